"""Every way to stop an axis, in every phase of its motion, against the numbers of the specification.

Twelve stops (`MC_Power` StopMode 0 to 3, `MC_Stop` Mode 0, 2 and 3, alarm reactions 1 to 4, `MC_Halt`) are
crossed with constant travel, acceleration, deceleration and standstill.
"""

from __future__ import annotations

import math
from typing import Any, Final

from hil.campaign import Campaign, CaseContext
from hil.expect import (
    golden,
    job_output,
    no_motion_after,
    ramp,
    standstill,
    state_at,
    stw1_sequence,
    value_at,
)
from hil.record import EventSelector
from testcases.campaigns.support import (
    ACCELERATION,
    MAXIMUM_VELOCITY,
    PHASES,
    VELOCITY,
    axis_name,
    bring_into,
    drive_name,
    enable,
    quick_stop,
    settle_s,
    state_change,
    tolerance,
)

CAMPAIGN: Final = Campaign("stop modes", tags=("stop",), bench="reference")

ALARM_OF_REACTION: Final = {1: 533, 2: 104, 3: 304, 4: 521}

STOPS: Final[dict[str, dict[str, Any]]] = {
    "power-0": {
        "state": "DISABLING_RAMP",
        "end": "DISABLED",
        "ramp": "emergency",
        "ids": ("STP-239", "STP-301"),
    },
    "power-1": {"state": "DISABLING_QUICK", "end": "DISABLED", "ramp": "off3", "ids": ("STP-240", "STP-311")},
    "power-2": {
        "state": "DISABLING_RAMP",
        "end": "DISABLED",
        "ramp": "maximum",
        "ids": ("STP-241", "STP-324"),
    },
    "power-3": {
        "state": "DISABLING_COAST",
        "end": "DISABLED",
        "ramp": "coast",
        "ids": ("STP-242", "STP-331"),
    },
    "stop-0": {"state": "STOPPING", "end": "STOP_HOLD", "ramp": "emergency", "ids": ("STP-248", "STP-416")},
    "stop-2": {"state": "STOPPING", "end": "STOP_HOLD", "ramp": "maximum", "ids": ("STP-249", "STP-418")},
    "stop-3": {"state": "STOPPING", "end": "STOP_HOLD", "ramp": "current", "ids": ("STP-250", "STP-419")},
    "reaction-1": {
        "state": "ALARM_RAMP",
        "end": "ALARM_STANDSTILL",
        "ramp": "current",
        "ids": ("STP-243", "STP-590"),
    },
    "reaction-2": {
        "state": "ALARM_RAMP",
        "end": "ALARM_DISABLED",
        "ramp": "maximum",
        "ids": ("STP-244", "STP-592"),
    },
    "reaction-3": {
        "state": "ALARM_RAMP",
        "end": "ALARM_DISABLED",
        "ramp": "emergency",
        "ids": ("STP-245", "STP-593"),
    },
    "reaction-4": {
        "state": "ALARM_DRIVE_STOP",
        "end": "ALARM_DISABLED",
        "ramp": "off3",
        "ids": ("STP-246", "STP-348"),
    },
    "halt": {"state": "HALTING", "end": "STANDSTILL", "ramp": "current", "ids": ("STP-247", "STP-402")},
}

WORDS: Final = {
    "power-0": "MC_Power StopMode 0, emergency ramp",
    "power-1": "MC_Power StopMode 1, quick stop of the drive",
    "power-2": "MC_Power StopMode 2, maximum dynamic values",
    "power-3": "MC_Power StopMode 3, coast",
    "stop-0": "MC_Stop Mode 0, emergency ramp",
    "stop-2": "MC_Stop Mode 2, maximum dynamic values",
    "stop-3": "MC_Stop Mode 3, given dynamic values",
    "reaction-1": "alarm reaction 1, current dynamic values",
    "reaction-2": "alarm reaction 2, maximum dynamic values",
    "reaction-3": "alarm reaction 3, emergency ramp",
    "reaction-4": "alarm reaction 4, remove enable",
    "halt": "MC_Halt",
}
PHASE_WORDS: Final = {
    "constant": "from constant travel",
    "accelerating": "while accelerating",
    "decelerating": "while decelerating",
    "standstill": "at standstill",
}

GOLDEN: Final = {
    "emergency": "STP-008",
    "maximum": "STP-009",
    "off3": "STP-010",
    "current": "STP-012",
    "coast": "STP-014",
}

CONTROL_WORDS: Final = {
    "power-0": (0x047F, 0x047E),
    "power-1": (0x047F, 0x047B, 0x0478, 0x047E),
    "power-2": (0x047F, 0x047E),
    "power-3": (0x047F, 0x047C),
    "reaction-2": (0x047F, 0x047E),
    "reaction-3": (0x047F, 0x047E),
    "reaction-4": (0x047F, 0x047B, 0x0478),
}


def requirements_of(stop: str, phase: str, words: str = "") -> tuple[str, ...]:
    """Return the identifiers that a combination checks."""
    del words
    facts = STOPS[stop]
    ids = tuple(facts["ids"])
    return (*ids, GOLDEN[facts["ramp"]]) if phase == "constant" else ids


def give(ctx: CaseContext, stop: str) -> Any:
    """Give the stop; returns the instance that shows its end."""
    kind, _, number = stop.partition("-")
    if kind == "power":
        ctx.do(f"MC_Power Enable = FALSE, StopMode {number}")
        return ctx.axis.power(False, stop_mode=int(number))
    if kind == "stop":
        ctx.do(f"MC_Stop Mode {number}")
        return ctx.axis.stop(int(number))
    if kind == "halt":
        ctx.do("MC_Halt")
        return ctx.axis.halt()
    reaction = int(number)
    alarm_number = ALARM_OF_REACTION[reaction]
    ctx.do(f"alarm {alarm_number} with reaction {reaction}")
    ctx.inject("axis.alarm", axis_name(ctx), number=alarm_number, reaction=reaction)
    return None


@CAMPAIGN.product(
    "{stop}/{phase}",
    parameters=[
        {"stop": stop, "phase": phase, "words": f"{WORDS[stop]}, {PHASE_WORDS[phase]}"}
        for stop in STOPS
        for phase in PHASES
    ],
    title="{words}",
    tags=("{phase}",),
    requirements=requirements_of,
)
def stop_case(ctx: CaseContext, stop: str, phase: str, words: str) -> None:
    """Stop an axis and compare ramp, travel, control words, job outputs and end state with the
    specification.
    """
    del words  # the title
    enable(ctx)
    stops_as_specified(ctx, stop, phase, bring_into(ctx, phase))


def stops_as_specified(ctx: CaseContext, stop: str, phase: str, job: Any) -> None:
    """Give a stop in a phase of a job (None at standstill), and expect of it what the specification says."""
    facts = STOPS[stop]
    allowed = tolerance(ctx)
    axis, drive = axis_name(ctx), drive_name(ctx)
    before = ctx.now_s
    instance = give(ctx, stop)
    coast = facts["ramp"] == "coast"
    ctx.run_for((4.0 if coast and phase != "standstill" else 1.5) + settle_s(ctx))
    ended = ctx.now_s

    since = state_change(ctx, facts["state"])
    ctx.expect(state_at(axis, ended, facts["end"]).covers(*facts["ids"]))
    ctx.expect(standstill(by=ended - 0.2, axis=axis), no_motion_after(ended - 0.2, axis=axis))
    if stop in CONTROL_WORDS:
        ctx.expect(stw1_sequence(CONTROL_WORDS[stop], axis=axis, since=before))
    if job is not None:
        output = "Error" if stop.startswith("reaction") else "CommandAborted"
        error_id = 0x8001 if stop.startswith("reaction") else None
        ctx.expect(job_output(job.name, output, since=before, within_s=allowed.time_s, error_id=error_id))
    if stop.startswith("power"):
        ctx.expect(value_at(f"{axis}.power_status", ended, 0.0, tolerance=0.0))
        ctx.expect(value_at(f"{axis}.power_busy", ended, 0.0, tolerance=0.0).covers("STP-294"))
    elif stop.startswith("reaction"):
        ctx.expect(value_at(f"{axis}.power_busy", ended, 1.0, tolerance=0.0).covers("STP-344"))
    elif instance is not None:
        ctx.expect(job_output(instance.name, "Done", since=before))
        ctx.expect(value_at(f"{axis}.power_status", ended, 1.0, tolerance=0.0))
    if phase == "standstill":
        ctx.expect(no_motion_after(before, axis=axis).covers("STP-298"))
        return
    if coast:
        # The mechanics alone decide; what can be said is that nobody brakes: the drive has no torque from now
        # on.
        ctx.expect(
            ramp(
                since, axis=axis, velocity=f"{drive}.motor_speed", position=f"{drive}.position", threshold=1.0
            )
        )
        return
    by_drive = facts["ramp"] == "off3"
    if by_drive:
        since = quick_stop(ctx)
    expected = expectation(ctx, facts["ramp"], phase, since)
    factor = 0.001 if by_drive else 1.0
    identifiers = requirements_of(stop, phase)
    ctx.expect(
        ramp(
            since,
            axis=axis,
            velocity=f"{drive}.motor_speed" if by_drive else f"{axis}.velocity_setpoint",
            position=f"{drive}.position" if by_drive else f"{axis}.position_setpoint",
            time_s=expected.time_s,
            time_tolerance_s=allowed.time_s,
            distance=expected.distance * factor,
            distance_tolerance=allowed.distance_mm * factor,
            delay_s=5 * ctx.bench.cycle_ns * 1e-9 + float(ctx.bench.config.tolerance.time_s),
            made_by="drive" if by_drive else None,
            threshold=6.0 if by_drive else 1e-9,
        ).covers(*identifiers)
    )
    # What the machine does: the same ramp, later by the transport delay of two cycles.
    delay_s = 2 * ctx.bench.cycle_ns * 1e-9
    if phase == "constant" and not by_drive:
        ctx.expect(
            ramp(
                since,
                axis=axis,
                velocity=f"{drive}.velocity",
                position=f"{drive}.position",
                distance=(expected.distance + VELOCITY * delay_s) * 0.001,
                distance_tolerance=allowed.distance_mm * 0.001,
                threshold=0.0005,
            ).named("travel of the machine")
        )


def expectation(ctx: CaseContext, kind: str, phase: str, since: EventSelector | float) -> golden.StopRamp:
    """Return the ramp by the formulas of the specification, from the velocity that the trace shows at its
    beginning.

    Args:
        ctx: The case.
        kind: Kind of ramp, of `STOPS`.
        phase: Phase of motion; in another one than those of the reference axis the trace tells the
            acceleration.
        since: Beginning of the ramp.

    """
    trace = ctx.trace()
    start_s = trace.instant(since)
    if start_s is None:
        return golden.StopRamp(0.0, 0.0, 0.0)
    axis = axis_name(ctx)
    if kind == "off3":
        speed = abs(trace[f"{drive_name(ctx)}.motor_speed"].at(start_s)) * MAXIMUM_VELOCITY / 3000.0
        return golden.drive_ramp(speed, MAXIMUM_VELOCITY, 0.5)
    if kind == "emergency":
        return golden.stop_ramp(abs(trace[f"{axis}.actual_velocity"].at(start_s)), 4000.0)
    velocity = trace[f"{axis}.velocity_setpoint"].at(start_s)
    if phase in PHASES:
        present = {"accelerating": ACCELERATION, "decelerating": -ACCELERATION}.get(phase, 0.0)
    else:
        present = trace[f"{axis}.acceleration_setpoint"].at(start_s) * math.copysign(1.0, velocity)
    velocity = abs(velocity)
    if kind == "maximum":
        return golden.stop_ramp(velocity, 2000.0, 20_000.0, acceleration=present)
    return golden.stop_ramp(velocity, 1000.0, 10_000.0, acceleration=present)
