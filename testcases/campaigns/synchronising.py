"""Synchronising: ways to a gear or cam and away from it by their formulas, shifts, what is added and
simulated, status variables, and every input that is refused.
"""

from __future__ import annotations

from collections.abc import Callable
from math import nan
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from hil.bench import BenchFile, load_bench
from hil.campaign import Campaign, CaseContext
from hil.expect import no_alarm
from testcases.campaigns._synchronous import BENCH, FOLLOWER, LEADER, Machine, machine
from testcases.campaigns.support import equal

Numbers = NDArray[np.float64]

_LIFT, _PERIOD = 20.0, 100.0
_STRAIGHT: Final = {"straight": {"interpolation": "linear", "points": [[-1000.0, -470.0], [1000.0, 470.0]]}}
OPEN: Final[BenchFile] = load_bench(BENCH).configured({"cam": _STRAIGHT})
"""The bench of synchronous operation with a cam of constant slope."""
_MODULO: Final = "Modulo."
ROUND: Final[BenchFile] = load_bench(BENCH).configured(
    {
        "cam": _STRAIGHT,
        "axis": {
            LEADER: {
                "variables": {
                    f"{_MODULO}Enable": True, f"{_MODULO}StartValue": -40.0, f"{_MODULO}Length": 150.0
                }
            },
            FOLLOWER: {
                "variables": {
                    f"{_MODULO}Enable": True, f"{_MODULO}StartValue": -30.0, f"{_MODULO}Length": 85.0
                }
            },
        },
    }
)  # fmt: skip
"""The same with modulo axes."""
_HERE: Final = "testcases.campaigns.synchronising"
CAMPAIGN: Final = Campaign("synchronising", tags=("synchronous",), bench=f"{_HERE}:OPEN")
TURNING: Final = Campaign("synchronising of modulo axes", tags=("synchronous",), bench=f"{_HERE}:ROUND")
_CYCLE_S: Final = 0.004
_SLOPE: Final = 0.47
_NEAR: Final = 1e-6
"""What a position may be off its formula, mm."""
_DYNAMICS: Final = {"Velocity": 210.0, "Acceleration": 900.0, "Deceleration": 600.0, "Jerk": 0.0}
_QUICK: Final = {"Acceleration": 1900.0, "Deceleration": 1700.0, "Jerk": 0.0}


# -- formulas ------------------------------------------------------------------------------------------------


def swing(x: float) -> tuple[float, float, float]:
    """Return the cam `swing` with its derivatives: polynomial 3-4-5 of VDI 2143, to and fro."""
    place, half = x % _PERIOD, _PERIOD / 2
    sign = 1.0 if place <= half else -1.0
    z = (place if place <= half else _PERIOD - place) / half
    return (
        _LIFT * z**3 * (10.0 - 15.0 * z + 6.0 * z**2),
        sign * _LIFT * 30.0 * z**2 * (1.0 - z) ** 2 / half,
        _LIFT * 60.0 * z * (1.0 - z) * (1.0 - 2.0 * z) / half**2,
    )


def quintic(begin: float, end: float, first: tuple[float, ...], last: tuple[float, ...]) -> Any:
    """Return the polynomial of the fifth degree with these values and two derivatives at both ends."""
    rows = []
    for x in (0.0, end - begin):
        rows += [
            [x**n for n in range(6)],
            [n * x ** (n - 1) if n else 0.0 for n in range(6)],
            [n * (n - 1) * x ** (n - 2) if n > 1 else 0.0 for n in range(6)],
        ]
    wanted = np.linalg.solve(np.array(rows), np.array([*first, *last]))
    return lambda x: np.polyval(wanted[::-1], np.asarray(x) - begin)


def smooth(ctx: CaseContext, since: float, *, steps: int = 4) -> None:
    """Measure how far velocity and acceleration are off the changes of position and velocity since an
    instant; so many cycles may hold a step of the acceleration.
    """
    trace = ctx.trace()
    columns = []
    for name in ("position_setpoint", "velocity_setpoint", "acceleration_setpoint"):
        signal = trace[f"{FOLLOWER}.{name}"]
        columns.append(signal.values[signal.time_s >= since - 1e-9])
    for low, high, words in ((0, 1, "velocity"), (1, 2, "acceleration")):
        rise = (columns[low][2:] - columns[low][:-2]) / (2.0 * _CYCLE_S)
        off = np.sort(np.abs(columns[high][1:-1] - rise))
        most = float(np.abs(columns[high]).max(initial=0.0))
        ctx.measure(f"{words}: off the change below it", float(off[-1 - steps]), high=0.03 * most + 1e-6)


class Rows(NamedTuple):
    """What is recorded of the follower since an instant."""

    time_s: Numbers
    phase: Numbers
    x: Numbers
    """Leading value that the function gets."""
    y: Numbers
    """Following value by the function."""
    setpoint: Numbers


def rows(ctx: CaseContext, since: float) -> Rows:
    """Return the samples of the follower from an instant on."""
    trace = ctx.trace()
    names = ("sync_phase", "leading_position", "function_position", "position_setpoint")
    signals = [trace[f"{FOLLOWER}.{name}"] for name in names]
    here = signals[0].time_s >= since - 1e-9
    return Rows(signals[0].time_s[here], *(one.values[here] for one in signals))


_SYNCHRONISING, _SYNCHRONOUS, _LEAVING = 2, 3, 4


def _placed(ctx: CaseContext, place: float, *, leader: float = 0.0) -> Machine:
    """Return the machine with leader and follower at places other than 0."""
    here = machine(ctx)
    for axis, where in ((here.follower, place), (here.leader, leader)):
        if where:
            ctx.wait_until(axis.home(where).done, 1.0, f"{axis.name} is at {where:g} mm")
    ctx.run_for(0.012)
    return here


def _moving(ctx: CaseContext, axis: Any, velocity: float) -> None:
    ctx.wait_until(axis.move_velocity(velocity, **_QUICK).in_velocity, 2.0, f"{velocity:g} mm/s")
    ctx.run_for(0.02)


# -- over a distance -----------------------------------------------------------------------------------------

_WAYS: Final = [
    # function, profile, velocity of the leading axis and of the follower before, distance
    ("gear", 1, 90.0, 0.0, 40.0),
    ("gear", 1, -90.0, 0.0, 30.0),
    ("gear", 1, 70.0, 12.0, 40.0),
    ("gear", 3, 90.0, -9.0, 50.0),
    ("gear", 3, -80.0, 0.0, 30.0),
    ("gear", 4, 90.0, 0.0, 35.0),
    ("gear", 4, -60.0, 7.0, 35.0),
    ("cam", 1, 90.0, 0.0, 40.0),
    ("cam", 1, -90.0, 0.0, 30.0),
    ("cam", 3, 80.0, 0.0, 25.0),
    ("cam", 4, 90.0, 0.0, 35.0),
    ("cam", 6, 90.0, 6.0, 35.0),
    ("cam", 6, -70.0, 0.0, 30.0),
]


@CAMPAIGN.product(
    "way/{function}-{profile}/{leading}:{own}",
    parameters=[
        {"function": function, "profile": profile, "leading": leading, "own": own, "distance": distance}
        for function, profile, leading, own, distance in _WAYS
    ],
    title="{function}, SyncProfileReference {profile}, {leading} mm/s, follower {own} mm/s before",
    requirements=("SYN-120", "SYN-118"),
)
def way(ctx: CaseContext, function: str, profile: int, leading: float, own: float, distance: float) -> None:
    """Between its start and its end the way is the polynomial that both ends ask for; then it is the
    function; StartSync and InSync come in the cycles of these places.
    """
    here = _placed(ctx, 3.7, leader=11.0)
    sense = 1.0 if leading > 0.0 else -1.0
    if own:
        _moving(ctx, here.follower, own)
    _moving(ctx, here.leader, leading)
    since = ctx.now_s
    x, y = here.position(here.leader), here.position(here.follower)
    place = x + sense * 65.0
    cam = ctx.bench.cam("swing")
    if function == "gear":
        target = y + 4.0
        job = here.follower.gear_in_pos(
            here.leader, place, target, -3, 4, SyncProfileReference=profile, MasterStartDistance=distance
        )
        anchor = place, target
    else:
        zero = (x if profile == 4 else place) - 20.0
        job = here.follower.cam_in(
            here.leader, cam, MasterOffset=zero, SlaveOffset=y - 2.0, MasterScaling=0.9,
            SlaveScaling=1.3, MasterSyncPosition=20.0, SyncProfileReference=profile,
            MasterStartDistance=distance, ApplicationMode=1,
        )  # fmt: skip
        anchor = zero, y - 2.0
    ctx.wait_until(lambda: job.InSync, 3.0, "the axis is synchronous")
    shown_in_sync = ctx.now_s
    ctx.run_for(0.1)
    found = rows(ctx, since)
    begin, end = _ends(found, profile, place, sense, distance)
    if function == "gear":
        law = _line(place, anchor[1], -0.75)
    else:
        # Profile 6: the synchronous position of the cam is where the way ends.
        zero = end - 20.0 if profile == 6 else anchor[0]
        law = _cam(zero, anchor[1], 0.9, 1.3)
    before = int(np.flatnonzero(np.isin(found.phase, (_SYNCHRONISING, _SYNCHRONOUS)))[0]) - 1
    # Both axes have constant velocities until then.
    start = float(found.setpoint[before]) + own * (begin - _lead(ctx, found.time_s[before])) / leading
    expected = quintic(begin, end, (start, own / leading, 0.0), law(end))
    judge(ctx, "off the polynomial of its way", found, _SYNCHRONISING, expected)
    judge(ctx, "off its function", found, _SYNCHRONOUS, lambda at: np.array([law(one)[0] for one in at]))
    inside = found.x[found.phase == _SYNCHRONISING]
    step = abs(leading) * _CYCLE_S
    equal(ctx, "begin of the way", float(sense * (inside[0] - begin)), 0.5 * step, within=0.5 * step + _NEAR)
    equal(ctx, "end of the way", float(sense * (end - inside[-1])), 0.5 * step, within=0.5 * step + _NEAR)
    smooth(ctx, float(found.time_s[before + 2]), steps=6)
    late = float(shown_in_sync - found.time_s[found.phase == _SYNCHRONOUS][0])
    equal(ctx, "InSync after the axis is synchronous", late, 0.5 * _CYCLE_S, "SYN-155", within=1.1 * _CYCLE_S)
    ctx.expect(no_alarm())


def _lead(ctx: CaseContext, at: float) -> float:
    """Return the leading position of a cycle, which is recorded with its axis."""
    return float(ctx.trace()[f"{LEADER}.position_setpoint"].at(at))


def _ends(found: Rows, profile: int, place: float, sense: float, distance: float) -> tuple[float, float]:
    """Return where synchronising begins and ends, leading values."""
    if profile == 1:
        return place - sense * distance, place
    if profile == 3:
        return place, place + sense * distance
    inside = found.x[found.phase == _SYNCHRONISING]
    # From the leading value of the call on, which is that of the cycle before its first one.
    begin = float(inside[0]) - float(inside[1] - inside[0])
    return begin, begin + sense * distance


def _line(x0: float, y0: float, ratio: float) -> Callable[[float], tuple[float, float, float]]:
    return lambda x: (y0 + ratio * (x - x0), ratio, 0.0)


def _cam(x0: float, y0: float, master: float, slave: float) -> Callable[[float], tuple[float, float, float]]:
    def law(x: float) -> tuple[float, float, float]:
        y, slope, bend = swing((x - x0) / master)
        return y0 + slave * y, slave * slope / master, slave * bend / master**2

    return law


def judge(ctx: CaseContext, text: str, found: Rows, phase: int, law: Callable[[Numbers], Numbers]) -> None:
    """Measure the greatest deviation of the follower from a formula in a phase."""
    here = found.phase == phase
    ctx.measure("cycles in the phase", float(np.count_nonzero(here)), low=5.0)
    wrong = float(np.abs(found.y[here] - law(found.x[here])).max(initial=0.0))
    ctx.measure(text, wrong, "mm", high=_NEAR)


# -- with dynamic values, at once, in place ------------------------------------------------------------------


@CAMPAIGN.product(
    "dynamic/{function}/{leading}:{target}",
    parameters=[
        {"function": function, "leading": leading, "target": target}
        for function in ("gear", "cam")
        for leading, target in ((60.0, 24.0), (-60.0, -31.0), (40.0, -18.0))
    ],
    title="{function} with dynamic values, leading axis {leading} mm/s, by {target} mm",
    requirements=("SYN-123",),
)
def dynamic(ctx: CaseContext, function: str, leading: float, target: float) -> None:
    """The axis starts as late as its dynamic values allow, keeps them, and is there with the leading axis."""
    here = _placed(ctx, 5.0, leader=2.0)
    _moving(ctx, here.leader, leading)
    since = ctx.now_s
    x, y = here.position(here.leader), here.position(here.follower)
    sense = 1.0 if leading > 0.0 else -1.0
    place, goal, ratio = x + sense * 45.0, y + target, _SLOPE
    inputs = {"SyncProfileReference": 0, **_DYNAMICS}
    if function == "gear":
        ratio = 0.6
        job = here.follower.gear_in_pos(here.leader, place, goal, 3, 5, **inputs)
    else:
        cam = ctx.bench.cam("straight")
        job = here.follower.cam_in(
            here.leader, cam, MasterOffset=place, SlaveOffset=goal, MasterSyncPosition=1000.0, **inputs
        )
    ctx.wait_until(lambda: job.InSync, 3.0, "the axis is synchronous")
    ctx.run_for(0.1)
    found = rows(ctx, since)
    judge(ctx, "off its function", found, _SYNCHRONOUS, lambda at: goal + ratio * (at - place))
    inside = found.phase == _SYNCHRONISING
    takes = _fastest(target, ratio * leading)
    begun = float(found.time_s[inside][0]) - _CYCLE_S
    equal(ctx, "duration", float(found.time_s[inside][-1]) - begun, takes, "SYN-123", within=2.5 * _CYCLE_S)
    equal(
        ctx,
        "leading value at the end",
        float(found.x[inside][-1]),
        place,
        within=1.5 * abs(leading) * _CYCLE_S,
    )
    velocity = np.diff(found.y) / _CYCLE_S
    slopes = np.diff(velocity[inside[1:]]) / _CYCLE_S
    most = max(_DYNAMICS["Acceleration"], _DYNAMICS["Deceleration"])
    ctx.measure("greatest acceleration", float(np.abs(slopes).max()), "mm/s2", high=1.02 * most)
    smooth(ctx, begun, steps=14)
    ctx.measure(
        "greatest velocity", float(np.nanmax(np.abs(velocity))), "mm/s", high=1.001 * _DYNAMICS["Velocity"]
    )
    ctx.expect(no_alarm())


def _fastest(way: float, end: float) -> float:
    """Return the least time of a motion from rest to a velocity over a way, without jerk, s; by bisection of
    its greatest velocity.
    """
    sign = 1.0 if way > 0.0 else -1.0
    way, end = abs(way), end * sign
    up, down, limit = _DYNAMICS["Acceleration"], _DYNAMICS["Deceleration"], _DYNAMICS["Velocity"]

    def parts(top: float) -> tuple[float, float]:
        """Return time and way of the ramps; an end in the other direction is braked to 0 and left again."""
        if end < 0.0:
            return top / up + top / down - end / up, top**2 / (2 * up) + top**2 / (2 * down) - end**2 / (
                2 * up
            )
        return top / up + (top - end) / down, top**2 / (2 * up) + (top**2 - end**2) / (2 * down)

    low, high = max(end, 0.0), limit
    if parts(high)[1] > way:
        for _ in range(60):
            middle = 0.5 * (low + high)
            low, high = (middle, high) if parts(middle)[1] < way else (low, middle)
    time_s, covered = parts(high)
    return time_s + max(way - covered, 0.0) / high


@CAMPAIGN.case(
    "direct", title="MC_CamIn at once, and in place", requirements=("CAM-126", "CAM-131", "CAM-133")
)
def direct(ctx: CaseContext) -> None:
    """Profile 2 shifts the cam to where both axes are; 7 waits until the axis is where the cam wants it."""
    here = _placed(ctx, 12.0, leader=37.5)
    cam, follower = ctx.bench.cam("swing"), here.follower
    job = follower.cam_in(
        here.leader, cam, MasterSyncPosition=30.0, SyncProfileReference=2, ApplicationMode=1, SlaveScaling=0.7
    )
    ctx.wait_until(job.in_sync, 0.2, "the axis is synchronous")
    zero, lift = 7.5, 12.0 - 0.7 * swing(30.0)[0]
    _shown(
        ctx, follower, FunctionState=3, ActualCam=cam.object.db_number,
        ActualMaster=here.leader.object.db_number, MasterOffset=zero, SlaveOffset=lift, MasterScaling=1.0,
        SlaveScaling=0.7, Offset=lift,
    )  # fmt: skip
    since = ctx.now_s
    _moving(ctx, here.leader, 80.0)
    ctx.run_for(0.3)
    law = _cam(zero, lift, 1.0, 0.7)
    judge(
        ctx,
        "off the shifted cam",
        rows(ctx, since),
        _SYNCHRONOUS,
        lambda at: np.array([law(x)[0] for x in at]),
    )
    # Profile 7: the leading axis runs on; the follower gets to its cam where that comes to it.
    stop = follower.stop(0)
    ctx.wait_until(stop.done, 2.0, "the follower stands")
    stop.set(Execute=False)
    ctx.run_for(0.012)
    ctx.wait_until(here.leader.halt().done, 2.0, "the leading axis stands")
    x, y = here.position(here.leader), here.position(follower)
    zero, lift = x - 20.0, y - swing(20.0)[0] + 1.0
    job = follower.cam_in(
        here.leader, cam, MasterOffset=zero, SlaveOffset=lift, SyncProfileReference=7, ApplicationMode=1
    )
    ctx.run_for(0.1)
    equal(ctx, "it waits beside its cam", job.Busy and not (job.InSync or job.StartSync), 1, "CAM-131")
    _shown(ctx, follower, "SYN-035", WaitingFunctionState=3, FunctionState=0)
    ctx.wait_until(follower.move_relative(2.0, Velocity=50.0, **_QUICK).done, 2.0, "the axis is there")
    ctx.measure("not in place", float(job.InSync), high=0.0)
    follower.move_absolute(y + 1.0, Velocity=50.0, **_QUICK)
    ctx.wait_until(job.in_sync, 1.0, "it is synchronous where the cam is")
    since = ctx.now_s
    _moving(ctx, here.leader, 80.0)
    law = _cam(zero, lift, 1.0, 1.0)
    judge(ctx, "off the cam", rows(ctx, since), _SYNCHRONOUS, lambda at: np.array([law(x)[0] for x in at]))


def _shown(ctx: CaseContext, axis: Any, *ids: str, **wanted: float) -> None:
    """Expect variables of `StatusSynchronizedMotion`; `EffectiveLeadingValue_Position` for one below it."""
    for name, value in wanted.items():
        path = f"StatusSynchronizedMotion.{name.replace('_', '.')}"
        equal(ctx, path, axis.var(path), value, *ids, within=1e-6 if value % 1 else 1e-9)


# -- shifts --------------------------------------------------------------------------------------------------


def _geared(ctx: CaseContext, leading: float) -> tuple[Machine, Any]:
    """Return the machine in gear 3:2 behind a leading axis with a velocity, and the job."""
    here = _placed(ctx, 4.0, leader=7.0)
    job = here.follower.gear_in(here.leader, 3, 2, **_QUICK)
    ctx.wait_until(job.in_gear, 1.0, "the axis is in gear")
    if leading:
        _moving(ctx, here.leader, leading)
    ctx.run_for(0.05)
    return here, job


def _start_shift(follower: Any, kind: str, amount: float, distance: float, **inputs: Any) -> Any:
    """Start a shift over a distance of the leading value."""
    if kind.startswith("phasing"):
        return getattr(follower, kind)(amount, PhasingDistance=distance, **inputs)
    return getattr(follower, kind)(amount, distance, **inputs)


_SHIFTS: Final = [
    # instruction, amounts one after the other, leading velocity, Direction, whether it has a start position
    ("phasing_absolute", (8.0, 3.0), 75.0, 3, False),
    ("phasing_relative", (8.0, -11.0), 75.0, 1, True),
    ("phasing_relative", (-5.0, -6.0), -75.0, 2, False),
    ("offset_absolute", (8.0, 3.0), 75.0, 1, True),
    ("offset_relative", (-8.0, 2.0), -75.0, 3, True),
    ("offset_relative", (6.0, 7.0), 75.0, 1, False),
]


@CAMPAIGN.product(
    "shift/{kind}/{leading}/{direction}-{waits}",
    parameters=[
        {"kind": kind, "amounts": amounts, "leading": leading, "direction": direction, "waits": waits}
        for kind, amounts, leading, direction, waits in _SHIFTS
    ],
    title="{kind} {amounts} behind {leading} mm/s, Direction {direction}, with a start position: {waits}",
    requirements=("SYN-178", "SYN-191"),
)
def shift(
    ctx: CaseContext, kind: str, amounts: tuple[float, ...], leading: float, direction: int, waits: bool
) -> None:
    """A shift goes by its polynomial from its start position on; its outputs, status bits and status
    variables say how far; the gear goes on with it.
    """
    here, gear = _geared(ctx, leading)
    follower, name = here.follower, kind.partition("_")[0]
    phases, relative = name == "phasing", kind.endswith("relative")
    x0, y0 = here.position(here.leader), here.position(follower)
    at, distance = 0.0, 9.0
    for amount in amounts:
        begin, target = at, at + amount if relative else amount
        x = here.position(here.leader)
        sense = 1.0 if leading > 0.0 else -1.0
        start = x + sense * 8.3
        inputs: dict[str, Any] = {"ProfileReference": 2 if waits else 1, "StartPosition": start}
        since = ctx.now_s
        job = _start_shift(follower, kind, amount, distance, Direction=direction, **inputs)
        ctx.run_for(0.012)
        started = job.StartPhasing if phases else job.StartOffset
        equal(ctx, "started", started, not waits, "SYN-187" if phases else "SYN-430")
        bits = ("StatusWord2.X3", "StatusWord.X24") if phases else ("StatusWord2.X5", "StatusWord2.X4")
        for bit, wanted in zip(bits, (waits, not waits), strict=True):
            equal(ctx, bit, follower.var(bit), wanted, "SYN-049")
        ctx.wait_until(job.done, 1.0, "the shift is done")
        at = target
        tag = "PhaseShift" if phases else "Offset"
        _shown(ctx, follower, "SYN-040" if phases else "SYN-041", **{tag: target})
        output = {
            "phasing_absolute": "AbsolutePhaseShift", "phasing_relative": "CoveredPhaseShift",
            "offset_absolute": "AbsoluteOffset", "offset_relative": "CoveredOffset",
        }[kind]  # fmt: skip
        equal(ctx, output, getattr(job, output), amount, "SYN-182" if phases else "SYN-193", within=1e-9)
        for bit in bits:
            equal(ctx, f"{bit} behind it", follower.var(bit), 0)
        _by_polynomial(ctx, since, phases, (begin, target), start if waits else None, distance, (x0, y0))
    ctx.measure("InGear", float(gear.InGear), low=1.0)
    off = (
        here.position(follower) - y0 - 1.5 * (here.position(here.leader) - x0) - at * (1.5 if phases else 1.0)
    )
    equal(ctx, "off the shifted gear", off, 0.0, within=_NEAR)
    ctx.expect(no_alarm())


@TURNING.product(
    "shift/turning/{kind}",
    parameters={"kind": ("phasing_relative", "offset_relative")},
    title="{kind} from a start position in this turn and in the next one",
    requirements=lambda kind: ("SYN-180", "SYN-187") if kind == "phasing_relative" else ("SYN-430",),
)
def shift_on_a_turn(ctx: CaseContext, kind: str) -> None:
    """A modulo leading axis comes to the start position in its direction: just ahead, beyond the end of its
    range, or after almost a whole turn, when it lies just behind.
    """
    here = _placed(ctx, 4.0)
    length, low = 150.0, -40.0
    job = here.follower.gear_in(here.leader, 3, 2, **_QUICK)
    ctx.wait_until(job.in_gear, 1.0, "the axis is in gear")
    for velocity in (250.0, -250.0):
        _moving(ctx, here.leader, velocity)
        sense = 1.0 if velocity > 0.0 else -1.0
        for ahead in (23.0, 145.0):
            begun, place = ctx.now_s, here.position(here.leader)
            start = low + (place + sense * ahead - low) % length
            shifts = _start_shift(
                here.follower, kind, 0.5 * sense, 9.0, ProfileReference=2, StartPosition=start, Direction=3
            )
            output = "StartPhasing" if kind.startswith("phasing") else "StartOffset"
            ctx.wait_until(lambda one=shifts, name=output: getattr(one, name), 1.0, "the shift begins")
            way = abs(velocity) * (ctx.now_s - begun)
            # The outputs show it one call behind the setpoint, which is in the middle of a cycle.
            equal(
                ctx,
                f"way to {start:g} mm at {velocity:g} mm/s, {ahead:g} mm ahead",
                way,
                ahead,
                "SYN-187" if output == "StartPhasing" else "SYN-430",
                within=3.0 * abs(velocity) * _CYCLE_S,
            )
            ctx.wait_until(shifts.done, 1.0, "the shift is done")
    ctx.expect(no_alarm())


def _by_polynomial(
    ctx: CaseContext,
    since: float,
    phases: bool,
    ends: tuple[float, float],
    start: float | None,
    distance: float,
    origin: tuple[float, float],
) -> None:
    """Measure how far a shift is off `10 z^3 - 15 z^4 + 6 z^5` of the way of the leading value (SYN-132)."""
    found = rows(ctx, since)
    trace = ctx.trace()
    leading = np.array([trace[f"{LEADER}.position_setpoint"].at(when) for when in found.time_s])
    x0, y0 = origin
    shifted = found.x - leading if phases else found.setpoint - y0 - 1.5 * (leading - x0)
    moved = np.flatnonzero(np.abs(shifted - ends[0]) > 1e-9)
    sense = float(np.sign(leading[-1] - leading[0]))
    # Without a start position it begins with the leading value of the call.
    begin = start if start is not None else float(leading[moved[0] - 1])
    z = np.clip(sense * (leading - begin) / distance, 0.0, 1.0)
    wanted = ends[0] + (ends[1] - ends[0]) * z**3 * (10.0 - 15.0 * z + 6.0 * z**2)
    wrong = float(np.abs(shifted - wanted).max())
    ctx.measure("off the polynomial of the shift", wrong, "mm", high=_NEAR, requirements=("SYN-132",))


@CAMPAIGN.case("shift/dynamic", requirements=("SYN-183", "SYN-184", "SYN-424"))
def shift_with_dynamics(ctx: CaseContext) -> None:
    """Phasing with dynamic values takes the time of its ramps on the follower, whatever the leading axis
    does; what is there already is done at once.
    """
    here, _ = _geared(ctx, 0.0)
    follower = here.follower
    inputs = {"Velocity": 50.0, "Acceleration": 1000.0, "Deceleration": 500.0, "Jerk": 0.0}
    for kind, amount, way, shown in (
        ("phasing_absolute", 10.0, 15.0, 10.0),
        ("phasing_absolute", 10.0, 0.0, 10.0),
        ("phasing_relative", -4.0, -6.0, 6.0),
    ):
        y, begun = here.position(follower), ctx.now_s
        job = getattr(follower, kind)(amount, ProfileReference=0, **inputs)
        ctx.wait_until(job.done, 2.0, "the shift is done")
        takes = abs(way) / 50.0 + 0.5 * (50.0 / 1000.0 + 50.0 / 500.0) if way else 0.0
        equal(ctx, f"{kind} {amount}: time", ctx.now_s - begun, takes, "SYN-424", within=0.013)
        equal(ctx, "way of the follower", here.position(follower) - y, way, "SYN-183", within=1e-9)
        _shown(ctx, follower, PhaseShift=shown)


@CAMPAIGN.case("shift/cancelled", requirements=("SYN-188", "SYN-425", "SYN-427", "SYN-432", "SYN-337"))
def cancelled(ctx: CaseContext) -> None:
    """Profile 5 ends what waits, not what shifts, and of its own kind; a leading value that turns round ends
    it with 16#808C where it is; against its direction nothing is shifted.
    """
    here, _ = _geared(ctx, 0.0)
    follower = here.follower
    for kind, other in (("phasing", "offset"), ("offset", "phasing")):
        name = f"{kind}_relative"
        waits = _start_shift(follower, name, 5.0, 10.0, ProfileReference=2, StartPosition=4000.0)
        ctx.run_for(0.02)
        refused = getattr(follower, f"{other}_relative")(1.0, ProfileReference=5)
        ctx.run_for(0.012)
        equal(ctx, f"ErrorID of {other}", refused.ErrorID, 0x808A, "SYN-186")
        done = getattr(follower, f"{kind}_absolute")(0.0, ProfileReference=5)
        ctx.run_for(0.012)
        equal(ctx, "what waits is aborted", waits.CommandAborted, 1, "SYN-425")
        equal(ctx, "the cancelling job is done", done.Done, 1)
        opposed = _start_shift(follower, name, 5.0, 10.0, ProfileReference=1, Direction=2)
        _moving(ctx, here.leader, 60.0)
        equal(ctx, "it waits for its direction", opposed.Busy, 1, "SYN-427")
        tag = "PhaseShift" if kind == "phasing" else "Offset"
        _shown(ctx, follower, **{tag: 0.0})
        shifting = _start_shift(follower, name, 5.0, 30.0, ProfileReference=1)
        ctx.run_for(0.15)
        equal(ctx, "the job before is aborted", opposed.CommandAborted, 1)
        on = getattr(follower, f"{kind}_relative")(0.0, ProfileReference=5)
        ctx.run_for(0.012)
        equal(ctx, "what shifts goes on", shifting.Busy + on.Done, 2, "SYN-425")
        here.lead(-60.0, **_QUICK)
        ctx.run_for(0.3)
        equal(ctx, "ErrorID of a reversal", shifting.ErrorID, 0x808C, "SYN-188")
        value = follower.var(f"StatusSynchronizedMotion.{tag}")
        ctx.measure(f"{tag} stays", value, "mm", low=0.5, high=4.5, requirements=("SYN-188",))
        ctx.wait_until(here.leader.halt(Deceleration=1700.0, Jerk=0.0).done, 1.0, "the leader stands")
        again = follower.gear_in(here.leader, 3, 2)
        ctx.wait_until(again.in_gear, 1.0, "the axis is in gear again")
        _shown(ctx, follower, "SYN-189", **{tag: 0.0})


# -- leaving -------------------------------------------------------------------------------------------------


@CAMPAIGN.product(
    "leave/{function}-{profile}/{leading}",
    parameters=[
        {"function": function, "profile": profile, "leading": leading}
        for function in ("gear", "cam")
        for profile in (0, 1)
        for leading in (70.0, -70.0)
    ],
    title="leave a {function} with SyncProfileReference {profile} behind {leading} mm/s",
    requirements=("SYN-205", "SYN-206", "SYN-212", "SYN-434"),
)
def leave(ctx: CaseContext, function: str, profile: int, leading: float) -> None:
    """Over a distance the axis follows the polynomial from half of it before its place on; with dynamic
    values it brakes with its deceleration; both end at the place, and WaitingFunctionState tells of the wait.
    """
    here = _placed(ctx, 4.0, leader=7.0)
    follower, sense = here.follower, 1.0 if leading > 0.0 else -1.0
    if function == "gear":
        job, ratio, number = follower.gear_in(here.leader, -3, 2, **_QUICK), -1.5, 4
    else:
        cam, ratio, number = ctx.bench.cam("straight"), _SLOPE, 5
        job = follower.cam_in(
            here.leader, cam, SyncProfileReference=2, MasterSyncPosition=1000.0, MasterScaling=1.0
        )
    ctx.run_for(0.05)
    _moving(ctx, here.leader, leading)
    ctx.measure("synchronous", float(follower.var("StatusWord.X22")), low=1.0)
    since, y = ctx.now_s, here.position(follower)
    velocity = ratio * leading
    place, distance, braking = y + sense * ratio * 31.0, 22.0, 640.0
    inputs = {"MasterStopDistance": distance} if profile else {"Deceleration": braking, "Jerk": 0.0}
    out = getattr(follower, f"{function}_out")(place, SyncProfileReference=profile, **inputs)
    ctx.run_for(0.02)
    _shown(
        ctx, follower, "SYN-035", WaitingFunctionState=number, FunctionState=1 if function == "gear" else 3
    )
    equal(ctx, "StatusWord2.X1 while it waits", follower.var("StatusWord2.X1"), 0, "SYN-048")
    ctx.wait_until(lambda: out.StartSyncOut, 1.0, "desynchronising begins")
    equal(ctx, "the job before is aborted", job.CommandAborted, 1, "SYN-207")
    _shown(ctx, follower, "SYN-034", WaitingFunctionState=0, FunctionState=number)
    equal(ctx, "StatusWord2.X1", follower.var("StatusWord2.X1"), 1, "SYN-048")
    ctx.wait_until(out.done, 2.0, "the axis has left")
    found = rows(ctx, since)
    going = found.phase == _LEAVING
    takes = distance / abs(leading) if profile else abs(velocity) / braking
    # The cycles of its begin and of its end count.
    lasts = float(np.count_nonzero(going)) * _CYCLE_S
    equal(ctx, "duration", lasts, takes + 2.0 * _CYCLE_S, within=1.6 * _CYCLE_S)
    needed = abs(ratio) * distance / 2.0 if profile else velocity**2 / (2.0 * braking)
    left = abs(place - float(found.setpoint[np.flatnonzero(going)[0] - 1]))
    equal(ctx, "way that is left when it begins", left, needed, within=abs(velocity) * _CYCLE_S)
    if profile:
        trace = ctx.trace()
        x = np.array([trace[f"{LEADER}.position_setpoint"].at(at) for at in found.time_s])
        # It begins where the rest of the way is half the distance times the ratio.
        zero = float(x[np.flatnonzero(going)[0] - 1]) + sense * (left - needed) / abs(ratio)
        law = quintic(
            zero,
            zero + sense * distance,
            (place - sense * ratio * distance / 2.0, ratio, 0.0),
            (place, 0.0, 0.0),
        )
        inside = going & (sense * (zero + sense * distance - x) > 0.0)
        wrong = float(np.abs(found.setpoint[inside] - law(x[inside])).max())
        ctx.measure("off the polynomial of leaving", wrong, "mm", high=_NEAR, requirements=("SYN-129",))
    else:
        slope = np.diff(found.setpoint[going], 2) / _CYCLE_S**2
        steady = np.abs(slope[1:-2])
        ctx.measure(
            "deceleration", float(np.median(steady)), "mm/s2", low=0.98 * braking, high=1.02 * braking
        )
    equal(ctx, "place", here.position(follower), place, "SYN-206", within=_NEAR)
    smooth(ctx, float(found.time_s[going][0]), steps=10)
    ctx.run_for(0.02)
    _shown(ctx, follower, WaitingFunctionState=0, FunctionState=0, ActualMaster=0, ActualCam=0)
    equal(ctx, "velocity", follower.var("Velocity"), 0.0)
    ctx.expect(no_alarm())


# -- what is added, and simulation ---------------------------------------------------------------------------


@CAMPAIGN.case(
    "additive", requirements=("SYN-221", "SYN-222", "SYN-223", "SYN-226", "SYN-227", "SYN-229", "SYN-439")
)
def additive(ctx: CaseContext) -> None:
    """What is added acts in the next cycle on position and velocity, outlasts the job, and ends with Enable,
    by another instance and with the enable of the axis.
    """
    here, _ = _geared(ctx, 0.0)
    follower, prefix = here.follower, "EffectiveLeadingValue_"
    x, y = here.position(here.leader), here.position(follower)
    first = follower.leading_value_additive(0.0)
    ctx.run_for(0.012)
    equal(ctx, "Busy", first.Busy, 1, "SYN-219")
    _shown(ctx, follower, "SYN-046", StatusWord=1 << 4)
    first.set(Position=0.4, Velocity=3.0, Acceleration=20.0)
    ctx.run_for(0.012)
    _shown(ctx, follower, "SYN-222", **{f"{prefix}Position": x + 0.4, f"{prefix}Velocity": 3.0,
        f"{prefix}Acceleration": 20.0, "FunctionLeadingValue_Position": x + 0.4,
        "FunctionFollowingValue_Velocity": 4.5, "FunctionFollowingValue_Acceleration": 30.0,
        "FunctionFollowingValue_Position": y + 0.6, "FunctionState": 1})  # fmt: skip
    equal(ctx, "position", here.position(follower), y + 0.6, "SYN-222", within=_NEAR)
    first.set(Velocity=0.0, Acceleration=0.0)
    ctx.run_for(0.012)
    again = follower.gear_in(here.leader, 1, 1)
    ctx.wait_until(again.in_gear, 1.0, "the axis is in another gear")
    _shown(ctx, follower, "SYN-223", **{f"{prefix}Position": x + 0.4})
    second = follower.leading_value_additive(0.3)
    ctx.run_for(0.012)
    equal(ctx, "the first one is aborted, the second acts", second.Busy - first.Busy, 1, "SYN-226")
    _shown(ctx, follower, **{f"{prefix}Position": x + 0.3})
    equal(ctx, "position", here.position(follower), y + 0.5, within=_NEAR)
    second.set(Enable=False)
    ctx.run_for(0.012)
    equal(ctx, "Busy", second.Busy, 0, "SYN-227")
    _shown(ctx, follower, "SYN-227", StatusWord=0, **{f"{prefix}Position": x})
    for name, value, code in (
        ("Position", nan, 0x8009),
        ("Velocity", nan, 0x8003),
        ("Acceleration", nan, 0x8004),
    ):
        wrong = follower.leading_value_additive(0.0)
        wrong.set(**{name: value})
        ctx.run_for(0.012)
        equal(ctx, f"ErrorID of {name}", wrong.ErrorID, code, "SYN-220")
        wrong.set(Enable=False)
        ctx.run_for(0.008)
    third = follower.leading_value_additive(0.0)
    ctx.run_for(0.012)
    follower.power(False)
    ctx.run_for(0.2)
    equal(ctx, "Busy on a disabled axis", third.Busy, 0, "SYN-229")
    refused = follower.leading_value_additive(0.0)
    ctx.run_for(0.012)
    equal(ctx, "ErrorID on a disabled axis", refused.ErrorID, 0x800F, "SYN-221")


@CAMPAIGN.case(
    "simulation",
    requirements=("SYN-232", "SYN-233", "SYN-234", "SYN-235", "SYN-237", "SYN-440", "SYN-443", "SYN-413"),
)
def simulation(ctx: CaseContext) -> None:
    """In simulation the function goes on without its axis, which takes other jobs; at its end the axis
    follows again, with the step that lies between; a disabled axis loses its job.
    """
    here = _placed(ctx, 4.0, leader=7.0)
    follower = here.follower

    def code(instance: Any, wanted: int, *ids: str) -> None:
        ctx.run_for(0.012)
        equal(ctx, f"ErrorID of {instance.name}", instance.ErrorID, wanted, *ids)
        instance.set(**{key: False for key in ("Enable", "Execute") if key in instance.inputs})
        ctx.run_for(0.008)

    code(follower.synchronized_motion_simulation(), 0x8075, "SYN-233")
    waits = follower.gear_in_pos(here.leader, 3000.0, 0.0, 1, 1, MasterStartDistance=9.0)
    ctx.run_for(0.012)
    code(follower.synchronized_motion_simulation(), 0x80A9, "SYN-233")
    job = follower.gear_in(here.leader, 3, 2)
    ctx.wait_until(job.in_gear, 1.0, "the axis is in gear")
    equal(ctx, "the waiting job is aborted", waits.CommandAborted, 1)
    _moving(ctx, here.leader, 40.0)
    code(follower.synchronized_motion_simulation(), 0x800D, "SYN-232")
    ctx.wait_until(here.leader.halt().done, 1.0, "the leading axis stands")
    simulated = follower.synchronized_motion_simulation()
    ctx.run_for(0.012)
    equal(ctx, "InSimulation, Busy", simulated.InSimulation + simulated.Busy, 2, "SYN-231")
    _shown(ctx, follower, "SYN-045", StatusWord=1 << 3, FunctionState=1)
    equal(ctx, "StatusWord.X22", follower.var("StatusWord.X22"), 0, "SYN-232")
    equal(ctx, "InGear", job.InGear, 1, "SYN-232")
    code(follower.synchronized_motion_simulation(), 0x800C, "SYN-413")
    code(follower.gear_in(here.leader, 1, 1), 0x8076, "SYN-440")
    code(follower.phasing_relative(1.0), 0x8076, "SYN-185")
    code(follower.gear_out(3.0, SyncProfileReference=0), 0x8076)
    x, y = here.position(here.leader), here.position(follower)
    function = follower.var("StatusSynchronizedMotion.FunctionFollowingValue.Position")
    ctx.wait_until(here.leader.move_relative(6.0, Velocity=80.0, **_QUICK).done, 1.0, "the leader has moved")
    moved = follower.var("StatusSynchronizedMotion.FunctionFollowingValue.Position") - function
    equal(ctx, "way of the function", moved, 9.0, "SYN-234", within=_NEAR)
    equal(ctx, "way of the axis", here.position(follower) - y, 0.0, "SYN-234")
    ctx.wait_until(follower.move_relative(8.0, Velocity=80.0, **_QUICK).done, 1.0, "a job of its own")
    equal(ctx, "InGear", job.InGear, 1, "SYN-235")
    simulated.set(Enable=False)
    ctx.run_for(0.012)
    equal(ctx, "InSimulation", simulated.InSimulation, 0)
    _shown(ctx, follower, StatusWord=0)
    off = here.position(follower) - y - 1.5 * (here.position(here.leader) - x)
    equal(ctx, "off the gear", off, 0.0, "SYN-237", within=_NEAR)
    equal(ctx, "StatusWord.X22", follower.var("StatusWord.X22"), 1, "SYN-443")
    last = follower.synchronized_motion_simulation()
    ctx.run_for(0.012)
    follower.power(False)
    ctx.run_for(0.2)
    equal(ctx, "InGear while the axis is disabled", job.InGear, 1, "SYN-235")
    last.set(Enable=False)
    ctx.run_for(0.012)
    equal(ctx, "CommandAborted", job.CommandAborted, 1, "SYN-443")
    _shown(ctx, follower, FunctionState=0)


# -- modulo axes ---------------------------------------------------------------------------------------------


@TURNING.product(
    "way/{profile}/{direction}/{leading}",
    parameters={"profile": (0, 1, 3), "direction": (1, 2, 3), "leading": (70.0, -70.0)},
    title="SyncProfileReference {profile}, SyncDirection {direction}, leading axis {leading} mm/s",
    requirements=("SYN-154", "SYN-161"),
)
def modulo_way(ctx: CaseContext, profile: int, direction: int, leading: float) -> None:
    """The axis is at its synchronous position in the direction that it may go, and then in gear; without one
    it goes the shortest way.
    """
    here = _placed(ctx, 40.0, leader=10.0)
    follower, sense = here.follower, 1.0 if leading > 0.0 else -1.0
    _moving(ctx, here.leader, leading)
    since = ctx.now_s
    x = here.position(here.leader)
    place = x + sense * 60.0
    place = (place + 40.0) % 150.0 - 40.0
    inputs = dict(_DYNAMICS) if profile == 0 else {"MasterStartDistance": 50.0}
    job = follower.gear_in_pos(
        here.leader, place, 25.0, 1, 2, SyncProfileReference=profile, SyncDirection=direction, **inputs
    )
    ctx.wait_until(lambda: job.InSync or job.Error, 4.0, "the axis is synchronous, or cannot be")
    found = rows(ctx, since)
    inside = found.phase == _SYNCHRONISING
    steps = np.diff(np.unwrap(found.setpoint[inside], period=85.0))
    if direction != 3:
        ahead = steps if direction == 1 else -steps
        ctx.measure("way in its direction", float(ahead.sum()), "mm", low=0.0, requirements=("SYN-161",))
        if direction == (1 if leading > 0.0 else 2):
            # Else the gear itself leads the axis back at the end of its way.
            ctx.measure("greatest step back", -float(ahead.min()), "mm", high=1e-6, requirements=("SYN-154",))
    ctx.run_for(0.05)
    gone = sense * ((sense * (here.position(here.leader) - place)) % 150.0)
    off = (here.position(follower) - 25.0 - 0.5 * gone) % 85.0
    equal(ctx, "off the gear", min(off, 85.0 - off), 0.0, within=_NEAR)
    if direction == 3:
        # Half a turn, and what the gear adds meanwhile.
        ctx.measure("way of synchronising", abs(float(steps.sum())), "mm", high=42.5 + 25.0)
    ctx.expect(no_alarm())


@TURNING.product(
    "leave/{profile}/{direction}",
    parameters={"profile": (0, 1), "direction": (1, 2, 3)},
    title="modulo axes: leave with SyncProfileReference {profile}, SyncOutDirection {direction}",
    requirements=("SYN-206", "SYN-438"),
)
def modulo_leave(ctx: CaseContext, profile: int, direction: int) -> None:
    """The axis stops at the place of the next turn; in the direction that it may not go the job waits
    until the leading axis has turned round.
    """
    here = _placed(ctx, 40.0, leader=10.0)
    follower = here.follower
    job = follower.gear_in(here.leader, 3, 4, **_QUICK)
    ctx.wait_until(job.in_gear, 1.0, "the axis is in gear")
    _moving(ctx, here.leader, 90.0)
    inputs = {"MasterStopDistance": 14.0} if profile else {"Deceleration": 700.0, "Jerk": 0.0}
    place = here.position(follower) - 9.0
    out = follower.gear_out(place, SyncProfileReference=profile, SyncOutDirection=direction, **inputs)
    if direction == 2:
        ctx.run_for(1.5)  # more than a turn
        equal(ctx, "it waits", out.Busy - out.StartSyncOut, 1, "SYN-438")
        here.lead(-90.0, **_QUICK)
    since = ctx.now_s
    ctx.wait_until(out.done, 3.0, "the axis has left")
    off = (here.position(follower) - place) % 85.0
    equal(ctx, "place", min(off, 85.0 - off), 0.0, "SYN-206", within=_NEAR)
    found = rows(ctx, since)
    steps = np.diff(np.unwrap(found.setpoint[found.phase == _LEAVING], period=85.0))
    ahead = -steps if direction == 2 else steps
    ctx.measure("greatest step back", -float(ahead.min()), "mm", high=1e-6, requirements=("SYN-438",))
    ctx.expect(no_alarm())


# -- refused -------------------------------------------------------------------------------------------------

_BIG: Final = 1.01e12
_REFUSED: Final[dict[str, tuple[tuple[str, float, int], ...]]] = {
    "gear_in": (
        ("Master", None, 0x8002),
        ("RatioNumerator", 0, 0x8017), ("RatioNumerator", 1 << 31, 0x8017), ("RatioNumerator", 1.5, 0x8017),
        ("RatioNumerator", -(1 << 31) - 1, 0x8017), ("RatioDenominator", 0, 0x8018),
        ("RatioDenominator", -1, 0x8018), ("RatioDenominator", 1 << 31, 0x8018),
        ("Acceleration", 0.0, 0x8004), ("Deceleration", 0.0, 0x8005), ("Jerk", nan, 0x8006),
    ),
    "gear_in_velocity": (
        ("Master", None, 0x8002),
        ("RatioNumerator", 0, 0x8017), ("RatioDenominator", 0, 0x8018), ("Acceleration", 0.0, 0x8004),
        ("Deceleration", 0.0, 0x8005), ("Jerk", nan, 0x8006),
    ),
    "gear_in_pos": (
        ("Master", None, 0x8002),
        ("RatioNumerator", 0, 0x8017), ("RatioDenominator", 0, 0x8018), ("MasterSyncPosition", _BIG, 0x8034),
        ("MasterSyncPosition", nan, 0x8034), ("SlaveSyncPosition", -_BIG, 0x8035),
        ("SyncProfileReference", 2, 0x8036), ("SyncProfileReference", 5, 0x8036),
        ("SyncProfileReference", -1, 0x8036), ("MasterStartDistance", 0.0, 0x8026),
        ("MasterStartDistance", -1.0, 0x8026), ("MasterStartDistance", nan, 0x8026),
        ("SyncDirection", 0, 0x8007), ("SyncDirection", 4, 0x8007),
    ),
    "gear_in_pos dynamic": (
        ("Velocity", 0.0, 0x8003), ("Acceleration", 0.0, 0x8004), ("Deceleration", 0.0, 0x8005),
        ("Jerk", nan, 0x8006), ("SyncDirection", 0, 0x8007),
    ),
    "cam_in": (
        ("Master", None, 0x8002),
        ("MasterOffset", _BIG, 0x8021), ("MasterOffset", nan, 0x8021), ("SlaveOffset", _BIG, 0x8022),
        ("MasterScaling", 0.0, 0x8023), ("MasterScaling", nan, 0x8023), ("SlaveScaling", nan, 0x8024),
        ("MasterStartDistance", 0.0, 0x8026), ("ApplicationMode", 3, 0x8027), ("ApplicationMode", -1, 0x8027),
        ("MasterSyncPosition", nan, 0x8034), ("SyncProfileReference", 8, 0x8036),
        ("SyncProfileReference", -1, 0x8036), ("SyncProfileReference", 5, 0x808B),
        ("MasterSyncPosition", 100.001, 0x80AD), ("MasterSyncPosition", -0.001, 0x80AD),
        ("SyncDirection", 0, 0x8007), ("Cam", None, 0x8002),
    ),
    "cam_in dynamic": (
        ("Velocity", 0.0, 0x8003), ("Acceleration", 0.0, 0x8004), ("Deceleration", 0.0, 0x8005),
        ("Jerk", nan, 0x8006),
    ),
}  # fmt: skip
"""Wrong inputs of jobs that start, with their ErrorIDs."""
_REFUSED_IN_GEAR: Final[dict[str, tuple[tuple[str, float, int], ...]]] = {
    "phasing_absolute": (
        ("PhaseShift", nan, 0x8070), ("ProfileReference", 3, 0x8083), ("ProfileReference", 4, 0x8083),
        ("ProfileReference", -1, 0x8083), ("PhasingDistance", 0.0, 0x8082), ("PhasingDistance", nan, 0x8082),
        ("Direction", 0, 0x8007), ("Direction", 4, 0x8007), ("Master", None, 0x8002),
    ),
    "phasing_relative": (
        ("PhaseShift", nan, 0x8070), ("ProfileReference", 6, 0x8083), ("PhasingDistance", -1.0, 0x8082),
    ),
    "phasing_absolute dynamic": (
        ("Velocity", 0.0, 0x8003), ("Acceleration", 0.0, 0x8004), ("Deceleration", 0.0, 0x8005),
        ("Jerk", nan, 0x8006),
    ),
    "phasing_relative start": (("StartPosition", nan, 0x8084),),
    "offset_absolute": (
        ("Offset", nan, 0x8080), ("ProfileReference", 0, 0x8083), ("ProfileReference", 3, 0x8083),
        ("OffsetDistance", 0.0, 0x8081), ("OffsetDistance", -1.0, 0x8081), ("Direction", 0, 0x8007),
        ("Direction", 4, 0x8007),
    ),
    "offset_relative start": (("StartPosition", nan, 0x8084),),
    "gear_out": (
        ("SlavePosition", _BIG, 0x8037), ("SlavePosition", nan, 0x8037), ("SyncOutDirection", 0, 0x8007),
        ("SyncOutDirection", 4, 0x8007), ("MasterStopDistance", 0.0, 0x8026),
        ("MasterStopDistance", nan, 0x8026), ("SyncProfileReference", 2, 0x8036),
        ("SyncProfileReference", 6, 0x8036),
    ),
    "gear_out dynamic": (("Deceleration", 0.0, 0x8005), ("Jerk", nan, 0x8006)),
    "cam_out": (("SyncProfileReference", 1, 0x8078),),
}  # fmt: skip
"""Those of jobs that change a synchronous job or end it."""


@CAMPAIGN.product(
    "refused/{when}",
    parameters={"when": ("at-rest", "in-gear")},
    title="Wrong inputs, {when}",
    requirements=(
        "SYN-133", "SYN-318", "SYN-319", "SYN-321", "SYN-323", "SYN-324", "SYN-325", "SYN-326", "SYN-328",
        "SYN-334", "SYN-336", "SYN-340",
    ),
)  # fmt: skip
def refused(ctx: CaseContext, when: str) -> None:
    """Each wrong input is refused with its ErrorID in the first call, and changes nothing; the values at
    their borders are taken.
    """
    if when == "at-rest":
        here, gear = _placed(ctx, 4.0, leader=7.0), None
    else:
        here, gear = _geared(ctx, 0.0)
    follower, cam = here.follower, ctx.bench.cam("swing")
    makers: dict[str, Callable[[], Any]] = {
        "gear_in": lambda: follower.gear_in(here.leader, 1, 1),
        "gear_in_velocity": lambda: follower.gear_in_velocity(here.leader, 1, 1),
        "gear_in_pos": lambda: follower.gear_in_pos(here.leader, 900.0, 3.0, 1, 1, MasterStartDistance=9.0),
        "cam_in": lambda: follower.cam_in(here.leader, cam, MasterOffset=900.0, MasterStartDistance=9.0),
        "phasing_absolute": lambda: follower.phasing_absolute(1.0, PhasingDistance=9.0, ProfileReference=1),
        "phasing_relative": lambda: follower.phasing_relative(1.0, PhasingDistance=9.0, ProfileReference=1),
        "offset_absolute": lambda: follower.offset_absolute(1.0, 9.0),
        "offset_relative": lambda: follower.offset_relative(1.0, 9.0),
        "gear_out": lambda: follower.gear_out(900.0, MasterStopDistance=9.0),
        "cam_out": lambda: follower.cam_out(900.0, MasterStopDistance=9.0),
    }
    profiles = {"dynamic": 0, "start": 2}
    for name, wrong in (_REFUSED if when == "at-rest" else _REFUSED_IN_GEAR).items():
        kind, _, which = name.partition(" ")
        profile = "SyncProfileReference" if "in" in kind.split("_") or "out" in kind else "ProfileReference"
        for key, value, code in wrong:
            job = makers[kind]()
            job.set(**({profile: profiles[which]} if which else {}), **{key: value})
            ctx.run_for(0.004)
            equal(ctx, f"ErrorID of {name} with {key} {value}", job.ErrorID, code)
            equal(ctx, "Error alone", job.Error - job.Busy - job.Done, 1)
    if gear is not None:
        ctx.measure("InGear", float(gear.InGear), low=1.0)
        _shown(ctx, follower, PhaseShift=0.0, Offset=0.0, WaitingFunctionState=0, FunctionState=1)
        return
    for numerator, denominator in ((-(1 << 31), 1), ((1 << 31) - 1, (1 << 31) - 1), (1, (1 << 31) - 1)):
        job = follower.gear_in(here.leader, numerator, denominator)
        ctx.run_for(0.012)
        equal(ctx, f"{numerator}:{denominator} is taken", job.Busy, 1)
    for position in (0.0, 100.0):
        job = follower.cam_in(
            here.leader, cam, MasterOffset=900.0, MasterStartDistance=9.0, MasterSyncPosition=position
        )
        ctx.run_for(0.012)
        equal(ctx, f"a synchronous position of {position} is taken", job.Busy, 1)
    ctx.expect(no_alarm())
