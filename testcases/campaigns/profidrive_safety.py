"""Safety functions of a PROFIdrive axis, word by word in its safety channel, and the functions of its
setpoint channel: safe stops, standstill, speed, direction, position, brake; rounding, motor potentiometer,
inversion.
"""

from __future__ import annotations

import struct
from typing import Final

from fieldbus.profidrive.words import STW1, ZSW1
from hil.bench import BenchFile
from hil.campaign import Campaign, CaseContext
from testcases.campaigns.profidrive_speed import BENCH as SPEED
from testcases.campaigns.profidrive_speed import DOWN_S, DRIVE, FULL, OFF, QUICK_S, RUN, TOP, UP_S, Led
from testcases.campaigns.support import equal

BENCH: Final = BenchFile(
    "guarded drive",
    SPEED.text.replace('name = "led drive, speed mode"', 'name = "guarded drive"').replace(
        "operating_mode = 1", "operating_mode = 1\nsafety_telegram = 701"
    )
    + """
[drive.drive1.brake]
torque_nm = 10.0

[drive.drive1.safety]
ss1_time_ms = 500.0
ss2_time_ms = 600.0
sos_delay_ms = 200.0
sos_tolerance_mm = 0.5
sls_limits_mm_s = [250.0, 100.0, 400.0]
sls_factor_percent = 80.0
sls_delay_ms = 150.0
sls_reaction = "ss1"
sdi_tolerance_mm = 2.0
sdi_delay_ms = 120.0
sdi_reaction = "ss2"
slp_ranges_mm = [[-50.0, 40.0], [-20.0, 200.0]]
slp_delay_ms = 100.0
slp_reaction = "sto"
sbt_torque_nm = 1.0
sbt_time_ms = 300.0
""",
)
CAMPAIGN: Final = Campaign(
    "profidrive safety",
    controller="",
    tags=("telegram",),
    bench="testcases.campaigns.profidrive_safety:BENCH",
)
FUNCTIONS: Final = Campaign(
    "profidrive setpoints",
    controller="",
    tags=("telegram",),
    bench="testcases.campaigns.profidrive_speed:BENCH",
)
"""The setpoint channel, on the bench of the speed mode."""
STO, SS1, SS2, SOS, SLS = 0x0001, 0x0002, 0x0004, 0x0008, 0x0010
SOS_SELECTED, SLS_SELECTED, EVENT, MESSAGE = 0x0020, 0x0040, 0x0080, 0x8000
POSITIVE, NEGATIVE = 0x1000, 0x2000
OPEN_BRAKE: Final = 0x1000
LEVELS: Final = (250.0, 100.0, 400.0)
RPM: Final = 6.0
"""Of the motor, per mm/s."""


class Guarded(Led):
    """The drive, with its safety channel."""

    def safe(self, word: int, *ids: str, limit: float | None = None, third: int = 0) -> None:
        """Expect S_ZSW1B and S_ZSW3B, and the limit of S_V_LIMIT_B in rpm."""
        equal(self._ctx, "S_ZSW1B", self.master["S_ZSW1B"], word, *ids)
        equal(self._ctx, "S_ZSW3B", self.master["S_ZSW3B"] & 0x0FFF, third, *ids)
        if limit is not None:
            found = self.master["S_V_LIMIT_B"] / FULL * TOP
            equal(self._ctx, "S_V_LIMIT_B, rpm", found, limit, *ids, within=0.01)

    def stands(self, what: str, *ids: str) -> None:
        """Expect standstill."""
        equal(self._ctx, f"speed {what}", self.speed, 0.0, *ids, within=0.5)

    def again(self) -> None:
        """Switch on again."""
        self.send("OFF1", 0.1, STW1=OFF, NSOLL_B=0)
        self.send("ON", 0.5, STW1=RUN)
        self.bits("ZSW1", 0x4F, 0x07, "PD-060")


@CAMPAIGN.case("torque-off", requirements=("CFG-443", "CFG-471", "CFG-472", "CFG-439"))
def torque_off(ctx: CaseContext) -> None:
    """Safe torque off coasts without a fault and shows bit 0; it is a lasting OFF2."""
    led = Guarded(ctx)
    led.safe(0, "CFG-471", limit=TOP)
    led.turn(1200.0, 0.6)
    cause = ctx.inject("drive.sto", DRIVE)
    ctx.run_for(0.05)
    led.safe(STO, "CFG-472", limit=0.0)
    led.bits("ZSW1", 0x5F, 0x40, "CFG-443")
    torque = float(ctx.trace()[f"{DRIVE}.torque"].values[-1])
    equal(ctx, "torque, Nm", torque, 0.0, "CFG-443", within=1e-6)
    led.send("OFF1", 0.05, STW1=OFF)
    led.send("ON", 0.2, STW1=RUN)
    led.bits("ZSW1", 0x04, 0, "CFG-443")
    cause.remove()
    led.send("OFF1", 1.0, STW1=OFF, NSOLL_B=0)
    led.safe(0, "CFG-471", limit=TOP)
    led.again()


@CAMPAIGN.product(
    "stop-1/{how}",
    parameters={"how": ("in-time", "too-slow", "standing")},
    title="safe stop 1, {how}",
    requirements=("CFG-444", "CFG-473", "CFG-474"),
)
def stop_1(ctx: CaseContext, how: str) -> None:
    """It brakes on the ramp of OFF3, bit 1 all the time, bit 0 from standstill on; too slow a ramp is a
    fault.
    """
    led = Guarded(ctx, on=how != "standing")
    if how != "standing":
        led.turn(1500.0, 0.6)
    if how == "too-slow":
        led.write(1135, 3.0)
    cause = ctx.inject("drive.ss1", DRIVE)
    begun = ctx.now_s
    ctx.run_for(0.04)
    if how == "standing":
        led.safe(SS1 | STO, "CFG-474")
    elif how == "in-time":
        led.safe(SS1, "CFG-473", limit=0.0)
        ctx.run_for(0.06)
        slope = led.slope(begun + 0.03, 0.06)
        equal(ctx, "slope, rpm/s", slope, -TOP / QUICK_S, "CFG-444", within=0.05 * TOP / QUICK_S)
        led.bits("ZSW1", 0x20, 0, "CFG-444")
        ctx.run_for(0.2)
        led.safe(SS1 | STO, "CFG-474")
        led.stands("after safe stop 1", "CFG-444")
        led.bits("ZSW1", 0x08, 0, "CFG-444")
        led.send("OFF1", 0.05, STW1=OFF, NSOLL_B=0)
        led.send("ON", 0.3, STW1=RUN)
        led.bits("ZSW1", 0x04, 0, "CFG-444")
    else:
        ctx.run_for(0.5)
        led.bits("ZSW1", 0x08, 0x08, "CFG-444")
        led.safe(SS1 | STO, "CFG-474")
    cause.remove()
    led.send("acknowledge", 0.1, STW1=OFF | STW1.ACKNOWLEDGE, NSOLL_B=0)
    led.send("OFF1", 2.0, STW1=OFF)
    led.safe(0, "CFG-471")
    led.again()


@CAMPAIGN.case("stop-2", requirements=("CFG-445", "CFG-477", "CFG-478", "CFG-481", "CFG-482", "CFG-442"))
def stop_2(ctx: CaseContext) -> None:
    """It brakes on the ramp of OFF3 and stays in operation; the standstill is watched, and a load that is
    moved stops it for good, until it is acknowledged safely.
    """
    led = Guarded(ctx)
    led.turn(1500.0, 0.6)
    cause = ctx.inject("safety.ss2", DRIVE)
    begun = ctx.now_s
    ctx.run_for(0.1)
    led.safe(SS2, "CFG-477", limit=0.0)
    slope = led.slope(begun + 0.03, 0.06)
    equal(ctx, "slope, rpm/s", slope, -TOP / QUICK_S, "CFG-445", within=0.05 * TOP / QUICK_S)
    led.bits("ZSW1", 0x67, 0x07, "CFG-448")
    ctx.run_for(0.3)
    led.safe(SS2 | SOS | SOS_SELECTED, "CFG-481", limit=0.0)
    led.stands("at monitored standstill", "CFG-445")
    led.bits("ZSW1", 0x07, 0x07, "CFG-445")
    cause.remove()
    ctx.run_for(0.6)
    led.safe(0, "CFG-478", limit=TOP)
    led.bits("ZSW1", 0x20, 0x20, "CFG-448")
    equal(ctx, "speed after it", led.speed, 1500.0, "CFG-445", within=1.0)
    cause = ctx.inject("safety.ss2", DRIVE)
    ctx.run_for(0.5)
    ctx.inject("mechanics.load_step", DRIVE, force_N=20_000.0, duration_s=0.05)
    ctx.run_for(0.06)
    found = led.master["S_ZSW1B"] & (EVENT | MESSAGE)
    equal(ctx, "event and message", found, EVENT | MESSAGE, "CFG-481")
    led.bits("ZSW1", int(ZSW1.WARNING), int(ZSW1.WARNING), "CFG-481")
    ctx.run_for(0.7)
    cause.remove()
    led.send("OFF1", 0.1, STW1=OFF, NSOLL_B=0)
    equal(ctx, "message stays", led.master["S_ZSW1B"] & (MESSAGE | STO), MESSAGE | STO, "CFG-481")
    ctx.inject("safety.acknowledge", DRIVE)
    ctx.run_for(0.1)
    led.safe(0, "CFG-481")
    led.send("acknowledge", 0.1, STW1=OFF | STW1.ACKNOWLEDGE)
    led.again()


@CAMPAIGN.product(
    "standstill/{how}",
    parameters={"how": ("halted", "moving")},
    title="safe operating stop, {how}",
    requirements=("CFG-452", "CFG-481", "CFG-482"),
)
def standstill(ctx: CaseContext, how: str) -> None:
    """It brakes nothing; its delay begins with the selection, and who still moves then is stopped."""
    led = Guarded(ctx)
    led.turn(600.0, 0.4)
    cause = ctx.inject("safety.sos", DRIVE)
    rpm = 0.0 if how == "halted" else 600.0
    led.turn(rpm, 0.18)
    led.safe(SOS_SELECTED, "CFG-482", limit=0.0)
    ctx.run_for(0.05)
    if how == "halted":
        led.safe(SOS_SELECTED | SOS, "CFG-481", limit=0.0)
        cause.remove()
        ctx.run_for(0.05)
        led.safe(0, "CFG-482", limit=TOP)
        led.turn(600.0, 0.4)
        equal(ctx, "speed after it", led.speed, 600.0, "CFG-482", within=1.0)
        return
    found = led.master["S_ZSW1B"] & (SOS | EVENT | MESSAGE | SS1)
    equal(ctx, "standstill, event, message, safe stop 1", found, SOS | EVENT | MESSAGE | SS1, "CFG-481")
    ctx.run_for(0.4)
    led.stands("afterwards", "CFG-481")
    equal(ctx, "torque off", led.master["S_ZSW1B"] & STO, STO, "CFG-481")


@CAMPAIGN.product(
    "speed/{level}",
    parameters={"level": (1, 2, 3)},
    title="safely limited speed, level {level}",
    requirements=("CFG-457", "CFG-458", "CFG-463", "CFG-464", "CFG-485", "CFG-486", "CFG-487"),
)
def limited(ctx: CaseContext, level: int) -> None:
    """The limit of the setpoint is 80 % of the level; below the level nothing trips, above it the axis stops
    after the delay, and not before.
    """
    led = Guarded(ctx)
    top = LEVELS[level - 1] * RPM
    led.turn(top - 12.0, 1.2)
    cause = ctx.inject("safety.sls", DRIVE, level=level)
    ctx.run_for(0.1)
    shown = (level - 1) << 9
    led.safe(SLS_SELECTED | shown, "CFG-485", limit=0.8 * top)
    ctx.run_for(0.3)
    led.safe(SLS_SELECTED | SLS | shown, "CFG-486", limit=0.8 * top)
    led.bits("ZSW1", 0x4F, 0x07, "CFG-457")
    cause.remove()
    led.turn(top + 12.0, 0.3)
    led.safe(0, "CFG-485", limit=TOP)
    ctx.inject("safety.sls", DRIVE, level=level)
    ctx.run_for(0.13)
    led.safe(SLS_SELECTED | shown, "CFG-486")
    ctx.run_for(0.04)
    found = led.master["S_ZSW1B"] & (EVENT | MESSAGE | SS1)
    equal(ctx, "event, message, safe stop 1", found, EVENT | MESSAGE | SS1, "CFG-464")
    ctx.run_for(0.6)
    led.stands("afterwards", "CFG-464")


@CAMPAIGN.product(
    "direction/{way}",
    parameters=[{"way": "positive", "sign": 1}, {"way": "negative", "sign": -1}],
    title="safe direction: {way}",
    requirements=("CFG-465", "CFG-489", "CFG-490"),
)
def direction(ctx: CaseContext, way: str, sign: int) -> None:
    """The permitted direction is free and shown; the other one is tolerated for 2 mm, then the axis stops and
    stays under control.
    """
    led = Guarded(ctx)
    ctx.inject("safety.sdi", DRIVE, direction=way)
    bit = POSITIVE if sign > 0 else NEGATIVE
    led.turn(sign * 300.0, 0.4)
    led.safe(bit, "CFG-489", limit=0.0)
    equal(ctx, "speed in the permitted direction", led.speed, sign * 300.0, "CFG-465", within=1.0)
    led.turn(0.0, 0.4)
    before = float(ctx.trace()[f"{DRIVE}.position"].values[-1]) * 1000.0
    led.turn(-sign * 60.0, 0.15)
    led.safe(bit, "CFG-465")
    ctx.run_for(0.3)
    moved = (float(ctx.trace()[f"{DRIVE}.position"].values[-1]) * 1000.0 - before) * -sign
    equal(ctx, "way in the other direction, mm", moved, 2.4, "CFG-465", within=0.5)
    found = led.master["S_ZSW1B"] & (EVENT | MESSAGE | SS2)
    equal(ctx, "event, message, safe stop 2", found, EVENT | MESSAGE | SS2, "CFG-465")
    led.stands("afterwards", "CFG-465")
    led.bits("ZSW1", 0x07, 0x07, "CFG-465")


@CAMPAIGN.product(
    "position/{number}-{side}",
    parameters=[
        {"number": 1, "side": "upper", "end": 40.0, "sign": 1},
        {"number": 1, "side": "lower", "end": -50.0, "sign": -1},
        {"number": 2, "side": "lower", "end": -20.0, "sign": -1},
    ],
    title="safely limited position, range {number} at {end}",
    requirements=("CFG-494", "CFG-495"),
)
def position(ctx: CaseContext, number: int, side: str, end: float, sign: int) -> None:
    """Inside of the range nothing happens, beyond its end the torque goes; S_ZSW2B shows the selection."""
    del side
    led = Guarded(ctx)
    ctx.inject("safety.slp", DRIVE, range=number)
    ctx.run_for(0.05)
    word = 0x80 | (0x10 if number == 2 else 0)
    equal(ctx, "S_ZSW2B", led.master["S_ZSW2B"], word, "CFG-494")
    led.turn(sign * 300.0, 0.0)
    ctx.wait_until(lambda: led.master["S_ZSW1B"] & STO, 3.0, "the torque goes")
    there = float(ctx.trace()[f"{DRIVE}.position"].values[-1]) * 1000.0
    equal(ctx, "place, mm", there, end, "CFG-495", within=0.6)
    found = led.master["S_ZSW1B"] & (EVENT | MESSAGE)
    equal(ctx, "event, message", found, EVENT | MESSAGE, "CFG-495")


@CAMPAIGN.case("brake/control", requirements=("CFG-483", "PD-056"))
def brake_control(ctx: CaseContext) -> None:
    """STW1 bit 12 opens the brake at any time; safe torque off and safe brake control close it anyway."""
    led = Guarded(ctx, on=False)
    brake = ctx.bench.drive(DRIVE).core.brake
    for what, fault in (("safe torque off", "drive.sto"), ("safe brake control", "safety.sbc")):
        equal(ctx, "closed without bit 12", brake.closed, 1, "PD-056")
        led.send("open the brake", 0.3, STW1=OFF | OPEN_BRAKE)
        equal(ctx, "closed with bit 12", brake.closed, 0, "PD-056")
        cause = ctx.inject(fault, DRIVE)
        ctx.run_for(0.3)
        equal(ctx, f"closed with {what}", brake.closed, 1, "CFG-483")
        led.safe(STO, "CFG-483")
        cause.remove()
        ctx.run_for(0.3)
        equal(ctx, "closed afterwards", brake.closed, 0, "CFG-483")
        led.send("close the brake", 0.3, STW1=OFF)
    led.send("ON", 0.5, STW1=RUN)
    ctx.inject("safety.sbc", DRIVE)
    ctx.run_for(0.1)
    led.bits("ZSW1", 0x04, 0, "CFG-483")
    equal(ctx, "closed", brake.closed, 1, "CFG-483")


SELECT, START, OTHER_WAY = 0x01, 0x02, 0x08
SELECTED, ACTIVE, GOOD, COMPLETED = 0x01, 0x08, 0x10, 0x20


@CAMPAIGN.product(
    "brake/test-{way}",
    parameters={"way": ("positive", "negative", "worn")},
    title="safe brake test, {way}",
    requirements=("CFG-484",),
)
def brake_test(ctx: CaseContext, way: str) -> None:
    """Selected, started by an edge, active while it pulls with its torque, completed with its result; a brake
    that slips is no good one.
    """
    led = Guarded(ctx)
    if way == "worn":
        ctx.inject("drive.brake_slip", DRIVE, share=0.02)
    led.send("select", 0.05, S_STW3B=SELECT)
    led.safe(0, "CFG-484", third=SELECTED)
    word = SELECT | START | (OTHER_WAY if way == "negative" else 0)
    led.send("start", 0.3, S_STW3B=word)
    if way != "worn":
        led.safe(0, "CFG-484", third=SELECTED | ACTIVE)
        torque = float(ctx.trace()[f"{DRIVE}.torque"].values[-1])
        equal(ctx, "torque, Nm", torque, -1.0 if way == "negative" else 1.0, "CFG-484", within=0.02)
    ctx.run_for(1.5)
    led.safe(0, "CFG-484", third=SELECTED | COMPLETED | (0 if way == "worn" else GOOD))
    results = [entry.data.get("good") for entry in ctx.trace().select(kind="drive.brake_test", source=DRIVE)]
    equal(ctx, f"results {results}", results == [way != "worn"], 1, "CFG-484")
    led.send("a level starts nothing", 0.1, S_STW3B=word)
    led.safe(0, "CFG-484", third=SELECTED | COMPLETED | (0 if way == "worn" else GOOD))
    led.send("deselect", 0.1, S_STW3B=0)
    led.safe(0, "CFG-484")
    led.bits("ZSW1", 0x4F, 0x07, "CFG-484")
    if way != "worn":
        led.turn(300.0, 0.5)
        equal(ctx, "speed after the test", led.speed, 300.0, "CFG-484", within=1.0)


# -- setpoint channel ---------------------------------------------------------------------------------------


def time_to(ctx: CaseContext, led: Led, rpm: float, **words: int) -> float:
    """Give a speed and return how long the motor takes to it, s."""
    begun = ctx.now_s
    core = ctx.bench.drive(DRIVE).core
    rising = core.speed_rpm < rpm
    led.turn(rpm, 0.0, **words)
    there = (lambda: core.speed_rpm >= rpm - 0.6) if rising else (lambda: core.speed_rpm <= rpm + 0.6)
    ctx.wait_until(there, 20.0, f"{rpm:g} rpm")
    return ctx.now_s - begun


@FUNCTIONS.case("rounding", requirements=("PD-271", "PD-273"))
def rounding(ctx: CaseContext) -> None:
    """p1130 and p1131 make ramps longer by half of each, p1136 and p1137 the quick stop; OFF1 has the ramp
    too.
    """
    led = Led(ctx)
    share = 1500.0 / TOP
    for first, last in ((0.4, 0.2), (0.1, 0.6), (0.0, 0.0)):
        led.write(1130, first)
        led.write(1131, last)
        extra = (first + last) / 2
        took = time_to(ctx, led, 1500.0)
        equal(ctx, "time up, s", took, UP_S * share + extra, "PD-271", within=0.03)
        ctx.run_for(0.3)
        took = time_to(ctx, led, 0.0)
        equal(ctx, "time down, s", took, DOWN_S * share + extra, "PD-271", within=0.04)
        ctx.run_for(0.3)
    led.write(1136, 0.2)
    led.write(1137, 0.3)
    led.turn(1500.0, 1.0)
    took = time_to(ctx, led, 0.0, STW1=RUN & ~int(STW1.NO_OFF3))
    equal(ctx, "time of the quick stop, s", took, QUICK_S * share + 0.25, "PD-273", within=0.04)


@FUNCTIONS.case("limits", requirements=("PD-269", "PD-270"))
def speed_limits(ctx: CaseContext) -> None:
    """p1083 and p1086 limit each direction for itself."""
    led = Led(ctx)
    led.write(1083, 640.0)
    led.write(1086, -310.0)
    for asked, found in ((1500.0, 640.0), (-1500.0, -310.0), (300.0, 300.0), (-300.0, -300.0)):
        led.turn(asked, 1.2)
        equal(ctx, "speed", led.speed, found, "PD-269", within=1.0)


def source(led: Led, number: int, value: int) -> None:
    """Write a parameter that names a source."""
    led.node.download(0x2000 + number, 0, struct.pack("<I", value))


@FUNCTIONS.case("inversion", requirements=("PD-055",))
def inversion(ctx: CaseContext) -> None:
    """Bit 11 turns the setpoint round if p1113 names it, else it does nothing."""
    led = Led(ctx)
    led.turn(600.0, 0.6, STW1=RUN | STW1.BIT_11)
    equal(ctx, "speed without p1113", led.speed, 600.0, "PD-055", within=1.0)
    source(led, 1113, 0x082AFC0B)
    ctx.run_for(1.2)
    equal(ctx, "speed with p1113", led.speed, -600.0, "PD-055", within=1.0)
    led.turn(600.0, 1.2, STW1=RUN)
    equal(ctx, "speed without the bit", led.speed, 600.0, "PD-055", within=1.0)
    for bit in (STW1.BIT_13, STW1.BIT_14, STW1.BIT_15):
        led.turn(600.0, 0.3, STW1=RUN | bit)
        equal(ctx, "speed with a bit of no meaning", led.speed, 600.0, "PD-058", within=1.0)
        led.bits("ZSW1", 0x4F, 0x07, "PD-059")


@FUNCTIONS.case("potentiometer", requirements=("PD-057", "PD-058"))
def potentiometer(ctx: CaseContext) -> None:
    """Bits 13 and 14 raise and lower with p1082 in p1047, what is reached stays and is added; OFF1 forgets
    it.
    """
    led = Led(ctx)
    source(led, 1035, 0x082AFC0D)
    source(led, 1036, 0x082AFC0E)
    led.write(1047, 5.0)
    led.send("raise", 1.0, STW1=RUN | STW1.BIT_13)
    led.send("hold", 0.5, STW1=RUN)
    top = led.parameter(1082)
    equal(ctx, "r1050", led.parameter(1050), top / 5.0, "PD-057", within=0.01 * top)
    raised = led.parameter(1050)
    equal(ctx, "speed", led.speed, raised, "PD-057", within=1.0)
    led.send("lower", 0.5, STW1=RUN | STW1.BIT_14)
    led.turn(150.0, 0.6, STW1=RUN)
    lowered = led.parameter(1050)
    equal(ctx, "r1050", lowered, raised - top / 10.0, "PD-058", within=0.01 * top)
    equal(ctx, "speed with a setpoint", led.speed, lowered + 150.0, "PD-057", within=1.0)
    led.send("OFF1", 1.0, STW1=OFF)
    equal(ctx, "r1050 after OFF1", led.parameter(1050), 0.0, "PD-057")


@FUNCTIONS.case("jog", requirements=("PD-053", "PD-122", "PD-267"))
def jog(ctx: CaseContext) -> None:
    """Bits 8 and 9 turn with p1058 and p1059 without ON and without bits 4, 5, 6; both together stand with a
    warning, with another setpoint nothing moves.
    """
    led = Led(ctx, on=False)
    led.write(1058, 220.0)
    led.write(1059, -130.0)
    ready = OFF & ~0x70
    for bit, rpm in ((STW1.JOG_1, 220.0), (STW1.JOG_2, -130.0)):
        led.send("jog", 0.6, STW1=ready | bit)
        equal(ctx, "speed", led.speed, rpm, "PD-267", within=1.0)
        led.bits("ZSW1", 0x04, 0x04, "PD-053")
        led.send("no jog", 0.6, STW1=ready)
        equal(ctx, "speed without the bit", led.speed, 0.0, "PD-053", within=0.6)
        led.send("with a setpoint", 0.3, STW1=OFF | bit)
        equal(ctx, "speed with a setpoint", led.speed, 0.0, "PD-122", within=0.6)
        led.send("no jog", 0.1, STW1=ready)
    led.bits("ZSW1", int(ZSW1.WARNING), 0, "PD-122")
    led.send("both", 0.4, STW1=ready | STW1.JOG_1 | STW1.JOG_2)
    equal(ctx, "speed with both", led.speed, 0.0, "PD-122", within=0.6)
    led.bits("ZSW1", int(ZSW1.WARNING), int(ZSW1.WARNING), "PD-122")
