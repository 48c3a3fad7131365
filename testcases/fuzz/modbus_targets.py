"""Modbus: a server and clients that get any bytes."""

from __future__ import annotations

from fieldbus.clock import S, VirtualScheduler
from fieldbus.modbus import (
    Area,
    Block,
    Change,
    ModbusServer,
    Outcome,
    RegisterMap,
    Request,
    RtuClient,
    RtuDecoder,
    RtuStation,
    SerialLine,
    TcpClient,
    TcpDecoder,
    TcpLink,
    TcpResponder,
    TcpSplitter,
    TcpStation,
    rtu_frame,
    tcp_frame,
)
from testcases.fuzz.targets import Take, promise


def modbus() -> Take:
    """Return a server behind TCP and on a serial line; the first byte of an input cuts it into segments and
    runs.
    """
    read = bytes.fromhex("03 0000 0001")
    restart = bytes.fromhex("08 0001 0000")

    class Ear:
        def __init__(self) -> None:
            self.heard: list[tuple[bytes, bool]] = []

        def started(self, time_ns: int) -> None:
            pass

        def received(self, data: bytes, damaged: bool, time_ns: int) -> None:
            self.heard.append((data, damaged))

    def take(data: bytes) -> None:
        registers = RegisterMap()
        for area in Area:
            registers.add(area, Block(0, 200))
            registers.add(area, Block(300, 10, writable=False))
        server = ModbusServer(registers, unit=5, identification={0: b"a", 1: b"b", 2: b"c", 0x80: b"d"})
        size = 1 + (data[0] % 37 if data else 0)
        pieces = [data[at : at + size] for at in range(1, len(data), size)]

        face, check = TcpResponder(server), TcpSplitter()
        for piece in pieces:
            check.feed(face.receive(piece))
            promise(not check.broken and check.pending == 0, "responses that are no frames")
        fresh = TcpResponder(server).receive(tcp_frame(1, 5, read))
        promise(fresh[:9] == bytes.fromhex("0001 0000 0005 05 03 02"), "no response over a new connection")

        scheduler = VirtualScheduler()
        line = SerialLine(scheduler)
        station = RtuStation(scheduler, line, server)
        ear = Ear()
        port = line.attach("ear", ear)
        # An input with a good checksum in front would never come up by chance: every piece is sent with one
        # as well.
        for piece in pieces:
            port.send(piece)
            scheduler.run_for(S)
            port.send(rtu_frame(5, piece[:253]))
            scheduler.run_for(S)
        promise(all(len(frame) <= 256 for frame, _ in ear.heard), "a response longer than a frame")
        promise(not any(damaged for _, damaged in ear.heard), "a response into the request")
        port.send(rtu_frame(5, restart))
        scheduler.run_for(S)
        before = len(ear.heard)
        port.send(rtu_frame(5, read))
        scheduler.run_for(S)
        promise(len(ear.heard) == before + 1, "no response on the line")
        promise(not station.missed, "a frame that was missed although the line was quiet")

    return take


def modbus_client() -> Take:
    """Return the clients of both links; the input is what comes instead of every response."""

    def take(data: bytes) -> None:
        scheduler = VirtualScheduler()
        line, link = SerialLine(scheduler), TcpLink(scheduler)
        server = ModbusServer(RegisterMap(), unit=5)
        RtuStation(scheduler, line, server)
        TcpStation(scheduler, link, server)
        master = RtuClient(scheduler, line)
        client = TcpClient(scheduler, lambda handler: link.connect("client", handler), outstanding=4)
        asked = [
            Request(3, 0, 2),
            Request(1, 0, 9),
            Request(16, 0, 1, (7,)),
            Request(43, code=1),
            Request(8, data=b"\0\0"),
        ]

        def instead(sender: str, sent: bytes, _now: int) -> Change | None:
            if sender not in ("station", "server"):
                return None
            # once as it is, once with the head of the response, so that it is looked at
            size = 7 if sender == "server" else 1
            return Change(data=data if data[:1] < b"\x80" else sent[:size] + data[1:])

        ends = [line.add_hook(instead), link.add_hook(instead)]
        jobs = [one.submit(request, 5) for one in (master, client) for request in asked]
        scheduler.run_for(60 * S)
        promise(all(job.result is not None for job in jobs), "a request that never ends")
        for end in ends:
            end()
        for one in (master, client):
            job = one.submit(asked[0], 5)
            scheduler.run_for(10 * S)
            promise(
                job.result is not None and job.result.outcome is Outcome.EXCEPTION, "no exception afterwards"
            )
        rtu, tcp = RtuDecoder(), TcpDecoder()
        promise(all(rtu.text(entry.data) for entry in line.log), "a frame without a text")
        for entry in link.log:
            tcp.text(entry.data, from_server=entry.sender == "server")

    return take
