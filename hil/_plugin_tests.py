"""What a test does with benches: which it built, by which fixture or by itself, and its examples."""

from __future__ import annotations

import functools
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Final

import pytest

from hil._plugin_settings import BENCH
from hil._plugin_source import function_of

if TYPE_CHECKING:
    from hil.faults import Injector
    from hil.protocols import Bench, BenchFile
    from hil.record import Trace

FIXTURES: Final = frozenset({"bench", "axis", "drive", "faults", "trace", "hil_bench_file", "new_bench"})
"""Fixtures by which a test shows that it uses a bench."""


class Use:
    """A bench that a test has built."""

    def __init__(self, bench: Bench, bench_file: BenchFile[Bench]) -> None:
        self.bench = bench
        self.bench_file = bench_file
        self._kept: Trace | None = None

    def keep(self) -> None:
        """Take the recording before the bench is closed: devices in another
        process cannot be asked afterwards.
        """
        self._kept = self.bench.trace()

    def trace(self) -> Trace:
        """Return what was recorded."""
        return self._kept if self._kept is not None else self.bench.trace()

    def injectors(self) -> list[Injector]:
        """Return what has armed faults on the bench."""
        from hil.faults import Injector

        return Injector.all_of(self.bench)

    def waiting(self) -> list[str]:
        """Return the faults whose trigger has not fired, a line each."""
        return [line for injector in self.injectors() for line in injector.waiting_summary()]

    def unmet_wait(self) -> str:
        """Return why the last `run_until` gave up; empty when it did not."""
        from hil.protocols import DescribedBench

        return self.bench.unmet_wait() if isinstance(self.bench, DescribedBench) else ""

    def summary(self) -> str:
        """Return how the axes stand; empty for a bench that does not tell."""
        from hil.protocols import DescribedBench

        return self.bench.summary() if isinstance(self.bench, DescribedBench) else ""


@dataclass(frozen=True, slots=True)
class Example:
    """An example of Hypothesis that has failed."""

    number: int
    """1, 2, ... in the order in which they ran."""
    arguments: str
    use: Use | None


class TestRecord:
    """A test and the benches that it has built.

    Args:
        item: The test.

    """

    __test__ = False  # no test of pytest's own

    def __init__(self, item: pytest.Item) -> None:
        self.item = item
        self.last: Use | None = None
        """The bench that was built last; of examples that fail that of the last one, the shrunk one."""
        self.built = 0
        self.examples = 0
        self.first_failed: Example | None = None
        self.last_failed: Example | None = None
        self.calls = False
        """Whether the test itself runs now, and not its fixtures."""
        self._open: list[Bench] = []

    @property
    def uses_bench(self) -> bool:
        """Whether it has to do with a bench: built one, or asks for a fixture that has one."""
        return self.last is not None or self._asks or self._given() is not None

    @property
    def _asks(self) -> bool:
        names = self.item.fixturenames if isinstance(self.item, pytest.Function) else ()
        return not FIXTURES.isdisjoint(names) or self.item.get_closest_marker(BENCH) is not None

    def add(self, bench: Bench, bench_file: BenchFile[Bench], *, keep: bool) -> None:
        """Note a bench that has been built.

        Args:
            bench: The bench.
            bench_file: What it was built from.
            keep: Whether its recording is wanted after the test.

        """
        if self.last is not None and self.last.bench is bench:
            return
        self.built += 1
        use = self.last = Use(bench, bench_file)
        if keep and bench.kind != "virtual":
            from hil.bench.bench import Bench as Concrete

            if isinstance(bench, Concrete):
                bench.on_close(use.keep)

    def look_at_fixtures(self) -> None:
        """Take over the bench of a fixture of a whole module, which this test has not built."""
        given = self._given()
        if self.last is None and given is not None:
            self.last = Use(*given)

    def _given(self) -> tuple[Bench, BenchFile[Bench]] | None:
        from hil._built import file_of

        values: Mapping[str, object] = self.item.funcargs if isinstance(self.item, pytest.Function) else {}
        return next((found for one in values.values() if (found := file_of(one)) is not None), None)

    def close_later(self, bench: Bench) -> None:
        """Note a bench that is closed with the test or example."""
        self._open.append(bench)

    def close(self) -> None:
        """Close the benches of a test or example."""
        while self._open:
            self._open.pop().close()

    # -- examples of Hypothesis ----------------------------------------------------------------------------

    @contextmanager
    def running(self) -> Iterator[None]:
        """Be the test that runs: every example of Hypothesis closes its benches, and is noted if it fails."""
        # Hypothesis hangs it on the function: only the name tells.
        handle: Any = getattr(function_of(self.item), "hypothesis", None)
        inner: Callable[..., object] | None = None if handle is None else handle.inner_test
        self.calls = True
        if inner is not None:
            handle.inner_test = self._watched(inner)
            _begin_with(self.item, str(self.item.config.getoption("--hil-example") or ""))
        try:
            yield
        finally:
            self.calls = False
            if inner is not None:
                handle.inner_test = inner

    def _watched(self, inner: Callable[..., object]) -> Callable[..., object]:
        @functools.wraps(inner)
        def example(*args: object, **kwargs: object) -> object:
            __tracebackhide__ = True
            self.examples += 1
            self.last = None
            try:
                return inner(*args, **kwargs)
            except (Exception, pytest.fail.Exception) as error:
                if not type(error).__module__.startswith("hypothesis"):
                    self._note_failure(kwargs)
                raise
            finally:
                self.close()

        return example

    def _note_failure(self, arguments: Mapping[str, object]) -> None:
        known = {name: value for name, value in arguments.items() if name not in FIXTURES}
        given = ", ".join(f"{name}={value!r}" for name, value in known.items())
        self.last_failed = Example(self.examples, given, self.last)
        self.first_failed = self.first_failed or self.last_failed

    def finish(self) -> None:
        """End the examples: the bench of the test is that of the last one that failed."""
        if self.last_failed is not None:
            self.last = self.last_failed.use or self.last


def _begin_with(item: pytest.Item, example: str) -> None:
    """Let a test of Hypothesis run one example alone: `VERSION BLOB`, as it tells it itself.

    Raises:
        pytest.UsageError: It is none, or one of another version of Hypothesis.

    """
    if not example:
        return
    import hypothesis

    version, _, blob = example.partition(" ")
    if version != hypothesis.__version__:
        raise pytest.UsageError(
            f"the example is one of Hypothesis {version}, and {hypothesis.__version__} is installed: what it "
            "means may differ"
        )
    function = function_of(item)
    assert function is not None  # an example is one of a test function
    hypothesis.reproduce_failure(version, blob.encode("ascii"))(function)
