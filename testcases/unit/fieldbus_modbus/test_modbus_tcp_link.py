"""The TCP link in simulated time: segments, several connections, several requests under way, faults."""

import pytest

from fieldbus.clock import MS, S, VirtualScheduler
from fieldbus.errors import ConfigurationError
from fieldbus.modbus import (
    Change,
    ConnectionLimits,
    ModbusServer,
    Outcome,
    Request,
    TcpClient,
    TcpDecoder,
    TcpLink,
    TcpStation,
    tcp_frame,
)
from testcases.unit.fieldbus_modbus.conftest import new_map

READ = Request(3, 10, 2)
ANSWER = bytes.fromhex("03 04 100a 100b")


class Peer:
    """A bare end of a connection."""

    def __init__(self, rig, name="tester"):
        self.got = b""
        self.events = []
        self.end = rig.link.connect(name, self)

    def opened(self):
        self.events.append("opened")

    def receive(self, data):
        self.got += data

    def closed(self, reason):
        self.events.append(reason)


class Rig:
    def __init__(self, *, segment_size=1460, **station):
        self.scheduler = VirtualScheduler()
        self.link = TcpLink(self.scheduler, segment_size=segment_size)
        self.server = ModbusServer(new_map(), unit=None)
        self.station = TcpStation(self.scheduler, self.link, self.server, **station)

    def client(self, **options):
        return TcpClient(self.scheduler, lambda handler: self.link.connect("client", handler), **options)

    def peer(self, name="tester"):
        peer = Peer(self, name)
        self.scheduler.run_for(MS)
        return peer

    def ask(self, client, request, unit=1, wait_ns=30 * S):
        job = client.submit(request, unit)
        assert self.scheduler.run_until(lambda: job.result, wait_ns)
        return job.result

    def hook(self, sender, *changes):
        """Apply changes to what a sender sends, one after the other."""
        todo = list(changes)
        return self.link.add_hook(lambda name, data, now: todo.pop(0) if name == sender and todo else None)


@pytest.fixture
def rig():
    return Rig()


@pytest.mark.requirement("MODB-038", "MODB-044")
@pytest.mark.parametrize("size", [1, 3, 7, 1460])
def test_segments_do_not_matter(size):
    """Two frames in one segment, one in three, every byte for itself: two responses in order, with their
    numbers.
    """
    rig = Rig(segment_size=size)
    peer = rig.peer()
    peer.end.send(tcp_frame(1, 1, READ.encode()) + tcp_frame(2, 1, READ.encode()))
    rig.scheduler.run_for(S)
    assert peer.got == tcp_frame(1, 1, ANSWER) + tcp_frame(2, 1, ANSWER)
    carried = [entry for entry in rig.link.log if entry.data and entry.sender == "tester"]
    assert len(carried) == -(-24 // size)


@pytest.mark.requirement("MODB-037")
@pytest.mark.parametrize("header", ["0001 0001 0006", "0001 0000 0001", "0001 0000 0000", "0001 0000 00ff"])
def test_a_wrong_header_ends_the_connection(rig, header):
    """The frame is dropped and the connection closed; another connection is not concerned."""
    peer, other = rig.peer(), rig.peer("other")
    peer.end.send(bytes.fromhex(header) + b"\x01" + READ.encode())
    rig.scheduler.run_for(S)
    assert peer.events == ["opened", "closed"]
    assert peer.got == b""
    other.end.send(tcp_frame(1, 1, READ.encode()))
    rig.scheduler.run_for(S)
    assert other.got == tcp_frame(1, 1, ANSWER)
    assert len(rig.station.ends) == 1


def test_connections_are_limited():
    """One more connection than the station has is refused; a place that is left is free again."""
    rig = Rig(limits=ConnectionLimits(connections=2))
    first, second, third = rig.peer(), rig.peer(), rig.peer()
    assert (first.events, second.events, third.events) == (["opened"], ["opened"], ["refused"])
    first.end.close()
    rig.scheduler.run_for(MS)
    assert rig.peer().events == ["opened"]


def test_a_request_has_to_become_complete_in_time():
    """The time runs from the first byte of a request: a byte now and then does not prolong it, a request that
    is complete ends it, and the one behind that has its own.
    """
    rig = Rig(limits=ConnectionLimits(request_ns=5 * S), processing_ns=0)
    request = tcp_frame(1, 1, READ.encode())
    for begin_ns, closes_ns in ((5 * S, True), (5 * S - 2 * MS, False)):
        slow = rig.peer()
        slow.end.send(request[:4])
        rig.scheduler.run_for(begin_ns - 1 * S)
        slow.end.send(request[4:8])
        rig.scheduler.run_for(1 * S)
        slow.end.send(request[8:])
        rig.scheduler.run_for(10 * MS)
        assert slow.events == (["opened", "closed"] if closes_ns else ["opened"])
        assert slow.got == (b"" if closes_ns else tcp_frame(1, 1, ANSWER))
    pairs = rig.peer()
    pairs.end.send(request[:4])
    for _ in range(4):
        rig.scheduler.run_for(4 * S)
        pairs.end.send(request[4:] + request[:4])
    rig.scheduler.run_for(4 * S)
    assert pairs.got == tcp_frame(1, 1, ANSWER) * 4
    assert pairs.events == ["opened"]
    rig.scheduler.run_for(2 * S)
    assert pairs.events == ["opened", "closed"]
    assert len(rig.station.ends) == 1


def test_limits_of_connections_are_checked():
    """A server that takes no connection, or no time for a request, is refused."""
    with pytest.raises(ConfigurationError, match="connections"):
        ConnectionLimits(connections=0)
    with pytest.raises(ConfigurationError, match="request_ns"):
        ConnectionLimits(request_ns=0)


@pytest.mark.requirement("MODB-036", "MODB-039")
def test_several_requests_under_way(rig):
    """Up to the configured number are sent without waiting, each with its own number; the others queue."""
    client = rig.client(outstanding=4)
    results = []
    for number in range(10):
        client.submit(Request(3, 10 + number, 1), done=results.append)
    rig.scheduler.run_for(MS // 2)
    assert (client.outstanding, client.waiting) == (4, 6)
    rig.scheduler.run_for(S)
    assert [result.response.values for result in results] == [(0x100A + number,) for number in range(10)]


@pytest.mark.requirement("MODB-039")
def test_responses_in_any_order_find_their_request(rig):
    """Responses that overtake each other are matched by their number."""
    client = rig.client(outstanding=3)
    kept = []

    def reverse(name, data, now):
        if name == "server" and len(kept) < 3:
            kept.append(data)
            return Change(data=b"".join(reversed(kept))) if len(kept) == 3 else Change(drop=True)
        return None

    rig.link.add_hook(reverse)
    jobs = [client.submit(Request(3, 10 + number, 1)) for number in range(3)]
    rig.scheduler.run_for(S // 2)
    assert [job.result.response.values for job in jobs] == [(0x100A,), (0x100B,), (0x100C,)]


@pytest.mark.requirement("MODB-041", "MODB-043")
def test_late_responses_are_discarded(rig):
    """A time-out takes a new number; the response to the old one is counted and dropped."""
    client = rig.client(timeout_ns=500 * MS, retries=1)
    rig.hook("server", Change(delay_ns=700 * MS))
    result = rig.ask(client, READ)
    assert (result.outcome, result.tries) == (Outcome.DONE, 2)
    assert (client.timeouts, client.late) == (1, 1)


@pytest.mark.exhaustive
@pytest.mark.requirement("MODB-041")
def test_numbers_come_again_late():
    """No number is used twice within 65535 requests."""
    rig = Rig(processing_ns=0)
    rig.link.keep_log = False
    rig.link.latency_ns = 0
    client = rig.client(outstanding=16)
    numbers = []
    rig.link.add_hook(lambda name, data, now: numbers.append(data[:2]) if name == "client" else None)
    for _ in range(40):
        for _ in range(200):
            client.submit(Request(3, 10, 1))
        rig.scheduler.run_for(S)
    assert len(set(numbers)) == len(numbers) == 8000


@pytest.mark.requirement("MODB-043")
@pytest.mark.parametrize(
    ("change", "outcome"),
    [
        (lambda data: b"\x12\x34" + data[2:], Outcome.TIMEOUT),
        (lambda data: data[:6] + b"\x09" + data[7:], Outcome.INVALID),
        (lambda data: data[:7] + b"\x04" + data[8:], Outcome.INVALID),
        (lambda data: data[:4] + b"\x00\x05" + data[6:11], Outcome.INVALID),
        (lambda data: data[:2] + b"\x00\x01" + data[4:], Outcome.LOST),
        (lambda data: data[:4] + b"\x01\x00" + data[6:], Outcome.LOST),
        (lambda data: data[:4] + b"\x00\x01" + data[6:], Outcome.LOST),
        (lambda data: data[:7], Outcome.TIMEOUT),
    ],
    ids=["number", "unit", "function", "content", "protocol", "length 256", "length 1", "half a frame"],
)
def test_wrong_responses(rig, change, outcome):
    """A wrong number, unit, function, content, header or a part: the result says so, and a retry is
    served.
    """
    client = rig.client(timeout_ns=500 * MS, retries=0)
    rig.link.add_hook(
        lambda name, data, now: Change(data=change(data)) if name == "server" and now < S else None
    )
    assert rig.ask(client, READ).outcome is outcome
    rig.scheduler.run_for(2 * S)
    client.retries = 1
    assert rig.ask(client, READ).outcome is Outcome.DONE


@pytest.mark.requirement("MODB-043", "MODB-042")
def test_a_reset_loses_what_is_under_way_and_connects_again(rig):
    """Requests under way are sent again over a new connection, or are lost without a retry."""
    for retries, outcome in ((0, Outcome.LOST), (1, Outcome.DONE)):
        client = rig.client(retries=retries, outstanding=4)
        jobs = [client.submit(READ) for _ in range(4)]
        rig.scheduler.run_for(MS)
        assert client.outstanding == 4
        for end in list(rig.station.ends):
            end.reset()
        rig.scheduler.run_for(2 * S)
        assert [job.result.outcome for job in jobs] == [outcome] * 4
        assert rig.ask(client, READ).outcome is Outcome.DONE
        assert client.connections == 2


@pytest.mark.requirement("MODB-042")
def test_a_cut_cable_is_not_noticed_by_the_connection(rig):
    """Both ends stay open and silent; behind the cut everything arrives in order, and the client goes on."""
    client = rig.client(timeout_ns=500 * MS, retries=0)
    assert rig.ask(client, READ).outcome is Outcome.DONE
    rig.link.cut = True
    assert rig.ask(client, READ).outcome is Outcome.TIMEOUT
    assert client.connected
    rig.link.cut = False
    assert rig.ask(client, READ).outcome is Outcome.DONE
    assert (client.connections, client.late) == (1, 1)


def test_order_survives_a_cut(rig):
    """What was sent before and behind the cut arrives in that order."""
    peer = rig.peer()
    frames = [tcp_frame(number, 1, Request(6, 10, 1, (number,)).encode()) for number in range(1, 6)]
    for number, frame in enumerate(frames):
        peer.end.send(frame)
        rig.scheduler.run_for(30_000)
        if number == 1:
            rig.link.cut = True
        if number == 3:
            rig.scheduler.run_for(50_000)
            rig.link.cut = False
    rig.scheduler.run_for(S)
    assert peer.got == b"".join(frames)


def test_no_server_is_an_outcome(rig):
    """Without a server, and behind a cut cable, a request is lost after its tries; later the server is
    there.
    """
    client = rig.client(retries=2, timeout_ns=500 * MS)
    rig.link.listen(None)
    result = rig.ask(client, READ)
    assert (result.outcome, result.tries) == (Outcome.LOST, 3)
    assert "refused" in result.text
    rig.link.cut = True
    assert "time-out" in rig.ask(client, READ).text
    rig.link.cut = False
    rig.station = TcpStation(rig.scheduler, rig.link, rig.server)
    assert rig.ask(client, READ).outcome is Outcome.DONE


def test_closing_the_client(rig):
    """What is under way is lost, the server forgets the connection, the next request makes another one."""
    client = rig.client()
    job = client.submit(READ)
    rig.scheduler.run_for(MS)
    client.close()
    assert job.result.outcome is Outcome.LOST
    rig.scheduler.run_for(S)
    assert rig.station.ends == []
    assert rig.ask(client, READ).outcome is Outcome.DONE
    for options in ({"outstanding": 0}, {"outstanding": 17}, {"timeout_ns": 0}):
        with pytest.raises(ConfigurationError):
            rig.client(**options)


def test_the_log_reads_in_words(rig):
    """Both streams of a connection in words, with the response held against its request."""
    client = rig.client()
    rig.ask(client, READ)
    rig.ask(client, Request(6, 0, 1, (7,)), 3)
    decoder = TcpDecoder()
    words = [
        text
        for entry in rig.link.log
        for text in decoder.text(entry.data, from_server=entry.sender == "server")
    ]
    assert words == [
        "transaction 1 unit 1 request 03 read holding registers 000Ah x 2",
        "transaction 1 unit 1 response 03 read holding registers: 100A 100B",
        "transaction 2 unit 3 request 06 write single register 0000h = 0007",
        "transaction 2 unit 3 response 06 write single register: exception 02h illegal data address",
    ]
    assert "unsolicited" in decoder.text(tcp_frame(9, 1, b"\x03\x00"), from_server=True)[0]
    assert "wrong header" in decoder.text(b"\x00\x01\x00\x01\x00\x06", from_server=True)[0]
