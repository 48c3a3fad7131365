"""Load, response times and jitter: calculated ahead, and compared with what the segment does."""

import can
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fieldbus.can import CanFrame, CanMedium, frame_bits, worst_case_bits
from fieldbus.can.analysis import (
    BIT_TIMING,
    PeriodicFrame,
    arrival_statistics,
    arrivals,
    planned_load,
    response_time_ns,
    worst_case_time_ns,
)
from fieldbus.can.export import EPOCH_S, read_log, write_log
from fieldbus.clock import MS, US, S, VirtualScheduler
from fieldbus.errors import BusError

RATES = [1_000_000, 800_000, 500_000, 250_000, 125_000, 50_000, 20_000, 10_000]


def bus_of(traffic, bitrate, *, offsets=None):
    """Return a segment on which every frame of `traffic` has a node of its own, one more that listens, and
    its requests.
    """
    scheduler = VirtualScheduler()
    medium = CanMedium(scheduler, bitrate=bitrate)
    medium.attach("listener", lambda frame, time_ns: None)
    for number, item in enumerate(traffic):
        port = medium.attach(f"n{number}", lambda frame, time_ns: None)
        phase = 0 if offsets is None else offsets[number] % item.period_ns
        scheduler.every(item.period_ns, lambda port=port, item=item: port.send(item.frame), phase_ns=phase)
    return scheduler, medium


@pytest.mark.requirement("CANP-069")
def test_planned_load_of_the_example():
    """Four drives with an RPDO and a TPDO of 8 bytes and SYNC every 2 ms at 1 Mbit/s: 56.8 % at worst."""
    traffic = [PeriodicFrame(CanFrame(0x80), 2 * MS)]
    for node in range(1, 5):
        traffic += [PeriodicFrame(CanFrame(base + node, bytes(8)), 2 * MS) for base in (0x180, 0x200)]
    assert planned_load(traffic, 1_000_000) == pytest.approx(0.5675)


@pytest.mark.requirement("CANP-069")
@pytest.mark.parametrize("bitrate", RATES)
def test_measured_load_is_the_calculated_one(bitrate):
    """Over a common period of all frames the measured load is the sum of exact frame bits over the time, to
    the bit.
    """
    bit = S // bitrate
    traffic = [
        PeriodicFrame(CanFrame(0x80), 1000 * bit),
        PeriodicFrame(CanFrame(0x181, b"\x00\xff\x00\xff"), 2000 * bit),
        PeriodicFrame(CanFrame(0x12345678, bytes(8), extended=True), 4000 * bit),
        PeriodicFrame(CanFrame(0x701, remote=True, dlc=1), 4000 * bit),
    ]
    scheduler, medium = bus_of(traffic, bitrate)
    scheduler.run_for(4000 * bit * 5 - 1)
    busy = 5 * (4 * frame_bits(traffic[0].frame) + 2 * frame_bits(traffic[1].frame))
    busy += 5 * (frame_bits(traffic[2].frame) + frame_bits(traffic[3].frame))
    assert medium.busy_bits == busy
    assert medium.bus_load() == pytest.approx(planned_load(traffic, bitrate, exact=True), rel=1e-6)
    assert medium.bus_load(4000 * bit) == pytest.approx(busy / 5 / 4000, rel=1e-3)


@pytest.mark.requirement("CANP-032")
def test_response_times_worked_out_by_hand():
    """The highest waits for the longest other frame, the lowest for all others; a bus that is too full has no
    answer.
    """
    top, middle, low = (PeriodicFrame(CanFrame(can_id, bytes(8)), 2 * MS) for can_id in (0x10, 0x20, 0x30))
    longest = 135 * US
    assert worst_case_time_ns(top.frame, 1_000_000) == longest
    traffic = [top, middle, low]
    assert response_time_ns(top, traffic, 1_000_000) == 2 * longest
    assert response_time_ns(middle, traffic, 1_000_000) == 3 * longest
    assert response_time_ns(low, traffic, 1_000_000) == 3 * longest
    late = PeriodicFrame(top.frame, 2 * MS, jitter_ns=100 * US)
    assert response_time_ns(late, [late, middle, low], 1_000_000) == 100 * US + 2 * longest
    # A frame of higher priority that comes again while the lower one still waits counts twice.
    often = PeriodicFrame(CanFrame(0x01, bytes(8)), 300 * US)
    assert response_time_ns(low, [often, top, middle, low], 1_000_000) == (2 + 1 + 1 + 1) * longest
    assert response_time_ns(low, [PeriodicFrame(often.frame, 130 * US), low], 1_000_000) is None
    with pytest.raises(BusError, match="not positive"):
        response_time_ns(PeriodicFrame(top.frame, 0), traffic, 1_000_000)


@pytest.mark.exhaustive
@pytest.mark.requirement("CANP-031", "CANP-032")
@given(
    st.lists(
        st.tuples(st.integers(0, 8), st.sampled_from([1, 2, 4, 5]), st.integers(0, 5_000_000)),
        min_size=2,
        max_size=8,
    )
)
def test_no_frame_takes_longer_than_its_worst_case(shapes):
    """Whatever the phases: from request to the end of the intermission no frame takes longer than was
    calculated.
    """
    traffic = [
        PeriodicFrame(CanFrame(0x100 + number, bytes([number]) * length), period * MS)
        for number, (length, period, _) in enumerate(shapes)
    ]
    offsets = [offset for *_, offset in shapes]
    scheduler, medium = bus_of(traffic, 1_000_000, offsets=offsets)
    scheduler.run_for(45 * MS)
    for item, offset in zip(traffic, offsets, strict=True):
        limit = response_time_ns(item, traffic, 1_000_000)
        requests = range(offset % item.period_ns, 40 * MS, item.period_ns)
        ends = [end + 3 * US for end in arrivals(medium.log, item.frame.can_id)]
        assert len(ends) >= len(requests)
        if limit is not None:
            assert max(end - request for request, end in zip(requests, ends, strict=False)) <= limit


@pytest.mark.requirement("CANP-070")
def test_jitter_of_sync_is_that_of_the_frame_in_progress():
    """SYNC comes 0 to one longest frame late; minimum, maximum and deviation are reported, per node and from
    the log alike.
    """
    sync = PeriodicFrame(CanFrame(0x80), 1 * MS)
    other = PeriodicFrame(CanFrame(0x701, b"\x00" * 8), 1 * MS + 7 * US)
    scheduler, medium = bus_of([sync, other], 1_000_000)
    times = []
    medium.attach("drive", lambda frame, time_ns: times.append(time_ns) if frame.can_id == 0x80 else None)
    scheduler.run_for(1000 * MS)
    assert times == arrivals(medium.log, 0x80)
    own = (frame_bits(sync.frame) - 3) * US
    statistics = arrival_statistics(times, sync.period_ns, phase_ns=own)
    assert statistics.arrivals == len(times)
    assert statistics.earliest_ns == 0
    assert 100 * US < statistics.latest_ns <= worst_case_bits(8) * US
    late = [time - number * MS - own for number, time in enumerate(times)]
    assert (min(late), max(late)) == (statistics.earliest_ns, statistics.latest_ns)
    assert statistics.mean_ns == pytest.approx(sum(late) / len(late))
    assert statistics.deviation_ns**2 == pytest.approx(
        sum(x * x for x in late) / len(late) - statistics.mean_ns**2
    )
    assert statistics.longest_ns <= 1 * MS + statistics.latest_ns
    assert arrival_statistics(times, MS).latest_ns == statistics.latest_ns
    with pytest.raises(BusError, match="two arrivals"):
        arrival_statistics([1], MS)


@pytest.mark.requirement(
    "CANP-060", "CANP-061", "CANP-062", "CANP-063", "CANP-064", "CANP-065", "CANP-066", "CANP-067"
)
@pytest.mark.parametrize(
    ("bitrate", "length", "bit_ns", "sample"),
    [
        (1_000_000, 25, 1_000, 0.75),
        (800_000, 50, 1_250, 0.80),
        (500_000, 100, 2_000, 0.875),
        (250_000, 250, 4_000, 0.875),
        (125_000, 500, 8_000, 0.875),
        (50_000, 1000, 20_000, 0.875),
        (20_000, 2500, 50_000, 0.875),
        (10_000, 5000, 100_000, 0.875),
    ],
)
def test_every_rate_of_cia_301_through_the_whole_chain(tmp_path, bitrate, length, bit_ns, sample):
    """Base, extended and remote frames: segment, python-can in and out, log, file and back, with the bit time
    of the rate.
    """
    timing = BIT_TIMING[bitrate]
    assert (timing.bus_length_m, timing.sample_point) == (length, sample)
    assert timing.sample_point_range == ((0.75, 0.90) if bitrate >= 800_000 else (0.85, 0.90))
    assert sorted(BIT_TIMING) == sorted(RATES)
    scheduler = VirtualScheduler()
    medium = CanMedium(scheduler, bitrate=bitrate, name=f"rate{bitrate}")
    frames = [
        CanFrame(0x123, bytes(range(8))),
        CanFrame(0x1234567, b"\x00" * 3, extended=True),
        CanFrame(0x7FF, remote=True, dlc=8),
        CanFrame(0x1FFFFFFF, extended=True, remote=True, dlc=0),
        CanFrame(0x000),
    ]
    with (
        can.Bus(interface="hil", channel=medium, bitrate=bitrate) as sender,
        can.Bus(interface="hil", channel=medium) as receiver,
    ):
        end = 0
        for frame in frames:
            start = scheduler.now
            sender.send(
                can.Message(
                    arbitration_id=frame.can_id,
                    data=None if frame.remote else frame.data,
                    dlc=frame.dlc,
                    is_extended_id=frame.extended,
                    is_remote_frame=frame.remote,
                )
            )
            message = receiver.recv(1.0)
            end = start + (frame_bits(frame) - 3) * bit_ns
            assert scheduler.now == end
            assert message.timestamp == end / S
            assert (message.arbitration_id, message.is_extended_id, message.is_remote_frame, message.dlc) == (
                frame.can_id,
                frame.extended,
                frame.remote,
                frame.dlc,
            )
            scheduler.run_for(3 * bit_ns)
    assert [entry[2] for entry in medium.log] == frames
    for suffix in (".log", ".asc", ".blf"):
        back = read_log(write_log(medium.log, tmp_path / f"bus{suffix}"), origin_s=EPOCH_S)
        assert [frame for _, frame in back] == frames
        assert back[-1][0] == pytest.approx(end / S, abs=2e-6)


@pytest.mark.parametrize(
    "options", [{"is_fd": True}, {"is_fd": True, "bitrate_switch": True}, {"is_fd": True, "data": bytes(64)}]
)
def test_can_fd_messages_are_refused_with_words(options):
    """A CAN FD message on the classical segment is an error that says so, and nothing goes on the wire."""
    scheduler = VirtualScheduler()
    medium = CanMedium(scheduler, name="classical")
    medium.attach("listener", lambda frame, time_ns: None)
    with can.Bus(interface="hil", channel=medium) as bus:
        message = can.Message(arbitration_id=0x123, is_extended_id=False, **{"data": b"\x01", **options})
        with pytest.raises(can.CanOperationError, match="CAN FD messages are not supported"):
            bus.send(message)
        with pytest.raises(ValueError, match="CAN FD messages are not supported"):
            bus.send_periodic(message, 0.01)
    scheduler.run_for(MS)
    assert medium.log == []
    with pytest.raises(can.CanInitializationError, match="CAN FD is not supported"):
        can.Bus(interface="hil", channel=medium, fd=True)
