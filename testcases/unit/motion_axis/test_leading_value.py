"""Extrapolated actual value and delayed setpoint, as the data block shows them (§4.3, §4.4)."""

from __future__ import annotations

from types import SimpleNamespace

import pytest

from motion.drives.simulated import SimulatedDrivePort
from motion.kernel.leading_value import Hysteresis, within_band
from motion.s7.axis.assembly import leading_value_of
from motion.s7.axis.external_encoder import ExternalEncoder
from motion.s7.variables import VariableStore
from testcases.unit.motion_axis.conftest import CYCLE

E, STATUS = "Extrapolation.", "StatusExtrapolation."
GIVEN = "StatusProvidedLeadingValue.DelayedLeadingValue."


def make(feedback, acquisition_s=0.0, cycle_s=CYCLE, **variables):
    store = VariableStore(
        "PositioningAxis", {path.replace("__", "."): value for path, value in variables.items()}
    )
    return leading_value_of(
        store,
        cycle_s=cycle_s,
        acquisition_s=acquisition_s,
        feedback=lambda: feedback,
        setpoint=lambda: (feedback.position, feedback.velocity, 0.0),
    )


@pytest.mark.requirement("SYN-062", "SYN-052", "VAR-189")
def test_printed_extrapolation():
    """100 mm and 50 mm/s, with 6 ms of the leading and 12 ms of the following axis: 100.9 mm."""
    feedback = SimpleNamespace(position=100.0, velocity=50.0)
    leading = make(feedback, 0.002, **{f"{E}FollowingAxisDependentTime": 0.012})
    assert leading.in_use() is None
    assert leading.leading_time_s == pytest.approx(0.006)
    assert leading.position == pytest.approx(100.9)
    assert (leading.filtered_position, leading.velocity) == (100.0, 50.0)


@pytest.mark.requirement("SYN-054", "SYN-056", "SYN-066", "VAR-189")
@pytest.mark.parametrize("system", [0, 1])
def test_system_defined_extrapolation(system):
    """0: no position filter, and the time of the following axis alone; 1: the filter delays, and its times
    are made up for.
    """
    feedback = SimpleNamespace(position=0.0, velocity=100.0)
    leading = make(
        feedback,
        **{
            f"{E}Settings.SystemDefinedExtrapolation": system,
            f"{E}PositionFilter.T1": 0.02,
            f"{E}PositionFilter.T2": 0.02,
            f"{E}FollowingAxisDependentTime": 0.012,
        },
    )
    for _ in range(200):
        feedback.position += 0.4
        leading.step()
    assert leading.time_s == pytest.approx(0.012 + system * 0.044)
    assert leading.filtered_position == pytest.approx(feedback.position - system * 4.0, abs=1e-6)
    assert leading.position == pytest.approx(feedback.position + 1.2 + system * 0.4, abs=1e-6)


@pytest.mark.requirement("SYN-064")
def test_tolerance_band():
    """A band of 2.0 around the last velocity; beyond it the value less half the band."""
    last, found = 10.0, []
    for value in (10.0, 10.5, 11.5, 10.2, 9.0):
        last = within_band(last, value, 2.0)
        found.append(last)
    assert found == [10.0, 10.0, 10.5, 10.5, 10.0]


@pytest.mark.requirement("SYN-065")
def test_hysteresis():
    """A reversal of less than 0.5 does not pass."""
    hysteresis = Hysteresis(0.0)
    given = (0.0, 1.0, 2.0, 1.8, 1.6, 1.5, 1.4, 1.6, 1.9)
    assert [hysteresis.step(value, 0.5) for value in given] == [0.0, 1.0, 2.0, 2.0, 2.0, 1.5, 1.4, 1.4, 1.9]


@pytest.mark.requirement("SYN-055", "SYN-057", "SYN-058", "SYN-059", "SYN-067", "VAR-122")
@pytest.mark.parametrize("mode", [0, 1])
def test_velocity_of_the_extrapolated_value(make_rig, mode):
    """The filtered actual velocity, or what the extrapolated position does: nothing while the hysteresis
    holds it.
    """
    rig = make_rig(variables={f"{E}Settings.ExtrapolatedVelocityMode": mode})
    rig.travelling(100.0)
    assert rig.axis.var(f"{STATUS}ExtrapolatedVelocity") == pytest.approx(100.0, rel=1e-3)
    rig.axis.write(f"{E}VelocityFilter.T1", 0.1)
    rig.axis.write(f"{E}Hysteresis.Value", 50.0)
    job = rig.axis.move_velocity(-100.0, Acceleration=2000.0, Deceleration=2000.0, Jerk=0.0)
    rig.until(lambda: rig.axis.var("ActualVelocity") < -99.0)
    shown = rig.axis.var(f"{STATUS}ExtrapolatedVelocity")
    filtered = rig.axis.var(f"{STATUS}FilteredVelocity")
    assert filtered > -80.0
    assert shown == (0.0 if mode else filtered)
    rig.until(job.in_velocity)
    rig.run(2.0)
    assert rig.axis.var(f"{STATUS}ExtrapolatedVelocity") == pytest.approx(-100.0, rel=1e-3)
    rig.axis.write(f"{E}VelocityTolerance.Range", 60.0)
    rig.until(rig.axis.halt().done)
    rig.run(1.0)
    assert rig.axis.var(f"{STATUS}FilteredVelocity") == pytest.approx(-30.0, abs=1.0)


@pytest.mark.requirement("SYN-053", "SYN-060", "SYN-389", "SYN-390", "VAR-122")
def test_time_of_the_following_axis(rig):
    """At constant velocity the value is the position after that time; a change of the time is a step of v *
    dt.
    """
    rig.travelling(100.0)
    rig.axis.home(0.0)
    rig.cycles(4)
    ahead = rig.axis.var(f"{STATUS}ExtrapolatedPosition") - rig.axis.var("ActualPosition")
    assert ahead == pytest.approx(100.0 * rig.axis.var(f"{E}LeadingAxisDependentTime"), rel=1e-3)
    rig.axis.write(f"{E}FollowingAxisDependentTime", 0.05)
    rig.cycles(1)
    stepped = rig.axis.var(f"{STATUS}ExtrapolatedPosition") - rig.axis.var("ActualPosition")
    assert stepped - ahead == pytest.approx(5.0, rel=1e-3)
    predicted = rig.axis.var(f"{STATUS}ExtrapolatedPosition")
    rig.run(0.052)
    assert predicted == pytest.approx(rig.axis.var("ActualPosition") + 0.2, abs=0.3)


@pytest.mark.requirement("SYN-070", "VAR-121")
@pytest.mark.parametrize("delay", [0.008, 0.01])
def test_delayed_leading_value(make_rig, delay):
    """8 ms at 100 mm/s are 0.8 mm behind `Position`; so is a part of a cycle."""
    rig = make_rig(variables={"CrossPlcSynchronousOperation.LocalLeadingValueDelayTime": delay})
    rig.travelling(100.0)
    behind = rig.axis.var("Position") - rig.axis.var(f"{GIVEN}Position")
    assert behind == pytest.approx(100.0 * delay)
    assert rig.axis.var(f"{GIVEN}Velocity") == pytest.approx(100.0)
    rig.until(rig.axis.home(-500.0).done)
    assert rig.axis.var("Position") - rig.axis.var(f"{GIVEN}Position") == pytest.approx(behind, rel=1e-6)
    rig.until(rig.axis.halt(Jerk=0.0).done)
    rig.run(0.1)
    assert rig.axis.var(f"{GIVEN}Position") == rig.axis.var("Position")


@pytest.mark.requirement("CTL-025", "SYN-061", "SYN-063", "VAR-115")
def test_setpoint_execution_time(make_rig):
    """T_ipo 4 ms, T_o 1 ms, T_DC 2 ms, and 3 ms of T_vtc or 1 / Kv = 100 ms: 10 and 107 ms."""
    rig = make_rig(
        variables={
            "PositionControl.Kv": 10.0,
            "DynamicAxisModel.VelocityTimeConstant": 0.003,
            "PositionControl.Kpc": 100.0,
        }
    )
    axis = rig.axis.object
    axis.connection = "data_block"
    for number, time in ((1010, 0.005), (1011, 0.001), (1012, 0.002)):
        axis.variables.write_parameter(number, time)
    axis.variables.restart()
    axis.apply_configuration()
    assert rig.axis.var("StatusPositioning.SetpointExecutionTime") == pytest.approx(0.010)
    rig.axis.write("PositionControl.Kpc", 0.0)
    rig.cycles(1)
    assert rig.axis.var("StatusPositioning.SetpointExecutionTime") == pytest.approx(0.107)


@pytest.mark.requirement("VAR-121", "VAR-122", "SYN-003")
def test_external_encoder():
    """An external encoder extrapolates its actual value as well, and delays it."""
    port = SimulatedDrivePort(cycle_s=CYCLE)
    variables = {
        f"{E}FollowingAxisDependentTime": 0.1,
        "CrossPlcSynchronousOperation.LocalLeadingValueDelayTime": 0.008,
        "Sensor.Parameter.StepsPerRevolution": 131072,
        "Sensor.Parameter.FineResolutionXist1": 0,
    }
    encoder = ExternalEncoder("encoder1", port, cycle_ns=4_000_000, variables=variables)
    for _ in range(50):
        port.turn(0.05)
        encoder.cycle()
    velocity = encoder.var("ActualVelocity")
    assert velocity == pytest.approx(0.05 / 6.283185307179586 * 10.0 / CYCLE, rel=1e-3)
    position = encoder.var("ActualPosition")
    assert encoder.var(f"{STATUS}ExtrapolatedPosition") - position == pytest.approx(
        velocity * 0.106, rel=1e-3
    )
    assert position - encoder.var(f"{GIVEN}Position") == pytest.approx(velocity * 0.008, rel=1e-2)
