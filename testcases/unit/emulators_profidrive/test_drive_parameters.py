"""Parameters of the PROFIdrive axis: written over the channel, seen in the motion; shown as the drive is."""

from __future__ import annotations

import struct
from dataclasses import replace

import pytest

from emulators.drive.profidrive import AxisState, ProfidriveConfig
from emulators.drive.profidrive.faults.catalogue import BLOCKED, CATALOGUE
from emulators.drive.profidrive.parameters.drive_parameters import DriveParameters
from fieldbus.profidrive.errors import ParameterAccessError
from fieldbus.profidrive.requests import Address, Refusal, Request, Values, decode_answer
from testcases.unit.emulators_profidrive.profidrive_rig import READY, RUN, Rig


@pytest.fixture
def rig():
    """The reference axis, full ramp generator."""
    return Rig(ProfidriveConfig.reference(operating_mode=1))


@pytest.fixture
def parameters(rig):
    """Its parameters."""
    return DriveParameters(rig.drive)


def write(parameters, number, code, value):
    """Write over the channel; return the error, or None."""
    request = Request(1, 2, 1, (Address(number),), (Values(code, (value,)),)).encode()
    result = decode_answer(parameters.server.request(request)).results[0]
    return result.error if isinstance(result, Refusal) else None


@pytest.mark.requirement("PD-270", "PD-272")
@pytest.mark.parametrize(
    ("number", "stop", "state"), [(1121, 0x047E, AxisState.S2), (1135, 0x047B, AxisState.S1)]
)
def test_a_ramp_time_that_is_written_is_the_one_of_the_next_stop(rig, parameters, number, stop, state):
    """OFF1 takes p1121 * n / p1082, OFF3 p1135 * n / p1082."""
    rig.turn(1500)
    assert write(parameters, number, 0x08, 0.8) is None
    assert rig.time_until(stop, state) == pytest.approx(0.4, abs=0.06)


@pytest.mark.exhaustive
@pytest.mark.requirement("PD-268", "PD-278")
def test_reference_and_maximum_speed(rig, parameters):
    """p2000 scales the setpoint; both are refused with 77h while the pulses are on."""
    assert write(parameters, 2000, 0x08, 2000.0) is None
    rig.enable()
    rig.cycle(RUN, count=400, NSOLL_B=0x2000_0000)
    assert rig.drive.core.speed_rpm == pytest.approx(1000, abs=1)
    assert write(parameters, 2000, 0x08, 3000.0) == 0x77
    assert write(parameters, 1082, 0x08, 500.0) == 0x77
    rig.cycle(READY, count=600)
    assert write(parameters, 1082, 0x08, 500.0) is None
    rig.cycle(RUN, count=400, NSOLL_B=0x2000_0000)
    assert rig.drive.core.speed_rpm == pytest.approx(500, abs=1)


@pytest.mark.requirement("PD-276")
def test_torque_limits(rig, parameters):
    """p1520 limits at once; a limit on the wrong side of zero is refused."""
    assert write(parameters, 1520, 0x08, 1.5) is None
    assert rig.drive.torque_limit_Nm == 1.5
    assert parameters.store.value(1521) == -6.0
    assert write(parameters, 1521, 0x08, 1.0) == 0x02
    assert write(parameters, 1521, 0x08, -2.0) is None
    assert rig.drive.settings.torque_limits_Nm == (1.5, 2.0)


@pytest.mark.requirement("PD-237", "PD-266", "PD-267", "PD-280", "PD-277")
def test_other_settings(rig, parameters):
    """In the units of the parameter list."""
    settings = rig.drive.settings
    for number, code, value in (
        (925, 0x06, 5),
        (1058, 0x08, 75.0),
        (1059, 0x08, -60.0),
        (2040, 0x08, 250.0),
        (1544, 0x08, 50.0),
    ):
        assert write(parameters, number, code, value) is None
        assert parameters.store.value(number) == value
    assert settings.sign_of_life_tolerance == rig.drive.sign_of_life.tolerance == 5
    assert settings.jog_rpm == (75.0, -60.0)
    assert settings.setpoint_monitoring_ms == pytest.approx(250.0)
    assert settings.momred_evaluation_percent == 50.0


@pytest.mark.requirement("PD-121", "PD-239")
def test_operating_mode_only_in_s1(rig, parameters):
    """11h in operation; 14h for a mode that is not there."""
    rig.enable()
    assert write(parameters, 930, 0x06, 3) == 0x11
    rig.cycle(0x0400, count=5)
    assert rig.drive.state is AxisState.S1
    assert write(parameters, 930, 0x06, 2) == 0x14
    assert write(parameters, 930, 0x06, 3) is None
    assert rig.drive.settings.operating_mode == 3


@pytest.mark.requirement("PD-031", "PD-235", "PD-233", "PD-255", "PD-263")
def test_telegram_and_encoder_are_shown(parameters):
    """PNU 922 is that of the bus configuration and can only be read; P979 as the encoder is."""
    store = parameters.store
    assert store.value(922) == 105
    assert write(parameters, 922, 0x06, 3) == 0x01
    assert [store.value(979, at) for at in range(6)] == [0x5112, 0xC000_0000, 2048, 11, 9, 0]
    assert write(parameters, 418, 0x05, 4) == 0x01


@pytest.mark.requirement("PD-249", "PD-259", "PD-260", "PD-283")
def test_displays(rig, parameters):
    """Speed, torque, words and operating display as the drive is."""
    store = parameters.store
    assert store.value(2) == 42
    rig.cycle(READY, count=45)
    assert store.value(2) == 31
    rig.cycle(0x0477, count=2)
    assert store.value(2) == 21
    rig.cycle(RUN, count=2)
    assert store.value(2) == 0
    rig.cycle(RUN, count=500, **rig.speed(900))
    assert store.value(21) == pytest.approx(900, abs=1)
    assert store.value(20) == pytest.approx(900, abs=1e-3)
    assert store.value(31) == pytest.approx(rig.drive.core.torque)
    assert store.value(26) == pytest.approx(rig.drive.power.dc_link.voltage_V)
    assert (store.value(967), store.value(898)) == (RUN, RUN)
    assert store.value(968) == store.value(899) == rig.drive.words.zsw1()
    for stw1, display in ((0x046F, 13), (0x045F, 12), (0x043F, 10), (0x047E, 18), (0x047F, 0), (0x047B, 17)):
        rig.cycle(stw1, count=1, **rig.speed(900))
        assert store.value(2) == display, f"{stw1:04X}"


@pytest.mark.requirement("PD-134", "PD-135", "PD-136", "PD-138", "PD-244", "PD-284")
def test_faults_and_warnings_are_shown_and_cleared(rig, parameters):
    """The buffer of the drive; 0 to PNU 952 clears it, ZSW1 bit 3 and the reaction."""
    store = parameters.store
    rig.enable()
    rig.drive.raise_fault(BLOCKED, value=-3)
    rig.cycle(RUN)
    assert (store.value(947), store.value(949), store.value(945), store.value(2131)) == (
        BLOCKED,
        -3,
        0x7121,
        BLOCKED,
    )
    assert (store.value(2), store.value(952)) == (45, 1)
    assert rig.cycle(RUN)["ZSW1"] & 0x0008
    assert write(parameters, 952, 0x06, 0) is None
    assert not rig.cycle(RUN)["ZSW1"] & 0x0008
    assert rig.drive.state is AxisState.S1
    rig.enable()
    assert [store.value(951, at) for at in range(len(CATALOGUE))] == sorted(CATALOGUE)
    rig.drive.safety.set_sto(True)
    assert store.value(2132) == 1699
    assert any(store.value(number) for number in range(953, 961))


@pytest.mark.requirement("PD-250", "PD-251", "PD-285")
def test_saved_settings_survive_a_restart(rig, parameters):
    """What is not saved is again as configured; p0972 = 1 restarts the drive."""
    assert write(parameters, 1120, 0x08, 2.5) is None
    assert write(parameters, 971, 0x06, 1) is None
    assert write(parameters, 1121, 0x08, 7.0) is None
    rig.enable()
    assert write(parameters, 970, 0x06, 1) == 0x77
    assert write(parameters, 972, 0x06, 1) is None
    assert rig.drive.state is AxisState.IDLE
    assert (rig.drive.settings.ramp_up_s, rig.drive.settings.ramp_down_s) == (2.5, 1.0)
    assert write(parameters, 970, 0x06, 1) is None
    assert rig.drive.settings.ramp_up_s == 10.0


def test_a_setting_beyond_the_limits_leaves_the_drive_alone(rig, parameters):
    """Refused with 02h, also not-a-number."""
    before = rig.drive.settings.ramp_down_s
    for raw in (struct.pack(">f", -1.0), bytes.fromhex("7FC00000"), bytes.fromhex("7F800000")):
        request = Request(1, 2, 1, (Address(1121),)).encode() + b"\x08\x01" + raw
        assert decode_answer(parameters.server.request(request)).results == (Refusal(0x02, 0),)
    assert rig.drive.settings.ramp_down_s == before
    with pytest.raises(ParameterAccessError):
        parameters.store.write(2000, 0)


@pytest.mark.requirement("MC-577")
@pytest.mark.parametrize(("time_constant_s", "kv", "vtc_ms"), [(0.002, 7.5, 2.0), (0.004, 3.75, 4.0)])
def test_what_a_commissioning_reads(time_constant_s, kv, vtc_ms):
    """Gain and time constant that a tuning would find: the largest stable gain of the position loop in
    1000/min, ms.
    """
    config = ProfidriveConfig.reference()
    tuning = replace(config.tuning, velocity_time_constant_ms=time_constant_s * 1000.0)
    parameters = DriveParameters(Rig(replace(config, tuning=tuning)).drive)
    assert parameters.read("r5276") == pytest.approx(kv)
    assert parameters.read("r5277") == pytest.approx(vtc_ms)
    assert 0.5 * 16.66666 * parameters.read("r5276") == pytest.approx(0.125 / time_constant_s, rel=1e-5)
    for number in (490, 495, 1544, 5276, 5277):
        answer = decode_answer(parameters.server.request(Request(1, 1, 1, (Address(number),), ()).encode()))
        assert not isinstance(answer.results[0], Refusal), number
    assert [parameters.read(2902, at) for at in (0, 5, 12)] == [0.0, 100.0, -100.0]


@pytest.mark.requirement("MC-539", "STP-153", "STP-154")
def test_interconnection_for_torque_limiting(rig, parameters):
    """p1522 and p1523 on the fixed values 100 % and -100 %; p1544 is 100 %, p2194 90 % from the factory."""
    assert write(parameters, 1522, 0x07, 0x0B56FC05) is None
    assert write(parameters, 1523, 0x07, 0x0B56FC0C) is None
    assert rig.drive.settings.torque_limits_percent == (100.0, 100.0)
    assert (parameters.read("p1544"), parameters.read("p2194")) == (100.0, 90.0)
    rig.enable()
    rig.cycle(0x047F)
    assert rig.drive.torque_limit_Nm == pytest.approx(rig.drive.settings.reference_torque_nm)
