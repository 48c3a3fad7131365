"""Configuration of the drive."""

from __future__ import annotations

import math

import pytest

from emulators.drive import ServoTuning
from emulators.drive.cia402 import (
    BrakeConfig,
    CiA402Drive,
    DriveConfig,
    EncoderConfig,
    LinearAxisConfig,
    RotaryAxisConfig,
    SwitchesConfig,
)
from emulators.drive.machine import build_machine
from fieldbus.can import CanMedium
from fieldbus.clock import VirtualScheduler
from fieldbus.errors import ConfigurationError


def test_reference_axis_has_the_numbers_of_the_specification():
    """Ramps, limits and units of the reference axis; emergency braking takes less than half of the peak
    torque.
    """
    config = DriveConfig.reference()
    objects = config.objects
    assert (objects[0x6084, 0], objects[0x6085, 0]) == (3_000_000, 6_000_000)
    assert (objects[0x607F, 0], objects[0x6080, 0], objects[0x605B, 0]) == (3_000_000, 3000, 1)
    assert (objects[0x60A9, 0], objects[0x6092, 1], objects[0x6092, 2]) == (0xFDB44700, 131072, 1)
    mechanics, switches = build_machine(config.mechanics, config.switches)
    assert mechanics.stops == (-0.6, 0.6)
    assert (switches["negative_limit"].high, switches["positive_limit"].low) == (-0.55, 0.55)
    torque = 4.0 / mechanics.ratio * mechanics.motor_inertia
    assert torque < 0.5 * config.rated_torque_nm * 3.0
    assert mechanics.ratio * 2 * math.pi == pytest.approx(0.010)


def test_reference_axis_with_other_ramps():
    """Ramp times refer to the maximum speed."""
    objects = DriveConfig.reference(
        max_speed_rpm=6000, ramp_down_s=2.0, quick_stop_s=0.25, sync_period_ms=1
    ).objects
    assert (objects[0x6084, 0], objects[0x6085, 0], objects[0x60C2, 1]) == (3_000_000, 24_000_000, 1)


@pytest.mark.parametrize(
    ("build", "where"),
    [
        (lambda: DriveConfig(node_id=0), "node_id"),
        (lambda: DriveConfig(servo_period_ns=300_000), "servo_period_ns"),
        (lambda: DriveConfig(limit_switch_reaction="brake"), "limit_switch_reaction"),
        (lambda: DriveConfig(rated_torque_nm=0.0), "rated_torque_nm"),
        (lambda: DriveConfig(missing_setpoints=-1), "missing_setpoints"),
        (lambda: DriveConfig(boot_time_ms=math.inf), "boot_time_ms"),
        (lambda: EncoderConfig(kind="resolver"), "encoder kind"),
        (lambda: EncoderConfig(counts_per_revolution=1), "counts_per_revolution"),
        (lambda: SwitchesConfig(home_from_mm=3.0, home_to_mm=2.0), "home_from_mm"),
        (lambda: LinearAxisConfig(negative_stop_mm=5.0, positive_stop_mm=5.0), "positive_stop_mm"),
        (lambda: LinearAxisConfig(load_mass_kg=-1.0), "load_mass_kg"),
        (lambda: RotaryAxisConfig(gear_ratio=0.0), "gear_ratio"),
        (lambda: SwitchesConfig(hysteresis_mm=-1.0), "hysteresis_mm"),
        (lambda: BrakeConfig(torque_nm=-1.0), "brake torque_nm"),
        (lambda: DriveConfig.reference(sync_period_ms=0), "sync_period_ms"),
        (lambda: DriveConfig.reference(quick_stop_s=0.0), "quick_stop_s"),
    ],
)
def test_bad_values_are_refused_with_their_name(build, where: str):
    """Every wrong value is refused when the configuration is made, and the message names it."""
    with pytest.raises(ConfigurationError, match=where):
        build()


def test_unknown_object_and_unfit_period_are_refused():
    """Objects that the drive does not have, and a servo period that the tuning does not bear, are refused."""
    scheduler = VirtualScheduler()
    medium = CanMedium(scheduler)
    with pytest.raises(ConfigurationError, match="5000h"):
        CiA402Drive(scheduler, medium, DriveConfig(objects={(0x5000, 0): 1}), name="a")
    with pytest.raises(ConfigurationError, match="period_s"):
        CiA402Drive(
            scheduler, medium, DriveConfig(tuning=ServoTuning(velocity_time_constant_ms=0.5)), name="b"
        )


def test_objects_of_the_configuration_become_defaults(make_bench):
    """Configured objects, encoder resolution and ratings are what the bus shows, and what "load" restores."""
    config = DriveConfig.reference().with_objects({(0x6083, 0): 123_000})
    bench = make_bench(config)
    assert bench.read(0x6083) == 123_000
    assert bench.read(0x608F, 1) == 131072
    assert (bench.read(0x6075), bench.read(0x6076)) == (5000, 2000)
    other = make_bench(
        DriveConfig(
            encoder=EncoderConfig(counts_per_revolution=4096),
            rated_torque_nm=1.5,
            rated_current_A=3.2,
            node_id=1,
        )
    )
    assert (other.read(0x608F, 1), other.read(0x6076), other.read(0x6075)) == (4096, 1500, 3200)


def test_rotary_axis_works_too(make_bench):
    """A rotary machine turns in profile velocity mode, and the trace names radians."""
    config = DriveConfig(mechanics=RotaryAxisConfig(gear_ratio=4.0))
    bench = make_bench(config)
    assert bench.drive.trace_columns[0] == ("position", "rad")
    bench.write(0x60FF, 600)
    bench.enable(3)
    bench.run(0.3)
    assert bench.drive.mechanics.velocity == pytest.approx(600 * 2 * math.pi / 60 / 4.0, rel=1e-4)
