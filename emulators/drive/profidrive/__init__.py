"""The PROFIdrive face of an emulated drive. `ProfidriveDrive` knows no bus; a transport carries its
telegrams.
"""

from __future__ import annotations

from emulators.drive.profidrive._eds import EDS_PATH, eds_text, profidrive_dictionary
from emulators.drive.profidrive.can import ProfidriveCanDrive, ProfidriveNodeConfig
from emulators.drive.profidrive.config import AXIS_TELEGRAMS, DriveSettings, ProfidriveConfig
from emulators.drive.profidrive.definitions import ParameterDefinition, WriteRule, load_definitions
from emulators.drive.profidrive.device import ProfidriveDrive
from emulators.drive.profidrive.drive_parameters import DriveParameters
from emulators.drive.profidrive.fault_catalogue import CATALOGUE, DriveWarning, Fault
from emulators.drive.profidrive.messages import FaultBuffer, FaultMessage
from emulators.drive.profidrive.parameter_channel import ChannelError, ParameterChannel
from emulators.drive.profidrive.parameter_record import ParameterRecord
from emulators.drive.profidrive.parameter_server import ParameterServer
from emulators.drive.profidrive.parameters import ParameterStore
from emulators.drive.profidrive.profile_parameters import Identification, ParameterMemory
from emulators.drive.profidrive.sdo_parameters import ParameterWindow
from emulators.drive.profidrive.statemachine import Action, AxisState, GeneralStateMachine, Off

__all__ = [
    "AXIS_TELEGRAMS",
    "CATALOGUE",
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
    "eds_text",
    "load_definitions",
    "profidrive_dictionary",
]
