"""Technology objects: what they are made of and what one application cycle does with it."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any, ClassVar, Final

from fieldbus.errors import ConfigurationError
from motion.drives.port import INPUT_HOME
from motion.kernel.backlash import Backlash
from motion.kernel.feedback import VALID, EncoderSource, Feedback
from motion.kernel.fine_interpolation import FineInterpolation
from motion.kernel.mechanics import INCREMENTAL
from motion.s7.axis.adaption import Adaption
from motion.s7.axis.configuration import given_values
from motion.s7.axis.control_words import ControlWords
from motion.s7.axis.data_block import frozen, live_variables, unit_names
from motion.s7.axis.enabling import EnableControl
from motion.s7.axis.homing import ActiveHoming, PassiveHoming, home_directly, shift_axis
from motion.s7.axis.jobs import ERROR_ALARM
from motion.s7.axis.motion import MotionControl
from motion.s7.axis.ramp_times import RampTimes
from motion.s7.axis.reactions import AxisAlarms
from motion.s7.axis.reset import ALARM_RESTART_REFUSED, Reset
from motion.s7.axis.servo import ServoCycle
from motion.s7.axis.state import FACTS, AxisState
from motion.s7.axis.status import status_word, status_word2
from motion.s7.axis.torque import TORQUE_DATA
from motion.s7.axis.trace import TRACE_COLUMNS, trace_row
from motion.s7.data_blocks import DataBlocks
from motion.s7.variables import VariableStore

if TYPE_CHECKING:
    from fieldbus.history import History
    from motion.drives.encoder import EncoderPort
    from motion.drives.port import DrivePort
    from motion.kernel.superposition import Superposition
    from motion.setpoint import SetpointGenerator

CONNECTIONS: Final = ("direct", "data_block")


class TechnologyAxis(ServoCycle):
    """Base of positioning and speed axis.

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
        ramp_times: Ramps as times in s, in place of accelerations, by the names of
            `motion.s7.axis.ramp_times.RAMPS`.

    Raises:
        ConfigurationError: A variable does not exist, its value is out of range, or values do not fit
            together.

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
        variables: Mapping[str, Any] | None = None,
        history: History | None = None,
        delay_s: float | None = None,
        encoders: Sequence[EncoderPort | DrivePort] | None = None,
        connection: str = "direct",
        cpu: str = "S7-1500T",
        ramp_times: Mapping[str, float] | None = None,
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
        self.interpolator_ns = interpolator_ns or cycle_ns
        self.interpolator_s = self.interpolator_ns * 1e-9
        ratio, rest = divmod(self.interpolator_ns, cycle_ns)
        if rest or ratio < 1:
            raise ConfigurationError(
                "interpolator_ns", self.interpolator_ns, f"a multiple of the servo cycle of {cycle_ns} ns"
            )
        self.fine = FineInterpolation(ratio, self.cycle_s) if ratio > 1 else None
        """Points on the way between two setpoints of the interpolator; None: it runs in every servo cycle."""
        self._direct_delay_s = 2 * self.cycle_s if delay_s is None else delay_s
        start_values = given_values(dict(variables or {}))
        self.variables = VariableStore(
            self.object_type, start_values, sensors=len(self.encoder_ports), name=name, history=history
        )
        if self.has_position:
            for number, one in enumerate(self.encoder_ports, start=1):
                if f"Sensor[{number}].Type" not in start_values and one.absolute_encoder:
                    self.variables.preset(f"Sensor[{number}].Type", 1)
                if f"Sensor[{number}].Interface.Number" not in start_values:
                    self.variables.preset(f"Sensor[{number}].Interface.Number", one.interface_number)
        if ramp_times:
            self.variables.on_start_value = RampTimes(self.variables, ramp_times, start_values).follow
        if TORQUE_DATA not in start_values:
            self.variables.preset(TORQUE_DATA, port.has_torque_data)
        if port.analog and "Actor.Type" not in start_values:
            self.variables.preset("Actor.Type", 0)
        self.state = AxisState.DISABLED
        self.facts = FACTS[AxisState.DISABLED]
        self.homed = False
        self.homings: list[ActiveHoming | PassiveHoming] = []
        """Active and passive homing under way (StatusWord.X11)."""
        self.homing_input = INPUT_HOME
        """Bit of the inputs that is reference cam or homing mark (`DigitalInputAddress`)."""
        self.communication_ok = False
        self.in_operation = False
        self.at_rest = True
        self.actual_velocity = 0.0
        self.speed_output_rpm = 0.0
        self.status_word = 0
        self.status_word2 = 0
        self._error_word_shown = 0
        self.stw1_sent = 0
        self.power_status_shown = False
        """Status as the history knows it (`power.status`)."""
        self._setpoint_due = False
        self._resets: list[Reset] = []
        self.station_inputs: Callable[[DrivePort], bool] | None = None
        """Puts the switches at an I/O station into the inputs of the port, once per cycle; returns whether it
        answers.
        """
        self.inputs_in_servo = True
        """Limit switches are read in the servo cycle (`PIP OB Servo`); else with the call of the program
        (LIM-025).
        """
        self.data_blocks = DataBlocks()
        """Global data blocks of the controller, of which a bit can be a limit switch."""
        self.master: object | None = None
        """The control panel that has the axis; None = the user program (`StatusWord.X4`)."""
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
            raise problems[0].error(problems[1:])
        self.simulated = self.virtual = False
        self._leading = None
        self.encoder_apart: EncoderSource | None = None
        """The operative encoder, where it has a connection of its own."""
        self.adaption: Adaption | None = None
        self.apply_configuration()
        self._live = self._readers = live_variables(self)
        if self.has_position:
            self.trace_columns = unit_names(self)

    # -- state
    # ------------------------------------------------------------------------------------------------

    def set_state(self, state: AxisState) -> None:
        """Change the state and record it."""
        old = self.state
        if state is old:
            return
        self.state = state
        self.facts = FACTS[state]
        if state is AxisState.RESTARTING:
            self._live = frozen(self._readers)
        elif old is AxisState.RESTARTING:
            self._live = self._readers
        history = self.history
        if history is not None:
            history.emit(self.name, "axis.state", **{"from": old.name, "to": state.name})
        status = self.facts.enabled
        if status is not self.power_status_shown:
            self.power_status_shown = status
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

    def power_down(self) -> None:
        """Lose what is not retentive; `apply_configuration` then begins anew."""
        self._resets = []
        self.enabling.power_down()
        self.set_state(AxisState.DISABLED)
        self.alarms.power_down()
        self.motion.power_down()
        self.communication_ok = self.in_operation = False
        self.at_rest = True
        self.actual_velocity = self.speed_output_rpm = 0.0
        self.status_word = self.status_word2 = self.stw1_sent = 0

    def forget_encoders(self) -> None:
        """Forget what the encoders have counted, also the ranges that an absolute encoder has passed."""
        self.sensors = ()

    @property
    def restart_refused(self) -> bool:
        """Whether a restart is not possible now, because the object is enabled (VAR-007)."""
        return self.facts.enabled or self.enabling.busy

    def refuse_restart(self) -> None:
        """Warn that a restart was asked for that is not possible now."""
        self.alarms.raise_alarm(ALARM_RESTART_REFUSED)

    # -- cycle
    # ------------------------------------------------------------------------------------------------

    def cycle(self) -> None:
        """Run one application cycle: inputs, monitoring, state, setpoint, control, outputs."""
        self.read_inputs()
        self._setpoint_due = True
        has_position = self.has_position
        feedback = self.feedback
        enabling = self.enabling
        self.alarms.engine.update()
        enabling.supervise()
        if has_position:
            self.limits.check_hardware()
        if self._resets:
            for reset in self._resets:
                reset.step()
            self._resets = [reset for reset in self._resets if not reset.done]
        enabling.step()
        for homing in self.homings[:] if self.homings else ():
            homing.step()
        motion = self.motion
        fine = self.fine
        if fine is not None and self.facts.controlled and not enabling.switching_off:
            motion.finish_step()  # the servo has reached the end of the interval only now
        facts = self.facts
        if facts.controlled and not enabling.switching_off:
            if motion.limits_assigned:
                # So that the look-ahead of the software limits sees what becomes of the motion.
                motion.follow_limits()
            if has_position and motion.position_controlled:
                self.limits.check_software()
            gen: SetpointGenerator | Superposition | FineInterpolation
            if fine is None:
                motion.step(self.cycle_s)
                gen = motion.total
            else:
                start = motion.total.s, motion.total.v
                motion.step(self.interpolator_s)
                gen = fine.begin(start, motion.total, controlled=has_position and motion.position_controlled)
            self._setpoint_due = False
            if has_position:
                if motion.position_controlled:
                    output = self.close_loop(gen)
                    self.monitoring.step(controlled=True)
                    if self.torque.detects:
                        # Behind the monitoring, which comes first where both are due (STP-163).
                        self.torque.step()
                else:
                    self.controller.follow(gen.s if fine is None else feedback.position)
                    output = gen.v
                    self.limits.check_actual(controlled=True)
                    self.monitoring.step(controlled=False)
            else:
                output = gen.v
            if fine is None:
                motion.finish_step()
            if not self.facts.controlled or enabling.switching_off:
                output = 0.0
        else:
            output = self.actual_velocity if enabling.catching else 0.0
            if not facts.controlled:
                motion.gen.set_state(
                    feedback.position, 0.0
                )  # follow-up: position tracks, speed setpoint zero (CTL-003)
            # Otherwise the drive is being switched off: the setpoint stays where its ramp has ended
            # (STP-306).
            if has_position:
                self.controller.follow(feedback.position)
                self.limits.check_actual(controlled=False)
                self.monitoring.step(controlled=False)
        self.write_outputs(output)
        if self._leading is not None:
            self._leading.step()
        self.status_word = status_word(self)
        self.status_word2 = status_word2(self)
        self._error_word_shown = self.alarms.engine.error_word
        self._setpoint_due = False

    @property
    def setpoint_delay_s(self) -> float:
        """Time by which a setpoint that is taken from the actual values has to be ahead of them, s.

        It is the transport delay and, with velocity precontrol, the time constant of the drive. Between
        reading the actual values and the setpoint of the same cycle it is one cycle less, because the
        setpoint still advances.
        """
        delay = self.delay_s - self.cycle_s if self._setpoint_due else self.delay_s
        if not self.has_position:
            return delay
        dynamic_filter = self.controller.filter
        if dynamic_filter is not None:
            delay += dynamic_filter.delay_s
        return delay + self.controller.precontrolled_lag_s

    def trace_row(self) -> tuple[float, ...]:
        """Return the values of `trace_columns` for the present cycle."""
        if self.alarms.engine.error_word != self._error_word_shown:
            # An instruction has raised an alarm after the cycle: the words of one row belong together
            # (DIA-110).
            self.status_word = status_word(self)
            self._error_word_shown = self.alarms.engine.error_word
        return trace_row(self)

    # -- variables under their original paths
    # -----------------------------------------------------------------

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
        """Assign a variable like the user program does; the access class decides when it acts (VAR-001 to
        VAR-015).
        """
        self.variables.write(path, value)


class SpeedAxis(TechnologyAxis):
    """Speed axis: turns the load, has no position (`TO_SpeedAxis`)."""

    object_type = "SpeedAxis"
    kinds: ClassVar[tuple[str, ...]] = ("SpeedAxis",)
    trace_columns = tuple(
        (name, {"mm": "", "mm/s": "rpm", "mm/s2": "rpm/s"}.get(unit, unit))
        for name, unit in TechnologyAxis.trace_columns
    )


class PositioningAxis(TechnologyAxis):
    """Positioning axis (`TO_PositioningAxis`)."""

    object_type = "PositioningAxis"
    kinds: ClassVar[tuple[str, ...]] = ("PositioningAxis",)
    has_position = True

    def home(self, mode: int, position: float, sensor: int = 0) -> None:
        """See `motion.s7.axis.homing.home_directly`."""
        home_directly(self, mode, position, sensor)

    @property
    def incremental(self) -> bool:
        """Whether the operative encoder is an incremental one."""
        return self.feedback.scale.kind == INCREMENTAL

    @staticmethod
    def sensor_path(number: int) -> str:
        """Return where the variables of an encoder begin."""
        return f"Sensor[{number}]"

    def homing_switch(self, path: str) -> bool:
        """Return whether reference cam or homing input is active: its level is `path.SwitchLevel` (HOM-057,
        HOM-062).
        """
        level: bool = self.variables.read(f"{path}.SwitchLevel")
        return (self.port.inputs & self.homing_input != 0) is level

    def shift_setpoints(self, offset: float) -> None:
        """Let setpoints, controller and limits follow a shift of the coordinate system."""
        shift_axis(self, offset)
        self.leading_value.shift(offset)

    def ends_passive_homing(self) -> int | None:
        """Return why passive homing cannot go on: an ErrorID, 0 = it is aborted, None = it can (OVR-115)."""
        if self.alarms.blocking:
            return ERROR_ALARM
        return None if self.facts.enabled and not self.enabling.disabling else 0

    def alarm(self, number: int) -> None:
        """Raise a technology alarm."""
        self.alarms.raise_alarm(number)


class SynchronousAxis(PositioningAxis):
    """Synchronous axis (`TO_SynchronousAxis`): does everything that a positioning axis does (CFG-015)."""

    object_type = "SynchronousAxis"
    kinds: ClassVar[tuple[str, ...]] = ("SynchronousAxis", "PositioningAxis")
