"""What an axis tells its drive about torque and force, by type of axis, motor and side of the limit
(§5.7.8.1, VAR-132).
"""

from __future__ import annotations

from math import tau

import pytest

from fieldbus.errors import ConfigurationError
from motion.drives.simulated import SimulatedDrivePort
from testcases.unit.motion_axis.conftest import Rig

REFERENCE_TORQUE = {"Actor.DriveParameter.ReferenceTorque": 2.0}
GEAR = {"LoadGear.Numerator": 5, "LoadGear.Denominator": 2}
LOAD_SIDE = {"TorqueLimiting.LimitBase": 1}
ROTARY = {"Properties.MotionType": 1, "Units.LengthUnit": 1005, "Units.VelocityUnit": 1521}
LINEAR_MOTOR = {
    "Actor.MotorType": 1,
    "Actor.LinearMotorDriveParameter.ReferenceForce": 500.0,
    "Actor.LinearMotorDriveParameter.ReferenceVelocity": 60.0,
    "Sensor[1].System": 0,
    "Sensor[1].Parameter.Resolution": 0.001,
    "Actor.Efficiency": 0.5,
}


class TorquePort(SimulatedDrivePort):
    """A simulated drive that keeps what it gets about torque; its motor gives none."""

    __slots__ = ("additive_nm", "limit", "range_", "reference")

    def __init__(self, **settings):
        super().__init__(**settings)
        self.has_torque_reduction = self.has_torque_data = True
        self.limit = self.range_ = None
        self.additive_nm = 0.0

    def write(self, stw1, speed_rpm, torque_nm=0.0):
        super().write(stw1, speed_rpm, torque_nm)
        self.additive_nm = torque_nm

    def limit_torque(self, share):
        self.limit = share

    def set_torque_range(self, upper, lower):
        self.range_ = (upper, lower)


@pytest.fixture
def torque_rig(monkeypatch):
    monkeypatch.setattr("testcases.unit.motion_axis.conftest.SimulatedDrivePort", TorquePort)

    def make(speed=False, **variables):
        return Rig(speed=speed, variables=REFERENCE_TORQUE | variables)

    return make


def limit_of(rig, value):
    """Return the share of the reference that a limit becomes."""
    job = rig.axis.torque_limiting(value)
    rig.cycles(2)
    assert job.Busy, hex(job.ErrorID)
    return rig.port.limit


@pytest.mark.parametrize(
    ("variables", "limit", "share"),
    [
        pytest.param(ROTARY, 0.5, 0.25, marks=pytest.mark.requirement("STP-138"), id="rotary, motor side"),
        pytest.param(
            ROTARY | LOAD_SIDE | GEAR,
            2.0,
            2.0 * 2 / 5 / 2.0,
            marks=pytest.mark.requirement("STP-139"),
            id="rotary, load side, gear",
        ),
        pytest.param(
            ROTARY | LOAD_SIDE | GEAR | {"Actor.Efficiency": 0.8},
            2.0,
            2.0 * 2 / 5 / 0.8 / 2.0,
            marks=pytest.mark.requirement("STP-139"),
            id="rotary, load side, gear and efficiency",
        ),
        pytest.param(
            GEAR | {"Actor.Efficiency": 0.8},
            0.5,
            0.25,
            marks=pytest.mark.requirement("STP-140"),
            id="linear, motor side",
        ),
        pytest.param(
            LOAD_SIDE | GEAR | {"Actor.Efficiency": 0.8},
            1000.0,
            1000.0 * 0.010 / tau * 2 / 5 / 0.8 / 2.0,
            marks=pytest.mark.requirement("STP-141"),
            id="linear, load side",
        ),
        pytest.param(LINEAR_MOTOR, 125.0, 0.25, marks=pytest.mark.requirement("STP-142"), id="linear motor"),
        pytest.param(
            LINEAR_MOTOR | LOAD_SIDE,
            125.0,
            0.25,
            marks=pytest.mark.requirement("STP-142", "STP-137", "VAR-141"),
            id="linear motor, LimitBase means nothing",
        ),
    ],
)
def test_conversion_of_the_limit(torque_rig, variables, limit, share):
    """Motor side as it is; load side through gear, spindle and efficiency; a linear motor as force, without
    efficiency.
    """
    assert limit_of(torque_rig(**variables), limit) == pytest.approx(share)


@pytest.mark.requirement("STP-139", "STP-129")
def test_a_speed_axis_at_its_load(torque_rig):
    """A speed axis has torque limits too, through its gear."""
    rig = torque_rig(speed=True, **LOAD_SIDE, **GEAR)
    assert limit_of(rig, 2.0) == pytest.approx(2.0 * 2 / 5 / 2.0)


@pytest.mark.requirement("STP-141")
def test_the_lead_counts_in_its_unit(torque_rig):
    """A lead of 0.010 m is one of 10 mm."""
    metres = {
        "Units.LengthUnit": 1010,
        "Units.VelocityUnit": 1061,
        "Mechanics.LeadScrew": 0.010,
        "Clamping.FollowingErrorDeviation": 0.005,
        "Clamping.PositionTolerance": 0.001,
    }
    rig = torque_rig(**metres, **LOAD_SIDE)
    assert limit_of(rig, 400.0) == pytest.approx(400.0 * 0.010 / tau / 2.0)


@pytest.mark.requirement("STP-133", "VAR-140")
@pytest.mark.parametrize(
    ("variables", "share"), [({}, 0.5), (LOAD_SIDE, 200.0 * 0.010 / tau / 2.0), (LINEAR_MOTOR, 200.0 / 500.0)]
)
def test_which_default_a_negative_limit_takes(torque_rig, variables, share):
    """Torque at the motor of a standard motor, Force at a linear load and of a linear motor."""
    defaults = {"TorqueLimiting.LimitDefaults.Torque": 1.0, "TorqueLimiting.LimitDefaults.Force": 200.0}
    assert limit_of(torque_rig(**defaults, **variables), -1.0) == pytest.approx(share)


@pytest.mark.requirement("STP-133", "STP-179", "STP-187")
def test_torques_are_in_the_unit_of_the_axis(torque_rig):
    """With Units.TorqueUnit in kNm limit, additive torque, range and defaults are kNm."""
    kilo = {
        "Units.TorqueUnit": 1128,
        "Actor.DriveParameter.ReferenceTorque": 0.002,
        "TorqueLimiting.LimitDefaults.Torque": 0.0005,
    }
    rig = torque_rig(**kilo)
    rig.enabled()
    assert limit_of(rig, 0.001) == pytest.approx(0.5)
    rig.axis.torque_additive(0.0003)
    rig.cycles(2)
    assert rig.port.additive_nm == pytest.approx(0.3)
    other = torque_rig(**kilo)
    assert limit_of(other, -1.0) == pytest.approx(0.25)
    third = torque_rig(**kilo)
    third.axis.torque_range(0.001, -0.0005)
    third.cycles(2)
    assert third.port.range_ == pytest.approx((0.5, -0.25))


@pytest.mark.requirement("STP-603", "MC-610")
@pytest.mark.parametrize(
    ("limit", "error"), [(2147483648.0, 0), (2147483649.0, 0x8043), (-2147483649.0, 0x8043)]
)
def test_range_of_the_limit(torque_rig, limit, error):
    """Beyond +-2147483648 it is rejected with 16#8043 and no limit is sent."""
    rig = torque_rig()
    job = rig.axis.torque_limiting(limit)
    rig.cycles(2)
    assert (job.ErrorID, job.Busy) == (error, not error)
    if error:
        assert rig.port.limit is None


@pytest.mark.requirement("STP-186", "MC-529", "VAR-132", "STP-179")
def test_forces_of_a_linear_motor(torque_rig):
    """Additive force and range are forces, N, shares of ReferenceForce; the variables of the force show
    them.
    """
    rig = torque_rig(**LINEAR_MOTOR)
    rig.enabled()
    rig.axis.torque_additive(50.0)
    rig.axis.torque_range(250.0, -125.0)
    rig.port.actual_torque_nm = 40.0
    rig.cycles(2)
    assert rig.port.range_ == pytest.approx((0.5, -0.25))
    assert rig.port.additive_nm == 50.0
    shown = [
        rig.axis.var(f"StatusTorqueData.{name}")
        for name in ("ActualForce", "ActualTorque", "TotalForceAdditive")
    ]
    assert shown == [40.0, 0.0, 50.0]


@pytest.mark.requirement("STP-129")
def test_limiting_goes_on_and_off_around_and_within_a_motion(torque_rig):
    """Before a job, during it and off again during it; the job goes on."""
    rig = torque_rig()
    rig.enabled()
    limiting = rig.axis.torque_limiting(1.0)
    rig.cycles(2)
    moving = rig.axis.move_velocity(100.0)
    for enable, share in ((False, None), (True, 0.5), (False, None)):
        rig.run(0.1)
        limiting.set(Enable=enable)
        rig.cycles(2)
        assert rig.port.limit == share
        assert moving.Busy


@pytest.mark.requirement("STP-159", "CFG-134", "CFG-164")
@pytest.mark.parametrize("path", ["Simulation.Mode", "VirtualAxis.Mode"])
def test_a_simulated_axis_sends_no_torque(torque_rig, path):
    """Limit, range and additive torque of a simulated or virtual axis are accepted and do not reach the
    drive.
    """
    rig = torque_rig(**{path: 1})
    rig.enabled()
    jobs = [rig.axis.torque_limiting(1.0), rig.axis.torque_additive(0.5)]
    rig.run(0.1)
    assert all(job.Busy for job in jobs)
    jobs[0].set(Enable=False)
    rig.cycles(2)
    jobs[0] = rig.axis.torque_range(1.0, -1.0)
    rig.run(0.1)
    assert all(job.Busy for job in jobs)
    assert (rig.port.limit, rig.port.range_, rig.port.additive_nm) == (None, None, 0.0)


# -- configuration
# --------------------------------------------------------------------------------------------------------


@pytest.mark.requirement("STP-164", "VAR-145")
@pytest.mark.parametrize("tolerance", [5.0, 6.0])
def test_a_clamping_tolerance_that_is_no_less_than_the_deviation_is_refused(torque_rig, tolerance):
    """The tolerance has to be smaller than the following error at which the stop is detected."""
    variables = {"Clamping.FollowingErrorDeviation": 5.0, "Clamping.PositionTolerance": tolerance}
    with pytest.raises(
        ConfigurationError, match=r"Clamping.PositionTolerance: .* below Clamping.FollowingErrorDeviation = 5"
    ):
        torque_rig(**variables)


@pytest.mark.requirement("STP-164")
def test_the_tolerance_is_checked_by_a_restart(torque_rig):
    """Written into load memory it is alarm 101, and the old value stays in force."""
    rig = torque_rig()
    rig.run(0.05)
    rig.axis.object.variables.write_start("Clamping.PositionTolerance", 5.0)
    rig.until(rig.axis.reset(restart=True).error)
    assert rig.axis.var("ErrorDetail.Number") == 101
    assert rig.axis.var("Clamping.PositionTolerance") == 1.0
