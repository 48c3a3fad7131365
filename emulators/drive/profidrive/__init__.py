"""The PROFIdrive face of an emulated drive. `ProfidriveDrive` knows no bus; a transport carries its telegrams."""

from __future__ import annotations

from emulators.drive.profidrive.config import AXIS_TELEGRAMS, DriveSettings, ProfidriveConfig
from emulators.drive.profidrive.device import ProfidriveDrive
from emulators.drive.profidrive.encoder_words import EncoderInterface
from emulators.drive.profidrive.fault_catalogue import CATALOGUE, DriveWarning, Fault
from emulators.drive.profidrive.messages import FaultBuffer, FaultMessage
from emulators.drive.profidrive.statemachine import Action, AxisState, GeneralStateMachine, Off

__all__ = [
    "AXIS_TELEGRAMS",
    "CATALOGUE",
    "Action",
    "AxisState",
    "DriveSettings",
    "DriveWarning",
    "EncoderInterface",
    "Fault",
    "FaultBuffer",
    "FaultMessage",
    "GeneralStateMachine",
    "Off",
    "ProfidriveConfig",
    "ProfidriveDrive",
]
