"""Faults of a whole segment on a live bus: load, babbling, and a bridge that is taken apart."""

from __future__ import annotations

import can
import pytest

from fieldbus.can import CanFrame
from hil.bench import BenchFile
from hil.errors import ConfigurationError, UnsupportedFaultError
from hil.faults import Injector

BENCH = """
[bench]
name = "observer"
kind = "live"

[segment.can0]
bitrate = 125_000
interface = "virtual"
channel = "{channel}"
{bridge}

[drive.x]
segment = "can0"
node_id = 5
device = "physical"
"""


class Desk:
    """A bench without axes, and a foreign node on either side of it."""

    def __init__(self, channel, *, bridged):
        self.near, self.far = channel, f"{channel} B" if bridged else channel
        bridge = f'bridge = {{ channel = "{self.far}" }}' if bridged else ""
        self.bench = BenchFile("own.toml", BENCH.format(channel=channel, bridge=bridge)).build()
        self.faults = Injector(self.bench)
        self.a, self.b = (can.Bus(interface="virtual", channel=one) for one in (self.near, self.far))

    def heard(self, bus):
        self.bench.run_for(0.05)
        found = []
        while (message := bus.recv(0.01)) is not None:
            found.append(message)
        return found

    def close(self):
        self.bench.close()
        self.a.shutdown()
        self.b.shutdown()


@pytest.fixture
def desk(request):
    desk = Desk(request.node.name, bridged=False)
    yield desk
    desk.close()


@pytest.fixture
def bridged(request):
    desk = Desk(request.node.name, bridged=True)
    yield desk
    desk.close()


def message(can_id):
    return can.Message(arbitration_id=can_id, is_extended_id=False)


@pytest.mark.exhaustive
def test_load_of_a_live_bus(desk):
    """Random frames of the wanted range fill the wanted share of the time at the bit rate of the bench
    file.
    """
    segment = desk.bench.segment()
    armed = desk.faults.inject(
        "can.load",
        load_percent=20.0,
        duration_s=1.0,
        lowest_id=0x600,
        highest_id=0x60F,
        shortest=2,
        longest=4,
    )
    desk.bench.run_for(1.2)
    seconds = (armed.removed_ns - armed.applied_ns) * 1e-9
    load = 100.0 * segment.busy_bits / 125_000 / seconds
    assert 5.0 < load < 22.0  # never more; less where the machine has stood still
    frames = desk.heard(desk.a)
    assert len(frames) == len(segment.log)
    assert all(0x600 <= one.arbitration_id <= 0x60F and 2 <= one.dlc <= 4 for one in frames)
    assert {sender for _, sender, *_ in segment.log} == {"load"}
    assert desk.heard(desk.a) == []


@pytest.mark.exhaustive
def test_babbling_on_a_live_bus(desk):
    """One frame again and again, more of them than a cycle has room for, until the fault is removed."""
    armed = desk.faults.inject("can.babble", can_id=0x001, data="AA", node="idiot")
    desk.bench.run_for(0.5)
    armed.remove()
    frames = desk.heard(desk.a)
    assert len(frames) > 50
    assert {(one.arbitration_id, bytes(one.data)) for one in frames} == {(0x001, b"\xaa")}
    assert {sender for _, sender, *_ in desk.bench.segment().log} == {"idiot"}
    assert desk.heard(desk.a) == []


@pytest.mark.parametrize("kind", ["can.cable_break", "can.unplug"])
def test_a_bridge_is_taken_apart(bridged, kind):
    """Nothing passes any more, nodes of the bench stay with the first side; afterwards everything is as
    before.
    """
    received = []
    port = bridged.bench.segment().attach("local", lambda frame, time_ns: received.append(frame.can_id))
    key = "node" if kind == "can.unplug" else "nodes"

    def exchange():
        received.clear()
        bridged.a.send(message(0x100))
        bridged.b.send(message(0x200))
        port.send(CanFrame(0x300))
        bridged.bench.run_for(0.1)
        on = [sorted(one.arbitration_id for one in bridged.heard(bus)) for bus in (bridged.a, bridged.b)]
        return (*on, sorted(received))

    joined = ([0x200, 0x300], [0x100, 0x300], [0x100, 0x200])
    assert exchange() == joined
    armed = bridged.faults.inject(kind, **{key: bridged.far})
    assert exchange() == ([0x300], [], [0x100])
    armed.remove()
    assert exchange() == joined


def test_without_a_bridge_a_cable_cannot_be_broken(desk):
    """A bench that has one adapter cannot break the cable."""
    with pytest.raises(UnsupportedFaultError, match="it needs access to the cable, or a bridge of the bench"):
        desk.faults.inject("can.cable_break", nodes="x")


def test_what_is_cut_off_is_a_side(bridged):
    """Another name is refused with those of the sides."""
    with pytest.raises(
        ConfigurationError, match=r"can\.unplug\.parameters\.node: 'x' is not allowed; allowed: "
    ):
        bridged.faults.inject("can.unplug", node="x")


@pytest.mark.parametrize(
    "kind", ["can.noise", "can.stuck_dominant", "can.bus_off", "can.no_ack", "can.overload"]
)
def test_what_no_adapter_can_do_is_refused(bridged, kind):
    """Bits, levels and the controllers of others are out of reach: refused with the reason."""
    parameters = {
        "can.noise": {"bit_error_rate": 0.001},
        "can.bus_off": {"node": "x"},
        "can.overload": {"node": "x"},
    }
    with pytest.raises(UnsupportedFaultError, match="it needs "):
        bridged.faults.inject(kind, **parameters.get(kind, {}))
