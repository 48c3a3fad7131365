"""Bits of control words 1 and 2 that are not the axis' own (section 2.13 of the instruction specification),
and travel to fixed stop.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

from fieldbus.profidrive.words import STW2
from motion.s7.axis.jobs import Job
from motion.s7.axis.state import DISABLING

if TYPE_CHECKING:
    from fieldbus.history import History
    from motion.kernel.servo_axis import ServoAxis
    from motion.s7.axis.state import AxisStates

STW1_MASK: Final = 0xFB00
"""Bits of STW1 that `MC_SetAxisSTW` may set: 8, 9, 11 to 15 (MC-437)."""
STW2_MASK: Final = 0x0FFF
"""Bits of STW2 that it may set: 0 to 11; above is the sign of life (MC-439)."""

_TRAVEL_TO_FIXED_STOP: Final = int(STW2.TRAVEL_TO_FIXED_STOP)


class ControlWords:
    """What `MC_SetAxisSTW` has written, laid over what the axis sends (MC-442 to MC-445).

    Args:
        name: Name of the axis.
        history: Event log, or None.
        servo: The axis in the kernel.
        states: State of the axis.

    """

    def __init__(self, name: str, history: History | None, servo: ServoAxis, states: AxisStates) -> None:
        self._name = name
        self._history = history
        self._servo = servo
        self._states = states
        self._job: Job | None = None
        self.waiting = False
        """A job waits for its cycle."""
        self._bits = (0, 0, 0, 0)
        self._own_stw2 = 0
        self._owned_stw2 = (0, 0)
        self.owned_stw1 = 0
        """Bits of STW1 that are the user's."""
        self.user_stw1 = 0
        """Their values."""

    def submit(self, job: Job, stw1: int, mask1: int, stw2: int, mask2: int) -> None:
        """Let the next cycle write the masked bits; a job that has not got so far is aborted."""
        job.start(self._name, self._history)
        if self._job is not None:
            self._job.abort()
            self._job = None
            self.waiting = False
        if self._states.state in DISABLING:
            job.abort()
            return
        self._job = job
        self._bits = (stw1, mask1, stw2, mask2)
        self.waiting = True
        job.activate()

    def step(self) -> None:
        """Carry out what waits; runs before the outputs of the cycle."""
        job = self._job
        if job is None:
            return
        self._job = None
        self.waiting = False
        if self._states.state in DISABLING:
            job.abort()
            return
        stw1, mask1, stw2, mask2 = self._bits
        self.owned_stw1 |= mask1
        self.user_stw1 = (self.user_stw1 & ~mask1) | (stw1 & mask1)
        user, owned = self._owned_stw2
        self._owned_stw2 = ((user & ~mask2) | (stw2 & mask2), owned | mask2)
        self._show()
        job.finish()

    def release(self) -> None:
        """Give all bits back to the axis: it restarts (MC-444)."""
        if self._job is not None:
            self._job.abort()
            self._job = None
            self.waiting = False
        self.owned_stw1 = self.user_stw1 = 0
        self._owned_stw2 = (0, 0)
        self._show()

    def travel_to_fixed_stop(self, on: bool) -> None:
        """Set or clear STW2 bit 8 for the axis itself (STP-172)."""
        self._own_stw2 = _TRAVEL_TO_FIXED_STOP if on else 0
        self._show()

    def _show(self) -> None:
        user, owned = self._owned_stw2
        self._servo.port.stw2 = (self._own_stw2 & ~owned) | (user & owned)
