"""Linear coupling of NC axes, propagation of errors, coupling to actual values."""

from itertools import pairwise

import pytest

from testcases.unit.motion_nc.nc_rig import Rig, T

pytestmark = pytest.mark.exhaustive


class Pair:
    """A master and its slave."""

    def __init__(self, ratio=2.0, master=None, couple=True, **slave):
        self.master = Rig(**(master or {})).enabled()
        self.slave = Rig(with_=self.master, **slave).enabled()
        if couple:
            self.gear = self.slave.handle.gear_in(self.master.handle, ratio, 1.0)
            self.master.until(self.gear.in_gear)

    def cycles(self, count=1):
        self.master.cycles(count)


@pytest.mark.requirement("NC-094", "NC-473", "NC-445", "NC-465", "NC-033")
def test_gear():
    """The slave goes the way of the master times the ratio, without a check of its maxima; states show who
    is what.
    """
    pair = Pair(2.0, axis__maximum_velocity=100.0)
    pair.cycles(2)
    assert pair.master.ref.NcToPlc.CoupleState == 1
    assert pair.slave.ref.NcToPlc.CoupleState == 3
    assert pair.slave.ref.NcToPlc.AxisState == 13
    assert pair.slave.status("Protected")
    assert not pair.slave.status("PTPmode")
    assert pair.master.status("PTPmode")
    assert not pair.master.status("Protected")
    move = pair.master.handle.move_absolute(100.0, Velocity=150.0)
    fastest = 0.0
    while not move.done():
        pair.cycles()
        assert pair.slave.axis.motion.s == pytest.approx(2.0 * pair.master.axis.motion.s, abs=1e-9)
        fastest = max(fastest, pair.slave.axis.motion.v)
    assert fastest > 200.0
    assert pair.slave.axis.position == pytest.approx(200.0, abs=0.1)
    third = Rig(with_=pair.master).enabled()
    pair.master.until(third.handle.gear_in(pair.slave.handle, -0.5).in_gear)
    pair.cycles(2)
    assert pair.slave.ref.NcToPlc.CoupleState == 2
    pair.master.until(pair.master.handle.move_relative(10.0, Velocity=50.0).done)
    assert third.axis.motion.s == pytest.approx(-10.0)
    circle = pair.master.handle.gear_in(third.handle)
    pair.cycles(2)
    assert circle.Error


@pytest.mark.requirement("NC-244")
def test_ratio_and_decoupling():
    """The ratio changes while coupled without a jump; the slave leaves with its velocity."""
    pair = Pair(1.0)
    pair.master.until(pair.master.handle.move_velocity(50.0).in_velocity)
    before = pair.slave.axis.motion.s
    pair.slave.handle.gear_in(pair.master.handle, 3.0)
    pair.cycles(2)
    assert pair.slave.axis.motion.s == pytest.approx(before, abs=0.5)
    assert pair.slave.axis.motion.v == pytest.approx(150.0)
    pair.master.until(pair.slave.handle.gear_out().done)
    pair.cycles(10)
    assert pair.slave.ref.NcToPlc.CoupleState == 0
    assert pair.slave.generator.v == pytest.approx(150.0)
    assert pair.gear.CommandAborted


@pytest.mark.requirement("NC-036", "NC-202", "NC-214", "NC-215")
def test_commands_to_a_slave():
    """A stop leaves the coupling first; another command does so where it is allowed, and is refused
    elsewhere.
    """
    pair = Pair(1.0)
    pair.master.until(pair.master.handle.move_velocity(50.0).in_velocity)
    stop = pair.slave.handle.stop(Deceleration=500.0, Jerk=50_000.0)
    velocities = [pair.slave.generator.v]
    for _ in range(200):
        pair.cycles(1)
        velocities.append(pair.slave.generator.v)
    assert stop.done()
    assert velocities[0] == 50.0
    assert max(a - b for a, b in pairwise(velocities)) <= 500.0 * T + 1e-9  # its own ramp
    assert pair.slave.generator.v == 0.0
    assert pair.master.generator.v == 50.0
    assert pair.slave.ref.NcToPlc.CoupleState == 0
    for allowed in (True, False):
        pair = Pair(1.0, axis__allow_commands_slave=allowed)
        move = pair.slave.handle.move_absolute(10.0, Velocity=50.0)
        pair.cycles(3)
        assert move.Error is not allowed
        assert pair.slave.ref.NcToPlc.CoupleState == (0 if allowed else 3)
        if allowed:
            pair.master.until(move.done)


@pytest.mark.requirement("NC-197", "NC-198", "NC-210", "NC-211", "NC-212", "NC-739", "NC-782", "NC-446")
def test_error_propagation(subtests):
    """An error of a slave reaches its master at once, or after the delay unless it is decoupled before; one
    of the master reaches its slaves at once.
    """
    for mode, delay, decoupled_after, expected in (
        ("INSTANTANEOUS", 0.5, None, 0.0),
        ("DELAYED", 0.0, None, 0.0),
        ("DELAYED", 0.5, None, 0.5),
        ("DELAYED", 0.5, 0.3, None),
    ):
        with subtests.test(mode=mode, delay=delay, decoupled_after=decoupled_after):
            pair = Pair(axis__error_propagation_mode=mode, axis__error_propagation_delay=delay)
            pair.master.until(pair.master.handle.move_velocity(50.0).in_velocity)
            pair.slave.axis.raise_error(0x4550)
            assert pair.slave.handle.error_id == 0x4550
            reached = None
            for cycle in range(400):
                if decoupled_after is not None and cycle == round(decoupled_after / T):
                    pair.slave.handle.gear_out()
                pair.cycles()
                if pair.master.axis.error:
                    reached = cycle * T
                    break
                if expected and mode == "DELAYED" and cycle > 1:
                    assert pair.slave.status("ErrorPropagationDelayed")
            if expected is None:
                assert reached is None
                assert pair.master.generator.v == 50.0
                assert not pair.slave.status("ErrorPropagationDelayed")
            else:
                assert reached == pytest.approx(expected, abs=2 * T)
                assert pair.master.handle.error_id == 0x43A0
    pair = Pair()
    pair.master.axis.raise_error(0x4550)
    pair.cycles(2)
    assert pair.slave.handle.error_id == 0x43A0


@pytest.mark.requirement("NC-199", "NC-200", "NC-201", "NC-213", "NC-783")
def test_pushed_master(subtests):
    """A disabled master moved by hand takes its slave along where the parameter says so, within the
    velocity window.
    """
    for follows in (False, True):
        with subtests.test(follows=follows):
            pair = Pair(2.0, axis__couple_slave_to_actual=follows, axis__couple_velocity_window=1000.0)
            pair.master.handle.power(False)
            pair.cycles(3)
            for _ in range(1000):
                pair.master.device.position += 0.01
                pair.cycles()
            assert pair.slave.axis.motion.s == pytest.approx(20.0 if follows else 0.0, abs=0.05)
            assert not pair.slave.axis.error
            if not follows:
                pair.master.enabled()
                pair.cycles(5)
                assert pair.slave.axis.motion.s == pytest.approx(0.0, abs=1e-6)
    for deviation, cycles, error in ((0.9, 400, 0), (1.1, 5, 0), (1.1, 6, 0x4551)):
        with subtests.test(deviation=deviation, cycles=cycles):
            pair = Pair(
                1.0,
                master={"enc__filter_time_velocity": 0.0},
                axis__couple_slave_to_actual=True,
                enc__filter_time_velocity=0.0,
                enc__scaling_numerator=0.0000001,
            )
            pair.master.handle.power(False)
            pair.cycles(3)
            pair.slave.device.frozen = True
            for _ in range(cycles):
                pair.master.device.position += deviation * T
                pair.cycles()
            pair.slave.device.frozen = False
            pair.cycles(3)
            assert pair.slave.handle.error_id == error


@pytest.mark.requirement("NC-553", "NC-555")
def test_coupling_control():
    """The additional controller acts on the difference of the following errors, and makes it smaller."""
    pair = Pair(1.0, master={"ctrl__pos_kv": 0.0}, ctrl__pos_kv=0.0, ctrl__kcp=5.0)
    pair.master.device.position -= 0.4
    pair.slave.device.position -= 0.1
    pair.cycles(1)
    assert abs(pair.slave.device.velocity) == pytest.approx(1.5, abs=0.02)
    pair.cycles(500)
    assert pair.slave.axis.following_error == pytest.approx(0.4, abs=0.01)
    pair.slave.handle.write_parameter("ctrl.kcp", 0.0)
    pair.slave.device.position -= 0.1
    pair.cycles(1)
    assert pair.slave.device.velocity == 0.0
