"""Error confinement on the virtual segment: acknowledge, counters, passive, bus-off, recovery, collisions."""

import itertools

import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from fieldbus.can import CanFrame, CanMedium, ErrorCode, HookResult, NodeState, frame_bits
from fieldbus.can.confinement import rec_after_reception, state_of
from fieldbus.can.timing import wire_bits
from fieldbus.clock import MS, US, VirtualScheduler
from fieldbus.errors import BusError
from fieldbus.history import History

FRAME = CanFrame(0x181, b"\x55" * 8)
LENGTH = frame_bits(FRAME)  # with 3 bits of intermission; a bit is a microsecond here
ACTIVE, PASSIVE, BUS_OFF = NodeState.ERROR_ACTIVE, NodeState.ERROR_PASSIVE, NodeState.BUS_OFF


class Bench:
    """A segment at 1 Mbit/s with nodes by name; `received` has what each of them got."""

    def __init__(self, *names, **options):
        self.scheduler = VirtualScheduler()
        self.history = History(self.scheduler)
        self.medium = CanMedium(self.scheduler, history=self.history)
        self.received = {name: [] for name in names}
        self.ports = {
            name: self.medium.attach(
                name, lambda frame, time_ns, name=name: self.received[name].append(frame), **options
            )
            for name in names
        }

    def corrupt(self, sender, count):
        """Let the next frame of `sender` fail `count` times."""

        def hook(frame, name, time_ns):
            if name == sender:
                remove()
                return HookResult.corrupt(count)
            return None

        remove = self.medium.add_hook(hook)
        return remove

    def run(self, bits):
        self.scheduler.run_for(bits * US)

    def log_times(self):
        return [time_ns / US for time_ns, *_ in self.medium.log]

    def errors(self):
        return [error for *_, error in self.medium.log]


# ------------------------------------------------------------------------------------------------- rules


@pytest.mark.requirement("CANP-053", "CANP-054")
@pytest.mark.parametrize(
    ("tec", "rec", "state"),
    [
        (0, 0, ACTIVE),
        (127, 127, ACTIVE),
        (128, 0, PASSIVE),
        (0, 128, PASSIVE),
        (255, 255, PASSIVE),
        (256, 0, BUS_OFF),
    ],
)
def test_state_by_counters(tec, rec, state):
    """Active up to 127, passive from 128 of either counter, bus-off from 256 of the transmit counter."""
    assert state_of(tec, rec) is state


@pytest.mark.requirement("CANP-052")
@pytest.mark.parametrize(("before", "after"), [(0, 0), (1, 0), (127, 126), (128, 119), (255, 119)])
def test_receive_counter_after_a_good_frame(before, after):
    """A good frame takes one off; from above 127 the counter falls to 119."""
    assert rec_after_reception(before) == after


def first_difference(wires):
    """Return the first position at which two senders differ."""
    return next(index for index, (one, other) in enumerate(zip(*wires, strict=False)) if one != other)


# ------------------------------------------------------------------------------------------------ acknowledge


@pytest.mark.requirement("CANP-037", "CANP-046", "CANP-056", "CANP-079")
def test_lone_node_becomes_passive_and_stays_so():
    """Without an acknowledge the counter goes to 128 in 16 attempts and stays there for ever."""
    bench = Bench("a")
    port = bench.ports["a"]
    port.send(FRAME)
    counters = []
    for _ in range(17):
        attempts = len(bench.medium.log)
        bench.scheduler.run_until(lambda attempts=attempts: len(bench.medium.log) > attempts, MS)
        counters.append(port.tec)
    assert counters == [*range(8, 129, 8), 128]
    assert port.state is PASSIVE
    bench.run(1_000_000)
    assert port.tec == 128
    assert port.state is PASSIVE
    assert set(bench.errors()) == {"ACK_ERROR"}


@pytest.mark.requirement("CANP-008", "CANP-030", "CANP-038", "CANP-042")
def test_times_of_unacknowledged_attempts():
    """An attempt lasts to the ACK slot plus flag 6 and delimiter 8; then 3 bits, and 8 more when
    error-passive.
    """
    bench = Bench("a")
    bench.ports["a"].send(FRAME)
    bench.run(20_000)
    times = bench.log_times()
    attempt = LENGTH - 3 - 8 + 6 + 8
    assert times[0] == attempt
    gaps = [later - earlier for earlier, later in itertools.pairwise(times)]
    assert gaps[:15] == [attempt + 3] * 15
    assert set(gaps[15:]) == {attempt + 3 + 8}


@pytest.mark.exhaustive
def test_lone_node_does_not_flood_the_history():
    """Endless repetition is reported as long as it changes something: 16 errors and one change of state."""
    bench = Bench("a")
    bench.ports["a"].send(FRAME)
    bench.run(1_000_000)
    kinds = [event.kind for event in bench.history.events]
    assert kinds == ["can.bus_error"] * 16 + ["can.status"]
    first, status = bench.history.events[0], bench.history.events[-1]
    assert first.source == "can0"
    assert first.data == {"port": "a", "code": "ACK_ERROR", "field": "ack_slot", "can_id": 0x181, "tec": 8}
    assert status.data == {"port": "a", "status": "ERROR_PASSIVE", "tec": 128, "rec": 0}


@pytest.mark.requirement("CANP-030", "CANP-051", "CANP-056")
def test_frame_gets_through_when_a_partner_appears():
    """The waiting frame is delivered to the node that comes, and every success takes one off the counter."""
    bench = Bench("a", "b")
    bench.ports["b"].online = False
    bench.ports["a"].send(FRAME)
    bench.run(5_000)
    bench.ports["b"].online = True
    bench.run(500)
    assert bench.received["b"] == [FRAME]
    assert bench.ports["a"].tec == 127
    assert bench.ports["a"].state is ACTIVE
    for _ in range(200):
        bench.ports["a"].send(FRAME)
    bench.run(200 * 200)
    assert bench.ports["a"].tec == 0
    statuses = [event.data["status"] for event in bench.history.select(kind="can.status")]
    assert statuses == ["ERROR_PASSIVE", "ERROR_ACTIVE"]


@pytest.mark.requirement("CANP-054")
def test_bus_off_partner_does_not_acknowledge():
    """A node in bus-off gives no acknowledge: its partner is alone."""
    bench = Bench("a", "b", auto_recovery=False)
    bench.ports["b"].set_error_counters(tec=256)
    bench.ports["a"].send(FRAME)
    bench.run(10_000)
    assert bench.received["b"] == []
    assert bench.ports["a"].tec == 128


def test_lone_nodes_load():
    """The endless attempts of a lone node occupy the bus, which the load shows."""
    bench = Bench("a")
    bench.ports["a"].send(FRAME)
    bench.run(1_000_000)
    attempt = LENGTH - 11 + 14
    assert bench.medium.bus_load(500_000 * US) == pytest.approx((attempt + 3) / (attempt + 11), rel=1e-3)
    assert bench.medium.bus_load() == pytest.approx((attempt + 3) / (attempt + 11), rel=1e-2)


# ------------------------------------------------------------------------------------------------- bit errors


@pytest.mark.requirement("CANP-038", "CANP-042", "CANP-043", "CANP-045", "CANP-051", "CANP-052")
def test_one_corrupted_attempt():
    """A bit error costs the sender 8 and each receiver 1, one error frame of time, and nothing is lost."""
    bench = Bench("a", "b", "c")
    bench.corrupt("a", 1)
    bench.ports["a"].send(FRAME)
    bench.scheduler.run_until(lambda: bench.medium.log, MS)
    a, b, c = bench.ports.values()
    assert (a.tec, a.rec) == (8, 0)
    assert [(port.tec, port.rec) for port in (b, c)] == [(0, 1), (0, 1)]
    stuffed_region = LENGTH - 3 - 10
    # The sender's flag is dominant in the CRC delimiter, a form error for the receivers, whose flags end one
    # bit later.
    flags = 7
    assert bench.log_times() == [stuffed_region + flags + 8]
    bench.run(500)
    assert bench.received == {"a": [], "b": [FRAME], "c": [FRAME]}
    assert bench.log_times()[1] == stuffed_region + flags + 8 + 3 + LENGTH - 3
    assert (a.tec, b.rec, c.rec) == (7, 0, 0)
    assert [event.data["code"] for event in bench.history.events] == ["BIT_ERROR"]


@pytest.mark.requirement("CANP-042")
def test_other_senders_compete_after_an_error_frame():
    """After an error frame arbitration is open again: a higher identifier goes before the retransmission."""
    bench = Bench("a", "b")
    bench.corrupt("a", 1)
    bench.ports["a"].send(FRAME)
    bench.scheduler.run_for(50 * US)
    bench.ports["b"].send(CanFrame(0x080))
    bench.run(1_000)
    assert [(sender, error) for _, sender, _, error in bench.medium.log] == [
        ("a", "BIT_ERROR"),
        ("b", ""),
        ("a", ""),
    ]


@pytest.mark.requirement("CANP-045", "CANP-053", "CANP-054", "CANP-057", "CANP-079")
def test_32_failures_in_a_row_lead_to_bus_off():
    """16 failed transmissions make the sender error-passive, 32 bus-off, with the states reported as they
    change.
    """
    bench = Bench("a", "b", auto_recovery=False)
    a, b = bench.ports.values()
    changes = []
    a.on_state.append(lambda old, new: changes.append((old, new, a.tec)))
    bench.corrupt("a", 1000)
    a.send(FRAME)
    a.send(CanFrame(0x182))
    bench.run(100_000)
    assert bench.errors() == ["BIT_ERROR"] * 32
    assert changes == [(ACTIVE, PASSIVE, 128), (PASSIVE, BUS_OFF, 256)]
    assert a.state is BUS_OFF
    assert b.rec == 32
    a.send(FRAME)  # nothing goes out any more, and the queue is gone
    bench.run(100_000)
    assert len(bench.medium.log) == 32
    assert a.pending == 0


@pytest.mark.requirement("CANP-043", "CANP-052", "CANP-053")
def test_receiver_becomes_passive_by_the_errors_of_others():
    """The receive counter alone makes a node passive, and the next good frame brings it back to 119."""
    bench = Bench("a", "b")
    a, b = bench.ports.values()
    b.set_error_counters(rec=127)
    assert b.warning
    assert b.state is ACTIVE
    bench.corrupt("a", 1)
    a.send(FRAME)
    bench.scheduler.run_until(lambda: bench.medium.log, MS)
    assert (b.rec, b.state) == (128, PASSIVE)
    bench.run(500)
    assert (b.rec, b.state) == (119, ACTIVE)


@pytest.mark.requirement("CANP-008", "CANP-042")
def test_passive_sender_suspends_unless_it_becomes_receiver():
    """An error-passive sender waits 8 bits after its own frame; another node's frame comes first, whatever
    its rank.
    """
    bench = Bench("a", "b")
    a, b = bench.ports.values()
    a.set_error_counters(tec=200)
    low, high = CanFrame(0x700, bytes(8)), CanFrame(0x100, bytes(8))
    a.send(high)
    a.send(high)
    bench.scheduler.at((frame_bits(high) + 5) * US, lambda: b.send(low))
    bench.run(2_000)
    assert [(sender, frame.can_id) for _, sender, frame, _ in bench.medium.log] == [
        ("a", 0x100),
        ("b", 0x700),
        ("a", 0x100),
    ]
    start_of_low = frame_bits(high) + 5
    times = bench.log_times()
    assert times[1] == start_of_low + frame_bits(low) - 3
    assert (
        times[2] == start_of_low + frame_bits(low) + frame_bits(high) - 3
    )  # no suspension after somebody else's
    a.send(high)
    a.send(high)
    bench.run(2_000)
    times = bench.log_times()
    assert times[-1] - times[-2] == frame_bits(high) + 8


def test_power_cycle_clears_the_counters():
    """A node that comes back online starts with an error-active controller."""
    bench = Bench("a", "b", auto_recovery=False)
    port = bench.ports["a"]
    port.set_error_counters(tec=256, rec=200)
    assert port.state is BUS_OFF
    port.online = False
    port.online = True
    assert (port.tec, port.rec, port.state) == (0, 0, ACTIVE)
    port.send(FRAME)
    bench.run(500)
    assert bench.received["b"] == [FRAME]


def test_counters_can_be_set_within_their_range():
    """The bench may set the counters, the state follows at once, nonsense is refused."""
    bench = Bench("a", "b", auto_recovery=False)
    port = bench.ports["a"]
    port.set_error_counters(tec=130)
    assert port.state is PASSIVE
    port.set_error_counters(tec=0, rec=3)
    assert (port.state, port.rec) == (ACTIVE, 3)
    port.set_error_counters(tec=256)
    assert port.state is BUS_OFF
    port.set_error_counters(tec=0)
    assert port.state is ACTIVE
    for wrong in ({"tec": 257}, {"tec": -1}, {"rec": 256}):
        with pytest.raises(BusError, match="is outside 0"):
            port.set_error_counters(**wrong)


def test_forced_bus_off_in_the_middle_of_a_frame():
    """A sender that is put into bus-off breaks off; what it sent never counts as good."""
    bench = Bench("a", "b", auto_recovery=False)
    bench.ports["a"].send(FRAME)
    bench.run(40)
    bench.ports["a"].set_error_counters(tec=256)
    bench.run(1_000)
    assert bench.received["b"] == []
    assert bench.errors() == ["BIT_STUFFING_ERROR"]


# ------------------------------------------------------------------------------------------------- recovery


@pytest.mark.requirement("CANP-055", "CANP-079")
def test_recovery_on_an_idle_bus_takes_128_times_11_bits():
    """1408 bit times after the last dominant bit the node is error-active with empty counters."""
    bench = Bench("a", "b")
    port = bench.ports["a"]
    bench.corrupt("a", 1000)
    port.send(FRAME)
    bench.scheduler.run_until(lambda: port.state is BUS_OFF, 100 * MS)
    off = bench.scheduler.now
    assert bench.scheduler.run_until(lambda: port.state is ACTIVE, 100 * MS)
    flags_of_others = (
        9  # they notice the last error by a stuff error only, because the node's own flag is passive
    )
    assert bench.scheduler.now - off == (1408 + flags_of_others) * US
    assert (port.tec, port.rec) == (0, 0)
    statuses = [
        (event.data["port"], event.data["status"]) for event in bench.history.select(kind="can.status")
    ]
    assert statuses == [("a", "ERROR_PASSIVE"), ("a", "BUS_OFF"), ("a", "ERROR_ACTIVE")]
    port.send(FRAME)
    bench.run(500)
    assert bench.received["b"] == [FRAME]


@pytest.mark.requirement("CANP-055")
def test_recovery_on_request():
    """Without automatic recovery the node stays off until it is asked, and then needs the full time."""
    bench = Bench("a", "b", auto_recovery=False)
    port = bench.ports["a"]
    port.set_error_counters(tec=256)
    bench.run(10_000)
    assert port.state is BUS_OFF
    port.recover()
    bench.run(700)
    port.recover()  # asking again changes nothing
    bench.run(707)
    assert port.state is BUS_OFF
    bench.run(1)
    assert port.state is ACTIVE
    port.recover()
    assert port.state is ACTIVE


@pytest.mark.exhaustive
@pytest.mark.requirement("CANP-055")
@given(gaps=st.lists(st.integers(0, 60), min_size=1, max_size=5))
def test_recovery_under_traffic_counts_recessive_sequences(gaps):
    """Each run of recessive bits between two frames counts for as many sequences as 11 bits fit into it."""
    bench = Bench("a", "b", "c")
    port = bench.ports["a"]
    port.set_error_counters(tec=256)
    total = 0

    def send():
        nonlocal total
        if port.state is BUS_OFF:
            bench.ports["b"].send(FRAME)
            bench.scheduler.after((LENGTH + gaps[total % len(gaps)]) * US, send)
            total += 1

    bench.scheduler.after(100 * US, send)
    assert bench.scheduler.run_until(lambda: port.state is ACTIVE, 1000 * MS)
    # The model: recessive from time 0 to the first frame, later from the ACK delimiter (8 bits before the end
    # of EOF).
    missing, since, recovered = 128, 0, None
    for end in bench.log_times():
        start = end - (LENGTH - 3)
        if start - since >= missing * 11:
            break
        missing -= int((start - since) // 11)
        since = end - 8
    recovered = since + missing * 11
    assert bench.scheduler.now == recovered * US


@pytest.mark.requirement("CANP-055")
def test_recovery_between_error_frames_counts_recessive_sequences():
    """The delimiter of an error frame with the intermission is one sequence of 11 bits, with the suspension
    no more.
    """
    bench = Bench("a", "b")
    port = bench.ports["a"]
    port.set_error_counters(tec=256)
    bench.ports["b"].send(FRAME)  # nobody acknowledges: error frames without end
    assert bench.scheduler.run_until(lambda: port.state is ACTIVE, 1000 * MS)
    assert len(bench.medium.log) == 128
    assert bench.scheduler.now == (bench.log_times()[-1] - 8 + 11) * US


# ------------------------------------------------------------------------------------------------- collisions


@pytest.mark.requirement("CANP-029")
def test_identical_frames_of_two_nodes_both_succeed():
    """Two nodes that send the very same bits at the same time do not notice each other."""
    bench = Bench("a", "b", "c")
    for name in ("a", "b"):
        bench.ports[name].send(FRAME)
    bench.run(1_000)
    assert bench.received == {"a": [], "b": [], "c": [FRAME]}
    assert bench.errors() == [""]
    assert bench.history.events == []


@pytest.mark.requirement("CANP-029", "CANP-037")
def test_identical_frames_need_a_third_node_for_the_acknowledge():
    """A transmitter does not acknowledge: two of the same frame alone on the bus both miss the
    acknowledge.
    """
    bench = Bench("a", "b")
    for port in bench.ports.values():
        port.send(FRAME)
    bench.run(150)
    assert bench.errors() == ["ACK_ERROR"]
    assert [port.tec for port in bench.ports.values()] == [8, 8]


@pytest.mark.requirement("CANP-029", "CANP-043", "CANP-045")
def test_same_identifier_with_different_data_destroys_both():
    """Two nodes with one identifier and different content destroy each other's frames as long as they are
    error-active.
    """
    bench = Bench("a", "b", "c", auto_recovery=False)
    a, b, c = bench.ports.values()
    one, other = CanFrame(0x181, b"\x00\x00"), CanFrame(0x181, b"\x00\x01")
    a.send(one)
    b.send(other)
    bench.scheduler.run_until(lambda: bench.medium.log, MS)
    difference = first_difference([wire_bits(one), wire_bits(other)])
    assert (a.tec, b.tec, c.rec) == (8, 8, 1)
    length_of_flags = bench.log_times()[0] - (difference + 1) - 8
    assert 6 <= length_of_flags <= 12
    bench.run(10_000)
    # 16 times both destroy the frame. Then both are error-passive: the one that sends recessive gives up with
    # a flag that nobody sees, and the other gets through.
    assert bench.errors()[:17] == ["BIT_ERROR"] * 16 + [""]
    assert bench.received["c"][0] == one
    assert bench.received["c"] == [one, other]
    assert bench.received["b"] == []  # it was busy with its error flag
    assert (a.state, b.state) == (ACTIVE, PASSIVE)
    assert a.tec == 127
    assert b.tec == 128 + 8 - 1


@pytest.mark.requirement("CANP-029")
def test_collision_of_different_lengths():
    """Frames of one identifier that differ in the DLC collide in the control field already."""
    bench = Bench("a", "b", "c")
    bench.ports["a"].send(CanFrame(0x181, b""))
    bench.ports["b"].send(CanFrame(0x181, bytes(8)))
    bench.scheduler.run_until(lambda: bench.medium.log, MS)
    assert bench.errors() == ["BIT_ERROR"]
    assert bench.log_times()[0] < 19 + 5 + 12 + 8


@pytest.mark.exhaustive
@pytest.mark.requirement("CANP-029", "CANP-038")
@given(st.binary(min_size=8, max_size=8), st.binary(min_size=8, max_size=8))
def test_length_of_the_error_frame_of_two_colliding_nodes(one, other):
    """Alone on the bus: the loser's flag, then that of the other from the first recessive bit it cannot
    send.
    """
    assume(one != other)
    bench = Bench("a", "b")
    frames = [CanFrame(0x181, data) for data in (one, other)]
    for port, frame in zip(bench.ports.values(), frames, strict=True):
        port.send(frame)
    bench.scheduler.run_until(lambda: bench.medium.log, MS)
    wires = [wire_bits(frame) for frame in frames]
    at = first_difference(wires)
    winner = next(wire for wire in wires if wire[at] == 0)
    noticed = at + 1
    while winner[noticed] == 0:  # the loser's flag is dominant
        noticed += 1
    assert bench.log_times()[0] == max(at + 1 + 6, noticed + 1 + 6) + 8


# ------------------------------------------------------------------------------------------ broken-off frames


@pytest.mark.requirement("CANP-034", "CANP-038", "CANP-043")
@pytest.mark.parametrize("leave", ["offline", "detach"])
def test_sender_that_disappears_leaves_a_torn_frame(leave):
    """A node that loses power in the middle of its frame makes a stuff error for the others, and no
    delivery.
    """
    bench = Bench("a", "b", "c")
    bench.ports["a"].send(FRAME)
    bench.run(50)
    if leave == "offline":
        bench.ports["a"].online = False
    else:
        bench.ports["a"].detach()
    bench.ports["b"].send(CanFrame(0x200))
    bench.run(1_000)
    assert [(sender, error) for _, sender, _, error in bench.medium.log] == [
        ("a", "BIT_STUFFING_ERROR"),
        ("b", ""),
    ]
    # Bit 49 was recessive already: five more make a stuff error, then come the flags of the two others.
    assert wire_bits(FRAME)[48:50] == [0, 1]
    assert bench.log_times()[0] == 49 + 6 + 6 + 8
    assert bench.received["b"] == []
    assert bench.received["c"] == [CanFrame(0x200)]
    assert bench.ports["c"].rec == 0  # one up, one down
    assert bench.ports["b"].rec == 1


@pytest.mark.parametrize("left", range(1, 20))
def test_sender_that_disappears_at_the_very_end(left):
    """Behind its last dominant bit a vanished sender makes no difference; before it the frame is torn."""
    bench = Bench("a", "b", "c")
    bench.ports["a"].send(FRAME)
    bench.run(LENGTH - 3 - left)
    bench.ports["a"].online = False
    bench.run(1_000)
    last_bits = wire_bits(FRAME)[max(len(wire_bits(FRAME)) + 10 - left, 0) :]
    assert bench.received["b"] == ([] if 0 in last_bits else [FRAME])


def test_sender_that_disappears_before_its_frame_starts():
    """A frame that has not begun just vanishes with its node, and the next in rank takes the bus."""
    bench = Bench("a", "b", "c")
    bench.ports["a"].send(CanFrame(0x100))
    bench.ports["b"].send(CanFrame(0x200))
    bench.ports["a"].online = False
    bench.run(1_000)
    assert [(sender, error) for _, sender, _, error in bench.medium.log] == [("b", "")]
    assert bench.log_times() == [frame_bits(CanFrame(0x200)) - 3]


def test_power_cycle_within_an_error_frame():
    """A node that restarts while its failed attempt still ends neither repeats the frame nor counts the
    error.
    """
    bench = Bench("a", "b")
    bench.corrupt("a", 1)
    bench.ports["a"].send(FRAME)
    bench.run(LENGTH - 5)  # within the error frame
    bench.ports["a"].online = False
    bench.ports["a"].online = True
    bench.run(1_000)
    assert bench.errors() == ["BIT_ERROR"]
    assert bench.ports["a"].tec == 0


def test_one_of_two_identical_senders_disappears():
    """When one of two senders of the same bits vanishes, the other completes the frame."""
    bench = Bench("a", "b", "c")
    for name in ("a", "b"):
        bench.ports[name].send(FRAME)
    bench.run(30)
    bench.ports["a"].online = False
    bench.run(1_000)
    assert bench.received["c"] == [FRAME]
    assert [(sender, error) for _, sender, _, error in bench.medium.log] == [("b", "")]


def test_node_that_is_off_does_not_answer_the_collision_of_the_others():
    """A node that was first to send and is unplugged at once takes no part in what the others do."""
    bench = Bench("a", "b", "c")
    for name in "cab":
        bench.ports[name].send(CanFrame(0x100))
    bench.run(1)
    bench.ports["c"].online = False
    bench.run(300)
    assert set(bench.errors()) == {"ACK_ERROR"}
    assert len(bench.errors()) > 3


def test_last_receiver_disappears():
    """A receiver that goes away before the ACK slot leaves the sender without acknowledge."""
    bench = Bench("a", "b")
    bench.ports["a"].send(FRAME)
    bench.run(50)
    bench.ports["b"].online = False
    bench.run(100)
    assert bench.errors() == ["ACK_ERROR"]


def test_bus_error_listener():
    """Whoever wants error frames gets time, transmitter, kind, frame and field, at the wrong bit."""
    bench = Bench("a", "b")
    reported = []
    bench.medium.bus_error_listeners.append(lambda *arguments: reported.append(arguments))
    bench.corrupt("a", 1)
    bench.ports["a"].send(FRAME)
    bench.run(500)
    assert reported == [((LENGTH - 3 - 10) * US, "a", ErrorCode.BIT, FRAME, "crc")]


@pytest.mark.exhaustive
@pytest.mark.requirement("CANP-077")
@given(
    st.lists(
        st.tuples(
            st.integers(0, 3000),
            st.sampled_from(["send", "off", "on", "counters", "corrupt", "inject"]),
            st.integers(0, 2),
            st.integers(0, 3),
        ),
        max_size=60,
    )
)
def test_any_disturbance_leaves_a_working_segment(steps):
    """After any mixture of sends and faults the segment works; a second run, and one with an idle hook, is
    the same.
    """

    def once(*, idle_hook=False):
        bench = Bench("a", "b", "c")
        if idle_hook:
            bench.medium.add_hook(lambda frame, sender, time_ns: None)
        ports = list(bench.ports.values())
        removers = []

        def act(kind, who, what):
            port = ports[who]
            if kind == "send":
                port.send(
                    CanFrame(0x100 + what, bytes([who] * (what + 1)))
                )  # identical ones of all would never end
            elif kind == "off":
                port.online = False
            elif kind == "on":
                port.online = True
            elif kind == "counters":
                port.set_error_counters(tec=(0, 120, 200, 256)[what])
            elif kind == "corrupt":
                removers.append(bench.corrupt(port.name, what + 1))
            else:
                bench.medium.inject(CanFrame(0x100 + what, b"injected"))

        for time_us, kind, who, what in steps:
            bench.scheduler.at(time_us * US, lambda arguments=(kind, who, what): act(*arguments))
        bench.run(5_000)
        for remove in removers:
            remove()
        for port in ports:
            port.online = True
        bench.run(100_000)
        return bench

    bench = once()
    assert bench.medium.log == once().medium.log
    assert bench.medium.log == once(idle_hook=True).medium.log
    assert all(
        later > earlier for earlier, later in zip(bench.log_times(), bench.log_times()[1:], strict=False)
    )
    assert all(port.state is not BUS_OFF and not port.queue for port in bench.medium.ports)
    for port in bench.medium.ports:
        bench.received = {name: [] for name in bench.ports}
        frame = CanFrame(0x7F0, port.name.encode())
        port.send(frame)
        bench.run(1_000)
        assert [name for name, frames in bench.received.items() if frames == [frame]] == [
            name for name in bench.ports if name != port.name
        ]
