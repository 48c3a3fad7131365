"""Seeded defects of the museum: one of the catalogue of `hil mutants`, or one made for an entry."""

from __future__ import annotations

from hil.mutants import CATALOGUE, Edit, Mutant


def known(name: str) -> Mutant:
    """Return a defect of the catalogue."""
    return CATALOGUE[name]


def made(name: str, area: str, title: str, *edits: tuple[str, str, str]) -> Mutant:
    """Return a defect of its own.

    Args:
        name: Name of the entry.
        area: One of `hil.mutants.AREAS`.
        title: The defect in words.
        edits: Function, present text, and the text in its place.

    """
    return Mutant(name, area, title, tuple(Edit(*edit) for edit in edits))
