"""A bus of python-can as a segment in real time: SocketCAN, USB adapters, UDP multicast, serial adapters."""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable
from threading import Event, Thread
from types import TracebackType
from typing import Any, Final, Self

import can

from fieldbus.can.arbitration import LogEntry
from fieldbus.can.frame import CanFrame, FrameReceiver
from fieldbus.can.hooks import FrameHook, Verdict, ask_hooks
from fieldbus.can.message import read_error, to_frame, to_message
from fieldbus.can.registry import register_segment
from fieldbus.can.timing import frame_bits
from fieldbus.clock import MS, RealtimeScheduler, Scheduler
from fieldbus.errors import BusError, ConfigurationError, UnsupportedFaultError
from fieldbus.history import History

BUS: Final = "bus"
"""Name of the sender of everything that comes from outside."""

_POLL_S: Final = 0.1
_ECHO_LIMIT: Final = 4096
_ECHO_NS: Final = 500 * MS  # an echo that has not come by then was lost


class LivePort:
    """A local node's connection to a live segment; made by `LiveSegment.attach`."""

    __slots__ = ("confirm", "detached", "listen_only", "name", "online", "receive", "segment")

    def __init__(
        self,
        segment: LiveSegment,
        name: str,
        receive: FrameReceiver,
        *,
        listen_only: bool,
        confirm: FrameReceiver | None,
    ) -> None:
        self.segment = segment
        self.name = name
        self.receive = receive
        self.listen_only = listen_only
        self.confirm = confirm
        self.online = True
        """False: the node neither sends nor receives. The adapter goes on acknowledging what is on the bus."""
        self.detached = False

    def send(self, frame: CanFrame) -> None:
        """Hand `frame` to the bus and to the other local nodes.

        Raises:
            BusError: The port is detached or listens only, the segment is closed, the bus refuses, or the frame is
                no classical CAN frame.

        """
        self.segment.submit(self, frame)

    def detach(self) -> None:
        """Leave the segment for good; harmless to repeat."""
        self.segment.detach(self)

    def __repr__(self) -> str:
        where = "detached" if self.detached else "online" if self.online else "offline"
        return f"<LivePort {self.name} on {self.segment.name}: {where}>"


class LiveSegment:
    """A python-can bus as a segment; local nodes see the bus and each other.

    A thread waits for frames and hands them to the scheduler; everything else runs there. A bus that fails or comes
    back is told in the history (`can.status` with status DOWN or UP) and makes `send` raise.

    Args:
        scheduler: A realtime scheduler.
        bus: An open bus, to be received by nobody else.
        name: Name in logs; also registered for `can.Bus(interface="hil", channel=name)`.
        history: Where `can.status` and `can.bus_error` events go.
        keep_log: Whether `log` is written.
        close_bus: Whether `close` shuts the bus down.
        echo: Whether the bus gives own frames back, as UDP multicast does and others do with
            `receive_own_messages`: they are then taken out again. Default: by the kind of bus.
        lossy: A frame that the bus refuses is lost without an exception, as for a device that goes on living
            while its bus is down or nobody acknowledges.

    Raises:
        ConfigurationError: The scheduler does not run in real time.

    """

    hook_kinds: Final = frozenset({"drop", "delay", "replace", "duplicate"})
    """What hooks can do here: the frame itself is made by hardware and cannot be corrupted."""

    def __init__(
        self,
        scheduler: Scheduler,
        bus: can.BusABC,
        *,
        name: str = "can0",
        history: History | None = None,
        keep_log: bool = True,
        close_bus: bool = True,
        echo: bool | None = None,
        lossy: bool = False,
    ) -> None:
        if not isinstance(scheduler, RealtimeScheduler):
            raise ConfigurationError(
                "scheduler", type(scheduler).__name__, "a RealtimeScheduler for a live bus"
            )
        self.scheduler: Scheduler = scheduler
        self.name = name
        self.log: list[LogEntry] = []
        """Every frame in the order in which it was sent or came; grows, is never replaced."""
        self.down = False
        """Whether the last attempt to send or receive failed."""
        self._realtime = scheduler
        self._bus = bus
        self._history = history
        self._keep_log = keep_log
        self._lossy = lossy
        self._close_bus = close_bus
        self._echo = type(bus).__module__.startswith("can.interfaces.udp_multicast") if echo is None else echo
        self._awaited: deque[tuple[int, CanFrame]] = deque(maxlen=_ECHO_LIMIT)
        self._ports: tuple[LivePort, ...] = ()
        self._hooks: tuple[tuple[FrameHook], ...] = ()
        self._last_ns = scheduler.now
        self._closed = Event()
        self._reader = Thread(target=self._read, name=f"reader of {name}", daemon=True)
        register_segment(self)
        self._reader.start()

    @classmethod
    def open(
        cls,
        scheduler: Scheduler,
        *,
        interface: str,
        channel: Any,
        name: str = "can0",
        history: History | None = None,
        keep_log: bool = True,
        lossy: bool = False,
        **options: Any,
    ) -> Self:
        """Open a python-can bus and make it a segment, which owns it.

        Args:
            scheduler: A realtime scheduler.
            interface: Kind of bus as python-can names it: "socketcan", "udp_multicast", "slcan", ...
            channel: Which one: "can0", "239.74.163.2", "/dev/ttyACM0@115200", ...
            name: Name in logs.
            history: Where events go.
            keep_log: Whether `log` is written.
            lossy: A frame that the bus refuses is lost without an exception.
            options: Further options of the interface, such as `bitrate` or `port`.

        Raises:
            BusError: The bus cannot be opened.
            ConfigurationError: The scheduler does not run in real time.

        """
        if not isinstance(scheduler, RealtimeScheduler):
            raise ConfigurationError(
                "scheduler", type(scheduler).__name__, "a RealtimeScheduler for a live bus"
            )
        try:
            bus = can.Bus(interface=interface, channel=channel, **options)
        except Exception as error:  # a NameError, for example, where a vendor's library is missing
            raise BusError(f"{name}: {interface} {channel} cannot be opened: {error}") from error
        echo = True if options.get("receive_own_messages") else None
        return cls(scheduler, bus, name=name, history=history, keep_log=keep_log, echo=echo, lossy=lossy)

    def __repr__(self) -> str:
        state = "closed" if self._closed.is_set() else "down" if self.down else "up"
        return (
            f"<LiveSegment {self.name} on {self._bus.channel_info}, {state}, {len(self._ports)} local nodes>"
        )

    # --------------------------------------------------------------------------------------------- nodes

    def attach(
        self,
        name: str,
        receive: FrameReceiver,
        *,
        listen_only: bool = False,
        confirm: FrameReceiver | None = None,
    ) -> LivePort:
        """Connect a local node.

        Args:
            name: Its name in logs; no two local nodes may share one.
            receive: Called with every frame of the bus and of the other local nodes, and its time (ns).
            listen_only: Must not send.
            confirm: Called with every own frame that the bus has taken.

        Raises:
            BusError: The name is taken.

        """
        if any(port.name == name for port in self._ports):
            raise BusError(f"a port named {name!r} is already attached to {self.name}")
        port = LivePort(self, name, receive, listen_only=listen_only, confirm=confirm)
        self._ports = (*self._ports, port)
        return port

    def detach(self, port: LivePort) -> None:
        """See `LivePort.detach`."""
        port.detached = True
        port.online = False
        self._ports = tuple(other for other in self._ports if other is not port)

    @property
    def ports(self) -> tuple[LivePort, ...]:
        """The local nodes in the order in which they came."""
        return self._ports

    # --------------------------------------------------------------------------------------------- sending

    def submit(self, port: LivePort, frame: CanFrame) -> None:
        """See `LivePort.send`."""
        if port.detached:
            raise BusError(f"port {port.name} is detached from {self.name}")
        if port.listen_only:
            raise BusError(f"port {port.name} on {self.name} listens only")
        if not port.online:
            return
        frame_bits(frame)  # validates
        self._treat(frame, port.name, self._now(), lambda treated: self._send(treated, port.name, port))

    def inject(self, frame: CanFrame, sender: str = "fault") -> None:
        """Send `frame` past the hooks, to the bus and to all local nodes.

        Raises:
            BusError: The segment is closed, the bus refuses, or the frame is no classical CAN frame.

        """
        frame_bits(frame)  # validates
        self._send(frame, sender, None)

    def _send(self, frame: CanFrame, sender: str, port: LivePort | None) -> None:
        if self._closed.is_set():
            raise BusError(f"{self.name} is closed")
        if port is not None and not port.online:  # went offline while its frame was delayed
            return
        if self._echo:
            self._awaited.append((self._now(), frame))
        try:
            self._bus.send(to_message(frame))
        except (can.CanError, OSError, ValueError) as error:
            if self._echo:
                self._awaited.pop()
            self._changed(down=True, reason=f"sending failed: {error}")
            if self._lossy:
                return
            raise BusError(f"{self.name}: {frame!r} cannot be sent: {error}") from error
        self._changed(down=False)
        time_ns = self._write(self._now(), sender, frame)
        if port is not None and port.confirm is not None:
            confirm = port.confirm
            self.scheduler.post(lambda: confirm(frame, time_ns))
        if len(self._ports) > (port is not None):
            self.scheduler.post(lambda: self._deliver(frame, time_ns, port))

    # --------------------------------------------------------------------------------------------- receiving

    def _read(self) -> None:
        """Wait for messages; runs in a thread of its own and touches nothing but the scheduler's queue."""
        bus, closed, post = self._bus, self._closed, self.scheduler.post
        failed = False
        while not closed.is_set():
            try:
                message = bus.recv(_POLL_S)
            except Exception as error:  # noqa: BLE001 - drivers raise what they like, and this thread must not die
                if closed.is_set():
                    break
                if not failed:
                    failed = True
                    reason = f"receiving failed: {error}"
                    post(lambda reason=reason: self._changed(down=True, reason=reason))  # type: ignore[misc]
                closed.wait(_POLL_S)
                continue
            if failed:
                failed = False
                post(lambda: self._changed(down=False))
            if message is not None:  # `is_rx` is false also for other programs on this machine
                time_ns = time.monotonic_ns() - self._realtime.origin_ns
                post(lambda message=message, time_ns=time_ns: self._received(message, time_ns))  # type: ignore[misc]

    def _received(self, message: can.Message, time_ns: int) -> None:
        if self._closed.is_set():
            return
        if message.is_error_frame:
            self._received_error(message, time_ns)
            return
        try:
            frame = to_frame(message)
        except BusError as error:
            if self._history is not None:
                self._history.emit(self.name, "can.ignored", reason=str(error), can_id=message.arbitration_id)
            return
        if self._awaited and self._is_echo(frame):
            return
        self._treat(frame, BUS, time_ns, lambda treated: self._take(treated, time_ns))

    def _take(self, frame: CanFrame, time_ns: int) -> None:
        self._deliver(frame, self._write(time_ns, BUS, frame), None)

    def _received_error(self, message: can.Message, time_ns: int) -> None:
        code, state = read_error(message)
        if code or state is None:
            code = code or "UNKNOWN"
            self._write(time_ns, BUS, CanFrame(0), code)
            if self._history is not None:
                self._history.emit(self.name, "can.bus_error", port="", code=code, can_id=0)
        if state is not None and self._history is not None:
            self._history.emit(self.name, "can.status", port="", status=state.value)

    def _is_echo(self, frame: CanFrame) -> bool:
        """Return whether `frame` is one of our own that comes back."""
        now = self._now()
        while self._awaited and now - self._awaited[0][0] > _ECHO_NS:
            self._awaited.popleft()
        for index, (_, awaited) in enumerate(self._awaited):
            if awaited == frame:
                del self._awaited[index]
                return True
        return False

    def _deliver(self, frame: CanFrame, time_ns: int, sender: LivePort | None) -> None:
        for port in self._ports:
            if port is not sender and port.online:
                port.receive(frame, time_ns)

    # --------------------------------------------------------------------------------------------- hooks

    def add_hook(self, hook: FrameHook) -> Callable[[], None]:
        """Call `hook` with every frame that a local node sends or that comes from the bus (sender "bus").

        Injected frames and copies are not hooked, delayed ones not again. A hook that wants a frame corrupted makes the
        call that brought the frame raise `UnsupportedFaultError`.

        Returns:
            The function that removes the hook; harmless to repeat.

        """
        entry = (hook,)  # its own identity, so that the same function can be added twice
        self._hooks = (*self._hooks, entry)

        def remove() -> None:
            self._hooks = tuple(other for other in self._hooks if other is not entry)

        return remove

    def _treat(self, frame: CanFrame, sender: str, time_ns: int, go_on: Callable[[CanFrame], None]) -> None:
        """Let the hooks decide how often and when `go_on` gets the frame."""
        verdict: Verdict | None = None
        if self._hooks:
            verdict = ask_hooks([hook for (hook,) in self._hooks], frame, sender, time_ns)
        if verdict is None:
            go_on(frame)
            return
        if verdict.corruptions:
            raise UnsupportedFaultError(f"{self.name} is a live bus: frames cannot be corrupted on the wire")
        if verdict.dropped:
            return
        treated, times = verdict.frame, 1 + verdict.copies

        def repeat() -> None:
            for _ in range(times):
                go_on(treated)

        if verdict.delay_ns:
            self.scheduler.after(verdict.delay_ns, repeat)
        else:
            repeat()

    # --------------------------------------------------------------------------------------------- state and end

    def _now(self) -> int:
        return max(self.scheduler.now, time.monotonic_ns() - self._realtime.origin_ns)

    def _write(self, time_ns: int, sender: str, frame: CanFrame, error: str = "") -> int:
        """Write the log and return the time of the entry; a late thread must not turn the order of times."""
        self._last_ns = time_ns = max(time_ns, self._last_ns)
        if self._keep_log:
            self.log.append((time_ns, sender, frame, error))
        return time_ns

    def _changed(self, *, down: bool, reason: str = "") -> None:
        if down == self.down:
            return
        self.down = down
        if self._history is not None:
            status = "DOWN" if down else "UP"
            self._history.emit(self.name, "can.status", port="", status=status, reason=reason)

    def close(self) -> None:
        """End the reader and shut the bus down; harmless to repeat."""
        if self._closed.is_set():
            return
        self._closed.set()
        self._reader.join(10 * _POLL_S)
        if self._close_bus:
            self._bus.shutdown()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()
