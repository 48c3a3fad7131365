"""Checks of every entry of a catalogue: one test that goes through the entries as subtests.

A thousand entries as a thousand tests cost more time for fixtures and reports than for the checks.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from itertools import product
from typing import Any

import pytest


def values_of(entry: Any) -> tuple[Any, ...]:
    """Return the values of an entry: a `pytest.param`, a tuple, or one value."""
    if hasattr(entry, "values") and hasattr(entry, "marks"):
        return tuple(entry.values)
    return entry if isinstance(entry, tuple) else (entry,)


def label_of(entry: Any) -> str:
    """Return the id of a `pytest.param`, or its values as text."""
    name = getattr(entry, "id", None)
    return name if isinstance(name, str) else "-".join(_text(value) for value in values_of(entry))


def _text(value: Any) -> str:
    return str(getattr(value, "__name__", value))


def each(*catalogues: Iterable[Any]) -> Iterator[tuple[str, tuple[Any, ...]]]:
    """Yield label and values of every entry, or of every combination of the entries of several catalogues.

    Raises:
        ValueError: There is none: the test would prove nothing.

    """
    combinations = list(product(*catalogues))
    if not combinations:
        raise ValueError("the catalogue has no entries")
    for entries in combinations:
        values = tuple(value for entry in entries for value in values_of(entry))
        yield "-".join(label_of(entry) for entry in entries), values


def requirements_in(*catalogues: Iterable[Any]) -> pytest.MarkDecorator:
    """Return the mark with the requirements that the entries of a catalogue name."""
    names = {
        name: None
        for entries in catalogues
        for entry in entries
        for mark in getattr(entry, "marks", ())
        if mark.name == "requirement"
        for name in mark.args
    }
    return pytest.mark.requirement(*names)
