"""Programs of a search on other machines, with one to three axes; programs as the judges of defects."""

from __future__ import annotations

from pathlib import Path

import pytest

from fieldbus.errors import ConfigurationError
from hil.bench import load_bench
from hil.campaign import CaseSettings, execute_case, find_campaigns, load_bench_file
from hil.configurations import Configuration
from hil.fuzz import Program, search
from hil.fuzz._machines import machine_names
from hil.fuzz.judging import write_programs
from reports.model import Verdict

NAMES = machine_names(4)
BENCHES = ("reference", "nc-axes:profidrive")
ON_MACHINE = [{"configuration": {"other machine": {"name": NAMES[0]}}}, {"do": "power_on"}, {"wait": 0.3}]


def test_a_program_says_its_machine_and_comes_back_from_json() -> None:
    """The machine is a part of the configuration, and takes the place of the bench file."""
    program = Program.from_json(ON_MACHINE)
    assert Program.from_json(program.to_json()) == program
    assert program.configuration.applied_to(load_bench("reference")).name == f"configuration {NAMES[0]}"
    for wrong in ("no machine", 7):
        with pytest.raises(ConfigurationError, match="configuration"):
            Program.from_json([{"configuration": {"other machine": {"name": wrong}}}, {"wait": 0.1}])


def test_a_seed_has_its_machines() -> None:
    """The same seed gives the same machines, another one others; among them are some with several axes."""
    assert machine_names(4) == NAMES
    assert len(set(NAMES)) == 12
    assert set(machine_names(5)).isdisjoint(NAMES)
    axes = {len(Configuration.of(name).bench_file().config.axis) for name in NAMES}
    assert axes == {1, 2, 3}


@pytest.mark.exhaustive
def test_a_search_gives_instructions_to_the_axes_of_machines() -> None:
    """Half of the programs run on a machine, with instructions for each of its axes; no rule is broken."""
    kept: list[Program] = []
    found = search(load_bench("reference"), cases=10, seed=6, machines=NAMES[:3], on_new=kept.append)
    assert getattr(found.failure, "violation", None) is None
    on_machines = [program for program in kept if "other machine" in program.configuration.parts]
    assert 2 <= len(on_machines) < len(kept)
    assert any(len({getattr(step, "axis", "") for step in one.steps} - {""}) > 1 for one in on_machines)


@pytest.mark.exhaustive
def test_programs_are_written_as_a_campaign(tmp_path: Path) -> None:
    """The same number and seed give the same files; each is a case on its bench, half of them on machines."""
    file = write_programs(tmp_path / "a", 8, 2, BENCHES)
    other = write_programs(tmp_path / "b", 8, 2, BENCHES)
    names = sorted(one.name for one in file.parent.iterdir())
    assert names == sorted(one.name for one in other.parent.iterdir())
    assert all((file.parent / name).read_bytes() == (other.parent / name).read_bytes() for name in names)
    (campaign,) = find_campaigns([str(file)])
    cases = list(campaign.campaign.cases)
    assert [case.bench.startswith("configuration:") for case in cases] == [True] * 4 + [False] * 4
    result = execute_case(cases[0], load_bench_file(cases[0].bench), CaseSettings(seed=2)).result
    assert result.verdict is Verdict.PASSED, result.message
    write_programs(tmp_path / "a", 3, 2, BENCHES)
    assert len(list((tmp_path / "a").glob("*.json"))) == 3
