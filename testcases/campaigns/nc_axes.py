"""NC axes: motions by their formulas, buffer modes, error codes, homing, coupling, external setpoints."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Final

import numpy as np

from hil.bench import BenchFile
from hil.campaign import Campaign, CaseContext
from hil.expect.golden import travel_time
from motion.nc.blocks import Direction, HomingMode, JogMode
from motion.nc.commands import BufferMode
from motion.nc.interface import STATUS_BITS
from testcases.campaigns.support import equal, speed_at

BENCH: Final = BenchFile(
    "nc axes",
    """
[bench]
name = "nc axes"
kind = "virtual"
cycle_ms = 2

[segment.can0]
bitrate = 1_000_000

[drive.motor]
segment = "can0"
node_id = 5

[drive.motor.mechanics]
coulomb_friction_n = 0.0
viscous_friction_n_per_m_s = 0.0

[drive.motor.switches]
home_from_mm = 60.0
home_to_mm = 85.0
hysteresis_mm = 0.0
input_filter_ms = 0.0

[drive.feeder]
profile = "profidrive"
telegram = 3
segment = "can0"
node_id = 6

[axis.x]
controller = "nc"
drive = "motor"

[axis.x.parameters]
"ctrl.pos_kv" = 30.0
"axis.soft_limit_min_enable" = true
"axis.soft_limit_min" = -150.0
"axis.soft_limit_max_enable" = true
"axis.soft_limit_max" = 350.0

[axis.y]
controller = "nc"
drive = "feeder"

[axis.y.parameters]
"ctrl.pos_kv" = 20.0
""",
)

CAMPAIGN: Final = Campaign(
    "nc axes", tags=("nc",), controller="nc", bench="testcases.campaigns.nc_axes:BENCH"
)
CYCLE_S: Final = 0.002
FAST: Final = {"Acceleration": 1200.0, "Deceleration": 800.0, "Jerk": 20_000.0}
"""Dynamics of the motions, mm/s2 and mm/s3; no two are alike."""
RESTING: Final = {"Operational", "NotMoving", "ControlLoopClosed", "PTPmode"}
"""Status of an enabled axis at rest, before its first command."""


def axis(ctx: CaseContext, name: str = "x") -> Any:
    """Return an enabled axis."""
    found = ctx.bench.axis(name, controller="nc")
    ctx.do(f"MC_Power of {name}")
    ctx.wait_until(found.power().status, 2.0, f"{name} is enabled")
    ctx.run_for(0.02)
    return found


def until(ctx: CaseContext, condition: Callable[[], object], text: str = "the motion is done") -> float:
    """Wait for an output of a block; return how long that took, s."""
    begun = ctx.now_s
    ctx.wait_until(condition, 15.0, text)
    return ctx.now_s - begun


def status(ctx: CaseContext, one: Any, wanted: set[str], *ids: str, besides: tuple[str, ...] = ()) -> None:
    """Expect exactly these members of `AXIS_REF.Status`; of `besides` it does not matter."""
    one.ref.ReadStatus()
    shown = {name for name in STATUS_BITS if getattr(one.ref.Status, name)} - set(besides)
    wrong = sorted(shown ^ (wanted - set(besides)))
    ctx.do(f"status of {one.name}: {', '.join(sorted(shown))}")
    equal(ctx, f"members of the status that are wrong ({', '.join(wrong) or 'none'})", len(wrong), 0, *ids)


def there(ctx: CaseContext, one: Any, position: float, within: float = 0.02) -> None:
    """Expect the axis and its machine at a position."""
    ctx.run_for(0.4)
    equal(ctx, f"position of {one.name}", one.position, position, within=within)
    equal(ctx, f"set position of {one.name}", one.ref.NcToPlc.SetPos, position, within=1e-6)
    equal(ctx, f"set velocity of {one.name}", one.ref.NcToPlc.SetVelo, 0.0, within=1e-9)
    drive = {"x": "motor", "y": "feeder"}[one.name]
    if not one.homed:
        true_mm = float(ctx.trace()[f"{drive}.position"].values[-1]) * 1000.0
        equal(ctx, f"machine of {one.name}, mm", true_mm, position, within=within + 0.03)


@CAMPAIGN.product(
    "move/{block}-{name}",
    parameters=[
        {"block": block, "name": name, "target": target}
        for block, target in (
            ("absolute", 220.0),
            ("absolute-back", -130.0),
            ("relative", 97.5),
            ("short", 3.0),
        )
        for name in "xy"
    ],
    title="MC_Move, {block}, axis {name}",
)
def move(ctx: CaseContext, block: str, name: str, target: float) -> None:
    """The motion takes the time of its ramps, shows every bit of its status, and ends at its target."""
    one = axis(ctx, name)
    status(
        ctx,
        one,
        RESTING | {"InTargetPosition", "InPositionArea"},
        besides=("InTargetPosition", "InPositionArea"),
    )
    sign = 1.0 if target > 0.0 else -1.0
    start = one.move_relative if block == "relative" else one.move_absolute
    begun = ctx.now_s
    motion = start(target, Velocity=180.0, **FAST)
    ctx.run_for(4 * CYCLE_S)
    turned = {"PositiveDirection" if sign > 0.0 else "NegativeDirection"}
    equal(ctx, "Busy and Active", motion.Busy + motion.Active, 2)
    moving = {"Operational", "ControlLoopClosed", "PTPmode", "HasJob", "NewTargetPos"} | turned
    areas = ("InTargetPosition", "InPositionArea", "NewTargetPos")
    status(ctx, one, moving, "NC-440", besides=areas)
    if block != "short":
        ctx.run_for(0.35)
        status(ctx, one, moving | {"ConstantVelocity"}, "NC-440", besides=areas)
        equal(ctx, "set velocity", one.ref.NcToPlc.SetVelo, sign * 180.0, within=1e-6)
    until(ctx, motion.done)
    expected = travel_time(abs(target), 180.0, 1200.0, 800.0, 20_000.0)
    equal(ctx, "time of the motion", ctx.now_s - begun, expected, within=3 * CYCLE_S + 0.03)
    there(ctx, one, target)
    status(ctx, one, RESTING | {"InTargetPosition", "InPositionArea"}, "NC-440")
    equal(ctx, "Done, not Busy, no error", motion.Done - motion.Busy - motion.Error, 1)


@CAMPAIGN.product(
    "homing-ended/{how}",
    parameters={"how": ("halt", "disabled")},
    title="homing ends by: {how}; the software limits hold again",
    requirements=("NC-130", "NC-133", "NC-314"),
)
def homing_ended(ctx: CaseContext, how: str) -> None:
    """Software limits do not count while the axis is homed, and hold as soon as that has ended, however."""
    one = axis(ctx)
    one.write_parameter("axis.soft_limit_max", 25.0)
    homing = one.home()
    ctx.run_for(0.2)
    equal(ctx, "Busy", homing.Busy, 1)
    if how == "halt":
        until(ctx, one.halt().done, "the axis has halted")
    else:
        one.power(False)
        ctx.run_for(0.2)
        until(ctx, one.reset().done, "the lost enable is acknowledged")
        ctx.wait_until(one.power().status, 2.0, "the axis is enabled")
    ctx.run_for(0.05)
    equal(ctx, "homed", one.homed, 0, "NC-314")
    one.move_velocity(-40.0, **FAST)
    ctx.wait_until(lambda: one.position < 15.0, 5.0, "the axis is well before its limit")
    one.move_velocity(60.0, **FAST)
    ctx.run_for(1.2)
    equal(ctx, "set position", one.ref.NcToPlc.SetPos, 25.0, "NC-130", within=1e-6)
    equal(ctx, "set velocity", one.ref.NcToPlc.SetVelo, 0.0, "NC-130", within=1e-9)


@CAMPAIGN.case("target-window", requirements=("NC-152", "NC-153", "NC-154", "NC-155"))
def target_window(ctx: CaseContext) -> None:
    """An axis that is pushed off its target leaves the windows at once, and is in its target again when it
    has been within the window for the whole monitoring time, each time anew.
    """
    one = axis(ctx)
    window, dwell_s = 0.5, 0.06
    for name, value in (
        ("position_lag_monitoring", False),
        ("target_position_monitoring", True),
        ("target_position_window", window),
        ("target_position_monitoring_time", dwell_s),
        ("position_range_monitoring", True),
        ("position_range_window", 2.0 * window),
    ):
        one.write_parameter(f"axis.{name}", value)
    target = 12.0
    until(ctx, one.move_absolute(target, Velocity=180.0, **FAST).done)
    ctx.run_for(2.0 * dwell_s)
    per_mm = ctx.bench.config.drive["motor"].increments_per_revolution / 10.0
    for push_mm in (3.0, -4.0):
        ctx.inject("encoder.jump", "motor", increments=round(push_mm * per_mm))
        inside_s = ctx.now_s
        left = False
        while ctx.now_s - inside_s < dwell_s + 0.02:
            ctx.run_for(CYCLE_S)
            one.ref.ReadStatus()
            deviation = abs(one.ref.NcToPlc.ActPos - target)
            left = left or deviation > window
            if deviation > window:
                inside_s = ctx.now_s
            waited = ctx.now_s - inside_s
            if left and abs(deviation - window) > 0.02 and abs(waited - dwell_s) > 1.5 * CYCLE_S:
                equal(
                    ctx,
                    f"InTargetPosition {waited:.3f} s within the window",
                    one.ref.Status.InTargetPosition,
                    waited > dwell_s,
                    "NC-154",
                    "NC-155",
                )
            if left and abs(deviation - 2.0 * window) > 0.02:
                equal(
                    ctx,
                    f"InPositionArea at {deviation:.2f} mm",
                    one.ref.Status.InPositionArea,
                    deviation < 2.0 * window,
                    "NC-152",
                    "NC-153",
                )
        equal(ctx, "it has left the window", left, 1)


@CAMPAIGN.product(
    "ramp/{which}",
    parameters={"which": ("acceleration", "deceleration", "jerk", "default", "override")},
    title="set-points keep the {which}",
)
def ramp(ctx: CaseContext, which: str) -> None:
    """The set velocity rises and falls with its inputs, with the defaults without, and by the override."""
    one = axis(ctx)
    given = {} if which == "default" else {**FAST, "Jerk": 20_000.0 if which == "jerk" else 1e7}
    if which == "override":
        one.power(override=40.0)
    motion = one.move_velocity(160.0, **given)
    until(ctx, motion.in_velocity, "the velocity is reached")
    top = 160.0 * (0.4 if which == "override" else 1.0)
    equal(ctx, "velocity", one.ref.NcToPlc.SetVelo, top, within=1e-6)
    velocity = ctx.trace()["x.set_velocity"]
    begun = float(velocity.time_s[np.flatnonzero(velocity.values)[0]]) - CYCLE_S
    going = {"Operational", "ControlLoopClosed", "PTPmode", "HasJob", "PositiveDirection"}
    ctx.run_for(0.01)
    status(ctx, one, going | {"ConstantVelocity", "ContinuousMotion"}, "NC-459", besides=("NewTargetPos",))
    up, down, jerk = (1500.0, 1500.0, 2250.0) if which == "default" else (1200.0, 800.0, given["Jerk"])
    reached = ctx.now_s - 0.01 - begun
    rise = top / up + up / jerk if top > up * up / jerk else 2.0 * (top / jerk) ** 0.5
    equal(ctx, "time of speeding up", reached, rise, within=4 * CYCLE_S + 0.1 * (which == "override"))
    halt = one.halt(**({} if which == "default" else {"Deceleration": 800.0, "Jerk": jerk}))
    took = until(ctx, halt.done)
    fall = top / down + down / jerk if top > down * down / jerk else 2.0 * (top / jerk) ** 0.5
    equal(ctx, "time of slowing down", took, fall, within=4 * CYCLE_S)
    equal(ctx, "the motion is aborted", motion.CommandAborted, 1)


@CAMPAIGN.product(
    "buffer/{mode}",
    parameters=[
        {"mode": mode.name, "number": int(mode), "passing": passing}
        for mode, passing in (
            (BufferMode.Aborting, None),
            (BufferMode.Buffered, 0.0),
            (BufferMode.BlendingLow, 90.0),
            (BufferMode.BlendingPrevious, 170.0),
            (BufferMode.BlendingNext, 90.0),
            (BufferMode.BlendingHigh, 170.0),
        )
    ],
    title="second motion with {mode}",
)
def buffer(ctx: CaseContext, mode: str, number: int, passing: float | None) -> None:
    """The second motion takes over at the target of the first with the velocity that its mode says."""
    del mode
    one = axis(ctx)
    first = one.move_absolute(100.0, Velocity=170.0, **FAST)
    ctx.run_for(0.1)
    second = one.move_absolute(200.0, Velocity=90.0, BufferMode=BufferMode(number), **FAST)
    ctx.run_for(0.01)
    one.ref.ReadStatus()
    waits = passing is not None
    equal(ctx, "CmdBuffered", one.ref.Status.CmdBuffered, waits)
    equal(ctx, "the second is active", second.Active, not waits)
    until(ctx, second.done)
    equal(ctx, "the first is done", first.Done, waits)
    equal(ctx, "the first is aborted", first.CommandAborted, not waits)
    if passing is not None:
        found = speed_at(ctx, "x.set_position", "x.set_velocity", 100.0)
        equal(ctx, "velocity at the first target", found, passing, within=1200.0 * 2 * CYCLE_S)
    there(ctx, one, 200.0)


@CAMPAIGN.product(
    "continuous/{end}",
    parameters={"end": (0.0, 40.0, 250.0)},
    title="through a position with {end} mm/s",
)
def continuous(ctx: CaseContext, end: float) -> None:
    """The position is passed with the end velocity, and the axis goes on with it until it is halted."""
    one = axis(ctx)
    motion = one.move_continuous_absolute(120.0, end, Velocity=150.0, **FAST)
    until(ctx, motion.in_end_velocity, "the end velocity is reached")
    ctx.run_for(0.05)
    equal(ctx, "velocity", one.ref.NcToPlc.SetVelo, end, within=1e-6)
    equal(ctx, "Busy", motion.Busy, 1)
    if end:
        found = speed_at(ctx, "x.set_position", "x.set_velocity", 120.0)
        equal(ctx, "velocity at the position", found, end, within=1200.0 * 2 * CYCLE_S)
        until(ctx, one.halt(Deceleration=800.0, Jerk=1e6).done)
    else:
        there(ctx, one, 120.0)


@CAMPAIGN.case("additive")
def additive(ctx: CaseContext) -> None:
    """A relative motion counts from where it begins, an additive one from the last target."""
    one = axis(ctx)
    one.move_absolute(100.0, Velocity=100.0, **FAST)
    ctx.run_for(0.4)
    until(ctx, one.move_additive(-10.0, Velocity=120.0, **FAST).done)
    there(ctx, one, 90.0)
    until(ctx, one.move_relative(-12.5, Velocity=120.0, **FAST).done)
    there(ctx, one, 77.5)
    until(ctx, one.set_position(1000.0).done)
    ctx.run_for(0.01)
    equal(ctx, "position", one.position, 1000.0, within=0.02)
    equal(ctx, "set position", one.ref.NcToPlc.SetPos, 1000.0, within=0.02)
    until(ctx, one.set_position(-990.0, relative=True).done)
    ctx.run_for(0.01)
    equal(ctx, "position", one.position, 10.0, within=0.02)


@CAMPAIGN.product(
    "modulo/{direction}-{place}",
    parameters=[
        {"direction": direction.name, "number": int(direction), "place": place, "ends": ends}
        for direction, place, ends in (
            (Direction.POSITIVE, 90.0, 90.0),
            (Direction.POSITIVE, 30.0, 390.0),
            (Direction.NEGATIVE, 30.0, 30.0),
            (Direction.NEGATIVE, 90.0, -270.0),
            (Direction.SHORTEST, 300.0, -60.0),
            (Direction.SHORTEST, 200.0, 200.0),
            (Direction.POSITIVE, 450.0, 450.0),
        )
    ],
    title="modulo position {place}, {direction}",
)
def modulo(ctx: CaseContext, direction: str, number: int, place: float, ends: float) -> None:
    """From 50 mm the axis goes the way that its direction says; a turn more counts."""
    del direction
    one = axis(ctx, "y")
    until(ctx, one.move_absolute(50.0, Velocity=180.0, **FAST).done)
    until(ctx, one.move_modulo(place, Direction(number), Velocity=400.0, **FAST).done)
    there(ctx, one, ends, within=0.05)


REFUSED: Final[dict[str, tuple[str, dict[str, Any], int]]] = {
    "below-minimum": ("move_absolute", {"position": -150.1, "Velocity": 10.0}, 0x4460),
    "above-maximum": ("move_absolute", {"position": 350.1, "Velocity": 10.0}, 0x4461),
    "relative-above": ("move_relative", {"distance": 350.1, "Velocity": 10.0}, 0x4461),
    "no-velocity": ("move_absolute", {"position": 1.0, "Velocity": 0.0}, 0x4359),
    "too-fast": ("move_absolute", {"position": 1.0, "Velocity": 600.0}, 0x4359),
    "too-small": ("move_relative", {"distance": 0.00001, "Velocity": 1.0}, 0x435A),
    "acceleration": ("move_relative", {"distance": 1.0, "Velocity": 1.0, "Acceleration": -1.0}, 0x4B06),
    "buffer-mode": ("move_relative", {"distance": 1.0, "Velocity": 1.0, "BufferMode": 77}, 0x4B06),
    "end-velocity": (
        "move_continuous_relative",
        {"distance": 9.0, "end_velocity": -1.0, "Velocity": 1.0},
        0x4B06,
    ),
    "gear-out": ("gear_out", {}, 0x4B05),
    "external": ("external_disable", {}, 0x42E3),
}


@CAMPAIGN.product(
    "refused/{what}",
    parameters={"what": tuple(REFUSED)},
    title="refused: {what}",
)
def refused(ctx: CaseContext, what: str) -> None:
    """The block has the code of the error, the axis does not move and goes on as if nothing had been."""
    one = axis(ctx)
    method, inputs, code = REFUSED[what]
    before = one.position
    block = getattr(one, method)(**inputs)
    ctx.run_for(0.05)
    equal(ctx, "ErrorID", block.ErrorID, code)
    equal(ctx, "Error without Busy and Done", block.Error - block.Busy - block.Done, 1)
    equal(ctx, "way", one.position - before, 0.0, within=0.01)
    for allowed in (-150.0, 350.0) if what in ("below-minimum", "above-maximum") else (5.0,):
        until(ctx, one.move_absolute(allowed, Velocity=300.0, **FAST).done)
        there(ctx, one, allowed)


@CAMPAIGN.product(
    "enable/{what}",
    parameters=[
        {"what": "none", "power": {"enable": False}, "code": 0x4356, "sign": 1.0},
        {"what": "no-plus", "power": {"positive": False}, "code": 0x4358, "sign": 1.0},
        {"what": "no-minus", "power": {"negative": False}, "code": 0x4357, "sign": -1.0},
    ],
    title="without an enable: {what}",
)
def enables(ctx: CaseContext, what: str, power: dict[str, bool], code: int, sign: float) -> None:
    """Without its enable a motion is refused, and one that runs ends; the other direction goes on."""
    one = axis(ctx)
    moving = one.move_velocity(sign * 90.0, **FAST)
    until(ctx, moving.in_velocity, "the velocity is reached")
    one.power(**power)
    ctx.run_for(1.0)
    equal(ctx, "set velocity", one.ref.NcToPlc.SetVelo, 0.0, within=1e-9)
    equal(ctx, "the motion has ended", moving.Busy, 0)
    block = one.move_relative(sign * 5.0, Velocity=50.0)
    ctx.run_for(0.05)
    equal(ctx, "ErrorID", block.ErrorID, code)
    if what != "none":
        until(ctx, one.reset().done)
        until(ctx, one.move_relative(-sign * 5.0, Velocity=50.0, **FAST).done)


@CAMPAIGN.product(
    "stop/{which}",
    parameters={"which": ("stop", "halt")},
    title="MC_{which}",
)
def stop(ctx: CaseContext, which: str) -> None:
    """MC_Stop locks the axis until Execute falls, MC_Halt does not; both brake as their inputs say."""
    one = axis(ctx)
    moving = one.move_velocity(150.0, **FAST)
    until(ctx, moving.in_velocity, "the velocity is reached")
    block = getattr(one, which)(Deceleration=600.0, Jerk=1e7)
    took = until(ctx, block.done)
    equal(ctx, "time of braking", took, 150.0 / 600.0, within=4 * CYCLE_S)
    equal(ctx, "aborted", moving.CommandAborted, 1)
    one.ref.ReadStatus()
    equal(ctx, "MotionCommandsLocked", one.ref.Status.MotionCommandsLocked, which == "stop")
    tried = one.move_relative(10.0, Velocity=50.0, **FAST)
    ctx.run_for(0.02)
    code, covered = (0x42EF, ("NC-741",)) if which == "stop" else (0, ())
    equal(ctx, "ErrorID", tried.ErrorID, code, *covered)
    if which == "stop":
        block.set(Execute=False)
        ctx.run_for(0.01)
        tried = one.move_relative(10.0, Velocity=50.0, **FAST)
    until(ctx, tried.done)


@CAMPAIGN.product(
    "jog/{mode}-{way}",
    parameters=[
        {"mode": mode.name.rpartition("_")[2].lower(), "number": int(mode), "way": way}
        for mode in (
            JogMode.MC_JOGMODE_STANDARD_SLOW,
            JogMode.MC_JOGMODE_STANDARD_FAST,
            JogMode.MC_JOGMODE_CONTINOUS,
            JogMode.MC_JOGMODE_INCHING,
        )
        for way in ("forward", "backwards")
    ],
    title="MC_Jog {mode} {way}",
)
def jog(ctx: CaseContext, mode: str, number: int, way: str) -> None:
    """Jogging has the velocity of its mode and ends with its input; inching goes a way."""
    one = axis(ctx)
    sign = 1.0 if way == "forward" else -1.0
    one.write_parameter("axis.manual_velocity_slow", 33.0)
    one.write_parameter("axis.manual_velocity_fast", 77.0)
    block = one.jog(JogMode(number), backwards=sign < 0.0, Velocity=55.0, Position=12.5, **FAST)
    if mode == "inching":
        until(ctx, block.done)
        there(ctx, one, sign * 12.5)
        return
    ctx.run_for(0.5)
    wanted = {"slow": 33.0, "fast": 77.0, "continous": 55.0}[mode]
    equal(ctx, "velocity", one.ref.NcToPlc.SetVelo, sign * wanted, within=1e-6)
    block.set(JogForward=False, JogBackwards=False)
    ctx.run_for(0.5)
    equal(ctx, "velocity", one.ref.NcToPlc.SetVelo, 0.0, within=1e-9)
    equal(ctx, "Busy", block.Busy, 0)


@CAMPAIGN.product(
    "lag/{filter_s}",
    parameters={"filter_s": (0.02, 0.1)},
    title="position lag for {filter_s} s",
)
def lag(ctx: CaseContext, filter_s: float) -> None:
    """A lag above its maximum is an error after the filter time, not before; reset and enable go on."""
    one = axis(ctx)
    for key, value in (("axis.position_lag_max", 2.5), ("axis.position_lag_filter_time", filter_s)):
        one.write_parameter(key, value)
    moving = one.move_velocity(100.0, **FAST)
    until(ctx, moving.in_velocity, "the velocity is reached")
    ctx.inject("mechanics.jam", "motor")
    ctx.wait_until(lambda: abs(one.object.following_error) > 2.5, 1.0, "the lag is above its maximum")
    took = until(ctx, lambda: one.error_id, "the axis has an error")
    equal(ctx, "time until the error", took, filter_s, within=3 * CYCLE_S)
    equal(ctx, "code of the axis", one.error_id, 0x4550)
    ctx.run_for(0.01)
    equal(ctx, "code of the block", moving.ErrorID, 0x4550)
    one.ref.ReadStatus()
    equal(ctx, "Error, not Operational", one.ref.Status.Error - one.ref.Status.Operational, 1)


@CAMPAIGN.product(
    "drive-fault/{name}",
    parameters={"name": ("x", "y")},
    title="fault of the drive of {name}",
)
def drive_fault(ctx: CaseContext, name: str) -> None:
    """A fault of the drive is error 4650h of the axis and of its block; reset and a motion go on."""
    one = axis(ctx, name)
    moving = one.move_velocity(-60.0, **FAST)
    until(ctx, moving.in_velocity, "the velocity is reached")
    ctx.inject("drive.fault", {"x": "motor", "y": "feeder"}[name], code=0x2310)
    ctx.run_for(0.6)
    equal(ctx, "code of the axis", one.error_id, 0x4650)
    equal(ctx, "code of the block", moving.ErrorID, 0x4650)
    one.ref.ReadStatus()
    equal(ctx, "DriveDeviceError", one.ref.Status.DriveDeviceError, 1)
    until(ctx, one.reset().done)
    ctx.wait_until(lambda: one.operational, 2.0, "the axis is enabled again")
    equal(ctx, "no code any more", one.error_id, 0)
    until(ctx, one.move_absolute(20.0, Velocity=100.0, **FAST).done)
    there(ctx, one, 20.0)


@CAMPAIGN.product(
    "homing/{cam}-{sync}",
    parameters=[
        {"cam": cam, "sync": sync, "edge": edge}
        for cam, sync, edge in (("right", "left", 60.0), ("right", "right", 85.0))
    ],
    title="homing at the cam to the {cam}, its {sync} edge",
    requirements=("NC-320",),
)
def homing(ctx: CaseContext, cam: str, sync: str, edge: float) -> None:
    """Towards the cam and off it with their own velocities; its edge gets the home position."""
    del cam
    one = axis(ctx)
    for key, value in (
        ("axis.homing_velocity_towards_cam", 40.0),
        ("axis.homing_velocity_off_cam", 11.0),
        ("enc.homing_invert_sync_search", sync == "left"),
        ("enc.home_position", 222.0),
        ("enc.homing_sensor_source", "Digital Input 3"),
    ):
        one.write_parameter(key, value)
    home = one.home()
    ctx.run_for(0.3)
    one.ref.ReadStatus()
    equal(ctx, "HomingBusy, not Homed", one.ref.Status.HomingBusy - one.ref.Status.Homed, 1)
    equal(ctx, "velocity towards the cam", one.ref.NcToPlc.SetVelo, 40.0, within=1e-6)
    until(ctx, home.done, "homing is done")
    ctx.run_for(0.3)
    one.ref.ReadStatus()
    equal(ctx, "Homed, not HomingBusy", one.ref.Status.Homed - one.ref.Status.HomingBusy, 1)
    true_mm = float(ctx.trace()["motor.position"].values[-1]) * 1000.0
    equal(ctx, "home position of the machine", true_mm - one.position, edge - 222.0, "NC-320", within=0.1)


@CAMPAIGN.case("home-here")
def home_here(ctx: CaseContext) -> None:
    """Direct homing gives the present place a position; the flag alone can be taken and given."""
    one = axis(ctx)
    until(ctx, one.home(25.0, mode=HomingMode.MC_Direct).done)
    ctx.run_for(0.01)
    equal(ctx, "homed", one.homed, 1)
    equal(ctx, "position", one.position, 25.0, within=0.01)
    until(ctx, one.home(mode=HomingMode.MC_ResetCalibration).done)
    ctx.run_for(0.01)
    equal(ctx, "homed", one.homed, 0)
    until(ctx, one.home(mode=HomingMode.MC_ForceCalibration).done)
    ctx.run_for(0.01)
    equal(ctx, "homed", one.homed, 1)
    equal(ctx, "position", one.position, 25.0, within=0.01)


@CAMPAIGN.product(
    "gear/{ratio}",
    parameters={"ratio": (2.0, -0.5)},
    title="coupling with ratio {ratio}",
)
def gear(ctx: CaseContext, ratio: float) -> None:
    """The slave goes the way of its master times the ratio; stops and errors go through the coupling."""
    master, slave = axis(ctx, "x"), axis(ctx, "y")
    coupling = slave.gear_in(master, ratio)
    until(ctx, coupling.in_gear, "the axes are coupled")
    ctx.run_for(0.01)
    equal(ctx, "CoupleState of the master", master.ref.NcToPlc.CoupleState, 1)
    equal(ctx, "CoupleState of the slave", slave.ref.NcToPlc.CoupleState, 3)
    until(ctx, master.move_absolute(80.0, Velocity=120.0, **FAST).done)
    there(ctx, slave, 80.0 * ratio, within=0.05)
    moving = master.move_velocity(-40.0, **FAST)
    until(ctx, moving.in_velocity, "the velocity is reached")
    ctx.run_for(0.01)
    equal(ctx, "velocity of the slave", slave.ref.NcToPlc.SetVelo, -40.0 * ratio, within=1e-6)
    until(ctx, slave.gear_out().done)
    ctx.run_for(0.05)
    equal(ctx, "velocity goes on", slave.ref.NcToPlc.SetVelo, -40.0 * ratio, within=1e-6)
    equal(ctx, "CoupleState", slave.ref.NcToPlc.CoupleState, 0)
    equal(ctx, "the coupling is aborted", coupling.CommandAborted, 1)
    until(ctx, slave.halt().done)
    equal(ctx, "velocity of the master", master.ref.NcToPlc.SetVelo, -40.0, within=1e-6)


@CAMPAIGN.case("gear-error")
def gear_error(ctx: CaseContext) -> None:
    """An error of a slave stops its master with 43A0h."""
    master, slave = axis(ctx, "x"), axis(ctx, "y")
    until(ctx, slave.gear_in(master).in_gear, "the axes are coupled")
    until(ctx, master.move_velocity(40.0, **FAST).in_velocity, "the velocity is reached")
    ctx.inject("drive.fault", "feeder", code=0x2310)
    ctx.run_for(0.3)
    equal(ctx, "code of the slave", slave.error_id, 0x4650)
    equal(ctx, "code of the master", master.error_id, 0x43A0)


@CAMPAIGN.case("external", requirements=("NC-565",))
def external(ctx: CaseContext) -> None:
    """Packets with a direction are the set-points; commands are refused meanwhile, and count afterwards."""
    one = axis(ctx)
    until(ctx, one.external_enable(30.0).done)
    packet = {"s": 0.0, "step": 0.2}

    def feed() -> None:
        if packet["s"] < 30.0:
            packet["s"] += packet["step"]
        written = one.ref.PlcToNc
        written.ExtSetPos, written.ExtSetDirection = packet["s"], 1
        written.ExtSetVelo = 100.0 if packet["s"] < 30.0 else 0.0

    ctx.bench.on_cycle(feed)
    ctx.run_for(0.1)
    one.ref.ReadStatus()
    equal(ctx, "ExtSetPointGenEnabled", one.ref.Status.ExtSetPointGenEnabled, 1, "NC-565")
    equal(ctx, "set velocity", one.ref.NcToPlc.SetVelo, 100.0, within=1e-6)
    tried = one.move_absolute(10.0, Velocity=50.0)
    ctx.run_for(0.02)
    equal(ctx, "ErrorID", tried.ErrorID, 0x42E2)
    ctx.run_for(0.5)
    equal(ctx, "position", one.position, 30.0, within=0.25)
    until(ctx, one.external_disable().done)
    ctx.run_for(0.05)
    one.ref.ReadStatus()
    equal(ctx, "ExtSetPointGenEnabled", one.ref.Status.ExtSetPointGenEnabled, 0)
    until(ctx, one.move_absolute(10.0, Velocity=50.0, **FAST).done)
    there(ctx, one, 10.0)


@CAMPAIGN.case("plc-stops", requirements=("NC-438",))
def plc_stops(ctx: CaseContext) -> None:
    """Without fresh data of the PLC the interface is cleared after the watchdog time, and the enables go."""
    one = axis(ctx)
    until(ctx, one.move_velocity(50.0, **FAST).in_velocity, "the velocity is reached")
    ctx.bench.nc.plc_running = False
    ctx.run_for(9 * CYCLE_S)
    equal(ctx, "set velocity", one.ref.NcToPlc.SetVelo, 50.0, within=1e-6)
    ctx.run_for(0.4)
    equal(ctx, "set velocity", one.ref.NcToPlc.SetVelo, 0.0, "NC-438", within=1e-6)
    equal(ctx, "operational", one.operational, 0, "NC-438")
