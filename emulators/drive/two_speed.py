"""A motor with two speeds and a brake, at contactors or at the inputs of an inverter. It knows no bus.

Its terminals are inputs by name: the wiring calls `set_terminal`. An I/O station does that on a bench.
"""

from __future__ import annotations

from enum import Enum
from typing import TYPE_CHECKING, ClassVar, Final

from emulators.drive.drive_train import build_drive_train
from emulators.drive.emulated_drive import ServoDrive
from emulators.drive.machine import BrakeConfig
from emulators.drive.tuning import RPM
from emulators.drive.two_speed_config import CONTACTORS, INVERTER, TERMINALS, TwoSpeedConfig
from emulators.trace import SERVO, Column, names_and_units, servo_values, value_texts
from fieldbus.clock import MS, Scheduler, Timer, seconds_to_ns
from fieldbus.errors import ConfigurationError, UnknownNameError
from fieldbus.history import History

if TYPE_CHECKING:
    import numpy as np

ILLEGAL_COMBINATION: Final = 0x9001
"""Number of the fault for terminals that contradict each other."""
EXTERNAL_FAULT: Final = 0x9000
"""Number of a fault that a test brings about without saying which."""


class TwoSpeedState(Enum):
    """What the motor is doing."""

    OFF = "Off"
    COASTING = "Coasting"
    """No speed is switched on, the brake is released."""
    SLOW = "Slow"
    FAST = "Fast"
    BRAKED = "Braked"
    FAULT = "Fault"


_NUMBERS: Final = {state: number for number, state in enumerate(TwoSpeedState)}
_COLUMNS: Final = (
    *SERVO,
    Column("encoder_increments", "inc"),
    Column("terminals"),
    Column("state", texts={number: state.value for state, number in _NUMBERS.items()}),
    Column("inputs"),
    Column("brake_closed"),
    Column("fault_number"),
)


class TwoSpeedDrive(ServoDrive):
    """An emulated motor with two speeds, and all that a test can do to it and its machine.

    Terminals that contradict each other, two directions or two speeds, trip it: the motor coasts until they
    are all off.

    Args:
        scheduler: Time of the bench.
        config: Motor and machine.
        name: Name in the history.
        history: Log; None for none.
        rng: Source of the encoder's noise; None: the encoder cannot be made noisy.

    """

    trace_enums: ClassVar = value_texts(_COLUMNS)

    def __init__(
        self,
        scheduler: Scheduler,
        config: TwoSpeedConfig,
        *,
        name: str,
        history: History | None = None,
        rng: np.random.Generator | None = None,
    ) -> None:
        period = max(1 * MS, config.servo_period_ns)
        train = build_drive_train(
            scheduler,
            mechanics=config.mechanics,
            switches=config.switches,
            encoder=config.encoder,
            brake=BrakeConfig(),
            tuning=config.tuning,
            servo_period_ns=config.servo_period_ns,
            rng=rng,
        )
        super().__init__(scheduler, name=name, history=history, train=train, control_period_ns=period)
        self.config = config
        self.terminals = dict.fromkeys(TERMINALS[config.two_speed.control], False)
        """Levels of the terminals by name."""
        self.terminals["brake"] = True
        self.digital_inputs.on_change = self._on_inputs
        self.powered = False
        self.state = TwoSpeedState.OFF
        self.braked = True
        """The brake is applied."""
        self.illegal = 0
        """Contradicting combinations of terminals so far."""
        self.fault_number = 0
        """Fault that is there; 0: none."""
        self._causes: set[int] = set()
        self._speed = 0.0
        self._period_s = period / 1e9
        self._brake_timer: Timer | None = None
        self.trace_columns = names_and_units(_COLUMNS, train.load_unit)
        """(name, unit) of the values of `trace_row`."""
        self.limit_torque(None)
        scheduler.every(period, self._step)

    def trace_row(self) -> tuple[float, ...]:
        """Return the present values of `trace_columns`."""
        core = self.core
        return servo_values(self.mechanics, core) + (  # noqa: RUF005 - a sum makes no list
            core.encoder.increments,
            sum(level << bit for bit, level in enumerate(self.terminals.values())),
            _NUMBERS[self.state],
            self.digital_inputs.value,
            self.braked,
            self.fault_number,
        )

    # -- life and terminals ----------------------------------------------------------------------------

    def power_on(self) -> None:
        """Switch the supply on."""
        if self.powered:
            return
        self.powered = True
        self.encoder.power_on(self.mechanics.motor_angle)
        self.core.reinitialise()
        self.core.enable_pulses()
        self.digital_inputs.read()
        self._apply_brake(applied=self.terminals["brake"])
        self._evaluate()

    def power_off(self) -> None:
        """Switch the supply off: the brake applies at once."""
        if self.powered:
            self.powered = False
            self._apply_brake(applied=True)
            self._enter(TwoSpeedState.OFF)

    def set_terminal(self, name: str, level: bool) -> None:
        """Change the level of a terminal.

        Raises:
            UnknownNameError: There is no such terminal.

        """
        if name not in self.terminals:
            raise UnknownNameError(self.name, name, "a terminal", self.terminals)
        if self.terminals[name] is level:
            return
        self.terminals[name] = level
        if name == "brake":
            if self._brake_timer is not None:
                self._brake_timer.cancel()
            delay = seconds_to_ns(self.config.two_speed.brake_delay_ms / 1000.0)
            self._brake_timer = self.scheduler.after(delay, self._brake_moves)
        self._evaluate()

    def _brake_moves(self) -> None:
        self._brake_timer = None
        self._apply_brake(applied=self.terminals["brake"] or not self.powered)
        self._evaluate()

    def _apply_brake(self, *, applied: bool) -> None:
        if applied is not self.braked:
            self.braked = applied
            self.emit("drive.brake", applied=applied)

    @property
    def _wanted(self) -> tuple[int, bool] | None:
        """Direction and whether it is to be fast; (0, False): no speed; None: the terminals contradict each
        other.
        """
        on = self.terminals
        if self.config.two_speed.control == "contactors":
            chosen = [name for name in CONTACTORS[:4] if on[name]]
            if len(chosen) > 1:
                return None
            if not chosen:
                return 0, False
            return (1 if chosen[0].startswith("plus") else -1), chosen[0].endswith("high")
        minus, plus, low, high = (on[name] for name in INVERTER[:4])
        if (minus and plus) or (low and high):
            return None
        if not (minus or plus) or not (low or high):
            return 0, False
        return (1 if plus else -1), high

    def _evaluate(self) -> None:
        wanted = self._wanted
        if wanted is None:
            if self.state is not TwoSpeedState.FAULT:
                self.illegal += 1
                on = ", ".join(name for name, level in self.terminals.items() if level)
                self.emit("drive.illegal_terminals", terminals=on)
                self._trip(ILLEGAL_COMBINATION)
            return
        if not self.powered:
            return
        direction, fast = wanted
        if self.state is TwoSpeedState.FAULT:
            if direction or self._causes:
                return
            self.fault_number = 0
        if self.braked:
            self._enter(TwoSpeedState.BRAKED)
        elif not direction:
            self._enter(TwoSpeedState.COASTING)
        else:
            self._enter(TwoSpeedState.FAST if fast else TwoSpeedState.SLOW)

    def _step(self) -> None:
        """Approach the speed that is switched on."""
        settings, state = self.config.two_speed, self.state
        target, time = 0.0, settings.coasting_s
        if self.braked:
            time = settings.braking_s
        elif state in {TwoSpeedState.FAST, TwoSpeedState.SLOW}:
            direction, fast = self._wanted or (0, False)
            target = direction * (settings.fast_rpm if fast else settings.slow_rpm)
            time = settings.time_constant_s
        speed = self._speed
        if speed != target:
            speed += (target - speed) * self._period_s / (self._period_s + time)
            self._speed = target if abs(speed - target) < 1e-3 else speed
            self.core.command_velocity(self._speed * RPM, 1)

    def _enter(self, state: TwoSpeedState) -> None:
        old = self.state
        if state is not old:
            self.state = state
            self.emit("drive.state", **{"from": old.value, "to": state.value})

    def _on_inputs(self, _before: int) -> None:
        self.emit("drive.inputs", inputs=self.digital_inputs.value)

    # -- faults ----------------------------------------------------------------------------------------

    def raise_fault(self, code: int = EXTERNAL_FAULT, *, persistent: bool = False) -> None:
        """Trip the motor protection: the motor coasts, until all terminals are off.

        Args:
            code: Number that the recorder shows, 1..65535.
            persistent: The cause stays until `clear_fault_cause`.

        """
        if not 1 <= code <= 0xFFFF:
            raise ConfigurationError(f"{self.name}: fault number", code, "1..65535")
        if persistent:
            self._causes.add(code)
        self._trip(code)

    def _trip(self, code: int) -> None:
        self.fault_number = code
        self.emit("drive.fault", number=code)
        self._enter(TwoSpeedState.FAULT)

    def clear_fault_cause(self, code: int | None = None) -> None:
        """End the cause of a persistent fault, or of all."""
        if code is None:
            self._causes.clear()
        else:
            self._causes.discard(code)
        self._evaluate()

    def limit_torque(self, share: float | None) -> None:
        """Limit the torque to a share of the rated one; None: three times it."""
        limit = self.config.rated_torque_nm * (3.0 if share is None else share)
        self.core.set_torque_limits(limit, limit)
