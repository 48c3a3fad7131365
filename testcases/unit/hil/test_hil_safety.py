"""Safety functions of a drive in a bench: selected as faults, seen by the axis as alarms, re-enabled as the
documents say.
"""

from __future__ import annotations

import json

import pytest

from fieldbus.errors import ConfigurationError, UnsupportedFaultError
from hil.bench import BenchFile, BenchFileError, load_bench
from hil.bench.remote import RemoteDrive
from hil.faults import CATALOGUE, DRIVE_METHODS, Fault, Injector

pytestmark = pytest.mark.exhaustive

TABLES = """
[drive.drive1.profidrive]
safety_telegram = 701

[drive.drive1.safety]
ss1_time_ms = 1000.0
ss2_time_ms = 1000.0
sls_limits_mm_s = [250.0]
sls_delay_ms = 300.0
slp_ranges_mm = [[-100.0, 100.0]]
"""
KINDS = [entry for entry in CATALOGUE if entry.name.startswith("safety.")]


def build(tables=TABLES, name="profidrive"):
    text = load_bench(name).text.replace("[axis.axis1]\n", f"{tables}\n[axis.axis1]\n")
    return BenchFile("own.toml", text).build(seed=7)


class Rig:
    """The bench with its axis under way."""

    def __init__(self, bench, velocity=200.0):
        self.bench = bench
        self.axis = bench.axis()
        self.drive = bench.drive()
        self.faults = Injector(bench)
        self.power = self.axis.power()
        assert bench.run_until(self.power.status, timeout=2.0)
        self.job = self.axis.move_velocity(velocity)
        bench.run_for(0.6)
        assert abs(self.axis.var("ActualVelocity") - velocity) < 2.0

    def alarms(self):
        return [event.data["number"] for event in self.bench.history.events if event.kind == "alarm.raised"]

    def word(self):
        """Return S_ZSW1B as the controller gets it."""
        return self.axis.port.actual("S_ZSW1B")

    def speed(self):
        return abs(self.drive.mechanics.velocity) * 1000.0

    def again(self):
        """Acknowledge; return whether the axis works again with the enable kept."""
        reset = self.axis.reset()
        assert self.bench.run_until(lambda: reset.done() or reset.error(), timeout=1.0)
        return self.bench.run_until(self.power.status, timeout=1.0)


@pytest.fixture
def rig():
    with build() as bench:
        yield Rig(bench)


@pytest.mark.requirement("CFG-443", "CFG-448", "CFG-449", "STP-560")
def test_safe_torque_off_is_alarm_421(rig):
    """The axis coasts with alarm 421; acknowledged too early the alarm is there again; then it is enabled by
    itself.
    """
    armed = rig.faults.inject("drive.sto", "drive1")
    rig.bench.run_for(0.1)
    assert rig.alarms() == [421]
    assert rig.word() & 0x0001
    assert rig.speed() > 50.0
    rig.bench.run_for(2.0)
    assert not rig.again()
    armed.remove()
    assert rig.again()


@pytest.mark.requirement("CFG-444", "CFG-448", "STP-561")
def test_safe_stop_1_is_alarm_550_and_then_421(rig):
    """The drive brakes by itself on OFF3, the setpoints track; with safe torque off alarm 421 follows."""
    rig.faults.inject("drive.ss1", "drive1")
    rig.bench.run_for(0.05)
    assert rig.alarms() == [550]
    assert rig.job.CommandAborted or rig.job.Error
    assert rig.axis.var("Position") == pytest.approx(rig.axis.var("ActualPosition"), abs=2.0)
    rig.bench.run_for(0.5)
    assert rig.speed() == pytest.approx(0.0, abs=0.1)
    assert rig.alarms() == [550, 421]
    assert rig.word() & 0x0003 == 0x0003


@pytest.mark.requirement("CFG-445", "CFG-448", "CFG-449", "STP-561")
def test_safe_stop_2_is_alarm_550_and_the_drive_stays_on(rig):
    """Alarm 550 alone: the drive stands under its own control with ZSW1.2; afterwards the axis is led
    again.
    """
    armed = rig.faults.inject("safety.ss2", "drive1")
    rig.bench.run_for(1.0)
    assert rig.alarms() == [550]
    assert rig.speed() == pytest.approx(0.0, abs=0.1)
    assert rig.word() & 0x000F == 0x000C
    assert rig.drive.drive.state.text.startswith("S4")
    armed.remove()
    rig.bench.run_for(0.1)
    assert rig.again()
    rig.axis.move_velocity(100.0)
    rig.bench.run_for(0.5)
    assert rig.speed() == pytest.approx(100.0, abs=2.0)


@pytest.mark.requirement("CFG-463", "CFG-464", "CFG-465", "CFG-611")
@pytest.mark.parametrize("reacts", [True, False])
def test_safely_limited_speed_in_the_protective_door_example(reacts):
    """SLS of 250 mm/s with 80 %: a program that takes 200 mm/s from S_V_LIMIT_B goes on; another one gets
    550, then 421.
    """
    with build() as bench:
        rig = Rig(bench, 400.0)
        rig.faults.inject("safety.sls", "drive1")
        bench.run_for(0.02)
        assert rig.word() & 0x0040
        limit = rig.axis.port.actual("S_V_LIMIT_B") / 0x4000_0000 * 3000.0 / 60.0 * 10.0
        assert limit == pytest.approx(200.0, abs=0.001)
        if reacts:
            rig.axis.move_velocity(limit)
        bench.run_for(1.0)
        if reacts:
            assert rig.alarms() == []
            assert rig.speed() == pytest.approx(200.0, abs=1.0)
            assert rig.word() & 0x00D0 == 0x0050
        else:
            assert rig.alarms() == [550, 421]
            assert rig.speed() == pytest.approx(0.0, abs=0.1)
            assert rig.word() & 0x8080 == 0x8080


def test_a_violation_waits_for_its_safe_acknowledgement(rig):
    """After the stop by safe direction MC_Reset alone does not help: the safety message has to go first."""
    armed = rig.faults.inject("safety.sdi", "drive1", direction="negative")
    rig.bench.run_for(1.0)
    armed.remove()
    assert rig.alarms() == [550, 421]
    assert not rig.again()
    rig.faults.inject("safety.acknowledge", "drive1")
    assert rig.again()


@pytest.mark.requirement("CFG-454", "CFG-455")
def test_a_brake_test_led_by_the_controller():
    """With the axis halted and enabled the drive pulls at its brake; no alarm, and the result comes back."""
    tables = TABLES + "sbt_torque_nm = 3.0\n\n[drive.drive1.brake]\ntorque_nm = 5.0\n"
    with build(tables) as bench:
        rig = Rig(bench, 50.0)
        assert bench.run_until(rig.axis.halt().done, timeout=1.0)
        bench.run_for(0.2)
        rig.axis.port.command("S_STW3B", 0x0001)
        bench.run_for(0.02)
        rig.axis.port.command("S_STW3B", 0x0003)
        assert bench.run_until(lambda: rig.axis.port.actual("S_ZSW3B") == 0x0031, timeout=2.0)
        rig.axis.port.command("S_STW3B", 0)
        bench.run_for(0.1)
        assert rig.alarms() == []
        assert bench.trace()["drive1.torque"].values.max() == pytest.approx(3.0, abs=0.01)
        rig.axis.move_velocity(50.0)
        bench.run_for(0.5)
        assert rig.speed() == pytest.approx(50.0, abs=1.0)
        with pytest.raises(ConfigurationError, match="S_STW1B, S_STW3B"):
            rig.axis.port.command("G2_STW", 1)


@pytest.mark.parametrize("entry", KINDS, ids=lambda entry: entry.name)
def test_every_kind_works_through_the_process_of_a_live_bench(rig, monkeypatch, entry):
    """The example of the catalogue is applied and removed by commands that the process of the drives
    accepts.
    """
    drive = rig.drive

    class Pipe:
        def call(self, method, name, args, kwargs):
            assert (method in DRIVE_METHODS, name) == (True, "drive1")
            command = json.loads(json.dumps({"args": list(args), "kwargs": kwargs}))
            return getattr(drive, method)(*command["args"], **command["kwargs"])

    proxy = RemoteDrive(Pipe(), "drive1", DRIVE_METHODS)
    monkeypatch.setattr(rig.bench, "drive", lambda _name=None: proxy)
    monkeypatch.setattr(rig.bench, "kind", "live")
    example = {key: value for key, value in entry.example.items() if key != "duration_s"}
    armed = rig.faults.arm(Fault.from_dict(example))
    rig.bench.run_for(0.05)
    selected = rig.word()
    assert (selected != 0) is (entry.name not in {"safety.acknowledge", "safety.slp"})
    if entry.name == "safety.slp":
        assert rig.axis.port.actual("S_ZSW2B") == 0x0080
    armed.remove()
    drive.acknowledge_safety()
    rig.bench.run_for(0.05)
    assert rig.word() == 0


def test_the_record_shows_the_word():
    """`drive1.safety` is S_ZSW1B in every cycle, and the log has an event with every change."""
    with build(TABLES.replace("safety_telegram = 701", "")) as bench:
        rig = Rig(bench)
        rig.faults.inject("safety.ss2", "drive1", duration_s=0.5)
        bench.run_for(1.0)
        trace = bench.trace()
        seen = set(trace["drive1.safety"].values.astype(int))
        assert seen == {0x0000, 0x0004, 0x002C}
        words = [event.data["word"] for event in trace.select(kind="drive.safety", source="drive1")]
        assert words == [0x0004, 0x002C, 0x0000]


def test_another_profile_has_no_such_functions():
    """On a CiA 402 drive the kinds are refused, and so are the keys of the bench file."""
    with load_bench("reference").build() as bench:
        for entry in KINDS:
            with pytest.raises(UnsupportedFaultError, match="offers no"):
                Injector(bench).arm(Fault.from_dict(entry.example))
    with pytest.raises(BenchFileError, match=r"safety\.sos_tolerance_mm.*has none"):
        build("[drive.drive1.safety]\nsos_tolerance_mm = 3.0\n", "reference")


def test_a_telegram_with_too_many_words_is_refused():
    """106, 750 and 701 are 21 words: more than a node has on CAN; with four TPDOs the node-ID is limited."""
    words = "telegram = 106\n[drive.drive1.profidrive]\ntorque_telegram = true\nsafety_telegram = 701\n"
    text = load_bench("profidrive").text
    with pytest.raises(BenchFileError, match="106 with 750 with 701 has 21 words; at most 16"):
        BenchFile(
            "own.toml",
            text.replace("telegram = 105\n", "")
            .replace("[axis.axis1]\n", "[axis.axis1]\n", 1)
            .replace("increments_per_revolution = 2048", f"increments_per_revolution = 2048\n{words}", 1),
        ).build()
    high = text.replace("node_id = 5", "node_id = 100").replace(
        "[axis.axis1]\n", "[drive.drive1.profidrive]\nsafety_telegram = 701\n\n[axis.axis1]\n"
    )
    with pytest.raises(BenchFileError, match="node_id: 100 with telegram 105 with 701; at most 95"):
        BenchFile("own.toml", high).build()
