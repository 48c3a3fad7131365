"""Defects of the PROFIdrive drive, of its telegram and encoder interface, and of the
controller's side of the telegram.
"""

from __future__ import annotations

from functools import partial
from typing import Final

from hil.mutants._mutant import Mutant, defect

_MACHINE: Final = "emulators.drive.profidrive.statemachine:GeneralStateMachine.step"
_DEVICE: Final = "emulators.drive.profidrive.drive:ProfidriveDrive"
_FAULTS: Final = "emulators.drive.profidrive.faults.state:FaultState"
_OPERATION: Final = "emulators.drive.profidrive.operation:Operation"
_CHANNEL: Final = "emulators.drive.profidrive.modes.setpoint_channel:SetpointChannel"
_WORDS: Final = "emulators.drive.profidrive.status_words:StatusWords"
_MONITORS: Final = "emulators.drive.profidrive.monitors:Monitors"
_SIGN: Final = "fieldbus.profidrive.sign_of_life:SignOfLife"
_WATCH: Final = "fieldbus.profidrive.sign_of_life:SignWatch.step"
_PORT: Final = "motion.drives.profidrive:ProfidrivePort"
_ENCODER: Final = "emulators.encoder.profidrive.interface:EncoderInterface"

_defect = partial(defect, area="profidrive")

MUTANTS: Final[tuple[Mutant, ...]] = (
    _defect(
        "off2-as-off3",
        "OFF2 is treated like OFF3: the drive brakes instead of coasting",
        _MACHINE,
        "if not no_off2:\n                return self._to(AxisState.S1, Action.INHIBIT)\n            if not "
        "no_off3:\n"
        "                return self._to(AxisState.S5B, Action.QUICK_STOP)\n            if not on:",
        "if not no_off2 or not no_off3:\n                return self._to(AxisState.S5B, "
        "Action.QUICK_STOP)\n            if not on:",
        ids=("PD-104", "PD-114"),
        likely=("telegram-faults/withdrawn-off2/*@profidrive",),
    ),
    _defect(
        "off3-as-off1",
        "OFF3 brakes with the ramp of OFF1",
        _MACHINE,
        "if not no_off3:\n                return self._to(AxisState.S5B, Action.QUICK_STOP)\n            if "
        "not on:",
        "if not no_off3:\n                return self._to(AxisState.S5B, Action.RAMP_STOP)\n            if "
        "not on:",
        ids=("PD-105", "PD-116"),
        likely=("stop-modes/power-1/constant@profidrive",),
    ),
    _defect(
        "quick-stop-taken-back",
        "When OFF3 ends, the drive resumes operation: S5b returns to S4",
        _MACHINE,
        "if not no_off2 or standstill or not operate:",
        "if on and no_off3 and operate:\n                return self._to(AxisState.S4, Action.CONTINUE)\n"
        "            if not no_off2 or standstill or not operate:",
        ids=("PD-113",),
        likely=("profidrive-words/off3-is-kept",),
    ),
    _defect(
        "off1-cannot-be-taken-back",
        "ON during the ramp of OFF1 is ignored: S5a continues to S2",
        _MACHINE,
        "if on:\n                return self._to(AxisState.S4, Action.CONTINUE)",
        "if on and standstill:\n                return self._to(AxisState.S4, Action.CONTINUE)",
        ids=("PD-111",),
        likely=("profidrive-words/off1-is-taken-back",),
    ),
    _defect(
        "switches-on-by-level",
        "S1 is left with ON set: no edge is needed after a stop",
        _MACHINE,
        "if not stw1 & STW1.ON and no_off2 and no_off3",
        "if no_off2 and no_off3",
        ids=("PD-098",),
        likely=("profidrive-words/on-needs-an-edge",),
    ),
    _defect(
        "on-not-locked-by-fault",
        "A fault does not lock ON: the drive starts by itself after the acknowledgement",
        f"{_OPERATION}.lock_on",
        "self._on_locked = True",
        "self._on_locked = False",
        ids=("PD-115",),
        likely=("profidrive-words/fault-locks-on",),
    ),
    _defect(
        "acknowledged-by-level",
        "Faults are acknowledged by the level of STW1 bit 7 instead of its edge",
        f"{_DEVICE}._take_over",
        "acknowledges = stw1 & ~data.stw1 & _ACKNOWLEDGE",
        "acknowledges = stw1 & _ACKNOWLEDGE",
        ids=("PD-137",),
        likely=("drive-faults/acknowledge-held@profidrive",),
    ),
    _defect(
        "lasting-cause-acknowledged",
        "A fault whose cause lasts is gone after the acknowledgement",
        f"{_FAULTS}.acknowledge",
        "if holds():",
        "if not holds():",
        ids=("PD-137",),
        likely=("drive-faults/acknowledge-held@profidrive",),
    ),
    _defect(
        "fault-bit-missing",
        "ZSW1 bit 3 shows no fault",
        f"{_WORDS}._true_zsw1",
        "if faults.buffer.current:\n            word |= _FAULT",
        "if not faults.buffer.current and faults.off:\n            word |= _FAULT",
        ids=("PD-068",),
        likely=("drive-faults/acknowledge-held@profidrive",),
    ),
    _defect(
        "off3-bit-not-shown",
        "ZSW1 bit 5 stays 1 during a quick stop",
        f"{_WORDS}._true_zsw1",
        "if stw1 & 0x0004 and not (off & _OFF3 or self._safety.holding) and state is not _S5B:",
        "if stw1 is not None:",
        ids=("PD-070",),
        likely=("telegram-faults/withdrawn-off3/*@profidrive",),
    ),
    _defect(
        "pulses-bit-from-state",
        "ZSW2 bit 10 shows pulses whenever the drive is switched on",
        f"{_WORDS}.zsw2",
        "if self._core.enabled:",
        "if self._machine.state.bits & 0x0003:",
        ids=("PD-083",),
        likely=("profidrive-words/pulses",),
    ),
    _defect(
        "sign-of-life-tolerance-off-by-one",
        "One wrong sign of life more than PNU 925 is tolerated",
        f"{_SIGN}.step",
        "if self.counter <= _FAILURE * self.tolerance:",
        "if self.counter <= _FAILURE * (self.tolerance + 1):",
        ids=("PD-127", "PD-129"),
        likely=("telegram-faults/two-wrong-signs@profidrive",),
    ),
    _defect(
        "sign-of-life-never-forgets",
        "Correct signs of life do not count the failures down",
        f"{_SIGN}.step",
        "self.counter -= 1\n",
        "self.counter -= 0\n",
        ids=("PD-127",),
        likely=("telegram-faults/one-wrong-sign@profidrive", "telegram-faults/two-wrong-signs@profidrive"),
    ),
    _defect(
        "sign-of-life-wraps-to-zero",
        "The drive counts its sign of life from 15 to 0",
        f"{_SIGN}.step",
        "self.value = value + 1 if 0 <= value < _HIGHEST else 1",
        "self.value = (value + 1) % 16",
        ids=("PD-123",),
        likely=("stop-modes/halt/constant@profidrive",),
    ),
    _defect(
        "controller-ignores-sign-of-life",
        "The controller accepts any sign of life of the drive",
        _WATCH,
        "right = self._before == 0 or received == next_sign(self._before)",
        "right = received >= 0",
        ids=("PD-132",),
        likely=("telegram-faults/sign-of-life/*@profidrive",),
    ),
    _defect(
        "controller-tolerates-one-sign-less",
        "The controller drops the drive one wrong sign of life too early",
        _WATCH,
        "return self._wrong <= self.tolerance",
        "return self._wrong < self.tolerance",
        ids=("PD-132",),
        likely=("telegram-faults/sign-of-life-stands/2@profidrive",),
    ),
    _defect(
        "control-bit-ignored",
        "Setpoints are taken over without control by PLC (STW1 bit 10)",
        f"{_DEVICE}._take_over",
        "if not stw1 & _CONTROL:",
        "if not stw1 & _CONTROL and not data.controlled_cyclically:",
        ids=("PD-076",),
        likely=("telegram-faults/control-given-away*@profidrive",),
    ),
    _defect(
        "speed-setpoint-half-scale",
        "NSOLL_B is scaled with 8000 0000h as 100 % instead of 4000 0000h",
        f"{_CHANNEL}.refresh",
        "self._scale = settings.reference_speed_rpm * RPM / N4_ONE",
        "self._scale = settings.reference_speed_rpm * RPM / (2 * N4_ONE)",
        ids=("PD-005",),
        likely=("fault-reactions/drive-fault/*/constant@profidrive", "axis-faults/*@profidrive"),
    ),
    _defect(
        "ramps-swapped",
        "OFF1 brakes with p1135 and OFF3 with p1121",
        f"{_CHANNEL}.stop_ramp",
        "self._quick if quick else self._down,",
        "self._down if quick else self._quick,",
        ids=("PD-116",),
        likely=("stop-modes/power-1/constant@profidrive",),
    ),
    _defect(
        "ramp-enable-ignored",
        "STW1 bit 4 has no effect: the setpoint is followed without the ramp generator enabled",
        f"{_CHANNEL}.step",
        "if stw1 & (_RAMP_ENABLED | _SETPOINT_ENABLED) == _RAMP_ENABLED | _SETPOINT_ENABLED:",
        "if stw1 & _SETPOINT_ENABLED:",
        ids=("PD-050",),
        likely=("telegram-faults/ramp-disabled@profidrive",),
    ),
    _defect(
        "setpoint-enable-ignored",
        "STW1 bit 6 has no effect: the setpoint is followed although it is disabled",
        f"{_CHANNEL}.step",
        "if stw1 & (_RAMP_ENABLED | _SETPOINT_ENABLED) == _RAMP_ENABLED | _SETPOINT_ENABLED:",
        "if stw1 & _RAMP_ENABLED:",
        ids=("PD-052",),
        likely=("telegram-faults/ramp-without-input@profidrive",),
    ),
    _defect(
        "clock-failure-unnoticed",
        "The drive does not notice missing telegrams",
        f"{_MONITORS}._look_at_bus",
        "missed = self._settings.sign_of_life_tolerance + 1.5",
        "missed = 1000.0 * (self._settings.sign_of_life_tolerance + 1.5)",
        ids=("PD-030",),
        likely=("profidrive-words/sync-lost",),
    ),
    _defect(
        "setpoint-monitoring-hundredfold",
        "The monitoring time of process data over Modbus is taken in another unit",
        f"{_MONITORS}._look_at_bus",
        "silent_ns > round(limit_ms * MS)",
        "silent_ns > 100 * round(limit_ms * MS)",
        ids=("PD-292",),
        likely=("modbus-monitoring/every-request",),
    ),
    _defect(
        "encoder-error-not-shown",
        "G1_ZSW bit 15 stays 0: the encoder value continues as if it were valid",
        f"{_ENCODER}._transition",
        "elif cause:\n            self._fault(cause)",
        "elif cause and not self.valid:\n            self._fault(cause)",
        ids=("PD-160",),
        likely=("fault-reactions/encoder-fault/*@profidrive", "drive-faults/trip/encoder-wire/*@profidrive"),
    ),
    _defect(
        "stale-answer-shown",
        "The controller keeps the last answer when an answer of the wrong length arrives",
        f"{_PORT}._take",
        "if frame is None or len(frame) != self.telegram.actual.length:\n            alive = "
        "self._judge(fresh=False)",
        "if frame is None:\n            alive = self._judge(fresh=False)\n        elif len(frame) != "
        "self.telegram.actual.length:\n"
        "            alive = self._judge(fresh=True)",
        ids=("PD-030", "TA-020"),
        likely=("telegram-faults/wrong-length/*@profidrive",),
    ),
    _defect(
        "encoder-error-bit-ignored",
        "The controller does not look at the error bit of G1_ZSW",
        f"{_PORT}._show",
        "self.sensor_fault = bool(g1_zsw & _ENCODER_ERROR)",
        "self.sensor_fault = False",
        ids=("TA-020", "PD-160"),
        likely=("telegram-faults/lie/encoder-error/*@profidrive",),
    ),
    _defect(
        "controller-sign-stands-still",
        "The controller sends the same sign of life in every telegram",
        f"{_PORT}._compose",
        "self._sign = sign = next_sign(self._sign)",
        "self._sign = sign = 1",
        ids=("PD-123",),
        likely=("stop-modes/halt/constant@profidrive",),
    ),
    _defect(
        "fault-ends-with-its-cause",
        "A fault of the drive leaves operation but not the stop command behind: it does not stop",
        f"{_FAULTS}.enter",
        "self.off |= off",
        "self.off |= off & 2",
        ids=("PD-115", "STP-559"),
        likely=("fault-reactions/drive-fault/*@profidrive",),
    ),
)
