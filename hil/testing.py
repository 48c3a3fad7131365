"""Helpers for tests that use a bench: the growing trace, expectations as assertions, repeatability."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from itertools import count
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final, Protocol
from weakref import WeakSet

from fieldbus.errors import ConfigurationError, UnknownAttributeError
from hil.errors import ExpectationFailedError
from hil.expect import Expectation, describe, evaluate, run_checkers
from hil.protocols import Bench, BenchFile
from hil.record import Trace, first_difference, homing_drawings
from reports.model import Check, Verdict

if TYPE_CHECKING:
    from fieldbus.history import Event
    from hil.bench.bench import Bench as ConcreteBench
    from hil.record import EventSelector, Signal, TraceFrame, TraceGroup

__all__ = ["CurrentTrace", "NewBench", "assert_repeatable", "assert_trace", "homing_drawings"]


class NewBench(Protocol):
    """What the fixture `new_bench` is: a factory of benches."""

    def __call__(
        self,
        bench: str | Path = "",
        /,
        *,
        seed: int | None = None,
        tables: Mapping[str, Any] | None = None,
    ) -> ConcreteBench:
        """Return a fresh bench, which is closed at the end of the test, or of the example of Hypothesis.

        In a fixture of your own close it yourself: `with new_bench() as bench: yield bench`.

        Args:
            bench: Bench file, embedded name or `module:NAME`; empty: as of the fixture `bench`.
            seed: Seed of its random streams; None: that of the test.
            tables: Changes to the bench file: `{"axis": {"x": {"variables": {...}}}}`.

        Raises:
            ConfigurationError: There is no such bench file, or its content is not usable.
            BlockedError: A drive did not come up, or a bus cannot be opened.

        """


def _assert_all(checks: list[Check]) -> None:
    __tracebackhide__ = True
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
    __tracebackhide__ = True
    checks = evaluate(trace, expectations)
    _assert_all(checks)
    return checks


_INSTEAD: Final = {
    "expect": "trace.check(alarm(421))",
    "signal": 'trace["x.actual_position"]',
    "signals": "trace.names()",
    "event": 'trace.select(source="x", kind="alarm.raised")',
}
"""What is meant by names that a trace does not have."""
_LIVING: Final[WeakSet[CurrentTrace]] = WeakSet()
_NUMBERS: Final = count(1)


class CurrentTrace:
    """The recording of a bench as far as it has come; the fixture `trace`.

    Calling it returns a `Trace`; signals, events, frames and the like can be asked of it directly.

    Args:
        bench: The bench.

    """

    def __init__(self, bench: Bench) -> None:
        self._bench = bench
        self._snapshot: Trace | None = None
        self._stamp = (-1, -1)
        self.checks: list[Check] = []
        """Outcome of everything that was checked, for the report."""
        self.number = next(_NUMBERS)
        """1, 2, ... in the order of making, over all benches."""
        _LIVING.add(self)

    @staticmethod
    def all_of(bench: Bench) -> list[CurrentTrace]:
        """Return those of a bench that are still in use, in the order in which they were made."""
        return sorted((one for one in _LIVING if one._bench is bench), key=lambda one: one.number)  # noqa: SLF001 - its own

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

    def __iter__(self) -> Iterator[Signal]:
        return iter(self())

    def __repr__(self) -> str:
        return f"<CurrentTrace up to {self._bench.scheduler.now * 1e-9:.3f} s>"

    if not TYPE_CHECKING:

        def __getattr__(self, name: str) -> object:
            """Name methods that are similar to one that does not exist."""
            raise UnknownAttributeError(
                self, attribute=name, what="the trace", instead=_INSTEAD.get(name, "")
            )

    def names(self) -> list[str]:
        """Return the names of all signals."""
        return self().names()

    @property
    def events(self) -> Sequence[Event]:
        """The event log, in order."""
        return self().events

    def select(self, *, source: str | None = None, kind: str | None = None) -> Iterator[Event]:
        """Return events of a source and of a kind (a trailing dot selects a family)."""
        return self().select(source=source, kind=kind)

    def instant(self, reference: float | EventSelector) -> float | None:
        """Return a reference instant in seconds; None when its event did not happen."""
        return self().instant(reference)

    @property
    def frames(self) -> tuple[TraceFrame, ...]:
        """All frames of all buses, by time."""
        return self().frames

    @property
    def buses(self) -> list[str]:
        """Names of the recorded buses."""
        return self().buses

    @property
    def groups(self) -> tuple[TraceGroup, ...]:
        """The recorded groups in the order in which they were added."""
        return self().groups

    @property
    def constants(self) -> dict[str, float]:
        """Facts of the bench that a judge of the trace needs,
        by `component.fact`: `axis1.max_deceleration`.
        """
        return self().constants

    @property
    def end_s(self) -> float:
        """Time of the snapshot, s."""
        return self().end_s

    def window(self, start_s: float, end_s: float) -> Trace:
        """Return what lies between two times, both included; times keep their origin."""
        return self().window(start_s, end_s)

    def digest(self) -> str:
        """Return the SHA-256 of the recording so far, hexadecimal."""
        return self().digest()

    def save(self, path: str | Path) -> tuple[Path, Path]:
        """Write the recording so far as `NAME.npz` and `NAME.json`; returns the two files."""
        return self().save(path)

    def check(self, *expectations: Expectation) -> None:
        """Evaluate expectations on what is recorded so far.

        Raises:
            ExpectationFailedError: One does not hold; the message says expected, observed and when.
            ConfigurationError: There is none, or one of them is no expectation.

        """
        __tracebackhide__ = True
        if not expectations:
            allowed = "expectations of hil.expect, such as alarm(421)"
            raise ConfigurationError("trace.check", expectations, allowed, problem="checks nothing")
        outcomes = evaluate(self(), expectations)
        self.checks.extend(outcomes)
        _assert_all(outcomes)

    def check_rules(self, *, without: tuple[str, ...] = ()) -> None:
        """Apply the rules that hold in every run; `without` names requirements
        that do not apply to this test.
        """
        __tracebackhide__ = True
        outcomes = [check for check in run_checkers(self()) if not set(without) & set(check.requirements)]
        self.checks.extend(outcomes)
        _assert_all(outcomes)


def assert_repeatable(
    bench_file: BenchFile[ConcreteBench], script: Callable[[ConcreteBench], object], *, seed: int = 0
) -> str:
    """Run `script(bench)` on two fresh benches and compare the traces.

    Returns:
        The common digest.

    Raises:
        ExpectationFailedError: They differ; the message names the first difference.

    """
    traces: list[Trace] = []
    for _ in range(2):
        with bench_file.build(seed=seed) as bench:
            script(bench)
            traces.append(bench.trace())
    if traces[0].digest() != traces[1].digest():
        raise ExpectationFailedError(f"not repeatable: {first_difference(*traces)}")
    return traces[0].digest()
