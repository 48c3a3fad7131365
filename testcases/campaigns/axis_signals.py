"""When an axis says that it has arrived, and that it stands: windows and times of the monitoring, on drives
of either profile.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from hil.campaign import Campaign, CaseContext
from hil.expect import no_alarm, value_at
from testcases.campaigns._reactions import cycles, waited_for_standstill
from testcases.campaigns.support import axis_name, drive_name, enable

CAMPAIGN: Final = Campaign("axis signals", tags=("axis",), bench="reference")


@CAMPAIGN.product(
    "positioned/{distance}",
    parameters={"distance": (40, -40)},
    title="MC_MoveRelative {distance} mm is done after the dwell time in the window",
    requirements=("MON-016", "MON-018"),
)
def positioned(ctx: CaseContext, distance: int) -> None:
    """Done comes when the actual position has been in the window for the dwell time, not before; the axis is
    at its target.
    """
    axis = axis_name(ctx)
    read = ctx.axis.variables.read
    enable(ctx)
    start = float(ctx.trace()[f"{axis}.position_setpoint"].values[-1])
    ctx.do(f"MC_MoveRelative {distance} mm")
    move = ctx.axis.move_relative(float(distance))
    ctx.wait_until(move.done, 5.0, "the motion has ended")
    done = ctx.now_s
    trace = ctx.trace()
    setpoint, actual = trace[f"{axis}.position_setpoint"], trace[f"{axis}.actual_position"]
    target, window = start + distance, float(read("PositioningMonitoring.Window"))
    outside = (np.abs(actual.values - target) > window) | (np.abs(setpoint.values - target) > 1e-6)
    entered = float(actual.time_s[np.flatnonzero(outside)[-1]])
    dwell = float(read("PositioningMonitoring.MinDwellTime"))
    ctx.measure(
        "time in the window before Done",
        done - entered,
        "s",
        low=dwell,
        high=dwell + cycles(ctx, 4),
        requirements=("MON-018",),
    )
    ctx.run_for(0.1)
    ctx.expect(value_at(f"{axis}.actual_position", ctx.now_s, target, tolerance=window), no_alarm(axis=axis))


@CAMPAIGN.case("standstill", requirements=("MON-050",))
def stands(ctx: CaseContext) -> None:
    """StatusWord.X7 rises when the velocity has been below the threshold for the dwell time, not before."""
    axis = axis_name(ctx)
    read = ctx.axis.variables.read
    enable(ctx)
    ctx.do("MC_MoveVelocity 300 mm/s")
    job = ctx.axis.move_velocity(300.0)
    ctx.wait_until(job.in_velocity, 5.0, "constant travel is reached")
    ctx.do("MC_Halt")
    begun = ctx.now_s
    ctx.axis.halt()
    ctx.run_for(1.0)
    waited = waited_for_standstill(
        ctx, axis, f"{axis}.actual_velocity", float(read("StandstillSignal.VelocityThreshold")), since_s=begun
    )
    dwell = float(read("StandstillSignal.MinDwellTime"))
    ctx.measure(
        "time below the threshold before X7",
        waited,
        "s",
        low=dwell,
        high=dwell + cycles(ctx, 2),
        requirements=("MON-050",),
    )


@CAMPAIGN.case("follows", requirements=("CTL-001",))
def follows(ctx: CaseContext) -> None:
    """At constant travel the following error is that of the drive's time constant, and the motor works
    against friction alone.
    """
    axis, drive = axis_name(ctx), drive_name(ctx)
    mechanics = ctx.bench.config.drive[drive].mechanics
    enable(ctx)
    at_rest = _behind(ctx, axis, drive)
    job = ctx.axis.move_velocity(300.0)
    ctx.wait_until(job.in_velocity, 5.0, "constant travel is reached")
    ctx.run_for(0.3)
    error = 300.0 * float(ctx.axis.variables.read("DynamicAxisModel.VelocityTimeConstant"))
    force = mechanics.coulomb_friction_n + mechanics.viscous_friction_n_per_m_s * 0.3
    torque = force * mechanics.lead_screw_mm / 1000.0 / (2.0 * np.pi)
    ctx.expect(
        value_at(f"{axis}.following_error", ctx.now_s, error, tolerance=0.03).covers("CTL-001"),
        value_at(f"{axis}.actual_velocity", ctx.now_s, 300.0, tolerance=1.0),
        value_at(f"{drive}.torque", ctx.now_s, torque, tolerance=0.1 * torque),
    )
    if not str(getattr(ctx.bench.segment(), "kind", "")).startswith("modbus"):
        # Sampled at SYNC and shown in the same cycle; a tenth of a servo period would be seen.
        behind = _behind(ctx, axis, drive) - at_rest
        ctx.measure("actual position behind the machine", behind, "mm", low=-0.01, high=0.01)


def _behind(ctx: CaseContext, axis: str, drive: str) -> float:
    """Return by how much the actual position is behind the true one, and the offset between both, mm."""
    trace = ctx.trace()
    return float(trace[f"{drive}.position"].values[-1]) * 1000.0 - float(
        trace[f"{axis}.actual_position"].values[-1]
    )


@CAMPAIGN.case("shown", requirements=("DIA-092", "DIA-093", "DIA-094", "DIA-096", "DIA-097", "DIA-098"))
def shown(ctx: CaseContext) -> None:
    """What the variables of the axis show is what the setpoint, the machine and the drive do."""
    axis, drive, var = axis_name(ctx), drive_name(ctx), ctx.axis.var
    enable(ctx)
    ctx.wait_until(ctx.axis.home(10.0).done, 2.0, "the axis is homed")

    def near(path: str, wanted: float, within: float, *ids: str) -> None:
        value = float(var(path))
        ctx.measure(path, value, low=wanted - within, high=wanted + within, requirements=ids)

    def last(column: str) -> float:
        return float(ctx.trace()[column].values[-1])

    job = ctx.axis.move_velocity(240.0, Acceleration=800.0, Jerk=0.0)
    ctx.run_for(0.15)
    near("Acceleration", 800.0, 1e-6, "DIA-094")
    near("Velocity", last(f"{axis}.velocity_setpoint"), 1e-9, "DIA-094")
    near("ActualAcceleration", 800.0, 80.0)
    for bit in (6, 7, 8, 10, 12, 13, 14):
        near(f"StatusWord.X{bit}", float(bit in {10, 13}), 0.0, "DIA-050")
    ctx.wait_until(job.in_velocity, 3.0, "the velocity is reached")
    ctx.run_for(0.2)
    near("Position", last(f"{axis}.position_setpoint"), 1e-6, "DIA-093")
    near("ActualPosition", last(f"{axis}.actual_position"), 1e-6, "DIA-096")
    near("StatusPositioning.FollowingError", last(f"{axis}.following_error"), 1e-6, "DIA-098")
    near("Acceleration", 0.0, 1e-9, "DIA-094")
    near("ActualAcceleration", 0.0, 60.0)
    near("VelocitySetpoint", 240.0, 2.0)
    near("ActualVelocity", 240.0, 2.0, "DIA-097")
    near("ActualSpeed", 240.0 * 60.0 / 10.0, 5.0)
    near("OperativeSensor", 1.0, 0.0, "DIA-095")
    near("StatusSensor[1].Position", last(f"{axis}.actual_position"), 1e-6, "DIA-096")
    near("StatusSensor[1].Velocity", last(f"{axis}.actual_velocity"), 1e-6, "DIA-097")
    for path, wanted in (
        ("StatusSensor[1].State", 2.0),
        ("StatusSensor[1].CommunicationOK", 1.0),
        ("StatusSensor[1].Error", 0.0),
        ("StatusDrive.InOperation", 1.0),
        ("StatusDrive.CommunicationOK", 1.0),
        ("StatusDrive.Error", 0.0),
        ("StatusMotionIn.FunctionState", 0.0),
        ("ErrorDetail.Number", 0.0),
        ("StatusWord.X5", 1.0),
        ("StatusWord.X12", 1.0),
    ):
        near(path, wanted, 0.0)
    ctx.axis.halt(Deceleration=700.0, Jerk=0.0)
    ctx.run_for(0.1)
    near("Acceleration", -700.0, 1e-6, "DIA-094")
    near("StatusWord.X14", 1.0, 0.0, "DIA-050")
    ctx.run_for(0.5)
    target = float(var("Position")) - 60.0
    ctx.axis.move_absolute(target, Velocity=150.0)
    ctx.run_for(0.2)
    near("StatusPositioning.TargetPosition", target, 1e-6, "DIA-092")
    near("StatusWord.X8", 1.0, 0.0, "DIA-047")
    ctx.run_for(1.0)
    near("StatusWord.X6", 1.0, 0.0, "DIA-043")
    near("StatusWord.X7", 1.0, 0.0, "DIA-049")
    machine = last(f"{drive}.position") * 1000.0
    near("ActualPosition", machine - _behind_zero(ctx, axis, drive), 0.02, "DIA-096")


def _behind_zero(ctx: CaseContext, axis: str, drive: str) -> float:
    """Return where the machine is when the axis shows 0, mm, from the sample in which it was homed."""
    trace = ctx.trace()
    homed_s = max(one.time_ns for one in trace.select(source=axis, kind="axis.homed")) * 1e-9 + cycles(ctx, 3)
    return trace[f"{drive}.position"].at(homed_s) * 1000.0 - trace[f"{axis}.actual_position"].at(homed_s)
