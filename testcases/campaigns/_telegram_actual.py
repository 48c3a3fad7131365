"""Cases of `telegram_faults`: what comes from the drive is wrong."""

from __future__ import annotations

from typing import Any, Final

from hil.campaign import Campaign, CaseContext
from hil.expect import alarm, no_alarm, value_at
from hil.record import event
from testcases.campaigns._profiles import encoder_increments_per_revolution
from testcases.campaigns._reactions import cycles, recovers, stopped_for_good
from testcases.campaigns._telegram_support import APPLIED, ends_disabled, goes_on, need_sign_of_life
from testcases.campaigns.support import (
    MOVING,
    PHASES,
    axis_name,
    bring_into,
    drive_name,
    enable,
    following_error_s,
    grace_s,
    permitted_error_mm,
    settle_s,
)

CASES: Final = Campaign("telegram faults", tags=("fault", "telegram"), bench="profidrive")

SIGN_TOLERANCE: Final = 3
"""Wrong values of the drive's sign of life in a row that a controller tolerates (PD-132)."""
ENDS: Final = ("constant", "standstill")


@CASES.product(
    "sign-of-life/{phase}",
    parameters={"phase": PHASES},
    title="the sign of life of the drive stands still, from {phase}",
    tags=("actual", "sign-of-life", "{phase}"),
    requirements=("PD-132", "PD-349", "STP-574"),
)
def sign_of_life(ctx: CaseContext, phase: str) -> None:
    """The fourth wrong value in a row is a lost communication: 431 with reaction 4; counting again the axis
    recovers.
    """
    need_sign_of_life(ctx)
    enable(ctx)
    bring_into(ctx, phase)
    fault = ctx.inject("telegram.sign_of_life", drive_name(ctx), direction="actual", how="freeze")
    # The first telegram that is hit still shows the value that it should.
    ended = ends_disabled(ctx, 431, within=SIGN_TOLERANCE + 4, identifiers=("PD-132",))
    ctx.expect(value_at(f"{axis_name(ctx)}.communication_ok", ended, 0.0, tolerance=0.0))
    fault.remove()
    ctx.run_for(0.1)
    recovers(ctx)


@CASES.product(
    "sign-of-life-jumps/{times}",
    parameters={"times": (1, 2, 3)},
    title="the sign of life of the drive jumps for {times} cycles",
    tags=("actual", "sign-of-life"),
    requirements=("PD-132",),
)
def sign_of_life_jumps(ctx: CaseContext, times: int) -> None:
    """Values that jump and count on are wrong twice, there and back: within the tolerance, the motion goes
    on.
    """
    need_sign_of_life(ctx)
    enable(ctx)
    bring_into(ctx, "constant")
    ctx.inject("telegram.sign_of_life", drive_name(ctx), count=times, how="jump", step=6)
    ctx.run_for(0.3)
    ctx.expect(no_alarm(axis=axis_name(ctx)).covers("PD-132"))
    goes_on(ctx)


@CASES.product(
    "sign-of-life-stands/{times}",
    parameters={"times": (2, 3)},
    title="the sign of life of the drive stands still for {times} cycles",
    tags=("actual", "sign-of-life"),
    requirements=("PD-132",),
)
def sign_of_life_stands(ctx: CaseContext, times: int) -> None:
    """It is wrong once more when it goes on: three wrong values in a row are tolerated, the fourth is 431."""
    need_sign_of_life(ctx)
    enable(ctx)
    bring_into(ctx, "constant")
    ctx.inject("telegram.sign_of_life", drive_name(ctx), count=times, how="freeze")
    ctx.run_for(0.3)
    if times < 3:
        ctx.expect(no_alarm(axis=axis_name(ctx)).covers("PD-132"))
        goes_on(ctx)
    else:
        ctx.expect(alarm(431, reaction=4, since=APPLIED, within_s=cycles(ctx, 6), axis=axis_name(ctx)))


LIES: Final[dict[str, tuple[dict[str, Any], int, tuple[str, ...]]]] = {
    "fault": ({"signal": "ZSW1.3", "value": 1}, 421, ("STP-559", "PD-063")),
    "control": ({"signal": "ZSW1.9", "value": 0}, 421, ("PD-069",)),
    "operation": ({"signal": "ZSW1.2", "value": 0}, 421, ("PD-062", "STP-560")),
    "inhibited": ({"signal": "ZSW1", "value": 0x0240}, 421, ("STP-560",)),
    "encoder-error": ({"signal": "G1_ZSW.15", "value": 1}, 411, ("PD-149",)),
    "encoder-parked": ({"signal": "G1_ZSW.14", "value": 1}, 411, ("PD-148",)),
}
"""Name of the case -> what stands in the telegram, alarm, requirements."""


@CASES.product(
    "lie/{what}/{phase}",
    parameters={"what": tuple(LIES), "phase": ENDS},
    title="the telegram tells of {what}, which is not so, from {phase}",
    tags=("actual", "{phase}"),
    requirements=lambda what, phase: (*LIES[what][2], "PD-349", "TA-020"),
)
def lie(ctx: CaseContext, what: str, phase: str) -> None:
    """A status bit that says so is enough: alarm with reaction 4, the axis stops; the truth again, it
    recovers.
    """
    reported, number, identifiers = LIES[what]
    enable(ctx)
    bring_into(ctx, phase)
    fault = ctx.inject("telegram.stuck", drive_name(ctx), **reported)
    # An axis that believes its drive off takes all enables away: the drive coasts.
    ends_disabled(ctx, number, within=3, identifiers=identifiers, stop_s=4.0 if what == "inhibited" else 1.5)
    fault.remove()
    ctx.run_for(0.1)
    recovers(ctx)


@CASES.product(
    "autonomous/{phase}",
    parameters={"phase": MOVING},
    title="ZSW1 shows a quick stop that the drive does not make, from {phase}",
    tags=("actual", "{phase}"),
    requirements=("STP-561", "PD-065"),
)
def autonomous(ctx: CaseContext, phase: str) -> None:
    """A drive that is on, not in operation, with its quick stop active brakes by itself, as the axis sees it:
    550.
    """
    enable(ctx)
    bring_into(ctx, phase)
    fault = ctx.inject("telegram.bits", drive_name(ctx), signal="ZSW1", clear=0x0024)
    ctx.run_for(1.0 + settle_s(ctx))
    ctx.expect(
        alarm(550, reaction=5, since=APPLIED, within_s=cycles(ctx, 3), axis=axis_name(ctx)).covers(
            "STP-561", "PD-065"
        )
    )
    fault.remove()


@CASES.case(
    "control-requested-lost", tags=("actual",), requirements=("PD-069", "PD-349", "TA-020", "STP-558")
)
def control_requested_lost(ctx: CaseContext) -> None:
    """ZSW1.9 falls: 421 with reaction 4, and its text says why."""
    enable(ctx)
    bring_into(ctx, "constant")
    fault = ctx.inject("telegram.control_lost", drive_name(ctx), direction="actual")
    ends_disabled(ctx, 421, within=3, identifiers=("PD-069",))
    (raised, *_) = [one for one in ctx.trace().select(kind="alarm.raised") if one.data["number"] == 421]
    ctx.measure(
        "alarm 421 names the control request",
        float("control request" in str(raised.data["text"])),
        low=1.0,
        high=1.0,
    )
    fault.remove()
    ctx.run_for(0.1)
    recovers(ctx)


@CASES.product(
    "stale/{phase}",
    parameters={"phase": MOVING},
    title="stale actual values with a living sign of life, from {phase}",
    tags=("actual", "{phase}"),
    requirements=("MON-040", "PD-349"),
)
def stale(ctx: CaseContext, phase: str) -> None:
    """The telegram repeats old values while its counter runs: nobody but the following error notices, 521."""
    enable(ctx)
    bring_into(ctx, phase)
    fault = ctx.inject("telegram.freeze", drive_name(ctx), direction="actual", sign_of_life="counts")
    ctx.run_for(following_error_s(ctx) + 1.0)
    ctx.expect(
        alarm(
            521,
            reaction=4,
            since=APPLIED,
            within_s=following_error_s(ctx) + cycles(ctx, 2),
            axis=axis_name(ctx),
        ).covers("MON-040")
    )
    fault.remove()
    ctx.run_for(2.0 + settle_s(ctx))
    stopped_for_good(ctx, ctx.now_s)


@CASES.product(
    "frozen/{phase}",
    parameters={"phase": ENDS},
    title="the telegram of the drive is frozen, sign of life and all, from {phase}",
    tags=("actual", "{phase}"),
    requirements=("PD-132", "PD-349"),
)
def frozen(ctx: CaseContext, phase: str) -> None:
    """A telegram that is always the same has no sign of life: 431."""
    need_sign_of_life(ctx)
    enable(ctx)
    bring_into(ctx, phase)
    fault = ctx.inject("telegram.freeze", drive_name(ctx), direction="actual")
    ends_disabled(ctx, 431, within=SIGN_TOLERANCE + 4, identifiers=("PD-132",))
    fault.remove()
    ctx.run_for(0.1)
    recovers(ctx)


@CASES.product(
    "wrong-length/{words}",
    parameters={"words": (-1, 1)},
    title="the telegram of the drive is {words} word longer than it should be",
    tags=("actual",),
    requirements=("PD-030", "STP-574"),
)
def wrong_length(ctx: CaseContext, words: int) -> None:
    """A telegram of another length is not taken over: after the grace of the axis it counts as lost, 431."""
    enable(ctx)
    bring_into(ctx, "constant")
    fault = ctx.inject("telegram.length", drive_name(ctx), words=words)
    ended = ends_disabled(
        ctx, 431, within=ctx.bench.config.bench.grace_cycles + 2, identifiers=("PD-030", "STP-574")
    )
    ctx.expect(value_at(f"{axis_name(ctx)}.communication_ok", ended, 0.0, tolerance=0.0))
    fault.remove()
    ctx.run_for(0.1)
    recovers(ctx)


@CASES.product(
    "late/{number}",
    parameters={"number": (1, 2)},
    title="answers are {number} cycles late",
    tags=("actual",),
    requirements=("STP-574", "PD-349"),
)
def late(ctx: CaseContext, number: int) -> None:
    """Answers within the grace disturb the control, and give no alarm of the communication."""
    axis = axis_name(ctx)
    enable(ctx)
    bring_into(ctx, "constant")
    ctx.inject("telegram.late", drive_name(ctx), cycles=number, duration_s=0.2)
    ctx.run_for(0.5)
    ctx.expect(no_alarm(axis=axis, besides=(522,)).covers("STP-574"))
    goes_on(ctx)


@CASES.case("very-late", tags=("actual",), requirements=("STP-574", "PD-349"))
def very_late(ctx: CaseContext) -> None:
    """Answers that stay away for longer than the grace are lost: 431."""
    enable(ctx)
    bring_into(ctx, "constant")
    grace = ctx.bench.config.bench.grace_cycles
    fault = ctx.inject("telegram.late", drive_name(ctx), cycles=grace + 2)
    ctx.run_for(1.5 + settle_s(ctx))
    ctx.expect(
        alarm(431, reaction=4, since=APPLIED, within_s=grace_s(ctx), axis=axis_name(ctx)).covers("STP-574")
    )
    fault.remove()
    ctx.run_for(0.1)
    stopped_for_good(ctx, ctx.now_s)
    recovers(ctx)


@CASES.product(
    "position-jumps/{turns}",
    parameters={"turns": (-2, 2)},
    title="G1_XIST1 jumps by {turns} revolutions",
    tags=("actual", "encoder"),
    requirements=("MON-040", "PD-349"),
)
def position_jumps(ctx: CaseContext, turns: int) -> None:
    """A position that jumps beyond the permitted following error: 521 at once."""
    enable(ctx)
    bring_into(ctx, "constant")
    counts = turns * encoder_increments_per_revolution(ctx)
    ctx.inject("telegram.offset", drive_name(ctx), signal="G1_XIST1", counts=counts)
    ctx.run_for(2.0 + settle_s(ctx))
    ctx.expect(
        alarm(521, reaction=4, since=APPLIED, within_s=cycles(ctx, 4), axis=axis_name(ctx)).covers("MON-040")
    )
    stopped_for_good(ctx, ctx.now_s)


HARMLESS: Final[dict[str, tuple[str, dict[str, Any]]]] = {
    "speed-scaled": ("telegram.scale", {"signal": "NIST_B", "factor": 0.5}),
    "speed-displaced": ("telegram.offset", {"signal": "NIST_B", "percent": 10.0}),
    "warning": ("telegram.stuck", {"signal": "ZSW1.7", "value": 1}),
    "tolerance": ("telegram.bits", {"signal": "ZSW1", "clear": 0x0100}),
    "second-value": ("telegram.flip", {"signal": "G1_XIST2"}),
    "messages-swapped": ("telegram.swap", {"signal": "MELDW.0", "other": "MELDW.15"}),
}


@CASES.product(
    "harmless/{what}",
    parameters={"what": tuple(HARMLESS)},
    title="{what} in the telegram does not stop the axis",
    tags=("actual",),
    requirements=("PD-349",),
)
def harmless(ctx: CaseContext, what: str) -> None:
    """The position of the axis comes from G1_XIST1: what it does not use leaves the motion alone."""
    kind, parameters = HARMLESS[what]
    enable(ctx)
    bring_into(ctx, "constant")
    ctx.inject(kind, drive_name(ctx), duration_s=0.3, **parameters)
    ctx.run_for(0.5)
    ctx.expect(no_alarm(axis=axis_name(ctx)))
    goes_on(ctx)


@CASES.case("position-displaced-a-little", tags=("actual", "encoder"), requirements=("MON-040",))
def position_displaced(ctx: CaseContext) -> None:
    """A displacement within the permitted following error is worked off, there and back."""
    enable(ctx)
    bring_into(ctx, "constant")
    lead = ctx.bench.config.drive[drive_name(ctx)].mechanics.lead_screw_mm
    counts = round(0.1 * permitted_error_mm(ctx) / lead * encoder_increments_per_revolution(ctx))
    ctx.inject("telegram.offset", drive_name(ctx), signal="G1_XIST1", counts=counts, duration_s=0.3)
    ctx.run_for(0.6)
    ctx.expect(no_alarm(axis=axis_name(ctx)))
    goes_on(ctx)


@CASES.case("never-off", tags=("actual",), requirements=("STP-573", "STP-295"))
def never_off(ctx: CaseContext) -> None:
    """ZSW1 shows operation for ever: MC_Power stays busy when the axis is to be disabled, until it is true
    again.
    """
    axis = axis_name(ctx)
    power = enable(ctx)
    fault = ctx.inject("telegram.stuck", drive_name(ctx), signal="ZSW1.2", value=1)
    ctx.do("MC_Power Enable = FALSE")
    ctx.axis.power(False)
    ctx.run_for(1.0 + settle_s(ctx))
    ctx.expect(
        value_at(f"{axis}.power_busy", ctx.now_s, 1.0, tolerance=0.0).covers("STP-573"),
        value_at(f"{axis}.power_status", ctx.now_s, 1.0, tolerance=0.0).covers("STP-295"),
    )
    fault.remove()
    ctx.wait_until(lambda: not power.Busy, 1.0, "MC_Power is no longer busy")


@CASES.case("operation-comes-late", tags=("actual",), requirements=("STP-043", "STP-556", "PD-349"))
def operation_comes_late(ctx: CaseContext) -> None:
    """ZSW1.2 stays away while the axis is enabled: MC_Power waits without an alarm, and goes on once it is
    there.
    """
    fault = ctx.inject("telegram.stuck", drive_name(ctx), signal="ZSW1.2", value=0)
    ctx.do("MC_Power Enable = TRUE")
    power = ctx.axis.power()
    ctx.run_for(1.0 + settle_s(ctx))
    ctx.measure("MC_Power.Status while ZSW1.2 = 0", float(power.status()), low=0.0, high=0.0)
    ctx.measure("MC_Power.Busy meanwhile", float(power.busy()), low=1.0, high=1.0)
    ctx.expect(no_alarm(axis=axis_name(ctx)))
    fault.remove()
    ctx.wait_until(power.status, 1.0, "the axis is enabled")
    ctx.expect(no_alarm(axis=axis_name(ctx), since=event("fault.removed")))
