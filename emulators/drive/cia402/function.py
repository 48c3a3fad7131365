"""The drive function: state machine, power stage, modes and stops, without a bus."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Final

from emulators.drive.cia402.axis import ProfileAxis
from emulators.drive.cia402.modes import (
    CyclicPosition,
    CyclicTorque,
    CyclicVelocity,
    Homing,
    InterpolatedPosition,
    ModeOfOperation,
    NoMode,
    ProfilePosition,
    ProfileTorque,
    ProfileVelocity,
    Velocity,
)
from emulators.drive.cia402.statemachine import Action, PowerStateMachine, StopOption
from fieldbus.clock import Scheduler, Timer, seconds_to_ns

_UNSEEN_CYCLES: Final = 4
"""Transition 4 follows 3 after this many control cycles when the status word is not sampled."""
_HALT: Final = 0x100
_MODE_BITS: Final = 0x270
"""Bits 4, 5, 6 and 9 of the control word."""
_MODE_PRIORITY: Final = 50
"""The bits of the mode are looked at after all else of the instant in which they come."""


class DriveFunction:
    """Executes what the state machine asks for and lets setpoints through or not.

    Args:
        scheduler: Time of power-on and brake delays.
        machine: State machine.
        axis: The motor as the profile sees it.

    """

    def __init__(self, scheduler: Scheduler, *, machine: PowerStateMachine, axis: ProfileAxis) -> None:
        self._scheduler = scheduler
        self.machine = machine
        self.axis = axis
        self.homing = Homing(axis)
        self.interpolation = InterpolatedPosition(axis)
        self.profile_velocity = ProfileVelocity(axis)
        modes: tuple[ModeOfOperation, ...] = (
            NoMode(axis),
            ProfilePosition(axis),
            Velocity(axis),
            self.profile_velocity,
            ProfileTorque(axis),
            self.homing,
            self.interpolation,
            CyclicPosition(axis),
            CyclicVelocity(axis),
            CyclicTorque(axis),
        )
        self.modes: Final = {mode.number: mode for mode in modes}
        """Every mode by its number in 6060h."""
        self.mode: ModeOfOperation = self.modes[0]
        """Mode in effect."""
        self.word = 0
        """Last control word."""
        self.local_control = False
        """Control words are ignored."""
        self.released = False
        """The brake is open: setpoints may pass."""
        self.limit_stop = False
        """A stop at a limit switch is under way."""
        self.following = False
        """The mode executes its setpoints."""
        self.on_fault_reset: Callable[[], None] = _nothing
        """Called after transition 15."""
        self.on_following: Callable[[], None] = _nothing
        """Called when setpoints begin to count."""
        self.on_change: Callable[[], None] = _nothing
        """Called after a change that was not caused by a call from outside."""
        self._closing_timer: Timer | None = None
        self._power_timer: Timer | None = None
        self._unseen_cycles = 0
        self._early_edges = 0
        """Bits of the mode that have risen while the brake opens, and are still set."""
        axis.core.on_standstill = self._on_standstill

    # -- from outside ----------------------------------------------------------------------------------

    def start(self) -> None:
        """Begin as after power-on: everything off, no mode."""
        self.off()
        self.mode = self.modes[0]
        self.word = self.axis.control_word = 0
        self.machine.start()

    def control(self, word: int) -> None:
        """Take a control word."""
        machine = self.machine
        changed = word ^ self.word
        self.word = self.axis.control_word = word
        machine.remote = not self.local_control
        self.execute(machine.control(word))
        if self.axis.core.enabled and machine.follows_commands and not self.local_control:
            if bool(word & _HALT) is not self.axis.halted:
                self._halt(bool(word & _HALT))
            if changed & _MODE_BITS:
                if self.released:
                    self._control_mode(changed)
                else:
                    self._early_edges = (self._early_edges | changed & _MODE_BITS) & word

    def _control_mode(self, changed: int) -> None:
        """Have the mode look at its bits: the setpoint of the same PDO may stand behind the control word."""
        self._scheduler.at(
            self._scheduler.now, partial(self._mode_control, self.word, changed), priority=_MODE_PRIORITY
        )

    def _mode_control(self, word: int, changed: int) -> None:
        if self.released and self.axis.core.enabled and self.machine.follows_commands:
            self.mode.control(word, changed)
            self.on_change()

    def evaluate_again(self) -> None:
        """Evaluate the last control word again, because an obstacle is gone."""
        self.machine.release()
        if not self.word & 0x80:
            self.execute(self.machine.control(self.word))
        self._mode_control(self.word, 0)

    def change_mode(self, number: int) -> None:
        """Put another mode in effect (C402-089)."""
        mode = self.modes.get(number)
        if mode is None or mode is self.mode:
            return
        following = self.following
        self.mode.leave()
        self.mode = mode
        self.following = False
        self.settle()
        if following:
            self.axis.core.take_torque_offset(mode.torque_offset)
            mode.enter()

    def cycle(self) -> None:
        """Do the work of one control cycle."""
        machine = self.machine
        if machine.enable_follows:
            self._unseen_cycles += 1
            if self._unseen_cycles >= _UNSEEN_CYCLES:
                machine.status_seen = True
            self.execute(machine.cycle())
        if self.following:
            self.mode.cycle()
        elif self.axis.core.enabled:
            if not self.released and machine.follows_commands:
                self._release()
                self.settle()
            if self.released:
                self.mode.stopped()
            else:
                self.mode.waiting()

    def stop_at_limit_switch(self) -> None:
        """Stop with 6085h and stay in operation (C402-161)."""
        core = self.axis.core
        if not (self.axis.halted and core.stopping):
            core.stop(
                self.axis.stop_slope(StopOption.QUICK_STOP), track_position=self.mode.position_controlled
            )
        self.limit_stop = True
        self.settle()

    def execute(self, action: Action) -> None:
        """Do what the state machine asks for."""
        if action is Action.NOTHING:
            return
        core = self.axis.core
        machine = self.machine
        if action is Action.POWER_ON:
            self._unseen_cycles = 0
            delay_ns = seconds_to_ns(self.axis.config.power_on_delay_ms / 1000.0)
            if delay_ns:
                _cancel(self._power_timer)
                self._power_timer = self._scheduler.after(delay_ns, self._power_is_on)
            else:
                self.execute(machine.power_is_on())
        elif action is Action.ENABLE:
            core.enable_pulses()
            self.axis.halted = bool(self.word & _HALT)
            self.released = False
            self._release()
        elif action is Action.STOP:
            _cancel(self._closing_timer)
            self._closing_timer = None
            self.limit_stop = False
            self.mode.stop(machine.stop_option)
        elif action is Action.CONTINUE:
            _cancel(self._closing_timer)
            self._closing_timer = None
            core.brake.open()
            self.axis.halted = bool(self.word & _HALT)
            self.released = False
            self._release()
        elif action is Action.OFF:
            self.off()
        elif action is Action.FAULT_RESET:
            self.on_fault_reset()
        self.settle()

    def off(self) -> None:
        """Switch the torque off at once."""
        _cancel(self._closing_timer)
        _cancel(self._power_timer)
        self._closing_timer = self._power_timer = None
        self.axis.core.inhibit_pulses()
        self.mode.leave()
        self.released = False
        self._early_edges = 0
        self.limit_stop = False
        self.axis.halted = False
        self.following = False

    def settle(self) -> None:
        """Find out whether setpoints count now."""
        following = (
            self.released
            and self.axis.core.enabled
            and not self.axis.halted
            and not self.limit_stop
            and self.machine.follows_commands
        )
        if following is not self.following:
            self.following = following
            if following:
                self.on_following()
            else:
                self.axis.demand_excess = 0.0
                self.mode.limited = False

    # -- inside ----------------------------------------------------------------------------------------

    def _power_is_on(self) -> None:
        self._power_timer = None
        self.execute(self.machine.power_is_on())
        self.on_change()

    def _release(self) -> None:
        """Let setpoints through, as soon as the brake is open (C402-173)."""
        if self.axis.core.brake.closed:
            return
        self.released = True
        self.mode.enter()
        if self.axis.halted:
            self._stop_for_halt()
        if self._early_edges:
            # Who waits for an answer to them would wait forever.
            self._control_mode(self._early_edges)
            self._early_edges = 0

    def _halt(self, halted: bool) -> None:
        self.axis.halted = halted
        if halted:
            self._stop_for_halt()
        elif self.released and not self.limit_stop:
            self.mode.resume()
        self.settle()

    def _stop_for_halt(self) -> None:
        self.mode.stop(self.axis.halt_option)

    def _on_standstill(self) -> None:
        machine = self.machine
        if machine.ramping_down:
            brake = self.axis.core.brake
            if brake.fitted and machine.stop_leads_off and brake.closing_time_s > 0.0:
                # The motor holds the axis until the brake has closed.
                brake.close()
                self._closing_timer = self._scheduler.after(
                    seconds_to_ns(brake.closing_time_s), self._stop_finished
                )
            else:
                self._stop_finished()
        elif self.limit_stop:
            self.limit_stop = False
            if not self.axis.halted:
                self.mode.resume()
            self.settle()

    def _stop_finished(self) -> None:
        self._closing_timer = None
        self.execute(self.machine.stop_finished())
        self.on_change()


def _cancel(timer: Timer | None) -> None:
    if timer is not None:
        timer.cancel()


def _nothing() -> None:
    pass
