"""Configurations: machines that differ in many ways, drawn so that every two differences meet."""

import itertools
import json
from functools import cache
from pathlib import Path

import pytest

from fieldbus.errors import ConfigurationError, UnknownNameError
from hil.bench import BenchFile
from hil.bench.rules import findings
from hil.campaign import load_bench_file
from hil.cli import main
from hil.configurations import (
    ANY,
    CONFIGURATION,
    FACTORS,
    Configuration,
    Needs,
    differing,
    handbook,
    name_of,
    objection,
    plan,
    read_name,
)
from reports.store import load_run

PAGE = Path(__file__).resolve().parents[3] / "docs/guides/configurations.md"


@cache
def everything():
    """Return configurations for cases that take every machine: all pairs that can meet."""
    return plan([ANY] * 60, seed=3)


@pytest.mark.exhaustive
def test_every_two_values_meet_where_nothing_speaks_against_them():
    """The rows are possible, few, and have every pair of values; pairs that are missing cannot exist: they
    are in no row of another seed either.
    """
    drawn, pairs = everything(), everything().pairs
    assert not any(objection(row) for row in drawn.rows)
    assert len(drawn.rows) < 70
    assert drawn.covered == pairs == plan([ANY], seed=4).pairs
    values = [(name, value) for name, factor in FACTORS.items() for value in factor.values]
    missing = {
        pair for pair in itertools.combinations(values, 2) if pair[0][0] != pair[1][0] and pair not in pairs
    }
    assert {value for value in values if all(value not in pair for pair in pairs)} == set()
    assert (("profile", "cia402"), ("bus", "modbus-tcp")) in missing
    assert (("motion", "rotary-modulo"), ("switches", "closing")) in missing


@pytest.mark.exhaustive
def test_a_seed_gives_the_same_configurations_again():
    """The plan depends on the seed alone."""
    again, other = plan([ANY] * 60, seed=3), plan([ANY] * 60, seed=4)
    assert again == everything()
    assert other.rows != everything().rows


@pytest.mark.exhaustive
def test_each_case_gets_what_it_needs():
    """A case runs on as many configurations as are asked for, all of which serve it; one that none serves is
    not planned; without a number, few cases run on many configurations so that all pairs are covered.
    """
    rotary, line = Needs.of({"motion": ("rotary", "rotary-modulo")}), Needs.of({"bus": "modbus-rtu"})
    nowhere = rotary & Needs.of({"unit": "not deg"}) & Needs.of({"unit": "not rad"})
    cases = [rotary, ANY, line, nowhere]
    drawn = plan(cases, seed=1, each=4)
    assert [len(numbers) for numbers in drawn.drawn] == [4, 4, 4, 0]
    for needs, numbers in zip(cases, drawn.drawn, strict=True):
        assert len(set(numbers)) == len(numbers)
        assert not any(needs.refusal(drawn.rows[number]) for number in numbers)
    few = plan([rotary, line], seed=1)
    assert few.covered == few.pairs
    assert {row["motion"] for row in few.rows} == set(FACTORS["motion"].values)
    assert all(row["motion"].startswith("rotary") or row["bus"] == "modbus-rtu" for row in few.rows)


def test_needs_are_read_strictly():
    """A factor or a value that does not exist is refused with those that do; needs add up."""
    with pytest.raises(UnknownNameError, match="telegram"):
        Needs.of({"telegramm": "105"})
    with pytest.raises(ConfigurationError, match=r"needs.bus: 'canopen' .*can, modbus-tcp, modbus-rtu"):
        Needs.of({"bus": "canopen"})
    with pytest.raises(ConfigurationError, match="at least one value"):
        Needs.of({"profile": ("not cia402", "not profidrive")})
    both = Needs.of({"bus": "not modbus-rtu"}) & Needs.of({"bus": ("can", "modbus-rtu"), "jerk": "none"})
    assert str(both) == "bus can, jerk none"
    assert both.refusal({"bus": "modbus-rtu", "jerk": "none"}) == "needs bus can"
    assert not both.refusal({"jerk": "none"})


@pytest.mark.exhaustive
def test_a_name_is_the_whole_configuration():
    """Values and seed come back from the name; a name that is none is refused."""
    for row in everything().rows:
        configuration = Configuration(row, 12)
        assert Configuration.of(configuration.reference) == configuration
        assert read_name(name_of(row, 12)) == (row, 12)
    assert differing(everything().rows[0] | {"jerk": "none"}).count("jerk none") == 1
    for wrong in ("", "x", "i.0", "zzzzzzzzzzzzzzzzzzzz.0", "5.x", f"{name_of(everything().rows[0], 1)}x"):
        with pytest.raises(ConfigurationError, match="--list"):
            Configuration.of(CONFIGURATION + wrong)


def test_a_machine_that_cannot_exist_is_refused():
    """A configuration checks its values."""
    usual = {name: next(iter(factor.values)) for name, factor in FACTORS.items()}
    with pytest.raises(ConfigurationError, match="CiA 402 is spoken on CAN"):
        Configuration(usual | {"bus": "modbus-tcp"})
    with pytest.raises(ConfigurationError, match=r"configuration\.gear"):
        Configuration(usual | {"gear": "belt"})
    with pytest.raises(ConfigurationError, match="seed"):
        Configuration(usual, -1)


@pytest.mark.exhaustive
def test_every_configuration_is_a_bench_file_that_keeps_all_rules(subtests):
    """The bench files can be read, differ in their numbers, and `hil check` finds nothing; no two limits or
    defaults of an axis are equal.
    """
    texts = set()
    for row in everything().rows:
        configuration = Configuration(row, 3)
        with subtests.test(configuration.name):
            file = configuration.bench_file()
            texts.add(file.text)
            assert findings(file.config) == []
            variables = file.config.axis["z"].variables
            dynamics = [
                value
                for path, value in variables.items()
                if path.startswith("Dynamic") and "Limits.Velocity" not in path and value
            ]
            assert len({round(value, 9) for value in dynamics}) == len(dynamics)
            low, high = (variables[f"PositionLimits_SW.{side}Position"] for side in ("Min", "Max"))
            assert abs(low) != abs(high)
    assert len(texts) == len(everything().rows)


@pytest.mark.exhaustive
def test_every_configuration_comes_up_and_moves(subtests):
    """Each machine is enabled, and a motion of the axis moves the load as far, in the same direction."""
    for row in everything().rows:
        configuration = Configuration(row, 3)
        with subtests.test(configuration.name), configuration.bench_file().build(seed=1) as bench:
            axis, own = bench.axis(), bench.golden()
            assert bench.run_until(axis.power().status, 5.0)
            start = bench.trace()["z_drive.position"].values[-1]
            way = 0.11 * own.maximum_velocity
            assert bench.run_until(axis.move_relative(way).done, 8.0)
            trace = bench.trace()
            moved = trace["z_drive.position"].values[-1] - start
            assert moved == pytest.approx(way * own.machine_m, abs=0.025 * way * own.machine_m)
            assert not axis.var("ErrorWord")
            others = [name for name in bench.drive_names if name != "z_drive"]
            assert all(not trace[f"{name}.velocity"].values.any() for name in others)


def test_the_handbook_has_every_factor():
    """The table of the guide is the present one."""
    text = PAGE.read_text(encoding="utf-8")
    assert handbook.with_factors(text) == text
    assert handbook.table() in text


CAMPAIGN = '''
"""A campaign for the command line."""
from hil.campaign import Campaign

CAMPAIGN = Campaign("lines", needs={"bus": "modbus-tcp"})


@CAMPAIGN.case("fails", needs={"unit": ("in", "rad"), "cycle": "8ms"})
def fails(ctx):
    """The unit is not m."""
    ctx.run_for(0.05)
    ctx.measure("unit", ctx.axis.variables.read("Units.LengthUnit"), low=1010, high=1010)


@CAMPAIGN.case("nowhere", needs={"profile": "cia402"})
def nowhere(ctx):
    """CiA 402 is not spoken there."""
'''


@pytest.mark.exhaustive
def test_cases_run_on_configurations_and_are_repeated(capsys, tmp_path, monkeypatch):
    """`--configurations` lists and runs each case on machines that serve it and tells which it cannot; the
    token of a case, and its bench, repeat it.
    """
    monkeypatch.chdir(tmp_path)
    (tmp_path / "lines.py").write_text(CAMPAIGN)

    def call(*arguments):
        return main(list(arguments)), *capsys.readouterr()

    order = ("run", "lines.py", "--configurations", "pairwise:2", "--seed", "5")
    code, out, err = call(*order, "--list", "--json")
    listed = json.loads(out)
    assert (code, len(listed)) == (0, 2)
    assert all(one["configuration"]["unit"] in {"in", "rad"} for one in listed)
    assert "not planned: 1 cases that need bus modbus-tcp, profile cia402" in err
    code, out, _ = call(*order, "--list")
    assert f"{listed[0]['identifier']}  The unit is not m" in out
    assert f"{listed[0]['bench']}: " in out

    assert call(*order, "--evidence", "none")[0] == 1
    results = {case.identifier: case for case in load_run("hil-report").cases}
    assert list(results) == [one["identifier"] for one in listed]
    one = results[listed[0]["identifier"]]
    code, out, _ = call("replay", one.token, "--json")
    assert (code, json.loads(out)["case"], json.loads(out)["failed"]) == (1, one.identifier, 1)
    assert load_run("hil-report-replay").cases[0].trace_digest == one.trace_digest

    code, out, _ = call("benches", "show", listed[0]["bench"])
    assert BenchFile("shown", out).digest == load_bench_file(listed[0]["bench"]).digest
    assert call("run", "lines.py", "--bench", listed[0]["bench"], "-k", "fails")[0] == 1
    for wrong in ("pairwise:0", "triple", "pairwise:x"):
        assert "allowed: pairwise, or pairwise:N" in call("run", "lines.py", "--configurations", wrong)[2]
    code, _, err = call(*order, "--bench", "reference")
    assert (code, "leave --bench out" in err) == (2, True)
    code, _, err = call("run", "lines.py", "--configurations", "pairwise", "-k", "nowhere")
    assert (code, "no configuration serves" in err) == (2, True)
