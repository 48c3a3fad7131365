"""What every CAN segment does, whatever carries it: one suite over all backends.

The backends: the virtual medium; a live segment over python-can's `virtual` bus, over `udp_multicast` on the
loopback, through a serial-line adapter (`slcan`) on a pseudo-terminal, and over a SocketCAN interface, which
the environment variable HIL_VCAN names (`hil vcan` makes one); and a bridge between two live
buses, seen from its own process and from either side.
"""

import os
import socket
from collections.abc import Callable

import pytest

from emulators.adapter import ChannelState, SlcanDevice
from fieldbus.can import CanFrame, CanMedium, CanPort, CanSegment, HookResult
from fieldbus.can.live import LiveSegment
from fieldbus.clock import MS, RealtimeScheduler, S, Scheduler, VirtualScheduler
from fieldbus.errors import BusError, ConfigurationError

WAIT = 10 * S
SETTLE = 50 * MS  # long enough for a frame too many to show up
MULTICAST = "239.74.163.2"


class Node:
    """A node that keeps what it receives."""

    def __init__(self, segment: CanSegment, name: str, **options: bool):
        self.scheduler: Scheduler = segment.scheduler
        self.received: list[tuple[int, CanFrame]] = []
        self.port: CanPort = segment.attach(
            name, lambda frame, time_ns: self.received.append((time_ns, frame)), **options
        )

    @property
    def frames(self):
        return [frame for _, frame in self.received]

    def expect(self, *frames):
        """Wait for exactly these frames, in this order, and no more."""
        self.scheduler.run_until(lambda: len(self.received) >= len(frames), WAIT)
        self.scheduler.run_for(SETTLE)
        assert self.frames == list(frames)


class Backend:
    """Segments of one kind: `near` and `far` are the same bus, seen through different segment objects where
    it can be.
    """

    def __init__(
        self,
        scheduler: Scheduler,
        open_segment: Callable[[str], CanSegment],
        *,
        separate: bool,
        between: tuple[object, ...] = (),
    ):
        self.scheduler = scheduler
        self.near = open_segment("near")
        self.far = open_segment("far") if separate else self.near
        self.between = between

    def close(self):
        parts = (self.near, self.far, *self.between)
        for segment in {id(segment): segment for segment in parts}.values():
            close = getattr(segment, "close", None)
            if close is not None:
                close()


FD_BITRATE = 2_000_000


def virtual_medium(_channel):
    scheduler = VirtualScheduler()
    return Backend(
        scheduler, lambda name: CanMedium(scheduler, name=name, data_bitrate=FD_BITRATE), separate=False
    )


def live(interface, channel, **options):
    scheduler = RealtimeScheduler()
    return Backend(
        scheduler,
        lambda name: LiveSegment.open(
            scheduler, interface=interface, channel=channel, name=name, fd_bitrate=FD_BITRATE, **options
        ),
        separate=True,
    )


def python_can_virtual(channel):
    return live("virtual", channel)


def udp_multicast(_channel):
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        try:
            membership = socket.inet_aton(MULTICAST) + socket.inet_aton("0.0.0.0")
            probe.setsockopt(socket.IPPROTO_IP, socket.IP_ADD_MEMBERSHIP, membership)
            probe.bind(("", 0))
            port = probe.getsockname()[1]  # a port of its own, so that runs side by side do not meet
        except OSError as error:
            pytest.skip(f"no multicast here: {error}")
    return live("udp_multicast", MULTICAST, port=port, hop_limit=0)


def slcan(channel):
    """The near segment behind an emulated adapter, whose bus the far one shares."""
    scheduler = RealtimeScheduler()
    hub = LiveSegment.open(scheduler, interface="virtual", channel=channel, name="hub")
    device = SlcanDevice(hub, bitrate=500_000)
    where = {
        "near": {"interface": "slcan", "channel": device.path, "bitrate": 500_000, "sleep_after_open": 0.0},
        "far": {"interface": "virtual", "channel": channel},
    }
    backend = Backend(
        scheduler,
        lambda name: LiveSegment.open(scheduler, name=name, **where[name]),
        separate=True,
        between=(device, hub),
    )
    # A real adapter has long been opened when a test begins; here it has not seen the command yet.
    assert scheduler.run_until(lambda: device.adapter.state is ChannelState.OPEN, WAIT)
    return backend


def bridge_from_within(channel):
    """The near segment is the bridge itself, the far one a bus on its other side."""
    scheduler = RealtimeScheduler()
    where = {
        "near": {"channel": f"{channel} A", "bridge": {"channel": f"{channel} B"}},
        "far": {"channel": f"{channel} B"},
    }
    return Backend(
        scheduler,
        lambda name: LiveSegment.open(
            scheduler, interface="virtual", name=name, fd_bitrate=FD_BITRATE, **where[name]
        ),
        separate=True,
    )


def bridge_from_outside(channel):
    """Both segments are outside of the bridge, on its two sides."""
    scheduler = RealtimeScheduler()
    side = {"near": f"{channel} A", "far": f"{channel} B"}
    bridge = LiveSegment.open(
        scheduler,
        interface="virtual",
        name="bridge",
        channel=side["near"],
        bridge={"channel": side["far"]},
        fd_bitrate=FD_BITRATE,
    )
    return Backend(
        scheduler,
        lambda name: LiveSegment.open(
            scheduler, interface="virtual", channel=side[name], name=name, fd_bitrate=FD_BITRATE
        ),
        separate=True,
        between=(bridge,),
    )


def socketcan(_channel):
    interface = os.environ.get("HIL_VCAN")
    if not interface:
        pytest.skip("HIL_VCAN names no SocketCAN interface (hil vcan --count 2 -- pytest -m vcan)")
    return live("socketcan", interface)


@pytest.fixture(
    params=[
        pytest.param(virtual_medium, id="medium"),
        pytest.param(python_can_virtual, id="python-can-virtual"),
        pytest.param(udp_multicast, id="udp_multicast"),
        pytest.param(slcan, id="slcan"),
        pytest.param(bridge_from_within, id="bridge"),
        pytest.param(bridge_from_outside, id="through-a-bridge"),
        pytest.param(socketcan, id="socketcan", marks=pytest.mark.vcan),
    ]
)
def backend(request):
    backend = request.param(request.node.name)
    yield backend
    backend.close()


@pytest.fixture
def near(backend):
    return Node(backend.near, "near")


@pytest.fixture
def far(backend):
    return Node(backend.far, "far")


KINDS = [
    CanFrame(0x000),
    CanFrame(0x181, bytes(range(8))),
    CanFrame(0x7FF, b"\xff" * 8),
    CanFrame(0x602, b"\x40\x00\x10\x00\x00\x00\x00\x00"),
    CanFrame(0x701, remote=True, dlc=1),
    CanFrame(0x182, remote=True, dlc=8),
    CanFrame(0x000, b"ext", extended=True),
    CanFrame(0x1FFFFFFF, b"\x00\x01", extended=True),
    CanFrame(0x123, b"same id", extended=True),
    CanFrame(0x123, b"same id"),
]


def test_backend_is_a_segment(backend, near):
    """Every backend has the interface that devices are written against."""
    assert isinstance(backend.near, CanSegment)
    assert isinstance(near.port, CanPort)
    assert near.port.name == "near"
    assert near.port.online
    assert backend.near.scheduler is backend.scheduler


@pytest.mark.exhaustive
@pytest.mark.parametrize("frame", KINDS, ids=repr)
def test_frames_arrive_intact(near, far, frame):
    """Identifier, format, kind, length and data arrive as they were sent."""
    near.port.send(frame)
    far.expect(frame)


def test_frames_of_can_fd_arrive_intact(backend):
    """Frames of CAN FD pass between nodes that know them; a classic node beside them hears the classic ones
    alone.
    """
    if backend.near.data_bitrate is None:
        with pytest.raises(ConfigurationError, match="data_bitrate"):
            backend.near.attach("near", lambda _frame, _time_ns: None, fd=True)
        return
    classic = Node(backend.far, "classic")
    near, far = Node(backend.near, "near", fd=True), Node(backend.far, "far", fd=True)
    frames = [
        CanFrame(0x123, bytes(range(64)), fd=True, brs=True),
        CanFrame(0x123, b"classic"),
        CanFrame(0x1ABCDEF0, bytes(12), extended=True, fd=True),
        CanFrame(0x124, b"", fd=True, esi=True),
    ]
    for number, frame in enumerate(frames, 1):
        near.port.send(frame)
        assert backend.scheduler.run_until(lambda number=number: len(far.received) == number, WAIT)
    far.expect(*frames)
    classic.expect(frames[1])
    far.port.send(frames[0])
    near.expect(frames[0])


def test_own_frames_do_not_come_back(near, far):
    """A node never receives what it has sent itself."""
    near.port.send(CanFrame(0x100, b"own"))
    far.port.send(CanFrame(0x101, b"other"))
    near.expect(CanFrame(0x101, b"other"))
    far.expect(CanFrame(0x100, b"own"))


def test_order_of_a_sender_is_kept(near, far):
    """Frames of one identifier arrive in the order in which their sender gave them, none lost, none twice."""
    frames = [CanFrame(0x181, number.to_bytes(2, "little")) for number in range(100)]
    for frame in frames:
        near.port.send(frame)
    far.expect(*frames)


def test_two_nodes_of_one_segment_object_see_each_other(backend, near, far):
    """Nodes on the same segment object hear each other and the far side, each frame once."""
    second = Node(backend.near, "second")
    near.port.send(CanFrame(0x100))
    second.expect(CanFrame(0x100))
    far.expect(CanFrame(0x100))
    second.port.send(CanFrame(0x101))
    near.expect(CanFrame(0x101))
    far.expect(CanFrame(0x100), CanFrame(0x101))
    far.port.send(CanFrame(0x102))
    near.expect(CanFrame(0x101), CanFrame(0x102))
    second.expect(CanFrame(0x100), CanFrame(0x102))


@pytest.mark.exhaustive
def test_answers_from_the_receive_callback(backend, near):
    """A node may answer while it receives, and the answer arrives after the request."""
    far = backend.far.attach(
        "far", lambda frame, time_ns: far.send(CanFrame(frame.can_id - 0x80, frame.data))
    )
    near.port.send(CanFrame(0x601, b"request"))
    near.expect(CanFrame(0x581, b"request"))
    near.port.send(CanFrame(0x602, b"again"))
    near.expect(CanFrame(0x581, b"request"), CanFrame(0x582, b"again"))


def test_sending_returns_before_anybody_receives(near, far, backend):
    """Sending only hands the frame over: no receiver runs inside of the call."""
    second = Node(backend.near, "second")
    near.port.send(CanFrame(0x100))
    assert far.received == second.received == []
    far.expect(CanFrame(0x100))


def test_times_are_scheduler_time(near, far, backend):
    """The time of reception lies between sending and the present, on the clock of the scheduler, and never
    falls.
    """
    backend.scheduler.run_for(5 * MS)
    before = backend.scheduler.now
    for number in range(5):
        near.port.send(CanFrame(0x100 + number))
    far.expect(*(CanFrame(0x100 + number) for number in range(5)))
    times = [time_ns for time_ns, _ in far.received]
    assert times == sorted(times)
    assert before < times[0]
    assert times[-1] <= backend.scheduler.now


def test_detach_stops_delivery(backend, near, far):
    """A detached node receives nothing more, the others still do; its name can be used again."""
    second = Node(backend.near, "second")
    far.port.send(CanFrame(0x100))
    second.expect(CanFrame(0x100))
    second.port.detach()
    far.port.send(CanFrame(0x101))
    near.expect(CanFrame(0x100), CanFrame(0x101))
    assert second.frames == [CanFrame(0x100)]
    Node(backend.near, "second")


def test_sending_after_detach_is_an_error(backend, near, far):
    """A detached port refuses to send and says which port of which segment it was; detaching again is
    harmless.
    """
    near.port.detach()
    near.port.detach()
    with pytest.raises(BusError, match=f"port near is detached from {backend.near.name}"):
        near.port.send(CanFrame(0x100))


def test_offline_node_is_mute_and_deaf(backend, near, far):
    """An offline node sends nothing, hears nothing, and takes part again when it is back."""
    second = Node(backend.near, "second")
    near.port.online = False
    near.port.send(CanFrame(0x100))
    far.port.send(CanFrame(0x101))
    second.expect(CanFrame(0x101))
    assert near.frames == []
    near.port.online = True
    near.port.send(CanFrame(0x102))
    far.expect(CanFrame(0x102))
    far.port.send(CanFrame(0x103))
    near.expect(CanFrame(0x103))


@pytest.mark.parametrize(
    "frame", [CanFrame(0x800), CanFrame(1, bytes(9)), CanFrame(1, b"ab", dlc=3)], ids=repr
)
def test_what_is_no_frame_is_refused(near, far, frame):
    """A frame that cannot exist is an error for its sender and nothing for the others."""
    with pytest.raises(BusError):
        near.port.send(frame)
    near.port.send(CanFrame(0x100))
    far.expect(CanFrame(0x100))


def test_two_nodes_of_one_name_are_refused(backend, near):
    """A name stands for one node of a segment object."""
    with pytest.raises(BusError, match="'near' is already attached"):
        Node(backend.near, "near")


def test_log_holds_every_frame(backend, near, far):
    """The log has time, sender, frame and error of what was sent here and what came, in order."""
    near.port.send(CanFrame(0x100, b"a"))
    far.expect(CanFrame(0x100, b"a"))
    far.port.send(CanFrame(0x101, b"b"))
    near.expect(CanFrame(0x101, b"b"))
    entries = backend.near.log
    assert [(frame, error) for _, _, frame, error in entries] == [
        (CanFrame(0x100, b"a"), ""),
        (CanFrame(0x101, b"b"), ""),
    ]
    assert entries[0][1] == "near"
    side = backend.near.sides[-1].name if isinstance(backend.near, LiveSegment) else "far"
    assert entries[1][1] == side
    assert entries[1][0] == near.received[0][0]


def test_hooks_and_injection(backend, near, far):
    """The seams for faults are there: dropping, replacing, doubling, delaying, injecting, and the list of
    what is possible.
    """
    segment = backend.near
    assert {"drop", "delay", "replace", "duplicate"} <= segment.hook_kinds
    results = {
        0x100: HookResult.drop(),
        0x101: HookResult.replace(CanFrame(0x201)),
        0x102: HookResult.duplicate(),
        0x103: HookResult.delay(20 * MS),
    }
    remove = segment.add_hook(lambda frame, sender, time_ns: results.get(frame.can_id))
    for can_id in (0x100, 0x103, 0x101, 0x102):
        near.port.send(CanFrame(can_id))
    # The virtual bus arbitrates, a live one sends in the order of the calls: compare without the order.
    backend.scheduler.run_until(lambda: len(far.received) >= 4, WAIT)
    backend.scheduler.run_for(SETTLE)
    assert sorted(frame.can_id for frame in far.frames) == [0x102, 0x102, 0x103, 0x201]
    assert far.frames[-1].can_id == 0x103
    remove()
    segment.inject(CanFrame(0x055), sender="intruder")
    near.expect(CanFrame(0x055))
    assert backend.scheduler.run_until(lambda: far.frames[-1] == CanFrame(0x055), WAIT)
    assert segment.log[-1][1:] == ("intruder", CanFrame(0x055), "")
