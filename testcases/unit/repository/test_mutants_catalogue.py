"""The catalogue of defects fits the product as it is: every change can be made, every place is reached by a
case, the page is true.
"""

from __future__ import annotations

import re
from collections import Counter
from pathlib import Path

import pytest

from hil._requirements import requirements
from hil.campaign import CaseSettings, case_seed, execute_case, load_bench_file, load_campaign
from hil.mutants import AREAS, CATALOGUE, catalogue_table, find_judges, hinted, seeded, watched
from reports.model import Verdict

PAGE = (Path(__file__).parents[3] / "docs" / "reference" / "mutants.md").read_text(encoding="utf-8")
LEAST = {"cia402": 15, "profidrive": 15, "axis": 20, "nc": 15, "machine": 8, "bus": 5}


@pytest.fixture(scope="module")
def judges():
    """All cases that ship with the product, on their benches."""
    return find_judges()


@pytest.mark.exhaustive
def test_every_change_can_be_made(subtests):
    """The old text of every change stands in its function exactly once, and what comes of it compiles."""
    for mutant in CATALOGUE.values():
        with subtests.test(mutant.name), seeded(mutant, set()):
            pass


@pytest.mark.exhaustive
def test_the_places_are_reached_by_the_cases_named_as_likely(judges):
    """No defect that never runs: in the unmutated product one of its likely cases comes to the changed
    statement.
    """
    missing = dict(CATALOGUE)
    reached: set[str] = set()
    with watched(CATALOGUE.values(), reached):
        for mutant in CATALOGUE.values():
            for judge in hinted(mutant, judges)[:4]:
                if mutant.name not in missing:
                    break
                case = load_campaign(judge.campaign)[judge.identifier]
                settings = CaseSettings(seed=case_seed(0, judge.identifier))
                result = execute_case(case, load_bench_file(judge.bench), settings).result
                assert result.verdict is Verdict.PASSED, (judge.name, result.message)
                for name in reached:
                    missing.pop(name, None)
    assert sorted(missing) == []


@pytest.mark.exhaustive
def test_likely_cases_exist(judges):
    """Every pattern of likely cases fits a case."""
    wrong = [
        (mutant.name, pattern)
        for mutant in CATALOGUE.values()
        for pattern in mutant.likely
        if not any(judge.fits(pattern) for judge in judges)
    ]
    assert wrong == []
    assert [mutant.name for mutant in CATALOGUE.values() if not mutant.likely] == []


def test_requirements_exist():
    """Every defect names requirements of the specification."""
    known = {one.identifier for one in requirements()}
    wrong = {
        name: [one for one in mutant.requirements if one not in known] for name, mutant in CATALOGUE.items()
    }
    assert {name: one for name, one in wrong.items() if one} == {}
    assert [name for name, mutant in CATALOGUE.items() if not mutant.requirements] == []


def test_every_area_has_its_share():
    """The defects are spread over drive, telegram, axis, machine and bus."""
    count = Counter(mutant.area for mutant in CATALOGUE.values())
    assert {area: count[area] for area in AREAS if count[area] < LEAST[area]} == {}


def test_the_page_lists_the_defects(subtests):
    """docs/reference/mutants.md has the table of every area as the catalogue has it; `hil mutants --list
    --json` has the data.
    """
    for area in AREAS:
        with subtests.test(area=area):
            table = "\n".join(catalogue_table(CATALOGUE.values(), area))
            assert table in PAGE, f"the table of {area} should be:\n{table}"


def test_the_page_lists_what_is_not_caught():
    """Every defect with an explanation stands on the page with it."""
    for name, mutant in CATALOGUE.items():
        if mutant.explained:
            assert f"`{name}`: {mutant.explained}" in PAGE


def test_the_example_of_the_page_can_be_made():
    """The defect of one's own that the page shows fits the product."""
    (example,) = re.findall(r"```python\n(.*?)```", PAGE, flags=re.DOTALL)
    names = {}
    exec(example, names)
    (mutant,) = names["MUTANTS"]
    with seeded(mutant, set()):
        pass
