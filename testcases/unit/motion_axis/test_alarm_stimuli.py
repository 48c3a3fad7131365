"""Every alarm of an axis that the runtime raises, by its cause: number, reaction, bits, jobs, motion,
acknowledgement (TA-024).
"""

from __future__ import annotations

import re
from pathlib import Path

import pytest

import motion
from motion.s7.alarms import alarm, catalogue
from motion.s7.axis.state import AxisState
from testcases.unit.motion_axis.alarm_stimuli import ELSEWHERE, STIMULI, Stimulus
from testcases.unit.motion_axis.conftest import Rig

ROOT = Path(__file__).parents[3]
ROWS = {
    204: "TA-019",
    533: "TA-017",
    534: "TA-017",
    104: "LIM-088",
    307: "LIM-103",
    308: "LIM-103",
    411: "DIA-061",
    421: "STP-608",
    504: "CTL-107",
    551: "CTL-108",
}
DISABLED = (AxisState.DISABLED, AxisState.ALARM_DISABLED)


def brought_about(stimulus: Stimulus):
    """Return the rig with the alarm pending, what takes the cause away, and the index of the first event of
    the alarm.
    """
    rig = Rig(variables=stimulus.variables)
    if not stimulus.fresh:
        rig.travelling(100.0)
    undo = stimulus.act(rig)
    engine = rig.axis.alarms.engine
    rig.until(lambda: engine.is_pending(stimulus.number), stimulus.within_s)
    return rig, undo


def marked(stimulus: Stimulus):
    """Return a parameter with the requirement that its alarm has in addition to those of all."""
    row = ROWS.get(stimulus.number)
    return pytest.param(stimulus, id=stimulus.name, marks=[pytest.mark.requirement(row)] if row else [])


@pytest.fixture(params=[marked(one) for one in STIMULI])
def case(request):
    """Return one stimulus with its rig, the alarm pending, and the end of the cause."""
    return request.param, *brought_about(request.param)


@pytest.mark.requirement("TA-024", "TA-001", "TA-002", "TA-013", "MON-056")
def test_number_reaction_and_bits(case):
    """The alarm has the number of its cause, its reaction, and sets its bit alone in the word of its class;
    X1 is that of errors.
    """
    stimulus, rig, _ = case
    entry = alarm(stimulus.number)
    engine = rig.axis.alarms.engine
    (raised,) = [one for one in engine.pending if one.number == stimulus.number]
    reaction = entry.reactions[0] if stimulus.reaction is None else stimulus.reaction
    assert (raised.reaction, raised.info) == (reaction, stimulus.info)
    if stimulus.info:
        assert raised.info <= len(entry.causes)
    errors = {one.entry.error_bit for one in engine.pending} - {None}
    warnings = {one.entry.warning_bit for one in engine.pending} - {None}
    assert rig.axis.var("ErrorWord") == sum(1 << bit for bit in errors)
    assert rig.axis.var("WarningWord") == sum(1 << bit for bit in warnings)
    assert (entry.error_bit in errors, entry.warning_bit in warnings) == (
        entry.alarm_class != "W",
        entry.alarm_class == "W",
    )
    assert rig.axis.var("StatusWord.X1") is bool(errors)


@pytest.mark.requirement("TA-024", "TA-005", "TA-002", "MC-116", "MC-002")
def test_jobs(case):
    """With a reaction the job in control ends with 16#8001 in the cycle of the alarm; a warning leaves it
    alone.
    """
    stimulus, rig, _ = case
    entry = alarm(stimulus.number)
    if stimulus.fresh:
        if entry.reactions[0]:
            refused = rig.axis.move_velocity(50.0)
            rig.cycles(2)
            assert refused.ErrorID in (
                0x8001,
                0x800D,
            )  # 16#800D while the restart that has found the fault still runs
        return
    (raised,) = [one for one in rig.events("alarm.raised") if one.data["number"] == stimulus.number]
    ended = [one for one in rig.events("job.error") if one.time_ns == raised.time_ns]
    if raised.data["reaction"]:
        assert [one.data["error_id"] for one in ended] == [0x8001] * len(ended)
        assert ended
        assert rig.axis.motion.job is None
    else:
        assert all(one.data["error_id"] != 0x8001 for one in ended)
        assert rig.axis.motion.job.busy


@pytest.mark.requirement("TA-024", "TA-006", "STP-344", "STP-422")
def test_motion(case):
    """A reaction brings the axis to rest, and nothing moves afterwards; a warning does not."""
    stimulus, rig, _ = case
    entry = alarm(stimulus.number)
    if stimulus.fresh:
        return
    reaction = stimulus.reaction or entry.reactions[0]
    if not reaction:
        rig.run(0.3)
        assert rig.axis.state is AxisState.MOTION
        return
    rig.until(lambda: rig.axis.actual_velocity == 0.0, 3.0)
    rig.run(0.3)
    rest = rig.axis.feedback.travel
    keeps = reaction in entry.stays_enabled
    assert (rig.axis.state in DISABLED) is not keeps
    rig.run(0.5)
    assert rig.axis.feedback.travel == pytest.approx(rest, abs=0.01)


@pytest.mark.requirement("TA-024", "TA-007", "TA-008", "MC-178", "MC-180")
def test_acknowledgement(case):
    """Without its cause the alarm is gone after `MC_Reset`, one of class R only after a restart; a second one
    changes nothing.
    """
    stimulus, rig, undo = case
    entry = alarm(stimulus.number)
    engine = rig.axis.alarms.engine
    if not entry.reactions[0] and not stimulus.fresh:
        rig.axis.halt()
    rig.run(1.5)
    undo()
    rig.run(0.5)
    assert engine.is_pending(stimulus.number)  # the end of the cause alone changes nothing
    if entry.restart:
        rig.until(rig.axis.reset().error)
        assert engine.is_pending(stimulus.number)
        rig.until(rig.axis.reset(restart=True).done)
    else:
        rig.until(rig.axis.reset().done)
    rig.run(0.3)
    assert engine.pending == ()
    assert [rig.axis.var(f"ErrorDetail.{one}") for one in ("Number", "Reaction")] == [0, 0]
    assert (rig.axis.var("ErrorWord"), rig.axis.var("WarningWord"), rig.axis.var("StatusWord.X1")) == (
        0,
        0,
        False,
    )
    before = len(rig.events("alarm.raised")) + len(rig.events("alarm.cleared"))
    rig.until(rig.axis.reset().done)
    rig.run(0.1)
    assert len(rig.events("alarm.raised")) + len(rig.events("alarm.cleared")) == before


def raised_in_the_code() -> set[int]:
    """Return the numbers that the sources of the runtime name as alarms."""
    text = "".join(path.read_text() for path in Path(motion.__file__).parent.rglob("*.py"))
    return {int(number) for number in re.findall(r"^ALARM_\w+: Final = (\d+)$", text, re.MULTILINE)}


def test_every_alarm_of_the_runtime_has_a_stimulus():
    """An alarm that the sources raise is brought about by a test: add its stimulus to `alarm_stimuli`."""
    here = {one.number for one in STIMULI}
    assert raised_in_the_code() - here - set(ELSEWHERE) == set()
    assert here & set(ELSEWHERE) == set()
    assert here | set(ELSEWHERE) <= set(catalogue())
    for number, place in ELSEWHERE.items():
        assert str(number) in (ROOT / place).read_text(), (number, place)


OBJECTS = {"S": "SpeedAxis", "P": "PositioningAxis", "E": "ExternalEncoder"}


def documented() -> dict[int, list[str]]:
    """Return the rows of the list in the manual by number."""
    rows = re.findall(r"^\| (\d+) \|(.*)\|$", (ROOT / "docs/reference/alarms.md").read_text(), re.MULTILINE)
    return {int(number): [cell.strip() for cell in cells.split(" | ")] for number, cells in rows}


def test_the_manual_lists_every_alarm():
    """Class, reactions, bit, objects and text are those of the catalogue; a dash stands exactly where nothing
    raises it.
    """
    expected = {}
    for number, entry in catalogue().items():
        objects = "".join(letter for letter, kind in OBJECTS.items() if kind in entry.applies_to)
        if objects:
            bit = f"W.X{entry.warning_bit}" if entry.error_bit is None else f"E.X{entry.error_bit}"
            reactions = " or ".join(map(str, entry.reactions))
            expected[number] = [entry.alarm_class, reactions, bit, objects, entry.text]
    found = documented()
    assert {number: cells[:5] for number, cells in found.items()} == expected
    silent = {number for number, cells in found.items() if cells[5].startswith("- ")}
    assert silent == set(found) - {one.number for one in STIMULI} - set(ELSEWHERE)
