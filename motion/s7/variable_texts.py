"""What the variables of technology objects mean, for people: `hil variables` and the page of the handbook.

`python -m motion.s7.variable_texts docs/reference/variables.md` writes the page; what stands above the line
`MARK` is written by hand and kept.
"""

from __future__ import annotations

import re
import sys
from functools import cache
from pathlib import Path
from typing import Final, NamedTuple

from motion.s7.data import load
from motion.s7.data._variables import Variable, elements, object_types, variables_of
from motion.s7.variables import VariableStore

MARK: Final = (
    "<!-- From here on the page is written by: python -m motion.s7.variable_texts "
    "docs/reference/variables.md -->\n"
)
_INHERITS: Final = {"SynchronousAxis": "PositioningAxis"}


class VariableText(NamedTuple):
    """A variable of a type of technology object, in words."""

    path: str
    """`Sensor[1..4].Type` for an element of an array."""
    data_type: str
    access: str
    """`DIR`, `CAL`, `RES` or `RON`."""
    unit: str
    """Unit with the default units of the object; empty without."""
    range: str
    default: str
    meaning: str


@cache
def variable_texts(object_type: str) -> tuple[VariableText, ...]:
    """Return the variables of a type of technology object, in the order of the data block.

    Raises:
        ConfigurationError: There is no such type.

    """
    store = VariableStore(object_type)
    meanings = _meanings(object_type)
    return tuple(_text(variable, store, meanings) for variable in variables_of(object_type))


def _meanings(object_type: str) -> dict[str, list[str]]:
    content = load("variable_texts")
    rows = [*content.get(_INHERITS.get(object_type, ""), ()), *content[object_type]]
    return {path: [meaning, *values] for path, meaning, *values in rows}


def _text(variable: Variable, store: VariableStore, meanings: dict[str, list[str]]) -> VariableText:
    row = meanings.get(variable.path) or meanings[variable.path.rpartition(".")[0]]  # a part of an address
    meaning, values = row[0], row[1] if len(row) > 1 else None
    if values:
        meaning += f" FALSE: {values[0]}; TRUE: {values[1]}."
    if variable.bits:
        bits = ", ".join(f"X{bit} {name}" for bit, name in variable.bits.items())
        meaning += f" Bits: {bits}."
    return VariableText(
        variable.path,
        variable.data_type,
        variable.access,
        store.unit(elements(variable)[0]),
        _range(variable),
        _value(variable.initial),
        meaning.strip(),
    )


def _range(variable: Variable) -> str:
    if variable.data_type == "BOOL":
        return "FALSE, TRUE"
    if variable.variants:
        return "; ".join(
            f"{kind.lower()} {low:g} to {high:g}" for kind, (low, high) in variable.variants.items()
        )
    return "" if variable.bits else variable.allowed(0)


def _value(value: object) -> str:
    return (
        str(value).upper()
        if isinstance(value, bool)
        else f"{value:g}"
        if isinstance(value, float)
        else str(value)
    )


def matching(object_type: str, pattern: str) -> list[VariableText]:
    """Return the variables whose path has a text, capital letters aside.

    Args:
        object_type: Type of technology object.
        pattern: Part of a path, or a whole one with `*` and `?` as in file names; brackets are brackets.

    """
    wild = "*" in pattern or "?" in pattern
    text = re.escape(pattern).replace(r"\*", ".*").replace(r"\?", ".")
    search = re.compile(f"^{text}$" if wild else text, re.IGNORECASE)
    return [
        one
        for one, variable in zip(variable_texts(object_type), variables_of(object_type), strict=True)
        if any(map(search.search, (one.path, *elements(variable))))
    ]


# -- documentation -----------------------------------------------------------------------------------------


def page(head: str) -> str:
    """Return the whole page.

    Args:
        head: What is written by hand.

    """
    return head + MARK + "".join(map(_section, object_types()))


def head_of(text: str) -> str:
    """Return what is written by hand of a page."""
    return text.partition(MARK)[0]


def _section(object_type: str) -> str:
    rows = variable_texts(object_type)
    base = _INHERITS.get(object_type)
    more = ""
    if base is not None:
        rows = rows[len(variable_texts(base)) :]
        more = f"All of {base}, and:\n\n"
    lines = "".join(
        f"| {' | '.join((f'`{one.path}`', *one[1:]))} |\n".replace("  |", " |").replace("|  |", "| |")
        for one in rows
    )
    return (
        f"\n## {object_type}\n\n{more}| variable | type | access | unit | range | default | meaning |\n"
        f"|---|---|---|---|---|---|---|\n{lines}"
    )


if __name__ == "__main__":
    for name in sys.argv[1:]:
        file = Path(name)
        file.write_text(page(head_of(file.read_text(encoding="utf-8"))), encoding="utf-8")
