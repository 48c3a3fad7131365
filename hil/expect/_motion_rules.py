"""Always-on rules about motion: a drive without torque does not drive, a setpoint does not jump."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

import numpy as np
from numpy.typing import NDArray

from fieldbus.history import Event
from hil.expect._profidrive_rules import profidrive_axes, pulses_enabled
from hil.expect._words import has_torque, in_states
from hil.record import Signal, Trace
from reports.model import Check, Verdict

REST_SPEED: dict[str, float] = {"m/s": 0.0005, "rad/s": 0.05, "mm/s": 0.5}
"""Speed that counts as rest, by unit."""
REST_TRAVEL: dict[str, float] = {"m": 0.0001, "rad": 0.01, "mm": 0.1}
"""Displacement that counts as none, by unit."""


WINDOW_S = (0.05, 0.15)
"""What counts as an earlier speed: between these times back. A rebound from an
elastic stop is then no acceleration.
"""
_AFTER_PUSH_S = 0.5
"""A spring that is let go or a load that swings back needs a moment to come to rest."""
_JOLT_S = 0.02
"""Time after an encoder fault in which the drive may still have jerked before its torque went."""
_REST_S = 0.1
"""Time below the rest speed after which an axis is at rest."""


def pushed_spans(trace: Trace, drive: str) -> list[tuple[float, float]]:
    """Return when something else than the drive may move the mechanics: a force,
    a released block, an end stop, the weight of the load until a brake holds it.
    """
    spans = _falling_spans(trace, drive)
    pushing: dict[object, float] = {}
    for entry in trace.select(source=drive, kind="fault."):
        if not str(entry.data.get("fault", "")).startswith("mechanics."):
            continue
        number = entry.data.get("injection")
        if entry.kind == "fault.applied":
            pushing[number] = entry.time_ns * 1e-9
        elif entry.kind == "fault.removed" and number in pushing:
            spans.append((pushing.pop(number), entry.time_ns * 1e-9 + _AFTER_PUSH_S))
    spans += [(start, float("inf")) for start in pushing.values()]
    return spans + _stop_spans(trace, drive)


def _falling_spans(trace: Trace, drive: str) -> list[tuple[float, float]]:
    """Return when a load may fall, where the bench states its weight (`<drive>.gravity_n`): always, without a
    brake; else until the brake has closed.
    """
    if not trace.constants.get(f"{drive}.gravity_n"):
        return []
    if not trace.constants.get(f"{drive}.brake_torque_nm"):
        return [(0.0, float("inf"))]
    closing_s = trace.constants.get(f"{drive}.brake_closing_s", 0.0)
    return [
        (entry.time_ns * 1e-9, entry.time_ns * 1e-9 + closing_s + _AFTER_PUSH_S)
        for entry in trace.select(source=drive, kind="drive.state")
    ]


def _stop_spans(trace: Trace, drive: str) -> list[tuple[float, float]]:
    """Return when the axis touches an end stop, where the bench states
    its place (`<drive>.positive_stop`).
    """
    position = trace[f"{drive}.position"]
    slack = REST_TRAVEL.get(position.unit, 0.0001)
    low, high = trace.constants.get(f"{drive}.negative_stop"), trace.constants.get(f"{drive}.positive_stop")
    touching = np.zeros(len(position), dtype=bool)
    if low is not None:
        touching |= position.values <= low + slack
    if high is not None:
        touching |= position.values >= high - slack
    return [(start, end + _AFTER_PUSH_S) for start, end in _stretches(position.time_s, touching)]


def _stretches(times: NDArray[np.float64], flags: NDArray[np.bool_]) -> list[tuple[float, float]]:
    """Return first and last time of every run of true flags."""
    edges = np.flatnonzero(np.diff(np.concatenate(([False], flags, [False])).astype(np.int8)))
    return [
        (float(times[start]), float(times[end - 1]))
        for start, end in zip(edges[::2], edges[1::2], strict=True)
    ]


def check_motion_while_disabled(trace: Trace) -> list[Check]:
    """Without torque an axis coasts at most: it gets no faster, and once at rest it
    stays there (STP-331, C402-010).
    """
    checks = []
    for drive, word, without, requirements in _drives_without_torque(trace):
        position, velocity = trace[f"{drive}.position"], trace[f"{drive}.velocity"]
        stretches = _stretches(word.time_s, without)
        pushed = pushed_spans(trace, drive)
        jolts = [entry.time_ns * 1e-9 for entry in trace.select(source=drive, kind="fault.") if _jolts(entry)]
        problems = []
        for start, end in stretches:
            # A push makes the rest of its stretch a new story: it is judged from its end on.
            for begin, finish in _free_parts(start, end, pushed):
                jolted = any(begin - _JOLT_S <= when <= begin for when in jolts)
                entry = _speed_before(velocity, begin) if begin == start and not jolted else None
                if entry is not None and _commanded(trace, drive, begin):
                    entry = max(entry, abs(float(velocity.at(begin))))
                found = _part_problem(velocity.between(begin, finish), position.between(begin, finish), entry)
                if found is not None:
                    problems.append(found)
        problem = min(problems, default=None)
        checks.append(
            Check(
                name=f"no motion of {drive} without torque",
                verdict=Verdict.PASSED if problem is None else Verdict.FAILED,
                expected="coasting at most, no motion once at rest",
                observed=problem[1] if problem else f"{len(stretches)} stretches without torque",
                time_s=problem[0] if problem else None,
                requirements=requirements,
            )
        )
    return checks


def _drives_without_torque(trace: Trace) -> Iterator[tuple[str, Signal, NDArray[np.bool_], list[str]]]:
    """Return drives of either profile, with a signal for the times, where they show no
    torque, and what that concerns.
    """
    for drive in trace.components_with("statusword", "position", "velocity", "torque"):
        word = trace[f"{drive}.statusword"]
        yield drive, word, ~has_torque(word.values.astype(np.int64)), ["STP-331", "C402-010"]
    for drive in profidrive_axes(trace):
        yield (
            drive,
            trace[f"{drive}.drive_zsw2"],
            ~pulses_enabled(trace, drive),
            ["STP-331", "PD-104", "PD-107"],
        )


def _free_parts(start: float, end: float, pushed: list[tuple[float, float]]) -> list[tuple[float, float]]:
    """Return what is left of a stretch when the pushed times are cut out."""
    parts = []
    for begin, finish in sorted(pushed):
        if finish < start or begin > end:
            continue
        if begin > start:
            parts.append((start, begin))
        start = max(start, finish)
    if start <= end:
        parts.append((start, end))
    return parts


def _jolts(entry: Event) -> bool:
    return str(entry.data.get("fault", "")).startswith("encoder.") and entry.kind != "fault.armed"


def _speed_before(velocity: Signal, time_s: float) -> float | None:
    """Return the greatest speed with which the torque may have gone, from the two samples before."""
    index = int(np.searchsorted(velocity.time_s, time_s - 1e-10))
    if index < 2:
        return None
    last, earlier = abs(float(velocity.values[index - 1])), abs(float(velocity.values[index - 2]))
    return last + 1.5 * abs(last - earlier)


def commanded(speed: float, outputs: Iterable[float]) -> bool:
    """Return whether a motor speed may be what an axis commanded at last, give or take an overshoot; all of
    them in rpm.
    """
    return any(abs(speed) <= 1.2 * abs(output) and speed * output >= 0 for output in outputs)


def _commanded(trace: Trace, drive: str, time_s: float) -> bool:
    """Return whether a drive was commanded to get as fast as it is in the very
    sample in which its torque went.

    A setpoint that jumped (MotionIn) lets it take a good step in one sample.
    """
    if f"{drive}.motor_speed" not in trace:
        return False
    outputs = []
    for axis in trace.components_with("speed_output"):
        output = trace[f"{axis}.speed_output"]
        index = int(np.searchsorted(output.time_s, time_s - 1e-10))
        outputs += [float(value) for value in output.values[max(index - 3, 0) : index]]
    return commanded(float(trace[f"{drive}.motor_speed"].at(time_s)), outputs)


def _part_problem(velocity: Signal, position: Signal, entry: float | None) -> tuple[float, str] | None:
    """Return time and text of the first motion that coasting does not explain.

    Args:
        velocity: Samples without torque.
        position: The same.
        entry: Greatest speed at the begin; None: that of the first sample.

    """
    rest_speed = REST_SPEED.get(velocity.unit, 0.0005)
    rest_travel = REST_TRAVEL.get(position.unit, 0.0001)
    speed, times = np.abs(velocity.values), velocity.time_s
    moving = np.flatnonzero(speed > rest_speed)
    firsts = np.searchsorted(times, times[moving] - WINDOW_S[1]).tolist()
    lasts = np.searchsorted(times, times[moving] - WINDOW_S[0], side="right").tolist()
    for index, first, last in zip(moving.tolist(), firsts, lasts, strict=True):
        before = float(speed[first:last].max(initial=0.0))
        if first == 0:
            # Soon after the begin there is nothing earlier than the begin itself.
            before = max(before, float(speed[0]) if entry is None else entry)
        # In the sample in which the torque goes it may just have begun to move.
        slack = rest_speed if index else 4.0 * rest_speed
        if speed[index] > before * 1.02 + slack:
            text = f"{float(velocity.values[index]):.4g} {velocity.unit} after {before:.4g} {velocity.unit}"
            return float(times[index]), text
    for begin, finish in _stretches(times, speed <= rest_speed):
        if finish - begin < _REST_S:
            continue
        first = int(np.searchsorted(position.time_s, begin))
        displacement = np.abs(position.values[first:] - position.values[first])
        # Without friction a machine coasts on, however slowly it moved.
        creep = float(speed[(times >= begin) & (times <= begin + _REST_S)].min())
        coasted = creep * (position.time_s[first:] - begin)
        moved = np.flatnonzero(displacement > rest_travel + coasted)
        if len(moved):
            when, distance = float(position.time_s[first + moved[0]]), float(displacement[moved[0]])
            return when, f"moved by {distance:.4g} {position.unit} after coming to rest at {begin:.6f} s"
    return None


STEADY_STATES = {
    "enable_ramp",
    "standstill",
    "motion",
    "halting",
    "stopping",
    "stop_hold",
    "alarm_ramp",
    "disabling_ramp",
}


STOPS = {"halting", "stopping", "alarm_ramp", "disabling_ramp"}
"""States that brake with a ramp of the axis itself."""


def check_setpoint_continuity(trace: Trace) -> list[Check]:
    """The velocity setpoint changes no faster than the greatest configured (de)celeration (STP-239, STP-244).

    Needs the constants `<axis>.max_acceleration`, `<axis>.max_deceleration` and
    `<axis>.emergency_deceleration`. At a change of the axis state the generator may start again from
    actual values; the samples around it are not judged, but that a ramp which stops the axis begins
    among the velocities that it has or had a moment ago. Setpoints that the user program gives
    itself, or a leading value, are not judged (MC-568, SYN-107).
    """
    checks = []
    for axis in trace.components_with("velocity_setpoint", "state", "status_word"):
        limits = [
            trace.constants.get(f"{axis}.{name}")
            for name in ("max_acceleration", "max_deceleration", "emergency_deceleration")
        ]
        known = [limit for limit in limits if limit is not None]
        if len(known) < len(limits):
            continue
        signal = trace[f"{axis}.velocity_setpoint"]
        if len(signal) < 3:
            continue
        state = trace[f"{axis}.state"]
        steady = in_states(state, STEADY_STATES)
        # On a live bench late cycles are caught up in a burst; each of them is still one cycle of the
        # setpoint.
        step_s = np.maximum(np.diff(signal.time_s), trace.constants.get(f"{axis}.cycle_s", 0.0))
        bound = max(known) * step_s * 1.001 + 1e-6
        jump = np.abs(np.diff(signal.values))
        own = steady & ~given_from_outside(trace, axis)
        inside = own[1:] & own[:-1]
        judged = inside & no_change(trace, axis, signal)
        stopping = in_states(state, STOPS)
        steps = np.flatnonzero(inside & (judged | stopping[1:]) & (jump > bound))
        broken = [at for at in steps if judged[at] or not _starts_again(trace, axis, signal, int(at), bound)]
        index = int(broken[0]) if broken else None
        rates = (jump / step_s)[judged] if index is None else (jump / step_s)[broken]
        worst = float(rates.max(initial=0.0))
        checks.append(
            Check(
                name=f"continuity of {axis}.velocity_setpoint",
                verdict=Verdict.PASSED if index is None else Verdict.FAILED,
                expected=f"at most {max(known):g} {signal.unit}/s",
                observed=(
                    f"greatest {worst:.5g} {signal.unit}/s"
                    if index is None
                    else f"a step of {float(jump[index]):.5g} {signal.unit} in {float(step_s[index]):.4g} s"
                ),
                time_s=None if index is None else float(signal.time_s[index + 1]),
                value=worst,
                unit=f"{signal.unit}/s",
                high=max(known),
                requirements=["STP-239", "STP-244"],
            )
        )
    return checks


def _starts_again(trace: Trace, axis: str, setpoint: Signal, at: int, bound: NDArray[np.float64]) -> bool:
    """Return whether a step behind sample `at` ends between the setpoint before it and the actual velocities
    around it.
    """
    if f"{axis}.actual_velocity" not in trace:
        return True
    actual = trace[f"{axis}.actual_velocity"].values[max(at - 3, 0) : at + 2]
    near = [*map(float, actual[~np.isnan(actual)]), float(setpoint.values[at])]
    slack = float(bound[at])
    return min(near) - slack <= float(setpoint.values[at + 1]) <= max(near) + slack


def given_from_outside(trace: Trace, axis: str) -> NDArray[np.bool_]:
    """Return the samples in which the user program or a leading value gives setpoints: StatusWord.X31, X21
    and X22, StatusWord2.X6 and X1 (MIN-013, MIN-014, SYN-047, SYN-048).
    """
    return trace.once((given_from_outside, axis), lambda: _given_from_outside(trace, axis))


def _given_from_outside(trace: Trace, axis: str) -> NDArray[np.bool_]:
    word = trace[f"{axis}.status_word"]
    given = _bit(word, 31) | _bit(word, 21) | _bit(word, 22)
    name = f"{axis}.status_word2"
    return given | _bit(trace[name], 6) | _bit(trace[name], 1) if name in trace else given


def follows_actual(trace: Trace, axis: str) -> NDArray[np.bool_]:
    """Return the samples without position control, in which the position setpoint is the actual position:
    StatusWord.X28 (CTL-003).
    """
    return _bit(trace[f"{axis}.status_word"], 28)


def _bit(word: Signal, number: int) -> NDArray[np.bool_]:
    return np.asarray(word.values.astype(np.int64) >> number & 1, dtype=bool)


def no_change(trace: Trace, axis: str, signal: Signal) -> NDArray[np.bool_]:
    """Return which intervals between samples hold no change of state and no start of
    a job, nor follow one directly.
    """
    return trace.once((no_change, axis, signal.name), lambda: _no_change(trace, axis, signal))


def _no_change(trace: Trace, axis: str, signal: Signal) -> NDArray[np.bool_]:
    free = np.ones(len(signal) - 1, dtype=bool)
    for kind in ("axis.state", "axis.homed", "alarm.raised", "program.write", "job.active"):
        for entry in trace.select(source=axis, kind=kind):
            if kind == "job.active" and entry.data.get("instruction") != "MC_Stop":
                continue  # of the jobs only MC_Stop may start from actual values (STP-248)
            index = int(np.searchsorted(signal.time_s, entry.time_ns * 1e-9 - 1e-10))
            free[max(index - 2, 0) : index + 2] = False
    return free
