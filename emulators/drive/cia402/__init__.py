"""CiA 402 face of the emulated drive: `CiA402Drive` on a CAN segment.

Delays, all in terms of the frame end of a SYNC (default servo period 0.25 ms, SYNC period T):

* Actual values in the TPDOs of a SYNC are those of the last servo instant, at most one servo period old.
* A control word or mode in a synchronous RPDO acts at that SYNC; its TPDOs already show the new state.
  Modes and status bits of the mode follow in the next control cycle (1 ms).
* A setpoint that becomes effective at a SYNC is taken up at the next servo instant, acts on the load
  within the servo period after that, and is reached one 60C2h period later. With `torque_precontrol`
  (default) csv therefore is a pure dead time of T + 0.25 ms behind the line through the setpoints, without
  lag; with `csv_interpolation=False` of 0.25 ms behind the staircase of setpoints; with
  `torque_precontrol=False` the lag T_vtc (2 ms) comes on top.
* csp: the same dead time; at constant velocity no following error, while accelerating with a about a *
  T_vtc / Kv.
* Stops made by the drive (quick stop, shutdown, halt, fault) begin at the next servo instant; the state
  changes `standstill_time_s` (1 ms) after standstill.
"""

from __future__ import annotations

from emulators.drive.cia402.config import DriveConfig
from emulators.drive.cia402.drive import CiA402Drive
from emulators.drive.cia402.eds import EDS, EDS_PATH
from emulators.drive.cia402.faults.rules import COASTING_FAULTS, RULES, FaultRule, fault_rule
from emulators.drive.cia402.personality import Personality, load_personality, personality_names
from emulators.drive.cia402.quirks import EmcyCode, Quirks
from emulators.drive.cia402.statemachine import Action, OptionCodes, PowerStateMachine, StopOption
from emulators.drive.cia402.warnings import DriveWarning
from emulators.drive.homing_config import HomingConfig
from emulators.drive.machine import (
    BrakeConfig,
    EncoderConfig,
    LinearAxisConfig,
    RotaryAxisConfig,
    SafetyConfig,
    SwitchesConfig,
)

__all__ = [
    "COASTING_FAULTS",
    "EDS",
    "EDS_PATH",
    "RULES",
    "Action",
    "BrakeConfig",
    "CiA402Drive",
    "DriveConfig",
    "DriveWarning",
    "EmcyCode",
    "EncoderConfig",
    "FaultRule",
    "HomingConfig",
    "LinearAxisConfig",
    "OptionCodes",
    "Personality",
    "PowerStateMachine",
    "Quirks",
    "RotaryAxisConfig",
    "SafetyConfig",
    "StopOption",
    "SwitchesConfig",
    "fault_rule",
    "load_personality",
    "personality_names",
]
