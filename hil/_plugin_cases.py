"""Cases of a matrix file as tests: `pytest matrix.toml`."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import pytest

from hil._plugin_settings import bench_reference, run_seed, shortest
from hil.campaign import CaseSettings, case_seed, execute_case
from hil.campaign._discover import matrix_campaign
from hil.campaign._execute import make_token
from hil.campaign._worker import bench_of
from hil.errors import BlockedError, HilError
from reports import replay_command
from reports.model import Verdict

if TYPE_CHECKING:
    from hil.bench.bench import Bench
    from hil.campaign import Case
    from hil.campaign._execute import Execution
    from hil.protocols import BenchFile


class CaseFailedError(HilError):
    """A case of a campaign has failed, or the harness has; the message is complete without a traceback."""


class MatrixTests(pytest.File):
    """A matrix file that was named on the command line."""

    def collect(self) -> Iterator[CaseTest]:
        """Return its cases."""
        for case in matrix_campaign(self.path).cases:
            yield CaseTest.from_parent(self, name=case.identifier, case=case)


class CaseOutcome(NamedTuple):
    """What has become of a case."""

    execution: Execution
    bench_file: BenchFile[Bench]


class CaseTest(pytest.Item):
    """A case as a test."""

    def __init__(self, *, case: Case, **more: Any) -> None:
        super().__init__(**more)
        self.case = case
        self.outcome: CaseOutcome | None = None
        if case.requirements:
            self.add_marker(pytest.mark.requirement(*case.requirements))

    def runtest(self) -> None:
        """Run the case with the seed that `hil run` gives it."""
        bench = bench_reference(self.config, default=self.case.bench)
        bench_file: BenchFile[Bench] = bench_of(bench)
        seed = case_seed(run_seed(self.config), self.case.identifier)
        token = make_token(
            self.case,
            seed=seed,
            campaign=shortest(self.path),
            bench=bench,
            bench_digest=bench_file.digest,
        )
        execution = execute_case(self.case, bench_file, CaseSettings(seed=seed, token=token))
        result = execution.result
        self.outcome = CaseOutcome(execution, bench_file)
        if result.verdict is Verdict.BLOCKED:
            raise BlockedError(result.message)
        if result.verdict is not Verdict.PASSED:
            raise CaseFailedError(f"{result.message}\nrepeat with: {replay_command(token)}")

    def repr_failure(self, excinfo: pytest.ExceptionInfo[BaseException], style: Any = None) -> Any:
        """Return the text of a failure: expected, observed, when, and how to repeat it."""
        if isinstance(excinfo.value, CaseFailedError):
            return str(excinfo.value)
        return super().repr_failure(excinfo, style)

    def reportinfo(self) -> tuple[Path, int | None, str]:
        """Return where the test comes from, and its name."""
        return self.path, 0, self.case.identifier
