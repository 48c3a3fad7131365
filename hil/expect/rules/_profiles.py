"""Rules about the whole of a motion by jobs: its velocity, that it begins, and how long it takes."""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from hil.expect.golden import travel_time
from hil.expect.rules._definition import Flags, Judged, Rule, differences, last_true
from hil.expect.rules._ramps import Segment, in_segments
from hil.expect.rules._views import AxisView

_SHARE: Final = 1e-6
_POSITIONING: Final = ("MC_MoveAbsolute", "MC_MoveRelative")
_LATE: Final = 3
"""Cycles in which a motion may begin later, and end later, than by formula."""


def _cruising(axis: AxisView) -> Flags:
    """Return where the velocity has not changed for three cycles."""
    v, a = axis["velocity_setpoint"], axis["acceleration_setpoint"]
    still = (a == 0.0) & (np.abs(differences(v)) <= 1e-12 * np.abs(v))
    return last_true(still & (v != 0.0), 3)


def _kept_velocity(axis: AxisView) -> Judged | None:
    found = axis.once(in_segments)
    if found is None:
        return None
    known, usable = found
    v = axis["velocity_setpoint"]
    judged, broken, wanted = (np.zeros(len(v), dtype=kind) for kind in (bool, bool, float))
    cruising = axis.once(_cruising)
    for part in known:
        if part.velocity is None:
            continue
        inside = slice(part.first + 4, part.behind)
        own = cruising[inside] & usable[inside]
        judged[inside] |= own
        wanted[inside] = part.velocity[inside]
        off = np.abs(np.abs(v[inside]) - part.velocity[inside])
        broken[inside] |= own & (off > _SHARE * (1.0 + part.velocity[inside]))
    if not judged.any():
        return None
    unit = axis.unit("velocity_setpoint")
    return Judged(
        axis.time_s, judged, broken, lambda at: f"it keeps {v[at]:.6g} {unit} in place of {wanted[at]:.6g}"
    )


KEPT_VELOCITY: Final = Rule(
    name="velocity that a job keeps",
    says="what a job keeps is its velocity with the override, within the limits",
    requirements=("MC-093", "MC-094", "VAR-164", "STP-113"),
    tolerance="rounding; judged from the fourth cycle with the same value on",
    judge=_kept_velocity,
    excused_by=("controller.",),
    recovery_cycles=5,
)


def _profile_s(way: float, begin: float, part: Segment, at: int) -> float | None:
    """Return how long the shortest motion over a way takes, s, to its end at rest.

    Args:
        way: Its length, > 0.
        begin: Velocity at its begin, in its direction.
        part: The job with its dynamic values.
        at: Cycle whose values hold.

    Returns:
        The time; None where no formula is known: with a jerk limit from another velocity than 0, or with a
        reversal.

    """
    assert part.velocity is not None  # asked for positionings only
    top, up, down = float(part.velocity[at]), float(part.acceleration[at]), float(part.deceleration[at])
    jerk = float(part.jerk[at])
    if min(top, up, down) <= 0.0 or begin < 0.0 or begin > top or begin**2 / (2.0 * down) > way:
        return None
    if math.isinf(jerk):
        peak = math.sqrt((2.0 * up * down * way + down * begin**2) / (up + down))
        if peak <= top:
            return (peak - begin) / up + peak / down
        rest = way - (top**2 - begin**2) / (2.0 * up) - top**2 / (2.0 * down)
        return (top - begin) / up + top / down + rest / top
    if begin > 0.0:
        return None
    return travel_time(way, top, up, down, jerk)


def _duration(axis: AxisView) -> Judged | None:
    found = axis.once(in_segments)
    if found is None or not axis.has("position_setpoint") or not axis.has_position:
        return None
    known, usable = found
    s, v, a = (axis[f"{name}_setpoint"] for name in ("position", "velocity", "acceleration"))
    ends = {
        axis.index_of(entry.time_ns)
        for entry in axis.whole.events.of(axis.name, "job.done")
        if entry.data.get("instruction") in _POSITIONING
    }
    judged: list[tuple[float, str]] = []
    for part in known:
        first, behind = part.first, part.behind
        if part.what not in _POSITIONING or part.velocity is None or behind not in ends:
            continue
        inside = slice(first, behind)
        if first < 1 or behind >= len(s) or not usable[first + 1 : behind].all():
            continue
        values = (part.velocity, part.acceleration, part.deceleration, part.jerk)
        # A value that changes on the way makes another profile.
        if any(np.unique(one[inside]).size > 1 for one in values) or a[first - 1] != 0.0:
            continue
        moving = np.flatnonzero(v[inside] != 0.0)
        if not len(moving):
            continue
        # The job acts from the cycle in which it gets control on, with the motion of the one before.
        way = float(s[behind] - s[first - 1])
        sign = math.copysign(1.0, way)
        if abs(way) < 1e-3:
            continue
        time_s = _profile_s(abs(way), sign * float(v[first - 1]), part, first)
        if time_s is None:
            continue
        taken = int(moving[-1]) + 2
        needed = time_s / axis.cycle_s
        wrong = not needed - _LATE <= taken <= needed + _LATE
        text = f"{part.what} over {way:.5g} takes {taken} cycles, by its values {needed:.1f}"
        judged.append((axis.time_s[behind], text if wrong else ""))
    return Judged.of_list(judged) if judged else None


DURATION: Final = Rule(
    name="time of a positioning",
    says="a positioning takes as long as the shortest profile with its velocity, acceleration, deceleration "
    "and jerk",
    requirements=("MC-093", "STP-082", "STP-084"),
    tolerance="three cycles; of a positioning alone, with a jerk limit from rest",
    judge=_duration,
    excused_by=("controller.",),
    recovery_cycles=5,
)


def _begins(axis: AxisView) -> Judged | None:
    found = axis.once(in_segments)
    if found is None:
        return None
    known, usable = found
    v, a = axis["velocity_setpoint"], axis["acceleration_setpoint"]
    override = axis.number_over_time("Override.Velocity")
    limited = axis.bit(15) | axis.bit(16)
    judged: list[tuple[float, str]] = []
    for part in known:
        first = part.first
        last = first + _LATE + 1
        if part.velocity is None or last >= part.behind or override is None:
            continue
        span = slice(max(first - 1, 0), last + 1)
        if not usable[first + 1 : last + 1].all() or limited[span].any() or (override[span] == 0.0).any():
            continue
        if part.what in _POSITIONING or (part.velocity[span] < 1e-6).any():
            continue
        idle = bool((v[first + 1 : last + 1] == 0.0).all() and (a[first + 1 : last + 1] == 0.0).all())
        text = f"{part.what} does not move the axis {_LATE} cycles after it has got control"
        judged.append((axis.time_s[last], text if idle else ""))
    return Judged.of_list(judged) if judged else None


BEGINS: Final = Rule(
    name="begin of a motion",
    says="a job with a velocity moves the axis at once",
    requirements=("MC-060", "MC-090"),
    tolerance="three cycles; not at a software limit or with an override of 0",
    judge=_begins,
    excused_by=("controller.",),
    recovery_cycles=5,
)

AXIS_RULES: Final[tuple[Rule[AxisView], ...]] = (KEPT_VELOCITY, DURATION, BEGINS)
