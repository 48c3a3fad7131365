"""Modes, option codes and homing methods of a CiA 402 drive, led object by object by a plain master."""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from fieldbus.canopen import NmtCommand
from hil.campaign import Campaign, CaseContext
from hil.expect import happens, never_happens
from hil.record import event
from testcases.campaigns._led_servo import DRIVE, NODE, REV, Node, words

CAMPAIGN: Final = Campaign(
    "cia402 modes", controller="", tags=("drive", "cia402"), bench="testcases.campaigns._led_servo:BENCH"
)

SPEED: Final = 600
"""Speed of the motions, rpm."""
UP, DOWN, QUICK = 3000, 2000, 9000
"""Slopes of speeding up, slowing down and the quick stop, rpm/s."""
MODES: Final = {1: "pp", 2: "vl", 3: "pv", 4: "tq", 6: "hm", 7: "ip", 8: "csp", 9: "csv", 10: "cst"}
READY: Final = {1: 0x0F, 2: 0x7F, 3: 0x0F}
SLOPES: Final = {"slow down": DOWN, "quick stop ramp": QUICK}


def drive(ctx: CaseContext) -> Node:
    """Return the drive, with slopes that are not alike."""
    node = Node(ctx)
    node.configure(
        {0x6081: SPEED * 1000, 0x6083: UP * 1000, 0x6084: DOWN * 1000, 0x6085: QUICK * 1000}
        | {(0x6048, 1): UP, (0x6049, 1): DOWN, (0x604A, 1): QUICK, 0x6065: 0x7FFFFFFF}
    )
    return node


def speed(ctx: CaseContext) -> float:
    """Return the speed of the motor now, rpm."""
    return float(ctx.trace()[f"{DRIVE}.motor_speed"].values[-1])


def turning(ctx: CaseContext, mode: int, rpm: int = SPEED) -> Node:
    """Return the drive, turning with a speed in a mode."""
    node = drive(ctx)
    node.enable(mode)
    ctx.do(f"{rpm} rpm in mode {MODES[mode]}")
    if mode == 1:
        node.write(0x607A, 60 * REV if rpm > 0 else -60 * REV)
        node.control(0x1F)
    elif mode == 2:
        node.write(0x6042, rpm)
        node.control(READY[2])
    else:
        node.write(0x60FF, rpm * 1000)
    ctx.run_for(abs(rpm) / UP + 0.03)
    node.shows(0x606C, rpm * 1000, "C402-096", within=3000)
    return node


def slope(ctx: CaseContext, since: float, until: float) -> float:
    """Return the slope of the speed of the motor in a window, rpm/s."""
    signal = ctx.trace()[f"{DRIVE}.motor_speed"].between(since, until)
    return float(np.polyfit(signal.time_s - since, signal.values, 1)[0])


# -- modes ------------------------------------------------------------------------------------------------


@CAMPAIGN.case("modes", requirements=("C402-078", "C402-087", "C402-090"))
def modes(ctx: CaseContext) -> None:
    """6061h follows 6060h in the modes of 6502h; every other number is refused; 0 changes nothing."""
    node = drive(ctx)
    supported = node.read(0x6502)
    node.equal("modes of 6502h", supported, 0x3EF, "C402-086")
    node.shows(0x1000, 0x00020192)
    for mode in MODES:
        node.write(0x6060, mode)
        ctx.run_for(0.002)
        node.shows(0x6061, mode, "C402-078")
    for mode in (5, 11, 100, -1, -128):
        node.refuses(0x6060, mode, 0x06090030, "C402-090")
    node.write(0x6060, 0)
    ctx.run_for(0.002)
    node.shows(0x6061, 10, "C402-088")


@CAMPAIGN.product(
    "ramps/{name}-{way}",
    parameters=[
        {"mode": mode, "name": MODES[mode], "way": way, "sign": sign}
        for mode in (1, 2, 3)
        for way, sign in (("forward", 1), ("backward", -1))
    ],
    title="{name} {way}: speeding up, slowing down, reversal",
    requirements=("C402-096", "C402-097"),
)
def ramps(ctx: CaseContext, mode: int, name: str, way: str, sign: int) -> None:
    """Each direction speeds up with its slope and slows down with the other one; bit 10 tells the end."""
    del name, way
    node = drive(ctx)
    node.enable(mode)
    begun = ctx.now_s
    target = {1: 0x607A, 2: 0x6042, 3: 0x60FF}[mode]
    node.write(target, sign * {1: 6 * REV, 2: SPEED, 3: SPEED * 1000}[mode])
    node.control(READY[mode] | (0x10 if mode == 1 else 0), 0.1)
    if mode != 2:
        node.bits(0x400, 0, "C402-044")
    node.equal("slope of speeding up", slope(ctx, ctx.now_s - 0.09, ctx.now_s), sign * UP, within=0.03 * UP)
    ctx.run_for(SPEED / UP)
    node.shows(0x606C, sign * SPEED * 1000, within=3000)
    node.shows(0x6064, sign * (SPEED / 60 * REV * (ctx.now_s - begun - SPEED / UP / 2)), within=200)
    if mode == 1:
        node.until(0x400, 0x400, 3.0, "the target is reached")
        ctx.run_for(0.05)
        node.shows(0x6064, sign * 6 * REV, "C402-091", within=1)
        node.shows(0x6062, sign * 6 * REV)
        node.bits(0x1000, 0x1000, "C402-091")
        node.control(0x0F)
        node.bits(0x1400, 0x400, "C402-091")
        return
    if mode == 3:
        node.bits(0x1400, 0x400, "C402-044")
    node.write(target, 0)
    ctx.run_for(0.1)
    found = slope(ctx, ctx.now_s - 0.09, ctx.now_s)
    node.equal("slope of slowing down", found, -sign * DOWN, within=0.03 * DOWN)
    ctx.run_for(SPEED / DOWN)
    node.shows(0x606C, 0, within=300)
    node.bits(0x1400, 0x1400 if mode == 3 else 0, "C402-044")


@CAMPAIGN.product(
    "set-points/{kind}",
    parameters={"kind": ("queued", "immediate", "relative", "blended", "level", "end-velocity")},
    title="two set-points in profile position: {kind}",
    requirements=("C402-091", "C402-092", "C402-093"),
)
def set_points(ctx: CaseContext, kind: str) -> None:
    """A second set-point waits, interrupts, adds up, is blended in, or does not count without an edge."""
    node = drive(ctx)
    node.enable(1)
    word = {"immediate": 0x3F, "relative": 0x5F, "blended": 0x21F}.get(kind, 0x1F)
    if kind == "end-velocity":
        node.write(0x6082, SPEED * 500)
    node.write(0x607A, 3 * REV)
    node.control(0x1F)
    node.bits(0x1000, 0x1000, "C402-091")
    if kind != "level":
        node.control(word & ~0x10)
        node.bits(0x1000, 0, "C402-091")
    ctx.run_for(0.15)
    second = -2 * REV if kind == "relative" else 5 * REV
    node.write(0x607A, second)
    node.control(word, 0.002)
    if kind in ("queued", "relative", "blended"):
        node.control(word & ~0x10)
        node.bits(0x1000, 0x1000, "C402-092")
    node.until(0x400, 0x400, 4.0, "the target is reached")
    ctx.run_for(0.4)
    ends = {"level": 3 * REV, "relative": REV}.get(kind, 5 * REV)
    if kind == "end-velocity":
        # 300 rpm at the target, then the slope of 6084h.
        ends = 5 * REV + round(0.5 * (SPEED / 2 / 60) ** 2 / (DOWN / 60) * REV)
    node.shows(0x6064, ends, within=25 if kind == "end-velocity" else 1)
    stops = ctx.trace()[f"{DRIVE}.motor_speed"].between(0.3, ctx.now_s)
    rests = int(np.count_nonzero(np.diff((np.abs(stops.values) < UP * 0.0045).astype(int)) > 0))
    node.equal("number of rests", rests, 2 if kind in ("queued", "relative") else 1, "C402-092")
    node.control(0x0F)


@CAMPAIGN.product(
    "profile/{kind}",
    parameters={"kind": (0, 1, 2, 3)},
    title="profile type {kind} of 6086h",
    requirements=("C402-095", "C402-229"),
)
def profile(ctx: CaseContext, kind: int) -> None:
    """sin² takes pi/2 times, jerk-free 15/8 times as long as a straight ramp; 3 keeps the jerk of 60A4h."""
    node = drive(ctx)
    node.configure({0x6086: kind, (0x60A4, 1): 30_000_000})
    node.enable(1)
    begun = ctx.now_s
    node.write(0x607A, 5 * REV)
    begun = ctx.now_s
    node.control(0x1F)
    took = ctx.now_s - begun + node.until(0x400, 0x400, 5.0, "the target is reached")
    v, up, down = SPEED / 60, UP / 60, DOWN / 60
    stretch = {0: 1.0, 1: math.pi / 2, 2: 1.875}.get(kind, 0.0)
    if kind == 3:
        jerk = 30_000 / 60
        ramp_up, ramp_down = v / up + up / jerk, v / down + down / jerk
    else:
        ramp_up, ramp_down = stretch * v / up, stretch * v / down
    expected = (5 - 0.5 * v * (ramp_up + ramp_down)) / v + ramp_up + ramp_down
    node.equal("time of the positioning", took, expected, "C402-095", within=0.02)
    ctx.run_for(0.05)
    node.shows(0x6064, 5 * REV, within=1)


@CAMPAIGN.case("limits", requirements=("C402-095", "C402-257", "C402-045"))
def limits(ctx: CaseContext) -> None:
    """607Dh, 607Fh, 6080h, 60C8h and 60C9h hold positions and speeds, and bit 11 says so."""
    node = drive(ctx)
    node.configure({0x60C9: 500_000, 0x60C8: -200_000})
    node.enable(3)
    for wanted, held in ((SPEED, 500), (-SPEED, -200)):
        node.write(0x60FF, wanted * 1000)
        ctx.run_for(0.7)
        node.shows(0x606C, held * 1000, "C402-257", within=2000)
        node.bits(0xC00, 0x800, "C402-045")
    node.write(0x60FF, -100_000)
    ctx.run_for(0.2)
    node.bits(0xC00, 0x400, "C402-045")
    node.configure({0x60C9: 9_000_000, 0x60C8: -9_000_000, 0x6080: 350, 0x60FF: 500_000})
    ctx.run_for(0.6)
    node.shows(0x606C, 350_000, "C402-045", within=2000)
    node.bits(0xC00, 0x800, "C402-045")


@CAMPAIGN.product(
    "torque/{limit}",
    parameters=[
        {"limit": "none", "index": 0, "value": 0, "target": 400, "reached": 400},
        {"limit": "6072h", "index": 0x6072, "value": 300, "target": 900, "reached": 300},
        {"limit": "60E0h", "index": 0x60E0, "value": 250, "target": 900, "reached": 250},
        {"limit": "60E1h", "index": 0x60E1, "value": 150, "target": -900, "reached": -150},
    ],
    title="profile torque up to {limit}",
    requirements=("C402-098", "C402-045"),
)
def torque(ctx: CaseContext, limit: str, index: int, value: int, target: int, reached: int) -> None:
    """The torque takes 6087h to its target on a held shaft; limits hold it, bits 10 and 11 say so."""
    del limit
    node = drive(ctx)
    node.configure({0x6087: 1000, **({index: value} if index else {})})
    ctx.inject("mechanics.jam", DRIVE)
    node.enable(4)
    node.bits(0x400, 0x400, "C402-098")
    begun = ctx.now_s
    node.write(0x6071, target)
    ctx.run_for(0.12)
    node.bits(0x400, 0, "C402-098")
    node.shows(0x6074, math.copysign(1000 * (ctx.now_s - begun), target), "C402-098", within=8)
    node.shows(0x6077, math.copysign(1000 * (ctx.now_s - begun), target), "C402-098", within=9)
    ctx.run_for(1.0)
    node.shows(0x6077, reached, "C402-098", within=1)
    node.bits(0xC00, 0x400 if target == reached else 0x800, "C402-045")
    node.write(0x6071, 0)
    ctx.run_for(1.0)
    node.shows(0x6077, 0, within=1)
    node.bits(0xC00, 0x400, "C402-045")


# -- option codes ------------------------------------------------------------------------------------------

STOPS: Final[dict[str, tuple[int, dict[int, str], int, int]]] = {
    "halt": (0x605D, {1: "slow down", 2: "quick stop ramp"}, 0x27, 0x27),
    "quick-stop": (
        0x605A,
        {0: "coast", 1: "slow down", 2: "quick stop ramp", 5: "slow down", 6: "quick stop ramp"},
        0x40,
        0x07,
    ),
    "shutdown": (0x605B, {0: "coast", 1: "slow down"}, 0x21, 0x21),
    "disable-operation": (0x605C, {0: "coast", 1: "slow down"}, 0x23, 0x23),
}
"""Object, actions by value, bits of the status word at the end and, for 605Ah from 5 on, in their place."""


@CAMPAIGN.product(
    "option/{stop}-{value}-{name}",
    parameters=[
        {"stop": stop, "value": value, "mode": mode, "name": MODES[mode], "sign": sign}
        for stop, (_, actions, _, _) in STOPS.items()
        for value in actions
        for mode, sign in ((1, 1), (2, -1), (3, -1))
        if not (mode != 3 and value in (0, 5))
    ],
    title="{stop} with option {value} in {name}",
    requirements=("C402-072", "C402-053"),
)
def option(ctx: CaseContext, stop: str, value: int, mode: int, name: str, sign: int) -> None:
    """The axis brakes as the option code says, with the right slope, and ends in the right state."""
    del name
    index, actions, state, stays = STOPS[stop]
    node = turning(ctx, mode, sign * SPEED)
    node.write(index, value)
    word = READY[mode] | (0x10 if mode == 1 else 0)
    action = actions[value]
    commanded = {"halt": word | 0x100, "quick-stop": 0x02, "shutdown": 0x06, "disable-operation": 0x07}[stop]
    begun = ctx.now_s
    node.control(commanded, 0.0)
    ctx.run_for(0.05)
    if action == "coast":
        node.equal("speed while coasting", speed(ctx), sign * SPEED, within=10)
        node.bits(0x6F, state, "C402-053")
        return
    found = slope(ctx, ctx.now_s - 0.04, ctx.now_s)
    node.equal("slope", found, -sign * SLOPES[action], "C402-054", within=0.05 * SLOPES[action])
    node.bits(0x400, 0, "C402-044")
    during = {"halt": 0x27, "quick-stop": 0x07}.get(stop, 0x27)
    node.bits(0x6F, during, "C402-072")
    ctx.run_for(SPEED / SLOPES[action])
    node.equal("speed at the end", speed(ctx), 0, within=0.5)
    node.bits(0x6F, stays if value >= 5 else state, "C402-058")
    if stop == "halt" and mode != 2:
        node.bits(0x400, 0x400, "C402-044")
        node.control(word)
        ctx.run_for(SPEED / UP + 0.1)
        node.shows(0x606C, sign * SPEED * 1000, "C402-063", within=3000)
    if value >= 5:
        node.control(word)
        node.bits(0x6F, 0x27, "C402-058")
    ctx.expect(never_happens(event("drive.fault", DRIVE), since=begun))


@CAMPAIGN.case("option-values", requirements=("C402-072", "C402-073"))
def option_values(ctx: CaseContext) -> None:
    """Option codes take the values of the profile; reserved and negative ones are refused."""
    node = drive(ctx)
    allowed = {
        0x6007: range(4),
        0x605A: range(9),
        0x605B: range(2),
        0x605C: range(2),
        0x605D: range(1, 5),
        0x605E: range(5),
    }
    for index, values in allowed.items():
        for value in (*range(-2, 11), -0x8000):
            node.refuses(index, value, 0 if value in values else 0x06090030, "C402-073")


@CAMPAIGN.product(
    "states/{state}-{word}",
    parameters=[
        {"state": state, "word": f"{word:02X}h", "given": word, "ends": ends}
        for state, table in {
            "switch-on-disabled": {0x06: 0x21, 0x07: 0x40, 0x0F: 0x40, 0x02: 0x40, 0x00: 0x40, 0x80: 0x40},
            "ready": {0x06: 0x21, 0x07: 0x23, 0x0F: 0x27, 0x02: 0x40, 0x00: 0x40, 0x80: 0x21},
            "switched-on": {0x06: 0x21, 0x07: 0x23, 0x0F: 0x27, 0x02: 0x40, 0x00: 0x40, 0x80: 0x23},
            "enabled": {0x06: 0x21, 0x07: 0x23, 0x0F: 0x27, 0x02: 0x40, 0x00: 0x40, 0x80: 0x27},
            "fault": {0x06: 0x08, 0x07: 0x08, 0x0F: 0x08, 0x02: 0x08, 0x00: 0x08, 0x80: 0x40},
        }.items()
        for word, ends in table.items()
    ],
    title="control word {word} in {state}",
    requirements=("C402-018", "C402-015"),
)
def states(ctx: CaseContext, state: str, word: str, given: int, ends: int) -> None:
    """Each command leads from each state to where the state machine says, or changes nothing."""
    del word
    node = drive(ctx)
    node.write(0x6060, 3)
    for one in {"ready": (6,), "switched-on": (6, 7), "enabled": (6, 7, 15)}.get(state, ()):
        node.control(one)
    if state == "fault":
        ctx.inject("drive.fault", DRIVE, code=0x8611)
        ctx.run_for(0.02)
        node.shows(0x603F, 0x8611, "C402-014", signed=False)
        node.shows(0x1001, 0x21, "C301-019")
        node.control(0x00)
        node.bits(0x4F, 0x08, "C402-015")
    mask = 0x4F if ends in (0x08, 0x40) else 0x6F
    node.control(given, 0.02)
    node.bits(mask, ends, "C402-018")
    node.bits(0x0010, 0x0010)  # voltage enabled: the DC link is charged
    node.bits(0x0200, 0x0200, "C402-041")
    node.shows(0x6061, 3)
    if ends == 0x40 and state == "fault":
        node.shows(0x603F, 0, "C402-015")
        node.shows(0x1001, 0, "C402-015")


# -- cyclic modes ------------------------------------------------------------------------------------------


@CAMPAIGN.product(
    "cyclic/{name}",
    parameters=[{"mode": mode, "name": MODES[mode]} for mode in (7, 8, 9, 10)],
    title="a ramp of set-points by PDO in {name}",
    requirements=("C402-100", "C402-101"),
)
def cyclic(ctx: CaseContext, mode: int, name: str) -> None:
    """Set-points by PDO at every SYNC are followed, offsets add up, and TPDOs show what the axis does."""
    del name
    node = drive(ctx)
    target = {7: 0x60C10120, 8: 0x607A0020, 9: 0x60FF0020, 10: 0x60710010}[mode]
    node.map_pdo(1, (0x60400010, target), 1, transmit=False)
    node.map_pdo(1, (0x60410010, 0x60640020), 1, transmit=True)
    node.configure({(0x60C2, 1): 4, 0x6060: mode})
    node.listen(0x180 + NODE)
    node.nmt(NmtCommand.START)
    master = ctx.bench.network()
    master.start_sync(4_000_000, 0)
    value = 0
    gear = {"word": 0x06, "step": 0}

    def send() -> None:
        nonlocal value
        value += gear["step"]
        size = 2 if mode == 10 else 4
        data = words(gear["word"]) + value.to_bytes(size, "little", signed=True)
        master.send(0x200 + NODE, data)

    ctx.bench.on_cycle(send)
    for word in (0x06, 0x07, 0x1F if mode == 7 else 0x0F):
        gear["word"] = word
        ctx.run_for(0.02)
    node.bits(0x6F, 0x27, "C402-018")
    node.bits(0x1000, 0x1000, "C402-046")
    before = node.read(0x6064)
    if mode in (7, 8):
        gear["step"] = 40
        ctx.run_for(0.4)
        node.shows(0x606C, 40 / REV / 0.004 * 60_000, within=3000)
        gear["step"] = 0
        ctx.run_for(0.3)
        node.shows(0x6064, value, "C402-100", within=1)
        node.shows(0x6062, value, within=1)
        node.shows(0x60F4, 0, within=1)
        if mode == 8:
            node.write(0x60B0, -300)
            ctx.run_for(0.3)
            node.shows(0x6064, value - 300, "C402-100", within=1)
    elif mode == 9:
        gear["step"] = 1500
        ctx.run_for(0.4)
        gear["step"] = 0
        ctx.run_for(0.05)
        node.shows(0x606C, value, "C402-100", within=1500)
        node.write(0x60B1, 30_000)
        ctx.run_for(0.05)
        node.shows(0x606C, value + 30_000, "C402-100", within=1500)
    else:
        gear["step"] = 1
        ctx.run_for(0.1)
        gear["step"] = 0
        ctx.run_for(0.01)
        node.shows(0x6077, value, "C402-101", within=1)
        node.write(0x60B2, 10)
        ctx.run_for(0.01)
        node.shows(0x6077, value + 10, "C402-101", within=1)
    last = node.taken(0x180 + NODE)
    ctx.expect(never_happens(event("drive.fault", DRIVE)))
    node.equal("TPDO1 came with every SYNC", len(last), 250 * ctx.now_s, within=30 + 250 * 0.5)
    moved = abs(int.from_bytes(last[-1][2:], "little", signed=True) - before)
    node.equal("the TPDO shows the way", moved > 10, 1)


@CAMPAIGN.case("first-target")
def first_target(ctx: CaseContext) -> None:
    """In csp a drive that has got no target yet holds the place where it is enabled: 607Ah is still 0, far
    from there.
    """
    node = turning(ctx, 3)
    node.write(0x60FF, 0)
    ctx.run_for(SPEED / DOWN + 0.1)
    node.control(0x00)
    there = node.read(0x6064)
    node.equal("the place is away from 0", abs(there) > REV, 1)
    node.shows(0x607A, 0)
    node.enable(8)
    ctx.run_for(0.2)
    node.shows(0x6064, there, within=REV / 100)


@CAMPAIGN.product(
    "set-point-counts-again/{mode}-{word:x}",
    parameters={"mode": (2, 3, 9, 10), "word": (0x07, 0x06, 0x00)},
    title="mode {mode}, left by {word:X}h and entered again",
)
def counts_again(ctx: CaseContext, mode: int, word: int) -> None:
    """A set-point that was there before an operation ended counts again with the next one, unchanged."""
    node = drive(ctx)
    node.write(0x605B, 1)
    index, value = {2: (0x6042, 240), 3: (0x60FF, 240_000), 9: (0x60FF, 240_000), 10: (0x6071, 40)}[mode]
    node.write(index, value)
    found = []
    for _ in range(2):
        node.enable(mode)
        node.control(READY.get(mode, 0x0F), 0.15)
        found.append(speed(ctx))
        node.control(word, 0.4)
        if mode == 10 or not word:
            # It coasts: the machine is held.
            node.control(0x00, 0.01)
            ctx.inject("mechanics.jam", DRIVE, duration_s=0.1)
            ctx.run_for(0.15)
        node.equal(f"speed after {word:02X}h", speed(ctx), 0.0, within=0.5)
        node.control(0x00, 0.3)
    node.equal("speed of the first time", abs(found[0]) > 100.0, 1)
    node.equal("speed of the second time", found[1], found[0], within=25.0)


# -- homing in the drive -----------------------------------------------------------------------------------

NLS, PLS, CAM = -45.0, 61.0, (-30.0, -12.5)
"""Places of the switches of the bench, mm."""
HYSTERESIS: Final = 0.25
INDEX: Final = 777 / REV * 10.0
"""Place of the zero mark in a revolution, mm."""
EDGES: Final[dict[int, tuple[float, int]]] = {
    1: (NLS + HYSTERESIS, 1),
    2: (PLS - HYSTERESIS, -1),
    7: (CAM[0] - HYSTERESIS, -1),
    8: (CAM[0], 1),
    9: (CAM[1], -1),
    10: (CAM[1] + HYSTERESIS, 1),
    11: (CAM[1] + HYSTERESIS, 1),
    12: (CAM[1], -1),
    13: (CAM[0], 1),
    14: (CAM[0] - HYSTERESIS, -1),
}
"""Home edge of the methods with a switch and index: place, direction in which it is passed."""


def home_place(method: int, start: float) -> float:
    """Return where the home position of a method is, mm."""
    if method in (33, 34):
        place, direction, index = start, (-1 if method == 33 else 1), True
    elif method in (35, 37):
        return start
    else:
        base, index = (method, True) if method < 15 else (method - 16, False)
        place, direction = EDGES[base]
    if not index:
        return place
    turns = (place - INDEX) / 10.0
    return 10.0 * (math.floor(turns) + 1 if direction > 0 else math.ceil(turns) - 1) + INDEX


@CAMPAIGN.product(
    "homing/{method}-{start}",
    parameters=[
        {"method": method, "start": start}
        for method in (*EDGES, *(base + 16 for base in EDGES), 33, 34, 37)
        for start in (("left", "right") if method in range(7, 31) and method not in (17, 18) else ("right",))
    ],
    title="homing method {method}, from the {start}",
    requirements=("C402-133", "C402-135", "C402-139"),
)
def homing(ctx: CaseContext, method: int, start: str) -> None:
    """The drive finds the edge of its method, or the first zero mark after it; bits 10, 12, 13 tell of it."""
    node = drive(ctx)
    node.configure({(0x6099, 1): 300_000, (0x6099, 2): 60_000, 0x609A: 60_000_000})
    if start == "left":
        node.enable(1)
        node.write(0x607A, -4 * REV)
        node.control(0x1F)
        node.until(0x400, 0x400, 5.0, "the start position is reached")
        node.control(0x06)
    begun_mm = node.read(0x6064) / REV * 10.0
    node.configure({0x6098: method, 0x607C: 0})
    node.enable(6)
    node.bits(0x2000, 0, "C402-135")
    begun = ctx.now_s
    node.control(0x1F)
    if method != 37:
        node.bits(0x3400, 0, "C402-135")
    ctx.run_for(0.05)
    node.until(0x1400, 0x1400, 30.0, "homing has ended")
    node.bits(0x2000, 0, "C402-135")
    ctx.run_for(0.1)
    true_mm = float(ctx.trace()[f"{DRIVE}.position"].values[-1]) * 1000.0
    found = true_mm - node.read(0x6064) / REV * 10.0
    window = 0.0 if method in range(1, 15) or method >= 33 else 0.012
    node.equal("home position, mm", found, home_place(method, begun_mm), "C402-139", within=window + 0.0052)
    trace = ctx.trace()[f"{DRIVE}.motor_speed"].between(begun, ctx.now_s)
    node.equal("greatest speed, rpm", float(np.max(np.abs(trace.values))), 300, within=310)
    if method == 37:
        node.shows(0x6064, 0, "C402-139", within=1)
    ctx.expect(never_happens(event("drive.fault", DRIVE)))


@CAMPAIGN.product(
    "homing-again/{method}",
    parameters=[{"method": 23, "from_mm": 0.0}, {"method": 27, "from_mm": -40.0}],
    title="homing method {method} twice, each time by way of the limit switch",
    requirements=("C402-136", "C402-139"),
)
def homing_again(ctx: CaseContext, method: int, from_mm: float) -> None:
    """A run turns round at the limit switch on its way, and so does the next one; both find the same edge."""
    node = drive(ctx)
    node.configure({(0x6099, 1): 900_000, (0x6099, 2): 90_000, 0x609A: 60_000_000, 0x6098: method, 0x607C: 0})
    for _ in range(2):
        away_mm = from_mm - float(ctx.trace()[f"{DRIVE}.position"].values[-1]) * 1000.0
        node.enable(1)
        node.write(0x607A, round(away_mm / 10.0 * REV))
        node.control(0x5F)
        node.until(0x400, 0x400, 5.0, "the start position is reached")
        node.control(0x06)
        node.enable(6)
        node.control(0x1F, 0.05)
        ended = node.read(0x6041) & 0x3400
        if not ended & 0x2000:
            node.until(0x1400, 0x1400, 10.0, "homing has ended")
        node.equal("homing error", ended & 0x2000, 0, "C402-136")
        ctx.run_for(0.1)
        true_mm = float(ctx.trace()[f"{DRIVE}.position"].values[-1]) * 1000.0
        found = true_mm - node.read(0x6064) / REV * 10.0
        node.equal("home position, mm", found, home_place(method, from_mm), "C402-139", within=0.02)
        node.control(0x06)


@CAMPAIGN.case("homing-fails", requirements=("C402-136",))
def homing_fails(ctx: CaseContext) -> None:
    """Without a home switch the search ends at the limit switch with bit 13; a stop aborts without it."""
    node = drive(ctx)
    node.configure({(0x6099, 1): 600_000, (0x6099, 2): 60_000, 0x609A: 60_000_000, 0x6098: 3})
    ctx.inject("switch.stuck", DRIVE, input="home", state=False)
    node.enable(6)
    node.control(0x1F)
    ctx.run_for(0.3)
    node.bits(0x3400, 0)
    node.control(0x0F)
    ctx.run_for(0.2)
    node.bits(0x3000, 0)
    node.control(0x1F)
    node.until(0x2400, 0x2400, 20.0, "homing has failed")
    node.bits(0x1000, 0, "C402-136")
    ctx.expect(happens(event("emcy.raised", DRIVE, code=0x8612)).covers("C402-136"))


@CAMPAIGN.product(
    "probe/{edge}",
    parameters=[
        {"edge": "rising", "function": 0x11, "index": 0x60BA, "mm": 20.0, "status": 0x3, "sign": 1},
        {"edge": "falling", "function": 0x21, "index": 0x60BB, "mm": 30.0, "status": 0x5, "sign": 1},
        {
            "edge": "rising-backwards",
            "function": 0x11,
            "index": 0x60BA,
            "mm": 30.0,
            "status": 0x3,
            "sign": -1,
        },
    ],
    title="touch probe 1, {edge}",
    requirements=("C402-159",),
)
def probe(ctx: CaseContext, edge: str, function: int, index: int, mm: float, status: int, sign: int) -> None:
    """60B8h takes the position of the edge once; 60B9h shows it, and falls when it is switched off."""
    del edge
    node = drive(ctx)
    node.enable(1)
    if sign < 0:
        node.write(0x607A, 5 * REV)
        node.control(0x1F)
        node.until(0x400, 0x400, 5.0, "the start position is reached")
        node.control(0x0F)
    node.shows(0x60B9, 0, signed=False)
    node.write(0x60B8, function)
    ctx.run_for(0.004)
    node.shows(0x60B9, 1, signed=False)
    for target in ((5 if sign > 0 else 0), (0 if sign > 0 else 5)):
        node.write(0x607A, target * REV)
        node.control(0x1F)
        node.until(0x400, 0x400, 5.0, "the target is reached")
        node.control(0x0F)
        node.equal("status of the probe", node.read(0x60B9, signed=False) & 0x7, status)
        node.shows(index, mm / 10.0 * REV, within=3)
    node.write(0x60B8, 0)
    ctx.run_for(0.004)
    node.shows(0x60B9, 0, signed=False)


@CAMPAIGN.product(
    "polarity/{bit}",
    parameters={"bit": ("position", "velocity")},
    title="polarity of the {bit}",
    requirements=("C402-165",),
)
def polarity(ctx: CaseContext, bit: str) -> None:
    """607Eh turns targets and actual values round; it is locked while the drive is enabled."""
    node = drive(ctx)
    node.write(0x607E, 0x80 if bit == "position" else 0x40)
    node.enable(1 if bit == "position" else 3)
    node.refuses(0x607E, 0, 0x08000022, "C402-165")
    if bit == "position":
        node.write(0x607A, 2 * REV)
        node.control(0x1F)
        node.until(0x400, 0x400, 5.0, "the target is reached")
        ctx.run_for(0.05)
        node.shows(0x6064, 2 * REV, within=1)
        true_mm = float(ctx.trace()[f"{DRIVE}.position"].values[-1]) * 1000.0
        node.equal("true position, mm", true_mm, -20.0, "C402-165", within=0.02)
    else:
        node.write(0x60FF, 300_000)
        ctx.run_for(0.2)
        node.shows(0x606C, 300_000, within=1500)
        node.equal("true speed, rpm", speed(ctx), -300, "C402-165", within=2)


@CAMPAIGN.case("factors", requirements=("C402-167", "C402-236"))
def factors(ctx: CaseContext) -> None:
    """6091h and 6092h scale positions: what is commanded and what is shown."""
    node = drive(ctx)
    node.configure({(0x6091, 1): 3, (0x6091, 2): 1, (0x6092, 1): 500, (0x6092, 2): 1})
    node.refuses(0x6092, 0, 0x06090030, "C402-167", sub=1)
    node.enable(1)
    node.refuses(0x6092, 400, 0x08000022, "C402-167", sub=1)
    node.write(0x607A, 1000)
    node.control(0x1F)
    node.until(0x400, 0x400, 9.0, "the target is reached")
    ctx.run_for(0.05)
    node.shows(0x6064, 1000, "C402-167", within=1)
    true_mm = float(ctx.trace()[f"{DRIVE}.position"].values[-1]) * 1000.0
    node.equal("true position, mm", true_mm, 1000 / 500 * 3 * 10, "C402-236", within=0.08)
