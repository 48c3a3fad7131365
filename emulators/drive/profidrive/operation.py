"""How the state machine of a PROFIdrive axis acts on the drive: commands in effect, actions of its
transitions (PD-096 to PD-118).
"""

from __future__ import annotations

from typing import Final

from emulators.drive.core import ServoCore
from emulators.drive.profidrive.faults.catalogue import DriveWarning
from emulators.drive.profidrive.faults.state import FaultState
from emulators.drive.profidrive.modes import OperatingMode
from emulators.drive.profidrive.process_data import ProcessData
from emulators.drive.profidrive.safety.state import SafetyState
from emulators.drive.profidrive.statemachine import Action, AxisState, GeneralStateMachine
from emulators.drive.profidrive.torque import TorqueLimits
from emulators.drive.supply import DcLink
from emulators.events import Emit
from fieldbus.clock import Scheduler, Timer, seconds_to_ns
from fieldbus.profidrive.sign_of_life import SignOfLife
from fieldbus.profidrive.words import STW1, STW2

_ON: Final = int(STW1.ON)
_S1: Final = AxisState.S1
_S3: Final = AxisState.S3
_S4: Final = AxisState.S4
_NOTHING: Final = Action.NOTHING
_STOPS: Final = (AxisState.S5A, AxisState.S5B)
_JOG: Final = int(STW1.JOG_1 | STW1.JOG_2)
_RUN: Final = int(STW1.ON | STW1.NO_OFF2 | STW1.NO_OFF3 | STW1.ENABLE_OPERATION)
_RUN_OR_JOG: Final = _RUN | _JOG
_PARK_AXIS: Final = int(STW2.PARKING)


class Operation:
    """Steps the general state machine and carries out what it asks for.

    Args:
        scheduler: Clock of the drive.
        machine: General state machine.
        core: Servo core; its standstill ends a stop.
        data: Control words in effect.
        faults: Their stop commands act like those of the control word.
        safety: Likewise.
        mode: Operating mode; it stops the axis.
        torque: Torque limits, applied again when the pulses are enabled.
        dc_link: Its voltage enables the power stage.
        signs: Sign of life that S1 waits for; None: the drive is not isochronous.
        power_on_delay_ns: From S3 until operation can be enabled, ns.
        emit: Writes state changes into the log.

    """

    def __init__(
        self,
        scheduler: Scheduler,
        *,
        machine: GeneralStateMachine,
        core: ServoCore,
        data: ProcessData,
        faults: FaultState,
        safety: SafetyState,
        mode: OperatingMode,
        torque: TorqueLimits,
        dc_link: DcLink,
        signs: SignOfLife | None,
        power_on_delay_ns: int,
        emit: Emit,
    ) -> None:
        self._scheduler = scheduler
        self.machine = machine
        self._core = core
        self._data = data
        self._faults = faults
        self._safety = safety
        self._mode = mode
        self._torque = torque
        self._dc_link = dc_link
        self._signs = signs
        self._power_on_delay_ns = power_on_delay_ns
        self._emit = emit
        self.refuses = False
        """S3 is not left, whatever the control word says."""
        self._on_locked = self._standstill = False
        self._s3_ns = 0
        self._closing: Timer | None = None
        """The brake closes at the end of a stop; until then the motor holds the axis."""
        core.on_standstill = self._on_standstill

    @property
    def parked(self) -> bool:
        """Whether the axis is parked: STW2 bit 7, while there are no pulses (PD-082, PD-083)."""
        return bool(self._data.stw2 & _PARK_AXIS) and not self._core.enabled

    @property
    def ready(self) -> bool:
        """Whether the power stage can be enabled."""
        return not (self._dc_link.low or self._safety.torque_off or self.refuses or self.parked)

    def reset(self) -> None:
        """Begin as after power-on."""
        old = self.machine.state
        self._forget_brake()
        self.machine.reset()
        self._on_locked = self._standstill = False
        self._changed(old)

    def lock_on(self) -> None:
        """Demand a new edge of ON: a fault has switched off (PD-115)."""
        self._on_locked = True

    def act(self) -> None:
        """Let the state machine make one step: in every bus cycle, and when something happens in between."""
        data = self._data
        if not data.controlled_cyclically:
            return
        machine = self.machine
        old = machine.state
        faults = self._faults
        off = faults.off | self._safety.off
        if old is _S4 and data.stw1 & _RUN_OR_JOG == _RUN and not (self._on_locked or off or faults.warnings):
            return  # operation continues: the usual case, in every bus cycle
        action = machine.step(
            self._command(old),
            off=off,
            standstill=self._standstill,
            # Each is asked for in one state only.
            ready=old is not _S3 or (self.ready and self._delay_over()),
            synchronised=old is not _S1 or self._signs is None or self._signs.synchronised,
        )
        if action is not _NOTHING:
            self._carry_out(action)
        if machine.state is not old:
            self._changed(old)

    def _delay_over(self) -> bool:
        return self._scheduler.now - self._s3_ns >= self._power_on_delay_ns

    def _command(self, state: AxisState) -> int:
        """Return STW1 as the state machine sees it."""
        stw1 = self._data.stw1
        if self._on_locked:
            if not stw1 & _ON:
                self._on_locked = False
            elif state is not AxisState.S1:
                stw1 &= ~_ON
        if stw1 & _JOG:
            if self._mode.jogs(stw1) and state is not AxisState.S1 and not self._on_locked:
                stw1 |= _ON  # jogging switches on by itself, from S2 (PD-122)
        elif self._faults.warnings:
            self._faults.warn(DriveWarning.JOG_CONTRADICTION, False)
        return stw1

    def _carry_out(self, action: Action) -> None:
        self._standstill = False
        closing = self._forget_brake()
        if action is Action.ENABLE:
            self._core.enable_pulses()
            self._torque.renew()
        elif action is Action.INHIBIT:
            self._mode.inhibited()
            self._core.inhibit_pulses()
        elif action is not Action.CONTINUE:
            self._mode.stop(quick=action is Action.QUICK_STOP)
        elif closing:
            self._core.brake.open()

    def _on_standstill(self) -> None:
        brake = self._core.brake
        if brake.fitted and brake.closing_time_s > 0.0 and self.machine.state in _STOPS:
            brake.close()
            self._closing = self._scheduler.after(seconds_to_ns(brake.closing_time_s), self._stop_finished)
        else:
            self._stop_finished()

    def _stop_finished(self) -> None:
        self._closing = None
        self._standstill = True
        self.act()

    def _forget_brake(self) -> bool:
        """Wait for the brake no more; returns whether it was on its way."""
        timer, self._closing = self._closing, None
        if timer is None:
            return False
        timer.cancel()
        return True

    def _changed(self, old: AxisState) -> None:
        new = self.machine.state
        if new is AxisState.S3:
            self._s3_ns = self._scheduler.now
        if new is not old:
            self._emit("drive.state", **{"from": old.text, "to": new.text})
