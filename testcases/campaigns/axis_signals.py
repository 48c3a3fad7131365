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
