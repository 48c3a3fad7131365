"""Homing on any machine: what the axis calls its home position is where the mark, or the load, really is.

The place of the load is that of the emulated mechanics; zero marks are a revolution of the motor apart. What
is expected follows from gear, lead and unit of the bench file.
"""

from __future__ import annotations

from typing import Any, Final

from hil.campaign import Campaign, CaseContext
from hil.expect import no_alarm
from testcases.campaigns.own_axis import Own, own
from testcases.campaigns.support import axis_name, drive_name, enable, equal, restart

CAMPAIGN: Final = Campaign(
    "homing anywhere",
    tags=("homing",),
    bench="reference",
    needs={
        "feedback": "motor",
        "encoder": "incremental",
        "motion": ("linear", "rotary"),
        "play": "none",
        "load": "not heavy",
        "software-limits": "off",
    },
)
SIGN: Final = {"positive": 1.0, "negative": -1.0}


class _Places:
    """Where the load is, and where the zero marks are, in position units of the axis."""

    def __init__(self, ctx: CaseContext, values: Own) -> None:
        self._ctx, self._values = ctx, values
        section = ctx.bench.config.drive[drive_name(ctx)]
        mechanics = section.mechanics
        pitch_mm = mechanics.lead_screw_mm * mechanics.gear_denominator / mechanics.gear_numerator
        self.pitch = pitch_mm * 1e-3 / values.golden.machine_m
        turned = -1.0 if mechanics.reversed else 1.0
        self.first = turned * self.pitch * section.index_increments / section.increments_per_revolution

    @property
    def load(self) -> float:
        """Place of the load."""
        trace = self._ctx.trace()
        return float(trace[f"{drive_name(self._ctx)}.position"].values[-1]) / self._values.golden.machine_m

    @property
    def zero(self) -> float:
        """Place of the load at which the axis would show 0."""
        return self.load - float(self._ctx.trace()[f"{axis_name(self._ctx)}.actual_position"].values[-1])

    def beside_a_mark(self, place: float) -> float:
        """Return how far a place is from the nearest zero mark."""
        turns = (place - self.first) / self.pitch
        return abs(turns - round(turns)) * self.pitch


def _beginning(ctx: CaseContext, mode: str) -> tuple[Own, _Places]:
    """Enable the axis somewhere between two marks."""
    restart(ctx, {f"Sensor[1].{mode}.Mode": 0})
    enable(ctx)
    values = own(ctx)
    places = _Places(ctx, values)
    way = values.draw("begin", 0.3, 0.6) * places.pitch
    speed = values.given(values.speed(0.2))
    ctx.wait_until(ctx.axis.move_relative(way, Velocity=speed).done, 5.0, "the axis is between two marks")
    ctx.run_for(values.settling_s)
    return values, places


def _slack(values: Own) -> float:
    return 3.0 * values.increment + 1e-6 * values.way(1.0)


@CAMPAIGN.product(
    "active/{direction}",
    parameters={"direction": tuple(SIGN)},
    title="active homing on the zero mark in {direction} direction",
    requirements=("HOM-081", "HOM-083", "HOM-085"),
)
def active(ctx: CaseContext, direction: str) -> None:
    """The axis stops at its home position, which is the offset beside the first mark in the direction."""
    values, places = _beginning(ctx, "ActiveHoming")
    sign, position = SIGN[direction], values.way(values.draw("home", 2.1, 2.9))
    offset = values.way(values.draw("offset", 0.011, 0.019))
    write = ctx.axis.write
    write("Sensor[1].ActiveHoming.Direction", int(sign < 0.0))
    write("Homing.ApproachDirection", sign < 0.0)
    write("Sensor[1].ActiveHoming.HomePositionOffset", offset)
    write("Homing.ReferencingVelocity", values.given(values.speed(0.1)))
    ctx.run_for(0.05)
    begun = places.load
    ctx.wait_until(ctx.axis.home(position, mode=3).done, 20.0, "the axis is homed")
    ctx.run_for(0.1 + values.settling_s)
    shown = float(ctx.axis.var("ActualPosition"))
    window = float(ctx.axis.variables.read("PositioningMonitoring.Window"))
    equal(ctx, "position in the end", shown, position, "HOM-083", within=window)
    mark = places.zero + position - offset
    slack = _slack(values)
    ctx.measure("home mark beside a zero mark", places.beside_a_mark(mark), values.unit, high=slack)
    way = sign * (mark - begun)
    ctx.measure(
        "way to the mark", way, values.unit, low=-slack, high=places.pitch + slack, requirements=("HOM-085",)
    )
    equal(ctx, "X5", ctx.axis.var("StatusWord.X5"), 1.0, "HOM-081")
    ctx.expect(no_alarm(axis=axis_name(ctx)))


@CAMPAIGN.product(
    "passive/{direction}",
    parameters={"direction": tuple(SIGN)},
    title="passive homing on the zero mark, moving in {direction} direction",
    requirements=("HOM-120", "HOM-128"),
)
def passive(ctx: CaseContext, direction: str) -> None:
    """The mark that is passed gets the position; the motion goes on, and its way is the same."""
    values, places = _beginning(ctx, "PassiveHoming")
    sign, position = SIGN[direction], values.way(values.draw("home", 1.1, 1.9))
    ctx.axis.write("Sensor[1].PassiveHoming.Direction", 2)
    ctx.run_for(0.05)
    begun = places.load
    job = ctx.axis.home(position, mode=2)
    ctx.run_for(0.1)
    equal(ctx, "X5 while it searches", ctx.axis.var("StatusWord.X5"), 0.0, "HOM-120")
    way = sign * (1.2 * places.pitch + values.way(0.2))
    move = ctx.axis.move_relative(way, Velocity=values.given(values.speed(0.3)))
    ctx.wait_until(move.done, 10.0, "the motion has ended")
    ctx.run_for(0.1 + values.settling_s)
    equal(ctx, "MC_Home is done", job.Done, 1.0)
    mark = places.zero + position
    slack = _slack(values)
    ctx.measure("home mark beside a zero mark", places.beside_a_mark(mark), values.unit, high=slack)
    found = sign * (mark - begun)
    ctx.measure("way to the mark", found, values.unit, low=-slack, high=places.pitch + slack)
    window = float(ctx.axis.variables.read("PositioningMonitoring.Window"))
    equal(ctx, "way of the load", places.load - begun, way, within=2.0 * window + slack)
    equal(ctx, "X5", ctx.axis.var("StatusWord.X5"), 1.0)


@CAMPAIGN.case("direct", requirements=("HOM-012", "HOM-013"))
def direct(ctx: CaseContext) -> None:
    """Mode 0 gives the present place a position, mode 1 moves the coordinates; the load stands."""
    enable(ctx)
    values = own(ctx)
    places = _Places(ctx, values)
    begun = places.load
    for mode in (0, 1, 0, 1):
        before = float(ctx.axis.var("Position"))
        value: Any = values.way(values.draw(f"value {mode} {before:.3g}", -0.9, 0.9))
        ctx.wait_until(ctx.axis.home(value, mode=mode).done, 2.0, f"mode {mode} is done")
        ctx.run_for(0.05)
        wanted = value if mode == 0 else before + value
        equal(
            ctx,
            f"position after mode {mode}",
            ctx.axis.var("Position"),
            wanted,
            "HOM-012",
            within=_slack(values),
        )
        equal(ctx, f"X5 after mode {mode}", ctx.axis.var("StatusWord.X5"), 1.0, "HOM-013")
    equal(ctx, "way of the load", places.load - begun, 0.0, within=values.still)
