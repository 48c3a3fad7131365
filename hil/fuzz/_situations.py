"""What a program has reached: situations of axis, drive, alarms and faults, as a
measure of what a search has seen.
"""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Iterable
from typing import Final

from hil.fuzz._configuration import Configuration
from hil.record import Trace

Situation = tuple[str, ...]
"""A family (a key of `FAMILIES`) and what came together."""

FAMILIES: Final = {
    "axis": "the axis goes from one state to another",
    "drive": "the drive goes from one state to another",
    "job": "an instruction is accepted in a state of the axis",
    "refused": "an instruction ends with an ErrorID in a state of the axis",
    "fault": "a fault acts in a state of the axis",
    "alarm": "an alarm comes with its reaction in a state of the axis, after a fault (or after none)",
    "together": "an alarm comes while another is pending",
    "configuration": "a part of a configuration with a certain content",
}
"""Family -> what it tells."""


def situations_of(trace: Trace) -> frozenset[Situation]:
    """Return the situations that a trace went through."""
    reached: set[Situation] = set()
    states: dict[str, str] = {}
    pending: set[str] = set()
    fault = "no fault"

    def here(axis: str = "") -> str:
        return states[axis] if axis in states else next(iter(states.values()), "DISABLED")

    for event in trace.events:
        data = event.data
        match event.kind:
            case "axis.state":
                states[event.source] = str(data["to"])
                reached.add(("axis", str(data["from"]), str(data["to"])))
            case "drive.state":
                reached.add(("drive", str(data["from"]), str(data["to"])))
            case "job.started":
                reached.add(("job", str(data["instruction"]), here(event.source)))
            case "job.error":
                text = f"16#{int(str(data['error_id'])):04X}"
                reached.add(("refused", str(data["instruction"]), text, here(event.source)))
            case "fault.applied":
                fault = str(data["fault"])
                reached.add(("fault", fault, here()))
            case "alarm.raised":
                number = str(data["number"])
                reached.add(("alarm", number, str(data["reaction"]), here(event.source), fault))
                reached.update(("together", number, other) for other in pending if other != number)
                pending.add(number)
            case "alarm.cleared":
                pending.discard(str(data["number"]))
    return frozenset(reached)


def configured(configuration: Configuration) -> frozenset[Situation]:
    """Return the situations that a configuration is by itself: one for each of its parts."""
    return frozenset(
        ("configuration", name, json.dumps(part, sort_keys=True))
        for name, part in configuration.parts.items()
    )


def by_family(reached: Iterable[Situation]) -> dict[str, int]:
    """Return how many different situations of each family were reached, in the order of `FAMILIES`."""
    counts = Counter(situation[0] for situation in reached)
    return {family: counts[family] for family in FAMILIES}
