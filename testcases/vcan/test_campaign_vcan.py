"""The shipped campaigns in real time over SocketCAN, controller and drives in processes of their own.

The same cases run in virtual time elsewhere; here they meet a real bus, a real clock and a machine that is
sometimes late. A case that fails while the machine was later than the bench file allows is repeated, and then
*blocked*: it says nothing about what was tested. So there may be a few of those, but no failed one.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path
from xml.etree import ElementTree as ET

import pytest

from hil.bench import load_bench
from reports.model import CaseResult, Verdict
from reports.store import load_run
from testcases.campaigns.support import PHASES
from testcases.stop_sample import sampled_stops

pytestmark = pytest.mark.vcan

PATIENCE_S = 800.0
"""How long a whole campaign may take; it decides nothing but how long a hanging one is waited for."""

FAULT_CASES = {
    "drive fault": "drive-fault/2310/constant",
    "actual values lost": "actual-values-lost/constant",
    "frames corrupted": "corrupted-frames",
    "supply lost": "node-off/constant",
    "heartbeat of the controller lost": "controller-heartbeat-lost/standstill",
    "limit switch": "limit-switch/constant",
    "encoder jump": "encoder-jump/131072",
}
"""One case of each way that a fault takes to a live bench: drive, cable, supply, controller, switch and
encoder."""
IMPOSSIBLE = "fault-reactions/corrupted-frames"
"""Bit errors cannot be made through an adapter."""

SELECTION = """
from hil.campaign import Campaign
from testcases.campaigns import {campaign}

CAMPAIGN = Campaign("selection of {campaign}")
for name in {names!r}:
    CAMPAIGN.add({campaign}.CAMPAIGN[name])
"""


def bench_on(channel: str, file: Path) -> str:
    """Return the name of the live bench, or that of a copy which uses another interface."""
    if channel == "vcan0":
        return "live"
    text = load_bench("live").text
    assert text.count('channel = "vcan0"') == 1
    file.write_text(text.replace('channel = "vcan0"', f'channel = "{channel}"'), encoding="utf-8")
    return str(file)


def run_campaign(campaign: str, report: Path, channel: str) -> tuple[dict[str, object], list[CaseResult]]:
    """Run `hil run` on the live bench; returns what it says on standard output, and the stored results."""
    command = ["run", campaign, "--bench", bench_on(channel, report.with_suffix(".toml"))]
    done = subprocess.run(
        [sys.executable, "-m", "hil.cli", *command, "--json", "--report", str(report)],
        check=False,
        stdin=subprocess.DEVNULL,
        capture_output=True,
        text=True,
        timeout=PATIENCE_S,
        env={**os.environ, "COLUMNS": "200"},
    )
    print(done.stderr)  # pytest shows it when the test fails
    assert done.returncode == 0, f"exit code {done.returncode}"
    summary = json.loads(done.stdout)
    cases = load_run(report).cases
    assert Path(summary["report"]) == report / "report.html"
    assert len(cases) == sum(summary[key] for key in ("passed", "failed", "blocked", "errors"))
    for case in cases:
        assert case.title in (report / "report.html").read_text(encoding="utf-8")
    suite = ET.parse(summary["junit"]).getroot()
    assert len(list(suite.iter("testcase"))) == len(cases)
    return summary, cases


def test_stop_modes_on_a_live_bench(vcan_channel, tmp_path):
    """Ramps of the controller and of the drive hold on the live bench in every phase of motion; only lateness
    may block one.
    """
    chosen = sampled_stops(every_stop=False)
    assert {phase for _, phase in chosen} == set(PHASES)
    file = tmp_path / "selection.py"
    names = tuple(f"stop-modes/{stop}/{phase}" for stop, phase in chosen)
    file.write_text(SELECTION.format(campaign="stop_modes", names=names), encoding="utf-8")
    summary, cases = run_campaign(str(file), tmp_path / "stop-modes", vcan_channel)
    assert sorted(case.identifier for case in cases) == sorted(names)
    assert (summary["failed"], summary["errors"]) == (0, 0)
    assert summary["passed"] >= len(cases) - 1
    for case in cases:
        assert case.verdict is Verdict.PASSED or " s late, more than the bench allows" in case.message


def test_fault_reactions_on_a_live_bench(vcan_channel, tmp_path):
    """One case of each way of a fault holds on the live bench; what cannot be injected there is blocked
    with a reason.
    """
    file = tmp_path / "selection.py"
    names = tuple(f"fault-reactions/{name}" for name in FAULT_CASES.values())
    file.write_text(SELECTION.format(campaign="fault_reactions", names=names), encoding="utf-8")
    summary, cases = run_campaign(str(file), tmp_path / "faults", vcan_channel)
    verdicts = {case.identifier: case for case in cases}
    assert list(verdicts) == list(names)
    assert (summary["failed"], summary["errors"]) == (0, 0)
    refused = verdicts.pop(IMPOSSIBLE)
    assert refused.verdict is Verdict.BLOCKED
    assert refused.message.startswith("frame.corrupt cannot be injected on a live bench: ")
    late = [case for case in verdicts.values() if case.verdict is not Verdict.PASSED]
    assert all(" s late, more than the bench allows" in case.message for case in late)
    assert len(late) <= 1
