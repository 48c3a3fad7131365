"""External encoder: a technology object that acquires a position and moves nothing (CFG-016 to CFG-018, VAR-025)."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any, ClassVar, Final

from motion.alarms import AlarmEngine
from motion.axis.adaption import Adaption
from motion.axis.configuration import Abilities, Problem, check_configuration, derive_units
from motion.axis.feedback import VALID, Feedback
from motion.axis.mechanics import INCREMENTAL, Mechanics
from motion.axis.modulo import Modulo
from motion.axis.state import AxisState
from motion.axis.status import (
    DONE,
    ENABLE,
    ERROR,
    HOMING_DONE,
    ONLINE_START_VALUES_CHANGED,
    RESTART_ACTIVE,
    STANDSTILL,
)
from motion.variables import VariableStore

if TYPE_CHECKING:
    from fieldbus.history import History
    from motion.drives.encoder import EncoderPort
    from motion.drives.port import DrivePort

ALARM_CONFIGURATION: Final = 101
ALARM_ENCODER: Final = 411
ALARM_COMMUNICATION: Final = 431
_RESTART_CYCLES: Final = 5
_HYSTERESIS: Final = 1.1


class EncoderReset:
    """One execution of `MC_Reset` on an external encoder; the object steps it."""

    __slots__ = ("_age", "_object", "done", "restart")

    def __init__(self, external: ExternalEncoder, *, restart: bool) -> None:
        self._object = external
        self._age = 0
        self.restart = restart
        self.done = False
        if restart:
            external.state = AxisState.RESTARTING

    def step(self) -> None:
        """Advance by one application cycle."""
        self._age += 1
        external = self._object
        if not self.restart:
            external.engine.acknowledge()
            self.done = True
        elif self._age >= _RESTART_CYCLES:
            external.finish_restart()
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
        ConfigurationError: A variable does not exist, its value is out of range, or values do not fit together.

    """

    object_type: ClassVar[str] = "ExternalEncoder"
    connection: ClassVar[str] = "direct"
    simulated: ClassVar[bool] = False
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
        start_values = derive_units(dict(variables or {}))
        self.variables = VariableStore(self.object_type, start_values, name=name, history=history)
        if "Sensor.Type" not in start_values and port.absolute_encoder:
            self.variables.preset("Sensor.Type", 1)
        self.engine = AlarmEngine(name, object_type=self.object_type, history=history)
        self.state = AxisState.DISABLED
        self.homed = False
        self.standstill = False
        self._standstill_time = 0.0
        self._was_linked = False
        self._resets: list[EncoderReset] = []
        self._feedback: Feedback | None = None
        self._adaption: Adaption | None = None
        problems = self.check(start=False)
        if problems:
            raise problems[0].error()
        self._threshold = self.variables.bind("StandstillSignal.VelocityThreshold")
        self._dwell = self.variables.bind("StandstillSignal.MinDwellTime")
        self.apply_configuration()
        self._live = self._live_variables()
        unit = self.variables.unit("ActualPosition")
        self.trace_columns: tuple[tuple[str, str], ...] = (
            ("position", unit), ("velocity", f"{unit}/s"), ("state", ""), ("status_word", ""), ("error_word", ""),
        )  # fmt: skip

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
        """Return what does not fit together, in the values in force or in the start values of the next restart."""
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
        offset = store.bind("StatusSensor.AbsEncoderOffset")
        self._feedback = Feedback(
            self.port, scale, self.cycle_s, offset, before=before, powered_off=powered_off
        )
        self.homed = False

    # -- cycle ------------------------------------------------------------------------------------------------

    def cycle(self) -> None:
        """Run one application cycle."""
        if self.state is not AxisState.RESTARTING:
            self.variables.latch()
        port = self.port
        port.read()
        adaption = self._adaption
        if adaption is not None and adaption.active:
            adaption.step()
        feedback = self.feedback
        feedback.update()
        if feedback.lost_reference:
            feedback.lost_reference = False
            self.homed = False
        engine = self.engine
        engine.update()
        engine.set_cause(ALARM_COMMUNICATION, not port.link_ok and self._was_linked)
        engine.set_cause(ALARM_ENCODER, port.sensor_fault)
        if port.link_ok:
            self._was_linked = True
        self._watch_standstill(abs(feedback.velocity))
        for reset in self._resets:
            reset.step()
        if self._resets:
            self._resets = [reset for reset in self._resets if not reset.done]

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

    # -- instructions -----------------------------------------------------------------------------------------

    def make_reset(self, *, restart: bool) -> EncoderReset:
        """Return an execution of `MC_Reset`; the cycle carries it out."""
        reset = EncoderReset(self, restart=restart)
        self._resets.append(reset)
        return reset

    @property
    def restart_refused(self) -> bool:
        """Whether a restart is not possible now: an external encoder cannot be enabled."""
        return False

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

    def home(self, mode: int, position: float) -> None:
        """Carry out a direct homing; modes as those of a positioning axis without 11 and 12, which have a setpoint."""
        feedback, modulo = self.feedback, self.modulo
        offset = position - feedback.position if mode in (0, 7, 13) else position
        if modulo.enabled:
            offset = modulo.wrap(position) - feedback.position if mode == 7 else modulo.shortest(offset)
        feedback.shift(offset)
        self.homed = True
        if mode in (6, 7, 13):
            self.variables.set_internal("StatusSensor.Adjusted", 1)
        if mode in (6, 7):
            feedback.keep_offset()
        if self.history is not None:
            self.history.emit(self.name, "axis.homed", mode=mode, offset=offset)

    # -- variables under their original paths -----------------------------------------------------------------

    def status_word(self) -> int:
        """Return `StatusWord` for the present cycle."""
        restarting = self.state is AxisState.RESTARTING
        word = RESTART_ACTIVE if restarting else ENABLE | DONE
        if self.engine.error_word:
            word |= ERROR
        if self.variables.online_start_values_changed:
            word |= ONLINE_START_VALUES_CHANGED
        if self.homed:
            word |= HOMING_DONE
        if self.standstill:
            word |= STANDSTILL
        return word

    def _live_variables(self) -> dict[str, Callable[[], Any]]:
        engine = self.engine
        return {
            "ActualPosition": lambda: self.modulo.wrap(self.feedback.position),
            "ActualModuloCycle": lambda: self.modulo.cycle(self.feedback.position),
            "ActualVelocity": lambda: self.feedback.velocity,
            "ActualAcceleration": lambda: (
                (self.feedback.velocity - self.feedback.last_velocity) / self.cycle_s
            ),
            "StatusSensor.State": lambda: self.feedback.state,
            "StatusSensor.Position": lambda: self.modulo.wrap(self.feedback.position),
            "StatusSensor.ModuloCycle": lambda: self.modulo.cycle(self.feedback.position),
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
