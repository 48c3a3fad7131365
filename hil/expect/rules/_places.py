"""Rules about places: where and when a positioning is over, software limits, the homed state."""

from __future__ import annotations

from typing import Final, NamedTuple

import numpy as np

from fieldbus.history import Event
from hil.expect.rules._definition import Flags, Judged, Numbers, Rule, runs, spread
from hil.expect.rules._views import AxisView

_POSITIONINGS: Final = ("MC_MoveAbsolute", "MC_MoveRelative")
_MONITORED: Final = (*_POSITIONINGS, "MC_Halt")
_ENDS: Final = ("job.done", "job.aborted", "job.error")
_POSITIONING_ERROR: Final = 541
_LASTING_S: Final = 1.0
"""So long after another motion, or a change of limits and dynamic values, an axis need not stop in time."""
_NOT_REACHED, _LEFT = 1, 2
"""Info of alarm 541 (MON-018, MON-019)."""


class _Span(NamedTuple):
    """A job in control."""

    first: int
    behind: int
    begun: Event
    end: Event | None


class _Monitoring(NamedTuple):
    """Window of positioning monitoring, and its times, s."""

    window: float
    dwell: float
    tolerance: float


def _spans(axis: AxisView) -> list[_Span]:
    """Return the times in which monitored jobs have control; of a job that was started again its last one."""
    events = axis.whole.events
    started: dict[object, Event] = {}
    running: dict[object, tuple[int, Event]] = {}
    found: list[_Span] = []
    for entry in events.of(axis.name, "job.started", "job.active", *_ENDS):
        job = entry.data.get("job")
        if entry.kind == "job.started":
            started[job] = entry
            running.pop(job, None)
        elif entry.kind == "job.active" and job in started:
            running[job] = axis.index_of(entry.time_ns), started[job]
        elif job in running and entry.kind in _ENDS:
            first, begun = running.pop(job)
            found.append(_Span(first, axis.index_of(entry.time_ns), begun, entry))
    count = len(axis.time_s)
    found += [_Span(first, count, begun, None) for first, begun in running.values()]
    return [one for one in found if one.begun.data.get("instruction") in _MONITORED]


def _elsewhere(axis: AxisView) -> Flags:
    """Return where something else than a single job makes the position: a superimposed or synchronous motion,
    torque limits, no position control; or where the position is given another value.
    """
    count = len(axis.time_s)
    flags = axis.bit(22) | axis.bit(23) | axis.bit(26) | axis.bit(28) | axis.bit(31)
    if axis.has("status_word2"):
        flags |= axis.bit(6, "status_word2") | axis.bit(7, "status_word2")
    moved = axis.whole.events.of(axis.name, "axis.homed", "axis.position_set", "homing.started")
    flags |= axis.near(moved, 2, 2)
    return flags if len(flags) == count else np.ones(count, dtype=bool)


def _arrival(axis: AxisView) -> Judged | None:
    needed = ("position_setpoint", "actual_position", "velocity_setpoint", "status_word")
    window, dwell = (axis.number(f"PositioningMonitoring.{name}") for name in ("Window", "MinDwellTime"))
    tolerance = axis.number("PositioningMonitoring.ToleranceTime")
    if not axis.has_position or not axis.has(*needed) or None in {window, dwell, tolerance}:
        return None
    if axis.ratio != 1 or axis.restarted:
        return None
    monitoring = _Monitoring(window or 0.0, dwell or 0.0, tolerance or 0.0)
    elsewhere = _elsewhere(axis) | axis.gaps
    elsewhere[0] = False
    moving = axis["velocity_setpoint"] != 0.0
    taken_over = {entry.time_ns for entry in axis.whole.events.of(axis.name, "job.active")}
    alarms = {
        entry.time_ns: int(entry.data.get("info") or 0)
        for entry in axis.whole.events.of(axis.name, "alarm.raised")
        if entry.data.get("number") == _POSITIONING_ERROR
    }
    found: list[tuple[float, str]] = []
    for span in _spans(axis):
        if span.behind - span.first < 2 or elsewhere[max(span.first - 1, 0) : span.behind + 1].any():
            continue
        if span.begun.data.get("instruction") == "MC_Halt" and not moving[span.first]:
            continue  # there is nothing to brake, and no supervision (MC-232)
        # In the cycle of its end the setpoint may be that of the next job: MC_Stop begins with the actual
        # velocity.
        alone = span.end is None or span.end.time_ns not in taken_over
        text = _judge_arrival(axis, span, moving, monitoring, alarms, alone=alone)
        if text is not None:
            found.append((axis.time_s[min(span.behind, len(axis.time_s) - 1)], text))
    return Judged.of_list(found) if found else None


def _judge_arrival(
    axis: AxisView,
    span: _Span,
    moving: Flags,
    monitoring: _Monitoring,
    alarms: dict[int, int],
    *,
    alone: bool,
) -> str | None:
    """Return how the end of a job differs from what positioning monitoring makes of it; empty: not at all,
    None: nothing can be said.
    """
    window, dwell, tolerance = monitoring
    first, behind = span.first, min(span.behind, len(axis.time_s) - 1)
    travelled = np.flatnonzero(moving[first : behind + alone])
    if not len(travelled):
        return None
    rest = first + int(travelled[-1]) + 1
    ended = span.end
    done = ended is not None and ended.kind == "job.done"
    if rest > behind:
        return "Done while the setpoint moves" if done else None
    target = axis["position_setpoint"][rest]
    # A sample on the border is taken for either side.
    apart = np.abs(axis["actual_position"][rest : behind + 1] - target)
    inside = apart <= window * (1.0 + 1e-6)
    surely = apart <= window * (1.0 - 1e-6)
    cycles = int(np.ceil(dwell / axis.cycle_s - 1e-6))
    if done:
        ago = len(inside) - 1 - int(np.max(np.flatnonzero(~inside), initial=-1))
        if not inside[-1] or ago < cycles:
            return f"Done after {ago} cycles in the window of {window:g}; the dwell time is {cycles}"
    stays = _first_run(surely, max(cycles, 1))
    if stays is not None and len(surely) - 1 - stays > 4:
        return f"no Done {len(surely) - 1 - stays} cycles after the dwell time in the window"
    number = alarms.get(ended.time_ns) if ended is not None else None
    waited = len(inside) - 1
    allowed = int(np.ceil(tolerance / axis.cycle_s - 1e-6))
    if number == _NOT_REACHED and waited < allowed - 2:
        return f"alarm 541 after {waited} cycles outside of the window; the tolerance time is {allowed}"
    if number == _LEFT and not inside[:-1].any():
        return "alarm 541 with info 2, and the axis has not been in the window"
    if number is None and not inside.any() and waited > allowed + 3:
        return f"no alarm 541 after {waited} cycles outside of the window; the tolerance time is {allowed}"
    return "" if done or number is not None else None


def _first_run(flags: Flags, length: int) -> int | None:
    """Return the index at which so many flags in a row are true for the first time."""
    if len(flags) < length:
        return None
    sums = np.cumsum(np.concatenate(([0], flags.astype(np.int64))))
    full = np.flatnonzero(sums[length:] - sums[:-length] == length)
    return int(full[0]) + length - 1 if len(full) else None


ARRIVAL: Final = Rule(
    name="end of positioning",
    says="a positioning or halt is done when the actual position was in the window for the dwell time, not "
    "before; alarm 541 comes after the tolerance time, and only then",
    requirements=("MON-016", "MON-017", "MON-018", "MON-019", "MC-261", "MC-231"),
    tolerance="four cycles late, none early; the alarm two cycles",
    judge=_arrival,
    excused_by=("controller.", "axis.alarm"),
    recovery_cycles=3,
)


_POSITIVE, _NEGATIVE, _SHORTEST = 1, 2, 3
"""Direction of MC_MoveAbsolute on a modulo axis."""


def _ways(direction: object, begins: Numbers, target: float, length: float) -> Numbers:
    """Return the ways to a place in a modulo range, from each of some positions."""
    ahead = (target - begins) % length
    # A place that is reached but for rounding is no whole turn away.
    ahead = np.where(np.minimum(ahead, length - ahead) < 1e-6 * length, 0.0, ahead)
    behind = np.where(ahead > 0.0, ahead - length, 0.0)
    if direction == _SHORTEST:
        return np.where(ahead > 0.5 * length * (1.0 + 1e-6), behind, ahead)
    return behind if direction == _NEGATIVE else ahead


def _target(axis: AxisView) -> Judged | None:
    if not axis.has("position_setpoint", "status_word") or axis.restarted:
        return None
    modulo = axis.number("Modulo.Enable")
    if modulo is None and not axis.off("Modulo.Enable"):
        return None
    length = (axis.number("Modulo.Length") or 0.0) if modulo else 0.0
    elsewhere = _elsewhere(axis)
    setpoint = axis["position_setpoint"]
    scale = max(float(np.abs(setpoint).max(initial=0.0)), length, 1e-9)
    taken_over = {entry.time_ns for entry in axis.whole.events.of(axis.name, "job.active")}
    found: list[tuple[float, str]] = []
    for span in _spans(axis):
        asked, end = span.begun.data, span.end
        instruction = asked.get("instruction")
        if end is None or end.kind != "job.done" or instruction not in _POSITIONINGS:
            continue
        behind = min(span.behind, len(setpoint) - 1)
        if elsewhere[max(span.first - 1, 0) : behind + 1].any():
            continue
        # A slow interpolator has made the first setpoints of a buffered job when the one before is done.
        reached = float(setpoint[behind - 1 if axis.ratio > 1 and end.time_ns in taken_over else behind])
        begins = setpoint[max(span.first - 1, 0) : span.first + axis.ratio + 1]
        if instruction == "MC_MoveAbsolute" and "direction" in asked:
            if not length:
                continue
            target = float(asked["position"] or 0.0)
            ways = begins + _ways(asked["direction"], begins, target, length)
            # In motion it is one of these positions that decides.
            wrong = float(np.abs(ways - reached).min()) > 1e-6 * scale
            text = f"{instruction} to {target:.6g} from {begins[-1]:.6g} is done at {reached:.6g}"
            found.append((axis.time_s[behind], text if wrong else ""))
            continue
        if instruction == "MC_MoveAbsolute" and "position" in asked:
            begins = np.zeros(1)
            way = float(asked["position"] or 0.0)
        elif instruction == "MC_MoveRelative" and "distance" in asked:
            # In motion the position at which the job takes over is that of one of these samples.
            way = float(asked["distance"] or 0.0)
        else:
            continue
        wanted = float(begins[-1]) + way
        begun = reached - way
        wrong = not begins.min() - 1e-6 * scale <= begun <= begins.max() + 1e-6 * scale
        text = f"{instruction} is done at {reached:.6g} and not at {wanted:.6g}" if wrong else ""
        found.append((axis.time_s[behind], text))
    return Judged.of_list(found) if found else None


TARGET: Final = Rule(
    name="target of positioning",
    says="a positioning ends where it was to go",
    requirements=("MC-249", "MC-255", "MC-256", "MC-277", "MC-284"),
    tolerance="rounding",
    judge=_target,
    excused_by=("controller.",),
    recovery_cycles=3,
)


_MODULO: Final = (
    ("position_setpoint", "modulo_position", "modulo_cycle"),
    ("actual_position", "actual_modulo_position", "actual_modulo_cycle"),
)
"""Columns: a position that grows without end, its place in the range, and its cycle."""


def _modulo_range(axis: AxisView) -> Judged | None:
    if not axis.has("modulo_position", "modulo_cycle", "actual_modulo_position", "actual_modulo_cycle"):
        return None
    enabled, length, start = (
        axis.number_over_time(f"Modulo.{name}") for name in ("Enable", "Length", "StartValue")
    )
    if enabled is None or length is None or start is None:
        return None
    judged = (enabled != 0.0) & (length > 0.0) & ~spread(axis.in_states("restarting"), 1, 2)
    broken = np.zeros(len(judged), dtype=bool)
    for whole, place, cycle in _MODULO:
        near = 1e-8 * length + 1e-12 * np.abs(axis[whole])
        broken |= np.abs(axis[cycle] * length + axis[place] - axis[whole]) > near
        broken |= (axis[place] < start - near) | (axis[place] >= start + length)
        broken |= axis[cycle] != np.rint(axis[cycle])

    def describe(at: int) -> str:
        texts = [
            f"{axis[whole][at]:.8g} is place {axis[place][at]:.8g} of cycle {axis[cycle][at]:g}"
            for whole, place, cycle in _MODULO
        ]
        return f"setpoint {texts[0]}, actual position {texts[1]}"

    return Judged(axis.time_s, judged, judged & broken, describe)


MODULO_RANGE: Final = Rule(
    name="modulo range",
    says="setpoint and actual position are a place within the modulo range, and so many ranges below it",
    requirements=("CFG-097", "CFG-098", "CFG-101"),
    tolerance="rounding",
    judge=_modulo_range,
    excused_by=("controller.",),
    recovery_cycles=3,
)


class _Limits(NamedTuple):
    """Software limits in force."""

    low: Numbers
    high: Numbers
    acts: Flags
    """The axis is homed, and the limits are active."""

    @property
    def near(self) -> Numbers:
        """What a position may differ from a limit by rounding."""
        return 1e-6 * (self.high - self.low)


def _limits(axis: AxisView) -> _Limits | None:
    if not axis.has("position_setpoint", "status_word") or not axis.off("Modulo.Enable") or axis.restarted:
        return None
    active, low, high = (
        axis.number_over_time(f"PositionLimits_SW.{name}")
        for name in ("Active", "MinPosition", "MaxPosition")
    )
    if active is None or low is None or high is None or not active.any():
        return None
    acts = (active != 0.0) & axis.bit(5) & (low < high)
    return _Limits(low, high, ~spread(~acts, 2, 2))


def _limit_bits(axis: AxisView) -> Judged | None:
    limits = _limits(axis)
    if limits is None:
        return None
    setpoint = axis["position_setpoint"]
    near = limits.near
    reach = axis.ratio + 1
    below, above = axis.bit(15), axis.bit(16)
    wrong = (below & ~spread(setpoint <= limits.low + near, reach, reach)) | (
        above & ~spread(setpoint >= limits.high - near, reach, reach)
    )
    missing = (~below & ~spread(setpoint > limits.low - near, reach, reach)) | (
        ~above & ~spread(setpoint < limits.high + near, reach, reach)
    )
    controlled = ~spread(axis.bit(28) | ~axis.bit(0), reach, reach)
    judged = limits.acts & controlled

    def describe(at: int) -> str:
        shown = f"X15 {int(below[at])}, X16 {int(above[at])}"
        return f"{shown} at {setpoint[at]:.6g} with limits {limits.low[at]:g} and {limits.high[at]:g}"

    return Judged(axis.time_s, judged, judged & (wrong | missing), describe)


LIMIT_BITS: Final = Rule(
    name="bits of software limits",
    says="X15 and X16 are set while the position setpoint is at or beyond the software limit, and only then",
    requirements=("LIM-082", "LIM-083", "DIA-039", "DIA-040"),
    tolerance="a cycle",
    judge=_limit_bits,
    excused_by=("controller.",),
    recovery_cycles=3,
)


def _limit_passed(axis: AxisView) -> Judged | None:
    limits = _limits(axis)
    if limits is None:
        return None
    setpoint = axis["position_setpoint"]
    near = limits.near
    out = (setpoint > limits.high + near) | (setpoint < limits.low - near)
    passed = out & ~np.concatenate(([True], out[:-1]))
    events = axis.whole.events
    changes = [
        entry
        for entry in events.of(axis.name, "program.write")
        if str(entry.data.get("variable")).startswith(("PositionLimits", "Dynamic", "Override"))
    ]
    if axis.number("PositionLimits_SW.LimitReachedBehavior") != 0.0:
        changes += events.of(axis.name, "job.active")  # one that brakes less may come too late (LIM-084)
    jobs = axis.bit(8) | axis.bit(9) | axis.bit(10)
    # Something has to be on its way, and nothing else than jobs with dynamic values that are known.
    lasting = np.zeros(len(setpoint), dtype=bool)
    for first, behind in runs(_elsewhere(axis) | axis.bit(11) | axis.near(changes)):
        lasting[max(first - 2, 0) : behind + round(_LASTING_S / axis.cycle_s)] = True
    judged = limits.acts & ~lasting & (jobs | passed) & axis.in_states("motion", "halting", "alarm_ramp")
    return Judged(
        axis.time_s,
        judged,
        judged & passed,
        lambda at: (
            f"the setpoint goes on to {setpoint[at]:.6g}, beyond {limits.low[at]:g} or {limits.high[at]:g}"
        ),
    )


LIMIT_PASSED: Final = Rule(
    name="software limits",
    says="a motion by jobs of the axis ends at the software limit",
    requirements=("LIM-075", "LIM-077", "LIM-079"),
    tolerance="rounding; not judged with other motions than jobs, and after changes of limits and dynamics",
    judge=_limit_passed,
    excused_by=("controller.", "axis.alarm"),
    recovery_s=2.0,
)


def _homed(axis: AxisView) -> Judged | None:
    if not axis.has_position or not axis.has("status_word"):
        return None
    shown = axis.bit(5)
    before = np.concatenate((shown[:1], shown[:-1]))
    events = axis.whole.events
    reach = axis.ratio + 1
    homed = events.of(axis.name, "axis.homed")
    begun = [
        entry
        for entry in events.of(axis.name, "job.started", "job.active")
        if entry.data.get("instruction") == "MC_Home"
    ]
    other_play = [
        entry
        for entry in events.of(axis.name, "program.write")
        if ".Backlash." in str(entry.data.get("variable"))
    ]
    lost = [*begun, *other_play, *events.of(axis.name, "alarm.raised", "homing.started")]
    other = [
        *events.of(axis.name, "axis.adaption"),
        *events.all("controller.state", "controller.initialised"),
    ]
    rises = shown & ~before & ~axis.near(homed, reach, reach)
    falls = before & ~shown & ~axis.near(lost, reach, reach)
    missing = axis.near(homed, 0, 0)
    late = (
        np.concatenate((np.zeros(reach, dtype=bool), missing[:-reach])) if len(missing) > reach else missing
    )
    # Another homing may begin in the cycle in which one ends.
    again = axis.near(events.of(axis.name, "homing.started"), 0, 2 * reach)
    unshown = late & ~spread(shown, 0, reach) & ~again
    judged = ~spread(axis.in_states("restarting"), 2, 3) & ~axis.near(other, 2, 3)

    def describe(at: int) -> str:
        if unshown[at]:
            return "X5 is not set after homing"
        return "X5 is set without homing" if rises[at] else "X5 falls without a cause"

    return Judged(axis.time_s, judged, judged & (rises | falls | unshown), describe)


HOMED: Final = Rule(
    name="homed bit",
    says="X5 is set by a homing that has found its place; a homing, a restart, a fault or another backlash "
    "resets it",
    requirements=("MC-215", "MC-216", "DIA-030", "VAR-152"),
    tolerance="a cycle",
    judge=_homed,
    excused_by=(
        "controller.", "encoder.", "drive.", "frame.", "telegram.", "can.", "modbus.", "io.", "pto.",
    ),
    recovery_s=1.0,
)  # fmt: skip

AXIS_RULES: Final[tuple[Rule[AxisView], ...]] = (
    ARRIVAL,
    TARGET,
    MODULO_RANGE,
    LIMIT_BITS,
    LIMIT_PASSED,
    HOMED,
)
