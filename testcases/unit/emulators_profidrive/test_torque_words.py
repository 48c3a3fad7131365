"""Torque and messages in the telegrams: reduction, telegram 750, utilisation, fixed stop, MELDW, ZSW2,
acknowledgement.
"""

from __future__ import annotations

from dataclasses import replace

import pytest

from emulators.drive.core import RPM
from emulators.drive.profidrive import AxisState, DriveSettings, ProfidriveConfig
from emulators.drive.profidrive.faults import catalogue as numbers
from emulators.drive.profidrive.faults.catalogue import CATALOGUE, Acknowledgement, Diagnosis
from fieldbus.errors import ConfigurationError
from fieldbus.profidrive import MELDW, from_n2, to_n2
from fieldbus.profidrive.words import G_ZSW, ZSW1, ZSW2
from testcases.unit.emulators_profidrive.profidrive_rig import READY, RUN, SYNCHRONISED, Rig

FIXED_STOP, PARK = 0x0100, 0x0080
ALWAYS = MELDW.NO_MOTOR_OVERTEMPERATURE | MELDW.NO_POWER_UNIT_OVERLOAD | MELDW.DEVIATION_IN_TOLERANCE
RUNNING = ALWAYS | MELDW.CONTROLLER_ENABLED | MELDW.READY | MELDW.PULSES_ENABLED
RESTING = MELDW.SPEED_BELOW_THRESHOLD_3 | MELDW.SPEED_BELOW_THRESHOLD_2
LIGHT, RAMPED = MELDW.TORQUE_BELOW_THRESHOLD, MELDW.RAMP_COMPLETED


def build(telegram=105, *, torque_telegram=False, blocked_s=0.0, **settings):
    config = ProfidriveConfig.reference(telegram=telegram)
    return Rig(
        replace(
            config,
            torque_telegram=torque_telegram,
            blocked_time_ms=blocked_s * 1000.0,
            rated_torque_nm=40.0,  # heat is not the subject
            settings=replace(config.settings, **settings),
        )
    )


# -- torque --------------------------------------------------------------------------------------------


@pytest.mark.requirement("MC-574", "PD-037", "STP-155")
@pytest.mark.parametrize("evaluation", [100.0, 50.0, 0.0])
def test_reduction_is_evaluated_with_p1544(evaluation):
    """K = 1 - p1544 * MOMRED / 4000h multiplies both limits; the blocked motor gives exactly that torque."""
    rig = build(momred_evaluation_percent=evaluation)
    rig.enable()
    rig.drive.mechanics.jam(True)
    for rpm, sign in ((600.0, 1.0), (-600.0, -1.0)):
        rig.cycle(RUN, MOMRED=0x3000, count=200, **rig.speed(rpm))
        assert rig.drive.core.torque == pytest.approx(sign * 6.0 * (1.0 - evaluation / 100.0 * 0.75))


@pytest.mark.requirement("PD-027", "PD-038", "CFG-407")
def test_telegram_750_counts_in_p2003():
    """With p2003 = 40 Nm 1000h of M_ADD1 is 10 Nm: limits and actual torque have the same measure, in both
    directions.
    """
    rig = build(torque_telegram=True, reference_torque_nm=40.0, torque_limits_Nm=(100.0, 100.0))
    rig.enable()
    rig.drive.mechanics.jam(True)
    rig.cycle(RUN, M_ADD1=0x1000)
    rig.drive.core.step()
    assert rig.drive.core.torque == pytest.approx(10.0, abs=0.5)
    limits = {"M_LIMIT_POS": to_n2(12.0 / 40.0), "M_LIMIT_NEG": to_n2(-7.0 / 40.0)}
    for rpm, torque in ((600.0, 12.0), (-600.0, -7.0)):
        rig.cycle(RUN, count=300, **rig.speed(rpm), **limits)
        assert from_n2(rig.actual["M_ACT"]) * 40.0 == pytest.approx(torque, abs=0.01)


@pytest.mark.requirement("PD-038")
def test_limits_hold_while_the_axis_brakes():
    """On OFF3 the limits of telegram 750 still follow their words."""
    rig = build(torque_telegram=True)
    rig.turn(1500.0)
    small = {"M_LIMIT_POS": to_n2(0.05), "M_LIMIT_NEG": to_n2(-0.05)}
    rig.cycle(0x047B, count=3, **small)
    assert rig.drive.state is AxisState.S5B
    assert rig.drive.core.torque == pytest.approx(-0.1, abs=1e-3)


@pytest.mark.requirement("MC-574", "STP-156", "STP-157", "PD-085")
@pytest.mark.parametrize(("share", "utilised"), [(0.85, False), (0.95, True)])
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_utilisation_is_that_of_the_limit_in_force(share, utilised, sign):
    """At 90 % (p2194) of the reduced limit MELDW bit 1 falls, in either direction."""
    rig = build(telegram=105, torque_telegram=True)
    rig.enable()
    rig.drive.mechanics.jam(True)
    # Of the 4 Nm of telegram 750 2 Nm are left; the additive torque is what the blocked motor gives.
    torque = sign * share * 2.0
    rig.cycle(RUN, MOMRED=0x2000, M_ADD1=to_n2(torque / 2.0), count=2)
    assert rig.drive.core.torque == pytest.approx(torque, abs=0.02)
    assert bool(rig.actual["MELDW"] & MELDW.TORQUE_BELOW_THRESHOLD) is not utilised


def test_a_limit_of_nothing_is_utilised():
    """With the torque reduced to nothing the drive works at its limit."""
    rig = build()
    rig.enable()
    assert rig.cycle(RUN, MOMRED=0x4000, count=2)["MELDW"] & LIGHT == 0
    assert rig.cycle(READY, MOMRED=0x4000, count=20)["MELDW"] & LIGHT


@pytest.mark.exhaustive
@pytest.mark.requirement("MC-575", "STP-535", "PD-082", "PD-083", "STP-172")
@pytest.mark.parametrize("announced", [True, False])
def test_travel_to_a_fixed_stop(announced):
    """A motor that is blocked at its torque limit trips with F07900 after a second, unless STW2 bit 8 has
    announced it.
    """
    rig = build(blocked_s=1.0)
    rig.turn(60.0)
    here = rig.drive.mechanics.position
    rig.drive.mechanics.set_stops(None, here + 0.002)
    word = FIXED_STOP if announced else 0
    cycles = 0
    while rig.drive.core.speed_rpm > 1.0 or cycles < 60:
        rig.cycle(RUN, STW2=word, MOMRED=0x3000, **rig.speed(60.0))
        cycles += 1
    rig.cycle(RUN, STW2=word, MOMRED=0x3000, count=400, **rig.speed(60.0))
    if announced:
        assert rig.drive.state is AxisState.S4
        assert rig.actual["ZSW2"] & ZSW2.TRAVEL_TO_FIXED_STOP
        assert rig.drive.core.torque == pytest.approx(1.5)
        # Retracting leaves the stop and the word shows what is commanded.
        rig.cycle(RUN, STW2=word, MOMRED=0x3000, count=50, **rig.speed(-60.0))
        assert rig.drive.mechanics.position < here + 0.002
        assert rig.cycle(RUN, **rig.speed(-60.0))["ZSW2"] & ZSW2.TRAVEL_TO_FIXED_STOP == 0
    else:
        assert rig.drive.faults.number == numbers.BLOCKED
        assert rig.drive.state is AxisState.S1
    off = rig.cycle(READY, STW2=FIXED_STOP, count=100)
    assert off["ZSW2"] & (ZSW2.TRAVEL_TO_FIXED_STOP | ZSW2.PULSES_ENABLED) == 0


# -- MELDW ---------------------------------------------------------------------------------------------


@pytest.mark.requirement("PD-085")
@pytest.mark.parametrize(
    ("rpm", "rests"),
    [
        (0.0, RESTING),
        (4.0, RESTING),
        (6.0, MELDW.SPEED_BELOW_THRESHOLD_2),
        (890.0, MELDW.SPEED_BELOW_THRESHOLD_2),
        (-890.0, MELDW.SPEED_BELOW_THRESHOLD_2),
        (910.0, 0),
        (-2000.0, 0),
    ],
)
def test_every_bit_of_meldw_at_constant_speed(rpm, rests):
    """Bits 2 and 3 are the speed thresholds 5 and 900 rpm; all others show a healthy axis in operation, the
    reserved ones 0.
    """
    rig = build()
    rig.turn(rpm)
    assert rig.actual["MELDW"] == RUNNING | LIGHT | RAMPED | rests


@pytest.mark.requirement("PD-085")
def test_meldw_of_an_axis_that_is_off():
    """Bits 11 and 13 are 0, bit 12 stays until there is a fault."""
    rig = build()
    rig.cycle(READY, count=SYNCHRONISED)
    assert rig.actual["MELDW"] == ALWAYS | MELDW.READY | LIGHT | RAMPED | RESTING
    rig.drive.raise_fault(numbers.EXTERNAL)
    assert rig.cycle(READY)["MELDW"] == ALWAYS | LIGHT | RAMPED | RESTING


@pytest.mark.requirement("PD-085")
def test_bit_0_falls_while_the_ramp_runs():
    """With the full ramp-function generator bit 0 is 0 until the speed is reached; the deviation stays in
    tolerance.
    """
    rig = build(operating_mode=1, ramp_up_s=1.0)
    rig.enable()
    rig.cycle(RUN, count=50, **rig.speed(1500.0))
    assert rig.actual["MELDW"] & (RAMPED | MELDW.DEVIATION_IN_TOLERANCE) == MELDW.DEVIATION_IN_TOLERANCE
    rig.cycle(RUN, count=100, **rig.speed(1500.0))
    assert rig.actual["MELDW"] & RAMPED


@pytest.mark.requirement("PD-085", "PD-073", "PD-067")
def test_bits_of_heat():
    """Bits 6 and 7, and ZSW1 bits 13 and 15, fall with their warnings, which ZSW1 bit 7 shows."""
    rig = build()
    rig.turn(300.0)
    motor, stage = rig.drive.power.motor, rig.drive.power.stage
    for node, message, bit in (
        (motor, MELDW.NO_MOTOR_OVERTEMPERATURE, ZSW1.NO_MOTOR_OVERTEMPERATURE),
        (stage, MELDW.NO_POWER_UNIT_OVERLOAD, ZSW1.NO_POWER_UNIT_OVERLOAD),
    ):
        rig.cycle(RUN, count=10, **rig.speed(300.0))
        assert rig.actual["ZSW1"] & (bit | ZSW1.WARNING) == bit
        node.forced_C = 130.0 if node is motor else 90.0
        rig.cycle(RUN, count=10, **rig.speed(300.0))
        assert rig.actual["MELDW"] & ALWAYS == ALWAYS & ~message
        assert rig.actual["ZSW1"] & (bit | ZSW1.WARNING) == ZSW1.WARNING
        node.forced_C = None


@pytest.mark.exhaustive
@pytest.mark.requirement("PD-085")
@pytest.mark.parametrize(("signal", "threshold", "rpm"), [("speed", 500.0, 600.0), ("torque", 0.05, 600.0)])
def test_bit_5_watches_a_signal_of_choice(signal, threshold, rpm):
    """The variable signal is 1 above its threshold, in either direction, and 0 when nothing is chosen."""
    rig = build(variable_signal=signal, variable_threshold=threshold)
    rig.turn(-rpm)
    assert rig.actual["MELDW"] & MELDW.VARIABLE_SIGNAL
    rig.cycle(RUN, count=300)
    assert not rig.actual["MELDW"] & MELDW.VARIABLE_SIGNAL
    with pytest.raises(ConfigurationError, match="none, torque, speed"):
        DriveSettings(variable_signal="power")


# -- ZSW1 and ZSW2 -------------------------------------------------------------------------------------


@pytest.mark.requirement("PD-077", "PD-069")
def test_control_that_is_lost_in_operation():
    """Without STW1 bit 10 the axis runs on with what it had, and goes on requesting control."""
    rig = build()
    rig.turn(600.0)
    rig.cycle(0, count=100)
    assert rig.drive.state is AxisState.S4
    assert rig.drive.core.velocity == pytest.approx(600.0 * RPM, rel=1e-3)
    assert rig.actual["ZSW1"] & (ZSW1.CONTROL_REQUESTED | ZSW1.OPERATION_ENABLED) == 0x0204


@pytest.mark.exhaustive
@pytest.mark.requirement("PD-058", "PD-059")
def test_bits_without_a_meaning_do_nothing():
    """STW1 bits 11, 13, 14 and 15 are free in speed mode here: the axis turns as without them."""
    with_bits, without = build(), build()
    with_bits.turn(600.0)
    without.turn(600.0)
    with_bits.cycle(RUN | 0xE800, count=100, **with_bits.speed(600.0))
    without.cycle(RUN, count=100, **without.speed(600.0))
    assert with_bits.actual == without.actual


@pytest.mark.requirement("PD-083", "PD-082")
def test_parking_the_axis():
    """STW2 bit 7 parks the axis without pulses: its encoder too, and it cannot be switched on; in operation
    it does nothing.
    """
    rig = build()
    rig.enable()
    rig.cycle(RUN, STW2=PARK, count=5)
    assert rig.drive.state is AxisState.S4
    assert rig.actual["ZSW2"] & (ZSW2.PARKING | ZSW2.PULSES_ENABLED) == ZSW2.PULSES_ENABLED
    rig.cycle(READY, STW2=PARK, count=40)
    assert rig.actual["ZSW2"] & (ZSW2.PARKING | ZSW2.PULSES_ENABLED) == ZSW2.PARKING
    assert (rig.actual["G1_ZSW"], rig.actual["G1_XIST1"]) == (G_ZSW.PARKING, 0)
    rig.cycle(RUN, STW2=PARK, count=10)
    assert rig.drive.state is AxisState.S3
    rig.cycle(READY, count=40)
    rig.cycle(RUN, count=3)
    assert rig.drive.state is AxisState.S4
    assert rig.actual["G1_ZSW"] == 0


# -- faults --------------------------------------------------------------------------------------------


@pytest.mark.requirement("PD-139", "PD-063")
def test_when_a_fault_can_be_acknowledged():
    """Immediately, only without pulses, or never before the next power-on; what cannot be stays with ZSW1 bit
    3.
    """
    rig = build()
    rig.turn(300.0)
    drive = rig.drive

    def acknowledge(word):
        rig.cycle(word | 0x80, count=2)
        return rig.cycle(word, count=2)["ZSW1"] & ZSW1.FAULT

    assert CATALOGUE[numbers.ENCODER_SIGNAL].acknowledgement is Acknowledgement.PULSE_INHIBIT
    drive.faults.enter(
        CATALOGUE[numbers.ENCODER_SIGNAL], reaction=0
    )  # reported without a stop: the pulses stay
    assert acknowledge(RUN)
    assert drive.faults.number == numbers.ENCODER_SIGNAL
    rig.cycle(READY, count=100)
    assert not acknowledge(READY)
    drive.raise_fault(numbers.HARDWARE)
    assert acknowledge(READY)
    drive.power_off()
    drive.power_on()
    assert not rig.cycle(READY, count=5)["ZSW1"] & ZSW1.FAULT


@pytest.mark.requirement("PD-140")
def test_every_fault_has_a_class_of_diagnosis():
    """The log of a fault tells its class, one of the twenty of the profile."""
    assert len(Diagnosis) == 20
    for number, expected in (
        (numbers.OVERVOLTAGE, "DC link overvoltage"),
        (numbers.SIGN_OF_LIFE, "bus"),
        (numbers.SAFE_STOP, "safety"),
        (numbers.ENCODER_SIGNAL, "encoder value"),
        (numbers.PHASE_LOSS, "mains"),
        (numbers.MOTOR_OVERLOAD, "motor overload"),
        (4711, "other"),
    ):
        rig = build()
        rig.cycle(READY, count=2)
        rig.drive.raise_fault(number)
        (event,) = [one for one in rig.history.events if one.kind == "drive.fault"]
        assert event.data["diagnosis"] == expected


@pytest.mark.requirement("PD-043")
def test_words_show_the_oldest_fault_and_the_oldest_warning():
    """FAULT_CODE and WARN_CODE are 0 without one, and keep the first of several."""
    config = replace(
        ProfidriveConfig.reference(),
        telegram=999,
        free_setpoint=("STW1", "NSOLL_B", "STW2"),
        free_actual=("ZSW1", "NIST_B", "ZSW2", "FAULT_CODE", "WARN_CODE"),
    )
    rig = Rig(config)
    rig.cycle(READY, count=SYNCHRONISED)
    assert (rig.actual["FAULT_CODE"], rig.actual["WARN_CODE"]) == (0, 0)
    for number in (numbers.EXTERNAL, numbers.MOTOR_OVERLOAD):
        rig.drive.raise_fault(number)
    for number in (7850, 7840):
        rig.drive.faults.warn(number, True)
    rig.cycle(READY)
    assert (rig.actual["FAULT_CODE"], rig.actual["WARN_CODE"]) == (numbers.EXTERNAL, 7850)
    rig.drive.faults.warn(7850, False)
    rig.cycle(READY | 0x80)
    assert (rig.actual["FAULT_CODE"], rig.actual["WARN_CODE"]) == (0, 7840)
