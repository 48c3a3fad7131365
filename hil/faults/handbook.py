"""The page about faults in the handbook: `python -m hil.faults.handbook docs/reference/faults.md` writes it
from the definitions.

The part above the line `MARK` is written by hand and kept; what follows is derived from the kinds.
"""

from __future__ import annotations

import sys
from inspect import cleandoc
from pathlib import Path
from typing import Final

from hil.faults._catalogue import CATALOGUE, FAMILIES
from hil.faults._kind import Family, FaultType
from hil.faults._parameters import ENVIRONMENTS, Parameter
from hil.faults.seams import members

MARK: Final = (
    "<!-- From here on the page is written by: python -m hil.faults.handbook docs/reference/faults.md -->\n"
)
_ALL_IDENTIFIERS: Final = 0x1FFFFFFF
_INTRODUCTION: Final = """
## The catalogue

`hil faults` prints it, `hil faults --json` gives it to programs.
"""
_LEGEND: Final = """
*Target* says what is named: a segment, a drive or an axis; switch, encoder and mechanics are addressed
by their drive, an encoder with a node of its own (`[encoder.NAME]`) by its own name. A fault that is
*lasting* stays until it is removed; the others are over the moment they are applied. *Benches*:
`virtual`; `live`, with emulated drives on a real bus; `hardware`, a physical drive. Everywhere else
the fault is refused with the reason, and the case ends *blocked*. It is also refused if the part that
is hit does not offer the methods named with the kind: a drive of your own may offer some of them only.
"""
_HEADER: Final = "| parameter | unit | range | default | meaning |\n|---|---|---|---|---|\n"


def page(head: str) -> str:
    """Return the whole page.

    Args:
        head: What is written by hand.

    """
    return head + MARK + _INTRODUCTION + _overview() + _LEGEND + "".join(map(_family, FAMILIES))


def head_of(text: str) -> str:
    """Return what is written by hand of a page."""
    return text.partition(MARK)[0]


def _overview() -> str:
    rows = "".join(
        f"| `{kind.name}` | {kind.target} | {kind.seam} | {'yes' if kind.lasting else 'no'} | "
        f"{', '.join(where for where in ENVIRONMENTS if not kind.injectable(where))} |\n"
        for kind in CATALOGUE
    )
    return f"\n| kind | target | seam | lasting | benches |\n|---|---|---|---|---|\n{rows}"


def _family(family: Family) -> str:
    head = ""
    if family.title:
        table = _table(family.shared)
        head = f"\n### {family.title}\n\n{cleandoc(family.text)}\n{table}"
    return head + "".join(_kind(kind, family) for kind in family.kinds)


def _kind(kind: FaultType, family: Family) -> str:
    text = cleandoc(kind.text) if kind.text else f"{kind.summary}."
    if kind.remark and not kind.text:
        text += f" {kind.remark[0].upper()}{kind.remark[1:]}."
    if not kind.lasting:
        text += "\nIt is over the moment it is applied."
    table = _table(tuple(one for one in kind.parameters if one not in family.shared))
    return f"\n### `{kind.name}`\n\n{text}\n{_needed(kind)}{table}\n```python\n{kind.example_call}\n```\n"


def _needed(kind: FaultType) -> str:
    if kind.effect.needs is None:
        return ""
    part = {"station": "station", "encoder": "encoder or drive"}.get(kind.target, "drive")
    methods = ", ".join(f"`{name}()`" for name in members(kind.effect.needs))
    return f"\nThe {part} has to offer {methods}.\n"


def _table(parameters: tuple[Parameter, ...]) -> str:
    return f"\n{_HEADER}{''.join(map(_row, parameters))}" if parameters else ""


def _row(parameter: Parameter) -> str:
    summary = parameter.summary
    acronym = summary[:2].isalpha() and summary[:2].isupper()
    meaning = summary if acronym else summary[0].lower() + summary[1:]
    unit = f" {parameter.unit} " if parameter.unit else " "
    return f"| `{parameter.name}` |{unit}| {_range(parameter)} | {_default(parameter)} | {meaning} |\n"


def _number(value: float, parameter: Parameter) -> str:
    if parameter.type == "int":
        return f"0x{int(value):X}" if value == _ALL_IDENTIFIERS else str(int(value))
    return f"{value:.6f}".rstrip("0").rstrip(".")


def _range(parameter: Parameter) -> str:
    if parameter.choices:
        return ", ".join(f"`{choice}`" for choice in parameter.choices)
    if parameter.type == "bool":
        return "`true`, `false`"
    if parameter.minimum is None or parameter.maximum is None:
        return "text"
    ends = f"{_number(parameter.minimum, parameter)} to {_number(parameter.maximum, parameter)}"
    return ends + (", whole" if parameter.type == "int" else "")


def _default(parameter: Parameter) -> str:
    default = parameter.default
    if parameter.required or default is None:
        return "required" if parameter.required else "none"
    if isinstance(default, (bool, str)):
        return str(default).lower() or "empty"
    return _number(default, parameter)


if __name__ == "__main__":
    path = Path(sys.argv[1])
    path.write_text(page(head_of(path.read_text(encoding="utf-8"))), encoding="utf-8")
