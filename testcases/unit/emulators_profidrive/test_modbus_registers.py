"""The registers of the maps one by one, against a table of their own; what they mean, against the machine."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest

from emulators.drive.machine import SwitchesConfig
from emulators.drive.profidrive import ProfidriveConfig
from emulators.drive.profidrive.faults import catalogue as numbers
from emulators.drive.profidrive.modbus import ProfidriveModbusDrive
from emulators.drive.profidrive.modbus_config import ProfidriveModbusConfig
from fieldbus.clock import MS, US, S, VirtualScheduler
from fieldbus.errors import ConfigurationError
from fieldbus.modbus import Change, Outcome, Request, RtuClient, SerialFormat, SerialLine
from fieldbus.profidrive import to_n2
from testcases.unit.emulators_profidrive.modbus_rig import FAST, READY, RUN, ModbusRig

# register, parameter, sub-index, scale, lowest and highest number on the wire
SETTINGS = [
    pytest.param(40200, 730, 0, 1, 0, 1, marks=pytest.mark.requirement("PD-303")),
    pytest.param(40203, 733, 0, 1, 0, 1, marks=pytest.mark.requirement("PD-303")),
    pytest.param(40321, 640, 0, 10, 100, 4000, marks=pytest.mark.requirement("PD-310")),
    pytest.param(40322, 1120, 0, 100, 0, 65000, marks=pytest.mark.requirement("PD-311")),
    pytest.param(40323, 1121, 0, 100, 0, 65000, marks=pytest.mark.requirement("PD-311")),
    pytest.param(40324, 2000, 0, 1, 6, 32767, marks=pytest.mark.requirement("PD-312")),
    pytest.param(40500, 2200, 0, 1, 0, 1, marks=pytest.mark.requirement("PD-324")),
    pytest.param(40501, 2240, 0, 100, -20000, 20000, marks=pytest.mark.requirement("PD-324")),
    pytest.param(40510, 2265, 0, 100, 0, 6000, marks=pytest.mark.requirement("PD-324")),
    pytest.param(40511, 2269, 0, 100, 0, 50000, marks=pytest.mark.requirement("PD-324")),
    pytest.param(40512, 2280, 0, 1000, 0, 65535, marks=pytest.mark.requirement("PD-324")),
    pytest.param(40513, 2285, 0, 1, 0, 60, marks=pytest.mark.requirement("PD-324")),
    pytest.param(40514, 2274, 0, 1, 0, 60, marks=pytest.mark.requirement("PD-324")),
    pytest.param(40515, 2291, 0, 100, -20000, 20000, marks=pytest.mark.requirement("PD-324")),
    pytest.param(40516, 2292, 0, 100, -20000, 20000, marks=pytest.mark.requirement("PD-324")),
    pytest.param(40523, 791, 0, 100, -19999, 19999, marks=pytest.mark.requirement("PD-325")),
    pytest.param(40524, 791, 1, 100, -19999, 19999, marks=pytest.mark.requirement("PD-325")),
]
READ_ONLY = [
    *range(40110, 40120),
    40220,
    40221,
    *range(40240, 40246),
    *range(40260, 40264),
    40300,
    40301,
    40320,
    *range(40340, 40350),
    *range(40400, 40410),
    40499,
    40520,
    40521,
    40522,
]


@pytest.fixture
def rig():
    """A drive with the G120's registers over TCP that nobody watches."""
    return ModbusRig("tcp", setpoint_monitoring_ms=0.0)


@pytest.mark.parametrize(("register", "number", "sub_index", "scale", "low", "high"), SETTINGS)
def test_settings(rig, register, number, sub_index, scale, low, high):
    """A register is its parameter times the scale, both ways, from limit to limit; beyond them exception
    04.
    """
    store = rig.drive.parameters.store
    for raw in (low, (low + high) // 2, high):
        assert rig.write(register, raw) == "done"
        assert store.value(number, sub_index) == pytest.approx(raw / scale, rel=1e-6)
        assert rig.read(register) == [raw & 0xFFFF]
    for raw in (low - 1, high + 1):
        if -0x8000 <= raw <= 0xFFFF and not (low == 0 and raw < 0):
            assert rig.write(register, raw) == "exception 4"
    assert rig.read(register) == [high & 0xFFFF]


@pytest.mark.requirement("PD-299", "PD-304", "PD-305", "PD-306", "PD-307", "PD-308", "PD-309", "PD-337")
def test_what_can_only_be_read(rig):
    """Every display refuses to be written with exception 04; every register of the table can be read."""
    for register in READ_ONLY:
        assert len(rig.read(register)) == 1, register
        assert rig.write_one(register, 0) == "exception 4", register


@pytest.mark.exhaustive
@pytest.mark.requirement("PD-288", "PD-335")
def test_there_is_nothing_else(rig):
    """What the table does not name does not exist."""
    known = {
        *READ_ONLY,
        *range(40100, 40110),
        *range(40601, 40723),
        40201,
        40202,
        *(row.values[0] for row in SETTINGS),
    }
    for register in range(40050, 40760):
        assert (rig.read(register) != "exception 2") is (register in known), register


@pytest.mark.requirement("PD-297", "PD-298", "PD-301", "PD-302")
def test_words_beyond_the_second():
    """Ten words each way: with telegram 105 every signal stands in its register."""
    rig = ModbusRig("tcp", drive=ProfidriveConfig.reference(telegram=105), setpoint_monitoring_ms=0.0)
    words = [READY, 0x1234, 0x5678, 0x9000, 0x1111, 0x8000, 0x0001, 0x0002, 0x0003, 0x0004]
    for register, word in zip(range(40100, 40110), words, strict=True):
        assert rig.write_one(register, word) == "done"
    rig.scheduler.run_for(20 * MS)
    drive = rig.drive.drive
    names = drive.telegram.setpoint.names
    assert drive.telegram.setpoint.pack(*drive.row[: len(names)]) == b"".join(
        word.to_bytes(2, "big") for word in words
    )
    rig.drive.raise_fault(numbers.OVERCURRENT)
    rig.scheduler.run_for(20 * MS)
    shown = drive.telegram.actual.decode(b"".join(word.to_bytes(2, "big") for word in rig.read(40110, 10)))
    assert shown["ZSW1"] & 8
    assert shown["G1_XIST1"] == drive.encoder_words.words()[1]


@pytest.mark.requirement("PD-304", "PD-305", "PD-306", "PD-303")
def test_terminals():
    """Inputs show the switches and what a test puts on the analog ones, outputs what was written."""
    drive = replace(ProfidriveConfig.reference(telegram=1), switches=SwitchesConfig(input_filter_ms=0.0))
    rig = ModbusRig("tcp", drive=drive, setpoint_monitoring_ms=0.0)
    assert rig.read(40240, 6) == [0, 0, 0, 0, 0, 0]
    rig.drive.force_input("home", True)
    assert rig.read(40240, 6) == [0, 0, 1, 0, 0, 0]
    for number, percent in enumerate((12.5, -100.0, 300.0, -300.0)):
        rig.drive.set_analog_input(number, percent)
    assert rig.read(40260, 4) == [1250, 0x10000 - 10000, 30000, 0x10000 - 30000]
    for wrong in ((4, 0.0), (-1, 0.0), (0, 301.0), (0, math.nan)):
        with pytest.raises(ConfigurationError, match="analog input"):
            rig.drive.set_analog_input(*wrong)
    rig.write(40523, 5000, -2550)
    assert rig.read(40220, 2) == [5000, 0x10000 - 2550]
    rig.write(40200, 1, 0, 1, 1)
    assert rig.drive.parameters.store.value(747) == 0b1101


@pytest.mark.exhaustive
@pytest.mark.requirement(
    "PD-308",
    "PD-313",
    "PD-314",
    "PD-315",
    "PD-316",
    "PD-317",
    "PD-318",
    "PD-319",
    "PD-320",
    "PD-307",
    "PD-309",
)
def test_displays_of_a_drive_that_turns(rig):
    """Speeds, frequency, voltages, current, torque, power and energy are those of the machine."""
    rig.enable()
    rig.keep(0.5, RUN, to_n2(-0.25))
    core = rig.drive.core
    rig.drive.set_load_force(-400.0)
    rig.keep(0.2, RUN, to_n2(-0.25))
    setpoint, actual, frequency, output, link, current, torque, power = (
        word - 0x10000 if word & 0x8000 else word for word in rig.read(40340, 8)
    )
    assert (setpoint, actual) == (-750, pytest.approx(-750, abs=1))
    assert frequency == pytest.approx(-5000, abs=2)  # 200 Hz at 3000 rpm
    assert output == pytest.approx(100, abs=1)  # 400 V at 3000 rpm
    assert link == pytest.approx(rig.drive.power.dc_link.voltage_V, abs=1.0)
    assert abs(core.torque) > 0.1
    assert torque == pytest.approx(core.torque * 100, abs=1)
    assert current == pytest.approx(abs(core.torque) / 2.0 * 2.2 * 100, abs=1)
    assert power == pytest.approx(core.torque * core.velocity / 10.0, abs=1)
    assert rig.read(40301) == [521]
    assert rig.read(40300) == [10010]
    assert rig.read(40320) == [75]
    assert rig.read(40349) == [0]


@pytest.mark.requirement("PD-319")
def test_energy(rig):
    """r0039 integrates the power: braking gives back, and the register counts whole kilowatt hours."""
    rig.enable()
    rig.keep(1.0, RUN, to_n2(0.5))
    store = rig.drive.parameters.store
    balance, drawn, returned = store.values(39, 0, 3)
    assert balance == pytest.approx(drawn - returned)
    assert drawn > 0.0
    rig.keep(1.0, READY, 0)
    assert store.value(39, 2) > returned  # the inertia has given back
    assert rig.read(40348) == [0]
    rig.drive.power.drawn_J += 5.2 * 3.6e6
    assert rig.read(40348) == [5]


@pytest.mark.requirement("PD-321", "PD-322", "PD-323")
def test_faults_alarms_and_the_error_code(rig):
    """40400 is the present situation, 40408 and 40409 the alarm, 40499 the number of the refusal of the last
    access.
    """
    rig.enable()
    rig.drive.force_warning(True)
    alarm = rig.drive.drive.faults.warning_number
    assert rig.read(40408, 2) == [alarm, alarm]
    rig.drive.raise_fault(numbers.OVERSPEED)
    assert rig.read(40400) == [numbers.OVERSPEED]
    assert rig.read(40499) == [0]
    rig.drive.raise_fault(numbers.OVERCURRENT)
    assert rig.read(40400, 3) == [numbers.OVERSPEED, numbers.OVERCURRENT, 0]
    rig.drive.parameters.store.refusals[1120] = 0x65
    assert rig.read(40322) == "exception 4"
    assert rig.read(40499) == [0x65]
    rig.drive.parameters.store.refusals.clear()
    ModbusRig.enable(other := ModbusRig("tcp", setpoint_monitoring_ms=0.0))
    assert other.write(40324, 2000) == "exception 4"  # p2000 with pulses
    assert other.read(40499) == [0x77]


@pytest.mark.requirement("PD-293")
def test_valid_registers_of_a_refused_write(rig):
    """Function 16 over several registers writes the valid ones although one is refused."""
    assert rig.write(40322, 111, 65001, 1500) == "exception 4"
    assert rig.read(40322, 3) == [111, 20, 1500]


def test_the_style_of_the_g220():
    """Control words begin at 40150, and there are no parameters but those of data record 47."""
    rig = ModbusRig("tcp", registers="sinamics_g220", setpoint_monitoring_ms=0.0)
    assert rig.write(40150, READY, 0) == "done"
    rig.scheduler.run_for(20 * MS)
    assert rig.write(40150, RUN, to_n2(0.1), 0, 0, 0x0815) == "done"
    rig.scheduler.run_for(S // 2)
    zsw1, speed = rig.read(40100, 2)
    assert zsw1 & 7 == 7
    assert speed == pytest.approx(to_n2(0.1), abs=8)
    assert rig.read(40322) == "exception 2"
    assert rig.write(40601, 1, 0x2F0A, 0x8001, 0x0101, 0x1001, 0x0002, 0x0000) == "done"


@pytest.mark.requirement("PD-291")
def test_times_of_the_line():
    """p2024: longest processing, character delay, pause; 0 is what the rate says; what the rate does not
    allow is refused.
    """
    rig = ModbusRig("rtu", format_=SerialFormat(38400), setpoint_monitoring_ms=0.0)
    store = rig.drive.parameters.store

    def answered(pause_us):
        end = rig.link.add_hook(
            lambda sender, _data, _now: Change(pauses={3: pause_us * US}) if sender == "master" else None
        )
        found = rig.read(40100)
        end()
        return found == [0]

    assert answered(750)
    store.write(2024, 0.5, 1)
    rig.scheduler.run_for(MS)
    assert answered(500)
    assert not answered(510)
    for sub_index, wrong in ((1, 0.751), (2, 1.749)):
        with pytest.raises(Exception, match="not possible at this rate"):
            store.write(2024, wrong, sub_index)
    store.write(2024, 0.0, 1)
    store.write(2024, 10.0, 2)
    rig.scheduler.run_for(MS)
    begin = rig.scheduler.now
    assert rig.read(40100) == [0]
    assert rig.scheduler.now - begin > 10 * MS  # the end of the request is known later
    store.write(2024, 5.0, 0)
    rig.drive.delay_responses(0.006)
    assert rig.read(40100) is Outcome.TIMEOUT
    rig.drive.delay_responses(0.004)
    assert rig.read(40100) == [0]


@pytest.mark.requirement("PD-234")
def test_the_node_address():
    """PNU 918 is the address; another one counts from the next power-on, if it was saved."""
    rig = ModbusRig("rtu")
    store = rig.drive.parameters.store
    assert store.value(918) == 7
    store.write(918, 9)
    store.save()
    assert rig.read(40100) == [0]
    rig.drive.power_off()
    rig.drive.power_on()
    assert rig.read(40100) is Outcome.TIMEOUT
    assert hasattr(rig.ask(Request(3, 99, 1), unit=9), "values")


def test_defaults_are_fast():
    """The ramps of the rig are those of its configuration: the registers show hundredths."""
    rig = ModbusRig("tcp")
    assert rig.read(40322, 2) == [round(FAST.ramp_up_s * 100), round(FAST.ramp_down_s * 100)]


@pytest.mark.requirement("PD-310")
def test_the_current_limit():
    """p0640 caps the torque: the rated current gives the rated torque. At the start it is above what the
    limits need.
    """
    rig = ModbusRig("tcp", setpoint_monitoring_ms=0.0)
    store = rig.drive.parameters.store
    assert rig.read(40321) == [132]  # 6 Nm are 6.6 A
    store.write(640, 2.2)
    rig.enable()
    assert rig.drive.drive.torque.upper_Nm == pytest.approx(2.0)
    assert rig.drive.drive.torque.lower_Nm == pytest.approx(2.0)
    rig.drive.mechanics.jam(True)
    rig.keep(0.3, RUN, to_n2(0.5))
    assert rig.drive.core.torque == pytest.approx(2.0, abs=0.01)
    assert rig.write(40321, 400) == "done"
    rig.keep(0.3, RUN, to_n2(0.5))
    assert rig.drive.core.torque == pytest.approx(6.0, abs=0.01)


@pytest.mark.exhaustive
def test_several_drives_on_one_line():
    """Three units on a line are led one after the other; each hears only what is for it, a broadcast reaches
    all.
    """
    scheduler = VirtualScheduler()
    line = SerialLine(scheduler, format_=SerialFormat(115200))
    drives = {}
    for unit in (1, 2, 247):
        config = ProfidriveModbusConfig(
            unit=unit, drive=ProfidriveConfig(telegram=1, settings=FAST), setpoint_monitoring_ms=0.0
        )
        drives[unit] = ProfidriveModbusDrive(scheduler, config, name=f"drive {unit}")
        drives[unit].attach(line)
        drives[unit].power_on()
    master = RtuClient(scheduler, line)
    for unit in drives:
        for word, share in ((READY, 0.0), (RUN, unit / 1000.0)):
            master.submit(Request(16, 99, 2, (word, to_n2(share))), unit)
            scheduler.run_for(S // 2)
    speeds = [drive.core.speed_rpm for drive in drives.values()]
    assert speeds == pytest.approx([3.0, 6.0, 741.0], abs=1.0)
    master.submit(Request(16, 99, 2, (READY, 0)), 0)
    scheduler.run_for(S)
    assert not any(drive.core.enabled for drive in drives.values())
    assert line.collisions == 0


def test_fault_numbers_of_another_make():
    """FAULT_CODE and WARN_CODE show the numbers of the map; what it does not have is shown as it is."""
    drive = ProfidriveConfig(telegram=111, settings=replace(FAST, operating_mode=2))
    for number, shown in ((30001, 11), (7452, 126), (42, 42)):
        rig = ModbusRig(registers="festo", drive=drive)
        rig.drive.raise_fault(number)
        rig.scheduler.run_for(20 * MS)
        assert rig.fault == number
        assert rig.read(109) == [shown]
    rig.drive.drive.faults.warn(7461, True)
    rig.scheduler.run_for(20 * MS)
    assert rig.read(110) == [67]
