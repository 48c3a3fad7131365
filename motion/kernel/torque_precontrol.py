"""Torque pre-control: the torque that the acceleration setpoint needs, sent ahead of it (CTL-050).

`M = scale * (J_motor + J_load / i²) * alpha_motor`, of a linear motor `F = scale * (m_motor + m_load) * a`.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from motion.kernel.cell import Cell


class TorquePrecontrol:
    """Torque for the acceleration setpoint.

    Inertias and scale may change while the axis moves (CFG-575 to CFG-577).

    Args:
        scale: Share of the calculated torque that is sent, percent.
        motor: Moment of inertia of the motor, kg m²; of a linear motor its mass, kg.
        load: The same of the load.
        per_motor: Torque, Nm (force, N), per unit of `motor` and position unit/s².
        per_load: The same per unit of `load`.

    """

    def __init__(
        self,
        *,
        scale: Cell[float],
        motor: Cell[float],
        load: Cell[float],
        per_motor: float,
        per_load: float,
    ) -> None:
        self._scale = scale
        self._motor = motor
        self._load = load
        self._per_motor = per_motor
        self._per_load = per_load

    def torque(self, acceleration: float) -> float:
        """Return the torque, Nm, of a linear motor the force, N, for an
        acceleration setpoint, position unit/s².
        """
        inertia = self._motor.value * self._per_motor + self._load.value * self._per_load
        return self._scale.value * 0.01 * inertia * acceleration
