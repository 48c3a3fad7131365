"""What few jobs do: motion at a fixed stop, values that each instruction refuses, positions of a program on a
modulo axis, a superimposed motion that loses its position control, a gain that does not work, laws of cams
that are proposed.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, Final

from hil.bench import BenchFile, load_bench
from hil.campaign import Campaign, CaseContext
from motion.kernel.cams import End, Point
from motion.kernel.cams.elements import line, point_group
from motion.kernel.cams.transitions import LAWS, law_between, proposed, selectable
from motion.nc.blocks import Direction, JogMode, MC_MoveModulo, MC_MoveVelocity
from motion.s7.commissioning.optimisation import Optimisation, TestStep, tuned_by_drive
from testcases.campaigns._instruction_outputs import Outputs
from testcases.campaigns._reactions import cycles
from testcases.campaigns.nc_axes import FAST, until
from testcases.campaigns.nc_axes import axis as nc_axis
from testcases.campaigns.support import drive_name, enable, equal

_HERE: Final = "testcases.campaigns.rare_jobs"
CAMPAIGN: Final = Campaign("rare jobs", tags=("axis",), bench="reference")
_INTO, _UNCONTROLLED, _CLAMPED = 0x8047, 0x8045, 0x8046
_WIDE: Final = {"FollowingError.MinValue": 1e3, "FollowingError.MaxValue": 1e3}


# -- at a fixed stop -----------------------------------------------------------------------------------------


@CAMPAIGN.product(
    "fixed-stop/{way}",
    parameters={"way": (1, -1)},
    title="jobs of an axis that is clamped, direction {way}",
    requirements=("STP-600", "STP-602", "MC-550"),
)
def fixed_stop(ctx: CaseContext, way: int) -> None:
    """A clamped axis refuses what would go on into the stop, by distance, target, velocity or jog, and the
    end of the limiting; off, it is clamped no more. Motion without position control is refused as long as a
    stop is looked for.
    """
    enable(ctx)
    axis, outputs = ctx.axis, Outputs(ctx)
    ctx.wait_until(axis.home(0.0).done, 1.0, "homed")
    for path, value in {
        **_WIDE,
        "Clamping.FollowingErrorDeviation": 4.0,
        "Clamping.PositionTolerance": 1.0,
    }.items():
        axis.write(path, value)
    limiting = outputs.watch(axis.torque_limiting(1.0, mode=1))
    outputs.calls(3)
    refused = outputs.watch(axis.move_velocity(20.0, PositionControlled=False))
    outputs.calls(2)
    equal(ctx, "ErrorID without position control", refused.last.error_id, _UNCONTROLLED, "STP-600")
    axis.move_velocity(70.0 * way)
    ctx.run_for(0.1)
    jam = ctx.inject("mechanics.jam", drive_name(ctx))
    ctx.wait_until(lambda: limiting.instance.InClamping, 1.0, "the axis is clamped")
    ctx.run_for(0.05)
    here = float(axis.var("Position"))
    into: dict[str, Callable[[], Any]] = {
        "relative": lambda: axis.move_relative(3.0 * way),
        "absolute": lambda: axis.move_absolute(here + 2.0 * way),
        "velocity": lambda: axis.move_velocity(15.0 * way),
        "jog": lambda: axis.jog(15.0, backward=way < 0),
    }
    for name, make in into.items():
        one = outputs.watch(make())
        outputs.calls(3)
        equal(ctx, f"{name} into the stop: ErrorID", one.last.error_id, _INTO, "STP-602")
        equal(ctx, f"clamped after {name}", limiting.instance.InClamping, 1.0, "STP-602")
        one.lower()
        outputs.calls(2)
    limiting.instance.set(Enable=False)
    outputs.calls(3)
    equal(ctx, "ErrorID when the limiting is switched off", limiting.last.error_id, _CLAMPED, "MC-550")
    equal(ctx, "still clamped", axis.var("StatusWord.X30"), 1.0, "MC-550")
    axis.power(False)
    ctx.run_for(0.3)
    equal(ctx, "X30 of an axis that is off", axis.var("StatusWord.X30"), 0.0, "MC-550")
    limiting.raise_again()
    outputs.calls(2)
    limiting.lower()
    outputs.calls(3)
    equal(ctx, "ErrorID of the limiting of an axis that is off", limiting.last.error_id, 0.0, "MC-550")
    jam.remove()


@CAMPAIGN.case("uncontrolled", requirements=("MC-098", "MC-103", "OVR-016"))
def uncontrolled(ctx: CaseContext) -> None:
    """A job without position control ends a superimposed motion, whose way stays, and one with it closes the
    loop where the axis is.
    """
    enable(ctx)
    axis = ctx.axis
    basic = axis.move_velocity(60.0)
    ctx.wait_until(basic.in_velocity, 3.0, "constant")
    moving = axis.move_superimposed(40.0, VelocityDiff=50.0)
    ctx.run_for(0.2)
    axis.move_velocity(60.0, PositionControlled=False)
    ctx.run_for(cycles(ctx, 3))
    equal(ctx, "the superimposed motion is aborted", moving.CommandAborted, 1.0, "MC-103")
    equal(ctx, "X28", axis.var("StatusWord.X28"), 1.0, "MC-098")
    ctx.run_for(0.3)
    equal(ctx, "velocity", axis.var("ActualVelocity"), 60.0, "MC-098", within=2.0)
    closed = axis.move_velocity(60.0, PositionControlled=True)
    ctx.wait_until(closed.in_velocity, 2.0, "constant")
    equal(ctx, "X28 with position control", axis.var("StatusWord.X28"), 0.0, "MC-098")
    error = float(axis.var("StatusPositioning.FollowingError"))
    equal(ctx, "following error", error, 0.0, "MC-103", within=0.5)
    job = axis.motion_in_velocity(60.0, PositionControlled=False)
    ctx.run_for(0.05)
    equal(ctx, "X28 with setpoints of the program", axis.var("StatusWord.X28"), 1.0)
    job.set(PositionControlled=True)
    ctx.run_for(0.05)
    equal(ctx, "X28 when they want control", axis.var("StatusWord.X28"), 0.0)
    job.set(Enable=False)
    ctx.run_for(0.05)


# -- values that are refused ---------------------------------------------------------------------------------

_WRONG: Final[tuple[tuple[str, Callable[[Any], Any], int], ...]] = (
    ("MC_Home Mode 4", lambda axis: axis.home(0.0, mode=4), 0x800A),
    ("MC_Home Mode -1", lambda axis: axis.home(0.0, mode=-1), 0x800A),
    ("MC_Home Mode 6 of an incremental encoder", lambda axis: axis.home(0.0, mode=6), 0x8010),
    ("MC_Stop Mode 1", lambda axis: axis.stop(1), 0x800A),
    ("MC_Stop Mode 4", lambda axis: axis.stop(4), 0x800A),
    ("MC_Halt Mode 2", lambda axis: axis.halt(Mode=2), 0x800A),
    ("MC_MoveVelocity Direction 3", lambda axis: axis.move_velocity(5.0, Direction=3), 0x8007),
    ("MC_MoveVelocity Direction -1", lambda axis: axis.move_velocity(5.0, Direction=-1), 0x8007),
    ("MC_MoveRelative BufferMode 2", lambda axis: axis.move_relative(5.0, BufferMode=2), 0x800A),
    ("MC_MoveRelative without acceleration", lambda axis: axis.move_relative(5.0, Acceleration=0.0), 0x8004),
    ("MC_MoveRelative without deceleration", lambda axis: axis.move_relative(5.0, Deceleration=0.0), 0x8005),
    ("MC_MoveRelative, jerk no number", lambda axis: axis.move_relative(5.0, Jerk=math.nan), 0x8006),
    ("MC_MoveRelative without velocity", lambda axis: axis.move_relative(5.0, Velocity=0.0), 0x8003),
    ("MC_MoveRelative, distance infinite", lambda axis: axis.move_relative(math.inf), 0x8008),
    ("MC_MoveAbsolute, position no number", lambda axis: axis.move_absolute(math.nan), 0x8009),
    ("MC_SetSensor 3", lambda axis: axis.set_sensor(5), 0x8050),
    ("MC_SetSensor Mode 4", lambda axis: axis.set_sensor(1, mode=4), 0x800A),
    ("MC_WriteParameter 999", lambda axis: axis.write_parameter(999, 1), 0x805A),
    ("MC_WriteParameter 1011", lambda axis: axis.write_parameter(1011, 0.01), 0x805D),
    ("MC_TorqueLimiting, limit no number", lambda axis: axis.torque_limiting(math.nan), 0x8043),
    ("MC_TorqueRange without torque data", lambda axis: axis.torque_range(1.0, -1.0), 0x804F),
    ("MC_TorqueAdditive without torque data", lambda axis: axis.torque_additive(1.0), 0x804F),
    ("MC_SetAxisSTW on CiA 402", lambda axis: axis.set_axis_stw(STW1=0x200, STW1BitMask=0x200), 0x8FFF),
)


@CAMPAIGN.case("wrong-values", requirements=("MC-006", "MC-007", "MC-059", "MC-600"))
def wrong_values(ctx: CaseContext) -> None:
    """What an instruction cannot work with is refused at once with its ErrorID, is held until the input
    falls, and the job that runs goes on.
    """
    enable(ctx)
    axis, outputs = ctx.axis, Outputs(ctx)
    ctx.wait_until(axis.home(0.0).done, 1.0, "homed")
    running = outputs.watch(axis.move_velocity(17.0))
    ctx.wait_until(running.instance.in_velocity, 3.0, "constant")
    told = []
    for name, make, error_id in _WRONG:
        one = outputs.watch(make(axis))
        outputs.calls(3)
        told.append(f"{name}: 16#{one.last.error_id:04X}")
        equal(ctx, f"{name}: ErrorID", one.last.error_id, error_id, "MC-007", "MC-600")
        equal(ctx, f"{name}: the job goes on", running.last.success, 1.0, "MC-059")
        one.lower()
        outputs.calls(2)
    ctx.do("; ".join(told))
    equal(ctx, "velocity", axis.var("Velocity"), 17.0, "MC-059", within=1e-9)


# -- modulo axes ---------------------------------------------------------------------------------------------

_RANGE: Final[dict[str, Any]] = {
    "Modulo.Enable": True, "Modulo.Length": 100.0, "Modulo.StartValue": -20.0,
    "PositionLimits_SW.Active": True,
}  # fmt: skip
_LIMITED: Final[dict[str, tuple[float, float, float | None, float | None]]] = {
    # lower and upper limit; where it stops backwards and forwards from 10, places in the range
    "inside": (-5.0, 40.0, -5.0, 40.0),
    "lower-inside": (-5.0, 500.0, -5.0, 80.0),
    "upper-inside": (-500.0, 40.0, -20.0, 40.0),
    "outside": (-500.0, 500.0, None, None),
    "turned": (60.0, 25.0, -40.0, 25.0),
}


def _modulo() -> BenchFile:
    return load_bench("reference").configured({"axis": {"axis1": {"variables": _RANGE}}})


MODULO: Final = _modulo()
OF_MODULO: Final = Campaign("rare jobs of modulo axes", tags=("axis",), bench=f"{_HERE}:MODULO")


@OF_MODULO.product(
    "limits/{name}",
    parameters={"name": tuple(_LIMITED)},
    title="software limits {name} the modulo range",
    requirements=("VAR-171", "LIM-079"),
)
def modulo_limits(ctx: CaseContext, name: str) -> None:
    """Limits within the modulo range hold in the range that the axis is in, also with the lower one above;
    those outside of it do not.
    """
    low, high, backward, forward = _LIMITED[name]
    axis = ctx.axis
    axis.write("PositionLimits_SW.MinPosition", low)
    axis.write("PositionLimits_SW.MaxPosition", high)
    enable(ctx)
    ctx.wait_until(axis.home(10.0).done, 1.0, "homed")
    for sign, place in ((-1.0, backward), (1.0, forward)):
        job = axis.move_velocity(sign * 90.0)
        ctx.run_for(2.2)
        if place is None:
            equal(ctx, "it goes on", axis.var("Velocity"), sign * 90.0, "VAR-171", within=1e-9)
            ctx.wait_until(axis.halt().done, 3.0, "it stands")
            continue
        if place in (-20.0, 80.0) and axis.var("Velocity"):
            ctx.do("an end of the range is no limit")
            ctx.wait_until(axis.halt().done, 3.0, "it stands")
            ctx.wait_until(axis.move_absolute(10.0, Direction=3).done, 4.0, "back")
            continue
        whole = float(axis.var("Position")) + 100.0 * float(axis.var("ModuloCycle"))
        apart = (whole - place + 50.0) % 100.0 - 50.0
        equal(ctx, f"it stops at {place}", apart, 0.0, "LIM-079", "VAR-171", within=1e-3)
        equal(ctx, "alarm", axis.var("ErrorDetail.Number"), 533.0, "LIM-079")
        ctx.wait_until(axis.reset().done, 2.0, "acknowledged")
        back = axis.move_relative(-sign * abs(whole - 10.0), Velocity=100.0)
        ctx.wait_until(back.done, 4.0, "it moves away")
        del job


@OF_MODULO.case("positions", requirements=("MC-474", "MIN-001"))
def modulo_positions(ctx: CaseContext) -> None:
    """Positions that a program gives on a modulo axis are the nearest places: the axis goes through the end
    of its range and not back.
    """
    axis = ctx.axis
    axis.write("PositionLimits_SW.MinPosition", -1e4)
    axis.write("PositionLimits_SW.MaxPosition", 1e4)
    enable(ctx)
    ctx.wait_until(axis.home(70.0).done, 1.0, "homed")
    job = axis.motion_in_position(70.0)
    place, step = 70.0, 30.0 * 0.004
    whole = float(axis.var("Position")) + 100.0 * float(axis.var("ModuloCycle"))
    for _ in range(150):
        place += step
        job.set(Position=(place + 20.0) % 100.0 - 20.0, Velocity=30.0)
        ctx.run_for(0.004)
    ctx.run_for(0.004)
    gone = float(axis.var("Position")) + 100.0 * float(axis.var("ModuloCycle")) - whole
    equal(ctx, "way", gone, 150 * step, "MC-474", within=1e-6 + step)
    equal(ctx, "place", axis.var("Position"), 88.0 - 100.0, "MC-474", within=1e-6 + step)
    job.set(Enable=False)
    ctx.run_for(0.05)


# -- optimisation --------------------------------------------------------------------------------------------


@CAMPAIGN.case("optimisation", requirements=("COM-060", "COM-062", "COM-063", "COM-067"))
def optimisation(ctx: CaseContext) -> None:
    """An attempt with a gain that is far too high is broken off and not good, the axis comes to rest, and the
    next one with a good gain is good; the values of the axis stay its own.
    """
    axis, bench = ctx.axis, ctx.bench
    panel = axis.control_panel()
    panel.take_control()
    panel.enable()
    ctx.wait_until(lambda: panel.enabled, 3.0, "the panel has enabled the axis")
    before = float(axis.variables.read("PositionControl.Kv"))

    def wait(condition: Any, seconds: float) -> bool:
        return bool(bench.run_until(condition, timeout=seconds))

    routine = Optimisation(
        panel, bench.runtime, wait, TestStep(distance=2.0, velocity=60.0, acceleration=1000.0)
    )
    good = routine.attempt(20.0, 0.0, 0.0)
    equal(ctx, "a gain of 20 is good", good.good, 1.0, "COM-063")
    high = routine.attempt(400.0, 0.0, 0.0)
    equal(ctx, "a gain of 400 is not", high.good, 0.0, "COM-063")
    ctx.measure("overshoot with it", high.overshoot, low=5.0 * good.tolerance, requirements=("COM-067",))
    again = routine.attempt(20.0, 0.0, 0.0)
    equal(ctx, "a gain of 20 is good again", again.good, 1.0, "COM-063")
    equal(ctx, "overshoot as before", again.overshoot, good.overshoot, "COM-067", within=0.02)
    panel.release()
    ctx.wait_until(lambda: not panel.active, 3.0, "control is given back")
    equal(ctx, "gain of the axis", axis.variables.read("PositionControl.Kv"), before, "COM-062")
    tuned = tuned_by_drive(60.0, 12.0) if tuned_by_drive.__code__.co_argcount == 2 else {}
    for path, wanted in (("PositionControl.Kv", 0.5 * 16.66666 * 60.0),
                         ("DynamicAxisModel.VelocityTimeConstant", 0.012)):  # fmt: skip
        equal(ctx, f"{path} from the drive", tuned[path], wanted, "COM-060", within=1e-6 * wanted)


# -- laws of cams --------------------------------------------------------------------------------------------


@CAMPAIGN.case("laws", requirements=("CAM-027", "CAM-150", "CAM-153", "CAM-160"))
def laws(ctx: CaseContext) -> None:
    """The law that is proposed has the lowest characteristic value of those that can be selected and are
    continuous enough; groups of points follow what they are given, as points and as segments.
    """
    ctx.run_for(0.004)
    ends = {
        "R": ({}, {}), "G": ({"slope": 0.5}, {"slope": 0.5}), "U": ({"bend": 6.0}, {"bend": -6.0}),
        "B": ({"slope": 0.5, "bend": 6.0}, {"slope": 0.5, "bend": -6.0}),
    }  # fmt: skip
    for task in ("RR", "RG", "GR", "GG", "RU", "UR", "UU", "RB", "BR", "GB"):
        names = selectable(task)
        ctx.measure(f"laws for {task}: {', '.join(names)}", len(names), low=1.0, requirements=("CAM-153",))
        equal(ctx, f"polynomial for {task}", "polynomial" in names, 1.0, "CAM-153")
        for target in ("cv", "ca", "cj"):
            if task == "RR":
                able = [name for name in names if LAWS[name].continuity >= 2]
                values = {
                    name: getattr(
                        law_between(name, End(0.0, 0.0, **ends["R"][0]), End(1.0, 1.0, **ends["R"][1]))
                        .characteristics, target,
                    )
                    for name in able
                }  # fmt: skip
                best = min(values.values())
                found = proposed(task, target)
                equal(ctx, f"{target} of {found}", values[found], best, "CAM-160", within=1e-12)
            else:
                equal(ctx, f"proposed for {task}", proposed(task, target) in names, 1.0, "CAM-160")
        first = proposed(task)
        equal(ctx, f"first for {task}", first == next(n for n in names if LAWS[n].continuity >= 2), 1.0)
    equal(ctx, "continuous jerk", proposed("RR", continuity=3) == "polynomial_4567", 1.0, "CAM-160")
    for wrong in (
        lambda: proposed("GG", continuity=3),
        lambda: law_between("polynom", End(0.0, 0.0), End(1.0, 1.0)),
        lambda: law_between("simple_sine", End(1.0, 0.0), End(1.0, 1.0)),
        lambda: law_between("simple_sine", End(0.0, 1.0), End(1.0, 1.0)),
        lambda: law_between("simple_sine", End(0.0, 0.0), End(1.0, 1.0), lam=1.0),
        lambda: law_between("simple_sine", End(0.0, 0.0), End(1.0, 1.0), lam=0.5, ca=5.0),
        lambda: law_between("polynomial_3", End(0.0, 0.0), End(1.0, 1.0), lam=0.5),
    ):
        refused = 0
        try:
            wrong()
        except Exception as error:  # noqa: BLE001 - whatever refuses it, the story says what it was
            ctx.do(f"refused: {error}")
            refused = 1
        equal(ctx, "refused in words", refused, 1.0)
    straight = line(Point(2.0, 5.0), Point(10.0, -3.0)).segments[0]
    equal(ctx, "line", straight.a[1] * (10.0 - 2.0) + straight.a[0], -3.0, "CAM-027", within=1e-12)
    given = [Point(0.0, 0.0), Point(30.0, 20.0), Point(70.0, 10.0), Point(100.0, 0.0)]
    points = point_group(given, approximation=21).points
    equal(ctx, "points", len(points), 21.0, "CAM-027")
    equal(ctx, "last point", points[-1].x, 100.0, "CAM-027", within=1e-12)
    equal(ctx, "distance of the points", points[7].x - points[6].x, 5.0, "CAM-027", within=1e-9)
    equal(ctx, "point at 30", points[6].y, 20.0, "CAM-027", within=1e-9)
    segments = point_group(given, segments=True, approximation=21).segments
    equal(ctx, "segments", len(segments), 20.0, "CAM-027")
    for segment, point, following in zip(segments, points, points[1:], strict=False):
        s = following.x - point.x
        end = segment.a[0] + s * (segment.a[1] + s * (segment.a[2] + s * segment.a[3]))
        equal(ctx, f"begin of the segment at {point.x:g}", segment.a[0], point.y, "CAM-027", within=1e-9)
        equal(ctx, f"end of the segment at {point.x:g}", end, following.y, "CAM-027", within=1e-6)


# -- resets --------------------------------------------------------------------------------------------------


@CAMPAIGN.case("resets", requirements=("STP-065", "CFG-041"))
def resets(ctx: CaseContext) -> None:
    """Each reset begins, ends and is told of, for a pulse and for a long `Execute`: one without anything to
    acknowledge, a restart that is refused while the axis is enabled, one that takes place, one after another.
    """
    enable(ctx)
    axis, outputs = ctx.axis, Outputs(ctx)
    for pulse in (False, True):
        enabled = axis.power()
        ctx.wait_until(enabled.status, 3.0, "the axis is enabled")
        for restart, refused in ((False, False), (True, True), (False, False)):
            one = outputs.watch(axis.reset(restart=restart))
            outputs.calls(1)
            if pulse:
                one.lower()
            outputs.calls(100)
            ended = next(call for call in one.calls if call.ended)
            what = f"reset, restart {restart}"
            equal(ctx, f"{what}: ErrorID", ended.error_id, 0x800E if refused else 0, "MC-073")
            equal(ctx, f"{what}: Done", ended.done, not refused, "MC-055")
            outputs.release()
        axis.power(enable=False)
        ctx.wait_until(lambda: axis.state.name == "DISABLED", 3.0, "the axis is off")
        one = outputs.watch(axis.reset(restart=True))
        outputs.until(one, "done", 5.0, "the axis has restarted")
        outputs.release()


# -- NC blocks -----------------------------------------------------------------------------------------------

OF_NC: Final = Campaign(
    "rare blocks", tags=("nc",), controller="nc", bench="testcases.campaigns.nc_axes:BENCH"
)


@OF_NC.case("directions", requirements=("NC-100", "NC-103"))
def directions(ctx: CaseContext) -> None:
    """The present direction is that in which the axis moves, forwards at rest; a direction that there is not
    is refused.
    """
    one = nc_axis(ctx, "y")
    for velocity, sign in ((60.0, 1.0), (-60.0, -1.0)):
        moving = one.move_velocity(velocity, **FAST)
        until(ctx, moving.in_velocity, "constant")
        block = one.run(
            MC_MoveVelocity(one.ref, Execute=True, Velocity=35.0, Direction=Direction.CURRENT, **FAST)
        )
        until(ctx, block.in_velocity, "constant")
        equal(ctx, "velocity in the present direction", one.ref.NcToPlc.SetVelo, sign * 35.0, within=1e-6)
        before = one.ref.NcToPlc.SetPos
        block = one.run(
            MC_MoveModulo(
                one.ref, Execute=True, Position=120.0, Velocity=200.0, Direction=Direction.CURRENT, **FAST
            )
        )
        until(ctx, block.done)
        way = one.ref.NcToPlc.SetPos - before
        ctx.measure("way in the present direction", sign * way, low=0.0, high=365.0)
        equal(ctx, "place", one.ref.NcToPlc.SetPos % 360.0, 120.0, within=1e-6)
    for wrong in (
        MC_MoveModulo(one.ref, Execute=True, Position=120.0, Velocity=100.0, Direction=77),
        MC_MoveVelocity(one.ref, Execute=True, Velocity=10.0, Direction=77),
        MC_MoveVelocity(one.ref, Execute=True, Velocity=10.0, Direction=Direction.SHORTEST),
    ):
        one.run(wrong)
        ctx.run_for(0.01)
        equal(ctx, f"{wrong.block}: ErrorID", wrong.ErrorID, 0x4B06)
    refused = one.gear_in(nc_axis(ctx, "x"), 1.0, 0.0)
    ctx.run_for(0.01)
    equal(ctx, "a ratio by 0: ErrorID", refused.ErrorID, 0x4B06)
    first = one.move_additive(12.0, Velocity=80.0, **FAST)
    until(ctx, first.done)
    one.power(positive=False)
    ctx.run_for(0.01)
    jog = one.jog(JogMode.MC_JOGMODE_STANDARD_SLOW)
    ctx.run_for(0.02)
    equal(ctx, "a jog without its feed: ErrorID", jog.ErrorID, 0x4358)
    equal(ctx, "Busy", jog.Busy, 0.0)
    jog.set(JogForward=False)
    ctx.run_for(0.02)
    equal(ctx, "ErrorID afterwards", jog.ErrorID, 0.0)
    one.power()
    stop = one.stop()
    until(ctx, stop.done, "the stop is done")
    stop.set(Execute=False)
    ctx.run_for(0.02)
    until(ctx, one.move_relative(2.0, Velocity=50.0, **FAST).done)
