"""What a program has reached: situations of axis, drive, alarms and faults, as a
measure of what a search has seen.
"""

from __future__ import annotations

import json
from bisect import bisect_left
from collections import Counter
from collections.abc import Iterable
from itertools import pairwise
from typing import Final

import numpy as np

from hil.fuzz._configuration import Configuration
from hil.record import Trace

Situation = tuple[str, ...]
"""A family (a key of `FAMILIES`) and what came together."""

FAMILIES: Final = {
    "axis": "the axis goes from one state to another",
    "drive": "the drive goes from one state to another",
    "job": "an instruction is accepted in a state of the axis",
    "refused": "an instruction ends with an ErrorID in a state of the axis",
    "error": "an NC axis goes into error in a state, after a fault (or after none)",
    "fault": "a fault acts in a state of the axis",
    "alarm": "an alarm comes with its reaction in a state of the axis, after a fault (or after none)",
    "together": "an alarm comes while another is pending",
    "configuration": "a part of a configuration with a certain content",
}
"""Family -> what it tells."""

_NC_STATES: Final = (
    (31, "error"),
    (30, "invalid data"),
    (13, "superposed"),
    (14, "external"),
    (11, "homing"),
    (5, "slave"),
    (29, "locked"),
    (19, "endless"),
    (8, "job"),
    (7, "stopped"),
    (0, "operational"),
)
"""Bits of `StateDWord` that name the state of an NC axis, the first that is set."""


def _nc_states(trace: Trace) -> dict[str, list[tuple[float, str]]]:
    """Return the states that the NC axes of a trace went through, with the time of each."""
    found: dict[str, list[tuple[float, str]]] = {}
    for column in trace.names():
        axis, _, name = column.partition(".")
        if name != "state_dword":
            continue
        words = trace[column]
        states = found[axis] = []
        for when_s, word in zip(words.time_s.tolist(), words.values.astype(np.int64).tolist(), strict=True):
            state = next((text for bit, text in _NC_STATES if word >> bit & 1), "disabled")
            if not states or states[-1][1] != state:
                states.append((when_s, state))
    return found


def situations_of(trace: Trace) -> frozenset[Situation]:
    """Return the situations that a trace went through."""
    reached: set[Situation] = set()
    states: dict[str, str] = {}
    pending: set[str] = set()
    fault = "no fault"

    nc = _nc_states(trace)
    for passed in nc.values():
        reached.update(("axis", before, after) for (_, before), (_, after) in pairwise(passed))

    def nc_state(axis: str, when_s: float) -> str:
        """Return the state in front of an event."""
        passed = nc.get(axis, [])
        place = bisect_left(passed, (when_s, ""))
        return passed[place - 1][1] if place else "disabled"

    def here(axis: str = "", when_s: float = 0.0) -> str:
        if nc:
            return nc_state(axis or next(iter(nc)), when_s)
        return states[axis] if axis in states else next(iter(states.values()), "DISABLED")

    for event in trace.events:
        data = event.data
        now_s = event.time_ns * 1e-9
        match event.kind:
            case "axis.state":
                states[event.source] = str(data["to"])
                reached.add(("axis", str(data["from"]), str(data["to"])))
            case "drive.state":
                reached.add(("drive", str(data["from"]), str(data["to"])))
            case "job.started":
                reached.add(("job", str(data["instruction"]), here(event.source, now_s)))
            case "job.error":
                text = f"16#{int(str(data['error_id'])):04X}"
                reached.add(("refused", str(data["instruction"]), text, here(event.source, now_s)))
            case "command.refused":
                text = f"16#{int(str(data['error_id'])):04X}"
                reached.add(("refused", "", text, here(event.source, now_s)))
            case "axis.error":
                text = f"16#{int(str(data['error_id'])):04X}"
                reached.add(("error", text, here(event.source, now_s), fault))
            case "fault.applied":
                fault = str(data["fault"])
                reached.add(("fault", fault, here("", now_s)))
            case "alarm.raised":
                number = str(data["number"])
                reached.add(("alarm", number, str(data["reaction"]), here(event.source, now_s), fault))
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
