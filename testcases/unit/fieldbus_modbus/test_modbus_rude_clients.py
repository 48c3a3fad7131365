"""The server on real sockets with clients that misbehave: none of them slows another one down for long, holds
a place for ever or fills the memory.
"""

from __future__ import annotations

import random
import resource
import socket
from contextlib import ExitStack, closing
from threading import Event, Thread

import pytest

from fieldbus.clock import MS, S
from fieldbus.modbus import ConnectionLimits, Request, tcp_frame
from testcases.unit.fieldbus_modbus.real_server import real_device

pytestmark = pytest.mark.realtime

READ = tcp_frame(1, 5, Request(3, 10, 2).encode())
ANSWER = tcp_frame(1, 5, bytes.fromhex("03 04 100a 100b"))
LONG = tcp_frame(1, 5, Request(3, 10, 125).encode())
LIMIT = 64


@pytest.fixture(scope="module")
def device():
    """A device that waits for rude clients half a second."""
    with real_device(limits=ConnectionLimits(LIMIT, 500 * MS), unread_ns=S // 2) as made:
        yield made


def connect(device):
    """Connect to the device."""
    connection = socket.create_connection((device.host, device.port), timeout=20)
    connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
    return connection


def ask(connection):
    """Send a request and wait for the response; return whether it is the right one."""
    connection.sendall(READ)
    data = b""
    while len(data) < len(ANSWER):
        piece = connection.recv(len(ANSWER) - len(data))
        if not piece:
            return False
        data += piece
    return data == ANSWER


def is_closed(connection):
    """Wait for the end of a connection."""
    try:
        while connection.recv(65536):
            pass
    except ConnectionError:
        pass
    return True


def flood(device, over):
    """Send requests with long responses as fast as they are taken, and read nothing."""
    with closing(connect(device)) as deaf:
        deaf.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
        deaf.settimeout(0.2)
        while not over.is_set():
            try:
                deaf.sendall(LONG * 100)
            except TimeoutError:
                continue
            except OSError:  # the server has closed the connection
                return


def test_floods_from_clients_that_never_read(device):
    """Eight clients send requests without end and read nothing: a good client gets all its responses
    meanwhile, the memory does not grow by what they send, and they lose their connections.
    """
    before_kb = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    over = Event()
    floods = [Thread(target=flood, args=(device, over), daemon=True) for _ in range(8)]
    with closing(connect(device)) as good:
        assert ask(good)
        for one in floods:
            one.start()
        assert all(ask(good) for _ in range(300))
        for one in floods:  # each ends because the server closes its connection
            one.join(60)
        ended = [not one.is_alive() for one in floods]
        over.set()
        assert ask(good)
    assert all(ended)
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before_kb < 20_000


def test_more_connections_than_places(device):
    """Of 200 connections as many are served as there are places; the others are closed at once, and places
    that become free are taken again.
    """
    with ExitStack() as stack:
        many = [stack.enter_context(closing(connect(device))) for _ in range(200)]
        served = []
        for one in many:
            try:
                served.append(ask(one))
            except ConnectionError:
                served.append(False)
        assert served.count(True) == LIMIT
        assert all(ask(one) for one, good in zip(many, served, strict=True) if good)
    with closing(connect(device)) as one:
        for _ in range(1000):  # the closed ones are noticed one after the other
            try:
                if ask(one):
                    break
            except ConnectionError:
                pass
            one.close()
            one = connect(device)  # noqa: PLW2901 - the next attempt
        assert ask(one)


def test_requests_that_never_get_complete(device):
    """Clients that hold every place with half a request lose it; a good client comes in again."""
    with ExitStack() as stack:
        slow = [stack.enter_context(closing(connect(device))) for _ in range(LIMIT)]
        for number, one in enumerate(slow):
            one.sendall(READ[: 1 + number % (len(READ) - 1)])
        assert all(is_closed(one) for one in slow)
        with closing(connect(device)) as good:
            assert ask(good)


def test_garbage_and_resets(device):
    """Random bytes, half requests with a reset, and connections that end at once: a good client notices
    nothing.
    """
    chance = random.Random(1)
    with closing(connect(device)) as good:
        for _ in range(150):
            with closing(connect(device)) as rude:
                kind = chance.randrange(4)
                if kind == 0:
                    rude.sendall(chance.randbytes(chance.randrange(1, 2000)))
                elif kind == 1:
                    rude.sendall(READ[: chance.randrange(len(READ))])
                    rude.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, b"\1\0\0\0\0\0\0\0")
                elif kind == 2:
                    rude.sendall(READ)
                    rude.shutdown(socket.SHUT_WR)
            assert ask(good)
