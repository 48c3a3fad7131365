"""An axis: motor, gear, lead screw and load as one inertia, with friction, end
stops, load force and switches.

The model is one degree of freedom in the coordinate of the load (m or rad,
called *load unit* below). Per step:

* The linear part (inertia, viscous friction, a constant force) is advanced by the trapezoidal rule, which
  is stable for every step and exact for a constant force without viscous friction.
* Coulomb friction is a bound on the momentum that friction can take away in one step: where it suffices to
  stop the load, the load stands exactly still. There is no threshold speed, hence neither creep nor chatter.
* The end stops are stiff springs with dampers; in contact the step is implicit
  Euler, stable at any stiffness.

With backlash, or a broken coupling, motor and load are two bodies: `_step_parted`. Within the play each moves
by itself; where its end is reached they collide without bouncing, and continue as one body for as long as
they press against each other. A broken coupling is a play without end.

The common case costs one comparison against the *quiet range*: the interval of positions in which no switch
changes and no end stop is touched.
"""

from __future__ import annotations

import math
from collections.abc import Iterable

from emulators.mechanics._checks import checked, checked_share
from emulators.mechanics._switch import SwitchModel
from fieldbus.errors import ConfigurationError

MotionFactors = tuple[float, float, float, float, float, float, float, float]
"""What a step calculates with while it touches neither a switch nor an end stop: force per torque, constant
force, force up to which a standing load stands, decay of the speed in a step, speed per force, speed that
friction takes in a step, half of the duration of a step, angle of the shaft per position.
"""


class AxisMechanics:
    """Inertia behind a transmission, in the coordinate of the load: in one piece, or in two with backlash
    between them.

    Use `LinearAxisMechanics` or `RotaryAxisMechanics`.

    Args:
        ratio: Load units per radian of the motor shaft, not 0; negative: the load goes backwards while the
            shaft turns forwards.
        inertia: Inertia of everything, reflected to the load: kg, or kg m^2 for a rotary load; > 0.
        viscous_friction: N per m/s or Nm per rad/s, >= 0.
        coulomb_friction: Sliding friction, N or Nm, >= 0.
        static_friction: Breakaway force at standstill, N or Nm, >= `coulomb_friction`; default: the same.
        gravity_force: Constant force on the load in positive direction, N or Nm.
        lower_stop: Position of the lower end stop, load unit; None: there is none.
        upper_stop: Position of the upper end stop, load unit; None: there is none.
        stop_stiffness: Spring of an end stop, N/m or Nm/rad, > 0.
        stop_damping: Damper of an end stop, Ns/m or Nms/rad, >= 0.
        position: Start position of the load, load unit.
        switches: Switches on the travel.
        backlash: Play between motor and load from one side to the other, load unit, >= 0.
        motor_share: Share of the inertia that is on the motor's side of the play, above 0, below 1.

    Raises:
        ConfigurationError: A value is outside its range.

    """

    __slots__ = (
        "_angle_per_unit",
        "_brake",
        "_breakaway",
        "_coulomb",
        "_decay",
        "_dt",
        "_external",
        "_extra_friction",
        "_force_per_torque",
        "_free_speed",
        "_friction_step",
        "_gain",
        "_gap",
        "_gravity",
        "_half_dt",
        "_high",
        "_inertia",
        "_jammed",
        "_load_force",
        "_low",
        "_lower_stop",
        "_motor_share",
        "_own_play",
        "_parted",
        "_play",
        "_static",
        "_stop_damping",
        "_stop_stiffness",
        "_upper_stop",
        "_viscous",
        "_wear",
        "_worn_play",
        "calm_high",
        "calm_low",
        "calm_speed",
        "factors",
        "in_contact",
        "motor_angle",
        "position",
        "ratio",
        "step_start",
        "switches",
        "velocity",
    )

    def __init__(
        self,
        *,
        ratio: float,
        inertia: float,
        viscous_friction: float = 0.0,
        coulomb_friction: float = 0.0,
        static_friction: float | None = None,
        gravity_force: float = 0.0,
        lower_stop: float | None = None,
        upper_stop: float | None = None,
        stop_stiffness: float = 1e7,
        stop_damping: float = 2e4,
        position: float = 0.0,
        switches: Iterable[SwitchModel] = (),
        backlash: float = 0.0,
        motor_share: float = 0.5,
    ) -> None:
        if ratio == 0.0:
            raise ConfigurationError("ratio", ratio, "a finite number, not 0")
        self.ratio = checked("ratio", ratio)
        self._inertia = checked("inertia", inertia, positive=True)
        self._viscous = checked("viscous_friction", viscous_friction, minimum=0.0)
        self._coulomb = checked("coulomb_friction", coulomb_friction, minimum=0.0)
        if static_friction is None:
            static_friction = coulomb_friction
        self._static = checked("static_friction", static_friction, minimum=self._coulomb)
        self._gravity = checked("gravity_force", gravity_force)
        self._stop_stiffness = checked("stop_stiffness", stop_stiffness, positive=True)
        self._stop_damping = checked("stop_damping", stop_damping, minimum=0.0)
        self._lower_stop = -math.inf
        self._upper_stop = math.inf
        self._angle_per_unit = 1.0 / self.ratio
        self._force_per_torque = 1.0 / self.ratio
        self.position = checked("position", position)
        """Position of the load, m or rad."""
        self.velocity = 0.0
        """Velocity of the load, m/s or rad/s."""
        self.motor_angle = self.position * self._angle_per_unit
        """Angle of the motor shaft, rad; zero where the load is at zero."""
        self.in_contact = False
        """Whether the load presses against an end stop."""
        self.step_start = self.position
        """While a switch reports an edge: where the step of the load began, m or rad."""
        self.switches: tuple[SwitchModel, ...] = tuple(switches)
        self._external = 0.0
        self._brake = 0.0
        self._jammed = False
        self._extra_friction = 0.0
        self._motor_share = checked_share(motor_share)
        self._free_speed = 0.0
        # Half of the play, how far it is to become, and how fast; where the motor is in it, seen from the
        # load.
        self._play = self._worn_play = self._own_play = 0.5 * checked("backlash", backlash, minimum=0.0)
        self._wear = self._gap = 0.0
        self._parted = self._play > 0.0
        self._dt = 0.0
        self._half_dt = self._decay = self._gain = self._friction_step = 0.0
        self._breakaway = self._load_force = 0.0
        self._low = self._high = 0.0
        self.calm_low = self.calm_high = self.calm_speed = 0.0
        """Range of the load, load unit, and its largest speed, for which `find_calm` was true."""
        self.factors: MotionFactors = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
        self._refresh_forces()
        self.set_stops(lower_stop, upper_stop)

    # -- state ---------------------------------------------------------------------------------------------

    @property
    def motor_speed(self) -> float:
        """Speed of the motor shaft, rad/s."""
        return self._free_speed if self._parted else self.velocity * self._angle_per_unit

    @property
    def motor_inertia(self) -> float:
        """Inertia of everything, reflected to the motor shaft, kg m^2."""
        return self._inertia * self.ratio * self.ratio

    @property
    def jammed(self) -> bool:
        """Whether the shaft is blocked."""
        return self._jammed

    @property
    def backlash(self) -> float:
        """Present play between motor and load, load unit; inf where the coupling is broken."""
        return 2.0 * self._play

    @property
    def external_force(self) -> float:
        """Force from outside on the load, N or Nm, positive in positive direction."""
        return self._external

    @property
    def stops(self) -> tuple[float | None, float | None]:
        """Positions of the lower and the upper end stop, load unit; None where there is none."""
        low, high = self._lower_stop, self._upper_stop
        return (None if math.isinf(low) else low), (None if math.isinf(high) else high)

    # -- what happens to the machine -----------------------------------------------------------------------

    def apply_force(self, force: float) -> None:
        """Set the force from outside on the load (a load step), N or Nm, positive in positive direction."""
        self._external = checked("force", force)
        self._refresh_forces()

    def set_brake_torque(self, torque_Nm: float) -> None:
        """Set the holding torque of a brake on the motor shaft, Nm, >= 0; it acts like dry friction."""
        self._brake = checked("torque_Nm", torque_Nm, minimum=0.0) * abs(self._force_per_torque)
        self._refresh_forces()

    def set_added_friction(self, force: float) -> None:
        """Add dry friction to that of the load, N or Nm, >= 0: bearings or ways
        that have gone bad; 0 = as new.
        """
        self._extra_friction = checked("force", force, minimum=0.0)
        self._refresh_forces()

    def set_stops(self, lower: float | None, upper: float | None) -> None:
        """Place or remove (None) the end stops, load unit; also while the axis runs (STP-536)."""
        low = -math.inf if lower is None else checked("lower_stop", lower)
        high = math.inf if upper is None else checked("upper_stop", upper)
        if not low < high:
            raise ConfigurationError("end stops", (lower, upper), "lower < upper")
        self._lower_stop = low
        self._upper_stop = high
        self._settle()

    def jam(self, jammed: bool) -> None:
        """Block the shaft at the present position, or release it."""
        self._jammed = jammed
        if jammed:
            self.velocity = 0.0
            if self._play == 0.0:
                self._free_speed = 0.0
        self._settle()

    def place(self, position: float) -> None:
        """Put the load at rest at `position` (load unit), as before the start of a test."""
        self.position = checked("position", position)
        self.motor_angle = self.position * self._angle_per_unit
        self.velocity = self._free_speed = self._gap = 0.0
        self._settle()

    # -- coupling -----------------------------------------------------------------------------------------

    def slip(self, distance: float) -> bool:
        """Displace the load by `distance` (m or rad) while the motor shaft turns on.

        Returns:
            Whether the angle of the shaft has moved with it, by `distance / ratio`, which who measures it has
            to take back; False where motor and load are apart already.

        """
        self.position += checked("distance", distance)
        broken = math.isinf(self._play)
        if broken:
            self._gap -= distance
        else:
            self.motor_angle = (self.position + self._gap) * self._angle_per_unit
        self._settle()
        return not broken

    def break_coupling(self, motor_share: float) -> None:
        """Part motor and load for good: the motor turns alone, the load coasts; a brake on the motor holds
        the motor only.

        Args:
            motor_share: Share of the whole inertia that is on the side of the motor, above 0, below 1.

        Raises:
            ConfigurationError: The share is not between 0 and 1.

        """
        share = checked_share(motor_share)
        if math.isinf(self._play):
            return
        self._motor_share = share
        self._part(math.inf)

    def set_added_backlash(self, backlash: float, growth_s: float = 0.0) -> None:
        """Let the play between motor and load grow by `backlash` (load unit)
        within a time; 0 = as it was built.

        A repaired coupling draws the load to where the motor is.

        Raises:
            ConfigurationError: A value is negative.

        """
        worn = self._own_play + 0.5 * checked("backlash", backlash, minimum=0.0)
        time_s = checked("growth_s", growth_s, minimum=0.0)
        if math.isinf(self._play):
            return
        self._worn_play = worn
        if time_s > 0.0 and worn > self._play:
            self._wear = (worn - self._play) / time_s
            self._part(self._play)
        else:
            self._wear = 0.0
            self._part(worn)

    def _part(self, play: float) -> None:
        """Let motor and load have this play, half of the way from one side to the other, from now on."""
        if not self._parted:
            self._free_speed = self.velocity * self._angle_per_unit
        self._play = play
        inside = min(max(self._gap, -play), play)
        self.position += self._gap - inside
        self._gap = inside
        self._parted = play > 0.0 or self._wear > 0.0
        if not self._parted:
            self.velocity = self._free_speed * self.ratio
        self._refresh_forces()
        self._settle()

    # -- integration -----------------------------------------------------------------------------------------

    def step(self, torque_Nm: float, dt_s: float) -> float:
        """Advance by `dt_s` under a constant motor torque, and return the motor angle, rad.

        Args:
            torque_Nm: Air-gap torque of the motor, Nm.
            dt_s: Duration, s, > 0; cheap as long as it is the same as in the last step.

        """
        if dt_s != self._dt:
            self._prepare(dt_s)
        velocity = self.velocity
        force = torque_Nm * self._force_per_torque + self._load_force
        if velocity == 0.0 and -self._breakaway <= force <= self._breakaway:
            return self.motor_angle
        new = velocity * self._decay + force * self._gain
        friction = self._friction_step
        if new > friction:
            new -= friction
        elif new < -friction:
            new += friction
        else:
            new = 0.0
        position = self.position + (velocity + new) * self._half_dt
        if self._low < position < self._high:
            self.velocity = new
            self.position = position
            self.motor_angle = angle = position * self._angle_per_unit
            return angle
        self._step_special(force, new, position)
        return self.motor_angle

    def find_calm(self, steps: int, dt_s: float, torque_Nm: float) -> bool:
        """Find the range in which so many steps certainly touch no switch and no end stop, whatever torque of
        at most `torque_Nm` either way drives the motor; return whether the load is within it now.
        """
        if dt_s != self._dt:
            return False
        force = torque_Nm * abs(self._force_per_torque) + abs(self._load_force)
        self.calm_speed = 1.5 * abs(self.velocity) + force * self._gain
        # Friction only takes from the speed, so that this one cannot be reached.
        reach = steps * dt_s * (self.calm_speed + steps * force * self._gain)
        if not reach < math.inf:
            return False
        self.calm_low, self.calm_high = self._low + reach, self._high - reach
        return self.calm_low < self.position < self.calm_high

    def take_motion(self, position: float, velocity: float, motor_angle: float) -> None:
        """Let the load be where steps within the calm range have brought it, calculated with `factors`."""
        self.position = position
        self.velocity = velocity
        self.motor_angle = motor_angle

    def _step_special(self, force: float, free_velocity: float, free_position: float) -> None:
        """Finish a step that ends outside the quiet range: play, jam, end stop or switch edge."""
        if self._parted:
            self._step_parted(force)
            return
        if self._jammed:
            self.velocity = 0.0
            return
        position = free_position
        velocity = free_velocity
        if position > self._upper_stop or position < self._lower_stop:
            position, velocity = self._contact(force, free_velocity, free_position)
        self.step_start = self.position
        self.velocity = velocity
        self.position = position
        self.motor_angle = position * self._angle_per_unit
        self._settle(moving=True)

    def _step_parted(self, force: float) -> None:
        """Advance motor and load each for itself, or as one where the play ends."""
        dt, share, unit = self._dt, self._motor_share, self._angle_per_unit
        play = self._play
        if self._wear:
            play = self._play = min(play + self._wear * dt, self._worn_play)
            if play == self._worn_play:
                self._wear = 0.0
        # Of `gain` (time over inertia, at the load) each side has its own part of the inertia.
        motor_gain, load_gain = self._gain / share, self._gain / (1.0 - share)
        start, motor, load = self.position, self._free_speed / unit, self.velocity
        motor_new = _towards_rest(motor + (force - self._load_force) * motor_gain, self._brake * motor_gain)
        dry, holding = self._coulomb + self._extra_friction, self._static + self._extra_friction
        resting = load == 0.0 and abs(self._load_force) <= holding
        load_new = 0.0
        if not (self._jammed or resting):
            load_new = _towards_rest(load * self._decay + self._load_force * load_gain, dry * load_gain)
        way, load_way = 0.5 * (motor + motor_new) * dt, 0.5 * (load + load_new) * dt
        gap = self._gap + way - load_way
        if -play <= gap <= play:
            position = start + load_way
            if (position > self._upper_stop or position < self._lower_stop) and not self._jammed:
                position, load_new = self._contact(self._load_force, load_new, position)
                gap = min(max(gap + start + load_way - position, -play), play)
        else:
            # They collide within this step, or press against each other already: from then on they move as
            # one.
            end = math.copysign(play, gap)
            alone = min(max((end - self._gap) / (way - load_way), 0.0), 1.0)
            velocity = share * (motor + alone * (motor_new - motor)) + (1.0 - share) * (
                load + alone * (load_new - load)
            )
            position, load_new = self._step_together(force, velocity, start + alone * load_way, 1.0 - alone)
            gap, motor_new = end, load_new
        self._gap = gap
        self._free_speed = motor_new * unit
        self.motor_angle = (position + gap) * unit
        if position == start and load_new == 0.0 == load:
            return
        self.step_start = start
        self.velocity = load_new
        self.position = position
        self._settle(moving=True)

    def _step_together(
        self, force: float, velocity: float, position: float, share: float
    ) -> tuple[float, float]:
        """Return position and velocity of the load after a share of a step in
        which motor and load are one body.
        """
        holding = self._static + self._brake + self._extra_friction
        if self._jammed or (velocity == 0.0 and abs(force) <= holding and not self.in_contact):
            return position, 0.0
        new = _towards_rest(velocity * self._decay + force * self._gain, self._friction_step)
        new = velocity + (new - velocity) * share
        there = position + 0.5 * (velocity + new) * self._dt * share
        if there > self._upper_stop or there < self._lower_stop:
            self.velocity = velocity
            return self._contact(force, new, there)
        return there, new

    def _contact(self, force: float, free_velocity: float, free_position: float) -> tuple[float, float]:
        """Return position and velocity after an implicit Euler step against the spring-damper of a stop."""
        dt = self._dt
        gain = self._gain
        stiffness = self._stop_stiffness
        damping = self._stop_damping
        stop = self._upper_stop if free_position > self._upper_stop else self._lower_stop
        start = self.position
        velocity = self.velocity * self._decay + (force - stiffness * (start - stop)) * gain
        friction = self._friction_step
        if velocity > friction:
            velocity -= friction
        elif velocity < -friction:
            velocity += friction
        else:
            velocity = 0.0
        velocity /= 1.0 + gain * (stiffness * dt + damping)
        position = start + velocity * dt
        reaction = stiffness * (position - stop) + damping * velocity
        pressing = reaction > 0.0 if stop == self._upper_stop else reaction < 0.0
        if pressing:
            return position, velocity
        return free_position, free_velocity

    def _prepare(self, dt_s: float) -> None:
        checked("dt_s", dt_s, positive=True)
        self._dt = dt_s
        self._half_dt = 0.5 * dt_s
        damping = self._viscous * dt_s / self._inertia
        if damping < 1.0:
            self._decay = (1.0 - 0.5 * damping) / (1.0 + 0.5 * damping)
            self._gain = dt_s / self._inertia / (1.0 + 0.5 * damping)
        else:
            self._decay = 1.0 / (1.0 + damping)
            self._gain = dt_s / self._inertia / (1.0 + damping)
        self._refresh_forces()

    def _refresh_forces(self) -> None:
        self._load_force = self._gravity + self._external
        extra = self._extra_friction
        self._friction_step = (self._coulomb + self._brake + extra) * self._gain
        special = self.in_contact or self._parted
        self._breakaway = -1.0 if special else self._static + self._brake + extra
        self.calm_low = self.calm_high = 0.0
        self.factors = (
            self._force_per_torque,
            self._load_force,
            self._breakaway,
            self._decay,
            self._gain,
            self._friction_step,
            self._half_dt,
            self._angle_per_unit,
        )

    def _settle(self, *, moving: bool = False) -> None:
        """Evaluate switches and contact at the present position and find the new quiet range."""
        position = self.position
        low = self._lower_stop
        high = self._upper_stop
        for switch in self.switches:
            switch.update(position, moving=moving)
            quiet_low, quiet_high = switch.quiet_range(position)
            low = max(low, quiet_low)
            high = min(high, quiet_high)
        contact = position > self._upper_stop or position < self._lower_stop
        if contact or self._jammed or self._parted:
            low, high = math.inf, -math.inf
        self._low = low
        self._high = high
        self.calm_low = self.calm_high = 0.0
        if contact is not self.in_contact:
            self.in_contact = contact
            self._refresh_forces()


def _towards_rest(speed: float, step: float) -> float:
    """Return a speed that dry friction has taken a step towards zero, and not beyond."""
    if speed > step:
        return speed - step
    return speed + step if speed < -step else 0.0
