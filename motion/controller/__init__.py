"""The controller as a CPU: operating states, execution levels, diagnostics buffer (MC-629 to MC-637)."""

from motion.controller.controller import Controller, ControllerError
from motion.controller.diagnosis import ControllerDiagnosis
from motion.controller.diagnostics_buffer import DiagnosticsBuffer, DiagnosticsEntry
from motion.controller.levels import ExecutionLevels
from motion.controller.states import OperatingState

__all__ = [
    "Controller",
    "ControllerDiagnosis",
    "ControllerError",
    "DiagnosticsBuffer",
    "DiagnosticsEntry",
    "ExecutionLevels",
    "OperatingState",
]
