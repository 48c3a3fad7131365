"""Motor and load as two bodies: play between them, a coupling that slips or breaks.

Within the play each moves by itself; where its end is reached they collide without bouncing, and go on as one
body for as long as they press against each other. A broken coupling is a play without end.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from fieldbus.errors import ConfigurationError


def checked(where: str, value: float, *, minimum: float | None = None, positive: bool = False) -> float:
    """Return a finite number in its range, or raise ConfigurationError."""
    if not math.isfinite(value) or (positive and value <= 0.0) or (minimum is not None and value < minimum):
        allowed = (
            "a finite number > 0"
            if positive
            else "a finite number" + (f" >= {minimum:g}" if minimum is not None else "")
        )
        raise ConfigurationError(where, value, allowed)
    return float(value)


class PartedBodies:
    """What happens between motor and load of an `AxisMechanics`, which has the attributes named here."""

    __slots__ = (
        "_free_speed",
        "_gap",
        "_motor_share",
        "_own_play",
        "_parted",
        "_play",
        "_wear",
        "_worn_play",
        "motor_angle",
        "position",
        "step_start",
        "velocity",
    )

    _free_speed: float
    _gap: float
    _motor_share: float
    _own_play: float
    _parted: bool
    _play: float
    _wear: float
    _worn_play: float
    motor_angle: float
    position: float
    step_start: float
    velocity: float

    if TYPE_CHECKING:
        in_contact: bool
        ratio: float
        _angle_per_unit: float
        _brake: float
        _coulomb: float
        _decay: float
        _dt: float
        _extra_friction: float
        _friction_step: float
        _gain: float
        _jammed: bool
        _load_force: float
        _lower_stop: float
        _static: float
        _upper_stop: float

        def _settle(self, *, moving: bool = False) -> None:
            """Evaluate switches and contact."""

        def _refresh_forces(self) -> None:
            """Calculate what depends on the forces."""

        def _contact(self, force: float, free_velocity: float, free_position: float) -> tuple[float, float]:
            """Return position and velocity after a step against a stop."""

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

    def wear_out(self, backlash: float, growth_s: float = 0.0) -> None:
        """Let the play between motor and load grow by `backlash` (load unit) within a time; 0 = as it was
        built.

        What is mended draws the load to where the motor is.

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
        """Return position and velocity of the load after a share of a step in which motor and load are one
        body.
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


def checked_share(value: float) -> float:
    """Return a share of the inertia that leaves something on both sides."""
    share = checked("motor_share", value, positive=True)
    if share >= 1.0:
        raise ConfigurationError("motor_share", value, "above 0, below 1")
    return share


def _towards_rest(speed: float, step: float) -> float:
    """Return a speed that dry friction has taken a step towards zero, and not beyond."""
    if speed > step:
        return speed - step
    return speed + step if speed < -step else 0.0
