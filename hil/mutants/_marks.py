"""Marks in the code of the product that tell which of its statements a case comes to.

A mark stands at the beginning of every block of statements, and after every statement of a block that may
leave it. All functions of a module get them with one compilation; the cost of a mark is that of a store into
an array of bytes.
"""

from __future__ import annotations

import ast
import hashlib
import importlib
import inspect
import marshal
import pkgutil
import textwrap
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from functools import cache
from types import CodeType, FunctionType, ModuleType
from typing import Final

from hil.mutants._mutant import PACKAGES, Edit, Mutant
from hil.mutants._patch import TargetChangedError, changed_source, function_of

_ARRAY: Final = "__mutant_marks__"
"""Global of a module under which its functions find their marks."""
_FUNCTIONS: Final = (ast.FunctionDef, ast.AsyncFunctionDef)
_LEAVING: Final = (ast.Return, ast.Raise, ast.Break, ast.Continue)


@dataclass(frozen=True)
class Marked:
    """A module with marks in its functions."""

    name: str
    digest: str
    """Of its source."""
    code: bytes
    """The compiled module."""
    total: int
    """How many marks it has."""
    by_line: Mapping[int, int]
    """For the first line of every statement of a function the mark that tells whether it is reached."""
    classes: Mapping[str, range]
    """Lines of its classes, by name."""


def product_modules() -> list[str]:
    """Return the names of all modules of the product that may have defects."""
    names: list[str] = []
    for package in PACKAGES:
        root = importlib.import_module(package)
        names += [package, *(one.name for one in pkgutil.walk_packages(root.__path__, f"{package}."))]
    return sorted(names)


@cache
def source_digest(module: str) -> str:
    """Return a digest of the source of a module; empty: it has none, or cannot be imported here."""
    try:
        source = inspect.getsource(importlib.import_module(module))
    except (ImportError, OSError):
        return ""
    return hashlib.sha256(source.encode()).hexdigest()[:12]


@cache
def marked(module: str) -> Marked | None:
    """Return a module with marks; None: it has no source, or cannot be imported here."""
    try:
        imported = importlib.import_module(module)
        source = inspect.getsource(imported)
    except (ImportError, OSError):
        return None
    tree = ast.parse(source)
    classes = {
        node.name: range(node.lineno, (node.end_lineno or node.lineno) + 1)
        for node in tree.body
        if isinstance(node, ast.ClassDef)
    }
    bodies = [node.body for node in ast.walk(tree) if isinstance(node, _FUNCTIONS)]
    blocks = [block for body in bodies for block in _blocks(body)]
    by_line: dict[int, int] = {}
    total = 0
    for block in blocks:
        starts = {at: total + index for index, at in enumerate(_starts(block))}
        total += len(starts)
        current = 0
        for at, statement in enumerate(block):
            current = starts.get(at, current)
            by_line.setdefault(statement.lineno, current)
        for at in reversed(starts):
            block.insert(at, _mark(starts[at], block[at]))
    file = inspect.getsourcefile(imported) or module
    code = compile(ast.fix_missing_locations(tree), file, "exec", dont_inherit=True)
    return Marked(module, source_digest(module), marshal.dumps(code), total, by_line, classes)


def _blocks(body: list[ast.stmt]) -> Iterator[list[ast.stmt]]:
    """Yield a block and those in it, without those of functions and classes in it."""
    yield body
    for statement in body:
        if isinstance(statement, (*_FUNCTIONS, ast.ClassDef)):
            continue
        for _, value in ast.iter_fields(statement):
            inner = value if isinstance(value, list) else []
            if inner and isinstance(inner[0], ast.stmt):
                yield from _blocks(inner)
            for one in inner:
                if isinstance(one, (ast.ExceptHandler, ast.match_case)):
                    yield from _blocks(one.body)


def _starts(body: list[ast.stmt]) -> list[int]:
    """Return the places in a block before which a mark has to stand."""
    return [0] + [
        at + 1
        for at, statement in enumerate(body[:-1])
        if any(isinstance(node, _LEAVING) for node in ast.walk(statement))
    ]


def _mark(number: int, before: ast.stmt) -> ast.stmt:
    """Return the statement that sets a mark."""
    (mark,) = ast.parse(f"{_ARRAY}[{number}] = 1").body
    for node in ast.walk(mark):
        if isinstance(node, (ast.stmt, ast.expr)):
            ast.copy_location(node, before)
    return mark


@dataclass(frozen=True)
class Marks:
    """Marks in modules; they travel to the processes that run cases."""

    modules: tuple[Marked, ...]

    @contextmanager
    def applied(self) -> Iterator[list[bytearray]]:
        """Give the functions of the modules code with marks, and what they had at the end; yields an array
        for each module, in which a mark that is passed becomes 1.

        The arrays stay in the modules: functions that were made meanwhile still use them.
        """
        arrays = [bytearray(one.total) for one in self.modules]
        before: dict[FunctionType, CodeType] = {}
        try:
            for one, array in zip(self.modules, arrays, strict=True):
                module = importlib.import_module(one.name)
                setattr(module, _ARRAY, array)
                codes = _codes(marshal.loads(one.code))  # noqa: S302 - our own
                for function in _functions(module, codes):
                    before[function] = function.__code__
                    function.__code__ = codes[function.__qualname__, function.__code__.co_firstlineno]
            yield arrays
        finally:
            for function, code in before.items():
                function.__code__ = code


def _codes(code: CodeType) -> dict[tuple[str, int], CodeType]:
    """Return the code objects in a compiled module, by qualified name and first line."""
    found: dict[tuple[str, int], CodeType] = {}
    for constant in code.co_consts:
        if isinstance(constant, CodeType):
            found[constant.co_qualname, constant.co_firstlineno] = constant
            found.update(_codes(constant))
    return found


def _functions(module: ModuleType, codes: dict[tuple[str, int], CodeType]) -> Iterator[FunctionType]:
    """Yield the functions of a module that a changed code fits."""
    for path in _paths(module.__name__, vars(module), ""):
        with suppress(TargetChangedError):
            function = function_of(Edit(f"{module.__name__}:{path}", "", " "))
            code = codes.get((function.__qualname__, function.__code__.co_firstlineno))
            if code is not None and function.__code__.co_freevars == code.co_freevars:
                yield function


def _paths(module: str, names: Mapping[str, object], prefix: str) -> Iterator[str]:
    """Yield the paths of what a module itself defines."""
    for name, value in list(names.items()):
        if isinstance(value, type):
            if value.__module__ == module and value.__qualname__ == f"{prefix}{name}":
                yield from _paths(module, vars(value), f"{prefix}{name}.")
        elif prefix or getattr(value, "__module__", module) == module:
            yield f"{prefix}{name}"


def packed(array: bytes | bytearray) -> bytes:
    """Return marks, a byte each, as bits."""
    result = bytearray((len(array) + 7) // 8)
    for at, value in enumerate(array):
        if value:
            result[at >> 3] |= 1 << (at & 7)
    return bytes(result)


def marks_of(modules: Iterable[str]) -> Marks:
    """Return marks in modules; those without a source are left out."""
    return Marks(tuple(one for name in modules if (one := marked(name)) is not None))


@dataclass(frozen=True)
class Place:
    """Where a defect is: a module and one of its marks."""

    module: str
    mark: int


def places_of(mutant: Mutant) -> Sequence[Place]:
    """Return the places that a case has to come to, one of them, to notice a defect.

    Raises:
        TargetChangedError: The code that it changes is not what the catalogue says.

    """
    places = []
    for edit in mutant.edits:
        function = function_of(edit)
        change = changed_source(edit, function)
        first = function.__code__.co_firstlineno
        line = first + _statement_line(inspect.getsource(function), change.line) - 1
        module = edit.target.partition(":")[0]
        found = marked(module)
        mark = None if found is None else found.by_line.get(line)
        if mark is None:
            raise TargetChangedError(edit, f"line {line} of {module}, which changes, is in no statement")
        places.append(Place(module, mark))
    return places


def _statement_line(source: str, line: int) -> int:
    """Return the first line of the innermost statement of a function that a line belongs to."""
    (definition,) = ast.parse(textwrap.dedent(source)).body
    best = line
    size: int | None = None
    for node in ast.walk(definition):
        if isinstance(node, ast.stmt) and node is not definition:
            end = node.end_lineno or node.lineno
            if node.lineno <= line <= end and (size is None or end - node.lineno < size):
                best, size = node.lineno, end - node.lineno
    return best
