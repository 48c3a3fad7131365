"""Words and orders that the reports share."""

from __future__ import annotations

import math
from typing import Final

from reports.model import Verdict

VERDICTS: Final = (Verdict.FAILED, Verdict.ERROR, Verdict.BLOCKED, Verdict.PASSED)
"""From the gravest on: the order in which reports show them."""


def duration(value: float) -> str:
    """Return a time [s] in the unit that suits its size."""
    if not math.isfinite(value):
        return "unknown"
    if value >= 120:
        minutes, rest = divmod(round(value), 60)
        return f"{minutes // 60} h {minutes % 60:02d} min" if minutes >= 60 else f"{minutes} min {rest:02d} s"
    if value >= 1:
        return f"{value:.2f} s"
    return f"{value * 1000:.0f} ms" if value else "0 s"
