"""The virtual segment between healthy nodes: times, order, delivery, presence, load."""

import gc
import itertools
import subprocess
import sys
import weakref

import pytest

from fieldbus.can import CanFrame, CanMedium, CanPort, CanSegment, find_segment, frame_bits
from fieldbus.clock import MS, US, RealtimeScheduler, VirtualScheduler
from fieldbus.errors import BusError, ConfigurationError
from fieldbus.history import History


class Node:
    """A port with a list of what it has received."""

    def __init__(self, medium, name, **options):
        self.received = []
        self.port = medium.attach(
            name, lambda frame, time_ns: self.received.append((time_ns, frame)), **options
        )
        self.send = self.port.send

    @property
    def frames(self):
        return [frame for _, frame in self.received]


@pytest.fixture
def scheduler():
    return VirtualScheduler()


@pytest.fixture
def history(scheduler):
    return History(scheduler)


@pytest.fixture
def medium(scheduler, history):
    return CanMedium(scheduler, history=history)


def wire(medium):
    return [(sender, frame.can_id) for _, sender, frame, _ in medium.log]


def test_medium_and_port_keep_the_protocols(medium):
    """The medium is a segment and its ports are ports, as the type checker and the bench understand them."""
    assert isinstance(medium, CanSegment)
    assert isinstance(medium.attach("a", lambda frame, time_ns: None), CanPort)


@pytest.mark.requirement("CANP-015", "CANP-077", "CANP-079")
@pytest.mark.parametrize("bitrate", [1_000_000, 500_000, 125_000, 83_333, 10_000])
def test_frame_takes_its_exact_time(scheduler, bitrate):
    """The others receive at the end of EOF, and the next frame ends one frame length after the
    intermission.
    """
    medium = CanMedium(scheduler, bitrate=bitrate)
    a, b = Node(medium, "a"), Node(medium, "b")
    first, second = CanFrame(0x181, b"\x00\x01\x02\x03"), CanFrame(0x182, bytes(8))
    scheduler.run_for(7 * US)
    a.send(first)
    a.send(second)
    scheduler.run_for(100 * MS)
    end_of_first = 7 * US + (frame_bits(first) - 3) * 1_000_000_000 // bitrate
    start_of_second = end_of_first + 3 * 1_000_000_000 // bitrate
    end_of_second = start_of_second + (frame_bits(second) - 3) * 1_000_000_000 // bitrate
    assert b.received == [(end_of_first, first), (end_of_second, second)]
    assert a.received == []
    assert medium.log == [(end_of_first, "a", first, ""), (end_of_second, "a", second, "")]


@pytest.mark.requirement("CANP-008", "CANP-027")
def test_sender_in_the_intermission_takes_part(scheduler, medium):
    """A frame that is queued during the intermission still beats a lower one that has waited all the time."""
    a, b = Node(medium, "a"), Node(medium, "b")
    first, waiting, late = CanFrame(0x100), CanFrame(0x300), CanFrame(0x200)
    a.send(first)
    a.send(waiting)
    end = (frame_bits(first) - 3) * US
    scheduler.at(end + 3 * US, lambda: b.send(late))
    scheduler.run_for(MS)
    assert wire(medium) == [("a", 0x100), ("b", 0x200), ("a", 0x300)]


@pytest.mark.requirement("CANP-027")
def test_sender_after_start_of_frame_waits(scheduler, medium):
    """A frame that is queued after the start of another waits for its end, however high it ranks."""
    a, b = Node(medium, "a"), Node(medium, "b")
    a.send(CanFrame(0x300, bytes(8)))
    scheduler.at(1, lambda: b.send(CanFrame(0x001)))
    scheduler.run_for(MS)
    assert wire(medium) == [("a", 0x300), ("b", 0x001)]


@pytest.mark.requirement("CANP-027", "CANP-079")
@pytest.mark.parametrize("hooked", [False, True])
def test_all_senders_of_an_instant_arbitrate(scheduler, medium, hooked):
    """On an idle bus the order of the calls within one instant does not matter, only the identifiers do."""
    if hooked:
        medium.add_hook(lambda frame, sender, time_ns: None)
    nodes = [Node(medium, f"n{number}") for number in range(4)]
    for at, order in ((MS, (3, 1, 2, 0)), (2 * MS, (0, 3, 2, 1))):
        for rank in order:
            scheduler.at(at, lambda rank=rank: nodes[rank].send(CanFrame(0x100 + rank)))
    scheduler.run_for(3 * MS)
    assert wire(medium) == [(f"n{rank}", 0x100 + rank) for rank in range(4)] * 2


@pytest.mark.requirement("CANP-031")
def test_port_offers_its_highest_frame_and_keeps_order_within_a_rank(scheduler, medium):
    """Within one node the highest-ranking frame goes first; frames of one identifier keep their order."""
    a, b = Node(medium, "a"), Node(medium, "b")
    a.send(CanFrame(0x50))
    scheduler.at(1, lambda: None)
    scheduler.run_for(1)
    for can_id, data in (
        (0x300, b"1"),
        (0x200, b"1"),
        (0x300, b"2"),
        (0x100, b"1"),
        (0x200, b"2"),
        (0x200, b"3"),
    ):
        a.send(CanFrame(can_id, data))
    scheduler.run_for(MS)
    assert [(frame.can_id, frame.data) for frame in b.frames[1:]] == [
        (0x100, b"1"),
        (0x200, b"1"),
        (0x200, b"2"),
        (0x200, b"3"),
        (0x300, b"1"),
        (0x300, b"2"),
    ]


def test_reply_in_the_receive_callback(scheduler, medium):
    """A node that answers at the end of a frame is on the wire after the intermission."""
    answer = CanFrame(0x581, bytes(8))
    b = None
    a = Node(medium, "a")
    b = medium.attach("b", lambda frame, time_ns: b.send(answer))
    request = CanFrame(0x601, bytes(8))
    a.send(request)
    scheduler.run_for(MS)
    assert a.received == [((frame_bits(request) + frame_bits(answer) - 3) * US, answer)]


class CountingScheduler(VirtualScheduler):
    """Counts the events that are entered."""

    def __init__(self):
        super().__init__()
        self.entered = 0

    def at(self, *arguments, **options):
        self.entered += 1
        return super().at(*arguments, **options)

    def again(self, *arguments):
        self.entered += 1
        super().again(*arguments)


def test_event_per_frame():
    """A saturated segment costs the scheduler one event per frame."""
    scheduler = CountingScheduler()
    medium = CanMedium(scheduler)
    a, b = Node(medium, "a"), Node(medium, "b")
    for number in range(100):
        a.send(CanFrame(0x100 + number, bytes(8)))
    scheduler.run_for(100 * MS)
    assert len(b.received) == 100
    assert scheduler.entered == 100


def test_remote_frame_and_dlc_arrive_as_sent(scheduler, medium):
    """Remote frames keep their DLC, data frames a DLC above 8 (CANP-010)."""
    a, b = Node(medium, "a"), Node(medium, "b")
    sent = [
        CanFrame(0x181, remote=True, dlc=5),
        CanFrame(0x182, bytes(8), dlc=12),
        CanFrame(0x12345678, b"x", extended=True),
    ]
    for frame in sent:
        a.send(frame)
        scheduler.run_for(MS)
    assert b.frames == sent


def test_confirmation_of_own_frames(scheduler, medium):
    """A port that asks for it hears of its own frames when they are sent, and only of those."""
    confirmed = []
    a = Node(medium, "a", confirm=lambda frame, time_ns: confirmed.append((time_ns, frame)))
    b = Node(medium, "b")
    a.send(CanFrame(0x100))
    b.send(CanFrame(0x200))
    scheduler.run_for(MS)
    assert confirmed == [((frame_bits(CanFrame(0x100)) - 3) * US, CanFrame(0x100))]
    assert a.frames == [CanFrame(0x200)]


# ------------------------------------------------------------------------------------------------- presence


def test_offline_node_neither_sends_nor_receives(scheduler, medium):
    """Offline means deaf and mute; frames queued before or meanwhile never go out."""
    a, b, c = Node(medium, "a"), Node(medium, "b"), Node(medium, "c")
    a.send(CanFrame(0x10))
    a.send(CanFrame(0x300))
    b.send(CanFrame(0x20))
    scheduler.run_for(1)
    a.port.online = False
    a.send(CanFrame(0x301))
    scheduler.run_for(MS)
    assert a.received == []
    assert CanFrame(0x20) in c.frames
    a.port.online = True
    b.send(CanFrame(0x21))
    scheduler.run_for(MS)
    assert a.frames == [CanFrame(0x21)]
    assert {0x300, 0x301}.isdisjoint(can_id for _, can_id in wire(medium))


def test_node_that_appears_in_the_middle_of_a_frame_misses_it(scheduler, medium):
    """Who comes online, or is attached, during a frame receives from the next one on."""
    a, b = Node(medium, "a"), Node(medium, "b")
    b.port.online = False
    Node(medium, "c")
    a.send(CanFrame(0x100, bytes(8)))
    a.send(CanFrame(0x101, bytes(8)))
    scheduler.run_for(50 * US)
    b.port.online = True
    late = Node(medium, "late")
    scheduler.run_for(MS)
    assert b.frames == [CanFrame(0x101, bytes(8))]
    assert late.frames == [CanFrame(0x101, bytes(8))]


def test_detach_stops_delivery_and_sending(scheduler, medium):
    """After detach nothing arrives, sending is an error, and the name is free again."""
    a, b = Node(medium, "a"), Node(medium, "b")
    Node(medium, "c")
    b.port.detach()
    b.port.detach()
    a.send(CanFrame(0x100))
    scheduler.run_for(MS)
    assert b.received == []
    with pytest.raises(BusError, match="port b is detached from can0"):
        b.send(CanFrame(0x100))
    with pytest.raises(BusError, match="port b is detached from can0"):
        b.port.online = True
    assert [port.name for port in medium.ports] == ["a", "c"]
    Node(medium, "b")


def test_detach_within_a_delivery(scheduler, medium):
    """A node that is detached by an earlier receiver of the same frame does not get it."""
    a = Node(medium, "a")
    medium.attach("b", lambda frame, time_ns: c.port.detach())
    c = Node(medium, "c")
    a.send(CanFrame(0x100))
    scheduler.run_for(MS)
    assert c.received == []


def test_names_are_unique(medium):
    """Two nodes of one name would be indistinguishable in every log."""
    Node(medium, "a")
    with pytest.raises(BusError, match="a port named 'a' is already attached to can0"):
        Node(medium, "a")


def test_listening_port_hears_but_does_not_acknowledge_or_send(scheduler, medium):
    """A listen-only port receives frames that somebody else acknowledged, and cannot send."""
    a, monitor = Node(medium, "a"), Node(medium, "monitor", listen_only=True)
    a.send(CanFrame(0x100))
    scheduler.run_for(200 * US)
    assert monitor.received == []
    assert medium.log[0][3] == "ACK_ERROR"
    Node(medium, "b")
    scheduler.run_for(MS)
    assert monitor.frames == [CanFrame(0x100)]
    with pytest.raises(BusError, match="monitor on can0 listens only"):
        monitor.send(CanFrame(0x100))


@pytest.mark.requirement("CANP-031")
def test_full_transmit_queue_refuses_the_newest(scheduler, medium, history):
    """A frame that finds the queue full is lost, counted, and reported once."""
    a, b = Node(medium, "a", tx_buffers=2), Node(medium, "b")
    for number in range(6):
        a.send(CanFrame(0x100 + number))
    scheduler.run_for(MS)
    assert [frame.can_id for frame in b.frames] == [0x100, 0x101, 0x102]  # one on the wire, two queued
    assert a.port.overruns == 3
    events = list(history.select(kind="can.overrun"))
    assert [event.data["port"] for event in events] == ["a"]
    with pytest.raises(ConfigurationError, match="at least 1"):
        medium.attach("c", lambda frame, time_ns: None, tx_buffers=0)


def test_flush_forgets_the_queue(scheduler, medium):
    """Flushed frames never go out; the one that is on the wire completes."""
    a, b = Node(medium, "a"), Node(medium, "b")
    for number in range(3):
        a.send(CanFrame(0x100 + number))
    assert a.port.pending == 2
    scheduler.run_for(1)
    a.port.flush()
    scheduler.run_for(MS)
    assert [frame.can_id for frame in b.frames] == [0x100]
    a.send(CanFrame(0x200))
    a.port.flush()
    scheduler.run_for(MS)
    assert len(b.frames) == 1


def test_bad_frames_are_refused_at_the_sender(medium):
    """A frame that is none raises where it is sent, and leaves the segment as it was."""
    a = Node(medium, "a")
    with pytest.raises(BusError, match=r"outside 0\.\.7FFh"):
        a.send(CanFrame(0x800))
    with pytest.raises(BusError, match="must be bytes, not bytearray"):
        a.send(CanFrame(0x100, bytearray(2)))
    assert a.port.pending == 0


def test_failing_receiver_leaves_the_segment_intact(scheduler, medium):
    """An exception in a receive callback reaches the caller of the scheduler; the traffic can go on after
    it.
    """
    a = Node(medium, "a")

    def fail(frame, time_ns):
        raise ZeroDivisionError

    medium.attach("bad", fail)
    good = Node(medium, "good")
    a.send(CanFrame(0x100))
    a.send(CanFrame(0x101))
    for _ in range(2):
        with pytest.raises(ZeroDivisionError):
            scheduler.run_for(MS)
    assert wire(medium) == [("a", 0x100), ("a", 0x101)]
    assert good.received == []


# ------------------------------------------------------------------------------------------- load, log, names


@pytest.mark.requirement("CANP-079")
def test_sync_waits_for_the_frame_in_progress(scheduler, medium):
    """On a bus full of low-ranking frames a SYNC is late by the rest of one frame, and by every part of
    it.
    """
    a, b = Node(medium, "a"), Node(medium, "b")
    background = CanFrame(0x7F0, bytes(8))
    length = frame_bits(background)
    b.port.tx_buffers = 10_000
    for _ in range(2_000):
        b.send(background)
    sync = CanFrame(0x80)
    sent = []
    for number in range(200):
        scheduler.at(number * 1009 * US + 500, lambda: (sent.append(scheduler.now), a.send(sync)))
    scheduler.run_for(210 * MS)
    delays = [
        (time_ns - (frame_bits(sync) - 3) * US - queued) / US
        for queued, (time_ns, frame) in zip(sent, b.received, strict=True)
    ]
    assert 0 <= min(delays) < 5
    assert length - 5 < max(delays) <= length
    assert length * 0.4 < sum(delays) / len(delays) < length * 0.6


@pytest.mark.requirement("CANP-069")
def test_bus_load(scheduler, medium):
    """The load is the share of bit times that frames with their intermission take, in all and in a window."""
    a, _ = Node(medium, "a"), Node(medium, "b")
    assert medium.bus_load() == 0.0
    frames = [CanFrame(0x80), CanFrame(0x201, bytes(8))]
    bits = sum(map(frame_bits, frames))
    for number in range(4):
        scheduler.run_for(number * MS - scheduler.now)
        for frame in frames:
            a.send(frame)
    scheduler.run_for(7 * MS)
    assert medium.bus_load() == pytest.approx(4 * bits / 10_000)
    assert medium.bus_load(7 * MS) == pytest.approx(bits / 7_000)
    assert medium.bus_load(100 * MS) == pytest.approx(4 * bits / 10_000)
    assert medium.bus_load(6 * MS) == 0.0
    # A window that begins in the middle of a frame counts the rest of it.
    assert medium.bus_load(7 * MS - 10 * US) == pytest.approx((bits - 10) / 6_990)
    with pytest.raises(BusError, match="not positive"):
        medium.bus_load(0)


@pytest.mark.requirement("CANP-069")
def test_bus_load_of_the_guide_example(scheduler, medium):
    """Four drives with two 8-byte PDOs and a SYNC every 2 ms stay below the 56.8 % of the worst case."""
    nodes = [Node(medium, f"n{number}") for number in range(5)]

    def cycle():
        nodes[0].send(CanFrame(0x80))
        for number in range(1, 5):
            nodes[0].send(CanFrame(0x200 + number, bytes(8)))
            nodes[number].send(CanFrame(0x180 + number, bytes(8)))

    scheduler.every(2 * MS, cycle)
    scheduler.run_for(200 * MS - 1)
    frames = [CanFrame(0x80), *(CanFrame(base + n, bytes(8)) for base in (0x180, 0x200) for n in range(1, 5))]
    assert medium.bus_load() == pytest.approx(sum(map(frame_bits, frames)) / 2000, rel=1e-6)
    assert medium.bus_load() < 0.568


def test_without_log(scheduler):
    """A medium that keeps no log still delivers and knows its total load, and says why it knows no window."""
    medium = CanMedium(scheduler, keep_log=False)
    a, b = Node(medium, "a"), Node(medium, "b")
    a.send(CanFrame(0x100))
    scheduler.run_for(MS)
    assert medium.log == []
    assert len(b.received) == 1
    assert medium.bus_load() > 0.04
    with pytest.raises(BusError, match="needs the log"):
        medium.bus_load(MS)


def test_good_frames_leave_the_history_alone(scheduler, medium, history):
    """The event log is for what is unusual; frames are in the log of the medium."""
    a, _ = Node(medium, "a"), Node(medium, "b")
    a.send(CanFrame(0x100))
    scheduler.run_for(MS)
    assert history.events == []


@pytest.mark.parametrize("bitrate", [0, 999, 1_000_001, 1e6])
def test_bit_rate_is_checked(scheduler, bitrate):
    """The bit rate is a whole number within the limits of classical CAN."""
    with pytest.raises(ConfigurationError, match="bitrate"):
        CanMedium(scheduler, bitrate=bitrate)


@pytest.mark.exhaustive
def test_segment_is_found_by_name_as_long_as_it_lives(scheduler):
    """The registry knows the latest segment of a name and does not keep it alive."""
    medium = CanMedium(scheduler, name="press")
    assert find_segment("press") is medium
    later = CanMedium(scheduler, name="press")
    assert find_segment("press") is later
    reference = weakref.ref(later)
    del later
    gc.collect()
    assert reference() is None
    with pytest.raises(BusError, match="no CAN segment is registered as 'press'"):
        find_segment("press")


def test_realtime_scheduler_carries_a_medium(scheduler):
    """On the wall clock frames keep their order and their distance on the bus."""
    scheduler = RealtimeScheduler()
    medium = CanMedium(scheduler, bitrate=100_000)
    a, b = Node(medium, "a"), Node(medium, "b")
    for number in range(5):
        a.send(CanFrame(0x100 + number, bytes(8)))
    assert scheduler.run_until(lambda: len(b.received) == 5, 10_000 * MS)
    times = [time_ns for time_ns, _ in b.received]
    lengths = [frame_bits(CanFrame(0x100 + number, bytes(8))) * 10 * US for number in range(1, 5)]
    assert [later - earlier for earlier, later in itertools.pairwise(times)] == lengths


@pytest.mark.exhaustive
def test_python_can_is_not_imported():
    """The virtual segment is usable without loading python-can, which would cost its import time."""
    code = "import sys, fieldbus.can, fieldbus.can.medium; sys.exit('can' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0
