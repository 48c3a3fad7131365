"""Fault confinement of the nodes of a bus section: error states, recovery from
bus-off, and the events about both.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Final

from fieldbus.can.confinement import (
    RECOVERY_SEQUENCE_BITS,
    RECOVERY_SEQUENCES,
    ErrorCode,
    NodeState,
    state_of,
)
from fieldbus.can.frame import CanFrame
from fieldbus.can.port import MediumPort
from fieldbus.clock import S, Scheduler
from fieldbus.history import History

BusErrorListener = Callable[[int, str, ErrorCode, CanFrame | None, str], object]
"""Called with time (ns), name of the node that found the error, the error, the frame that it was sending
(None: it was receiving) and the field of the frame.
"""

StateChange = tuple[MediumPort, NodeState, NodeState]
"""A port, its old and its new state."""

_OVERRUN_EVENT_NS: Final = S  # at most one event per node in this time


class ErrorHandling:
    """Derives the state of the nodes from their error counters, times their recovery, and reports both.

    Args:
        scheduler: Time.
        name: Name of the segment in the history.
        bitrate: bit/s.
        history: Receives `can.status`, `can.bus_error`, `can.overrun`, `can.given_up` and `can.overload`.
        listeners: Called whenever `can.bus_error` is written.
        on_bus_off: Called when a node goes bus-off, before its recovery begins.
        on_recovered: Called when the bus was recessive for long enough to end bus-off.

    """

    def __init__(
        self,
        scheduler: Scheduler,
        *,
        name: str,
        bitrate: int,
        history: History | None,
        listeners: list[BusErrorListener],
        on_bus_off: Callable[[MediumPort], None],
        on_recovered: Callable[[MediumPort], None],
    ) -> None:
        self.listeners = listeners
        self.quiet_since_ns = scheduler.now
        """Start of the last ACK or error delimiter, ns: recessive bits count from there."""
        self._scheduler = scheduler
        self._name = name
        self._bitrate = bitrate
        self.history = history
        self._on_bus_off = on_bus_off
        self._on_recovered = on_recovered
        self._sequence_ns = RECOVERY_SEQUENCE_BITS * S // bitrate
        self._overrun_event_ns: dict[str, int] = {}

    # -- states

    def update_state(self, port: MediumPort, changes: list[StateChange]) -> None:
        """Set the state of `port` by its counters, and add a change to
        `changes`; only recovery ends bus-off.
        """
        if port.state is not NodeState.BUS_OFF:
            self.change_state(port, state_of(port.tec, port.rec), changes)

    def change_state(self, port: MediumPort, state: NodeState, changes: list[StateChange]) -> None:
        """Set the state of `port`, and add a change to `changes`."""
        old = port.state
        if state is old:
            return
        port.state = state
        changes.append((port, old, state))
        if state is NodeState.BUS_OFF:
            port.can_send = False
            self._on_bus_off(port)
            if port.auto_recovery:
                self.begin_recovery(port)

    def report(self, changes: list[StateChange]) -> None:
        """Write the events about `changes`, and call the listeners of the ports."""
        for port, old, new in changes:
            if self.history is not None:
                self.history.emit(
                    self._name, "can.status", port=port.name, status=new.value, tec=port.tec, rec=port.rec
                )
            for listener in tuple(port.on_state):
                listener(old, new)

    # -- events

    def report_error(self, port: MediumPort, code: ErrorCode, field: str, frame: CanFrame | None) -> None:
        """Write that `port` has found an error; `frame`: what it was sending."""
        if self.history is not None:
            role = {"can_id": frame.can_id, "tec": port.tec} if frame is not None else {"rec": port.rec}
            self.history.emit(
                self._name, "can.bus_error", port=port.name, code=code.value, field=field, **role
            )
        for listener in tuple(self.listeners):
            listener(self._scheduler.now, port.name, code, frame, field)

    def report_given_up(self, port: MediumPort, can_id: int, reason: str) -> None:
        """Write that `port` does not repeat a frame."""
        if self.history is not None:
            self.history.emit(self._name, "can.given_up", port=port.name, can_id=can_id, reason=reason)

    def report_overload(self, port: MediumPort) -> None:
        """Write that `port` has begun an overload frame."""
        if self.history is not None:
            self.history.emit(self._name, "can.overload", port=port.name)

    def overrun(self, port: MediumPort) -> None:
        """Count a frame that `port` has refused because its queue is full; at most one event a second."""
        port.overruns += 1
        now = self._scheduler.now
        last = self._overrun_event_ns.get(port.name)
        if last is not None and now - last < _OVERRUN_EVENT_NS:
            return
        self._overrun_event_ns[port.name] = now
        self._scheduler.catch_up()
        if self.history is not None:
            self.history.emit(self._name, "can.overrun", port=port.name, count=port.overruns)
        for listener in tuple(port.on_overrun):
            listener()

    # -- recovery from bus-off (CANP-055)

    def begin_recovery(self, port: MediumPort) -> None:
        """Begin to count recessive sequences, if `port` is bus-off."""
        if port.state is NodeState.BUS_OFF and port.online and port.recovery_timer is None:
            port.recovery_count = 0
            port.recovery_from_ns = self._scheduler.now
            self.await_recovery(port)

    def await_recovery(self, port: MediumPort) -> None:
        """Enter the time at which the bus, staying recessive, completes the
        sequences that are still missing.
        """
        missing = (RECOVERY_SEQUENCES - port.recovery_count) * RECOVERY_SEQUENCE_BITS
        due = max(self.quiet_since_ns, port.recovery_from_ns) + missing * S // self._bitrate
        self.stop_recovery(port)
        port.recovery_timer = self._scheduler.at(
            max(due, self._scheduler.now), lambda: self._on_recovered(port)
        )

    def stop_recovery(self, port: MediumPort) -> None:
        """Count no longer."""
        if port.recovery_timer is not None:
            port.recovery_timer.cancel()
            port.recovery_timer = None

    def count_quiet(self, ports: Iterable[MediumPort], start_ns: int, quiet_ns: int) -> None:
        """Count the recessive sequences before the frame from `start_ns` to
        `quiet_ns`, where the next ones start.
        """
        waiting = [port for port in ports if port.recovery_timer is not None]
        for port in waiting:
            recessive = start_ns - max(self.quiet_since_ns, port.recovery_from_ns)
            if recessive > 0:
                port.recovery_count += recessive // self._sequence_ns
        self.quiet_since_ns = quiet_ns
        for port in waiting:
            self.await_recovery(port)
