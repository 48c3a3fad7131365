"""Technology module TM PTO 2x24V: pulse-train outputs that a controller sees as drives with an encoder; knows
no bus.
"""

from __future__ import annotations

from emulators.io.tm_pto.channel import PtoChannel
from emulators.io.tm_pto.config import PtoConfig
from emulators.io.tm_pto.module import PtoModule
from emulators.io.tm_pto.pulses import PulseGenerator
from emulators.io.tm_pto.stepper import StepperConfig, StepperMotor

__all__ = [
    "PtoChannel",
    "PtoConfig",
    "PtoModule",
    "PulseGenerator",
    "StepperConfig",
    "StepperMotor",
]
