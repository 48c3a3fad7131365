"""What gives the values of a matrix their meaning."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Protocol, runtime_checkable

from hil.campaign._context import CaseContext

Values = Mapping[str, str]
"""A value for every factor of a combination; while combinations are being made, for some of them."""


@runtime_checkable
class Vocabulary(Protocol):
    """What the factors of a matrix may be, what a combination does, and what is expected of it."""

    @property
    def factors(self) -> Mapping[str, Mapping[str, str]]:
        """Words of every factor, each with what it means in a title.

        The factors `drive` and `transport` together choose a bench from `benches`.
        """
        ...

    @property
    def defaults(self) -> Mapping[str, str]:
        """The value of each factor that a matrix does not name; a factor without one has to be named."""
        ...

    @property
    def benches(self) -> Mapping[tuple[str, str], str]:
        """Bench by drive and transport."""
        ...

    def impossible(self, values: Values) -> str:
        """Return why a combination cannot exist at all, whatever the bench; empty: it can.

        What only the present bench cannot do is not impossible: such a case ends *blocked*. Factors may be
        missing while combinations are being made; what is true of a part has to be true of the whole.
        """
        ...

    def title(self, values: Values) -> str:
        """Return the title of a combination: what it tests."""
        ...

    def requirements(self, values: Values) -> Sequence[str]:
        """Return the identifiers of the specification that a combination checks."""
        ...

    def run(self, ctx: CaseContext, values: Values) -> None:
        """Run a combination on a fresh bench and state what is expected of it."""
        ...
