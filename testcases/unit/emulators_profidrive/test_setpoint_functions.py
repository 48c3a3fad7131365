"""Setpoint channel of the speed axis: rounding, speed limits, inversion, motor potentiometer; over the
parameters.
"""

from __future__ import annotations

import pytest

from emulators.drive.profidrive import AxisState, DriveParameters, ProfidriveConfig
from fieldbus.profidrive import STW1
from testcases.unit.emulators_profidrive.profidrive_rig import READY, RUN, Rig


@pytest.fixture
def rig():
    """The reference axis with the full ramp generator: 3000 rpm in 1 s, quick stop 0.5 s."""
    return Rig(ProfidriveConfig.reference(operating_mode=1))


@pytest.fixture
def parameters(rig):
    """Its parameters."""
    return DriveParameters(rig.drive)


def time_to(rig, rpm, stw1=RUN, **signals):
    """Return how long the axis takes to reach a speed, s."""
    started = rig.scheduler.now
    rising = rig.drive.core.speed_rpm < rpm
    for _ in range(2000):
        rig.cycle(stw1, **signals)
        if (rig.drive.core.speed_rpm >= rpm - 0.5) if rising else (rig.drive.core.speed_rpm <= rpm + 0.5):
            return (rig.scheduler.now - started) / 1e9
    raise AssertionError(rig.drive.core.speed_rpm)


@pytest.mark.requirement("PD-271")
def test_rounding_of_the_ramp_generator(rig, parameters):
    """p1120 + p1130 / 2 + p1131 / 2 up, p1121 and the same down."""
    parameters.write("p1130", 0.4)
    parameters.write("p1131", 0.2)
    rig.enable()
    assert time_to(rig, 1500, **rig.speed(1500)) == pytest.approx(0.5 + 0.2 + 0.1, abs=0.03)
    rig.cycle(RUN, count=25, **rig.speed(1500))
    assert time_to(rig, 0, **rig.speed(0)) == pytest.approx(0.5 + 0.2 + 0.1, abs=0.03)


@pytest.mark.exhaustive
@pytest.mark.requirement("PD-271")
def test_rounding_holds_for_off1(rig, parameters):
    """The stop ramp of OFF1 is the same ramp generator."""
    parameters.write("p1130", 0.4)
    parameters.write("p1131", 0.4)
    rig.turn(1500)
    assert rig.time_until(READY, AxisState.S2) == pytest.approx(0.5 + 0.4, abs=0.06)


@pytest.mark.exhaustive
@pytest.mark.requirement("PD-273")
def test_off3_has_its_own_rounding(rig, parameters):
    """p1136 and p1137; p1130 and p1131 do not count."""
    parameters.write("p1130", 5.0)
    parameters.write("p1136", 0.2)
    parameters.write("p1137", 0.2)
    rig.enable()
    rig.cycle(RUN, count=1800, **rig.speed(1500))
    assert rig.time_until(RUN & ~STW1.NO_OFF3, AxisState.S1) == pytest.approx(0.25 + 0.2, abs=0.06)


@pytest.mark.exhaustive
@pytest.mark.requirement("PD-271")
def test_p1134_breaks_a_ramp_off(rig, parameters):
    """With 1 a setpoint that turns round acts at once, without overshoot."""
    for kind, overshoots in ((0, True), (1, False)):
        parameters.write("p1130", 0.5)
        parameters.write("p1131", 0.5)
        parameters.write("p1134", kind)
        rig.enable()
        rig.cycle(RUN, count=125, **rig.speed(1500))
        turned = rig.drive.core.precontrol_velocity
        rig.cycle(RUN, count=10, **rig.speed(0))
        assert (rig.drive.core.precontrol_velocity > turned * 1.01) is overshoots
        rig.cycle(READY, count=700)


@pytest.mark.exhaustive
@pytest.mark.requirement("PD-269")
def test_speed_limits(rig, parameters):
    """p1083 and p1086 limit each direction for itself."""
    parameters.write("p1083", 600.0)
    parameters.write("p1086", -300.0)
    rig.enable()
    rig.cycle(RUN, count=300, **rig.speed(1500))
    assert rig.drive.core.speed_rpm == pytest.approx(600, abs=1)
    rig.cycle(RUN, count=400, **rig.speed(-1500))
    assert rig.drive.core.speed_rpm == pytest.approx(-300, abs=1)


@pytest.mark.exhaustive
@pytest.mark.requirement("PD-055")
def test_bit_11_turns_the_setpoint_round_if_p1113_says_so(rig, parameters):
    """Without p1113 the bit is nothing."""
    rig.enable()
    rig.cycle(RUN | STW1.BIT_11, count=300, **rig.speed(600))
    assert rig.drive.core.speed_rpm == pytest.approx(600, abs=1)
    parameters.write("p1113", 0x082AFC0B)
    assert parameters.read("p1113") == 0x082AFC0B
    rig.cycle(RUN | STW1.BIT_11, count=300, **rig.speed(600))
    assert rig.drive.core.speed_rpm == pytest.approx(-600, abs=1)


@pytest.mark.exhaustive
@pytest.mark.requirement("PD-057", "PD-058")
def test_motor_potentiometer(rig, parameters):
    """p1035, p1036: bits 13 and 14 raise and lower, p1082 within p1047; what it has reached stays, and is
    added.
    """
    rig.enable()
    rig.cycle(RUN | STW1.BIT_13, count=250)
    assert rig.drive.core.speed_rpm == pytest.approx(0, abs=1)
    parameters.write("p1035", 0x082AFC0D)
    parameters.write("p1047", 5.0)
    rig.cycle(RUN | STW1.BIT_13, count=250)
    rig.cycle(RUN, count=200)
    assert parameters.read("r1050") == pytest.approx(600, abs=1)
    assert rig.drive.core.speed_rpm == pytest.approx(600, abs=1)
    rig.cycle(RUN | STW1.BIT_14, count=125)
    rig.cycle(RUN, count=200, **rig.speed(100))
    assert rig.drive.core.speed_rpm == pytest.approx(400, abs=1)
    rig.cycle(READY, count=300)
    assert parameters.read("r1050") == 0.0


@pytest.mark.requirement("PD-058", "PD-059")
@pytest.mark.parametrize("bit", [STW1.BIT_14, STW1.BIT_15])
def test_reserved_bits_do_nothing(rig, bit):
    """Bits 14 and 15 change neither state nor speed of a drive that does not use them."""
    rig.enable()
    rig.cycle(RUN | bit, count=300, **rig.speed(600))
    assert rig.drive.state is AxisState.S4
    assert rig.drive.core.speed_rpm == pytest.approx(600, abs=1)
