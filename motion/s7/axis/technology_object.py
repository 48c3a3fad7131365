"""What axis and external encoder have in common: variables, data block, alarms, restart, and what they keep.

| kept over | RUN-STOP-RUN | restart of the object | download | power off, memory reset | factory reset |
|---|---|---|---|---|---|
| values assigned (DIR, CAL, `MC_WriteParameter` 1000 and 1020) | yes | no | no | no | no |
| start values written in load memory | yes | yes | as downloaded | yes | yes |
| T_i, T_o, T_DC of `MC_WriteParameter` | yes | yes | no | no | no |
| position, modulo counter, homed: incremental encoder | yes | no | no | no | no |
| position, modulo counter, homed: absolute encoder | yes | yes | yes | by encoder value and offset | no |
| bits of `MC_SetAxisSTW`, jobs, torque functions | no | no | no | no | no |

(MC-444, MC-460, MC-461, VAR-012, VAR-013, CFG-270, CFG-271, CFG-108 to CFG-115, HOM-179 to HOM-190.)
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable, Mapping
from functools import partial
from itertools import count
from typing import TYPE_CHECKING, ClassVar, Final, Protocol, TypeVar

from motion.kernel.mechanics import INCREMENTAL
from motion.kernel.modulo import NO_MODULO
from motion.s7.axis.homing.passive import abort_passive
from motion.s7.axis.jobs import ERROR_CONFIGURATION, NO_ERROR
from motion.s7.axis.state import AxisState
from motion.s7.compatibility import DEFAULT

if TYPE_CHECKING:
    from collections.abc import Iterator

    from fieldbus.history import History
    from motion.kernel.leading_value import LeadingValue, Value
    from motion.kernel.modulo import Modulo
    from motion.s7.alarms import AlarmEngine
    from motion.s7.axis.configuration import Problem
    from motion.s7.axis.homing.direct import Homing
    from motion.s7.variables import VariableStore

ALARM_CONFIGURATION: Final = 101
ALARM_RESTART_REFUSED: Final = 322
_CONFIGURATION: Final = (ALARM_CONFIGURATION, 109)
"""Alarms that stay until the configuration has been put right and the object restarted: as a whole, and of a
limit switch.
"""
_RESTART_CYCLES: Final = 5
"""Cycles that the re-initialisation takes."""
_OFFSET: Final = ".AbsEncoderOffset"
_RESTING: Final = frozenset((AxisState.DISABLED, AxisState.ALARM_DISABLED))

SETPOINT: Final = "setpoint"
ACTUAL: Final = "actual"
DELAYED: Final = "delayed"
"""Types of coupling: the setpoint, the extrapolated actual value, the delayed setpoint (SYN-020)."""

V = TypeVar("V")
Live = dict[str, Callable[[], int | float]]
"""Readers of the variables that the runtime does not keep in the store, by path."""


def frozen(live: Live) -> Live:
    """Return readers of what `live` says now, for the time in which the object
    is being initialised (VAR-228).
    """
    return {path: partial(_kept, reader()) for path, reader in live.items()}


def _kept(value: V) -> V:
    return value


def in_its_units(live: Live, store: VariableStore) -> Live:
    """Return the readers of what the object has, in its units in place of those of the runtime (CFG-072)."""
    known = set(store.paths())
    found: Live = {}
    for path, reader in live.items():
        if path in known:
            factor = store.factors.of(store.describe(path).unit)
            found[path] = reader if factor == 1.0 else partial(_converted, reader, factor)
    return found


def _converted(reader: Callable[[], float], factor: float) -> float:
    return reader() / factor


def live_leading_value(get: Callable[[], LeadingValue], modulo: Callable[[], Modulo]) -> Live:
    """Return the readers of the variables that show a leading value, for an
    object that may get another one.
    """
    status, given = "StatusExtrapolation.", "StatusProvidedLeadingValue.DelayedLeadingValue."
    return {
        "Extrapolation.LeadingAxisDependentTime": lambda: get().leading_time_s,
        f"{status}FilteredPosition": lambda: modulo().wrap(get().filtered_position),
        f"{status}FilteredVelocity": lambda: get().filtered_velocity,
        f"{status}ExtrapolatedPosition": lambda: modulo().wrap(get().position),
        f"{status}ExtrapolatedVelocity": lambda: get().velocity,
        f"{given}Position": lambda: modulo().wrap(get().delayed()[0]),
        f"{given}Velocity": lambda: get().delayed()[1],
        f"{given}Acceleration": lambda: get().delayed()[2],
    }


def live_alarms(engine: AlarmEngine) -> Live:
    """Return the readers of the variables that show the alarms of an object."""
    return {
        "ErrorWord": lambda: engine.error_word,
        "WarningWord": lambda: engine.warning_word,
        "ErrorDetail.Number": lambda: engine.number,
        "ErrorDetail.Reaction": lambda: engine.reaction,
    }


class Enabling(Protocol):
    """What `MC_Power` commands and sees of an object."""

    start_mode: int

    @property
    def enable(self) -> bool:
        """Level of `MC_Power.Enable` as last called."""

    @property
    def enabled(self) -> bool:
        """`MC_Power.Status`."""

    @property
    def busy(self) -> bool:
        """`MC_Power.Busy`."""

    @property
    def alarmed(self) -> bool:
        """Whether an alarm keeps an object disabled that is to be enabled (MC-167)."""

    def call(self, *, enable: bool, start_mode: int, stop_mode: int) -> tuple[bool, bool, bool]:
        """Take the inputs of `MC_Power` over; returns `enabled`, `busy` and `alarmed`."""


class Restartable(Protocol):
    """What `MC_Reset` acknowledges or restarts."""

    engine: AlarmEngine
    """Pending alarms."""

    def begin_restart(self) -> None:
        """Begin to be initialised."""

    def finish_restart(self) -> None:
        """Put the start values into force, or raise alarm 101."""

    def acknowledge(self, age: int) -> bool:
        """Acknowledge the alarms, in the `age`-th cycle of the instruction; returns whether that is done."""


class Reset:
    """One execution of `MC_Reset`; the object steps it.

    Args:
        owner: The object.
        restart: Restart it; otherwise its alarms are acknowledged.

    """

    def __init__(self, owner: Restartable, *, restart: bool) -> None:
        self._owner = owner
        self._age = 0
        self.restart = restart
        self.done = False
        self.error_id = NO_ERROR
        """Why the instruction ends with an error, once `done`: 16#8015, the configuration is still wrong
        (TA-008, MC-609).
        """
        if restart:
            owner.begin_restart()

    def step(self) -> None:
        """Advance by one application cycle."""
        self._age += 1
        owner = self._owner
        if self.restart:
            if self._age < _RESTART_CYCLES:
                return
            owner.finish_restart()
        elif not owner.acknowledge(self._age):
            return
        wrong = any(map(owner.engine.is_pending, _CONFIGURATION))
        self.error_id = ERROR_CONFIGURATION if wrong else NO_ERROR
        self.done = True


class TechnologyObject:
    """Base of axis and external encoder; the module says what is kept over which event.

    Args:
        name: Name in history and trace.
        variables: Its variables.
        engine: Its pending alarms.
        history: Event log, or None.

    """

    object_type: ClassVar[str] = ""
    kinds: ClassVar[tuple[str, ...]] = ()
    """Types of technology objects as which instructions take it: its own, and the
    one whose functions it contains.
    """
    has_position: ClassVar[bool] = False
    """It has a setpoint position that a job can move."""
    cpu: str = DEFAULT
    """Controller that the object belongs to, one of `motion.s7.compatibility.LEVELS`."""
    connection: str = "direct"

    def __init__(
        self, name: str, variables: VariableStore, engine: AlarmEngine, history: History | None
    ) -> None:
        self.name = name
        self.variables = variables
        self.engine = engine
        """Pending alarms."""
        self.history = history
        self.homings: list[Homing] = []
        """Active and passive homing under way (StatusWord.X11)."""
        self.on_homing: list[Callable[[], object]] = []
        """Called when a homing job starts that looks for a mark, or cancels one that does."""
        self.master: object | None = None
        """The control panel that has the object; None = the user program (`StatusWord.X4`)."""
        self.db_number = 0
        """Number of its data block, from 1 on in the order in which the controller has got its axes and
        encoders; 0 outside of a controller.
        """
        self.power_owner: object | None = None
        """The `MC_Power` instance that rules this object (MC-160)."""
        self._resets: list[Reset] = []
        self._live: Live = {}
        self._readers: Live = {}
        self._instances: dict[str, Iterator[int]] = {}

    # -- leading values: what an object gives that leads others

    leading_defective = False
    """It gives no value that could be followed, whatever it has (SYN-358)."""

    @property
    def leader(self) -> TechnologyObject | None:
        """The leading object of the synchronous job in control; None without one."""
        return None

    def leads_positions(self) -> bool:
        """Return whether the setpoint has positions that can be followed (alarm 603)."""
        return True

    @property
    def leading_modulo(self) -> Modulo:
        """Modulo range of its positions."""
        return NO_MODULO

    def lead(self) -> None:
        """Take note that a following axis is interconnected with this object."""

    @property
    def stands(self) -> bool:
        """Whether it has no motion (`StatusWord.X7`)."""
        return True

    def leading_by(self, coupling: str) -> Callable[[], Value]:
        """Return what gives the value of each cycle to a follower with this type of coupling, one of
        `SETPOINT`, `ACTUAL` and `DELAYED` (SYN-020).
        """
        raise NotImplementedError(f"{self.name} leads no axis by its {coupling} value")

    @property
    def local_delay_s(self) -> float | None:
        """Delay that an axis behind it has to have where it gives the value to a further controller, s; None:
        any (SYN-393).
        """
        return None

    def gives_value(self) -> bool:
        """Return whether the leading value is valid: a restart and a failed encoder make it invalid."""
        return False

    def instance_name(self, instruction: str) -> str:
        """Return the name of one more instance of an instruction: `axis1.MC_Power_1`."""
        numbers = self._instances.setdefault(instruction, count(1))
        return f"{self.name}.{instruction}_{next(numbers)}"

    # -- what the kinds of object do each in their way

    @property
    @abstractmethod
    def state(self) -> AxisState:
        """Enable/stop state."""

    @property
    @abstractmethod
    def enabling(self) -> Enabling:
        """What `MC_Power` commands and sees."""

    @property
    @abstractmethod
    def simulated(self) -> bool:
        """Whether no device is used."""

    @property
    @abstractmethod
    def restart_refused(self) -> bool:
        """Whether a restart is not possible now, because the object is enabled (VAR-007, MC-170)."""

    @abstractmethod
    def check(self, *, start: bool) -> list[Problem]:
        """Return what does not fit together, in the values in effect or in the
        start values of the next restart.
        """

    @abstractmethod
    def apply_configuration(self, *, powered_off: bool = False) -> None:
        """Derive everything from the variables, at start and after a restart.

        Args:
            powered_off: The controller has been without supply: nothing is kept but what is retentive.

        """

    @abstractmethod
    def forget_encoders(self) -> None:
        """Forget what the encoders have counted, also the ranges that an absolute encoder has passed."""

    @abstractmethod
    def hold_back(self) -> None:
        """Refuse jobs with 16#800D until `release` (MC-631)."""

    @abstractmethod
    def release(self) -> None:
        """End an initialisation: from now on the object takes jobs."""

    @abstractmethod
    def acknowledge(self, age: int) -> bool:
        """Acknowledge the alarms, in the `age`-th cycle of the instruction; returns whether that is done."""

    @abstractmethod
    def switch_outputs(self, on: bool) -> None:
        """Switch the process outputs of the object's drive."""

    @abstractmethod
    def clear_alarms(self) -> None:
        """Clear everything whose cause is gone, fatal alarms included."""

    @abstractmethod
    def _abort_jobs(self) -> None:
        """End all motion jobs with `CommandAborted`."""

    @abstractmethod
    def _end_functions(self) -> None:
        """Take back what instructions have set without a motion job: bits of
        control words, torque functions.
        """

    @abstractmethod
    def _withdraw_enable(self) -> None:
        """Disable the object with the effect of reaction 4 (STP-506)."""

    @abstractmethod
    def _power_down(self) -> None:
        """Lose what is not retentive; `apply_configuration` then begins again."""

    # -- acknowledging and restarting (section 2 of the stopping specification)

    def make_reset(self, *, restart: bool) -> Reset:
        """Return an execution of `MC_Reset`; the cycle carries it out."""
        reset = Reset(self, restart=restart)
        self._resets.append(reset)
        return reset

    def _step_resets(self) -> None:
        for reset in self._resets:
            reset.step()
        self._resets = [reset for reset in self._resets if not reset.done]

    def refuse_restart(self) -> None:
        """Warn that a restart was asked for that is not possible now."""
        self.engine.raise_alarm(ALARM_RESTART_REFUSED)

    def begin_restart(self) -> None:
        """Begin to be initialised; the data block shows what it shows now until that has ended (VAR-228)."""
        self._abort_jobs()
        self.hold_back()
        self._show_restart(True)

    def finish_restart(self) -> None:
        """Put the start values into force, or raise alarm 101."""
        self._initialise(self.variables.restart, powered_off=False)
        self.release()
        self._show_restart(False)

    def _initialise(self, take_over: Callable[[], object], *, powered_off: bool) -> None:
        """Put the start values of load memory into force, or disable the object with alarm 101."""
        problems = [str(problem) for problem in self.variables.violations() or self.check(start=True)]
        self.clear_alarms()
        if problems:
            self.engine.raise_alarm(ALARM_CONFIGURATION, text="; ".join(problems))
        else:
            take_over()
            self.apply_configuration(powered_off=powered_off)

    def _show_restart(self, begins: bool) -> None:
        self._live = frozen(self._readers) if begins else self._readers

    # -- operating states of the controller

    @property
    def resting(self) -> bool:
        """Whether the object is disabled: its drive is off, and nothing is under way."""
        return self.state in _RESTING

    def disable(self) -> None:
        """Take the object from the user program with the effect of reaction 4 (STP-506):
        jobs are aborted, the drive stops.
        """
        self.master = None
        abort_passive(self.homings)
        self._abort_jobs()
        self._end_functions()
        self._withdraw_enable()

    def power_down(self) -> None:
        """Lose everything that is not retentive, at once: jobs, enables, values."""
        self.master = None
        abort_passive(self.homings)
        self._abort_jobs()
        self._end_functions()
        self.homings.clear()
        self._resets = []
        self._power_down()
        self._initialise(self.variables.power_cycle, powered_off=True)

    def download(self, values: Mapping[str, object]) -> None:
        """Load start values of any access class and initialise the object with them.

        Raises:
            ConfigurationError: A variable does not exist, its value is out of range, or values do not fit
                together; then nothing has changed.

        """
        take_back = self.variables.load(values)
        problems = self.check(start=True)
        if problems:
            take_back()
            raise problems[0].error()
        self.forget_adjustment(only_incremental=True)
        self._initialise(self.variables.power_cycle, powered_off=False)

    def forget_adjustment(self, *, only_incremental: bool = False) -> None:
        """Delete the adjustment of the object's absolute encoders.

        Args:
            only_incremental: Only of those whose type is no longer an absolute one (HOM-157).

        """
        store = self.variables
        for path in [path for path in store.paths() if path.endswith(_OFFSET)]:
            sensor = path.removesuffix(_OFFSET)
            if only_incremental and store.read(f"{sensor.removeprefix('Status')}.Type") != INCREMENTAL:
                continue
            store.set_internal(path, 0.0)
            store.set_internal(f"{sensor}.Adjusted", 0)

    # -- variables under their original paths

    def var(self, path: str) -> int | float:
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
            number = int(bit[1:])
            if number > 15:
                self.variables.read(path)  # refuses a bit that the word does not have
            return bool(int(self._live[head]()) >> number & 1)
        return self.variables.read(path)

    def write(self, path: str, value: object) -> None:
        """Assign a variable like the user program does; the access class decides
        when it acts (VAR-001 to VAR-015).
        """
        self.variables.write(path, value)
