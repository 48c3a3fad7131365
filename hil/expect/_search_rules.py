"""Rules for generated programs: a sound axis comes up, stops after an alarm, and knows its position.

They hold for benches whose axes are sound and are enabled before anything else, which a shipped case about a
wrong configuration, for example, is not. So they do not judge every case.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Final

import numpy as np
from numpy.typing import NDArray

from fieldbus.history import Event
from hil.expect._base import pending_alarms
from hil.expect._motion_rules import REST_SPEED
from hil.expect._profidrive_rules import pulses_enabled
from hil.expect._words import has_torque
from hil.expect.golden import stop_time
from hil.record import Signal, Trace
from reports.model import Check, Verdict

_DRIVE_STOP_S: Final = 3.0
"""Longest stop that a drive makes by itself, coasting included, when the bench states none."""
_FORCES: Final = ("mechanics.",)
"""Kinds of faults that move an axis from outside; no bound can be calculated until `_FORCES_S` after them."""
_FORCES_S: Final = 0.5
_OTHER_RAMP: Final = ("frame.", "drive.", "encoder.", "telegram.", "safety.")
"""Kinds of faults after which the drive may stop by itself."""
_OTHER_RAMP_S: Final = 0.1
_FEEDBACK: Final = ("encoder.", "frame.", "telegram.", "modbus.truncate", "drive.power_off", "drive.sto")
"""Kinds of faults that displace the actual position."""
_FEEDBACK_S: Final = 0.1
_NEW_COORDINATES: Final = frozenset({"axis.homed", "axis.position_set", "link.up", "link.down"})
"""Events that may displace the coordinates of an axis."""
_INVALID: Final = 1 << 30
"""`StateDWord` of an NC axis: its actual values are those of the last telegram that came."""
_CORRECTED: Final = 1 << 20
"""`OpModeDWord` of an NC axis: a correction is added to its actual position."""
_CONTROLLER_S: Final = 1.0
"""A controller that does not run leaves the actual values as they were."""
_UP_S: Final = 0.2
"""Time that a drive may need until it is in operation, s."""
_UP_CYCLES: Final = 25
"""Cycles that the handshake of control and status word may take besides."""

Spans = list[tuple[float, float]]


def _fault_events(trace: Trace, kinds: tuple[str, ...]) -> list[Event]:
    return [entry for entry in trace.events if str(entry.data.get("fault", "")).startswith(kinds)]


def _fault_spans(trace: Trace, kinds: tuple[str, ...], after_s: float) -> Spans:
    """Return when faults of some kinds are active, or an event of theirs is at most `after_s` ago."""
    spans: Spans = []
    active: dict[object, float] = {}
    for entry in _fault_events(trace, kinds):
        now_s, number = entry.time_ns * 1e-9, entry.data.get("injection")
        spans.append((now_s, now_s + after_s))
        if entry.kind == "fault.applied":
            active[number] = now_s
        elif entry.kind == "fault.removed" and number in active:
            spans.append((active.pop(number), now_s))
    return spans + [(start, float("inf")) for start in active.values()]


def _inside(times: NDArray[np.float64], spans: Iterable[tuple[float, float]]) -> NDArray[np.bool_]:
    result = np.zeros(len(times), dtype=bool)
    for begin, end in spans:
        result |= (times >= begin) & (times <= end)
    return result


def _held(signal: Signal, times: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the last value of a signal at each of some times, not a number before its first sample."""
    if len(signal) == 0:
        return np.full(len(times), np.nan)
    index = np.searchsorted(signal.time_s, times + 1e-10, side="right") - 1
    return np.where(index >= 0, signal.values[np.maximum(index, 0)], np.nan)


def _torque(trace: Trace, drive: str) -> NDArray[np.bool_] | None:
    """Return where a drive gives torque by its words, or by its record; None: it has neither."""
    if f"{drive}.statusword" in trace:
        return has_torque(np.nan_to_num(trace[f"{drive}.statusword"].values).astype(np.int64))
    if f"{drive}.drive_zsw2" in trace:
        return pulses_enabled(trace, drive)
    return trace[f"{drive}.torque"].values != 0.0 if f"{drive}.torque" in trace else None


def _axes(trace: Trace) -> list[tuple[str, str]]:
    """Return the axes of the trace with their drives; a bench of another make may have just one of each."""
    pairs = {} if trace.vocabulary is None else dict(trace.vocabulary.drives)
    if not pairs:
        axes = trace.components_with("actual_position", "actual_velocity")
        drives = [name for name in trace.components_with("position", "velocity") if name not in axes]
        if len(axes) == len(drives) == 1:
            pairs = {axes[0]: drives[0]}
    return [(axis, drive) for axis, drive in pairs.items() if f"{drive}.velocity" in trace]


def _check(name: str, expected: str, problem: tuple[float, str] | None, requirements: list[str]) -> Check:
    return Check(
        name=name,
        verdict=Verdict.PASSED if problem is None else Verdict.FAILED,
        expected=expected,
        observed="so in every cycle" if problem is None else problem[1],
        time_s=None if problem is None else problem[0],
        requirements=requirements,
    )


def _bound_s(trace: Trace, axis: str, reaction: int, *, by_drive: bool) -> float:
    """Return how long the stop of a reaction may take, s."""
    constants = trace.constants
    drive_s = constants.get(f"{axis}.longest_drive_stop_s", _DRIVE_STOP_S)
    if by_drive:
        return max(drive_s, _DRIVE_STOP_S)
    if not 1 <= reaction <= 3:
        return drive_s
    slowest = constants.get(f"{axis}.deceleration", 1000.0)
    deceleration, jerk = {
        1: (slowest, constants.get(f"{axis}.jerk", 0.0)),
        2: (constants.get(f"{axis}.max_deceleration", slowest), constants.get(f"{axis}.max_jerk", 0.0)),
        3: (constants.get(f"{axis}.emergency_deceleration", slowest), 0.0),
    }[reaction]
    return stop_time(constants.get(f"{axis}.max_velocity", 500.0), deceleration, jerk) + 0.25


def _deadlines(trace: Trace, axis: str) -> list[tuple[float, float, int]]:
    """Return the alarms with a stop reaction: end of the alarm, latest end of the stop (s), number.

    A force from outside ends the deadlines of the alarms that are pending; a fault after which the drive may
    stop by itself gives it time again. While the enable is removed by reaction 4, a further alarm changes
    nothing: the stop of the drive goes on.
    """
    pushes = [entry.time_ns * 1e-9 for entry in _fault_events(trace, _FORCES)]
    others = [entry.time_ns * 1e-9 for entry in _fault_events(trace, _OTHER_RAMP)]
    pushed = _fault_spans(trace, _FORCES, _FORCES_S)
    other = _fault_spans(trace, _OTHER_RAMP, _OTHER_RAMP_S)
    result = []
    removed: list[tuple[float, float, float]] = []
    for raised_ns, cleared_ns, number, reaction in pending_alarms(trace, axis):
        raised_s, cleared_s = raised_ns * 1e-9, cleared_ns * 1e-9
        free = not any(begin <= raised_s <= end for begin, end in pushed)
        if not 1 <= reaction <= 4 or not free or any(raised_s <= when <= cleared_s for when in pushes):
            continue
        by_drive = any(begin <= raised_s <= end for begin, end in other)
        due_s = raised_s + _bound_s(trace, axis, reaction, by_drive=by_drive)
        due_s = max([when + _DRIVE_STOP_S for when in others if raised_s <= when <= cleared_s], default=due_s)
        due_s = max([due_s, *(due for begin, end, due in removed if begin <= raised_s <= end)])
        if reaction == 4:
            removed.append((raised_s, cleared_s, due_s))
        result.append((cleared_s, due_s, number))
    return result


def _moving_with_torque(trace: Trace, drive: str) -> NDArray[np.bool_]:
    velocity = trace[f"{drive}.velocity"]
    moving = np.abs(velocity.values) > 4 * REST_SPEED.get(velocity.unit, 0.0005)
    torque = _torque(trace, drive)
    return moving if torque is None else moving & torque


def check_rest_after_alarm(trace: Trace) -> list[Check]:
    """After an alarm with a stop reaction a drive with torque stands within the bound of that reaction
    (STP-348, STP-386 to STP-388).
    """
    checks = []
    for axis, drive in _axes(trace):
        velocity = trace[f"{drive}.velocity"]
        times = velocity.time_s
        moving = _moving_with_torque(trace, drive)
        moving &= ~_inside(times, _fault_spans(trace, _FORCES, _FORCES_S))
        problem: tuple[float, str] | None = None
        for cleared_s, due_s, number in _deadlines(trace, axis):
            late = np.flatnonzero(moving & (times > due_s) & (times < cleared_s))
            if len(late) and (problem is None or times[late[0]] < problem[0]):
                value = float(velocity.values[late[0]])
                text = f"still {value:.4g} {velocity.unit} when the stop of alarm {number} should be over"
                problem = float(times[late[0]]), text
        checks.append(
            _check(
                f"rest of {axis} after an alarm",
                "at rest when the stop of the reaction is over",
                problem,
                ["STP-348", "STP-386", "STP-387", "STP-388"],
            )
        )
    return checks


def undecided_until(trace: Trace) -> float:
    """Return up to when a moving axis has to be watched, s: the last deadline of a stop; 0: none."""
    latest = 0.0
    for axis, drive in _axes(trace):
        moving = _moving_with_torque(trace, drive)
        if len(moving) and moving[-1]:
            latest = max([latest, *(due for end, due, _ in _deadlines(trace, axis) if end > trace.end_s)])
    return latest


def check_comes_up(trace: Trace) -> list[Check]:
    """Enabled before anything else is asked of it, a sound axis comes into operation within a moment, without
    an alarm (STP-015, STP-030).
    """
    checks = []
    for axis, _drive in _axes(trace):
        if f"{axis}.power_enable" not in trace or f"{axis}.power_status" not in trace:
            continue
        enable, status = trace[f"{axis}.power_enable"], trace[f"{axis}.power_status"]
        on = np.flatnonzero(enable.values != 0)
        if len(on) == 0:
            continue
        begin_s = float(enable.time_s[on[0]])
        off = on[0] + np.flatnonzero(enable.values[on[0] :] == 0)
        withdrawn_s = float(enable.time_s[off[0]]) if len(off) else float("inf")
        up = np.flatnonzero(status.values != 0)
        up_s = float(status.time_s[up[0]]) if len(up) else float("inf")
        other_s = min([withdrawn_s, *(entry.time_ns * 1e-9 for entry in trace.events if _asks_more(entry))])
        alarms = [
            entry
            for entry in trace.select(source=axis, kind="alarm.raised")
            if entry.time_ns * 1e-9 < min(up_s, other_s) and entry.data.get("reaction") != 0
        ]
        bound_s = begin_s + _UP_S + _UP_CYCLES * trace.constants.get(f"{axis}.cycle_s", 0.004)
        problem = None
        if alarms:
            when_s = max(begin_s, alarms[0].time_ns * 1e-9)
            number, text = alarms[0].data.get("number"), alarms[0].data.get("text")
            problem = when_s, f"not enabled {when_s - begin_s:.3f} s after MC_Power, alarm {number} ({text})"
        elif bound_s < min(up_s, other_s, trace.end_s):
            problem = bound_s, f"not enabled {bound_s - begin_s:.3f} s after MC_Power, no alarm"
        checks.append(
            _check(f"{axis} comes up", "in operation after MC_Power", problem, ["STP-015", "STP-030"])
        )
    return checks


def _asks_more(entry: Event) -> bool:
    """Return whether an event may keep an axis disabled, or shows that it need not be enabled any more."""
    return entry.kind in {"fault.armed", "axis.restart"} or (
        entry.kind == "job.started" and entry.data.get("instruction") != "MC_Power"
    )


def check_feedback(trace: Trace) -> list[Check]:
    """The actual position of the axis follows the true position of the mechanics (STP-550).

    The offset between both is taken at rest, again after each event that may displace the coordinates.
    """
    checks = []
    for axis, drive in _axes(trace):
        if f"{axis}.actual_position" not in trace:
            continue
        actual, position = trace[f"{axis}.actual_position"], trace[f"{drive}.position"]
        scale = {("mm", "m"): 1000.0, ("mm", "mm"): 1.0, ("m", "m"): 1.0}.get((actual.unit, position.unit))
        if scale is None:
            continue
        checks.append(
            _check(
                f"position feedback of {axis}",
                "as the mechanics",
                _drifted(trace, axis, drive, scale),
                ["STP-550"],
            )
        )
    return checks


def _out_of_step(trace: Trace, drive: str) -> Spans:
    """Return when a stepper motor does not follow its pulses, which the axis takes for its position."""
    spans: Spans = []
    begin: float | None = None
    for entry in trace.select(source=drive, kind="drive."):
        if entry.kind == "drive.out_of_step" and begin is None:
            begin = entry.time_ns * 1e-9
        elif entry.kind == "drive.in_step" and begin is not None:
            spans.append((begin, entry.time_ns * 1e-9))
            begin = None
    return spans if begin is None else [*spans, (begin, float("inf"))]


_DELAY_CYCLES: Final = 4
"""Cycles that an actual position may be late."""


def _drifted(trace: Trace, axis: str, drive: str, scale: float) -> tuple[float, str] | None:
    """Return when actual and true position drift apart by more than the delay of the bus explains."""
    actual = trace[f"{axis}.actual_position"]
    times = actual.time_s
    true = _held(trace[f"{drive}.position"], times) * scale
    speed = np.abs(_held(trace[f"{drive}.velocity"], times)) * scale
    linked = np.ones(len(times), dtype=bool)
    if f"{axis}.communication_ok" in trace:
        linked = _held(trace[f"{axis}.communication_ok"], times) != 0
    if f"{axis}.state_dword" in trace:
        linked &= (trace[f"{axis}.state_dword"].values.astype(np.int64) & _INVALID) == 0
    if f"{axis}.op_mode_dword" in trace:
        linked &= (trace[f"{axis}.op_mode_dword"].values.astype(np.int64) & _CORRECTED) == 0
    disturbed = _inside(times, _fault_spans(trace, _FEEDBACK, _FEEDBACK_S))
    disturbed |= _inside(times, _fault_spans(trace, ("controller.",), _CONTROLLER_S))
    disturbed |= _inside(times, _out_of_step(trace, drive))
    # An encoder in error gives no position.
    disturbed |= _inside(
        times,
        [
            (raised_ns * 1e-9, cleared_ns * 1e-9)
            for raised_ns, cleared_ns, number, _ in pending_alarms(trace, axis)
            if number == 411
        ],
    )
    resets = sorted(
        entry.time_ns * 1e-9
        for entry in (
            *_fault_events(trace, (*_FEEDBACK, "controller.")),
            *(entry for entry in trace.events if entry.kind in _NEW_COORDINATES),
        )
    )
    # At a bounce off an end stop the speed of the moment is small, and the delayed position still far behind.
    recent = speed.copy()
    for ago in range(1, _DELAY_CYCLES + 1):
        recent[ago:] = np.fmax(recent[ago:], speed[:-ago])
    margin = recent * _DELAY_CYCLES * trace.constants.get(f"{axis}.cycle_s", 0.004) + 0.05
    if trace.constants.get(f"{axis}.Sensor[1].Backlash.Enable"):
        # What is added to the position by the direction of motion.
        margin += trace.constants.get(f"{axis}.Sensor[1].Backlash.Size", 0.0)
    # An encoder on the motor does not show where in its play the load is.
    margin += trace.constants.get(f"{drive}.backlash_m", 0.0) * (1000.0 if actual.unit == "mm" else 1.0)
    known = linked & ~disturbed & ~np.isnan(true) & ~np.isnan(speed)
    offset: float | None = None
    settle = 0
    place = 0
    for index, (when_s, difference) in enumerate(
        zip(times.tolist(), (actual.values - true).tolist(), strict=True)
    ):
        while place < len(resets) and resets[place] <= when_s + 1e-10:
            offset, settle, place = None, 5, place + 1
        if not known[index] or settle:
            settle = max(settle - 1, 0)
            offset = None
        elif offset is None:
            # Taken at rest only: in motion it would hold the delay of the bus.
            if speed[index] < 0.5:
                offset = difference
        elif abs(difference - offset) > margin[index]:
            return when_s, f"they have drifted apart by {difference - offset:.4g} {actual.unit}"
    return None
