"""The ground under all live tests: python-can and can-utils meet on a real SocketCAN interface."""

import shutil
import subprocess
import sys
import time

import can
import pytest

pytestmark = pytest.mark.vcan

PATIENCE_S = 20.0
"""How long to wait for something that must come; nothing here takes that long."""
PROBE_ID = 0x7FE
QUIT_ID = 0x7FF


def program(name: str) -> str:
    """Return the path of a program of can-utils, or fail."""
    path = shutil.which(name)
    if path is None:
        pytest.fail(f"{name} is missing (Debian package can-utils)")
    return path


@pytest.fixture
def bus(vcan_channel):
    with can.Bus(interface="socketcan", channel=vcan_channel) as opened:
        yield opened


@pytest.fixture
def other_bus(vcan_channel):
    with can.Bus(interface="socketcan", channel=vcan_channel) as opened:
        yield opened


def receive(bus, can_id) -> can.Message:
    """Return the next message with this identifier."""
    end = time.monotonic() + PATIENCE_S
    while time.monotonic() < end:
        message = bus.recv(1.0)
        if message is not None and message.arbitration_id == can_id:
            return message
    pytest.fail(f"no message {can_id:X} within {PATIENCE_S} s")


@pytest.mark.parametrize(
    "message",
    [
        can.Message(arbitration_id=0x000, data=b"", is_extended_id=False),
        can.Message(arbitration_id=0x181, data=b"\x37\x02", is_extended_id=False),
        can.Message(arbitration_id=0x7F1, data=bytes(range(8)), is_extended_id=False),
        can.Message(arbitration_id=0x1FFFFFFE, data=b"\xff" * 8, is_extended_id=True),
        can.Message(arbitration_id=0x701, is_remote_frame=True, dlc=1, is_extended_id=False),
    ],
    ids=lambda message: f"{message.arbitration_id:X}-{message.dlc}",
)
def test_message_arrives_unchanged(bus, other_bus, message):
    """A message comes out of a second socket with the same identifier, kind, length and data, and a time of
    today.
    """
    before = time.time()
    bus.send(message)
    received = receive(other_bus, message.arbitration_id)
    assert received.equals(message, timestamp_delta=None, check_channel=False, check_direction=False)
    assert before - 1 < received.timestamp < time.time() + 1


def test_own_messages_do_not_come_back(bus, other_bus):
    """A socket does not hear itself, but the others do."""
    bus.send(can.Message(arbitration_id=0x123, is_extended_id=False))
    receive(other_bus, 0x123)
    assert bus.recv(0.05) is None


def test_burst_keeps_order_and_loses_nothing(bus, other_bus):
    """Frames of one sender arrive all and in their order, also when the reader comes late."""
    for number in range(100):
        bus.send(
            can.Message(arbitration_id=0x200 + number, data=bytes([number]), is_extended_id=False),
            timeout=1.0,
        )
    received = [other_bus.recv(PATIENCE_S) for _ in range(100)]
    assert [(message.arbitration_id, message.data[0]) for message in received] == [
        (0x200 + n, n) for n in range(100)
    ]


ECHO = f"""
import can, sys
with can.Bus(interface="socketcan", channel=sys.argv[1]) as bus:
    print("ready", flush=True)
    while (message := bus.recv({PATIENCE_S})) is not None and message.arbitration_id != {QUIT_ID}:
        message.arbitration_id += 1
        bus.send(message)
"""


def test_echo_of_another_process(bus, vcan_channel):
    """Two processes talk over the interface in both directions."""
    peer = subprocess.Popen([sys.executable, "-c", ECHO, vcan_channel], stdout=subprocess.PIPE, text=True)
    try:
        assert peer.stdout.readline() == "ready\n"
        for number in range(20):
            bus.send(can.Message(arbitration_id=0x600, data=bytes([number] * 8), is_extended_id=False))
            assert receive(bus, 0x601).data == bytes([number] * 8)
        bus.send(can.Message(arbitration_id=QUIT_ID, is_extended_id=False))
        assert peer.wait(PATIENCE_S) == 0
    finally:
        peer.kill()
        peer.communicate()


def test_candump_sees_what_python_sends(bus, vcan_channel):
    """Candump prints exactly the frames that python-can sends."""
    dump = subprocess.Popen(
        [program("candump"), "-L", vcan_channel, "-T", str(round(PATIENCE_S * 1000))],
        stdout=subprocess.PIPE,
        text=True,
    )
    try:
        # candump does not say when it listens: call until it answers
        probe = bus.send_periodic(can.Message(arbitration_id=PROBE_ID, is_extended_id=False), 0.02)
        assert f" {vcan_channel} {PROBE_ID:X}#" in dump.stdout.readline()
        probe.stop()
        bus.send(can.Message(arbitration_id=0x181, data=b"\x37\x02\x00", is_extended_id=False))
        bus.send(can.Message(arbitration_id=0x12345678, data=b"\xde\xad", is_extended_id=True))
        bus.send(can.Message(arbitration_id=0x080, is_extended_id=False))
        bus.send(can.Message(arbitration_id=QUIT_ID, is_extended_id=False))
        seen = []
        for line in dump.stdout:
            frame = line.split()[2]
            if frame == f"{QUIT_ID:X}#":
                break
            if frame != f"{PROBE_ID:X}#":
                seen.append(frame)
        assert seen == ["181#370200", "12345678#DEAD", "080#"]
    finally:
        dump.kill()
        dump.communicate()


@pytest.mark.parametrize(
    ("text", "can_id", "extended", "data"),
    [("601#4041600000000000", 0x601, False, b"\x40\x41\x60\0\0\0\0\0"), ("00000080#01", 0x80, True, b"\x01")],
    ids=["standard", "extended"],
)
def test_cansend_is_received_by_python(bus, vcan_channel, text, can_id, extended, data):
    """What cansend sends arrives in python-can."""
    subprocess.run([program("cansend"), vcan_channel, text], check=True, timeout=PATIENCE_S)
    message = receive(bus, can_id)
    assert message.is_extended_id is extended
    assert message.data == data


def test_kernel_sends_periodically(bus, other_bus):
    """The broadcast manager of the kernel (module can-bcm) sends a message again and again until it is
    stopped.
    """
    task = bus.send_periodic(can.Message(arbitration_id=0x080, data=b"\x01", is_extended_id=False), 0.01)
    stamps = [receive(other_bus, 0x080).timestamp for _ in range(10)]
    task.stop()
    assert stamps == sorted(stamps)
    while other_bus.recv(0.2) is not None:
        pass
    assert other_bus.recv(0.1) is None
