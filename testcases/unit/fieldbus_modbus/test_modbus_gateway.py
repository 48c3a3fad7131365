"""A gateway from TCP to a serial line with units behind it."""

import pytest

from fieldbus.clock import MS, S, VirtualScheduler
from fieldbus.errors import ConfigurationError
from fieldbus.modbus import (
    Area,
    Block,
    ModbusServer,
    Outcome,
    RegisterMap,
    Request,
    RtuClient,
    RtuStation,
    SerialLine,
    TcpClient,
    TcpGateway,
    TcpLink,
    TcpSplitter,
    tcp_frame,
)


class Plant:
    """Two units on a line, a gateway, clients on TCP."""

    def __init__(self, **options):
        self.scheduler = VirtualScheduler()
        self.line = SerialLine(self.scheduler)
        self.units = {}
        self.stations = {}
        for unit in (3, 7):
            registers = RegisterMap()
            registers.add(Area.HOLDING_REGISTERS, Block(0, 10)).values[0] = 0x1000 + unit
            server = ModbusServer(registers, unit=unit, identification={0: b"a", 1: b"b", 2: b"%d" % unit})
            self.units[unit] = registers
            self.stations[unit] = RtuStation(self.scheduler, self.line, server, name=f"unit {unit}")
        self.link = TcpLink(self.scheduler)
        master = RtuClient(self.scheduler, self.line, retries=0, timeout_ns=100 * MS)
        self.gateway = TcpGateway(self.link, master, self.scheduler, **options)

    def client(self, outstanding=16):
        return TcpClient(
            self.scheduler,
            lambda handler: self.link.connect("client", handler),
            outstanding=outstanding,
            retries=0,
            timeout_ns=20 * S,
        )

    def ask(self, request, unit):
        job = self.client().submit(request, unit)
        self.scheduler.run_for(S)
        if job.result is None or job.result.outcome is Outcome.TIMEOUT:
            return None
        response = job.result.response
        return f"exception {response.exception}" if response.exception else response


@pytest.mark.requirement("MODB-039", "MODB-040")
def test_each_unit_is_reached_from_several_connections():
    """Requests of two connections to two units come back to whom they belong, one after the other on the
    line.
    """
    plant = Plant()
    clients = [plant.client(), plant.client()]
    jobs = [
        (unit, client.submit(Request(3, 0, 1), unit))
        for _ in range(3)
        for client in clients
        for unit in (3, 7)
    ]
    plant.scheduler.run_for(5 * S)
    assert [job.result.response.values[0] for _, job in jobs] == [0x1000 + unit for unit, _ in jobs]
    assert plant.line.collisions == 0
    assert plant.ask(Request(16, 1, 2, (5, 6)), 7).exception == 0
    assert plant.units[7].get(Area.HOLDING_REGISTERS, 2) == 6
    identified = plant.ask(Request(43, code=1), 3)
    assert identified.exception == 0
    assert plant.ask(Request(8, data=b"\x12\x34"), 3).data == b"\x12\x34"


@pytest.mark.requirement("MODB-022", "MODB-023", "MODB-030", "MODB-031")
def test_what_the_gateway_and_what_the_units_refuse():
    """0B for a unit that does not answer, 0A for one that there cannot be and for a line that is away; the
    units' own codes.
    """
    plant = Plant()
    assert plant.ask(Request(3, 0, 1), 9) == "exception 11"
    assert plant.ask(Request(3, 0, 1), 248) == "exception 10"
    assert plant.ask(Request(3, 100, 1), 3) == "exception 2"
    assert plant.ask(Request(3, 0, 1), 3).values == (0x1003,)
    plant.stations[3].online = False
    assert plant.ask(Request(3, 0, 1), 3) == "exception 11"
    plant.gateway.master.port.online = False
    assert plant.ask(Request(3, 0, 1), 7) == "exception 10"
    plant.gateway.master.port.online = True
    assert plant.ask(Request(3, 0, 1), 7).values == (0x1007,)


@pytest.mark.requirement("MODB-027")
def test_more_requests_than_it_keeps():
    """The gateway is busy (06) when its places are taken, and not any more when they are free."""
    plant = Plant(waiting=2)
    client = plant.client()
    jobs = [client.submit(Request(3, 0, 1), 3) for _ in range(4)]
    plant.scheduler.run_for(2 * S)
    assert [job.result.response.exception for job in jobs] == [0, 0, 6, 6]
    assert plant.ask(Request(3, 0, 1), 3).values == (0x1003,)
    with pytest.raises(ConfigurationError, match="waiting"):
        Plant(waiting=0)


@pytest.mark.requirement("MODB-007", "MODB-024", "MODB-035", "MODB-037")
def test_broadcasts_nonsense_and_connections_that_end():
    """A broadcast reaches all in silence; no requests are 01 and 03; a wrong header ends the connection;
    nobody misses an end.
    """
    plant = Plant()
    assert plant.ask(Request(16, 5, 1, (77,)), 0) is None
    assert [registers.get(Area.HOLDING_REGISTERS, 5) for registers in plant.units.values()] == [77, 77]
    heard = []
    open_before = len(plant.gateway.ends)

    class Ear:
        def opened(self):
            pass

        def receive(self, data):
            heard.append(data)

        def closed(self, reason):
            heard.append(reason)

    end = plant.link.connect("ear", Ear())
    plant.scheduler.run_for(MS)
    end.send(
        tcp_frame(1, 3, b"\x63\x00")
        + tcp_frame(2, 3, b"\x03\x00\x00\x00\x7e")
        + tcp_frame(3, 0, b"\x03\x00\x00\x00\x01")
    )
    plant.scheduler.run_for(S)
    assert TcpSplitter().feed(b"".join(heard)) == [(1, 3, b"\xe3\x01"), (2, 3, b"\x83\x03")]
    end.send(tcp_frame(4, 9, Request(3, 0, 1).encode()))
    plant.scheduler.run_for(10 * MS)
    end.send(bytes(12))
    plant.scheduler.run_for(S)
    assert heard[-1] == "closed"
    assert len(plant.gateway.ends) == open_before
    assert plant.ask(Request(3, 0, 1), 3).values == (0x1003,)
