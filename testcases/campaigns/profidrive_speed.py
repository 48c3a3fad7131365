"""The speed mode of a PROFIdrive drive in telegram 105: ramps, limits, words of status, parameters."""

from __future__ import annotations

import struct
from typing import Final

import numpy as np

from fieldbus.canopen import NmtCommand
from fieldbus.profidrive.words import MELDW, STW1, STW2, ZSW1, ZSW2
from hil.bench import BenchFile
from hil.campaign import Campaign, CaseContext
from testcases.campaigns._led_servo import Node
from testcases.campaigns.support import equal

DRIVE: Final = "drive1"
NODE: Final = 5
BENCH: Final = BenchFile(
    "led drive, speed mode",
    f"""
[bench]
name = "led drive, speed mode"
kind = "virtual"
cycle_ms = 4

[segment.can0]
bitrate = 1_000_000

[drive.drive1]
profile = "profidrive"
telegram = 105
segment = "can0"
node_id = {NODE}
off1_ramp_s = 0.8
off3_ramp_s = 0.3

[drive.drive1.mechanics]
coulomb_friction_n = 0.0
viscous_friction_n_per_m_s = 0.0
negative_stop_mm = -5000.0
positive_stop_mm = 5000.0

[drive.drive1.switches]
negative_limit_mm = -4900.0
positive_limit_mm = 4900.0

[drive.drive1.profidrive]
operating_mode = 1
ramp_up_s = 0.5
""",
)
CAMPAIGN: Final = Campaign(
    "profidrive speed", controller="", tags=("telegram",), bench="testcases.campaigns.profidrive_speed:BENCH"
)

OFF: Final = 0x047E
RUN: Final = 0x047F
FULL: Final = 0x4000_0000
TOP: Final = 3000.0
UP_S, DOWN_S, QUICK_S = 0.5, 0.8, 0.3
ALL_WELL: Final = int(
    ZSW1.READY_TO_SWITCH_ON
    | ZSW1.READY
    | ZSW1.OPERATION_ENABLED
    | ZSW1.NO_OFF2
    | ZSW1.NO_OFF3
    | ZSW1.DEVIATION_IN_TOLERANCE
    | ZSW1.CONTROL_REQUESTED
)
REACHED: Final = int(ZSW1.SPEED_REACHED)
"""The speed is at or above the comparison value, whatever the setpoint is."""
WORD: Final = 0x07FF
"""Bits of ZSW1 whose meaning the profile fixes."""


class Led:
    """The drive, led by the words of its telegram, with its parameters by SDO.

    Args:
        ctx: The case.

    """

    def __init__(self, ctx: CaseContext, *, on: bool = True) -> None:
        self._ctx = ctx
        self.master = ctx.bench.telegram(DRIVE)
        self.node = Node(ctx, NODE)
        self.send("OFF1", 0.3, STW1=OFF)
        if on:
            self.send("ON", 0.3, STW1=RUN)
            self.bits("ZSW1", 0x4F, 0x07, "PD-060")

    def send(self, text: str, seconds: float, **words: int) -> float:
        """Send words from now on, let time pass; return when that was."""
        self._ctx.do(text, **words)
        begun = self._ctx.now_s
        self.master.send(**words)
        self._ctx.run_for(seconds)
        return begun

    def turn(self, rpm: float, seconds: float, **words: int) -> float:
        """Give a speed."""
        return self.send(f"{rpm:g} rpm", seconds, NSOLL_B=round(rpm / TOP * FULL), **words)

    def bits(self, name: str, mask: int, wanted: int, *ids: str) -> None:
        """Expect bits of a word of the telegram now."""
        equal(self._ctx, f"{name} & {mask:04X}h", self.master[name] & mask, wanted & mask, *ids)

    @property
    def speed(self) -> float:
        """Speed of the motor, rpm."""
        return float(self._ctx.trace()[f"{DRIVE}.motor_speed"].values[-1])

    def slope(self, since: float, seconds: float) -> float:
        """Slope of the speed of the motor, rpm/s."""
        signal = self._ctx.trace()[f"{DRIVE}.motor_speed"].between(since, since + seconds)
        return float(np.polyfit(signal.time_s - since, signal.values, 1)[0])

    def parameter(self, number: int, sub: int = 0) -> float:
        """Read a REAL32 parameter by SDO."""
        return float(struct.unpack("<f", number_of(self.node.upload(0x2000 + number, sub)))[0])

    def write(self, number: int, value: float, *, code: int = 0) -> None:
        """Write a REAL32 parameter by SDO and expect this abort code."""
        found = self.node.download(0x2000 + number, 0, struct.pack("<f", value))
        equal(self._ctx, f"abort code of p{number} = {value:g}", found, code, "PD-343")


@CAMPAIGN.product(
    "ramp/{way}",
    parameters=[{"way": "forward", "sign": 1.0}, {"way": "backward", "sign": -1.0}],
    title="ramps {way}",
    requirements=("PD-116", "PD-271"),
)
def ramp(ctx: CaseContext, way: str, sign: float) -> None:
    """Up with p1120, down with p1121, the quick stop with p1135; NIST_B, ZSW1 and MELDW tell of it."""
    del way
    led = Led(ctx)
    led.bits("ZSW1", WORD, ALL_WELL, "PD-060")
    begun = led.turn(sign * 1500.0, 0.12)
    equal(
        ctx, "slope up", led.slope(begun + 0.03, 0.1), sign * TOP / UP_S, "PD-271", within=0.03 * TOP / UP_S
    )
    led.bits("ZSW1", WORD & ~REACHED, ALL_WELL, "PD-070")
    led.bits("MELDW", MELDW.RAMP_COMPLETED, 0, "PD-085")
    ctx.run_for(0.33)
    equal(ctx, "speed", led.speed, sign * 1500.0, "PD-005", within=1.0)
    value = led.master["NIST_B"]
    value -= (value >= 1 << 31) << 32
    equal(ctx, "NIST_B", value, sign * FULL / 2, "PD-005", within=FULL / 2000)
    led.bits("ZSW1", WORD, ALL_WELL | REACHED, "PD-070")
    led.bits("MELDW", MELDW.RAMP_COMPLETED, int(MELDW.RAMP_COMPLETED), "PD-085")
    begun = led.turn(sign * 300.0, 0.15)
    equal(
        ctx,
        "slope down",
        led.slope(begun + 0.03, 0.1),
        -sign * TOP / DOWN_S,
        "PD-271",
        within=0.03 * TOP / DOWN_S,
    )
    ctx.run_for(0.4)
    led.turn(sign * 1500.0, 0.5)
    begun = led.send("OFF3", 0.1, STW1=RUN & ~STW1.NO_OFF3)
    equal(
        ctx,
        "slope of OFF3",
        led.slope(begun + 0.02, 0.07),
        -sign * TOP / QUICK_S,
        "PD-116",
        within=0.04 * TOP / QUICK_S,
    )
    ctx.run_for(0.3)
    led.bits("ZSW1", 0x6F, 0x40, "PD-105")


@CAMPAIGN.product(
    "off/{which}",
    parameters=[
        {"which": "1", "word": OFF, "slope": TOP / DOWN_S, "end": 0x31},
        {"which": "2", "word": RUN & ~int(STW1.NO_OFF2), "slope": 0.0, "end": 0x60},
        {"which": "3", "word": RUN & ~int(STW1.NO_OFF3), "slope": TOP / QUICK_S, "end": 0x50},
        {"which": "enable", "word": RUN & ~int(STW1.ENABLE_OPERATION), "slope": 0.0, "end": 0x33},
    ],
    title="OFF{which} at 1200 rpm",
    requirements=("PD-104", "PD-105", "PD-111"),
)
def off(ctx: CaseContext, which: str, word: int, slope: float, end: int) -> None:
    """Each way of switching off brakes with its ramp or not at all, and ends in its state with its bits."""
    led = Led(ctx)
    led.turn(1200.0, 0.4)
    begun = led.send(f"OFF{which}", 0.1, STW1=word)
    equal(ctx, "slope", led.slope(begun + 0.02, 0.07), -slope, "PD-116", within=0.04 * slope + 60.0)
    ctx.run_for(0.9)
    led.bits("ZSW1", 0x7F, end, "PD-060")
    led.bits("ZSW2", int(ZSW2.PULSES_ENABLED), 0, "PD-083")
    led.send("OFF1", 0.1, STW1=OFF, NSOLL_B=0)
    led.bits("ZSW1", 0x7F, 0x31, "PD-060")
    led.send("ON", 2.0, STW1=RUN)
    led.bits("ZSW1", 0x7F, 0x37, "PD-060")
    led.bits("ZSW2", int(ZSW2.PULSES_ENABLED), int(ZSW2.PULSES_ENABLED), "PD-083")


@CAMPAIGN.product(
    "off/{which}-disabled",
    parameters=[
        {"which": "1", "word": OFF, "end": 0x01, "identifier": "PD-110"},
        {"which": "3", "word": RUN & ~int(STW1.NO_OFF3), "end": 0x40, "identifier": "PD-113"},
    ],
    title="operation is disabled on the ramp of OFF{which}",
    requirements=lambda identifier, **_: (identifier,),
)
def disabled_on_the_ramp(ctx: CaseContext, which: str, word: int, end: int, identifier: str) -> None:
    """Without the enable of operation the pulses go at once, on either ramp, and the motor coasts."""
    for sign in (1.0, -1.0):
        led = Led(ctx)
        led.turn(1500.0 * sign, 0.6)
        led.send(f"OFF{which}", 0.06, STW1=word)
        led.bits("ZSW2", int(ZSW2.PULSES_ENABLED), int(ZSW2.PULSES_ENABLED), "PD-083")
        begun = led.send("operation disabled", 0.1, STW1=word & ~int(STW1.ENABLE_OPERATION))
        led.bits("ZSW2", int(ZSW2.PULSES_ENABLED), 0, identifier)
        led.bits("ZSW1", 0x47, end, identifier)
        equal(ctx, "slope", led.slope(begun + 0.02, 0.07), 0.0, identifier, within=60.0)
        led.send("OFF1", 0.1, STW1=OFF)


@CAMPAIGN.product(
    "ramp-bits/{bit}",
    parameters=[
        {"bit": "enable", "mask": int(STW1.RAMP_ENABLE), "stays": 0.0},
        {"bit": "release", "mask": int(STW1.RAMP_RELEASE), "stays": 1.0},
        {"bit": "setpoint", "mask": int(STW1.SETPOINT_ENABLE), "stays": 0.0},
        {"bit": "control", "mask": int(STW1.CONTROL_BY_PLC), "stays": 1.0},
    ],
    title="STW1 without the bit of: {bit}",
    requirements=("PD-050", "PD-051", "PD-052", "PD-076"),
)
def ramp_bits(ctx: CaseContext, bit: str, mask: int, stays: float) -> None:
    """The ramp is reset, held, or led to zero; without control by PLC nothing new is taken over."""
    led = Led(ctx)
    led.turn(900.0, 0.4)
    begun = led.send(f"without {bit}", 0.05, STW1=RUN & ~mask, NSOLL_B=round(1800 / TOP * FULL))
    ctx.run_for(1.0)
    equal(ctx, "speed", led.speed, 900.0 * stays, "PD-050", within=2.0)
    if bit == "setpoint":
        found = led.slope(begun + 0.02, 0.15)
        equal(ctx, "slope", found, -TOP / DOWN_S, "PD-052", within=0.05 * TOP / DOWN_S)
    led.bits("ZSW1", 0x4F, 0x07, "PD-060")
    led.send("with it again", 0.8, STW1=RUN)
    equal(ctx, "speed", led.speed, 1800.0, "PD-050", within=2.0)


@CAMPAIGN.product(
    "thresholds/{rpm}",
    parameters=[
        {"rpm": 0, "low": 1, "high": 1},
        {"rpm": 30, "low": 0, "high": 1},
        {"rpm": -880, "low": 0, "high": 1},
        {"rpm": 930, "low": 0, "high": 0},
    ],
    title="MELDW at {rpm} rpm",
    requirements=("PD-085",),
)
def thresholds(ctx: CaseContext, rpm: int, low: int, high: int) -> None:
    """Every bit of MELDW at a constant speed: the two thresholds, and the others of a healthy axis."""
    led = Led(ctx)
    led.turn(rpm, 0.6)
    healthy = int(
        MELDW.RAMP_COMPLETED
        | MELDW.TORQUE_BELOW_THRESHOLD
        | MELDW.NO_MOTOR_OVERTEMPERATURE
        | MELDW.NO_POWER_UNIT_OVERLOAD
        | MELDW.DEVIATION_IN_TOLERANCE
        | MELDW.CONTROLLER_ENABLED
        | MELDW.READY
        | MELDW.PULSES_ENABLED
    )
    wanted = healthy | low * MELDW.SPEED_BELOW_THRESHOLD_3 | high * MELDW.SPEED_BELOW_THRESHOLD_2
    led.bits("MELDW", 0xFFFF, int(wanted), "PD-085")
    led.send("OFF1", 1.0, STW1=OFF)
    led.bits(
        "MELDW",
        int(MELDW.CONTROLLER_ENABLED | MELDW.PULSES_ENABLED | MELDW.READY),
        int(MELDW.READY),
        "PD-085",
    )


@CAMPAIGN.case("torque-reduction", requirements=("PD-037", "MC-574"))
def torque_reduction(ctx: CaseContext) -> None:
    """MOMRED takes away its part of both limits: a blocked motor gives exactly what is left."""
    led = Led(ctx)
    ctx.inject("mechanics.jam", DRIVE)
    torque = f"{DRIVE}.torque"
    for reduction, rpm in ((0x0000, 600.0), (0x1000, -600.0), (0x3000, 600.0)):
        led.turn(rpm, 0.5, MOMRED=reduction)
        found = float(ctx.trace()[torque].values[-1])
        wanted = 6.0 * (1.0 - reduction / 0x4000) * (1.0 if rpm > 0 else -1.0)
        equal(ctx, "torque, Nm", found, wanted, "PD-037", within=0.02)
        led.bits("ZSW1", int(ZSW1.TORQUE_LIMIT_NOT_REACHED), 0, "PD-071")
        led.bits("MELDW", int(MELDW.TORQUE_BELOW_THRESHOLD), 0, "PD-085")


@CAMPAIGN.case("parking", requirements=("PD-082", "PD-083"))
def parking(ctx: CaseContext) -> None:
    """A parked axis says so, its encoder too, and cannot be switched on; afterwards it can."""
    led = Led(ctx, on=False)
    led.send("park", 0.1, STW2=int(STW2.PARKING))
    led.bits("ZSW2", int(ZSW2.PARKING), int(ZSW2.PARKING), "PD-083")
    led.bits("G1_ZSW", 0x4000, 0x4000, "PD-149")
    led.send("ON", 0.3, STW1=RUN)
    led.bits("ZSW1", 0x04, 0, "PD-082")
    led.send("OFF1", 0.1, STW1=OFF, STW2=0)
    led.bits("ZSW2", int(ZSW2.PARKING), 0, "PD-083")
    led.send("ON", 0.4, STW1=RUN)
    led.bits("ZSW1", 0x4F, 0x07, "PD-060")


@CAMPAIGN.case("encoder", requirements=("PD-141", "PD-142", "PD-148"))
def encoder(ctx: CaseContext) -> None:
    """G1_XIST1 counts with the motor; the zero mark is searched, read and cleared."""
    led = Led(ctx)
    before = led.master["G1_XIST1"]
    begun = float(ctx.trace()[f"{DRIVE}.position"].values[-1])
    led.turn(300.0, 0.8)
    led.turn(0.0, 0.8)
    way = (float(ctx.trace()[f"{DRIVE}.position"].values[-1]) - begun) * 1000.0 / 10.0
    counted = (led.master["G1_XIST1"] - before) & 0xFFFFFFFF
    per = counted / way / 131_072
    equal(
        ctx,
        "increments per revolution, as a power of two",
        per,
        2.0 ** round(np.log2(per)),
        "PD-141",
        within=0.02 * per,
    )
    led.send("search the zero mark", 0.05, G1_STW=0x0011)
    led.bits("G1_ZSW", 0xFFFF, 0x0001, "PD-141")
    led.turn(300.0, 0.6)
    led.turn(0.0, 0.4)
    led.bits("G1_ZSW", 0x000F, 0, "PD-141")
    led.send("no command", 0.03, G1_STW=0)
    led.send("read the value", 0.03, G1_STW=0x0021)
    led.bits("G1_ZSW", 0x00F0, 0x0010, "PD-142")
    led.send("no command", 0.03, G1_STW=0)
    led.bits("G1_ZSW", 0xFFFF, 0, "PD-142")


@CAMPAIGN.product(
    "parameter/{number}",
    parameters=[
        {"number": 1120, "value": 1.5, "low": -1.0, "slope": TOP / 1.5},
        {"number": 1121, "value": 0.4, "low": -1.0, "slope": TOP / 0.4},
        {"number": 1135, "value": 0.9, "low": -1.0, "slope": TOP / 0.9},
        {"number": 1083, "value": 700.0, "low": -1.0, "slope": 700.0},
    ],
    title="p{number} = {value}",
    requirements=("PD-343", "PD-269", "PD-271"),
)
def parameter(ctx: CaseContext, number: int, value: float, low: float, slope: float) -> None:
    """A parameter is an object 2000h + number; it acts at once, and values out of its range are refused."""
    led = Led(ctx)
    before = led.parameter(number)
    led.write(number, low, code=0x06090030)
    equal(ctx, f"p{number} is unchanged", led.parameter(number), before, "PD-343")
    led.write(number, value)
    equal(ctx, f"p{number}", led.parameter(number), value, "PD-343", within=1e-4)
    begun = led.turn(1200.0, 0.25)
    if number == 1120:
        equal(ctx, "slope up", led.slope(begun + 0.03, 0.2), slope, "PD-271", within=0.03 * slope)
        return
    ctx.run_for(0.6)
    if number == 1083:
        equal(ctx, "speed", led.speed, slope, "PD-269", within=2.0)
        return
    word = RUN if number == 1121 else RUN & ~int(STW1.NO_OFF3)
    begun = led.turn(0.0, 0.12, STW1=word)
    equal(ctx, "slope down", led.slope(begun + 0.02, 0.09), -slope, "PD-271", within=0.04 * slope)


@CAMPAIGN.case("parameters/refused", requirements=("PD-343", "PD-346"))
def parameters_refused(ctx: CaseContext) -> None:
    """No such parameter, no element, read only, wrong size: each its abort code."""
    led = Led(ctx, on=False)
    for number, sub, data, code in (
        (7, 0, b"\0\0", 0x06020000),
        (1121, 1, b"\0\0\0\0", 0x06090011),
        (964, 6, b"\0\0", 0x06090011),
        (964, 0, b"\0\0", 0x06010002),
        (1121, 0, b"\0\0", 0x06070010),
    ):
        found = led.node.download(0x2000 + number, sub, data)
        equal(ctx, f"abort code of p{number}[{sub}]", found, code, "PD-346")


@CAMPAIGN.product(
    "parameters/saved-{how}",
    parameters={"how": ("1010h", "p0971", "not")},
    title="parameters saved by {how}",
    requirements=("PD-344", "PD-250"),
)
def saved(ctx: CaseContext, how: str) -> None:
    """What was saved is there after a reset, what was not is not."""
    node = Node(ctx, NODE)
    ctx.run_for(0.05)
    node.write(0x2000 + 1121, FOURTH)
    if how == "1010h":
        node.download(0x1010, 1, b"save")
    elif how == "p0971":
        node.download(0x2000 + 971, 0, b"\1\0")
    node.write(0x2000 + 1120, FOURTH)
    node.nmt(NmtCommand.RESET_NODE)
    ctx.run_for(0.2)
    for number, value in ((1121, DOWN_S if how == "not" else 0.25), (1120, UP_S)):
        found = struct.unpack("<f", number_of(node.upload(0x2000 + number)))[0]
        equal(ctx, f"p{number}", found, value, "PD-344", within=1e-4)


FOURTH: Final = int.from_bytes(struct.pack("<f", 0.25), "little")
"""0.25 as a REAL32."""


def number_of(answer: bytes | int) -> bytes:
    """Return what an SDO upload brought; zeros where it was refused."""
    return answer if isinstance(answer, bytes) else bytes(4)


@CAMPAIGN.product(
    "sign-of-life/{cycles}",
    parameters={"cycles": (1, 6)},
    title="{cycles} telegrams are missing",
    requirements=("PD-127", "PD-129"),
)
def sign_of_life(ctx: CaseContext, cycles: int) -> None:
    """One missing telegram is tolerated, several make the drive stop by itself until it is acknowledged."""
    led = Led(ctx)
    led.turn(600.0, 0.5)
    ctx.inject("frame.drop", "can0", message="rpdo1", count=cycles)
    ctx.run_for(1.2)
    faults = list(ctx.trace().select(kind="drive.fault", source=DRIVE))
    equal(ctx, "faults", len(faults), cycles > 1, "PD-129")
    equal(ctx, "speed", led.speed, 0.0 if cycles > 1 else 600.0, "PD-129", within=1.0)
    led.bits("ZSW1", 0x08, 0x08 if cycles > 1 else 0, "PD-068")
    if cycles > 1:
        led.send("acknowledge", 0.2, STW1=OFF | STW1.ACKNOWLEDGE, NSOLL_B=0)
        led.bits("ZSW1", 0x08, 0, "PD-137")
        led.send("OFF1", 0.2, STW1=OFF)
        led.send("ON", 0.4, STW1=RUN)
        led.bits("ZSW1", 0x4F, 0x07, "PD-060")


@CAMPAIGN.case("sign-of-life/now-and-then", requirements=("PD-127",))
def now_and_then(ctx: CaseContext) -> None:
    """A missing telegram is forgotten after ten right ones: then the next one is tolerated, too."""
    led = Led(ctx)
    led.turn(300.0, 0.3)
    for _ in range(4):
        ctx.inject("frame.drop", "can0", message="rpdo1", count=1)
        ctx.run_for(0.08)
    led.bits("ZSW1", 0x08, 0, "PD-127")
    equal(ctx, "speed", led.speed, 300.0, "PD-127", within=1.0)


@CAMPAIGN.case("speed-limits", requirements=("PD-269",))
def speed_limits(ctx: CaseContext) -> None:
    """p1083 and p1086 hold the setpoint, each in its direction, and let go what is within both."""
    led = Led(ctx)
    led.write(1083, 450.0)
    led.write(1086, -330.0)
    for rpm, wanted in ((900.0, 450.0), (-900.0, -330.0), (200.0, 200.0), (-200.0, -200.0)):
        led.turn(rpm, 0.5)
        equal(ctx, f"speed with {rpm:g} rpm", led.speed, wanted, "PD-269", within=1.0)
    led.write(1086, -900.0)
    led.turn(-900.0, 0.6)
    equal(ctx, "speed with another limit", led.speed, -900.0, "PD-269", within=1.0)


MANY_FAULTS: Final = (30002, 30001, 7011, 30004, 30005, 30011, 31110, 7901, 7900, 7860)


@CAMPAIGN.case("fault-situation", requirements=("PD-133", "PD-135", "PD-137"))
def fault_situation(ctx: CaseContext) -> None:
    """Eight messages make a situation, the newest stands in the last place of a full one; one that is there
    does not come again. Acknowledged they move on, and a fault whose cause lasts begins the next situation.
    """
    led = Led(ctx)

    def numbers(first: int) -> list[int]:
        found = [number_of(led.node.upload(0x2000 + 947, first + place)) for place in range(8)]
        return [int.from_bytes(one, "little") for one in found]

    lasting = ctx.inject("drive.fault", DRIVE, code=MANY_FAULTS[0], persistent=True)
    ctx.run_for(0.01)
    for code in (*MANY_FAULTS[1:], MANY_FAULTS[1]):
        ctx.inject("drive.fault", DRIVE, code=code)
        ctx.run_for(0.005)
    # The second fault stands there already: it is not entered again.
    full = [*MANY_FAULTS[:7], MANY_FAULTS[-1]]
    found = numbers(0)
    equal(ctx, f"p947 {found} is {full}", found == full, 1, "PD-135")
    led.send("acknowledge", 0.05, STW1=OFF | STW1.ACKNOWLEDGE)
    found = numbers(8)
    equal(ctx, f"the situation before {found} is {full}", found == full, 1, "PD-137")
    found = numbers(0)
    equal(ctx, f"p947 {found}: what lasts", found == [MANY_FAULTS[0], *7 * [0]], 1, "PD-137")
    led.bits("ZSW1", 0x08, 0x08, "PD-137")
    lasting.remove()
    led.send("no edge", 0.05, STW1=OFF)
    led.send("acknowledge", 0.05, STW1=OFF | STW1.ACKNOWLEDGE)
    led.bits("ZSW1", 0x08, 0, "PD-137")
    equal(ctx, "faults that are left", sum(numbers(0)), 0, "PD-137")


FAULTS: Final = {"overcurrent": 0x2310, "following": 0x8611}


@CAMPAIGN.product(
    "fault/{what}",
    parameters={"what": tuple(FAULTS)},
    title="fault: {what}",
    requirements=("PD-068", "PD-115", "PD-137"),
)
def fault(ctx: CaseContext, what: str) -> None:
    """The fault bit, the number in the buffer, no pulses; acknowledging takes its edge, ON a new one."""
    led = Led(ctx)
    led.turn(600.0, 0.4)
    ctx.inject("drive.fault", DRIVE, code=FAULTS[what])
    ctx.run_for(1.0)
    led.bits("ZSW1", 0x0C, 0x08, "PD-068")
    led.bits("MELDW", int(MELDW.PULSES_ENABLED | MELDW.CONTROLLER_ENABLED), 0, "PD-085")
    number = led.node.upload(0x2000 + 945, 0)
    equal(
        ctx,
        "a fault in r0945",
        isinstance(number, bytes) and int.from_bytes(number, "little") > 0,
        1,
        "PD-137",
    )
    led.send("acknowledge", 0.2, STW1=RUN | STW1.ACKNOWLEDGE)
    led.bits("ZSW1", 0x0C, 0, "PD-137")
    led.send("ON still set", 0.2, STW1=RUN)
    led.bits("ZSW1", 0x04, 0, "PD-115")
    led.send("OFF1", 0.1, STW1=OFF)
    led.send("ON", 0.4, STW1=RUN)
    led.bits("ZSW1", 0x4F, 0x07, "PD-060")
