"""Which part of a slave takes which frame."""

from __future__ import annotations

from collections.abc import Callable, Container, Iterable, Mapping

from fieldbus.can.frame import CanFrame

FrameHandler = Callable[[CanFrame, int], None]
"""Takes a frame and the time of its end, ns."""
Route = tuple[int, bool, FrameHandler]
"""Identifier, whether it has 29 bits, handler."""


class Dispatcher:
    """Tables from identifier to handler, rebuilt when state or configuration change; one look-up per frame.

    Args:
        to_local_time: Wraps a handler so that it gets times of the clock of the node; None: that is the clock
            of the bus.

    """

    def __init__(self, to_local_time: Callable[[FrameHandler], FrameHandler] | None = None) -> None:
        self._to_local_time = to_local_time
        self.on_change: Callable[[Mapping[int, FrameHandler], Container[int]], None] | None = None
        """Called with the table for data frames with 11-bit identifiers when it has changed, and with the
        identifiers whose handler keeps what comes and does nothing else.
        """
        self._data: dict[int, FrameHandler] = {}
        self._extended: dict[int, FrameHandler] = {}
        self._remote: dict[int, FrameHandler] = {}
        self._remote_extended: dict[int, FrameHandler] = {}

    def receive(self, frame: CanFrame, time_ns: int) -> None:
        """Give a frame to its handler."""
        if frame.remote:
            handler = (self._remote_extended if frame.extended else self._remote).get(frame.can_id)
        elif frame.extended:
            handler = self._extended.get(frame.can_id)
        else:
            handler = self._data.get(frame.can_id)
        if handler is not None:
            handler(frame, time_ns)

    def replace(
        self, data: Iterable[Route], remote: Iterable[Route], apart: Iterable[FrameHandler] = ()
    ) -> None:
        """Put new tables in effect; services that share an identifier all get
        the frame, in the given order.

        Args:
            data: Who takes data frames.
            remote: Who takes remote frames.
            apart: Those that keep what comes and do nothing else (`Timer.apart`).

        """
        data = list(data)
        self._data, self._extended = self._tables(data)
        self._remote, self._remote_extended = self._tables(remote)
        if self.on_change is not None:
            keeping = tuple(apart)
            seen = {can_id for can_id, _, handler in data if handler not in keeping}
            self.on_change(self._data, {can_id for can_id, _, _ in data} - seen)

    def _tables(self, routes: Iterable[Route]) -> tuple[dict[int, FrameHandler], dict[int, FrameHandler]]:
        basic, extended = _tables(routes)
        wrap = self._to_local_time
        if wrap is None:
            return basic, extended
        return {key: wrap(take) for key, take in basic.items()}, {
            key: wrap(take) for key, take in extended.items()
        }


def _tables(routes: Iterable[Route]) -> tuple[dict[int, FrameHandler], dict[int, FrameHandler]]:
    tables: tuple[dict[int, FrameHandler], dict[int, FrameHandler]] = ({}, {})
    for can_id, extended, handler in routes:
        table = tables[extended]
        first = table.get(can_id)
        table[can_id] = handler if first is None else _both(first, handler)
    return tables


def _both(first: FrameHandler, second: FrameHandler) -> FrameHandler:
    def take(frame: CanFrame, time_ns: int) -> None:
        first(frame, time_ns)
        second(frame, time_ns)

    return take
