"""Finding the homing mark while something moves: zero mark, zero mark behind a cam,
edge of a digital input (§5.11.2).
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

if TYPE_CHECKING:
    from motion.drives.mark import MarkSearch
    from motion.kernel.feedback import Feedback

ALARM_NOT_FOUND: Final = 342
ALARM_NOT_SUPPORTED: Final = 343

ZERO_MARK: Final = 0
ZERO_MARK_AND_CAM: Final = 1
DIGITAL_INPUT: Final = 2
"""`ActiveHoming.Mode` and `PassiveHoming.Mode` (HOM-052, HOM-058)."""

_STEPS: Final = 2
"""Steps of the encoder by which it has to move back before its direction counts as
another one: noise is no motion.
"""
_MOMENT_S: Final = 0.1
"""Time within which that way has to be covered for something to be in motion at the start."""


class Way:
    """Direction in which an encoder moves.

    Args:
        feedback: The encoder.

    """

    def __init__(self, feedback: Feedback) -> None:
        self._feedback = feedback
        self._play = _STEPS * abs(feedback.scale.increment) * feedback.scale.fine
        self._extreme = feedback.travel
        moving = abs(feedback.velocity) * _MOMENT_S > self._play
        self.direction = 0 if not moving else 1 if feedback.velocity > 0.0 else -1
        """1 positive, -1 negative, 0: it has not moved yet."""

    def step(self) -> int:
        """Take over the position of this cycle and return the direction."""
        travel = self._feedback.travel
        moved = travel - self._extreme
        if moved * self.direction > 0.0:
            self._extreme = travel
        elif abs(moved) > self._play:
            self.direction = 1 if moved > 0.0 else -1
            self._extreme = travel
        return self.direction


class MarkFinder:
    """Says in which cycle the homing mark has been passed in homing direction, and where it lies.

    Args:
        feedback: The encoder.
        search: Zero mark search of the device behind it; not needed for a digital input.
        mode: `ZERO_MARK`, `ZERO_MARK_AND_CAM`, `DIGITAL_INPUT`.
        direction: Homing direction: 1 positive, -1 negative, 0 whichever way it moves.
        positive_side: The mark is the positive side of the digital input.
        switch: Whether the input is active now.

    """

    def __init__(
        self,
        feedback: Feedback,
        search: MarkSearch | None,
        *,
        mode: int,
        direction: int,
        positive_side: bool,
        switch: bool,
    ) -> None:
        self._feedback = feedback
        self._search = None if mode == DIGITAL_INPUT else search
        self._mine = False
        self._mode = mode
        self._direction = direction
        self._positive_side = positive_side
        self._switch = switch
        self._on_cam = False
        self._way = 0
        self._began = 0.0

    @property
    def enters(self) -> bool:
        """Whether the mark is the edge at which the input becomes active, in the present homing direction
        (HOM-073 to HOM-076).
        """
        return ((self._direction or self._way) > 0) is not self._positive_side

    @property
    def failed(self) -> bool:
        """Whether the device has ended its search with an error, or knows no search."""
        return self._search is not None and self._mine and self._search.failed

    @property
    def supported(self) -> bool:
        """Whether the device can search for a zero mark at all."""
        return self._search is not None and self._search.supported

    def step(self, way: int, switch: bool) -> float | None:
        """Look for the mark in this cycle.

        Args:
            way: Direction of the motion, 1, -1 or 0.
            switch: Whether cam or input is active.

        Returns:
            Position of the mark in the present coordinates, axis unit; None: it has not been passed.

        """
        before, self._switch = self._switch, switch
        forward = way != 0 and self._direction in (0, way)
        if self._mode == DIGITAL_INPUT:
            self._way = way
            if forward and switch is not before and switch is self.enters:
                return self._feedback.position
            return None
        search = self._search
        if search is None:
            return None
        if self._mine and search.found:
            position = self._passed(search)
            if position is not None:
                return position
        if way != self._way or not forward:
            self._way = way
            self._on_cam = False  # the cam has to be detected again (HOM-128)
            self.close()
        if not forward:
            return None
        if self._mode == ZERO_MARK:
            if not search.searching:
                self._begin(search)
        elif switch:
            self._on_cam = True  # a zero mark on the cam does not count (HOM-091)
            self.close()
        elif self._on_cam and not search.searching:
            self._on_cam = False
            self._begin(search)
        return None

    def close(self) -> None:
        """Look no more, and leave alone what another one looks for: the device has one search for active and
        passive homing.
        """
        if self._search is not None and self._mine:
            self._search.cancel()
        self._mine = False

    def _begin(self, search: MarkSearch) -> None:
        self._began = self._feedback.travel
        self._mine = True
        search.start()

    def _passed(self, search: MarkSearch) -> float | None:
        """Return the position of the mark that was found, None if it was passed the other way round."""
        search.found = self._mine = False
        ahead = self._feedback.ahead(search.value)
        if (self._feedback.travel + ahead - self._began) * self._way < 0.0:
            return None
        return self._feedback.position + ahead
