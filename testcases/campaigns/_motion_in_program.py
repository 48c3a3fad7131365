"""Cases of `motion_in`: controller and program stop, hang, interfere or switch off under setpoints that come
from outside.
"""

from __future__ import annotations

from typing import Any, Final

from hil.campaign import Campaign, CaseContext
from hil.expect import (
    happens,
    job_output,
    never_happens,
    no_alarm,
    state_at,
    status_word_bit,
    stays_within,
    value_at,
)
from hil.record import event
from testcases.campaigns._motion_in import (
    EXACT,
    FAULT_SPEED,
    MODES,
    at_rest,
    ends_with,
    under_way,
)
from testcases.campaigns._profiles import profile_of
from testcases.campaigns._reactions import cycles, machine_at_rest
from testcases.campaigns.support import acknowledge, axis_name, enable, settle_s

CASES: Final = Campaign("motion in", tags=("motion-in", "fault"), bench="reference")


@CASES.product(
    "disabled/{stop_mode}/{mode}",
    parameters=[
        *({"stop_mode": stop_mode, "mode": "velocity"} for stop_mode in (0, 1, 2, 3)),
        {"stop_mode": 0, "mode": "position"},
        {"stop_mode": 0, "mode": "superimposed"},
    ],
    title="MC_Power disables with StopMode {stop_mode} under MC_MotionIn ({mode})",
    requirements=("MIN-017", "MIN-050"),
)
def disabled(ctx: CaseContext, stop_mode: int, mode: str) -> None:
    """CommandAborted and the ramp of the StopMode; enabled again, the axis stands although Enable of the
    instance is still TRUE.
    """
    axis, name = ctx.axis, axis_name(ctx)
    job, program = MODES[mode](ctx, FAULT_SPEED)
    since = ctx.now_s
    ctx.do(f"MC_Power Enable = FALSE, StopMode {stop_mode}")
    axis.power(False, stop_mode=stop_mode)
    ctx.run_for((3.0 if stop_mode == 3 else 1.0) + settle_s(ctx))
    ctx.expect(ends_with(ctx, job, "CommandAborted", since=since))
    machine_at_rest(ctx, ctx.now_s)
    enable(ctx)
    ctx.run_for(0.3)
    ctx.expect(
        state_at(name, ctx.now_s, "STANDSTILL"),
        never_happens(event("job.started", name, job=job.name), since=since).covers("MIN-050"),
    )
    program.end()
    job.set(Enable=False)
    ctx.run_for(0.02)
    at_rest(ctx, since=since)


@CASES.product(
    "not-enabled/{mode}",
    parameters={"mode": tuple(MODES)},
    title="MC_MotionIn ({mode}) on an axis that is not enabled",
    requirements=("MIN-017", "MC-481", "MC-491", "MC-501"),
)
def not_enabled(ctx: CaseContext, mode: str) -> None:
    """16#800F; enabling the axis afterwards does not start it, a new edge of Enable does."""
    axis, name = ctx.axis, axis_name(ctx)
    since = ctx.now_s
    start = {
        "velocity": lambda: axis.motion_in_velocity(10.0),
        "position": lambda: axis.motion_in_position(float(axis.var("Position"))),
        "superimposed": lambda: axis.motion_in_superimposed(0.0),
    }[mode]
    job = start()
    ctx.run_for(0.05)
    ctx.expect(ends_with(ctx, job, "Error", since=since, error_id=0x800F).covers("MIN-017"))
    enable(ctx)
    ctx.run_for(0.2)
    ctx.expect(state_at(name, ctx.now_s, "STANDSTILL"))
    job.set(Enable=False)
    ctx.run_for(0.02)
    job.set(Enable=True)
    ctx.run_for(0.1)
    ctx.measure("Busy", float(job.Busy), low=1.0)
    job.set(Enable=False)
    ctx.run_for(0.3 + settle_s(ctx))
    at_rest(ctx, since=since)


def _nothing_starts(ctx: CaseContext, job: Any, since: float) -> None:
    """Expect that enabling the axis again starts nothing."""
    name = axis_name(ctx)
    ctx.run_for(0.5)
    acknowledge(ctx)  # also what the drive has to say of the time without its controller
    enable(ctx)
    ctx.run_for(0.3)
    ctx.expect(
        state_at(name, ctx.now_s, "STANDSTILL"),
        never_happens(event("job.started", name, job=job.name), since=since),
        stays_within(f"{name}.velocity_setpoint", low=-EXACT, high=EXACT, since=ctx.now_s - 0.2),
    )


@CASES.product(
    "controller-stop/{mode}",
    parameters={"mode": tuple(MODES)},
    title="STOP of the controller under MC_MotionIn ({mode})",
    tags=("controller",),
    requirements=("MC-629", "STP-506"),
)
def controller_stop(ctx: CaseContext, mode: str) -> None:
    """The job ends with CommandAborted, the drive stops the axis; after the warm restart nothing moves by
    itself.
    """
    name = axis_name(ctx)
    job, program = MODES[mode](ctx, FAULT_SPEED)
    since = ctx.now_s
    stop_s = 1.0 + settle_s(ctx)
    ctx.inject("controller.stop", duration_s=stop_s)
    ctx.run_for(stop_s)
    program.end()
    ctx.expect(
        happens(event("job.aborted", name, job=job.name), since=since).covers("MC-629"),
        state_at(name, ctx.now_s - 0.1, "DISABLED").covers("STP-506"),
    )
    machine_at_rest(ctx, ctx.now_s)
    _nothing_starts(ctx, job, since)


@CASES.product(
    "controller-power-off/{mode}",
    parameters={"mode": ("velocity", "position")},
    title="supply of the controller lost under MC_MotionIn ({mode})",
    tags=("controller",),
    requirements=("MC-630",),
)
def controller_power_off(ctx: CaseContext, mode: str) -> None:
    """The drive misses its setpoints and brakes by itself; when the controller is back nothing moves."""
    job, program = MODES[mode](ctx, FAULT_SPEED)
    since = ctx.now_s
    off_s = 1.0 + settle_s(ctx)
    ctx.inject("controller.power_off", duration_s=off_s)
    ctx.run_for(off_s)
    program.end()
    machine_at_rest(ctx, ctx.now_s)
    ctx.run_for(1.0)
    _nothing_starts(ctx, job, since)


@CASES.product(
    "controller-stall/{length}",
    parameters={"length": ("short", "long")},
    title="the controller hangs {length}",
    tags=("controller",),
    requirements=("MIN-003", "C402-104", "PD-127"),
)
def controller_stall(ctx: CaseContext, length: str) -> None:
    """A CiA 402 drive bridges one cycle, a PROFIdrive axis misses the sign of life; a long hang stops either,
    and the job does not outlive it.
    """
    name = axis_name(ctx)
    job, program = under_way(ctx, FAULT_SPEED)
    since = ctx.now_s
    long = length == "long"
    stall_s = 0.8 if long else 0.9 * ctx.bench.cycle_ns * 1e-9
    ctx.inject("controller.stall", duration_s=stall_s)
    ctx.run_for(stall_s + (0.0 if long else 0.3))
    if not long and profile_of(ctx) == "cia402":
        program.end()
        ctx.expect(no_alarm(since=since, axis=name), state_at(name, ctx.now_s, "MOTION"))
        ctx.measure("Busy", float(job.Busy), low=1.0)
        job.set(Enable=False)
        ctx.run_for(0.3 + settle_s(ctx))
        at_rest(ctx, since=since)
        return
    if long:
        machine_at_rest(ctx, ctx.now_s)
    ctx.run_for(1.2 + settle_s(ctx))
    ctx.expect(
        job_output(job.name, "Error", since=since, error_id=0x8001),
        status_word_bit(31, False, at=ctx.now_s, axis=name),
    )
    machine_at_rest(ctx, ctx.now_s)


@CASES.product(
    "controller-overrun/{level}",
    parameters={"level": ("servo", "interpolator")},
    title="MC_{level} overruns its cycle under MC_MotionInVelocity",
    tags=("controller",),
    requirements=("MC-636", "MC-637"),
)
def controller_overrun(ctx: CaseContext, level: str) -> None:
    """The controller stops, and with it the axis; the job ends with CommandAborted."""
    name = axis_name(ctx)
    job, program = under_way(ctx, FAULT_SPEED)
    since = ctx.now_s
    ctx.inject("controller.overrun", level=level, time_ms=1.2 * ctx.bench.cycle_ns * 1e-6, duration_s=0.5)
    ctx.run_for(1.2 + settle_s(ctx))
    program.end()
    ctx.expect(
        happens(event("controller.state", to="STOP"), since=since, within_s=cycles(ctx, 8)),
        happens(event("job.aborted", name, job=job.name), since=since),
        state_at(name, ctx.now_s, "DISABLED"),
    )
    machine_at_rest(ctx, ctx.now_s)


@CASES.product(
    "edges/{mode}",
    parameters={"mode": tuple(MODES)},
    title="Enable alternates with every call ({mode})",
    requirements=("MIN-026", "MIN-040", "MIN-043"),
)
def edges(ctx: CaseContext, mode: str) -> None:
    """A program that takes Enable away and gives it again with every call: every edge is a job, none is an
    alarm or a jump.
    """
    axis, name = ctx.axis, axis_name(ctx)
    enable(ctx)
    since = ctx.now_s
    calls, pair = [0], []

    def toggle() -> None:
        calls[0] += 1
        for one in pair:
            one.set(Enable=calls[0] % 2 == 1)

    ctx.bench.runtime.call(toggle)
    start = float(axis.var("Position"))
    pair.append(
        {
            "velocity": lambda: axis.motion_in_velocity(5.0),
            "position": lambda: axis.motion_in_position(start + 0.05),
            "superimposed": lambda: axis.motion_in_superimposed(0.001),
        }[mode]()
    )
    ctx.run_for(100 * ctx.bench.interpolator_ns * 1e-9)
    ctx.bench.runtime.uncall(toggle)
    pair[0].set(Enable=False)
    ctx.run_for(0.3 + settle_s(ctx))
    # One in two cycles has the velocity; each of the superimposed jobs leaves its distance.
    way = {"velocity": 0.5 * 5.0 * 0.4, "position": 0.05, "superimposed": 50 * 0.001}[mode]
    ended = [
        one for one in ctx.trace().select(source=name, kind="job.done") if one.data.get("job") == pair[0].name
    ]
    ctx.measure("jobs that have ended well", len(ended), low=49, high=51)
    ctx.expect(
        never_happens(event("job.error", name), since=since),
        value_at(f"{name}.position_setpoint", ctx.now_s, start + way, tolerance=0.05),
    )
    at_rest(ctx, since=since)


@CASES.product(
    "restart-refused/{mode}",
    parameters={"mode": ("velocity", "position")},
    title="MC_Reset with Restart under MC_MotionIn ({mode})",
    requirements=("MC-170",),
)
def restart_refused(ctx: CaseContext, mode: str) -> None:
    """An enabled axis is not restarted: 16#800E, and the motion goes on."""
    job, program = MODES[mode](ctx, 40.0)
    since = ctx.now_s
    reset = ctx.axis.reset(restart=True)
    ctx.run_for(0.3)
    ctx.expect(job_output(reset.name, "Error", since=since, error_id=0x800E))
    ctx.measure("Busy", float(job.Busy), low=1.0)
    program.end()
    job.set(Enable=False)
    ctx.run_for(0.3 + settle_s(ctx))
    ctx.expect(job_output(job.name, "Done", since=since))
