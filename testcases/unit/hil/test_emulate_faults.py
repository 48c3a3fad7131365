"""`hil emulate` with faults: what a master of others sees of them, and what is refused."""

from __future__ import annotations

import os
import signal
import time

import can
import pytest
from pymodbus.client import ModbusTcpClient
from pymodbus.exceptions import ModbusIOException

from testcases.processes import PATIENCE_S, Reader, hil_command

pytestmark = pytest.mark.realtime

GROUP = "239.74.163.22"
ZSW1 = 40110 - 40001
"""On the wire, in the map of SINAMICS."""
READ_TYPE = bytes.fromhex("4000100000000000")


class Master:
    """A master that reads 1000h of node 5 of the bench `live`."""

    def __init__(self, bus: can.BusABC) -> None:
        self.bus = bus

    def read(self, within_s: float) -> float | None:
        """Return after how many seconds the answer came; None: it did not."""
        begin = time.monotonic()
        self.bus.send(can.Message(arbitration_id=0x605, is_extended_id=False, data=READ_TYPE))
        while (left := begin + within_s - time.monotonic()) > 0:
            message = self.bus.recv(left)
            if message is not None and message.arbitration_id == 0x585:
                return time.monotonic() - begin
        return None


def emulate(*faults: str) -> tuple[Reader, int]:
    port = 45000 + os.getpid() % 1000
    options = [part for fault in faults for part in ("--fault", fault)]
    place = ["-i", "udp_multicast", "-c", GROUP, "-o", f"port={port}"]
    return Reader([*hil_command(), "emulate", "live", *place, *options], stream="stderr"), port


def test_a_master_meets_faults_on_the_way():
    """Two answers are lost, then requests come late; standard error says what is applied and what is over."""
    drives, port = emulate(
        "frame.drop@can0:drive=drive1,message=sdo_tx,count=2",
        "frame.delay:drive=drive1,message=sdo_rx,delay_s=0.4",
    )
    try:
        drives.wait_for("^ready")
        with can.Bus(interface="hil_multicast", channel=GROUP, port=port) as bus:
            master = Master(bus)
            assert [master.read(1.5), master.read(1.5)] == [None, None]
            drives.wait_for("fault.removed.*frame.drop")
            late = master.read(PATIENCE_S)
            assert late is not None
            assert late > 0.39
        assert drives.end(signal.SIGTERM) == 0
    finally:
        drives.kill()


def test_a_modbus_client_of_others_meets_faults_of_telegrams():
    """The client of pymodbus sees a bit stuck in the status word; later a telegram is lost: its request stays
    unanswered, and the next one is served.
    """
    faults = (
        "telegram.stuck:signal=ZSW1.3,value=1,count=2",
        "telegram.lost:count=1,at_s=0.5",
    )
    options = [part for fault in faults for part in ("--fault", fault)]
    command = [*hil_command(), "emulate", "profidrive_tcp", *options]
    drives = Reader(command, stream="stderr")
    try:
        port = int(drives.wait_for(r"Modbus TCP on 127.0.0.1:(\d+)").group(1))
        drives.wait_for("^ready")
        client = ModbusTcpClient("127.0.0.1", port=port, timeout=1.0, retries=0)
        assert client.connect()
        words = [client.read_holding_registers(ZSW1, count=1).registers[0] for _ in range(3)]
        assert [word & 8 for word in words] == [8, 8, 0]
        time.sleep(1.0)
        with pytest.raises(ModbusIOException):
            client.read_holding_registers(ZSW1, count=1)
        client.close()
        assert client.connect()
        assert not client.read_holding_registers(ZSW1, count=1).isError()
        client.close()
        assert drives.end(signal.SIGTERM) == 0
    finally:
        drives.kill()


@pytest.mark.parametrize(
    ("fault", "says"),
    [
        ("frame.corrupt", "frame.corrupt cannot be injected on a live bench"),
        ("axis.alarm:number=521", "somebody else's"),
        ("telegram.lost", "no PROFIdrive drive in this process"),
    ],
)
def test_faults_that_are_not_possible(fault, says):
    """A fault that needs our controller, or a bus in virtual time, is refused with the reason."""
    drives, _ = emulate(fault)
    try:
        drives.wait_for(says)
        assert drives.process.wait(PATIENCE_S) == 2
    finally:
        drives.kill()
