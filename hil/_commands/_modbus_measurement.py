"""Modbus requests per second over TCP on loopback, for `hil benchmark`.

Each server has a process of its own, as a server has in use, and the same ten registers; the client is a bare
socket in this process, for both. They are asked by turns, so that a noisy machine disturbs both alike.
"""

from __future__ import annotations

import socket
import subprocess
import sys
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from threading import Event, Thread
from typing import Any, Final, cast

from fieldbus.clock import S
from hil._commands._measurements import Figure, alternately
from hil.errors import CannotRunError

REQUESTS: Final = 500
OURS: Final = "ours"
PEER: Final = "peer"


def modbus_requests() -> list[Figure]:
    """Return requests per second over TCP on loopback, one client: our server, and that
    of pymodbus with its simulator.
    """
    with ExitStack() as stack:
        ours = stack.enter_context(_process(OURS))
        theirs = stack.enter_context(_process(PEER))
        ours_rate, peer_rate = alternately(lambda: _ask_often(ours), lambda: _ask_often(theirs))
    return [
        Figure("modbus_tcp_requests_ours", ours_rate, "requests/s"),
        Figure("modbus_tcp_requests_peer", peer_rate, "requests/s"),
    ]


@contextmanager
def _process(who: str) -> Iterator[int]:
    """Run one of the servers in a process of its own; its port."""
    with subprocess.Popen(  # noqa: S603 - this very module
        [sys.executable, "-m", __name__, who], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    ) as process:
        assert process.stdin is not None
        assert process.stdout is not None
        try:
            answer = process.stdout.readline()
            if not answer:
                raise CannotRunError(f"the Modbus server {who} of the benchmark did not start")
            yield int(answer)
        finally:
            process.stdin.close()  # which ends it


def _ask_often(port: int) -> int:
    """Read ten registers again and again over one connection; return how often."""
    request = bytes.fromhex("0001 0000 0006 01 03 0000 000a")
    with socket.create_connection(("127.0.0.1", port), timeout=5) as connection:
        connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        for _ in range(REQUESTS):
            connection.sendall(request)
            answer = b""
            while len(answer) < 29:
                piece = connection.recv(64)
                if not piece:
                    raise CannotRunError("a Modbus server of the benchmark closed the connection")
                answer += piece
            if answer[7:9] != b"\x03\x14":
                raise CannotRunError(f"a Modbus server of the benchmark answered {answer.hex(' ')}")
    return REQUESTS


@contextmanager
def _our_modbus_server() -> Iterator[int]:
    from fieldbus.clock import RealtimeScheduler
    from fieldbus.modbus import Area, Block, ModbusServer, RegisterMap, SocketNetwork, TcpStation

    registers = RegisterMap()
    registers.add(Area.HOLDING_REGISTERS, Block(0, 10))
    scheduler = RealtimeScheduler()
    network = SocketNetwork(scheduler)
    TcpStation(scheduler, network, ModbusServer(registers), processing_ns=0)
    over = Event()
    thread = Thread(target=lambda: scheduler.run_until(over.is_set, 3600 * S), daemon=True)
    _, port = network.serve()
    thread.start()
    try:
        yield port
    finally:
        scheduler.post(over.set)
        thread.join()
        network.close()


@contextmanager
def _peer_modbus_server() -> Iterator[int]:
    import asyncio

    from pymodbus.server import ModbusTcpServer
    from pymodbus.simulator import DataType, SimData, SimDevice

    loop = asyncio.new_event_loop()
    ports: list[int] = []
    ready, over = Event(), asyncio.Event()

    async def serve() -> None:
        device = SimDevice(1, simdata=[SimData(0, count=10, values=0, datatype=DataType.REGISTERS)])
        server = ModbusTcpServer(device, address=("127.0.0.1", 0))
        await server.serve_forever(background=True)
        ports.append(cast("Any", server.transport).sockets[0].getsockname()[1])
        ready.set()
        await over.wait()
        await cast("Any", server).shutdown()

    thread = Thread(target=lambda: loop.run_until_complete(serve()), daemon=True)
    thread.start()
    if not ready.wait(10):
        raise CannotRunError("pymodbus's server did not start")
    try:
        yield ports[0]
    finally:
        loop.call_soon_threadsafe(over.set)
        thread.join()
        loop.close()


def _serve(who: str) -> None:
    """Run a server until standard input ends."""
    with {OURS: _our_modbus_server, PEER: _peer_modbus_server}[who]() as port:
        print(port, flush=True)  # noqa: T201 - for the process that has started this one
        sys.stdin.read()


if __name__ == "__main__":
    _serve(sys.argv[1])
