"""Rules about ramps and limits of the setpoint: each direction and each stop has its own values."""

from __future__ import annotations

from typing import Final, NamedTuple

import numpy as np

from fieldbus.history import Event
from hil.expect.rules._definition import Flags, Judged, Numbers, Rule, differences, last_true
from hil.expect.rules._views import CONTROLLED, AxisView

_SHARE: Final = 1.0 + 1e-6
_MOVES: Final = ("MC_MoveAbsolute", "MC_MoveRelative", "MC_MoveVelocity", "MC_MoveJog", "MC_Halt")
_SUPERIMPOSED: Final = ("MC_MoveSuperimposed", "MC_HaltSuperimposed", "MC_MotionInSuperimposed")


class Segment(NamedTuple):
    """A time in which one job has control, or one ramp of the axis brakes."""

    first: int
    behind: int
    acceleration: Numbers
    deceleration: Numbers
    jerk: Numbers
    velocity: Numbers | None
    """Greatest velocity that is asked for; None: the segment brakes only."""
    what: str


def _asked(axis: AxisView) -> dict[object, Event]:
    """Return what each job was given, the last time that it was started."""
    return {entry.data.get("job"): entry for entry in axis.whole.events.of(axis.name, "job.started")}


def segments(axis: AxisView) -> list[Segment] | None:
    """Return the times whose dynamic values are known; None where the bench does not tell its limits."""
    number = axis.number_over_time
    limits = [
        number(f"DynamicLimits.{name}")
        for name in ("MaxAcceleration", "MaxDeceleration", "MaxJerk", "MaxVelocity", "Velocity")
    ]
    emergency, override = number("DynamicDefaults.EmergencyDeceleration"), number("Override.Velocity")
    if emergency is None or override is None or any(one is None for one in limits):
        return None
    acceleration, deceleration, jerk, velocity, second = (one for one in limits if one is not None)
    fastest = np.minimum(velocity, second)
    count = len(axis.time_s)
    found: list[Segment] = []
    events = axis.whole.events
    spans: list[tuple[int, int, Event]] = []
    running: dict[object, tuple[int, Event]] = {}
    started: dict[object, Event] = {}
    ordered = events.of(axis.name, "job.started", "job.active", "job.done", "job.aborted", "job.error")
    for entry in sorted(ordered, key=lambda one: one.time_ns):
        job = entry.data.get("job")
        if entry.kind == "job.started":
            started[job] = entry
        elif entry.kind == "job.active" and job in started:
            running[job] = axis.index_of(entry.time_ns), started[job]
        elif job in running:
            first, begun = running.pop(job)
            spans.append((first, axis.index_of(entry.time_ns), begun))
    spans += [(first, count, begun) for first, begun in running.values()]
    superimposed = np.zeros(count + 1, dtype=bool)
    for first, behind, begun in spans:
        if begun.data.get("instruction") in _SUPERIMPOSED:
            superimposed[first : behind + 2] = True
    moving = axis.in_states("motion", "halting")
    for first, behind, begun in spans:
        asked = begun.data
        if asked.get("instruction") not in _MOVES or "deceleration" not in asked:
            continue
        if superimposed[first:behind].any() or not moving[first + 1 : behind].all():
            continue
        wanted = asked.get("velocity")
        given = float(asked.get("jerk") or 0.0)
        found.append(
            Segment(
                first,
                behind,
                np.minimum(float(asked.get("acceleration") or 0.0), acceleration),
                np.minimum(float(asked.get("deceleration") or 0.0), deceleration),
                np.minimum(given, jerk) if given > 0.0 else np.full(count, np.inf),
                None if wanted is None else np.minimum(abs(float(wanted)) * override * 0.01, fastest),
                str(asked.get("instruction")),
            )
        )
    return found


def in_segments(axis: AxisView) -> tuple[list[Segment], Flags] | None:
    """Return the jobs whose dynamic values are known, and where the axis makes its setpoints by them."""
    columns = ("velocity_setpoint", "acceleration_setpoint", "status_word", "state")
    if not axis.has(*columns) or axis.number("interpolator_s") is not None or len(axis.time_s) < 5:
        return None
    known = segments(axis)
    if not known:
        return None
    usable = axis.in_states(*CONTROLLED) & ~axis.bit(28) & ~axis.gaps
    usable &= ~axis.near(axis.whole.events.of(axis.name, "axis.homed", "axis.sensor", "program.write"), 1, 3)
    return known, usable


def _job_dynamics(axis: AxisView) -> Judged | None:
    found = axis.once(in_segments)
    if found is None:
        return None
    known, usable = found
    v, a = axis["velocity_setpoint"], axis["acceleration_setpoint"]
    count = len(v)
    judged, broken = np.zeros(count, dtype=bool), np.zeros(count, dtype=bool)
    bound = np.zeros(count)
    for part in known:
        inside = slice(part.first + 2, part.behind)
        own = usable[inside]
        faster = a[inside] * v[inside] > 0.0
        limit = np.where(faster, part.acceleration[inside], part.deceleration[inside])
        # A reversal may be at zero in a cycle, and speeds up from then on.
        turning = np.abs(v[inside]) <= 1e-9
        limit[turning] = np.maximum(part.acceleration[inside], part.deceleration[inside])[turning]
        # The acceleration of the motion before goes on until the jerk has ended it.
        before = np.abs(a[min(part.first, count - 1)])
        steps = np.arange(len(limit)) + 1.0
        jerk = part.jerk[inside]
        with np.errstate(invalid="ignore"):
            carried = np.where(np.isinf(jerk), 0.0, before - jerk * steps * axis.cycle_s * 0.5)
        limit = np.maximum(limit, np.where(before > 0.0, carried, 0.0))
        judged[inside] |= own
        bound[inside] = limit
        broken[inside] |= own & (np.abs(a[inside]) > limit * _SHARE + 1e-6)
    if not judged.any():
        return None
    unit = axis.unit("acceleration_setpoint")
    return Judged(
        axis.time_s,
        judged,
        broken,
        lambda at: f"{a[at]:.6g} {unit} at {v[at]:.5g}, at most {bound[at]:.6g}",
    )


JOB_DYNAMICS: Final = Rule(
    name="acceleration of jobs",
    says="a job accelerates with its acceleration and brakes with its deceleration at most",
    requirements=("MC-093", "STP-082", "STP-084"),
    tolerance="rounding; the acceleration of the motion before, as far as the jerk lets it go on",
    judge=_job_dynamics,
    excused_by=("controller.",),
    recovery_cycles=5,
)


def _kept_acceleration(axis: AxisView) -> Flags:
    """Return the samples with the third or a later one of the same acceleration in a row."""
    a = axis["acceleration_setpoint"]
    same = np.abs(differences(a)) <= 1e-9 * np.abs(a)
    return last_true(same & (a != 0.0), 2)


def _plateaus(axis: AxisView) -> Judged | None:
    found = axis.once(in_segments)
    if found is None:
        return None
    known, usable = found
    v, a = axis["velocity_setpoint"], axis["acceleration_setpoint"]
    count = len(v)
    judged, broken = np.zeros(count, dtype=bool), np.zeros(count, dtype=bool)
    still = axis.once(_kept_acceleration)
    for part in known:
        inside = slice(part.first + 4, part.behind)
        own = still[inside] & usable[inside] & (v[inside] != 0.0)
        faster = a[inside] * v[inside] > 0.0
        value = np.where(faster, part.acceleration[inside], part.deceleration[inside])
        judged[inside] |= own
        broken[inside] |= own & (np.abs(np.abs(a[inside]) - value) > 1e-6 * value)
    if not judged.any():
        return None
    unit = axis.unit("acceleration_setpoint")
    return Judged(
        axis.time_s, judged, broken, lambda at: f"it keeps {a[at]:.6g} {unit} at {v[at]:.5g} {unit[:-1]}"
    )


PLATEAUS: Final = Rule(
    name="ramps of jobs",
    says="what a job keeps is its acceleration while it gets faster, and its deceleration while it brakes",
    requirements=("MC-093", "STP-082", "STP-084"),
    tolerance="rounding; judged from the third cycle with the same value on",
    judge=_plateaus,
    excused_by=("controller.",),
    recovery_cycles=5,
)


def _job_jerk(axis: AxisView) -> Judged | None:
    found = axis.once(in_segments)
    if found is None:
        return None
    known, usable = found
    a = axis["acceleration_setpoint"]
    count = len(a)
    judged, broken = np.zeros(count, dtype=bool), np.zeros(count, dtype=bool)
    change = np.abs(differences(a)) / axis.cycle_s
    # The acceleration of a sample that the axis did not make itself says nothing about a jerk.
    usable = last_true(usable, 1)
    for part in known:
        inside = slice(part.first + 3, part.behind)
        own = usable[inside] & np.isfinite(part.jerk[inside])
        judged[inside] |= own
        broken[inside] |= own & (change[inside] > part.jerk[inside] * _SHARE + 1e-3)
    if not judged.any():
        return None
    unit = axis.unit("acceleration_setpoint")
    return Judged(
        axis.time_s, judged, broken, lambda at: f"the acceleration changes by {change[at]:.6g} {unit[:-1]}3"
    )


JOB_JERK: Final = Rule(
    name="jerk of jobs",
    says="the acceleration changes no faster than the jerk of the job, within the limit",
    requirements=("MC-093", "STP-084"),
    tolerance="rounding",
    judge=_job_jerk,
    excused_by=("controller.",),
    recovery_cycles=5,
)


def _job_velocity(axis: AxisView) -> Judged | None:
    found = axis.once(in_segments)
    if found is None:
        return None
    known, usable = found
    v, a = axis["velocity_setpoint"], axis["acceleration_setpoint"]
    count = len(v)
    judged, broken, bound = np.zeros(count, dtype=bool), np.zeros(count, dtype=bool), np.zeros(count)
    for part in known:
        if part.velocity is None:
            continue
        inside = slice(part.first + 2, part.behind)
        own = usable[inside]
        # Above it only a motion that was faster before, while it brakes.
        over = np.abs(v[inside]) > part.velocity[inside] * _SHARE + 1e-6
        judged[inside] |= own
        bound[inside] = part.velocity[inside]
        more = np.abs(a[inside]) > np.abs(a[part.first + 1 : part.behind - 1][: len(own)]) * (1.0 - 1e-9)
        broken[inside] |= own & over & more & (a[inside] * v[inside] > 1e-9)
        if abs(v[min(part.first + 1, count - 1)]) <= part.velocity[min(part.first + 1, count - 1)] * _SHARE:
            # From what it was allowed before an override or a limit was lowered it brakes.
            highest = np.maximum.accumulate(part.velocity[part.first : part.behind])[2:]
            allowed = highest + _carried(axis, part, a)
            broken[inside] |= own & over & (np.abs(v[inside]) > allowed)
    if not judged.any():
        return None
    unit = axis.unit("velocity_setpoint")
    return Judged(
        axis.time_s, judged, broken, lambda at: f"{v[at]:.6g} {unit}, at most {bound[at]:.6g} {unit}"
    )


def _carried(axis: AxisView, part: Segment, a: Numbers) -> float:
    """Return by how much the acceleration before may carry the velocity beyond that of the job."""
    before = float(np.abs(a[max(part.first - 1, 0) : part.first + 2]).max(initial=0.0))
    jerk = float(part.jerk[part.first if part.first < len(part.jerk) else -1])
    return before * axis.cycle_s + (0.0 if np.isinf(jerk) or jerk <= 0.0 else before**2 / (2.0 * jerk))


JOB_VELOCITY: Final = Rule(
    name="velocity of jobs",
    says="a job gets no faster than its velocity with the override, within the limits",
    requirements=("MC-094", "VAR-164", "STP-113"),
    tolerance="rounding; a motion that was faster before only brakes",
    judge=_job_velocity,
    excused_by=("controller.",),
    recovery_cycles=5,
)


_RAMPS: Final = ("alarm_ramp", "disabling_ramp", "stopping", "enable_ramp")


def _stop_ramps(axis: AxisView) -> Judged | None:
    columns = ("velocity_setpoint", "acceleration_setpoint", "status_word", "state")
    if not axis.has(*columns) or axis.number("interpolator_s") is not None or len(axis.time_s) < 5:
        return None
    deceleration = axis.number_over_time("DynamicLimits.MaxDeceleration")
    emergency = axis.number_over_time("DynamicDefaults.EmergencyDeceleration")
    if deceleration is None or emergency is None:
        return None
    a, v = axis["acceleration_setpoint"], axis["velocity_setpoint"]
    count = len(a)
    still = axis.once(_kept_acceleration) & ~axis.gaps & ~axis.bit(28)
    still &= ~axis.near(axis.whole.events.of(axis.name, "program.write", "axis.homed"), 0, 3)
    judged, broken = np.zeros(count, dtype=bool), np.zeros(count, dtype=bool)
    wanted = np.zeros(count)
    for first, behind, values in _ramp_values(axis, deceleration, emergency):
        inside = slice(first + 2, behind)
        own = still[inside] & (a[inside] * v[inside] < 0.0)
        judged[inside] |= own
        off = np.min(
            [np.abs(np.abs(a[inside]) - value[inside]) / np.maximum(value[inside], 1e-9) for value in values],
            axis=0,
        )
        wanted[inside] = values[0][inside]
        broken[inside] |= own & (off > 1e-6)
    if not judged.any():
        return None
    unit = axis.unit("acceleration_setpoint")
    return Judged(
        axis.time_s,
        judged,
        broken,
        lambda at: f"it brakes with {a[at]:.6g} {unit}, not with {wanted[at]:.6g}",
    )


def _ramp_values(
    axis: AxisView, deceleration: Numbers, emergency: Numbers
) -> list[tuple[int, int, list[Numbers]]]:
    """Return the ramps of the axis and the decelerations that each may have."""
    events = axis.whole.events
    found = []
    changes = events.of(axis.name, "axis.state")
    stops = {
        entry.data.get("job"): entry
        for entry in events.of(axis.name, "job.started")
        if entry.data.get("instruction") == "MC_Stop"
    }
    actives = [e for e in events.of(axis.name, "job.active") if e.data.get("instruction") == "MC_Stop"]
    alarms = events.of(axis.name, "alarm.raised")
    for place, entry in enumerate(changes):
        kind = str(entry.data.get("to", "")).lower()
        if kind not in _RAMPS:
            continue
        first = axis.index_of(entry.time_ns)
        end_ns = changes[place + 1].time_ns if place + 1 < len(changes) else axis.whole.trace.end_ns
        behind = axis.index_of(end_ns)
        limit = [np.minimum(deceleration, deceleration), emergency]
        own = [one for one in actives if entry.time_ns <= one.time_ns <= end_ns]
        within = [
            int(one.data.get("reaction") or 0) for one in alarms if entry.time_ns <= one.time_ns < end_ns
        ]
        if kind == "stopping":
            modes = {
                int(stops[one.data.get("job")].data.get("mode") or 0)
                for one in own
                if one.data.get("job") in stops
            }
            if len(own) != 1 or len(modes) != 1 or within:
                continue
            mode = modes.pop()
            if mode == 3:
                asked = float(stops[own[0].data.get("job")].data.get("deceleration") or 0.0)
                values = [np.minimum(asked, deceleration)]
            else:
                values = [emergency if mode == 0 else deceleration]
        elif kind == "alarm_ramp":
            at_once = [int(one.data.get("reaction") or 0) for one in alarms if one.time_ns == entry.time_ns]
            if (
                own
                or max(at_once, default=0) not in (2, 3)
                or any(one.time_ns > entry.time_ns for one in alarms if one.time_ns < end_ns)
            ):
                continue
            # A stop that was harder goes on.
            values = [emergency] if max(at_once) == 3 else [deceleration, emergency]
        elif kind == "enable_ramp":
            values = [deceleration]
            if within:
                continue
        else:
            values = limit
            if within or own:
                continue
        found.append((first, behind, values))
    return found


STOP_RAMPS: Final = Rule(
    name="deceleration of stops",
    says="a stop brakes with the value of its mode: the emergency deceleration, the greatest one, or its own",
    requirements=("STP-239", "STP-241", "STP-386", "STP-387", "STP-388"),
    tolerance="rounding; judged from the third cycle with the same value on",
    judge=_stop_ramps,
    excused_by=("controller.",),
    recovery_cycles=5,
)

AXIS_RULES: Final[tuple[Rule[AxisView], ...]] = (
    JOB_DYNAMICS,
    PLATEAUS,
    JOB_JERK,
    JOB_VELOCITY,
    STOP_RAMPS,
)
