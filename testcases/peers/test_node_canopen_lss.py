"""The npm package `canopen` as LSS master of slaves that have no node-ID yet."""

from __future__ import annotations

from copy import deepcopy

import pytest

from fieldbus.canopen import CanopenSlave, NmtState
from hil.bench.drives import object_dictionary
from testcases.node_peer import MASTER

PATIENCE_MS = 150
"""How long the stranger waits for a slave to object, in each of the steps of a scan."""


def identity(slave):
    """Return the identity of a slave in the words of the package."""
    parts = ("vendorId", "productCode", "revisionNumber", "serialNumber")
    return {part: int(slave.store.values[0x101800 | sub]) for sub, part in enumerate(parts, 1)}


@pytest.fixture
def slave(station):
    """A slave without a node-ID, whose identity has few bits set, so that a scan is short."""
    dictionary = deepcopy(object_dictionary())
    for sub, value in enumerate((0x22, 0x402, 0x10000, 9), 1):
        dictionary[0x1018][sub].default = dictionary[0x1018][sub].value = value
    return CanopenSlave(station.scheduler, station.segment, dictionary, 255, name="anonymous")


@pytest.mark.requirement("C301-153", "C301-155", "C301-158", "C301-161", "C301-162", "C301-163")
def test_scan_and_naming(station, new_peer, slave):
    """Fastscan finds the identity; the node gets a node-ID, stores it, and boots under it."""
    peer = new_peer(MASTER, 7)
    peer.call("start")
    slave.power_on()
    peer.run(0.1)
    assert slave.nmt_state == NmtState.INITIALISING
    assert peer.noticed("heartbeat") == []
    assert peer.call("lssFastscan", timeout=PATIENCE_MS) == identity(slave)
    assert peer.call("lssInquire", what="VendorId") == identity(slave)["vendorId"]
    assert peer.call("lssInquire", what="SerialNumber") == identity(slave)["serialNumber"]
    peer.call("lssNodeId", node=7)
    peer.call("lssStore")
    peer.call("lssOperation")
    peer.until(lambda: [7, 0] in peer.noticed("heartbeat"), "the boot-up under the new node-ID")
    assert slave.node_id == 7
    assert peer.upload(0x1018, 4) == (9).to_bytes(4, "little")
    assert peer.call("lssFastscan", timeout=PATIENCE_MS) is None  # nobody is left without a name


@pytest.mark.requirement("C301-154")
def test_selection_by_identity(station, new_peer, slave):
    """Only the slave that is meant answers to switch mode selective and takes the node-ID."""
    other = CanopenSlave(station.scheduler, station.segment, object_dictionary(), 255, name="other")
    peer = new_peer(MASTER, 8)
    peer.call("start")
    slave.power_on()
    other.power_on()
    peer.run(0.1)
    peer.call("lssSelective", **identity(other), timeout=5000)
    peer.call("lssNodeId", node=8)
    peer.call("lssOperation")
    peer.until(lambda: [8, 0] in peer.noticed("heartbeat"), "the boot-up")
    assert (slave.node_id, other.node_id) == (255, 8)
