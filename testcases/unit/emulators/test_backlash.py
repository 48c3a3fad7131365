"""Backlash between motor and load: two bodies that collide, press against each other, and part."""

from __future__ import annotations

import math
import random

import pytest

from emulators.mechanics import LinearAxisMechanics, RotaryAxisMechanics
from fieldbus.errors import ConfigurationError

DT = 250e-6
LEAD = 0.010
PER_TURN = LEAD / (2.0 * math.pi)
MOTOR = 2.5e-4
"""Motor and screw, kg m^2."""
MASS = 40.0


def slide(backlash_m=0.002, **options):
    return LinearAxisMechanics(
        lead_screw_m=LEAD,
        motor_inertia_kgm2=2e-4,
        screw_inertia_kgm2=0.5e-4,
        load_mass_kg=MASS,
        backlash_m=backlash_m,
        **options,
    )


def motor_at(plant):
    """Return the place of the motor as travel of the load, m."""
    return plant.motor_angle * PER_TURN


def run(plant, torque, steps):
    for _ in range(steps):
        plant.step(torque, DT)


def test_within_the_play_the_motor_moves_alone():
    """With the inertia of motor and screw alone; the load stands where it is."""
    plant = slide()
    run(plant, 0.05, 40)
    assert plant.motor_speed == pytest.approx(0.05 / MOTOR * 40 * DT, rel=1e-9)
    assert (plant.position, plant.velocity) == (0.0, 0.0)


def test_the_collision_keeps_the_momentum():
    """Where the play ends both go on with the velocity that their common momentum makes."""
    plant = slide()
    while plant.velocity == 0.0:
        before = plant.motor_speed
        plant.step(1e-3 if before < 30.0 else 0.0, DT)
    share = MOTOR / (MOTOR + MASS * PER_TURN**2)
    assert plant.velocity / PER_TURN == pytest.approx(share * before, rel=1e-3)
    assert plant.motor_speed == pytest.approx(plant.velocity / PER_TURN)
    assert motor_at(plant) - plant.position == pytest.approx(0.001)


def test_pressed_together_they_are_one_body():
    """Once the motor presses, the motion is that of an axis without backlash, step for step."""
    plant = slide(viscous_friction=30.0, coulomb_friction=30.0)
    run(plant, 1.0, 100)
    for torque in (1.0, 2.0, 0.3):
        run(plant, torque, 20)
        assert motor_at(plant) - plant.position == pytest.approx(0.001)
        start, speed = plant.position, plant.velocity
        run(plant, torque, 20)
        alone = slide(0.0, viscous_friction=30.0, coulomb_friction=30.0)
        alone.velocity = speed
        run(alone, torque, 20)
        assert plant.velocity == pytest.approx(alone.velocity, rel=1e-9)
        assert plant.position - start == pytest.approx(alone.position, rel=1e-9)


def test_a_reversal_goes_through_the_play():
    """The load of a motor that turns back stays where it is until the motor has gone through the whole
    play.
    """
    plant = slide(coulomb_friction=200.0)
    run(plant, 1.0, 100)
    while plant.velocity > 0.0:
        plant.step(-2.0, DT)
    rest, turned = plant.position, motor_at(plant)
    assert turned > rest - 0.001
    while plant.position == rest:
        turned = motor_at(plant)
        plant.step(-0.05, DT)
    assert turned - rest == pytest.approx(-0.001, abs=abs(plant.motor_speed) * PER_TURN * DT * 2.0)


def test_a_hanging_load_lies_on_one_flank_and_a_brake_holds_it():
    """Weight takes the load through the play, and no further while the brake holds the motor."""
    plant = slide(gravity_force=-200.0)
    plant.set_brake_torque(5.0)
    run(plant, 0.0, 2000)
    assert motor_at(plant) - plant.position == pytest.approx(0.001)
    assert -5e-5 < motor_at(plant) < 0.0  # the blow has turned it a little
    assert plant.velocity == plant.motor_speed == 0.0


@pytest.mark.parametrize("growth_s", [0.0, 0.1])
def test_play_grows_and_is_repaired(growth_s):
    """It grows evenly from what was built; after the repair the load is drawn to the motor, whose encoder
    sees nothing of it.
    """
    plant = slide(0.0, gravity_force=-200.0)
    plant.set_brake_torque(5.0)
    plant.set_added_backlash(0.002, growth_s)
    run(plant, 0.0, 200)
    assert plant.backlash == pytest.approx(0.001 if growth_s else 0.002)
    run(plant, 0.0, 800)
    assert plant.backlash == pytest.approx(0.002)
    assert motor_at(plant) - plant.position == pytest.approx(0.001)
    angle = plant.motor_angle
    plant.set_added_backlash(0.0)
    run(plant, 0.0, 10)
    assert (plant.motor_angle, plant.position, plant.backlash) == (
        angle,
        pytest.approx(angle * PER_TURN),
        0.0,
    )
    run(plant, 3.0, 50)
    assert plant.motor_angle * PER_TURN == pytest.approx(plant.position)


def test_stop_jam_slip_and_break_in_the_play():
    """An end stop holds the load, a jam too, and the motor has its play; a slip moves the play with the load;
    a break leaves none.
    """
    plant = slide(upper_stop_m=0.01)
    run(plant, 1.0, 4000)
    assert plant.position == pytest.approx(0.01, abs=1e-4)
    assert motor_at(plant) - plant.position == pytest.approx(0.001, abs=1e-6)
    plant.jam(True)
    held = plant.position
    run(plant, -1.0, 4000)
    assert plant.position == held
    assert motor_at(plant) - held == pytest.approx(-0.001)
    assert plant.motor_speed == 0.0
    plant.jam(False)
    apart = motor_at(plant) - plant.position
    assert plant.slip(-0.003)
    assert motor_at(plant) - plant.position == pytest.approx(apart)
    plant.break_coupling(0.4)
    run(plant, -1.0, 400)
    assert motor_at(plant) - plant.position < -0.002
    assert math.isinf(plant.backlash)
    turned = plant.motor_angle
    assert not plant.slip(0.001)
    assert plant.motor_angle == turned
    plant.set_added_backlash(0.001)
    assert math.isinf(plant.backlash)


@pytest.mark.parametrize("seed", range(5))
def test_nobody_gains_energy_and_nobody_leaves_the_play(seed):
    """Whatever the motor does: never further apart than the play, and no more energy than it has brought."""
    rng = random.Random(seed)
    plant = RotaryAxisMechanics(
        motor_inertia_kgm2=2e-4,
        load_inertia_kgm2=3e-4,
        gear_ratio=2.0,
        backlash_rad=0.02,
        coulomb_friction=rng.choice([0.0, 0.02]),
        viscous_friction=1e-4,
    )
    motor, brought = 2e-4, 0.0
    torque = 0.0
    for _ in range(4000):
        if rng.random() < 0.02:
            torque = rng.uniform(-0.5, 0.5)
        angle = plant.motor_angle
        plant.step(torque, DT)
        brought += torque * (plant.motor_angle - angle)
        energy = 0.5 * motor * plant.motor_speed**2 + 0.5 * 3e-4 * plant.velocity**2
        assert abs(plant.motor_angle / 2.0 - plant.position) <= 0.01 + 1e-12
        assert energy <= brought + 1e-4
    assert plant.position != 0.0


@pytest.mark.parametrize("values", [{"backlash_m": -1e-3}, {"backlash_m": math.nan}])
def test_what_is_no_play_is_refused(values):
    """A play is a finite number of at least 0; so is what it grows by."""
    with pytest.raises(ConfigurationError, match="backlash"):
        slide(**values)
    with pytest.raises(ConfigurationError, match="backlash"):
        slide().set_added_backlash(-1e-3)
    with pytest.raises(ConfigurationError, match="growth_s"):
        slide().set_added_backlash(1e-3, -1.0)
