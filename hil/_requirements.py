"""Catalogues of a report: requirements (data that ships with the package) and fault kinds."""

from __future__ import annotations

import json
from functools import cache
from importlib.resources import files
from typing import NamedTuple

from hil.faults import CATALOGUE
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
        return self.identifier.rpartition("-")[0]


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


def complete(run: RunResult) -> None:
    """Give a run the catalogues against which its report shows coverage: requirements and fault kinds."""
    run.requirements = [
        RequirementInfo(entry.identifier, entry.title, entry.section, entry.document)
        for entry in requirements()
    ]
    run.fault_catalogue = [entry.name for entry in CATALOGUE]
