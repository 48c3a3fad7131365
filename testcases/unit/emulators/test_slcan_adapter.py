"""The emulated serial-line adapter: protocol, rubbish on the line, and the device on a real
pseudo-terminal.
"""

import os
import time
from contextlib import contextmanager
from itertools import pairwise

import can
import pytest
import serial
from hypothesis import given
from hypothesis import strategies as st

from emulators.adapter import AcceptanceFilter, ChannelState, SlcanAdapter, SlcanDevice, StatusFlag
from fieldbus.can import CanFrame, CanMedium
from fieldbus.can.live import LiveSegment
from fieldbus.clock import MS, RealtimeScheduler, S, VirtualScheduler
from fieldbus.errors import ConfigurationError
from fieldbus.history import History

WAIT = 20 * S
PLENTY = 10_000


class Station:
    """An adapter and the frames that it puts on the bus."""

    def __init__(self, **options):
        self.sent = []
        self.takes = True
        self.adapter = SlcanAdapter(self._transmit, **options)

    def _transmit(self, frame):
        if self.takes:
            self.sent.append(frame)
        return self.takes

    def say(self, *lines):
        """Send command lines and return the answers to all of them."""
        return b"".join(self.adapter.feed(line.encode("latin-1") + b"\r") for line in lines)

    def hear(self, frame, time_ns=0, free=PLENTY):
        return self.adapter.deliver(frame, time_ns, free=free)


@pytest.fixture
def opened():
    station = Station()
    assert station.say("S6", "O") == b"\r\r"
    return station


TRANSMISSIONS = [
    ("t1230", CanFrame(0x123), b"z\r"),
    ("t7FF81122334455667788", CanFrame(0x7FF, bytes.fromhex("1122334455667788")), b"z\r"),
    ("t0012ABcd", CanFrame(0x001, b"\xab\xcd"), b"z\r"),
    ("T000001231FF", CanFrame(0x123, b"\xff", extended=True), b"Z\r"),
    ("T1FFFFFFF0", CanFrame(0x1FFFFFFF, extended=True), b"Z\r"),
    ("r7018", CanFrame(0x701, remote=True, dlc=8), b"z\r"),
    ("R1ABCDEF05", CanFrame(0x1ABCDEF0, remote=True, extended=True, dlc=5), b"Z\r"),
]


@pytest.mark.parametrize(("line", "frame", "answer"), TRANSMISSIONS, ids=lambda value: str(value)[:24])
def test_frames_go_both_ways(opened, line, frame, answer):
    """Every kind of frame is sent as the line says, and comes out as the same line when it is received."""
    assert opened.say(line) == answer
    assert opened.sent == [frame]
    assert opened.hear(frame) == line.upper().replace("T", line[0]).replace("R", line[0]).encode() + b"\r"


@pytest.mark.parametrize(
    "line",
    [
        "t12",
        "t1239",
        "t123",
        "t1231",
        "t12311",
        "t1231AAB",
        "t800112",
        "t12G0",
        "t1231 1",
        "T00000123",
        "T200000000",
        "r12381",
        "R00000123",
        "x1230",
        "S9",
        "SA",
        "S",
        "S66",
        "O1",
        "C0",
        "X2",
        "X",
        "Z2",
        "M1234567",
        "m12345678A",
        "W2",
        "Q3",
        "U7",
        "F1",
        "V1",
        "N1",
        "\xff",
        "t\xff230",
        "s12345",
        "P1",
        "t1230" + "0" * 100,
    ],
)
def test_what_is_wrong_is_answered_with_bell(opened, line):
    """Wrong digits, lengths, identifiers and unknown commands get BELL, send nothing and are counted."""
    assert opened.say(line) == b"\a"
    assert opened.sent == []
    assert opened.adapter.rejected == 1
    assert opened.adapter.state is ChannelState.OPEN
    assert opened.say("t1230") == b"z\r"


def test_commands_belong_to_a_state_of_the_channel():
    """What configures is taken while closed only, what sends or asks while open only; open needs a bit
    rate.
    """
    station = Station()
    configuring = ("S4", "s031C", "X1", "Z0", "W0", "M00000000", "mFFFFFFFF", "U1", "L", "O")
    working = ("C", "F", "t1230")
    assert station.say("O", "L") == b"\a\a"
    assert station.say(*working) == b"\a" * 3
    assert station.say("S6", "O") == b"\r\r"
    assert station.say(*configuring) == b"\a" * len(configuring)
    assert station.say("F", "t1230", "C") == b"F00\rz\r\r"
    assert station.say("C") == b"\a"
    assert station.say("S4", "X1", "Z0", "W0", "M00000000", "mFFFFFFFF", "U1") == b"\r" * 7
    assert station.say("L", "t1230", "r1230", "Q1") == b"\r\a\a\r"
    assert station.hear(CanFrame(0x10)) == b"t0100\r"


def test_version_and_serial_number_are_always_reported():
    """V and N answer in every state."""
    station = Station(version="1013", serial_number="A12B")
    assert station.say("V", "N") == b"V1013\rNA12B\r"
    assert station.say("S8", "O", "V", "N") == b"\r\rV1013\rNA12B\r"


@pytest.mark.parametrize(
    ("registers", "bitrate"), [("0014", 1_000_000), ("001C", 500_000), ("031C", 125_000)]
)
def test_bit_rate_by_registers(registers, bitrate):
    """`s` sets the bit rate by the timing registers of the controller at 16 MHz."""
    station = Station(bitrate=bitrate)
    assert station.say(f"s{registers}", "O", "t1230") == b"\r\rz\r"
    assert station.adapter.channel_bitrate == bitrate
    assert station.sent == [CanFrame(0x123)]


def test_wrong_bit_rate_hears_and_sends_nothing():
    """At another bit rate nothing is understood: flags tell of bus errors, frames get stuck until the queue
    is full.
    """
    station = Station(bitrate=1_000_000)
    station.say("S6", "O")
    assert station.hear(CanFrame(0x100)) == b""
    assert station.say("F", "F") == b"F80\rF00\r"
    assert station.say(*["t1230"] * 9) == b"z\r" * 8 + b"\a"
    assert station.sent == []
    flags = StatusFlag.BUS_ERROR | StatusFlag.PASSIVE | StatusFlag.WARNING | StatusFlag.TRANSMIT_FULL
    assert station.adapter.status == flags
    assert station.say("C", "S8", "O", "t1230") == b"\r\r\rz\r"
    assert station.sent == [CanFrame(0x123)]


def test_polling():
    """Without auto-poll frames wait: P gives one, A gives all and says so, an overflow is flagged once
    read.
    """
    station = Station()
    assert station.say("P", "X0", "S6", "O", "P", "A") == b"\a\r\r\r\rA\r"
    for number in range(3):
        assert station.hear(CanFrame(0x100 + number)) == b""
    assert station.say("P", "A", "P", "t1230") == b"t1000\r" + b"t1010\rt1020\rA\r" + b"\r" + b"\r"
    for number in range(40):
        station.hear(CanFrame(number))
    assert station.say("F", "F") == b"F09\rF00\r"
    assert station.say("A").count(b"t") == 32
    station.say("C", "X1", "O")
    assert station.say("P", "A") == b"\a\a"


def test_overrun_of_the_line():
    """A frame for which the line has no room is lost and flagged: never a piece of it."""
    station = Station()
    station.say("S6", "O")
    frame = CanFrame(0x123, bytes(8))
    assert station.hear(frame, free=21) == b""
    assert station.hear(frame, free=22) == b"t12380000000000000000\r"
    assert station.say("F") == b"F09\r"


def test_transmit_queue_full(opened):
    """A frame that the bus does not take is answered with BELL and flagged."""
    opened.takes = False
    assert opened.say("t1230", "F") == b"\aF02\r"
    opened.takes = True
    assert opened.say("t1230", "F") == b"z\rF00\r"


def test_time_stamps():
    """With Z1 every frame carries milliseconds, which wrap after a minute."""
    station = Station()
    station.say("Z1", "S6", "O")
    assert station.hear(CanFrame(0x123, b"\x01"), 1_234 * MS) == b"t123101" + b"04D2\r"
    assert station.hear(CanFrame(0x123, remote=True, dlc=2), 60_001 * MS) == b"r1232" + b"0001\r"


FILTERS = [
    # code, mask, single, frame, taken
    (0x00000000, 0xFFFFFFFF, False, CanFrame(0x123), True),
    (0x24600000, 0x001FFFFF, True, CanFrame(0x123), True),
    (0x24600000, 0x001FFFFF, True, CanFrame(0x122), False),
    (0x24600000, 0x000FFFFF, True, CanFrame(0x123, remote=True), False),
    (0x24601200, 0x001F00FF, True, CanFrame(0x123, b"\x12\x77"), True),
    (0x24601200, 0x001F00FF, True, CanFrame(0x123, b"\x13"), False),
    (0x24601200, 0x001F00FF, True, CanFrame(0x123), True),  # no byte, nothing to compare
    (0x091A2B38, 0x00000007, True, CanFrame(0x01234567, extended=True), True),
    (0x091A2B38, 0x00000007, True, CanFrame(0x01234566, extended=True), False),
    (0x091A2B38, 0x00000003, True, CanFrame(0x01234567, extended=True, remote=True), False),
    (0x24602480, 0x001F001F, False, CanFrame(0x123), True),
    (0x24602480, 0x001F001F, False, CanFrame(0x124), True),
    (0x24602480, 0x001F001F, False, CanFrame(0x125), False),
    (0x24610002, 0x0010FFF0, False, CanFrame(0x123, b"\x12"), True),
    (0x24610002, 0x0010FFF0, False, CanFrame(0x123, b"\x13"), True),  # the second pattern takes everything
    (0x2461FFE2, 0x0010FFF0 & 0xFFFF0010, False, CanFrame(0x123, b"\x13"), False),
    (0x091A0000, 0x00000000, False, CanFrame(0x01234567, extended=True), True),
    (0x091A0000, 0x00000000, False, CanFrame(0x01235567, extended=True), True),
    (0x091A0000, 0x00000000, False, CanFrame(0x01434567, extended=True), False),
    (0x091A0000, 0x00000000, False, CanFrame(0x00001000, extended=True), True),  # the second pattern: zero
]


@pytest.mark.parametrize(("code", "mask", "single", "frame", "taken"), FILTERS)
def test_acceptance_filter(code, mask, single, frame, taken):
    """Code and mask pick frames as the registers of the controller do, in either mode."""
    station = Station()
    station.say(f"W{int(single)}", f"M{code:08X}", f"m{mask:08X}", "S6", "O")
    assert bool(station.hear(frame)) is taken
    unfiltered = AcceptanceFilter()
    assert unfiltered.accepts(frame)


@pytest.mark.exhaustive
@given(data=st.binary(max_size=400), cuts=st.lists(st.integers(0, 400), max_size=8))
def test_rubbish_never_breaks_the_adapter(data, cuts):
    """Whatever comes in, in whatever pieces: the answers are the same, nothing wrong is sent, and it still
    works.
    """
    whole, pieces = Station(), Station()
    for station in (whole, pieces):
        station.say("S6", "O")
    answers = whole.adapter.feed(data)
    edges = sorted({0, len(data), *(cut for cut in cuts if cut < len(data))})
    in_pieces = b"".join(pieces.adapter.feed(data[first:last]) for first, last in pairwise(edges))
    assert in_pieces == answers
    assert pieces.sent == whole.sent
    for frame in whole.sent:
        assert frame.can_id <= (0x1FFFFFFF if frame.extended else 0x7FF)
        assert len(frame.data) <= 8
    # CR ends whatever was begun; then the adapter is as good as new
    whole.adapter.feed(b"\r")
    whole.say("C")
    assert whole.say("S8", "O", "t1230")[-2:] == (b"z\r" if whole.adapter.auto_poll else b"\r\r")[-2:]
    assert whole.sent[-1] == CanFrame(0x123)


COMMANDS = st.sampled_from(
    [
        "S6",
        "S8",
        "O",
        "L",
        "C",
        "t12321122",
        "T000001230",
        "r1231",
        "F",
        "P",
        "A",
        "X0",
        "X1",
        "Z0",
        "Z1",
        "V",
        "N",
        "",
        "t",
    ]
)


@pytest.mark.exhaustive
@given(program=st.lists(COMMANDS | st.just("frame"), max_size=60))
def test_every_command_gets_one_answer(program):
    """In any order of commands and frames: one answer per command, ended by CR or BELL, and states as the
    commands say.
    """
    station = Station()
    for step in program:
        if step == "frame":
            output = station.hear(CanFrame(0x123, b"\x55"))
            assert output == b"" or (output.startswith(b"t123155") and output.endswith(b"\r"))
            assert not (output and station.adapter.state is ChannelState.CLOSED)
            continue
        before = station.adapter.state
        answer = station.say(step)
        assert answer[-1:] in (b"\r", b"\a")
        assert step == "A" or answer.count(b"\r") + answer.count(b"\a") == 1
        if answer == b"\a":
            assert station.adapter.state is before
        elif step in ("O", "L", "C"):
            assert (
                station.adapter.state
                is {
                    "O": ChannelState.OPEN,
                    "L": ChannelState.LISTENING,
                    "C": ChannelState.CLOSED,
                }[step]
            )


# -- on a pseudo-terminal ------------------------------------------------------------------------------


class Desk:
    """The device on a live segment, and a foreign node on the same bus."""

    def __init__(self, channel, **options):
        self.scheduler = RealtimeScheduler()
        self.scheduler.every(5 * MS, lambda: None)  # conditions are looked at after events
        self.history = History(self.scheduler)
        self.segment = LiveSegment.open(
            self.scheduler, interface="virtual", channel=channel, name="hub", history=self.history
        )
        self.device = SlcanDevice(self.segment, history=self.history, **options)
        self.received = []
        self.node = self.segment.attach("node", lambda frame, _time_ns: self.received.append(frame))

    def until(self, condition):
        assert self.scheduler.run_until(condition, WAIT)

    def close(self):
        self.device.close()
        self.segment.close()


@contextmanager
def desk_for(request, **options):
    desk = Desk(request.node.name, **options)
    try:
        yield desk
    finally:
        desk.close()


def test_a_serial_program_talks_to_it(request):
    """With pyserial alone: commands in fragments and several in one write, answers in order, frames in
    between.
    """
    with desk_for(request) as desk, serial.Serial(desk.device.path, 115200, timeout=0) as port:
        said = bytearray()

        def heard(expected):
            said.extend(port.read(4096))
            return expected in said

        for piece in (b"V", b"\r", b"S", b"6\rO", b"\rt12", b"32112", b"2\rF\r"):
            port.write(piece)
            desk.scheduler.run_for(2 * MS)
        desk.until(lambda: heard(b"V1013\r\r\rz\rF00\r"))
        # The adapter answers when it has taken the frame, which then still has to cross the segment.
        desk.until(lambda: desk.received == [CanFrame(0x123, b"\x11\x22")])
        desk.node.send(CanFrame(0x181, b"\x01\x02\x03"))
        desk.until(lambda: heard(b"t1813010203\r"))
        port.write(b"C\r")
        desk.until(lambda: desk.device.adapter.state is ChannelState.CLOSED)
        assert [event.data["state"] for event in desk.history.select(kind="adapter.state")] == [
            "open",
            "closed",
        ]


@pytest.mark.exhaustive
def test_a_program_that_does_not_read_loses_frames_and_wedges_nothing(request):
    """When nobody reads the line, frames are lost and reported once; whoever comes then can work at once."""
    with desk_for(request) as desk:
        with serial.Serial(desk.device.path) as port:
            port.write(b"S6\rO\r")
            desk.until(lambda: desk.device.adapter.state is ChannelState.OPEN)
            for number in range(2000):
                desk.node.send(CanFrame(0x100 + number % 256, bytes(8)))
            desk.until(lambda: any(desk.history.select(kind="adapter.overrun")))
        assert len([*desk.history.select(kind="adapter.overrun")]) == 1
        with can.Bus(
            interface="slcan", channel=desk.device.path, bitrate=500_000, sleep_after_open=0.0
        ) as bus:
            desk.until(lambda: desk.device.adapter.state is ChannelState.OPEN)
            desk.scheduler.run_for(50 * MS)
            bus.flush()
            desk.received.clear()
            bus.send(can.Message(arbitration_id=0x123, is_extended_id=False))
            desk.until(lambda: CanFrame(0x123) in desk.received)


def test_rubbish_on_the_line_is_survived_by_both_ends(request):
    """Line noise into the adapter and out of it: commands and frames behind it arrive."""
    with desk_for(request) as desk:
        received = []
        place = {
            "interface": "slcan",
            "channel": desk.device.path,
            "bitrate": 500_000,
            "sleep_after_open": 0.0,
        }
        with LiveSegment.open(desk.scheduler, name="near", history=desk.history, **place) as near:
            port = near.attach("near", lambda frame, _time_ns: received.append(frame))
            desk.until(lambda: desk.device.adapter.state is ChannelState.OPEN)
            for noise in (b"\xff\xfe\r", b"tzz\r", b"t\r", b"T0000012\r", b"\a\a\a", b"t1239\r"):
                os.write(desk.device._line._master, noise)  # what the program hears
                near.sides[0].bus.serialPortOrig.write(noise)  # what the adapter hears
                time.sleep(0.02)
            desk.until(lambda: desk.device.adapter.rejected >= 5)
            desk.scheduler.run_for(300 * MS)
            desk.node.send(CanFrame(0x181, b"\x01"))
            desk.until(lambda: CanFrame(0x181, b"\x01") in received)
            port.send(CanFrame(0x201, b"\x02"))
            desk.until(lambda: CanFrame(0x201, b"\x02") in desk.received)
            assert near.ignored["garbled"] >= 1
            assert not near.down


def test_listen_only(request):
    """A program that opens the channel to listen hears, and cannot send."""
    with desk_for(request) as desk:
        place = {
            "channel": desk.device.path,
            "bitrate": 500_000,
            "sleep_after_open": 0.0,
            "listen_only": True,
        }
        with can.Bus(interface="slcan", **place) as bus:
            desk.until(lambda: desk.device.adapter.state is ChannelState.LISTENING)
            bus.send(can.Message(arbitration_id=0x123, is_extended_id=False))
            desk.until(lambda: desk.device.adapter.rejected > 0)
            assert desk.received == []
            desk.node.send(CanFrame(0x181))
            heard = []
            desk.until(lambda: heard.append(bus.recv(0)) or any(heard))


def test_the_device_needs_real_time():
    """A serial line has no virtual time: a segment in virtual time is refused."""
    with pytest.raises(ConfigurationError, match="a segment in real time"):
        SlcanDevice(CanMedium(VirtualScheduler(), name="virtual"))
