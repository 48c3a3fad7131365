"""What pytest says of tests with benches: reason, report, evidence, examples of Hypothesis, replays."""

import json
import re
import subprocess
import sys

import pytest

import hil.bench.bench  # noqa: F401 - pytester forgets what a run inside has imported, and caches would mix both
from hil.campaign import Token
from hil.record import Trace
from reports.model import Verdict
from reports.store import load_run
from testcases.unit.hil import three_axes

pytestmark = pytest.mark.exhaustive

pytest_plugins = ["pytester"]

SUITE = '''
import pytest
from hypothesis import Phase, given, settings, strategies as st
import hil
from hil.bench import load_bench
from hil.expect import alarm, event
from hil.faults import Injector, velocity
from hil.testing import CurrentTrace

EXAMPLES = settings(max_examples=10, deadline=None, derandomize=True, database=None,
                    phases=[Phase.generate, Phase.shrink])

@pytest.mark.hil_bench("benches/wrong.toml")
def test_home(bench):
    z = bench.axis("z")
    power = z.power()
    bench.wait_until(power.status, 2.0, "z is enabled")
    job = z.move_relative(50.0)
    assert bench.run_until(job.done, timeout=0.5)

def test_bare(bench):
    power = bench.axis("x").power()
    assert power.Status

def test_never_fired(bench, faults, trace):
    faults.inject("drive.fault", "x_drive", code=0x8611, trigger=velocity(45.0))
    bench.run_for(0.1)
    trace.check(alarm(421, since=event("fault.applied"), within_s=0.1))

def test_mistake(bench):
    bench.axis("nox")

@EXAMPLES
@given(speed=st.integers(10, 200))
def test_speeds(new_bench, speed):
    bench = new_bench()
    trace, faults = CurrentTrace(bench), Injector(bench)
    x = bench.axis("x")
    power = x.power()
    bench.wait_until(power.status, 1.0)
    x.move_velocity(speed)
    faults.inject("drive.fault", "x_drive", code=0x8611)
    bench.run_for(0.03)
    trace.check(alarm(421))
    assert speed < 100, "too fast"

@given(st.integers())
def test_refused(hil_bench_file, number):
    """Hypothesis refuses a fixture that is the same for all examples."""

def test_builds_itself():
    for _ in range(2):
        with load_bench("reference").build(seed=7) as bench:
            bench.run_for(0.02)
    raise ValueError("of the test")

@pytest.fixture(scope="module")
def shared(new_bench):
    with new_bench(tables={"bench": {"name": "shared"}}) as bench:
        yield bench

class TestShared:
    @pytest.mark.parametrize("seconds", [0.01, 0.02])
    def test_runs(self, shared, seconds):
        shared.run_for(seconds)
        assert seconds < 0.02

@pytest.mark.skip(reason="not today")
def test_skipped(bench): pass

@pytest.mark.xfail(reason="known")
def test_known(bench):
    assert bench.axis("x").homed

def test_without_bench():
    assert False
'''


def test_a_suite_is_reported_and_repeated(tmp_path, subtests):
    """One run, from a folder below that of the ini file, and everything that it leaves behind."""
    root = tmp_path / "machine"
    (root / "tests" / "benches").mkdir(parents=True)
    (root / "bench.toml").write_text(three_axes.text())
    (root / "tests" / "benches" / "wrong.toml").write_text(three_axes.text(z_steps=131072, z_fine=0))
    (root / "pytest.ini").write_text("[pytest]\nhil_bench = bench.toml\n")
    (root / "tests" / "test_machine.py").write_text(SUITE)
    done = run(
        root / "tests", "-m", "pytest", "-p", "no:cacheprovider", "--hil-report=rep", "--hil-evidence=all"
    )
    for check in CHECKS:
        with subtests.test(check.__doc__):
            check(root / "tests", done.stdout)


def run(folder, *arguments):
    """Run Python with these arguments in a folder."""
    return subprocess.run(
        [sys.executable, *arguments], cwd=folder, capture_output=True, text=True, check=False
    )


def cases_of(folder):
    return {case.identifier.partition("::")[2]: case for case in load_run(folder / "rep").cases}


def headlines_of(folder):
    content = json.loads((folder / "rep" / "summary.json").read_text())
    return {case["identifier"].partition("::")[2]: case["headline"] for case in content["cases"]}


def a_failure_says_why(folder, out):
    """Terminal, report, list, JUnit and summary give job, ErrorID, alarm and time, not the address of an
    object.
    """
    headlines = headlines_of(folder)
    junit = (folder / "rep" / "junit.xml").read_text()
    wanted = {
        "test_home": r"MC_MoveRelative_1 of z ended with 16#8001: alarm 521 at 0\.\d{3} s",
        "test_bare": r"False = <MC_Power_1 of x has Enable TRUE, Status FALSE>.Status",
        "test_never_fired": r"The fault .*: armed, never fired: velocity of x peaked at 0, asked 45.*",
        "test_mistake": r"bench: 'nox' is not the name of an axis; allowed: x, y, z",
        "test_speeds": r"too fast",
        "test_refused": r"FailedHealthCheck: hil_bench_file is one bench for all examples: .* new_bench.*",
        "test_builds_itself": r"ValueError: of the test",
        "TestShared::test_runs[0.02]": r"assert 0.02 < 0.02",
    }
    for name, words in wanted.items():
        assert re.fullmatch(words, headlines[name]), headlines[name]
        assert headlines[name].replace("<", "&lt;").replace(">", "&gt;") in junit
    assert " object at 0x" not in out.replace("TestShared object at 0x", "")
    assert "drive.fault on x_drive: armed, never fired: velocity of x peaked at 0, asked 45 mm/s" in out
    assert "hil/bench/" not in out, "a frame of the library"
    assert "hil/testing.py" not in out
    assert re.search(r"E +AssertionError: MC_MoveRelative_1 of z ended with 16#8001: alarm 521", out)


def every_test_with_a_bench_is_in_the_report(folder, out):
    """Whatever way it uses one: the verdicts are those of pytest; a test without a bench is not there."""
    cases = cases_of(folder)
    assert {name: case.verdict.value for name, case in cases.items()} == {
        **dict.fromkeys(
            ("test_home", "test_bare", "test_never_fired", "test_mistake", "test_speeds", "test_refused"),
            "failed",
        ),
        "test_builds_itself": "failed",
        "TestShared::test_runs[0.01]": "passed",
        "TestShared::test_runs[0.02]": "failed",
        "test_skipped": "blocked",
        "test_known": "passed",
    }
    assert "9 failed, 1 passed, 1 skipped, 1 xfailed" in out
    home = cases["test_home"]
    assert "assert bench.run_until(job.done, timeout=0.5)" in home.traceback
    assert home.alarms
    assert cases["test_refused"].title == "Hypothesis refuses a fixture that is the same for all examples."
    assert "The test built 2 benches; this is the last one" in {
        s.text for s in cases["test_builds_itself"].story
    }
    assert cases["test_skipped"].message == "not today"
    page = (folder / "rep" / "report.html").read_text()
    assert "Traceback" in page


def an_example_of_hypothesis_has_its_trace(folder, _):
    """Every example has a fresh bench; the case shows the shrunk one, and keeps the trace of the first that
    failed.
    """
    case = cases_of(folder)["test_speeds"]
    story = [step.text for step in case.story]
    assert re.fullmatch(r"Hypothesis ran \d+ examples, each on a fresh bench", story[0])
    assert re.fullmatch(r"Example \d+ failed first: speed=\d+", story[1])
    assert story[2] == "Shown is the last one that failed, the shrunk one: speed=100"
    assert [check.verdict for check in case.checks] == [Verdict.PASSED]
    assert [fault.kind for fault in case.faults] == ["drive.fault"]
    shrunk, first = (
        Trace.load(folder / "rep" / case.files[name])
        for name in ("trace columns", "trace of the example that failed first")
    )
    assert shrunk["x.velocity_setpoint"].values.max() <= 100.0
    assert shrunk.end_s == first.end_s, "each example began at zero"


def evidence_is_that_of_hil_run(folder, _):
    """Trace and bus logs are files that the commands take; the token repeats the test, and looks into it."""
    case = cases_of(folder)["test_home"]
    trace = folder / "rep" / case.files["trace columns"]
    assert {"bus log (candump)", "bus log (Modbus)"} <= set(case.files)
    done = run(folder, "-m", "hil.cli", "export", str(trace), "-o", "z.csv", "--signal", "z.actual_velocity")
    assert done.returncode == 0, done.stderr
    assert "z.actual_velocity" in (folder / "z.csv").read_text()[:200]

    assert Token.decode(case.token).test_file == "test_machine.py"
    done = run(folder, "-m", "hil.cli", "replay", case.token, "--report", "again", "--json")
    assert done.returncode == 1, done.stderr
    answer = json.loads(done.stdout)
    assert (answer["case"], answer["verdict"]) == ("tests/test_machine.py::test_home", "failed")
    assert answer["message"].startswith("MC_MoveRelative_1 of z ended with 16#8001: alarm 521")
    (again,) = load_run(folder / "again").cases
    assert again.trace_digest == case.trace_digest
    assert again.token == case.token

    done = run(
        folder, "-m", "hil.cli", "diag", "--token", case.token, "--axis", "z", "--at", "0.15", "--json"
    )
    assert done.returncode == 0, done.stderr
    assert json.loads(done.stdout)["note"] == "tests/test_machine.py::test_home on three axes at 0.150 s"
    done = run(folder, "-m", "hil.cli", "diag", "--token", case.token, "--at", "9")
    assert done.returncode == 2
    assert "ended before" in done.stderr + done.stdout


CHECKS = (
    a_failure_says_why,
    every_test_with_a_bench_is_in_the_report,
    an_example_of_hypothesis_has_its_trace,
    evidence_is_that_of_hil_run,
)


def test_mistakes_are_refused(pytester):
    """A mark without a bench, evidence without a folder."""
    pytester.makepyfile("import pytest\n@pytest.mark.hil_bench\ndef test_one(bench): pass")
    result = pytester.runpytest("-p", "no:cacheprovider")
    result.stderr.fnmatch_lines(["*test_one: hil_bench() is not allowed; allowed: one bench file*"])
    result = pytester.runpytest("-p", "no:cacheprovider", "--hil-evidence=all")
    result.stderr.fnmatch_lines(["*--hil-evidence needs a folder for it: --hil-report DIR*"])


@pytest.mark.parametrize("workers", [(), ("-n", "1")])
def test_a_full_disk_names_the_file(pytester, workers):
    """The outcomes of the tests stay; the end says which file could not be written."""
    pytester.makepyfile(
        test_two="""
        import resource, signal
        def test_one(bench):
            signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
            resource.setrlimit(resource.RLIMIT_FSIZE, (5000, resource.RLIM_INFINITY))
        def test_two(bench): pass
        """
    )
    result = pytester.runpytest_subprocess("-p", "no:cacheprovider", "--hil-report=rep", *workers)
    result.assert_outcomes(passed=2)
    assert result.ret == pytest.ExitCode.USAGE_ERROR
    result.stdout.fnmatch_lines(
        ["the bench report is not complete, because a file could not be written: *jsonl: File too large"]
    )
    assert "Traceback" not in result.stderr.str()


def test_evidence_of_workers_is_gathered(pytester):
    """With xdist the files of the tests are in the folder of the report."""
    pytester.makepyfile(
        "def test_one(bench): assert bench.run_until(lambda: False, 0.01)\ndef test_two(bench): pass"
    )
    pytester.runpytest_subprocess("-p", "no:cacheprovider", "-n", "2", "--hil-report=rep")
    one, two = sorted(load_run(pytester.path / "rep").cases, key=lambda case: case.identifier)
    assert all((pytester.path / "rep" / path).exists() for path in one.files.values())
    assert len(one.files) == 3
    assert "did not come within 0.01 s: axis1 DISABLED" in one.message
    assert not two.files
