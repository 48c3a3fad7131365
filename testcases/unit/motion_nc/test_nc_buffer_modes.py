"""Buffer modes, continuous motions, relative, additive and modulo moves of an NC axis."""

import pytest

from motion.nc.blocks import MC_MoveAbsolute
from motion.nc.commands import BufferMode
from motion.nc.modulo import Direction
from testcases.unit.motion_nc.nc_rig import Rig, T

pytestmark = pytest.mark.exhaustive
FAST = {"Acceleration": 2000.0, "Deceleration": 2000.0, "Jerk": 1e6}


def _passing(rig, place, done):
    """Return the velocity at which the set position passes a place, and the lowest position after that."""
    before, lowest, passed = rig.generator.s, None, None
    for _ in range(5000):
        if done():
            break
        rig.cycles()
        s = rig.generator.s
        if passed is None and before < place <= s:
            passed = rig.generator.v
        if passed is not None:
            lowest = s if lowest is None else min(lowest, s)
        before = s
    return passed, lowest


def test_buffer_modes(subtests):
    """The second command takes over at the target of the first, with the velocity that the mode says."""
    for mode, expected in (
        (BufferMode.Buffered, 0.0),
        (BufferMode.BlendingLow, 100.0),
        (BufferMode.BlendingPrevious, 200.0),
        (BufferMode.BlendingNext, 100.0),
        (BufferMode.BlendingHigh, 200.0),
    ):
        with subtests.test(mode=mode.name):
            rig = Rig().enabled()
            first = rig.handle.move_absolute(100.0, Velocity=200.0, **FAST)
            rig.cycles(2)
            second = rig.handle.move_absolute(200.0, Velocity=100.0, BufferMode=mode, **FAST)
            rig.cycles(2)
            assert rig.status("CmdBuffered")
            assert second.Busy
            assert not second.Active
            passed, _ = _passing(rig, 100.0, second.done)
            assert passed == pytest.approx(expected, abs=2000.0 * T + 1e-6)
            assert first.Done
            assert rig.generator.s == 200.0
            assert not rig.status("CmdBuffered")


def test_opposite_directions_do_not_blend():
    """A blending command back stops at the target of the first."""
    rig = Rig().enabled()
    rig.handle.move_absolute(100.0, Velocity=200.0, **FAST)
    rig.cycles(2)
    second = rig.handle.move_absolute(0.0, Velocity=100.0, BufferMode=BufferMode.BlendingHigh, **FAST)
    highest = 0.0
    for _ in range(5000):
        if second.done():
            break
        rig.cycles()
        highest = max(highest, rig.generator.s)
    assert highest == pytest.approx(100.0)
    assert rig.generator.s == 0.0


def test_aborting():
    """A command with mode Aborting takes over at once, and ends what waits too."""
    rig = Rig().enabled()
    first = rig.handle.move_absolute(500.0, Velocity=100.0)
    rig.cycles(2)
    waiting = rig.handle.move_absolute(600.0, Velocity=100.0, BufferMode=BufferMode.Buffered)
    rig.cycles(200)
    third = rig.handle.move_absolute(10.0, Velocity=100.0)
    rig.until(third.done)
    assert first.CommandAborted
    assert waiting.CommandAborted
    assert rig.generator.s == 10.0


def test_continuous_motion(subtests):
    """The target is passed with the end velocity, faster or slower than before, and the axis goes on with
    it.
    """
    for end in (0.0, 50.0, 300.0):
        for absolute in (True, False):
            with subtests.test(end=end, absolute=absolute):
                rig = Rig().enabled()
                start = (
                    rig.handle.move_continuous_absolute if absolute else rig.handle.move_continuous_relative
                )
                move = start(200.0, end, Velocity=150.0, **FAST)
                passed, _ = _passing(rig, 199.5, move.in_end_velocity)
                if passed is not None:
                    assert passed == pytest.approx(end, abs=50.0)
                rig.cycles(50)
                assert rig.generator.v == pytest.approx(end)
                assert move.Busy
                if end:
                    assert rig.generator.s > 200.0
                else:
                    assert rig.generator.s == pytest.approx(200.0, abs=0.5)


def test_relative_and_additive():
    """A relative move counts from the set position at which it begins, an additive one from the last
    target.
    """
    rig = Rig().enabled()
    rig.handle.move_absolute(100.0, Velocity=100.0)
    rig.cycles(300)
    at = rig.generator.s
    assert 0.0 < at < 100.0
    rig.until(rig.handle.move_additive(10.0, Velocity=100.0).done)
    assert rig.generator.s == pytest.approx(110.0)
    rig.until(rig.handle.move_relative(-10.0, Velocity=100.0).done)
    assert rig.generator.s == pytest.approx(100.0)


@pytest.mark.requirement("NC-255", "NC-678")
def test_modulo_move():
    """MC_MoveModulo takes factor and tolerance window from the encoder; an impossible target is an error."""
    settings = {"enc__modulo_factor": 360.0, "enc__modulo_tolerance_window": 1.0}
    for start, way in ((90.9, -0.9), (91.1, 358.9)):
        rig = Rig(**settings).enabled()
        rig.until(rig.handle.set_position(start).done)
        rig.cycles(2)
        begin = rig.generator.s
        move = rig.handle.move_modulo(90.0, Velocity=500.0)
        rig.until(move.done)
        assert rig.generator.s - begin == pytest.approx(way, abs=0.01)
    refused = rig.handle.move_modulo(400.0, Direction.SHORTEST, Velocity=500.0)
    rig.cycles(2)
    assert refused.ErrorID == 0x4B06


def test_a_second_start():
    """A block starts again at the next rising edge, with the inputs of then."""
    rig = Rig().enabled()
    move = rig.handle.run(MC_MoveAbsolute(rig.ref, Execute=True, Position=10.0, Velocity=100.0))
    rig.until(move.done)
    rig.cycles(5)
    assert move.Done
    move.set(Execute=False)
    rig.cycles(2)
    assert not move.Done
    move.set(Execute=True, Position=0.0)
    rig.until(move.done)
    assert rig.generator.s == 0.0
