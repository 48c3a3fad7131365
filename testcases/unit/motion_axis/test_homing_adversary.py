"""Whatever is done to a homing at any moment: one output per job, X11 tells the truth, no false mark, and the
next one works.
"""

from __future__ import annotations

import pytest
from hypothesis import HealthCheck, example, given, settings
from hypothesis import strategies as st

from testcases.unit.homing_machines import (
    CAM,
    HOME,
    INPUT,
    LIMIT,
    ZERO_MARK,
    clearance,
    next_mark,
    off_a_mark,
    variables,
)
from testcases.unit.motion_axis.conftest import CYCLE, Rig
from testcases.unit.motion_axis.test_homing_property import Plant

pytestmark = pytest.mark.exhaustive

WITH_MARK = (2, 3, 5, 8, 10)
JOBS = {
    **{
        f"home {mode}": lambda axis, mode=mode: axis.home(HOME, mode=mode)
        for mode in (0, 1, 2, 3, 5, 8, 9, 10, 11, 12, 13)
    },
    "halt": lambda axis: axis.halt(),
    "relative": lambda axis: axis.move_relative(-30.0),
    "absolute": lambda axis: axis.move_absolute(axis.var("ActualPosition") + 20.0),
    "velocity": lambda axis: axis.move_velocity(60.0),
    "jog": lambda axis: axis.jog(40.0, backward=True),
    "superimposed": lambda axis: axis.move_superimposed(5.0),
    "set sensor": lambda axis: axis.set_sensor(1),
    "stop": lambda axis: axis.stop(0),
    "restart": lambda axis: axis.reset(restart=True),
    "reset": lambda axis: axis.reset(),
}
DEEDS = (
    "override 0",
    "override 100",
    "override 200",
    "encoder lost",
    "encoder back",
    "off",
    "on",
    "release",
    "cam sticks",
    "cam free",
    "limit bounces",
    "approach 0",
    "approach 80",
)
PLACES = st.lists(st.tuples(st.sampled_from([*JOBS, *DEEDS]), st.integers(1, 250)), min_size=1, max_size=8)


class Machine:
    """An axis between limit switches with a cam, and somebody who does what he should not."""

    def __init__(self, mode, direction):
        self.machine = {
            "cam": (0.0, 22.0),
            "start": 60.0,
            "phase": 5.0,
            "mode": mode,
            "direction": direction,
            "approach": -1,
            "positive_side": True,
            "reversal": True,
            "velocity": 80.0,
        }
        self.plant = Plant(self.machine)
        passive = {"Sensor[1].PassiveHoming.Mode": mode, "Sensor[1].PassiveHoming.Direction": 2}
        self.rig = Rig(
            port=self.plant, variables=variables(self.machine) | passive | {"Homing.HomePosition": HOME}
        )
        self.rig.enabled()
        self.axis = self.rig.axis
        self.homings = []
        self.stops = []
        self.behind = 0

    def do(self, what):
        axis = self.axis
        if what in JOBS:
            job = JOBS[what](axis)
            if what.startswith("home"):
                self.homings.append(job)
            elif what == "stop":
                self.stops.append(job)
        elif what.startswith("override"):
            axis.write("Override.Velocity", float(what.split()[1]))
        elif what.startswith("encoder"):
            self.plant.sensor_fault = what.endswith("lost")
        elif what in ("off", "on"):
            axis.power(what == "on")
        elif what == "release":
            for stop in self.stops:
                stop.set(Execute=False)
        elif what.startswith("cam"):
            self.plant.wrong = "cam always on" if what.endswith("sticks") else "nothing"
        elif what == "limit bounces":
            self.plant.wrong = "both limits on"
            self.rig.cycles(2)
            self.plant.wrong = "nothing"
        else:
            axis.write("Homing.ApproachVelocity", float(what.split()[1]))

    def judge(self):
        """Check what holds at any moment."""
        busy = 0
        for job in self.homings:
            outputs = (job.Busy, job.Done, job.CommandAborted, job.Error)
            assert sum(outputs) == 1, outputs
            busy += job.Busy
        # An active and a passive one may run in parallel (OVR-087). The status word is that of the cycle
        # before the outputs; a superseded job shows it at its next call.
        agrees = (
            busy <= 2
            and self.axis.var("StatusWord.X11") is bool(busy)
            and len(self.axis.object.homings) == busy
        )
        self.behind = 0 if agrees else self.behind + 1
        assert self.behind <= 2
        assert self.plant.farthest <= LIMIT + clearance(CYCLE)

    def recover(self):
        """Do what an operator does before he homes again."""
        self.plant.sensor_fault = False
        self.plant.wrong = "nothing"
        for what in (
            "release",
            "halt",
            "override 100",
            "approach 80",
        ):  # a jog would go on to the limit switch
            self.do(what)
        self.rig.run(3.0)
        for _ in range(3):
            self.axis.reset()
            self.rig.run(0.1)
        self.axis.power(True)
        self.rig.run(0.5)
        self.axis.reset()
        self.rig.run(0.1)

    def mark(self):
        """Return the place on which the next active homing has to end; None: one of many."""
        direction = self.machine["direction"]
        low, high = self.machine["cam"]
        if self.machine["mode"] == ZERO_MARK:
            return None
        return (
            next_mark(high if direction > 0 else low, direction, 5.0) if self.machine["mode"] == CAM else high
        )

    def off(self):
        """Return by how much the axis misses the mark on which it should be homed, mm."""
        place = self.plant.place - (self.axis.var("ActualPosition") - HOME)
        mark = self.mark()
        return off_a_mark(place, 5.0) if mark is None else place - mark


@pytest.mark.requirement("HOM-034", "HOM-193", "HOM-195", "HOM-196", "HOM-198", "HOM-107", "HOM-111")
@settings(max_examples=25, deadline=None, derandomize=True, suppress_health_check=list(HealthCheck))
@given(st.sampled_from([ZERO_MARK, CAM, INPUT]), st.sampled_from([1, -1]), PLACES)
@example(
    CAM, 1, [("home 3", 100), ("home 3", 100), ("home 8", 10), ("encoder lost", 50), ("encoder back", 50)]
)
@example(
    INPUT,
    -1,
    [
        ("home 3", 150),
        ("override 0", 100),
        ("override 200", 10),
        ("stop", 20),
        ("release", 1),
        ("home 5", 200),
    ],
)
@example(
    ZERO_MARK,
    1,
    [("home 3", 20), ("limit bounces", 20), ("reset", 20), ("home 3", 20), ("off", 5), ("on", 100)],
)
@example(ZERO_MARK, 1, [("relative", 64), ("jog", 199)])
@example(ZERO_MARK, 1, [("home 3", 1), ("home 2", 1), ("home 2", 5)])
def test_nothing_confuses_homing(mode, direction, deeds):
    """Jobs, faults, overrides and switches in any order; afterwards an operator homes the axis, on the right
    mark.
    """
    machine = Machine(mode, direction)
    for what, cycles in deeds:
        machine.do(what)
        for _ in range(cycles):
            machine.rig.cycles(1)
            machine.judge()
    machine.recover()
    job = machine.axis.home(HOME, mode=3)
    machine.rig.until(job.ended, 60.0)
    machine.rig.run(0.3)
    assert job.Done, f"ErrorID {job.ErrorID:04X}h"
    assert machine.axis.var("StatusWord.X5") is True
    assert abs(machine.off()) <= (3.0 * 40.0 * CYCLE if mode == INPUT else 0.01)
