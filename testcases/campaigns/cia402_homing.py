"""Homing methods of a CiA 402 drive with all their edges: every method of the profile and those of hard stops
from every side, with the speeds of each phase; what a drive can do differently, and how a search fails.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, Final

import numpy as np

from fieldbus.canopen import NmtCommand
from hil.bench import BenchFile
from hil.campaign import Campaign, CaseContext
from hil.expect import happens, never_happens
from hil.record import event
from testcases.campaigns._led_servo import BENCH as LED
from testcases.campaigns._led_servo import DRIVE, REV, Node
from testcases.campaigns.cia402_modes import CAM, HYSTERESIS, INDEX, NLS, PLS

_HERE: Final = "testcases.campaigns.cia402_homing"
LEFT_STOP, RIGHT_STOP = -52.0, 70.0
EDGE: Final = 6.0
"""Edge of a home switch that is active up to one end of the travel."""


def _bench(name: str, *, home: str = "", homing: str = "") -> BenchFile:
    text = LED.text.replace('name = "led servo"', f'name = "{name}"')
    stops = f"negative_stop_mm = {LEFT_STOP}\npositive_stop_mm = {RIGHT_STOP}\n"
    text = text.replace("coulomb_friction_n", stops + "coulomb_friction_n")
    if home:
        text = text.replace("home_from_mm = -30.0\nhome_to_mm = -12.5\n", home)
    return BenchFile(name, text + homing)


PLAIN: Final = _bench("homing servo")
RIGHT: Final = _bench("home switch to the right", home=f"home_from_mm = {EDGE}\n")
"""The home switch is active from its edge on."""
BELOW: Final = _bench("home switch to the left", home=f"home_to_mm = {EDGE}\n")
OTHER: Final = _bench(
    "other homing",
    homing='[drive.drive1.homing]\noffset = "vendor"\nmove = "zero"\n'
    'hard_stop_methods = { "-1" = "negative_index", "-2" = "positive", "-3" = "unsupported" }\n',
)
BLIND: Final = _bench("homing without a home switch", home="home_mm = 900.0\n")


def _campaign(name: str, bench: str) -> Campaign:
    return Campaign(name, controller="", tags=("drive", "cia402", "homing"), bench=f"{_HERE}:{bench}")


CAMPAIGN: Final = _campaign("cia402 homing", "PLAIN")
TO_THE_RIGHT: Final = _campaign("cia402 homing, switch to the right", "RIGHT")
TO_THE_LEFT: Final = _campaign("cia402 homing, switch to the left", "BELOW")
OF_OTHERS: Final = _campaign("cia402 homing of other makes", "OTHER")

FAST, SLOW = 1200, 150
"""Speeds of 6099h, rpm."""
MM_S: Final = 10.0 / 60.0
"""mm/s of 1 rpm."""
ACCELERATION: Final = 60_000
"""609Ah, rpm/s."""
START: Final = 0x10


class Homed(Node):
    """A drive that is homed from a place.

    Args:
        ctx: The case.

    """

    def __init__(self, ctx: CaseContext) -> None:
        super().__init__(ctx)
        self.ctx = ctx
        self.configure(
            {(0x6099, 1): FAST * 1000, (0x6099, 2): SLOW * 1000, 0x609A: ACCELERATION * 1000}
            | {0x6081: 2_900_000, 0x6083: 200_000_000, 0x6084: 200_000_000, 0x6065: 0x7FFFFFFF}
        )
        self.begun = 0.0

    def until(self, mask: int, value: int, limit_s: float, text: str) -> float:
        """Wait until bits of the status word have a value, as the drive has them; return how long, s.

        Raises:
            ExpectationFailedError: It did not happen in time.

        """
        begun = self.ctx.now_s
        drive: Any = self.ctx.bench.drive(DRIVE)
        self.ctx.wait_until(lambda: drive.peek(0x6041) & mask == value, limit_s, text)
        return self.ctx.now_s - begun

    def last(self, column: str) -> float:
        """Return the latest sample of the drive."""
        return float(self.ctx.trace()[f"{DRIVE}.{column}"].values[-1])

    @property
    def place(self) -> float:
        """Place of the machine, mm."""
        return self.last("position") * 1000.0

    def go(self, mm: float) -> None:
        """Bring the machine to a place."""
        self.control(0x06)
        self.enable(1)
        self.write(0x607A, round(self.read(0x6064) + (mm - self.place) / 10.0 * REV))
        self.control(0x1F)
        self.until(0x400, 0x400, 2.0, f"the machine is at {mm:g} mm")
        self.control(0x06)

    def start(self, method: int) -> None:
        """Begin to home."""
        self.control(0x06)
        self.write(0x6098, method)
        self.enable(6)
        self.bits(0x3400, 0x400, "C402-135")
        self.begun = self.ctx.now_s
        self.control(0x0F | START, 0.004)

    def run(self, method: int, limit_s: float = 4.0) -> None:
        """Home, and let the machine come to rest."""
        self.start(method)
        if self.ctx.now_s:
            self.ctx.do(f"method {method}")
        self.until(0x1400, 0x1400, limit_s, f"method {method} has ended")
        self.bits(0x2000, 0, "C402-135")
        self.ctx.run_for(0.02)

    def greatest(self) -> float:
        """Return the greatest speed since the beginning, rpm."""
        trace = self.ctx.trace()[f"{DRIVE}.motor_speed"].between(self.begun, self.ctx.now_s)
        return float(np.max(np.abs(trace.values)))

    def home(self) -> float:
        """Return the place of the position 0, mm."""
        return self.place - self.read(0x6064) / REV * 10.0


def mark(place: float, direction: int) -> float:
    """Return the first zero mark behind a place in a direction, mm."""
    turns = (place - INDEX) / 10.0
    return 10.0 * (math.floor(turns) + 1 if direction > 0 else math.ceil(turns) - 1) + INDEX


ON_CAM, LEFT, BESIDE = -20.0, -37.0, 20.0
LEFT_SIDE, RIGHT_SIDE = "from the left", "from the right"
CAMS: Final[dict[int, tuple[float, int]]] = {
    7: (CAM[0] - HYSTERESIS, -1),
    8: (CAM[0], 1),
    9: (CAM[1], -1),
    10: (CAM[1] + HYSTERESIS, 1),
    11: (CAM[1] + HYSTERESIS, 1),
    12: (CAM[1], -1),
    13: (CAM[0], 1),
    14: (CAM[0] - HYSTERESIS, -1),
}
"""Home edge of a method with a cam, and the direction in which it is passed."""


DIRECT: Final = {
    **dict.fromkeys((4, 6), "from beside it"),
    **dict.fromkeys((8, 13), LEFT_SIDE),
    **dict.fromkeys((9, 12), RIGHT_SIDE),
}
"""Where the first edge that a method meets is its home edge, so that it is passed fast."""


def judged(node: Homed, method: int, edge: float, direction: int, *, fast: bool | None, of: str) -> None:
    """Expect the place, the speeds, and that it has come to rest.

    Args:
        node: The drive.
        method: 1 to 30.
        edge: Home edge, mm.
        direction: In which it is passed.
        fast: It has searched fast, or slowly all the way; None: either.
        of: Where it began.

    """
    name, index = f"method {method} {of}", method < 16
    direct = DIRECT.get(method % 16) == of
    place = mark(edge, direction) if index else edge
    # A switch is read in every servo cycle.
    within = 0.006 if index else 0.06 if direct else 0.01
    node.equal(f"{name}: home, mm", node.home(), place, "C402-139", within=within)
    if fast is not None:
        wanted = FAST if fast else SLOW
        node.equal(
            f"{name}: greatest speed, rpm", node.greatest(), wanted, "C402-133", within=0.02 * wanted + 4
        )
    if not (direct and index):
        last = FAST if direct else SLOW
        rest = 0.5 * last * last / ACCELERATION / 60.0 * 10.0
        beyond = direction * (node.place - place)
        node.equal(f"{name}: rest behind it, mm", beyond, rest, "C402-133", within=0.05 + 0.03 * rest)
    node.equal(f"{name}: it stands", node.last("motor_speed"), 0.0, within=2.0)


@CAMPAIGN.product(
    "cam/{method}",
    parameters={"method": (*CAMS, *(method + 16 for method in CAMS))},
    title="method {method} from both sides and from the cam",
    requirements=("C402-133", "C402-135", "C402-139"),
)
def cam(ctx: CaseContext, method: int) -> None:
    """The edge of the method, whatever side the search begins on, with the speeds of its phases."""
    node = Homed(ctx)
    base = method if method < 16 else method - 16
    edge, direction = CAMS[base]
    for of, start in ((LEFT_SIDE, LEFT), ("from the cam", ON_CAM), (RIGHT_SIDE, BESIDE)):
        node.go(start)
        node.run(method)
        # Who stands on the cam and leaves it across the home edge does so slowly from the start.
        inside = base in (7, 10, 11, 14)
        judged(node, method, edge, direction, fast=of != "from the cam" or not inside, of=of)
    ctx.expect(never_happens(event("drive.fault", DRIVE)))


@CAMPAIGN.product(
    "limit/{method}",
    parameters={"method": (1, 2, 17, 18)},
    title="method {method} from the travel and from the switch",
    requirements=("C402-133", "C402-136", "C402-139"),
)
def limit(ctx: CaseContext, method: int) -> None:
    """The limit switch is the reference; who stands on it leaves it slowly."""
    node = Homed(ctx)
    left = method in (1, 17)
    edge, direction = (NLS + HYSTERESIS, 1) if left else (PLS - HYSTERESIS, -1)
    node.go(-35.0 if left else 50.0)
    node.run(method)
    judged(node, method, edge, direction, fast=True, of="from the travel")
    node.go(-44.0 if left else 60.0)
    ctx.run_for(0.02)
    node.run(method | 16)
    judged(node, method | 16, edge, direction, fast=None, of="from near the switch")
    ctx.expect(never_happens(event("drive.fault", DRIVE)))


SIDES: Final = {3: (EDGE - HYSTERESIS, -1), 4: (EDGE, 1), 5: (EDGE + HYSTERESIS, 1), 6: (EDGE, -1)}
"""Home edge of a method with a switch up to one end of the travel."""


def side(ctx: CaseContext, method: int) -> None:
    """A switch that is active up to the end of the travel tells on which side the load is."""
    node = Homed(ctx)
    base = method if method < 16 else method - 16
    edge, direction = SIDES[base]
    for start in (EDGE - 12.0, EDGE + 12.0):
        node.go(start)
        active = (start > EDGE) == (base < 5)
        node.run(method)
        # Methods 3 and 5 leave the switch across the home edge: slowly, if they stand on it.
        fast = not (base in (3, 5) and active)
        of = "from the switch" if active else "from beside it"
        judged(node, method, edge, direction, fast=fast, of=of)
    ctx.expect(never_happens(event("drive.fault", DRIVE)))


for _campaign_of, _bases in ((TO_THE_RIGHT, (3, 4)), (TO_THE_LEFT, (5, 6))):
    _campaign_of.product(
        "side/{method}",
        parameters={"method": (*_bases, *(base + 16 for base in _bases))},
        title="method {method} from both sides of the edge",
        requirements=("C402-133", "C402-136", "C402-139"),
    )(side)


@CAMPAIGN.case("index-and-here", requirements=("C402-126", "C402-127", "C402-129", "C402-139"))
def index_and_here(ctx: CaseContext) -> None:
    """33 and 34 find the next zero mark, slowly; 35 and 37 take the place as it is, with offset."""
    node = Homed(ctx)
    for method, direction in ((33, -1), (34, 1)):
        begun = node.place
        node.run(method)
        place = mark(begun, direction)
        node.equal(f"method {method}: home, mm", node.home(), place, "C402-139", within=0.006)
        node.equal(f"method {method}: speed, rpm", node.greatest(), SLOW, "C402-133", within=4)
    for method in (35, 37):
        for offset in (0, 1234, -777):
            node.write(0x607C, offset)
            node.run(method)
            node.shows(0x6064, -offset, "C402-138")
            node.shows(0x6062, -offset, "C402-138")
            node.equal("it has not moved", node.greatest(), 0, within=1)


# -- hard stops ---------------------------------------------------------------------------------------------

THRESHOLD: Final = 200
"""2010h:1, permille of the rated torque."""
RETRACTION: Final = 1500
"""2010h:3, increments."""


@CAMPAIGN.product(
    "hard-stop/{method}",
    parameters={"method": (-1, -2, -3, -4)},
    title="method {method}, at a hard stop",
    requirements=("C402-131", "C402-132", "C402-135"),
)
def hard_stop(ctx: CaseContext, method: int) -> None:
    """It presses with the threshold and no more for the detection time; home is there, a way back from it, or
    the first zero mark on the way back.
    """
    node = Homed(ctx)
    right = method in (-1, -3)
    sign, stop = (1, RIGHT_STOP) if right else (-1, LEFT_STOP)
    node.configure({(0x2010, 1): THRESHOLD, (0x2010, 2): 60, (0x2010, 3): 0})
    # The limit switches stand in front of the stops; they mean nothing to these methods.
    for number, retraction in enumerate((0, RETRACTION) if method < -2 else (0,)):
        node.write(0x2010, retraction, 3)
        node.go(stop - sign * 24.0)
        ctx.run_for(0.02)
        node.run(method, 6.0)
        trace = ctx.trace()
        rated = float(node.read(0x6076)) / 1000.0
        speed, torques = (
            trace[f"{DRIVE}.{name}"].between(node.begun, ctx.now_s) for name in ("motor_speed", "torque")
        )
        held = (np.abs(speed.values) < 2.0) & (sign * torques.values > 0.99 * THRESHOLD / 1000 * rated)
        pressed = float(np.sum(held)) * float(np.median(np.diff(speed.time_s)))
        greatest = float(np.max(np.abs(torques.values[: int(np.max(np.flatnonzero(held)))])))
        node.equal("greatest torque, Nm", greatest, THRESHOLD / 1000 * rated, "C402-131", within=1e-3)
        node.equal("time at the stop, s", pressed, 0.06, "C402-131", within=0.012)
        greatest = float(np.max(np.abs(speed.values)))
        node.equal("greatest speed, rpm", greatest, SLOW, "C402-131", within=6)
        place = stop - sign * retraction / REV * 10.0
        if method >= -2:
            place = mark(stop, -sign)
        node.equal(f"{number}: home, mm", node.home(), place, "C402-131", within=0.03)
        node.control(0x06)
    # Afterwards the torque is that of the drive again.
    node.enable(10)
    node.write(0x6071, -sign * 700)
    ctx.run_for(0.03)
    node.equal("torque afterwards, permille", node.read(0x6077), -sign * 700, within=30)
    node.control(0x00)


@OF_OTHERS.case("methods", requirements=("C402-131", "C402-132", "C402-138"))
def other_methods(ctx: CaseContext) -> None:
    """What a make does differently: stops of other numbers, the offset with the other sign, and a drive that
    goes to zero.
    """
    node = Homed(ctx)
    node.configure({(0x2010, 1): THRESHOLD, (0x2010, 2): 30})
    node.refuses(0x6098, -3, 0x06090030, "C402-141")
    for method, start, stop, zero in (
        (-1, LEFT_STOP + 20.0, LEFT_STOP, True),
        (-2, RIGHT_STOP - 20.0, RIGHT_STOP, False),
        (-4, LEFT_STOP + 20.0, LEFT_STOP, False),
    ):
        offset = 900 if stop > 0 else -900
        node.write(0x607C, offset)
        node.go(start)
        node.start(method)
        node.until(0x1000, 0x1000, 6.0, "home is known")
        node.bits(0x2400, 0, "C402-135")
        home = mark(stop, 1 if stop < 0 else -1) if zero else stop
        node.until(0x400, 0x400, 4.0, "it has gone to zero")
        ctx.run_for(0.03)
        node.bits(0x3400, 0x1400, "C402-135")
        # The home point has +607Ch: zero lies so far before it, and there the drive goes if it can.
        node.shows(0x6064, 0, "C402-138", within=2)
        node.equal(
            f"method {method}: zero, mm", node.place, home - offset / REV * 10.0, "C402-138", within=0.05
        )
        node.control(0x00)
        ctx.run_for(0.01)
    node.go(10.0)
    node.write(0x607C, 900)
    for method in (35, 37):
        before = node.place
        node.run(method)
        node.equal("gone to zero, mm", node.place - before, -900 / REV * 10.0, "C402-138", within=0.02)
        node.equal("slowly, rpm", node.greatest(), SLOW, "C402-138", within=4)


# -- interrupted, failed ------------------------------------------------------------------------------------


@CAMPAIGN.product(
    "interrupted/{phase}",
    parameters=[
        {"phase": "switch", "method": 7, "start": BESIDE, "after": 0.1},
        {"phase": "index", "method": 34, "start": 3.0, "after": 0.05},
        {"phase": "stop", "method": -3, "start": 50.0, "after": 0.1},
    ],
    title="a search for the {phase} is interrupted, halted and goes on",
    requirements=("C402-076", "C402-134", "C402-135"),
)
def interrupted(ctx: CaseContext, phase: str, method: int, start: float, after: float) -> None:
    """Bit 4 and halt stop it with 609Ah and 605Dh; without the halt it searches on, and a new edge starts it
    again.
    """
    del phase
    node = Homed(ctx)
    node.configure({(0x2010, 1): THRESHOLD, 0x6085: 30_000_000, 0x605D: 2})
    node.go(start)
    node.start(method)
    ctx.run_for(after)
    node.bits(0x3400, 0, "C402-135")
    speed = node.last("motor_speed")
    node.control(0x0F, 0.0)
    begun = ctx.now_s
    ctx.run_for(abs(speed) / ACCELERATION + 0.02)
    node.bits(0x3400, 0x400, "C402-135")
    node.equal("it stands, rpm", node.last("motor_speed"), 0.0, "C402-134", within=2)
    _braked(ctx, node, begun, speed, ACCELERATION, "C402-134")
    node.control(0x0F | START, after)
    speed = node.last("motor_speed")
    node.equal("it searches again", abs(speed) > 100, 1, "C402-134")
    begun = ctx.now_s
    node.control(0x10F | START, abs(speed) / 30_000 + (0.02 if method > 0 else 0.08))
    node.bits(0x3400, 0x400, "C402-076")
    if method > 0:  # against a stop the threshold limits the torque of the halt, too
        _braked(ctx, node, begun, speed, 30_000, "C402-076")
    node.control(0x10F, 0.01)
    node.control(0x10F | START, 0.03)
    node.equal("no start in a halt, rpm", node.last("motor_speed"), 0.0, "C402-076", within=2)
    node.control(0x0F, 0.01)
    node.control(0x0F | START, 0.01)
    node.until(0x1400, 0x1400, 6.0, "it has ended")
    node.control(0x10F | START, 0.02)
    node.control(0x0F | START, 0.02)
    node.bits(0x3400, 0x1400, "C402-076")
    ctx.expect(never_happens(event("drive.fault", DRIVE)))


def _braked(ctx: CaseContext, node: Homed, begun: float, speed: float, slope: float, *ids: str) -> None:
    trace = ctx.trace()[f"{DRIVE}.motor_speed"].between(begun, ctx.now_s)
    moving = trace.time_s[np.abs(trace.values) > 0.1 * abs(speed)]
    took = float(moving[-1]) - begun if len(moving) else 0.0
    node.equal("braking time, s", took, 0.9 * abs(speed) / slope, *ids, within=0.004)


def _both_limits(ctx: CaseContext, node: Homed) -> None:
    del node
    for name in ("negative_limit", "positive_limit"):
        ctx.inject("switch.stuck", DRIVE, input=name, state=True)


def _wrong_limit(ctx: CaseContext, node: Homed) -> None:
    del node
    ctx.run_for(0.05)
    ctx.inject("switch.stuck", DRIVE, input="negative_limit", state=True)


def _one_after_the_other(ctx: CaseContext, node: Homed) -> None:
    ctx.inject("switch.stuck", DRIVE, input="home", state=False)
    del node


Prepare = Callable[[CaseContext, Homed], object]
FAILS: Final[dict[str, dict[str, Any]]] = {
    "both-limits": {"method": 8, "start": 0.0, "first": _both_limits},
    "limit-behind": {"method": 8, "start": 0.0, "then": _wrong_limit},
    "no-cam": {"method": 10, "start": 0.0, "first": _one_after_the_other, "limit": 4.0},
    "no-cam-left": {"method": 14, "start": -35.0, "first": _one_after_the_other, "limit": 4.0},
    "no-threshold": {"method": -3, "start": 0.0, "objects": {(0x2010, 1): 0}},
    "slow-is-0": {"method": 8, "start": 0.0, "objects": {(0x6099, 2): 0}},
    "fast-is-0": {"method": 8, "start": 0.0, "objects": {(0x6099, 1): 0}},
    "zero": {"method": 0, "start": 0.0, "emcy": False},
    "end-stop": {
        "method": 34,
        "start": 0.0,
        "objects": {(0x2010, 2): 20},
        "then": lambda ctx, _: ctx.inject("mechanics.jam", DRIVE),
    },
}


@CAMPAIGN.product(
    "fails/{why}",
    parameters={"why": tuple(FAILS)},
    title="a search fails: {why}",
    requirements=("C402-135", "C402-136", "C402-137"),
)
def fails(ctx: CaseContext, why: str) -> None:
    """Bit 13, EMCY 8612h, and a stop with 609Ah; the next success takes it all back."""
    row = FAILS[why]
    node = Homed(ctx)
    node.go(row["start"])
    node.configure(row.get("objects", {}))
    if "first" in row:
        row["first"](ctx, node)
    node.start(row["method"])
    if "then" in row:
        row["then"](ctx, node)
    node.until(0x2400, 0x2400, row.get("limit", 2.0), "the search has failed")
    node.bits(0x1000, 0, "C402-136")
    ctx.run_for(0.005)
    node.equal("it stands, rpm", node.last("motor_speed"), 0.0, "C402-137", within=2)
    if row.get("emcy", True):
        ctx.expect(happens(event("emcy.raised", DRIVE, code=0x8612)).covers("C402-137"))
    node.control(0x0F)
    node.bits(0x2000, 0x2000, "C402-135")
    if why == "zero":
        node.control(0x00)
        node.run(37)
        node.bits(0x3400, 0x1400, "C402-135")


@CAMPAIGN.product(
    "within/{what}-{enough}",
    parameters={"what": ("time", "way"), "enough": (True, False)},
    title="a search within its {what}: {enough}",
    requirements=("C402-137",),
)
def within(ctx: CaseContext, what: str, enough: bool) -> None:
    """2010h:4 and 2010h:5 end a search that takes longer, and none that takes less."""
    node = Homed(ctx)
    node.go(BESIDE)
    node.run(24)
    took = ctx.now_s - 0.02 - node.begun
    node.go(BESIDE)
    way = abs(BESIDE - (CAM[0] - 1.0)) / 10.0 * REV
    share = 1.1 if enough else 0.9
    if what == "time":
        node.write(0x2010, round(took * 1000 * share), 4)
    else:
        node.write(0x2010, round(way * share * 0.95), 5)
    node.start(24)
    if enough:
        node.until(0x1400, 0x1400, 4.0, "it has ended")
    else:
        node.until(0x2000, 0x2000, 4.0, "it has failed")
        if what == "time":
            node.equal("time-out, s", ctx.now_s - node.begun, took * share, "C402-137", within=0.01)


@CAMPAIGN.case("after-reset", requirements=("C402-133",))
def after_reset(ctx: CaseContext) -> None:
    """A search that was cut off by a node reset leaves nothing: neither bits nor limits of the torque."""
    node = Homed(ctx)
    node.configure({(0x2010, 1): THRESHOLD})
    node.go(40.0)
    node.start(-3)
    ctx.run_for(0.1)
    node.nmt(NmtCommand.RESET_NODE)
    ctx.run_for(0.1)
    node = Homed(ctx)
    node.bits(0x3400, 0)
    node.enable(10)
    node.write(0x6071, -500)
    ctx.run_for(0.02)
    node.equal("torque, permille", node.read(0x6077), -500, within=30)
    node.control(0x00)
