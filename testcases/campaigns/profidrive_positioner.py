"""The basic positioner of a PROFIdrive drive in telegram 111: tasks, homing, limits, all status words."""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from fieldbus.profidrive.words import POS_STW1, POS_STW2, POS_ZSW1, POS_ZSW2, STW1, ZSW1
from hil.bench import BenchFile
from hil.campaign import Campaign, CaseContext
from testcases.campaigns.support import equal

DRIVE: Final = "drive1"
MAX_ACC, MAX_DEC = 400, 800
"""Greatest acceleration and deceleration of the bench, 1000 LU/s2: mm/s2 with 1 LU = 1 um."""
BENCH: Final = BenchFile(
    "led positioner",
    f"""
[bench]
name = "led positioner"
kind = "virtual"
cycle_ms = 4

[segment.can0]
bitrate = 1_000_000

[drive.drive1]
profile = "profidrive"
telegram = 111
segment = "can0"
node_id = 5
index_increments = 40000

[drive.drive1.mechanics]
coulomb_friction_n = 0.0
viscous_friction_n_per_m_s = 0.0
negative_stop_mm = -160.0
positive_stop_mm = 170.0

[drive.drive1.switches]
home_from_mm = 33.0
home_to_mm = 48.0
negative_limit_mm = -120.0
positive_limit_mm = 130.0
hysteresis_mm = 0.0
input_filter_ms = 0.0
probe1_from_mm = 21.0

[drive.drive1.positioner]
max_acceleration = {MAX_ACC}
max_deceleration = {MAX_DEC}
max_velocity = 20000
software_limits = [-90000, 95000]
reference_position = 7000
reference_offset = 1500
jog_velocities = [-900, 1500]
jog_increments = [3000, 2000]
position_cams = [5000, -5000]
cam_velocity = 3000
mark_velocity = 600

[[drive.drive1.positioner.block]]
number = 1
task = "absolute"
position = 20000
velocity = 6000
continuation = "continue with stop"

[[drive.drive1.positioner.block]]
number = 2
task = "relative"
position = 30000
velocity = 9000
continuation = "continue flying"

[[drive.drive1.positioner.block]]
number = 3
task = "absolute"
position = 80000
velocity = 3000

[[drive.drive1.positioner.block]]
number = 5
task = "set output"
parameter = 3
continuation = "continue flying"

[[drive.drive1.positioner.block]]
number = 6
task = "wait"
parameter = 300
continuation = "continue flying"

[[drive.drive1.positioner.block]]
number = 7
task = "reset output"
parameter = 1
continuation = "continue flying"

[[drive.drive1.positioner.block]]
number = 8
task = "goto"
parameter = 3

[[drive.drive1.positioner.block]]
number = 10
task = "endless negative"
velocity = 4000
continuation = "continue external"

[[drive.drive1.positioner.block]]
number = 11
task = "relative"
position = 4000
velocity = 5000
acceleration_percent = 50
deceleration_percent = 25
""",
)
CAMPAIGN: Final = Campaign(
    "profidrive positioner",
    tags=("telegram", "positioner"),
    bench="testcases.campaigns.profidrive_positioner:BENCH",
)

READY: Final = 0x040F | STW1.NO_REJECT_TASK | STW1.NO_INTERMEDIATE_STOP
GO: Final = READY | STW1.ACTIVATE_TASK
MDI: Final = int(POS_STW1.MDI | POS_STW1.ABSOLUTE)
RELATIVE: Final = int(POS_STW1.MDI)
SETUP: Final = int(POS_STW1.MDI | POS_STW1.SETUP)
ZSW1_TASK: Final = int(
    ZSW1.TARGET_REACHED
    | ZSW1.HOME_POSITION_SET
    | ZSW1.TASK_ACKNOWLEDGED
    | ZSW1.STANDSTILL
    | ZSW1.ACCELERATING
    | ZSW1.DECELERATING
    | ZSW1.DEVIATION_IN_TOLERANCE
)
REST: Final = int(ZSW1.STANDSTILL | ZSW1.DEVIATION_IN_TOLERANCE)
POS_2: Final = 0xFFFF


class Axis:
    """The drive in operation, led by the words of its telegram.

    Args:
        ctx: The case.

    """

    def __init__(self, ctx: CaseContext, **words: int) -> None:
        self._ctx = ctx
        self.master = ctx.bench.telegram(DRIVE)
        self.send("OFF1", 0.1, STW1=READY & ~1, OVERRIDE=0x4000, MDI_VELOCITY=6000, **words)
        self.send("ON", 0.4, STW1=READY)
        equal(ctx, "ZSW1 in operation", self.master["ZSW1"] & 0x4F, 0x07, "PD-060")

    def send(self, text: str, seconds: float, **words: int) -> Axis:
        """Send words from now on, and let time pass."""
        self._ctx.do(text, **words)
        self.master.send(**words)
        self._ctx.run_for(seconds)
        return self

    def go(self, seconds: float, **words: int) -> Axis:
        """Give the edge that starts a task."""
        self.send("no task", 0.012, STW1=READY, **words)
        return self.send("start the task", seconds, STW1=GO)

    def home(self) -> Axis:
        """Make the present place the reference point; the position is 7000 LU then."""
        self.send("set the reference point", 0.02, POS_STW2=int(POS_STW2.SET_REFERENCE_POINT))
        return self.send("no reference point", 0.02, POS_STW2=0)

    def stands(self, lu: float, *ids: str, within: float = 25.0) -> Axis:
        """Expect the position, in the telegram and at the machine."""
        equal(self._ctx, "XIST_A", self.signed("XIST_A"), lu, *ids, within=within)
        return self

    def signed(self, name: str) -> int:
        """Return a signal of 32 bits with its sign."""
        value = self.master[name]
        return value - (1 << 32) if value >= 1 << 31 else value

    @property
    def velocity(self) -> float:
        """Velocity of the machine, mm/s."""
        return float(self._ctx.trace()[f"{DRIVE}.velocity"].values[-1]) * 1000.0

    @property
    def machine(self) -> float:
        """Place of the machine, mm."""
        return float(self._ctx.trace()[f"{DRIVE}.position"].values[-1]) * 1000.0

    def shows(self, zsw1: int, pos_zsw1: int, pos_zsw2: int, *ids: str) -> Axis:
        """Expect every bit of the status words of the positioner."""
        for name, mask, wanted in (
            ("ZSW1", ZSW1_TASK, zsw1),
            ("POS_ZSW1", 0xFFFF, pos_zsw1),
            ("POS_ZSW2", POS_2, pos_zsw2),
        ):
            found = self.master[name] & mask
            self._ctx.do(f"{name} is {found:04X}h, to be {wanted:04X}h")
            equal(self._ctx, f"{name} & {mask:04X}h", found, wanted, *ids)
        return self


CAMS: Final = {True: int(POS_ZSW2.CAM_1 | POS_ZSW2.CAM_2), False: int(POS_ZSW2.CAM_1)}
STOOD: Final = int(POS_ZSW2.SETPOINT_STANDS)
COMMAND: Final = int(POS_ZSW2.COMMAND_ACTIVE)
DONE: Final = int(ZSW1.TARGET_REACHED)
HOMED: Final = int(ZSW1.HOME_POSITION_SET)
TOLERANT: Final = int(ZSW1.DEVIATION_IN_TOLERANCE)
ACKNOWLEDGED: Final = int(ZSW1.TASK_ACKNOWLEDGED)


@CAMPAIGN.product(
    "mdi/{way}",
    parameters=[{"way": "forward", "target": 87_000}, {"way": "backward", "target": -73_000}],
    title="MDI absolute, {way}",
    requirements=("PD-051", "PD-070", "PD-088", "PD-090"),
)
def mdi(ctx: CaseContext, way: str, target: int) -> None:
    """Ramps of their own, every bit on the way and at the target, and the acknowledgement with its bit."""
    axis = Axis(ctx).home()
    axis.shows(REST | HOMED, 0, STOOD, "PD-091")
    forward = way == "forward"
    moves = int(POS_ZSW2.FORWARD if forward else POS_ZSW2.BACKWARD) | COMMAND
    mdi_on, acc, dec = int(POS_ZSW1.MDI), 0x2000, 0x1000
    begun = ctx.now_s + 0.012
    axis.go(0.1, POS_STW1=MDI, MDI_TARPOS=target, MDI_VELOCITY=6000, MDI_ACC=acc, MDI_DEC=dec)
    axis.shows(TOLERANT | HOMED | ACKNOWLEDGED | ZSW1.ACCELERATING, mdi_on, moves, "PD-074")
    sign = 1 if forward else -1
    equal(
        ctx, "velocity while speeding up", axis.velocity, sign * MAX_ACC * 0.5 * 0.097, "PD-040", within=2.0
    )
    ctx.run_for(0.5)
    axis.shows(TOLERANT | HOMED | ACKNOWLEDGED, mdi_on, moves | (0 if forward else CAMS[True]), "PD-072")
    equal(ctx, "velocity", axis.velocity, sign * 100.0, "PD-088", within=0.5)
    full = 0x4000_0000 * 600 / 3000
    equal(ctx, "NIST_B", axis.signed("NIST_B"), sign * full, "PD-005", within=0.01 * full)
    axis.send("the edge is over", 0.05, STW1=READY)
    ctx.wait_until(lambda: axis.master["ZSW1"] & DONE, 5.0, "the target is reached")
    v, a, d = 100.0, MAX_ACC * 0.5, MAX_DEC * 0.25
    needed = abs(target - 7000) / 1000.0 / v + 0.5 * v / a + 0.5 * v / d
    equal(ctx, "time of the task, s", ctx.now_s - begun, needed, "PD-040", within=0.05)
    ctx.run_for(0.1)
    axis.shows(REST | HOMED | DONE, mdi_on, STOOD | (0 if forward else CAMS[True]))
    axis.stands(target, "PD-088")
    equal(ctx, "machine, mm", axis.machine, (target - 7000) / 1000.0, within=0.03)


@CAMPAIGN.case("mdi/relative", requirements=("PD-088",))
def mdi_relative(ctx: CaseContext) -> None:
    """Ways add up, without a home position too; an absolute task is refused then, with warning 7461."""
    axis = Axis(ctx)
    place = axis.signed("XIST_A")
    for way in (11_000, 11_000, -5_000):
        axis.go(1.2, POS_STW1=RELATIVE, MDI_TARPOS=way)
        place += way
        axis.stands(place, "PD-088")
        equal(ctx, "target reached, no home position", axis.master["ZSW1"] & (DONE | HOMED), DONE, "PD-070")
    axis.go(0.2, POS_STW1=MDI, MDI_TARPOS=1_000)
    equal(ctx, "warning", axis.master["WARN_CODE"], 7461)
    equal(ctx, "not acknowledged", axis.master["ZSW1"] & ACKNOWLEDGED, 0)
    axis.stands(place)


@CAMPAIGN.case("mdi/continuous", requirements=("PD-088",))
def continuous(ctx: CaseContext) -> None:
    """With bit 12 a new target counts at once; without it, only with an edge."""
    axis = Axis(ctx).home().go(0.3, POS_STW1=MDI, MDI_TARPOS=50_000)
    axis.send("another target without an edge", 1.5, MDI_TARPOS=20_000).stands(50_000)
    axis.send("continuous take-over", 0.3, POS_STW1=MDI | int(POS_STW1.CONTINUOUS))
    axis.send("another target", 1.5, MDI_TARPOS=-12_000).stands(-12_000, "PD-088")


@CAMPAIGN.product(
    "override/{override}-{velocity}",
    parameters=[
        {"override": 0x4000, "velocity": 4_500, "mm_s": 75.0},
        {"override": 0x1000, "velocity": 4_500, "mm_s": 18.75},
        {"override": 0x6000, "velocity": 4_500, "mm_s": 112.5},
        {"override": 0x7FFF, "velocity": 19_000, "mm_s": 333.333},
        {"override": 0x0000, "velocity": 4_500, "mm_s": 0.0},
    ],
    title="set-up with override {override} and velocity {velocity}",
    requirements=("PD-039", "PD-040"),
)
def override(ctx: CaseContext, override: int, velocity: int, mm_s: float) -> None:
    """4000h is 100 %; the maximum velocity holds in any case, and POS_ZSW2 bit 1 says so."""
    axis = Axis(ctx)
    axis.send("to the left", 0.012, POS_STW1=SETUP | int(POS_STW1.NEGATIVE), MDI_VELOCITY=9_000)
    axis.send("go", 0.6, STW1=GO)
    axis.go(
        1.06 if mm_s > 300 else 0.7,
        POS_STW1=SETUP | int(POS_STW1.POSITIVE),
        MDI_VELOCITY=velocity,
        OVERRIDE=override,
    )
    equal(ctx, "velocity", axis.velocity, mm_s, "PD-039", within=0.01 * mm_s + 0.05)
    limited = axis.master["POS_ZSW2"] & POS_ZSW2.VELOCITY_LIMITED
    equal(ctx, "velocity limited", bool(limited), mm_s > 300, "PD-091")
    equal(ctx, "POS_ZSW1", axis.master["POS_ZSW1"], int(POS_ZSW1.SETUP), "PD-090")


@CAMPAIGN.case("set-up", requirements=("PD-088", "PD-090"))
def set_up(ctx: CaseContext) -> None:
    """By direction bits, until neither or both are set."""
    axis = Axis(ctx).go(0.7, POS_STW1=SETUP | int(POS_STW1.POSITIVE))
    equal(ctx, "velocity", axis.velocity, 100.0, "PD-088", within=0.5)
    axis.shows(TOLERANT | ACKNOWLEDGED, int(POS_ZSW1.SETUP), int(POS_ZSW2.FORWARD) | COMMAND, "PD-091")
    axis.send("negative", 0.9, POS_STW1=SETUP | int(POS_STW1.NEGATIVE))
    equal(ctx, "velocity", axis.velocity, -100.0, "PD-088", within=0.5)
    axis.send("both", 0.5, POS_STW1=SETUP | int(POS_STW1.NEGATIVE | POS_STW1.POSITIVE))
    equal(ctx, "velocity", axis.velocity, 0.0, "PD-088", within=0.05)


@CAMPAIGN.product(
    "interrupted/{how}",
    parameters={"how": ("pause", "reject", "pulses")},
    title="a task is interrupted: {how}",
    requirements=("PD-049", "PD-050"),
)
def interrupted(ctx: CaseContext, how: str) -> None:
    """A pause keeps the task, a rejection ends it with the greatest deceleration, so does OFF2."""
    axis = Axis(ctx).home().go(0.5, POS_STW1=MDI, MDI_TARPOS=80_000, MDI_DEC=0x1000)
    begun = ctx.now_s
    word = {
        "pause": GO & ~STW1.NO_INTERMEDIATE_STOP,
        "reject": GO & ~STW1.NO_REJECT_TASK,
        "pulses": GO & ~STW1.NO_OFF2,
    }[how]
    axis.send(how, 0.05, STW1=word)
    speed = ctx.trace()[f"{DRIVE}.velocity"].between(begun + 0.02, ctx.now_s)
    slope = float(np.polyfit(speed.time_s - begun, speed.values, 1)[0]) * -1000.0
    if how != "pulses":
        equal(
            ctx,
            "deceleration, mm/s2",
            slope,
            MAX_DEC * (0.25 if how == "pause" else 1.0),
            "PD-049",
            within=30.0,
        )
        axis.send("wait", 0.6)
        equal(ctx, "standstill", axis.master["ZSW1"] & (ZSW1.STANDSTILL | DONE), int(ZSW1.STANDSTILL))
        equal(ctx, "task kept", bool(axis.master["POS_ZSW2"] & COMMAND), how == "pause", "PD-050")
    if how == "pulses":
        axis.send("switch on again", 0.2, STW1=READY & ~1).send("ON", 0.4, STW1=READY)
    place = axis.signed("XIST_A")
    axis.send("go on", 1.5, STW1=GO if how == "pause" else READY)
    axis.stands(80_000 if how == "pause" else place, "PD-050")


@CAMPAIGN.case("blocks/follow", requirements=("PD-086", "PD-087", "PD-088", "PD-090"))
def blocks(ctx: CaseContext) -> None:
    """Continued with stop, flying and to the end; the block in work is shown."""
    axis = Axis(ctx).home().go(0.0, POS_STW1=1)
    seen: list[int] = []
    speeds: dict[int, float] = {}
    for _ in range(700):
        ctx.run_for(0.004)
        number = axis.master["POS_ZSW1"] & 0x7F
        if number and (not seen or seen[-1] != number):
            seen.append(number)
            speeds[number] = axis.velocity
    equal(ctx, f"blocks {seen} are 1, 2, 3", seen == [1, 2, 3], 1, "PD-090")
    equal(ctx, "velocity at the second", speeds.get(2, 99.0), 0.0, "PD-087", within=5.0)
    equal(ctx, "velocity at the third", speeds.get(3, 0.0), 50.0, "PD-087", within=3.0)
    axis.stands(80_000, "PD-087")
    equal(ctx, "target reached", axis.master["ZSW1"] & DONE, DONE)
    equal(ctx, "POS_ZSW1", axis.master["POS_ZSW1"] & 0xFF80, int(POS_ZSW1.BLOCKS), "PD-090")


@CAMPAIGN.case("blocks/outputs", requirements=("PD-087", "PD-091"))
def outputs(ctx: CaseContext) -> None:
    """Outputs are set and reset, a block waits its time, and a jump leads to its block."""
    axis = Axis(ctx).home().go(0.2, POS_STW1=5)
    both = int(POS_ZSW2.OUTPUT_1 | POS_ZSW2.OUTPUT_2)
    equal(ctx, "outputs", axis.master["POS_ZSW2"] & both, both, "PD-091")
    equal(ctx, "velocity while waiting", axis.velocity, 0.0, within=0.01)
    axis.send("wait", 0.2)
    equal(ctx, "outputs", axis.master["POS_ZSW2"] & both, int(POS_ZSW2.OUTPUT_2), "PD-091")
    equal(ctx, "block", axis.master["POS_ZSW1"] & 0x7F, 3, "PD-087")
    axis.send("wait", 2.2).stands(80_000, "PD-087")


@CAMPAIGN.case("blocks/external", requirements=("PD-057",))
def external(ctx: CaseContext) -> None:
    """An endless block goes on until the edge of bit 13; its successor has its own ramps."""
    axis = Axis(ctx).home().go(0.6, POS_STW1=10)
    equal(ctx, "velocity", axis.velocity, -66.667, "PD-087", within=0.5)
    axis.send("next block", 2.0, STW1=GO | STW1.EXTERNAL_BLOCK_CHANGE)
    equal(ctx, "block", axis.master["POS_ZSW1"] & 0x7F, 11, "PD-057")
    equal(ctx, "target reached", axis.master["ZSW1"] & DONE, DONE)
    axis.go(0.1, POS_STW1=9)
    equal(ctx, "warning: no such block", axis.master["WARN_CODE"], 7462)


@CAMPAIGN.case("warnings", requirements=("PD-043", "PD-138"))
def warnings(ctx: CaseContext) -> None:
    """Of two warnings WARN_CODE shows the one that came first, until that is gone; bit 7 of ZSW1 lasts as
    long as one is there.
    """
    axis = Axis(ctx).home()

    def expect(text: str, number: int) -> None:
        equal(ctx, f"WARN_CODE: {text}", axis.master["WARN_CODE"], number, "PD-043")
        equal(ctx, f"ZSW1 bit 7: {text}", axis.master["ZSW1"] & 0x80, 0x80 * bool(number), "PD-138")

    for hot_first in (True, False):
        expect("none", 0)
        if not hot_first:
            axis.go(0.03, POS_STW1=9)
        hot = ctx.inject("drive.overtemperature", DRIVE, part="motor", temperature_C=125.0)
        ctx.run_for(0.05)
        if hot_first:
            expect("the motor is warm", 7910)
            axis.go(0.03, POS_STW1=9)
        expect("and there is no such block" if hot_first else "still the block", 7910 if hot_first else 7462)
        axis.send("no task", 0.03, STW1=READY)
        expect("the motor alone", 7910)
        axis.go(0.03, POS_STW1=9)
        hot.remove()
        ctx.run_for(0.05)
        expect("the block alone", 7462)
        axis.send("no task", 0.03, STW1=READY)


@CAMPAIGN.product(
    "jog/{which}",
    parameters=[
        {"which": "1", "bit": int(STW1.JOG_1), "mm_s": -15.0, "step": -3_000},
        {"which": "2", "bit": int(STW1.JOG_2), "mm_s": 25.0, "step": 2_000},
    ],
    title="jog {which}",
    requirements=("PD-053", "PD-089", "PD-090"),
)
def jog(ctx: CaseContext, which: str, bit: int, mm_s: float, step: int) -> None:
    """Jog moves as long as its bit stands, incremental jog by its way; both bits at once stop it."""
    del which
    axis = Axis(ctx)
    axis.send("jog", 0.4, STW1=READY | bit)
    equal(ctx, "velocity", axis.velocity, mm_s, "PD-053", within=0.2)
    equal(ctx, "POS_ZSW1", axis.master["POS_ZSW1"], int(POS_ZSW1.JOG), "PD-090")
    axis.send("both", 0.4, STW1=READY | STW1.JOG_1 | STW1.JOG_2)
    equal(ctx, "velocity", axis.velocity, 0.0, "PD-053", within=0.05)
    axis.send("none", 0.2, STW1=READY)
    equal(ctx, "POS_ZSW1", axis.master["POS_ZSW1"], 0, "PD-090")
    place = axis.signed("XIST_A")
    axis.send("incremental jog", 0.8, STW1=READY | bit, POS_STW2=int(POS_STW2.INCREMENTAL_JOG))
    axis.stands(place + step, "PD-089")
    axis.send("none", 0.1, STW1=READY)


MARK: Final = 40_000 / 131_072 * 10.0
"""Place of the zero mark in a revolution, mm."""


@CAMPAIGN.product(
    "homing/{search}",
    parameters=[
        {"search": "positive", "sign": 1, "edge": 33.0},
        {"search": "from-the-right", "sign": -1, "edge": 48.0},
    ],
    title="homing at cam and zero mark, {search}",
    requirements=("PD-055", "PD-071", "PD-089", "PD-090"),
)
def homing(ctx: CaseContext, search: str, sign: int, edge: float) -> None:
    """To the cam, back off it, next zero mark, reference point."""
    axis = Axis(ctx)
    search_bit = 0
    if search == "from-the-right":
        search_bit = int(POS_STW2.SEARCH_NEGATIVE)
        axis.go(1.5, POS_STW1=RELATIVE, MDI_TARPOS=80_000)
    axis.send("home", 0.4, STW1=READY | STW1.START_HOMING, POS_STW2=search_bit)
    equal(ctx, "velocity towards the cam", axis.velocity, sign * 50.0, "PD-055", within=0.5)
    equal(ctx, "POS_ZSW1", axis.master["POS_ZSW1"], int(POS_ZSW1.HOMING), "PD-090")
    ctx.wait_until(lambda: axis.master["ZSW1"] & HOMED, 15.0, "the home position is set")
    axis.send("homing has ended", 0.4)
    mark = (
        math.ceil((edge - MARK) / 10.0) - 1 if sign > 0 else math.floor((edge - MARK) / 10.0) + 1
    ) * 10.0 + MARK
    equal(ctx, "machine at the reference point, mm", axis.machine, mark + 1.5, "PD-055", within=0.03)
    axis.stands(7_000, "PD-055").shows(
        axis.master["ZSW1"] & ZSW1_TASK & ~HOMED | HOMED, 0, axis.master["POS_ZSW2"] | STOOD, "PD-090"
    )


@CAMPAIGN.case("homing/passive", requirements=("PD-089",))
def passive(ctx: CaseContext) -> None:
    """On the fly at a probe while a task goes on."""
    axis = Axis(ctx)
    axis.send("passive homing", 0.02, POS_STW2=int(POS_STW2.PASSIVE_HOMING), STW1=READY | STW1.START_HOMING)
    axis.send("a task", 0.012, POS_STW1=RELATIVE, MDI_TARPOS=50_000, MDI_VELOCITY=3_000)
    axis.send("go", 0.3, STW1=GO | STW1.START_HOMING)
    equal(ctx, "not homed yet", axis.master["ZSW1"] & HOMED, 0)
    axis.send("go on", 1.8)
    equal(ctx, "homed", axis.master["ZSW1"] & HOMED, HOMED, "PD-089")
    equal(
        ctx,
        "machine against position, mm",
        axis.machine - axis.signed("XIST_A") / 1000.0,
        21.0 - 7.0,
        "PD-089",
        within=0.06,
    )


@CAMPAIGN.product(
    "limit/{what}",
    parameters=[
        {"what": "software-plus", "sign": 1, "bit": int(POS_STW2.SOFTWARE_LIMITS), "place": 88.0, "code": 0},
        {
            "what": "software-minus",
            "sign": -1,
            "bit": int(POS_STW2.SOFTWARE_LIMITS),
            "place": -97.0,
            "code": 0,
        },
        {"what": "cam-plus", "sign": 1, "bit": int(POS_STW2.LIMIT_CAMS), "place": 130.0, "code": 7492},
        {"what": "cam-minus", "sign": -1, "bit": int(POS_STW2.LIMIT_CAMS), "place": -120.0, "code": 7491},
    ],
    title="limit: {what}",
    requirements=("PD-089", "PD-090", "PD-091"),
)
def limit(ctx: CaseContext, what: str, sign: int, bit: int, place: float, code: int) -> None:
    """A software limit is approached, a limit switch stops with a fault; out of it the axis can go."""
    axis = Axis(ctx).home()
    way = int(POS_STW1.POSITIVE if sign > 0 else POS_STW1.NEGATIVE)
    axis.send("supervise", 0.02, POS_STW2=bit)
    axis.go(2.2, POS_STW1=SETUP | way)
    equal(ctx, "velocity", axis.velocity, 0.0, within=0.05)
    equal(ctx, "fault", axis.master["FAULT_CODE"], code, "PD-089")
    if code == 0:
        equal(ctx, "machine, mm", axis.machine, place, "PD-089", within=0.05)
        minus, plus = int(POS_ZSW2.SOFTWARE_LIMIT_MINUS), int(POS_ZSW2.SOFTWARE_LIMIT_PLUS)
        shown = axis.master["POS_ZSW2"] & (minus | plus)
        equal(ctx, "software limit of POS_ZSW2", shown, plus if sign > 0 else minus, "PD-091")
        axis.go(0.2, POS_STW1=MDI, MDI_TARPOS=sign * 120_000)
        equal(ctx, "warning", axis.master["WARN_CODE"], 7470 if sign > 0 else 7469)
    else:
        equal(ctx, "beyond the switch, mm", sign * (axis.machine - place), 6.0, "PD-089", within=6.0)
        minus, plus = int(POS_ZSW1.MINUS_CAM), int(POS_ZSW1.PLUS_CAM)
        equal(
            ctx,
            "cam of POS_ZSW1",
            axis.master["POS_ZSW1"] & (minus | plus),
            plus if sign > 0 else minus,
            "PD-090",
        )
        equal(ctx, "fault bit", axis.master["ZSW1"] & 0x08, 0x08)
        axis.send("acknowledge", 0.05, STW1=(READY | STW1.ACKNOWLEDGE) & ~1)
        axis.send("OFF1", 0.1, STW1=READY & ~1).send("ON", 0.4, STW1=READY)
    back = int(POS_STW1.NEGATIVE if sign > 0 else POS_STW1.POSITIVE)
    axis.go(0.5, POS_STW1=SETUP | back)
    equal(ctx, "velocity back", axis.velocity, -sign * 100.0, within=1.0)


@CAMPAIGN.case("tracking", requirements=("PD-089", "PD-091"))
def tracking(ctx: CaseContext) -> None:
    """In tracking the demand follows the axis: a push moves it, and it stays there."""
    axis = Axis(ctx).home()
    axis.send("tracking", 0.05, POS_STW2=int(POS_STW2.TRACKING))
    equal(ctx, "tracking of POS_ZSW2", axis.master["POS_ZSW2"] & POS_ZSW2.TRACKING, 1, "PD-091")
    axis.send("no tracking", 0.05, POS_STW2=0)
    equal(ctx, "tracking of POS_ZSW2", axis.master["POS_ZSW2"] & POS_ZSW2.TRACKING, 0, "PD-091")


@CAMPAIGN.product(
    "cams/{place}",
    parameters=[{"place": 4_000, "bits": 1}, {"place": 6_000, "bits": 0}, {"place": -6_000, "bits": 3}],
    title="position cams at {place} LU",
    requirements=("PD-091",),
)
def cams(ctx: CaseContext, place: int, bits: int) -> None:
    """Bits 8 and 9: position at or below the cam."""
    axis = Axis(ctx).home().go(1.0, POS_STW1=MDI, MDI_TARPOS=place)
    shown = axis.master["POS_ZSW2"] & (POS_ZSW2.CAM_1 | POS_ZSW2.CAM_2)
    equal(ctx, "cams", shown >> 8, bits, "PD-091")


@CAMPAIGN.case("blocked", requirements=("PD-068",))
def blocked(ctx: CaseContext) -> None:
    """A blocked axis trips with 7452; acknowledging and switching on again let it move."""
    axis = Axis(ctx).home().go(0.3, POS_STW1=MDI, MDI_TARPOS=60_000)
    ctx.inject("mechanics.jam", DRIVE, duration_s=0.5)
    axis.send("wait", 0.7)
    equal(ctx, "fault", axis.master["FAULT_CODE"], 7452, "PD-068")
    equal(ctx, "fault bit, no operation", axis.master["ZSW1"] & 0x0C, 0x08, "PD-068")
    axis.send("acknowledge", 0.05, STW1=(READY | STW1.ACKNOWLEDGE) & ~1)
    axis.send("OFF1", 0.1, STW1=READY & ~1).send("ON", 0.4, STW1=READY)
    equal(ctx, "no fault", axis.master["FAULT_CODE"], 0)
    axis.go(1.5, POS_STW1=MDI, MDI_TARPOS=30_000).stands(30_000)
