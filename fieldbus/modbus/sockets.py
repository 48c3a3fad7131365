"""Real TCP connections: one thread waits for the sockets and hands over to the
scheduler, where everything happens.

One peer cannot slow the others down or fill the memory: of every connection only a few small pieces wait
for the scheduler at a time, nothing more is read from a peer that does not take its responses, and a peer
that takes none for `unread_ns` loses its connection.
"""

from __future__ import annotations

import errno
import os
import selectors
import socket
import time
from collections.abc import Callable
from contextlib import suppress
from threading import Lock, Thread
from typing import Final

from fieldbus.clock import S, Scheduler
from fieldbus.errors import BusError
from fieldbus.modbus.tcp_link import Connection, TcpHandler

_PIECE: Final = 1040
"""Bytes that are read from a connection at once: four of the longest frames, or 86 requests of 12 bytes."""
_MOST_HANDED_OVER: Final = 2
"""Pieces of one connection that wait for the scheduler; until it has taken one, nothing more is read."""
_MOST_UNSENT: Final = 16384
"""Bytes that wait for a peer that does not read; beyond it nothing more is read from this peer."""
_BACKLOG: Final = 128
_KEEPALIVE: Final = (("TCP_KEEPIDLE", 10), ("TCP_KEEPINTVL", 5), ("TCP_KEEPCNT", 3))
"""Seconds, and number of probes, until a peer that disappeared is noticed; where the system can set them."""
_LOOK_S: Final = 0.25
"""Pause between two looks at connections whose peers do not read, s."""
_NO_FILES_S: Final = 0.05
UNREAD_NS: Final = 5 * S
"""How long a peer may take no response, ns."""


class SocketEnd:
    """Our end of a connection."""

    def __init__(self, network: SocketNetwork, sock: socket.socket, *, connecting: bool) -> None:
        self._network = network
        self.socket = sock
        self.watched = 0
        """What the thread of the sockets waits for at this connection now: events of `selectors`."""
        self._handler: TcpHandler | None = None
        self._lock = Lock()
        self._unsent = bytearray()
        self._given_up = False
        self._handed_over = 0
        self._taken = 0
        self._stalled_since_ns = 0
        self.connecting = connecting
        self.open = not connecting

    # On the scheduler's thread.

    def use(self, handler: TcpHandler) -> None:
        """Hand what comes to `handler` from now on."""
        self._handler = handler

    def send(self, data: bytes) -> None:
        """Send bytes; ignored when the connection is not open."""
        with self._lock:
            if not self.open:
                return
            sent = 0
            if not self._unsent:
                try:
                    sent = self.socket.send(data)
                except BlockingIOError:
                    pass
                except OSError:
                    return  # the reading side notices and reports it
            if sent == len(data):
                return
            if not self._unsent:
                self._stalled_since_ns = time.monotonic_ns()
            self._unsent += data[sent:]
        self._network.look_at(self)

    def close(self) -> None:
        """End the connection; its own handler is not called."""
        self._handler = None
        with self._lock:
            self.open = False
            self._given_up = True
            with suppress(OSError):  # the reading side wakes, and takes it away
                self.socket.shutdown(socket.SHUT_RDWR)
        self._network.look_at(self)

    def received(self, data: bytes) -> None:
        """Give bytes to the handler, unless the connection was closed here."""
        full = self._handed_over - self._taken >= _MOST_HANDED_OVER
        self._taken += 1
        if full:
            self._network.look_at(self)
        if self._handler is not None and not self._given_up:
            self._handler.receive(data)

    def made(self) -> None:
        """Report the connection to the handler."""
        self.open = True
        if self._handler is not None:
            self._handler.opened()

    def ended(self, reason: str) -> None:
        """Report the end of the connection to the handler."""
        self.open = False
        handler, self._handler = self._handler, None
        if handler is not None:
            handler.closed(reason)

    # On the thread of the sockets.

    def interest(self) -> int:
        """Return what the thread has to wait for at this connection: events of `selectors`, 0 for nothing."""
        if self.connecting:
            return selectors.EVENT_WRITE
        unsent = len(self._unsent)
        full = self._handed_over - self._taken >= _MOST_HANDED_OVER or unsent > _MOST_UNSENT
        reads = self._given_up or not full
        return (selectors.EVENT_READ if reads else 0) | (selectors.EVENT_WRITE if unsent else 0)

    def hand_over(self) -> None:
        """Count a piece that waits for the scheduler."""
        self._handed_over += 1

    def unread(self, now_ns: int) -> int:
        """Return how long the peer has taken nothing of what waits for it, ns."""
        return now_ns - self._stalled_since_ns if self._unsent and not self.connecting else 0

    def vanish(self) -> None:
        """Close the socket."""
        with self._lock:
            self.open = False
            self.socket.close()

    def flush(self) -> bool:
        """Send what waits; return whether the connection still stands."""
        with self._lock:
            try:
                sent = self.socket.send(self._unsent)
            except BlockingIOError:
                return True
            except OSError:
                return False
            self._stalled_since_ns = time.monotonic_ns()
            del self._unsent[:sent]
        return True


class SocketNetwork:
    """Connections to and from this machine.

    Args:
        scheduler: A realtime scheduler, on which the handlers are called.
        unread_ns: How long a peer may take nothing of what waits for it before its connection is closed, ns.

    """

    def __init__(self, scheduler: Scheduler, *, unread_ns: int = UNREAD_NS) -> None:
        self._scheduler = scheduler
        self._unread_ns = unread_ns
        self._selector = selectors.DefaultSelector()
        self._wake_read, self._wake_write = os.pipe()
        os.set_blocking(self._wake_write, False)
        os.set_blocking(self._wake_read, False)
        self._selector.register(self._wake_read, selectors.EVENT_READ, None)
        self._orders: list[Callable[[], None]] = []
        self._changed: list[SocketEnd] = []
        self._ends: dict[SocketEnd, None] = {}
        self._stalled: dict[SocketEnd, None] = {}
        self._accept: Callable[[SocketEnd], TcpHandler | None] | None = None
        self._closed = False
        self._thread = Thread(target=self._run, name="modbus sockets", daemon=True)
        self._thread.start()

    def serve(self, host: str = "127.0.0.1", port: int = 0) -> tuple[str, int]:
        """Take connections at an address of this machine; return host and port.

        Args:
            host: Default: only programs of this machine can connect.
            port: 0 for any that is free.

        Raises:
            BusError: The address cannot be used.

        """
        try:
            listener = socket.create_server((host, port), backlog=_BACKLOG)
        except OSError as error:
            raise BusError(f"TCP server at {host}:{port}: {error.strerror or error}") from None
        listener.setblocking(False)
        address: tuple[str, int] = listener.getsockname()[:2]
        self._order(lambda: self._listen(listener))
        return address

    def listen(self, accept: Callable[[SocketEnd], TcpHandler | None] | None) -> None:
        """Call `accept` with every new connection, as `TcpLink.listen` does."""
        self._accept = accept

    def connect(self, host: str, port: int, handler: TcpHandler) -> Connection:
        """Begin a connection; the handler is called with the outcome."""
        sock = socket.socket(socket.AF_INET6 if ":" in host else socket.AF_INET, socket.SOCK_STREAM)
        sock.setblocking(False)
        end = SocketEnd(self, sock, connecting=True)
        end.use(handler)
        try:
            code = sock.connect_ex((host, port))
        except OSError as error:  # a name that nobody knows
            code = error.errno or errno.EINVAL
        if code not in (0, errno.EINPROGRESS):
            sock.close()
            self._scheduler.post(lambda: end.ended(os.strerror(code) if code > 0 else "unknown host"))
        else:
            self._order(lambda: self._register(end))
        return end

    def close(self) -> None:
        """End all connections and the thread; harmless to repeat."""
        if self._closed:
            return
        self._closed = True
        self._wake()
        self._thread.join()
        for end in self._ends:
            end.vanish()
        for key in list(self._selector.get_map().values()):
            if isinstance(key.fileobj, socket.socket):
                key.fileobj.close()
        self._selector.close()
        os.close(self._wake_read)
        os.close(self._wake_write)

    def look_at(self, end: SocketEnd) -> None:
        """Let the thread look at a connection again."""
        self._changed.append(end)
        if not self._closed:
            self._wake()

    def _wake(self) -> None:
        with suppress(BlockingIOError):  # full: it will wake all the same
            os.write(self._wake_write, b"\0")

    def _order(self, order: Callable[[], None]) -> None:
        self._orders.append(order)
        if not self._closed:
            self._wake()

    # --------------------------------------------------------------------------- on the thread of the sockets

    def _listen(self, listener: socket.socket) -> None:
        self._selector.register(listener, selectors.EVENT_READ, listener)

    def _register(self, end: SocketEnd) -> None:
        end.socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        end.socket.setsockopt(socket.SOL_SOCKET, socket.SO_KEEPALIVE, 1)
        for name, value in _KEEPALIVE:
            if hasattr(socket, name):
                end.socket.setsockopt(socket.IPPROTO_TCP, getattr(socket, name), value)
        self._ends[end] = None
        self._watch(end)

    def _watch(self, end: SocketEnd) -> None:
        """Wait for what the connection needs now."""
        wanted = end.interest()
        if wanted != end.watched:
            if not wanted:
                self._selector.unregister(end.socket)
            elif not end.watched:
                self._selector.register(end.socket, wanted, end)
            else:
                self._selector.modify(end.socket, wanted, end)
            end.watched = wanted
        if wanted & selectors.EVENT_WRITE and not end.connecting:
            self._stalled[end] = None
        else:
            self._stalled.pop(end, None)

    def _run(self) -> None:
        while not self._closed:
            # Connections that do not take their responses have to be looked at without an event.
            for key, events in self._selector.select(_LOOK_S if self._stalled else None):
                data = key.data
                if data is None:
                    self._woken()
                elif isinstance(data, SocketEnd):
                    if data in self._ends:  # not taken away by an earlier event of this round
                        self._ready(data, events)
                else:
                    self._new(data)
            if self._stalled:
                now_ns = time.monotonic_ns()
                for end in [end for end in self._stalled if end.unread(now_ns) > self._unread_ns]:
                    self._forget(end, "not read")

    def _woken(self) -> None:
        with suppress(BlockingIOError):
            while os.read(self._wake_read, 4096):
                pass
        while self._orders:
            self._orders.pop(0)()
        while self._changed:
            end = self._changed.pop()
            if end in self._ends:
                self._watch(end)

    def _new(self, listener: socket.socket) -> None:
        try:
            sock, _ = listener.accept()
        except OSError as error:
            if error.errno in (errno.EMFILE, errno.ENFILE):
                time.sleep(_NO_FILES_S)  # the peer keeps waiting; without a pause this would be a busy loop
            return  # otherwise the peer is gone again
        sock.setblocking(False)
        end = SocketEnd(self, sock, connecting=False)
        self._register(end)
        self._scheduler.post(lambda: self._accepted(end))

    def _accepted(self, end: SocketEnd) -> None:
        handler = None if self._accept is None else self._accept(end)
        if handler is None:
            end.close()
        else:
            end.use(handler)

    def _ready(self, end: SocketEnd, events: int) -> None:
        if end.connecting:
            code = end.socket.getsockopt(socket.SOL_SOCKET, socket.SO_ERROR)
            if code:
                self._forget(end, os.strerror(code))
                return
            end.connecting = False
            self._scheduler.post(end.made)
            self._watch(end)
            return
        # Waiting data are read before a failed write ends the connection: a hasty client has still written.
        if events & selectors.EVENT_READ:
            try:
                data = end.socket.recv(_PIECE)
            except BlockingIOError:
                return
            except OSError:
                self._forget(end, "reset")
                return
            if not data:
                self._forget(end, "closed")
                return
            end.hand_over()
            self._scheduler.post(lambda: end.received(data))
        if events & selectors.EVENT_WRITE and end.watched & selectors.EVENT_WRITE and not end.flush():
            self._forget(end, "reset")
            return
        self._watch(end)

    def _forget(self, end: SocketEnd, reason: str) -> None:
        if end.watched:
            self._selector.unregister(end.socket)
        self._stalled.pop(end, None)
        del self._ends[end]
        end.vanish()
        self._scheduler.post(lambda: end.ended(reason))
