"""The way to real hardware without any: the drives are `physical`, and `hil emulate` brings them in another
process.

The bench and the case are those that a user has for a drive on the desk: over UDP multicast, through a
serial-line adapter, and, in `testcases/vcan`, over SocketCAN. What is judged is what happens, not how fast:
the limits in the bench file are wide, because the machine may be slow.
"""

from __future__ import annotations

import signal
from pathlib import Path

import pytest

from testcases.physical_support import emulate, multicast_place, run_round_trip


def test_physical_drive_over_udp_multicast(tmp_path):
    """Enable, home, move, stop and a lost bus against a drive of another process, over UDP multicast on the
    loopback.
    """
    place = multicast_place()
    drives = emulate(tmp_path, place)
    try:
        run_round_trip(tmp_path, place)
        assert drives.end(signal.SIGTERM) == 0
    finally:
        drives.kill()


def test_physical_drive_through_a_serial_line_adapter(tmp_path):
    """The same through python-can's driver for serial adapters, pyserial, a pseudo-terminal and the emulated
    adapter.
    """
    device = tmp_path / "ttyACM0"
    drives = emulate(tmp_path, None, "--adapter", "slcan", "--link", str(device))
    try:
        drives.wait_for(rf"^adapter: slcan on {device}$")
        place = {
            "interface": "slcan",
            "channel": str(device),
            "options": {"bitrate": 1_000_000, "sleep_after_open": 0.0},
        }
        run_round_trip(tmp_path, place)
        drives.wait_for(r"adapter  adapter\.state  state open, bitrate 1000000$")
        assert drives.end(signal.SIGTERM) == 0
    finally:
        drives.kill()
    assert not Path(device).is_symlink()


def test_own_drives_are_beyond_the_bridge(tmp_path):
    """The drives that the bench brings itself are on the far side of its bridge: faults on the way hit their
    frames.
    """
    place = multicast_place()
    far = multicast_place()
    place["bridge"] = {"channel": far["channel"], "options": far["options"]}
    run_round_trip(tmp_path, place, physical=False)


def test_a_drive_beyond_a_bridge_of_different_adapters(tmp_path):
    """The two sides of a bridge may be of different kinds: UDP multicast here, a serial-line adapter
    there.
    """
    near = multicast_place()
    drives = emulate(tmp_path, None, "--adapter", "slcan")
    try:
        device = drives.wait_for(r"^adapter: slcan on (\S+)$")[1]
        options = {"bitrate": 1_000_000, "sleep_after_open": 0.0}
        run_round_trip(
            tmp_path, near | {"bridge": {"interface": "slcan", "channel": device, "options": options}}
        )
    finally:
        drives.kill()


def test_an_adapter_at_the_wrong_bit_rate_hears_nothing(tmp_path):
    """A program that sets another bit rate than that of the bus gets no answer: the case is blocked with the
    reason.
    """
    drives = emulate(tmp_path, None, "--adapter", "slcan")
    try:
        device = drives.wait_for(r"^adapter: slcan on (\S+)$")[1]
        place = {
            "interface": "slcan",
            "channel": device,
            "options": {"bitrate": 500_000, "sleep_after_open": 0.0},
        }
        summary, reported = run_round_trip(tmp_path, place, exit_code=2)
        assert summary["blocked"] == 1
        assert "drive1 (node 5) does not answer on the bus" in reported
    finally:
        drives.kill()


pytestmark = pytest.mark.realtime
