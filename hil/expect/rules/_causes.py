"""Rules about causes: nothing reacts without a cause in the trace, and no cause goes without its reaction."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Final

import numpy as np

from fieldbus.history import Event
from hil.expect.rules._definition import Flags, Judged, Numbers, Rule, differences, last_true, spread
from hil.expect.rules._views import CONTROLLED, AxisView, DriveView

_LED: Final = ("enable_ramp", "standstill", "motion", "halting", "stopping", "stop_hold")
_FAULT: Final = 1 << 3
_REQUESTED: Final = 1 << 9
_OPERATION: Final = 1 << 2


def _permitted(axis: AxisView) -> Numbers | None:
    """Return the permitted following error by the numbers of the bench (MON-038)."""
    names = (
        "FollowingError.MinValue",
        "FollowingError.MaxValue",
        "FollowingError.MinVelocity",
        "DynamicLimits.MaxVelocity",
    )
    values = [axis.number_over_time(name) for name in names]
    if any(one is None for one in values):
        return None
    low, high, from_, top = (one for one in values if one is not None)
    speed = np.abs(axis["velocity_setpoint"])
    span = np.maximum(top - from_, 1e-12)
    between = low + (high - low) * np.clip((speed - from_) / span, 0.0, 1.0)
    return np.where(speed <= from_, low, np.where(speed >= top, high, between))


def _permitted_error(axis: AxisView) -> Judged | None:
    if not axis.has("velocity_setpoint", "permitted_following_error", "state"):
        return None
    permitted = axis.once(_permitted)
    if permitted is None or axis.number("interpolator_s") is not None:
        return None
    shown = axis["permitted_following_error"]
    judged = ~axis.in_states("restarting") & ~axis.near(
        axis.whole.events.of(axis.name, "program.write"), 1, 2
    )
    unit = axis.unit("permitted_following_error")
    return Judged(
        axis.time_s,
        judged,
        judged & (np.abs(shown - permitted) > 1e-9 * (1.0 + np.abs(permitted))),
        lambda at: f"{shown[at]:.6g} {unit} in place of {permitted[at]:.6g}",
    )


PERMITTED_ERROR: Final = Rule(
    name="permitted following error",
    says="the permitted following error is constant up to its velocity and grows in proportion above",
    requirements=("MON-038", "MON-039"),
    tolerance="rounding",
    judge=_permitted_error,
    excused_by=("controller.",),
    recovery_cycles=3,
    live=True,
)


def _pending(axis: AxisView, *numbers: int) -> Flags:
    """Return the samples in which one of some alarms is pending, the cycle of its end included."""
    flags = np.zeros(len(axis.time_s), dtype=bool)
    raised: dict[object, int] = {}
    events = axis.whole.events.of(axis.name, "alarm.raised", "alarm.cleared")
    for entry in sorted(events, key=lambda one: one.time_ns):
        number = entry.data.get("number")
        if number not in numbers:
            continue
        at = axis.index_of(entry.time_ns)
        if entry.kind == "alarm.raised":
            raised.setdefault(number, at)
        elif number in raised:
            flags[raised.pop(number) : at + 1] = True
    for at in raised.values():
        flags[at:] = True
    return flags


def _raised_at(axis: AxisView, number: int) -> Flags:
    """Return the samples that first show an alarm."""
    flags = np.zeros(len(axis.time_s), dtype=bool)
    for entry in axis.whole.events.of(axis.name, "alarm.raised"):
        at = axis.index_of(entry.time_ns)
        if entry.data.get("number") == number and at < len(flags):
            flags[at] = True
    return flags


def _following_error_alarm(axis: AxisView) -> Judged | None:
    if not axis.has("following_error", "velocity_setpoint", "status_word", "state", "stw1"):
        return None
    enabled = axis.number_over_time("FollowingError.EnableMonitoring")
    permitted = axis.once(_permitted)
    if enabled is None or permitted is None or axis.number("interpolator_s") is not None:
        return None
    error = np.abs(axis["following_error"])
    watched = axis.in_states(*CONTROLLED) & ~axis.bit(28) & (axis.word("stw1") & 1 != 0)
    # A torque limit may suspend the monitoring of positions.
    watched &= ~axis.bit(26) & (enabled != 0)
    judged = watched & ~axis.near(
        axis.whole.events.of(axis.name, "program.write", "job.active", "axis.state"), 1, 1
    )
    too_large = error > permitted * (1.0 + 1e-9)
    broken = judged & too_large & ~_pending(axis, 521)
    came = _raised_at(axis, 521)
    # In the cycle of the alarm the controller may be open already: its error is that of the sample before.
    before = np.concatenate(([0.0], error[:-1]))
    step = np.abs(differences(error))
    near = np.maximum(error, before + np.maximum(step, np.concatenate(([0.0], step[:-1]))))
    early = came & (near < 0.9 * np.minimum(permitted, np.concatenate((permitted[:1], permitted[:-1]))))
    unit = axis.unit("following_error")
    return Judged(
        axis.time_s,
        judged | came,
        broken | early,
        lambda at: (
            f"alarm 521 at a following error of {near[at]:.5g} {unit}, {permitted[at]:.5g} are permitted"
            if early[at]
            else f"{error[at]:.5g} {unit} without alarm 521, {permitted[at]:.5g} are permitted"
        ),
    )


FOLLOWING_ERROR_ALARM: Final = Rule(
    name="alarm 521",
    says="alarm 521 comes in the cycle in which the following error exceeds the permitted one, and only then",
    requirements=("MON-040", "MON-043"),
    tolerance="10 % before, one cycle behind",
    judge=_following_error_alarm,
    excused_by=("controller.", "axis.alarm"),
    recovery_cycles=5,
)


def _drive_alarm(axis: AxisView) -> Judged | None:
    if not axis.has("zsw1", "state", "communication_ok"):
        return None
    word = axis.word("zsw1")
    fault = (word & _FAULT != 0) | (word & _REQUESTED == 0) | (word & _OPERATION == 0)
    around = spread(fault, 1, axis.ratio)
    found = []
    for entry in axis.whole.events.of(axis.name, "alarm.raised"):
        number, info = entry.data.get("number"), entry.data.get("info")
        at = axis.index_of(entry.time_ns)
        if number not in (421, 550) or at >= len(word) or info == 4:
            continue
        text = ""
        if number == 421 and not around[at]:
            text = f"alarm 421 with ZSW1 = {word[at]:04X}h, which shows a drive in operation"
        if number == 421 and info == 1 and not (word[max(at - 1, 0) : at + 2] & _FAULT != 0).any():
            text = f"alarm 421 (1) with ZSW1 = {word[at]:04X}h, which shows no fault"
        if number == 550 and (word[at] & 0x27) == 0x27:
            text = f"alarm 550 with ZSW1 = {word[at]:04X}h, which shows a drive in operation"
        found.append((entry.time_ns * 1e-9, text))
    return Judged.of_list(found) if found else None


DRIVE_ALARM: Final = Rule(
    name="alarms 421 and 550",
    says="alarm 421 needs a fault, a lost request or lost operation of the drive; alarm 550 a stop of it",
    requirements=("TA-020", "TA-018"),
    tolerance="a cycle",
    judge=_drive_alarm,
    excused_by=("axis.alarm",),
    recovery_s=0.1,
)


def _fault_noticed(axis: AxisView) -> Judged | None:
    if not axis.has("zsw1", "state"):
        return None
    led = axis.in_states(*_LED)
    word = axis.word("zsw1")
    fault = led & (word & _FAULT != 0)
    lasting = last_true(fault, axis.ratio)
    return Judged(
        axis.time_s,
        led,
        lasting & ~_pending(axis, 421, 411, 431, 550),
        lambda at: f"ZSW1 = {word[at]:04X}h shows a fault, and there is no alarm",
    )


FAULT_NOTICED: Final = Rule(
    name="fault of the drive",
    says="a fault in ZSW1 of a drive in operation raises an alarm at once",
    requirements=("TA-020",),
    tolerance="a cycle",
    judge=_fault_noticed,
    excused_by=("controller.",),
    recovery_cycles=5,
)


def _communication_alarm(axis: AxisView) -> Judged | None:
    if not axis.has("communication_ok", "zsw1", "state"):
        return None
    lost = (axis["communication_ok"] == 0) & (axis.word("zsw1") & _FAULT == 0)
    for entry in axis.whole.events.of(axis.drive_name, "link.down"):
        lost[axis.index_of(entry.time_ns) :][:1] = True
    found = []
    for entry in axis.whole.events.of(axis.name, "alarm.raised"):
        at = axis.index_of(entry.time_ns)
        if entry.data.get("number") != 431 or at >= len(lost) or entry.data.get("info") not in (1, 2):
            continue
        here = bool(lost[max(at - axis.ratio, 0) : at + 2].any())
        found.append((entry.time_ns * 1e-9, "" if here else "alarm 431, and the drive communicates"))
    return Judged.of_list(found) if found else None


COMMUNICATION_ALARM: Final = Rule(
    name="alarm 431",
    says="alarm 431 of the drive comes with the loss of its cyclic data only",
    requirements=("TA-020",),
    tolerance="a cycle",
    judge=_communication_alarm,
    excused_by=("axis.alarm",),
    recovery_s=0.1,
)


_ZERO: Final[Mapping[int, tuple[str, ...]]] = {
    304: ("DynamicLimits.MaxVelocity",),
    305: ("DynamicLimits.MaxAcceleration", "DynamicLimits.MaxDeceleration"),
    306: ("DynamicLimits.MaxJerk",),
}


def _limit_alarms(axis: AxisView) -> Judged | None:
    found = []
    for entry in axis.whole.events.of(axis.name, "alarm.raised"):
        number, at = int(entry.data.get("number") or 0), axis.index_of(entry.time_ns)
        if at >= len(axis.time_s):
            continue
        when = entry.time_ns * 1e-9
        if number in _ZERO:
            values = [axis.number_over_time(path) for path in _ZERO[number]]
            known = [one for one in values if one is not None]
            if len(known) == len(values):
                zero = any((one[max(at - 1, 0) : at + 2] <= 0.0).any() for one in known)
                found.append((when, "" if zero else f"alarm {number}, and the limit is not 0"))
        elif number in (533, 534, 104):
            active = axis.number_over_time("PositionLimits_SW.Active")
            low = axis.number_over_time("PositionLimits_SW.MinPosition")
            high = axis.number_over_time("PositionLimits_SW.MaxPosition")
            if active is None or low is None or high is None:
                continue
            near = slice(max(at - 1, 0), at + 2)
            text = (
                ""
                if active[near].any()
                else f"alarm {number}, and the software limit switches are not active"
            )
            if number == 104 and not (low[near] >= high[near]).any():
                text = "alarm 104, and the software limit switches are in order"
            found.append((when, text))
        elif number == 504 and axis.has("speed_output"):
            limit = None if axis.drive is None else axis.drive.number("max_speed_rpm")
            unit = axis.whole.numbers.get(f"{axis.name}.unit_per_rpm")
            if limit is None or unit is None:
                continue
            output = np.abs(axis["speed_output"][max(at - 1, 0) : at + 2]).max(initial=0.0)
            found.append(
                (when, "" if output > 0.5 * limit else f"alarm 504 at an output of {output:.5g} rpm")
            )
    return Judged.of_list(found) if found else None


LIMIT_ALARMS: Final = Rule(
    name="alarms of limits",
    says="an alarm about a limit needs a limit that is zero, wrong, active or reached",
    requirements=("LIM-004", "STP-607", "CTL-107"),
    tolerance="a cycle",
    judge=_limit_alarms,
    excused_by=("axis.alarm",),
    recovery_s=0.1,
    live=True,
)


_UNFOUNDED: Final = (421, 411, 431, 550, 401, 412, 106, 108, 201, 202, 203, 552, 102, 103)
"""Alarms of a device or of its bus: without a fault there is none."""
_ASK_ENCODERS: Final = ("MC_Home", "MC_MeasuringInput", "MC_MeasuringInputCyclic")
_OUTSIDE: Final = (
    "controller.state",
    "controller.initialised",
    "program.error",
)


def _unfounded_alarms(axis: AxisView) -> Judged | None:
    begin_s = _first_disturbance(axis)
    # An encoder answers a search for a mark that it does not have with an error.
    asked_s = _first(
        entry
        for entry in axis.whole.events.of(axis.name, "job.started")
        if entry.data.get("instruction") in _ASK_ENCODERS
    )
    found = []
    for entry in axis.whole.events.of(axis.name, "alarm.raised"):
        when, number = entry.time_ns * 1e-9, entry.data.get("number")
        if number in _UNFOUNDED and not (number == 411 and when >= asked_s):
            text = f"alarm {number} ({entry.data.get('text')}) without a fault" if when < begin_s else ""
            found.append((when, text))
    return Judged.of_list(found) if found else None


def _first_disturbance(view: AxisView | DriveView) -> float:
    """Return from when on something has disturbed the bench, s: a fault, a change of the controller."""
    return _first(view.whole.events.all("fault.applied", "fault.hit", *_OUTSIDE))


def _first(events: Iterable[Event]) -> float:
    """Return when the first of some events came, s; infinite without one."""
    return min((entry.time_ns * 1e-9 for entry in events), default=float("inf"))


UNFOUNDED_ALARMS: Final = Rule(
    name="alarms of devices",
    says="no alarm about drive, encoder, station or bus before a fault or a change of the controller",
    requirements=("TA-020",),
    tolerance="none",
    judge=_unfounded_alarms,
)

_EVENTS: Final = (
    "drive.fault",
    "emcy.raised",
    "drive.connection_lost",
    "drive.communication_lost",
    "drive.out_of_step",
    "drive.safety_message",
    "link.down",
    "link.node_lost",
    "link.heartbeat_lost",
    "drive.sync_jitter",
)


def _unfounded_events(drive: DriveView) -> Judged | None:
    begin_s = _first_disturbance(drive)
    if drive.axis is None or drive.axis.simulated.any():
        return None  # nobody leads the drive, or a case does with frames of its own
    found = []
    taken_s = _taken_over_s(drive)
    for entry in drive.whole.events.of(drive.name, *_EVENTS):
        if entry.kind == "drive.out_of_step" and not entry.data.get("lost"):
            continue
        when = entry.time_ns * 1e-9
        detail = entry.data.get("text") or entry.data.get("reason") or ""
        found.append(
            (
                when,
                f"{entry.kind} {detail} without a fault".replace("  ", " ")
                if taken_s <= when < begin_s
                else "",
            )
        )
    return Judged.of_list(sorted(found)) if found else None


def _taken_over_s(drive: DriveView) -> float:
    """Return from when on a drive is led, s: one of a vendor may take its commissioning for a fault."""
    if drive.number("standard_mapping") != 0.0:
        return 0.0
    booted = drive.whole.events.all("node.booted")
    return min((one.time_ns * 1e-9 for one in booted if one.data.get("name") == drive.name), default=0.0)


UNFOUNDED_EVENTS: Final = Rule(
    name="faults of the drive",
    says="a drive that an axis leads trips, errs or is lost only after a fault or a change of the controller",
    requirements=("C402-014", "PD-133"),
    tolerance="none",
    judge=_unfounded_events,
)

_LEAVES: Final = ("quick_stop_active", "fault_reaction_active", "fault")


def _left_operation(drive: DriveView) -> Judged | None:
    """A CiA 402 drive leaves operation by its control word or by a fault."""
    if not drive.has("controlword", "state"):
        return None
    begin_s = _first_disturbance(drive)
    word = drive.word("controlword")
    vocabulary = drive.whole.trace.vocabulary
    led = vocabulary is not None and drive.name in dict(vocabulary.drives).values()
    found = []
    for entry in drive.whole.events.of(drive.name, "drive.state"):
        if str(entry.data.get("from", "")).lower() != "operation enabled":
            continue
        when, at = entry.time_ns * 1e-9, drive.index_of(entry.time_ns)
        if when >= begin_s or at >= len(word):
            continue
        if not led and str(entry.data.get("to")).lower().startswith("fault"):
            continue  # no axis leads it: what is asked of it may be a fault
        told = (word[max(at - 1, 0) : at + 2] & 0x0F != 0x0F).any()
        found.append((when, "" if told else f"it goes to {entry.data.get('to')} with controlword 000Fh"))
    return Judged.of_list(found) if found else None


LEFT_OPERATION: Final = Rule(
    name="end of operation",
    says="a drive leaves operation by its control word only, as long as nothing was disturbed",
    requirements=("C402-026",),
    tolerance="a sample",
    judge=_left_operation,
)

AXIS_RULES: Final[tuple[Rule[AxisView], ...]] = (
    PERMITTED_ERROR,
    FOLLOWING_ERROR_ALARM,
    DRIVE_ALARM,
    FAULT_NOTICED,
    COMMUNICATION_ALARM,
    LIMIT_ALARMS,
    UNFOUNDED_ALARMS,
)
DRIVE_RULES: Final[tuple[Rule[DriveView], ...]] = (UNFOUNDED_EVENTS, LEFT_OPERATION)
