"""Modulo axes: places in the range, counters, ways to a target, homing, software limits."""

from __future__ import annotations

import pytest

from motion.s7.axis.assembly import modulo_of
from motion.s7.variables import VariableStore

ROTARY = {
    "Properties.MotionType": 1,
    "Modulo.Enable": True,
    "Modulo.Length": 360.0,
    "Modulo.StartValue": 0.0,
}


def modulo(**settings):
    return modulo_of(
        VariableStore("PositioningAxis", ROTARY | {f"Modulo.{k}": v for k, v in settings.items()})
    )


class TestRange:
    """Arithmetic of the range."""

    @pytest.mark.requirement("CFG-101", "CFG-102", "CFG-103", "CFG-100", "VAR-162")
    @pytest.mark.parametrize(
        ("start", "unwrapped", "place", "cycle"),
        [
            (0.0, 350.0, 350.0, 0),
            (0.0, 370.0, 10.0, 1),
            (0.0, -10.0, 350.0, -1),
            (0.0, 359.999, 359.999, 0),
            (0.0, 360.0, 0.0, 1),
            (0.0, 0.0, 0.0, 0),
            (-180.0, 200.0, -160.0, 1),
            (-180.0, -180.0, -180.0, 0),
            (0.0, 7210.0, 10.0, 20),
        ],
    )
    def test_place_and_cycle(self, start, unwrapped, place, cycle):
        """Start <= place < start + length, and the counter says how often the range has been passed."""
        one = modulo(StartValue=start)
        assert (one.wrap(unwrapped), one.cycle(unwrapped)) == (pytest.approx(place), cycle)

    @pytest.mark.requirement("CFG-106", "CFG-099")
    def test_without_modulo(self):
        """Without the range a position is itself, however large, and the counter is 0."""
        one = modulo(Enable=False)
        assert (one.wrap(1e6), one.cycle(1e6)) == (1e6, 0)

    @pytest.mark.requirement("CFG-119", "CFG-120", "CFG-121", "CFG-122", "CFG-112")
    @pytest.mark.parametrize(
        ("present", "new", "way"),
        [
            (350.0, 10.0, 20.0),
            (350.0, 340.0, -10.0),
            (10.0, 350.0, -20.0),
            (10.0, 190.0, 180.0),
            (190.0, 10.0, 180.0),
        ],
    )
    def test_shortest_way(self, present, new, way):
        """The shorter way round; half a range is gone in positive direction."""
        assert modulo().shortest(new - present) == pytest.approx(way)

    @pytest.mark.requirement("MC-255")
    @pytest.mark.parametrize(
        ("direction", "place", "target"),
        [
            (1, 10.0, 370.0),
            (2, 10.0, 10.0),
            (3, 10.0, 370.0),
            (1, 340.0, 700.0),
            (2, 340.0, 340.0),
            (3, 340.0, 340.0),
            (1, 350.0, 350.0),
            (2, 350.0, 350.0),
        ],
    )
    def test_direction(self, direction, place, target):
        """From 350 degrees: positive, negative, shortest."""
        assert modulo().target(place, 350.0, direction) == pytest.approx(target)

    @pytest.mark.requirement("CFG-110", "CFG-111", "CFG-118")
    @pytest.mark.parametrize(
        ("home", "cycle"), [(0.0, 0), (90.0, 0), (180.0, 0), (180.001, -1), (359.999, -1)]
    )
    def test_counter_at_a_home_position(self, home, cycle):
        """Found by active or passive homing, the upper half of the range is counter -1."""
        one = modulo()
        assert (one.cycle(one.homed(home)), one.wrap(one.homed(home))) == (cycle, pytest.approx(home))

    @pytest.mark.requirement("VAR-171")
    @pytest.mark.parametrize(
        ("low", "high", "expected"),
        [
            (10.0, 350.0, (370.0, 710.0)), (-10.0, 350.0, (360.0, 710.0)), (10.0, 400.0, (370.0, 720.0)),
            (-10.0, 400.0, (float("-inf"), float("inf"))),
            (300.0, 60.0, (300.0, 420.0)), (30.0, 20.0, (390.0, 740.0)), (50.0, 31.0, (50.0, 391.0)),
        ],
    )  # fmt: skip
    def test_software_limits(self, low, high, expected):
        """A limit outside the range gives way to the end of the range; two of them do nothing; they may stand
        in either order.
        """
        assert modulo().limits(low, high, 400.0) == expected


FAST = {
    "DynamicLimits.MaxVelocity": 120000.0,
    "DynamicLimits.Velocity": 120000.0,
    "DynamicLimits.MaxAcceleration": 1e6,
    "DynamicLimits.MaxDeceleration": 1e6,
    "DynamicDefaults.EmergencyDeceleration": 1e6,
    "Modulo.Length": 360.0,
    "Actor.DriveParameter.ReferenceSpeed": 20000.0,
    "Actor.DriveParameter.MaxSpeed": 30000.0,
    "FollowingError.EnableMonitoring": False,
}


class TestAxis:
    """A rotary axis that turns for ever."""

    def rig(self, make_rig, **more):
        rig = make_rig(variables=ROTARY | more)
        rig.enabled()
        return rig

    def rows(self, rig):
        var = rig.axis.var
        return var("Position"), var("ModuloCycle"), var("ActualPosition"), var("ActualModuloCycle")

    @pytest.mark.exhaustive
    @pytest.mark.requirement(
        "CFG-100", "CFG-104", "CFG-105", "CFG-094", "CFG-097", "CFG-098", "VAR-111", "CFG-014"
    )
    def test_turns_through_the_border(self, make_rig):
        """Setpoint and actual value stay in the range, their counters run apart, and the following error
        knows no border.
        """
        rig = self.rig(make_rig)
        rig.axis.home(350.0)
        rig.cycles(2)
        seen = []
        rig.runtime.after_cycle.append(
            lambda: seen.append((*self.rows(rig), rig.axis.var("StatusPositioning.FollowingError")))
        )
        rig.axis.move_velocity(400.0)
        rig.run(3.0)
        places = [row[0] for row in seen] + [row[2] for row in seen]
        assert all(0.0 <= place < 360.0 for place in places)
        assert {row[1] - row[3] for row in seen} == {0, 1}
        assert seen[-1][1] >= 2
        assert max(abs(row[4]) for row in seen) < 2.0
        assert rig.axis.alarms.engine.number == 0

    @pytest.mark.exhaustive
    @pytest.mark.requirement("CFG-119", "CFG-120", "CFG-121")
    @pytest.mark.parametrize(
        ("start", "new", "change"), [(350.0, 10.0, 1), (350.0, 340.0, 0), (10.0, 350.0, -1)]
    )
    def test_direct_homing(self, make_rig, start, new, change):
        """Direct homing goes the shortest way, and the counter with it."""
        rig = self.rig(make_rig)
        job = rig.axis.move_relative(360.0 * 5 + start)
        rig.until(job.done, 60.0)
        before = rig.axis.var("ActualModuloCycle")
        rig.until(rig.axis.home(new).done)
        rig.cycles(1)
        assert rig.axis.var("ActualPosition") == pytest.approx(new, abs=0.01)
        assert rig.axis.var("ActualModuloCycle") - before == change

    @pytest.mark.exhaustive
    @pytest.mark.requirement("CFG-123", "CFG-116", "VAR-112", "VAR-110", "VAR-109")
    def test_absolute_adjustment(self, make_rig):
        """`MC_Home` mode 7 of an absolute encoder sets the counter to 0, also in the upper half, and keeps
        the offset.
        """
        rig = self.rig(make_rig, **{"Sensor[1].Type": 1})
        rig.until(rig.axis.move_relative(360.0 * 7).done, 60.0)
        assert rig.axis.var("ActualModuloCycle") in (6, 7)
        rig.until(rig.axis.home(300.0, mode=7).done)
        rig.cycles(1)
        assert (rig.axis.var("ActualPosition"), rig.axis.var("ActualModuloCycle")) == (
            pytest.approx(300.0, abs=0.01),
            0,
        )
        assert rig.axis.var("StatusSensor[1].Adjusted") == 1
        assert rig.axis.var("StatusSensor[1].AbsEncoderOffset") != 0.0

    @pytest.mark.exhaustive
    @pytest.mark.requirement("CFG-109", "CFG-115", "CFG-124", "VAR-158", "VAR-159")
    @pytest.mark.parametrize(("kind", "cycle", "homed"), [(0, 0, False), (1, 3, True)])
    def test_restart(self, make_rig, kind, cycle, homed):
        """A restart sets the counter of an incremental encoder to 0 and keeps that of an absolute one, and
        with it the homing.
        """
        rig = self.rig(make_rig, **{"Sensor[1].Type": kind})
        rig.until(rig.axis.home(10.0, mode=7 if kind else 0).done)
        rig.until(rig.axis.move_relative(360.0 * 3).done, 30.0)
        assert rig.axis.var("ActualModuloCycle") == 3
        power = rig.axis.power(False)
        rig.until(power.off)
        rig.until(rig.axis.reset(restart=True).done)
        rig.cycles(2)
        assert rig.axis.var("ActualModuloCycle") == cycle
        assert rig.axis.var("StatusWord.X5") is homed

    @pytest.mark.requirement("MC-255", "STP-219")
    @pytest.mark.parametrize(("direction", "way"), [(1, 350.0), (2, -10.0), (3, -10.0)])
    def test_absolute_positioning(self, make_rig, direction, way):
        """`MC_MoveAbsolute` goes in the direction that is given, and shows the target in the range."""
        rig = self.rig(make_rig)
        rig.until(rig.axis.home(5.0).done)
        before = rig.column("position_setpoint")[-1]
        job = rig.axis.move_absolute(355.0, Direction=direction)
        rig.cycles(3)
        assert rig.axis.var("StatusPositioning.TargetPosition") == pytest.approx(355.0)
        rig.until(job.done, 30.0)
        assert rig.column("position_setpoint")[-1] - before == pytest.approx(way, abs=0.01)

    @pytest.mark.requirement("MC-255")
    def test_illegal_direction(self, make_rig):
        """On a modulo axis a direction of 0 is 16#8007; without modulo it does not matter."""
        rig = self.rig(make_rig)
        rig.until(rig.axis.home(5.0).done)
        job = rig.axis.move_absolute(355.0, Direction=0)
        rig.cycles(2)
        assert job.ErrorID == 0x8007
        plain = make_rig().enabled()
        plain.until(plain.axis.home(5.0).done)
        plain.until(plain.axis.move_absolute(15.0, Direction=0).done)

    @pytest.mark.exhaustive
    @pytest.mark.requirement("VAR-171")
    def test_software_limit_in_the_range(self, make_rig):
        """A limit within the range stops the axis in whatever cycle it is."""
        rig = self.rig(
            make_rig, **{"PositionLimits_SW.MinPosition": -10.0, "PositionLimits_SW.MaxPosition": 300.0}
        )
        rig.until(rig.axis.move_relative(360.0 * 2).done, 30.0)
        rig.until(rig.axis.home(0.0).done)
        rig.axis.write("PositionLimits_SW.Active", True)
        rig.axis.move_velocity(100.0)
        rig.until(lambda: rig.axis.alarms.engine.is_pending(533), 10.0)
        rig.run(1.0)
        assert rig.axis.var("Position") == pytest.approx(300.0, abs=0.01)

    @pytest.mark.requirement("LIM-091")
    @pytest.mark.parametrize(("velocity", "end"), [(100.0, 60.0), (-100.0, 300.0)])
    def test_software_limits_across_the_end_of_the_range(self, make_rig, velocity, end):
        """From 300 to 60 degrees over 0: no alarm 104, and the axis stops on either limit."""
        rig = self.rig(
            make_rig,
            **{
                "PositionLimits_SW.MinPosition": 300.0,
                "PositionLimits_SW.MaxPosition": 60.0,
                "PositionLimits_SW.Active": True,
            },
        )
        rig.until(rig.axis.home(350.0 if velocity > 0.0 else 10.0).done)
        rig.axis.move_velocity(velocity)
        rig.until(lambda: rig.axis.var("ErrorWord") != 0, 10.0)
        rig.run(1.0)
        assert rig.axis.var("ErrorDetail.Number") == 533
        assert rig.axis.var("Position") == pytest.approx(end, abs=0.01)

    def test_units_follow_the_type(self, make_rig):
        """A rotary axis counts in degrees, in data block and trace, unless it is configured otherwise."""
        rig = make_rig(variables=ROTARY)
        assert rig.axis.variables.unit("Position") == "deg"
        assert dict(rig.axis.trace_columns)["velocity_setpoint"] == "deg/s"

    @pytest.mark.requirement("VAR-163", "VAR-225")
    def test_faster_than_the_range(self, make_rig):
        """More than one range per cycle is alarm 412 with reaction 4; a range of 0.8 degrees at 4 ms ends at
        200 deg/s.
        """
        rig = self.rig(make_rig, **{"Modulo.Length": 0.8})
        rig.axis.move_velocity(190.0)
        rig.run(1.0)
        assert rig.axis.var("ErrorDetail.Number") == 0
        rig.axis.move_velocity(210.0)
        rig.run(1.0)
        assert (rig.axis.var("ErrorDetail.Number"), rig.axis.var("ErrorDetail.Reaction")) == (412, 4)
        assert rig.axis.var("ErrorWord.X5") is True

    @pytest.mark.requirement("STP-112")
    @pytest.mark.parametrize(
        ("limit", "velocity", "number", "warned"),
        [(120000.0, 89000.0, 0, False), (120000.0, 91000.0, 412, False), (90000.0, 91000.0, 0, True)],
    )
    def test_limit_of_the_velocity(self, make_rig, limit, velocity, number, warned):
        """360 degrees and 4 ms: 90 000 deg/s. MaxVelocity set to it keeps the axis enabled, with 501
        alone.
        """
        rig = self.rig(make_rig, **(FAST | {"DynamicLimits.MaxVelocity": limit}))
        rig.axis.move_velocity(velocity, Acceleration=1e6, Deceleration=1e6, Jerk=0.0)
        rig.run(0.5)
        assert [event.data["number"] for event in rig.events("alarm.raised")] == [number or 501] * (
            number > 0 or warned
        )
        assert rig.axis.var("StatusWord.X0") is (number == 0)
        if number:
            assert rig.axis.var("ErrorDetail.Reaction") == 4
        else:
            assert rig.column("velocity_setpoint")[-1] == min(velocity, limit)

    @pytest.mark.requirement("STP-113")
    def test_limit_of_the_velocity_of_a_leading_axis(self, make_rig):
        """Configured to give a leading value: 360 / (2 * 4 ms) = 45 000 deg/s, and 501 where it limits."""
        leading = {"CrossPlcSynchronousOperation.Interface[3].EnableLeadingValueOutput": True}
        rig = self.rig(make_rig, **FAST, **leading)
        job = rig.axis.move_velocity(44000.0, Acceleration=1e6, Jerk=0.0)
        rig.until(job.in_velocity)
        assert rig.events("alarm.raised") == []
        rig.axis.move_velocity(60000.0, Acceleration=1e6, Jerk=0.0)
        rig.run(0.2)
        assert rig.column("velocity_setpoint")[-1] == 45000.0
        assert [event.data["number"] for event in rig.events("alarm.raised")] == [501]

    @pytest.mark.requirement("CFG-108", "CFG-113", "CFG-114", "VAR-111", "VAR-112")
    @pytest.mark.parametrize(("kind", "offset", "cycle"), [(0, 0.0, 0), (1, 0.0, 2), (1, 400.0, 3)])
    def test_counter_at_power_on(self, make_rig, kind, offset, cycle):
        """At a start of the controller it is 0 with an incremental encoder, and follows from value and offset
        with an absolute one.
        """
        rig = make_rig(
            variables=ROTARY | {"Sensor[1].Type": kind, "StatusSensor[1].AbsEncoderOffset": offset}
        )
        rig.port.turn(2.1 * 6.283185307179586 - rig.port.angle)
        rig.cycles(2)
        axis = rig.axis.object
        axis.variables.power_cycle()
        axis.apply_configuration(powered_off=True)
        rig.cycles(2)
        assert rig.axis.var("ActualModuloCycle") == cycle

    @pytest.mark.requirement("CFG-117", "VAR-112")
    def test_relative_adjustment(self, make_rig):
        """`MC_Home` mode 6 shifts by the shortest way: by 350 degrees is by -10, and the counter falls by one
        at the border.
        """
        rig = self.rig(make_rig, **{"Sensor[1].Type": 1})
        rig.until(rig.axis.home(5.0, mode=7).done)
        rig.until(rig.axis.move_relative(360.0).done, 30.0)
        assert rig.axis.var("ActualModuloCycle") == 1
        rig.until(rig.axis.home(350.0, mode=6).done)
        rig.cycles(1)
        assert rig.axis.var("ActualPosition") == pytest.approx(355.0, abs=0.01)
        assert rig.axis.var("ActualModuloCycle") == 0
