"""Cases of `homing`: marks that do not come, cams that lie, encoders that fail, somebody who interferes."""

from __future__ import annotations

from typing import Any, Final

from hil.campaign import Campaign, CaseContext
from hil.expect import alarm, job_output, never_happens, no_alarm, status_word_bit
from hil.faults import on_event
from hil.record import event
from testcases.campaigns._homing import (
    HOME,
    go_to,
    home,
    homed_at,
    never_in_a_stop,
    not_homed,
    prepare,
)
from testcases.campaigns._profiles import by_profile
from testcases.campaigns._reactions import disabled_by_alarm, stopped_for_good
from testcases.campaigns.support import axis_name, drive_name, enable, settle_s

CASES: Final = Campaign("homing", tags=("homing", "fault"), bench="profidrive")

NO_MARK: Final[dict[str, tuple[str, str, dict[str, Any]]]] = {
    "no-zero-mark": ("zero-mark", "encoder.index_missing", {}),
    "no-zero-mark-behind-cam": ("cam", "encoder.index_missing", {}),
    "cam-stuck-free": ("cam", "switch.stuck", {"input": "home", "state": False}),
    "cam-stuck-actuated": ("cam", "switch.stuck", {"input": "home", "state": True}),
    "input-stuck-free": ("input", "switch.stuck", {"input": "home", "state": False}),
    "input-stuck-actuated": ("input", "switch.stuck", {"input": "home", "state": True}),
}
"""Name of the case -> mark, kind of fault, parameters."""


@CASES.product(
    "{what}/{reversal}",
    parameters={"what": tuple(NO_MARK), "reversal": ("with", "without")},
    title="{what}, {reversal} reversal",
    requirements=("HOM-097", "HOM-112", "HOM-114", "MC-220"),
)
def no_mark(ctx: CaseContext, what: str, reversal: str) -> None:
    """The mark never comes: with reversal the search ends with 342, without it at the limit switch with 531
    and 342.
    """
    mark, kind, parameters = NO_MARK[what]
    places = prepare(ctx, mark, direction="negative", reversal=reversal == "with")
    go_to(ctx, places.cam[1] + 60.0)
    axis = ctx.axis
    axis.write("Homing.ReferencingVelocity", 100.0)
    axis.write("Homing.ApproachVelocity", 150.0)
    ctx.inject(kind, drive_name(ctx), **parameters)
    since = ctx.now_s
    job = home(ctx)
    name = axis_name(ctx)
    not_homed(ctx, job, since=since)
    ctx.expect(alarm(342, reaction=3, since=since, axis=name).covers("HOM-097", "HOM-114"))
    if reversal == "without":
        ctx.expect(alarm(531, reaction=3, since=since, axis=name).covers("HOM-112"))
    ctx.run_for(0.6 + settle_s(ctx))
    stopped_for_good(ctx, ctx.now_s)
    never_in_a_stop(ctx, places)


@CASES.product(
    "cam-bounces/{mark}/{pulses}",
    parameters={"mark": ("cam", "input"), "pulses": ("2", "9")},
    title="the cam bounces ({mark}, {pulses} pulses)",
    requirements=("HOM-068", "HOM-107"),
)
def cam_bounces(ctx: CaseContext, mark: str, pulses: str) -> None:
    """Pulses while the cam is reached: the mark is the same, or, of an input, within the way of the
    bouncing.
    """
    places = prepare(ctx, mark, direction="positive", positive_side=mark == "input")
    go_to(ctx, places.cam[1] + 60.0)
    fault = ctx.inject(
        "switch.bounce",
        drive_name(ctx),
        trigger=on_event("drive.inputs", drive_name(ctx)),
        input="home",
        pulses=int(pulses),
    )
    since = ctx.now_s
    ctx.do("MC_Home Mode 3")
    job = ctx.axis.home(HOME, mode=3)
    ctx.run_for(1.0)
    fault.remove()
    ctx.wait_until(job.ended, 60.0, "the homing ends")
    ctx.run_for(0.2 + settle_s(ctx))
    expected = places.next_mark(places.leaves_cam(1), 1) if mark == "cam" else places.edge(1, True)
    homed_at(ctx, job, places, mark, expected, since=since)


@CASES.product(
    "encoder-lost/{mark}",
    parameters={"mark": ("zero-mark", "cam", "input")},
    title="the signal of the encoder is lost on the way to the mark ({mark})",
    requirements=("HOM-179", "HOM-191"),
)
def encoder_lost(ctx: CaseContext, mark: str) -> None:
    """Alarm 411 with reaction 4, the job ends with 16#8001, and the axis is not homed, neither then nor after
    the repair.
    """
    places = prepare(ctx, mark, direction="positive", positive_side=True)
    go_to(ctx, places.cam[1] + 30.0 if mark != "zero-mark" else places.cam[1] + 3.0)
    ctx.axis.write("Homing.ReferencingVelocity", 10.0)
    since = ctx.now_s
    ctx.do("MC_Home Mode 3")
    job = ctx.axis.home(HOME, mode=3)
    ctx.run_for(0.2)
    fault = ctx.inject("encoder.wire_break", drive_name(ctx))
    ctx.run_for(3.0 + settle_s(ctx))
    name = axis_name(ctx)
    not_homed(ctx, job, since=since)
    ctx.expect(alarm(411, reaction=4, since=since, axis=name).covers("HOM-179"))
    stopped_for_good(ctx, ctx.now_s)
    disabled_by_alarm(ctx, ctx.now_s)
    fault.remove()
    ctx.run_for(0.5)
    ctx.expect(status_word_bit(5, False, at=ctx.now_s, axis=name).covers("HOM-191"))


@CASES.case("homed-encoder-lost", title="the encoder of a homed axis fails", requirements=("HOM-179",))
def homed_encoder_lost(ctx: CaseContext) -> None:
    """An incremental encoder that has failed has lost its reference: the axis is not homed any more, also
    after the repair.
    """
    axis = axis_name(ctx)
    enable(ctx)
    ctx.wait_until(ctx.axis.home(HOME, mode=0).done, 1.0, "the position is set")
    ctx.run_for(0.1)
    ctx.check(status_word_bit(5, True, at=ctx.now_s, axis=axis))
    fault = ctx.inject("encoder.wire_break", drive_name(ctx))
    ctx.run_for(0.5 + settle_s(ctx))
    ctx.expect(alarm(411, reaction=4, axis=axis))
    fault.remove()
    ctx.run_for(0.5)
    ctx.expect(status_word_bit(5, False, at=ctx.now_s, axis=axis).covers("HOM-179"))


@CASES.case(
    "limit-after-reversal",
    title="a limit switch after a homing that turned round at it",
    requirements=("HOM-115",),
)
def limit_after_reversal(ctx: CaseContext) -> None:
    """Once homed, the limit switches at which the axis turned round stop it again."""
    places = prepare(ctx, "cam", direction="positive", approach="negative", reversal=True)
    go_to(ctx, places.cam[0] - 15.0)
    job = home(ctx)
    ctx.check(job_output(job.name, "Done"))
    homed = ctx.now_s
    ctx.do("MC_MoveVelocity -100 mm/s")
    ctx.axis.move_velocity(-100.0)
    ctx.run_for(4.0 + settle_s(ctx))
    ctx.expect(alarm(531, since=homed, axis=axis_name(ctx)).covers("HOM-115"))
    stopped_for_good(ctx, ctx.now_s)


@CASES.product(
    "search-fails/{code}",
    parameters={"code": ("0001", "0002", "0004", "0005")},
    title="the encoder answers the search with error {code}h",
    tags=("telegram",),
    requirements=("HOM-078",),
)
def search_fails(ctx: CaseContext, code: str) -> None:
    """Gx_ZSW bit 15: alarm 411 and ErrorWord.X10, the job ends with 16#8001."""
    ctx.require(by_profile(ctx, cia402=False, profidrive=True), "an encoder with a PROFIdrive interface")
    places = prepare(ctx, "zero-mark", direction="positive")
    go_to(ctx, places.cam[1] + 4.0)
    since = ctx.now_s
    ctx.do("MC_Home Mode 3")
    job = ctx.axis.home(HOME, mode=3)
    ctx.run_for(0.05)
    ctx.inject("encoder.error", drive_name(ctx), code=int(code, 16))
    ctx.wait_until(job.ended, 10.0, "the homing ends")
    ctx.run_for(2.0 + settle_s(ctx))
    name = axis_name(ctx)
    not_homed(ctx, job, since=since)
    ctx.expect(
        alarm(411, reaction=4, since=since, axis=name).covers("HOM-078"),
        status_word_bit(10, True, at=ctx.now_s, axis=name, word="error_word").covers("HOM-078"),
    )
    never_in_a_stop(ctx, places)


@CASES.product(
    "aborted/{by}/{part}",
    parameters={"by": ("halt", "stop", "motion", "disabling"), "part": ("approach", "search", "back")},
    title="aborted by {by} during its part {part}",
    tags=("abort",),
    requirements=("HOM-195", "HOM-034"),
)
def aborted(ctx: CaseContext, by: str, part: str) -> None:
    """Another job takes over: CommandAborted, no homing any more, and the marks that are passed later mean
    nothing.
    """
    places = prepare(
        ctx, "input" if part == "back" else "cam", direction="negative", positive_side=part == "back"
    )
    go_to(ctx, places.cam[1] + 60.0)
    axis, name = ctx.axis, axis_name(ctx)
    since = ctx.now_s
    ctx.do("MC_Home Mode 3")
    job = axis.home(HOME, mode=3)
    selector = event("homing.phase", name, phase=part)
    ctx.wait_until(
        lambda: bool([one for one in ctx.bench.history.select(kind="homing.phase") if selector.matches(one)]),
        20.0,
        f"the homing is in its part {part}",
    )
    ctx.run_for(0.02)
    ctx.do(by)
    if by == "halt":
        taker: Any = axis.halt()
    elif by == "stop":
        taker = axis.stop(0)
    elif by == "motion":
        taker = axis.move_relative(40.0)
    else:
        axis.power_instance.set(Enable=False)
        taker = None
    ctx.run_for(2.0 + settle_s(ctx))
    ctx.expect(
        job_output(job.name, "CommandAborted", since=since).covers("HOM-195"),
        status_word_bit(11, False, at=ctx.now_s, axis=name).covers("HOM-034"),
        status_word_bit(5, False, at=ctx.now_s, axis=name),
        never_happens(event("axis.homed", name), since=since),
        no_alarm(since=since, axis=name),
    )
    if taker is not None:
        ctx.expect(job_output(taker.name, "Done", since=since))
    never_in_a_stop(ctx, places)
