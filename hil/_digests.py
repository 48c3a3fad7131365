"""Digests of the product: which state of it has run."""

from __future__ import annotations

import hashlib
import importlib.util
from functools import cache
from pathlib import Path
from typing import Final

from hil.errors import CannotRunError

PACKAGES: Final = ("fieldbus", "emulators", "motion", "hil", "reports", "testcases.campaigns")
"""Packages of the product."""


@cache
def package_digest(name: str) -> str:
    """Return SHA-256 over names and contents of the files of a package, without what running it leaves.

    Raises:
        CannotRunError: There is no such package.

    """
    spec = importlib.util.find_spec(name)
    if spec is None or spec.submodule_search_locations is None:
        raise CannotRunError(f"the package {name} is not there")
    total = hashlib.sha256()
    for place in spec.submodule_search_locations:
        root = Path(place)
        for path in sorted(root.rglob("*")):
            if path.is_file() and path.suffix != ".pyc":
                total.update(path.relative_to(root).as_posix().encode() + b"\0")
                total.update(path.read_bytes())
    return total.hexdigest()


def product_digest() -> str:
    """Return SHA-256 over the digests of all packages of the product."""
    lines = (f"{name} {package_digest(name)}\n" for name in PACKAGES)
    return hashlib.sha256("".join(lines).encode()).hexdigest()
