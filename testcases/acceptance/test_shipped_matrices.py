"""The matrices that ship with the product: every n-th of their cases passes here, all of them with `hil
run`.
"""

from __future__ import annotations

import re
from functools import cache
from pathlib import Path

import pytest

from hil.bench import load_bench
from hil.campaign import CaseSettings, case_seed, execute_case, requirements_here
from hil.campaign._shipped import SHIPPED
from hil.matrix import load_matrix
from reports.model import Verdict

FOLDER = Path(__file__).parents[1] / "campaigns"
PROFILE = {"reference": "cia402", "fast": "cia402", "synchronous": "cia402"}
STEP = {"stops_of_jobs": 29, "stops_on_stops": 31}
"""A prime number against every size of a factor would be best; these keep the sample small and mixed."""


@cache
def matrix(name):
    return load_matrix(FOLDER / f"{name}.toml")


def sample():
    """Yield every n-th case of the matrices; all but the first of each are exhaustive."""
    for path in sorted(FOLDER.glob("*.toml")):
        for number, case in enumerate(matrix(path.stem).cases[3 :: STEP.get(path.stem, 83)]):
            profile = PROFILE.get(case.bench, "profidrive")
            marks = [pytest.mark.requirement(*requirements_here(case.requirements, [profile]))]
            if number:
                marks.append(pytest.mark.exhaustive)
            yield pytest.param(case, id=case.identifier, marks=marks)


@cache
def bench_file(name):
    return load_bench(name)


@pytest.mark.parametrize("case", list(sample()))
def test_case_passes(case):
    """Expectations that follow from the words of a combination hold, and all always-on checkers."""
    settings = CaseSettings(seed=case_seed(0, case.identifier))
    result = execute_case(case, bench_file(case.bench), settings).result

    assert result.verdict is Verdict.PASSED, result.message


def test_the_matrices_have_at_least_a_thousand_cases():
    """And no two of them, of all matrices together, have the same name."""
    names = [case.identifier for path in FOLDER.glob("*.toml") for case in matrix(path.stem).cases]

    assert len(names) == len(set(names)) >= 1000


def test_every_campaign_of_the_folder_has_a_short_name():
    """`hil run NAME` finds every matrix and every module that has a campaign of its own."""
    modules = [
        path.stem
        for path in FOLDER.glob("[!_]*.py")
        if re.search(r"^CAMPAIGN\b.* = Campaign\(", path.read_text(encoding="utf-8"), re.MULTILINE)
    ]
    names = {campaign.name for campaign in SHIPPED}
    assert {*modules, *(path.stem for path in FOLDER.glob("*.toml"))} <= names
