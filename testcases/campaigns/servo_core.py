"""The cascade of an emulated drive by itself: what it is told, against laws of motion and plain models of its
controllers; every command to both sides, in single steps and several at once, and from every other one.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Final

import numpy as np

from emulators.drive.brake import HoldingBrake
from emulators.drive.core import ServoCore, ServoTuning
from emulators.drive.machine import EncoderConfig
from emulators.mechanics import AxisMechanics
from hil.campaign import Campaign, CaseContext
from testcases.campaigns.machine_parts import near
from testcases.campaigns.support import equal

CAMPAIGN: Final = Campaign(
    "servo core", controller="", tags=("drive",), bench="testcases.campaigns.can_bus:BENCH"
)
DT: Final = 250e-6
INERTIA: Final = 4e-4
LAG_S: Final = 0.002
INTEGRAL_S: Final = 0.02


def core(*, friction: float = 0.0, viscous: float = 0.0, brake_nm: float = 0.0, **tuning: float) -> ServoCore:
    """Return a drive on a shaft."""
    machine = AxisMechanics(ratio=1.0, inertia=INERTIA, coulomb_friction=friction, viscous_friction=viscous)
    brake = HoldingBrake(machine, torque_Nm=brake_nm, opening_time_s=0.01, closing_time_s=0.02)
    encoder = EncoderConfig(counts_per_revolution=1 << 20).build(None)
    made = ServoCore(
        mechanics=machine, encoder=encoder, period_s=DT, tuning=ServoTuning(**tuning), brake=brake
    )
    made.set_torque_limits(6.0, 5.0)
    made.set_speed_limit(300.0)
    return made


def steps(one: ServoCore, count: int) -> np.ndarray:
    """Make single steps; returns speed, torque, demand, place, and place demanded, a row each."""
    rows = []
    for _ in range(count):
        one.step()
        rows.append((one.velocity, one.torque, one.velocity_demand, one.position, one.position_demand))
    return np.array(rows).reshape(count, 5)


Command = Callable[[ServoCore, int], object]
COMMANDS: Final[dict[str, Command]] = {
    "velocity": lambda one, sign: one.command_velocity(sign * 60.0, 16),
    "velocity-back": lambda one, sign: one.command_velocity(-sign * 25.0, 24),
    "position": lambda one, sign: one.command_position(one.position + sign * 0.3, 16, coast=8),
    "servo": lambda one, sign: one.command_servo(sign * 40.0, one.position + sign * 0.1, 80.0, 16),
    "servo-at-once": lambda one, sign: one.command_servo(sign * 30.0, one.position + sign * 0.02, 50.0, 1),
    "hold": lambda one, _: one.hold_position(),
    "profile": lambda one, sign: one.follow_profile().move(
        one.position + sign * 1.5, velocity=50.0, acceleration=3000.0, deceleration=2000.0
    ),
    "torque": lambda one, sign: one.command_torque(sign * 0.7, 12),
    "ramp": lambda one, sign: one.ramp(sign * 55.0, 2500.0, deceleration=1500.0),
    "tracking-ramp": lambda one, sign: one.ramp(-sign * 35.0, 2500.0, track_position=True),
    "stop": lambda one, _: one.stop(4000.0),
    "offset": lambda one, sign: one.add_torque(sign * 0.3, 10),
    "push": lambda one, sign: one.mechanics.apply_force(sign * 0.4),
    "no-push": lambda one, _: one.mechanics.apply_force(0.0),
    "steep": lambda one, sign: one.ramp(sign * 200.0, math.inf),
    "steep-back": lambda one, sign: one.ramp(-sign * 200.0, math.inf),
}
STATE: Final = (
    *("position", "velocity", "torque", "torque_demand", "velocity_demand", "position_demand"),
    *("following_error", "precontrol_velocity", "position_command", "position_ahead", "torque_offset"),
    "commanded_torque",
)
FLAGS: Final = (
    *("torque_limited", "speed_limited", "enabled", "controls_position", "controls_torque", "stopping"),
    *("standing", "interpolating", "phase_steps"),
)


def _state(one: ServoCore) -> list[float]:
    return [float(getattr(one, name)) for name in STATE]


def _flags(one: ServoCore) -> list[int]:
    return [int(getattr(one, name)) for name in FLAGS]


@CAMPAIGN.product(
    "both-sides/{friction}",
    parameters={"friction": (0.0, 0.15)},
    title="all commands to both sides, dry friction {friction} Nm",
)
def both_sides(ctx: CaseContext, friction: float) -> None:
    """What it does to one side it does to the other, to the last digit; several steps at once are these
    steps.
    """
    plus, minus, at_once = (core(friction=friction, viscous=1e-3) for _ in range(3))
    minus.set_torque_limits(5.0, 6.0)
    for one in (plus, minus, at_once):
        one.enable_pulses()
        one.step()
    wrong: list[str] = []
    calm = 0
    for _ in range(2):
        for name, command in COMMANDS.items():
            command(plus, 1)
            command(minus, -1)
            command(at_once, 1)
            for _ in range(12):
                for _ in range(8):
                    plus.step()
                    minus.step()
                if at_once.calm():
                    at_once.advance(8)
                    calm += 1
                else:
                    steps(at_once, 8)
                there, back, same = _state(plus), _state(minus), _state(at_once)
                wrong += [
                    f"{name}: {what} is {value} and {other}"
                    for what, value, other in zip(STATE, there, back, strict=True)
                    if value != -other
                ]
                wrong += [
                    f"{name}: {what} is {value}, at once {other}"
                    for what, value, other in zip(STATE, there, same, strict=True)
                    if abs(value - other) > 1e-12 * (1.0 + abs(value))
                ]
                if not _flags(plus) == _flags(minus) == _flags(at_once):
                    wrong.append(f"{name}: {_flags(plus)}, {_flags(minus)}, {_flags(at_once)}")
    equal(ctx, f"several steps at once: {calm} times", calm > 250, 1)
    equal(ctx, f"differences: {'; '.join(wrong[:4])}", len(wrong), 0)


@CAMPAIGN.case("interpolated", requirements=("C402-101",))
def interpolated(ctx: CaseContext) -> None:
    """A speed is reached on a line in so many steps, without lag; a position too, and it coasts so long and
    no longer.
    """
    for count in (1, 2, 16):
        one = core()
        one.enable_pulses()
        steps(one, 3)
        one.command_velocity(8.0, count)
        equal(ctx, "interpolating", one.interpolating, 1)
        equal(ctx, "steps to go", one.phase_steps, count)
        rows = steps(one, count + 4)
        line = np.minimum(np.arange(1, count + 5) / count, 1.0) * 8.0
        near(ctx, f"{count}: demand", float(np.max(np.abs(rows[:, 2] - line))), 0.0, within=1e-12)
        mean = 0.5 * (line + np.concatenate(([0.0], line[:-1])))
        # The encoder shows the mean of the last step.
        if count > 2:
            off = float(np.max(np.abs(rows[1:, 0] - mean[:-1])))
            near(ctx, f"{count}: lag", off, 0.0, within=1e-9)
        near(
            ctx, f"{count}: torque of the ramp", rows[0, 1], min(INERTIA * 8.0 / count / DT, 6.0), within=1e-9
        )
        equal(ctx, f"{count}: over", one.interpolating, 0)
        equal(ctx, f"{count}: steps since", one.phase_steps, 0)
    for coast in (0, 5):
        one = core()
        one.enable_pulses()
        one.command_position(0.04, 10, coast=coast)
        way = []
        for _ in range(30):
            way.append(one.position_command)
            one.step()
        line = np.minimum(np.arange(30), 10 + coast) * 0.004
        near(ctx, f"coast {coast}: demand", float(np.max(np.abs(np.array(way) - line))), 0.0, within=1e-12)
        equal(ctx, f"coast {coast}: position is controlled", one.controls_position, 1)
        steps(one, 400)
        near(ctx, f"coast {coast}: it is there", one.position, line[-1], within=1e-6)
        near(ctx, f"coast {coast}: following error", one.following_error, 0.0, within=1e-6)
    one = core()
    one.enable_pulses()
    one.command_position(0.04, 10, coast=3)
    found = []
    for _ in range(15):
        found.append(one.phase_steps)
        one.step()
    equal(ctx, f"phase {found}", found == [*range(10, 0, -1), 0, -1, -2, -3, -3], 1)


def _pi(load: float, seconds: float, *, integral_s: float = INTEGRAL_S) -> list[float]:
    """Speed of a shaft under a load with a PI controller, every step of the drive."""
    fine = 40
    gain = INERTIA / LAG_S
    speed = integral = 0.0
    found = []
    for number in range(round(seconds / DT) * fine):
        torque = -gain * speed + integral
        integral -= (gain / integral_s if integral_s else 0.0) * speed * DT / fine
        speed += (torque + load) / INERTIA * DT / fine
        if number % fine == fine - 1:
            found.append(speed)
    return found


@CAMPAIGN.product(
    "load/{integral}",
    parameters={"integral": (0.02, 0.0, 0.05)},
    title="a load step, integral time {integral} s",
)
def load(ctx: CaseContext, integral: float) -> None:
    """The speed gives way and comes back as with the gains of the configuration."""
    for push in (0.5, -0.5):
        one = core(velocity_integral_time_s=integral)
        one.enable_pulses()
        steps(one, 4)
        one.mechanics.apply_force(push)
        found = steps(one, 400)[:, 0]
        model = np.array(_pi(push, 0.1, integral_s=integral))
        deepest = float(np.max(np.abs(model)))
        off = float(np.max(np.abs(found - model)))
        near(ctx, f"{push} Nm: speed against the model", off, 0.0, within=0.08 * deepest)
        near(ctx, f"{push} Nm: in the end", found[-1], float(model[-1]), within=0.01 * deepest)
        near(ctx, f"{push} Nm: greatest speed", float(np.max(np.abs(found))), deepest, within=0.04 * deepest)


@CAMPAIGN.case("position-loop", requirements=("PD-195",))
def position_loop(ctx: CaseContext) -> None:
    """A deviation decays with the gain, given or configured; the speed limit holds on the way."""
    for kind, gain in (("servo", 60.0), ("configured", 45.0)):
        for sign in (1, -1):
            one = core(position_gain=gain)
            one.enable_pulses()
            if kind == "servo":
                one.command_servo(0.0, sign * 0.05, gain, 1)
            else:
                one.hold_position()
                steps(one, 2)
                one.command_position(sign * 0.05, 1, precontrol=0.0)
            place, speed = 0.0, 0.0
            found = steps(one, 240)
            for _ in range(240 * 20):
                wanted = gain * (sign * 0.05 - place)
                speed += (wanted - speed) / LAG_S * DT / 20
                place += speed * DT / 20
            near(ctx, f"{kind} {sign}: place after 60 ms", found[-1, 3], place, within=2e-3)
            near(
                ctx,
                f"{kind} {sign}: after 15 ms",
                found[59, 3],
                sign * 0.05 * _settled(gain, 0.015),
                within=3e-3,
            )
    for sign in (1, -1):
        one = core()
        one.set_speed_limit(20.0)
        one.enable_pulses()
        one.command_servo(0.0, sign * 3.0, 60.0, 1)
        rows = steps(one, 400)
        near(ctx, "speed at the limit", rows[-1, 0], sign * 21.0, within=0.01)
        equal(ctx, "limited", one.speed_limited, 1)
        one.command_servo(0.0, one.position, 60.0, 1)
        steps(one, 100)
        equal(ctx, "no longer limited", one.speed_limited, 0)


def _settled(gain: float, seconds: float) -> float:
    place = speed = 0.0
    for _ in range(round(seconds / 1e-5)):
        speed += (gain * (1.0 - place) - speed) / LAG_S * 1e-5
        place += speed * 1e-5
    return place


@CAMPAIGN.case("torque", requirements=("C402-103",))
def torque(ctx: CaseContext) -> None:
    """A torque is reached on a line, accelerates by the inertia, is cut at its limits and at the speed limit;
    an additive torque comes on top; it ends with its slope and says so once.
    """
    for sign in (1, -1):
        one = core()
        one.enable_pulses()
        steps(one, 2)
        one.command_torque(sign * 0.8, 8)
        rows = steps(one, 108)
        line = sign * 0.8 * np.minimum(np.arange(1, 109) / 8, 1.0)
        near(ctx, "torque", float(np.max(np.abs(rows[:, 1] - line))), 0.0, within=1e-12)
        gained = float(np.sum(line[:-1])) * DT / INERTIA
        near(ctx, "speed", one.mechanics.velocity, gained, within=1e-9)
        equal(ctx, "torque is controlled", one.controls_torque, 1)
        near(ctx, "commanded torque", one.commanded_torque, sign * 0.8)
        one.add_torque(sign * -0.2, 4)
        near(ctx, "with an additive torque", steps(one, 5)[-1, 1], sign * 0.6, within=1e-12)
        one.add_torque(0.0)
        near(ctx, "without it, at once", steps(one, 1)[-1, 1], sign * 0.8, within=1e-12)
        one.command_torque(sign * 50.0)
        steps(one, 1)
        limit = 6.0 if sign > 0 else 5.0
        near(ctx, "at its limit", one.torque, sign * limit)
        equal(ctx, "limited", one.torque_limited, 1)
        near(ctx, "what the limits leave", one.limited_torque(sign * 50.0), sign * limit)
        near(ctx, "and what they do not touch", one.limited_torque(sign * 4.9), sign * 4.9)
        rows = steps(one, 500)
        near(ctx, "at the speed limit", rows[-1, 0], sign * 300.0, within=0.5)
        equal(ctx, "limited by speed", one.speed_limited, 1)
        ended: list[int] = []
        one.on_standstill = lambda e=ended: e.append(1)
        one.command_torque(sign * 1.0)
        steps(one, 1)
        one.mechanics.place(0.0)
        one.command_torque(sign * 1.0)
        steps(one, 2)
        one.stop_torque(100.0)
        equal(ctx, "stopping", one.stopping, 1)
        falls = steps(one, 41)[:, 1]
        due = sign * np.maximum(1.0 - np.arange(1, 42) * 100.0 * DT, 0.0)
        near(ctx, "falls with its slope", float(np.max(np.abs(falls - due))), 0.0, within=1e-9)
        steps(one, 5)
        equal(ctx, "said once that it ended", len(ended), 1)
        equal(ctx, "ended", one.stopping, 0)
        one.take_torque_offset(sign * 0.4)
        equal(ctx, "additive torque taken", one.torque_offset, sign * 0.4)


@CAMPAIGN.case("ramps", requirements=("C402-096", "C402-011"))
def ramps(ctx: CaseContext) -> None:
    """Away from zero with one slope, towards it with the other, through zero both; a stop from the actual
    speed ends when it has stood for its time, or when it has tried for too long.
    """
    for sign in (1, -1):
        one = core()
        one.enable_pulses()
        for target, slope in ((40.0, 2000.0), (15.0, 1000.0), (0.0, 1000.0)):
            begin = one.precontrol_velocity
            one.ramp(sign * target, 2000.0, deceleration=1000.0)
            due = abs(abs(begin) - target) / slope
            demand = steps(one, 200)[:, 2]
            took = (int(np.argmax(demand == sign * target)) + 1) * DT
            near(ctx, f"{sign * target}: time", took, due, within=1.01 * DT)
        one.ramp(sign * 20.0, 2000.0, deceleration=1000.0)
        steps(one, 80)
        one.ramp(-sign * 30.0, 2000.0, deceleration=1000.0)
        demand = steps(one, 300)[:, 2]
        took = (int(np.argmax(demand == -sign * 30.0)) + 1) * DT
        near(ctx, "through zero", took, 0.020 + 0.015, within=2.01 * DT)
        ended: list[float] = []
        one.on_standstill = lambda e=ended, o=one: e.append(o.velocity)
        begun = one.velocity
        one.stop(1500.0)
        equal(ctx, "stopping", one.stopping, 1)
        count = 0
        while one.stopping and count < 2000:
            one.step()
            count += 1
        due = abs(begun) / 1500.0 + 0.001
        near(ctx, "standstill after", count * DT, due, within=3.01 * DT)
        equal(ctx, "said once", len(ended), 1)
        equal(ctx, "it stands", one.standing, 1)
        # Driven from outside it never stands: the stop ends after its time-out.
        one = core(standstill_timeout_s=0.2)
        one.enable_pulses()
        one.set_torque_limits(0.1, 0.1)
        one.mechanics.apply_force(sign * 1.0)
        steps(one, 40)
        one.stop(math.inf)
        count = 0
        while one.stopping and count < 2000:
            one.step()
            count += 1
        near(ctx, "given up after", count * DT, 0.2, within=1.01 * DT)
        equal(ctx, "it does not stand", one.standing, 0)
    for rpm in (4.99, 5.01):
        one = core()
        one.enable_pulses()
        one.command_velocity(rpm * math.tau / 60.0, 1)
        steps(one, 200)
        equal(ctx, f"standing at {rpm} rpm", one.standing, rpm < 5)


@CAMPAIGN.case("from-each-to-each")
def from_each_to_each(ctx: CaseContext) -> None:
    """With the same speed, no command makes the speed jump that another one has reached."""
    at_speed: dict[str, Command] = {
        "velocity": lambda one, s: one.command_velocity(s * 30.0, 8),
        "servo": lambda one, s: one.command_servo(s * 30.0, one.position_ahead, 0.0, 1),
        "profile": lambda one, s: one.follow_profile().move(
            s * 1e6, velocity=30.0, acceleration=2000.0, deceleration=2000.0
        ),
        "ramp": lambda one, s: one.ramp(s * 30.0, 2000.0),
        "tracking": lambda one, s: one.ramp(s * 30.0, 2000.0, track_position=True),
        "torque": lambda one, s: one.command_torque(0.0),
    }
    for sign in (1, -1):
        for source, first in at_speed.items():
            for name, second in at_speed.items():
                one = core()
                one.enable_pulses()
                one.command_velocity(sign * 30.0, 40)
                steps(one, 60)
                first(one, sign)
                steps(one, 60)
                speed = one.velocity
                second(one, sign)
                rows = steps(one, 40)
                off = float(np.max(np.abs(rows[:, 0] - speed)))
                near(ctx, f"from {source} to {name}: change of the speed", off, 0.0, within=0.1)
                off = float(np.max(np.abs(rows[:, 1])))
                near(ctx, f"from {source} to {name}: torque", off, 0.0, within=0.1)
                if one.controls_position:
                    near(ctx, f"from {source} to {name}: error", one.following_error, 0.0, within=2e-3)


@CAMPAIGN.case("pulses", requirements=("STP-331", "STP-532"))
def pulses(ctx: CaseContext) -> None:
    """Without pulses there is no torque, with them a shaft that turns is taken on without a jerk; the brake
    opens and closes with them.
    """
    for sign in (1, -1):
        one = core(brake_nm=2.0)
        equal(ctx, "at first", _flags(one) == [0, 0, 0, 0, 0, 0, 1, 0, 0], 1)
        equal(ctx, "brake", one.brake.closed, 1)
        one.enable_pulses()
        steps(one, 39)
        equal(ctx, "brake in front of its time", one.brake.closed, 1)
        steps(one, 1)
        equal(ctx, "brake after its time", one.brake.closed, 0)
        one.command_velocity(sign * 25.0, 20)
        steps(one, 60)
        near(ctx, "turning", one.velocity, sign * 25.0, within=1e-6)
        one.inhibit_pulses()
        equal(ctx, "no torque", (one.torque, one.torque_demand) == (0.0, 0.0), 1)
        rows = steps(one, 20)
        near(ctx, "no torque later", float(np.max(np.abs(rows[:, 1]))), 0.0)
        near(ctx, "coasting", one.velocity, sign * 25.0, within=1e-6)
        near(ctx, "demand is where it is", one.position_demand, one.position)
        one.enable_pulses()
        near(ctx, "taken on", one.velocity_demand, sign * 25.0, within=1e-6)
        rows = steps(one, 20)
        near(ctx, "without a jerk", float(np.max(np.abs(rows[:, 1]))), 0.0, within=0.01)
        one.inhibit_pulses()
        steps(one, 79)
        near(ctx, "still turning", one.velocity, sign * 25.0, within=1e-6)
        steps(one, 30)
        equal(ctx, "held by the brake", (one.brake.closed, one.velocity) == (True, 0.0), 1)
        one.mechanics.place(sign * 3.0)
        one.reinitialise()
        near(ctx, "read again", one.position, one.encoder.sample(one.mechanics.motor_angle))
        equal(ctx, "nothing of before", (one.velocity, one.velocity_demand, one.torque) == (0.0, 0.0, 0.0), 1)


@CAMPAIGN.product(
    "encoder-jump/{counts}",
    parameters={"counts": (-131072, 131072, 700000)},
    title="the encoder jumps by {counts} increments",
)
def encoder_jump(ctx: CaseContext, counts: int) -> None:
    """A torque at its limit leaves it when the speed is on the other side of its demand: the integral part
    never holds it there.
    """
    one = core()
    one.enable_pulses()
    one.command_velocity(0.0, 1)
    steps(one, 40)
    one.encoder.jump(counts)
    speed, torque, *_ = steps(one, 2000).T
    limits = np.where(torque > 0.0, 6.0, -5.0)
    held = np.abs(torque) >= np.abs(limits) - 1e-9
    apart = held & (np.sign(speed) == np.sign(torque)) & (np.abs(speed) > 20.0)
    equal(ctx, "steps at the limit in the direction of a speed that is not demanded", int(apart.sum()), 0)
    near(ctx, "speed half a second later", float(speed[-1]), 0.0, within=1e-3)
