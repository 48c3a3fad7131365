"""Which outputs of technology objects a run has read: variables that the program cannot write, and bits of
words.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from collections.abc import Set as AbstractSet
from typing import TYPE_CHECKING, Final

if TYPE_CHECKING:
    from motion.s7.handles import AxisHandle

_COLUMNS: Final[Mapping[str, str]] = {
    "StatusWord": "status_word",
    "StatusWord2": "status_word2",
    "ErrorWord": "error_word",
    "WarningWord": "warning_word",
}
"""Words that are recorded, with their column."""

_SHOWN: Final = ("Status", "Error", "Warning")
"""Structures whose variables an axis shows; with others a variable without a structure."""


def outputs_of(
    axes: Mapping[str, AxisHandle], looked_at: AbstractSet[str]
) -> tuple[frozenset[str], frozenset[str]]:
    """Return the outputs of axes that somebody has read, and the others.

    A bit is read with its own path, or by a rule that judges it in the recorded word; a whole word that is
    read says nothing of its bits.

    Args:
        axes: Axes by name.
        looked_at: Names of the signals, and of the bits of recorded words, that were looked at in the trace.

    """
    read: set[str] = set()
    every: set[str] = set()
    for name, handle in axes.items():
        for path, recorded in _outputs(handle):
            output = f"{name}.{path}"
            every.add(output)
            if path in handle.paths_read or f"{name}.{recorded}" in looked_at:
                read.add(output)
    return frozenset(read), frozenset(every - read)


def _outputs(handle: AxisHandle) -> Iterator[tuple[str, str]]:
    """Yield the paths of outputs, each with the name under which a rule looks at it, or its own."""
    for path in handle.variables.paths("RON"):
        if "." in path and not path.startswith(_SHOWN):
            continue  # of the configuration
        bits = handle.variables.describe(path).bits
        if not bits:
            yield path, path
        for bit in bits:
            yield f"{path}.X{bit}", f"{_COLUMNS.get(path, path)}.X{bit}"
