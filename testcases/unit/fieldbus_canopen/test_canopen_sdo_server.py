"""SDO server of the slave, frame by frame."""

from __future__ import annotations

from binascii import crc_hqx

import pytest

from fieldbus.canopen import AbortCode, SdoAbort
from fieldbus.canopen.sdo_server import SdoServer
from fieldbus.clock import MS

REQUEST = 0x605
ANSWER = 0x585


def head(command: int, index: int, sub: int = 0) -> bytes:
    return bytes((command,)) + index.to_bytes(2, "little") + bytes((sub,))


def size(command: int, index: int, count: int, sub: int = 0) -> bytes:
    return head(command, index, sub) + count.to_bytes(4, "little")


def abort_of(answer: bytes) -> int:
    assert answer[0] == 0x80, answer.hex()
    return int.from_bytes(answer[4:], "little")


@pytest.mark.requirement("C301-057")
@pytest.mark.parametrize(
    ("command", "index", "value", "count"),
    [
        (0x2F, 0x6060, 0xFE, 1),
        (0x2B, 0x6040, 0x1234, 2),
        (0x27, 0x2006, 0xFFFFFE, 3),
        (0x23, 0x6083, 0x89ABCDEF, 4),
    ],
)
def test_expedited_download_of_each_length(bench, command, index, value, count):
    """An expedited download of 1 to 4 bytes is confirmed with 60h and read back with the same bytes."""
    assert bench.sdo(head(command, index) + value.to_bytes(4, "little")) == head(0x60, index) + bytes(4)
    answer = bench.sdo(head(0x40, index) + bytes(4))
    assert answer == head(0x43 | (4 - count) << 2, index) + value.to_bytes(4, "little")


@pytest.mark.requirement("C301-057")
def test_expedited_download_without_size_takes_the_size_of_the_object(bench):
    """With 22h the server takes as many bytes as the object has and ignores the others."""
    assert bench.sdo(head(0x22, 0x6040) + b"\x34\x12\xff\xff")[0] == 0x60
    assert bench.slave.get(0x6040) == 0x1234


def test_signed_values_are_stored_with_their_sign(bench):
    """The device sees negative numbers for signed types."""
    assert bench.write(0x60FF, 0, -5, 4) == 0
    assert bench.slave.get(0x60FF) == -5


@pytest.mark.requirement("C301-058", "C301-059")
def test_segmented_download_alternates_the_toggle_bit(bench):
    """A segmented download of a string is confirmed segment by segment with the toggle bit of the request."""
    text = b"commissioned by test"
    assert bench.sdo(size(0x21, 0x2001, len(text))) == head(0x60, 0x2001) + bytes(4)
    assert bench.sdo(b"\x00" + text[:7]) == b"\x20" + bytes(7)
    assert bench.sdo(b"\x10" + text[7:14]) == b"\x30" + bytes(7)
    assert bench.sdo(b"\x03" + text[14:20] + b"\0") == b"\x20" + bytes(7)
    assert bench.slave.get(0x2001) == text.decode()


@pytest.mark.requirement("C301-058")
def test_segmented_download_without_size(bench):
    """The size of a segmented download need not be announced."""
    assert bench.sdo(head(0x20, 0x2001) + bytes(4))[0] == 0x60
    assert bench.sdo(b"\x0bab" + bytes(5))[0] == 0x20
    assert bench.slave.get(0x2001) == "ab"


@pytest.mark.requirement("C301-060", "C301-061")
def test_segmented_upload(bench):
    """A string of more than four bytes comes in segments, the last one marked and padded."""
    name = "Emulated_servo_drive"
    assert bench.sdo(head(0x40, 0x1008) + bytes(4)) == size(0x41, 0x1008, len(name))
    assert bench.sdo(b"\x60" + bytes(7)) == b"\x00" + name[:7].encode()
    assert bench.sdo(b"\x70" + bytes(7)) == b"\x10" + name[7:14].encode()
    assert bench.sdo(b"\x60" + bytes(7)) == b"\x03" + name[14:].encode() + b"\0"


@pytest.mark.requirement("C301-060")
def test_short_string_is_uploaded_expedited(bench):
    """A string of up to four bytes comes with the answer itself."""
    assert bench.sdo(head(0x40, 0x1009) + bytes(4)) == head(0x4B, 0x1009) + b"A1\0\0"


def test_empty_string_is_uploaded_as_no_bytes(bench):
    """An empty string is answered as a segmented transfer of size zero."""
    assert bench.sdo(head(0x40, 0x2001) + bytes(4)) == size(0x41, 0x2001, 0)
    assert bench.sdo(b"\x60" + bytes(7)) == b"\x0f" + bytes(7)


@pytest.mark.requirement("C301-072", "C301-077")
@pytest.mark.parametrize("upload", [False, True])
def test_wrong_toggle_aborts(bench, upload):
    """A repeated toggle bit ends the transfer with 05030000h, and the next segment finds none."""
    if upload:
        bench.sdo(head(0x40, 0x1008) + bytes(4))
        bench.sdo(b"\x60" + bytes(7))
        again = b"\x60" + bytes(7)
    else:
        bench.sdo(size(0x21, 0x2001, 20))
        bench.sdo(bytes(8))
        again = bytes(8)
    answer = bench.sdo(again)
    assert abort_of(answer) == AbortCode.TOGGLE
    assert answer[1:4] == head(0, 0x1008 if upload else 0x2001)[1:]
    assert abort_of(bench.sdo(again)) == AbortCode.COMMAND


@pytest.mark.requirement("C301-072", "C301-079")
@pytest.mark.parametrize("command", [0xE0, 0xFF, 0x60, 0x70, 0x00, 0x10, 0xA1, 0xA2, 0xA3, 0xC1])
def test_command_without_meaning_is_aborted(bench, command):
    """An unknown command, or one that belongs to no running transfer, is aborted with 05040001h."""
    assert abort_of(bench.sdo(head(command, 0x6040) + bytes(4))) == AbortCode.COMMAND
    assert bench.read(0x1000) == 0x00020192


@pytest.mark.requirement("C301-072", "C301-078")
def test_silent_client_times_out(kit):
    """A transfer whose client falls silent is aborted with 05040000h after the time-out, in simulated
    time.
    """
    bench = kit.Bench(sdo_timeout_ns=50 * MS)
    bench.slave.power_on()
    bench.run()
    bench.sdo(size(0x21, 0x2001, 20))
    bench.run(30)
    assert bench.sdo(bytes(8))[0] == 0x20  # still alive, and the time starts again
    bench.take()
    bench.run(40)
    assert bench.take(ANSWER) == []
    bench.run(20)
    answers = bench.take(ANSWER)
    assert [abort_of(answer) for answer in answers] == [AbortCode.TIMEOUT]
    assert answers[0][1:4] == head(0, 0x2001)[1:]
    assert abort_of(bench.sdo(b"\x10" + bytes(7))) == AbortCode.COMMAND


@pytest.mark.requirement("C301-073")
def test_new_initiate_ends_the_old_transfer_silently(bench):
    """A new request during a segmented transfer is served, and the old transfer is gone without an abort."""
    bench.sdo(size(0x21, 0x2001, 20))
    assert bench.read(0x1000) == 0x00020192
    assert abort_of(bench.sdo(bytes(8))) == AbortCode.COMMAND
    assert bench.slave.get(0x2001) == ""


@pytest.mark.requirement("C301-062", "C301-073")
def test_abort_of_the_client_is_silent(bench):
    """An abort from the client ends the transfer and is not answered."""
    bench.sdo(head(0x40, 0x1008) + bytes(4))
    assert bench.ask(REQUEST, size(0x80, 0x1008, 0x08000000)) == []
    assert abort_of(bench.sdo(b"\x60" + bytes(7))) == AbortCode.COMMAND


@pytest.mark.requirement("C301-075")
@pytest.mark.parametrize("length", [0, 1, 4, 7])
def test_frames_of_another_length_are_ignored(bench, length):
    """A client frame without exactly eight bytes is not answered."""
    assert bench.ask(REQUEST, (head(0x40, 0x1000) + bytes(4))[:length]) == []


@pytest.mark.requirement("C301-013", "C301-087", "C301-096")
def test_unknown_object_and_sub_index(bench):
    """An object outside the dictionary gives 06020000h, an unknown sub-index 06090011h, also of a plain
    variable.
    """
    assert -bench.read(0x5000) == AbortCode.NO_OBJECT
    assert bench.write(0x5000, 0, 0, 4) == AbortCode.NO_OBJECT
    assert -bench.read(0x1018, 9) == AbortCode.NO_SUB_INDEX
    assert -bench.read(0x6040, 1) == AbortCode.NO_SUB_INDEX
    assert bench.write(0x1800, 4, 0, 1) == AbortCode.NO_SUB_INDEX


@pytest.mark.requirement("C301-076", "C301-085", "C301-086")
def test_access_rights(bench):
    """Writing a read-only or constant object gives 06010002h, reading a write-only one 06010001h."""
    assert bench.write(0x6041, 0, 1, 2) == AbortCode.READ_ONLY
    assert bench.write(0x1018, 0, 1, 1) == AbortCode.READ_ONLY
    assert -bench.read(0x2003) == AbortCode.WRITE_ONLY
    assert bench.write(0x2003, 0, 7, 2) == 0
    assert bench.slave.get(0x2003) == 7


@pytest.mark.requirement("C301-086")
@pytest.mark.parametrize("command", [0x21, 0xC6])
def test_read_only_is_refused_at_initiation(bench, command):
    """A segmented or block download to a read-only object is refused with its first frame."""
    assert abort_of(bench.sdo(size(command, 0x200A, 100))) == AbortCode.READ_ONLY


@pytest.mark.requirement("C301-074", "C301-093")
@pytest.mark.parametrize(("index", "count"), [(0x6040, 1), (0x6040, 4), (0x6083, 2), (0x6060, 2)])
def test_expedited_length_must_match(bench, index, count):
    """An expedited download of another length than the object's is refused with 06070010h and changes
    nothing.
    """
    before = bench.slave.get(index)
    assert bench.write(index, 0, 0x0101, count) == AbortCode.LENGTH
    assert bench.slave.get(index) == before


@pytest.mark.requirement("C301-074", "C301-094", "C301-095")
@pytest.mark.parametrize("command", [0x21, 0xC6])
def test_announced_length_must_match(bench, command):
    """A longer announced size gives 06070012h, a shorter one 06070013h, before any data."""
    assert abort_of(bench.sdo(size(command, 0x6083, 5))) == AbortCode.TOO_LONG
    assert abort_of(bench.sdo(size(command, 0x6083, 3))) == AbortCode.TOO_SHORT


def test_data_beyond_the_announced_size_abort(bench):
    """More data than announced are refused in the segment that brings them."""
    bench.sdo(size(0x21, 0x2001, 5))
    assert abort_of(bench.sdo(b"\x00" + bytes(7))) == AbortCode.TOO_LONG


def test_fewer_data_than_announced_abort(bench):
    """A last segment that leaves the announced size unfilled is refused."""
    bench.sdo(size(0x21, 0x2001, 10))
    assert abort_of(bench.sdo(b"\x01" + b"1234567")) == AbortCode.TOO_SHORT
    assert bench.slave.get(0x2001) == ""


def test_string_longer_than_the_device_takes(bench):
    """A string beyond the device's memory for it is refused when it is announced."""
    assert abort_of(bench.sdo(size(0x21, 0x2001, 5000))) == AbortCode.TOO_LONG


@pytest.mark.requirement("C301-083")
def test_domain_larger_than_memory(bench):
    """A domain beyond the device's memory is refused with 05040005h."""
    assert abort_of(bench.sdo(size(0x21, 0x2002, 1 << 30))) == AbortCode.MEMORY


@pytest.mark.requirement("C301-076", "C301-098", "C301-099")
def test_limits_of_the_eds(bench):
    """A value above the high limit gives 06090031h, below the low limit 06090032h; the limits themselves
    pass.
    """
    assert bench.write(0x2000, 0, 9, 2) == AbortCode.VALUE_HIGH
    assert bench.write(0x2000, 0, 0, 2) == AbortCode.VALUE_LOW
    assert bench.slave.get(0x2000) == 3
    assert bench.write(0x2000, 0, 5, 2) == 0
    assert bench.write(0x2000, 0, 1, 2) == 0
    assert bench.write(0x2004, 0, 2, 1) == AbortCode.VALUE_HIGH


@pytest.mark.requirement("C301-076", "C301-100")
def test_crossed_limits(bench):
    """When the EDS has a maximum below the minimum, any write gives 06090036h."""
    assert bench.write(0x2009, 0, 4, 2) == AbortCode.MAXIMUM_BELOW_MINIMUM


def test_device_refuses_with_its_own_code(bench):
    """A write callback gets the value before it is stored and may refuse it with any abort code."""
    seen = []

    def refuse(value):
        seen.append((value, bench.slave.get(0x6060)))
        if value == 5:
            raise SdoAbort(AbortCode.VALUE)

    bench.slave.on_write(0x6060, 0, refuse)
    assert bench.write(0x6060, 0, 8, 1) == 0
    assert bench.write(0x6060, 0, 5, 1) == AbortCode.VALUE
    assert seen == [(8, 0), (5, 8)]
    assert bench.slave.get(0x6060) == 8


def test_all_write_callbacks_of_an_entry_are_called(bench):
    """Two callbacks on one entry run in the order of registration; the first refusal ends it."""
    seen = []
    bench.slave.on_write(0x6060, 0, lambda value: seen.append(("first", value)))
    bench.slave.on_write(0x6060, 0, lambda value: seen.append(("second", value)))
    bench.write(0x6060, 0, 3, 1)
    assert seen == [("first", 3), ("second", 3)]


def test_read_callback_gives_the_value(bench):
    """A read callback's value is uploaded in place of the stored one; its refusal aborts."""
    bench.slave.on_read(0x6064, 0, lambda: 4711)
    assert bench.read(0x6064) == 4711

    def unavailable():
        raise SdoAbort(AbortCode.NO_DATA)

    bench.slave.on_read(0x606C, 0, unavailable)
    assert -bench.read(0x606C) == AbortCode.NO_DATA


def test_device_values_outside_the_type_are_held_at_its_end(bench):
    """A device value too large for its type is uploaded as the largest one, not as garbage or an
    exception.
    """
    bench.slave.set(0x6077, 0, 40_000)
    assert bench.read(0x6077) == 32_767
    bench.slave.set(0x6064, 0, -12.4)
    assert bench.read(0x6064) == 0x1_0000_0000 - 12
    bench.slave.set(0x6064, 0, float("nan"))
    assert bench.read(0x6064) == 0


# -- block transfers
# ------------------------------------------------------------------------------------------


def send_block(bench, segments: list[bytes], *, last: bool, skip: tuple[int, ...] = ()) -> list[bytes]:
    """Send the segments of one block and return the answers."""
    bench.take()
    for number, part in enumerate(segments, 1):
        if number not in skip:
            mark = 0x80 if last and number == len(segments) else 0
            bench.send(REQUEST, bytes((number | mark,)) + part.ljust(7, b"\0"))
    bench.run(30)
    return bench.take(ANSWER)


def parts(content: bytes) -> list[bytes]:
    return [content[start : start + 7] for start in range(0, len(content), 7)]


def block_end(content: bytes, *, crc: int | None = None) -> bytes:
    unused = -len(content) % 7
    value = crc_hqx(content, 0) if crc is None else crc
    return bytes((0xC1 | unused << 2,)) + value.to_bytes(2, "little") + bytes(5)


@pytest.mark.requirement("C301-063", "C301-064", "C301-065")
def test_block_download_in_several_blocks(bench):
    """A domain of more than one block arrives complete, each block acknowledged with its last number."""
    content = bytes(range(256)) * 5
    assert bench.sdo(size(0xC6, 0x2002, len(content))) == head(0xA4, 0x2002) + b"\x7f\0\0\0"
    segments = parts(content)
    assert send_block(bench, segments[:127], last=False) == [b"\xa2\x7f\x7f" + bytes(5)]
    rest = segments[127:]
    assert send_block(bench, rest, last=True) == [bytes((0xA2, len(rest), 0x7F)) + bytes(5)]
    assert bench.sdo(block_end(content)) == b"\xa1" + bytes(7)
    assert bench.slave.get(0x2002) == content


@pytest.mark.requirement("C301-069", "C301-082")
def test_block_download_with_wrong_crc(bench):
    """A wrong CRC aborts with 05040004h and stores nothing; without CRC support the field is not looked
    at.
    """
    content = b"some content of a domain"
    for command, good in ((0xC6, False), (0xC2, True)):
        bench.sdo(size(command, 0x2002, len(content)))
        send_block(bench, parts(content), last=True)
        answer = bench.sdo(block_end(content, crc=crc_hqx(content, 0) ^ 1))
        if good:
            assert answer[0] == 0xA1
            assert bench.slave.get(0x2002) == content
        else:
            assert abort_of(answer) == AbortCode.CRC
            assert bench.slave.get(0x2002) == b""


@pytest.mark.requirement("C301-070")
def test_lost_segment_is_asked_for_again(bench):
    """After a gap the server acknowledges the last segment in order and takes the rest when it is
    repeated.
    """
    content = bytes(range(70))
    segments = parts(content)
    bench.sdo(size(0xC6, 0x2002, len(content)))
    assert send_block(bench, segments, last=True, skip=(4,)) == [b"\xa2\x03\x7f" + bytes(5)]
    assert send_block(bench, segments[3:], last=True) == [b"\xa2\x07\x7f" + bytes(5)]
    assert bench.sdo(block_end(content))[0] == 0xA1
    assert bench.slave.get(0x2002) == content


@pytest.mark.requirement("C301-070")
def test_missing_first_segment_is_acknowledged_with_zero(bench):
    """When the first segment is missing the acknowledge is 0."""
    bench.sdo(size(0xC6, 0x2002, 14))
    assert send_block(bench, parts(bytes(14)), last=True, skip=(1,)) == [b"\xa2\x00\x7f" + bytes(5)]


def test_repeated_segment_is_taken_once(bench):
    """A segment that comes twice, as after a repetition on the bus, does not end up twice in the data."""
    content = bytes(range(14))
    bench.sdo(size(0xC6, 0x2002, 14))
    bench.send(REQUEST, b"\x01" + content[:7])
    bench.send(REQUEST, b"\x01" + content[:7])
    bench.send(REQUEST, b"\x82" + content[7:])
    bench.run(5)
    assert bench.take(ANSWER)[-1][:2] == b"\xa2\x02"
    assert bench.sdo(block_end(content))[0] == 0xA1
    assert bench.slave.get(0x2002) == content


@pytest.mark.requirement("C301-070", "C301-081")
def test_segment_number_zero_is_invalid(bench):
    """Sequence number 0 aborts with 05040003h."""
    bench.sdo(size(0xC6, 0x2002, 14))
    assert abort_of(bench.sdo(bytes(8))) == AbortCode.SEQUENCE


def test_client_may_abort_between_segments(bench):
    """80h during a block is the client's abort, not a segment."""
    bench.sdo(size(0xC6, 0x2002, 14))
    assert bench.ask(REQUEST, size(0x80, 0x2002, 0x08000000)) == []
    assert bench.read(0x1000) == 0x00020192


def test_block_download_of_a_number(bench):
    """Objects of fixed size can be written in a block; length and limits are checked as always."""
    bench.sdo(size(0xC6, 0x2000, 2))
    send_block(bench, [b"\x04\0"], last=True)
    assert bench.sdo(block_end(b"\x04\0"))[0] == 0xA1
    assert bench.slave.get(0x2000) == 4
    bench.sdo(size(0xC6, 0x2000, 2))
    send_block(bench, [b"\x09\0"], last=True)
    assert abort_of(bench.sdo(block_end(b"\x09\0"))) == AbortCode.VALUE_HIGH


def receive_block(bench, request: bytes) -> list[bytes]:
    bench.take()
    bench.send(REQUEST, request)
    bench.run(30)
    return bench.take(ANSWER)


@pytest.mark.requirement("C301-066", "C301-067", "C301-068", "C301-069")
def test_block_upload(bench):
    """A domain is uploaded in blocks of the client's size, with CRC and the number of unused bytes at the
    end.
    """
    content = bytes(range(100))
    bench.slave.set(0x2002, 0, content)
    assert bench.sdo(head(0xA4, 0x2002) + b"\x08\0\0\0") == size(0xC6, 0x2002, 100)
    received = b""
    block = receive_block(bench, b"\xa3" + bytes(7))
    assert [frame[0] for frame in block] == [1, 2, 3, 4, 5, 6, 7, 8]
    received += b"".join(frame[1:] for frame in block)
    block = receive_block(bench, b"\xa2\x08\x08" + bytes(5))
    assert [frame[0] for frame in block] == [1, 2, 3, 4, 5, 6, 0x87]
    received += b"".join(frame[1:] for frame in block)
    end = bench.sdo(b"\xa2\x07\x08" + bytes(5))
    unused = -100 % 7
    assert end == bytes((0xC1 | unused << 2,)) + crc_hqx(content, 0).to_bytes(2, "little") + bytes(5)
    assert received[:-unused] == content
    assert bench.ask(REQUEST, b"\xa1" + bytes(7)) == []
    assert abort_of(bench.sdo(b"\xa1" + bytes(7))) == AbortCode.COMMAND


@pytest.mark.requirement("C301-070")
def test_block_upload_repeats_what_was_lost(bench):
    """The server goes on behind the last segment that the client has acknowledged, with the new block
    size.
    """
    content = bytes(range(70))
    bench.slave.set(0x2002, 0, content)
    bench.sdo(head(0xA4, 0x2002) + b"\x05\0\0\0")
    receive_block(bench, b"\xa3" + bytes(7))
    block = receive_block(bench, b"\xa2\x02\x03" + bytes(5))
    assert [frame[0] for frame in block] == [1, 2, 3]
    assert b"".join(frame[1:] for frame in block) == content[14:35]


@pytest.mark.requirement("C301-066", "C301-080", "C301-081")
def test_block_upload_refuses_invalid_numbers(bench):
    """Block sizes 0 and above 127 abort with 05040002h, an acknowledge beyond what was sent with
    05040003h.
    """
    bench.slave.set(0x2002, 0, bytes(100))
    for blocks in (0, 128, 255):
        assert abort_of(bench.sdo(head(0xA4, 0x2002) + bytes((blocks, 0, 0, 0)))) == AbortCode.BLOCK_SIZE
    bench.sdo(head(0xA4, 0x2002) + b"\x05\0\0\0")
    receive_block(bench, b"\xa3" + bytes(7))
    assert abort_of(bench.sdo(b"\xa2\x06\x05" + bytes(5))) == AbortCode.SEQUENCE
    bench.sdo(head(0xA4, 0x2002) + b"\x05\0\0\0")
    receive_block(bench, b"\xa3" + bytes(7))
    assert abort_of(bench.sdo(b"\xa2\x05\x00" + bytes(5))) == AbortCode.BLOCK_SIZE
    bench.sdo(head(0xA4, 0x2002) + b"\x05\0\0\0")
    receive_block(bench, b"\xa3" + bytes(7))
    assert abort_of(bench.sdo(b"\xa2\x05\x80" + bytes(5))) == AbortCode.BLOCK_SIZE


@pytest.mark.requirement("C301-071")
def test_protocol_switch_threshold(bench):
    """Data not above the threshold are uploaded in the normal way, data above it in blocks."""
    assert bench.sdo(head(0xA4, 0x6040) + b"\x7f\x04\0\0") == head(0x4B, 0x6040) + bytes(4)
    assert bench.sdo(head(0xA4, 0x1008) + b"\x7f\x04\0\0")[0] == 0xC6
    assert bench.sdo(head(0xA4, 0x6040) + b"\x7f\x00\0\0")[0] == 0xC6


def test_block_upload_of_nothing(bench):
    """An empty domain is uploaded as one segment without used bytes."""
    assert bench.sdo(head(0xA4, 0x2002) + b"\x7f\0\0\0") == size(0xC6, 0x2002, 0)
    assert receive_block(bench, b"\xa3" + bytes(7)) == [b"\x81" + bytes(7)]
    assert bench.sdo(b"\xa2\x01\x7f" + bytes(5)) == b"\xdd\0\0" + bytes(5)


def test_second_server_channel(bench):
    """A second SDO server listens on the identifiers of 1201h once they are valid, with a transfer of its
    own.
    """
    assert bench.write(0x1201, 1, 0x6C0, 4) == 0
    assert bench.write(0x1201, 2, 0x6D0, 4) == 0
    bench.sdo(head(0x40, 0x1008) + bytes(4))
    (answer,) = bench.ask(0x6C0, head(0x40, 0x1000) + bytes(4))
    assert answer.can_id == 0x6D0
    assert answer.data == size(0x43, 0x1000, 0x20192)
    assert bench.sdo(b"\x60" + bytes(7)) == b"\x00Emulate"


def test_answers_can_be_delayed(bench):
    """With a response delay the answer comes that much later; nothing else changes."""
    bench.slave.sdo_response_delay_ns = 20 * MS
    bench.take()
    bench.send(REQUEST, head(0x40, 0x1000) + bytes(4))
    bench.run(19)
    assert bench.take(ANSWER) == []
    bench.run(3)
    assert bench.take(ANSWER) == [size(0x43, 0x1000, 0x20192)]


def test_server_answers_bytes_without_a_bus():
    """The server is bytes in, bytes out, and refuses a request of another length than eight with silence."""

    class Objects:
        def read(self, index, sub):
            return index.to_bytes(2, "big") + bytes((sub,))

        def check_write(self, index, sub, size):
            raise SdoAbort(AbortCode.READ_ONLY)

        def write(self, index, sub, data, *, expedited=False, sized=True):
            raise SdoAbort(AbortCode.HARDWARE)

    server = SdoServer(Objects())
    assert server.request(b"\x40\x34\x12\x07\0\0\0\0") == [b"\x47\x34\x12\x07\x12\x34\x07\0"]
    assert server.request(b"\x40") == []
    assert abort_of(server.request(b"\x2f\x34\x12\x07\0\0\0\0")[0]) == AbortCode.HARDWARE
    assert not server.active
    assert server.aborts == 1
