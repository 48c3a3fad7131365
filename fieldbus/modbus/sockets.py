"""Real TCP connections: one thread waits for the sockets and hands over to the
scheduler, where everything happens.
"""

from __future__ import annotations

import errno
import os
import selectors
import socket
from collections.abc import Callable
from contextlib import suppress
from threading import Lock, Semaphore, Thread
from typing import Final

from fieldbus.clock import Scheduler
from fieldbus.errors import BusError
from fieldbus.modbus.tcp_link import Connection, TcpHandler

_PIECE: Final = 65536
_MOST_UNSENT: Final = 65536
"""Bytes that wait for a peer that does not read; beyond it the connection is closed."""
_BACKLOG: Final = 16
_MOST_HANDED_OVER: Final = 64
"""Pieces that wait for the scheduler; beyond it nothing more is read, so that the peers' own buffers fill."""


class SocketEnd:
    """Our end of a connection."""

    def __init__(self, network: SocketNetwork, sock: socket.socket, *, connecting: bool) -> None:
        self._network = network
        self._socket = sock
        self._handler: TcpHandler | None = None
        self._lock = Lock()
        self._unsent = bytearray()
        self._given_up = False
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
                    sent = self._socket.send(data)
                except BlockingIOError:
                    pass
                except OSError:
                    return  # the reading side notices and reports it
            self._unsent += data[sent:]
            if not self._unsent:
                return
            if len(self._unsent) > _MOST_UNSENT:
                self._shut()
        self._network.wake()

    def close(self) -> None:
        """End the connection; its own handler is not called."""
        self._handler = None
        with self._lock:
            self._shut()

    def _shut(self) -> None:
        self.open = False
        self._given_up = True
        with suppress(OSError):  # the reading side wakes, and takes it away
            self._socket.shutdown(socket.SHUT_RDWR)

    def received(self, data: bytes) -> None:
        """Give bytes to the handler, unless the connection was closed here."""
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

    @property
    def wants_to_send(self) -> bool:
        """Whether something waits to be sent."""
        return self.connecting or bool(self._unsent)

    def vanish(self) -> None:
        """Close the socket."""
        with self._lock:
            self.open = False
            self._socket.close()

    def flush(self) -> None:
        """Send what waits."""
        with self._lock, suppress(OSError):
            del self._unsent[: self._socket.send(self._unsent)]


class SocketNetwork:
    """Connections to and from this machine.

    Args:
        scheduler: A realtime scheduler, on which the handlers are called.

    """

    def __init__(self, scheduler: Scheduler) -> None:
        self._scheduler = scheduler
        self._selector = selectors.DefaultSelector()
        self._wake_read, self._wake_write = os.pipe()
        os.set_blocking(self._wake_write, False)
        os.set_blocking(self._wake_read, False)
        self._selector.register(self._wake_read, selectors.EVENT_READ, None)
        self._orders: list[Callable[[], None]] = []
        self._ends: dict[socket.socket, SocketEnd] = {}
        self._accept: Callable[[SocketEnd], TcpHandler | None] | None = None
        self._closed = False
        self._slots = Semaphore(_MOST_HANDED_OVER)
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
            raise BusError(f"Modbus TCP server at {host}:{port}: {error.strerror or error}") from None
        listener.setblocking(False)
        address: tuple[str, int] = listener.getsockname()[:2]
        self._order(lambda: self._register(listener, None))
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
            self._order(lambda: self._register(sock, end))
        return end

    def close(self) -> None:
        """End all connections and the thread; harmless to repeat."""
        if self._closed:
            return
        self._closed = True
        self._wake()
        self._slots.release()
        self._thread.join()
        for end in self._ends.values():
            end.open = False
        for key in list(self._selector.get_map().values()):
            if isinstance(key.fileobj, socket.socket):
                key.fileobj.close()
        self._selector.close()
        os.close(self._wake_read)
        os.close(self._wake_write)

    def wake(self) -> None:
        """Let the thread look at all connections again."""
        if self._closed:
            return
        self._wake()

    def _wake(self) -> None:
        with suppress(BlockingIOError):  # full: it will wake all the same
            os.write(self._wake_write, b"\0")

    def _order(self, order: Callable[[], None]) -> None:
        self._orders.append(order)
        self.wake()

    # --------------------------------------------------------------------------- on the thread of the sockets

    def _register(self, sock: socket.socket, end: SocketEnd | None) -> None:
        if end is not None:
            self._ends[sock] = end
            sock.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self._selector.register(sock, _interest(end), sock)

    def _run(self) -> None:
        while not self._closed:
            for key, events in self._selector.select():
                sock = key.data
                if sock is None:
                    self._woken()
                elif sock in self._ends:
                    self._ready(sock, self._ends[sock], events)
                else:
                    self._new(sock)

    def _woken(self) -> None:
        with suppress(BlockingIOError):
            while os.read(self._wake_read, _PIECE):
                pass
        while self._orders:
            self._orders.pop(0)()
        for sock, end in self._ends.items():
            self._selector.modify(sock, _interest(end), sock)

    def _new(self, listener: socket.socket) -> None:
        try:
            sock, _ = listener.accept()
        except OSError:  # gone again
            return
        sock.setblocking(False)
        end = SocketEnd(self, sock, connecting=False)
        self._register(sock, end)
        self._scheduler.post(lambda: self._accepted(end))

    def _accepted(self, end: SocketEnd) -> None:
        handler = None if self._accept is None else self._accept(end)
        if handler is None:
            end.close()
        else:
            end.use(handler)

    def _ready(self, sock: socket.socket, end: SocketEnd, events: int) -> None:
        if end.connecting:
            code = sock.getsockopt(socket.SOL_SOCKET, socket.SO_ERROR)
            if code:
                self._forget(sock, end, os.strerror(code))
                return
            end.connecting = False
            self._scheduler.post(end.made)
            self._selector.modify(sock, _interest(end), sock)
            return
        if events & selectors.EVENT_READ:
            try:
                data = sock.recv(_PIECE)
            except BlockingIOError:
                return
            except OSError:
                self._forget(sock, end, "reset")
                return
            if not data:
                self._forget(sock, end, "closed")
                return
            self._scheduler.post(lambda: self._received(end, data))
            self._slots.acquire()
        if events & selectors.EVENT_WRITE:
            end.flush()
            self._selector.modify(sock, _interest(end), sock)

    def _received(self, end: SocketEnd, data: bytes) -> None:
        self._slots.release()
        end.received(data)

    def _forget(self, sock: socket.socket, end: SocketEnd, reason: str) -> None:
        self._selector.unregister(sock)
        del self._ends[sock]
        end.vanish()
        self._scheduler.post(lambda: end.ended(reason))


def _interest(end: SocketEnd | None) -> int:
    return selectors.EVENT_READ | (selectors.EVENT_WRITE if end is not None and end.wants_to_send else 0)
