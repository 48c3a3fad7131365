"""Rules about motion: position, velocity and acceleration belong together, values to their own drive."""

from __future__ import annotations

from typing import Final

import numpy as np

from hil.expect.rules._definition import Judged, Numbers, Rule, differences, last_true, spread
from hil.expect.rules._views import CONTROLLED, AxisView

_ROUNDING: Final = 1e-9
"""Rounding of a number, as a share."""


def _own_setpoints(axis: AxisView) -> np.ndarray:
    """Return the samples in which the axis makes a smooth setpoint: none that begins from actual values, is
    given by the user program or a leading value, or follows a shift of the coordinates.
    """
    own = axis.in_states(*CONTROLLED) & ~axis.bit(31) & ~axis.bit(28)
    own &= ~axis.bit(21) & ~axis.bit(22)
    if axis.has("status_word2"):
        own &= ~axis.bit(6, "status_word2") & ~axis.bit(1, "status_word2")
    events = axis.whole.events
    starts = events.of(axis.name, "axis.state", "axis.homed", "axis.sensor", "alarm.raised")
    starts += events.of(axis.name, "job.active", "job.done", "job.aborted", "job.error")
    return own & ~axis.near(starts, 1, 2 * axis.ratio - 1) & ~axis.gaps


def _widest(values: Numbers, steps: int) -> Numbers:
    """Return the greatest value within so many samples less one on either side."""
    result = values.copy()
    for step in range(1, steps):
        result[step:] = np.maximum(result[step:], values[:-step])
        result[:-step] = np.maximum(result[:-step], values[step:])
    return result


def _setpoint_position(axis: AxisView) -> Judged | None:
    columns = ("position_setpoint", "velocity_setpoint", "acceleration_setpoint", "status_word", "state")
    if not axis.has_position or not axis.has(*columns) or len(axis.time_s) < 3:
        return None
    cycle_s = axis.cycle_s
    s, v, a = (axis[column] for column in columns[:3])
    own = axis.once(_own_setpoints)
    judged = own.copy()
    judged[1:] &= own[:-1]
    judged[0] = False
    way = np.zeros(len(s))
    way[1:] = 0.5 * (v[1:] + v[:-1]) * cycle_s
    moved = differences(s)
    bound = np.zeros(len(s))
    change, gained = np.abs(a[1:] - a[:-1]), v[1:] - v[:-1]
    inside = np.abs(gained - 0.5 * (a[1:] + a[:-1]) * cycle_s)
    bound[1:] = change * cycle_s**2 / 8.0 + 0.6 * inside * cycle_s
    if axis.ratio > 1:
        bound = _widest(bound, axis.ratio) * axis.ratio**2
    bound += _ROUNDING * (1.0 + np.abs(s))
    off = np.abs(moved - way)
    unit, speed = axis.unit("position_setpoint"), axis.unit("velocity_setpoint")
    return Judged(
        axis.time_s,
        judged,
        judged & (off > bound),
        lambda at: f"it moves by {moved[at]:.6g} {unit} in a cycle at {v[at]:.6g} {speed}",
    )


SETPOINT_POSITION: Final = Rule(
    name="position setpoint",
    says="the position setpoint is the integral of the velocity setpoint",
    requirements=("MC-568",),
    tolerance="what a change of the acceleration within the cycle can make",
    judge=_setpoint_position,
    excused_by=("controller.",),
    recovery_cycles=3,
)


def _setpoint_velocity(axis: AxisView) -> Judged | None:
    columns = ("velocity_setpoint", "acceleration_setpoint", "status_word", "state")
    if not axis.has(*columns) or len(axis.time_s) < 4:
        return None
    if axis.ratio > 1 and not axis.has_position:
        return None  # between cycles of the interpolator its velocities lie on a line
    cycle_s = axis.cycle_s
    v, a = (axis[column] for column in columns[:2])
    own = axis.once(_own_setpoints)
    judged = last_true(own, 2)
    judged[:-1] &= own[1:]
    judged[-1] = False
    low, high = np.minimum(a[1:], a[:-1]) * cycle_s, np.maximum(a[1:], a[:-1]) * cycle_s
    if axis.ratio > 1:
        # Between the cycles of the interpolator the acceleration stands, and the setpoints lie on a curve.
        low, high = -_widest(-low, 2 * axis.ratio - 1), _widest(high, 2 * axis.ratio - 1)
        slack_of_curve = 0.25 * np.maximum(np.abs(low), np.abs(high))
        low, high = low - slack_of_curve, high + slack_of_curve
        # A ramp that begins and ends between two calls of the interpolator does not show in the acceleration.
        hidden = (low == 0.0) & (high == 0.0)
        steepest = _steepest(axis)[1:] * cycle_s * (1.0 + _ROUNDING)
        low, high = np.where(hidden, -steepest, low), np.where(hidden, steepest, high)
    gained = v[1:] - v[:-1]
    # A ramp that begins and ends within two cycles shows in the neighbours.
    calm = np.abs(differences(a)) * cycle_s
    slack = _ROUNDING * (1.0 + np.abs(v))
    off = np.zeros(len(v))
    off[1:] = np.maximum(low - gained, gained - high)
    near = np.maximum(calm, np.concatenate((calm[1:], [0.0])))
    for step in range(1, axis.ratio + 1):
        near[step:] = np.maximum(near[step:], calm[:-step])
    broken = judged & (off > slack + near)
    unit = axis.unit("velocity_setpoint")
    return Judged(
        axis.time_s,
        judged,
        broken,
        lambda at: f"it changes by {v[at] - v[at - 1]:.6g} {unit} in a cycle at {a[at]:.6g} {unit}/s",
    )


def _steepest(axis: AxisView) -> Numbers:
    """Return the greatest acceleration that the limits allow, in every cycle; endless where it is unknown."""
    paths = (
        "DynamicLimits.MaxAcceleration",
        "DynamicLimits.MaxDeceleration",
        "DynamicDefaults.EmergencyDeceleration",
    )
    values = [axis.number_over_time(path) for path in paths]
    known = [one for one in values if one is not None]
    if len(known) < len(paths):
        return np.full(len(axis.time_s), np.inf)
    found: Numbers = np.max(known, axis=0)
    return found


SETPOINT_VELOCITY: Final = Rule(
    name="velocity setpoint",
    says="the velocity setpoint is the integral of the acceleration setpoint",
    requirements=("MC-568",),
    tolerance="one change of the acceleration within the cycle or the two around it; of a slower "
    "interpolator a ramp between two of its calls",
    judge=_setpoint_velocity,
    excused_by=("controller.",),
    recovery_cycles=3,
)


_SENSOR_FAULT: Final = 5
"""Bit of `ErrorWord`: an error in the encoder system."""


def _valid_feedback(axis: AxisView) -> np.ndarray:
    """Return the samples whose actual position goes on from the one before."""
    valid = axis["communication_ok"] != 0 if axis.has("communication_ok") else np.ones(len(axis.time_s), bool)
    events = axis.whole.events
    moved = events.of(axis.name, "axis.homed", "axis.sensor", "axis.restart")
    moved += events.of(axis.drive_name, "link.up", "link.down")
    moved += events.all("controller.state")
    if axis.has("error_word"):
        # While the encoder is not valid the last values stay; with its first valid one the position leaps
        # (VAR-075, VAR-107).
        valid &= ~spread(axis.bit(_SENSOR_FAULT, "error_word"), 1, 2)
    valid &= ~spread(axis.in_states("restarting"), 1, 2)
    return valid & ~axis.near(moved, 1, 2) & ~axis.gaps


def _other_encoder(axis: AxisView) -> bool:
    """Return whether the program uses several encoders: one may take over the position of another."""
    started = axis.whole.events.of(axis.name, "job.started", "axis.sensor")
    return any(
        entry.kind == "axis.sensor" or entry.data.get("instruction") == "MC_SetSensor" for entry in started
    )


def _actual_velocity(axis: AxisView) -> Judged | None:
    if not axis.has_position or not axis.has("actual_velocity", "state") or len(axis.time_s) < 3:
        return None
    if not axis.off("Sensor[1].ActualVelocityMode") or not axis.off("Sensor[1].Backlash.Enable"):
        return None
    if _other_encoder(axis):
        return None
    s, v = axis["actual_position"], axis["actual_velocity"]
    # Without a drive the velocity setpoint becomes the actual one.
    valid = last_true(axis.once(_valid_feedback) & ~axis.simulated, 2)
    rate = differences(s) / axis.cycle_s
    off = np.abs(rate - v)
    # Of a count of 32 bits the last digits of the position are rounded, whatever the position is.
    rounded = abs(_increment(axis) or 0.0) * 2.0**-16 / axis.cycle_s
    bound = _ROUNDING * (np.abs(s) / axis.cycle_s + np.abs(v) + 1.0) + 1e-5 * np.abs(v) + rounded
    unit = axis.unit("actual_velocity")
    return Judged(
        axis.time_s,
        valid,
        valid & (off > bound),
        lambda at: f"{v[at]:.6g} {unit}, but the position changes by {rate[at]:.6g} {unit}",
    )


ACTUAL_VELOCITY: Final = Rule(
    name="actual velocity",
    says="the actual velocity is the difference of two actual positions by the cycle",
    requirements=("CFG-335",),
    tolerance="none but rounding; without the velocity of the telegram, compensation of backlash, on no "
    "virtual axis; not while the encoder has an error (ErrorWord.X5)",
    judge=_actual_velocity,
    excused_by=("encoder.", "telegram.", "controller."),
    recovery_cycles=3,
)


def _following_error(axis: AxisView) -> Judged | None:
    columns = ("position_setpoint", "actual_position", "following_error", "status_word", "state", "stw1")
    if not axis.has(*columns):
        return None
    delay_s = axis.number("delay_s")
    more = axis.number_over_time("FollowingError.AdditionalSetpointDelayTime")
    if not axis.off("Simulation.Mode"):
        return None  # its actual values come from a model of the drive (CFG-161)
    if not axis.off("VirtualAxis.Mode") and not axis.off("SetpointFilter.DynamicFilter.Mode"):
        return None  # it has no control that could be behind
    if delay_s is None or more is None or axis.restarted or not len(more) or more.max() != more.min():
        return None
    cycles = (delay_s + float(more[0])) / axis.cycle_s
    whole = int(cycles + 1e-9)
    rest = max(0.0, cycles - whole)
    if len(axis.time_s) < whole + 4:
        return None
    s, actual, error = (axis[column] for column in columns[:3])
    led = axis.in_states(*CONTROLLED) & ~axis.bit(28) & (axis.word("stw1") & 1 != 0)
    events = axis.whole.events
    led &= ~axis.near(
        events.of(axis.name, "axis.state", "axis.homed", "axis.sensor", "job.active", "alarm.raised"), 1, 1
    )
    led &= ~axis.gaps
    judged = last_true(led, whole + 3)
    delayed = np.full(len(s), np.nan)
    delayed[whole:] = s[: len(s) - whole]
    if rest:
        delayed[whole + 1 :] += (s[: len(s) - whole - 1] - delayed[whole + 1 :]) * rest
    expected = delayed - actual
    off = np.abs(error - expected)
    unit = axis.unit("following_error")
    return Judged(
        axis.time_s,
        judged,
        judged & (off > _ROUNDING * (1.0 + np.abs(s)) * 10.0),
        lambda at: (
            f"{error[at]:.6g} {unit}, but setpoint and actual position are {expected[at]:.6g} {unit} apart"
        ),
    )


FOLLOWING_ERROR: Final = Rule(
    name="following error",
    says="the following error is the setpoint of the transport delay ago minus the actual position",
    requirements=("MON-030", "MON-033"),
    tolerance="none but rounding",
    judge=_following_error,
    excused_by=("controller.",),
    recovery_cycles=10,
)


def _setpoint_at_enabling(axis: AxisView) -> Judged | None:
    columns = ("position_setpoint", "actual_position", "actual_velocity")
    delay_s = axis.number("delay_s")
    if not axis.has_position or delay_s is None or not axis.has(*columns):
        return None
    s, actual, v = (axis[column] for column in columns)
    # By the events: an alarm may end the state within its first cycle, so that no sample has it.
    starts = axis.whole.events.of(axis.name, "axis.state")
    began = axis.near(
        [
            entry
            for entry in starts
            if entry.data.get("from") == "ENABLING" and entry.data.get("to") in ("STANDSTILL", "ENABLE_RAMP")
        ],
        0,
        0,
    )
    began &= ~axis.gaps
    # In its first cycle the setpoint goes on by one step already.
    ahead = np.abs(v) * (delay_s + 2 * axis.ratio * axis.cycle_s)
    off = np.abs(s - actual)
    unit = axis.unit("position_setpoint")
    return Judged(
        axis.time_s,
        began,
        began & (off > ahead + _ROUNDING * (1.0 + np.abs(s))),
        lambda at: f"the setpoint is {s[at]:.6g} {unit}, the axis at {actual[at]:.6g} {unit}",
    )


SETPOINT_AT_ENABLING: Final = Rule(
    name="setpoint at enabling",
    says="an axis that has been enabled holds its actual position",
    requirements=("STP-047", "STP-054"),
    tolerance="the way that it moves during the transport delay and two cycles of the interpolator",
    judge=_setpoint_at_enabling,
    excused_by=("encoder.", "telegram.", "controller."),
    recovery_cycles=3,
)


def _increment(axis: AxisView) -> float | None:
    """Return the way of a raw increment by the numbers of the bench, signed; None where the encoder is not
    a rotary one of the drive, on motor or load.
    """
    number = axis.number
    mounting = number("Sensor[1].MountingMode")
    if not axis.whole.numbers.get(f"{axis.name}.encoder_of_drive"):
        return None
    if mounting not in (0, 1) or number("Sensor[1].System") != 1:
        return None
    names = (
        "Sensor[1].Parameter.StepsPerRevolution",
        "Sensor[1].Parameter.FineResolutionXist1",
        "LoadGear.Numerator",
        "LoadGear.Denominator",
        "Sensor[1].InverseDirection",
    )
    known = [one for one in map(number, names) if one is not None]
    way = _way_per_revolution(axis)
    if len(known) < len(names) or way is None:
        return None
    steps, fine, motor, load, inverse = known
    ratio = 1.0 if mounting else (load or 1.0) / (motor or 1.0)
    size: float = way * ratio / (steps * 2.0**fine)
    return -size if inverse else size


def _way_per_revolution(axis: AxisView) -> float | None:
    """Return the way of a revolution of the load: of a screw its lead, of a turning axis 360 degrees."""
    kind = axis.number("Properties.MotionType")
    if kind == 0:
        return axis.number("Mechanics.LeadScrew")
    turn = {"°": 360.0, "deg": 360.0, "rad": 2.0 * np.pi}
    return turn.get(axis.unit("actual_position")) if kind == 1 else None


def _own_encoder(axis: AxisView) -> Judged | None:
    if not axis.has("actual_position", "communication_ok", "state"):
        return None
    increment, drive = _increment(axis), axis.drive
    if increment is None or drive is None or drive.data is None:
        return None
    encoder = int(axis.whole.numbers[f"{axis.name}.encoder_of_drive"])
    counts = drive.data["position" if drive.number("cia402") is not None else f"actual.G{encoder}_XIST1"]
    # With adaption the numbers come from the drive, and the trace does not have them.
    options = ("Sensor[1].Backlash.Enable", "Sensor[1].DataAdaption")
    if counts is None or _other_encoder(axis) or not all(map(axis.off, options)):
        return None
    count, known = drive.data.when_whole(counts).latest(axis.time_s)
    step = (differences(count) + 2.0**31) % 2.0**32 - 2.0**31
    s = axis["actual_position"]
    moved = differences(s)
    valid = last_true(axis.once(_valid_feedback) & known & ~axis.simulated, 2)
    expected = step * increment
    unit = axis.unit("actual_position")
    return Judged(
        axis.time_s,
        valid,
        valid & (np.abs(moved - expected) > _ROUNDING * (np.abs(s) + 1.0)),
        lambda at: (
            f"it moves by {moved[at]:.6g} {unit} in a cycle, the encoder of {axis.drive_name} by "
            f"{expected[at]:.6g} {unit}"
        ),
    )


OWN_ENCODER: Final = Rule(
    name="actual position",
    says="the actual position moves as the encoder count that its own drive has sent, by the bench file",
    requirements=("C402-198", "LIM-098"),
    tolerance="none but rounding: what is sent until the cycle counts in it; not while the encoder has an "
    "error (ErrorWord.X5)",
    judge=_own_encoder,
    excused_by=("controller.", "encoder.", "telegram.", "frame."),
    recovery_cycles=4,
)


_LIMITED: Final = 0.999
"""An output beyond this share of the greatest speed may be limited."""


def _control_law(axis: AxisView) -> Judged | None:
    columns = ("velocity_setpoint", "control_difference", "speed_output", "status_word", "state", "stw1")
    if not axis.has(*columns) or not axis.has_position or axis.drive is None or axis.restarted:
        return None
    delaying = ("PositionControl.EnableDSC", "SetpointFilter.DynamicFilter.Mode", "TorquePreControl.Mode")
    if not all(map(axis.off, delaying)):
        return None
    gain, precontrol = (axis.number_over_time(f"PositionControl.{name}") for name in ("Kv", "Kpc"))
    unit_per_rpm = axis.whole.numbers.get(f"{axis.name}.unit_per_rpm")
    top_rpm = axis.drive.number("max_speed_rpm")
    if gain is None or precontrol is None or unit_per_rpm is None or not top_rpm:
        return None
    rpm, v = axis["speed_output"], axis["velocity_setpoint"]
    law = (gain * axis["control_difference"] + precontrol * 0.01 * v) / unit_per_rpm
    judged = axis.in_states(*CONTROLLED) & ~axis.bit(28) & (axis.word("stw1") & 1 != 0) & ~axis.simulated
    judged &= (np.abs(rpm) < _LIMITED * top_rpm) & (np.abs(law) < _LIMITED * top_rpm)
    events = axis.whole.events
    changes = events.of(axis.name, "axis.state", "axis.sensor", "axis.homed", "alarm.raised", "job.active")
    judged &= ~axis.near([*changes, *events.of(axis.name, "program.write")], 1, axis.ratio)
    off = np.abs(rpm - law)
    return Judged(
        axis.time_s,
        judged,
        judged & (off > 1e-6 * (1.0 + np.abs(law))),
        lambda at: f"the output is {rpm[at]:.6g} rpm, by gain and precontrol {law[at]:.6g} rpm",
    )


CONTROL_LAW: Final = Rule(
    name="control law",
    says="the speed that is output is Kv times the control difference plus Kpc times the velocity setpoint",
    requirements=("CTL-038", "CTL-039"),
    tolerance="rounding; not judged at the limit of the speed, with control in the drive, a dynamic filter "
    "or precontrol of the torque, nor in a cycle with a change of state or job",
    judge=_control_law,
    excused_by=("controller.",),
    recovery_cycles=5,
    live=True,
)

AXIS_RULES: Final[tuple[Rule[AxisView], ...]] = (
    SETPOINT_POSITION,
    SETPOINT_VELOCITY,
    ACTUAL_VELOCITY,
    FOLLOWING_ERROR,
    CONTROL_LAW,
    OWN_ENCODER,
    SETPOINT_AT_ENABLING,
)
