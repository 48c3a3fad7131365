"""Ratios between motor, encoder and axis; encoder counts of every width; what outlasts power-off."""

from __future__ import annotations

from math import pi

import pytest

from motion.drives.simulated import SimulatedDrivePort
from motion.kernel.cell import Cell
from motion.kernel.feedback import EncoderFeedback
from motion.s7.axis import PositioningAxis
from motion.s7.axis.assembly import mechanics_of
from motion.s7.axis.configuration import given_values
from motion.s7.handles import AxisHandle
from motion.s7.units import decimals, farthest_position, travel_time_s
from motion.s7.variables import VariableStore
from testcases.catalogue import each, requirements_in
from testcases.unit.motion_axis.conftest import Rig

ROTARY = {"Properties.MotionType": 1}
LOAD_SIDE = {"Sensor[1].MountingMode": 1}
EXTERNAL = {"Sensor[1].MountingMode": 2}
STEPS = {"Sensor[1].Parameter.StepsPerRevolution": 1000, "Sensor[1].Parameter.FineResolutionXist1": 0}
LINEAR = {"Sensor[1].System": 0, "Sensor[1].MountingMode": 1, "Sensor[1].Parameter.FineResolutionXist1": 0}


def mechanics(*settings, kind="PositioningAxis"):
    variables = {}
    for one in settings:
        variables |= one
    return mechanics_of(VariableStore(kind, given_values(variables)))


class TestRatios:
    """The numbers of the specification."""

    @pytest.mark.requirement("CFG-507", "CFG-500", "VAR-134")
    def test_lead_screw_example(self):
        """Lead 10 mm, one motor revolution for two of the load: 50 motor revolutions are 1000 mm."""
        ratios = mechanics(STEPS, {"LoadGear.Denominator": 2})
        assert 50 * 1000 * ratios.increment == pytest.approx(1000.0)

    @pytest.mark.requirement("CFG-007", "CFG-027")
    def test_speed_axis_with_gear(self):
        """Ten motor revolutions per load revolution: 100 rpm of the load are 1000 rpm of the motor."""
        ratios = mechanics({"LoadGear.Numerator": 10}, kind="SpeedAxis")
        assert 100.0 * ratios.rpm_per_unit == pytest.approx(1000.0)

    @pytest.mark.requirement("CFG-509", "CFG-501", "CFG-502", "CFG-503")
    def test_encoder_at_the_load(self):
        """Three encoder revolutions per load revolution: three of them are 360 degrees, whatever the load
        gear is.
        """
        for gear in (1, 7):
            ratios = mechanics(
                ROTARY,
                STEPS,
                LOAD_SIDE,
                {"Sensor[1].MeasuringGear.Denominator": 3, "LoadGear.Numerator": gear},
            )
            assert 3 * 1000 * ratios.increment == pytest.approx(360.0)

    @pytest.mark.requirement("CFG-510", "VAR-149", "CFG-526", "VAR-148")
    def test_measuring_wheel(self):
        """Two wheel revolutions per encoder revolution, 200 mm per wheel revolution: 400 mm."""
        ratios = mechanics(
            STEPS,
            EXTERNAL,
            {"Sensor[1].MeasuringGear.Numerator": 2, "Sensor[1].Parameter.DistancePerRevolution": 200.0},
        )
        assert 1000 * ratios.increment == pytest.approx(400.0)

    @pytest.mark.requirement("CFG-511", "CFG-302", "CFG-515")
    def test_linear_scale(self):
        """A line every 0.02 mm: 500 increments are 10 mm; lead and load gear do not matter."""
        ratios = mechanics(
            LINEAR,
            {"Sensor[1].Parameter.Resolution": 0.02, "Mechanics.LeadScrew": 3.0, "LoadGear.Numerator": 5},
        )
        assert 500 * ratios.increment == pytest.approx(10.0)

    @pytest.mark.requirement("CFG-306", "CFG-303", "CFG-300")
    def test_fine_resolution(self):
        """2048 steps with 11 bits: one revolution are 4 194 304 raw increments."""
        ratios = mechanics()
        assert 4_194_304 * ratios.increment == pytest.approx(10.0)

    @pytest.mark.requirement("CFG-307")
    def test_one_bit_of_fine_resolution_too_few(self):
        """The computed position is twice the mechanical one."""
        wrong = mechanics({"Sensor[1].Parameter.FineResolutionXist1": 10})
        assert wrong.increment == pytest.approx(2.0 * mechanics().increment)

    @pytest.mark.requirement("CFG-505", "CFG-506", "CFG-541", "VAR-135")
    def test_inverted_directions(self):
        """Each flag inverts its own direction: 100 mm/s are -600 rpm, an increasing count is a negative
        motion.
        """
        assert mechanics({"Actor.InverseDirection": True}).rpm_per_unit * 100.0 == pytest.approx(-600.0)
        assert mechanics({"Actor.InverseDirection": True}).increment > 0.0
        assert mechanics({"Sensor[1].InverseDirection": True}).increment < 0.0
        assert mechanics({"Sensor[1].InverseDirection": True}).rpm_per_unit > 0.0

    @pytest.mark.requirement("CFG-077")
    def test_radians(self):
        """A rotary axis in rad turns 2 pi per revolution."""
        ratios = mechanics({"Properties.MotionType": 1, "Units.LengthUnit": 1004, "Units.VelocityUnit": 1086})
        assert ratios.travel == pytest.approx(2.0 * pi)

    @pytest.mark.requirement("CFG-276", "VAR-132")
    @pytest.mark.parametrize(
        ("unit", "velocity", "mm"), [(1013, 1062, 1.0), (1010, 1061, 1000.0), (1019, 1066, 25.4)]
    )
    def test_linear_motor(self, unit, velocity, mm):
        """The setpoint of a linear motor is m/min of the load, without gear and screw."""
        ratios = mechanics(
            {
                "Actor.MotorType": 1,
                "Units.LengthUnit": unit,
                "Units.VelocityUnit": velocity,
                "LoadGear.Numerator": 9,
            }
        )
        assert 1000.0 / mm * ratios.rpm_per_unit == pytest.approx(60.0)

    @pytest.mark.requirement("CFG-528", "CFG-529", "CFG-530")
    @pytest.mark.parametrize(
        ("settings", "counts", "way"),
        [
            ({"Mechanics.LeadScrew": 5.0, "LoadGear.Numerator": 2}, 2000, 5.0),
            ({"Sensor.System": 0, "Sensor.Parameter.Resolution": 0.01, "LoadGear.Numerator": 2}, 500, 5.0),
            ({"Properties.MotionType": 1, "LoadGear.Numerator": 4}, 4000, 360.0),
        ],
        ids=["linear, rotary encoder", "linear, linear encoder", "rotary"],
    )  # fmt: skip
    def test_external_encoder(self, settings, counts, way):
        """An external encoder has load gear and lead, or the distance of increments."""
        base = {"Sensor.Parameter.StepsPerRevolution": 1000, "Sensor.Parameter.FineResolutionXist1": 0}
        ratios = mechanics(base, settings, kind="ExternalEncoder")
        assert counts * ratios.increment == pytest.approx(way)


class TestUnits:
    """Resolution and range."""

    @pytest.mark.requirement("CFG-088", "CFG-089", "VAR-020")
    def test_decimals(self):
        """Three decimals, six with the units of higher resolution."""
        assert [decimals(1013, 1062), decimals(1536), decimals(1013, 1538), decimals(1005, 1539)] == [
            3,
            6,
            6,
            6,
        ]

    @pytest.mark.requirement("CFG-092", "CFG-093")
    def test_long_term_limit(self):
        """At 20 m/min the limit of 9.0E12 mm is reached after 4.5E8 min, with higher resolution a thousandth
        of it.
        """
        velocity = 20_000.0 / 60.0
        assert travel_time_s(velocity, 1013) / 60.0 == pytest.approx(4.5e8)
        assert travel_time_s(velocity, 1536) / 60.0 == pytest.approx(4.5e5)
        assert farthest_position(1013) <= 2**53 * 1e-3
        assert farthest_position(1536) <= 2**53 * 1e-6


class Encoder:
    """One encoder as the axis reads it: counts of a given width, an absolute value that outlasts
    power-off.
    """

    def __init__(self, **settings):
        variables = {f"Sensor[1].{path.replace('__', '.')}": value for path, value in settings.items()}
        self.port = SimulatedDrivePort(cycle_s=0.001)
        self.port.link_ok = True
        self.scale = mechanics(variables).sensors[0]
        self.offset = Cell(0.0)
        self.feedback = EncoderFeedback(self.port, self.scale, 0.001, self.offset)

    def show(self, raw):
        self.port.encoder_increments = raw
        self.feedback.update()
        return self.feedback.position

    def power_cycle(self):
        self.feedback = EncoderFeedback(
            self.port, self.scale, 0.001, self.offset, before=self.feedback, powered_off=True
        )

    def restart(self):
        self.feedback = EncoderFeedback(self.port, self.scale, 0.001, self.offset, before=self.feedback)


COARSE = {"Parameter__StepsPerRevolution": 1000, "Parameter__FineResolutionXist1": 0}
SINGLE_TURN = {**COARSE, "Parameter__DeterminableRevolutions": 1}


class NarrowPort(SimulatedDrivePort):
    """A drive whose encoder has a counter of 16 bits."""

    def read(self):
        super().read()
        self.encoder_increments &= 0xFFFF


@pytest.mark.requirement("CFG-312", "CFG-601", "CTL-110")
@pytest.mark.parametrize("behavior", [0, 1])
def test_a_narrow_counter_of_an_axis(behavior):
    """With BehaviorGx_XIST1 = 0 the axis passes the end of the counter; with 1 it sees a jump of a turn:
    alarm 521, warning 504.
    """
    narrow = {
        "Sensor[1].Parameter.BehaviorGx_XIST1": behavior,
        "Sensor[1].Parameter.StepsPerRevolution": 65536,
    }
    rig = Rig(port=NarrowPort(cycle_s=0.004, increments_per_revolution=65536), variables=narrow).enabled()
    rig.axis.move_velocity(20.0)
    rig.run(1.0)
    if behavior:
        numbers = {event.data["number"] for event in rig.events("alarm.raised")}
        assert 521 in numbers
        assert numbers <= {504, 521, 412}
    else:
        assert rig.axis.alarms.engine.pending == ()
        assert rig.axis.var("ActualPosition") > 15.0


class TestCounts:
    """Widths of the count and types of encoders."""

    @pytest.mark.requirement("CFG-310", "CFG-308", "VAR-146")
    def test_32_bits(self):
        """The step from FFFF FFFFh to 0 is one step."""
        encoder = Encoder(**COARSE)
        encoder.show(0xFFFFFFFF)
        before = encoder.feedback.position
        assert encoder.show(0) - before == pytest.approx(0.01)

    @pytest.mark.requirement("CFG-311", "CFG-309", "VAR-146")
    def test_16_bits(self):
        """With `BehaviorGx_XIST1` = 0 and 65536 increments the step from 65535 to 0 is one step."""
        encoder = Encoder(
            Parameter__StepsPerRevolution=65536,
            Parameter__FineResolutionXist1=0,
            Parameter__BehaviorGx_XIST1=0,
        )
        assert encoder.scale.bits == 16
        encoder.show(65535)
        before = encoder.feedback.position
        assert encoder.show(0) - before == pytest.approx(10.0 / 65536)

    @pytest.mark.requirement("CFG-312", "CFG-601", "VAR-146", "VAR-225")
    def test_16_bits_not_expected(self):
        """With the default a count of 16 bits makes the position jump by 65535 counts."""
        encoder = Encoder(Parameter__StepsPerRevolution=65536, Parameter__FineResolutionXist1=0)
        encoder.show(65535)
        before = encoder.feedback.position
        assert encoder.show(0) - before == pytest.approx(-65535 * 10.0 / 65536)

    @pytest.mark.requirement("CFG-313")
    def test_narrow_with_a_wide_count(self):
        """With `BehaviorGx_XIST1` = 0 a count of 32 bits is tracked too while less than half the width passes
        in a cycle.
        """
        encoder = Encoder(
            Parameter__StepsPerRevolution=65536,
            Parameter__FineResolutionXist1=0,
            Parameter__BehaviorGx_XIST1=0,
        )
        start = encoder.show(0)
        for raw in range(30_000, 300_001, 30_000):
            position = encoder.show(raw)
        assert position - start == pytest.approx(300_000 * 10.0 / 65536)

    @pytest.mark.requirement("CFG-290", "CFG-294", "CFG-605")
    def test_incremental(self):
        """After power-on the position is 0, whatever the count is; afterwards it follows the shaft."""
        encoder = Encoder(**COARSE)
        assert encoder.show(12345) == 0.0
        assert encoder.show(12445) == pytest.approx(1.0)
        encoder.power_cycle()
        assert encoder.show(12500) == 0.0

    @pytest.mark.requirement("CFG-291", "CFG-296", "CFG-299", "HOM-154", "VAR-147")
    def test_absolute_beyond_its_range(self):
        """A single-turn encoder of 10 mm that was moved from 2 to 27 mm shows 7 mm after power-on."""
        encoder = Encoder(Type=1, **SINGLE_TURN)
        encoder.show(200)
        for raw in (600, 1100, 1600, 2100, 2600, 2700):
            position = encoder.show(raw)
        assert position == pytest.approx(27.0)
        encoder.power_cycle()
        assert encoder.show(700) == pytest.approx(7.0)

    @pytest.mark.requirement("CFG-292", "CFG-297", "CFG-605")
    def test_cyclic_absolute(self):
        """The ranges passed are kept over power-off: the same motion ends at 27 mm."""
        encoder = Encoder(Type=2, **SINGLE_TURN)
        encoder.show(200)
        for raw in (600, 1100, 1600, 2100, 2600, 2700):
            encoder.show(raw)
        encoder.power_cycle()
        assert encoder.show(700) == pytest.approx(27.0)
        encoder.power_cycle()
        assert encoder.show(700 - 400) == pytest.approx(23.0)

    @pytest.mark.requirement("CFG-298", "VAR-225", "HOM-156")
    def test_moved_too_far_while_off(self):
        """Moved by more than half a range while off, the position is wrong by whole ranges."""
        encoder = Encoder(Type=2, **SINGLE_TURN)
        encoder.show(200)
        encoder.power_cycle()
        assert encoder.show(800) == pytest.approx(8.0 - 10.0)

    @pytest.mark.requirement("CFG-293", "CFG-115")
    def test_offset_outlasts_power_off(self):
        """The offset of the absolute adjustment is added to the encoder value for ever."""
        encoder = Encoder(Type=1, **SINGLE_TURN)
        encoder.show(200)
        encoder.feedback.shift(100.0)
        encoder.feedback.keep_offset()
        encoder.power_cycle()
        assert encoder.show(200) == pytest.approx(102.0)
        encoder.restart()
        assert encoder.show(300) == pytest.approx(103.0)

    @pytest.mark.requirement("CFG-336")
    def test_velocity_from_the_drive(self):
        """`ActualVelocityMode` = 1 takes the actual speed of the telegram, and the position none the less
        from the count.
        """
        encoder = Encoder(ActualVelocityMode=1, **COARSE)
        encoder.show(0)
        encoder.port.actual_speed_rpm = 750.0
        encoder.show(3)
        assert encoder.feedback.velocity == pytest.approx(125.0)
        assert encoder.feedback.position == pytest.approx(0.03)

    @pytest.mark.requirement("CFG-342", "CFG-335")
    def test_low_resolution(self):
        """One count per 0.1 mm at 20 mm/s: the difference shows 0 or 100 mm/s, 20 in the mean; the telegram a
        steady 20.
        """
        coarse = {"Parameter__StepsPerRevolution": 100, "Parameter__FineResolutionXist1": 0}
        difference, measured = Encoder(**coarse), Encoder(ActualVelocityMode=1, **coarse)
        measured.port.actual_speed_rpm = 120.0
        seen, steady = [], []
        for cycle in range(51):
            for encoder, into in ((difference, seen), (measured, steady)):
                encoder.show(cycle // 5)
                into.append(encoder.feedback.velocity)
        assert {round(one, 6) for one in seen} == {0.0, 100.0}
        assert sum(seen[1:]) / 50 == pytest.approx(20.0)
        assert steady[1:] == pytest.approx([20.0] * 50)

    @pytest.mark.requirement("CFG-343", "CFG-602")
    def test_frozen_speed(self):
        """A frozen actual speed of 0 makes the velocity 0, while the position goes on."""
        encoder = Encoder(ActualVelocityMode=1, **COARSE)
        encoder.show(0)
        encoder.show(100)
        assert (encoder.feedback.velocity, encoder.feedback.position) == (0.0, pytest.approx(1.0))


GROUPS_OF_AN_OBJECT_CASES = [
    ("Properties.MotionType", "PE"),
    ("Units.VelocityUnit", "SPE"),
    ("Modulo.Enable", "PE"),
    ("Simulation.Mode", "SP"),
    ("VirtualAxis.Mode", "SP"),
    ("Actor.Type", "SP"),
    ("Actor.DataAdaption", "SP"),
    ("Actor.Interface.EnableTorqueData", "SP"),
    ("Sensor[1].DataAdaption", "P"),
    ("Sensor.DataAdaption", "E"),
    ("Actor.InverseDirection", "SP"),
    ("Sensor[1].InverseDirection", "P"),
    ("Sensor.InverseDirection", "E"),
    ("LoadGear.Numerator", "SPE"),
    ("Sensor[1].MeasuringGear.Numerator", "P"),
    ("Sensor.MeasuringGear.Numerator", ""),
    ("Mechanics.LeadScrew", "PE"),
    ("Actor.LoadInertia", "P"),
    ("Sensor[1].Backlash.Enable", "P"),
    ("Sensor.Backlash.Enable", ""),
    ("DynamicDefaults.EmergencyDeceleration", "SP"),
    ("DynamicLimits.MaxVelocity", "SP"),
    ("TorqueLimiting.LimitBase", "SP"),
    ("PositionLimits_SW.Active", "P"),
    ("PositionLimits_HW.Active", "P"),
    ("Clamping.PositionTolerance", "P"),
    ("Sensor[1].ActiveHoming.Mode", "P"),
    ("Sensor.ActiveHoming.Mode", ""),
    ("Sensor[1].PassiveHoming.Mode", "P"),
    ("Sensor.PassiveHoming.Mode", "E"),
    ("PositioningMonitoring.Window", "P"),
    ("FollowingError.MaxValue", "P"),
    ("StandstillSignal.MinDwellTime", "PE"),
    ("PositionControl.EnableDSC", "P"),
    ("SetpointFilter.DynamicFilter.Mode", "P"),
    ("CrossPlcSynchronousOperation.LocalLeadingValueDelayTime", "PE"),
    ("Extrapolation.PositionFilter.T1", "PE"),
    ("Position", "P"),
    ("ActualPosition", "PE"),
]


def check_groups_of_an_object(path, types):
    kinds = {"S": "SpeedAxis", "P": "PositioningAxis", "E": "ExternalEncoder"}
    found = "".join(letter for letter, kind in kinds.items() if path in set(VariableStore(kind).paths()))
    assert found == types
    assert (path in set(VariableStore("SynchronousAxis").paths())) is ("P" in types)


@pytest.mark.exhaustive
@pytest.mark.requirement(
    "CFG-019",
    "CFG-020",
    "CFG-021",
    "CFG-024",
    "CFG-028",
    "CFG-029",
    "CFG-032",
    "CFG-033",
    "CFG-035",
    "CFG-036",
    "CFG-037",
    "CFG-038",
    "CFG-022",
    "CFG-023",
    "CFG-025",
    "CFG-026",
    "CFG-031",
    "CFG-030",
    "CFG-034",
)
@requirements_in(GROUPS_OF_AN_OBJECT_CASES)
def test_groups_of_an_object(subtests):
    """A technology object has the configuration groups of its type, and none of the others (CFG section
    2.2).
    """
    for label, values in each(GROUPS_OF_AN_OBJECT_CASES):
        with subtests.test(label):
            check_groups_of_an_object(*values)


NUMBERS = {"LoadGear.Numerator": 2, "Mechanics.LeadScrew": 8.0, "Sensor[1].MeasuringGear.Numerator": 3,
           "Sensor[1].Parameter.DistancePerRevolution": 5.0, "Sensor[1].Parameter.Resolution": 0.01}  # fmt: skip  # noqa: E501
LINEAR_SYSTEM = {"Sensor[1].System": 0}


@pytest.mark.parametrize(
    ("settings", "per_step", "rpm"),
    [
        pytest.param(
            {},
            3 / 2 * 8.0 / 1000,
            60.0 / 8.0 * 2,
            marks=pytest.mark.requirement("CFG-513"),
            id="linear, motor",
        ),
        pytest.param(
            LOAD_SIDE,
            3 * 8.0 / 1000,
            60.0 / 8.0 * 2,
            marks=pytest.mark.requirement("CFG-514"),
            id="linear, load",
        ),
        pytest.param(
            LOAD_SIDE | LINEAR_SYSTEM,
            3 * 0.01,
            60.0 / 8.0 * 2,
            marks=pytest.mark.requirement("CFG-515"),
            id="linear, scale",
        ),
        pytest.param(
            EXTERNAL,
            3 * 5.0 / 1000,
            60.0 / 8.0 * 2,
            marks=pytest.mark.requirement("CFG-516", "CFG-431"),
            id="linear, wheel",
        ),
        pytest.param(
            EXTERNAL | {"Actor.MotorType": 1},
            3 * 5.0 / 1000,
            0.06,
            marks=pytest.mark.requirement("CFG-517"),
            id="linear motor, rotary encoder",
        ),
        pytest.param(
            LINEAR_SYSTEM | {"Actor.MotorType": 1},
            3 * 0.01,
            0.06,
            marks=pytest.mark.requirement("CFG-518"),
            id="linear motor, scale",
        ),
        pytest.param(
            ROTARY,
            3 / 2 * 360.0 / 1000,
            60.0 / 360.0 * 2,
            marks=pytest.mark.requirement("CFG-519"),
            id="rotary, motor",
        ),
        pytest.param(
            ROTARY | LOAD_SIDE,
            3 * 360.0 / 1000,
            60.0 / 360.0 * 2,
            marks=pytest.mark.requirement("CFG-520"),
            id="rotary, load",
        ),
        pytest.param(
            ROTARY | EXTERNAL,
            3 * 5.0 / 1000,
            60.0 / 360.0 * 2,
            marks=pytest.mark.requirement("CFG-521"),
            id="rotary, wheel",
        ),
    ],
)
@pytest.mark.requirement("CFG-525", "CFG-526")
def test_configurations_of_an_axis(settings, per_step, rpm):
    """Every combination of axis, motor, mounting and measuring system has its own ratios, and an axis takes
    it.
    """
    values = STEPS | NUMBERS | settings
    axis = PositioningAxis("a", SimulatedDrivePort(cycle_s=0.001), cycle_ns=1_000_000, variables=values)
    assert axis.mechanics.increment == pytest.approx(per_step)
    assert axis.mechanics.rpm_per_unit == pytest.approx(rpm)


@pytest.mark.requirement("CFG-512")
def test_configuration_of_a_speed_axis():
    """A speed axis has the direction of the drive and the load gear, and nothing else of mechanics."""
    store = VariableStore("SpeedAxis")
    found = {
        path
        for path in store.paths()
        if path.split(".")[0] in ("LoadGear", "Mechanics", "Sensor[1]", "Modulo", "Properties")
    }
    assert found == {"LoadGear.Numerator", "LoadGear.Denominator"}
    turned = mechanics({"LoadGear.Numerator": 3, "Actor.InverseDirection": True}, kind="SpeedAxis")
    assert turned.rpm_per_unit == -3.0


class Mounted(SimulatedDrivePort):
    """A drive whose machine moves the other way, or whose encoder counts down."""

    __slots__ = ("counts_down", "turned")

    def __init__(self, *, turned=False, counts_down=False):
        super().__init__(cycle_s=0.004)
        self.turned = turned
        self.counts_down = counts_down

    def read(self):
        super().read()
        if self.counts_down:
            self.encoder_increments = -self.encoder_increments

    @property
    def machine_mm(self):
        return self._angle / (2.0 * pi) * 10.0 * (-1.0 if self.turned else 1.0)


@pytest.mark.parametrize(
    ("turned", "counts_down", "actor", "sensor"),
    [
        pytest.param(
            False, False, False, False, marks=pytest.mark.requirement("CFG-536", "CFG-535"), id="as it is"
        ),
        pytest.param(True, False, True, True, marks=pytest.mark.requirement("CFG-537"), id="machine turned"),
        pytest.param(
            False,
            True,
            False,
            True,
            marks=pytest.mark.requirement("CFG-538", "CFG-532"),
            id="encoder counts down",
        ),
    ],
)
def test_directions(make_rig, turned, counts_down, actor, sensor):
    """With the flags that fit, a positive job moves the machine forward and the axis shows it."""
    from testcases.unit.motion_axis.conftest import REFERENCE

    rig = make_rig()
    port = Mounted(turned=turned, counts_down=counts_down)
    values = REFERENCE | {"Actor.InverseDirection": actor, "Sensor[1].InverseDirection": sensor}
    axis = PositioningAxis("axis2", port, cycle_ns=4_000_000, variables=values, delay_s=0.004)
    rig.runtime.add(axis)
    handle = AxisHandle(rig.runtime, axis)
    rig.until(handle.power().status)
    rig.until(handle.move_relative(30.0).done)
    assert port.machine_mm == pytest.approx(30.0, abs=0.01)
    assert handle.var("ActualPosition") == pytest.approx(30.0, abs=0.01)
    assert axis.alarms.engine.number == 0
