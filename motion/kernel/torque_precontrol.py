"""Torque pre-control: the torque that the acceleration setpoint needs, sent ahead of it with telegram 750
(CFG section 27, CTL-050).

`M = Scale * (J_motor + J_load / i²) * alpha_motor`, of a linear motor `F = Scale * (m_motor + m_load) * a`.
"""

from __future__ import annotations

from math import tau
from typing import TYPE_CHECKING

from motion.s7.units import ANGLES, LENGTHS

if TYPE_CHECKING:
    from motion.s7.variables import VariableStore


class TorquePrecontrol:
    """See the module. Inertias and scale may change while the axis moves (CFG-575 to CFG-577).

    Args:
        store: Variables of a positioning axis.

    """

    __slots__ = ("_load", "_motor", "_per_load", "_per_motor", "_scale")

    def __init__(self, store: VariableStore) -> None:
        read, bind = store.read, store.bind
        self._scale = bind("TorquePreControl.Scale")
        self._load = bind("Actor.LoadInertia")
        unit = read("Units.LengthUnit")
        if read("Actor.MotorType") == 1:
            self._motor = bind("Actor.LinearMotorDriveParameter.MotorMass")
            self._per_motor = self._per_load = LENGTHS[unit]
            return
        self._motor = bind("Actor.DriveParameter.MotorInertia")
        gear = read("LoadGear.Numerator") / read("LoadGear.Denominator")
        if read("Properties.MotionType") == 1:
            load_rad, load = ANGLES[unit], 1.0
        else:
            load_rad = tau / read("Mechanics.LeadScrew")
            load = (read("Mechanics.LeadScrew") * LENGTHS[unit] / tau) ** 2
        self._per_motor = load_rad * gear
        self._per_load = load_rad / gear * load

    def torque(self, acceleration: float) -> float:
        """Return the torque, Nm, of a linear motor the force, N, for an acceleration setpoint, position
        unit/s².
        """
        inertia = self._motor.value * self._per_motor + self._load.value * self._per_load
        return float(self._scale.value * 0.01 * inertia * acceleration)
