"""A device on real links, its scheduler running in a thread, so that programs that wait can talk to it."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from threading import Event, Thread

from fieldbus.clock import RealtimeScheduler, S
from fieldbus.modbus import (
    DEFAULT_LIMITS,
    ConnectionLimits,
    ModbusServer,
    PtyServer,
    SocketNetwork,
    TcpStation,
)
from testcases.unit.fieldbus_modbus.conftest import IDENTIFICATION, new_map


class RealDevice:
    """The device of `conftest` as unit 5, over TCP (`port`) and on a pseudo-terminal (`path`)."""

    def __init__(self, limits: ConnectionLimits, unread_ns: int) -> None:
        self.scheduler = RealtimeScheduler()
        self.server = ModbusServer(new_map(), unit=5, identification=IDENTIFICATION)
        self.network = SocketNetwork(self.scheduler, unread_ns=unread_ns)
        self.station = TcpStation(self.scheduler, self.network, self.server, processing_ns=0, limits=limits)
        self.host, self.port = self.network.serve()
        self.serial = PtyServer(self.scheduler, self.server)
        self.path = self.serial.path


@contextmanager
def real_device(*, limits: ConnectionLimits = DEFAULT_LIMITS, unread_ns: int = 5 * S) -> Iterator[RealDevice]:
    device = RealDevice(limits, unread_ns)
    over = Event()
    thread = Thread(target=lambda: device.scheduler.run_until(over.is_set, 600 * S), daemon=True)
    thread.start()
    try:
        yield device
    finally:
        device.scheduler.post(over.set)
        thread.join()
        device.serial.close()
        device.network.close()
