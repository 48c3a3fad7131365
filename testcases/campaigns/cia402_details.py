"""Objects of a CiA 402 drive one by one: velocity mode in all its units, buffer of ip, windows and their
times, homing that fails, probes with their counters, warnings, protection and safety, each bit both ways.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Final

from fieldbus.canopen import NmtCommand
from hil.bench import BenchFile
from hil.campaign import Campaign, CaseContext
from testcases.campaigns._led_servo import BENCH as LED
from testcases.campaigns._led_servo import DRIVE, NODE, REV, Node
from testcases.campaigns.cia402_modes import DOWN, QUICK, SPEED, UP, drive, slope, speed, turning

BENCH: Final = BenchFile(
    "guarded servo",
    LED.text.replace('name = "led servo"', 'name = "guarded servo"')
    + """probe2_from_mm = 22.0
probe2_to_mm = 28.0

[drive.drive1.thermal]
i2t_time_constant_s = 0.5

[drive.drive1.safety]
ss1_time_ms = 400.0
interlock = "quick_stop"

[drive.drive1.homing]
""",
)
CAMPAIGN: Final = Campaign(
    "cia402 details",
    controller="",
    tags=("drive", "cia402"),
    bench="testcases.campaigns.cia402_details:BENCH",
)
TOLERANT: Final = BenchFile(
    "servo that warns",
    LED.text.replace('name = "led servo"', 'name = "servo that warns"').replace(
        "[drive.drive1.mechanics]", 'sync_loss = "warning"\n\n[drive.drive1.mechanics]'
    ),
)
"""The drive goes on when SYNC is missing, and says so."""
OF_WARNINGS: Final = Campaign(
    "cia402 warnings",
    controller="",
    tags=("drive", "cia402"),
    bench="testcases.campaigns.cia402_details:TOLERANT",
)
RUN: Final = 0x7F
"""Operation enabled with the three bits of the ramp of vl."""
RANGE, STATE, CROSSED, WRITE_ONLY = 0x06090030, 0x08000022, 0x06090036, 0x06010001


def poll(ctx: CaseContext, node: Node, index: int, fits: Callable[[int], bool], limit_s: float) -> float:
    """Read an object until its value fits; return how long that took, s.

    Raises:
        ExpectationFailedError: It did not happen in time.

    """
    begun = ctx.now_s
    while not fits(node.read(index)):
        if ctx.now_s - begun > limit_s:
            ctx.wait_until(lambda: False, 0.0, f"{index:04X}h fits")
        ctx.run_for(0.0005)
    return ctx.now_s - begun


def velocity(ctx: CaseContext) -> Node:
    """Return a drive in vl, enabled, with ramps of 3000 and 2000 rpm/s."""
    node = drive(ctx)
    node.enable(2)
    node.control(RUN)
    return node


# -- vl -----------------------------------------------------------------------------------------------------


@CAMPAIGN.case("vl/amounts", requirements=("C402-096", "C402-182", "C402-183", "C402-045"))
def amounts(ctx: CaseContext) -> None:
    """6047h bounds the amount in each direction, 0 stays 0, bit 11 says what is not as asked; 6046h sets
    both.
    """
    node = velocity(ctx)
    for sub, value in enumerate((100, 500, 40, 300), 1):
        node.write(0x6047, value, sub)
    for target, found in (
        (5, 100),
        (100, 100),
        (450, 450),
        (900, 500),
        (0, 0),
        (-5, -40),
        (-40, -40),
        (-90, -90),
        (-3000, -300),
    ):
        node.write(0x6042, target)
        ctx.run_for(0.5)
        node.equal(f"speed for {target}", speed(ctx), found, "C402-182", within=0.3)
        node.shows(0x6043, found, "C402-180")
        node.shows(0x6044, found, "C402-181", within=1)
        node.bits(0x800, 0x800 * (target != found), "C402-045")
    node.write(0x6046, 50, 1)
    node.write(0x6046, 700, 2)
    for sub, value in enumerate((50, 700, 50, 700), 1):
        node.shows(0x6047, value, "C402-182", sub=sub)


@CAMPAIGN.case("vl/units", requirements=("C402-187", "C402-188", "C402-189", "C402-190", "C402-192"))
def units(ctx: CaseContext) -> None:
    """604Ch 1/10 and 604Bh -3/2 turn 1000 into -150 rpm; percentages and targets follow each other."""
    node = velocity(ctx)
    node.configure({(0x604C, 2): 10, (0x604B, 1): -3, (0x604B, 2): 2})
    node.write(0x6042, 1000)
    ctx.run_for(0.3)
    node.equal("speed", speed(ctx), -150, "C402-187", within=0.3)
    node.shows(0x6043, 1000, "C402-180")
    node.shows(0x6044, 1000, "C402-181", within=3)
    for index in (0x604B, 0x604C):
        for sub in (1, 2):
            node.refuses(index, 0, RANGE, "C402-187", sub=sub)
    node.configure({(0x604C, 2): 1, (0x604B, 1): 1, (0x604B, 2): 1, 0x604E: 2000, 0x6052: 8192})
    node.shows(0x6042, 1000, "C402-189")
    ctx.run_for(1.0)
    node.equal("speed", speed(ctx), 1000, "C402-189", within=1)
    for index in (0x6053, 0x6054, 0x6055):
        node.shows(index, 8192, "C402-190", within=4)
    node.write(0x6042, -500)
    node.shows(0x6052, -4096, "C402-189")
    node.write(0x604E, 1000)
    node.shows(0x6052, -8192, "C402-189")
    for index, value in ((0x604E, 0), (0x604D, 0), (0x604D, 3)):
        node.refuses(index, value, RANGE, "C402-192")
    node.refuses(0x604D, 4, 0, "C402-192")


@CAMPAIGN.product(
    "vl/ramp-{ramp:x}",
    parameters=[
        {"ramp": 0x6048, "time": 0x604F},
        {"ramp": 0x6049, "time": 0x6050},
        {"ramp": 0x604A, "time": 0x6051},
    ],
    title="ramp {ramp:X}h and its time",
    requirements=("C402-184", "C402-185", "C402-186", "C402-191"),
)
def ramp(ctx: CaseContext, ramp: int, time: int) -> None:
    """Delta speed and delta time are one with the time from zero to 604Eh, the last written counts, and
    acts.
    """
    node = velocity(ctx)
    node.write(0x604E, 3000)
    for time_ms in (1, 700, 1000, 2500):
        node.write(time, time_ms)
        node.shows(time, time_ms, "C402-191")
        share = node.read(ramp, 1, signed=False) / node.read(ramp, 2, signed=False)
        node.equal(f"ramp for {time_ms} ms", share, 3000 / time_ms * 1000, "C402-191", within=1e-6 * share)
    node.write(time, 0)
    node.shows(ramp, 0, "C402-191", sub=2)
    node.write(ramp, 6000, 1)
    node.write(ramp, 3, 2)
    node.shows(time, 1500, "C402-191")
    node.write(0x604E, 1000)
    node.shows(time, 500, "C402-191")
    node.configure({(ramp, 1): 1300, (ramp, 2): 1, 0x6042: 0 if ramp == 0x6048 else 700})
    ctx.run_for(0.7)
    if ramp == 0x604A:
        node.write(0x605A, 6)
        node.control(0x02, 0.0)
    else:
        node.write(0x6042, 700 if ramp == 0x6048 else 0)
    ctx.run_for(0.25)
    found = slope(ctx, ctx.now_s - 0.2, ctx.now_s)
    node.equal("slope", found, 1300 if ramp == 0x6048 else -1300, "C402-184", within=25)


@CAMPAIGN.case(
    "vl/bits", requirements=("C402-033", "C402-034", "C402-035", "C402-044", "C402-046", "C402-047")
)
def ramp_bits(ctx: CaseContext) -> None:
    """Without bit 4 the drive brakes, without bit 5 the ramp stands, without bit 6 its input is 0; bits 10,
    12, 13 of the status word stay 0.
    """
    node = velocity(ctx)
    node.write(0x6042, 1200)
    ctx.run_for(0.2)
    node.control(RUN & ~0x20, 0.1)
    frozen = speed(ctx)
    node.equal("speed while it grows", frozen, 610, "C402-034", within=25)
    ctx.run_for(0.2)
    node.equal("speed with a frozen ramp", speed(ctx), frozen, "C402-034", within=0.5)
    node.bits(0x3400, 0, "C402-044")
    node.control(RUN, 0.4)
    node.equal("speed", speed(ctx), 1200, "C402-034", within=1)
    node.control(RUN & ~0x40, 0.1)
    node.equal("slope without bit 6", slope(ctx, ctx.now_s - 0.09, ctx.now_s), -DOWN, "C402-035", within=60)
    ctx.run_for(0.6)
    node.equal("speed without bit 6", speed(ctx), 0, "C402-035", within=0.2)
    node.control(RUN, 0.5)
    node.control(RUN & ~0x10, 0.1)
    node.equal("slope without bit 4", slope(ctx, ctx.now_s - 0.09, ctx.now_s), -DOWN, "C402-033", within=60)
    ctx.run_for(0.6)
    node.equal("speed without bit 4", speed(ctx), 0, "C402-033", within=0.2)
    node.bits(0x346F, 0x27, "C402-046")
    node.control(0x0F, 0.3)
    node.equal("speed with 000Fh", speed(ctx), 0, "C402-033", within=0.2)


# -- ip -----------------------------------------------------------------------------------------------------

STEP: Final = 40
"""Increments per period of 4 ms."""


def buffered(ctx: CaseContext, size: int, organisation: int = 0) -> Node:
    """Return a drive in ip with a buffer of so many set-points, enabled without bit 4."""
    node = drive(ctx)
    node.configure({(0x60C2, 1): 4, (0x60C4, 2): size, (0x60C4, 3): organisation})
    node.download(0x60C4, 6, b"\1")
    node.enable(7)
    return node


@CAMPAIGN.case("ip/queue", requirements=("C402-099", "C402-172", "C402-253", "C402-041"))
def queue(ctx: CaseContext) -> None:
    """Set-points come out one in a period and in order; a full buffer refuses with the warning bit, an empty
    one holds, warns and sends FF70h; a new set-point goes on.
    """
    node = buffered(ctx, 4)
    node.listen(0x80 + NODE)
    for number in range(1, 5):
        node.write(0x60C1, number * STEP, 1)
    found = node.download(0x60C1, 1, (5 * STEP).to_bytes(4, "little"))
    node.equal("abort code of a full buffer", found, STATE, "C402-172")
    ctx.run_for(0.004)
    node.bits(0x80, 0x80, "C402-041")
    node.shows(0x2100, 1 << 14, signed=False)
    ctx.run_for(0.05)
    node.shows(0x6062, 0, "C402-099")
    node.bits(0x1400, 0x400, "C402-099")
    node.control(0x1F, 0.0)
    node.until(0x1000, 0x1000, 0.02, "interpolation is active")
    took = poll(ctx, node, 0x6062, lambda value: value >= 4 * STEP, 0.1)
    node.equal("time of four set-points, s", took, 0.016, "C402-253", within=0.005)
    ctx.run_for(0.1)
    node.shows(0x6064, 4 * STEP, "C402-099", within=1)
    node.bits(0x1480, 0x480, "C402-099")
    node.shows(0x2100, 1 << 15 | 1 << 14, signed=False)
    codes = [int.from_bytes(data[:2], "little") for data in node.taken(0x80 + NODE)]
    node.equal(f"EMCYs {codes}", codes == [0xFF70], 1, "C402-099")
    node.write(0x60C1, 5 * STEP, 1)
    ctx.run_for(0.1)
    node.shows(0x6064, 5 * STEP, "C402-099", within=1)
    codes = [int.from_bytes(data[:2], "little") for data in node.taken(0x80 + NODE)]
    node.equal(f"EMCYs {codes}", codes[:1] == [0], 1, "C402-099")
    node.control(0x0F, 0.02)
    node.bits(0x1080, 0, "C402-041")
    # The warning goes with the mode, too.
    node.write(0x60C1, 4 * STEP, 1)
    node.control(0x1F, 0.1)
    node.bits(0x80, 0x80, "C402-041")
    node.write(0x6060, 1)
    ctx.run_for(0.01)
    node.bits(0x80, 0, "C402-041")
    node.shows(0x2100, 0, signed=False)


@CAMPAIGN.case("ip/ring", requirements=("C402-172", "C402-255"))
def ring(ctx: CaseContext) -> None:
    """A full ring gives its oldest place away; sizes, organisations and places are checked."""
    node = buffered(ctx, 3, 1)
    for number in range(1, 5):
        node.write(0x60C1, number * STEP, 1)
    node.shows(0x60C4, 1, "C402-172", sub=4)
    node.control(0x1F, 0.1)
    node.shows(0x6062, 4 * STEP, "C402-172")
    node.control(0x0F)
    for sub, good, bad in (
        (2, (1, 16, 5), (0, 17)),
        (3, (1, 0), (2,)),
        (6, (0, 1), (2, 255)),
        (5, (1,), (0, 2, 4)),
    ):
        size = {2: 4, 3: 1, 5: 1, 6: 1}[sub]
        for values, code in ((good, 0), (bad, RANGE)):
            for value in values:
                found = node.download(0x60C4, sub, value.to_bytes(size, "little"))
                node.equal(f"abort code of 60C4h:{sub} = {value}", found, code, "C402-255")
    node.shows(0x60C4, 16, "C402-255", sub=1)
    for sub in (5, 6):
        node.equal(f"reading 60C4h:{sub}", node.upload(0x60C4, sub) == WRITE_ONLY, 1, "C402-255")
    for value in (1, -1):
        node.refuses(0x60C0, value, RANGE, "C402-255")


@CAMPAIGN.case("ip/interrupted", requirements=("C402-033", "C402-076", "C402-099"))
def interrupted(ctx: CaseContext) -> None:
    """Without bit 4 the axis brakes and keeps what waits; a halt lets it run out."""
    node = buffered(ctx, 16)
    node.write(0x6084, 60_000_000)
    for number in range(1, 17):
        node.write(0x60C1, number * STEP, 1)
    node.control(0x1F, 0.02)
    node.control(0x0F, 0.2)
    node.bits(0x1480, 0x400, "C402-033")
    kept = node.read(0x6062)
    node.equal("on the way", 2 * STEP < kept < 14 * STEP, 1, "C402-033")
    ctx.run_for(0.1)
    node.shows(0x6062, kept, "C402-033")
    node.control(0x1F, 0.2)
    node.shows(0x6064, 16 * STEP, "C402-033", within=1)
    node.control(0x0F)
    for number in range(15, -1, -1):
        node.write(0x60C1, number * STEP, 1)
    node.control(0x1F, 0.012)
    node.control(0x11F, 0.15)
    node.bits(0x1400, 0x400, "C402-076")
    kept = node.read(0x6062)
    node.equal("halted on the way", kept > 4 * STEP, 1, "C402-076")
    node.control(0x1F, 0.1)
    node.shows(0x6062, kept, "C402-076")


# -- windows ------------------------------------------------------------------------------------------------


@CAMPAIGN.product(
    "following-error/{ms}",
    parameters=[{"ms": 0, "sign": 1}, {"ms": 20, "sign": -1}, {"ms": 40, "sign": 1}],
    title="following error for {ms} ms, to the side {sign}",
    requirements=("C402-047", "C402-153", "C402-155"),
)
def following(ctx: CaseContext, ms: int, sign: int) -> None:
    """Beyond 6065h for 6066h the drive trips with 8611h, not before; a shorter one does nothing."""
    node = drive(ctx)
    node.configure({0x6065: 100, 0x6066: ms})
    node.enable(1)
    node.listen(0x80 + NODE)
    node.write(0x607A, 20 * sign * REV)
    node.control(0x1F, 0.3)
    node.bits(0x2000, 0, "C402-047")
    if ms:
        ctx.inject("mechanics.jam", DRIVE, duration_s=0.3 * ms / 1000)
        ctx.run_for(0.2 * ms / 1000)
        node.bits(0x4F, 0x07, "C402-153")
        ctx.run_for(1.0)
        node.bits(0x4F, 0x07, "C402-153")
    ctx.inject("mechanics.jam", DRIVE)
    begun = ctx.now_s
    ctx.wait_until(lambda: node.times(0x80 + NODE), 2.0, "the drive trips")
    # 100 increments at 600 rpm take 2.5 ms.
    node.equal(
        "time until the EMCY, s",
        node.times(0x80 + NODE)[0] - begun,
        0.0025 + ms / 1000,
        "C402-153",
        within=0.004,
    )
    node.equal("EMCY", int.from_bytes(node.taken(0x80 + NODE)[0][:2], "little"), 0x8611, "C402-153")


@CAMPAIGN.case("position-window", requirements=("C402-044", "C402-156"))
def position_window(ctx: CaseContext) -> None:
    """Bit 10 comes when the actual position has been within 6067h for 6068h, not before; it falls with the
    next set-point.
    """
    node = drive(ctx)
    node.configure({0x6067: 20, 0x6068: 150})
    node.enable(1)
    node.write(0x607A, REV)
    node.control(0x1F, 0.0)
    poll(ctx, node, 0x6064, lambda value: abs(value - REV) <= 20, 2.0)
    node.bits(0x400, 0, "C402-156")
    took = node.until(0x400, 0x400, 1.0, "the target is reached")
    node.equal("time in the window, s", took, 0.15, "C402-156", within=0.006)
    node.control(0x0F)
    node.write(0x607A, 0)
    node.control(0x1F)
    node.bits(0x400, 0, "C402-044")


@CAMPAIGN.case("velocity-window", requirements=("C402-044", "C402-096"))
def velocity_window(ctx: CaseContext) -> None:
    """In pv bit 10 needs the speed within 606Dh for 606Eh, bit 12 falls above 606Fh for 6070h."""
    node = drive(ctx)
    node.configure({0x606D: 20_000, 0x606E: 100, 0x606F: 50_000, 0x6070: 60})
    node.enable(3)
    node.bits(0x1000, 0x1000, "C402-044")
    node.write(0x60FF, 600_000)
    begun = ctx.now_s
    node.until(0x1000, 0, 1.0, "the threshold is passed")
    node.equal("time above the threshold, s", ctx.now_s - begun, 50 / UP + 0.06, "C402-096", within=0.006)
    node.until(0x400, 0x400, 1.0, "the speed is reached")
    node.equal(
        "time until the speed is reached, s", ctx.now_s - begun, 580 / UP + 0.1, "C402-096", within=0.008
    )
    node.write(0x60FF, 0)
    ctx.run_for(0.002)
    node.bits(0x400, 0, "C402-044")
    ctx.run_for(0.2)
    node.bits(0x1000, 0, "C402-044")
    ctx.run_for(0.4)
    node.bits(0x1400, 0x1400, "C402-044")


@CAMPAIGN.case("ranges", requirements=("C402-164", "C402-257", "C402-045", "C402-151"))
def ranges(ctx: CaseContext) -> None:
    """607Dh holds targets with bit 11, crossed limits are refused; 60F2h takes what the profile has; 607Fh
    and 6080h hold the speed of a positioning.
    """
    node = drive(ctx)
    node.configure({(0x607D, 1): -2 * REV, (0x607D, 2): 3 * REV})
    for value, code in (
        (0x00, 0),
        (0x01, 0),
        (0x02, 0),
        (0x03, RANGE),
        (0x04, RANGE),
        (0xC0, 0),
        (0x100, RANGE),
        (0x00, 0),
    ):
        node.refuses(0x60F2, value, code, "C402-151")
    node.configure({0x607F: 250_000, 0x6098: 37})
    node.enable(6)
    node.control(0x1F, 0.05)
    node.control(0x06)
    node.enable(1)
    node.write(0x607A, 9 * REV)
    node.control(0x1F, 0.4)
    node.equal("speed", speed(ctx), 250, "C402-257", within=1)
    node.until(0x400, 0x400, 4.0, "the limit is reached")
    ctx.run_for(0.05)
    node.shows(0x6064, 3 * REV, "C402-164", within=1)
    node.bits(0x800, 0x800, "C402-045")
    node.control(0x0F)
    node.write(0x607A, -9 * REV)
    node.control(0x1F, 0.1)
    node.until(0x400, 0x400, 6.0, "the lower limit is reached")
    ctx.run_for(0.05)
    node.shows(0x6064, -2 * REV, "C402-164", within=1)
    node.control(0x0F)
    node.write(0x607A, 0)
    node.control(0x1F, 0.1)
    node.bits(0x800, 0, "C402-045")


# -- homing -------------------------------------------------------------------------------------------------


@CAMPAIGN.case("homing/methods", requirements=("C402-133", "C402-134"))
def methods(ctx: CaseContext) -> None:
    """60E3h lists what 6098h takes; everything else is refused."""
    node = drive(ctx)
    listed = [node.read(0x60E3, sub) for sub in range(1, node.read(0x60E3, signed=False) + 1)]
    wanted = {*range(1, 15), *range(17, 31), 33, 34, 35, 37}
    node.equal(f"methods {sorted(listed)}", wanted <= set(listed), 1, "C402-134")
    for method in range(-6, 42):
        node.refuses(0x6098, method, 0 if method in listed or method == 0 else RANGE, "C402-133")


@CAMPAIGN.product(
    "homing/fails-{why}",
    parameters=[
        {"why": "time", "objects": {(0x2010, 4): 300}, "method": 1, "within": 0.45},
        {"why": "way", "objects": {(0x2010, 5): REV // 2}, "method": 1, "within": 0.6},
        {"why": "speed-zero", "objects": {(0x6099, 2): 0}, "method": 34, "within": 0.2},
    ],
    title="homing fails: {why}",
    requirements=("C402-136",),
)
def homing_fails(
    ctx: CaseContext, why: str, objects: dict[tuple[int, int], int], method: int, within: float
) -> None:
    """Time, way and speed 0 end a search with bit 13 and without bit 12; a new start clears bit 13."""
    del why
    node = drive(ctx)
    node.configure({(0x6099, 1): 100_000, (0x6099, 2): 30_000, 0x609A: 60_000_000, 0x6098: method})
    node.configure(dict(objects))
    node.enable(6)
    node.control(0x1F, 0.05)
    took = node.until(0x2000, 0x2000, 5.0, "homing has failed")
    node.equal("time, s", took, within / 2, "C402-136", within=within / 2 + 0.05)
    node.bits(0x1000, 0, "C402-136")
    ctx.run_for(0.3)
    node.equal("speed", speed(ctx), 0, "C402-136", within=0.5)
    node.control(0x0F, 0.01)
    node.configure({(0x2010, 4): 60_000, (0x2010, 5): 0, (0x6099, 2): 30_000, 0x6098: 37})
    node.control(0x1F, 0.05)
    node.bits(0x3400, 0x1400, "C402-135")


@CAMPAIGN.case("homing/offset", requirements=("C402-137", "C402-138"))
def offset(ctx: CaseContext) -> None:
    """At the home position 6064h shows 607Ch with its sign, without motion; halt and a fallen start bit
    stop.
    """
    node = drive(ctx)
    node.configure({0x607C: 500, 0x6098: 37})
    node.enable(6)
    node.control(0x1F, 0.05)
    node.equal("amount of 6064h", abs(node.read(0x6064)), 500, "C402-138")
    node.shows(0x6062, node.read(0x6064), "C402-138")
    node.bits(0x3400, 0x1400, "C402-135")
    node.control(0x0F)
    node.configure({(0x6099, 1): 100_000, (0x6099, 2): 30_000, 0x609A: 60_000_000, 0x6098: 2})
    node.control(0x1F, 0.3)
    node.equal("speed of the search", speed(ctx), 100, "C402-137", within=1)
    node.control(0x11F, 0.3)
    node.equal("speed in a halt", speed(ctx), 0, "C402-137", within=0.2)
    node.control(0x1F, 0.3)
    node.equal("speed after it", speed(ctx), 100, "C402-137", within=1)
    node.control(0x0F, 0.3)
    node.equal("speed without the start bit", speed(ctx), 0, "C402-137", within=0.2)
    node.bits(0x3000, 0, "C402-136")


# -- probes -------------------------------------------------------------------------------------------------

POSITIVE, NEGATIVE, ON, CONTINUOUS = 0x10, 0x20, 0x01, 0x02
VALUES: Final = {(1, "up"): 0x60BA, (1, "down"): 0x60BB, (2, "up"): 0x60BC, (2, "down"): 0x60BD}
COUNTERS: Final = {(1, "up"): 0x60D5, (1, "down"): 0x60D6, (2, "up"): 0x60D7, (2, "down"): 0x60D8}


@CAMPAIGN.product(
    "probe/{probe}-{how}",
    parameters={"probe": (1, 2), "how": ("first", "continuous")},
    title="probe {probe}, {how} events",
    requirements=("C402-143", "C402-150"),
)
def probe(ctx: CaseContext, probe: int, how: str) -> None:
    """First event: value and counter stand until the probe is switched on again; continuous: each edge
    counts; the level has its bit, and the other probe stays still.
    """
    shift = 8 * (probe - 1)
    for edges in (POSITIVE, NEGATIVE, POSITIVE | NEGATIVE):
        node = turning(ctx, 3, 300) if edges == POSITIVE else node  # noqa: F821 - the one of the first round
        node.write(0x60B8, 0)
        before = {key: node.read(index, signed=False) for key, index in COUNTERS.items()}
        node.write(0x60B8, (ON | edges | (CONTINUOUS if how == "continuous" else 0)) << shift)
        seen: dict[str, list[int]] = {"up": [], "down": []}
        for _ in range(3):
            for state, edge in ((True, "up"), (False, "down")):
                if state:
                    held = ctx.inject("switch.press", DRIVE, input=f"probe{probe}")
                else:
                    held.remove()
                ctx.run_for(0.003)
                seen[edge].append(node.read(VALUES[probe, edge]))
                level = node.read(0x60B9, signed=False) >> shift & 0x80
                node.equal("bit 7 of the status", level, 0x80 * state, "C402-143")
        status = node.read(0x60B9, signed=False)
        for edge, bit in (("up", POSITIVE), ("down", NEGATIVE)):
            stored = bool(edges & bit)
            counted = node.read(COUNTERS[probe, edge], signed=False) - before[probe, edge]
            wanted = (3 if how == "continuous" else 1) if stored else 0
            node.equal(f"{edge} events counted", counted, wanted, "C402-150")
            different = len(set(seen[edge]))
            if stored:
                node.equal(f"{edge} values", different, 3 if how == "continuous" else 1, "C402-143")
            node.equal(f"{edge} bit", bool(status >> shift & (2 if edge == "up" else 4)), stored, "C402-143")
        other = status >> (8 - shift) & 0x7F
        node.equal("status of the other probe", other, 0, "C402-143")
    for value, sub, index in (
        (0x0D, 0, 0x60B8),
        (0x0D00, 0, 0x60B8),
        (3, 1, 0x60D0),
        (0, 2, 0x60D0),
        (-1, 1, 0x60D0),
    ):
        node.refuses(index, value, RANGE, "C402-144", sub=sub)


@CAMPAIGN.case("probe/index", requirements=("C402-144", "C402-152"))
def index_probe(ctx: CaseContext) -> None:
    """The zero mark as source: continuous events one revolution apart, at the mark, both ways."""
    node = turning(ctx, 3, 600)
    for rpm in (600, -600):
        node.write(0x60FF, rpm * 1000)
        ctx.run_for(1.0)
        node.write(0x60B8, 0)
        node.write(0x60B8, ON | CONTINUOUS | POSITIVE | 0x04)
        found = []
        for _ in range(3):
            count = node.read(0x60D5)
            poll(ctx, node, 0x60D5, lambda value, count=count: value != count, 0.3)
            found.append(node.read(0x60BA))
        for place in found:
            node.equal("place of the mark", place % REV, 777, "C402-152", within=0)
        node.equal("distance of the marks", found[2] - found[1], REV if rpm > 0 else -REV, "C402-152")


# -- protection and safety ----------------------------------------------------------------------------------


@CAMPAIGN.product(
    "warning/{what}",
    parameters=[
        {"what": "injected", "fault": "drive.warning", "bit": 31, "inputs": {}},
        {"what": "mains", "fault": "drive.mains_off", "bit": 5, "inputs": {}},
        {"what": "phase", "fault": "drive.phase_loss", "bit": 6, "inputs": {}},
        {"what": "torque-off", "fault": "drive.sto", "bit": 8, "inputs": {}},
        {"what": "interlock", "fault": "drive.interlock", "bit": 10, "inputs": {}},
    ],
    title="warning: {what}",
    requirements=("C402-041", "C402-299"),
)
def warning(ctx: CaseContext, what: str, fault: str, bit: int, inputs: dict[str, float]) -> None:
    """Bit 7 and the bit of 2100h and 1002h come with the cause and go with it; 603Fh stays 0."""
    node = drive(ctx)
    node.bits(0x80, 0, "C402-041")
    cause = ctx.inject(fault, DRIVE, **inputs)
    ctx.run_for(0.05)
    node.bits(0x80, 0x80, "C402-041")
    for index in (0x2100, 0x1002):
        node.shows(index, 1 << bit, "C402-299", signed=False)
    node.shows(0x603F, 0, "C402-041", signed=False)
    if what in ("mains", "phase"):
        node.shows(0x2103, 1 if what == "mains" else 2, sub=1, signed=False)
    if what == "torque-off":
        node.shows(0x2108, 3, signed=False)
    if what == "interlock":
        node.shows(0x2108, 16, signed=False)
        node.equal("60FDh bit 3", node.read(0x60FD) & 8, 0)
    node.control(0x06)
    node.bits(0x6F, 0x40 if what in ("torque-off", "interlock") else 0x21, "C402-030")
    cause.remove()
    ctx.run_for(0.05)
    node.bits(0x80, 0, "C402-041")
    node.shows(0x2100, 0, "C402-299", signed=False)
    node.equal("60FDh bit 3", node.read(0x60FD) & 8, 8)


@CAMPAIGN.product(
    "temperature/{part}",
    parameters=[
        {"part": "motor", "sub": 1, "warm": 120.0, "hot": 140.0, "bit": 2, "code": 0x4310},
        {"part": "power_stage", "sub": 2, "warm": 85.0, "hot": 95.0, "bit": 3, "code": 0x4210},
    ],
    title="temperature of the {part}",
    requirements=("C402-041", "C402-302", "C402-016"),
)
def temperature(ctx: CaseContext, part: str, sub: int, warm: float, hot: float, bit: int, code: int) -> None:
    """A warning from its limit on, a fault from the next on; no reset until the part is below the warning."""
    node = drive(ctx)
    node.enable(3)
    for celsius, warns in ((warm - 0.5, 0), (warm + 0.5, 1), (hot - 0.5, 1)):
        cause = ctx.inject("drive.overtemperature", DRIVE, part=part, temperature_C=celsius)
        ctx.run_for(0.02)
        node.shows(0x2101, celsius * 10, "C402-302", sub=sub, within=1)
        node.shows(0x2100, warns << bit, "C402-041", signed=False)
        node.bits(0xEF, 0xA7 if warns else 0x27, "C402-041")
        cause.remove()
    cause = ctx.inject("drive.overtemperature", DRIVE, part=part, temperature_C=hot + 0.5)
    ctx.run_for(0.5)
    node.bits(0x4F, 0x08, "C402-302")
    node.shows(0x603F, code, "C402-302", signed=False)
    node.shows(0x1001, 0x09, "C301-019")
    cause.remove()
    cause = ctx.inject("drive.overtemperature", DRIVE, part=part, temperature_C=warm + 0.5)
    node.control(0x80, 0.02)
    node.bits(0x4F, 0x08, "C402-016")
    cause.remove()
    ctx.run_for(0.02)
    node.control(0x00)
    node.control(0x80, 0.02)
    node.bits(0x4F, 0x40, "C402-016")
    node.shows(0x2100, 0, "C402-041", signed=False)


@CAMPAIGN.case("operating-time")
def operating_time(ctx: CaseContext) -> None:
    """The operating time counts while there is supply, over all sessions; a fault keeps the time of its
    instant.
    """
    node = drive(ctx)
    begun_ms = node.read(0x2106, signed=False) - 1000.0 * ctx.now_s
    off_s = 0.0
    for _ in range(3):
        ctx.run_for(0.1)
        ctx.inject("drive.fault", DRIVE, code=0x2310)
        ctx.run_for(0.01)
        struck_ms = begun_ms + 1000.0 * (ctx.now_s - 0.01 - off_s)
        node.shows(0x2105, struck_ms, sub=1, within=3.0, signed=False)
        node.shows(0x2106, begun_ms + 1000.0 * (ctx.now_s - off_s), within=4.0, signed=False)
        ctx.inject("drive.power_off", DRIVE, duration_s=0.07)
        off_s += 0.07
        ctx.run_for(0.3)


@CAMPAIGN.case("overload", requirements=("C402-160", "C402-016"))
def overload(ctx: CaseContext) -> None:
    """A blocked motor at three times its torque: i2t rises, warns, trips with 2310h at 105 %, and has to
    fall.
    """
    node = drive(ctx)
    node.configure({0x6087: 100_000})
    node.enable(4)
    ctx.inject("mechanics.jam", DRIVE)
    node.write(0x6071, 2000)
    begun = ctx.now_s
    node.until(0x80, 0x80, 2.0, "the overload warns")
    # (T / T rated)^2 = 4 rises with 0.5 s to 1.
    node.equal("time until the warning, s", ctx.now_s - begun, 0.1435, "C402-160", within=0.035)
    node.shows(0x2100, 1, "C402-160", signed=False)
    node.equal("i2t, permille", node.read(0x2102, 1, signed=False), 1020, "C402-160", within=50)
    node.until(0x08, 0x08, 1.0, "the drive trips")
    node.shows(0x603F, 0x2310, "C402-160", signed=False)
    node.control(0x00)
    node.control(0x80)
    node.bits(0x08, 0x08, "C402-016")
    ctx.run_for(0.3)
    node.control(0x00)
    node.control(0x80, 0.02)
    node.bits(0x4F, 0x40, "C402-016")
    node.equal("entry of 2104h", node.read(0x2104, 1, signed=False) & 0xFFFF, 0x2310)
    node.download(0x2107, 0, b"\1")
    node.shows(0x2104, 0, sub=1, signed=False)


@CAMPAIGN.product(
    "safe-stop-1/{how}",
    parameters={"how": ("in-time", "too-slow", "standing")},
    title="safe stop 1, {how}",
    requirements=("C402-030",),
)
def safe_stop(ctx: CaseContext, how: str) -> None:
    """Quick stop, torque off at standstill, no enabling meanwhile; a ramp that is too slow is FF81h."""
    if how == "standing":
        node = drive(ctx)
        node.control(0x06)
        node.control(0x07)
        ctx.inject("drive.ss1", DRIVE)
        ctx.run_for(0.01)
        node.bits(0x6F, 0x40, "C402-030")
        return
    node = turning(ctx, 3)
    if how == "too-slow":
        node.write(0x6085, 500_000)
    cause = ctx.inject("drive.ss1", DRIVE)
    ctx.run_for(0.03)
    if how == "in-time":
        node.bits(0x6F, 0x07, "C402-030")
        node.shows(0x2108, 0b1100, "C402-030", signed=False)
        node.shows(0x2100, 1 << 9, "C402-041", signed=False)
        found = slope(ctx, ctx.now_s - 0.02, ctx.now_s)
        node.equal("slope", found, -QUICK, "C402-030", within=0.05 * QUICK)
        ctx.run_for(0.3)
        node.bits(0x6F, 0x40, "C402-030")
        node.control(0x06)
        node.bits(0x6F, 0x40, "C402-030")
    else:
        ctx.run_for(0.4)
        node.bits(0x4F, 0x08, "C402-030")
        node.shows(0x603F, 0xFF81, "C402-030", signed=False)
        node.control(0x80)
        node.bits(0x4F, 0x08, "C402-016")
    cause.remove()
    ctx.run_for(0.01)
    node.control(0x00)
    node.control(0x80)
    node.control(0x06)
    node.bits(0x6F, 0x21, "C402-030")
    node.shows(0x2108, 0, "C402-030", signed=False)


@CAMPAIGN.case("interlock", requirements=("C402-168",))
def interlock(ctx: CaseContext) -> None:
    """An open interlock makes a quick stop, and enabling has to wait until it is closed."""
    node = turning(ctx, 3)
    cause = ctx.inject("drive.interlock", DRIVE)
    ctx.run_for(0.02)
    node.bits(0x6F, 0x07, "C402-168")
    ctx.run_for(SPEED / QUICK + 0.1)
    node.equal("speed", speed(ctx), 0, "C402-168", within=0.5)
    node.control(0x06)
    node.bits(0x6F, 0x40, "C402-168")
    cause.remove()
    ctx.run_for(0.01)
    node.control(0x00)
    node.control(0x06)
    node.bits(0x6F, 0x21, "C402-168")


@CAMPAIGN.case("shown", requirements=("C402-041", "C402-078"))
def shown(ctx: CaseContext) -> None:
    """Bits that are forced, a word that stands, a wrong mode, a slow ramp, a torque limit: each shows, and is
    gone when it ends.
    """
    node = drive(ctx)
    node.enable(3)
    for fault, inputs, index, during, after in (
        ("drive.statusword_bits", {"set": 0x4000, "clear": 0x0020}, 0x6041, (0x4020, 0x4000), (0x4020, 0x20)),
        ("drive.mode_display", {"mode": 8}, 0x6061, (0xFF, 8), (0xFF, 3)),
        ("drive.local_control", {}, 0x6041, (0x200, 0), (0x200, 0x200)),
    ):
        cause = ctx.inject(fault, DRIVE, **inputs)
        ctx.run_for(0.01)
        node.equal(
            f"{index:04X}h with {fault}", node.read(index, signed=False) & during[0], during[1], "C402-041"
        )
        cause.remove()
        ctx.run_for(0.01)
        node.equal(
            f"{index:04X}h without it", node.read(index, signed=False) & after[0], after[1], "C402-041"
        )
    cause = ctx.inject("drive.slow_ramp", DRIVE, share=0.5)
    node.write(0x60FF, 600_000)
    ctx.run_for(0.1)
    node.equal("slope with half a ramp", slope(ctx, ctx.now_s - 0.08, ctx.now_s), UP / 2, within=0.05 * UP)
    cause.remove()
    cause = ctx.inject("drive.torque_limit", DRIVE, share=0.2)
    ctx.run_for(0.01)
    node.shows(0x2102, 200, sub=4, signed=False)
    cause.remove()
    ctx.run_for(0.01)
    node.shows(0x2102, 0xFFFF, sub=4, signed=False)


@OF_WARNINGS.case("sync-lost", requirements=("C301-109",))
def sync_lost(ctx: CaseContext) -> None:
    """Each time that SYNC is missing the drive says so by an EMCY that ends at once, and goes on."""
    node = drive(ctx)
    node.listen(0x80 + NODE)
    node.write(0x1006, 4000)
    node.nmt(NmtCommand.START)
    node.write(0x60FF, 240_000)
    node.enable(9)
    for number in (1, 2, 3):
        for _ in range(5):
            node.send(0x80, b"")
            ctx.run_for(0.003)
        node.equal(f"EMCYs before loss {number}", len(node.taken(0x80 + NODE)), 0)
        ctx.run_for(0.03)
        found = [data[:3].hex() for data in node.taken(0x80 + NODE)]
        node.equal(
            f"EMCYs of loss {number} {found}", [data[:4] for data in found] == ["0087", "0000"], 1, "C301-109"
        )
        node.equal("error register in the last one", found[-1:] == ["000000"], 1, "C301-109")
        node.bits(0x4F, 0x07)
    node.equal("speed, rpm", speed(ctx), 240.0, within=2.0)
