"""A TCP link in simulated time: connections as ordered streams, segments, latency,
reset, a cable that can be cut.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from functools import partial
from itertools import pairwise
from typing import NamedTuple, Protocol

from fieldbus.clock import Scheduler
from fieldbus.errors import ConfigurationError
from fieldbus.modbus.hooks import Hooks, LinkHook


class TcpSegment(NamedTuple):
    """A segment, for the log."""

    time_ns: int
    """When it arrived."""
    connection: int
    """Number of the connection, from 1 on."""
    sender: str
    data: bytes
    note: str
    """`opened`, `closed`, `reset`, `refused`, `changed`, `dropped`, or nothing."""


class TcpHandler(Protocol):
    """User of one end of a connection."""

    def opened(self) -> None:
        """Take note that bytes may be sent."""

    def receive(self, data: bytes) -> None:
        """Take what arrived, in any pieces."""

    def closed(self, reason: str) -> None:
        """Take note of the end of the connection: `closed`, `reset`, `refused`."""


class Connection(Protocol):
    """What a handler may do."""

    def send(self, data: bytes) -> None:
        """Send bytes; ignored when the connection is not open."""

    def close(self) -> None:
        """End the connection; the own handler is not called."""


class TcpEnd:
    """One end of a connection on a virtual link."""

    def __init__(self, link: TcpLink, name: str, number: int, handler: TcpHandler) -> None:
        self.link = link
        self.name = name
        self.number = number
        self.handler = handler
        self.peer: TcpEnd | None = None
        self.open = False
        self.under_way: deque[Callable[[], None]] = deque()
        """What was sent and has not arrived, in order; for the link."""
        self._due_ns = 0

    def send(self, data: bytes) -> None:
        """Send bytes; ignored when the connection is not open."""
        if self.open and data:
            self.link.carry(self, data)

    def close(self) -> None:
        """End the connection; its own handler is not called."""
        self._end("closed")

    def reset(self) -> None:
        """End the connection at once at both ends, as after a loss of supply with a restart; both handlers
        are called.
        """
        if self.open:
            self._end("reset")
            self.handler.closed("reset")

    def _end(self, reason: str) -> None:
        if not self.open:
            return
        self.open = False
        if self.peer is not None:
            self.link.carry_end(self, self.peer, reason)

    def due(self, earliest_ns: int) -> int:
        """Return when something sent now arrives: never before what was sent earlier, ns."""
        self._due_ns = max(self._due_ns, earliest_ns)
        return self._due_ns


class TcpLink:
    """A network between clients and one server.

    Args:
        scheduler: Time.
        name: For logs.
        latency_ns: From one end to the other, ns.
        segment_size: Most bytes of a segment.
        keep_log: Whether `log` is kept.

    """

    def __init__(
        self,
        scheduler: Scheduler,
        name: str = "net",
        *,
        latency_ns: int = 100_000,
        segment_size: int = 1460,
        keep_log: bool = True,
    ) -> None:
        if latency_ns < 0:
            raise ConfigurationError("link, latency_ns", latency_ns, "0 or more")
        if segment_size < 1:
            raise ConfigurationError("link, segment_size", segment_size, "1 or more")
        self.scheduler = scheduler
        self.name = name
        self.latency_ns = latency_ns
        self.segment_size = segment_size
        self.keep_log = keep_log
        self.log: list[TcpSegment] = []
        self._accept: Callable[[TcpEnd], TcpHandler | None] | None = None
        self._connections = 0
        self._hooks = Hooks()
        self._cut = False
        self._held: list[TcpEnd] = []

    def listen(self, accept: Callable[[TcpEnd], TcpHandler | None] | None) -> None:
        """Call `accept` with the end of every new connection; it returns the handler, or None to refuse."""
        self._accept = accept

    def add_hook(self, hook: LinkHook) -> Callable[[], None]:
        """Ask `hook` before everything that is sent; returns the function that ends it."""
        return self._hooks.add(hook)

    @property
    def cut(self) -> bool:
        """Whether the cable is cut. Neither end notices (MODB-042); what is sent arrives after
        the repair.
        """
        return self._cut

    @cut.setter
    def cut(self, cut: bool) -> None:
        self._cut = cut
        if not cut:
            held, self._held = self._held, []
            for sender in held:
                self.scheduler.after(self.latency_ns, partial(self._next, sender))

    def connect(self, name: str, handler: TcpHandler) -> TcpEnd:
        """Begin a connection to the server; the handler is called when it is open or refused."""
        self._connections += 1
        client = TcpEnd(self, name, self._connections, handler)
        self._send_later(client, self.scheduler.now + self.latency_ns, lambda: self._arrived(client))
        return client

    def _arrived(self, client: TcpEnd) -> None:
        server = TcpEnd(self, "server", client.number, client.handler)
        handler = None if self._accept is None else self._accept(server)
        at = self.scheduler.now + self.latency_ns
        if handler is None:
            self._send_later(server, at, lambda: self._refused(client))
            return
        server.handler = handler
        server.peer, client.peer = client, server
        server.open = True
        self._note(client.number, client.name, b"", "opened")
        server.due(at)  # nothing overtakes the acknowledgement
        self._send_later(server, at, lambda: self._opened(client))

    def _refused(self, client: TcpEnd) -> None:
        self._note(client.number, client.name, b"", "refused")
        client.handler.closed("refused")

    def _opened(self, client: TcpEnd) -> None:
        if client.peer is not None and client.peer.open:
            client.open = True
            client.handler.opened()

    def carry(self, sender: TcpEnd, data: bytes) -> None:
        """Take bytes of an end to the other one."""
        now = self.scheduler.now
        cuts: tuple[int, ...] = ()
        note = ""
        delay_ns = 0
        change = self._hooks.ask(sender.name, data, now)
        if change is None:
            if len(data) <= self.segment_size:
                self._send_later(
                    sender, sender.due(now + self.latency_ns), partial(self._deliver, sender, data, "")
                )
                return
        else:
            if change.reset:
                sender.reset()
                return
            if change.drop:
                self._note(sender.number, sender.name, data, "dropped")
                return
            note, delay_ns, cuts = "changed", change.delay_ns, change.cuts
            data = data if change.data is None else change.data
        places = {
            0,
            len(data),
            *range(0, len(data), self.segment_size),
            *(at for at in cuts if 0 < at < len(data)),
        }
        limits = sorted(places)
        at = sender.due(now + self.latency_ns + delay_ns)
        for begin, end in pairwise(limits):
            piece = data[begin:end]
            self._send_later(sender, at, partial(self._deliver, sender, piece, note))

    def carry_end(self, sender: TcpEnd, receiver: TcpEnd, reason: str) -> None:
        """Report the end of a connection to the other end, after what was sent before."""
        at = sender.due(self.scheduler.now + self.latency_ns)

        def arrive() -> None:
            self._note(sender.number, sender.name, b"", reason)
            if receiver.open:
                receiver.open = False
                receiver.handler.closed(reason)

        self._send_later(sender, at, arrive)

    def _deliver(self, sender: TcpEnd, data: bytes, note: str) -> None:
        self._note(sender.number, sender.name, data, note)
        receiver = sender.peer
        if receiver is not None and receiver.open:
            receiver.handler.receive(data)

    def _send_later(self, sender: TcpEnd, at_ns: int, arrive: Callable[[], None]) -> None:
        sender.under_way.append(arrive)
        self.scheduler.at(at_ns, partial(self._next, sender))

    def _next(self, sender: TcpEnd) -> None:
        # The oldest arrives, whichever it was entered for: a cable that was cut for a time changes no order.
        if self._cut:
            self._held.append(sender)
        else:
            sender.under_way.popleft()()

    def _note(self, connection: int, sender: str, data: bytes, note: str) -> None:
        if self.keep_log:
            self.log.append(TcpSegment(self.scheduler.now, connection, sender, data, note))
