"""An NC axis on a bench, on emulated drives of both profiles."""

from itertools import pairwise

import numpy as np
import pytest

from fieldbus.errors import ConfigurationError
from fieldbus.profidrive.words import ZSW2
from hil.bench import Bench, load_bench
from hil.bench.bench_file import parse
from hil.bench.makes import with_nc_axes
from hil.bench.units import variables_in_units
from hil.campaign import load_bench_file
from hil.expect._words import has_torque
from hil.faults import Injector

pytestmark = pytest.mark.exhaustive

_BENCH = """
[bench]
name = "feeder"
kind = "virtual"
cycle_ms = 2

[segment.can0]
bitrate = 1_000_000

[drive.motor]
segment = "can0"
node_id = 5
{drive}

[axis.x]
controller = "nc"
drive = "motor"

[axis.x.parameters]
"ctrl.pos_kv" = 20.0
"""
_PROFILES = {"cia402": "", "profidrive": 'profile = "profidrive"\ntelegram = 3'}


def _bench(profile="cia402"):
    return Bench(parse(_BENCH.format(drive=_PROFILES[profile]), "bench.toml"))


@pytest.mark.parametrize("profile", _PROFILES)
def test_a_move(profile):
    """The axis moves the shaft of an emulated drive, and its faults reach the axis; reset and enable bring
    it back.
    """
    with _bench(profile) as bench:
        x = bench.axis("x")
        bench.wait_until(x.power().status, 1.0)
        move = x.move_absolute(200.0, Velocity=200.0)
        bench.wait_until(move.done, 3.0)
        bench.run_for(0.5)
        trace = bench.trace()
        assert x.position == pytest.approx(200.0, abs=0.01)
        assert max(abs(trace["x.following_error"].values)) < 1.0
        assert max(trace["x.set_velocity"].values) == pytest.approx(200.0)
        move = x.move_velocity(-50.0)
        bench.wait_until(move.in_velocity, 2.0)
        bench.drive("motor").raise_fault(0x2310)
        bench.run_for(0.1)
        assert x.error_id == 0x4650
        assert move.ErrorID == 0x4650
        bench.run_for(0.5)
        bench.wait_until(x.reset().done, 1.0)
        bench.wait_until(lambda: x.operational, 1.0)
        move = x.move_absolute(50.0, Velocity=100.0)
        bench.wait_until(move.done, 3.0)


@pytest.mark.requirement("NC-427")
@pytest.mark.parametrize("profile", _PROFILES)
def test_data_invalid_for_some_cycles(profile):
    """Invalid data are borne for three cycles behind the grace of the port: the drive stays enabled and the
    motion goes on; one cycle more is an error.
    """
    for cycles, error_id in ((5, 0), (6, 0x4655)):
        with _bench(profile) as bench:
            x = bench.axis("x")
            bench.wait_until(x.power().status, 1.0)
            bench.wait_until(x.move_velocity(50.0).in_velocity, 2.0)
            Injector(bench).inject("frame.drop", "can0", message="tpdo1", count=cycles)
            bench.run_for(0.1)
            assert x.error_id == error_id
            speeds = bench.trace()["motor.velocity"].values[-40:]
            assert (min(speeds) > 0.045) == (error_id == 0)


def test_both_controllers():
    """An NC axis and a technology object stand on one bench; `bench.axis()` returns each with its own
    blocks.
    """
    text = (
        _BENCH.format(drive="")
        + '\n[drive.other]\nsegment = "can0"\nnode_id = 6\n[axis.z]\ndrive = "other"\n'
    )
    with Bench(parse(text, "bench.toml")) as bench:
        assert bench.axis() is bench.axis("x") is bench.axis("x", controller="nc")
        bench.axis("z").power()
        bench.wait_until(bench.axis("x").power().status, 1.0)
        move = bench.axis("x").move_relative(5.0, Velocity=50.0)
        bench.wait_until(move.done, 2.0)
        assert "x operational" in bench.summary()
        assert "z " in bench.summary()
        with pytest.raises(ConfigurationError, match="z"):
            bench.axis("z", controller="nc")


def test_mistakes_of_the_file():
    """A wrong parameter is reported with its key, its value and what is allowed."""
    for line, words in (
        ('"ctrl.pos_kw" = 1.0', "ctrl.pos_kv"),
        ('"ctrl.pos_kv" = -1.0', "0 or more"),
        ('"enc.encoder_mode" = "VELO"', "POSVELOACC"),
        ('"axis.maximum_velocity" = 5000.0', "axis.maximum_velocity"),
    ):
        with pytest.raises(ConfigurationError, match=words):
            Bench(parse(_BENCH.format(drive="").replace('"ctrl.pos_kv" = 20.0', line), "bench.toml"))


def test_a_technology_object_in_other_units():
    """What an NC axis takes over from a technology object that counts in m/s, or in inches, is the
    same machine in mm and s; a rotary one counts in degrees.
    """
    reference = load_bench("reference")
    wanted = with_nc_axes(reference, "reference").config.nc_axes["axis1"]
    axis = reference.config.s7_axes["axis1"]
    for units in ((1013, 1061), (1019, 1066)):
        told = reference.configured({"axis": {"axis1": {"variables": variables_in_units(axis, *units)}}})
        found = with_nc_axes(told, "told").config.nc_axes["axis1"]
        assert found.feed == pytest.approx(10.0)
        for key, value in wanted.parameters.items():
            assert found.parameters[key] == pytest.approx(value, rel=1e-6), (units, key)
    turned = reference.configured({"axis": {"axis1": {"variables": {"Units.LengthUnit": 1005}}}})
    assert with_nc_axes(turned, "turned").config.nc_axes["axis1"].parameters["axis.unit"] == "deg"


def _first(signal, since, holds):
    """Return the time from `since` to the first sample behind it for which something holds, s."""
    return next(
        float(time) - since
        for time, value in zip(signal.time_s, signal.values, strict=True)
        if time > since and holds(value)
    )


@pytest.mark.requirement("NC-039")
@pytest.mark.parametrize("profile", _PROFILES)
def test_a_drive_that_loses_its_setpoints_stops_by_itself(profile):
    """Without setpoints, in whatever state the NC is, the drive brakes on its own ramp, closes its brake, and
    only then gives its torque away; its velocity is never cut off.
    """
    brake = {"torque_nm": 5.0, "opening_time_ms": 30.0, "closing_time_ms": 40.0}
    reference = load_bench_file("nc-axes:reference" if profile == "cia402" else "nc-axes:profidrive")
    with reference.configured({"drive": {"drive1": {"brake": brake}}}).build(seed=0) as bench:
        axis = bench.axis(controller="nc")
        bench.wait_until(axis.power().status, 2.0, "enable")
        moving = axis.move_velocity(200.0, Acceleration=2000.0, Jerk=1e6)
        bench.wait_until(moving.in_velocity, 2.0, "velocity")
        bench.run_for(0.1)
        begun = bench.now_s
        Injector(bench).inject("frame.drop", "can0", message="rpdo1")
        bench.run_for(0.5)
        trace = bench.trace()
    speed = trace["drive1.velocity"]
    behind = [
        (float(time) - begun, float(value))
        for time, value in zip(speed.time_s, speed.values, strict=True)
        if time >= begun + 0.01
    ]
    step_s = behind[1][0] - behind[0][0]
    steepest = max((a[1] - b[1]) / step_s for a, b in pairwise(behind))
    assert 0.9 <= steepest <= 1.6  # m/s2, the ramps of the drives; 0.2 m/s at once would be 50
    stands = next(time for time, value in behind if abs(value) < 1e-3)
    assert 0.15 < stands < 0.35
    closed = _first(trace["drive1.brake_closed"], begun, bool)
    assert stands - 0.03 <= closed
    # The axis hangs on the motor until the brake holds it.
    if profile == "cia402":
        off = _first(trace["drive1.statusword"], begun, lambda word: not has_torque(np.array([int(word)]))[0])
    else:
        off = _first(trace["drive1.drive_zsw2"], begun, lambda word: not int(word) & ZSW2.PULSES_ENABLED)
    assert stands <= off
    assert closed <= off + 0.005
    assert axis.error_id in {0x4650, 0x4651}


@pytest.mark.requirement("PD-111")
def test_on_while_the_brake_closes_opens_it_again():
    """OFF1 that is taken back while the brake closes: a PROFIdrive drive goes on operating, and releases its
    brake.
    """
    brake = {"torque_nm": 5.0, "opening_time_ms": 20.0, "closing_time_ms": 200.0}
    reference = load_bench_file("nc-axes:profidrive")
    with reference.configured({"drive": {"drive1": {"brake": brake}}}).build(seed=0) as bench:
        axis = bench.axis(controller="nc")
        bench.wait_until(axis.power().status, 2.0, "enable")
        axis.power(False)
        bench.run_for(0.1)
        assert bench.drive("drive1").core.enabled
        bench.wait_until(axis.power().status, 0.05, "operation goes on")
        move = axis.move_relative(20.0, Velocity=200.0)
        bench.wait_until(move.done, 2.0, "the brake is open")
        axis.power(False)
        bench.run_for(0.4)
        assert not bench.drive("drive1").core.enabled
        assert bench.trace()["drive1.brake_closed"].values[-1] == 1.0
