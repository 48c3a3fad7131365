"""A cam as it is used: scaled, shifted, run once or cyclically (CAM section 14)."""

from __future__ import annotations

from math import floor
from typing import Final

from motion.kernel.cams.curve import Curve
from motion.kernel.cams.inverse import NEAREST, NEGATIVE, POSITIVE, Inverse
from motion.kernel.cams.pieces import Values

ONCE: Final = 0
"""`ApplicationMode`: the cam is run once; beyond its ends the following value stays (CAM-106, CAM-111)."""
CYCLIC: Final = 1
"""It is repeated; every run begins with the following value at its start (CAM-107)."""
APPENDING: Final = 2
"""It is repeated; every run begins where the one before ended (CAM-108)."""

_ROUNDING: Final = 1e-12
_EPSILON: Final = 4e-16


class ScaledCurve:
    """`y = f((x - master_offset) / master_scaling) * slave_scaling + slave_offset`.

    The curve itself is not changed (CAM-105).

    Args:
        curve: The interpolated cam.
        master_scaling: Factor of the leading values, not 0; negative mirrors the cam (CAM-104).
        slave_scaling: Factor of the following values.
        master_offset: Shift of the leading values.
        slave_offset: Shift of the following values.
        mode: `ONCE`, `CYCLIC` or `APPENDING`.

    Raises:
        ValueError: `master_scaling` is 0 (CAM-103), or there is no such mode.

    """

    def __init__(
        self,
        curve: Curve,
        *,
        master_scaling: float = 1.0,
        slave_scaling: float = 1.0,
        master_offset: float = 0.0,
        slave_offset: float = 0.0,
        mode: int = ONCE,
    ) -> None:
        if master_scaling == 0.0:
            raise ValueError("master_scaling is 0")
        if mode not in (ONCE, CYCLIC, APPENDING):
            raise ValueError(f"mode is {mode}, not {ONCE}, {CYCLIC} or {APPENDING}")
        self.curve: Curve = curve
        self.master_scaling: float = master_scaling
        self.slave_scaling: float = slave_scaling
        self.master_offset: float = master_offset
        self.slave_offset: float = slave_offset
        self.mode: int = mode

    @property
    def low(self) -> float:
        """Lowest leading value of the cam, scaled and shifted."""
        return min(self.first, self.last)

    @property
    def high(self) -> float:
        """Highest leading value of the cam, scaled and shifted."""
        return max(self.first, self.last)

    @property
    def first(self) -> float:
        """Leading value that belongs to the start of the cam."""
        return self.curve.start * self.master_scaling + self.master_offset

    @property
    def last(self) -> float:
        """Leading value that belongs to the end of the cam."""
        return self.curve.end * self.master_scaling + self.master_offset

    @property
    def period(self) -> float:
        """Length of one run in the leading value, above 0."""
        return self.curve.period * abs(self.master_scaling)

    def contains(self, x: float) -> bool:
        """Return whether a leading value is in the first run."""
        return self.low <= x <= self.high

    def argument(self, x: float) -> float:
        """Return the leading value of the cam itself that belongs to `x`, not limited to its range."""
        return (x - self.master_offset) / self.master_scaling

    def cycle(self, x: float) -> int:
        """Return the number of the run in which `x` lies, 0 for the first; always 0 when it is run once."""
        if self.mode == ONCE:
            return 0
        return self._cycle(self.argument(x))

    def evaluate(self, x: float) -> Values:
        """Return the following value and its first two derivatives by the scaled leading value."""
        return self.follow(x)[:3]

    def follow(self, x: float) -> tuple[float, float, float, int]:
        """Return what `evaluate` and `cycle` do; called in every cycle of a following axis."""
        curve, slave, master = self.curve, self.slave_scaling, self.master_scaling
        argument = (x - self.master_offset) / master
        added = 0.0
        cycle = 0
        if self.mode != ONCE:
            cycle = floor((argument - curve.start) / curve.period + _ROUNDING)  # as `_cycle`, without a call
            if not curve.start <= argument < curve.end:
                argument -= cycle * curve.period
                if argument < curve.start:  # noqa: PLR1730 - `max` costs a call
                    argument = curve.start
                if self.mode == APPENDING:
                    added = cycle * curve.lift
        y, d, dd = curve.evaluate(argument)
        return (
            (y + added) * slave + self.slave_offset,
            d * slave / master,
            dd * slave / (master * master),
            cycle,
        )

    def leading_value(
        self, inverse: Inverse, y: float, approach: float, direction: int = NEAREST
    ) -> float | None:
        """Return the leading value of one run that has a following value, all of them scaled and shifted
        (CAM-228); None when there is none in that direction.

        Args:
            inverse: That of the curve.
            y: The following value.
            approach: Leading value from which it is looked for.
            direction: `POSITIVE`, `NEGATIVE` or `NEAREST`; see `Inverse.find`.

        """
        if self.master_scaling < 0.0:
            direction = {POSITIVE: NEGATIVE, NEGATIVE: POSITIVE}.get(direction, direction)
        wanted = self._following(inverse, y)
        found = (
            None
            if wanted is None
            else inverse.find(wanted, self.argument(approach), direction, self._margin(y))
        )
        return None if found is None else found * self.master_scaling + self.master_offset

    def reaches(self, inverse: Inverse, y: float) -> bool:
        """Return whether one run has the following value, scaled and shifted, anywhere."""
        wanted = self._following(inverse, y)
        return wanted is not None and inverse.reaches(wanted, self._margin(y))

    def _following(self, inverse: Inverse, y: float) -> float | None:
        """Return the following value of the cam itself; None: there is none, since the scaling is 0."""
        if self.slave_scaling == 0.0:
            return inverse.lowest if y == self.slave_offset else None
        return (y - self.slave_offset) / self.slave_scaling

    def _margin(self, y: float) -> float:
        """Return by what the following value of the cam itself is rounded at most."""
        slave = self.slave_scaling
        return 0.0 if slave == 0.0 else _EPSILON * (abs(y) + abs(self.slave_offset)) / abs(slave)

    def _cycle(self, argument: float) -> int:
        curve = self.curve
        return floor((argument - curve.start) / curve.period + _ROUNDING)
