"""Active homing on a bench: zero mark, zero mark behind a cam, edge of a digital input (§5.11.3)."""

from __future__ import annotations

import pytest

from testcases.unit.hil.homing_bench import STEEP, Machine, homing_bench

PROFILES = ["profidrive", "reference"]
ZERO_MARK, CAM, INPUT = range(3)
NEGATIVE = {"Sensor[1].ActiveHoming.Direction": 1}
BACKWARDS = {"Homing.ApproachDirection": True}
POSITIVE_SIDE = {"Sensor[1].ActiveHoming.SideInput": True}


def machine(mode, name="profidrive", *, variables=None, **parts):
    own = {"Sensor[1].ActiveHoming.Mode": mode, "Sensor[1].ActiveHoming.HomePositionOffset": 5.0}
    return homing_bench(name, variables=STEEP | own | (variables or {}), **parts)


@pytest.mark.parametrize("name", PROFILES)
class TestZeroMarkBehindCam:
    """`ActiveHoming.Mode` = 1: cam from 100 to 120 mm, zero marks at 3, 13, 23, ..."""

    @pytest.mark.exhaustive
    @pytest.mark.requirement(
        "HOM-092",
        "HOM-089",
        "HOM-090",
        "HOM-091",
        "HOM-068",
        "HOM-081",
        "HOM-083",
        "HOM-086",
        "HOM-045",
        "HOM-040",
        "VAR-156",
        "HOM-004",
        "HOM-043",
        "HOM-041",
        "HOM-042",
        "MC-196",
        "MC-202",
        "HOM-052",
        "HOM-054",
        "HOM-056",
        "HOM-050",
        "HOM-049",
    )
    def test_same_direction(self, name):
        """Cam at 100 with 200 mm/s, left at 120, mark at 123 (113 ignored), home at 128."""
        with machine(CAM, name) as bench:
            run = Machine(bench)
            job = run.done()
            assert run.phases() == ["approach+", "search+"]
            assert job.ReferenceMarkPosition == -5.0
            assert run.place == pytest.approx(128.0, abs=0.01)
            assert run.position == pytest.approx(0.0, abs=0.01)
            assert max(run.column("velocity_setpoint")[1]) == pytest.approx(200.0)
            assert run.speed_at("axis.homed") == pytest.approx(40.0)

    @pytest.mark.exhaustive
    @pytest.mark.requirement("HOM-093", "HOM-084")
    def test_too_fast_for_the_mark(self, name):
        """With 300 mm/s the mark at 123 is passed with more than 200 mm/s, and counts."""
        with machine(CAM, name, variables={"Homing.ApproachVelocity": 300.0}) as bench:
            run = Machine(bench)
            run.done()
            assert run.place == pytest.approx(128.0, abs=0.01)
            assert 140.0 < run.speed_at("axis.homed") < 230.0

    @pytest.mark.exhaustive
    @pytest.mark.requirement("HOM-094", "HOM-054", "HOM-090")
    def test_opposite_direction(self, name):
        """Detected at 100 in positive direction, left there in negative one, mark at 93, home at 98."""
        with machine(CAM, name, variables=NEGATIVE) as bench:
            run = Machine(bench)
            run.done()
            assert run.phases() == ["approach+", "search-"]
            assert run.place == pytest.approx(98.0, abs=0.01)
            assert run.position == pytest.approx(0.0, abs=0.01)

    @pytest.mark.exhaustive
    @pytest.mark.requirement("HOM-095", "HOM-107")
    def test_beyond_the_far_edge_while_braking(self, name):
        """A cam of 5 mm: left on the wrong side, met again on the way back, and the mark before it counts."""
        switches = {"home_from_mm": 100.0, "home_to_mm": 105.0}
        with machine(CAM, name, variables=NEGATIVE, switches=switches) as bench:
            run = Machine(bench)
            run.done()
            assert max(run.column("actual_position")[1]) > 106.0
            assert run.place == pytest.approx(98.0, abs=0.01)

    @pytest.mark.requirement("HOM-096")
    def test_begins_on_the_cam(self, name):
        """It goes in homing direction at once, with homing velocity."""
        with machine(CAM, name, mechanics={"start_position_mm": 110.0}) as bench:
            run = Machine(bench)
            run.done()
            assert run.phases() == ["search+"]
            assert run.place == pytest.approx(128.0, abs=0.01)

    @pytest.mark.exhaustive
    @pytest.mark.requirement("HOM-048", "HOM-089", "VAR-155")
    def test_approach_in_negative_direction(self, name):
        """From above the cam in negative direction, homing in negative direction: mark at 93."""
        variables = NEGATIVE | BACKWARDS
        with machine(CAM, name, variables=variables, mechanics={"start_position_mm": 200.0}) as bench:
            run = Machine(bench)
            run.done()
            assert run.phases() == ["approach-", "search-"]
            assert run.place == pytest.approx(98.0, abs=0.01)


@pytest.mark.parametrize("name", PROFILES)
class TestZeroMark:
    """`ActiveHoming.Mode` = 0."""

    @pytest.mark.exhaustive
    @pytest.mark.requirement("HOM-098", "HOM-099", "HOM-100", "HOM-101", "HOM-069", "HOM-039", "HOM-072")
    def test_first_mark_in_homing_direction(self, name):
        """From 118 in positive direction the mark is 123, whatever the approach direction is; the offset is
        travelled fast.
        """
        variables = BACKWARDS | {"Sensor[1].ActiveHoming.HomePositionOffset": 100.0}
        with machine(ZERO_MARK, name, variables=variables, mechanics={"start_position_mm": 118.0}) as bench:
            run = Machine(bench)
            run.done(1000.0)
            assert run.phases() == ["search+"]
            assert run.place == pytest.approx(223.0, abs=0.01)
            assert run.position == pytest.approx(1000.0, abs=0.01)
            times, speeds = run.column("velocity_setpoint")
            found = run.time_of("axis.homed")
            assert max(speeds[times < found]) == pytest.approx(40.0)
            assert max(speeds) == pytest.approx(200.0)

    @pytest.mark.requirement("HOM-085")
    def test_without_offset(self, name):
        """The axis brakes beyond the mark and comes back to it."""
        with machine(ZERO_MARK, name, variables={"Sensor[1].ActiveHoming.HomePositionOffset": 0.0}) as bench:
            run = Machine(bench)
            job = run.done()
            assert job.ReferenceMarkPosition == 0.0
            assert min(run.column("velocity_setpoint")[1]) < 0.0
            assert run.place == pytest.approx(3.0, abs=0.01)

    @pytest.mark.exhaustive
    @pytest.mark.requirement("HOM-066", "HOM-077")
    @pytest.mark.parametrize("velocity", [10.0, 40.0, 150.0])
    def test_is_exact_at_any_velocity(self, name, velocity):
        """Neither the cycle in which the mark lies nor the time until it is read makes an error."""
        with machine(ZERO_MARK, name, variables={"Homing.ReferencingVelocity": velocity}) as bench:
            run = Machine(bench)
            run.done()
            increment = 10.0 / (2048 if name == "profidrive" else 131072)
            mark = round(0.3 * 10.0 / increment) * increment
            assert run.place - run.position == pytest.approx(mark + 5.0, abs=increment)

    @pytest.mark.requirement("HOM-098", "HOM-054")
    def test_negative(self, name):
        """In negative direction the mark is at -7."""
        with machine(ZERO_MARK, name, variables=NEGATIVE) as bench:
            run = Machine(bench)
            run.done()
            assert run.place == pytest.approx(-2.0, abs=0.01)


EDGES = [
    # homing direction, side, place of the edge, motion from 0 in positive approach direction
    pytest.param(
        {},
        100.0,
        ["approach+", "back-", "search+"],
        id="positive, negative side",
        marks=pytest.mark.requirement("HOM-073", "HOM-104"),
    ),
    pytest.param(
        POSITIVE_SIDE,
        120.0,
        ["approach+", "search+"],
        id="positive, positive side",
        marks=pytest.mark.requirement("HOM-074", "HOM-103"),
    ),
    pytest.param(
        NEGATIVE | POSITIVE_SIDE,
        120.0,
        ["approach+", "back+", "search-"],
        id="negative, positive side",
        marks=pytest.mark.requirement("HOM-075", "HOM-105"),
    ),
    pytest.param(
        NEGATIVE,
        100.0,
        ["approach+", "search-"],
        id="negative, negative side",
        marks=pytest.mark.requirement("HOM-076"),
    ),
]


class TestDigitalInput:
    """`ActiveHoming.Mode` = 2: an edge of the input that is active from 100 to 120 mm."""

    @pytest.mark.exhaustive
    @pytest.mark.requirement(
        "HOM-102", "HOM-053", "HOM-057", "HOM-067", "HOM-070", "HOM-107", "HOM-055", "VAR-155"
    )
    @pytest.mark.parametrize("low", [False, True], ids=["active high", "active low"])
    @pytest.mark.parametrize(("variables", "edge", "phases"), EDGES)
    @pytest.mark.parametrize("name", PROFILES)
    def test_edges(self, name, variables, edge, phases, low):
        """The edge of the configured side, met in homing direction, exact to the way of a cycle with homing
        velocity.
        """
        level = {"Sensor[1].ActiveHoming.SwitchLevel": not low, "Homing.ApproachVelocity": 150.0}
        with machine(INPUT, name, variables=variables | level) as bench:
            if low:
                bench.drive().invert_input("home", True)
            run = Machine(bench)
            run.done()
            assert run.phases() == phases
            assert run.place - run.position == pytest.approx(edge + 5.0, abs=40.0 * 0.008)
            assert run.speed_at("axis.homed") == pytest.approx(40.0, abs=0.5)

    @pytest.mark.exhaustive
    @pytest.mark.requirement("HOM-067", "HOM-066")
    def test_with_input_filter(self):
        """A filter of 6.4 ms adds its time: less than 0.416 mm, and the way of the telegram, with 40 mm/s."""
        with machine(INPUT, variables=POSITIVE_SIDE, switches={"input_filter_ms": 6.4}) as bench:
            run = Machine(bench)
            run.done()
            error = run.place - run.position - 125.0
            assert 40.0 * 0.0064 - 0.01 <= error <= 40.0 * (0.0064 + 0.008)

    @pytest.mark.exhaustive
    @pytest.mark.requirement("HOM-071")
    def test_signal_shorter_than_the_filter(self):
        """1 mm with 200 mm/s is 5 ms: a filter of 6.4 ms lets nothing pass, and the axis goes on to the limit
        switch.
        """
        switches = {"home_from_mm": 100.0, "home_to_mm": 101.0, "input_filter_ms": 6.4}
        with machine(INPUT, variables=POSITIVE_SIDE, switches=switches) as bench:
            run = Machine(bench)
            job = run.home()
            assert (job.Error, job.ErrorID) == (True, 0x8001)
            assert run.phases() == ["approach+"]

    @pytest.mark.exhaustive
    @pytest.mark.requirement("HOM-106", "HOM-084")
    def test_too_fast_for_the_edge(self):
        """An input of 5 mm, left long before the homing velocity is reached: its end counts all the same."""
        with machine(
            INPUT, variables=POSITIVE_SIDE, switches={"home_from_mm": 100.0, "home_to_mm": 105.0}
        ) as bench:
            run = Machine(bench)
            run.done()
            assert run.speed_at("axis.homed") > 100.0
            assert run.place - run.position == pytest.approx(110.0, abs=200.0 * 0.008)

    @pytest.mark.exhaustive
    @pytest.mark.requirement("HOM-104", "HOM-107")
    def test_beyond_the_input_while_braking(self):
        """The near side of an input of 5 mm: passed in both directions, the edge that counts is met with
        homing velocity.
        """
        with machine(INPUT, switches={"home_from_mm": 100.0, "home_to_mm": 105.0}) as bench:
            run = Machine(bench)
            run.done()
            assert max(run.column("actual_position")[1]) > 106.0
            assert run.place - run.position == pytest.approx(105.0, abs=40.0 * 0.008)

    @pytest.mark.exhaustive
    @pytest.mark.requirement("HOM-096", "HOM-104")
    @pytest.mark.parametrize(
        ("variables", "phases", "edge"),
        [
            ({}, ["back-", "search+"], 100.0),
            (POSITIVE_SIDE, ["search+"], 120.0),
            (NEGATIVE | POSITIVE_SIDE, ["back+", "search-"], 120.0),
        ],
    )
    def test_begins_on_the_input(self, variables, phases, edge):
        """Towards the edge, or away from it to come back in homing direction."""
        with machine(INPUT, variables=variables, mechanics={"start_position_mm": 110.0}) as bench:
            run = Machine(bench)
            run.done()
            assert run.phases() == phases
            assert run.place - run.position == pytest.approx(edge + 5.0, abs=40.0 * 0.008)
