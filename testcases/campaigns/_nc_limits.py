"""What the cases of `limits` are on axes of an NC.

An NC axis has software limits. Limit switches are inputs of the PLC, whose program takes enables away: the
feed enable of the direction (`braking`), or the enable of the axis (`disabling`).
"""

from __future__ import annotations

from typing import Any, Final

from hil.campaign import CaseContext, Counterpart, NotApplicable
from hil.errors import BlockedError
from hil.expect import axis_error, command_refused, happens, no_axis_error, value_at
from hil.record import event
from motion.nc.blocks import HomingMode, JogMode
from testcases.campaigns._nc import (
    LIMIT_AT_START,
    LIMIT_IN_MOTION,
    NO_ENABLE,
    NO_FEED,
    SIGN,
    Numbers,
    Table,
    at_rest,
    axis_name,
    axis_of,
    bring_into,
    code_at,
    enable,
    moves_again,
    reset,
)
from testcases.campaigns._reactions import cycles
from testcases.campaigns.support import VELOCITY, drive_name, settle_s

BITS: Final = {"negative": 0x1, "positive": 0x2}
"""Inputs of the drive, as the PLC reads them."""
FILTER_S: Final = 0.0064
"""Filter time of an input of the drive, s."""


class SwitchProgram:
    """A part of the PLC program that takes enables away while limit switches are pressed.

    Args:
        ctx: The case.
        power: `MC_Power` of the axis.
        takes: `feed` or `enable`.

    """

    def __init__(self, ctx: CaseContext, power: Any, takes: str) -> None:
        self._device = axis_of(ctx).object.device
        self._power = power
        self._takes = takes
        ctx.bench.nc.call(self)

    def __call__(self) -> None:
        """Run once, in a cycle of the PLC."""
        inputs = self._device.digital_inputs
        if self._takes == "feed":
            self._power.set(
                Enable_Positive=not inputs & BITS["positive"], Enable_Negative=not inputs & BITS["negative"]
            )
        elif inputs & (BITS["positive"] | BITS["negative"]):
            self._power.set(Enable=False)


def set_in_motion(ctx: CaseContext, motion: str, sign: int) -> Any:
    """Bring the enabled axis into a motion; returns its block, None at standstill."""
    axis = axis_of(ctx)
    if motion in ("constant", "accelerating", "standstill"):
        return bring_into(ctx, motion, direction=sign)
    ctx.do(f"{motion} at {VELOCITY * sign:g} mm/s")
    if motion == "jog":
        block: Any = axis.jog(
            JogMode.MC_JOGMODE_CONTINOUS, backwards=sign < 0, Velocity=VELOCITY, **Numbers(ctx).dynamics
        )
    else:
        block = axis.move_relative(400.0 * sign, Velocity=VELOCITY, **Numbers(ctx).dynamics)
    ctx.wait_until(lambda: axis.object.motion.v * sign > VELOCITY - 1e-6, 5.0, f"the axis is in its {motion}")
    ctx.run_for(0.05)
    return block


def _release(block: Any) -> None:
    if hasattr(block, "JogForward"):
        block.set(JogForward=False, JogBackwards=False)


def switch_case(ctx: CaseContext, kind: str, side: str, motion: str, pulses: int = 0) -> None:
    """The program takes an enable away at the switch; the axis stops, and leaves the switch backwards
    only.

    Raises:
        BlockedError: The switches do not reach the controller.

    """
    axis, name, drive = axis_of(ctx), axis_name(ctx), drive_name(ctx)
    if ctx.bench.config.drive[drive].profile == "analog":
        raise BlockedError(f"{drive} is an analog drive: no input brings its limit switches to the NC")
    power = enable(ctx)
    SwitchProgram(ctx, power, "feed" if kind == "braking" else "enable")
    running = set_in_motion(ctx, motion, SIGN[side])
    if pulses:
        press = ctx.inject(
            "switch.bounce", drive, input=f"{side}_limit", pulses=pulses, shortest_s=0.001, longest_s=0.006
        )
    else:
        press = ctx.inject("switch.press", drive, input=f"{side}_limit")
    applied = event("fault.applied")
    # Without enable the axis coasts.
    ctx.run_for((1.8 if kind == "braking" else 3.0) + settle_s(ctx))
    ended = ctx.now_s
    at_rest(ctx, ended)
    within = FILTER_S + cycles(ctx, 5) + 0.014 * pulses
    if kind == "braking":
        ctx.expect(no_axis_error(axis=name))
        if running is not None:
            ctx.expect(
                happens(
                    event("axis.feed_missing", name, error_id=NO_FEED[side]), since=applied, within_s=within
                )
            )
            ctx.measure("CommandAborted of the running block", float(running.CommandAborted), low=1.0)
        _release(running)
        refused = axis.move_relative(20.0 * SIGN[side], Velocity=100.0)
        ctx.run_for(cycles(ctx, 3))
        ctx.expect(command_refused(NO_FEED[side], since=ended, axis=name))
        ctx.measure(
            "ErrorID further into the switch", float(refused.ErrorID), low=NO_FEED[side], high=NO_FEED[side]
        )
        inwards = axis.move_relative(-20.0 * SIGN[side], Velocity=100.0)
        ctx.wait_until(inwards.done, 5.0, "the axis leaves the switch")
        press.remove()
        ctx.run_for(0.1)
        outwards = axis.move_relative(10.0 * SIGN[side], Velocity=100.0)
        ctx.wait_until(outwards.done, 5.0, "it moves both ways again")
        return
    if running is None:
        ctx.expect(no_axis_error(axis=name))
        ctx.measure("MC_Power.Status", float(power.Status), high=0.0)
        return
    ctx.expect(axis_error(NO_ENABLE, since=applied, within_s=within, axis=name).covers("NC-733"))
    code_at(ctx, ended, NO_ENABLE)
    _release(running)
    press.remove()
    ctx.run_for(0.1)
    reset(ctx)
    enable(ctx)
    moves_again(ctx)


def _limits(ctx: CaseContext, low: float, high: float) -> None:
    axis = axis_of(ctx)
    ctx.do(f"software limits {low:g} to {high:g} mm are monitored")
    for key, value in (
        ("axis.soft_limit_min", low),
        ("axis.soft_limit_max", high),
        ("axis.soft_limit_min_enable", True),
        ("axis.soft_limit_max_enable", True),
    ):
        axis.write_parameter(key, value)


def software_case(ctx: CaseContext, side: str, motion: str) -> None:
    """A motion without target ends at the software limit, without an error; a target beyond it is refused."""
    axis, name, sign = axis_of(ctx), axis_name(ctx), SIGN[side]
    _limits(ctx, -350.0, 350.0)
    enable(ctx)
    if motion == "positioning":
        before = ctx.now_s
        refused = axis.move_absolute(350.001 * sign, Velocity=VELOCITY)
        ctx.run_for(cycles(ctx, 3))
        code = LIMIT_AT_START[side]
        ctx.expect(command_refused(code, since=before, axis=name))
        ctx.measure("ErrorID of the block", float(refused.ErrorID), low=code, high=code)
        to_the_limit = axis.move_absolute(350.0 * sign, Velocity=VELOCITY)
        ctx.wait_until(to_the_limit.done, 5.0, "the limit itself is a target")
        ctx.expect(no_axis_error(axis=name))
        return
    block = set_in_motion(ctx, motion, sign)
    ctx.run_for(3.0)
    ended = ctx.now_s
    ctx.expect(
        no_axis_error(axis=name),
        value_at(f"{name}.set_position", ended, 350.0 * sign, tolerance=1e-6).covers("NC-130"),
        value_at(f"{drive_name(ctx)}.position", ended, 0.35 * sign, tolerance=0.0002),
    )
    at_rest(ctx, ended)
    axis.ref.ReadStatus()
    at_limit = axis.ref.Status.SoftLimitMaxExceeded if sign > 0.0 else axis.ref.Status.SoftLimitMinExceeded
    beyond = sign * axis.position >= 350.0
    ctx.measure(
        "the bit of the limit is as the position says",
        float(at_limit == beyond),
        low=1.0,
        requirements=("NC-130",),
    )
    _release(block)
    back = axis.move_relative(-20.0 * sign, Velocity=100.0)
    ctx.wait_until(back.done, 5.0, "the axis moves back")


def passed_case(ctx: CaseContext, side: str) -> None:
    """A limit that moves behind a moving axis is an error: the axis is shut down, and moves back after a
    reset.
    """
    axis, name, sign = axis_of(ctx), axis_name(ctx), SIGN[side]
    _limits(ctx, -450.0, 450.0)
    enable(ctx)
    bring_into(ctx, "constant", direction=sign)
    before = ctx.now_s
    ctx.do("the limit moves behind the axis")
    end = "max" if sign > 0 else "min"
    axis.write_parameter(f"axis.soft_limit_{end}", 5.0 * sign)
    ctx.run_for(1.0 + settle_s(ctx))
    ended = ctx.now_s
    code = LIMIT_IN_MOTION[side]
    ctx.expect(axis_error(code, since=before, within_s=cycles(ctx, 2), axis=name).covers())
    code_at(ctx, ended, code)
    at_rest(ctx, ended)
    reset(ctx)
    _only_backwards(ctx, side)


def _only_backwards(ctx: CaseContext, side: str) -> None:
    axis, sign = axis_of(ctx), SIGN[side]
    since = ctx.now_s
    ctx.wait_until(lambda: axis.operational, 5.0, "the axis is operational")
    axis.move_relative(20.0 * sign, Velocity=100.0)
    ctx.run_for(cycles(ctx, 3))
    ctx.expect(command_refused(LIMIT_AT_START[side], since=since, axis=axis_name(ctx)).covers("NC-131"))
    back = axis.move_relative(-20.0 * sign, Velocity=100.0)
    ctx.wait_until(back.done, 5.0, "the axis moves back towards the permitted range")


def outside_case(ctx: CaseContext, side: str) -> None:
    """Homed outside of its limits the axis moves back only."""
    axis, sign = axis_of(ctx), SIGN[side]
    _limits(ctx, -100.0, 100.0)
    enable(ctx)
    ctx.do(f"MC_Home MC_Direct, Position {150.0 * sign:g} mm")
    home = axis.home(150.0 * sign, mode=HomingMode.MC_Direct)
    ctx.wait_until(home.done, 1.0, "the axis is homed")
    _only_backwards(ctx, side)
    ctx.expect(no_axis_error(axis=axis_name(ctx)))


def without_effect_case(ctx: CaseContext, side: str) -> None:
    """A limit that is not monitored stops nothing."""
    axis, name, sign = axis_of(ctx), axis_name(ctx), SIGN[side]
    _limits(ctx, -100.0, 100.0)
    for end in ("min", "max"):
        axis.write_parameter(f"axis.soft_limit_{end}_enable", False)
    enable(ctx)
    move = axis.move_absolute(150.0 * sign, Velocity=VELOCITY)
    ctx.wait_until(move.done, 5.0, "the axis is beyond the limit")
    ctx.expect(no_axis_error(axis=name))


def exchanged_case(ctx: CaseContext) -> None:
    """With the minimum above the maximum every positioning is refused, with the code of its direction."""
    axis, name = axis_of(ctx), axis_name(ctx)
    _limits(ctx, 100.0, -100.0)
    enable(ctx)
    for distance, code in ((20.0, 0x4424), (-20.0, 0x4423)):
        since = ctx.now_s
        axis.move_relative(distance, Velocity=100.0)
        ctx.run_for(cycles(ctx, 3))
        ctx.expect(command_refused(code, since=since, axis=name))
    _limits(ctx, -100.0, 100.0)
    moves_again(ctx)


NO_STATE: Final = NotApplicable(
    "an NC axis has no state for a traversable switch: the PLC program says what happens at it"
)
NO_WIRING: Final = NotApplicable(
    "how switches are wired and read is a matter of the PLC program, which the NC does not see"
)
NO_CONTROL_MODE: Final = NotApplicable(
    "an NC axis has no motion without position control and none superimposed"
)


def _switch(kind: str, side: str, motion: str) -> Counterpart | NotApplicable:
    if motion in ("superimposed", "uncontrolled"):
        return NO_CONTROL_MODE
    if motion in ("homing", "motion-in"):
        return NotApplicable(
            f"the switch acts on enables, whatever moves the axis; {motion} adds nothing to constant"
        )
    ids = () if kind == "braking" else ("NC-733",)
    return Counterpart(switch_case, {"kind": kind, "side": side, "motion": motion}, ids)


def _bounces(side: str, kind: str, pulses: int) -> Counterpart | NotApplicable:
    if kind == "traversable":
        return NO_STATE
    return Counterpart(
        switch_case,
        {"kind": kind, "side": side, "motion": "constant", "pulses": pulses},
        () if kind == "braking" else ("NC-733",),
    )


def _software(side: str, motion: str, behaviour: str) -> Counterpart | NotApplicable:
    if behaviour == "maximum":
        return NotApplicable("an NC axis brakes at a software limit with the deceleration of its command")
    if motion in ("superimposed", "motion-in"):
        return NO_CONTROL_MODE
    ids = () if motion == "positioning" else ("NC-130",)
    return Counterpart(software_case, {"side": side, "motion": motion}, ids)


def _passed(side: str, how: str, leaves: str) -> Counterpart | NotApplicable:
    if how != "moved" or leaves != "braking":
        return NotApplicable("an NC axis has one reaction to a passed software limit: moved/braking")
    return Counterpart(passed_case, {"side": side}, ())


def _without_effect(side: str, why: str) -> Counterpart | NotApplicable:
    if why == "not-homed":
        return NotApplicable("software limits of an NC axis count whether it is homed or not")
    return Counterpart(without_effect_case, {"side": side})


LIMITS: Final = Table(
    {
        "braking/*": _switch,
        "disabling/*": _switch,
        "traversable/*": NO_STATE,
        "bounces/*": _bounces,
        "software/limits-exchanged": lambda: Counterpart(exchanged_case),
        "software/*/passed/*": _passed,
        "software/*/without-effect/*": _without_effect,
        "software/*/homed-outside": lambda side: Counterpart(outside_case, {"side": side}, ("NC-131",)),
        "software/*/moved/*": NotApplicable(
            "a limit that moves in front of an NC axis counts for its next command"
        ),
        "software/*/simulated": NotApplicable("the simulation of an NC axis is no drive of a bench"),
        "software/*/switch-on-the-way": NotApplicable(
            "switches and software limits do not know each other in the NC"
        ),
        "software/*": _software,
        "remove-enable/*": NotApplicable("an NC axis does not choose how its drive goes off"),
        "mc-stop/*": NotApplicable("a feed enable that goes away during MC_Stop leaves the stop as it is"),
        "disabled/*": NO_WIRING,
        "simulated/*": NotApplicable("the simulation of an NC axis is no drive of a bench"),
        "*": NO_WIRING,
    }
)
