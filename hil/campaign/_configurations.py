"""Cases on configurations: which case runs on which, and which cases none of them serves."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from hil.campaign._discover import Selected
from hil.configurations import name_of, plan
from hil.errors import CannotRunError

if TYPE_CHECKING:
    from hil.configurations import Plan


@dataclass(frozen=True)
class Drawn:
    """Cases on their configurations."""

    cases: list[Selected]
    summary: str
    """How many, and what they cover."""


def draw_configurations(cases: Sequence[Selected], *, seed: int, each: int | None) -> Drawn:
    """Draw configurations for the cases of every campaign.

    Args:
        cases: The cases, on benches of their own.
        seed: Another one gives other configurations.
        each: Configurations of every case; None: as few as cover all pairs of values in a campaign.

    Raises:
        CannotRunError: No configuration serves any of them.

    """
    groups: dict[str, list[Selected]] = {}
    bound: Counter[str] = Counter()
    for item in cases:
        if item.case.own_numbers or item.case.refusal:
            bound[item.case.group] += 1
        else:
            groups.setdefault(item.case.group, []).append(item)
    drawn: list[Selected] = []
    lines = [
        f"{group}: not planned: {count} cases whose numbers are those of their bench, or without a meaning"
        for group, count in bound.items()
    ]
    for group, items in groups.items():
        planned = plan([item.case.needs for item in items], seed=seed, each=each)
        drawn += _on(items, planned, seed)
        lines += _told(group, items, planned)
    if not drawn:
        raise CannotRunError("no configuration serves any of the cases: \n" + "\n".join(lines))
    return Drawn(drawn, "\n".join(lines))


def _on(items: Sequence[Selected], planned: Plan, seed: int) -> list[Selected]:
    names = [name_of(row, seed) for row in planned.rows]
    return [
        Selected(item.case.on(names[number]), item.campaign, planned.rows[number])
        for item, numbers in zip(items, planned.drawn, strict=True)
        for number in numbers
    ]


def _told(group: str, items: Sequence[Selected], planned: Plan) -> list[str]:
    runs = sum(map(len, planned.drawn))
    used = len({number for numbers in planned.drawn for number in numbers})
    pairs, covered = len(planned.pairs), len(planned.covered)
    outcome = f"{len(items)} cases in {runs} runs on {used} configurations"
    lines = [f"{group}: {outcome}, {covered} of {pairs} pairs of values"]
    left_out = Counter(
        str(item.case.needs) for item, numbers in zip(items, planned.drawn, strict=True) if not numbers
    )
    lines += [f"  not planned: {count} cases that need {needs}" for needs, count in left_out.items()]
    return lines
