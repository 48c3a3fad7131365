"""Faults of a live segment as a whole: what can be done with an adapter, or with a bridge between two."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Final

from fieldbus.clock import MS
from fieldbus.errors import BusError, ConfigurationError, UnsupportedFaultError
from hil.faults._action import Action
from hil.faults._fault import Fault, parse_payload
from hil.protocols import Bench

_BABBLE_PERIOD_NS: Final = MS


def live_babble(bench: Bench, segment: Any, fault: Fault) -> Action:
    """Return a babbling node: every millisecond as many frames as the wire could carry in it, or the adapter
    takes.
    """
    return _Babble(bench, segment, fault)


def break_bridge(segment: Any, fault: Fault) -> Action:
    """Return the action that separates the two sides of a bridge.

    Raises:
        UnsupportedFaultError: The segment is no bridge of our own.
        ConfigurationError: What is cut off is no side of it.

    """
    if not getattr(segment, "bridged", False):
        raise UnsupportedFaultError(
            f"{fault.kind} cannot be injected on {segment.name}: it needs a hand at the cable, or a bridge "
            f"of the bench"
        )
    key = "node" if fault.kind == "can.unplug" else "nodes"
    wanted = [name.strip() for name in str(fault.value(key)).split(",")]
    sides = [side.name for side in segment.sides]
    for name in wanted:
        if name not in sides:
            raise ConfigurationError(f"{fault.kind}.parameters.{key}", name, ", ".join(sides))
    mend: list[Callable[[], None]] = []

    def join() -> None:
        mend.pop()()

    return Action(segment.name, lambda: mend.append(segment.cut()), join)


class _Babble(Action):
    """Sends in bursts, because no timer of a program comes as often as a frame on the wire."""

    __slots__ = ("_bench", "_burst", "_frame", "_node", "_segment", "_timer")

    def __init__(self, bench: Bench, segment: Any, fault: Fault) -> None:
        from fieldbus.can import CanFrame, frame_time_ns

        super().__init__(segment.name, self._send, self._stop)
        self._bench = bench
        self._segment = segment
        self._node = str(fault.value("node"))
        data = parse_payload("can.babble.parameters.data", fault.value("data"))
        self._frame = CanFrame(fault.value("can_id"), data, extended=fault.value("extended"))
        self._burst = max(1, _BABBLE_PERIOD_NS // frame_time_ns(self._frame, segment.bitrate))
        self._timer: Any = None

    def _send(self) -> None:
        try:
            for _ in range(self._burst):
                self._segment.inject(self._frame, sender=self._node)
        except BusError:  # the adapter's queue is full, which is what was wanted
            pass
        self._timer = self._bench.scheduler.after(_BABBLE_PERIOD_NS, self._send)

    def _stop(self) -> None:
        if self._timer is not None:
            self._timer.cancel()
