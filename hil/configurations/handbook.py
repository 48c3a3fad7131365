"""The table of factors in the handbook.

`python -m hil.configurations.handbook docs/guides/configurations.md` writes it between the comments
`<!-- factors -->` and `<!-- end of factors -->` of a page.
"""

from __future__ import annotations

import re
import sys
from pathlib import Path
from typing import Final

from hil.configurations.factors import FACTORS

_BLOCK: Final = re.compile(r"(<!-- factors -->\n).*?(<!-- end of factors -->)", re.DOTALL)


def table() -> str:
    """Return the Markdown table of the factors."""
    lines = ["| factor | what it is | values |", "|---|---|---|"]
    for factor in FACTORS.values():
        values = "; ".join(f"`{word}` {meaning}" for word, meaning in factor.values.items())
        lines.append(f"| `{factor.name}` | {factor.meaning} | {values} |")
    return "\n".join(lines)


def with_factors(page: str) -> str:
    """Return a page with the present table of factors."""
    return _BLOCK.sub(lambda found: f"{found[1]}{table()}\n{found[2]}", page)


if __name__ == "__main__":
    for argument in sys.argv[1:]:
        path = Path(argument)
        path.write_text(with_factors(path.read_text(encoding="utf-8")), encoding="utf-8")
