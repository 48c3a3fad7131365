"""Position mode of a PROFIdrive axis: the basic positioner behind the telegrams 7, 9, 110, 111 and 112
(PD-007, PD-008, PD-018 to PD-020).

Setpoint words come from the telegram; what it has not comes from settings and digital inputs of the drive:
home switch as reference cam, limit switches as limit cams. A task that is refused is a warning, what stops
the axis on its way is a fault.
"""

from __future__ import annotations

import math
from typing import Final

from emulators.drive.inputs import DigitalInputs
from emulators.drive.machine import INPUT_BITS
from emulators.drive.profidrive.faults.catalogue import DriveWarning
from emulators.drive.profidrive.faults.state import FaultState, RaiseFault
from emulators.drive.profidrive.modes.setpoint_channel import SetpointChannel
from emulators.drive.profidrive.positioner.positioner import Positioner, Refused, Words
from emulators.drive.profidrive.process_data import ProcessData
from emulators.drive.profidrive.safety.state import SafetyState
from emulators.drive.profidrive.statemachine import AxisState, GeneralStateMachine, Off
from emulators.drive.profidrive.torque import TorqueLimits
from fieldbus.profidrive.formats import N2_ONE
from fieldbus.profidrive.words import POS_STW2, STW1

_JOG: Final = int(STW1.JOG_1 | STW1.JOG_2)
_NEGATIVE_LIMIT: Final = 1 << INPUT_BITS["negative_limit"]
_POSITIVE_LIMIT: Final = 1 << INPUT_BITS["positive_limit"]
_HOME: Final = 1 << INPUT_BITS["home"]
_CAM: Final = int(POS_STW2.REFERENCE_CAM)
_NEGATIVE: Final = int(POS_STW2.SEARCH_NEGATIVE)
_POS_STW: Final = int(
    POS_STW2.TRACKING | POS_STW2.SET_REFERENCE_POINT | POS_STW2.REFERENCE_CAM | POS_STW2.INCREMENTAL_JOG
)
"""Bits of POS_STW2 that POS_STW of telegram 110 has too."""


class PositionMode:
    """Leads the axis by traversing tasks.

    Args:
        channel: Setpoint channel, whose stop ramps are used.
        positioner: Basic positioner.
        data: Setpoints of the telegram.
        machine: General state machine.
        safety: Safety functions in effect.
        faults: Faults and warnings.
        torque: Torque limits.
        inputs: Limit and home switches.
        keeps_home: Whether the encoder keeps the home position over power-off.
        raise_fault: Raises a fault of the drive.

    """

    def __init__(
        self,
        channel: SetpointChannel,
        positioner: Positioner,
        data: ProcessData,
        *,
        machine: GeneralStateMachine,
        safety: SafetyState,
        faults: FaultState,
        torque: TorqueLimits,
        inputs: DigitalInputs,
        keeps_home: bool,
        raise_fault: RaiseFault,
    ) -> None:
        self.channel = channel
        self.positioner = positioner
        self._data = data
        self._machine = machine
        self._safety = safety
        self._faults = faults
        self._torque = torque
        self._inputs = inputs
        self._keeps_home = keeps_home
        self._raise_fault = raise_fault
        place = data.place
        self._stw1_at = place("POS_STW1")
        self._stw2_at = place("POS_STW2")
        self._pos_stw_at = place("POS_STW")
        self._satzanw_at = place("SATZANW")
        self._mod_at = place("MDI_MOD")
        self._override_at = place("OVERRIDE")
        self._target_at = place("MDI_TARPOS")
        self._velocity_at = place("MDI_VELOCITY")
        self._acc_at = place("MDI_ACC")
        self._dec_at = place("MDI_DEC")
        self._acc_fine_at = place("MDI_ACC_32")
        self._dec_fine_at = place("MDI_DEC_32")
        self._warned: Refused | None = None
        self._refusals = 0

    def restart(self) -> None:
        """Begin as after power-on: an incremental encoder has lost the home position."""
        self.positioner.restart(keep_home=self._keeps_home)
        self._warned = None

    def jogs(self, stw1: int) -> bool:
        """Say whether a control word switches on by a jog bit: not in position mode;
        both bits at once are a warning.
        """
        self._faults.warn(DriveWarning.JOG_CONTRADICTION, stw1 & _JOG == _JOG)
        return False

    # -- setpoint words --------------------------------------------------------------------------------

    def words(self, row: tuple[int, ...]) -> Words:
        """Return the setpoint words in effect, whichever telegram brings them."""
        settings = self.positioner.settings
        inputs = self._inputs.value
        if self._satzanw_at >= 0:
            pos_stw1 = Positioner.words_of_satzanw(row[self._satzanw_at], row[self._mod_at])
        else:
            pos_stw1 = row[self._stw1_at]
        pos_stw2 = row[self._stw2_at] if self._stw2_at >= 0 else row[self._pos_stw_at] & _POS_STW
        pos_stw2 |= settings.always_on
        if inputs & _HOME:
            pos_stw2 |= _CAM
        if settings.search_negative:
            pos_stw2 ^= _NEGATIVE
        acceleration, deceleration = float(N2_ONE), float(N2_ONE)
        if self._acc_fine_at >= 0:
            acceleration = row[self._acc_fine_at] / settings.max_acceleration * N2_ONE
            deceleration = row[self._dec_fine_at] / settings.max_deceleration * N2_ONE
        elif self._acc_at >= 0:
            acceleration, deceleration = row[self._acc_at], row[self._dec_at]
        has_mdi = self._target_at >= 0
        return Words(
            stw1=self._data.stw1,
            pos_stw1=pos_stw1,
            pos_stw2=pos_stw2,
            override=row[self._override_at] if self._override_at >= 0 else N2_ONE,
            target=row[self._target_at] if has_mdi else settings.mdi_target,
            velocity=row[self._velocity_at] if has_mdi else settings.mdi_velocity,
            acceleration=acceleration,
            deceleration=deceleration,
        )

    # -- cycle -----------------------------------------------------------------------------------------

    def lead(self, row: tuple[int, ...]) -> None:
        """Let the setpoints act; the positioner does, in `watch`."""

    def watch(self) -> None:
        """Let the positioner work; in every bus cycle, whatever the state is."""
        positioner = self.positioner
        torque = self._torque
        inputs = self._inputs.value
        positioner.step(
            self.words(self._data.row),
            operating=self._machine.state is AxisState.S4 and not self._safety.holding,
            minus_cam=bool(inputs & _NEGATIVE_LIMIT),
            plus_cam=bool(inputs & _POSITIVE_LIMIT),
            fixed_stop=torque.at_fixed_stop,
        )
        clamping = positioner.clamping_torque_Nm if positioner.fixed_stop.active else math.inf
        if clamping != torque.clamping_Nm:
            torque.cap(clamping_Nm=clamping)
        if positioner.refused is not self._warned or positioner.refusals != self._refusals:
            self._refusals = positioner.refusals
            self._report(positioner.refused)
        if positioner.off_course and self._machine.state is AxisState.S4:
            self._raise_fault(Refused.FOLLOWING_ERROR)

    def probe_edge(self, number: int, rising: bool, increments: int) -> None:
        """Take an edge of probe input 1 or 2, with the increments of the motor encoder at it."""
        per_increment = self.positioner.core.encoder.radians_per_increment
        self.positioner.probe_edge(number, rising, increments * per_increment)

    def _report(self, refused: Refused | None) -> None:
        faults = self._faults
        if self._warned is not None and not self._warned.is_fault:
            faults.warn(self._warned, False)
        self._warned = refused
        if refused is None:
            return
        if refused.is_fault:
            self._raise_fault(refused)
        elif self.positioner.settings.refused_task == "fault":
            self._raise_fault(refused, reaction=Off.OFF1)
        else:
            faults.warn(refused, True)

    def stop(self, *, quick: bool) -> None:
        """Brake to standstill: OFF1 with p1121, OFF3 with p1135."""
        self.channel.stop_ramp(int(STW1.RAMP_ENABLE), quick=quick)

    def inhibited(self) -> None:
        """The pulses have been taken away."""

    # -- status words ----------------------------------------------------------------------------------

    def zsw1(self) -> int:
        """Return the bits of ZSW1 that position mode has in its own way (PD-068 to PD-075)."""
        return self.positioner.zsw1
