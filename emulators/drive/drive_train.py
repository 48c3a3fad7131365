"""The one place where motor, encoder, brake, machine and servo core of a drive are put together."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from emulators.drive.core import ServoCore
from emulators.drive.inputs import DigitalInputs
from emulators.drive.machine import (
    BrakeConfig,
    EncoderConfig,
    LinearAxisConfig,
    RotaryAxisConfig,
    SwitchesConfig,
    build_machine,
)
from emulators.drive.power_stage import PowerStage
from emulators.drive.supply_config import SupplyConfig
from emulators.drive.thermal_config import ThermalConfig
from emulators.drive.tuning import ServoTuning
from emulators.encoder import RotaryEncoder
from emulators.mechanics import AxisMechanics, SwitchModel
from fieldbus.clock import Scheduler

if TYPE_CHECKING:
    import numpy as np


@dataclass(frozen=True, kw_only=True)
class DriveTrain:
    """Machine, motor with encoder and brake, and the servo core that controls them.

    Args:
        core: Servo core; it has the brake.
        mechanics: Machine.
        encoder: Motor encoder.
        switches: Switches on the travel, by input name.
        digital_inputs: Inputs that the switches are wired to.
        load_unit: Unit of the load position: m or rad.

    """

    core: ServoCore
    mechanics: AxisMechanics
    encoder: RotaryEncoder
    switches: dict[str, SwitchModel]
    digital_inputs: DigitalInputs
    load_unit: str

    def build_power_stage(
        self,
        *,
        supply: SupplyConfig,
        thermal: ThermalConfig,
        rated_torque_Nm: float,
    ) -> PowerStage:
        """Return the power stage that feeds the motor: DC link, temperatures and overload.

        Args:
            supply: DC link and mains.
            thermal: Temperatures and overload.
            rated_torque_Nm: Continuous torque of the motor, Nm.

        """
        return PowerStage(
            self.core,
            supply=supply,
            thermal=thermal,
            rated_torque_Nm=rated_torque_Nm,
        )


def build_drive_train(
    scheduler: Scheduler,
    *,
    mechanics: LinearAxisConfig | RotaryAxisConfig,
    switches: SwitchesConfig,
    encoder: EncoderConfig,
    brake: BrakeConfig,
    tuning: ServoTuning,
    servo_period_ns: int,
    rng: np.random.Generator | None = None,
) -> DriveTrain:
    """Build a drive train; its servo core runs on the scheduler from now on.

    Args:
        scheduler: Clock of the drive.
        mechanics: Machine.
        switches: Switches on the travel of a linear axis.
        encoder: Motor encoder.
        brake: Holding brake of the motor.
        tuning: Gains of the control loops.
        servo_period_ns: Control period, ns.
        rng: Source of the encoder noise; None: the encoder cannot be made noisy.

    Raises:
        ConfigurationError: The servo period is too long for the gains.

    """
    plant, fitted = build_machine(mechanics, switches)
    model = encoder.build(rng)
    core = ServoCore(
        mechanics=plant,
        encoder=model,
        period_s=servo_period_ns / 1e9,
        tuning=tuning,
        brake=brake.build(plant),
    )
    scheduler.every_step(servo_period_ns, core)
    return DriveTrain(
        core=core,
        mechanics=plant,
        encoder=model,
        switches=fitted,
        digital_inputs=DigitalInputs(scheduler, fitted, filter_s=switches.filter_s),
        load_unit="m" if isinstance(mechanics, LinearAxisConfig) else "rad",
    )
