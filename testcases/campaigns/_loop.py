"""What the cases of `monitoring` and `control` share: configuration, constant travel, instants and signals of
the run.

Expectations are calculated from the configuration, or from the recorded setpoints and actual values; the axis
is never asked what it thinks of them.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, Final

import numpy as np

from hil.campaign import CaseContext
from hil.expect import alarm, no_alarm, state_at, status_word_bit
from hil.record import event
from testcases.campaigns._profiles import encoder_increments_per_revolution
from testcases.campaigns._reactions import disabled_by_alarm
from testcases.campaigns.support import axis_name, drive_name, enable

APPLIED: Final = event("fault.applied")
WIDE: Final = {"FollowingError.MinValue": 1000.0, "FollowingError.MaxValue": 1000.0}
"""No following error is too large."""
UNHURRIED: Final = {"PositioningMonitoring.ToleranceTime": 60.0}
"""No axis settles too late."""
SIGN: Final = {"positive": 1, "negative": -1}
ACCELERATION: Final = 2000.0


def configure(ctx: CaseContext, start: Mapping[str, Any] | None = None, **now: Any) -> None:
    """Set variables that need a restart, and by `Group__Name` those that act at once."""
    axis = ctx.axis
    if start:
        for path, value in start.items():
            axis.variables.write_start(path, value)
        ctx.do("MC_Reset Restart = TRUE: the configuration takes effect")
        ctx.wait_until(axis.reset(restart=True).done, 5.0, "the axis is restarted")
    for name, value in now.items():
        axis.write(name.replace("__", "."), value)


def write(ctx: CaseContext, values: Mapping[str, Any]) -> None:
    """Assign variables that act at once."""
    for path, value in values.items():
        ctx.axis.write(path, value)


def position_control_in(ctx: CaseContext, where: str) -> dict[str, Any]:
    """Return the start values for position control in the `controller` or in the `drive`.

    Raises:
        BlockedError: The drive has no dynamic servo control.

    """
    if where == "controller":
        return {}
    section = ctx.bench.config.drive[drive_name(ctx)]
    ctx.require(
        section.profile == "profidrive" and section.telegram in (5, 6, 105, 106),
        "a drive with dynamic servo control (telegram 5, 6, 105 or 106)",
    )
    return {"PositionControl.EnableDSC": True}


def travel(ctx: CaseContext, velocity: float, **inputs: Any) -> Any:
    """Bring the enabled axis to constant velocity, mm/s; returns the running job, None for 0."""
    if velocity == 0.0:
        ctx.run_for(0.05)
        return None
    ctx.do(f"MC_MoveVelocity {velocity:g} mm/s")
    job = ctx.axis.move_velocity(velocity, **{"Acceleration": ACCELERATION, "Jerk": 0.0, **inputs})
    ctx.wait_until(job.in_velocity, 5.0, "constant travel is reached")
    ctx.run_for(0.06)
    return job


def cycle_s(ctx: CaseContext) -> float:
    """Return the application cycle, s."""
    return float(ctx.bench.cycle_ns) * 1e-9


def permitted(ctx: CaseContext, velocity: float) -> float:
    """Return what the formula of the specification permits at a velocity setpoint with the values in force,
    mm (MON-038).
    """
    read = ctx.axis.var
    least, most, low = (
        float(read(f"FollowingError.{one}")) for one in ("MinValue", "MaxValue", "MinVelocity")
    )
    top = float(read("DynamicLimits.MaxVelocity"))
    return float(np.interp(abs(velocity), (low, top), (least, most)))


def increments(ctx: CaseContext, distance: float) -> int:
    """Return a way of the load as steps of the fault kinds of the encoder."""
    mechanics = ctx.bench.config.drive[drive_name(ctx)].mechanics
    per_turn = mechanics.lead_screw_mm * mechanics.gear_denominator / mechanics.gear_numerator
    return round(distance / per_turn * encoder_increments_per_revolution(ctx))


class Run:
    """The signals of the axis from an instant on, one value per cycle."""

    def __init__(self, ctx: CaseContext, since: float = 0.0) -> None:
        self._trace = ctx.trace()
        self._axis, self._drive = axis_name(ctx), drive_name(ctx)
        self._since = since
        self.time = self._of(f"{self._axis}.position_setpoint", times=True)

    def _of(self, name: str, *, times: bool = False) -> Any:
        signal = self._trace[name]
        at = np.array(signal.time_s)
        return (at if times else np.array(signal.values))[at >= self._since - 1e-9]

    def __getattr__(self, name: str) -> Any:
        return self._of(f"{self._axis}.{name}")

    def drive(self, name: str) -> tuple[Any, Any]:
        """Return times and values of a signal of the drive."""
        signal = f"{self._drive}.{name}"
        return self._of(signal, times=True), self._of(signal)

    def first(self, condition: Any) -> float | None:
        """Return the first time at which a condition over the rows holds, None without."""
        found = np.flatnonzero(condition)
        return float(self.time[found[0]]) if len(found) else None

    def instant(self, selector: Any) -> float | None:
        """Return the time of an event, None without."""
        return self._trace.instant(selector)


def bit(word: Any, number: int) -> Any:
    """Return where a bit of a recorded word is set."""
    return word.astype(int) >> number & 1 == 1


def alarm_after(
    ctx: CaseContext,
    number: int,
    expected_s: float,
    *,
    since: Any = APPLIED,
    reaction: int = 4,
    early_s: float = 0.0,
    late_s: float | None = None,
    requirements: tuple[str, ...] = (),
) -> None:
    """Expect an alarm `expected_s` after an instant: at most `early_s` before, at most two cycles and
    `late_s` behind.
    """
    axis = axis_name(ctx)
    margin = 2.0 * cycle_s(ctx) + (0.0 if late_s is None else late_s)
    ctx.expect(
        alarm(number, reaction=reaction, since=since, within_s=expected_s + margin, axis=axis).covers(
            *requirements
        )
    )
    trace = ctx.trace()
    raised = trace.instant(event("alarm.raised", axis, number=number))
    began = since if isinstance(since, float) else trace.instant(since)
    if raised is not None and began is not None:
        ctx.measure(
            f"time to alarm {number}",
            raised - began,
            "s",
            low=expected_s - early_s - 1e-6,
            high=expected_s + margin,
            requirements=requirements,
        )


def disabled_with(ctx: CaseContext, number: int, word_bit: int, job: Any, *, since: float = 0.0) -> None:
    """Expect everything that goes with an alarm of reaction 4 (MON-056): bits, job, no other alarm; and the
    way back.
    """
    axis = axis_name(ctx)
    ended = ctx.now_s
    run = Run(ctx)
    ctx.measure("ErrorWord", float(run.error_word[-1]), low=1 << word_bit, high=1 << word_bit)
    ctx.measure("ErrorDetail.Number", float(run.alarm_number[-1]), low=number, high=number)
    ctx.measure("ErrorDetail.Reaction", float(run.alarm_reaction[-1]), low=4, high=4)
    ctx.expect(
        status_word_bit(0, False, at=ended, axis=axis),
        status_word_bit(1, True, at=ended, axis=axis),
        no_alarm(since=since, axis=axis, besides=(number, 504, 522)).covers("MON-056"),
    )
    if job is not None:
        ctx.measure(
            "ErrorID of the job", float(job.ErrorID), low=0x8001, high=0x8001, requirements=("MON-020",)
        )
        ctx.measure("Done of the job", float(job.Done), high=0.0)
    disabled_by_alarm(ctx, ended)


def acknowledged(ctx: CaseContext) -> None:
    """Acknowledge; the axis is enabled again by itself, without a jump, and moves."""
    ctx.do("MC_Reset")
    reset = ctx.axis.reset()
    ctx.wait_until(reset.done, 5.0, "the alarm is acknowledged")
    ctx.wait_until(ctx.axis.power_instance.status, 5.0, "the axis is enabled again without a new edge")
    since = ctx.now_s
    ctx.run_for(0.1)
    ctx.measure("speed after enabling", float(abs(Run(ctx, since).actual_velocity).max()), "mm/s", high=5.0)
    ctx.expect(state_at(axis_name(ctx), ctx.now_s, "STANDSTILL"))


def quiet(ctx: CaseContext, *, besides: tuple[int, ...] = (), requirements: tuple[str, ...] = ()) -> None:
    """Expect no alarm in the whole run."""
    ctx.expect(no_alarm(axis=axis_name(ctx), besides=besides).covers(*requirements))


def begin(ctx: CaseContext, start: Mapping[str, Any] | None = None, *values: Mapping[str, Any]) -> None:
    """Configure and enable."""
    configure(ctx, start)
    for one in values:
        write(ctx, one)
    enable(ctx)


def until_setpoint_ends(ctx: CaseContext, job: Callable[[], object] | Any) -> float:
    """Wait for the end of the setpoint of the last job; returns the time of the cycle in which it became
    0.
    """
    axis = ctx.axis
    ctx.wait_until(lambda: not axis.motion.gen.done, 1.0, "the setpoint moves")
    ctx.wait_until(lambda: axis.motion.gen.done, 10.0, "the setpoint has ended")
    del job
    return ctx.now_s
