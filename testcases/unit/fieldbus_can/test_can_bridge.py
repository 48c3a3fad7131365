"""Two live buses made one: what passes, what can be done to it on the way, and in which order."""

import threading
import time

import can
import pytest

from fieldbus.can import CanFrame, HookResult
from fieldbus.can.live import LiveSegment
from fieldbus.clock import MS, RealtimeScheduler, S
from fieldbus.errors import BusError, UnsupportedFaultError
from fieldbus.history import History

WAIT = 10 * S


class Bridge:
    """A bridge between the channels A and B, and a foreign node on either side."""

    def __init__(self, name):
        self.scheduler = RealtimeScheduler()
        self.scheduler.every(5 * MS, lambda: None)  # conditions are looked at after events
        self.history = History(self.scheduler)
        self.names = (f"{name} A", f"{name} B")
        self.segment = LiveSegment.open(
            self.scheduler,
            interface="virtual",
            channel=self.names[0],
            bridge={"channel": self.names[1]},
            name="bridge",
            history=self.history,
        )
        self.a, self.b = (can.Bus(interface="virtual", channel=channel) for channel in self.names)

    def heard(self, bus, count, *, pump=True):
        """Return `count` identifiers that a side hears, and make sure that no further one comes."""
        found = []
        end = time.monotonic() + 10.0
        while len(found) < count and time.monotonic() < end:
            if pump:
                self.scheduler.run_for(2 * MS)
            message = bus.recv(0.005)
            if message is not None:
                found.append(message.arbitration_id)
        if pump:
            self.scheduler.run_for(30 * MS)
        assert bus.recv(0.02) is None
        return found


@pytest.fixture
def bridge(request):
    bridge = Bridge(request.node.name)
    yield bridge
    bridge.segment.close()
    bridge.a.shutdown()
    bridge.b.shutdown()


def message(can_id, data=b""):
    return can.Message(arbitration_id=can_id, data=data, is_extended_id=False)


def test_frames_pass_in_both_directions(bridge):
    """What one side sends reaches the other once, does not come back, and is logged under the name of its
    side.
    """
    bridge.a.send(message(0x605))
    bridge.b.send(message(0x585))
    assert bridge.heard(bridge.b, 1) == [0x605]
    assert bridge.heard(bridge.a, 1) == [0x585]
    logged = {frame.can_id: sender for _, sender, frame, _ in bridge.segment.log}
    assert logged == {0x605: bridge.names[0], 0x585: bridge.names[1]}


def test_frames_pass_while_time_stands_still(bridge):
    """Without a fault nobody has to run the scheduler: controller and drive do not notice that the test is
    busy.
    """
    for number in range(50):
        bridge.a.send(message(0x100 + number))
    assert bridge.heard(bridge.b, 50, pump=False) == list(range(0x100, 0x132))
    bridge.scheduler.run_for(50 * MS)
    assert len(bridge.segment.log) == 50


def test_every_treatment_works_between_strangers(bridge):
    """Dropping, replacing, doubling and delaying hit frames whose sender and receiver are both elsewhere."""
    results = {
        0x100: HookResult.drop(),
        0x101: HookResult.replace(CanFrame(0x777, b"new")),
        0x102: HookResult.duplicate(2),
        0x103: HookResult.delay(60 * MS),
    }
    bridge.segment.add_hook(lambda frame, sender, time_ns: results.get(frame.can_id))
    for can_id in (0x103, 0x100, 0x101, 0x102, 0x104):
        bridge.a.send(message(can_id))
    assert bridge.heard(bridge.b, 6) == [0x777, 0x102, 0x102, 0x102, 0x104, 0x103]
    for can_id in (0x100, 0x104):
        bridge.b.send(message(can_id))
    assert bridge.heard(bridge.a, 1) == [0x104]


def test_a_hook_knows_the_side(bridge):
    """The sender of a frame is the channel from which it comes: one direction can be cut alone."""
    far = bridge.names[1]
    bridge.segment.add_hook(lambda frame, sender, time_ns: HookResult.drop() if sender == far else None)
    bridge.a.send(message(0x100))
    bridge.b.send(message(0x200))
    assert bridge.heard(bridge.b, 1) == [0x100]
    assert bridge.heard(bridge.a, 0) == []


@pytest.mark.exhaustive
def test_order_is_kept_when_a_fault_begins_and_ends(bridge):
    """Frames that wait for the scheduler are not overtaken by those that need it no longer."""
    remove = bridge.segment.add_hook(lambda frame, sender, time_ns: None)
    stop = threading.Event()

    def flood():
        for number in range(0x400):
            bridge.a.send(message(number))
            if number % 16 == 0:
                time.sleep(0.001)
        stop.set()

    sender = threading.Thread(target=flood)
    sender.start()
    heard = []
    end = time.monotonic() + 20.0
    while len(heard) < 0x400 and time.monotonic() < end:
        bridge.scheduler.run_for(MS)
        remove()
        remove = bridge.segment.add_hook(lambda frame, sender, time_ns: None)
        if stop.is_set():
            remove()
        while (received := bridge.b.recv(0)) is not None:
            heard.append(received.arbitration_id)
    sender.join()
    assert heard == list(range(0x400))


def test_local_nodes_and_injection_reach_both_sides(bridge):
    """A node in this process, and an injected frame, are heard on both sides; it hears both."""
    received = []
    port = bridge.segment.attach("local", lambda frame, time_ns: received.append(frame.can_id))
    port.send(CanFrame(0x010))
    bridge.segment.inject(CanFrame(0x020))
    assert bridge.heard(bridge.a, 2) == [0x010, 0x020]
    assert bridge.heard(bridge.b, 2) == [0x010, 0x020]
    bridge.a.send(message(0x030))
    bridge.b.send(message(0x040))
    assert bridge.scheduler.run_until(lambda: len(received) == 3, WAIT)
    assert sorted(received) == [0x020, 0x030, 0x040]


def test_the_sides_can_be_parted(bridge):
    """Parted, nothing passes, and local nodes stay with the first side; joined again, everything does."""
    received = []
    port = bridge.segment.attach("local", lambda frame, time_ns: received.append(frame.can_id))
    repair = bridge.segment.cut()
    with pytest.raises(BusError, match="bridge has no bridge that could be parted"):
        bridge.segment.cut()
    bridge.a.send(message(0x100))
    bridge.b.send(message(0x200))
    port.send(CanFrame(0x300))
    assert bridge.heard(bridge.a, 1) == [0x300]
    assert bridge.heard(bridge.b, 0) == []
    assert received == [0x100]
    repair()
    repair()
    bridge.a.send(message(0x101))
    bridge.b.send(message(0x201))
    assert bridge.heard(bridge.b, 1) == [0x101]
    assert bridge.heard(bridge.a, 1) == [0x201]


def test_bit_errors_are_refused(bridge):
    """The adapters make the bits: corruption stays impossible, with the reason."""
    bridge.segment.add_hook(lambda frame, sender, time_ns: HookResult.corrupt())
    bridge.a.send(message(0x100))
    with pytest.raises(UnsupportedFaultError, match="bridge is a live bus"):
        bridge.scheduler.run_for(WAIT)


def test_one_side_that_fails_is_reported_and_the_other_lives(bridge):
    """A side that takes nothing is DOWN under its name; the other one still takes what local nodes send."""
    port = bridge.segment.attach("local", lambda frame, time_ns: None)
    bridge.segment.sides[1].bus.shutdown()
    bridge.a.send(message(0x100))
    port.send(CanFrame(0x200))
    assert bridge.heard(bridge.a, 1) == [0x200]
    assert bridge.scheduler.run_until(lambda: bridge.segment.down, WAIT)
    events = [event.data for event in bridge.history.select(kind="can.status")]
    assert [(data["port"], data["status"]) for data in events] == [(bridge.names[1], "DOWN")]
    bridge.segment.sides[0].bus.shutdown()
    with pytest.raises(BusError):
        port.send(CanFrame(0x201))


def test_a_bridge_that_cannot_be_opened_leaves_nothing_open(request):
    """When the far side cannot be opened, the near one is closed again, and the message names the far one."""
    before = set(threading.enumerate())
    with pytest.raises(BusError, match="can0: nonsense far cannot be opened"):
        LiveSegment.open(
            RealtimeScheduler(),
            interface="virtual",
            channel=request.node.name,
            bridge={"interface": "nonsense", "channel": "far"},
        )
    assert set(threading.enumerate()) <= before
