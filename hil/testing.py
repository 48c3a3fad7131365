"""Helpers for tests that use a bench: the growing trace, expectations as assertions, repeatability."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from hil.errors import ExpectationFailedError
from hil.expect import Expectation, describe, evaluate, run_checkers
from hil.protocols import Bench, BenchFile
from hil.record import Signal, Trace, first_difference, homing_drawings
from reports.model import Check, Verdict

__all__ = ["CurrentTrace", "assert_repeatable", "assert_trace", "homing_drawings"]


def _assert_all(checks: list[Check]) -> None:
    failed = [describe(check) for check in checks if check.verdict is not Verdict.PASSED]
    if failed:
        raise ExpectationFailedError("\n".join(failed))


def assert_trace(trace: Trace, *expectations: Expectation) -> list[Check]:
    """Evaluate expectations on a trace.

    Returns:
        The checks, all passed.

    Raises:
        ExpectationFailedError: One does not hold; the message says expected, observed and when.

    """
    checks = evaluate(trace, expectations)
    _assert_all(checks)
    return checks


class CurrentTrace:
    """The recording of a bench as far as it has come; the fixture `trace`.

    Calling it returns a `Trace`; signals, events and everything else of `Trace` can be asked of it directly.

    Args:
        bench: The bench.

    """

    def __init__(self, bench: Bench) -> None:
        self._bench = bench
        self._snapshot: Trace | None = None
        self._stamp = (-1, -1)
        self.checks: list[Check] = []
        """Outcome of everything that was checked, for the report."""

    def __call__(self) -> Trace:
        """Return a snapshot; the same one as long as nothing happens."""
        stamp = (self._bench.scheduler.now, len(self._bench.history.events))
        if self._snapshot is None or stamp != self._stamp:
            self._snapshot, self._stamp = self._bench.trace(), stamp
        return self._snapshot

    def __getitem__(self, name: str) -> Signal:
        return self()[name]

    def __contains__(self, name: object) -> bool:
        return name in self()

    def __getattr__(self, name: str) -> Any:
        if name.startswith("_"):
            raise AttributeError(name)
        return getattr(self(), name)

    def check(self, *expectations: Expectation) -> None:
        """Evaluate expectations on what is recorded so far; raises `ExpectationFailedError` when one does not
        hold.
        """
        outcomes = evaluate(self(), expectations)
        self.checks.extend(outcomes)
        _assert_all(outcomes)

    def check_rules(self, *, without: tuple[str, ...] = ()) -> None:
        """Apply the rules that hold in every run; `without` names requirements that do not apply to this
        test.
        """
        outcomes = [check for check in run_checkers(self()) if not set(without) & set(check.requirements)]
        self.checks.extend(outcomes)
        _assert_all(outcomes)


def assert_repeatable(bench_file: BenchFile, script: Callable[[Any], object], *, seed: int = 0) -> str:
    """Run `script(bench)` on two fresh benches and compare the traces.

    Returns:
        The common digest.

    Raises:
        ExpectationFailedError: They differ; the message names the first difference.

    """
    traces = []
    for _ in range(2):
        with bench_file.build(seed=seed) as bench:
            script(bench)
            traces.append(bench.trace())
    if traces[0].digest() != traces[1].digest():
        raise ExpectationFailedError(f"not repeatable: {first_difference(*traces)}")
    digest: str = traces[0].digest()
    return digest
