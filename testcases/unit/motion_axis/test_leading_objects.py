"""What a synchronous axis follows: setpoints, actual values, external encoders (SYN sections 2 and 3)."""

from __future__ import annotations

from math import tau

import pytest

from motion.drives.encoder import EncoderPort
from motion.s7.axis import ExternalEncoder
from motion.s7.axis.technology_object import ACTUAL, DELAYED
from motion.s7.cams import Cam
from motion.s7.handles import EncoderHandle
from testcases.unit.motion_axis.conftest import Rig

VIRTUAL = {"VirtualAxis.Mode": 1}
SIMULATED = {"VirtualAxis.Mode": 0}
ACROSS = "CrossPlcSynchronousOperation."
HALF = 1 << 31
"""Half of the range of a counter."""


class Belt(EncoderPort):
    """An encoder on a belt: 100 increments per mm, `step` increments per cycle, and a noise of `noise`."""

    __slots__ = ("noise", "silent", "step")

    def __init__(self) -> None:
        super().__init__()
        self.step = 0
        self.noise = 0
        self.silent = False

    def read(self) -> None:
        self.link_ok = not self.silent
        self.noise = -self.noise
        self.encoder_increments = (self.encoder_increments + self.step + self.noise + HALF) % (
            2 * HALF
        ) - HALF


def behind_belt(step=40, *, at=0, encoder=None, belt=Belt, **variables):
    """An enabled synchronous axis behind an external encoder that goes `step` increments per cycle, from `at`
    on.
    """
    rig = Rig(synchronous=True, variables=VIRTUAL)
    rig.belt = belt()
    rig.belt.step = step
    rig.belt.encoder_increments = at
    settings = {
        "Mechanics.LeadScrew": 10.0,
        "Sensor.Parameter.StepsPerRevolution": 1000,
        "Sensor.Parameter.FineResolutionXist1": 0,
    }
    settings |= {f"Extrapolation.{path}": value for path, value in variables.items()} | (encoder or {})
    measuring = ExternalEncoder(
        "belt", rig.belt, cycle_ns=rig.cycle_ns, variables=settings, history=rig.history
    )
    rig.runtime.add_encoder(measuring)
    rig.encoder = EncoderHandle(rig.runtime, measuring)
    rig.axis.object.leading_objects = (measuring, rig.leader.object)
    rig.runtime.order_axes()
    rig.enabled()
    rig.run(0.1)
    return rig


def coupled(kind, *, leader, velocity=100.0):
    """An axis in gear 1:1 behind the actual or delayed value of the leading axis, and the distance between
    setpoint and leading value in each of some cycles at constant velocity.
    """
    rig = Rig(synchronous=True, variables=VIRTUAL, leader_variables=leader)
    rig.axis.object.couplings = {"leader": kind}
    rig.enabled().leader_at(velocity)
    rig.job = rig.axis.gear_in(rig.leader)
    rig.until(rig.job.in_gear)
    rig.run(0.5)
    return rig


def effective(rig, quantity="Position"):
    return rig.axis.var(f"StatusSynchronizedMotion.EffectiveLeadingValue.{quantity}")


@pytest.mark.requirement("SYN-317", "SYN-016")
def test_what_can_lead():
    """An external encoder and an axis are taken; a cam and what is no object at all are 16#8002."""
    rig = behind_belt()
    job = rig.axis.gear_in(rig.encoder)
    rig.until(job.in_gear)
    assert rig.axis.var("StatusSynchronizedMotion.ActualMaster") == rig.encoder.object.db_number
    second = rig.axis.gear_in(rig.leader)
    rig.cycles(2)
    assert (job.CommandAborted, second.Error) == (True, False)
    for wrong in (Cam("curve"), None, "belt"):
        refused = rig.axis.gear_in(wrong)
        rig.cycles()
        assert (refused.Error, refused.ErrorID, second.Busy) == (True, 0x8002, True)


@pytest.mark.parametrize("mode", [0, 1])
def test_the_value_is_ahead_by_the_time_of_extrapolation(mode):
    """A belt at 100 mm/s and 10 ms more than its own cycle: the leading value is where the belt will be, the
    follower has its velocity, and both keep their distance.
    """
    times = {"FollowingAxisDependentTime": 0.010, "Settings.ExtrapolatedVelocityMode": mode}
    rig = behind_belt(**times)
    job = rig.axis.gear_in(rig.encoder, 2, 1)
    rig.until(job.in_gear)
    read = rig.encoder.var
    ahead = 0.010 + read("Extrapolation.LeadingAxisDependentTime")
    places = []
    for _ in range(50):
        rig.cycles()
        assert effective(rig) == pytest.approx(read("ActualPosition") + 100.0 * ahead)
        assert effective(rig) == read("StatusExtrapolation.ExtrapolatedPosition")
        assert effective(rig, "Velocity") == pytest.approx(100.0)
        assert rig.axis.var("Velocity") == pytest.approx(200.0)
        places.append(rig.axis.var("Position") - 2.0 * effective(rig))
    assert places == pytest.approx([places[0]] * 50)


@pytest.mark.requirement("SYN-390")
def test_another_time_of_extrapolation_is_a_step():
    """2 ms more at 100 mm/s: the leading value and the follower step by 0.2 mm in the next cycle."""
    rig = behind_belt()
    rig.until(rig.axis.gear_in(rig.encoder).in_gear)
    before, follower = effective(rig), rig.axis.var("Position")
    rig.encoder.object.variables.write("Extrapolation.FollowingAxisDependentTime", 0.002)
    rig.cycles()
    assert effective(rig) - before == pytest.approx(0.4 + 0.2)
    assert rig.axis.var("Position") - follower == pytest.approx(0.4 + 0.2)


@pytest.mark.requirement("SYN-391")
@pytest.mark.parametrize(("hysteresis", "alarms"), [(0.0, [608]), (0.5, [])])
def test_noise_while_synchronising(hysteresis, alarms):
    """A slow belt with noise that goes back: alarm 608; with a hysteresis above the noise the axis gets into
    gear.
    """
    settings = {"Hysteresis.Value": hysteresis, "VelocityFilter.T1": 0.1, "VelocityFilter.T2": 0.1}
    rig = behind_belt(4, **settings)
    rig.belt.noise = 10
    rig.run(1.0)
    job = rig.axis.gear_in(rig.encoder, 2, 1, Acceleration=20.0, Jerk=0.0)
    rig.run(2.0)
    assert rig.alarms_of("axis1") == alarms
    assert job.InGear is not bool(alarms)


@pytest.mark.requirement("SYN-027")
def test_the_actual_value_needs_no_position_control():
    """A leading axis without position control is followed by its actual value; disabled and pushed too."""
    rig = Rig(synchronous=True, variables=VIRTUAL, leader_variables=SIMULATED)
    rig.axis.object.couplings = {"leader": ACTUAL}
    rig.enabled().leader_at(0.0)
    rig.until(rig.leader.move_velocity(50.0, PositionControlled=False).in_velocity)
    job = rig.axis.gear_in(rig.leader)
    rig.until(job.in_gear)
    assert rig.axis.var("Velocity") == pytest.approx(50.0, abs=0.5)
    power = rig.leader.power(False)
    rig.until(power.off)
    port = rig.leader.object.servo.port
    before = rig.axis.var("Position")
    port.turn(tau)
    rig.cycles(10)
    assert rig.axis.var("Position") - before == pytest.approx(10.0, abs=0.1)
    assert (job.InGear, rig.alarms_of("axis1")) == (True, [])


@pytest.mark.requirement("SYN-070")
def test_the_delayed_setpoint():
    """8 ms at 100 mm/s: the follower gets the setpoint of two cycles ago, 0.8 mm behind."""
    rig = coupled(DELAYED, leader=VIRTUAL | {f"{ACROSS}LocalLeadingValueDelayTime": 0.008})
    assert rig.leader.var("Position") - effective(rig) == pytest.approx(0.8)
    assert effective(rig) == rig.leader.var("StatusProvidedLeadingValue.DelayedLeadingValue.Position")


def test_a_restart_of_the_leading_axis_ends_the_coupling():
    """The leading axis is restarted while its follower is in gear: alarm 601 with reaction 2, job 16#8001."""
    rig = Rig(synchronous=True, variables=VIRTUAL)
    rig.enabled().leader_at(0.0)
    job = rig.axis.gear_in(rig.leader)
    rig.until(job.in_gear)
    rig.until(rig.leader.power(False).off)
    assert job.InGear
    rig.leader.reset(restart=True)
    rig.cycles(3)
    assert (job.Error, job.ErrorID, job.InGear) == (True, 0x8001, False)
    (alarm,) = rig.axis.object.engine.pending
    assert (alarm.number, alarm.reaction) == (601, 2)


@pytest.mark.requirement("SYN-382")
def test_an_encoder_that_fails():
    """Without a valid value no gear starts, and one that runs ends: alarm 601; the follower stops."""
    rig = behind_belt()
    job = rig.axis.gear_in_velocity(rig.encoder)
    rig.until(job.in_sync)
    rig.belt.sensor_fault = True
    rig.run(1.0)
    assert (job.ErrorID, rig.axis.var("Velocity"), rig.alarms_of("axis1")) == (0x8001, 0.0, [601])
    rig.until(rig.axis.reset().done)
    again = rig.axis.gear_in_velocity(rig.encoder)
    rig.cycles(2)
    assert (again.ErrorID, rig.alarms_of("axis1")) == (0x8001, [601, 601])


@pytest.mark.requirement("SYN-007")
def test_what_leads_by_kind_of_controller():
    """`MC_GearIn` behind the setpoint of an axis on either kind; an external encoder leads on a technology
    processor alone.
    """
    for cpu, technology in (("S7-1500", False), ("S7-1500T", True), ("S7-1500T V7", True)):
        rig = Rig(synchronous=True, variables=VIRTUAL, cpu=cpu)
        encoder = ExternalEncoder("belt", Belt(), cycle_ns=rig.cycle_ns, history=rig.history)
        rig.runtime.add_encoder(encoder)
        rig.axis.object.leading_objects += (encoder,)
        rig.runtime.order_axes()
        rig.enabled().leader_at(0.0)
        rig.run(0.05)
        rig.until(rig.axis.gear_in(rig.leader).in_gear)
        job = rig.axis.gear_in(EncoderHandle(rig.runtime, encoder))
        rig.cycles(2)
        assert (job.ErrorID == 0x8002) is not technology
