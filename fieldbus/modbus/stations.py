"""Servers at the virtual links: a station on a serial line, a station behind TCP."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Final, Generic, Protocol, TypeVar

from fieldbus.clock import MS, S, Scheduler, Timer
from fieldbus.errors import ConfigurationError
from fieldbus.modbus.framing import RtuResponder, TcpResponder
from fieldbus.modbus.serial_line import FrameAssembler, SerialFormat, SerialLine
from fieldbus.modbus.server import ModbusServer
from fieldbus.modbus.tcp_link import TcpHandler


class ServerEnd(Protocol):
    """A server's end of a connection, virtual or real."""

    @property
    def open(self) -> bool:
        """Whether bytes can be sent."""

    def send(self, data: bytes) -> None:
        """Send bytes."""

    def close(self) -> None:
        """End the connection."""


End = TypeVar("End", bound=ServerEnd)
End_co = TypeVar("End_co", bound=ServerEnd, covariant=True)


class Network(Protocol[End_co]):
    """Where connections come from: `TcpLink` or `SocketNetwork`."""

    def listen(self, accept: Callable[[End_co], TcpHandler | None] | None) -> None:
        """Call `accept` with every new connection."""


@dataclass(frozen=True)
class ConnectionLimits:
    """What the clients of a server may ask of it.

    Raises:
        ConfigurationError: A value is out of its range.

    """

    connections: int = 64
    """Most connections at the same time, 1..1000; a further one is closed at once."""
    request_ns: int = 5 * S
    """Longest time from the first byte of a request to its last one, ns, above 0; then the connection is
    closed.
    """

    def __post_init__(self) -> None:
        if not 1 <= self.connections <= 1000:
            raise ConfigurationError("connections", self.connections, "1..1000")
        if self.request_ns <= 0:
            raise ConfigurationError("request_ns", self.request_ns, "above 0")


DEFAULT_LIMITS: Final = ConnectionLimits()


class RequestTimer:
    """Ends a connection on which a request has begun and does not get complete.

    Args:
        scheduler: Time.
        longest_ns: From the first byte of a request to its last one, ns.
        expired: Called when it takes longer.

    """

    def __init__(self, scheduler: Scheduler, longest_ns: int, expired: Callable[[], None]) -> None:
        self._scheduler = scheduler
        self._longest_ns = longest_ns
        self._expired = expired
        self._timer: Timer | None = None

    def look(self, pending: int, *, completed: bool) -> None:
        """Take note of what came.

        Args:
            pending: Bytes of the request that is not complete.
            completed: Whether a request before it became complete, so that this one has just begun.

        """
        if self._timer is not None and (completed or not pending):
            self._timer.cancel()
            self._timer = None
        if pending and self._timer is None:
            self._timer = self._scheduler.after(self._longest_ns, self._expired)

    def stop(self) -> None:
        """End the supervision."""
        self.look(0, completed=False)


class RtuStation:
    """A server on a serial line.

    Args:
        scheduler: Time.
        line: The line.
        server: What answers.
        name: On the line.
        format_: Rate and parity, where they are not those of the line.
        processing_ns: From the end of the request, which is t3.5 behind its last character, to the
            response, ns.
        lenient: Accept pauses between t1.5 and t3.5 within a frame.
        t15_ns: Longest pause within a frame, ns; default that of the rate (p2024[1], PD-291).
        t35_ns: Pause that ends a frame, ns; default that of the rate (p2024[2], PD-291).

    """

    def __init__(
        self,
        scheduler: Scheduler,
        line: SerialLine,
        server: ModbusServer,
        *,
        name: str = "station",
        format_: SerialFormat | None = None,
        processing_ns: int = MS,
        lenient: bool = False,
        t15_ns: int | None = None,
        t35_ns: int | None = None,
    ) -> None:
        self._scheduler = scheduler
        self.server = server
        self.processing_ns = processing_ns
        self.longest_processing_ns = 0
        """A response that would come later is not sent (p2024[0], PD-291); 0 = it always is."""
        self._responder = RtuResponder(server)
        rate = format_ if format_ is not None else line.format
        self.assembler = FrameAssembler(
            scheduler,
            rate.t15_ns if t15_ns is None else t15_ns,
            rate.t35_ns if t35_ns is None else t35_ns,
            self._frame,
            lenient=lenient,
        )
        self.port = line.attach(name, self.assembler, format_)
        self.missed = 0
        """Frames that came while a response was not sent yet, and were ignored (MODB-010)."""
        self.silent = False
        """Whether requests are carried out and not answered."""
        self._pending = False

    @property
    def online(self) -> bool:
        """Whether the station is supplied; without supply it neither receives nor sends."""
        return self.port.online

    @online.setter
    def online(self, online: bool) -> None:
        self.port.online = online

    def _frame(self, frame: bytes, damaged: bool) -> None:
        if not self.port.online:
            return
        if self._pending:
            self.missed += 1
            return
        answer = self._responder.receive(frame, damaged=damaged)
        late = 0 < self.longest_processing_ns < self.processing_ns
        if answer is not None and not (self.silent or late):
            self._pending = True
            self._scheduler.after(self.processing_ns, lambda: self._send(answer))

    def _send(self, answer: bytes) -> None:
        self._pending = False
        self.port.send(answer)


class TcpStation(Generic[End]):
    """A server behind TCP, virtual or real, with several connections.

    Args:
        scheduler: Time.
        link: Network.
        server: What answers.
        processing_ns: From a request to its response, ns.
        limits: What its clients may ask of it.

    """

    def __init__(
        self,
        scheduler: Scheduler,
        link: Network[End],
        server: ModbusServer,
        *,
        processing_ns: int = MS,
        limits: ConnectionLimits = DEFAULT_LIMITS,
    ) -> None:
        self.scheduler = scheduler
        self.server = server
        self.processing_ns = processing_ns
        self.limits = limits
        self.ends: list[End] = []
        """Its ends of the open connections."""
        self.silent = False
        """Whether requests are carried out and not answered."""
        self._online = True
        link.listen(self._accept)

    @property
    def online(self) -> bool:
        """Whether the station is supplied.

        Without supply it refuses connections and answers nothing. Clients do not notice (MODB-042) until they
        send something after the supply has come back, which resets the connection.
        """
        return self._online

    @online.setter
    def online(self, online: bool) -> None:
        if not online:
            self.ends.clear()
        self._online = online

    def _accept(self, end: End) -> _Served[End] | None:
        if not self._online or len(self.ends) >= self.limits.connections:
            return None
        self.ends.append(end)
        return _Served(self, end)


class _Served(Generic[End]):
    """A connection of a station."""

    def __init__(self, station: TcpStation[End], end: End) -> None:
        self._station = station
        self._end = end
        self._responder = TcpResponder(station.server)
        self._timer = RequestTimer(station.scheduler, station.limits.request_ns, self._close)

    def opened(self) -> None:
        """Nothing to do: a server waits."""

    def receive(self, data: bytes) -> None:
        """Answer what is complete; a wrong header ends the connection (MODB-037)."""
        station, end = self._station, self._end
        if not station.online:
            return
        if end not in station.ends:  # a connection from before the supply was lost
            end.close()
            return
        requests = self._responder.requests
        answers = self._responder.responses(data)
        self._timer.look(self._responder.pending, completed=self._responder.requests > requests)
        if station.silent:
            answers.clear()
        if station.processing_ns == 0:
            end.send(b"".join(answers))
        else:
            for answer in answers:
                station.scheduler.after(station.processing_ns, lambda answer=answer: self._send(answer))  # type: ignore[misc]
        if self._responder.broken and end.open:
            station.scheduler.after(station.processing_ns, self._close)

    def _send(self, answer: bytes) -> None:
        if self._end in self._station.ends:
            self._end.send(answer)

    def _close(self) -> None:
        self._end.close()
        self.closed("closed")

    def closed(self, reason: str) -> None:  # noqa: ARG002 - whatever the reason
        """Forget the connection."""
        self._timer.stop()
        if self._end in self._station.ends:
            self._station.ends.remove(self._end)
