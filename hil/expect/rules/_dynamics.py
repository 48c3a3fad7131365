"""Rules about the dynamics of a drive: what its torque does to the machine, and that the motor follows."""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from hil.expect.rules._definition import Flags, Judged, Numbers, Rule, differences, last_true, spread
from hil.expect.rules._views import AxisView, DriveView

_SLOW_M_S: Final = 2e-3
"""Below it dry friction may hold the load, m/s."""
_NEAR_STOP_M: Final = 2e-3
"""Distance from an end stop at which its spring cannot act yet, m."""
_DISTURBED: Final = ("mechanics.", "encoder.", "telegram.", "frame.", "can.", "modbus.", "drive.", "safety.")
_SMOOTH: Final = 0.2
"""Share of the rated torque by which it may change within three cycles."""
_SAME: Final = 1e-9


def _extremes(values: Numbers, before: int, behind: int) -> tuple[Numbers, Numbers]:
    """Return the least and the greatest of each sample and so many around it."""
    low, high = values.copy(), values.copy()
    seen = 1
    while seen <= before:
        # Two windows side by side, or one over the other, make one twice as wide at most.
        step = min(seen, before + 1 - seen)
        low[step:] = np.minimum(low[step:], low[:-step])
        high[step:] = np.maximum(high[step:], high[:-step])
        seen += step
    if behind:
        low, high = (_extremes(one[::-1], behind, 0)[place][::-1] for place, one in enumerate((low, high)))
    return low, high


def _momentum(drive: DriveView) -> Judged | None:
    names = ("moved_kg", "coulomb_friction_n", "viscous_friction_n_per_m_s", "lead_m", "gear_ratio")
    known = [one for one in map(drive.number, names) if one is not None]
    if len(known) < len(names) or drive.number("backlash_m") != 0.0 or len(drive.time_s) < 6:
        return None
    if not drive.has("velocity", "torque", "position") or drive.unit("velocity") != "m/s":
        return None
    if drive.number("cia402") is None and drive.number("telegram") is None:
        return None  # pulses and voltages: the torque of such a drive is not that of its last step
    if not drive.number("interpolation") or (drive.number("telegram") is not None and drive.axis is None):
        # Its demand may step in every cycle, that of a motor potentiometer for example, and the torque is
        # another one between two samples.
        return None
    mass, dry, viscous, lead_m, ratio = known
    cycle_s, v = drive.whole.cycle_s, drive["velocity"]
    force = drive["torque"] * (math.tau * ratio / lead_m) + (drive.number("gravity_n") or 0.0)
    low, high = _extremes(force, 2, 1)
    # Between two samples the torque may have been beyond both of them, and is so where the demand steps.
    more = 0.5 * (high - low) + 0.01 * np.abs(force) + 1.0
    if drive.has("velocity_demand"):
        asked = differences(drive["velocity_demand"]) * (lead_m / (60.0 * ratio)) / cycle_s
        least, most = _extremes(asked, 2, 1)
        more = more + mass * (most - least)
    smooth = high - low <= _SMOOTH * (drive.number("rated_torque_nm") or 0.0) * abs(math.tau * ratio / lead_m)
    rubbing = np.sign(v) * dry + viscous * v
    gained = differences(v) / cycle_s
    expected = (force - rubbing) / mass
    judged = (np.abs(v) > _SLOW_M_S) & smooth
    judged[1:] &= judged[:-1] & (np.sign(v[1:]) == np.sign(v[:-1]))
    judged &= np.abs(np.diff(drive.time_s, prepend=-1.0) - cycle_s) < 1e-3 * cycle_s
    judged &= _free_way(drive, 1)
    if drive.has("brake_closed"):
        judged &= ~spread((drive["brake_closed"] != 0) | (differences(drive["brake_closed"]) != 0.0), 2, 2)
    if drive.has("mode"):
        # Positions from the bus: the demand of the speed steps in every cycle, and with it the torque.
        judged &= ~drive.shows("mode", "csp", "ip")
    under, over = (low - more - rubbing) / mass, (high + more - rubbing) / mass
    slack = 0.02 * np.abs(expected) + 0.05
    broken = judged & ((gained < under - slack) | (gained > over + slack))
    return Judged(
        drive.time_s,
        judged,
        broken,
        lambda at: (
            f"{gained[at]:.4g} m/s2 with {drive['torque'][at]:.4g} Nm, which makes {expected[at]:.4g} m/s2"
        ),
    )


MOMENTUM: Final = Rule(
    name="force and acceleration",
    says="the load is accelerated by torque and weight less friction, over its mass, by the bench file",
    requirements=("STP-014", "STP-550"),
    tolerance="what the torque of the samples around it leaves open, 2 % and 0.05 m/s2; not with play, "
    "at end stops, below 2 mm/s, with positions from the bus, with a demand that steps once in a cycle",
    judge=_momentum,
    excused_by=_DISTURBED,
    recovery_s=0.3,
)


def _saturated(drive: DriveView) -> Flags:
    """Return where the torque stands at a value: the one that limits it."""
    demand = drive["torque_demand"]
    still = np.abs(differences(demand)) <= _SAME * (1.0 + np.abs(demand))
    return last_true(still & (demand != 0.0), 2)


def _strained(drive: DriveView) -> Flags | None:
    """Return where the torque may be at a limit that keeps the motor from its speed; None: the limit may be
    any, because an axis or a tool has set one.
    """
    axis, rated = drive.axis, drive.number("rated_torque_nm")
    if axis is None or rated is None or not drive.has("torque_demand"):
        return None
    if axis.whole.events.of(axis.name, "axis.torque_limit", "axis.torque_range"):
        return None
    return _saturated(drive) & (np.abs(drive["torque_demand"]) > 0.2 * rated)


_OPERATION: Final = ("operation_enabled", "s4_operation")
_TORQUE_MODES: Final = ("tq", "cst")


def _led_by_speed(drive: DriveView) -> Flags:
    """Return where a drive controls its speed."""
    led = last_true(drive.in_states(*_OPERATION), 2)
    if drive.has("mode"):
        led &= ~drive.shows("mode", *_TORQUE_MODES)
    return led


def _pushes(drive: DriveView) -> Judged | None:
    top = drive.number("max_speed_rpm")
    columns = ("torque_demand", "velocity_demand", "motor_speed", "state")
    if not top or not drive.has(*columns) or len(drive.time_s) < 6:
        return None
    apart = drive["velocity_demand"] - drive["motor_speed"]
    # From where the demand was a moment ago the controller may still come.
    low, high = _extremes(apart, 4, 0)
    torque = drive["torque_demand"]
    sure = np.abs(torque) > 0.02 * (drive.number("rated_torque_nm") or np.inf)
    judged = _saturated(drive) & _led_by_speed(drive) & sure
    judged &= (low > 0.03 * top) | (high < -0.03 * top)
    return Judged(
        drive.time_s,
        judged,
        judged & (torque * apart < 0.0),
        lambda at: f"{torque[at]:.4g} Nm, and the speed is to change by {apart[at]:.4g} rpm",
    )


PUSHES: Final = Rule(
    name="torque at its limit",
    says="a torque at its limit brings the speed towards its demand",
    requirements=("STP-183", "C402-212"),
    tolerance="judged while the speed is at least 3 % of the greatest one apart from its demand",
    judge=_pushes,
    excused_by=("drive.", "safety.", "encoder.", "mechanics."),
    recovery_cycles=5,
)

_STEADY_S: Final = 0.1
"""So long a demand has to stand until the motor has its speed, s."""


def _steady(values: Numbers, near: float, count: int) -> Flags:
    """Return where a value has kept within a range during so many samples."""
    if len(values) <= count:
        return np.zeros(len(values), dtype=bool)
    low, high = _extremes(values, count, 0)
    result = high - low <= near
    result[:count] = False
    return result


def _motor_follows(drive: DriveView) -> Judged | None:
    top = drive.number("max_speed_rpm")
    columns = ("torque_demand", "velocity_demand", "motor_speed", "state", "torque")
    if not top or not drive.has(*columns) or drive.number("moved_kg") is None:
        return None
    strained = _strained(drive)
    if strained is None:
        return None
    count = int(np.ceil(_STEADY_S / drive.whole.cycle_s))
    demand, speed = drive["velocity_demand"], drive["motor_speed"]
    judged = _steady(demand, 1e-4 * top, count) & last_true(_led_by_speed(drive), count)
    judged &= ~spread(strained, 0, min(count, len(demand) - 1))
    judged &= _free_way(drive, count)
    off = np.abs(speed - demand)
    return Judged(
        drive.time_s,
        judged,
        judged & (off > 0.02 * np.abs(demand) + 0.005 * top),
        lambda at: f"{speed[at]:.5g} rpm, {demand[at]:.5g} rpm are demanded",
    )


def _free_way(drive: DriveView, count: int) -> Flags:
    """Return where the load has been away from its end stops for so many samples."""
    free = np.ones(len(drive.time_s), dtype=bool)
    if drive.has("position"):
        for side, sign in (("negative_stop", 1.0), ("positive_stop", -1.0)):
            place = drive.number(side)
            if place is not None:
                free &= sign * (drive["position"] - place) > _NEAR_STOP_M
    return last_true(free, min(count, len(free) - 1))


MOTOR_FOLLOWS: Final = Rule(
    name="speed of the motor",
    says="the motor has the speed that is demanded of it, once that has stood for 0.1 s",
    requirements=("C402-101", "PD-005"),
    tolerance="2 %, and 0.5 % of the greatest speed; not judged at the limit of the torque or at an end stop",
    judge=_motor_follows,
    excused_by=("drive.", "safety.", "encoder.", "mechanics."),
    recovery_s=0.5,
)

DRIVE_RULES: Final[tuple[Rule[DriveView], ...]] = (MOMENTUM, PUSHES, MOTOR_FOLLOWS)


def _turns_as_put_out(axis: AxisView) -> Judged | None:
    drive = axis.drive
    if drive is None or not axis.has("speed_output", "in_operation", "state", "stw1"):
        return None
    top = drive.number("max_speed_rpm")
    if not top or not drive.has("motor_speed") or len(drive.time_s) < 2:
        return None
    if axis.restarted or not axis.off("PositionControl.EnableDSC"):
        return None  # with control in the drive the output is not all of its demand
    count = int(np.ceil(_STEADY_S / axis.cycle_s))
    output = np.clip(axis["speed_output"], -top, top)
    at = np.clip(np.searchsorted(drive.time_s, axis.time_s, side="right") - 1, 0, len(drive.time_s) - 1)
    speed = drive["motor_speed"][at]
    led = (axis["in_operation"] != 0) & (axis.word("stw1") & 1 != 0) & ~axis.simulated
    led &= axis.in_states("standstill", "motion", "halting", "stop_hold")
    strained = _strained(drive)
    if strained is not None:
        led &= ~strained[at]
    elif drive.has("torque_demand"):
        return None
    led &= _free_way(drive, 1)[at]
    judged = _steady(output, 0.002 * top, count) & last_true(led & ~axis.gaps, min(count, len(led) - 1))
    off = np.abs(speed - output)
    return Judged(
        axis.time_s,
        judged,
        judged & (off > 0.03 * np.abs(output) + 0.01 * top),
        lambda k: f"the motor turns at {speed[k]:.5g} rpm, the axis puts out {output[k]:.5g} rpm",
    )


TURNS: Final = Rule(
    name="motor of the axis",
    says="the motor turns as the axis puts out, once that has stood for 0.1 s",
    requirements=("CTL-038", "STP-054"),
    tolerance="3 %, and 1 % of the greatest speed; not judged at the limit of the torque or at an end stop",
    judge=_turns_as_put_out,
    excused_by=(
        "drive.",
        "safety.",
        "encoder.",
        "mechanics.",
        "frame.",
        "telegram.",
        "can.",
        "modbus.",
        "controller.",
        "io.",
        "pto.",
        "terminal.",
    ),
    recovery_s=0.5,
)

_SETTLE_S: Final = 1.0
"""So long ago a following error may have its cause, s."""
_FOLLOWING: Final = 521
_DEMANDING: Final = (
    "MC_MotionIn",
    "MC_SetSensor",
    "MC_Torque",
    "MC_Gear",
    "MC_Cam",
    "MC_Phasing",
    "MC_Offset",
)
"""Instructions by which a setpoint may go where the axis cannot follow."""


def _trips(axis: AxisView) -> Judged | None:
    raised = [
        entry
        for entry in axis.whole.events.of(axis.name, "alarm.raised")
        if entry.data.get("number") == _FOLLOWING
    ]
    drive = axis.drive
    if not raised or drive is None or not drive.has("torque_demand", "torque") or axis.restarted:
        return None
    top = drive.number("max_speed_rpm")
    if not top or not axis.has("speed_output"):
        return None
    events = axis.whole.events
    causes = events.all("fault.applied", "fault.hit", "controller.state", "drive.fault", "drive.warning")
    causes += events.of(axis.name, "program.write", "axis.torque_limit", "axis.torque_range", "axis.sensor")
    causes += [
        entry
        for entry in events.of(axis.name, "job.started")
        if str(entry.data.get("instruction")).startswith(_DEMANDING)
    ]
    first_s = min((entry.time_ns for entry in causes), default=10**18) * 1e-9
    limited = _saturated(drive) & (np.abs(drive["torque_demand"]) > 0.0)
    found = []
    for entry in raised:
        when = entry.time_ns * 1e-9
        if when > first_s:
            break
        near = (drive.time_s > when - _SETTLE_S) & (drive.time_s <= when)
        if np.abs(axis["speed_output"][: axis.index_of(entry.time_ns)]).max(initial=0.0) > 0.9 * top:
            break
        stuck = bool((limited & near).any()) or not bool(_free_way(drive, 0)[near].all())
        found.append((when, "" if stuck else "alarm 521 of a sound axis whose torque has had no limit"))
    return Judged.of_list(found) if found else None


TRIPS: Final = Rule(
    name="cause of alarm 521",
    says="before any fault, assignment or torque limit alarm 521 comes only at the limit of the torque or at "
    "an end stop",
    requirements=("MON-040", "STP-054"),
    tolerance="a second",
    judge=_trips,
    excused_by=("axis.alarm",),
)

AXIS_RULES: Final[tuple[Rule[AxisView], ...]] = (TURNS, TRIPS)
