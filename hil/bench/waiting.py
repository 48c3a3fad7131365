"""Conditions that a test waits for: what they are, and why they did not come."""

from __future__ import annotations

from collections.abc import Callable
from math import isfinite
from types import BuiltinFunctionType, FunctionType, MethodType
from typing import NamedTuple, SupportsFloat

from fieldbus.clock import seconds_to_ns
from fieldbus.errors import ConfigurationError
from motion.s7.handles import summary
from motion.s7.instructions import Instruction
from motion.s7.instructions.base import ExecuteInstruction

Condition = Callable[[], object]
"""What is waited for: a function of no arguments, true when it has come."""


def check_condition(where: str, condition: object) -> None:
    """Refuse what cannot be asked again and again.

    Raises:
        ConfigurationError: It is a value, such as `job.done()` in place of `job.done`.

    """
    if not callable(condition):
        raise ConfigurationError(
            where, condition, "a condition to be asked again and again: job.done, not job.done()"
        )


def checked_ns(where: str, seconds: object) -> int:
    """Return a time in nanoseconds.

    Raises:
        ConfigurationError: It is no finite number of seconds, 0 or more.

    """
    allowed = "a time in seconds, 0 or more, such as 0.5"
    if isinstance(seconds, str) or not isinstance(seconds, SupportsFloat):
        raise ConfigurationError(where, seconds, allowed)
    value = float(seconds)
    if not isfinite(value) or value < 0.0:
        raise ConfigurationError(where, seconds, allowed)
    return seconds_to_ns(value)


class UnmetWait(NamedTuple):
    """A wait that has run into its timeout."""

    condition: Condition
    timeout_s: float
    ended_ns: int
    """When it gave up; what it tells holds as long as no more time has passed."""

    def summary(self, axes: str = "") -> str:
        """Return what was waited for and how it stands: `MC_Home_1 of z ended with 16#8001: alarm 521 at
        0.378 s`.

        Args:
            axes: How the axes stand; for a condition that is no output of a job.

        """
        job = self.condition.__self__ if isinstance(self.condition, MethodType) else None
        if isinstance(job, Instruction):
            output = self.condition_name
            if output in ("done", "in_velocity", "status") and _has_failed(job):
                return job.summary()
            return f"{job.summary()}, {output} did not come within {self.timeout_s:g} s: {summary(job.axis)}"
        named = f"{self.condition_name} did not come within {self.timeout_s:g} s"
        return f"{named}: {axes}" if axes else named

    @property
    def condition_name(self) -> str:
        """The condition in words: the name of a function, or the place of a lambda."""
        condition: object = self.condition
        function = condition.__func__ if isinstance(condition, MethodType) else condition
        if isinstance(function, FunctionType):
            code = function.__code__
            if function.__name__ == "<lambda>":
                return f"the condition at {code.co_filename.rpartition('/')[2]}:{code.co_firstlineno}"
        elif not isinstance(function, BuiltinFunctionType | type):
            return type(function).__name__
        return function.__name__


def _has_failed(job: Instruction) -> bool:
    """Whether what a job tells of itself says why an output did not come."""
    return job.Error or (isinstance(job, ExecuteInstruction) and job.CommandAborted)
