"""Properties of NC axes: modulo ways, setpoints within their limits whatever is commanded, the watchdog in
every phase.
"""

from itertools import pairwise
from math import ceil, floor

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from motion.nc.commands import CONTINUOUS, ENDLESS, POSITION, STOP, BufferMode, Command, CommandState
from motion.nc.modulo import Direction, ModuloTargetError, modulo_distance, modulo_move
from motion.nc.motion import Motion
from motion.nc.parameters import ParameterSet
from testcases.unit.motion_nc.nc_rig import Rig, T

pytestmark = pytest.mark.exhaustive

PLACES = st.integers(-4000, 4000).map(lambda number: number / 10.0)


def _ways(start, target, factor, direction, tolerance):
    """Return the ways that end at a modulo position, the best first: by search among all turns."""
    first = ceil((start - 3 * factor - target) / factor)
    last = floor((start + 3 * factor - target) / factor)
    ways = [target + turn * factor - start for turn in range(first, last + 1)]
    near = min(ways, key=lambda way: (round(abs(way), 9), -way))
    if direction is Direction.SHORTEST or abs(near) <= tolerance + 1e-9:
        return near
    if direction is Direction.POSITIVE:
        return min(way for way in ways if way > -1e-9)
    return max(way for way in ways if way < 1e-9)


@pytest.mark.requirement("NC-682", "NC-684")
@settings(max_examples=150, deadline=None, derandomize=True, database=None)
@given(
    start=PLACES,
    share=st.integers(0, 999),
    factor=st.sampled_from([100.0, 360.0, 1000.0]),
    tolerance=st.sampled_from([0.0, 0.1, 1.0, 10.0]),
    direction=st.sampled_from([Direction.POSITIVE, Direction.NEGATIVE, Direction.SHORTEST]),
    turns=st.integers(0, 3),
)
def test_modulo_ways(start, share, factor, tolerance, direction, turns):
    """The way ends at the modulo position; it is the shortest in its direction, or against it within the
    tolerance, half a turn goes forwards; turns are added in the direction, the shortest way has none.
    """
    target = share * factor / 1000.0
    if direction is Direction.SHORTEST and turns:
        with pytest.raises(ModuloTargetError, match="turns"):
            modulo_distance(
                start, target, factor=factor, tolerance=tolerance, direction=direction, turns=turns
            )
        turns = 0
    way = modulo_distance(start, target, factor=factor, tolerance=tolerance, direction=direction, turns=turns)
    sign = -1.0 if direction is Direction.NEGATIVE else 1.0
    expected = _ways(start, target, factor, direction, tolerance) + sign * turns * factor
    assert way == pytest.approx(expected, abs=1e-6)
    if direction is not Direction.SHORTEST:
        moved = modulo_move(
            start, target + turns * factor, factor=factor, tolerance=tolerance, direction=direction
        )
        assert moved == pytest.approx(way, abs=1e-6)


COMMANDS = st.builds(
    dict,
    kind=st.sampled_from([POSITION, POSITION, POSITION, CONTINUOUS, ENDLESS, STOP]),
    velocity=st.sampled_from([5.0, 40.0, 120.0, 300.0]),
    acceleration=st.sampled_from([300.0, 2000.0]),
    deceleration=st.sampled_from([400.0, 1500.0]),
    jerk=st.sampled_from([5000.0, 50_000.0]),
    place=st.integers(-20, 20).map(lambda number: number * 5.0),
    buffer_mode=st.sampled_from(list(BufferMode)),
    after=st.integers(1, 120),
    override=st.sampled_from([None, None, 0.0, 0.3, 1.0]),
)


@settings(max_examples=60, deadline=None, derandomize=True, database=None)
@given(commands=st.lists(COMMANDS, min_size=1, max_size=5))
def test_setpoints_keep_every_limit(commands):
    """Whatever is commanded, in whatever buffer mode and with whatever override: position, velocity and
    acceleration are continuous, none is above what a command has allowed, an override of 0 holds the axis,
    and with one of 100 % every command ends or goes on.
    """
    motion = Motion(ParameterSet(), cycle_s=T)
    given, rows = [], []

    def cycle():
        motion.step()
        if motion.active is not None:
            motion.finish(motion.active, arrived=motion.arrived, in_target=True)
        rows.append((motion.s, motion.v, motion.a))

    for one in commands:
        rates = {key: one[key] for key in ("velocity", "acceleration", "deceleration", "jerk")}
        kind = one["kind"]
        command = Command(
            kind,
            target=(1.0 if one["place"] >= 0.0 else -1.0) if kind == ENDLESS else one["place"],
            end_velocity=0.5 * one["velocity"] if kind == CONTINUOUS else 0.0,
            buffer_mode=one["buffer_mode"],
            **rates,
        )
        motion.submit(command)
        given.append(command)
        for _ in range(one["after"]):
            cycle()
        if one["override"] is not None:
            motion.set_override(one["override"])
    motion.set_override(0.0)
    for _ in range(700):
        cycle()
    assert motion.v == pytest.approx(0.0, abs=1e-6)
    motion.set_override(1.0)
    for _ in range(16_000 if max(abs(one["place"]) for one in commands) else 2000):
        if motion.active is None:
            break
        if not motion.queue and motion.active.in_velocity:
            break
        cycle()
    for command in given[:-1]:
        ended = command.state in {CommandState.DONE, CommandState.ABORTED}
        assert ended or motion.active is command or command in motion.queue
    fastest = max(command.velocity for command in given)
    steepest = max(max(command.acceleration, command.deceleration) for command in given)
    sharpest = max(command.jerk for command in given)
    assert max(abs(v) for _, v, _ in rows) <= fastest * (1.0 + 1e-6)
    assert max(abs(a) for *_, a in rows) <= steepest * (1.0 + 1e-6)
    assert max(abs(b[2] - a[2]) for a, b in pairwise(rows)) <= sharpest * T * 1.001
    for before, after in pairwise(rows):
        assert abs(after[0] - before[0] - 0.5 * (before[1] + after[1]) * T) <= sharpest * T**3 + 1e-9


PHASES = {
    "standstill": lambda rig: None,
    "accelerating": lambda rig: (rig.handle.move_velocity(100.0), rig.cycles(40)),
    "constant": lambda rig: rig.until(rig.handle.move_velocity(-100.0).in_velocity),
    "braking": lambda rig: (
        rig.until(rig.handle.move_velocity(100.0).in_velocity),
        rig.handle.halt(),
        rig.cycles(30),
    ),
    "positioning": lambda rig: (rig.handle.move_absolute(50.0, Velocity=80.0), rig.cycles(150)),
    "locked": lambda rig: rig.until(rig.handle.stop().done),
    "superposed": lambda rig: (rig.handle.move_superimposed(50.0, 40.0), rig.cycles(100)),
    "external": lambda rig: (rig.handle.external_enable(10.0), rig.cycles(5)),
    "homing": lambda rig: (rig.handle.home(), rig.cycles(300)),
}
LOSES = {"accelerating", "constant", "braking", "positioning", "locked", "superposed", "homing"}
"""Phases in which a command is active."""


@pytest.mark.requirement("NC-016", "NC-017", "NC-022")
def test_the_watchdog_in_every_phase(subtests):
    """Whatever the axis does, and however often the PLC is called: N of its cycles without fresh data clear
    the interface, not one fewer; the axis has no output, an active command ends with 4356h, and nothing
    goes on when the PLC runs again. With 0 nothing is cleared.
    """
    for number, (phase, begin) in enumerate(PHASES.items()):
        for n, plc_cycles in ((4, 1), (2, 3), (0, 1))[: 2 + (number % 3 == 0)]:
            with subtests.test(phase, n=n, plc_cycles=plc_cycles):
                rig = Rig(task__watchdog_cycles=n, plc_cycles=plc_cycles).enabled()
                begin(rig)
                while rig.runtime.cycles % plc_cycles:
                    rig.cycles()
                rig.runtime.plc_running = False
                rig.cycles(1 + n * plc_cycles)
                assert rig.axis.plc_to_nc.ControlDWord & 0x7 == 0x7
                rig.cycles(1)
                if not n:
                    rig.cycles(200)
                    assert rig.axis.plc_to_nc.ControlDWord & 0x7 == 0x7
                    assert rig.axis.operational
                    continue
                assert rig.axis.plc_to_nc.pack() == bytes(128)
                rig.cycles(3)
                assert not rig.axis.operational
                assert rig.device.velocity == 0.0
                assert rig.axis.error_id == (0x4356 if phase in LOSES else 0)
                place = rig.axis.position
                rig.runtime.plc_running = True
                rig.cycles(200)
                assert rig.axis.position == pytest.approx(place, abs=1e-3)
                assert rig.axis.motion.active is None
