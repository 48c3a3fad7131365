"""Active homing from any place on benches of both profiles: on the right mark or with the right alarm, never
in a stop at speed.
"""

from __future__ import annotations

import pytest
from hypothesis import HealthCheck, given, settings

from testcases.unit.hil.homing_bench import Machine, homing_bench
from testcases.unit.homing_machines import (
    HOME,
    LIMIT,
    admissible,
    broken_machines,
    clearance,
    honest_end,
    machines,
    right_mark_or_right_alarm,
    variables,
)

pytestmark = pytest.mark.exhaustive

CYCLE = 0.004
STOP = LIMIT + clearance(CYCLE)
FEW = settings(max_examples=4, deadline=None, derandomize=True, suppress_health_check=list(HealthCheck))


def homed(name, machine):
    """Home on a bench; returns what there is to be judged."""
    counts = 2048 if name == "profidrive" else 131072
    low, high = machine["cam"]
    wrong = machine.get("wrong", "nothing")
    if wrong == "no cam":
        low, high = 5000.0, 5100.0
    mark = round(machine["phase"] / 10.0 * counts) % counts
    machine["phase"] = mark / counts * 10.0
    with homing_bench(
        name,
        variables=variables(machine) | {"PositionLimits_HW.Active": False},
        switches={
            "home_from_mm": low,
            "home_to_mm": high,
            "negative_limit_mm": -LIMIT,
            "positive_limit_mm": LIMIT,
        },
        mechanics={
            "start_position_mm": machine["start"],
            "negative_stop_mm": -STOP,
            "positive_stop_mm": STOP,
        },
        drive={"index_increments": mark},
    ) as bench:
        drive = bench.drive()
        if wrong == "cam always on":
            drive.force_input("home", True)
        elif wrong == "inverted cam":
            drive.invert_input("home", True)
        elif wrong == "limits exchanged":
            drive.swap_limit_switches(True)
        elif wrong == "both limits on":
            drive.force_input("negative_limit", True)
            drive.force_input("positive_limit", True)
        run = Machine(bench)
        job = run.axis.home(HOME, mode=3)
        run.axis.write_parameter(1000, True)
        run.until(job.ended, 120.0)
        run.run(1.0)
        trace = bench.trace()
        places = trace["drive1.position"].values * 1000.0
        assert max(abs(places)) < STOP
        return {
            "job": job,
            "homed_on": run.place - (run.position - HOME),
            "alarms": run.alarms(),
            "axis": run.axis,
            "cycle_s": CYCLE,
        }


@pytest.mark.requirement(
    "HOM-068", "HOM-070", "HOM-099", "HOM-107", "HOM-108", "HOM-111", "HOM-114", "HOM-097", "HOM-112"
)
@pytest.mark.parametrize("name", ["profidrive", "reference"])
def test_right_mark_or_right_alarm(name):
    """Over PROFIdrive by the reference mark search, over CiA 402 by the touch probe: the same outcome."""

    @FEW
    @given(machines())
    def run(machine):
        admissible(machine, clearance(CYCLE))
        right_mark_or_right_alarm(machine, **homed(name, machine))

    run()


@pytest.mark.requirement("HOM-097", "HOM-107", "HOM-109", "HOM-111", "HOM-112", "HOM-114")
@pytest.mark.parametrize("name", ["profidrive", "reference"])
def test_broken_machines(name):
    """Switches of any place, missing, stuck, inverted or exchanged: an honest end before the stop."""

    @FEW
    @given(broken_machines())
    def run(machine):
        honest_end(machine, **homed(name, machine))

    run()
