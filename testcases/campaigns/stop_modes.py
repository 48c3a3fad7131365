"""Every way to stop an axis, in every phase of its motion, against the numbers of the specification.

Twelve stops (`MC_Power` StopMode 0 to 3, `MC_Stop` Mode 0, 2 and 3, alarm reactions 1 to 4, `MC_Halt`) are
crossed with constant travel, acceleration, deceleration and standstill.
"""

from __future__ import annotations

import math
from typing import Any, Final, Literal

from hil.campaign import Campaign, CaseContext
from hil.expect import (
    Expectation,
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
from testcases.campaigns.own_axis import Dynamics, own
from testcases.campaigns.support import (
    PHASES,
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
CAMPAIGN.says_of("nc", "testcases.campaigns._nc_stops:STOP_MODES")

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

WITH_INPUTS: Final = ("stop-3", "halt")
"""Stops whose instruction has inputs for deceleration and jerk."""

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


def braking_of(ctx: CaseContext, stop: str) -> Dynamics | None:
    """Return what a stop with inputs brakes with, drawn from the seed or the dynamic defaults; None: it has
    no inputs.
    """
    if stop not in WITH_INPUTS:
        return None
    values = own(ctx)
    by_inputs = values.draw(f"inputs of {stop}", 0.0, 1.0) < 0.5
    return values.dynamics(stop, braking=(0.62, 0.8)) if by_inputs else values.defaults()


def give(ctx: CaseContext, stop: str) -> Any:
    """Give the stop; returns the instance that shows its end."""
    kind, _, number = stop.partition("-")
    braking = braking_of(ctx, stop)
    inputs = {} if braking is None or braking == own(ctx).defaults() else braking.braking
    words = "".join(f", {name} {value:.5g}" for name, value in inputs.items())
    if kind == "power":
        ctx.do(f"MC_Power Enable = FALSE, StopMode {number}")
        return ctx.axis.power(False, stop_mode=int(number))
    if kind == "stop":
        ctx.do(f"MC_Stop Mode {number}{words}")
        return ctx.axis.stop(int(number), **inputs)
    if kind == "halt":
        ctx.do(f"MC_Halt{words}")
        return ctx.axis.halt(**inputs)
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
    allowed, values = tolerance(ctx), own(ctx)
    axis, drive = axis_name(ctx), drive_name(ctx)
    before = ctx.now_s
    instance = give(ctx, stop)
    coast = facts["ramp"] == "coast"
    ctx.run_for((4.0 if coast and phase != "standstill" else 1.2 + values.settling_s) + settle_s(ctx))
    ended = ctx.now_s

    ctx.expect(state_at(axis, ended, facts["end"]).covers(*facts["ids"]))
    ctx.expect(
        standstill(by=ended - 0.2, axis=axis, tolerance=values.slow),
        no_motion_after(ended - 0.2, axis=axis, tolerance=values.still),
    )
    if stop in CONTROL_WORDS:
        ctx.expect(stw1_sequence(CONTROL_WORDS[stop], axis=axis, since=before))
    if job is not None:
        output = "Error" if stop.startswith("reaction") else "CommandAborted"
        error_id = 0x8001 if stop.startswith("reaction") else None
        ctx.expect(
            job_output(
                job.name, output, since=before, within_s=allowed.time_s + values.call_s, error_id=error_id
            )
        )
    if stop.startswith("power"):
        ctx.expect(value_at(f"{axis}.power_status", ended, 0.0, tolerance=0.0))
        ctx.expect(value_at(f"{axis}.power_busy", ended, 0.0, tolerance=0.0).covers("STP-294"))
    elif stop.startswith("reaction"):
        ctx.expect(value_at(f"{axis}.power_busy", ended, 1.0, tolerance=0.0).covers("STP-344"))
    elif instance is not None:
        ctx.expect(job_output(instance.name, "Done", since=before))
        ctx.expect(value_at(f"{axis}.power_status", ended, 1.0, tolerance=0.0))
    if phase == "standstill":
        ctx.expect(no_motion_after(before, axis=axis, tolerance=values.still).covers("STP-298"))
        return
    if coast:
        # The mechanics alone decide; what can be said is that nobody brakes: the drive has no torque from now
        # on.
        ctx.expect(
            ramp(
                state_change(ctx, facts["state"]),
                axis=axis,
                velocity=f"{drive}.motor_speed",
                position=f"{drive}.position",
                threshold=values.rpm(values.slow) / 6.0,
            )
        )
        return
    by_drive = facts["ramp"] == "off3"
    since = ramp_begins(ctx, stop)
    expected = expectation(ctx, stop, phase, since)
    ctx.expect(
        ramp_of(ctx, stop, since, expected, made_by="drive" if by_drive else None).covers(
            *requirements_of(stop, phase)
        )
    )
    # What the machine does: the same ramp, later by the transport delay of two cycles.
    delay_s = 2 * ctx.bench.cycle_ns * 1e-9
    # An emergency ramp begins at the actual position, the others at a setpoint that is ahead of it by what
    # the precontrol leaves to position control.
    start_s = None if facts["ramp"] == "emergency" else ctx.trace().instant(since)
    behind = 0.0 if start_s is None else ctx.trace()[f"{axis}.following_error"].at(start_s)
    if phase == "constant" and not by_drive:
        ctx.expect(
            ramp(
                since,
                axis=axis,
                velocity=f"{drive}.velocity",
                position=f"{drive}.position",
                distance=values.metres(expected.distance + values.velocity * delay_s + behind),
                distance_tolerance=values.metres(allowed.distance),
                threshold=values.metres(values.slow / 2.0),
            ).named("travel of the machine")
        )


def ramp_begins(ctx: CaseContext, stop: str) -> EventSelector:
    """Select the instant at which the ramp of a stop begins."""
    kind = STOPS[stop]["ramp"]
    if kind == "off3":
        return quick_stop(ctx)
    since = state_change(ctx, STOPS[stop]["state"])
    if kind == "emergency" and (
        stop.startswith("reaction") or ctx.bench.interpolator_ns > ctx.bench.cycle_ns
    ):
        # Here the setpoint goes to the actual position, where the ramp begins, in the cycle after the state.
        return since.plus(ctx.bench.cycle_ns * 1e-9)
    return since


def ramp_of(
    ctx: CaseContext,
    stop: str,
    since: EventSelector,
    expected: golden.StopRamp,
    *,
    made_by: Literal["drive"] | None = None,
) -> Expectation:
    """Expect the ramp of a stop: of the setpoint, or of the machine where the drive makes it.

    Args:
        ctx: The case.
        stop: One of `STOPS`, not one that coasts.
        since: Beginning of the ramp.
        expected: Its time and its travel.
        made_by: Who has to make it; None: that is not asked.

    """
    allowed, values = tolerance(ctx), own(ctx)
    axis, drive = axis_name(ctx), drive_name(ctx)
    by_drive = STOPS[stop]["ramp"] == "off3"
    factor = values.golden.machine_m if by_drive else 1.0
    return ramp(
        since,
        axis=axis,
        velocity=f"{drive}.motor_speed" if by_drive else f"{axis}.velocity_setpoint",
        position=f"{drive}.position" if by_drive else f"{axis}.position_setpoint",
        time_s=expected.time_s,
        time_tolerance_s=allowed.time_s,
        distance=expected.distance * factor,
        distance_tolerance=allowed.distance * factor,
        delay_s=5 * ctx.bench.interpolator_ns * 1e-9 + float(ctx.bench.config.tolerance.time_s),
        made_by=made_by,
        threshold=values.rpm(values.slow) if by_drive else 1e-9 * values.golden.maximum_velocity,
    )


def expectation(
    ctx: CaseContext,
    stop: str,
    phase: str,
    since: EventSelector | float,
    *,
    running: Dynamics | None = None,
) -> golden.StopRamp:
    """Return the ramp by the formulas of the specification, from the velocity that the trace shows at its
    beginning.

    Args:
        ctx: The case.
        stop: One of `STOPS`.
        phase: Phase of motion; in another one than `PHASES` the trace tells the acceleration.
        since: Beginning of the ramp.
        running: What the job brakes with that runs; None: with the dynamics of the case.

    """
    trace = ctx.trace()
    start_s = trace.instant(since)
    if start_s is None:
        return golden.StopRamp(0.0, 0.0, 0.0)
    axis, values, kind = axis_name(ctx), own(ctx), STOPS[stop]["ramp"]
    limits, running = values.golden, running or values.dynamics()
    if kind == "off3":
        return limits.off3(values.of_rpm(trace[f"{drive_name(ctx)}.motor_speed"].at(start_s)))
    if kind == "emergency":
        return limits.emergency(trace[f"{axis}.actual_velocity"].at(start_s))
    velocity = trace[f"{axis}.velocity_setpoint"].at(start_s)
    if phase in PHASES:
        present = {"accelerating": running.acceleration, "decelerating": -running.deceleration}.get(
            phase, 0.0
        )
    else:
        present = trace[f"{axis}.acceleration_setpoint"].at(start_s) * math.copysign(1.0, velocity)
    braking = braking_of(ctx, stop) or running
    if kind == "maximum":
        braking = Dynamics(0.0, limits.maximum_deceleration, limits.maximum_jerk)
    return braking.stop(velocity, present)
