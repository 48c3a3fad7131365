"""Parts of an emulated drive by themselves, against plain models of their own: mechanics with friction, play,
end stops and switches, shaft, brake, profile and ramp generator, heat, DC link.

The models here integrate the laws of motion in small steps; nothing of the product takes part in them.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from emulators.drive.brake import HoldingBrake
from emulators.drive.protection import WindowTimer
from emulators.drive.ramp import PositionProfile, ProfileForm, RampShape
from emulators.drive.rounded_ramp import RoundedRamp, Rounding
from emulators.drive.supply import DcLink
from emulators.drive.supply_config import SupplyConfig
from emulators.drive.thermal import ThermalModel, ThermalNode
from emulators.mechanics import AxisMechanics, DrivenShaft, SwitchModel
from fieldbus.clock import VirtualScheduler
from hil.campaign import Campaign, CaseContext
from testcases.campaigns.device_settings import refused
from testcases.campaigns.support import equal

CAMPAIGN: Final = Campaign(
    "machine parts", controller="", tags=("drive",), bench="testcases.campaigns.can_bus:BENCH"
)
DT: Final = 250e-6
FINE: Final = 50
"""Steps of a model in one of the product."""


def near(ctx: CaseContext, what: str, found: float, wanted: float, *, within: float = 1e-9) -> None:
    """Expect a number."""
    equal(ctx, what, found, wanted, within=within)


# -- mechanics ---------------------------------------------------------------------------------------------


class Body:
    """Motor and load as one body, in small steps: mass, viscous, dry and static friction, forces."""

    def __init__(self, mass: float, *, ratio: float, viscous: float, dry: float, static: float) -> None:
        self.mass, self.ratio, self.viscous, self.dry, self.static = mass, ratio, viscous, dry, static
        self.place = self.speed = 0.0
        self.load = self.brake = 0.0

    def run(self, torque: float, seconds: float) -> None:
        """Go on under a torque."""
        step = DT / FINE
        for _ in range(round(seconds / step)):
            force = torque / self.ratio + self.load
            holding = self.static + self.brake
            if self.speed == 0.0 and abs(force) <= holding:
                continue
            speed = self.speed + (force - self.viscous * self.speed) / self.mass * step
            taken = (self.dry + self.brake) / self.mass * step
            speed = math.copysign(max(abs(speed) - taken, 0.0), speed)
            self.place += 0.5 * (self.speed + speed) * step
            self.speed = speed


def run(mechanics: AxisMechanics, torque: float, seconds: float) -> None:
    """Let a machine go on under a torque."""
    for _ in range(round(seconds / DT)):
        mechanics.step(torque, DT)


FORCES: Final = (
    # torque of the motor, force on the load, torque of the brake, added friction, s
    (0.9, 0.0, 0.0, 0.0, 0.05),
    (-1.3, 20.0, 0.0, 0.0, 0.08),
    (0.0, 0.0, 0.0, 15.0, 0.03),
    (0.4, -35.0, 0.02, 0.0, 0.06),
    (0.0, 0.0, 0.3, 5.0, 0.05),
    (0.7, 10.0, 0.0, 0.0, 0.04),
)


@CAMPAIGN.product(
    "motion/{ratio}-{viscous}",
    parameters={"ratio": (0.003, -0.0047), "viscous": (0.0, 130.0)},
    title="a body, ratio {ratio}, viscous friction {viscous}",
    requirements=("STP-550",),
)
def motion(ctx: CaseContext, ratio: float, viscous: float) -> None:
    """Forces, frictions and brake move it as by the laws of motion, in any direction of the motor."""
    model = Body(9.0, ratio=ratio, viscous=viscous, dry=11.0, static=17.0)
    machine = AxisMechanics(
        ratio=ratio, inertia=9.0, viscous_friction=viscous, coulomb_friction=11.0, static_friction=17.0
    )
    for number, (torque, load, brake, added, seconds) in enumerate(FORCES):
        machine.apply_force(load)
        machine.set_brake_torque(brake)
        machine.set_added_friction(added)
        model.load, model.brake = load, brake / abs(ratio) + added
        run(machine, torque, seconds)
        model.run(torque, seconds)
        near(ctx, f"{number}: velocity", machine.velocity, model.speed, within=2e-3 * (1 + abs(model.speed)))
        near(ctx, f"{number}: position", machine.position, model.place, within=3e-4)
        near(ctx, f"{number}: motor", machine.motor_angle * ratio, machine.position, within=1e-12)
        near(ctx, f"{number}: motor speed", machine.motor_speed * ratio, machine.velocity, within=1e-12)
    near(ctx, "inertia at the motor", machine.motor_inertia, 9.0 * ratio * ratio, within=1e-12)
    equal(ctx, "force from outside", machine.external_force, FORCES[-1][1])


@CAMPAIGN.case("breakaway", requirements=("STP-550",))
def breakaway(ctx: CaseContext) -> None:
    """What static friction and brake hold, to the last newton either way, stays; more of it moves."""
    for sign in (1, -1):
        for torque, brake, moves in ((17.0, 0.0, 0), (17.01, 0.0, 1), (22.0, 5.0, 0), (22.01, 5.0, 1)):
            machine = AxisMechanics(ratio=1.0, inertia=2.0, coulomb_friction=11.0, static_friction=17.0)
            machine.set_brake_torque(brake)
            run(machine, sign * torque, DT)
            equal(ctx, f"{sign * torque} Nm against {17 + brake} moves it", machine.velocity != 0.0, moves)
        machine = AxisMechanics(ratio=1.0, inertia=2.0, coulomb_friction=11.0, gravity_force=-4.0)
        run(machine, sign * 15.0, 10 * DT)
        way = sign * 15.0 - 4.0
        gone = max(abs(way) - 11.0, 0.0) / 2.0 * 10 * DT
        near(ctx, f"{sign * 15} Nm with weight", machine.velocity, math.copysign(gone, way), within=1e-9)


@CAMPAIGN.case("end-stops", requirements=("STP-536",))
def end_stops(ctx: CaseContext) -> None:
    """Pressed against a stop it comes to rest where the stop gives way to the force."""
    for sign in (1, -1):
        machine = AxisMechanics(
            ratio=1.0, inertia=2.0, upper_stop=0.05, lower_stop=-0.06, stop_stiffness=4e5, stop_damping=900.0
        )
        stop = 0.05 if sign > 0 else -0.06
        run(machine, 40.0 * sign, 0.05)
        equal(ctx, "not there yet", machine.in_contact, 0)
        fastest = 0.0
        for _ in range(round(0.5 / DT)):
            fastest = max(fastest, abs(machine.velocity))
            machine.step(40.0 * sign, DT)
        near(ctx, "greatest speed", fastest, math.sqrt(2 * 40.0 / 2.0 * abs(stop)), within=0.02)
        equal(ctx, "in contact", machine.in_contact, 1)
        near(ctx, "at rest", machine.velocity, 0.0, within=1e-6)
        near(ctx, "how far the stop gives way", machine.position - stop, sign * 40.0 / 4e5, within=1e-6)
        run(machine, -40.0 * sign, 0.02)
        equal(ctx, "away from the stop", machine.in_contact, 0)
        back = 0.5 * 40.0 / 2.0 * 0.02**2
        near(ctx, "way back", machine.position - stop, -sign * back, within=0.15 * back)
        machine.set_stops(None, None)
        equal(ctx, "no stops", machine.stops == (None, None), 1)
        run(machine, -40.0 * sign, 0.15)
        equal(ctx, "it goes on", -sign * machine.position > 0.06, 1)
        machine.place(0.04)
        equal(
            ctx, "placed", (machine.position, machine.velocity, machine.motor_angle) == (0.04, 0.0, 0.04), 1
        )
        machine.set_stops(-0.01, 0.03)
        equal(ctx, "stops", machine.stops == (-0.01, 0.03), 1)
        equal(ctx, "beyond a stop", machine.in_contact, 1)
    for stops in ((0.1, 0.1), (0.2, 0.1), (math.nan, 0.1)):
        equal(ctx, f"stops {stops} are refused", bool(refused(lambda s=stops: machine.set_stops(*s))), 1)


@CAMPAIGN.case("jam-and-slip")
def jam_and_slip(ctx: CaseContext) -> None:
    """A jam stops it dead and holds it; a slip moves the load, and the motor with it while they hold on."""
    machine = AxisMechanics(ratio=0.5, inertia=2.0)
    run(machine, 1.0, 0.1)
    place = machine.position
    machine.jam(True)
    equal(ctx, "jammed", (machine.jammed, machine.velocity, machine.motor_speed) == (True, 0.0, 0.0), 1)
    run(machine, 5.0, 0.1)
    near(ctx, "held", machine.position, place)
    machine.jam(False)
    equal(ctx, "released", machine.jammed, 0)
    run(machine, 1.0, 0.1)
    near(ctx, "it goes on", machine.position - place, 0.5 * 1.0 / 0.5 / 2.0 * 0.1**2, within=1e-4)
    place, angle = machine.position, machine.motor_angle
    equal(ctx, "the shaft moves with a slip", machine.slip(0.02), 1)
    near(ctx, "slipped", machine.position - place, 0.02)
    near(ctx, "shaft", (machine.motor_angle - angle) * 0.5, 0.02)


@CAMPAIGN.case("play", requirements=("CFG-563",))
def play(ctx: CaseContext) -> None:
    """The motor passes the play alone, and takes the load along behind it with the momentum of both; play
    grows with wear and is gone again in a new coupling; a broken one lets the motor run alone.
    """
    share, wide = 0.3, 0.004
    for sign in (1, -1):
        machine = AxisMechanics(
            ratio=0.1, inertia=2.0, backlash=wide, motor_share=share, coulomb_friction=0.5
        )
        equal(ctx, "play", machine.backlash, wide)
        steps, before = 0, 0.0
        while machine.position == 0.0 and steps < 4000:
            before = machine.motor_speed * 0.1
            machine.step(0.05 * sign, DT)
            steps += 1
        force = 0.05 / 0.1
        alone = math.sqrt(2 * (0.5 * wide) * share * 2.0 / force)
        near(ctx, "time in the play, s", steps * DT, alone, within=2 * DT)
        near(ctx, "speed in front of the load", before, sign * force / (share * 2.0) * alone, within=0.01)
        both = share * before
        near(ctx, "speed of both", machine.velocity, both, within=0.03 * abs(both) + 1e-3)
        near(ctx, "the motor is ahead", machine.motor_angle * 0.1 - machine.position, sign * 0.5 * wide)
        run(machine, 0.05 * sign, 0.05)
        near(ctx, "motor and load", machine.motor_speed * 0.1, machine.velocity, within=1e-9)
        run(machine, -0.05 * sign, 0.002)
        equal(ctx, "the load coasts", sign * machine.velocity > sign * machine.motor_speed * 0.1, 1)
        gap = machine.motor_angle * 0.1 - machine.position
        equal(ctx, "within the play", abs(gap) < 0.5 * wide, 1)
    worn = AxisMechanics(ratio=1.0, inertia=2.0)
    equal(ctx, "none at first", worn.backlash, 0.0)
    worn.set_added_backlash(0.01, 0.1)
    run(worn, 0.0, 0.05)
    near(ctx, "half of the wear", worn.backlash, 0.005, within=1e-4)
    run(worn, 0.0, 0.06)
    near(ctx, "all of the wear", worn.backlash, 0.01)
    worn.set_added_backlash(0.0)
    near(ctx, "a new coupling", worn.backlash, 0.0)
    run(worn, 1.0, 0.1)
    near(ctx, "one body again", worn.velocity, worn.motor_speed)
    near(ctx, "of the whole inertia", worn.velocity, 1.0 / 2.0 * 0.1, within=1e-6)
    moving = worn.velocity
    worn.break_coupling(0.25)
    equal(ctx, "broken", math.isinf(worn.backlash), 1)
    run(worn, 1.0, 0.1)
    near(ctx, "the load coasts", worn.velocity, moving, within=1e-9)
    near(ctx, "the motor runs alone", worn.motor_speed, moving + 1.0 / (0.25 * 2.0) * 0.1, within=1e-3)
    worn.set_brake_torque(5.0)
    run(worn, 0.0, 0.1)
    equal(ctx, "the brake holds the motor", worn.motor_speed, 0.0)
    near(ctx, "and not the load", worn.velocity, moving, within=1e-9)
    place, angle = worn.position, worn.motor_angle
    equal(ctx, "a slip leaves the shaft alone", worn.slip(0.5), 0)
    near(ctx, "slipped", worn.position - place, 0.5)
    near(ctx, "shaft", worn.motor_angle, angle, within=1e-9)
    for wrong in (0.0, 1.0, -0.1, math.nan):
        equal(ctx, f"share {wrong} is refused", bool(refused(lambda w=wrong: worn.break_coupling(w))), 1)


@CAMPAIGN.case("calm")
def calm(ctx: CaseContext) -> None:
    """Where a machine is said to be calm, no switch and no stop is met in so many steps."""
    random = np.random.default_rng(7)
    met = 0
    for _ in range(60):
        switch = SwitchModel(low=0.02, high=0.03)
        machine = AxisMechanics(
            ratio=1.0,
            inertia=1.0,
            upper_stop=0.05,
            lower_stop=-0.05,
            switches=(switch,),
            coulomb_friction=1.0,
        )
        machine.place(float(random.choice((0.0195, 0.0305, 0.0495)) + random.uniform(-0.0008, 0.0004)))
        machine.step(float(random.uniform(-90, 90)), DT)
        torque = float(random.uniform(0, 90))
        if not machine.find_calm(8, DT, torque):
            continue
        met += 1
        state, sign = switch.state, 1 if random.random() < 0.5 else -1
        for _ in range(8):
            machine.step(sign * torque, DT)
            equal(ctx, "in contact", machine.in_contact, 0)
            equal(ctx, "switch has changed", switch.state is not state, 0)
    equal(ctx, f"places that are calm: {met}", 5 < met < 55, 1)


# -- switches, shaft, brake --------------------------------------------------------------------------------


@CAMPAIGN.case("switches", requirements=("LIM-024",))
def switches(ctx: CaseContext) -> None:
    """Each end of a switch with its hysteresis, from either side, to the last digit; polarity, and a signal
    that is forced.
    """
    beyond = math.nextafter
    for inverted in (False, True):
        told: list[tuple[bool, float | None]] = []
        switch = SwitchModel(low=1.0, high=2.0, hysteresis=0.25, inverted=inverted)
        switch.on_change = lambda s=switch, t=told: t.append((s.state is not s.inverted, s.edge))
        for place, actuated in (
            (beyond(1.0, 0), False),
            (1.0, True),
            (0.75, True),
            (beyond(0.75, 0), False),
            (2.0, True),
            (2.25, True),
            (beyond(2.25, 3), False),
            (beyond(2.0, 3), False),
            (2.0, True),
            (1.5, True),
            (0.5, False),
        ):
            switch.update(place, moving=True)
            equal(ctx, f"operated at {place}", switch.actuated, actuated)
            equal(ctx, f"signal at {place}", switch.state, actuated is not inverted)
            low, high = switch.quiet_range(place)
            equal(ctx, f"{place} is in its range", low <= place <= high, 1)
            equal(ctx, f"ends of the range at {place}", (low, high) in _RANGES[actuated], 1)
        places = [1.0, 0.75, 1.0, 2.25, 2.0, 0.75]
        equal(ctx, f"edges are at {places}: {told}", [edge for _, edge in told] == places, 1)
    switch = SwitchModel.above(1.0, hysteresis=0.1)
    for place, state in ((0.99, False), (1.0, True), (0.95, True), (0.89, False), (1e9, True)):
        switch.update(place)
        equal(ctx, f"above 1, at {place}", switch.state, state)
    switch = SwitchModel.below(1.0, hysteresis=0.1, inverted=True)
    for place, state in ((1.01, True), (1.0, False), (1.05, False), (1.11, True), (-1e9, False)):
        switch.update(place)
        equal(ctx, f"below 1, inverted, at {place}", switch.state, state)
    jumped = SwitchModel(low=1.0, high=2.0)
    seen: list[bool] = []
    jumped.on_change = lambda: seen.append(jumped.state)
    jumped.update(0.0, moving=True)
    jumped.update(5.0, moving=True)
    equal(ctx, "passed within a step: there and back", seen == [True, False], 1)
    jumped.update(0.0)
    equal(ctx, "placed beyond it: nothing", len(seen), 2)
    forced = SwitchModel.unreached()
    equal(ctx, "out of reach", forced.state, 0)
    forced.forced = True
    equal(ctx, "forced", (forced.state, forced.forced, forced.actuated) == (True, True, False), 1)
    forced.inverted = True
    equal(ctx, "forced has no polarity", forced.state, 1)
    forced.forced = None
    equal(ctx, "inverted", forced.state, 1)
    forced.inverted = False
    equal(ctx, "not inverted", forced.state, 0)


_RANGES: Final = {
    True: [(0.75, 2.25)],
    False: [(-math.inf, 1.0), (2.0, math.inf)],
}


@CAMPAIGN.case("shaft")
def shaft(ctx: CaseContext) -> None:
    """Ramps, lists of them, repeated ones: position is the integral of the speed at any time."""
    scheduler = VirtualScheduler()
    turned = DrivenShaft(scheduler, position=3.0)
    profile = [(0.1, 5.0), (0.2, -1.0), (0.0, 2.0), (0.05, 2.0)]

    def at(seconds: float, *, repeat: bool) -> tuple[float, float]:
        place, speed, left = 3.0, 0.0, seconds
        while True:
            for duration, target in profile:
                if left < duration:
                    now = speed + (target - speed) * left / duration
                    return place + 0.5 * (speed + now) * left, now
                place += 0.5 * (speed + target) * duration
                speed, left = target, left - duration
            if not repeat:
                return place + speed * left, speed

    for repeat in (False, True):
        turned.place(3.0)
        turned.follow(profile, repeat=repeat)
        for step in range(1, 40):
            scheduler.run_for(17_000_000)
            place, speed = at(step * 0.017, repeat=repeat)
            near(ctx, f"position after {step}", turned.position, place, within=1e-7)
            near(ctx, f"speed after {step}", turned.velocity, speed, within=1e-7)
    turned.place(1.0)
    turned.turn(-4.0, ramp_s=0.1)
    scheduler.run_for(50_000_000)
    near(ctx, "half of a ramp", turned.velocity, -2.0, within=1e-9)
    turned.turn(1.0)
    near(ctx, "at once", turned.velocity, 1.0, within=1e-9)
    near(ctx, "from there", turned.position, 0.95, within=1e-9)
    for values, repeat in (([(0.0, 1.0)], True), ([(-0.1, 1.0)], False), ([(0.1, math.nan)], False)):
        said = refused(lambda v=values, r=repeat: turned.follow(v, repeat=r))
        equal(ctx, f"{values} is refused", bool(said), 1)


@CAMPAIGN.case("brake", requirements=("STP-532",))
def brake(ctx: CaseContext) -> None:
    """It opens and closes after its times, not before; stuck, worn, held from outside."""
    machine = AxisMechanics(ratio=1.0, inertia=1.0)
    held = HoldingBrake(machine, torque_Nm=8.0, opening_time_s=0.010, closing_time_s=0.020)

    def moves(torque: float) -> bool:
        machine.place(0.0)
        machine.step(torque, DT)
        return machine.velocity != 0.0

    equal(ctx, "closed at first", (held.closed, held.busy, held.holding_torque_Nm) == (True, False, 8.0), 1)
    equal(ctx, "it holds", (moves(8.0), moves(8.1)) == (False, True), 1)
    for opens, time_s in ((True, 0.010), (False, 0.020)):
        (held.open if opens else held.close)()
        equal(ctx, "on its way", held.busy, 1)
        steps = 0
        while held.busy and steps < 1000:
            held.step(0.001)
            steps += 1
            equal(ctx, "changed before its time", held.closed is not opens, steps * 0.001 >= time_s - 1e-9)
        near(ctx, f"time until it is {'open' if opens else 'closed'}", steps * 0.001, time_s)
        equal(ctx, "holding torque", held.holding_torque_Nm, 0.0 if opens else 8.0)
        held.step(1.0)
        equal(ctx, "it stays", held.closed is not opens, 1)
    held.open()
    held.step(0.009)
    held.close()
    equal(ctx, "withdrawn in time", (held.closed, held.busy) == (True, False), 1)
    held.open()
    held.step(0.009)
    equal(ctx, "its time counts anew", held.closed, 1)
    held.step(0.001)
    equal(ctx, "open", held.closed, 0)
    held.set_torque_share(0.5)
    held.set_stuck(True)
    equal(ctx, "stuck closed, worn", held.holding_torque_Nm, 4.0)
    equal(ctx, "it holds half", (moves(4.0), moves(4.1)) == (False, True), 1)
    held.set_stuck(False)
    held.close()
    held.step(0.020)
    equal(ctx, "stuck open", held.holding_torque_Nm, 0.0)
    held.set_stuck(None)
    held.set_torque_share(1.0)
    equal(ctx, "as new", held.holding_torque_Nm, 8.0)
    for attribute, closed in (("forced_open", False), ("forced_closed", True)):
        setattr(held, attribute, True)
        equal(ctx, attribute, getattr(held, attribute), 1)
        held.step(0.02)
        equal(ctx, "after its time", held.closed, closed)
        setattr(held, attribute, False)
        held.step(0.02)
        equal(ctx, "let go", held.closed, 1)
    held.forced_open = held.forced_closed = True
    held.step(0.02)
    equal(ctx, "closed goes before open", held.closed, 1)
    none = HoldingBrake(machine)
    none.open()
    equal(ctx, "no brake does nothing", (none.busy, none.holding_torque_Nm) == (False, 0.0), 1)


@CAMPAIGN.case("window")
def window(ctx: CaseContext) -> None:
    """A condition counts when it has held for its time, to the step, begins anew, and falls back at once."""
    for time_s, steps in ((0.0, 1), (0.001, 2), (0.005, 6)):
        timer = WindowTimer(time_s)
        for _ in range(2):
            found = [timer.update(True, 0.001) for _ in range(steps + 2)]
            equal(ctx, f"{time_s} s: {found}", found == [False] * (steps - 1) + [True] * 3, 1)
            equal(ctx, "falls back", timer.update(False, 0.001) or timer.expired, 0)
        timer.update(True, 0.001)
        timer.reset()
        equal(ctx, "reset", timer.expired, 0)


# -- profile and ramp --------------------------------------------------------------------------------------


def _travel(profile: PositionProfile, seconds: float, step: float) -> np.ndarray:
    rows = []
    for _ in range(round(seconds / step)):
        profile.advance()
        rows.append((profile.position, profile.velocity, float(profile.done)))
    return np.array(rows)


SHAPES: Final = {
    "trapezoid": (ProfileForm(), 1.0),
    "sine": (ProfileForm(RampShape.SIN2), math.pi / 2),
    "jerk-free": (ProfileForm(RampShape.JERK_FREE), 1.875),
    "jerk": (ProfileForm(jerk=400.0), 1.0),
    "two-jerks": (ProfileForm(jerk=400.0, braking_jerk=250.0), 1.0),
}


@CAMPAIGN.product(
    "profile/{shape}",
    parameters={"shape": tuple(SHAPES)},
    title="positions of a profile: {shape}",
    requirements=("C402-095",),
)
def profile(ctx: CaseContext, shape: str) -> None:
    """It ends at its target in the time of the formula and keeps speed, acceleration, deceleration and jerk;
    to the other side it does the same; a new target on the way is reached, too.
    """
    form, stretch = SHAPES[shape]
    step, fast, up, down = 0.001, 3.0, 20.0, 12.0
    smoothing = max(up / form.jerk, down / (form.braking_jerk or form.jerk)) if form.jerk else 0.0
    for way in (2.5, 0.2, -2.5, -0.2):
        moved = PositionProfile(step_s=step)
        moved.reset(1.0)
        moved.move(1.0 + way, velocity=fast, acceleration=up, deceleration=down, form=form)
        rows = _travel(moved, 3.0, step)
        place, speed, done = rows.T
        u, d = up / stretch, down / stretch
        peak = min(fast, math.sqrt(2 * abs(way) * u * d / (u + d)))
        cruise = max(0.0, abs(way) - 0.5 * peak * peak * (1 / u + 1 / d)) / peak
        cruises = cruise > step
        needed = peak / u + peak / d + cruise + smoothing
        took = float(np.argmax(done > 0) + 1) * step
        near(ctx, f"{way}: time", took, needed, within=2.5 * step)
        near(ctx, f"{way}: target", place[-1], 1.0 + way, within=1e-9)
        near(ctx, f"{way}: at rest", speed[-1], 0.0, within=1e-12)
        fastest = float(np.max(np.abs(speed)))
        if cruises or not form.jerk:
            near(ctx, f"{way}: greatest speed", fastest, peak, within=0.01 * peak + up * step)
        near(
            ctx,
            f"{way}: no way back",
            float(np.min(np.sign(way) * np.diff(place))),
            0.0,
            within=1e-9 + fast * step,
        )
        equal(ctx, f"{way}: it never turns", np.min(np.sign(way) * speed) >= -1e-9, 1)
        slope = np.sign(way) * np.diff(np.concatenate(([0.0], speed))) / step
        if not form.jerk or cruise > 0.2:
            near(ctx, f"{way}: acceleration", float(slope.max()), up, within=0.03 * up)
            near(ctx, f"{way}: deceleration", float(slope.min()), -down, within=0.03 * down)
        integral = np.cumsum(0.5 * (speed + np.concatenate(([0.0], speed[:-1])))) * step
        off = float(np.max(np.abs(place - 1.0 - integral)))
        near(ctx, f"{way}: position is the integral", off, 0.0, within=2e-4)
        if form.jerk:
            steepest = float(np.max(np.abs(np.diff(slope)))) / step
            near(
                ctx,
                f"{way}: jerk",
                steepest,
                0.0,
                within=1.02 * (max(up, down) if cruises else up + down) / smoothing,
            )
        # A new target on the way, before and behind, and one that is passed with a speed.
        for other, end in ((3.0, 0.0), (-1.0, 0.0), (1.2, 0.0), (3.0, 0.7), (3.0, 9.0)):
            moved.reset(0.0)
            moved.move(2.0, velocity=fast, acceleration=up, deceleration=down, form=form)
            _travel(moved, 0.3, step)
            moved.move(
                other, velocity=0.8 * fast, acceleration=up, deceleration=down, end_velocity=end, form=form
            )
            rows = _travel(moved, 3.0 + smoothing, step)
            near(
                ctx,
                f"{other}, {end}: greatest speed",
                float(np.max(np.abs(rows[:, 1]))),
                0.0,
                within=1.001 * fast,
            )
            if not end:
                near(ctx, f"{other}: new target", rows[-1, 0], other, within=1e-9)
                continue
            near(ctx, f"{other}, {end}: speed there", rows[-1, 1], min(end, 0.8 * fast), within=1e-6)
            passed = float(np.interp(other, rows[:, 0], np.arange(len(rows))))
            equal(ctx, f"{other}, {end}: it is passed", 0 < passed < len(rows) - 1, 1)
    for wrong in ({"velocity": 0.0}, {"acceleration": 0.0}, {"deceleration": -1.0}):
        values = {"velocity": 1.0, "acceleration": 1.0, "deceleration": 1.0} | wrong
        equal(ctx, f"{wrong} is refused", bool(refused(lambda v=values: moved.move(1.0, **v))), 1)
    equal(ctx, "a step of 0 is refused", bool(refused(PositionProfile, step_s=0.0)), 1)


ROUNDINGS: Final = (
    # acceleration, deceleration, initial, final, s
    (50.0, 30.0, 0.0, 0.0),
    (50.0, 30.0, 0.2, 0.1),
    (50.0, 30.0, 0.0, 0.1),
    (50.0, 30.0, 0.2, 0.0),
)


@CAMPAIGN.product(
    "rounded-ramp/{number}",
    parameters={"number": tuple(range(len(ROUNDINGS)))},
    title="a ramp with rounding, {number}",
    requirements=("PD-116",),
)
def rounded_ramp(ctx: CaseContext, number: int) -> None:
    """A ramp takes speed / slope and half of both roundings, keeps slope and jerk, to either side; a target
    that is nearer than the roundings, one that turns round, and one that is broken off.
    """
    up, down, initial, final = ROUNDINGS[number]
    shape = Rounding(up, down, initial, final)
    step = 0.001

    def to(ramp: RoundedRamp, target: float, seconds: float, form: Rounding = shape) -> np.ndarray:
        found = [ramp.velocity]
        for _ in range(round(seconds / step)):
            ramp.aim(ramp.velocity, target, form)
            found.append(ramp.step(step))
        return np.array(found)

    for sign in (1, -1):
        ramp = RoundedRamp()
        for target, limit in ((40.0, up), (55.0, up), (20.0, down), (0.0, down)):
            begin = ramp.velocity
            speeds = to(ramp, sign * target, 2.5)
            change = abs(sign * target - begin)
            full = change >= limit * 0.5 * (initial + final)
            if full:
                needed = change / limit + 0.5 * (initial + final)
            else:
                # The slope stays below the limit: rise and fall in proportion to their times.
                peak = math.sqrt(2.0 * change * limit / (initial + final))
                needed = peak / limit * (initial + final)
            took = float(np.argmax(np.abs(speeds - sign * target) < 1e-9)) * step
            near(ctx, f"{sign * target}: time", took, needed, within=2.5 * step)
            slope = np.diff(speeds) / step
            near(ctx, f"{sign * target}: slope", float(np.max(np.abs(slope))), 0.0, within=limit * 1.0001)
            if full:
                equal(ctx, f"{sign * target}: slope is used", np.max(np.abs(slope)) > 0.98 * limit, 1)
            if initial and final:
                jerk = float(np.max(np.abs(np.diff(slope)))) / step
                near(ctx, f"{sign * target}: jerk", jerk, 0.0, within=1.01 * limit / min(initial, final))
            overshoot = float(np.max(np.abs(speeds)))
            near(ctx, f"{sign * target}: no overshoot", overshoot, 0.0, within=max(abs(begin), target) + 1e-6)
        to(ramp, sign * 40.0, 0.3)
        turned = to(ramp, sign * -10.0, 3.0)
        near(ctx, "turned round", turned[-1], sign * -10.0, within=1e-9)
        change = np.diff(turned) / step
        near(ctx, "its slopes", float(np.max(np.abs(change))), 0.0, within=up * 1.0001)
        to(ramp, sign * 40.0, 0.25)
        before = ramp.velocity
        ramp.hold()
        held = [ramp.step(step) for _ in range(5)]
        equal(ctx, "broken off", set(held) == {before}, 1)
        equal(ctx, "no slope", ramp.slope, 0.0)
        if initial and final:
            breaks = shape._replace(continuous=False)
            for form in (shape, breaks):
                ramp = RoundedRamp()
                to(ramp, sign * 40.0, 0.4, form)
                speeds = to(ramp, 0.0, 2.0, form)
                went_on = float(np.max(np.abs(speeds))) > abs(speeds[0]) + 0.05
                equal(ctx, f"continuous = {form.continuous}: the slope falls first", went_on, form.continuous)
                near(ctx, "and comes to 0", speeds[-1], 0.0, within=1e-9)
        elsewhere = RoundedRamp()
        elsewhere.aim(sign * 7.0, sign * 7.0, shape)
        equal(ctx, "a ramp begins where the speed is", elsewhere.velocity, sign * 7.0)


# -- heat and supply ---------------------------------------------------------------------------------------


@CAMPAIGN.case("heat", requirements=("C402-160",))
def heat(ctx: CaseContext) -> None:
    """Utilisation and temperature go to their ends by exponentials; each limit is where it is."""
    model = ThermalModel(rated_torque_Nm=2.0, time_constant_s=5.0)
    seconds = 0.0
    while not model.update(3.0, 0.01):
        seconds += 0.01
        if seconds > 20.0:
            break
    due = -5.0 * math.log(1.0 - 1.05 / 2.25)
    near(ctx, "trips after, s", seconds, due, within=0.02)
    equal(ctx, "tripped", (model.tripped, model.near, model.recovered) == (True, True, False), 1)
    seconds = 0.0
    while not model.recovered and seconds < 20.0:
        model.update(0.0, 0.02)
        seconds += 0.02
    near(ctx, "recovered after, s", seconds, 5.0 * math.log(1.05), within=0.03)
    model.utilisation = 0.95 * 1.05
    equal(ctx, "not near at 95 %", model.near, 0)
    model.utilisation = 1.05
    equal(ctx, "no trip at 100 %", model.tripped or model.advance(1.05 * 4.0, 0.0), 0)
    for name in ("rated_torque_Nm", "time_constant_s"):
        values = {"rated_torque_Nm": 1.0, name: 0.0}
        equal(ctx, f"{name} = 0 is refused", name in refused(ThermalModel, **values), 1)
    node = ThermalNode(rise_K=80.0, time_constant_s=10.0, ambient_C=25.0, warning_C=60.0, fault_C=90.0)
    for load, time_s in ((1.5, 4.0), (0.2, 6.0), (2.0, 3.0)):
        before = node.rise_now_K
        for _ in range(50):
            node.advance(load, time_s / 50)
        end = load * 80.0
        near(
            ctx,
            "temperature",
            node.temperature_C,
            25 + end + (before - end) * math.exp(-time_s / 10),
            within=1e-6,
        )
    for place, warm, hot in ((59.99, 0, 0), (60.0, 1, 0), (89.99, 1, 0), (90.0, 1, 1)):
        node.forced_C = place
        equal(ctx, f"warm at {place}", node.warm, warm)
        equal(ctx, f"hot at {place}", node.hot, hot)
        equal(ctx, "what the sensor shows", node.temperature_C, place)


@CAMPAIGN.case("dc-link", requirements=("C402-029",))
def dc_link(ctx: CaseContext) -> None:
    """Charged by the mains, discharged by the load, raised by braking until the chopper burns it, with the
    energy that the laws say; limits, missing phase, brown-out, failed and overheated chopper.
    """
    config = SupplyConfig(
        nominal_v=500.0, undervoltage_v=400.0, overvoltage_v=700.0, chopper_on_v=620.0, chopper_off_v=600.0
    )
    capacity, step = config.capacitance_uf * 1e-6, 0.002

    def after(link: DcLink, power: float, seconds: float) -> float:
        for _ in range(round(seconds / step)):
            link.update(power, step)
        return link.voltage_V

    link = DcLink(config)
    equal(ctx, "settled", link.settled, 1)
    for missing, factor in ((False, 1.0), (True, 2.0)):
        link.phase_missing = missing
        drop = 2000.0 * 0.005 * factor / (capacity * 500.0)
        near(ctx, f"under load, {missing=}", after(link, 2000.0, 0.5), 500.0 - drop, within=0.01)
        near(ctx, "without", after(link, 0.0, 0.5), 500.0)
    link.phase_missing = False
    link.mains_on = False
    equal(ctx, "not settled without mains", link.settled, 0)
    energy = 0.5 * capacity * 500.0**2 - (100.0 + config.standby_w) * 0.1
    near(ctx, "discharged", after(link, 100.0, 0.1), math.sqrt(2 * energy / capacity), within=0.01)
    near(ctx, "empty", after(link, 5000.0, 0.2), 0.0)
    equal(ctx, "too low", link.low, 1)
    link.restart()
    near(ctx, "switched on without mains", link.voltage_V, 0.0)
    link.mains_on = True
    near(ctx, "one time constant", after(link, 0.0, 0.004) / 500.0, 1 - math.exp(-0.8), within=1e-3)
    link.restart()
    near(ctx, "switched on with mains", link.voltage_V, 500.0)
    link.mains_share = 0.79
    drop = 500.0 * 0.005 / (capacity * 395.0)
    near(ctx, "brown-out", after(link, 500.0, 1.0), 395.0 - drop, within=0.01)
    equal(ctx, "too low", link.low, 1)
    near(ctx, "mains", link.mains_V, 395.0)
    link.mains_share = 1.0
    after(link, 0.0, 0.2)
    energy = 0.5 * capacity * 500.0**2 + (1500.0 - config.standby_w) * 0.01
    near(ctx, "braking raises it", after(link, -1500.0, 0.01), math.sqrt(2 * energy / capacity), within=0.01)
    equal(ctx, "no chopping", link.chopping, 0)
    burnt = 0.0
    highest = 0.0
    for _ in range(200):
        link.update(-1500.0, step)
        burnt += link.chopper_power_W * step
        highest = max(highest, link.voltage_V)
    stored = 0.5 * capacity * (link.voltage_V**2 - 500.0**2)
    near(ctx, "energy, J", burnt + stored, (1500.0 - config.standby_w) * 0.41, within=2.0)
    equal(ctx, "the chopper keeps it down", 600.0 < highest < 620.0, 1)
    equal(ctx, "neither low nor high", link.low or link.high, 0)
    link.chopper_failed = True
    after(link, -1500.0, 0.05)
    equal(ctx, "failed: too high", (link.high, link.chopping) == (True, False), 1)
    link.chopper_failed = False
    after(link, 0.0, 0.1)
    lost = 2 * config.standby_w * 0.1 / capacity
    near(ctx, "down to where it ceases", link.voltage_V, math.sqrt(600.0**2 - lost), within=0.5)
    hot = DcLink(config)
    seconds = 0.0
    while not hot.chopper_overloaded and seconds < 60.0:
        hot.update(-415.0, 0.01)
        seconds += 0.01
    near(ctx, "the resistor is too hot after, s", seconds, 20.0 * math.log(2.0), within=0.6)
    hot.force(700.0)
    equal(ctx, "700 V is not too high", hot.high, 0)
    hot.force(700.1)
    equal(ctx, "700.1 V is", hot.high, 1)
    hot.update(-9000.0, 0.5)
    near(ctx, "held", hot.voltage_V, 700.1)
    hot.force(400.0)
    equal(ctx, "400 V is not too low", hot.low, 0)
    hot.force(399.9)
    equal(ctx, "399.9 V is", hot.low, 1)
    equal(ctx, "still too hot", hot.chopper_overloaded, 1)
    for _ in range(500):
        hot.update(0.0, 0.01)
    equal(ctx, "cooled down", hot.chopper_overloaded, 0)
    hot.force(None)
    near(ctx, "let go", hot.voltage_V, 500.0)
    near(ctx, "cold", [hot.update(0.0, 10.0) for _ in range(40)] and hot.chopper_load, 0.0)
