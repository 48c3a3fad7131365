"""A speed axis on the same emulated drive, over the same bus."""

from __future__ import annotations

import pytest

from hil.bench import BenchFile, load_bench
from hil.bench.bench_file import read
from motion.s7.axis import AxisState


@pytest.fixture
def bench():
    with load_bench("speed").build(seed=1) as bench:
        yield bench


def running(bench, speed=600.0):
    axis = bench.axis()
    power = axis.power()
    assert bench.run_until(power.status, 2.0)
    job = axis.move_velocity(speed)
    assert bench.run_until(job.in_velocity, 3.0)
    bench.run_for(0.1)
    return axis, job


@pytest.mark.requirement("MC-042", "MC-102", "STP-515")
def test_speed_axis_turns_and_halts(bench):
    """MC_MoveVelocity reaches its speed at the motor, MC_Halt ends at setpoint zero, the axis stays
    enabled.
    """
    axis, _ = running(bench)
    assert axis.var("ActualSpeed") == pytest.approx(600.0, abs=1.0)
    halt = axis.halt()
    assert bench.run_until(halt.done, 2.0)
    bench.run_for(0.1)
    assert axis.var("ActualSpeed") == pytest.approx(0.0, abs=1.0)
    assert axis.var("StatusWord.X6")
    assert axis.state is AxisState.STANDSTILL


@pytest.mark.requirement("STP-292")
@pytest.mark.parametrize("mode", [0, 1, 2, 3])
def test_every_stop_mode_disables_the_speed_axis(bench, mode):
    """All four stop modes bring the drive to rest and end with Status and Busy FALSE."""
    axis, job = running(bench)
    power = axis.power(False, stop_mode=mode)
    assert bench.run_until(power.off, 3.0)
    assert bench.run_until(lambda: abs(bench.drive().mechanics.velocity) < 1e-6, 5.0)
    assert job.CommandAborted


@pytest.mark.exhaustive
@pytest.mark.requirement("STP-559")
def test_drive_fault_on_a_speed_axis(bench):
    """A drive fault raises 421 and is acknowledged together with the drive."""
    axis, job = running(bench)
    bench.drive().raise_fault(0x2310)
    bench.run_for(1.0)
    assert (axis.var("ErrorDetail.Number"), axis.var("ErrorDetail.Reaction")) == (421, 4)
    assert job.ErrorID == 0x8001
    reset = axis.reset()
    assert bench.run_until(reset.done, 2.0)
    assert bench.run_until(axis.power_instance.status, 2.0)


@pytest.mark.requirement("CFG-508", "CFG-499", "CFG-504")
def test_gear_and_lead_screw():
    """With a gear of 4:1 and a screw of 10 mm, 100 mm/s need 2400 rpm at the motor, and the machine really
    moves so.
    """
    source, text = read("reference")
    text = text.replace(
        '"Mechanics.LeadScrew" = 10.0', '"Mechanics.LeadScrew" = 10.0\n"LoadGear.Numerator" = 4'
    )
    text = text.replace(
        "off3_ramp_s = 0.5\n", "off3_ramp_s = 0.5\n[drive.drive1.mechanics]\ngear_numerator = 4\n"
    )
    with BenchFile(source, text).build(seed=1) as bench:
        axis = bench.axis()
        power = axis.power()
        assert bench.run_until(power.status, 2.0)
        job = axis.move_velocity(100.0)
        assert bench.run_until(job.in_velocity, 2.0)
        bench.run_for(0.1)
        assert axis.var("ActualSpeed") == pytest.approx(2400.0, abs=2.0)
        assert bench.drive().mechanics.velocity == pytest.approx(0.1, rel=0.002)
        assert axis.var("ActualPosition") == pytest.approx(bench.drive().mechanics.position * 1000.0, abs=0.5)


@pytest.mark.requirement("CFG-537", "CFG-533", "CFG-534", "CFG-540")
def test_both_directions_inverted():
    """With drive and encoder direction inverted the loop is closed the right way round; the machine moves
    backwards.
    """
    source, text = read("reference")
    text = text.replace(
        '"Mechanics.LeadScrew" = 10.0',
        '"Mechanics.LeadScrew" = 10.0\n"Actor.InverseDirection" = true\n"Sensor[1].InverseDirection" = true',
    )
    with BenchFile(source, text).build(seed=1) as bench:
        axis = bench.axis()
        power = axis.power()
        assert bench.run_until(power.status, 2.0)
        move = axis.move_relative(20.0)
        assert bench.run_until(move.done, 3.0)
        assert axis.var("ActualPosition") == pytest.approx(20.0, abs=0.1)
        assert bench.drive().mechanics.position * 1000.0 == pytest.approx(-20.0, abs=0.1)


@pytest.mark.requirement("CFG-539", "MON-040")
def test_one_direction_inverted_runs_away_until_521():
    """With one direction wrong the loop has positive feedback: alarm 521 stops it."""
    source, text = read("reference")
    text = text.replace(
        '"Mechanics.LeadScrew" = 10.0', '"Mechanics.LeadScrew" = 10.0\n"Sensor[1].InverseDirection" = true'
    )
    with BenchFile(source, text).build(seed=1) as bench:
        axis = bench.axis()
        power = axis.power()
        assert bench.run_until(power.status, 2.0)
        axis.move_relative(50.0)
        assert bench.run_until(lambda: axis.var("ErrorDetail.Number") == 521, 3.0)
        bench.run_for(1.0)
        assert abs(bench.drive().mechanics.velocity) < 1e-6


@pytest.mark.exhaustive
@pytest.mark.requirement("MC-205", "MC-206", "MC-214")
def test_absolute_encoder_keeps_its_position_over_a_power_cycle():
    """An absolute encoder adjusted with Mode 7 shows the same position after power-off and stays homed."""
    source, text = read("reference")
    text = text.replace("off3_ramp_s = 0.5\n", 'off3_ramp_s = 0.5\nencoder = "absolute"\n')
    with BenchFile(source, text).build(seed=1) as bench:
        axis = bench.axis()
        power = axis.power()
        assert bench.run_until(power.status, 2.0)
        home = axis.home(100.0, mode=7)
        assert bench.run_until(home.done, 1.0)
        assert axis.var("StatusSensor[1].Adjusted") == 1
        move = axis.move_absolute(130.0)
        assert bench.run_until(move.done, 3.0)
        before = axis.var("ActualPosition")
        bench.drive().power_off()
        bench.run_for(0.5)
        bench.drive().power_on()
        bench.run_for(1.0)
        assert axis.var("ActualPosition") == pytest.approx(before, abs=0.05)
        assert axis.var("StatusWord.X5")


@pytest.mark.exhaustive
@pytest.mark.requirement("C402-013", "STP-318")
def test_no_torque_after_the_drives_own_ramp():
    """As soon as a quick stop has ended, the drive gives no torque any more, not even in the step that ends
    it.
    """
    with load_bench("reference").build(seed=1) as bench:
        axis = bench.axis()
        power = axis.power()
        assert bench.run_until(power.status, 2.0)
        job = axis.move_velocity(300.0)
        assert bench.run_until(job.in_velocity, 2.0)
        axis.power(False, stop_mode=1)
        drive = bench.drive()
        assert bench.run_until(lambda: drive.core.torque != 0.0 and not axis.in_operation, 1.0)
        assert bench.run_until(lambda: not drive.core.enabled, 1.0)
        assert drive.core.torque == 0.0
        bench.run_for(0.5)
        assert drive.core.torque == 0.0
