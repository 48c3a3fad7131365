"""What the product cannot do yet, as its documentation lists it."""

from __future__ import annotations

from pathlib import Path
from typing import Final

from hil.errors import CannotRunError

_PLACES: Final = (
    Path(__file__).parent / "data" / "features.md",  # in the wheel
    Path(__file__).parents[1] / "docs" / "reference" / "features.md",  # in a checkout
)
_LAST: Final = "not yet"
"""Heading of the last column of the table."""


def known_limits() -> list[tuple[str, str]]:
    """Return each area of the product with what it lacks there.

    Raises:
        CannotRunError: The file is missing, or has no such table.

    """
    path = next((one for one in _PLACES if one.is_file()), None)
    if path is None:
        raise CannotRunError(
            "the list of known limits, features.md, is missing: the installation is not complete"
        )
    rows = [
        [cell.strip() for cell in line.strip().strip("|").split("|")]
        for line in path.read_text(encoding="utf-8").splitlines()
        if line.startswith("|")
    ]
    if not rows or rows[0][-1] != _LAST:
        raise CannotRunError(f"{path}: there is no table whose last column is {_LAST!r}")
    return [(row[0], row[-1]) for row in rows[2:] if row[-1]]
