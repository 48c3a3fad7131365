"""Buffer modes, continuous motions, relative, additive and modulo moves of an NC axis."""

from itertools import pairwise

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


def test_every_mode_behind_every_other(subtests):
    """Three motions in all pairs of modes, on and back, with an override that goes to 0 and up again: they
    end in their order, none leaves its dynamics or goes beyond a target, and the last one is reached.
    """
    waiting = [mode for mode in BufferMode if mode is not BufferMode.Aborting]
    dynamics = {"Acceleration": 1200.0, "Deceleration": 800.0, "Jerk": 20_000.0}
    for number, (second, third) in enumerate((a, b) for a in waiting for b in waiting):
        targets = ((50.0, 100.0, 20.0), (50.0, -20.0, 30.0), (60.0, 70.0, 75.0))[number % 3]
        velocities = ((170.0, 40.0, 90.0), (90.0, 170.0, 40.0))[number % 2]
        with subtests.test(f"{second.name}, {third.name}", targets=targets, velocities=velocities):
            rig = Rig().enabled()
            blocks = [
                rig.handle.move_absolute(target, Velocity=velocity, BufferMode=mode, **dynamics)
                for target, velocity, mode in zip(
                    targets, velocities, (BufferMode.Aborting, second, third), strict=True
                )
            ]
            rows, ended = [], []
            for cycle in range(4000):
                if cycle % 60 == 30:
                    rig.handle.power(override=(0.0, 100.0, 30.0, 60.0)[cycle // 60 % 4])
                rig.cycles()
                rows.append((rig.generator.s, rig.generator.v, rig.generator.a))
                ended += [one for one in blocks if one.Done and one not in ended]
                if len(ended) == 3:
                    break
            assert ended == blocks
            assert rows[-1][0] == pytest.approx(targets[-1])
            assert min(0.0, *targets) - 1e-6 <= min(row[0] for row in rows)
            assert max(row[0] for row in rows) <= max(targets) + 1e-6
            assert max(abs(v) for _, v, _ in rows) <= max(velocities) + 1e-6
            assert max(abs(a) for *_, a in rows) <= 1200.0 + 1e-6
            assert max(abs(b[2] - a[2]) / T for a, b in pairwise(rows)) <= 20_000.0 * 1.01


def test_override_holds_what_goes_on_behind_its_target(subtests):
    """Behind its target a continuous motion has the share of its end velocity that the override leaves, and
    0 holds it; so it is with a superposed motion.
    """
    for name in ("continuous", "superposed"):
        with subtests.test(name):
            rig = Rig().enabled()
            if name == "continuous":
                rig.handle.move_continuous_absolute(30.0, 60.0, Velocity=100.0, **FAST)
            else:
                rig.handle.move_superimposed(500.0, 60.0, **FAST)
            rig.cycles(300)
            for override, expected in ((100.0, 60.0), (0.0, 0.0), (50.0, 30.0), (100.0, 60.0)):
                rig.handle.power(override=override)
                rig.cycles(150)
                assert rig.axis.motion.v == pytest.approx(expected, abs=1e-6)
            assert rig.status("Compensating") is (name == "superposed")


@pytest.mark.requirement("NC-130")
def test_a_continuous_motion_stops_at_the_limit(subtests):
    """Beyond its target a motion with end velocity goes as far as the software limit, and stands there
    without an error.
    """
    for sign in (1.0, -1.0):
        with subtests.test(sign=sign):
            rig = Rig(
                axis__soft_limit_max_enable=True,
                axis__soft_limit_max=100.0,
                axis__soft_limit_min_enable=True,
                axis__soft_limit_min=-100.0,
            ).enabled()
            move = rig.handle.move_continuous_absolute(sign * 30.0, 60.0, Velocity=100.0, **FAST)
            rig.until(move.in_end_velocity)
            rig.cycles(1500)
            assert rig.axis.motion.s == pytest.approx(sign * 100.0)
            assert move.Busy
            assert not rig.axis.error


def test_what_waits_begins_where_the_others_end():
    """A waiting relative, additive or modulo motion counts from the end of those in front of it, also for
    the software limits.
    """
    limits = {"axis__soft_limit_max_enable": True, "axis__soft_limit_max": 130.0}
    rig = Rig(**limits).enabled()
    rig.handle.move_absolute(20.0, Velocity=100.0, **FAST)
    waits = {"Velocity": 100.0, "BufferMode": BufferMode.Buffered, **FAST}
    first, second, third = (rig.handle.move_relative(50.0, **waits) for _ in range(3))
    rig.cycles(2)
    assert (first.ErrorID, second.ErrorID, third.ErrorID) == (0, 0, 0x4461)
    last = rig.handle.move_additive(10.0, **waits)
    rig.until(last.done)
    assert rig.generator.s == pytest.approx(130.0)
    rig = Rig().enabled()
    rig.handle.move_absolute(100.0, Velocity=200.0, **FAST)
    rig.cycles(20)
    turn = rig.handle.move_modulo(20.0, Direction.POSITIVE, **waits)
    rig.until(turn.done)
    assert rig.generator.s == pytest.approx(380.0)


@pytest.mark.requirement("NC-028")
def test_feed_enable_of_what_no_command_moves(subtests):
    """A superposed motion and external setpoints are stopped too, in the direction without feed enable alone;
    a superposed motion in it is refused.
    """
    for kind in ("superposed", "external"):
        for sign in (1.0, -1.0):
            for positive in (True, False):
                with subtests.test(kind, sign=sign, positive=positive):
                    rig = Rig().enabled()
                    if kind == "superposed":
                        rig.handle.move_superimposed(sign * 500.0, 40.0, **FAST)
                    else:
                        rig.handle.external_enable(0.0, start_type=2)
                        packet = rig.ref.PlcToNc
                        packet.ExtSetDirection = int(sign)

                        def feed(packet=packet, sign=sign):
                            packet.ExtSetPos += sign * 40.0 * T
                            packet.ExtSetVelo = sign * 40.0

                        rig.runtime.call(feed)
                    rig.cycles(100)
                    assert rig.axis.motion.v == pytest.approx(sign * 40.0)
                    rig.handle.power(positive=positive, negative=not positive)
                    rig.cycles(600)
                    allowed = positive is (sign > 0.0)
                    assert (rig.axis.motion.v == 0.0) is not allowed
                    missing = [entry for entry in rig.history.events if entry.kind == "axis.feed_missing"]
                    assert len(missing) == (0 if allowed else 1)
    rig = Rig().enabled()
    rig.handle.power(positive=False)
    rig.cycles(2)
    refused = rig.handle.move_superimposed(50.0, 40.0)
    rig.cycles(2)
    assert refused.ErrorID == 0x4358


@pytest.mark.requirement("NC-113")
def test_fast_stop_of_what_no_command_moves(subtests):
    """The fast axis stop brakes a slave, which leaves its master, a superposed motion and external setpoints
    as well.
    """
    for kind in ("slave", "superposed"):
        with subtests.test(kind):
            rig = Rig(
                axis__fast_axis_stop_signal_type="Rising Edge",
                axis__fast_deceleration=8000.0,
                axis__fast_jerk=1e6,
            )
            rig.enabled()
            if kind == "slave":
                master = Rig(with_=rig).enabled()
                rig.handle.gear_in(master.handle)
                master.handle.move_velocity(100.0, **FAST)
            else:
                rig.handle.move_superimposed(500.0, 100.0, **FAST)
            rig.cycles(200)
            assert rig.axis.motion.v == pytest.approx(100.0)
            rig.device.fast_stop = True
            rig.cycles(100 if kind == "slave" else 300)
            assert rig.axis.motion.v == pytest.approx(0.0)
            assert rig.axis.coupling.master is None
            assert not rig.axis.error
