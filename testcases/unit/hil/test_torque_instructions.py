"""Torque instructions and MC_SetAxisSTW on the emulated drive (sections 2.13 and 2.17 of the instruction
specification).
"""

from __future__ import annotations

from dataclasses import replace

import pytest

from motion.drives.port import STW1_OPERATE
from motion.s7.axis import AxisState
from testcases.unit.hil.test_hil_profidrive import bench, enabled

STW2_WORD, MOMRED_WORD, ADD_WORD, HIGH_WORD, LOW_WORD = 3, 4, 10, 11, 12
X26, X27, X30 = 1 << 26, 1 << 27, 1 << 30


def torque_bench(*, supplement=True, telegram=105, mechanics=None, **variables):
    """Return a bench with telegram 750 whose axis knows p2003 = 2 Nm."""
    own = {"Actor.DriveParameter.ReferenceTorque": 2.0} | variables
    return bench(
        telegram=telegram, profidrive={"torque_telegram": supplement}, variables=own, **(mechanics or {})
    )


def word(machine, number):
    """Return a word of the telegram to the drive, signed."""
    value = machine.drive().slave.get(0x5800 + number) & 0xFFFF
    return value - 0x10000 if value & 0x8000 else value


def later(machine, cycles=4):
    machine.run_for(0.004 * cycles)


# -- additive torque
# ---------------------------------------------------------------------------------------------------


@pytest.mark.requirement(
    "MC-517", "MC-520", "CFG-400", "CFG-407", "VAR-118", "VAR-119", "STP-178", "STP-179", "STP-182"
)
def test_additive_torque_reaches_the_drive():
    """0.5 of 2 Nm are 1000h in M_ADD1 and an offset in the drive; the variables show it; the value follows
    the input.
    """
    with torque_bench() as machine:
        axis = enabled(machine)
        job = axis.torque_additive(0.5)
        later(machine)
        assert job.Busy
        assert word(machine, ADD_WORD) == 0x1000
        assert machine.drive().core.torque_offset == pytest.approx(0.5)
        assert axis.var("StatusTorqueData.CommandAdditiveTorqueActive") == 1
        assert axis.var("StatusTorqueData.TotalTorqueAdditive") == pytest.approx(0.5)
        job.set(Value=-1.0)
        later(machine)
        assert word(machine, ADD_WORD) == -0x2000


@pytest.mark.requirement("MC-514", "MC-521", "STP-181")
def test_additive_torque_steps_to_zero():
    """Enable FALSE sends 0 at once; later values mean nothing."""
    with torque_bench() as machine:
        axis = enabled(machine)
        job = axis.torque_additive(0.5)
        later(machine)
        job.set(Enable=False)
        later(machine)
        job.set(Value=1.0)
        later(machine)
        assert word(machine, ADD_WORD) == 0
        assert not job.Busy
        assert axis.var("StatusTorqueData.CommandAdditiveTorqueActive") == 0


@pytest.mark.requirement("MC-518", "CFG-542", "STP-180", "VAR-135", "MC-528", "STP-188")
def test_inverted_direction_inverts_torque_and_range():
    """With Actor.InverseDirection the torque is sent with the other sign, and the limits are inverted and
    exchanged.
    """
    with torque_bench(**{"Actor.InverseDirection": True, "Sensor[1].InverseDirection": True}) as machine:
        axis = enabled(machine)
        axis.torque_additive(0.5)
        axis.torque_range(1.5, -0.5)
        later(machine)
        assert word(machine, ADD_WORD) == -0x1000
        assert (word(machine, HIGH_WORD), word(machine, LOW_WORD)) == (0x1000, -0x3000)


@pytest.mark.requirement("MC-512", "MC-522", "MC-617", "CFG-406", "CFG-408", "STP-604")
@pytest.mark.parametrize("name", ["additive", "range"])
def test_without_telegram_750_the_torque_instructions_are_refused(name):
    """16#804F, and nothing acts in the drive."""
    with torque_bench(supplement=False) as machine:
        axis = enabled(machine)
        job = axis.torque_additive(0.5) if name == "additive" else axis.torque_range(1.0, -1.0)
        later(machine, 1)
        assert job.ErrorID == 0x804F
        assert not job.Busy
        assert machine.drive().core.torque_offset == 0.0


@pytest.mark.exhaustive
@pytest.mark.requirement("CFG-404", "VAR-139", "CFG-406")
def test_torque_data_are_selected_where_the_drive_has_them():
    """`EnableTorqueData` is TRUE with telegram 750 and FALSE without; switched off, the functions are
    refused.
    """
    path = "Actor.Interface.EnableTorqueData"
    for supplement in (True, False):
        with torque_bench(supplement=supplement) as machine:
            assert machine.axis().var(path) is supplement
    with torque_bench(**{path: False}) as machine:
        axis = enabled(machine)
        job = axis.torque_additive(0.5)
        later(machine, 1)
        assert job.ErrorID == 0x804F
        assert word(machine, ADD_WORD) == 0


@pytest.mark.requirement("MC-512", "STP-178", "STP-425", "STP-131", "MC-540")
def test_mc_stop_keeps_torque_instructions_from_starting():
    """While MC_Stop runs each of the three ends with 16#800F."""
    with torque_bench() as machine:
        axis = enabled(machine)
        axis.stop(0)
        later(machine)
        jobs = [axis.torque_additive(0.5), axis.torque_range(1.0, -1.0), axis.torque_limiting(1.0)]
        later(machine, 1)
        assert [job.ErrorID for job in jobs] == [0x800F] * 3
        assert word(machine, MOMRED_WORD) == 0


@pytest.mark.requirement("MC-615", "STP-605", "STP-187", "MC-515", "MC-525", "MC-526")
@pytest.mark.parametrize(
    ("make", "error"),
    [
        (lambda axis: axis.torque_additive(1.1e12), 0x804A),
        (lambda axis: axis.torque_additive(float("nan")), 0x804A),
        (lambda axis: axis.torque_range(1.1e12, 0.0), 0x804B),
        (lambda axis: axis.torque_range(1.0, -1.1e12), 0x804C),
        (lambda axis: axis.torque_range(1.0, 1.0), 0x804D),
        (lambda axis: axis.torque_limiting(3.0e9), 0x8043),
        (lambda axis: axis.torque_limiting(1.0, mode=2), 0x800A),
    ],
)
def test_values_that_are_not_permitted(make, error):
    """Each has its own ErrorID, and the function does not become active."""
    with torque_bench() as machine:
        axis = enabled(machine)
        job = make(axis)
        later(machine, 2)
        assert (job.Error, job.ErrorID, job.Busy) == (True, error, False)
        job.set(Enable=False)
        later(machine, 1)
        assert not job.Error


@pytest.mark.requirement(
    "MC-519", "MC-534", "MC-557", "MC-124", "STP-152", "STP-189", "STP-256", "OVR-108", "OVR-109", "OVR-110"
)
def test_torque_functions_outlive_jobs_and_alarms():
    """No job aborts them and they abort none; an alarm with a reaction leaves them active."""
    with torque_bench() as machine:
        axis = enabled(machine)
        moving = axis.move_velocity(50.0)
        additive, limits = axis.torque_additive(0.1), axis.torque_range(1.8, -1.8)
        later(machine, 20)
        assert moving.Busy
        axis.halt()
        later(machine, 10)
        axis.object.alarms.raise_alarm(104)
        later(machine, 10)
        assert additive.Busy
        assert limits.Busy
        assert word(machine, HIGH_WORD) == round(0.9 * 0x4000)


# -- torque range
# ----------------------------------------------------------------------------------------------------------


@pytest.mark.requirement("MC-529", "MC-535", "STP-183", "STP-186", "STP-191", "VAR-143", "CFG-401")
def test_range_limits_the_drive_and_the_reference_does_without():
    """Without the instruction the limits are 100 % of the reference; with it what it says, and back."""
    with torque_bench() as machine:
        axis = enabled(machine)
        later(machine)
        assert (word(machine, HIGH_WORD), word(machine, LOW_WORD)) == (0x4000, -0x4000)
        job = axis.torque_range(1.0, -0.5)
        later(machine)
        assert (word(machine, HIGH_WORD), word(machine, LOW_WORD)) == (0x2000, -0x1000)
        assert axis.var("StatusTorqueData.CommandTorqueRangeActive") == 1
        axis.move_velocity(400.0, Acceleration=2000.0, Jerk=0.0)
        machine.run_for(0.2)
        torque = machine.trace()["drive1.torque"].values
        assert max(torque) <= 1.0 + 0.01
        job.set(Enable=False)
        later(machine)
        assert (word(machine, HIGH_WORD), word(machine, LOW_WORD)) == (0x4000, -0x4000)


@pytest.mark.exhaustive
@pytest.mark.requirement("MON-029", "MC-530", "STP-184", "VAR-142")
@pytest.mark.parametrize("monitored", [0, 1])
def test_range_suspends_following_error_monitoring(monitored):
    """A torque that does not suffice raises 521 only where position-related monitoring is left enabled."""
    with torque_bench(**{"TorqueLimiting.PositionBasedMonitorings": monitored}) as machine:
        axis = enabled(machine)
        axis.torque_range(0.12, -0.12)
        later(machine)
        axis.move_velocity(400.0, Acceleration=2000.0, Jerk=0.0)
        machine.run_for(0.5)
        raised = [event.data["number"] for event in machine.history.select(kind="alarm.raised")]
        assert [number for number in raised if number not in (504, 522)] == ([521] if monitored else [])


@pytest.mark.requirement("MC-533", "MC-616", "STP-190", "OVR-109", "OVR-110")
@pytest.mark.parametrize("first", ["range", "limiting"])
def test_range_and_limiting_exclude_each_other(first):
    """The later one ends with 16#804E; the earlier one stays."""
    with torque_bench() as machine:
        axis = enabled(machine)
        makes = [lambda: axis.torque_range(1.0, -1.0), lambda: axis.torque_limiting(1.0)]
        if first == "limiting":
            makes.reverse()
        one = makes[0]()
        later(machine, 1)
        two = makes[1]()
        later(machine, 1)
        assert one.Busy
        assert two.ErrorID == 0x804E


# -- torque limiting
# --------------------------------------------------------------------------------------------------------


@pytest.mark.requirement(
    "MC-549", "MC-544", "STP-133", "STP-134", "STP-135", "STP-136", "STP-158", "STP-172", "MC-113", "VAR-049"
)
def test_limit_is_a_reduction_in_the_telegram():
    """A limit of 0.5 of 2 Nm is a reduction of 75 % = 3000h; it follows the input; STW2.8 and X26 are set
    meanwhile.
    """
    with torque_bench(**{"TorqueLimiting.LimitDefaults.Torque": 1.5}) as machine:
        axis = enabled(machine)
        job = axis.torque_limiting(0.5)
        later(machine)
        assert word(machine, MOMRED_WORD) == 0x3000
        assert word(machine, STW2_WORD) & 0x0100
        assert axis.var("StatusWord") & X26
        job.set(Limit=1.0)
        later(machine)
        assert word(machine, MOMRED_WORD) == 0x2000
        job.set(Limit=-1.0)
        later(machine)
        assert word(machine, MOMRED_WORD) == 0x1000
        job.set(Limit=5.0)
        later(machine)
        assert word(machine, MOMRED_WORD) == 0
        job.set(Enable=False)
        later(machine)
        assert word(machine, MOMRED_WORD) == 0
        assert not word(machine, STW2_WORD) & 0x0100
        assert not axis.var("StatusWord") & X26


@pytest.mark.requirement("STP-137", "STP-141", "MC-549", "VAR-141", "VAR-140")
def test_limit_at_the_load_is_a_force():
    """At the load side of a linear axis the limit is a force: 400 N at 10 mm/rev and efficiency 0.8 are 0.796
    Nm.
    """
    with torque_bench(
        **{
            "TorqueLimiting.LimitBase": 1,
            "Actor.Efficiency": 0.8,
            "TorqueLimiting.LimitDefaults.Force": 200.0,
        }
    ) as machine:
        axis = enabled(machine)
        job = axis.torque_limiting(400.0)
        later(machine)
        assert word(machine, MOMRED_WORD) == pytest.approx((1.0 - 0.79577 / 2.0) * 0x4000, abs=1.0)
        job.set(Limit=-1.0)
        later(machine)
        assert word(machine, MOMRED_WORD) == pytest.approx((1.0 - 0.39789 / 2.0) * 0x4000, abs=1.0)


@pytest.mark.exhaustive
@pytest.mark.requirement("MC-538", "MC-611", "STP-130", "STP-583", "CFG-408")
@pytest.mark.parametrize("telegram", [3, 5])
def test_a_standard_telegram_has_no_torque_reduction(telegram):
    """Mode 0 ends with 16#8044; Mode 1 works by the following error alone."""
    with torque_bench(telegram=telegram) as machine:
        axis = enabled(machine)
        job = axis.torque_limiting(1.0)
        detection = axis.torque_limiting(1.0, mode=1)
        later(machine, 1)
        assert job.ErrorID == 0x8044
        assert detection.Busy


@pytest.mark.exhaustive
@pytest.mark.requirement("MC-537", "STP-132", "MC-541")
def test_limiting_needs_no_enabled_axis_but_detection_does():
    """Mode 0 starts on a disabled axis, Mode 1 ends with 16#800F there."""
    with torque_bench() as machine:
        axis = machine.axis()
        job = axis.torque_limiting(1.0)
        later(machine, 2)
        assert job.Busy
        job.set(Enable=False)
        later(machine, 2)
        other = axis.torque_limiting(1.0, mode=1)
        later(machine, 2)
        assert other.ErrorID == 0x800F


@pytest.mark.exhaustive
@pytest.mark.requirement("MON-029", "MON-044", "STP-144", "MC-551", "VAR-142")
@pytest.mark.parametrize("monitored", [0, 1])
def test_limiting_suspends_following_error_monitoring(monitored):
    """As the torque range does."""
    with torque_bench(**{"TorqueLimiting.PositionBasedMonitorings": monitored}) as machine:
        axis = enabled(machine)
        axis.torque_limiting(0.12)
        later(machine)
        axis.move_velocity(400.0, Acceleration=2000.0, Jerk=0.0)
        machine.run_for(0.5)
        raised = [event.data["number"] for event in machine.history.select(kind="alarm.raised")]
        assert (521 in raised) is bool(monitored)


@pytest.mark.exhaustive
@pytest.mark.requirement("MC-547", "STP-157", "STP-145", "STP-146", "MC-552", "VAR-050")
def test_the_drive_says_that_it_is_at_its_limit():
    """Too little torque: X27 and InLimitation; when the limit goes, the axis catches up."""
    with torque_bench(**{"FollowingError.EnableMonitoring": False}) as machine:
        axis = enabled(machine)
        job = axis.torque_limiting(0.12)
        axis.move_relative(100.0, Velocity=300.0, Acceleration=2000.0, Jerk=0.0)
        machine.run_for(0.3)
        assert job.InLimitation
        assert axis.var("StatusWord") & X27
        error = axis.var("StatusPositioning.FollowingError")
        assert error > 10.0
        job.set(Enable=False)
        machine.run_for(1.0)
        assert abs(axis.var("StatusPositioning.FollowingError")) < 0.5
        assert not axis.var("StatusWord") & X27


@pytest.mark.exhaustive
@pytest.mark.requirement("MC-559", "MC-560", "STP-148")
def test_halt_at_the_limit_is_done_when_the_axis_stands():
    """The setpoint brakes to 0, the axis creeps on to its setpoint with the limit active, then the halt is
    Done.
    """
    with torque_bench() as machine:
        axis = enabled(machine)
        limit = axis.torque_limiting(0.2)
        axis.move_velocity(300.0, Acceleration=2000.0, Jerk=0.0)
        machine.run_for(0.4)
        halt = axis.halt(Jerk=0.0)
        machine.run_for(0.32)
        assert halt.Busy
        assert limit.Busy
        assert axis.var("Velocity") == 0.0
        assert machine.run_until(halt.done, 10.0)
        assert abs(axis.var("ActualVelocity")) < 2.0


# -- fixed stop
# ------------------------------------------------------------------------------------------------------------

STOP_MM = 100.0
FIXED_STOP = {
    "Clamping.FollowingErrorDeviation": 5.0,
    "Clamping.PositionTolerance": 1.0,
    "FollowingError.MaxValue": 20.0,
    "PositionLimits_HW.Active": False,
}


def stop_bench(blocked_ms=0.0, **variables):
    """Return a bench with an end stop of the mechanics at 100 mm and no limit switch before it; when a
    blocked drive trips.
    """
    machine = torque_bench(**(FIXED_STOP | variables))
    config = machine.config
    machine.close()
    drive = config.drive["drive1"]
    drive = drive.model_copy(
        update={
            "mechanics": replace(drive.mechanics, positive_stop_mm=STOP_MM),
            "blocked_time_ms": blocked_ms,
        }
    )
    from hil.bench.bench import Bench

    return Bench(config.model_copy(update={"drive": {"drive1": drive}}), seed=1)


def clamp(machine):
    """Travel to the stop; returns (axis, job of the limit, job of the motion)."""
    axis = enabled(machine)
    limiting = axis.torque_limiting(0.5, mode=1)
    moving = axis.move_velocity(50.0)
    assert machine.run_until(limiting.in_clamping, 5.0)
    later(machine, 1)
    return axis, limiting, moving


@pytest.mark.exhaustive
@pytest.mark.requirement(
    "OVR-024",
    "STP-160",
    "STP-162",
    "STP-165",
    "STP-166",
    "STP-173",
    "STP-174",
    "STP-175",
    "MC-553",
    "MC-561",
    "MC-562",
    "MC-546",
    "VAR-144",
    "VAR-053",
)
def test_the_fixed_stop_is_detected():
    """Stop at 100 mm, deviation 5 mm: the job is aborted, the setpoint stays near 105 mm, the drive presses
    with its limit.
    """
    with stop_bench() as machine:
        axis, limiting, moving = clamp(machine)
        assert moving.CommandAborted
        assert limiting.InClamping
        assert axis.var("StatusWord") & X30
        assert axis.var("Position") == pytest.approx(105.0, abs=1.0)
        frozen = axis.var("Position")
        machine.run_for(0.5)
        assert axis.var("Position") == frozen
        assert axis.state is AxisState.STANDSTILL
        assert axis.var("StatusWord") & X27
        assert machine.drive().core.torque == pytest.approx(0.5, abs=0.05)
        assert not list(machine.history.select(kind="alarm.raised"))


@pytest.mark.exhaustive
@pytest.mark.requirement("HOM-143", "HOM-144")
def test_homing_at_a_fixed_stop():
    """Detection on, monitoring off, to the stop, Mode 0 with the following error pending, back, monitoring
    on, detection off.
    """
    with stop_bench(**{"PositionLimits_HW.Active": True, "FollowingError.MinValue": 10.0}) as machine:
        axis = enabled(machine)
        limiting = axis.torque_limiting(0.5, mode=1)
        assert machine.run_until(axis.write_parameter(1000, False).done, 1.0)
        axis.jog(20.0)
        assert machine.run_until(limiting.in_clamping, 10.0)
        later(machine, 2)
        lag = axis.var("Position") - axis.var("ActualPosition")
        assert lag > 4.0
        homing = axis.home(500.0)
        assert machine.run_until(homing.done, 1.0)
        assert axis.var("ActualPosition") == pytest.approx(500.0, abs=0.05)
        assert axis.var("Position") - axis.var("ActualPosition") == pytest.approx(lag, abs=0.05)
        assert axis.var("StatusWord.X5") is True
        away = axis.move_relative(-60.0)
        assert machine.run_until(away.done, 10.0)
        place = machine.drive().mechanics.position * 1000.0
        assert axis.var("ActualPosition") - 500.0 == pytest.approx(place - STOP_MM, abs=0.1)
        assert machine.run_until(axis.write_parameter(1000, True).done, 1.0)
        limiting.set(Enable=False)
        machine.run_for(0.2)
        assert not list(machine.history.select(kind="alarm.raised"))


@pytest.mark.exhaustive
@pytest.mark.requirement("STP-167", "MC-555")
def test_the_clamping_force_follows_the_limit():
    """A new Limit changes the torque at the stop."""
    with stop_bench() as machine:
        _, limiting, _ = clamp(machine)
        limiting.set(Limit=1.0)
        machine.run_for(0.1)
        assert machine.drive().core.torque == pytest.approx(1.0, abs=0.05)


@pytest.mark.exhaustive
@pytest.mark.requirement(
    "STP-170",
    "STP-176",
    "STP-177",
    "STP-601",
    "STP-602",
    "MC-550",
    "MC-556",
    "MC-563",
    "MC-564",
    "MC-565",
    "MC-613",
    "MC-614",
)
def test_retracting_ends_the_clamping():
    """Further in: 16#8047; off while clamped: 16#8046; away: accepted, and with the tolerance left the
    clamping ends.
    """
    with stop_bench() as machine:
        axis, limiting, _ = clamp(machine)
        further = axis.move_relative(10.0)
        later(machine, 1)
        assert further.ErrorID == 0x8047
        limiting.set(Enable=False)
        later(machine, 1)
        assert (limiting.Error, limiting.ErrorID, limiting.InClamping) == (True, 0x8046, True)
        limiting.set(Enable=True)
        later(machine, 1)
        assert limiting.Busy
        away = axis.move_velocity(50.0, Direction=2)
        assert machine.run_until(lambda: not limiting.InClamping, 2.0)
        assert away.Busy
        assert not axis.var("StatusWord") & X30
        limiting.set(Enable=False)
        later(machine)
        assert not limiting.Busy
        assert not limiting.Error
        assert not list(machine.history.select(kind="alarm.raised"))


@pytest.mark.exhaustive
@pytest.mark.requirement("MC-602", "STP-168", "MC-554")
def test_a_stop_that_breaks_away_is_an_alarm():
    """When the stop gives way, the actual position leaves the tolerance: alarm 542 with reaction 4."""
    with stop_bench() as machine:
        axis, limiting, _ = clamp(machine)
        machine.drive().mechanics.set_stops(-0.6, 0.2)
        assert machine.run_until(lambda: axis.state is not AxisState.STANDSTILL, 2.0)
        raised = [event.data["number"] for event in machine.history.select(kind="alarm.raised")]
        assert raised == [542]
        assert axis.var("ErrorDetail.Reaction") == 4
        later(machine, 1)
        assert not limiting.InClamping


@pytest.mark.requirement("STP-600", "MC-612")
def test_no_job_without_position_control_on_the_way_to_the_stop():
    """A job that would switch position control off ends with 16#8045 while detection is active."""
    with stop_bench() as machine:
        axis = enabled(machine)
        axis.torque_limiting(0.5, mode=1)
        later(machine, 1)
        job = axis.move_velocity(50.0, PositionControlled=False)
        later(machine, 1)
        assert job.ErrorID == 0x8045


# -- control words
# ------------------------------------------------------------------------------------------------------------


@pytest.mark.exhaustive
@pytest.mark.requirement("MC-442", "MC-444", "MC-436", "MC-438", "MC-440", "MC-446", "CFG-222")
def test_bits_of_the_control_words_are_the_users():
    """Masked bits appear in the telegram and stay when the job has ended; another mask adds to them."""
    with torque_bench() as machine:
        axis = enabled(machine)
        job = axis.set_axis_stw(STW1=0x1000, STW1BitMask=0x1000, STW2=0x0805, STW2BitMask=0x0807)
        later(machine, 2)
        assert job.Done
        job.set(Execute=False)
        later(machine, 3)
        assert axis.object.stw1_sent == STW1_OPERATE | 0x1000
        assert word(machine, STW2_WORD) & 0x0FFF == 0x0805
        axis.set_axis_stw(STW1=0x0100, STW1BitMask=0x0100, STW2=0x0000, STW2BitMask=0x0001)
        later(machine, 3)
        assert axis.object.stw1_sent == STW1_OPERATE | 0x1100
        assert word(machine, STW2_WORD) & 0x0FFF == 0x0804


@pytest.mark.requirement("MC-443", "MC-619", "MC-433", "MC-437", "MC-439", "CFG-222")
@pytest.mark.parametrize(
    "masks",
    [{"STW1BitMask": 0x0001}, {"STW1BitMask": 0x0400}, {"STW1BitMask": 0x0080}, {"STW2BitMask": 0x1000}],
)
def test_bits_that_belong_to_the_object_are_refused(masks):
    """Bits 0 to 7 and 10 of STW1 and the sign of life in STW2 are not the user's: 16#8055, the telegram
    stays.
    """
    with torque_bench() as machine:
        axis = enabled(machine)
        job = axis.set_axis_stw(STW1=0xFFFF, STW2=0xFFFF, **masks)
        later(machine, 3)
        assert job.ErrorID == 0x8055
        assert axis.object.stw1_sent == STW1_OPERATE
        assert word(machine, STW2_WORD) & 0x0FFF == 0


@pytest.mark.requirement("MC-444")
def test_a_restart_gives_the_bits_back():
    """After MC_Reset with Restart the telegram is the object's own again."""
    with torque_bench() as machine:
        axis = enabled(machine)
        axis.set_axis_stw(STW1=0x1000, STW1BitMask=0x1000)
        later(machine, 3)
        axis.power(False)
        machine.run_for(0.5)
        assert machine.run_until(axis.reset(restart=True).done, 2.0)
        later(machine, 2)
        assert not axis.object.stw1_sent & 0x1000


@pytest.mark.requirement("MC-445", "OVR-107", "MC-031")
def test_what_aborts_it():
    """Another instance, or disabling, aborts a job that is not through; no motion job is touched."""
    with torque_bench() as machine:
        axis = enabled(machine)
        moving = axis.move_velocity(50.0)
        first = axis.set_axis_stw(STW1=0x1000, STW1BitMask=0x1000)
        second = axis.set_axis_stw(STW1=0x0100, STW1BitMask=0x0100)
        later(machine, 3)
        assert first.CommandAborted
        assert second.Done
        assert moving.Busy
        assert axis.object.stw1_sent & 0x1100 == 0x0100
        axis.power(False, stop_mode=2)
        later(machine, 1)
        third = axis.set_axis_stw(STW1=0x1000, STW1BitMask=0x1000)
        later(machine, 2)
        assert third.CommandAborted


@pytest.mark.requirement("MC-431")
def test_a_drive_without_telegram_has_no_control_words():
    """On a CiA 402 drive the job ends with an error."""
    with bench("reference") as machine:
        job = machine.axis().set_axis_stw(STW1=0x1000, STW1BitMask=0x1000)
        later(machine, 2)
        assert job.Error
