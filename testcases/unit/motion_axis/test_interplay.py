"""What happens when stops, alarms, acknowledgements and MC_Power meet each other in an unusual order."""

from __future__ import annotations

import pytest

from motion.s7.axis import AxisState

ALARM_STAYS_ENABLED = 533


def raise_alarm(rig, number, **facts):
    rig.axis.object.alarms.raise_alarm(number, **facts)


@pytest.mark.requirement("STP-119", "STP-110")
@pytest.mark.parametrize("slow", ["halt", "stop", "velocity", "relative", "power"])
def test_acceleration_that_is_carried_over_respects_the_maximum_velocity(rig, slow):
    """A small jerk after an acceleration without jerk limit does not lift the velocity above MaxVelocity."""
    rig.enabled()
    rig.axis.move_velocity(500.0, Acceleration=2000.0, Jerk=0.0)
    rig.until(lambda: rig.column("velocity_setpoint")[-1] > 470.0)
    {
        "halt": lambda: rig.axis.halt(Jerk=1000.0),
        "stop": lambda: rig.axis.stop(3, Jerk=1000.0),
        "velocity": lambda: rig.axis.move_velocity(0.0, Jerk=1000.0),
        "relative": lambda: rig.axis.move_relative(10.0, Jerk=1000.0),
        "power": lambda: rig.axis.power(False, stop_mode=2),
    }[slow]()
    rig.run(1.0)
    assert max(rig.column("velocity_setpoint")) <= 500.0 + 1e-6


@pytest.mark.requirement("STP-122")
def test_job_after_an_acknowledged_emergency_ramp_does_not_run_backwards(rig):
    """The deceleration of the emergency ramp does not carry the axis through zero against the new job."""
    rig.travelling()
    raise_alarm(rig, 321)
    rig.cycles(4)
    rig.until(rig.axis.reset().done)
    job = rig.axis.move_velocity(50.0)
    rig.until(job.in_velocity)
    assert min(rig.column("velocity_setpoint")) >= -1e-6
    assert min(rig.column("actual_velocity")) > -5.0


@pytest.mark.requirement("STP-123", "STP-054")
def test_emergency_ramp_out_of_the_cycle_starts_without_a_step(make_rig):
    """An alarm of the cycle itself (hardware limit) brakes from the first cycle on and never accelerates
    first.
    """
    rig = make_rig(variables={"PositionLimits_HW.Active": True, "PositionLimits_HW.ApproachBehavior": 1})
    rig.travelling()
    steady = rig.column("speed_output")[-1]
    seen = len(rig.rows)
    rig.port.switches = 2
    rig.run(0.3)
    assert [event.data["number"] for event in rig.events("alarm.raised")] == [531]
    output = rig.column("speed_output")[seen:]
    first = next(i for i, value in enumerate(output) if value != pytest.approx(steady))
    assert output[first] == pytest.approx(steady - 4000.0 * 0.004 * 60.0 / 10.0, abs=1.0)
    assert max(output) <= steady + 1e-6


@pytest.mark.requirement("STP-396", "STP-251")
def test_no_job_on_an_axis_that_is_to_be_disabled(rig):
    """After MC_Power.Enable fell during an alarm ramp, an acknowledgement does not open the way for jobs."""
    rig.travelling()
    raise_alarm(rig, 321)
    rig.cycles(2)
    rig.axis.power(False, stop_mode=2)
    rig.axis.reset()
    rig.cycles(4)
    job = rig.axis.move_velocity(50.0)
    rig.cycles(2)
    assert job.Error
    assert job.ErrorID == 0x800F
    rig.until(lambda: rig.axis.state is AxisState.DISABLED)


@pytest.mark.requirement("STP-396")
def test_enable_that_rises_again_during_the_ramp_does_not_cancel_the_disabling(rig):
    """MC_Power 1-0-1 during an alarm ramp: the drive is switched off at its end, then on again."""
    rig.travelling()
    raise_alarm(rig, 321)
    rig.cycles(2)
    rig.axis.power(False, stop_mode=2)
    rig.cycles(2)
    power = rig.axis.power(True)
    rig.axis.reset()
    rig.until(lambda: rig.axis.state is AxisState.DISABLED)
    rig.until(power.status)


@pytest.mark.requirement("STP-255", "STP-415")
def test_jobs_are_refused_while_a_stop_inside_an_alarm_ramp_goes_on(rig):
    """MC_Stop on an alarm ramp that is acknowledged early still locks the axis until Execute falls."""
    rig.travelling()
    raise_alarm(rig, 104)
    rig.cycles(2)
    stop = rig.axis.stop(0)
    rig.cycles(2)
    rig.axis.reset()
    rig.cycles(4)
    jobs = [rig.axis.move_relative(5.0), rig.axis.move_velocity(5.0), rig.axis.halt()]
    rig.cycles(2)
    assert [job.ErrorID for job in jobs] == [0x800F] * 3
    rig.run(1.0)
    assert rig.axis.state is AxisState.STOP_HOLD
    stop.set(Execute=False)
    rig.until(lambda: rig.axis.state is AxisState.STANDSTILL)


@pytest.mark.exhaustive
@pytest.mark.requirement("STP-415", "STP-430")
@pytest.mark.parametrize("at_rest", [False, True])
def test_stop_keeps_its_lock_over_an_alarm_that_stays_enabled(rig, at_rest):
    """An alarm with reaction 1 and its acknowledgement do not release MC_Stop."""
    rig.travelling()
    stop = rig.axis.stop(0)
    if at_rest:
        rig.until(stop.done)
    else:
        rig.cycles(2)
    raise_alarm(rig, ALARM_STAYS_ENABLED, reaction=1)
    rig.run(1.0)
    assert rig.axis.state is AxisState.ALARM_STANDSTILL
    rig.axis.reset()
    rig.cycles(4)
    assert rig.axis.state is AxisState.STOP_HOLD
    job = rig.axis.move_velocity(10.0)
    rig.cycles(2)
    assert job.ErrorID == 0x800F


@pytest.mark.requirement("STP-396", "STP-503", "STP-508")
def test_reaction_5_on_a_disabling_ramp_ends_disabled(rig):
    """Tracking does not take the place of a disabling, and an acknowledgement never enables the axis."""
    rig.travelling()
    raise_alarm(rig, 321)
    rig.cycles(2)
    rig.axis.power(False, stop_mode=0)
    raise_alarm(rig, 550)
    rig.run(5.0)
    assert rig.axis.state is AxisState.ALARM_DISABLED
    rig.axis.reset()
    rig.run(0.5)
    assert rig.axis.state is AxisState.DISABLED


@pytest.mark.requirement("STP-488", "STP-491")
def test_speed_axis_without_link_can_be_switched_off(make_rig):
    """The last speed before the loss of the link does not keep the axis from arriving in the disabled
    state.
    """
    rig = make_rig(speed=True, variables={"Actor.RemoveEnableReaction": 3})
    rig.enabled()
    job = rig.axis.move_velocity(1000.0)
    rig.until(job.in_velocity)
    rig.port.link = False
    rig.run(3.0)
    power = rig.axis.power(False)
    rig.until(power.off)


@pytest.mark.requirement("MC-163", "STP-026")
@pytest.mark.parametrize("wrong", [{"stop_mode": 7}, {"start_mode": 5}])
def test_wrong_mode_does_not_keep_the_axis_enabled(rig, wrong):
    """MC_Power with a mode that does not exist still disables; only the wrong StopMode is an error then."""
    rig.travelling()
    power = rig.axis.power(False, **wrong)
    rig.cycles(2)
    assert power.Error is ("stop_mode" in wrong)
    rig.until(power.off)


@pytest.mark.requirement("MC-333")
def test_jog_starts_again_after_an_abort_during_its_braking(rig):
    """An input that rises after both were FALSE is a new command, whatever ended the previous one."""
    rig.enabled()
    jog = rig.axis.jog(100.0)
    rig.run(0.5)
    jog.set(JogForward=False)
    rig.cycles(2)
    rig.axis.halt()
    rig.cycles(2)
    jog.set(JogForward=True)
    rig.until(jog.in_velocity)


@pytest.mark.parametrize("value", [None, "5", 10**400, float("nan"), 1e13, True])
def test_position_that_is_no_number_in_range_is_an_error_of_the_instruction(rig, value):
    """Whatever stands at the input, the cycle goes on and the instruction says 16#8009."""
    rig.enabled()
    job = rig.axis.move_relative(value)
    rig.cycles(2)
    assert job.Error
    assert rig.axis.state is AxisState.STANDSTILL


@pytest.mark.parametrize("name", ["Velocity", "Acceleration", "Deceleration", "Jerk"])
def test_dynamic_value_too_small_to_plan_with(rig, name):
    """Denormal dynamics are refused instead of breaking the cycle."""
    rig.enabled()
    job = rig.axis.move_relative(100.0, **{name: 1e-320})
    rig.cycles(2)
    assert job.Error


@pytest.mark.requirement("STP-072", "MC-171", "STP-513")
@pytest.mark.parametrize("number", [431, 421])
def test_acknowledging_a_lasting_cause_leaves_no_gap(rig, number):
    """MC_Reset while the link is down, or the drive has its fault: the alarm comes again at once, X1 never
    falls.
    """
    rig.travelling()
    if number == 431:
        rig.port.link = False
    else:
        rig.port.fault = True
    rig.run(1.0)
    seen = len(rig.rows)
    reset = rig.axis.reset()
    rig.until(reset.done)
    rig.cycles(5)
    assert [event.data["number"] for event in rig.events("alarm.raised")] == [number, number]
    assert all(int(word) & 2 for word in rig.column("status_word")[seen:])
    assert set(rig.column("alarm_number")[seen:]) == {number}
    assert not rig.axis.power_instance.Status
