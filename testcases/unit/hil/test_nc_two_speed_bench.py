"""Two-speed axes: the axis with its blocks, and the emulated motor at contactors and at an inverter."""

import pytest

from emulators.drive.two_speed import TwoSpeedDrive, TwoSpeedState
from emulators.drive.two_speed_config import CONTACTORS, INVERTER, TwoSpeedConfig, TwoSpeedSettings
from fieldbus.clock import VirtualScheduler
from fieldbus.errors import ConfigurationError
from fieldbus.history import History
from hil.bench import Bench
from hil.bench.bench_file import parse
from motion.nc.blocks import JogMode
from testcases.unit.motion_nc.nc_rig import Plant, Rig, T

pytestmark = pytest.mark.exhaustive

_BENCH = """
[bench]
name = "hoist"
kind = "virtual"
cycle_ms = 2
[segment.net0]
kind = "modbus_tcp"
[station.io]
segment = "net0"
digital_outputs = [{outputs}]
counters = ["hoist.encoder"]
[drive.hoist]
profile = "two_speed"
segment = "net0"
{drive}
[drive.hoist.two_speed]
control = "{control}"
fast_rpm = 600.0
slow_rpm = 60.0
[axis.x]
controller = "nc"
drive = "hoist"
[axis.x.parameters]
{parameters}
"""
_VALUES = {
    "creep_distance_pos": 30.0,
    "creep_distance_neg": 30.0,
    "braking_distance_pos": 2.0,
    "braking_distance_neg": 2.0,
    "brake_delay_pos": 0.2,
    "brake_delay_neg": 0.2,
    "delay_fast_to_slow": 0.1,
    "creep_distance_stop": 5.0,
    "brake_release_delay": 0.1,
}


def _bench(control="contactors", drive="", outputs=None, **values):
    names = outputs or {"contactors": CONTACTORS, "inverter": INVERTER}[control]
    lines = "\n".join(f'"drv.{key}" = {str(value).lower()}' for key, value in {**_VALUES, **values}.items())
    text = _BENCH.format(
        outputs=", ".join(f'"hoist.{name}"' for name in names), drive=drive, control=control, parameters=lines
    )
    return Bench(parse(text, "bench.toml"))


@pytest.mark.requirement("NC-061", "NC-609", "NC-758")
def test_both_kinds_of_wiring(subtests):
    """A motor at contactors (byte 8) and an inverter (byte 9) make the same motion: fast, slow, brake,
    and stand near the target.
    """
    paths = []
    for control in ("contactors", "inverter"):
        with subtests.test(control), _bench(control) as bench:
            x = bench.axis("x")
            bench.wait_until(x.power().status, 1.0)
            move = x.move_absolute(100.0, Velocity=100.0)
            states, path, found = [], [], []
            motor = bench.drive("hoist")
            while not move.ended():
                bench.run_for(0.002)
                path.append(round(x.position, 4))
                for values, value in ((states, x.ref.NcToPlc.AxisState), (found, motor.state)):
                    if not values or values[-1] != value:
                        values.append(value)
            assert move.Done
            assert states == [0, 21, 22, 23, 24, 0]
            assert found[:2] == [TwoSpeedState.BRAKED, TwoSpeedState.COASTING]
            assert TwoSpeedState.FAST in found
            assert found.index(TwoSpeedState.FAST) < found.index(TwoSpeedState.SLOW)
            bench.run_for(0.5)
            assert motor.state is TwoSpeedState.BRAKED
            assert x.position == pytest.approx(100.0, abs=6.0)
            at = x.position
            bench.run_for(0.5)
            assert x.position == at
            assert motor.illegal == 0
            bench.wait_until(x.move_absolute(0.0, Velocity=100.0).done, 5.0)
            bench.run_for(0.5)
            assert x.position == pytest.approx(0.0, abs=6.0)
            paths.append(path)
    assert paths[0] == paths[1]


@pytest.mark.requirement("NC-672")
def test_looping_over_backlash():
    """With backlash the rest positions from both sides differ by it; with a looping distance they do not."""
    differences = []
    for looping in (False, True):
        rest = []
        drive = "[drive.hoist.mechanics]\nbacklash_mm = 1.0\n"
        with _bench(drive=drive, looping_enable=looping, looping_distance=20.0) as bench:
            x = bench.axis("x")
            bench.wait_until(x.power().status, 1.0)
            load = bench.drive("hoist").mechanics
            for target in (0.0, 60.0, 120.0, 60.0):
                bench.wait_until(x.move_absolute(target, Velocity=40.0).done, 60.0)
                bench.run_for(0.5)
                if target == 60.0:
                    rest.append(load.position * 1000.0)
        differences.append(abs(rest[1] - rest[0]))
    sample = 60.0 / 60.0 * 10.0 * 0.002
    assert differences[0] > 0.8
    assert differences[1] < max(sample, 0.05)


def test_stop_jog_enable_and_fault():
    """A stop creeps and brakes, jog runs until it is released, a lost enable ends the motion with the
    brake, a lost feed enable with a stop.
    """
    with _bench() as bench:
        x = bench.axis("x")
        bench.wait_until(x.power().status, 1.0)
        move = x.move_absolute(500.0, Velocity=100.0)
        bench.run_for(1.0)
        at = x.position
        stop = x.stop()
        bench.wait_until(stop.done, 5.0)
        assert move.CommandAborted
        assert 5.0 < x.position - at < 40.0
        refused = x.move_absolute(5.0, Velocity=100.0)
        bench.run_for(0.01)
        assert refused.ErrorID == 0x42EF
        stop.set(Execute=False)
        bench.run_for(0.01)
        jog = x.jog(JogMode.MC_JOGMODE_STANDARD_SLOW)
        bench.run_for(1.0)
        before = x.position
        bench.run_for(0.5)
        assert x.position - before > 20.0
        jog.set(JogForward=False)
        bench.wait_until(jog.done, 5.0)
        bench.run_for(0.3)
        motor = bench.drive("hoist")
        assert motor.state is TwoSpeedState.BRAKED
        move = x.move_absolute(-500.0, Velocity=100.0)
        bench.run_for(1.0)
        x.power(False)
        bench.run_for(0.1)
        assert move.ErrorID == 0x4356
        assert motor.state is TwoSpeedState.BRAKED
        bench.wait_until(x.reset().done, 1.0)
        bench.wait_until(x.power().status, 1.0)
        move = x.move_velocity(-100.0)
        bench.run_for(1.0)
        x.power(negative=False)
        bench.run_for(2.0)
        assert move.CommandAborted
        assert motor.state is TwoSpeedState.BRAKED


@pytest.mark.requirement("NC-607", "NC-608", "NC-677")
def test_limits_of_a_discrete_axis():
    """No coupling in either direction, no superposed motion or external setpoints; a way not beyond the
    braking distance is done at once; AxisState has the values 0 and 20 to 24.
    """
    two = Rig(axis={"two_speed": True}, drv__braking_distance_pos=5.0, ctrl__type="Two speed controller")
    other = Rig(with_=two)
    two.enabled()
    other.enabled()
    refused = [
        two.handle.gear_in(other.handle),
        other.handle.gear_in(two.handle),
        two.handle.move_superimposed(5.0, 10.0),
        two.handle.external_enable(0.0),
    ]
    two.cycles(2)
    assert [one.ErrorID for one in refused] == [0x4B05] * 4
    move = two.handle.move_absolute(5.0, Velocity=100.0)
    two.cycles(3)
    assert move.Done
    assert two.axis.discrete.image[8] == 0x80
    assert two.status("InTargetPosition") is False
    move = two.handle.move_absolute(5.1, Velocity=100.0)
    two.cycles(3)
    assert move.Busy
    assert two.ref.NcToPlc.AxisState == 21


class _Motor(Plant):
    """A motor that moves with two speeds as byte 8 says."""

    interface = 3

    def __init__(self, scaling):
        super().__init__(scaling)
        self.interface = 3

    def write(self, outputs):
        super().write(outputs)
        byte = outputs.image[8] if outputs.image else 0x80
        speed = {0x41: -200.0, 0x42: -20.0, 0x44: 20.0, 0x48: 200.0}.get(byte, 0.0)
        self.velocity = speed


def test_buffered_commands_and_windows():
    """Buffered commands follow each other, and the windows of the target are watched as with any axis."""
    rig = Rig(
        device=_Motor,
        axis={"two_speed": True},
        ctrl__type="Two speed controller",
        drv__creep_distance_pos=20.0,
        drv__braking_distance_pos=1.0,
    ).enabled()
    first = rig.handle.move_absolute(100.0, Velocity=100.0)
    second = rig.handle.move_absolute(150.0, Velocity=100.0, BufferMode=1)
    rig.until(first.done)
    assert rig.axis.position == pytest.approx(99.0, abs=0.1)
    assert second.Busy
    rig.until(second.done)
    rig.cycles(20)
    assert rig.axis.position == pytest.approx(149.0, abs=0.1)
    assert rig.status("InTargetPosition")
    assert rig.status("NotMoving")
    refused = rig.handle.move_absolute(200.0, Velocity=-5.0)
    rig.cycles(2)
    assert refused.ErrorID == 0x4359


def test_endless_motion_ends_at_the_software_limit():
    """Jog of a discrete axis ends at a monitored software limit: it creeps and brakes in front of it."""
    rig = Rig(
        device=_Motor,
        axis={"two_speed": True},
        ctrl__type="Two speed controller",
        drv__creep_distance_pos=20.0,
        drv__braking_distance_pos=1.0,
        axis__soft_limit_max=60.0,
        axis__soft_limit_max_enable=True,
    ).enabled()
    rig.handle.jog(JogMode.MC_JOGMODE_STANDARD_FAST)
    rig.cycles(2500)
    assert rig.axis.position == pytest.approx(59.0, abs=0.1)
    assert rig.axis.discrete.image[8] == 0x80


# -- the emulated motor alone


def _drive(control="contactors", **settings):
    scheduler = VirtualScheduler()
    history = History(scheduler)
    drive = TwoSpeedDrive(
        scheduler,
        TwoSpeedConfig(two_speed=TwoSpeedSettings(control=control, **settings)),
        name="motor",
        history=history,
    )
    drive.power_on()
    return scheduler, history, drive


def _rpm(drive):
    return drive.mechanics.motor_speed * 30.0 / 3.141592653589793


def test_speeds_and_brake():
    """Two constant speeds with an approach of first order; the brake moves after its delay."""
    scheduler, _, drive = _drive(fast_rpm=1000.0, slow_rpm=100.0, time_constant_s=0.1, brake_delay_ms=50.0)
    assert drive.braked
    drive.set_terminal("brake", False)
    scheduler.run_for(49_000_000)
    assert drive.braked
    scheduler.run_for(2_000_000)
    assert not drive.braked
    drive.set_terminal("plus_high", True)
    scheduler.run_for(100_000_000)
    assert _rpm(drive) == pytest.approx(632.0, rel=0.05)
    scheduler.run_for(1_000_000_000)
    assert _rpm(drive) == pytest.approx(1000.0, rel=0.01)
    drive.set_terminal("plus_high", False)
    drive.set_terminal("minus_low", True)
    scheduler.run_for(1_500_000_000)
    assert _rpm(drive) == pytest.approx(-100.0, rel=0.02)
    drive.set_terminal("minus_low", False)
    drive.set_terminal("brake", True)
    scheduler.run_for(500_000_000)
    assert _rpm(drive) == pytest.approx(0.0, abs=1.0)
    assert drive.state is TwoSpeedState.BRAKED


@pytest.mark.requirement("NC-758")
def test_illegal_terminals(subtests):
    """Two directions or two speeds at once are reported and trip the motor, until all are off."""
    for control, wrong in (
        ("contactors", ("plus_high", "minus_high")),
        ("contactors", ("plus_low", "plus_high")),
        ("inverter", ("direction_plus", "direction_minus")),
        ("inverter", ("velo_low", "velo_high")),
    ):
        with subtests.test(control, wrong=wrong):
            scheduler, history, drive = _drive(control)
            drive.set_terminal("brake", False)
            scheduler.run_for(100_000_000)
            for name in wrong:
                drive.set_terminal(name, True)
            assert drive.illegal == 1
            assert drive.state is TwoSpeedState.FAULT
            events = [one for one in history.events if one.kind == "drive.illegal_terminals"]
            assert all(name in events[0].data["terminals"] for name in wrong)
            scheduler.run_for(2_000_000_000)
            assert _rpm(drive) == pytest.approx(0.0, abs=1.0)
            for name in wrong:
                drive.set_terminal(name, False)
            assert drive.state is TwoSpeedState.COASTING
    drive = _drive()[2]
    with pytest.raises(ConfigurationError, match="plus_high"):
        drive.set_terminal("plus_fast", True)
    with pytest.raises(ConfigurationError, match="below fast_rpm"):
        TwoSpeedSettings(slow_rpm=2000.0)


def test_mistakes_of_the_file(subtests):
    """A missing wire, an unknown terminal and a technology object on it are mistakes of the file."""
    for outputs, words in (
        (("plus_low", "plus_high", "minus_low", "brake"), "minus_high"),
        ((*CONTACTORS[:4], "break"), "no terminal"),
    ):
        with subtests.test(words), pytest.raises(ConfigurationError, match=words):
            _bench(outputs=outputs)
    text = _BENCH.format(
        outputs=", ".join(f'"hoist.{name}"' for name in CONTACTORS),
        drive="",
        control="contactors",
        parameters="",
    )
    with pytest.raises(ConfigurationError, match="two speeds"):
        Bench(parse(text[: text.index("[axis.x]")] + '[axis.x]\ndrive = "hoist"\n', "bench.toml"))
    assert T == 0.002
