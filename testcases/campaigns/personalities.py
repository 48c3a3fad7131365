"""Drives that differ from the profile as drives on the market do: each personality under a plain master, and
what the profile says of the same in `cia402_modes`.
"""

from __future__ import annotations

from typing import Final

from fieldbus.canopen import NmtCommand
from hil.bench import BenchFile
from hil.campaign import Campaign, CaseContext
from testcases.campaigns._led_servo import BENCH as LED
from testcases.campaigns._led_servo import DRIVE, NODE, REV, Node
from testcases.campaigns.cia402_modes import drive

_PLACE: Final = "heartbeat_ms = 0\n"


def of(name: str, bench: str) -> tuple[BenchFile, Campaign]:
    """Return bench and campaign of a personality; `bench`: name of the bench in this module."""
    text = LED.text.replace(_PLACE, f'{_PLACE}personality = "{name}"\n')
    file = BenchFile(f"led {name}", text.replace('name = "led servo"', f'name = "led {name}"'))
    reference = f"testcases.campaigns.personalities:{bench}"
    campaign = Campaign(f"personality {name}", tags=("drive", "cia402"), bench=reference)
    return file, campaign


HALT, OF_HALT = of("halt-blocks-setpoints", "HALT")
SINGLE, OF_SINGLE = of("single-setpoint-servo", "SINGLE")
UNPRIMED, OF_UNPRIMED = of("unprimed-csp-servo", "UNPRIMED")
RETRY, OF_RETRY = of("auto-retry-inverter", "RETRY")
MAINS, OF_MAINS = of("mains-guarded-inverter", "MAINS")
SILENT, OF_SILENT = of("silent-start-servo", "SILENT")
HOMED, OF_HOMED = of("homed-bit-inverter", "HOMED")
FAST, OF_FAST = of("fast-switch-on-drive", "FAST")
COMPACT, OF_COMPACT = of("compact-motion-controller", "COMPACT")
INPUTS, OF_INPUTS = of("io-pdo-servo", "INPUTS")


def emcys(node: Node) -> list[str]:
    """Return the EMCYs since the last call, hexadecimal."""
    return [data.hex() for data in node.taken(0x80 + NODE)]


def ends(ctx: CaseContext, node: Node, place: int) -> None:
    """Expect the end of a positioning."""
    node.until(0x400, 0x400, 8.0, "the target is reached")
    ctx.run_for(0.05)
    node.shows(0x6064, place, within=1)


@OF_HALT.case("halt", requirements=("C402-076", "C402-091"))
def halt(ctx: CaseContext) -> None:
    """During a halt no set-point is acknowledged; with its end it is taken. EMCYs carry the fault as text."""
    node = drive(ctx)
    node.enable(1)
    node.write(0x607A, REV)
    node.control(0x10F)
    node.control(0x11F, 0.05)
    node.bits(0x1000, 0)
    node.control(0x1F, 0.02)
    node.bits(0x1000, 0x1000)
    node.control(0x0F)
    ends(ctx, node, REV)
    node.listen(0x80 + NODE)
    ctx.inject("drive.fault", DRIVE, code=0x3210)
    ctx.run_for(0.02)
    node.equal("text in the EMCY", emcys(node)[0][6:14] == b"F501".hex(), 1)


@OF_SINGLE.case("set-points", requirements=("C402-091", "C402-092"))
def single(ctx: CaseContext) -> None:
    """Without bit 5 nothing is taken; a second set-point takes the place of the first, none waits."""
    node = drive(ctx)
    node.enable(1)
    node.write(0x607A, REV)
    node.control(0x1F, 0.3)
    node.bits(0x1000, 0)
    node.shows(0x6064, 0, within=1)
    node.control(0x0F)
    node.control(0x3F, 0.02)
    node.bits(0x1000, 0x1000)
    node.control(0x2F)
    node.write(0x607A, 4 * REV)
    node.control(0x3F, 0.1)
    node.control(0x2F)
    ends(ctx, node, 4 * REV)


@OF_UNPRIMED.case("first-target", requirements=("C402-100",))
def unprimed(ctx: CaseContext) -> None:
    """In csp it goes to 607Ah = 0 at once; a target that was set is held."""
    node = drive(ctx)
    node.enable(1)
    node.write(0x607A, REV)
    node.control(0x1F)
    ends(ctx, node, REV)
    node.control(0x06)
    node.write(0x607A, 0)
    node.enable(8)
    ctx.run_for(0.6)
    node.shows(0x6064, 0, within=2)
    node.write(0x607A, REV // 2)
    ctx.run_for(0.6)
    node.shows(0x6064, REV // 2, within=2)


@OF_RETRY.case("faults", requirements=("C402-016", "C402-025"))
def retry(ctx: CaseContext) -> None:
    """A fault clears itself a second after its cause is gone, three times; a reset by the controller lets
    them count again. The home offset has the other sign, and homing ends when bit 4 is withdrawn.
    """
    node = drive(ctx)
    for _ in range(3):
        ctx.inject("drive.fault", DRIVE, code=0x2310)
        ctx.run_for(0.9)
        node.bits(0x4F, 0x08)
        ctx.run_for(0.2)
        node.bits(0x4F, 0x40)
    ctx.inject("drive.fault", DRIVE, code=0x2310)
    ctx.run_for(2.5)
    node.bits(0x4F, 0x08)
    node.control(0x00)
    node.control(0x80)
    node.bits(0x4F, 0x40)
    ctx.inject("drive.fault", DRIVE, code=0x2310)
    ctx.run_for(1.2)
    node.bits(0x4F, 0x40)
    node.configure({0x607C: 500, 0x6098: 37})
    node.enable(6)
    node.control(0x1F, 0.05)
    node.bits(0x3400, 0x1000)
    node.control(0x0F, 0.05)
    node.bits(0x3400, 0x1400)
    node.shows(0x6064, 500)


@OF_MAINS.case("mains", requirements=("C402-004", "C402-029"))
def mains(ctx: CaseContext) -> None:
    """Without mains it is switched on for three seconds and goes back; mains that come in time keep it."""
    node = drive(ctx)
    cause = ctx.inject("drive.dc_link", DRIVE, voltage_V=0.0)
    node.control(0x06)
    node.control(0x07)
    node.bits(0x6F, 0x23)
    node.control(0x0F)
    node.bits(0x6F, 0x23)
    ctx.run_for(2.9)
    node.bits(0x6F, 0x23)
    ctx.run_for(0.2)
    node.bits(0x4F, 0x40)
    cause.remove()
    ctx.run_for(0.05)
    node.control(0x06)
    node.control(0x07)
    cause = ctx.inject("drive.dc_link", DRIVE, voltage_V=0.0)
    ctx.run_for(2.0)
    cause.remove()
    ctx.run_for(2.0)
    node.bits(0x6F, 0x23)


@OF_SILENT.case("start", requirements=("C402-001", "C402-002"))
def silent(ctx: CaseContext) -> None:
    """During its self-test there is no status word, neither by SDO nor in a PDO; half a second later there
    is.
    """
    node = Node(ctx)
    ctx.run_for(0.7)
    node.map_pdo(1, (0x60410010,), 1, transmit=True)
    node.map_pdo(2, (0x60640020,), 1, transmit=True)
    node.write(0x1010, int.from_bytes(b"save", "little"), 1)
    node.nmt(NmtCommand.RESET_NODE)
    ctx.run_for(0.05)
    node.listen(0x180 + NODE, 0x280 + NODE)
    node.nmt(NmtCommand.START)
    node.equal("reading 6041h is refused", isinstance(node.upload(0x6041), int), 1)
    for _ in range(3):
        node.send(0x80, b"")
    ctx.run_for(0.01)
    node.equal("TPDOs with the status word", len(node.taken(0x180 + NODE)), 0)
    node.equal("other TPDOs", len(node.taken(0x280 + NODE)) >= 3, 1)
    ctx.run_for(0.6)
    node.bits(0x4F, 0x40, "C402-002")
    node.send(0x80, b"")
    ctx.run_for(0.01)
    node.equal("TPDOs with the status word", len(node.taken(0x180 + NODE)) >= 1, 1)


@OF_HOMED.case("bits", requirements=("C402-042", "C402-048"))
def homed(ctx: CaseContext) -> None:
    """Bit 15 after a homing that was refused, bit 8 from success until the drive is switched off."""
    node = drive(ctx)
    node.enable(6)
    node.bits(0x8100, 0)
    for method, bits in ((0, 0x8000), (37, 0x100)):
        node.write(0x6098, method)
        node.control(0x0F)
        node.control(0x1F, 0.05)
        node.bits(0x8100, bits)
    node.control(0x00)
    node.bits(0x8100, 0x100)
    ctx.inject("drive.power_off", DRIVE, duration_s=0.1)
    ctx.run_for(0.5)
    node.bits(0x8100, 0)


@OF_FAST.case("switched-on", requirements=("C402-020",))
def fast(ctx: CaseContext) -> None:
    """From Ready with 000Fh it is enabled without Switched on being seen."""
    node = drive(ctx)
    node.map_pdo(1, (0x60410010,), 255, transmit=True)
    node.nmt(NmtCommand.START)
    node.write(0x6060, 3)
    node.control(0x06)
    node.listen(0x180 + NODE)
    node.control(0x0F, 0.05)
    seen = [data[0] & 0x6F for data in node.taken(0x180 + NODE)]
    node.equal(f"states {[hex(one) for one in seen]} end with 27h", seen[-1:] == [0x27], 1)
    node.equal("Switched on among them", 0x23 in seen, 0)


@OF_COMPACT.case("emcy", requirements=("C301-108", "C402-306"))
def compact(ctx: CaseContext) -> None:
    """Codes, registers and error words of the manufacturer in the EMCY, 603Fh and 1003h; the reset clears
    them.
    """
    node = drive(ctx)
    node.listen(0x80 + NODE)
    for code, frame in ((0x8611, "1186210200000000"), (0x7305, "0073a14000000000")):
        ctx.inject("drive.fault", DRIVE, code=code)
        ctx.run_for(0.02)
        found = emcys(node)
        node.equal(f"EMCY {found} is {frame}", found == [frame], 1, "C301-108")
    node.shows(0x603F, 0x7300, signed=False)
    node.shows(0x1003, 0x7300 | 0x40 << 16, sub=1, signed=False)
    node.control(0x00)
    node.control(0x80, 0.02)
    node.equal("EMCY 0000h", emcys(node)[-1][:6] == "000000", 1, "C301-109")
    node.shows(0x1001, 0)


@OF_INPUTS.case("pdos", requirements=("C402-287",))
def default_pdos(ctx: CaseContext) -> None:
    """The PDOs that it has before anybody maps them carry inputs, outputs and torque too."""
    node = Node(ctx)
    node.listen(0x180 + NODE)
    sizes = {
        record: sum(node.read(record, sub, signed=False) & 0xFF for sub in range(1, node.read(record) + 1))
        // 8
        for record in (0x1600, 0x1A00)
    }
    objects = {node.read(0x1A00, sub, signed=False) >> 16 for sub in range(1, node.read(0x1A00) + 1)}
    node.equal("status word and inputs are in TPDO1", {0x6041, 0x60FD} <= objects, 1)
    node.nmt(NmtCommand.START)
    ctx.run_for(0.02)
    node.equal("bytes of TPDO1", len(node.taken(0x180 + NODE)[-1]), sizes[0x1A00])
    node.equal("bytes of RPDO1", sizes[0x1600] > 2, 1)
