"""Always-on rules about the setpoints of an axis: they are smooth, within the limits, and a stop ends where
it is computed to end.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from hil.expect._motion_rules import STEADY_STATES, follows_actual, given_from_outside, no_change
from hil.expect._words import in_states, normal_state
from hil.expect.golden import StopRamp, stop_ramp
from hil.record import Signal, Trace
from reports.model import Check, Verdict

Flags = NDArray[np.bool_]
_SHARE = 1.001
"""Rounding of the last digits, as a factor."""
_STEP = 1e-6
"""Rounding of a position, in axis units."""
_RAMP_STATES = ("alarm_ramp", "disabling_ramp")
_LATE_CYCLES = 3
"""A stop may begin this many cycles after its state: inputs, alarm and setpoint are of different cycles."""


def _axes(trace: Trace) -> Iterator[tuple[str, Signal, NDArray[np.float64]]]:
    """Return the axes whose whole setpoint chain is recorded: name, velocity setpoint, time of each cycle."""
    chain = ("position_setpoint", "velocity_setpoint", "acceleration_setpoint")
    for axis in trace.components_with(*chain, "state", "status_word"):
        velocity = trace[f"{axis}.velocity_setpoint"]
        if len(velocity) >= 3:
            cycle_s = trace.constants.get(f"{axis}.cycle_s", 0.0)
            # On a live bench late cycles are caught up in a burst; each of them is still one cycle of the
            # setpoint.
            yield axis, velocity, np.maximum(np.diff(velocity.time_s), cycle_s)


def _judged(trace: Trace, axis: str, velocity: Signal) -> Flags:
    """Return the steps between samples in which the axis makes its setpoints
    itself and nothing starts again.
    """
    return trace.once((_judged, axis), lambda: _computed(trace, axis, velocity))


def _computed(trace: Trace, axis: str, velocity: Signal) -> Flags:
    own = in_states(trace[f"{axis}.state"], STEADY_STATES) & ~given_from_outside(trace, axis)
    flags: Flags = own[1:] & own[:-1] & no_change(trace, axis, velocity)
    return flags


def check_position_continuity(trace: Trace) -> list[Check]:
    """The position setpoint moves by its velocity: no step beyond v * T and a tolerance (MC-568).

    The tolerance is what the greatest acceleration can add in a cycle. A change of state and an offset of
    homing may set a new position; they are not judged, nor are setpoints that the user program gives, nor
    what follows the actual position without position control.
    """
    checks = []
    for axis, velocity, step_s in _axes(trace):
        greatest = _greatest_acceleration(trace, axis)
        if greatest is None:
            continue
        position = trace[f"{axis}.position_setpoint"]
        follows = follows_actual(trace, axis)
        judged = _judged(trace, axis, velocity) & ~(follows[1:] | follows[:-1])
        step = np.abs(np.diff(position.values))
        speed = np.maximum(np.abs(velocity.values[1:]), np.abs(velocity.values[:-1]))
        bound = speed * step_s * _SHARE + greatest * step_s**2 + _STEP
        broken = np.flatnonzero(judged & (step > bound))
        over = float((step - bound)[judged].max(initial=-np.inf))
        index = int(broken[0]) if len(broken) else None
        checks.append(
            Check(
                f"continuity of {axis}.position_setpoint",
                Verdict.PASSED if index is None else Verdict.FAILED,
                "no step beyond velocity times cycle",
                f"{int(judged.sum())} cycles"
                + (f", nearest to the limit by {max(-over, 0.0):.3g} {position.unit}" if judged.any() else "")
                if index is None
                else f"a step of {float(step[index]):.5g} {position.unit} at {float(speed[index]):.4g} "
                f"{velocity.unit}",
                None if index is None else float(velocity.time_s[index + 1]),
                value=None if index is None else float(step[index]),
                unit=position.unit,
                high=None if index is None else float(bound[index]),
                requirements=["MC-568"],
                signal=f"{axis}.position_setpoint",
            )
        )
    return checks


def check_acceleration_setpoint(trace: Trace) -> list[Check]:
    """The acceleration setpoint keeps within the greatest configured one (STP-239, STP-241, MC-568).

    As in `check_setpoint_continuity`, with the value that the generator itself
    states in place of the difference.
    """
    checks = []
    for axis, velocity, _ in _axes(trace):
        greatest = _greatest_acceleration(trace, axis)
        if greatest is None:
            continue
        signal = trace[f"{axis}.acceleration_setpoint"]
        judged = np.zeros(len(signal), dtype=bool)
        judged[1:] = _judged(trace, axis, velocity)
        size = np.abs(signal.values)
        broken = np.flatnonzero(judged & ~(size <= greatest * _SHARE + _STEP))
        index = int(broken[0]) if len(broken) else None
        worst = float(size[judged].max(initial=0.0)) if index is None else float(size[index])
        checks.append(
            Check(
                f"limit of {axis}.acceleration_setpoint",
                Verdict.PASSED if index is None else Verdict.FAILED,
                f"at most {greatest:g} {signal.unit}",
                f"{worst:.5g} {signal.unit}",
                None if index is None else float(signal.time_s[index]),
                value=worst,
                unit=signal.unit,
                high=greatest,
                requirements=["STP-239", "STP-241", "MC-568"],
                signal=signal.name,
            )
        )
    return checks


def _greatest_acceleration(trace: Trace, axis: str) -> float | None:
    names = ("max_acceleration", "max_deceleration", "emergency_deceleration")
    known = [trace.constants.get(f"{axis}.{name}") for name in names]
    return max(limit for limit in known if limit is not None) if None not in known else None


def check_stop_travel(trace: Trace) -> list[Check]:
    """A stop of the axis takes no more way than its ramp by formula (STP-239, STP-241, STP-244, STP-245).

    Judged are the ramps of `MC_Power` (StopMode 0 or 2) and of alarms with reaction 2 and 3, on the
    setpoints, from the velocity with which the ramp begins. Which of both a disabling ramp is does not show
    in the words: the longer one counts. Ramps that something else interrupts, and those after limits were
    written by the program, are left out.
    """
    checks = []
    for axis, velocity, _ in _axes(trace):
        ramps = _Ramps.of(trace, axis)
        if ramps is None:
            continue
        problems: list[tuple[float, str]] = []
        seen = 0
        for begin_s, end_s, reaction in _stops(trace, axis):
            travel = ramps.travel(velocity, begin_s, end_s, reaction)
            if travel is None:
                continue
            seen += 1
            taken, limit = travel
            if taken > limit:
                problems.append(
                    (begin_s, f"{taken:.5g}, {taken - limit:.3g} more than {limit:.5g} by its ramp")
                )
        if seen:
            checks.append(
                Check(
                    f"travel of stops of {axis}",
                    Verdict.FAILED if problems else Verdict.PASSED,
                    "no more than by the formula of its ramp",
                    problems[0][1] if problems else f"{seen} stops",
                    problems[0][0] if problems else None,
                    requirements=["STP-239", "STP-241", "STP-244", "STP-245"],
                    signal=f"{axis}.position_setpoint",
                )
            )
    return checks


def _stops(trace: Trace, axis: str) -> Iterator[tuple[float, float, int]]:
    """Return begin, end and reaction of every ramp of the axis itself; 0: of `MC_Power`."""
    changes = list(trace.select(source=axis, kind="axis.state"))
    written = next((entry.time_ns for entry in trace.select(source=axis, kind="program.write")), None)
    alarms = [
        (entry.time_ns, int(entry.data.get("reaction") or 0))
        for entry in trace.select(source=axis, kind="alarm.raised")
    ]
    halts = [
        entry.time_ns
        for entry in trace.select(kind="fault.applied")
        if str(entry.data.get("fault")).startswith("controller.")
    ]
    cycle_ns = round(trace.constants.get(f"{axis}.cycle_s", 0.004) * 1e9)
    for number, entry in enumerate(changes):
        kind = normal_state(str(entry.data.get("to")))
        if kind not in _RAMP_STATES or (written is not None and written < entry.time_ns):
            continue
        end_ns = changes[number + 1].time_ns if number + 1 < len(changes) else trace.end_ns
        before = [reaction for time_ns, reaction in alarms if time_ns <= entry.time_ns]
        later = [time_ns for time_ns, _ in alarms if entry.time_ns < time_ns < end_ns]
        if kind == "alarm_ramp":
            recent = [r for t, r in alarms if entry.time_ns - 2 * cycle_ns <= t <= entry.time_ns]
            reaction = max((r for r in recent if r in (1, 2, 3)), default=0)
            if reaction not in (2, 3):
                continue
        elif before and later:
            continue
        else:
            reaction = 0
        if later or any(entry.time_ns <= time_ns < end_ns for time_ns in halts):
            # Another alarm may have taken over with its own ramp; a controller that hangs makes no setpoints.
            continue
        yield entry.time_ns * 1e-9, end_ns * 1e-9, reaction


class _Ramps:
    """The ramps of an axis by formula."""

    def __init__(
        self, emergency: float, deceleration: float, jerk: float, cycle_s: float, *, plan_s: float
    ) -> None:
        self._emergency = emergency
        self._deceleration = deceleration
        self._jerk = jerk
        self._cycle_s = cycle_s
        self._plan_s = max(plan_s, cycle_s)
        """Cycle in which setpoints are planned: that of the interpolator, where it is slower than the servo.
        """

    @classmethod
    def of(cls, trace: Trace, axis: str) -> _Ramps | None:
        """Return the ramps, or None where the bench does not give its limits."""
        names = ("emergency_deceleration", "max_deceleration", "max_jerk", "cycle_s")
        known = [trace.constants.get(f"{axis}.{name}") for name in names]
        if any(value is None for value in known) or not known[0] or not known[1] or not known[3]:
            return None
        interpolator_s = trace.constants.get(f"{axis}.interpolator_s", 0.0)
        return cls(*(float(value or 0.0) for value in known), plan_s=interpolator_s)

    def travel(
        self, velocity: Signal, begin_s: float, end_s: float, reaction: int
    ) -> tuple[float, float] | None:
        """Return the travel of a stop and its limit; None where there is no motion to judge."""
        first = max(int(np.searchsorted(velocity.time_s, begin_s - 1e-9)) - 1, 0)
        last = int(np.searchsorted(velocity.time_s, end_s + 1e-9, side="right"))
        times, values = velocity.time_s[first:last], velocity.values[first:last]
        if len(values) < 4 or float(np.abs(values).max()) < _STEP:
            return None
        early = values[: round(_LATE_CYCLES * self._plan_s / self._cycle_s) + 1]
        speed = float(np.abs(early).max())
        sign = -1.0 if early[int(np.argmax(np.abs(early)))] < 0 else 1.0
        rising = max(0.0, sign * float(early[0] - velocity.values[max(first - 1, 0)]) / self._cycle_s)
        limits = []
        if reaction in (0, 3):
            limits.append(stop_ramp(speed, self._emergency).distance)
        if reaction in (0, 2):
            limits.append(self._maximum(speed, rising).distance)
        taken = abs(float(np.trapezoid(values, times)))
        return taken, max(limits) * _SHARE + speed * _LATE_CYCLES * self._plan_s + _STEP

    def _maximum(self, speed: float, acceleration: float) -> StopRamp:
        return stop_ramp(speed, self._deceleration, self._jerk or None, acceleration=acceleration)
