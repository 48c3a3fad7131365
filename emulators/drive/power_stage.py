"""Heat and supply of a drive as models, without any profile: overload, temperatures, DC link.

In every control cycle only two sums are kept. The models are advanced by their mean every few control cycles:
thermal time constants are seconds, that of the rectifier is some milliseconds and solved in closed form.
"""

from __future__ import annotations

from typing import Final

from emulators.drive.core import ServoCore
from emulators.drive.supply import DcLink
from emulators.drive.supply_config import SupplyConfig
from emulators.drive.thermal import ThermalModel, ThermalNode
from emulators.drive.thermal_config import ThermalConfig
from fieldbus.clock import S

CYCLES: Final = 8
"""Control cycles between two steps of the models."""


class PowerStage:
    """Models of motor heat, power stage heat and DC link.

    Args:
        core: Whose torque heats.
        supply: DC link and mains.
        thermal: Temperatures and overload.
        rated_torque_Nm: Torque that the motor can supply continuously, Nm.

    """

    def __init__(
        self,
        core: ServoCore,
        *,
        supply: SupplyConfig,
        thermal: ThermalConfig,
        rated_torque_Nm: float,
    ) -> None:
        self._core = core
        self._mechanics = core.mechanics
        self._rated = rated_torque_Nm
        self.thermal = thermal
        self._square = 0.0
        self._work = 0.0
        self._left = CYCLES
        self._since_ns = 0
        self.dt_s = 0.0
        """Length of the last step of the models, s."""
        self.dc_link = DcLink(supply)
        self.motor_overload = ThermalModel(
            rated_torque_Nm=rated_torque_Nm, time_constant_s=thermal.i2t_time_constant_s
        )
        self.stage_overload = ThermalModel(
            rated_torque_Nm=rated_torque_Nm * thermal.stage_overload,
            time_constant_s=thermal.stage_overload_time_s,
        )
        self.motor = ThermalNode(
            rise_K=thermal.motor_rise_k,
            time_constant_s=thermal.motor_time_constant_s,
            ambient_C=thermal.ambient_c,
            warning_C=thermal.motor_warning_c,
            fault_C=thermal.motor_fault_c,
        )
        self.stage = ThermalNode(
            rise_K=thermal.stage_rise_k,
            time_constant_s=thermal.stage_time_constant_s,
            ambient_C=thermal.ambient_c,
            warning_C=thermal.stage_warning_c,
            fault_C=thermal.stage_fault_c,
        )

        self.drawn_J = self.returned_J = 0.0
        """Energy that went into the motor and came back from it since the drive was made, J."""

    def restart(self, now_ns: int) -> None:
        """Start after power-on: i2t forgets, what is hot has cooled meanwhile, the DC link is charged if
        mains are there.
        """
        self._heat(0.0, (now_ns - self._since_ns) / S)
        self._since_ns = now_ns
        self.motor_overload.utilisation = self.stage_overload.utilisation = 0.0
        self._square = self._work = 0.0
        self._left = CYCLES
        self.dc_link.restart()

    def update(self) -> bool:
        """Note the torque of a control cycle; returns whether the models are due, every few cycles."""
        torque = self._core.torque
        if torque:
            self._square += torque * torque
            self._work += torque * self._mechanics.velocity
        self._left = left = self._left - 1
        return left == 0

    def advance(self, now_ns: int) -> None:
        """Advance the models by the cycles since the last time."""
        self.dt_s = dt_s = (now_ns - self._since_ns) / S
        self._since_ns = now_ns
        square = self._square / CYCLES
        work = self._work / CYCLES
        self._square = self._work = 0.0
        self._left = CYCLES
        self._heat(square, dt_s)
        link = self.dc_link
        if square or not link.settled:
            losses = self.thermal.motor_loss_w * square / (self._rated * self._rated)
            power = work / self._mechanics.ratio + losses
            if power > 0.0:
                self.drawn_J += power * dt_s
            else:
                self.returned_J -= power * dt_s
            link.update(power, dt_s)

    def _heat(self, square: float, dt_s: float) -> None:
        load = square / (self._rated * self._rated)
        self.motor_overload.advance(square, dt_s)
        self.stage_overload.advance(square, dt_s)
        self.motor.advance(load, dt_s)
        self.stage.advance(load, dt_s)
