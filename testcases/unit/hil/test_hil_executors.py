"""Executors: what is lost with a worker, what is not, and that the place of a case leaves no trace in its
result.
"""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from hil._processor_time import own_processor_time_s, processor_time_s
from hil._workers import Answer, CopyStarter, Ended, Pool, start_interpreter
from hil.campaign import Runner, RunOptions, _limits, find_campaigns, select_cases
from hil.campaign import _runner as runner_module
from hil.campaign._executor import InProcess, LocalProcesses
from hil.envelope import move_absolute, sweep
from hil.errors import CannotRunError
from reports import run_digest
from reports.model import Verdict
from reports.store import load_run
from testcases.unit.hil import toytasks

pytestmark = pytest.mark.exhaustive

TOY = "testcases.unit.hil.toycampaign"
HANG = "testcases.unit.hil.toyhang"
PATIENCE_S = 60.0


def cases_of(module, name="CAMPAIGN"):
    return select_cases([entry for entry in find_campaigns([module]) if entry.reference.endswith(f":{name}")])


def outcomes(run):
    return [(case.identifier, case.verdict, case.trace_digest) for case in run.cases]


# -- processes
# ------------------------------------------------------------------------------------------------------


def hanging(name):
    return [item for item in cases_of(HANG) if item.case.identifier in {f"hang/{name}", "hang/fine"}]


def test_a_case_has_the_time_that_it_is_given():
    """The limit of the run takes the place of that of the case, and the run goes on."""
    asleep, fine = Runner(hanging("asleep"), RunOptions(jobs=2, wall_limit_s=0.4)).run().cases

    assert asleep.verdict is Verdict.ERROR
    assert "limit of 0.4 s of wall time" in asleep.message
    assert fine.verdict is Verdict.PASSED


def test_a_case_that_goes_on_regardless_is_ended(monkeypatch):
    """What swallows its time limit is ended from inside, in this process as well, and the run goes on."""
    monkeypatch.setattr(_limits, "AGAIN_S", 0.1)
    stubborn, fine = Runner(hanging("stubborn"), RunOptions(jobs=1, wall_limit_s=0.3)).run().cases

    assert (stubborn.verdict, fine.verdict) == (Verdict.ERROR, Verdict.PASSED)
    assert "limit of 0.3 s of wall time, and did not end when it was asked to" in stubborn.message


def test_a_process_that_does_not_hear_its_limit_is_ended(monkeypatch):
    """What hangs outside of Python is ended from outside, when the limit and a reserve have passed."""
    monkeypatch.setattr(runner_module, "PATIENCE_S", 2.6)
    deaf, *_ = Runner(hanging("deaf"), RunOptions(jobs=2, wall_limit_s=0.4)).run().cases

    assert deaf.verdict is Verdict.ERROR
    assert "did not answer for 3 s and was ended" in deaf.message


def test_a_dead_process_tells_how_and_the_case_can_be_replayed():
    """The result of a case that killed its process has the exit code and a token."""
    run = Runner(cases_of(TOY, "FATAL"), RunOptions(jobs=2)).run()
    first, lost, last = run.cases

    assert (first.verdict, lost.verdict, last.verdict) == (Verdict.PASSED, Verdict.ERROR, Verdict.PASSED)
    assert "exit code 3" in lost.message
    assert lost.token.startswith("HIL1-")


def test_executors_are_of_one_kind():
    """A run with an executor of one's own gives what every other gives."""
    cases = cases_of(TOY)

    class Backwards:
        def execute(self, orders):
            yield from InProcess({item.case.identifier: item.case for item in cases}).execute(orders[::-1])

    alone = Runner(cases, RunOptions()).run()
    assert outcomes(Runner(cases, RunOptions(executor=Backwards())).run()) == outcomes(alone)
    assert outcomes(Runner(cases, RunOptions(executor=LocalProcesses(3))).run()) == outcomes(alone)


def test_another_bench_file_is_not_taken_for_the_one_of_the_run(monkeypatch):
    """A worker whose bench file has another text says so, and does not judge by it."""
    monkeypatch.setattr(
        Runner, "_order", lambda self, item, make=Runner._order: _with_digest(make(self, item), "0" * 64)
    )
    run = Runner(cases_of(TOY)[:2], RunOptions(jobs=2)).run()

    assert {case.verdict for case in run.cases} == {Verdict.ERROR}
    assert all("is another one here" in case.message for case in run.cases)


def _with_digest(order, digest):
    from dataclasses import replace

    return replace(order, bench_digest=digest)


# -- a cluster
# --------------------------------------------------------------------------------------------------------


def start(*arguments):
    return subprocess.Popen(
        [sys.executable, "-m", "dask", *arguments],
        env={**os.environ, "PYTHONPATH": os.pathsep.join(path for path in sys.path if path)},
        stdin=subprocess.DEVNULL,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    )


@pytest.fixture(scope="module")
def cluster(tmp_path_factory):
    """A scheduler and two workers, each a process of its own, on the loopback: its address and the
    workers.
    """
    file = tmp_path_factory.mktemp("dask") / "scheduler.json"
    host = ("--host", "127.0.0.1", "--no-dashboard")
    processes = [start("scheduler", *host, "--port", "0", "--scheduler-file", str(file))]
    end = time.monotonic() + PATIENCE_S
    while not (file.exists() and file.read_text().endswith("}")):
        assert time.monotonic() < end, "the scheduler does not start"
        time.sleep(0.05)
    workers = [
        start("worker", *host, "--nthreads", "1", "--no-nanny", "--scheduler-file", str(file))
        for _ in range(2)
    ]
    processes += workers
    import json

    address = json.loads(file.read_text())["address"]
    from distributed import Client

    with Client(address, set_as_default=False) as client:
        client.wait_for_workers(2, timeout=PATIENCE_S)
    yield address, workers
    for process in reversed(processes):
        process.kill()
        process.wait()


@pytest.mark.exhaustive
def test_a_cluster_gives_what_this_machine_gives_also_when_a_worker_is_killed(cluster, tmp_path):
    """Every case has its result and its evidence, bit for bit that of the local run; a killed worker loses
    nothing.
    """
    address, workers = cluster
    cases = cases_of(TOY) + cases_of(TOY, "FATAL")
    here = Runner(cases, RunOptions(seed=5, jobs=2, evidence="all", directory=tmp_path / "here")).run()

    def kill(result, done, total):
        if done == 2:
            workers[0].send_signal(signal.SIGKILL)

    there = Runner(
        cases,
        RunOptions(seed=5, cluster=address, evidence="all", directory=tmp_path / "there"),
        on_result=kill,
    ).run()

    assert workers[0].wait(PATIENCE_S) == -signal.SIGKILL
    assert outcomes(there) == outcomes(here)
    assert run_digest(there) == run_digest(here)
    assert sorted(case.identifier for case in load_run(tmp_path / "there").cases) == sorted(
        item.case.identifier for item in cases
    )
    for mine, theirs in zip(here.cases, there.cases, strict=True):
        assert mine.files == theirs.files
        for name in mine.files.values():
            assert (tmp_path / "here" / name).read_bytes() == (tmp_path / "there" / name).read_bytes(), name


@pytest.mark.exhaustive
def test_an_envelope_on_a_cluster_is_that_of_this_machine(cluster):
    """A sweep gives the same on the workers of a cluster; what they cannot find by name is refused."""
    address, _ = cluster
    motion = move_absolute("", 5.0, 200.0)
    settings = {"every": 20, "watch_s": 0.2, "rules": False}
    here = sweep("reference", motion, ["operator.halt"], **settings)

    assert sweep("reference", motion, ["operator.halt"], cluster=address, **settings) == here
    with pytest.raises(CannotRunError, match="at the top level of a file"):
        sweep("reference", lambda bench: bench.run_for(0.1), ["operator.halt"], cluster=address)


def test_a_cluster_that_is_not_there_is_reported(monkeypatch):
    """Without a scheduler, or without the package, the run does not begin, and says what is missing."""
    from hil.campaign import _cluster

    monkeypatch.setattr(_cluster, "CONNECT_S", 0.3)
    with pytest.raises(CannotRunError, match=r"no scheduler answers at 'tcp://127\.0\.0\.1:1'"):
        Runner(cases_of(TOY), RunOptions(cluster="tcp://127.0.0.1:1")).run()
    monkeypatch.setitem(sys.modules, "distributed", None)
    with pytest.raises(CannotRunError, match=r"pip install 'motion-hil\[cluster\]'"):
        Runner(cases_of(TOY), RunOptions(cluster="tcp://127.0.0.1:1")).run()


# -- the pool


@pytest.mark.parametrize("start", [start_interpreter, CopyStarter([toytasks.__name__])], ids=["new", "copy"])
def test_a_task_gives_answers_and_one_end(start):
    """Answers come one by one; the end says done, failed, died or hung; one task does not disturb another."""
    tasks = [
        toytasks.Patient(("a", "b")),
        toytasks.Sleeper(("a", "hang")),
        toytasks.Patient(("a", "die")),
        toytasks.Patient(("fail",)),
        toytasks.Patient(("b",)),
    ]
    seen = {task: [] for task in tasks}
    with Pool(2, start) as pool:
        for event in pool.run(tasks):
            seen[event.task].append(event.value if isinstance(event, Answer) else (event.how, event.reason))

    assert list(seen.values()) == [
        ["a", "b", ("done", "")],
        ["a", ("hung", "the process that ran this case did not answer for 0.2 s and was ended")],
        ["a", ("died", "the process that ran this case died: exit code 7")],
        [("failed", "it cannot be done")],
        ["b", ("done", "")],
    ]


@pytest.mark.skipif(not Path("/proc/self/stat").exists(), reason="only Linux tells the time of a process")
def test_patience_can_be_processor_time():
    """Then a process that has to wait for the machine is given time, one that works too long or stands still
    is not.
    """
    waits = toytasks.Worked(wait_s=1.0, work_s=0.1, patience_s=0.4)
    works = toytasks.Worked(wait_s=0.0, work_s=30.0, patience_s=0.4)
    stands = toytasks.Worked(wait_s=30.0, work_s=0.0, patience_s=0.4)
    start = CopyStarter([toytasks.__name__])

    def ends(standstill_s, *tasks):
        with Pool(2, start, standstill_s=standstill_s) as pool:
            events = [event for event in pool.run(tasks) if isinstance(event, Ended)]
        return {event.task: (event.how, event.reason) for event in events}

    said = "the process that ran this case"
    assert ends(20.0, waits, works) == {
        waits: ("done", ""),
        works: ("hung", f"{said} did not answer for 0.4 s of processor time and was ended"),
    }
    assert ends(0.5, stands) == {stands: ("hung", f"{said} stood still for 0.5 s and was ended")}
    assert ends(0.0, waits) == {waits: ("hung", f"{said} did not answer for 0.4 s and was ended")}


@pytest.mark.skipif(not Path("/proc/self/stat").exists(), reason="only Linux tells the time of a process")
def test_processor_time_is_that_of_all_that_a_process_has_started():
    """That of a child counts while it runs and when it has ended; of a process that is gone there is none."""
    begun_s, before_s, all_s = own_processor_time_s(), time.process_time(), processor_time_s(os.getpid())
    with subprocess.Popen([sys.executable, "-c", "while True: pass"]) as child:
        while processor_time_s(os.getpid()) < all_s + 0.3:
            time.sleep(0.02)
        own_s = time.process_time() - before_s
        child.kill()
        child.wait()
    assert own_processor_time_s() - begun_s > 0.25
    assert own_s < 0.2, "it was the child that worked"
    assert processor_time_s(child.pid) is None


def test_processes_are_used_again_or_not():
    """A pool gives a process further tasks, unless each needs a fresh one."""
    for reuse, number in ((True, 1), (False, 3)):
        with Pool(1, CopyStarter([toytasks.__name__]), reuse=reuse) as pool:
            events = list(pool.run([toytasks.Number()] * 3))
        assert len({event.value for event in events if isinstance(event, Answer)}) == number
