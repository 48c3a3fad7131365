"""A client over TCP: several requests under way, time-outs, retries, new connections. Nothing waits."""

from __future__ import annotations

from collections.abc import Callable
from typing import Final

from fieldbus.clock import MS, S, Scheduler, Timer
from fieldbus.errors import ConfigurationError
from fieldbus.modbus.client import Job, Outcome, QueuedClient
from fieldbus.modbus.errors import ResponseError
from fieldbus.modbus.framing import TcpSplitter, tcp_frame
from fieldbus.modbus.tcp_link import Connection, TcpHandler

_MOST_OUTSTANDING: Final = 16

Connector = Callable[[TcpHandler], Connection]
"""Begins a connection for a handler and returns its end."""


class TcpClient(QueuedClient):
    """A client over one TCP connection, which it makes when it has something to say.

    Args:
        scheduler: Time.
        connect: Begins a connection.
        timeout_ns: From a request to its response, and for the connection to be made, ns (MODB-041).
        retries: How often a request is sent again, also over a new connection.
        outstanding: Most requests under way at the same time, 1..16 (MODB-039).
        reconnect_ns: Pause before a connection is tried again, ns.

    """

    def __init__(
        self,
        scheduler: Scheduler,
        connect: Connector,
        *,
        timeout_ns: int = S,
        retries: int = 1,
        outstanding: int = 1,
        reconnect_ns: int = 100 * MS,
    ) -> None:
        super().__init__(scheduler, timeout_ns, retries)
        if not 1 <= outstanding <= _MOST_OUTSTANDING:
            raise ConfigurationError("client, outstanding", outstanding, f"1..{_MOST_OUTSTANDING}")
        self._connect = connect
        self._most = outstanding
        self._reconnect_ns = reconnect_ns
        self._handler: _Handler | None = None
        self._splitter = TcpSplitter()
        self._open = False
        self._not_before_ns = 0
        self._retry_timer: Timer | None = None
        self._transaction = 0
        self._under_way: dict[int, tuple[Job, Timer]] = {}
        self.connections = 0
        """Connections that were made."""

    @property
    def connected(self) -> bool:
        """Whether the connection is open."""
        return self._open

    @property
    def outstanding(self) -> int:
        """Requests under way."""
        return len(self._under_way)

    def close(self) -> None:
        """End the connection; what is under way is lost, what waits stays in
        the queue until the next request.
        """
        handler, self._handler = self._handler, None
        if handler is not None:
            handler.end()
        self._open = False
        self._lose("the connection was closed", retry=False)

    def _go_on(self) -> None:
        if not self._queue:
            return
        if self._handler is None:
            self._make_connection()
            return
        while self._open and self._queue and len(self._under_way) < self._most:
            self._send(self._queue.popleft())

    def _make_connection(self) -> None:
        if self._retry_timer is not None:
            return
        now = self._scheduler.now
        if now < self._not_before_ns:
            self._retry_timer = self._scheduler.at(self._not_before_ns, self._connect_again)
            return
        self._not_before_ns = now + self._reconnect_ns
        self._handler = handler = _Handler(self)
        self._splitter = TcpSplitter()
        handler.connection = self._connect(handler)
        self._scheduler.after(self.timeout_ns, lambda: self._no_connection(handler))

    def _connect_again(self) -> None:
        self._retry_timer = None
        self._go_on()

    def _no_connection(self, handler: _Handler) -> None:
        if handler is self._handler and not self._open:
            handler.end()
            self.ended("no connection within the time-out")

    def opened(self) -> None:
        """Take note that the connection is open."""
        self._open = True
        self.connections += 1
        self._go_on()

    def ended(self, reason: str) -> None:
        """Take note that the connection is over or was not made."""
        was_open, self._open = self._open, False
        self._handler = None
        if was_open:
            self._lose(f"the connection ended: {reason}", retry=True)
        elif self._queue:  # each try to connect counts as one of the request that waits longest
            self._again(self._queue.popleft(), Outcome.LOST, f"no connection: {reason}", sent=False)
        self._go_on()

    def _lose(self, text: str, *, retry: bool) -> None:
        lost, self._under_way = self._under_way, {}
        for job, timer in reversed(lost.values()):
            timer.cancel()
            if retry:
                self._again(job, Outcome.LOST, text)
            else:
                job.fail(Outcome.LOST, text)

    def _again(self, job: Job, outcome: Outcome, text: str, *, sent: bool = True) -> None:
        if not sent:
            job.tries += 1
        if job.tries <= self.retries:
            self._queue.appendleft(job)
        else:
            job.fail(outcome, text)

    def _send(self, job: Job) -> None:
        job.tries += 1
        # Numbers in a row: that of a request that timed out comes again after 65535 others (MODB-041).
        self._transaction = number = self._transaction % 0xFFFF + 1
        timer = self._scheduler.after(self.timeout_ns, lambda: self._timed_out(number))
        self._under_way[number] = (job, timer)
        handler = self._handler
        if handler is not None and handler.connection is not None:
            handler.connection.send(tcp_frame(number, job.unit, job.frame_pdu))

    def _timed_out(self, number: int) -> None:
        job, _ = self._under_way.pop(number)
        self.timeouts += 1
        self._again(job, Outcome.TIMEOUT, "no response")
        if self._splitter.pending and self._handler is not None:
            # Half a frame, and the rest does not come: what follows would be taken for it.
            self._handler.end()
            self.ended("half a frame")
            return
        self._go_on()

    def received(self, data: bytes) -> None:
        """Take bytes of the connection."""
        for number, unit, pdu in self._splitter.feed(data):
            found = self._under_way.pop(number, None)
            if found is None:
                self.late += 1
                continue
            job, timer = found
            timer.cancel()
            try:
                response = job.decode(unit, pdu)
            except ResponseError as error:
                self._again(job, Outcome.INVALID, str(error))
            else:
                job.finish(response)
        if self._splitter.broken and self._handler is not None:
            self._handler.end()
            self.ended("a wrong header")
            return
        self._go_on()


class _Handler:
    """The client at one connection; a connection that it has given up is not heard any more."""

    def __init__(self, client: TcpClient) -> None:
        self._client: TcpClient | None = client
        self.connection: Connection | None = None

    def end(self) -> None:
        """Give the connection up."""
        self._client = None
        if self.connection is not None:
            self.connection.close()

    def opened(self) -> None:
        if self._client is not None:
            self._client.opened()
        elif self.connection is not None:
            self.connection.close()  # given up before it was made

    def receive(self, data: bytes) -> None:
        if self._client is not None:
            self._client.received(data)

    def closed(self, reason: str) -> None:
        if self._client is not None:
            client, self._client = self._client, None
            client.ended(reason)
