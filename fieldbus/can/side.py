"""One python-can bus behind a live segment: the thread that waits for its messages, its echoes, and whether
it works.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from pathlib import Path
from threading import Event, Lock, Thread
from typing import Final, Protocol

import can

from fieldbus.can.fd import NO_FD
from fieldbus.can.frame import CanFrame
from fieldbus.can.message import read_error, to_frame, to_message
from fieldbus.clock import MS
from fieldbus.errors import BusError
from fieldbus.history import History, Scalar

_POLL_S: Final = 0.1
_ECHO_LIMIT: Final = 4096
_ECHO_NS: Final = 500 * MS  # an echo that has not come by then was lost
_GARBLED_LIMIT: Final = 100
"""Messages in a row that a driver cannot read, from which on it counts as broken."""
_IFF_UP: Final = 1
_INTERFACES: Final = Path("/sys/class/net")

_GARBLED: Final = (ValueError, IndexError, KeyError, TypeError)
"""What python-can's drivers raise when they cannot make a message of what came,
where others raise a `CanError`.
"""


class SideOwner(Protocol):
    """What a side reports, each in the reader's thread."""

    def arrived(self, side: BusSide, frame: CanFrame, time_ns: int) -> None:
        """A frame of another node has come."""

    def arrived_error(self, side: BusSide, message: can.Message, time_ns: int) -> None:
        """The adapter reports an error on the bus."""

    def arrived_garbled(self, side: BusSide, reason: str, can_id: int | None) -> None:
        """Something has come that is no classical frame."""

    def receiving(self, side: BusSide, *, works: bool, reason: str) -> None:
        """Receiving began to fail, or works again."""


class BusSide:
    """A python-can bus and the thread that waits for its messages.

    Args:
        bus: An open bus, that has no other reader.
        name: Sender of what comes from it, in logs and for hooks.
        owner: Gets everything that comes.
        clock: Time of the segment, ns; may be asked in any thread.
        echo: Whether own frames come back and are to be taken out again.
        close_bus: Whether `close` shuts the bus down.
        fd: Whether frames of CAN FD are taken.

    """

    def __init__(
        self,
        bus: can.BusABC,
        *,
        name: str,
        owner: SideOwner,
        clock: Callable[[], int],
        echo: bool,
        close_bus: bool,
        fd: bool = False,
    ) -> None:
        self.bus = bus
        self.name = name
        self.receive_failed = False
        """Receiving has failed and has not been seen to work since."""
        self.send_failed = False
        """The last attempt to send has failed."""
        self.order = Lock()
        """Held while it is decided whether a frame may overtake the scheduler's
        work; see `LiveSegment.arrived`.
        """
        self.pending = 0
        """Frames that wait for the scheduler."""
        self._owner = owner
        self._clock = clock
        self._echo = echo
        self._fd = fd
        self._close_bus = close_bus
        self._awaited: deque[tuple[int, CanFrame]] = deque(maxlen=_ECHO_LIMIT)
        self._sending = Lock()
        self._sent_since_failure = False
        self._closed = Event()
        self._flags = _flags_file(bus)
        self._reader = Thread(target=self._read, name=f"reader of {name}", daemon=True)

    @property
    def down(self) -> bool:
        """Whether the bus fails."""
        return self.receive_failed or self.send_failed

    def start(self) -> None:
        """Begin to receive."""
        self._reader.start()

    def send(self, frame: CanFrame) -> None:
        """Hand a frame to the bus; callable from any thread.

        Raises:
            BusError: The bus refuses.

        """
        with self._sending:
            if self._echo:
                self._awaited.append((self._clock(), frame))
            try:
                self.bus.send(to_message(frame))
            except (can.CanError, OSError, ValueError) as error:
                if self._echo:
                    self._awaited.pop()
                raise BusError(str(error)) from error
        self._sent_since_failure = True

    # ---------------------------------------------------------------------------------------- reader's thread

    def _read(self) -> None:
        """Wait for messages until the end."""
        bus, closed = self.bus, self._closed
        failures = garbled = 0  # in a row
        while not closed.is_set():
            try:
                message = bus.recv(_POLL_S)
            except Exception as error:  # noqa: BLE001 - drivers raise what they like, and this thread must not die
                if closed.is_set():
                    break
                cause = error.__cause__ or error  # some wrap it, as if the device had failed
                if isinstance(cause, _GARBLED) and garbled < _GARBLED_LIMIT:
                    garbled += 1
                    self._garbled(cause)
                    continue
                failures += 1
                if failures == 1:
                    self._sent_since_failure = False
                    self._owner.receiving(self, works=False, reason=f"receiving failed: {error}")
                closed.wait(_POLL_S)
                continue
            garbled = 0
            if failures and self._works_again(message, failures):
                failures = 0
                self._owner.receiving(self, works=True, reason="")
            if message is not None:  # `is_rx` is false also for other programs on this machine
                self._sort(message)

    def _works_again(self, message: can.Message | None, failures: int) -> bool:
        """Return whether a quiet `recv` after `failures` of them means that the bus is back.

        SocketCAN reports once that its interface is down and is silent from then on, up or down;
        frames that had come before may still be read. So the interface itself is asked. Where there
        is none to ask, silence is proof after a driver that has complained again and again, or
        after a frame that could be sent.
        """
        if self._flags is not None:
            try:
                return bool(int(self._flags.read_text(), 0) & _IFF_UP)
            except (OSError, ValueError):
                return False  # unplugged
        return message is not None or failures > 1 or self._sent_since_failure

    def _garbled(self, error: BaseException) -> None:
        self._owner.arrived_garbled(self, f"the driver cannot read what came: {error}", None)
        if isinstance(error, UnicodeDecodeError):  # the driver for serial adapters would fail on it forever
            flush = getattr(self.bus, "flush", None)
            if callable(flush):
                flush()

    def _sort(self, message: can.Message) -> None:
        time_ns = self._clock()
        if message.is_error_frame:
            self._owner.arrived_error(self, message, time_ns)
            return
        try:
            frame = to_frame(message, fd=self._fd)
        except BusError as error:
            self._owner.arrived_garbled(self, str(error), message.arbitration_id)
            return
        if not (self._awaited and self._is_echo(frame)):
            self._owner.arrived(self, frame, time_ns)

    def _is_echo(self, frame: CanFrame) -> bool:
        """Return whether `frame` is one of our own that comes back."""
        now = self._clock()
        with self._sending:
            while self._awaited and now - self._awaited[0][0] > _ECHO_NS:
                self._awaited.popleft()
            for index, (_, awaited) in enumerate(self._awaited):
                if awaited == frame:
                    del self._awaited[index]
                    return True
        return False

    # --------------------------------------------------------------------------------------------- end

    def close(self) -> None:
        """End the reader and shut the bus down."""
        self._closed.set()
        if self._reader.ident is not None:
            self._reader.join(10 * _POLL_S)
        if self._close_bus:
            self.bus.shutdown()


class SideReports:
    """Writes failures, error frames and what is no frame into the history.

    Args:
        name: Name of the segment.
        history: Where events go; None: nowhere.
        bridged: Whether there are two buses, so that events have to say which.

    """

    def __init__(self, name: str, history: History | None, *, bridged: bool) -> None:
        self.ignored = {"fd": 0, "garbled": 0}
        self._name = name
        self._history = history
        self._bridged = bridged

    def _emit(self, side: BusSide, kind: str, **data: Scalar) -> None:
        if self._history is not None:
            self._history.emit(self._name, kind, port=side.name if self._bridged else "", **data)

    def error(self, side: BusSide, message: can.Message) -> str:
        """Report an error frame; returns the word for the error, empty when
        it was a change of state alone.
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
        """Count what came and is no frame, and report the first of its kind: there may be thousands."""
        kind = "fd" if reason == NO_FD else "garbled"
        self.ignored[kind] += 1
        if self.ignored[kind] == 1:
            more: dict[str, Scalar] = {} if can_id is None else {"can_id": can_id}
            self._emit(side, "can.ignored", reason=f"{reason}; further ones are counted only", **more)

    def changed(
        self,
        side: BusSide,
        *,
        reason: str = "",
        receive_failed: bool | None = None,
        send_failed: bool | None = None,
    ) -> None:
        """Note what became known of a bus, and report whether it is down.

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


def _flags_file(bus: can.BusABC) -> Path | None:
    """Return the file in which the kernel reports whether the interface of a SocketCAN bus is up."""
    if not type(bus).__module__.startswith("can.interfaces.socketcan"):
        return None
    return _INTERFACES / str(getattr(bus, "channel", "")) / "flags"


def echoes(bus: can.BusABC) -> bool:
    """Return whether a bus gives own frames back unasked, as UDP multicast of python-can does."""
    return type(bus).__module__.startswith("can.interfaces.udp_multicast")


def open_bus(name: str, interface: str, channel: object, options: dict[str, object]) -> can.BusABC:
    """Open a python-can bus; on SocketCAN so that CAN FD frames are seen, to report them.

    Raises:
        BusError: It cannot be opened.

    """
    if interface == "socketcan":
        options = {"fd": True, **options}
    try:
        if interface == "udp_multicast":
            from fieldbus.can.udp_multicast import UdpMulticastBus  # needs msgpack

            return UdpMulticastBus(str(channel), **options)  # type: ignore[arg-type]
        return can.Bus(interface=interface, channel=channel, **options)  # type: ignore[arg-type]
    except Exception as error:  # a NameError, for example, where a vendor's library is missing
        reason = _reason(error, interface)
        raise BusError(f"{name}: {interface} {channel} cannot be opened: {reason}") from error


def _reason(error: Exception, interface: str) -> str:
    """Return why a bus cannot be opened and, where SocketCAN is not there, what is everywhere."""
    if interface != "socketcan" or not isinstance(error, OSError):
        return str(error)
    return (
        f"{error.strerror or error}; there is no such SocketCAN interface here. Run the command under "
        "`hil vcan --`, which makes one, or take interface `udp_multicast` with channel `239.74.163.2`, "
        "which every machine has; `hil emulate --adapter slcan` needs neither"
    )
