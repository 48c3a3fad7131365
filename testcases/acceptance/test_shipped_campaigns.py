"""The campaigns that ship with the product pass on the embedded bench; each case is a test with its requirements."""

from __future__ import annotations

import pytest

from hil.bench import load_bench
from hil.campaign import CaseSettings, execute_case
from reports.model import Verdict
from testcases.campaigns import drive_faults, fault_reactions, stop_modes

CASES = [
    pytest.param(case, id=case.identifier, marks=pytest.mark.requirement(*case.requirements))
    for campaign in (stop_modes.CAMPAIGN, fault_reactions.CAMPAIGN, drive_faults.CAMPAIGN)
    for case in campaign.cases
]


@pytest.fixture(scope="module")
def bench_file():
    return load_bench("reference")


@pytest.mark.parametrize("case", CASES)
def test_case_passes(case, bench_file):
    """Every shipped case passes: stop, alarm, reaction, standstill and all always-on checkers."""
    result = execute_case(case, bench_file, CaseSettings(seed=1)).result

    assert result.verdict is Verdict.PASSED, result.message


def test_the_campaign_crosses_all_stops_with_all_phases():
    """Four StopModes, three MC_Stop modes, four reactions and MC_Halt are crossed with four phases of motion."""
    assert {case.identifier for case in stop_modes.CAMPAIGN.cases} == {
        f"stop-modes/{stop}/{phase}"
        for stop in (
            "power-0", "power-1", "power-2", "power-3", "stop-0", "stop-2", "stop-3",
            "reaction-1", "reaction-2", "reaction-3", "reaction-4", "halt",
        )
        for phase in ("constant", "accelerating", "decelerating", "standstill")
    }  # fmt: skip
