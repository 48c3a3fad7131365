"""What a PROFIdrive axis can be configured to do: fixed stop, modulo, homing without its marks, blocks by
parameters, windows of the positioner, data sets, overload, mains, operating display.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any, Final

from emulators.drive.machine import EncoderConfig, SwitchesConfig
from emulators.drive.positioner_config import TraversingBlock
from emulators.drive.profidrive import DriveSettings
from emulators.drive.supply_config import SupplyConfig
from emulators.drive.thermal_config import ThermalConfig
from fieldbus.profidrive.words import POS_STW1, POS_STW2, POS_ZSW2, STW1, STW2, ZSW1
from hil.campaign import Campaign, CaseContext
from testcases.campaigns._axis_rig import GO, OFF, ON, POS_OFF, POS_ON, PdAxis, Positioned, axis_config
from testcases.campaigns.support import equal

CAMPAIGN: Final = Campaign(
    "profidrive options", controller="", tags=("telegram",), bench="testcases.campaigns.can_bus:BENCH"
)
MDI: Final = int(POS_STW1.MDI | POS_STW1.ABSOLUTE)
RELATIVE: Final = int(POS_STW1.MDI)
DONE: Final = int(ZSW1.TARGET_REACHED)
HOMED: Final = int(ZSW1.HOME_POSITION_SET)


def homed(axis: Positioned) -> Positioned:
    """Make the present place the reference point."""
    axis.run(POS_ON, POS_STW2=int(POS_STW2.SET_REFERENCE_POINT))
    axis.run(POS_ON, POS_STW2=0)
    axis.shows("ZSW1", HOMED, HOMED, "PD-071")
    return axis


# -- positioner ---------------------------------------------------------------------------------------------


@CAMPAIGN.product(
    "fixed-stop/{way}",
    parameters=[{"way": "forward", "sign": 1}, {"way": "backward", "sign": -1}],
    title="travel to a fixed stop, {way}",
    requirements=("PD-091",),
)
def fixed_stop(ctx: CaseContext, way: str, sign: int) -> None:
    """At the stop the demand stands, the torque is that of clamping, the task is done; given up, the axis is
    where it stands; without a stop it is a plain task.
    """
    del way
    free = axis_config().mechanics
    stops = {"positive_stop_mm": 30.0} if sign > 0 else {"negative_stop_mm": -30.0}
    axis = homed(
        Positioned(
            ctx,
            changes={"mechanics": replace(free, **stops)},
            clamping_torque_nm=0.8,
            fixed_stop_tolerance=500.0,
        )
    )
    clamp = int(STW2.TRAVEL_TO_FIXED_STOP)
    moving = {"POS_STW1": MDI, "MDI_TARPOS": sign * 60_000, "MDI_VELOCITY": 3_000}
    axis.go(0.3, STW2=clamp, **moving)
    axis.equal("torque limit on the way", axis.drive.torque.upper_Nm, 0.8, "PD-091", within=1e-6)
    axis.shows("ZSW1", DONE, 0)
    axis.run(GO, 1.0)
    axis.equal("place, um", axis.lu, sign * 30_000, "PD-091", within=60.0)
    axis.equal("torque, Nm", axis.drive.core.torque, sign * 0.8, "PD-091", within=0.01)
    axis.shows("ZSW1", DONE, DONE, "PD-091")
    reached = int(POS_ZSW2.FIXED_STOP_REACHED)
    axis.shows("POS_ZSW2", reached, reached, "PD-091")
    axis.equal("no fault", axis.got["FAULT_CODE"], 0)
    axis.run(GO, 1.0)
    axis.equal("it stays at the stop", axis.got["FAULT_CODE"], 0, "PD-091")
    axis.run(POS_ON, 0.1, STW2=0)
    axis.equal("torque limit", axis.drive.torque.upper_Nm > 1.0, 1, "PD-091")
    axis.equal("no more torque into the stop, Nm", abs(axis.drive.core.torque), 0.4, "PD-091", within=0.4)
    axis.shows("POS_ZSW2", reached, 0, "PD-091")
    axis.go(1.0, POS_STW1=MDI, MDI_TARPOS=sign * 5_000)
    axis.equal("away from it, um", axis.lu, sign * 5_000, within=40.0)
    axis.go(0.8, STW2=clamp, POS_STW1=MDI, MDI_TARPOS=sign * 20_000)
    axis.equal("without a stop, um", axis.lu, sign * 20_000, "PD-091", within=40.0)
    axis.shows("ZSW1", DONE, DONE, "PD-091")
    axis.shows("POS_ZSW2", reached, 0, "PD-091")


@CAMPAIGN.product(
    "modulo/{telegram}",
    parameters={"telegram": (111, 110)},
    title="a modulo axis, telegram {telegram}",
    requirements=("PD-092",),
)
def modulo(ctx: CaseContext, telegram: int) -> None:
    """The nearer way, or the one of the direction, from every place; targets beyond the range are refused."""
    length = 30_000
    axis = Positioned(ctx, telegram, modulo_range=float(length))
    if telegram == 111:
        homed(axis)
    else:
        axis.run(POS_ON, POS_STW=int(POS_STW2.SET_REFERENCE_POINT))
        axis.run(POS_ON, POS_STW=0)
    start = 0
    for target, direction in (
        (5_000, 0), (28_000, 0), (1_000, 0), (15_000, 1), (14_000, 1), (20_000, -1), (19_000, -1),
        (19_000, 1), (4_000, 0), (19_001, 0), (0, 0), (29_999, 0),
    ):  # fmt: skip
        way = (target - start) % length
        if (direction < 0 and way) or (direction == 0 and way > length / 2):
            way -= length
        before = axis.lu
        if telegram == 111:
            bits = {1: int(POS_STW1.POSITIVE), -1: int(POS_STW1.NEGATIVE), 0: 0}[direction]
            axis.go(0.7, POS_STW1=MDI | bits, MDI_TARPOS=target, MDI_VELOCITY=12_000)
        else:
            bits = {1: 2, -1: 4, 0: 0}[direction]
            axis.go(0.7, SATZANW=0x8000, MDI_MOD=1 | bits, MDI_TARPOS=target, MDI_VELOCITY=12_000)
        axis.equal(f"way to {target}, direction {direction}", axis.lu - before, way, "PD-092", within=40.0)
        if "XIST_A" in axis.got:
            axis.equal("XIST_A", axis.got["XIST_A"], target, "PD-092", within=25.0)
        start = target
    if telegram == 111:
        for target, code in ((length, 7471), (-1, 7471), (length - 1, 0)):
            axis.go(0.2, POS_STW1=MDI, MDI_TARPOS=target)
            axis.equal(f"warning for {target}", axis.got["WARN_CODE"], code, "PD-092")


@CAMPAIGN.product(
    "not-found/{what}",
    parameters=[
        {"what": "cam", "code": 7458, "settings": {"max_cam_distance": 20_000.0}},
        {"what": "end-of-cam", "code": 7460, "settings": {"max_cam_distance": 20_000.0}},
        {"what": "mark", "code": 7459, "settings": {"has_cam": False, "max_mark_distance": 3_000.0}},
    ],
    title="homing does not find its {what}",
    requirements=("PD-055",),
)
def not_found(ctx: CaseContext, what: str, code: int, settings: dict[str, Any]) -> None:
    """It ends within its way with the fault of what is missing; what lies just within the way is found."""
    encoder = EncoderConfig(counts_per_revolution=2048, zero_mark_counts=1024)
    cam = SwitchesConfig(negative_limit_mm=None, positive_limit_mm=None, input_filter_ms=0.0)
    axis = Positioned(ctx, changes={"encoder": encoder, "switches": cam}, mark_velocity=3_000.0, **settings)
    bit = int(POS_STW2.REFERENCE_CAM) if what == "end-of-cam" else 0
    home = POS_ON | int(STW1.START_HOMING)
    axis.run(home, 1.2, POS_STW2=bit)
    axis.equal("fault", axis.got["FAULT_CODE"], code, "PD-055")
    # It brakes with OFF1, 500 mm/s2, from the speed of its search.
    longest, mm_s = (3_000, 50.0) if what == "mark" else (20_000, 5_000 / 60.0 if what == "cam" else 50.0)
    way = longest + mm_s * mm_s / 1000.0 * 1000.0
    axis.equal("way until then, um", abs(axis.lu), way, "PD-055", within=mm_s * 8.0)
    axis.shows("ZSW1", HOMED, 0, "PD-055")
    if what == "mark":
        axis = Positioned(
            ctx, changes={"encoder": encoder}, has_cam=False, max_mark_distance=5_300.0, mark_velocity=600.0
        )
        axis.run(home, 1.5)
        axis.equal("found within its way", axis.got["FAULT_CODE"], 0, "PD-055")
        axis.shows("ZSW1", HOMED, HOMED, "PD-055")
        axis.equal("at the mark, um", axis.lu, 5_000, "PD-055", within=30.0)


@CAMPAIGN.case("home-here", requirements=("PD-055",))
def home_here(ctx: CaseContext) -> None:
    """Where homing looks for nothing the place is taken as it is."""
    axis = Positioned(ctx, home_here=True, reference_position=12_345)
    axis.run(POS_ON | int(STW1.START_HOMING), 0.04)
    axis.shows("ZSW1", HOMED, HOMED, "PD-055")
    axis.equal("XIST_A", axis.got["XIST_A"], 12_345, "PD-055", within=1.0)
    axis.equal("it has not moved, um", axis.lu, 0.0, within=2.0)


NOT_WATCHED: Final = ("standstill_time_ms", "positioning_time_ms")


@CAMPAIGN.product(
    "window/{what}",
    parameters={"what": ("positioning", "standstill", "following")},
    title="the window of {what}",
    requirements=("PD-068",),
)
def window(ctx: CaseContext, what: str) -> None:
    """Its time and its width have two sides: below nothing happens, beyond it is a fault that stops."""
    for beyond in (False, True):
        settings: dict[str, Any] = {
            "positioning": {"window": 20.0, "positioning_time_ms": 240.0, "standstill_window": 5_000.0},
            "standstill": {"standstill_window": 300.0, "standstill_time_ms": 80.0, "window": 290.0},
            "following": {
                "following_tolerance": 900.0,
                "standstill_time_ms": 0.0,
                "positioning_time_ms": 0.0,
            },
        }[what]
        axis = homed(Positioned(ctx, **settings))
        code = {"positioning": 7451, "standstill": 7450, "following": 7452}[what]
        mechanics = axis.drive.mechanics
        if what == "positioning":
            # A jam just in front of the target, released in time or not.
            axis.go(0.0, POS_STW1=MDI, MDI_TARPOS=10_000, MDI_VELOCITY=6_000)
            while axis.lu < 9_900:
                axis.run(GO, 0.004)
            mechanics.jam(True)
            axis.run(GO, 0.3 if beyond else 0.08)
            mechanics.jam(False)
            axis.run(GO, 0.2)
        else:
            axis.go(0.4, POS_STW1=MDI, MDI_TARPOS=5_000, MDI_VELOCITY=6_000)
            axis.drive.core.set_torque_limits(0.5, 0.5)
            if what == "standstill":
                mechanics.slip(0.0006)
                mechanics.jam(True)
                axis.run(GO, 0.12 if beyond else 0.06)
                mechanics.jam(False)
                axis.run(GO, 0.1)
            else:
                mechanics.slip(0.0011 if beyond else 0.0007)
                axis.run(GO, 0.1)
        axis.equal(
            f"{what}, beyond: {beyond}: fault", axis.got["FAULT_CODE"], code if beyond else 0, "PD-068"
        )
        axis.shows("ZSW1", 0x08, 0x08 if beyond else 0, "PD-068")
        if beyond:
            axis.acknowledge()
            axis.equal("acknowledged", axis.got["FAULT_CODE"], 0, "PD-068")


BLOCKS: Final = range(2616, 2624)
"""Number, position, velocity, acceleration, deceleration, task, parameter, mode of the blocks."""


@CAMPAIGN.case("blocks-by-parameters", requirements=("PD-086", "PD-087"))
def blocks_by_parameters(ctx: CaseContext) -> None:
    """The table is read and written by p2616 to p2623; what contradicts itself cannot be started, each number
    stands once.
    """
    blocks = (
        TraversingBlock(number=4, position=7_000, velocity=6_000, continuation="continue with stop"),
        TraversingBlock(
            number=5, task="relative", position=-3_000, velocity=4_000, deceleration_percent=50.0
        ),
    )
    axis = homed(Positioned(ctx, block=blocks))
    rows = [[axis.parameter(number, at) for number in BLOCKS] for at in range(3)]
    equal(ctx, f"first row {rows[0]}", rows[0][:5] == [4, 7_000, 6_000, 100, 100], 1, "PD-087")
    equal(ctx, f"second row {rows[1]}", rows[1][:5] == [5, -3_000, 4_000, 100, 50], 1, "PD-087")
    equal(ctx, "an empty row", rows[2][0] < 0, 1)
    equal(ctx, "modes", (rows[0][7], rows[1][7]) == (0x10, 0x100), 1, "PD-087")
    axis.equal("another target is taken", axis.write(2617, 9_000, 0), 0, "PD-087")
    axis.go(1.5, POS_STW1=4)
    axis.equal("both blocks, um", axis.lu, 6_000, "PD-087", within=30.0)
    axis.equal("the number stands once", axis.write(2616, 4, 1) != 0, 1, "PD-087")
    axis.equal("a new block", axis.write(2616, 9, 2), 0)
    for number, value in ((2617, 12_000), (2618, 5_000), (2623, 0x00)):
        axis.equal(f"p{number}", axis.write(number, value, 2), 0, "PD-087")
    axis.go(1.0, POS_STW1=9)
    axis.equal("it goes there, um", axis.lu, 12_000, "PD-087", within=30.0)
    for mode in (0x40, 0x200):
        axis.equal("a mode that there is not", axis.write(2623, mode, 2), 0)
        axis.go(0.3, POS_STW1=9)
        axis.equal("cannot be started", axis.got["WARN_CODE"], 7464, "PD-087")
        axis.equal("it stands, um", axis.lu, 12_000, within=30.0)
    axis.write(2623, 0x10, 2)
    axis.go(0.5, POS_STW1=9)
    axis.equal("no block follows", axis.got["WARN_CODE"], 7465, "PD-087")
    axis.go(0.2, POS_STW1=30)
    axis.equal("no such block", axis.got["WARN_CODE"], 7462, "PD-086")
    for number, value, low in (
        (2546, 750.0, 0.0),
        (2545, 130.0, -1.0),
        (2571, 2_000.0, 0.0),
        (2573, 50.0, 0.0),
    ):
        axis.equal(f"p{number} = {value}", axis.write(number, value), 0)
        axis.equal(f"p{number}", axis.parameter(number), value)
        axis.equal(f"p{number} = {low} is refused", axis.write(number, low) != 0, 1)
        axis.equal(f"p{number} stays", axis.parameter(number), value)
    axis.go(0.4, POS_STW1=RELATIVE, MDI_TARPOS=100_000, MDI_VELOCITY=20_000)
    axis.equal("velocity, mm/s", axis.rpm / 6.0, 2_000 / 60.0, within=0.5)
    axis.run(POS_ON & ~int(STW1.NO_REJECT_TASK), 0.02)
    speed = axis.rpm / 6.0
    axis.equal("deceleration of a rejection", speed, 2_000 / 60.0 - 50 * 0.02, within=0.6)
    axis.run(POS_ON & ~int(STW1.NO_REJECT_TASK), 1.0)
    axis.equal("no modulo range with pulses", axis.write(2576, 20_000) != 0, 1)
    axis.run(POS_OFF, 1.5)
    axis.equal("modulo range", axis.write(2576, 20_000), 0)
    axis.equal("modulo on", axis.write(2577, 1), 0)
    axis.run(POS_OFF, 0.1)
    axis.equal("XIST_A within the range", 0 <= axis.got["XIST_A"] < 20_000, 1, "PD-092")


@CAMPAIGN.product(
    "refused/{how}",
    parameters={"how": ("warning", "fault")},
    title="a task that cannot be carried out is a {how}",
    requirements=("PD-067", "PD-068"),
)
def refused_task(ctx: CaseContext, how: str) -> None:
    """No such block, not homed, beyond a limit: under the number of the reason, and nothing moves."""
    for code, words in (
        (7462, {"POS_STW1": 17}),
        (7461, {"POS_STW1": MDI, "MDI_TARPOS": 1_000}),
        (7470, {"POS_STW1": MDI, "MDI_TARPOS": 50_001, "POS_STW2": int(POS_STW2.SOFTWARE_LIMITS)}),
        (7469, {"POS_STW1": MDI, "MDI_TARPOS": -40_001, "POS_STW2": int(POS_STW2.SOFTWARE_LIMITS)}),
    ):
        axis = Positioned(ctx, refused_task=how, software_limits=(-40_000, 50_000))
        if code > 7462:
            homed(axis)
        axis.go(0.1, **words)
        axis.equal("fault", axis.got["FAULT_CODE"], code if how == "fault" else 0, "PD-068")
        axis.equal("warning", axis.got["WARN_CODE"], code if how == "warning" else 0, "PD-067")
        axis.shows("ZSW1", int(ZSW1.TASK_ACKNOWLEDGED), 0)
        axis.equal("it stands, um", axis.lu, 0.0, within=3.0)
        axis.equal("in operation", axis.got["ZSW1"] >> 2 & 1, how == "warning", "PD-068")
        axis.run(POS_ON, 0.04)
        axis.equal("the warning ends with its request", axis.got["WARN_CODE"], 0, "PD-067")


@CAMPAIGN.product(
    "velocity/{how}",
    parameters={"how": ("zero", "absolute")},
    title="a negative velocity of MDI: {how}",
    requirements=("PD-088",),
)
def negative_velocity(ctx: CaseContext, how: str) -> None:
    """The axis stands, or moves with the amount; at rest without a task it is done, where that is wanted."""
    axis = homed(Positioned(ctx, negative_velocity=how, rest_is_reached=how == "absolute"))
    axis.shows("ZSW1", DONE, DONE if how == "absolute" else 0, "PD-070")
    axis.go(0.5, POS_STW1=MDI, MDI_TARPOS=5_000, MDI_VELOCITY=-6_000)
    axis.equal("place, um", axis.lu, 5_000 if how == "absolute" else 0, "PD-088", within=25.0)


@CAMPAIGN.case("fine-ramps", requirements=("PD-018", "PD-086", "PD-092"))
def telegram_words(ctx: CaseContext) -> None:
    """Telegram 110 with SATZANW and MDI_MOD; telegram 112 with accelerations of its own."""
    axis = Positioned(ctx, 110)
    axis.run(POS_ON, POS_STW=int(POS_STW2.SET_REFERENCE_POINT))
    axis.run(POS_ON, POS_STW=0)
    axis.go(0.3, SATZANW=0x8000, MDI_MOD=1, MDI_TARPOS=-20_000, MDI_VELOCITY=6_000)
    axis.equal("AKTSATZ", axis.got["AKTSATZ"], 0x8000, "PD-087")
    axis.run(GO, 0.5)
    axis.equal("absolute, um", axis.lu, -20_000, "PD-092", within=25.0)
    axis.go(0.6, SATZANW=0x8000, MDI_MOD=0, MDI_TARPOS=3_000)
    axis.equal("relative, um", axis.lu, -17_000, "PD-092", within=25.0)


# -- drive ---------------------------------------------------------------------------------------------------


def speed(axis: PdAxis, rpm: float) -> dict[str, int]:
    """Return the setpoint of a speed."""
    return {"NSOLL_B": round(rpm / axis.drive.settings.reference_speed_rpm * 0x4000_0000)}


@CAMPAIGN.case("data-sets", requirements=("PD-079",))
def data_sets(ctx: CaseContext) -> None:
    """STW2 chooses a set; what one of them has become is kept, a number that there is not changes nothing."""
    sets = tuple(
        DriveSettings(
            max_speed_rpm=3000.0, ramp_up_s=ramp, ramp_down_s=1.0, quick_stop_s=0.5, operating_mode=1
        )
        for ramp in (0.5, 2.0)
    )
    first = replace(sets[0], ramp_up_s=1.0)
    axis = PdAxis(ctx, axis_config(settings=first, data_sets=sets))
    axis.enable()

    def up() -> float:
        """Return the slope of speeding up, rpm/s."""
        axis.run(ON, 1.0, NSOLL_B=0)
        axis.run(ON, 0.012, **speed(axis, 900.0))
        begun = axis.rpm
        axis.run(ON, 0.1)
        slope = (axis.rpm - begun) / 0.1
        axis.run(ON, 0.8, NSOLL_B=0)
        return slope

    for number, ramp in ((0, 1.0), (1, 0.5), (2, 2.0), (3, 2.0), (7, 2.0), (1, 0.5), (0, 1.0)):
        axis.run(ON, 0.02, STW2=number)
        axis.equal(f"slope with set {number}", up(), 3000.0 / ramp, "PD-079", within=0.03 * 3000.0 / ramp)
    axis.run(ON, 0.02, STW2=1)
    axis.write("p1120", 0.75)
    axis.run(ON, 0.02, STW2=0)
    axis.equal("another set has kept its own", up(), 3000.0, "PD-079", within=90.0)
    axis.run(ON, 0.02, STW2=1)
    axis.equal("what was written is kept", up(), 4000.0, "PD-079", within=120.0)


@CAMPAIGN.product(
    "overload/{how}",
    parameters={"how": ("limit", "fault")},
    title="overload of motor and power stage: {how}",
    requirements=("PD-133",),
)
def overload(ctx: CaseContext, how: str) -> None:
    """After its time the torque is that which can last, or the drive trips, until it has cooled."""
    for part, share in (("motor", 2.0), ("stage", 2.6)):
        times = {"i2t_time_constant_s": 0.4 if part == "motor" else 1e5}
        times["stage_overload_time_s"] = 0.4 if part == "stage" else 1e5
        axis = PdAxis(ctx, axis_config(thermal=ThermalConfig(overload=how, **times)))
        axis.enable()
        # Pushed against a locked shaft the torque is the limit.
        rated = axis.drive.config.rated_torque_nm
        axis.write("p1520", share * rated)
        axis.write("p1521", -share * rated)
        axis.drive.mechanics.jam(True)
        axis.run(ON, 0.008, **speed(axis, 500.0))
        axis.run(ON, 0.03)
        axis.equal(f"{part}: torque at first", axis.drive.core.torque, share * rated, "PD-133", within=0.01)
        lasts = rated if part == "motor" else 2.0 * rated
        square = (share / (1.0 if part == "motor" else 2.0)) ** 2
        trip = 1.0 if how == "limit" else 1.05
        due = -0.4 * math.log(1.0 - trip / square)
        axis.run(ON, due - 0.03 - 0.04)
        axis.equal(f"{part}: not before", axis.drive.core.torque, share * rated, "PD-133", within=0.01)
        axis.run(ON, 0.08)
        if how == "limit":
            axis.equal(f"{part}: limited", axis.drive.core.torque, lasts, "PD-133", within=0.02)
        else:
            axis.equal(f"{part}: no torque", axis.drive.core.torque, 0.0, "PD-133", within=1e-9)
            axis.equal(f"{part}: a fault", axis.drive.faults.number > 0, 1, "PD-133")
        axis.run(OFF, 1.2, NSOLL_B=0)
        axis.drive.mechanics.jam(False)
        axis.run(OFF | 0x80, 0.02)
        axis.run(OFF, 0.16)
        axis.run(ON, 0.1)
        axis.equal(f"{part}: cooled down, again in operation", axis.got["ZSW1"] & 0x0C, 0x04, "PD-133")


@CAMPAIGN.case("phase-loss", requirements=("PD-133",))
def phase_loss(ctx: CaseContext) -> None:
    """A missing phase trips after its time in operation, not before, and not without pulses."""
    for missing_s, trips in ((0.07, False), (0.13, True)):
        axis = PdAxis(ctx, axis_config(supply=SupplyConfig(phase_loss_time_ms=100.0)))
        link = axis.drive.power.dc_link
        axis.run(OFF, 0.16)
        link.phase_missing = True
        axis.run(OFF, 0.3)
        axis.equal("without pulses: no fault", axis.got["ZSW1"] & 0x08, 0)
        link.phase_missing = False
        axis.enable()
        link.phase_missing = True
        axis.run(ON, missing_s)
        axis.equal(f"after {missing_s} s: fault", axis.got["ZSW1"] & 0x08, 0x08 if trips else 0, "PD-133")
        axis.run(OFF | 0x80, 0.02)
        axis.run(OFF, 0.02)
        axis.equal("while it is missing", axis.got["ZSW1"] & 0x08, 0x08 if trips else 0, "PD-133")
        link.phase_missing = False
        axis.run(OFF | 0x80, 0.04)
        axis.equal("acknowledged", axis.got["ZSW1"] & 0x08, 0, "PD-133")


@CAMPAIGN.case("operating-display", requirements=("PD-259",))
def operating_display(ctx: CaseContext) -> None:
    """r0002 in every state."""
    axis = PdAxis(ctx, axis_config())
    axis.drive.power_off()
    axis.equal("off", axis.parameter("r0002"), 70, "PD-259")
    axis.drive.power_on()
    rows = (
        ("ON too early", ON, 41),
        ("OFF2", 0x047C, 42),
        ("OFF3", 0x047A, 43),
        ("ready to switch on", OFF, 31),
        ("switched on", 0x0477, 21),
        ("operation", ON, 0),
        ("no setpoint", ON & ~0x40, 10),
        ("ramp held", ON & ~0x20, 12),
        ("no ramp", ON & ~0x10, 13),
        ("operation", ON, 0),
    )
    for name, word, wanted in rows:
        axis.run(word, 0.04)
        axis.equal(f"{name}: r0002", axis.parameter("r0002"), wanted, "PD-259")
    axis.run(ON, 0.5, **speed(axis, 600.0))
    axis.run(OFF, 0.02)
    axis.equal("OFF1: r0002", axis.parameter("r0002"), 18, "PD-259")
    axis.run(ON, 0.4)
    axis.run(ON & ~0x04, 0.02)
    axis.equal("OFF3: r0002", axis.parameter("r0002"), 17, "PD-259")
    axis.run(OFF, 0.5, NSOLL_B=0)
    axis.drive.safety.set_sto(True)
    axis.run(OFF, 0.02)
    axis.equal("safe torque off: r0002", axis.parameter("r0002"), 44, "PD-259")
    axis.drive.raise_fault(30001)
    axis.run(OFF, 0.02)
    axis.equal("fault: r0002", axis.parameter("r0002"), 45, "PD-259")
