"""The signal flow of position control, node by node: each is computed again from its recorded inputs
(appendix A.1, section 4.4).
"""

from __future__ import annotations

from itertools import pairwise
from math import exp, tau

import numpy as np
import pytest

from fieldbus.profidrive import to_n4
from fieldbus.profidrive.formats import to_n2
from testcases.unit.hil.test_hil_profidrive import CYCLE_S, bench, enabled

pytestmark = pytest.mark.exhaustive

KV, LAG_S = 25.0, 0.012
RPM_PER_UNIT = 6.0
DELAY = 2
"""T_i + T_o + T_DC + T_servo of the buses, cycles."""
FILTERS = {
    "none": (0, 0.0, 0.0, 0.0),
    "low-pass": (1, 0.02, 0.01, 0.006),
    "average": (2, 0.012, 0.006, 0.008),
}
SLOPE = 1000.0


def settings(*, dsc, kpc, filtering="none", additional=0.0, **more):
    mode, t1, t2, tt = FILTERS[filtering]
    prefix = "SetpointFilter.DynamicFilter."
    return (
        {
            "PositionControl.Kv": KV,
            "PositionControl.Kpc": kpc,
            "DynamicAxisModel.VelocityTimeConstant": LAG_S,
            "FollowingError.EnableMonitoring": False,
            "FollowingError.AdditionalSetpointDelayTime": additional,
            f"{prefix}Mode": mode,
            f"{prefix}T1": t1,
            f"{prefix}T2": t2,
            f"{prefix}Tt": tt,
        }
        | ({"PositionControl.EnableDSC": True} if dsc else {})
        | more
    )


class Recording:
    """Signals of a move there and halfway back, one value per application cycle, from before the first motion
    on.
    """

    def __init__(self, name, *, jerk=0.0, profidrive=(), **variables):
        with bench(name, variables=variables, profidrive=dict(profidrive)) as machine:
            axis = enabled(machine)
            machine.run_for(0.1)
            counts = []
            machine.on_cycle(lambda: counts.append(axis.port.encoder_increments))
            began = machine.now_s
            assert machine.run_until(axis.move_relative(40.0, Velocity=200.0, Jerk=jerk).done, 3.0)
            axis.move_relative(-30.0, Velocity=100.0, Acceleration=500.0, Jerk=jerk)
            machine.run_for(0.25)
            self._trace = machine.trace()
            self._from = began
            self.counts = np.array(counts)
            self.increment = axis.object.mechanics.increment

    def __getattr__(self, name):
        signal = self._trace[f"axis1.{name}"]
        return np.array(signal.values)[np.array(signal.time_s) > self._from]

    def received(self, name):
        """Return what the drive has of the words that the axis has sent in each cycle but the last one.

        They are taken over half a cycle later, and recorded at the end of the cycle that begins then.
        """
        signal = self._trace[f"drive1.{name}"]
        shown = dict(zip(np.round(np.array(signal.time_s) / CYCLE_S).astype(int), signal.values, strict=True))
        times = np.array(self._trace["axis1.speed_output"].time_s)
        sent = np.round(times[times > self._from] / CYCLE_S + 1.5).astype(int)
        return np.array([shown[at] for at in sent[:-2]])


def lagged(values, constant):
    """Return what a first-order lag makes of values between which the input goes in a straight line."""
    decay = exp(-CYCLE_S / constant)
    out = [values[0]]
    for before, now in pairwise(values):
        behind = (now - before) / CYCLE_S * constant
        out.append(now - behind + (out[-1] - before + behind) * decay)
    return np.array(out)


def late(values, seconds):
    """Return values that come later by a time, whole cycles or not."""
    at = np.arange(len(values)) - seconds / CYCLE_S
    return np.interp(at, np.arange(len(values)), values)


def averaged(values, seconds):
    """Return the moving average with the weights of CTL-075."""
    cycles = seconds / CYCLE_S
    whole = int(cycles + 1e-9)
    weights = np.array([1.0] * (whole + 1) + [cycles - whole])
    padded = np.concatenate([np.full(whole + 1, values[0]), values])
    return np.convolve(padded, weights / weights.sum())[whole + 1 : whole + 1 + len(values)]


def filtered(values, filtering):
    mode, t1, t2, tt = FILTERS[filtering]
    if mode == 0:
        return values
    return late(averaged(averaged(values, t1), t2) if mode == 2 else lagged(lagged(values, t1), t2), tt)


@pytest.mark.requirement(
    "CTL-049", "MON-053", "CTL-022", "CTL-023", "CTL-024", "CTL-061", "CTL-038", "CTL-060"
)
@pytest.mark.parametrize("filtering", list(FILTERS))
@pytest.mark.parametrize(("name", "dsc"), [("reference", False), ("profidrive", False), ("profidrive", True)])
@pytest.mark.parametrize("kpc", [0.0, 40.0, 100.0])
def test_every_node_follows_from_the_one_before(name, dsc, kpc, filtering):
    """Filter, balancing, control difference, output and following error, over acceleration, travel, braking
    and reversal.
    """
    run = Recording(name, **settings(dsc=dsc, kpc=kpc, filtering=filtering))
    position, velocity = run.position_setpoint, run.velocity_setpoint
    assert abs(velocity).max() == pytest.approx(200.0)
    x_f = filtered(position, filtering)
    assert run.filtered_position == pytest.approx(x_f, abs=1e-9)

    model = lagged(x_f, LAG_S)
    x_b = x_f - kpc / 100.0 * (x_f - model)
    # The controller knows the velocity at the end of a cycle, this test the way within it.
    assert run.balanced_position == pytest.approx(x_b, abs=SLOPE * CYCLE_S * LAG_S if kpc else 1e-9)

    balanced = run.balanced_position
    reference = balanced[DELAY:-1] if dsc else balanced[: -DELAY - 1]
    difference = run.control_difference[DELAY:-1]
    assert difference == pytest.approx(reference - run.actual_position[DELAY:-1], abs=1e-9)

    precontrol = kpc / 100.0 * filtered(velocity, filtering)[DELAY:-1]
    output = precontrol if dsc else KV * difference + precontrol
    assert run.speed_output[DELAY:-1] == pytest.approx(RPM_PER_UNIT * output, abs=1e-6)

    error = position[: -DELAY - 1] - run.actual_position[DELAY:-1]
    assert run.following_error[DELAY:-1] == pytest.approx(error, abs=1e-9)


@pytest.mark.requirement("CTL-049", "CTL-029", "CTL-027", "VAR-191", "MON-053", "CTL-099")
@pytest.mark.parametrize("dsc", [False, True])
def test_words_of_the_telegram_tell_which_path_is_active(dsc):
    """NSOLL_B is the output of one cycle before, XERR the control difference in increments, KPC the gain;
    both 0 without DSC.
    """
    run = Recording("profidrive", **settings(dsc=dsc, kpc=100.0))
    speed = run.speed_output
    assert list(run.received("nsoll")) == [to_n4(rpm / 3000.0) for rpm in speed[:-2]]
    difference = run.control_difference[:-2] / run.increment
    assert run.received("xerr") == pytest.approx(difference if dsc else 0.0 * difference, abs=0.5001)
    assert abs(difference).max() > 1000.0
    assert set(run.received("kpc")) == {KV * 1000.0 if dsc else 0.0}
    shown = run.counts * run.increment
    origin = shown[0] - run.actual_position[0]
    assert run.actual_position == pytest.approx(shown - origin, abs=1e-9)


@pytest.mark.requirement("CTL-033", "CTL-029")
def test_without_position_control_the_whole_setpoint_is_in_the_telegram():
    """X28 on an axis with DSC: KPC and XERR are 0, NSOLL_B is the full speed; with X28 = FALSE they are
    back.
    """
    with bench(variables=settings(dsc=True, kpc=0.0)) as machine:
        axis = enabled(machine)
        assert machine.run_until(axis.move_velocity(100.0, PositionControlled=False).in_velocity, 2.0)
        machine.run_for(0.1)
        row = dict(
            zip(machine.drive().drive.telegram.setpoint.names, machine.drive().drive.row, strict=False)
        )
        assert (row["KPC"], row["XERR"], row["NSOLL_B"]) == (0, 0, to_n4(600.0 / 3000.0))
        assert machine.run_until(axis.move_velocity(100.0).in_velocity, 2.0)
        machine.run_for(0.5)
        row = dict(
            zip(machine.drive().drive.telegram.setpoint.names, machine.drive().drive.row, strict=False)
        )
        assert row["KPC"] == KV * 1000
        assert row["NSOLL_B"] == 0  # Kpc = 0: the drive makes all of the speed out of XERR
        assert row["XERR"] > 0
        assert axis.var("ActualVelocity") == pytest.approx(100.0, rel=0.01)


@pytest.mark.requirement("CTL-049", "CTL-026", "CTL-051", "CTL-054", "CTL-060")
def test_torque_precontrol_is_the_last_node():
    """M_ADD is inertia times the acceleration behind the filter, one cycle after the setpoints, with and
    without DSC.
    """
    inertia = {
        "TorquePreControl.Mode": 1,
        "TorquePreControl.Scale": 80.0,
        "Actor.LoadInertia": 40.0,
        "Actor.DriveParameter.MotorInertia": 2.5e-4,
    }
    for dsc in (False, True):
        own = settings(dsc=dsc, kpc=100.0, filtering="average", **inertia)
        run = Recording("profidrive", profidrive={"torque_telegram": True}, **own)
        v_f = filtered(run.velocity_setpoint, "average")
        per_radian = 0.010 / tau
        alpha = np.diff(v_f) / CYCLE_S * 1e-3 / per_radian
        torque = 0.8 * (2.5e-4 + 40.0 * per_radian**2) * alpha
        assert run.additive_torque[1:] == pytest.approx(torque, abs=1e-9)
        assert torque.max() > 0.15
        assert run.received("m_add")[1:] == pytest.approx([to_n2(one / 2.0) for one in torque[:-2]], abs=1)


# -- the four combinations, and other couplings
# ---------------------------------------------------------------------------------


def steady(name, *, velocity=100.0, **variables):
    """Return following error and control difference of constant travel with a speed loop of 12 ms, mm."""
    lag = {} if name == "analog" else {"velocity_time_constant_ms": 1e3 * LAG_S}
    if name == "profidrive":
        lag["torque_precontrol"] = False
    with bench(name, variables=variables, **lag) as machine:
        axis = enabled(machine)
        assert machine.run_until(axis.move_velocity(velocity).in_velocity, 2.0)
        machine.run_for(0.8)
        return axis.var("StatusPositioning.FollowingError"), axis.var("StatusServo.ControlDifference")


@pytest.mark.requirement("CTL-103", "MON-033", "MON-035", "CTL-039", "CTL-030", "CTL-037", "MON-055")
@pytest.mark.parametrize("velocity", [100.0, -50.0])
@pytest.mark.parametrize(
    ("name", "dsc"), [("profidrive", False), ("profidrive", True), ("analog", False), ("reference", False)]
)
@pytest.mark.parametrize("kpc", [0.0, 100.0])
def test_following_error_of_constant_travel(name, dsc, kpc, velocity):
    """V / Kv without precontrol; v * T_vtc with it, the drive's lag: with and without DSC. Drives without
    lag: none.
    """
    lag = LAG_S if name == "profidrive" else 0.0
    own = settings(dsc=dsc, kpc=kpc) | {"DynamicAxisModel.VelocityTimeConstant": lag}
    error, difference = steady(name, velocity=velocity, **own)
    expected = velocity * lag if kpc else velocity / KV
    assert error == pytest.approx(expected, rel=0.01, abs=0.03)
    transport = velocity * DELAY * CYCLE_S if dsc else 0.0
    assert difference == pytest.approx(transport + (0.0 if kpc else velocity / KV), rel=0.01, abs=0.03)


@pytest.mark.requirement("CTL-103", "MON-037", "CTL-084", "CTL-074", "CTL-077", "MON-033", "MON-009")
@pytest.mark.parametrize("dsc", [False, True])
@pytest.mark.parametrize("kpc", [0.0, 100.0])
@pytest.mark.parametrize(("filtering", "delay_s"), [("low-pass", 0.036), ("average", 0.0)])
def test_delay_of_the_filter_in_the_following_error(dsc, kpc, filtering, delay_s):
    """The error is larger by velocity times the delay of the filter, and not with that as additional
    delay.
    """
    if filtering == "average":
        # 12 ms are three whole cycles: half of them; of 6 ms the weights 1, 1, 1/2 have their centre at 3.2
        # ms.
        delay_s = 0.006 + CYCLE_S * (1.0 + 2.0 * 0.5) / 2.5 + 0.008
    plain, _ = steady("profidrive", **settings(dsc=dsc, kpc=kpc))
    late_by, _ = steady("profidrive", **settings(dsc=dsc, kpc=kpc, filtering=filtering))
    assert late_by - plain == pytest.approx(100.0 * delay_s, abs=0.01)
    reported, _ = steady("profidrive", **settings(dsc=dsc, kpc=kpc, filtering=filtering, additional=delay_s))
    assert reported == pytest.approx(plain, abs=0.01)
