"""A bus of python-can as a segment in real time: SocketCAN, USB adapters, UDP multicast, serial adapters."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Mapping
from functools import partial
from threading import Event
from types import TracebackType
from typing import TYPE_CHECKING, Final, Self

import can

from fieldbus.can.fd import NO_FD, wire_bits
from fieldbus.can.frame import CanFrame, FrameReceiver
from fieldbus.can.frame_log import LogEntry
from fieldbus.can.hooks import FrameHook, FrameHooks, ask_hooks
from fieldbus.can.registry import register_segment
from fieldbus.can.side import BusSide, SideReports, echoes, open_bus
from fieldbus.clock import RealtimeScheduler, Scheduler
from fieldbus.errors import BusError, ConfigurationError, UnsupportedFaultError
from fieldbus.history import History

if TYPE_CHECKING:
    from fieldbus.can.kernel_bridge import KernelBridge

BUS: Final = "bus"
"""Name of the sender of everything that comes from outside, where there is no bridge."""


class LivePort:
    """A local node's connection to a live segment; made by `LiveSegment.attach`.

    Args:
        name: Name of the node.
        receive: Called with every frame for the node.
        listen_only: Whether it must not send.
        confirm: Called with every own frame that the bus has taken.
        takes_fd: Whether it takes and sends frames of CAN FD.
        submit: Sends a frame of the port.
        leave: Removes the port from its segment.

    """

    def __init__(
        self,
        name: str,
        receive: FrameReceiver,
        *,
        listen_only: bool,
        confirm: FrameReceiver | None,
        takes_fd: bool,
        submit: Callable[[LivePort, CanFrame], None],
        leave: Callable[[LivePort], None],
    ) -> None:
        self.name = name
        self.receive = receive
        self.listen_only = listen_only
        self.confirm = confirm
        self.takes_fd = takes_fd
        self.online = True
        """False: the node neither sends nor receives. The adapter continues
        acknowledging what is on the bus.
        """
        self.detached = False
        self._submit = submit
        self._leave = leave

    def send(self, frame: CanFrame) -> None:
        """Hand `frame` to the bus and to the other local nodes.

        Raises:
            BusError: The port is detached or listens only, the segment is closed, the bus refuses, or the
                frame is none that the segment carries.

        """
        self._submit(self, frame)

    def send_all(self, frames: Iterable[CanFrame]) -> None:
        """Hand several frames over, in their order; see `send`."""
        for frame in frames:
            self._submit(self, frame)

    def detach(self) -> None:
        """Leave the segment for good; harmless to repeat."""
        self.detached = True
        self.online = False
        self._leave(self)

    def __repr__(self) -> str:
        where = "detached" if self.detached else "online" if self.online else "offline"
        return f"<LivePort {self.name}: {where}>"


class LiveSegment:
    """A python-can bus as a segment; local nodes see the bus and each other.

    A thread waits for frames and hands them to the scheduler; everything else runs there. A bus that fails or
    comes back is reported in the history (`can.status` with status DOWN or UP) and makes `send` raise.

    With a bridge the segment is two buses made one: what comes from either side goes to the other, and can be
    hooked on the way, although neither its sender nor its receivers are in this process. Without hooks,
    a frame is passed on at once by the thread that has received it, also when the scheduler stands still.

    Args:
        scheduler: A realtime scheduler.
        bus: An open bus, that has no other reader.
        name: Name in logs; also registered for `can.Bus(interface="hil", channel=name)`.
        bridge: A second open bus.
        side_names: Senders of what comes from `bus` and `bridge`, for hooks and the log; default "bus",
            and with a bridge "near" and "far".
        history: Where `can.status` and `can.bus_error` events go.
        keep_log: Whether `log` is written.
        close_bus: Whether `close` shuts the buses down.
        echo: Whether the bus gives own frames back, as UDP multicast does and others do with
            `receive_own_messages`: they are then taken out again. Default: by the kind of bus.
        lossy: A frame that the bus refuses is lost without an exception, as for a device that keeps running
            while its bus is down or nobody acknowledges.
        data_bitrate: Bit rate of the data phase of CAN FD, bit/s, as it is set at the interface; None: a
            classical segment, on which a CAN FD frame is only counted.

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
        bridge: can.BusABC | None = None,
        side_names: tuple[str, str] | None = None,
        history: History | None = None,
        keep_log: bool = True,
        close_bus: bool = True,
        echo: bool | None = None,
        lossy: bool = False,
        data_bitrate: int | None = None,
    ) -> None:
        self._realtime = _realtime(scheduler)
        self.scheduler: Scheduler = scheduler
        self.name = name
        self.log: list[LogEntry] = []
        """Every frame in the order in which it was sent or came; grows, is never replaced."""
        self.bitrate: int | None = None
        """Bit rate of the wire, bit/s, if configured; the adapter does not report it."""
        self.data_bitrate: int | None = data_bitrate
        """Bit rate of the data phase of CAN FD, bit/s; None: a classical segment."""
        self.kernel: KernelBridge | None = None
        """The bridge of the kernel that this segment is on, if there is one."""
        self._reports = SideReports(name, history, bridged=bridge is not None)
        self.ignored = self._reports.ignored
        """What came and was no frame of the segment: CAN FD frames on a classical one, and what the driver
        could not read. One event each.
        """
        self._keep_log = keep_log
        self._lossy = lossy
        self._ports: tuple[LivePort, ...] = ()
        self._hooks = FrameHooks()
        self._busy_bits = 0
        self._parted = False
        self._last_ns = scheduler.now
        self._closed = Event()
        names = side_names or ((BUS, BUS) if bridge is None else ("near", "far"))
        self.sides: tuple[BusSide, ...] = tuple(
            BusSide(
                one,
                name=side_name,
                owner=self,
                clock=self._now,
                echo=echoes(one) if echo is None else echo,
                close_bus=close_bus,
                fd=data_bitrate is not None,
            )
            for one, side_name in zip((bus,) if bridge is None else (bus, bridge), names, strict=False)
        )
        """The bus, and the other one of a bridge."""
        register_segment(self)
        for side in self.sides:
            side.start()

    @classmethod
    def open(
        cls,
        scheduler: Scheduler,
        *,
        interface: str,
        channel: object,
        name: str = "can0",
        history: History | None = None,
        keep_log: bool = True,
        lossy: bool = False,
        fd_bitrate: int | None = None,
        bridge: Mapping[str, object] | None = None,
        **options: object,
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
            fd_bitrate: Bit rate of the data phase of CAN FD, bit/s; None: a classical segment.
            bridge: `channel` of the second bus of a bridge, its `interface` if it is another one, and its
                options. The channels are the names of the sides then. With `gateway` = "kernel" the kernel
                joins the two, and the segment is on the first; `kernel` then takes the faults that it can do.
            options: Further options of the interface, such as `bitrate` or `port`.

        Raises:
            BusError: A bus cannot be opened.
            ConfigurationError: The scheduler does not run in real time.

        """
        _realtime(scheduler)
        echo = True if options.get("receive_own_messages") else None
        bus = open_bus(name, interface, channel, options)
        further = dict(bridge or {})
        kernel = None
        if further.pop("gateway", "bench") == "kernel":
            from fieldbus.can.kernel_bridge import KernelBridge

            try:
                kernel = KernelBridge(str(channel), str(further["channel"]), fd=fd_bitrate is not None)
            except BusError as error:
                bus.shutdown()
                raise BusError(f"{name}: {error}") from error
        if bridge is None or kernel is not None:
            segment = cls(
                scheduler,
                bus,
                name=name,
                history=history,
                keep_log=keep_log,
                echo=echo,
                lossy=lossy,
                data_bitrate=fd_bitrate,
            )
            segment.kernel = kernel
            return segment
        far_channel, far_interface = further.pop("channel"), str(further.pop("interface", interface))
        try:
            far = open_bus(name, far_interface, far_channel, further)
        except BusError:
            bus.shutdown()
            raise
        names = (str(channel), str(far_channel))
        if names[0] == names[1]:  # the same name on two kinds of interface
            names = (f"{interface} {channel}", f"{far_interface} {far_channel}")
        return cls(
            scheduler,
            bus,
            name=name,
            bridge=far,
            side_names=names,
            history=history,
            keep_log=keep_log,
            echo=echo,
            lossy=lossy,
            data_bitrate=fd_bitrate,
        )

    @property
    def down(self) -> bool:
        """Whether the bus, or one of those of a bridge, is known to fail."""
        return any(side.down for side in self.sides)

    @property
    def bridged(self) -> bool:
        """Whether the segment is made of two buses."""
        return len(self.sides) > 1

    def __repr__(self) -> str:
        state = "closed" if self._closed.is_set() else "down" if self.down else "up"
        where = " and ".join(str(side.bus.channel_info) for side in self.sides)
        return f"<LiveSegment {self.name} on {where}, {state}, {len(self._ports)} local nodes>"

    # --------------------------------------------------------------------------------------------- nodes

    def attach(
        self,
        name: str,
        receive: FrameReceiver,
        *,
        listen_only: bool = False,
        confirm: FrameReceiver | None = None,
        fd: bool = False,
    ) -> LivePort:
        """Connect a local node.

        Args:
            name: Its name in logs; no two local nodes may share one.
            receive: Called with every frame of the bus and of the other local nodes, and its time (ns).
            listen_only: Must not send.
            confirm: Called with every own frame that the bus has taken.
            fd: Whether the node takes and sends frames of CAN FD.

        Raises:
            BusError: The name is taken.
            ConfigurationError: CAN FD on a classical segment.

        """
        if fd and self.data_bitrate is None:
            raise ConfigurationError("fd", fd, f"a segment with data_bitrate; {self.name} has none")
        if any(port.name == name for port in self._ports):
            raise BusError(f"a port named {name!r} is already attached to {self.name}")
        port = LivePort(
            name,
            receive,
            listen_only=listen_only,
            confirm=confirm,
            takes_fd=fd,
            submit=self._submit,
            leave=self._leave,
        )
        self._ports = (*self._ports, port)
        return port

    def _leave(self, port: LivePort) -> None:
        self._ports = tuple(other for other in self._ports if other is not port)

    @property
    def ports(self) -> tuple[LivePort, ...]:
        """The local nodes in the order in which they came."""
        return self._ports

    # --------------------------------------------------------------------------------------------- sending

    def _submit(self, port: LivePort, frame: CanFrame) -> None:
        if port.detached:
            raise BusError(f"port {port.name} is detached from {self.name}")
        if port.listen_only:
            raise BusError(f"port {port.name} on {self.name} listens only")
        if frame.fd and not port.takes_fd:
            raise BusError(f"port {port.name} on {self.name} sends no CAN FD frames")
        if not port.online:
            return
        self._check(frame)
        self._treat(frame, port.name, self._now(), lambda treated: self._send(treated, port.name, port))

    def inject(self, frame: CanFrame, sender: str = "fault") -> None:
        """Send `frame` past the hooks, to the bus and to all local nodes.

        Raises:
            BusError: The segment is closed, the bus refuses, or the frame is none that the segment carries.

        """
        self._check(frame)
        self._send(frame, sender, None)

    def _check(self, frame: CanFrame) -> None:
        if frame.fd and self.data_bitrate is None:
            raise BusError(NO_FD)
        wire_bits(frame, self.bitrate, self.data_bitrate)

    def _send(self, frame: CanFrame, sender: str, port: LivePort | None) -> None:
        if self._closed.is_set():
            raise BusError(f"{self.name} is closed")
        if port is not None and not port.online:  # went offline while its frame was delayed
            return
        reached = self.sides[:1] if self._parted else self.sides
        refusals = [reason for side in reached if (reason := self._hand_over(side, frame))]
        if len(refusals) == len(reached):
            if self._lossy:
                return
            raise BusError(f"{self.name}: {frame!r} cannot be sent: {refusals[0]}")
        time_ns = self._write(self._now(), sender, frame)
        if port is not None and port.confirm is not None:
            confirm = port.confirm
            self.scheduler.post(lambda: confirm(frame, time_ns))
        if len(self._ports) > (port is not None):
            self.scheduler.post(lambda: self._deliver(frame, time_ns, port))

    def _hand_over(self, side: BusSide, frame: CanFrame) -> str:
        """Give `frame` to one bus; returns why it was refused, empty when it was not."""
        try:
            side.send(frame)
        except BusError as error:
            self._reports.changed(side, reason=f"sending failed: {error}", send_failed=True)
            return str(error)
        if side.down:
            self._reports.changed(side, send_failed=False)
        return ""

    # --------------------------------------------------------------------------------------------- receiving

    def arrived(self, side: BusSide, frame: CanFrame, time_ns: int) -> None:
        """Take a frame; called in the reader's thread.

        A frame of a bridge that nobody hooks overtakes nothing when it is passed on here: as long as an
        earlier one of its side waits for the scheduler, it waits too.
        """
        passed = False
        if self._parted and side is not self.sides[0]:
            return
        if self.bridged:
            with side.order:
                if self._hooks.active or side.pending:
                    side.pending += 1
                else:
                    passed = True
                    self._pass_on(side, frame)
        self.scheduler.post(partial(self._received, side, frame, time_ns, passed=passed))

    def _pass_on(self, side: BusSide, frame: CanFrame) -> None:
        """Give a frame of one side to the other; a failure is only reported."""
        if self._parted:
            return
        for other in self.sides:
            if other is side:
                continue
            try:
                other.send(frame)
            except BusError as error:
                reason = f"sending failed: {error}"
                self.scheduler.post(partial(self._reports.changed, other, reason=reason, send_failed=True))
            else:
                if other.send_failed:
                    self.scheduler.post(partial(self._reports.changed, other, send_failed=False))

    def _received(self, side: BusSide, frame: CanFrame, time_ns: int, *, passed: bool) -> None:
        if not self._closed.is_set():
            if passed:
                self._take(side, frame, time_ns)
            else:
                try:
                    self._treat(frame, side.name, time_ns, partial(self._go_on, side, time_ns))
                finally:
                    with side.order:
                        side.pending -= self.bridged

    def _go_on(self, side: BusSide, time_ns: int, frame: CanFrame) -> None:
        if self.bridged:
            self._pass_on(side, frame)
        self._take(side, frame, time_ns)

    def _take(self, side: BusSide, frame: CanFrame, time_ns: int) -> None:
        self._deliver(frame, self._write(time_ns, side.name, frame), None)

    def arrived_error(self, side: BusSide, message: can.Message, time_ns: int) -> None:
        """Follow an error frame; called in the reader's thread."""
        self.scheduler.post(partial(self._received_error, side, message, time_ns))

    def _received_error(self, side: BusSide, message: can.Message, time_ns: int) -> None:
        code = self._reports.error(side, message)
        if code:
            self._write(time_ns, side.name, CanFrame(0), code)

    def arrived_garbled(self, side: BusSide, reason: str, can_id: int | None) -> None:
        """Follow something that is no classical frame; called in the reader's thread."""
        self.scheduler.post(partial(self._reports.ignore, side, reason, can_id))

    def _deliver(self, frame: CanFrame, time_ns: int, sender: LivePort | None) -> None:
        for port in self._ports:
            if port is not sender and port.online and (port.takes_fd or not frame.fd):
                port.receive(frame, time_ns)

    # --------------------------------------------------------------------------------------------- hooks

    def add_hook(self, hook: FrameHook) -> Callable[[], None]:
        """Call `hook` with every frame that a local node sends or that comes from the bus (sender "bus").

        Injected frames and copies are not hooked, delayed ones not again. A hook that wants a frame corrupted
        makes the call that brought the frame raise `UnsupportedFaultError`.

        Returns:
            The function that removes the hook; harmless to repeat.

        """
        return self._hooks.add(hook)

    def cut(self) -> Callable[[], None]:
        """Part the two sides of a bridge: local nodes stay with the first, nothing passes any more.

        Returns:
            The function that joins them again; harmless to repeat.

        Raises:
            BusError: There is no bridge, or it is parted already.

        """
        if not self.bridged or self._parted:
            raise BusError(f"{self.name} has no bridge that could be parted")
        self._parted = True

        def join() -> None:
            self._parted = False

        return join

    def withdraw(self, node: str) -> None:
        """Forget what `node` has injected and what still waits: nothing waits here, the adapter has it."""

    def _treat(self, frame: CanFrame, sender: str, time_ns: int, go_on: Callable[[CanFrame], None]) -> None:
        """Let the hooks decide how often and when `go_on` gets the frame."""
        verdict = ask_hooks(self._hooks.active, frame, sender, time_ns)
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

    # ------------------------------------------------------------------------------------------ state and end

    def _now(self) -> int:
        return max(self.scheduler.now, time.monotonic_ns() - self._realtime.origin_ns)

    def _write(self, time_ns: int, sender: str, frame: CanFrame, error: str = "") -> int:
        """Write the log and return the time of the entry; a late thread must not turn the order of times."""
        self._last_ns = time_ns = max(time_ns, self._last_ns)
        if not error:
            self._busy_bits += wire_bits(frame, self.bitrate, self.data_bitrate)
        if self._keep_log:
            self.log.append((time_ns, sender, frame, error))
        return time_ns

    def drop_log(self, count: int) -> None:
        """Remove the oldest entries of `log`, which somebody else keeps or nobody needs."""
        del self.log[:count]

    @property
    def busy_bits(self) -> int:
        """Bit times that the frames which were sent and received take on a wire, since the segment exists."""
        return self._busy_bits

    def receiving(self, side: BusSide, *, works: bool, reason: str) -> None:
        """Follow a failure of receiving, or its end; called in the reader's thread."""
        self.scheduler.post(partial(self._reports.changed, side, reason=reason, receive_failed=not works))

    def close(self) -> None:
        """End the readers and shut the buses down; harmless to repeat."""
        if self._closed.is_set():
            return
        self._closed.set()
        for side in self.sides:
            side.close()
        if self.kernel is not None:
            self.kernel.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()


def _realtime(scheduler: Scheduler) -> RealtimeScheduler:
    if not isinstance(scheduler, RealtimeScheduler):
        raise ConfigurationError("scheduler", type(scheduler).__name__, "a RealtimeScheduler for a live bus")
    return scheduler
