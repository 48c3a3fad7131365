"""Switching a defect on in the running process: the code of a function is replaced in
place, and put back afterwards.

The function object stays the same, so that the defect is in effect wherever the function is held already: in
a class, under an imported name, as a callback on the scheduler. What is compiled is the source of the
function with the change in it, and one call before the changed statement that tells that it has been reached.
"""

from __future__ import annotations
import __future__

import ast
import functools
import importlib
import inspect
import marshal
import textwrap
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from types import CodeType, FunctionType
from typing import Final

from fieldbus.errors import HilError
from hil.mutants._mutant import Edit, Mutant

HOOK: Final = "__mutant_reached__"
"""Global under which a changed function finds what notes it."""
_FLAGS: Final = __future__.annotations.compiler_flag


class TargetChangedError(HilError):
    """The code that a mutant changes is not what the catalogue says.

    Args:
        edit: The change.
        reason: What is different.

    """

    def __init__(self, edit: Edit, reason: str) -> None:
        super().__init__(
            f"{edit.target}: {reason}. The product has changed: bring the catalogue of mutants up to date"
        )
        self.edit = edit


@dataclass(frozen=True)
class _Change:
    """An edit made to source text: what to compile, and the line of the first difference."""

    edit: Edit
    source: str
    line: int


def function_of(edit: Edit) -> FunctionType:
    """Return the function that an edit changes, without what decorates it.

    Raises:
        TargetChangedError: It is not there.

    """
    module_name, _, path = edit.target.partition(":")
    try:
        found: object = importlib.import_module(module_name)
        for name in path.split("."):
            found = inspect.getattr_static(found, name)
    except (ImportError, AttributeError) as error:
        raise TargetChangedError(edit, str(error)) from error
    return _undecorated(edit, found)


def _undecorated(edit: Edit, found: object) -> FunctionType:
    while not isinstance(found, FunctionType) or hasattr(found, "__wrapped__"):
        inner = getattr(found, "__wrapped__", None)
        if isinstance(found, property):
            inner = found.fget
        elif isinstance(found, (staticmethod, classmethod)):
            inner = found.__func__
        elif isinstance(found, functools.cached_property):
            inner = found.func
        if inner is None:
            raise TargetChangedError(edit, f"it is a {type(found).__name__}, not a function")
        found = inner
    return found


def changed_source(edit: Edit, function: FunctionType) -> _Change:
    """Return the source of a function with an edit made; indentation counts as it is in the file.

    Raises:
        TargetChangedError: The old text does not stand there exactly once, or the new one is the same.

    """
    source = inspect.getsource(function)
    count = source.count(edit.old)
    if count != 1:
        raise TargetChangedError(edit, f"{edit.old!r} stands there {count} times, not once")
    shared = next(
        (at for at, (a, b) in enumerate(zip(edit.old, edit.new, strict=False)) if a != b),
        min(len(edit.old), len(edit.new)),
    )
    line = source.count("\n", 0, source.index(edit.old) + shared) + 1
    return _Change(edit, textwrap.dedent(source.replace(edit.old, edit.new)), line)


def _statement_lists(node: ast.AST) -> Iterator[list[ast.stmt]]:
    for _name, value in ast.iter_fields(node):
        inner = value if isinstance(value, list) else []
        if inner and isinstance(inner[0], ast.stmt):
            yield inner
        for one in inner:
            if isinstance(one, ast.ExceptHandler | ast.match_case):
                yield one.body


def _place(statements: list[ast.stmt], line: int) -> tuple[list[ast.stmt], int] | None:
    """Return the list that holds the innermost statement on a line, and its index there."""
    for index, statement in enumerate(statements):
        if statement.lineno <= line <= (statement.end_lineno or statement.lineno):
            for inner in _statement_lists(statement):
                found = _place(inner, line) if inner else None
                if found is not None:
                    return found
            return statements, index
    return None


def innermost(statements: list[ast.stmt], line: int) -> ast.stmt | None:
    """Return the innermost statement on a line; None: there is none."""
    found = _place(statements, line)
    return None if found is None else found[0][found[1]]


def _compiled(function: FunctionType, source: str, lines: Iterable[tuple[int, str]], edit: Edit) -> CodeType:
    """Return the code of a function from its source, with a note before the statements on these lines."""
    try:
        tree = ast.parse(source)
    except SyntaxError as error:
        raise TargetChangedError(edit, f"with the change it cannot be compiled: {error}") from error
    (definition,) = tree.body
    if not isinstance(definition, ast.FunctionDef):
        raise TargetChangedError(edit, "its source does not begin with a function")
    # From the last place to the first, so that an index found stays right.
    for line, name in sorted(lines, reverse=True):
        found = _place(definition.body, line)
        if found is None:
            raise TargetChangedError(edit, f"line {line} of it, which changes, is in no statement")
        statements, index = found
        note = ast.Expr(ast.Call(ast.Name(HOOK, ast.Load()), [ast.Constant(name)], []))
        statements.insert(index, ast.copy_location(note, statements[index]))
    return compiled(function, definition, edit)


def compiled(function: FunctionType, definition: ast.FunctionDef, edit: Edit) -> CodeType:
    """Return the code of a function from another definition of it, which is changed.

    Raises:
        TargetChangedError: It uses other variables from outside the function.

    """
    definition.decorator_list = []
    first = function.__code__.co_firstlineno
    ast.increment_lineno(definition, first - 1)
    free = function.__code__.co_freevars
    # A function around it gives it the variables that it has from outside, `__class__` of `super()` among
    # them.
    around = ast.parse(f"def around({', '.join(free)}): pass")
    (outer,) = around.body
    assert isinstance(outer, ast.FunctionDef)  # parsed just now
    outer.body = [definition]
    code = compile(
        ast.fix_missing_locations(around), function.__code__.co_filename, "exec", _FLAGS, dont_inherit=True
    )
    for constant in code.co_consts:
        if isinstance(constant, CodeType):
            for inner in constant.co_consts:
                if isinstance(inner, CodeType) and inner.co_name == function.__name__:
                    if inner.co_freevars != free:
                        raise TargetChangedError(
                            edit, "the change uses other variables from outside the function"
                        )
                    return inner.replace(co_qualname=function.__code__.co_qualname)
    raise TargetChangedError(edit, "it cannot be found in its own source")


@contextmanager
def _replaced(codes: dict[FunctionType, CodeType], note: object) -> Iterator[None]:
    """Give functions other code for a while.

    Args:
        codes: The code for each.
        note: What they find as `HOOK`.

    """
    before = {function: function.__code__ for function in codes}
    try:
        for function, code in codes.items():
            function.__globals__[HOOK] = note
            function.__code__ = code
        yield
    finally:
        for function, code in before.items():
            function.__code__ = code
            function.__globals__.pop(HOOK, None)


def _reached(names: set[str]) -> object:
    """Return what notes a statement that is reached."""
    return names.add


@dataclass(frozen=True)
class Patch:
    """Compiled code for functions; it can be sent to another process of the same interpreter, which need not
    compile it again.
    """

    places: tuple[tuple[Edit, bytes], ...] = ()
    """For each function one of the edits that lead to it, and its code."""
    note: Callable[[set[str]], object] = _reached
    """Makes what the functions find as `HOOK` from the set of names that they note."""

    @contextmanager
    def applied(self, reached: set[str]) -> Iterator[None]:
        """Give the functions this code, and what they had at the end.

        Args:
            reached: Gets the names of the mutants that are noted: whose changed statements are reached.

        Raises:
            TargetChangedError: A function is not there.

        """
        codes = {function_of(edit): marshal.loads(code) for edit, code in self.places}  # noqa: S302 - our own
        with _replaced(codes, self.note(reached)):
            yield


def defect_patch(mutant: Mutant) -> Patch:
    """Return the code with a defect in it.

    Raises:
        TargetChangedError: The code that it changes is not what the catalogue says.

    """
    codes: dict[FunctionType, tuple[Edit, bytes]] = {}
    for edit in mutant.edits:
        function = function_of(edit)
        if function in codes:
            raise TargetChangedError(edit, f"mutant {mutant.name} changes it twice; make that one change")
        change = changed_source(edit, function)
        code = _compiled(function, change.source, [(change.line, mutant.name)], edit)
        codes[function] = (edit, marshal.dumps(code))
    return Patch(tuple(codes.values()))


def watching_patch(mutants: Iterable[Mutant]) -> Patch:
    """Return code that tells where the places of defects are reached, and does nothing else otherwise.

    Raises:
        TargetChangedError: The code that one of them changes is not what the catalogue says.

    """
    places: dict[FunctionType, list[tuple[int, str]]] = {}
    edits: dict[FunctionType, Edit] = {}
    for mutant in mutants:
        for edit in mutant.edits:
            function = function_of(edit)
            change = changed_source(edit, function)
            # Compiled too, so that a change that cannot be made is reported before anything runs.
            _compiled(function, change.source, [(change.line, mutant.name)], edit)
            places.setdefault(function, []).append((change.line, mutant.name))
            edits[function] = edit
    return Patch(
        tuple(
            (
                edits[function],
                marshal.dumps(
                    _compiled(function, textwrap.dedent(inspect.getsource(function)), lines, edits[function])
                ),
            )
            for function, lines in places.items()
        )
    )


@contextmanager
def seeded(mutant: Mutant, reached: set[str]) -> Iterator[None]:
    """Switch a defect on, and off again at the end.

    Args:
        mutant: The defect.
        reached: Gets its name when one of the changed statements is reached.

    Raises:
        TargetChangedError: The code that it changes is not what the catalogue says.

    """
    with defect_patch(mutant).applied(reached):
        yield


@contextmanager
def watched(mutants: Iterable[Mutant], reached: set[str]) -> Iterator[None]:
    """Let the places of defects tell that they are reached, with nothing changed otherwise.

    Args:
        mutants: The defects, none of which is switched on.
        reached: Gets the names of those whose changed statement would have been reached.

    Raises:
        TargetChangedError: The code that one of them changes is not what the catalogue says.

    """
    with watching_patch(mutants).applied(reached):
        yield
