"""The PROFIdrive face of an emulated drive. `ProfidriveDrive` knows no bus; a
transport carries its telegrams.
"""

from __future__ import annotations

from emulators.drive.profidrive.canopen.config import ProfidriveNodeConfig
from emulators.drive.profidrive.canopen.drive import ProfidriveCanDrive
from emulators.drive.profidrive.canopen.eds import EDS, EDS_PATH
from emulators.drive.profidrive.canopen.sdo_parameters import ParameterWindow
from emulators.drive.profidrive.config import AXIS_TELEGRAMS, DriveSettings, ProfidriveConfig
from emulators.drive.profidrive.drive import ProfidriveDrive
from emulators.drive.profidrive.faults.buffer import FaultBuffer, FaultMessage
from emulators.drive.profidrive.faults.catalogue import CATALOGUE, DriveWarning, Fault
from emulators.drive.profidrive.parameters.access import ChannelError, ParameterChannel, ParameterRecord
from emulators.drive.profidrive.parameters.definitions import ParameterDefinition, WriteRule, load_definitions
from emulators.drive.profidrive.parameters.drive_parameters import DriveParameters
from emulators.drive.profidrive.parameters.profile import Identification, ParameterMemory
from emulators.drive.profidrive.parameters.server import ParameterServer
from emulators.drive.profidrive.parameters.store import ParameterStore
from emulators.drive.profidrive.statemachine import Action, AxisState, GeneralStateMachine, Off

__all__ = [
    "AXIS_TELEGRAMS",
    "CATALOGUE",
    "EDS",
    "EDS_PATH",
    "Action",
    "AxisState",
    "ChannelError",
    "DriveParameters",
    "DriveSettings",
    "DriveWarning",
    "Fault",
    "FaultBuffer",
    "FaultMessage",
    "GeneralStateMachine",
    "Identification",
    "Off",
    "ParameterChannel",
    "ParameterDefinition",
    "ParameterMemory",
    "ParameterRecord",
    "ParameterServer",
    "ParameterStore",
    "ParameterWindow",
    "ProfidriveCanDrive",
    "ProfidriveConfig",
    "ProfidriveDrive",
    "ProfidriveNodeConfig",
    "WriteRule",
    "load_definitions",
]
