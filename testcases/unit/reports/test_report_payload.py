"""What the page knows of a case."""

from __future__ import annotations

import json

import numpy as np
import pytest

from reports import AlarmRecord, CaseResult, Check, FaultRecord, Message, Signal, Step, Verdict
from reports.html.numbers import decode
from reports.html.payload import (
    case_payload,
    file_link,
    full_story,
    index_entry,
    script_json,
    select_messages,
)


def messages(count: int, **errors: str) -> list[Message]:
    return [
        Message(index * 0.001, "can0", 0x181, "", "drive1", f"m{index}", errors.get(f"e{index}", ""))
        for index in range(count)
    ]


def test_messages_with_errors_and_those_near_the_fault_are_chosen():
    """Of a long log stay all frames with errors and the nearest to the moments of interest, in order."""
    log = messages(5000, e4900="CRC error", e3="dropped")
    chosen = select_messages(log, [2.0], 100)
    assert len(chosen) == 100
    assert chosen == sorted(chosen)
    assert {3, 4900, 1999, 2000, 2001} <= set(chosen)
    assert set(chosen) - {3, 4900} == set(range(1951, 2049))


def test_short_log_is_whole_and_gaps_are_counted():
    """The page says how many messages are left out, and where."""
    assert select_messages(messages(5), [], 10) == [0, 1, 2, 3, 4]
    case = CaseResult(
        "c",
        "",
        Verdict.FAILED,
        faults=[FaultRecord("k", "t", 0.0, 2.0, None)],
        messages=messages(5000, e3="bad"),
    )
    rows = case_payload(case, points=500)["messages"]
    assert len(rows) == 400
    assert sum(row[7] for row in rows) == 2000 + 199 + 1 - 400
    assert rows[0][5:] == ["m3", "bad", 3]


def test_story_is_completed_from_the_records():
    """Faults, alarms and checks enter the story where the steps do not tell them, in order of time."""
    case = CaseResult("c", "", Verdict.FAILED, story=[Step(0.5, "do", "MC_Power")])
    case.faults = [FaultRecord("can.drop", "can0", 0.0, 1.0, 1.5), FaultRecord("never", "x", 0.0, None, None)]
    case.alarms = [AlarmRecord(1.1, "axis1", 431, 4, "lost")]
    case.checks = [
        Check("alarm 431", Verdict.PASSED, "within 20 ms", "after 100 ms", 1.1),
        Check("timeless", Verdict.PASSED, "", ""),
    ]
    assert [(step.time_s, step.kind) for step in full_story(case)] == [
        (0.5, "do"),
        (1.0, "inject"),
        (1.1, "observe"),
        (1.1, "expect"),
        (1.5, "inject"),
    ]
    case.story.append(Step(1.0, "inject", "reported"))
    assert [step.text for step in full_story(case) if step.kind == "inject"] == ["reported"]


def test_measured_time_gets_its_interval():
    """A reaction time without a start counts back from its moment, so that the plot can draw it; a level does
    not.
    """
    case = CaseResult("c", "", Verdict.FAILED)
    case.checks = [
        Check("a", Verdict.FAILED, "", "", 1.048, 48.0, "ms", None, 20.0),
        Check("b", Verdict.PASSED, "", "", 1.0, 3.0, "mm", None, 5.0),
        Check("c", Verdict.PASSED, "", "", 1.0, 3.0, "ms", None, 5.0, since_s=0.5),
    ]
    assert [check["since"] for check in case_payload(case, points=500)["checks"]] == [1.0, None, 0.5]


def test_failing_moments_stay_complete_in_long_recordings():
    """Around the fault every sample is there, however long the recording."""
    time = np.arange(200_000) * 1e-3
    case = CaseResult("c", "", Verdict.FAILED, faults=[FaultRecord("k", "t", 0.0, 123.456, None)])
    case.signals = [Signal("axis1.position", "mm", time, np.sin(time))]
    plain = case_payload(case, points=2000)
    kept = decode(plain["times"][0])
    assert len(kept) <= 2010
    near = kept[np.abs(kept - 123.456) < 0.1]
    assert len(near) >= 200
    assert np.diff(near).max() < 0.0011


def test_unsorted_and_ragged_recordings_are_put_right():
    """Times of a real recording may be out of order, missing or of another type."""
    case = CaseResult("c", "", Verdict.PASSED)
    case.signals = [
        Signal(
            "a.position", "mm", np.array([0.2, np.nan, 0.1, 0.3]), np.array([2, 9, 1, 3, 7], dtype=np.int16)
        )
    ]
    plain = case_payload(case, points=500)
    assert decode(plain["times"][0]).tolist() == pytest.approx([0.1, 0.2, 0.3])
    assert decode(plain["panels"][0]["traces"][0]["y"]).tolist() == [1, 2, 3]


def test_script_json_cannot_leave_its_element(hostile):
    """No `<`, `>`, `&` or line separator of the data stands in the page; the data is unchanged."""
    for case in hostile.cases:
        plain = case_payload(case, points=500)
        text = script_json(plain)
        assert not set("<>&\u2028\u2029") & set(text)
        assert json.loads(text) == plain


@pytest.mark.parametrize(
    ("path", "link"),
    [
        ("evidence/a b/can0.log", "./evidence/a%20b/can0.log"),
        ("evidence\\can0.log", "./evidence/can0.log"),
        ("javascript:alert(1)", "./javascript%3Aalert%281%29"),
        ("a?b#c", "./a%3Fb%23c"),
        ("../secret", ""),
        ("/etc/passwd", ""),
        ("C:\\x", ""),
        ("", ""),
    ],
)
def test_links_lead_to_files_next_to_the_report_only(path, link):
    """An evidence link is a relative path, never a scheme or a way out."""
    assert file_link(path) == link


def test_list_names_the_stop_where_no_fault_was_injected():
    """Fault and reaction of a stop are the instruction and the states of the axis; a fault comes first."""
    case = CaseResult("tests/test_x.py::test_stop", "test_stop", Verdict.PASSED)
    case.story = [
        Step(0.1, "do", "MC_Power Enable = TRUE, StartMode 1"),
        Step(0.2, "observe", "axis1: DISABLED -> STANDSTILL"),
        Step(0.3, "do", "MC_Power Enable = FALSE, StopMode 2"),
        Step(0.3, "observe", "axis1: STANDSTILL -> DISABLING_RAMP"),
        Step(0.35, "observe", "drive1: Operation enabled -> Switched on"),
        Step(0.4, "observe", "axis1: DISABLING_RAMP -> DISABLED"),
        Step(0.5, "do", "MC_Reset"),
        Step(0.6, "observe", "axis1: DISABLED -> ENABLING"),
    ]
    entry = index_entry(case)
    assert (entry["fl"], entry["al"]) == (["MC_Power StopMode 2"], ["disabling ramp, disabled"])
    assert "t" not in entry, "a title that repeats the identifier says nothing"
    case.faults = [FaultRecord("can.drop", "can0", 0.0, 1.0, None)]
    case.alarms = [AlarmRecord(1.1, "axis1", 431, 4, "")]
    assert index_entry(case)["fl"] == ["can.drop → can0"]
    assert index_entry(case)["al"] == ["431 remove enable"]


def test_modbus_rows_have_a_unit_and_codes_are_hexadecimal():
    """A CAN frame is named by its identifier, a Modbus frame by its unit; codes look as in the manuals."""
    case = CaseResult("c", "", Verdict.PASSED)
    case.messages = [
        Message(0.1, "can0", 0x181, "00", "drive1", "TPDO1"),
        Message(0.2, "can0", 0x18FF1234, "00", "drive1", "J1939"),
        Message(0.3, "tcp", 7, "00", "controller", "read", protocol="modbus_tcp"),
    ]
    case.faults = [FaultRecord("drive.fault", "drive1", 0, 0.1, None, {"code": 0x2310, "count": 3})]
    plain = case_payload(case, points=500)
    assert [row[2] for row in plain["messages"]] == ["181h", "18FF1234h", "unit 7"]
    assert plain["faults"][0][7] == [["code", "2310h"], ["count", "3"]]


def test_whole_log_of_a_case_that_is_not_green_is_there_on_demand():
    """Beyond the rows that are shown a failed case carries all, a passed one does not."""
    case = CaseResult("c", "", Verdict.FAILED, messages=messages(1000))
    assert [len(case_payload(case, points=500)[name]) for name in ("messages", "log")] == [400, 1000]
    case.verdict = Verdict.PASSED
    assert [len(case_payload(case, points=500)[name]) for name in ("messages", "log")] == [200, 0]


def test_search_finds_what_a_person_would_type():
    """Identifier, headline, alarm, fault, target, requirement, tag and token are searchable."""
    case = CaseResult(
        "stop/a", "Title", Verdict.FAILED, "broke", tags=["slow"], requirements=["STP-001"], token="h1.x"
    )
    case.faults = [FaultRecord("can.drop", "can0:0x181", 0.0, 1.0, None, axis_state="MOTION")]
    case.alarms = [AlarmRecord(1.1, "axis1", 431, 4, "Communication lost")]
    entry = index_entry(case)
    for word in (
        "stop/a",
        "title",
        "broke",
        "slow",
        "stp-001",
        "h1.x",
        "can.drop can0:0x181",
        "431 communication lost",
    ):
        assert word in " ".join([entry["id"], entry["t"], entry["h"], entry["q"]]).lower()
    assert entry["f"] == [["can.drop", "remove enable", "MOTION"]]
