"""The campaigns that ship with the product on axes of an NC: they pass, with the codes of the NC; what has no
meaning there says why.

A case of every sort and of every requirement runs; with HYPOTHESIS_PROFILE=nightly all of them.
"""

import os

import pytest

from hil.campaign import CaseSettings, execute_case, load_bench_file
from reports.model import Verdict
from testcases.campaigns import (
    drive_faults,
    fault_reactions,
    homing,
    limits,
    monitoring,
    stop_modes,
    telegram_faults,
)

pytestmark = pytest.mark.exhaustive

WHOLE = os.environ.get("HYPOTHESIS_PROFILE") == "nightly"
CAMPAIGNS = (stop_modes, fault_reactions, drive_faults, telegram_faults, limits, homing, monitoring)

COVERED = set()
"""Functions and requirements of the cases so far."""


def on_nc(module):
    """Return the cases of a campaign as they are on an NC axis."""
    campaign = module.CAMPAIGN
    return [campaign.on_controller(case, "nc") for case in campaign.cases]


def sample(module):
    """Return a case of every function, and one for every requirement that no case so far has."""
    chosen = []
    for case in on_nc(module):
        facts = {case.function.__name__, *case.requirements}
        if not case.refusal and (WHOLE or facts - COVERED):
            COVERED.update(facts)
            chosen.append(case)
    return chosen


@pytest.mark.parametrize(
    "case",
    [
        pytest.param(case, id=case.identifier, marks=pytest.mark.requirement(*case.requirements))
        for module in CAMPAIGNS
        for case in sample(module)
    ],
)
def test_case_passes_on_an_nc_axis(case):
    """Every case passes on the bench of the case with NC axes: code, stop, and what it takes to go on."""
    result = execute_case(case, load_bench_file(f"nc-axes:{case.bench}"), CaseSettings(seed=1)).result
    if "controlled by no PROFIdrive telegram" in result.message:
        return  # as the case for technology objects on the same bench
    assert result.verdict is Verdict.PASSED, result.message
    assert result.controller == "nc"


def test_every_case_is_there_or_says_why_not():
    """No case is left out without a word: it runs on an NC axis, or is blocked with its reason."""
    for module in CAMPAIGNS:
        cases = on_nc(module)
        refused = [case for case in cases if case.refusal]
        assert not [case.identifier for case in refused if "no case is written" in case.refusal]
        assert len(refused) < len(cases)
        if refused:
            result = execute_case(refused[0], load_bench_file("nc-axes:reference"), CaseSettings()).result
            assert result.verdict is Verdict.BLOCKED
            assert result.message.startswith("not applicable to an axis of an NC: ")


@pytest.mark.parametrize(
    "name",
    [
        "fault-reactions/drive-fault/3210/constant",
        "fault-reactions/overload",
        "fault-reactions/two-actual-values-lost",
        "drive-faults/trip/dc-link-missing/standstill",
        "telegram-faults/lie/operation/constant",
        "limits/braking/positive/constant",
    ],
)
def test_both_makes_get_the_same_fault(name):
    """A case and its counterpart inject the same fault, with the same parameters, into the same target."""
    module = next(one for one in CAMPAIGNS if name in one.CAMPAIGN)
    found = []
    for case in (module.CAMPAIGN[name], module.CAMPAIGN[f"{name}@nc"]):
        prefix = "nc-axes:" if case.controller else ""
        result = execute_case(case, load_bench_file(f"{prefix}{case.bench}"), CaseSettings(seed=1)).result
        assert result.verdict is Verdict.PASSED, result.message
        found.append([(one.kind, one.target, one.parameters) for one in result.faults])
    assert found[0] == found[1]
