"""Limits where nobody looks: changes within one cycle, ends of the modulo range, setpoints from outside, any
order of events.
"""

from __future__ import annotations

import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from motion.s7.axis import AxisState as S
from testcases.unit.motion_axis.conftest import Rig, TorquePort
from testcases.unit.motion_axis.test_sensors import Rig as Encoders

SOFT = {
    "PositionLimits_SW.Active": True,
    "PositionLimits_SW.MinPosition": -100.0,
    "PositionLimits_SW.MaxPosition": 100.0,
}
HARD = {"PositionLimits_HW.Active": True, "PositionLimits_HW.ApproachBehavior": 1}
MODULO = {"Modulo.Enable": True, "Modulo.Length": 360.0, "Modulo.StartValue": 0.0}
X17, X18 = 1 << 17, 1 << 18
NEGATIVE, POSITIVE = 1, 2


def raised(rig, *numbers):
    return [
        (one.data["number"], one.data["info"])
        for one in rig.events("alarm.raised")
        if not numbers or one.data["number"] in numbers
    ]


def soft(**variables):
    rig = Rig(variables=SOFT | variables).enabled()
    rig.axis.home(0.0)
    rig.cycles(2)
    return rig


def on_switch(**variables):
    """An enabled axis at rest on its positive switch, the alarm acknowledged."""
    rig = Rig(variables=HARD | {"FollowingError.EnableMonitoring": False} | variables).enabled()
    rig.axis.move_velocity(50.0)
    rig.run(0.3)
    rig.port.switches = POSITIVE
    rig.run(0.3)
    acknowledge(rig)
    return rig


def acknowledge(rig):
    rig.until(rig.axis.reset().done)
    rig.until(rig.axis.power_instance.status)
    rig.cycles(2)


# -- hardware
# ------------------------------------------------------------------------------------------------------------


@pytest.mark.requirement("LIM-049", "LIM-059")
@pytest.mark.parametrize(
    "how", ["positions", "superimposed positions", "velocities", "superimposed", "uncontrolled"]
)
@pytest.mark.parametrize("way", [1.0, -1.0])
def test_every_way_out_of_a_switch(how, way):
    """Outwards 531 with cause 3 after a cycle or two, also for positions without a velocity; inwards
    nothing.
    """
    rig = on_switch()
    place = rig.axis.var("Position")
    step = way * 0.2
    if how == "uncontrolled":
        rig.axis.move_velocity(way * 20.0, PositionControlled=False)
        rig.run(0.1)
    elif how == "superimposed":
        rig.axis.move_superimposed(way * 5.0)
        rig.run(0.1)
    else:
        if how == "positions":
            job, name, start = rig.axis.motion_in_position(place), "Position", place
        elif how == "superimposed positions":
            job, name, start = rig.axis.motion_in_superimposed(0.0), "Distance", 0.0
        else:
            job, name, start = rig.axis.motion_in_velocity(0.0), "Velocity", 0.0
        for cycle in range(20):
            rig.feed(job, [{name: way * 20.0 if name == "Velocity" else start + step * cycle}])
    if way > 0.0:
        assert raised(rig)[1:] == [(531, 3)]
        assert abs(rig.axis.feedback.position - place) < 1.0
    else:
        assert raised(rig)[1:] == []
        assert rig.axis.feedback.position < place - 0.5


@pytest.mark.requirement("LIM-062")
def test_positions_onto_the_wrong_switch():
    """Positions from the program lead in negative direction, and the positive switch comes: reversed."""
    rig = Rig(variables=HARD | {"FollowingError.EnableMonitoring": False}).enabled()
    job = rig.axis.motion_in_position(0.0)
    for cycle in range(20):
        rig.feed(job, [{"Position": -0.3 * cycle}])
    rig.port.switches = POSITIVE
    rig.cycles(2)
    assert raised(rig) == [(531, 4)]


@pytest.mark.requirement("LIM-061", "TA-016", "LIM-055")
def test_signals_that_are_plausible_again():
    """Both active, not traversable: when the wrong one has gone, the axis may leave the other one as
    always.
    """
    rig = Rig(variables=HARD).enabled()
    rig.axis.move_velocity(50.0)
    rig.run(0.3)
    rig.port.switches = NEGATIVE | POSITIVE
    rig.run(0.3)
    acknowledge(rig)
    assert raised(rig) == [(531, 5)]
    rig.port.switches = POSITIVE
    rig.cycles(2)
    rig.until(rig.axis.move_relative(-3.0).done)
    outwards = rig.axis.move_relative(1.0)
    rig.run(0.1)
    assert outwards.Error
    assert raised(rig) == [(531, 5), (531, 3)]


@pytest.mark.requirement("LIM-023", "LIM-039")
def test_one_switch_goes_and_the_other_comes_in_one_cycle():
    """The bits follow both; while 531 is pending it is not raised again, afterwards it is the new switch that
    forbids.
    """
    rig = on_switch()
    rig.port.switches = NEGATIVE
    rig.cycles(1)
    assert rig.axis.status_word & (X17 | X18) == X17
    assert raised(rig) == [(531, 1), (531, 2)]
    rig.run(0.1)
    acknowledge(rig)
    rig.until(rig.axis.move_relative(2.0).done)
    rig.axis.move_relative(-1.0)
    rig.run(0.1)
    assert raised(rig)[2:] == [(531, 3)]


@pytest.mark.exhaustive
@pytest.mark.requirement("LIM-042", "LIM-038")
@pytest.mark.parametrize("stop_mode", [0, 1, 2, 3])
def test_while_the_axis_is_being_disabled(stop_mode):
    """The switch on the way to standstill: 531, and the disabling ends as it was meant."""
    rig = Rig(variables=HARD).travelling(300.0)
    rig.axis.power(False, stop_mode=stop_mode)
    rig.run(0.02)
    rig.port.switches = POSITIVE
    rig.run(4.0 if stop_mode == 3 else 1.5)
    assert raised(rig) == [(531, 1)]
    assert rig.axis.state is S.ALARM_DISABLED
    assert not rig.axis.power_instance.Busy
    assert rig.axis.var("ActualVelocity") == pytest.approx(0.0, abs=0.01)


@pytest.mark.requirement("LIM-042")
def test_while_the_axis_is_being_enabled():
    """The switch before the drive is in operation: it does not come into operation."""
    rig = Rig(variables=HARD)
    power = rig.axis.power()
    rig.cycles(2)
    assert rig.axis.state is S.ENABLING
    rig.port.switches = POSITIVE
    rig.run(0.5)
    assert (rig.axis.state, power.Status, power.Busy) == (S.ALARM_DISABLED, False, True)


@pytest.mark.requirement("LIM-047", "LIM-059")
@pytest.mark.parametrize("velocity", [100.0, -100.0])
def test_acknowledged_while_the_axis_still_brakes(velocity):
    """The ramp goes on to its end; a motion that takes over while the axis still goes outwards is 531
    again.
    """
    rig = Rig(variables=HARD | {"DynamicDefaults.EmergencyDeceleration": 500.0}).travelling(300.0)
    rig.port.switches = POSITIVE
    rig.run(0.05)
    rig.until(rig.axis.reset().done)
    assert rig.axis.var("Velocity") > 200.0
    job = rig.axis.move_velocity(velocity)
    rig.run(1.5)
    assert job.ErrorID == 0x8001
    assert raised(rig) == [(531, 1), (531, 3)]
    assert rig.axis.state is S.ALARM_STANDSTILL


@pytest.mark.requirement("LIM-040")
def test_with_a_torque_limit():
    """Torque limiting stays on while the switch stops the axis."""
    rig = Rig(variables=HARD | {"Actor.DriveParameter.ReferenceTorque": 4.0}, port=TorquePort()).enabled()
    limiting = rig.axis.torque_limiting(1.0)
    rig.axis.move_velocity(50.0)
    rig.run(0.3)
    rig.port.switches = POSITIVE
    rig.run(0.5)
    assert raised(rig) == [(531, 1)]
    assert rig.axis.state is S.ALARM_STANDSTILL
    assert limiting.Busy


@pytest.mark.requirement("LIM-051", "LIM-046")
def test_another_encoder_behind_a_traversable_switch():
    """Switched to an encoder that reads 30 more: the switch is released where it is, in the positions of that
    encoder.
    """
    rig = Encoders(ahead=(30.0,), types=(0, 1))
    axis = rig.axis
    axis.variables.set_internal("PositionLimits_HW.Active", True)
    axis.variables.set_internal("PositionLimits_HW.Mode", 1)
    switch = axis.position.hardware.positive
    switch.active, switch.trip = True, axis.feedback.position - 5.0
    before = axis.feedback.position - switch.trip
    axis.set_sensor(2, mode=1)
    rig.cycles(2)
    assert axis.var("OperativeSensor") == 2
    assert axis.feedback.position == pytest.approx(30.0, abs=0.01)
    assert axis.feedback.position - switch.trip == pytest.approx(before, abs=0.01)


# -- software
# ------------------------------------------------------------------------------------------------------------


@pytest.mark.requirement("LIM-091", "LIM-092", "LIM-093", "LIM-082")
@pytest.mark.parametrize("turns", [0, 7, -3])
@pytest.mark.parametrize(
    ("low", "high", "start"), [(0.0, 360.0, 100.0), (100.0, 400.0, 150.0), (-10.0, 200.0, 100.0)]
)
def test_limits_at_the_ends_of_the_modulo_range(low, high, start, turns):
    """At rest on the end of the range the axis is on its limit, and not in front of the next range: outwards
    is refused.
    """
    rig = Rig(
        variables={"PositionLimits_SW.MinPosition": low, "PositionLimits_SW.MaxPosition": high} | MODULO
    ).enabled()
    rig.axis.home(start)
    rig.cycles(2)
    if turns:
        rig.until(
            rig.axis.move_relative(360.0 * turns, Velocity=500.0, Acceleration=2000.0, Jerk=0.0).done, 20.0
        )
    rig.axis.write("PositionLimits_SW.Active", True)
    rig.cycles(2)
    for side, end, bit in ((1.0, min(high, 360.0), "X16"), (-1.0, max(low, 0.0), "X15")):
        rig.axis.move_velocity(side * 400.0, Acceleration=2000.0, Jerk=0.0)
        rig.until(lambda: rig.axis.state is S.ALARM_STANDSTILL, 5.0)
        rig.cycles(1)
        there = rig.axis.var("ModuloCycle") * 360.0 + rig.axis.var("Position")
        assert there == pytest.approx(360.0 * turns + end, abs=1e-6)
        assert [rig.axis.var(f"StatusWord.{one}") for one in ("X15", "X16")] == [bit == "X15", bit == "X16"]
        acknowledge(rig)
        before = len(raised(rig))
        outwards = rig.axis.move_relative(side * 5.0)
        rig.run(0.1)
        assert outwards.Error
        assert len(raised(rig)) == before + 1
        acknowledge(rig)
    assert not raised(rig, 534)


@pytest.mark.requirement("LIM-084", "LIM-085", "LIM-075")
@pytest.mark.parametrize("leaves", [0, 1])
def test_a_limit_that_comes_closer_on_the_approach(leaves):
    """The limit is moved towards the axis that brakes for it already: 533, then 534 where the setpoint passes
    it.
    """
    rig = soft(**{"PositionLimits_SW.LimitExceededBehavior": leaves})
    rig.axis.move_velocity(400.0, Acceleration=2000.0, Jerk=0.0)
    rig.until(lambda: rig.axis.state is S.ALARM_RAMP)
    rig.axis.write("PositionLimits_SW.MaxPosition", 85.0)
    rig.run(2.0)
    assert raised(rig) == [(533, 2), (534, 2)]
    assert max(rig.column("position_setpoint")) > 86.0
    assert rig.axis.state is (S.ALARM_STANDSTILL if leaves else S.ALARM_DISABLED)
    assert rig.axis.var("StatusWord.X16")
    acknowledge(rig)
    for _ in range(2):  # back in steps, the first of them still outside
        rig.until(rig.axis.move_relative(-2.0).done)
    assert len(raised(rig)) == 2


@pytest.mark.requirement("LIM-084", "LIM-086")
def test_a_disabling_ramp_that_passes_the_limit():
    """`MC_Power` StopMode 0 with a weak emergency ramp: 534 where the setpoint passes the limit."""
    rig = soft(**{"DynamicDefaults.EmergencyDeceleration": 300.0})
    rig.axis.move_velocity(200.0, Acceleration=2000.0, Jerk=0.0)
    rig.until(lambda: rig.axis.var("Position") > 60.0)
    rig.axis.power(False, stop_mode=0)
    rig.run(1.5)
    assert raised(rig) == [(534, 2)]
    assert rig.axis.state is S.ALARM_DISABLED


@pytest.mark.requirement("LIM-087", "LIM-084", "LIM-095")
@pytest.mark.parametrize("side", [1.0, -1.0])
def test_limits_moved_across_a_standing_axis(side):
    """At rest nothing is passed; the axis may go inwards in steps, and outwards it may not."""
    rig = soft()
    rig.until(rig.axis.move_relative(side * 50.0).done)
    rig.axis.write(f"PositionLimits_SW.{'Max' if side > 0 else 'Min'}Position", side * 20.0)
    rig.run(0.1)
    first = raised(rig)
    if first:
        acknowledge(rig)
    outwards = rig.axis.move_relative(side * 5.0)
    rig.run(0.2)
    assert outwards.Error
    acknowledge(rig)
    before = len(raised(rig))
    rig.until(rig.axis.move_relative(-side * 10.0).done)
    rig.until(rig.axis.move_relative(-side * 10.0).done)
    rig.until(rig.axis.move_relative(-side * 20.0).done)
    assert len(raised(rig)) == before


@pytest.mark.requirement("LIM-075", "LIM-076", "MIN-006")
@pytest.mark.parametrize("acceleration", [0.0, 1000.0, -500.0])
def test_velocities_from_the_program_that_lie_about_their_acceleration(acceleration):
    """The acceleration that is given does not belong to the velocities: the axis ends on its limit all the
    same.
    """
    rig = soft()
    job = rig.axis.motion_in_velocity(0.0)
    for cycle in range(130):
        rig.feed(job, [{"Velocity": min(4.0 * cycle, 240.0), "Acceleration": acceleration}])
    rig.run(0.5)
    assert raised(rig) == [(533, 2)]
    assert max(rig.column("position_setpoint")) <= 100.0 + 1e-6
    assert rig.axis.var("Position") == pytest.approx(100.0, abs=1e-6)


@pytest.mark.requirement("LIM-075", "LIM-076")
@pytest.mark.parametrize("mode", ["VirtualAxis.Mode", "Simulation.Mode"])
def test_axes_without_a_drive(mode):
    """Virtual and simulated: 533 and at rest on the limit; the hardware switches mean nothing."""
    rig = soft(**HARD | {mode: 1})
    rig.port.switches = NEGATIVE | POSITIVE
    rig.axis.move_velocity(-300.0)
    rig.until(lambda: rig.axis.state is S.ALARM_STANDSTILL)
    rig.cycles(5)
    assert raised(rig) == [(533, 1)]
    assert rig.axis.var("ActualPosition") == pytest.approx(-100.0, abs=0.01)
    assert not rig.axis.status_word & (X17 | X18)


@pytest.mark.requirement("LIM-075", "LIM-097")
def test_an_override_that_lets_the_axis_go():
    """At rest on the limit with a job outwards that the override holds: given free, it does not move for a
    single cycle.
    """
    rig = soft()
    rig.axis.move_velocity(200.0)
    rig.until(lambda: rig.axis.state is S.ALARM_STANDSTILL)
    acknowledge(rig)
    rig.axis.write("Override.Velocity", 0.0)
    rig.cycles(2)
    rig.axis.move_velocity(200.0, Acceleration=2000.0, Jerk=0.0)
    rig.cycles(3)
    rig.axis.write("Override.Velocity", 100.0)
    rig.run(0.2)
    assert max(rig.column("position_setpoint")) <= 100.0 + 1e-6
    assert raised(rig) == [(533, 2), (533, 2)]


# -- any order
# ------------------------------------------------------------------------------------------------------------

VELOCITIES = st.sampled_from([-400.0, -150.0, -20.0, 0.0, 20.0, 150.0, 400.0])
ACTS = st.one_of(
    st.tuples(st.just("velocity"), VELOCITIES),
    st.tuples(st.just("absolute"), st.integers(-160, 160).map(float)),
    st.tuples(st.just("superimposed"), st.sampled_from([-150.0, -10.0, 10.0, 150.0])),
    st.tuples(st.just("halt"), st.just(0.0)),
    st.tuples(st.just("stop"), st.sampled_from([0.0, 2.0, 3.0])),
    st.tuples(st.just("override"), st.sampled_from([0.0, 50.0, 100.0, 200.0])),
)


def act(rig, what, value, jerk):
    axis = rig.axis
    dynamics = {"Acceleration": 1500.0, "Deceleration": 1500.0, "Jerk": jerk}
    if what == "velocity":
        axis.move_velocity(value, **dynamics)
    elif what == "absolute":
        axis.move_absolute(value, Velocity=400.0, **dynamics)
    elif what == "superimposed":
        axis.move_superimposed(value, VelocityDiff=200.0, **dynamics)
    elif what == "halt":
        axis.halt(Deceleration=500.0, Jerk=jerk)
    elif what == "stop":
        axis.stop(int(value), Deceleration=500.0, Jerk=jerk).set(Execute=False)
    else:
        axis.write("Override.Velocity", value)


@pytest.mark.exhaustive
@pytest.mark.requirement("LIM-075")
@settings(max_examples=40)
@given(
    acts=st.lists(st.tuples(st.integers(1, 120), ACTS), min_size=1, max_size=8),
    jerk=st.sampled_from([0.0, 4000.0]),
)
def test_no_order_of_jobs_passes_a_software_limit(acts, jerk):
    """Jobs, halts, stops, superimposed motion and overrides in any order: the setpoint stays between its
    limits, to the rounding.
    """
    rig = Rig(variables=SOFT | {"VirtualAxis.Mode": 1, "FollowingError.EnableMonitoring": False}).enabled()
    rig.until(rig.axis.home(0.0).done)
    rig.cycles(1)
    for cycles, (what, value) in acts:
        act(rig, what, value, jerk)
        rig.cycles(cycles)
        if rig.axis.state is S.ALARM_STANDSTILL:
            rig.axis.reset()
            rig.cycles(6)
    rig.axis.write("Override.Velocity", 100.0)
    rig.run(1.5)
    assert max(map(abs, rig.column("position_setpoint"))) <= 100.0 + 1e-6
    assert not raised(rig, 534)


@pytest.mark.exhaustive
@pytest.mark.requirement("LIM-075")
@settings(max_examples=30)
@given(
    jobs=st.lists(
        st.tuples(
            st.integers(1, 150),
            st.floats(30.0, 490.0),
            st.sampled_from([200.0, 2000.0]),
            st.sampled_from([50.0, 130.0, 2000.0]),
            st.sampled_from([0.0, 5000.0, 8000.0]),
        ),
        min_size=2,
        max_size=4,
    )
)
@example(
    jobs=[
        (50, 75.4, 2000.0, 2000.0, 8000.0),
        (22, 368.4, 2000.0, 130.0, 0.0),
        (7, 413.2, 200.0, 50.0, 8000.0),
    ]
)
@example(jobs=[(100, 200.5, 1000.0, 50.0, 0.0), (100, 401.0, 2000.0, 50.0, 0.0)])
def test_jobs_of_other_dynamics_end_on_a_software_limit(jobs):
    """Whatever velocity, dynamics and jerk a job has that supersedes another one: the stop with the greatest
    values ends on the limit.
    """
    rig = Rig(variables=SOFT | {"VirtualAxis.Mode": 1, "FollowingError.EnableMonitoring": False}).enabled()
    rig.until(rig.axis.home(0.0).done)
    rig.cycles(1)
    for cycles, velocity, acceleration, deceleration, jerk in jobs:
        rig.axis.move_velocity(velocity, Acceleration=acceleration, Deceleration=deceleration, Jerk=jerk)
        rig.cycles(cycles)
    rig.until(lambda: rig.axis.state is S.ALARM_STANDSTILL)
    rig.cycles(2)
    assert max(rig.column("position_setpoint")) == pytest.approx(100.0, abs=1e-6)
    assert raised(rig) == [(533, 2)]


SWITCHING = st.one_of(
    st.tuples(st.just("velocity"), VELOCITIES),
    st.tuples(st.just("superimposed"), st.sampled_from([-50.0, 50.0])),
    st.tuples(st.just("switches"), st.integers(0, 3).map(float)),
    st.tuples(st.just("acknowledge"), st.just(0.0)),
    st.tuples(st.just("monitoring"), st.sampled_from([0.0, 1.0])),
    st.tuples(st.just("halt"), st.just(0.0)),
)


@pytest.mark.exhaustive
@pytest.mark.requirement("LIM-049", "LIM-059", "LIM-061")
@settings(max_examples=40)
@given(
    acts=st.lists(st.tuples(st.integers(1, 60), SWITCHING), min_size=2, max_size=12),
    mode=st.sampled_from([0, 1]),
    behaviour=st.sampled_from([0, 1]),
)
def test_no_order_of_events_leads_further_into_a_switch(acts, mode, behaviour):
    """Whatever comes in whatever order: with its status bit set no motion goes outwards for longer than its
    alarm takes.
    """
    rig = Rig(
        variables=HARD
        | {
            "PositionLimits_HW.Mode": mode,
            "PositionLimits_HW.ApproachBehavior": behaviour,
            "FollowingError.EnableMonitoring": False,
        }
    ).enabled()
    for cycles, (what, value) in acts:
        if what == "switches":
            rig.port.switches = int(value)
        elif what == "acknowledge":
            rig.axis.reset()
        elif what == "monitoring":
            rig.axis.write_parameter(1000, bool(value))
        else:
            act(rig, what, value, 0.0)
        rig.cycles(cycles)
    rig.run(0.3)
    motion = int(S.MOTION)
    running = 0
    for word, state, velocity in zip(
        rig.column("status_word"), rig.column("state"), rig.column("velocity_setpoint"), strict=True
    ):
        word = int(word)  # noqa: PLW2901 - the trace has numbers
        outwards = (word & X18 and velocity > 0.0) or (word & X17 and velocity < 0.0)
        running = running + 1 if state == motion and outwards else 0
        assert running <= 2


@pytest.mark.requirement("LIM-029", "LIM-036")
@pytest.mark.parametrize("cycle", [0.001, 0.004, 0.016])
def test_the_way_into_the_switch(cycle):
    """Pushed by the setpoint at 300 mm/s: one cycle until it is seen, then 11.25 mm of the emergency ramp."""
    rig = Rig(variables=HARD, cycle_ns=round(cycle * 1e9)).travelling(300.0)
    place = rig.column("position_setpoint")[-1]
    rig.port.switches = POSITIVE
    rig.run(0.3)
    way = rig.column("position_setpoint")[-1] - place
    assert 11.24 <= way <= 11.25 + 300.0 * 3 * cycle


@pytest.mark.exhaustive
@pytest.mark.requirement("LIM-075")
@settings(max_examples=15)
@given(
    speeds=st.tuples(st.floats(20.0, 450.0), st.floats(20.0, 450.0)),
    acceleration=st.floats(300.0, 2000.0),
    deceleration=st.sampled_from([200.0, 2000.0]),
    jerk=st.sampled_from([0.0, 5000.0]),
    behaviour=st.sampled_from([0, 1]),
    room=st.floats(-12.0, 6.0),
)
@example((200.5, 401.0), 2000.0, 200.0, 0.0, 0, -8.0)
def test_limit_reached_at_the_end_of_a_superseding_acceleration(
    speeds, acceleration, deceleration, jerk, behaviour, room
):
    """The limit comes where the acceleration of a superseding job ends: the axis stops on the limit."""
    first, second = speeds
    far = {"PositionLimits_SW.MaxPosition": 1e6, "PositionLimits_SW.LimitReachedBehavior": behaviour}
    rig = soft(**far, **{"DynamicLimits.MaxDeceleration": deceleration})
    limit = 0.3 * first + (first + second) / 2.0 * abs(second - first) / acceleration
    limit += second * second / (2.0 * deceleration) + room
    rig.axis.write(
        "PositionLimits_SW.MaxPosition", max(limit, 0.35 * first + first * first / 2.0 / deceleration)
    )
    dynamics = {"Acceleration": acceleration, "Deceleration": deceleration, "Jerk": jerk}
    rig.axis.move_velocity(first, **dynamics | {"Acceleration": 2000.0})
    rig.run(0.3)
    rig.axis.move_velocity(second, **dynamics)
    rig.until(lambda: raised(rig), 10.0)
    rig.until(lambda: rig.column("velocity_setpoint")[-1] == 0.0)
    assert raised(rig, 533, 534) == [(533, 2)]
    assert max(rig.column("position_setpoint")) == pytest.approx(
        rig.axis.var("PositionLimits_SW.MaxPosition")
    )
