"""Symbols of an NC: names of the variables of its axes, as tools and clients see them (NC-048, NC-068)."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

from motion.nc.interface import NC_TO_PLC
from motion.nc.parameters import catalogue

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

    from motion.nc.axis import NcAxis

_AXES: Final[Mapping[str, str]] = {"en": "Axes", "de": "Achsen"}
"""Generic part of the names by language of the tool."""
STATES: Final = (*(name for name, _, _ in NC_TO_PLC), "CamCouplingState", "CamCouplingTableID")
"""States of an axis that have symbols: members of `NcToPlc`."""


def symbol_prefix(axis: NcAxis, *, language: str = "en") -> str | None:
    """Return what the names of the symbols of an axis begin with, `Axes.x`; None: it has none.

    Args:
        axis: The axis.
        language: Language of the tool, `en` or `de`; it changes the generic part, unless the task keeps that
            in English (`task.symbol_names_fixed`).

    """
    parameters = axis.parameters
    if not parameters.read("axis.create_symbols"):
        return None
    return f"{_AXES['en' if parameters.read('task.symbol_names_fixed') else language]}.{axis.name}"


def symbol_names(axis: NcAxis, *, language: str = "en") -> Iterator[str]:
    """Yield the names of the symbols of an axis: `Axes.x.SetPos`, `Axes.x.enc.scaling_numerator`."""
    prefix = symbol_prefix(axis, language=language)
    if prefix is not None:
        for name in (*STATES, *catalogue()):
            yield f"{prefix}.{name}"
