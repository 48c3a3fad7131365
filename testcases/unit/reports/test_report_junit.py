"""JUnit XML as continuous integration servers and requirement tools read it."""

from __future__ import annotations

import xml.etree.ElementTree as ET

import pytest

from reports import CaseResult, Check, RunResult, Verdict, write_junit
from reports.junit import xml_text
from testcases.catalogue import each

pytestmark = pytest.mark.exhaustive


@pytest.fixture(scope="module")
def root(run, tmp_path_factory) -> ET.Element:
    return ET.parse(write_junit(run, tmp_path_factory.mktemp("junit") / "junit.xml")).getroot()


def find(root: ET.Element, name: str) -> ET.Element:
    (found,) = [case for case in root.iter("testcase") if case.get("name") == name]
    return found


def properties(element: ET.Element, name: str) -> list[str]:
    return [item.get("value") for item in element.findall(f"properties/property[@name='{name}']")]


def test_suites_are_the_groups_and_counts_add_up(run, root):
    """One suite per group; tests, failures, errors and skipped agree with the run at both levels."""
    assert [suite.get("name") for suite in root] == ["stop-modes", "alarm-reactions", "bus-faults", "fuzz"]
    names = {"tests": len(run.cases), "failures": 4, "errors": 1, "skipped": 2}
    for name, count in names.items():
        assert int(root.get(name)) == count
        assert sum(int(suite.get(name)) for suite in root) == count
    for suite in root:
        assert len(suite.findall("testcase")) == int(suite.get("tests"))
        assert len(suite.findall("testcase/failure")) == int(suite.get("failures"))
        assert len(suite.findall("testcase/skipped")) == int(suite.get("skipped"))
        assert len(suite.findall("testcase/error")) == int(suite.get("errors"))


def test_verdicts_map_to_failure_skipped_and_error(root):
    """Failed is a failure, blocked is skipped with its reason, error is an error; passed has none of them."""
    failed = find(root, "alarm-reactions/alarm-521/encoder.freeze/motion").find("failure")
    assert failed.get("message") == "Alarm 521 expected within 20 ms, came after 48 ms"
    assert "expected: within 20 ms" in failed.text
    assert "repeat with: hil replay h1." in failed.text
    assert "cannot send error frames" in find(root, "bus-faults/can.corrupt/tpdo1/x8").find("skipped").get(
        "message"
    )
    assert find(root, "fuzz/seed-4185").find("error").get("message").startswith("SchedulerError")
    passed = find(root, "stop-modes/mc-power-0/constant")
    assert not {child.tag for child in passed} & {"failure", "skipped", "error"}


def test_properties_carry_what_repeats_and_traces_a_case(run, root):
    """Seed, token, digest, one property per requirement, and every measured value with its limits."""
    case = next(
        case for case in run.cases if case.identifier == "alarm-reactions/alarm-521/encoder.freeze/motion"
    )
    element = find(root, case.identifier)
    assert properties(element, "seed") == [str(case.seed)]
    assert properties(element, "token") == [case.token]
    assert properties(element, "trace_digest") == [case.trace_digest]
    assert properties(element, "requirement") == ["STP-343", "TA-012", "STP-361"]
    assert properties(element, "measured.alarm 521") == ["48 ms (limits ≤ 20 ms, failed)"]
    assert float(element.get("time")) == pytest.approx(case.wall_s)


def test_any_text_gives_well_formed_xml(hostile, tmp_path):
    """Control characters, lone surrogates, markup and non-characters cannot break the file and stay
    recognisable.
    """
    root = ET.parse(write_junit(hostile, tmp_path / "junit.xml")).getroot()
    assert len(list(root.iter("testcase"))) == len(hostile.cases)
    messages = [
        element.get("message") for element in root.iter() if element.tag in {"failure", "skipped", "error"}
    ]
    assert any("]]>&lt;&amp;" in message for message in messages)
    assert xml_text("a\x00b\x1b\ud800\uffff\tc\n😀") == r"a\x00b\x1b\ud800\uffff" + "\tc\n😀"


def check_every_odd_character_parses(tmp_path, code):
    run = RunResult(chr(code), 1, "b", "", {}, chr(code))
    run.cases = [
        CaseResult(
            f"a{chr(code)}b",
            "t",
            Verdict.FAILED,
            f"m{chr(code)}",
            group=chr(code),
            checks=[Check(chr(code), Verdict.FAILED, "e", "o", value=1.0)],
        )
    ]
    (case,) = ET.parse(write_junit(run, tmp_path / "j.xml")).getroot().iter("testcase")
    assert case.get("name").startswith("a")
    assert case.get("name").endswith("b")


def test_every_odd_character_parses(tmp_path, subtests):
    """Each single character that XML treats specially goes through a parser."""
    for label, values in each([*range(32), 0x7F, 0x85, 0xD800, 0xDFFF, 0xFFFE, 0xFFFF, 0x10FFFF]):
        with subtests.test(label):
            check_every_odd_character_parses(tmp_path, *values)
