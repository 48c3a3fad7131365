"""JUnit XML of a run, in the dialect that pytest writes and that CI servers and requirement tools read."""

from __future__ import annotations

import re
import xml.etree.ElementTree as ET
from pathlib import Path

from reports.model import CaseResult, Check, RunResult, Verdict
from reports.summary import run_digest
from reports.text import (
    check_sentence,
    expected_text,
    headline,
    limits,
    number,
    observed_text,
    quantity,
    replay_command,
)

# What XML 1.0 cannot hold in any form: most control characters, lone surrogates, two non-characters.
_ILLEGAL = re.compile("[^\t\n\r\x20-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")


def xml_text(text: str) -> str:
    """Return text that XML can hold: illegal characters become their escape (x07
    after a backslash for a bell).
    """
    return _ILLEGAL.sub(lambda match: ascii(match.group())[1:-1], text)


def junit_tree(run: RunResult) -> ET.Element:
    """Return the `testsuites` element: one suite per group, in order of appearance."""
    groups: dict[str, list[CaseResult]] = {}
    for case in run.cases:
        groups.setdefault(case.group or "cases", []).append(case)
    root = ET.Element("testsuites", {"name": xml_text(run.title), **_counts(run.cases)})
    for group, cases in groups.items():
        suite = ET.SubElement(root, "testsuite", {"name": xml_text(group), **_counts(cases)})
        if run.started:
            suite.set("timestamp", xml_text(run.started))
        properties = ET.SubElement(suite, "properties")
        _property(properties, "seed", str(run.seed))
        _property(properties, "bench", run.bench_name)
        _property(properties, "trace_digest", run_digest(run))
        for name, value in run.environment.items():
            _property(properties, f"environment.{name}", value)
        for case in cases:
            suite.append(_testcase(group, case))
    return root


def write_junit(run: RunResult, path: str | Path) -> Path:
    """Write the JUnit XML file and return its path."""
    target = Path(path)
    target.parent.mkdir(parents=True, exist_ok=True)
    root = junit_tree(run)
    ET.indent(root, " ")
    ET.ElementTree(root).write(target, encoding="utf-8", xml_declaration=True)
    return target


def _counts(cases: list[CaseResult]) -> dict[str, str]:
    def of(verdict: Verdict) -> str:
        return str(sum(case.verdict is verdict for case in cases))

    return {
        "tests": str(len(cases)),
        "failures": of(Verdict.FAILED),
        "errors": of(Verdict.ERROR),
        "skipped": of(Verdict.BLOCKED),
        "time": _seconds(sum(case.wall_s for case in cases)),
    }


def _testcase(group: str, case: CaseResult) -> ET.Element:
    element = ET.Element(
        "testcase",
        {"classname": xml_text(group), "name": xml_text(case.identifier), "time": _seconds(case.wall_s)},
    )
    properties = ET.SubElement(element, "properties")
    _property(properties, "title", case.title)
    _property(properties, "seed", str(case.seed))
    _property(properties, "token", case.token)
    _property(properties, "trace_digest", case.trace_digest)
    _property(properties, "simulated_s", number(case.simulated_s))
    for tag in case.tags:
        _property(properties, "tag", tag)
    named = [*case.requirements, *(identifier for check in case.checks for identifier in check.requirements)]
    for identifier in dict.fromkeys(named):
        _property(properties, "requirement", identifier)
    for check in case.checks:
        if check.value is not None:
            _property(properties, f"measured.{check.name}", _measured(check))
    if case.verdict is not Verdict.PASSED:
        tag = {Verdict.FAILED: "failure", Verdict.BLOCKED: "skipped", Verdict.ERROR: "error"}[case.verdict]
        reason = ET.SubElement(
            element, tag, {"message": xml_text(headline(case)), "type": case.verdict.value}
        )
        reason.text = xml_text(_explanation(case))
    if case.story:
        lines = [f"{step.time_s:12.6f} s  {step.kind:8}{step.text}" for step in case.story]
        ET.SubElement(element, "system-out").text = xml_text("\n".join(lines))
    return element


def _explanation(case: CaseResult) -> str:
    bad = [check for check in case.checks if check.verdict is not Verdict.PASSED]
    # The message of a case with checks is their sentences once more, unless it continues over several lines.
    lines = [case.message] if case.message and (not bad or "\n" in case.message) else []
    for check in sorted(bad, key=lambda check: check.rule):
        when = "" if check.time_s is None else f" (at {check.time_s:.6f} s)"
        lines += [
            f"{check.verdict.value}: {check_sentence(check)}{when}",
            f"  expected: {expected_text(check)}",
            f"  observed: {observed_text(check)}",
        ]
    if case.traceback:
        lines.append(case.traceback)
    if case.token:
        lines.append(f"repeat with: {replay_command(case.token)}")
    return "\n".join(lines)


def _measured(check: Check) -> str:
    value = "" if check.value is None else quantity(check.value, check.unit)
    allowed = limits(check)
    return (
        f"{value} (limits {allowed}, {check.verdict.value})"
        if allowed
        else f"{value} ({check.verdict.value})"
    )


def _property(parent: ET.Element, name: str, value: str) -> None:
    ET.SubElement(parent, "property", {"name": xml_text(name), "value": xml_text(value)})


def _seconds(value: float) -> str:
    return f"{value:.6f}" if value == value and abs(value) != float("inf") else "0"  # noqa: PLR0124 (NaN test)
