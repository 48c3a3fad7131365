"""Searches over configurations: what is laid over the bench file, what it means to a program, how a finding
is reported and kept.
"""

import json

import numpy as np
import pytest
from hypothesis import given, seed, settings

from fieldbus.errors import ConfigurationError
from hil.bench import EMBEDDED, load_bench, merged
from hil.campaign import CaseSettings, Token, execute_case, load_bench_file
from hil.cli import main
from hil.errors import CannotRunError
from hil.fuzz import (
    Configuration,
    Do,
    Invariant,
    Program,
    Wait,
    configurations,
    keep_program,
    regressions,
    run_program,
    search,
)
from hil.fuzz._provider import BACKEND
from reports.model import Verdict
from testcases.unit.hil.toybench import BENCH as TOY

pytestmark = pytest.mark.exhaustive

REFERENCE = load_bench("reference")
ON = (Do("power_on"), Wait(0.3))


# -- bench files
# ----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", EMBEDDED)
def test_a_bench_file_is_written_again_as_the_same_bench(name):
    """Nothing laid over it: the same content."""
    file = load_bench(name)
    assert file.configured({}).config == file.config


def test_tables_are_merged_and_the_rest_is_replaced():
    """Keys of the same table as a changed one stay; a value takes the place of a table and the other way
    round.
    """
    base = {"a": {"b": 1, "c": [1, 2]}, "d": 2}
    assert merged(base, {"a": {"c": [3]}, "e": {}}) == {"a": {"b": 1, "c": [3]}, "d": 2, "e": {}}
    assert merged(base, {"d": {"f": 1}, "a": 5}) == {"a": 5, "d": {"f": 1}}


# -- what a configuration means
# -------------------------------------------------------------------------------------


@pytest.mark.parametrize("codes", [(1010, 1061), (1019, 1066), (1013, 1524)])
def test_axis_and_program_have_the_same_units(codes):
    """The numbers of a program are mm whatever the axis counts in: the machine does the same."""
    steps = (*ON, Do("home"), Do("move_absolute", {"position": 60.0, "velocity": 200.0}), Wait(1.0))
    units = dict(zip(("length", "velocity"), codes, strict=True))
    usual, other = (
        run_program(Program(steps, configuration), REFERENCE).trace
        for configuration in (Configuration(), Configuration({"units": units}))
    )
    for name, nearly in (("drive1.position", 2e-6), ("drive1.velocity", 2e-3)):
        assert np.abs(other[name].values - usual[name].values).max() < nearly
    assert usual["drive1.position"].values[-1] == pytest.approx(0.06, abs=1e-4)


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (3, "an object with parts by name"),
        ({"cycle": 3}, "configuration.cycle"),
        ({"units": {"length": 1010}}, "codes of length and velocity"),
        ({"units": {"length": 1, "velocity": 1061}}, "codes of two units"),
        ({"cycle": {"bench": {"cycle_ms": 0}}}, "bench.cycle_ms"),
    ],
)
def test_a_wrong_configuration_is_named(content, words):
    """The message says which part of it is wrong, and what is allowed."""
    with pytest.raises(ConfigurationError, match=words):
        Program.from_json([{"configuration": content}, {"wait": 0.1}]).configuration.applied_to(REFERENCE)


@pytest.mark.parametrize("name", EMBEDDED)
def test_configurations_are_drawn_that_a_bench_file_takes(name):
    """Every part of every bench is valid by itself, reads back from JSON, and prints a line per value."""
    file = load_bench(name)
    seen = set()

    @seed(1)
    @settings(max_examples=40, database=None, backend=BACKEND)
    @given(configurations(file.config))
    def draw(configuration):
        assert Configuration.from_json(json.loads(json.dumps(configuration.to_json()))) == configuration
        assert len(list(configuration.lines())) >= len(configuration.parts)
        for part, content in configuration.parts.items():
            seen.add(part)
            Configuration({part: content}).applied_to(file)

    draw()
    assert len(seen) >= 8


def test_a_bench_without_a_file_has_no_configurations():
    """A Python object says so, in a search and with a single program."""
    with pytest.raises(CannotRunError, match="'toy bench' comes from no bench file"):
        search(TOY, cases=1, configurations=True)
    with pytest.raises(CannotRunError, match="'toy bench' comes from no bench file"):
        run_program(Program(ON, Configuration({"cycle": {"bench": {"cycle_ms": 2}}})), TOY)


# -- findings
# -------------------------------------------------------------------------------------------------------


@pytest.mark.requirement("STP-015", "STP-030")
def test_a_bench_whose_axis_does_not_come_up_is_a_finding():
    """An axis that is enabled and nothing else has to come into operation; a fault excuses it."""
    slow = Configuration({"power on": {"drive": {"drive1": {"power_on_delay_ms": 2000.0}}}})
    violation = run_program(Program(ON, slow), REFERENCE).violation
    assert violation.invariant == "axis1 comes up"
    assert "not enabled 0.30" in violation.text
    assert run_program(Program(ON), REFERENCE).violation is None
    excused = Program.from_json([{"fault": {"kind": "drive.sto"}}, *Program(ON).to_json()])
    assert run_program(excused, REFERENCE).violation is None


class OneUnit(Invariant):
    """A planted defect."""

    name = "one unit"

    def __init__(self, bench):
        self._axis = bench.axis()

    def cycle(self):
        return "" if self._axis.var("Units.VelocityUnit") == 1062 else "another one"


def one_unit(bench):
    return [OneUnit(bench)]


def test_a_finding_keeps_the_part_that_matters_and_becomes_a_case(tmp_path):
    """All other parts go; the token holds the configuration; the kept case brings its bench file."""
    found = search(REFERENCE, cases=30, seed=5, longest=0, configurations=True, invariants=one_unit)
    program = found.failure.program
    assert list(program.configuration.parts) == ["units"]
    assert len(program.steps) == 1
    assert found.repeatable
    assert {situation[1] for situation in found.reached if situation[0] == "configuration"} >= {"units"}
    token = Token.decode(found.token)
    assert Program.from_json(token.program) == program
    file = keep_program(token, tmp_path, "another unit")
    (case,) = regressions(tmp_path).cases
    assert case.bench == str(file.with_suffix(".toml"))
    bench = load_bench_file(case.bench)
    assert bench.config.axis["axis1"].variables["Units.VelocityUnit"] != 1062
    assert execute_case(case, bench, CaseSettings(seed=case.seed)).result.verdict is Verdict.PASSED


def test_the_command_line_searches_configurations(tmp_path, monkeypatch, capsys):
    """`hil fuzz --configurations` reaches configurations and says how many the bench file has refused."""
    monkeypatch.chdir(tmp_path)
    assert main(["fuzz", "--configurations", "--cases", "3", "--steps", "1", "--json"]) == 0
    reported = json.loads(capsys.readouterr().out)
    assert reported["reached"]["configuration"] > 0
    assert reported["refused"] == 0
