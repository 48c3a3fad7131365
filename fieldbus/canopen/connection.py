"""The connection of a controller to a CAN segment: data frames with 11-bit identifiers, by identifier."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Final

from fieldbus.can.frame import CanFrame, FrameReceiver
from fieldbus.can.port import MediumPort
from fieldbus.can.segment import CanSegment

DataCallback = Callable[[bytes, int], None]
Remover = Callable[[], None]


class BusConnection:
    """Sends frames, and calls the subscribers of an identifier.

    Args:
        segment: CAN segment to attach to.
        name: Name of the port.

    """

    def __init__(self, segment: CanSegment, name: str) -> None:
        # Callbacks, and whether they keep what comes and do nothing else.
        self._subscribers: dict[int, tuple[tuple[DataCallback, bool], ...]] = {}
        self._mailboxes: dict[int, FrameReceiver] = {}
        self._apart: set[int] = set()
        self.port: Final = segment.attach(name, self._receive)
        # A port in virtual time looks up itself who takes a frame.
        self._medium_port = self.port if isinstance(self.port, MediumPort) else None
        if self._medium_port is not None:
            self._medium_port.accept(self._mailboxes, self._apart)

    def send(self, cob_id: int, data: bytes) -> None:
        """Queue a data frame with an 11-bit identifier."""
        self.port.send(CanFrame(cob_id, data))

    def send_remote(self, cob_id: int, dlc: int = 0) -> None:
        """Queue a remote frame: a guarding request or a PDO request."""
        self.port.send(CanFrame(cob_id, remote=True, dlc=dlc))

    def subscribe(self, cob_id: int, callback: DataCallback, *, apart: bool = False) -> Remover:
        """Call `callback(data, time_ns)` for data frames with an 11-bit identifier; return the remover.

        `data` is what came on the wire, of any length: the callback must not trust it.

        Args:
            cob_id: Identifier.
            callback: Takes data and time.
            apart: It keeps what comes and does nothing else (`Timer.apart`).

        """
        subscribers = self._subscribers
        entry = (callback, apart)
        self._subscribe(cob_id, (*subscribers.get(cob_id, ()), entry))

        def remove() -> None:
            self._subscribe(
                cob_id, tuple(other for other in subscribers.get(cob_id, ()) if other[0] is not callback)
            )

        return remove

    def _subscribe(self, cob_id: int, callbacks: tuple[tuple[DataCallback, bool], ...]) -> None:
        self._apart.discard(cob_id)
        if not callbacks:
            self._subscribers.pop(cob_id, None)
            self._mailboxes.pop(cob_id, None)
        else:
            self._subscribers[cob_id] = callbacks
            self._mailboxes[cob_id] = _only(callbacks[0][0]) if len(callbacks) == 1 else self._receive
            if all(apart for _, apart in callbacks):
                self._apart.add(cob_id)
        if self._medium_port is not None:
            self._medium_port.accept(self._mailboxes, self._apart)

    def _receive(self, frame: CanFrame, time_ns: int) -> None:
        callbacks = self._subscribers.get(frame.can_id)
        if callbacks is None or frame.remote or frame.extended:
            return
        data = frame.data
        for callback, _ in callbacks:
            callback(data, time_ns)


def _only(callback: DataCallback) -> FrameReceiver:
    """Return what gives the data of a frame to a callback."""

    def take(frame: CanFrame, time_ns: Any) -> None:  # compiled, the same object passes through
        callback(frame.data, time_ns)

    return take
