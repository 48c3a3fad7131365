"""Cases of `limits`: hardware limit switches as they should be, met in every way to be under way, and left
again.
"""

from __future__ import annotations

from typing import Any, Final

from hil.campaign import Campaign, CaseContext
from hil.expect import (
    alarm,
    golden,
    happens,
    job_output,
    no_alarm,
    no_motion_after,
    ramp,
    state_at,
    value_at,
)
from hil.record import event
from testcases.campaigns._limits import (
    DYNAMICS,
    HARDWARE_BIT,
    KINDS,
    MOTIONS,
    OTHER,
    SIGN,
    bit_at,
    configure,
    refused,
    release,
    retracts,
    set_in_motion,
    stopped_on_ramp,
    tell_stop,
)
from testcases.campaigns._profiles import profile_of
from testcases.campaigns._reactions import cycles, detection_s
from testcases.campaigns.support import (
    MAXIMUM_VELOCITY,
    VELOCITY,
    acknowledge,
    acknowledge_and_enable,
    axis_name,
    bring_into,
    drive_name,
    enable,
    settle_s,
    tolerance,
)

CASES: Final = Campaign("limits", tags=("limits", "hardware"), bench="reference")
TELLING: Final = ("cia402", "profidrive")
"""Profiles of drives that are commanded how to stop, and tell where a mark was."""
HOMING: Final = {"Sensor[1]__ActiveHoming__Mode": 1, "Homing__AutoReversal": False}
"""A homing that looks for a cam, so that it is under way when the switch comes."""


def _requirements(kind: str, side: str, motion: str) -> tuple[str, ...]:
    del side
    found = {"braking": ["LIM-034"], "disabling": ["LIM-033"], "traversable": ["LIM-032", "LIM-045"]}[kind]
    found += {"homing": ["HOM-112"], "uncontrolled": ["LIM-040"], "standstill": ["LIM-042"]}.get(motion, [])
    return (*found, "LIM-031", "LIM-037", "LIM-039", "LIM-048", "TA-015")


@CASES.product(
    "{kind}/{side}/{motion}",
    parameters={"kind": tuple(KINDS), "side": tuple(SIGN), "motion": MOTIONS},
    title="{side} switch ({kind}) met in {motion}",
    tags=("{kind}", "{motion}"),
    requirements=_requirements,
)
def approach(ctx: CaseContext, kind: str, side: str, motion: str) -> None:
    """A switch is reached: 531 with the reaction of its kind, the stop of that reaction, and the way back
    inwards only.
    """
    sign, drive = SIGN[side], drive_name(ctx)
    if motion == "homing":
        ctx.require(profile_of(ctx) in TELLING, "an encoder whose zero mark the drive can tell")
    wanted = configure(ctx, kind, **(HOMING if motion == "homing" else {}))
    enable(ctx)
    jobs = set_in_motion(ctx, motion, sign)
    press = ctx.inject("switch.press", drive, input=f"{side}_limit")
    ctx.run_for((0.25 if wanted.stays_enabled else 0.6) + settle_s(ctx))
    hit, ended = event("fault.applied"), ctx.now_s
    tell_stop(ctx, wanted, side, jobs, hit=hit)
    if motion == "homing":
        ctx.expect(alarm(342, since=hit, axis=axis_name(ctx)).covers("HOM-112"))
    stopped_on_ramp(
        ctx, wanted, hit=hit, until=ended, moving=motion != "standstill", homing=motion == "homing"
    )
    for job in jobs:
        release(job)
    _retract(ctx, kind, side, press, moved=motion != "standstill")


def _retract(ctx: CaseContext, kind: str, side: str, press: Any, *, moved: bool) -> None:
    """Acknowledge; outwards 531 comes again; inwards the switch is left, one that is traversable at the place
    where it was met.
    """
    sign, bit = SIGN[side], HARDWARE_BIT[side]
    overtravelled = kind == "traversable" and moved
    if overtravelled:
        press.remove()
        ctx.run_for(detection_s(ctx, 3))
        ctx.expect(bit_at(ctx, bit, True).covers("LIM-045"))
    acknowledge_and_enable(ctx)
    ctx.expect(bit_at(ctx, bit, True).covers("LIM-047"))
    refused(ctx, 30.0 * sign, cause="LIM-049" if kind == "traversable" else "LIM-059")
    acknowledge_and_enable(ctx)
    retracts(ctx, (-70.0 if overtravelled else -20.0) * sign)
    if not overtravelled:
        ctx.expect(bit_at(ctx, bit, True))
        press.remove()
        # A traversable switch is left where it was met, or beyond: the position tells (LIM-046).
        ctx.run_for(detection_s(ctx, 4))
    ctx.expect(bit_at(ctx, bit, False).covers("LIM-046" if kind == "traversable" else "LIM-055"))
    retracts(ctx, 5.0 * sign)


OFF: Final = {"off1": (1, 1.0), "off3": (7, 0.5)}
"""`Actor.RemoveEnableReaction` and the time of that ramp from the maximum velocity, s."""


@CASES.product(
    "remove-enable/{side}/{reaction}",
    parameters={"side": tuple(SIGN), "reaction": ("off1", "off2", "off3")},
    title="{side} switch, the drive stops by {reaction}",
    tags=("disabling",),
    requirements=("LIM-033", "LIM-107"),
)
def remove_enable(ctx: CaseContext, side: str, reaction: str) -> None:
    """The drive stops as `Actor.RemoveEnableReaction` says: three stopping distances, distinguished by the
    machine.
    """
    axis, drive = axis_name(ctx), drive_name(ctx)
    number, ramp_s = OFF.get(reaction, (3, 0.0))
    ctx.require(profile_of(ctx) in TELLING, "a drive with OFF1, OFF2 and OFF3")
    configure(ctx, "disabling", Actor__RemoveEnableReaction=number)
    enable(ctx)
    bring_into(ctx, "constant", direction=SIGN[side])
    hit = event("fault.applied")
    ctx.inject("switch.press", drive, input=f"{side}_limit")
    ctx.run_for((4.0 if reaction == "off2" else 0.9) + settle_s(ctx))
    ctx.expect(alarm(531, reaction=4, since=hit, within_s=detection_s(ctx, 3), axis=axis))
    trace, allowed = ctx.trace(), tolerance(ctx)
    pressed = trace.instant(hit)
    position = trace[f"{drive}.position"]
    way = abs(position.at(ctx.now_s) - position.at(pressed or 0.0)) * 1000.0
    if reaction == "off2":
        # Friction alone: much further than any ramp, nobody brakes.
        ctx.measure(
            "stopping distance",
            way,
            "mm",
            low=1.5 * golden.drive_ramp(VELOCITY, MAXIMUM_VELOCITY, 1.0).distance,
        )
        return
    expected = golden.drive_ramp(VELOCITY, MAXIMUM_VELOCITY, ramp_s)
    ctx.measure(
        "stopping distance",
        way,
        "mm",
        low=expected.distance,
        high=expected.distance + VELOCITY * detection_s(ctx, 5) + allowed.distance,
        requirements=("LIM-033", "LIM-107"),
    )
    ctx.expect(
        ramp(
            hit,
            axis=axis,
            velocity=f"{drive}.motor_speed",
            position=f"{drive}.position",
            made_by="drive",
            time_s=expected.time_s,
            time_tolerance_s=allowed.time_s,
            threshold=6.0,
            delay_s=detection_s(ctx, 5),
            distance=expected.distance * 0.001,
            distance_tolerance=allowed.distance * 0.001,
        ).covers("LIM-107")
    )


@CASES.product(
    "mc-stop/{side}/{kind}/{mode}",
    parameters=[
        {"side": side, "kind": kind, "mode": mode}
        for side in SIGN
        for kind, mode in (("braking", 0), ("braking", 3), ("disabling", 0))
    ],
    title="{side} switch ({kind}) during MC_Stop Mode {mode}",
    tags=("{kind}", "stop"),
    requirements=("LIM-037",),
)
def during_stop(ctx: CaseContext, side: str, kind: str, mode: int) -> None:
    """`MC_Stop` gives way to a reaction that ranks higher, with `CommandAborted`; its own emergency ramp goes
    on to `Done`.
    """
    sign, axis = SIGN[side], axis_name(ctx)
    wanted = configure(ctx, kind)
    enable(ctx)
    bring_into(ctx, "constant", direction=sign)
    ctx.do(f"MC_Stop Mode {mode}")
    stop = ctx.axis.stop(mode, Deceleration=600.0, Jerk=0.0)
    ctx.run_for(0.02)
    hit = event("fault.applied")
    ctx.inject("switch.press", drive_name(ctx), input=f"{side}_limit")
    ctx.run_for(0.6 + settle_s(ctx))
    higher = not (wanted.stays_enabled and mode == 0)
    ctx.expect(
        alarm(531, reaction=wanted.reaction, since=hit, within_s=detection_s(ctx, 3), axis=axis),
        job_output(stop.name, "CommandAborted" if higher else "Done", since=hit).covers("LIM-037"),
        no_motion_after(ctx.now_s - 0.05, position=f"{drive_name(ctx)}.position", tolerance=0.00005),
    )


@CASES.product(
    "disabled/{side}/{kind}",
    parameters={"side": tuple(SIGN), "kind": tuple(KINDS)},
    title="a disabled axis on the {side} switch ({kind})",
    tags=("{kind}",),
    requirements=("LIM-041", "LIM-042"),
)
def disabled(ctx: CaseContext, side: str, kind: str) -> None:
    """531 without any motion; acknowledged on the switch, the axis is enabled there, leaves it inwards, and
    alarms once more at a restart.
    """
    sign, axis, drive, bit = SIGN[side], axis_name(ctx), drive_name(ctx), HARDWARE_BIT[side]
    wanted = configure(ctx, kind)
    hit = event("fault.applied")
    press = ctx.inject("switch.press", drive, input=f"{side}_limit")
    ctx.run_for(detection_s(ctx, 5))
    ctx.expect(
        alarm(531, reaction=wanted.reaction, since=hit, within_s=detection_s(ctx, 3), axis=axis).covers(
            "LIM-042"
        ),
        state_at(axis, ctx.now_s, "ALARM_DISABLED"),
        bit_at(ctx, bit, True),
    )
    ctx.do("MC_Reset Restart = TRUE on the switch")
    again = ctx.now_s
    ctx.wait_until(ctx.axis.reset(restart=True).done, 5.0, "the axis is restarted")
    ctx.run_for(cycles(ctx, 5))
    ctx.expect(alarm(531, reaction=wanted.reaction, since=again, axis=axis).covers("LIM-041"))
    acknowledge(ctx)
    quiet = ctx.now_s
    ctx.run_for(0.1)
    ctx.expect(no_alarm(since=quiet, until=ctx.now_s, axis=axis).covers("LIM-041"))
    enable(ctx)
    retracts(ctx, -15.0 * sign)
    press.remove()
    ctx.run_for(detection_s(ctx, 4))
    ctx.expect(bit_at(ctx, bit, False))


@CASES.product(
    "simulated/{side}",
    parameters={"side": tuple(SIGN)},
    title="a simulated axis and the {side} switch",
    requirements=("LIM-007",),
)
def simulated(ctx: CaseContext, side: str) -> None:
    """`Simulation.Mode`: both switches and the home switch change, and nothing happens to the axis."""
    axis, drive = axis_name(ctx), drive_name(ctx)
    configure(ctx, "braking", Simulation__Mode=1)
    enable(ctx)
    bring_into(ctx, "constant", direction=SIGN[side])
    since = ctx.now_s
    for name in (f"{side}_limit", f"{OTHER[side]}_limit", "home"):
        ctx.inject("switch.press", drive, input=name)
        ctx.run_for(0.05)
    ctx.expect(
        no_alarm(since=since, axis=axis).covers("LIM-007"),
        bit_at(ctx, 17, False),
        bit_at(ctx, 18, False),
        value_at(f"{axis}.velocity_setpoint", ctx.now_s, VELOCITY * SIGN[side], tolerance=1e-6),
    )


@CASES.product(
    "real-travel/{side}/{kind}",
    parameters={"side": tuple(SIGN), "kind": tuple(KINDS)},
    title="the load itself drives onto the {side} switch ({kind})",
    tags=("{kind}", "travel"),
    requirements=("LIM-029", "LIM-031", "LIM-048"),
)
def real_travel(ctx: CaseContext, side: str, kind: str) -> None:
    """Nobody forces an input: the load travels onto the switch, stops in front of the end stop, and comes
    back over it.
    """
    sign, axis, drive = SIGN[side], axis_name(ctx), drive_name(ctx)
    section = ctx.bench.config.drive[drive]
    switch = getattr(section.switches, f"{side}_limit_mm")
    stop = getattr(section.mechanics, f"{side}_stop_mm")
    wanted = configure(ctx, kind)
    enable(ctx)
    ctx.do("MC_MoveRelative close to the switch")
    to_go = switch - section.mechanics.start_position_mm
    job = ctx.axis.move_relative(
        to_go - 60.0 * sign, Velocity=500.0, Acceleration=2000.0, Deceleration=2000.0, Jerk=0.0
    )
    ctx.wait_until(job.done, 10.0, "the axis is close to the switch")
    since = ctx.now_s
    run = ctx.axis.move_velocity(200.0 * sign, **(DYNAMICS | {"Jerk": 0.0}))
    ctx.wait_until(run.error, 5.0, "the switch has stopped the axis")
    ctx.run_for(0.5 + settle_s(ctx))
    place = abs(ctx.trace()[f"{drive}.position"].at(ctx.now_s)) * 1000.0
    ctx.expect(
        alarm(531, reaction=wanted.reaction, since=since, axis=axis),
        happens(event("drive.inputs", drive), since=since),
    )
    ctx.measure(
        "place of the load behind the switch",
        place,
        "mm",
        low=abs(switch),
        high=abs(stop),
        requirements=("LIM-029",),
    )
    ctx.expect(bit_at(ctx, HARDWARE_BIT[side], True))
    acknowledge_and_enable(ctx)
    retracts(ctx, (abs(switch) - place - 10.0) * sign)
    ctx.expect(bit_at(ctx, HARDWARE_BIT[side], False).covers("LIM-048"))
