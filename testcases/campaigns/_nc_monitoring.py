"""What the cases of `monitoring` are on axes of an NC: position lag, target window, in-target alarm."""

from __future__ import annotations

from typing import Any, Final

from hil.campaign import CaseContext, Counterpart, NotApplicable
from hil.expect import axis_error, no_axis_error, stays_within, value_at
from testcases.campaigns._loop import increments
from testcases.campaigns._nc import (
    APPLIED,
    LAG,
    NOT_READY,
    SIGN,
    TARGET,
    Fault,
    Reaction,
    Table,
    at_rest,
    axis_name,
    axis_of,
    bring_into,
    code_at,
    enable,
    fault_case,
    goes_on,
    moves_again,
    need_cycle_of,
    need_encoder,
    profile,
    reset,
)
from testcases.campaigns._reactions import cycles
from testcases.campaigns.support import drive_name, settle_s

FILTER_S: Final = 0.02
"""Default of `axis.position_lag_filter_time`, s."""


def _permitted(ctx: CaseContext) -> float:
    return float(axis_of(ctx).read_parameter("axis.position_lag_max"))


def grows_case(ctx: CaseContext, kind: str, velocity: float) -> None:
    """The position lag grows with the velocity of the setpoint: 0x4550 when it has been above its maximum for
    longer than the filter time, and not before.
    """
    name = axis_name(ctx)
    need_encoder(ctx)
    enable(ctx)
    sign = 1 if velocity > 0 else -1
    running = bring_into(ctx, "constant", direction=sign, velocity=abs(velocity))
    if kind == "encoder.freeze":
        # A blind drive runs away: the NC has to see it before the drive itself does.
        axis_of(ctx).write_parameter("axis.position_lag_max", 2.0)
    options: dict[str, Any] = {"duration_s": 1.0} if kind == "encoder.freeze" else {}
    fault = ctx.inject(kind, drive_name(ctx), **options)
    used_up = _permitted(ctx) / abs(velocity)
    early = ctx.now_s + used_up + FILTER_S - cycles(ctx, 2)
    ctx.run_for(used_up + 1.0 + settle_s(ctx))
    ended = ctx.now_s
    ctx.expect(
        axis_error(LAG, since=APPLIED, within_s=used_up + FILTER_S + cycles(ctx, 5), axis=name).covers(
            "NC-136", "NC-148"
        ),
        no_axis_error(until=early, axis=name).covers("NC-136"),
        value_at(f"{name}.set_velocity", ended, 0.0, tolerance=0.0),
    )
    code_at(ctx, ended, LAG)
    ctx.measure("ErrorID of the running block", float(running.ErrorID), low=LAG, high=LAG)
    if kind != "encoder.freeze":
        at_rest(ctx, ended)
        fault.remove()
        ctx.run_for(0.1)
        reset(ctx)
        moves_again(ctx)


def jump_case(ctx: CaseContext, share: int) -> None:
    """A jump within the maximum is worked off; one beyond it is an error where the loop does not work it off
    within the filter time.
    """
    axis, name = axis_of(ctx), axis_name(ctx)
    enable(ctx)
    if abs(share) > 100:
        axis.write_parameter("axis.position_lag_filter_time", 0.0)
    ctx.run_for(0.05)
    ctx.inject("encoder.jump", drive_name(ctx), increments=increments(ctx, _permitted(ctx) * share / 100.0))
    ctx.run_for(1.0)
    if abs(share) > 100:
        ctx.expect(axis_error(LAG, since=APPLIED, within_s=cycles(ctx, 4), axis=name))
        code_at(ctx, ctx.now_s, LAG)
        return
    ctx.expect(
        no_axis_error(axis=name),
        value_at(f"{name}.following_error", ctx.now_s, 0.0, tolerance=0.02),
    )


def unwatched_case(ctx: CaseContext) -> None:
    """Switched off, nothing is compared: a jam of 12 mm passes, and the axis goes on."""
    need_encoder(ctx)
    axis = axis_of(ctx)
    axis.write_parameter("axis.position_lag_monitoring", False)
    enable(ctx)
    bring_into(ctx, "constant", velocity=60.0)
    ctx.inject("mechanics.jam", drive_name(ctx), duration_s=0.2)
    ctx.run_for(0.8)
    largest = float(abs(ctx.trace()[f"{axis_name(ctx)}.following_error"].values).max())
    ctx.measure("largest position lag", largest, "mm", low=10.5, high=14.0, requirements=("NC-134",))
    goes_on(ctx, ctx.now_s, moving=True, velocity=60.0, covers=("NC-134",))


def arrives_case(ctx: CaseContext, kind: str, options: dict[str, Any], way: float) -> None:
    """What the encoder on the motor does not see is no error: the axis arrives, and the load is elsewhere."""
    axis, name, drive = axis_of(ctx), axis_name(ctx), drive_name(ctx)
    enable(ctx)
    origin = float(ctx.trace()[f"{drive}.position"].values[-1])
    ctx.inject(kind, drive, **options)
    move = axis.move_relative(40.0, Velocity=200.0)
    ctx.wait_until(move.done, 3.0, "the axis believes that it has arrived")
    ctx.run_for(0.1)
    ctx.expect(no_axis_error(axis=name))
    reached = (float(ctx.trace()[f"{drive}.position"].values[-1]) - origin) * 1000.0
    ctx.measure("way of the load", reached, "mm", low=way - 0.2, high=way + 0.2)


def reversed_case(ctx: CaseContext, state: str) -> None:
    """An axis whose encoder counts the wrong way runs away until its position lag shuts it down, or a drive
    that watches the speed of its motor.
    """
    need_cycle_of(ctx, 0.008, "it shows too little of an axis that runs away")
    axis, drive = axis_of(ctx), drive_name(ctx)
    axis.write_parameter("ctrl.output_limit", 0.1)
    enable(ctx)
    bring_into(ctx, "standstill" if state == "standstill" else "constant", velocity=50.0)
    before = ctx.now_s
    ctx.inject("encoder.reverse", drive, duration_s=0.4)
    if state == "standstill":
        ctx.do("MC_MoveRelative 5 mm")
        axis.move_relative(5.0, Velocity=100.0)
    ctx.run_for(1.5)
    name = axis_name(ctx)
    # The share of the controller is limited; that of the commanded velocity comes on top.
    most = 0.1 + 100.0 / float(axis.read_parameter("axis.reference_velocity")) + 1e-6
    by_drive = profile(ctx) == "profidrive"  # F07901, motor overspeed
    shut = axis_error(NOT_READY if by_drive else LAG, since=APPLIED, within_s=0.35, axis=name)
    ctx.expect(
        shut if by_drive else shut.covers("NC-031", "NC-768"),
        stays_within(f"{name}.output", low=-most, high=most, since=before).covers("NC-031", "NC-768"),
    )


def too_late_case(ctx: CaseContext, timeout_s: float) -> None:
    """Held off its target the axis goes into error when the In-Target Timeout is over (NC-771)."""
    need_encoder(ctx)
    axis, name, drive = axis_of(ctx), axis_name(ctx), drive_name(ctx)
    axis.write_parameter("axis.in_target_timeout", timeout_s)
    axis.write_parameter("axis.position_lag_monitoring", False)
    enable(ctx)
    move = axis.move_relative(40.0, Velocity=100.0)
    ctx.wait_until(lambda: axis.object.motion.s > 39.0, 3.0, "the axis is near its target")
    ctx.inject("mechanics.jam", drive)
    ctx.wait_until(lambda: axis.object.motion.arrived, 3.0, "the set position has arrived")
    arrived = ctx.now_s
    ctx.run_for(timeout_s + 0.5)
    ctx.expect(
        axis_error(TARGET, since=arrived, within_s=timeout_s + cycles(ctx, 2), axis=name).covers(
            "NC-143", "NC-159", "NC-771"
        ),
        no_axis_error(until=arrived + max(timeout_s - cycles(ctx, 2), 0.0), axis=name).covers("NC-143"),
    )
    code_at(ctx, ctx.now_s, TARGET)
    ctx.measure("ErrorID of the block", float(move.ErrorID), low=TARGET, high=TARGET)


def displaced_case(ctx: CaseContext, share: int) -> None:
    """Behind Done the target window is no longer watched with a timeout; the position lag is, always."""
    need_cycle_of(ctx, 0.008, "with more dead time the loop answers a jump with an oscillation")
    axis, name = axis_of(ctx), axis_name(ctx)
    axis.write_parameter("axis.position_lag_filter_time", 0.0)
    enable(ctx)
    move = axis.move_relative(20.0, Velocity=100.0)
    ctx.wait_until(move.done, 3.0, "the axis has arrived")
    ctx.run_for(0.1)
    ctx.inject("encoder.jump", drive_name(ctx), increments=increments(ctx, _permitted(ctx) * share / 100.0))
    ctx.run_for(1.5)
    if share > 100:
        ctx.expect(axis_error(LAG, since=APPLIED, within_s=cycles(ctx, 4), axis=name))
    else:
        ctx.expect(no_axis_error(axis=name))


NO_WARNING: Final = NotApplicable(
    "an NC axis has one maximum of the position lag, whatever its velocity, and no warning"
)
NO_STANDSTILL: Final = NotApplicable(
    "NotMoving of an NC axis follows its commands; there is no standstill signal"
)
WINDOW: Final = NotApplicable(
    "a technology object has a tolerance time and a dwell time of its own; the NC has one timeout: too-late"
)
UNSEEN: Final = {
    "scale": ("encoder.scale", {"factor": 0.95}, 40.0 / 0.95),
    "slip": ("mechanics.slip", {"revolutions": -0.3}, 37.0),
    "coupling": ("mechanics.coupling_break", {"motor_share": 0.5}, 0.0),
}


def _grows(kind: str) -> Any:
    return lambda velocity: Counterpart(
        grows_case, {"kind": kind, "velocity": velocity}, ("NC-136", "NC-148")
    )


def _fault(fault: Fault, phase: str) -> Counterpart:
    return Counterpart(fault_case, {"fault": fault, "phase": phase}, fault.reaction.requirements)


def _of_the_drive(state: str) -> Counterpart:
    fault = Fault("drive.fault", Reaction(NOT_READY, ()), {"code": 0x8611}, watched_s=2.0)
    return _fault(fault, "constant" if state == "travel" else "standstill")


def _load(side: str) -> Counterpart:
    options = {"force_N": 400.0 * SIGN[side]}
    return _fault(
        Fault("mechanics.load_step", Reaction(0), options, lasts_s=0.3, watched_s=0.7, velocity=100.0),
        "constant",
    )


def _late(cycles: int) -> Counterpart:
    options = {"direction": "actual", "cycles": cycles}
    return _fault(Fault("telegram.late", Reaction(0), options, lasts_s=0.3, watched_s=0.8), "constant")


MONITORING: Final = Table(
    {
        "jam/*": _grows("mechanics.jam"),
        "frozen/*": _grows("encoder.freeze"),
        "jump/*": lambda share: Counterpart(jump_case, {"share": share}),
        "unwatched/switched-off": lambda what: Counterpart(unwatched_case, {}, ("NC-134",)),
        "unwatched/*": NotApplicable("an NC axis has no motion without position control"),
        "reversed/*": lambda state: Counterpart(reversed_case, {"state": state}, ("NC-031", "NC-768")),
        "blind/*": lambda every: Counterpart(
            arrives_case,
            {"kind": "encoder.step_loss", "options": {"every": every}, "way": 40.0 * every / (every - 1)},
        ),
        "unseen/*": lambda fault: Counterpart(
            arrives_case, dict(zip(("kind", "options", "way"), UNSEEN[fault], strict=True))
        ),
        "drive-fault/*": _of_the_drive,
        "late/*": _late,
        "load/*": _load,
        "too-late/0": NotApplicable("an In-Target Timeout of 0 leaves the loop no cycle to arrive in"),
        "too-late/*": lambda tolerance_ms: Counterpart(
            too_late_case, {"timeout_s": tolerance_ms * 1e-3}, ("NC-143", "NC-159", "NC-771")
        ),
        "displaced-after-done/*": lambda share: Counterpart(displaced_case, {"share": share}),
        "share/*": NO_WARNING,
        "warning-level/*": NO_WARNING,
        "braking/*": NO_WARNING,
        "gain/*": NO_WARNING,
        "changed/*": NO_WARNING,
        "filter/*": NotApplicable("an NC axis has no filter of its setpoints"),
        "fixed-stop/*": NotApplicable("an NC axis is not moved to a fixed stop"),
        "standstill/*": NO_STANDSTILL,
        "hysteresis/*": NO_STANDSTILL,
        "disturbed/*": NO_STANDSTILL,
        "recovery/*": NO_STANDSTILL,
        "simulated": NotApplicable("the simulation of an NC axis is no drive of a bench"),
        "*": WINDOW,
    }
)
