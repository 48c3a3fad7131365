"""What a slave does about communication errors: EMCY, a call to the device, a change of the NMT state
(C301-113, C301-122 to C301-130).
"""

from __future__ import annotations

from collections.abc import Callable
from enum import Enum
from typing import Final

from fieldbus.can.frame import CanFrame
from fieldbus.canopen.abort import AbortCode, SdoAbort
from fieldbus.canopen.dictionary import ObjectValue
from fieldbus.canopen.emcy import EmcyProducer
from fieldbus.canopen.nmt import NmtState
from fieldbus.clock import S, Scheduler, Timer
from fieldbus.history import History

EMCY_OVERRUN: Final = 0x8110
EMCY_ERROR_PASSIVE: Final = 0x8120
EMCY_LIFE: Final = 0x8130
EMCY_BUS_OFF_RECOVERED: Final = 0x8140
EMCY_COLLISION: Final = 0x8150

QUIET_NS: Final = 1 * S
"""A collision error ends when there was no collision for this long, ns."""

_BEHAVIOUR: Final = 0x102901
_BEHAVIOURS: Final = (0, 1, 2)


def check_behaviour(value: ObjectValue) -> None:
    """Refuse a value that 1029h does not have (C301-113).

    Raises:
        SdoAbort: 06090030h.

    """
    if value not in _BEHAVIOURS:
        raise SdoAbort(AbortCode.VALUE)


class CommunicationErrors:
    """Takes notice of lost peers, overdue RPDOs and the state of the CAN controller.

    Args:
        errors: Where the EMCYs go.
        values: Present values, for 1029h.
        state: Returns the NMT state.
        enter: Enters an NMT state.
        source: Name in the history.
        history: Log; None for none.

    """

    def __init__(
        self,
        errors: EmcyProducer,
        values: dict[int, ObjectValue],
        *,
        state: Callable[[], NmtState],
        enter: Callable[[NmtState], None],
        source: str,
        history: History | None,
    ) -> None:
        self._errors = errors
        self._values = values
        self._state = state
        self._enter = enter
        self._source = source
        self._history = history
        self.listeners: list[Callable[[str], None]] = []

    def announce(self, reason: str) -> None:
        """Notify the device."""
        for callback in self.listeners:
            callback(reason)

    def raise_error(self, code: int) -> None:
        """Report an error of the communication services."""
        self._errors.raise_error(code, None, b"", repeat=False)

    def peer_lost(self, kind: str) -> None:
        """Report that a heartbeat or the guarding master is missing."""
        self.raise_error(EMCY_LIFE)
        if self._history is not None:
            self._history.emit(self._source, f"{kind}.lost")
        self._fail(kind)

    def peers_found(self) -> None:
        """End the error: no peer is missing any more."""
        self._errors.clear(EMCY_LIFE)

    def rpdo_timeout(self, number: int) -> None:
        """Report that RPDO `number` is overdue; it does not change the NMT state."""
        if self._history is not None:
            self._history.emit(self._source, "rpdo.timeout", number=number)
        self.announce("rpdo_timeout")

    def controller_state(self, old: Enum, new: Enum) -> None:
        """Follow the error state of the CAN controller."""
        if new.name == "BUS_OFF":
            self._errors.clear(EMCY_ERROR_PASSIVE)
            self._fail("bus_off")
        elif old.name == "BUS_OFF":
            self.raise_error(EMCY_BUS_OFF_RECOVERED)
            self._errors.clear(EMCY_BUS_OFF_RECOVERED)
        elif new.name == "ERROR_PASSIVE":
            self.raise_error(EMCY_ERROR_PASSIVE)
        else:
            self._errors.clear(EMCY_ERROR_PASSIVE)

    def overrun(self) -> None:
        """Report that the CAN controller has lost frames; it is an error of the moment (CANP-058)."""
        self.raise_error(EMCY_OVERRUN)
        self._errors.clear(EMCY_OVERRUN)

    def _fail(self, reason: str) -> None:
        """Notify the device, then do what 1029h:1 says; without the object Operational is left (C301-113)."""
        self.announce(reason)
        behaviour = self._values.get(_BEHAVIOUR, 0)
        state = self._state()
        if behaviour == 0 and state == NmtState.OPERATIONAL:
            self._enter(NmtState.PRE_OPERATIONAL)
        elif behaviour == 2 and state in (NmtState.PRE_OPERATIONAL, NmtState.OPERATIONAL):
            self._enter(NmtState.STOPPED)


class CollisionWatch:
    """Raises 8150h when another node sends with an identifier that this one sends with.

    Args:
        scheduler: Time.
        emcy: Raises an error by code.
        emcy_clear: Ends an error by code.

    """

    def __init__(
        self,
        scheduler: Scheduler,
        *,
        emcy: Callable[[int], object],
        emcy_clear: Callable[[int], object],
    ) -> None:
        self._scheduler = scheduler
        self._emcy = emcy
        self._emcy_clear = emcy_clear
        self._last_ns = 0
        self._timer: Timer | None = None
        self.collisions = 0
        """Frames of others with an identifier that this node sends."""

    def stop(self) -> None:
        """Forget everything, as at power-off and reset; the error ends with the reset."""
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None

    def collision(self, _frame: CanFrame, time_ns: int) -> None:
        """Take a frame of another node with an own identifier."""
        self.collisions += 1
        self._last_ns = time_ns
        if self._timer is None:
            self._emcy(EMCY_COLLISION)
            self._timer = self._scheduler.at(max(time_ns + QUIET_NS, self._scheduler.now), self._due)

    def _due(self) -> None:
        due = self._last_ns + QUIET_NS
        if due > self._scheduler.now:
            self._timer = self._scheduler.at(due, self._due)
            return
        self._timer = None
        self._emcy_clear(EMCY_COLLISION)
