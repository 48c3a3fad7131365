"""Encoders of CiA 406 and PROFIdrive on shafts of their own, read object by object and word by word."""

from __future__ import annotations

import math
from typing import Any, Final

from fieldbus.canopen import NmtCommand
from fieldbus.profidrive.words import G_STW, G_ZSW
from hil.bench import BenchFile
from hil.campaign import Campaign, CaseContext
from testcases.campaigns._led_servo import Node
from testcases.campaigns.support import equal

STEPS, TURNS = 1000, 16
LENGTH_MM: Final = 20.0
LINES: Final = 4096
MARK: Final = 3_000_000
"""Place of the zero mark of the incremental PROFIdrive encoder, increments of G1_XIST1."""
NODES: Final = {
    "multi": 7,
    "counting": 8,
    "incremental": 9,
    "scale": 10,
    "cyclic": 11,
    "heads": 12,
    "single": 13,
}
BENCH: Final = BenchFile(
    "encoders",
    "\n".join(
        [
            '[bench]\nname = "encoders"\nkind = "virtual"\ncycle_ms = 4\n',
            "[segment.can0]\nbitrate = 1_000_000\n",
            *(
                f'[encoder.{name}]\nsegment = "can0"\nnode_id = {NODES[name]}\ntype = "{kind}"\n'
                + (
                    f"measuring_step_um = 1.0\nlength_mm = {LENGTH_MM}\noffset_mm = 0.0\n"
                    if "linear" in kind or kind == "multi_sensor"
                    else f"steps_per_revolution = {STEPS}\nrevolutions = {TURNS}\n"
                )
                for name, kind in (
                    ("multi", "multi_turn"),
                    ("counting", "single_turn_counting"),
                    ("incremental", "incremental_rotary"),
                    ("scale", "absolute_linear"),
                    ("cyclic", "cyclic_linear"),
                    ("heads", "multi_sensor"),
                    ("single", "single_turn"),
                )
            ),
            *(
                f'[encoder.{name}]\nprofile = "profidrive"\nsegment = "can0"\nnode_id = {node}\n'
                f'type = "{kind}"\nsteps_per_revolution = {LINES}\nrevolutions = 256\n'
                f"[encoder.{name}.profidrive]\ntelegram = {telegram}\n"
                + (f"zero_mark = {MARK}\n" if kind == "incremental_rotary" else "fine_xist2_bits = 9\n")
                for node, (name, telegram, kind) in enumerate(
                    (
                        ("pd81", 81, "multi_turn"),
                        ("pd82", 82, "multi_turn"),
                        ("pd83", 83, "multi_turn"),
                        ("pd84", 84, "multi_turn"),
                        ("pd", 81, "incremental_rotary"),
                    ),
                    21,
                )
            ),
        ]
    ),
)
CAMPAIGN: Final = Campaign(
    "encoders", controller="", tags=("encoder",), bench="testcases.campaigns.encoders:BENCH"
)
TOO_HIGH, TOO_LOW, WRONG, CROSSED = 0x06090031, 0x06090032, 0x06090030, 0x06090036


class Encoder(Node):
    """A CiA 406 encoder whose shaft the case turns.

    Args:
        ctx: The case.
        name: Its name.

    """

    def __init__(self, ctx: CaseContext, name: str = "multi") -> None:
        super().__init__(ctx, NODES[name])
        self.device: Any = ctx.bench.encoder(name)
        ctx.run_for(0.01)
        self._step = 1e-6 if name in ("scale", "cyclic", "heads") else math.tau / STEPS

    def count(self, steps: float) -> None:
        """Place the shaft so that the sensor counts so many steps from zero."""
        self._ctx.do(f"turn the shaft to {steps} steps")
        self.device.place_shaft((steps + 0.25) * self._step)
        self._ctx.run_for(0.004)

    def turn(self, steps_s: float, seconds: float) -> None:
        """Turn the shaft with a speed."""
        self._ctx.do(f"turn the shaft with {steps_s} steps/s")
        self.device.turn_shaft(steps_s * self._step)
        self._ctx.run_for(seconds)


def formed(steps: int, *, units: int, total: int, scaling: bool, back: bool, offset: int) -> int:
    """Return the position by the formula of the profile, from raw steps."""
    raw = (-steps if back else steps) % (STEPS * TURNS)
    if not scaling:
        return (raw + offset) % (STEPS * TURNS)
    return (raw * units // STEPS + offset) % total


@CAMPAIGN.product(
    "position/{name}",
    parameters=[
        {"name": "plain", "units": 1000, "total": 16_000, "word": 4},
        {"name": "backwards", "units": 1000, "total": 16_000, "word": 5},
        {"name": "scaled", "units": 360, "total": 4_000, "word": 4},
        {"name": "scaled-backwards", "units": 77, "total": 1_001, "word": 5},
        {"name": "scaling-off", "units": 360, "total": 4_000, "word": 0},
    ],
    title="position of a multi-turn encoder, {name}",
    requirements=("C406-003", "C406-004", "C406-005", "C406-007"),
)
def position(ctx: CaseContext, name: str, units: int, total: int, word: int) -> None:
    """Scaling, range, code sequence and preset make the position that the formula of the profile gives."""
    del name
    encoder = Encoder(ctx)
    encoder.configure({0x6001: units, 0x6002: total, 0x6000: word})
    encoder.shows(0x6500, word, "C406-052")
    encoder.shows(0x6501, STEPS)
    encoder.shows(0x6502, TURNS)
    encoder.shows(0x1000, 0x00020196, "C406-001")
    facts = {"units": units, "total": total, "scaling": bool(word & 4), "back": bool(word & 1)}
    offset = 0
    for steps, preset in ((3_333, None), (-1_234, 321), (9_999, None), (16_005, 55), (123, None)):
        encoder.count(steps)
        encoder.shows(0x6004, formed(steps, offset=offset, **facts), "C406-004")
        encoder.shows(0x600C, steps % (STEPS * TURNS), "C406-004")
        if preset is not None:
            encoder.write(0x6003, preset)
            ctx.run_for(0.004)
            offset = preset - formed(steps, offset=0, **facts | {"total": 10**9})
            encoder.shows(0x6509, offset, "C406-005")
            encoder.shows(0x6004, preset, "C406-005")


@CAMPAIGN.case("refused", requirements=("C406-013", "C406-014", "C406-015", "C406-016"))
def refused(ctx: CaseContext) -> None:
    """Scaling, range, preset and operating bits take what the profile allows, with the right abort codes."""
    encoder = Encoder(ctx)
    for index, value, code in (
        *((0x6000, word, WRONG) for word in (0x0008, 0x0010, 0x1004)),
        (0x6001, 0, TOO_LOW),
        (0x6001, STEPS + 1, TOO_HIGH),
        (0x6002, 0, TOO_LOW),
        (0x6002, STEPS * TURNS + 1, TOO_HIGH),
        (0x6003, STEPS * TURNS, TOO_HIGH),
    ):
        encoder.refuses(index, value, code, "C406-014")
    encoder.write(0x6001, 100)
    encoder.shows(0x6002, 100 * TURNS, "C406-015")
    encoder.write(0x6003, 77)
    encoder.shows(0x6509, 77, "C406-007")
    encoder.write(0x6000, 5)
    encoder.shows(0x6509, 0, "C406-007")
    scale = Encoder(ctx, "scale")
    scale.refuses(0x6005, 999, TOO_LOW, "C406-018", sub=1)
    scale.refuses(0x6000, 5, WRONG, "C406-013")


@CAMPAIGN.product(
    "kind/{name}",
    parameters=[
        {"name": "single", "kind": 1, "before": 600, "same": 600, "moved": 900},
        {"name": "multi", "kind": 2, "before": 2600, "same": 2600, "moved": 1900},
        {"name": "counting", "kind": 3, "before": 2600, "same": 2600, "moved": 2900},
        {"name": "incremental", "kind": 4, "before": 600, "same": 0, "moved": 0},
        {"name": "scale", "kind": 8, "before": 2600, "same": 2600, "moved": 1900},
        {"name": "cyclic", "kind": 9, "before": 2600, "same": 2600, "moved": 1900},
        {"name": "heads", "kind": 10, "before": 2600, "same": 2600, "moved": 1900},
    ],
    title="what an encoder knows after power-on: {name}",
    requirements=("C406-001", "C406-008"),
)
def kind(ctx: CaseContext, name: str, kind: int, before: int, same: int, moved: int) -> None:
    """Absolute encoders show their place at once, incremental ones begin at zero, counted turns are kept."""
    encoder = Encoder(ctx, name)
    encoder.equal("device type", encoder.read(0x1000) & 0xFFFF, 0x0196, "C406-001")
    del kind
    for steps in (800, 1600, 2600):
        encoder.count(steps)
    encoder.shows(0x6004, before, "C406-001")
    for place, wanted in ((2600, same), (1900, moved)):
        encoder.device.power_off()
        encoder.count(place)
        encoder.device.power_on()
        ctx.run_for(0.05)
        encoder.shows(0x6004, wanted, "C406-008")


@CAMPAIGN.case("speed", requirements=("C406-052",))
def speed(ctx: CaseContext) -> None:
    """The speed has the sign of the code sequence, its acceleration falls back to zero."""
    encoder = Encoder(ctx)
    for word, sign in ((4, 1), (5, -1)):
        encoder.write(0x6000, word)
        encoder.turn(20_000, 0.3)
        per = encoder.read(0x6030, 1)
        encoder.equal("sign of the speed", (per > 0) - (per < 0), sign, "C406-052")
        encoder.turn(40_000, 0.3)
        encoder.equal(
            "twice the speed", encoder.read(0x6030, 1), 2 * per, "C406-052", within=2 + 0.02 * abs(per)
        )
        encoder.turn(0, 0.3)
        encoder.shows(0x6030, 0, "C406-052", sub=1)


@CAMPAIGN.product(
    "cam/{name}",
    parameters=[
        {"name": "plain", "polarity": 0, "enable": 1, "states": (0, 1, 1, 1, 0)},
        {"name": "alone", "polarity": 0xFE, "enable": 1, "states": (0, 1, 1, 1, 0)},
        {"name": "inverted", "polarity": 1, "enable": 1, "states": (1, 0, 0, 0, 1)},
        {"name": "disabled", "polarity": 1, "enable": 0, "states": (0, 0, 0, 0, 0)},
    ],
    title="cam 1, {name}",
    requirements=("C406-027", "C406-028", "C406-029", "C406-032"),
)
def cam(ctx: CaseContext, name: str, polarity: int, enable: int, states: tuple[int, ...]) -> None:
    """Ends included, hysteresis on leaving, polarity, enable; the other cams stay as they are."""
    del name
    encoder = Encoder(ctx)
    encoder.configure(
        {(0x6310, 1): 100, (0x6320, 1): 200, (0x6330, 1): 10, (0x6302, 1): polarity, (0x6301, 1): enable}
    )
    for steps, state in zip((99, 100, 200, 210, 211), states, strict=True):
        encoder.count(steps)
        encoder.shows(0x6300, state, "C406-027", sub=1, signed=False)
    encoder.count(205)
    encoder.shows(0x6300, states[-1], "C406-032", sub=1, signed=False)


@CAMPAIGN.case("work-area", requirements=("C406-033", "C406-034"))
def work_area(ctx: CaseContext) -> None:
    """Beyond the high limit bits 0 and 1, below the low one bits 0 and 2; the limits cannot cross."""
    encoder = Encoder(ctx)
    encoder.configure({(0x6401, 1): 1000, (0x6402, 1): 2000})
    for steps, state in ((999, 0b101), (1000, 0), (2000, 0), (2001, 0b011)):
        encoder.count(steps)
        encoder.shows(0x6400, state, "C406-033", sub=1)
    encoder.refuses(0x6401, 2001, CROSSED, "C406-034", sub=1)
    encoder.refuses(0x6402, 999, CROSSED, "C406-034", sub=1)


@CAMPAIGN.case("alarm", requirements=("C406-050", "C406-038"))
def alarm(ctx: CaseContext) -> None:
    """Beyond its scale: alarm bit, EMCY with its register; all of it goes with the cause."""
    encoder = Encoder(ctx, "scale")
    encoder.listen(0x80 + NODES["scale"])
    encoder.count(19_000)
    encoder.shows(0x6503, 0)
    encoder.count(25_000)
    encoder.shows(0x6503, 1, "C406-050")
    encoder.shows(0x1001, 0x21, "C406-038")
    frames = encoder.taken(0x80 + NODES["scale"])
    encoder.equal("EMCY 1000h 21h", frames[0][:3] == b"\x00\x10\x21", 1, "C406-038")
    encoder.count(5_000)
    encoder.shows(0x6503, 0, "C406-050")
    encoder.shows(0x1001, 0, "C406-038")
    encoder.shows(0x6004, 5_000, "C406-050")
    encoder.equal("EMCY 0000h", encoder.taken(0x80 + NODES["scale"])[-1][:3] == b"\0\0\0", 1, "C406-038")


@CAMPAIGN.case("linear", requirements=("C406-013", "C406-018"))
def linear(ctx: CaseContext) -> None:
    """A linear encoder counts its position steps, wraps at its code, and turns round with bit 3."""
    encoder = Encoder(ctx, "cyclic")
    for step_nm, back in ((1000, 0), (1500, 0), (7919, 8), (20_000, 8)):
        encoder.write(0x6005, step_nm, 1)
        encoder.write(0x6000, 4 | back)
        total = 20_000_000 // step_nm
        encoder.shows(0x6002, total, "C406-018")
        for steps in (17, 12_345, 20_100):
            encoder.count(steps)
            there = (-steps if back else steps) % 20_000
            encoder.shows(0x6004, there * 1000 // step_nm % total, "C406-018", within=1 if back else 0)


@CAMPAIGN.case("heads", requirements=("C406-009", "C406-021", "C406-047"))
def heads(ctx: CaseContext) -> None:
    """Each sensor has its own position, preset and offset; the plain objects are those of the first."""
    encoder = Encoder(ctx, "heads")
    encoder.count(3_000)
    encoder.shows(0x6020, 3_000, "C406-021", sub=1)
    encoder.shows(0x6020, 8_000, "C406-021", sub=2)
    encoder.write(0x6010, 100, 2)
    ctx.run_for(0.004)
    encoder.shows(0x6020, 3_000, "C406-021", sub=1)
    encoder.shows(0x6020, 100, "C406-021", sub=2)
    encoder.shows(0x650C, 100 - 8_000, "C406-047", sub=2)
    encoder.write(0x6003, 7)
    ctx.run_for(0.004)
    encoder.shows(0x6020, 7, "C406-009", sub=1)
    encoder.shows(0x6509, 7 - 3_000, "C406-009")


@CAMPAIGN.case("memory", requirements=("C406-005", "C406-007"))
def memory(ctx: CaseContext) -> None:
    """A preset is kept at once; a scaling only when it was stored, and the preset with it."""
    encoder = Encoder(ctx)
    save = int.from_bytes(b"save", "little")
    encoder.count(1_000)
    encoder.write(0x6003, 50)
    for stored in (False, True):
        encoder.nmt(NmtCommand.RESET_NODE)
        ctx.run_for(0.05)
        encoder.shows(0x6004, 50, "C406-005")
        encoder.shows(0x6509, -950, "C406-005")
        if not stored:
            encoder.write(0x6001, 500)
            encoder.write(0x6003, 60)
            encoder.nmt(NmtCommand.RESET_NODE)
            ctx.run_for(0.05)
            encoder.shows(0x6001, STEPS, "C406-007")
            encoder.shows(0x6509, 0, "C406-007")
            encoder.write(0x6003, 50)
    encoder.write(0x6001, 500)
    encoder.write(0x6003, 60)
    encoder.write(0x1010, save, 1)
    encoder.nmt(NmtCommand.RESET_NODE)
    ctx.run_for(0.05)
    encoder.shows(0x6001, 500, "C406-007")
    encoder.shows(0x6004, 60, "C406-007")


@CAMPAIGN.case("pdo", requirements=("C406-053",))
def pdo(ctx: CaseContext) -> None:
    """TPDO1 comes with its timer, TPDO2 with every SYNC; both have the position."""
    encoder = Encoder(ctx)
    encoder.count(4_321)
    encoder.listen(0x187, 0x287)
    encoder.write(0x6200, 20)
    encoder.nmt(NmtCommand.START)
    ctx.run_for(0.01)
    encoder.taken(0x187)
    encoder.taken(0x287)
    ctx.run_for(0.1)
    cyclic = encoder.taken(0x187)
    encoder.equal("TPDO1 in 0.1 s", len(cyclic), 5, within=1)
    encoder.equal("position in TPDO1", int.from_bytes(cyclic[-1][:4], "little"), 4_321)
    synchronous = encoder.taken(0x287)
    before = len(synchronous)
    for _ in range(3):
        encoder.send(0x80, b"")
        ctx.run_for(0.001)
    found = encoder.taken(0x287)
    encoder.equal("TPDO2 for 3 SYNCs of ours", len(found), 3, within=3 if before else 0)
    encoder.equal("position in TPDO2", int.from_bytes(found[-1][:4], "little"), 4_321)


# -- PROFIdrive ---------------------------------------------------------------------------------------------


class Words:
    """A PROFIdrive encoder, led by its control word.

    Args:
        ctx: The case.
        name: Its name.

    """

    def __init__(self, ctx: CaseContext, name: str = "pd81") -> None:
        self._ctx = ctx
        self.device: Any = ctx.bench.encoder(name)
        self.port: Any = ctx.bench.encoder_port(name)
        ctx.wait_until(lambda: self.port.link_ok, 5.0, "the encoder answers")
        ctx.run_for(0.3)

    def __getitem__(self, name: str) -> int:
        """Return a signal of the telegram."""
        return int(self.port.actual(name))

    def send(self, g1_stw: int, seconds: float = 0.03) -> None:
        """Send the control word from now on."""
        self._ctx.do(f"G1_STW = {g1_stw:04X}h")
        self.port.g1_stw = g1_stw
        self._ctx.run_for(seconds)

    def turn(self, revolutions_s: float, seconds: float) -> None:
        """Turn the shaft."""
        self._ctx.do(f"turn the shaft with {revolutions_s} revolutions/s")
        self.device.turn_shaft(revolutions_s * math.tau)
        self._ctx.run_for(seconds)


@CAMPAIGN.product(
    "telegram/{number}",
    parameters={"number": (81, 82, 83, 84)},
    title="telegram {number}: position, absolute value, speed",
    requirements=("PD-010", "PD-011", "PD-012", "PD-013"),
)
def telegram(ctx: CaseContext, number: int) -> None:
    """Increments per revolution, the absolute value on request, the speed by its reference."""
    words = Words(ctx, f"pd{number}")
    counter = "G1_XIST3" if number == 84 else "G1_XIST1"
    before = words[counter]
    words.turn(2.5, 0.4)
    words.turn(0.0, 0.1)
    turned = (words[counter] - before) / (2.5 * 0.4)
    shift = round(math.log2(abs(turned) / LINES))
    equal(
        ctx, "increments per revolution", turned, LINES * 2**shift, "PD-010", within=LINES * 2**shift * 0.02
    )
    equal(ctx, "ZSW2_ENC without its sign of life", words["ZSW2_ENC"] & 0x0FFF, 0x0200, "PD-084")
    words.send(int(G_STW.ABSOLUTE_CYCLICALLY))
    equal(ctx, "G1_ZSW", words["G1_ZSW"], int(G_ZSW.ABSOLUTE_CYCLICALLY), "PD-148")
    first = words["G1_XIST2"]
    words.turn(-1.0, 0.5)
    if number != 81:
        name = "NIST_A" if number == 82 else "NIST_B"
        full = 0x4000 if number == 82 else 0x4000_0000
        value = words[name] - (1 << (16 if number == 82 else 32)) * (words[name] >= full * 2)
        equal(ctx, name, value / full * 3000.0, -60.0, "PD-012", within=1.0)
    words.turn(0.0, 0.1)
    equal(ctx, "way of the absolute value", (words["G1_XIST2"] - first) / LINES, -256, "PD-013", within=5)
    words.send(0)
    equal(ctx, "G1_ZSW", words["G1_ZSW"], 0, "PD-148")


@CAMPAIGN.case("parking", requirements=("PD-149",))
def parking(ctx: CaseContext) -> None:
    """A parked encoder says so and stands still; afterwards it goes on without an error."""
    words = Words(ctx)
    words.send(int(G_STW.PARK))
    equal(ctx, "G1_ZSW", words["G1_ZSW"], int(G_ZSW.PARKING), "PD-149")
    words.turn(1.0, 0.2)
    words.turn(0.0, 0.05)
    equal(ctx, "no error", words["G1_ZSW"] & G_ZSW.ERROR, 0, "PD-149")
    words.send(0, 0.1)
    equal(ctx, "G1_ZSW", words["G1_ZSW"], 0, "PD-149")
    before = words["G1_XIST1"]
    words.turn(1.0, 0.2)
    equal(ctx, "it counts again", words["G1_XIST1"] > before, 1, "PD-149")


@CAMPAIGN.case("zero-mark", requirements=("PD-141", "PD-142", "PD-143"))
def zero_mark(ctx: CaseContext) -> None:
    """The search shows its function, then the value in G1_XIST2 on request; an abort takes it back."""
    words = Words(ctx, "pd")
    words.send(0x0011)
    equal(ctx, "function active", words["G1_ZSW"], 0x0001, "PD-141")
    words.send(0x0031)
    words.send(0)
    equal(ctx, "aborted", words["G1_ZSW"], 0, "PD-143")
    words.send(0x0011)
    words.turn(2.0, 0.9)
    words.turn(0.0, 0.05)
    equal(ctx, "the search is over", words["G1_ZSW"], 0, "PD-142")
    words.send(0)
    words.send(0x0021)
    equal(ctx, "value there", words["G1_ZSW"], 0x0010, "PD-142")
    shown = words["G1_XIST2"]
    equal(ctx, "zero mark within a revolution", shown % (LINES << 11), MARK, "PD-142", within=1)
    words.send(0)
    equal(ctx, "G1_ZSW", words["G1_ZSW"], 0, "PD-142")


@CAMPAIGN.product(
    "error/{code}",
    parameters={"code": (1, 2)},
    title="error {code} of the encoder",
    requirements=("PD-160",),
)
def error(ctx: CaseContext, code: int) -> None:
    """The error bit and the code in G1_XIST2, until it is acknowledged and its cause is gone."""
    words = Words(ctx)
    fault = ctx.inject("encoder.error", "pd81", code=code)
    ctx.run_for(0.05)
    equal(ctx, "error bit", words["G1_ZSW"] & G_ZSW.ERROR, int(G_ZSW.ERROR), "PD-160")
    equal(ctx, "code", words["G1_XIST2"], code, "PD-160")
    fault.remove()
    ctx.run_for(0.05)
    equal(ctx, "error bit without its cause", words["G1_ZSW"] & G_ZSW.ERROR, int(G_ZSW.ERROR), "PD-160")
    words.send(int(G_STW.ACKNOWLEDGE), 0.1)
    words.send(0, 0.1)
    equal(ctx, "G1_ZSW", words["G1_ZSW"], 0, "PD-160")
