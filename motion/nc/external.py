"""Setpoints that the PLC generates (section 17)."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

from motion.nc.errors import BLOCK_NOT_PERMITTED, EXTERNAL_ACTIVE, EXTERNAL_NOT_ACTIVE, NO_ERROR

if TYPE_CHECKING:
    from motion.nc.interface import PlcToNc
    from motion.nc.motion import Motion

ABSOLUTE: Final = 1
RELATIVE: Final = 2
_STEP: Final = 1.1


class ExternalSetpoints:
    """External setpoint generation of an axis.

    Args:
        inputs: `PlcToNc` with the packets.
        motion: Setpoints of the axis.

    """

    def __init__(self, inputs: PlcToNc, motion: Motion) -> None:
        self._inputs = inputs
        self._motion = motion
        self._type = 0
        self.enabled = False
        """It runs (`ExtSetPointGenEnabled`)."""
        self._moved = False
        self._ending = False
        self.packets = 0
        """Packets taken over so far."""
        self.step_size = 0.0
        """Way of the set position by the last packet, position unit."""
        self._jumped = False

    def enable(self, start_type: int, target: float) -> int:
        """Begin; the axis has checked its state.

        Args:
            start_type: 1 absolute, 2 relative.
            target: Position that the monitoring of windows waits for, absolute or from here (NC-566).

        Returns:
            An error code, 0 for none.

        """
        motion = self._motion
        if self._type and self._type != start_type:
            return EXTERNAL_ACTIVE
        if start_type == ABSOLUTE and motion.active is not None:
            return BLOCK_NOT_PERMITTED
        if not self._type:
            self._moved = self._ending = False
            self._type = start_type
            self.enabled = True
        motion.watch(target if start_type == ABSOLUTE else motion.generator.s + target)
        return NO_ERROR

    def disable(self) -> int:
        """End after one more packet (NC-582); returns an error code, 0 for none."""
        if not self._type:
            return EXTERNAL_NOT_ACTIVE
        self._ending = True
        return NO_ERROR

    def cancel(self, *, moving: bool = False) -> None:
        """End at once: an error, a reset, or the enable is gone (NC-571, NC-572); `moving`: for a stop, which
        brakes from the present velocity (NC-035).
        """
        if self._type:
            self._type = 0
            self.enabled = False
            self._motion.take_offset(moving=moving)

    def step(self) -> None:
        """Take the packet of this cycle over, if it counts."""
        inputs, motion = self._inputs, self._motion
        before = motion.s
        moves = inputs.ExtSetDirection != 0
        if moves or self._moved or self._ending:
            self.packets += 1
            if self._type == ABSOLUTE:
                motion.generator.set_state(inputs.ExtSetPos, 0.0)
                motion.set_offset(0.0, inputs.ExtSetVelo, inputs.ExtSetAcc)
            else:
                motion.set_offset(inputs.ExtSetPos, inputs.ExtSetVelo, inputs.ExtSetAcc)
        if not moves:
            motion.set_offset(motion.offset, 0.0, 0.0)
        self._moved = moves
        self.step_size = motion.s - before
        if self._ending:
            self.cancel()

    def jumps(self, way: float) -> bool:
        """Return whether the last packet stepped by more than a way and 10 %; of steps in a row the first
        counts (NC-585).
        """
        too_far = abs(self.step_size) > way * _STEP
        begins = too_far and not self._jumped
        self._jumped = too_far
        return begins
