"""Ways to the parameters of a PROFIdrive axis: objects of CiA 402 on CANopen, data record 47 in registers,
records of a connection.
"""

from __future__ import annotations

from functools import partial
from typing import Any, Final

from emulators.drive.profidrive import DriveSettings, ProfidriveCanDrive, ProfidriveNodeConfig
from emulators.drive.profidrive.parameters.access import ParameterChannel, ParameterRecord
from fieldbus.can import CanMedium
from fieldbus.canopen import CanopenMaster, NmtCommand
from fieldbus.canopen.abort import SdoAbort
from fieldbus.clock import VirtualScheduler
from fieldbus.profidrive.record_errors import RecordRefusedError
from hil.campaign import Campaign, CaseContext
from testcases.campaigns._axis_rig import PdAxis, axis_config
from testcases.campaigns.support import equal, raises, same

CAMPAIGN: Final = Campaign(
    "profidrive channels", controller="", tags=("telegram",), bench="testcases.campaigns.can_bus:BENCH"
)
MS: Final = 1_000_000


class _Node:
    """A PROFIdrive axis as a CANopen node, whose objects are read and written without the bus."""

    def __init__(self, telegram: int) -> None:
        self.scheduler = VirtualScheduler()
        settings = DriveSettings(
            operating_mode=1, max_speed_rpm=3000.0, ramp_up_s=1.0, ramp_down_s=1.0, quick_stop_s=0.5
        )
        drive = axis_config(telegram=telegram, isochronous=False, settings=settings)
        config = ProfidriveNodeConfig(node_id=7, drive=drive)
        medium = CanMedium(self.scheduler)
        self.drive = ProfidriveCanDrive(self.scheduler, medium, config, name="axis")
        master = CanopenMaster(self.scheduler, medium)
        self.drive.power_on()
        self.run(0.1)
        master.nmt(NmtCommand.START, 7)
        self.run(0.02)

    def run(self, seconds: float) -> None:
        self.scheduler.run_for(round(seconds * 1e9))

    def read(self, index: int, sub: int = 0) -> Any:
        store = self.drive.slave.store
        try:
            entry = store.entry(index, sub)
            data = store.read(index, sub)
        except SdoAbort as abort:
            return f"{int(abort.code):08X}"
        return int.from_bytes(data, "little", signed=entry.signed) if entry.integer else data

    def write(self, index: int, value: int, sub: int = 0) -> str:
        store = self.drive.slave.store
        try:
            size = store.entry(index, sub).size
            store.write(index, sub, (value & (1 << 8 * size) - 1).to_bytes(size, "little"), expedited=True)
        except SdoAbort as abort:
            return f"{int(abort.code):08X}"
        return ""


@CAMPAIGN.case("objects", requirements=("PD-342",))
def objects(ctx: CaseContext) -> None:
    """Words, speeds, torques and ramps of CiA 402 are those of the axis, in its units; what is fixed takes
    nothing else.
    """
    node = _Node(1)
    parameters = node.drive.parameters
    for index, sub, wanted in (
        (0x605D, 0, 1),
        (0x6060, 0, 3),
        (0x6061, 0, 3),
        (0x6071, 0, 0),
        (0x6072, 0, 3000),
        (0x6086, 0, 0),
        (0x6094, 0, 2),
        (0x6502, 0, 4),
        (0x6504, 0, b"SIEMENS"),
        (0x606C, 0, 0),
        (0x6074, 0, 0),
    ):
        same(ctx, f"{index:04X}h:{sub}", node.read(index, sub), wanted, "PD-342")
    for index, good, bad in ((0x605D, 1, 2), (0x6060, 3, 1), (0x6086, 0, 3)):
        same(ctx, f"{index:04X}h = {good}", node.write(index, good), "", "PD-342")
        same(ctx, f"{index:04X}h = {bad}", node.write(index, bad), "06090030", "PD-342")
    for index in (0x6041, 0x6061, 0x6063, 0x6069, 0x606B, 0x606C, 0x6071, 0x6074, 0x6502):
        same(ctx, f"{index:04X}h is read only", node.write(index, 1), "06010002", "PD-342")
    same(ctx, "no such sub-index", node.read(0x6040, 1), "06090011")
    same(ctx, "no such object", node.read(0x6081), "06020000")
    # Ramps: 3000 rpm in 1 s and 0.5 s.
    for number, index, slope in ((1120, 0x6083, 3000), (1121, 0x6084, 3000), (1135, 0x6085, 6000)):
        same(ctx, f"{index:04X}h", node.read(index), slope, "PD-342")
        same(ctx, f"{index:04X}h written", node.write(index, 1500), "", "PD-342")
        equal(ctx, f"p{number}, s", float(parameters.read(number)), 2.0, "PD-342", within=1e-6)
        same(ctx, f"{index:04X}h = 0", node.write(index, 0), "06090030", "PD-342")
        parameters.write(number, 0.0)
        same(ctx, f"{index:04X}h without a time", node.read(index), 0xFFFF_FFFF, "PD-342")
        parameters.write(number, 1.0)
    same(ctx, "torque limit", node.write(0x6072, 1500), "", "PD-342")
    equal(ctx, "p1520, Nm", float(parameters.read(1520)), 3.0, "PD-342", within=1e-6)
    # Without control by the controller (STW1 bit 10) no setpoint counts.
    node.write(0x60FF, 500)
    node.run(0.02)
    same(ctx, "no control, no setpoint", node.read(0x60FF), 0, "PD-077")
    node.write(0x6040, 0x047E)
    node.run(0.02)
    # Velocities have a factor of their own.
    for numerator, denominator in ((10, 1), (3, 2)):
        same(ctx, "factor", (node.write(0x6094, numerator, 1), node.write(0x6094, denominator, 2)), ("", ""))
        same(ctx, "read", (node.read(0x6094, 1), node.read(0x6094, 2)), (numerator, denominator), "PD-342")
        share = numerator / denominator
        same(ctx, "slope with a factor", node.read(0x6083), round(3000 * share), "PD-342")
        for rpm in (600, -450):
            same(ctx, "target", node.write(0x60FF, round(rpm * share)), "", "PD-342")
            node.run(0.02)
            equal(ctx, "target read", node.read(0x60FF), rpm * share, "PD-342", within=1.0)
            signal = node.drive.drive.row[node.drive.telegram.setpoint.names.index("NSOLL_A")]
            equal(ctx, "in the telegram", signal / 0x4000 * 3000.0, rpm, "PD-342", within=0.2)
    node.write(0x60FF, 0)
    same(ctx, "control word", node.write(0x6040, 0x047E), "", "PD-342")
    node.run(0.05)
    same(ctx, "control word read", node.read(0x6040), 0x047E, "PD-342")
    same(ctx, "status word", node.read(0x6041), node.drive.drive.words.zsw1(), "PD-342")
    narrow = _Node(2)
    narrow.write(0x6040, 0x047E)
    narrow.run(0.02)
    same(ctx, "target of 32 bits", narrow.write(0x60FF, 1500), "", "PD-342")
    narrow.run(0.02)
    equal(ctx, "target of 32 bits read", narrow.read(0x60FF), 1500, within=1.0)
    same(ctx, "status of telegram 2", narrow.read(0x6041), narrow.drive.drive.words.zsw1(), "PD-342")


FIRST: Final = 40_601
READ: Final = bytes.fromhex("01010101" + "1000" + "0002" + "0000")
"""A request to read r0002."""


def _words(data: bytes) -> list[int]:
    data += bytes(len(data) % 2)
    return [int.from_bytes(data[at : at + 2], "big") for at in range(0, len(data), 2)]


@CAMPAIGN.case("registers", requirements=("PD-326", "PD-329", "PD-330", "PD-331", "PD-332", "PD-333"))
def registers(ctx: CaseContext) -> None:
    """A request is started by its first register, is not ready for the time of the drive, then there until
    the next; each mistake has its error.
    """
    rig = PdAxis(ctx, axis_config())
    there = True
    channel = ParameterChannel(rig.parameters.server, latency_ns=20 * MS, available=lambda: there)
    length = 0x2F00 | len(READ)
    same(ctx, "at first", channel.read(FIRST, 3, 0), [0, 0, 0])
    same(ctx, "taken", channel.write(FIRST, [1, length, *_words(READ)], 0), True, "PD-326")
    for now in (0, 19 * MS):
        same(ctx, "not ready", channel.read(FIRST, 3, now), [1, 0x2F00, 4], "PD-332")
        same(ctx, "busy", channel.write(FIRST, [1, length, *_words(READ)], now), False, "PD-332")
    found = channel.read(FIRST, 7, 20 * MS)
    same(ctx, "answer", found[:4], [2, 0x2F08, 0x0101, 0x0101], "PD-326")
    same(ctx, "value", found[4] >> 8 in (0x06, 0x42, 0x03), True)
    same(ctx, "still there", channel.read(FIRST, 7, 90 * MS), found, "PD-326")
    same(ctx, "a part of it", channel.read(FIRST + 2, 2, 90 * MS), found[2:4], "PD-326")
    now = 100 * MS
    for name, words, error in (
        ("another function", [1, 0x2E00 | len(READ), *_words(READ)], 3),
        ("longer than what was written", [1, 0x2F00 | (len(READ) + 1), *_words(READ)], 1),
        ("no length", [1, 0x2F00, *_words(READ)], 1),
        ("another order", [7, length, *_words(READ)], 2),
    ):
        channel.write(FIRST, words, now)
        same(ctx, name, channel.read(FIRST, 3, now), [2, 0x2F00, error], "PD-331")
        now += 50 * MS
    channel.write(FIRST, [0, length, *_words(READ)], now)
    same(ctx, "written only", channel.read(FIRST, 3, now), [0, length, 0x0101])
    channel.write(FIRST, [1], now)
    same(ctx, "then started", channel.read(FIRST, 2, now + 20 * MS), [2, 0x2F08], "PD-326")
    there = False
    channel.write(FIRST, [1, length, *_words(READ)], now + 60 * MS)
    same(ctx, "no drive", channel.read(FIRST, 3, now + 60 * MS), [2, 0x2F00, 2], "PD-330")
    there = True
    channel.injected = 5
    channel.write(FIRST, [1, length, *_words(READ)], now + 90 * MS)
    same(ctx, "injected", channel.read(FIRST, 3, now + 110 * MS), [2, 0x2F00, 5], "PD-333")
    channel.reset()
    same(ctx, "reset", channel.read(FIRST, 3, now + 200 * MS), [0, 0, 0])
    for first, count, fits in (
        (FIRST - 1, 1, 0),
        (FIRST, 122, 1),
        (FIRST, 123, 0),
        (FIRST + 121, 1, 1),
        (FIRST + 122, 1, 0),
    ):
        said = raises(partial(channel.read, first, count, 0), IndexError)
        equal(ctx, f"{count} registers from {first}", not said, fits)


@CAMPAIGN.case("records", requirements=("PD-206",))
def records(ctx: CaseContext) -> None:
    """Record 47 takes one request at a time; reading too early, another record, a wrong header or length, and
    a drive that is gone have their errors.
    """
    rig = PdAxis(ctx, axis_config())
    there = True
    record = ParameterRecord(rig.parameters.server, latency_ns=20 * MS, available=lambda: there)

    def code(call: Any) -> int:
        try:
            call()
        except RecordRefusedError as error:
            return int(error.code)
        return 0

    same(ctx, "nothing was asked", code(lambda: record.read(0xB02F, 0)), 0xB5, "PD-206")
    record.write(0xB02F, READ, 0)
    same(ctx, "too early", code(lambda: record.read(0xB02F, 19 * MS)), 0xB5, "PD-206")
    same(ctx, "one at a time", code(lambda: record.write(0xB02F, READ, 19 * MS)), 0xB5, "PD-206")
    answer = record.read(0xB02F, 20 * MS)
    same(ctx, "answer", answer[:4].hex(), "01010101", "PD-206")
    same(ctx, "it is gone then", code(lambda: record.read(0xB02F, 21 * MS)), 0xB5, "PD-206")
    for name, data, wanted in (
        ("another service", b"\1\3" + READ[2:], 0xB7),
        ("no reference", b"\0" + READ[1:], 0xB7),
        ("too short", READ[:3], 0xB1),
        ("too long", READ + bytes(240), 0xB1),
    ):
        same(ctx, name, code(lambda d=data: record.write(0xB02F, d, 30 * MS)), wanted, "PD-206")
    same(ctx, "another record", code(lambda: record.write(0x1234, READ, 30 * MS)), 0xB0, "PD-206")
    same(ctx, "another record read", code(lambda: record.read(0x1234, 30 * MS)), 0xB0, "PD-206")
    record.write(0xB02F, READ, 40 * MS)
    record.reset()
    same(ctx, "the connection has ended", code(lambda: record.read(0xB02F, 90 * MS)), 0xB5, "PD-206")
    there = False
    gone = code(lambda: record.read(0xB02F, 90 * MS))
    equal(ctx, f"no drive: {gone:02X}h", 0xA0 <= gone <= 0xAF, 1)
