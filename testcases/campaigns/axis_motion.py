"""What a controlled axis makes of its values: dynamics, superposition, interpolation, backlash, and encoders
that are switched.
"""

from __future__ import annotations

from typing import Any, Final

import numpy as np

from hil.bench import BenchFile, load_bench
from hil.campaign import Campaign, CaseContext
from hil.expect import always, no_alarm
from testcases.campaigns._reactions import calls, cycles
from testcases.campaigns.own_axis import own
from testcases.campaigns.support import axis_name, drive_name, enable, equal

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
INTERPOLATOR: Final = Campaign(
    "interpolator", tags=("axis",), bench=f"{_HERE}:SLOW", needs={"interpolator": "not 1", "play": "none"}
)
ENCODERS: Final = Campaign(
    "two encoders",
    tags=("axis", "encoder"),
    bench=f"{_HERE}:TWO",
    needs={"feedback": "both", "motion": ("linear", "rotary"), "play": "none"},
)
BACKLASH: Final = Campaign(
    "backlash",
    tags=("axis", "mechanics"),
    bench=f"{_HERE}:PLAY",
    needs={"feedback": "both", "motion": ("linear", "rotary"), "play": "compensated"},
)


@CAMPAIGN.case("slows-down", requirements=("MC-296",))
def slows_down(ctx: CaseContext) -> None:
    """A velocity is reduced with deceleration and jerk of the job, not with its acceleration."""
    axis, values = axis_name(ctx), own(ctx)
    enable(ctx)
    high, low = values.speed(values.draw("high", 0.55, 0.7)), values.speed(values.draw("low", 0.12, 0.2))
    fast = ctx.axis.move_velocity(values.given(high), **values.dynamics("fast").without_jerk().inputs)
    ctx.wait_until(fast.in_velocity, 3.0, f"{values.words(high)} are reached")
    since = ctx.now_s
    dynamics = values.dynamics("slow").with_jerk(values.golden)
    ctx.do(f"MC_MoveVelocity {values.words(low)}")
    slow = ctx.axis.move_velocity(values.given(low), **dynamics.inputs)
    ctx.wait_until(slow.in_velocity, 3.0, "the lower velocity is reached")
    wanted = dynamics.stop(high - low).time_s
    ctx.measure(
        "time to the lower velocity",
        ctx.now_s - since,
        "s",
        low=wanted - calls(ctx, 2),
        high=wanted + calls(ctx, 3),
        requirements=("MC-296",),
    )
    greatest = float(-ctx.trace()[f"{axis}.acceleration_setpoint"].values.min())
    ctx.measure(
        "greatest deceleration",
        greatest,
        f"{values.unit}/s2",
        low=0.998 * dynamics.deceleration,
        high=(1.0 + 1e-9) * dynamics.deceleration,
    )
    ctx.expect(no_alarm(axis=axis))


@CAMPAIGN.case("superimposed-room", requirements=("MC-352",))
def superimposed_room(ctx: CaseContext) -> None:
    """A superimposed motion gets what the basic one leaves of the velocity limit, and covers its distance all
    the same.
    """
    axis, values = axis_name(ctx), own(ctx)
    enable(ctx)
    limit = values.golden.maximum_velocity
    velocity = values.speed(values.draw("basic", 0.86, 0.92))
    dynamics = values.dynamics().without_jerk()
    basic = ctx.axis.move_velocity(values.given(velocity), **dynamics.inputs)
    ctx.wait_until(basic.in_velocity, 3.0, f"{values.words(velocity)} are reached")
    since = ctx.now_s
    begun = _setpoint(ctx, axis)
    left, distance = limit - velocity, values.way(values.draw("distance", 0.018, 0.024))
    extra = values.dynamics("superimposed").without_jerk()
    moving = ctx.axis.move_superimposed(
        distance, VelocityDiff=values.given(values.speed(0.37)), **extra.inputs
    )
    ctx.wait_until(moving.done, 2.0, "the superimposed motion has ended")
    took = ctx.now_s - since
    wanted = distance / left + left / 2.0 / extra.acceleration + left / 2.0 / extra.deceleration
    ctx.measure(
        f"time for {distance:.4g} {values.unit} with {left:.4g} {values.unit}/s",
        took,
        "s",
        low=wanted - calls(ctx, 2),
        high=wanted + calls(ctx, 4),
    )
    covered = _setpoint(ctx, axis) - begun - velocity * took
    slack = 2e-3 * distance + velocity * calls(ctx, 1)
    ctx.measure(
        "way of the superimposed motion", covered, values.unit, low=distance - slack, high=distance + slack
    )
    ctx.expect(
        always(
            "at most the maximum velocity", lambda v: v <= limit * (1.0 + 1e-9), f"{axis}.velocity_setpoint"
        ).covers("MC-352"),
        # What the control adds to the highest velocity may reach the limit of the speed setpoint.
        no_alarm(axis=axis, besides=(504,)),
    )


@CAMPAIGN.case("superimposed-again", requirements=("MC-344", "MC-353", "MC-357"))
def superimposed_again(ctx: CaseContext) -> None:
    """A superimposed motion that supersedes another one adds its distance to what that one has covered, also
    to the other side.
    """
    axis, values = axis_name(ctx), own(ctx)
    enable(ctx)
    inputs = {"VelocityDiff": values.given(values.speed(0.2)), **values.dynamics().without_jerk().inputs}
    slack = 2.0 * values.speed(0.2) * calls(ctx, 2)
    for first, second in ((0.2, 0.11), (-0.2, 0.13)):
        one = ctx.axis.move_superimposed(values.way(first), **inputs)
        ctx.run_for(0.35)
        begun, covered = _setpoint(ctx, axis), ctx.axis.var("StatusPositioning.SuperimposedDistance")
        two = ctx.axis.move_superimposed(values.way(second), **inputs)
        ctx.run_for(calls(ctx, 4))
        equal(ctx, "CommandAborted of the first", one.CommandAborted, 1, "MC-357")
        shown = 0.0
        while not two.done() and not two.error():
            # Behind the end it is 0 again.
            shown = float(ctx.axis.var("StatusPositioning.SuperimposedDistance")) or shown
            ctx.run_for(calls(ctx, 1))
        way = _setpoint(ctx, axis) - begun
        equal(ctx, "way of the second", way, values.way(second), "MC-344", within=slack)
        equal(
            ctx, "SuperimposedDistance at last", shown, covered + values.way(second), "MC-353", within=slack
        )
        ctx.run_for(0.05)


def _setpoint(ctx: CaseContext, axis: str) -> float:
    return float(ctx.trace()[f"{axis}.position_setpoint"].values[-1])


@INTERPOLATOR.case("constant-travel", requirements=("CTL-039",))
def constant_travel(ctx: CaseContext) -> None:
    """Several servo cycles to one of the interpolator: what the drive is given moves evenly, and the drive
    follows evenly.
    """
    axis, drive, values = axis_name(ctx), drive_name(ctx), own(ctx)
    enable(ctx)
    velocity = values.speed(values.draw("velocity", 0.35, 0.45))
    job = ctx.axis.move_velocity(values.given(velocity), **values.dynamics().inputs)
    ctx.wait_until(job.in_velocity, 3.0, f"{values.words(velocity)} are reached")
    ctx.run_for(0.2 + values.settling_s * (values.kpc < 100.0))
    since = ctx.now_s
    ctx.run_for(0.3)
    speed = ctx.trace()[f"{drive}.velocity"]
    during = speed.values[speed.time_s > since]
    ctx.measure(
        "unevenness of the drive",
        float(np.ptp(during)) / values.golden.machine_m,
        f"{values.unit}/s",
        high=0.5 * values.slow,
    )
    error = ctx.trace()[f"{axis}.following_error"]
    lag = float(np.abs(error.values[error.time_s > since]).max())
    left = velocity * (1.0 - values.kpc / 100.0) / values.kv
    ctx.measure(
        "following error", lag, values.unit, high=1.2 * left + values.way(4e-4), requirements=("CTL-039",)
    )


@ENCODERS.product(
    "switched/{mode}",
    parameters={"mode": (0, 1, 2, 3)},
    title="MC_SetSensor Mode {mode} at rest, the encoders some increments apart",
    requirements=("CFG-325", "CFG-326", "CFG-327", "CFG-328", "CFG-329", "CFG-330"),
)
def switched(ctx: CaseContext, mode: int) -> None:
    """Mode 0 is bumpless, 1 steps and is made up slowly, 2 and 3 transfer a position and switch nothing."""
    axis, drive, values = axis_name(ctx), drive_name(ctx), own(ctx)
    scale = ctx.bench.config.axis[axis].encoders[1]
    finest = values.increments[1]
    # What the scale has slipped by (CFG-330).
    slipped = max(round(values.way(values.draw("slip", 7e-4, 9e-4)) / finest), 8)
    difference = slipped * finest
    fine, coarse = max(0.025 * difference, 3.0 * values.increment, 2.0 * finest), 0.25 * difference
    enable(ctx)
    place = values.way(values.draw("place", 0.15, 0.25))
    ctx.wait_until(ctx.axis.home(place).done, 2.0, "the axis is homed")
    ctx.wait_until(ctx.axis.set_sensor(2, mode=2).done, 2.0, "both encoders agree")
    ctx.inject("encoder.jump", scale, increments=slipped)
    ctx.run_for(0.1)

    def shown(number: int) -> float:
        return float(ctx.axis.var(f"StatusSensor[{number}].Position"))

    def expect(name: str, value: float, wanted: float, slack: float) -> None:
        ctx.measure(name, value, values.unit, low=wanted - slack, high=wanted + slack)

    expect("encoder 2 ahead", shown(2) - shown(1), difference, fine)
    since = ctx.now_s
    # Mode 3 takes the position of encoder 2 over to encoder 1, which goes on controlling.
    target, reference = (1, 2) if mode == 3 else (2, 1)
    ctx.wait_until(
        ctx.axis.set_sensor(target, mode=mode, reference=reference).done, 2.0, "MC_SetSensor is done"
    )
    ctx.run_for(cycles(ctx, 2))
    at_once = float(ctx.axis.var("ActualPosition"))
    ctx.run_for(0.7 + values.settling_s)
    stepped = mode in (1, 3)
    expect(
        "ActualPosition at once",
        at_once,
        place + (difference if stepped else 0.0),
        coarse if stepped else fine,
    )
    operative = 2 if mode < 2 else 1
    ctx.measure("OperativeSensor", float(ctx.axis.var("OperativeSensor")), low=operative, high=operative)
    apart = difference if mode == 1 else 0.0
    expect("encoders apart in the end", shown(2) - shown(1), apart, 2.0 * fine)
    trace = ctx.trace()
    machine = trace[f"{drive}.position"]
    moved = (float(machine.values[-1]) - machine.at(since)) / values.golden.machine_m
    expect("way of the machine", moved, -difference if stepped else 0.0, 2.0 * fine)
    speed = trace[f"{drive}.velocity"]
    fastest = float(np.abs(speed.values[speed.time_s > since]).max()) / values.golden.machine_m
    # Unsmoothed it would be Kv times the difference.
    if mode == 1:
        smoothing_s = float(ctx.axis.variables.read("PositionControl.SmoothingTimeByChangeDifference"))
        ctx.measure(
            "greatest velocity on the way",
            fastest,
            f"{values.unit}/s",
            high=1.05 * difference / smoothing_s,
            requirements=("CFG-329",),
        )
    ctx.expect(no_alarm(axis=axis))


@ENCODERS.case("homed", requirements=("HOM-001", "HOM-002", "HOM-141"))
def homed(ctx: CaseContext) -> None:
    """A direct homing moves the positions of all encoders alike: what they were apart they stay apart."""
    axis, values = ctx.axis, own(ctx)
    scale = ctx.bench.config.axis[axis_name(ctx)].encoders[1]
    enable(ctx)
    ctx.inject("encoder.jump", scale, increments=max(round(values.way(0.0008) / values.increments[1]), 8))
    ctx.run_for(0.1)

    def apart() -> float:
        return float(axis.var("StatusSensor[2].Position") - axis.var("StatusSensor[1].Position"))

    slack = 3.0 * max(values.increments)
    before = apart()
    for mode, share in ((0, 0.31), (1, 0.17), (1, -0.23), (11, -0.42), (12, 0.13)):
        position = float(axis.var("Position"))
        value = values.way(share)
        ctx.wait_until(axis.home(value, mode=mode).done, 1.0, f"mode {mode} is done")
        ctx.run_for(cycles(ctx, 4))
        wanted = value + (position if mode in (1, 12) else 0.0)
        identifier = {0: "HOM-001", 1: "HOM-002"}.get(mode, "HOM-141")
        for name, found, goal in (("Position", axis.var("Position"), wanted), ("apart", apart(), before)):
            equal(ctx, f"mode {mode}: {name}", float(found), goal, identifier, within=slack)
    ctx.expect(no_alarm(axis=axis_name(ctx)))


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
    axis, drive, values = axis_name(ctx), drive_name(ctx), own(ctx)
    sign = 1.0 if direction == "forward" else -1.0
    play = float(ctx.axis.variables.read("Sensor[1].Backlash.Size"))
    there, back = (
        values.way(values.draw("there", 0.008, 0.012)),
        values.way(values.draw("back", 0.017, 0.023)),
    )
    slack = 0.1 * play + 2.0 * max(values.increments)
    speed = values.given(values.speed(0.03))
    enable(ctx)
    out = ctx.axis.move_relative(there * sign, Velocity=speed)
    ctx.wait_until(out.done, 3.0, "the play has been passed once")
    ctx.run_for(values.settling_s)
    ctx.wait_until(ctx.axis.home(0.0).done, 2.0, "the axis is homed")
    load = float(ctx.axis.var("StatusSensor[2].Position"))
    start = ctx.now_s
    returning = ctx.axis.move_relative(-back * sign, Velocity=speed)
    shown = []
    while not returning.done() and ctx.now_s < start + 3.0:
        ctx.run_for(cycles(ctx, 1))
        shown.append((ctx.now_s, bool(ctx.axis.var("StatusWord2.X2"))))
    ctx.run_for(values.settling_s)
    machine = ctx.trace()[f"{drive}.position"]

    def gone_by(time_s: float) -> float:
        return abs(machine.at(time_s) - machine.at(start)) / values.golden.machine_m

    ctx.measure(
        "way of the motor",
        gone_by(ctx.now_s),
        values.unit,
        low=back + play - slack,
        high=back + play + slack,
        requirements=("CFG-554",),
    )
    passing = [gone_by(time_s) for time_s, bit in shown if bit]
    ctx.measure(
        "way of the motor while PassingBacklash is shown",
        max(passing, default=0.0),
        values.unit,
        low=0.5 * play,
        high=1.5 * play,
        requirements=("CFG-553",),
    )
    gone = abs(float(ctx.axis.var("StatusSensor[2].Position")) - load)
    ctx.measure(
        "way of the load", gone, values.unit, low=back - slack, high=back + slack, requirements=("CFG-554",)
    )
    ctx.expect(no_alarm(axis=axis))
