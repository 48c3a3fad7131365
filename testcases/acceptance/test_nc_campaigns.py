"""The campaigns that ship with the product on axes of an NC: they pass, with the codes of the NC; what has no
meaning there says why.

A case of every sort and of every requirement runs; with HYPOTHESIS_PROFILE=nightly all of them.
"""

import os

import pytest

from fieldbus.errors import ConfigurationError
from hil.campaign import Campaign, CaseSettings, execute_case, load_bench_file
from hil.mutants import find_judges
from reports.model import Verdict
from testcases.campaigns import (
    bus_log,
    drive_faults,
    fault_reactions,
    gearing,
    homing,
    limits,
    monitoring,
    nc_axes,
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


def test_cases_pass_on_configurations_of_an_nc_axis():
    """Cases without numbers of their bench pass on machines with gears, other units and turned directions."""
    judges = find_judges(["testcases.campaigns.stop_modes@nc-pairwise"])
    assert len(judges) >= 16
    assert all(judge.bench.startswith("nc-axes:configuration:") for judge in judges)
    for judge in judges[:: 1 if WHOLE else 5]:
        case = stop_modes.CAMPAIGN[judge.identifier]
        result = execute_case(case, load_bench_file(judge.bench), CaseSettings(seed=1)).result
        assert result.verdict is Verdict.PASSED, f"{judge.name}: {result.message}"


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


@pytest.mark.parametrize(
    ("name", "bench", "verdict"),
    [
        ("fault-reactions/drive-fault/2310/standstill", "analog", Verdict.PASSED),
        ("fault-reactions/encoder-fault/standstill", "analog", Verdict.PASSED),
        ("fault-reactions/setpoints-lost/constant", "profidrive", Verdict.PASSED),
        ("telegram-faults/sign-of-life/constant", "profidrive_rtu", Verdict.PASSED),
        ("telegram-faults/sign-of-life/standstill", "stepper", Verdict.BLOCKED),
        ("monitoring/jam/50", "stepper", Verdict.BLOCKED),
        ("monitoring/reversed/standstill", "profidrive", Verdict.PASSED),
        ("monitoring/frozen/60", "profidrive_rtu", Verdict.PASSED),
    ],
)
def test_other_drives_have_codes_of_their_own(name, bench, verdict):
    """On drives that trip by themselves, report nothing, or answer late, the code is that of the bench."""
    module = next(one for one in CAMPAIGNS if name in one.CAMPAIGN)
    case = module.CAMPAIGN[f"{name}@nc"]
    result = execute_case(case, load_bench_file(f"nc-axes:{bench}"), CaseSettings(seed=1)).result
    assert result.verdict is verdict, result.message


def test_cases_of_an_nc_and_of_a_plain_master():
    """A case written for an NC axis runs as it is there and is blocked for a technology object; one that a
    plain master leads runs once.
    """
    at_home, elsewhere = (
        nc_axes.CAMPAIGN.on_controller(nc_axes.CAMPAIGN["nc-axes/additive"], make) for make in ("nc", "s7")
    )
    assert at_home.refusal == ""
    assert at_home.identifier == "nc-axes/additive@nc"
    result = execute_case(at_home, load_bench_file(f"nc-axes:{at_home.bench}"), CaseSettings()).result
    assert (result.verdict, result.controller) == (Verdict.PASSED, "nc")
    assert "the case is written for an axis of an NC" in elsewhere.refusal
    led = bus_log.CAMPAIGN.cases[0]
    assert bus_log.CAMPAIGN.on_controller(led, "s7").refusal == ""
    assert "led by a plain master" in bus_log.CAMPAIGN.on_controller(led, "nc").refusal
    only_s7 = gearing.CAMPAIGN.cases[0]
    assert "are about a technology object" in gearing.CAMPAIGN.on_controller(only_s7, "nc").refusal
    with pytest.raises(ConfigurationError, match=r"campaign controller.*'plc'.*s7, nc"):
        Campaign("mine", controller="plc")
