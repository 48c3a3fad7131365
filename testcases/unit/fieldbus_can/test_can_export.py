"""Bus logs as candump, ASC and BLF files, read back with the readers of python-can."""

from datetime import UTC, datetime

import can
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fieldbus.can import CanFrame, CanMedium, HookResult
from fieldbus.can.export import EPOCH_S, read_log, write_log
from fieldbus.clock import MS, US, S, VirtualScheduler
from fieldbus.errors import BusError, ConfigurationError

LOG = [
    (1_500, "a", CanFrame(0x80), ""),
    (250 * US, "b", CanFrame(0x181, bytes(range(8))), ""),
    (MS, "b", CanFrame(0x181, b"\x01", extended=True), "BIT_ERROR"),
    (MS + 123_457, "a", CanFrame(0x12345678, b"\xff\x00", extended=True), ""),
    (3600 * S + 1_000, "a", CanFrame(0x701, remote=True, dlc=5), ""),
    (3600 * S + 200_000, "a", CanFrame(0x702, remote=True), "ACK_ERROR"),
]
GOOD = [(time_ns, frame) for time_ns, _, frame, error in LOG if not error]
FLOAT_S = 0.12e-6  # distance of neighbouring floats at this epoch
RESOLUTION = {".log": 0.5e-6 + FLOAT_S, ".asc": 0.5e-6 + FLOAT_S, ".blf": FLOAT_S}
SUFFIXES = sorted(RESOLUTION)


@pytest.fixture(params=SUFFIXES)
def path(request, tmp_path):
    return tmp_path / f"bus{request.param}"


def test_frames_come_back_with_their_bench_times(path):
    """Identifiers, formats, data, remote requests and times survive; failed attempts are not frames."""
    assert write_log(LOG, path) == path
    back = read_log(path, origin_s=EPOCH_S)
    assert [frame for _, frame in back] == [frame for _, frame in GOOD]
    for (time_s, _), (time_ns, _) in zip(back, GOOD, strict=True):
        assert abs(time_s - time_ns / S) <= RESOLUTION[path.suffix]


def test_times_relative_to_the_first_frame(path):
    """Without an origin the first frame is at zero, as suits a log whose start nobody knows."""
    write_log(LOG, path)
    back = read_log(path)
    assert back[0][0] == 0.0
    for (time_s, _), (time_ns, _) in zip(back, GOOD, strict=True):
        assert abs(time_s - (time_ns - 1_500) / S) <= 2 * RESOLUTION[path.suffix]


def test_absolute_times_are_on_the_epoch(path):
    """A foreign reader sees the first of January 2000, or the epoch that was asked for."""
    for epoch_s in (EPOCH_S, 1_700_000_000.0):
        write_log(LOG, path, epoch_s=epoch_s)
        options = {"relative_timestamp": False}
        with can.LogReader(path, **options) as reader:
            times = [message.timestamp for message in reader]
        assert times[0] == pytest.approx(epoch_s + 1.5e-6, abs=1e-6)
        assert times[-1] == pytest.approx(epoch_s + 3600.0002, abs=1e-6)
    assert datetime.fromtimestamp(EPOCH_S, UTC).isoformat() == "2000-01-01T00:00:00+00:00"


def test_failed_attempts_are_error_frames(path):
    """Each failed attempt is an error frame for a foreign reader, at its place in the order."""
    write_log(LOG, path)
    with can.LogReader(path) as reader:
        flags = [message.is_error_frame for message in reader]
    assert flags == [bool(error) for *_, error in LOG]


def test_candump_text(tmp_path):
    """The candump file is what `candump -L` writes, with the error class and the DLC of remote frames."""
    path = write_log(LOG, tmp_path / "bus.log", channel="vcan3")
    assert path.read_text().splitlines() == [
        "(946684800.000002) vcan3 080#",
        "(946684800.000250) vcan3 181#0001020304050607",
        "(946684800.001000) vcan3 20000088#0000010000000000",
        "(946684800.001123) vcan3 12345678#FF00",
        "(946688400.000001) vcan3 701#R5",
        "(946688400.000200) vcan3 200000A0#0000001900000000",
    ]


def test_asc_text_has_no_trace_of_today(tmp_path):
    """The same log makes the same ASC file at any time: its dates are those of the epoch."""
    text = write_log(LOG, tmp_path / "bus.asc").read_text()
    assert text.count("2000") == 2 or text.count("1999") == 2  # local time: the header and the trigger block
    assert str(datetime.now(UTC).year) not in text
    assert "1  181             Rx   d 8 00 01 02 03 04 05 06 07" in text
    assert "0.000250" in text


def test_blf_keeps_nanoseconds(tmp_path):
    """In a BLF file the times are whole nanoseconds from the start, untouched by the size of the epoch."""
    log = [(number * 1_000_003 + 7, "a", CanFrame(0x100), "") for number in range(1000)]
    path = write_log(log, tmp_path / "bus.blf")
    reader = can.BLFReader(path)
    assert reader.start_timestamp == EPOCH_S
    reader.start_timestamp = 0.0
    assert [round(message.timestamp * 1e9) for message in reader] == [time_ns for time_ns, *_ in log]


def test_empty_log(path):
    """A bus on which nothing happened makes a file that reads back as nothing."""
    write_log([], path)
    assert read_log(path) == []


def test_dlc_above_8(path):
    """A DLC of 9..15 is 8 data bytes for every other tool (CANP-010)."""
    write_log([(1000, "a", CanFrame(0x100, bytes(8), dlc=15), "")], path)
    assert read_log(path) == [(0.0, CanFrame(0x100, bytes(8)))]


def test_log_of_a_medium(path):
    """The log of a real segment, retransmissions included, is exported as it is."""
    scheduler = VirtualScheduler()
    medium = CanMedium(scheduler)
    a = medium.attach("a", lambda frame, time_ns: None)
    medium.attach("b", lambda frame, time_ns: None)
    remove = medium.add_hook(lambda frame, sender, time_ns: HookResult.corrupt(2))
    a.send(CanFrame(0x100, b"x"))
    scheduler.run_for(MS)
    remove()
    a.send(CanFrame(0x101))
    scheduler.run_for(MS)
    write_log(medium.log, path)
    assert [frame for _, frame in read_log(path)] == [CanFrame(0x100, b"x"), CanFrame(0x101)]
    with can.LogReader(path) as reader:
        assert [message.is_error_frame for message in reader] == [True, True, False, False]


@pytest.mark.exhaustive
@given(
    frames=st.lists(
        st.tuples(
            st.integers(0, 10 * S),
            st.integers(0, 0x7FF),
            st.binary(max_size=8),
            st.booleans(),
        ),
        max_size=20,
    ),
    suffix=st.sampled_from(SUFFIXES),
)
def test_any_log_comes_back(tmp_path_factory, frames, suffix):
    """Whatever frames a log holds, what is read back are the same frames at the same times."""
    log = [
        (time_ns, "a", CanFrame(can_id << 18 if extended else can_id, data, extended=extended), "")
        for time_ns, can_id, data, extended in sorted(frames)
    ]
    path = write_log(log, tmp_path_factory.mktemp("log") / f"bus{suffix}")
    back = read_log(path, origin_s=EPOCH_S)
    assert [frame for _, frame in back] == [frame for _, _, frame, _ in log]
    assert all(
        abs(time_s - time_ns / S) <= RESOLUTION[suffix]
        for (time_s, _), (time_ns, *_) in zip(back, log, strict=True)
    )


def test_foreign_candump_file(tmp_path):
    """A file recorded with can-utils on a machine is read without its error frames; `##` is CAN FD."""
    path = tmp_path / "machine.log"
    path.write_text(
        "(1700000000.000000) can0 181#0102\n"
        "(1700000000.100000) can0 20000088#0000000000000000\n"
        "(1700000000.250000) can0 123##1112233\n"
        "(1700000000.500000) can0 00000701#R\n"
    )
    assert read_log(path) == [
        (0.0, CanFrame(0x181, b"\x01\x02")),
        (0.25, CanFrame(0x123, b"\x11\x22\x33", fd=True, brs=True)),
        (0.5, CanFrame(0x701, extended=True, remote=True)),
    ]


@pytest.mark.parametrize("name", ["short.blf", "garbled.blf", "garbled.log"])
def test_what_is_no_log_is_refused(tmp_path, name):
    """A damaged file is an error that names it, whatever the reader stumbles over."""
    path = write_log(LOG, tmp_path / name)
    path.write_bytes(b"nonsense" if name == "short.blf" else path.read_bytes()[:144] + b"nonsense" * 10)
    with pytest.raises(BusError, match=f"{name} cannot be read as a CAN log"):
        read_log(path)
    with pytest.raises(BusError, match="missing"):
        read_log(tmp_path / "missing.blf")


def test_options_are_checked(tmp_path):
    """An unknown suffix and an epoch that a format would lose are refused before anything is written."""
    with pytest.raises(ConfigurationError, match=r"\.log \(candump\), \.asc"):
        write_log(LOG, tmp_path / "bus.txt")
    for epoch_s in (0.0, 631_151_999.0, 946_684_800.5):
        with pytest.raises(ConfigurationError, match="epoch_s"):
            write_log(LOG, tmp_path / "bus.blf", epoch_s=epoch_s)
    assert list(tmp_path.iterdir()) == []
