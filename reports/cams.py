"""A cam of a case as plain data: its function with the derivatives, from which the report draws a picture."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from typing import Any


@dataclass
class CamDrawing:
    """The function of one cam at the end of a case."""

    name: str
    text: str
    """How it stood: how many points and segments, and where it is defined."""
    x: list[float]
    """Leading values, ascending."""
    y: list[float]
    """Following values."""
    first: list[float]
    """First derivatives."""
    second: list[float]
    """Second derivatives."""
    points: list[list[float]] = field(default_factory=list)
    """Valid points: leading and following value."""

    def to_plain(self) -> dict[str, Any]:
        """Return values for JSON."""
        return asdict(self)

    @classmethod
    def from_plain(cls, plain: Mapping[str, Any]) -> CamDrawing:
        """Return the drawing of `to_plain`.

        Raises:
            TypeError: It is not one.

        """
        return cls(**plain)
