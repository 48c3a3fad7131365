"""Cases of `axis_faults`: somebody interferes with a stop that is on its way."""

from __future__ import annotations

from typing import Any, Final

from hil.campaign import Campaign, CaseContext
from hil.expect import (
    Expectation,
    always,
    event_order,
    golden,
    job_output,
    never,
    no_motion_after,
    ramp,
    state_at,
    stw1_sequence,
    value_at,
)
from hil.record import event
from testcases.campaigns._reactions import cycles, recovers, stopped_for_good
from testcases.campaigns.stop_modes import GOLDEN, STOPS, WORDS, expectation, give, ramp_begins, ramp_of
from testcases.campaigns.support import (
    MAXIMUM_VELOCITY,
    axis_name,
    bring_into,
    drive_name,
    enable,
    quick_stop,
    settle_s,
    state_change,
    tolerance,
)

CASES: Final = Campaign("axis faults", tags=("fault", "axis"), bench="reference")

MIDDLE_S: Final = 0.04
"""Time after the beginning of a stop at which somebody interferes: every ramp is still on its way."""
WITHOUT_ACKNOWLEDGE: Final = 0x047F
"""Bits of STW1 that are compared while MC_Reset works: all that the object owns but bit 7."""
NO_OFF2: Final = 0x0002
NO_OFF3: Final = 0x0004
ENABLE_OPERATION: Final = 0x0008

STOP_MODES: Final = (0, 1, 2, 3)
REACTIONS: Final = (1, 3, 5, 7)
"""Permitted values of `Actor.RemoveEnableReaction`."""


def in_the_middle(ctx: CaseContext, stop: str) -> float:
    """Travel with 300 mm/s, give a stop, and return the instant before it; a part of it has passed then."""
    enable(ctx)
    bring_into(ctx, "constant")
    before = ctx.now_s
    give(ctx, stop)
    ctx.run_for(MIDDLE_S)
    return before


def same_ramp(ctx: CaseContext, stop: str) -> Expectation | None:
    """Expect the ramp that the stop makes when nobody interferes; None where it coasts."""
    if STOPS[stop]["ramp"] == "coast":
        return None
    since = ramp_begins(ctx, stop)
    return ramp_of(ctx, stop, since, expectation(ctx, stop, "constant", since))


def operation_stays_enabled(ctx: CaseContext, since: float) -> Expectation:
    """Expect STW1.3 in every telegram: without it the drive would coast out of its ramp."""
    return always(
        "STW1.3 (enable operation) is set",
        lambda word: (word.astype(int) & ENABLE_OPERATION) != 0,
        f"{axis_name(ctx)}.stw1",
        since=since,
    ).covers("STP-572")


@CASES.product(
    "enable-toggled/{mode}",
    parameters={"mode": STOP_MODES},
    title="Enable rises again in the middle of StopMode {mode}",
    tags=("stop",),
    requirements=lambda mode: ("STP-566", "STP-296", "STP-502", GOLDEN[STOPS[f"power-{mode}"]["ramp"]]),
)
def enable_toggled(ctx: CaseContext, mode: int) -> None:
    """The stop is not cancelled: its ramp is what it would have been; then the axis is enabled again by
    itself.
    """
    axis = axis_name(ctx)
    stop = f"power-{mode}"
    before = in_the_middle(ctx, stop)
    ctx.do("MC_Power Enable = TRUE in the middle of the stop")
    power = ctx.axis.power(True)
    ctx.wait_until(lambda: ctx.axis.state.name == "STANDSTILL", 5.0, "the axis is enabled again and stands")
    ctx.run_for(0.2 + settle_s(ctx))
    unchanged = same_ramp(ctx, stop)
    if unchanged is not None:
        ctx.expect(unchanged.covers("STP-566"))
    ctx.expect(
        event_order(
            [
                state_change(ctx, name)
                for name in (STOPS[stop]["state"], "DISABLED", "ENABLING", "STANDSTILL")
            ],
            since=before,
        ).covers("STP-566", "STP-296"),
        operation_stays_enabled(ctx, before),
        state_at(axis, ctx.now_s, "STANDSTILL"),
    )
    ctx.measure("MC_Power.Status", float(power.status()), low=1.0, high=1.0)


@CASES.product(
    "stop-mode-changed/{mode}-to-{other}",
    parameters=[
        {"mode": mode, "other": other} for mode in STOP_MODES for other in STOP_MODES if mode != other
    ],
    title="StopMode {other} is written in the middle of StopMode {mode}",
    tags=("stop",),
    requirements=("STP-567", "STP-292"),
)
def stop_mode_changed(ctx: CaseContext, mode: int, other: int) -> None:
    """The value at the falling edge of Enable counts: the stop goes on as it began."""
    axis = axis_name(ctx)
    stop = f"power-{mode}"
    before = in_the_middle(ctx, stop)
    ctx.do(f"StopMode {other}, Enable still FALSE")
    ctx.axis.power(False, stop_mode=other)
    ctx.run_for((4.0 if mode == 3 else 1.0) + settle_s(ctx))
    unchanged = same_ramp(ctx, stop)
    if unchanged is not None:
        ctx.expect(unchanged.covers("STP-567"))
    states = [STOPS[f"power-{one}"]["state"] for one in STOP_MODES]
    seen = {
        str(one.data["to"])
        for one in ctx.trace().select(source=axis, kind="axis.state")
        if one.data["to"] in states
    }
    ctx.measure("stops of the axis", len(seen), low=1, high=1)
    ctx.expect(state_at(axis, ctx.now_s, "DISABLED"), operation_stays_enabled(ctx, before))
    stopped_for_good(ctx, ctx.now_s)


# -- reaction 4
# ----------------------------------------------------------------------------------------------------------


def remove_enable(ctx: CaseContext, value: int) -> float:
    """Configure the reaction, travel, raise an alarm with reaction 4; returns the instant before, in the
    middle of the stop.
    """
    axis = axis_name(ctx)
    ctx.do(f"MC_WriteParameter 1020 = 16#{value:X}")
    ctx.wait_until(ctx.axis.write_parameter(1020, value).done, 1.0, "the reaction is written")
    enable(ctx)
    bring_into(ctx, "constant")
    before = ctx.now_s
    ctx.inject("axis.alarm", axis, number=521, reaction=4)
    ctx.run_for(0.1)
    return before


RAMP_S: Final = {1: 1.0, 5: 0.5, 7: 0.5}
"""Ramp time from the maximum speed to zero by `RemoveEnableReaction`: OFF1, OFF3, OFF3; OFF2 has none."""


@CASES.product(
    "acknowledged-in-reaction-4/{value}",
    parameters={"value": REACTIONS},
    title="MC_Reset in the middle of reaction 4 with RemoveEnableReaction 16#{value}",
    tags=("stop",),
    requirements=lambda value: ("STP-568", "STP-382" if value == 1 else "STP-383"),
)
def acknowledged(ctx: CaseContext, value: int) -> None:
    """OFF1 is interrupted: enabled while moving. OFF3 goes on to standstill. OFF2 goes through S1. None of
    them is a deadlock.
    """
    axis, drive = axis_name(ctx), drive_name(ctx)
    before = remove_enable(ctx, value)
    ctx.do("MC_Reset while the drive stops")
    reset = ctx.axis.reset()
    ctx.wait_until(reset.done, 2.0, "the alarm is acknowledged")
    at = ctx.wait_until(lambda: ctx.axis.states.facts.enabled, 5.0, "the axis is enabled")
    ctx.wait_until(lambda: ctx.axis.state.name == "STANDSTILL", 5.0, "the axis stands")
    ended = ctx.now_s
    trace = ctx.trace()
    alarm_at = trace.instant(event("alarm.raised", axis))
    assert alarm_at is not None
    if value == 1:
        speed = trace[f"{axis}.actual_velocity"].at(at)
        ctx.measure("velocity when it is enabled again, mm/s", speed, low=50.0, high=300.0)
        ctx.expect(
            stw1_sequence((0x047F, 0x047E, 0x047F), axis=axis, since=before, mask=WITHOUT_ACKNOWLEDGE).covers(
                "STP-382"
            )
        )
        # The compensating motion is bounded: the ramp of the enabling, no more.
        travel = trace[f"{drive}.position"].at(ended) - trace[f"{drive}.position"].at(at)
        low = golden.stop_distance(speed, 2000.0) * 0.001
        ctx.measure(
            "travel after the enabling, m", travel, low=low * 0.9, high=low + speed * cycles(ctx, 5) * 0.001
        )
    elif value == 3:
        ctx.expect(
            never(
                "the drive is on before it has been off",
                lambda zsw1: (zsw1.astype(int) & 0x0007) == 0x0007,
                f"{axis}.zsw1",
                since=alarm_at + cycles(ctx, 3),
                until=at - cycles(ctx, 3),
            ).covers("STP-383")
        )
    else:
        begin = trace.instant(quick_stop(ctx))
        assert begin is not None
        ctx.measure(
            "from the quick stop to enabled, s",
            at - begin,
            low=RAMP_S[value] * 300.0 / MAXIMUM_VELOCITY - cycles(ctx, 4),
        )
        ctx.expect(
            ramp(
                quick_stop(ctx),
                axis=axis,
                velocity=f"{drive}.motor_speed",
                position=f"{drive}.position",
                time_s=RAMP_S[value] * 300.0 / MAXIMUM_VELOCITY,
                time_tolerance_s=tolerance(ctx).time_s,
                delay_s=cycles(ctx, 5),
                threshold=6.0,
                until=at,
            ).covers("STP-383")
        )
    ctx.run_for(0.2 + settle_s(ctx))
    ctx.do("MC_MoveRelative -20 mm")
    ctx.wait_until(ctx.axis.move_relative(-20.0).done, 5.0, "the axis moves again")


@CASES.product(
    "disabled-in-reaction-4/{value}/{mode}",
    parameters={"value": REACTIONS, "mode": STOP_MODES},
    title="Enable falls with StopMode {mode} in the middle of reaction 4 with RemoveEnableReaction "
    "16#{value}",
    tags=("stop",),
    requirements=lambda value, mode: ("STP-569", "STP-385" if value == 7 else "STP-384"),
)
def disabled(ctx: CaseContext, value: int, mode: int) -> None:
    """With 16#1, 16#3, 16#5 the drive coasts, whatever StopMode says; with 16#7 OFF3 is kept to
    standstill.
    """
    axis, drive = axis_name(ctx), drive_name(ctx)
    before = remove_enable(ctx, value)
    speed = ctx.trace()[f"{drive}.motor_speed"].values[-1]
    ctx.do(f"MC_Power Enable = FALSE, StopMode {mode}")
    power = ctx.axis.power(False, stop_mode=mode)
    fell = ctx.now_s
    ctx.run_for((4.0 if value != 7 else 1.0) + settle_s(ctx))
    words = {
        1: (0x047F, 0x047E, 0x047C),
        3: (0x047F, 0x047C),
        5: (0x047F, 0x047A, 0x047C),
        7: (0x047F, 0x047B, 0x0478),
    }[value]
    identifier = "STP-385" if value == 7 else "STP-384"
    ctx.expect(stw1_sequence(words, axis=axis, since=before).covers("STP-569", identifier))
    if value == 7:
        ctx.expect(
            ramp(
                quick_stop(ctx),
                axis=axis,
                velocity=f"{drive}.motor_speed",
                position=f"{drive}.position",
                time_s=RAMP_S[7] * 300.0 / MAXIMUM_VELOCITY,
                time_tolerance_s=tolerance(ctx).time_s,
                delay_s=cycles(ctx, 5),
                threshold=6.0,
            ).covers("STP-385"),
            always(
                "OFF2 is not given while the motor turns",
                lambda word, motor: ((word.astype(int) & NO_OFF2) != 0) | (abs(motor) < 60.0),
                f"{axis}.stw1",
                f"{drive}.motor_speed",
                since=before,
            ).covers("STP-385"),
        )
    else:
        # Coasting from here on is slower than any ramp.
        later = ctx.trace()[f"{drive}.motor_speed"].at(fell + 0.1)
        braked = 3000.0 / RAMP_S.get(value, 1.0) * 0.1
        ctx.measure(
            "speed lost in 0.1 s behind the falling edge, rpm", speed - later, low=0.0, high=0.6 * braked
        )
    ctx.measure("MC_Power is off", float(power.off()), low=1.0, high=1.0)
    stopped_for_good(ctx, ctx.now_s)


@CASES.product(
    "reaction-4-in-stop-mode-1/{value}",
    parameters={"value": REACTIONS},
    title="Reaction 4 with RemoveEnableReaction 16#{value} in the middle of StopMode 1",
    tags=("stop",),
    requirements=("STP-526",),
)
def reaction_in_quick_stop(ctx: CaseContext, value: int) -> None:
    """OFF2 wins over the quick stop; nothing else weakens it: OFF3 is not given back before the axis stands,
    and the ramp is what it would have been.
    """
    axis, drive = axis_name(ctx), drive_name(ctx)
    ctx.do(f"MC_WriteParameter 1020 = 16#{value:X}")
    ctx.wait_until(ctx.axis.write_parameter(1020, value).done, 1.0, "the reaction is written")
    in_the_middle(ctx, "power-1")
    speed = ctx.trace()[f"{drive}.motor_speed"].values[-1]
    since = ctx.now_s
    ctx.inject("axis.alarm", axis, number=521, reaction=4)
    ctx.run_for((4.0 if value == 3 else 1.0) + settle_s(ctx))
    if value == 3:
        later = ctx.trace()[f"{drive}.motor_speed"].at(since + 0.1)
        braked = 3000.0 / RAMP_S[5] * 0.1
        ctx.measure("speed lost in 0.1 s, rpm", speed - later, low=0.0, high=0.6 * braked)
    else:
        ctx.expect(
            never(
                "OFF3 is given back while the motor turns",
                lambda word, motor: ((word.astype(int) & NO_OFF3) != 0) & (abs(motor) > 60.0),
                f"{axis}.stw1",
                f"{drive}.motor_speed",
                since=since,
            ).covers("STP-526")
        )
        unchanged = same_ramp(ctx, "power-1")
        if unchanged is not None:
            ctx.expect(unchanged.covers("STP-526"))
    ctx.expect(state_at(axis, ctx.now_s, "ALARM_DISABLED"))
    stopped_for_good(ctx, ctx.now_s)


# -- MC_Stop, motion jobs
# ---------------------------------------------------------------------------------------------------


@CASES.product(
    "alarm-in-stop-hold/{number}-{reaction}",
    parameters=[
        {"number": 533, "reaction": 1},
        {"number": 104, "reaction": 2},
        {"number": 304, "reaction": 3},
    ],
    title="alarm {number} with reaction {reaction} while MC_Stop holds the axis",
    tags=("stop",),
    requirements=("STP-577",),
)
def alarm_in_hold(ctx: CaseContext, number: int, reaction: int) -> None:
    """At rest there is nothing to stop: no motion; the axis is disabled, unless the alarm is one that keeps
    it enabled.
    """
    axis, drive = axis_name(ctx), drive_name(ctx)
    enable(ctx)
    bring_into(ctx, "constant")
    stop = give(ctx, "stop-0")
    ctx.wait_until(stop.done, 2.0, "MC_Stop is Done, Execute still TRUE")
    ctx.run_for(0.3 + settle_s(ctx))
    before = ctx.now_s
    ctx.inject("axis.alarm", axis, number=number, reaction=reaction)
    ctx.run_for(0.5 + settle_s(ctx))
    ended = ctx.now_s
    # Alarm 533 keeps the axis enabled (STP-589 to STP-591).
    end = "ALARM_STANDSTILL" if number == 533 else "ALARM_DISABLED"
    ctx.expect(
        no_motion_after(before, axis=axis, until=ended).covers("STP-577"),
        no_motion_after(before, position=f"{drive}.position", tolerance=0.00005, until=ended)
        .named("machine at rest")
        .covers("STP-577"),
        state_at(axis, ended, end).covers("STP-577"),
    )
    stop.set(Execute=False)
    ctx.run_for(0.05)
    recovers(ctx)


ANSWERS: Final[dict[str, int]] = {
    **{f"power-{mode}": 0x800F for mode in STOP_MODES},
    **{f"stop-{mode}": 0x800F for mode in (0, 2, 3)},
    **{f"reaction-{reaction}": 0x8001 for reaction in (1, 2, 3, 4)},
}
"""ErrorID of every motion job that is started in the middle of a stop."""

JOBS: Final = ("MC_MoveVelocity", "MC_MoveRelative", "MC_MoveJog", "MC_Halt")


def start(ctx: CaseContext, kind: str) -> Any:
    """Start a motion job; returns its instance."""
    ctx.do(f"{kind} in the middle of the stop")
    axis = ctx.axis
    if kind == "MC_MoveVelocity":
        return axis.move_velocity(100.0)
    if kind == "MC_MoveRelative":
        return axis.move_relative(50.0)
    return axis.jog(100.0) if kind == "MC_MoveJog" else axis.halt()


@CASES.product(
    "jobs-refused/{stop}",
    parameters=[{"stop": stop, "words": WORDS[stop]} for stop in ANSWERS],
    title="motion jobs are started during {words}",
    tags=("stop",),
    requirements=("STP-578",),
)
def jobs_refused(ctx: CaseContext, stop: str, words: str) -> None:
    """Each is rejected with its ErrorID, and the ramp is the one that it would have been."""
    del words  # the title
    before = in_the_middle(ctx, stop)
    started = ctx.now_s
    jobs = [start(ctx, kind) for kind in JOBS]
    ctx.run_for((4.0 if stop == "power-3" else 1.5) + settle_s(ctx))
    for job in jobs:
        ctx.expect(
            job_output(
                job.name, "Error", since=started, error_id=ANSWERS[stop], within_s=cycles(ctx, 3)
            ).covers("STP-578")
        )
    unchanged = same_ramp(ctx, stop)
    if unchanged is not None:
        ctx.expect(unchanged.covers("STP-578"))
    ctx.expect(state_at(axis_name(ctx), ctx.now_s, STOPS[stop]["end"]), operation_stays_enabled(ctx, before))
    stopped_for_good(ctx, ctx.now_s)


@CASES.product(
    "halt-gives-way/{kind}",
    parameters={"kind": JOBS},
    title="{kind} is started during MC_Halt",
    tags=("stop",),
    requirements=("STP-578",),
)
def halt_gives_way(ctx: CaseContext, kind: str) -> None:
    """A halt is superseded by every motion job: it ends with CommandAborted, and the job does what it is
    there for.
    """
    axis = axis_name(ctx)
    enable(ctx)
    bring_into(ctx, "constant")
    halt = give(ctx, "halt")
    ctx.run_for(MIDDLE_S)
    started = ctx.now_s
    job = start(ctx, kind)
    ctx.run_for(2.0 + settle_s(ctx))
    ctx.expect(
        job_output(halt.name, "CommandAborted", since=started, within_s=cycles(ctx, 3)).covers("STP-578")
    )
    if kind in ("MC_MoveVelocity", "MC_MoveJog"):
        ctx.expect(value_at(f"{axis}.velocity_setpoint", ctx.now_s, 100.0, tolerance=1e-6).covers("STP-578"))
    else:
        ctx.expect(job_output(job.name, "Done", since=started).covers("STP-578"))
