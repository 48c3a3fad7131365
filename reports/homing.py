"""What a homing did, as plain data: the picture of the report is drawn from it, and golden files are compared
with it.

Positions are those of the axis in the coordinates that hold at the end, so that a homed axis shows its mark
at the position of the mark; what was travelled before the mark is shown in the same coordinates.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from typing import Any


@dataclass
class HomingStep:
    """One step of a homing: a moment (`begin_s` = `end_s`), or a travel between two moments."""

    name: str
    """`start`, `approach`, `cam reached`, `search`, `mark`, `home`, ..."""
    direction: int
    """1 positive, -1 negative, 0 for a moment without motion."""
    begin_s: float
    end_s: float
    begin: float
    """Position at the beginning, position unit."""
    end: float
    velocity: float = 0.0
    """Of a travel the greatest speed with its sign, of a moment the velocity; position unit per second."""
    travel: bool = False


@dataclass
class SwitchEdge:
    """A switch changes while the axis moves over its end."""

    time_s: float
    position: float
    active: bool
    direction: int


@dataclass
class SwitchLane:
    """What was seen of a switch, or of the zero marks, along the travel."""

    name: str
    """`cam`, `input`, `negative limit`, `positive limit`, `zero mark`."""
    bars: list[list[float]] = field(default_factory=list)
    """Where it was active: from, to, position unit; of zero marks from = to."""
    edges: list[SwitchEdge] = field(default_factory=list)


@dataclass
class HomingDrawing:
    """One active or passive homing."""

    axis: str
    unit: str
    """Position unit of the axis."""
    job: str
    mode: int
    """`MC_Home.Mode`."""
    active: bool
    """Active homing: the axis moves by itself."""
    mark_kind: str
    """`zero mark`, `zero mark behind the cam`, `digital input`."""
    direction: int
    """Homing direction: 1, -1, 0 = whichever way it moves."""
    outcome: str
    """`Done`, `CommandAborted`, `Error 16#8001`, or `still active`."""
    begin_s: float
    end_s: float
    approach_velocity: float
    """Configured, position unit per second; 0 in passive homing."""
    homing_velocity: float
    mark: float | None = None
    """Position of the mark on which the axis was homed; None: it was not."""
    home: float | None = None
    """Where it came to rest after an active homing."""
    steps: list[HomingStep] = field(default_factory=list)
    lanes: list[SwitchLane] = field(default_factory=list)
    path: list[list[float]] = field(default_factory=list)
    """Time in s, position, velocity: the motion, thinned."""

    def summary(self, digits: int = 1) -> dict[str, Any]:
        """Return what can be compared with a stored golden one: no names, no times,
        positions and velocities rounded.

        Args:
            digits: Decimal places of positions; velocities are whole numbers.

        """

        def place(value: float) -> float:
            return round(value, digits) + 0.0

        return {
            "homing": f"Mode {self.mode}, {self.mark_kind}, direction {self.direction}: {self.outcome}",
            "mark": None if self.mark is None else place(self.mark),
            "home": None if self.home is None else place(self.home),
            "steps": [
                [step.name, step.direction, place(step.begin), place(step.end), round(step.velocity)]
                if step.travel
                else [step.name, place(step.begin)]
                for step in self.steps
            ],
            "lanes": {
                lane.name: {
                    "bars": [[place(low), place(high)] for low, high in lane.bars],
                    "edges": [
                        ["on" if edge.active else "off", edge.direction, place(edge.position)]
                        for edge in lane.edges
                    ],
                }
                for lane in self.lanes
            },
        }

    def to_plain(self) -> dict[str, Any]:
        """Return values for JSON."""
        return asdict(self)

    @classmethod
    def from_plain(cls, plain: Mapping[str, Any]) -> HomingDrawing:
        """Return the drawing of `to_plain`.

        Raises:
            TypeError, KeyError: It is not one.

        """
        values = dict(plain)
        values["steps"] = [HomingStep(**step) for step in values["steps"]]
        values["lanes"] = [
            SwitchLane(lane["name"], lane["bars"], [SwitchEdge(**edge) for edge in lane["edges"]])
            for lane in values["lanes"]
        ]
        return cls(**values)
