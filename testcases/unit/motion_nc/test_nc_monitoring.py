"""Windows, in-target alarm, motion monitoring, correction, device data of an NC axis."""

from itertools import product

import pytest

from motion.nc.monitoring import Monitoring
from motion.nc.parameters import ParameterSet
from testcases.unit.motion_nc.nc_rig import Rig, T


def _monitoring(**values):
    return Monitoring(ParameterSet({f"axis.{key}": value for key, value in values.items()}), cycle_s=T)


def _watch(monitoring, deviation, *, arrived=False, alarm=False):
    return monitoring.watch_target(deviation, arrived=arrived, alarm=alarm)


@pytest.mark.requirement("NC-001", "NC-137", "NC-138", "NC-152", "NC-153")
def test_position_area():
    """The window acts at once in both directions, its edge included; switched off it shows nothing."""
    monitoring = _monitoring()
    for deviation, inside in ((-5.1, False), (-4.9, True), (5.0, True), (5.000001, False), (0.0, True)):
        _watch(monitoring, deviation)
        assert monitoring.in_area is inside
    monitoring = _monitoring(position_range_monitoring=False)
    _watch(monitoring, 0.0)
    assert not monitoring.in_area


@pytest.mark.requirement("NC-139", "NC-140", "NC-141", "NC-154", "NC-155")
def test_target_window():
    """The window counts after the uninterrupted time; one cycle outside ends it and begins anew."""
    monitoring = _monitoring()
    found = []
    for _ in range(12):
        _watch(monitoring, -1.9)
        found.append(monitoring.in_target)
    assert found == [False] * 9 + [True] * 3
    _watch(monitoring, -2.1)
    assert not monitoring.in_target
    for _ in range(8):
        _watch(monitoring, 0.0)
    _watch(monitoring, 2.1)
    for _ in range(9):
        _watch(monitoring, 0.0)
    assert not monitoring.in_target
    _watch(monitoring, 2.0)
    assert monitoring.in_target
    for _ in range(100):
        _watch(monitoring, -2.1)
        assert not monitoring.in_target
    monitoring = _monitoring(target_position_monitoring=False)
    for _ in range(5000):
        _watch(monitoring, 0.0)
    assert not monitoring.in_target


@pytest.mark.requirement("NC-772")
def test_oscillation_around_the_target():
    """What swings through the window faster than its time is never in target, but in the area."""
    monitoring = _monitoring()
    for cycle in range(400):
        _watch(monitoring, 3.0 if cycle % 16 < 8 else -3.0)
        assert monitoring.in_area
        assert not monitoring.in_target


@pytest.mark.requirement("NC-142", "NC-143", "NC-157", "NC-158", "NC-159", "NC-731", "NC-771")
def test_in_target_alarm():
    """The timeout runs from the arrival of the set position; the window in time, or no alarm, is no error."""

    def until_error(cycles, *, inside_after=None, **values):
        monitoring = _monitoring(in_target_timeout=0.1, **values)
        for _ in range(100):
            assert _watch(monitoring, 3.0, arrived=False, alarm=True) == 0
        for cycle in range(cycles):
            deviation = 3.0 if inside_after is None or cycle < inside_after else 1.0
            if _watch(monitoring, deviation, arrived=True, alarm=True):
                return cycle
        return None

    assert until_error(500, in_target_alarm=True) == 50
    assert until_error(500, in_target_alarm=False) is None
    assert until_error(500, in_target_alarm=True, inside_after=40) is None
    assert until_error(500, in_target_alarm=True, inside_after=42) == 50
    assert until_error(500, in_target_alarm=True, inside_after=49, target_position_monitoring=False) is None
    assert until_error(500, in_target_alarm=True, target_position_monitoring=False) == 50
    monitoring = _monitoring(in_target_timeout=0.0, in_target_alarm=True)
    assert _watch(monitoring, 3.0, arrived=True, alarm=True) == 0x435C


@pytest.mark.requirement("NC-160")
def test_in_target_alarm_of_an_axis():
    """A load held off the target puts the axis into error and switches the output off."""
    rig = Rig(
        ctrl__pos_kv=0.0,
        axis__in_target_alarm=True,
        axis__in_target_timeout=0.1,
        ctrl__velocity_precontrol_weight=0.0,
    ).enabled()
    move = rig.handle.move_relative(3.0, Velocity=50.0)
    rig.until(lambda: rig.axis.error)
    assert rig.handle.error_id == move.ErrorID or rig.handle.error_id == 0x435C
    rig.cycles()
    assert move.ErrorID == 0x435C
    assert rig.axis.drive.output == 0.0
    assert not rig.handle.operational


@pytest.mark.requirement("NC-156")
def test_windows_of_a_new_command():
    """A new command is measured at its own target; an endless motion has none."""
    rig = Rig().enabled()
    rig.until(rig.handle.move_absolute(100.0, Velocity=100.0).done)
    assert rig.status("InTargetPosition")
    assert rig.status("InPositionArea")
    rig.handle.move_absolute(200.0, Velocity=10.0)
    rig.cycles(3)
    assert not rig.status("InTargetPosition")
    assert not rig.status("InPositionArea")
    rig.until(rig.handle.move_absolute(110.0, Velocity=100.0).done)
    rig.handle.move_velocity(1.0)
    rig.cycles(3)
    for _ in range(100):
        rig.cycles()
        assert not rig.status("InTargetPosition")
        assert not rig.status("InPositionArea")


@pytest.mark.requirement("NC-144", "NC-145", "NC-146", "NC-162", "NC-163", "NC-164", "NC-732")
def test_motion_monitoring():
    """One cycle with a greater change in the time is enough; less, or the window itself, for the time is an
    error.
    """
    monitoring = _monitoring(motion_monitoring=True)

    def until_error(steps):
        position = 0.0
        monitoring.reset()
        monitoring.watch_motion(position, moving=True, held=False)
        for cycle, step in enumerate(steps, start=1):
            position += step
            if monitoring.watch_motion(position, moving=True, held=False):
                return cycle
        return None

    assert until_error([0.05] * 400) == 250
    assert until_error([0.05] * 249 + [0.2] + [0.05] * 249) is None
    assert until_error([0.2] * 50 + [0.0] * 300) == 300
    assert until_error([0.101] * 1000) is None
    assert _monitoring(motion_monitoring=False).watch_motion(0.0, moving=True, held=False) == 0
    monitoring.reset()
    for held in (True, False):
        results = {monitoring.watch_motion(0.0, moving=True, held=held) for _ in range(240)}
        assert results == {0}
    monitoring.reset()
    assert {monitoring.watch_motion(0.0, moving=False, held=False) for _ in range(1000)} == {0}


@pytest.mark.requirement("NC-161", "NC-769", "NC-773")
def test_motion_monitoring_of_an_axis():
    """A frozen encoder during a motion is an error, standing still without a command is none; slow motion
    raises a false alarm.
    """
    settings = {"axis__position_lag_monitoring": False, "axis__motion_monitoring": True}
    rig = Rig(**settings).enabled()
    rig.cycles(1000)
    assert rig.handle.error_id == 0
    rig.until(rig.handle.move_absolute(50.0, Velocity=200.0).done)
    rig.cycles(1000)
    assert rig.handle.error_id == 0
    rig.handle.move_velocity(200.0)
    rig.cycles(100)
    rig.device.frozen = True
    rig.cycles(260)
    assert rig.handle.error_id == 0x435D
    rig = Rig(**settings).enabled()
    rig.handle.move_velocity(40.0)
    rig.cycles(300)
    assert rig.handle.error_id == 0x435D
    settings["axis__motion_monitoring"] = False
    rig = Rig(**settings).enabled()
    rig.handle.move_velocity(100.0)
    rig.device.frozen = True
    rig.cycles(1000)
    assert rig.handle.error_id == 0


@pytest.mark.requirement("NC-194", "NC-195", "NC-132", "NC-209")
def test_position_correction():
    """The correction acts while its parameter is on, filtered; software limits do not see it."""
    rig = Rig().enabled()
    rig.ref.PlcToNc.PositionCorrection = 3.0
    rig.cycles(20)
    assert rig.axis.encoder.correction == 0.0
    assert rig.axis.following_error == pytest.approx(0.0, abs=1e-6)
    rig = Rig(ctrl__pos_kv=0.0, axis__position_correction=True).enabled()
    rig.ref.PlcToNc.PositionCorrection = 1.0
    rig.cycles(3)
    assert rig.axis.following_error == pytest.approx(-1.0)
    rig.handle.write_parameter("ctrl.pos_kv", 20.0)
    rig.cycles(400)
    assert rig.device.position == pytest.approx(-1.0, abs=1e-3)
    assert rig.axis.position == pytest.approx(0.0, abs=1e-3)
    rig = Rig(
        ctrl__pos_kv=0.0, axis__position_correction=True, enc__position_correction_filter_time=0.01
    ).enabled()
    rig.ref.PlcToNc.PositionCorrection = 6.0
    rig.cycles(1)
    assert rig.axis.encoder.correction == pytest.approx(1.0)
    rig.cycles(1)
    assert rig.axis.encoder.correction == pytest.approx(1.8333333)
    limits = {"axis__soft_limit_max": 2.0, "axis__soft_limit_max_enable": True}
    rig = Rig(axis__position_correction=True, **limits).enabled()
    rig.ref.PlcToNc.PositionCorrection = 3.0
    rig.cycles(200)
    assert rig.handle.error_id == 0
    rig.until(rig.handle.move_absolute(2.0, Velocity=10.0).done)


@pytest.mark.requirement("NC-363", "NC-376", "NC-377", "NC-378", "NC-780", "NC-749")
def test_drive_error_tolerance(subtests):
    """With the tolerance a drive that keeps following is only reported; every other error stops the axis."""
    for tolerance, follows, stopped in (
        ("STANDARD", True, True),
        ("STANDARD", False, True),
        ("IGNORE SELECTED ERRORS", True, False),
        ("IGNORE SELECTED ERRORS", False, True),
    ):
        with subtests.test(tolerance=tolerance, follows=follows):
            rig = Rig(drv__error_tolerance=tolerance).enabled()
            rig.until(rig.handle.move_velocity(50.0).in_velocity)
            rig.device.keeps_following = follows
            rig.device.fault = True
            rig.cycles(5)
            assert rig.status("DriveDeviceError")
            assert rig.axis.error is stopped
            assert rig.handle.error_id == (0x4650 if stopped else 0)
            assert (rig.device.velocity != 0.0) is not stopped


@pytest.mark.requirement("NC-427", "NC-781", "NC-747")
def test_invalid_data(subtests):
    """Invalid data of encoder or drive keep the last values and show the flag; for more than three cycles, or
    as many as are set, they are an error with a code of its own.
    """
    for name, code in (("encoder_valid", 0x4466), ("valid", 0x4655)):
        for cycles, allowed in (*((one, 3) for one in range(1, 6)), (2, 1), (5, 5)):
            with subtests.test(name, cycles=cycles, allowed=allowed):
                rig = Rig().enabled()
                rig.axis.invalid_cycles = allowed
                rig.until(rig.handle.move_velocity(50.0).in_velocity)
                setattr(rig.device, name, False)
                rig.cycles(1)
                kept = rig.axis.position
                assert rig.status("IoDataInvalid")
                rig.cycles(cycles - 1)
                assert (rig.axis.position == kept) is (name == "encoder_valid" or cycles == 1)
                setattr(rig.device, name, True)
                rig.cycles(1)
                assert not rig.status("IoDataInvalid")
                assert rig.handle.error_id == (code if cycles > allowed else 0)


@pytest.mark.requirement("NC-745", "NC-750")
def test_encoder_fault_and_life_counter():
    """A faulty encoder is 0x4464; data that stay away because the sign of life stands still are 0x4651."""
    rig = Rig().enabled()
    rig.device.encoder_fault = True
    rig.cycles(2)
    assert rig.handle.error_id == 0x4464
    assert rig.status("Error")
    assert not rig.status("Operational")
    rig = Rig().enabled()
    rig.device.valid = rig.device.encoder_valid = False
    rig.device.life_lost = True
    rig.cycles(4)
    assert rig.handle.error_id == 0x4651
    assert rig.status("Error")


@pytest.mark.requirement("NC-472")
def test_op_mode(subtests):
    """The bits of OpModeDWord follow the parameters."""
    rig = Rig()
    for key, bit in (
        ("position_range_monitoring", 0),
        ("target_position_monitoring", 1),
        ("motion_monitoring", 3),
        ("in_target_alarm", 4),
        ("position_lag_monitoring", 16),
        ("soft_limit_min_enable", 18),
        ("soft_limit_max_enable", 19),
        ("position_correction", 20),
        ("allow_commands_slave", 21),
        ("allow_commands_ext_setpoint", 22),
    ):
        with subtests.test(key):
            for value in (True, False, True):
                rig.handle.write_parameter(f"axis.{key}", value)
                rig.cycles()
                assert bool(rig.ref.NcToPlc.OpModeDWord >> bit & 1) is value


@pytest.mark.requirement("NC-031", "NC-768", "NC-263")
def test_wrong_polarity():
    """Positive feedback runs away within the limit of the controller, until the lag ends it."""
    for key, push in product(("enc.invert_counting_direction", "drv.invert_motor_polarity"), (0.01, -0.01)):
        rig = Rig(ctrl__output_limit=0.02).enabled()
        rig.handle.write_parameter(key, True)
        rig.device.position += push
        fastest = 0.0
        for _ in range(3000):
            rig.cycles()
            fastest = max(fastest, abs(rig.device.velocity))
            if rig.axis.error:
                break
        assert rig.handle.error_id == 0x4550
        assert abs(rig.axis.following_error) > 5.0
        assert fastest == pytest.approx(44.0)
        assert rig.device.velocity == 0.0


def test_an_encoder_fault_of_the_drive_is_reset():
    """MC_Reset ends an encoder error whose cause the drive gives up only when it is acknowledged."""
    rig = Rig().enabled()
    write = rig.device.write

    def acknowledged(outputs):
        if outputs.reset:
            rig.device.encoder_fault = False
        write(outputs)

    rig.device.write = acknowledged
    rig.device.fault = rig.device.encoder_fault = True
    rig.cycles(3)
    assert rig.handle.error_id == 0x4464
    rig.until(rig.handle.reset().done, 1.0)
    rig.until(lambda: rig.axis.operational, 1.0)
    assert rig.handle.error_id == 0
