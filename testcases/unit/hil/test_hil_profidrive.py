"""The reference axis behind a PROFIdrive telegram: same motion as behind CiA 402, faults, loss and return,
bench file.
"""

from __future__ import annotations

import json
from dataclasses import replace
from functools import cache

import pytest

from fieldbus.profidrive import from_n4
from fieldbus.profidrive.errors import ParameterAccessError
from hil.bench import load_bench
from hil.bench.bench import Bench
from hil.bench.bench_file import BenchFileError, parse, read
from hil.bench.drive_host import DriveHost
from hil.bench.remote import RemoteDrive
from hil.bench.remote_calls import RemoteError
from hil.campaign import CaseSettings, execute_case
from hil.faults import DRIVE_METHODS, Injector
from reports.model import Verdict
from testcases.campaigns import stop_modes

CYCLE_S = 0.004


def bench(name="profidrive", **changes):
    """Return a bench whose drive section has other values."""
    config = load_bench(name).config
    profidrive = changes.pop("profidrive", {})
    drive = config.drive["drive1"]
    variables = dict(changes.pop("variables", ()))
    if profidrive:
        changes["profidrive"] = replace(drive.profidrive, **profidrive)
    drive = drive.model_copy(update=changes)
    axis = config.axis["axis1"]
    axis = axis.model_copy(update={"variables": {**axis.variables, **variables}})
    return Bench(config.model_copy(update={"drive": {"drive1": drive}, "axis": {"axis1": axis}}), seed=1)


def enabled(machine):
    """Enable and home the axis of a bench; returns the axis."""
    axis = machine.axis()
    power = axis.power()
    assert machine.run_until(power.status, 2.0)
    assert machine.run_until(axis.home(0.0).done, 1.0)
    return axis


# -- the same motion
# -----------------------------------------------------------------------------------------------------


@cache
def travel(name, **changes):
    """Return (time, true position in mm) of a series of jobs, the time counted from the first one."""
    with bench(name, **changes) if changes else Bench(load_bench(name).config, seed=1) as machine:
        axis = enabled(machine)
        machine.run_for(0.1)
        started = machine.now_s
        assert machine.run_until(axis.move_absolute(120.0, Velocity=400.0).done, 5.0)
        assert machine.run_until(axis.move_relative(-30.0, Velocity=80.0).done, 5.0)
        axis.move_velocity(-250.0)
        machine.run_for(0.5)
        assert machine.run_until(axis.halt().done, 5.0)
        machine.run_for(0.1)
        signal = machine.trace()["drive1.position"]
        return [
            (round((time - started) / CYCLE_S), value * 1000.0)
            for time, value in zip(signal.time_s, signal.values, strict=True)
            if time >= started
        ]


@pytest.mark.exhaustive
@pytest.mark.requirement("PD-034", "PD-035", "PD-171", "CFG-196")
@pytest.mark.parametrize("telegram", [3, 4, 5, 6, 102, 103, 105, 106])
def test_every_telegram_moves_the_axis_as_cia_402_does(telegram):
    """The same jobs give the same path of the true machine, within 0.05 mm at every cycle and 5 um at the
    end.
    """
    reference, other = travel("reference"), travel("profidrive", telegram=telegram)
    assert abs(len(reference) - len(other)) <= 2
    worst = max(abs(a - b) for (_, a), (_, b) in zip(reference, other, strict=False))
    assert worst < 0.05
    assert reference[-1][1] == pytest.approx(other[-1][1], abs=0.005)


@pytest.mark.exhaustive
@pytest.mark.parametrize(
    "stop", ["power-1/constant", "power-3/constant", "reaction-4/accelerating", "halt/decelerating"]
)
def test_stop_modes_keep_their_numbers(stop):
    """Cases of the campaign about stops pass with the numbers of the specification, unchanged."""
    case = next(case for case in stop_modes.CAMPAIGN.cases if case.identifier == f"stop-modes/{stop}")
    result = execute_case(case, load_bench("profidrive"), CaseSettings(seed=1)).result
    assert result.verdict is Verdict.PASSED, result.message


@pytest.mark.exhaustive
@pytest.mark.requirement("CFG-245")
def test_the_setpoint_on_the_wire_is_a_share_of_the_reference_speed():
    """250 mm/s are 1500 rpm: NSOLL_B is 2000 0000h at p2000 = 3000 rpm, in words 2 and 3 of the telegram."""
    with bench() as machine:
        axis = enabled(machine)
        axis.move_velocity(250.0)
        machine.run_for(1.0)
        words = [machine.drive().slave.get(0x5800 + word) & 0xFFFF for word in range(3)]
        assert words[0] == 0x047F
        assert from_n4(words[1] << 16 | words[2]) == pytest.approx(0.5, abs=0.001)
        assert axis.port.actual_speed_rpm == pytest.approx(1500.0, abs=1.0)


@pytest.mark.requirement("CFG-407")
def test_the_torque_telegram_shows_the_torque():
    """With 750 the axis sees the torque of the drive, and its own torque limits of 200 % leave the motion
    alone.
    """
    with bench(profidrive={"torque_telegram": True}) as machine:
        axis = enabled(machine)
        axis.move_velocity(250.0)
        machine.run_for(0.1)
        assert axis.port.actual_torque_nm == pytest.approx(machine.drive().core.torque, abs=0.1)
        assert axis.port.actual_torque_nm > 0.2


@pytest.mark.exhaustive
def test_a_speed_axis_works_on_telegram_1():
    """Telegram 1 has neither clock nor encoder: a speed axis turns with it, without any sign of life."""
    text = read("speed")[1]
    new = '[drive.drive1]\nprofile = "profidrive"\ntelegram = 1'
    config = parse(text.replace("[drive.drive1]", new), "speed.toml")
    with Bench(config, seed=1) as machine:
        axis = machine.axis()
        assert machine.run_until(axis.power().status, 2.0)
        axis.move_velocity(600.0, Acceleration=3000.0, Jerk=0.0)
        machine.run_for(2.0)
        assert axis.port.actual_speed_rpm == pytest.approx(600.0, abs=1.0)


# -- faults
# ------------------------------------------------------------------------------------------------------------


@pytest.mark.requirement("PD-129", "PD-132", "CFG-192")
def test_a_frozen_sign_of_life_of_the_drive_loses_the_link():
    """The controller reports the drive as lost when its counter stands still, although its frames go on
    coming.
    """
    with bench() as machine:
        axis = enabled(machine)
        words = machine.drive().drive.words
        words.freeze_sign_of_life(True)
        machine.run_for(0.1)
        assert not axis.port.link_ok
        words.freeze_sign_of_life(False)
        machine.run_for(0.1)
        assert axis.port.link_ok


@pytest.mark.exhaustive
@pytest.mark.requirement("PD-345")
def test_the_heartbeat_of_the_controller_that_stays_away_stops_the_drive():
    """A drive that loses its controller trips with F08700 and brakes with its quick stop (6007h = 3)."""
    with bench() as machine:
        axis = enabled(machine)
        axis.move_velocity(250.0)
        machine.run_for(0.5)
        machine.drive().slave.set(0x6007, 0, 3)
        Injector(machine).inject("frame.drop", message="controller_heartbeat", duration_s=1.0)
        machine.run_for(1.0)
        assert machine.drive().drive.faults.number == 8700
        assert not machine.drive().core.enabled


@pytest.mark.parametrize(("code", "number"), [(30001, 30001), (0x4310, 7011), (12345, 12345)])
def test_a_drive_fault_is_seen_with_its_number(code, number):
    """The number of the fault reaches the axis; an EMCY code stands for its fault, any other number for
    itself.
    """
    with bench() as machine:
        axis = enabled(machine)
        Injector(machine).inject("drive.fault", code=code)
        machine.run_for(0.05)
        assert axis.port.drive_fault_code == number
        assert axis.var("StatusDrive.Error")
        axis.reset()
        machine.run_for(0.3)
        assert not axis.var("StatusDrive.Error")
        assert axis.port.drive_fault_code == 0


@pytest.mark.exhaustive
@pytest.mark.requirement("PD-152", "PD-164", "PD-165")
def test_an_encoder_error_is_reported_and_acknowledged():
    """A cut wire makes G1_ZSW.15 and a fault; after repair and acknowledgement the axis has its actual value
    again.
    """
    with bench() as machine:
        axis = enabled(machine)
        fault = Injector(machine).inject("encoder.wire_break")
        machine.run_for(0.05)
        assert axis.port.sensor_fault
        fault.remove()
        for _ in range(3):
            axis.reset()
            machine.run_for(0.3)
        assert not axis.port.sensor_fault
        assert axis.sensor_valid


def test_a_fault_of_the_encoder_is_an_alarm_of_the_encoder():
    """A drive that trips because of its encoder says so in G1_ZSW: the axis raises alarm 411, and goes on
    after a reset.
    """
    with bench() as machine:
        axis = enabled(machine)
        Injector(machine).inject("drive.fault", code=31115)
        machine.run_for(0.05)
        assert axis.alarms.engine.number == 411
        axis.reset()
        machine.run_for(0.3)
        assert axis.sensor_valid
        assert axis.alarms.engine.number == 0


@pytest.mark.exhaustive
def test_a_drive_that_loses_its_supply_is_taken_in_again():
    """After power-off and power-on the network configures the drive again, and the axis can be enabled
    again.
    """
    with bench() as machine:
        axis = enabled(machine)
        Injector(machine).inject("drive.power_off", duration_s=0.5)
        machine.run_for(0.3)
        assert not axis.port.link_ok
        assert machine.run_until(lambda: axis.communication_ok, 3.0)
        axis.power(False)
        machine.run_for(0.1)
        axis.reset()
        machine.run_for(0.2)
        assert machine.run_until(axis.power(True).status, 2.0)


def test_faults_that_the_drive_does_not_have_are_refused_with_a_reason():
    """What has no place in this profile is refused, never ignored."""
    from fieldbus.errors import UnsupportedFaultError

    with bench() as machine:
        for kind, parameters in (("drive.mode_display", {"mode": 3}), ("drive.interlock", {})):
            with pytest.raises(UnsupportedFaultError, match="offers no"):
                Injector(machine).inject(kind, duration_s=0.1, **parameters)


# -- bench file
# ------------------------------------------------------------------------------------------------------------


@pytest.mark.requirement("CFG-201", "CFG-203", "CFG-221")
@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("telegram = 105", "telegram = 2", "no encoder value"),
        ("telegram = 105", "telegram = 7", "telegram"),
        ('profile = "profidrive"', 'profile = "cia402"', "telegram"),
        ("telegram = 105", 'telegram = 105\nsync_loss = "none"', "sync_loss"),
        ("[axis.axis1.variables]", '[axis.axis1.variables]\n"PositionControl.EnableDSC" = true', "XERR"),
        ("increments_per_revolution = 2048", "increments_per_revolution = 2097152", "G1_XIST1"),
        ("telegram = 105", 'telegram = 105\nsafety = { interlock = "fault" }', "interlock"),
    ],
)
def test_mistakes_in_the_bench_file_are_named(old, new, message):
    """A wrong telegram, or a key of the other profile, is refused with its name."""
    text = read("profidrive")[1]
    if message == "XERR":
        text = text.replace("telegram = 105", "telegram = 103")
    assert old in text
    with pytest.raises(BenchFileError, match=message):
        parse(text.replace(old, new), "own.toml")


@pytest.mark.parametrize("name", ["profidrive", "reference"])
def test_a_bench_file_that_names_every_key_is_no_mistake(name):
    """Keys of the other profile with their defaults change nothing: a whole configuration can be read
    back.
    """
    config = load_bench(name).config
    assert type(config).model_validate(config.model_dump(mode="json")) == config


# -- parameters
# ------------------------------------------------------------------------------------------------------------


def test_a_test_reads_and_writes_parameters_of_a_drive():
    """`bench.drive().parameters`: what is written acts, here the ramp of OFF1."""
    with bench() as machine:
        parameters = machine.drive().parameters
        assert parameters.read("p1121") == pytest.approx(1.0)
        parameters.write("p1121", 0.25)
        assert machine.drive().drive.settings.ramp_down_s == 0.25
        answer = parameters.request(bytes.fromhex("01010101100104610000"))
        assert answer == bytes.fromhex("0101010108013E800000")


@pytest.mark.exhaustive
def test_parameters_of_a_drive_in_another_process(request):
    """The same through the pipe: values as JSON, requests as bytes; a refusal comes back with its reason."""
    text = read("profidrive")[1].replace('kind = "virtual"', 'kind = "live"')
    text = text.replace(
        "[segment.can0]", f'[segment.can0]\ninterface = "virtual"\nchannel = "{request.node.name}"'
    )
    host = DriveHost(parse(text, "own.toml"), record=False)

    class Pipe:
        """Commands as they pass the pipe."""

        def call(self, method, name, args=(), kwargs=None):
            command = {"call": method, "drive": name, "args": args, "kwargs": kwargs or {}}
            return json.loads(json.dumps(host.execute(json.loads(json.dumps(command)))))

    try:
        parameters = RemoteDrive(Pipe(), "drive1", DRIVE_METHODS).parameters
        parameters.write("p1121", 0.25)
        assert parameters.read(1121) == 0.25
        assert parameters.request(bytes.fromhex("01010101100104610000")) == bytes.fromhex(
            "0101010108013E800000"
        )
        with pytest.raises(ParameterAccessError):
            parameters.write("r0002", 1)
        with pytest.raises(RemoteError, match="drive9"):
            RemoteDrive(Pipe(), "drive9", DRIVE_METHODS).parameters.read(2)
    finally:
        host.close()
