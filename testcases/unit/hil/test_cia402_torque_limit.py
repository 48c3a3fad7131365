"""MC_TorqueLimiting on a CiA 402 drive: 6072h by SDO, bit 11 of the status word (section 8.3 of the
instruction specification).
"""

from __future__ import annotations

from dataclasses import replace

import pytest

from hil.bench import load_bench
from hil.bench.bench import Bench
from hil.faults import Injector
from testcases.unit.hil.test_hil_profidrive import enabled
from testcases.unit.hil.test_torque_instructions import FIXED_STOP, STOP_MM

RATED = 2.0


def bench(stop=False, **variables):
    """Return the reference bench; with an end stop at 100 mm and no limit switch before it."""
    config = load_bench("reference").config
    axis = config.axis["axis1"]
    axis = axis.model_copy(
        update={"variables": {**axis.variables, **(FIXED_STOP if stop else {}), **variables}}
    )
    drive = config.drive["drive1"]
    if stop:
        drive = drive.model_copy(update={"mechanics": replace(drive.mechanics, positive_stop_mm=STOP_MM)})
    return Bench(config.model_copy(update={"axis": {"axis1": axis}, "drive": {"drive1": drive}}), seed=1)


def limit(machine):
    return machine.drive().slave.get(0x6072)


@pytest.mark.requirement("MC-585", "MC-544", "MC-549", "MC-113")
def test_limit_in_the_drive():
    """0.5 of 2 Nm are 250 thousandths; the input counts while Enable is TRUE; the drive's own value comes
    back.
    """
    with bench() as machine:
        axis = enabled(machine)
        own = limit(machine)
        job = axis.torque_limiting(0.5)
        machine.run_for(0.1)
        assert job.Busy
        assert axis.var("StatusWord.X26")
        assert limit(machine) == 250
        job.set(Limit=1.0)
        machine.run_for(0.1)
        assert limit(machine) == 500
        job.set(Limit=RATED)  # no reduction, as in a telegram
        machine.run_for(0.1)
        assert limit(machine) == own
        job.set(Limit=0.25)
        machine.run_for(0.1)
        job.set(Enable=False)
        machine.run_for(0.1)
        assert limit(machine) == own
        assert not axis.var("StatusWord.X26")


@pytest.mark.exhaustive
@pytest.mark.requirement("MC-585", "MC-547")
def test_in_limitation_is_bit_11():
    """Too little torque for the acceleration: the drive stays at its limit, and InLimitation and X27 tell."""
    with bench(**{"FollowingError.EnableMonitoring": False}) as machine:
        axis = enabled(machine)
        job = axis.torque_limiting(0.12)
        machine.run_for(0.1)
        assert not job.InLimitation
        axis.move_relative(100.0, Velocity=300.0, Acceleration=2000.0, Jerk=0.0)
        machine.run_for(0.2)
        assert job.InLimitation
        assert axis.var("StatusWord.X27")
        assert machine.drive().core.torque == pytest.approx(0.12, abs=0.005)
        job.set(Enable=False)
        machine.run_for(2.0)
        assert not axis.var("StatusWord.X27")


@pytest.mark.exhaustive
@pytest.mark.requirement("MC-585", "MC-553", "MC-546", "MC-602")
def test_fixed_stop():
    """Travel to the stop at 100 mm with 0.5 Nm: clamped, the job aborted, the drive presses with its limit;
    away again.
    """
    with bench(stop=True) as machine:
        axis = enabled(machine)
        limiting = axis.torque_limiting(0.5, mode=1)
        machine.run_for(0.1)
        moving = axis.move_velocity(50.0)
        assert machine.run_until(limiting.in_clamping, 5.0)
        machine.run_for(0.2)
        assert moving.CommandAborted
        assert machine.drive().core.torque == pytest.approx(0.5, abs=0.05)
        assert machine.run_until(axis.move_relative(-20.0).done, 3.0)
        assert not limiting.InClamping
        limiting.set(Enable=False)
        machine.run_for(0.1)
        assert limit(machine) == 3000


@pytest.mark.exhaustive
@pytest.mark.requirement("MC-585")
def test_a_drive_that_has_started_again_gets_the_limit_again():
    """A power cycle of the drive takes the limit away; it is written again when the drive is back."""
    with bench() as machine:
        axis = enabled(machine)
        axis.torque_limiting(0.5)
        machine.run_for(0.1)
        assert limit(machine) == 250
        Injector(machine).inject("drive.power_off", "drive1", duration_s=0.3)
        machine.run_for(3.0)
        assert limit(machine) == 250


@pytest.mark.requirement("MC-585")
def test_a_drive_that_refuses():
    """The history tells that the limit is not in force, and why."""
    with bench() as machine:
        axis = enabled(machine)
        Injector(machine).inject("drive.sdo_abort", "drive1", index=0x6072)
        axis.torque_limiting(0.5)
        machine.run_for(0.2)
        (event,) = machine.history.select(kind="drive.limit_refused")
        assert event.data["object"] == "6072h"
        assert "abort" in event.data["reason"] or "h " in event.data["reason"]
