"""The homing methods as data (C402-105 to C402-132).

A switch divides the travel into *zones*: -1 left of its active range, 0 inside, +1 right of it. Every method
with a switch ends with one passage from a zone to its neighbour; which edge that is, and in which direction
it is passed, follows from the two zones. How to get there follows from the zone in which the load is.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Final

from emulators.drive.homing_config import HomingConfig, StopMethod

NEGATIVE_LIMIT: Final = 1 << 0
POSITIVE_LIMIT: Final = 1 << 1
HOME: Final = 1 << 2
"""Bits of 60FDh."""


@dataclass(frozen=True)
class OnSwitch:
    """Home at the edge of a switch, or at the first index behind it.

    Args:
        switch: Bit of 60FDh.
        before: Zone from which the home edge is passed.
        after: Zone behind it; the direction of the passage is `after - before`.
        index: The home position is the first index behind the edge, in the same direction.
        start: Direction in which a switch with two edges is looked for; 0: the switch is active up to the
            end of the travel, so that "inactive" says on which side the load is.

    """

    switch: int
    before: int
    after: int
    index: bool = True
    start: int = 0

    @property
    def direction(self) -> int:
        """Direction in which the home edge is passed: -1 or +1."""
        return self.after - self.before

    @property
    def outside(self) -> int:
        """Zone outside the switch that the home edge borders on."""
        return self.before or self.after

    def way(self, zone: int | None) -> int:
        """Return the direction to move in from a zone (None: outside, on an unknown side)."""
        if zone is None:
            return self.start
        if zone == self.before:
            return self.direction
        return 1 if self.before > zone else -1


@dataclass(frozen=True)
class OnIndex:
    """Home at the next index in a direction."""

    direction: int


@dataclass(frozen=True)
class OnStop:
    """Home at a hard stop, or at the first index on the way back from it."""

    direction: int
    index: bool


@dataclass(frozen=True)
class Here:
    """Home at the present position, without motion."""


Method = OnSwitch | OnIndex | OnStop | Here

_WITH_INDEX: Final[dict[int, OnSwitch]] = {
    1: OnSwitch(NEGATIVE_LIMIT, 0, 1),
    2: OnSwitch(POSITIVE_LIMIT, 0, -1),
    3: OnSwitch(HOME, 0, -1),
    4: OnSwitch(HOME, -1, 0),
    5: OnSwitch(HOME, 0, 1),
    6: OnSwitch(HOME, 1, 0),
    7: OnSwitch(HOME, 0, -1, start=1),
    8: OnSwitch(HOME, -1, 0, start=1),
    9: OnSwitch(HOME, 1, 0, start=1),
    10: OnSwitch(HOME, 0, 1, start=1),
    11: OnSwitch(HOME, 0, 1, start=-1),
    12: OnSwitch(HOME, 1, 0, start=-1),
    13: OnSwitch(HOME, -1, 0, start=-1),
    14: OnSwitch(HOME, 0, -1, start=-1),
}

METHODS: Final[Mapping[int, Method]] = {
    **_WITH_INDEX,
    **{number + 16: replace(method, index=False) for number, method in _WITH_INDEX.items()},
    33: OnIndex(-1),
    34: OnIndex(1),
    35: Here(),
    37: Here(),
}
"""The methods that the profile defines; 15, 16, 31, 32 and 36 are reserved (C402-119, C402-125, C402-128)."""

STOP_METHODS: Final[Mapping[StopMethod, OnStop]] = {
    "positive": OnStop(1, index=False),
    "negative": OnStop(-1, index=False),
    "positive_index": OnStop(1, index=True),
    "negative_index": OnStop(-1, index=True),
}
"""What a manufacturer's method can be, by its name in a configuration."""


def supported_methods(config: HomingConfig) -> dict[int, Method]:
    """Return all homing methods of a drive by number: those of the profile and its own."""
    own: dict[int, StopMethod] = {-1: "positive_index", -2: "negative_index", -3: "positive", -4: "negative"}
    own |= {int(number): name for number, name in config.hard_stop_methods.items()}
    stops = {number: STOP_METHODS[name] for number, name in sorted(own.items()) if name != "unsupported"}
    return {**stops, **METHODS}
