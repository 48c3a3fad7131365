"""Runs of a campaign, begun, broken off, killed and gone on with, in any order: the folder holds what a model
says.

Every run is a real process, a fork of this one, which a case or the machine may kill; with two jobs it has
worker processes of its own, which cases kill as well. What the model says is what is left in the folder:
which cases, with which verdicts.
"""

from __future__ import annotations

import json
import os
import shutil
import signal
import tempfile
import warnings
from pathlib import Path

import pytest
from hypothesis import settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, initialize, invariant, precondition, rule

from hil.campaign import Runner, RunOptions, find_campaigns, select_cases
from hil.errors import CannotRunError
from reports.model import Verdict
from reports.store import RUN_FILE, load_run

pytestmark = pytest.mark.exhaustive

CAMPAIGN = '''
"""Cases that do what a file next to them says."""

import json
import os
import time
from pathlib import Path

from hil.campaign import Campaign
from hil.errors import BlockedError
from hil.expect import alarm

CAMPAIGN = Campaign("runs", bench="testcases.unit.hil.toybench:BENCH")


@CAMPAIGN.product("{name}", parameters={"name": ["a", "b", "c", "d", "e"]}, wall_limit_s=0.2)
def case(ctx, name):
    ctx.run_for(0.01)
    match json.loads((Path(__file__).parent / "ends.json").read_text())[name]:
        case "fails":
            ctx.expect(alarm(999))
        case "raises":
            raise ValueError(name)
        case "blocked":
            raise BlockedError(name)
        case "hangs":
            time.sleep(1000.0)
        case "dies":
            os._exit(7)
'''
NAMES = ("a", "b", "c", "d", "e")
VERDICTS = {
    "passes": Verdict.PASSED, "fails": Verdict.FAILED, "raises": Verdict.ERROR, "blocked": Verdict.BLOCKED,
    "hangs": Verdict.ERROR, "dies": Verdict.ERROR,
}  # fmt: skip
SHARDS = {None: NAMES, (1, 2): NAMES[0::2], (2, 2): NAMES[1::2]}
AGAIN = {Verdict.FAILED, Verdict.ERROR}
REFUSED = 9
"""Exit code of a process whose run was refused."""


def run_in_a_process(
    folder: Path, options: RunOptions, names: tuple[str, ...], kill_after: int | None
) -> int:
    """Run in a fork of this process, which kills itself after so many cases; return its exit code."""
    with warnings.catch_warnings():
        warnings.simplefilter(
            "ignore", DeprecationWarning
        )  # a fork of a process with threads: they take no part
        child = os.fork()
    if child == 0:
        try:
            cases = select_cases(find_campaigns([str(folder / "runs.py")]))
            chosen = [one for one in cases if one.case.identifier.rpartition("/")[2] in names]
            left = kill_after

            def count(*_reported: object) -> None:
                nonlocal left
                if left is not None:
                    left -= 1
                    if left == 0:
                        os.kill(os.getpid(), signal.SIGKILL)

            Runner(chosen, options, on_result=count).run()
        except CannotRunError:
            os._exit(REFUSED)
        except BaseException:  # noqa: BLE001 - reported by the exit code
            os._exit(1)
        os._exit(0)
    return os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])


class RunsOfACampaign(RuleBasedStateMachine):
    """Keeps the model next to the folder."""

    def __init__(self) -> None:
        super().__init__()
        self.folder = Path(tempfile.mkdtemp(prefix="hil-runs-"))
        self.report = self.folder / "report"
        (self.folder / "runs.py").write_text(CAMPAIGN)
        self.ends = dict.fromkeys(NAMES, "passes")
        self.write()
        self.held: dict[str, Verdict] | None = None
        self.shard: tuple[int, int] | None = None
        self.with_workers = 0

    def teardown(self) -> None:
        shutil.rmtree(self.folder)

    def write(self) -> None:
        (self.folder / "ends.json").write_text(json.dumps(self.ends))

    def run(
        self,
        *,
        names: tuple[str, ...] = NAMES,
        shard: tuple[int, int] | None = None,
        jobs: int = 1,
        resume: bool = False,
        repeat_failed: bool = False,
        kill_after: int | None = None,
    ) -> None:
        """Do a run, and let the model do it too."""
        options = RunOptions(
            directory=self.report,
            shard=shard,
            jobs=jobs,
            resume=resume,
            repeat_failed=repeat_failed,
            evidence="none",
        )
        code = run_in_a_process(self.folder, options, names, kill_after)
        if resume and self.held is not None:
            if shard != self.shard:
                assert code == REFUSED
                return
            held = {name: end for name, end in self.held.items() if not (repeat_failed and end in AGAIN)}
        else:
            held = {}
        todo = [name for name in names if name in SHARDS[shard] and name not in held]
        if self.held is not None and repeat_failed and resume:
            # What is to be repeated stays in the journal until it has ended again.
            held = {**{name: end for name, end in self.held.items() if name in todo}, **held}
        expected = 0
        for number, name in enumerate(todo, 1):
            if self.ends[name] == "dies" and jobs == 1:
                expected = 7  # it takes the only process with it
                break
            held[name] = VERDICTS[self.ends[name]]
            if number == kill_after:
                expected = -signal.SIGKILL
                break
        assert code == expected
        self.held, self.shard = held, shard

    @initialize(ends=st.lists(st.sampled_from(list(VERDICTS)), min_size=len(NAMES), max_size=len(NAMES)))
    def begin(self, ends):
        self.ends = dict(zip(NAMES, ends, strict=True))
        self.write()

    def failing(self) -> tuple[str, ...]:
        """Return the cases that failed or broke in the folder."""
        return tuple(name for name in NAMES if (self.held or {}).get(name) in AGAIN)

    def repair(self, names: tuple[str, ...]) -> None:
        self.ends.update(dict.fromkeys(names, "passes"))
        self.write()

    @rule(name=st.sampled_from(NAMES), end=st.sampled_from(list(VERDICTS)))
    def change(self, name, end):
        self.ends[name] = end
        self.write()

    @rule(shard=st.sampled_from(list(SHARDS)))
    def fresh(self, shard):
        self.run(shard=shard)

    @rule(resume=st.booleans(), cases=st.integers(1, 3))
    def killed(self, resume, cases):
        self.run(resume=resume, shard=self.shard if resume else None, kill_after=cases)

    @rule()
    def resume(self):
        self.run(resume=True, shard=self.shard)

    @precondition(lambda self: self.held is not None)
    @rule()
    def resume_as_another_part(self):
        self.run(resume=True, shard={None: (1, 2), (1, 2): None, (2, 2): (1, 2)}[self.shard])

    @precondition(lambda self: self.failing())
    @rule(repaired=st.booleans(), kill_after=st.sampled_from([None, None, 1]))
    def repeat_failed(self, repaired, kill_after):
        if repaired:
            self.repair(self.failing())
        self.run(resume=True, repeat_failed=True, shard=self.shard, kill_after=kill_after)

    @precondition(lambda self: self.failing())
    @rule(repaired=st.booleans())
    def last_failed(self, repaired):
        names = self.failing()
        if repaired:
            self.repair(names)
        self.run(names=names)

    @precondition(lambda self: self.with_workers < 1)
    @rule(resume=st.booleans())
    def workers(self, resume):
        self.with_workers += 1
        self.run(jobs=2, resume=resume, shard=self.shard if resume else None)

    @invariant()
    def folder_and_model_agree(self):
        if self.held is None:
            assert not (self.report / RUN_FILE).exists()
            return
        run = load_run(self.report)
        found = {case.identifier.rpartition("/")[2]: case.verdict for case in run.cases}
        assert found == self.held
        assert run.shard == ("/".join(map(str, self.shard)) if self.shard else "")


RunsOfACampaign.TestCase.settings = settings(max_examples=4, stateful_step_count=6, deadline=None)
TestRunsOfACampaign = RunsOfACampaign.TestCase
