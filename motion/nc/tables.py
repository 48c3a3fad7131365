"""Tables of the NC: cams and valve characteristics in one table space (NC-043, NC-353 to NC-371)."""

from __future__ import annotations

from itertools import pairwise
from typing import TYPE_CHECKING, Final

from fieldbus.errors import ConfigurationError
from motion.kernel.cams import CamError, Curve, Interpolation, Point, interpolate

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

LINEAR: Final = 0
SPLINE: Final = 1
"""Index of the texts of `drv.valve_interpolation`."""


class Table:
    """Points of a non-linear relation.

    Args:
        kind: `cam` (master and slave position) or `valve` (share of the velocity of full scale, share of
            the output).
        points: (x, y), x rising.

    Raises:
        ConfigurationError: Fewer than two points, x that do not rise, or numbers that are not finite.

    """

    def __init__(self, kind: str, points: Sequence[tuple[float, float]]) -> None:
        if kind not in {"cam", "valve"}:
            raise ConfigurationError("table, kind", kind, "cam or valve")
        if len(points) < 2 or any(low[0] >= high[0] for low, high in pairwise(points)):
            raise ConfigurationError("table, points", list(points), "two points or more, x rising")
        self.kind = kind
        self.points = tuple(points)
        try:
            places = [Point(x, y) for x, y in points]
            self._curves: tuple[Curve, Curve] = (
                interpolate(places, (), Interpolation.LINEAR),
                interpolate(places, (), Interpolation.CUBIC),
            )
        except CamError as error:
            raise ConfigurationError("table, points", list(points), str(error)) from None

    def value(self, x: float, interpolation: int = LINEAR) -> float:
        """Return y at x; outside of the points that of the nearest one (NC-371)."""
        points = self.points
        if x <= points[0][0]:
            return points[0][1]
        if x >= points[-1][0]:
            return points[-1][1]
        return self._curves[interpolation].evaluate(x)[0]


class TableSpace:
    """All tables of an NC by id; an id belongs to one table, whatever its kind."""

    def __init__(self) -> None:
        self._tables: dict[int, Table] = {}

    def add(self, table: Table, number: int | None = None) -> int:
        """Store a table; returns its id.

        Args:
            table: The table.
            number: Its id, 1 or more; None: the lowest that is free.

        Raises:
            ConfigurationError: The id is taken, or below 1.

        """
        if number is None:
            number = next(one for one in range(1, len(self._tables) + 2) if one not in self._tables)
        if number < 1 or number in self._tables:
            raise ConfigurationError("table, id", number, "1 or more, and of no other table")
        self._tables[number] = table
        return number

    def remove(self, number: int) -> None:
        """Delete a table, if it is there."""
        self._tables.pop(number, None)

    def get(self, number: int, kind: str) -> Table | None:
        """Return a table of a kind by its id; None: there is none."""
        table = self._tables.get(number)
        return table if table is not None and table.kind == kind else None

    def __iter__(self) -> Iterator[tuple[int, Table]]:
        return iter(sorted(self._tables.items()))
