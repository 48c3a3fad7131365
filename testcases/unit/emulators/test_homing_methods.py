"""Every homing method from every kind of start, against an oracle made of the profile's table, the switches
and the index grid.

The oracle knows the rows of the table in words, the places of the switches and the zero marks, and the true
machine. It shares nothing with the drive's own description of the methods.
"""

from __future__ import annotations

import math
import random

import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from emulators.drive.cia402 import HomingConfig
from testcases.unit.emulators.homing_rig import (
    ACCELERATION_MM_S2,
    COUNTS,
    FAST_MM_S,
    HYSTERESIS_MM,
    LEAD_MM,
    LIMIT_MM,
    SLOW_MM_S,
    STOP_MM,
    home,
    machine,
    prepare,
)

# Edges of the named switches in the order of the table's row, each with the direction of motion in which it
# is seen; by where the load starts. The last one is the home edge. "fast" says that this edge is the first
# and comes at 6099h:1.
ROWS: dict[int, dict[str, list[str]]] = {
    1: {"off": ["- NLS up", "+ NLS down"], "on": ["+ NLS down"]},
    3: {"off": ["+ HS up", "- HS down"], "on": ["- HS down"]},
    4: {"off": ["+ HS up"], "on": ["- HS down", "+ HS up"]},
    7: {
        "left": ["+ HS up", "- HS down"],
        "on": ["- HS down"],
        "right": ["+ PLS up", "- HS up", "- HS down"],
        "limit": ["- HS up", "- HS down"],
    },
    8: {
        "left": ["+ HS up"],
        "on": ["- HS down", "+ HS up"],
        "right": ["+ PLS up", "- HS up", "- HS down", "+ HS up"],
        "limit": ["- HS up", "- HS down", "+ HS up"],
    },
    9: {
        "left": ["+ HS up", "+ HS down", "- HS up"],
        "on": ["+ HS down", "- HS up"],
        "right": ["+ PLS up", "- HS up"],
        "limit": ["- HS up"],
    },
    10: {
        "left": ["+ HS up", "+ HS down"],
        "on": ["+ HS down"],
        "right": ["+ PLS up", "- HS up", "+ HS down"],
        "limit": ["- HS up", "+ HS down"],
    },
}
_MIRROR = {
    "+ ": "- ",
    "- ": "+ ",
    "NLS": "PLS",
    "PLS": "NLS",
    "left": "right",
    "right": "left",
}


def mirrored(edge: str) -> str:
    """Return an edge as it is seen in a mirror that exchanges the ends of the travel."""
    sign, switch, way = edge.split()
    return f"{'-' if sign == '+' else '+'} {_MIRROR.get(switch, switch)} {way}"


# 2, 5 and 6 are 1, 3 and 4 seen in a mirror, 11 to 14 are 7 to 10.
for plain, mirror in ((1, 2), (3, 5), (4, 6), (7, 11), (8, 12), (9, 13), (10, 14)):
    ROWS[mirror] = {
        _MIRROR.get(place, place): [mirrored(edge) for edge in edges] for place, edges in ROWS[plain].items()
    }
for number in range(1, 15):
    ROWS[number + 16] = ROWS[number]

WITH_INDEX = range(1, 15)


def requirements(*numbers: int) -> list[str]:
    """Return the identifiers of the rows of methods with and without index."""
    rows = {n: f"C402-{104 + n}" for n in range(1, 15)}
    rows |= {17: "C402-120", 18: "C402-120", 19: "C402-121", 20: "C402-121", 21: "C402-122", 22: "C402-122"}
    rows |= dict.fromkeys(range(23, 27), "C402-123") | dict.fromkeys(range(27, 31), "C402-124")
    return [rows[number] for number in numbers]


def geometry(method: int, rng) -> tuple[tuple[float, float], float, float]:
    """Return a home switch that suits the method, and the places of its left and right edge, mm."""
    base = method if method < 17 else method - 16
    left = rng.uniform(-20.0, 5.0)
    right = left + rng.uniform(4.0, 12.0)
    if base in (3, 4):
        return (left, math.inf), left, math.inf
    if base in (5, 6):
        return (-math.inf, right), -math.inf, right
    return (left, right), left, right


def start_mm(method: int, place: str, cam: tuple[float, float], rng) -> float:
    """Return a start position of a kind."""
    base = method if method < 17 else method - 16
    low, high = cam
    inner = LIMIT_MM - 2.0
    beyond = LIMIT_MM + rng.uniform(0.3, 4.0)
    if base in (1, 2):
        side = -1 if base == 1 else 1
        return side * beyond if place == "on" else rng.uniform(-inner, inner)
    if place == "limit":
        return beyond if base < 11 else -beyond
    if place == "on":
        return rng.uniform(max(low, -inner) + 0.3, min(high, inner) - 0.3)
    if place == "off":
        return rng.uniform(-inner, low - 0.5) if base in (3, 4) else rng.uniform(high + 0.5, inner)
    return rng.uniform(-inner, low - 0.5) if place == "left" else rng.uniform(high + 0.5, inner)


def home_edge_mm(edge: str, cam: tuple[float, float]) -> float:
    """Return where the load makes an edge: on leaving, the hysteresis lies behind the end of the range."""
    sign, switch, way = edge.split()
    low, high = {"NLS": (-math.inf, -LIMIT_MM), "PLS": (LIMIT_MM, math.inf), "HS": cam}[switch]
    if way == "up":
        return low if sign == "+" else high
    return high + HYSTERESIS_MM if sign == "+" else low - HYSTERESIS_MM


def first_mark(place_mm: float, direction: int, zero_mark: int) -> int:
    """Return the first zero mark behind a place, increments of the shaft."""
    turns = place_mm / LEAD_MM - zero_mark / COUNTS
    turn = math.floor(turns) + 1 if direction > 0 else math.ceil(turns) - 1
    return turn * COUNTS + zero_mark


def check(run, method: int, edges: list[str], cam: tuple[float, float], zero_mark: int) -> None:
    """Judge a run by its row of the table."""
    last = edges[-1]
    direction = 1 if last[0] == "+" else -1
    reference = last.split()[1]
    # The row speaks of its switch and of limit switches that are reached; those that are left again do not
    # matter.
    named = [
        (time, name)
        for time, name in run.edges
        if name.split()[1] == reference or (name.split()[1] in {"NLS", "PLS"} and name.endswith("up"))
    ]
    assert [name for _, name in named][: len(edges)] == edges, run.edges
    # C402-135: running, attained, finished.
    assert run.statuses == [0b000, 0b010, 0b011], [f"{bits:03b}" for bits in run.statuses]
    # C402-133: fast until the first edge of the switch that is looked for, slow afterwards; never backwards
    # behind the home edge.
    first_s = next(time for time, name in named if name.split()[1] == reference)
    home_s = named[len(edges) - 1][0]
    leaving = len(edges) == 1 and last.endswith("down")
    slowing_s = (FAST_MM_S + SLOW_MM_S) / ACCELERATION_MM_S2 + 0.020
    for time, position, velocity in run.samples:
        assert -STOP_MM < position < STOP_MM, "the end stop is touched"
        limit = SLOW_MM_S if leaving or time > first_s + slowing_s else FAST_MM_S
        assert abs(velocity) <= limit * 1.03 + 0.2, (time, velocity)
        if time > home_s + slowing_s:
            assert velocity * direction > -0.3, (time, velocity)
    if not leaving and first_s > run.start_ns / 1e9 + 0.05:
        assert max(abs(v) for t, _, v in run.samples if t <= first_s) > 0.9 * FAST_MM_S
    # The home position: the edge as the input has sampled it, or the exact zero mark behind it.
    edge = home_edge_mm(last, cam)
    at_edge = min(run.samples, key=lambda sample: abs(sample[0] - home_s))
    window = abs(at_edge[2]) * run.drive.config.servo_period_ns / 1e9 * 1.01
    if method in WITH_INDEX:
        marks = {
            first_mark(edge, direction, zero_mark),
            first_mark(edge + direction * window, direction, zero_mark),
        }
        assert run.home_counts in marks
    else:
        behind = direction * (run.home_counts / COUNTS * LEAD_MM - edge)
        assert -1.0 <= behind / LEAD_MM * COUNTS <= window / LEAD_MM * COUNTS + 1.0


CASES = [(method, place) for method in sorted(ROWS) for place in ROWS[method]]


def marked(cases):
    """Give every case the identifier of its method's row."""
    return [
        pytest.param(*case, marks=pytest.mark.requirement(*requirements(case[0])), id=f"{case[0]}-{case[1]}")
        for case in cases
    ]


@pytest.mark.exhaustive
@pytest.mark.requirement("C402-133", "C402-135", "C402-136", "C402-139")
@pytest.mark.parametrize(("method", "place"), marked(CASES))
def test_method_with_switch(make_bench, method, place):
    """Edges, directions, speeds and home position are those of the row, wherever switch, index and start
    lie.
    """
    rng = random.Random(1000 * method + len(place))
    for _ in range(3):
        cam, _, _ = geometry(method, rng)
        zero_mark = rng.randrange(COUNTS)
        start = start_mm(method, place, cam, rng)
        run = home(make_bench(machine(start_mm=start, home=cam, zero_mark=zero_mark)), method)
        check(run, method, ROWS[method][place], cam, zero_mark)


NO_MARK = None
"""Outcome of a run that meets a limit switch before a zero mark."""


def outcomes(edge: float, direction: int, zero_mark: int) -> set[int | None]:
    """Return the zero marks on which a run may end, increments of the shaft.

    The input is sampled: between the edge and the servo instant that shows it lies as much as the axis
    travels meanwhile, at the fast speed on a cam narrower than the way to brake. A zero mark in there may be
    taken or not. When the next one lies behind a limit switch, the search fails (C402-136).
    """
    window = direction * FAST_MM_S * 0.001 * 1.01
    found: set[int | None] = set()
    for place in (edge, edge + window):
        mark = first_mark(place, direction, zero_mark)
        for reach in (mark / COUNTS * LEAD_MM, mark / COUNTS * LEAD_MM + window):
            found.add(mark if reach * direction < LIMIT_MM else NO_MARK)
    return found


@pytest.mark.exhaustive
@pytest.mark.requirement("C402-136")
@settings(deadline=None, max_examples=40)
@given(
    method=st.sampled_from([*range(7, 15), *range(23, 31)]),
    low=st.floats(-38.0, 25.0),
    width=st.floats(0.3, 12.0),
    zero_mark=st.integers(0, COUNTS - 1),
    start=st.floats(-48.0, 48.0),
)
@example(method=7, low=-38.0, width=1.0, zero_mark=697, start=0.0)  # a mark just behind the edge
@example(method=7, low=-38.0, width=1.0, zero_mark=698, start=0.0)  # and one that the edge hides
@example(method=7, low=-38.0, width=1.0, zero_mark=720, start=0.0)  # and one before it
def test_narrow_and_wide_cams_anywhere(make_bench_factory, method, low, width, zero_mark, start):
    """Methods 7 to 14 and 23 to 30 find the same edge on cams that are narrower than the way to brake, from
    anywhere; without a zero mark between it and the limit switch the search fails there.
    """
    cam = (low, low + width)
    run = home(make_bench_factory(machine(start_mm=start, home=cam, zero_mark=zero_mark)), method)
    last = next(iter(ROWS[method].values()))[-1]
    direction = 1 if last[0] == "+" else -1
    edge = home_edge_mm(last, cam)
    assert all(-STOP_MM < position < STOP_MM for _, position, _ in run.samples)
    if method in WITH_INDEX:
        allowed = outcomes(edge, direction, zero_mark)
        if run.statuses[-1] == 0b101:
            assert NO_MARK in allowed
            assert run.edges[-1][1] == ("+ PLS up" if direction > 0 else "- NLS up")
            assert [code for code, _ in run.bench.emcys] == [0x8612]
        else:
            assert run.statuses[-1] == 0b011
            assert run.home_counts in allowed
    else:
        assert run.statuses[-1] == 0b011
        window = FAST_MM_S * 0.001 * 1.01
        behind = direction * (run.home_counts / COUNTS * LEAD_MM - edge)
        assert -1.0 <= behind / LEAD_MM * COUNTS <= window / LEAD_MM * COUNTS + 1.0


@pytest.mark.requirement("C402-126", "C402-133", "C402-135", "C402-139")
@pytest.mark.parametrize("method", [33, 34])
@pytest.mark.parametrize("start", [-17.3, 0.04, 8.81, 31.0])
@pytest.mark.parametrize("zero_mark", [0, 1, 3999, 1234])
def test_method_with_index_alone(make_bench, method, start, zero_mark):
    """33 and 34: slowly to the next zero mark in the direction of the method, latched to the increment."""
    run = home(make_bench(machine(start_mm=start, zero_mark=zero_mark)), method)
    direction = -1 if method == 33 else 1
    assert run.home_counts == first_mark(start, direction, zero_mark)
    assert run.statuses == [0b000, 0b010, 0b011]
    speeds = [velocity * direction for _, _, velocity in run.samples]
    way = abs(run.home_counts / COUNTS * LEAD_MM - start)
    assert max(speeds) <= 1.02 * SLOW_MM_S
    assert way < 1.0 or max(speeds) >= 0.98 * SLOW_MM_S
    assert min(speeds) > -0.3


@pytest.mark.exhaustive
@pytest.mark.requirement("C402-131", "C402-132")
@pytest.mark.parametrize(
    ("method", "side", "index"), [(-1, 1, True), (-2, -1, True), (-3, 1, False), (-4, -1, False)]
)
@pytest.mark.parametrize("retraction", [0, 1000])
@pytest.mark.parametrize("start", [-40.0, 12.0])
def test_method_with_hard_stop(make_bench, method, side, index, retraction, start):
    """-1 to -4: slowly against the stop with the threshold torque; home is there, behind the retraction, or
    at the next zero mark.
    """
    zero_mark = 777
    bench = make_bench(machine(start_mm=start, limits=False, zero_mark=zero_mark))
    bench.write(0x2010, retraction, 3)
    core = bench.drive.core
    torques = []
    run = prepare(bench, method)
    bench.scheduler.every(1_000_000, lambda: torques.append(core.torque * side), priority=6)
    start_of_run = len(run.samples)
    run.command(0x1F)
    bench.until(lambda: run.statuses, 0.1)
    run.to_end()
    mechanics = bench.drive.config.mechanics
    assert run.statuses[-2:] == [0b010, 0b011] or run.statuses[-1] == 0b011
    assert max(velocity * side for _, _, velocity in run.samples) <= SLOW_MM_S * 1.05
    assert max(position * side for _, position, _ in run.samples) > STOP_MM
    # 2010h:1 = 500 permille of 2 Nm, against the spring of the stop, until the way back begins.
    outermost = max(range(len(torques)), key=lambda k: run.samples[start_of_run + k][1] * side)
    assert max(torques[:outermost]) == pytest.approx(1.0, rel=1e-6)
    pressed_mm = 1000.0 * (1.0 * 2 * math.pi / (LEAD_MM / 1000) / mechanics.stop_stiffness_n_per_m)
    stop = side * STOP_MM
    if index:
        assert run.home_counts in {
            first_mark(stop, -side, zero_mark),
            first_mark(stop + side * pressed_mm, -side, zero_mark),
        }
    else:
        wanted = stop + side * pressed_mm - side * retraction * LEAD_MM / COUNTS
        assert run.home_counts / COUNTS * LEAD_MM == pytest.approx(wanted, abs=0.02)
    assert abs(run.samples[-1][2]) < 0.1


@pytest.mark.requirement("C402-131", "C402-132", "C402-141")
def test_meaning_of_the_hard_stop_methods_is_configurable(make_bench):
    """Another manufacturer's -1 and -2: no index; what is not listed is refused."""
    config = machine(
        start_mm=50.0,
        limits=False,
        homing=HomingConfig(
            hard_stop_methods={"-1": "positive", "-2": "negative", "-3": "unsupported", "-4": "unsupported"}
        ),
    )
    bench = make_bench(config)
    assert [bench.read(0x60E3, sub) for sub in range(1, bench.read(0x60E3) + 1)][:3] == [-2, -1, 1]
    run = home(bench, -1)
    assert run.home_counts / COUNTS * LEAD_MM == pytest.approx(STOP_MM, abs=0.1)


@pytest.mark.requirement("C402-139")
@pytest.mark.parametrize("filter_ms", [0.0, 2.0, 7.5])
def test_an_input_filter_delays_the_edge(make_bench, filter_ms):
    """Method 21 latches where the input has been active for the filter time: behind the edge by that time at
    slow speed.
    """
    cam = (-math.inf, 3.0)
    config = machine(start_mm=-2.0, home=cam, servo_us=250, input_filter_ms=filter_ms)
    run = home(make_bench(config), 21)
    late_mm = run.home_counts / COUNTS * LEAD_MM - (cam[1] + HYSTERESIS_MM)
    assert SLOW_MM_S * filter_ms / 1000 - 0.003 <= late_mm
    assert late_mm <= SLOW_MM_S * (filter_ms / 1000 + 0.00025) * 1.02 + 0.003
