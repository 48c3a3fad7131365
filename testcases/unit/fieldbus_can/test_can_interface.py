"""python-can programs on a segment: `can.Bus(interface="hil")`."""

import gc
import math
import threading
import time
from types import SimpleNamespace

import can
import pytest

from fieldbus.can import BitError, CanFrame, CanMedium, HookResult, NodeState, frame_bits, register_segment
from fieldbus.can.interface import HilBus
from fieldbus.clock import MS, US, RealtimeScheduler, S, VirtualScheduler


@pytest.fixture
def scheduler():
    return VirtualScheduler()


@pytest.fixture
def medium(scheduler):
    return CanMedium(scheduler, name="hil-test")


@pytest.fixture
def node(medium):
    """A plain node that keeps what it receives in `node.frames`."""
    node = SimpleNamespace(frames=[])
    node.port = medium.attach("node", lambda frame, time_ns: node.frames.append(frame))
    return node


@pytest.fixture
def bus(medium, node):
    with can.Bus(interface="hil", channel=medium) as bus:
        yield bus


def message(can_id=0x100, data=b"abc", **options):
    return can.Message(arbitration_id=can_id, data=data, is_extended_id=False, **options)


def test_entry_point_leads_to_the_class(medium):
    """`can.Bus` finds the interface by its name, and the segment by object or by name."""
    by_object = can.Bus(interface="hil", channel=medium)
    by_name = can.Bus(interface="hil", channel="hil-test")
    register_segment(medium, "2")
    by_number = can.Bus(interface="hil", channel="2")
    for bus in (by_object, by_name, by_number):
        assert isinstance(bus, HilBus)
        assert bus.segment is medium
    assert [port.name for port in medium.ports] == ["python-can", "python-can 2", "python-can 3"]
    for bus in (by_object, by_name, by_number):
        bus.shutdown()
    assert medium.ports == ()


@pytest.mark.parametrize(
    ("options", "text"),
    [
        ({"channel": "nowhere"}, "no CAN segment is registered as 'nowhere'"),
        ({"channel": object()}, "neither a segment nor the name of one"),
        ({"channel": "hil-test", "bitrate": 500_000}, "runs at 1000000 bit/s, not at 500000 bit/s"),
        ({"channel": "hil-test", "fd": True}, "CAN FD is not supported"),
        ({"channel": "hil-test", "name": "node"}, "'node' is already attached"),
    ],
)
def test_what_cannot_be_opened_says_why(medium, node, options, text):
    """Opening fails with python-can's exception and a text that names the reason; nothing stays attached."""
    with pytest.raises(can.CanInitializationError, match=text):
        can.Bus(interface="hil", **options)
    assert [port.name for port in medium.ports] == ["node"]


def test_waiting_lets_simulated_time_pass(scheduler, medium, node, bus):
    """`recv` runs the simulation up to the message; its time stamp is the end of the frame in bench time."""
    frame = CanFrame(0x123, b"xyz")
    scheduler.after(3 * S, lambda: node.port.send(frame))
    received = bus.recv(10.0)
    end = 3 * S + (frame_bits(frame) - 3) * US
    assert (received.arbitration_id, bytes(received.data), received.is_rx) == (0x123, b"xyz", True)
    assert received.timestamp == end / S
    assert received.channel == "hil-test"
    assert scheduler.now == end


def test_time_out_is_simulated_time(scheduler, bus):
    """Waiting in vain takes the time-out on the simulated clock, and next to nothing on the wall clock."""
    begin = time.monotonic()
    assert bus.recv(1000.0) is None
    assert scheduler.now == 1000 * S
    assert time.monotonic() - begin < 60
    assert bus.recv(0) is None
    assert scheduler.now == 1000 * S


def test_filters_do_not_stretch_the_time_out(scheduler, node, bus):
    """Messages that the filters hold back do not end the waiting, nor do they prolong it."""
    bus.set_filters([{"can_id": 0x200, "can_mask": 0x700, "extended": False}])
    scheduler.every(10 * MS, lambda: node.port.send(CanFrame(0x100)))
    scheduler.at(555 * MS, lambda: node.port.send(CanFrame(0x234)))
    assert bus.recv(0.5) is None
    assert scheduler.now == 500 * MS
    assert bus.recv(0.5).arbitration_id == 0x234


def test_waiting_for_ever_for_nothing_is_an_error(scheduler, node, bus):
    """Without a time-out and without any event left `recv` says so and does not hang."""
    scheduler.after(S, lambda: None)
    with pytest.raises(can.CanOperationError, match="no event is left"):
        bus.recv()
    assert scheduler.now == S


def test_iteration_ends_with_the_simulation(scheduler, node, bus):
    """Iterating yields every message and ends when nothing more can come."""
    for number in range(3):
        scheduler.after((number + 1) * S, lambda number=number: node.port.send(CanFrame(0x100 + number)))
    assert [received.arbitration_id for received in bus] == [0x100, 0x101, 0x102]


def test_sending_all_kinds_of_frames(scheduler, node, bus):
    """Identifiers, data and remote requests arrive as python-can gave them."""
    bus.send(message(0x100, b"abc"))
    bus.send(can.Message(arbitration_id=0x1ABCDEF0, data=b"12345678"))
    bus.send(can.Message(arbitration_id=0x300, is_remote_frame=True, dlc=4, is_extended_id=False))
    scheduler.run_for(MS)
    assert node.frames == [
        CanFrame(0x100, b"abc"),
        CanFrame(0x300, remote=True, dlc=4),
        CanFrame(0x1ABCDEF0, b"12345678", extended=True),
    ]


@pytest.mark.parametrize(
    ("wrong", "text"),
    [
        (can.Message(is_error_frame=True), "error frame cannot be sent"),
        (can.Message(is_fd=True, data=bytes(12)), "CAN FD messages are not supported"),
        (can.Message(arbitration_id=0x800, is_extended_id=False), "outside 0..7FFh"),
        (can.Message(data=b"12", dlc=3), "3 data bytes, not 2"),
    ],
)
def test_what_cannot_be_sent_says_why(bus, wrong, text):
    """A message that is no classical frame is refused where it is sent."""
    with pytest.raises(can.CanOperationError, match=text):
        bus.send(wrong)


def test_full_transmit_queue_is_an_error(medium, node, bus):
    """As with a real adapter, a program that sends faster than the bus takes gets an error."""
    for _ in range(1 + bus.port.tx_buffers):
        bus.send(message())
    with pytest.raises(can.CanOperationError, match="transmit queue of python-can on hil-test is full"):
        bus.send(message())
    bus.flush_tx_buffer()
    assert bus.port.pending == 0
    bus.send(message())


def test_own_messages(scheduler, medium, node):
    """Own messages come back when they have been sent, marked as such, and only if asked for."""
    with can.Bus(interface="hil", channel=medium, receive_own_messages=True) as bus:
        bus.send(message())
        received = bus.recv(1.0)
        assert (received.arbitration_id, received.is_rx) == (0x100, False)
        assert received.timestamp == (frame_bits(CanFrame(0x100, b"abc")) - 3) * 1e-6
    with can.Bus(interface="hil", channel=medium) as bus:
        bus.send(message())
        assert bus.recv(1.0) is None


def test_two_programs_talk(medium):
    """Two python-can buses on one segment exchange messages through the simulated wire."""
    with can.Bus(interface="hil", channel=medium) as one, can.Bus(interface="hil", channel=medium) as other:
        one.send(message(0x10))
        assert other.recv(1.0).arbitration_id == 0x10
        other.send(message(0x20))
        assert one.recv(1.0).arbitration_id == 0x20


# ------------------------------------------------------------------------------------------ periodic messages


def test_periodic_message_keeps_simulated_time(scheduler, node, bus):
    """A periodic message starts at once, keeps its period to the nanosecond, and ends after its duration."""
    times = []
    bus.segment.add_hook(lambda frame, sender, time_ns: times.append(time_ns))
    scheduler.run_for(1_234_567)
    task = bus.send_periodic(message(), 0.01, duration=0.1)
    scheduler.run_for(S)
    assert times == [1_234_567 + number * 10 * MS for number in range(10)]
    task.start()
    scheduler.run_for(S)
    assert len(times) == 20


def test_periodic_message_changes_and_stops(scheduler, node, bus):
    """Data can be changed while it runs; stop ends it, start begins again; no thread is involved."""
    threads = threading.active_count()
    task = bus.send_periodic([message(data=b"1")], 0.01)
    scheduler.run_for(25 * MS)
    task.modify_data(message(data=b"2"))
    scheduler.run_for(10 * MS)
    assert [frame.data for frame in node.frames] == [b"1", b"1", b"1", b"2"]
    task.stop()
    task.stop()
    scheduler.run_for(S)
    assert len(node.frames) == 4
    task.start()
    task.start()
    scheduler.run_for(5 * MS)
    assert len(node.frames) == 5
    assert threading.active_count() == threads
    with pytest.raises(ValueError, match="cannot be changed"):
        task.modify_data(message(0x101))


def test_periodic_messages_take_turns_and_can_be_modified(scheduler, node, bus):
    """Several messages of a task alternate; the modifier is called before each of them."""

    def count(msg):
        msg.data[0] += 1

    bus.send_periodic([message(data=b"\x00"), message(data=b"\x80")], 0.01, modifier_callback=count)
    scheduler.run_for(35 * MS)
    assert [frame.data[0] for frame in node.frames] == [0x01, 0x81, 0x02, 0x82]


def test_periodic_message_without_autostart(scheduler, node, bus):
    """A task that is not started sends nothing until it is."""
    task = bus.send_periodic(message(), 0.01, autostart=False)
    scheduler.run_for(S)
    assert node.frames == []
    task.start()
    scheduler.run_for(MS)
    assert len(node.frames) == 1


@pytest.mark.parametrize("period", [0, -1.0, 1e-12, math.nan, math.inf], ids=str)
def test_periodic_message_needs_a_period(bus, period):
    """A period that is no positive number is refused with what is allowed."""
    with pytest.raises(ValueError, match=rf"period {period} s is not a positive number of seconds"):
        bus.send_periodic(message(), period)


@pytest.mark.parametrize("duration", [-1.0, math.nan, math.inf], ids=str)
def test_periodic_message_needs_a_duration_that_ends(bus, duration):
    """A duration that is no number of seconds is refused; for ever is None."""
    with pytest.raises(ValueError, match=rf"duration {duration} s is not a number of seconds"):
        bus.send_periodic(message(), 0.01, duration=duration)


def test_periodic_message_is_checked(bus):
    """A message that cannot be sent is refused before anything is sent."""
    with pytest.raises(ValueError, match=r"outside 0\.\.7FFh"):
        bus.send_periodic(message(0x900), 0.1)


def test_time_out_is_checked(bus, node):
    """A time-out that is no number is refused; an infinite one waits for what comes, a negative one not at
    all.
    """
    with pytest.raises(ValueError, match="timeout nan s is not a number of seconds"):
        bus.recv(math.nan)
    assert bus.recv(-math.inf) is None
    node.port.send(CanFrame(0x123))
    assert bus.recv(math.inf).arbitration_id == 0x123


@pytest.mark.exhaustive
def test_periodic_message_outlives_a_full_queue(scheduler, medium):
    """On a bus without partner the queue fills up; the task goes on and is heard when a partner comes."""
    with can.Bus(interface="hil", channel=medium) as bus:
        bus.send_periodic(message(), 0.001)
        scheduler.run_for(S)
        assert bus.state is can.BusState.PASSIVE
        frames = []
        medium.attach("late", lambda frame, time_ns: frames.append(time_ns))
        scheduler.run_for(S)
        assert len(frames) > 1000


# ------------------------------------------------------------------------------------------- state and errors


def test_state_follows_the_error_counters(scheduler, medium, node, bus):
    """Error-active, error-passive and bus-off are ACTIVE, PASSIVE and ERROR."""
    assert bus.state is can.BusState.ACTIVE
    bus.port.set_error_counters(tec=128)
    assert bus.state is can.BusState.PASSIVE
    bus.port.set_error_counters(tec=256)
    assert bus.state is can.BusState.ERROR
    assert bus.recv(0.1) is None
    assert bus.state is can.BusState.ACTIVE
    with pytest.raises(NotImplementedError, match="cannot be set"):
        bus.state = can.BusState.PASSIVE


def test_error_frames(scheduler, medium, node):
    """On request errors on the bus and changes of the own state arrive as SocketCAN error frames."""
    with can.Bus(interface="hil", channel=medium, error_frames=True) as bus:
        remove = medium.add_hook(lambda frame, sender, time_ns: HookResult.corrupt())
        node.port.send(CanFrame(0x100))
        error = bus.recv(1.0)
        assert error.is_error_frame
        assert error.arbitration_id == 0x088  # CAN_ERR_PROT | CAN_ERR_BUSERROR
        assert (error.data[2], error.data[3]) == (0x01, 0x08)  # bit error of another node, in the CRC
        assert bus.recv(1.0).arbitration_id == 0x100
        remove()
        bus.port.set_error_counters(tec=256)
        off, on = bus.recv(1.0), bus.recv(1.0)
        assert (off.arbitration_id, on.arbitration_id, on.data[1]) == (0x040, 0x004, 0x40)
        assert bus.port.state is NodeState.ERROR_ACTIVE
        node.port.online = False
        bus.send(message())
        acknowledge = bus.recv(1.0)
        assert (acknowledge.arbitration_id, acknowledge.data[6]) == (0x0A0, 8)
    assert medium.bus_error_listeners == []


def test_shut_down_bus_refuses_everything(scheduler, medium, node, bus):
    """After shutdown the node is gone, periodic messages have ended, and every call says so."""
    bus.send_periodic(message(), 0.01)
    bus.shutdown()
    bus.shutdown()
    scheduler.run_for(S)
    assert node.frames == []
    assert [port.name for port in medium.ports] == ["node"]
    for call in (lambda: bus.send(message()), lambda: bus.recv(0), lambda: bus.send_periodic(message(), 1.0)):
        with pytest.raises(can.CanOperationError, match="is shut down"):
            call()


# ------------------------------------------------------------------------------------------------- threads


def test_waiting_in_a_callback_is_refused(scheduler, medium, node, bus):
    """Inside of a callback only what has already arrived can be read."""
    outcome = []

    def callback():
        outcome.append(bus.recv(0))
        with pytest.raises(can.CanOperationError, match="must not wait"):
            bus.recv(1.0)
        outcome.append("refused")

    scheduler.after(MS, callback)
    scheduler.run_for(10 * MS)
    assert outcome == [None, "refused"]


def test_virtual_time_has_one_thread(bus):
    """A foreign thread that would run the simulation is refused with advice."""
    errors = []

    def run():
        try:
            bus.recv(1.0)
        except can.CanOperationError as error:
            errors.append(str(error))

    thread = threading.Thread(target=run)
    thread.start()
    thread.join()
    assert len(errors) == 1
    assert "virtual time, which has one thread" in errors[0]


def test_notifier_in_real_time():
    """On a segment in real time a Notifier works: its thread waits while another runs the scheduler."""
    scheduler = RealtimeScheduler()
    medium = CanMedium(scheduler, name="rt")
    node = medium.attach("node", lambda frame, time_ns: node.send(CanFrame(frame.can_id + 1, frame.data)))
    bus = can.Bus(interface="hil", channel=medium)
    reader = can.BufferedReader()
    notifier = can.Notifier(bus, [reader], timeout=0.05)
    stop = threading.Event()
    runner = threading.Thread(target=lambda: scheduler.run_until(stop.is_set, 60 * S))
    runner.start()
    try:
        bus.send(message(0x100))
        answer = reader.get_message(10.0)
        assert answer.arbitration_id == 0x101
        task = bus.send_periodic(message(0x200), 0.005)
        assert [reader.get_message(10.0).arbitration_id for _ in range(3)] == [0x201] * 3
        task.stop()
    finally:
        notifier.stop()
        stop.set()
        scheduler.post(lambda: None)
        runner.join()
        bus.shutdown()


def test_recv_runs_a_realtime_scheduler_of_its_own_thread():
    """In the thread of the bus `recv` runs the scheduler itself when nobody else does."""
    scheduler = RealtimeScheduler()
    medium = CanMedium(scheduler, name="rt")
    node = medium.attach("node", lambda frame, time_ns: node.send(CanFrame(0x101)))
    with can.Bus(interface="hil", channel=medium) as bus:
        bus.send(message(0x100))
        assert bus.recv(10.0).arbitration_id == 0x101
        assert bus.recv(0.01) is None


@pytest.mark.exhaustive
def test_bus_keeps_the_segment_alive_but_the_registry_does_not(scheduler):
    """A program that opened a segment by name holds it; without it the segment goes."""
    bus = can.Bus(interface="hil", channel=CanMedium(scheduler, name="short-lived"))
    gc.collect()
    with can.Bus(interface="hil", channel="short-lived") as other:
        assert other.segment is bus.segment
    bus.shutdown()


@pytest.mark.requirement("CANP-059")
@pytest.mark.parametrize(
    ("field", "bit", "kind", "place"),
    [
        ("id", 2, 0x01, 0x02),
        ("reserved", 0, 0x01, 0x09),
        ("dlc", 0, 0x01, 0x0B),
        ("data", 5, 0x01, 0x0A),
        ("crc", 1, 0x01, 0x08),
        ("crc_delimiter", 0, 0x02, 0x18),
        ("ack_delimiter", 0, 0x02, 0x1B),
        ("eof", 0, 0x02, 0x1A),
    ],
)
def test_error_frames_tell_kind_and_place_as_socketcan_does(medium, node, field, bit, kind, place):
    """An error while sending carries CAN_ERR_PROT_TX, the kind, the place in the frame and the counters."""
    with can.Bus(interface="hil", channel=medium, error_frames=True) as bus:
        medium.add_hook(lambda frame, sender, time_ns: HookResult.corrupt(1, BitError(field, bit)))
        bus.send(message(0x2AA, b"\x55\x55"))
        error = bus.recv(1.0)
        assert error.is_error_frame
        assert error.arbitration_id == 0x088
        assert (error.data[2], error.data[3], error.data[6]) == (0x80 | kind, place, 8)
        assert bus.recv(0.1) is None
    assert node.frames == [CanFrame(0x2AA, b"\x55\x55")]
