"""CiA 402 face of the emulated drive: `CiA402Drive` on a CAN segment."""

from __future__ import annotations

from emulators.drive.cia402._eds import EDS_PATH, drive_dictionary, eds_text
from emulators.drive.cia402.config import (
    COASTING_FAULTS,
    BrakeConfig,
    DriveConfig,
    EncoderConfig,
    LinearAxisConfig,
    RotaryAxisConfig,
    SwitchConfig,
)
from emulators.drive.cia402.drive import CiA402Drive
from emulators.drive.cia402.statemachine import Action, OptionCodes, PowerStateMachine, StopOption

__all__ = [
    "COASTING_FAULTS",
    "EDS_PATH",
    "Action",
    "BrakeConfig",
    "CiA402Drive",
    "DriveConfig",
    "EncoderConfig",
    "LinearAxisConfig",
    "OptionCodes",
    "PowerStateMachine",
    "RotaryAxisConfig",
    "StopOption",
    "SwitchConfig",
    "drive_dictionary",
    "eds_text",
]
