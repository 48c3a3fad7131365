"""A bench without axes: silent with somebody else's controller, and between it and its drives."""

from __future__ import annotations

import can
import pytest

from fieldbus.can import CanFrame, frame_bits
from hil.bench import BenchFile, BenchFileError, load_bench
from hil.errors import UnsupportedFaultError
from hil.faults import Injector, frame

OBSERVER = """
[bench]
name = "observer"
kind = "live"

[segment.can0]
interface = "virtual"
channel = "{channel}"
{bridge}

[drive.x]
segment = "can0"
node_id = 5
device = "physical"
"""

SYNC = CanFrame(0x080)
CONTROL = CanFrame(0x205, b"\x0f\x00\x09")
STATUS = CanFrame(0x185, b"\x37\x02\x09")


class Desk:
    """A bench without axes, a controller on its channel and, with a bridge, a drive on the other side."""

    def __init__(self, channel, *, bridged):
        self.near, self.far = channel, f"{channel} drives" if bridged else channel
        bridge = f'bridge = {{ channel = "{self.far}" }}' if bridged else ""
        self.bench = BenchFile("own.toml", OBSERVER.format(channel=channel, bridge=bridge)).build()
        self.faults = Injector(self.bench)
        self.controller = can.Bus(interface="virtual", channel=self.near)
        self.drive = can.Bus(interface="virtual", channel=self.far)

    def close(self):
        self.bench.close()
        self.controller.shutdown()
        self.drive.shutdown()


def send(bus, sent):
    bus.send(can.Message(arbitration_id=sent.can_id, data=sent.data, is_extended_id=False))


def drain(bus):
    """Return everything that has come to a bus."""
    found = []
    while (message := bus.recv(0.02)) is not None:
        found.append((message.arbitration_id, bytes(message.data)))
    return found


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


def test_it_sends_nothing_by_itself(request):
    """From its start to its end not one frame: no SYNC, no heartbeat, no SDO, no NMT command."""
    with can.Bus(interface="virtual", channel=request.node.name) as witness:
        desk = Desk(request.node.name, bridged=False)
        desk.bench.run_for(0.5)
        desk.close()
        assert drain(witness) == []


def test_it_records_and_decodes_what_others_say(desk):
    """The frames of controller and drive are in the trace, and in words by the mapping of the drive's
    dictionary.
    """
    send(desk.controller, CanFrame(0x605, b"\x40\x41\x60\0\0\0\0\0"))
    send(desk.drive, CanFrame(0x585, b"\x4b\x41\x60\0\x37\x02\0\0"))
    send(desk.controller, SYNC)
    desk.bench.run_for(0.2)
    frames = [entry[2] for entry in desk.bench.segment().log]
    assert [one.can_id for one in frames] == [0x605, 0x585, 0x080]
    words = [desk.bench.decode(one) for one in frames]
    assert "x" in words[0]
    assert "6041h" in words[1]
    assert words[2].startswith("SYNC")
    assert len(list(desk.bench.trace().raw_frames("can0"))) == 3


def test_it_learns_the_mapping_that_somebody_else_writes(desk):
    """PDOs are described by the mapping that the foreign controller has written by SDO, whenever they are
    asked for.
    """
    status = CanFrame(0x185, b"\x01\x00\x00\x00")

    def write(index, sub, value, size=4):
        command = 0x23 | (4 - size) << 2
        data = bytes([command]) + index.to_bytes(2, "little") + bytes([sub]) + value.to_bytes(4, "little")
        send(desk.controller, CanFrame(0x605, data))
        send(desk.drive, CanFrame(0x585, b"\x60" + data[1:4] + bytes(4)))

    for index, sub, value, size in (
        (0x1800, 1, 0x80000185, 4),
        (0x1A00, 0, 0, 1),
        (0x1A00, 1, 0x606C0020, 4),
        (0x1A00, 0, 1, 1),
        (0x1800, 1, 0x185, 4),
    ):
        write(index, sub, value, size)
    desk.bench.run_for(0.2)
    words = desk.bench.decode(status)
    assert "606Ch" in words or "velocity" in words.lower()
    for _, _, frame_, _ in desk.bench.segment().log[:4]:  # an early look back does not undo what came later
        desk.bench.decode(frame_)
    assert desk.bench.decode(status) == words


def test_it_records_the_load(desk):
    """The load of a live segment is that of the frames seen, at the bit rate of the bench file."""
    for _ in range(20):
        send(desk.drive, STATUS)
    desk.bench.run_for(0.2)
    segment = desk.bench.segment()
    assert segment.busy_bits == 20 * frame_bits(STATUS)
    load = desk.bench.trace()["can0.load"]
    seconds = load.values.sum() / 100.0 * desk.bench.cycle_ns * 1e-9
    assert seconds == pytest.approx(20 * frame_bits(STATUS) / 1_000_000)


def test_it_injects_on_request(desk):
    """What a fault sends is all that it sends."""
    desk.faults.inject("frame.inject", can_id=0x000, data="8005", count=3)
    desk.bench.run_for(0.2)
    assert drain(desk.controller) == [(0, b"\x80\x05")] * 3


@pytest.mark.parametrize(
    ("kind", "parameters", "heard"),
    [
        ("frame.drop", {}, []),
        ("frame.replace", {"data": "0800"}, [(0x185, b"\x08\x00")]),
        ("frame.duplicate", {"copies": 2}, [(0x185, STATUS.data)] * 3),
        ("frame.delay", {"delay_s": 0.05}, [(0x185, STATUS.data)]),
    ],
)
def test_faults_hit_frames_between_strangers(bridged, kind, parameters, heard):
    """Every fault on frames works on what passes the bridge, by drive and message, and is reported with its
    hits.
    """
    armed = bridged.faults.inject(kind, drive="x", message="tpdo1", **parameters)
    send(bridged.drive, STATUS)
    send(bridged.controller, CONTROL)
    bridged.bench.run_for(0.2)
    assert drain(bridged.controller) == heard
    assert drain(bridged.drive) == [(CONTROL.can_id, CONTROL.data)]
    assert [event.data["hit"] for event in bridged.bench.history.select(kind="fault.hit")] == [1]
    armed.remove()
    send(bridged.drive, STATUS)
    bridged.bench.run_for(0.1)
    assert drain(bridged.controller) == [(0x185, STATUS.data)]


def test_a_frame_of_strangers_can_be_the_trigger(bridged):
    """The n-th frame that passes can itself be hit."""
    bridged.faults.inject(
        "frame.drop", trigger=frame(message="tpdo1", drive="x", number=2), count=1, drive="x", message="tpdo1"
    )
    for number in range(4):
        send(bridged.drive, CanFrame(0x185, bytes([number])))
    bridged.bench.run_for(0.2)
    assert [data[0] for _, data in drain(bridged.controller)] == [0, 2, 3]


def test_only_one_direction(bridged):
    """`sender` is the channel of a side."""
    bridged.faults.inject("frame.drop", sender=bridged.far)
    send(bridged.drive, STATUS)
    send(bridged.controller, CONTROL)
    bridged.bench.run_for(0.1)
    assert drain(bridged.controller) == []
    assert len(drain(bridged.drive)) == 1


def test_bit_errors_stay_refused(bridged):
    """No adapter gives access to the bits of the wire, between strangers neither."""
    with pytest.raises(UnsupportedFaultError, match="bit errors need access to the bits of the wire"):
        bridged.faults.inject("frame.corrupt", can_id=0x185)


def test_a_virtual_bench_without_axes_is_silent_too():
    """In virtual time the controller of a bench without axes sends nothing either; its drives do."""
    text = load_bench("reference").text
    with BenchFile("own.toml", text[: text.index("[axis.")]).build() as bench:
        bench.run_for(1.0)
        senders = {sender for _, sender, *_ in bench.segment().log}
        assert senders == {"drive1"}


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ('bridge = { channel = "a" }', r"segment\.can0\.bridge: both sides are virtual a"),
        (
            'bridge = { chanel = "b" }',
            r"segment\.can0\.bridge\.chanel: unknown key; did you mean channel\? allowed: channel, interface",
        ),
        ("bridge = {}", r"segment\.can0\.bridge\.channel: the key is missing"),
        (
            'options = { channel = "b" }',
            r"segment\.can0\.options\.channel: this is no option of an interface",
        ),
        (
            'bridge = { channel = "b", options = { name = "c" } }',
            r"segment\.can0\.bridge\.options\.name: this is no option",
        ),
        (
            'bridge = { channel = "b", gateway = "kernel" }',
            r"segment\.can0\.bridge\.gateway: the kernel joins interfaces of SocketCAN only, not virtual",
        ),
        (
            'bridge = { channel = "b", gateway = "cangw" }',
            r"bridge\.gateway: 'cangw' is not allowed; allowed: 'bench' or",
        ),
        ("options = { port = [1] }", r"segment\.can0\.options\.port"),
    ],
)
def test_mistakes_in_the_bench_file(change, message):
    """What cannot be a bridge or an option is refused with its key."""
    with pytest.raises(BenchFileError, match=message):
        BenchFile("own.toml", OBSERVER.format(channel="a", bridge=change))


@pytest.mark.parametrize("change", ['bridge = { channel = "b" }', "options = { port = 1 }"])
def test_bridge_and_options_are_for_live_benches(change):
    """A virtual segment has neither."""
    text = load_bench("reference").text.replace("[segment.can0]", f"[segment.can0]\n{change}")
    with pytest.raises(BenchFileError, match=r"segment\.can0: options and bridge belong to a live bench"):
        BenchFile("own.toml", text)
