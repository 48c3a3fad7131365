"""From any place, with any cam: active homing ends homed on the right mark or with the right alarm, and never
in a stop at speed.
"""

from __future__ import annotations

from math import tau

import pytest
from hypothesis import HealthCheck, example, given, settings

from motion.drives.port import INPUT_HOME, INPUT_NEGATIVE_LIMIT, INPUT_POSITIVE_LIMIT
from motion.drives.simulated import SimulatedDrivePort
from testcases.unit.homing_machines import (
    HOME,
    INPUT,
    LIMIT,
    PITCH,
    admissible,
    broken_machines,
    clearance,
    honest_end,
    machines,
    right_mark_or_right_alarm,
    variables,
)
from testcases.unit.motion_axis.conftest import CYCLE, Rig

pytestmark = pytest.mark.exhaustive

FULL = 131072
STOP = LIMIT + clearance(CYCLE)
"""Place of the end stop, mm."""


class Plant(SimulatedDrivePort):
    """A drive on a machine with cam and limit switches."""

    def __init__(self, machine):
        marks = [round((machine["phase"] + PITCH * turn) / 10.0 * FULL) for turn in range(-40, 40)]
        super().__init__(cycle_s=CYCLE, zero_marks=marks)
        self._angle = machine["start"] / 10.0 * tau
        self._cam = machine["cam"]
        self.wrong = machine.get("wrong", "nothing")
        self.farthest = abs(machine["start"])

    @property
    def place(self):
        return self._angle / tau * 10.0

    def read(self):
        super().read()
        place = self.place
        self.farthest = max(self.farthest, abs(place))
        low, high = self._cam
        wrong = self.wrong
        negative, positive, cam = place <= -LIMIT, place >= LIMIT, low <= place <= high
        if wrong == "limits exchanged":
            negative, positive = positive, negative
        elif wrong == "both limits on":
            negative = positive = True
        elif wrong == "no cam":
            cam = False
        elif wrong == "cam always on":
            cam = True
        elif wrong == "inverted cam":
            cam = not cam
        self.inputs = (
            (INPUT_NEGATIVE_LIMIT if negative else 0)
            | (INPUT_POSITIVE_LIMIT if positive else 0)
            | (INPUT_HOME if cam else 0)
        )


def homed(machine):
    """Home on a machine; returns what there is to be judged."""
    plant = Plant(machine)
    # Enabled without monitoring: who starts on a limit switch has acknowledged its alarm before.
    rig = Rig(port=plant, variables=variables(machine) | {"PositionLimits_HW.Active": False}).enabled()
    job = rig.axis.home(HOME, mode=3)
    rig.axis.write_parameter(1000, True)
    rig.until(job.ended, 120.0)
    rig.run(1.0)
    assert plant.farthest <= STOP
    return {
        "job": job,
        "homed_on": plant.place - (rig.axis.var("ActualPosition") - HOME),
        "alarms": [event.data["number"] for event in rig.events("alarm.raised")],
        "axis": rig.axis,
        "cycle_s": CYCLE,
    }


@pytest.mark.requirement(
    "HOM-068",
    "HOM-070",
    "HOM-091",
    "HOM-099",
    "HOM-107",
    "HOM-108",
    "HOM-111",
    "HOM-113",
    "HOM-114",
    "HOM-097",
    "HOM-112",
)
@settings(max_examples=50, deadline=None, derandomize=True, suppress_health_check=list(HealthCheck))
@given(machines())
@example(
    {
        "cam": (0.0, 3.0),
        "start": 3.0,
        "phase": 0.0,
        "mode": INPUT,
        "direction": -1,
        "approach": 1,
        "positive_side": True,
        "reversal": True,
        "velocity": 20.0,
    }
)
def test_right_mark_or_right_alarm(machine):
    """With reversal it is homed on the mark, if there is one; without, on the mark or stopped with 531 and
    342.
    """
    admissible(machine, clearance(CYCLE))
    right_mark_or_right_alarm(machine, **homed(machine))


@pytest.mark.requirement("HOM-097", "HOM-107", "HOM-109", "HOM-111", "HOM-112", "HOM-114")
@settings(max_examples=50, deadline=None, derandomize=True, suppress_health_check=list(HealthCheck))
@given(broken_machines())
def test_broken_machines(machine):
    """Cams of any place, missing, always on or inverted, limit switches exchanged or both on: an honest end
    before the stop.
    """
    honest_end(machine, **homed(machine))
