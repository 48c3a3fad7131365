"""Units of technology objects: every code, what it changes in the user program, and what stays as it is."""

from __future__ import annotations

from math import pi

import pytest

from fieldbus.errors import ConfigurationError
from motion.drives.simulated import SimulatedDrivePort
from motion.s7.axis import PositioningAxis
from motion.s7.units import unit_factors
from motion.s7.variables import VariableStore

POUND_FORCE = 4.4482216152605
INCH, FOOT, MILE = 0.0254, 0.3048, 1609.344

LENGTHS = {
    1015: ("nm", 1e-9),
    1014: ("um", 1e-6),
    1013: ("mm", 1e-3),
    1010: ("m", 1.0),
    1011: ("km", 1e3),
    1019: ("in", INCH),
    1018: ("ft", FOOT),
    1021: ("mi", MILE),
    1536: ("mm", 1e-3),
}
VELOCITIES = {
    1062: ("mm/s", 1e-3),
    1538: ("mm/s", 1e-3),
    1524: ("mm/min", 1e-3 / 60),
    1526: ("mm/h", 1e-3 / 3600),
    1061: ("m/s", 1.0),
    1525: ("m/min", 1 / 60),
    1063: ("m/h", 1 / 3600),
    1527: ("km/min", 1e3 / 60),
    1064: ("km/h", 1 / 3.6),
    1066: ("in/s", INCH),
    1069: ("in/min", INCH / 60),
    1067: ("ft/s", FOOT),
    1070: ("ft/min", FOOT / 60),
    1075: ("mi/h", MILE / 3600),
}
ANGULAR = {
    1521: ("deg/s", pi / 180),
    1539: ("deg/s", pi / 180),
    1522: ("deg/min", pi / 180 / 60),
    1086: ("rad/s", 1.0),
    1523: ("rad/min", 1 / 60),
}
METRIC = (1062, 1538, 1524, 1526, 1061, 1525, 1063, 1527, 1064)


def marked(table, ids):
    return [
        pytest.param(code, size, marks=pytest.mark.requirement(ids(code)), id=f"{code} {name}".strip())
        for code, (name, size) in table.items()
    ]


def store(kind="PositioningAxis", **units):
    return VariableStore(kind, {path.replace("__", "."): value for path, value in units.items()})


def in_si(rig):
    """Return the velocity of the setpoint in metres per second."""
    motor_rev = rig.axis.object.speed_output_rpm / 60.0
    return motor_rev * 0.01  # a lead of 10 mm, whatever the unit is


class TestCodes:
    """One unit of everything that has a unit, against the metre, the second, the newton."""

    @pytest.mark.parametrize(("code", "size"), marked(LENGTHS, lambda _: "CFG-076"))
    def test_length(self, code, size):
        """A linear motor turns one position unit per second into metres per minute: the size of the unit."""
        values = {"Actor.MotorType": 1, "Units.LengthUnit": code, "Sensor[1].System": 0}
        axis = PositioningAxis(
            "a",
            SimulatedDrivePort(cycle_s=0.004),
            cycle_ns=4_000_000,
            variables=values | {"Units.VelocityUnit": 1061},
        )
        assert axis.mechanics.rpm_per_unit == pytest.approx(60.0 * size, rel=1e-12)

    @pytest.mark.parametrize(
        ("code", "size"), marked(VELOCITIES, lambda code: "CFG-078" if code in METRIC else "CFG-079")
    )
    @pytest.mark.parametrize("length", [1013, 1010, 1019])
    def test_velocity(self, code, size, length):
        """Every velocity goes with every length: within the runtime it is position units per second."""
        found = store(Units__LengthUnit=length, Units__VelocityUnit=code)
        assert found.factors.velocity * LENGTHS[length][1] == pytest.approx(size, rel=1e-12)

    @pytest.mark.parametrize(("code", "size"), marked(ANGULAR, lambda _: "CFG-080"))
    @pytest.mark.parametrize(
        ("angle", "radians"),
        [pytest.param(1005, pi / 180, id="deg"), pytest.param(1004, 1.0, id="rad")],
    )
    def test_angular_velocity(self, code, size, angle, radians):
        """The same for angles."""
        found = store(Properties__MotionType=1, Units__LengthUnit=angle, Units__VelocityUnit=code)
        assert found.factors.velocity * radians == pytest.approx(size, rel=1e-12)

    @pytest.mark.requirement("CFG-082")
    @pytest.mark.parametrize(
        ("code", "newton"),
        [(1120, 1.0), (1122, 1000.0), (1094, POUND_FORCE), (1093, POUND_FORCE / 16), (1535, 0.138254954376)],
    )
    def test_force(self, code, newton):
        """N, kN, lbf, ozf, pdl."""
        assert store(Units__ForceUnit=code).factors.force == pytest.approx(newton, rel=1e-12)

    @pytest.mark.requirement("CFG-083")
    @pytest.mark.parametrize(
        ("code", "newton_metre"),
        [
            (1126, 1.0), (1128, 1000.0), (1529, POUND_FORCE * INCH), (1530, POUND_FORCE * FOOT),
            (1531, POUND_FORCE / 16 * INCH), (1532, POUND_FORCE / 16 * FOOT), (1533, 0.138254954376 * INCH),
            (1534, 0.138254954376 * FOOT),
        ],
    )  # fmt: skip
    def test_torque(self, code, newton_metre):
        """Nm, kNm, and pound-force, ounce-force, poundal times inch and foot."""
        assert store(Units__TorqueUnit=code).factors.torque == pytest.approx(newton_metre, rel=1e-12)

    @pytest.mark.requirement("CFG-084")
    @pytest.mark.parametrize(
        ("code", "kilogram"), [(1090, 1e-6), (1089, 1e-3), (1088, 1.0), (1092, 1e3), (1540, 0.45359237)]
    )
    def test_mass(self, code, kilogram):
        """Mg, g, kg, t, lb: the mass of a linear motor, and of the load of a linear axis."""
        found = store(Units__MassUnit=code, Actor__LoadInertia=2.0)
        assert found.bind("Actor.LoadInertia").value == pytest.approx(2.0 * kilogram, rel=1e-12)
        assert found.factors.of("mass") == pytest.approx(kilogram, rel=1e-12)

    @pytest.mark.requirement("CFG-085")
    @pytest.mark.parametrize(("code", "si"), [(1118, 1.0), (1541, 0.45359237 * FOOT**2)])
    def test_inertia(self, code, si):
        """Kg m² and lb ft²: of the motor, and of the load of a rotary axis."""
        found = store(
            Properties__MotionType=1,
            Units__LengthUnit=1005,
            Units__VelocityUnit=1521,
            Units__InertiaUnit=code,
            Actor__LoadInertia=3.0,
            Actor__DriveParameter__MotorInertia=2.0,
        )
        assert found.bind("Actor.LoadInertia").value == pytest.approx(3.0 * si, rel=1e-12)
        assert found.bind("Actor.DriveParameter.MotorInertia").value == pytest.approx(2.0 * si, rel=1e-12)

    @pytest.mark.requirement("CFG-074", "CFG-086")
    @pytest.mark.parametrize("kind", ["SpeedAxis", "PositioningAxis", "SynchronousAxis", "ExternalEncoder"])
    def test_every_code_has_a_worth(self, kind):
        """Whatever `Units.*` may be is worth something; the time is always in seconds."""
        found = VariableStore(kind)
        for path in found.paths():
            if not path.startswith("Units.") or path == "Units.TimeUnit":
                continue
            for code in found.describe(path).enum:
                values = {one: found.read(one) for one in found.paths()} | {path: code}
                assert unit_factors(
                    values.__getitem__, speed_axis=kind == "SpeedAxis", encoder=kind == "ExternalEncoder"
                )
        assert set(found.describe("Units.TimeUnit").enum) == {1054}


class TestUserProgram:
    """What a user program gives and sees is in the unit of the axis."""

    @pytest.mark.requirement("CFG-072", "CFG-078", "CFG-079")
    @pytest.mark.parametrize(
        ("length", "velocity", "value", "si", "travelled"),
        [
            (1013, 1524, 6000.0, 0.1, 100.0), (1013, 1525, 6.0, 0.1, 100.0), (1010, 1062, 100.0, 0.1, 0.1),
            (1019, 1069, 120.0, 2 * INCH, 2.0), (1013, 1064, 0.36, 0.1, 100.0),
        ],
        ids=["mm and mm/min", "mm and m/min", "m and mm/s", "in and in/min", "mm and km/h"],
    )  # fmt: skip
    def test_a_motion(self, make_rig, length, velocity, value, si, travelled):
        """The number in `Velocity` is one of the velocity unit, that in `Distance` one of the length unit."""
        size = LENGTHS[length][1] * 1000.0  # mm
        factor = VELOCITIES[velocity][1] * 1000.0
        rig = make_rig(
            variables={
                "Units.LengthUnit": length,
                "Units.VelocityUnit": velocity,
                "Mechanics.LeadScrew": 10.0 / size,
                "DynamicLimits.MaxVelocity": 500.0 / factor,
                "DynamicLimits.Velocity": 500.0 / factor,
                "DynamicLimits.MaxAcceleration": 2000.0 / size,
                "DynamicLimits.MaxDeceleration": 2000.0 / size,
                "DynamicLimits.MaxJerk": 20000.0 / size,
                "DynamicDefaults.Velocity": 100.0 / factor,
                "DynamicDefaults.Acceleration": 1000.0 / size,
                "DynamicDefaults.Deceleration": 1000.0 / size,
                "DynamicDefaults.Jerk": 10000.0 / size,
                "StandstillSignal.VelocityThreshold": 2.0 / factor,
                "FollowingError.MinVelocity": 10.0 / factor,
                "FollowingError.MinValue": 2.0 / size,
                "FollowingError.MaxValue": 10.0 / size,
                "PositioningMonitoring.Window": max(0.001, 0.1 / size),
            }
        ).enabled()
        move = rig.axis.move_velocity(value)
        rig.until(move.in_velocity)
        start = rig.axis.var("Position")
        rig.run(1.0)
        assert rig.axis.var("Position") - start == pytest.approx(travelled, rel=1e-6)
        assert in_si(rig) == pytest.approx(si, rel=1e-3)
        for path in ("Velocity", "ActualVelocity", "StatusSensor[1].Velocity", "VelocitySetpoint"):
            assert rig.axis.var(path) == pytest.approx(value, rel=1e-2), path
        halt = rig.axis.halt()
        rig.until(halt.done)
        assert rig.axis.var("StatusWord.X7")
        moved = rig.axis.move_relative(travelled / 10)  # with the default velocity
        rig.run(0.1)
        rig.until(moved.done)

    @pytest.mark.requirement("CFG-072", "CFG-081")
    def test_accelerations_do_not_follow_the_velocity_unit(self, make_rig):
        """1000 mm/s² are 1000 mm/s² with mm/min, too: 6000 mm/min are reached after 0.1 s and the rounding of
        the jerk.
        """
        rig = make_rig(
            variables={
                "Units.VelocityUnit": 1524,
                "DynamicLimits.MaxVelocity": 30000.0,
                "DynamicLimits.Velocity": 30000.0,
                "FollowingError.MinVelocity": 600.0,
                "StandstillSignal.VelocityThreshold": 120.0,
            }
        ).enabled()
        move = rig.axis.move_velocity(6000.0, Acceleration=1000.0, Jerk=0.0)
        rig.until(move.in_velocity)
        assert max(rig.column("acceleration_setpoint")) == pytest.approx(1000.0)
        times = [row[0] for row in rig.rows if 0.0 < row[2] < 100.0 - 1e-9]
        assert times[-1] - times[0] == pytest.approx(0.1, abs=0.01)
        assert dict(rig.axis.object.trace_columns)["velocity_setpoint"] == "mm/s"

    @pytest.mark.requirement("CFG-072")
    def test_jog_and_superimposed(self, make_rig):
        """The velocities of jog and superimposed motion are in the unit of the axis."""
        rig = make_rig(
            variables={
                "Units.VelocityUnit": 1525,
                "DynamicLimits.MaxVelocity": 30.0,
                "DynamicLimits.Velocity": 30.0,
                "DynamicDefaults.Velocity": 6.0,
                "StandstillSignal.VelocityThreshold": 0.12,
                "FollowingError.MinVelocity": 0.6,
            }
        ).enabled()
        jog = rig.axis.jog(3.0)
        rig.until(jog.in_velocity)
        assert rig.column("velocity_setpoint")[-1] == pytest.approx(50.0)
        rig.axis.move_superimposed(100.0, VelocityDiff=1.2)
        rig.run(0.5)
        assert max(rig.column("velocity_setpoint")) == pytest.approx(70.0)

    @pytest.mark.requirement("CFG-072")
    def test_what_the_drive_can_reach(self, make_rig):
        """18 m/min are 300 mm/s and no more than the drive can do; 60 m/min with 3000 rpm and 10 mm are,
        which 551 says.
        """
        for limit, reported in ((18.0, False), (60.0, True)):
            rig = make_rig(
                variables={
                    "Units.VelocityUnit": 1525,
                    "DynamicLimits.MaxVelocity": limit,
                    "DynamicLimits.Velocity": 18.0,
                    "StandstillSignal.VelocityThreshold": 0.12,
                    "FollowingError.MinVelocity": 0.6,
                }
            )
            rig.cycles(2)
            assert any(event.data["number"] == 551 for event in rig.events("alarm.raised")) is reported

    @pytest.mark.requirement("CFG-072")
    def test_active_homing(self, make_rig):
        """Approach and homing velocity are in the unit of the axis: 1.2 m/min are 20 mm/s."""
        rig = make_rig(
            variables={
                "Units.VelocityUnit": 1525,
                "DynamicLimits.MaxVelocity": 30.0,
                "DynamicLimits.Velocity": 30.0,
                "StandstillSignal.VelocityThreshold": 0.12,
                "FollowingError.MinVelocity": 0.6,
                "Homing.ApproachVelocity": 1.2,
                "Homing.ReferencingVelocity": 0.3,
                "Sensor[1].ActiveHoming.Mode": 2,
            }
        ).enabled()
        rig.axis.home(0.0, mode=3)
        rig.run(1.0)
        assert max(abs(velocity) for velocity in rig.column("velocity_setpoint")) in (
            pytest.approx(20.0),
            pytest.approx(5.0),
        )

    @pytest.mark.requirement("CFG-072")
    def test_setpoints_of_the_program(self, make_rig):
        """What `MC_MotionInVelocity` is given is in the unit of the axis."""
        rig = make_rig(
            variables={
                "Units.VelocityUnit": 1525,
                "DynamicLimits.MaxVelocity": 30.0,
                "DynamicLimits.Velocity": 30.0,
                "StandstillSignal.VelocityThreshold": 0.12,
                "FollowingError.MinVelocity": 0.6,
            }
        ).enabled()
        rig.axis.motion_in_velocity(1.2)
        rig.cycles(3)
        assert rig.column("velocity_setpoint")[-1] == pytest.approx(20.0)
        assert rig.axis.var("Velocity") == pytest.approx(1.2)

    @pytest.mark.requirement("CFG-072")
    def test_a_velocity_limit(self, make_rig):
        """A limit in m/min limits in m/min, also when it is written while the axis moves; reading gives what
        was written.
        """
        rig = make_rig(
            variables={
                "Units.VelocityUnit": 1525,
                "DynamicLimits.MaxVelocity": 30.0,
                "DynamicLimits.Velocity": 30.0,
                "StandstillSignal.VelocityThreshold": 0.12,
                "FollowingError.MinVelocity": 0.6,
            }
        ).enabled()
        rig.axis.write("DynamicLimits.Velocity", 7.3)
        assert rig.axis.var("DynamicLimits.Velocity") == 7.3
        rig.cycles()
        assert rig.axis.var("DynamicLimits.Velocity") == 7.3
        rig.axis.move_velocity(20.0)
        rig.run(1.0)
        assert rig.axis.var("Velocity") == pytest.approx(7.3)
        rig.axis.object.variables.write_start("DynamicLimits.MaxVelocity", 6.1)
        assert rig.axis.var("StatusWord.X3")
        assert rig.axis.var("DynamicLimits.MaxVelocity") == 30.0

    @pytest.mark.requirement("CFG-075", "CFG-081", "CFG-008", "CFG-006")
    @pytest.mark.parametrize(("unit", "value"), [(1082, 10.0), (1083, 600.0), (1528, 36000.0)])
    def test_speed_axis(self, make_rig, unit, value):
        """10 revolutions per second, written in any unit; the acceleration counts revolutions in seconds with
        each.
        """
        factor = value / 600.0
        rig = make_rig(
            speed=True,
            variables={
                "Units.VelocityUnit": unit,
                "DynamicLimits.MaxVelocity": 3000.0 * factor,
                "DynamicLimits.Velocity": 3000.0 * factor,
            },
        )
        rig.enabled()
        move = rig.axis.move_velocity(value, Acceleration=100.0, Jerk=0.0)
        rig.until(move.in_velocity)
        rising = [row[0] for row in rig.rows if 0.0 < row[2] < 600.0 - 1e-9]
        assert rising[-1] - rising[0] == pytest.approx(10.0 / 100.0, abs=0.01)
        rig.cycles(2)
        assert rig.axis.var("Velocity") == pytest.approx(value)
        assert rig.axis.var("ActualSpeed") == pytest.approx(600.0)
        assert dict(rig.axis.object.trace_columns)["velocity_setpoint"] == "rpm"

    @pytest.mark.exhaustive
    @pytest.mark.requirement("CFG-080", "CFG-072")
    def test_angles_per_minute(self, make_rig):
        """A rotary axis in degrees per minute: 3600 of them are 60 degrees per second, 10 rpm."""
        rig = make_rig(
            variables={
                "Properties.MotionType": 1,
                "Units.LengthUnit": 1005,
                "Units.VelocityUnit": 1522,
                "DynamicLimits.MaxVelocity": 30000.0,
                "DynamicLimits.Velocity": 30000.0,
            }
        ).enabled()
        move = rig.axis.move_velocity(3600.0)
        rig.until(move.in_velocity)
        assert rig.axis.object.speed_output_rpm == pytest.approx(10.0, rel=1e-2)


@pytest.mark.requirement("CFG-078", "CFG-079", "CFG-080")
@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"Units.VelocityUnit": 1521}, "1524, 1526, .*Units.LengthUnit = 1013 is a length"),
        (
            {"Properties.MotionType": 1, "Units.LengthUnit": 1005, "Units.VelocityUnit": 1062},
            "1521, 1539, 1522, 1086, 1523: Units.LengthUnit = 1005 is an angle",
        ),
    ],
)
def test_a_velocity_of_another_kind_is_refused(settings, message):
    """A length has no angular velocity, an angle no linear one."""
    with pytest.raises(ConfigurationError, match=message):
        PositioningAxis("a", SimulatedDrivePort(cycle_s=0.004), cycle_ns=4_000_000, variables=settings)


@pytest.mark.requirement("CFG-073")
def test_a_value_outside_its_range_with_another_unit():
    """The number stays when the unit changes: 0.0001 m is below the least window, and the message says so in
    the unit.
    """
    with pytest.raises(ConfigurationError, match=r"PositioningMonitoring.Window: 0.0001 is not allowed.* m$"):
        store(Units__LengthUnit=1010, Units__VelocityUnit=1061, PositioningMonitoring__Window=0.0001)
