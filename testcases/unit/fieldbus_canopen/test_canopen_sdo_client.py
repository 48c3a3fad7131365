"""The controller's SDO client: protocols, queue, time-outs, other people's servers, hostile answers."""

from __future__ import annotations

import random

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fieldbus.can import CanFrame, CanMedium
from fieldbus.can.hooks import HookResult
from fieldbus.canopen import CanopenMaster, CanopenSlave
from fieldbus.canopen.abort import AbortCode
from fieldbus.canopen.network import PumpedNetwork
from fieldbus.canopen.sdo_client import ATTEMPTS, TIMEOUT_NS
from fieldbus.canopen.sdo_transfer import SdoDownload, SdoTransfer, SdoUpload
from fieldbus.clock import MS, S, VirtualScheduler
from fieldbus.errors import ConfigurationError

SIZES = (1, 2, 3, 4, 5, 6, 7, 8, 14, 15, 63, 64, 888, 889, 890, 1778, 2500)


class Net:
    """A master, slaves of the test dictionary, and an ear on the bus."""

    def __init__(self, kit, *nodes: int) -> None:
        self.scheduler = VirtualScheduler()
        self.segment = CanMedium(self.scheduler)
        self.master = CanopenMaster(self.scheduler, self.segment)
        self.heard: list[tuple[int, CanFrame]] = []
        self.port = self.segment.attach("ear", lambda frame, time_ns: self.heard.append((time_ns, frame)))
        self.slaves = {
            node: CanopenSlave(self.scheduler, self.segment, kit.dictionary(), node, name=f"n{node}")
            for node in nodes
        }
        for slave in self.slaves.values():
            slave.power_on()
        self.run(2)
        self.heard.clear()

    def run(self, milliseconds: float) -> None:
        self.scheduler.run_for(round(milliseconds * MS))

    def finish(self, *jobs, timeout_s: float = 10) -> None:
        assert self.scheduler.run_until(lambda: all(job.done() for job in jobs), round(timeout_s * S))

    def frames(self, can_id: int) -> list[bytes]:
        return [frame.data for _, frame in self.heard if frame.can_id == can_id]


@pytest.fixture
def net(kit):
    return Net(kit, 5)


def content(size: int) -> bytes:
    return random.Random(size).randbytes(size)


@pytest.mark.requirement(
    "C301-057",
    "C301-058",
    "C301-059",
    "C301-060",
    "C301-061",
    "C301-063",
    "C301-064",
    "C301-065",
    "C301-066",
    "C301-067",
    "C301-068",
    "C301-069",
)
@pytest.mark.parametrize("block", [False, True])
@pytest.mark.parametrize("size", SIZES)
def test_there_and_back(net, size, block):
    """What is written is what is read, of any length, by every protocol."""
    sdo = net.master.sdo(5)
    write = sdo.download(0x2002, 0, content(size), block=block)
    net.finish(write)
    assert write.ok
    assert net.slaves[5].get(0x2002) == content(size)
    read = sdo.upload(0x2002, 0, block=block)
    net.finish(read)
    assert read.ok
    assert read.data == content(size)
    assert read.reason == write.reason == ""


def test_protocol_fits_the_size(net):
    """Four bytes go with the request, more in segments, much in blocks."""
    sdo = net.master.sdo(5)
    first = []
    for size in (4, 5, 63, 64):
        net.heard.clear()
        net.finish(sdo.download(0x2002, 0, content(size)))
        first.append(net.frames(0x605)[0][0])
    assert first == [0x23, 0x21, 0x21, 0xC6]


@pytest.mark.exhaustive
@pytest.mark.requirement("C301-060")
def test_numbers(net):
    """An upload is the entry's bytes, and an unsigned number for those who want one."""
    sdo = net.master.sdo(5)
    jobs = [sdo.upload(index) for index in (0x1000, 0x1001, 0x1008)]
    net.finish(*jobs)
    assert [job.value for job in jobs[:2]] == [0x00020192, 0]
    assert jobs[2].data == b"Emulated_servo_drive"


@pytest.mark.requirement("C301-062", "C301-076", "C301-087", "C301-086", "C301-096")
@pytest.mark.parametrize(
    ("index", "sub", "data", "code", "words"),
    [
        (0x3000, 0, None, AbortCode.NO_OBJECT, "does not exist"),
        (0x1018, 9, None, AbortCode.NO_SUB_INDEX, "sub-index"),
        (0x1000, 0, b"\0\0\0\0", AbortCode.READ_ONLY, "read-only"),
        (0x2003, 0, None, AbortCode.WRITE_ONLY, "write-only"),
        (0x2000, 0, b"\x09\0", AbortCode.VALUE_HIGH, "too high"),
        (0x1017, 0, b"\0\0\0\0", AbortCode.LENGTH, "length"),
    ],
)
def test_refusal_ends_the_job_with_its_code(net, index, sub, data, code, words):
    """A server's abort ends the transfer, which says why in words, and the next one goes on."""
    sdo = net.master.sdo(5)
    job = sdo.upload(index, sub) if data is None else sdo.download(index, sub, data)
    following = sdo.upload(0x1000)
    net.finish(job, following)
    assert (job.ok, job.abort_code, job.attempts, job.timed_out) == (False, code, 1, False)
    assert f"{code:08X}h" in job.reason
    assert words in job.reason
    assert following.ok


@pytest.mark.exhaustive
@pytest.mark.requirement("C301-072", "C301-078")
def test_silent_server(net):
    """A server that does not answer is asked again, then the job ends; it gets an abort in either case."""
    net.slaves[5].power_off()
    ended = []
    job = net.master.sdo(5).upload(0x1000, 0, ended.append)
    begun = net.scheduler.now
    net.finish(job)
    assert net.scheduler.now - begun == ATTEMPTS * TIMEOUT_NS
    assert (job.timed_out, job.attempts, job.abort_code) == (True, ATTEMPTS, AbortCode.TIMEOUT)
    assert ended == [job]
    net.run(2)
    request, abort = "40 00 10 00 00 00 00 00", "80 00 10 00 00 00 04 05"
    assert [data.hex(" ") for data in net.frames(0x605)] == [request, abort] * ATTEMPTS


def test_lost_frame_is_made_good(net):
    """A request that the bus has lost is sent again after the time-out, and the job ends well."""
    lost = []

    def lose_first(frame, *_rest):
        if frame.can_id == 0x605 and not lost:
            lost.append(frame)
            return HookResult.drop()
        return None

    net.segment.add_hook(lose_first)
    job = net.master.sdo(5).upload(0x1000)
    net.finish(job)
    assert lost
    assert (job.ok, job.attempts, job.value) == (True, 2, 0x00020192)


@pytest.mark.exhaustive
def test_one_request_at_a_time_per_server(kit):
    """A server never gets a request before it has answered the one before; servers work at the same time."""
    net = Net(kit, 5, 6)
    for slave in net.slaves.values():
        slave.sdo_response_delay_ns = 10 * MS
    begun = net.scheduler.now
    jobs = [net.master.sdo(node).upload(0x1018, sub) for sub in (1, 2, 3) for node in (5, 6)]
    net.finish(*jobs)
    assert 30 * MS < net.scheduler.now - begun < 33 * MS
    assert [job.value for job in jobs] == [0x1234, 0x1234, 0x5678, 0x5678, 0x00010000, 0x00010000]
    for node in (5, 6):
        order = [frame.can_id for _, frame in net.heard if frame.can_id in (0x600 + node, 0x580 + node)]
        assert order == [0x600 + node, 0x580 + node] * 3


def test_answers_of_others_are_ignored(net):
    """Answers to somebody else's requests, late ones, and frames of a wrong length do not disturb a
    transfer.
    """
    net.slaves[5].sdo_response_delay_ns = 20 * MS
    job = net.master.sdo(5).upload(0x1018, 1)
    net.run(2)
    for data in (
        "43 18 10 02 99 99 99 99",
        "60 18 10 01 00 00 00 00",
        "80 18 10 02 00 00 02 06",
        "43 18 10 01 99",
    ):
        net.port.send(CanFrame(0x585, bytes.fromhex(data)))
    net.finish(job)
    assert job.value == 0x1234
    assert net.master.sdo(5).strays == 4
    net.port.send(CanFrame(0x585, bytes.fromhex("43 18 10 01 00 00 00 00")))
    net.run(2)
    assert net.master.sdo(5).strays == 5


def test_cancelled_job(net):
    """A job that is given up tells the server if it was under way, calls nobody, and lets the next one
    run.
    """
    called = []
    sdo = net.master.sdo(5)
    net.slaves[5].sdo_response_delay_ns = 20 * MS
    first = sdo.upload(0x1008, 0, called.append)
    second = sdo.upload(0x1000, 0, called.append)
    third = sdo.upload(0x1018, 1, called.append)
    net.run(5)
    second.cancel()
    second.cancel()
    first.cancel()
    net.finish(third)
    assert first.done()
    assert second.done()
    assert called == [third]
    assert [data[0] for data in net.frames(0x605)] == [0x40, 0x80, 0x40]
    assert third.value == 0x1234


@pytest.mark.requirement("C301-062", "C301-081")
@pytest.mark.parametrize(
    ("answer", "code"),
    [("80 02 20 00 20 00 00 08", AbortCode.CANNOT_STORE), ("A2 7E 7F 00 00 00 00 00", AbortCode.SEQUENCE)],
)
def test_refused_block_is_not_sent_to_its_end(kit, answer, code):
    """A block that the server refuses, or acknowledges wrongly, in the middle ends there: no further segment
    goes out.
    """
    net = Net(kit)
    job = net.master.sdo(5).download(0x2002, 0, content(800))
    net.run(1)
    net.port.send(CanFrame(0x585, bytes.fromhex("A4 02 20 00 7F 00 00 00")))
    net.run(3)
    net.port.send(CanFrame(0x585, bytes.fromhex(answer)))
    net.run(0.2)
    assert job.done()
    assert job.abort_code == code
    net.run(0.6)  # a burst that was on its way
    sent = len(net.frames(0x605))
    assert sent < 30
    net.run(100)
    assert len(net.frames(0x605)) == sent


def test_job_from_the_callback_of_another(net):
    """A callback may queue the next transfer, as a state machine does."""
    seen = []

    def next_one(job):
        seen.append(job.value)
        if len(seen) < 4:
            net.master.sdo(5).upload(0x1018, 1 + len(seen), next_one)

    net.master.sdo(5).upload(0x1018, 1, next_one)
    net.run(5)
    assert seen == [0x1234, 0x5678, 0x00010000, 42]
    assert not net.master.sdo(5).busy


@pytest.mark.exhaustive
@pytest.mark.requirement("C301-070")
@pytest.mark.parametrize("which", [1, 2, 60, 126])
@pytest.mark.parametrize("direction", ["up", "down"])
def test_lost_segment_of_a_block_is_repeated(net, direction, which):
    """A segment that the bus has lost is sent again, without a restart of the transfer."""
    size = 1500
    net.slaves[5].values[0x200200] = content(size)
    identifier = 0x585 if direction == "up" else 0x605
    lost = []

    def lose(frame, *_rest):
        if frame.can_id == identifier and frame.data[0] == which and not lost:
            lost.append(frame)
            return HookResult.drop()
        return None

    net.segment.add_hook(lose)
    sdo = net.master.sdo(5)
    job = sdo.upload(8194, 0, block=True) if direction == "up" else sdo.download(8194, 0, content(size)[::-1])
    net.finish(job)
    assert lost
    assert (job.ok, job.attempts) == (True, 1)
    if direction == "up":
        assert job.data == content(size)
    else:
        assert net.slaves[5].get(0x2002) == content(size)[::-1]


@pytest.mark.parametrize("size", [3, 20, 64, 500])
def test_server_of_the_canopen_library(kit, size):
    """The server of the `canopen` library is served too; what it lacks of the block protocol is done
    without.
    """
    net = Net(kit)
    with PumpedNetwork(net.segment, name="library") as network:
        node = network.create_node(9, kit.dictionary(9))
        sdo = net.master.sdo(9)
        for _ in range(2):
            write = sdo.download(0x2002, 0, content(size))
            read = sdo.upload(0x2002, 0, block=True)
            net.finish(write, read)
            assert (write.ok, read.ok) == (True, True), (write, read)
            assert read.data == content(size) == node.sdo["Domain"].raw
        # Having been refused once, the client does not offer blocks again.
        assert [data[0] for data in net.frames(0x609)].count(0xC6) == (1 if size >= 64 else 0)


@pytest.mark.parametrize("period_ms", [1, 2, 4])
def test_transfers_leave_sync_alone(net, period_ms):
    """However many transfers there are, SYNC goes out at its instant: none is on the bus when it is due."""
    net.master.start_sync(period_ms * MS)
    jobs = [net.master.sdo(5).upload(0x1018, 1 + n % 4) for n in range(60)]
    jobs += [net.master.sdo(5).download(0x2002, 0, content(300))]
    net.finish(*jobs)
    ends = {time_ns % (period_ms * MS) for time_ns, frame in net.heard if frame.can_id == 0x80}
    assert len(ends) == 1
    assert all(job.ok for job in jobs)


@pytest.mark.exhaustive
def test_transfers_let_error_control_through(kit):
    """Clients and servers that answer without delay do not keep a heartbeat, of less priority, from the
    bus.
    """
    net = Net(kit, 5, 6)
    for node in (5, 6):
        for n in range(300):
            net.master.sdo(node).upload(0x1018, 1 + n % 4)
    net.port.send(CanFrame(0x77F, b"\x05"))
    begun = net.scheduler.now
    heard = []
    net.master.subscribe(0x77F, lambda _data, time_ns: heard.append(time_ns))
    net.run(20)
    assert net.master.sdo(5).busy
    assert heard
    assert heard[0] - begun < 10 * MS


@pytest.mark.exhaustive
def test_bad_arguments(net):
    """Numbers that do not exist in the protocol are refused at once, with what is allowed."""
    for make in (
        lambda: net.master.sdo(0),
        lambda: net.master.sdo(128),
        lambda: net.master.sdo(5).upload(0x10000),
        lambda: net.master.sdo(5).download(0x1000, 256, b""),
    ):
        with pytest.raises(ConfigurationError, match=r"\.\."):
            make()
    with pytest.raises(ConfigurationError, match=r"1017h:0: 100 is not allowed; allowed: bytes"):
        net.master.sdo(5).download(0x1017, 0, 100)


# -- the transfer alone: bytes in, bytes out
# -------------------------------------------------------------------------


def play(transfer: SdoTransfer, *answers: str) -> list[str]:
    """Feed answers; return everything that the client has sent, as hexadecimal."""
    sent = transfer.start()
    for answer in answers:
        sent += transfer.receive(bytes.fromhex(answer))
    return [data.hex(" ") for data in sent]


@pytest.mark.requirement("C301-072", "C301-077", "C301-080", "C301-081", "C301-082", "C301-094", "C301-095")
@pytest.mark.parametrize(
    ("transfer", "answers", "code"),
    [
        (SdoUpload(0x2001, 0), ["41 01 20 00 09 00 00 00", "10" + " 41" * 7], AbortCode.TOGGLE),
        (SdoUpload(0x2001, 0), ["41 01 20 00 05 00 00 00", "00" + " 41" * 7], AbortCode.TOO_LONG),
        (SdoUpload(0x2001, 0), ["41 01 20 00 09 00 00 00", "01" + " 41" * 7], AbortCode.TOO_SHORT),
        (SdoUpload(0x2001, 0), ["41 01 20 00 FF FF FF FF"], AbortCode.MEMORY),
        (SdoUpload(0x2001, 0, block=True), ["C2 01 20 00 FF FF FF FF"], AbortCode.MEMORY),
        (SdoUpload(0x2001, 0, block=True),
         ["C6 01 20 00 07 00 00 00", "81" + " 41" * 7, "C1 00 00 00 00 00 00 00"], AbortCode.CRC),
        (SdoUpload(0x2001, 0, block=True),
         ["C2 01 20 00 09 00 00 00", "81" + " 41" * 7, "C1 00 00 00 00 00 00 00"], AbortCode.TOO_SHORT),
        (SdoDownload(0x2001, 0, bytes(9)), ["60 01 20 00 00 00 00 00", "30" + " 00" * 7], AbortCode.TOGGLE),
        (SdoDownload(0x2001, 0, bytes(9), block=True), ["A4 01 20 00 00 00 00 00"], AbortCode.BLOCK_SIZE),
        (SdoDownload(0x2001, 0, bytes(9), block=True), ["A4 01 20 00 80 00 00 00"], AbortCode.BLOCK_SIZE),
        (SdoDownload(0x2001, 0, bytes(9), block=True),
         ["A4 01 20 00 7F 00 00 00", "A2 03 7F 00 00 00 00 00"], AbortCode.SEQUENCE),
    ],
)  # fmt: skip
def test_server_that_breaks_the_protocol(transfer, answers, code):
    """What a server does wrong is answered with the abort code that the standard has for it, and ends the
    transfer.
    """
    sent = play(transfer, *answers)
    assert transfer.done
    assert transfer.abort_code == code
    assert sent[-1] == "80 01 20 00 " + code.to_bytes(4, "little").hex(" ")


@pytest.mark.requirement("C301-060", "C301-061")
@pytest.mark.parametrize(
    ("answers", "content"),
    [
        (["42 01 20 00 01 02 03 04"], "01 02 03 04"),  # size not given: all four bytes
        (["4B 01 20 00 01 02 03 04"], "01 02"),
        (
            ["40 01 20 00 00 00 00 00", "00 01 02 03 04 05 06 07", "1B 08 09 00 00 00 00 00"],
            "01 02 03 04 05 06 07 08 09",
        ),
        (["41 01 20 00 00 00 00 00", "0F 00 00 00 00 00 00 00"], ""),  # an empty string
    ],
)
def test_answers_of_every_form(answers, content):
    """Uploads of given and of unknown size, and of nothing."""
    transfer = SdoUpload(0x2001, 0)
    play(transfer, *answers)
    assert transfer.done
    assert not transfer.abort_code
    assert transfer.data == bytes.fromhex(content)


def crc_bit_by_bit(data: bytes) -> int:
    """Return the CRC of block transfers as its polynomial x^16 + x^12 + x^5 + 1 says."""
    crc = 0
    for byte in data:
        crc ^= byte << 8
        for _ in range(8):
            crc = (crc << 1 ^ (0x1021 if crc & 0x8000 else 0)) & 0xFFFF
    return crc


@pytest.mark.requirement("C301-059", "C301-064", "C301-065", "C301-069")
def test_frames_of_a_download(net):
    """Ten bytes in segments and as a block, byte by byte."""
    data = bytes(range(1, 11))
    assert play(
        SdoDownload(0x2001, 2, data), "60 01 20 02 00 00 00 00", "20" + " 00" * 7, "30" + " 00" * 7
    ) == [
        "21 01 20 02 0a 00 00 00",
        "00 01 02 03 04 05 06 07",
        "19 08 09 0a 00 00 00 00",
    ]
    assert play(
        SdoDownload(0x2001, 2, data, block=True), "A4 01 20 02 7F 00 00 00", "A2 02 7F 00 00 00 00 00"
    ) == [
        "c6 01 20 02 0a 00 00 00",
        "01 01 02 03 04 05 06 07",
        "82 08 09 0a 00 00 00 00",
        "d1 " + crc_bit_by_bit(data).to_bytes(2, "little").hex(" ") + " 00 00 00 00 00",
    ]


@pytest.mark.exhaustive
@settings(max_examples=300, deadline=None)
@given(
    st.sampled_from(["up", "down"]),
    st.booleans(),
    st.lists(st.one_of(st.binary(min_size=8, max_size=8), st.binary(max_size=9)), max_size=30),
)
def test_any_answer_is_survived(direction, block, answers):
    """Whatever a server sends, the client does not raise, sends eight bytes each, and says nothing after the
    end.
    """
    transfer = (
        SdoUpload(0x2001, 0, block=block)
        if direction == "up"
        else SdoDownload(0x2001, 0, bytes(40), block=block)
    )
    transfer.start()
    heads = (b"\x41\x01\x20\x00", b"\xc6\x01\x20\x00", b"\x60\x01\x20\x00", b"\xa4\x01\x20\x00")
    for number, answer in enumerate(answers):
        over = transfer.done
        data = heads[number % 4] + answer[4:] if number < 2 and len(answer) == 8 else answer
        sent = transfer.receive(data)
        assert all(len(one) == 8 for one in sent)
        assert not (over and sent)
