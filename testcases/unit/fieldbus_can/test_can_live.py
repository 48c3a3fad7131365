"""A python-can bus as a segment in real time, here the `virtual` bus of python-can and buses that fail."""

import threading
import time

import can
import pytest

from fieldbus.can import CanFrame, HookResult, find_segment
from fieldbus.can.live import LiveSegment
from fieldbus.clock import MS, RealtimeScheduler, S, VirtualScheduler
from fieldbus.errors import BusError, ConfigurationError, UnsupportedFaultError
from fieldbus.history import History

WAIT = 10 * S


class Bench:
    """A live segment, a local node `a`, and a foreign python-can bus on the same channel."""

    def __init__(self, channel):
        self.scheduler = RealtimeScheduler()
        self.history = History(self.scheduler)
        self.segment = LiveSegment.open(
            self.scheduler, interface="virtual", channel=channel, name="live0", history=self.history
        )
        self.foreign = can.Bus(interface="virtual", channel=channel)
        self.received = []
        self.port = self.attach("a")

    def attach(self, name, **options):
        return self.segment.attach(
            name, lambda frame, time_ns: self.received.append((name, frame, time_ns)), **options
        )

    def until(self, count):
        """Wait until `count` frames have been received, and a little longer for one too many."""
        assert self.scheduler.run_until(lambda: len(self.received) >= count, WAIT)
        self.scheduler.run_for(20 * MS)
        assert len(self.received) == count

    def quiet(self):
        self.scheduler.run_for(100 * MS)


@pytest.fixture
def bench(request):
    bench = Bench(request.node.name)
    yield bench
    bench.segment.close()
    bench.foreign.shutdown()


def message(can_id, data=b"", **options):
    return can.Message(arbitration_id=can_id, data=data, is_extended_id=False, **options)


def test_frames_from_outside(bench):
    """What a foreign node sends arrives with the time of its arrival, and is in the log as sent by the
    bus.
    """
    before = time.monotonic_ns() - bench.scheduler.origin_ns
    bench.foreign.send(message(0x181, b"123"))
    bench.until(1)
    after = time.monotonic_ns() - bench.scheduler.origin_ns
    [(name, frame, time_ns)] = bench.received
    assert (name, frame) == ("a", CanFrame(0x181, b"123"))
    assert before <= time_ns <= after
    assert bench.segment.log == [(time_ns, "bus", frame, "")]


def test_frames_to_outside(bench):
    """What a local node sends reaches the foreign one, and is in the log under the node's name."""
    frame = CanFrame(0x12345678, b"xyz", extended=True)
    bench.port.send(frame)
    received = bench.foreign.recv(10.0)
    assert (received.arbitration_id, bytes(received.data), received.is_extended_id) == (
        0x12345678,
        b"xyz",
        True,
    )
    assert [(sender, logged) for _, sender, logged, _ in bench.segment.log] == [("a", frame)]
    bench.quiet()
    assert bench.received == []


def test_local_nodes_see_each_other(bench):
    """A frame of one local node goes to the others as well, later than the call, never to itself."""
    other = bench.attach("b")
    bench.port.send(CanFrame(0x10))
    assert bench.received == []
    bench.until(1)
    other.send(CanFrame(0x20))
    bench.until(2)
    assert [(name, frame.can_id) for name, frame, _ in bench.received] == [("b", 0x10), ("a", 0x20)]


def test_times_never_go_back(bench):
    """The log is in order of time although sending and receiving are stamped in different threads."""
    for number in range(50):
        bench.foreign.send(message(0x100 + number))
        bench.port.send(CanFrame(0x200 + number))
    bench.until(50)
    times = [time_ns for time_ns, *_ in bench.segment.log]
    assert len(times) == 100
    assert times == sorted(times)


def test_confirmation(bench):
    """A node that asks for it hears when the bus has taken its frame."""
    confirmed = []
    port = bench.segment.attach(
        "b", lambda frame, time_ns: None, confirm=lambda frame, time_ns: confirmed.append(frame)
    )
    port.send(CanFrame(0x10))
    bench.until(1)
    assert confirmed == [CanFrame(0x10)]


def test_offline_listening_and_detached_nodes(bench):
    """Offline nodes neither send nor receive; listeners must not send; detached ones are gone."""
    bench.port.online = False
    bench.port.send(CanFrame(0x10))
    bench.foreign.send(message(0x100))
    bench.quiet()
    assert bench.received == []
    assert bench.foreign.recv(0.1) is None
    bench.port.online = True
    listener = bench.attach("listener", listen_only=True)
    with pytest.raises(BusError, match="listener on live0 listens only"):
        listener.send(CanFrame(0x10))
    listener.detach()
    listener.detach()
    with pytest.raises(BusError, match="port listener is detached from live0"):
        listener.send(CanFrame(0x10))
    with pytest.raises(BusError, match="'a' is already attached to live0"):
        bench.attach("a")
    bench.foreign.send(message(0x101))
    bench.until(1)
    assert bench.received[0][:2] == ("a", CanFrame(0x101))


def test_hooks_on_received_frames(bench):
    """Frames from the bus can be dropped, replaced, doubled and delayed on their way to the local nodes."""
    results = {
        0x100: HookResult.drop(),
        0x101: HookResult.replace(CanFrame(0x777)),
        0x102: HookResult.duplicate(2),
        0x103: HookResult.delay(50 * MS),
    }
    asked = []

    def hook(frame, sender, time_ns):
        asked.append((frame.can_id, sender))
        return results.get(frame.can_id)

    remove = bench.segment.add_hook(hook)
    for can_id in (0x103, 0x100, 0x101, 0x102):
        bench.foreign.send(message(can_id))
    bench.until(5)
    assert [frame.can_id for _, frame, _ in bench.received] == [0x777, 0x102, 0x102, 0x102, 0x103]
    assert asked == [(0x103, "bus"), (0x100, "bus"), (0x101, "bus"), (0x102, "bus")]
    remove()
    remove()
    bench.foreign.send(message(0x100))
    bench.until(6)


def test_hooks_on_sent_frames(bench):
    """Frames of local nodes can be dropped, replaced, doubled and delayed on their way to the bus."""
    results = {
        0x100: HookResult.drop(),
        0x101: HookResult.replace(CanFrame(0x777)),
        0x102: HookResult.duplicate(),
        0x103: HookResult.delay(50 * MS),
    }
    bench.segment.add_hook(
        lambda frame, sender, time_ns: results.get(frame.can_id) if sender == "a" else None
    )
    for can_id in (0x103, 0x100, 0x101, 0x102):
        bench.port.send(CanFrame(can_id))
    bench.scheduler.run_for(100 * MS)
    assert [bench.foreign.recv(1.0).arbitration_id for _ in range(4)] == [0x777, 0x102, 0x102, 0x103]
    assert bench.foreign.recv(0.05) is None


def test_corruption_is_refused(bench):
    """Hardware makes the bits: a hook that wants them wrong is refused, and the capability set says it
    before.
    """
    assert "corrupt" not in bench.segment.hook_kinds
    bench.segment.add_hook(lambda frame, sender, time_ns: HookResult.corrupt())
    with pytest.raises(UnsupportedFaultError, match="live0 is a live bus"):
        bench.port.send(CanFrame(0x100))
    bench.foreign.send(message(0x100))
    with pytest.raises(UnsupportedFaultError, match="live0 is a live bus"):
        bench.scheduler.run_for(WAIT)


def test_injection(bench):
    """An injected frame passes the hooks by and reaches the bus and all local nodes."""
    bench.segment.add_hook(lambda frame, sender, time_ns: HookResult.drop())
    bench.segment.inject(CanFrame(0x55), sender="intruder")
    bench.until(1)
    assert bench.received[0][:2] == ("a", CanFrame(0x55))
    assert bench.foreign.recv(1.0).arbitration_id == 0x55
    assert bench.segment.log[0][1] == "intruder"


def test_error_frames_become_events(bench):
    """Error frames of the adapter are reported in the history and marked in the log, and disturb nobody."""
    bench.foreign.send(
        can.Message(is_error_frame=True, arbitration_id=0x088, data=bytes([0, 0, 4, 0, 0, 0, 0, 0]))
    )
    bench.foreign.send(can.Message(is_error_frame=True, arbitration_id=0x040, data=bytes(8)))
    bench.foreign.send(can.Message(is_error_frame=True))
    bench.foreign.send(message(0x100))
    bench.until(1)
    assert [
        (event.kind, event.data.get("code") or event.data.get("status")) for event in bench.history.events
    ] == [
        ("can.bus_error", "BIT_STUFFING_ERROR"),
        ("can.status", "BUS_OFF"),
        ("can.bus_error", "UNKNOWN"),
    ]
    assert [error for *_, error in bench.segment.log] == ["BIT_STUFFING_ERROR", "UNKNOWN", ""]


def test_fd_messages_are_counted_and_reported_once(bench):
    """CAN FD messages are not passed on but counted; the first one is an event that says what they are."""
    for _ in range(5):
        bench.foreign.send(can.Message(arbitration_id=0x100, data=bytes(64), is_fd=True))
    bench.foreign.send(message(0x101))
    bench.until(1)
    assert bench.received[0][1].can_id == 0x101
    [event] = bench.history.events
    assert (event.kind, event.data["can_id"]) == ("can.ignored", 0x100)
    assert event.data["reason"].startswith("CAN FD messages are not supported")
    assert bench.segment.ignored == {"fd": 5, "garbled": 0}
    assert not bench.segment.down


def test_echo_of_own_frames_is_taken_out():
    """On a bus that gives own frames back they are recognised, once each; equal frames of others are not
    lost.
    """
    scheduler = RealtimeScheduler()
    foreign = can.Bus(interface="virtual", channel="echo")
    received = []
    with LiveSegment.open(
        scheduler, interface="virtual", channel="echo", receive_own_messages=True
    ) as segment:
        port = segment.attach("a", lambda frame, time_ns: received.append(frame))
        port.send(CanFrame(0x100, b"same"))
        port.send(CanFrame(0x100, b"same"))
        foreign.send(message(0x100, b"same"))
        foreign.send(message(0x101))
        assert scheduler.run_until(lambda: CanFrame(0x101) in received, WAIT)
        assert received == [CanFrame(0x100, b"same"), CanFrame(0x101)]
    foreign.shutdown()


def test_frames_of_other_programs_on_this_machine_count(bench):
    """SocketCAN marks what another program of the same machine sends as not received; it is taken all the
    same.
    """
    local = message(0x100)
    local.is_rx = False
    bench.segment.sides[0].bus.queue.put(local)
    bench.until(1)
    assert bench.received[0][1] == CanFrame(0x100)


class FailingBus(can.BusABC):
    """A bus whose cable can be pulled; `complaints` says how often it tells so while it receives."""

    def __init__(self, complaints=10**9):
        self.broken = threading.Event()
        self.complaints = complaints
        self.left = 0
        self.frames = []
        super().__init__(channel="failing")

    def pull(self):
        self.left = self.complaints
        self.broken.set()

    def send(self, msg, timeout=None):
        if self.broken.is_set():
            raise can.CanOperationError("Network is down", 100)

    def _recv_internal(self, timeout):
        if self.broken.is_set() and self.left:
            self.left -= 1
            raise can.CanOperationError("Network is down", 100)
        if self.frames:
            return self.frames.pop(0), True
        time.sleep(min(timeout, 0.01))
        return None, True


def watched(bus):
    """Return a scheduler, a segment on `bus`, and a function that gives the states it has reported."""
    scheduler = RealtimeScheduler()
    history = History(scheduler)
    segment = LiveSegment(scheduler, bus, name="live0", history=history)
    return scheduler, segment, lambda: [event.data["status"] for event in history.select(kind="can.status")]


def test_bus_that_goes_down_and_comes_back():
    """A failing bus is one event down and one up, and makes every send an error that says why."""
    bus = FailingBus()
    scheduler, segment, reported = watched(bus)
    with segment:
        port = segment.attach("a", lambda frame, time_ns: None)
        port.send(CanFrame(0x100))
        bus.pull()
        assert scheduler.run_until(lambda: segment.down, WAIT)
        for _ in range(3):
            with pytest.raises(BusError, match=r"live0: <CanFrame 100#> cannot be sent: Network is down"):
                port.send(CanFrame(0x100))
        scheduler.every(10 * MS, lambda: None)  # conditions are looked at after events
        assert scheduler.run_until(lambda: bus.complaints - bus.left > 2, WAIT)
        bus.broken.clear()
        assert scheduler.run_until(lambda: not segment.down, WAIT)
        port.send(CanFrame(0x100))
        assert reported() == ["DOWN", "UP"]
        assert len(segment.log) == 2


@pytest.mark.parametrize("proof", ["sent", "received"])
def test_silence_does_not_mean_that_the_bus_is_back(proof):
    """A driver that complains once and is silent then is taken for down until a frame goes through."""
    bus = FailingBus(complaints=1)
    scheduler, segment, reported = watched(bus)
    with segment:
        port = segment.attach("a", lambda frame, time_ns: None)
        bus.pull()
        assert scheduler.run_until(lambda: segment.down, WAIT)
        for _ in range(3):
            scheduler.run_for(150 * MS)
            with pytest.raises(BusError):
                port.send(CanFrame(0x100))
        assert reported() == ["DOWN"]
        bus.broken.clear()
        if proof == "sent":
            port.send(CanFrame(0x100))
        else:
            bus.frames.append(message(0x100))
        assert scheduler.run_until(lambda: not segment.down, WAIT)
        assert reported() == ["DOWN", "UP"]


def test_a_send_that_fails_alone_is_down_until_one_succeeds():
    """A full transmit queue is a bus that takes no frames: silence on the receiving side does not end it."""
    bus = FailingBus(complaints=0)
    scheduler, segment, reported = watched(bus)
    with segment:
        port = segment.attach("a", lambda frame, time_ns: None)
        bus.pull()
        with pytest.raises(BusError):
            port.send(CanFrame(0x100))
        bus.frames.append(message(0x100))
        scheduler.run_for(300 * MS)
        assert reported() == ["DOWN"]
        bus.broken.clear()
        port.send(CanFrame(0x100))
        assert reported() == ["DOWN", "UP"]


class GarbledBus(FailingBus):
    """A bus whose driver chokes on what comes, as python-can's driver for serial adapters does."""

    def __init__(self, error):
        super().__init__()
        self.error = error
        self.rubbish = 3
        self.flushed = 0

    def flush(self):
        self.flushed += 1

    def _recv_internal(self, timeout):
        if self.rubbish:
            self.rubbish -= 1
            raise self.error
        return super()._recv_internal(timeout)


@pytest.mark.parametrize(
    ("error", "flushed"),
    [
        (ValueError("invalid literal"), 0),
        (IndexError("string index out of range"), 0),
        (UnicodeDecodeError("utf-8", b"\xff", 0, 1, "bad"), 3),
    ],
)
def test_what_the_driver_cannot_read_is_counted(error, flushed):
    """Rubbish on the line of an adapter is no failure of the bus: it is counted, reported once, and the next
    frame arrives.
    """
    bus = GarbledBus(error)
    bus.frames.append(message(0x123))
    scheduler = RealtimeScheduler()
    history = History(scheduler)
    received = []
    with LiveSegment(scheduler, bus, name="live0", history=history) as segment:
        segment.attach("a", lambda frame, time_ns: received.append(frame))
        assert scheduler.run_until(lambda: received, WAIT)
        assert received == [CanFrame(0x123)]
        assert segment.ignored == {"fd": 0, "garbled": 3}
        [event] = history.events
        assert event.kind == "can.ignored"
        assert str(error) in event.data["reason"]
        assert bus.flushed == flushed
        assert not segment.down


def test_a_driver_that_reads_nothing_any_more_is_down():
    """Rubbish without end is a bus that fails: the reader does not spin on it."""
    bus = GarbledBus(ValueError("file descriptor cannot be a negative integer"))
    bus.rubbish = 10**9
    scheduler, segment, reported = watched(bus)
    with segment:
        assert scheduler.run_until(lambda: segment.down, WAIT)
        spent = 10**9 - bus.rubbish
        scheduler.run_for(300 * MS)
        assert 10**9 - bus.rubbish - spent < 10
        assert reported() == ["DOWN"]


def test_close_ends_thread_and_bus(bench):
    """After close no thread is left, nothing arrives, and sending says that the segment is closed."""
    bench.segment.close()
    bench.segment.close()
    assert not any(thread.name == "reader of bus" for thread in threading.enumerate())
    bench.foreign.send(message(0x100))
    bench.quiet()
    assert bench.received == []
    with pytest.raises(BusError, match="live0 is closed"):
        bench.port.send(CanFrame(0x100))


def test_bus_of_somebody_else_stays_open():
    """A bus that the caller keeps is not shut down with the segment."""
    bus = can.Bus(interface="virtual", channel="kept")
    with LiveSegment(RealtimeScheduler(), bus, close_bus=False):
        pass
    bus.send(message(0x100))
    bus.shutdown()


def test_what_cannot_be_opened_says_why():
    """A virtual scheduler, an unknown interface and a missing device are refused with the reason."""
    with pytest.raises(ConfigurationError, match="RealtimeScheduler"):
        LiveSegment.open(VirtualScheduler(), interface="virtual", channel="x")
    with pytest.raises(BusError, match="can0: carrier_pigeon x cannot be opened"):
        LiveSegment.open(RealtimeScheduler(), interface="carrier_pigeon", channel="x")
    with pytest.raises(BusError, match="can0: socketcan no_such_interface cannot be opened"):
        LiveSegment.open(RealtimeScheduler(), interface="socketcan", channel="no_such_interface")


def test_segment_is_registered(bench):
    """A python-can program of the same process finds the live segment by name and talks on it."""
    assert find_segment("live0") is bench.segment
    with can.Bus(interface="hil", channel="live0", receive_own_messages=True) as bus:
        bus.send(message(0x100))
        own = bus.recv(10.0)
        assert (own.arbitration_id, own.is_rx) == (0x100, False)
        assert bench.foreign.recv(1.0).arbitration_id == 0x100
        bench.foreign.send(message(0x200))
        assert bus.recv(10.0).arbitration_id == 0x200
        assert bus.state is can.BusState.ACTIVE
        with pytest.raises(can.CanInitializationError, match="does not report errors"):
            can.Bus(interface="hil", channel="live0", error_frames=True)
    assert [port.name for port in bench.segment.ports] == ["a"]
