"""The tables of the handbook page of NC axes: error codes and parameters, from the data of the product.

python -m motion.nc.pages docs/reference/nc-axis.md
"""

from __future__ import annotations

import re
import sys
from pathlib import Path

from motion.nc.errors import error_codes
from motion.nc.parameters import Parameter, catalogue


def _default(one: Parameter) -> str:
    if one.type == "bool":
        return str(one.default).lower()
    if one.type in {"enum", "string"}:
        return f"`{one.default}`"
    return f"{one.default:g}" if one.type == "float" else str(one.default)


def parameter_table() -> str:
    """Return the Markdown table of all parameters."""
    lines = ["| key | name | unit | range | default | effect |", "|---|---|---|---|---|---|"]
    for one in catalogue().values():
        keys = ", ".join(f"`{key}`" for key in (one.key, *one.aliases))
        allowed = one.allowed.replace("'", "`") if one.type == "enum" else one.allowed
        cells = (keys, one.name, one.unit, allowed, _default(one), one.effect)
        lines.append(f"| {' | '.join(cells)} |".replace("  |", " |"))
    return "\n".join(lines)


def error_table() -> str:
    """Return the Markdown table of all error codes."""
    lines = ["| code | name | condition | reaction | remedy |", "|---|---|---|---|---|"]
    for one in error_codes().values():
        cells = (f"0x{one.code:04X}", one.name, one.condition, one.reaction, one.remedy)
        lines.append(f"| {' | '.join(cells)} |")
    return "\n".join(lines)


def with_tables(page: str) -> str:
    """Return a page with present tables."""
    for name, table in (("nc error codes", error_table()), ("nc parameters", parameter_table())):
        block = re.compile(rf"(<!-- {name} -->\n).*?(<!-- end of {name} -->)", re.DOTALL)
        page = block.sub(lambda found, table=table: f"{found[1]}{table}\n{found[2]}", page)  # type: ignore[misc]  # bound now
    return page


if __name__ == "__main__":
    for argument in sys.argv[1:]:
        path = Path(argument)
        path.write_text(with_tables(path.read_text(encoding="utf-8")), encoding="utf-8")
