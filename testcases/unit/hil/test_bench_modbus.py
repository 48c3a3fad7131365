"""A PROFIdrive axis on a Modbus segment of the bench file: same motion, missing answers, return, evidence."""

from __future__ import annotations

from functools import cache

import pytest

from fieldbus.errors import ConfigurationError
from fieldbus.modbus import Change
from hil.bench import load_bench
from hil.bench.bench import Bench
from hil.bench.bench_file import parse, read
from hil.bench.drive_config import ProfidriveModbusTable
from hil.campaign import CaseSettings, execute_case
from hil.errors import BlockedError
from hil.record import Trace
from reports.model import Verdict
from testcases.campaigns import stop_modes

pytestmark = pytest.mark.exhaustive

BENCHES = ("profidrive_tcp", "profidrive_rtu")
NO_SWITCHES = {'"PositionLimits_HW.Active" = true': '"PositionLimits_HW.Active" = false'}
"""For register maps that show no digital inputs."""


def bench(name="profidrive_tcp", **changes):
    """Return a bench whose file has other texts in some places."""
    text = read(name)[1]
    for old, new in changes.pop("replace", {}).items():
        assert old in text
        text = text.replace(old, new)
    return Bench(parse(text, f"{name}.toml"), seed=1)


def enabled(machine):
    """Enable and home the axis of a bench; returns the axis."""
    axis = machine.axis()
    assert machine.run_until(axis.power().status, 4.0)
    assert machine.run_until(axis.home(0.0).done, 1.0)
    return axis


def moving(machine):
    """Return the axis of a bench at 250 mm/s."""
    axis = enabled(machine)
    assert machine.run_until(axis.move_velocity(250.0).in_velocity, 4.0)
    return axis


def kinds(machine, source="drive1"):
    """Return the kinds of the events of the drive."""
    return [event.kind for event in machine.history.events if event.source == source]


# -- the same motion
# ------------------------------------------------------------------------------------------------------


@cache
def travel(name):
    """Return time (s) and true position (mm) of a job, from its start on."""
    with Bench(load_bench(name).config, seed=1) as machine:
        axis = enabled(machine)
        machine.run_for(0.2)
        start = machine.now_s
        assert machine.run_until(axis.move_absolute(120.0, Velocity=200.0).done, 5.0)
        machine.run_for(0.3)
        signal = machine.trace()["drive1.position"]
        return [
            (round(t - start, 6), v * 1000.0)
            for t, v in zip(signal.time_s, signal.values, strict=True)
            if t >= start
        ]


def test_the_axis_moves_over_tcp_as_it_does_on_can():
    """The same job gives the same path of the machine, cycle by cycle, and ends at the same place."""
    can, tcp = travel("profidrive"), travel("profidrive_tcp")
    assert max(abs(a - b) for (_, a), (_, b) in zip(can, tcp, strict=False)) < 0.05
    assert can[-1][1] == pytest.approx(tcp[-1][1], abs=0.005)


def test_the_axis_reaches_its_target_over_a_line():
    """With the cycle and the gain that the line allows the target is reached to 20 um within 0.3 s of the end
    of the job.
    """
    assert travel("profidrive_rtu")[-1][1] == pytest.approx(120.0, abs=0.02)


@pytest.mark.parametrize("name", BENCHES)
def test_the_stated_delay_is_that_of_the_machine(name):
    """At constant velocity the following error over the transport delay is none: what the axis assumes is
    what happens.
    """
    with bench(name) as machine:
        axis = moving(machine)
        machine.run_for(0.5)
        lag = axis.var("StatusPositioning.FollowingError") / 250.0
        assert abs(lag) < 0.05 * axis.object.delay_s + 0.0005


@pytest.mark.parametrize("name", BENCHES)
@pytest.mark.parametrize(
    "stop", ["power-0/accelerating", "power-1/constant", "stop-3/decelerating", "reaction-4/constant"]
)
def test_stop_modes_keep_their_numbers(name, stop):
    """Cases of the campaign about stops pass on Modbus with the numbers of the specification, unchanged."""
    case = next(case for case in stop_modes.CAMPAIGN.cases if case.identifier == f"stop-modes/{stop}")
    result = execute_case(case, load_bench(name), CaseSettings(seed=1)).result
    assert result.verdict is Verdict.PASSED, result.message


@pytest.mark.parametrize("registers", ["sinamics_g120", "festo"])
@pytest.mark.parametrize("telegram", [3, 102, 105])
def test_telegrams_and_maps_may_be_combined(telegram, registers):
    """Every telegram that the map has room for moves the axis, whatever the order of its bytes."""
    changes = {"telegram = 105": f"telegram = {telegram}", '"sinamics_g120"': f'"{registers}"', **NO_SWITCHES}
    with bench(replace=changes) as machine:
        axis = enabled(machine)
        assert machine.run_until(axis.move_absolute(20.0).done, 3.0)
        assert axis.var("ActualPosition") == pytest.approx(20.0, abs=0.05)


def test_a_line_with_function_23_needs_one_request():
    """Where the map allows it, one request on the line does both, and the delay is stated as half a cycle
    more.
    """
    with bench("profidrive_rtu", replace={'"sinamics_g120"': '"festo"', **NO_SWITCHES}) as machine:
        axis = moving(machine)
        machine.run_for(0.5)
        assert axis.object.delay_s == pytest.approx(2.5 * 0.024, abs=0.005)
        assert abs(axis.var("StatusPositioning.FollowingError") / 250.0) < 0.05 * axis.object.delay_s + 0.0005
        last = [machine.decode(entry[2]) for entry in machine.trace().raw_frames("line0")[-8:]]
        assert any("request 23 " in text for text in last)


@pytest.mark.requirement("MODB-010", "MODB-011")
def test_several_drives_share_a_line():
    """Two drives with their units on one line; each answers for itself, and the line is as busy as both
    need.
    """
    text = read("profidrive_rtu")[1].replace("cycle_ms = 24", "cycle_ms = 48")
    head, axis = text.split("[axis.axis1]")
    drive = head[head.index("[drive.drive1]") :]
    second = drive.replace("drive1", "drive2").replace("unit = 5", "unit = 6")
    other = "[axis.axis2]" + axis.replace("axis1", "axis2").replace("drive1", "drive2")
    with Bench(parse(head + second + "[axis.axis1]" + axis + other, "two.toml"), seed=1) as machine:
        for name in ("axis1", "axis2"):
            assert machine.run_until(machine.axis(name).power().status, 6.0)
        assert machine.run_until(machine.axis("axis1").move_relative(10.0).done, 4.0)
        machine.run_for(1.5)
        assert machine.axis("axis2").var("ActualPosition") == pytest.approx(0.0, abs=0.01)
        assert machine.axis("axis1").var("ActualPosition") == pytest.approx(10.0, abs=0.01)
        load = machine.trace()["line0.load"]
        characters = 2 * (
            9 + 20 + 8 + 8 + 5 + 20 + 8 + 5 + 12
        )  # write, read, read inputs, each with its response (MODB-011)
        assert load.values[-1] == pytest.approx(100.0 * characters * 11 / 115_200 / 0.048)


# -- answers that do not come
# ---------------------------------------------------------------------------------------------


def lose(machine, number, sender="drive1"):
    """Drop a number of answers from now on."""
    left = [number]

    def hook(who, _data, _time):
        if who != sender or not left[0]:
            return None
        left[0] -= 1
        return Change(drop=True)

    return machine.segment().add_hook(hook)


@pytest.mark.parametrize("name", BENCHES)
def test_two_lost_answers_are_two_missing_cycles(name):
    """Fewer missing cycles than `grace_cycles` do not disturb the axis; they are counted."""
    with bench(name) as machine:
        axis = moving(machine)
        lose(machine, 2)
        machine.run_for(0.3)
        assert 1 <= axis.port.missed <= 2
        assert axis.port.link_ok
        assert not axis.alarms.engine.number
        assert machine.trace()[f"{machine.segment().name}.drive1_missed"].values[-1] == axis.port.missed


@pytest.mark.parametrize("name", BENCHES)
def test_silence_is_a_lost_link_and_its_end_a_link(name):
    """A drive that does not answer is alarm 431 after the grace cycles; when it answers again the link is
    up.
    """
    with bench(name) as machine:
        axis = moving(machine)
        end = lose(machine, 10_000)
        assert machine.run_until(lambda: not axis.port.link_ok, 0.5)
        machine.run_for(0.01)
        assert axis.alarms.engine.number == 431
        end()
        assert machine.run_until(lambda: axis.port.link_ok, 4.0)
        assert "link.node_lost" in kinds(machine)


@pytest.mark.requirement("MODB-025", "MODB-026", "MODB-027", "MODB-028", "MODB-030", "MODB-031")
@pytest.mark.parametrize("code", [4, 5, 6, 7, 10, 11])
def test_an_exception_is_a_missing_cycle(code):
    """Exceptions that may pass (busy, acknowledge, a gateway without its target) cost cycles, and are
    reported with their name.
    """
    with bench() as machine:
        axis = moving(machine)
        left = [2]

        def refuse(_unit, pdu):
            if pdu[:3] != b"\x03\x00\x6d" or not left[0]:
                return 0
            left[0] -= 1
            return code

        machine.drive().server.exception_hook = refuse
        machine.run_for(0.1)
        assert (axis.port.exceptions, axis.port.missed) == (2, 2)
        assert axis.port.link_ok
        reported = [event.data for event in machine.history.events if event.kind == "link.request_failed"]
        assert [event["exception"] for event in reported] == [code]
        left[0] = 1000
        machine.run_for(0.1)
        assert not axis.port.link_ok
        left[0] = 0
        assert machine.run_until(lambda: axis.port.link_ok, 2.0)


@pytest.mark.requirement("MODB-041")
def test_a_late_answer_is_discarded():
    """An answer behind its time-out is none: the cycle is missing, and the next one has the values of the
    next request.
    """
    with bench() as machine:
        axis = moving(machine)
        once = [True]

        def hook(who, _data, _time):
            if who == "drive1" and once:
                once.clear()
                return Change(delay_ns=6_000_000)
            return None

        machine.segment().add_hook(hook)
        machine.run_for(0.1)
        assert machine.segment().client("drive1").late >= 1
        assert axis.port.link_ok


@pytest.mark.requirement("MODB-042", "PD-292")
def test_a_cut_cable_is_noticed_by_both_sides():
    """A cut cable is not reported: the axis misses its answers, the drive its process data (F01910), and
    brakes.
    """
    changes = {"off1_ramp_s = 1.0": "off1_ramp_s = 1.0\nprofidrive = { sign_of_life = false }"}
    with bench(replace=changes) as machine:
        axis = moving(machine)
        machine.segment().link().cut = True
        machine.run_for(0.05)
        assert not axis.port.link_ok
        machine.run_for(1.0)
        assert machine.drive().drive.faults.number == 1910
        machine.segment().link().cut = False
        assert machine.run_until(lambda: axis.port.link_ok, 2.0)
        machine.run_for(0.1)
        assert axis.port.drive_fault_code == 1910


def test_a_connection_that_is_reset_is_made_again():
    """A reset costs some cycles; the drive behind the new connection is the same, and keeps its reference."""
    with bench(replace={"cycle_ms = 4": "cycle_ms = 4\ngrace_cycles = 30"}) as machine:
        axis = moving(machine)
        restarts = axis.port.encoder_restarts
        machine.drive().station.ends[0].reset()
        machine.run_for(0.3)
        assert axis.port.link_ok
        assert axis.port.encoder_restarts == restarts
        assert machine.segment().client("drive1").connections == 2
        assert not axis.alarms.engine.number


@pytest.mark.requirement("PD-081")
@pytest.mark.parametrize("name", BENCHES)
def test_a_drive_that_was_off_is_known_by_its_words(name):
    """A drive that has not had a telegram yet does not request control: the reference of an incremental
    encoder is lost.
    """
    with bench(name) as machine:
        axis = moving(machine)
        restarts = axis.port.encoder_restarts
        machine.drive().power_off()
        machine.run_for(0.5)
        assert not axis.port.link_ok
        machine.drive().power_on()
        assert machine.run_until(lambda: axis.port.link_ok, 4.0)
        assert axis.port.encoder_restarts == restarts + 1
        axis.power(False)
        machine.run_for(0.3)
        axis.reset()
        machine.run_for(0.5)
        assert machine.run_until(axis.power(True).status, 4.0)
        assert not axis.var("StatusWord.X5")


@pytest.mark.requirement("PD-129", "PD-132")
def test_a_counter_that_stands_still_loses_the_link():
    """The sign of life of the telegram is watched on Modbus too: answers with an old counter are no signs of
    life.
    """
    with bench() as machine:
        axis = enabled(machine)
        machine.drive().drive.words.freeze_sign_of_life(True)
        machine.run_for(0.1)
        assert not axis.port.link_ok


def test_the_number_of_a_fault_is_read_from_its_register():
    """A fault has its number at the axis (40400), until it is acknowledged."""
    with bench() as machine:
        axis = enabled(machine)
        machine.drive().raise_fault(30001)
        machine.run_for(0.1)
        assert axis.port.drive_fault_code == 30001
        axis.reset()
        machine.run_for(0.5)
        assert axis.port.drive_fault_code == 0
        assert not axis.var("StatusDrive.Error")


def test_the_time_out_is_written_where_the_map_has_it():
    """p2040 of the drive is what the bench file says, by a request at the start."""
    changes = {
        '"sinamics_g120"': '"festo"',
        **NO_SWITCHES,
        "off1_ramp_s = 1.0": "off1_ramp_s = 1.0\nprofidrive = { setpoint_monitoring_ms = 250 }",
    }
    with bench(replace=changes) as machine:
        words = [machine.decode(entry[2]) for entry in machine.trace().raw_frames("net0")]
        assert any("16 write multiple registers 0190h = 00FA 0000" in text for text in words)
        assert machine.drive().drive.settings.setpoint_monitoring_ms == 250.0


# -- parameters
# -----------------------------------------------------------------------------------------------------------


def ask(machine, number, index=0, within_s=4.0):
    """Read a parameter through the port; returns value and reason."""
    answers = []
    machine.axis().port.read_parameter(number, index, lambda value, reason: answers.append((value, reason)))
    assert machine.run_until(lambda: answers, within_s)
    assert len(answers) == 1
    return answers[0]


@pytest.mark.requirement("PD-326", "PD-327", "PD-328")
@pytest.mark.parametrize("name", BENCHES)
def test_parameters_are_read_while_the_axis_moves(name):
    """Data record 47 in registers brings reference speed, telegram and ramp times; no cycle is missed, and no
    sign of life.
    """
    with bench(name) as machine:
        axis = moving(machine)
        assert axis.port.has_parameters
        assert ask(machine, 2000) == (3000.0, "")
        assert ask(machine, 922) == (105.0, "")
        assert ask(machine, 1121) == (1.0, "")
        machine.run_for(0.3)
        assert axis.port.missed == 0
        assert axis.port.link_ok
        assert not axis.alarms.engine.number


@pytest.mark.requirement("PD-210", "PD-213")
def test_a_parameter_that_there_is_not_is_refused_with_its_reason():
    """The error number of the drive reaches the program in words; the next one is read."""
    with bench() as machine:
        assert ask(machine, 65000) == (None, "00h parameter number not permitted")
        assert ask(machine, 947, 5000) == (None, "03h wrong sub-index at sub-index 5000")
        assert ask(machine, 2000) == (3000.0, "")


def test_a_lost_drive_ends_what_was_asked_of_it():
    """A request for a parameter of a drive that is lost ends with one message."""
    with bench() as machine:
        answers = []
        lose(machine, 100_000)
        machine.axis().port.read_parameter(2000, 0, lambda *answer: answers.append(answer))
        machine.run_for(1.0)
        assert [value for value, _ in answers] == [None]


def test_a_map_without_a_channel_has_no_parameters():
    """A register map without data record 47 says so."""
    with bench(replace={'"sinamics_g120"': '"festo"', **NO_SWITCHES}) as machine:
        assert not machine.axis().port.has_parameters


# -- start
# ------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", BENCHES)
def test_a_drive_that_does_not_answer_ends_the_start(name, monkeypatch):
    """The message has the drive, its unit and the reason."""
    from emulators.drive.profidrive.modbus import ProfidriveModbusDrive

    monkeypatch.setattr(ProfidriveModbusDrive, "power_on", lambda _self: None)
    with pytest.raises(BlockedError, match=r"drive1 \(unit \d\) does not answer within 5 s: "):
        bench(name)


@pytest.mark.requirement("MODB-023")
def test_a_drive_with_another_map_ends_the_start_at_once(tmp_path, monkeypatch):
    """Exception 02 to the first question: the drive is another one than the map says; asking again would
    change nothing.
    """
    from fieldbus.modbus import process_data
    from fieldbus.modbus.map_file import load_map
    from fieldbus.profidrive import telegram

    assert process_data(load_map("festo"), telegram(105)).actual_values == 100
    own = tmp_path / "own.toml"
    maps = read("profidrive_tcp")[1].replace('map = "sinamics_g120"', 'map = "own.toml"')
    maps = maps.replace(*next(iter(NO_SWITCHES.items())))
    text = 'name = "own"\nfunctions = [3, 16]\n[[block]]\nregister = 0\ncount = 10\nhook = "setpoints"\n[[block]]\nregister = 20\ncount = 10\nhook = "actual_values"\n'  # noqa: E501
    (tmp_path / "bench.toml").write_text(maps)
    own.write_text(text)
    config = load_bench(tmp_path / "bench.toml").config
    with Bench(config, seed=1) as machine:
        assert machine.axis().port.link_ok
    wrong = process_data(load_map("festo"), telegram(105))
    monkeypatch.setattr(ProfidriveModbusTable, "registers", lambda _drive: wrong)
    with pytest.raises(
        BlockedError,
        match=r"another drive than its register map says: 03 .*02h illegal data address",
    ):
        Bench(config, seed=1)


def test_an_optional_drive_may_be_missing(monkeypatch):
    """A bench with an optional drive is ready without it."""
    from emulators.drive.profidrive.modbus import ProfidriveModbusDrive

    power_on = ProfidriveModbusDrive.power_on
    monkeypatch.setattr(ProfidriveModbusDrive, "power_on", lambda _self: None)
    with bench(replace={'map = "sinamics_g120"': 'map = "sinamics_g120"\noptional = true'}) as machine:
        assert not machine.axis().port.link_ok
        power_on(machine.drive())
        assert machine.run_until(lambda: machine.axis().port.link_ok, 2.0)


# -- evidence
# ------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", BENCHES)
def test_the_trace_has_the_frames_and_repeats(name, tmp_path):
    """Requests and answers are in the trace, in words with the signals of the telegram; a second run is the
    same byte for byte.
    """

    def run():
        with bench(name) as machine:
            moving(machine)
            trace = machine.trace()
            return trace, [
                machine.decode(entry[2]) for entry in trace.raw_frames(machine.segment().name)[-8:]
            ]

    (trace, words), (again, _) = run(), run()
    assert trace.digest() == again.digest()
    assert any("drive1: " in text and "NSOLL_B = " in text and "STW2" in text for text in words)
    assert any("G1_XIST1" in text for text in words)
    assert {frame.protocol for frame in trace.frames} == {
        "modbus_tcp" if name.endswith("tcp") else "modbus_rtu"
    }
    trace.save(tmp_path / "trace")
    loaded = Trace.load(tmp_path / "trace")
    assert loaded.digest() == trace.digest()
    bus = loaded.buses[0]
    assert [entry[2].text() for entry in loaded.raw_frames(bus)] == [
        entry[2].text() for entry in trace.raw_frames(bus)
    ]


def test_a_failed_case_leaves_its_requests_as_text(tmp_path):
    """The evidence of a case has a line for every request and response, and no candump log of a bus that is
    none.
    """
    from hil.campaign import write_evidence

    case = next(case for case in stop_modes.CAMPAIGN.cases if case.identifier == "stop-modes/halt/standstill")
    execution = execute_case(case, load_bench("profidrive_tcp"), CaseSettings(seed=1))
    write_evidence(execution, tmp_path, "all")
    file = tmp_path / execution.result.files["bus log (Modbus)"]
    lines = file.read_text().splitlines()
    assert lines[0] == "0.000100 net0 controller -  connection 1 opened"
    assert lines[1].startswith(
        "0.000300 net0 controller 00 01 00 00 00 06 01 03 00 6D 00 0A  transaction 1 unit 1 request 03"
    )
    assert not file.with_name("bus.log").exists()


def test_can_services_are_none_of_a_drive_on_modbus():
    """There is neither a node nor a COB-ID; the messages say why."""
    with bench() as machine:
        with pytest.raises(ConfigurationError, match="on Modbus"):
            machine.node("drive1")
        with pytest.raises(ConfigurationError, match="on Modbus"):
            machine.cob_ids("drive1")
        with pytest.raises(ConfigurationError, match="CAN segment"):
            machine.network("net0")
        assert machine.network_names == ()
