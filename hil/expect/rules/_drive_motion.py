"""Rules about the motion of a drive: its mechanics, its encoder, and that it follows what was sent."""

from __future__ import annotations

from typing import Final

import numpy as np

from hil.expect.rules._component import kept
from hil.expect.rules._definition import Flags, Judged, Numbers, Rule, differences, last_true, spread
from hil.expect.rules._views import OWN_CLOCK, DriveView

_WRAP: Final = 2.0**32
_RPM: Final = 60.0
_RECORDED_SPEED: Final = 1e-3
"""Resolution of a speed setpoint on the bus, rpm."""


def _steady_grid(drive: DriveView) -> Flags:
    """Return the samples that follow the one before by the cycle of the bench."""
    cycle_s = drive.whole.cycle_s
    steps = differences(drive.time_s)
    return kept(np.abs(steps - cycle_s) < 1e-3 * cycle_s)


def _way_of_velocity(drive: DriveView) -> Judged | None:
    if not drive.has("position", "velocity") or len(drive.time_s) < 4:
        return None
    cycle_s = drive.whole.cycle_s
    p, v = drive["position"], drive["velocity"]
    way, mean = differences(p), np.zeros(len(p))
    mean[1:] = 0.5 * (v[1:] + v[:-1]) * cycle_s
    change = np.abs(differences(v))
    around = change.copy()
    around[1:] = np.maximum(around[1:], change[:-1])
    around[:-1] = np.maximum(around[:-1], change[1:])
    bound = cycle_s * (0.75 * around + 0.001 * np.abs(v) + 2e-3) + 1e-9 + 1e-12 * np.abs(p)
    steps, lead_m = drive.number("increments_per_revolution"), drive.number("lead_m")
    if steps and lead_m and not drive.has("velocity_demand"):
        bound += 1.1 * lead_m / abs(drive.number("gear_ratio") or 1.0) / steps
    judged = drive.once(_steady_grid)
    if drive.has("brake_closed"):
        closed = drive["brake_closed"]
        judged = judged & ~spread(differences(closed) != 0.0, 2, 2)
    unit, speed = drive.unit("position"), drive.unit("velocity")
    return Judged(
        drive.time_s,
        judged,
        judged & (np.abs(way - mean) > bound),
        lambda at: f"it moves by {way[at]:.4g} {unit} in a cycle at {v[at]:.4g} {speed}",
    )


MECHANICS: Final = Rule(
    name="motion of the mechanics",
    says="the position is the integral of the velocity",
    requirements=("STP-550",),
    tolerance="three quarters of the change of the velocity in the cycles around; of a stepper one step",
    judge=_way_of_velocity,
    excused_by=("mechanics.", "encoder.", "pto.", "drive.brake_slip", *OWN_CLOCK),
    recovery_cycles=3,
)


def _gear(drive: DriveView) -> Judged | None:
    lead_m, ratio, play = drive.number("lead_m"), drive.number("gear_ratio"), drive.number("backlash_m")
    if lead_m is None or ratio is None or play != 0.0 or not drive.has("velocity", "motor_speed"):
        return None
    if drive.unit("velocity") != "m/s":
        return None
    v, speed = drive["velocity"], drive["motor_speed"]
    expected = v / lead_m * ratio * _RPM
    broken = np.abs(speed - expected) > 1e-6 * (1.0 + np.abs(expected))
    return Judged(
        drive.time_s,
        np.ones(len(v), dtype=bool),
        broken,
        lambda at: f"the motor turns at {speed[at]:.5g} rpm, by the load at {expected[at]:.5g} rpm",
    )


GEAR: Final = Rule(
    name="gear",
    says="the speed of the motor is that of the load by gear and lead of the bench file",
    requirements=("STP-550",),
    tolerance="rounding; not judged with play",
    judge=_gear,
    excused_by=("mechanics.", "pto."),
    recovery_s=0.0,
)


def _out_of_step(drive: DriveView) -> Flags:
    """Return when a stepper motor does not follow its pulses, which are what it counts."""
    lost = np.zeros(len(drive.time_s), dtype=bool)
    for entry in drive.whole.events.of(drive.name, "drive.out_of_step", "drive.in_step", "drive.slipped"):
        lost[max(drive.index_of(entry.time_ns) - 1, 0) :] = entry.kind != "drive.in_step"
    return lost


def _encoder(drive: DriveView) -> Judged | None:
    lead_m, ratio, play = drive.number("lead_m"), drive.number("gear_ratio"), drive.number("backlash_m")
    steps = drive.number("increments_per_revolution")
    if lead_m is None or ratio is None or play != 0.0 or steps is None:
        return None
    if not drive.has("position", "encoder_increments") or len(drive.time_s) < 3:
        return None
    fine = 2.0 ** (drive.number("fine_resolution_bits") or 0.0)
    p, count = drive["position"], drive["encoder_increments"]
    per_unit = steps / lead_m * ratio
    counted = (differences(count) + _WRAP / 2) % _WRAP - _WRAP / 2
    way = differences(p) * per_unit
    powered = np.ones(len(p), dtype=bool)
    starts = drive.whole.events.of(drive.name, "drive.nmt", "nmt.state", "drive.state")
    judged = powered & ~drive.near(starts, 1, 1) & ~_out_of_step(drive)
    judged[0] = False
    off = np.minimum(np.abs(counted - way), np.abs(counted / fine - way))
    return Judged(
        drive.time_s,
        judged,
        judged & (off > 2.0 + 1e-9 * np.abs(way)),
        lambda at: f"{counted[at]:.0f} increments for {way[at]:.1f}",
    )


ENCODER: Final = Rule(
    name="encoder",
    says="the encoder counts the way of the shaft",
    requirements=("STP-550",),
    tolerance="two increments",
    judge=_encoder,
    excused_by=("mechanics.", "encoder.", "pto.", "drive.boot"),
    recovery_cycles=3,
)

_STOPS: Final = (
    ("quick_stop_active", "off3_ramp_s"),
    ("s5_quick_stop", "off3_ramp_s"),
    ("s5_ramp_stop", "off1_ramp_s"),
)
"""States in which a drive brakes by itself, and the time from its greatest speed to 0."""
_POSITION_MODES: Final = ("pp", "hm", "ip", "csp")


def _stop_of_drive(drive: DriveView) -> Judged | None:
    if not drive.has("velocity_demand", "state") or len(drive.time_s) < 4:
        return None
    top = drive.number("max_speed_rpm")
    if not top or drive.axis is None:
        return None  # a case that leads the drive itself may have given it other ramps
    demand = drive["velocity_demand"]
    ramps = {state: drive.number(name) for state, name in _STOPS}
    stops = [(drive.in_states(state), ramp_s) for state, ramp_s in ramps.items() if ramp_s]
    stops = [(inside, ramp_s) for inside, ramp_s in stops if inside.any()]
    if not stops:
        return None
    change = np.abs(differences(demand)) / drive.whole.cycle_s
    judged, wanted = np.zeros(len(demand), dtype=bool), np.zeros(len(demand))
    steady = _settled(drive, change)
    for stopping, ramp_s in stops:
        # Between the first whole cycle of the ramp and the last one before it ends.
        inside = last_true(stopping, 2) & drive.once(_steady_grid) & steady
        # Nor where the demand stands at the greatest speed: a stop may begin above it.
        inside[1:] &= (demand[:-1] != 0.0) & (np.abs(demand[:-1]) < 0.999 * top)
        inside &= demand != 0.0
        inside[:-1] &= demand[1:] != 0.0
        judged |= inside
        wanted[inside] = top / ramp_s
    return Judged(
        drive.time_s,
        judged,
        judged & (np.abs(change - wanted) > 0.01 * wanted),
        lambda at: f"it brakes with {change[at]:.5g} rpm/s, its ramp has {wanted[at]:.5g} rpm/s",
    )


def _settled(drive: DriveView, change: Numbers) -> Flags:
    """Return where the demand shows the ramp alone.

    A drive that controls its position brings the following error to 0 during the stop: until that has
    ended, the demand has the correction on top of the ramp, and its change differs from cycle to cycle.
    """
    settled = np.ones(len(change), dtype=bool)
    if drive.has("mode"):
        differs = np.abs(differences(change)) > 0.005 * np.abs(change)
        settled = ~(differs & drive.shows("mode", *_POSITION_MODES))
    return settled


STOP_OF_DRIVE: Final = Rule(
    name="ramp of a stop of the drive",
    says="a drive that stops by itself brakes by the ramp of the bench file: OFF1, OFF3 or quick stop",
    requirements=("STP-311", "C402-012", "PD-116"),
    tolerance="1 %; in modes with position control of the drive only where its correction has ended",
    judge=_stop_of_drive,
    excused_by=("drive.", "safety.", "controller."),
    recovery_s=1.0,
)

_LIMIT_CYCLES: Final = 4
"""Cycles until a torque limit of the axis acts in the drive: on its way, latched, and taken over."""


def _torque_limits(drive: DriveView) -> Judged | None:
    axis, reference = drive.axis, drive.number("reference_torque_nm")
    if axis is None or not reference or not drive.has("torque", "state") or axis.restarted:
        return None
    changes = drive.whole.events.of(axis.name, "axis.torque_limit", "axis.torque_range")
    if not changes or axis.simulated.any():
        return None
    count = len(drive.time_s)
    upper, lower = np.full(count, np.inf), np.full(count, -np.inf)
    sign = -1.0 if axis.number("Actor.InverseDirection") else 1.0
    gain = drive.number("momred_gain") or 1.0
    for entry in changes:
        data, first = entry.data, drive.index_of(entry.time_ns)
        high, low = np.inf, -np.inf
        if data.get("active"):
            limit = gain * float(data.get("limit") or 0.0)
            # A drive has no limit beyond zero: it could not stand still.
            high = max(float(data.get("upper") or limit), 0.0)
            low = min(float(data.get("lower") or -limit), 0.0)
        if sign < 0.0 and entry.kind == "axis.torque_range":
            high, low = -low, -high
        upper[first:], lower[first:] = high, low
    torque = drive["torque"]
    steady = (differences(np.nan_to_num(upper, posinf=0.0)) == 0.0) & (
        differences(np.nan_to_num(lower, neginf=0.0)) == 0.0
    )
    judged = np.isfinite(upper) & drive.in_states("operation_enabled", "s4_operation")
    judged = last_true(judged & steady, _LIMIT_CYCLES)
    slack = 0.002 * reference
    return Judged(
        drive.time_s,
        judged,
        judged & ((torque > 1.01 * upper + slack) | (torque < 1.01 * lower - slack)),
        lambda at: f"{torque[at]:.5g} Nm, the axis limits it to {lower[at]:.5g}..{upper[at]:.5g} Nm",
    )


TORQUE_LIMITS: Final = Rule(
    name="torque limits",
    says="the torque of the motor stays within the limits of MC_TorqueLimiting and MC_TorqueRange",
    requirements=("STP-183", "STP-188", "MC-528"),
    tolerance="1 %, 0.2 % of the reference torque, four cycles after a change; by MOMRED a share of p1520 "
    "and p1521 (PD-037)",
    judge=_torque_limits,
    excused_by=("drive.", "safety.", "frame.", "telegram.", "can.", "controller."),
    recovery_cycles=6,
)

DRIVE_RULES: Final[tuple[Rule[DriveView], ...]] = (MECHANICS, GEAR, ENCODER, STOP_OF_DRIVE, TORQUE_LIMITS)
