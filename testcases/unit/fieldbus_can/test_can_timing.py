"""Length and rank of CAN frames against a reference that counts bit by bit."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from fieldbus.can.frame import CanFrame
from fieldbus.can.timing import (
    INTERMISSION_BITS,
    TAIL_BITS,
    FrameMaker,
    arbitration_key,
    frame_bits,
    frame_time_ns,
    note_timing,
    timing_of,
    wire_bits,
    worst_case_bits,
)
from fieldbus.errors import BusError

pytestmark = pytest.mark.exhaustive


def bits_of(value, width):
    return [value >> shift & 1 for shift in range(width - 1, -1, -1)]


def arbitration_field(frame):
    if frame.extended:
        return [
            *bits_of(frame.can_id >> 18, 11),
            1,
            1,
            *bits_of(frame.can_id & 0x3FFFF, 18),
            int(frame.remote),
        ]
    return [*bits_of(frame.can_id, 11), int(frame.remote)]


def unstuffed(frame):
    """Return the bits from SOF to the end of the data."""
    reserved = [0, 0]  # r1 r0 or IDE r0
    bits = [0, *arbitration_field(frame), *reserved, *bits_of(frame.dlc, 4)]
    for byte in frame.data:
        bits += bits_of(byte, 8)
    return bits


def crc15(bits):
    crc = 0
    for bit in bits:
        feedback = bit ^ crc >> 14
        crc = crc << 1 & 0x7FFF
        if feedback:
            crc ^= 0x4599
    return crc


def stuff_count(bits):
    run = 0
    last = None
    count = 0
    for bit in bits:
        if bit == last:
            run += 1
        else:
            run = 1
            last = bit
        if run == 5:
            count += 1
            last = 1 - bit
            run = 1
    return count


def reference_bits(frame):
    """Return the length by the formula of the standard with the stuff bits of the real bit string."""
    body = unstuffed(frame)
    stuffed_region = body + bits_of(crc15(body), 15)
    return (67 if frame.extended else 47) + 8 * len(frame.data) + stuff_count(stuffed_region)


def reference_wire(frame):
    body = unstuffed(frame)
    wire = []
    for bit in body + bits_of(crc15(body), 15):
        wire.append(bit)
        if (
            len(wire) >= 5 and len(set(wire[-5:])) == 1
        ):  # whether one of the five was inserted does not matter
            wire.append(1 - bit)
    return wire


@st.composite
def frames(draw):
    extended = draw(st.booleans())
    remote = draw(st.booleans())
    # Few distinct bytes and identifiers with long runs: those are the ones with stuff bits.
    can_id = draw(
        st.one_of(st.integers(0, 0x1FFFFFFF if extended else 0x7FF), st.sampled_from([0, 0x7FF, 0x400, 0x0F]))
    )
    if remote:
        return CanFrame(can_id, extended=extended, remote=True, dlc=draw(st.integers(0, 15)))
    byte = st.one_of(st.integers(0, 255), st.sampled_from([0x00, 0xFF, 0x0F, 0xF0, 0x1F, 0xF8, 0xC1, 0x3E]))
    data = bytes(draw(st.lists(byte, max_size=8)))
    dlc = draw(st.integers(8, 15)) if len(data) == 8 else len(data)
    return CanFrame(can_id, data, extended=extended, dlc=dlc)


@pytest.mark.requirement(
    "CANP-001", "CANP-002", "CANP-003", "CANP-004", "CANP-009", "CANP-012", "CANP-014", "CANP-015", "CANP-017"
)
@given(frames())
def test_length_equals_a_count_bit_by_bit(frame):
    """The tables give for every frame what counting over its real bit string gives."""
    assert frame_bits(frame) == reference_bits(frame)


@pytest.mark.requirement("CANP-014")
@given(frames())
def test_wire_bits_are_the_stuffed_string(frame):
    """The bit string has no six equal bits in a row, and is the unstuffed one when the stuff bits are taken
    out.
    """
    wire = wire_bits(frame)
    assert wire == reference_wire(frame)
    assert all(len(set(wire[start : start + 6])) > 1 for start in range(len(wire) - 5))
    assert len(wire) + TAIL_BITS + INTERMISSION_BITS == frame_bits(frame)


def test_reference_checksum_has_the_published_check_value():
    """The reference of this file gives the check value that the catalogues of CRCs list for CRC-15/CAN."""
    assert crc15([bit for byte in b"123456789" for bit in bits_of(byte, 8)]) == 0x059E


@pytest.mark.requirement(
    "CANP-018", "CANP-019", "CANP-020", "CANP-021", "CANP-022", "CANP-023", "CANP-024", "CANP-025", "CANP-026"
)
@pytest.mark.parametrize(
    ("length", "shortest", "longest", "shortest_extended", "longest_extended"),
    [
        (0, 47, 55, 67, 80),
        (1, 55, 65, 75, 90),
        (2, 63, 75, 83, 100),
        (3, 71, 85, 91, 110),
        (4, 79, 95, 99, 120),
        (5, 87, 105, 107, 130),
        (6, 95, 115, 115, 140),
        (7, 103, 125, 123, 150),
        (8, 111, 135, 131, 160),
    ],
)
def test_table_of_bounds(length, shortest, longest, shortest_extended, longest_extended):
    """The bounds of the table are those of the formula, and thousands of frames of each length keep within
    them.
    """
    assert worst_case_bits(length) == longest
    assert worst_case_bits(length, extended=True) == longest_extended
    seen = {
        frame_bits(CanFrame(can_id, bytes([byte]) * length))
        for can_id in range(0, 0x800, 17)
        for byte in range(256)
    }
    assert shortest <= min(seen) <= shortest + 3
    assert max(seen) <= longest
    seen_extended = {
        frame_bits(CanFrame(can_id, bytes([byte]) * length, extended=True))
        for can_id in range(0, 0x20000000, 0x20000000 // 61)
        for byte in range(256)
    }
    assert shortest_extended <= min(seen_extended) <= shortest_extended + 3
    assert max(seen_extended) <= longest_extended


@pytest.mark.requirement("CANP-016")
@given(frames())
def test_worst_case_is_never_exceeded(frame):
    """No frame has more stuff bits than floor((g - 1) / 4)."""
    assert frame_bits(frame) <= worst_case_bits(len(frame.data), extended=frame.extended)


@pytest.mark.parametrize("dlc", range(9, 16))
def test_dlc_above_8_means_8_bytes(dlc):
    """A DLC of 9..15 goes with 8 data bytes, and with nothing else."""
    assert frame_bits(CanFrame(1, bytes(8), dlc=dlc)) == reference_bits(CanFrame(1, bytes(8), dlc=dlc))
    with pytest.raises(BusError, match="8 data bytes, not 7"):
        frame_bits(CanFrame(1, bytes(7), dlc=dlc))


@pytest.mark.requirement("CANP-027", "CANP-028")
@given(frames(), frames())
def test_rank_is_the_first_differing_bit_of_the_arbitration_field(one, other):
    """Whoever sends the dominant bit at the first difference of the arbitration fields ranks higher; equal
    fields tie.
    """
    first = [
        *arbitration_field(one),
        *([] if one.extended else [0]),
    ]  # IDE of a standard frame follows its RTR
    second = [*arbitration_field(other), *([] if other.extended else [0])]
    difference = next(((a, b) for a, b in zip(first, second, strict=False) if a != b), None)
    keys = arbitration_key(one), arbitration_key(other)
    if difference is None:
        assert keys[0] == keys[1]
        assert (one.can_id, one.extended, one.remote) == (other.can_id, other.extended, other.remote)
    else:
        assert (keys[0] < keys[1]) == (difference[0] < difference[1])
        assert keys[0] != keys[1]


@pytest.mark.requirement("CANP-028")
def test_data_beats_remote_and_standard_beats_extended():
    """With the same 11 leading bits the order is: standard data, standard remote, extended data, extended
    remote.
    """
    frames = [
        CanFrame(0x123),
        CanFrame(0x123, remote=True),
        CanFrame(0x123 << 18, extended=True),
        CanFrame(0x123 << 18, extended=True, remote=True),
    ]
    keys = [arbitration_key(frame) for frame in frames]
    assert keys == sorted(keys)
    assert len(set(keys)) == 4
    assert arbitration_key(CanFrame(0x122 << 18 | 0x3FFFF, extended=True)) < keys[0]


@pytest.mark.parametrize(
    ("frame", "message"),
    [
        (CanFrame(0x800), "800h is outside 0..7FFh"),
        (CanFrame(-1), "outside 0..7FFh"),
        (CanFrame(0x20000000, extended=True), "outside 0..1FFFFFFFh"),
        (CanFrame(1, dlc=16), "DLC 16"),
        (CanFrame(1, bytes(9)), "8 data bytes, not 9"),
        (CanFrame(1, b"ab", dlc=3), "3 data bytes, not 2"),
        (CanFrame(1, b"a", remote=True), "remote frame with DLC 1 carries 0 data bytes, not 1"),
    ],
)
def test_impossible_frames_are_refused(frame, message):
    """A frame that cannot exist on a classical bus is an error that says what is wrong with it."""
    with pytest.raises(BusError, match=message):
        frame_bits(frame)


@pytest.mark.parametrize("bitrate", [1_000_000, 500_000, 125_000, 83_333])
def test_frame_time(bitrate):
    """The time on the wire is length over bit rate, rounded down to a nanosecond."""
    frame = CanFrame(0x181, bytes(8))
    assert frame_time_ns(frame, bitrate) == reference_bits(frame) * 1_000_000_000 // bitrate


def test_cache_is_bounded():
    """However many different frames pass, the memory for their lengths stays bounded."""
    for value in range(3000):
        timing_of(0x181, value.to_bytes(4, "big"), False, False, 4)
    information = timing_of.cache_info()
    assert information.currsize <= information.maxsize < 10_000


@given(can_id=st.integers(0, 0x7FF), payloads=st.lists(st.binary(max_size=8), max_size=5))
def test_a_frame_maker_makes_what_a_frame_is(can_id, payloads):
    """Frames of one identifier that are made in a row are as long on the wire as any, and kept while the data
    stay.
    """
    maker = FrameMaker(can_id)
    for payload in payloads:
        frame = maker.make(payload)
        assert frame == CanFrame(can_id, payload)
        if payload:  # the empty frame is timed when it is sent
            assert (frame.key, frame.bits) == timing_of(can_id, payload, False, False, len(payload))
        assert note_timing(CanFrame(can_id, payload)) == note_timing(frame)
        assert maker.make(bytes(payload)) is frame
