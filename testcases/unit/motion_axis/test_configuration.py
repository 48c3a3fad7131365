"""Configurations that do not fit together are refused with the variables and the reason; what is adjusted is
warned of.
"""

from __future__ import annotations

import pytest

from fieldbus.errors import ConfigurationError
from motion.drives.simulated import SimulatedDrivePort
from motion.s7.axis import PositioningAxis, SpeedAxis
from motion.s7.axis.configuration import check_telegrams, encoders_of_telegram, setpoint_range
from motion.s7.variables import VariableStore

ROTARY = {"Properties.MotionType": 1}
LINEAR_MOTOR = {"Actor.MotorType": 1, "Sensor[1].MountingMode": 2}


def refused(settings, *, kind=PositioningAxis, encoders=1, **more):
    """Return the message with which an axis is refused."""
    port = SimulatedDrivePort(cycle_s=0.001)
    others = [SimulatedDrivePort(cycle_s=0.001) for _ in range(encoders - 1)]
    with pytest.raises(ConfigurationError) as caught:
        kind("a", port, cycle_ns=1_000_000, variables=settings, encoders=[port, *others], **more)
    return str(caught.value)


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        pytest.param(
            ROTARY | {"Actor.MotorType": 1, "Sensor[1].MountingMode": 2},
            "Actor.MotorType: 1 is not allowed; allowed: 0: a rotary axis (Properties.MotionType = 1) has a "
            "standard motor",
            marks=pytest.mark.requirement("CFG-069"),
            id="linear motor on a rotary axis",
        ),
        pytest.param(
            ROTARY | {"Sensor[1].System": 0, "Sensor[1].MountingMode": 1},
            "Sensor[1].System: 0 is not allowed; allowed: 1: a linear encoder cannot measure a rotary object",
            marks=pytest.mark.requirement("CFG-618"),
            id="linear encoder on a rotary axis",
        ),
        pytest.param(
            {"Sensor[1].System": 0},
            "Sensor[1].MountingMode: 0 is not allowed; allowed: 1 or 2: a linear encoder",
            marks=pytest.mark.requirement("CFG-513"),
            id="linear encoder on a motor shaft",
        ),
        pytest.param(
            {"Actor.MotorType": 1, "Sensor[1].MountingMode": 1},
            "Sensor[1].MountingMode: 1 is not allowed; allowed: 2: Actor.MotorType = 1 with "
            "Sensor[1].System = 1",
            marks=pytest.mark.requirement("CFG-523", "CFG-517"),
            id="linear motor, rotary encoder",
        ),
        pytest.param(
            {"Actor.MotorType": 1, "Sensor[1].System": 0, "Sensor[1].MountingMode": 2},
            "Sensor[1].MountingMode: 2 is not allowed; allowed: 0: Actor.MotorType = 1 with "
            "Sensor[1].System = 0",
            marks=pytest.mark.requirement("CFG-523", "CFG-518"),
            id="linear motor, linear encoder",
        ),
        pytest.param(
            {"Sensor[1].Backlash.Enable": True, "Sensor[1].MountingMode": 1},
            "Sensor[1].Backlash.Enable: True is not allowed; allowed: FALSE: compensation needs a "
            "standard motor",
            marks=pytest.mark.requirement("CFG-522", "CFG-618"),
            id="backlash at the load",
        ),
        pytest.param(
            ROTARY | {"Units.LengthUnit": 1013, "Units.VelocityUnit": 1062},
            "Units.LengthUnit: 1013 is not allowed; allowed: 1004, 1005: Properties.MotionType = 1 is a "
            "rotary object",
            marks=pytest.mark.requirement("CFG-069"),
            id="millimetres of a rotary axis",
        ),
        pytest.param(
            {"Units.LengthUnit": 1005, "Units.VelocityUnit": 1521},
            "Units.LengthUnit: 1005 is not allowed",
            marks=pytest.mark.requirement("CFG-068"),
            id="degrees of a linear axis",
        ),
        pytest.param(
            {"PositionControl.EnableDSC": True},
            "PositionControl.EnableDSC: True is not allowed; allowed: FALSE: the drive takes no XERR and "
            "KPC (CFG-221)",
            marks=pytest.mark.requirement("CFG-221", "VAR-180"),
            id="DSC without a telegram for it",
        ),
        pytest.param(
            {"PositionControl.InitialOperativeSensor": 2},
            "PositionControl.InitialOperativeSensor: 2 is not allowed; allowed: 1: the encoders that exist",
            marks=pytest.mark.requirement("CFG-316"),
            id="start with an encoder that is not there",
        ),
        pytest.param(
            {"PositionControl.Kv": 0.0},
            "PositionControl.Kv: 0.0 is not allowed; allowed: above 0 1/s",
            marks=pytest.mark.requirement("CFG-618", "VAR-178"),
            id="Kv",
        ),
        pytest.param(
            {"Sensor[1].Type": 2},
            "Sensor[1].Parameter.DeterminableRevolutions: 0 is not allowed; allowed: 1 or more: "
            "Sensor[1].Type = 2",
            marks=pytest.mark.requirement("CFG-299"),
            id="cyclic absolute without a range",
        ),
        pytest.param(
            {"Sensor[1].Interface.Number": 2},
            "Sensor[1].Interface.Number: 2 is not allowed; allowed: 1",
            marks=pytest.mark.requirement("CFG-285"),
            id="second encoder of a telegram with one",
        ),
        pytest.param(
            {"Actor.DriveParameter.ReferenceSpeed": 0.0},
            "Actor.DriveParameter.ReferenceSpeed: 0.0 is not allowed; allowed: above 0",
            id="no reference speed",
        ),
        pytest.param(
            {"Units.LengthUnit": 1536, "DynamicLimits.MaxVelocity": 2e9},
            "DynamicLimits.MaxVelocity: 2000000000.0 is not allowed; allowed: up to 1e+09 with six decimals",
            marks=pytest.mark.requirement("CFG-091", "VAR-020"),
            id="six decimals, velocity",
        ),
        pytest.param(
            {"Units.LengthUnit": 1536, "PositionLimits_SW.MaxPosition": 2e9},
            "PositionLimits_SW.MaxPosition: 2000000000.0 is not allowed",
            marks=pytest.mark.requirement("CFG-090", "CFG-091"),
            id="six decimals, position",
        ),
        pytest.param(
            {"Modulo.Length": 0.0},
            "Modulo.Length: 0.0 is not allowed",
            marks=pytest.mark.requirement("CFG-095"),
            id="no modulo length",
        ),
        pytest.param(
            {"Sensor[2].Existent": True},
            "Sensor[2].Existent: True is not allowed; allowed: FALSE: the axis is connected to 1 encoder(s)",
            marks=pytest.mark.requirement("CFG-175", "VAR-027"),
            id="an encoder that is not connected",
        ),
        pytest.param(
            {
                "Sensor[1].Parameter.StepsPerRevolution": 8388608,
                "Sensor[1].Parameter.FineResolutionXist1": 10,
            },
            "Sensor[1].Parameter.FineResolutionXist1: 10 is not allowed; allowed: at most 9",
            marks=pytest.mark.requirement("CFG-618"),
            id="more counts than the word has",
        ),
        pytest.param(
            {"Actor.Type": 0},
            "Actor.Type: 0 is not allowed; allowed: 1: the drive is connected by a telegram",
            marks=pytest.mark.requirement("CFG-178"),
            id="analog drive behind a telegram",
        ),
        pytest.param(
            {"StatusWord": 1},
            "StatusWord: 1 is not allowed; allowed: no value: it shows what the object does",
            marks=pytest.mark.requirement("VAR-009"),
            id="status word",
        ),
        pytest.param(
            {"ActualPosition": 5.0},
            "ActualPosition: 5.0 is not allowed",
            marks=pytest.mark.requirement("VAR-009"),
            id="actual position",
        ),
        pytest.param(
            {"Simulation.Mode": 1, "PositionControl.InitialOperativeSensor": 2},
            "PositionControl.InitialOperativeSensor: 2 is not allowed; allowed: 1",
            marks=pytest.mark.requirement("CFG-159"),
            id="simulated with the second encoder",
        ),
    ],
)
def test_contradictions(settings, message):
    """A configuration that contradicts itself is refused; the message names the variables and says why."""
    encoders = 2 if "Simulation.Mode" in settings else 1
    assert refused(settings, encoders=encoders).startswith(message)


@pytest.mark.requirement("CFG-618")
def test_all_contradictions_at_once():
    """What does not fit is named altogether, not one after the other."""
    message = refused({"PositionControl.Kv": 0.0, "Sensor[1].System": 0, "Sensor[2].Existent": True})
    assert all(
        f"{path}: " in message
        for path in ("PositionControl.Kv", "Sensor[1].MountingMode", "Sensor[2].Existent")
    )


@pytest.mark.requirement("CTL-053", "CFG-621")
def test_torque_data_without_their_telegram(make_rig):
    """Torque data switched on without telegram 750: alarm 109, cause "data exchange", until they are off and
    a restart.
    """
    path = "Actor.Interface.EnableTorqueData"
    rig = make_rig(variables={path: True, "TorquePreControl.Mode": 1})
    rig.axis.power()
    rig.run(0.1)
    assert (rig.axis.var("ErrorDetail.Number"), rig.axis.var("ErrorDetail.Reaction")) == (109, 4)
    assert rig.axis.alarms.engine.pending[0].info == 9
    assert not rig.axis.var("StatusWord.X0")
    rig.axis.power(False)
    rig.axis.variables.write_start(path, False)
    rig.until(rig.axis.reset(restart=True).ended)
    assert rig.axis.var("ErrorWord") == 0


@pytest.mark.requirement("CFG-177", "CFG-063", "CFG-175")
def test_number_of_encoders():
    """An S7-1500 has one encoder per axis, the T four; a fifth has no variables at all."""
    assert "cpu = S7-1500 has one encoder" in refused({}, encoders=2, cpu="S7-1500")
    ports = [SimulatedDrivePort(cycle_s=0.001) for _ in range(4)]
    axis = PositioningAxis("a", ports[0], cycle_ns=1_000_000, encoders=ports)
    assert [axis.var(f"Sensor[{n}].Existent") for n in range(1, 5)] == [True] * 4
    assert refused({"Sensor[5].Type": 0}).startswith("Sensor[5].Type: this is not a variable")
    assert refused({}, cpu="S7-1200").startswith("cpu: 'S7-1200' is not allowed; allowed: S7-1500T, S7-1500")


@pytest.mark.requirement("CFG-066")
def test_a_speed_axis_is_rotary():
    """A speed axis has no type of motion: asking for a linear one is refused."""
    assert refused({"Properties.MotionType": 0}, kind=SpeedAxis, encoders=1).startswith(
        "Properties.MotionType"
    )


@pytest.mark.requirement("CFG-067", "CFG-583")
@pytest.mark.parametrize(("settings", "value"), [({}, 0), (ROTARY, 1)])
def test_type_of_motion(settings, value):
    """`Properties.MotionType` shows it, and no program changes it."""
    axis = PositioningAxis("a", SimulatedDrivePort(cycle_s=0.001), cycle_ns=1_000_000, variables=settings)
    assert axis.var("Properties.MotionType") == value
    with pytest.raises(Exception, match="read only"):
        axis.write("Properties.MotionType", 1 - value)


class TestTelegrams:
    """Telegrams by type of object."""

    @pytest.mark.requirement(
        "CFG-195", "CFG-196", "CFG-197", "CFG-198", "CFG-201", "CFG-203", "CFG-176", "CFG-174"
    )
    @pytest.mark.parametrize(
        ("kind", "drive", "encoders", "fits"),
        [
            *(("SpeedAxis", number, (), True) for number in (1, 2, 3, 4, 5, 6, 102, 103, 105, 106)),
            *(("PositioningAxis", number, (), True) for number in (3, 4, 5, 6, 102, 103, 105, 106)),
            *(("PositioningAxis", number, (81,), True) for number in (1, 2, 3, 4, 5, 6, 102, 103, 105, 106)),
            ("PositioningAxis", 1, (83,), True),
            ("PositioningAxis", 1, (), False),
            ("PositioningAxis", 2, (), False),
            ("SynchronousAxis", 105, (), True),
            ("SpeedAxis", 3, (81,), False),
            ("SpeedAxis", 9, (), False),
            ("PositioningAxis", 111, (), False),
            ("PositioningAxis", 3, (82,), False),
            ("PositioningAxis", 750, (), False),
            ("ExternalEncoder", None, (81,), True),
            ("ExternalEncoder", None, (83,), True),
            ("ExternalEncoder", None, (3,), False),
            ("ExternalEncoder", 3, (81,), False),
            ("ExternalEncoder", None, (), False),
        ],
    )
    def test_per_object(self, kind, drive, encoders, fits):
        """Only the telegrams of its row can be chosen; a refusal names what can."""
        problem = check_telegrams(kind, drive, encoders)
        assert (problem is None) is fits
        if problem is not None:
            assert "allowed: " in str(problem)

    @pytest.mark.requirement("CFG-281", "CFG-282", "CFG-283")
    @pytest.mark.parametrize(
        ("number", "cpu", "connected"),
        [(1, "S7-1500T", 0), (3, "S7-1500T", 1), (6, "S7-1500T", 2), (106, "S7-1500T", 2), (6, "S7-1500", 1),
         (106, "S7-1500", 1), (4, "S7-1500T", 1), (103, "S7-1500T", 1)],
    )  # fmt: skip
    def test_connected_by_themselves(self, number, cpu, connected):
        """The encoder of a drive telegram is connected by itself; both of 6 and 106 on a T only."""
        assert encoders_of_telegram(number, cpu) == connected


class TestSetpoint:
    """Normalisation and limit of the speed setpoint."""

    @pytest.mark.requirement("CTL-109", "CFG-629", "CFG-247", "VAR-131", "CFG-622")
    @pytest.mark.parametrize(
        ("kind", "reference", "maximum", "limit", "adjusted"),
        [
            (0, 3000.0, 4000.0, 3510.0, True),
            (1, 3000.0, 7000.0, 6000.0, True),
            (1, 3000.0, 6000.0, 6000.0, False),
            (0, 3000.0, 3510.0, 3510.0, False),
        ],
    )
    def test_limit(self, kind, reference, maximum, limit, adjusted):
        """1.17 times the reference speed with an analog output, twice with a telegram."""
        store = VariableStore(
            "PositioningAxis",
            {
                "Actor.Type": kind,
                "Actor.DriveParameter.ReferenceSpeed": reference,
                "Actor.DriveParameter.MaxSpeed": maximum,
            },
        )
        found = setpoint_range(store)
        assert (found.maximum, bool(found.adjusted)) == (pytest.approx(limit), adjusted)

    @pytest.mark.requirement("CFG-629", "CFG-622", "VAR-131")
    def test_warning_110(self, make_rig):
        """The axis works with the limit, keeps the value, and warns with 110 without any reaction."""
        rig = make_rig(variables={"Actor.DriveParameter.MaxSpeed": 7000.0}).enabled()
        assert rig.axis.var("WarningWord.X1") is True
        assert rig.axis.var("ErrorWord") == 0
        assert rig.axis.var("Actor.DriveParameter.MaxSpeed") == 7000.0
        assert rig.axis.var("StatusWord.X0") is True

    @pytest.mark.requirement("CFG-280", "CFG-274")
    def test_maximum_speed(self, make_rig):
        """500 mm/s want 3000 rpm; with a maximum of 2000 rpm the setpoint stays there."""
        rig = make_rig(
            variables={
                "Actor.DriveParameter.MaxSpeed": 2000.0,
                "FollowingError.EnableMonitoring": False,
            }
        ).enabled()
        rig.axis.move_velocity(500.0)
        rig.run(1.0)
        assert max(rig.column("speed_output")) == 2000.0

    @pytest.mark.requirement("CFG-276", "CFG-277", "CFG-278", "VAR-132")
    def test_linear_motor(self):
        """A linear motor has reference values of its own."""
        values = {
            "Actor.MotorType": 1,
            "Actor.LinearMotorDriveParameter.ReferenceVelocity": 120.0,
            "Actor.LinearMotorDriveParameter.MaxVelocity": 300.0,
            "Actor.LinearMotorDriveParameter.ReferenceForce": 800.0,
        }
        found = setpoint_range(VariableStore("PositioningAxis", values))
        assert (found.reference, found.maximum, found.torque) == (120.0, 240.0, 800.0)


@pytest.mark.requirement(
    "VAR-015", "VAR-087", "VAR-018", "CFG-618", "VAR-006", "CFG-073", "CTL-010", "CTL-028"
)
@pytest.mark.parametrize(
    ("path", "value", "text"),
    [
        ("Sensor[1].System", 0, "Sensor[1].MountingMode = 0"),
        ("Mechanics.LeadScrew", 0.0, "Mechanics.LeadScrew = 0"),
        ("PositionControl.EnableDSC", True, "EnableDSC"),
    ],
)
def test_alarm_101_at_a_restart(make_rig, path, value, text):
    """A restart with start values that do not fit leaves the old ones in force: alarm 101, until a restart
    with good ones.
    """
    rig = make_rig()
    before = rig.axis.var(path)
    rig.axis.variables.write_start(path, value)
    assert rig.axis.var("StatusWord.X3") is True
    refused = rig.axis.reset(restart=True)
    rig.until(refused.error)
    assert refused.ErrorID == 0x8015
    assert (rig.axis.var("ErrorDetail.Number"), rig.axis.var("ErrorDetail.Reaction")) == (101, 4)
    assert rig.axis.var("ErrorWord.X1") is True
    assert text in rig.axis.alarms.engine.highest.text
    assert rig.axis.var(path) == before
    rig.axis.power()
    rig.run(0.1)
    assert rig.axis.var("StatusWord.X0") is False
    rig.axis.power(False)
    refused = rig.axis.reset()
    rig.until(refused.error)
    assert (refused.ErrorID, rig.axis.var("ErrorDetail.Number")) == (0x8015, 101)
    rig.axis.variables.write_start(path, before)
    rig.until(rig.axis.reset(restart=True).done)
    rig.cycles(1)
    assert rig.axis.var("ErrorWord") == 0
    rig.enabled()


@pytest.mark.requirement("CFG-272", "CFG-265", "CFG-266", "CFG-267", "VAR-011", "VAR-205")
def test_times_of_a_direct_connection(make_rig):
    """T_i, T_o, T_DC are set by themselves where the connection is direct: writing them is 16#805D."""
    rig = make_rig()
    for number in (1010, 1011, 1012):
        job = rig.axis.write_parameter(number, 0.001)
        rig.cycles(2)
        assert job.ErrorID == 0x805D
    assert rig.axis.var("StatusWord.X3") is False


@pytest.mark.requirement("CFG-053", "CFG-003", "VAR-010", "VAR-205", "MC-454", "MC-458")
def test_parameters_that_act_at_once(make_rig):
    """1000 switches the hardware limits, 1020 the reaction of the drive, both without a restart."""
    rig = make_rig()
    for number, value, path in (
        (1000, True, "PositionLimits_HW.Active"),
        (1020, 3, "Actor.RemoveEnableReaction"),
    ):
        job = rig.axis.write_parameter(number, value)
        rig.until(job.done)
        assert rig.axis.var(path) == value
    assert rig.axis.var("StatusWord.X3") is False


@pytest.mark.requirement("MC-450", "MC-451", "MC-459")
@pytest.mark.parametrize(
    ("number", "value", "error"),
    [(999, 1, 0x805A), (1000, 2.5, 0x805C), (1020, "OFF3", 0x805C), (1020, 2, 0x8FFF)],
)
def test_parameters_refused(make_rig, number, value, error):
    """An unknown number, a wrong type and a value that is not permitted have error numbers of their own."""
    rig = make_rig()
    job = rig.axis.write_parameter(number, value)
    rig.cycles(2)
    assert job.ErrorID == error


@pytest.mark.exhaustive
@pytest.mark.requirement(
    "CFG-263",
    "CFG-264",
    "CFG-268",
    "CFG-270",
    "CFG-271",
    "CFG-262",
    "VAR-012",
    "VAR-114",
    "MC-455",
    "MC-456",
    "MC-457",
    "MC-461",
    "MC-462",
)
def test_times_of_a_data_block(make_rig):
    """Through a data block the times count from 0 s, are put into force by a restart, and are lost with the
    supply.
    """
    # A controller that hardly controls shows the error that the times make, instead of correcting it.
    rig = make_rig(variables={"PositionControl.Kv": 0.001})
    axis = rig.axis.object
    axis.connection = "data_block"
    axis.apply_configuration()
    assert axis.delay_s == pytest.approx(0.004)
    for number, value in ((1010, 0.000125), (1011, 0.000125), (1012, 0.001)):
        rig.until(rig.axis.write_parameter(number, value).done)
    assert rig.axis.var("StatusWord.X3") is True
    assert axis.delay_s == pytest.approx(0.004)
    for _ in range(2):
        rig.until(rig.axis.reset(restart=True).done)
        assert rig.axis.var("StatusWord.X3") is False
        assert axis.delay_s == pytest.approx(0.00525)
    rig.enabled()
    rig.axis.move_velocity(100.0)
    rig.run(1.0)
    # The drive of this rig needs one cycle and no more, so that the times seem to be 1.25 ms too long.
    assert rig.axis.var("StatusPositioning.FollowingError") == pytest.approx(-0.125, abs=0.002)
    axis.variables.power_cycle()
    axis.apply_configuration(powered_off=True)
    assert axis.delay_s == pytest.approx(0.004)


@pytest.mark.requirement("CFG-201", "CFG-203", "CFG-012")
@pytest.mark.parametrize("telegram", [1, 2, 111])
def test_axis_on_a_telegram_without_encoder(telegram):
    """A positioning axis is not built on a drive telegram that brings no position, nor on one that it does
    not know.
    """
    port = SimulatedDrivePort(cycle_s=0.001)
    port.telegram_number = telegram
    with pytest.raises(ConfigurationError, match=f"drive telegram: {telegram} is not allowed; allowed: "):
        PositioningAxis("a", port, cycle_ns=1_000_000)
