"""Plant models in SI units: what hangs on the motor shaft, and the switches along the travel."""

from __future__ import annotations

from emulators.mechanics._axis import AxisMechanics
from emulators.mechanics._crossing import passing_time, position_within
from emulators.mechanics._machines import LinearAxisMechanics, RotaryAxisMechanics
from emulators.mechanics._shaft import DrivenShaft
from emulators.mechanics._switch import SwitchModel

__all__ = [
    "AxisMechanics",
    "DrivenShaft",
    "LinearAxisMechanics",
    "RotaryAxisMechanics",
    "SwitchModel",
    "passing_time",
    "position_within",
]
