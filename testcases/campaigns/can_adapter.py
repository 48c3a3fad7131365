"""A serial-line CAN adapter, command by command: states of its channel, frames of all kinds, bit rates,
polling, status flags, time stamps, acceptance filter.
"""

from __future__ import annotations

from typing import Final

from emulators.adapter import ChannelState, SlcanAdapter
from fieldbus.can import CanFrame
from hil.campaign import Campaign, CaseContext
from testcases.campaigns.support import equal

CAMPAIGN: Final = Campaign(
    "can adapter", controller="", tags=("can",), bench="testcases.campaigns.can_bus:BENCH"
)
MS: Final = 1_000_000
BELL: Final = "\a"


class Adapter:
    """An adapter, its program and its bus.

    Args:
        ctx: The case.
        bitrate: Bit rate of the bus, bit/s; None: unknown.

    """

    def __init__(self, ctx: CaseContext, bitrate: int | None = None) -> None:
        self._ctx = ctx
        self.sent: list[CanFrame] = []
        self.takes = True
        self.states: list[ChannelState] = []
        self.device = SlcanAdapter(self._transmit, bitrate=bitrate, on_state=self.states.append)

    def _transmit(self, frame: CanFrame) -> bool:
        if self.takes:
            self.sent.append(frame)
        return self.takes

    def says(self, line: str, answer: str) -> None:
        """Send a command; expect the answer, CR left out."""
        found = self.device.feed(line.encode("latin-1") + b"\r").decode("latin-1")
        wanted = answer if answer.endswith(BELL) else answer + "\r"
        self.same(f"answer to {line!r}", found, wanted)

    def hears(self, frame: CanFrame, line: str, *, at_ns: int = 0, free: int = 10_000) -> None:
        """Give a frame from the bus; expect what goes to the program, CR left out; empty: nothing."""
        found = self.device.deliver(frame, at_ns, free=free).decode("latin-1")
        self.same(f"line for {frame}", found, line + "\r" if line else "")

    def same(self, what: str, found: object, wanted: object) -> None:
        """Expect a value of any kind."""
        equal(self._ctx, f"{what} is {wanted!r} (it is {found!r})", found == wanted, 1)


FRAMES: Final = (
    ("t1230", CanFrame(0x123), "z"),
    ("t7FF81122334455667788", CanFrame(0x7FF, bytes.fromhex("1122334455667788")), "z"),
    ("T000001231FF", CanFrame(0x123, b"\xff", extended=True), "Z"),
    ("T1FFFFFFF0", CanFrame(0x1FFFFFFF, extended=True), "Z"),
    ("r7018", CanFrame(0x701, remote=True, dlc=8), "z"),
    ("R1ABCDEF05", CanFrame(0x1ABCDEF0, remote=True, extended=True, dlc=5), "Z"),
)
WRONG: Final = (
    "t12", "t1239", "t123", "t1231", "t12311", "t1231AAB", "t800112", "t12G0", "t1231 1", "T00000123",
    "T200000000", "r12381", "R00000123", "x1230", "S9", "SA", "S", "S66", "O1", "C0", "X2", "X", "Z2",
    "M1234567", "m12345678A", "W2", "Q3", "U7", "F1", "V1", "N1", "\xff", "s12345", "P1", "t1230" + "0" * 100,
)  # fmt: skip


@CAMPAIGN.case("frames")
def frames(ctx: CaseContext) -> None:
    """Every kind of frame goes both ways; what is wrong gets BELL, sends nothing and changes no state."""
    adapter = Adapter(ctx)
    adapter.says("S6", "")
    adapter.says("O", "")
    for line, frame, answer in FRAMES:
        adapter.says(line, answer)
        adapter.same("sent", adapter.sent[-1:], [frame])
        adapter.hears(frame, line)
    count = len(adapter.sent)
    for number, line in enumerate(WRONG, 1):
        adapter.says(line, BELL)
        equal(ctx, "commands refused", adapter.device.rejected, number)
    equal(ctx, "frames sent by them", len(adapter.sent) - count, 0)
    adapter.says("", "")
    adapter.says("\nt1230", "z")
    adapter.takes = False
    adapter.says("t1230", BELL)
    adapter.says("F", "F02")
    adapter.takes = True
    adapter.says("F", "F00")
    adapter.says("V", "V1013")
    adapter.says("N", "NH1L0")


CLOSED_ONLY: Final = ("S4", "s031C", "X1", "Z0", "W0", "M00000000", "mFFFFFFFF", "U6")


@CAMPAIGN.case("states")
def states(ctx: CaseContext) -> None:
    """What configures is taken while the channel is closed, what sends and asks while it is open; it opens
    with a bit rate alone; a listening one sends nothing.
    """
    adapter = Adapter(ctx)
    for line in ("O", "L", "C", "F", "t1230", "P"):
        adapter.says(line, BELL)
    adapter.says("S6", "")
    adapter.says("O", "")
    for line in (*CLOSED_ONLY, "L", "O"):
        adapter.says(line, BELL)
    adapter.says("F", "F00")
    adapter.says("C", "")
    adapter.says("C", BELL)
    adapter.hears(CanFrame(0x10), "")
    for line in CLOSED_ONLY:
        adapter.says(line, "")
    adapter.says("L", "")
    for line in ("t1230", "r1230", "T000001230", "R000001230"):
        adapter.says(line, BELL)
    adapter.hears(CanFrame(0x10), "t0100")
    adapter.says("C", "")
    wanted = [ChannelState.OPEN, ChannelState.CLOSED, ChannelState.LISTENING, ChannelState.CLOSED]
    adapter.same("states", adapter.states, wanted)


RATES: Final = {
    "S0": 10_000, "S1": 20_000, "S2": 50_000, "S3": 100_000, "S4": 125_000, "S5": 250_000, "S6": 500_000,
    "S7": 800_000, "S8": 1_000_000, "s0014": 1_000_000, "s001C": 500_000, "s031C": 125_000, "s011C": 250_000,
}  # fmt: skip


@CAMPAIGN.case("bit-rates")
def bit_rates(ctx: CaseContext) -> None:
    """Bit rates by number and by registers; at another one than that of the bus nothing is understood, and
    frames stick until the queue is full.
    """
    for line, rate in RATES.items():
        adapter = Adapter(ctx, rate)
        adapter.says(line, "")
        equal(ctx, "bit rate", adapter.device.channel_bitrate or 0, rate)
        adapter.says("O", "")
        adapter.says("t1230", "z")
        equal(ctx, "frames on the bus", len(adapter.sent), 1)
    adapter = Adapter(ctx, 1_000_000)
    adapter.says("S6", "")
    adapter.says("O", "")
    adapter.hears(CanFrame(0x100), "")
    adapter.says("F", "F80")
    adapter.says("F", "F00")
    for _ in range(8):
        adapter.says("t1230", "z")
    adapter.says("F", "FA4")
    adapter.says("t1230", BELL)
    adapter.says("F", "F02")
    equal(ctx, "frames on the bus", len(adapter.sent), 0)
    for line in ("C", "S8", "O"):
        adapter.says(line, "")
    adapter.says("t1230", "z")
    equal(ctx, "frames on the bus", len(adapter.sent), 1)


@CAMPAIGN.case("polling")
def polling(ctx: CaseContext) -> None:
    """Without auto-poll frames wait: P gives one, A all; 32 have room, and the overflow is flagged until it
    is read; a line without room loses whole frames; time stamps wrap after a minute.
    """
    adapter = Adapter(ctx)
    for line in ("X0", "S6", "O", "P"):
        adapter.says(line, "")
    adapter.says("A", "A")
    for number in range(3):
        adapter.hears(CanFrame(0x100 + number), "")
    adapter.says("P", "t1000")
    adapter.says("A", "t1010\rt1020\rA")
    adapter.says("P", "")
    adapter.says("t1230", "")
    for number in range(32):
        adapter.hears(CanFrame(number), "")
    adapter.says("F", "F00")
    adapter.hears(CanFrame(0x32), "")
    adapter.says("F", "F09")
    adapter.says("F", "F00")
    adapter.says("A", "".join(f"t{number:03X}0\r" for number in range(32)) + "A")
    adapter.hears(CanFrame(0x10), "")
    adapter.says("C", "")
    adapter.says("O", "")
    adapter.says("P", "")
    adapter.says("C", "")
    for line in ("X1", "Z1", "O"):
        adapter.says(line, "")
    adapter.says("P", BELL)
    adapter.says("A", BELL)
    adapter.hears(CanFrame(0x123, b"\1"), "t12310104D2", at_ns=1_234 * MS)
    adapter.hears(CanFrame(0x123, remote=True, dlc=2), "r1232EA5F", at_ns=59_999 * MS)
    adapter.hears(CanFrame(0x123, remote=True, dlc=2), "r12320000", at_ns=60_000 * MS)
    adapter.hears(CanFrame(0x123, bytes(8)), "", free=25)
    adapter.says("F", "F09")
    adapter.hears(CanFrame(0x123, bytes(8)), "t123800000000000000000000", free=26)
    adapter.says("F", "F00")


FILTERS: Final = (
    (0x24600000, 0x001FFFFF, True, CanFrame(0x123), True),
    (0x24600000, 0x001FFFFF, True, CanFrame(0x122), False),
    (0x24600000, 0x000FFFFF, True, CanFrame(0x123, remote=True), False),
    (0x24601200, 0x001F00FF, True, CanFrame(0x123, b"\x12\x77"), True),
    (0x24601200, 0x001F00FF, True, CanFrame(0x123, b"\x13"), False),
    (0x24601234, 0x001F0000, True, CanFrame(0x123, b"\x12\x34"), True),
    (0x24601234, 0x001F0000, True, CanFrame(0x123, b"\x12\x35"), False),
    (0x24601234, 0x001F0000, True, CanFrame(0x123, b"\x12"), True),
    (0x24601200, 0x001F00FF, True, CanFrame(0x123), True),
    (0x091A2B38, 0x00000007, True, CanFrame(0x01234567, extended=True), True),
    (0x091A2B38, 0x00000007, True, CanFrame(0x01234566, extended=True), False),
    (0x091A2B38, 0x00000003, True, CanFrame(0x01234567, extended=True, remote=True), False),
    (0x24602480, 0x001F001F, False, CanFrame(0x123), True),
    (0x24602480, 0x001F001F, False, CanFrame(0x124), True),
    (0x24602480, 0x001F001F, False, CanFrame(0x125), False),
    (0x2461FFE2, 0xFFFF0010 & 0x0010FFF0, False, CanFrame(0x123, b"\x12"), True),
    (0x2461FFE2, 0xFFFF0010 & 0x0010FFF0, False, CanFrame(0x123, b"\x13"), False),
    (0x091A0000, 0x00000000, False, CanFrame(0x01234567, extended=True), True),
    (0x091A0000, 0x00000000, False, CanFrame(0x01434567, extended=True), False),
    (0x091A0000, 0x00000000, False, CanFrame(0x00001000, extended=True), True),
)
"""Code, mask, one pattern or two, frame, whether it is taken."""


@CAMPAIGN.case("filter")
def acceptance(ctx: CaseContext) -> None:
    """Code and mask pick frames as the registers of the controller do, with one pattern and with two."""
    for code, mask, single, frame, taken in FILTERS:
        adapter = Adapter(ctx)
        for line in (f"W{single:d}", f"M{code:08X}", f"m{mask:08X}", "S6", "O"):
            adapter.says(line, "")
        found = bool(adapter.device.deliver(frame, 0, free=99))
        equal(ctx, f"{frame} by {code:08X}h, {mask:08X}h, single {single}", found, taken)
    adapter = Adapter(ctx)
    for line in ("S6", "O"):
        adapter.says(line, "")
    adapter.hears(CanFrame(0x7FF), "t7FF0")
