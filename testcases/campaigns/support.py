"""What the shipped campaigns share: bringing the axis into a phase of motion, and the tolerances of the
bench.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from hil.campaign import CaseContext
from hil.errors import BlockedError
from hil.record import EventSelector, event
from testcases.campaigns.own_axis import own

VELOCITY: Final = 300.0
"""Velocity at which every stop of the specification's numbers begins, mm/s."""
MAXIMUM_VELOCITY: Final = 500.0
"""Velocity of the axis at the drive's maximum speed (p1082), mm/s."""
_QUICK_STOPS: Final = {
    "cia402": "Quick stop active",
    "profidrive": "S5 quick stop",
    "tm_pto": "S5 quick stop",
    "analog": "Stopping",
}
"""State of the drive in which it stops on the ramp of its quick stop, by profile."""
ACCELERATION: Final = 1000.0
JERK: Final = 10_000.0

PHASES: Final = ("constant", "accelerating", "decelerating", "standstill")
MOVING: Final = PHASES[:3]


@dataclass(frozen=True)
class Tolerance:
    """How far a measurement may lie from the number of the specification on this bench."""

    time_s: float
    distance: float
    """In the position unit of the axis."""


def tolerance(ctx: CaseContext) -> Tolerance:
    """Return the tolerance that the bench file states, applied to this bench's cycle (section 0.3)."""
    section = ctx.bench.config.tolerance
    cycles_s = section.cycles * ctx.bench.interpolator_ns * 1e-9
    axis = own(ctx)
    extra = section.distance_mm / 1000.0 / (axis.golden.machine_m or 1.0)
    return Tolerance(cycles_s + section.time_s, axis.velocity * cycles_s + extra)


def settle_s(ctx: CaseContext) -> float:
    """Return the time to wait on top for everything to come to rest on this bench, s; none in virtual
    time.
    """
    return 10.0 * float(ctx.bench.config.tolerance.time_s)


def grace_s(ctx: CaseContext) -> float:
    """Return the time within which the axis must report lost actual values, s."""
    bench = ctx.bench.config
    return float((bench.bench.grace_cycles + 2) * ctx.bench.cycle_ns * 1e-9 + bench.tolerance.time_s)


def drive_setting(ctx: CaseContext, name: str) -> Any:
    """Return a setting of the drive of the axis, from its table of the bench file.

    Raises:
        BlockedError: A drive of this profile and bus has no such setting.

    """
    drive = drive_name(ctx)
    section = ctx.bench.config.drive[drive]
    if not hasattr(section, name):
        raise BlockedError(f"the case needs {name} of {drive}, and its profile {section.profile} has none")
    return getattr(section, name)


def can_segment(ctx: CaseContext) -> str:
    """Return the name of the CAN segment of the drive of the axis.

    Raises:
        BlockedError: It is not on CAN.

    """
    drive = drive_name(ctx)
    name = str(ctx.bench.config.drive[drive].segment)
    if ctx.bench.config.segment[name].on_modbus:
        raise BlockedError(f"the case needs a drive on CAN, and {drive} is on {name}, which is not")
    return name


def permitted_error_mm(ctx: CaseContext) -> float:
    """Return the following error that the axis permits at 300 mm/s, mm."""
    read = ctx.axis.variables.read
    low, high = read("FollowingError.MinVelocity"), read("DynamicLimits.MaxVelocity")
    share = (VELOCITY - low) / (high - low)
    return float(read("FollowingError.MinValue") * (1.0 - share) + read("FollowingError.MaxValue") * share)


def need_permitted_error_below(ctx: CaseContext, limit_mm: float, reason: str) -> None:
    """Block the case on a bench whose axis permits more following error than the case can make.

    Raises:
        BlockedError: It does.

    """
    permitted = permitted_error_mm(ctx)
    if permitted > limit_mm:
        raise BlockedError(
            f"the axis permits {permitted:g} mm of following error, this case needs at most {limit_mm:g} "
            f"mm: {reason}"
        )


def following_error_s(ctx: CaseContext) -> float:
    """Return the time in which a blocked axis uses up its permitted following error at 300 mm/s, with a
    reserve, s.
    """
    section = ctx.bench.config.tolerance
    # Twice, because braking while blocked lets the error grow more slowly.
    return float(
        2.0 * permitted_error_mm(ctx) / VELOCITY + 4 * ctx.bench.interpolator_ns * 1e-9 + section.time_s
    )


def axis_name(ctx: CaseContext) -> str:
    """Return the name of the axis under test."""
    return str(ctx.bench.axis_names[0])


def drive_name(ctx: CaseContext) -> str:
    """Return the name of the drive under test."""
    return str(ctx.bench.drive_of())


def state_change(ctx: CaseContext, state: str) -> EventSelector:
    """Select the instant at which the axis enters `state`."""
    return event("axis.state", axis_name(ctx), to=state)


def quick_stop(ctx: CaseContext) -> EventSelector:
    """Select the instant at which the drive begins its quick stop, as its profile calls it."""
    name = drive_name(ctx)
    profile = ctx.bench.config.drive[name].profile
    return event("drive.state", name, to=_QUICK_STOPS[profile])


def enable(ctx: CaseContext) -> Any:
    """Enable the axis and wait for it; returns the `MC_Power` instance."""
    ctx.do("MC_Power Enable = TRUE, StartMode 1")
    power = ctx.axis.power()
    ctx.wait_until(power.status, 5.0, "the axis is enabled")
    return power


def bring_into(ctx: CaseContext, phase: str, *, direction: int = 1) -> Any:
    """Bring the enabled axis into a phase of motion at `Own.velocity`; returns the running job, None at
    standstill.
    """
    axis, values = ctx.axis, own(ctx)
    if phase == "standstill":
        ctx.run_for(0.1)
        return None
    inputs = values.dynamics().inputs
    top = values.velocity if phase == "constant" else values.fast
    ctx.do(f"MC_MoveVelocity {values.words(top * direction)}")
    job = axis.move_velocity(values.given(top * direction), **inputs)
    if phase == "accelerating":
        ctx.wait_until(
            lambda: axis.motion.gen.v * direction >= values.velocity,
            5.0,
            f"{values.words(values.velocity)} are passed while accelerating",
        )
        return job
    ctx.wait_until(job.in_velocity, 5.0, "constant travel is reached")
    if phase == "constant":
        ctx.run_for(0.1)
        return job
    ctx.do("MC_MoveVelocity 0: the axis brakes")
    job = axis.move_velocity(0.0, **inputs)
    ctx.wait_until(
        lambda: axis.motion.gen.v * direction <= values.velocity,
        5.0,
        f"{values.words(values.velocity)} are passed while braking",
    )
    return job


def acknowledge(ctx: CaseContext) -> None:
    """Acknowledge the alarms and wait for it."""
    ctx.do("MC_Reset")
    reset = ctx.axis.reset()
    ctx.wait_until(reset.done, 5.0, "the alarms are acknowledged")


def acknowledge_and_enable(ctx: CaseContext) -> None:
    """Acknowledge, and wait until the axis is enabled: an alarm that has disabled it lets `MC_Power` enable
    it again.
    """
    acknowledge(ctx)
    ctx.wait_until(ctx.axis.power_instance.status, 5.0, "the axis is enabled without a new edge")


def restart(ctx: CaseContext, start: Mapping[str, Any]) -> None:
    """Write start values in load memory and restart the axis, which has to be disabled."""
    for path, value in start.items():
        ctx.axis.variables.write_start(path, value)
    ctx.do("MC_Reset Restart = TRUE: new start values take effect")
    ctx.wait_until(ctx.axis.reset(restart=True).done, 5.0, "the axis is restarted")


# -- numbers ----------------------------------------------------------------------------------------------


def equal(ctx: CaseContext, what: str, value: float, wanted: float, *ids: str, within: float = 0.0) -> None:
    """Expect a number, `within` more or less."""
    ctx.measure(what, float(value), low=wanted - within, high=wanted + within, requirements=ids)


def same(ctx: CaseContext, what: str, found: object, wanted: object, *ids: str) -> None:
    """Expect a value of any kind."""
    equal(ctx, f"{what} is {wanted!r} (it is {found!r})", found == wanted, 1, *ids)


def raises(call: Callable[[], object], kind: type[Exception] = Exception) -> str:
    """Return the message with which a call fails; empty: it does not."""
    try:
        call()
    except kind as error:
        return str(error) or type(error).__name__
    return ""


def column(ctx: CaseContext, name: str) -> NDArray[np.float64]:
    """Return the values of a signal of the trace so far, by its name: `axis1.velocity_setpoint`."""
    return np.asarray(ctx.trace()[name].values, dtype=np.float64)


def later(values: NDArray[np.float64], cycles: int) -> NDArray[np.float64]:
    """Return values so many cycles later, after the first one."""
    return np.concatenate((np.full(cycles, values[0]), values[: len(values) - cycles]))


def same_column(
    ctx: CaseContext,
    words: str,
    found: ArrayLike,
    wanted: ArrayLike,
    *ids: str,
    within: float = 1e-6,
    ranges: float = 10.0,
) -> None:
    """Measure the greatest difference of two columns, and that they say something.

    Args:
        ctx: The case.
        words: What the columns are.
        found: One column.
        wanted: What it has to be.
        ids: Requirements that the comparison judges.
        within: Greatest difference.
        ranges: So many times the greatest difference the values have to range over, at least.

    """
    found, wanted = np.asarray(found, dtype=np.float64), np.asarray(wanted, dtype=np.float64)
    ctx.measure(f"range of {words}", float(np.ptp(found)), low=ranges * within)
    ctx.measure(
        f"{words}: off its formula", float(np.abs(found - wanted).max()), high=within, requirements=ids
    )


def speed_at(ctx: CaseContext, position: str, velocity: str, place: float) -> float:
    """Return the velocity at which a position is passed for the first time."""
    trace = ctx.trace()
    where, speed = trace[position], trace[velocity]
    passed = np.flatnonzero((where.values[:-1] < place) & (where.values[1:] >= place))
    ctx.require(bool(len(passed)), f"{position} passes {place:g}")
    return float(speed.at(float(where.time_s[passed[0] + 1])))
