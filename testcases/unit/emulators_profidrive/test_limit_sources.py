"""Parameters of the PROFIdrive axis about torque limits, standstill and brake, written while it works
(STP-528).
"""

from __future__ import annotations

from dataclasses import replace

import pytest

from emulators.drive.profidrive import AxisState, DriveSettings, ProfidriveConfig
from emulators.drive.profidrive.parameters.drive_parameters import DriveParameters
from fieldbus.errors import ConfigurationError
from fieldbus.profidrive import MELDW, to_n2
from fieldbus.profidrive.errors import ParameterAccessError
from testcases.unit.emulators_profidrive.profidrive_rig import READY, RUN, Rig

OWN_UP, OWN_LOW = 0x05F0FC00, 0x05F1FC00
FIXED = 0x0B56FC00
"""r2902[0]."""


def build(telegram=105, **changes):
    """Return the axis with p2003 = 2 Nm and p1520 = 6 Nm, and its parameters."""
    rig = Rig(replace(ProfidriveConfig.reference(telegram=telegram), rated_torque_nm=40.0, **changes))
    return rig, DriveParameters(rig.drive)


@pytest.mark.exhaustive
@pytest.mark.requirement("STP-153", "STP-154", "MC-539", "MC-577")
def test_limits_from_fixed_values():
    """p1522 on +100 % and p1523 on -100 % make p2003 the limits; MOMRED then takes its share of p2003, in
    both directions.
    """
    rig, parameters = build()
    assert [parameters.read("r2902", at) for at in (5, 12)] == [100.0, -100.0]
    assert (parameters.read("p1522"), parameters.read("p1523")) == (OWN_UP, OWN_LOW)
    rig.enable()
    rig.drive.mechanics.jam(True)
    for connected, limit in ((False, 6.0), (True, 2.0)):
        if connected:
            parameters.write("p1522", FIXED + 5)
            parameters.write("p1523", FIXED + 12)
        for rpm, sign in ((600.0, 1.0), (-600.0, -1.0)):
            rig.cycle(RUN, MOMRED=0x3000, count=200, **rig.speed(rpm))
            assert rig.drive.core.torque == pytest.approx(sign * 0.25 * limit)
    assert (parameters.read("p1522"), parameters.read("p1523")) == (FIXED + 5, FIXED + 12)
    parameters.write("p1522", OWN_UP)
    assert rig.drive.settings.torque_limits_percent == (None, 100.0)


@pytest.mark.requirement("STP-153", "STP-154")
@pytest.mark.parametrize(
    ("number", "value"),
    [("p1522", FIXED + 12), ("p1523", FIXED + 5), ("p1522", OWN_LOW), ("p1522", FIXED + 15)],
)
def test_only_values_of_the_right_sign_can_be_connected(number, value):
    """A negative fixed value is no upper limit, and what does not exist is none either."""
    _, parameters = build()
    with pytest.raises(ParameterAccessError):
        parameters.write(number, value)


@pytest.mark.requirement("STP-153")
def test_a_setting_has_to_be_a_fixed_value():
    """The configuration takes what r2902 offers."""
    with pytest.raises(ConfigurationError, match=r"torque_limits_percent: 75.0 .*100, 150, 200"):
        DriveSettings(torque_limits_percent=(75.0, None))


@pytest.mark.requirement("STP-153")
def test_connections_are_saved_and_come_back():
    """Written and saved they are there after a power cycle; not saved they are gone."""
    rig, parameters = build()
    parameters.write("p1522", FIXED + 5)
    parameters.write("p0971", 1)
    parameters.write("p1523", FIXED + 12)
    rig.drive.power_off()
    rig.drive.power_on()
    parameters.power_on()
    assert (parameters.read("p1522"), parameters.read("p1523")) == (FIXED + 5, OWN_LOW)


@pytest.mark.requirement("STP-156", "STP-528")
def test_the_threshold_of_the_utilisation_is_p2194():
    """With 80 % of the limit MELDW bit 1 falls at p2194 = 75 %, and is back at 85 %."""
    rig, parameters = build(torque_telegram=True)
    rig.enable()
    rig.drive.mechanics.jam(True)
    for threshold, below in ((90.0, True), (75.0, False), (85.0, True)):
        parameters.write("p2194", threshold)
        rig.cycle(RUN, MOMRED=0x2000, M_ADD1=to_n2(0.8), count=3)
        assert bool(rig.actual["MELDW"] & MELDW.TORQUE_BELOW_THRESHOLD) is below


@pytest.mark.exhaustive
@pytest.mark.requirement("STP-528")
def test_speed_below_which_the_motor_stands():
    """With little torque the motor is behind its ramp: the stop ends when it is below p1226, earlier with a
    high one.
    """
    times = {}
    for threshold in (5.0, 400.0):
        rig, parameters = build()
        parameters.write("p1226", threshold)
        parameters.write("p1121", 0.1)
        rig.turn(600.0)
        times[threshold] = rig.time_until(READY, AxisState.S2, MOMRED=0x3E00)
        assert rig.drive.core.speed_rpm < threshold + 1.0
    assert times[400.0] < 0.7 * times[5.0]


@pytest.mark.requirement("STP-528")
def test_time_from_which_on_the_motor_counts_as_standing():
    """Pushed on for ever, the stop ends p1227 after its ramp."""
    rig, parameters = build()
    parameters.write("p1227", 0.3)
    parameters.write("p1121", 0.1)
    rig.turn(300.0)
    rig.drive.mechanics.apply_force(150.0)
    assert rig.time_until(READY, AxisState.S2, MOMRED=0x3F80) == pytest.approx(0.01 + 0.3, abs=0.03)
    assert rig.drive.core.speed_rpm > 100.0


@pytest.mark.requirement("STP-528")
def test_times_of_the_brake():
    """p1216 and p1217 are the times that the brake takes, ms."""
    rig, parameters = build()
    brake = rig.drive.core.brake
    parameters.write("p1216", 40.0)
    parameters.write("p1217", 60.0)
    assert (brake.opening_time_s, brake.closing_time_s) == (pytest.approx(0.04), pytest.approx(0.06))
    assert (parameters.read("p1216"), parameters.read("p1217")) == (pytest.approx(40.0), pytest.approx(60.0))


@pytest.mark.requirement("STP-531", "STP-029")
@pytest.mark.parametrize("telegram", [1, 2, 3, 105])
def test_a_setpoint_that_waits_is_followed_in_s4(telegram):
    """Outside of S4 a setpoint means nothing; the drive follows it as soon as it is in S4, without another
    edge.
    """
    rig, _ = build(telegram)
    rig.cycle(READY, count=60, **rig.speed(600.0))
    assert rig.drive.state is AxisState.S2
    assert rig.drive.core.speed_rpm == pytest.approx(0.0, abs=0.01)
    rig.cycle(RUN, count=200, **rig.speed(600.0))
    assert rig.drive.state is AxisState.S4
    assert rig.drive.core.speed_rpm == pytest.approx(600.0, abs=1.0)


@pytest.mark.requirement("STP-534")
@pytest.mark.parametrize("telegram", [1, 2, 3, 4, 5, 6, 102, 103, 105, 106])
@pytest.mark.parametrize("supplement", [False, True])
def test_words_of_every_telegram(telegram, supplement):
    """MOMRED and MELDW with 10x, torque words with 750 added to each of them; all bring STW1 and the speed
    setpoint.
    """
    rig, _ = build(telegram, torque_telegram=supplement)
    setpoint, actual = rig.drive.telegram.setpoint.names, rig.drive.telegram.actual.names
    assert ("MOMRED" in setpoint, "MELDW" in actual) == (telegram > 100, telegram > 100)
    for name, names in (
        ("M_ADD1", setpoint),
        ("M_LIMIT_POS", setpoint),
        ("M_LIMIT_NEG", setpoint),
        ("M_ACT", actual),
    ):
        assert (name in names) is supplement
    rig.turn(300.0)
    if telegram > 100:
        on = rig.actual["MELDW"]
        assert on & (MELDW.READY | MELDW.PULSES_ENABLED) == MELDW.READY | MELDW.PULSES_ENABLED
        rig.cycle(READY, count=200)
        assert rig.actual["MELDW"] & (MELDW.READY | MELDW.PULSES_ENABLED) == MELDW.READY


@pytest.mark.requirement("STP-017")
def test_a_drive_that_is_not_ready_does_not_reach_s4():
    """With MELDW DriveReady = 0 (a fault is present) the enable sequence leads nowhere; ready again, it
    does.
    """
    rig, _ = build(105)
    rig.cycle(READY, count=60)
    rig.drive.raise_fault(7860)
    rig.cycle(READY, count=2)
    assert not rig.actual["MELDW"] & MELDW.READY
    rig.cycle(RUN, count=100)
    assert rig.drive.state is not AxisState.S4
    rig.cycle(READY | 0x80, count=4)
    rig.cycle(READY, count=4)
    assert rig.actual["MELDW"] & MELDW.READY
    rig.cycle(RUN, count=10)
    assert rig.drive.state is AxisState.S4
