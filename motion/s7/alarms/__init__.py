"""Technology alarms: the catalogue as data, and the engine that holds the pending alarms of one object."""

from motion.s7.alarms.catalogue import (
    NO_REACTION,
    REMOVE_ENABLE,
    STOP_CURRENT,
    STOP_EMERGENCY,
    STOP_MAXIMUM,
    TERMINATE_ENCODER,
    TRACK_SETPOINTS,
    AlarmEntry,
    AlarmError,
    ErrorIdEntry,
    alarm,
    catalogue,
    error_ids,
    error_text,
    severity,
    stop_mode_severity,
)
from motion.s7.alarms.engine import AlarmEngine, DiagnosticEntry, PendingAlarm

__all__ = [
    "NO_REACTION",
    "REMOVE_ENABLE",
    "STOP_CURRENT",
    "STOP_EMERGENCY",
    "STOP_MAXIMUM",
    "TERMINATE_ENCODER",
    "TRACK_SETPOINTS",
    "AlarmEngine",
    "AlarmEntry",
    "AlarmError",
    "DiagnosticEntry",
    "ErrorIdEntry",
    "PendingAlarm",
    "alarm",
    "catalogue",
    "error_ids",
    "error_text",
    "severity",
    "stop_mode_severity",
]
