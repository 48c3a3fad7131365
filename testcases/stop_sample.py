"""A sample of the stop matrix, for benches on which the whole of it proves nothing more."""

from __future__ import annotations

from testcases.campaigns import stop_modes
from testcases.campaigns.support import PHASES

MAKER = {"off3": "drive", "coast": "nobody"}
"""Who makes a ramp; every other one is the controller's."""


def sampled_stops(*, every_stop: bool = True) -> list[tuple[str, str]]:
    """Return combinations of stop and phase in which every pair that can matter on a bench occurs.

    All 48 run on the reference bench. What another drive, bus or clock adds depends on who makes the ramp,
    controller or drive, in each phase of motion; at standstill there is no ramp, and while coasting nobody
    makes one. Those pairs are covered, greedily and in a fixed order.

    Args:
        every_stop: Cover every stop, every kind of ramp in every phase, and every requirement of the campaign
            too.

    """
    wanted: dict[tuple[str, str], set[object]] = {}
    for stop, facts in stop_modes.STOPS.items():
        for phase in PHASES:
            case = stop_modes.CAMPAIGN[f"stop-modes/{stop}/{phase}"]
            ramp = facts["ramp"] if every_stop else MAKER.get(facts["ramp"], "controller")
            covers = wanted[stop, phase] = {ramp, phase}
            if every_stop:
                covers |= {stop, *case.requirements}
            if facts["ramp"] != "coast" and phase != "standstill":
                covers.add((ramp, phase))
    missing: set[object] = set().union(*wanted.values())
    chosen: list[tuple[str, str]] = []
    while missing:
        best = max(wanted, key=lambda combination: len(wanted[combination] & missing))
        missing -= wanted[best]
        chosen.append(best)
    return chosen
