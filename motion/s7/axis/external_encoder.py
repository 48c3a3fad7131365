"""External encoder: a technology object that acquires a position and moves nothing (CFG-016 to CFG-018,
VAR-025).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any, ClassVar, Final

from motion.drives.encoder import EncoderPort
from motion.kernel.feedback import VALID, Feedback
from motion.kernel.leading_value import LeadingValue, live_leading_value
from motion.kernel.mechanics import INCREMENTAL, Mechanics
from motion.kernel.modulo import Modulo
from motion.kernel.monitoring import ALARM_RANGE_EXCEEDED
from motion.s7.alarms import AlarmEngine
from motion.s7.axis.adaption import Adaption
from motion.s7.axis.configuration import Abilities, Problem, check_configuration, given_values
from motion.s7.axis.data_block import frozen, in_its_units
from motion.s7.axis.encoder_enabling import EncoderEnabling
from motion.s7.axis.homing import ActiveHoming, PassiveHoming, home_directly
from motion.s7.axis.homing.active import ALARM_NOT_FOUND, ALARM_NOT_SUPPORTED
from motion.s7.axis.jobs import ERROR_ALARM, NO_ERROR
from motion.s7.axis.reset import ALARM_CONFIGURATION, ALARM_RESTART_REFUSED, acknowledge_error
from motion.s7.axis.state import AxisState
from motion.s7.axis.status import (
    DONE,
    ENABLE,
    ERROR,
    HOMING_COMMAND,
    HOMING_DONE,
    ONLINE_START_VALUES_CHANGED,
    RESTART_ACTIVE,
    STANDSTILL,
)
from motion.s7.units import farthest_position
from motion.s7.variables import VariableStore

if TYPE_CHECKING:
    from fieldbus.history import History
    from motion.drives.port import DrivePort

ALARM_ENCODER: Final = 411
ALARM_COMMUNICATION: Final = 431
ENCODER_SIGNALS_ALARM: Final = 1
ENCODER_STATION_FAILED: Final = 3
"""Causes of 411 and 431, as the catalogue numbers them (TA-013)."""
_ALARMS_OF_HOMING: Final = (ALARM_NOT_FOUND, ALARM_NOT_SUPPORTED)
"""342 and 343 are alarms of axes only."""
_NO_MARK: Final = "the encoder cannot search for a homing mark"
_RESTART_CYCLES: Final = 5
_HYSTERESIS: Final = 1.1


class EncoderReset:
    """One execution of `MC_Reset` on an external encoder; the object steps it."""

    __slots__ = ("_age", "_object", "done", "error_id", "restart")

    def __init__(self, external: ExternalEncoder, *, restart: bool) -> None:
        self._object = external
        self._age = 0
        self.restart = restart
        self.done = False
        self.error_id = NO_ERROR
        """See `Reset.error_id`."""
        if restart:
            external.begin_restart()

    def step(self) -> None:
        """Advance by one application cycle."""
        self._age += 1
        external = self._object
        if not self.restart:
            external.engine.acknowledge()
            external.engine.update()
        elif self._age >= _RESTART_CYCLES:
            external.finish_restart()
        else:
            return
        self.error_id = acknowledge_error(external.engine)
        self.done = True


class ExternalEncoder:
    """`TO_ExternalEncoder` on a port of the bench.

    Args:
        name: Name in history and trace.
        port: Where the encoder value comes from.
        cycle_ns: Application cycle, ns.
        variables: Start values by their original path, for example `{"Mechanics.LeadScrew": 5.0}`.
        history: Event log, or None.

    Raises:
        ConfigurationError: A variable does not exist, its value is out of range, or values do not fit
            together.

    """

    object_type: ClassVar[str] = "ExternalEncoder"
    kinds: ClassVar[tuple[str, ...]] = ("ExternalEncoder",)
    connection: ClassVar[str] = "direct"
    simulated: ClassVar[bool] = False
    has_position: ClassVar[bool] = False
    """No setpoint position that a job could move."""
    trace_enums: ClassVar[dict[str, dict[int, str]]] = {}

    def __init__(
        self,
        name: str,
        port: EncoderPort | DrivePort,
        *,
        cycle_ns: int,
        variables: Mapping[str, Any] | None = None,
        history: History | None = None,
    ) -> None:
        self.name = name
        self.port = port
        self.history = history
        self.cycle_s = cycle_ns * 1e-9
        start_values = given_values(dict(variables or {}))
        self.variables = VariableStore(self.object_type, start_values, name=name, history=history)
        if "Sensor.Type" not in start_values and port.absolute_encoder:
            self.variables.preset("Sensor.Type", 1)
        self.engine = AlarmEngine(name, object_type=self.object_type, history=history)
        self.state = AxisState.DISABLED
        self.master: object | None = None
        """See the axis: there is no control panel for an encoder (CFG-065)."""
        self.power_owner: object | None = None
        """The `MC_Power` instance that rules this object (MC-160)."""
        self.enabling = EncoderEnabling(self)
        self.homed = False
        self.digital_input: Callable[[], bool] | None = None
        """Level of the input that is reference cam or homing mark; None = none is wired."""
        self.homings: list[ActiveHoming | PassiveHoming] = []
        """Passive homing under way (StatusWord.X11)."""
        self.operative_sensor = 1
        self.standstill = False
        self._standstill_time = 0.0
        self._was_linked = False
        self._resets: list[EncoderReset] = []
        self._feedback: Feedback | None = None
        self._adaption: Adaption | None = None
        problems = self.check(start=False)
        if problems:
            raise problems[0].error(problems[1:])
        self._threshold = self.variables.bind("StandstillSignal.VelocityThreshold")
        self._dwell = self.variables.bind("StandstillSignal.MinDwellTime")
        self._farthest = farthest_position(self.variables.read("Units.LengthUnit"))
        self.apply_configuration()
        self._live = self._readers = in_its_units(self._live_variables(), self.variables)
        unit = self.variables.unit("ActualPosition")
        self.trace_columns: tuple[tuple[str, str], ...] = (
            ("position", unit),
            ("velocity", f"{unit}/s"),
            ("state", ""),
            ("status_word", ""),
            ("error_word", ""),
        )

    @property
    def feedback(self) -> Feedback:
        """Position and velocity, unwrapped."""
        assert self._feedback is not None  # made by the constructor
        return self._feedback

    @property
    def sensor_valid(self) -> bool:
        """Whether the actual position is valid (`StatusSensor.State` = 2)."""
        return self.feedback.state == VALID

    def check(self, *, start: bool) -> list[Problem]:
        """Return what does not fit together, in the values in force or in the start values of the next
        restart.
        """
        return check_configuration(
            self.variables, Abilities(velocities=(self.port.brings_speed,)), start=start
        )

    def apply_configuration(self, *, powered_off: bool = False) -> None:
        """Derive everything from the variables, at start and after a restart."""
        self._derive(restart=True, powered_off=powered_off)
        store = self.variables
        absolute = self.feedback.scale.kind != INCREMENTAL
        if not absolute:
            store.set_internal("StatusSensor.Adjusted", 0)
        self.homed = absolute and store.read("StatusSensor.Adjusted") == 1
        if self._adaption is not None:
            self._adaption.close()
        self._adaption = Adaption(
            store, None, (self.port,), self.engine, self._derive, name=self.name, history=self.history
        )

    def _derive(self, *, restart: bool = False, powered_off: bool = False) -> None:
        store = self.variables
        scale = Mechanics(store).sensors[0]
        self.modulo = Modulo(store)
        before = self._feedback
        if before is not None and not restart and before.scale == scale:
            return
        if isinstance(self.port, EncoderPort):
            self.port.set_reference(scale.reference)
        offset = store.bind("StatusSensor.AbsEncoderOffset")
        self._feedback = Feedback(
            self.port, scale, self.cycle_s, offset, before=before, powered_off=powered_off
        )
        self._make_leading_value()
        self.homed = False

    def _make_leading_value(self) -> None:
        """Make what followers get: there is no setpoint, so that the actual value is also what is delayed."""
        feedback = self.feedback
        self.leading_value = LeadingValue(
            self.variables,
            cycle_s=self.cycle_s,
            feedback=lambda: feedback,
            acquisition_s=float(self.variables.parameter(1010).value) or 0.5 * self.cycle_s,
            setpoint=lambda: (
                feedback.position,
                feedback.velocity,
                (feedback.velocity - feedback.last_velocity) / self.cycle_s,
            ),
        )
        self._leading = self.leading_value.in_use()

    # -- cycle
    # ------------------------------------------------------------------------------------------------

    def cycle(self) -> None:
        """Run one application cycle."""
        if self.state is not AxisState.RESTARTING and self.variables.latch():
            self._leading = self.leading_value.in_use()
        port = self.port
        port.read()
        adaption = self._adaption
        if adaption is not None and adaption.active:
            adaption.step()
        feedback = self.feedback
        feedback.update()
        if self._leading is not None:
            self._leading.step()
        if feedback.lost_reference:
            feedback.lost_reference = False
            self.homed = False
        engine = self.engine
        engine.update()
        engine.set_cause(
            ALARM_COMMUNICATION,
            not port.link_ok and self._was_linked,
            info=ENCODER_STATION_FAILED + port.sign_lost,
        )
        engine.set_cause(ALARM_ENCODER, port.sensor_fault, info=ENCODER_SIGNALS_ALARM)
        if port.link_ok:
            self._was_linked = True
        self.enabling.step()
        if not -self._farthest <= feedback.position <= self._farthest:
            engine.raise_alarm(ALARM_RANGE_EXCEEDED, info=2 if feedback.position > 0.0 else 1)
        self._watch_standstill(abs(feedback.velocity))
        for reset in self._resets:
            reset.step()
        if self._resets:
            self._resets = [reset for reset in self._resets if not reset.done]

    def finish_cycle(self) -> None:
        """Look for homing marks, after all axes have read their ports: a digital input is as old as the
        position then (HOM-067).
        """
        for homing in self.homings[:] if self.homings else ():
            homing.step()

    def _watch_standstill(self, speed: float) -> None:
        threshold = self._threshold.value
        if self.standstill:
            if speed > threshold * _HYSTERESIS:
                self.standstill = False
                self._standstill_time = 0.0
        elif speed < threshold:
            self._standstill_time += self.cycle_s
            self.standstill = self._standstill_time >= self._dwell.value - 1e-9
        else:
            self._standstill_time = 0.0

    # -- instructions
    # -----------------------------------------------------------------------------------------

    def make_reset(self, *, restart: bool) -> EncoderReset:
        """Return an execution of `MC_Reset`; the cycle carries it out."""
        reset = EncoderReset(self, restart=restart)
        self._resets.append(reset)
        return reset

    def power_down(self) -> None:
        """Lose what is not retentive; `apply_configuration` then begins anew."""
        self._resets = []
        self.state = AxisState.DISABLED
        self._live = self._readers
        self.enabling.call(enable=False, start_mode=1, stop_mode=0)
        self.engine.power_down()
        self.standstill = self._was_linked = False
        self._standstill_time = 0.0

    def forget_encoders(self) -> None:
        """Forget what the encoder has counted, also the ranges that an absolute one has passed."""
        self._feedback = None

    @property
    def restart_refused(self) -> bool:
        """Whether a restart is not possible now, because the object is enabled (VAR-007, MC-170)."""
        return self.enabling.enable

    def refuse_restart(self) -> None:
        """Warn that a restart was asked for that is not possible now."""
        self.engine.raise_alarm(ALARM_RESTART_REFUSED)

    @property
    def restarting(self) -> bool:
        """Whether the object is being re-initialised."""
        return self.state is AxisState.RESTARTING

    def begin_restart(self) -> None:
        """Begin to be initialised anew; the data block shows what it shows now until that has ended
        (VAR-228).
        """
        self.state = AxisState.RESTARTING
        self._live = frozen(self._readers)

    def finish_restart(self) -> None:
        """Put the start values into force, or raise alarm 101."""
        problems = [str(one) for one in self.variables.violations()] or [
            str(one) for one in self.check(start=True)
        ]
        self.engine.restart()
        if problems:
            self.engine.raise_alarm(ALARM_CONFIGURATION, text="; ".join(problems))
        else:
            self.variables.restart()
            self.apply_configuration()
        self.state = AxisState.DISABLED
        self._live = self._readers

    def home(self, mode: int, position: float, sensor: int = 0) -> None:
        """Carry out a direct homing; without a setpoint modes 11 and 12 are 0 and 1 (HOM-018)."""
        home_directly(self, {11: 0, 12: 1}.get(mode, mode), position, sensor)

    @property
    def sensors(self) -> tuple[Feedback, ...]:
        """Its encoder."""
        return (self.feedback,)

    @property
    def incremental(self) -> bool:
        """Whether the encoder is an incremental one."""
        return self.feedback.scale.kind == INCREMENTAL

    @staticmethod
    def sensor_path(number: int) -> str:  # noqa: ARG004 - there is one
        """Return where the variables of the encoder begin."""
        return "Sensor"

    def homing_switch(self, path: str) -> bool:
        """Return whether the digital input has the level of `path.SwitchLevel` (HOM-062); FALSE where none is
        wired.
        """
        wired = self.digital_input
        level: bool = self.variables.read(f"{path}.SwitchLevel")
        return wired is not None and wired() is level

    def shift_setpoints(self, offset: float) -> None:
        """Let the leading value follow a shift of the coordinate system; there are no setpoints."""
        self.leading_value.shift(offset)

    def ends_passive_homing(self) -> int | None:
        """Return why passive homing cannot go on: an ErrorID, 0 = it is aborted, None = it can."""
        if self.engine.error_word:
            return ERROR_ALARM
        return None if self.enabling.enabled else 0

    def alarm(self, number: int) -> None:
        """Raise a technology alarm; of those of homing, which this object does not have, alarm 411 tells."""
        if number in _ALARMS_OF_HOMING:
            self.engine.raise_alarm(ALARM_ENCODER, info=ENCODER_SIGNALS_ALARM, text=_NO_MARK)
        else:
            self.engine.raise_alarm(number)

    # -- variables under their original paths
    # -----------------------------------------------------------------

    def status_word(self) -> int:
        """Return `StatusWord` for the present cycle."""
        word = RESTART_ACTIVE if self.restarting else DONE
        if self.enabling.enabled:
            word |= ENABLE
        if self.engine.error_word:
            word |= ERROR
        if self.variables.online_start_values_changed:
            word |= ONLINE_START_VALUES_CHANGED
        if self.homed:
            word |= HOMING_DONE
        if self.homings and any(homing.busy for homing in self.homings):
            word = word & ~DONE | HOMING_COMMAND
        if self.standstill:
            word |= STANDSTILL
        return word

    def _live_variables(self) -> dict[str, Callable[[], Any]]:
        engine = self.engine
        return live_leading_value(lambda: self.leading_value, lambda: self.modulo) | {
            "ActualPosition": lambda: self.feedback.place(self.modulo)[1],
            "ActualModuloCycle": lambda: self.feedback.place(self.modulo)[0],
            "ActualVelocity": lambda: self.feedback.velocity,
            "ActualAcceleration": lambda: (
                (self.feedback.velocity - self.feedback.last_velocity) / self.cycle_s
            ),
            "StatusSensor.State": lambda: self.feedback.state,
            "StatusSensor.Position": lambda: self.feedback.place(self.modulo)[1],
            "StatusSensor.ModuloCycle": lambda: self.feedback.place(self.modulo)[0],
            "StatusSensor.Velocity": lambda: self.feedback.velocity,
            "StatusSensor.CommunicationOK": lambda: self.port.link_ok,
            "StatusSensor.Error": lambda: self.port.sensor_fault,
            "StatusSensor.Control": lambda: True,
            "StatusWord": self.status_word,
            "ErrorWord": lambda: engine.error_word,
            "WarningWord": lambda: engine.warning_word,
            "ErrorDetail.Number": lambda: engine.number,
            "ErrorDetail.Reaction": lambda: engine.reaction,
        }

    def var(self, path: str) -> Any:
        """Return a variable of the technology data block by its original path; bits as `StatusWord.X7`.

        Raises:
            ConfigurationError: There is no such variable on this object type.

        """
        live = self._live.get(path)
        if live is not None:
            return live()
        head, _, bit = path.rpartition(".")
        bit = bit.lstrip("%")
        if head in self._live and bit[:1] == "X" and bit[1:].isdigit():
            return bool(self._live[head]() >> int(bit[1:]) & 1)
        return self.variables.read(path)

    def write(self, path: str, value: Any) -> None:
        """Assign a variable like the user program does (VAR-001 to VAR-015)."""
        self.variables.write(path, value)

    def trace_row(self) -> tuple[float, ...]:
        """Return the values of `trace_columns` for the present cycle."""
        feedback = self.feedback
        return (
            feedback.position,
            feedback.velocity,
            feedback.state,
            self.status_word(),
            self.engine.error_word,
        )
