"""External encoder: a technology object that acquires a position and moves nothing
(CFG-016 to CFG-018, VAR-025).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, ClassVar, Final

from typing_extensions import override

from motion.drives.encoder import EncoderPort
from motion.kernel.feedback import VALID, EncoderFeedback, Feedback
from motion.kernel.mechanics import INCREMENTAL
from motion.s7.alarms import AlarmEngine
from motion.s7.axis.adaption import Adaption
from motion.s7.axis.alarms import ALARM_RANGE_EXCEEDED
from motion.s7.axis.assembly import leading_value_of, mechanics_of, modulo_of
from motion.s7.axis.configuration import Abilities, Problem, check_configuration, given_values
from motion.s7.axis.enabling import ALARM_ENCODER_NOT_READY, NOT_INITIALISED
from motion.s7.axis.homing.direct import home_directly
from motion.s7.axis.homing.finder import ALARM_NOT_FOUND, ALARM_NOT_SUPPORTED
from motion.s7.axis.jobs import ERROR_ALARM
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
from motion.s7.axis.technology_object import (
    Live,
    TechnologyObject,
    in_its_units,
    live_alarms,
    live_leading_value,
)
from motion.s7.units import farthest_position
from motion.s7.variables import VariableStore

if TYPE_CHECKING:
    from fieldbus.history import History
    from motion.drives.port import DrivePort
    from motion.kernel.leading_value import Value
    from motion.kernel.modulo import Modulo

ALARM_ENCODER: Final = 411
ALARM_COMMUNICATION: Final = 431
ENCODER_SIGNALS_ALARM: Final = 1
ENCODER_STATION_FAILED: Final = 3
"""Causes of 411 and 431, as the catalogue numbers them (TA-013)."""
_ALARMS_OF_HOMING: Final = (ALARM_NOT_FOUND, ALARM_NOT_SUPPORTED)
"""342 and 343 are alarms of axes only."""
_NO_MARK: Final = "the encoder cannot search for a homing mark"
_HYSTERESIS: Final = 1.1


class EncoderEnabling:
    """What `MC_Power` commands and sees of an external encoder: whether its value is valid (STP-035, MC-159).

    Args:
        name: Name of the object.
        history: Event log, or None.
        engine: Its pending alarms.

    """

    def __init__(self, name: str, history: History | None, engine: AlarmEngine) -> None:
        self._name = name
        self._history = history
        self._engine = engine
        self._joined = False
        """The encoder has been there since the start of the controller, or its
        absence has been reported.
        """
        self.enable = False
        """Level of `MC_Power.Enable` as last called."""
        self.enabled = False
        """`MC_Power.Status` and `StatusWord.X0`."""
        self.start_mode = 1
        """Without effect (STP-027)."""

    @property
    def busy(self) -> bool:
        """`MC_Power.Busy`: enabled, or to be enabled."""
        return self.enable

    @property
    def alarmed(self) -> bool:
        """Whether an alarm keeps an object disabled that is to be enabled."""
        return self.enable and not self.enabled and self._engine.reaction != 0

    def call(self, *, enable: bool, start_mode: int, stop_mode: int) -> tuple[bool, bool, bool]:
        """Take the inputs of `MC_Power` over, where there is nothing to stop; returns `enabled`, `busy` and
        `alarmed`.
        """
        del start_mode, stop_mode
        self.enable = enable
        if not enable:
            self._set(False)
        return self.enabled, enable, self.alarmed

    def step(self, *, valid: bool, restarting: bool) -> None:
        """Follow input, encoder value and alarms.

        Args:
            valid: The encoder value is valid.
            restarting: The object is being initialised.

        """
        if not self._joined:
            if valid:
                self._joined = True
            elif self.enable:
                self._joined = True
                self._engine.raise_alarm(ALARM_ENCODER_NOT_READY, info=NOT_INITIALISED)
        wanted = self.enable and self._engine.reaction == 0 and not restarting
        # A value that becomes invalid without an alarm does not end what has been enabled.
        self._set(wanted and (self.enabled or valid))

    def _set(self, enabled: bool) -> None:
        if enabled is self.enabled:
            return
        self.enabled = enabled
        if self._history is not None:
            self._history.emit(self._name, "power.status", value=enabled)


class ExternalEncoder(TechnologyObject):
    """`TO_ExternalEncoder` on a port of the bench.

    Args:
        name: Name in history and trace.
        port: Where the encoder value comes from.
        cycle_ns: Application cycle, ns.
        variables: Start values by their original path, for example `{"Mechanics.LeadScrew": 5.0}`.
        history: Event log, or None.

    Raises:
        ConfigurationError: A variable does not exist, its value is out of range,
            or values do not fit together.

    """

    object_type: ClassVar[str] = "ExternalEncoder"
    kinds: ClassVar[tuple[str, ...]] = ("ExternalEncoder",)
    trace_enums: ClassVar[dict[str, dict[int, str]]] = {}

    def __init__(
        self,
        name: str,
        port: EncoderPort | DrivePort,
        *,
        cycle_ns: int,
        variables: Mapping[str, object] | None = None,
        history: History | None = None,
    ) -> None:
        start_values = given_values(dict(variables or {}))
        store = VariableStore(self.object_type, start_values, name=name, history=history)
        if "Sensor.Type" not in start_values and port.absolute_encoder:
            store.preset("Sensor.Type", 1)
        super().__init__(
            name, store, AlarmEngine(name, object_type=self.object_type, history=history), history
        )
        self.port = port
        self.cycle_s = cycle_ns * 1e-9
        self._state = AxisState.DISABLED
        self._enabling = EncoderEnabling(name, history, self.engine)
        self.homed = False
        self.digital_input: Callable[[], bool] | None = None
        """Level of the input that is reference cam or homing mark; None = none is wired."""
        self.standstill = False
        self._standstill_time = 0.0
        self._was_linked = False
        self._feedback: Feedback | None = None
        self._adaption: Adaption | None = None
        problems = self.check(start=False)
        if problems:
            raise problems[0].error(problems[1:])
        self._threshold = store.bind("StandstillSignal.VelocityThreshold")
        self._dwell = store.bind("StandstillSignal.MinDwellTime")
        self._farthest = farthest_position(store.read_int("Units.LengthUnit"))
        self.apply_configuration()
        self._live = self._readers = in_its_units(self._live_variables(), store)
        unit = store.unit("ActualPosition")
        self.trace_columns: tuple[tuple[str, str], ...] = (
            ("position", unit),
            ("velocity", f"{unit}/s"),
            ("state", ""),
            ("status_word", ""),
            ("error_word", ""),
        )

    @property
    @override
    def state(self) -> AxisState:
        return self._state

    @property
    @override
    def enabling(self) -> EncoderEnabling:
        return self._enabling

    @property
    @override
    def simulated(self) -> bool:
        return False

    @property
    def feedback(self) -> Feedback:
        """Position and velocity, unwrapped."""
        assert self._feedback is not None  # made by the constructor
        return self._feedback

    @property
    def sensor_valid(self) -> bool:
        """Whether the actual position is valid (`StatusSensor.State` = 2)."""
        return self.feedback.state == VALID

    @property
    def operative_sensor(self) -> int:
        """Number of its encoder."""
        return 1

    @override
    def check(self, *, start: bool) -> list[Problem]:
        return check_configuration(
            self.variables, Abilities(velocities=(self.port.brings_speed,)), start=start
        )

    @override
    def apply_configuration(self, *, powered_off: bool = False) -> None:
        self._derive(restart=True, powered_off=powered_off)
        store = self.variables
        absolute = not self.incremental
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
        scale = mechanics_of(store).sensors[0]
        self.modulo = modulo_of(store)
        before = self._feedback
        if before is not None and not restart and before.scale == scale:
            return
        if isinstance(self.port, EncoderPort):
            self.port.set_reference(scale.reference)
        offset = store.bind("StatusSensor.AbsEncoderOffset")
        self._feedback = EncoderFeedback(
            self.port, scale, self.cycle_s, offset, before=before, powered_off=powered_off
        )
        # There is no setpoint, so that the actual value is also what is delayed for followers.
        self.leading_value = leading_value_of(
            store,
            cycle_s=self.cycle_s,
            acquisition_s=float(store.parameter(1010).cell.value) or 0.5 * self.cycle_s,
            feedback=lambda: self.feedback,
            setpoint=self._actual_value,
        )
        self._leading = self.leading_value.in_use()
        self.homed = False

    def _actual_value(self) -> Value:
        feedback = self.feedback
        return (
            feedback.position,
            feedback.velocity,
            (feedback.velocity - feedback.last_velocity) / self.cycle_s,
        )

    @override
    def leading_by(self, coupling: str) -> Callable[[], Value]:
        """Return the extrapolated actual value; an external encoder has no setpoint (SYN-003)."""
        return lambda: self.leading_value.extrapolated()  # noqa: PLW0108 - a restart makes another one

    @property
    @override
    def stands(self) -> bool:
        return self.standstill

    @property
    @override
    def leading_modulo(self) -> Modulo:
        return self.modulo

    @override
    def gives_value(self) -> bool:
        if self.leading_defective:
            return False
        return self._state is not AxisState.RESTARTING and self.sensor_valid

    # -- cycle

    def cycle(self) -> None:
        """Run one application cycle."""
        if self._state is not AxisState.RESTARTING and self.variables.latch():
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
        self._enabling.step(valid=feedback.state == VALID, restarting=self._state is AxisState.RESTARTING)
        if not -self._farthest <= feedback.position <= self._farthest:
            engine.raise_alarm(ALARM_RANGE_EXCEEDED, info=2 if feedback.position > 0.0 else 1)
        self._watch_standstill(abs(feedback.velocity))
        if self._resets:
            self._step_resets()

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

    # -- restart and operating states of the controller

    @property
    @override
    def restart_refused(self) -> bool:
        return self._enabling.enable

    @override
    def hold_back(self) -> None:
        self._state = AxisState.RESTARTING

    @override
    def release(self) -> None:
        self._state = AxisState.DISABLED

    @override
    def acknowledge(self, age: int) -> bool:
        self.engine.acknowledge()
        self.engine.update()
        return True

    @override
    def switch_outputs(self, on: bool) -> None:
        pass  # it has no drive

    @override
    def clear_alarms(self) -> None:
        self.engine.restart()

    @override
    def forget_encoders(self) -> None:
        self._feedback = None

    @override
    def _abort_jobs(self) -> None:
        pass  # it has no motion jobs

    @override
    def _end_functions(self) -> None:
        pass  # nor functions

    @override
    def _withdraw_enable(self) -> None:
        self._enabling.call(enable=False, start_mode=1, stop_mode=0)

    @override
    def _power_down(self) -> None:
        self.release()
        self._show_restart(False)
        self._withdraw_enable()
        self.engine.power_down()
        self.standstill = self._was_linked = False
        self._standstill_time = 0.0

    # -- homing

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

    def sensor_path(self, number: int) -> str:  # noqa: ARG002 - there is one
        """Return where the variables of the encoder begin."""
        return "Sensor"

    def homing_switch(self, path: str) -> bool:
        """Return whether the digital input has the level of `path.SwitchLevel`
        (HOM-062); FALSE where none is wired.
        """
        wired = self.digital_input
        level = self.variables.read_bool(f"{path}.SwitchLevel")
        return wired is not None and wired() is level

    def shift_setpoints(self, offset: float) -> None:
        """Let the leading value follow a shift of the coordinate system; there are no setpoints."""
        self.leading_value.shift(offset)

    def ends_passive_homing(self) -> int | None:
        """Return why passive homing cannot continue: an ErrorID, 0 = it is aborted, None = it can."""
        if self.engine.error_word:
            return ERROR_ALARM
        return None if self._enabling.enabled else 0

    def alarm(self, number: int) -> None:
        """Raise a technology alarm; those of homing, which this object does not have, become alarm 411."""
        if number in _ALARMS_OF_HOMING:
            self.engine.raise_alarm(ALARM_ENCODER, info=ENCODER_SIGNALS_ALARM, text=_NO_MARK)
        else:
            self.engine.raise_alarm(number)

    # -- what it shows

    def status_word(self) -> int:
        """Return `StatusWord` for the present cycle."""
        word = RESTART_ACTIVE if self._state is AxisState.RESTARTING else DONE
        if self._enabling.enabled:
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

    def _live_variables(self) -> Live:
        return (
            live_leading_value(lambda: self.leading_value, lambda: self.modulo)
            | live_alarms(self.engine)
            | {
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
            }
        )

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
