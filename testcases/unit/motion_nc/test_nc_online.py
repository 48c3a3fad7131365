"""The online dialog of an axis: what it shows, enabling, keys, functions, coupling, compensation."""

import pytest

from fieldbus.errors import ConfigurationError
from motion.nc.online import fill_dynamics
from motion.nc.parameters import ParameterSet
from testcases.unit.motion_nc.nc_rig import Rig, T

pytestmark = pytest.mark.exhaustive


def _dialog(**values):
    """An axis whose PLC is stopped, with its dialog."""
    rig = Rig(task__watchdog_cycles=0, **values)
    rig.runtime.plc_running = False
    rig.cycles()
    online = rig.handle.online
    online.all()
    rig.cycles(4)
    return rig, online


@pytest.mark.requirement(*(f"NC-{row}" for row in range(218, 229)), "NC-009")
def test_view():
    """Every field shows what the axis does: positions, lag with its extremes, velocities, output, states."""
    rig, online = _dialog(ctrl__velocity_precontrol_weight=0.5)
    view = online.view()
    assert (view.controller, view.feed_fw, view.feed_bw, view.override) == (True, True, True, 100.0)
    assert view.ready
    assert view.not_moving
    assert not view.calibrated
    assert not view.has_job
    online.press("F3")
    for _ in range(400):
        rig.cycles()
    view, axis = online.view(), rig.axis
    assert view.actual_position == axis.position > 10.0
    assert view.setpoint_position == axis.motion.s
    assert view.lag_distance == axis.following_error == pytest.approx(view.lag_max)
    assert view.lag_min == 0.0
    assert view.actual_velocity == axis.encoder.velocity
    assert view.setpoint_velocity == 100.0
    assert view.total_output == pytest.approx(100.0 * 100.0 / 2200.0, rel=0.01)
    assert view.control_output == pytest.approx(100.0 * 50.0 / 2200.0, rel=0.01)
    assert (view.has_job, view.not_moving, view.moving_fw, view.moving_bw) == (True, False, True, False)
    online.release("F3")
    rig.cycles(300)
    online.press("F2")
    rig.cycles(400)
    view = online.view()
    assert (view.moving_fw, view.moving_bw) == (False, True)
    assert view.lag_min < 0.0 < view.lag_max
    online.reset_extremes()
    assert online.view().lag_min == online.view().lag_max == 0.0
    online.release("F2")
    rig.cycles(400)
    online.set_enabling(controller=True, feed_fw=True, feed_bw=False, override=25.0)
    rig.cycles()
    view = online.view()
    assert (view.controller, view.feed_fw, view.feed_bw, view.override) == (True, True, False, 25.0)
    online.set_calibration(True)
    online.target_position, online.target_velocity = rig.axis.motion.s + 1.0, 40.0
    online.press("F5")
    rig.until(lambda: not online.view().has_job and online.view().in_target_position)
    assert online.view().in_position_range
    assert online.view().calibrated
    other = Rig(with_=rig)
    rig.cycles()
    assert rig.handle.online.couple(other.axis.name) == 0
    rig.cycles()
    assert online.view().coupled
    rig.axis.raise_error(0x4550)
    rig.cycles()
    assert online.view().error == 0x4550
    assert not online.view().ready


@pytest.mark.requirement("NC-072", "NC-073", "NC-074", "NC-071", "NC-081")
def test_display_options():
    """Display options change the view alone: process data and parameters keep their numbers; a unit names."""
    rig, online = _dialog(axis__unit="deg", enc__modulo_factor=10.0)
    rig.handle.set_position(725.5)
    rig.runtime.plc_running = True
    rig.cycles()
    rig.runtime.plc_running = False
    online.press("F3")
    rig.cycles(200)
    plain = online.view()
    image = rig.axis.nc_to_plc.pack()
    for key in ("axis.display_position_um", "axis.display_modulo", "axis.display_velocity_mm_min"):
        rig.handle.write_parameter(key, True)
    shown = online.view()
    assert rig.axis.nc_to_plc.pack() == image
    assert shown.actual_position == pytest.approx((plain.actual_position % 10.0) * 1000.0)
    assert shown.actual_velocity == pytest.approx(plain.actual_velocity * 60.0)
    assert (shown.position_unit, shown.velocity_unit) == ("udeg", "deg/min")
    assert (plain.position_unit, plain.velocity_unit) == ("deg", "deg/s")
    parameters = rig.parameters
    for key, unit in (
        ("axis.maximum_velocity", "deg/s"),
        ("axis.default_acceleration", "deg/s2"),
        ("axis.default_jerk", "deg/s3"),
        ("axis.position_lag_max", "deg"),
        ("enc.scaling_numerator", "deg/INC"),
    ):
        assert parameters.unit(key) == unit
        assert parameters.read(key) == ParameterSet({"enc.encoder_mask": 5}).read(key)


@pytest.mark.requirement("NC-230", "NC-229")
def test_priority_of_the_plc():
    """A linked PLC that runs has priority: motions of the dialog are refused; without link, or with the PLC
    stopped, they run, in an enabled direction alone.
    """
    rig = Rig().enabled()
    online = rig.handle.online
    for call in (
        lambda: online.press("F3"),
        lambda: online.press("F9"),
        lambda: online.start("absolute", target=5.0, velocity=10.0),
        lambda: online.raw_output(5.0),
        lambda: online.set_target_position(5.0),
        online.stop,
    ):
        assert call() == 0x4B05
    rig.cycles(20)
    assert rig.generator.v == 0.0
    rig.runtime.links[rig.axis.name].connected = False
    assert online.press("F3") == 0
    rig.cycles(300)
    assert rig.generator.v == 100.0
    online.release("F3")
    rig.cycles(300)
    online.set_enabling(controller=True, feed_fw=False, feed_bw=True)
    rig.cycles(2)
    online.press("F4")
    rig.cycles(20)
    assert online.error_id == 0x4358
    assert rig.generator.v == 0.0
    online.release("F4")
    online.press("F2")
    rig.cycles(300)
    assert rig.generator.v == -100.0
    with pytest.raises(ConfigurationError, match="F9"):
        online.press("F7")


@pytest.mark.requirement("NC-232", "NC-233", "NC-234", "NC-235")
def test_manual_keys(subtests):
    """F1 to F4 move while they are pressed, with the manual velocities."""
    for key, velocity in (("F1", -600.0), ("F2", -100.0), ("F3", 100.0), ("F4", 600.0)):
        with subtests.test(key):
            rig, online = _dialog()
            online.press(key)
            rig.cycles(800)
            assert rig.generator.v == pytest.approx(velocity)
            online.release("F6")
            rig.cycles(10)
            assert rig.generator.v == pytest.approx(velocity)
            online.release(key)
            rig.cycles(900)
            assert rig.generator.v == 0.0


@pytest.mark.requirement("NC-236", "NC-237", "NC-238", "NC-239", "NC-328")
def test_other_keys():
    """F5 starts to the target, F6 stops, F8 resets, F9 homes with the cam of the PLC image (bit 5)."""
    rig, online = _dialog(enc__home_position=7.0)
    online.target_position, online.target_velocity = 300.0, 150.0
    online.press("F5")
    rig.cycles(500)
    assert rig.generator.v == 150.0
    online.press("F6")
    rig.cycles(300)
    assert rig.generator.v == 0.0
    assert rig.generator.s < 300.0
    assert not rig.axis.motion.locked
    rig.axis.raise_error(0x4550)
    rig.cycles()
    online.press("F8")
    rig.cycles(20)
    assert rig.handle.error_id == 0
    online.press("F9")
    rig.cycles(50)
    assert rig.axis.homing.busy
    rig.axis.plc_to_nc.ControlDWord |= 1 << 7  # which the source names as well
    rig.cycles(20)
    assert rig.axis.homing.state == 2
    rig.axis.plc_to_nc.ControlDWord |= 1 << 5
    rig.cycles(200)
    rig.axis.plc_to_nc.ControlDWord &= ~(1 << 5)
    rig.cycles(200)
    assert rig.axis.homed
    assert rig.axis.position == pytest.approx(7.0, abs=2.0)


@pytest.mark.requirement("NC-240")
def test_extended_start():
    """Absolute, relative, endless, modulo and reversing; an input that a mode needs is missed; Last Time is
    the duration of the motion.
    """
    rig, online = _dialog()
    for mode, target, end in (("absolute", 20.0, 20.0), ("relative", -5.0, 15.0), ("modulo", 10.0, 370.0)):
        assert online.start(mode, target=target, velocity=100.0) == 0
        before = rig.scheduler.now
        rig.until(lambda: online._command is not None)
        rig.until(lambda: online._command is None)
        assert rig.generator.s == pytest.approx(end)
        assert online.last_time == pytest.approx((rig.scheduler.now - before) * 1e-9, abs=0.012)
    for mode, sign in (("endless +", 1.0), ("endless -", -1.0)):
        online.start(mode, velocity=50.0, acceleration=3000.0, jerk=1e6)
        rig.cycles(200)
        assert rig.generator.v == sign * 50.0
        online.stop()
        rig.cycles(300)
    turns = []
    online.start("reversing", target=360.0, second_target=370.0, velocity=200.0)
    last = 0.0
    for _ in range(3000):
        rig.cycles()
        if rig.generator.v == 0.0 and last != 0.0:
            turns.append(round(rig.generator.s, 6))
        last = rig.generator.v
    assert len(turns) > 3
    assert turns[:4] == [360.0, 370.0, 360.0, 370.0]
    online.stop()
    rig.cycles(400)
    at = rig.generator.s
    rig.cycles(400)
    assert rig.generator.s == at
    for mode in ("absolute", "relative", "modulo", "reversing"):
        with pytest.raises(ConfigurationError, match="target"):
            online.start(mode, velocity=10.0)
    with pytest.raises(ConfigurationError, match="second_target"):
        online.start("reversing", target=5.0, velocity=10.0)
    with pytest.raises(ConfigurationError, match="endless"):
        online.start("sideways", velocity=10.0)


@pytest.mark.requirement("NC-241")
def test_raw_output():
    """A fixed output without position control until stop: limits and polarity hold, no lag is watched."""
    rig, online = _dialog(drv__output_limit_max=0.2, drv__invert_motor_polarity=True, ctrl__pos_kv=20.0)
    rig.device.frozen = True  # the axis does not move: a controlled one would lag
    for percent, output in ((10.0, -0.1), (50.0, -0.2), (-30.0, 0.3)):
        assert online.raw_output(percent) == 0
        rig.cycles(50)
        assert rig.axis.drive.output == pytest.approx(output)
        assert rig.device.velocity == pytest.approx(output * 2200.0)
        assert rig.handle.error_id == 0
    online.stop()
    rig.cycles(10)
    assert rig.axis.drive.output == 0.0
    online.start("absolute", target=5.0, velocity=1.0)
    rig.cycles(20)
    assert online.raw_output(5.0) == 0x4B04


@pytest.mark.requirement("NC-243", "NC-242", "NC-299")
def test_targets_and_positions():
    """The target changes on the fly; the actual position is set, or shifted."""
    rig, online = _dialog()
    online.start("absolute", target=500.0, velocity=100.0)
    rig.cycles(500)
    assert online.set_target_position(90.0) == 0
    rig.until(lambda: rig.axis.motion.active is None)
    assert rig.generator.s == pytest.approx(90.0)
    assert online.set_target_position(80.0) == 0x4B04
    online.set_actual_position(10.0)
    rig.cycles()
    assert rig.axis.position == pytest.approx(10.0, abs=0.01)
    online.set_actual_position(2.5, relative=True)
    rig.cycles()
    assert rig.axis.position == pytest.approx(12.5, abs=0.01)
    assert rig.axis.motion.s == pytest.approx(12.5, abs=0.01)


@pytest.mark.requirement("NC-244")
def test_coupling_dialog():
    """Couple, Change Factor, Stop and Decouple; the factor is 1 by default."""
    rig, online = _dialog()
    slave = Rig(with_=rig)
    rig.cycles()
    slave.handle.online.all()
    rig.cycles(4)
    dialog = slave.handle.online
    assert dialog.decouple() == 0x4B05
    assert dialog.change_factor(2.0) == 0x4B05
    assert dialog.couple(rig.axis.name) == 0
    online.press("F3")
    rig.cycles(300)
    assert slave.generator.v == 100.0
    assert dialog.change_factor(0.0) == 0x4B06
    assert dialog.change_factor(2.0) == 0
    rig.cycles()
    assert slave.generator.v == 200.0
    assert dialog.decouple() == 0
    online.release("F3")
    rig.cycles(400)
    assert rig.generator.v == 0.0
    assert slave.generator.v == 200.0
    dialog.couple(rig.axis.name, 0.5)
    dialog.stop()
    rig.cycles(500)
    assert slave.axis.coupling.master is None
    assert slave.generator.v == 0.0


@pytest.mark.requirement("NC-245", "NC-453", "NC-032")
def test_compensation():
    """A superposed motion adds its way to the running one, of a master or a slave, beyond Maximum Velocity
    too; bit 13 shows it.
    """
    rig, online = _dialog(axis__maximum_velocity=100.0)
    slave = Rig(with_=rig, axis__maximum_velocity=100.0)
    rig.cycles()
    slave.handle.online.all()
    rig.cycles(4)
    slave.handle.online.couple(rig.axis.name)
    online.start("absolute", target=600.0, velocity=100.0)
    rig.cycles(400)
    for one, dialog in ((rig, online), (slave, slave.handle.online)):
        before = one.axis.motion.s - rig.axis.motion.generator.s
        assert dialog.compensate(20.0, 50.0) == 0
        fastest = 0.0
        rig.cycles()
        while one.axis.nc_to_plc.StateDWord & 1 << 13:
            fastest = max(fastest, one.axis.motion.v)
            rig.cycles()
        assert fastest == pytest.approx(150.0)
        assert one.axis.motion.v == pytest.approx(100.0)
        if one is slave:
            assert one.axis.motion.s - rig.axis.motion.s == pytest.approx(before + 20.0)
    rig.until(lambda: rig.axis.motion.active is None)
    assert rig.axis.motion.s == pytest.approx(620.0)
    assert slave.axis.motion.v == 0.0


@pytest.mark.requirement("NC-217")
def test_default_dynamics_from_a_time():
    """The acceleration time to Maximum Velocity fills the three defaults and nothing else."""
    parameters = ParameterSet()
    before = {key: parameters.read(key) for key in ("axis.maximum_acceleration", "axis.maximum_velocity")}
    fill_dynamics(parameters, time_s=2.0)
    assert parameters.read("axis.default_acceleration") == 1000.0
    assert parameters.read("axis.default_deceleration") == 1000.0
    assert parameters.read("axis.default_jerk") == 500.0
    fill_dynamics(parameters, time_s=2.0, steepness=4.0)
    assert parameters.read("axis.default_jerk") == 2000.0
    assert before == {key: parameters.read(key) for key in before}
    for wrong in ({"time_s": 0.0}, {"time_s": 1.0, "steepness": 0.5}):
        with pytest.raises(ConfigurationError):
            fill_dynamics(parameters, **wrong)


@pytest.mark.requirement(*(f"NC-{row}" for row in range(291, 299)), "NC-300")
def test_encoder_view():
    """The view of the encoder: positions, correction, counters of hardware and NC, modulo, latch, flag."""
    rig, online = _dialog(
        axis__position_correction=True, enc__filter_time_position=0.01, enc__position_bias=0.0
    )
    online.set_enabling(controller=False, feed_fw=False, feed_bw=False)
    rig.device.position = 725.4014
    rig.cycles(200)
    view = online.encoder()
    assert view.hard_increments == 7254014
    assert view.soft_increments == (0, 7254014)
    assert view.position == pytest.approx(725.4014)
    assert view.modulo_position == pytest.approx(5.4014)
    assert view.modulo_turns == 2
    assert not view.calibrated
    rig.axis.plc_to_nc.PositionCorrection = 1.5
    rig.device.position = 726.4014
    rig.cycles()
    view = online.encoder()
    assert view.correction == 1.5
    assert view.uncorrected_position == pytest.approx(726.4014)
    assert view.position == pytest.approx(725.4014 + 1.0 * T / (T + 0.01) + 1.5)
    rig.axis.homing.latch_difference = -3.25
    assert online.encoder().latch_difference == -3.25
    online.set_calibration(True)
    assert online.encoder().calibrated
    online.set_calibration(False)
    assert not online.encoder().calibrated
    for count, words in ((-1, (-1, 0xFFFFFFFF)), (5 << 32 | 7, (5, 7))):
        rig.axis.encoder.soft_increments = count
        assert online.encoder().soft_increments == words
