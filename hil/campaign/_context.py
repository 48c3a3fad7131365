"""What a case function gets: the bench, its parts, faults, the story of the case and its expectations."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from fieldbus.errors import ConfigurationError
from hil.errors import BlockedError, ExpectationFailedError
from hil.expect import Expectation, describe
from hil.faults import ArmedFault, Injector
from hil.protocols import DescribedBench
from hil.record import Trace
from reports.model import Check, Scalar, Step, Verdict
from reports.text import capital, limit_words, quantity

if TYPE_CHECKING:
    from numpy.random import Generator

    from hil.bench.bench import Bench
    from hil.protocols import Drive
    from motion.s7.handles import AxisHandle


class CaseContext:
    """What a case function works with.

    Args:
        bench: A fresh bench.
        seed: Seed of this case.

    """

    def __init__(self, bench: Bench, *, seed: int = 0) -> None:
        self.bench = bench
        self.seed = seed
        self.faults = Injector(bench)
        """Arms faults: `ctx.faults.inject("drive.fault", code=0x2310)`."""
        self.story: list[Step] = []
        self.checks: list[Check] = []
        """Outcomes so far."""
        self.expectations: list[Expectation] = []
        """Judged on the finished trace."""

    # -- parts ----------------------------------------------------------------------------------------------

    @property
    def axis(self) -> AxisHandle:
        """The default axis of the bench; others with `ctx.bench.axis(name)`."""
        return self.bench.axis()

    @property
    def drive(self) -> Drive:
        """The default drive of the bench; others with `ctx.bench.drive(name)`."""
        return self.bench.drive()

    @property
    def now_s(self) -> float:
        """Present time of the bench, s: a reference instant for expectations."""
        return float(self.bench.scheduler.now) * 1e-9

    def rng(self, name: str = "case") -> Generator:
        """Return the seeded random stream `name` of this case."""
        return self.bench.rng(f"case.{name}")

    def trace(self) -> Trace:
        """Return a snapshot of the recording."""
        return self.bench.trace()

    # -- story ----------------------------------------------------------------------------------------------

    def do(self, text: str, **detail: Scalar) -> float:
        """Add an instruction that is given now to the story; returns the time, s."""
        return self._step("do", text, detail)

    def observe(self, text: str, **detail: Scalar) -> float:
        """Add an observation to the story; alarms, states, jobs and faults are added automatically."""
        return self._step("observe", text, detail)

    def _step(self, kind: str, text: str, detail: dict[str, Scalar]) -> float:
        now = self.now_s
        self.story.append(Step(now, kind, text, detail))
        return now

    # -- time -----------------------------------------------------------------------------------------------

    def run_for(self, seconds: float) -> None:
        """Let `seconds` of bench time pass."""
        self.bench.run_for(seconds)

    def run_until(self, predicate: Callable[[], object], timeout: float) -> bool:
        """Run until `predicate` is true; returns False when `timeout` seconds have passed before."""
        return self.bench.run_until(predicate, timeout)

    def wait_until(self, predicate: Callable[[], object], timeout: float, text: str) -> float:
        """Run until `predicate` is true; the case fails when that takes longer than `timeout` (STP-554).

        Args:
            predicate: What is waited for.
            timeout: Limit, s.
            text: Its meaning, for the report.

        Returns:
            The time at which it became true, s.

        Raises:
            ExpectationFailedError: It did not happen in time.

        """
        if not self.bench.run_until(predicate, timeout):
            check = Check(
                text,
                Verdict.FAILED,
                f"within {timeout:g} s",
                self._unmet_wait() or "it did not happen",
                self.now_s,
                high=timeout,
                unit="s",
                sentence=f"{capital(text)}: it did not happen within {timeout:g} s",
            )
            self.checks.append(check)
            raise ExpectationFailedError(describe(check))
        return self.now_s

    def _unmet_wait(self) -> str:
        bench: object = self.bench  # another one than ours need not tell
        return bench.unmet_wait() if isinstance(bench, DescribedBench) else ""

    # -- faults ---------------------------------------------------------------------------------------------

    def inject(self, kind: str, target: str = "", **options: Any) -> ArmedFault:
        """Arm a fault; arguments as of `Injector.inject`. Without a trigger it is applied at once.

        Raises:
            UnsupportedFaultError: This bench cannot inject it; the case ends *blocked*.

        """
        return self.faults.inject(kind, target, **options)

    # -- expectations ---------------------------------------------------------------------------------------

    def expect(self, *expectations: Expectation) -> None:
        """Add expectations that judge the finished trace."""
        for expectation in expectations:
            if not isinstance(expectation, Expectation):
                raise ConfigurationError("ctx.expect", expectation, "expectations made by hil.expect")
        self.expectations.extend(expectations)

    def check(self, *expectations: Expectation) -> None:
        """Judge expectations now, on what is recorded so far.

        Raises:
            ExpectationFailedError: One of them does not hold; the case ends *failed*.

        """
        trace = self.trace()
        outcomes = [outcome for expectation in expectations for outcome in expectation.evaluate(trace)]
        self.checks.extend(outcomes)
        failed = [outcome for outcome in outcomes if outcome.verdict is not Verdict.PASSED]
        if failed:
            raise ExpectationFailedError("; ".join(describe(outcome) for outcome in failed))

    def measure(
        self,
        name: str,
        value: float,
        unit: str = "",
        *,
        low: float | None = None,
        high: float | None = None,
        requirements: tuple[str, ...] = (),
    ) -> bool:
        """Record a measurement with limits; returns whether it is within them."""
        good = (low is None or value >= low) and (high is None or value <= high)
        limits = " and ".join(
            text
            for text in (f">= {low:g}" if low is not None else "", f"<= {high:g}" if high is not None else "")
            if text
        )
        self.checks.append(
            Check(
                name,
                Verdict.PASSED if good else Verdict.FAILED,
                limits or "any value",
                f"{value:g} {unit}".rstrip(),
                self.now_s,
                value,
                unit,
                low,
                high,
                list(requirements),
                sentence=f"{capital(name)}: {quantity(value, unit)}"
                + (f" (allowed: {limit_words(low, high, unit)})" if limits else ""),
            )
        )
        return good

    def require(self, condition: object, text: str) -> None:
        """Require something of the bench before the test itself.

        Raises:
            BlockedError: The condition is false; the case ends *blocked*.

        """
        if not condition:
            raise BlockedError(f"the bench is not as needed: {text}")
