"""The pytest plugin, in test runs of its own."""

import json
import subprocess
import sys

import pytest

import hil.bench.bench  # noqa: F401 - pytester forgets what a run inside has imported, and caches would mix both
from hil._plugin_report import new_run
from hil._plugin_results import RequirementLog, passed_requirements, read_results, write_results
from hil.campaign import Runner, RunOptions, find_campaigns, select_cases
from reports.model import CaseResult, Verdict
from reports.store import load_run, start_run, write_case

pytestmark = pytest.mark.exhaustive

pytest_plugins = ["pytester"]

BENCH = "--hil-bench=testcases.unit.hil.toybench:BENCH"
SUITE = """
import pytest
from hil.expect import alarm, event

def enable(bench, axis):
    axis.power()
    assert bench.run_until(lambda: axis.state == "STANDSTILL", 1.0)

@pytest.mark.requirement("STP-559", "STP-303")
def test_trip(bench, axis, drive, faults, trace):
    '''A drive fault leads to alarm 421.'''
    enable(bench, axis)
    axis.move_velocity(100.0)
    bench.run_for(0.3)
    faults.inject("drive.fault", code=0x2310)
    bench.run_for(0.5)
    assert drive.state == "FAULT"
    assert trace["axis1.alarm_number"].values[-1] == 421
    trace.check(alarm(421, reaction=4, within_s=0.02, since=event("fault.applied")))
    trace.check_rules()

@pytest.mark.requirement("STP-304")
def test_wrong(bench, trace):
    bench.run_for(0.1)
    trace.check(alarm(999))

@pytest.mark.requirement("STP-305")
def test_blocked(bench, faults):
    bench.kind = "live"
    faults.inject("frame.corrupt", can_id=1)

@pytest.mark.requirement("STP-306")
@pytest.mark.xfail
def test_expected_to_fail():
    assert False

@pytest.mark.requirement("STP-307")
def test_breaks_afterwards(request):
    request.addfinalizer(lambda: 1 // 0)

def test_plain():
    pass
"""


@pytest.fixture
def suite(pytester):
    pytester.makepyfile(test_machine=SUITE)
    return pytester


def results_of(pytester):
    return read_results((pytester.path / ".hil" / "requirements").glob("*.json"))


def test_the_fixtures_give_a_bench_and_its_parts(suite):
    """Bench, axis, drive, faults and trace work together; a bench that is not as needed is skipped as
    blocked.
    """
    result = suite.runpytest("-p", "no:cacheprovider", "-rs", BENCH)
    result.assert_outcomes(passed=3, failed=1, skipped=1, xfailed=1, errors=1)
    result.stdout.fnmatch_lines(["*blocked: frame.corrupt cannot be injected on a live bench*"])
    result.stdout.fnmatch_lines(["*ExpectationFailedError: Alarm 999 did not come*no alarm came*"])


def test_blocked_is_not_passed(suite):
    """The summary names what the bench cannot answer; alone it is exit code 5, and with `fail` a failure."""
    options = ("-p", "no:cacheprovider", BENCH, "--hil-report=rep")
    reason = "*test_machine.py::test_blocked: frame.corrupt cannot be injected on a live bench*"
    result = suite.runpytest(*options)
    result.stdout.fnmatch_lines(["*blocked: not passed*", reason])
    assert result.ret == pytest.ExitCode.TESTS_FAILED
    alone = suite.runpytest(*options, "-k", "blocked")
    alone.stdout.fnmatch_lines([reason, "*nothing was tested*"])
    assert alone.ret == pytest.ExitCode.NO_TESTS_COLLECTED
    strict = suite.runpytest(*options, "-k", "blocked", "--hil-blocked=fail")
    strict.assert_outcomes(failed=1)
    strict.stdout.fnmatch_lines(["*blocked: frame.corrupt cannot be injected on a live bench*"])
    (case,) = load_run(suite.path / "rep").cases
    assert case.verdict.value == "blocked"


def test_requirement_results_are_recorded_by_outcome(suite):
    """Each marked test leaves its identifiers and outcome; only a clean pass counts as covering."""
    suite.runpytest("-p", "no:cacheprovider", BENCH)
    outcomes = {node.partition("::")[2]: entry for node, entry in results_of(suite).items()}
    assert {name: entry["outcome"] for name, entry in outcomes.items()} == {
        "test_trip": "passed",
        "test_wrong": "failed",
        "test_blocked": "skipped",
        "test_expected_to_fail": "xfailed",
        "test_breaks_afterwards": "failed",
    }
    assert outcomes["test_trip"]["requirements"] == ["STP-559", "STP-303"]
    assert passed_requirements(suite.path) == ({"STP-559", "STP-303"}, 5)


def test_workers_of_xdist_leave_the_same_results(suite):
    """With two workers the results, the report and the number of files are those of one process."""
    suite.runpytest_subprocess(
        "-p", "no:cacheprovider", "-n", "2", BENCH, "--hil-report=rep", "--hil-history=none"
    )
    assert passed_requirements(suite.path) == ({"STP-559", "STP-303"}, 5)
    assert len(list((suite.path / ".hil" / "requirements").glob("*.json"))) == 1
    run = load_run(suite.path / "rep")
    assert [case.identifier.partition("::")[2] for case in run.cases] == [
        "test_blocked",
        "test_trip",
        "test_wrong",
    ]
    assert not (suite.path / "rep" / "workers").exists()
    assert (suite.path / "rep" / "report.html").exists()
    assert not (suite.path / "rep" / "history.sqlite").exists()


def test_a_test_that_kills_its_worker_is_an_error_in_the_report(pytester):
    """The others keep their results, and what a killed session has left is not taken for theirs."""
    pytester.makepyfile(
        test_deadly="""
import os, pytest
@pytest.mark.parametrize("n", range(3))
def test_one(bench, n):
    bench.run_for(0.1)
    if n == 1:
        os._exit(5)
"""
    )
    stale = pytester.path / "rep" / "workers" / "gw7"
    start_run(stale, new_run(0, "old", ""))
    write_case(stale, CaseResult("test_old.py::test_old", "old", Verdict.FAILED))
    pytester.runpytest_subprocess(
        "-p", "no:cacheprovider", "-n", "1", BENCH, "--hil-report=rep", "--hil-history=none"
    )

    run = load_run(pytester.path / "rep")
    assert [(case.identifier[-3:], case.verdict) for case in run.cases] == [
        ("[0]", Verdict.PASSED),
        ("[1]", Verdict.ERROR),
        ("[2]", Verdict.PASSED),
    ]
    assert "worker 'gw0' crashed" in run.cases[1].message


def test_the_report_holds_the_tests_that_used_a_bench(suite):
    """With --hil-report each test with a bench is a case with verdict, checks, faults, story and
    requirements.
    """
    result = suite.runpytest("-p", "no:cacheprovider", BENCH, "--hil-report=rep", "--hil-seed=3")
    result.stdout.fnmatch_lines(["bench report: rep*report.html"])
    run = load_run(suite.path / "rep")
    cases = {case.identifier.partition("::")[2]: case for case in run.cases}
    assert {name: case.verdict for name, case in cases.items()} == {
        "test_trip": Verdict.PASSED,
        "test_wrong": Verdict.FAILED,
        "test_blocked": Verdict.BLOCKED,
    }
    trip = cases["test_trip"]
    assert trip.title == "A drive fault leads to alarm 421."
    assert trip.requirements == ["STP-559", "STP-303"]
    assert [fault.kind for fault in trip.faults] == ["drive.fault"]
    assert "alarm 421" in {check.name for check in trip.checks}
    assert trip.messages
    assert trip.signals
    assert "Alarm 999" in cases["test_wrong"].message
    assert run.seed == 3
    assert (suite.path / "rep" / "history.sqlite").exists()
    html = (suite.path / "rep" / "report.html").read_text(encoding="utf-8")
    assert "A drive fault leads to alarm 421." in html
    suite.runpytest("-p", "no:cacheprovider", BENCH, "--hil-report=rep", "-k", "trip")
    assert len(load_run(suite.path / "rep").cases) == 1, "a report folder is used again"


def test_seed_and_test_name_make_the_seed_of_a_bench(pytester):
    """The seed of a bench depends on --hil-seed and the name of the test, and on nothing else."""
    pytester.makepyfile(
        """
        import pathlib
        def test_one(bench):
            with pathlib.Path("seeds").open("a") as file: file.write(f"one {bench.seed}\\n")
        def test_two(bench):
            with pathlib.Path("seeds").open("a") as file: file.write(f"two {bench.seed}\\n")
        """
    )
    for options in ([], ["-k", "two"], ["--hil-seed=1", "-k", "one"]):
        pytester.runpytest("-p", "no:cacheprovider", BENCH, *options)
    lines = (pytester.path / "seeds").read_text().split("\n")
    assert lines[1] == lines[2], "the same test, alone or among others"
    assert len({line.split()[1] for line in lines[:2]}) == 2
    assert lines[3].startswith("one ")
    assert lines[3] != lines[0]


def test_the_bench_can_come_from_the_ini_file_or_a_mark(pytester):
    """Command line before ini file; the mark of a test before both."""
    pytester.makeini("[pytest]\nhil_bench = testcases.unit.hil.toybench:CREEPING\nhil_seed = 5\n")
    pytester.makepyfile(
        """
        import pytest
        def test_ini(bench):
            assert bench.drive().defect == "creeps_without_torque"
        @pytest.mark.hil_bench("testcases.unit.hil.toybench:DEAF")
        def test_mark(bench):
            assert bench.drive().defect == "ignores_alarms"
        """
    )
    pytester.runpytest("-p", "no:cacheprovider").assert_outcomes(passed=2)


def test_faults_are_removed_after_a_test(pytester):
    """A fault that is active at the end of a test is removed before the bench closes."""
    pytester.makepyfile(
        """
        def test_jam(bench, faults, request):
            drive = bench.drive()
            bench.close = lambda: (_ for _ in ()).throw(RuntimeError("jammed")) if drive.jammed else None
            faults.inject("mechanics.jam")
            assert drive.jammed
        """
    )
    pytester.runpytest("-p", "no:cacheprovider", BENCH).assert_outcomes(passed=1)


@pytest.mark.parametrize(
    ("source", "options", "words"),
    [
        (
            "import pytest\n@pytest.mark.requirement(5)\ndef test(): pass",
            [],
            "*requirement(5) is no identifier*",
        ),
        ("def test(bench): pass", ["--hil-bench=nowhere.toml"], "*nowhere.toml*"),
        ("def test(bench): pass", ["--hil-bench=testcases.unit.hil.toybench:NOTHING"], "*NOTHING*"),
    ],
)
def test_mistakes_are_reported(pytester, source, options, words):
    """A wrong mark and a wrong bench are reported with their names."""
    pytester.makepyfile(source)
    result = pytester.runpytest("-p", "no:cacheprovider", *options)
    assert result.ret != 0
    assert any(words.strip("*") in line for line in [*result.outlines, *result.errlines])


def test_a_wrong_bench_file_is_one_message_without_a_traceback(pytester):
    """Errors of the fixtures have file, key and the right name, no line of the library and of pytest; an
    error of `new_bench` shows the line of the test.
    """
    pytester.path.joinpath("bad.toml").write_text('[bench]\nnmae = "cell"\n[segment.can0]\n')
    pytester.makepyfile(
        """
        def test_fixture(axis): pass
        def test_own(new_bench):
            new_bench(tables={"bench": {"cycl_ms": 4}})
        """
    )
    result = pytester.runpytest("-p", "no:cacheprovider", "--hil-bench=bad.toml")
    result.assert_outcomes(errors=1, failed=1)
    text = "\n".join(result.outlines)
    error, failure = text.partition("ERROR at setup of test_fixture")[2].split("== FAILURES ==", 1)
    assert error.splitlines()[1].startswith("bad.toml: bench.nmae: unknown key; did you mean name?")
    assert len(error.splitlines()) == 3, "the message between two rulers"
    assert ">       new_bench(tables=" in failure
    assert "bad.toml: bench.nmae: unknown key" in failure


def test_an_error_in_code_without_source_is_reported(pytester):
    """A test fails like any other when code that a library generates has raised: its lines are not there."""
    pytester.makepyfile(
        """
        def test_generated(bench):
            exec("def generated(): raise AssertionError('no source')\\ngenerated()", {})
        """
    )
    result = pytester.runpytest("-p", "no:cacheprovider")
    result.assert_outcomes(failed=1)
    assert any("no source" in line for line in result.outlines)


def test_a_run_without_marks_leaves_nothing(pytester):
    """The plugin writes nothing into projects that do not use it."""
    pytester.makepyfile("def test(): pass")
    pytester.runpytest("-p", "no:cacheprovider").assert_outcomes(passed=1)
    assert not (pytester.path / ".hil").exists()


def test_marks_reach_the_junit_file(suite):
    """The identifiers are properties of the test in JUnit, where other tools look for them."""
    suite.runpytest("-p", "no:cacheprovider", BENCH, "--junitxml=junit.xml")
    text = (suite.path / "junit.xml").read_text()
    assert '<property name="requirement" value="STP-559"' in text


def test_loading_the_plugin_loads_nothing_heavy():
    """A pytest run that uses no bench imports none of the heavy libraries."""
    code = (
        "import sys, hil.pytest_plugin\n"
        "heavy = {'numpy', 'canopen', 'can', 'pydantic', 'rich', 'typer', 'jinja2', 'plotly', 'hypothesis', "
        "'hil.campaign'}\n"
        "print(sorted(heavy & set(sys.modules)))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


# -- the files of results
# -------------------------------------------------------------------------------------------


def logged(**outcomes):
    log = RequirementLog()
    for name, outcome in outcomes.items():
        log.note(f"test_a.py::{name}", [f"X-{name}"], "call", outcome)
    return log


def test_the_latest_outcome_of_a_test_counts(tmp_path):
    """A later run of some tests replaces their outcomes and leaves the others."""
    (tmp_path / "test_a.py").touch()
    write_results(tmp_path, logged(a="passed", b="failed"))
    write_results(tmp_path, logged(b="passed"))
    assert passed_requirements(tmp_path) == ({"X-a", "X-b"}, 2)
    write_results(tmp_path, logged(a="failed"))
    assert passed_requirements(tmp_path) == ({"X-b"}, 2)


def test_tests_whose_file_is_gone_do_not_count(tmp_path):
    """What a deleted test has shown is no coverage."""
    write_results(tmp_path, logged(a="passed"))
    assert passed_requirements(tmp_path) == (set(), 0)


def test_many_files_become_few_without_losing_outcomes(tmp_path):
    """Old result files are merged; every outcome survives, and the latest still counts."""
    (tmp_path / "test_a.py").touch()
    for number in range(50):
        write_results(
            tmp_path, logged(**{f"t{number}": "passed", "flip": "passed" if number % 2 else "failed"})
        )
    folder = tmp_path / ".hil" / "requirements"
    assert len(list(folder.glob("*.json"))) <= 21
    covered, known = passed_requirements(tmp_path)
    assert known == 51
    assert covered == {f"X-t{number}" for number in range(50)} | {"X-flip"}


def test_damaged_result_files_are_passed_over(tmp_path):
    """A file that cannot be read does not hide the others."""
    (tmp_path / "test_a.py").touch()
    path = write_results(tmp_path, logged(a="passed"))
    (path.parent / "zz.json").write_text("{")
    (path.parent / "yy.json").write_text(json.dumps({"time_ns": 1, "results": {"n": {}}}))
    assert passed_requirements(tmp_path) == ({"X-a"}, 1)


@pytest.mark.parametrize("workers", [(), ("-n", "2")])
def test_cases_of_a_matrix_are_tests(pytester, workers):
    """A matrix file that is named runs case by case, with the seeds and so the traces of `hil run`; reports
    and marks included.
    """
    matrix = 'title = "m"\n[factors]\nbench = ["reference", "analog"]\nmoment = ["standstill"]\n'
    (pytester.path / "m.toml").write_text(matrix + 'fault = ["two-actual-values-lost", "heartbeat-lost"]\n')
    result = pytester.runpytest(
        "-p", "no:cacheprovider", "-rs", "m.toml", "--hil-report=rep", "--hil-seed=3", *workers
    )

    result.assert_outcomes(passed=2, skipped=2)
    result.stdout.fnmatch_lines_random(["*blocked: *analog has none*", "*blocked: *a fault of CAN*"])
    run = load_run(pytester.path / "rep")
    assert [case.verdict.value for case in run.cases].count("blocked") == 2
    alone = Runner(select_cases(find_campaigns(["m.toml"])), RunOptions(seed=3)).run()
    assert {c.identifier: c.trace_digest for c in run.cases} == {
        c.identifier: c.trace_digest for c in alone.cases
    }
    outcomes = {name.rpartition("::")[2]: entry["outcome"] for name, entry in results_of(pytester).items()}
    assert outcomes["m/reference/standstill/heartbeat-lost"] == "passed"
    assert outcomes["m/analog/standstill/heartbeat-lost"] == "skipped"
    pytester.runpytest(
        "-p", "no:cacheprovider", "--co", "-q"
    ).assert_outcomes()  # nobody named it: it is not collected
