"""Limit switches during active homing: turning round at them, being stopped by them, homing on them
(§5.11.3.4, §5.11.3.5).
"""

from __future__ import annotations

import pytest

from testcases.unit.hil.homing_bench import STEEP, Machine, homing_bench

pytestmark = pytest.mark.exhaustive

ZERO_MARK, CAM, INPUT = range(3)
REVERSAL = {"Homing.AutoReversal": True}
NEGATIVE = {"Sensor[1].ActiveHoming.Direction": 1}
BACKWARDS = {"Homing.ApproachDirection": True}
POSITIVE_SIDE = {"Sensor[1].ActiveHoming.SideInput": True}
NOWHERE = {"home_from_mm": 5000.0, "home_to_mm": 5100.0}


def machine(mode, *, variables=None, start=0.0, **parts):
    own = {"Sensor[1].ActiveHoming.Mode": mode, "Sensor[1].ActiveHoming.HomePositionOffset": 5.0}
    return homing_bench(
        variables=STEEP | own | (variables or {}), mechanics={"start_position_mm": start}, **parts
    )


class TestReversal:
    """`Homing.AutoReversal` = TRUE."""

    @pytest.mark.requirement(
        "HOM-108",
        "HOM-109",
        "HOM-110",
        "HOM-113",
        "HOM-046",
        "HOM-047",
        "LIM-043",
        "HOM-045",
        "HOM-111",
        "VAR-160",
    )
    def test_beyond_the_cam(self):
        """From 300: turned round at 550 with the default deceleration, past the cam with approach velocity,
        then the mark.
        """
        with machine(CAM, variables=REVERSAL, start=300.0) as bench:
            run = Machine(bench)
            run.done()
            assert run.phases() == ["approach+", "back-", "search+"]
            assert run.place == pytest.approx(128.0, abs=0.01)
            assert run.alarms() == []
            words = run.column("status_word")[1].astype(int)
            assert any(words & 1 << 18)
            assert not any(words & 1 << 1)
            speeds = run.column("velocity_setpoint")[1]
            assert min(speeds) == pytest.approx(-200.0)
            braking = run.column("acceleration_setpoint")[1]
            assert abs(braking).max() == pytest.approx(1000.0)
            # 200 mm/s and 1000 mm/s² need 20 mm beyond the switch, and the way until it is noticed.
            beyond = max(run.column("actual_position")[1]) + 300.0 - 550.0
            assert 20.0 <= beyond <= 20.0 + 200.0 * 0.012

    @pytest.mark.requirement("HOM-108", "HOM-113")
    @pytest.mark.parametrize(
        ("mode", "more", "start", "phases", "place"),
        [
            (CAM, BACKWARDS, 0.0, ["approach-", "approach+", "search+"], 128.0),
            (CAM, BACKWARDS | NEGATIVE, 0.0, ["approach-", "back+", "search-"], 98.0),
            (CAM, NEGATIVE, 300.0, ["approach+", "approach-", "search-"], 98.0),
            (INPUT, {}, 300.0, ["approach+", "back-", "search+"], 105.0),
            (INPUT, POSITIVE_SIDE, 300.0, ["approach+", "back-", "search+"], 125.0),
            (INPUT, BACKWARDS | NEGATIVE | POSITIVE_SIDE, 0.0, ["approach-", "back+", "search-"], 125.0),
            (INPUT, BACKWARDS, 0.0, ["approach-", "approach+", "back-", "search+"], 105.0),
            (INPUT, NEGATIVE, 300.0, ["approach+", "approach-", "search-"], 105.0),
        ],
    )
    def test_every_side(self, mode, more, start, phases, place):
        """Cam or input is found from either side of it, and the mark is met in homing direction."""
        with machine(mode, variables=REVERSAL | more, start=start) as bench:
            run = Machine(bench)
            run.done()
            assert run.phases() == phases
            assert run.place - run.position == pytest.approx(place, abs=0.01 if mode == CAM else 0.6)
            assert run.alarms() == []

    @pytest.mark.requirement("HOM-114", "HOM-033", "MC-220", "MC-002")
    def test_no_cam(self):
        """Neither on the way to one switch nor to the other: alarm 342, reaction 3, X10, the job ends with
        16#8001.
        """
        with machine(CAM, variables=REVERSAL, start=300.0, switches=NOWHERE) as bench:
            run = Machine(bench)
            job = run.home()
            assert (job.Error, job.ErrorID, job.Busy) == (True, 0x8001, False)
            assert run.phases() == ["approach+", "back-"]
            assert run.events("alarm.raised")[0].data["number"] == 342
            assert run.axis.var("ErrorDetail.Number") == 342
            assert run.axis.var("ErrorDetail.Reaction") == 3
            assert run.bit(10, "ErrorWord")
            assert (run.bit(5), run.bit(11)) == (False, False)
            run.run(0.5)
            assert 342 in run.alarms()
            assert min(run.column("actual_position")[1]) + 300.0 > -600.0

    @pytest.mark.requirement("HOM-114", "HOM-097")
    def test_no_zero_mark(self):
        """Without cam the way back is searched too: the same switch a second time ends the search."""
        with machine(
            ZERO_MARK, variables=REVERSAL | {"Homing.ReferencingVelocity": 300.0}, start=300.0
        ) as bench:
            bench.drive().suppress_index(True)
            run = Machine(bench)
            job = run.home()
            assert job.ErrorID == 0x8001
            assert run.phases() == ["search+", "back-", "search+"]
            assert run.alarms()[0] == 342

    @pytest.mark.requirement("HOM-109", "HOM-115")
    @pytest.mark.parametrize(("offset", "alarms"), [(40.0, []), (5.0, [531]), (-5.0, [531])])
    def test_mark_on_the_switch(self, offset, alarms):
        """Left with the way to the home position the switch is quiet; at rest on it, or back into it,
        monitoring acts.
        """
        own = {"Sensor[1].ActiveHoming.HomePositionOffset": offset}
        with machine(
            ZERO_MARK, variables=REVERSAL | own, start=547.0, switches={"negative_limit_mm": 480.0}
        ) as bench:
            run = Machine(bench)
            job = run.home()
            run.run(0.1)
            assert run.phases() == ["search+", "back-", "search+"]
            assert run.bit(5)
            assert run.alarms() == alarms
            assert job.Done is (offset > 0.0)

    @pytest.mark.requirement("HOM-109", "LIM-053")
    def test_exchanged_switches(self):
        """The negative switch is met in positive direction: no turning round at it, but 531, and rest before
        the end stop.
        """
        quiet = {"PositionLimits_HW.ApproachBehavior": 1}
        with machine(CAM, variables=REVERSAL | quiet, start=400.0) as bench:
            bench.drive().swap_limit_switches(True)
            run = Machine(bench)
            job = run.home()
            run.run(0.5)
            assert job.ErrorID == 0x8001
            assert run.alarms()[0] == 531
            assert 550.0 < run.place < 600.0

    @pytest.mark.requirement("HOM-193")
    @pytest.mark.parametrize("mode", [ZERO_MARK, CAM])
    def test_passive_with_active(self, mode):
        """A passive homing against the direction of an active one does not take its search away."""
        own = {"Sensor[1].PassiveHoming.Mode": mode, "Sensor[1].PassiveHoming.Direction": 1}
        with machine(mode, variables=own) as bench:
            run = Machine(bench)
            job = run.axis.home(0.0, mode=3)
            run.run(0.05)
            waiting = run.axis.home(0.0, mode=8)
            run.until(job.ended, 10.0)
            assert (job.Done, waiting.Error) == (True, False)
            assert run.place == pytest.approx(128.0 if mode == CAM else 8.0, abs=0.01)

    @pytest.mark.requirement("HOM-115", "HOM-195")
    def test_aborted_on_the_switch(self):
        """After a halt on the switch normal monitoring is back in the next cycle: 531."""
        with machine(CAM, variables=REVERSAL, start=500.0) as bench:
            run = Machine(bench)
            job = run.axis.home(0.0, mode=3)
            run.until(lambda: run.bit(18))
            halt = run.axis.halt()
            run.run(0.008)
            assert (job.CommandAborted, job.Busy) == (True, False)
            run.run(0.008)
            assert run.alarms() == [531]
            assert halt.Error


class TestWithoutReversal:
    """`Homing.AutoReversal` = FALSE."""

    @pytest.mark.requirement("HOM-112", "HOM-097", "HOM-047")
    @pytest.mark.parametrize("mode", [ZERO_MARK, CAM, INPUT])
    def test_stopped_by_the_switch(self, mode):
        """The limit switch stops the axis as in any motion (531), and the mark counts as not found (342)."""
        with machine(mode, start=500.0, switches=NOWHERE) as bench:
            bench.drive().suppress_index(True)
            run = Machine(bench)
            job = run.home()
            run.run(0.1)
            assert (job.Error, job.ErrorID) == (True, 0x8001)
            assert run.alarms() == [531, 342]
            assert (run.bit(9, "ErrorWord"), run.bit(10, "ErrorWord"), run.bit(5)) == (True, True, False)


class TestOnTheLimitSwitch:
    """The limit switch is the homing mark."""

    @staticmethod
    def on_switch(offset=5.0, **more):
        variables = {"Sensor[1].ActiveHoming.HomePositionOffset": offset, "Homing.HomePosition": -400.0}
        return machine(
            INPUT,
            variables=variables | BACKWARDS | POSITIVE_SIDE | more,
            start=-450.0,
            axis={"homing_input": "negative_limit"},
        )

    @pytest.mark.requirement(
        "HOM-116", "HOM-117", "HOM-118", "HOM-119", "HOM-070", "HOM-006", "MC-204", "HOM-051", "HOM-122"
    )
    def test_procedure(self):
        """Monitoring off, homing with mode 5 on the positive side of the negative switch, away from it,
        monitoring on.
        """
        with self.on_switch() as bench:
            run = Machine(bench)
            run.until(run.axis.write_parameter(1000, False).done)
            job = run.done(123.0, mode=5)
            assert job.ReferenceMarkPosition == -405.0
            assert run.phases() == ["approach-", "search+"]
            assert run.position == pytest.approx(-400.0, abs=0.01)
            assert run.place == pytest.approx(-545.0, abs=0.4)
            times, places = run.column("actual_position")
            assert -600.0 < min(places[times < run.time_of("axis.homed")]) - 450.0 < -560.0
            run.until(run.axis.write_parameter(1000, True).done)
            run.run(0.1)
            assert run.alarms() == []

    @pytest.mark.requirement("HOM-121", "LIM-041")
    def test_monitoring_on_the_switch(self):
        """Switched on while the axis stands on the switch, monitoring raises 531."""
        with self.on_switch(offset=-10.0) as bench:
            run = Machine(bench)
            run.until(run.axis.write_parameter(1000, False).done)
            run.done(mode=5)
            run.until(run.axis.write_parameter(1000, True).done)
            run.run(0.1)
            assert run.alarms() == [531]

    @pytest.mark.requirement("HOM-120")
    def test_monitoring_left_on(self):
        """With monitoring on and without reversal the switch stops the homing."""
        with self.on_switch() as bench:
            run = Machine(bench)
            job = run.home(mode=5)
            assert job.ErrorID == 0x8001
            assert 531 in run.alarms()

    @pytest.mark.requirement("HOM-116", "HOM-108")
    def test_with_reversal(self):
        """With reversal the switch is mark and turning point, and monitoring may stay on."""
        with self.on_switch(**REVERSAL) as bench:
            run = Machine(bench)
            run.done(mode=5)
            assert run.place == pytest.approx(-545.0, abs=0.4)
            assert run.alarms() == []
