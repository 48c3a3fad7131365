"""Rules about the values on the bus: what is sent is what the sender has, and what is used was sent."""

from __future__ import annotations

from typing import Final

import numpy as np

from hil.expect.rules._definition import Flags, Judged, Numbers, Rule, Words, last_true
from hil.expect.rules._frames import Series
from hil.expect.rules._views import OWN_CLOCK, AxisView, DriveView

_N4: Final = 2.0**30
_N2: Final = 2.0**14
_WRAP: Final = 2.0**32
_FLEETING: Final = 1 << 8 | 1 << 10 | 1 << 14
"""Bits of ZSW1 that follow the speed."""
_WAITS_CYCLES: Final = 5
"""A frame that was held up by errors of the bus is sent within so many cycles of the bench behind them."""
_SYNC_S: Final = 5e-4
"""Longest time from the recording of a drive to the SYNC behind it."""


def _sent_speed(drive: DriveView) -> tuple[Series, float] | None:
    """Return the actual speed that a drive sends, rpm, and its resolution."""
    return _speed(drive, "velocity", "actual.NIST")


def given_speed(drive: DriveView) -> tuple[Series, float] | None:
    """Return the speed setpoint that is sent to a drive, rpm, and its resolution."""
    return _speed(drive, "target_velocity", "setpoint.NSOLL")


def _speed(drive: DriveView, of_object: str, of_telegram: str) -> tuple[Series, float] | None:
    data = drive.data
    if data is None:
        return None
    if drive.number("cia402") is not None:
        found = data[of_object]
        return None if found is None else (Series(found.time_s, found.values * 0.001), 0.001)
    reference = drive.number("reference_speed_rpm")
    for suffix, one in (("_B", _N4), ("_A", _N2)):
        found = data[of_telegram + suffix]
        if found is not None and reference is not None:
            return Series(found.time_s, found.values * (reference / one)), reference / one
    return None


def _sent_count(drive: DriveView) -> Series | None:
    """Return the encoder count that a drive sends."""
    data = drive.data
    if data is None:
        return None
    return data["position" if drive.number("cia402") is not None else "actual.G1_XIST1"]


def _around(values: Numbers, at: Words) -> tuple[Numbers, Numbers]:
    """Return the least and the greatest of each sample and its neighbours."""
    before, here, behind = (
        values[np.maximum(at - 1, 0)],
        values[at],
        values[np.minimum(at + 1, len(values) - 1)],
    )
    return (
        np.minimum(np.minimum(before, here), behind),
        np.maximum(np.maximum(before, here), behind),
    )


def sample_before(samples_s: Numbers, times_s: Numbers, within_s: float) -> tuple[Words, Flags]:
    """Return for each time the sample at or before it, and whether that is less than so long ago; the first
    one where there is none.
    """
    at = np.searchsorted(samples_s, times_s, side="right") - 1
    near = (at >= 0) & (times_s - samples_s[np.maximum(at, 0)] < within_s)
    return np.maximum(at, 0), near


def _beside(drive: DriveView, sent: Series) -> tuple[Words, Flags]:
    """Return for each frame the sample of the drive just before it, and whether that is of the same cycle:
    not where an error on the bus may have made the frame wait.
    """
    at, near = sample_before(drive.time_s, sent.time_s, 0.6 * drive.whole.cycle_s)
    if drive.node is not None:
        waited = drive.whole.frames.behind_errors(
            drive.node[0], sent.time_s, _WAITS_CYCLES * drive.whole.cycle_s
        )
        near = near if waited is None else near & ~waited
    return at, near


def _position_sent(drive: DriveView) -> Judged | None:
    sent, steps = _sent_count(drive), drive.number("increments_per_revolution")
    if sent is None or steps is None or not drive.has("encoder_increments", "motor_speed"):
        return None
    at, near = _beside(drive, sent)
    # Behind a start of the drive it counts from elsewhere.
    near &= sent.time_s < min(drive.whole.boots(drive.name), default=np.inf)
    count, speed = drive["encoder_increments"], np.abs(drive["motor_speed"])
    fine = 2.0 ** (drive.number("fine_resolution_bits") or 0.0)
    off = np.abs((sent.values - count[at] + _WRAP / 2) % _WRAP - _WRAP / 2)
    fastest = np.maximum(speed[at], speed[np.minimum(at + 1, len(speed) - 1)])
    bound = 2.0 * fine + fastest / 60.0 * steps * fine * _SYNC_S
    return Judged(
        sent.time_s,
        near,
        near & (off > bound),
        lambda k: f"{sent.values[k]:.0f} is sent, the encoder has counted {count[at[k]]:.0f}",
    )


POSITION_SENT: Final = Rule(
    name="position on the bus",
    says="the position that a drive sends is the count of its own encoder",
    requirements=("C402-198", "PD-171"),
    tolerance="the way from the record to SYNC, half a millisecond, and two increments",
    judge=_position_sent,
    excused_by=("encoder.", "mechanics.slip", "frame.", "telegram.", "can.", "drive.boot", *OWN_CLOCK),
    recovery_cycles=3,
)


def _speed_sent(drive: DriveView) -> Judged | None:
    found = _sent_speed(drive)
    if found is None or not drive.has("motor_speed", "torque"):
        return None
    sent, step = found
    at, near = _beside(drive, sent)
    speed = drive["motor_speed"]
    low, high = _around(speed, at)
    limit = (
        np.inf if drive.number("cia402") is not None else 2.0 * (drive.number("reference_speed_rpm") or 0.0)
    )
    off = np.abs(sent.values - np.clip(speed[at], -limit, limit))
    bound = 5.0 + 0.01 * np.abs(speed[at]) + (high - low) + step
    return Judged(
        sent.time_s,
        near,
        near & (off > bound),
        lambda k: f"{sent.values[k]:.5g} rpm is sent, the motor turns at {speed[at[k]]:.5g} rpm",
    )


SPEED_SENT: Final = Rule(
    name="speed on the bus",
    says="the speed that a drive sends is that of its motor",
    requirements=("C402-206", "PD-035"),
    tolerance="the change of the speed in the cycles around, 1 % and 5 rpm for the resolution of the encoder",
    judge=_speed_sent,
    excused_by=("encoder.", "frame.", "telegram.", "can.", "mechanics.", "drive.boot", *OWN_CLOCK),
    recovery_cycles=3,
)


def _torque_sent(drive: DriveView) -> Judged | None:
    data, rated = drive.data, drive.number("rated_torque_nm")
    if data is None or rated is None or not drive.has("torque"):
        return None
    sent = data["torque"]
    if sent is None:
        return None
    at, near = _beside(drive, sent)
    torque = drive["torque"]
    low, high = _around(torque, at)
    value = sent.values * 0.001 * rated
    slack = 0.002 * rated + 0.5 * (high - low) + 0.05 * rated
    broken = near & ((value < low - slack) | (value > high + slack))
    return Judged(
        sent.time_s,
        near,
        broken,
        lambda k: f"{value[k]:.4g} Nm is sent, the torque is {torque[at[k]]:.4g} Nm",
    )


TORQUE_SENT: Final = Rule(
    name="torque on the bus",
    says="the torque that a drive sends is that of its motor",
    requirements=("C402-215",),
    tolerance="the change of the torque in the cycles around and 5 % of the rated torque",
    judge=_torque_sent,
    excused_by=("encoder.", "frame.", "telegram.", "can.", "mechanics.", "drive.boot", *OWN_CLOCK),
    recovery_cycles=3,
)


def _status_sent(drive: DriveView) -> Judged | None:
    data = drive.data
    if data is None:
        return None
    name, column = ("statusword", "statusword") if drive.number("cia402") else ("actual.ZSW1", "drive_zsw1")
    sent = data[name]
    if sent is None or not drive.has(column):
        return None
    at, near = _beside(drive, sent)
    steady = 0xFFFF if drive.number("cia402") else ~_FLEETING & 0xFFFF
    word, shown = drive.word(column) & steady, sent.values.astype(np.int64) & steady
    later = np.minimum(at + 1, len(word) - 1)
    # Bits need not change together: each has to be that of one of the two samples.
    broken = near & ((shown ^ word[at]) & (shown ^ word[later]) != 0)
    changes = drive.whole.events.of(drive.name, "drive.state", "drive.warning", "drive.fault")
    calm = ~drive.near(changes, 1, 1)[at]
    return Judged(
        sent.time_s,
        near & calm,
        broken & calm,
        lambda k: f"{shown[k]:04X}h is sent, the drive shows {word[at[k]]:04X}h",
    )


STATUS_SENT: Final = Rule(
    name="status word on the bus",
    says="the status word that a drive sends is its own",
    requirements=("C402-039",),
    tolerance="that of the sample before or behind; not judged around a change of state",
    judge=_status_sent,
    excused_by=(
        "frame.",
        "telegram.",
        "can.",
        "drive.boot",
        "drive.statusword_stuck",
        "drive.statusword_bits",
    ),
    recovery_cycles=3,
)


def _speed_demanded(drive: DriveView) -> Judged | None:
    """Compare the demand of the servo with what was on the bus before the SYNC before."""
    found = given_speed(drive)
    if found is None or not drive.has("velocity_demand") or drive.number("live"):
        return None
    axis = drive.axis
    if axis is None or not axis.off("PositionControl.EnableDSC") or drive.number("operating_mode") == 1.0:
        return None
    if drive.number("torque_precontrol") == 0.0:
        return None  # the demand is behind by the model of the speed loop
    sent, step = found
    times, cycle_s = drive.time_s, drive.whole.cycle_s
    given, known = sent.latest(times - cycle_s + 1e-9)
    earlier, known_earlier = sent.latest(times - 2.0 * cycle_s + 1e-9)
    fresh = sent.age_s(times - cycle_s + 1e-9) < cycle_s
    demand = drive["velocity_demand"]
    if drive.number("cia402") is not None:
        led = drive.in_states("operation_enabled") & (drive.word("controlword") & 0x010F == 0x000F)
    elif drive.has("drive_zsw1"):
        led = (drive.word("drive_zsw1") & 0x0F == 0x07) & (drive.word("drive_stw1") & 0x7F == 0x7F)
    else:
        return None
    opening_s = drive.number("brake_opening_s") or 0.0
    led = last_true(led & known & known_earlier & fresh, 3 + int(np.ceil(opening_s / cycle_s)))
    limit = drive.number("max_speed_rpm")
    if limit is None:
        return None
    led &= np.maximum(np.abs(given), np.abs(earlier)) < limit - 1.0  # it is given as a whole number
    wanted = given
    bound = step + 0.02 * np.abs(given - earlier) + 1e-6 * np.abs(given)
    return Judged(
        times,
        led,
        led & (np.abs(demand - wanted) > bound),
        lambda k: f"the drive follows {demand[k]:.6g} rpm, {wanted[k]:.6g} rpm was sent a cycle ago",
    )


SPEED_DEMANDED: Final = Rule(
    name="speed setpoint",
    says="the drive follows the speed setpoint that was on the bus before SYNC",
    requirements=("C402-101",),
    tolerance="resolution of the setpoint and 2 % of its last change",
    judge=_speed_demanded,
    excused_by=("frame.", "telegram.", "can.", "drive.", "safety.", "controller."),
    recovery_cycles=4,
)

DRIVE_RULES: Final[tuple[Rule[DriveView], ...]] = (
    POSITION_SENT,
    SPEED_SENT,
    TORQUE_SENT,
    STATUS_SENT,
    SPEED_DEMANDED,
)


def _speed_given(axis: AxisView) -> Judged | None:
    drive = axis.drive
    found = None if drive is None else given_speed(drive)
    if drive is None or found is None or not axis.has("speed_output", "state") or drive.number("live"):
        return None
    sent, step = found
    if axis.simulated.any():
        return None
    at, near = sample_before(axis.time_s, sent.time_s - 1e-9, 0.5 * axis.cycle_s)
    output = axis["speed_output"]
    limit = 2.0 * (drive.number("reference_speed_rpm") or 0.0)
    wanted = np.clip(output, -limit, limit) if drive.number("cia402") is None else output
    off = np.abs(sent.values - wanted[at])
    return Judged(
        sent.time_s,
        near,
        near & (off > 0.51 * step + 1e-9 * np.abs(sent.values) + (1e-4 if step < 1e-4 else 0.0)),
        lambda k: f"{sent.values[k]:.6g} rpm is sent, the axis puts out {output[at[k]]:.6g} rpm",
    )


SPEED_GIVEN: Final = Rule(
    name="speed setpoint on the bus",
    says="the speed setpoint that the drive gets is the output of its own axis",
    requirements=("CTL-038",),
    tolerance="half a step of the setpoint",
    judge=_speed_given,
    excused_by=("frame.", "telegram.", "can.", "controller.", "drive.boot"),
    recovery_s=0.02,
    recovery_cycles=2,
)


def _speed_taken(axis: AxisView) -> Judged | None:
    drive = axis.drive
    found = None if drive is None else _sent_speed(drive)
    if drive is None or drive.data is None or found is None:
        return None
    if not axis.has("actual_speed", "communication_ok"):
        return None
    sent, step = found
    value, known = drive.data.when_whole(sent).latest(axis.time_s)
    shown = axis["actual_speed"]
    linked = last_true((axis["communication_ok"] != 0) & known & ~axis.simulated, 1)
    return Judged(
        axis.time_s,
        linked,
        linked & (np.abs(shown - value) > 0.51 * step + 1e-6 * np.abs(value)),
        lambda k: f"{shown[k]:.6g} rpm, but the drive has sent {value[k]:.6g} rpm",
    )


SPEED_TAKEN: Final = Rule(
    name="actual speed",
    says="the actual speed of the axis is the one that its own drive has sent last",
    requirements=("CFG-336", "C402-206"),
    tolerance="rounding; a telegram in several PDOs counts from the last one on",
    judge=_speed_taken,
    excused_by=("telegram.", "frame.", "can.", "controller.", "drive.emcy_storm"),
    recovery_cycles=3,
)

AXIS_RULES: Final[tuple[Rule[AxisView], ...]] = (SPEED_GIVEN, SPEED_TAKEN)
