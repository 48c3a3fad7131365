"""`hil variables`: the variables of technology objects, with type, unit, range, access and meaning."""

from __future__ import annotations

from fieldbus.errors import UnknownNameError
from hil._commands.terminal import print_json
from motion.s7.variable_texts import VariableText, matching, variable_texts
from motion.s7.variables import object_types


def show_variables(pattern: str, *, object_type: str, as_json: bool) -> int:
    """Print the variables that match; returns the exit code.

    Args:
        pattern: Part of a path, or a path with `*`; empty: all of them.
        object_type: Type of technology object.
        as_json: As JSON.

    Raises:
        UnknownNameError: There is no such type, or nothing matches.

    """
    kinds = {kind.lower(): kind for kind in object_types()}
    kind = kinds.get(object_type.lower())
    if kind is None:
        raise UnknownNameError("--object", object_type, "a type of technology object", kinds.values())
    found = matching(kind, pattern)
    if not found:
        every = [one.path for one in variable_texts(kind)]
        raise UnknownNameError("", pattern, f"part of a variable of {kind}", every, listed_by="hil variables")
    if as_json:
        print_json([one._asdict() for one in found])
        return 0
    for one in found:
        print(_head(one))  # noqa: T201 - the answer
        print(f"    {one.meaning}")  # noqa: T201 - the answer
    return 0


def _head(one: VariableText) -> str:
    unit = f" {one.unit}" if one.unit else ""
    allowed = f"  {one.range}{unit}" if one.range else unit
    return f"{one.path}  {one.data_type}  {one.access}{allowed}  (default {one.default})"
