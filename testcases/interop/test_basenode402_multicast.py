"""`hil emulate` on UDP multicast: `BaseNode402` with the default PDOs of the drive, and who hears whom."""

from __future__ import annotations

import signal
import socket
import time

import can
import canopen
import pytest
from canopen.profiles.p402 import BaseNode402

from emulators.drive.cia402 import EDS_PATH
from fieldbus.can.udp_multicast import UdpMulticastBus
from testcases.physical_support import multicast_place
from testcases.processes import PATIENCE_S, Reader, hil_command

pytestmark = pytest.mark.realtime

GROUP = "239.74.163.2"


@pytest.fixture
def port():
    """A port of its own, so that runs side by side do not meet."""
    return multicast_place()["options"]["port"]


def heard(bus, wait_s=0.3):
    """Identifiers of the frames that come within the time."""
    frames = iter(lambda: bus.recv(wait_s), None)
    return [frame.arbitration_id for frame in frames]


def frame(can_id):
    """The same data for everybody: only the sender tells frames apart."""
    return can.Message(arbitration_id=can_id, data=b"\x01", is_extended_id=False)


def test_own_frames_do_not_come_back_and_equal_ones_of_others_do(port):
    """Every side hears the others, python-can's own bus among them, and never itself."""
    with (
        UdpMulticastBus(GROUP, port=port) as first,
        UdpMulticastBus(GROUP, port=port) as second,
        can.Bus(interface="udp_multicast", channel=GROUP, port=port, hop_limit=0) as foreign,
    ):
        for sender in (first, second, foreign):
            sender.send(frame(0x123))
        assert [heard(bus) for bus in (first, second)] == [[0x123, 0x123]] * 2
        assert heard(foreign) == [0x123] * 3


def test_nothing_but_multicast_comes_in(port):
    """A datagram to the port of this machine itself is not for the bus."""
    with UdpMulticastBus(GROUP, port=port) as bus, socket.socket(type=socket.SOCK_DGRAM) as stranger:
        stranger.sendto(b"\x80", ("127.0.0.1", port))
        assert heard(bus) == []


def test_mistakes_are_named():
    """Group, port, network interface and options that do not exist are refused with what is allowed."""
    for arguments, message in (
        ({"channel": "10.0.0.1"}, "'10.0.0.1' is no multicast group"),
        ({"channel": GROUP, "port": 65536}, r"port 65536 is not allowed; allowed: 1\.\.65535"),
        ({"channel": GROUP, "hop_limit": -1}, r"hop_limit -1 is not allowed; allowed: 0\.\.255"),
        ({"channel": GROUP, "join": "nosuch0"}, "join 'nosuch0': there is no such network interface; there"),
        ({"channel": GROUP, "fd": True}, "option 'fd' is not known; allowed: port, hop_limit, join"),
    ):
        with pytest.raises(can.CanInitializationError, match=message):
            UdpMulticastBus(**arguments)


def test_basenode402_with_default_pdos(port):
    """The library maps nothing: it reads the PDOs of the drive and leads it by them, again and again."""
    place = ["-i", "udp_multicast", "-c", GROUP, "-o", f"port={port}"]
    drives = Reader([*hil_command(), "emulate", "live", *place], stream="stderr")
    network = canopen.Network(bus=UdpMulticastBus(GROUP, port=port))
    try:
        drives.wait_for(rf"^drive1: cia402, node 5, on udp_multicast {GROUP}, port {port}, lo")
        drives.wait_for("^ready")
        network.connect()
        node = network.add_node(BaseNode402(5, str(EDS_PATH)))
        for name in ("TIMEOUT_SWITCH_OP_MODE", "TIMEOUT_SWITCH_STATE_FINAL", "TIMEOUT_CHECK_TPDO"):
            setattr(node, name, PATIENCE_S)
        node.sdo.RESPONSE_TIMEOUT = PATIENCE_S
        node.nmt.state = "PRE-OPERATIONAL"
        node.setup_402_state_machine()
        node.nmt.state = "OPERATIONAL"
        for speed in (300_000, -300_000, 300_000):
            node.op_mode = "PROFILED VELOCITY"
            assert node.op_mode == "PROFILED VELOCITY"
            node.state = "OPERATION ENABLED"
            node.sdo[0x60FF].raw = speed
            end = time.monotonic() + PATIENCE_S
            while abs(node.sdo[0x606C].raw - speed) > 30_000 and time.monotonic() < end:
                pass
            assert node.sdo[0x606C].raw == pytest.approx(speed, abs=30_000)
            node.sdo[0x60FF].raw = 0
            node.state = "SWITCH ON DISABLED"
        assert drives.end(signal.SIGTERM) == 0
    finally:
        network.disconnect()
        drives.kill()
