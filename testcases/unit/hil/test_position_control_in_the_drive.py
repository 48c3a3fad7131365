"""Position control in the drive and in the controller on emulated drives: disturbance, gain, lost telegrams,
what changes meanwhile.
"""

from __future__ import annotations

from dataclasses import replace
from math import exp, pi

import numpy as np
import pytest

from emulators.drive.profidrive import ProfidriveConfig
from emulators.drive.profidrive.parameters.drive_parameters import DriveParameters
from fieldbus.profidrive.errors import ParameterAccessError
from fieldbus.profidrive.formats import to_n2
from hil.faults import Injector
from testcases.unit.emulators_profidrive.profidrive_rig import RUN, Rig
from testcases.unit.hil.test_hil_profidrive import CYCLE_S, bench, enabled
from testcases.unit.hil.test_torque_instructions import torque_bench

pytestmark = pytest.mark.exhaustive

DSC = "PositionControl.EnableDSC"
LOOSE = {"FollowingError.EnableMonitoring": False, "PositioningMonitoring.ToleranceTime": 60.0}


def control(*, dsc=True, kv=20.0, kpc=100.0, **more):
    own = {"PositionControl.Kv": kv, "PositionControl.Kpc": kpc, DSC: dsc, **more}
    return LOOSE | own


def true_position(machine, since):
    signal = machine.trace()["drive1.position"]
    times = np.array(signal.time_s)
    return times[times > since], np.array(signal.values)[times > since] * 1e3


@pytest.mark.requirement("CTL-034", "CTL-027")
def test_a_load_step_is_countered_sooner_in_the_drive():
    """The same gain against a force of 400 N: the load is displaced less by the loop in the drive than by
    that in the controller.
    """
    peaks = []
    for dsc in (False, True):
        with bench(variables=control(dsc=dsc, kv=60.0)) as machine:
            enabled(machine)
            machine.run_for(0.2)
            began = machine.now_s
            _, before = true_position(machine, began - 0.05)
            Injector(machine).inject("mechanics.load_step", "drive1", force_N=400.0)
            machine.run_for(0.3)
            _, after = true_position(machine, began)
            peaks.append(abs(after - before[-1]).max())
    assert peaks[1] < 0.9 * peaks[0]
    assert peaks[1] > 0.001


@pytest.mark.requirement("CTL-034")
def test_a_gain_that_only_the_drive_can_bear():
    """Kv = 250 1/s at 4 ms and a cycle of dead time each way: the loop of the controller oscillates, that of
    the drive is stable.
    """
    swing = []
    for dsc in (False, True):
        with bench(variables=control(dsc=dsc, kv=250.0), velocity_time_constant_ms=0.8) as machine:
            axis = enabled(machine)
            axis.move_relative(5.0, Velocity=50.0)
            machine.run_for(1.0)
            _, position = true_position(machine, machine.now_s - 0.2)
            swing.append(position.max() - position.min())
    assert swing[0] > 0.5
    assert swing[1] < 0.01


@pytest.mark.requirement("CTL-032", "CTL-100")
def test_a_drive_without_telegrams_holds_its_last_reference():
    """The controller's telegrams stop while DSC holds the position: it is held against a force until the
    drive's own fault acts.
    """
    with bench(
        variables=control(kv=60.0), profidrive={"setpoint_monitoring_ms": 400.0, "sign_of_life": True}
    ) as machine:
        enabled(machine)
        machine.drive().parameters.write("925", 65535)
        machine.run_for(0.2)
        drive = machine.drive()
        place = drive.mechanics.position * 1e3
        began = machine.now_s
        Injector(machine).inject("frame.drop", "can0", drive="drive1", message="rpdo1")
        machine.run_for(3 * CYCLE_S)
        Injector(machine).inject("mechanics.load_step", "drive1", force_N=300.0)
        machine.run_for(0.3)
        assert drive.core.enabled
        assert drive.mechanics.position * 1e3 == pytest.approx(place, abs=0.2)
        machine.run_for(0.4)
        faults = [
            event for event in machine.history.select(kind="drive.fault") if event.time_ns * 1e-9 > began
        ]
        assert len(faults) == 1
        assert faults[0].time_ns * 1e-9 - began == pytest.approx(0.4, abs=3 * CYCLE_S)


@pytest.mark.requirement("CTL-007", "CTL-029", "CTL-008")
@pytest.mark.parametrize("smoothing", [0.0, 0.05])
def test_a_change_of_the_gain_in_the_drive_can_be_smoothed(smoothing):
    """Kv from 10 to 20 at 100 mm/s without precontrol: KPC changes at once, the speed doubles; smoothed a
    third of that is left.

    That rest is the drive's: it takes the new gain at once and reaches the new reference within the bus
    cycle.
    """
    own = control(kv=10.0, kpc=0.0, **{"PositionControl.SmoothingTimeByChangeDifference": smoothing})
    with bench(variables=own) as machine:
        axis = enabled(machine)
        axis.move_velocity(100.0)
        machine.run_for(1.2)
        began = machine.now_s
        axis.write("PositionControl.Kv", 20.0)
        machine.run_for(0.5)
        trace = machine.trace()
        speed = trace["axis1.actual_velocity"].between(began, machine.now_s).values
        gain = trace["drive1.kpc"].between(began, machine.now_s).values
        assert (gain[0], gain[-1]) == (10_000.0, 20_000.0)
        assert set(gain) == {10_000.0, 20_000.0}
        if smoothing:
            assert max(speed) < 140.0
        else:
            assert max(speed) > 160.0
        assert axis.var("StatusPositioning.FollowingError") == pytest.approx(5.0, rel=0.02)


@pytest.mark.requirement("CTL-007", "CTL-029")
def test_a_change_of_the_gain_with_precontrol_is_no_disturbance():
    """With 100 % there is nothing for the gain to correct but the way of the transport, which is no
    deviation.
    """
    own = control(kv=10.0, **{"PositionControl.SmoothingTimeByChangeDifference": 0.05})
    with bench(variables=own) as machine:
        axis = enabled(machine)
        axis.move_velocity(100.0)
        machine.run_for(0.6)
        began = machine.now_s
        for gain in (40.0, 5.0, 20.0):
            axis.write("PositionControl.Kv", gain)
            machine.run_for(0.2)
        speed = machine.trace()["axis1.actual_velocity"].between(began, machine.now_s).values
        assert max(abs(value - 100.0) for value in speed) < 2.0


@pytest.mark.requirement("CTL-047", "CTL-029")
@pytest.mark.parametrize(("way", "acts"), [(0.03, False), (0.07, True)])
def test_quantisation_acts_on_what_the_drive_gets(way, acts):
    """Mode 2 with 0.05 mm: a setpoint 0.03 mm away is XERR 0 and moves nothing, one 0.07 mm away is 0.05
    mm.
    """
    mode = "PositionControl.ControlDifferenceQuantization"
    own = control(kpc=0.0, **{f"{mode}.Mode": 2, f"{mode}.Value": 0.05})
    with bench(variables=own) as machine:
        axis = enabled(machine)
        machine.run_for(0.2)
        began = machine.now_s
        assert machine.run_until(axis.move_relative(way).done, 2.0)
        machine.run_for(0.3)
        sent = machine.trace()["drive1.xerr"].between(began, machine.now_s).values
        assert set(sent) == ({0.0, round(0.05 * 2048 * 2048 / 10.0)} if acts else {0.0})
        assert (axis.var("ActualPosition") > 0.01) is acts
        assert axis.var("StatusServo.ControlDifference") == 0.0


@pytest.mark.requirement("CTL-085", "CTL-093", "CTL-094", "CTL-033")
@pytest.mark.parametrize("dsc", [False, True])
def test_the_loop_is_opened_and_closed_on_the_way(dsc):
    """At 100 mm/s off, on, off, on: the speed of the machine stays within 3 mm/s, and no position is made up
    for.
    """
    with bench(variables=control(dsc=dsc, kv=40.0)) as machine:
        axis = enabled(machine)
        axis.move_velocity(100.0)
        machine.run_for(0.5)
        began = machine.now_s
        for closed in (False, True, False, True):
            axis.move_velocity(100.0, PositionControlled=closed)
            machine.run_for(0.15)
            assert axis.var("StatusWord.X28") is not closed
        speed = machine.trace()["drive1.velocity"].between(began, machine.now_s).values
        assert max(abs(value * 1e3 - 100.0) for value in speed) < 3.0
        assert not list(machine.history.select(kind="alarm.raised"))


@pytest.mark.requirement("CTL-092")
@pytest.mark.parametrize("closed", [True, False])
def test_a_torque_limit_stays_without_position_control(closed):
    """0.3 Nm of MC_TorqueLimiting bounds the torque with and without position control, and after the
    change.
    """
    with torque_bench(**control(dsc=False)) as machine:
        axis = enabled(machine)
        axis.torque_limiting(0.3)
        axis.move_velocity(300.0, Acceleration=2000.0, Jerk=0.0, PositionControlled=not closed)
        machine.run_for(0.1)
        began = machine.now_s
        axis.move_velocity(
            -300.0, Acceleration=2000.0, Deceleration=2000.0, Jerk=0.0, PositionControlled=closed
        )
        machine.run_for(0.3)
        torque = machine.trace()["drive1.torque"].between(began, machine.now_s).values
        assert max(abs(value) for value in torque) == pytest.approx(0.3, abs=0.01)
        assert axis.var("StatusWord.X26")


# -- the drive
# ------------------------------------------------------------------------------------------------------------


@pytest.mark.requirement("CTL-100", "CTL-015")
@pytest.mark.parametrize("lag_s", [0.004, 0.02])
def test_the_speed_loop_is_a_lag_of_first_order(lag_s):
    """A step of the speed setpoint is followed as 1 - exp(-t / T_vtc)."""
    config = ProfidriveConfig.reference()
    tuning = replace(
        config.tuning,
        velocity_time_constant_ms=lag_s * 1000.0,
        torque_precontrol=False,
        velocity_integral_time_s=0.0,
    )
    smooth = replace(config.mechanics, coulomb_friction_n=0.0, viscous_friction_n_per_m_s=0.0)
    rig = Rig(replace(config, tuning=tuning, interpolation=False, mechanics=smooth))
    rig.enable()
    for cycle in range(1, 11):
        rig.cycle(RUN, **rig.speed(300.0))
        expected = 300.0 * (1.0 - exp(-cycle * CYCLE_S / lag_s))
        assert rig.drive.core.speed_rpm == pytest.approx(
            expected, abs=600.0 * config.servo_period_ns / 1e9 / lag_s
        )


@pytest.mark.requirement("CTL-058", "CTL-102", "CTL-057")
def test_the_additive_torque_between_two_telegrams():
    """p1409.0 = 1: M_ADD is reached in a straight line within the bus cycle; 0: at once. The other parameters
    are kept.
    """
    config = replace(ProfidriveConfig.reference(), torque_telegram=True)
    for interpolates in (False, True):
        rig = Rig(config)
        parameters = DriveParameters(rig.drive)
        for name, value in (("p1400", 0x400), ("p1428", 2.0), ("p1429", 0.0), ("p5271", 0x10)):
            parameters.write(name, value)
            assert parameters.read(name) == value
        parameters.write("p1409", int(interpolates))
        rig.enable()
        rig.drive.receive(rig.drive.telegram.setpoint.encode({"STW1": RUN, "M_ADD1": to_n2(0.5)}))
        rig.drive.cycle()
        steps = config.cycle_ns // config.servo_period_ns
        offsets = []
        for _ in range(steps):
            rig.scheduler.run_for(config.servo_period_ns)
            offsets.append(rig.drive.core.torque_offset)
        whole = 0.5 * config.settings.reference_torque_nm
        expected = [whole * (at + 1) / steps if interpolates else whole for at in range(steps)]
        assert offsets == pytest.approx(expected, abs=1e-3)


@pytest.mark.requirement("CTL-102")
def test_what_an_axis_can_read_of_its_drive():
    """Every parameter that the control loop needs answers, and shows what the drive is."""
    with bench() as machine:
        parameters = machine.drive().parameters
        config = machine.drive().drive.config
        assert parameters.read("p0115") == config.servo_period_ns / 1e3
        assert parameters.read("p0341") == pytest.approx(config.mechanics.motor_inertia_kgm2)
        assert parameters.read("p1498") == pytest.approx(config.mechanics.load_at_motor_kgm2)
        assert (parameters.read("p2000"), parameters.read("p1082"), parameters.read("p2003")) == (
            3000.0,
            3000.0,
            2.0,
        )
        assert parameters.read("r5277") == pytest.approx(2.0)
        for name in ("r5276", "p490", "p495", "p1400", "p1409", "p1428", "p1429", "p5271"):
            assert parameters.read(name) >= 0.0
        with pytest.raises(ParameterAccessError):
            parameters.write("p0115", 62.5)


@pytest.mark.requirement("CTL-045")
@pytest.mark.parametrize("name", ["profidrive", "reference"])
def test_gains_of_the_drive_are_its_own(name):
    """Whatever the axis is configured to assume of its control loop, the speed controller of the drive stays
    as it is.
    """
    with bench(name, variables=LOOSE | {"PositioningMonitoring.Window": 1.0}) as machine:
        axis = enabled(machine)
        core = machine.drive().core
        before = core.tuning, core._proportional_gain, core._integral_gain
        axis.write("PositionControl.Kv", 60.0)
        axis.write("PositionControl.Kpc", 30.0)
        axis.write("DynamicAxisModel.VelocityTimeConstant", 0.05)
        assert machine.run_until(axis.move_relative(20.0).done, 3.0)
        axis.power(False)
        machine.run_for(0.2)
        axis.variables.write_start("PositionControl.Kv", 80.0)
        assert machine.run_until(axis.reset(restart=True).done, 2.0)
        machine.run_for(0.2)
        assert (core.tuning, core._proportional_gain, core._integral_gain) == before


@pytest.mark.requirement("CTL-098", "CTL-097")
@pytest.mark.parametrize("dsc", [False, True])
def test_safe_stop_2_and_safe_torque_off(dsc):
    """SS2 stops with the OFF3 ramp and resists a push; STO lets friction alone brake, whatever ramp there
    is.
    """
    for kind in ("safety.ss2", "drive.sto"):
        with bench(variables=control(dsc=dsc)) as machine:
            axis = enabled(machine)
            axis.move_velocity(300.0)
            machine.run_for(0.8)
            began = machine.now_s
            Injector(machine).inject(kind, "drive1")
            machine.run_for(0.5)
            trace = machine.trace()
            torque = trace["drive1.torque"].between(began + 2 * CYCLE_S, machine.now_s).values
            drive = machine.drive()
            if kind == "drive.sto":
                assert not any(torque)
                velocity = trace["drive1.velocity"]
                first, second = velocity.at(began + 0.02), velocity.at(began + 0.12)
                mass = drive.mechanics.motor_inertia / drive.mechanics.ratio**2
                friction = 30.0 + 30.0 * 0.5 * (first + second)
                assert (first - second) / 0.1 == pytest.approx(friction / mass, rel=0.05)
                assert drive.mechanics.velocity > 0.1
                continue
            stop = trace["drive1.velocity"].between(began, began + 0.5)
            moving = [t for t, v in zip(stop.time_s, stop.values, strict=True) if abs(v) > 0.001]
            assert moving[-1] - began == pytest.approx(0.5 * 300.0 / 500.0, abs=3 * CYCLE_S)
            place = drive.mechanics.position
            Injector(machine).inject("mechanics.load_step", "drive1", force_N=200.0)
            machine.run_for(0.3)
            assert abs(drive.mechanics.position - place) < 0.002
            assert abs(drive.core.torque) == pytest.approx((200.0 - 0.0) * 0.010 / (2 * pi), rel=0.25)
            assert drive.core.enabled
