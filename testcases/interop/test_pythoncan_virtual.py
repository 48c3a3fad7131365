"""Plain python-can on a virtual segment: raw frames by hand against the emulated drive, answers byte for
byte.

`can.Bus(interface="hil")` lets a program that was written for real hardware talk to the drive; `recv` lets
time pass.
"""

from __future__ import annotations

from itertools import pairwise

import can
import pytest

NODE = 5
NMT, SDO_REQUEST, SDO_ANSWER, ERROR_CONTROL, EMCY = (
    0x000,
    0x600 + NODE,
    0x580 + NODE,
    0x700 + NODE,
    0x080 + NODE,
)
TPDO1, RPDO1 = 0x180 + NODE, 0x200 + NODE


class Desk:
    """What somebody with a CAN adapter does: send frames, wait for frames."""

    def __init__(self, bus: can.BusABC) -> None:
        self.bus = bus

    def send(self, can_id: int, data: str = "", *, remote: bool = False) -> None:
        self.bus.send(
            can.Message(
                arbitration_id=can_id,
                data=None if remote else bytes.fromhex(data),
                is_remote_frame=remote,
                dlc=1 if remote else None,
                is_extended_id=False,
            )
        )

    def receive(self, can_id: int, timeout: float = 1.0) -> str | None:
        """Return the data of the next frame with this identifier, None after `timeout` s of simulated
        time.
        """
        end = None
        while (message := self.bus.recv(timeout)) is not None:
            end = message.timestamp + timeout if end is None else end
            if message.arbitration_id == can_id and not message.is_remote_frame:
                return message.data.hex(" ")
            if message.timestamp >= end:
                break
        return None

    def sdo(self, request: str) -> str | None:
        self.send(SDO_REQUEST, request)
        return self.receive(SDO_ANSWER)

    def drain(self) -> None:
        while self.bus.recv(0) is not None:
            pass


@pytest.fixture
def desk(station):
    assert station.node_id == NODE
    with can.Bus(interface="hil", channel=station.medium.name, bitrate=1_000_000) as bus:
        desk = Desk(bus)
        station.drive.power_on()
        assert desk.receive(ERROR_CONTROL) == "00"
        yield desk


# -- SDO
# ------------------------------------------------------------------------------------------------------


@pytest.mark.requirement("C301-009", "C301-057", "C301-060")
@pytest.mark.parametrize(
    ("request_", "answer"),
    [
        ("40 00 10 00 00 00 00 00", "43 00 10 00 92 01 02 00"),  # device type
        ("40 41 60 00 00 00 00 00", "4b 41 60 00 50 02 00 00"),  # status word: Switch on disabled
        ("40 61 60 00 00 00 00 00", "4f 61 60 00 00 00 00 00"),  # no mode
        ("23 83 60 00 40 42 0f 00", "60 83 60 00 00 00 00 00"),  # 1000000
        ("2b 40 60 00 06 00 00 00", "60 40 60 00 00 00 00 00"),  # Shutdown
        ("2f 60 60 00 03 00 00 00", "60 60 60 00 00 00 00 00"),  # profile velocity
        ("22 83 60 00 40 42 0f 00", "60 83 60 00 00 00 00 00"),  # size not given
    ],
)
def test_expedited_transfers(desk, request_, answer):
    """Expedited uploads and downloads of 1, 2 and 4 bytes are answered as the profile lays them out."""
    assert desk.sdo(request_) == answer


@pytest.mark.requirement("C301-059", "C301-060", "C301-061")
def test_segmented_upload(desk):
    """The device name comes in segments with alternating toggle, the last one marked and with its unused
    bytes.
    """
    text = b"Emulated servo drive CiA 402"
    assert desk.sdo("40 08 10 00 00 00 00 00") == f"41 08 10 00 {len(text):02x} 00 00 00"
    received = b""
    for number in range(4):
        answer = bytes.fromhex(desk.sdo(f"{0x60 | (number & 1) << 4:02x} 00 00 00 00 00 00 00"))
        assert answer[0] == (number & 1) << 4 | (number == 3)
        received += answer[1:]
    assert received == text


@pytest.mark.requirement("C301-059", "C301-058")
def test_segmented_download(desk):
    """A string is written in two segments and read back."""
    assert desk.sdo("21 03 64 00 09 00 00 00") == "60 03 64 00 00 00 00 00"
    assert desk.sdo("00 4d 2d 31 32 33 34 35") == "20 00 00 00 00 00 00 00"
    assert desk.sdo("1b 36 37 00 00 00 00 00") == "30 00 00 00 00 00 00 00"
    assert desk.sdo("40 03 64 00 00 00 00 00") == "41 03 64 00 09 00 00 00"
    assert desk.sdo("60 00 00 00 00 00 00 00") == "00 4d 2d 31 32 33 34 35"
    assert desk.sdo("70 00 00 00 00 00 00 00") == "1b 36 37 00 00 00 00 00"


@pytest.mark.requirement(
    "C301-062", "C301-074", "C301-079", "C301-085", "C301-086", "C301-087", "C301-096", "C301-097"
)
@pytest.mark.parametrize(
    ("request_", "answer"),
    [
        ("40 00 50 00 00 00 00 00", "80 00 50 00 00 00 02 06"),  # no such object
        ("40 18 10 05 00 00 00 00", "80 18 10 05 11 00 09 06"),  # no such sub-index
        ("23 00 10 00 01 00 00 00", "80 00 10 00 02 00 01 06"),  # read-only
        ("40 c4 60 05 00 00 00 00", "80 c4 60 05 01 00 01 06"),  # write-only
        ("2f 60 60 00 0b 00 00 00", "80 60 60 00 30 00 09 06"),  # a mode that the drive has not
        ("23 40 60 00 06 00 00 00", "80 40 60 00 10 00 07 06"),  # four bytes for a word
        ("e7 00 10 00 00 00 00 00", "80 00 10 00 01 00 04 05"),  # no such command
    ],
)
def test_aborts(desk, request_, answer):
    """What cannot be done is answered with the abort code of the profile, at the object that was asked
    for.
    """
    assert desk.sdo(request_) == answer


@pytest.mark.requirement("C301-075")
def test_short_request_is_ignored(desk):
    """A request with fewer than eight bytes gets no answer, and the next proper one does."""
    assert desk.sdo("40 00 10 00") is None
    assert desk.sdo("40 00 10 00 00 00 00 00") == "43 00 10 00 92 01 02 00"


# -- NMT, error control
# ---------------------------------------------------------------------------------------


@pytest.mark.requirement("C301-016", "C301-022", "C301-023", "C301-010")
def test_nmt_by_hand(desk):
    """Reset, start, stop and Pre-operational show in boot-up and heartbeats; a foreign node number does not
    count.
    """
    desk.send(NMT, "81 05")
    assert desk.receive(ERROR_CONTROL) == "00"
    assert desk.sdo("2b 17 10 00 64 00 00 00") == "60 17 10 00 00 00 00 00"  # heartbeat every 100 ms
    assert desk.receive(ERROR_CONTROL) == "7f"
    for command, state in (
        ("01 05", "05"),
        ("02 05", "04"),
        ("80 05", "7f"),
        ("01 00", "05"),
        ("02 06", "05"),
    ):
        desk.send(NMT, command)
        assert desk.receive(ERROR_CONTROL) == state
    desk.send(NMT, "82 05")
    assert desk.receive(ERROR_CONTROL) == "00"
    assert desk.receive(ERROR_CONTROL) is None, "1017h is 0 again"


@pytest.mark.requirement("C301-017")
def test_malformed_nmt_is_ignored(desk):
    """Commands of wrong length or without a meaning change nothing."""
    assert desk.sdo("2b 17 10 00 0a 00 00 00") is not None
    for data in ("", "01", "01 05 00", "03 05"):
        desk.send(NMT, data)
        desk.drain()
        assert desk.receive(ERROR_CONTROL) == "7f"


@pytest.mark.requirement("C301-028")
def test_node_guarding_by_hand(desk):
    """Remote requests are answered with the state and a toggle bit that begins with 0."""
    answers = []
    for _ in range(4):
        desk.send(ERROR_CONTROL, remote=True)
        answers.append(desk.receive(ERROR_CONTROL))
    assert answers == ["7f", "ff", "7f", "ff"]


# -- a drive moved by hand
# ------------------------------------------------------------------------------------


@pytest.mark.requirement("C402-018", "C402-019", "C402-024", "C402-021", "C402-039", "C301-019", "C301-044")
def test_controlword_by_pdo(desk):
    """RPDO1 with the control word takes the drive to Operation enabled; TPDO1 tells every status word on its
    way.
    """
    desk.send(NMT, "01 05")
    assert desk.receive(TPDO1) == "50 02"
    for word, status in (("06 00", "31 02"), ("07 00", "33 02"), ("0f 00", "37 02"), ("00 00", "50 02")):
        desk.send(RPDO1, word)
        assert desk.receive(TPDO1) == status


@pytest.mark.requirement("C402-097", "C402-018", "C402-019", "C402-024")
def test_profile_velocity_by_sdo(desk, station):
    """A profile velocity move with SDO frames alone: 600 rpm for one second are ten revolutions."""
    for request in (
        "2f 60 60 00 03 00 00 00",  # profile velocity
        "23 ff 60 00 c0 27 09 00",  # 600000 * 10^-3 rpm
        "2b 40 60 00 06 00 00 00",
        "2b 40 60 00 07 00 00 00",
        "2b 40 60 00 0f 00 00 00",
    ):
        assert desk.sdo(request)[:2] == "60"
    assert desk.bus.recv(0.5) is None
    begin = actual_position(desk)
    assert desk.bus.recv(1.0) is None
    travelled = (actual_position(desk) - begin) / 131072
    assert travelled == pytest.approx(10.0, rel=0.01)
    assert desk.sdo("40 6c 60 00 00 00 00 00")[:11] == "43 6c 60 00"
    assert station.drive.mechanics.velocity == pytest.approx(0.100, rel=0.005)


def actual_position(desk) -> int:
    """Return 6064h."""
    answer = bytes.fromhex(desk.sdo("40 64 60 00 00 00 00 00"))
    assert answer[:4] == bytes.fromhex("43 64 60 00")
    return int.from_bytes(answer[4:], "little", signed=True)


@pytest.mark.requirement("C301-108", "C301-109", "C402-014", "C402-016", "C402-025")
def test_fault_by_hand(desk, station):
    """A fault sends the EMCY with code and register; control word 0080h resets it and sends 0000h."""
    station.drive.raise_fault(0x4310)
    assert desk.receive(EMCY) == "10 43 09 00 00 00 00 00"
    assert desk.sdo("40 3f 60 00 00 00 00 00") == "4b 3f 60 00 10 43 00 00"
    assert desk.sdo("40 41 60 00 00 00 00 00") == "4b 41 60 00 18 02 00 00"
    assert desk.sdo("2b 40 60 00 00 00 00 00") == "60 40 60 00 00 00 00 00"
    desk.send(SDO_REQUEST, "2b 40 60 00 80 00 00 00")
    assert desk.receive(EMCY) == "00 00 00 00 00 00 00 00"
    assert desk.receive(SDO_ANSWER) == "60 40 60 00 00 00 00 00"
    assert desk.sdo("40 41 60 00 00 00 00 00") == "4b 41 60 00 50 02 00 00"


def test_periodic_sync_of_python_can(desk):
    """`send_periodic` produces SYNC in simulated time: a TPDO of type 2 comes with every second one."""
    for request in (
        "23 00 18 01 85 01 00 c0",  # TPDO1 invalid
        "2f 00 18 02 02 00 00 00",  # every second SYNC
        "23 00 18 01 85 01 00 40",  # TPDO1 valid
    ):
        assert desk.sdo(request)[:2] == "60"
    desk.send(NMT, "01 05")
    task = desk.bus.send_periodic(can.Message(arbitration_id=0x080, is_extended_id=False), 0.01)
    stamps = []
    while len(stamps) < 10:
        message = desk.bus.recv(1.0)
        assert message is not None
        if message.arbitration_id == TPDO1:
            stamps.append(message.timestamp)
    task.stop()
    assert [b - a for a, b in pairwise(stamps)] == pytest.approx([0.02] * 9, abs=1e-6)
    while desk.bus.recv(0.01) is not None:
        pass
    assert desk.bus.recv(1.0) is None
