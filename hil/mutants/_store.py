"""Results in the report folder: written after every defect, so that a run can be resumed, or its survivors
tried again.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final

from hil.errors import CannotRunError
from hil.mutants._mutant import Mutant
from hil.mutants._plan import Judge
from hil.mutants._seeding import MutantResult, Seeding, changes_of, digest_of
from hil.mutants._table import markdown
from reports.archive import write_whole

JSON_FILE: Final = "mutants.json"
TABLE_FILE: Final = "mutants.md"
_GOOD: Final = frozenset({"caught", "explained"})
_NEEDED: Final = frozenset({"changes", "status", "caught_by", "how", "message", "seconds"})


def store(seeding: Seeding, directory: Path) -> None:
    """Write `mutants.json` and `mutants.md` into a report folder; whatever else lies there stays."""
    directory.mkdir(parents=True, exist_ok=True)
    write_whole(directory / JSON_FILE, (json.dumps(seeding.as_dict(), indent=2) + "\n").encode())
    write_whole(directory / TABLE_FILE, markdown(seeding).encode())


@dataclass(frozen=True, slots=True)
class Stored:
    """An earlier run, as its file has it."""

    entries: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)
    """What is known of each defect, by name."""
    seconds: float = 0.0
    seed: int = 0
    judged_by: str = ""
    where: str = ""

    def kept(
        self, mutants: Iterable[Mutant], judges: Sequence[Judge], seed: int, *, again: bool
    ) -> list[MutantResult]:
        """Return the results that need not be found again: of defects that are still the same, and could be
        judged.

        Args:
            mutants: The defects that are asked for.
            judges: The cases that judge.
            seed: Seed of the run.
            again: Judge those again that were not caught.

        Raises:
            CannotRunError: The earlier run had another seed or other cases.

        """
        if self.seed != seed:
            raise CannotRunError(
                f"{self.where} holds a run with seed {self.seed}; it can only be resumed with the same"
            )
        if self.judged_by != digest_of(judges):
            raise CannotRunError(
                f"{self.where} holds a run that other cases have judged; it can only be resumed with the "
                f"same campaigns"
            )
        kept = []
        for mutant in mutants:
            entry = self.entries.get(mutant.name)
            if entry is None or entry["changes"] != changes_of(mutant) or entry["status"] == "error":
                continue
            if entry["status"] in _GOOD or not again:
                kept.append(MutantResult(mutant, over=True, earlier=entry))
        return kept

    def missed(self, mutants: Sequence[Mutant]) -> list[Mutant]:
        """Return the defects that were not caught.

        Raises:
            CannotRunError: There is none.

        """
        bad = {name for name, entry in self.entries.items() if entry["status"] not in _GOOD}
        found = [mutant for mutant in mutants if mutant.name in bad]
        if not found:
            raise CannotRunError(
                f"none of the {len(bad)} defects that were not caught in {self.where} is among the "
                f"{len(mutants)} selected ones"
                if bad
                else f"every defect was caught in {self.where}: there is nothing to repeat"
            )
        return found


def _check(entry: Mapping[str, Any]) -> None:
    if missing := _NEEDED - entry.keys():
        raise ValueError(f"{entry['name']} has no {', '.join(sorted(missing))}")


def load_stored(directory: Path) -> Stored:
    """Return the earlier run in a report folder.

    Raises:
        CannotRunError: There is none, or it cannot be read.

    """
    path = directory / JSON_FILE
    try:
        plain = json.loads(path.read_text(encoding="utf-8"))
        entries = {entry["name"]: entry for entry in plain["mutants"]}
        for entry in entries.values():
            _check(entry)
        return Stored(entries, float(plain["seconds"]), int(plain["seed"]), plain["judged_by"], str(path))
    except FileNotFoundError as error:
        raise CannotRunError(f"there is no run to go on with: {path} does not exist") from error
    except (OSError, ValueError, TypeError, KeyError) as error:
        raise CannotRunError(f"{path} is no result of hil mutants: {error}") from error
