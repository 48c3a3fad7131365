"""The controller: from an instruction of the user program to the telegram of a drive, and back.

| package | what it is |
|---|---|
| `motion.s7` | an S7-1500 controller: technology objects, `MC_` instructions, alarms, CPU |
| `motion.kernel` | what every axis has whatever its make: ratios, actual values, setpoints, control |
| `motion.setpoint` | velocity and position profiles with limited jerk |
| `motion.drives` | ports to drives and encoders on every bus |

A dialect such as `motion.s7` imports the kernel, never another dialect. The names here are those that a
program needs to run axes without a bench; they are loaded when they are first used.
`docs/explanation/controller.md` has the parts and the way of a setpoint.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING

import fieldbus  # noqa: F401 - puts the compiled core in place, if there is one

if TYPE_CHECKING:
    from motion.drives.encoder import EncoderPort
    from motion.drives.port import DrivePort
    from motion.drives.simulated import SimulatedDrivePort
    from motion.kernel.servo_axis import ServoAxis
    from motion.s7.axis import ExternalEncoder, PositioningAxis, SpeedAxis, SynchronousAxis
    from motion.s7.handles import AxisHandle, EncoderHandle
    from motion.s7.runtime import Runtime
    from motion.setpoint import Setpoint, SetpointGenerator

__all__ = [
    "AxisHandle",
    "DrivePort",
    "EncoderHandle",
    "EncoderPort",
    "ExternalEncoder",
    "PositioningAxis",
    "Runtime",
    "ServoAxis",
    "Setpoint",
    "SetpointGenerator",
    "SimulatedDrivePort",
    "SpeedAxis",
    "SynchronousAxis",
]

_HOME = {
    "AxisHandle": "motion.s7.handles",
    "DrivePort": "motion.drives.port",
    "EncoderHandle": "motion.s7.handles",
    "EncoderPort": "motion.drives.encoder",
    "ExternalEncoder": "motion.s7.axis",
    "PositioningAxis": "motion.s7.axis",
    "Runtime": "motion.s7.runtime",
    "ServoAxis": "motion.kernel.servo_axis",
    "Setpoint": "motion.setpoint",
    "SetpointGenerator": "motion.setpoint",
    "SimulatedDrivePort": "motion.drives.simulated",
    "SpeedAxis": "motion.s7.axis",
    "SynchronousAxis": "motion.s7.axis",
}


def __getattr__(name: str) -> object:
    module = _HOME.get(name)
    if module is None:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(module), name)


def __dir__() -> list[str]:
    return __all__
