"""The pages of the museum in the handbook.

`python -m hil.museum.handbook docs/museum/field-errors.md` writes the entries between the comments
`<!-- entries -->` and `<!-- end of entries -->` of the page.
"""

from __future__ import annotations

import re
import sys
from pathlib import Path
from typing import Final

from hil.museum._field_error import AREAS, field_error_page, load_museum

_BLOCK: Final = re.compile(r"(<!-- entries -->\n).*?(<!-- end of entries -->)", re.DOTALL)


def entries() -> str:
    """Return table and pages of all entries, chapter by chapter."""
    museum = load_museum().values()
    lines = ["| entry | what was wrong | caught by |", "|---|---|---|"]
    lines += [f"| `{one.name}` | {one.title} | `{one.judged_by}` |" for one in museum]
    text = "\n".join(lines) + "\n"
    for area in AREAS:
        pages = [field_error_page(one, level=3) for one in museum if one.area == area]
        text += f"\n## {area[0].upper()}{area[1:]}\n\n" + "\n".join(pages)
    return text


def with_entries(page: str) -> str:
    """Return a page with the present entries."""
    return _BLOCK.sub(lambda found: f"{found[1]}{entries()}{found[2]}", page)


if __name__ == "__main__":
    for argument in sys.argv[1:]:
        path = Path(argument)
        path.write_text(with_entries(path.read_text(encoding="utf-8")), encoding="utf-8")
