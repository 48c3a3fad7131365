"""`MC_Home`: who may use which mode, what a homing shows, and what it does to other jobs (§5.11, §8.3)."""

from __future__ import annotations

import pytest

ABSOLUTE = {"Sensor[1].Type": 1}
MODULO = {"Modulo.Enable": True, "Modulo.Length": 360.0}


def home(rig, position=0.0, *, mode=0, timeout=20.0, sensor=0):
    job = rig.axis.home(position, mode=mode, sensor=sensor)
    rig.until(job.ended, timeout)
    return job


class TestConditions:
    """Rejections, with the running job untouched."""

    @pytest.mark.requirement("HOM-005", "MC-194", "MC-203")
    @pytest.mark.parametrize("mode", [4, 14, -1])
    def test_reserved_modes(self, rig, mode):
        """4 and what lies outside of 0..13: 16#800A."""
        rig.enabled()
        assert home(rig, mode=mode).ErrorID == 0x800A

    @pytest.mark.requirement(
        "HOM-021", "MC-011", "MC-214", "HOM-015", "HOM-016", "HOM-017", "HOM-018", "HOM-019", "HOM-020"
    )
    @pytest.mark.parametrize("absolute", [False, True])
    @pytest.mark.parametrize("mode", [0, 1, 2, 3, 5, 6, 7, 8, 10, 11, 12, 13])
    def test_modes_by_type_of_encoder(self, make_rig, mode, absolute):
        """6 and 7 for absolute encoders only (16#8010), 13 for incremental ones only (16#8011), all others
        for both.
        """
        rig = make_rig(variables=ABSOLUTE if absolute else None).enabled()
        job = rig.axis.home(1.0, mode=mode)
        rig.cycles(3)
        refused = {6: 0x8010, 7: 0x8010} if not absolute else {13: 0x8011}
        assert job.ErrorID == refused.get(mode, 0)
        assert job.Error is (mode in refused)

    @pytest.mark.requirement("HOM-024", "HOM-026", "MC-187", "MC-188", "MC-010", "HOM-138")
    @pytest.mark.parametrize(("modes", "error"), [((2, 3, 5, 8, 10), 0x800F), ((0, 1, 9, 11, 12, 13), 0)])
    def test_disabled(self, rig, modes, error):
        """Modes with a homing mark need an enabled object; the others do not."""
        rig.cycles(5)
        for mode in modes:
            assert home(rig, 1.0, mode=mode).ErrorID == error

    @pytest.mark.requirement("HOM-028", "VAR-166")
    @pytest.mark.parametrize(("name", "error"), [("Acceleration", 0x8004), ("Deceleration", 0x8005)])
    @pytest.mark.parametrize("value", [0.0, 1e-13])
    def test_without_dynamics(self, rig, name, error, value):
        """A dynamic default with which nothing can move: active homing is refused as any other motion, and
        the axis stays as it is.
        """
        rig.enabled()
        rig.axis.write(f"DynamicDefaults.{name}", value)
        jobs = [home(rig, mode=mode) for mode in (3, 5)] + [rig.axis.move_relative(5.0)]
        rig.cycles(2)
        assert [job.ErrorID for job in jobs] == [error] * 3
        assert rig.axis.var("ErrorWord") == 0

    @pytest.mark.requirement("HOM-025", "HOM-026", "MC-622")
    def test_without_position_control(self, rig):
        """Modes 3 and 5 close it; all others but 9 are rejected with 16#8071."""
        rig.enabled(start_mode=0)
        for mode in (0, 1, 2, 8, 10, 11, 12, 13):
            assert home(rig, mode=mode).ErrorID == 0x8071
        assert home(rig, mode=9).Done
        assert rig.axis.var("StatusWord.X28") is True
        assert home(rig, mode=3).Done
        assert rig.axis.var("StatusWord.X28") is False

    @pytest.mark.requirement("HOM-023", "HOM-027", "HOM-152", "HOM-147", "MC-186", "MC-013")
    @pytest.mark.parametrize("mode", [0, 1, 2, 3, 5, 8, 10, 11, 12, 13])
    def test_invalid_actual_value(self, rig, mode):
        """Without a valid encoder value: 16#8016."""
        rig.enabled()
        rig.port.sensor_fault = True
        rig.cycles(1)
        job = rig.axis.home(0.0, mode=mode)
        rig.cycles(1)
        assert job.ErrorID == 0x8016

    @pytest.mark.requirement("HOM-167", "MC-188")
    def test_incremental_adjustment_with_an_alarm(self, rig):
        """Mode 13 is rejected with 16#8001 while an alarm is pending, mode 0 is not."""
        rig.enabled()
        rig.axis.alarms.raise_alarm(533)
        rig.run(1.0)
        assert home(rig, mode=13).ErrorID == 0x8001
        assert home(rig, mode=0).Done

    @pytest.mark.requirement("HOM-150", "MC-618", "MC-195")
    @pytest.mark.parametrize("sensor", [-1, 2, 5])
    def test_number_of_the_encoder(self, rig, sensor):
        """An encoder that does not exist: 16#8050."""
        rig.enabled()
        assert home(rig, mode=13, sensor=sensor).ErrorID == 0x8050

    @pytest.mark.requirement("MC-221", "HOM-030", "MC-623", "CFG-323")
    @pytest.mark.parametrize("mode", [2, 3, 5, 8, 10])
    def test_no_switch_of_encoders(self, rig, mode):
        """While a homing looks for its mark MC_SetSensor is rejected with 16#8074."""
        rig.enabled()
        job = rig.axis.home(0.0, mode=mode)
        rig.cycles(5)
        switch = rig.axis.set_sensor(1)
        rig.cycles(2)
        assert (switch.ErrorID, job.Busy) == (0x8074, True)


class TestAlarms:
    """What active homing finds wrong before it moves."""

    @pytest.mark.requirement("HOM-029", "HOM-033")
    @pytest.mark.parametrize("path", ["Homing.ApproachVelocity", "Homing.ReferencingVelocity"])
    @pytest.mark.parametrize("mode", [3, 5])
    def test_velocity_zero(self, make_rig, path, mode):
        """Alarm 341 with reaction 2, ErrorWord.X10, and the job ends with 16#8001."""
        rig = make_rig(variables={path: 0.0}).enabled()
        job = home(rig, mode=mode)
        assert (job.Error, job.ErrorID) == (True, 0x8001)
        assert (rig.axis.var("ErrorDetail.Number"), rig.axis.var("ErrorDetail.Reaction")) == (341, 2)
        assert rig.axis.var("ErrorWord.X10") is True
        assert set(rig.column("velocity_setpoint")) == {0.0}

    @pytest.mark.parametrize("mode", [3, 8])
    def test_device_without_zero_mark(self, rig, mode):
        """Alarm 343."""
        rig.port.mark = None
        rig.enabled()
        assert home(rig, mode=mode).ErrorID == 0x8001
        assert rig.axis.var("ErrorDetail.Number") == 343


class TestStatus:
    """X5, X11, `Adjusted`, outputs."""

    @pytest.mark.requirement(
        "MC-109",
        "VAR-039",
        "HOM-034",
        "HOM-082",
        "HOM-180",
        "MC-216",
        "MC-219",
        "MC-215",
        "HOM-033",
        "HOM-083",
    )
    def test_active_homing(self, rig):
        """X11 to the end; X5 falls at the start and rises at the mark, before the home position is
        reached.
        """
        rig.enabled()
        home(rig)
        job = rig.axis.home(500.0, mode=3)
        rig.until(job.done, 20.0)
        words = [int(word) for word in rig.column("status_word")]
        x5 = [word >> 5 & 1 for word in words]
        x11 = [word >> 11 & 1 for word in words]
        begin, end = x11.index(1), len(x11) - 1 - x11[::-1].index(1)
        assert 0 not in x11[begin : end + 1]
        assert x5[begin] == 0
        homed = x5.index(1, begin)
        assert begin < homed < end - 10
        assert 0 not in x5[homed:]
        assert x11[-1] == 0
        assert rig.axis.var("StatusSensor[1].Adjusted") == 1
        assert job.ReferenceMarkPosition == 500.0

    @pytest.mark.requirement("HOM-035", "HOM-036", "MC-215", "HOM-064", "HOM-014")
    @pytest.mark.parametrize(("mode", "adjusted"), [(0, 0), (1, 0), (11, 0), (12, 0), (13, 1)])
    def test_adjusted_incremental(self, rig, mode, adjusted):
        """Direct homing sets X5 alone, adjustment `Adjusted` as well."""
        rig.enabled()
        assert home(rig, 7.0, mode=mode).Done
        rig.cycles(1)
        assert rig.axis.var("StatusWord.X5") is True
        assert rig.axis.var("StatusSensor[1].Adjusted") == adjusted

    @pytest.mark.requirement("HOM-031", "LIM-007")
    @pytest.mark.parametrize("kind", ["Simulation.Mode", "VirtualAxis.Mode"])
    @pytest.mark.parametrize("mode", [0, 2, 3, 5, 8, 10, 13])
    def test_simulated(self, make_rig, kind, mode):
        """Every mode is Done at once, at its position, without a search."""
        rig = make_rig(variables={kind: 1, "Homing.HomePosition": 30.0}).enabled()
        job = home(rig, 30.0, mode=mode, timeout=0.1)
        assert job.Done
        rig.cycles(3)
        assert rig.axis.var("ActualPosition") == pytest.approx(30.0)
        assert set(rig.column("velocity_setpoint")) == {0.0}

    @pytest.mark.requirement("HOM-080", "MC-218", "HOM-193")
    def test_aborts_the_running_motion(self, rig):
        """The motion in progress is overridden."""
        rig.enabled()
        move = rig.axis.move_velocity(100.0)
        rig.until(move.in_velocity)
        job = rig.axis.home(0.0, mode=3)
        rig.cycles(2)
        assert (move.CommandAborted, job.Busy) == (True, True)

    @pytest.mark.requirement("HOM-028", "HOM-110")
    def test_dynamics(self, make_rig):
        """Ramps are those of DynamicDefaults."""
        rig = make_rig(
            variables={
                "DynamicDefaults.Acceleration": 300.0,
                "DynamicDefaults.Deceleration": 500.0,
                "DynamicDefaults.Jerk": 0.0,
                "Sensor[1].ActiveHoming.HomePositionOffset": 200.0,
            }
        ).enabled()
        rig.until(rig.axis.home(0.0, mode=3).done, 20.0)
        accelerations = rig.column("acceleration_setpoint")
        assert max(accelerations) == pytest.approx(300.0)
        assert min(accelerations) == pytest.approx(-500.0)

    @pytest.mark.requirement("HOM-195", "HOM-196")
    def test_aborted(self, rig):
        """A halt ends it, and the search with it: passing the mark later has no effect."""
        rig.enabled()
        job = rig.axis.home(0.0, mode=3)
        rig.run(1.0)
        halt = rig.axis.halt()
        rig.until(halt.done)
        assert (job.CommandAborted, job.Busy) == (True, False)
        assert rig.axis.var("StatusWord.X11") is False
        rig.until(rig.axis.move_relative(200.0).done)
        assert rig.axis.var("StatusWord.X5") is False

    @pytest.mark.requirement("HOM-198", "OVR-088", "HOM-142", "HOM-164")
    @pytest.mark.parametrize("mode", [0, 1, 11, 12, 13])
    def test_direct_homing_aborts_nothing(self, rig, mode):
        """A motion goes on with its velocity, and so does a passive homing that waits."""
        rig.enabled()
        waiting = rig.axis.home(0.0, mode=2)
        move = rig.axis.move_velocity(100.0)
        rig.until(move.in_velocity)
        job = home(rig, 1000.0, mode=mode)
        rig.cycles(2)
        assert (job.Done, move.Busy, waiting.Busy, move.in_velocity()) == (True, True, True, True)
        assert rig.column("velocity_setpoint")[-1] == pytest.approx(100.0)


class TestModulo:
    """On a modulo axis."""

    @pytest.mark.requirement("HOM-044", "CFG-110")
    def test_offset_on_the_shortest_way(self, make_rig):
        """Length 360, home position 10, offset 350: the mark is set to 20, and the axis moves -10."""
        rig = make_rig(variables=MODULO | {"Sensor[1].ActiveHoming.HomePositionOffset": 350.0}).enabled()
        job = home(rig, 10.0, mode=3)
        assert job.Done
        assert job.ReferenceMarkPosition == -340.0
        assert rig.axis.var("ActualPosition") == pytest.approx(10.0, abs=0.05)
        turned = rig.port.angle / 6.283185307179586 * 10.0
        assert turned == pytest.approx(140.0, abs=0.05)

    @pytest.mark.requirement("CFG-110", "CFG-111", "CFG-118")
    @pytest.mark.parametrize(("place", "cycle"), [(90.0, 0), (180.0, 0), (180.001, -1), (359.999, -1)])
    def test_counter(self, make_rig, place, cycle):
        """A home position in the upper half of the range belongs to the cycle -1."""
        rig = make_rig(variables=MODULO).enabled()
        home(rig, place, mode=3)
        assert rig.axis.var("ModuloCycle") == cycle
        assert rig.axis.var("Position") == pytest.approx(place)
