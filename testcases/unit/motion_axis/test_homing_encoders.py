"""What homing does to the encoders of an axis, absolute ones and several of them (§5.11.5 to §5.11.9)."""

from __future__ import annotations

import pytest

from testcases.unit.motion_axis.test_backlash import move, rig_of
from testcases.unit.motion_axis.test_sensors import Rig as Encoders

ABSOLUTE = {"Sensor[1].Type": 1}


def home(rig, position, *, mode, sensor=0):
    job = rig.axis.home(position, mode=mode, sensor=sensor)
    rig.until(job.done)
    rig.cycles(2)
    return job


def offset(rig, number=1):
    return rig.axis.var(f"StatusSensor[{number}].AbsEncoderOffset")


class TestSeveral:
    """Encoders 1 and 2 on one shaft."""

    @pytest.mark.requirement("HOM-141", "HOM-001", "HOM-002", "MC-199", "MC-200", "HOM-139")
    @pytest.mark.parametrize(("mode", "shown"), [(0, 100.0), (1, 100.0), (11, 100.0), (12, 100.0)])
    def test_direct_homing_shifts_all(self, mode, shown):
        """Encoder 2 reads 0.3 more than encoder 1, before and after."""
        rig = Encoders(ahead=(0.3,), types=(0, 0))
        rig.axis.sensors[1].transfer(rig.shown(1) + 0.3)
        home(rig, 100.0, mode=mode)
        assert rig.shown(1) == pytest.approx(shown)
        assert rig.shown(2) == pytest.approx(shown + 0.3)

    @pytest.mark.requirement("HOM-163", "HOM-165", "HOM-151", "HOM-014", "MC-195", "MC-212", "HOM-020")
    @pytest.mark.parametrize(("sensor", "homed"), [(0, True), (1, True), (2, False)])
    def test_incremental_adjustment(self, sensor, homed):
        """Mode 13 sets the encoder that is named and no other; X5 follows the operative one only."""
        rig = Encoders(types=(0, 0))
        home(rig, 25.0, mode=13, sensor=sensor)
        number = sensor or 1
        assert rig.shown(number) == pytest.approx(25.0)
        assert rig.shown(3 - number) == pytest.approx(0.0)
        assert rig.axis.var("StatusWord.X5") is homed
        assert rig.axis.var(f"StatusSensor[{number}].Adjusted") == 1
        assert rig.axis.var(f"StatusSensor[{3 - number}].Adjusted") == 0

    @pytest.mark.requirement(
        "HOM-150", "HOM-151", "HOM-149", "HOM-148", "HOM-007", "HOM-008", "MC-205", "MC-206", "HOM-063"
    )
    @pytest.mark.parametrize(("mode", "shown"), [(6, 80.0), (7, 50.0)])
    def test_absolute_adjustment_of_another_encoder(self, mode, shown):
        """Encoder 2 shows 30: shifted by 50 or set to 50, with its offset kept; the axis is not homed by
        that.
        """
        rig = Encoders(ahead=(30.0,), types=(0, 1))
        home(rig, 50.0, mode=mode, sensor=2)
        assert rig.shown(2) == pytest.approx(shown, abs=0.001)
        assert offset(rig, 2) == pytest.approx(shown - 30.0, abs=0.001)
        assert rig.axis.var("StatusWord.X5") is False
        assert rig.axis.var("StatusSensor[2].Adjusted") == 1
        assert rig.shown(1) == 0.0

    @pytest.mark.requirement("HOM-021", "MC-011")
    def test_type_of_the_named_encoder_counts(self):
        """Mode 7 for an incremental second encoder: 16#8010; mode 13 for an absolute one: 16#8011."""
        for types, mode, error in (((1, 0), 7, 0x8010), ((0, 1), 13, 0x8011)):
            rig = Encoders(types=types)
            job = rig.axis.home(0.0, mode=mode, sensor=2)
            rig.cycles(2)
            assert job.ErrorID == error


class TestAbsolute:
    """One absolute encoder; what is kept over power-off is `AbsEncoderOffset`."""

    @pytest.mark.exhaustive
    @pytest.mark.requirement("HOM-087", "HOM-088", "HOM-133", "MC-213")
    @pytest.mark.parametrize("mode", [3, 8])
    def test_first_homing_is_kept(self, make_rig, mode):
        """Without a kept offset homing keeps the one that it finds; the next one shifts the position and
        leaves it.
        """
        rig = make_rig(variables=ABSOLUTE).enabled()
        first = rig.axis.home(500.0, mode=mode)
        if mode == 8:
            rig.axis.move_velocity(100.0)
        rig.until(first.done, 20.0)
        rig.cycles(2)
        kept = offset(rig)
        assert kept == pytest.approx(500.0 - 150.0, abs=0.01)
        assert rig.axis.var("StatusSensor[1].Adjusted") == 1
        rig.until(rig.axis.halt().done)
        rig.until(rig.axis.move_relative(-200.0).done)
        second = rig.axis.home(700.0, mode=mode)
        if mode == 8:
            rig.axis.move_velocity(100.0)
        rig.until(second.done, 20.0)
        rig.cycles(2)
        assert offset(rig) == kept
        rig.until(rig.axis.halt().done)
        rig.until(rig.axis.home(rig.axis.var("ActualPosition"), mode=7).done)
        assert offset(rig) == pytest.approx(700.0 - 150.0, abs=0.01)

    @pytest.mark.requirement("HOM-180", "MC-216")
    @pytest.mark.parametrize("mode", [3, 5, 8, 10])
    def test_stays_homed(self, make_rig, mode):
        """The start of a homing does not take the homed state of an absolute encoder."""
        rig = make_rig(variables=ABSOLUTE).enabled()
        home(rig, 10.0, mode=7)
        job = rig.axis.home(0.0, mode=mode)
        rig.cycles(3)
        assert (job.Busy, rig.axis.var("StatusWord.X5")) == (True, True)


class TestFaultyEncoder:
    """An error of the encoder that is over again."""

    @pytest.mark.requirement("HOM-191", "HOM-192", "HOM-179")
    @pytest.mark.parametrize(("variables", "homed"), [(None, False), (ABSOLUTE, True)])
    def test_recovers(self, make_rig, variables, homed):
        """An incremental one has lost its relation, and absolute positioning is refused (321); an absolute
        one has not.
        """
        rig = make_rig(variables=variables).enabled()
        home(rig, 10.0, mode=7 if variables else 0)
        rig.port.sensor_fault = True
        rig.run(0.5)
        rig.port.sensor_fault = False
        rig.run(0.1)
        rig.until(rig.axis.reset().done)
        rig.until(rig.axis.power_instance.status)
        assert rig.axis.var("StatusWord.X5") is homed
        job = rig.axis.move_absolute(20.0)
        rig.run(2.0)
        assert job.Done is homed
        assert (rig.axis.var("ErrorDetail.Number") == 321) is not homed


class TestBacklash:
    """Homing with backlash compensation (§5.11.11): the direction of the last motion decides."""

    @pytest.mark.requirement("HOM-173", "HOM-177", "CFG-567", "CFG-569")
    @pytest.mark.parametrize("mode", [0, 13])
    @pytest.mark.parametrize("last", [5.0, -5.0])
    def test_direct_homing(self, make_rig, mode, last):
        """Whatever flank is touched, position and load agree after homing while the direction is kept."""
        rig = rig_of(make_rig)
        move(rig, last)
        rig.until(rig.axis.home(100.0, mode=mode).done)
        origin = rig.load.position - 100.0
        move(rig, last)
        assert rig.axis.var("ActualPosition") - (rig.load.position - origin) == pytest.approx(0.0, abs=0.005)

    @pytest.mark.requirement("HOM-172", "CFG-566")
    def test_homing_on_a_mark(self, make_rig):
        """With the whole backlash passed in homing direction before the mark, the load stands where the axis
        shows it.
        """
        rig = rig_of(make_rig)
        mark = 15 * 10.0
        rig.until(rig.axis.move_relative(mark + 3.0 - rig.load.motor, Velocity=50.0).done, 20.0)
        move(rig, mark - rig.load.motor - 5.0)
        job = rig.axis.home(0.0, mode=8)
        move(rig, 10.0)
        assert job.Done
        # At the mark of the motor a load that is pushed in positive direction stands at 150 mm.
        assert rig.axis.var("ActualPosition") + mark == pytest.approx(rig.load.position, abs=0.005)

    @pytest.mark.exhaustive
    @pytest.mark.requirement("HOM-178", "CFG-551")
    def test_changed_size(self, make_rig):
        """Another size makes the axis one that is not homed."""
        rig = rig_of(make_rig)
        assert rig.axis.var("StatusWord.X5") is True
        rig.axis.write("Sensor[1].Backlash.Size", 0.1)
        rig.cycles(3)
        assert rig.axis.var("StatusWord.X5") is False
