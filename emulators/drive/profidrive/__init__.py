"""The PROFIdrive face of an emulated drive: state machine, fault buffer; knows no bus."""

from __future__ import annotations

from emulators.drive.profidrive.messages import FaultBuffer, FaultMessage
from emulators.drive.profidrive.statemachine import Action, AxisState, GeneralStateMachine, Off

__all__ = ["Action", "AxisState", "FaultBuffer", "FaultMessage", "GeneralStateMachine", "Off"]
