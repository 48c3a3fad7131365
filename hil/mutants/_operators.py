"""Mutation operators: what a program changes in the source of a function, one place at a time.

They are the operators that the literature of mutation testing has found to stand for real mistakes:
relational and logical operators, arithmetic operators and signs, constants, removed statements, swapped
arguments, minimum and maximum, and a return before the end (Offutt et al., "An experimental determination of
sufficient mutant operators", 1996; Jia and Harman, "An analysis and survey of the development of mutation
testing", 2011).
"""

from __future__ import annotations

import ast
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final

BORDER: Final = {ast.Lt: "<=", ast.LtE: "<", ast.Gt: ">=", ast.GtE: ">"}
DIRECTION: Final = {
    ast.Lt: ">",
    ast.LtE: ">=",
    ast.Gt: "<",
    ast.GtE: "<=",
    ast.Eq: "!=",
    ast.NotEq: "==",
    ast.Is: "is not",
    ast.IsNot: "is",
    ast.In: "not in",
    ast.NotIn: "in",
}
ARITHMETIC: Final = {
    ast.Mult: "/",
    ast.Div: "*",
    ast.FloorDiv: "*",
    ast.LShift: ">>",
    ast.RShift: "<<",
    ast.BitAnd: "|",
    ast.BitOr: "&",
    ast.BitXor: "&",
}
OPERATORS: Final = {
    "border": "a comparison takes its border in, or leaves it out",
    "relation": "a comparison is turned round",
    "sign": "plus and minus change places, or a minus is lost",
    "arithmetic": "times and divided by, shifts, or bit operators change places",
    "constant": "a number is one step larger, or a truth value is the other one",
    "logic": "`and` and `or` change places, or a `not` is lost",
    "call": "a call is left out",
    "assignment": "an assignment to an attribute or element is left out: it keeps its old value",
    "arguments": "two neighbouring arguments of a call change places",
    "extreme": "minimum and maximum change places",
    "return": "the function ends before its last statements",
}
"""Operators and what they do."""
_NO_LOGIC: Final = (ast.Raise, ast.JoinedStr, ast.Assert, ast.Import, ast.ImportFrom, ast.AnnAssign)


@dataclass(frozen=True)
class Replacement:
    """A change of one place.

    Positions are line and column in characters, lines from 1, in the source that was parsed.
    """

    operator: str
    start: tuple[int, int]
    end: tuple[int, int]
    text: str
    statement: int
    """Line of the statement that it is in."""


def replacements(function: ast.FunctionDef, lines: list[str]) -> Iterator[Replacement]:
    """Yield every change of a function.

    Left out are docstrings, messages of exceptions, formatted texts, assertions, annotations and defaults of
    arguments: nothing that a drive or a controller does depends on them.

    Args:
        function: The parsed function.
        lines: Lines of the source that it was parsed from.

    """
    source = _Source(lines)
    body = function.body
    if isinstance(body[0], ast.Expr) and isinstance(body[0].value, ast.Constant):
        body = body[1:]
    for statement in body:
        for change in _of_statement(statement, source):
            # An attribute that is never made is no defect that anybody could overlook.
            if change.operator != "assignment" or function.name != "__init__":
                yield change
    returns = any(isinstance(node, ast.Return) and node.value is not None for node in ast.walk(function))
    # Behind a last text, the description of an attribute, there is nothing that could be left out.
    acting = [one for one in body if not (isinstance(one, ast.Expr) and isinstance(one.value, ast.Constant))]
    if len(acting) > 1 and not returns and not _is_generator(function):
        last = acting[-1]
        start = source.start(last)
        indent = " " * start[1]
        yield Replacement("return", start, start, f"return\n{indent}", last.lineno)


def _is_generator(function: ast.FunctionDef) -> bool:
    return any(isinstance(node, (ast.Yield, ast.YieldFrom)) for node in ast.walk(function))


class _Source:
    """Positions of nodes in characters; the parser counts bytes."""

    def __init__(self, lines: list[str]) -> None:
        self._lines = lines

    def start(self, node: ast.expr | ast.stmt) -> tuple[int, int]:
        return node.lineno, self._column(node.lineno, node.col_offset)

    def end(self, node: ast.expr | ast.stmt) -> tuple[int, int]:
        line, offset = node.end_lineno, node.end_col_offset
        assert line is not None  # the parser gives both
        assert offset is not None
        return line, self._column(line, offset)

    def _column(self, line: int, offset: int) -> int:
        return len(self._lines[line - 1].encode()[:offset].decode())

    def text(self, node: ast.expr) -> str:
        """Return the source of an expression."""
        (first, left), (last, right) = self.start(node), self.end(node)
        if first == last:
            return self._lines[first - 1][left:right]
        middle = self._lines[first : last - 1]
        return "\n".join([self._lines[first - 1][left:], *middle, self._lines[last - 1][:right]])

    def between(
        self, left: ast.expr, right: ast.expr, text: str
    ) -> tuple[tuple[int, int], tuple[int, int]] | None:
        """Return where an operator stands between two expressions; None: not in one piece of one line."""
        line, column = self.end(left)
        stop_line, stop = self.start(right)
        for number in range(line, stop_line + 1):
            whole = self._lines[number - 1]
            begin = column if number == line else 0
            finish = stop if number == stop_line else len(whole)
            part = whole[begin:finish].partition("#")[0]
            at = part.find(text)
            if at >= 0:
                return (number, begin + at), (number, begin + at + len(text))
        return None


_COMPARISON: Final = {
    ast.Lt: "<",
    ast.LtE: "<=",
    ast.Gt: ">",
    ast.GtE: ">=",
    ast.Eq: "==",
    ast.NotEq: "!=",
    ast.Is: "is",
    ast.IsNot: "is not",
    ast.In: "in",
    ast.NotIn: "not in",
}
_SYMBOL: Final = {
    ast.Add: "+",
    ast.Sub: "-",
    ast.Mult: "*",
    ast.Div: "/",
    ast.FloorDiv: "//",
    ast.LShift: "<<",
    ast.RShift: ">>",
    ast.BitAnd: "&",
    ast.BitOr: "|",
    ast.BitXor: "^",
}


def _of_statement(statement: ast.stmt, source: _Source) -> Iterator[Replacement]:
    """Yield the changes of a statement and of those in it."""
    if isinstance(statement, _NO_LOGIC):
        return
    at = statement.lineno
    if isinstance(statement, (ast.FunctionDef, ast.ClassDef)):
        for inner in statement.body:
            yield from _of_statement(inner, source)
        return
    place = source.start(statement), source.end(statement)
    if isinstance(statement, ast.Expr):
        if isinstance(statement.value, ast.Constant):
            return  # a text between statements
        if isinstance(statement.value, ast.Call):
            yield Replacement("call", *place, "pass", at)
    if isinstance(statement, (ast.Assign, ast.AugAssign)):
        targets = statement.targets if isinstance(statement, ast.Assign) else [statement.target]
        if all(isinstance(target, (ast.Attribute, ast.Subscript)) for target in targets):
            yield Replacement("assignment", *place, "pass", at)
    if isinstance(statement, ast.AugAssign) and isinstance(statement.op, (ast.Add, ast.Sub)):
        symbol, other = ("+=", "-=") if isinstance(statement.op, ast.Add) else ("-=", "+=")
        found = source.between(statement.target, statement.value, symbol)
        if found is not None:
            yield Replacement("sign", *found, other, at)
    for _, value in ast.iter_fields(statement):
        for part in value if isinstance(value, list) else [value]:
            if isinstance(part, ast.stmt):
                yield from _of_statement(part, source)
            elif isinstance(part, (ast.ExceptHandler, ast.match_case)):
                for inner in part.body:
                    yield from _of_statement(inner, source)
            elif isinstance(part, ast.withitem):
                yield from _of_expression(part.context_expr, source, at)
            elif isinstance(part, ast.expr):
                yield from _of_expression(part, source, at)


def _of_expression(node: ast.expr, source: _Source, at: int) -> Iterator[Replacement]:
    """Yield the changes of an expression and of those in it."""
    if isinstance(node, _NO_LOGIC):
        return
    place = source.start(node), source.end(node)
    match node:
        case ast.Compare(left=left, ops=[op], comparators=[right]):
            found = source.between(left, right, _COMPARISON[type(op)])
            if found is not None:
                if type(op) in BORDER:
                    yield Replacement("border", *found, BORDER[type(op)], at)
                yield Replacement("relation", *found, DIRECTION[type(op)], at)
        case ast.BinOp(left=left, op=op, right=right) if type(op) in _SYMBOL and not _is_text(node):
            found = source.between(left, right, _SYMBOL[type(op)])
            if found is not None:
                if isinstance(op, (ast.Add, ast.Sub)):
                    yield Replacement("sign", *found, "-" if isinstance(op, ast.Add) else "+", at)
                else:
                    yield Replacement("arithmetic", *found, ARITHMETIC[type(op)], at)
        case ast.UnaryOp(op=ast.USub(), operand=operand):
            yield Replacement("sign", *place, source.text(operand), at)
        case ast.UnaryOp(op=ast.Not(), operand=operand):
            yield Replacement("logic", *place, f"({source.text(operand)})", at)
        case ast.BoolOp(op=op, values=[first, second, *_]):
            was, becomes = ("and", "or") if isinstance(op, ast.And) else ("or", "and")
            found = source.between(first, second, was)
            if found is not None and len(node.values) == 2:
                yield Replacement("logic", *found, becomes, at)
        case ast.Constant(value=bool() as value):
            yield Replacement("constant", *place, str(not value), at)
        case ast.Constant(value=int() as value):
            yield Replacement("constant", *place, str(value + 1), at)
        case ast.Constant(value=float() as value):
            yield Replacement("constant", *place, repr(value * 1.1 if value else 1.0), at)
        case ast.Call(func=ast.Name(id="min" | "max" as name)):
            other = "max" if name == "min" else "min"
            yield Replacement("extreme", source.start(node.func), source.end(node.func), other, at)
        case ast.Call(args=[first, second, *_]) if not isinstance(first, ast.Starred) and not isinstance(
            second, ast.Starred
        ):
            one, two = source.text(first), source.text(second)
            if one != two and "\n" not in one + two and first.lineno == second.lineno:
                yield Replacement("arguments", source.start(first), source.end(second), f"{two}, {one}", at)
        case _:
            pass
    for child in ast.iter_child_nodes(node):
        if isinstance(child, ast.expr):
            yield from _of_expression(child, source, at)
        elif isinstance(child, ast.keyword):
            yield from _of_expression(child.value, source, at)
        elif isinstance(child, ast.comprehension):
            for inner in (child.iter, *child.ifs):
                yield from _of_expression(inner, source, at)


def _is_text(node: ast.BinOp) -> bool:
    """Return whether an operator joins or fills in texts."""
    return any(
        isinstance(side, ast.JoinedStr) or (isinstance(side, ast.Constant) and isinstance(side.value, str))
        for side in (node.left, node.right)
    )
