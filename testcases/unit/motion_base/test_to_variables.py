"""Variables of technology objects: paths, units, initial values and configuration."""

import pytest

from fieldbus.errors import ConfigurationError
from motion.s7.variables import UnknownVariableError, VariableStore, object_types

TYPES = ("SpeedAxis", "PositioningAxis", "SynchronousAxis", "ExternalEncoder")


@pytest.fixture
def store() -> VariableStore:
    return VariableStore("PositioningAxis")


class TestPaths:
    """Names of variables, elements and bits."""

    def test_types(self):
        """The object types are those of the variable catalogue."""
        assert object_types() == (*TYPES, "LeadingAxisProxy")

    @pytest.mark.requirement("VAR-022", "VAR-024", "VAR-025")
    @pytest.mark.parametrize(
        ("kind", "path"),
        [
            ("SpeedAxis", "Position"),
            ("SpeedAxis", "ActualPosition"),
            ("SpeedAxis", "Sensor[1].Type"),
            ("SpeedAxis", "Homing.HomePosition"),
            ("SpeedAxis", "PositionControl.Kv"),
            ("ExternalEncoder", "StatusWord2"),
            ("ExternalEncoder", "Override.Velocity"),
            ("ExternalEncoder", "DynamicLimits.MaxVelocity"),
            ("ExternalEncoder", "Simulation.Mode"),
            ("ExternalEncoder", "Sensor[1].Type"),
            ("ExternalEncoder", "Sensor.ActiveHoming.Mode"),
            ("ExternalEncoder", "Sensor.Backlash.Size"),
            ("ExternalEncoder", "Sensor.MeasuringGear.Numerator"),
            ("ExternalEncoder", "Units.TorqueUnit"),
            ("SpeedAxis", "Units.LengthUnit"),
            ("PositioningAxis", "StatusSynchronizedMotion.StatusWord"),
        ],
    )
    def test_absent(self, kind, path):
        """Variables that an object type lacks do not exist there."""
        with pytest.raises(UnknownVariableError):
            VariableStore(kind).read(path)

    @pytest.mark.requirement("VAR-026")
    @pytest.mark.parametrize(
        ("kind", "path"),
        [
            ("SpeedAxis", "Units.VelocityUnit"),
            ("PositioningAxis", "Sensor[4].ActiveHoming.Mode"),
            ("PositioningAxis", "CrossPlcSynchronousOperation.Interface[32].AddressOut"),
            ("SynchronousAxis", "PositionControl.Kv"),
            ("SynchronousAxis", "StatusSynchronizedMotion.StatusWord"),
            ("ExternalEncoder", "Sensor.Type"),
            ("ExternalEncoder", "StatusSensor.State"),
        ],
    )
    def test_present(self, kind, path):
        """Array elements, inherited variables and single structures are reached by their paths."""
        store = VariableStore(kind)

        assert store.bind(path).value == store.read(path)

    @pytest.mark.requirement("VAR-027")
    def test_existing_encoders(self):
        """One encoder exists unless more are asked for."""
        assert [VariableStore("PositioningAxis").read(f"Sensor[{n}].Existent") for n in (1, 2, 3, 4)] == [
            True,
            False,
            False,
            False,
        ]
        assert VariableStore("PositioningAxis", sensors=3).read("Sensor[3].Existent")

    def test_unknown_with_suggestions(self, store):
        """An unknown path is answered with similar ones, capital letters aside."""
        with pytest.raises(UnknownVariableError) as caught:
            store.read("dynamiclimits.maxvelocity")

        assert str(caught.value).startswith(
            "PositioningAxis has no variable 'dynamiclimits.maxvelocity'; similar: DynamicLimits.MaxVelocity"
        )

    def test_nothing_similar(self, store):
        """Without similar paths the message ends after the fact."""
        with pytest.raises(UnknownVariableError, match=r"has no variable '\?\?'$"):
            store.write("??", 1)

    @pytest.mark.parametrize("path", ["StatusWord.X7", "StatusWord.%X7"])
    def test_bits(self, store, path):
        """A bit is read from its word, in both spellings; the runtime sets and clears single bits."""
        store.bind("StatusWord").value = 0x80
        assert store.read(path) is True

        store.set_internal(path, False)
        store.set_internal("StatusWord.X31", True)

        assert store.read("StatusWord") == 0x8000_0000
        assert store.read(path) is False

    @pytest.mark.parametrize("path", ["StatusWord.X32", "Velocity.X0", "Actor.RemoveEnableReaction.X16"])
    def test_no_such_bit(self, store, path):
        """Bits beyond the word and bits of numbers do not exist."""
        with pytest.raises(UnknownVariableError, match="has no bit"):
            store.read(path)

    def test_bit_has_no_cell(self, store):
        """Only whole variables can be bound."""
        with pytest.raises(UnknownVariableError):
            store.bind("StatusWord.X7")

    def test_names_of_bits_and_values(self, store):
        """The definition names bits and values."""
        assert store.describe("StatusWord").bits[7] == "Standstill"
        assert store.describe("Actor.RemoveEnableReaction").enum == {
            1: "OFF1",
            3: "OFF2",
            5: "OFF3",
            7: "OFF3_COMPAT",
        }

    @pytest.mark.requirement("VAR-070", "VAR-084")
    def test_error_word_bits(self):
        """The error word has the groups of its object type and nothing else."""
        bits = {kind: set(VariableStore(kind).describe("ErrorWord").bits) for kind in TYPES}

        assert bits["SpeedAxis"] == {0, 1, 2, 3, 4, 6, 7, 13, 15}
        assert bits["PositioningAxis"] == set(range(16)) - {14}
        assert bits["ExternalEncoder"] == {0, 1, 2, 3, 5, 7, 10, 13, 15}

    @pytest.mark.requirement("VAR-019")
    @pytest.mark.parametrize(
        ("kind", "settings", "path", "unit"),
        [
            ("PositioningAxis", {}, "Position", "mm"),
            ("PositioningAxis", {}, "DynamicLimits.MaxJerk", "mm/s3"),
            ("PositioningAxis", {"Units.LengthUnit": 1005}, "DynamicLimits.MaxAcceleration", "deg/s2"),
            ("PositioningAxis", {"Units.VelocityUnit": 1538}, "Velocity", "mm/s"),
            ("PositioningAxis", {}, "Actor.DriveParameter.ReferenceTorque", "Nm"),
            ("PositioningAxis", {}, "Override.Velocity", "%"),
            ("SpeedAxis", {}, "Velocity", "1/min"),
            ("SpeedAxis", {}, "Acceleration", "1/s2"),
            ("SpeedAxis", {}, "ErrorDetail.Reaction", ""),
        ],
    )
    def test_units(self, kind, settings, path, unit):
        """Units follow the unit codes of the object."""
        assert VariableStore(kind, settings).unit(path) == unit

    @pytest.mark.requirement("VAR-021")
    def test_limits_of_a_speed_axis(self):
        """A speed axis counts revolutions per minute: its acceleration and jerk limits are 1e12 / 60^2 and
        1e12 / 60^3.
        """
        speed, position = VariableStore("SpeedAxis"), VariableStore("PositioningAxis")
        paths = [f"DynamicLimits.{name}" for name in ("MaxVelocity", "MaxAcceleration", "MaxJerk")]

        assert [speed.describe(path).maximum for path in paths] == [
            1e12,
            pytest.approx(1e12 / 60**2),
            pytest.approx(1e12 / 60**3),
        ]
        assert [position.describe(path).maximum for path in paths] == [1e12, 1e12, 1e12]
        assert set(speed.describe("Units.VelocityUnit").enum) == {1082, 1083, 1528}


class TestInitialValues:
    """Values of a new technology object."""

    @pytest.mark.parametrize("kind", TYPES)
    def test_in_range(self, kind):
        """Every initial value has its type and lies in its range."""
        store = VariableStore(kind)

        for path in store.paths():
            variable = store.describe(path)
            assert variable.convert(path, store.read(path)) == store.read(path)
            assert variable.permits(store.read(path), 0), path

    @pytest.mark.requirement("VAR-218", "STP-351")
    @pytest.mark.parametrize(
        ("path", "value"),
        [
            ("Actor.RemoveEnableReaction", 7),
            ("Sensor[1].MeasuringGear.Numerator", 1),
            ("Sensor[1].Parameter.BehaviorGx_XIST1", 1),
            ("SetpointFilter.DynamicFilter.Mode", 0),
            ("DynamicAxisModel.VelocityTimeConstant", 0.0),
            ("PositioningMonitoring.MinDwellTime", 0.01),
            ("Units.TorqueUnit", 1126),
            ("Units.ForceUnit", 1120),
        ],
    )
    def test_vendor_defaults(self, store, path, value):
        """The defaults that the vendor states are the initial values, and marked as the vendor's."""
        assert store.read(path) == store.start_value(path) == value
        assert store.describe(path).vendor_default

    def test_other_initial_values_are_marked(self, store):
        """An initial value that is a choice of this product is not presented as the vendor's."""
        assert not store.describe("PositionControl.Kv").vendor_default


class TestConfiguration:
    """Start values given to a new object."""

    def test_any_class(self):
        """A configuration sets start value and value in force of every access class."""
        store = VariableStore(
            "PositioningAxis", {"Mechanics.LeadScrew": 5, "Actor.Type": 0, "PositionControl.Kv": 20.0}
        )

        assert store.read("Mechanics.LeadScrew") == store.start_value("Mechanics.LeadScrew") == 5.0
        assert store.read("Actor.Type") == 0
        assert store.bind("PositionControl.Kv").value == 20.0
        assert not store.online_start_values_changed

    @pytest.mark.parametrize(
        ("path", "value", "message"),
        [
            (
                "Mechanics.LeadScrew",
                0.0,
                "Mechanics.LeadScrew: 0.0 is not allowed; allowed: LREAL, 1e-12 to 1e+12 mm/rev",
            ),
            (
                "Override.Velocity",
                "fast",
                "Override.Velocity: 'fast' is not allowed; allowed: LREAL, 0 to 200 %",
            ),
            (
                "Actor.RemoveEnableReaction",
                2,
                (
                    "Actor.RemoveEnableReaction: 2 is not allowed; allowed: WORD, 1 (OFF1), 3 (OFF2), 5 "
                    "(OFF3), 7"
                ),
            ),
            (
                "Modulo.Enable",
                2,
                "Modulo.Enable: 2 is not allowed; allowed: BOOL, False or True",
            ),
            (
                "Mechanics.Leadscrew",
                5.0,
                "Mechanics.Leadscrew: this is not a variable of PositioningAxis; similar: Mech",
            ),
        ],
    )
    def test_mistakes(self, path, value, message):
        """A wrong path, type or value is refused with what is allowed."""
        with pytest.raises(ConfigurationError) as caught:
            VariableStore("PositioningAxis", {path: value})

        assert str(caught.value).startswith(message)

    def test_unknown_type(self):
        """An unknown object type is refused with the types that exist."""
        with pytest.raises(
            ConfigurationError, match="SpeedAxis, PositioningAxis, SynchronousAxis, ExternalEncoder"
        ):
            VariableStore("Cam")

    @pytest.mark.requirement("VAR-016", "VAR-017")
    def test_ranges_by_motion_type(self):
        """Where a range depends on the motion type it follows `Properties.MotionType`, in any order of the
        settings.
        """
        rotary = {"Homing.ApproachVelocity": 360_000.0, "Properties.MotionType": 1}
        assert VariableStore("PositioningAxis", rotary).read("Homing.ApproachVelocity") == 360_000.0
        with pytest.raises(ConfigurationError, match="LREAL, 0 to 10000"):
            VariableStore("PositioningAxis", {"Homing.ApproachVelocity": 10_000.1})
        with pytest.raises(ConfigurationError, match=r"LREAL, 0.002 to 1e\+12"):
            VariableStore("PositioningAxis", {"FollowingError.MaxValue": 0.001, "Properties.MotionType": 1})
