"""Looking things up: `hil variables`, `hil faults NAME`, `hil benches`, `hil --version`, completion."""

import json
import re
import subprocess
import sys
from importlib.metadata import version
from pathlib import Path

import pytest

from hil.bench import EMBEDDED
from hil.bench.bench_file import read
from hil.cli import main
from motion.s7.variable_texts import head_of, page, variable_texts
from motion.s7.variables import VariableStore, object_types

PAGE = Path(__file__).resolve().parents[3] / "docs/reference/variables.md"


@pytest.mark.exhaustive
def test_a_variable_is_shown_with_everything_about_it(capsys):
    """Type, access, range, default, unit and meaning, FALSE and TRUE included, whatever case is typed."""
    assert main(["variables", "homing.approachd"]) == 0
    head, meaning = capsys.readouterr().out.splitlines()
    assert head == "Homing.ApproachDirection  BOOL  CAL  FALSE, TRUE  (default FALSE)"
    assert meaning.endswith("is approached. FALSE: positive direction; TRUE: negative direction.")
    assert main(["variables", "DynamicLimits.MaxV*", "--object", "speedaxis", "--json"]) == 0
    (one,) = json.loads(capsys.readouterr().out)
    assert one["path"] == "DynamicLimits.MaxVelocity"
    assert one["unit"] == "1/min"
    assert main(["variables", "Sensor[1].ActiveHoming.Mode"]) == 0
    assert capsys.readouterr().out.startswith("Sensor[1..4].ActiveHoming.Mode  DINT  RES  0 (ZERO_MARK)")


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["variables", "ApproachDirectoin"], "similar: Homing.ApproachDirection"),
        (["variables", "--object", "Speed"], "similar: SpeedAxis"),
        (["faults", "frame.dorp"], "'frame.dorp' is not a kind of fault; similar: frame.drop"),
        (["faults", "zz"], "`hil faults` lists them"),
        (["benches", "show", "refrence"], "similar: reference"),
        (["benches", "shw"], "allowed: list, show NAME"),
    ],
)
def test_a_name_that_there_is_not_gets_similar_ones(capsys, arguments, words):
    """Nothing is printed as an answer, exit code 2, and the message has the nearest names."""
    assert main(arguments) == 2
    captured = capsys.readouterr()
    assert captured.out == ""
    assert words in captured.err


def test_every_variable_of_every_object_has_a_meaning(subtests):
    """What an object has and what is described are the same paths, in the same order."""
    for kind in object_types():
        with subtests.test(kind):
            texts = variable_texts(kind)
            paths = list(VariableStore(kind).paths())
            assert [one.path.replace("[1..4]", "[1]").replace("[1..32]", "[1]") for one in texts] == [
                path for path in paths if "[" not in path or "[1]" in path
            ]
            assert all(one.meaning for one in texts)


def test_the_page_of_the_variables_is_current():
    """The page is what `python -m motion.s7.variable_texts docs/reference/variables.md` writes."""
    text = PAGE.read_text(encoding="utf-8")
    assert page(head_of(text)) == text


@pytest.mark.exhaustive
def test_faults_of_a_name_family_or_pattern(capsys):
    """One kind, a family, a part of a name, or all that match a pattern."""
    for name, first, count in (
        ("frame.drop", "frame.drop", 1),
        ("axis", "axis.alarm", 3),
        ("heartbeat_l", "drive.heartbeat_loss", None),
        ("switch.*", "switch.stuck", None),
    ):
        assert main(["faults", name, "--json"]) == 0
        kinds = [one["name"] for one in json.loads(capsys.readouterr().out)]
        assert first in kinds
        assert count in (None, len(kinds))


@pytest.mark.exhaustive
def test_benches_are_listed_and_shown(capsys):
    """`show` prints the file of a bench as it is."""
    assert main(["benches"]) == 0
    assert [line.split()[0] for line in capsys.readouterr().out.splitlines()] == list(EMBEDDED)
    assert main(["benches", "show", "fast"]) == 0
    assert capsys.readouterr().out == read("fast")[1]


def test_version(capsys):
    """`hil --version` prints the version of the distribution, and whether its core is compiled."""
    assert main(["--version"]) == 0
    assert re.fullmatch(
        rf"motion-hil {re.escape(version('motion-hil'))}, (pure|compiled)\b.*\n", capsys.readouterr().out
    )


@pytest.mark.exhaustive
@pytest.mark.parametrize(
    ("line", "word"),
    [
        ("hil faults frame.dr", "frame.drop"),
        ("hil run --bench profi", "profidrive_tcp"),
        ("hil run sto", "stop_modes"),
    ],
)
def test_a_shell_completes_names(line, word):
    """Bash gets commands, options and names, with exit code 0."""
    import os

    words = line.split()
    environment = {
        **os.environ,
        "_HIL_COMPLETE": "complete_bash",
        "COMP_WORDS": line,
        "COMP_CWORD": str(len(words) - 1),
    }
    done = subprocess.run(
        [sys.executable, "-m", "motion_hil"], env=environment, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    assert word in done.stdout.split()
