"""Superposed motion: a distance on top of what the axis does, of a master or a slave (NC-032, NC-245)."""

from __future__ import annotations

from typing import TYPE_CHECKING

from motion.nc.commands import Command, CommandState
from motion.setpoint import SetpointGenerator

if TYPE_CHECKING:
    from motion.nc.coupling import Coupling
    from motion.nc.motion import Motion


class Superposed:
    """The superposed motion of an axis.

    Args:
        motion: Its setpoints.
        coupling: What it follows, if it does.
        cycle_s: Its cycle, s.

    """

    def __init__(self, motion: Motion, coupling: Coupling, *, cycle_s: float) -> None:
        self._motion = motion
        self._coupling = coupling
        self._cycle_s = cycle_s
        self._part = SetpointGenerator()
        self.command: Command | None = None
        """The motion that runs; None: none (`Compensating`)."""

    def start(self, command: Command) -> None:
        """Begin to move by `command.target` with `command.velocity` on top; one that runs is aborted, and its
        way so far stays.
        """
        self.abort(CommandState.ABORTED, 0)
        self._part.set_state(0.0, 0.0)
        command.state = CommandState.ACTIVE
        self.command = command
        self._plan(command)

    def set_override(self) -> None:
        """Take over the override of the axis: 0 holds the motion."""
        if self.command is not None:
            self._plan(self.command)

    def _plan(self, command: Command) -> None:
        override, part = self._motion.override, self._part
        if override <= 0.0:
            part.start_stop(command.deceleration, command.jerk)
            return
        part.start_position(
            command.target,
            command.velocity * override,
            command.acceleration,
            command.deceleration,
            command.jerk,
        )

    def step(self) -> None:
        """Run one cycle, after the basic motion."""
        command, part = self.command, self._part
        if command is None:
            return
        part.advance(self._cycle_s)
        self._motion.set_offset(part.s, part.v, part.a)
        if part.done and self._motion.override > 0.0:
            command.state = CommandState.DONE
            self._keep()

    def abort(self, state: CommandState, error_id: int) -> None:
        """End it; the way so far stays."""
        command = self.command
        if command is None:
            return
        command.state = state
        command.error_id = error_id
        self._keep()

    def _keep(self) -> None:
        self.command = None
        if self._coupling.master is None:
            self._motion.take_offset()
        else:
            self._coupling.shift(self._motion.offset)
            self._motion.generator.shift(self._motion.offset)
            self._motion.set_offset(0.0, 0.0, 0.0)
