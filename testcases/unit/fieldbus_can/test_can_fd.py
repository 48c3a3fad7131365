"""CAN FD on the virtual segment: duration, both rates, who takes such frames and who destroys them."""

from __future__ import annotations

import random
import re

import can
import pytest

from fieldbus.can import BitError, CanFrame, CanMedium, HookResult, NodeState
from fieldbus.can.bitstream import image_of
from fieldbus.can.export import EPOCH_S, read_log, write_log
from fieldbus.can.frame import FD_LENGTHS
from fieldbus.can.live import LiveSegment
from fieldbus.clock import MS, RealtimeScheduler, S, VirtualScheduler
from fieldbus.errors import BusError, ConfigurationError
from fieldbus.history import History
from hil.logs import read_bus_log

NOMINAL, DATA = 500_000, 2_000_000


class Bench:
    """Two FD nodes and one classical program on a segment."""

    def __init__(self, *, data_bitrate: int | None = DATA) -> None:
        self.scheduler = VirtualScheduler()
        self.history = History(self.scheduler)
        self.medium = CanMedium(
            self.scheduler, bitrate=NOMINAL, data_bitrate=data_bitrate, name="fd", history=self.history
        )
        fd = data_bitrate is not None
        self.received: dict[str, list[tuple[CanFrame, int]]] = {"a": [], "b": [], "classic": []}
        self.a, self.b, self.classic = (
            self.medium.attach(
                name, lambda frame, at, to=heard: to.append((frame, at)), fd=fd and name != "classic"
            )
            for name, heard in self.received.items()
        )

    def run(self, ms: float = 20) -> None:
        self.scheduler.run_for(round(ms * MS))


def expected_ns(frame: CanFrame) -> int:
    """Return the duration without the intermission, by counting characters (CANP-073, CANP-075)."""
    control = f"10{frame.brs:d}|{frame.esi:d}{frame.dlc:04b}"
    if frame.extended:
        text = f"0{frame.can_id >> 18:011b}11{frame.can_id & 0x3FFFF:018b}0{control}"
    else:
        text = f"0{frame.can_id:011b}00{control}"
    text += "".join(f"{byte:08b}" for byte in frame.data)
    wire, run = "", ""
    for index, mark in enumerate(text):
        wire += mark
        if mark == "|":
            continue
        run = run + mark if run[-1:] == mark else mark
        if len(run) == 5 and index + 1 < len(text):
            run = "1" if mark == "0" else "0"
            wire += run
    slow, fast = wire.split("|")
    crc = 17 if len(frame.data) <= 16 else 21
    fast_bits = len(fast) + 4 + crc + -(-(4 + crc) // 4) + 1
    slow_bits = len(slow) + 9
    return slow_bits * S // NOMINAL + fast_bits * S // (DATA if frame.brs else NOMINAL)


def frames(count: int) -> list[CanFrame]:
    rng = random.Random(7)
    made = []
    for _ in range(count):
        length = rng.choice(FD_LENGTHS)
        data = rng.choice((bytes(length), b"\xff" * length, rng.randbytes(length), b"\xf8" * length))
        extended = rng.random() < 0.5
        made.append(
            CanFrame(
                rng.randrange(1 << (29 if extended else 11)),
                data,
                extended=extended,
                fd=True,
                brs=rng.random() < 0.7,
                esi=rng.random() < 0.2,
            )
        )
    return made


@pytest.mark.requirement("CANP-073", "CANP-074", "CANP-075")
def test_frames_have_the_exact_length_of_both_rates():
    """A frame ends after its nominal bits and its data bits, stuff bits of both kinds included, to 2 ns."""
    bench = Bench()
    for frame in frames(120):
        start = bench.scheduler.now
        bench.a.send(frame)
        bench.run(5)
        got, at = bench.received["b"].pop()
        assert got == frame
        assert at - start == pytest.approx(expected_ns(frame), abs=2)


@pytest.mark.requirement("CANP-075")
def test_bit_by_bit_is_as_long_as_whole():
    """Followed bit by bit from its middle on, a frame arrives as it was, at the same time."""
    for frame in frames(25):
        ends = []
        for disturbed in (False, True):
            bench = Bench()
            bench.a.send(frame)
            if disturbed:
                bench.run(0.021)
                bench.medium.flip_bit(["a node that is not there"])
            bench.run(5)
            ((got, at),) = bench.received["b"]
            assert got == frame
            ends.append(at)
        assert ends[0] == pytest.approx(ends[1], abs=2)


@pytest.mark.requirement("CANP-075")
def test_stuff_count_and_fixed_stuff_bits():
    """The CRC field has a fixed stuff bit before every four bits, and counts the others in Gray code."""
    for frame in frames(40):
        image = image_of(frame)
        tail = image.bits[image.data_end :]
        fixed = [index - image.data_end for index in sorted(image.fixed)]
        assert fixed == list(range(0, len(tail), 5))
        assert all(
            tail[at] == 1 - (image.bits[image.data_end - 1] if not at else tail[at - 1]) for at in fixed
        )
        count = len(image.stuff) % 8
        gray = count ^ count >> 1
        assert [image.bits[at] for at in image.places["stuff_count"]] == [
            gray >> 2 & 1, gray >> 1 & 1, gray & 1, f"{gray:b}".count("1") % 2,
        ]  # fmt: skip
        assert len(image.places["crc"]) == (17 if len(frame.data) <= 16 else 21)


def test_programs_that_know_no_fd_acknowledge_and_hear_nothing():
    """A node without `fd` acknowledges a CAN FD frame and does not get it; it cannot send one."""
    bench = Bench()
    bench.b.detach()
    bench.a.send(CanFrame(0x100, bytes(64), fd=True, brs=True))
    bench.run()
    assert [entry[3] for entry in bench.medium.log] == [""]
    assert bench.received["classic"] == []
    bench.a.send(CanFrame(0x100, b"\1"))
    bench.run()
    assert len(bench.received["classic"]) == 1
    with pytest.raises(BusError, match="sends no CAN FD frames"):
        bench.classic.send(CanFrame(0x100, bytes(64), fd=True))


@pytest.mark.requirement("CANP-076")
def test_a_classic_controller_destroys_fd_frames():
    """A controller without CAN FD destroys each frame with a form error, until it is error-passive."""
    bench = Bench()
    bench.classic.set_classic_only(True)
    found = []
    bench.medium.bus_error_listeners.append(
        lambda _at, name, code, _frame, field: found.append((name, field))
    )
    frame = CanFrame(0x100, bytes(12), fd=True, brs=True)
    bench.a.send(frame)
    bench.run(0.08)
    assert found[0] == ("classic", "reserved")  # as it takes FDF
    assert bench.a.tec == 8
    bench.run(20)
    failed = [entry[3] for entry in bench.medium.log[:-1]]
    assert failed == ["FORM_ERROR"] * 15
    assert bench.medium.log[-1][3] == ""
    assert bench.classic.state is NodeState.ERROR_PASSIVE
    assert [got for got, _ in bench.received["b"]] == [frame]


@pytest.mark.requirement("CANP-076")
def test_a_passive_classic_controller_disturbs_nobody():
    """An error-passive controller without CAN FD destroys nothing any more."""
    bench = Bench()
    bench.classic.set_classic_only(True)
    bench.classic.set_error_counters(rec=200)
    bench.a.send(CanFrame(0x100, bytes(range(32)), fd=True, brs=True))
    bench.run(5)
    assert [entry[3] for entry in bench.medium.log] == [""]
    assert len(bench.received["b"]) == 1
    assert bench.received["classic"] == []


@pytest.mark.parametrize(
    "error",
    [
        BitError("fdf", 0), BitError("esi", 0), BitError("dlc", 1), BitError("data", 9),
        BitError("stuff_count", 1), BitError("crc", 2), BitError("stuff", -1), BitError("ack_slot", 0),
        BitError("data", 9, frozenset({"b"})), BitError("crc", 2, frozenset({"b"})),
    ],
    ids=repr,
)  # fmt: skip
def test_bit_errors_in_both_phases(error):
    """A frame with one wrong bit anywhere ends in an error frame, is repeated once and arrives as it was."""
    bench = Bench()
    hits = iter([HookResult.corrupt(1, error)])
    remove = bench.medium.add_hook(lambda *_: next(hits, None))
    frame = CanFrame(0x155, bytes(range(20)), fd=True, brs=True)
    bench.a.send(frame)
    bench.run(20)
    remove()
    assert [bool(entry[3]) for entry in bench.medium.log] == [True, False]
    assert [got for got, _ in bench.received["b"]] == [frame]
    assert bench.a.tec == 7
    bench.a.send(CanFrame(0x55, b"\1"))
    bench.run()
    assert bench.received["b"][-1][0] == CanFrame(0x55, b"\1")


def test_load_counts_data_bits_by_their_rate():
    """The load of the segment is the time that frames occupy, whatever their rate is."""
    bench = Bench()
    frame = CanFrame(0x155, bytes(64), fd=True, brs=True)
    bench.a.send(frame)
    bench.run(1)
    assert bench.medium.bus_load() == pytest.approx((expected_ns(frame) + 3 * S / NOMINAL) / MS, abs=0.002)
    assert bench.medium.bus_load(MS) == pytest.approx(bench.medium.bus_load(), abs=0.002)


def test_an_fd_frame_without_partner_is_repeated():
    """Alone on the segment a sender of CAN FD gets no acknowledge, and becomes error-passive."""
    bench = Bench()
    bench.b.online = bench.classic.online = False
    bench.a.send(CanFrame(0x155, bytes(16), fd=True, brs=True))
    bench.run(20)
    assert {entry[3] for entry in bench.medium.log} == {"ACK_ERROR"}
    assert bench.a.state is NodeState.ERROR_PASSIVE
    bench.b.online = True
    bench.run(20)
    assert len(bench.received["b"]) == 1


@pytest.mark.parametrize(
    ("frame", "says"),
    [
        (CanFrame(0x100, bytes(10), fd=True), "12, 16, 20, 24, 32, 48, 64 bytes, not 10"),
        (CanFrame(0x100, remote=True, fd=True), "no remote frames"),
        (CanFrame(0x800, fd=True), "outside"),
    ],
)
def test_what_is_no_fd_frame_is_refused(frame, says):
    """A length, kind or identifier that CAN FD does not have is refused with what is allowed."""
    with pytest.raises(BusError, match=re.escape(says)):
        Bench().a.send(frame)


def test_a_classic_segment_has_no_fd():
    """Without `data_bitrate` no node and no program gets CAN FD; a data rate below the other is refused."""
    bench = Bench(data_bitrate=None)
    with pytest.raises(ConfigurationError, match="data_bitrate"):
        bench.medium.attach("c", lambda *_: None, fd=True)
    with pytest.raises(BusError, match="CAN FD"):
        bench.medium.inject(CanFrame(0x100, fd=True))
    with pytest.raises(ConfigurationError, match="500000"):
        CanMedium(bench.scheduler, bitrate=NOMINAL, data_bitrate=250_000)


def test_python_can_programs_exchange_fd_messages():
    """`can.Bus(interface="hil", fd=True)` sends and receives CAN FD; one without it hears no such frame."""
    Bench()
    with (
        can.Bus(interface="hil", channel="fd", fd=True, data_bitrate=DATA) as one,
        can.Bus(interface="hil", channel="fd", fd=True) as other,
        can.Bus(interface="hil", channel="fd") as third,
    ):
        sent = can.Message(arbitration_id=0x18DA_00F1, data=bytes(range(48)), is_fd=True, bitrate_switch=True)
        one.send(sent)
        got = other.recv(0.1)
        assert got is not None
        assert got.equals(sent, timestamp_delta=None, check_channel=False, check_direction=False)
        assert third.recv(0.0) is None
        assert one.protocol is can.CanProtocol.CAN_FD
        with pytest.raises(can.CanOperationError, match="CAN FD"):
            third.send(sent)
        with pytest.raises(can.CanInitializationError, match="not at 5000000"):
            can.Bus(interface="hil", channel="fd", fd=True, data_bitrate=5_000_000)


@pytest.mark.parametrize("suffix", [".log", ".asc", ".blf", ".pcap", ".pcapng"])
def test_log_files_keep_fd_frames(tmp_path, suffix):
    """Frames of both kinds come back from every format as they were, with BRS and ESI."""
    bench = Bench()
    sent = [*frames(30), CanFrame(0x181, b"\x37\x02"), CanFrame(0x705, remote=True, dlc=1)]
    for frame in sent:
        bench.a.send(frame)
        bench.run(3)
    path = write_log(bench.medium.log, tmp_path / f"bus{suffix}")
    assert [frame for _, frame in read_log(path, origin_s=EPOCH_S)] == sent
    log = read_bus_log(path)
    (packed,) = log.channels.values()
    assert [frame for _, _, frame, _ in packed] == sent
    assert packed[7][2] == sent[7]
    assert log.fd_frames == 30


def test_a_live_bus_carries_fd():
    """A live segment with `data_bitrate` exchanges CAN FD with other programs, and counts its data bits."""
    scheduler = RealtimeScheduler()
    heard = []
    with (
        can.Bus(interface="virtual", channel="live fd", protocol=can.CanProtocol.CAN_FD) as foreign,
        LiveSegment.open(scheduler, interface="virtual", channel="live fd", fd_bitrate=DATA) as segment,
    ):
        segment.bitrate = NOMINAL
        node = segment.attach("node", lambda frame, _at: heard.append(frame), fd=True)
        segment.attach("classic", lambda frame, _at: heard.append(frame))
        frame = CanFrame(0x123, bytes(range(24)), fd=True, brs=True)
        node.send(frame)
        message = foreign.recv(5.0)
        assert message is not None
        assert (message.is_fd, message.bitrate_switch, bytes(message.data)) == (True, True, frame.data)
        foreign.send(message)
        assert scheduler.run_until(lambda: heard, 5 * S)
        assert heard == [frame]
        assert [entry[2] for entry in segment.log] == [frame, frame]
        assert segment.busy_bits == pytest.approx(2 * (expected_ns(frame) * NOMINAL / S + 3), abs=2)
