"""Defects drawn by a program from the source of the product: nobody has chosen them, so no campaign can be
fitted to them.
"""

from __future__ import annotations

import ast
import hashlib
import inspect
import pkgutil
import random
import re
import tomllib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from importlib import import_module
from importlib.resources import files
from typing import Final

from hil.errors import CannotRunError
from hil.mutants._mutant import PACKAGES, Edit, Mutant
from hil.mutants._operators import OPERATORS, Replacement, replacements
from hil.mutants._patch import TargetChangedError, defect_patch, function_of

_LEFT_OUT: Final = frozenset({"__repr__", "__str__", "__hash__", "__eq__", "summary", "describe"})
"""Functions for people who read, and not for drives and controllers."""
_EQUIVALENTS: Final = "equivalent_mutants.toml"
_LIVE_CODE: Final = "live_code.toml"
_IDENTIFIER: Final = re.compile(r"\b([A-Z][A-Z0-9]{1,4})-(\d{3})\b(?:\s+to\s+(?:\1-)?(\d{3})\b)?")
"""Of one requirement, or of several in a row: `MC-052 to MC-070`."""
_LONGEST_RANGE: Final = 60


@dataclass(frozen=True)
class _Place:
    """A statement with the changes that it allows."""

    module: str
    path: str
    """`function` or `Class.method`."""
    first: int
    """Line of the function in its file."""
    changes: tuple[Replacement, ...]


def draw(number: int, seed: int, areas: Sequence[str] = ()) -> list[Mutant]:
    """Return defects drawn from the source of the product.

    Packages take part by the number of their statements; within a package every statement is as likely as
    another, then every operator that fits it, then every place. The same source, seed and areas give the same
    defects.

    Args:
        number: How many.
        seed: Of the draw.
        areas: Packages or modules that take part, `motion` or `emulators.drive`; none: all of `PACKAGES`.
            `live_code` takes no part.

    Raises:
        CannotRunError: An area is none, or has fewer statements.

    """
    chosen = packages_of(areas)
    by_package = {name: list(_places(name, areas)) for name in chosen}
    total = sum(map(len, by_package.values()))
    if number > total:
        raise CannotRunError(f"--mechanical {number}: there are only {total} statements to change")
    drawn: list[Mutant] = []
    taken = 0
    for name, places in by_package.items():
        taken += len(places)
        share = round(number * taken / total) - len(drawn)
        drawn += _draw_from(places, share, random.Random(f"{seed} {name}"))  # noqa: S311 - no secret
    return drawn


def _draw_from(places: list[_Place], number: int, source: random.Random) -> Iterator[Mutant]:
    order = source.sample(places, len(places))
    for place in order:
        if number <= 0:
            return
        by_operator: dict[str, list[Replacement]] = {}
        for change in place.changes:
            by_operator.setdefault(change.operator, []).append(change)
        operator = source.choice(sorted(by_operator))
        mutant = _mutant(place, source.choice(by_operator[operator]))
        try:
            defect_patch(mutant)
        except TargetChangedError:
            continue  # it cannot be switched on in place: a function that is made anew for every object
        number -= 1
        yield mutant


def packages_of(areas: Sequence[str]) -> list[str]:
    """Return the packages that areas are in; no areas: all of `PACKAGES`.

    Raises:
        CannotRunError: An area is in none of them.

    """
    for area in areas:
        package = area.partition(".")[0]
        if package not in PACKAGES:
            raise CannotRunError(
                f"--area {area!r} is not allowed with --mechanical; allowed: {', '.join(PACKAGES)}, or a "
                f"module of them such as emulators.drive"
            )
    return [name for name in PACKAGES if not areas or any(one.partition(".")[0] == name for one in areas)]


def _places(package: str, areas: Sequence[str]) -> Iterator[_Place]:
    """Yield the statements of a package that can be changed and that a virtual bench can run."""
    for name in modules_of_package(package, areas):
        for place in _places_of(name):
            if f"{name}:{place.path.partition('.')[0]}" not in live_code():
                yield place


def modules_of_package(package: str, areas: Sequence[str]) -> list[str]:
    """Return the modules of a package that are in the areas, without those that no virtual bench runs.

    Raises:
        CannotRunError: There are none.

    """
    inside = [area for area in areas if area.partition(".")[0] == package]
    root = import_module(package)
    names = [
        one.name
        for one in pkgutil.walk_packages(root.__path__, f"{package}.")
        if not inside or any(one.name == area or one.name.startswith(f"{area}.") for area in inside)
    ]
    if not names:
        raise CannotRunError(f"--area {inside[0]!r}: there is no such module")
    return sorted(name for name in names if name not in live_code())


@cache
def _places_of(module: str) -> tuple[_Place, ...]:
    try:
        source = inspect.getsource(import_module(module))
    except (ImportError, OSError):  # what an optional package or another system is needed for
        return ()
    lines = source.splitlines()
    return tuple(
        _Place(module, path, function.lineno, tuple(changes))
        for path, function in _functions(ast.parse(source).body, "")
        for changes in _by_statement(function, lines)
    )


def _by_statement(function: ast.FunctionDef, lines: list[str]) -> Iterator[list[Replacement]]:
    by_line: dict[int, list[Replacement]] = {}
    for change in replacements(function, lines):
        by_line.setdefault(change.statement, []).append(change)
    yield from by_line.values()


def _functions(body: Sequence[ast.stmt], prefix: str) -> Iterator[tuple[str, ast.FunctionDef]]:
    """Yield the functions of a module and the methods of its classes."""
    for node in body:
        if isinstance(node, ast.ClassDef):
            yield from _functions(node.body, f"{prefix}{node.name}.")
        elif isinstance(node, ast.FunctionDef) and node.name not in _LEFT_OUT and not _is_overload(node):
            yield f"{prefix}{node.name}", node


def _is_overload(function: ast.FunctionDef) -> bool:
    names = {ast.unparse(one).rpartition(".")[2] for one in function.decorator_list}
    return not names.isdisjoint({"overload", "abstractmethod", "setter"})


def _mutant(place: _Place, change: Replacement) -> Mutant:
    """Return the defect for a change."""
    old, new = _edited(place, change)
    target = f"{place.module}:{place.path}"
    digest = hashlib.sha256(f"{old}\0{new}".encode()).hexdigest()[:8]
    name = f"{place.module}.{place.path}/{change.operator}-{digest}"
    return Mutant(
        name=name,
        area=place.module.partition(".")[0],
        title=OPERATORS[change.operator],
        edits=(Edit(target, old, new),),
        requirements=_named_near(place.module, place.path),
        explained=equivalents().get(name, ""),
        operator=change.operator,
    )


@cache
def _named_near(module: str, path: str) -> tuple[str, ...]:
    """Return the identifiers of requirements that the source of a function names; of its class, or of its
    module, where it names none.
    """
    imported = import_module(module)
    texts = [inspect.getsource(function_of(Edit(f"{module}:{path}", "", " ")))]
    owner = path.rpartition(".")[0]
    if owner:
        texts.append(inspect.getdoc(vars(imported).get(owner.partition(".")[0])) or "")
    texts.append(inspect.getdoc(imported) or "")
    return next((found for text in texts if (found := _identifiers(text))), ())


def _identifiers(text: str) -> tuple[str, ...]:
    found: dict[str, None] = {}
    for match in _IDENTIFIER.finditer(text):
        prefix, first, last = match.groups()
        numbers = range(int(first), min(int(last or first), int(first) + _LONGEST_RANGE) + 1)
        found.update(dict.fromkeys(f"{prefix}-{number:03d}" for number in numbers))
    return tuple(found)


def _edited(place: _Place, change: Replacement) -> tuple[str, str]:
    """Return the present and the new text: whole lines, as many as make the text unique in its function."""
    function = function_of(Edit(f"{place.module}:{place.path}", "", " "))
    text = inspect.getsource(function)
    lines = text.splitlines(keepends=True)
    first = function.__code__.co_firstlineno
    begin, end = change.start[0] - first, change.end[0] - first
    changed = list(lines)
    tail = lines[end][change.end[1] :]
    changed[begin : end + 1] = [lines[begin][: change.start[1]] + change.text + tail]
    low, high = begin, end + 1
    while text.count("".join(lines[low:high])) != 1:
        low, high = max(low - 1, 0), min(high + 1, len(lines))
    extra = high - end - 1
    stop = begin + 1 + extra
    return "".join(lines[low:high]), "".join(changed[low:stop])


@cache
def equivalents() -> Mapping[str, str]:
    """Return the defects that no test can notice, each with the reason, by name.

    A name holds the operator, the place, and a digest of the text: a reason is void when the text changes.
    """
    text = files("hil").joinpath("data", _EQUIVALENTS).read_text(encoding="utf-8")
    return {entry["name"]: entry["reason"] for entry in tomllib.loads(text).get("mutant", [])}


@cache
def live_code() -> Mapping[str, str]:
    """Return the modules (`fieldbus.can.live`) and classes (`fieldbus.clock:RealtimeScheduler`) that no bench
    in virtual time runs, each with the reason.
    """
    text = files("hil").joinpath("data", _LIVE_CODE).read_text(encoding="utf-8")
    return {entry["name"]: entry["reason"] for entry in tomllib.loads(text)["code"]}
