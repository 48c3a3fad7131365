"""What the history is told of the buses behind a live segment."""

from __future__ import annotations

from typing import Any

import can

from fieldbus.can.message import read_error
from fieldbus.can.side import FD_REASON, BusSide
from fieldbus.history import History


class SideReports:
    """Tells of failures, error frames and what is no frame.

    Args:
        name: Name of the segment.
        history: Where events go; None: nowhere.
        bridged: Whether there are two buses, so that events have to say which.

    """

    __slots__ = ("_bridged", "_history", "_name", "ignored")

    def __init__(self, name: str, history: History | None, *, bridged: bool) -> None:
        self.ignored = {"fd": 0, "garbled": 0}
        self._name = name
        self._history = history
        self._bridged = bridged

    def _emit(self, side: BusSide, kind: str, **data: Any) -> None:
        if self._history is not None:
            self._history.emit(self._name, kind, port=side.name if self._bridged else "", **data)

    def error(self, side: BusSide, message: can.Message) -> str:
        """Tell of an error frame; returns the word for the error, empty when it was a change of state
        alone.
        """
        code, state = read_error(message)
        if not code and state is None:
            code = "UNKNOWN"
        if code:
            self._emit(side, "can.bus_error", code=code, can_id=0)
        if state is not None:
            self._emit(side, "can.status", status=state.value)
        return code

    def ignore(self, side: BusSide, reason: str, can_id: int | None) -> None:
        """Count what came and is no frame, and tell of the first of its kind: there may be thousands."""
        kind = "fd" if reason == FD_REASON else "garbled"
        self.ignored[kind] += 1
        if self.ignored[kind] == 1:
            more: dict[str, Any] = {} if can_id is None else {"can_id": can_id}
            self._emit(side, "can.ignored", reason=f"{reason}; further ones are counted only", **more)

    def changed(
        self,
        side: BusSide,
        *,
        reason: str = "",
        receive_failed: bool | None = None,
        send_failed: bool | None = None,
    ) -> None:
        """Note what became known of a bus, and tell whether it is down.

        A frame that can be sent does not prove that receiving works; a bus that receives again after a
        failure will also take frames again, until the next attempt says otherwise.
        """
        before = side.down
        if receive_failed is not None:
            side.receive_failed = receive_failed
            side.send_failed = side.send_failed and receive_failed
        if send_failed is not None:
            side.send_failed = send_failed
        if side.down != before:
            self._emit(side, "can.status", status="DOWN" if side.down else "UP", reason=reason)
