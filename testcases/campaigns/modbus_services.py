"""A PROFIdrive drive behind Modbus registers, asked request by request by a plain client."""

from __future__ import annotations

from struct import pack
from typing import Any, Final

from fieldbus.modbus import Outcome, Request
from hil.bench import BenchFile
from hil.campaign import Campaign, CaseContext
from testcases.campaigns.support import equal

DRIVE: Final = "drive1"
UNIT: Final = 7
FIRST: Final = 40_000
"""Register 40 001 has the address 0."""
READY, RUN, ACKNOWLEDGE = 0x047E, 0x047F, 0x04FE
_DRIVE: Final = f"""
[drive.drive1]
profile = "profidrive"
telegram = 1
segment = "link0"
unit = {UNIT}
off1_ramp_s = 0.5
off3_ramp_s = 0.2

[drive.drive1.mechanics]
coulomb_friction_n = 0.0
viscous_friction_n_per_m_s = 0.0

[drive.drive1.profidrive]
operating_mode = 1
ramp_up_s = 0.4
"""
TCP: Final = BenchFile(
    "led drive on Modbus TCP",
    '[bench]\nname = "led drive on Modbus TCP"\nkind = "virtual"\ncycle_ms = 4\n'
    f'[segment.link0]\nkind = "modbus_tcp"\n{_DRIVE}',
)
LINE: Final = BenchFile(
    "led drive on a line",
    '[bench]\nname = "led drive on a line"\nkind = "virtual"\ncycle_ms = 4\n'
    f'[segment.link0]\nkind = "modbus_rtu"\nbaud = 115_200\n{_DRIVE}',
)
MAILBOX: Final = BenchFile(
    "led drive with a mailbox",
    TCP.text.replace("unit =", 'map = "festo"\nunit =').replace(TCP.name, "led drive with a mailbox"),
)
CAMPAIGN: Final = Campaign(
    "modbus services", tags=("modbus", "profidrive"), bench="testcases.campaigns.modbus_services:TCP"
)
ON_A_LINE: Final = Campaign(
    "modbus line services", tags=("modbus", "profidrive"), bench="testcases.campaigns.modbus_services:LINE"
)
"""The same on a serial line."""
WITH_MAILBOX: Final = Campaign(
    "modbus mailbox", tags=("modbus", "profidrive"), bench="testcases.campaigns.modbus_services:MAILBOX"
)
"""A drive whose registers are those of a CMMT: parameters by a mailbox, low bytes and words first."""


class Client:
    """A plain Modbus client of the drive.

    Args:
        ctx: The case.

    """

    def __init__(self, ctx: CaseContext) -> None:
        self._ctx = ctx
        segment: Any = ctx.bench.segment("link0")
        self._client = segment.client(DRIVE)
        ctx.run_for(0.1)

    def ask(self, function: int, *fields: Any, unit: int = UNIT) -> Any:
        """Return the registers of the response, the negative exception code, or None without a response."""
        job = self._client.submit(Request(function, *fields), unit)
        self._ctx.wait_until(lambda: job.result is not None, 10.0, f"function {function} is answered")
        if job.result.outcome is Outcome.EXCEPTION:
            return -job.result.response.exception
        return job.result.response.values if job.result.outcome is Outcome.DONE else None

    def read(self, register: int, quantity: int = 1) -> Any:
        """Read registers by their numbers."""
        return self.ask(3, register - FIRST - 1, quantity)

    def write(self, register: int, *words: int) -> Any:
        """Write registers with function 16."""
        return self.ask(16, register - FIRST - 1, len(words), tuple(word & 0xFFFF for word in words))

    def keep(self, seconds: float, stw1: int, setpoint: int = 0) -> None:
        """Write the telegram every 20 ms for a time."""
        until = self._ctx.now_s + seconds
        while self._ctx.now_s < until:
            self.write(40_100, stw1, setpoint)
            self._ctx.run_for(0.02)

    def enable(self) -> None:
        """Bring the drive into operation."""
        self._ctx.do("READY, then RUN")
        self.keep(0.1, READY)
        self.keep(0.2, RUN)
        equal(self._ctx, "ZSW1 in operation", self.read(40_110)[0] & 0x4F, 0x07, "PD-295")

    def shows(self, register: int, wanted: float, *ids: str, within: float = 0.0) -> None:
        """Expect a register, as a signed number."""
        found = self.read(register)
        value = found[0] if isinstance(found, tuple | list) else found or -999
        value = value - 0x10000 if value >= 0x8000 else value
        equal(self._ctx, f"register {register}", value, wanted, *ids, within=within)

    def answers(self, what: str, found: Any, wanted: Any, *ids: str) -> None:
        """Expect an answer."""
        self._ctx.do(f"{what}: {found}, to be {wanted}")
        equal(self._ctx, f"{what} is {wanted}", found == wanted, 1, *ids)


def both(identifier: str, **options: Any) -> Any:
    """Make a case of both campaigns."""

    def add(function: Any) -> Any:
        for campaign in (CAMPAIGN, ON_A_LINE):
            if "parameters" in options:
                campaign.product(identifier, **options)(function)
            else:
                campaign.case(identifier, **options)(function)
        return function

    return add


@both("turns", requirements=("PD-295", "PD-296", "PD-299"))
def turns(ctx: CaseContext) -> None:
    """Control word and setpoint turn the drive with its ramps; the displays show the machine."""
    client = Client(ctx)
    client.enable()
    begun = ctx.now_s
    client.keep(0.06, RUN, 0x1000)
    rising = float(ctx.trace()[f"{DRIVE}.motor_speed"].values[-1])
    late_s = ctx.now_s - begun
    equal(ctx, "speed on the ramp, rpm", rising, 3000 / 0.4 * late_s, "PD-296", within=3000 / 0.4 * 0.025)
    client.keep(0.5, RUN, 0x1000)
    client.shows(40_111, 0x1000, "PD-300", within=8)
    client.shows(40_340, 750, "PD-308", within=1)
    client.shows(40_341, 750, "PD-308", within=1)
    equal(
        ctx, "speed of the motor, rpm", float(ctx.trace()[f"{DRIVE}.motor_speed"].values[-1]), 750, within=1.0
    )
    client.keep(0.7, RUN, -0x0800)
    client.shows(40_341, -375, "PD-308", within=1)
    client.keep(0.3, READY, -0x0800)
    client.shows(40_341, 0, "PD-308", within=1)
    equal(ctx, "ZSW1 after OFF1", client.read(40_110)[0] & 0x4F, 0x01, "PD-299")


@both("single-register", requirements=("PD-295",))
def single(ctx: CaseContext) -> None:
    """Function 06 changes one word of the telegram and leaves the others."""
    client = Client(ctx)
    client.enable()
    for _ in range(30):
        client.answers(
            "function 06", client.ask(6, 40_101 - FIRST - 1, 1, (0x0400,)) is not None, True, "PD-295"
        )
        ctx.run_for(0.02)
    client.shows(40_341, 187.5, "PD-308", within=1)
    client.answers("registers of the telegram", tuple(client.read(40_100, 2)), (RUN, 0x0400), "PD-295")


@both(
    "exception/{what}",
    parameters=[
        {"what": "no-register", "function": 3, "register": 40_050, "quantity": 1, "code": 2},
        {"what": "beyond-the-last", "function": 3, "register": 40_722, "quantity": 2, "code": 2},
        {"what": "coils", "function": 1, "register": 40_100, "quantity": 1, "code": 1},
        {"what": "inputs", "function": 4, "register": 40_100, "quantity": 1, "code": 1},
    ],
    title="exception: {what}",
    requirements=("MODB-032", "PD-335"),
)
def exception(ctx: CaseContext, what: str, function: int, register: int, quantity: int, code: int) -> None:
    """What the drive does not have is refused with the right code, and nothing else changes."""
    client = Client(ctx)
    client.answers(what, client.ask(function, register - FIRST - 1, quantity), -code, "MODB-032")
    client.answers("another register", len(client.read(40_110)), 1)


SETTINGS: Final = (
    (40_321, 100, 4000),
    (40_322, 0, 65_000),
    (40_323, 0, 65_000),
    (40_324, 6, 32_767),
    (40_501, -20_000, 20_000),
    (40_513, 0, 60),
    (40_523, -19_999, 19_999),
)
"""Registers of settings with the ends of their range."""


@both("settings", requirements=("PD-310", "PD-311", "PD-312"))
def settings(ctx: CaseContext) -> None:
    """Settings take what is in their range and refuse the next number with exception 4."""
    client = Client(ctx)
    for register, low, high in SETTINGS:
        for value in (low, (low + high) // 2, high):
            client.answers(f"write {value} to {register}", client.write(register, value) is not None, True)
            client.answers(f"read {register}", client.read(register)[0], value & 0xFFFF, "PD-310")
        if high < 0x8000:
            client.answers(f"write {high + 1} to {register}", client.write(register, high + 1), -4, "PD-335")
        client.answers(f"read {register}", client.read(register)[0], high & 0xFFFF, "PD-310")
    for register in (40_110, 40_240, 40_300, 40_341, 40_400):
        client.answers(f"write to {register}", client.ask(6, register - FIRST - 1, 1, (0,)), -4, "PD-337")


@both("ramp", requirements=("PD-311",))
def ramp(ctx: CaseContext) -> None:
    """The ramp times in the registers are those of the machine: 1120 up, 1121 down."""
    client = Client(ctx)
    client.write(40_322, 200)
    client.write(40_323, 100)
    client.enable()
    for setpoint, seconds in ((0x2000, 2.0), (0, 1.0)):
        speed = ctx.trace()[f"{DRIVE}.motor_speed"]
        before, begun = float(speed.values[-1]), ctx.now_s
        client.keep(0.3, RUN, setpoint)
        now = float(ctx.trace()[f"{DRIVE}.motor_speed"].values[-1])
        wanted = 3000.0 / seconds * (ctx.now_s - begun)
        equal(
            ctx,
            "change of the speed, rpm",
            abs(now - before),
            wanted,
            "PD-311",
            within=3000.0 / seconds * 0.03,
        )
        client.keep(1.2, RUN, setpoint)


@both(
    "watched/{kind}",
    parameters={"kind": ("reading", "writing", "silence")},
    title="process data are watched: {kind}",
    requirements=("PD-280", "PD-292"),
)
def watched(ctx: CaseContext, kind: str) -> None:
    """Any access to the process data keeps the drive going; without one it stops after p2040, not before."""
    client = Client(ctx)
    client.enable()
    client.keep(0.3, RUN, 0x1000)
    last = ctx.now_s - 0.02
    if kind != "silence":
        for _ in range(8):
            ctx.run_for(0.06)
            client.read(40_110) if kind == "reading" else client.write(40_100, RUN, 0x1000)
        equal(
            ctx, "speed, rpm", float(ctx.trace()[f"{DRIVE}.motor_speed"].values[-1]), 750, "PD-292", within=2
        )
        return
    lost = ctx.inject("modbus.drop", direction="request")
    ctx.run_for(0.5)
    lost.remove()
    faults = list(ctx.trace().select(kind="drive.fault", source=DRIVE))
    client.answers("number of faults", len(faults), 1, "PD-292")
    if faults:
        silent_s = faults[0].time_ns * 1e-9 - last
        equal(ctx, "time without access, s", silent_s, 0.1, "PD-292", within=0.03)
    equal(ctx, "speed, rpm", float(ctx.trace()[f"{DRIVE}.motor_speed"].values[-1]), 0, "PD-292", within=1)
    client.keep(0.1, READY)
    equal(ctx, "fault bit", client.read(40_110)[0] & 8, 8, "PD-299")
    client.keep(0.05, ACKNOWLEDGE)
    client.keep(0.1, READY)
    equal(ctx, "fault bit", client.read(40_110)[0] & 8, 0, "PD-299")
    client.shows(40_400, 0, "PD-309")


@both("fault", requirements=("PD-309",))
def fault(ctx: CaseContext) -> None:
    """The fault number stands in its register until it is acknowledged."""
    client = Client(ctx)
    client.enable()
    ctx.inject("drive.fault", DRIVE, code=0x2310)
    client.keep(0.1, RUN)
    number = client.read(40_400)[0]
    client.answers("a fault number", number > 0, True, "PD-309")
    equal(ctx, "fault, no operation", client.read(40_110)[0] & 0x0C, 0x08, "PD-299")
    client.keep(0.1, READY)
    client.keep(0.05, ACKNOWLEDGE)
    client.keep(0.1, READY)
    equal(ctx, "no fault", client.read(40_110)[0] & 0x08, 0, "PD-299")
    client.shows(40_400, 0, "PD-309")
    client.enable()


READ: Final = (0x2F0A, 0x8001, 0x0101, 0x1001, 0x0002, 0x0000)


@both("parameters/read", requirements=("PD-326", "PD-327", "PD-328", "PD-332"))
def parameter_read(ctx: CaseContext) -> None:
    """A parameter request in registers 40601: not ready, then the answer, which stays."""
    client = Client(ctx)
    client.write(40_601, 0x0001, *READ)
    early = tuple(client.read(40_601, 3))
    client.answers("state", early[0] in (1, 2), True, "PD-327")
    ctx.run_for(0.2)
    found = tuple(client.read(40_601, 6))
    client.answers("answer", found[:5], (0x0002, 0x2F08, 0x8001, 0x0101, 0x0301), "PD-332")
    client.answers("answer again", tuple(client.read(40_601, 6)), found, "PD-328")


@both("parameters/write", requirements=("PD-326", "PD-327"))
def parameter_write(ctx: CaseContext) -> None:
    """p1120 = 5.0 s through the channel is 500 in its register; a read-only one is refused in the answer."""
    client = Client(ctx)
    client.write(40_601, 0x0001, 0x2F10, 0x8002, 0x0101, 0x1001, 0x0460, 0x0000, 0x0801, 0x40A0, 0x0000)
    ctx.run_for(0.2)
    client.answers("answer", tuple(client.read(40_601, 4)), (0x0002, 0x2F04, 0x8002, 0x0101), "PD-327")
    client.shows(40_322, 500, "PD-311")
    client.write(40_601, 0x0001, 0x2F10, 0x8002, 0x0101, 0x1001, 0x0002, 0x0000, 0x0801, 0x40A0, 0x0000)
    ctx.run_for(0.2)
    client.answers("refused", client.read(40_601, 4)[2], 0x8082, "PD-327")


@both("parameters/saturated", requirements=("PD-294",))
def saturated(ctx: CaseContext) -> None:
    """A value that does not fit its register shows as the end of the register; the parameter keeps it."""
    client = Client(ctx)
    ramp_up = (0x0001, 0x2F10, 0x8002, 0x0101, 0x1001, 0x0460, 0x0000, 0x0801)
    for high, shown in ((0x4423, 65_200), (0x442F, 0xFFFF), (0x461C, 0xFFFF), (0x40A0, 500)):
        client.write(40_601, *ramp_up, high, 0x0000)
        ctx.run_for(0.2)
        client.answers("answer", tuple(client.read(40_601, 4)), (0x0002, 0x2F04, 0x8002, 0x0101))
        client.answers("register of the ramp time", client.read(40_322)[0], shown, "PD-294")


@both(
    "parameters/mistake-{what}",
    parameters=[
        {"what": "length", "words": (0x0001, 0x2F00, 0x8001, 0x0101), "error": 1},
        {"what": "control", "words": (0x0002, *READ), "error": 2},
        {"what": "function", "words": (0x0001, 0x2E0A, *READ[1:]), "error": 3},
    ],
    title="mistake of a parameter request: {what}",
    requirements=("PD-329", "PD-330", "PD-331"),
)
def mistake(ctx: CaseContext, what: str, words: tuple[int, ...], error: int) -> None:
    """A mistake is answered at once with its number, and the next request is served."""
    client = Client(ctx)
    client.write(40_601, *words)
    client.answers(what, tuple(client.read(40_601, 3)), (0x0002, 0x2F00, error), "PD-329")
    client.write(40_601, 0x0001, *READ)
    ctx.run_for(0.2)
    client.answers("the next request", tuple(client.read(40_601, 3)), (0x0002, 0x2F08, 0x8001), "PD-329")


@CAMPAIGN.case("unit", requirements=("PD-290",))
def any_unit(ctx: CaseContext) -> None:
    """Over TCP every unit identifier is answered."""
    client = Client(ctx)
    for unit in (UNIT, UNIT + 1, 255):
        found = client.ask(3, 40_110 - FIRST - 1, 1, unit=unit)
        client.answers(f"registers for unit {unit}", found is not None and len(found), 1, "PD-290")


@ON_A_LINE.case("unit", requirements=("PD-290", "MODB-007"))
def own_unit(ctx: CaseContext) -> None:
    """On a line another unit is not answered, and a broadcast acts in silence."""
    client = Client(ctx)
    client.answers("another unit", client.ask(3, 40_110 - FIRST - 1, 1, unit=UNIT + 1), None, "PD-290")
    client.ask(16, 40_100 - FIRST - 1, 2, (READY, 0), unit=0)
    client.answers("control word", client.read(40_100)[0], READY, "MODB-007")


# -- mailbox ------------------------------------------------------------------------------------------------

READING, WRITING, DONE, REFUSED = 0x01, 0x02, 0x10, 0x03
"""Orders of the mailbox, and its states behind them."""
STORED: Final = (
    (2040, "<f", (250.0, 1000.0)),
    (1120, "<f", (2.5, 0.125)),
    (925, "<H", (258, 4)),
    (1113, "<I", (0x082AFC0B,)),
)
"""Parameters of every size, and numbers in them of which no two bytes are alike."""


@WITH_MAILBOX.case("mailbox")
def mailbox(ctx: CaseContext) -> None:
    """What is written by the mailbox is read by it, low byte first, and is the number that the registers
    show; a parameter that does not exist, a wrong length and a wrong order end in state 3.
    """
    client = Client(ctx)

    def order(number: int, code: int, data: bytes = b"") -> tuple[int, bytes]:
        """Carry out an order; returns state and data."""
        words = [int.from_bytes(data[at : at + 2].ljust(2, b"\0"), "little") for at in range(0, len(data), 2)]
        if words:
            client.ask(16, 510, len(words), tuple(words))
        client.ask(16, 500, 5, (number, 0, 1, code, len(data)))
        state, length = client.ask(3, 503, 2)
        found = client.ask(3, 510, 4)
        return state, b"".join(word.to_bytes(2, "little") for word in found)[:length]

    for number, form, values in STORED:
        before = order(number, READING)
        client.answers(f"p{number} is read", (before[0], len(before[1])), (DONE, len(pack(form, values[0]))))
        for value in values:
            data = pack(form, value)
            client.answers(f"p{number} = {value} is written", order(number, WRITING, data)[0], DONE)
            client.answers(f"p{number} is read", order(number, READING), (DONE, data))
            if number == 2040:
                shown = client.ask(3, 400, 2)
                client.answers("registers of p2040", shown[0] | shown[1] << 16, value, "PD-280")
        client.answers(f"p{number} is put back", order(number, WRITING, before[1])[0], DONE)
        client.answers("one byte too many", order(number, WRITING, before[1] + b"\0")[0], REFUSED)
        client.answers("an unknown order", order(number, 7)[0], REFUSED)
        client.answers(f"p{number} is what it was", order(number, READING), before)
    client.answers("no such parameter", order(4999, READING)[0], REFUSED)
