"""Axis plant: integration, friction, end stops, faults."""

from __future__ import annotations

import math

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from emulators.mechanics import AxisMechanics, LinearAxisMechanics, RotaryAxisMechanics, SwitchModel
from fieldbus.errors import ConfigurationError

DT = 0.00025


def axis(**options) -> AxisMechanics:
    values = {"ratio": 1.0, "inertia": 2.0, **options}
    return AxisMechanics(**values)


def run(mechanics: AxisMechanics, torque: float, seconds: float, dt: float = DT) -> None:
    for _ in range(round(seconds / dt)):
        mechanics.step(torque, dt)


def test_constant_force_is_integrated_exactly():
    """Without friction a constant force gives v = F t / m and x = F t^2 / 2m to rounding."""
    mechanics = axis()
    run(mechanics, 3.0, 1.0)
    assert mechanics.velocity == pytest.approx(1.5, rel=1e-12)
    assert mechanics.position == pytest.approx(0.75, rel=1e-12)


def test_gear_and_lead_screw_reflect_inertia_and_torque():
    """1 Nm at the motor of a 10 mm screw pushes with 2 pi / 0.01 N; inertias add up at the motor shaft."""
    mechanics = LinearAxisMechanics(
        lead_screw_m=0.01, gear_ratio=2.0, motor_inertia_kgm2=1e-4, screw_inertia_kgm2=4e-4, load_mass_kg=10.0
    )
    per_radian = 0.01 / (2 * math.pi) / 2.0
    assert mechanics.motor_inertia == pytest.approx(1e-4 + 4e-4 / 4.0 + 10.0 * per_radian**2)
    run(mechanics, 0.5, 0.1)
    assert mechanics.motor_speed == pytest.approx(0.5 / mechanics.motor_inertia * 0.1, rel=1e-9)
    assert mechanics.motor_angle == pytest.approx(mechanics.position / per_radian)


def test_rotary_axis_gear():
    """A gear i divides the speed and multiplies the motor inertia at the load by i^2."""
    mechanics = RotaryAxisMechanics(gear_ratio=5.0, motor_inertia_kgm2=1e-4, load_inertia_kgm2=2.5e-3)
    assert mechanics.motor_inertia == pytest.approx(2e-4)
    run(mechanics, 0.1, 0.1)
    assert mechanics.motor_speed == pytest.approx(5.0 * mechanics.velocity)


@pytest.mark.parametrize("backlash", [0.0, 1e-4])
def test_a_reversed_machine_is_the_mirror_image(backlash):
    """The load goes the same way backwards while the motor turns forwards, against the same friction and
    brake, with play and without.
    """
    parts = {"lead_screw_m": 0.01, "motor_inertia_kgm2": 1e-4, "load_mass_kg": 20.0, "backlash_m": backlash}
    plain, mirrored = (
        LinearAxisMechanics(**parts, coulomb_friction=25.0, reversed_direction=turned)
        for turned in (False, True)
    )
    for brake_nm, torque_nm in ((0.0, 0.4), (0.1, 0.4), (0.1, -0.3), (0.3, 0.2), (0.0, -0.03)):
        for mechanics in (plain, mirrored):
            mechanics.set_brake_torque(brake_nm)
            run(mechanics, torque_nm, 0.05)
        assert mirrored.motor_angle == pytest.approx(plain.motor_angle, rel=1e-12)
        assert mirrored.motor_speed == pytest.approx(plain.motor_speed, rel=1e-12)
        assert mirrored.position == pytest.approx(-plain.position, rel=1e-12)
    assert abs(plain.position) > 1e-3


def test_viscous_friction_decays_to_the_terminal_speed():
    """With viscous friction the speed goes to F/b with the time constant m/b."""
    mechanics = axis(viscous_friction=4.0)
    run(mechanics, 2.0, 0.5)
    assert mechanics.velocity == pytest.approx(0.5 * (1.0 - math.exp(-1.0)), rel=1e-5)
    run(mechanics, 2.0, 10.0)
    assert mechanics.velocity == pytest.approx(0.5, rel=1e-6)


@pytest.mark.requirement("STP-530")
def test_coasting_against_dry_friction_takes_the_time_of_the_formula():
    """Torque off: an axis with Coulomb friction stops after m v / F, exactly, and stays."""
    mechanics = axis(coulomb_friction=0.8)
    mechanics.velocity = 1.0
    run(mechanics, 0.0, 2.5 - 2 * DT)
    assert 0.0 < mechanics.velocity < 1e-3
    run(mechanics, 0.0, 0.01)
    assert mechanics.velocity == 0.0
    assert mechanics.position == pytest.approx(1.25, rel=1e-4)
    rest = mechanics.position
    run(mechanics, 0.79, 1.0)
    assert mechanics.position == rest


@pytest.mark.exhaustive
@settings(deadline=None)
@given(
    speed=st.floats(-5.0, 5.0),
    force=st.floats(-0.99, 0.99),
    dt=st.sampled_from([0.0001, 0.00025, 0.001, 0.004]),
)
def test_friction_never_creeps_or_chatters(speed: float, force: float, dt: float):
    """Where friction exceeds the drive force, the axis stops in finite time and then never moves again."""
    mechanics = axis(coulomb_friction=1.0)
    mechanics.velocity = speed
    signs = set()
    for _ in range(round(2.0 * abs(speed) / (1.0 - abs(force)) / dt) + 2):
        mechanics.step(force, dt)
        signs.add((mechanics.velocity > 0) - (mechanics.velocity < 0))
    assert mechanics.velocity == 0.0
    assert len(signs - {0}) <= 1
    rest = mechanics.position
    for _ in range(10):
        mechanics.step(-force, dt)
    assert mechanics.position == rest


def test_breakaway_needs_the_static_friction():
    """At standstill the larger static friction holds; once moving only the sliding friction acts."""
    mechanics = axis(coulomb_friction=1.0, static_friction=2.0)
    run(mechanics, 1.9, 0.1)
    assert mechanics.velocity == 0.0
    run(mechanics, 2.1, 0.1)
    assert mechanics.velocity == pytest.approx(1.1 / 2.0 * 0.1, rel=1e-3)


@pytest.mark.requirement("STP-536")
@pytest.mark.parametrize("dt", [0.0001, 0.00025, 0.001])
@pytest.mark.parametrize("stiffness", [1e5, 1e7, 1e9])
def test_end_stop_is_stable_at_any_stiffness(dt: float, stiffness: float):
    """An axis that runs into a stop bounces at most with its own energy and comes to rest pressed against
    it.
    """
    damping = 0.6 * math.sqrt(stiffness * 100.0)
    mechanics = axis(
        inertia=100.0, upper_stop=0.5, stop_stiffness=stiffness, stop_damping=damping, viscous_friction=1e3
    )
    mechanics.velocity = 0.5
    fastest = 0.0
    for _ in range(round(3.0 / dt)):
        mechanics.step(200.0, dt)
        fastest = max(fastest, abs(mechanics.velocity))
    assert fastest <= 0.51
    assert mechanics.in_contact
    assert abs(mechanics.velocity) < 1e-4
    assert mechanics.position == pytest.approx(0.5 + 200.0 / stiffness, abs=1e-5)


@pytest.mark.requirement("STP-536")
def test_end_stop_can_be_removed_under_load():
    """Removing the stop sets a pressed axis free."""
    mechanics = axis(upper_stop=0.01)
    run(mechanics, 1.0, 1.0)
    assert mechanics.position < 0.011
    mechanics.set_stops(None, None)
    run(mechanics, 1.0, 1.0)
    assert mechanics.position > 0.2
    assert mechanics.stops == (None, None)


def test_a_stop_pushes_a_resting_axis_out_against_friction():
    """An axis at rest inside of a stop is pushed out although friction could hold it without the stop."""
    mechanics = axis(coulomb_friction=50.0, position=0.5)
    mechanics.set_stops(None, 0.49)
    run(mechanics, 0.0, 1.0)
    assert mechanics.position < 0.4901


def test_lower_stop_holds_too():
    """The lower stop is a mirror of the upper one."""
    mechanics = axis(lower_stop=-0.01, viscous_friction=10.0)
    run(mechanics, -1.0, 5.0)
    assert mechanics.position == pytest.approx(-0.01, abs=1e-5)


def test_jam_blocks_and_releases():
    """A jammed shaft stands still under any torque and moves again after release."""
    mechanics = axis()
    run(mechanics, 1.0, 0.1)
    mechanics.jam(True)
    place = mechanics.position
    run(mechanics, 1000.0, 0.1)
    assert (mechanics.position, mechanics.velocity) == (place, 0.0)
    mechanics.jam(False)
    run(mechanics, 1.0, 0.1)
    assert mechanics.position > place


def test_external_force_gravity_and_brake():
    """Gravity and external force add up; the brake holds what friction does not."""
    mechanics = axis(gravity_force=-5.0)
    run(mechanics, 0.0, 0.1)
    assert mechanics.velocity == pytest.approx(-0.25, rel=1e-9)
    mechanics.place(0.0)
    mechanics.apply_force(5.0)
    run(mechanics, 0.0, 0.1)
    assert mechanics.velocity == 0.0
    mechanics.apply_force(0.0)
    mechanics.set_brake_torque(6.0)
    run(mechanics, 0.0, 0.1)
    assert mechanics.velocity == 0.0
    mechanics.set_brake_torque(0.0)
    run(mechanics, 0.0, 0.1)
    assert mechanics.velocity < 0.0


def test_switch_with_hysteresis():
    """A switch comes at its edge and falls back only behind the hysteresis."""
    switch = SwitchModel.above(0.1, hysteresis=0.02)
    changes = []
    switch.on_change = lambda: changes.append(switch.state)
    mechanics = axis(switches=[switch])
    for position in (0.05, 0.0999, 0.1001, 0.2, 0.0801, 0.0799, 0.0999):
        mechanics.position, mechanics.velocity = position, 0.0
        mechanics.place(position)
    assert changes == [True, False]


def test_switch_edges_are_seen_by_the_moving_load():
    """A cam is entered and left in motion, each edge within one step of its place."""
    switch = SwitchModel(low=0.1, high=0.2)
    mechanics = axis(switches=[switch])
    places = []
    switch.on_change = lambda: places.append(mechanics.position)
    mechanics.velocity = 0.5
    run(mechanics, 0.0, 1.0)
    assert places == [pytest.approx(0.1, abs=0.5 * DT), pytest.approx(0.2, abs=0.5 * DT)]


def test_forced_and_inverted_switch():
    """A forced signal wins over polarity and actuation; None gives the switch back."""
    switch = SwitchModel.below(0.0)
    axis(switches=[switch], position=1.0)
    assert switch.state is False
    switch.inverted = True
    assert switch.state is True
    switch.forced = False
    assert switch.state is False
    switch.forced = None
    switch.inverted = False
    assert switch.state is False
    switch.forced = True
    assert switch.state is True
    assert not switch.actuated


@pytest.mark.parametrize(
    "options",
    [
        {"inertia": 0.0},
        {"ratio": 0.0},
        {"viscous_friction": -1.0},
        {"coulomb_friction": math.nan},
        {"coulomb_friction": 2.0, "static_friction": 1.0},
        {"lower_stop": 1.0, "upper_stop": 0.0},
        {"stop_stiffness": 0.0},
    ],
)
def test_impossible_plants_are_refused(options):
    """Values without physical sense are refused when the plant is built."""
    with pytest.raises(ConfigurationError):
        axis(**options)


def test_impossible_switches_are_refused():
    """A switch needs a range that it can leave."""
    for options in ({}, {"low": 1.0, "high": 0.0}, {"low": 0.0, "hysteresis": -1.0}):
        with pytest.raises(ConfigurationError):
            SwitchModel(**options)
