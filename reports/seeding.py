"""The defects that were seeded on purpose, and which cases noticed them:
`mutants.json` of a report folder.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final

SEEDING_FILE: Final = "mutants.json"
"""A list of objects with `name`, `caught_by` (identifiers of cases) and `seconds`, or an object whose
`mutants` is one.
"""


@dataclass(frozen=True)
class Defect:
    """A seeded defect."""

    name: str
    title: str
    area: str
    status: str
    """`caught`, `survived`, or what the file says."""
    caught_by: list[str]
    remark: str
    seconds: float | None
    how: str = ""
    """`failed`, `error`, `blocked`, `hung` or `crashed`: how the first case that caught it ended."""
    message: str = ""
    """What that case said."""
    broken: tuple[str, ...] = ()
    """Requirements that its failed checks name."""
    changes: tuple[str, ...] = ()
    """What was changed in the source, in words."""


@dataclass
class Seeding:
    """What the file says; empty with `error` where it cannot be read."""

    defects: list[Defect] = field(default_factory=list)
    error: str = ""
    interrupted: bool = False
    """Whether not all of them were judged."""
    seed: int | None = None
    """Of the run, and of the draw if the defects were drawn."""
    cases: int | None = None
    """Cases that judged, all of which were green without a defect."""
    left_out: int = 0
    """Cases that judged nothing, because there was no time to run them without a defect."""
    product: str = ""
    """Digest of the product that was changed; empty: it is not known."""
    judged_by: str = ""
    """Digest of the names of the cases that judged."""

    def count(self, status: str) -> int:
        """Return the number of defects with a status."""
        return sum(defect.status == status for defect in self.defects)


def load_seeding(folder: str | Path) -> Seeding | None:
    """Return the seeded defects of a report folder; None where there is no file."""
    path = Path(folder) / SEEDING_FILE
    try:
        plain = json.loads(path.read_text(encoding="utf-8"))
        about = plain if isinstance(plain, dict) else {}
        return Seeding(
            [_defect(entry) for entry in _entries(plain)],
            interrupted=bool(about.get("interrupted")),
            seed=_whole(about.get("seed")),
            cases=_whole(about.get("baseline_cases")),
            left_out=_whole(about.get("baseline_left_out")) or 0,
            product=str(about.get("product", "")),
            judged_by=str(about.get("judged_by", "")),
        )
    except FileNotFoundError:
        return None
    except KeyError as error:
        return Seeding(error=f"{SEEDING_FILE}: an entry has no {error}")
    except (OSError, ValueError, TypeError) as error:
        return Seeding(error=f"{SEEDING_FILE}: {error}")


def _whole(value: object) -> int | None:
    return value if isinstance(value, int) else None


def _entries(plain: object) -> list[Any]:
    entries = plain["mutants"] if isinstance(plain, dict) else plain
    if not isinstance(entries, list):
        raise TypeError("not a list of objects with name, caught_by and seconds")
    return entries


def _defect(entry: Mapping[str, Any]) -> Defect:
    if not isinstance(entry, dict):
        raise TypeError(f"{entry!r} is not an object with name, caught_by and seconds")
    caught_by = [str(name) for name in entry["caught_by"]]
    seconds = entry.get("seconds")
    return Defect(
        name=str(entry["name"]),
        title=str(entry.get("title", "")),
        area=str(entry.get("area", "")),
        status=str(entry.get("status") or ("caught" if caught_by else "survived")),
        caught_by=caught_by,
        remark=str(entry.get("explained") or entry.get("message") or ""),
        seconds=float(seconds) if isinstance(seconds, int | float) else None,
        how=str(entry.get("how", "")),
        message=str(entry.get("message", "")) if caught_by else "",
        broken=tuple(str(one) for one in entry.get("broken", ())),
        changes=tuple(
            f"{change['target']}: {change['old']} -> {change['new']}" for change in entry.get("changes", ())
        ),
    )
