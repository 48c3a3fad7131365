"""A discrete axis: commands are executed by the two-speed sequence, and the set values are the actual ones
(section 19).
"""

from __future__ import annotations

from math import inf
from typing import TYPE_CHECKING

from motion.nc.commands import ENDLESS, STOP, Command
from motion.nc.two_speed import IDLE, TwoSpeed

if TYPE_CHECKING:
    from motion.nc.motion import Motion
    from motion.nc.parameters import ParameterSet


class Discrete:
    """Execution of the commands of a discrete axis.

    Args:
        parameters: Parameters of the axis.
        motion: Its commands.
        cycle_s: Its cycle, s.

    """

    def __init__(self, parameters: ParameterSet, motion: Motion, *, cycle_s: float) -> None:
        self._motion = motion
        self.sequence = TwoSpeed(parameters, cycle_s=cycle_s)
        """Two speeds and brake."""
        self._running: Command | None = None

    @property
    def image(self) -> bytes:
        """The 12 byte for the drive."""
        return self.sequence.image

    @property
    def stands(self) -> bool:
        """Whether the sequence is over and the brake applied."""
        return self.sequence.state == IDLE

    @property
    def direction(self) -> int:
        """Direction of travel, -1, 0 or 1."""
        return self.sequence.direction

    def follow(self, position: float, velocity: float) -> None:
        """Let the set values be the actual ones."""
        self._motion.generator.set_state(position, velocity)

    def step(self, position: float, override: float) -> None:
        """Run one cycle.

        Args:
            position: Actual position, position unit.
            override: 0 to 1.

        """
        motion, sequence = self._motion, self.sequence
        active = motion.active
        if active is not None and active.ended:
            active = None
        if active is not self._running:
            self._take(active, position)
        sequence.step(position, override * 100.0)
        running = self._running
        if running is not None and sequence.state == IDLE:
            self._running = None
            motion.complete(running)

    def _take(self, command: Command | None, position: float) -> None:
        self._running = command
        if command is None or command.kind == STOP:
            self.sequence.stop(position)
            return
        target = command.target
        if command.kind == ENDLESS:
            limit = self._motion.limit_ahead(target)
            target = target * inf if limit is None else limit
        self.sequence.start(position, target, command.velocity)

    def abort(self) -> None:
        """Switch off and apply the brake at once: an error, or the enable is gone."""
        self._running = None
        self.sequence.abort()
