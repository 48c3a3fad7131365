"""`hil emulate` with faults: what a master of others sees of them, and what is refused."""

from __future__ import annotations

import os
import signal
import time

import can
import pytest

from testcases.processes import PATIENCE_S, Reader, hil_command

pytestmark = pytest.mark.realtime

GROUP = "239.74.163.22"
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


@pytest.mark.parametrize(
    ("fault", "says"),
    [
        ("frame.corrupt", "frame.corrupt cannot be injected on a live bench"),
        ("axis.alarm:number=521", "somebody else's"),
        ("telegram.lost", "no ports of its axes"),
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
