"""The machine of a drive obeys the laws of motion by the numbers of the bench file: inertia, gear, friction,
weight, forces from outside, end stops, and a shaft that is held.
"""

from __future__ import annotations

import math
from typing import Any, Final

import numpy as np

from hil.bench import BenchFile
from hil.campaign import Campaign, CaseContext
from testcases.campaigns._led_servo import DRIVE, NODE, Node
from testcases.campaigns.support import equal

BENCH: Final = BenchFile(
    "machine with friction and weight",
    f"""
[bench]
name = "machine with friction and weight"
kind = "virtual"
cycle_ms = 4

[segment.can0]
bitrate = 1_000_000

[drive.{DRIVE}]
segment = "can0"
node_id = {NODE}
increments_per_revolution = 65536
heartbeat_ms = 0

[drive.{DRIVE}.mechanics]
gear_numerator = 2
lead_screw_mm = 8.0
motor_inertia_kgm2 = 2.1e-4
screw_inertia_kgm2 = 0.9e-4
load_mass_kg = 35.0
coulomb_friction_n = 90.0
static_friction_n = 140.0
viscous_friction_n_per_m_s = 220.0
gravity_n = -60.0
negative_stop_mm = -180.0
positive_stop_mm = 170.0

[drive.{DRIVE}.switches]
negative_limit_mm = -400.0
positive_limit_mm = 400.0
home_mm = -390.0
""",
)
BRAKE_NM: Final = 0.6
BRAKED: Final = BenchFile(
    "machine with a brake",
    BENCH.text.replace("[drive.drive1.mechanics]", "[drive.drive1.mechanics]\nreversed = true").replace(
        BENCH.name, "machine with a brake"
    )
    + f"""
[drive.{DRIVE}.brake]
torque_nm = {BRAKE_NM}
""",
)
"""The same with a holding brake, behind a gear that turns the other way."""
CAMPAIGN: Final = Campaign(
    "machine law", controller="", tags=("drive",), bench="testcases.campaigns.machine_law:BENCH"
)

OF_BRAKE: Final = Campaign(
    "machine law of a brake",
    controller="",
    tags=("drive",),
    bench="testcases.campaigns.machine_law:BRAKED",
)


class Machine(Node):
    """The drive in torque mode, and the numbers of its machine.

    Args:
        ctx: The case.

    """

    def __init__(self, ctx: CaseContext) -> None:
        super().__init__(ctx)
        self.ctx = ctx
        section: Any = ctx.bench.config.drive[DRIVE]
        self.parts = parts = section.mechanics
        self.rated_nm = float(section.rated_torque_nm)
        self.force_per_nm = math.tau * parts.gear_ratio / (parts.lead_screw_mm / 1000.0)
        """Force on the load of 1 Nm of the motor, N."""
        turning = parts.motor_inertia_kgm2 * parts.gear_ratio**2 + parts.screw_inertia_kgm2
        self.mass = parts.load_mass_kg + turning * (math.tau / (parts.lead_screw_mm / 1000.0)) ** 2
        """Of everything, as the load has it, kg."""
        self.configure({0x6087: 2_000_000})
        self.enable(4)

    def push(self, force: float, seconds: float) -> tuple[float, float]:
        """Command the torque that makes a force, N; returns when it is there, and the end, s."""
        torque = round(force / self.force_per_nm / self.rated_nm * 1000.0)
        self.write(0x6071, torque)
        begun = self.ctx.now_s + 0.008
        self.ctx.run_for(seconds)
        return begun, self.ctx.now_s

    def obeys(self, what: str, span: tuple[float, float], outside: float = 0.0, dry: float = 0.0) -> None:
        """Expect that in a span the momentum grows by the forces, as long as the load moves one way.

        Args:
            what: Name of the check.
            span: Begin and end, s.
            outside: Force from outside, N.
            dry: Friction that was added, N.

        """
        trace = self.ctx.trace()
        speed, torque = (trace[f"{DRIVE}.{name}"].between(*span) for name in ("velocity", "torque"))
        v, steps = speed.values, np.diff(speed.time_s)
        mean = 0.5 * (v[1:] + v[:-1])
        drive = 0.5 * (torque.values[1:] + torque.values[:-1]) * self.force_per_nm
        friction = (self.parts.coulomb_friction_n + dry) * np.sign(mean)
        force = (
            drive + self.parts.gravity_n + outside - friction - self.parts.viscous_friction_n_per_m_s * mean
        )
        one_way = (v[1:] * v[:-1] > 0.0) & (np.abs(np.diff(torque.values)) < 1e-9)
        off = np.abs(self.mass * np.diff(v) - force * steps)[one_way]
        bound = 0.005 * np.abs(force * steps)[one_way] + 0.01
        equal(self.ctx, f"{what}: samples that move", float(np.count_nonzero(one_way) > 5), 1)
        wrong = int(np.count_nonzero(off > bound))
        worst = float(np.max(off / bound, initial=0.0))
        equal(
            self.ctx, f"{what}: samples that break the law of momentum (at worst {worst:.3g} times)", wrong, 0
        )

    @property
    def speed(self) -> float:
        """Velocity of the load, m/s."""
        return float(self.ctx.trace()[f"{DRIVE}.velocity"].values[-1])

    @property
    def place(self) -> float:
        """Position of the load, mm."""
        return 1000.0 * float(self.ctx.trace()[f"{DRIVE}.position"].values[-1])


@CAMPAIGN.case("momentum")
def momentum(ctx: CaseContext) -> None:
    """The momentum grows by torque, weight, friction and forces from outside, in both directions, driven and
    coasting.
    """
    machine = Machine(ctx)
    for force in (700.0, 320.0, -650.0, -300.0, 500.0, 0.0):
        machine.obeys(f"{force:g} N", machine.push(force, 0.07))
    machine.push(0.0, 1.5)
    equal(ctx, "velocity after coasting, m/s", machine.speed, 0.0)
    for sign in (1.0, -1.0):
        load = ctx.inject("mechanics.load_step", DRIVE, force_N=250.0 * sign)
        machine.obeys("a force from outside", machine.push(500.0 * sign, 0.05), outside=250.0 * sign)
        load.remove()
        machine.push(0.0, 0.8)
        machine.obeys("without it", machine.push(400.0 * sign, 0.05))
        dry = ctx.inject("mechanics.friction", DRIVE, force_N=130.0)
        machine.obeys("more friction", machine.push(-600.0 * sign, 0.05), dry=130.0)
        dry.remove()
        machine.push(0.0, 0.8)
        machine.obeys("the friction as built", machine.push(-500.0 * sign, 0.05))
        machine.push(0.0, 1.5)


@CAMPAIGN.case("breakaway")
def breakaway(ctx: CaseContext) -> None:
    """It rests while the force is below the static friction, and moves above it, by weight and torque."""
    machine = Machine(ctx)
    parts = machine.parts
    for sign in (1.0, -1.0):
        border = sign * parts.static_friction_n - parts.gravity_n
        for share, moves in ((0.97, 0), (1.03, 1)):
            machine.push(0.0, 1.2)
            equal(ctx, "velocity before", machine.speed, 0.0)
            start = machine.place
            machine.push(border * share, 0.15)
            equal(ctx, f"moves with {share:g} of {border:g} N", float(machine.place != start), moves)
            equal(ctx, "and to its side", float((machine.place - start) * border >= 0.0), 1)
    machine.push(0.0, 1.2)
    ctx.inject("mechanics.jam", DRIVE, duration_s=0.2)
    start = machine.place
    machine.push(600.0, 0.15)
    equal(ctx, "place of a shaft that is held, mm", machine.place, start, within=1e-9)
    machine.push(0.0, 0.3)


@CAMPAIGN.case("end-stops")
def end_stops(ctx: CaseContext) -> None:
    """A stop ends the travel on each side: the load comes to rest there and goes in no further than its
    spring gives way; back it moves freely.
    """
    machine = Machine(ctx)
    parts = machine.parts
    for sign, stop in ((1.0, parts.positive_stop_mm), (-1.0, parts.negative_stop_mm)):
        machine.push(320.0 * sign, 5.0)
        force = abs(320.0 * sign + parts.gravity_n)
        way = 1000.0 * force / parts.stop_stiffness_n_per_m
        equal(ctx, "velocity at the stop, m/s", machine.speed, 0.0, within=1e-4)
        inside = (machine.place - stop) * sign
        equal(ctx, "way into the stop, mm", inside, way, "STP-536", within=0.35 * way + 0.002)
        machine.obeys("back", machine.push(-500.0 * sign, 0.08))
        machine.push(0.0, 1.2)


@OF_BRAKE.case("brake")
def brake(ctx: CaseContext) -> None:
    """A closed brake holds the load against its torque behind the gear and the friction, on both sides,
    whichever way the gear turns; beyond that the load moves.
    """
    section: Any = ctx.bench.config.drive[DRIVE]
    parts = section.mechanics
    held = BRAKE_NM * math.tau * parts.gear_ratio / (parts.lead_screw_mm / 1000.0)
    ctx.run_for(0.05)
    for sign in (1.0, -1.0):
        border = sign * (abs(held) + parts.static_friction_n) - parts.gravity_n
        for share, moves in ((0.98, 0), (1.02, 1)):
            start = float(ctx.trace()[f"{DRIVE}.position"].values[-1])
            load = ctx.inject("mechanics.load_step", DRIVE, force_N=border * share)
            ctx.run_for(0.1)
            way = float(ctx.trace()[f"{DRIVE}.position"].values[-1]) - start
            equal(ctx, f"moves with {share:g} of {border:.1f} N", float(way != 0.0), moves)
            equal(ctx, "and to its side", float(way * sign >= 0.0), 1)
            load.remove()
            ctx.run_for(0.3)
