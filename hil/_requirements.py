"""Catalogues of a report: requirements (data that ships with the package) and fault kinds."""

from __future__ import annotations

import json
from collections.abc import Sequence
from functools import cache
from importlib.resources import files
from pathlib import Path
from typing import NamedTuple

from hil._own_catalogue import load_catalogue
from hil.faults import CATALOGUE
from reports.coverage import family_of
from reports.model import RequirementInfo, RunResult


class Requirement(NamedTuple):
    """An identifier of the specification."""

    identifier: str
    title: str
    section: str
    document: str

    @property
    def prefix(self) -> str:
        """Part before the number: `STP` of `STP-303`."""
        return family_of(self.identifier)


@cache
def requirements() -> tuple[Requirement, ...]:
    """Return all requirements in the order of the specification."""
    content = json.loads(files("hil").joinpath("data", "requirements.json").read_text(encoding="utf-8"))
    return tuple(
        Requirement(identifier, title, section, document)
        for document, sections in content["documents"]
        for section, entries in sections
        for identifier, title in entries
    )


def own_requirements(catalogue: Path | None) -> list[Requirement]:
    """Return the requirements of a catalogue of the user; none without a catalogue.

    Raises:
        CannotRunError: It cannot be read.

    """
    if catalogue is None:
        return []
    return [
        Requirement(entry.identifier, entry.title, entry.section, catalogue.name)
        for entry in load_catalogue(catalogue)
    ]


def complete(run: RunResult, own: Sequence[Requirement] = ()) -> None:
    """Give a run the catalogues against which its report shows coverage: requirements and fault kinds.

    Args:
        run: The run.
        own: Requirements of the user, which come first.

    """
    taken = {entry.identifier for entry in own}
    run.requirements = [RequirementInfo(*entry, own=True) for entry in own] + [
        RequirementInfo(entry.identifier, entry.title, entry.section, entry.document)
        for entry in requirements()
        if entry.identifier not in taken
    ]
    run.fault_catalogue = [entry.name for entry in CATALOGUE]
