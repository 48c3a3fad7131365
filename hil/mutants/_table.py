"""Tables of defects, for reports and for the documentation."""

from __future__ import annotations

from collections.abc import Iterable

from hil.mutants._mutant import Mutant
from hil.mutants._seeding import Seeding


def _cell(text: str) -> str:
    return text.replace("|", "\\|").replace("\n", " ")


def markdown(seeding: Seeding) -> str:
    """Return the defect-seeding table of a run."""
    caught, total = seeding.count("caught"), len(seeding.results)
    lines = [
        "# Defect seeding",
        "",
        (
            f"{caught} of {total} caught in {seeding.seconds:.0f} s, baseline ({len(seeding.baseline)} cases) "  # noqa: E501
            f"included."
        ),
        "",
        "| defect | area | what is wrong | status | noticed by | how | s |",
        "|---|---|---|---|---|---|---|",
    ]
    for result in seeding.results:
        mutant = result.mutant
        red = result.caught_by
        by = ", ".join(f"`{outcome.judge.name}`" for outcome in red) or _cell(
            mutant.explained or result.error
        )
        how = red[0].verdict if red else ""
        lines.append(
            f"| `{mutant.name}` | {mutant.area} | {_cell(mutant.title)} | {result.status} | {by} | {how} "
            f"| {result.seconds:.2f} |"
        )
    return "\n".join(lines) + "\n"


def catalogue_table(mutants: Iterable[Mutant], area: str) -> list[str]:
    """Return the rows of the documentation for the defects of an area, heading included."""
    lines = ["| defect | what is wrong | where | requirements |", "|---|---|---|---|"]
    for mutant in mutants:
        if mutant.area == area:
            where = ", ".join(f"`{edit.target.partition(':')[2]}`" for edit in mutant.edits)
            lines.append(
                f"| `{mutant.name}` | {_cell(mutant.title)} | {where} | {', '.join(mutant.requirements)} |"
            )
    return lines
