"""All defects, by name."""

from __future__ import annotations

import importlib
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Final

from hil.errors import CannotRunError
from hil.mutants import _axis, _bus, _cia402, _control, _limits_homing, _machine, _nc, _profidrive, _setpoints
from hil.mutants._mutant import AREAS, Mutant
from hil.mutants._plan import closest


def by_name(mutants: Sequence[Mutant]) -> dict[str, Mutant]:
    """Return mutants by their names.

    Raises:
        CannotRunError: Two have the same name.

    """
    found: dict[str, Mutant] = {}
    for mutant in mutants:
        if mutant.name in found:
            raise CannotRunError(f"there are two mutants {mutant.name!r}")
        found[mutant.name] = mutant
    return found


CATALOGUE: Final[Mapping[str, Mutant]] = by_name(
    [
        *_cia402.MUTANTS, *_profidrive.MUTANTS, *_axis.MUTANTS, *_control.MUTANTS, *_setpoints.MUTANTS,
        *_limits_homing.MUTANTS, *_nc.MUTANTS, *_machine.MUTANTS, *_bus.MUTANTS,
    ]
)  # fmt: skip
"""The defects that ship with the product, area by area."""


def load_catalogue(reference: str) -> Mapping[str, Mutant]:
    """Return a catalogue; empty: the one that ships with the product.

    Args:
        reference: `package.module:NAME` or `file.py:NAME` of a list of mutants; without a name `MUTANTS`.
            Modules of the current folder are found.

    Raises:
        CannotRunError: There is none, or it holds something else.

    """
    if not reference:
        return CATALOGUE
    where, _, name = reference.partition(":")
    path = Path(where)
    if path.suffix == ".py" or (path.parent == Path() and path.with_suffix(".py").is_file()):
        path = path.with_suffix(".py").resolve()
        where = path.stem
        if not path.is_file():
            raise CannotRunError(f"catalogue {reference!r}: there is no file {path}")
        if str(path.parent) not in sys.path:
            sys.path.append(str(path.parent))  # worker processes get it, too
    try:
        found = getattr(importlib.import_module(where), name or "MUTANTS")
    except (ImportError, AttributeError, ValueError) as error:
        raise CannotRunError(f"catalogue {reference!r}: {error}") from error
    if not isinstance(found, (list, tuple)) or not all(isinstance(one, Mutant) for one in found):
        raise CannotRunError(f"catalogue {reference!r} is no list of hil.mutants.Mutant")
    return by_name(found)


def select_mutants(
    catalogue: Mapping[str, Mutant], *, names: Sequence[str] = (), areas: Sequence[str] = ()
) -> list[Mutant]:
    """Return the mutants with these names, or all, of these areas, or all.

    Raises:
        CannotRunError: A name or area is unknown, or nothing is left.

    """
    for name in names:
        if name not in catalogue:
            raise CannotRunError(f"there is no mutant {name!r}{closest(name, catalogue)}")
    for area in areas:
        if area not in AREAS:
            raise CannotRunError(f"--area {area!r} is not allowed; allowed: {', '.join(AREAS)}")
    chosen = [
        mutant
        for mutant in catalogue.values()
        if (not names or mutant.name in names) and (not areas or mutant.area in areas)
    ]
    if not chosen:
        raise CannotRunError(f"none of {len(catalogue)} mutants fits the selection")
    return chosen
