"""Matrix files: what becomes of factors, what is covered, and what is said of mistakes."""

import itertools
import json
import subprocess
import sys

import pytest
from hypothesis import given
from hypothesis import strategies as st

from fieldbus.errors import ConfigurationError
from hil.campaign import CaseSettings, execute_case, find_campaigns, load_bench_file, load_campaign
from hil.cli import main
from hil.errors import CampaignNotFoundError
from hil.matrix import _campaign, combinations_of, combine, load_matrix, read_matrix
from reports.model import Verdict

pytestmark = pytest.mark.exhaustive

FILE = """
title = "our axis"
tags = ["ours"]
reduction = "full"
seeds = 2

[factors]
drive = ["cia402", "profidrive"]
transport = ["can", "modbus-tcp"]
moment = ["constant", "standstill"]
stop = ["power-?", "halt"]

[[exclude]]
drive = "profidrive"
stop = "power-*"
reason = "our drive has a brake of its own"

[[case]]
name = "the one that failed last winter"
drive = "cia402"
transport = "can"
job = "jog-backward"
moment = "arriving"
stop = "stop-2"
tags = ["winter"]
requirements = ["STP-249"]
"""


@pytest.fixture
def write(tmp_path):
    """Write a matrix file; returns its path."""

    def write(text=FILE, name="matrix.toml"):
        path = tmp_path / name
        path.write_text(text)
        return path

    return write


def test_factors_become_cases(write):
    """Combinations in order without those left out, each with every seed, and the named case before them."""
    campaign = load_matrix(write())
    names = [case.identifier for case in campaign.cases]

    assert names[:3] == [
        "our-axis/the-one-that-failed-last-winter/1",
        "our-axis/the-one-that-failed-last-winter/2",
        "our-axis/cia402/can/constant/power-0/1",
    ]
    # CiA 402 on CAN with five stops, PROFIdrive on two buses with MC_Halt, in two moments with two seeds.
    assert len(names) == 2 + 2 * 2 * (5 + 2)
    assert combinations_of(read_matrix(write())).left_out == {
        "our drive has a brake of its own": 16,
        "no bench has this drive and transport": 10,
    }
    assert {case.bench for case in campaign.cases} == {"reference", "profidrive", "profidrive_tcp"}
    named, plain = campaign.cases[0], campaign.cases[2]
    assert {"ours", "winter"} <= set(named.tags)
    assert "STP-249" in named.requirements
    assert {"ours", "cia402", "can", "constant", "power-0"} == set(plain.tags)
    assert {"STP-239", "STP-301"} <= set(plain.requirements)
    assert (
        plain.title
        == "MC_Power StopMode 0, emergency ramp: MC_MoveVelocity, at constant velocity (CiA 402, CAN), run 1"
    )


factors_of_any_size = st.lists(st.integers(1, 4), min_size=1, max_size=5).map(
    lambda sizes: {
        f"f{place}": [f"v{place}{value}" for value in range(size)] for place, size in enumerate(sizes)
    }
)


@given(factors_of_any_size, st.integers(1, 4), st.data())
def test_every_group_of_values_that_can_meet_does(factors, strength, data):
    """N-wise: what nothing speaks against is covered, nothing left out is there, and nothing is there
    twice.
    """
    names = list(factors)
    values = st.sampled_from([(name, value) for name in names for value in factors[name]])
    excluded = [
        dict(pair) for pair in data.draw(st.lists(st.lists(values, min_size=1, max_size=3), max_size=3))
    ]

    def objection(row):
        return "no" if any(rule.items() <= row.items() for rule in excluded) else ""

    full = [
        row
        for combination in itertools.product(*factors.values())
        if not objection(row := dict(zip(names, combination, strict=True)))
    ]
    found = combine(factors, objection, strength)

    def groups(rows):
        size = min(strength, len(names))
        return {group for row in rows for group in itertools.combinations(row.items(), size)}

    assert found.possible == len(full)
    assert all(row in full for row in found.rows)
    assert len({tuple(row.items()) for row in found.rows}) == len(found.rows) <= len(full)
    assert groups(found.rows) == groups(full)
    assert combine(factors, objection, None).rows == full


def test_a_reduced_matrix_is_the_same_in_every_process(write):
    """Seeds, shards and tokens hang on it: the order of hashes does not change what is chosen."""
    path = write(FILE.replace('"full"', "2").replace("seeds = 2", ""))
    program = (
        f"from hil.matrix import load_matrix; print([c.identifier for c in load_matrix({str(path)!r}).cases])"
    )
    runs = {
        subprocess.run(
            [sys.executable, "-c", program],
            env={"PYTHONHASHSEED": seed, "PYTHONPATH": ":".join(sys.path)},
            capture_output=True,
            text=True,
            check=True,
        ).stdout
        for seed in ("0", "1")
    }

    assert runs == {f"{[case.identifier for case in load_matrix(path).cases]}\n"}
    assert len(load_matrix(path).cases) < 15  # all combinations and the named case; pairs need no more


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        (
            '"full"',
            '"triple"',
            'reduction: \'triple\' is not allowed; allowed: "full", "pairwise" or a whole number',
        ),
        ('"full"', "0", "reduction: 0 is not allowed"),
        ("seeds = 2", "seeds = 0", "seeds: 0 is not allowed; allowed: a whole number from 1 to 1000"),
        ('title = "our axis"', "", "title: None is not allowed"),
        (
            '"standstill"]',
            '"stanstill"]',
            "factors.moment[2]: 'stanstill' is not a value of moment; similar: standstill",
        ),
        (
            '"power-?"',
            '"energy-*"',
            "factors.stop[1]: 'energy-*' is not allowed; allowed: a pattern that fits one of",
        ),
        ("moment = [", "momnet = [", "factors.momnet: unknown key; did you mean moment?"),
        (
            'stop = ["power-?", "halt"]',
            "stop = []",
            "factors.stop: [] is not allowed; allowed: at least one value",
        ),
        ('"halt"]', '"halt", "halt"]', "factors.stop.*every value once"),
        ('transport = ["can", "modbus-tcp"]', "", "allowed: drive and transport together"),
        ('moment = ["c', 'bench = ["reference"]\nmoment = ["c', "either bench, or drive and transport"),
        ('reason = "our drive has a brake of its own"', "", "exclude[1].reason"),
        (
            'stop = "power-*"\n',
            'stop = "stop-0"\n',
            "exclude[1].stop: 'stop-0' is not a value of stop",
        ),
        ('job = "jog-backward"', 'job = "jig"', "case[1].job: 'jig' is not a value of job; similar: jog"),
        ('stop = "stop-2"', 'then = "stop-2"', "not: a second stop needs a first one"),
        ('tags = ["ours"]', 'tag = ["ours"]', "tag: unknown key; did you mean tags?"),
        ('tags = ["ours"]', 'vocabulary = "hil.matrix:combine"', "the members of hil.matrix.Vocabulary"),
        ("[factors]", "[factors", "this is not valid TOML: "),
        (
            "seeds = 2",
            "seeds = 2,0",
            "seeds: 2,0 is not allowed; allowed: a number with a decimal point: seeds = 2.0",
        ),
        ('"cia402", "profidrive"]', '"stepper"]', "exclude[1].drive"),
    ],
)
def test_mistakes_are_reported_with_place_and_what_is_allowed(write, old, new, words):
    """File, key, value, what is allowed, and the nearest word."""
    path = write(FILE.replace(old, new, 1))
    with pytest.raises(ConfigurationError) as caught:
        load_matrix(path)

    assert str(path) in str(caught.value)
    rest = str(caught.value)
    for part in words.split(".*"):
        assert part in rest
        rest = rest.partition(part)[2]


EVERYTHING = "\n".join(
    f'{name} = ["*"]' for name in ("drive", "transport", "job", "moment", "stop", "then", "fault")
)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (f"seeds = 1000\n[factors]\n{EVERYTHING}", "more than 100000 cases"),
        (f"[factors]\n{EVERYTHING}", "more than 100000 cases"),
        (
            (
                '[factors]\ndrive = ["cia402"]\ntransport = ["can"]\nstop = ["halt"]\n[[case]]\nname = '
                '"cia402/can/halt"'
            ),
            "'x/cia402/can/halt' is not allowed; allowed: a name that no combination of the factors has",
        ),
    ],
)
def test_more_cases_than_anybody_runs_and_names_twice_are_refused(monkeypatch, write, text, words):
    """A product of all words is refused before it fills the memory; a named case keeps off the names of
    combinations.
    """
    if "seeds" not in text and "case" not in text:
        monkeypatch.setattr(_campaign, "MOST_CASES", 200)
        words = words.replace("100000", "200")
    path = write(f'title = "x"\n{text}\n')
    with pytest.raises(ConfigurationError) as caught:
        load_matrix(path)

    assert str(path) in str(caught.value)
    assert words in str(caught.value)


def test_more_combinations_than_anybody_looks_through_are_refused(monkeypatch, write):
    """Reduced or not: all combinations are asked whether they can be."""
    monkeypatch.setattr(_campaign, "MOST_COMBINATIONS", 10)
    with pytest.raises(
        ConfigurationError, match=r"factors: '\d+ combinations' is not allowed; allowed: at most 10 "
    ):
        load_matrix(write())


def test_a_matrix_of_which_nothing_is_left_is_refused(write):
    """An empty campaign would pass for a good one."""
    text = 'title = "x"\n[factors]\ndrive = ["analog"]\ntransport = ["can"]\nstop = ["halt"]\n'
    with pytest.raises(ConfigurationError, match="all of them left out"):
        load_matrix(write(text))


def test_a_matrix_is_found_as_file_in_a_directory_and_in_a_package(write, tmp_path):
    """The same campaign leads back from its reference; TOML without factors is none."""
    path = write()
    write('[bench]\nname = "no matrix"\n', "bench.toml")
    for reference in (path, tmp_path):
        (found,) = find_campaigns([str(reference)])
        assert found.reference == str(path)
        assert load_campaign(found.reference) is found.campaign
    reference = "testcases.campaigns:stops_of_jobs.toml"
    (packaged,) = find_campaigns([reference])
    assert load_campaign(reference) is packaged.campaign
    assert reference in [found.reference for found in find_campaigns(["testcases.campaigns"])]
    for nowhere in ("testcases.campaigns:none.toml", "none.toml"):
        with pytest.raises(CampaignNotFoundError):
            find_campaigns([nowhere])


def test_a_bench_file_next_to_the_matrix_and_one_of_ones_own(write, tmp_path):
    """Paths count from the matrix file; a bench of one's own takes its place among drives and transports."""
    (tmp_path / "ours.toml").write_text("")
    text = 'title = "x"\n[factors]\nbench = ["ours.toml", "reference"]\nstop = ["halt"]\n'
    cases = load_matrix(write(text)).cases
    assert [case.bench for case in cases] == [str(tmp_path / "ours.toml"), "reference"]
    assert [case.identifier for case in cases] == ["x/ours/halt", "x/reference/halt"]
    text = (
        'title = "x"\n[factors]\ndrive = ["stepper"]\ntransport = ["can"]\nstop = ["halt"]\n'
        '[[bench]]\ndrive = "stepper"\ntransport = "can"\nfile = "ours.toml"\n'
    )
    assert [case.bench for case in load_matrix(write(text)).cases] == [str(tmp_path / "ours.toml")]


def test_a_matrix_is_run_and_replayed(write, tmp_path, monkeypatch, capsys):
    """`hil run matrix.toml` runs it, with processes too, and the token of a case leads back to it."""
    monkeypatch.chdir(tmp_path)
    write('title = "x"\n[factors]\nmoment = ["standstill", "constant"]\nstop = ["halt"]\n')
    assert main(["run", "matrix.toml", "-j", "2", "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["passed"] == 2
    summary = json.loads((tmp_path / "hil-report" / "summary.json").read_text())
    token = next(case["token"] for case in summary["cases"] if case["identifier"] == "x/standstill/halt")
    assert main(["replay", token]) == 0
    assert main(["run", "matrix.toml", "--list"]) == 0
    assert capsys.readouterr().out.splitlines()[-1].startswith("x/constant/halt  MC_Halt: MC_MoveVelocity")


def test_what_a_bench_cannot_do_is_blocked(write):
    """A fault without a seam on the bench is no failure and no success."""
    text = 'title = "x"\n[factors]\nbench = ["analog"]\nmoment = ["standstill"]\nfault = ["heartbeat-lost"]\n'
    (case,) = load_matrix(write(text)).cases
    result = execute_case(case, load_bench_file("analog"), CaseSettings()).result
    assert result.verdict is Verdict.BLOCKED, result.message
