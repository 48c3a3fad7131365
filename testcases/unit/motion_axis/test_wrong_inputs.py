"""Input values that no instruction can work with, and preconditions that are not met (sections 2 and 8.5 of
the specification).
"""

from __future__ import annotations

from math import inf, nan

import pytest

import motion.s7.instructions as instructions
from motion.s7.axis import AxisState
from testcases.catalogue import each
from testcases.unit.motion_axis.conftest import Rig, TorquePort
from testcases.unit.motion_axis.override_cells import ON_A_SYNCHRONOUS_JOB, cam_of, synchronous

ERRORS = {
    "Velocity": 0x8003,
    "VelocityDiff": 0x8003,
    "Acceleration": 0x8004,
    "AccelerationDiff": 0x8004,
    "Deceleration": 0x8005,
    "Jerk": 0x8006,
    "MasterOffset": 0x8021,
    "SlaveOffset": 0x8022,
    "MasterScaling": 0x8023,
    "SlaveScaling": 0x8024,
    "MasterStartDistance": 0x8026,
    "MasterStopDistance": 0x8026,
    "MasterSyncPosition": 0x8034,
    "SlaveSyncPosition": 0x8035,
    "SlavePosition": 0x8037,
    "Distance": 0x8008,
    "Position": 0x8009,
    "Value": 0x804A,
    "UpperLimit": 0x804B,
    "LowerLimit": 0x804C,
    "Limit": 0x8043,
}
"""ErrorID by input."""
WITHOUT_ZERO = ("Acceleration", "Deceleration")
"""Inputs that 0.0 is not allowed at; the velocity is one more where it does not mean a velocity to move with.
"""
VELOCITY_AS_AIM = (
    "MC_MoveVelocity",
    "MC_MoveJog",
    "MC_MotionInVelocity",
    "MC_MotionInPosition",
    "MC_MotionInSuperimposed",
)
DYNAMICS = ("Velocity", "Acceleration", "Deceleration", "Jerk")
NEEDS = {"MC_Stop": {"Mode": 3}}
"""Inputs without which another one is not looked at."""
START = {"MC_MoveJog": "JogForward"}
MOTION = (
    "MC_Halt",
    "MC_MoveAbsolute",
    "MC_MoveRelative",
    "MC_MoveVelocity",
    "MC_MoveJog",
    "MC_MoveSuperimposed",
    "MC_HaltSuperimposed",
    "MC_Stop",
)


def numeric(kind):
    """Return the inputs of an instruction that are LREAL."""
    return [key for key, default in kind.inputs.items() if isinstance(default, float)]


CASES = [
    (name, key)
    for name in sorted(instructions.__all__)
    if name.startswith("MC_") and hasattr(getattr(instructions, name), "inputs")
    if getattr(instructions, name).object_types not in (("Cam",), ("MeasuringInput",))
    if name not in ON_A_SYNCHRONOUS_JOB
    for key in numeric(getattr(instructions, name))
]


def start_of(kind):
    return START.get(kind.__name__, "Enable" if "Enable" in kind.inputs else "Execute")


def needs(name, rig):
    """Inputs that an instruction has to have for another one to be looked at."""
    if name.endswith("Out"):
        return {"MasterStopDistance": 1.0}
    if not synchronous(name):
        return NEEDS.get(name, {})
    if name == "MC_CamIn":
        return {"Master": rig.leader.object, "Cam": cam_of(rig).object, "MasterStartDistance": 1.0}
    return {"Master": rig.leader.object}


def profile_of(name, key):
    """Profile of synchronising for which an input matters, where there is a choice."""
    if "SyncProfileReference" not in getattr(instructions, name).inputs:
        return {}
    return {"SyncProfileReference": 0 if key in DYNAMICS else 1}


def moving(name=""):
    """Return a homed axis on a drive with every ability, that moves at constant velocity, and its job."""
    rig = Rig(
        port=TorquePort(),
        variables={"Actor.DriveParameter.ReferenceTorque": 4.0},
        synchronous=synchronous(name),
    ).enabled()
    rig.until(rig.axis.home(0.0).done)
    job = rig.axis.move_velocity(50.0)
    rig.until(job.in_velocity)
    return rig, job


def check_what_is_no_value(name, key, value):
    rig, running = moving(name)
    kind = getattr(instructions, name)
    one = rig.axis.run(kind(rig.axis.object, **needs(name, rig)))
    one.set(**profile_of(name, key))
    one.set(**{key: value, start_of(kind): True})
    rig.cycles(3)
    assert (one.Error, one.ErrorID, one.Busy) == (True, ERRORS[key], False)
    assert running.InVelocity
    assert rig.axis.var("Velocity") == 50.0
    assert rig.port.torque_share is None
    assert rig.port.torque_range == (1.0, -1.0)


@pytest.mark.exhaustive
@pytest.mark.requirement("MC-600", "MC-059", "MC-007", "MC-610", "MC-615")
def test_what_is_no_value(subtests):
    """No number, infinite, or beyond the range of the variables: the ErrorID of the input; the running job
    goes on.
    """
    for label, values in each(CASES, [nan, inf, -inf, 1.0e30, -1.0e30, "5.0", None]):
        with subtests.test(label):
            check_what_is_no_value(*values)


def check_zero(name, key):
    rig, running = moving(name)
    kind = getattr(instructions, name)
    one = rig.axis.run(kind(rig.axis.object, **needs(name, rig)))
    one.set(**profile_of(name, key))
    one.set(**{key: 0.0, start_of(kind): True})
    rig.cycles(2)
    given = name in VELOCITY_AS_AIM
    refused = (key in WITHOUT_ZERO and "MotionIn" not in name) or (
        key in ("Velocity", "VelocityDiff", "MasterScaling", "MasterStartDistance", "MasterStopDistance")
        and not given
    )
    if name.endswith("Out") and not refused:
        assert one.ErrorID in (0x8077, 0x8078)  # there is nothing to leave
        return
    if name == "MC_TorqueRange":
        return  # a range from or to 0.0 is one
    assert one.Error is refused
    if refused:
        assert one.ErrorID == ERRORS[key]
        assert running.InVelocity


@pytest.mark.exhaustive
@pytest.mark.requirement("MC-600", "MC-086", "MC-087", "MC-088", "MC-090", "MC-091", "MC-092")
def test_zero(subtests):
    """0.0 is refused as acceleration, deceleration and velocity of a way; everywhere else it is a value."""
    for label, values in each(CASES):
        with subtests.test(label):
            check_zero(*values)


NO_CHOICE_NAME_KEY_ERROR = [
    ("MC_Halt", "Mode", 0x800A),
    ("MC_Stop", "Mode", 0x800A),
    ("MC_MoveAbsolute", "BufferMode", 0x800A),
    ("MC_MoveRelative", "BufferMode", 0x800A),
    ("MC_MoveVelocity", "Direction", 0x8007),
    ("MC_Home", "Mode", 0x800A),
    ("MC_SetSensor", "Sensor", 0x8050),
    ("MC_SetSensor", "Mode", 0x800A),
    ("MC_TorqueLimiting", "Mode", 0x800A),
    ("MC_WriteParameter", "ParameterNumber", 0x805A),
    ("MC_SetAxisSTW", "STW1BitMask", 0x8055),
    ("MC_SetAxisSTW", "STW2BitMask", 0x8055),
    ("MC_SetAxisSTW", "STW1", None),
    ("MC_SetAxisSTW", "STW2", None),
]


def check_what_is_no_choice(value, name, key, error):
    if key in ("STW1", "STW2") and value == 99:
        value = 0x10000
    rig, running = moving()
    kind = getattr(instructions, name)
    one = rig.axis.run(kind(rig.axis.object, **{key: value, start_of(kind): True}))
    rig.cycles(2)
    if name == "MC_SetAxisSTW" and "Mask" in key and value == 99:
        assert one.ErrorID == (0x8055 if key == "STW1BitMask" else 0)  # 99 = 16#63 is a mask of STW2
        return
    assert one.Error
    assert one.ErrorID == error or error is None
    assert running.InVelocity


@pytest.mark.exhaustive
@pytest.mark.requirement("MC-600")
def test_what_is_no_choice(subtests):
    """Modes, directions, numbers and words that there are not: an ErrorID, never an exception."""
    for label, values in each([nan, 1.0e30, -1, 99, "0", None, [0]], NO_CHOICE_NAME_KEY_ERROR):
        with subtests.test(label):
            check_what_is_no_choice(*values)


@pytest.mark.exhaustive
@pytest.mark.requirement("MC-003", "MC-255")
@pytest.mark.parametrize("direction", [0, 4, nan])
def test_direction_on_a_modulo_axis(make_rig, direction):
    """MC_MoveAbsolute.Direction is looked at on a modulo axis only: 16#8007."""
    modulo = {"Modulo.Enable": True, "Modulo.Length": 360.0}
    for variables, error in ((modulo, 0x8007), ({}, 0)):
        rig = make_rig(variables=variables).enabled()
        rig.until(rig.axis.home(0.0).done)
        job = rig.axis.move_absolute(5.0, Direction=direction)
        rig.cycles(2)
        assert job.ErrorID == error


@pytest.mark.requirement(
    "MC-245", "MC-274", "MC-291", "MC-315", "MC-341", "MC-361", "MC-222", "MC-393", "MC-010"
)
@pytest.mark.parametrize("name", MOTION)
def test_the_object_has_to_be_enabled(rig, name):
    """16#800F on a disabled axis; the same instance is accepted with a new edge when it is enabled."""
    rig.cycles(5)
    rig.until(rig.axis.home(0.0).done)
    kind = getattr(instructions, name)
    one = rig.axis.run(kind(rig.axis.object))
    one.set(**{start_of(kind): True})
    rig.cycles(3)
    assert (one.Error, one.ErrorID, one.Busy) == (True, 0x800F, False)
    one.set(**{start_of(kind): False})
    rig.enabled()
    assert not one.Error
    one.set(**{start_of(kind): True})
    rig.cycles(3)
    assert not one.Error


@pytest.mark.requirement(
    "MC-126", "MC-244", "MC-274", "MC-291", "MC-315", "MC-222", "MC-341", "MC-361", "MC-393"
)
@pytest.mark.parametrize("name", MOTION)
def test_the_object_has_to_be_configured_correctly(rig, name):
    """A restart with a wrong start value: alarm 101, the object is not enabled, and no job is executed."""
    rig.cycles(5)
    rig.axis.variables.write_start("Mechanics.LeadScrew", 0.0)
    reset = rig.axis.reset(restart=True)
    rig.until(lambda: reset.Done or reset.Error)
    assert rig.axis.var("ErrorDetail.Number") == 101
    power = rig.axis.power()
    rig.run(0.3)
    assert (power.Status, power.Error, power.ErrorID) == (False, True, 0x8001)
    kind = getattr(instructions, name)
    one = rig.axis.run(kind(rig.axis.object, **{start_of(kind): True}))
    rig.cycles(3)
    assert (one.Busy, getattr(one, "Done", False)) == (False, False)
    # MC_Stop gives way to the alarm without an error (MC-420).
    assert one.CommandAborted if name == "MC_Stop" else one.ErrorID == 0x8001


@pytest.mark.requirement("MC-430")
def test_control_words_need_a_correct_configuration():
    """MC_SetAxisSTW on an object with a wrong configuration: 16#8001, the telegram stays as it is."""
    rig = Rig(port=TorquePort())
    rig.cycles(5)
    rig.axis.variables.write_start("Mechanics.LeadScrew", 0.0)
    reset = rig.axis.reset(restart=True)
    rig.until(lambda: reset.Done or reset.Error)
    assert rig.axis.var("ErrorDetail.Number") == 101
    job = rig.axis.set_axis_stw(STW1=0x1000, STW1BitMask=0x1000)
    rig.cycles(3)
    assert job.ErrorID == 0x8001
    assert not rig.port.stw1 & 0x1000


@pytest.mark.requirement("MC-375", "MC-618")
def test_set_sensor_needs_an_encoder_that_exists(rig):
    """16#8050 for one that is not configured."""
    rig.cycles(5)
    for sensor in (2, 3, 4):
        job = rig.axis.set_sensor(sensor)
        rig.cycles(2)
        assert job.ErrorID == 0x8050
    other = rig.axis.set_sensor(1, mode=3, reference=2)
    rig.cycles(2)
    assert other.ErrorID == 0x8051


@pytest.mark.requirement("MC-432", "MC-431")
@pytest.mark.parametrize("mode", [0, 1])
def test_set_axis_stw_needs_a_telegram(mode):
    """In simulation and without a telegram: an error, no bit changed."""
    port = TorquePort()
    port.speaks_telegram = mode == 1
    rig = Rig(port=port, variables={"Simulation.Mode": mode})
    rig.cycles(5)
    job = rig.axis.set_axis_stw(STW1=0x1000, STW1BitMask=0x1000)
    rig.cycles(3)
    assert job.Error
    assert job.ErrorID != 0
    assert not rig.axis.stw1_sent & 0x1000


@pytest.mark.requirement("MC-451", "MC-454", "MC-620")
@pytest.mark.parametrize("value", [1, 0, 2, 1.0, "TRUE", None])
def test_limit_switches_take_a_bool(rig, value):
    """A value of another type is 16#805C, and the switches stay as they are."""
    rig.enabled()
    before = rig.axis.var("PositionLimits_HW.Active")
    job = rig.axis.write_parameter(1000, value)
    rig.cycles(2)
    assert (job.Error, job.ErrorID) == (True, 0x805C)
    assert rig.axis.var("PositionLimits_HW.Active") is before


@pytest.mark.requirement("MC-454", "MC-450", "MC-620")
@pytest.mark.parametrize("value", [True, False])
def test_a_speed_axis_has_no_limit_switches(make_rig, value):
    """Index 1000 is not allowed for it: 16#805A."""
    rig = make_rig(speed=True).enabled()
    job = rig.axis.write_parameter(1000, value)
    rig.cycles(2)
    assert (job.Error, job.ErrorID) == (True, 0x805A)


@pytest.mark.requirement("MC-447", "MC-620", "MC-451", "OVR-111")
def test_write_parameter(rig):
    """Without enable, over nothing: unknown number 16#805A, wrong type 16#805C, times with a direct
    connection 16#805D.
    """
    rig.cycles(5)
    for number, value, error in (
        (999, True, 0x805A),
        (1000, "on", 0x805C),
        (1020, 1.5, 0x805C),
        (1011, 0.001, 0x805D),
    ):
        job = rig.axis.write_parameter(number, value)
        rig.cycles(2)
        assert job.ErrorID == error
    first, second = rig.axis.write_parameter(1000, True), rig.axis.write_parameter(1000, False)
    rig.cycles(2)
    assert (first.Done, second.Done) == (True, True)
    assert rig.axis.var("PositionLimits_HW.Active") is False
    rig.enabled()
    moving_job = rig.axis.move_velocity(50.0)
    rig.until(moving_job.in_velocity)
    rig.axis.write_parameter(1000, True)
    rig.cycles(5)
    assert moving_job.InVelocity


@pytest.mark.requirement("MC-622", "MC-541", "MC-103")
def test_what_needs_position_control():
    """16#8071 for fixed-stop detection without position control."""
    rig = Rig(port=TorquePort()).enabled(start_mode=0)
    detection = rig.axis.torque_limiting(1.0, mode=1)
    rig.cycles(2)
    assert detection.ErrorID == 0x8071


@pytest.mark.requirement("MC-414", "MC-540", "MC-512", "MC-522")
@pytest.mark.parametrize("phase", ["braking", "standstill"])
def test_no_torque_instruction_during_a_stop(phase):
    """16#800F while MC_Stop brakes and while it holds; those that are active stay so."""
    rig, _ = moving()
    before = rig.axis.torque_additive(0.25)
    stop = rig.axis.stop(3, Deceleration=100.0)
    rig.cycles(3)
    if phase == "standstill":
        rig.until(stop.done)
    jobs = [rig.axis.torque_additive(0.5), rig.axis.torque_range(1.0, -1.0), rig.axis.torque_limiting(1.0)]
    rig.cycles(2)
    assert [job.ErrorID for job in jobs] == [0x800F] * 3
    assert before.Busy
    assert rig.port.additive_nm == 0.25


@pytest.mark.requirement("MC-184", "OVR-104")
@pytest.mark.parametrize("restart", [False, True])
def test_nothing_aborts_a_reset(rig, restart):
    """Neither another acknowledgement nor, on a disabled axis, a restart lets an MC_Reset show
    CommandAborted.
    """
    rig.cycles(5)
    rig.port.fault = True
    first = rig.axis.reset()
    rig.cycles(2)
    assert first.Busy
    second = rig.axis.reset(restart=restart)
    rig.port.fault = False
    rig.until(lambda: first.Done and second.Done)
    assert (first.CommandAborted, second.CommandAborted) == (False, False)
    assert rig.axis.state is AxisState.DISABLED
