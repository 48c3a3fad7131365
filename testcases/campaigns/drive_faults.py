"""Faults inside the drive and its supply, and what the axis makes of them; the same cases on virtual and live
benches.
"""

from __future__ import annotations

from typing import Any, Final

import numpy as np

from hil.campaign import Campaign, CaseContext
from hil.expect import alarm, always, happens, never_happens, no_alarm, state_at, stays_within
from hil.record import event
from testcases.campaigns._profiles import STATES, by_profile, enters, of_profile, profile_of, warns_of_mains
from testcases.campaigns._reactions import cycles, disabled_by_alarm, recovers, stopped_for_good
from testcases.campaigns.support import (
    acknowledge,
    axis_name,
    bring_into,
    drive_name,
    enable,
    grace_s,
    need_permitted_error_below,
    settle_s,
)

CAMPAIGN: Final = Campaign("drive faults", tags=("fault", "drive"), bench="reference")
CAMPAIGN.says_of("nc", "testcases.campaigns._nc_faults:DRIVE_FAULTS")

PHASES: Final = ("constant", "standstill")

TRIPS: Final[dict[str, tuple[str, dict[str, Any], int, int]]] = {
    "motor-hot": ("drive.overtemperature", {"part": "motor", "temperature_C": 160.0}, 0x4310, 421),
    "stage-hot": ("drive.overtemperature", {"part": "power_stage", "temperature_C": 120.0}, 0x4210, 421),
    "dc-link-missing": ("drive.dc_link", {"voltage_V": 0.0}, 0x3220, 421),
    "dc-link-too-high": ("drive.dc_link", {"voltage_V": 900.0}, 0x3210, 421),
    "encoder-wire": ("encoder.wire_break", {}, 0x7305, 411),
}
"""Name of the case -> kind of fault, parameters, EMCY code, technology alarm."""
COASTS: Final = ("dc-link-too-high", "encoder-wire")
"""Without DC link or motor encoder there is no torque to brake with: the drive is off at once."""


@CAMPAIGN.product(
    "trip/{what}/{phase}",
    parameters={"what": tuple(TRIPS), "phase": PHASES},
    title="the drive trips by itself ({what}) from {phase}",
    tags=("{phase}",),
    requirements=("C402-311", "C402-014", "STP-559"),
)
def trip(ctx: CaseContext, what: str, phase: str) -> None:
    """A monitor of the drive trips: EMCY, alarm with reaction 4, standstill; without the cause one MC_Reset
    recovers.
    """
    axis = axis_name(ctx)
    kind, parameters, code, number = TRIPS[what]
    enable(ctx)
    bring_into(ctx, phase)
    fault = ctx.inject(kind, drive_name(ctx), **parameters)
    ctx.run_for(4.0 + settle_s(ctx))
    ended = ctx.now_s
    applied = event("fault.applied")
    ctx.expect(
        happens(event("emcy.received", code=code), since=applied, within_s=cycles(ctx, 4) + 0.02).covers(
            "C402-311"
        ),
        alarm(number, reaction=4, since=applied, within_s=cycles(ctx, 6) + 0.02, axis=axis).covers("STP-559"),
    )
    if number == 421:
        (raised, *_) = [
            one
            for one in ctx.trace().select(source=axis, kind="alarm.raised")
            if one.data["number"] == number
        ] or [None]
        text = "" if raised is None else str(raised.data["text"])
        ctx.measure(
            "alarm 421 says that the drive has a fault", float("drive fault" in text), low=1.0, high=1.0
        )
    if what in COASTS:
        ctx.expect(happens(enters(ctx, "off after a fault"), since=applied, within_s=cycles(ctx, 3) + 0.02))
    stopped_for_good(ctx, ended)
    disabled_by_alarm(ctx, ended)
    fault.remove()
    ctx.run_for(0.2)
    recovers(ctx)
    if profile_of(ctx) == "cia402":
        ctx.expect(
            happens(event("emcy.received", code=0), since=ended)
            .named("the EMCY that ends the error")
            .covers("C301-109")
        )


@CAMPAIGN.case("acknowledge-held", requirements=("C402-015", "C402-016", "PD-137", "TA-007"))
def acknowledge_held(ctx: CaseContext) -> None:
    """A cause that lasts cannot be acknowledged; when it ends only a new edge of the bit does it, not the
    level it still has.
    """
    axis = axis_name(ctx)
    enable(ctx)
    fault = ctx.inject("drive.fault", drive_name(ctx), code=0x2310, persistent=True)
    ctx.run_for(0.5 + settle_s(ctx))
    asked = ctx.now_s
    ctx.do("MC_Reset while the cause lasts: the axis holds the bit until the drive has acknowledged")
    ctx.axis.reset()
    ctx.run_for(cycles(ctx, 10))
    fault.remove()
    ctx.run_for(cycles(ctx, 10))
    ctx.expect(
        always(
            "the bit that acknowledges is held",
            lambda word: (word.astype(np.int64) & 0x80) != 0,
            f"{axis}.stw1",
            since=asked + cycles(ctx, 4),
            until=ctx.now_s - cycles(ctx, 1),
        ),
        always(
            "the drive shows its fault",
            lambda word: (word.astype(np.int64) & 0x08) != 0,
            f"{axis}.zsw1",
            since=asked,
            until=ctx.now_s,
        ).covers(*by_profile(ctx, cia402=("C402-015", "C402-016"), profidrive=("PD-137",))),
    )
    ctx.run_for(0.3 + settle_s(ctx))
    ctx.expect(
        happens(event("alarm.raised", axis, number=421), since=ctx.now_s - 0.4 - settle_s(ctx)).covers(
            "TA-007"
        )
    )
    recovers(ctx)


@CAMPAIGN.case("mains-off", requirements=("C402-029", "C402-311"))
def mains_off(ctx: CaseContext) -> None:
    """The mains are away: warning first, 3220h when the DC link is empty; back again the axis is enabled by
    MC_Reset.
    """
    axis, drive = axis_name(ctx), drive_name(ctx)
    enable(ctx)
    fault = ctx.inject("drive.mains_off", drive)
    ctx.run_for(4.0 + settle_s(ctx))
    ctx.expect(
        happens(
            warns_of_mains(ctx),
            since=event("fault.applied"),
            within_s=cycles(ctx, 4) + 0.02,
        ),
        happens(event("emcy.received", code=0x3220), since=event("fault.applied"), within_s=4.0).covers(
            "C402-029"
        ),
        alarm(421, reaction=4, since=event("fault.applied"), axis=axis),
        always(
            "bit 7 of the status word warns",
            lambda word: (word.astype(np.int64) & 0x80) != 0,
            f"{axis}.zsw1",
            since=event("fault.applied").plus(cycles(ctx, 4) + 0.02),
            until=event("fault.removed"),
        ),
    )
    fault.remove()
    ctx.run_for(0.5)
    recovers(ctx)


@CAMPAIGN.product(
    "withdrawn/{phase}",
    parameters={"phase": PHASES},
    title="the drive falls to Switch on disabled by itself, from {phase}",
    tags=("{phase}",),
    requirements=("C402-311", "STP-560", "STP-608"),
)
def withdrawn(ctx: CaseContext, phase: str) -> None:
    """The drive leaves operation without a command: 421, coasting, recovery."""
    axis = axis_name(ctx)
    enable(ctx)
    bring_into(ctx, phase)
    ctx.inject("drive.switch_on_disabled", drive_name(ctx))
    ctx.run_for(4.0 + settle_s(ctx))
    ended = ctx.now_s
    ctx.expect(
        alarm(421, reaction=4, since=event("fault.applied"), within_s=cycles(ctx, 6), axis=axis).covers(
            "STP-560", "STP-608"
        )
    )
    (raised, *_) = ctx.trace().select(source=axis, kind="alarm.raised")
    ctx.measure(
        "alarm 421 says that it has shut down",
        float("switched itself off" in str(raised.data["text"])),
        low=1.0,
        high=1.0,
    )
    stopped_for_good(ctx, ended)
    disabled_by_alarm(ctx, ended)
    recovers(ctx)


@CAMPAIGN.product(
    "safe-stop-1/{phase}",
    parameters={"phase": PHASES},
    title="safe stop 1 from {phase}",
    tags=("{phase}",),
    requirements=("C402-030",),
)
def safe_stop_1(ctx: CaseContext, phase: str) -> None:
    """Safe stop 1: the drive brakes by itself, then takes the torque; released and acknowledged it is enabled
    again.
    """
    drive = drive_name(ctx)
    enable(ctx)
    bring_into(ctx, phase)
    fault = ctx.inject("drive.ss1", drive)
    ctx.run_for(2.0 + settle_s(ctx))
    ended = ctx.now_s
    ctx.expect(
        happens(enters(ctx, "quick stop"), since=event("fault.applied"), within_s=cycles(ctx, 1)),
        happens(enters(ctx, "switched off"), since=event("fault.applied")).covers(
            *by_profile(ctx, cia402=("C402-030",), profidrive=("PD-113",))
        ),
        happens(event("alarm.raised", axis_name(ctx)), since=event("fault.applied")),
    )
    stopped_for_good(ctx, ended)
    fault.remove()
    recovers(ctx)


@CAMPAIGN.case("sto-before-enabling", requirements=("C402-030", "STP-046"))
def sto_before_enabling(ctx: CaseContext) -> None:
    """While safe torque off is there the drive stays off, whatever the axis asks for; without it the axis is
    enabled.
    """
    drive = drive_name(ctx)
    fault = ctx.inject("drive.sto", drive)
    before = ctx.now_s
    ctx.do("MC_Power Enable = TRUE")
    power = ctx.axis.power()
    ctx.run_for(0.5 + settle_s(ctx))
    ctx.measure("MC_Power.Status with safe torque off", float(power.status()), low=0.0, high=0.0)
    ctx.expect(
        never_happens(event("drive.state", drive), since=before, until=ctx.now_s - cycles(ctx, 1)).covers(
            "C402-030"
        )
    )
    fault.remove()
    ctx.wait_until(power.status, 5.0, "the axis is enabled")


@CAMPAIGN.case("no-dc-link-before-enabling", requirements=("C402-004", "PD-103"))
def no_dc_link_before_enabling(ctx: CaseContext) -> None:
    """Without DC link the drive does not begin to operate, whatever the axis asks for; with it the axis is
    enabled.
    """
    fault = ctx.inject("drive.dc_link", drive_name(ctx), voltage_V=0.0)
    before = ctx.now_s
    ctx.do("MC_Power Enable = TRUE")
    power = ctx.axis.power()
    ctx.run_for(0.5 + settle_s(ctx))
    ctx.measure("MC_Power.Status without DC link", float(power.status()), low=0.0, high=0.0)
    until = ctx.now_s - cycles(ctx, 1)
    ctx.expect(never_happens(enters(ctx, "operating"), since=before, until=until))
    if profile_of(ctx) == "cia402":
        on = event("drive.state", drive_name(ctx), to="Switched on")
        ctx.expect(never_happens(on, since=before, until=until).covers("C402-004"))
    fault.remove()
    ctx.run_for(0.2)
    if not power.status():
        acknowledge(ctx)
    ctx.wait_until(power.status, 5.0, "the axis is enabled")


@CAMPAIGN.case("jam-comes-free", requirements=("STP-311", "PD-116"))
def jam_comes_free(ctx: CaseContext) -> None:
    """A stop of the drive begins with the speed that the motor has: a jam that comes free meanwhile sets
    nothing in motion.
    """
    axis, drive = axis_name(ctx), drive_name(ctx)
    need_permitted_error_below(ctx, 40.0, "the alarm has to come while the setpoint still moves")
    enable(ctx)
    bring_into(ctx, "constant")
    jam = ctx.inject("mechanics.jam", drive)
    ctx.wait_until(lambda: ctx.axis.object.alarms.blocking, 2.0, "the following error has become too large")
    ctx.run_for(cycles(ctx, 5))
    freed = ctx.now_s
    place_m = float(ctx.trace()[f"{drive}.position"].values[-1])
    jam.remove()
    ctx.run_for(1.5 + settle_s(ctx))
    ctx.expect(
        alarm(521, reaction=4, axis=axis),
        stays_within(f"{drive}.position", low=place_m - 0.001, high=place_m + 0.001, since=freed).named(
            "the machine stays where it was jammed"
        ),
    )


@CAMPAIGN.case("weak-quick-stop", requirements=("STP-311", "C402-012", "PD-112"))
def weak_quick_stop(ctx: CaseContext) -> None:
    """A motor too weak for the ramp comes to rest later; until it stands the drive goes on braking."""
    drive = drive_name(ctx)
    enable(ctx)
    bring_into(ctx, "constant")
    ctx.inject("drive.torque_limit", drive, share=0.03)
    before = ctx.now_s
    ctx.do("MC_Power Enable = FALSE, StopMode 1")
    ctx.axis.power(False, stop_mode=1)
    ctx.run_for(2.5 + settle_s(ctx))
    trace = ctx.trace()
    state = of_profile(ctx, STATES["switched off"])
    ends = [one for one in trace.select(source=drive, kind="drive.state") if one.data["to"] == state]
    off_s = ends[-1].time_ns * 1e-9
    ctx.check(happens(enters(ctx, "switched off"), since=before))
    ctx.measure(
        "speed of the motor when the torque goes",
        abs(float(trace[f"{drive}.motor_speed"].at(off_s))),
        "rad/s",
        high=6.0,
    )
    ctx.measure("time of the stop", off_s - before, "s", low=0.4)


HARMLESS: Final[dict[str, tuple[str, dict[str, Any]]]] = {
    "warning": ("drive.warning", {}),
    "sdo-timeout": ("drive.sdo_timeout", {}),
    "sdo-abort": ("drive.sdo_abort", {"code": 0x08000022}),
    "emcy-storm": ("drive.emcy_storm", {"code": 0xFF00, "period_s": 0.02}),
}


@CAMPAIGN.product(
    "harmless/{what}",
    parameters={"what": tuple(HARMLESS)},
    title="{what} of the drive does not stop the axis",
    requirements=("C402-310", "C402-311"),
)
def harmless(ctx: CaseContext, what: str) -> None:
    """What does not concern the cyclic data leaves the motion alone."""
    axis = axis_name(ctx)
    kind, parameters = HARMLESS[what]
    enable(ctx)
    bring_into(ctx, "constant")
    ctx.inject(kind, drive_name(ctx), duration_s=0.3, **parameters)
    ctx.run_for(0.5)
    ctx.expect(no_alarm(axis=axis), state_at(axis, ctx.now_s, "MOTION"))


@CAMPAIGN.product(
    "reset/{phase}",
    parameters={"phase": PHASES},
    title="the node restarts in operation, from {phase}",
    tags=("node", "{phase}"),
    requirements=("C402-310", "TA-020", "C301-022"),
)
def reset(ctx: CaseContext, phase: str) -> None:
    """A restart in operation: 431 or 421, boot-up frame, cyclic data again, recovery."""
    axis = axis_name(ctx)
    enable(ctx)
    bring_into(ctx, phase)
    ctx.inject("drive.reset", drive_name(ctx), boot_s=grace_s(ctx) + 0.5)
    ctx.run_for(grace_s(ctx) + 4.0 + settle_s(ctx))
    ended = ctx.now_s
    ctx.expect(
        alarm(431, reaction=4, since=event("fault.applied"), within_s=grace_s(ctx), axis=axis).covers(
            "TA-020"
        ),
        happens(event("node.bootup"), since=event("fault.applied")).covers("C301-022"),
    )
    stopped_for_good(ctx, ended)
    disabled_by_alarm(ctx, ended)
    recovers(ctx)


@CAMPAIGN.case("transition-refused", requirements=("C402-311", "STP-043", "STP-556"))
def transition_refused(ctx: CaseContext) -> None:
    """The drive does not go to Operation enabled: MC_Power waits without an alarm, and goes on once it
    does.
    """
    drive = drive_name(ctx)
    fault = ctx.inject("drive.refuse_transition", drive, transition=4)
    ctx.do("MC_Power Enable = TRUE")
    power = ctx.axis.power()
    ctx.run_for(1.0 + settle_s(ctx))
    ctx.measure("MC_Power.Status while transition 4 is refused", float(power.status()), low=0.0, high=0.0)
    ctx.measure("MC_Power.Busy meanwhile", float(power.busy()), low=1.0, high=1.0)
    ctx.expect(no_alarm(axis=axis_name(ctx)))
    before = ctx.now_s
    fault.remove()
    ctx.wait_until(power.status, 5.0, "the axis is enabled")
    ctx.expect(happens(enters(ctx, "operating"), since=before).covers("STP-043"))
