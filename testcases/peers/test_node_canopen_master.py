"""The CANopen stack of the npm package `canopen` as the master of the emulated drive.

It was written independently of this project and of the Python library `canopen`: whatever passes here is read
the same way by two strangers.
"""

from __future__ import annotations

import struct

import pytest

from emulators.drive.cia402 import DriveConfig
from fieldbus.canopen.abort import AbortCode, SdoAbort
from testcases.node_peer import NODE, PeerError

ENABLE = (0x06, 0x07, 0x0F)
STATE = 0x6F


def u16(value: int) -> bytes:
    return struct.pack("<H", value)


def u32(value: int) -> bytes:
    return struct.pack("<I", value & 0xFFFFFFFF)


def held_by(store, index: int, sub: int) -> tuple[bytes, int | None]:
    """Return what the drive holds, or the abort code with which it refuses."""
    try:
        return store.read(index, sub), None
    except SdoAbort as abort:
        return b"", abort.code


@pytest.mark.requirement("C301-060", "C301-061", "C301-132", "C301-146")
def test_every_readable_object(station, peer):
    """Expedited and segmented uploads of the whole dictionary bring what the drive holds."""
    store = station.drive.slave.store
    seen = 0
    for entry in list(store.entries.values()):
        index, sub = entry.key >> 8, entry.key & 0xFF
        held, refusal = held_by(store, index, sub)
        if refusal is not None:  # write-only, or an empty entry of the error history
            with pytest.raises(PeerError) as refused:
                peer.upload(index, sub)
            assert refused.value.code == refusal
            continue
        data = peer.upload(index, sub)
        if data != held:  # it may have moved meanwhile: an actual value
            assert len(data) == len(store.read(index, sub)), f"{index:04X}h:{sub}"
        seen += 1
    assert seen > 250
    assert peer.upload(0x1000) == u32(0x00020192)


@pytest.mark.requirement(
    "C301-057",
    "C301-058",
    "C301-059",
    "C301-063",
    "C301-064",
    "C301-065",
    "C301-066",
    "C301-067",
    "C301-068",
    "C301-069",
    "C301-070",
)
@pytest.mark.parametrize("size", [1, 4, 5, 7, 8, 100, 900])
@pytest.mark.parametrize("block_down", [False, True], ids=["segmented", "block"])
@pytest.mark.parametrize("block_up", [False, True], ids=["segmented-back", "block-back"])
def test_transfers_of_every_kind(station, peer, size, block_down, block_up):
    """What is written in one kind of transfer is read back in every kind; 900 bytes take several blocks."""
    text = bytes(0x20 + number % 90 for number in range(size))
    peer.download(0x6403, 0, text, block=block_down)
    assert station.drive.slave.store.read(0x6403, 0) == text
    assert peer.upload(0x6403, 0, block=block_up) == text


@pytest.mark.requirement(
    "C301-085", "C301-086", "C301-087", "C301-096", "C301-093", "C301-098", "C301-074", "C402-090"
)
@pytest.mark.parametrize(
    ("index", "sub", "data", "code"),
    [
        (0x6041, 0, u16(0), AbortCode.READ_ONLY),
        (0x5FFF, 0, u16(0), AbortCode.NO_OBJECT),
        (0x607D, 9, u32(0), AbortCode.NO_SUB_INDEX),
        (0x6040, 0, u32(0), AbortCode.LENGTH),
        (0x607A, 0, u16(0), AbortCode.LENGTH),
        (0x6060, 0, b"\x05", AbortCode.VALUE),
        (0x605A, 0, u16(100), AbortCode.VALUE),
    ],
)
def test_refusals(peer, index, sub, data, code):
    """A stranger's client gets the reason that the standard names."""
    with pytest.raises(PeerError) as refused:
        peer.download(index, sub, data)
    assert refused.value.code == code


@pytest.mark.requirement("C301-016", "C301-018", "C301-022", "C301-023", "C301-027")
def test_network_management(station, peer):
    """Boot-up, heartbeat in every state, all commands."""
    peer.download(0x1017, 0, u16(50))
    for command, state in (
        ("startNode", 0x05),
        ("stopNode", 0x04),
        ("enterPreOperational", 0x7F),
        ("startNode", 0x05),
    ):
        peer.call("nmt", command=command, node=NODE)
        peer.until(lambda state=state: peer.noticed("heartbeat")[-1] == [NODE, state], f"state {state:02X}h")
    peer.events.clear()
    peer.call("nmt", command="resetNode", node=NODE)
    peer.until(lambda: [NODE, 0] in peer.noticed("heartbeat"), "the boot-up after the reset")
    assert peer.upload(0x1017) == u16(0)
    assert station.drive.slave.nmt_state == 0x7F


@pytest.mark.requirement("C301-025", "C301-026", "C301-108", "C301-109", "C301-123", "C402-014", "C402-025")
def test_fault_and_acknowledgement(station, peer):
    """A fault is an emergency message that the stranger reads; so is its end."""
    peer.download(0x6060, 0, b"\x03")
    for word in ENABLE:
        peer.download(0x6040, 0, u16(word))
    peer.poll(lambda: peer.upload(0x6041)[0] & STATE == 0x27, "Operation enabled")
    station.drive.raise_fault(0x2310)
    peer.until(lambda: peer.noticed("emergency"), "the emergency message")
    code, register, info = peer.noticed("emergency")[0]
    assert (code, register & 0x03, len(info)) == (0x2310, 0x03, 10)
    peer.poll(lambda: peer.upload(0x6041)[0] & 0x4F == 0x08, "Fault")
    assert peer.upload(0x603F) == u16(0x2310)
    assert peer.upload(0x1003, 1)[:2] == u16(0x2310)
    peer.download(0x6040, 0, u16(0x80))
    peer.until(lambda: peer.noticed("emergency")[-1][0] == 0, "the end of the error")
    assert peer.noticed("emergency")[-1][1] == 0
    peer.poll(lambda: peer.upload(0x6041)[0] & 0x4F == 0x40, "Switch on disabled")


@pytest.mark.requirement(
    "C301-031", "C301-038", "C301-039", "C301-044", "C301-046", "C301-051", "C301-052", "C402-091", "C402-295"
)
def test_a_move_over_pdos(station, peer):
    """The stranger maps PDOs by the standard's procedure, sends SYNC, enables the drive and moves it."""
    encoder = DriveConfig.reference(node_id=NODE).encoder.counts_per_revolution
    rpdo, tpdo = 0x200 + NODE, 0x180 + NODE
    for communication, mapping, cob_id, kind, objects in (
        (0x1400, 0x1600, rpdo, 255, (0x60400010, 0x607A0020)),
        (0x1800, 0x1A00, tpdo, 1, (0x60410010, 0x60640020)),
    ):
        peer.download(communication, 1, u32(0x80000000 | cob_id))
        peer.download(mapping, 0, b"\0")
        for number, mapped in enumerate(objects, 1):
            peer.download(mapping, number, u32(mapped))
        peer.download(mapping, 0, bytes((len(objects),)))
        peer.download(communication, 2, bytes((kind,)))
        peer.download(communication, 1, u32(cob_id))
    peer.download(0x6060, 0, b"\x01")
    peer.call(
        "transmitPdo",
        cobId=rpdo,
        transmissionType=254,
        objects=[{"index": 0x2040, "type": "UNSIGNED16"}, {"index": 0x207A, "type": "INTEGER32"}],
    )
    peer.call(
        "receivePdo",
        cobId=tpdo,
        objects=[{"index": 0x2041, "type": "UNSIGNED16"}, {"index": 0x2064, "type": "INTEGER32"}],
    )
    peer.call("nmt", command="startNode", node=NODE)
    peer.call("sync", period_us=10_000)

    def newest() -> tuple[int, int]:
        values = [objects for cob_id, objects in peer.noticed("pdo") if cob_id == tpdo]
        return (values[-1][str(0x2041)], values[-1][str(0x2064)]) if values else (0, 0)

    def status(mask: int, value: int) -> bool:
        return newest()[0] & mask == value

    def control(word: int, target: int = 0) -> None:
        peer.call("setValues", values=[[0x2040, word], [0x207A, target]])

    peer.until(lambda: status(0x4F, 0x40), "Switch on disabled over the TPDO")
    for word, state in zip(ENABLE, (0x21, 0x23, 0x27), strict=True):
        control(word)
        peer.until(lambda state=state: status(STATE, state), f"state {state:02X}h")
    start = newest()[1]
    target = start + 2 * encoder
    control(0x0F, target)
    control(0x1F, target)
    peer.until(lambda: status(0x1000, 0x1000), "the acknowledgement of the setpoint")
    control(0x0F, target)
    peer.until(lambda: status(0x1400, 0x0400), "target reached")
    assert newest()[1] == pytest.approx(target, abs=encoder // 100)
    travel_m = 2 * 0.01  # two turns of the screw
    assert station.drive.mechanics.position == pytest.approx(travel_m, rel=0.01)
