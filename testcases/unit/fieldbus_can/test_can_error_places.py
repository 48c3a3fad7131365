"""What follows from the place of a bit error: table-driven, with the figures worked out by hand."""

import pytest

from fieldbus.can import BitError, CanFrame, CanMedium, ErrorCode, HookResult, NodeState
from fieldbus.can.bitstream import FIELDS, image_of
from fieldbus.clock import MS, US, VirtualScheduler
from fieldbus.errors import BusError
from fieldbus.history import History

FRAME = CanFrame(0x2AA, b"\x55\x55")  # no stuff bits before the CRC
LAST = len(image_of(FRAME).bits)  # first bit behind the stuffed region


class Bench:
    """Nodes a, b, c at 1 Mbit/s; a bit is a microsecond."""

    def __init__(self, **options):
        self.scheduler = VirtualScheduler()
        self.history = History(self.scheduler)
        self.medium = CanMedium(self.scheduler, history=self.history)
        self.received = {name: [] for name in "abc"}
        self.ports = {
            name: self.medium.attach(
                name,
                lambda frame, time_ns, name=name: self.received[name].append(frame),
                auto_recovery=False,
                **options,
            )
            for name in "abc"
        }
        self.reported = []
        self.medium.bus_error_listeners.append(
            lambda time, port, code, frame, field: self.reported.append((time // US, port, code, field))
        )

    def corrupt_next(self, error, count=1):
        def hook(frame, sender, time_ns):
            remove()
            return HookResult.corrupt(count, error)

        remove = self.medium.add_hook(hook)

    def counters(self):
        return [(port.tec, port.rec) for port in self.ports.values()]


def first_attempt(error):
    """Send FRAME from a with `error`; returns the bench at the end of the first attempt."""
    bench = Bench()
    bench.corrupt_next(error)
    bench.ports["a"].send(FRAME)
    bench.scheduler.run_until(lambda: bench.medium.log, MS)
    return bench


ALL, SENDER, ONE, BOTH = None, frozenset("a"), frozenset("b"), frozenset("bc")
BIT, STUFF, FORM, CRC, ACK = ErrorCode.BIT, ErrorCode.STUFF, ErrorCode.FORM, ErrorCode.CRC, ErrorCode.ACK


@pytest.mark.parametrize(
    ("error", "reported", "end", "counters"),
    [
        # A dominant flag in the CRC delimiter is a form error for the receivers: 1 + 6 bits of flags.
        pytest.param(
            BitError("crc", -1, SENDER),
            (LAST, "a", BIT, "crc"),
            LAST + 7 + 8,
            [(8, 0), (0, 1), (0, 1)],
            marks=pytest.mark.requirement("CANP-033", "CANP-038"),
            id="bit error of the sender in the CRC",
        ),
        pytest.param(
            BitError("crc_delimiter", 0, ALL),
            (LAST + 1, "a", FORM, "crc_delimiter"),
            LAST + 1 + 6 + 8,
            [(8, 0), (0, 1), (0, 1)],
            marks=pytest.mark.requirement("CANP-036"),
            id="form error in the CRC delimiter",
        ),
        # Nobody has sent an error flag before: that of the sender takes the ACK delimiter, the others' come
        # one bit later.
        pytest.param(
            BitError("ack_slot", 0, SENDER),
            (LAST + 2, "a", ACK, "ack_slot"),
            LAST + 2 + 7 + 8,
            [(8, 0), (0, 1), (0, 1)],
            marks=pytest.mark.requirement("CANP-006", "CANP-037"),
            id="missing acknowledge",
        ),
        # Two receivers read another CRC than was sent: flags after the ACK delimiter, and nobody has
        # acknowledged.
        pytest.param(
            BitError("data", 3, BOTH),
            (LAST + 2, "a", ACK, "ack_slot"),
            LAST + 2 + 7 + 8,
            [(8, 0), (0, 1), (0, 1)],
            marks=pytest.mark.requirement("CANP-006"),
            id="no good receiver",
        ),
        # One receiver finds the CRC wrong and was the first to tell: the sender's flag follows one bit later
        # (REC +1 +8).
        pytest.param(
            BitError("data", 3, ONE),
            (LAST + 3, "b", CRC, "ack_delimiter"),
            LAST + 3 + 7 + 8,
            [(8, 0), (0, 9), (0, 1)],
            marks=pytest.mark.requirement("CANP-005", "CANP-035", "CANP-044"),
            id="CRC error",
        ),
        pytest.param(
            BitError("ack_delimiter", 0, ALL),
            (LAST + 3, "a", FORM, "ack_delimiter"),
            LAST + 3 + 6 + 8,
            [(8, 0), (0, 1), (0, 1)],
            marks=pytest.mark.requirement("CANP-036"),
            id="form error in the ACK delimiter",
        ),
        pytest.param(
            BitError("eof", 2, ONE),
            (LAST + 6, "b", FORM, "eof"),
            LAST + 6 + 7 + 8,
            [(8, 0), (0, 9), (0, 1)],
            marks=pytest.mark.requirement("CANP-007", "CANP-036", "CANP-044"),
            id="form error in EOF",
        ),
    ],
)
def test_kind_time_and_counters_follow_from_the_place(error, reported, end, counters):
    """The error that is found first, where its error frame ends, and TEC and REC of sender and receivers."""
    bench = first_attempt(error)
    assert bench.reported[0] == reported
    assert bench.medium.log[0][0] // US == end
    assert bench.medium.log[0][3] == reported[2].value
    assert bench.counters() == counters
    bench.scheduler.run_for(MS)
    assert bench.received == {"a": [], "b": [FRAME], "c": [FRAME]}
    assert [error for *_, error in bench.medium.log] == [reported[2].value, ""]


@pytest.mark.requirement("CANP-007", "CANP-013")
def test_frame_hit_in_its_last_bit_is_received_twice():
    """A dominant last bit of EOF is an error for the sender only: the receivers have the frame, and get it
    again.
    """
    bench = first_attempt(BitError("eof", 6))
    bench.scheduler.run_for(MS)
    assert bench.received == {"a": [], "b": [FRAME] * 2, "c": [FRAME] * 2}
    assert bench.counters() == [(7, 0), (0, 0), (0, 0)]
    assert [error for *_, error in bench.medium.log] == ["", "FORM_ERROR", ""]


@pytest.mark.requirement("CANP-033", "CANP-047")
def test_recessive_stuff_bit_read_dominant_in_arbitration_is_excused():
    """That is a stuff error of the sender which does not count; behind the arbitration field it is a bit
    error that does.
    """
    frame = CanFrame(0x003, b"\x00")
    stuff = sorted(image_of(frame).stuff)
    assert stuff[0] < image_of(frame).arbitration_end < stuff[2]
    for number, code, tec in ((0, STUFF, 0), (2, BIT, 8)):
        assert image_of(frame).bits[stuff[number]] == 1
        bench = Bench()
        bench.corrupt_next(BitError("stuff", number))
        bench.ports["a"].send(frame)
        bench.scheduler.run_until(lambda bench=bench: bench.medium.log, MS)
        assert bench.reported[0][1:3] == ("a", code)
        assert bench.ports["a"].tec == tec


@pytest.mark.requirement("CANP-034", "CANP-043", "CANP-044")
def test_stuff_error_of_one_receiver():
    """The receiver that finds it first counts 9, the others 1, because it reads their flags behind its
    own.
    """
    frame = CanFrame(
        0x0F8
    )  # the stuff bit after the last five equal bits of the identifier, read wrongly by b
    bench = Bench()
    bench.corrupt_next(BitError("stuff", 0, ONE))
    bench.ports["a"].send(frame)
    bench.scheduler.run_until(lambda: bench.medium.log, MS)
    assert bench.reported[0][1:3] == ("b", STUFF)
    assert bench.counters() == [(8, 0), (0, 9), (0, 1)]


@pytest.mark.requirement("CANP-041")
@pytest.mark.parametrize("bit", [0, 1])
def test_dominant_bit_in_the_intermission_is_answered_by_an_overload_flag(bit):
    """Overload flag 6, delimiter 8, intermission 3 keep the next frame back, and no counter moves."""
    bench = Bench()
    bench.corrupt_next(BitError("intermission", bit))
    for _ in range(2):
        bench.ports["a"].send(FRAME)
    bench.scheduler.run_for(MS)
    assert bench.counters() == [(0, 0)] * 3
    times = [time_ns // US for time_ns, *_ in bench.medium.log]
    assert times[1] - times[0] == (bit + 1) + 6 + 8 + 3 + LAST + 10
    assert bench.received["b"] == [FRAME] * 2


@pytest.mark.requirement("CANP-027", "CANP-041")
def test_dominant_third_bit_of_the_intermission_is_a_start_of_frame():
    """Who has something to send goes on with the identifier; the frame comes one bit early."""
    bench = Bench()
    bench.corrupt_next(BitError("intermission", 2))
    for _ in range(2):
        bench.ports["a"].send(FRAME)
    bench.scheduler.run_for(MS)
    times = [time_ns // US for time_ns, *_ in bench.medium.log]
    assert times[1] - times[0] == 2 + LAST + 10
    assert bench.counters() == [(0, 0)] * 3


@pytest.mark.requirement("CANP-041")
@pytest.mark.parametrize("count", [0, 1, 2])
def test_slow_receiver_asks_for_overload_frames(count):
    """Each costs 14 bits behind a frame, or 15 with the answer of the others; at most two, and nothing is
    counted.
    """
    bench = Bench()
    bench.ports["b"].set_overload_frames(count)
    for _ in range(2):
        bench.ports["a"].send(FRAME)
    bench.scheduler.run_for(MS)
    times = [time_ns // US for time_ns, *_ in bench.medium.log]
    assert times[1] - times[0] == 3 + LAST + 10 + count * 15
    assert bench.counters() == [(0, 0)] * 3
    assert len(list(bench.history.select(kind="can.overload"))) == 2 * count
    with pytest.raises(BusError, match="0 to 2"):
        bench.ports["b"].set_overload_frames(3)


@pytest.mark.requirement("CANP-050", "CANP-054")
def test_bus_stuck_dominant():
    """The sender counts 8 for the error and 8 for every 8 dominant bits behind its flag, up to bus-off;
    receivers stop at 255.
    """
    bench = Bench()
    a, b, _ = bench.ports.values()
    a.send(FRAME)
    wrong = 30
    while image_of(FRAME).bits[wrong] == 0:
        wrong += 1
    bench.scheduler.at(wrong * US, lambda: bench.medium.hold_level(0))
    bench.scheduler.run_for((wrong + 1) * US)
    assert a.tec == 8
    bench.scheduler.run_for((6 + 7) * US)
    assert a.tec == 8
    bench.scheduler.run_for(1 * US)  # the 14th dominant bit in a row
    assert (a.tec, a.state) == (16, NodeState.ERROR_ACTIVE)
    bench.scheduler.run_for(14 * 8 * US)
    assert (a.tec, a.state) == (128, NodeState.ERROR_PASSIVE)
    bench.scheduler.run_for(16 * 8 * US)
    assert a.state is NodeState.BUS_OFF
    bench.scheduler.run_for(1_000_000 * US)
    assert b.rec == 255
    assert b.state is NodeState.ERROR_PASSIVE
    bench.medium.hold_level(None)
    bench.scheduler.run_for(MS)
    b.send(FRAME)
    bench.scheduler.run_for(MS)
    assert bench.received["c"] == [FRAME]


@pytest.mark.requirement("CANP-054", "CANP-057")
def test_bus_stuck_recessive():
    """Whoever sends reads recessive at SOF: 8 for the error and 8 for each of the flags, until it is passive,
    then bus-off.
    """
    bench = Bench()
    a, b, _ = bench.ports.values()
    bench.medium.hold_level(1)
    a.send(FRAME)
    bench.scheduler.run_for(20 * MS)
    assert a.state is NodeState.BUS_OFF
    assert (b.tec, b.rec) == (0, 0)
    bench.medium.hold_level(None)
    b.send(FRAME)
    bench.scheduler.run_for(MS)
    assert bench.received["c"] == [FRAME]


@pytest.mark.exhaustive
@pytest.mark.requirement("CANP-068")
@pytest.mark.parametrize("rate", [500_000, 250_000])
def test_node_with_a_wrong_bit_rate(rate):
    """It destroys frames of the others until it is error-passive, then it is silent and they get through;
    nobody hears it.
    """
    bench = Bench()
    a, _, c = bench.ports.values()
    c.set_bitrate(rate)
    for number in range(60):
        a.send(CanFrame(0x2AA, bytes([number] * 8)))
    bench.scheduler.run_for(30 * MS)
    assert c.state is NodeState.ERROR_PASSIVE
    assert [frame.data[0] for frame in bench.received["b"]] == list(range(60))
    assert bench.received["c"] == []
    errors = [error for *_, error in bench.medium.log]
    assert any(errors[:5])
    assert not any(errors[-20:])
    c.send(FRAME)
    bench.scheduler.run_for(5 * MS)
    assert FRAME not in bench.received["b"]
    c.set_bitrate(None)
    bench.scheduler.run_for(5 * MS)
    assert FRAME in bench.received["b"]


@pytest.mark.requirement("CANP-068")
def test_slightly_wrong_bit_rate_takes_the_healthy_sender_to_bus_off():
    """A node that is slow enough to send longer flags than the others is not distinguished from them: it
    stays active, the sender pays.
    """
    bench = Bench()
    a, _, c = bench.ports.values()
    c.set_bitrate(800_000)
    a.send(CanFrame(0x2AA, bytes(8)))
    bench.scheduler.run_for(20 * MS)
    assert a.state is NodeState.BUS_OFF
    assert c.state is NodeState.ERROR_ACTIVE
    assert bench.received == {"a": [], "b": [], "c": []}


@pytest.mark.requirement("CANP-030")
def test_one_shot_frames_are_not_repeated():
    """A one-shot frame that loses the arbitration or meets an error is given up, and the log of events says
    why.
    """
    bench = Bench(one_shot=True)
    bench.ports["a"].send(CanFrame(0x100))
    bench.ports["b"].send(CanFrame(0x200))
    bench.scheduler.run_for(MS)
    bench.corrupt_next(BitError())
    bench.ports["a"].send(FRAME)
    bench.scheduler.run_for(MS)
    assert bench.received == {"a": [], "b": [CanFrame(0x100)], "c": [CanFrame(0x100)]}
    lost, failed = bench.history.select(kind="can.given_up")
    assert lost.data == {"port": "b", "can_id": 0x200, "reason": "ARBITRATION_LOST"}
    assert failed.data == {"port": "a", "can_id": 0x2AA, "reason": "BIT_ERROR"}


@pytest.mark.requirement("CANP-006", "CANP-039", "CANP-059")
def test_receivers_that_do_not_acknowledge():
    """They receive nothing while the sender is error-active; its passive flag no longer disturbs them, and
    they get every attempt.
    """
    bench = Bench()
    for name in "bc":
        bench.ports[name].set_acknowledge(False)
    bench.ports["a"].send(FRAME)
    bench.scheduler.run_for(5 * MS)
    a, b, _ = bench.ports.values()
    assert a.tec == 128
    assert b.rec == 0
    assert len(bench.received["b"]) > 5
    for name in "bc":
        bench.ports[name].set_acknowledge(True)
    bench.scheduler.run_for(MS)
    assert a.tec == 127
    assert a.pending == 0


def test_receive_delay_keeps_the_order():
    """Frames are handed over later, in their order, also when the delay is taken back; the other nodes are
    not concerned.
    """
    bench = Bench()
    times = []
    late = bench.medium.attach(
        "late", lambda frame, time_ns: times.append((frame.data[0], time_ns, bench.scheduler.now))
    )
    late.receive_delay_ns = 2 * MS
    for number in range(3):
        bench.ports["a"].send(CanFrame(0x100, bytes([number])))
    bench.scheduler.run_for(MS)
    late.receive_delay_ns = 0
    bench.ports["a"].send(CanFrame(0x100, b"\x03"))
    bench.scheduler.run_for(5 * MS)
    ends = [time_ns for time_ns, *_ in bench.medium.log]
    assert [number for number, _, _ in times] == [0, 1, 2, 3]
    assert [reported for _, reported, _ in times] == [end + 2 * MS for end in ends[:3]] + [ends[2] + 2 * MS]
    assert all(reported == now for _, reported, now in times)
    assert len(bench.received["b"]) == 4
    with pytest.raises(BusError, match="negative"):
        late.receive_delay_ns = -1


@pytest.mark.parametrize(("field", "bit", "text"), [("header", 0, "no field"), ("id", 64, "outside")])
def test_bit_errors_are_checked(field, bit, text):
    """A place that no frame has is refused where it is named."""
    with pytest.raises(BusError, match=text):
        BitError(field, bit)


@pytest.mark.requirement("CANP-001", "CANP-002", "CANP-003", "CANP-005", "CANP-006", "CANP-007", "CANP-008")
@pytest.mark.parametrize("extended", [False, True])
def test_fields_of_a_frame_have_their_lengths(extended):
    """Every field has as many bits as the table of frame formats says, each bit once, in the order of the
    wire.
    """
    frame = CanFrame(0x12345 if extended else 0x123, b"\xff\x00\xff", extended=extended)
    image = image_of(frame)
    lengths = {name: len(image.places[name]) for name in FIELDS}
    stuff = lengths.pop("stuff")
    common = {
        "sof": 1,
        "id": 11,
        "ide": 1,
        "rtr": 1,
        "dlc": 4,
        "data": 24,
        "crc": 15,
        "crc_delimiter": 1,
        "ack_slot": 1,
        "ack_delimiter": 1,
        "eof": 7,
        "intermission": 3,
    }
    own = (
        {"srr": 1, "id_extension": 18, "reserved": 2}
        if extended
        else {"srr": 0, "id_extension": 0, "reserved": 1}
    )
    assert lengths == {**common, **own, **dict.fromkeys(("fdf", "brs", "esi", "stuff_count"), 0)}
    assert len(image.bits) == (54 if extended else 34) + 24 + stuff
    every = sorted(place for places in image.places.values() for place in places)
    assert every == list(range(len(image.bits) + 13))
    plain = [
        place for name in FIELDS if name not in ("stuff", "srr", "ide", "rtr") for place in image.places[name]
    ]
    assert plain == sorted(plain)
