"""Passive homing on a bench: the mark is noticed during motions of other jobs (§5.11.4)."""

from __future__ import annotations

import pytest

from testcases.unit.hil.homing_bench import STEEP, Machine, homing_bench

pytestmark = pytest.mark.exhaustive

PROFILES = ["profidrive", "reference"]
ZERO_MARK, CAM, INPUT = range(3)
DIRECTION = "Sensor[1].PassiveHoming.Direction"
SIDE = "Sensor[1].PassiveHoming.SideInput"


def machine(mode, name="profidrive", *, variables=None, start=0.0, **parts):
    own = STEEP | {"Sensor[1].PassiveHoming.Mode": mode, "Homing.HomePosition": 700.0}
    return homing_bench(
        name, variables=own | (variables or {}), mechanics={"start_position_mm": start}, **parts
    )


def pass_by(run, velocity=50.0, seconds=4.0):
    """Move with constant velocity, then halt; says whether the velocity was undisturbed to the last."""
    move = run.axis.move_velocity(velocity)
    run.run(seconds)
    undisturbed = move.in_velocity()
    run.until(run.axis.halt().ended)
    run.run(0.1)
    return undisturbed


@pytest.mark.parametrize("name", PROFILES)
class TestMarks:
    """Every kind of mark, in every direction."""

    @pytest.mark.requirement(
        "HOM-131",
        "HOM-123",
        "HOM-125",
        "HOM-127",
        "HOM-009",
        "HOM-058",
        "HOM-060",
        "HOM-132",
        "MC-207",
        "MC-196",
        "HOM-041",
        "HOM-034",
        "HOM-035",
    )
    def test_on_the_fly(self, name):
        """Cam 100 to 120, mark 123: there the position becomes 0 in flight, and the velocity setpoint has no
        step.
        """
        with machine(CAM, name) as bench:
            run = Machine(bench)
            job = run.axis.home(0.0, mode=8)
            undisturbed = pass_by(run)
            assert (job.Done, job.ReferenceMarkPosition) == (True, 0.0)
            assert run.place - run.position == pytest.approx(123.0, abs=0.01)
            assert undisturbed
            speeds = run.column("velocity_setpoint")[1]
            assert max(abs(speeds[1:] - speeds[:-1])) <= 1000.0 * 0.004 + 1e-9
            assert max(abs(run.column("following_error")[1])) < 0.2
            times, words = run.column("status_word")
            waiting = (times > 0.2) & (times < run.time_of("axis.homed"))
            assert all(words[waiting].astype(int) & 1 << 11)
            assert not run.bit(11)
            assert run.axis.var("StatusSensor[1].Adjusted") == 1

    @pytest.mark.requirement("HOM-129", "HOM-124")
    @pytest.mark.parametrize(
        ("direction", "velocity", "mark"),
        [(0, 50.0, 3.0), (1, -50.0, -7.0), (2, -50.0, -7.0), (2, 50.0, 3.0)],
    )
    def test_zero_mark_alone(self, name, direction, velocity, mark):
        """The first zero mark in homing direction, without any cam; direction 2 is the one in which the axis
        moves.
        """
        with machine(ZERO_MARK, name, variables={DIRECTION: direction}) as bench:
            run = Machine(bench)
            job = run.axis.home(40.0, mode=8)
            pass_by(run, velocity, 1.0)
            assert job.Done
            assert run.place - run.position == pytest.approx(mark - 40.0, abs=0.01)

    @pytest.mark.requirement("HOM-124", "HOM-107")
    @pytest.mark.parametrize("mode", [ZERO_MARK, CAM, INPUT])
    def test_not_in_the_other_direction(self, name, mode):
        """Against the homing direction nothing is detected."""
        with machine(mode, name, start=200.0) as bench:
            run = Machine(bench)
            job = run.axis.home(0.0, mode=8)
            pass_by(run, -50.0, 3.5)
            assert (job.Busy, job.Done) == (True, False)

    @pytest.mark.requirement("HOM-128", "HOM-124")
    def test_turning_between_cam_and_mark(self, name):
        """Back before the mark: it has to leave the cam again, and the job goes on without an error."""
        with machine(CAM, name, start=90.0) as bench:
            run = Machine(bench)
            job = run.axis.home(0.0, mode=8)
            run.axis.move_relative(31.5, Velocity=100.0)  # beyond the cam, before the mark at 123
            run.run(1.5)
            run.axis.move_relative(-1.0, Velocity=10.0)
            run.run(1.0)
            run.axis.move_relative(8.0, Velocity=10.0)  # over the mark, without the cam
            run.run(1.5)
            assert (job.Busy, job.Error) == (True, False)
            run.axis.move_relative(-25.0, Velocity=100.0)
            run.run(1.0)
            run.axis.move_relative(25.0, Velocity=100.0)
            run.run(1.0)
            assert job.Done
            assert run.place - run.position == pytest.approx(123.0, abs=0.01)

    @pytest.mark.requirement(
        "HOM-130", "HOM-073", "HOM-074", "HOM-075", "HOM-076", "HOM-059", "HOM-062", "HOM-061"
    )
    @pytest.mark.parametrize("low", [False, True], ids=["active high", "active low"])
    @pytest.mark.parametrize(
        ("direction", "positive_side", "edge"),
        [(0, False, 100.0), (0, True, 120.0), (1, True, 120.0), (1, False, 100.0)],
    )
    def test_edges_of_the_input(self, name, direction, positive_side, edge, low):
        """The edge of the configured side in homing direction, electrically rising or falling as the level
        says.
        """
        variables = {
            DIRECTION: direction,
            SIDE: positive_side,
            "Sensor[1].PassiveHoming.SwitchLevel": not low,
        }
        with machine(INPUT, name, variables=variables, start=200.0 if direction else 20.0) as bench:
            if low:
                bench.drive().invert_input("home", True)
            run = Machine(bench)
            job = run.axis.home(0.0, mode=8)
            pass_by(run, -50.0 if direction else 50.0, 3.0)
            assert job.Done
            assert run.place - run.position == pytest.approx(edge, abs=50.0 * 0.008)


class TestModes:
    """2, 8, 9 and 10."""

    @pytest.mark.requirement(
        "HOM-126",
        "HOM-003",
        "HOM-009",
        "HOM-011",
        "HOM-125",
        "VAR-157",
        "HOM-180",
        "MC-201",
        "MC-209",
        "MC-216",
        "MC-207",
    )
    @pytest.mark.parametrize(
        ("mode", "position", "kept"), [(2, 40.0, True), (8, 40.0, False), (10, 700.0, False)]
    )
    def test_position_and_homed_state(self, mode, position, kept):
        """`Position`, or with mode 10 `Homing.HomePosition`; mode 2 alone leaves the homed state until the
        mark.
        """
        with machine(ZERO_MARK) as bench:
            run = Machine(bench)
            run.done(0.0, mode=0)
            job = run.axis.home(40.0, mode=mode)
            run.run(0.1)
            assert (job.Busy, run.bit(5)) == (True, kept)
            pass_by(run, 50.0, 1.0)
            assert (job.Done, run.bit(5)) == (True, True)
            assert job.ReferenceMarkPosition == position
            assert run.place - run.position == pytest.approx(3.0 - position, abs=0.01)

    @pytest.mark.requirement("HOM-126")
    @pytest.mark.parametrize(("mode", "alarms"), [(2, [533]), (8, [])])
    def test_software_limits(self, mode, alarms):
        """They rest while mode 8 waits for the mark, and act on with mode 2."""
        limits = {
            "PositionLimits_SW.Active": True,
            "PositionLimits_SW.MaxPosition": 50.0,
            "PositionLimits_SW.MinPosition": -50.0,
        }
        with machine(CAM, variables=limits) as bench:
            run = Machine(bench)
            run.done(0.0, mode=0)
            run.axis.home(0.0, mode=mode)
            pass_by(run, 50.0, 2.0)
            assert run.alarms() == alarms

    @pytest.mark.requirement("HOM-134", "HOM-010", "MC-208", "OVR-086", "MC-189")
    @pytest.mark.parametrize("mode", [2, 8, 10])
    def test_cancel(self, mode):
        """Mode 9 is Done, the passive one ends with CommandAborted, and the mark has no effect any more."""
        with machine(ZERO_MARK) as bench:
            run = Machine(bench)
            job = run.axis.home(40.0, mode=mode)
            run.run(0.1)
            cancel = run.done(mode=9)
            run.run(0.008)
            assert (job.CommandAborted, job.Busy, job.Done, cancel.Done) == (True, False, False, True)
            assert not run.bit(11)
            pass_by(run, 50.0, 1.0)
            assert not run.bit(5)
            assert run.place == pytest.approx(run.position, abs=0.01)

    @pytest.mark.requirement("HOM-135", "MC-189")
    def test_cancel_nothing(self):
        """Mode 9 without a passive homing is Done, on a disabled axis as well, and homes nothing."""
        with machine(ZERO_MARK) as bench:
            run = Machine(bench, enable=False)
            run.done(mode=9)
            assert not run.bit(5)

    @pytest.mark.requirement("HOM-136", "OVR-087")
    def test_another_one(self):
        """A second passive homing takes the place of the first."""
        with machine(ZERO_MARK) as bench:
            run = Machine(bench)
            first = run.axis.home(40.0, mode=8)
            run.run(0.05)
            second = run.axis.home(90.0, mode=8)
            run.run(0.02)
            assert (first.CommandAborted, second.Busy) == (True, True)
            pass_by(run, 50.0, 1.0)
            assert second.Done
            assert run.place - run.position == pytest.approx(3.0 - 90.0, abs=0.01)

    @pytest.mark.requirement("HOM-137")
    def test_waits_for_ever(self):
        """No mark for longer than the 60 s that a drive would wait: still busy; nothing in it counts time."""
        with machine(ZERO_MARK) as bench:
            run = Machine(bench)
            job = run.axis.home(0.0, mode=8)
            run.run(62.0)
            assert (job.Busy, job.Error) == (True, False)

    @pytest.mark.requirement("HOM-196", "OVR-115", "OVR-085")
    def test_survives_motion_but_not_a_stop(self):
        """Jobs of every kind leave it; MC_Stop, another homing with motion, and disabling end it."""
        with machine(ZERO_MARK) as bench:
            bench.drive().suppress_index(True)
            run = Machine(bench)
            job = run.axis.home(0.0, mode=2)
            run.done(0.0, mode=0)
            run.until(run.axis.move_absolute(10.0).done)
            run.until(run.axis.move_relative(-5.0).done)
            run.until(run.axis.move_velocity(20.0).in_velocity)
            run.until(run.axis.halt().done)
            assert job.Busy
            run.axis.stop(0)
            run.run(0.02)
            assert (job.CommandAborted, job.Busy) == (True, False)

    @pytest.mark.requirement("HOM-193", "HOM-196")
    def test_active_homing_ends_it(self):
        """Mode 3 aborts it."""
        with machine(ZERO_MARK) as bench:
            run = Machine(bench)
            job = run.axis.home(0.0, mode=8)
            run.run(0.05)
            active = run.done(0.0)
            assert (job.CommandAborted, active.Done) == (True, True)

    @pytest.mark.requirement("OVR-115", "HOM-138")
    def test_disabling_ends_it(self):
        """With the enable it is gone, without an error."""
        with machine(ZERO_MARK) as bench:
            run = Machine(bench, enable=False)
            power = run.axis.power()
            run.until(power.status)
            job = run.axis.home(0.0, mode=8)
            run.run(0.05)
            power.set(Enable=False)
            run.run(1.0)
            assert (job.CommandAborted, job.Error) == (True, False)
