"""Backlash compensation and homing: what is touched when the position is set, and after power-on (§5.11.11,
CFG section 26.4).
"""

from __future__ import annotations

from math import tau

import pytest

from motion.drives.port import INPUT_HOME
from testcases.unit.motion_axis.test_backlash import SIZE, move, rig_of

ABSOLUTE = {"Sensor[1].Type": 1}


def absolute(make_rig, direction, *, ways):
    """Return a rig whose absolute encoder is adjusted to 100 after `ways`, mm, and has been without supply
    since.
    """
    rig = rig_of(
        lambda variables: make_rig(variables=variables | ABSOLUTE),
        homed=False,
        DirectionAbsoluteHoming=direction,
    )
    for way in ways:
        move(rig, way)
    rig.until(rig.axis.home(100.0, mode=7).done)
    rig.origin = rig.load.position - 100.0
    return rig


def power_cycle(rig, *, turned=0.0):
    """Switch the controller off and on; the shaft is turned by `turned`, mm of the axis, meanwhile."""
    rig.until(rig.axis.power(False).off)
    axis = rig.axis.object
    rig.port.turn(turned / 10.0 * tau)
    axis.variables.power_cycle()
    axis.apply_configuration(powered_off=True)
    rig.cycles(3)
    rig.load.follow()
    rig.enabled()


def error(rig):
    """Return by how much the axis shows more than the place of the load."""
    return rig.axis.var("ActualPosition") - (rig.load.position - rig.origin)


class TestAbsoluteEncoder:
    """`DirectionAbsoluteHoming` says which flank was touched at the adjustment."""

    @pytest.mark.requirement("HOM-065", "HOM-174", "HOM-175", "CFG-568", "CFG-550")
    @pytest.mark.parametrize(("direction", "ways", "first"), [(0, (5.0,), -10.0), (1, (5.0, -5.0), 10.0)])
    def test_first_motion_against_it(self, make_rig, direction, ways, first):
        """After power-on the axis is homed, and the first motion against that direction travels the backlash
        as well.
        """
        rig = absolute(make_rig, direction, ways=ways)
        power_cycle(rig)
        assert rig.axis.var("StatusWord.X5")
        assert rig.axis.var("ActualPosition") == pytest.approx(100.0, abs=0.005)
        motor = rig.load.motor
        move(rig, first)
        assert abs(rig.load.motor - motor) == pytest.approx(10.0 + SIZE, abs=0.005)
        assert rig.load.position - rig.origin == pytest.approx(100.0 + first, abs=0.005)

    @pytest.mark.requirement("CFG-568", "CFG-550")
    @pytest.mark.parametrize(("direction", "ways", "first"), [(0, (5.0,), 10.0), (1, (5.0, -5.0), -10.0)])
    def test_first_motion_along_it(self, make_rig, direction, ways, first):
        """In that direction it travels the distance alone."""
        rig = absolute(make_rig, direction, ways=ways)
        power_cycle(rig)
        motor = rig.load.motor
        move(rig, first)
        assert abs(rig.load.motor - motor) == pytest.approx(10.0, abs=0.005)
        assert error(rig) == pytest.approx(0.0, abs=0.005)

    @pytest.mark.requirement("HOM-065", "HOM-174", "CFG-568")
    def test_another_direction_than_configured(self, make_rig):
        """Adjusted after negative motion with a positive direction configured, the load misses its place by
        the backlash.
        """
        rig = absolute(make_rig, 0, ways=(5.0, -5.0))
        power_cycle(rig)
        move(rig, -10.0)
        assert abs(error(rig)) == pytest.approx(SIZE, abs=0.005)

    @pytest.mark.requirement("HOM-176", "CFG-568")
    def test_turned_while_off(self, make_rig):
        """Another flank at power-on than at the adjustment: wrong by the backlash, until the axis has
        travelled that far.
        """
        rig = absolute(make_rig, 0, ways=(5.0,))
        power_cycle(rig, turned=-SIZE)
        assert error(rig) == pytest.approx(-SIZE, abs=0.005)
        move(rig, 5.0)
        assert error(rig) == pytest.approx(0.0, abs=0.005)

    @pytest.mark.exhaustive
    @pytest.mark.requirement("CFG-564", "CFG-568")
    def test_without_adjustment(self, make_rig):
        """An absolute encoder that was never adjusted waits for the whole backlash, and its first value is no
        motion.
        """
        rig = rig_of(lambda variables: make_rig(variables=variables | ABSOLUTE), homed=False)
        rig.until(rig.axis.power(False).off)
        rig.port.turn(3.0 * tau)
        rig.axis.object.apply_configuration(powered_off=True)
        rig.cycles(3)
        rig.load.position = rig.load.motor
        rig.enabled()
        motor = rig.load.motor
        move(rig, -SIZE / 2)
        move(rig, SIZE / 2)
        assert rig.load.motor == pytest.approx(motor, abs=0.005)


class TestDirectHoming:
    """Setting the position where the axis stands."""

    @pytest.mark.requirement("CFG-567", "CFG-569")
    @pytest.mark.parametrize("mode", [0, 13])
    @pytest.mark.parametrize("way", [5.0, -5.0])
    def test_after_motion_in_one_direction(self, make_rig, mode, way):
        """With the backlash passed the same place of the load is set from either direction, and holds after
        reversals.
        """
        rig = rig_of(make_rig, homed=False)
        move(rig, way)
        rig.until(rig.axis.home(100.0, mode=mode).done)
        rig.origin = rig.load.position - 100.0
        for distance in (7.0, -12.0, 3.0):
            move(rig, distance)
            assert error(rig) == pytest.approx(0.0, abs=0.005)

    @pytest.mark.requirement("CFG-567", "CFG-569")
    @pytest.mark.parametrize("mode", [0, 13])
    def test_within_the_backlash(self, make_rig, mode):
        """Set while the motor stands somewhere in the backlash, the position is wrong by what was not
        passed.
        """
        rig = rig_of(make_rig, homed=False)
        rig.load.position = rig.load.motor + SIZE
        move(rig, SIZE / 2)
        rig.until(rig.axis.home(100.0, mode=mode).done)
        rig.origin = rig.load.position - 100.0
        move(rig, 5.0)
        assert error(rig) == pytest.approx(SIZE / 2, abs=0.005)


class TestActiveHoming:
    """A search for the edge of a cam that the load passes."""

    def homed(self, make_rig, before, **backlash):
        """Return a rig that has moved by `before` and then searched the edge at 20 mm of the load in positive
        direction.
        """
        search = {
            "Sensor[1].ActiveHoming.Mode": 2,
            "Homing.ApproachVelocity": 20.0,
            "Homing.ReferencingVelocity": 5.0,
            "Sensor[1].ActiveHoming.SwitchLevel": True,
        }
        rig = rig_of(lambda variables: make_rig(variables=variables | search), homed=False, **backlash)

        def cam():
            rig.port.switches = INPUT_HOME if rig.load.position >= 20.0 else 0

        rig.runtime.after_cycle.append(cam)
        for way in before:
            move(rig, way)
        job = rig.axis.home(50.0, mode=3)
        rig.until(job.done, 20.0)
        rig.run(0.2)
        rig.origin = 20.0 - 50.0
        return rig

    @pytest.mark.requirement("CFG-566")
    @pytest.mark.parametrize("before", [(5.0,), (-5.0,), (5.0, -5.0)])
    def test_same_edge_from_any_flank(self, make_rig, before):
        """Whatever was moved before: the backlash is passed on the way to the edge, and the place of the load
        is the same.
        """
        rig = self.homed(make_rig, before)
        assert error(rig) == pytest.approx(0.0, abs=0.09)  # the cam is looked at once per cycle
        shown = error(rig)
        for distance in (-8.0, 5.0):
            move(rig, distance)
            assert error(rig) == pytest.approx(shown, abs=0.005)
