"""A drive with an analog setpoint: a voltage in, an enable input, a ready output (STP-539, STP-540). It knows
no bus.

Terminals are attributes of the drive: the wiring calls `set_voltage` and `set_enable`, and listens to
`on_ready` and `on_inputs`. An I/O station does that on a bench.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from enum import Enum
from typing import TYPE_CHECKING, ClassVar, Final

from emulators.drive.analog_config import AnalogConfig
from emulators.drive.drive_train import build_drive_train
from emulators.drive.emulated_drive import ServoDrive
from emulators.drive.tuning import RPM
from emulators.trace import SERVO, Column, names_and_units, servo_values, value_texts
from fieldbus.clock import Scheduler, Timer, seconds_to_ns
from fieldbus.errors import ConfigurationError
from fieldbus.history import History

if TYPE_CHECKING:
    import numpy as np

EXTERNAL_FAULT: Final = 0x9000
"""Number of a fault that a test brings about without saying which."""


class AnalogState(Enum):
    """What the drive is doing."""

    OFF = "Off"
    STANDBY = "Standby"
    """No torque; it waits for the enable."""
    STARTING = "Starting"
    """Enabled; the ready output has not come yet."""
    OPERATION = "Operation"
    STOPPING = "Stopping"
    """The enable is away, its own ramp runs."""
    FAULT = "Fault"


_NUMBERS: Final = {state: number for number, state in enumerate(AnalogState)}
_LED: Final = frozenset({AnalogState.STARTING, AnalogState.OPERATION})
ReadyListener = Callable[[bool], object]


_COLUMNS: Final = (
    *SERVO,
    Column("encoder_increments", "inc"),
    Column("setpoint_voltage", "V"),
    Column("enable_input"),
    Column("ready_output"),
    Column("state", texts={number: state.value for state, number in _NUMBERS.items()}),
    Column("inputs"),
    Column("brake_closed"),
    Column("fault_number"),
)


class AnalogDrive(ServoDrive):
    """An emulated drive with an analog setpoint, and all that a test can do to it and its machine.

    It is off until `power_on`; the machine moves from the start. Without an enable input it follows the
    voltage as soon as it is on.

    Args:
        scheduler: Time of the bench.
        config: The drive and its machine.
        name: Name in the history.
        history: Log; None for none.
        rng: Source of the encoder's noise; None: the encoder cannot be made noisy.

    """

    trace_enums: ClassVar = value_texts(_COLUMNS)

    def __init__(
        self,
        scheduler: Scheduler,
        config: AnalogConfig,
        *,
        name: str,
        history: History | None = None,
        rng: np.random.Generator | None = None,
    ) -> None:
        train = build_drive_train(
            scheduler,
            mechanics=config.mechanics,
            switches=config.switches,
            encoder=config.encoder,
            brake=config.brake,
            tuning=config.speed_tuning,
            servo_period_ns=config.servo_period_ns,
            rng=rng,
        )
        super().__init__(
            scheduler,
            name=name,
            history=history,
            train=train,
            control_period_ns=config.control_period_ns,
        )
        self.config = config
        self.core.on_standstill = self._on_standstill
        self.digital_inputs.on_change = self._on_inputs
        self.on_ready: list[ReadyListener] = []
        """Called with every new level of the ready output."""
        self.on_inputs: list[Callable[[int], object]] = []
        """Called with the switches of the machine, bits as in `digital_inputs`, after every change."""
        self.powered = False
        self.state = AnalogState.OFF
        self.voltage = 0.0
        """At the setpoint input, V."""
        self.enabled = False
        """Level of the enable input."""
        self.fault_number = 0
        """Fault that is there or waits for a new enable; 0: none."""
        self._causes: set[int] = set()
        self._locked = False
        self._torque_off = False
        self._ready = False
        self._forced_ready: bool | None = None
        self._ready_timer: Timer | None = None
        self._share = 1.0
        self.trace_columns = names_and_units(_COLUMNS, train.load_unit)
        """(name, unit) of the values of `trace_row`."""
        self.limit_torque(None)

    def trace_row(self) -> tuple[float, ...]:
        """Return the present values of `trace_columns`; position, velocity and speed
        are those of the true mechanics.
        """
        core = self.core
        return servo_values(self.mechanics, core) + (  # noqa: RUF005 - a sum makes no list
            core.encoder.increments,
            self.voltage,
            self.enabled,
            self.ready,
            _NUMBERS[self.state],
            self.digital_inputs.value,
            core.brake.holding_torque_Nm > 0.0,
            self.fault_number,
        )

    # -- life ------------------------------------------------------------------------------------------

    def power_on(self) -> None:
        """Switch the supply on."""
        if self.powered:
            return
        self.powered = True
        self.encoder.power_on(self.mechanics.motor_angle)
        self.core.reinitialise()
        self.digital_inputs.read()
        self.fault_number = 0
        # An enable that was there before the supply came does not start the motor.
        self._locked = self.config.analog.enable_input and self.enabled
        self._enter(AnalogState.STANDBY)
        if self._causes:
            self._trip(min(self._causes))
        else:
            self._start()

    def power_off(self) -> None:
        """Switch the supply off at once: the motor coasts, the ready output falls."""
        if self.powered:
            self.powered = False
            self._inhibit()
            self._enter(AnalogState.OFF)

    # -- terminals -------------------------------------------------------------------------------------

    def set_voltage(self, volts: float) -> None:
        """Bring a voltage to the setpoint input, V.

        Raises:
            ConfigurationError: It is no finite number.

        """
        if not math.isfinite(volts):
            raise ConfigurationError(f"{self.name}: voltage", volts, "a finite number")
        self.voltage = volts
        if self.state is AnalogState.OPERATION:
            self._follow()

    def set_enable(self, level: bool) -> None:
        """Change the level at the enable input; without one nothing happens."""
        if level is self.enabled:
            return
        self.enabled = level
        if not self.config.analog.enable_input:
            return
        if level:
            self._start()
            return
        self._locked = False
        if self.state is AnalogState.FAULT and not self._causes:
            self.fault_number = 0
            self._enter(AnalogState.STANDBY)
        elif self.state in _LED:
            self._stop()

    @property
    def ready(self) -> bool:
        """Level of the ready output."""
        return self._ready if self._forced_ready is None else self._forced_ready and self.powered

    # -- inside ----------------------------------------------------------------------------------------

    @property
    def _wanted(self) -> bool:
        return (self.enabled or not self.config.analog.enable_input) and not self._locked

    def _start(self) -> None:
        startable = self.state in {AnalogState.STANDBY, AnalogState.STOPPING}
        if not (startable and self._wanted and not self._torque_off):
            return
        if self.state is AnalogState.STANDBY:
            self.core.enable_pulses()
        self._lead(0.0)
        self._enter(AnalogState.STARTING)
        if self.config.analog.ready_delay_ms:
            delay_ns = seconds_to_ns(self.config.analog.ready_delay_ms / 1000.0)
            self._ready_timer = self.scheduler.after(delay_ns, self._started)
        else:
            self._started()

    def _started(self) -> None:
        self._ready_timer = None
        self._enter(AnalogState.OPERATION)
        self._set_ready(True)
        self._follow()

    def _follow(self) -> None:
        self._lead(self.config.speed_rpm(self.voltage))

    def _lead(self, speed_rpm: float) -> None:
        self.core.command_velocity(speed_rpm * RPM, 1)

    def _stop(self) -> None:
        self._cancel_ready()
        config = self.config
        if config.analog.ready_falls == "enable":
            self._set_ready(False)
        if config.analog.stop == "coast":
            self._enter(AnalogState.STANDBY)
            self.core.inhibit_pulses()
            if config.analog.ready_falls == "standstill":
                self._watch_coasting()
            return
        self._enter(AnalogState.STOPPING)
        self.core.stop(config.max_speed_rpm * RPM / config.off3_ramp_s * self._share)

    def _watch_coasting(self) -> None:
        """Look whether the motor stands, while nothing else shows it."""
        if self.state is not AnalogState.STANDBY:
            return
        if self.core.standing:
            self._set_ready(False)
        else:
            self.scheduler.after(self.config.control_period_ns, self._watch_coasting)

    def _on_standstill(self) -> None:
        if self.state is not AnalogState.STOPPING:
            return
        self.core.inhibit_pulses()
        self._enter(AnalogState.STANDBY)
        if self.config.analog.ready_falls == "standstill":
            self._set_ready(False)

    def _inhibit(self) -> None:
        """Take torque and ready output away at once."""
        self._cancel_ready()
        self.core.inhibit_pulses()
        self._set_ready(False)

    def _cancel_ready(self) -> None:
        if self._ready_timer is not None:
            self._ready_timer.cancel()
            self._ready_timer = None

    def _set_ready(self, level: bool) -> None:
        before = self.ready
        self._ready = level
        self._tell_ready(before)

    def _tell_ready(self, before: bool) -> None:
        level = self.ready
        if level is not before:
            self.emit("drive.ready", value=level)
            for listener in self.on_ready:
                listener(level)

    def _enter(self, state: AnalogState) -> None:
        old = self.state
        if state is not old:
            self.state = state
            self.emit("drive.state", **{"from": old.value, "to": state.value})

    def _on_inputs(self, _before: int) -> None:
        value = self.digital_inputs.value
        self.emit("drive.inputs", inputs=value)
        for listener in self.on_inputs:
            listener(value)

    # -- faults ----------------------------------------------------------------------------------------

    def raise_fault(self, code: int = EXTERNAL_FAULT, *, persistent: bool = False) -> None:
        """Trip: the motor coasts and the ready output falls, until the enable has been taken away once.

        A drive without an enable input stays in its fault until its supply has been off.

        Args:
            code: Number that the recorder shows, 1..65535.
            persistent: The cause stays until `clear_fault_cause`.

        """
        if not 1 <= code <= 0xFFFF:
            raise ConfigurationError(f"{self.name}: fault number", code, "1..65535")
        if persistent:
            self._causes.add(code)
        if self.powered:
            self._trip(code)

    def _trip(self, code: int) -> None:
        self.fault_number = code
        self.emit("drive.fault", number=code)
        self._enter(AnalogState.FAULT)
        self._inhibit()

    def clear_fault_cause(self, code: int | None = None) -> None:
        """End the cause of a persistent fault, or of all; the fault itself waits for a new enable."""
        if code is None:
            self._causes.clear()
        else:
            self._causes.discard(code)
        if (
            self.state is AnalogState.FAULT
            and not self._causes
            and self.config.analog.enable_input
            and not self.enabled
        ):
            self.fault_number = 0
            self._enter(AnalogState.STANDBY)

    def set_sto(self, active: bool) -> None:
        """Activate or release safe torque off; the drive needs a new enable then."""
        self._torque_off = active
        if active and self.powered and self.state is not AnalogState.FAULT:
            self._locked = self.config.analog.enable_input and self.enabled
            self._enter(AnalogState.STANDBY)
            self._inhibit()
        elif not active:
            self._start()

    def force_ready(self, level: bool | None) -> None:
        """Show a level at the ready output, whatever the drive does; None: the true one again."""
        before = self.ready
        self._forced_ready = level
        self._tell_ready(before)

    def limit_torque(self, share: float | None) -> None:
        """Limit the torque to a share of the rated one; None = the peak torque of the drive."""
        limit = self.config.rated_torque_nm * (self.config.peak_torque if share is None else share)
        self.core.set_torque_limits(limit, limit)

    def scale_ramps(self, share: float) -> None:
        """Make the stop ramp with this share of its slope; 1 = as set."""
        self._share = share

    def break_encoder_wire(self, broken: bool) -> None:
        """Cut the wire of the encoder, for drive and controller: the count stands, and the drive trips; or
        repair it.
        """
        self.encoder.freeze(broken)
        if broken:
            self.raise_fault(0x7305, persistent=True)
        else:
            self.clear_fault_cause(0x7305)
