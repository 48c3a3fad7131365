"""What a seeded defect is: a place in the product, the present text, and the text that replaces it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

from fieldbus.errors import ConfigurationError

AREAS: Final = ("cia402", "profidrive", "axis", "nc", "machine", "bus")
"""Where a defect can be: the CiA 402 drive, the PROFIdrive drive with its telegrams, the technology
objects of the controller, its NC axes, encoders and mechanics, bus and network."""
PACKAGES: Final = ("motion", "emulators", "fieldbus")
"""Areas of defects that a program draws: the packages of controller, devices and buses."""


@dataclass(frozen=True)
class Edit:
    """A change of the source of one function.

    `old` has to occur in the function exactly once, so that a change of the
    product that touches it is noticed.
    """

    target: str
    """`package.module:function` or `package.module:Class.method`."""
    old: str
    new: str


@dataclass(frozen=True)
class Mutant:
    """A defect as a firmware engineer could make it; nothing of it is in the
    product until it is switched on.
    """

    name: str
    area: str
    """One of `AREAS`, or of `PACKAGES`."""
    title: str
    """The defect in words."""
    edits: tuple[Edit, ...]
    requirements: tuple[str, ...] = ()
    """Identifiers of the specification that the defect offends against."""
    likely: tuple[str, ...] = ()
    """Patterns of cases that are tried first, best first: `stop-modes/power-1/*`, or `homing/*@reference`
    with the bench.
    """
    explained: str = ""
    """Why no case can notice it; empty: one has to."""
    operator: str = ""
    """What the program did that drew it, see `OPERATORS`; empty: a person made it."""

    def __post_init__(self) -> None:
        known = (*AREAS, *PACKAGES)
        if self.area not in known:
            raise ConfigurationError(f"mutant {self.name}.area", self.area, f"one of {', '.join(known)}")
        if not self.edits:
            raise ConfigurationError(f"mutant {self.name}.edits", "none", "at least one change")
        for edit in self.edits:
            if edit.old == edit.new:
                raise ConfigurationError(
                    f"mutant {self.name}.edits", edit.new, f"something else than {edit.old!r}"
                )


def defect(
    name: str,
    title: str,
    target: str,
    old: str,
    new: str,
    *,
    area: str,
    ids: tuple[str, ...],
    likely: tuple[str, ...],
    explained: str = "",
) -> Mutant:
    """Return a mutant with a single change: the usual one."""
    return Mutant(name, area, title, (Edit(target, old, new),), ids, likely, explained)
