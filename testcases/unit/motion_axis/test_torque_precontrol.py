"""Torque pre-control and the inertias it needs; torque and force in the units of the axis; the force of a
linear motor.
"""

from __future__ import annotations

from math import pi, tau

import pytest

from testcases.unit.motion_axis.conftest import Rig, TorquePort

PRECONTROL = {"TorquePreControl.Mode": 1, "TorquePreControl.Scale": 100.0}
ROTARY = {"Properties.MotionType": 1, "LoadGear.Numerator": 3, "DynamicLimits.MaxAcceleration": 1e5}
INERTIA = {"Actor.DriveParameter.MotorInertia": 0.001, "Actor.LoadInertia": 0.009}
LINEAR_MOTOR = {
    "Actor.MotorType": 1,
    "Sensor[1].System": 0,
    "Sensor[1].Parameter.Resolution": 1000.0 / 131072,
    "Sensor[1].Parameter.FineResolutionXist1": 0,
    "Actor.LinearMotorDriveParameter.ReferenceVelocity": 60.0,
    "Actor.LinearMotorDriveParameter.MaxVelocity": 60.0,
    "Actor.LinearMotorDriveParameter.ReferenceForce": 200.0,
}


def accelerating(variables, acceleration, **inputs):
    """Return a rig in the constant part of an acceleration."""
    rig = Rig(variables=variables, port=TorquePort()).enabled()
    rig.axis.move_velocity(400.0, Acceleration=acceleration, Jerk=0.0, **inputs)
    rig.cycles(4)
    assert rig.column("acceleration_setpoint")[-1] == pytest.approx(acceleration)
    return rig


def degrees(radians):
    return radians * 180.0 / pi


class TestPrecontrol:
    """The additive torque that the acceleration needs."""

    @pytest.mark.requirement(
        "CFG-582", "CTL-059", "CTL-051", "CTL-019", "VAR-188", "CFG-575", "CFG-576", "CTL-018"
    )
    @pytest.mark.parametrize(
        ("scale", "alpha_motor", "torque"), [(100.0, 100.0, 0.2), (100.0, 300.0, 0.6), (50.0, 300.0, 0.3)]
    )
    def test_rotary(self, scale, alpha_motor, torque):
        """(0.001 + 0.009/9) kg m² times the acceleration of the motor, weighted."""
        variables = ROTARY | INERTIA | PRECONTROL | {"TorquePreControl.Scale": scale}
        rig = accelerating(variables, degrees(alpha_motor / 3.0))
        assert rig.port.additive_nm == pytest.approx(torque)
        assert rig.axis.var("StatusTorqueData.TotalTorqueAdditive") == pytest.approx(torque)

    @pytest.mark.requirement("CTL-054", "CTL-050")
    def test_the_filtered_acceleration_counts(self):
        """With a moving average of six cycles the torque of a step of the acceleration comes in seven equal
        parts.
        """
        average = {"SetpointFilter.DynamicFilter.Mode": 2, "SetpointFilter.DynamicFilter.T1": 0.024}
        rig = Rig(variables=ROTARY | INERTIA | PRECONTROL | average, port=TorquePort()).enabled()
        torques = []
        rig.runtime.after_cycle.append(lambda: torques.append(rig.port.additive_nm))
        rig.axis.move_velocity(400.0, Acceleration=degrees(100.0), Jerk=0.0)
        rig.cycles(14)
        rising = [value for value in torques if value > 1e-9]
        assert rising[:8] == pytest.approx([0.6 * step / 7 for step in range(1, 8)] + [0.6])

    @pytest.mark.requirement("CTL-017", "CTL-055")
    def test_position_and_velocity_wait_for_the_current_loop(self):
        """With pre-control they reach the drive later by `CurrentTimeConstant`, the torque does not, and
        nothing else moves.
        """
        behind = []
        for mode in (0, 1):
            own = {"TorquePreControl.Mode": mode, "DynamicAxisModel.CurrentTimeConstant": 0.012}
            rig = accelerating(ROTARY | INERTIA | own, 1000.0)
            assert rig.port.additive_nm == pytest.approx(mode * 0.002 * 3.0 * 1000.0 * pi / 180.0)
            rig.run(1.0)
            behind.append(rig.axis.var("Position") - rig.axis.var("ActualPosition"))
            assert rig.axis.var("ActualVelocity") == pytest.approx(400.0, rel=1e-3)
        assert behind[1] - behind[0] == pytest.approx(400.0 * 0.012, rel=1e-3)

    @pytest.mark.requirement("CTL-051", "CFG-575", "CFG-027")
    def test_linear(self):
        """A mass of 40 kg behind a screw of 10 mm and a gear of 2:1 is 40 (h / 2 pi)² / 4 at the motor."""
        variables = PRECONTROL | {
            "LoadGear.Numerator": 2,
            "Actor.LoadInertia": 40.0,
            "Actor.DriveParameter.MotorInertia": 2e-4,
        }
        rig = accelerating(variables, 1000.0)
        alpha = 1.0 / 0.01 * tau * 2
        assert rig.port.additive_nm == pytest.approx((2e-4 + 40.0 * (0.01 / tau) ** 2 / 4) * alpha)

    @pytest.mark.requirement("CFG-084", "CFG-085", "CTL-051")
    def test_units_of_inertia(self):
        """The same machine in tonnes, lb ft², inches: the same torque."""
        variables = PRECONTROL | {
            "Units.LengthUnit": 1019,
            "Units.VelocityUnit": 1066,
            "Mechanics.LeadScrew": 10.0 / 25.4,
            "LoadGear.Numerator": 2,
            "Units.MassUnit": 1092,
            "Actor.LoadInertia": 0.04,
            "Units.InertiaUnit": 1541,
            "Actor.DriveParameter.MotorInertia": 2e-4 / (0.45359237 * 0.3048**2),
        }
        rig = accelerating(variables, 1000.0 / 25.4)
        alpha = 1.0 / 0.01 * tau * 2
        assert rig.port.additive_nm == pytest.approx((2e-4 + 40.0 * (0.01 / tau) ** 2 / 4) * alpha)

    @pytest.mark.requirement("CFG-579", "CTL-053")
    def test_without_inertia(self):
        """Mode 1 with all inertias 0: nothing is pre-controlled."""
        rig = accelerating(ROTARY | PRECONTROL, 1000.0)
        assert rig.port.additive_nm == 0.0
        assert rig.axis.var("StatusTorqueData.TotalTorqueAdditive") == 0.0

    @pytest.mark.requirement("CTL-050", "CTL-018")
    def test_off(self):
        """Mode 0: nothing, whatever the inertias are."""
        rig = accelerating(ROTARY | INERTIA, 1000.0)
        assert rig.port.additive_nm == 0.0

    @pytest.mark.requirement("CTL-053", "CFG-180", "CFG-399", "VAR-139")
    def test_without_telegram_750(self):
        """Without torque data in the telegram nothing is pre-controlled."""
        port = TorquePort()
        port.has_torque_data = False
        rig = Rig(variables=ROTARY | INERTIA | PRECONTROL, port=port).enabled()
        rig.axis.move_velocity(400.0, Acceleration=1000.0, Jerk=0.0)
        rig.cycles(4)
        assert (port.additive_nm, rig.axis.var("StatusTorqueData.TotalTorqueAdditive")) == (0.0, 0.0)

    @pytest.mark.requirement("CTL-052", "VAR-119", "CTL-026", "CFG-399", "CFG-400")
    def test_sum(self):
        """MC_TorqueAdditive and pre-control add up; at the end of the acceleration the instruction's share
        remains.
        """
        rig = accelerating(ROTARY | INERTIA | PRECONTROL, degrees(200.0))
        rig.axis.torque_additive(0.5)
        rig.cycles(2)
        assert rig.port.additive_nm == pytest.approx(1.7)
        assert rig.axis.var("StatusTorqueData.TotalTorqueAdditive") == pytest.approx(1.7)
        rig.run(1.0)
        assert rig.port.additive_nm == pytest.approx(0.5)

    @pytest.mark.requirement("CTL-056")
    def test_not_without_position_control(self):
        """Without position control only MC_TorqueAdditive remains."""
        rig = accelerating(ROTARY | INERTIA | PRECONTROL, degrees(200.0), PositionControlled=False)
        assert rig.axis.var("StatusWord.X28")
        assert rig.port.additive_nm == 0.0
        rig.axis.torque_additive(0.5)
        rig.cycles(2)
        assert rig.port.additive_nm == pytest.approx(0.5)

    @pytest.mark.requirement("CFG-542", "VAR-135")
    def test_inverted_drive(self):
        """The drive gets it with the other sign, the variable shows it as the axis has it."""
        directions = {"Actor.InverseDirection": True, "Sensor[1].InverseDirection": True}
        rig = accelerating(ROTARY | INERTIA | PRECONTROL | directions, degrees(100.0))
        assert rig.port.additive_nm == pytest.approx(-0.6)
        assert rig.axis.var("StatusTorqueData.TotalTorqueAdditive") == pytest.approx(0.6)

    @pytest.mark.requirement("CFG-575", "CFG-576", "CTL-019")
    def test_changes_while_moving(self):
        """Inertias and scale act at the next cycle."""
        rig = accelerating(ROTARY | INERTIA | PRECONTROL, degrees(100.0))
        rig.axis.write("Actor.LoadInertia", 0.0)
        rig.cycles()
        assert rig.port.additive_nm == pytest.approx(0.3)
        rig.axis.write("Actor.DriveParameter.MotorInertia", 0.002)
        rig.axis.write("TorquePreControl.Scale", 150.0)
        rig.cycles()
        assert rig.port.additive_nm == pytest.approx(0.9)


class TestLinearMotor:
    """Forces in the place of torques."""

    @pytest.mark.requirement("CFG-577", "CTL-052", "CTL-026", "CFG-403", "VAR-119")
    def test_precontrol(self):
        """(5 + 20) kg at 2 m/s² are 50 N, shown in TotalForceAdditive; TotalTorqueAdditive stays 0."""
        mass = {"Actor.LinearMotorDriveParameter.MotorMass": 5.0, "Actor.LoadInertia": 20.0}
        rig = accelerating(LINEAR_MOTOR | PRECONTROL | mass, 2000.0)
        assert rig.port.additive_nm == pytest.approx(50.0)
        assert rig.axis.var("StatusTorqueData.TotalForceAdditive") == pytest.approx(50.0)
        assert rig.axis.var("StatusTorqueData.TotalTorqueAdditive") == 0.0

    @pytest.mark.requirement(
        "CFG-403", "CFG-278", "CFG-402", "VAR-118", "STP-186", "MC-529", "MC-515", "MC-525"
    )
    def test_forces(self):
        """Additive force in kN, limits as shares of the reference force, the actual force in ActualForce."""
        rig = Rig(
            variables=LINEAR_MOTOR
            | {"Units.ForceUnit": 1122, "Actor.LinearMotorDriveParameter.ReferenceForce": 0.2},
            port=TorquePort(),
        ).enabled()
        rig.axis.torque_additive(0.03)
        ranged = rig.axis.torque_range(0.1, -0.05)
        rig.cycles(2)
        assert rig.port.additive_nm == pytest.approx(30.0)
        assert rig.port.torque_range == (pytest.approx(0.5), pytest.approx(-0.25))
        rig.port.actual_torque_nm = 70.0
        assert rig.axis.var("StatusTorqueData.ActualForce") == pytest.approx(0.07)
        assert rig.axis.var("StatusTorqueData.ActualTorque") == 0.0
        ranged.set(Enable=False)
        rig.cycles(2)
        assert rig.port.torque_range == (1.0, -1.0)

    @pytest.mark.requirement("STP-142", "STP-137", "STP-133", "CFG-278")
    @pytest.mark.parametrize("side", [0, 1])
    def test_limit(self, side):
        """A limit is a force, at either side and without efficiency; below 0 that of the technology
        object.
        """
        settings = {
            "TorqueLimiting.LimitBase": side,
            "TorqueLimiting.LimitDefaults.Force": 40.0,
            "Actor.Efficiency": 0.5,
            "LoadGear.Numerator": 7,
        }
        rig = Rig(variables=LINEAR_MOTOR | settings, port=TorquePort()).enabled()
        limiting = rig.axis.torque_limiting(50.0)
        rig.cycles(2)
        assert rig.port.torque_share == pytest.approx(0.25)
        limiting.set(Limit=-1.0)
        rig.cycles(2)
        assert rig.port.torque_share == pytest.approx(0.2)

    @pytest.mark.exhaustive
    @pytest.mark.requirement("CFG-276", "CFG-277", "CFG-422", "CFG-423", "CFG-424", "VAR-123", "VAR-132")
    def test_velocity(self):
        """100 mm/s are 6 m/min; beyond the maximum velocity the output ends there; there is no ActualSpeed in
        rpm.
        """
        rig = Rig(
            variables=LINEAR_MOTOR | {"Actor.LinearMotorDriveParameter.MaxVelocity": 12.0}, port=TorquePort()
        ).enabled()
        move = rig.axis.move_velocity(100.0)
        rig.until(move.in_velocity)
        assert rig.axis.object.speed_output_rpm == pytest.approx(6.0, rel=1e-2)
        assert rig.axis.var("ActualSpeed") == 0.0
        rig.axis.move_velocity(300.0)
        rig.run(0.5)
        assert max(rig.column("speed_output")) == 12.0
        columns = dict(rig.axis.object.trace_columns)
        assert (columns["speed_output"], columns["actual_speed"], columns["actual_torque"]) == (
            "m/min",
            "m/min",
            "N",
        )


class TestTorqueUnits:
    """Torques of a standard motor in the unit of the axis."""

    @pytest.mark.requirement("CFG-083", "MC-515", "MC-525", "CFG-275", "VAR-118")
    def test_pound_force_inch(self):
        """88.5 lbf in are 10 Nm: reference torque, additive torque, limits and actual torque."""
        lbf_in = 4.4482216152605 * 0.0254
        settings = {"Units.TorqueUnit": 1529, "Actor.DriveParameter.ReferenceTorque": 40.0 / lbf_in}
        rig = Rig(variables=settings, port=TorquePort()).enabled()
        rig.axis.torque_additive(10.0 / lbf_in)
        rig.axis.torque_range(20.0 / lbf_in, -10.0 / lbf_in)
        rig.cycles(2)
        assert rig.port.additive_nm == pytest.approx(10.0)
        assert rig.port.torque_range == (pytest.approx(0.5), pytest.approx(-0.25))
        rig.port.actual_torque_nm = 10.0
        assert rig.axis.var("StatusTorqueData.ActualTorque") == pytest.approx(88.5, abs=0.01)
        assert rig.axis.var("StatusTorqueData.TotalTorqueAdditive") == pytest.approx(88.5, abs=0.01)
        assert rig.axis.var("Actor.DriveParameter.ReferenceTorque") == 40.0 / lbf_in

    @pytest.mark.requirement("CFG-082", "CFG-083", "STP-141", "STP-139")
    def test_limit_at_the_load(self):
        """A limit at the load of a linear axis is a force in its unit, with a screw in inches: 2 pi Nm at the
        motor per 1000 N and 2 pi mm.
        """
        settings = {
            "Units.LengthUnit": 1019,
            "Units.VelocityUnit": 1066,
            "Mechanics.LeadScrew": tau / 25.4,
            "Units.ForceUnit": 1122,
            "TorqueLimiting.LimitBase": 1,
            "Actor.DriveParameter.ReferenceTorque": 4.0,
        }
        rig = Rig(variables=settings, port=TorquePort()).enabled()
        rig.axis.torque_limiting(1.0)
        rig.cycles(2)
        assert rig.port.torque_share == pytest.approx(0.25)
