"""How the state machine of a PROFIdrive axis works on the drive: commands in force, actions of its
transitions (PD-096 to PD-118).
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

from emulators.drive.profidrive.faults.catalogue import DriveWarning
from emulators.drive.profidrive.statemachine import Action, AxisState, GeneralStateMachine
from fieldbus.clock import seconds_to_ns
from fieldbus.profidrive.words import STW1

if TYPE_CHECKING:
    from emulators.drive.profidrive.drive import ProfidriveDrive

_ON: Final = int(STW1.ON)
_S1: Final = AxisState.S1
_S3: Final = AxisState.S3
_S4: Final = AxisState.S4
_NOTHING: Final = Action.NOTHING
_JOG: Final = int(STW1.JOG_1 | STW1.JOG_2)
_RUN: Final = int(STW1.ON | STW1.NO_OFF2 | STW1.NO_OFF3 | STW1.ENABLE_OPERATION)
_RUN_OR_JOG: Final = _RUN | _JOG


class Operation:
    """Steps the general state machine and carries out what it asks for.

    Args:
        drive: The drive.

    """

    __slots__ = ("_drive", "_on_locked", "_s3_ns", "_standstill", "machine", "refuses")

    def __init__(self, drive: ProfidriveDrive) -> None:
        self._drive = drive
        self.machine = GeneralStateMachine()
        self.refuses = False
        """S3 is not left, whatever the control word says."""
        self._on_locked = self._standstill = False
        self._s3_ns = 0
        drive.core.on_standstill = self._on_standstill

    def reset(self) -> None:
        """Begin as after power-on."""
        old = self.machine.state
        self.machine.reset()
        self._on_locked = self._standstill = False
        self._changed(old)

    def lock_on(self) -> None:
        """Demand a new edge of ON: a fault has switched off (PD-115)."""
        self._on_locked = True

    def act(self) -> None:
        """Let the state machine make one step: in every bus cycle, and when something happens in between."""
        drive = self._drive
        if not (drive.powered and drive.controlled_cyclically):
            return
        machine = self.machine
        old = machine.state
        faults = drive.faults
        if (
            old is _S4
            and drive.stw1 & _RUN_OR_JOG == _RUN
            and not (self._on_locked or faults.off or drive.safety.off or faults.warnings)
        ):
            return  # operation goes on: the usual case, in every bus cycle
        action = machine.step(
            self._command(old),
            off=faults.off | drive.safety.off,
            standstill=self._standstill,
            # Each is asked for in one state only.
            ready=old is not _S3 or (drive.ready and self._delay_over()),
            synchronised=old is not _S1 or not drive.isochronous or drive.sign_of_life.synchronised,
        )
        if action is not _NOTHING:
            self._carry_out(action)
        if machine.state is not old:
            self._changed(old)

    def _delay_over(self) -> bool:
        drive = self._drive
        return drive.scheduler.now - self._s3_ns >= seconds_to_ns(drive.config.power_on_delay_s)

    def _command(self, state: AxisState) -> int:
        """Return STW1 as the state machine sees it."""
        drive = self._drive
        stw1 = drive.stw1
        if self._on_locked:
            if not stw1 & _ON:
                self._on_locked = False
            elif state is not AxisState.S1:
                stw1 &= ~_ON
        if stw1 & _JOG:
            if drive.mode.jogs(stw1) and state is not AxisState.S1 and not self._on_locked:
                stw1 |= _ON  # jogging switches on by itself, from S2 (PD-122)
        elif drive.faults.warnings:
            drive.faults.warn(DriveWarning.JOG_CONTRADICTION, False)
        return stw1

    def _carry_out(self, action: Action) -> None:
        drive = self._drive
        self._standstill = False
        if action is Action.ENABLE:
            drive.core.enable_pulses()
            drive.torque.renew()
        elif action is Action.INHIBIT:
            drive.mode.inhibited()
            drive.core.inhibit_pulses()
        elif action is not Action.CONTINUE:
            drive.mode.stop(quick=action is Action.QUICK_STOP)

    def _on_standstill(self) -> None:
        self._standstill = True
        self.act()

    def _changed(self, old: AxisState) -> None:
        drive = self._drive
        new = self.machine.state
        if new is AxisState.S3:
            self._s3_ns = drive.scheduler.now
        if new is not old:
            drive.emit("drive.state", **{"from": old.text, "to": new.text})
