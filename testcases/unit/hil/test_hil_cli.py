"""The command line: exit codes, machine-readable output, light start."""

import json
import re
import subprocess
import sys

import pytest

from hil._commands.terminal import CaseProgress, time_left
from hil._plugin_results import RequirementLog, write_results
from hil._requirements import requirements
from hil.campaign import SHIPPED
from hil.campaign._lock import only_run_in
from hil.cli import main
from hil.faults import CATALOGUE
from reports.model import CaseResult, Verdict
from reports.store import load_run

pytestmark = pytest.mark.exhaustive

TOY = "testcases.unit.hil.toycampaign"


@pytest.fixture(autouse=True)
def elsewhere(tmp_path, monkeypatch):
    """Every command runs in a folder of its own."""
    monkeypatch.chdir(tmp_path)
    return tmp_path


def call(capsys, *arguments):
    code = main([str(argument) for argument in arguments])
    captured = capsys.readouterr()
    return code, captured.out, captured.err


def test_one_run_in_a_folder_at_a_time(capsys, tmp_path):
    """While a run goes on in a folder another one is refused and takes nothing of it away; afterwards it may
    run.
    """
    run = ("run", TOY, "--select", "chance", "--report", tmp_path / "rep")
    assert call(capsys, *run)[0] == 0
    with only_run_in(tmp_path / "rep"):
        code, _, err = call(capsys, *run)
        assert (code, load_run(tmp_path / "rep").interrupted) == (2, False)
        assert "another run is going on in this folder" in err
        assert call(capsys, *run[:-1], tmp_path / "other")[0] == 0
    assert call(capsys, *run)[0] == 0


def test_a_report_that_cannot_be_there_is_reported(capsys, tmp_path):
    """A file in place of the folder is named before anything runs."""
    (tmp_path / "rep").write_text("mine")
    code, _, err = call(capsys, "run", TOY, "--select", "chance", "--report", "rep/sub")

    assert code == 2
    assert "rep/sub: no folder for a report can be made here: Not a directory" in err
    assert "passed" not in err


def test_run_json_is_the_only_thing_on_standard_output(capsys, tmp_path):
    """`hil run --json` prints one object with exactly the promised keys, whatever the cases print
    themselves.
    """
    file = tmp_path / "loud.py"
    file.write_text(
        "from hil import Campaign\n"
        "C = Campaign('loud', bench='testcases.unit.hil.toybench:BENCH')\n"
        "@C.case('one')\ndef one(ctx):\n    print('noise')\n    ctx.run_for(0.1)\n"
    )
    code, out, err = call(capsys, "run", file, "--json", "--report", "rep")
    assert code == 0
    content = json.loads(out)
    assert set(content) == {
        "passed",
        "failed",
        "blocked",
        "errors",
        "report",
        "junit",
        "seed",
        "trace_digest",
    }
    assert (content["passed"], content["failed"], content["blocked"], content["errors"]) == (1, 0, 0, 0)
    assert len(content["trace_digest"]) == 64
    assert (tmp_path / content["report"]).exists()
    assert (tmp_path / content["junit"]).exists()
    assert "noise" in err
    assert "passed" in err


@pytest.mark.parametrize(
    ("select", "code"),
    [("move", 0), ("wrong", 1), ("broken", 1), ("blocked", 2), ("toy/", 1), ("nothing like it", 2)],
)
def test_exit_codes_of_run(capsys, select, code):
    """0 passed, 1 cases failed or broke, 2 nothing could run."""
    assert call(capsys, "run", TOY, "-k", select, "-t", "toy")[0] == (
        code if select != "nothing like it" else 2
    )


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["run", "no.such.module"], "no such file, directory or module"),
        (["run", TOY, "-k", "move", "--bench", "nowhere.toml"], "nowhere.toml"),
        (["run", TOY, "--evidence", "some"], "failed, all, none"),
        (["run", TOY, "--jobs", "many"], "0 or auto for all processors"),
        (["run", TOY, "--shard", "3/2"], "I/N with I from 1 to N"),
        (["run", TOY, "--last-failed"], "no run here"),
        (["report", "nowhere"], "no run here"),
        (["replay", "HIL1-xyz"], "damaged"),
        (["replay", "hello"], "no replay token"),
        (["check", "nowhere.toml"], "nowhere.toml"),
        (["frobnicate"], "No such command"),
        (["fuzz", "--cases", "0"], "greater than or equal to 1"),
        (["requirements"], "no test results"),
        (["requirements", "nowhere"], "no run here"),
        (["requirements", "--prefix", "XYZ"], "no requirement has it; allowed: "),
        (["history"], "no history here"),
        (["history", "compare", "1", "2", "3"], "allowed: list; compare A B; show CASE; prune"),
        (["run", TOY, "--summary", "-", "--json"], "both write to standard output"),
    ],
)
def test_what_cannot_run_ends_with_2_and_one_message(capsys, arguments, words):
    """A mistake of the user ends with 2 and says what is wrong, without a traceback and with nothing on
    stdout.
    """
    code, out, err = call(capsys, *arguments)
    assert code == 2
    assert words in err
    assert "Traceback" not in err
    assert out == ""


def test_runs_leave_a_history_that_can_be_asked(capsys, tmp_path, monkeypatch):
    """Every run is recorded; `hil history` lists, compares and follows a case; the summary says what is
    new.
    """
    monkeypatch.setenv("GITHUB_STEP_SUMMARY", str(tmp_path / "steps.md"))
    assert call(capsys, "run", TOY, "-k", "move-50", "--report", "rep", "--summary", "auto")[0] == 0
    code, out, err = call(capsys, "run", TOY, "-k", "wrong", "--report", "rep", "--summary", "-")
    assert code == 1
    assert "**failed**: Alarm 999" in out
    code, _, err = call(capsys, "run", TOY, "-t", "toy", "--report", "rep", "--summary", "auto")
    assert "since the last results: 1 new failure, 1 still failing" in err, (
        "broken is new, wrong failed before"
    )
    steps = (tmp_path / "steps.md").read_text("utf-8")
    assert steps.count("## ") == 3, "two runs, one of them with a list of failed cases, one after the other"
    file = tmp_path / "rep" / "history.sqlite"
    runs = json.loads(call(capsys, "history", "--history", file, "--json")[1])
    assert [run["number"] for run in runs] == [3, 2, 1]
    code, out, _ = call(capsys, "history", "compare", "1", "--history", file, "--json")
    assert code == 1
    assert json.loads(out)["same_traces"] == 1, "the same case with the same seed leaves the same trace"
    code, out, _ = call(capsys, "history", "compare", "2", "last", "--history", file)
    assert "toy/broken" in out
    code, out, _ = call(capsys, "history", "show", "toy/wrong", "--history", file)
    assert (code, out.count("failed")) == (0, 2)
    assert "repeat the last one with: hil replay HIL1-" in out
    assert (
        call(capsys, "history", "prune", "--keep", "1", "--history", file)[1]
        == "2 runs deleted, the last 1 stay\n"
    )
    assert call(capsys, "report", "rep", "--report", "rep", "--summary", "again.md")[0] == 1
    assert (tmp_path / "again.md").exists()
    assert len(json.loads(call(capsys, "history", "--history", file, "--json")[1])) == 1, (
        "it is there already"
    )
    assert sorted(path.name for path in tmp_path.iterdir()) == ["again.md", "rep", "steps.md"]


def test_history_can_be_elsewhere_or_nowhere(capsys, tmp_path):
    """`--history` names the file or none at all; one that is none costs a warning, not the report."""
    assert call(capsys, "run", TOY, "-k", "move-50", "--report", "rep", "--history", "none")[0] == 0
    assert not (tmp_path / "rep" / "history.sqlite").exists()
    assert call(capsys, "run", TOY, "-k", "move-50", "--report", "rep", "--history", "deep/h.sqlite")[0] == 0
    assert (tmp_path / "deep" / "h.sqlite").exists()
    (tmp_path / "notes").write_text("no database" * 100)
    code, _, err = call(capsys, "run", TOY, "-k", "move-50", "--report", "other", "--history", "notes")
    assert code == 0
    assert "warning: the run is not in the history" in err
    assert (tmp_path / "other" / "report.html").exists()


def test_requirements_of_a_run(capsys, tmp_path):
    """A report folder says what its cases cover, by family, with what is missing."""
    call(capsys, "run", TOY, "-k", "move", "--report", "rep")
    content = json.loads(call(capsys, "requirements", "rep", "--json")[1])
    cases = load_run(tmp_path / "rep").cases
    named = {name for case in cases for name in case.requirements}
    named |= {name for case in cases for check in case.checks for name in check.requirements}
    assert "STP-559" in named
    assert set(content["uncovered"]) == {entry.identifier for entry in requirements()} - named
    stops = sum(name.startswith("STP-") for name in named)
    assert content["prefixes"]["STP"]["covered"] == stops
    _, out, _ = call(capsys, "requirements", "rep", "--prefix", "STP", "--missing")
    assert re.search(rf"^STP +{stops} of +609", out, re.MULTILINE)
    assert re.search(r"^STP-301 +\w", out, re.MULTILINE)
    assert "STP-559" not in out
    assert "HOM" not in out


def test_a_case_is_replayed_from_its_token(capsys, tmp_path):
    """`hil replay` repeats the case exactly: same verdict, same trace, a report of its own."""
    call(capsys, "run", TOY, "-k", "wrong", "--report", "rep")
    (original,) = load_run(tmp_path / "rep").cases
    code, out, _ = call(capsys, "replay", original.token, "--report", "again")
    assert code == 1
    assert out.startswith("failed  toy/wrong\nAlarm 999 did not come")
    (repeated,) = load_run(tmp_path / "again").cases
    assert repeated.trace_digest == original.trace_digest
    assert (tmp_path / "again" / "report.html").exists()
    code, out, _ = call(capsys, "replay", original.token, "--report", "again", "--json")
    assert json.loads(out)["verdict"] == "failed"


def test_a_replay_on_a_changed_bench_is_refused(capsys):
    """A token is bound to its bench; --force repeats the case all the same."""
    from hil.campaign import Token

    token = Token("toy/move-50", 1, f"{TOY}:CAMPAIGN", "testcases.unit.hil.toybench:BENCH", "0" * 64).encode()
    code, _, err = call(capsys, "replay", token)
    assert code == 2
    assert "has changed since the token was made" in err
    assert call(capsys, "replay", token, "--force")[0] == 0
    gone = Token("toy/gone", 1, f"{TOY}:CAMPAIGN", "testcases.unit.hil.toybench:BENCH").encode()
    assert "has no case 'toy/gone'" in call(capsys, "replay", gone)[2]


def test_twice_proves_repeatability_and_names_what_differs(capsys):
    """--twice passes a repeatable bench and fails one that is not, naming the first event that differs."""
    assert call(capsys, "run", TOY, "-k", "move", "--twice")[0] == 0
    code, _, err = call(
        capsys, "run", TOY, "-k", "move-50", "--twice", "--bench", "testcases.unit.hil.toybench:NOISY"
    )
    assert code == 1
    assert "first difference at 0.070000 s event bench.noise of bench" in err


def test_interruption_leaves_a_report(capsys, tmp_path):
    """Ctrl-C ends with 2 and leaves the report of what ran; --resume runs the rest."""
    file = tmp_path / "stopped.py"
    file.write_text(
        "import pathlib\nfrom hil import Campaign\n"
        "C = Campaign('stopped', bench='testcases.unit.hil.toybench:BENCH')\n"
        "@C.case('one')\ndef one(ctx):\n    ctx.run_for(0.1)\n"
        "@C.case('two')\ndef two(ctx):\n"
        "    if not pathlib.Path('go').exists():\n        raise KeyboardInterrupt\n"
    )
    code, out, err = call(capsys, "run", file, "--json", "--report", "rep")
    assert code == 2
    assert json.loads(out)["passed"] == 1
    assert "interrupted" in err
    assert (tmp_path / "rep" / "report.html").exists()
    (tmp_path / "go").touch()
    code, out, _ = call(capsys, "run", file, "--json", "--report", "rep", "--resume")
    assert code == 0
    assert json.loads(out)["passed"] == 2


def test_fuzz_finds_and_replays(capsys, tmp_path):
    """`hil fuzz` ends with 1 on a defect, with script and token; `hil replay` meets the same violation."""
    code, out, err = call(
        capsys, "fuzz", "--cases", 100, "--seed", 2, "--bench", "testcases.unit.hil.toybench:DOUBLE", "--json"
    )
    assert code == 1
    (failure,) = json.loads(out)["failures"]
    assert failure["invariant"] == "one job output"
    assert "1. power_on" in err
    assert json.loads((tmp_path / "hil-report-fuzz" / "program.json").read_text()) == failure["program"]
    code, out, _ = call(capsys, "replay", failure["token"], "--json")
    assert code == 1
    assert failure["text"] in json.loads(out)["message"]


def test_fuzz_of_a_sound_bench_ends_with_0(capsys):
    """No finding is success."""
    code, out, _ = call(
        capsys, "fuzz", "--cases", 10, "--bench", "testcases.unit.hil.toybench:BENCH", "--json"
    )
    assert code == 0
    result = json.loads(out)
    assert {key: result[key] for key in ("cases", "seed", "failures", "report")} == {
        "cases": 10,
        "seed": 0,
        "failures": [],
        "report": "",
    }
    assert result["new"] == sum(result["reached"].values()) > 0


def test_faults_json_is_the_catalogue(capsys):
    """`hil faults --json` gives every kind with target kinds, parameters, seam and places."""
    code, out, _ = call(capsys, "faults", "--json")
    assert code == 0
    entries = {entry["name"]: entry for entry in json.loads(out)}
    assert set(entries) == {entry.name for entry in CATALOGUE}
    delay = entries["frame.delay"]
    assert delay["targets"] == ["segment"]
    assert delay["seam"] == "CAN medium"
    parameter = next(p for p in delay["parameters"] if p["name"] == "delay_s")
    assert (parameter["type"], parameter["unit"], parameter["required"]) == ("float", "s", True)
    assert entries["frame.corrupt"]["benches"]["live"]["injectable"] is False
    assert entries["frame.corrupt"]["benches"]["live"]["reason"]
    assert "frame.delay" in call(capsys, "faults")[1]


def test_check_tells_what_is_on_the_bench(capsys):
    """`hil check` builds the bench and says so."""
    code, out, _ = call(capsys, "check", "testcases.unit.hil.toybench:BENCH", "--json")
    assert code == 0
    content = json.loads(out)
    assert content["bench"] == "toy bench"
    assert content["built"] is True
    assert content["signals"] > 10


def test_requirements_count_by_prefix(capsys, tmp_path):
    """`hil requirements --json` counts what passing tests carry, by prefix, and lists the rest."""
    log = RequirementLog()
    log.note("test_a.py::a", ["STP-301", "STP-302"], "call", "passed")
    log.note("test_a.py::b", ["STP-303"], "call", "failed")
    (tmp_path / "test_a.py").touch()
    write_results(tmp_path, log)
    code, out, _ = call(capsys, "requirements", "--json")
    assert code == 0
    content = json.loads(out)
    assert content["prefixes"]["STP"] == {"total": 609, "covered": 2}
    assert "STP-303" in content["uncovered"]
    assert "STP-301" not in content["uncovered"]
    assert sum(entry["total"] for entry in content["prefixes"].values()) == len(requirements())
    assert len(content["uncovered"]) == len(requirements()) - 2
    assert re.search(r"^STP +2 of +609", call(capsys, "requirements")[1], re.MULTILINE)


def test_requirement_identifiers_are_unique():
    """The catalogue holds every identifier once, with title, section and document."""
    entries = requirements()
    assert len({entry.identifier for entry in entries}) == len(entries)
    assert all(entry.title and entry.section and entry.document and entry.prefix for entry in entries)


def test_help_loads_nothing_heavy():
    """`hil --help` names all commands and loads none of their libraries."""
    code = (
        "import sys\nfrom hil.cli import main\ncode = main(['--help'])\n"
        "heavy = {'numpy', 'canopen', 'can', 'pydantic', 'rich', 'jinja2', 'plotly', 'hypothesis', "
        "'hil.campaign', 'reports'}\n"
        "print(code, sorted(heavy & set(sys.modules)))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    for command in (
        "demo",
        "run",
        "emulate",
        "check",
        "diag",
        "replay",
        "fuzz",
        "benchmark",
        "requirements",
        "faults",
    ):
        assert f"  {command} " in done.stdout
    assert done.stdout.splitlines()[-1] == "0 []"


def test_run_alone_lists_the_shipped_campaigns(capsys):
    """`hil run` names every shipped campaign with its cases and title, and says what to give: exit code 2."""
    code, out, err = call(capsys, "run")
    assert code == 2
    assert re.search(r"^homing +96  Homing: every mode", out, re.MULTILINE)
    assert "hil run stop_modes" in err
    code, out, _ = call(capsys, "run", "--list", "--json")
    listed = json.loads(out)
    assert code == 0
    assert [entry["name"] for entry in listed] == [shipped.name for shipped in SHIPPED]
    assert all(entry["cases"] and entry["title"] for entry in listed)


def test_shipped_campaigns_run_by_short_name(capsys, tmp_path):
    """Short names, modules and files mix; a name that a file here has too is refused with both spellings."""
    code, out, _ = call(capsys, "run", "stop_modes", TOY, "-k", "halt/standstill", "--list", "--json")
    assert (code, [entry["campaign"] for entry in json.loads(out)]) == (
        0,
        ["testcases.campaigns.stop_modes:CAMPAIGN"],
    )
    assert "did you mean 'stop_modes'?" in call(capsys, "run", "stopmodes")[2]
    (tmp_path / "homing.py").write_text("raise SystemError('not imported')  # Campaign(\n")
    (tmp_path / "limits").mkdir()
    for name, here in (("homing", "./homing.py"), ("limits", "./limits")):
        code, _, err = call(capsys, "run", name)
        assert code == 2
        assert f"give testcases.campaigns.{name} or {here}" in " ".join(err.split())
    assert call(capsys, "run", "testcases.campaigns.homing", "--list")[0] == 0
    assert "no file in it defines a Campaign" in call(capsys, "run", "./limits")[2]


def test_cases_are_listed_without_being_run(capsys, tmp_path):
    """`--list` names the cases that would run, for people and for machines, and makes no report."""
    code, out, err = call(capsys, "run", TOY, "-t", "toy", "--list", "--shard", "1/3")
    assert code == 0
    assert [line.split()[0] for line in out.splitlines()] == ["toy/move-50", "toy/wrong", "toy/chance"]
    assert "3 cases" in err
    code, out, _ = call(capsys, "run", TOY, "-k", "chance", "--list", "--json")
    assert [entry["identifier"] for entry in json.loads(out)] == ["toy/chance"]
    assert not (tmp_path / "hil-report").exists()


def test_failed_cases_are_repeated(capsys):
    """`--last-failed` runs what failed or broke in the report folder; when nothing did, it says so."""
    call(capsys, "run", TOY, "-t", "toy")
    code, out, _ = call(capsys, "run", TOY, "--last-failed", "--json")
    assert (code, json.loads(out)["failed"], json.loads(out)["errors"]) == (1, 1, 1)
    assert [case.identifier for case in load_run("hil-report").cases] == ["toy/wrong", "toy/broken"]
    code, _, err = call(capsys, "run", TOY, "-k", "move", "--last-failed")
    assert (code, "none of the 2 cases that failed" in err) == (2, True)
    call(capsys, "run", TOY, "-k", "move")
    code, _, err = call(capsys, "run", TOY, "--last-failed")
    assert (code, "there is nothing to repeat" in err) == (2, True)


def test_shards_make_one_report(capsys):
    """`hil report` merges shards into what the whole run would have been, again and again into the same
    folder.
    """
    for number in (1, 2):
        call(capsys, "run", TOY, "-t", "toy", "--shard", f"{number}/2", "--report", f"part{number}")
    _, out, _ = call(capsys, "run", TOY, "-t", "toy", "--report", "whole", "--json")
    whole = json.loads(out)
    for _ in range(2):
        code, out, _ = call(capsys, "report", "part2", "part1", "--report", "all", "--json")
        assert code == 1
        assert {**json.loads(out), "report": "", "junit": ""} == {**whole, "report": "", "junit": ""}
    code, out, _ = call(capsys, "report", "all", "--report", "all", "--json")
    assert json.loads(out)["trace_digest"] == whole["trace_digest"]
    code, _, err = call(capsys, "report", "part1", "all", "--report", "all")
    assert (code, "merged into itself" in err) == (2, True)
    code, _, err = call(capsys, "report", "part1", "--report", "half")
    assert (code, "interrupted" in err) == (2, True)  # the other half is missing


def test_the_rest_of_the_time_is_estimated():
    """At the pace so far; nothing is said before anything has ended, or when nothing is left."""
    assert time_left(10.0, 5, 15) == "about 0:30 left"
    assert time_left(100.0, 1, 61) == "about 1:41:40 left"
    assert time_left(10.0, 0, 20) == ""
    assert time_left(10.0, 20, 0) == ""


def test_a_run_that_is_not_watched_prints_a_line_for_each_group(capsys):
    """Piped, a group gets a line when its last case has ended, a bad case at once; with -v every case."""
    results = [
        CaseResult("a/1", "", Verdict.PASSED, group="a", wall_s=0.5),
        CaseResult("b/1", "", Verdict.FAILED, "Alarm 421 did not come", group="b", wall_s=1.0),
        CaseResult("a/2", "", Verdict.PASSED, group="a", wall_s=1.0),
        CaseResult("c/1", "", Verdict.PASSED, group="c", wall_s=1.0),
    ]
    with CaseProgress(5, groups={"a": 2, "b": 1, "c": 2}) as progress:
        for done, result in enumerate(results, start=1):
            progress.case_done(result, done, 5)
    lines = capsys.readouterr().err.splitlines()
    assert lines[0].startswith("[2/5] failed  b/1 (1.00 s)")
    assert lines[1:] == [
        "    Alarm 421 did not come",
        "b: 1 failed (1.0 s)",
        "a: 2 passed (1.5 s)",
        "c: 1 passed (1.0 s)",
    ]
    with CaseProgress(5, groups={"a": 2}, verbose=True) as progress:
        progress.case_done(results[0], 1, 5)
    assert capsys.readouterr().err.startswith("[1/5] passed  a/1 (0.50 s)")
