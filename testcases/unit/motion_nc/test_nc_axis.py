"""An NC axis by its blocks: enables, moves, override, stop, limits, monitoring, on an ideal plant."""

import pytest

from fieldbus.errors import ConfigurationError, UnknownNameError
from motion.nc.blocks import JogMode
from motion.nc.commands import BufferMode
from motion.nc.interface import FULL_OVERRIDE
from testcases.unit.motion_nc.nc_rig import Rig, T

pytestmark = pytest.mark.exhaustive


def _limit(rig, key, value):
    rig.handle.write_parameter(f"axis.{key}", value)


@pytest.mark.requirement("NC-062", "NC-063")
def test_simulation_axis():
    """A simulation axis is operational without hardware; its encoder repeats the set position of the cycle
    before.
    """
    rig = Rig(simulated=True).enabled()
    move = rig.handle.move_velocity(100.0)
    rig.until(move.in_velocity)
    before = rig.generator.s
    rig.cycles()
    assert rig.axis.position == pytest.approx(before, abs=1e-4)
    assert rig.axis.following_error == pytest.approx(100.0 * T, abs=1e-4)


@pytest.mark.requirement("NC-064")
def test_simulated_lag():
    """An offset of the simulation encoder raises the lag error as a real one would."""
    rig = Rig(simulated=True).enabled()
    rig.device.offset = 5.1
    rig.cycles(30)
    assert rig.handle.error_id == 0x4550


@pytest.mark.requirement("NC-258")
def test_simulation_noise():
    """Noise moves the actual position within its level; without a level it stands."""
    values = iter([0.5, -1.0, 1.0, 0.25] * 100)
    rig = Rig(simulated=True, noise=lambda: next(values)).enabled()
    positions = set()
    for level in (0.0, 0.01):
        rig.handle.write_parameter("enc.simulation_noise", level)
        rig.cycles()
        positions.clear()
        for _ in range(8):
            rig.cycles()
            positions.add(round(rig.axis.position, 6))
        assert positions == ({0.0} if level == 0.0 else {0.005, -0.01, 0.01, 0.0025})


@pytest.mark.requirement("NC-723")
def test_power():
    """Status and Active follow the axis, not the input; only an enabled axis accepts a motion command."""
    rig = Rig()
    refused = rig.handle.move_absolute(10.0, Velocity=10.0)
    rig.cycles(2)
    assert refused.Error
    assert refused.ErrorID == 0x4356
    rig.device.fault = True
    power = rig.handle.power()
    rig.cycles(5)
    assert not power.Status
    assert not power.Active
    rig.device.fault = False
    rig.handle.reset()
    rig.until(power.status, 0.1)
    assert power.Active
    assert rig.ref.PlcToNc.ControlDWord == 0x7
    assert rig.ref.PlcToNc.Override == 1_000_000
    move = rig.handle.move_absolute(10.0, Velocity=10.0)
    rig.until(move.done)
    assert rig.axis.position == pytest.approx(10.0, abs=0.01)


@pytest.mark.requirement("NC-083", "NC-092", "NC-736")
def test_velocity_limit():
    """A velocity above Maximum Velocity, or not above 0, is refused and nothing moves; the maximum itself
    is taken.
    """
    rig = Rig().enabled()
    for velocity in (2000.1, 0.0, -1.0):
        refused = rig.handle.move_absolute(100.0, Velocity=velocity)
        rig.cycles(3)
        assert refused.ErrorID == 0x4359
        assert rig.generator.s == 0.0
    move = rig.handle.move_absolute(100.0, Velocity=2000.0)
    rig.until(move.done)


@pytest.mark.requirement("NC-084", "NC-085", "NC-086", "NC-087", "NC-088", "NC-091", "NC-093")
def test_dynamics(subtests):
    """0.0 or nothing is the default; values above the maxima are used without a check."""
    steep = {"Jerk": 1e6}
    for given, expected in (
        (steep, (1500.0, 1200.0, 1e6)),
        ({"Acceleration": 0.0, "Deceleration": 0.0, **steep}, (1500.0, 1200.0, 1e6)),
        ({"Acceleration": 20000.0, "Deceleration": 18000.0, **steep}, (20000.0, 18000.0, 1e6)),
        ({"Acceleration": 20000.0, "Deceleration": 20000.0}, (None, None, 2250.0)),
        ({"Acceleration": 20000.0, "Deceleration": 20000.0, "Jerk": 0.0}, (None, None, 2250.0)),
    ):
        with subtests.test(given=given):
            rig = Rig(axis__default_deceleration=1200.0).enabled()
            move = rig.handle.move_absolute(1900.0, Velocity=1000.0, **given)
            highest = lowest = jerk = last = 0.0
            while not move.done():
                rig.cycles()
                a = rig.generator.a
                highest, lowest = max(highest, a), min(lowest, a)
                jerk, last = max(jerk, abs(a - last) / T), a
            assert not move.Error
            acceleration, deceleration, most = expected
            if acceleration is not None:
                assert highest == pytest.approx(acceleration, rel=1e-6)
                assert lowest == pytest.approx(-deceleration, rel=1e-6)
            else:
                assert jerk == pytest.approx(most, rel=1e-3)
            assert jerk <= most * 1.001


@pytest.mark.requirement("NC-124", "NC-125", "NC-126", "NC-127", "NC-129", "NC-743")
def test_software_limits_at_start(subtests):
    """A target beyond a monitored limit is refused with its code; the limit itself, and any without
    monitoring, is not.
    """
    for side, sign, code in (("min", -1.0, 0x4460), ("max", 1.0, 0x4461)):
        with subtests.test(side):
            rig = Rig().enabled()
            _limit(rig, f"soft_limit_{side}", sign * 5.0)
            move = rig.handle.move_absolute(sign * 6.0, Velocity=50.0)
            rig.until(move.done)
            rig.until(rig.handle.move_absolute(0.0, Velocity=50.0).done)
            _limit(rig, f"soft_limit_{side}_enable", True)
            at = rig.generator.s
            refused = rig.handle.move_absolute(sign * 5.001, Velocity=50.0)
            rig.cycles(5)
            assert refused.ErrorID == code
            assert rig.generator.s == at
            assert not rig.axis.error
            move = rig.handle.move_absolute(sign * 5.0, Velocity=50.0)
            rig.until(move.done)


@pytest.mark.requirement("NC-130", "NC-131")
@pytest.mark.parametrize(("end", "sign", "at_start"), [("max", 1, 0x4461), ("min", -1, 0x4460)])
def test_endless_motion_stops_at_the_limit(end, sign, at_start):
    """Endless and jog motion stand at the limit; its bit is shown there; the way back is accepted, from
    beyond too.
    """
    limit, exceeded = f"axis.soft_limit_{end}", f"SoftLimit{end.capitalize()}Exceeded"
    for start in ("move_velocity", "jog"):
        rig = Rig(**{limit.replace(".", "__"): sign * 50.0, f"axis__soft_limit_{end}_enable": True}).enabled()
        if start == "jog":
            rig.handle.jog(JogMode.MC_JOGMODE_STANDARD_FAST, backwards=sign < 0)
        else:
            rig.handle.move_velocity(sign * 300.0)
        farthest = 0.0
        for _ in range(600):
            rig.cycles()
            farthest = max(farthest, sign * rig.generator.s)
        assert farthest == pytest.approx(50.0)
        assert farthest <= 50.0 + 1e-9
        rig.handle.write_parameter(limit, sign * 49.99)
        rig.cycles()
        assert rig.status(exceeded)
        assert not rig.axis.error
        refused = rig.handle.move_velocity(sign * 10.0)
        rig.cycles(2)
        assert refused.ErrorID == at_start
        back = rig.handle.move_absolute(sign * 20.0, Velocity=100.0)
        rig.until(back.done)
        assert not rig.status(exceeded)


@pytest.mark.requirement("NC-734", "NC-735", "NC-028", "NC-029")
def test_feed_enables(subtests):
    """Without the feed enable of a direction a command is refused, and a motion in it stops on its ramp."""
    for sign, code in ((1.0, 0x4358), (-1.0, 0x4357)):
        with subtests.test(sign=sign):
            rig = Rig().enabled()
            other = {"positive": sign < 0.0, "negative": sign > 0.0}
            move = rig.handle.move_relative(sign * 1000.0, Velocity=200.0, Deceleration=2000.0, Jerk=1e6)
            rig.handle.move_relative(
                sign * 1000.0, Velocity=100.0, Deceleration=500.0, BufferMode=BufferMode.Buffered
            )
            rig.cycles(200)
            assert abs(rig.generator.v) == pytest.approx(200.0)
            rig.handle.power(**other)
            at = rig.generator.s
            rig.cycles(2)
            steepest = 0.0
            while not rig.status("NotMoving"):
                rig.cycles()
                steepest = max(steepest, abs(rig.generator.a))
            assert steepest == pytest.approx(2000.0, rel=1e-3)
            assert abs(rig.generator.s - at) < 200.0**2 / 2 / 2000.0 + 200.0 * 0.01
            assert move.CommandAborted
            refused = rig.handle.move_relative(sign * 10.0, Velocity=10.0)
            rig.cycles(2)
            assert refused.ErrorID == code
            back = rig.handle.move_relative(-sign * 10.0, Velocity=100.0)
            rig.until(back.done)
            assert not rig.axis.error


def test_a_stop_without_enable_is_done():
    """MC_Stop is accepted by an axis that stands without enables, and locks it; MC_Halt is done there too."""
    rig = Rig()
    rig.cycles(3)
    halt = rig.handle.halt()
    rig.until(halt.done, 0.1)
    stop = rig.handle.stop()
    rig.until(stop.done, 0.1)
    rig.enabled()
    refused = rig.handle.move_relative(1.0, Velocity=10.0)
    rig.cycles(2)
    assert refused.ErrorID == 0x42EF
    stop.set(Execute=False)
    rig.cycles(2)
    rig.until(rig.handle.move_relative(1.0, Velocity=10.0).done)


def test_inputs_that_are_no_numbers(subtests):
    """An input that is infinite or no number is refused by its block, without an effect on the axis; an
    override that is none counts as 0.
    """
    rig = Rig(simulated=True).enabled()
    x = rig.handle
    for number in (float("nan"), float("inf"), float("-inf")):
        for start in (
            lambda value: x.move_absolute(value, Velocity=10.0),
            lambda value: x.move_relative(1.0, Velocity=value),
            lambda value: x.move_velocity(10.0, Jerk=value),
            lambda value: x.move_continuous_absolute(50.0, value, Velocity=10.0),
            lambda value: x.jog(JogMode.MC_JOGMODE_CONTINOUS, Velocity=value),
            lambda value: x.jog(JogMode.MC_JOGMODE_INCHING, Position=value, Velocity=10.0),
            x.set_position,
            x.home,
            x.external_enable,
            lambda value: x.move_superimposed(value, 10.0),
        ):
            block = start(number)
            with subtests.test(block=block.block, number=number):
                rig.cycles(2)
                assert (block.Error, block.ErrorID) == (True, 0x4B06)
                assert (rig.axis.motion.s, rig.axis.error, rig.axis.motion.active) == (0.0, False, None)
    x.power(override=float("nan"))
    rig.cycles(3)
    assert rig.axis.motion.override == 0.0
    negative = x.jog(JogMode.MC_JOGMODE_CONTINOUS, Velocity=10.0, Deceleration=-1.0)
    rig.cycles(2)
    assert negative.ErrorID == 0x4B06


@pytest.mark.requirement("NC-166", "NC-168", "NC-169")
def test_override_types(subtests):
    """Reduced scales the peak of the profile, Original the commanded velocity."""
    dynamics = {"Acceleration": 1000.0, "Deceleration": 1000.0, "Jerk": 1e7}
    way = 490.0  # whose peak is 700 mm/s
    for kind, table in (
        ("Reduced (iterated)", {100: 700, 80: 560, 50: 350, 10: 70}),
        ("Original (iterated)", {100: 700, 80: 700, 70: 700, 50: 500}),
    ):
        for override, expected in table.items():
            with subtests.test(kind=kind, override=override):
                rig = Rig(axis__velocity_override_type=kind).enabled()
                rig.handle.power(override=override)
                rig.cycles(2)
                move = rig.handle.move_relative(way, Velocity=1000.0, **dynamics)
                highest = 0.0
                while not move.done():
                    rig.cycles()
                    highest = max(highest, rig.generator.v)
                assert highest == pytest.approx(expected, rel=0.004)


@pytest.mark.requirement("NC-167", "NC-173")
def test_override_change():
    """A new override changes the velocity with the acceleration and jerk of the command; it counts from 0
    to 100 %.
    """
    rig = Rig().enabled()
    move = rig.handle.move_absolute(
        1900.0, Velocity=400.0, Acceleration=500.0, Deceleration=800.0, Jerk=5000.0
    )
    rig.cycles(800)
    assert rig.generator.v == pytest.approx(400.0)
    for override, velocity in ((50.0, 200.0), (0.0, 0.0), (-10.0, 0.0), (150.0, 400.0), (25.0, 100.0)):
        rig.handle.power(override=override)
        steepest = jerk = 0.0
        last = rig.generator.a
        for _ in range(480):
            rig.cycles()
            a = rig.generator.a
            steepest, jerk, last = max(steepest, abs(a)), max(jerk, abs(a - last) / T), a
        assert rig.generator.v == pytest.approx(velocity)
        assert steepest <= 800.0 + 1e-6
        assert jerk <= 5000.0 + 1e-3
        assert rig.axis.nc_to_plc.AxisState == (2 if velocity == 0.0 else 3)
        assert not move.ended()
    # A program that writes more into the interface than 100 % gets no more.
    rig.runtime.call(lambda: setattr(rig.ref.PlcToNc, "Override", 2 * FULL_OVERRIDE))
    rig.cycles(480)
    assert rig.generator.v == pytest.approx(400.0)
    assert rig.axis.trace_row()[-1] == 1.0
    rig.until(move.done)
    assert rig.generator.s == 1900.0


@pytest.mark.requirement("NC-724", "NC-035", "NC-741")
def test_stop():
    """MC_Stop ends a motion with the dynamics of the last command where it has none, and locks the axis
    until Execute falls.
    """
    for given, expected in (
        ({}, 700.0),
        ({"Deceleration": -1.0, "Jerk": 0.0}, 700.0),
        ({"Deceleration": 300.0}, 300.0),
    ):
        rig = Rig().enabled()
        move = rig.handle.move_velocity(500.0, Deceleration=700.0, Jerk=1e6)
        rig.until(move.in_velocity)
        stop = rig.handle.stop(**given)
        steepest = 0.0
        ramps = []
        while not stop.done():
            rig.cycles()
            steepest = max(steepest, -rig.generator.a)
            ramps.append(-rig.generator.a)
        assert steepest == pytest.approx(expected, rel=1e-3)
        assert ramps.index(steepest) < 5  # the jerk of the last command, not the default of the axis
        assert move.CommandAborted
        assert rig.status("HasBeenStopped")
        assert rig.status("MotionCommandsLocked")
        refused = rig.handle.move_relative(10.0, Velocity=10.0), rig.handle.halt()
        rig.cycles(2)
        assert [one.ErrorID for one in refused] == [0x42EF, 0x42EF]
        assert rig.status("MotionCommandsLocked")
        stop.set(Execute=False)
        rig.cycles(2)
        assert not rig.status("MotionCommandsLocked")
        rig.until(rig.handle.move_relative(10.0, Velocity=10.0).done)


def test_halt_is_overridden():
    """MC_Halt brakes and does not lock: another command takes over while it runs."""
    rig = Rig().enabled()
    rig.until(rig.handle.move_velocity(500.0).in_velocity)
    halt = rig.handle.halt()
    rig.cycles(20)
    assert halt.Busy
    assert 0.0 < rig.generator.v < 500.0
    move = rig.handle.move_velocity(400.0)
    rig.until(move.in_velocity)
    assert halt.CommandAborted


@pytest.mark.requirement("NC-103", "NC-104", "NC-105", "NC-106", "NC-107")
def test_jog(subtests):
    """The standard modes take the manual velocities in both directions; inching moves by Position at a
    rising edge.
    """
    for mode, velocity in (
        (JogMode.MC_JOGMODE_STANDARD_FAST, 600.0),
        (JogMode.MC_JOGMODE_STANDARD_SLOW, 100.0),
    ):
        for backwards in (False, True):
            with subtests.test(mode=mode, backwards=backwards):
                rig = Rig().enabled()
                jog = rig.handle.jog(mode, backwards=backwards)
                rig.cycles(700)
                assert rig.generator.v == pytest.approx(-velocity if backwards else velocity)
                jog.set(JogForward=False, JogBackwards=False)
                rig.until(jog.done)
                assert rig.generator.v == 0.0
    rig = Rig().enabled()
    jog = rig.handle.jog(JogMode.MC_JOGMODE_INCHING, Position=2.0, Velocity=50.0)
    rig.until(jog.done)
    assert rig.generator.s == pytest.approx(2.0)
    rig.cycles(100)
    assert rig.generator.s == pytest.approx(2.0)
    jog.set(JogForward=False)
    rig.cycles()
    jog.set(JogBackwards=True)
    rig.cycles(2)
    rig.until(jog.done)
    assert rig.generator.s == pytest.approx(0.0)


@pytest.mark.requirement("NC-242")
def test_set_position():
    """Set and actual position change together, in motion too: the following error and the motion stay."""
    rig = Rig(ctrl__velocity_precontrol_weight=0.5).enabled()
    move = rig.handle.move_absolute(300.0, Velocity=40.0)
    rig.cycles(500)
    error, velocity = rig.axis.following_error, rig.generator.v
    assert error > 0.5
    actual = rig.axis.position
    rig.handle.set_position(1000.0, relative=True)
    rig.cycles()
    assert rig.axis.following_error == pytest.approx(error, abs=0.02)
    assert rig.generator.v == velocity
    assert rig.axis.position == pytest.approx(actual + 1000.0, abs=0.2)
    rig.until(move.done)
    assert rig.generator.s == pytest.approx(1300.0)
    rig.handle.set_position(5.0)
    rig.cycles(2)
    assert rig.axis.position == pytest.approx(5.0, abs=0.01)


@pytest.mark.requirement("NC-134", "NC-135", "NC-136", "NC-148", "NC-730", "NC-770", "NC-002")
def test_position_lag():
    """A lag above the maximum for longer than the filter time shuts the axis down; at the maximum or
    shorter, nothing.
    """

    def pushed(by, cycles, **parameters):
        rig = Rig(ctrl__pos_kv=0.0, **parameters).enabled()
        rig.device.position = by
        rig.cycles(cycles)
        rig.device.position = 0.0 if not rig.axis.error else by
        return rig

    for by, cycles, error in (
        (5.0, 200, 0),
        (5.1, 9, 0),
        (5.1, 10, 0),
        (5.1, 12, 0x4550),
        (-5.1, 12, 0x4550),
    ):
        rig = pushed(by, cycles)
        rig.cycles(20)
        assert rig.handle.error_id == error, (by, cycles)
    assert rig.status("Error")
    assert not rig.status("Operational")
    assert not rig.status("ControlLoopClosed")
    assert rig.axis.drive.output == 0.0
    assert rig.device.written[-1] == 0.0
    assert pushed(1000.0, 5000, axis__position_lag_monitoring=False).handle.error_id == 0


def test_lag_in_motion_is_no_ramp():
    """In motion the output is zero in the cycle in which the lag is found."""
    rig = Rig().enabled()
    move = rig.handle.move_velocity(500.0)
    rig.until(move.in_velocity)
    rig.device.frozen = True
    rig.until(lambda: rig.axis.error)
    assert rig.handle.error_id == 0x4550
    assert rig.device.written[-1] == 0.0
    assert rig.device.written[-2] > 400.0
    rig.cycles()
    assert move.ErrorID == 0x4550


@pytest.mark.requirement("NC-150", "NC-151")
def test_open_loop_and_reset():
    """Moved by hand without enable there is no lag; MC_Reset takes the set position to the actual one."""
    rig = Rig().enabled()
    rig.handle.power(False)
    rig.cycles(3)
    rig.device.position = 100.0
    rig.cycles(50)
    assert rig.handle.error_id == 0
    assert rig.generator.s == pytest.approx(100.0)
    rig.enabled()
    rig.device.position = 110.0
    rig.device.frozen = True
    rig.cycles(15)
    assert rig.handle.error_id == 0x4550
    assert rig.axis.following_error == pytest.approx(-10.0, abs=0.5)
    rig.device.frozen = False
    rig.until(rig.handle.reset().done)
    assert rig.handle.error_id == 0
    assert rig.generator.s == pytest.approx(rig.axis.position)
    assert rig.axis.following_error == pytest.approx(0.0, abs=1e-6)


@pytest.mark.requirement("NC-733")
def test_enable_lost_in_motion():
    """Losing the controller enable while a command is active is an error; at rest it is none."""
    rig = Rig().enabled()
    rig.handle.power(False)
    rig.cycles(5)
    assert rig.handle.error_id == 0
    rig.enabled()
    move = rig.handle.move_velocity(100.0)
    rig.until(move.in_velocity)
    rig.handle.power(False)
    rig.cycles(3)
    assert rig.handle.error_id == 0x4356
    assert move.ErrorID == 0x4356
    refused = rig.handle.move_absolute(1.0, Velocity=1.0)
    rig.cycles(2)
    assert refused.Error


@pytest.mark.requirement("NC-075", "NC-076", "NC-077")
def test_divider_and_phase():
    """An axis with Divider n runs in every n-th cycle of the SAF task, in the one that Modulo says."""
    for phase in range(4):
        rig = Rig(axis__cycle_divider=4, axis__cycle_modulo=phase)
        assert rig.axis.cycle_s == pytest.approx(0.008)
        seen = []
        for _ in range(20):
            before = rig.axis.nc_to_plc.OpModeDWord >> 24
            rig.cycles()
            seen.append((rig.axis.nc_to_plc.OpModeDWord >> 24) != before)
        assert sum(seen) == 5
        assert [index % 4 for index, ran in enumerate(seen) if ran] == [phase] * 5
    with pytest.raises(ConfigurationError, match="cycle_modulo"):
        Rig(axis__cycle_divider=4, axis__cycle_modulo=4)


@pytest.mark.requirement("NC-015", "NC-016", "NC-017", "NC-021")
def test_watchdog(subtests):
    """N cycles without fresh data clear PlcToNc from the next cycle on, and the axis stops; 0 never does."""
    for n in (0, 1, 5):
        with subtests.test(n=n):
            rig = Rig(task__watchdog_cycles=n).enabled()
            rig.until(rig.handle.move_velocity(100.0).in_velocity)
            if n > 1:
                rig.runtime.plc_running = False
                rig.cycles(n - 1)
                rig.runtime.plc_running = True
                rig.cycles(n)
                assert rig.handle.operational
            rig.runtime.plc_running = False
            rig.cycles(1)  # what the last call has written arrives
            rig.cycles(n)
            assert rig.axis.plc_to_nc.ControlDWord == 0x7
            rig.cycles(1)
            assert (rig.axis.plc_to_nc.pack() == bytes(128)) is (n > 0)
            rig.cycles(50)
            assert rig.handle.operational is (n == 0)
            assert (rig.device.velocity == 0.0) is (n > 0)


@pytest.mark.requirement("NC-020", "NC-766")
def test_watchdog_to_plc():
    """A stalled transfer to the PLC shows old values, then zeros; the axis itself goes on."""
    rig = Rig(task__watchdog_cycles=5).enabled()
    rig.until(rig.handle.move_velocity(100.0).in_velocity)
    link = rig.runtime.links["x"]
    link.to_plc_stalled = True
    rig.cycles(1)
    kept = rig.ref.NcToPlc.ActPos
    rig.cycles(4)
    assert rig.ref.NcToPlc.ActPos == kept != 0.0
    rig.cycles(1)
    assert rig.ref.NcToPlc.pack() == bytes(256)
    assert not rig.status("Operational")
    assert rig.generator.v == 100.0
    link.to_plc_stalled = False
    rig.cycles(1)
    assert rig.status("Operational")


@pytest.mark.requirement("NC-022")
def test_after_the_watchdog():
    """Fresh data act at once after a stall, and the motion is not resumed: a reset is needed."""
    rig = Rig(task__watchdog_cycles=5).enabled()
    rig.until(rig.handle.move_velocity(100.0).in_velocity)
    rig.runtime.plc_running = False
    rig.cycles(20)
    assert rig.handle.error_id == 0x4356
    rig.runtime.plc_running = True
    rig.cycles(2)
    assert rig.axis.plc_to_nc.ControlDWord == 0x7
    rig.cycles(50)
    assert not rig.handle.operational
    rig.until(rig.handle.reset().done)
    rig.cycles(5)
    assert rig.handle.operational
    assert rig.generator.v == 0.0


@pytest.mark.requirement("NC-475", "NC-476", "NC-478")
def test_read_status():
    """Status changes with ReadStatus() only; Error and ErrorID mirror the image."""
    rig = Rig().enabled()
    rig.ref.ReadStatus()
    assert rig.ref.Status.Operational
    rig.axis.raise_error(0x4550)
    rig.cycles(2)
    assert rig.ref.Status.Operational
    assert not rig.ref.Status.Error
    rig.ref.ReadStatus()
    assert rig.ref.Status.Error
    assert rig.ref.Status.ErrorID == 0x4550
    assert not rig.ref.Status.Operational


def test_wrong_inputs():
    """An input that a block does not have is named; a negative acceleration is an error of the block."""
    rig = Rig().enabled()
    with pytest.raises(UnknownNameError, match="Velocity"):
        rig.handle.move_absolute(1.0, Velocit=5.0)
    move = rig.handle.move_absolute(1.0, Velocity=5.0, Acceleration=-1.0)
    rig.cycles(2)
    assert move.ErrorID == 0x4B06


def test_inputs_are_of_their_kind():
    """An enumeration takes the name of a member; what is no value for an input is refused where it is given,
    with what is allowed.
    """
    rig = Rig().enabled()
    blended = rig.handle.move_absolute(1.0, Velocity=10.0, BufferMode="BlendingLow")
    assert blended.BufferMode is BufferMode.BlendingLow
    rig.until(blended.done)
    for given, message in (
        ({"BufferMode": "BlendingLo"}, r"MC_MoveAbsolute.BufferMode: 'BlendingLo' .*similar: BlendingLow"),
        ({"Velocity": "fast"}, r"MC_MoveAbsolute.Velocity: 'fast' is not allowed; allowed: a number"),
        ({"Velocity": None}, "a number"),
    ):
        with pytest.raises(ConfigurationError, match=message):
            rig.handle.move_absolute(1.0, **{"Velocity": 10.0} | given)
    with pytest.raises(ConfigurationError, match=r"MC_MoveAbsolute\.Execute: .*True or False"):
        blended.set(Execute="no")
    rig.cycles(3)
    with pytest.raises(AttributeError, match=r"has no 'move_absolut'; similar: move_absolute"):
        _ = rig.handle.move_absolut
