"""Symbols of an NC: names of the variables of its axes, as tools and clients see them (NC-048, NC-068)."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

from motion.nc.interface import NcToPlc
from motion.nc.parameters import catalogue

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

    from motion.nc.axis import NcAxis

_AXES: Final[Mapping[str, str]] = {"en": "Axes", "de": "Achsen"}
"""Generic part of the names by language of the tool."""
_STATES: Final = tuple(vars(NcToPlc()))
_PARTS: Final = {"axis": "", "encoder": "_Enc", "drive": "_Drive", "controller": "_Ctrl"}


def symbol_names(axis: NcAxis, *, language: str = "en") -> Iterator[str]:
    """Yield the names of the symbols of an axis: `Axes.x.SetPos`, `Axes.x_Enc.ScalingNumerator`.

    Args:
        axis: The axis.
        language: Language of the tool, `en` or `de`; it changes the generic part, unless the task keeps that
            in English (`task.symbol_names_fixed`).

    """
    parameters = axis.parameters
    if not parameters.read("axis.create_symbols"):
        return
    generic = _AXES["en" if parameters.read("task.symbol_names_fixed") else language]
    for name in _STATES:
        yield f"{generic}.{axis.name}.{name}"
    for key, one in catalogue().items():
        if one.component in _PARTS:
            words = key.split(".")[1].split("_")
            yield f"{generic}.{axis.name}{_PARTS[one.component]}.{''.join(map(str.capitalize, words))}"
