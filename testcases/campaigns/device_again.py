"""Drives led object by object: what they do once, they do again, after any resets and faults; and to the
other side they do the same with the other sign.

Nothing is said about what is right. Runs of one program are compared sample by sample and object by object:
what a drive keeps from the past, has only from its start, or does to one side only, shows as a difference.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from fieldbus.canopen import NmtCommand
from fieldbus.profidrive.words import POS_STW1, STW1
from hil.bench import BenchFile
from hil.campaign import Campaign, CaseContext
from testcases.campaigns._led_servo import DRIVE, NODE, Node
from testcases.campaigns._readout import Readout, devices
from testcases.campaigns.profidrive_positioner import GO, READY, RELATIVE, SETUP, Axis
from testcases.campaigns.profidrive_speed import OFF, RUN
from testcases.campaigns.profidrive_speed import Led as Speed

REV: Final = 1 << 16
"""Increments per revolution of the motor, and per 10 mm of the slide."""
UNIT: Final = REV // 4000
"""Increments in 2.5 um, in which the ways of the programs are."""
BENCH: Final = BenchFile(
    "symmetric servo",
    f"""
[bench]
name = "symmetric servo"
kind = "virtual"
cycle_ms = 4

[segment.can0]
bitrate = 1_000_000

[drive.{DRIVE}]
segment = "can0"
node_id = {NODE}
increments_per_revolution = {REV}
heartbeat_ms = 0

[drive.{DRIVE}.mechanics]
coulomb_friction_n = 40.0
viscous_friction_n_per_m_s = 150.0

[drive.{DRIVE}.switches]
home_from_mm = 80.0
home_to_mm = 90.0
negative_limit_mm = -95.0
positive_limit_mm = 95.0
""",
)
CAMPAIGN: Final = Campaign(
    "device again", controller="", tags=("drive",), bench="testcases.campaigns.device_again:BENCH"
)
GRID_S: Final = 0.02
"""Runs begin at multiples of this, so that all cycles of bench and drive have the same phase."""
CONTROL_NS, MIDDLE_NS = 1_000_000, 240_000
WAYS: Final = ("position", "encoder_increments")
"""Columns that count from where a run begins."""
Numbers = NDArray[np.float64]


@dataclass
class Run:
    """What a run has left behind."""

    columns: dict[str, Numbers]
    events: list[tuple[str, tuple[str, ...]]]
    readout: Readout


def record(
    ctx: CaseContext, drive: str, program: Callable[[], object], readout: Callable[[], Readout]
) -> Run:
    """Run a program and return what it has left in the trace and, at its end, in the objects."""
    ctx.run_for((-round(ctx.now_s * 1e9) % round(GRID_S * 1e9)) * 1e-9)
    begin = ctx.now_s
    program()
    end = ctx.now_s
    trace = ctx.trace()
    group = next(one for one in trace.groups if one.name == drive)
    columns = {}
    for name, _ in group.columns:
        values = trace[f"{drive}.{name}"].between(begin - 1e-9, end - 1e-9).values
        columns[name] = values - values[0] if name in WAYS else values
    events = [
        (one.kind, tuple(f"{key}={value}" for key, value in one.data.items() if key not in _OF_PLACE))
        for one in trace.events
        if one.source == drive and begin - 1e-9 <= one.time_ns * 1e-9 < end - 1e-9
    ]
    return Run(columns, events, readout())


_OF_PLACE: Final = ("position_pu", "at_ns", "time", "injection")


# -- the CiA 402 drive -------------------------------------------------------------------------------------

SLOW, FAST = 170, 430
"""Speeds, rpm; no two quantities of a program are alike."""
TORQUE: Final = 90
"""Per mille of the rated torque."""


class Led(Node):
    """The drive, led object by object."""

    def download(self, index: int, sub: int, data: bytes, *, block: bool | None = None) -> int:
        """Write bytes, in the middle of a control cycle, whatever the frames before have taken."""
        self._ctx.run_for((MIDDLE_NS - round(self._ctx.now_s * 1e9)) % CONTROL_NS * 1e-9)
        return super().download(index, sub, data, block=block)

    def trip(self, code: int) -> None:
        """Let the drive trip."""
        self._ctx.inject("drive.fault", DRIVE, code=code)


def begin(ctx: CaseContext) -> Led:
    """Return the drive with slopes and limits that are not alike."""
    node = Led(ctx)
    node.configure({0x60FF: 0, 0x6071: 0, 0x6042: 0})
    node.configure({0x6081: 600_000, 0x6083: 3_100_000, 0x6084: 2_300_000, 0x6085: 9_000_000, 0x6087: 700})
    node.configure({(0x6048, 1): 3100, (0x6049, 1): 2300, (0x604A, 1): 9000})
    node.configure({0x6065: 0x7FFFFFFF, 0x6067: 25 * UNIT, 0x6068: 6, 0x60E0: 1500, 0x60E1: 1500})
    node.configure({0x606D: 9000, 0x606E: 5, 0x606F: 30_000, 0x6070: 4})
    return node


def _velocity(node: Led, sign: int) -> None:
    """In pv up, over, through zero, halted and let go."""
    node.enable(3)
    for speed, wait_s, word in (
        (FAST, 0.09, 0x0F),
        (SLOW, 0.05, 0x0F),
        (-SLOW, 0.14, 0x0F),
        (-SLOW, 0.05, 0x10F),
        (-SLOW, 0.05, 0x0F),
    ):
        node.write(0x60FF, sign * speed * 1000)
        node.control(word, wait_s)
    node.control(0x02, 0.06)


def _velocity_mode(node: Led, sign: int) -> None:
    """In vl up, with a frozen ramp, down, and off with the shutdown."""
    node.enable(2)
    node.write(0x6042, sign * FAST)
    for word, wait_s in ((0x7F, 0.06), (0x5F, 0.03), (0x7F, 0.05), (0x3F, 0.05), (0x7F, 0.02), (0x06, 0.1)):
        node.control(word, wait_s)


def _positions(node: Led, sign: int) -> None:
    """In pp a set-point that waits, one that takes over at once, a relative one, and a halt on the way."""
    node.enable(1)
    for target, word, wait_s in (
        (700, 0x1F, 0.03),
        (1900, 0x1F, 0.03),
        (-300, 0x3F, 0.1),
        (-450, 0x7F, 0.06),
        (900, 0x1F, 0.08),
        (0, 0x11F, 0.04),
        (0, 0x1F, 0.25),
    ):
        node.write(0x607A, sign * target * UNIT)
        node.control(word, wait_s)
        node.control(word & ~0x10)
    node.control(0x07)


def _torque(node: Led, sign: int) -> None:
    """In tq up and to the other side by the slope of 6087h."""
    node.enable(4)
    for torque, wait_s in ((TORQUE, 0.05), (-TORQUE, 0.09), (0, 0.1)):
        node.write(0x6071, sign * torque)
        node.control(0x0F, wait_s)
    node.control(0x0D, 0.05)


def _cyclic(node: Led, sign: int) -> None:
    """In csv and cst a few set-points with their offsets."""
    node.enable(9)
    for speed in (60, 90, 40, -30):
        node.write(0x60FF, sign * speed * 1000)
        node.write(0x60B1, sign * speed * 100)
        node.control(0x0F, 0.012)
    node.write(0x60B1, 0)
    node.write(0x60FF, 0)
    node.control(0x0F, 0.04)
    node.control(0x06, 0.02)
    node.enable(10)
    for torque in (40, -60, 20):
        node.write(0x6071, sign * torque)
        node.write(0x60B2, sign * 5)
        node.control(0x0F, 0.012)
    node.write(0x60B2, 0)
    node.write(0x6071, 0)
    node.control(0x0F, 0.03)
    node.control(0x00, 0.02)


def _cyclic_position(node: Led, sign: int) -> None:
    """In csp a few set-points with their offset."""
    base = node.read(0x6064)
    node.write(0x607A, base)
    node.enable(8)
    for way in (4, 11, 19, 9):
        node.write(0x607A, base + sign * way * UNIT)
        node.write(0x60B0, sign * 3 * UNIT)
        node.control(0x0F, 0.012)
    node.write(0x60B0, 0)
    node.control(0x0F, 0.05)
    node.control(0x06, 0.02)


def _interpolated(node: Led, sign: int) -> None:
    """In ip set-points out of the buffer."""
    node.configure({(0x60C4, 2): 16, (0x60C4, 3): 0})
    node.download(0x60C4, 6, b"\1")
    node.enable(7)
    base = node.read(0x6062)
    for way in (10, 30, 60, 80, 90):
        node.write(0x60C1, base + sign * way * UNIT, 1)
    node.control(0x1F, 0.06)
    node.control(0x0F, 0.02)
    node.download(0x60C4, 6, b"\0")


def _trip(node: Led, sign: int) -> None:
    """A fault at speed, and its reset."""
    node.enable(3)
    node.write(0x60FF, sign * FAST * 1000)
    node.control(0x0F, 0.08)
    node.trip(0x2310)
    node.control(0x0F, 0.12)
    node.control(0x80)
    node.control(0x00)


def _home(node: Led, sign: int) -> None:
    """Back to the place of the start."""
    del sign
    node.enable(1)
    node.write(0x607A, 0)
    node.control(0x1F, 0.0)
    node.until(0x400, 0x400, 3.0, "the drive is back")
    node.control(0x0F, 0.05)
    node.control(0x00, 0.02)


PROGRAMS: Final[dict[str, Callable[[Led, int], None]]] = {
    "velocity": _velocity,
    "vl": _velocity_mode,
    "positions": _positions,
    "torque": _torque,
    "cyclic": _cyclic,
    "csp": _cyclic_position,
    "interpolated": _interpolated,
    "trip": _trip,
}


# -- comparisons -------------------------------------------------------------------------------------------

WITH_DIRECTION: Final = ("drive_zsw1", "drive_meldw")
"""Words with a bit that shows the direction."""
SIGNED: Final = (
    *WAYS,
    "velocity",
    "motor_speed",
    "torque",
    "torque_demand",
    "velocity_demand",
    "following_error",
    "nsoll",
)
"""Columns that change their sign on the other side."""
ROUNDING: Final = 2e-3
"""Share of the greatest value by which two runs may differ: they do not begin at quite the same place."""
COUNTS: Final = ("encoder_increments", "following_error")
"""Columns that may differ by two increments."""
SET_FIRST: Final = ("mode",)
"""Columns that a program sets before anything else: what they show at its beginning is of the time before."""


COUNTERS: Final = ("drive_stw2", "drive_zsw2")
"""Words whose highest four bits are a sign of life."""


def differences(first: Run, second: Run, *, mirrored: bool = False) -> list[str]:
    """Return in which columns, events and objects two runs differ."""
    found = []
    for name in first.columns:
        values, other = first.columns[name], second.columns[name]
        if name in COUNTERS:
            values, other = values % 0x1000, other % 0x1000
        if mirrored and name in WITH_DIRECTION:
            continue
        if mirrored and name in SIGNED:
            other = -other
        count = min(len(values), len(other))
        if abs(len(values) - len(other)) > 1:
            found.append(f"{name} has {len(other)} samples, not {len(values)}")
        bound = ROUNDING * float(np.max(np.abs(values), initial=0.0)) + (2.0 if name in COUNTS else 1e-9)
        off = np.abs(values[:count] - other[:count])
        if name in SET_FIRST:
            off[:2] = 0.0
        at = int(np.argmax(off)) if count else 0
        if count and off[at] > bound:
            found.append(f"{name} is {other[at]:.6g}, not {values[at]:.6g}, in sample {at}")
    if not mirrored:
        told = [[one for one in run.events if not one[0].startswith("fault.")] for run in (first, second)]
        where = next((one for one, pair in enumerate(zip(*told, strict=False)) if pair[0] != pair[1]), -1)
        if where < 0 and len(told[0]) != len(told[1]):
            where = min(map(len, told))
        if where >= 0:
            found.append(f"event {where} is {[one[where] if where < len(one) else None for one in told]}")
        found += [
            f"{place[0]:04X}h:{place[1]} is {second.readout[place]!r}, not {content!r}"
            for place, content in first.readout.items()
            if place[0] not in ELSEWHERE and second.readout[place] != content
        ]
    return found


ELSEWHERE: Final = (
    *(0x2101, 0x2102),
    *(0x1003, 0x1013, 0x2103, 0x2104, 0x2105, 0x2106, 0x2108),
    *(0x6062, 0x6063, 0x6064, 0x607A, 0x60C1, 0x60E4, 0x60FC),
)
"""Objects with heat, times and histories of faults, and positions, which the trace has."""


@CAMPAIGN.product(
    "servo/{program}",
    parameters={"program": tuple(PROGRAMS)},
    title="a CiA 402 drive, {program}: again, to the other side, after resets",
    requirements=("C301-018",),
)
def servo(ctx: CaseContext, program: str) -> None:
    """A program straight after power-on, once more, mirrored, after other motions and a power cycle, and
    after a node reset.
    """
    ctx.run_for(0.08)
    (device,) = devices(ctx)

    def once(sign: int) -> Run:
        node = begin(ctx)
        run = record(ctx, DRIVE, lambda: PROGRAMS[program](node, sign), device.readout)
        _home(node, 1)
        return run

    first = once(1)
    device.none("again", differences(first, once(1)))
    if program != "csp":  # around a target its limit of the deceleration acts on differences of an increment
        device.none("to the other side", differences(first, once(-1), mirrored=True))
    node = begin(ctx)
    for other in PROGRAMS.values():
        other(node, 1)
    _home(node, 1)
    device.off_and_on()
    device.none("after other motions and a power cycle", differences(first, once(1)), "C301-018")
    device.nmt(NmtCommand.RESET_NODE)
    ctx.run_for(0.1)
    device.none("after a node reset", differences(first, once(1)), "C301-018")


# -- PROFIdrive drives -------------------------------------------------------------------------------------

OF_SPEED: Final = Campaign(
    "device again, telegram 105",
    controller="",
    tags=("telegram",),
    bench="testcases.campaigns.profidrive_speed:BENCH",
)
OF_TASKS: Final = Campaign(
    "device again, telegram 111",
    controller="",
    tags=("telegram", "positioner"),
    bench="testcases.campaigns.profidrive_positioner:BENCH",
)
NO_RELEASE, NO_SETPOINT, NO_RAMP = RUN & ~0x20, RUN & ~0x40, RUN & ~0x10
STEPS: Final[dict[str, tuple[tuple[int, float, int], ...]]] = {
    "ramps": (
        (RUN, 1100, 30),
        (RUN, -430, 45),
        (NO_RELEASE, 900, 10),
        (RUN, 900, 25),
        (NO_SETPOINT, 900, 30),
    ),
    "ramp-off": ((RUN, 700, 25), (NO_RAMP, 700, 15), (RUN, 300, 25), (OFF, 300, 60)),
    "off": ((RUN, 900, 30), (OFF, 900, 20), (RUN, 400, 30), (RUN & ~2, 400, 20), (OFF, 0, 60)),
    "quick": ((RUN, 800, 30), (RUN & ~4, 800, 15), (RUN, 800, 30), (OFF, 0, 60)),
    "inhibited": ((RUN, 600, 25), (RUN & ~8, 600, 20), (RUN, 600, 40), (RUN & ~0x400, 100, 15)),
}
"""STW1, speed in rpm, and how many cycles of 4 ms, step by step."""


@OF_SPEED.product(
    "{program}",
    parameters={"program": tuple(STEPS)},
    title="a PROFIdrive drive, {program}: again, to the other side, after a power cycle",
)
def words(ctx: CaseContext, program: str) -> None:
    """Control words and speeds straight after the start, once more, mirrored, and after a trip and a power
    cycle.
    """
    led = Speed(ctx, on=False)

    def once(sign: int) -> Run:
        led.send("OFF1, acknowledged", 0.1, STW1=OFF | 0x80, NSOLL_B=0)
        led.send("OFF1", 0.1, STW1=OFF)
        led.send("ON", 0.2, STW1=RUN)

        def steps() -> None:
            for word, rpm, cycles in STEPS[program]:
                led.turn(sign * rpm, cycles * 0.004, STW1=word)

        run = record(ctx, DRIVE, steps, dict)
        led.send("OFF1", 1.0, STW1=OFF, NSOLL_B=0)
        return run

    first = once(1)
    _none(ctx, "again", differences(first, once(1)))
    _none(ctx, "to the other side", differences(first, once(-1), mirrored=True))
    led.send("ON", 0.2, STW1=RUN)
    led.turn(500.0, 0.2)
    ctx.inject("drive.fault", DRIVE, code=30001)
    ctx.run_for(0.5)
    _none(ctx, "after a trip", differences(first, once(1)))
    _off_and_on(ctx)
    _none(ctx, "after a power cycle", differences(first, once(1)))


def _none(ctx: CaseContext, what: str, found: list[str]) -> None:
    ctx.measure(f"{what}: {'; '.join(found[:6]) or 'all right'}", len(found), low=0, high=0)


def _off_and_on(ctx: CaseContext) -> None:
    off = ctx.inject("drive.power_off", DRIVE)
    ctx.run_for(0.2)
    off.remove()
    ctx.run_for(1.5)


BACKWARDS: Final = int(POS_STW1.POSITIVE | POS_STW1.NEGATIVE)
TASKS: Final[dict[str, tuple[dict[str, int], ...]]] = {
    "relative": (
        {"POS_STW1": RELATIVE, "MDI_TARPOS": 2300, "MDI_VELOCITY": 7000},
        {"POS_STW1": RELATIVE, "MDI_TARPOS": -3100, "MDI_VELOCITY": 4100, "OVERRIDE": 0x3000},
        {"POS_STW1": RELATIVE, "MDI_TARPOS": 800, "MDI_ACC": 0x2000, "MDI_DEC": 0x1800},
    ),
    "set-up": (
        {"POS_STW1": SETUP | POS_STW1.POSITIVE, "MDI_VELOCITY": 3000, "MDI_TARPOS": 0},
        {"POS_STW1": SETUP | POS_STW1.POSITIVE, "MDI_VELOCITY": 1400, "MDI_TARPOS": 0},
    ),
}
"""Words of tasks, one after the other; MDI_TARPOS is mirrored."""


@OF_TASKS.product(
    "{program}",
    parameters={"program": tuple(TASKS)},
    title="a positioner, {program}: again, to the other side, after a power cycle",
)
def tasks(ctx: CaseContext, program: str) -> None:
    """Tasks straight after the start, once more, mirrored, and after a stop on the way and a power cycle."""
    plain = {"OVERRIDE": 0x4000, "MDI_ACC": 0x4000, "MDI_DEC": 0x4000, "POS_STW1": 0}
    axis = Axis(ctx)

    def once(sign: int) -> Run:
        axis.send("OFF1", 0.1, STW1=READY & ~1, **plain)
        axis.send("ON", 0.3, STW1=READY)

        def all_tasks() -> None:
            for row in TASKS[program]:
                given = row | {"MDI_TARPOS": sign * row["MDI_TARPOS"]}
                if program == "set-up" and sign < 0:
                    given["POS_STW1"] ^= BACKWARDS
                axis.go(0.3, **given)
            axis.send("no task", 0.3, STW1=READY)
            axis.send("reject", 0.2, STW1=READY & ~int(STW1.NO_REJECT_TASK))

        run = record(ctx, DRIVE, all_tasks, dict)
        # The ways are relative: another start is another place with other switches.
        del run.columns["inputs"]
        run.events = [one for one in run.events if one[0] != "drive.inputs"]
        axis.send("OFF1", 0.5, STW1=READY & ~1)
        return run

    first = once(1)
    _none(ctx, "again", differences(first, once(1)))
    _none(ctx, "to the other side", differences(first, once(-1), mirrored=True))
    axis.send("ON", 0.3, STW1=READY, **plain)
    axis.go(0.1, POS_STW1=RELATIVE, MDI_TARPOS=3000)
    axis.send("intermediate stop", 0.2, STW1=GO & ~int(STW1.NO_INTERMEDIATE_STOP))
    axis.send("reject", 0.2, STW1=READY & ~int(STW1.NO_REJECT_TASK))
    _off_and_on(ctx)
    _none(ctx, "after a power cycle", differences(first, once(1)))
