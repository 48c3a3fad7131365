"""One entry of the museum, the catalogue of those that ship, and the page about one."""

from __future__ import annotations

import importlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Final

from fieldbus.errors import ConfigurationError, UnknownNameError
from hil.mutants import Mutant

SHIPPED: Final = "testcases.museum:ENTRIES"
"""Where the entries that ship are."""
AREAS: Final = (
    "stop and restart",
    "drive and brake",
    "CANopen",
    "Modbus",
    "homing and limits",
    "coordination",
)
"""Chapters of the museum, in their order."""


@dataclass(frozen=True)
class Source:
    """Where a defect is published."""

    who: str
    """Product and place: `ros-industrial/ros2_canopen, issue 260`."""
    url: str
    """Address of the thread or article."""


@dataclass(frozen=True, kw_only=True)
class FieldError:
    """A published defect of a real product, and how this bench shows and catches it.

    Raises:
        ConfigurationError: It has no source, an unknown area, or not exactly one way to be shown.

    """

    name: str
    """Short name, words joined by dashes."""
    title: str
    """The defect in one line."""
    area: str
    """One of `AREAS`."""
    sources: tuple[Source, ...]
    happened: str
    """What happened, to which product."""
    on_the_bus: str
    """What it looks like in a trace or on the bus."""
    found_by: str
    """How a machine builder finds it on a machine, or keeps it out of one."""
    campaign: str
    """Shipped campaign with the case, by its short name."""
    case: str
    """Identifier of the case that catches it."""
    bench: str = ""
    """Bench of the case; empty: the one that the case is written for."""
    defect: Mutant | None = None
    """Seeded defect that makes drive, bus or controller behave so."""
    defective_bench: str = ""
    """Bench whose devices behave so, in place of a seeded defect."""

    def __post_init__(self) -> None:
        if not self.sources:
            raise ConfigurationError(f"entry {self.name}.sources", "none", "at least one public source")
        if self.area not in AREAS:
            raise ConfigurationError(f"entry {self.name}.area", self.area, f"one of {', '.join(AREAS)}")
        if (self.defect is None) is (not self.defective_bench):
            raise ConfigurationError(
                f"entry {self.name}", "a seeded defect and a bench, or neither", "one of the two"
            )

    @property
    def shown_by(self) -> str:
        """What makes the bench show it, in words."""
        if self.defect is None:
            return f"the bench `{self.defective_bench}`"
        places = ", ".join(f"`{edit.target.partition(':')[2]}`" for edit in self.defect.edits)
        return f"the seeded defect `{self.defect.name}` in {places}"

    @property
    def judged_by(self) -> str:
        """Case and bench as `hil run` takes them."""
        return f"{self.case}@{self.bench}" if self.bench else self.case


def load_museum(reference: str = SHIPPED) -> Mapping[str, FieldError]:
    """Return the entries by name.

    Args:
        reference: `package.module:NAME` of a sequence of `FieldError`.

    Raises:
        ConfigurationError: Two have the same name.

    """
    module, _, name = reference.partition(":")
    found: dict[str, FieldError] = {}
    for entry in getattr(importlib.import_module(module), name):
        if entry.name in found:
            raise ConfigurationError("entry of the museum", entry.name, "a name that no other entry has")
        found[entry.name] = entry
    return found


def select_entries(museum: Mapping[str, FieldError], names: Sequence[str]) -> list[FieldError]:
    """Return the entries with these names; all, if there are none.

    Raises:
        UnknownNameError: There is no such entry.

    """
    for name in names:
        if name not in museum:
            raise UnknownNameError("hil museum", name, "an entry of the museum", tuple(museum))
    return [museum[name] for name in dict.fromkeys(names)] if names else list(museum.values())


def field_error_page(entry: FieldError, *, level: int = 1) -> str:
    """Return the page about an entry, Markdown.

    Args:
        entry: The entry.
        level: Level of its heading.

    """
    head = "#" * level
    sources = "\n".join(f"* [{source.who}]({source.url})" for source in entry.sources)
    return (
        f"{head} {entry.title}\n\n"
        f"`{entry.name}`. {entry.happened}\n\n"
        f"**On the bus.** {entry.on_the_bus}\n\n"
        f"**How to find it.** {entry.found_by}\n\n"
        f"**Here.** Shown by {entry.shown_by}; caught by `{entry.judged_by}` of the campaign "
        f"`{entry.campaign}`.\n\n"
        f"Published:\n\n{sources}\n"
    )
