"""The log of a link as frames: whatever pieces it came in, each frame can be read alone."""

from __future__ import annotations

import pytest

from fieldbus.clock import MS, VirtualScheduler
from fieldbus.modbus import (
    Change,
    ModbusServer,
    Request,
    RtuClient,
    RtuStation,
    SerialLine,
    SerialLog,
    TcpClient,
    TcpLink,
    TcpLog,
    TcpSegment,
    TcpStation,
    tcp_frame,
)
from testcases.unit.fieldbus_modbus.conftest import new_map

READ = Request(3, 0, 2)


class Network:
    """A client and a device behind TCP, with the log of what passes."""

    def __init__(self):
        self.clock = VirtualScheduler()
        self.link = TcpLink(self.clock)
        TcpStation(self.clock, self.link, ModbusServer(new_map(), unit=5))
        self.client = TcpClient(
            self.clock,
            lambda handler: self.link.connect("plc", handler),
            retries=0,
            timeout_ns=50 * MS,
            outstanding=4,
        )
        self.log = TcpLog(self.link.log, client="plc", names={"server": "drive"})

    def ask(self, *requests):
        """Let requests be answered; returns the log."""
        for request in requests:
            self.client.submit(request, 5)
        self.clock.run_for(200 * MS)
        return self.log.update()


def test_requests_and_responses_carry_time_sender_and_meaning():
    """A request and its response are two rows, the second one with the words of a response."""
    log = Network().ask(READ)
    assert [(entry.sender, entry.frame.text().split(" 03")[0]) for entry in log] == [
        ("plc", "connection 1 opened"),
        ("plc", "transaction 1 unit 5 request"),
        ("drive", "transaction 1 unit 5 response"),
    ]
    assert [entry.time_ns for entry in log] == sorted(entry.time_ns for entry in log)
    assert log[1].frame.can_id == 5
    assert log[1].frame.pdu == READ.encode()


@pytest.mark.requirement("MODB-038")
def test_segments_are_no_frames():
    """A frame in three segments is one row, and two frames in one segment are two."""
    network = Network()
    network.link.add_hook(lambda sender, _data, _time: Change(cuts=(3, 9)) if sender == "plc" else None)
    assert [entry.frame.text() for entry in network.ask(READ)][1] == f"transaction 1 unit 5 request {READ}"
    both = tcp_frame(1, 5, READ.encode()) + tcp_frame(2, 5, READ.encode())
    log = TcpLog([TcpSegment(7, 1, "plc", both, "")], client="plc").update()
    assert [entry.frame.data for entry in log] == [both[:12], both[12:]]


def test_what_a_fault_did_is_said():
    """Dropped and changed frames say so; a dropped one does not disturb the ones behind it."""
    network = Network()
    count = []

    def hook(sender, data, _time):
        if sender != "plc":
            return None
        count.append(1)
        if len(count) == 1:
            return Change(drop=True)
        return Change(data=data[:-1] + b"\1") if len(count) == 2 else None

    network.link.add_hook(hook)
    errors = [(entry.sender, entry.error) for entry in network.ask(READ, READ, READ) if entry.frame.data]
    assert errors == [("plc", "dropped"), ("plc", "changed"), ("plc", ""), ("drive", ""), ("drive", "")]


@pytest.mark.requirement("MODB-037")
def test_a_wrong_header_and_half_a_frame_are_said():
    """What cannot be read is in the log all the same."""
    rows = [
        TcpSegment(1, 1, "plc", b"\0\1\0\7\0\2\1\3", ""),
        TcpSegment(2, 2, "plc", b"\0\1\0\0\0\6\1\3", ""),
        TcpSegment(3, 2, "plc", b"", "closed"),
        TcpSegment(4, 3, "plc", b"", "refused"),
    ]
    log = TcpLog(rows, client="plc").update()
    assert [entry.error for entry in log] == ["wrong header", "incomplete", "", "refused"]
    assert "nothing after 00 01 00 07" in log[0].frame.text()


def test_the_log_grows_with_its_source():
    """Called again, it holds what was there before and what has come since."""
    network = Network()
    first = list(network.ask(READ))
    second = network.ask(READ)
    assert second[: len(first)] == first
    assert len(second) == len(first) + 2


def test_a_line_is_read_the_same_way():
    """On a serial line the response belongs to the request before it; a broken frame is said to be one."""
    clock = VirtualScheduler()
    line = SerialLine(clock)
    RtuStation(clock, line, ModbusServer(new_map(), unit=5), name="drive")
    client = RtuClient(clock, line, name="plc", timeout_ns=20 * MS, retries=0)
    log = SerialLog(line.log, master="plc")
    client.submit(READ, 5)
    clock.run_for(100 * MS)
    line.add_hook(
        lambda sender, data, _time: (
            Change(data=data[:-1] + bytes((data[-1] ^ 1,))) if sender == "plc" else None
        )
    )
    client.submit(READ, 5)
    clock.run_for(100 * MS)
    words = [(entry.sender, entry.frame.text().split(" 03")[0], entry.error) for entry in log.update()]
    assert words[:2] == [("plc", "unit 5 request", ""), ("drive", "unit 5 response", "")]
    assert words[2][1].startswith("broken frame: 05")
    assert words[2][2] == "changed"
    assert len(words) == 3


def test_an_answer_that_nobody_asked_for_is_none():
    """A response with a transaction that nobody has begun is no request either."""
    log = TcpLog([TcpSegment(1, 1, "server", tcp_frame(9, 5, b"\3\2\0\1"), "")], client="plc").update()
    assert "unsolicited response" in log[0].frame.text()
