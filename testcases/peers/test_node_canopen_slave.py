"""Our master services against the npm package `canopen` in the role of a slave.

A master is only as good as the slaves of others with which it works: this one has never seen our code.
"""

from __future__ import annotations

import struct

import canopen
import pytest

from fieldbus.canopen import BootState, CanopenMaster, NmtState, NodeSetup, Parameter, PumpedNetwork
from fieldbus.canopen.decode import FrameDecoder
from fieldbus.clock import S
from testcases.node_peer import PATIENCE_S

SLAVE = 33
CLIENT = 127
IDENTITY = {"vendorId": 0x1234, "productCode": 0x77, "revisionNumber": 0x00020001, "serialNumber": 4711}
OBJECTS = [
    {"index": 0x2000, "type": "UNSIGNED32", "value": 7},
    {"index": 0x2001, "type": "INTEGER16", "value": -5},
    {"index": 0x2002, "type": "VISIBLE_STRING", "value": "as it left the factory"},
]


@pytest.fixture
def slave(new_peer):
    """The package as a slave with heartbeat, SDO server, emergency messages and three objects."""
    peer = new_peer(SLAVE, CLIENT)
    peer.call("serve", client=CLIENT, heartbeat_ms=100, identity=IDENTITY, objects=OBJECTS)
    return peer


@pytest.fixture
def client(station):
    """An SDO client without a dictionary."""
    with PumpedNetwork(station.segment) as network:
        client = network.add_node(SLAVE, canopen.ObjectDictionary()).sdo
        client.RESPONSE_TIMEOUT = PATIENCE_S
        yield client


@pytest.mark.requirement("C301-057", "C301-058", "C301-060", "C301-061")
def test_sdo_with_a_foreign_server(slave, client):
    """Expedited and segmented transfers in both directions; identity as the slave states it."""
    slave.call("start")
    assert [struct.unpack("<I", client.upload(0x1018, sub))[0] for sub in (1, 2, 3, 4)] == list(
        IDENTITY.values()
    )
    client.download(0x2000, 0, struct.pack("<I", 0xCAFE0001))
    assert slave.call("value", index=0x2000) == 0xCAFE0001
    assert struct.unpack("<h", client.upload(0x2001, 0)) == (-5,)
    assert client.upload(0x2002, 0) == b"as it left the factory"
    client.download(0x2002, 0, b"something longer than four bytes")
    assert slave.call("value", index=0x2002) == "something longer than four bytes"


@pytest.mark.requirement("C301-026", "C301-108", "C301-123")
def test_supervision_of_a_foreign_slave(station, slave):
    """The boot-up, the heartbeat and its loss, and an emergency message of the stranger are noticed."""
    master = CanopenMaster(station.scheduler, station.segment, node_id=CLIENT, history=station.history)
    lost: list[str] = []
    master.watch_heartbeat(SLAVE, 2 * S, lambda: lost.append("lost"))
    codes: list[int] = []
    master.on_emcy(SLAVE, lambda code, *_: codes.append(code))
    slave.call("start")
    slave.run(2.5)
    assert lost == []
    slave.call("emergency", code=0x4210)
    slave.until(lambda: codes, "the emergency message")
    assert codes == [0x4210]
    slave.close()
    slave.until(lambda: lost, "the loss of the heartbeat")
    assert lost == ["lost"]


@pytest.mark.requirement("C301-015", "C301-016", "C301-023", "C301-146")
def test_foreign_slave_is_taken_into_service(station, slave):
    """The stranger is asked for its identity, gets the one parameter that differs, is started, and shows
    Operational.
    """
    master = CanopenMaster(station.scheduler, station.segment, node_id=CLIENT, history=station.history)
    setup = NodeSetup(
        SLAVE,
        "stranger",
        vendor_id=IDENTITY["vendorId"],
        product_code=IDENTITY["productCode"],
        revision=IDENTITY["revisionNumber"],
        serial=IDENTITY["serialNumber"],
        parameters=(Parameter(0x2000, 0, 8, 4), Parameter(0x2001, 0, -5, 2)),
        heartbeat_timeout_ms=2000,
    )
    node = master.add_node(setup)
    node.sdo.timeout_ns = round(PATIENCE_S * S)
    slave.call("start")
    node.boot()
    slave.until(lambda: node.in_service or node.failure, "the end of the boot")
    assert node.in_service, node.failure
    assert [(p.index, p.value) for p in node.report.written] == [(0x2000, 8)]
    assert slave.call("value", index=0x2000) == 8
    slave.run(1.0)
    assert node.nmt_state is NmtState.OPERATIONAL
    slave.close()
    slave.until(lambda: node.boot_state is BootState.LOST, "the loss of the heartbeat")


def test_other_device_than_expected(station, slave):
    """The stranger is not started when it has another serial number than the expected one."""
    master = CanopenMaster(station.scheduler, station.segment, node_id=CLIENT)
    node = master.add_node(NodeSetup(SLAVE, "stranger", serial=1))
    node.sdo.timeout_ns = round(PATIENCE_S * S)
    slave.call("start")
    node.boot()
    slave.until(lambda: node.failure, "the failure")
    assert node.boot_state is BootState.FAILED
    assert "00001267h" in str(node.failure)


def test_frames_of_the_stranger_are_decoded(station, slave, client):
    """The bus monitor reads NMT, SDO, heartbeat and emergency messages of foreign software without a
    complaint.
    """
    frames = []
    station.segment.attach("monitor", lambda frame, _time: frames.append(frame))
    slave.call("start")
    client.upload(0x2002, 0)
    client.download(0x2002, 0, b"a longer text")
    slave.call("emergency", code=0x4210)
    slave.run(0.3)
    decoder = FrameDecoder()
    words = [decoder.decode(frame) for frame in frames]
    assert not [text for text in words if "malformed" in text]
    assert any("4210h" in text for text in words)
    assert any("2002h" in text for text in words)
