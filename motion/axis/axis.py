"""Technology objects: what they are made of and what one application cycle does with it."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any, ClassVar, Final

from fieldbus.errors import ConfigurationError
from motion.axis.adaption import Adaption
from motion.axis.assembly import AxisAssembly
from motion.axis.backlash import Backlash
from motion.axis.configuration import derive_units
from motion.axis.control_words import ControlWords
from motion.axis.data_block import live_variables, unit_names
from motion.axis.enabling import EnableControl
from motion.axis.feedback import VALID, EncoderSource, Feedback
from motion.axis.homing import home_directly
from motion.axis.motion import MotionControl
from motion.axis.reactions import AxisAlarms
from motion.axis.reset import Reset
from motion.axis.state import FACTS, AxisState
from motion.axis.status import status_word, status_word2
from motion.drives.port import STW1
from motion.variables import VariableStore

if TYPE_CHECKING:
    from fieldbus.history import History
    from motion.drives.encoder import EncoderPort
    from motion.drives.port import DrivePort

_AT_REST_RPM: Final = 1.0
"""Motor speed below which a speed axis counts as standing."""

CONNECTIONS: Final = ("direct", "data_block")


class TechnologyAxis(AxisAssembly):
    """Base of positioning and speed axis.

    Args:
        name: Name in history and trace.
        port: Coupling to the drive.
        cycle_ns: Application cycle, ns.
        variables: Start values by their original path, for example `{"DynamicLimits.MaxVelocity": 500.0}`.
        history: Event log, or None.
        delay_s: Time from a setpoint to the actual value that it makes, without the lag of the drive
            (`T_i + T_o + T_DC + T_servo`), s; default two cycles. With a data block the parameters 1010 to 1012 say it.
        encoders: Where the values of `Sensor[1]`, `Sensor[2]`, ... come from; None = of one encoder, that of the drive.
        connection: `direct`, or `data_block`: a user program stands between telegram and axis (CFG section 13).
        cpu: `S7-1500T`, or `S7-1500`, which has one encoder per axis (CFG-177).

    Raises:
        ConfigurationError: A variable does not exist, its value is out of range, or values do not fit together.

    """

    trace_columns: tuple[tuple[str, str], ...] = (
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
        ("in_operation", ""),
        ("communication_ok", ""),
    )
    trace_enums: ClassVar[dict[str, dict[int, str]]] = {"state": {int(s): s.name for s in AxisState}}

    def __init__(
        self,
        name: str,
        port: DrivePort,
        *,
        cycle_ns: int,
        variables: Mapping[str, Any] | None = None,
        history: History | None = None,
        delay_s: float | None = None,
        encoders: Sequence[EncoderPort | DrivePort] | None = None,
        connection: str = "direct",
        cpu: str = "S7-1500T",
    ) -> None:
        if connection not in CONNECTIONS:
            raise ConfigurationError("connection", connection, ", ".join(CONNECTIONS))
        self.name = name
        self.drive_port = port
        """Connection to the drive, also while it is not used."""
        self.port: DrivePort = port
        self.encoder_ports = (port,) if encoders is None else tuple(encoders)
        self._other_ports = [one for one in self.encoder_ports if one is not port]
        self.connection = connection
        self.cpu = cpu
        self.history = history
        self.cycle_ns = cycle_ns
        self.cycle_s = cycle_ns * 1e-9
        self._direct_delay_s = 2 * self.cycle_s if delay_s is None else delay_s
        start_values = derive_units(dict(variables or {}))
        self.variables = VariableStore(
            self.object_type, start_values, sensors=len(self.encoder_ports), name=name, history=history
        )
        if self.has_position:
            for number, one in enumerate(self.encoder_ports, start=1):
                if f"Sensor[{number}].Type" not in start_values and one.absolute_encoder:
                    self.variables.preset(f"Sensor[{number}].Type", 1)
                if f"Sensor[{number}].Interface.Number" not in start_values:
                    self.variables.preset(f"Sensor[{number}].Interface.Number", one.interface_number)
        self.state = AxisState.DISABLED
        self.facts = FACTS[AxisState.DISABLED]
        self.homed = False
        self.communication_ok = False
        self.in_operation = False
        self.at_rest = True
        self.actual_velocity = 0.0
        self.speed_output_rpm = 0.0
        self.status_word = 0
        self.status_word2 = 0
        self._error_word_shown = 0
        self.stw1_sent = 0
        self._status = False
        self._setpoint_due = False
        self._resets: list[Reset] = []
        self.station_inputs: Callable[[DrivePort], object] | None = None
        """Puts the switches that are wired to an I/O station into the inputs of the port, once per cycle."""
        self.power_owner: object | None = None
        """The `MC_Power` instance that rules this object (MC-160)."""
        self.alarms = AxisAlarms(self)
        self.enabling = EnableControl(self)
        self.motion = MotionControl(self)
        self.control_words = ControlWords(self)
        self.sensors: tuple[Feedback, ...] = ()
        """All encoders, in the order of `Sensor[n]`."""
        self.backlashes: tuple[Backlash, ...] = ()
        """Compensation of the encoders that sit on the motor."""
        self.operative_sensor = 1
        """`OperativeSensor`: the encoder in position control (CFG-314)."""
        problems = self.check(start=False)
        if problems:
            raise problems[0].error()
        self.simulated = self.virtual = False
        self.encoder_apart: EncoderSource | None = None
        """The operative encoder, where it has a connection of its own."""
        self.adaption: Adaption | None = None
        self.apply_configuration()
        self._live = live_variables(self)
        if self.has_position:
            self.trace_columns = unit_names(self)

    # -- state ------------------------------------------------------------------------------------------------

    def set_state(self, state: AxisState) -> None:
        """Change the state and record it."""
        old = self.state
        if state is old:
            return
        self.state = state
        self.facts = FACTS[state]
        history = self.history
        if history is not None:
            history.emit(self.name, "axis.state", **{"from": old.name, "to": state.name})
        status = self.facts.enabled
        if status is not self._status:
            self._status = status
            if history is not None:
                history.emit(self.name, "power.status", value=status)

    @property
    def sensor_valid(self) -> bool:
        """Whether the actual position is valid (`StatusSensor[1].State` = 2); TRUE without an encoder."""
        return not self.has_position or self.feedback.state == VALID

    def make_reset(self, *, restart: bool) -> Reset:
        """Return an execution of `MC_Reset`; the cycle carries it out."""
        reset = Reset(self, restart=restart)
        self._resets.append(reset)
        return reset

    @property
    def restart_refused(self) -> bool:
        """Whether a restart is not possible now, because the object is enabled (VAR-007)."""
        return self.facts.enabled or self.enabling.busy

    # -- cycle ------------------------------------------------------------------------------------------------

    def cycle(self) -> None:
        """Run one application cycle: inputs, monitoring, state, setpoint, control, outputs."""
        self.variables.latch()
        port = self.port
        port.read()
        if self.station_inputs is not None:
            self.station_inputs(port)
        for other in self._other_ports:
            other.read()
        if self._adapting is not None:
            self._adapting.step()
            port = self.port
        self._setpoint_due = True
        zsw1 = port.zsw1
        self.communication_ok = port.link_ok and zsw1 & 0x0208 == 0x0200
        self.in_operation = zsw1 & 0x0204 == 0x0204 and not zsw1 & 0x0008
        has_position = self.has_position
        feedback = self.feedback
        if has_position:
            for sensor in self.sensors:
                sensor.update()
            for backlash in self.backlashes:
                if backlash.enabled.value or backlash.used:
                    backlash.step()
            self.actual_velocity = velocity = feedback.velocity
            self.at_rest = -self._rest_threshold.value <= velocity <= self._rest_threshold.value
            if feedback.lost_reference:
                feedback.lost_reference = False
                self.homed = False
        else:
            # Without a link the last value says nothing: it counts as 0, as the velocity of an encoder does.
            rpm = port.actual_speed_rpm if port.link_ok else 0.0
            self.actual_velocity = rpm / self.mechanics.rpm_per_unit
            self.at_rest = -_AT_REST_RPM <= rpm <= _AT_REST_RPM
        enabling = self.enabling
        self.alarms.engine.update()
        enabling.supervise()
        if has_position:
            self.limits.check_hardware()
        for reset in self._resets:
            reset.step()
        if self._resets:
            self._resets = [reset for reset in self._resets if not reset.done]
        enabling.step()
        motion = self.motion
        if self.facts.controlled and not enabling.switching_off:
            if has_position and motion.position_controlled:
                self.limits.check_software()
            motion.step(self.cycle_s)
            gen = motion.total
            self._setpoint_due = False
            if has_position:
                controller = self.controller
                if motion.position_controlled:
                    output = controller.step(gen.s, gen.v, feedback.position)
                    if self._dsc:
                        # The drive closes the loop around what it has measured since (CFG-194).
                        output = controller.precontrol
                        port.control_position(
                            (controller.balanced_position - feedback.position) / self.mechanics.increment,
                            controller.gain,
                        )
                    if self.torque.detects:
                        self.torque.step()
                    self.monitoring.step(controlled=True)
                else:
                    controller.follow(gen.s)
                    output = gen.v
                    self.monitoring.step(controlled=False)
            else:
                output = gen.v
            motion.finish_step()
            if not FACTS[self.state].controlled or enabling.switching_off:
                output = 0.0
        else:
            output = 0.0
            if not self.facts.controlled:
                motion.gen.set_state(
                    feedback.position, 0.0
                )  # follow-up: position tracks, speed setpoint zero (CTL-003)
            # Otherwise the drive is being switched off: the setpoint stays where its ramp has ended (STP-306).
            if has_position:
                self.controller.follow(feedback.position)
                self.monitoring.step(controlled=False)
        speed = output * self.mechanics.rpm_per_unit
        limit = self._max_speed
        if speed > limit:
            speed = limit
        elif speed < -limit:
            speed = -limit
        self.speed_output_rpm = speed
        stw1 = enabling.stw1 | STW1.ACKNOWLEDGE if enabling.acknowledge_drive else enabling.stw1
        words = self.control_words
        if words.busy:
            words.step()
        if words.owned_stw1:
            stw1 = stw1 & ~words.owned_stw1 | words.user_stw1
        self.stw1_sent = stw1
        torque = self.torque
        if torque.additive is None:
            port.write(stw1, speed)
        else:
            port.write(stw1, speed, torque.additive_output_nm)
        self.status_word = status_word(self)
        self.status_word2 = status_word2(self)
        self._error_word_shown = self.alarms.engine.error_word
        self._setpoint_due = False

    @property
    def setpoint_delay_s(self) -> float:
        """Time by which a setpoint that is taken from the actual values has to be ahead of them, s.

        It is the transport delay and, with velocity precontrol, the time constant of the drive. Between reading the
        actual values and the setpoint of the same cycle it is one cycle less, because the setpoint still advances.
        """
        delay = self.delay_s - self.cycle_s if self._setpoint_due else self.delay_s
        return delay + self.controller.precontrolled_lag_s if self.has_position else delay

    def trace_row(self) -> tuple[float, ...]:
        """Return the values of `trace_columns` for the present cycle."""
        gen = self.motion.total
        port = self.port
        engine = self.alarms.engine
        feedback = self.feedback
        if engine.error_word != self._error_word_shown:
            # An instruction has raised an alarm after the cycle: the words of one row belong together (DIA-110).
            self.status_word = status_word(self)
            self._error_word_shown = engine.error_word
        return (
            gen.s,
            gen.v,
            gen.a,
            feedback.position,
            self.actual_velocity,
            self.controller.following_error if self.has_position else 0.0,
            port.actual_speed_rpm,
            self.speed_output_rpm,
            port.actual_torque_nm,
            self.status_word,
            self.status_word2,
            engine.error_word,
            engine.warning_word,
            engine.number,
            engine.reaction,
            self.state,
            self.stw1_sent,
            port.zsw1,
            self._status,
            self.enabling.busy,
            self.in_operation,
            self.communication_ok,
        )

    # -- variables under their original paths -----------------------------------------------------------------

    def var(self, path: str) -> Any:
        """Return a variable of the technology data block by its original path; bits as `StatusWord.X7`.

        Raises:
            ConfigurationError: There is no such variable on this object type.

        """
        live = self._live.get(path)
        if live is not None:
            return live()
        head, _, bit = path.rpartition(".")
        if head in self._live and bit.lstrip("%")[:1] == "X" and bit.lstrip("%")[1:].isdigit():
            return bool(self._live[head]() >> int(bit.lstrip("%")[1:]) & 1)
        return self.variables.read(path)

    def write(self, path: str, value: Any) -> None:
        """Assign a variable like the user program does; the access class decides when it acts (VAR-001 to VAR-015)."""
        self.variables.write(path, value)


class SpeedAxis(TechnologyAxis):
    """Speed axis: velocity unit rpm at the load, no position (`TO_SpeedAxis`)."""

    object_type = "SpeedAxis"
    trace_columns = tuple(
        (name, {"mm": "", "mm/s": "rpm", "mm/s2": "rpm/s"}.get(unit, unit))
        for name, unit in TechnologyAxis.trace_columns
    )


class PositioningAxis(TechnologyAxis):
    """Positioning axis (`TO_PositioningAxis`)."""

    object_type = "PositioningAxis"
    has_position = True

    def home(self, mode: int, position: float) -> None:
        """See `motion.axis.homing.home_directly`."""
        home_directly(self, mode, position)
