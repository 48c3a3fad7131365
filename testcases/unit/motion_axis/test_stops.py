"""Stops of an axis on exact numbers: ramps, control words, jobs (sections 0.3 and 8 of the stopping
specification).
"""

from __future__ import annotations

from itertools import pairwise

import pytest

from motion.s7.axis import AxisState

TWO_CYCLES = 0.008


def words(rig, since):
    """Return the sequence of distinct control words sent since a time."""
    sequence = []
    for time, word in zip(rig.times(), rig.column("stw1"), strict=True):
        if time >= since and (not sequence or sequence[-1] != word):
            sequence.append(int(word))
    return sequence


@pytest.mark.parametrize(
    ("mode", "seconds", "travel"),
    [
        pytest.param(0, 0.075, 11.25, marks=pytest.mark.requirement("STP-008", "STP-301")),
        pytest.param(2, 0.250, 37.5, marks=pytest.mark.requirement("STP-009", "STP-324")),
    ],
)
def test_ramp_of_power_stop_mode(rig, mode, seconds, travel):
    """MC_Power StopMode 0 and 2 brake the setpoint in the time and way of the specification, then disable."""
    rig.travelling()
    start = rig.scheduler.now / 1e9
    power = rig.axis.power(False, stop_mode=mode)
    rig.until(power.off)

    duration, way = rig.stop_of_setpoint(start)
    assert duration == pytest.approx(seconds, abs=TWO_CYCLES)
    assert way == pytest.approx(travel, abs=300.0 * TWO_CYCLES)
    assert rig.job.CommandAborted
    assert rig.axis.state is AxisState.DISABLED
    assert words(rig, start) == [0x047F, 0x047E]


@pytest.mark.requirement("STP-010", "STP-315", "STP-316", "STP-319", "STP-320")
def test_quick_stop_is_the_drives_own_ramp(rig):
    """StopMode 1: setpoint zero as a step, OFF3 ramp of the drive, then OFF1 and OFF2, then the idle
    pattern.
    """
    rig.travelling()
    start = rig.scheduler.now / 1e9
    power = rig.axis.power(False, stop_mode=1)
    rig.until(power.off)

    speed = [v for t, v in zip(rig.times(), rig.column("actual_velocity"), strict=True) if t >= start]
    ramp = sum(0.5 < v < 299.5 for v in speed) * 0.004
    assert ramp == pytest.approx(0.300, abs=TWO_CYCLES)
    assert words(rig, start) == [0x047F, 0x047B, 0x0478, 0x047E]
    outputs = [v for t, v in zip(rig.times(), rig.column("speed_output"), strict=True) if t > start + 0.004]
    assert outputs[0] == 0.0


@pytest.mark.requirement("STP-336", "STP-338", "STP-288")
def test_coast_withdraws_off2_and_keeps_it(rig):
    """StopMode 3: OFF2 and OFF1 at once, disabled while the axis still turns, the withdrawn bits stay."""
    rig.travelling()
    start = rig.scheduler.now / 1e9
    power = rig.axis.power(False, stop_mode=3)
    rig.until(power.off)

    assert rig.axis.actual_velocity > 250.0
    assert words(rig, start) == [0x047F, 0x047C]
    rig.run(3.0)
    assert words(rig, start) == [0x047F, 0x047C]
    assert rig.axis.var("StatusWord.X7")


@pytest.mark.parametrize(
    ("inputs", "seconds", "travel"),
    [
        pytest.param({"mode": 0}, 0.075, 11.25, marks=pytest.mark.requirement("STP-008", "STP-416")),
        pytest.param({"mode": 2}, 0.250, 37.5, marks=pytest.mark.requirement("STP-009", "STP-418")),
        pytest.param({"mode": 3}, 0.400, 60.0, marks=pytest.mark.requirement("STP-012", "STP-419")),
        pytest.param(
            {"mode": 3, "Deceleration": 3000.0, "Jerk": 10000.0}, 0.346, 51.96,
            marks=pytest.mark.requirement("STP-013"),
        ),
    ],
)  # fmt: skip
def test_ramp_of_mc_stop(rig, inputs, seconds, travel):
    """MC_Stop brakes with the dynamics of its mode, stays enabled and locks the axis while Execute is
    TRUE.
    """
    rig.travelling()
    start = rig.scheduler.now / 1e9
    stop = rig.axis.stop(**inputs)
    rig.until(stop.done)

    duration, way = rig.stop_of_setpoint(start)
    assert duration == pytest.approx(seconds, abs=TWO_CYCLES)
    assert way == pytest.approx(travel, abs=300.0 * TWO_CYCLES)
    assert rig.job.CommandAborted
    assert rig.axis.state is AxisState.STOP_HOLD
    assert rig.axis.var("StatusWord2.X0")
    assert words(rig, start) == [0x047F]


@pytest.mark.requirement("STP-430", "STP-431", "MC-409", "MC-427", "MC-429")
def test_mc_stop_blocks_until_released(rig):
    """A job started while MC_Stop holds is refused with 16#800F; after the release a new edge moves the
    axis.
    """
    rig.travelling()
    stop = rig.axis.stop(0)
    rig.until(stop.done)
    refused = rig.axis.move_velocity(50.0)
    rig.cycles(2)
    assert (refused.Error, refused.ErrorID) == (True, 0x800F)
    stop.set(Execute=False)
    rig.cycles(2)
    assert not rig.axis.var("StatusWord2.X0")
    again = rig.axis.move_velocity(50.0)
    rig.until(again.in_velocity)


@pytest.mark.requirement("STP-012", "STP-409", "STP-411", "MC-229")
def test_halt_with_defaults(rig):
    """MC_Halt brakes with the dynamic defaults in 400 ms and 60 mm and leaves the axis enabled."""
    rig.travelling()
    start = rig.scheduler.now / 1e9
    halt = rig.axis.halt()
    rig.until(halt.done)
    duration, way = rig.stop_of_setpoint(start)
    assert duration == pytest.approx(0.400, abs=TWO_CYCLES)
    assert way == pytest.approx(60.0, abs=300.0 * TWO_CYCLES)
    assert rig.axis.state is AxisState.STANDSTILL


@pytest.mark.requirement("STP-402", "STP-413", "OVR-014")
def test_motion_job_supersedes_halt(rig):
    """A motion job started during the ramp of MC_Halt takes over."""
    rig.travelling()
    halt = rig.axis.halt()
    rig.run(0.1)
    move = rig.axis.move_velocity(200.0)
    rig.until(move.in_velocity)
    assert halt.CommandAborted
    assert rig.axis.var("Velocity") == pytest.approx(200.0)


@pytest.mark.parametrize(
    ("reaction", "number", "seconds", "travel"),
    [
        pytest.param(1, 533, 0.400, 60.0, marks=pytest.mark.requirement("STP-012", "STP-386")),
        pytest.param(2, 104, 0.250, 37.5, marks=pytest.mark.requirement("STP-009", "STP-387")),
        pytest.param(3, 321, 0.075, 11.25, marks=pytest.mark.requirement("STP-008", "STP-388")),
    ],
)
def test_ramp_of_alarm_reactions(rig, reaction, number, seconds, travel):
    """Reactions 1 to 3 brake with current, maximum and emergency dynamics; jobs end with 16#8001."""
    rig.travelling()
    start = rig.scheduler.now / 1e9
    rig.axis.alarms.raise_alarm(number, reaction=reaction)
    rig.run(0.6)
    duration, way = rig.stop_of_setpoint(start)
    assert duration == pytest.approx(seconds, abs=TWO_CYCLES)
    assert way == pytest.approx(travel, abs=300.0 * TWO_CYCLES)
    assert (rig.job.Error, rig.job.ErrorID) == (True, 0x8001)


@pytest.mark.requirement("STP-343", "STP-344", "STP-393", "STP-394", "STP-033")
def test_disabling_reaction_and_automatic_enable(rig):
    """After reaction 2 the axis is disabled with Busy TRUE; the acknowledgement enables it without a new
    edge.
    """
    rig.travelling()
    rig.axis.alarms.raise_alarm(104)
    rig.run(0.5)
    power = rig.axis.power_instance
    assert (rig.axis.state, power.Status, power.Busy) == (AxisState.ALARM_DISABLED, False, True)
    reset = rig.axis.reset()
    rig.until(reset.done)
    rig.until(power.status)
    assert rig.axis.state is AxisState.STANDSTILL
    assert not rig.axis.var("StatusWord.X1")


@pytest.mark.parametrize(
    ("value", "sequence", "seconds"),
    [
        pytest.param(1, [0x047F, 0x047E], 0.600, marks=pytest.mark.requirement("STP-011", "STP-363")),
        pytest.param(5, [0x047F, 0x047A], 0.300, marks=pytest.mark.requirement("STP-010", "STP-365")),
        pytest.param(
            7, [0x047F, 0x047B, 0x0478], 0.300, marks=pytest.mark.requirement("STP-010", "STP-366", "STP-367")
        ),
    ],
)
def test_remove_enable_patterns(make_rig, value, sequence, seconds):
    """Reaction 4 sends the pattern of RemoveEnableReaction; the drive brakes on its own ramp."""
    rig = make_rig(variables={"Actor.RemoveEnableReaction": value})
    rig.travelling()
    start = rig.scheduler.now / 1e9
    rig.axis.alarms.raise_alarm(521)
    rig.cycles(1)
    assert not rig.axis.power_instance.Status
    rig.run(1.0)
    speed = [v for t, v in zip(rig.times(), rig.column("actual_velocity"), strict=True) if t >= start]
    assert sum(0.5 < v < 299.5 for v in speed) * 0.004 == pytest.approx(seconds, abs=TWO_CYCLES)
    assert words(rig, start) == sequence
    assert rig.axis.state is AxisState.ALARM_DISABLED


@pytest.mark.requirement("STP-353", "STP-364")
def test_remove_enable_by_coasting(make_rig):
    """RemoveEnableReaction 16#3 takes OFF2 and OFF1 away; the object waits for standstill."""
    rig = make_rig(variables={"Actor.RemoveEnableReaction": 3})
    rig.travelling()
    start = rig.scheduler.now / 1e9
    rig.axis.alarms.raise_alarm(521)
    rig.run(0.5)
    assert rig.axis.state is AxisState.ALARM_DRIVE_STOP
    rig.run(2.0)
    assert rig.axis.state is AxisState.ALARM_DISABLED
    assert words(rig, start) == [0x047F, 0x047C]


@pytest.mark.parametrize(
    ("first", "second", "aborted", "severity"),
    [
        pytest.param(
            ("alarm", 2), ("stop", 0), False, 3, marks=pytest.mark.requirement("STP-438", "STP-439", "MC-421")
        ),
        pytest.param(
            ("stop", 3), ("alarm", 2), True, 2, marks=pytest.mark.requirement("STP-437", "STP-440", "MC-420")
        ),
        pytest.param(("alarm", 3), ("stop", 0), True, 3, marks=pytest.mark.requirement("STP-441", "STP-521")),
        pytest.param(
            ("stop", 2), ("alarm", 2), False, 2, marks=pytest.mark.requirement("STP-442", "STP-517")
        ),
        pytest.param(("alarm", 2), ("stop", 3), True, 2, marks=pytest.mark.requirement("STP-520")),
        pytest.param(("alarm", 1), ("stop", 2), False, 2, marks=pytest.mark.requirement("STP-519")),
        pytest.param(("stop", 0), ("alarm", 3), False, 3, marks=pytest.mark.requirement("STP-518")),
    ],
)
def test_alarm_reaction_against_mc_stop(rig, first, second, aborted, severity):
    """The more severe stop wins; an MC_Stop that loses shows CommandAborted and no error."""
    number = {1: 533, 2: 104, 3: 321}
    rig.travelling()
    stop = None
    for kind, value in (first, second):
        if kind == "stop":
            stop = rig.axis.stop(value)
            rig.run(0.02)
        else:
            rig.axis.alarms.raise_alarm(number[value], reaction=value)
            rig.run(0.02)
    assert stop.CommandAborted is aborted
    assert not stop.Error
    assert rig.axis.motion.severity == severity
    rig.run(1.0)
    assert stop.Done is not aborted


@pytest.mark.exhaustive
@pytest.mark.requirement("STP-439")
def test_example_1_numbers(rig):
    """Reaction 2, then MC_Stop Mode 0 100 ms later: 150 ms and 31.7 mm in all."""
    rig.travelling()
    start = rig.scheduler.now / 1e9
    rig.axis.alarms.raise_alarm(104)
    rig.run(0.096)
    rig.axis.stop(0)
    rig.run(0.5)
    duration, way = rig.stop_of_setpoint(start)
    assert duration == pytest.approx(0.150, abs=TWO_CYCLES)
    assert way == pytest.approx(31.7, abs=300.0 * TWO_CYCLES)


@pytest.mark.requirement("STP-423", "MC-419")
def test_weaker_mc_stop_is_turned_away(rig):
    """MC_Stop Mode 3 during Mode 0 gets CommandAborted; Mode 0 during Mode 3 takes over."""
    rig.travelling()
    weak = rig.axis.stop(3)
    rig.run(0.05)
    strong = rig.axis.stop(0)
    rig.run(0.02)
    assert weak.CommandAborted
    late = rig.axis.stop(3)
    rig.cycles(2)
    assert (late.CommandAborted, late.Error, strong.CommandAborted) == (True, False, False)


@pytest.mark.requirement("STP-384", "VAR-137")
def test_disabling_during_remove_enable_coasts(make_rig):
    """RemoveEnableReaction other than 16#7: Enable = FALSE during the ramp leads to OFF2 whatever StopMode
    says.
    """
    rig = make_rig(variables={"Actor.RemoveEnableReaction": 1})
    rig.travelling()
    rig.axis.alarms.raise_alarm(521)
    rig.run(0.1)
    start = rig.scheduler.now / 1e9
    rig.axis.power(False, stop_mode=0)
    rig.cycles(3)
    assert words(rig, start)[-1] == 0x047C


@pytest.mark.requirement("STP-385", "MC-155", "VAR-137")
def test_disabling_during_off3_waits_for_standstill(rig):
    """RemoveEnableReaction 16#7: OFF2 is not withdrawn before standstill; then the axis is disabled."""
    rig.travelling()
    rig.axis.alarms.raise_alarm(521)
    rig.run(0.1)
    start = rig.scheduler.now / 1e9
    power = rig.axis.power(False, stop_mode=3)
    rig.until(power.off)
    assert words(rig, start) == [0x047B, 0x0478]
    assert abs(rig.axis.actual_velocity) < 1.0


@pytest.mark.requirement("STP-382", "STP-489")
def test_acknowledging_an_off1_ramp_interrupts_it(make_rig):
    """Acknowledged during OFF1 the drive goes on, the axis enables while moving and comes to rest."""
    rig = make_rig(variables={"Actor.RemoveEnableReaction": 1})
    rig.travelling()
    rig.axis.alarms.raise_alarm(521)
    rig.run(0.1)
    rig.axis.reset()
    power = rig.axis.power_instance
    rig.until(power.status)
    assert rig.axis.actual_velocity > 100.0
    rig.run(0.5)
    assert rig.axis.state is AxisState.STANDSTILL
    assert abs(rig.axis.actual_velocity) < 0.5


@pytest.mark.requirement("STP-296", "STP-502", "MC-154")
def test_disabling_cannot_be_cancelled(rig):
    """Enable = TRUE during the ramp does not stop the braking; the axis is enabled again afterwards by
    itself.
    """
    rig.travelling()
    rig.axis.power(False, stop_mode=2)
    rig.run(0.05)
    assert rig.axis.state is AxisState.DISABLING_RAMP
    asked = len(rig.rows)
    power = rig.axis.power()
    rig.until(lambda: rig.axis.state is AxisState.DISABLED)
    speeds = rig.column("velocity_setpoint")[asked:]
    assert speeds[0] > 100.0
    assert all(after <= before for before, after in pairwise(speeds))
    assert speeds[-1] == 0.0
    assert not power.status()
    rig.until(power.status)
    assert rig.column("velocity_setpoint")[-1] == 0.0


@pytest.mark.requirement("STP-025", "STP-292")
def test_stop_mode_counts_at_the_falling_edge(rig):
    """StopMode may change while enabled; the value at the falling edge of Enable is executed."""
    rig.travelling()
    rig.axis.power(True, stop_mode=3)
    rig.cycles(2)
    start = rig.scheduler.now / 1e9
    rig.axis.power(False, stop_mode=3)
    rig.cycles(3)
    assert words(rig, start)[-1] == 0x047C


@pytest.mark.requirement("STP-589", "STP-597", "STP-598", "STP-591")
def test_alarm_that_keeps_the_axis_enabled(rig):
    """531 with reaction 3 brakes, stays enabled and refuses jobs until it is acknowledged."""
    rig.travelling()
    rig.axis.alarms.raise_alarm(531, reaction=3)
    rig.run(0.3)
    power = rig.axis.power_instance
    assert (rig.axis.state, power.Status) == (AxisState.ALARM_STANDSTILL, True)
    refused = rig.axis.move_velocity(-10.0)
    rig.cycles(2)
    assert refused.ErrorID == 0x8001
    reset = rig.axis.reset()
    rig.until(reset.done)
    rig.cycles(2)
    assert rig.axis.state is AxisState.STANDSTILL
    assert {word & ~0x80 for word in words(rig, 0.1)} == {0x047F}  # STW1.7 acknowledges in the drive


@pytest.mark.requirement("STP-396", "STP-503")
@pytest.mark.parametrize(
    ("reaction", "stop_mode", "state"),
    [(3, 2, "ALARM_RAMP"), (3, 0, "ALARM_RAMP"), (2, 0, "DISABLING_RAMP"), (1, 2, "DISABLING_RAMP"),
     (3, 1, "DISABLING_QUICK"), (1, 3, "DISABLING_COAST")],
)  # fmt: skip
def test_enable_falls_during_an_alarm_ramp(rig, reaction, stop_mode, state):
    """Quick stop and coast act at once, a ramp only when it is more severe; the axis ends disabled with Busy
    FALSE.
    """
    number = {1: 533, 2: 104, 3: 304}[reaction]
    rig.travelling()
    rig.axis.alarms.raise_alarm(number, reaction=reaction)
    rig.run(0.02)
    power = rig.axis.power(False, stop_mode=stop_mode)
    rig.cycles(1)
    assert rig.axis.state.name == state
    rig.until(power.off)
    assert rig.axis.state is AxisState.ALARM_DISABLED


@pytest.mark.requirement("STP-325")
def test_maximum_stop_takes_present_acceleration_along(rig):
    """StopMode 2 during acceleration: the velocity still rises by a^2 / (2 j) = 25 mm/s."""
    rig.enabled()
    rig.axis.move_velocity(450.0, Acceleration=1000.0, Jerk=10000.0)
    rig.run(0.25)
    rig.until(lambda: rig.axis.motion.gen.v >= 200.0)
    before = rig.axis.motion.gen.v
    start = rig.scheduler.now / 1e9
    rig.axis.power(False, stop_mode=2)
    rig.run(0.5)
    peak = max(v for t, v in zip(rig.times(), rig.column("velocity_setpoint"), strict=True) if t >= start)
    assert peak - before == pytest.approx(25.0, abs=1000.0 * TWO_CYCLES)


@pytest.mark.requirement("STP-403", "MC-239")
def test_abort_acceleration(rig):
    """MC_Halt with AbortAcceleration: the velocity does not rise any more; without, by 50 mm/s."""
    rig.enabled()
    rig.axis.move_velocity(450.0, Acceleration=1000.0, Jerk=10000.0)
    rig.until(lambda: rig.axis.motion.gen.v >= 200.0)
    before = rig.axis.motion.gen.v
    start = rig.scheduler.now / 1e9
    rig.axis.halt(AbortAcceleration=True, Jerk=10000.0)
    rig.run(0.5)
    peak = max(v for t, v in zip(rig.times(), rig.column("velocity_setpoint"), strict=True) if t >= start)
    assert peak - before <= 1000.0 * TWO_CYCLES
