"""Cases of `instructions`: every job in every state of the axis, its outputs from edge to edge, and what each
controller has of them.
"""

from __future__ import annotations

from typing import Any, Final

from hil.campaign import Campaign, CaseContext
from testcases.campaigns._instruction_jobs import Stage, stage
from testcases.campaigns._instruction_outputs import Outputs, Watched
from testcases.campaigns._overriding import ALARM, LOCKED, MOTION
from testcases.campaigns.own_axis import own
from testcases.campaigns.support import axis_name

CASES: Final = Campaign("instructions", tags=("axis", "states"), bench="reference")

_RESTARTING, _PANEL = 0x800D, 0x8012
_SET: Final = ("position-set", "position-shifted", "cancel-homing", "parameter")
"""Jobs that need neither enable nor standstill."""
_MOVING: Final = (*sorted(MOTION - {"homing-3", "homing-5"}), "halt", "halt-basic", "homing-3", "homing-5")
_PASSIVE: Final = ("passive-2", "passive-8", "passive-10")


def _refused(on: Stage, job: str, error_id: int, *requirements: str) -> None:
    """Expect a job to be refused at its edge, with an error that is held, and without motion."""
    begun = on.setpoint
    one = on.outputs.watch(on.start(job, 0.2, "running"))
    on.outputs.calls(4)
    shown = [call.error_id for call in one.calls]
    good = shown == [error_id] * len(shown) and abs(on.setpoint - begun) < 1e-6 * on.values.way(1.0)
    on.ctx.measure(
        f"{job}: refused with 16#{error_id:04X} (shown: {one.last.text})",
        float(good),
        low=1.0,
        requirements=requirements,
    )
    on.outputs.release()


def _done(on: Stage, job: str, *requirements: str) -> None:
    """Expect a job to be done within a few calls, whatever the state."""
    one = on.outputs.watch(on.start(job, 0.2, "running"))
    on.outputs.calls(6)
    on.ctx.measure(
        f"{job}: done (shown: {one.last.text})", float(one.last.done), low=1.0, requirements=requirements
    )
    on.outputs.release()


@CASES.case("state/disabled", requirements=("MC-010", "MC-222", "MC-245", "MC-187", "MC-188", "MC-447"))
def disabled(ctx: CaseContext) -> None:
    """On a disabled axis nothing moves: 16#800F; positions, parameters and acknowledgement need no enable."""
    on = stage(ctx)
    ctx.axis.power(False)
    ctx.wait_until(lambda: not ctx.axis.power_instance.Busy, 5.0, "the axis is disabled")
    for job in (*_MOVING, *_PASSIVE, "stop", "halt-superimposed"):
        _refused(on, job, LOCKED, "MC-010")
    for job in (*_SET, "reset"):
        _done(on, job, "MC-188", "MC-447")
    ctx.measure("ErrorWord", float(ctx.axis.var("ErrorWord")), high=0.0, requirements=("MC-642",))


@CASES.case("state/stopped", requirements=("MC-406", "MC-407", "MC-409", "OVR-084"))
def stopped(ctx: CaseContext) -> None:
    """Held by `MC_Stop` at standstill the axis refuses motion: 16#800F; when `Execute` falls it takes jobs
    again.
    """
    on = stage(ctx)
    stop = ctx.axis.stop(2)
    ctx.wait_until(stop.done, 2.0, "MC_Stop is done")
    for job in _MOVING:
        _refused(on, job, LOCKED, "MC-409", "OVR-084")
    for job in (*_SET, "reset"):
        _done(on, job, "OVR-088")
    ctx.measure("StatusWord2.X0", float(ctx.axis.var("StatusWord2.X0")), low=1.0, requirements=("MC-406",))
    stop.set(Execute=False)
    on.outputs.calls(2)
    ctx.measure("StatusWord2.X0", float(ctx.axis.var("StatusWord2.X0")), high=0.0, requirements=("MC-407",))
    moved = on.outputs.watch(ctx.axis.move_relative(on.values.way(0.02)))
    on.outputs.until(moved, "done", 3.0, "a job runs after the stop")


@CASES.product(
    "state/alarm/{number}",
    parameters={"number": (421, 104)},
    title="every job while alarm {number} is pending",
    requirements=("MC-123", "MC-125", "MC-420"),
)
def alarm(ctx: CaseContext, number: int) -> None:
    """With a pending alarm that has a reaction motion is refused with 16#8001; `MC_Stop` shows an abort."""
    on = stage(ctx)
    travelling = on.travel(0.3)
    ctx.inject("axis.alarm", axis_name(ctx), number=number)
    ctx.wait_until(lambda: not ctx.axis.var("StatusWord.X0"), 5.0, "the axis is disabled")
    ctx.run_for(0.5)
    ctx.measure(
        f"the job shows {travelling.last.text}",
        float(travelling.last.error_id == ALARM),
        low=1.0,
        requirements=("MC-123",),
    )
    for job in _MOVING:
        _refused(on, job, ALARM, "MC-123")
    _done(on, "parameter", "MC-447")
    _done(on, "reset", "MC-178")
    ctx.wait_until(ctx.axis.power_instance.status, 5.0, "the axis is enabled again")
    on.outputs.calls(20)
    ctx.measure("velocity", on.velocity, low=0.0, high=0.0, requirements=("MC-125",))


@CASES.case("state/warning", requirements=("MC-122", "MC-642"))
def warning(ctx: CaseContext) -> None:
    """An alarm without reaction neither ends a job nor refuses one."""
    on = stage(ctx)
    running = on.travel(0.3)
    ctx.inject("axis.alarm", axis_name(ctx), number=504)
    on.outputs.calls(5)
    ctx.measure(f"shown: {running.last.text}", float(running.last.success), low=1.0, requirements=("MC-122",))
    moved = on.outputs.watch(ctx.axis.move_relative(on.values.way(0.05)))
    on.outputs.until(moved, "done", 3.0, "a job runs with a pending warning")


@CASES.case("state/control-panel", requirements=("MC-004",))
def control_panel(ctx: CaseContext) -> None:
    """While a control panel has the axis, jobs of the program are refused with 16#8012."""
    on = stage(ctx)
    ctx.axis.power(False)
    ctx.wait_until(lambda: not ctx.axis.power_instance.Busy, 5.0, "the axis is disabled")
    panel = ctx.axis.control_panel()
    panel.take_control()
    on.outputs.calls(3)
    for job in (*_MOVING, *_PASSIVE, "stop"):
        _refused(on, job, _PANEL, "MC-004")
    panel.release()
    on.outputs.calls(3)
    ctx.wait_until(ctx.axis.power().status, 5.0, "the program enables the axis")
    moved = on.outputs.watch(ctx.axis.move_relative(on.values.way(0.05)))
    on.outputs.until(moved, "done", 3.0, "the program has the axis again")


@CASES.case("state/restarting", requirements=("MC-008", "MC-181", "MC-182", "MC-170"))
def restarting(ctx: CaseContext) -> None:
    """No restart of an enabled axis: 16#800E; while it restarts jobs are refused with 16#800D."""
    on = stage(ctx)
    enabled = on.outputs.watch(ctx.axis.reset(restart=True))
    on.outputs.calls(4)
    good = enabled.last.error_id == 0x800E and bool(ctx.axis.var("WarningWord.X3"))
    ctx.measure(f"restart while enabled: {enabled.last.text}", float(good), low=1.0, requirements=("MC-170",))
    on.outputs.release()
    ctx.axis.power(False)
    ctx.wait_until(lambda: not ctx.axis.power_instance.Busy, 5.0, "the axis is disabled")
    again = on.outputs.watch(ctx.axis.reset(restart=True))
    on.outputs.calls(1)
    ctx.measure("StatusWord.X2", float(ctx.axis.var("StatusWord.X2")), low=1.0, requirements=("MC-181",))
    late = [on.outputs.watch(on.start(job, 0.1, "running")) for job in ("relative", "halt", "position-set")]
    on.outputs.calls(1)
    for one in late:
        ctx.measure(
            f"{one.instance.name} shows {one.last.text}",
            float(one.last.error_id == _RESTARTING),
            low=1.0,
            requirements=("MC-008",),
        )
    on.outputs.until(again, "done", 5.0, "the axis is restarted")
    ctx.measure("homed", float(ctx.axis.var("StatusWord.X5")), high=0.0, requirements=("MC-182",))


@CASES.product(
    "control/{start}/{job}",
    parameters={
        "start": (0, 1),
        "job": (
            "velocity",
            "jog",
            "motion-in-velocity",
            "absolute",
            "relative",
            "superimposed",
            "halt",
            "stop",
        ),
    },
    title="{job} after MC_Power with StartMode {start}: position control",
    requirements=("MC-097", "MC-098", "MC-099", "MC-100", "MC-101"),
)
def control(ctx: CaseContext, start: int, job: str) -> None:
    """StatusWord.X28 shows what the enable and each job make of position control."""
    outputs, values, axis = Outputs(ctx), own(ctx), ctx.axis
    ctx.wait_until(axis.power().status, 5.0, "the axis is enabled")
    ctx.wait_until(axis.home(0.0).done, 2.0, "the axis is homed")
    axis.power(False)
    ctx.wait_until(lambda: not axis.power_instance.Busy, 5.0, "the axis is disabled")
    ctx.wait_until(axis.power(start_mode=start).status, 5.0, "the axis is enabled")
    outputs.calls(2)

    def expect(controlled: bool, what: str, requirement: str) -> None:
        shown = float(axis.var("StatusWord.X28"))
        ctx.measure(
            f"X28 {what}", shown, low=not controlled, high=not controlled, requirements=(requirement,)
        )

    expect(start == 1, "after enabling", "MC-097")
    velocity, distance = values.given(values.speed(0.3)), values.way(0.05)
    for wanted in (False, True, False):
        with_control: dict[str, Any] = {"PositionControlled": wanted}
        if job == "velocity":
            one = outputs.watch(axis.move_velocity(velocity, **with_control))
        elif job == "jog":
            one = outputs.watch(axis.jog(velocity, **with_control))
        elif job == "motion-in-velocity":
            one = outputs.watch(axis.motion_in_velocity(0.0, **with_control))
        else:
            one = outputs.watch(axis.move_velocity(velocity, **with_control))
            outputs.until(one, "success", 3.0, "the velocity is reached")
            _other(axis, job, distance, outputs)
            outputs.calls(4)
            forced = job not in {"halt", "stop"}
            expect(forced or wanted, f"with {job}", "MC-100" if forced else "MC-101")
            ctx.run_for(0.5)
            outputs.release()
            continue
        outputs.calls(4)
        expect(wanted, f"with {job}, PositionControlled {wanted}", "MC-099" if wanted else "MC-098")
        outputs.release()
        outputs.watch(axis.halt())
        ctx.run_for(0.5)
        expect(wanted, "after the job", "MC-101")
        outputs.release()


def _other(axis: Any, job: str, distance: float, outputs: Outputs) -> None:
    if job == "absolute":
        outputs.watch(axis.move_absolute(float(axis.var("ActualPosition")) + distance))
    elif job == "relative":
        outputs.watch(axis.move_relative(distance))
    elif job == "superimposed":
        outputs.watch(axis.move_superimposed(0.2 * distance))
    else:
        outputs.watch(axis.halt() if job == "halt" else axis.stop(2))


_FINITE: Final = {
    "relative": "MC-024", "absolute": "MC-023", "superimposed": "MC-027", "halt": "MC-022", "stop": "MC-030",
    "position-set": "MC-021", "parameter": "MC-032", "reset": "MC-020", "halt-superimposed": "MC-028",
}  # fmt: skip


@CASES.product(
    "edges/{job}",
    parameters={"job": tuple(_FINITE)},
    title="{job}: outputs from edge to edge",
    requirements=lambda job: (
        "MC-064",
        "MC-066",
        "MC-067",
        "MC-068",
        "MC-069",
        "MC-077",
        "MC-078",
        _FINITE[job],
    ),
)
def edges(ctx: CaseContext, job: str) -> None:
    """`Done` for exactly one call after an edge that has fallen, held while it stands; a second edge starts
    anew and shows no abort.
    """
    on = stage(ctx)
    for held in (False, True):
        if job in {"halt", "stop"}:
            on.travel(0.2)
        one = on.outputs.watch(on.start(job, 0.04, "edges"))
        on.outputs.calls(1)
        if not held:
            one.lower()
        on.ctx.run_for(1.2)
        _ends(on, one, job, held=held)
        on.outputs.release()
        if job != "stop":
            on.back()
    if job not in {"relative", "superimposed"}:
        return
    one = on.outputs.watch(on.start(job, 0.06, "again"))
    on.outputs.calls(5)
    one.lower()
    on.outputs.calls(2)
    one.raise_again()
    on.ctx.run_for(1.2)
    aborted = sum(call.aborted for call in one.calls)
    ends = [call.done for call in one.calls].index(True) if any(call.done for call in one.calls) else 0
    busy = all(call.busy for call in one.calls[:ends])
    ctx.measure(
        f"started again while busy: {one.last.text}, {aborted} aborts",
        float(bool(ends) and busy and not aborted),
        low=1.0,
        requirements=("MC-069",),
    )


def _ends(on: Stage, one: Watched, job: str, *, held: bool) -> None:
    done = [call.done for call in one.calls]
    number = sum(done)
    rises = sum(now and not before for before, now in zip([False, *done], done, strict=False))
    requirement = "MC-078" if held else "MC-077"
    high = len(done) if held else 1
    on.ctx.measure(
        f"{job}: calls with Done", number, low=2 if held else 1, high=high, requirements=(requirement,)
    )
    on.ctx.measure(f"{job}: rises of Done", rises, low=1, high=1, requirements=("MC-068",))
    failed = sum(call.aborted or call.error for call in one.calls)
    on.ctx.measure(f"{job}: calls with an abort or an error", failed, high=0, requirements=(_FINITE[job],))
