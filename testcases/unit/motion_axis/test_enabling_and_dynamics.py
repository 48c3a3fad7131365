"""Enabling, acknowledging, restarting, and where dynamic values come from (sections 1 to 3 of the stopping
specification).
"""

from __future__ import annotations

from itertools import pairwise

import pytest

from motion.drives.simulated import DriveStage
from motion.s7.axis import AxisState
from testcases.unit.motion_axis.lagging_drive import LaggingDrivePort

CYCLE = 0.004
S = AxisState


def raised(rig):
    return [event.data["number"] for event in rig.events("alarm.raised")]


# -- enabling
# ------------------------------------------------------------------------------------------------------------


@pytest.mark.requirement("STP-037", "STP-039", "STP-041", "STP-046")
def test_bit_sequence_of_enabling(rig):
    """Idle pattern before; a drive in S1 gets OFF1 = 0 until it is ready; then ON once, S3, S4."""
    rig.run(0.05)
    assert rig.axis.object.stw1_sent == 0x047E
    assert rig.port.zsw1 == 0x0231
    rig.port.inhibited = True
    rig.cycles(2)
    rig.axis.power()
    rig.run(0.5)
    assert {int(word) & 1 for word in rig.column("stw1")} == {0}
    assert not rig.axis.power_instance.Status
    rig.port.inhibited = False
    rig.until(rig.axis.power_instance.status)
    zsw1 = [int(word) for word in rig.column("zsw1")]
    order = [word for index, word in enumerate(zsw1) if index == 0 or word != zsw1[index - 1]]
    assert order[-3:] == [0x0231, 0x0233, 0x0237]


@pytest.mark.requirement("STP-043")
def test_a_drive_that_stays_in_s3(rig, monkeypatch):
    """Without operation enabled Status stays FALSE, Busy TRUE, and no setpoint is executed."""
    plain = type(rig.port)._transitions

    def transitions(port):
        plain(port)
        if port.stage is DriveStage.S4:
            port.stage = DriveStage.S3

    monkeypatch.setattr(type(rig.port), "_transitions", transitions)
    power = rig.axis.power()
    rig.run(2.0)
    assert power.Busy
    assert not power.Status
    job = rig.axis.move_velocity(100.0)
    rig.run(0.2)
    assert job.Error
    assert rig.column("actual_velocity")[-1] == 0.0


@pytest.mark.requirement("STP-045", "STP-018")
@pytest.mark.parametrize("how", ["fault", "link"])
def test_no_sequence_without_communication(rig, how):
    """A fault in ZSW1, or no link: CommunicationOK FALSE, and ON is not given."""
    rig.run(0.05)
    if how == "fault":
        rig.port.fault = True
    else:
        rig.port.link = False
    rig.cycles(2)
    assert not rig.axis.var("StatusDrive.CommunicationOK")
    rig.axis.power()
    rig.run(0.5)
    assert {int(word) & 1 for word in rig.column("stw1")} == {0}


@pytest.mark.requirement("STP-030", "STP-052", "MC-138")
def test_status_and_x0_say_the_same(rig):
    """In every cycle of enabling, motion and disabling Status of MC_Power is X0 of the cycle."""
    pairs = []
    power = rig.axis.power_instance
    rig.runtime.after_cycle.append(lambda: pairs.append((power.Status, bool(rig.axis.var("StatusWord") & 1))))
    rig.travelling(200.0)
    rig.axis.power(False, stop_mode=2)
    rig.until(power.off)
    assert all(status is x0 for status, x0 in pairs)
    assert {True, False} == {status for status, _ in pairs}


@pytest.mark.requirement("STP-032", "STP-063")
@pytest.mark.parametrize(("number", "refused"), [(321, True), (541, True), (501, False), (522, False)])
def test_alarms_refuse_jobs_and_warnings_do_not(rig, number, refused):
    """A pending alarm with a reaction: 16#8001; a warning lets jobs start."""
    rig.enabled()
    rig.axis.object.alarms.raise_alarm(number)
    rig.cycles(2)
    job = rig.axis.move_velocity(50.0)
    rig.cycles(2)
    assert job.ErrorID == (0x8001 if refused else 0)


@pytest.mark.requirement("STP-033", "STP-074")
@pytest.mark.parametrize("toggled", [False, True])
def test_enabled_again_after_an_alarm(rig, toggled):
    """By itself while Enable stayed TRUE; after Enable has fallen meanwhile only with a new edge."""
    rig.enabled()
    rig.axis.object.alarms.raise_alarm(421)
    rig.until(lambda: rig.axis.object.state is S.ALARM_DISABLED)
    if toggled:
        rig.axis.power(False)
        rig.cycles(3)
    rig.until(rig.axis.reset().done)
    rig.run(0.3)
    assert rig.axis.power_instance.Status is not toggled
    if toggled:
        rig.axis.power(True)
        rig.until(rig.axis.power_instance.status)


@pytest.mark.requirement("STP-026")
def test_start_mode_counts_at_the_edge(rig):
    """Changed while enabled it does nothing; it counts again when the axis comes back after an alarm."""
    rig.enabled(start_mode=1)
    rig.axis.power(True, start_mode=0)
    rig.cycles(3)
    assert not rig.axis.var("StatusWord.X28")
    rig.axis.object.alarms.raise_alarm(421)
    rig.until(lambda: rig.axis.object.state is S.ALARM_DISABLED)
    rig.until(rig.axis.reset().done)
    rig.until(rig.axis.power_instance.status)
    assert rig.axis.var("StatusWord.X28")


def coasting(rig, velocity=300.0):
    """Let the axis turn without being enabled; returns its velocity and position."""
    rig.travelling(velocity)
    rig.axis.power(False, stop_mode=3)
    rig.until(rig.axis.power_instance.off)
    return rig.column("actual_velocity")[-1], rig.column("actual_position")[-1]


@pytest.mark.requirement("STP-049", "STP-053", "STP-054", "MC-145", "VAR-184")
def test_enabling_a_moving_axis(rig):
    """With position control the axis brakes with MaxDeceleration and holds where the ramp ends."""
    coasting(rig)
    rig.axis.power(True)
    rig.until(lambda: rig.axis.object.state is S.ENABLE_RAMP)
    seen = len(rig.rows)
    v0, s0 = rig.column("velocity_setpoint")[-1], rig.column("position_setpoint")[-1]
    rig.until(lambda: rig.axis.object.state is S.STANDSTILL)
    slopes = [(b - a) / CYCLE for a, b in pairwise(rig.column("velocity_setpoint")[seen:-1])]
    assert min(slopes) == pytest.approx(-2000.0, rel=0.01)
    rig.run(0.3)
    assert rig.axis.var("ActualPosition") == pytest.approx(s0 + v0 * v0 / 4000.0, abs=v0 * 2 * CYCLE)
    assert not raised(rig)


@pytest.mark.requirement("STP-050")
def test_monitoring_works_while_a_moving_axis_is_enabled(make_rig):
    """A following error that is too large during this braking, here because the drive lags, raises 521."""
    rig = make_rig(port=LaggingDrivePort(cycle_s=CYCLE, lag_s=0.03))
    coasting(rig)
    rig.axis.write("FollowingError.MinValue", 0.1)
    rig.axis.write("FollowingError.MaxValue", 0.11)
    rig.axis.power(True)
    rig.run(0.3)
    assert 521 in raised(rig)


@pytest.mark.requirement("CTL-014", "CTL-095", "STP-051", "STP-056", "MC-146", "MC-147", "VAR-184")
@pytest.mark.parametrize("velocity_mode", [False, True])
def test_enabling_without_ramp_ignores_limits_and_monitoring(make_rig, velocity_mode):
    """StartMode 0, or VelocityModePowerOn 1: setpoint 0 as a step, steeper than MaxDeceleration, and no
    alarm.
    """
    start = {"FollowingError.MinValue": 0.01, "FollowingError.MaxValue": 0.011}
    if velocity_mode:
        start["PositionControl.VelocityModePowerOn"] = 1
    rig = make_rig(variables=start)
    coasting(rig)
    rig.axis.power(True, start_mode=int(velocity_mode))
    rig.until(lambda: rig.axis.object.servo.controlled)
    begun = len(rig.rows) - 1
    rig.run(0.2)
    assert rig.axis.power_instance.status()
    assert set(rig.column("velocity_setpoint")[begun:]) == {0.0}
    steps = [b - a for a, b in pairwise(rig.column("actual_velocity")[begun:])]
    assert min(steps) < -2000.0 * CYCLE * 2.0
    at_rest = next(at for at, speed in enumerate(rig.column("actual_velocity")[begun:]) if abs(speed) < 1.0)
    assert at_rest <= 5
    assert not raised(rig)


@pytest.mark.requirement("STP-057")
def test_velocity_mode_is_restart_relevant(rig):
    """The variable cannot be written at run time; written to load memory it acts after a restart."""
    with pytest.raises(Exception, match="restart-relevant"):
        rig.axis.write("PositionControl.VelocityModePowerOn", 1)
    rig.axis.object.variables.write_start("PositionControl.VelocityModePowerOn", 1)
    assert rig.axis.var("PositionControl.VelocityModePowerOn") == 0
    rig.run(0.1)
    rig.until(rig.axis.reset(restart=True).done)
    assert rig.axis.var("PositionControl.VelocityModePowerOn") == 1


# -- acknowledging and restarting
# ----------------------------------------------------------------------------------------------


@pytest.mark.requirement(
    "STP-066", "STP-067", "STP-069", "STP-070", "STP-073", "MC-179", "DIA-113", "VAR-088"
)
def test_acknowledging_many_alarms(rig):
    """All are gone with Done, words and bits are 0, and no alarm was raised again on the way."""
    rig.enabled()
    for number in (321, 541, 501, 502):
        rig.axis.object.alarms.raise_alarm(number)
    rig.run(1.0)
    before = len(raised(rig))
    reset = rig.axis.reset()
    rig.axis.halt()
    rig.until(reset.done)
    assert not reset.CommandAborted
    assert len(raised(rig)) == before
    assert [rig.axis.var(name) for name in ("ErrorWord", "WarningWord", "ErrorDetail.Number")] == [0, 0, 0]
    assert not rig.axis.var("StatusWord.X1")


@pytest.mark.requirement("STP-064", "STP-065", "STP-075", "STP-079", "MC-182")
def test_restart_takes_all_start_values_together(rig):
    """X3 tells of the change; after the restart all values act, alarms are acknowledged and direct changes
    are gone.
    """
    rig.enabled()
    rig.axis.write("Override.Velocity", 50.0)
    rig.axis.home(0.0)
    rig.cycles(3)
    rig.axis.power(False)
    rig.until(rig.axis.power_instance.off)
    rig.axis.object.alarms.raise_alarm(501)
    store = rig.axis.object.variables
    store.write_start("Mechanics.LeadScrew", 20.0)
    store.write_start("DynamicLimits.MaxVelocity", 800.0)
    rig.cycles(1)
    assert rig.axis.var("StatusWord.X3")
    assert rig.axis.var("Mechanics.LeadScrew") == 10.0
    rig.until(rig.axis.reset(restart=True).done)
    rig.cycles(1)
    assert not rig.axis.var("StatusWord.X3")
    assert (rig.axis.var("Mechanics.LeadScrew"), rig.axis.var("DynamicLimits.MaxVelocity")) == (20.0, 800.0)
    assert rig.axis.var("Override.Velocity") == 100.0
    assert rig.axis.var("WarningWord") == 0
    assert not rig.axis.var("StatusWord.X5")


# -- dynamics
# ------------------------------------------------------------------------------------------------------------

DEFAULTS = {
    "DynamicDefaults.Velocity": 120.0,
    "DynamicDefaults.Acceleration": 700.0,
    "DynamicDefaults.Deceleration": 350.0,
    "DynamicDefaults.Jerk": 0.0,
}


def slopes_of(rig, since):
    return [(b - a) / CYCLE for a, b in pairwise(rig.column("velocity_setpoint")[since:])]


@pytest.mark.parametrize(
    ("kind", "velocity", "acceleration", "deceleration"),
    [
        pytest.param("absolute", True, True, True, marks=pytest.mark.requirement("STP-086", "STP-100")),
        pytest.param("relative", True, True, True, marks=pytest.mark.requirement("STP-087")),
        pytest.param("velocity", False, True, False, marks=pytest.mark.requirement("STP-088")),
        pytest.param("jog", False, True, True, marks=pytest.mark.requirement("STP-089")),
        pytest.param("superimposed", True, True, True, marks=pytest.mark.requirement("STP-090")),
        pytest.param("halt", False, False, True, marks=pytest.mark.requirement("STP-091")),
        pytest.param("halt superimposed", False, False, True, marks=pytest.mark.requirement("STP-092")),
        pytest.param("stop", False, False, True, marks=pytest.mark.requirement("STP-093")),
    ],
)
def test_which_defaults_an_instruction_takes(make_rig, kind, velocity, acceleration, deceleration):
    """Inputs left at -1.0 take the defaults of the printed table."""
    rig = make_rig(variables=DEFAULTS)
    rig.enabled()
    rig.until(rig.axis.home(0.0).done)
    if kind in ("halt", "stop"):
        job = rig.axis.move_velocity(100.0)
        rig.until(job.in_velocity)
    if kind == "halt superimposed":
        rig.axis.move_superimposed(500.0, VelocityDiff=100.0, Acceleration=2000.0)
        rig.run(0.2)
    rig.cycles(2)
    since = len(rig.rows) - 1
    job = {
        "absolute": lambda: rig.axis.move_absolute(100.0),
        "relative": lambda: rig.axis.move_relative(100.0),
        "velocity": lambda: rig.axis.move_velocity(100.0),
        "jog": lambda: rig.axis.jog(100.0),
        "superimposed": lambda: rig.axis.move_superimposed(100.0),
        "halt": rig.axis.halt,
        "halt superimposed": rig.axis.halt_superimposed,
        "stop": lambda: rig.axis.stop(3),
    }[kind]()
    rig.run(0.5)
    if kind == "jog":
        job.set(JogForward=False)
    rig.run(3.0)
    slopes = slopes_of(rig, since)
    if velocity:
        assert max(rig.column("velocity_setpoint")) == pytest.approx(120.0)
    if acceleration:
        assert max(slopes) == pytest.approx(700.0)
    if deceleration:
        assert min(slopes) == pytest.approx(-350.0)


@pytest.mark.requirement("STP-085")
def test_changed_defaults_act_with_the_next_edge(rig):
    """A running job keeps the values that it resolved."""
    rig.enabled()
    job = rig.axis.move_relative(300.0, Jerk=0.0)
    rig.run(0.3)
    rig.axis.write("DynamicDefaults.Velocity", 300.0)
    rig.axis.write("DynamicDefaults.Deceleration", 200.0)
    since = len(rig.rows)
    rig.until(job.done)
    assert max(rig.column("velocity_setpoint")) == pytest.approx(100.0)
    assert min(slopes_of(rig, since)) == pytest.approx(-1000.0)
    second = rig.axis.move_relative(300.0, Jerk=0.0)
    rig.until(second.done)
    assert max(rig.column("velocity_setpoint")) == pytest.approx(300.0)
    assert min(slopes_of(rig, since + 10)[-100:]) == pytest.approx(-200.0)


@pytest.mark.requirement("STP-094", "STP-095", "STP-096", "STP-097", "STP-104", "STP-105")
@pytest.mark.parametrize(
    ("default", "given", "limit", "effective"),
    [(2000.0, -1.0, 4000.0, 2000.0), (2000.0, -1.0, 500.0, 500.0), (2000.0, 3000.0, 4000.0, 3000.0),
     (2000.0, 6000.0, 4000.0, 4000.0)],
)  # fmt: skip
@pytest.mark.parametrize("variable", ["MaxVelocity", "Velocity"])
def test_printed_velocities(make_rig, default, given, limit, effective, variable):
    """The lower of MaxVelocity and Velocity limits what default or input give."""
    rig = make_rig(
        variables={
            "DynamicDefaults.Velocity": default,
            "DynamicLimits.MaxVelocity": 9000.0,
            "DynamicLimits.Velocity": 9000.0,
            f"DynamicLimits.{variable}": limit,
            "DynamicLimits.MaxAcceleration": 50000.0,
            "DynamicLimits.MaxDeceleration": 50000.0,
            "Mechanics.LeadScrew": 200.0,
            "FollowingError.EnableMonitoring": False,
            "Actor.DriveParameter.MaxSpeed": 60000.0,
        }
    )
    rig.enabled()
    job = rig.axis.move_relative(6000.0, Velocity=given, Acceleration=40000.0, Deceleration=40000.0, Jerk=0.0)
    rig.until(job.done, 20.0)
    assert max(rig.column("velocity_setpoint")) == pytest.approx(effective)


@pytest.mark.requirement("STP-106", "STP-107", "STP-108", "STP-083")
def test_every_value_is_limited_by_its_limit(rig):
    """Acceleration, deceleration and jerk above their limits run with the limits, and warnings tell."""
    rig.enabled()
    job = rig.axis.move_relative(
        300.0, Velocity=400.0, Acceleration=9000.0, Deceleration=9000.0, Jerk=900000.0
    )
    rig.until(job.done)
    a = rig.column("acceleration_setpoint")
    assert max(a) == pytest.approx(2000.0, rel=0.01)
    assert min(a) == pytest.approx(-2000.0, rel=0.01)
    assert max(abs(q - p) / CYCLE for p, q in pairwise(a)) == pytest.approx(20000.0, rel=0.01)
    assert {502, 503} <= set(raised(rig))


@pytest.mark.requirement("STP-114", "STP-115")
def test_profile_without_jerk_limit(rig):
    """Acceleration is +a, 0 or -d and nothing between, and the axis ends at its target."""
    rig.enabled()
    job = rig.axis.move_relative(100.0, Acceleration=800.0, Deceleration=400.0, Jerk=0.0)
    rig.until(job.done)
    assert {round(a, 6) for a in rig.column("acceleration_setpoint")} == {0.0, 800.0, -400.0}
    assert rig.axis.var("Position") == pytest.approx(100.0, abs=1e-9)


@pytest.mark.requirement("STP-116", "STP-099", "STP-102")
def test_profile_with_jerk_limit(rig):
    """The acceleration changes by the jerk of the job at most; its ramp takes Acceleration / Jerk = 0.1 s."""
    rig.enabled()
    job = rig.axis.move_relative(400.0, Velocity=300.0, Acceleration=1000.0, Deceleration=500.0, Jerk=10000.0)
    rig.until(job.done)
    a = rig.column("acceleration_setpoint")
    assert max(abs(q - p) / CYCLE for p, q in pairwise(a)) <= 10000.0 * (1.0 + 1e-6)
    rising = [index for index, value in enumerate(a) if value > 0.0]
    full = next(index for index, value in enumerate(a) if value > 999.0)
    assert (full - rising[0]) * CYCLE == pytest.approx(0.1, abs=2.5 * CYCLE)
    falling = [index for index, value in enumerate(a) if value < 0.0]
    full = next(index for index, value in enumerate(a) if value < -499.0)
    assert (full - falling[0]) * CYCLE == pytest.approx(0.05, abs=2.5 * CYCLE)


@pytest.mark.exhaustive
@pytest.mark.requirement("STP-117")
def test_override_scales_the_running_job(rig):
    """0 to 200 %, at once and with the dynamics of the job."""
    rig.travelling(200.0)
    for percent, expected in ((50.0, 100.0), (200.0, 400.0), (0.0, 0.0), (100.0, 200.0)):
        since = len(rig.rows)
        rig.axis.write("Override.Velocity", percent)
        rig.run(1.5)
        assert rig.column("velocity_setpoint")[-1] == pytest.approx(expected)
        assert max(map(abs, slopes_of(rig, since))) <= 1000.0 + 1e-6


@pytest.mark.requirement("STP-120", "STP-121", "STP-122")
@pytest.mark.parametrize(("jerk", "rise"), [(10000.0, 50.0), (0.0, 0.0)])
def test_superseding_an_acceleration(rig, jerk, rise):
    """With a0 = 1000 the velocity rises by a0^2 / (2 j) more, without jerk limit not at all."""
    rig.enabled()
    rig.axis.move_velocity(400.0, Acceleration=1000.0, Jerk=0.0)
    rig.until(lambda: rig.column("velocity_setpoint")[-1] >= 200.0)
    here = rig.column("velocity_setpoint")[-1]
    since = len(rig.rows)
    rig.axis.move_velocity(0.0, Deceleration=1000.0, Jerk=jerk)
    rig.run(0.6)
    peak = max(rig.column("velocity_setpoint")[since:])
    assert peak - here == pytest.approx(rise, abs=1000.0 * 2.5 * CYCLE)


@pytest.mark.requirement("STP-101", "STP-118", "STP-124", "STP-125")
@pytest.mark.parametrize("cause", ["power", "stop", "alarm"])
def test_emergency_deceleration(rig, cause):
    """4000 mm/s2 although MaxDeceleration is 2000, and without jerk limit, whoever asks for it."""
    rig.travelling(300.0)
    since = len(rig.rows)
    if cause == "power":
        rig.axis.power(False, stop_mode=0)
    elif cause == "stop":
        rig.axis.stop(0)
    else:
        rig.axis.object.alarms.raise_alarm(321)
    rig.run(0.3)
    slopes = [round(one) for one in slopes_of(rig, since) if one]
    assert slopes.count(-4000) >= 15
    assert min(slopes) >= -4005
