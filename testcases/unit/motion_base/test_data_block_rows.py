"""Rows of the specification that name variables: they exist under that name, with type, access class, range
and codes.
"""

from __future__ import annotations

import pytest

from fieldbus.errors import ConfigurationError
from motion.s7.variables import UnknownVariableError, VariableStore
from testcases.catalogue import each, requirements_in

KINDS = {"S": "SpeedAxis", "P": "PositioningAxis", "E": "ExternalEncoder"}
E12 = (-1e12, 1e12)


def row(identifier, *cells):
    return pytest.param(*cells, marks=pytest.mark.requirement(identifier), id=identifier)


NAME_CASES = [
    row("CFG-417", ("Actor.Interface.AddressIn",), "SP"),
    row("CFG-418", ("Actor.Interface.AddressOut",), "SP"),
    row("CFG-419", ("Actor.DriveParameter.ReferenceSpeed",), "SP"),
    row("CFG-420", ("Actor.DriveParameter.MaxSpeed",), "SP"),
    row("CFG-421", ("Actor.DriveParameter.ReferenceTorque",), "SP"),
    row("CFG-422", ("Actor.LinearMotorDriveParameter.ReferenceVelocity",), "P"),
    row("CFG-423", ("Actor.LinearMotorDriveParameter.MaxVelocity",), "P"),
    row("CFG-424", ("Actor.LinearMotorDriveParameter.ReferenceForce",), "P"),
    row("CFG-425", ("Sensor[1..4].Interface.AddressIn", "Sensor[1..4].Interface.AddressOut"), "P"),
    row("CFG-426", ("Sensor[1..4].System",), "P"),
    row("CFG-427", ("Sensor[1..4].Type",), "P"),
    row("CFG-428", ("Sensor[1..4].Parameter.Resolution",), "P"),
    row("CFG-429", ("Sensor[1..4].Parameter.StepsPerRevolution",), "P"),
    row("CFG-430", ("Sensor[1..4].Parameter.DeterminableRevolutions",), "P"),
    row(
        "CFG-432",
        ("Sensor[1..4].Parameter.ReferenceSpeed", "Sensor[1..4].Parameter.ReferenceVelocity"),
        "P",
    ),
    row("CFG-433", ("Sensor[1..4].MeasuringGear.Numerator", "Sensor[1..4].MeasuringGear.Denominator"), "P"),
    row("CFG-434", ("Sensor[1..4].Parameter.FineResolutionXist1",), "P"),
    row("CFG-435", ("Sensor[1..4].Parameter.FineResolutionXist2",), "P"),
    row("CFG-436", ("Simulation.Mode",), "SP"),
    row("CFG-584", ("LoadGear.Numerator", "LoadGear.Denominator"), "SPE"),
    row("CFG-585", ("Mechanics.LeadScrew",), "PE"),
    row("CFG-585", ("Actor.Efficiency",), "SP"),
    row("CFG-586", ("Sensor[1..4].MountingMode", "Sensor[1..4].Parameter.DistancePerRevolution"), "P"),
    row("CFG-587", ("Actor.InverseDirection",), "SP"),
    row("CFG-587", ("Sensor[1..4].InverseDirection",), "P"),
    row("CFG-588", ("Modulo.Enable", "Modulo.Length", "Modulo.StartValue"), "PE"),
    row(
        "CFG-590",
        (
            "Actor.LoadInertia",
            "Actor.DriveParameter.MotorInertia",
            "Actor.LinearMotorDriveParameter.MotorMass",
        ),
        "P",
    ),
    row("CFG-527", ("Mechanics.LeadScrew",), "PE"),
]


def check_name(paths, objects):
    for path in paths:
        names = [path.replace("1..4", str(number)) for number in range(1, 5)] if "1..4" in path else [path]
        for letter, kind in KINDS.items():
            store = VariableStore(kind)
            for name in names:
                if letter in objects:
                    store.read(name)
                else:
                    with pytest.raises(UnknownVariableError):
                        store.read(name)


@pytest.mark.exhaustive
@requirements_in(NAME_CASES)
def test_name(subtests):
    """The variable can be read under this name on the objects that have it, in every element of its array,
    and on no other.
    """
    for label, values in each(NAME_CASES):
        with subtests.test(label):
            check_name(*values)


DEFINITION_CASES = [
    row("CFG-096", "Modulo.StartValue", "LREAL", "RES", *E12),
    row("CFG-300", "Sensor[1].Parameter.StepsPerRevolution", "UDINT", "RES", 1, 8388608),
    row("CFG-301", "Sensor[1].Parameter.DeterminableRevolutions", "UDINT", "RES", 0, 8388608),
    row("CFG-304", "Sensor[1].Parameter.FineResolutionXist2", "UDINT", "RES", 0, 31),
    row("CFG-547", "Sensor[1].Backlash.Enable", "BOOL", "DIR", None, None),
    row("CFG-548", "Sensor[1].Backlash.Size", "LREAL", "DIR", 0.0, 1e12),
    row("CFG-549", "Sensor[1].Backlash.Velocity", "LREAL", "DIR", 0.0, 1e12),
    row("CFG-550", "Sensor[1].Backlash.DirectionAbsoluteHoming", "DINT", "DIR", 0, 1),
    row("CFG-575", "Actor.LoadInertia", "LREAL", "DIR", 0.0, 1e12),
    row("CFG-576", "Actor.DriveParameter.MotorInertia", "LREAL", "DIR", 0.0, 1e12),
    row("CFG-577", "Actor.LinearMotorDriveParameter.MotorMass", "LREAL", "DIR", 0.0, 1e12),
    row("CFG-578", "Actor.Efficiency", "LREAL", "RES", 0.0, 1.0),
    row("VAR-208", "PositionLimits_SW.MaxPosition", "LREAL", "DIR", *E12),
    row("VAR-208", "StatusProvidedLeadingValue.DelayedLeadingValue.Position", "LREAL", "RON", *E12),
    row("VAR-208", "StatusExtrapolation.FilteredPosition", "LREAL", "RON", *E12),
    row("VAR-210", "Actor.MotorType", "DINT", "RES", 0, 1),
    row("VAR-211", "TorqueLimiting.LimitDefaults.Force", "LREAL", "CAL", 0.0, 1e12),
    row("VAR-211", "LoadGear.Denominator", "UDINT", "RES", 1, 4294967295),
    row("VAR-211", "ActualAcceleration", "LREAL", "RON", None, None),
    row("VAR-212", "StatusInterpreterMotion.Interpreter", "DB_ANY", "RON", 0, 65535),
    row("VAR-213", "Sensor[1].PassiveHoming.SwitchLevel", "BOOL", "RES", None, None),
]


def check_definition(path, data_type, access, low, high):
    store = VariableStore("PositioningAxis")
    found = store.describe(path)
    assert (found.data_type, found.access) == (data_type, access)
    if low is None:
        return
    for value in (low, high):
        assert VariableStore("PositioningAxis", {path: value}).read(path) == value
    step = max(1e-3, abs(high) * 1e-6) if data_type == "LREAL" else 1
    for value in (low - step, high + step):
        with pytest.raises(ConfigurationError, match="is not allowed"):
            VariableStore("PositioningAxis", {path: value})


@pytest.mark.exhaustive
@requirements_in(DEFINITION_CASES)
def test_definition(subtests):
    """Type, access class and both bounds are those of the row; what lies outside is refused at the
    configuration.
    """
    for label, values in each(DEFINITION_CASES):
        with subtests.test(label):
            check_definition(*values)


@pytest.mark.requirement("VAR-209", "VAR-213")
def test_external_encoder_where_the_source_is_wrong():
    """`Sensor.Parameter.Resolution` has the range of an axis, `PassiveHoming.SwitchLevel` is read only as
    printed.
    """
    store = VariableStore("ExternalEncoder")
    assert store.describe("Sensor.Parameter.Resolution").minimum == 1e-12
    assert store.describe("Sensor.PassiveHoming.SwitchLevel").access == "RON"


@pytest.mark.requirement("VAR-214")
@pytest.mark.parametrize(
    ("wrong", "right"),
    [
        ("VirtualAxisMode", "VirtualAxis.Mode"), ("Velocity.Override", "Override.Velocity"),
        ("DynamicLimits.Acceleration", "DynamicLimits.MaxAcceleration"),
        ("SetPointFilter.DynamicFilter.Mode", "SetpointFilter.DynamicFilter.Mode"),
        ("ErrorDetails.Reaction", "ErrorDetail.Reaction"),
    ],
)  # fmt: skip
def test_misprinted_names(wrong, right):
    """Names that the source misprints do not exist; the right ones do, and are suggested where they look
    alike.
    """
    store = VariableStore("PositioningAxis")
    store.read(right)
    with pytest.raises(UnknownVariableError):
        store.read(wrong)


UNITS = {
    "CFG-076": (
        "LengthUnit",
        {
            "nm": 1015,
            "um": 1014,
            "mm": 1013,
            "m": 1010,
            "km": 1011,
            "in": 1019,
            "ft": 1018,
            "mi": 1021,
            "mm (6 decimals)": 1536,
        },
    ),
    "CFG-078": (
        "VelocityUnit",
        {
            "mm/s": 1062,
            "mm/s (6 decimals)": 1538,
            "mm/min": 1524,
            "mm/h": 1526,
            "m/s": 1061,
            "m/min": 1525,
            "m/h": 1063,
            "km/min": 1527,
            "km/h": 1064,
        },
    ),
    "CFG-079": ("VelocityUnit", {"in/s": 1066, "in/min": 1069, "ft/s": 1067, "ft/min": 1070, "mi/h": 1075}),
    "CFG-080": (
        "VelocityUnit",
        {"deg/s": 1521, "deg/s (6 decimals)": 1539, "deg/min": 1522, "rad/s": 1086, "rad/min": 1523},
    ),
    "CFG-082": ("ForceUnit", {"N": 1120, "kN": 1122, "lbf": 1094, "ozf": 1093, "pdl": 1535}),
    "CFG-083": (
        "TorqueUnit",
        {
            "Nm": 1126,
            "kNm": 1128,
            "lbf in": 1529,
            "lbf ft": 1530,
            "ozf in": 1531,
            "ozf ft": 1532,
            "pdl in": 1533,
            "pdl ft": 1534,
        },
    ),
    "CFG-084": ("MassUnit", {"mg": 1090, "g": 1089, "kg": 1088, "t": 1092, "lb": 1540}),
    "CFG-085": ("InertiaUnit", {"kg*m^2": 1118, "lb*ft^2": 1541}),
    "CFG-086": ("TimeUnit", {"s": 1054}),
}


@pytest.mark.parametrize(
    ("quantity", "codes"), [row(identifier, *cells) for identifier, cells in UNITS.items()]
)
@pytest.mark.requirement("CFG-074")
def test_units(quantity, codes):
    """Every unit has its code in `Units.*`, and every code of the object is in the tables of the
    specification.
    """
    store = VariableStore("PositioningAxis")
    enum = store.describe(f"Units.{quantity}").enum
    assert {name: enum.get(code) for name, code in codes.items()} == {name: name for name in codes}
    every = {code for other, cells in UNITS.values() if other == quantity for code in cells.values()}
    if quantity == "LengthUnit":
        every |= {1004, 1005}
    assert set(enum) == every
    with pytest.raises(ConfigurationError):
        VariableStore("PositioningAxis", {f"Units.{quantity}": 1})


@pytest.mark.requirement("CFG-081", "VAR-019")
@pytest.mark.parametrize(
    ("length", "velocity", "unit"), [(1013, 1062, "mm"), (1010, 1525, "m"), (1019, 1069, "in")]
)
def test_acceleration_and_jerk(length, velocity, unit):
    """Acceleration and jerk are in the position unit per s2 and s3, whatever the unit of velocity is."""
    store = VariableStore("PositioningAxis", {"Units.LengthUnit": length, "Units.VelocityUnit": velocity})
    assert store.unit("DynamicLimits.MaxAcceleration") == f"{unit}/s2"
    assert store.unit("DynamicLimits.MaxJerk") == f"{unit}/s3"


@pytest.mark.requirement("VAR-154")
def test_codes_of_homing():
    """Modes of active and passive homing, and the directions that they know."""
    store = VariableStore("PositioningAxis")
    for kind in ("ActiveHoming", "PassiveHoming"):
        assert store.describe(f"Sensor[1].{kind}.Mode").enum == {
            0: "ZERO_MARK",
            1: "ZERO_MARK_AND_CAM",
            2: "DIGITAL_INPUT",
        }
    assert store.describe("Sensor[1].ActiveHoming.Direction").enum == {0: "POSITIVE", 1: "NEGATIVE"}
    assert store.describe("Sensor[1].PassiveHoming.Direction").enum == {
        0: "POSITIVE",
        1: "NEGATIVE",
        2: "CURRENT",
    }


BITS = {
    "VAR-028": (0, "Enable", "SPE"),
    "VAR-030": (2, "RestartActive", "SPE"),
    "VAR-031": (3, "OnlineStartValuesChanged", "SPE"),
    "VAR-032": (4, "ControlPanelActive", "SP"),
    "VAR-033": (5, "HomingDone", "PE"),
    "VAR-034": (6, "Done", "SPE"),
    "VAR-035": (7, "Standstill", "PE"),
    "VAR-036": (8, "PositioningCommand", "P"),
    "VAR-037": (9, "JogCommand", "SP"),
    "VAR-038": (10, "VelocityCommand", "SP"),
    "VAR-039": (11, "HomingCommand", "PE"),
    "VAR-040": (12, "ConstantVelocity", "SP"),
    "VAR-041": (13, "Accelerating", "SP"),
    "VAR-042": (14, "Decelerating", "SP"),
    "VAR-043": (15, "SWLimitMinActive", "P"),
    "VAR-044": (16, "SWLimitMaxActive", "P"),
    "VAR-045": (17, "HWLimitMinActive", "P"),
    "VAR-046": (18, "HWLimitMaxActive", "P"),
    "VAR-047": (23, "MoveSuperimposedCommand", "P"),
    "VAR-048": (25, "AxisSimulation", "SP"),
    "VAR-049": (26, "TorqueLimitingCommand", "SP"),
    "VAR-050": (27, "InLimitation", "SP"),
    "VAR-051": (28, "NonPositionControlled", "P"),
    "VAR-052": (29, "KinematicsMotionCommand", "P"),
    "VAR-053": (30, "InClamping", "P"),
    "VAR-054": (31, "MotionInCommand", "P"),
}


@pytest.mark.requirement("VAR-024", "VAR-025")
@pytest.mark.parametrize("letter", "SPE")
def test_bits_of_the_status_word(letter):
    """The status word of an object has its bits under their names, and no others: the rest is reserved."""
    found = VariableStore(KINDS[letter]).describe("StatusWord").bits
    expected = {bit: name for bit, name, objects in BITS.values() if letter in objects}
    if letter in "SPE":
        expected[1] = "Error"
    assert found == expected
