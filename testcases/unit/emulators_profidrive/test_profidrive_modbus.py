"""The PROFIdrive axis behind a register map, over TCP and on a serial line, from its responses alone."""

from __future__ import annotations

import math

import pytest

from emulators.drive.profidrive import ProfidriveConfig
from emulators.drive.profidrive.faults import catalogue as numbers
from emulators.drive.profidrive.modbus import ProfidriveModbusDrive
from emulators.drive.profidrive.modbus_config import ProfidriveModbusConfig
from fieldbus.clock import MS, US, S, VirtualScheduler
from fieldbus.errors import ConfigurationError, UnsupportedFaultError
from fieldbus.modbus import Outcome, Parity, Request, SerialFormat, SerialLine, TcpLink
from fieldbus.profidrive import to_n2
from testcases.unit.emulators_profidrive.modbus_rig import ACKNOWLEDGE, FAST, READY, RUN, UNIT, ModbusRig


@pytest.fixture(params=["tcp", "rtu"])
def rig(request):
    """A drive with telegram 1 and the G120's registers."""
    return ModbusRig(request.param)


@pytest.mark.requirement("PD-295", "PD-296", "PD-299", "PD-300")
def test_it_is_switched_on_and_turns(rig):
    """Control word and setpoint in 40100 and 40101 enable the axis and turn it; 40110 and 40111 show it."""
    rig.enable()
    zsw1, speed = rig.keep(0.5, RUN, to_n2(0.25))
    assert zsw1 & 0x47 == 0x07
    assert speed == pytest.approx(to_n2(0.25), abs=8)
    assert rig.drive.core.speed_rpm == pytest.approx(750.0, abs=1.0)
    assert rig.read(40341) == [pytest.approx(750, abs=1)]
    zsw1, speed = rig.keep(0.5, READY, to_n2(0.25))
    assert zsw1 & 0x47 == 0x01
    assert speed in (0, 1, 0xFFFF)


@pytest.mark.requirement("PD-295", "PD-296")
def test_single_registers_make_a_telegram(rig):
    """Function 06 changes one word of the telegram and leaves the others."""
    rig.enable()
    for _ in range(20):
        assert rig.write_one(40101, to_n2(-0.1)) == "done"
        rig.scheduler.run_for(20 * MS)
    assert rig.drive.core.speed_rpm == pytest.approx(-300.0, abs=1.0)
    assert rig.read(40100, 2) == [RUN, to_n2(-0.1) & 0xFFFF]


def test_it_acts_in_its_own_cycle():
    """A telegram acts at the next cycle of the drive, 4 ms apart, and not when it comes."""
    rig = ModbusRig("tcp", drive=ProfidriveConfig(telegram=1, settings=FAST, cycle_ns=4 * MS))
    rig.keep(0.1, READY, 0)
    rig.scheduler.run_for(4 * MS - rig.scheduler.now % (4 * MS) + MS)
    assert rig.write(40100, RUN, 0) == "done"
    assert rig.drive.drive.stw1 == READY
    rig.scheduler.run_for(4 * MS - rig.scheduler.now % (4 * MS) + 1)
    assert rig.drive.drive.stw1 == RUN


@pytest.mark.requirement("PD-280", "PD-292", "MODB-042")
def test_process_data_that_stay_away(rig):
    """After p2040 without access the drive stops with OFF3 and F01910; reading keeps it; acknowledging needs
    data.
    """
    rig.enable()
    rig.keep(0.3, RUN, to_n2(0.5))
    for _ in range(10):
        rig.scheduler.run_for(60 * MS)
        rig.read(40110)  # counts as well as writing
    assert rig.fault == 0
    begin = rig.scheduler.now
    while rig.scheduler.now < begin + 80 * MS:
        rig.read(40322)  # does not count
        rig.scheduler.run_for(5 * MS)
    assert rig.fault == 0
    rig.scheduler.run_until(lambda: rig.fault != 0, S)
    assert rig.fault == numbers.SETPOINT_TIMEOUT
    assert 88 * MS < rig.scheduler.now - begin < 103 * MS
    rig.scheduler.run_for(S // 4)
    assert abs(rig.drive.core.speed_rpm) < 1.0
    assert not rig.drive.core.enabled
    zsw1, _ = rig.keep(0.1, READY, 0)
    assert zsw1 & 8
    rig.keep(0.05, ACKNOWLEDGE, 0)
    zsw1, _ = rig.keep(0.1, READY, 0)
    assert not zsw1 & 8
    assert rig.read(40400, 2) == [0, 0]


@pytest.mark.exhaustive
@pytest.mark.requirement("PD-280", "PD-292")
def test_the_time_is_that_of_the_map_of_the_configuration_or_of_p2040():
    """100 ms is the factory value of the map; the configuration or the client may choose another one, 0
    switches it off.
    """
    for options, expected_ms in (
        ({}, 100.0),
        ({"setpoint_monitoring_ms": 500.0}, 500.0),
        ({"setpoint_monitoring_ms": 0.0}, 0.0),
    ):
        rig = ModbusRig("tcp", **options)
        assert rig.drive.parameters.store.value(2040) == expected_ms
        rig.enable()
        rig.scheduler.run_for(S)
        assert rig.fault == (numbers.SETPOINT_TIMEOUT if expected_ms else 0)


@pytest.mark.requirement("PD-292")
def test_the_line_watches_two_registers_and_tcp_all_of_them():
    """On the serial line 40102 does not keep the process data, over TCP it does."""
    for link, fault in (("rtu", numbers.SETPOINT_TIMEOUT), ("tcp", 0)):
        rig = ModbusRig(link)
        rig.enable()
        for _ in range(10):
            rig.write(40102, 0)
            rig.scheduler.run_for(30 * MS)
        assert rig.fault == fault


@pytest.mark.requirement("PD-326", "PD-327", "PD-328", "PD-332", "PD-330")
def test_parameters_by_data_record_47(rig):
    """The worked example reads r0002 = 31; a write of p1121 acts; without supply of the drive nothing is
    answered.
    """
    rig.keep(0.05, READY, 0)
    assert rig.write(40601, 1, 0x2F0A, 0x8001, 0x0101, 0x1001, 0x0002, 0x0000) == "done"
    assert rig.read(40601, 3) == [1, 0x2F00, 4]
    rig.scheduler.run_for(30 * MS)
    assert rig.read(40601, 6) == [2, 0x2F08, 0x8001, 0x0101, 0x0301, 31]
    assert rig.write(40601, 1, 0x2F10, 0x8002, 0x0101, 0x1001, 1121, 0, 0x0801, 0x4080, 0) == "done"
    rig.scheduler.run_for(30 * MS)
    assert rig.read(40601, 4) == [2, 0x2F04, 0x8002, 0x0101]
    assert rig.drive.drive.settings.ramp_down_s == 4.0
    assert rig.read(40323) == [400]


@pytest.mark.requirement("PD-334", "PD-335", "PD-336", "PD-337", "PD-287", "PD-288")
@pytest.mark.parametrize(
    ("request_", "expected"),
    [
        (Request(4, 99, 1), "exception 1"),
        (Request(1, 0, 1), "exception 1"),
        (Request(23, 99, 1, (0,), 99), "exception 1"),
        (Request(3, 98, 1), "exception 2"),
        (Request(3, 120, 2), "exception 2"),
        (Request(16, 118, 3, (0, 0, 0)), "exception 2"),
        (Request(16, 600, 123, (0,) * 123), "exception 3"),
        (Request(6, 109, 1, (0,)), "exception 4"),
        (Request(6, 321, 1, (65001,)), "exception 4"),
        (Request(6, 339, 1, (1,)), "exception 4"),
    ],
)
def test_wrong_requests(rig, request_, expected):
    """Function, address, quantity, execution: 01, 02, 03, 04."""
    assert rig.ask(request_) == expected


@pytest.mark.exhaustive
@pytest.mark.requirement("PD-289", "PD-290", "MODB-040")
def test_units():
    """On the line only its own unit is answered, and a broadcast acts in silence; over TCP every unit is
    answered.
    """
    line, net = ModbusRig("rtu"), ModbusRig("tcp")
    assert line.ask(Request(3, 99, 1), unit=UNIT + 1) is Outcome.TIMEOUT
    assert hasattr(net.ask(Request(3, 99, 1), unit=UNIT + 1), "values")
    line.keep(0.1, READY, 0)
    line.client.submit(Request(16, 99, 2, (RUN, 0)), 0)
    line.scheduler.run_for(S // 20)
    assert line.drive.drive.stw1 == RUN
    for unit in (0, 248):
        with pytest.raises(ConfigurationError, match=r"1\.\.247"):
            ProfidriveModbusConfig(unit=unit)


@pytest.mark.requirement("PD-290", "PD-292")
def test_a_damaged_frame_is_not_answered_and_leads_to_the_time_out():
    """A wrong checksum or parity gets no response, and the process data time out."""
    from fieldbus.modbus import Change

    rig = ModbusRig("rtu")
    rig.enable()
    for change in (
        lambda data: Change(data=data[:-1] + bytes((data[-1] ^ 1,))),
        lambda data: Change(damaged=(2,)),
    ):
        end = rig.link.add_hook(
            lambda sender, data, _now, change=change: change(data) if sender == "master" else None
        )
        assert rig.read(40110) is Outcome.TIMEOUT
        end()
        assert rig.fault == numbers.SETPOINT_TIMEOUT
        rig.keep(0.1, READY, 0)
        rig.keep(0.1, ACKNOWLEDGE, 0)
        rig.enable()


@pytest.mark.requirement("PD-289", "MODB-001")
@pytest.mark.parametrize("baud", [4800, 9600, 19200, 38400, 57600, 76800, 93750, 115200, 187500])
@pytest.mark.parametrize("parity", [Parity.EVEN, Parity.NONE])
def test_rates_of_the_line(baud, parity):
    """It works with each rate and 11 bits per character, and refuses others."""
    rig = ModbusRig("rtu", format_=SerialFormat(baud, parity))
    assert rig.read(40100, 2) == [0, 0]
    for wrong in (SerialFormat(baud, Parity.NONE, 1), SerialFormat(14400, parity)):
        drive = ProfidriveModbusDrive(rig.scheduler, rig.config, name="other")
        with pytest.raises(ConfigurationError, match="serial line"):
            drive.attach(SerialLine(rig.scheduler, format_=wrong))


@pytest.mark.requirement("PD-291")
@pytest.mark.parametrize(
    ("baud", "longest_us"),
    [(38400, 750), (57600, 556), (76800, 417), (93750, 341), (115200, 278), (187500, 171)],
)
def test_pauses_within_a_frame(baud, longest_us):
    """A pause up to the table's time belongs to the frame, a longer one spoils it."""
    from fieldbus.modbus import Change

    rig = ModbusRig("rtu", format_=SerialFormat(baud))
    for pause_us, answered in ((longest_us, True), (longest_us + 1, False)):
        change = Change(pauses={3: pause_us * US})
        end = rig.link.add_hook(
            lambda sender, _data, _now, change=change: change if sender == "master" else None
        )
        assert (rig.read(40100) == [0]) is answered
        end()


def test_telegrams_that_do_not_fit_are_refused():
    """Ten words stand in the registers of the G120; telegram 106 has more, telegram 105 fits."""
    scheduler = VirtualScheduler()
    for telegram, fits in ((105, True), (106, False)):
        config = ProfidriveModbusConfig(drive=ProfidriveConfig.reference(telegram=telegram))
        if fits:
            ProfidriveModbusDrive(scheduler, config, name="drive")
        else:
            with pytest.raises(ConfigurationError, match="at most 10 in SINAMICS G120"):
                ProfidriveModbusDrive(scheduler, config, name="drive")


@pytest.mark.exhaustive
def test_isochronous_only_on_command():
    """With a telegram of application class 4 the sign of life is not watched unless the configuration wants
    it.
    """
    for wanted in (None, True):
        config = ProfidriveConfig(telegram=3, settings=FAST, isochronous=wanted)
        rig = ModbusRig("tcp", drive=config)
        sign = 0
        for cycle in range(200):
            sign = sign % 15 + 1
            if cycle == 150:
                assert rig.fault == 0
            job = rig.client.submit(
                Request(16, 99, 5, (READY, 0, 0, (sign if cycle < 150 else 3) << 12, 0)), 1
            )
            rig.scheduler.run_for(4 * MS)
            assert job.result.outcome is Outcome.DONE
        assert rig.fault == (numbers.SIGN_OF_LIFE if wanted else 0)


@pytest.mark.exhaustive
def test_supply(rig):
    """Without supply nobody answers; afterwards what was written is gone, and what was saved is there."""
    rig.write(40322, 300)
    rig.write(40323, 700)
    assert rig.write(40601, 1, 0x2F0E, 0x8002, 0x0101, 0x1001, 971, 0, 0x4201, 1) == "done"
    rig.scheduler.run_for(S // 10)
    rig.write(40322, 900)
    rig.write(40100, READY, 77)
    rig.drive.power_off()
    assert rig.read(40100) in (Outcome.TIMEOUT, Outcome.LOST)
    rig.drive.power_on()
    assert rig.read(40100) in ([0], Outcome.LOST)  # a connection of before is reset
    assert rig.read(40100, 2) == [0, 0]
    assert rig.read(40322, 2) == [300, 700]


def test_boot_time():
    """It is silent until it has booted."""
    rig = ModbusRig("rtu", boot_time_ms=400.0)
    assert rig.read(40100) is Outcome.TIMEOUT
    assert rig.read(40100) == [0]


@pytest.mark.exhaustive
@pytest.mark.requirement(
    "PD-349", "MODB-026", "MODB-027", "MODB-028", "MODB-029", "MODB-030", "MODB-031", "MODB-043"
)
def test_exceptions_silence_and_delay_on_demand(rig):
    """Every exception code of the standard is answered and understood, for one function or all; silence; late
    responses.
    """
    texts = {
        5: "acknowledge",
        6: "busy",
        7: "negative",
        8: "memory parity",
        10: "gateway path",
        11: "gateway target",
    }
    for code, text in texts.items():
        rig.drive.refuse_requests(code)
        assert rig.read(40100) == f"exception {code}"
        job = rig.client.submit(Request(3, 99, 1), UNIT)
        rig.scheduler.run_for(S)
        assert text in job.result.text.lower()
    rig.drive.refuse_requests(6, function=16)
    assert rig.write(40100, 0) == "exception 6"
    assert rig.read(40100) == [0]
    rig.drive.refuse_requests(None)
    assert rig.write(40100, 0) == "done"
    with pytest.raises(ConfigurationError, match="gateway"):
        rig.drive.refuse_requests(9)
    rig.drive.suppress_modbus_responses(True)
    assert rig.write(40101, 5) is Outcome.TIMEOUT
    rig.drive.suppress_modbus_responses(False)
    assert rig.read(40101) == [5]  # it was carried out
    before = rig.scheduler.now
    rig.drive.delay_responses(0.3)
    assert rig.read(40100) == [0]
    assert rig.scheduler.now - before > 300 * MS
    with pytest.raises(ConfigurationError, match="delay_s"):
        rig.drive.delay_responses(-1.0)


@pytest.mark.requirement("PD-349", "PD-333")
def test_errors_of_the_parameter_channel_on_demand(rig):
    """Each error of data record 47 can be had."""
    rig.client.timeout_ns = S
    for code in (1, 2, 3, 4, 5):
        rig.drive.fail_parameter_channel(code)
        assert rig.write(40601, 1, 0x2F0A, 0x8001, 0x0101, 0x1001, 0x0002, 0x0000) == "done"
        rig.scheduler.run_for(30 * MS)
        assert rig.read(40601, 3) == [2, 0x2F00, code]
    rig.drive.fail_parameter_channel(None)
    rig.write(40601, 1, 0x2F0A, 0x8001, 0x0101, 0x1001, 0x0002, 0x0000)
    rig.scheduler.run_for(30 * MS)
    assert rig.read(40602) == [0x2F08]
    with pytest.raises(ConfigurationError, match="1, 2, 3, 4, 5"):
        rig.drive.fail_parameter_channel(9)


@pytest.mark.requirement("PD-321", "PD-295")
def test_fault_methods_are_those_of_every_transport(rig):
    """A fault shows in 40110 bit 3 and 40400, goes with an acknowledgement, and lies of the status word reach
    the client.
    """
    rig.enable()
    rig.drive.raise_fault(numbers.OVERCURRENT)
    zsw1, _ = rig.keep(0.1, RUN, 0)
    assert zsw1 & 0x4F == 0x48
    assert rig.read(40400, 8) == [numbers.OVERCURRENT, 0, 0, 0, 0, 0, 0, 0]
    rig.keep(0.1, ACKNOWLEDGE, 0)
    rig.enable()
    rig.drive.override_statusword_bits(0x0008, 0x0004)
    zsw1, _ = rig.keep(0.05, RUN, 0)
    assert zsw1 & 0x0F == 0x0B
    rig.drive.override_statusword_bits(0, 0)
    rig.drive.set_sto(True)
    zsw1, _ = rig.keep(0.05, RUN, 0)
    assert not zsw1 & 4
    assert rig.drive.state.text
    assert rig.drive.now_ns == rig.scheduler.now
    assert not rig.drive.core.enabled


def test_the_trace_has_the_columns_of_the_drive(rig):
    """The same columns as on CAN but for that of the node, all of them numbers."""
    names = [name for name, _ in rig.drive.trace_columns]
    row = rig.drive.trace_row()
    assert len(row) == len(names) == len(set(names))
    assert "nmt_state" not in names
    assert all(math.isfinite(value) for value in row)
    rig.enable()
    assert rig.drive.trace_row()[names.index("drive_stw1")] == RUN


def test_one_bus_and_what_needs_one():
    """A drive is on one link; without any, doors that need one say so."""
    scheduler = VirtualScheduler()
    drive = ProfidriveModbusDrive(scheduler, ProfidriveModbusConfig(), name="alone")
    with pytest.raises(UnsupportedFaultError, match="no Modbus link"):
        drive.suppress_modbus_responses(True)
    drive.listen(TcpLink(scheduler))
    with pytest.raises(ConfigurationError, match="one bus"):
        drive.attach(SerialLine(scheduler))
    drive.close()


def test_a_reset_is_silence_and_service_again(rig):
    """As after a dip of the supply."""
    rig.enable()
    rig.drive.reset_node(0.7)
    assert rig.read(40100) in (Outcome.TIMEOUT, Outcome.LOST)
    rig.scheduler.run_for(S)
    rig.read(40100)
    assert rig.read(40100, 2) == [0, 0]
    rig.enable()
