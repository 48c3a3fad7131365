"""Entry points of `motion-hil`, and the check that Python finds its packages and no others of the same names.

The packages have plain import names (`motion`, `reports`, ...) that a user's project may have too.
Python then finds one of the two only, and anything may fail to import. This module has the name of
the distribution: the command and the pytest plugin start in any project and can say in one sentence
what is wrong.
"""

from __future__ import annotations

import importlib.util
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Final

PACKAGES: Final = ("fieldbus", "emulators", "motion", "hil", "reports", "testcases")
"""Import names of the distribution."""
_HERE: Final = Path(__file__).resolve().parent
_NEEDED: Final = PACKAGES[:-1]
"""What the product cannot do without; `testcases` has the shipped campaigns only."""


def hidden() -> str:
    """Return a sentence about the first package that another one of the same name hides; empty: none is."""
    for name in _NEEDED:
        found = _found(name)
        if found is not None and not _is_ours(found):
            return _sentence(found, _HERE / name / "__init__.py", name)
    return ""


def explain(error: BaseException) -> str:
    """Return a sentence about an import that failed because two packages share a name; empty: it did not.

    Args:
        error: An exception, with its causes.

    """
    for name in filter(None, map(_package_of, _chain(error))):
        found = _found(name)
        if found is None:
            continue
        if not _is_ours(found):
            return _sentence(found, _HERE / name / "__init__.py", name)
        for theirs in _others(name):
            return _sentence(found, theirs, name)
    return ""


def _chain(error: BaseException | None) -> Iterator[BaseException]:
    seen: set[int] = set()
    while error is not None and id(error) not in seen:
        seen.add(id(error))
        yield error
        error = error.__cause__ or error.__context__


def _package_of(error: BaseException) -> str:
    """Return which of our names an exception is about; empty: none."""
    name = ""
    if isinstance(error, ModuleNotFoundError):
        name = (error.name or "").partition(".")[0]
    elif isinstance(error, ImportError):
        name = error.name or ""
    elif isinstance(error, AttributeError) and isinstance(error.obj, type(sys)):
        name = error.obj.__name__
    return name if name in PACKAGES else ""


def _found(name: str) -> Path | None:
    """Return the file that `import name` leads to now, or the folder of a package without `__init__.py`."""
    module = sys.modules.get(name)
    if module is not None:
        file, folders = getattr(module, "__file__", None), list(getattr(module, "__path__", ()))
    else:
        try:
            spec = importlib.util.find_spec(name)
        except (ImportError, ValueError):
            return None
        if spec is None:
            return None
        file, folders = spec.origin, list(spec.submodule_search_locations or ())
    place = file or next(iter(folders), None)
    return Path(place).resolve() if place else None


def _is_ours(found: Path) -> bool:
    """Return whether a package belongs to this distribution, or to another copy of it, such as a checkout."""
    top = found.parent.parent if found.name == "__init__.py" else found.parent
    return top == _HERE or (top / "hil" / "pytest_plugin.py").is_file()


def _others(name: str) -> Iterator[Path]:
    """Return the modules and packages of a name on the path, and in the current folder, that are not ours."""
    for entry in dict.fromkeys(Path(text or ".").resolve() for text in [*sys.path, ""]):
        for place in (entry / name / "__init__.py", entry / f"{name}.py", entry / name):
            if (place.is_file() or any(place.glob("*.py"))) and not _is_ours(place):
                yield place


def _sentence(first: Path, second: Path, name: str) -> str:
    hides = (
        f"{first} of motion-hil hides {second}"
        if _is_ours(first)
        else f"{first} hides {second} of motion-hil"
    )
    return (
        f"{hides}, because both are imported as {name!r}: rename yours, or move it into "
        f"a package of your own (my_machine.{name})"
    )


def main() -> int:
    """Run the command `hil` and return its exit code."""
    found = _found("hil")
    if found is not None and not _is_ours(found):
        print(f"hil: {hidden()}", file=sys.stderr)  # noqa: T201 - the answer
        return 2
    from hil.cli import main as run

    return run()


def __getattr__(name: str) -> object:
    """Load the pytest plugin for pytest, which looks for `motion_hil:plugin`."""
    if name != "plugin":
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    found = _found("hil")
    if found is not None and not _is_ours(found):
        import pytest

        raise pytest.UsageError(f"{hidden()}; tests that need no bench run with `pytest -p no:hil`")
    return importlib.import_module("hil.pytest_plugin")


if __name__ == "__main__":
    sys.exit(main())
