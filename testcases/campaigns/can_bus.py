"""The virtual CAN segment bit by bit: lengths, arbitration, errors and counters, bus-off, CAN FD, and
programs on it. Plain nodes on a segment of their own; expected are the bits, counters and times of ISO
11898-1.
"""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, Final

import can

from fieldbus.can import BitError, CanFrame, CanMedium, HookResult, NodeState
from fieldbus.can.analysis import PeriodicFrame, arrival_statistics, arrivals, planned_load, response_time_ns
from fieldbus.can.export import read_log, write_log
from fieldbus.can.message import read_error
from hil.bench import BenchFile
from hil.campaign import Campaign, CaseContext
from hil.expect.rules._can_length import length_of
from testcases.campaigns.support import equal

BENCH: Final = BenchFile(
    "can bus",
    '[bench]\nname = "can bus"\nkind = "virtual"\ncycle_ms = 4\n[segment.can0]\n'
    '[encoder.encoder1]\nsegment = "can0"\nnode_id = 9\ntype = "multi_turn"\n',
)
CAMPAIGN: Final = Campaign("can bus", controller="", tags=("can",), bench="testcases.campaigns.can_bus:BENCH")
US, MS = 1_000, 1_000_000
ACTIVE, PASSIVE, OFF = NodeState.ERROR_ACTIVE, NodeState.ERROR_PASSIVE, NodeState.BUS_OFF
STANDARD, EXTENDED = 11, 29


class Segment:
    """A segment with nodes of its own; at 1 Mbit/s a bit takes 1 us.

    Args:
        ctx: The case.
        names: Nodes on it.
        bitrate: Bit rate, bit/s.
        data_bitrate: That of the data phase of CAN FD, bit/s; None: a classical segment.
        options: Of all nodes.

    """

    def __init__(
        self,
        ctx: CaseContext,
        names: str = "abc",
        *,
        bitrate: int = 1_000_000,
        data_bitrate: int | None = None,
        **options: Any,
    ) -> None:
        self.ctx = ctx
        own: Any = ctx.bench.segment("can0")
        self.scheduler = own.scheduler
        self.medium = CanMedium(self.scheduler, bitrate=bitrate, data_bitrate=data_bitrate, name="lab")
        self.errors: list[tuple[str, str, str]] = []
        self.medium.bus_error_listeners.append(
            lambda _time, port, code, _frame, field: self.errors.append((port, code.value, field))
        )
        self.received: dict[str, list[tuple[int, CanFrame]]] = {}
        self.begun_ns = self.scheduler.now
        for name in names:
            self.attach(name, **options)

    def attach(self, name: str, **options: Any) -> Any:
        """Connect a node; what it receives is kept with its time."""
        heard = self.received.setdefault(name, [])
        return self.medium.attach(name, lambda frame, at_ns: heard.append((at_ns, frame)), **options)

    def __getitem__(self, name: str) -> Any:
        return self.medium.port(name)

    def run_us(self, us: float) -> None:
        """Let time pass."""
        self.ctx.run_for(us / 1e6)

    def heard(self, name: str) -> list[CanFrame]:
        """Return what a node has received."""
        return [frame for _, frame in self.received[name]]

    def counters(self) -> list[int]:
        """Return transmit and receive counters of all nodes, one after the other."""
        return [value for port in self.medium.ports for value in (port.tec, port.rec)]

    def ends_us(self) -> list[float]:
        """Return when the attempts so far have ended, us from the begin."""
        return [(at_ns - self.begun_ns) / US for at_ns, *_ in self.medium.log]

    def corrupt(self, count: int = 1, error: BitError | None = None) -> None:
        """Let the next frame fail so many times."""

        def hook(*_: object) -> HookResult:
            remove()
            return HookResult.corrupt(count, error)

        remove = self.medium.add_hook(hook)

    def is_so(self, what: str, found: object, wanted: object, *ids: str) -> None:
        """Expect a value of any kind."""
        equal(self.ctx, f"{what} is {wanted} (it is {found})", found == wanted, 1, *ids)


CONTENTS: Final = {"zeros": b"\0" * 8, "ones": b"\xff" * 8, "dense": b"\xf8" * 8, "plain": b"\x55" * 8}


@CAMPAIGN.product(
    "length/{content}-{bits}",
    parameters={"content": tuple(CONTENTS), "bits": (STANDARD, EXTENDED)},
    title="length of frames with {bits} bits of identifier, content {content}",
    requirements=("CANP-012", "CANP-014", "CANP-015", "CANP-016", "CANP-017"),
)
def length(ctx: CaseContext, content: str, bits: int) -> None:
    """Every length of data, data and remote frames: the end is exact to the bit, and within its bounds."""
    segment = Segment(ctx, "ab")
    plain = 44 if bits == STANDARD else 64
    for can_id in (0, 0x123, (1 << bits) - 1):
        for size in range(9):
            for remote in (False, True):
                frame = CanFrame(
                    can_id,
                    b"" if remote else CONTENTS[content][:size],
                    extended=bits == EXTENDED,
                    remote=remote,
                    dlc=size,
                )
                begun = segment.scheduler.now
                segment["a"].send(frame)
                segment.run_us(200)
                at_ns, got = segment.received["b"].pop()
                took = (at_ns - begun) / US
                what = f"{frame}: bits"
                equal(ctx, what, took, length_of(frame), "CANP-017")
                least = plain + (0 if remote else 8 * size)
                most = least + (least - 10 - 1) // 4
                equal(ctx, f"{what} within the bounds", least <= took <= most, 1, "CANP-016")
                equal(ctx, f"{what}: content as it was sent", got == frame, 1, "CANP-009")
    equal(ctx, "errors", len(segment.errors), 0)


@CAMPAIGN.product(
    "rates/{bitrate}",
    parameters={"bitrate": (1_000_000, 800_000, 500_000, 250_000, 125_000, 50_000, 20_000, 10_000)},
    title="frames at {bitrate} bit/s",
    requirements=("CANP-060", "CANP-069"),
)
def rates(ctx: CaseContext, bitrate: int) -> None:
    """A frame takes its bits at the rate; the load counts them with the intermission, in all and in a window;
    a DLC above 8 is passed on with its eight bytes.
    """
    segment = Segment(ctx, "ab", bitrate=bitrate)
    frame = CanFrame(0x181, b"\x55" * 8, dlc=12)
    bit_s = 1 / bitrate
    bits = length_of(frame)
    for _ in range(3):
        segment["a"].send(frame)
    ctx.run_for(1000 * bit_s)
    times = [at_ns / 1e9 for at_ns, _ in segment.received["b"]]
    equal(ctx, "frames", len(times), 3)
    equal(ctx, "first end, bits", (times[0] - segment.begun_ns / 1e9) / bit_s, bits, within=0.01)
    for earlier, later in pairwise(times):
        equal(ctx, "gap, bits", (later - earlier) / bit_s, bits + 3, "CANP-008", within=0.01)
    segment.is_so("frame", segment.heard("b")[-1], frame, "CANP-010")
    equal(ctx, "bits on the bus", segment.medium.busy_bits, 3 * (bits + 3), "CANP-069")
    equal(ctx, "load", segment.medium.bus_load(), 3 * (bits + 3) / 1000, "CANP-069", within=1e-3)
    ctx.run_for(1000 * bit_s)
    equal(ctx, "load of the second half", segment.medium.bus_load(round(1000 * bit_s * 1e9)), 0.0, "CANP-069")


# -- arbitration --------------------------------------------------------------------------------------------


@CAMPAIGN.case("arbitration", requirements=("CANP-011", "CANP-027", "CANP-028", "CANP-030", "CANP-031"))
def arbitration(ctx: CaseContext) -> None:
    """All frames of an instant go in the order of their bits: data before remote, 11 bits before 29; the
    losers go without an error, and each node offers its highest frame.
    """
    ranked = [
        CanFrame(0x000, b"\1"),
        CanFrame(0x0FF, b"\2"),
        CanFrame(0x100, b"\3"),
        CanFrame(0x100, remote=True),
        CanFrame(0x100 << 18, b"\4", extended=True),
        CanFrame(0x100 << 18, extended=True, remote=True),
        CanFrame((0x100 << 18) + 1, b"\5", extended=True),
        CanFrame(0x101, b"\6"),
        CanFrame(0x7F0, b"\7"),
        CanFrame(0x7FF, b"\10"),
    ]
    segment = Segment(ctx, "ear")
    for number, place in enumerate((7, 2, 9, 0, 5, 4, 8, 1, 6, 3)):
        node = f"n{number % 5}"
        if node not in segment.received:
            segment.attach(node)
        segment[node].send(ranked[place])
    segment.run_us(3000)
    segment.is_so("order", segment.heard("e"), ranked, "CANP-028")
    equal(ctx, "counters", sum(segment.counters()), 0, "CANP-027")
    for earlier, later, frame in zip(segment.ends_us(), segment.ends_us()[1:], ranked[1:], strict=False):
        equal(ctx, "from end to end, bits", later - earlier, 3 + length_of(frame), "CANP-031")


@CAMPAIGN.case("arbitration/intermission", requirements=("CANP-027", "CANP-031", "CANP-070"))
def intermission(ctx: CaseContext) -> None:
    """What comes before the end of the intermission takes part; what comes a bit later waits for one frame at
    most, however high it ranks.
    """
    segment = Segment(ctx)
    low, high = CanFrame(0x700, bytes(8)), CanFrame(0x080)
    for late in (-1, 2):
        begun = segment.scheduler.now
        count = len(segment.medium.log)
        for _ in range(2):
            segment["a"].send(low)
        at = begun + (length_of(low) + 3 + late) * US
        segment.scheduler.at(at, lambda: segment["b"].send(high))
        segment.run_us(1000)
        order = [frame.can_id for _, _, frame, _ in segment.medium.log[count:]]
        wanted = [0x700, 0x080, 0x700] if late < 0 else [0x700, 0x700, 0x080]
        segment.is_so(
            f"order with the higher one {late} bits after the intermission", order, wanted, "CANP-027"
        )


@CAMPAIGN.case("arbitration/same", requirements=("CANP-029", "CANP-037"))
def same(ctx: CaseContext) -> None:
    """Equal frames pass unnoticed if a third node acknowledges; unequal ones destroy each other until both
    are error-passive, and then both get through.
    """
    frame = CanFrame(0x181, b"\x55" * 8)
    segment = Segment(ctx)
    for name in "ab":
        segment[name].send(frame)
    segment.run_us(1000)
    segment.is_so("what c has got", segment.heard("c"), [frame], "CANP-029")
    equal(ctx, "counters", sum(segment.counters()), 0, "CANP-029")
    alone = Segment(ctx, "ab")
    for name in "ab":
        alone[name].send(frame)
    alone.run_us(150)
    segment.is_so("counters without a third node", alone.counters(), [8, 0, 8, 0], "CANP-037")
    segment = Segment(ctx, auto_recovery=False)
    one, other = CanFrame(0x181, b"\0\0"), CanFrame(0x181, b"\0\1")
    segment["a"].send(one)
    segment["b"].send(other)
    segment.run_us(100)
    segment.is_so("counters after the first attempt", segment.counters(), [8, 0, 8, 0, 0, 1], "CANP-029")
    segment.run_us(10_000)
    segment.is_so(
        "outcome of the attempts",
        [error for *_, error in segment.medium.log][:17],
        ["BIT_ERROR"] * 16 + [""],
        "CANP-029",
    )
    segment.is_so("what c has got", segment.heard("c"), [one, other], "CANP-030")
    segment.is_so("counters in the end", segment.counters()[:4:2], [127, 135], "CANP-051")


# -- errors -------------------------------------------------------------------------------------------------

FRAME: Final = CanFrame(0x2AA, b"\x55\x55")
"""No stuff bits before its CRC."""
ALL, SENDER, ONE, BOTH = None, frozenset("a"), frozenset("b"), frozenset("bc")
PLACES: Final[dict[str, tuple[BitError, str, str, int, list[int]]]] = {
    "crc-of-sender": (BitError("crc", -1, SENDER), "a", "BIT_ERROR", 7, [8, 0, 0, 1, 0, 1]),
    "crc-delimiter": (BitError("crc_delimiter", 0, ALL), "a", "FORM_ERROR", 7, [8, 0, 0, 1, 0, 1]),
    "ack-slot": (BitError("ack_slot", 0, SENDER), "a", "ACK_ERROR", 9, [8, 0, 0, 1, 0, 1]),
    "crc-of-both": (BitError("data", 3, BOTH), "a", "ACK_ERROR", 9, [8, 0, 0, 1, 0, 1]),
    "crc-of-one": (BitError("data", 3, ONE), "b", "CRC_ERROR", 10, [8, 0, 0, 9, 0, 1]),
    "ack-delimiter": (BitError("ack_delimiter", 0, ALL), "a", "FORM_ERROR", 9, [8, 0, 0, 1, 0, 1]),
    "eof-of-one": (BitError("eof", 2, ONE), "b", "FORM_ERROR", 13, [8, 0, 0, 9, 0, 1]),
    "eof-of-sender": (BitError("eof", 5, SENDER), "a", "FORM_ERROR", 16, [8, 0, 0, 0, 0, 0]),
    "last-of-eof": (BitError("eof", 6, ALL), "a", "FORM_ERROR", 16, [8, 0, 0, 0, 0, 0]),
}
"""Where a bit is read wrongly by whom; who reports what; bits from the end of the CRC to the end of the
flags; transmit and receive counters of a, b, c.
"""


@CAMPAIGN.product(
    "error/{place}",
    parameters={"place": tuple(PLACES)},
    title="bit error: {place}",
    requirements=(
        "CANP-033",
        "CANP-035",
        "CANP-036",
        "CANP-037",
        "CANP-038",
        "CANP-043",
        "CANP-044",
        "CANP-045",
    ),
)
def error(ctx: CaseContext, place: str) -> None:
    """Who notices what, how long the error frame is, what it costs, and that the frame comes again."""
    segment = Segment(ctx)
    wrong, who, code, bits, counters = PLACES[place]
    segment.corrupt(1, wrong)
    segment["a"].send(FRAME)
    begin = segment.scheduler.now
    attempt = length_of(FRAME) - 10 + bits + 8
    segment.scheduler.at(begin + attempt * US + US // 2, lambda: found.extend(segment.counters()))
    found: list[int] = []
    segment.run_us(1000)
    segment.is_so("first report", segment.errors[0][:2], (who, code), "CANP-033")
    twice = place in ("last-of-eof", "eof-of-sender")
    log = [outcome for *_, outcome in segment.medium.log]
    if place == "last-of-eof":
        segment.is_so("outcomes", log, ["", "FORM_ERROR", ""], "CANP-013")
    elif place != "eof-of-sender":
        segment.is_so("outcomes", log, [code, ""], "CANP-030")
        equal(ctx, "end of the attempt, bits", segment.ends_us()[0], attempt, "CANP-038")
        gap = segment.ends_us()[1] - segment.ends_us()[0]
        equal(ctx, "until the end of the repetition, bits", gap, 3 + length_of(FRAME), "CANP-042")
    segment.is_so("counters after the attempt", found, counters, "CANP-045")
    for name in "bc":
        segment.is_so(f"what {name} has got", segment.heard(name), [FRAME] * (1 + twice), "CANP-013")
    equal(ctx, "transmit counter after the repetition", segment["a"].tec, 7, "CANP-051")


@CAMPAIGN.case("error/stuff", requirements=("CANP-033", "CANP-034", "CANP-043", "CANP-044", "CANP-047"))
def stuff(ctx: CaseContext) -> None:
    """A stuff bit read wrongly: of one receiver, and of the sender in its arbitration (free) and behind
    it.
    """
    segment = Segment(ctx)
    segment.corrupt(1, BitError("stuff", 0, ONE))
    segment["a"].send(CanFrame(0x0F8))
    segment.run_us(60)
    segment.is_so("first report", segment.errors[0][:2], ("b", "BIT_STUFFING_ERROR"), "CANP-034")
    segment.is_so("counters", segment.counters(), [8, 0, 0, 9, 0, 1], "CANP-044")
    for number, code, counter in ((0, "BIT_STUFFING_ERROR", 0), (2, "BIT_ERROR", 8)):
        segment = Segment(ctx)
        segment.corrupt(1, BitError("stuff", number))
        segment["a"].send(CanFrame(0x003, b"\0"))
        segment.run_us(62)
        segment.is_so("first report", segment.errors[0][:2], ("a", code), "CANP-033")
        equal(ctx, "transmit counter", segment["a"].tec, counter, "CANP-047")


@CAMPAIGN.product(
    "overload/{what}",
    parameters=[
        {"what": "first-bit", "bit": 0, "requested": 0, "extra": 1 + 6 + 8},
        {"what": "second-bit", "bit": 1, "requested": 0, "extra": 2 + 6 + 8},
        {"what": "one-frame", "bit": -1, "requested": 1, "extra": 15},
        {"what": "two-frames", "bit": -1, "requested": 2, "extra": 30},
        {"what": "none", "bit": -1, "requested": 0, "extra": 0},
    ],
    title="overload: {what}",
    requirements=("CANP-041",),
)
def overload(ctx: CaseContext, what: str, bit: int, requested: int, extra: int) -> None:
    """Overload frames hold the next frame back by flag and delimiter, and no counter moves."""
    del what
    segment = Segment(ctx)
    if bit >= 0:
        segment.corrupt(1, BitError("intermission", bit))
    segment["b"].set_overload_frames(requested)
    for _ in range(2):
        segment["a"].send(FRAME)
    segment.run_us(1000)
    ends = segment.ends_us()
    gap = ends[1] - ends[0] - 3 - length_of(FRAME)
    equal(
        ctx,
        "bits between the frames beyond the intermission",
        gap,
        extra,
        "CANP-041",
        within=1.0 if requested else 0,
    )
    equal(ctx, "counters", sum(segment.counters()), 0, "CANP-041")
    segment.is_so("what c has got", segment.heard("c"), [FRAME] * 2)


# -- confinement --------------------------------------------------------------------------------------------


@CAMPAIGN.case("confinement/alone", requirements=("CANP-037", "CANP-042", "CANP-046", "CANP-056"))
def alone(ctx: CaseContext) -> None:
    """A node alone becomes passive with its 16th attempt and stays so; then it waits 8 more bits each time; a
    partner gets the frame, and the counter goes down by one with each frame.
    """
    frame = CanFrame(0x181, b"\x55" * 8)
    segment = Segment(ctx, "ab")
    segment["b"].online = False
    segment["a"].send(frame)
    attempt = length_of(frame) - 8 + 6 + 8
    for number in range(1, 18):
        before = len(segment.medium.log)
        ctx.wait_until(lambda before=before: len(segment.medium.log) > before, 0.01, "an attempt ends")
        equal(ctx, f"counter after attempt {number}", segment["a"].tec, min(8 * number, 128), "CANP-046")
        state = ACTIVE if number < 16 else PASSIVE
        segment.is_so("state", segment["a"].state, state, "CANP-053")
        equal(ctx, "warning", segment["a"].warning, number >= 12, "CANP-053")
    gaps = [later - earlier for earlier, later in pairwise(segment.ends_us())]
    equal(ctx, "first attempt, bits", segment.ends_us()[0], attempt, "CANP-038")
    segment.is_so("gaps", gaps, [attempt + 3.0] * 15 + [attempt + 11.0], "CANP-042")
    segment.run_us(20_000)
    equal(ctx, "counter", segment["a"].tec, 128, "CANP-056")
    segment["b"].online = True
    segment.run_us(500)
    segment.is_so("what b has got", segment.heard("b"), [frame], "CANP-030")
    segment.is_so("state", segment["a"].state, ACTIVE, "CANP-053")
    for left in (127, 126, 125):
        equal(ctx, "counter", segment["a"].tec, left, "CANP-051")
        segment["a"].send(frame)
        segment.run_us(300)


@CAMPAIGN.product(
    "confinement/bus-off-{recovery}",
    parameters={"recovery": ("automatic", "asked")},
    title="bus-off and recovery, {recovery}",
    requirements=("CANP-045", "CANP-053", "CANP-054", "CANP-055", "CANP-057"),
)
def bus_off(ctx: CaseContext, recovery: str) -> None:
    """32 failures lead to bus-off with the state reported as it changes; 128 times 11 recessive bits lead out
    of it, at once or on request, and not a bit earlier.
    """
    segment = Segment(ctx, "ab", auto_recovery=recovery == "automatic")
    a = segment["a"]
    changes: list[tuple[object, object, int]] = []
    a.on_state.append(lambda old, new: changes.append((old, new, a.tec)))
    segment.corrupt(1000)
    a.send(FRAME)
    a.send(CanFrame(0x182))
    ctx.wait_until(lambda: a.state is OFF, 0.1, "a is bus-off")
    off = segment.scheduler.now
    segment.run_us(30)
    segment.is_so("changes", changes, [(ACTIVE, PASSIVE, 128), (PASSIVE, OFF, 256)], "CANP-053")
    segment.is_so("attempts", [one for *_, one in segment.medium.log], ["BIT_ERROR"] * 32, "CANP-057")
    equal(ctx, "receive counter of the other", segment["b"].rec, 32, "CANP-043")
    equal(ctx, "frames that wait", a.pending, 0, "CANP-054")
    extra = 9.0  # flag of the other node, which notices a passive flag by a stuff error
    if recovery == "asked":
        segment.run_us(5_000)
        segment.is_so("state", a.state, OFF, "CANP-055")
        a.recover()
        off, extra = segment.scheduler.now, 0.0
        segment.run_us(700)
        a.recover()
    ctx.wait_until(lambda: a.state is ACTIVE, 0.1, "a is back")
    equal(ctx, "recovery, bits", (segment.scheduler.now - off) / US, 1408 + extra, "CANP-055")
    segment.is_so("counters of a", segment.counters()[:2], [0, 0], "CANP-055")
    a.send(FRAME)
    segment.run_us(500)
    segment.is_so("what b has got", segment.heard("b"), [FRAME], "CANP-055")
    equal(ctx, "receive counter of the other after a good frame", segment["b"].rec, 31, "CANP-052")


@CAMPAIGN.case("confinement/bus-off-again", requirements=("CANP-055",))
def bus_off_again(ctx: CaseContext) -> None:
    """Every recovery needs its own 128 sequences: what was counted between the frames of others the last time
    does not count again, whether that recovery has ended or was interrupted by switching off.
    """
    segment = Segment(ctx, "abc", auto_recovery=True)
    a, b = segment["a"], segment["b"]
    for interrupted in (False, True):
        a.set_error_counters(tec=256)
        for _ in range(5):
            segment.run_us(210)
            b.send(FRAME)
        if interrupted:
            a.online = False
            segment.run_us(300)
            a.online = True
            segment.run_us(300)
        else:
            ctx.wait_until(lambda: a.state is ACTIVE, 0.1, "a is back")
        segment.run_us(2_000)
        a.set_error_counters(tec=256)
        off = segment.scheduler.now
        ctx.wait_until(lambda: a.state is ACTIVE, 0.1, "a is back once more")
        equal(ctx, "recovery, bits", (segment.scheduler.now - off) / US, 1408, "CANP-055", within=11)


@CAMPAIGN.case("confinement/counters", requirements=("CANP-052", "CANP-053", "CANP-054", "CANP-059"))
def counters(ctx: CaseContext) -> None:
    """State and warning by the counters at each of their borders; a good frame takes one off, and from above
    127 the receive counter falls to 119.
    """
    for tec, rec, state, warning in (
        (0, 0, ACTIVE, 0),
        (95, 95, ACTIVE, 0),
        (96, 0, ACTIVE, 1),
        (0, 96, ACTIVE, 1),
        (127, 127, ACTIVE, 1),
        (128, 0, PASSIVE, 1),
        (0, 128, PASSIVE, 1),
        (255, 255, PASSIVE, 1),
        (256, 0, OFF, 1),
    ):
        segment = Segment(ctx, "ab", auto_recovery=False)
        segment["b"].set_error_counters(tec=tec, rec=rec)
        segment.is_so(f"state with {tec}, {rec}", segment["b"].state, state, "CANP-053")
        equal(ctx, "warning", segment["b"].warning, warning, "CANP-053")
        segment["a"].send(FRAME)
        segment.run_us(150)
        after = rec if state is OFF else 0 if rec == 0 else 119 if rec > 127 else rec - 1
        equal(ctx, "receive counter after a good frame", segment["b"].rec, after, "CANP-052")
        equal(ctx, "acknowledged", segment.medium.log[0][3] == "", state is not OFF, "CANP-054")
        if state is not OFF:
            segment["b"].send(FRAME)
            segment.run_us(150)
            equal(ctx, "transmit counter after a good frame", segment["b"].tec, max(tec - 1, 0), "CANP-051")


@CAMPAIGN.case("confinement/suspend", requirements=("CANP-008", "CANP-042"))
def suspend(ctx: CaseContext) -> None:
    """A passive sender waits 8 bits after a frame of its own; another node may start meanwhile, and after its
    frame there is no such wait.
    """
    low, high = CanFrame(0x700, bytes(8)), CanFrame(0x100, bytes(8))
    for tec, extra in ((127, 0), (128, 8), (200, 8)):
        segment = Segment(ctx)
        segment["a"].set_error_counters(tec=tec + 1 if tec == 127 else tec)
        segment["a"].set_error_counters(tec=tec)
        for _ in range(2):
            segment["a"].send(high)
        segment.run_us(600)
        # The first good frame takes one off: from 128 to 127 the sender is active again.
        wait = 0 if tec <= 128 else extra
        ends = segment.ends_us()
        equal(ctx, f"gap with {tec}, bits", ends[1] - ends[0], 3 + wait + length_of(high), "CANP-008")
    segment = Segment(ctx)
    segment["a"].set_error_counters(tec=200)
    for _ in range(2):
        segment["a"].send(high)
    at = segment.scheduler.now + (length_of(high) + 3 + 5) * US
    segment.scheduler.at(at, lambda: segment["b"].send(low))
    segment.run_us(1000)
    segment.is_so(
        "order", [frame.can_id for _, _, frame, _ in segment.medium.log], [0x100, 0x700, 0x100], "CANP-042"
    )
    ends = segment.ends_us()
    equal(ctx, "begin of the other, bits", ends[1] - ends[0], 3 + 5 + length_of(low), "CANP-042")
    equal(ctx, "after its frame, bits", ends[2] - ends[1], 3 + length_of(high), "CANP-042")


@CAMPAIGN.case("disturbed/held", requirements=("CANP-050", "CANP-078"))
def held(ctx: CaseContext) -> None:
    """A bus held dominant costs 8 more for every 8 bits beyond a flag; released, frames pass again; held
    recessive nobody is heard.
    """
    segment = Segment(ctx, auto_recovery=False)
    segment["a"].send(FRAME)
    segment.run_us(20)
    segment.medium.hold_level(0)
    seen: list[list[int]] = []
    for _ in range(4):
        segment.run_us(40)
        seen.append(segment.counters())
    for earlier, later in pairwise(seen):
        for place, node in enumerate("abc"):
            column = 2 * place + (node != "a")
            grown = later[column] - earlier[column]
            equal(ctx, f"growth of the counter of {node} in 40 bits", grown, 40, "CANP-050", within=0)
    segment.medium.hold_level(None)
    ctx.run_for(0.002)
    segment["b"].send(CanFrame(0x10))
    segment.run_us(500)
    equal(ctx, "b is heard", CanFrame(0x10) in segment.heard("c"), 1, "CANP-078")
    segment = Segment(ctx)
    segment.medium.hold_level(1)
    segment["a"].send(FRAME)
    segment.run_us(300)
    equal(ctx, "frames heard", len(segment.heard("b")), 0, "CANP-078")
    equal(ctx, "errors of the sender", segment["a"].tec >= 8, 1, "CANP-033")
    segment.medium.hold_level(None)
    segment.run_us(1000)
    equal(ctx, "frames heard", len(segment.heard("b")), 1, "CANP-030")


@CAMPAIGN.case("disturbed/idle", requirements=("CANP-078", "CANP-034"))
def idle(ctx: CaseContext) -> None:
    """A single dominant bit on an idle bus is a start of frame that nobody continues: a stuff error for
    each.
    """
    segment = Segment(ctx)
    segment.medium.flip_bit()
    segment.run_us(100)
    segment.is_so("counters", segment.counters(), [0, 1, 0, 1, 0, 1], "CANP-043")
    equal(
        ctx,
        "stuff errors",
        sum(code == "BIT_STUFFING_ERROR" for _, code, _ in segment.errors) >= 1,
        1,
        "CANP-034",
    )
    segment["a"].send(FRAME)
    segment.run_us(200)
    segment.is_so("what b has got", segment.heard("b"), [FRAME])


@CAMPAIGN.case("disturbed/cable", requirements=("CANP-078", "CANP-068"))
def cable(ctx: CaseContext) -> None:
    """Cut nodes hear their own side alone; a node of another rate hears nobody; each comes back."""
    segment = Segment(ctx, "abcd")
    repair = segment.medium.cut("cd")
    for name, can_id in (("a", 0x10), ("c", 0x30)):
        segment[name].send(CanFrame(can_id))
    segment.run_us(500)
    heard = {name: [frame.can_id for frame in segment.heard(name)] for name in "abcd"}
    segment.is_so("heard by each", heard, {"a": [], "b": [0x10], "c": [], "d": [0x30]}, "CANP-078")
    repair()
    repair()
    segment["a"].send(CanFrame(0x11))
    segment.run_us(500)
    equal(ctx, "the other side hears again", CanFrame(0x11) in segment.heard("d"), 1, "CANP-078")
    segment["d"].set_bitrate(500_000)
    segment["a"].send(CanFrame(0x12))
    segment.run_us(3000)
    equal(ctx, "heard by the node of another rate", CanFrame(0x12) in segment.heard("d"), 0, "CANP-068")
    equal(ctx, "heard by the others", CanFrame(0x12) in segment.heard("b"), 1, "CANP-068")
    segment["d"].set_bitrate(None)
    segment["d"].set_error_counters(tec=0, rec=0)
    segment.run_us(3000)
    segment["a"].send(CanFrame(0x13))
    segment.run_us(500)
    equal(ctx, "heard again", CanFrame(0x13) in segment.heard("d"), 1, "CANP-068")


@CAMPAIGN.case("nodes", requirements=("CANP-030", "CANP-059"))
def nodes(ctx: CaseContext) -> None:
    """Listening, one-shot, silent, late, offline and full nodes; confirmation and withdrawal of own
    frames.
    """
    sent: list[CanFrame] = []
    segment = Segment(ctx, "a")
    segment.attach("ear", listen_only=True)
    segment["a"].send(FRAME)
    segment.run_us(200)
    equal(ctx, "a listening node acknowledges", segment["a"].tec, 8, "CANP-006", within=8)
    equal(ctx, "and hears nothing that nobody acknowledges", len(segment.heard("ear")), 0, "CANP-006")
    segment.attach("b")
    segment["b"].set_acknowledge(False)
    segment.run_us(500)
    equal(ctx, "a node without acknowledge hears it", len(segment.heard("b")), 0, "CANP-059")
    segment["b"].set_acknowledge(True)
    segment.run_us(500)
    for name in ("b", "ear"):
        segment.is_so(f"what {name} has got", segment.heard(name), [FRAME], "CANP-006")
    once = segment.attach("once", one_shot=True, tx_buffers=2, confirm=lambda frame, _at: sent.append(frame))
    segment.corrupt(1)
    once.send(FRAME)
    segment.run_us(500)
    equal(ctx, "a one-shot frame is not repeated", len(segment.heard("b")), 1, "CANP-030")
    segment.is_so("confirmed", sent, [], "CANP-030")
    for can_id in (0x20, 0x21, 0x22, 0x23, 0x24):
        once.send(CanFrame(can_id))
    equal(ctx, "frames that wait", once.pending, 2, "CANP-078", within=1)
    equal(ctx, "frames refused", once.overruns, 3, "CANP-078", within=1)
    segment.run_us(1000)
    segment.is_so("confirmed", [f.can_id for f in sent], [0x20, 0x21, 0x22][: len(sent)], "CANP-031")
    equal(ctx, "refused and sent", once.overruns + len(sent), 5, "CANP-078")
    segment["b"].receive_delay_ns = 300 * US
    begun = segment.scheduler.now
    segment["a"].send(FRAME)
    segment.run_us(1000)
    late = (segment.received["b"][-1][0] - begun) / US
    equal(ctx, "delayed delivery, us", late, length_of(FRAME) + 300, "CANP-078")
    segment["b"].online = False
    segment["a"].send(CanFrame(0x31))
    segment["b"].online = True
    segment.run_us(500)
    equal(ctx, "missed while offline", CanFrame(0x31) in segment.heard("once"), 1)
    segment["a"].send_all([CanFrame(0x42), CanFrame(0x41), CanFrame(0x43)])
    segment["a"].withdraw({(0x43, False)})
    segment.run_us(500)
    found = [frame.can_id for frame in segment.heard("once") if 0x40 <= frame.can_id < 0x50]
    equal(ctx, f"withdrawn frame in {found}", 0x43 in found, 0)
    equal(ctx, "others", sorted(found) == [0x41, 0x42], 1)
    segment["a"].send(CanFrame(0x50))
    segment["a"].send(CanFrame(0x51))
    segment["a"].flush()
    segment.run_us(500)
    equal(ctx, "flushed frame", CanFrame(0x51) in segment.heard("once"), 0)


@CAMPAIGN.product(
    "hook/{what}",
    parameters={"what": ("drop", "delay", "replace", "duplicate", "corrupt")},
    title="a frame is hit: {what}",
    requirements=("CANP-078",),
)
def hook(ctx: CaseContext, what: str) -> None:
    """What a hook does to a frame, when, and that it does nothing to others and nothing when it is gone."""
    segment = Segment(ctx, "ab")
    victim, other, new = CanFrame(0x100, b"first"), CanFrame(0x200, b"second"), CanFrame(0x0AB, b"new")
    result = {
        "drop": HookResult.drop(),
        "delay": HookResult.delay(MS),
        "replace": HookResult.replace(new),
        "duplicate": HookResult.duplicate(2),
        "corrupt": HookResult.corrupt(3),
    }[what]
    remove = segment.medium.add_hook(lambda frame, _sender, _at: result if frame.can_id == 0x100 else None)
    for frame in (victim, other):
        segment["a"].send(frame)
    segment.run_us(3000)
    wanted = {
        "drop": [other],
        "delay": [other, victim],
        "replace": [new, other],
        "duplicate": [victim] * 3 + [other],
        "corrupt": [victim, other],
    }[what]
    segment.is_so("heard", segment.heard("b"), wanted, "CANP-078")
    if what == "delay":
        at_us = (segment.received["b"][1][0] - segment.begun_ns) / US
        equal(ctx, "end of the delayed frame, us", at_us, 1000 + length_of(victim), "CANP-078")
    if what == "corrupt":
        equal(ctx, "failed attempts", sum(bool(error) for *_, error in segment.medium.log), 3, "CANP-078")
        equal(ctx, "transmit counter", segment["a"].tec, 3 * 8 - 2, "CANP-045")
    remove()
    remove()
    segment["a"].send(victim)
    segment.run_us(300)
    segment.is_so("heard without the hook", segment.heard("b")[len(wanted) :], [victim])
    segment.medium.inject(CanFrame(0x7AA))
    segment.medium.inject(CanFrame(0x7AB))
    equal(ctx, "injected frames that wait", segment.medium.injected("fault"), 1, within=1)
    segment.medium.withdraw("fault")
    segment.run_us(500)
    injected = [frame.can_id for frame in segment.heard("b") if frame.can_id >= 0x700]
    equal(ctx, f"injected frames {injected}", len(injected), 1, within=1)
    equal(ctx, "injected frames that wait", segment.medium.injected("fault"), 0)


# -- CAN FD -------------------------------------------------------------------------------------------------

NOMINAL, DATA = 500_000, 2_000_000


def fd_length_ns(frame: CanFrame, nominal: int = NOMINAL, data: int = DATA) -> float:
    """Return the duration of a CAN FD frame up to its EOF, counted in characters (CANP-073, CANP-075)."""
    control = f"10{frame.brs:d}|{frame.esi:d}{frame.dlc:04b}"
    if frame.extended:
        text = f"0{frame.can_id >> 18:011b}11{frame.can_id & 0x3FFFF:018b}0{control}"
    else:
        text = f"0{frame.can_id:011b}00{control}"
    text += "".join(f"{byte:08b}" for byte in frame.data)
    wire, run = "", ""
    for index, mark in enumerate(text):
        wire += mark
        if mark == "|":
            continue
        run = run + mark if run[-1:] == mark else mark
        if len(run) == 5 and index + 1 < len(text):
            run = "1" if mark == "0" else "0"
            wire += run
    slow, fast = wire.split("|")
    crc = 17 if len(frame.data) <= 16 else 21
    fast_bits = len(fast) + 4 + crc + -(-(4 + crc) // 4) + 1
    slow_bits = len(slow) + 9
    return slow_bits * 1e9 / nominal + fast_bits * 1e9 / (data if frame.brs else nominal)


@CAMPAIGN.product(
    "fd/length-{content}",
    parameters={"content": tuple(CONTENTS)},
    title="length of CAN FD frames, content {content}",
    requirements=("CANP-073", "CANP-074", "CANP-075"),
)
def fd_length(ctx: CaseContext, content: str) -> None:
    """Every length, with and without rate switch and error state, both identifiers: exact to two ns; followed
    bit by bit it is as long.
    """
    segment = Segment(ctx, "ab", bitrate=NOMINAL, data_bitrate=DATA, fd=True)
    pattern = CONTENTS[content] * 8
    for extended in (False, True):
        for size in (*range(9), 12, 16, 20, 24, 32, 48, 64):
            for brs, esi in ((False, False), (True, size % 2 == 0)):
                frame = CanFrame(
                    0x1ABCDE5 if extended else 0x2A5,
                    pattern[:size],
                    extended=extended,
                    fd=True,
                    brs=brs,
                    esi=esi,
                )
                begun = segment.scheduler.now
                segment["a"].send(frame)
                if size % 3 == 0:
                    segment.run_us(21)
                    segment.medium.flip_bit(["a node that is not there"])
                segment.run_us(2000)
                at_ns, got = segment.received["b"].pop()
                equal(ctx, f"{frame}, ns", at_ns - begun, fd_length_ns(frame), "CANP-075", within=2)
                equal(ctx, "as it was sent", got == frame, 1, "CANP-073")
    equal(ctx, "errors", len(segment.errors), 0)


@CAMPAIGN.case("fd/mixed", requirements=("CANP-073", "CANP-076"))
def fd_mixed(ctx: CaseContext) -> None:
    """A node that takes no CAN FD acknowledges and hears nothing; a classic controller destroys such frames
    until it is passive, and a damaged bit is an error as in any frame.
    """
    segment = Segment(ctx, "a", bitrate=NOMINAL, data_bitrate=DATA, fd=True)
    segment.attach("plain")
    frame = CanFrame(0x100, bytes(range(48)), fd=True, brs=True)
    segment["a"].send(frame)
    segment.run_us(1000)
    equal(ctx, "counter of the sender", segment["a"].tec, 0, "CANP-006")
    equal(ctx, "heard by the plain node", len(segment.heard("plain")), 0)
    segment.attach("b", fd=True)
    segment["a"].set_error_counters(tec=0)
    for field in ("data", "crc", "stuff_count", "brs", "esi", "dlc"):
        count = len(segment.heard("b"))
        before = segment["a"].tec
        segment.corrupt(1, BitError(field, 0))
        segment["a"].send(frame)
        segment.run_us(2000)
        equal(ctx, f"bit error in {field}: heard", len(segment.heard("b")) - count, 1, "CANP-030")
        equal(ctx, f"bit error in {field}: counter", segment["a"].tec - before, 7, "CANP-045")
    segment["plain"].set_classic_only(True)
    segment["a"].set_error_counters(tec=0, rec=0)
    segment["plain"].set_error_counters(tec=0, rec=0)
    segment["a"].send(frame)
    segment.run_us(300)
    equal(ctx, "destroyed", segment["a"].tec >= 8, 1, "CANP-076")
    segment.run_us(20_000)
    equal(ctx, "the classic controller is passive", segment["plain"].state is PASSIVE, 1, "CANP-076")
    count = len(segment.heard("b"))
    segment["a"].send(frame)
    segment.run_us(2000)
    equal(ctx, "frames pass again", len(segment.heard("b")) - count, 1, "CANP-076")
    segment["a"].send(FRAME)
    segment.run_us(1000)
    segment.is_so("a classical frame", segment.heard("plain")[-1:], [FRAME], "CANP-076")


# -- programs and figures -----------------------------------------------------------------------------------


@CAMPAIGN.case("program", requirements=("CANP-077", "CANP-059"))
def program(ctx: CaseContext) -> None:
    """A python-can program: messages of both kinds with their times, filters, time-outs, periodic messages,
    own messages, states and error frames.
    """
    segment = Segment(ctx)
    seconds = segment.begun_ns / 1e9
    with can.Bus(interface="hil", channel=segment.medium, name="tool", receive_own_messages=False) as bus:
        for frame in (
            CanFrame(0x123, b"xyz"),
            CanFrame(0x1FFFFFFF, b"12345678", extended=True),
            CanFrame(0x123, remote=True, dlc=5),
        ):
            begun = segment.scheduler.now
            segment["a"].send(frame)
            message = bus.recv(1.0)
            assert message is not None
            found = (
                message.arbitration_id,
                bytes(message.data),
                message.is_extended_id,
                message.is_remote_frame,
                message.dlc,
            )
            segment.is_so(
                "message",
                found,
                (frame.can_id, frame.data, frame.extended, frame.remote, frame.dlc),
                "CANP-077",
            )
            equal(
                ctx,
                "time stamp, us",
                message.timestamp * 1e6,
                begun / US + length_of(frame),
                "CANP-077",
                within=0.6,
            )
            bus.send(message)
            segment.run_us(300)
            segment.is_so("sent again", segment.heard("b")[-1], frame, "CANP-077")
        bus.set_filters([{"can_id": 0x200, "can_mask": 0x700, "extended": False}])
        for can_id in (0x1FF, 0x300, 0x234):
            segment["a"].send(CanFrame(can_id))
        message = bus.recv(0.01)
        segment.is_so("message that the filter passes", message and message.arbitration_id, 0x234)
        begun = segment.scheduler.now
        segment.is_so("nothing comes", bus.recv(0.25), None)
        equal(ctx, "time-out, s", (segment.scheduler.now - begun) / 1e9, 0.25, within=1e-9)
        equal(ctx, "simulated time is that of the program", segment.scheduler.now / 1e9 > seconds + 0.25, 1)
        task = bus.send_periodic(can.Message(arbitration_id=0x55, data=b"\1", is_extended_id=False), 0.01)
        count = len(segment.heard("c"))
        ctx.run_for(0.095)
        equal(ctx, "periodic messages in 95 ms", len(segment.heard("c")) - count, 10)
        task.stop()
        count = len(segment.heard("c"))
        ctx.run_for(0.05)
        equal(ctx, "periodic messages after the end", len(segment.heard("c")) - count, 0)
        segment.is_so("state", bus.state, can.BusState.ACTIVE)
        segment["tool"].set_error_counters(tec=130)
        segment.is_so("state", bus.state, can.BusState.PASSIVE, "CANP-053")
        segment["tool"].set_error_counters(tec=0)
        segment.is_so("state", bus.state, can.BusState.ACTIVE, "CANP-053")
    segment.is_so("nodes", [port.name for port in segment.medium.ports], ["a", "b", "c"])


ERROR_CLASSES: Final = {
    "BIT_ERROR": (0x088, 0x01),
    "FORM_ERROR": (0x088, 0x02),
    "BIT_STUFFING_ERROR": (0x088, 0x04),
    "CRC_ERROR": (0x088, 0x00),
    "ACK_ERROR": (0x0A0, 0x00),
}
"""Class and kind in the error frame of SocketCAN (linux/can/error.h)."""
LOCATIONS: Final = {
    "id": 0x02, "rtr": 0x0C, "dlc": 0x0B, "data": 0x0A, "crc": 0x08, "crc_delimiter": 0x18, "ack_slot": 0x19,
    "ack_delimiter": 0x1B, "eof": 0x1A,
}  # fmt: skip


@CAMPAIGN.case("program/errors", requirements=("CANP-077", "CANP-033", "CANP-053"))
def program_errors(ctx: CaseContext) -> None:
    """Error frames as SocketCAN has them, of the sender and of another node, with kind, place and counters;
    the changes to passive, bus-off and back.
    """
    for field in LOCATIONS:
        for sending in (True, False):
            segment = Segment(ctx, auto_recovery=False)
            with can.Bus(interface="hil", channel=segment.medium, name="tool", error_frames=True) as bus:
                tool = segment["tool"]
                tool.set_error_counters(tec=3, rec=5)
                while bus.recv(0) is not None:
                    pass
                wrong = "ack_slot" if field == "ack_slot" else field
                segment.corrupt(1, BitError(wrong, 0, frozenset({"tool" if sending else "a"})))
                if sending:
                    bus.send(can.Message(arbitration_id=0x555, data=b"\x55", is_extended_id=False))
                else:
                    segment["a"].send(CanFrame(0x555, b"\x55"))
                segment.run_us(90)
                _, code, place = segment.errors[0]
                message = bus.recv(0)
                assert message is not None
                what = f"{field}, {'own' if sending else 'other'} frame"
                wanted, kind = ERROR_CLASSES[code]
                data = bytes(message.data)
                segment.is_so(f"{what}: an error frame", message.is_error_frame, True, "CANP-077")
                segment.is_so(f"{what}: class", message.arbitration_id, wanted, "CANP-033")
                segment.is_so(f"{what}: read back", read_error(message), (code, None), "CANP-033")
                own = sending and segment.errors[0][0] == "tool"
                if code != "ACK_ERROR":
                    segment.is_so(f"{what}: kind", data[2], kind | 0x80 * own, "CANP-033")
                location = 0x08 if code == "CRC_ERROR" else LOCATIONS.get(place, data[3])
                segment.is_so(f"{what}: place {place}", data[3], location, "CANP-033")
                segment.is_so(f"{what}: counter of the node", data[6], 11 if own else 3, "CANP-045")
    segment = Segment(ctx, "ab", auto_recovery=True)
    with can.Bus(interface="hil", channel=segment.medium, name="tool", error_frames=True) as bus:
        for tec, wanted in ((128, (0x004, 0x30)), (10, (0x004, 0x40)), (256, (0x040, 0x00))):
            segment["tool"].set_error_counters(tec=tec)
            message = bus.recv(0)
            assert message is not None
            found = (message.arbitration_id, message.data[1])
            segment.is_so(f"error frame of a counter of {tec}", found, wanted, "CANP-053")
            segment.is_so("state read back", read_error(message), ("", segment["tool"].state), "CANP-053")
            segment.is_so("counter", message.data[6], min(tec, 255), "CANP-077")
        segment.is_so("state", bus.state, can.BusState.ERROR, "CANP-053")


def _refused(ctx: CaseContext, what: str, error: type[Exception], act: Any, *ids: str) -> None:
    """Expect an exception with words."""
    found: object = None
    try:
        act()
    except error as reason:
        found = str(reason)
    equal(ctx, f"{what} is refused (with {found!r})", bool(found), 1, *ids)


@CAMPAIGN.case("program/options", requirements=("CANP-077", "CANP-073"))
def program_options(ctx: CaseContext) -> None:
    """A segment by its name, names of nodes, bit rates and CAN FD that fit, own messages, several periodic
    messages in turn, with an end and with changing content; what cannot be is refused.
    """
    segment = Segment(ctx, "ab")
    fast = CanMedium(segment.scheduler, bitrate=NOMINAL, data_bitrate=DATA, name="fast")

    def make(**options: Any) -> Any:
        return can.Bus(**({"interface": "hil", "channel": segment.medium} | options))

    wrong = can.CanInitializationError
    _refused(ctx, "an unknown segment", wrong, lambda: make(channel="nowhere"))
    _refused(ctx, "what is no segment", wrong, lambda: make(channel=segment))
    _refused(ctx, "another bit rate", wrong, lambda: make(bitrate=500_000))
    _refused(ctx, "CAN FD on a classical segment", wrong, lambda: make(fd=True), "CANP-073")
    _refused(ctx, "another data bit rate", wrong, lambda: make(channel=fast, fd=True, data_bitrate=4_000_000))
    _refused(ctx, "a name that is taken", wrong, lambda: make(name="a"))
    ends = [make(channel="lab", bitrate=1_000_000), make(), make(channel=fast, fd=True, data_bitrate=DATA)]
    segment.is_so("names", [end.port.name for end in ends], ["python-can", "python-can 2", "python-can"])
    segment.is_so(
        "protocols", [str(end.protocol) for end in ends], ["CanProtocol.CAN_20"] * 2 + ["CanProtocol.CAN_FD"]
    )
    segment.is_so("segment", ends[0].channel_info, "hil segment lab")
    long = can.Message(arbitration_id=5, data=bytes(12), is_fd=True, is_extended_id=False)
    _refused(ctx, "a CAN FD message", can.CanOperationError, lambda: ends[0].send(long), "CANP-073")
    broken = can.Message(is_error_frame=True)
    _refused(ctx, "an error frame", can.CanOperationError, lambda: ends[0].send(broken))
    ends[2].send(long)
    segment.run_us(500)
    segment.is_so("messages of CAN FD heard by nobody", ends[2].recv(0), None)
    _refused(ctx, "a time-out that is no number", ValueError, lambda: ends[0].recv(float("nan")))
    inside: list[Exception] = []

    def read() -> None:
        try:
            ends[1].recv(0.1)
        except can.CanOperationError as reason:
            inside.append(reason)

    segment.scheduler.after(US, read)
    segment.run_us(10)
    segment.is_so("waiting inside of a callback is refused", len(inside), 1)
    for end in ends:
        end.shutdown()
        end.shutdown()
    _refused(ctx, "a bus that is shut down", can.CanOperationError, lambda: ends[0].recv(0))
    segment.is_so("nodes", [port.name for port in segment.medium.ports], ["a", "b"])
    with make(name="tool", receive_own_messages=True) as bus:
        bus.send(can.Message(arbitration_id=0x10, data=b"own", is_extended_id=False))
        segment.run_us(200)
        own = bus.recv(0)
        assert own is not None
        segment.is_so("own message", (own.arbitration_id, bytes(own.data), own.is_rx), (0x10, b"own", False))
        for number in range(3):
            bus.send(can.Message(arbitration_id=0x20 + number, is_extended_id=False))
        bus.flush_tx_buffer()
        count = len(segment.heard("a"))
        segment.run_us(500)
        segment.is_so("messages behind a flush", len(segment.heard("a")) - count, 0)
        two = [can.Message(arbitration_id=number, data=b"\0", is_extended_id=False) for number in (1, 2)]

        def count_up(message: can.Message) -> None:
            message.data[0] += 1

        for period in (0.0, -1.0, float("inf")):
            _refused(
                ctx, f"period {period}", ValueError, lambda period=period: bus.send_periodic(two[0], period)
            )
        _refused(
            ctx, "a negative duration", ValueError, lambda: bus.send_periodic(two[0], 0.01, duration=-1.0)
        )
        begun = len(segment.heard("a"))
        task = bus.send_periodic(two[0], 0.01, duration=0.035, modifier_callback=count_up)
        ctx.run_for(0.1)
        found = [(frame.can_id, frame.data) for frame in segment.heard("a")[begun:]]
        segment.is_so("counted messages", found, [(1, bytes((number,))) for number in (1, 2, 3, 4)])
        begun = len(segment.heard("a"))
        task.start()
        task.start()
        ctx.run_for(0.005)
        task.stop()
        ctx.run_for(0.05)
        segment.is_so("messages of one that is stopped", len(segment.heard("a")) - begun, 1)


@CAMPAIGN.case("figures", requirements=("CANP-032", "CANP-069", "CANP-070"))
def figures(ctx: CaseContext) -> None:
    """Load and response times of a plan, worked out by hand; how late the frames really were."""
    traffic = [PeriodicFrame(CanFrame(0x80), 2 * MS)]
    for node in range(1, 5):
        traffic += [PeriodicFrame(CanFrame(base + node, bytes(8)), 2 * MS) for base in (0x180, 0x200)]
    equal(
        ctx,
        "load of the guide",
        planned_load(traffic, 1_000_000),
        (8 * 135 + 55) / 2000,
        "CANP-069",
        within=1e-9,
    )
    frames = [PeriodicFrame(CanFrame(can_id, bytes(8)), 2 * MS) for can_id in (0x10, 0x20, 0x30)]
    for place, count in ((0, 2), (1, 3), (2, 3)):
        found = response_time_ns(frames[place], frames, 1_000_000) or 0
        equal(ctx, f"response time of frame {place}, bits", found / US, count * 135, "CANP-032")
    late = PeriodicFrame(CanFrame(0x08, bytes(8)), 2 * MS, 100 * US)
    equal(
        ctx,
        "with jitter, bits",
        (response_time_ns(late, [*frames, late], 1_000_000) or 0) / US,
        370,
        "CANP-032",
    )
    full = [PeriodicFrame(CanFrame(can_id, bytes(8)), 300 * US) for can_id in (0x10, 0x20, 0x30)]
    segment = Segment(ctx)
    segment.is_so("response time on a bus that is too full", response_time_ns(full[2], full, 1_000_000), None)
    grid = arrival_statistics([0, 1010 * US, 2000 * US, 3030 * US], MS)
    segment.is_so(
        "lateness, us",
        (
            grid.arrivals,
            grid.earliest_ns,
            grid.latest_ns // US,
            grid.shortest_ns // US,
            grid.longest_ns // US,
        ),
        (4, 0, 30, 990, 1030),
        "CANP-070",
    )
    equal(ctx, "mean, us", grid.mean_ns / US, 10.0, "CANP-070", within=1e-9)
    equal(ctx, "standard deviation, us", grid.deviation_ns / US, 150.0**0.5, "CANP-070", within=1e-6)
    for _ in range(3):
        segment["a"].send(FRAME)
        segment.run_us(500)
    found_at = [(at_ns - segment.begun_ns) / US for at_ns in arrivals(segment.medium.log, FRAME.can_id)]
    wanted = [length_of(FRAME) + 500 * number for number in range(3)]
    segment.is_so("ends of the frames, us", found_at, [float(one) for one in wanted], "CANP-070")


@CAMPAIGN.product(
    "file/{kind}",
    parameters={"kind": ("log", "asc", "blf", "pcap", "pcapng")},
    title="a bus log as a file, {kind}",
)
def file(ctx: CaseContext, kind: str) -> None:
    """Every kind of frame is read back from a file as it was on the wire, with its time."""
    segment = Segment(ctx, "ab", bitrate=NOMINAL, data_bitrate=DATA, fd=True)
    sent = [
        CanFrame(0x123, b"\x01\x23\x45"),
        CanFrame(0x1ABCDEF0, bytes(range(8)), extended=True),
        CanFrame(0x7FF, remote=True, dlc=4),
        CanFrame(0x000),
        CanFrame(0x321, bytes(range(24)), fd=True, brs=True),
        CanFrame(0x321, bytes(range(12)), fd=True, esi=True),
    ]
    for frame in sent:
        segment["a"].send(frame)
        segment.run_us(1500)
    with TemporaryDirectory() as folder:
        path = Path(folder) / f"bus.{kind}"
        write_log(segment.medium.log, path)
        back = read_log(path)
    segment.is_so("frames", [frame for _, frame in back], sent)
    begun = segment.medium.log[0][0]
    for (found_s, _), (at_ns, *_) in zip(back, segment.medium.log, strict=True):
        equal(ctx, "time, us", (found_s - back[0][0]) * 1e6, (at_ns - begun) / US, within=1.5)
