"""Cases of `monitoring`: the standstill signal, judged by the recorded actual velocity."""

from __future__ import annotations

from typing import Final

import numpy as np

from hil.campaign import Campaign, CaseContext
from hil.expect import no_alarm
from testcases.campaigns._loop import Run, begin, bit, cycle_s, increments, quiet, travel
from testcases.campaigns.support import axis_name, drive_name

CASES: Final = Campaign("monitoring", tags=("monitoring",), bench="reference")

STANDSTILL: Final = 7
RELEASE: Final = 1.1


def judged(run: Run, threshold: float, dwell_s: float, cycle: float) -> np.ndarray:
    """Return the signal as the rule makes it of the actual velocity: below the threshold for the time, until
    1.1 times that.
    """
    shown, rest, out = bool(bit(run.status_word, STANDSTILL)[0]), 0.0, []
    for speed in abs(run.actual_velocity):
        if shown:
            if speed > RELEASE * threshold:
                shown, rest = False, 0.0
        elif speed < threshold:
            rest += cycle
            shown = rest >= dwell_s - 1e-9
        else:
            rest = 0.0
        out.append(shown)
    return np.array(out)


def agrees(ctx: CaseContext, since: float, threshold: float, dwell_s: float) -> Run:
    """Expect X7 in every cycle of the run to be what the rule says."""
    run = Run(ctx, since)
    differs = int((judged(run, threshold, dwell_s, cycle_s(ctx)) != bit(run.status_word, STANDSTILL)).sum())
    ctx.measure(
        "cycles in which X7 is not what the rule says",
        differs,
        high=0.0,
        requirements=("MON-047", "MON-048", "MON-049"),
    )
    return run


def signal(ctx: CaseContext, threshold: float, dwell_ms: float) -> None:
    begin(
        ctx,
        None,
        {"StandstillSignal.VelocityThreshold": threshold, "StandstillSignal.MinDwellTime": dwell_ms / 1000.0},
    )
    ctx.run_for(dwell_ms / 1000.0 + 0.05)


@CASES.product(
    "standstill/{threshold}/{dwell_ms}",
    parameters=[{"threshold": t, "dwell_ms": d} for t, d in ((2, 0), (2, 100), (10, 20), (50, 0), (50, 100))],
    title="standstill below {threshold} mm/s for {dwell_ms} ms",
    tags=("standstill",),
    requirements=("MON-010", "MON-011", "MON-014", "MON-047"),
)
def standstill(ctx: CaseContext, threshold: float, dwell_ms: float) -> None:
    """X7 goes with the motion, and comes when the actual velocity has been below the threshold for the
    time.
    """
    signal(ctx, threshold, dwell_ms)
    since = ctx.now_s
    travel(ctx, 300.0)
    halt = ctx.axis.halt(Deceleration=1000.0, Jerk=0.0)
    ctx.wait_until(halt.done, 3.0, "the halt is done")
    ctx.run_for(dwell_ms / 1000.0 + 0.1)
    run = agrees(ctx, since, threshold, dwell_ms / 1000.0)
    shown = bit(run.status_word, STANDSTILL)
    below = run.time[np.flatnonzero(abs(run.actual_velocity) >= threshold)[-1]] + cycle_s(ctx)
    came = run.time[np.flatnonzero(~shown)[-1]] + cycle_s(ctx)
    ctx.measure(
        "X7 after the velocity has fallen below the threshold",
        float(came - below),
        "s",
        low=max(0.0, dwell_ms / 1000.0 - cycle_s(ctx)) - 1e-6,
        high=dwell_ms / 1000.0 + cycle_s(ctx),
        requirements=("MON-047",),
    )
    ctx.expect(no_alarm(axis=axis_name(ctx)))


@CASES.product(
    "hysteresis/{percent}/{start}",
    parameters={"percent": (90, 105, 120), "start": ("from-rest", "from-travel")},
    title="{percent} % of the threshold, {start}",
    tags=("standstill",),
    requirements=("MON-048",),
)
def hysteresis(ctx: CaseContext, percent: int, start: str) -> None:
    """From rest X7 stays up to 1.1 times the threshold; once gone it comes back below the threshold only."""
    signal(ctx, 20.0, 20.0)
    since = ctx.now_s
    if start == "from-travel":
        travel(ctx, 100.0)
    travel(ctx, 0.2 * percent)
    ctx.run_for(0.2)
    run = agrees(ctx, since, 20.0, 0.02)
    expected = percent < 100 or (percent < 110 and start == "from-rest")
    ctx.measure(
        "X7 in the end",
        float(bit(run.status_word, STANDSTILL)[-1]),
        low=expected,
        high=expected,
        requirements=("MON-048",),
    )
    quiet(ctx)


@CASES.product(
    "disturbed/{cause}",
    parameters={"cause": ("push", "noise", "frozen")},
    title="standstill disturbed: {cause}",
    tags=("standstill", "encoder"),
    requirements=("MON-048", "MON-049"),
)
def disturbed(ctx: CaseContext, cause: str) -> None:
    """A push, noise of the encoder, a frozen encoder: X7 follows the actual velocity by the same rule,
    whatever makes it.
    """
    signal(ctx, 3.0, 50.0)
    since = ctx.now_s
    drive = drive_name(ctx)
    if cause == "push":
        for _ in range(3):
            ctx.inject("mechanics.load_step", drive, force_N=2500.0, duration_s=0.012)
            ctx.run_for(0.1)
    elif cause == "noise":
        ctx.inject("encoder.noise", drive, increments=increments(ctx, 0.008), duration_s=0.2)
    else:
        travel(ctx, 20.0)
        ctx.inject("encoder.freeze", drive, duration_s=0.04)
    ctx.run_for(0.4)
    run = agrees(ctx, since, 3.0, 0.05)
    ctx.measure(
        "greatest actual velocity",
        float(abs(run.actual_velocity).max()),
        "mm/s",
        low=3.3 if cause == "push" else 0.0,
    )


@CASES.product(
    "recovery/{velocity}",
    parameters={"velocity": (100, -300)},
    title="recovery after an alarm at {velocity} mm/s",
    tags=("standstill",),
    requirements=("MON-052",),
)
def recovery(ctx: CaseContext, velocity: int) -> None:
    """After remove enable the axis is enabled again when it stands, not before, without a jump."""
    axis = ctx.axis
    signal(ctx, 2.0, 20.0)
    travel(ctx, velocity)
    ctx.inject("axis.alarm", axis_name(ctx), number=541)
    ctx.run_for(0.02)
    since = ctx.now_s
    ctx.do("MC_Reset while the axis still moves")
    reset = axis.reset()
    ctx.wait_until(axis.power_instance.status, 5.0, "the axis is enabled again")
    ctx.run_for(0.2)
    ctx.measure("MC_Reset is done", float(reset.Done), low=1.0)
    run = Run(ctx, since)
    enabled = np.flatnonzero(run.power_status)
    ctx.measure(
        "speed when it is enabled again",
        float(abs(run.actual_velocity[enabled[0]])),
        "mm/s",
        high=2.0,
        requirements=("MON-052",),
    )
    ctx.measure("speed afterwards", float(abs(run.actual_velocity[enabled[0] :]).max()), "mm/s", high=2.0)
