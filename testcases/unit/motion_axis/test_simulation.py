"""Virtual and simulated axes: no drive, no encoder, actual values out of setpoints."""

from __future__ import annotations

import numpy as np
import pytest

VIRTUAL = {"VirtualAxis.Mode": 1}
SIMULATED = {"Simulation.Mode": 1}
BOTH = pytest.mark.parametrize("mode", [VIRTUAL, SIMULATED], ids=["virtual", "simulated"])


def ramp(rig, velocity=100.0):
    """Enabled and at constant velocity."""
    rig.enabled()
    job = rig.axis.move_velocity(velocity)
    rig.until(job.in_velocity)
    rig.run(0.5)


class TestBoth:
    """What virtual and simulated axes share."""

    @BOTH
    @pytest.mark.requirement("CFG-125", "CFG-161", "CFG-157", "VAR-126", "VAR-048")
    def test_the_drive_gets_nothing(self, make_rig, mode):
        """A dead link, no telegram to the drive, and yet the axis moves; `StatusWord.X25` shows it."""
        rig = make_rig(variables=mode)
        rig.port.link = False
        rig.port.write(0x0123, 45.0)  # what the image holds before
        ramp(rig)
        assert rig.axis.var("ActualPosition") > 30.0
        assert rig.port.written == (0x0123, 45.0)
        assert rig.axis.var("StatusWord.X25") is True

    @BOTH
    @pytest.mark.requirement("CFG-132", "CFG-164", "VAR-126", "STP-036")
    def test_enabled_at_once(self, make_rig, mode):
        """`MC_Power.Status` comes one servo cycle after `Enable` at the latest."""
        rig = make_rig(variables=mode)
        rig.cycles(3)
        power = rig.axis.power()
        rig.cycles(2)
        assert power.Status is True

    @BOTH
    @pytest.mark.requirement("CFG-133", "CFG-164")
    def test_homing_without_motion(self, make_rig, mode):
        """Homing is done at once and nothing moves."""
        rig = make_rig(variables=mode).enabled()
        rig.until(rig.axis.home(100.0).done)
        rig.cycles(2)
        assert rig.axis.var("ActualPosition") == pytest.approx(100.0)
        assert rig.axis.var("StatusWord.X5") is True
        assert max(rig.column("velocity_setpoint")) == 0.0

    @BOTH
    @pytest.mark.requirement("CFG-130", "CFG-162", "VAR-126")
    def test_limit_switches_do_nothing(self, make_rig, mode):
        """Hardware limit switches have no effect."""
        rig = make_rig(variables=mode | {"PositionLimits_HW.Active": True})
        rig.port.switches = 3
        ramp(rig)
        assert rig.axis.alarms.engine.number == 0
        assert rig.axis.var("ActualPosition") > 10.0

    @BOTH
    @pytest.mark.requirement("CFG-129", "CFG-164")
    def test_remove_enable(self, make_rig, mode):
        """Reaction 4 ends jobs and disables the object although there is no drive to stop."""
        rig = make_rig(variables=mode)
        ramp(rig)
        rig.axis.alarms.raise_alarm(421)
        rig.cycles(5)
        assert rig.axis.var("StatusWord.X0") is False
        assert rig.axis.var("ActualVelocity") == 0.0
        assert rig.axis.var("ErrorDetail.Reaction") == 4

    @BOTH
    @pytest.mark.requirement("CFG-153", "CFG-155", "CFG-154", "CFG-172", "VAR-129")
    @pytest.mark.parametrize(
        ("settings", "position"),
        [
            ({"Sensor[1].Type": 1, "Properties.MotionType": 1, "Sensor[1].Parameter.StepsPerRevolution": 2048,
              "StatusSensor[1].AbsEncoderOffset": 137.812}, 179.9995),
            ({"Sensor[1].Type": 1, "Sensor[1].Parameter.StepsPerRevolution": 4096}, 0.5859375),
            ({"Sensor[1].Type": 0, "Sensor[1].Parameter.StepsPerRevolution": 4096}, 0.0),
        ],
        ids=["rotary with offset", "linear", "incremental"],
    )  # fmt: skip
    def test_position_at_power_on(self, make_rig, mode, settings, position):
        """An absolute encoder shows 240 increments and its offset at power-on, an incremental one 0."""
        rig = make_rig(variables=mode | settings)
        rig.cycles(1)
        assert rig.axis.var("ActualPosition") == pytest.approx(position, abs=0.0001)

    @BOTH
    def test_without_position_control(self, make_rig, mode):
        """A motion without position control moves such an axis too, and positioning goes on from where it
        is.
        """
        rig = make_rig(variables=mode).enabled()
        rig.until(rig.axis.home(0.0).done)
        job = rig.axis.move_velocity(100.0, PositionControlled=False)
        rig.until(job.in_velocity)
        rig.run(1.0)
        place = rig.axis.var("ActualPosition")
        assert place > 100.0
        assert rig.axis.var("ActualVelocity") == pytest.approx(100.0)
        move = rig.axis.move_absolute(50.0)
        rig.until(move.done, 10.0)
        assert rig.axis.var("ActualPosition") == pytest.approx(50.0, abs=0.01)

    @BOTH
    def test_a_ramp_from_the_actual_values_begins_without_a_step(self, make_rig, mode):
        """A stop that begins with the actual values goes on from where the axis is in every cycle."""
        late = {"DynamicAxisModel.AdditionalPositionTimeConstant": 0.008}
        rig = make_rig(variables=mode | late)
        ramp(rig)
        rig.axis.power(False, stop_mode=0)
        rig.run(0.02)
        steps = np.diff(rig.column("actual_position"))[-10:]
        assert steps[0] == pytest.approx(0.4, abs=1e-6)
        assert (np.diff(steps) < 1e-9).all()
        assert (np.diff(steps) > -0.1).all()


class TestVirtual:
    """The virtual axis from technology version 8.0 on."""

    @pytest.mark.requirement(
        "CFG-151",
        "SYN-078",
        "CFG-138",
        "CFG-139",
        "CFG-140",
        "CFG-141",
        "CFG-142",
        "CFG-143",
        "CFG-144",
        "CFG-145",
        "CFG-146",
        "CFG-147",
        "VAR-128",
    )
    def test_setpoints_repeated(self, make_rig):
        """After `MC_Interpolator` actual values repeat the setpoints of two cycles ago, one of them the delay
        of the axis (CFG-151); what a loop would show is 0 in every cycle.
        """
        rig = make_rig(variables=VIRTUAL).enabled()
        setpoints = ("Position", "Position", "Velocity", "Velocity", "Acceleration")
        actual = (
            "ActualPosition",
            "StatusSensor[1].Position",
            "ActualVelocity",
            "StatusSensor[1].Velocity",
            "ActualAcceleration",
        )
        nothing = (
            "ActualSpeed",
            "VelocitySetpoint",
            "StatusServo.ControlDifference",
            "StatusServo.BalancedPosition",
        )
        rows = {paths: [] for paths in (setpoints, actual, nothing)}

        def look():
            for paths, found in rows.items():
                found.append([rig.axis.var(path) for path in paths])

        rig.runtime.after_cycle.append(look)
        rig.axis.home(5.0)
        rig.axis.move_relative(30.0)
        rig.run(1.0)
        assert np.array(rows[actual])[3:] == pytest.approx(np.array(rows[setpoints])[1:-2], abs=1e-9)
        assert (np.ptp(rows[actual], axis=0) > 20.0).all()
        assert not np.any(rows[nothing])
        assert rig.axis.var("StatusSensor[1].Adjusted") == 1

    @pytest.mark.requirement("CFG-148", "VAR-128")
    def test_control_does_not_matter(self, make_rig):
        """Gains and time constants do not change the actual values."""
        paths = []
        for gains in (
            {},
            {
                "PositionControl.Kv": 3.0,
                "PositionControl.Kpc": 20.0,
                "DynamicAxisModel.VelocityTimeConstant": 0.02,
            },
        ):
            rig = make_rig(variables=VIRTUAL | gains)
            ramp(rig)
            paths.append(rig.column("actual_position"))
        assert paths[0] == paths[1]

    @pytest.mark.requirement("CFG-127", "VAR-014")
    def test_only_by_download(self, make_rig):
        """`VirtualAxis.Mode` cannot be changed while the controller runs."""
        rig = make_rig()
        with pytest.raises(Exception, match="read only"):
            rig.axis.write("VirtualAxis.Mode", 1)
        with pytest.raises(Exception, match="read only"):
            rig.axis.variables.write_start("VirtualAxis.Mode", 1)

    @pytest.mark.requirement("CFG-128", "VAR-128")
    def test_not_homed_after_power_on(self, make_rig):
        """A virtual axis with an absolute encoder has to be homed after power-on although it counts as
        adjusted.
        """
        rig = make_rig(variables=VIRTUAL | {"Sensor[1].Type": 1}).enabled()
        assert (rig.axis.var("StatusWord.X5"), rig.axis.var("StatusSensor[1].Adjusted")) == (False, 1)
        job = rig.axis.move_absolute(10.0)
        rig.cycles(2)
        assert job.ErrorID == 0x8001


class TestSimulated:
    """Simulation by the control loop and a simplified drive."""

    @pytest.mark.requirement(
        "CTL-016", "CFG-166", "CFG-167", "CFG-168", "CFG-170", "CFG-171", "VAR-127", "CFG-137",
        "SYN-079",
    )  # fmt: skip
    @pytest.mark.parametrize(
        ("settings", "delay_s"),
        [
            (
                {"PositionControl.Kpc": 100.0, "DynamicAxisModel.VelocityTimeConstant": 0.003},
                0.004 + 0.004 + 0.003,
            ),
            (
                {
                    "PositionControl.Kpc": 100.0,
                    "DynamicAxisModel.VelocityTimeConstant": 0.003,
                    "DynamicAxisModel.AdditionalPositionTimeConstant": 0.006,
                },
                0.004 + 0.004 + 0.003 + 0.006,
            ),
            ({"PositionControl.Kpc": 0.0, "PositionControl.Kv": 100.0}, 0.004 + 0.010),
            (
                {
                    "PositionControl.Kpc": 0.0,
                    "PositionControl.Kv": 100.0,
                    "DynamicAxisModel.AdditionalPositionTimeConstant": 0.006,
                },
                0.004 + 0.010 + 0.006,
            ),
            (
                {"PositionControl.Kpc": 0.0, "PositionControl.Kv": 100.0, "PositionControl.EnableDSC": True},
                0.004 + 0.004 + 0.010,
            ),
        ],
        ids=["precontrol", "precontrol and additional", "without", "without, and additional", "without, DSC"],
    )
    def test_lag(self, make_rig, settings, delay_s):
        """At constant velocity the actual position lags by the velocity times the delay of the model."""
        rig = make_rig(variables=SIMULATED | settings)
        ramp(rig)
        lag = rig.axis.var("Position") - rig.axis.var("ActualPosition")
        assert lag == pytest.approx(100.0 * delay_s, rel=1e-3)

    @pytest.mark.requirement("CFG-156", "CFG-158", "VAR-014")
    def test_by_restart(self, make_rig):
        """`Simulation.Mode` is changed in load memory and takes effect with a restart, in both directions."""
        rig = make_rig()
        rig.port.link = False
        rig.axis.power()
        rig.run(0.1)
        assert rig.axis.var("StatusWord.X0") is False
        rig.axis.power(False)
        for mode in (1, 0):
            rig.cycles(2)
            rig.axis.variables.write_start("Simulation.Mode", mode)
            rig.until(rig.axis.reset(restart=True).done)
            rig.axis.power()
            rig.run(0.1)
            assert rig.axis.var("StatusWord.X0") is bool(mode)
            assert rig.axis.var("StatusWord.X25") is bool(mode)
            rig.axis.power(False)
            rig.run(0.1)

    def test_speed_axis(self, make_rig):
        """A simulated speed axis reaches its speed without a drive."""
        rig = make_rig(speed=True, variables=SIMULATED)
        rig.port.link = False
        rig.enabled()
        job = rig.axis.move_velocity(600.0)
        rig.until(job.in_velocity)
        rig.cycles(2)
        assert rig.axis.var("ActualSpeed") == pytest.approx(600.0)
