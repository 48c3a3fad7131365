"""Capture files of the logs of both links, read back with nothing but their formats."""

import struct

from fieldbus.clock import MS, S, VirtualScheduler
from fieldbus.modbus import (
    Change,
    ModbusServer,
    RegisterMap,
    Request,
    RtuClient,
    RtuStation,
    SerialLine,
    TcpClient,
    TcpLink,
    TcpStation,
)
from fieldbus.modbus.export import EPOCH_S, write_serial_capture, write_tcp_capture

FIN, SYN, RST, PSH, ACK = 1, 2, 4, 8, 16


def records(path):
    """Return link type and (time in ns, data) of a capture."""
    data = path.read_bytes()
    magic, major, minor, _, _, _, link_type = struct.unpack_from("<IHHiIII", data)
    assert (magic, major, minor) == (0xA1B23C4D, 2, 4)
    found, at = [], 24
    while at < len(data):
        seconds, rest, size, whole = struct.unpack_from("<IIII", data, at)
        assert size == whole
        found.append(((seconds - EPOCH_S) * S + rest, data[at + 16 : at + 16 + size]))
        at += 16 + size
    return link_type, found


def tcp(path):
    """Return (source port, destination port, sequence, acknowledgement, flags, data) of each packet."""
    link_type, found = records(path)
    assert link_type == 101
    rows = []
    for _, packet in found:
        assert packet[0] == 0x45
        assert struct.unpack_from(">H", packet, 2)[0] == len(packet)
        source, target, sequence, expected, size, flags = struct.unpack_from(">HHIIBB", packet, 20)
        assert size == 0x50
        rows.append((source, target, sequence, expected, flags, packet[40:]))
    return rows


def run(*hooks, listening=True):
    scheduler = VirtualScheduler()
    link = TcpLink(scheduler)
    if listening:
        TcpStation(scheduler, link, ModbusServer(RegisterMap()))
    client = TcpClient(scheduler, lambda handler: link.connect("client", handler), retries=0)
    for hook in hooks:
        link.add_hook(hook)
    for _ in range(2):
        client.submit(Request(3, 0, 1))
        scheduler.run_for(2 * S)
    client.close()
    scheduler.run_for(S)
    return link


def test_a_connection_from_handshake_to_end(tmp_path):
    """Handshake, data with sequence numbers that fit on either side, end; times as in the log."""
    link = run()
    path = write_tcp_capture(link.log, tmp_path / "a.pcap")
    rows = tcp(path)
    assert [row[4] for row in rows] == [SYN, SYN | ACK, ACK, *[PSH | ACK] * 4, FIN | ACK]
    next_sequence = {True: 0, False: 0}
    for source, target, sequence, expected, flags, data in rows:
        from_server = source == 502
        assert 502 in (source, target)
        assert sequence == next_sequence[from_server]
        next_sequence[from_server] += len(data) + bool(flags & (SYN | FIN))
        if flags & ACK:
            assert expected == next_sequence[not from_server]
    assert [row[5] for row in rows if row[5]] == [entry.data for entry in link.log if entry.data]
    assert [time for time, packet in records(path)[1] if len(packet) > 40] == [
        e.time_ns for e in link.log if e.data
    ]


def test_what_was_refused_reset_or_dropped(tmp_path):
    """A refused connection is reset at once; what a fault drops is not there; a log may begin in the
    middle.
    """
    assert [row[4] for row in tcp(write_tcp_capture(run(listening=False).log, tmp_path / "a.pcap"))] == [
        SYN,
        RST | ACK,
        SYN,
        RST | ACK,
    ]
    dropped = run(lambda sender, _data, _now: Change(drop=True) if sender == "server" else None)
    rows = tcp(write_tcp_capture(dropped.log, tmp_path / "b.pcap"))
    assert not [row for row in rows if row[0] == 502 and row[5]]
    reset = run(lambda sender, _data, _now: Change(reset=True) if sender == "server" else None)
    assert RST | ACK in [row[4] for row in tcp(write_tcp_capture(reset.log, tmp_path / "c.pcap"))]
    whole = run()
    rows = tcp(write_tcp_capture(whole.log[2:], tmp_path / "d.pcap"))
    assert [row[4] for row in rows][:3] == [SYN, SYN | ACK, ACK]
    assert len([row for row in rows if row[5]]) == 3


def test_a_serial_line(tmp_path):
    """Frames with their end time, without those that never came through."""
    scheduler = VirtualScheduler()
    line = SerialLine(scheduler)
    RtuStation(scheduler, line, ModbusServer(RegisterMap()))
    client = RtuClient(scheduler, line, retries=0)
    client.submit(Request(3, 0, 1))
    scheduler.run_for(S)
    line.add_hook(lambda sender, _data, _now: Change(drop=True) if sender == "station" else None)
    client.submit(Request(3, 0, 1))
    scheduler.run_for(S)
    noise = line.attach("noise", client.port.listener)
    client.submit(Request(3, 0, 1))
    scheduler.run_for(MS)
    noise.send(bytes(3))
    scheduler.run_for(S)
    link_type, found = records(write_serial_capture(line.log, tmp_path / "a.pcap"))
    assert link_type == 147
    assert [data.hex() for _, data in found] == [
        "010300000001840a",
        "018302c0f1",
        "010300000001840a",
    ]
    assert [time for time, _ in found] == [frame.end_ns for frame in line.log if not frame.note]
