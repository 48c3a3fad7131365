"""The controller as a CPU: operating states, execution levels, diagnostics buffer (MC-629 to MC-637)."""

from motion.s7.controller.controller import Controller, ControllerError
from motion.s7.controller.diagnosis import ControllerDiagnosis
from motion.s7.controller.diagnostics_buffer import DiagnosticsBuffer, DiagnosticsEntry
from motion.s7.controller.levels import ExecutionLevels
from motion.s7.controller.states import OperatingState

__all__ = [
    "Controller",
    "ControllerDiagnosis",
    "ControllerError",
    "DiagnosticsBuffer",
    "DiagnosticsEntry",
    "ExecutionLevels",
    "OperatingState",
]
