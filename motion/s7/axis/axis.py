"""Technology objects: what they are made of and what one application cycle does with it."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from math import inf
from typing import TYPE_CHECKING, ClassVar, Final

from typing_extensions import override

from fieldbus.errors import ConfigurationError
from motion.drives.encoder import EncoderPort
from motion.drives.port import INPUT_HOME, STW1
from motion.kernel.feedback import NO_FEEDBACK, EncoderFeedback, Feedback
from motion.kernel.mechanics import INCREMENTAL, MOTOR_SIDE
from motion.kernel.modulo import NO_MODULO
from motion.kernel.monitoring import Monitoring
from motion.kernel.position_control import LEAST_GAIN
from motion.kernel.servo_axis import ServoAxis
from motion.kernel.simulation import SimulatedFeedback, SimulatedPort
from motion.kernel.torque_limits import TorqueLimits
from motion.s7.axis.adaption import Adaption
from motion.s7.axis.alarms import AxisAlarms, MonitoringAlarms
from motion.s7.axis.assembly import (
    backlash_of,
    dynamic_filter_of,
    leading_value_of,
    mechanics_of,
    modulo_of,
    monitoring_limits_of,
    position_control_of,
    sensor_prefixes,
)
from motion.s7.axis.configuration import (
    DSC_TELEGRAMS,
    Abilities,
    Problem,
    check_configuration,
    check_telegrams,
    doubts,
    given_values,
    setpoint_range,
)
from motion.s7.axis.control_words import ControlWords
from motion.s7.axis.data_block import Shown, live_variables
from motion.s7.axis.dynamic_limits import DynamicLimits
from motion.s7.axis.enabling import EnableControl, EnableSettings
from motion.s7.axis.hardware_limits import HardwareLimits
from motion.s7.axis.homing.direct import home_directly
from motion.s7.axis.jobs import ERROR_ALARM
from motion.s7.axis.motion import PHASES, MotionControl
from motion.s7.axis.override import BEFORE_V9, V9
from motion.s7.axis.position_parts import PositionParts
from motion.s7.axis.ramp_times import RampTimes
from motion.s7.axis.reactions import Reactions
from motion.s7.axis.software_limits import SoftwareLimits
from motion.s7.axis.state import AxisState, AxisStates, DriveCommand
from motion.s7.axis.status import StatusWords
from motion.s7.axis.technology_object import ACTUAL, DELAYED, SETPOINT, TechnologyObject
from motion.s7.axis.torque import TORQUE_DATA, TorqueControl
from motion.s7.compatibility import level_of
from motion.s7.data_blocks import DataBlocks
from motion.s7.units import farthest_position
from motion.s7.variables import VariableStore

if TYPE_CHECKING:
    from fieldbus.history import History
    from motion.drives.port import DrivePort
    from motion.kernel.leading_value import LeadingValue, Value
    from motion.kernel.mechanics import Mechanics
    from motion.kernel.modulo import Modulo

CONNECTIONS: Final = ("direct", "data_block")

ALARM_ADDRESS: Final = 109
ALARM_ADJUSTED: Final = 110
ALARM_ACROSS: Final = 114
ALARM_SPEED_LIMITED: Final = 504
ALARM_VELOCITY_UNREACHABLE: Final = 551
_DATA_EXCHANGE: Final = 9
"""Cause of alarm 109: telegram 750 (TA-013)."""
_SAME_TIME_S: Final = 1e-9
_ROUNDING: Final = 1.0 + 1e-9
_PULSE_CYCLES: Final = 2
"""Cycles for which STW1.7 is shown at least."""
_DRIVE_TIMEOUT_NS: Final = 200_000_000
"""Time that the drive gets to withdraw its fault before the alarms are acknowledged all the same."""
_REACTION_REMOVE_ENABLE: Final = 4
_ACKNOWLEDGE: Final = int(STW1.ACKNOWLEDGE)

SWITCH_BUMPLESS: Final = 0
SWITCH_AS_IT_IS: Final = 1
TRANSFER: Final = 2
TRANSFER_FROM: Final = 3
"""Modes of `MC_SetSensor`."""

TRACE_COLUMNS: Final[tuple[tuple[str, str], ...]] = (
    ("position_setpoint", "mm"),
    ("velocity_setpoint", "mm/s"),
    ("acceleration_setpoint", "mm/s2"),
    ("actual_position", "mm"),
    ("actual_velocity", "mm/s"),
    ("following_error", "mm"),
    ("actual_speed", "rpm"),
    ("speed_output", "rpm"),
    ("actual_torque", "Nm"),
    ("status_word", ""),
    ("status_word2", ""),
    ("error_word", ""),
    ("warning_word", ""),
    ("alarm_number", ""),
    ("alarm_reaction", ""),
    ("state", ""),
    ("stw1", ""),
    ("zsw1", ""),
    ("power_status", ""),
    ("power_busy", ""),
    ("power_enable", ""),
    ("in_operation", ""),
    ("communication_ok", ""),
    ("filtered_position", "mm"),
    ("balanced_position", "mm"),
    ("control_difference", "mm"),
    ("permitted_following_error", "mm"),
    ("additive_torque", "Nm"),
)
"""Name and unit of every value, for an axis in mm with a standard motor."""
MODULO_COLUMNS: Final[tuple[tuple[str, str], ...]] = (
    ("modulo_position", "mm"),
    ("modulo_cycle", ""),
    ("actual_modulo_position", "mm"),
    ("actual_modulo_cycle", ""),
)
"""The same of an axis that has a modulo range when the bench starts: the places of setpoint and actual
position in it, and how often it lies below. The other positions of a trace grow without end.
"""
SYNCHRONOUS_COLUMNS: Final[tuple[tuple[str, str], ...]] = (
    ("leading_position", ""),
    ("leading_velocity", ""),
    ("leading_shift", ""),
    ("function_position", "mm"),
    ("leading_zero", ""),
    ("following_zero", "mm"),
    ("sync_phase", ""),
)
"""The same of a synchronous axis: leading value that its function gets, in the unit of the leading object, by
how much that is shifted, following position by the function, where the function has its zero, phase. Not a
number where the axis follows nothing.
"""


class TechnologyAxis(TechnologyObject):
    """Any axis: speed axis, positioning axis, synchronous axis.

    Args:
        name: Name in history and trace.
        port: Coupling to the drive.
        cycle_ns: Cycle of `MC_Servo`, ns.
        interpolator_ns: Cycle of `MC_Interpolator`, ns, a multiple of that; None = the same.
        variables: Start values by their original path, for example `{"DynamicLimits.MaxVelocity": 500.0}`.
        history: Event log, or None.
        delay_s: Time from a setpoint to the actual value that it makes, without the lag of the drive
            (`T_i + T_o + T_DC + T_servo`), s; default two cycles. With a data block the parameters 1010 to
            1012 say it.
        encoders: Where the values of `Sensor[1]`, `Sensor[2]`, ... come from; None = of one encoder, that
            of the drive.
        connection: `direct`, or `data_block`: a user program stands between telegram and axis (CFG
            section 13).
        cpu: Controller that the object belongs to, one of `motion.s7.compatibility.LEVELS`; it decides how
            many encoders an axis has (CFG-177) and what instructions offer.
        ramp_times: Ramps as times in s, in place of accelerations, by the
            names of `motion.s7.axis.ramp_times.RAMPS`.

    Raises:
        ConfigurationError: A variable does not exist, its value is out of range,
            or values do not fit together.

    """

    trace_columns: tuple[tuple[str, str], ...] = TRACE_COLUMNS
    trace_enums: ClassVar[dict[str, dict[int, str]]] = {"state": {int(s): s.name for s in AxisState}}

    def __init__(
        self,
        name: str,
        port: DrivePort,
        *,
        cycle_ns: int,
        interpolator_ns: int | None = None,
        variables: Mapping[str, object] | None = None,
        history: History | None = None,
        delay_s: float | None = None,
        encoders: Sequence[EncoderPort | DrivePort] | None = None,
        connection: str = "direct",
        cpu: str = "S7-1500T",
        ramp_times: Mapping[str, float] | None = None,
    ) -> None:
        if connection not in CONNECTIONS:
            raise ConfigurationError("connection", connection, ", ".join(CONNECTIONS))
        self.interpolator_ns = interpolator_ns or cycle_ns
        ratio, rest = divmod(self.interpolator_ns, cycle_ns)
        if rest or ratio < 1:
            raise ConfigurationError(
                "interpolator_ns", self.interpolator_ns, f"a multiple of the servo cycle of {cycle_ns} ns"
            )
        encoder_ports = (port,) if encoders is None else tuple(encoders)
        start_values = given_values(dict(variables or {}))
        store = VariableStore(
            self.object_type, start_values, sensors=len(encoder_ports), name=name, history=history
        )
        self._preset(store, start_values, port, encoder_ports)
        if ramp_times:
            store.on_start_value = RampTimes(store, ramp_times, start_values).follow
        self.alarms = AxisAlarms(name, self.object_type, history)
        super().__init__(name, store, self.alarms.engine, history)
        self.connection = connection
        self.cpu = cpu
        bind = store.bind
        self.servo = servo = ServoAxis(
            port,
            encoder_ports,
            cycle_s=cycle_ns * 1e-9,
            ratio=ratio,
            rest=bind("StandstillSignal.VelocityThreshold") if self.has_position else None,
        )
        """The axis in the kernel: actual values, setpoints, position control, drive port."""
        self._direct_delay_s = 2 * servo.cycle_s if delay_s is None else delay_s
        self.data_blocks = DataBlocks()
        """Global data blocks of the controller, of which a bit can be a limit switch."""
        self.homing_input = INPUT_HOME
        """Bit of the inputs that is reference cam or homing mark (`DigitalInputAddress`)."""
        self.station_inputs: Callable[[DrivePort], bool] | None = None
        """Puts the switches at an I/O station into the inputs of the port, once per
        cycle; returns whether it answers.
        """
        self.status_word = 0
        self.status_word2 = 0
        self._error_word_shown = 0
        self.stw1_sent = 0
        self.states = states = AxisStates(name, history, servo)
        self.command = command = DriveCommand()
        """Control word of the drive."""
        limits = DynamicLimits(store, self.alarms)
        self._dynamics = limits
        torque_limits = TorqueLimits(bind("TorqueLimiting.PositionBasedMonitorings"))
        monitoring = self._monitoring(torque_limits) if self.has_position else None
        self.motion = MotionControl(
            name,
            history,
            servo=servo,
            states=states,
            command=command,
            alarms=self.alarms,
            limits=limits,
            defaults=(bind("DynamicDefaults.Deceleration"), bind("DynamicDefaults.Jerk")),
            monitoring=monitoring,
            torque=torque_limits,
            homings=self.homings,
            overriding=BEFORE_V9 if level_of(cpu).before_v9 else V9,
        )
        """Jobs and ramps."""
        self._enabling = EnableControl(
            name,
            history,
            servo=servo,
            states=states,
            command=command,
            alarms=self.alarms,
            motion=self.motion,
            settings=EnableSettings(
                remove_enable=bind("Actor.RemoveEnableReaction"),
                velocity_mode=bind("PositionControl.VelocityModePowerOn") if self.has_position else None,
                max_deceleration=bind("DynamicLimits.MaxDeceleration"),
            ),
            adapted=lambda: self.adaption is None or self.adaption.ready,
        )
        self.reactions = Reactions(
            states=states,
            alarms=self.alarms,
            motion=self.motion,
            enabling=self._enabling,
            command=command,
            remove_enable=bind("Actor.RemoveEnableReaction"),
        )
        """What alarms do to the axis."""
        self.alarms.on_reaction = self.reactions.react
        self.control_words = ControlWords(name, history, servo, states)
        problems = self.check(start=False)
        if problems:
            raise problems[0].error(problems[1:])
        self.torque = TorqueControl(
            name,
            history,
            store,
            servo=servo,
            states=states,
            alarms=self.alarms,
            motion=self.motion,
            control_words=self.control_words,
            limits=torque_limits,
        )
        self.position = None if monitoring is None else self._position_parts(monitoring)
        """Monitoring and limits of travel; None without positions."""
        self.image_limits: HardwareLimits | None = None
        """Its limit switches, where they are inputs of the process image of the program (LIM-025)."""
        self._status = StatusWords(
            store,
            self.engine,
            servo=servo,
            states=states,
            command=command,
            motion=self.motion,
            torque=self.torque,
            homings=self.homings,
            position=self.position,
        )
        self.adaption: Adaption | None = None
        self._adapting: Adaption | None = None
        self.leading_value: LeadingValue | None = None
        """What followers get, of an axis with positions."""
        self._leading: LeadingValue | None = None
        self.leading_objects: tuple[TechnologyObject, ...] = ()
        """What a synchronous axis may follow: the interconnection of its leading values (SYN-014)."""
        self.hold_tolerance = 0.0
        """Way back of a leading value that is none while the axis synchronises or leaves it, position unit of
        the leading object (SYN-074).
        """
        self._interconnected = False
        self.couplings: dict[str, str] = {}
        """Types of coupling by the name of the leading object, where it is not the usual one (SYN-020)."""
        self.apply_configuration()
        self._live = self._readers = live_variables(
            Shown(
                variables=store,
                engine=self.engine,
                servo=servo,
                motion=self.motion,
                torque=self.torque,
                status_word=lambda: self._status.word(self.master),
                status_word2=self._status.word2,
                execution_s=self.setpoint_execution_s,
                leading_value=self._present_leading_value,
                follows=self.object_type == "SynchronousAxis",
                leader_number=self._leader_number,
            )
        )
        self._records_modulo = self.has_position and bool(store.read("Modulo.Enable"))
        if self.has_position:
            columns = self.trace_columns
            if self._records_modulo:
                own = len(TRACE_COLUMNS)
                columns = (*columns[:own], *MODULO_COLUMNS, *columns[own:])
            self.trace_columns = _columns(store, columns)

    def _preset(
        self,
        store: VariableStore,
        given: Mapping[str, object],
        port: DrivePort,
        encoders: Sequence[EncoderPort | DrivePort],
    ) -> None:
        """Take over what the devices say and the configuration does not."""
        if self.has_position:
            for number, one in enumerate(encoders, start=1):
                if f"Sensor[{number}].Type" not in given and one.absolute_encoder:
                    store.preset(f"Sensor[{number}].Type", 1)
                if f"Sensor[{number}].Interface.Number" not in given:
                    store.preset(f"Sensor[{number}].Interface.Number", one.interface_number)
        if TORQUE_DATA not in given:
            store.preset(TORQUE_DATA, port.has_torque_data)
        if port.analog and "Actor.Type" not in given:
            store.preset("Actor.Type", 0)

    def _monitoring(self, torque: TorqueLimits) -> Monitoring:
        servo = self.servo
        return Monitoring(
            servo,
            monitoring_limits_of(self.variables),
            torque,
            MonitoringAlarms(self.alarms),
            cycle_s=servo.interpolator_s,
        )

    def _position_parts(self, monitoring: Monitoring) -> PositionParts:
        return PositionParts(
            monitoring,
            HardwareLimits(
                self.variables,
                servo=self.servo,
                states=self.states,
                alarms=self.alarms,
                motion=self.motion,
                data_blocks=lambda: self.data_blocks,
            ),
            SoftwareLimits(
                self.variables,
                servo=self.servo,
                states=self.states,
                alarms=self.alarms,
                motion=self.motion,
                dynamics=self._dynamics,
            ),
        )

    # -- what it is made of, by its variables

    @override
    def check(self, *, start: bool) -> list[Problem]:
        read = self.variables.start_value if start else self.variables.read
        encoders = self.servo.encoder_ports
        port = self.servo.drive_port
        number = port.telegram_number
        abilities = Abilities(
            dsc=port.dsc
            and (not number or number in DSC_TELEGRAMS)
            and (not self.has_position or encoders[0] is port),
            interfaces=tuple(one.interface_number for one in encoders),
            velocities=tuple(one.brings_speed for one in encoders),
            simulated=read("VirtualAxis.Mode") == 1 or read("Simulation.Mode") == 1,
            analog=port.analog,
        )
        problems = check_configuration(self.variables, abilities, cpu=self.cpu, start=start)
        if number and not abilities.simulated:
            apart = [one for one in encoders if one is not port and one.interface_number == 1]
            own = tuple(one.telegram_number or 81 for one in apart) if self.has_position else ()
            unfit = check_telegrams(self.object_type, number, own)
            if unfit is not None:
                problems.insert(0, unfit)
        return problems

    @override
    def apply_configuration(self, *, powered_off: bool = False) -> None:
        store, servo = self.variables, self.servo
        virtual = store.read("VirtualAxis.Mode") == 1
        servo.virtual = virtual and not level_of(self.cpu).simulates_virtual_axes
        servo.simulated = simulated = virtual or store.read("Simulation.Mode") == 1
        if self.has_position:
            servo.operative_sensor = store.read_int("PositionControl.InitialOperativeSensor")
        self.torque.begin()
        self.control_words.release()
        self.derive(restart=True, powered_off=powered_off)
        if self.position is not None:
            self.position.hardware.check_addresses()
        if store.read(TORQUE_DATA) and not simulated and not servo.drive_port.has_torque_data:
            self.alarms.raise_alarm(
                ALARM_ADDRESS, info=_DATA_EXCHANGE, text=f"{TORQUE_DATA} is TRUE without telegram 750"
            )
        servo.homed = (
            self.has_position
            and not simulated
            and not self.incremental
            and store.read(f"StatusSensor[{servo.operative_sensor}].Adjusted") == 1
        )
        if self.adaption is not None:
            self.adaption.close()
        sources = servo.encoder_ports if self.has_position else ()
        adaption = Adaption(
            store,
            servo.drive_port,
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
        self.check_interconnections()

    def check_interconnections(self) -> None:
        """Compare the axis with what it may follow, once that is known and after every restart.

        Where it gives the value of a proxy to a further controller with another delay than that of the proxy,
        it is alarm 114 (SYN-304, SYN-393); torque precontrol behind the noise of actual values is a doubt
        (SYN-069).
        """
        for leader in self.leading_objects:
            delay = leader.local_delay_s
            if delay is not None and self._gives_leading_value():
                own = self.variables.read("CrossPlcSynchronousOperation.LocalLeadingValueDelayTime")
                if abs(delay - own) > _SAME_TIME_S:
                    text = f"LocalLeadingValueDelayTime is {own:g} s, that of {leader.name} is {delay:g} s"
                    self.alarms.raise_alarm(ALARM_ACROSS, text=text)
            noisy = self.coupling_with(leader) == ACTUAL and self.torque.precontrols
            if noisy and self.history is not None:
                text = f"TorquePreControl.Mode = 1 behind the actual value of {leader.name} (SYN-069)"
                self.history.emit(self.name, "axis.doubt", text=text)

    def derive(self, *, restart: bool = False, powered_off: bool = False) -> None:
        """Derive ratios, limits and encoders from the variables in effect.

        Without a `restart` an encoder whose data have not changed continues as it is.
        """
        store, servo = self.variables, self.servo
        apart = [isinstance(one, EncoderPort) and one.interface_number == 1 for one in servo.encoder_ports]
        servo.mechanics = mechanics = mechanics_of(store, apart=apart)
        limits = setpoint_range(store)
        servo.max_speed = limits.maximum
        if limits.adjusted:
            self.alarms.raise_alarm(ALARM_ADJUSTED, info=1, text=limits.adjusted)
        wanted = store.bind("DynamicLimits.MaxVelocity").value * abs(mechanics.rpm_per_unit)
        if not servo.simulated and wanted > limits.maximum * _ROUNDING:
            self.alarms.raise_alarm(
                ALARM_VELOCITY_UNREACHABLE,
                text=f"DynamicLimits.MaxVelocity needs {wanted:g}, the drive has {limits.maximum:g}",
            )
        simulated_port: SimulatedPort | None = None
        if servo.simulated:
            servo.port = simulated_port = SimulatedPort(servo.cycle_s, mechanics.rpm_per_unit)
            # Jobs about torque are accepted as with the drive, though it gets nothing (STP-159).
            simulated_port.has_torque_data = servo.drive_port.has_torque_data
            simulated_port.has_torque_reduction = servo.drive_port.has_torque_reduction
        else:
            servo.port = servo.drive_port
            servo.port.set_reference(limits.reference, limits.torque)
        servo.delay_s = self._delay()
        servo.modulo = NO_MODULO
        servo.encoder_apart = None
        position = self.position
        if position is None:
            servo.feedback = NO_FEEDBACK
            return
        servo.modulo = modulo = modulo_of(store)
        self._limit_leading()
        self._make_sensors(mechanics, simulated_port, restart=restart, powered_off=powered_off)
        servo.in_drive = store.read_bool("PositionControl.EnableDSC") and not servo.simulated
        servo.controller = position_control_of(
            store,
            simulated_port,
            dynamic_filter_of(store, servo.cycle_s, precontrol=self.torque.precontrols),
            virtual=servo.virtual,
            acceleration=servo.given_acceleration,
            cycle_s=servo.cycle_s,
            delay_s=servo.delay_s,
            in_drive=servo.in_drive,
        )
        position.monitoring.begin(modulo, farthest_position(store.read_int("Units.LengthUnit")))
        position.hardware.begin()
        position.software.begin()
        self.take_sensor(servo.operative_sensor)
        if servo.virtual:
            servo.controller.reset(servo.feedback.position)
        self.leading_value = leading_value_of(
            store,
            cycle_s=servo.interpolator_s,
            acquisition_s=self.acquisition_s,
            feedback=lambda: servo.feedback,
            setpoint=servo.setpoint,
        )
        self._leading = self.leading_value.in_use()

    def _make_sensors(
        self, mechanics: Mechanics, port: SimulatedPort | None, *, restart: bool, powered_off: bool
    ) -> None:
        store, servo = self.variables, self.servo
        prefixes = sensor_prefixes(store)
        before: Sequence[Feedback | None] = servo.sensors or (None,) * 4
        offsets = [store.bind(f"Status{prefix}.AbsEncoderOffset") for prefix in prefixes]
        if port is not None:
            simulated = tuple(
                SimulatedFeedback(port, scale, cell, None if powered_off else old)
                for scale, cell, old in zip(mechanics.sensors, offsets, before, strict=False)
            )
            port.feedbacks = simulated
            servo.sensors = simulated
        else:
            sensors: list[Feedback] = []
            for source, scale, cell, old in zip(
                servo.encoder_ports, mechanics.sensors, offsets, before, strict=False
            ):
                if isinstance(source, EncoderPort):
                    source.set_reference(scale.reference)
                if old is not None and not restart and old.scale == scale:
                    sensors.append(old)
                    continue
                sensors.append(
                    EncoderFeedback(source, scale, servo.cycle_s, cell, before=old, powered_off=powered_off)
                )
                servo.homed = False
            servo.sensors = tuple(sensors)
        for number, sensor in enumerate(servo.sensors, start=1):
            adjusted = f"StatusSensor[{number}].Adjusted"
            if servo.virtual:
                store.set_internal(adjusted, 1)
            elif sensor.scale.kind == INCREMENTAL:
                store.set_internal(adjusted, 0)
        servo.backlashes = tuple(
            backlash_of(store, sensor, prefix, servo.cycle_s)
            for sensor, prefix in zip(servo.sensors, prefixes, strict=False)
            if port is None and store.read(f"{prefix}.MountingMode") == MOTOR_SIDE
        )

    @property
    @override
    def leader(self) -> TechnologyObject | None:
        return self._object_of(self._leader_number())

    @property
    def next_leader(self) -> TechnologyObject | None:
        """The leading object of the job that waits for its start; None without one."""
        waiting = self.motion.entering
        return None if waiting is None else self._object_of(waiting.leader_number)

    def leads(self, leader: TechnologyObject) -> bool:
        """Return whether `leader` is this axis, or follows it over any number of axes, now or as soon as a
        job starts that waits (SYN-018).
        """
        if leader is self:
            return True
        above: list[TechnologyObject | None] = [leader.leader]
        if isinstance(leader, TechnologyAxis):
            above.append(leader.next_leader)
        return any(one is not None and self.leads(one) for one in above)

    def _object_of(self, number: int) -> TechnologyObject | None:
        """Return the leading object with this data block."""
        return next((one for one in self.leading_objects if one.db_number == number), None)

    @property
    @override
    def leading_modulo(self) -> Modulo:
        return self.servo.modulo

    def _leader_number(self) -> int:
        """Return `StatusSynchronizedMotion.ActualMaster` (SYN-036)."""
        job = self.motion.following_job
        return 0 if job is None else job.leader_number

    def coupling_with(self, leader: TechnologyObject) -> str:
        """Return how values of `leader` are taken: `SETPOINT`, `ACTUAL` or `DELAYED`."""
        return self.couplings.get(
            leader.name, ACTUAL if leader.object_type == "ExternalEncoder" else SETPOINT
        )

    @override
    def leads_positions(self) -> bool:
        return self.servo.position_controlled or not self.servo.controlled

    @property
    @override
    def stands(self) -> bool:
        return self.position is not None and self.position.monitoring.standstill

    @override
    def leading_by(self, coupling: str) -> Callable[[], Value]:
        if coupling == ACTUAL:
            return lambda: self._present_leading_value().extrapolated()
        if coupling == DELAYED:
            return lambda: self._present_leading_value().delayed()
        return self.servo.leading_setpoint

    @override
    def gives_value(self) -> bool:
        if self.leading_defective:
            return False
        return self.states.state is not AxisState.RESTARTING and self.servo.sensor_valid

    @override
    def lead(self) -> None:
        """Take note that a following axis is interconnected with this one."""
        self._interconnected = True
        self._limit_leading()

    def _limit_leading(self) -> None:
        """Limit the velocity where the axis may lead others: followers need two servo cycles per modulo range
        (STP-113, SYN-023).
        """
        modulo = self.servo.modulo
        leads = modulo.enabled and (self._interconnected or self._gives_leading_value())
        self._dynamics.leading = modulo.length / (2.0 * self.servo.cycle_s) if leads else inf

    def _gives_leading_value(self) -> bool:
        """Return whether the axis may lead axes of other controllers: it is configured to provide its leading
        value.
        """
        read = self.variables.read
        output = "CrossPlcSynchronousOperation.Interface[{}].EnableLeadingValueOutput"
        return any(read(output.format(number)) for number in range(1, 33))

    def _delay(self) -> float:
        """Return T_i + T_o + T_DC + T_servo, s: of a direct connection the real times, of a
        data block the values that the program sets (CFG-263).
        """
        servo = self.servo
        if servo.simulated:
            return servo.cycle_s
        if self.connection == "data_block":
            parameter = self.variables.parameter
            return servo.cycle_s + sum(float(parameter(one).cell.value) for one in (1010, 1011, 1012))
        return self._direct_delay_s

    @property
    def acquisition_s(self) -> float:
        """T_i, how old an actual value is when the axis takes it, s; of a direct connection half of what is
        not T_servo.
        """
        servo = self.servo
        if self.connection == "data_block" and not servo.simulated:
            return float(self.variables.parameter(1010).cell.value)
        return max(0.0, 0.5 * (servo.delay_s - servo.cycle_s))

    def setpoint_execution_s(self) -> float:
        """`StatusPositioning.SetpointExecutionTime`: T_ipo, T_vtc or 1 / Kv, T_o
        and T_DC, s (VAR-115, SYN-063).
        """
        servo = self.servo
        read = self.variables.bind
        if read("PositionControl.Kpc").value > 0.0:
            lag = read("DynamicAxisModel.VelocityTimeConstant").value
        else:
            lag = 1.0 / max(read("PositionControl.Kv").value, LEAST_GAIN)
        return float(servo.interpolator_s + servo.delay_s - servo.cycle_s - self.acquisition_s + lag)

    def _present_leading_value(self) -> LeadingValue:
        assert self.leading_value is not None  # asked by an axis with positions only
        return self.leading_value

    # -- encoders

    def take_sensor(self, number: int) -> None:
        """Control the position with encoder `number` from now on (CFG-379 to CFG-381)."""
        read = self.variables.read
        mode = read("PositionControl.ControlDifferenceQuantization.Mode")
        quantum = 0.0
        if mode == 1:
            quantum = abs(self.servo.sensors[number - 1].scale.increment)
        elif mode == 2:
            quantum = float(read("PositionControl.ControlDifferenceQuantization.Value"))
        self.servo.take_sensor(number, quantum)

    def set_sensor(self, number: int, mode: int, reference: int) -> None:
        """Switch to an encoder, or transfer a position to it (CFG section 16, `MC_SetSensor`).

        Args:
            number: Encoder to switch to, or to transfer to, 1 to 4.
            mode: 0 switch and transfer the position of the axis, 1 switch without a transfer, 2 transfer the
                position of the axis without a switch, 3 transfer that of `reference`.
            reference: Encoder whose position is transferred with mode 3.

        """
        servo = self.servo
        target = servo.sensors[number - 1]
        present = servo.feedback
        if mode == TRANSFER_FROM:
            target.transfer(servo.sensors[reference - 1].position)
            return
        if mode in (SWITCH_BUMPLESS, TRANSFER):
            target.transfer(present.position)
        if mode == TRANSFER or target is present:
            return
        step = target.position - present.position
        self.take_sensor(number)
        present.discard_correction()
        if self.position is not None:
            self.position.hardware.shift_places(step)
        if step and servo.controlled and servo.position_controlled:
            servo.controller.absorb(step)
        if self.history is not None:
            self.history.emit(self.name, "axis.sensor", sensor=number, step=step)

    @override
    def forget_encoders(self) -> None:
        self.servo.sensors = ()

    def read_limits_with_program(self) -> None:
        """Read the hardware limit switches with the call of the program, not in the servo cycle (LIM-025)."""
        if self.position is not None:
            self.image_limits = self.position.hardware
            self.image_limits.in_servo = False

    # -- homing

    def home(self, mode: int, position: float, sensor: int = 0) -> None:
        """Carry out a direct homing; the arguments as in `motion.s7.axis.homing.home_directly`."""
        home_directly(self, mode, position, sensor, setpoint=self.servo.total.s)

    @property
    def incremental(self) -> bool:
        """Whether the operative encoder is an incremental one."""
        return self.servo.feedback.scale.kind == INCREMENTAL

    def sensor_path(self, number: int) -> str:
        """Return where the variables of an encoder begin."""
        return f"Sensor[{number}]"

    def homing_switch(self, path: str) -> bool:
        """Return whether reference cam or homing input is active: its level is
        `path.SwitchLevel` (HOM-057, HOM-062).
        """
        level = self.variables.read_bool(f"{path}.SwitchLevel")
        return (self.servo.port.inputs & self.homing_input != 0) is level

    def shift_setpoints(self, offset: float) -> None:
        """Let setpoints, controller and limits follow a shift of the coordinate system."""
        self.motion.shift_coordinates(offset)
        if self.position is not None:
            self.position.hardware.shift_places(offset)
            self.position.software.shift()
        self.torque.shift(offset)
        self.motion.shift_target(offset)
        if self.leading_value is not None:
            self.leading_value.shift(offset)

    def ends_passive_homing(self) -> int | None:
        """Return why passive homing cannot continue: an ErrorID, 0 = aborted, None = it can (OVR-115)."""
        if self.alarms.blocking:
            return ERROR_ALARM
        return None if self.states.facts.enabled and not self._enabling.disabling else 0

    def alarm(self, number: int) -> None:
        """Raise a technology alarm."""
        self.alarms.raise_alarm(number)

    # -- restart and operating states of the controller

    @property
    @override
    def state(self) -> AxisState:
        return self.states.state

    @property
    @override
    def enabling(self) -> EnableControl:
        return self._enabling

    @property
    @override
    def restart_refused(self) -> bool:
        return self.states.facts.enabled or self._enabling.busy

    @override
    def hold_back(self) -> None:
        self.states.enter(AxisState.RESTARTING)
        self._show_restart(True)

    @override
    def release(self) -> None:
        self.states.enter(AxisState.ALARM_DISABLED if self.alarms.blocking else AxisState.DISABLED)
        self._show_restart(False)

    @override
    def acknowledge(self, age: int) -> bool:
        # The drive acknowledges on the rising edge of STW1.7; one low cycle makes sure that there is an edge.
        self.command.acknowledge = age > 1
        drive_ready = not self.servo.port.zsw1 & 0x0008
        if age <= _PULSE_CYCLES or (not drive_ready and age * self.interpolator_ns < _DRIVE_TIMEOUT_NS):
            return False
        self.command.acknowledge = False
        self.alarms.acknowledge()
        return True

    @override
    def switch_outputs(self, on: bool) -> None:
        self._enabling.rest(outputs=on)
        self.servo.drive_port.switch_outputs(on)

    @override
    def clear_alarms(self) -> None:
        self.alarms.restart()

    @override
    def _abort_jobs(self) -> None:
        self.motion.abort_simulated()
        self.motion.abort_all()

    @override
    def _end_functions(self) -> None:
        self.control_words.release()
        self.torque.end_all()

    @override
    def _withdraw_enable(self) -> None:
        self._enabling.withdraw()
        if not self.resting and self.states.state is not AxisState.RESTARTING:
            self.reactions.react(_REACTION_REMOVE_ENABLE)

    @override
    def _power_down(self) -> None:
        self._enabling.power_down()
        self.states.enter(AxisState.DISABLED)
        self._show_restart(False)
        self.alarms.power_down()
        self.motion.power_down()
        self.servo.power_down()
        self.status_word = self.status_word2 = self.stw1_sent = 0

    # -- cycle

    def read_inputs(self) -> None:
        """Take over what has arrived, and what the program has assigned."""
        servo = self.servo
        if self.variables.pending and self.variables.latch():
            self.motion.limits_assigned = True
            if self.leading_value is not None:
                self._leading = self.leading_value.in_use()
        port = servo.port
        port.read()
        if self.station_inputs is not None:
            readable = self.station_inputs(port)
            expected = self.states.facts.drive_expected and port.link_ok
            self.alarms.watch_inputs(readable, expected=expected)
        for other in servo.other_ports:
            other.read()
        if self._adapting is not None:
            self._adapting.step()
        servo.take_actual_values()

    def write_outputs(self, output: float) -> None:
        """Send control word, speed for the velocity `output` and torques."""
        servo = self.servo
        if servo.limit_speed(output):
            self.alarms.warn(ALARM_SPEED_LIMITED)
        command = self.command
        stw1 = command.stw1 | _ACKNOWLEDGE if command.acknowledge else command.stw1
        words = self.control_words
        if words.waiting:
            words.step()
        if words.owned_stw1:
            stw1 = stw1 & ~words.owned_stw1 | words.user_stw1
        self.stw1_sent = stw1
        torque = self.torque
        if torque.sends:
            leads = servo.position_controlled and servo.controlled and not command.switching_off
            servo.port.write(
                stw1, servo.speed_output_rpm, torque.output_nm(servo.given_acceleration() if leads else 0.0)
            )
        else:
            servo.port.write(stw1, servo.speed_output_rpm)

    def servo_cycle(self) -> None:
        """Run one servo cycle without `MC_Interpolator`: it is not due, or late. Its decisions and its
        setpoints stand.
        """
        self.read_inputs()
        servo = self.servo
        output = 0.0
        if servo.controlled and not self.command.switching_off:
            setpoint = servo.total if servo.fine is None else servo.fine.advance()
            if not self.has_position:
                output = setpoint.v
            elif servo.position_controlled:
                output = servo.close_loop(setpoint.s, setpoint.v)
            else:
                servo.controller.follow(servo.feedback.position)
                output = setpoint.v
        else:
            if self._enabling.catching:
                output = servo.actual_velocity
            tracked = servo.controller.tracked(servo.feedback.position)
            if not servo.controlled:
                servo.basic.set_state(tracked, 0.0)
            if self.has_position:
                servo.controller.follow(tracked)
        self.write_outputs(output)

    def cycle(self) -> None:
        """Run one application cycle: inputs, monitoring, state, setpoint, control, outputs."""
        self.read_inputs()
        servo = self.servo
        servo.setpoint_due = True
        position = self.position
        # The encoder that was read: a restart in this cycle makes another one, which has no value yet.
        feedback = servo.feedback
        enabling = self._enabling
        command = self.command
        self.engine.update()
        enabling.supervise()
        if position is not None:
            position.hardware.check_hardware()
        if self._resets:
            self._step_resets()
        enabling.step()
        if self.homings:
            for homing in self.homings[:]:
                homing.step()
        motion = self.motion
        fine = servo.fine
        if fine is not None and servo.controlled and not command.switching_off:
            motion.finish_step()  # the servo has reached the end of the interval only now
        if servo.controlled and not command.switching_off:
            if motion.limits_assigned:
                # The look-ahead of the software limits has to see what becomes of the motion.
                motion.follow_limits()
            if position is not None and servo.position_controlled:
                position.software.check_software()
            total = servo.total
            if fine is None:
                motion.step(servo.cycle_s)
                total = servo.total
                s, v = total.s, total.v
            else:
                start = total.s, total.v
                motion.step(servo.interpolator_s)
                fine.begin(start, servo.total, controlled=position is not None and servo.position_controlled)
                s, v = fine.s, fine.v
            servo.setpoint_due = False
            if position is None:
                output = v
            elif servo.position_controlled:
                output = servo.close_loop(s, v)
                position.monitoring.step(controlled=True)
                if self.torque.limits.detects:
                    # Behind the monitoring, which comes first where both are due (STP-163).
                    self.torque.step()
            else:
                servo.controller.follow(s if fine is None else feedback.position)
                output = v
                position.software.check_actual(controlled=True)
                position.monitoring.step(controlled=False)
            if fine is None:
                motion.finish_step()
            if not self.states.facts.controlled or command.switching_off:
                output = 0.0  # the monitoring or a job has taken the axis out of control
        else:
            output = servo.actual_velocity if enabling.catching else 0.0
            if motion.simulated is not None:
                motion.step_simulation(servo.interpolator_s)
            tracked = servo.controller.tracked(feedback.position)
            if not servo.controlled:
                # Follow-up: the position tracks, the speed setpoint is zero (CTL-003).
                servo.basic.set_state(tracked, 0.0)
            # Otherwise the drive is being switched off: the setpoint stays where its ramp has ended
            # (STP-306).
            if position is not None:
                servo.controller.follow(tracked)
                position.software.check_actual(controlled=False)
                position.monitoring.step(controlled=False)
                if self.torque.limits.clamped:
                    self.torque.step()
        self.write_outputs(output)
        if self._leading is not None:
            self._leading.step()
        status = self._status
        self.status_word = status.word(self.master)
        self.status_word2 = status.word2()
        self._error_word_shown = self.engine.error_word

    def trace_row(self) -> tuple[float, ...]:
        """Return the values of `trace_columns` for the present cycle."""
        engine = self.engine
        servo = self.servo
        states = self.states
        if engine.error_word != self._error_word_shown:
            # An instruction has raised an alarm after the cycle: the words of one row belong together
            # (DIA-110).
            self.status_word = self._status.word(self.master)
            self._error_word_shown = engine.error_word
        total = servo.total
        if servo.fine is None or not servo.controlled:
            s, v, a = total.s, total.v, total.a
        else:
            s, v, a = servo.fine.s, servo.fine.v, servo.fine.a
        port = servo.port
        command = self.command
        position = self.position
        if position is None:
            following_error = filtered = balanced = difference = permitted = additive = 0.0
        else:
            controller = servo.controller
            following_error = controller.following_error
            filtered = s if controller.filter is None else controller.filter.position
            balanced = controller.balanced_position
            difference = controller.control_difference
            permitted = position.monitoring.permitted_following_error(total.v)
            additive = self.torque.total_additive_nm
        # Compiled, numbers become floats here for a quarter of what they cost when the recorder packs them.
        row = (
            s,
            v,
            a,
            servo.feedback.position,
            servo.actual_velocity,
            following_error,
            port.actual_speed_rpm,
            servo.speed_output_rpm,
            port.actual_torque_nm,
            float(self.status_word),
            float(self.status_word2),
            float(engine.error_word),
            float(engine.warning_word),
            float(engine.number),
            float(engine.reaction),
            states.state,
            float(self.stw1_sent),
            port.zsw1,
            float(states.power_status_shown),
            float(self._enabling.busy),
            float(command.enable),
            float(servo.in_operation),
            float(servo.communication_ok),
            filtered,
            balanced,
            difference,
            permitted,
            additive,
        )
        if not self._records_modulo:
            return row
        modulo = servo.modulo
        actual_cycle, actual_place = servo.feedback.place(modulo)
        return (*row, modulo.wrap(s), modulo.cycle(s), actual_place, actual_cycle)

    # -- what it shows

    @property
    @override
    def simulated(self) -> bool:
        return self.servo.simulated

    @property
    def feedback(self) -> Feedback:
        """Position and velocity of the operative encoder."""
        return self.servo.feedback

    @property
    def sensors(self) -> tuple[Feedback, ...]:
        """All encoders, in the order of `Sensor[n]`."""
        return self.servo.sensors

    @property
    def operative_sensor(self) -> int:
        """`OperativeSensor`: the encoder in position control (CFG-314)."""
        return self.servo.operative_sensor

    @property
    def sensor_valid(self) -> bool:
        """Whether the actual position is valid (`StatusSensor[1].State` = 2); TRUE without an encoder."""
        return self.servo.sensor_valid

    @property
    def homed(self) -> bool:
        """Whether positions are those of the machine (`StatusWord.X5`)."""
        return self.servo.homed

    @homed.setter
    def homed(self, homed: bool) -> None:
        self.servo.homed = homed

    @property
    def actual_velocity(self) -> float:
        """Actual velocity, axis unit per second; of a speed axis rpm of the load."""
        return self.servo.actual_velocity

    @property
    def at_rest(self) -> bool:
        """Whether the actual velocity is within the standstill threshold."""
        return self.servo.at_rest

    @property
    def communication_ok(self) -> bool:
        """`StatusDrive.CommunicationOK`: telegrams arrive, and the drive lets itself be controlled."""
        return self.servo.communication_ok

    @property
    def in_operation(self) -> bool:
        """`StatusDrive.InOperation`: the drive executes setpoints."""
        return self.servo.in_operation

    @property
    def speed_output_rpm(self) -> float:
        """Speed setpoint of the drive, rpm; of a linear motor m/min."""
        return self.servo.speed_output_rpm

    @property
    def delay_s(self) -> float:
        """Time from a setpoint to the actual value that it makes, without the lag of the drive, s."""
        return self.servo.delay_s

    @property
    def port(self) -> DrivePort:
        """Connection in use: that to the drive, or a simulated one."""
        return self.servo.port

    @property
    def mechanics(self) -> Mechanics:
        """Ratios between motor, encoders and axis."""
        return self.servo.mechanics

    @property
    def modulo(self) -> Modulo:
        """The modulo range."""
        return self.servo.modulo


_SPEED_COLUMNS: Final = tuple(
    (name, {"mm": "", "mm/s": "rpm", "mm/s2": "rpm/s"}.get(unit, unit)) for name, unit in TRACE_COLUMNS
)


class SpeedAxis(TechnologyAxis):
    """Speed axis: turns the load, has no position (`TO_SpeedAxis`)."""

    object_type = "SpeedAxis"
    kinds: ClassVar[tuple[str, ...]] = ("SpeedAxis",)
    trace_columns = _SPEED_COLUMNS


class PositioningAxis(TechnologyAxis):
    """Positioning axis (`TO_PositioningAxis`)."""

    object_type = "PositioningAxis"
    kinds: ClassVar[tuple[str, ...]] = ("PositioningAxis",)
    has_position = True


class SynchronousAxis(TechnologyAxis):
    """Synchronous axis (`TO_SynchronousAxis`): does everything that a positioning axis does (CFG-015), and
    follows a leading value (SYN-001).
    """

    object_type = "SynchronousAxis"
    kinds: ClassVar[tuple[str, ...]] = ("SynchronousAxis", "PositioningAxis")
    has_position = True
    trace_columns = (*TRACE_COLUMNS, *SYNCHRONOUS_COLUMNS)
    trace_enums: ClassVar[dict[str, dict[int, str]]] = {
        **TechnologyAxis.trace_enums,
        "sync_phase": dict(enumerate(PHASES)),
    }

    @override
    def trace_row(self) -> tuple[float, ...]:
        return (*super().trace_row(), *self.motion.synchronous_row())


def _columns(store: VariableStore, columns: tuple[tuple[str, str], ...]) -> tuple[tuple[str, str], ...]:
    """Return the columns of the trace: velocities in position units per second, whatever the velocity unit of
    the axis is.
    """
    unit = store.unit("Position")
    names = {"mm": unit, "mm/s": f"{unit}/s", "mm/s2": f"{unit}/s2"}
    if store.read("Actor.MotorType") == 1:
        names |= {"rpm": "m/min", "Nm": "N"}
    return tuple((name, names.get(token, token)) for name, token in columns)
