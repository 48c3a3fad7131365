"""Power drive system state machine of CiA 402, without time, bus or motor (C402-001 to C402-031).

`PowerStateMachine` gets control words and events and answers with an `Action`: what the drive has
to do. A stop ramp belongs to the drive; while it runs the machine waits for `stop_finished`.
During the ramp of Shutdown or Disable operation the state stays Operation enabled, and the
transition is made at standstill (STP-543).
"""

from __future__ import annotations

from collections.abc import Callable
from enum import Enum, IntEnum
from typing import Final

from fieldbus.cia402 import Command, DriveState, decode_command


class Action(Enum):
    """What the drive has to do after a call."""

    NOTHING = "nothing"
    POWER_ON = "switch the high-level power on, then call `power_is_on`"
    ENABLE = "enable the drive function"
    STOP = "stop as `stop_option` says, then call `stop_finished`"
    CONTINUE = "give the stop up and follow the commands again"
    OFF = "torque off at once"
    FAULT_RESET = "the fault is acknowledged"


class StopOption(IntEnum):
    """How a stop is made: values 1 to 4 of the option codes."""

    SLOW_DOWN = 1
    QUICK_STOP = 2
    CURRENT_LIMIT = 3
    VOLTAGE_LIMIT = 4


_STATES_WITH_TORQUE: Final = (DriveState.OPERATION_ENABLED, DriveState.QUICK_STOP_ACTIVE)


class OptionCodes:
    """Option codes in effect (C402-049 to C402-073)."""

    def __init__(self) -> None:
        self.abort_connection = 1
        self.quick_stop = 2
        self.shutdown = 0
        self.disable_operation = 1
        self.halt = 1
        self.fault_reaction = 2


_OPERATION_ENABLED: Final = DriveState.OPERATION_ENABLED


class PowerStateMachine:
    """The states, the transitions and what they ask of the drive.

    Args:
        on_transition: Called with number, old and new state after every transition.

    """

    def __init__(self, on_transition: Callable[[int, DriveState, DriveState], None] | None = None) -> None:
        self._on_transition = on_transition
        self.options = OptionCodes()
        self.state = DriveState.NOT_READY_TO_SWITCH_ON
        self.stop_option = StopOption.QUICK_STOP
        """How to stop, after `Action.STOP`."""
        self.inhibited = False
        """Transition 2 is refused (safe torque off; C402-030)."""
        self.power_available = True
        """High-level power can be switched on (DC link; C402-004)."""
        self.tolerates_no_power = False
        """Transition 3 is made without high-level power too: a quirk."""
        self.skips_switched_on = False
        """Transition 4 follows 3 before Switched on can be seen: a quirk."""
        self.fault_present = False
        """The cause of the fault is still there: no reset (C402-016)."""
        self.remote = True
        """Control words are processed (bit 9 of the status word)."""
        self.refused: frozenset[int] = frozenset()
        """Numbers of transitions by command that are not made: a fault to inject; of 2, 3, 4, 15, 16."""
        self.settled = False
        """The last control word leads nowhere further in the present state."""
        self.enable_follows = False
        """Transition 4 is to follow transition 3 (C402-020)."""
        self.status_seen = True
        """The status word of the present state has been sampled."""
        self._previous_word = 0
        self._waits_for_power = False
        self._ramp_target: DriveState | None = None
        self._quick_stop_option = 2
        self._quick_stopped = False

    # -- what the drive asks ---------------------------------------------------------------------------

    @property
    def status_bits(self) -> int:
        """Bits 0 to 3, 5 and 6 of the status word."""
        return self.state.bits

    @property
    def ramping_down(self) -> bool:
        """Whether a stop is under way that leads out of the present state."""
        return (
            self._ramp_target is not None
            or self.state is DriveState.FAULT_REACTION_ACTIVE
            or (self.state is DriveState.QUICK_STOP_ACTIVE and not self._quick_stopped)
        )

    @property
    def stop_leads_off(self) -> bool:
        """Whether the stop under way ends with the torque switched off."""
        return self.ramping_down and not (
            self.state is DriveState.QUICK_STOP_ACTIVE and self._quick_stop_option > 4
        )

    @property
    def follows_commands(self) -> bool:
        """Whether setpoints are executed: Operation enabled and no stop under way."""
        return self.state is _OPERATION_ENABLED and self._ramp_target is None

    # -- life ------------------------------------------------------------------------------------------

    def start(self) -> Action:
        """Power-on or reset of the application: transition 0; forgets everything."""
        self._forget()
        self._previous_word = 0
        self.fault_present = False
        self._go(0, DriveState.NOT_READY_TO_SWITCH_ON)
        return Action.OFF

    def initialised(self) -> Action:
        """Self-test finished: transition 1."""
        if self.state is DriveState.NOT_READY_TO_SWITCH_ON:
            self._go(1, DriveState.SWITCH_ON_DISABLED)
        return Action.NOTHING

    # -- commands --------------------------------------------------------------------------------------

    def control(self, word: int) -> Action:
        """Evaluate a control word: at most one transition (C402-027)."""
        rising = word & 0x80 and not self._previous_word & 0x80
        self._previous_word = word
        if not self.remote:
            return Action.NOTHING
        if self.state is DriveState.FAULT:
            if rising and not self.fault_present and 15 not in self.refused:
                self._go(15, DriveState.SWITCH_ON_DISABLED)
                return Action.FAULT_RESET
            return Action.NOTHING
        if word & 0x80:
            return Action.NOTHING
        before = self.state
        action = self._command(decode_command(word))
        self.settled = action is Action.NOTHING and self.state is before
        return action

    def _command(self, command: Command) -> Action:
        state = self.state
        if state is DriveState.OPERATION_ENABLED:
            return self._in_operation(command)
        if command is Command.DISABLE_VOLTAGE or command is Command.QUICK_STOP:
            return self._withdraw(command)
        if state is DriveState.SWITCH_ON_DISABLED:
            if command is Command.SHUTDOWN and not self.inhibited and 2 not in self.refused:
                self._go(2, DriveState.READY_TO_SWITCH_ON)
        elif state is DriveState.READY_TO_SWITCH_ON:
            if command is Command.SHUTDOWN:
                self._waits_for_power = False
            elif (self.power_available or self.tolerates_no_power) and 3 not in self.refused:
                self.enable_follows = command is Command.ENABLE_OPERATION
                if not self._waits_for_power:
                    self._waits_for_power = True
                    return Action.POWER_ON
        elif state is DriveState.SWITCHED_ON:
            if command is Command.ENABLE_OPERATION:
                return self._enable()
            self.enable_follows = False
            if command is Command.SHUTDOWN:
                self._go(6, DriveState.READY_TO_SWITCH_ON)
        elif (
            state is DriveState.QUICK_STOP_ACTIVE
            and command is Command.ENABLE_OPERATION
            and self._quick_stopped
            and not self.inhibited
            and 16 not in self.refused
        ):
            self._go(16, DriveState.OPERATION_ENABLED)
            return Action.CONTINUE
        return Action.NOTHING

    def _in_operation(self, command: Command) -> Action:
        if command is Command.DISABLE_VOLTAGE or command is Command.QUICK_STOP:
            return self._withdraw(command)
        if command is Command.SHUTDOWN:
            return self._leave_operation(8, DriveState.READY_TO_SWITCH_ON, self.options.shutdown)
        if command is Command.SWITCH_ON:
            return self._leave_operation(5, DriveState.SWITCHED_ON, self.options.disable_operation)
        if self._ramp_target is not None:
            # Like OFF1 of other profiles, a stop by Shutdown or Disable operation can be taken back.
            self._ramp_target = None
            return Action.CONTINUE
        return Action.NOTHING

    def _leave_operation(self, transition: int, target: DriveState, option: int) -> Action:
        if option == 0:
            self._go(transition, target)
            return Action.OFF
        if self._ramp_target is None:
            self._ramp_target = target
            self.stop_option = StopOption.SLOW_DOWN
            return Action.STOP
        self._ramp_target = target
        return Action.NOTHING

    def _withdraw(self, command: Command) -> Action:
        """Execute Disable voltage or Quick stop."""
        state = self.state
        if state is DriveState.READY_TO_SWITCH_ON:
            self._go(7, DriveState.SWITCH_ON_DISABLED)
        elif state is DriveState.SWITCHED_ON:
            self._go(10, DriveState.SWITCH_ON_DISABLED)
        elif state is DriveState.OPERATION_ENABLED:
            if command is Command.DISABLE_VOLTAGE:
                self._go(9, DriveState.SWITCH_ON_DISABLED)
                return Action.OFF
            return self._quick_stop()
        elif state is DriveState.QUICK_STOP_ACTIVE and command is Command.DISABLE_VOLTAGE:
            self._go(12, DriveState.SWITCH_ON_DISABLED)
            return Action.OFF
        return Action.NOTHING

    def _quick_stop(self) -> Action:
        self._quick_stop_option = option = self.options.quick_stop
        self._go(11, DriveState.QUICK_STOP_ACTIVE)
        if option == 0:
            self._go(12, DriveState.SWITCH_ON_DISABLED)
            return Action.OFF
        self.stop_option = StopOption(option if option <= 4 else option - 4)
        return Action.STOP

    def _enable(self) -> Action:
        if 4 in self.refused or not self.power_available:
            return Action.NOTHING
        self._go(4, DriveState.OPERATION_ENABLED)
        return Action.ENABLE

    # -- events ----------------------------------------------------------------------------------------

    def power_is_on(self) -> Action:
        """High-level power is on: transition 3."""
        if self.state is DriveState.READY_TO_SWITCH_ON and self._waits_for_power:
            if not (self.power_available or self.tolerates_no_power):
                self._waits_for_power = False
                return Action.NOTHING
            follows = self.enable_follows
            self._go(3, DriveState.SWITCHED_ON)
            if follows and self.skips_switched_on:
                return self._enable()
            self.enable_follows = follows
            self.status_seen = False
        return Action.NOTHING

    def cycle(self) -> Action:
        """Call once per control cycle: transition 4 follows 3 as soon as
        Switched on has been seen (C402-020).
        """
        if self.enable_follows and self.status_seen and self.state is DriveState.SWITCHED_ON:
            return self._enable()
        return Action.NOTHING

    def stop_finished(self) -> Action:
        """Report that the stop asked for by `Action.STOP` has ended: transitions 5, 8, 12, 14."""
        state = self.state
        if state is DriveState.OPERATION_ENABLED and self._ramp_target is not None:
            target = self._ramp_target
            self._go(8 if target is DriveState.READY_TO_SWITCH_ON else 5, target)
            return Action.OFF
        if state is DriveState.QUICK_STOP_ACTIVE:
            if self._quick_stop_option <= 4:
                self._go(12, DriveState.SWITCH_ON_DISABLED)
                return Action.OFF
            self._quick_stopped = True
            self.settled = False
        elif state is DriveState.FAULT_REACTION_ACTIVE:
            self._go(14, DriveState.FAULT)
            return Action.OFF
        return Action.NOTHING

    def fault(self, *, can_brake: bool = True) -> Action:
        """Enter the fault reaction: transition 13, and 14 at once where nothing has to be or can be stopped.

        Args:
            can_brake: False: the power stage or the motor sensor has failed,
                there is no torque to brake with.

        """
        state = self.state
        if state is DriveState.FAULT:
            return Action.NOTHING
        if state is DriveState.FAULT_REACTION_ACTIVE:
            return Action.NOTHING if can_brake else self.stop_finished()
        had_torque = state in _STATES_WITH_TORQUE
        self._go(13, DriveState.FAULT_REACTION_ACTIVE)
        option = self.options.fault_reaction
        if had_torque and can_brake and option > 0:
            self.stop_option = StopOption(option)
            return Action.STOP
        return self.stop_finished()

    def disable_voltage(self) -> Action:
        """Fall to Switch on disabled by an internal event, such as safe torque off; a fault stays a fault."""
        if self.state is DriveState.FAULT_REACTION_ACTIVE:
            return self.stop_finished()
        return self._withdraw(Command.DISABLE_VOLTAGE)

    def reset_itself(self) -> Action:
        """Leave Fault by an internal event: transition 15 without a command."""
        if self.state is not DriveState.FAULT:
            return Action.NOTHING
        self._go(15, DriveState.SWITCH_ON_DISABLED)
        return Action.FAULT_RESET

    def quick_stop(self) -> Action:
        """Execute the command Quick stop by an internal event (6007h = 3)."""
        return self._withdraw(Command.QUICK_STOP)

    def release(self) -> None:
        """Have the control word evaluated again, because an obstacle is gone."""
        self.settled = False

    # -- inside ----------------------------------------------------------------------------------------

    def _forget(self) -> None:
        self._waits_for_power = False
        self._ramp_target = None
        self._quick_stopped = False
        self.enable_follows = False
        self.settled = False

    def _go(self, transition: int, state: DriveState) -> None:
        old = self.state
        self._forget()
        self.state = state
        if self._on_transition is not None:
            self._on_transition(transition, old, state)
