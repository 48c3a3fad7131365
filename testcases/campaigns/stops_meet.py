"""Whatever stops an axis, and whatever comes while it does: stops, alarms, disabling, in every state."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Final

from hil.campaign import Campaign, CaseContext
from testcases.campaigns._reactions import cycles
from testcases.campaigns.support import axis_name, equal

CAMPAIGN: Final = Campaign("stops meet", tags=("axis", "states"), bench="reference")
_REACTION_2, _REACTION_3, _REACTION_4 = 307, 321, 104
"""Alarms with these reactions."""
_OFF: Final = ("DISABLED", "ALARM_DISABLED")


class _Stand:
    """The axis, in motion, with what has happened to it.

    Args:
        ctx: The case.

    """

    def __init__(self, ctx: CaseContext) -> None:
        self.ctx = ctx
        self.axis = ctx.axis
        self.jobs: list[Any] = []

    def up(self) -> None:
        """Acknowledge, enable, and move with 300 mm/s, from a place with room."""
        ctx, axis = self.ctx, self.axis
        axis.power(False)
        ctx.wait_until(lambda: axis.state.name in _OFF, 5.0, "it is off")
        ctx.run_for(0.05)
        ctx.wait_until(axis.reset().done, 5.0, "acknowledged")
        ctx.wait_until(axis.power().status, 5.0, "enabled")
        here = float(axis.var("Position"))
        if abs(here) > 20.0:
            ctx.wait_until(axis.move_relative(-here, Velocity=400.0, Jerk=0.0).done, 5.0, "it is back")
        running = axis.move_velocity(300.0, Acceleration=1900.0, Jerk=0.0)
        ctx.wait_until(running.in_velocity, 3.0, "constant")
        self.jobs = [running]

    def stop(self, mode: int) -> None:
        """Start MC_Stop."""
        inputs = {"Deceleration": 900.0, "Jerk": 0.0} if mode == 3 else {}
        self.jobs.append(self.axis.stop(mode, **inputs))

    def alarm(self, number: int) -> None:
        """Raise an alarm."""
        self.ctx.inject("axis.alarm", axis_name(self.ctx), number=number)

    def held(self) -> None:
        """Stop, and hold the axis with Execute."""
        self.stop(0)
        self.ctx.wait_until(self.jobs[-1].done, 3.0, "the stop is done")

    def standing_alarm(self) -> None:
        """Let an alarm stop the axis, which stays enabled."""
        self.alarm(_REACTION_2)
        self.ctx.wait_until(lambda: self.axis.var("Velocity") == 0.0, 3.0, "it stands")
        self.ctx.run_for(0.05)

    def acknowledged(self) -> None:
        """Acknowledge an alarm while its ramp still runs."""
        self.alarm(_REACTION_2)
        self.ctx.run_for(cycles(self.ctx, 3))
        self.axis.reset()
        self.ctx.run_for(cycles(self.ctx, 4))

    def enabling(self) -> None:
        """Be on the way up."""
        self.axis.power(False)
        self.ctx.wait_until(lambda: self.axis.state.name in _OFF, 3.0, "it is off")
        self.ctx.run_for(0.1)
        self.axis.power()
        self.ctx.run_for(cycles(self.ctx, 1))


_SITUATIONS: Final[dict[str, Callable[[_Stand], None]]] = {
    "stop-0": lambda one: one.stop(0),
    "stop-2": lambda one: one.stop(2),
    "stop-3": lambda one: one.stop(3),
    "held": _Stand.held,
    "alarm-2": lambda one: one.alarm(_REACTION_2),
    "alarm-3": lambda one: one.alarm(_REACTION_3),
    "standing-alarm": _Stand.standing_alarm,
    "acknowledged": _Stand.acknowledged,
    "power-0": lambda one: one.axis.power(False, stop_mode=0) and None,
    "power-1": lambda one: one.axis.power(False, stop_mode=1) and None,
    "power-2": lambda one: one.axis.power(False, stop_mode=2) and None,
    "power-3": lambda one: one.axis.power(False, stop_mode=3) and None,
    "drive-stop": lambda one: one.alarm(_REACTION_4),
    "enabling": _Stand.enabling,
}
_EVENTS: Final[dict[str, Callable[[_Stand], None]]] = {
    "power-0": lambda one: one.axis.power(False, stop_mode=0) and None,
    "power-1": lambda one: one.axis.power(False, stop_mode=1) and None,
    "power-2": lambda one: one.axis.power(False, stop_mode=2) and None,
    "power-3": lambda one: one.axis.power(False, stop_mode=3) and None,
    "alarm-2": lambda one: one.alarm(_REACTION_2),
    "alarm-3": lambda one: one.alarm(_REACTION_3),
    "alarm-4": lambda one: one.alarm(_REACTION_4),
    "stop-0": lambda one: one.stop(0),
    "stop-2": lambda one: one.stop(2),
}
_STRENGTH: Final = {
    "stop-3": 900.0,
    "acknowledged": 2000.0,
    "alarm-2": 2000.0,
    "stop-2": 2000.0,
    "power-2": 2000.0,
    "alarm-3": 4000.0,
    "stop-0": 4000.0,
    "power-0": 4000.0,
}
"""Deceleration of the ramps that the axis makes by itself, mm/s2."""


@CAMPAIGN.product(
    "{situation}",
    parameters={"situation": tuple(_SITUATIONS)},
    title="{situation}, and what comes then",
    requirements=(
        "STP-384",
        "STP-396",
        "STP-415",
        "STP-423",
        "STP-432",
        "STP-433",
        "STP-437",
        "STP-441",
        "STP-526",
    ),
    without=("STP-245",),  # the way of a ramp that another one takes over
)
def meets(ctx: CaseContext, situation: str) -> None:
    """The harder one of two ramps counts, a softer one takes nothing back; the axis ends disabled where
    anything has disabled it, all its jobs have ended, and it comes up again.
    """
    stand, name = _Stand(ctx), axis_name(ctx)
    axis = ctx.axis
    for event, act in _EVENTS.items():
        stand.up()
        _SITUATIONS[situation](stand)
        if situation not in ("held", "standing-alarm", "acknowledged", "enabling"):
            ctx.run_for(cycles(ctx, 3))
        act(stand)
        ctx.run_for(cycles(ctx, 3))
        what = f"{event} after {situation}"
        first, second = _STRENGTH.get(situation), _STRENGTH.get(event)
        # Disabling takes its own ramp (STP-239), and a stop nothing from an axis that is being disabled.
        judged = event.startswith("alarm") or (event.startswith("stop") and not situation.startswith("power"))
        if first is not None and second is not None and judged:
            ctx.run_for(cycles(ctx, 3))
            slope = ctx.trace()[f"{name}.acceleration_setpoint"]
            now, most = -float(slope.values[-1]), max(first, second)
            if axis.var("Velocity") > 0.0 and most == 4000.0:
                within = 1e-6 * most
                equal(ctx, f"{what}: deceleration", now, most, "STP-423", "STP-432", "STP-441", within=within)
            elif axis.var("Velocity") > 0.0:
                # Ramps of 2000 mm/s2 keep to the limit of the jerk, so they are on their way there.
                ctx.measure(
                    f"{what}: deceleration", now, high=2000.0 * (1.0 + 1e-9), requirements=("STP-433",)
                )
        ctx.run_for(1.6 if situation in ("power-3", "drive-stop") or event == "power-3" else 0.9)
        alarms = ("alarm-2", "alarm-3", "alarm-4", "standing-alarm", "drive-stop")
        alarmed = event in alarms or situation in alarms
        off = alarmed or event.startswith("power") or situation.startswith("power")
        equal(ctx, f"{what}: enabled", axis.var("StatusWord.X0"), not off, "STP-396")
        equal(ctx, f"{what}: velocity", axis.var("Velocity"), 0.0)
        equal(
            ctx,
            f"{what}: it stands",
            float(ctx.trace()[f"{name}.actual_velocity"].values[-1]),
            0.0,
            within=1.0,
        )
        running = [job for job in stand.jobs if job.Busy]
        equal(ctx, f"{what}: jobs that run", len(running), 0.0, "STP-437")
        pending = [alarm.number for alarm in axis.object.engine.pending]
        equal(ctx, f"{what}: alarms {pending}", bool(pending), alarmed)
        for job in stand.jobs:
            job.set(Execute=False)
        ctx.run_for(cycles(ctx, 3))
