"""What a technology axis consists of, made of its variables: ratios, limits, encoders, controller, transfer
of parameters.
"""

from __future__ import annotations

from math import inf
from typing import TYPE_CHECKING, ClassVar, Final, cast

from motion.drives.encoder import EncoderPort
from motion.kernel.backlash import Backlash
from motion.kernel.feedback import NO_FEEDBACK, EncoderSource, Feedback
from motion.kernel.leading_value import LeadingValue
from motion.kernel.mechanics import INCREMENTAL, MOTOR_SIDE, Mechanics
from motion.kernel.modulo import NO_MODULO, Modulo
from motion.kernel.monitoring import Monitoring
from motion.kernel.position_control import LEAST_GAIN, PositionController
from motion.kernel.setpoint_filter import DynamicFilter
from motion.kernel.simulation import SimulatedController, SimulatedFeedback, SimulatedPort, VirtualController
from motion.s7.axis.adaption import Adaption
from motion.s7.axis.configuration import (
    DSC_TELEGRAMS,
    Abilities,
    Problem,
    check_configuration,
    check_telegrams,
    doubts,
    setpoint_range,
)
from motion.s7.axis.limits import TravelLimits
from motion.s7.axis.torque import TORQUE_DATA, TorqueControl

if TYPE_CHECKING:
    from fieldbus.history import History
    from motion.drives.port import DrivePort
    from motion.s7.axis.axis import TechnologyAxis
    from motion.s7.axis.control_words import ControlWords
    from motion.s7.axis.reactions import AxisAlarms
    from motion.s7.variables import VariableStore

ALARM_ADDRESS: Final = 109
ALARM_ADJUSTED: Final = 110
_STANDS: Final = 1e-6
"""Axis units per second that are none, whatever the standstill threshold is."""
ALARM_VELOCITY_UNREACHABLE: Final = 551
_DATA_EXCHANGE: Final = 9
"""Cause of alarm 109: telegram 750 (TA-013)."""
_ROUNDING: Final = 1.0 + 1e-9


class AxisAssembly:
    """Base of `TechnologyAxis`, which fills in what is declared here; see there."""

    object_type: ClassVar[str] = ""
    kinds: ClassVar[tuple[str, ...]] = ()
    """Types of technology objects as which instructions take it: its own, and the one whose functions it
    contains.
    """
    has_position: ClassVar[bool] = False

    name: str
    history: History | None
    variables: VariableStore
    drive_port: DrivePort
    port: DrivePort
    encoder_ports: tuple[EncoderPort | DrivePort, ...]
    connection: str
    cpu: str
    cycle_s: float
    interpolator_s: float
    alarms: AxisAlarms
    control_words: ControlWords
    sensors: tuple[Feedback, ...]
    backlashes: tuple[Backlash, ...]
    operative_sensor: int
    encoder_apart: EncoderSource | None
    simulated: bool
    virtual: bool
    homed: bool
    adaption: Adaption | None
    leading_value: LeadingValue
    """What followers get, of an axis with position."""
    _leading: LeadingValue | None
    _direct_delay_s: float

    @property
    def _axis(self) -> TechnologyAxis:
        return cast("TechnologyAxis", self)

    def check(self, *, start: bool) -> list[Problem]:
        """Return what does not fit together, in the values in force or in the start values of the next
        restart.
        """
        read = self.variables.start_value if start else self.variables.read
        port = self.drive_port
        number = port.telegram_number
        abilities = Abilities(
            dsc=port.dsc
            and (not number or number in DSC_TELEGRAMS)
            and (not self.has_position or self.encoder_ports[0] is port),
            interfaces=tuple(one.interface_number for one in self.encoder_ports),
            velocities=tuple(one.brings_speed for one in self.encoder_ports),
            simulated=read("VirtualAxis.Mode") == 1 or read("Simulation.Mode") == 1,
            analog=port.analog,
        )
        problems = check_configuration(self.variables, abilities, cpu=self.cpu, start=start)
        if number and not abilities.simulated:
            apart = [one for one in self.encoder_ports if one is not port and one.interface_number == 1]
            own = tuple(one.telegram_number or 81 for one in apart) if self.has_position else ()
            unfit = check_telegrams(self.object_type, number, own)
            if unfit is not None:
                problems.insert(0, unfit)
        return problems

    def apply_configuration(self, *, powered_off: bool = False) -> None:
        """Derive everything from the variables, at start and after a restart.

        Args:
            powered_off: The controller has been without supply: nothing is kept but what is retentive.

        """
        store = self.variables
        self.virtual = store.read("VirtualAxis.Mode") == 1
        self.simulated = simulated = self.virtual or store.read("Simulation.Mode") == 1
        if self.has_position:
            self.operative_sensor = store.read("PositionControl.InitialOperativeSensor")
        self.torque = TorqueControl(self._axis)
        self.control_words.release()
        self.derive(restart=True, powered_off=powered_off)
        if self.has_position:
            self.limits.check_addresses()
        if store.read(TORQUE_DATA) and not simulated and not self.drive_port.has_torque_data:
            self.alarms.raise_alarm(
                ALARM_ADDRESS, info=_DATA_EXCHANGE, text=f"{TORQUE_DATA} is TRUE without telegram 750"
            )
        self.homed = (
            self.has_position
            and not simulated
            and self.feedback.scale.kind != INCREMENTAL
            and store.read(f"StatusSensor[{self.operative_sensor}].Adjusted") == 1
        )
        if self.adaption is not None:
            self.adaption.close()
        sources = self.encoder_ports if self.has_position else ()
        adaption = Adaption(
            store,
            self.drive_port,
            sources,
            self.alarms,
            self.derive,
            simulated=simulated,
            name=self.name,
            history=self.history,
        )
        self.adaption = adaption
        self._adapting = adaption if adaption.active else None
        if self.history is not None:
            for doubt in doubts(store):
                self.history.emit(self.name, "axis.doubt", text=str(doubt))

    def derive(self, *, restart: bool = False, powered_off: bool = False) -> None:
        """Derive ratios, limits and encoders from the variables in force.

        Without a `restart` an encoder whose data have not changed goes on as it is.
        """
        store = self.variables
        apart = [isinstance(one, EncoderPort) and one.interface_number == 1 for one in self.encoder_ports]
        self.mechanics = mechanics = Mechanics(store, apart=apart)
        limits = setpoint_range(store)
        self._max_speed = limits.maximum
        if limits.adjusted:
            self.alarms.raise_alarm(ALARM_ADJUSTED, info=1, text=limits.adjusted)
        wanted = store.bind("DynamicLimits.MaxVelocity").value * abs(mechanics.rpm_per_unit)
        if not self.simulated and wanted > limits.maximum * _ROUNDING:
            self.alarms.raise_alarm(
                ALARM_VELOCITY_UNREACHABLE,
                text=f"DynamicLimits.MaxVelocity needs {wanted:g}, the drive has {limits.maximum:g}",
            )
        self.modulo = NO_MODULO
        if self.simulated:
            self.port = port = SimulatedPort(self.cycle_s, mechanics.rpm_per_unit)
            # Jobs about torque are accepted as with the drive, though it gets nothing (STP-159).
            port.has_torque_data = self.drive_port.has_torque_data
            port.has_torque_reduction = self.drive_port.has_torque_reduction
        else:
            self.port = self.drive_port
            self.port.set_reference(limits.reference, limits.torque)
        self.delay_s = self._delay()
        self.encoder_apart = None
        if not self.has_position:
            self.feedback = NO_FEEDBACK
            return
        self.modulo = modulo = Modulo(store)
        # Followers need two servo cycles per modulo range (STP-113).
        self._axis.motion.leading_limit = (
            modulo.length / (2.0 * self.cycle_s) if modulo.enabled and self._gives_leading_value() else inf
        )
        before = self.sensors or (None,) * 4
        offsets = [
            store.bind(f"{one.prefix.replace('Sensor', 'StatusSensor')}.AbsEncoderOffset")
            for one in mechanics.sensors
        ]
        if self.simulated:
            feedbacks = tuple(
                SimulatedFeedback(port, scale, self.cycle_s, cell, None if powered_off else old)
                for scale, cell, old in zip(mechanics.sensors, offsets, before, strict=False)
            )
            port.feedbacks = feedbacks
            self.sensors = feedbacks
        else:
            sensors: list[Feedback] = []
            for source, scale, cell, old in zip(
                self.encoder_ports, mechanics.sensors, offsets, before, strict=False
            ):
                if isinstance(source, EncoderPort):
                    source.set_reference(scale.reference)
                if old is not None and not restart and old.scale == scale:
                    sensors.append(old)
                    continue
                sensors.append(
                    Feedback(source, scale, self.cycle_s, cell, before=old, powered_off=powered_off)
                )
                self.homed = False
            self.sensors = tuple(sensors)
        for number, sensor in enumerate(self.sensors, start=1):
            adjusted = f"StatusSensor[{number}].Adjusted"
            if self.virtual:
                store.set_internal(adjusted, 1)
            elif sensor.scale.kind == INCREMENTAL:
                store.set_internal(adjusted, 0)
        self.backlashes = tuple(
            Backlash(self._axis, sensor, sensor.scale.prefix)
            for sensor in self.sensors
            if not self.simulated and self.variables.read(f"{sensor.scale.prefix}.MountingMode") == MOTOR_SIDE
        )
        self._build_control()
        self.take_sensor(self.operative_sensor)
        self.leading_value = LeadingValue(
            store,
            cycle_s=self.interpolator_s,
            acquisition_s=self.acquisition_s,
            feedback=lambda: self.feedback,
            setpoint=self._axis.motion.setpoint,
        )
        self._leading = self.leading_value.in_use()

    def _gives_leading_value(self) -> bool:
        """Return whether the axis may lead others: it is configured to put out its leading value."""
        read = self.variables.read
        output = "CrossPlcSynchronousOperation.Interface[{}].EnableLeadingValueOutput"
        return any(read(output.format(number)) for number in range(1, 33))

    def _delay(self) -> float:
        """Return T_i + T_o + T_DC + T_servo, s: of a direct connection as it is, of a data block as it is
        told (CFG-263).
        """
        if self.simulated:
            return self.cycle_s
        if self.connection == "data_block":
            return self.cycle_s + sum(
                float(self.variables.parameter(one).value) for one in (1010, 1011, 1012)
            )
        return self._direct_delay_s

    @property
    def acquisition_s(self) -> float:
        """T_i, how old an actual value is when the axis takes it, s; of a direct connection half of what is
        not T_servo.
        """
        if self.connection == "data_block" and not self.simulated:
            return float(self.variables.parameter(1010).value)
        return max(0.0, 0.5 * (self.delay_s - self.cycle_s))

    def setpoint_execution_s(self) -> float:
        """`StatusPositioning.SetpointExecutionTime`: T_ipo, T_vtc or 1 / Kv, T_o and T_DC, s (VAR-115,
        SYN-063).
        """
        read = self.variables.bind
        if read("PositionControl.Kpc").value > 0.0:
            lag = read("DynamicAxisModel.VelocityTimeConstant").value
        else:
            lag = 1.0 / max(read("PositionControl.Kv").value, LEAST_GAIN)
        return float(self.interpolator_s + self.delay_s - self.cycle_s - self.acquisition_s + lag)

    def _build_control(self) -> None:
        """Make controller, monitoring and limits."""
        store = self.variables
        bind = store.bind
        self._dsc = store.read("PositionControl.EnableDSC") and not self.simulated
        self.controller: PositionController | VirtualController
        dynamic_filter = DynamicFilter.of(store, self.cycle_s, precontrol=self.torque.precontrols)
        if isinstance(self.port, SimulatedPort):
            self.controller = (
                VirtualController(self.port, dynamic_filter)
                if self.virtual
                else SimulatedController(self.port, store, self.cycle_s, dynamic_filter)
            )
        else:
            self.controller = PositionController(
                kv=bind("PositionControl.Kv"),
                kpc=bind("PositionControl.Kpc"),
                time_constant=bind("DynamicAxisModel.VelocityTimeConstant"),
                additional_delay=bind("FollowingError.AdditionalSetpointDelayTime"),
                smoothing=bind("PositionControl.SmoothingTimeByChangeDifference"),
                cycle_s=self.cycle_s,
                delay_s=self.delay_s,
                dynamic_filter=dynamic_filter,
                in_drive=self._dsc,
            )
        self.monitoring = Monitoring(self._axis, self.interpolator_s)
        self.limits = TravelLimits(self._axis)
        self._rest_threshold = bind("StandstillSignal.VelocityThreshold")

    @property
    def rest_velocity(self) -> float:
        """Velocity up to which the axis counts as standing, axis unit per second."""
        return max(float(self._rest_threshold.value), _STANDS)

    def take_sensor(self, number: int) -> None:
        """Control the position with encoder `number` from now on."""
        self.operative_sensor = number
        self.feedback = self.sensors[number - 1]
        source = self.feedback.source
        self.encoder_apart = None if source is self.port else source
        self.controller.quantum = self._control_quantum()

    def _control_quantum(self) -> float:
        """Return the quantum of the control difference, axis unit: none, the encoder's resolution, or a value
        (CFG-379 to 381).
        """
        read = self.variables.read
        mode = read("PositionControl.ControlDifferenceQuantization.Mode")
        if mode == 1:
            return abs(self.feedback.scale.increment)
        return float(read("PositionControl.ControlDifferenceQuantization.Value")) if mode == 2 else 0.0
