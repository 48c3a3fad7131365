"""Modbus devices under a plain client, on a line, over TCP and behind a gateway: every function with its
limits and exceptions, gaps within frames, identification, diagnostics, and an I/O station with its channels.
"""

from __future__ import annotations

import math
import struct
from functools import partial
from itertools import pairwise
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, Final

from emulators.io import (
    AnalogInput,
    AnalogOutput,
    CounterInput,
    DigitalInput,
    DigitalOutput,
    ModbusIoStation,
)
from fieldbus.modbus import (
    Area,
    Block,
    ModbusServer,
    Outcome,
    Parity,
    RegisterMap,
    Request,
    RtuClient,
    RtuDecoder,
    RtuStation,
    SerialFormat,
    SerialLine,
    TcpClient,
    TcpDecoder,
    TcpGateway,
    TcpLink,
    TcpStation,
    rtu_frame,
    tcp_frame,
)
from fieldbus.modbus.decode import request_text, response_text
from fieldbus.modbus.export import write_serial_capture, write_tcp_capture
from hil.campaign import Campaign, CaseContext
from testcases.campaigns.support import equal, same

CAMPAIGN: Final = Campaign(
    "modbus stations", controller="", tags=("modbus",), bench="testcases.campaigns.can_bus:BENCH"
)
MS: Final = 1_000_000
UNIT: Final = 5
IDENTITY: Final = {0: b"ACME", 1: b"D-1", 2: b"1.0", 4: b"drive", 0x80: b"extra"}


def scheduler_of(ctx: CaseContext) -> Any:
    """Return the clock of the bench."""
    segment: Any = ctx.bench.segment("can0")
    return segment.scheduler


# -- functions ----------------------------------------------------------------------------------------------


def device(unit: int | None = UNIT, count: int = 2200) -> ModbusServer:
    """Return a device with all areas from address 10 on; a register holds 1000h and its address, every third
    bit is set.
    """
    registers = RegisterMap("device")
    for area in Area:
        bits = area in (Area.COILS, Area.DISCRETE_INPUTS)
        block = registers.add(area, Block(10, count, name=area.value))
        block.values[:] = [at % 3 == 0 if bits else 0x1000 + at for at in range(10, 10 + count)]
    return ModbusServer(registers, unit=unit, identification=IDENTITY)


EXCHANGES: Final = (
    ("01 000A 0009", "01 02 24 01"),
    ("02 000C 0001", "02 01 01"),
    ("03 000A 0002", "03 04 100A 100B"),
    ("04 0010 0001", "04 02 1010"),
    ("01 000A 0000", "81 03"),
    ("01 000A 07D1", "81 03"),
    ("02 000A 07D1", "82 03"),
    ("03 000A 0000", "83 03"),
    ("03 000A 007E", "83 03"),
    ("04 000A 007E", "84 03"),
    ("01 0009 0001", "81 02"),
    ("01 08A2 0001", "81 02"),
    ("01 08A1 0002", "81 02"),
    ("03 0009 0002", "83 02"),
    ("04 FFFF 0002", "84 02"),
    ("03 000A 00", "83 03"),
    ("03 000A 0001 00", "83 03"),
    ("05 000A FF00", "05 000A FF00"),
    ("01 000A 0001", "01 01 01"),
    ("05 000A 0000", "05 000A 0000"),
    ("01 000A 0001", "01 01 00"),
    ("05 000A 0001", "85 03"),
    ("05 0009 FF00", "85 02"),
    ("06 000A ABCD", "06 000A ABCD"),
    ("03 000A 0001", "03 02 ABCD"),
    ("06 08A2 0001", "86 02"),
    ("0F 000A 000A 02 FF02", "0F 000A 000A"),
    ("01 000A 000A", "01 02 FF 02"),
    ("0F 000A 000A 01 FF", "8F 03"),
    ("0F 000A 0000 00", "8F 03"),
    ("0F 08A0 0003 01 07", "8F 02"),
    ("10 000A 0002 04 1234 5678", "10 000A 0002"),
    ("03 000A 0002", "03 04 1234 5678"),
    ("10 000A 0002 03 1234 56", "90 03"),
    ("10 000A 0000 00", "90 03"),
    ("10 000A 0002 04 1234", "90 03"),
    ("10 0009 0001 02 0000", "90 02"),
    ("06 000A 3600", "06 000A 3600"),
    ("16 000A F0F0 0F0F", "16 000A F0F0 0F0F"),
    ("03 000A 0001", "03 02 3F0F"),
    ("06 000A 0012", "06 000A 0012"),
    ("16 000A 00F2 0025", "16 000A 00F2 0025"),
    ("03 000A 0001", "03 02 0017"),
    ("06 000A 3F0F", "06 000A 3F0F"),
    ("16 0009 FFFF 0000", "96 02"),
    ("16 000A FFFF", "96 03"),
    ("17 000A 0002 000B 0001 02 0064", "17 04 3F0F 0064"),
    ("17 000A 0000 000B 0001 02 0064", "97 03"),
    ("17 000A 007E 000B 0001 02 0064", "97 03"),
    ("17 000A 0001 000B 0000 00", "97 03"),
    ("17 000A 0001 000B 0001 03 0064 00", "97 03"),
    ("17 0009 0001 000B 0001 02 7777", "97 02"),
    ("17 000A 0001 0009 0001 02 7777", "97 02"),
    ("03 000B 0001", "03 02 0064"),
    ("07", "87 01"),
    ("0B", "8B 01"),
    ("14 00", "94 01"),
    ("18 0000", "98 01"),
    ("64 0000", "E4 01"),
    ("08 0000 A537", "88 01"),
    ("2B 0E 01 00", "2B 0E 01 83 00 00 03 00 04 41434D45 01 03 442D31 02 03 312E30"),
    ("2B 0E 02 03", "2B 0E 02 83 00 00 04 00 04 41434D45 01 03 442D31 02 03 312E30 04 05 6472697665"),
    ("2B 0E 04 04", "2B 0E 04 83 00 00 01 04 05 6472697665"),
    ("2B 0E 04 03", "AB 02"),
    ("2B 0E 05 00", "AB 03"),
    ("2B 0D 00 00", "AB 01"),
)
"""Requests and responses over TCP, hexadecimal, one after the other."""


@CAMPAIGN.case(
    "functions",
    requirements=(
        "MODB-012",
        "MODB-013",
        "MODB-014",
        "MODB-015",
        "MODB-017",
        "MODB-018",
        "MODB-019",
        "MODB-020",
        "MODB-021",
        "MODB-022",
        "MODB-023",
        "MODB-024",
        "MODB-032",
    ),
)
def functions(ctx: CaseContext) -> None:
    """Every function byte for byte, with each way of being refused, and in the order of the checks."""
    server = device()
    for request, response in EXCHANGES:
        found = server.respond(bytes.fromhex(request)) or b""
        same(ctx, f"response to {request}", found.hex(" "), bytes.fromhex(response).hex(" "), "MODB-032")
    for function, most, size in ((1, 2000, 250), (2, 2000, 250), (3, 125, 250), (4, 125, 250)):
        found = server.respond(bytes((function, 0, 10)) + most.to_bytes(2, "big")) or b""
        same(
            ctx,
            f"{most} with function {function}",
            (found[0], found[1], len(found)),
            (function, size, size + 2),
        )
    for function, most, size in ((15, 1968, 246), (16, 123, 246)):
        for count, code in ((most, function), (most + 1, function | 0x80)):
            length = -(-count // 8) if function == 15 else 2 * count
            data = (
                bytes((function, 0, 10)) + count.to_bytes(2, "big") + bytes((length & 0xFF,)) + bytes(length)
            )
            found = server.respond(data) or b""
            equal(ctx, f"{count} with function {function} ({size})", found[0], code, "MODB-017")
    for count, code in ((121, 0x17), (122, 0x97)):
        data = (
            bytes.fromhex("17 000A 0001 000A")
            + count.to_bytes(2, "big")
            + bytes((2 * count,))
            + bytes(2 * count)
        )
        found = server.respond(data) or b""
        equal(ctx, f"{count} written with function 23", found[0], code, "MODB-020")
    same(ctx, "an empty request", server.respond(b""), None)
    server.powered = False
    same(ctx, "without supply", server.respond(bytes.fromhex("03 000A 0001")), None)


SERIAL: Final = (
    ("08 0000 A537", "08 0000 A537"),
    ("08 0001 0000", "08 0001 0000"),
    ("08 000E 0000", "08 000E 0001"),
    ("03 0009 0001", "83 02"),
    ("08 000D 0000", "08 000D 0001"),
    ("08 000E 0000", "08 000E 0004"),
    ("08 000D 0001", "88 03"),
    ("08 0063 0000", "88 01"),
    ("08 0001 1234", "88 03"),
    ("08 000A 0000", "08 000A 0000"),
    ("08 000E 0000", "08 000E 0001"),
    ("08 0004 0000", ""),
    ("03 000A 0001", ""),
    ("06 000A 7777", ""),
    ("08 0001 0000", ""),
    ("03 000A 0001", "03 02 100A"),
    ("08 0001 FF00", "08 0001 FF00"),
)
"""Requests and responses on a line; empty: none."""


@CAMPAIGN.case("diagnostics", requirements=("MODB-007", "MODB-016", "MODB-035"))
def diagnostics(ctx: CaseContext) -> None:
    """Function 08 on a line: echo, restart, listen only, counters; broadcasts write in silence."""
    server = device()
    for request, response in SERIAL:
        found = server.respond(bytes.fromhex(request), serial=True) or b""
        same(ctx, f"response to {request}", found.hex(" "), bytes.fromhex(response).hex(" "), "MODB-016")
    for request, address, value in (
        ("06 000A 0101", 10, 0x0101),
        ("10 000B 0001 02 0202", 11, 0x0202),
        ("06 0009 0303", 10, 0x0101),
        ("16 000A 0000 FFFF", 10, None),
    ):
        found = server.respond(bytes.fromhex(request), serial=True, broadcast=True)
        same(ctx, f"response to broadcast {request}", found, None, "MODB-007")
        if value is not None:
            held = server.registers.get(Area.HOLDING_REGISTERS, address)
            equal(ctx, f"register {address} after it", held, value, "MODB-035")
    same(
        ctx,
        "read by broadcast",
        server.respond(bytes.fromhex("03 000A 0001"), serial=True, broadcast=True),
        None,
    )


# -- the line -----------------------------------------------------------------------------------------------


class Ear:
    """Hears a line."""

    def __init__(self) -> None:
        self.frames: list[tuple[int, bytes, bool]] = []

    def started(self, time_ns: int) -> None:
        """Something begins."""

    def received(self, data: bytes, damaged: bool, time_ns: int) -> None:
        """Keep a piece."""
        self.frames.append((time_ns, data, damaged))


@CAMPAIGN.product(
    "line/rate-{baud}-{parity}-{bits}",
    parameters=[
        {"baud": 4800, "parity": "even", "stop": None, "bits": 11, "t15": 3.4375, "t35": 8.0208},
        {"baud": 9600, "parity": "odd", "stop": None, "bits": 11, "t15": 1.7188, "t35": 4.0104},
        {"baud": 19200, "parity": "none", "stop": None, "bits": 11, "t15": 0.8594, "t35": 2.0052},
        {"baud": 19200, "parity": "none", "stop": 1, "bits": 10, "t15": 0.7813, "t35": 1.8229},
        {"baud": 38400, "parity": "even", "stop": 2, "bits": 12, "t15": 0.75, "t35": 1.75},
        {"baud": 115200, "parity": "even", "stop": None, "bits": 11, "t15": 0.75, "t35": 1.75},
    ],
    title="a line with {baud} bit/s, parity {parity}",
    requirements=("MODB-001", "MODB-002", "MODB-003", "MODB-005", "MODB-006", "MODB-011"),
)
def rate(
    ctx: CaseContext, baud: int, parity: str, stop: int | None, bits: int, t15: float, t35: float
) -> None:
    """Times of characters and pauses; the response begins t3.5 after the request, and both have their CRC."""
    scheduler = scheduler_of(ctx)
    form = SerialFormat(baud, parity=Parity(parity), stop_bits=stop)
    line = SerialLine(scheduler, format_=form)
    station = RtuStation(scheduler, line, device())
    ear = Ear()
    port = line.attach("tester", ear)
    equal(ctx, "bits of a character", form.bits, bits, "MODB-001")
    equal(ctx, "t1.5, ms", form.t15_ns / MS, t15, "MODB-002", within=0.0006)
    equal(ctx, "t3.5, ms", form.t35_ns / MS, t35, "MODB-002", within=0.0006)
    frame = bytes.fromhex("05 03 000A 000A")
    port.send(rtu_frame(5, frame[1:]))
    ctx.run_for(0.2)
    request, response = line.log
    equal(
        ctx,
        "request, ms",
        (request.end_ns - request.start_ns) / MS,
        8 * bits / baud * 1e3,
        "MODB-011",
        within=1e-3,
    )
    equal(
        ctx,
        "response, ms",
        (response.end_ns - response.start_ns) / MS,
        25 * bits / baud * 1e3,
        "MODB-011",
        within=1e-3,
    )
    pause = response.start_ns - request.end_ns - station.processing_ns
    equal(ctx, "pause before the response, ms", pause / MS, t35, "MODB-002", within=0.0006)
    for data in (request.data, response.data):
        crc = 0xFFFF
        for byte in data[:-2]:
            crc ^= byte
            for _ in range(8):
                crc = crc >> 1 ^ (0xA001 if crc & 1 else 0)
        same(ctx, "CRC", data[-2:], crc.to_bytes(2, "little"), "MODB-006")


@CAMPAIGN.case("line/gaps", requirements=("MODB-002", "MODB-004", "MODB-044"))
def gaps(ctx: CaseContext) -> None:
    """A pause within a frame: up to t1.5 it counts, beyond it the frame is discarded, by a lenient station
    only from t3.5 on; the next frame counts again.
    """
    scheduler = scheduler_of(ctx)
    frame = rtu_frame(UNIT, bytes.fromhex("03 000A 0001"))
    for lenient in (False, True):
        line = SerialLine(scheduler)
        RtuStation(scheduler, line, device(), lenient=lenient)
        ear = Ear()
        port = line.attach("tester", ear)
        for characters, counts in ((1.4, True), (1.6, lenient), (3.4, lenient), (3.6, False)):
            for at in (1, 4, 7):
                ear.frames.clear()
                gap_ns = round(characters * line.format.duration_ns(1))
                begun = scheduler.now
                port.send(frame[:at])
                scheduler.at(begun + line.format.duration_ns(at) + gap_ns, partial(port.send, frame[at:]))
                ctx.run_for(0.06)
                what = f"answers with {characters} characters before byte {at}, lenient {lenient}"
                equal(ctx, what, len(ear.frames), counts, "MODB-004")
        for wrong in (
            frame[:-1] + bytes((frame[-1] ^ 1,)),
            frame[:3],
            rtu_frame(UNIT + 1, frame[1:-2]),
            frame[:1],
        ):
            ear.frames.clear()
            port.send(wrong)
            ctx.run_for(0.06)
            equal(ctx, f"answers to {wrong.hex(' ')}", len(ear.frames), 0, "MODB-008")
        port.send(frame)
        ctx.run_for(0.06)
        equal(ctx, "answers to a good frame", len(ear.frames), 1, "MODB-008")


@CAMPAIGN.case("gateway", requirements=("MODB-022", "MODB-030", "MODB-031", "MODB-039", "MODB-040"))
def gateway(ctx: CaseContext) -> None:
    """Requests of two connections to two units come back to whom they belong; 0Bh for a unit that is silent,
    0Ah for one that cannot be; the units' own exceptions pass.
    """
    scheduler = scheduler_of(ctx)
    line = SerialLine(scheduler, format_=SerialFormat(115_200))
    units = {unit: device(unit) for unit in (3, 7)}
    for unit, server in units.items():
        server.registers.write(Area.HOLDING_REGISTERS, 10, (0x2000 + unit,))
        RtuStation(scheduler, line, server, name=f"unit {unit}")
    link = TcpLink(scheduler)
    TcpGateway(link, RtuClient(scheduler, line, retries=0, timeout_ns=20 * MS), scheduler)

    def client(name: str) -> TcpClient:
        return TcpClient(
            scheduler,
            lambda handler: link.connect(name, handler),
            retries=0,
            timeout_ns=10_000 * MS,
            outstanding=16,
        )

    clients = [client("a"), client("b")]
    jobs = [
        (unit, one.submit(Request(3, 10, 1), unit)) for _ in range(3) for one in clients for unit in (3, 7)
    ]
    ctx.run_for(0.3)
    for unit, job in jobs:
        same(
            ctx,
            f"register of unit {unit}",
            job.result and job.result.response.values,
            (0x2000 + unit,),
            "MODB-040",
        )
    equal(ctx, "collisions on the line", line.collisions, 0, "MODB-010")
    for unit, request, code in (
        (9, Request(3, 10, 1), 11),
        (3, Request(3, 9, 1), 2),
        (7, Request(16, 11, 2, (5, 6)), 0),
    ):
        job = clients[0].submit(request, unit)
        ctx.run_for(0.2)
        found = job.result.response.exception if job.result and job.result.response else -1
        equal(ctx, f"exception of function {request.function} to unit {unit}", found, code, "MODB-031")
    equal(
        ctx, "written through the gateway", units[7].registers.get(Area.HOLDING_REGISTERS, 12), 6, "MODB-018"
    )


# -- the I/O station ----------------------------------------------------------------------------------------


class Station:
    """An I/O station and a plain client of it.

    Args:
        ctx: The case.
        transport: `tcp` or `rtu`.
        watchdog_ms: Time without a write after which outputs take their substitutes; 0: never.

    """

    def __init__(self, ctx: CaseContext, transport: str = "tcp", watchdog_ms: float = 0.0) -> None:
        self.ctx = ctx
        scheduler = scheduler_of(ctx)
        self.count = 0
        self.levels: list[bool] = []
        self.volts: list[float] = []
        self.station = ModbusIoStation(
            scheduler,
            digital_inputs=[DigitalInput(scheduler, 3.0) for _ in range(17)] + [DigitalInput(scheduler, 0.0)],
            digital_outputs=[DigitalOutput(self.levels.append)]
            + [DigitalOutput() for _ in range(16)]
            + [DigitalOutput(substitute=None), DigitalOutput(substitute=True)],
            analog_inputs=[
                AnalogInput(scheduler, bipolar=True),
                AnalogInput(scheduler, 4.0, 20.0, wire_break_below=3.6),
                AnalogInput(scheduler, smoothing_ms=10.0),
            ],
            analog_outputs=[
                AnalogOutput(on_change=self.volts.append),
                AnalogOutput(-5.0, 5.0, substitute=None),
            ],
            counters=[CounterInput(lambda: self.count)],
            watchdog_ms=watchdog_ms,
        )
        self.client: TcpClient | RtuClient
        if transport == "rtu":
            line = SerialLine(scheduler, format_=SerialFormat(115_200))
            RtuStation(scheduler, line, self.station.server)
            self.client = RtuClient(scheduler, line)
        else:
            link = TcpLink(scheduler)
            TcpStation(scheduler, link, self.station.server)
            self.client = TcpClient(scheduler, lambda handler: link.connect("client", handler))

    def ask(self, *request: Any) -> Any:
        """Return the values of a response; an exception as a negative number."""
        job = self.client.submit(Request(*request))
        self.ctx.wait_until(lambda: job.result is not None, 10.0, "the station answers")
        result: Any = job.result
        return -result.response.exception if result.outcome is Outcome.EXCEPTION else result.response.values

    def same(self, what: str, found: object, wanted: object, *ids: str) -> None:
        """Expect a value of any kind."""
        same(self.ctx, what, found, wanted, *ids)


@CAMPAIGN.product(
    "station/channels-{transport}",
    parameters={"transport": ("tcp", "rtu")},
    title="channels of an I/O station over {transport}",
    requirements=("MODB-012", "MODB-013", "MODB-017", "MODB-018", "MODB-020", "MODB-033"),
)
def channels(ctx: CaseContext, transport: str) -> None:
    """Each channel has its place in its area and in the image, and no other moves with it."""
    rig = Station(ctx, transport)
    station = rig.station
    for number in (0, 3, 15, 16, 17):
        station.input(number).set(True)
        ctx.run_for(0.005)
        bits = tuple(int(at == number) for at in range(18))
        rig.same(f"inputs with {number}", rig.ask(2, 0, 18), bits, "MODB-012")
        words = (1 << number & 0xFFFF, 1 << number >> 16)
        rig.same(f"image with input {number}", rig.ask(3, 0x1000, 2), words, "MODB-033")
        station.input(number).set(False)
        ctx.run_for(0.005)
    for number in (0, 7, 16, 18):
        rig.ask(5, number, 1, (1,))
        rig.same(
            f"outputs with {number}", [int(one.value) for one in station.digital_outputs].index(1), number
        )
        rig.same("read back", rig.ask(1, 0, 19), tuple(int(at == number) for at in range(19)), "MODB-012")
        rig.same("in the image", rig.ask(3, 0x2000, 2), (1 << number & 0xFFFF, 1 << number >> 16), "MODB-033")
        rig.ask(15, 0, 19, (0,) * 19)
    rig.same("changes of output 0", rig.levels, [True, False])
    for word, volts, other in ((27648, 10.0, 5.0), (13824, 5.0, 0.0), (-13824, -5.0, -10.0), (0, 0.0, -5.0)):
        rig.ask(16, 0, 2, (word & 0xFFFF, word & 0xFFFF))
        found = [one.value for one in station.analog_outputs]
        equal(ctx, "V", found[0], volts, "MODB-018", within=1e-6)
        equal(ctx, "V of the other range", found[1], other, "MODB-018", within=1e-6)
    equal(ctx, "last voltage at the wire", rig.volts[-1], 0.0)
    rig.ask(6, 0, 1, (32_767,))
    equal(ctx, "V beyond the range", station.analog_output(0).value, 10.0 * 32_511 / 27_648, within=1e-3)
    rig.count = -5
    rig.same("counter", rig.ask(3, 0x1005, 2), (0xFFFF, 0xFFFB), "MODB-033")
    rig.count = 0x8000_0001
    equal(ctx, "counter beyond 31 bits", station.counter(0).count, -0x7FFF_FFFF)
    rig.same("inputs can be written", isinstance(rig.ask(6, 0x1000, 1, (1,)), tuple), False)
    rig.same("beyond the image", rig.ask(3, 0x1007, 1), -2, "MODB-023")
    written = rig.ask(23, 0x1000, 2, (0x0005,), 0x2000)
    rig.same("exchange", written, (0, 0), "MODB-020")
    rig.same("outputs by the exchange", rig.ask(1, 0, 4), (1, 0, 1, 0), "MODB-020")


ANALOG: Final = (
    (0, 0.0, 0),
    (0, 10.0, 27_648),
    (0, -10.0, -27_648),
    (0, 11.75, 32_486),
    (0, 11.77, 32_767),
    (0, -11.75, -32_486),
    (0, -11.77, -32_768),
    (1, 4.0, 0),
    (1, 12.0, 13_824),
    (1, 20.0, 27_648),
    (1, 22.81, 32_504),
    (1, 22.82, 32_767),
    (1, 3.7, -518),
    (1, 3.59, 32_767),
)
"""Analog input, quantity, word: 27648 is the end of the range, 32767 and -32768 lie beyond it."""


@CAMPAIGN.case("station/inputs", requirements=("MODB-012", "MODB-013"))
def inputs(ctx: CaseContext) -> None:
    """Filters pass what lasts longer, from its last bounce on; words of analog inputs at the borders of their
    ranges; smoothing.
    """
    rig = Station(ctx)
    station = rig.station
    for length_us, seen in ((2_990, 0), (3_010, 1)):
        channel = station.input(1)
        channel.set(True)
        ctx.run_for(length_us / 1e6)
        equal(ctx, f"seen after {length_us} us", channel.value, seen)
        channel.set(False)
        ctx.run_for(0.01)
        equal(ctx, "seen afterwards", channel.value, 0)
    bouncing = station.input(2)
    for rests in (False, True):
        bouncing.set(rests)
        ctx.run_for(0.004)
        for away_s, back_s in ((0.002, 0.001), (0.0025, 0.0004), (0.0014, 0.0015)):
            for _ in range(4):
                bouncing.set(not rests)
                ctx.run_for(away_s)
                equal(ctx, "bouncing is seen", bouncing.value, rests)
                bouncing.set(rests)
                ctx.run_for(back_s)
                equal(ctx, "bouncing is seen", bouncing.value, rests)
    station.input(17).set(True)
    equal(ctx, "without filter at once", station.input(17).value, 1)
    for number, quantity, word in ANALOG:
        station.analog_input(number).set(quantity)
        rig.same(f"word for {quantity}", rig.ask(4, number, 1), (word & 0xFFFF,), "MODB-013")
    smooth = station.analog_input(2)
    smooth.set(10.0)
    ctx.run_for(0.01)
    equal(ctx, "word after a time constant", smooth.word, 27_648 * (1 - math.exp(-1)), within=1)
    smooth.set(0.0)
    ctx.run_for(0.2)
    equal(ctx, "word in the end", smooth.word, 0, within=1)


@CAMPAIGN.case("station/watchdog", requirements=("MODB-042",))
def watchdog(ctx: CaseContext) -> None:
    """Without a write for the time outputs take their substitutes or stay; reading does not help, the next
    write ends it; without supply all are off.
    """
    rig = Station(ctx, watchdog_ms=100.0)
    station = rig.station
    ctx.run_for(0.3)
    equal(ctx, "substituted before the first write", station.substituted, 0)
    rig.ask(15, 0, 18, (1,) * 18)
    rig.ask(16, 0, 2, (100, 200))
    ctx.run_for(0.09)
    rig.ask(15, 0, 1, (1,))
    written = ctx.now_s
    ctx.run_for(0.04)
    rig.ask(1, 0, 1)
    ctx.run_for(written + 0.09 - ctx.now_s)
    equal(ctx, "substituted before the time", station.substituted, 0)
    ctx.run_for(0.012)
    equal(ctx, "substituted after the time", station.substituted, 1)
    levels = [int(one.value) for one in station.digital_outputs]
    rig.same("outputs", levels, [0] * 17 + [1, 1])
    rig.same("words", [one.word for one in station.analog_outputs], [0, 200])
    rig.ask(15, 0, 1, (1,))
    equal(ctx, "substituted after a write", station.substituted, 0)
    equal(ctx, "output", station.output(0).value, 1)
    rig.count = 77
    station.power_off()
    rig.same("outputs without supply", sum(one.value for one in station.digital_outputs), 0)
    rig.same("answer without supply", station.server.respond(bytes.fromhex("01 0000 0001")), None)
    station.power_on()
    equal(ctx, "counter after power-on", station.counter(0).count, 0)
    rig.count = 80
    equal(ctx, "counter goes on", station.counter(0).count, 3)


@CAMPAIGN.case("station/faults")
def faults(ctx: CaseContext) -> None:
    """Channels that are held, broken, exchanged or falsified, each kind, and right again afterwards."""
    rig = Station(ctx)
    station = rig.station
    for kind, number, level in (("input", 17, station.input(17)), ("output", 3, station.output(3))):

        def now(channel: Any = level, kind: str = kind) -> bool:
            return bool(channel.value if kind == "input" else channel.level)

        level.set(True)
        equal(ctx, f"{kind} is on", now(), 1)
        station.hold(kind, number, 0.0)
        equal(ctx, f"{kind} held at 0", now(), 0)
        level.set(False)
        station.hold(kind, number, 1.0)
        equal(ctx, f"{kind} held at 1", now(), 1)
        station.break_wire(kind, number, broken=True)
        equal(ctx, f"{kind} held at 1, wire broken", now(), kind == "input")
        station.hold(kind, number, None)
        level.set(True)
        equal(ctx, f"{kind} with a broken wire", now(), 0)
        station.break_wire(kind, number, broken=False)
        equal(ctx, f"{kind} repaired", now(), 1)
    source, sink = station.analog_input(0), station.analog_output(0)
    source.set(4.0)
    sink.set(13_824)
    for kind, value in (("analog_input", lambda: source.value), ("analog_output", lambda: sink.level)):
        right = 4.0 if kind == "analog_input" else 5.0
        equal(ctx, kind, value(), right, within=1e-6)
        station.disturb(kind, 0, offset=0.5, gain=2.0)
        equal(ctx, f"{kind} falsified", value(), 2.0 * right + 0.5, within=1e-6)
        station.hold(kind, 0, -3.0)
        equal(ctx, f"{kind} held", value(), -3.0, within=1e-6)
        station.break_wire(kind, 0, broken=True)
        equal(ctx, f"{kind} broken", value(), 0.0, within=1e-6)
        station.break_wire(kind, 0, broken=False)
        station.hold(kind, 0, None)
        station.disturb(kind, 0)
        equal(ctx, f"{kind} right again", value(), right, within=1e-6)
    rig.count = 10
    station.hold("counter", 0, 1.0)
    rig.count = 25
    equal(ctx, "counter held", station.counter(0).count, 10)
    station.break_wire("counter", 0, broken=True)
    station.hold("counter", 0, None)
    rig.count = 30
    equal(ctx, "counter with a broken wire", station.counter(0).count, 10)
    station.break_wire("counter", 0, broken=False)
    rig.count = 33
    equal(ctx, "counter goes on from there", station.counter(0).count, 13)
    station.input(17).set(True)
    station.swap("input", 17, 16)
    ctx.run_for(0.005)
    rig.same("inputs exchanged", rig.ask(2, 16, 2), (1, 0))
    station.swap("input", 17, 16)
    rig.same("inputs right again", rig.ask(2, 16, 2), (0, 1))
    rig.levels.clear()
    station.output(0).set(False)
    station.output(1).set(True)
    station.swap("output", 0, 1)
    rig.same("wire of output 0 after the exchange", rig.levels[-1:], [True])
    station.swap("output", 0, 1)
    rig.same("wire of output 0 right again", rig.levels[-1:], [False])


# -- logs ---------------------------------------------------------------------------------------------------


@CAMPAIGN.case("decoded", requirements=("MODB-038",))
def decoded(ctx: CaseContext) -> None:
    """Frames of a line and of a connection in words: requests, responses, broadcasts, exceptions, what is
    broken and what nobody has asked for.
    """
    line = RtuDecoder()
    read, answer = Request(3, 10, 1).encode(), bytes.fromhex("03 02 100A")
    for frame, begins, contains in (
        (rtu_frame(5, read), "unit 5 request ", "03"),
        (rtu_frame(5, answer), "unit 5 response ", ""),
        (rtu_frame(5, answer), "unit 5 ", "not understood"),
        (rtu_frame(5, read), "unit 5 request ", ""),
        (rtu_frame(7, read), "unit 7 request ", ""),
        (rtu_frame(7, b"\x83\x02"), "unit 7 response ", ""),
        (rtu_frame(0, bytes.fromhex("06 000A 1234")), "broadcast request ", ""),
        (rtu_frame(5, read)[:-1] + b"\0", "broken frame: ", "05 03"),
        (rtu_frame(5, b"\x64\1\2"), "unit 5 ", "not understood"),
    ):
        text = line.text(frame)
        fits = text.startswith(begins) and contains in text
        equal(ctx, f"{frame.hex(' ')} is {text!r}", fits, 1, "MODB-006")
    stream = TcpDecoder()
    request, response = tcp_frame(9, 5, read), tcp_frame(9, 5, answer)
    for data, server, begins in (
        (request[:5], False, []),
        (request[5:] + request, False, ["transaction 9 unit 5 request "] * 2),
        (response, True, ["transaction 9 unit 5 response "]),
        (response, True, ["transaction 9 unit 5 unsolicited response: "]),
        (tcp_frame(4, 5, read), False, ["transaction 4 unit 5 request "]),
        (tcp_frame(4, 5, b"\x03\x04\0\0\0\0"), True, ["transaction 4 unit 5 response that does not fit: "]),
        (b"\0\1\0\7\0\6" + bytes(6), False, ["wrong header"]),
        (b"\0\1\0\7\0\6" + bytes(6), False, []),
    ):
        texts = stream.text(data, from_server=server)
        fits = len(texts) == len(begins) and all(map(str.startswith, texts, begins))
        equal(ctx, f"{data.hex(' ')} is {texts}", fits, 1, "MODB-038")
    same(ctx, "the words of a request", request_text(read) == f"request {Request(3, 10, 1)}", True)
    for asked, pdu, begins_with in (
        (read, answer, "response "),
        (read, b"\x83\2", "response "),
        (read, b"\x04\2\0\0", "response that does not fit: "),
        (b"\x64", answer, "unsolicited response: "),
    ):
        text = response_text(asked, pdu)
        equal(ctx, f"response {pdu.hex()} is {text!r}", text.startswith(begins_with), 1)


def packets(path: Path) -> tuple[int, list[tuple[int, bytes]]]:
    """Return link type, and time in ns and bytes of the packets of a pcap file."""
    data = path.read_bytes()
    magic, _, _, _, _, _, link_type = struct.unpack_from("<IHHiIII", data)
    found, at = [], 24
    while at < len(data) and magic == 0xA1B23C4D:
        seconds, rest, size, _ = struct.unpack_from("<IIII", data, at)
        found.append((seconds * 1_000_000_000 + rest, data[at + 16 : at + 16 + size]))
        at += 16 + size
    return link_type, found


def total(data: bytes) -> int:
    """Return the sum of words with the carry added, FFFFh where the checksum is right."""
    number = sum(struct.unpack(f">{len(data) // 2}H", data))
    while number > 0xFFFF:
        number = (number & 0xFFFF) + (number >> 16)
    return number


@CAMPAIGN.case("captured", requirements=("MODB-036",))
def captured(ctx: CaseContext) -> None:
    """Logs of a connection and of a line as capture files: addresses, ports, sequence numbers, checksums,
    times; what is in them is what passed.
    """
    scheduler = scheduler_of(ctx)
    link, line = TcpLink(scheduler), SerialLine(scheduler)
    TcpStation(scheduler, link, device())
    RtuStation(scheduler, line, device())
    client = TcpClient(scheduler, lambda handler: link.connect("client", handler), retries=0)
    master = RtuClient(scheduler, line)
    for register in (10, 9):
        client.submit(Request(3, register, 1), UNIT)
        master.submit(Request(3, register, 1), UNIT)
        ctx.run_for(0.2)
    client.close()
    ctx.run_for(0.1)
    with TemporaryDirectory() as folder:
        connection = packets(write_tcp_capture(link.log, Path(folder) / "tcp.pcap"))
        serial = packets(write_serial_capture(line.log, Path(folder) / "line.pcap"))
    equal(ctx, "link type of a connection", connection[0], 101)
    expected = {True: 0, False: 0}
    flags_seen, data_seen = [], b""
    for _, packet in connection[1]:
        equal(ctx, "checksum of the outer head", total(packet[:20]), 0xFFFF)
        pseudo = packet[12:20] + struct.pack(">BBH", 0, 6, len(packet) - 20)
        inner = packet[20:] + b"\0" * (len(packet) % 2)
        equal(ctx, "checksum of the segment", total(pseudo + inner), 0xFFFF)
        source, target, sequence, acknowledged, _, flags = struct.unpack_from(">HHIIBB", packet, 20)
        server = source == 502
        equal(ctx, "one end is port 502", (source == 502) + (target == 502), 1, "MODB-036")
        equal(ctx, "sequence number", sequence, expected[server])
        expected[server] += len(packet) - 40 + bool(flags & 3)
        if flags & 0x10:
            equal(ctx, "acknowledged", acknowledged, expected[not server])
        flags_seen.append(flags)
        data_seen += packet[40:]
    same(ctx, "handshake", flags_seen[:3], [0x02, 0x12, 0x10])
    same(ctx, "data", flags_seen[3:7], [0x18] * 4)
    wanted = b"".join(tcp_frame(1, UNIT, bytes.fromhex(pdu)) for pdu in ("03 000A 0001", "03 02 100A"))
    same(ctx, "first exchange", data_seen[: len(wanted)], wanted, "MODB-036")
    equal(ctx, "link type of a line", serial[0], 147)
    same(ctx, "frames of the line", [data for _, data in serial[1]], [frame.data for frame in line.log])
    gaps = [later - earlier for (earlier, _), (later, _) in pairwise(serial[1])]
    logged = [later.start_ns - earlier.start_ns for earlier, later in pairwise(line.log)]
    ends = [later.end_ns - earlier.end_ns for earlier, later in pairwise(line.log)]
    equal(ctx, "times of the line", gaps in (logged, ends), 1)
