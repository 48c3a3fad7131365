"""What a controlled axis makes of its values: dynamics, superposition, interpolation, backlash, and encoders
that are switched.
"""

from __future__ import annotations

from typing import Any, Final

import numpy as np

from hil.bench import BenchFile, load_bench
from hil.campaign import Campaign, CaseContext
from hil.expect import always, no_alarm
from testcases.campaigns._reactions import cycles
from testcases.campaigns.support import axis_name, drive_name, enable

_HERE: Final = "testcases.campaigns.axis_motion"
_TEXT: Final = load_bench("reference").text
_AXIS: Final = 'drive = "drive1"\n'
PLAY_MM: Final = 0.2
"""Play between motor and load, and what the axis compensates of it."""
SETTINGS: Final = {
    "PositioningMonitoring.Window": 0.01,
    "PositionControl.SmoothingTimeByChangeDifference": 0.1,
}


def _with_scale(name: str, *, play_mm: float = 0.0, **variables: Any) -> BenchFile:
    """Return the reference bench with a second encoder, which measures the load."""
    lines = [
        line for line in _TEXT.splitlines() if line.partition(" ")[0].strip('"') not in SETTINGS | variables
    ]
    text = "\n".join(lines).replace(_AXIS.strip(), 'drive = "drive1"\nencoders = ["drive1", "scale"]', 1)
    settings = "".join(f'"{path}" = {str(value).lower()}\n' for path, value in (SETTINGS | variables).items())
    scale = f"""
[encoder.scale]
segment = "can0"
node_id = 20
type = "incremental_linear"
measuring_step_um = 1.0
on = "drive1"
mounting = "load"
backlash_mm = {play_mm}
"""
    return BenchFile(name, f"{text}\n{settings}{scale}")


SLOW: Final = BenchFile(
    "slow interpolator", _TEXT.replace("cycle_ms = 4\n", "cycle_ms = 4\ninterpolator_ms = 12\n", 1)
)
TWO: Final = _with_scale("two encoders")
PLAY: Final = _with_scale(
    "play between motor and load",
    play_mm=PLAY_MM,
    **{"Sensor[1].Backlash.Enable": True, "Sensor[1].Backlash.Size": PLAY_MM},
)

CAMPAIGN: Final = Campaign("axis motion", tags=("axis",), bench="reference")
INTERPOLATOR: Final = Campaign("interpolator", tags=("axis",), bench=f"{_HERE}:SLOW")
ENCODERS: Final = Campaign("two encoders", tags=("axis", "encoder"), bench=f"{_HERE}:TWO")
BACKLASH: Final = Campaign("backlash", tags=("axis", "mechanics"), bench=f"{_HERE}:PLAY")


@CAMPAIGN.case("slows-down", requirements=("MC-296",))
def slows_down(ctx: CaseContext) -> None:
    """A velocity is reduced with the deceleration of the job, not with its acceleration: 200 mm/s with 500
    mm/s2 and 10000 mm/s3.
    """
    axis = axis_name(ctx)
    enable(ctx)
    fast = ctx.axis.move_velocity(300.0, Acceleration=2000.0, Deceleration=2000.0, Jerk=0.0)
    ctx.wait_until(fast.in_velocity, 3.0, "300 mm/s are reached")
    since = ctx.now_s
    slow = ctx.axis.move_velocity(100.0, Acceleration=2000.0, Deceleration=500.0, Jerk=10_000.0)
    ctx.wait_until(slow.in_velocity, 3.0, "100 mm/s are reached")
    wanted = 200.0 / 500.0 + 500.0 / 10_000.0
    ctx.measure(
        "time to the lower velocity",
        ctx.now_s - since,
        "s",
        low=wanted - cycles(ctx, 2),
        high=wanted + cycles(ctx, 3),
        requirements=("MC-296",),
    )
    greatest = float(-ctx.trace()[f"{axis}.acceleration_setpoint"].values.min())
    ctx.measure("greatest deceleration", greatest, "mm/s2", low=499.0, high=500.0 + 1e-6)
    ctx.expect(no_alarm(axis=axis))


@CAMPAIGN.case("superimposed-room", requirements=("MC-352",))
def superimposed_room(ctx: CaseContext) -> None:
    """A superimposed motion gets what the basic one leaves of the velocity limit, and covers its distance all
    the same.
    """
    axis = axis_name(ctx)
    enable(ctx)
    basic = ctx.axis.move_velocity(450.0, Acceleration=2000.0, Jerk=0.0)
    ctx.wait_until(basic.in_velocity, 3.0, "450 mm/s are reached")
    since = ctx.now_s
    dynamics = {"Acceleration": 2000.0, "Deceleration": 2000.0, "Jerk": 0.0}
    moving = ctx.axis.move_superimposed(10.0, VelocityDiff=200.0, **dynamics)
    ctx.wait_until(moving.done, 2.0, "the superimposed motion has ended")
    wanted = 10.0 / 50.0 + 50.0 / 2000.0
    ctx.measure(
        "time for 10 mm with 50 mm/s",
        ctx.now_s - since,
        "s",
        low=wanted - cycles(ctx, 2),
        high=wanted + cycles(ctx, 4),
    )
    ctx.expect(
        always("at most 500 mm/s", lambda v: v <= 500.0 + 1e-6, f"{axis}.velocity_setpoint").covers("MC-352"),
        # What the control adds to the highest velocity may reach the limit of the speed setpoint.
        no_alarm(axis=axis, besides=(504,)),
    )


@INTERPOLATOR.case("constant-travel", requirements=("CTL-039",))
def constant_travel(ctx: CaseContext) -> None:
    """Three servo cycles to one of the interpolator: what the drive is given moves evenly, and the drive
    follows evenly.
    """
    axis, drive = axis_name(ctx), drive_name(ctx)
    enable(ctx)
    job = ctx.axis.move_velocity(200.0, Acceleration=1000.0, Jerk=10_000.0)
    ctx.wait_until(job.in_velocity, 3.0, "200 mm/s are reached")
    ctx.run_for(0.2)
    since = ctx.now_s
    ctx.run_for(0.3)
    velocity = ctx.trace()[f"{drive}.velocity"]
    during = velocity.values[velocity.time_s > since] * 1000.0
    ctx.measure("unevenness of the drive", float(np.ptp(during)), "mm/s", high=0.5)
    error = ctx.trace()[f"{axis}.following_error"]
    lag = float(np.abs(error.values[error.time_s > since]).max())
    ctx.measure("following error", lag, "mm", high=0.1, requirements=("CTL-039",))


_DIFFERENCE: Final = 0.4
"""What the scale has slipped by, mm (CFG-330)."""


@ENCODERS.product(
    "switched/{mode}",
    parameters={"mode": (0, 1, 2, 3)},
    title="MC_SetSensor Mode {mode} at rest, the encoders 0.4 mm apart",
    requirements=("CFG-325", "CFG-326", "CFG-327", "CFG-328", "CFG-329", "CFG-330"),
)
def switched(ctx: CaseContext, mode: int) -> None:
    """Mode 0 is bumpless, 1 steps and is made up slowly, 2 and 3 transfer a position and switch nothing."""
    axis, drive = axis_name(ctx), drive_name(ctx)
    enable(ctx)
    ctx.wait_until(ctx.axis.home(100.0).done, 2.0, "the axis is homed")
    ctx.wait_until(ctx.axis.set_sensor(2, mode=2).done, 2.0, "both encoders agree")
    ctx.inject("encoder.jump", "scale", increments=round(_DIFFERENCE * 1000.0))
    ctx.run_for(0.1)

    def shown(number: int) -> float:
        return float(ctx.axis.var(f"StatusSensor[{number}].Position"))

    ctx.measure("encoder 2 ahead", shown(2) - shown(1), "mm", low=_DIFFERENCE - 0.01, high=_DIFFERENCE + 0.01)
    since = ctx.now_s
    # Mode 3 takes the position of encoder 2 over to encoder 1, which goes on controlling.
    target, reference = (1, 2) if mode == 3 else (2, 1)
    ctx.wait_until(
        ctx.axis.set_sensor(target, mode=mode, reference=reference).done, 2.0, "MC_SetSensor is done"
    )
    ctx.run_for(cycles(ctx, 2))
    at_once = float(ctx.axis.var("ActualPosition"))
    ctx.run_for(1.0)
    stepped = mode in (1, 3)
    wanted = 100.0 + (_DIFFERENCE if stepped else 0.0)
    slack = 0.1 if stepped else 0.01
    ctx.measure("ActualPosition at once", at_once, "mm", low=wanted - slack, high=wanted + slack)
    operative = 2 if mode < 2 else 1
    ctx.measure("OperativeSensor", float(ctx.axis.var("OperativeSensor")), low=operative, high=operative)
    rest = shown(2) - shown(1)
    apart = _DIFFERENCE if mode == 1 else 0.0
    ctx.measure("encoders apart in the end", rest, "mm", low=apart - 0.02, high=apart + 0.02)
    trace = ctx.trace()
    machine = trace[f"{drive}.position"]
    moved = (float(machine.values[-1]) - machine.at(since)) * 1000.0
    back = -_DIFFERENCE if stepped else 0.0
    ctx.measure("way of the machine", moved, "mm", low=back - 0.02, high=back + 0.02)
    speed = trace[f"{drive}.velocity"]
    fastest = float(np.abs(speed.values[speed.time_s > since]).max()) * 1000.0
    # Unsmoothed it would be Kv * 0.4 mm = 8 mm/s.
    if mode == 1:
        ctx.measure("greatest velocity on the way", fastest, "mm/s", high=4.0, requirements=("CFG-329",))
    ctx.expect(no_alarm(axis=axis))


@BACKLASH.product(
    "reversal/{direction}",
    parameters={"direction": ("forward", "backward")},
    title="reversal after a motion {direction}, with backlash compensation",
    requirements=("CFG-553", "CFG-554"),
)
def reversal(ctx: CaseContext, direction: str) -> None:
    """The motor goes the play further, PassingBacklash is shown meanwhile and no longer, and the load goes
    exactly its way.
    """
    axis, drive = axis_name(ctx), drive_name(ctx)
    sign = 1.0 if direction == "forward" else -1.0
    enable(ctx)

    def move(distance: float) -> None:
        job = ctx.axis.move_relative(distance, Velocity=50.0)
        ctx.wait_until(job.done, 3.0, f"{distance:g} mm are gone")
        ctx.run_for(0.2)

    move(5.0 * sign)
    ctx.wait_until(ctx.axis.home(0.0).done, 2.0, "the axis is homed")
    load = float(ctx.axis.var("StatusSensor[2].Position"))
    start = ctx.now_s
    back = ctx.axis.move_relative(-10.0 * sign, Velocity=50.0)
    shown = []
    while not back.done() and ctx.now_s < start + 3.0:
        ctx.run_for(cycles(ctx, 1))
        shown.append((ctx.now_s, bool(ctx.axis.var("StatusWord2.X2"))))
    ctx.run_for(0.2)
    machine = ctx.trace()[f"{drive}.position"]

    def gone_by(time_s: float) -> float:
        return abs(machine.at(time_s) - machine.at(start)) * 1000.0

    motor = gone_by(ctx.now_s)
    ctx.measure(
        "way of the motor", motor, "mm", low=9.98 + PLAY_MM, high=10.02 + PLAY_MM, requirements=("CFG-554",)
    )
    passing = [gone_by(time_s) for time_s, bit in shown if bit]
    ctx.measure(
        "way of the motor while PassingBacklash is shown",
        max(passing, default=0.0),
        "mm",
        low=0.5 * PLAY_MM,
        high=1.5 * PLAY_MM,
        requirements=("CFG-553",),
    )
    gone = abs(float(ctx.axis.var("StatusSensor[2].Position")) - load)
    ctx.measure("way of the load", gone, "mm", low=9.97, high=10.03, requirements=("CFG-554",))
    ctx.expect(no_alarm(axis=axis))
