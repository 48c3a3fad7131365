"""A stepper drive behind a channel of the TM PTO: power stage, motor, travel with switches and end stops. It
knows no bus.

The shaft stands where the pulses say while the motor is in step (`emulators.io.tm_pto.stepper`). It falls out
of step when it is overloaded, blocked, at an end stop, or without current; the pulse counter, which is the
encoder of the axis, knows nothing of it.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Final

from emulators.drive.inputs import DigitalInputs
from emulators.drive.keys import PullOutTorqueKeys
from emulators.drive.machine import LinearAxisConfig, RotaryAxisConfig, SwitchesConfig, build_machine
from emulators.drive.profidrive.statemachine import AxisState
from emulators.drive.pto_settings import PtoSettings
from emulators.drive.tuning import RPM
from emulators.io.tm_pto import PtoConfig, PtoModule, StepperConfig, StepperMotor
from emulators.mechanics import AxisMechanics, SwitchModel
from emulators.trace import LOAD, Column
from fieldbus.clock import US, Scheduler, Timer, seconds_to_ns
from fieldbus.errors import ConfigurationError
from fieldbus.history import History

_TAU: Final = 2.0 * math.pi
_NUMBERS: Final = {state: number for number, state in enumerate(AxisState)}


@dataclass(frozen=True, kw_only=True)
class StepperDriveConfig(PullOutTorqueKeys):
    """Channel 0 of a module with its motor and machine; channel 1 has no motor.

    Args:
        channel: Channel 0, with what its settings say of the motor.
        other: Channel 1.
        mechanics: Machine: transmission, inertia, friction, end stops.
        switches: Switches on the travel of a linear axis. `home` is wired to RS, `probe1` to MI.
        servo_period_ns: How often motor and machine are looked at, ns.

    Raises:
        ConfigurationError: A value is out of its range.

    """

    channel: PtoConfig = field(default_factory=PtoConfig)
    other: PtoConfig = field(
        default_factory=lambda: PtoConfig(settings=PtoSettings(use_ed=False, use_dr=False))
    )
    mechanics: LinearAxisConfig | RotaryAxisConfig = field(
        default_factory=lambda: LinearAxisConfig(
            motor_inertia_kgm2=3e-5, screw_inertia_kgm2=1e-5, load_mass_kg=5.0
        )
    )
    switches: SwitchesConfig = field(default_factory=SwitchesConfig)
    servo_period_ns: int = 250 * US

    def __post_init__(self) -> None:
        if self.servo_period_ns <= 0:
            raise ConfigurationError("stepper servo_period_ns", self.servo_period_ns, "> 0")
        self.motor(1.0)

    def motor(self, inertia: float) -> StepperConfig:
        """Return the motor with an inertia at its shaft, kg m^2."""
        settings = self.channel.settings
        return StepperConfig(
            increments=self.channel.increments,
            full_steps=settings.full_steps,
            holding_torque=self.rated_torque_nm,
            corner_hz=settings.corner_hz,
            start_stop_hz=settings.start_stop_hz,
            inertia=inertia,
            friction=0.0,
        )


def signal_output_config(
    increments: int, reference_speed_rpm: float, *, servo_period_ns: int = 250 * US
) -> StepperDriveConfig:
    """Return an encoder-signal output in the manner of the TM41 (CFG-409): speed setpoints become edges of
    two tracks at once.

    It is a channel without ramp, terminals and motor, in the standard telegram 3;
    what turns is the encoder signal.

    Args:
        increments: Edges per revolution.
        reference_speed_rpm: Speed at 100 %, rpm.
        servo_period_ns: How often it is looked at, ns.

    Raises:
        ConfigurationError: The tracks cannot carry so many edges.

    """
    channel = PtoConfig(
        settings=PtoSettings(
            variant="standard",
            signals="ab_fourfold",
            reference_speed_rpm=reference_speed_rpm,
            use_ed=False,
            use_dr=False,
            full_steps=4,
        ),
        increments=increments,
        maximum_speed=reference_speed_rpm,
        ramp_stop_ms=1,
        quick_stop_ms=1,
    )
    return StepperDriveConfig(
        channel=channel,
        mechanics=RotaryAxisConfig(
            motor_inertia_kgm2=1e-9, load_inertia_kgm2=0.0, coulomb_friction=0.0, viscous_friction=0.0
        ),
        rated_torque_nm=1e9,
        servo_period_ns=servo_period_ns,
    )


class StepperTravel:
    """The load behind the shaft of a stepper motor: friction, forces, end stops, switches.

    Args:
        config: Machine.
        plant: The same machine as built, with its switches.
        motor: Its motor.

    """

    def __init__(
        self,
        config: LinearAxisConfig | RotaryAxisConfig,
        plant: AxisMechanics,
        motor: StepperMotor,
    ) -> None:
        self._motor = motor
        self.ratio: Final = plant.ratio
        """Load units per radian of the shaft."""
        self._start = plant.position
        if isinstance(config, LinearAxisConfig):
            self._coulomb, self._viscous = config.coulomb_friction_n, config.viscous_friction_n_per_m_s
            self._gravity = config.gravity_n
        else:
            self._coulomb, self._viscous = config.coulomb_friction, config.viscous_friction
            self._gravity = config.load_torque
        self._force = 0.0
        self._jammed = False
        self._lower, self._upper = plant.stops
        self.switches = plant.switches
        self.position = self._start
        """Of the load, m or rad."""
        self.velocity = 0.0
        """Of the load, m/s or rad/s."""
        for switch in self.switches:
            switch.update(self.position)

    @property
    def motor_speed(self) -> float:
        """Speed of the shaft, rad/s."""
        return self.velocity / self.ratio

    @property
    def motor_angle(self) -> float:
        """True angle of the shaft, rad; zero where the load is at zero."""
        return self.position / self.ratio

    def jam(self, jammed: bool) -> None:
        """Block the shaft, or release it."""
        self._jammed = jammed

    def apply_force(self, force: float) -> None:
        """Set the force from outside on the load, N or Nm, positive in positive direction."""
        self._force = force

    def set_stops(self, lower: float | None, upper: float | None) -> None:
        """Place or remove (None) the end stops, load unit."""
        if lower is not None and upper is not None and not lower < upper:
            raise ConfigurationError("end stops", (lower, upper), "lower < upper")
        self._lower, self._upper = lower, upper

    def step(self, speed: float) -> None:
        """Go on to where the pulses are; `speed`: what they command, rad/s of the shaft."""
        motor = self._motor
        if self._jammed:
            motor.load_torque = math.inf
        else:
            against = self._viscous * speed * self.ratio - self._gravity - self._force
            if speed:
                against += math.copysign(self._coulomb, speed * self.ratio)
            motor.load_torque = against * self.ratio
        motor.follow()
        position = self._start + motor.angle * self.ratio
        for stop, beyond in ((self._lower, -1.0), (self._upper, 1.0)):
            if stop is not None and (position - stop) * beyond > 0.0:
                motor.stand((stop - self._start) / self.ratio)
                position = self._start + motor.angle * self.ratio
        self.velocity = 0.0 if motor.stalled else speed * self.ratio
        if position != self.position:
            self.position = position
            for switch in self.switches:
                switch.update(position, moving=True)


COLUMNS: Final = (
    Column("position", LOAD),
    Column("velocity", f"{LOAD}/s"),
    Column("motor_speed", "rpm"),
    Column("torque", "Nm"),
    Column("encoder_increments", "inc"),
    Column("lost_increments", "inc"),
    Column("out_of_step"),
    Column("pulse_speed", "rpm"),
    Column("setpoint_speed", "rpm"),
    Column("drive_stw1"),
    Column("drive_zsw1"),
    Column("g1_stw"),
    Column("g1_zsw"),
    Column("enable_output"),
    Column("state", texts={number: state.text for state, number in _NUMBERS.items()}),
    Column("inputs"),
)
"""Columns of `StepperDrive.trace_row`."""


class StepperDrive:
    """Module, power stage, motor and machine.

    Args:
        scheduler: Time of the bench.
        config: All of them.
        name: Name in the history.
        history: Log; None for none.

    """

    def __init__(
        self, scheduler: Scheduler, config: StepperDriveConfig, *, name: str, history: History | None = None
    ) -> None:
        self._scheduler = scheduler
        self._history = history
        self.name = name
        self.config = config
        self.module = PtoModule(
            scheduler, (config.channel, config.other), watchdog_cycles=config.channel.settings.watchdog_cycles
        )
        self.channel = self.module.channels[0]
        plant, self.switches = build_machine(config.mechanics, config.switches)
        self.motor = StepperMotor(self.channel.generator, config.motor(plant.motor_inertia))
        self.mechanics = StepperTravel(config.mechanics, plant, self.motor)
        self.digital_inputs = DigitalInputs(scheduler, self.switches, filter_s=config.switches.filter_s)
        self.digital_inputs.on_change = self._on_inputs
        self.digital_inputs.on_probe = self._on_probe
        self.on_inputs: Callable[[], object] | None = None
        """Called when the switches of the machine have changed."""
        self._per_hertz = _TAU / config.channel.increments
        self._shown = self.channel.state
        self._enabled = False
        self._ready: bool | None = None
        self._ready_timer: Timer | None = None
        self._ready_delay_ns = seconds_to_ns(config.channel.settings.ready_delay_ms / 1000.0)
        self._stalled = False
        self._fault = False
        scheduler.every(config.servo_period_ns, self._step)

    # -- machine ---------------------------------------------------------------------------------------

    def _step(self) -> None:
        channel = self.channel
        generator = channel.generator
        generator.advance(self._scheduler.now)
        if channel.ed is not self._enabled:
            self._power_stage(channel.ed)
        self.mechanics.step(generator.frequency * self._per_hertz)
        if self.motor.stalled is not self._stalled:
            self._stalled = self.motor.stalled
            self.emit("drive.out_of_step" if self._stalled else "drive.in_step", lost=self.motor.lost)

    def _power_stage(self, enabled: bool) -> None:
        """Let the power stage follow ED: current in the windings, and its ready signal."""
        self._enabled = enabled
        if not self.config.channel.settings.use_ed:
            return
        self.motor.energised = enabled
        if self._ready_timer is not None:
            self._ready_timer.cancel()
            self._ready_timer = None
        if enabled and self._ready_delay_ns:
            self._ready_timer = self._scheduler.after(self._ready_delay_ns, self._set_ready)
        else:
            self._set_ready()

    def _set_ready(self) -> None:
        self._ready_timer = None
        level = self._enabled or not self.config.channel.settings.use_ed
        self.channel.drive_input("DR", level if self._ready is None else self._ready)

    def force_ready(self, level: bool | None) -> None:
        """Bring a level to DR, whatever the power stage does; None: its own again."""
        self._ready = level
        self._set_ready()

    def lose_steps(self, periods: int) -> None:
        """Let the shaft slip by whole electrical periods of four full steps; positive: it lags behind."""
        self.motor.slip(periods)
        self.emit("drive.slipped", lost=self.motor.lost)

    def restart(self) -> None:
        """Begin as after power-on."""
        self.channel.restart()
        self.motor.energised = not self.config.channel.settings.use_ed
        self._enabled = False
        self._set_ready()
        self.digital_inputs.read()
        self.log_changes()

    def _on_inputs(self, before: int) -> None:
        value = self.digital_inputs.value
        self.emit("drive.inputs", inputs=value)
        if (value ^ before) & 4:
            self.channel.drive_input("RS", bool(value & 4))
        if self.on_inputs is not None:
            self.on_inputs()

    def _on_probe(self, number: int, switch: SwitchModel) -> None:
        if number == 1:
            self.channel.drive_input("MI", switch.state)

    # -- evidence --------------------------------------------------------------------------------------

    def log_changes(self) -> None:
        """Write what has changed since the last bus cycle into the log."""
        state, fault = self.channel.state, self.channel.fault
        if state is not self._shown:
            self.emit("drive.state", **{"from": self._shown.text, "to": state.text})
            self._shown = state
        if fault is not self._fault:
            self._fault = fault
            if fault:
                self.emit("drive.fault", number=1, text="error at a digital output")
            else:
                self.emit("drive.fault_acknowledged")

    def trace_row(self) -> tuple[float, ...]:
        """Return the present values; position, velocity and speed are those of the
        true shaft and load (STP-550).
        """
        mechanics, motor = self.mechanics, self.motor
        _, stw1, zsw1, setpoint, speed, g1_stw, g1_zsw, enable, count = self.channel.trace_row()
        torque = motor.needed_torque()
        return (
            mechanics.position,
            mechanics.velocity,
            mechanics.motor_speed / RPM,
            0.0 if motor.stalled else torque,
            count,
            motor.lost,
            motor.stalled,
            speed,
            setpoint,
            stw1,
            zsw1,
            g1_stw,
            g1_zsw,
            enable,
            _NUMBERS[self.channel.state],
            self.digital_inputs.value,
        )

    def emit(self, kind: str, **data: str | float | bool) -> None:
        """Write an event of this drive into the log, if there is one."""
        if self._history is not None:
            self._history.emit(self.name, kind, **data)
