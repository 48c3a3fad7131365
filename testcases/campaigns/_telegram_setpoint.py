"""Cases of `telegram_faults`: what goes to the drive is wrong."""

from __future__ import annotations

from typing import Any, Final

from hil.campaign import Campaign, CaseContext
from hil.expect import alarm, happens, never_happens, no_alarm, value_at
from hil.record import event
from testcases.campaigns._reactions import cycles, disabled_by_alarm, recovers, stopped_for_good
from testcases.campaigns._telegram_support import (
    APPLIED,
    drive_enters,
    drive_faults,
    goes_on,
    need_sign_of_life,
)
from testcases.campaigns.support import (
    MOVING,
    acknowledge,
    axis_name,
    bring_into,
    drive_name,
    enable,
    following_error_s,
    settle_s,
)

CASES: Final = Campaign("telegram faults", tags=("fault", "telegram"), bench="profidrive")

SIGN_OF_LIFE: Final = "sign of life of the controller failed"
"""Fault 1912."""

SILENCES: Final[dict[str, tuple[str, dict[str, Any]]]] = {
    "frozen-sign": ("telegram.sign_of_life", {"direction": "setpoint", "how": "freeze"}),
    "zero-sign": ("telegram.sign_of_life", {"direction": "setpoint", "how": "zero"}),
    "stale": ("telegram.freeze", {"direction": "setpoint"}),
    "lost": ("telegram.lost", {"direction": "setpoint"}),
    "empty": ("telegram.length", {"direction": "setpoint", "words": -10}),
    "one-word-short": ("telegram.length", {"direction": "setpoint", "words": -1}),
    "late": ("telegram.late", {"direction": "setpoint", "cycles": 3}),
}
"""Ways in which the drive misses the sign of life of its controller."""


@CASES.product(
    "controller-{how}/{phase}",
    parameters=[
        *({"how": how, "phase": "constant"} for how in SILENCES),
        *({"how": "frozen-sign", "phase": phase} for phase in MOVING[1:]),
    ],
    title="the drive misses the sign of life ({how}), from {phase}",
    tags=("setpoint", "sign-of-life", "{phase}"),
    requirements=("PD-127", "PD-128", "PD-129", "PD-132"),
)
def controller_silent(ctx: CaseContext, how: str, phase: str) -> None:
    """The second wrong value is the fault: OFF1 and its ramp; the drive's own sign of life goes, which is 431
    for the axis.
    """
    need_sign_of_life(ctx)
    kind, parameters = SILENCES[how]
    enable(ctx)
    bring_into(ctx, phase)
    fault = ctx.inject(kind, drive_name(ctx), **parameters)
    ctx.run_for(2.0 + settle_s(ctx))
    ended = ctx.now_s
    ctx.expect(
        happens(drive_faults(ctx, SIGN_OF_LIFE), since=APPLIED, within_s=cycles(ctx, 5)).covers(
            "PD-127", "PD-128"
        ),
        happens(drive_enters(ctx, "S5 ramp stop"), since=APPLIED, within_s=cycles(ctx, 5)).covers("PD-129"),
        alarm(431, reaction=4, since=APPLIED, within_s=cycles(ctx, 7), axis=axis_name(ctx)).covers("PD-132"),
    )
    stopped_for_good(ctx, ended)
    disabled_by_alarm(ctx, ended)
    fault.remove()
    # Both counters have to become synchronous again: twice 16 right values (PD-125).
    ctx.run_for(60 * ctx.bench.cycle_ns * 1e-9)
    recovers(ctx)


@CASES.case("one-wrong-sign", tags=("setpoint", "sign-of-life"), requirements=("PD-127", "PD-128"))
def one_wrong_sign(ctx: CaseContext) -> None:
    """A wrong value of the controller now and then, more than ten right ones between, is tolerated with PNU
    925 = 1.
    """
    need_sign_of_life(ctx)
    enable(ctx)
    bring_into(ctx, "constant")
    for _ in range(3):
        ctx.inject("telegram.sign_of_life", drive_name(ctx), count=1, direction="setpoint", how="jump")
        ctx.run_for(14 * ctx.bench.cycle_ns * 1e-9)
    ctx.run_for(0.1)
    ctx.expect(
        never_happens(event("drive.fault", drive_name(ctx))).covers("PD-128"), no_alarm(axis=axis_name(ctx))
    )
    goes_on(ctx)


@CASES.case("two-wrong-signs", tags=("setpoint", "sign-of-life"), requirements=("PD-127", "PD-128"))
def two_wrong_signs(ctx: CaseContext) -> None:
    """A second wrong value with fewer than ten right ones between is the fault."""
    need_sign_of_life(ctx)
    enable(ctx)
    bring_into(ctx, "constant")
    for _ in range(2):
        ctx.inject("telegram.sign_of_life", drive_name(ctx), count=1, direction="setpoint", how="jump")
        ctx.run_for(6 * ctx.bench.cycle_ns * 1e-9)
    ctx.run_for(1.5 + settle_s(ctx))
    ctx.expect(
        happens(drive_faults(ctx, SIGN_OF_LIFE), since=APPLIED, within_s=cycles(ctx, 10)).covers(
            "PD-127", "PD-128"
        )
    )
    stopped_for_good(ctx, ctx.now_s)
    recovers(ctx)


OFFS: Final[dict[str, tuple[str, str, int, int, tuple[str, ...]]]] = {
    "off1": ("STW1.0", "S5 ramp stop", 421, 4, ("PD-106",)),
    "off2": ("STW1.1", "S1 switching on inhibited", 421, 4, ("PD-104",)),
    "off3": ("STW1.2", "S5 quick stop", 550, 5, ("PD-105",)),
    "disable": ("STW1.3", "S3 switched on", 421, 4, ("PD-107",)),
}
"""Name -> bit that the drive sees as 0, state of the drive, alarm and reaction of the axis, requirements."""


@CASES.product(
    "withdrawn-{how}/{phase}",
    parameters={"how": tuple(OFFS), "phase": MOVING},
    title="the drive sees {how} that nobody gave, from {phase}",
    tags=("setpoint", "{phase}"),
    requirements=lambda how, phase: (*OFFS[how][4], "PD-349"),
)
def withdrawn(ctx: CaseContext, how: str, phase: str) -> None:
    """The drive does what it reads; the axis sees that ZSW1.2 fell without its doing: 421, or 550 while a
    quick stop shows.
    """
    signal, state, number, reaction, identifiers = OFFS[how]
    enable(ctx)
    bring_into(ctx, phase)
    fault = ctx.inject("telegram.flip", drive_name(ctx), signal=signal)
    ctx.run_for(2.0 + settle_s(ctx))
    ctx.expect(
        happens(drive_enters(ctx, state), since=APPLIED, within_s=cycles(ctx, 2)).covers(*identifiers),
        alarm(number, reaction=reaction, since=APPLIED, within_s=cycles(ctx, 5), axis=axis_name(ctx)),
    )
    fault.remove()
    ctx.run_for(2.0)
    stopped_for_good(ctx, ctx.now_s)


@CASES.case(
    "operation-withdrawn-in-quick-stop", tags=("setpoint", "stop"), requirements=("STP-572", "PD-113")
)
def operation_withdrawn_in_quick_stop(ctx: CaseContext) -> None:
    """On its way the telegram loses STW1.3 during OFF3: pulses off at once, the motor coasts out of its
    ramp.
    """
    drive = drive_name(ctx)
    enable(ctx)
    bring_into(ctx, "constant")
    ctx.do("MC_Power Enable = FALSE, StopMode 1")
    ctx.axis.power(False, stop_mode=1)
    ctx.wait_until(lambda: ctx.drive.drive.state.name == "S5B", 1.0, "the quick stop has begun")
    ctx.run_for(0.05)
    before = ctx.drive.drive.core.speed_rpm
    fault = ctx.inject("telegram.stuck", drive, signal="STW1.3", value=0)
    ctx.run_for(0.1)
    lost = before - ctx.drive.drive.core.speed_rpm
    # OFF3 takes 600 rpm in 0.1 s.
    ctx.measure("speed lost in 0.1 s, rpm", lost, low=0.0, high=300.0)
    ctx.expect(
        happens(
            drive_enters(ctx, "S1 switching on inhibited"), since=APPLIED, within_s=cycles(ctx, 3)
        ).covers("STP-572")
    )
    fault.remove()
    ctx.run_for(4.0)
    stopped_for_good(ctx, ctx.now_s)


@CASES.case("control-given-away", tags=("setpoint",), requirements=("PD-076", "PD-077"))
def control_given_away(ctx: CaseContext) -> None:
    """STW1.10 falls in operation: the drive keeps its last setpoint and runs on; neither fault nor alarm at
    constant travel.
    """
    drive = drive_name(ctx)
    enable(ctx)
    bring_into(ctx, "constant")
    ctx.inject("telegram.control_lost", drive, direction="setpoint", duration_s=0.2)
    ctx.run_for(0.5)
    ctx.expect(
        no_alarm(axis=axis_name(ctx)).covers("PD-076"),
        never_happens(event("drive.state", drive), since=APPLIED).covers("PD-077"),
    )
    goes_on(ctx)


@CASES.case(
    "control-given-away-before-a-halt", tags=("setpoint",), requirements=("PD-076", "PD-077", "MON-040")
)
def control_given_away_before_a_halt(ctx: CaseContext) -> None:
    """Without control the drive does not hear the halt either: it runs on, and the following error says
    so.
    """
    enable(ctx)
    bring_into(ctx, "constant")
    fault = ctx.inject("telegram.control_lost", drive_name(ctx), direction="setpoint")
    ctx.do("MC_Halt")
    ctx.axis.halt()
    ctx.run_for(0.3)
    moving = value_at(f"{drive_name(ctx)}.velocity", ctx.now_s, 0.3, tolerance=0.05)
    ctx.expect(
        moving.covers("PD-077"), alarm(521, reaction=4, since=APPLIED, axis=axis_name(ctx)).covers("MON-040")
    )
    fault.remove()
    ctx.run_for(1.5 + settle_s(ctx))
    stopped_for_good(ctx, ctx.now_s)
    recovers(ctx)


@CASES.product(
    "reset-unheard/{value}",
    parameters={"value": (0, 1)},
    title="STW1.7 stands at {value}: the fault is not acknowledged",
    tags=("setpoint",),
    requirements=("PD-078", "PD-115"),
)
def reset_unheard(ctx: CaseContext, value: int) -> None:
    """A fault is acknowledged by an edge of STW1.7 alone: neither 0 nor a standing 1 does it."""
    drive = drive_name(ctx)
    enable(ctx)
    fault = ctx.inject("telegram.stuck", drive, signal="STW1.7", value=value)
    ctx.run_for(0.1)
    ctx.inject("drive.fault", drive, code=0x2310)
    ctx.run_for(0.3)
    ctx.do("MC_Reset, which the drive does not hear")
    ctx.axis.reset()
    ctx.run_for(0.5)
    ctx.expect(
        never_happens(event("drive.fault_acknowledged", drive), until=ctx.now_s).covers("PD-078"),
        alarm(421, reaction=4, axis=axis_name(ctx)),
    )
    fault.remove()
    ctx.run_for(0.1)
    acknowledge(ctx)
    ctx.expect(
        happens(event("drive.fault_acknowledged", drive), since=event("fault.removed")).covers("PD-078")
    )
    ctx.wait_until(ctx.axis.power_instance.status, 5.0, "the axis is enabled again")


@CASES.product(
    "speed-{what}",
    parameters={"what": ("halved", "swapped", "stuck")},
    title="NSOLL_B is {what}",
    tags=("setpoint",),
    requirements=("MON-040", "PD-349"),
)
def speed_wrong(ctx: CaseContext, what: str) -> None:
    """The drive gets a wrong speed: the following error grows beyond what is permitted, 521."""
    drive = drive_name(ctx)
    enable(ctx)
    bring_into(ctx, "constant")
    if what == "halved":
        ctx.inject("telegram.scale", drive, signal="NSOLL_B", factor=0.5, duration_s=0.5)
    elif what == "swapped":
        ctx.inject("telegram.swap", drive, signal="PZD2", other="PZD3", direction="setpoint", duration_s=0.5)
    else:
        ctx.inject("telegram.stuck", drive, signal="NSOLL_B", value=0, duration_s=0.5)
    ctx.run_for(2.0 + settle_s(ctx))
    ctx.expect(
        alarm(
            521, reaction=4, since=APPLIED, within_s=2.0 * following_error_s(ctx), axis=axis_name(ctx)
        ).covers("MON-040")
    )
    stopped_for_good(ctx, ctx.now_s)
    recovers(ctx)


@CASES.case("speed-slightly-wrong", tags=("setpoint",), requirements=("MON-040",))
def speed_slightly_wrong(ctx: CaseContext) -> None:
    """A scale of 95 % is made up for by the position control: no alarm."""
    enable(ctx)
    bring_into(ctx, "constant")
    ctx.inject("telegram.scale", drive_name(ctx), signal="NSOLL_B", factor=0.95, duration_s=0.3)
    ctx.run_for(0.5)
    ctx.expect(no_alarm(axis=axis_name(ctx)))
    goes_on(ctx)


@CASES.case("torque-reduced", tags=("setpoint",), requirements=("PD-037",))
def torque_reduced(ctx: CaseContext) -> None:
    """MOMRED of 100 %, which nobody sent, takes the torque: accelerating the axis falls behind, 521."""
    enable(ctx)
    ctx.inject("telegram.stuck", drive_name(ctx), signal="MOMRED", value=0x4000, duration_s=0.5)
    ctx.run_for(0.05)
    ctx.do("MC_MoveVelocity 300 mm/s without torque")
    ctx.axis.move_velocity(300.0)
    ctx.run_for(2.0 + settle_s(ctx))
    ctx.expect(
        value_at(f"{drive_name(ctx)}.torque", event("fault.applied").plus(0.2), 0.0, tolerance=0.001).covers(
            "PD-037"
        ),
        alarm(521, reaction=4, since=APPLIED, axis=axis_name(ctx)),
    )
    stopped_for_good(ctx, ctx.now_s)


@CASES.product(
    "ramp-{how}",
    parameters={"how": ("disabled", "frozen", "without-input")},
    title="the drive sees a ramp generator that is {how}",
    tags=("setpoint",),
    requirements=("PD-119", "PD-120", "PD-349"),
)
def ramp_bits(ctx: CaseContext, how: str) -> None:
    """STW1.4 or .6 at 0 stops the drive in operation (521); STW1.5 has no effect on a reduced setpoint
    channel.
    """
    bit = {"disabled": 4, "frozen": 5, "without-input": 6}[how]
    enable(ctx)
    bring_into(ctx, "constant")
    ctx.inject("telegram.stuck", drive_name(ctx), signal=f"STW1.{bit}", value=0, duration_s=0.3)
    ctx.run_for(1.5 + settle_s(ctx))
    if how == "frozen":
        ctx.expect(no_alarm(axis=axis_name(ctx)).covers("PD-120"))
        goes_on(ctx)
        return
    ctx.expect(alarm(521, reaction=4, since=APPLIED, within_s=0.3, axis=axis_name(ctx)).covers("PD-120"))
    stopped_for_good(ctx, ctx.now_s)


@CASES.product(
    "enabled-in-spite/{phase}",
    parameters={"phase": ("constant", "standstill")},
    title="STW1.0 stands at 1: the drive does not hear that it is to be switched off, from {phase}",
    tags=("setpoint", "{phase}"),
    requirements=("STP-573", "PD-349"),
)
def enabled_in_spite(ctx: CaseContext, phase: str) -> None:
    """MC_Power stops the axis and stays busy, because the drive stays on; nothing moves; heard again, it is
    off.
    """
    axis = axis_name(ctx)
    power = enable(ctx)
    bring_into(ctx, phase)
    fault = ctx.inject("telegram.stuck", drive_name(ctx), signal="STW1.0", value=1)
    ctx.do("MC_Power Enable = FALSE, StopMode 0")
    ctx.axis.power(False, stop_mode=0)
    ctx.run_for(1.5 + settle_s(ctx))
    ctx.expect(value_at(f"{axis}.power_busy", ctx.now_s, 1.0, tolerance=0.0).covers("STP-573"))
    stopped_for_good(ctx, ctx.now_s)
    fault.remove()
    ctx.wait_until(lambda: not power.Busy, 1.0, "MC_Power is no longer busy")
