"""Drive data sets, alarm class, control taken away, order of the bus cycle, stop times of a pulse module's
axis.
"""

from __future__ import annotations

from dataclasses import replace

import pytest

from emulators.drive.profidrive import (
    AxisState,
    DriveParameters,
    DriveSettings,
    DriveWarning,
    ProfidriveConfig,
)
from emulators.drive.profidrive.faults import catalogue as numbers
from fieldbus.errors import ConfigurationError
from fieldbus.profidrive import STW1, ZSW1, ZSW2, to_n4
from testcases.unit.emulators_profidrive.profidrive_rig import READY, RUN, SYNCHRONISED, Rig

RAMPED = ProfidriveConfig.reference(operating_mode=1)


def with_sets():
    """Return an axis with a second data set: slower ramps."""
    slow = replace(RAMPED.settings, ramp_up_s=4.0, ramp_down_s=4.0)
    return Rig(replace(RAMPED, data_sets=(slow,)))


@pytest.mark.requirement("PD-082", "PD-083")
def test_stw2_chooses_the_data_set():
    """ZSW2 shows the set in force, with bit 11 in the cycle of the change; its ramps are those of the next
    setpoint.
    """
    rig = with_sets()
    parameters = DriveParameters(rig.drive)
    rig.enable()
    answer = rig.cycle(RUN, STW2=1)
    assert answer["ZSW2"] & (0x1F | ZSW2.DATA_SET_CHANGEOVER) == 1 | ZSW2.DATA_SET_CHANGEOVER
    assert rig.cycle(RUN, STW2=1)["ZSW2"] & (0x1F | ZSW2.DATA_SET_CHANGEOVER) == 1
    assert (parameters.read("r0051"), parameters.read("p1120")) == (1, 4.0)
    rig.cycle(RUN, count=250, STW2=1, **rig.speed(1500))
    assert rig.drive.core.speed_rpm == pytest.approx(750, rel=0.02)
    rig.cycle(RUN, count=250, STW2=0, **rig.speed(1500))
    assert rig.drive.core.speed_rpm == pytest.approx(1500, abs=1)


@pytest.mark.requirement("PD-082", "PD-083")
def test_a_data_set_keeps_what_was_written_to_it():
    """A parameter belongs to the set in force; a number that there is not changes nothing."""
    rig = with_sets()
    parameters = DriveParameters(rig.drive)
    rig.cycle(READY, STW2=1)
    parameters.write("p1121", 2.5)
    rig.cycle(READY, count=2, STW2=0)
    assert parameters.read("p1121") == 1.0
    rig.cycle(READY, count=2, STW2=1)
    assert parameters.read("p1121") == 2.5
    assert rig.cycle(READY, count=2, STW2=7)["ZSW2"] & 0x1F == 1
    rig.drive.power_off()
    rig.drive.power_on()
    assert parameters.read("r0051") == 0


def test_data_sets_of_two_kinds_are_refused():
    """All of them are of one operating mode."""
    with pytest.raises(ConfigurationError, match="930"):
        replace(RAMPED, data_sets=(DriveSettings(operating_mode=3),))


@pytest.mark.requirement("PD-083")
@pytest.mark.parametrize(
    ("warnings", "rank"),
    [
        ((), 0),
        ((DriveWarning.INJECTED,), 1),
        ((DriveWarning.INJECTED, DriveWarning.MOTOR_TEMPERATURE), 2),
        ((DriveWarning.SAFE_TORQUE_OFF, DriveWarning.INJECTED), 3),
    ],
)
def test_alarm_class(warnings, rank):
    """Bits 5 and 6: the class of the gravest warning."""
    rig = Rig(RAMPED)
    rig.cycle(READY)
    for warning in warnings:
        rig.drive.faults.warn(warning, True)
    assert rig.cycle(READY)["ZSW2"] >> 5 & 3 == rank


@pytest.mark.requirement("PD-077")
@pytest.mark.parametrize(("reaction", "fault"), [("run_on", 0), ("fault", numbers.CONTROL_LOST)])
def test_control_that_is_taken_away_in_operation(reaction, fault):
    """The drive runs on with the last control word, or trips with F07220 and brakes on the ramp of OFF1."""
    rig = Rig(replace(RAMPED, control_lost=reaction))
    rig.turn(600)
    rig.cycle(RUN & ~STW1.CONTROL_BY_PLC, count=100, **rig.speed(600))
    assert rig.drive.faults.number == fault
    assert (rig.drive.state is AxisState.S4) is (not fault)
    if not fault:
        assert rig.drive.core.speed_rpm == pytest.approx(600, abs=1)


@pytest.mark.requirement("PD-077")
def test_control_that_is_not_there_yet_is_no_fault():
    """Before operation the bit may come and go."""
    rig = Rig(replace(RAMPED, control_lost="fault"))
    rig.cycle(READY & ~STW1.CONTROL_BY_PLC, count=10)
    rig.cycle(READY, count=SYNCHRONISED)
    rig.cycle(READY & ~STW1.CONTROL_BY_PLC, count=10)
    assert not rig.drive.faults.present


@pytest.mark.requirement("PD-347")
def test_what_a_telegram_asks_for_acts_in_its_own_bus_cycle():
    """Telegram, state machine, setpoint channel, send telegram: one cycle does it all, for what it brings
    itself.
    """
    rig = Rig(ProfidriveConfig.reference(telegram=3))
    rig.enable()
    answer = rig.cycle(RUN, NSOLL_B=to_n4(0.1), G1_STW=0x4000)
    assert rig.drive.channel.target > 0.0
    assert answer["G1_ZSW"] & 0x4000
    answer = rig.cycle(RUN & ~STW1.ENABLE_OPERATION, NSOLL_B=to_n4(0.2))
    assert answer["ZSW1"] & 0x0047 == 0x0003
    # S3 does not lead any more: the setpoint of this telegram is not taken.
    assert rig.drive.channel.target == pytest.approx(0.1 * 3000 * 0.104719755, rel=1e-3)
    rig.drive.raise_fault(numbers.EXTERNAL)
    assert rig.cycle(READY)["ZSW1"] & ZSW1.FAULT
    # Acknowledged before the state machine looks: S1 is seen in the answer, without the fault.
    assert rig.cycle(READY | STW1.ACKNOWLEDGE)["ZSW1"] & (ZSW1.FAULT | 0x0047) in {0x0040, 0x0001}


@pytest.mark.requirement("PD-118")
@pytest.mark.parametrize(
    ("stw1", "state", "stop_s"),
    [
        (RUN & ~STW1.ON, AxisState.S2, 0.5),
        (RUN & ~STW1.NO_OFF3, AxisState.S1, 0.25),
        (RUN & ~STW1.NO_OFF2, AxisState.S1, 0.0),
        (RUN & ~STW1.ENABLE_OPERATION, AxisState.S3, 0.0),
    ],
)
def test_stops_end_in_their_state_and_time(stw1, state, stop_s):
    """OFF1 within the ramp stop time, OFF3 within the quick-stop time, OFF2 and bit 3 at once."""
    rig = Rig(RAMPED)
    rig.turn(1500)
    assert rig.time_until(stw1, state) == pytest.approx(stop_s, abs=0.05)


@pytest.mark.exhaustive
@pytest.mark.requirement("PD-118")
@pytest.mark.parametrize("bit", [STW1.RAMP_ENABLE, STW1.SETPOINT_ENABLE])
def test_without_ramp_or_setpoint_the_axis_stays_in_operation(bit):
    """Bit 4 or bit 6 = 0: S4 with speed zero."""
    rig = Rig(RAMPED)
    rig.turn(1500)
    answer = rig.cycle(RUN & ~bit, count=300, **rig.speed(1500))
    assert rig.drive.core.speed_rpm == pytest.approx(0, abs=0.5)
    assert answer["ZSW1"] & 0x0047 == 0x0007


@pytest.mark.requirement("PD-258")
def test_parameters_of_the_station():
    """PNU 61000 is the name; addresses of a network that the drive is not on are zeros; none can be
    written.
    """
    parameters = DriveParameters(Rig().drive)
    assert parameters.store.text(61000) == "drive"
    assert [parameters.store.definition(number).elements for number in range(61001, 61005)] == [4, 6, 4, 4]
    assert not any(parameters.store.is_writable(number) for number in range(61000, 61005))


@pytest.mark.requirement("PD-009", "PD-140")
@pytest.mark.parametrize(
    ("fault", "bit"),
    [
        (numbers.CAN_ERROR, 7),
        (numbers.MOTOR_TEMPERATURE, 4),
        (numbers.ENCODER_SIGNAL, 9),
        (numbers.EXTERNAL, 15),
    ],
)
def test_the_namur_message_has_a_bit_per_class(fault, bit):
    """Telegram 20: the last word tells what kind of fault is there; nothing without one."""
    rig = Rig(replace(RAMPED, telegram=20))
    assert rig.cycle(READY)["MELD_NAMUR"] == 0
    rig.drive.raise_fault(fault)
    assert rig.cycle(READY)["MELD_NAMUR"] == 1 << bit
    rig.cycle(READY | STW1.ACKNOWLEDGE)
    assert rig.cycle(READY)["MELD_NAMUR"] == 0
