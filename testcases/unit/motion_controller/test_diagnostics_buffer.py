"""The diagnostics buffer: bounded, in order, with entries of every part that reports (TA-011, STP-020)."""

from __future__ import annotations

import pytest

from fieldbus.clock import S, VirtualScheduler
from fieldbus.errors import ConfigurationError
from fieldbus.history import History
from motion.s7.alarms import catalogue
from motion.s7.controller import DiagnosticsBuffer


@pytest.fixture
def scheduler():
    return VirtualScheduler()


def test_bounded(scheduler):
    """The oldest entries go, the numbers go on; the text has the newest first."""
    buffer = DiagnosticsBuffer(scheduler, capacity=3)
    for number in range(5):
        scheduler.run_for(S)
        buffer.append("controller", f"entry {number}", "coming" if number % 2 else "")
    assert [(entry.number, entry.time_ns, entry.text) for entry in buffer.entries] == [
        (3, 3 * S, "entry 2"),
        (4, 4 * S, "entry 3"),
        (5, 5 * S, "entry 4"),
    ]
    lines = buffer.text(2).splitlines()
    assert [line.split(": ")[1] for line in lines] == ["entry 4", "entry 3"]
    assert "4.000 s  + controller" in lines[1]
    assert buffer.entries[1].as_dict() == {
        "number": 4,
        "time_s": 4.0,
        "source": "controller",
        "text": "entry 3",
        "direction": "coming",
    }
    with pytest.raises(ConfigurationError, match="1 or more"):
        DiagnosticsBuffer(scheduler, capacity=0)


def test_power_off(scheduler):
    """The newest 500 entries outlast it."""
    buffer = DiagnosticsBuffer(scheduler)
    for number in range(700):
        buffer.append("controller", str(number))
    buffer.lose_power()
    assert (len(buffer), buffer.entries[0].number, buffer.entries[-1].number) == (500, 201, 700)


@pytest.mark.requirement("TA-011")
def test_exactly_the_alarms_that_are_recorded(scheduler):
    """Coming and going of every alarm of the catalogue that has the mark, of no other."""
    history = History(scheduler)
    buffer = DiagnosticsBuffer(scheduler)
    end = buffer.follow(history)
    for number in catalogue():
        history.emit("axis1", "alarm.raised", number=number, reaction=1, text="")
        history.emit("axis1", "alarm.cleared", number=number)
    recorded = [number for number, entry in catalogue().items() if entry.diagnostic_buffer]
    assert len(buffer) == 2 * len(recorded)
    reported = [
        (int(e.text.split("alarm ")[1].split(",")[0].split(":")[0]), e.direction) for e in buffer.entries
    ]
    assert reported == [(number, way) for number in recorded for way in ("coming", "going")]
    end()
    history.emit("axis1", "alarm.raised", number=recorded[0], reaction=1, text="")
    assert len(buffer) == 2 * len(recorded)


def test_what_others_emit_is_taken_as_it_is(scheduler):
    """A part of one's own may emit the same kinds with other data; an unknown alarm is none."""
    history = History(scheduler)
    buffer = DiagnosticsBuffer(scheduler)
    buffer.follow(history)
    history.emit("lamp", "link.node_lost")
    history.emit("lamp", "alarm.raised", number=9999)
    history.emit("lamp", "alarm.raised")
    assert [entry.text for entry in buffer.entries] == ["device lost: ?"]


@pytest.mark.requirement("STP-020")
def test_alarms_and_connections_of_an_axis(rig):
    """An alarm comes and goes; OB 121 is named; the entries are in the order of time."""
    rig.travelling(100.0)
    rig.port.fault = True
    rig.run(1.0)
    rig.port.fault = False
    rig.axis.reset()
    rig.run(0.3)
    rig.axis.write("Sensor[1].Backlash.DirectionAbsoluteHoming", 77)
    rig.history.emit("drive1", "link.down")
    entries = rig.controller.diagnostics_buffer.entries
    assert [(entry.source, entry.direction) for entry in entries] == [
        ("axis1", "coming"),
        ("axis1", "going"),
        ("axis1", ""),
        ("drive1", "coming"),
    ]
    assert "technology alarm 421, reaction 4" in entries[0].text
    assert "OB 121" in entries[2].text
    assert entries[3].text == "no cyclic communication"
    assert [entry.time_ns for entry in entries] == sorted(entry.time_ns for entry in entries)
