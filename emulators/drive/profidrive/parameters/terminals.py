"""Terminals of the emulated axis, its energy meter, and what else its registers show (PD-303 to PD-325)."""

from __future__ import annotations

import math
from typing import Final

from emulators.drive.core import ServoCore
from emulators.drive.inputs import DigitalInputs
from emulators.drive.power_stage import PowerStage
from emulators.drive.profidrive.config import DriveSettings
from emulators.drive.profidrive.parameters.store import ParameterStore
from emulators.drive.profidrive.torque import TorqueLimits
from fieldbus.errors import ConfigurationError

ANALOG_INPUTS: Final = 4
_DIGITAL_OUTPUTS: Final = (730, 731, 732, 733)
_J_PER_KWH: Final = 3.6e6
_LARGEST_PERCENT: Final = 300.0


class Terminals:
    """Digital and analog terminals; inputs beyond the switches of the machine are set by a test.

    Args:
        store: Parameters of the axis.
        settings: Parameters in effect; the torque limits among them stand above a current limit as set.
        core: Servo core.
        power: Heat and supply.
        torque: Torque limits.
        inputs: Digital inputs.
        rated_torque_Nm: Rated torque of the motor, Nm.

    """

    def __init__(
        self,
        store: ParameterStore,
        settings: DriveSettings,
        *,
        core: ServoCore,
        power: PowerStage,
        torque: TorqueLimits,
        inputs: DigitalInputs,
        rated_torque_Nm: float,
    ) -> None:
        self._analog = [0.0] * ANALOG_INPUTS

        def outputs(_: int) -> int:
            return sum(bool(store.value(number)) << bit for bit, number in enumerate(_DIGITAL_OUTPUTS))

        def energy(sub_index: int) -> float:
            both = (power.drawn_J - power.returned_J, power.drawn_J, power.returned_J)
            return both[sub_index] / _J_PER_KWH

        def voltage(_: int) -> float:
            share = abs(core.speed_rpm) / max(float(store.value(311)), 1e-9)
            return min(share * float(store.value(304)), power.dc_link.voltage_V / math.sqrt(2.0))

        rated = rated_torque_Nm

        def limit_current(_: int, value: float) -> None:
            torque.cap(current_Nm=value / max(float(store.value(305)), 1e-9) * rated)

        # As set, the current limit leaves the torque limits of the configuration alone.
        needed = max(settings.torque_limits_Nm) / rated * float(store.value(305))
        store.set(640, max(float(store.value(640)), 2.0 * needed))
        store.writers[640] = limit_current
        readers = store.readers
        readers[25] = voltage
        readers[39] = energy
        readers[722] = lambda _: inputs.value
        readers[747] = outputs
        readers[755] = lambda sub_index: self._analog[sub_index]
        readers[774] = lambda sub_index: store.value(791, sub_index)
        readers[2110] = lambda sub_index: store.value(2122, sub_index)
        readers[2250] = lambda _: store.value(2240)

    def set_analog_input(self, number: int, percent: float) -> None:
        """Let an analog input show a value (r0755), percent.

        Args:
            number: 0..3.
            percent: -300..300.

        Raises:
            ConfigurationError: There is no such input, or the value is out of range.

        """
        if not 0 <= number < ANALOG_INPUTS:
            raise ConfigurationError("analog input", number, f"0..{ANALOG_INPUTS - 1}")
        if not -_LARGEST_PERCENT <= percent <= _LARGEST_PERCENT:
            raise ConfigurationError("analog input, percent", percent, "-300..300")
        self._analog[number] = percent
