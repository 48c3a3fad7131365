"""What programs use of the library beside an axis in motion: an ideal drive, closed formulas, words about
axes and jobs, records of calls, an enable behind an interlock, hooks of the execution levels, loading of
projects.
"""

from __future__ import annotations

import re
import tempfile
from collections.abc import Callable
from itertools import pairwise
from pathlib import Path
from typing import Any, Final

from fieldbus.clock import VirtualScheduler
from fieldbus.history import History
from hil.bench import BenchFile, load_bench
from hil.campaign import Campaign, CaseContext
from motion.drives.simulated import SimulatedDrivePort
from motion.s7.axis import PositioningAxis
from motion.s7.commissioning.precautions import precautions
from motion.s7.handles import AxisHandle
from motion.s7.runtime import Runtime
from motion.s7.variable_texts import matching, variable_texts
from motion.setpoint import SetpointGenerator, stop_time
from testcases.campaigns.support import drive_name, enable, equal

_HERE: Final = "testcases.campaigns.library"
CAMPAIGN: Final = Campaign("library", tags=("axis",), bench="reference")
_CYCLE_NS: Final = 4_000_000
_CYCLE_S: Final = 0.004


# -- an ideal drive ------------------------------------------------------------------------------------------


class _Ideal:
    """An axis on an ideal drive, in a controller of its own.

    Args:
        port: The drive.

    """

    def __init__(self, port: SimulatedDrivePort) -> None:
        variables = dict(load_bench("reference").config.axis["axis1"].variables)
        variables |= {"PositionLimits_HW.Active": False}
        self.port = port
        self.scheduler = VirtualScheduler()
        history = History(self.scheduler)
        self.runtime = Runtime(self.scheduler, cycle_ns=_CYCLE_NS, history=history)
        axis = PositioningAxis(
            "axis", port, cycle_ns=_CYCLE_NS, variables=variables, history=history, delay_s=_CYCLE_S
        )
        self.runtime.add(axis)
        self.axis = AxisHandle(self.runtime, axis)
        self.runtime.start()

    def run(self, seconds: float) -> None:
        """Let time pass."""
        self.scheduler.run_for(round(seconds * 1e9))

    def until(self, condition: Callable[[], object], seconds: float = 5.0) -> bool:
        """Let time pass until a condition holds; returns whether it came to that."""
        return bool(self.scheduler.run_until(condition, round(seconds * 1e9)))


def _port(**options: Any) -> SimulatedDrivePort:
    return SimulatedDrivePort(
        cycle_s=_CYCLE_S, max_speed_rpm=3000.0, off1_ramp_s=0.8, off3_ramp_s=0.4, coast_s=2.0, **options
    )


@CAMPAIGN.case("ideal-drive/motion", requirements=("STP-268", "STP-272", "CFG-335"))
def ideal_motion(ctx: CaseContext) -> None:
    """An axis on an ideal drive goes where it is sent, and its encoder counts that, in both directions."""
    one = _Ideal(_port())
    one.run(0.02)
    equal(ctx, "state before the enable", one.port.stage, 2.0, "STP-268")
    equal(ctx, "it is enabled", one.until(one.axis.power().status), 1.0)
    equal(ctx, "state in operation", one.port.stage, 4.0, "STP-268")
    for way in (37.0, -51.0):
        begun, angle = float(one.axis.var("ActualPosition")), one.port.angle
        equal(ctx, f"{way} mm are done", one.until(one.axis.move_relative(way, Velocity=170.0).done), 1.0)
        one.run(0.2)
        equal(
            ctx, f"way of {way}", float(one.axis.var("ActualPosition")) - begun, way, "CFG-335", within=0.02
        )
        turns = (one.port.angle - angle) / 6.283185307179586
        equal(ctx, f"turns of the motor for {way}", turns, way / 10.0, within=0.002)
    job = one.axis.move_velocity(-90.0)
    equal(ctx, "the velocity is reached", one.until(job.in_velocity), 1.0)
    one.run(0.2)
    equal(ctx, "speed of the drive", one.port.actual_speed_rpm, -540.0, "CFG-335", within=1.0)
    equal(ctx, "what is written", one.port.written[1], -540.0, within=1.0)
    before = float(one.axis.var("ActualPosition"))
    one.port.turn(0.5 * 6.283185307179586)
    one.run(_CYCLE_S)
    moved = float(one.axis.var("ActualPosition")) - before
    equal(ctx, "half a turn by hand", moved, 5.0 - 90.0 * _CYCLE_S, within=0.4)


@CAMPAIGN.product(
    "ideal-drive/stop/{mode}",
    parameters=[
        {"mode": 0, "axis_stops": True, "ramp_s": 0.0},
        {"mode": 1, "axis_stops": False, "ramp_s": 0.4},
        {"mode": 2, "axis_stops": True, "ramp_s": 0.0},
        {"mode": 3, "axis_stops": False, "ramp_s": 2.0},
    ],
    title="StopMode {mode} on an ideal drive",
    requirements=("STP-239", "STP-240", "STP-241", "STP-242"),
)
def ideal_stop(ctx: CaseContext, mode: int, axis_stops: bool, ramp_s: float) -> None:
    """The drive brakes on the ramp of the command that it gets, or the axis on its own; afterwards it is off,
    and comes up again.
    """
    one = _Ideal(_port())
    one.until(one.axis.power().status)
    for speed in (300.0, -200.0):
        job = one.axis.move_velocity(speed)
        equal(ctx, "the velocity is reached", one.until(job.in_velocity), 1.0)
        one.run(0.1)
        since = one.scheduler.now
        one.axis.power(False, stop_mode=mode)
        equal(ctx, "it stands", one.until(lambda: one.port.actual_speed_rpm == 0.0), 1.0)
        took = (one.scheduler.now - since) * 1e-9
        if axis_stops:
            slope = 4000.0 if mode == 0 else 2000.0
            wanted = abs(speed) / slope + (slope / 20000.0 if mode == 2 else 0.0)
            equal(ctx, f"time of the stop from {speed}", took, wanted, "STP-239", "STP-241", within=0.045)
        else:
            wanted = abs(speed) * 6.0 / 3000.0 * ramp_s
            equal(ctx, f"time of the stop from {speed}", took, wanted, "STP-240", "STP-242", within=0.02)
        equal(ctx, "it is off", one.until(lambda: one.axis.state.name == "DISABLED"), 1.0)
        one.run(0.05)
        equal(ctx, "state of the drive", one.port.stage, 1.0 if mode == 3 else 2.0)
        equal(ctx, "it comes up again", one.until(one.axis.power().status), 1.0)


@CAMPAIGN.case("ideal-drive/faults", requirements=("STP-559", "TA-020", "STP-046", "CFG-448"))
def ideal_faults(ctx: CaseContext) -> None:
    """A fault, a stop of the drive itself, a lost link and a drive that is inhibited: the axis has its alarm,
    and goes on when the cause is gone and acknowledged.
    """
    # A drive that stops by itself leaves operation when it stands.
    for name, *numbers in (("fault", 421), ("autonomous_stop", 550, 421), ("link", 431), ("inhibited",)):
        one = _Ideal(_port())
        if name != "inhibited":
            one.until(one.axis.power().status)
            job = one.axis.move_velocity(250.0)
            one.until(job.in_velocity)
        setattr(one.port, name, name != "link")
        if name == "inhibited":
            one.run(0.02)
            one.axis.power()
        one.run(0.5)
        pending = [alarm.number for alarm in one.axis.object.engine.pending]
        equal(ctx, f"{name}: alarms {pending}", pending == numbers, 1.0, "TA-020")
        equal(ctx, f"{name}: enabled", one.axis.var("StatusWord.X0"), 0.0, "STP-559")
        if name == "fault":
            equal(ctx, "the fault is latched", one.port.fault_latched, 1.0)
            one.axis.reset()
            one.run(0.1)
            equal(ctx, "still latched with its cause", one.port.fault_latched, 1.0)
        setattr(one.port, name, name == "link")
        if numbers:
            equal(ctx, f"{name}: acknowledged", one.until(one.axis.reset().done), 1.0, "STP-559")
        equal(ctx, f"{name}: enabled again", one.until(lambda one=one: one.axis.var("StatusWord.X0")), 1.0)
        equal(ctx, f"{name}: nothing is latched", one.port.fault_latched, 0.0)
        equal(ctx, f"{name}: it moves", one.until(one.axis.move_relative(-3.0).done), 1.0)


@CAMPAIGN.product(
    "ideal-drive/mark/{direction}",
    parameters={"direction": ("positive", "negative")},
    title="zero mark of an ideal drive, {direction} direction",
    requirements=("HOM-032",),
)
def ideal_mark(ctx: CaseContext, direction: str) -> None:
    """Active homing finds the next mark in its direction, and the axis is homed there."""
    marks = (-70_000, -30_000, 20_000, 45_000, 90_000)
    one = _Ideal(_port(zero_marks=marks))
    for path, value in (("Mode", 0),):
        one.axis.variables.write_start(f"Sensor[1].ActiveHoming.{path}", value)
    equal(ctx, "restarted", one.until(one.axis.reset(restart=True).done), 1.0)
    one.axis.write("Sensor[1].ActiveHoming.Direction", 0 if direction == "positive" else 1)
    one.until(one.axis.power().status)
    job = one.axis.home(111.0, mode=3)
    equal(ctx, "homed", one.until(job.done, 20.0), 1.0, "HOM-032")
    one.run(0.3)
    count = 20_000 if direction == "positive" else -30_000
    here = one.port.encoder_increments / 131072.0 * 10.0
    wanted = 111.0 + here - count / 131072.0 * 10.0
    equal(ctx, "position", one.axis.var("ActualPosition"), wanted, "HOM-032", within=0.01)


# -- formulas ------------------------------------------------------------------------------------------------


@CAMPAIGN.case("formulas", requirements=("STP-010", "MC-296"))
def formulas(ctx: CaseContext) -> None:
    """The time to standstill in closed form is that of the ramp itself: with and without jerk, in both
    directions, while it speeds up, brakes, brakes too hard, and turns round first.
    """
    ctx.run_for(0.01)
    for deceleration, jerk in ((700.0, 0.0), (700.0, 9000.0), (300.0, 2000.0)):
        for velocity in (250.0, -90.0, 12.0, -1.5):
            for acceleration in (0.0, 320.0, -320.0, 900.0, -900.0):
                ramp = SetpointGenerator()
                ramp.set_state(0.0, velocity, acceleration if jerk else 0.0)
                ramp.start_stop(deceleration, jerk)
                took = ramp.remaining_time
                time_s = 0.0
                while not ramp.done and time_s < 20.0:
                    ramp.advance(0.0005)
                    time_s += 0.0005
                found = stop_time(velocity, acceleration, deceleration, jerk)
                what = f"{velocity:g}, {acceleration:g}, {deceleration:g}, {jerk:g}"
                equal(ctx, f"time from {what}", found, took, "STP-010", within=1e-6 * (1.0 + took))
                equal(ctx, f"ramp from {what}", time_s, took, within=0.0011)
                equal(ctx, "remaining time at the end", ramp.remaining_time, 0.0)


# -- words ---------------------------------------------------------------------------------------------------


@CAMPAIGN.case("words", requirements=("DIA-110", "MC-005"))
def words(ctx: CaseContext) -> None:
    """What axes and instances say of themselves is what they are: state, position, alarms; how a job stands,
    since when, how it has ended, when, and by which other job or alarm.
    """
    axis = ctx.axis

    def said(one: Any, *parts: str) -> None:
        text = str(one.summary())
        missing = [part for part in parts if part not in text]
        equal(ctx, f"{text!r} lacks {missing}", len(missing), 0.0, "DIA-110")

    said(axis, "axis1 DISABLED at 0 mm", "not homed")
    power = enable(ctx)
    said(power, "MC_Power_1 of axis1 has Enable TRUE, Status TRUE")
    ctx.wait_until(axis.home(12.5).done, 1.0, "homed")
    said(axis, "axis1 STANDSTILL at 12.5 mm")
    equal(ctx, "homed axes do not say otherwise", "not homed" in axis.summary(), 0.0)
    first = axis.move_velocity(60.0)
    said(first, "has not been called yet")
    ctx.run_for(0.004)
    begun = ctx.now_s
    ctx.run_for(0.1)
    said(first, f"MC_MoveVelocity_1 of axis1 is busy since {begun:.3f} s")
    second = axis.move_relative(5.0)
    ctx.run_for(0.008)
    (aborted,) = ctx.trace().select(source="axis1", kind="job.aborted")
    said(first, f"was aborted at {aborted.time_ns * 1e-9:.3f} s", "by MC_MoveRelative_1")
    ctx.wait_until(second.done, 3.0, "there")
    said(second, f"MC_MoveRelative_1 of axis1 was done at {ctx.now_s:.3f} s")
    second.set(Execute=False)
    ctx.run_for(0.02)
    wrong = axis.move_relative(5.0, Acceleration=0.0)
    ctx.run_for(0.008)
    said(wrong, "ended with 16#8004")
    third = axis.move_velocity(-50.0)
    ctx.run_for(0.1)
    ctx.inject("axis.alarm", "axis1", number=307)
    ctx.run_for(0.02)
    said(third, "ended with 16#8001: alarm 307 at")
    said(axis, "axis1 ALARM_", "alarm 307")
    refused = axis.move_relative(1.0)
    ctx.run_for(0.02)
    said(refused, "ended with 16#8001: alarm 307")
    again = axis.power()
    again.set(StartMode=7)
    axis.power(False)
    ctx.wait_until(axis.reset().done, 3.0, "acknowledged")
    again.set(StartMode=9)
    ctx.run_for(0.3)
    again.set(Enable=True)
    ctx.run_for(0.02)
    said(again, "Enable TRUE, Status FALSE, and shows 16#800A")
    repeated = axis.jog(20.0)
    said(repeated, "MC_MoveJog_1 of axis1")
    for number, text in ((0x8001, "16#8001"), (0x8004, "16#8004"), (0x1234, "unknown error identification")):
        from motion.s7.alarms import error_text

        equal(ctx, f"text of {number:04X}", text in error_text(number), 1.0, "MC-005")


@CAMPAIGN.case("variables", requirements=("VAR-001", "VAR-003"))
def variables(ctx: CaseContext) -> None:
    """The texts about variables are those of the objects: every variable has one, with its type, access,
    values and bits; a search finds them by parts of their path and by patterns.
    """
    ctx.run_for(0.01)
    axis = ctx.axis
    rows = {re.sub(r"\[1\.\.\d+\]", "[1]", row.path): row for row in variable_texts("PositioningAxis")}
    own = {path for path in axis.variables.paths() if not re.search(r"\[(?!1\])", path)}
    equal(ctx, "variables without a text", len(own - set(rows)), 0.0, "VAR-001")
    for path in sorted(own & set(rows)):
        definition, row = axis.variables.describe(path), rows[path]
        alike = row.data_type == definition.data_type and row.access == definition.access
        default = definition.initial
        shown = str(default).upper() if isinstance(default, bool) else f"{float(default):g}"
        alike = alike and (row.default == shown or float(row.default) == float(default))
        alike = alike and (row.range == "FALSE, TRUE") is (definition.data_type == "BOOL")
        alike = alike and (row.range == "") is bool(definition.bits)
        alike = alike and all(f"X{bit} {name}" in row.meaning for bit, name in definition.bits.items())
        alike = (
            alike and ("Bits:" in row.meaning) is bool(definition.bits) and row.meaning == row.meaning.strip()
        )
        if not alike:
            equal(ctx, f"text of {path}: {row}", 0.0, 1.0, "VAR-003")
    equal(ctx, "a value of FALSE and TRUE", "FALSE: " in rows["PositionLimits_SW.Active"].meaning, 1.0)
    found = {row.path for row in matching("PositioningAxis", "followingerror.m")}
    wanted = {path for path in own if "followingerror.m" in path.lower()}
    equal(ctx, f"found {sorted(found)}", found == wanted and bool(found), 1.0)
    found = {row.path for row in matching("PositioningAxis", "Sensor[3].Type")}
    equal(ctx, f"found of an array {sorted(found)}", found == {"Sensor[1..4].Type"}, 1.0)
    found = {row.path for row in matching("PositioningAxis", "position*.min*")}
    equal(ctx, "found by a pattern", "PositionLimits_SW.MinPosition" in found, 1.0)
    equal(ctx, "what does not fit", any(not path.lower().startswith("position") for path in found), 0.0)


@CAMPAIGN.case("precautions", requirements=("COM-027", "MIN-008"))
def cautions(ctx: CaseContext) -> None:
    """What should be watched and is not is named, and only that."""
    axis = ctx.axis
    ctx.run_for(0.02)
    paths = ("PositionLimits_HW.Active", "PositionLimits_SW.Active", "FollowingError.EnableMonitoring")
    for on in ((True, True, True), (False, True, True), (True, False, False), (False, False, False)):
        for path, value in zip(paths, on, strict=True):
            axis.variables.write_start(path, value)
        ctx.wait_until(axis.reset(restart=True).done, 3.0, "restarted")
        said = precautions(axis.object)
        named = [any(path in text for text in said) for path in paths]
        equal(ctx, f"named with {on}: {said}", named == [not one for one in on], 1.0, "COM-027")
        unhomed = any("StatusWord.X5" in text for text in said)
        equal(ctx, "that software limits wait for a homing", unhomed, on[1], "COM-027")
    axis.variables.write_start("PositionLimits_SW.Active", True)
    ctx.wait_until(axis.reset(restart=True).done, 3.0, "restarted")
    enable(ctx)
    ctx.wait_until(axis.home(0.0).done, 1.0, "homed")
    named = any("StatusWord.X5" in text for text in precautions(axis.object))
    equal(ctx, "not when it is homed", named, 0.0, "COM-027")


# -- calls, interlock, hooks ---------------------------------------------------------------------------------


@CAMPAIGN.case("calls", requirements=("MC-064", "MC-067"))
def calls(ctx: CaseContext) -> None:
    """A record of calls has every call of every instance with its outputs: Done for one call after Execute
    fell.
    """
    enable(ctx)
    log = ctx.bench.record_calls()
    job = ctx.axis.move_relative(2.0)
    ctx.run_for(0.04)
    job.set(Execute=False)
    ctx.run_for(1.0)
    rows = log.of(job)
    equal(ctx, "calls", len(rows), 260.0, within=2.0)
    equal(ctx, "numbers", float(all(row.number == at for at, row in enumerate(rows, 1))), 1.0)
    gaps = {b.cycle - a.cycle for a, b in pairwise(rows)}
    equal(ctx, f"cycles between calls {gaps}", gaps == {1}, 1.0)
    times = {b.time_ns - a.time_ns for a, b in pairwise(rows)}
    equal(ctx, f"time between calls {times}", times == {_CYCLE_NS}, 1.0)
    done = [row for row in rows if "Done" in row.true]
    equal(ctx, "calls with Done", len(done), 1.0, "MC-064", "MC-067")
    equal(ctx, "nothing else in it", done[0].true == {"Done"}, 1.0)
    equal(ctx, "Busy before", "Busy" in rows[done[0].number - 2].true, 1.0, "MC-064")
    equal(ctx, "nothing behind", float(any(row.true for row in rows[done[0].number :])), 0.0, "MC-067")
    names = {instance.instruction for instance in log.instances}
    equal(ctx, f"instances {sorted(names)}", names == {"MC_Power", "MC_MoveRelative"}, 1.0)


@CAMPAIGN.case("interlock", requirements=("STP-024", "STP-020"))
def interlock(ctx: CaseContext) -> None:
    """An enable behind the interlock waits for a drive that is silent, comes with it, goes with it, and comes
    again; taken back it stays away.
    """
    axis, drive = ctx.axis, drive_name(ctx)
    ctx.run_for(0.05)
    segment = str(ctx.bench.config.drive[drive].segment)
    silent = ctx.inject("can.unplug", segment, node=drive)
    ctx.run_for(0.5)
    power = axis.power_when_ready()
    ctx.run_for(0.1)
    equal(ctx, "Enable without the drive", power.Enable, 0.0, "STP-024")
    silent.remove()
    ctx.wait_until(lambda: axis.var("StatusDrive.CommunicationOK"), 8.0, "the drive is back")
    ctx.run_for(0.02)
    equal(ctx, "Enable with the drive", power.Enable, 1.0, "STP-024")
    axis.reset()
    ctx.wait_until(power.status, 5.0, "the axis is enabled")
    again = ctx.inject("can.unplug", segment, node=drive, duration_s=0.3)
    ctx.wait_until(lambda: not power.Enable, 0.3, "the enable goes with the drive")
    ctx.run_for(1.0)
    again.remove()
    ctx.wait_until(axis.reset().done, 5.0, "acknowledged")
    ctx.wait_until(lambda: power.Enable, 8.0, "and comes with it")
    ctx.wait_until(power.status, 5.0, "the axis is enabled again")
    axis.power(False)
    ctx.run_for(0.5)
    equal(ctx, "Enable after it was taken back", power.Enable, 0.0, "STP-024")


SLOW: Final[BenchFile] = load_bench("reference").configured({"bench": {"interpolator_ms": 12}})
OF_LEVELS: Final = Campaign("hooks of the levels", tags=("controller",), bench=f"{_HERE}:SLOW")


@OF_LEVELS.case("called", requirements=("MC-634", "MC-635"))
def hooks(ctx: CaseContext) -> None:
    """A hook is called in its level, in front of the inputs or behind the outputs, as often as the level
    runs, until it is ended; there is no other level.
    """
    levels = ctx.bench.controller.levels
    enable(ctx)
    job = ctx.axis.move_velocity(50.0)
    ctx.wait_until(job.in_velocity, 3.0, "constant")
    seen: dict[str, list[float]] = {"MC_PreServo": [], "MC_PostServo": [], "MC_PreInterpolator": []}
    order: list[str] = []

    def note(name: str) -> Callable[[], None]:
        def call() -> None:
            seen[name].append(float(ctx.axis.var("ActualPosition")))
            order.append(name)

        return call

    ends = [levels.hook(name, note(name)) for name in seen]
    ctx.run_for(0.12)
    for name, count in (("MC_PreServo", 30.0), ("MC_PostServo", 30.0), ("MC_PreInterpolator", 10.0)):
        equal(ctx, f"calls of {name}", len(seen[name]), count, "MC-634", within=1.0)
    before, behind = seen["MC_PreServo"], seen["MC_PostServo"]
    newer = [b - a for a, b in zip(before, behind, strict=False)]
    equal(ctx, "the inputs are read between both", min(newer), 50.0 * 0.004, "MC-634", within=0.05)
    pairs = order.index("MC_PreInterpolator")
    equal(ctx, "order", order[pairs - 1] in ("MC_PostServo", "MC_PreServo"), 1.0)
    for end in ends:
        end()
        end()
    counts = {name: len(rows) for name, rows in seen.items()}
    ctx.run_for(0.05)
    equal(ctx, "calls afterwards", {name: len(rows) for name, rows in seen.items()} == counts, 1.0)
    refused = 0
    try:
        levels.hook("MC_Servo", note("MC_PreServo"))
    except Exception as error:  # noqa: BLE001 - whatever refuses it, the story says what it was
        ctx.do(f"refused: {error}")
        refused = 1
    equal(ctx, "a level without hooks is refused", refused, 1.0)


# -- projects ------------------------------------------------------------------------------------------------

ABSOLUTE: Final[BenchFile] = load_bench("reference").configured(
    {
        "drive": {"drive1": {"encoder": "absolute"}},
        "axis": {
            "axis1": {"variables": {"Sensor[1].Type": 1, "Sensor[1].Parameter.DeterminableRevolutions": 4096}}
        },
    }
)
OF_PROJECTS: Final = Campaign("projects", tags=("controller",), bench=f"{_HERE}:ABSOLUTE")
OF_CAMS: Final = Campaign(
    "projects with cams", tags=("controller", "cams"), bench="testcases.campaigns.cams:BENCH"
)


def _stopped(ctx: CaseContext) -> Any:
    controller = ctx.bench.controller
    controller.stop()
    ctx.run_for(0.6)
    equal(ctx, "state", controller.state.name == "STOP", 1.0)
    return controller


def _running(ctx: CaseContext) -> None:
    ctx.bench.controller.run()
    ctx.wait_until(lambda: ctx.bench.controller.state.name == "RUN", 5.0, "RUN")
    ctx.run_for(0.1)


@OF_PROJECTS.case("loaded", requirements=("HOM-157", "CFG-290", "MC-630"))
def projects(ctx: CaseContext) -> None:
    """A project that was upgraded keeps the adjustment of an absolute encoder, another project does not;
    global data blocks are empty then, and a project cannot be loaded in RUN.
    """
    axis, controller = ctx.axis, ctx.bench.controller
    enable(ctx)
    ctx.wait_until(axis.home(64.0, mode=7).done, 1.0, "the encoder is adjusted")
    axis.write("Override.Velocity", 70.0)
    block = ctx.bench.runtime.data_blocks.add(9, 4)
    refused = 0
    try:
        controller.load_project()
    except Exception as error:  # noqa: BLE001 - whatever refuses it, the story says what it was
        ctx.do(f"refused: {error}")
        refused = 1
    equal(ctx, "refused in RUN", refused, 1.0, "MC-630")
    for upgraded in (True, False):
        block.set_bit(2, 5, True)
        place = float(axis.var("ActualPosition"))
        _stopped(ctx)
        controller.load_project(upgraded=upgraded)
        equal(ctx, "bit of the data block", block.bit(2, 5), 0.0)
        _running(ctx)
        equal(
            ctx, f"adjusted, upgraded {upgraded}", axis.var("StatusSensor[1].Adjusted"), upgraded, "HOM-157"
        )
        equal(ctx, "X5", axis.var("StatusWord.X5"), upgraded, "HOM-157")
        equal(ctx, "Override.Velocity", axis.var("Override.Velocity"), 100.0)
        if upgraded:
            equal(ctx, "position", axis.var("ActualPosition"), place, "HOM-157", within=0.05)
    said = [event for event in ctx.trace().events if "loaded" in str(event.data)]
    ctx.measure("entries about it", float(len(said)), low=0.0)
    enable(ctx)


@OF_PROJECTS.case("breakpoint", requirements=("MC-633",))
def breakpoint_met(ctx: CaseContext) -> None:
    """A breakpoint is an overflow of MC_Servo: STOP, the axis stops, every object restarts; the buffer says
    so.
    """
    axis, controller = ctx.axis, ctx.bench.controller
    enable(ctx)
    axis.write("Override.Velocity", 70.0)
    job = axis.move_velocity(100.0)
    ctx.wait_until(job.in_velocity, 3.0, "constant")
    controller.breakpoint()
    ctx.run_for(0.8)
    equal(ctx, "state", controller.state.name == "STOP", 1.0, "MC-633")
    equal(ctx, "velocity", axis.var("ActualVelocity"), 0.0, "MC-633", within=1.0)
    buffer = controller.diagnostics_buffer
    found = buffer.find("breakpoint")
    ctx.measure("entries about it", float(len(found)), low=1.0, requirements=("MC-633",))
    text = buffer.text(3)
    equal(ctx, "lines of the newest three entries", len(text.splitlines()), 3.0)
    equal(ctx, "newest first", text.splitlines()[0].strip().startswith(str(buffer.entries[-1].number)), 1.0)
    equal(ctx, "all lines", len(buffer.text().splitlines()), len(buffer))
    said = controller.diagnosis().text() if callable(getattr(controller, "diagnosis", None)) else "STOP"
    equal(ctx, "the diagnosis says the state", "STOP" in said, 1.0)
    refused = 0
    try:
        controller.breakpoint()
    except Exception as error:  # noqa: BLE001 - whatever refuses it, the story says what it was
        ctx.do(f"refused: {error}")
        refused = 1
    equal(ctx, "no second one in STOP", refused, 1.0)
    ctx.axis.power(False)
    _running(ctx)
    equal(ctx, "Override.Velocity after the restart", axis.var("Override.Velocity"), 100.0, "MC-633")
    enable(ctx)


@OF_CAMS.case("lifecycle", requirements=("CAM-026", "CAM-019", "CAM-141"))
def cam_lifecycle(ctx: CaseContext) -> None:
    """A cam outlives STOP and RUN with its function, and loses it with the supply, a download and another
    project; a job that runs meanwhile ends. Its points can be written as a file.
    """
    ctx.run_for(0.02)
    name = "mixed"
    cam, controller = ctx.bench.cam(name), ctx.bench.controller
    ctx.wait_until(cam.interpolate().done, 2.0, "interpolated")
    equal(ctx, "interpolated", cam.var("StatusWord.X5"), 1.0, "CAM-141")
    curve = cam.curve
    with tempfile.TemporaryDirectory() as folder:
        for derivatives in (False, True):
            file = cam.export(Path(folder) / "cam.csv", number=11, derivatives=derivatives)
            lines = [line.split(",") for line in Path(file).read_text().splitlines()]
            equal(ctx, "columns", len(lines[0]), 5.0 if derivatives else 2.0)
            equal(ctx, "rows", len(lines), 12.0)
            values = [[float(one) for one in row] for row in lines[1:]]
            equal(ctx, "first place", values[0][0], curve.start, within=1e-9)
            equal(ctx, "last place", values[-1][0], curve.end, within=1e-9)
            for x, *shown in values:
                found = curve.evaluate(x)
                for at, value in enumerate(shown[:3]):
                    equal(ctx, f"derivative {at} at {x:g}", value, found[at], within=1e-9)
                if derivatives:
                    # inside of a piece: the third derivative is the change of the second
                    step = 1e-5 if x < curve.end - 1e-3 else -1e-5
                    jerk = (curve.evaluate(x + 2.0 * step)[2] - curve.evaluate(x + step)[2]) / step
                    equal(ctx, f"third derivative at {x:g}", shown[3], jerk, within=1e-3 + 1e-3 * abs(jerk))
    _stopped(ctx)
    _running(ctx)
    equal(ctx, "after STOP and RUN", cam.var("StatusWord.X5"), 1.0, "CAM-026")
    for event in ("power", "download", "project"):
        _stopped(ctx)
        if event == "power":
            controller.power_off()
            ctx.run_for(0.1)
            controller.power_on()
            ctx.wait_until(lambda: controller.state.name == "RUN", 10.0, "RUN")
        elif event == "download":
            controller.download(name, {})
        else:
            controller.load_project()
        if event != "power":
            _running(ctx)
        ctx.run_for(0.1)
        equal(ctx, f"interpolated after {event}", cam.var("StatusWord.X5"), 0.0, "CAM-026")
        equal(ctx, f"alarm after {event}", cam.var("StatusWord.X1"), 0.0)
        ctx.wait_until(cam.interpolate().done, 2.0, f"interpolated again after {event}")
    running = cam.interpolate()
    ctx.run_for(0.004)
    if running.Busy:
        _stopped(ctx)
        _running(ctx)
        equal(ctx, "a job that ran ends", running.Busy, 0.0, "CAM-026")
