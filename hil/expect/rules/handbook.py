"""The table of the rules in the handbook.

`python -m hil.expect.rules.handbook docs/guides/writing-tests.md` writes it between the comments
`<!-- trace rules -->` and `<!-- end of trace rules -->` of a page.
"""

from __future__ import annotations

import re
import sys
from pathlib import Path
from typing import Final

from hil.expect.rules import ALL_RULES

_BLOCK: Final = re.compile(r"(<!-- trace rules -->\n).*?(<!-- end of trace rules -->)", re.DOTALL)


def table() -> str:
    """Return the Markdown table of the rules."""
    lines = ["| rule | what has to hold | within | live | requirements |", "|---|---|---|---|---|"]
    lines += [
        f"| {rule.name} | {rule.says} | {rule.tolerance} | {'yes' if rule.live else ''} | "
        f"{', '.join(rule.requirements)} |"
        for rule in ALL_RULES
    ]
    return "\n".join(lines)


def with_rules(page: str) -> str:
    """Return a page with the present table of rules."""
    return _BLOCK.sub(lambda found: f"{found[1]}{table()}\n{found[2]}", page)


if __name__ == "__main__":
    for argument in sys.argv[1:]:
        path = Path(argument)
        path.write_text(with_rules(path.read_text(encoding="utf-8")), encoding="utf-8")
