"""Several encoders and a backlash between motor and load, on a bench: the scale measures the load behind the
play.
"""

from __future__ import annotations

import pytest

from hil.bench.bench import Bench
from hil.bench.bench_file import BenchFileError, parse, read
from hil.faults import Injector

pytestmark = pytest.mark.exhaustive

SIZE = 0.2
SCALE = f"""
[encoder.scale]
segment = "can0"
node_id = 20
type = "incremental_linear"
measuring_step_um = 1.0
on = "drive1"
mounting = "load"
backlash_mm = {SIZE}
"""
SHAFT = """
[encoder.shaft]
segment = "can0"
node_id = 21
type = "multi_turn"
steps_per_revolution = 65536
on = "drive1"
mounting = "motor"
"""


def machine(encoders, extra, **variables):
    settings = {"PositioningMonitoring.Window": 0.01, "FollowingError.MinValue": 5.0} | variables
    lines = [
        line
        for line in read("reference")[1].splitlines()
        if line.partition(" ")[0].strip('"') not in settings
    ]
    text = "\n".join(lines).replace('drive = "drive1"', f'drive = "drive1"\nencoders = {encoders}', 1)
    for path, value in settings.items():
        text += f'\n"{path}" = {str(value).lower()}'
    return Bench(parse(text + "\n" + extra, "bench.toml"), seed=1)


def enabled(bench):
    axis = bench.axis()
    power = axis.power()
    assert bench.run_until(power.status, 2.0)
    assert bench.run_until(axis.home(0.0).done, 1.0)
    return axis


def move(bench, distance):
    bench.axis().move_relative(distance, Velocity=50.0)
    bench.run_for(0.2 + abs(distance) / 50.0 + 0.4)


def cycles(bench, seconds):
    """Let cycle after cycle pass."""
    for _ in range(round(seconds * 1e9 / bench.cycle_ns)):
        bench.run_for(bench.cycle_ns / 1e9)
        yield


def shown(axis, number):
    return axis.var(f"StatusSensor[{number}].Position")


def motor(bench):
    """Return the place of the motor, mm of the axis."""
    return bench.drive().mechanics.position * 1000.0


def compensated(number):
    return {f"Sensor[{number}].Backlash.Enable": True, f"Sensor[{number}].Backlash.Size": SIZE}


@pytest.mark.requirement("CFG-545", "CFG-558")
def test_load_encoder_in_control():
    """Position control drives the motor through the play: the load is right after a reversal, without any
    compensation.
    """
    with machine('["scale"]', SCALE) as bench:
        axis = enabled(bench)
        move(bench, 10.0)
        before = motor(bench)
        axis.move_relative(-10.0, Velocity=50.0)
        ways = [(before - motor(bench), axis.var("ActualPosition")) for _ in cycles(bench, 0.8)]
        bench.run_for(0.5)
        assert axis.var("ActualPosition") == pytest.approx(0.0, abs=0.01)
        # The motor stands somewhere in the play, before and after; it has to pass what is left of it.
        assert 10.0 < before - motor(bench) <= 10.0 + SIZE + 0.01
        still = [way for way, position in ways if position > 9.995]
        assert max(still) > 0.02  # the load stands while the motor passes the play
        assert not axis.var("StatusWord2.X2")


@pytest.mark.requirement("CFG-546", "CFG-318")
def test_each_encoder_for_itself():
    """Two encoders on the motor, the compensation of one of them is active: the other one shows the motor as
    it is.
    """
    with machine('["drive1", "shaft"]', SHAFT, **compensated(1)) as bench:
        axis = enabled(bench)
        move(bench, 10.0)
        apart = shown(axis, 2) - shown(axis, 1)
        move(bench, -10.0)
        assert shown(axis, 1) - shown(axis, 2) + apart == pytest.approx(SIZE, abs=0.01)
        move(bench, 10.0)
        assert shown(axis, 2) - shown(axis, 1) == pytest.approx(apart, abs=0.01)


class TestMotorAndScale:
    """The motor encoder with its compensation, and the scale behind the play."""

    @pytest.fixture
    def bench(self):
        with machine('["drive1", "scale"]', SCALE, **compensated(1)) as bench:
            enabled(bench)
            for distance in (5.0, -5.0):
                move(bench, distance)
            assert bench.run_until(bench.axis().set_sensor(2, mode=2).done, 1.0)
            yield bench

    @pytest.mark.requirement("CFG-570")
    def test_motor_encoder_follows_the_scale(self, bench):
        """While the scale is in control the position of the motor encoder is that of the load, in every cycle
        of a reversal.
        """
        axis = bench.axis()
        assert bench.run_until(axis.set_sensor(2, mode=1).done, 1.0)
        bench.run_for(0.5)
        assert bench.run_until(axis.set_sensor(1, mode=2).done, 1.0)
        for distance in (10.0, -10.0):
            axis.move_relative(distance, Velocity=50.0)
            for _ in cycles(bench, 0.8):
                # The scale is read one cycle apart from the motor encoder: 0.2 mm at 50 mm/s.
                assert abs(shown(axis, 1) - shown(axis, 2)) < 0.25
                assert not axis.var("StatusWord2.X2")
            bench.run_for(0.5)
            assert shown(axis, 1) == pytest.approx(shown(axis, 2), abs=0.01)

    @pytest.mark.requirement("CFG-571", "CFG-321", "CFG-573")
    def test_from_scale_to_motor(self, bench):
        """Mode 0 back to the motor encoder: after the play has been passed once both agree, and the axis
        stays homed.
        """
        axis = bench.axis()
        assert bench.run_until(axis.set_sensor(2, mode=0).done, 1.0)
        move(bench, 10.0)
        assert bench.run_until(axis.set_sensor(1, mode=0).done, 1.0)
        assert axis.var("StatusWord.X5")
        for distance in (-10.0, 6.0, -3.0):
            move(bench, distance)
            assert axis.var("StatusWord.X5")
            assert shown(axis, 1) == pytest.approx(shown(axis, 2), abs=0.02)

    @pytest.mark.requirement("CFG-573")
    def test_from_motor_to_scale(self, bench):
        """Mode 0 to the scale while the motor has only begun to pass the play: up to the size apart, and
        equal afterwards.
        """
        axis = bench.axis()
        move(bench, 10.0)
        job = axis.move_relative(-5.0, Velocity=1.0)
        assert bench.run_until(lambda: axis.var("StatusWord2.X2"), 1.0)
        bench.run_for(0.02)
        assert axis.var("StatusWord2.X2")
        assert abs(shown(axis, 1) - shown(axis, 2)) <= SIZE + 0.02
        assert bench.run_until(axis.set_sensor(2, mode=0).done, 1.0)
        assert bench.run_until(job.ended, 10.0)
        for distance in (-4.0, 4.0):
            move(bench, distance)
        before = shown(axis, 1) - shown(axis, 2)
        assert abs(before) <= SIZE + 0.02
        move(bench, -7.0)
        assert shown(axis, 1) - shown(axis, 2) == pytest.approx(before, abs=0.02)


# -- play of the machine
# -------------------------------------------------------------------------------------------------

RIGID_SCALE = SCALE.replace(f"backlash_mm = {SIZE}\n", "")


def worn(encoders, play_mm, **variables):
    """Return a bench whose machine, not its encoder, has play."""
    extra = RIGID_SCALE + f"\n[drive.drive1.mechanics]\nbacklash_mm = {play_mm}\n"
    return machine(encoders, extra, **variables)


def load(bench):
    """Return the place of the load by the true mechanics, mm."""
    return bench.drive().mechanics.position * 1000.0


def alarms(bench):
    """Return the numbers of all alarms."""
    return [entry.data["number"] for entry in bench.history.events if entry.kind == "alarm.raised"]


@pytest.mark.requirement("CFG-545", "CFG-558")
def test_the_motor_encoder_knows_nothing_of_the_play_of_the_machine():
    """The axis moves by what was commanded, the load by less after each reversal, and nothing is alarmed."""
    with worn('["drive1"]', 0.5) as bench:
        axis = enabled(bench)
        for distance, missed in ((10.0, None), (-10.0, 0.5), (-5.0, 0.0), (5.0, 0.5)):
            before, shown = load(bench), axis.var("ActualPosition")
            axis.move_relative(distance, Velocity=50.0, Deceleration=400.0)
            bench.run_for(0.8)
            assert axis.var("ActualPosition") - shown == pytest.approx(distance, abs=0.02)
            if missed is not None:
                assert abs(load(bench) - before) == pytest.approx(abs(distance) - missed, abs=0.05)
        assert alarms(bench) == []


@pytest.mark.requirement("CFG-546", "CFG-558")
def test_compensation_takes_the_play_of_the_machine_back():
    """With the size of the real play as compensation, the load is where the axis is in either direction."""
    play = {"Sensor[1].Backlash.Enable": True, "Sensor[1].Backlash.Size": 0.5}
    with worn('["drive1"]', 0.5, **play) as bench:
        axis = enabled(bench)
        ways = []
        for distance in (10.0, -10.0, 10.0):
            before = load(bench)
            axis.move_relative(distance, Velocity=50.0, Deceleration=400.0)
            bench.run_for(0.8)
            ways.append(load(bench) - before)
        assert ways[1:] == pytest.approx([-10.0, 10.0], abs=0.06)


@pytest.mark.requirement("MON-038", "MON-040")
@pytest.mark.parametrize(("play", "alarm"), [(0.2, 0), (6.0, 521)])
def test_an_encoder_at_the_load_sees_play_grow(play, alarm):
    """At a reversal the load stands until the motor has passed the play: a following error, which is beyond
    what is permitted if it is long.
    """
    with machine(
        '["scale"]', RIGID_SCALE, **{"FollowingError.MinValue": 2.0, "FollowingError.MaxValue": 2.0}
    ) as bench:
        axis = enabled(bench)
        move(bench, 10.0)
        assert alarms(bench) == []
        Injector(bench).inject("mechanics.backlash", backlash_mm=play, growth_s=0.1)
        bench.run_for(0.2)
        assert bench.drive().mechanics.backlash == pytest.approx(play / 1000.0)
        axis.move_relative(-20.0, Velocity=100.0)
        largest = max(abs(axis.var("StatusPositioning.FollowingError")) for _ in cycles(bench, 0.6))
        assert (alarm in alarms(bench)) is bool(alarm)
        assert (largest > 2.0) is bool(alarm)


@pytest.mark.requirement("MON-018")
def test_play_can_keep_a_position_from_being_reached():
    """The motor hunts for a load in a wide play that comes to rest on no flank: the window is not reached in
    time, alarm 541.
    """
    window = {
        "PositioningMonitoring.Window": 0.005,
        "PositioningMonitoring.ToleranceTime": 0.3,
        "FollowingError.MinValue": 50.0,
    }
    with machine('["scale"]', RIGID_SCALE, **window, **{"FollowingError.MaxValue": 50.0}) as bench:
        axis = enabled(bench)
        move(bench, 10.0)
        assert alarms(bench) == []
        Injector(bench).inject("mechanics.backlash", backlash_mm=10.0)
        axis.move_relative(-20.0, Velocity=100.0)
        bench.run_for(2.0)
        reported = [
            entry.data
            for entry in bench.history.events
            if entry.kind == "alarm.raised" and entry.data["number"] == 541
        ]
        assert [data["info"] for data in reported] == [1]


def test_a_stepper_motor_has_no_play():
    """The bench file says so, instead of ignoring it."""
    text = read("stepper")[1].replace("load_mass_kg = 5.0", "load_mass_kg = 5.0\nbacklash_mm = 0.1")
    with pytest.raises(BenchFileError, match=r"mechanics\.backlash_mm: 0\.1 is not allowed; allowed: 0"):
        parse(text, "bench.toml")
