"""The gateway for python-can programs: `can.Bus(interface="hil", channel=...)` is a node of a segment.

In virtual time a program that waits in `recv` lets the simulated time pass, so that a program that was
written for real hardware runs unchanged, and faster. Time-outs and periods are then simulated seconds, and so
are the time stamps.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from queue import Empty, SimpleQueue
from threading import get_ident
from typing import Final

import can
from can.broadcastmanager import (
    LimitedDurationCyclicSendTaskABC,
    ModifiableCyclicTaskABC,
    RestartableCyclicTaskABC,
)

from fieldbus.can.confinement import ErrorCode, NodeState
from fieldbus.can.frame import CanFrame
from fieldbus.can.medium import CanMedium
from fieldbus.can.message import error_message, status_message, to_frame, to_message
from fieldbus.can.port import MediumPort
from fieldbus.can.registry import find_segment
from fieldbus.can.segment import CanPort, CanSegment
from fieldbus.clock import S, Timer, seconds_to_ns
from fieldbus.errors import BusError

_FOREVER_NS: Final = 10**18
_STATES: Final = {
    NodeState.ERROR_ACTIVE: can.BusState.ACTIVE,
    NodeState.ERROR_PASSIVE: can.BusState.PASSIVE,
    NodeState.BUS_OFF: can.BusState.ERROR,
}


class HilBus(can.BusABC):
    """A python-can bus on a segment of this process.

    On a virtual segment it belongs to the one thread of the simulation: `recv` runs the scheduler, and is
    refused from other threads, so that a `can.Notifier` cannot be used there. On a segment in real time
    `send` and `recv` may be called from any thread; `recv` in the thread that made the bus runs the scheduler
    while nobody else does.

    Args:
        channel: The segment, or the name of one (`fieldbus.can.register_segment`).
        can_filters: As for every python-can bus.
        receive_own_messages: Whether own messages come back (`is_rx` false) when they have been sent.
        name: Name of the node in logs; default "python-can", with a number if that is taken.
        error_frames: Whether errors on the bus and changes of the own state are received as error frames,
            in the encoding of SocketCAN.
        bitrate: If given, must be that of the segment.
        fd: Take and send CAN FD messages, on a segment with `data_bitrate`.
        data_bitrate: If given, must be that of the segment.
        _options: Anything else that a configuration holds for other interfaces; not used.

    Raises:
        can.CanInitializationError: No such segment, another bit rate, or CAN FD on a classical segment.

    """

    def __init__(
        self,
        channel: CanSegment | str | int,
        can_filters: can.typechecking.CanFilters | None = None,
        *,
        receive_own_messages: bool = False,
        name: str | None = None,
        error_frames: bool = False,
        bitrate: int | None = None,
        fd: bool = False,
        data_bitrate: int | None = None,
        **_options: object,
    ) -> None:
        try:
            segment = find_segment(str(channel)) if isinstance(channel, str | int) else channel
        except BusError as error:
            raise can.CanInitializationError(str(error)) from error
        if not isinstance(segment, CanSegment):
            raise can.CanInitializationError(f"channel {channel!r} is neither a segment nor the name of one")
        if fd and segment.data_bitrate is None:
            raise can.CanInitializationError(
                f"CAN FD is not supported: {segment.name} is a classical CAN segment (no data_bitrate)"
            )
        if data_bitrate is not None and data_bitrate != segment.data_bitrate:
            raise can.CanInitializationError(
                f"the data phase of {segment.name} runs at {segment.data_bitrate} bit/s, not at "
                f"{data_bitrate} bit/s"
            )
        if bitrate is not None and isinstance(segment, CanMedium) and bitrate != segment.bitrate:
            raise can.CanInitializationError(
                f"{segment.name} runs at {segment.bitrate} bit/s, not at {bitrate} bit/s"
            )
        self.segment = segment
        self.channel_info = f"hil segment {segment.name}"
        self._scheduler = segment.scheduler
        self._thread = get_ident()
        self._scheduler_thread: int | None = None  # known once something has been received
        self._queue: SimpleQueue[can.Message] = SimpleQueue()
        self._receive_own = receive_own_messages
        self._fd = fd
        self._cleanup: list[Callable[[], object]] = []
        self.port = self._attach(name)
        self._controller = self.port if isinstance(self.port, MediumPort) else None
        if error_frames:
            self._listen_for_errors()
        super().__init__(channel=segment.name, can_filters=can_filters)
        self._can_protocol = can.CanProtocol.CAN_FD if fd else can.CanProtocol.CAN_20

    def _attach(self, name: str | None) -> CanPort:
        """Attach under `name`, or under the first default name that is free."""
        confirm = self._on_sent if self._receive_own else None
        if name is not None:
            try:
                return self.segment.attach(name, self._on_frame, confirm=confirm, fd=self._fd)
            except BusError as error:
                raise can.CanInitializationError(str(error)) from error
        taken = {port.name for port in self.segment.ports}
        number, default = 1, "python-can"
        while default in taken:
            number += 1
            default = f"python-can {number}"
        return self.segment.attach(default, self._on_frame, confirm=confirm, fd=self._fd)

    # --------------------------------------------------------------------------------------------- receiving

    def _on_frame(self, frame: CanFrame, time_ns: int) -> None:
        self._scheduler_thread = get_ident()
        self._queue.put(to_message(frame, time_s=time_ns / S, channel=self.segment.name))

    def _on_sent(self, frame: CanFrame, time_ns: int) -> None:
        self._queue.put(to_message(frame, time_s=time_ns / S, channel=self.segment.name, is_rx=False))

    def _listen_for_errors(self) -> None:
        port, segment, queue = self.port, self.segment, self._queue
        if not isinstance(segment, CanMedium) or not isinstance(port, MediumPort):
            port.detach()
            raise can.CanInitializationError(
                f"{segment.name} does not report errors: only a virtual segment does"
            )

        def on_error(time_ns: int, name: str, code: ErrorCode, frame: CanFrame | None, field: str) -> None:
            queue.put(
                error_message(
                    code,
                    time_s=time_ns / S,
                    channel=segment.name,
                    tec=port.tec,
                    rec=port.rec,
                    field=field,
                    sending=frame is not None and name == port.name,
                )
            )

        def on_state(_old: NodeState, new: NodeState) -> None:
            time_s = self._scheduler.now / S
            queue.put(status_message(new, time_s=time_s, channel=segment.name, tec=port.tec, rec=port.rec))

        segment.bus_error_listeners.append(on_error)
        port.on_state.append(on_state)
        self._cleanup.append(lambda: segment.bus_error_listeners.remove(on_error))

    def recv(self, timeout: float | None = None) -> can.Message | None:
        """Return the next message that passes the filters, or None after `timeout`
        seconds of the segment's time.

        Raises:
            can.CanOperationError: The bus is shut down; or without a time-out nothing can ever arrive,
                because the simulation has no event left; or it would have to wait inside of a callback, or on
                a virtual segment in a thread that the bus does not belong to.
            ValueError: The time-out is no number.

        """
        self._check_open()
        if timeout is not None and math.isnan(timeout):
            raise ValueError("timeout nan s is not a number of seconds")
        rest_ns = None if timeout is None or timeout == math.inf else seconds_to_ns(max(timeout, -1.0))
        while True:
            message, rest_ns = self._next(rest_ns)
            if message is None or self._matches_filters(message):
                return message

    def _next(self, timeout_ns: int | None) -> tuple[can.Message | None, int | None]:
        """Return the next message and what is left of the time-out."""
        try:
            return self._queue.get_nowait(), timeout_ns
        except Empty:
            if timeout_ns is not None and timeout_ns <= 0:
                return None, timeout_ns
        begin_ns = self._clock_ns()
        message: can.Message | None = None
        pumping = self._may_pump()
        if pumping:
            self._pump(timeout_ns)
        with suppress(Empty):
            if pumping:
                message = self._queue.get_nowait()
            else:
                message = self._queue.get(timeout=None if timeout_ns is None else timeout_ns / S)
        rest_ns = None if timeout_ns is None else timeout_ns - (self._clock_ns() - begin_ns)
        return message, rest_ns

    def _pump(self, timeout_ns: int | None) -> None:
        scheduler, queue = self._scheduler, self._queue
        if timeout_ns is not None:
            scheduler.run_until(lambda: not queue.empty(), timeout_ns)
        elif scheduler.realtime:
            scheduler.run_until(lambda: not queue.empty(), _FOREVER_NS)
        else:
            scheduler.run_until(lambda: not queue.empty() or scheduler.next_due_ns is None, _FOREVER_NS)
            if queue.empty():
                raise _NothingLeftError(
                    f"no message can arrive on {self.segment.name}: no event is left in the simulation"
                )

    def _may_pump(self) -> bool:
        """Return whether waiting means running the scheduler; if not, another thread runs it.

        Raises:
            can.CanOperationError: Waiting is impossible here.

        """
        scheduler = self._scheduler
        thread = get_ident()
        if not scheduler.realtime and thread != self._thread:
            raise can.CanOperationError(
                f"{self.segment.name} lives in virtual time, which has one thread: call recv in the thread "
                f"that made the "
                "bus, use callbacks of the segment in place of a Notifier, and for canopen "
                "fieldbus.canopen.PumpedNetwork"
            )
        if scheduler.running and (not scheduler.realtime or thread == self._scheduler_thread):
            raise can.CanOperationError("recv inside of a callback must not wait: use timeout=0")
        return thread == self._thread and not scheduler.running

    def _clock_ns(self) -> int:
        return time.monotonic_ns() if self._scheduler.realtime else self._scheduler.now

    def __iter__(self) -> Iterator[can.Message]:
        """Yield messages; on a virtual segment until no event is left that could bring another."""
        while True:
            try:
                message = self.recv(1.0 if self._scheduler.realtime else None)
            except _NothingLeftError:
                return
            if message is not None:
                yield message

    # --------------------------------------------------------------------------------------------- sending

    def send(self, msg: can.Message, timeout: float | None = None) -> None:  # noqa: ARG002 - never waits
        """Queue `msg`; it goes out while the scheduler runs.

        Raises:
            can.CanOperationError: The bus is shut down, the transmit queue is full, or the message is an
                error frame, a CAN FD message on a bus without `fd`, or no valid CAN message.

        """
        self._check_open()
        try:
            frame = self.frame_of(msg)
            if self._scheduler.realtime:
                self._scheduler.post(lambda: self._send_posted(frame))
                return
            refused = self._overruns
            self.port.send(frame)
        except BusError as error:
            raise can.CanOperationError(str(error)) from error
        if self._overruns != refused:
            raise can.CanOperationError(
                f"the transmit queue of {self.port.name} on {self.segment.name} is full"
            )

    def frame_of(self, message: can.Message) -> CanFrame:
        """Return a message as a frame that may be sent here.

        Raises:
            BusError: It is an error frame, a CAN FD message on a bus without `fd`, or no valid CAN message.

        """
        return to_frame(message, fd=self._fd)

    @property
    def _overruns(self) -> int:
        return 0 if self._controller is None else self._controller.overruns

    def _send_posted(self, frame: CanFrame) -> None:
        self._scheduler_thread = get_ident()
        with suppress(BusError):  # it is in the history of the segment, and there is no caller any more
            self.port.send(frame)

    def _send_periodic_internal(
        self,
        msgs: Sequence[can.Message] | can.Message,
        period: float,
        duration: float | None = None,
        autostart: bool = True,
        modifier_callback: Callable[[can.Message], None] | None = None,
    ) -> CyclicTask:
        self._check_open()
        return CyclicTask(
            self, msgs, period, duration, autostart=autostart, modifier_callback=modifier_callback
        )

    def flush_tx_buffer(self) -> None:
        """Remove the messages that wait for the bus."""
        if self._controller is not None:
            self._do(self._controller.flush)

    def _do(self, action: Callable[[], object]) -> None:
        """Carry out what belongs to the scheduler's thread."""
        if self._scheduler.realtime:
            self._scheduler.post(action)
        else:
            action()

    # ------------------------------------------------------------------------------------------ state and end

    @property
    def state(self) -> can.BusState:
        """ACTIVE, PASSIVE (error-passive) or ERROR (bus-off); always ACTIVE where it is not known."""
        return _STATES[NodeState.ERROR_ACTIVE if self._controller is None else self._controller.state]

    @state.setter
    def state(self, new_state: can.BusState) -> None:
        raise NotImplementedError(
            f"the state of a node follows from its error counters, {new_state} cannot be set"
        )

    def _check_open(self) -> None:
        if self._is_shutdown:
            raise can.CanOperationError(f"the bus on {self.segment.name} is shut down")

    def shutdown(self) -> None:
        """Stop the periodic messages and leave the segment; harmless to repeat."""
        if self._is_shutdown:
            return
        super().shutdown()
        for action in self._cleanup:
            action()
        if self._scheduler.realtime and self._scheduler.running:
            self._scheduler.post(self.port.detach)
        else:
            self.port.detach()


class _NothingLeftError(can.CanOperationError):
    """The simulation has come to its end."""


class CyclicTask(LimitedDurationCyclicSendTaskABC, ModifiableCyclicTaskABC, RestartableCyclicTaskABC):
    """A periodic message in the time of the segment, without a thread; made by `HilBus.send_periodic`.

    The first message goes out when the scheduler next runs, the others at whole periods from then. Several
    messages take turns. A message that finds the transmit queue full is lost.
    """

    def __init__(
        self,
        bus: HilBus,
        messages: Sequence[can.Message] | can.Message,
        period: float,
        duration: float | None,
        *,
        autostart: bool,
        modifier_callback: Callable[[can.Message], None] | None,
    ) -> None:
        if not math.isfinite(period) or seconds_to_ns(period) <= 0:
            raise ValueError(f"period {period} s is not a positive number of seconds")
        if duration is not None and not 0.0 <= duration < math.inf:
            raise ValueError(f"duration {duration} s is not a number of seconds, 0 or more")
        super().__init__(messages, period, duration)
        for message in self.messages:
            try:
                bus.frame_of(message)
            except BusError as error:
                raise ValueError(str(error)) from error
        self._bus = bus
        self._modify = modifier_callback
        self._timer: Timer | None = None
        self._end_ns: int | None = None
        self._next = 0
        if autostart:
            self.start()

    def start(self) -> None:
        """Send from now on; harmless while it runs."""
        self._bus._do(self._begin)  # noqa: SLF001 - one part with the bus

    def stop(self) -> None:
        """Stop sending; harmless when it has ended."""
        self._bus._do(self._end)  # noqa: SLF001 - one part with the bus

    def _begin(self) -> None:
        if self._timer is not None:
            return
        scheduler = self._bus.segment.scheduler
        now = scheduler.now
        self._next = 0
        self._end_ns = now + seconds_to_ns(self.duration) if self.duration else None
        self._timer = scheduler.every(self.period_ns, self._send, phase_ns=now % self.period_ns)

    def _end(self) -> None:
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None

    def _send(self) -> None:
        if self._end_ns is not None and self._bus.segment.scheduler.now >= self._end_ns:
            self._end()
            return
        message = self.messages[self._next]
        self._next = (self._next + 1) % len(self.messages)
        if self._modify is not None:
            self._modify(message)
        with suppress(BusError):  # reported by the segment; the next period tries again
            self._bus.port.send(self._bus.frame_of(message))
