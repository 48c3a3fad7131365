"""Digest of the source of a test: function, fixtures and helpers, without comments and layout."""

from __future__ import annotations

import ast
import hashlib
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from types import FunctionType, MethodType
from typing import TYPE_CHECKING, Final

import pytest

if TYPE_CHECKING:
    from collections.abc import Callable

_Definition = ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef | ast.Assign | ast.AnnAssign
_DOCUMENTED: Final = (ast.FunctionDef, ast.AsyncFunctionDef, ast.ClassDef)


def source_digest(item: pytest.Item) -> str:
    """Return SHA-256 over what a test is made of; empty where its source cannot be read.

    That is its function (of a class, the whole class), the fixtures of the project that it uses, and the
    functions, classes and constants of the same modules that these name.
    """
    if not isinstance(item, pytest.Function):
        return ""
    group = item.cls
    top = item.originalname if group is None else str(group.__qualname__).partition(".")[0]
    found = {item.path: {top}}
    for path, fixture in _fixtures(item):
        found.setdefault(path, set()).add(fixture)
    digest = hashlib.sha256()
    known = False
    for path, names in sorted(found.items()):
        for text in _texts(path, names):
            digest.update(text.encode("utf-8", "replace"))
            known = True
    return digest.hexdigest() if known else ""


def function_of(item: pytest.Item) -> Callable[..., object] | None:
    """Return the function of a test, not bound to an object; None: it is no function."""
    if not isinstance(item, pytest.Function):
        return None
    function: Callable[..., object] = item.obj
    return function.__func__ if isinstance(function, MethodType) else function


def _fixtures(item: pytest.Function) -> Iterator[tuple[Path, str]]:
    """Return file and name of every fixture of the project that a test uses."""
    for candidates in item._fixtureinfo.name2fixturedefs.values():  # noqa: SLF001 - the only place that knows
        for one in candidates:
            if not isinstance(one.func, FunctionType):
                continue
            code = one.func.__code__
            path = Path(code.co_filename)
            if path.is_relative_to(item.config.rootpath) and "site-packages" not in path.parts:
                yield path, code.co_name


def _texts(path: Path, names: set[str]) -> Iterator[str]:
    """Return the definitions of a module that have these names, and those that they name, in their order."""
    definitions = _definitions(path)
    wanted: set[str] = set()
    waiting = [name for name in names if name in definitions]
    while waiting:
        name = waiting.pop()
        if name not in wanted:
            wanted.add(name)
            waiting += [other for other in definitions[name][1] if other in definitions]
    for name in sorted(wanted):
        yield definitions[name][0]


@cache
def _definitions(path: Path) -> dict[str, tuple[str, frozenset[str]]]:
    """Return text and used names of every definition at the top of a module, by its name."""
    try:
        tree = ast.parse(path.read_bytes())
    except (OSError, SyntaxError, ValueError):
        return {}
    found: dict[str, tuple[str, frozenset[str]]] = {}
    for node in tree.body:
        if not isinstance(node, _Definition):
            continue
        for one in ast.walk(node):
            if isinstance(one, _DOCUMENTED) and ast.get_docstring(one, clean=False) is not None:
                one.body = one.body[1:] or [ast.Pass()]
        used = frozenset(one.id for one in ast.walk(node) if isinstance(one, ast.Name))
        for name in _names_of(node):
            before, others = found.get(name, ("", frozenset()))
            found[name] = (before + ast.dump(node), others | used)
    return found


def _names_of(node: _Definition) -> list[str]:
    if isinstance(node, ast.Assign):
        return [one.id for target in node.targets for one in ast.walk(target) if isinstance(one, ast.Name)]
    if isinstance(node, ast.AnnAssign):
        return [node.target.id] if isinstance(node.target, ast.Name) else []
    return [node.name]
