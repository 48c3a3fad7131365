"""Cases of `control`: machine, encoder, telegram, safety functions and torque limits that act on the loop."""

from __future__ import annotations

from itertools import pairwise
from math import pi
from typing import Any, Final

import numpy as np

from hil.campaign import Campaign, CaseContext
from hil.expect import alarm, job_output, no_alarm, state_at
from testcases.campaigns._control_travel import WHERE, loop
from testcases.campaigns._loop import (
    APPLIED,
    UNHURRIED,
    WIDE,
    Run,
    acknowledged,
    alarm_after,
    begin,
    configure,
    cycle_s,
    increments,
    position_control_in,
    quiet,
    travel,
)
from testcases.campaigns._profiles import profile_of
from testcases.campaigns.support import axis_name, drive_name, drive_setting

CASES: Final = Campaign("control", tags=("control",), bench="reference")


@CASES.product(
    "jam/{where}/{velocity}",
    parameters={"where": WHERE, "velocity": (60, -200)},
    title="jammed at {velocity} mm/s, loop in the {where}",
    tags=("mechanics", "{where}"),
    requirements=("MON-033", "MON-040", "CTL-027"),
)
def jam(ctx: CaseContext, where: str, velocity: int) -> None:
    """The permitted following error is used up in the same time wherever the position is controlled."""
    begin(ctx, position_control_in(ctx, where))
    travel(ctx, velocity)
    blocked = ctx.inject("mechanics.jam", drive_name(ctx))
    allowed = float(np.interp(abs(velocity), (50.0, 500.0), (2.0, 10.0)))
    ctx.run_for(allowed / abs(velocity) + 0.5)
    alarm_after(ctx, 521, allowed / abs(velocity), early_s=0.003, requirements=("MON-033", "MON-040"))
    blocked.remove()
    ctx.run_for(0.1)
    acknowledged(ctx)


@CASES.product(
    "push/{where}",
    parameters={"where": WHERE},
    title="a push at standstill, loop in the {where}",
    tags=("mechanics", "{where}"),
    requirements=("CTL-001", "CTL-034"),
)
def push(ctx: CaseContext, where: str) -> None:
    """A force within the torque displaces the axis for a moment; the loop brings it back, and holds it while
    the force lasts.
    """
    loop(ctx, where)
    ctx.run_for(0.1)
    since = ctx.now_s
    ctx.inject("mechanics.load_step", drive_name(ctx), force_N=500.0)
    ctx.run_for(0.6)
    run = Run(ctx, since)
    ctx.measure(
        "greatest displacement",
        float(abs(run.actual_position - run.actual_position[0]).max()),
        "mm",
        low=0.001,
        high=0.2,
    )
    ctx.measure(
        "displacement in the end",
        float(abs(run.actual_position[-1] - run.position_setpoint[-1])),
        "mm",
        high=0.01,
    )
    quiet(ctx)


@CASES.product(
    "encoder/{fault}/{where}",
    parameters={"fault": ("freeze", "reverse", "jump"), "where": WHERE},
    title="encoder {fault} at 100 mm/s, loop in the {where}",
    tags=("encoder", "{where}"),
    requirements=("MON-040", "MON-033"),
    without=("STP-331",),
)
def encoder(ctx: CaseContext, fault: str, where: str) -> None:
    """What the encoder says wrongly is found by the following error, wherever the loop is, before the machine
    is far away.
    """
    axis = axis_name(ctx)
    begin(ctx, position_control_in(ctx, where))
    travel(ctx, 100.0)
    if fault == "jump":
        ctx.inject("encoder.jump", drive_name(ctx), increments=increments(ctx, 6.0))
    else:
        ctx.inject(f"encoder.{fault}", drive_name(ctx), duration_s=0.3)
    ctx.run_for(1.5)
    within = {"freeze": 0.029 + 2 * cycle_s(ctx), "reverse": 0.05, "jump": 2 * cycle_s(ctx)}[fault]
    ctx.expect(alarm(521, reaction=4, since=APPLIED, within_s=within, axis=axis).covers("MON-040"))
    ctx.measure("power of the axis", float(Run(ctx).power_status[-1]), high=0.0)


@CASES.product(
    "telegram/{word}",
    parameters={"word": ("kpc-halved", "xerr-offset", "xerr-stuck", "speed-scaled")},
    title="a word of the loop in the drive is wrong: {word}",
    tags=("bus", "drive"),
    requirements=("CTL-029", "CTL-031", "MON-033"),
)
def wrong_word(ctx: CaseContext, word: str) -> None:
    """Half of KPC is half the gain, an offset of XERR is an offset of the position, a wrong speed is
    corrected by the loop.
    """
    axis, drive = axis_name(ctx), drive_name(ctx)
    loop(ctx, "drive", PositionControl__Kpc=0.0 if word == "kpc-halved" else 100.0)
    travel(ctx, 100.0)
    ctx.run_for(0.3)
    before = float(Run(ctx).following_error[-1])
    increment = abs(float(ctx.axis.object.mechanics.increment))
    options: dict[str, Any] = {
        "kpc-halved": {"kind": "telegram.scale", "signal": "KPC", "factor": 0.5},
        "xerr-offset": {"kind": "telegram.offset", "signal": "XERR", "counts": round(0.5 / increment)},
        "xerr-stuck": {"kind": "telegram.stuck", "signal": "XERR"},
        "speed-scaled": {"kind": "telegram.scale", "signal": "NSOLL_B", "factor": 0.9},
    }[word]
    kind = options.pop("kind")
    ctx.inject(kind, drive, direction="setpoint", **options)
    ctx.run_for(0.6)
    after = float(Run(ctx).following_error[-1])
    expected = {"kpc-halved": before, "xerr-offset": -0.5, "speed-scaled": 10.0 / 25.0, "xerr-stuck": 0.0}[
        word
    ]
    ctx.measure(
        "change of the following error",
        after - before,
        "mm",
        low=expected - 0.05,
        high=expected + 0.05,
        requirements=("CTL-031",),
    )
    ctx.expect(no_alarm(axis=axis), state_at(axis, ctx.now_s, "MOTION"))


@CASES.product(
    "safety/{function}/{where}",
    parameters={"function": ("sto", "ss2"), "where": WHERE},
    title="{function} at 200 mm/s, loop in the {where}",
    tags=("safety", "{where}"),
    requirements=("CTL-097", "CTL-098"),
)
def safety(ctx: CaseContext, function: str, where: str) -> None:
    """STO: friction alone brakes, 421. SS2: the ramp of OFF3, then a push is resisted, 550."""
    axis, drive = axis_name(ctx), drive_name(ctx)
    loop(ctx, where)
    travel(ctx, 200.0)
    ctx.inject("drive.sto" if function == "sto" else "safety.ss2", drive)
    applied = ctx.now_s
    ctx.run_for(0.4)
    run = Run(ctx, applied + 3 * cycle_s(ctx))
    times, velocity = run.drive("velocity")
    if function == "sto":
        mechanics = ctx.bench.config.drive[drive].mechanics
        per_metre = (
            2.0
            * np.pi
            / mechanics.lead_screw_mm
            * 1000.0
            * mechanics.gear_numerator
            / mechanics.gear_denominator
        )
        mass = (
            mechanics.load_mass_kg
            + (mechanics.motor_inertia_kgm2 + mechanics.screw_inertia_kgm2) * per_metre**2
        )
        friction = mechanics.coulomb_friction_n + mechanics.viscous_friction_n_per_m_s * float(
            velocity.mean()
        )
        slope = float((velocity[0] - velocity[-1]) / (times[-1] - times[0]))
        ctx.measure(
            "deceleration",
            slope,
            "m/s²",
            low=0.95 * friction / mass,
            high=1.05 * friction / mass,
            requirements=("CTL-097",),
        )
        ctx.expect(alarm(421, reaction=4, since=applied, within_s=0.05, axis=axis))
        return
    ctx.expect(alarm(550, reaction=5, since=applied, within_s=0.05, axis=axis).covers("CTL-098"))
    moving = times[abs(velocity) > 0.002]
    ramp = 200.0 / 500.0 * float(drive_setting(ctx, "off3_ramp_s"))
    ctx.measure(
        "time of the ramp",
        float(moving[-1]) - applied,
        "s",
        low=ramp - 0.02,
        high=ramp + 0.02,
        requirements=("CTL-098",),
    )
    since = ctx.now_s
    ctx.inject("mechanics.load_step", drive, force_N=250.0)
    ctx.run_for(0.3)
    _, position = Run(ctx, since).drive("position")
    ctx.measure(
        "way of the push",
        float(abs(position - position[0]).max()) * 1000.0,
        "mm",
        high=2.0,
        requirements=("CTL-098",),
    )


@CASES.product(
    "torque-limit/{mode}",
    parameters={"mode": ("controlled", "not-controlled", "force-at-the-load")},
    title="torque limit, {mode}",
    tags=("torque",),
    requirements=lambda mode: ("CTL-092", *(("STP-140",) if mode == "force-at-the-load" else ())),
)
def torque_limit(ctx: CaseContext, mode: str) -> None:
    """A limit of MC_TorqueLimiting bounds the torque in either mode, and stays when the mode changes; N at
    the load mean Nm at the motor.
    """
    controlled, at_load = mode != "not-controlled", mode == "force-at-the-load"
    if profile_of(ctx) == "profidrive":
        for name, source in (("p1522", 0x0B56FC05), ("p1523", 0x0B56FC0C)):
            ctx.drive.parameters.write(name, source)  # limits of 100 % of p2003, which MOMRED reduces
    loop(ctx, "controller", {"TorqueLimiting.LimitBase": 1} if at_load else None)
    lead_m = float(ctx.axis.variables.read("Mechanics.LeadScrew")) * 1e-3
    limiting = ctx.axis.torque_limiting(0.3 * 2.0 * pi / lead_m if at_load else 0.3)
    ctx.run_for(0.05)
    ctx.require(not limiting.Error, "torque reduction in the telegram of the drive")
    since = ctx.now_s
    ctx.axis.move_velocity(200.0, Acceleration=2000.0, Jerk=0.0, PositionControlled=not controlled)
    ctx.run_for(0.1)
    ctx.axis.move_velocity(
        -200.0, Acceleration=2000.0, Deceleration=2000.0, Jerk=0.0, PositionControlled=controlled
    )
    ctx.run_for(0.3)
    _, torque = Run(ctx, since).drive("torque")
    reference = float(ctx.axis.var("Actor.DriveParameter.ReferenceTorque"))
    limit = 0.3 / reference * float(drive_setting(ctx, "rated_torque_nm"))
    ctx.measure(
        "greatest torque",
        float(abs(torque).max()),
        "Nm",
        low=0.9 * limit,
        high=1.03 * limit,
        requirements=("STP-140",) if at_load else ("CTL-092",),
    )


@CASES.product(
    "torque-limit-watched/{watched}",
    parameters={"watched": (0, 1)},
    title="following error under a torque limit, PositionBasedMonitorings = {watched}",
    tags=("torque",),
    requirements=("STP-144",),
)
def torque_limit_watched(ctx: CaseContext, watched: int) -> None:
    """An axis that is held under a torque limit lags without an alarm, or with 521 where monitoring stays
    on.
    """
    axis = axis_name(ctx)
    begin(ctx, {"TorqueLimiting.PositionBasedMonitorings": watched}, UNHURRIED)
    limiting = ctx.axis.torque_limiting(0.5)
    ctx.run_for(0.05)
    ctx.require(not limiting.Error, "torque reduction in the telegram of the drive")
    travel(ctx, 60.0)
    ctx.inject("mechanics.jam", drive_name(ctx))
    since = ctx.now_s
    ctx.run_for(0.4)
    if watched:
        ctx.expect(alarm(521, since=since, axis=axis).covers("STP-144"))
        return
    lag = float(Run(ctx, since).following_error[-1])
    ctx.measure("following error in the end", lag, "mm", low=15.0)
    ctx.expect(no_alarm(axis=axis, besides=(504,)).covers("STP-144"))


@CASES.case("speed-limited", tags=("torque",), requirements=("CTL-038", "CTL-107"))
def speed_limited(ctx: CaseContext) -> None:
    """Catching up beyond the maximum speed is cut there, with warning 504, and the axis arrives all the
    same.
    """
    axis = axis_name(ctx)
    begin(ctx, None, WIDE, UNHURRIED, {"PositionControl.Kv": 50.0})
    travel(ctx, 450.0)
    ctx.inject("mechanics.jam", drive_name(ctx), duration_s=0.03)
    ctx.run_for(0.1)
    job = ctx.axis.halt()
    ctx.wait_until(job.done, 4.0, "the axis has caught up and stands")
    run = Run(ctx)
    ctx.measure(
        "greatest speed output",
        float(abs(run.speed_output).max()),
        "rpm",
        low=3000.0,
        high=3000.0,
        requirements=("CTL-038",),
    )
    ctx.expect(alarm(504, reaction=0, axis=axis).covers("CTL-107"), no_alarm(axis=axis, besides=(504,)))


@CASES.case("tuning-by-hand", tags=("travel",), requirements=("CTL-048", "CTL-043"))
def tuning_by_hand(ctx: CaseContext) -> None:
    """Kpc 0, T_vtc 0, Kv 10, then Kpc 100 and a higher gain in steps of 5 %: every step moves without an
    alarm, the error falls.
    """
    begin(
        ctx,
        None,
        WIDE,
        UNHURRIED,
        {
            "PositionControl.Kpc": 0.0,
            "DynamicAxisModel.VelocityTimeConstant": 0.0,
            "PositionControl.Kv": 10.0,
        },
    )
    largest = []
    for kpc, gain in ((0.0, 10.0), (0.0, 20.0), (0.0, 40.0), (100.0, 36.0), (100.0, 37.8)):
        configure(ctx, None, PositionControl__Kpc=kpc, PositionControl__Kv=gain)
        since = ctx.now_s
        job = ctx.axis.move_relative(8.0 if len(largest) % 2 else -8.0, Velocity=100.0, Jerk=0.0)
        ctx.wait_until(job.done, 3.0, "the step is done")
        largest.append(float(abs(Run(ctx, since).following_error).max()))
    falls = all(later < earlier * 0.75 for earlier, later in pairwise(largest[:4]))
    ctx.measure(
        "the following error falls from step to step", float(falls), low=1.0, requirements=("CTL-048",)
    )
    ctx.expect(job_output(job.name, "Done"))
    quiet(ctx)
