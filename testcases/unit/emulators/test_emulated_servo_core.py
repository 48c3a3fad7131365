"""Servo core: golden ramps, tracking, limits, pulses, brake."""

from __future__ import annotations

import math
import random

import pytest

from emulators.drive import HoldingBrake, ServoCore, ServoTuning
from emulators.drive.tuning import RPM
from emulators.encoder import IncrementalEncoder
from emulators.mechanics import AxisMechanics, LinearAxisMechanics
from fieldbus.errors import ConfigurationError

DT = 0.00025
LEAD = 0.01


def build(
    *, tuning: ServoTuning | None = None, brake: dict[str, float] | None = None, **options
) -> ServoCore:
    values = {"coulomb_friction": 30.0, "viscous_friction": 30.0, **options}
    mechanics = LinearAxisMechanics(
        lead_screw_m=LEAD, motor_inertia_kgm2=2e-4, screw_inertia_kgm2=0.5e-4, load_mass_kg=40.0, **values
    )
    core = ServoCore(
        mechanics=mechanics,
        encoder=IncrementalEncoder(),
        period_s=DT,
        tuning=tuning,
        brake=HoldingBrake(mechanics, **brake) if brake else None,
    )
    core.set_torque_limits(6.0, 6.0)
    return core


def run(core: ServoCore, seconds: float) -> None:
    for _ in range(round(seconds / DT)):
        core.step()


def at_speed(rpm: float, **options) -> ServoCore:
    core = build(**options)
    core.enable_pulses()
    core.ramp(rpm * RPM, 20000.0 * RPM)
    run(core, 0.5)
    assert core.speed_rpm == pytest.approx(rpm, rel=1e-4)
    return core


def stop(core: ServoCore, slope_rpm_s: float) -> tuple[float, float, float]:
    """Return load-side ramp time, travel and the time of the standstill report."""
    mechanics: AxisMechanics = core.mechanics
    reported = []
    core.on_standstill = lambda: reported.append(step * DT)
    core.stop(slope_rpm_s * RPM)
    core.step()  # the plant still moves under the torque of the last instant
    position, speed = mechanics.position, mechanics.velocity
    stopped = 0.0
    step = 0
    while not reported and step < 100_000:
        step += 1
        core.step()
        if abs(mechanics.velocity) > 1e-4 * abs(speed):
            stopped = step * DT
    return stopped + DT, mechanics.position - position, reported[0]


@pytest.mark.requirement("STP-010", "STP-529")
def test_off3_of_the_reference_axis():
    """From 1800 rpm with p1135 = 0.5 s from 3000 rpm: 300 ms and 45.0 mm at the load."""
    duration, travel, reported = stop(at_speed(1800.0), 3000.0 / 0.5)
    assert duration == pytest.approx(0.300, abs=DT + 1e-9)
    assert travel * 1000 == pytest.approx(45.0, rel=0.005)
    assert reported - duration <= 0.002


@pytest.mark.requirement("STP-011", "STP-529")
def test_off1_of_the_reference_axis():
    """From 1800 rpm with p1121 = 1.0 s from 3000 rpm: 600 ms and 90.0 mm at the load."""
    duration, travel, _ = stop(at_speed(-1800.0), 3000.0 / 1.0)
    assert duration == pytest.approx(0.600, abs=DT + 1e-9)
    assert travel * 1000 == pytest.approx(-90.0, rel=0.005)


@pytest.mark.parametrize("tracks", [False, True])
def test_ramp_slope_holds_under_friction_and_wrong_inertia(tracks: bool):
    """The ramp is controlled: 30 % wrong inertia and strong friction change the stop by less than 1 %."""
    tuning = ServoTuning(inertia_kgm2=3.5e-4 * 1.3)
    core = at_speed(1800.0, tuning=tuning, coulomb_friction=200.0)
    core.on_standstill = lambda: done.append(True)
    done: list[bool] = []
    core.stop(6000.0 * RPM, track_position=tracks)
    start = core.mechanics.position
    while not done:
        core.step()
    assert (core.mechanics.position - start) * 1000 == pytest.approx(45.0, rel=0.01)


def test_ramp_starts_from_the_actual_speed():
    """A stop begins at the speed that the axis has, not at the demand."""
    core = at_speed(1000.0)
    core.command_velocity(3000.0 * RPM, 1_000_000)
    core.torque_offset = 0.0
    core.mechanics.velocity = 1500.0 * RPM * core.mechanics.ratio
    core.step()
    core.step()
    start = core.speed_rpm
    core.stop(6000.0 * RPM)
    core.step()
    assert core.velocity_demand / RPM == pytest.approx(start - 6000.0 * DT, rel=1e-6)


@pytest.mark.requirement("STP-530")
def test_pulse_inhibit_takes_the_torque_away_in_the_same_step():
    """After pulse inhibit no torque acts: the axis coasts with its friction only."""
    core = at_speed(1800.0, viscous_friction=0.0)
    core.stop(6000.0 * RPM)
    run(core, 0.01)
    assert core.torque != 0.0
    core.inhibit_pulses()
    assert (core.torque, core.torque_demand) == (0.0, 0.0)
    speed = core.mechanics.velocity
    run(core, 0.1)
    mass = core.mechanics.motor_inertia / core.mechanics.ratio**2
    assert speed - core.mechanics.velocity == pytest.approx(30.0 / mass * 0.1, rel=1e-6)


def test_interpolated_velocity_is_followed_without_lag():
    """csv-like ramp of 3000 rpm/s, new target every 4 ms: actual = demand within 0.1 rpm (pre-controlled)."""
    core = build()
    core.enable_pulses()
    worst = 0.0
    for cycle in range(1, 100):
        core.command_velocity(cycle * 12.0 * RPM, 16)
        for _ in range(16):
            demand = core.precontrol_velocity
            core.step()
            if cycle > 20:
                worst = max(worst, abs(core.mechanics.motor_speed - demand) / RPM)
    assert worst < 0.1


def test_velocity_loop_time_constant_without_precontrol():
    """With torque_precontrol off a velocity step is answered with T_vtc = 2 ms."""
    core = build(tuning=ServoTuning(torque_precontrol=False), coulomb_friction=0.0, viscous_friction=0.0)
    core.enable_pulses()
    core.command_velocity(100.0 * RPM, 1)
    run(core, 0.002 + 2 * DT)
    assert core.mechanics.motor_speed / RPM == pytest.approx(100.0 * (1 - math.exp(-1)), rel=0.06)
    run(core, 0.05)
    assert core.mechanics.motor_speed / RPM == pytest.approx(100.0, rel=1e-3)


@pytest.mark.parametrize("feedforward", [0.0, 1.0])
def test_position_lag_at_constant_velocity(feedforward: float):
    """Following error at constant velocity: v / Kv without, zero with velocity feed-forward."""
    core = build(tuning=ServoTuning(velocity_feedforward=feedforward, position_gain=80.0))
    core.enable_pulses()
    core.command_position(200.0, round(2.0 / DT))
    run(core, 1.5)
    expected = 100.0 / 80.0 * (1.0 - feedforward)
    assert core.following_error == pytest.approx(expected, abs=1e-3)


def test_position_is_reached_exactly_and_held_against_a_force():
    """After an interpolated move the axis stands at the target, and a load step is taken back."""
    core = build()
    core.enable_pulses()
    core.command_position(50.0, 2000)
    run(core, 1.0)
    assert core.mechanics.motor_angle == pytest.approx(50.0, abs=2e-3)
    core.mechanics.apply_force(800.0)
    run(core, 0.01)
    assert abs(core.mechanics.motor_angle - 50.0) > 2e-3
    run(core, 1.0)
    assert core.mechanics.motor_angle == pytest.approx(50.0, abs=2e-3)


def test_torque_limit_and_anti_windup():
    """Above the torque limit the acceleration is limited, and the speed arrives without overshoot from
    windup.
    """
    core = build(coulomb_friction=0.0, viscous_friction=0.0)
    core.set_torque_limits(1.0, 1.0)
    core.enable_pulses()
    core.command_velocity(2000.0 * RPM, 1)
    fastest = 0.0
    limited = 0
    for _ in range(1600):
        core.step()
        limited += core.torque_limited
        fastest = max(fastest, core.mechanics.motor_speed / RPM)
        assert abs(core.torque) <= 1.0
    expected = 2000.0 * RPM * core.mechanics.motor_inertia / 1.0
    assert limited * DT == pytest.approx(expected, rel=0.1)
    assert fastest < 2000.0 * 1.02
    assert core.speed_rpm == pytest.approx(2000.0, rel=1e-3)


def test_stop_at_the_torque_limit():
    """A stop with infinite slope brakes with all the torque there is and ends at standstill."""
    core = at_speed(1800.0, coulomb_friction=0.0, viscous_friction=0.0)
    speed = core.mechanics.motor_speed
    done = []
    core.on_standstill = lambda: done.append(True)
    core.stop(math.inf)
    run(core, 0.005 + DT)
    assert core.torque == -6.0
    assert speed - core.mechanics.motor_speed == pytest.approx(
        6.0 / core.mechanics.motor_inertia * 0.005, rel=1e-6
    )
    run(core, 0.03)
    assert done == [True]
    assert core.standing


def test_torque_control_respects_the_speed_limit():
    """Torque control accelerates with the torque and stops accelerating at the speed limit."""
    core = build(coulomb_friction=0.0, viscous_friction=0.0)
    core.set_speed_limit(500.0 * RPM)
    core.enable_pulses()
    core.command_torque(0.5)
    run(core, 0.02)
    assert core.mechanics.motor_speed == pytest.approx(
        0.5 / core.mechanics.motor_inertia * (0.02 - DT), rel=1e-6
    )
    run(core, 0.3)
    assert core.mechanics.motor_speed / RPM == pytest.approx(500.0, rel=0.01)
    assert core.speed_limited


def test_change_of_source_is_bumpless():
    """Changing between velocity, ramp, position and torque control in motion makes no step in torque."""
    core = at_speed(600.0)
    core.command_velocity(600.0 * RPM, 1)
    run(core, 0.1)
    steady = core.torque
    torques = []
    for change in (
        lambda: core.ramp(600.0 * RPM, 1000.0),
        lambda: core.command_position(core.position + 600.0 * RPM * (0.1 + DT), 400),
        core.follow_profile,
        lambda: core.command_torque(steady),
        lambda: core.command_velocity(600.0 * RPM, 1),
    ):
        change()
        for _ in range(200):
            core.step()
            torques.append(core.torque)
    assert max(abs(torque - steady) for torque in torques) < 0.05


@pytest.mark.requirement("CTL-100")
def test_current_loop_lag():
    """A first-order current loop delays the torque by its time constant."""
    core = build(tuning=ServoTuning(current_time_constant_s=0.001))
    core.enable_pulses()
    core.command_torque(1.0)
    run(core, 0.001)
    assert core.torque == pytest.approx(1 - math.exp(-1), rel=0.1)
    run(core, 0.02)
    assert core.torque == pytest.approx(1.0, rel=1e-3)


@pytest.mark.requirement("STP-532")
def test_brake_closes_with_the_pulses_at_any_speed():
    """Pulse inhibit closes the brake irrespective of speed, after its closing time; forced open it stays
    open.
    """
    brake = {"torque_Nm": 3.0, "opening_time_s": 0.02, "closing_time_s": 0.03}
    core = build(brake=brake)
    assert core.brake.closed
    core.enable_pulses()
    run(core, 0.019)
    assert core.brake.closed
    run(core, 0.002)
    assert not core.brake.closed
    core.ramp(1000.0 * RPM, 50000.0 * RPM)
    run(core, 0.2)
    speed = core.mechanics.velocity
    core.inhibit_pulses()
    run(core, 0.0295)
    assert core.mechanics.velocity > 0.9 * speed
    run(core, 0.1)
    assert core.brake.closed
    assert core.mechanics.velocity == 0.0


def test_forced_open_brake_lets_the_axis_coast():
    """A brake that is held open from outside does not stop the coasting axis."""
    core = build(brake={"torque_Nm": 3.0})
    core.brake.forced_open = True
    core.enable_pulses()
    core.ramp(1000.0 * RPM, 50000.0 * RPM)
    run(core, 0.2)
    core.inhibit_pulses()
    run(core, 0.1)
    assert core.mechanics.velocity > 0.0
    core.brake.forced_open = False
    run(core, 0.1)
    assert core.mechanics.velocity == 0.0


def test_standstill_is_reported_after_the_timeout_when_the_axis_is_driven():
    """An axis that something keeps turning counts as stopped after the timeout, like a drive that gives
    up.
    """
    core = build(tuning=ServoTuning(standstill_timeout_s=0.2))
    core.set_torque_limits(0.1, 0.1)
    core.enable_pulses()
    core.mechanics.apply_force(500.0)
    run(core, 0.05)
    done = []
    core.on_standstill = lambda: done.append(True)
    core.stop(math.inf)
    run(core, 0.15)
    assert not done
    run(core, 0.1)
    assert done == [True]


def test_the_same_run_twice_is_identical():
    """The core has no hidden state outside of its objects: two runs agree bit by bit."""

    def trace() -> list[float]:
        core = at_speed(700.0)
        core.stop(6000.0 * RPM, track_position=True)
        values = []
        for _ in range(800):
            core.step()
            values.append(core.torque)
        return values

    assert trace() == trace()


@pytest.mark.parametrize(
    "options",
    [
        {"velocity_time_constant_ms": 0.0},
        {"position_gain": -1.0},
        {"velocity_feedforward": 1.5},
        {"inertia_kgm2": 0.0},
        {"standstill_speed_rpm": math.nan},
    ],
)
def test_impossible_tunings_are_refused(options):
    """Gains and times are checked."""
    with pytest.raises(ConfigurationError):
        ServoTuning(**options)


def test_servo_period_must_suit_the_velocity_loop():
    """A servo period near T_vtc would be unstable and is refused."""
    with pytest.raises(ConfigurationError, match="period_s"):
        build(tuning=ServoTuning(velocity_time_constant_ms=0.5))


def _state(core: ServoCore) -> list[float]:
    mechanics, encoder = core.mechanics, core.encoder
    return [
        core.position, core.velocity, core.position_demand, core.velocity_demand, core.position_ahead,
        core.torque, core.torque_demand, core.torque_limited, core.speed_limited, core.precontrol_velocity,
        core.phase_steps, mechanics.position, mechanics.velocity, mechanics.motor_angle, encoder.increments,
        encoder.angle,
    ]  # fmt: skip


def test_steps_at_once_are_the_same_as_single_ones():
    """`advance` makes bit for bit what so many calls of `step` make: any source, at limits, enabled or not,
    with and without lag, near to end stops where it is not allowed.
    """
    draw = random.Random(5)
    for seed in range(12):
        tuning = ServoTuning(current_time_constant_s=0.0005 if seed % 4 == 3 else 0.0)
        one, other = (
            build(tuning=tuning, coulomb_friction=30.0 * (seed % 3), lower_stop_m=-0.4, upper_stop_m=0.4)
            for _ in range(2)
        )
        calm = 0
        for _ in range(250):
            order, speed, steps = draw.randrange(12), draw.uniform(-300.0, 300.0), draw.randint(1, 8)
            force, count = draw.choice((0.0, 0.0, 300.0, -4000.0)), draw.randint(1, 16)
            for core in (one, other):
                if order == 0:
                    core.enable_pulses()
                elif order == 1 and speed > 200.0:
                    core.inhibit_pulses()
                elif order in (2, 3, 4):
                    core.command_velocity(speed, steps)
                elif order in (5, 6, 7):
                    core.command_servo(speed, core.position + speed / 50.0, 60.0, steps)
                elif order == 8:
                    core.command_position(core.position + speed / 100.0, steps, coast=2)
                elif order == 9:
                    core.ramp(speed, 5000.0)
                elif order == 10:
                    core.mechanics.apply_force(force)
                elif order == 11:
                    core.set_torque_limits(abs(speed) / 40.0, 6.0)
            if one.calm():
                calm += 1
                one.advance(count)
            else:
                for _ in range(count):
                    one.step()
            for _ in range(count):
                other.step()
            assert _state(one) == _state(other), (seed, order)
        assert calm > 20
