"""Expectation that an axis follows another one by a gear or a cam, judged by recorded positions alone."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import KW_ONLY, dataclass

import numpy as np
from typing_extensions import override

from fieldbus.errors import ConfigurationError
from hil.expect._base import Expectation, Reference, check_bound, end_of, instant, words_of
from hil.expect._wording import instant_words
from hil.record import Trace
from reports.model import Check

Law = float | Callable[[float], float]
"""A ratio, or a following position of a leading one."""


@dataclass(frozen=True)
class follows(Expectation):
    """Expect an axis to move as far as another one and a gear or a cam say from `since` to `until`.

    The way from `since` on counts, so it judges a log of a real machine as well, where homing is not known.

    Args:
        axis: The axis that follows, or its signal: `follower`, `follower.position_setpoint`.
        leader: The axis or external encoder that leads, or its signal; without a column that of the actual
            position.
        law: Ratio, following unit per leading unit; or a function that returns the following position of a
            leading one.
        since: Begin of the observation.
        until: End of the observation; None: the end of the trace.
        tolerance: Greatest deviation, unit of the axis.

    Raises:
        ConfigurationError: The tolerance is negative, or `law` neither number nor function.

    """

    axis: str
    leader: str
    law: Law
    _: KW_ONLY
    since: Reference
    until: Reference | None = None
    tolerance: float = 0.1

    def __post_init__(self) -> None:
        check_bound("follows.tolerance", self.tolerance)
        if isinstance(self.law, bool) or not (isinstance(self.law, int | float) or callable(self.law)):
            raise ConfigurationError(
                "follows.law", self.law, "a ratio, or a function of the leading position"
            )

    @property
    def title(self) -> str:
        """Name made from the content."""
        return f"{self.axis} follows {self.leader}"

    @property
    def wanted(self) -> str:
        """What is expected, in words."""
        law = "its function" if callable(self.law) else f"ratio {self.law:g}"
        return f"{law} within {self.tolerance:g} from {words_of(self.since)} on"

    @override
    def signals_named(self) -> tuple[str, ...]:
        return _signal(self.axis), _signal(self.leader)

    def judge(self, trace: Trace) -> list[Check]:
        """Evaluate on a trace: the leading position is taken at the times of the following one."""
        since_s, until_s = instant(trace, self.since), end_of(trace, self.until)
        following, leading = (trace[name] for name in self.signals_named())
        part = following.between(since_s, until_s)
        if len(part) < 2 or len(leading) == 0:
            return [self.unseen(trace, "fewer than two positions were recorded after that", since_s)]
        x = np.interp(part.time_s, leading.time_s, leading.values)
        law = self.law
        wanted = np.array([law(float(one)) for one in x]) if callable(law) else float(law) * x
        error = (part.values - part.values[0]) - (wanted - wanted[0])
        # What is no number does not follow.
        size = np.where(np.isnan(error), np.inf, np.abs(error))
        broken = np.flatnonzero(size > self.tolerance)
        index = int(broken[0]) if len(broken) else int(np.argmax(size))
        deviation = float(error[index])
        sentence = (
            f"{self.axis} was {abs(deviation):.4g} {part.unit} {'behind' if deviation < 0 else 'ahead of'} "
            f"what {self.leader} asks for, from {instant_words(self.since)} on"
        )
        return [
            self.outcome(
                passed=len(broken) == 0,
                observed=f"{deviation:.4g} {part.unit}",
                time_s=float(part.time_s[index]),
                value=deviation,
                unit=part.unit,
                low=-self.tolerance,
                high=self.tolerance,
                signal=_signal(self.axis),
                since_s=since_s,
                sentence=sentence,
            )
        ]


def _signal(name: str) -> str:
    return name if "." in name else f"{name}.actual_position"
