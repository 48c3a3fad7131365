"""NC axes beyond one motion: online dialog, groups on a path, corrections, probe, parameter blocks."""

from __future__ import annotations

from itertools import pairwise
from math import hypot, pi
from typing import Any, Final

from hil.bench import BenchFile
from hil.campaign import Campaign, CaseContext
from hil.expect.golden import travel_time
from motion.nc.correction_blocks import CorrectionMode
from motion.nc.interpolation import InterpolationGroup
from motion.nc.parameter_blocks import (
    AxisParameter,
    MC_ReadActualPosition,
    MC_ReadActualVelocity,
    MC_ReadAxisError,
    MC_ReadBoolParameter,
    MC_ReadParameter,
    MC_ReadParameterSet,
    MC_ReadStatus,
    MC_WriteBoolParameter,
    MC_WriteParameter,
)
from motion.nc.touch_probe import ProbeSource
from testcases.campaigns.nc_axes import axis, until
from testcases.campaigns.support import equal

BENCH: Final = BenchFile(
    "nc machines",
    """
[bench]
name = "nc machines"
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
probe1_from_mm = 31.0
probe1_to_mm = 47.0
input_filter_ms = 0.0
hysteresis_mm = 0.0

[nc.parameters]
"task.watchdog_cycles" = 0

[axis.x]
controller = "nc"
drive = "motor"

[axis.x.parameters]
"ctrl.pos_kv" = 25.0
"axis.position_correction" = true
"axis.maximum_acceleration" = 1000.0
"axis.maximum_deceleration" = 800.0
"enc.modulo_factor" = 90.0
"axis.manual_velocity_fast" = 400.0
"axis.rapid_traverse_velocity" = 300.0

[axis.v]
controller = "nc"

[axis.v.parameters]
"axis.maximum_acceleration" = 1000.0
"axis.maximum_deceleration" = 800.0
"axis.rapid_traverse_velocity" = 90.0
"axis.velo_jump_factor" = 2.0
""",
)
CAMPAIGN: Final = Campaign(
    "nc machines", tags=("nc",), controller="nc", bench="testcases.campaigns.nc_machines:BENCH"
)
CYCLE_S: Final = 0.002


# -- online dialog -----------------------------------------------------------------------------------------


def dialog(ctx: CaseContext, name: str = "x") -> Any:
    """Stop the PLC, and return an axis that its dialog has enabled."""
    found = ctx.bench.axis(name, controller="nc")
    ctx.do("stop the PLC; enable in the dialog")
    ctx.bench.nc.plc_running = False
    ctx.run_for(CYCLE_S)
    found.online.all()
    ctx.wait_until(lambda: found.online.view().ready, 1.0, f"{name} is ready")
    return found


def velocity(one: Any) -> float:
    """Return the set velocity, mm/s."""
    return float(one.ref.NcToPlc.SetVelo)


@CAMPAIGN.product(
    "dialog/key-{key}",
    parameters=[
        {"key": "F1", "wanted": -400.0, "ids": "NC-232"},
        {"key": "F2", "wanted": -100.0, "ids": "NC-233"},
        {"key": "F3", "wanted": 100.0, "ids": "NC-234"},
        {"key": "F4", "wanted": 400.0, "ids": "NC-235"},
    ],
    title="{key} of the online dialog",
)
def key(ctx: CaseContext, key: str, wanted: float, ids: str) -> None:
    """It moves with its velocity while it is pressed; another key that is released leaves it alone."""
    one = dialog(ctx)
    ctx.do(f"press {key}")
    equal(ctx, "error code of the key", one.online.press(key), 0, ids)
    ctx.run_for(1.6)
    equal(ctx, "set velocity", velocity(one), wanted, ids, within=1e-6)
    view = one.online.view()
    equal(
        ctx, "the view shows the direction", (view.moving_fw, view.moving_bw) == (wanted > 0, wanted < 0), 1
    )
    equal(ctx, "actual velocity of the view", view.actual_velocity, wanted, "NC-223", within=2.0)
    equal(ctx, "setpoint velocity of the view", view.setpoint_velocity, wanted, "NC-223", within=1e-6)
    equal(ctx, "position of the view", view.actual_position, one.position, "NC-218", within=1e-9)
    lag = view.setpoint_position - view.actual_position
    equal(
        ctx, "lag distance of the view", view.lag_distance, lag, "NC-220", within=1.5 * abs(wanted) * CYCLE_S
    )
    equal(ctx, "job bit of the view", view.has_job, 1, "NC-226")
    equal(ctx, "standstill bit of the view", view.not_moving, 0, "NC-226")
    extremes = view.lag_max if wanted > 0 else view.lag_min
    equal(ctx, "the greater extreme has the sign of the motion", extremes * wanted > 0, 1, "NC-221")
    one.online.reset_extremes()
    equal(ctx, "extremes that were reset", one.online.view().lag_max - one.online.view().lag_min, 0.0)
    one.online.release("F6")
    ctx.run_for(0.05)
    equal(ctx, "set velocity behind another key", velocity(one), wanted, ids, within=1e-6)
    one.online.release(key)
    ctx.run_for(1.8)
    equal(ctx, "set velocity of the key that was let go", velocity(one), 0.0, ids, within=1e-9)
    equal(ctx, "standstill bit at the end", one.online.view().not_moving, 1, "NC-226")


@CAMPAIGN.product(
    "dialog/start-{mode}",
    parameters=[
        {"mode": "absolute", "target": 63.0, "end": 63.0},
        {"mode": "relative", "target": -17.5, "end": -17.5},
        {"mode": "modulo", "target": 30.0, "end": 30.0},
    ],
    title="Extended start of the online dialog, {mode}",
    requirements=("NC-240",),
)
def extended_start(ctx: CaseContext, mode: str, target: float, end: float) -> None:
    """The motion takes the time of its ramps and ends where its mode says; Last Time is its duration."""
    one = dialog(ctx)
    begun = ctx.now_s
    dynamics = {"acceleration": 1200.0, "deceleration": 800.0, "jerk": 20_000.0}
    equal(ctx, "error code", one.online.start(mode, target=target, velocity=90.0, **dynamics), 0)
    ctx.run_for(2 * CYCLE_S)
    ctx.wait_until(lambda: not one.online.view().has_job, 5.0, "the motion is over")
    took = ctx.now_s - begun
    wanted = travel_time(abs(end), 90.0, *dynamics.values())
    equal(ctx, "duration, s", took, wanted, "NC-240", within=5 * CYCLE_S)
    equal(ctx, "Last Time, s", one.online.last_time, took, "NC-240", within=0.012)
    equal(ctx, "end", one.ref.NcToPlc.SetPos, end, "NC-240", within=1e-6)


@CAMPAIGN.case("dialog/endless", requirements=("NC-240",))
def endless(ctx: CaseContext) -> None:
    """Endless motions go in their direction until stop; reversing goes to and fro between two targets."""
    one = dialog(ctx)
    for mode, sign in (("endless +", 1.0), ("endless -", -1.0)):
        one.online.start(mode, velocity=50.0, acceleration=3000.0, deceleration=2000.0, jerk=1e6)
        ctx.run_for(0.4)
        equal(ctx, f"set velocity, {mode}", velocity(one), sign * 50.0, "NC-240", within=1e-9)
        one.online.stop()
        ctx.run_for(0.5)
        equal(ctx, f"set velocity after the stop, {mode}", velocity(one), 0.0, "NC-237", within=1e-9)
    low, high = 8.0, 21.0
    one.online.start("reversing", target=high, second_target=low, velocity=120.0)
    ctx.run_for(3.0)
    trace = ctx.trace()
    where, speed = trace["x.set_position"].values, trace["x.set_velocity"].values
    turned = [round(float(where[at]), 4) for at in range(1, len(speed)) if speed[at] == 0.0 != speed[at - 1]]
    equal(
        ctx, "it turns round at its targets in turn", turned[-2:] in ([low, high], [high, low]), 1, "NC-240"
    )
    one.online.stop()
    ctx.run_for(0.6)
    equal(ctx, "set velocity after the stop", velocity(one), 0.0, "NC-237", within=1e-9)


@CAMPAIGN.case("dialog/target", requirements=("NC-236", "NC-238", "NC-242", "NC-243"))
def target(ctx: CaseContext) -> None:
    """F5 goes to the target, which may change on the way; F8 acknowledges; the position may be set."""
    one = dialog(ctx)
    one.online.target_position, one.online.target_velocity = 150.0, 80.0
    equal(ctx, "F5", one.online.press("F5"), 0, "NC-236")
    ctx.run_for(0.5)
    equal(ctx, "set velocity", velocity(one), 80.0, "NC-236", within=1e-6)
    equal(ctx, "a new target", one.online.set_target_position(77.0), 0, "NC-243")
    ctx.wait_until(lambda: not one.online.view().has_job, 5.0, "the motion is over")
    equal(ctx, "end", one.ref.NcToPlc.SetPos, 77.0, "NC-243", within=1e-6)
    equal(ctx, "a target without motion", one.online.set_target_position(5.0), 0x4B04, "NC-243")
    one.online.set_actual_position(10.0)
    ctx.run_for(0.3)
    equal(ctx, "position that was set", one.position, 10.0, "NC-242", within=0.02)
    one.online.set_actual_position(-2.5, relative=True)
    ctx.run_for(0.3)
    equal(ctx, "position that was shifted", one.position, 7.5, "NC-242", within=0.02)
    one.object.raise_error(0x4550)
    ctx.run_for(0.01)
    view = one.online.view()
    equal(ctx, "error of the view", view.error, 0x4550, "NC-228")
    equal(ctx, "ready with an error", view.ready, 0, "NC-225")
    one.online.press("F8")
    ctx.run_for(0.3)
    equal(ctx, "error behind F8", one.error_id, 0, "NC-238")


@CAMPAIGN.case("dialog/raw-output", requirements=("NC-241",))
def raw_output(ctx: CaseContext) -> None:
    """A fixed output without position control: the motor turns with its part of the speed, until stop."""
    one = dialog(ctx)
    for percent in (10.0, -5.0):
        equal(ctx, "error code", one.online.raw_output(percent), 0, "NC-241")
        ctx.run_for(0.3)
        full = one.read_parameter("drv.reference_velocity") / one.read_parameter("drv.output_ratio")
        actual = one.ref.NcToPlc.ActVelo
        equal(
            ctx,
            f"velocity at {percent} %",
            actual,
            full * percent / 100.0,
            "NC-241",
            within=0.02 * full * 0.1,
        )
        equal(ctx, "output of the view", one.online.view().total_output, percent, "NC-224", within=0.1)
    one.online.stop()
    ctx.run_for(0.3)
    equal(ctx, "velocity after the stop", one.ref.NcToPlc.ActVelo, 0.0, "NC-241", within=0.1)


@CAMPAIGN.case("dialog/enabling", requirements=("NC-225", "NC-229", "NC-230", "NC-231"))
def enabling(ctx: CaseContext) -> None:
    """A PLC that runs has priority; a missing feed enable refuses its direction alone; the override acts."""
    one = axis(ctx)
    refused = (
        one.online.press("F3"),
        one.online.start("absolute", target=5.0, velocity=10.0),
        one.online.raw_output(5.0),
        one.online.stop(),
    )
    equal(ctx, "commands refused while the PLC runs", sum(code == 0x4B05 for code in refused), 4, "NC-230")
    ctx.run_for(0.05)
    equal(ctx, "set velocity", velocity(one), 0.0, "NC-230")
    ctx.do("take the link to the PLC away")
    ctx.bench.nc.links["x"].connected = False
    one.online.set_enabling(controller=True, feed_fw=False, feed_bw=True, override=40.0)
    ctx.run_for(0.01)
    view = one.online.view()
    shown = (view.controller, view.feed_fw, view.feed_bw, view.override)
    equal(ctx, "enables and override of the view", shown == (True, False, True, 40.0), 1, "NC-225")
    one.online.press("F3")
    ctx.run_for(0.05)
    equal(ctx, "error of the direction that is not enabled", one.online.error_id, 0x4358, "NC-229")
    one.online.release("F3")
    one.online.press("F2")
    ctx.run_for(0.6)
    equal(ctx, "set velocity with the override", velocity(one), -40.0, "NC-231", within=1e-6)
    one.online.set_enabling(controller=True, feed_fw=True, feed_bw=True, override=100.0)
    ctx.run_for(0.5)
    equal(ctx, "set velocity without it", velocity(one), -100.0, "NC-231", within=1e-6)
    one.online.release("F2")


@CAMPAIGN.case("dialog/couple", requirements=("NC-244",))
def couple(ctx: CaseContext) -> None:
    """Couple, change the factor, decouple: the slave moves by its factor, then keeps its velocity."""
    one, slave = dialog(ctx), dialog(ctx, "v")
    side = slave.online
    equal(ctx, "decouple without coupling", side.decouple(), 0x4B05, "NC-244")
    equal(ctx, "factor without coupling", side.change_factor(2.0), 0x4B05, "NC-244")
    equal(ctx, "couple", side.couple("x"), 0, "NC-244")
    one.online.press("F3")
    ctx.run_for(0.6)
    equal(ctx, "velocity of the slave", velocity(slave), 100.0, "NC-244", within=1e-6)
    equal(ctx, "the view shows it", side.view().coupled, 1, "NC-227")
    equal(ctx, "factor 0", side.change_factor(0.0), 0x4B06, "NC-244")
    equal(ctx, "factor 1.7", side.change_factor(1.7), 0, "NC-244")
    ctx.run_for(0.1)
    equal(ctx, "velocity of the slave", velocity(slave), 170.0, "NC-244", within=1e-6)
    equal(ctx, "decouple", side.decouple(), 0, "NC-244")
    one.online.release("F3")
    ctx.run_for(0.8)
    equal(ctx, "velocity of the master", velocity(one), 0.0, "NC-244")
    equal(ctx, "velocity of the slave alone", velocity(slave), 170.0, "NC-244", within=1e-6)
    side.stop()
    ctx.run_for(0.8)
    equal(ctx, "velocity of the slave after its stop", velocity(slave), 0.0, "NC-244")


@CAMPAIGN.case("dialog/compensate", requirements=("NC-245", "NC-453"))
def compensate(ctx: CaseContext) -> None:
    """A superposed motion adds its way to the one that runs, and its velocity while it lasts."""
    one = dialog(ctx)
    one.online.start("absolute", target=400.0, velocity=100.0)
    ctx.run_for(0.6)
    equal(ctx, "compensate", one.online.compensate(20.0, 50.0), 0, "NC-245")
    ctx.run_for(0.3)
    equal(ctx, "bit 13 while it lasts", one.ref.NcToPlc.StateDWord >> 13 & 1, 1, "NC-453")
    equal(ctx, "set velocity", velocity(one), 150.0, "NC-245", within=1e-6)
    ctx.wait_until(lambda: not one.ref.NcToPlc.StateDWord >> 13 & 1, 2.0, "the superposed motion is over")
    equal(ctx, "set velocity behind it", velocity(one), 100.0, "NC-245", within=0.5)
    ctx.wait_until(lambda: not one.online.view().has_job, 6.0, "the motion is over")
    equal(ctx, "end", one.ref.NcToPlc.SetPos, 420.0, "NC-245", within=1e-6)


@CAMPAIGN.case("dialog/encoder", requirements=tuple(f"NC-{row}" for row in range(291, 297)))
def encoder_view(ctx: CaseContext) -> None:
    """The view of the encoder: increments of the hardware, modulo position and turns, correction."""
    one = axis(ctx)
    until(ctx, one.move_absolute(217.0, Velocity=200.0).done)
    ctx.run_for(0.3)
    view = one.online.encoder()
    scaling = one.read_parameter("enc.scaling_numerator") / one.read_parameter("enc.scaling_denominator")
    equal(ctx, "position by the increments", view.soft_increments[1] * scaling, view.position, within=0.01)
    equal(ctx, "modulo turns", view.modulo_turns, 2, "NC-295")
    equal(ctx, "modulo position", view.modulo_position, view.position - 180.0, "NC-294", within=1e-6)
    equal(ctx, "homed", view.calibrated, 0, "NC-296")
    one.ref.PlcToNc.PositionCorrection = 1.5
    ctx.run_for(0.5)
    view = one.online.encoder()
    equal(ctx, "correction", view.correction, 1.5, "NC-292", within=1e-9)
    equal(ctx, "position with it", view.position - view.uncorrected_position, 1.5, "NC-293", within=1e-6)
    equal(ctx, "position", view.position, 217.0, within=0.02)


# -- groups on a path --------------------------------------------------------------------------------------


def group(ctx: CaseContext, **settings: float) -> tuple[Any, Any, InterpolationGroup]:
    """Return two enabled axes and their group."""
    x, v = axis(ctx, "x"), axis(ctx, "v")
    values = {"acceleration": 1100.0, "deceleration": 700.0, "jerk": 60_000.0, "c2": 1.0, **settings}
    made = InterpolationGroup([x.object, v.object], cycle_s=CYCLE_S, least_velocity=0.0, **values)
    ctx.bench.nc.groups.append(made)
    return x, v, made


def travel(ctx: CaseContext, made: InterpolationGroup) -> list[tuple[float, float, float, float]]:
    """Start a group, and return positions and velocities of both axes in every cycle until it ends."""
    ctx.do("start the group")
    equal(ctx, "error code of the start", made.start(), 0)
    since = ctx.now_s
    ctx.wait_until(lambda: not made.running, 20.0, "the path is over")
    trace = ctx.trace()
    rows = trace["x.set_position"].time_s > since - 1e-9
    columns = ("x.set_position", "v.set_position", "x.set_velocity", "v.set_velocity")
    return list(zip(*(trace[name].values[rows].tolist() for name in columns), strict=True))


@CAMPAIGN.case("group/rapid", requirements=("NC-174", "NC-178", "NC-179"))
def rapid(ctx: CaseContext) -> None:
    """G0 goes straight, with the velocity of the axis that needs most time."""
    _, _, made = group(ctx)
    made.g0(x=40.0, v=30.0)
    path = travel(ctx, made)
    equal(ctx, "greatest path velocity", max(hypot(*one[2:]) for one in path), 150.0, "NC-179", within=1e-3)
    off = max(abs(one[1] - 0.75 * one[0]) for one in path)
    equal(ctx, "distance from the straight line", off, 0.0, "NC-178", within=1e-6)
    equal(ctx, "end of x", path[-1][0], 40.0, "NC-174", within=1e-6)
    equal(ctx, "end of v", path[-1][1], 30.0, "NC-174", within=1e-6)


@CAMPAIGN.product(
    "group/joint-{kind}",
    parameters=[
        {"kind": "exact", "exact": True, "slowest": 0.0},
        {"kind": "through", "exact": False, "slowest": 70.0},
    ],
    title="A straight joint, {kind}",
    requirements=("NC-180", "NC-185"),
)
def joint(ctx: CaseContext, kind: str, *, exact: bool, slowest: float) -> None:
    """G60 stops at a straight joint; without it the smaller velocity is there at the joint, not before."""
    _, _, made = group(ctx)
    if exact:
        made.exact_stop()
    made.g1(140.0, x=60.0)
    made.g1(70.0, x=120.0)
    path = travel(ctx, made)
    near = [one[2] for one in path if abs(one[0] - 60.0) < 0.2]
    equal(ctx, "velocity at the joint", min(near), slowest, "NC-180", within=2.0)
    equal(ctx, "greatest velocity", max(one[2] for one in path), 140.0, "NC-185", within=1e-3)
    equal(ctx, "velocity of the second part", max(one[2] for one in path if one[0] > 61.0), 70.0, within=0.1)
    rates = [(after[2] - before[2]) / CYCLE_S for before, after in pairwise(path)]
    equal(ctx, "greatest acceleration", max(rates), 1100.0, "NC-176", within=12.0)
    equal(ctx, "greatest deceleration", min(rates), -700.0, "NC-176", within=12.0)
    equal(ctx, "end", path[-1][0], 120.0, within=1e-6)


@CAMPAIGN.case("group/corner", requirements=("NC-186", "NC-187"))
def corner(ctx: CaseContext) -> None:
    """At a corner no axis steps by more than its jump factor allows: x has none, so the path stops there."""
    _, _, made = group(ctx)
    made.g1(90.0, x=30.0)
    made.g1(80.0, v=25.0)
    path = travel(ctx, made)
    step = max(abs(after[3] - before[3]) for before, after in pairwise(path))
    ctx.measure(
        "greatest step of v", step, "mm/s", low=0.0, high=1100.0 * CYCLE_S + 1e-6, requirements=("NC-186",)
    )
    equal(ctx, "no axis moves with the other", max(min(one[2], one[3]) for one in path), 0.0, within=1e-6)
    equal(ctx, "end of x", path[-1][0], 30.0, within=1e-6)
    equal(ctx, "end of v", path[-1][1], 25.0, within=1e-6)


@CAMPAIGN.case("group/ball", requirements=("NC-188", "NC-189", "NC-190", "NC-191"))
def ball(ctx: CaseContext) -> None:
    """Within the tolerance ball the path is smooth, leaves the corner by less than the radius, keeps its
    velocity, and takes no new override.
    """
    _, _, made = group(ctx)
    made.tolerance_ball(6.0)
    made.g1(50.0, x=40.0)
    made.g1(50.0, v=45.0)
    path = travel(ctx, made)
    nearest = min(hypot(one[0] - 40.0, one[1]) for one in path)
    ctx.measure("least distance from the corner", nearest, "mm", low=0.1, high=6.0, requirements=("NC-189",))
    inside = [hypot(*one[2:]) for one in path if 0.01 < 40.0 - one[0] < 5.4 and 0.01 < one[1] < 5.4]
    spread = max(inside) - min(inside) if inside else 1e9
    equal(ctx, "change of the velocity within the ball", spread, 0.0, "NC-190", within=1e-3)
    outside = max(min(abs(one[1]), abs(40.0 - one[0])) for one in path)
    ctx.measure("greatest distance from both lines", outside, "mm", high=6.0, requirements=("NC-189",))
    steps = max(hypot(b[2] - a[2], b[3] - a[3]) for a, b in pairwise(path))
    ctx.measure(
        "greatest change in a cycle", steps, "mm/s", high=1.6 * 1100.0 * CYCLE_S, requirements=("NC-188",)
    )
    equal(ctx, "end of v", path[-1][1], 45.0, within=1e-6)


@CAMPAIGN.case("group/arc", requirements=("NC-181", "NC-182"))
def arc(ctx: CaseContext) -> None:
    """A line and a tangent arc: the path keeps its distance from the centre, and its velocity."""
    x, v, made = group(ctx)
    made.g1(60.0, x=20.0)
    made.arc(60.0, (20.0, 15.0), clockwise=False, x=20.0, v=30.0)
    path = travel(ctx, made)
    off = max(abs(hypot(one[0] - 20.0, one[1] - 15.0) - 15.0) for one in path if one[1] > 0.01)
    equal(ctx, "distance from the circle", off, 0.0, "NC-181", within=1e-3)
    ctx.measure("farthest of x", max(one[0] for one in path), "mm", low=34.98, high=35.01)
    length = sum(hypot(b[0] - a[0], b[1] - a[1]) for a, b in pairwise(path))
    equal(ctx, "length of the path", length, 20.0 + 15.0 * pi, within=0.05)
    fast = [hypot(*one[2:]) for one in path if 3.0 < one[1] < 24.0]
    equal(ctx, "velocity on the arc", min(fast), 60.0, "NC-182", within=0.5)
    equal(ctx, "greatest velocity", max(fast), 60.0, within=0.5)
    ctx.run_for(0.4)
    equal(ctx, "x is there", x.position, 20.0, within=0.02)
    equal(ctx, "v is there", v.position, 30.0, within=0.02)


@CAMPAIGN.product(
    "group/override-{percent}",
    parameters={"percent": (30, 60, 100, 150)},
    title="Path override {percent} %",
    requirements=("NC-170", "NC-172"),
)
def override(ctx: CaseContext, percent: int) -> None:
    """The override scales the velocity of the path; above 100 % it has no effect in its usual type."""
    _, _, made = group(ctx)
    made.override = percent / 100.0
    made.g1(110.0, x=60.0, v=20.0)
    path = travel(ctx, made)
    wanted = 110.0 * min(percent, 100) / 100.0
    equal(ctx, "greatest path velocity", max(hypot(*one[2:]) for one in path), wanted, "NC-170", within=0.5)
    equal(ctx, "end of x", path[-1][0], 60.0, within=1e-6)


@CAMPAIGN.case("group/stop", requirements=("NC-035",))
def group_stop(ctx: CaseContext) -> None:
    """A stop of one axis brakes the group on its path; commands to its axes are refused until then."""
    x, v, made = group(ctx)
    made.g1(100.0, x=300.0, v=150.0)
    equal(ctx, "error code of the start", made.start(), 0)
    ctx.run_for(0.6)
    equal(ctx, "PTP mode in a group", x.ref.NcToPlc.StateDWord >> 25 & 1, 0, "NC-035")
    refused = v.move_absolute(5.0, Velocity=10.0)
    ctx.run_for(0.01)
    equal(ctx, "ErrorID of a command to an axis of the group", refused.ErrorID, 0x4B05, "NC-035")
    since = ctx.now_s
    stop = v.stop(Deceleration=500.0, Jerk=20_000.0)
    took = until(ctx, lambda: not made.running, "the group stands")
    ctx.measure("time of the stop", took, "s", low=100.0 / 700.0, high=100.0 / 700.0 + 0.03)
    equal(ctx, "Done of the stop", stop.Done, 1)
    trace = ctx.trace()
    rows = trace["x.set_position"].time_s > since
    off = abs(trace["v.set_position"].values[rows] - 0.5 * trace["x.set_position"].values[rows]).max()
    equal(ctx, "distance from the path", float(off), 0.0, "NC-035", within=1e-3)
    ctx.run_for(0.01)
    equal(ctx, "PTP mode behind it", x.ref.NcToPlc.StateDWord >> 25 & 1, 1, "NC-035")
    stop.set(Execute=False)
    ctx.run_for(0.1)
    again = x.move_absolute(0.0, Velocity=150.0)
    ctx.run_for(0.02)
    equal(ctx, "ErrorID of a command behind the stop", again.ErrorID, 0, "NC-035")
    until(ctx, again.done)


@CAMPAIGN.product(
    "group/ended-by-{cause}", parameters={"cause": ("error", "enable")}, title="{cause} in a group"
)
def group_error(ctx: CaseContext, cause: str) -> None:
    """An error of one axis, or its lost enable, stops the other one with 16#43A0."""
    x, v, made = group(ctx)
    made.g1(100.0, x=300.0, v=150.0)
    made.start()
    ctx.run_for(0.4)
    if cause == "error":
        x.object.raise_error(0x4464)
    else:
        x.power(False)
    ctx.run_for(0.01)
    equal(ctx, "error of x", x.error_id, 0x4464 if cause == "error" else 0x4356)
    equal(ctx, "error of v", v.error_id, 0x43A0, "NC-197")
    equal(ctx, "the group stands", made.running, 0)


# -- corrections -------------------------------------------------------------------------------------------


@CAMPAIGN.product(
    "backlash/{edge}-{way}",
    parameters=[
        {"edge": edge, "way": way, "wanted": wanted}
        for edge, way, wanted in (
            ("left", "forward", 0.0),
            ("left", "backward", 0.4),
            ("right", "forward", -0.4),
            ("right", "backward", 0.0),
        )
    ],
    title="Backlash compensation, {edge} edge, {way}",
    requirements=("NC-599", "NC-600", "NC-601", "NC-602"),
)
def backlash(ctx: CaseContext, edge: str, way: str, wanted: float) -> None:
    """The left edge is corrected in negative motion by the backlash, the right one in positive motion by
    less than nothing; the axis is at its target, the machine off it by the correction.
    """
    one = axis(ctx)
    block = one.compensate_backlash(0.4, CompensationInPositiveDirection=edge == "right")
    until(ctx, one.move_absolute(30.0, Velocity=100.0).done)
    if way == "backward":
        until(ctx, one.move_absolute(12.0, Velocity=100.0).done)
    ctx.run_for(0.6)
    place = 30.0 if way == "forward" else 12.0
    equal(ctx, "Enabled", block.Enabled, 1, "NC-599")
    equal(ctx, "correction", one.ref.PlcToNc.PositionCorrection, wanted, "NC-600", within=1e-6)
    equal(ctx, "position", one.position, place, within=0.02)
    machine = float(ctx.trace()["motor.position"].values[-1]) * 1000.0
    equal(ctx, "machine, mm", machine, place - wanted, "NC-601", within=0.05)


def corrected(ctx: CaseContext, one: Any, seconds: float) -> list[float]:
    """Return the correction in every cycle from now on."""
    seen = [float(one.ref.PlcToNc.PositionCorrection)]
    end = ctx.bench.on_cycle(lambda: seen.append(float(one.ref.PlcToNc.PositionCorrection)))
    ctx.run_for(seconds)
    end()
    return seen


@CAMPAIGN.case("correction/fast", requirements=("NC-206", "NC-207", "NC-208"))
def correction(ctx: CaseContext) -> None:
    """The limiter goes to its value with its acceleration; the machine moves by the negative of it."""
    one = axis(ctx)
    before = float(ctx.trace()["motor.position"].values[-1]) * 1000.0
    mode = CorrectionMode.POSITIONCORRECTION_MODE_FAST
    block = one.correct_position(1.2, CorrectionMode=mode, Acceleration=100.0)
    ctx.run_for(0.02)
    equal(ctx, "Limiting on the way", block.Limiting, 1, "NC-208")
    seen = corrected(ctx, one, 0.6)
    speeds = [(b - a) / CYCLE_S for a, b in pairwise(seen)]
    rate = max(abs(b - a) / CYCLE_S for a, b in pairwise(speeds))
    ctx.measure("greatest acceleration", rate, "mm/s2", low=95.0, high=115.0, requirements=("NC-208",))
    ctx.measure("greatest velocity", max(speeds), "mm/s", low=9.5, high=11.5, requirements=("NC-208",))
    equal(ctx, "value", seen[-1], 1.2, "NC-208", within=1e-9)
    equal(ctx, "Limiting at the end", block.Limiting, 0, "NC-208")
    equal(ctx, "error of the block", block.ErrorID, 0)
    ctx.run_for(0.3)
    after = float(ctx.trace()["motor.position"].values[-1]) * 1000.0
    equal(ctx, "way of the machine, mm", after - before, -1.2, "NC-207", within=0.03)
    equal(ctx, "position", one.position, 0.0, "NC-206", within=0.02)
    without = one.ref.NcToPlc.ActPosWithoutPosCorrection
    equal(ctx, "position without the correction", without, -1.2, "NC-206", within=0.02)


@CAMPAIGN.case("correction/length", requirements=("NC-208",))
def correction_length(ctx: CaseContext) -> None:
    """Over a length the correction grows with the way of the axis, in either direction, and then stands."""
    one = axis(ctx)
    mode = CorrectionMode.POSITIONCORRECTION_MODE_FULLLENGTH
    one.correct_position(0.8, CorrectionMode=mode, CorrectionLength=40.0)
    ctx.run_for(0.05)
    equal(ctx, "correction at rest", one.ref.PlcToNc.PositionCorrection, 0.0, "NC-208", within=1e-9)
    until(ctx, one.move_absolute(-10.0, Velocity=60.0).done)
    equal(ctx, "after a quarter", one.ref.PlcToNc.PositionCorrection, 0.2, "NC-208", within=0.01)
    until(ctx, one.move_absolute(60.0, Velocity=60.0).done)
    equal(ctx, "after the whole", one.ref.PlcToNc.PositionCorrection, 0.8, "NC-208", within=1e-6)
    for wrong in ({"CorrectionMode": mode, "CorrectionLength": 0.0}, {"CorrectionMode": 9}):
        refused = one.correct_position(0.1, **wrong)
        ctx.run_for(0.01)
        equal(ctx, f"ErrorID with {wrong}", refused.ErrorID, 0x4B06)
        refused.set(Enable=False)


@CAMPAIGN.product(
    "superposed/{way}",
    parameters={"way": (15.0, -9.0)},
    title="MC_MoveSuperImposed over {way} mm",
    requirements=("NC-032", "NC-453"),
)
def superposed(ctx: CaseContext, way: float) -> None:
    """It adds its way to that of the motion below, and is done when its way is over."""
    one = axis(ctx)
    below = one.move_absolute(160.0, Velocity=70.0)
    ctx.run_for(0.5)
    job = one.move_superimposed(way, 40.0)
    took = until(ctx, job.done, "the superposed motion is done")
    ctx.measure("duration", took, "s", low=abs(way) / 40.0, high=abs(way) / 40.0 + 0.5)
    equal(ctx, "the motion below runs on", below.Busy, 1, "NC-032")
    equal(ctx, "it was not aborted", below.CommandAborted, 0)
    until(ctx, below.done)
    equal(ctx, "end", one.ref.NcToPlc.SetPos, 160.0 + way, "NC-032", within=1e-6)
    for inputs in ((0.0, 40.0), (5.0, 0.0)):
        refused = one.move_superimposed(*inputs)
        ctx.run_for(0.01)
        equal(ctx, f"refused with {inputs}", bool(refused.Error or refused.Done), 1)


# -- probe and parameter blocks ----------------------------------------------------------------------------


@CAMPAIGN.product(
    "probe/{edge}-{way}",
    parameters=[
        {"edge": "positive", "way": "forward", "place": 31.0},
        {"edge": "negative", "way": "forward", "place": 47.0},
        {"edge": "positive", "way": "backward", "place": 47.0},
        {"edge": "negative", "way": "backward", "place": 31.0},
    ],
    title="MC_TouchProbe, {edge} edge, {way}",
    requirements=("NC-409",),
)
def probe(ctx: CaseContext, edge: str, way: str, place: float) -> None:
    """It records the place of its edge, and not that of the other one."""
    one = axis(ctx)
    if way == "backward":
        until(ctx, one.move_absolute(60.0, Velocity=150.0).done)
    source = ProbeSource.LATCH_POSITIVE if edge == "positive" else ProbeSource.LATCH_NEGATIVE
    block = one.touch_probe(source)
    ctx.run_for(0.05)
    equal(ctx, "Busy before the edge", block.Busy, 1)
    until(ctx, one.move_absolute(60.0 if way == "forward" else 5.0, Velocity=80.0).done)
    equal(ctx, "Done", block.Done, 1, "NC-409")
    equal(ctx, "recorded position", block.RecordedPosition, place, "NC-409", within=0.05)
    again = one.touch_probe(source)
    ctx.run_for(0.05)
    equal(ctx, "Busy, not Done, before the next edge", again.Busy - again.Done, 1, "NC-409")


@CAMPAIGN.case("parameters", requirements=("NC-204",))
def parameters(ctx: CaseContext) -> None:
    """Reading and writing parameters by blocks: values, wrong numbers, limits; a set is that of the axis."""
    one = axis(ctx)
    program = one.run
    limit = program(MC_WriteParameter(one.ref, ParameterNumber=AxisParameter.MaxVelocityAppl, Value=333.0))
    limit.set(Execute=True)
    ctx.run_for(0.05)
    equal(ctx, "Done of the writing block", limit.Done, 1)
    read = program(MC_ReadParameter(one.ref, ParameterNumber=AxisParameter.MaxVelocityAppl, Enable=True))
    switch = program(
        MC_WriteBoolParameter(one.ref, ParameterNumber=AxisParameter.EnableLimitPos, Value=True, Execute=True)
    )
    ctx.run_for(0.05)
    equal(ctx, "value that was written", read.Value, 333.0)
    equal(ctx, "Valid", read.Valid, 1)
    equal(ctx, "parameter of the axis", one.read_parameter("axis.maximum_velocity"), 333.0)
    equal(ctx, "Done of the switch", switch.Done, 1)
    on = program(MC_ReadBoolParameter(one.ref, ParameterNumber=AxisParameter.EnableLimitPos, Enable=True))
    wrong = program(MC_ReadParameter(one.ref, ParameterNumber=9999, Enable=True))
    bad = program(
        MC_WriteParameter(one.ref, ParameterNumber=AxisParameter.MaxVelocityAppl, Value=-1.0, Execute=True)
    )
    ctx.run_for(0.05)
    equal(ctx, "the switch is on", on.Value, 1)
    equal(ctx, "a number that is none", wrong.Error and not wrong.Valid, 1)
    equal(ctx, "a value that is refused", bad.Error and not bad.Done, 1)
    equal(ctx, "what it leaves", one.read_parameter("axis.maximum_velocity"), 333.0)
    whole = program(MC_ReadParameterSet(one.ref, Enable=True))
    ctx.run_for(0.05)
    equal(ctx, "the set is valid", whole.Valid, 1)


@CAMPAIGN.case("status-blocks", requirements=("NC-008",))
def status_blocks(ctx: CaseContext) -> None:
    """The reading blocks show position, velocity, error and state of the axis, each in its situation."""
    one = axis(ctx)
    status = one.run(MC_ReadStatus(one.ref, Enable=True))
    place = one.run(MC_ReadActualPosition(one.ref, Enable=True))
    speed = one.run(MC_ReadActualVelocity(one.ref, Enable=True))
    error = one.run(MC_ReadAxisError(one.ref, Enable=True))
    ctx.run_for(0.05)

    def shown(what: str, wanted: set[str]) -> None:
        names = ("ErrorStop", "Disabled", "Stopping", "StandStill", "DiscreteMotion", "ContinuousMotion")
        found = {name for name in names if getattr(status, name)}
        equal(ctx, f"state shown {what} ({', '.join(sorted(found))})", found == wanted, 1)
        equal(ctx, "position of the block", place.Position, one.position, within=1.0)
        equal(ctx, "velocity of the block", speed.ActualVelocity, one.ref.NcToPlc.ActVelo, within=5.0)

    shown("at rest", {"StandStill"})
    move = one.move_absolute(120.0, Velocity=100.0)
    ctx.run_for(0.5)
    shown("while positioning", {"DiscreteMotion"})
    equal(ctx, "ConstantVelocity", status.ConstantVelocity, 1)
    until(ctx, move.done)
    one.move_velocity(-50.0)
    ctx.run_for(0.4)
    shown("in endless motion", {"ContinuousMotion"})
    stop = one.stop()
    ctx.run_for(0.02)
    shown("while stopping", {"Stopping"})
    until(ctx, stop.done)
    stop.set(Execute=False)
    ctx.run_for(0.05)
    one.object.raise_error(0x4550)
    ctx.run_for(0.05)
    shown("with an error", {"ErrorStop"})
    equal(ctx, "AxisErrorID", error.AxisErrorID, 0x4550)
    one.reset()
    ctx.run_for(0.5)
    equal(ctx, "AxisErrorID behind the reset", error.AxisErrorID, 0)
    one.power(False)
    ctx.run_for(0.1)
    shown("without enable", {"Disabled"})
