"""Automatic transfer of drive and encoder parameters at start-up (CFG section 18, VAR-106).

Setpoints and actual values are shares of reference values, so controller and drive must have the same ones.
Where `Actor.DataAdaption` or `Sensor[n].DataAdaption` says so, they are read from the drive: after every
(re)initialisation of the technology object, and whenever the drive comes back. Nothing waits: a request is
put, its answer comes by a call, and the axis cannot be enabled before.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from math import isfinite, nan, tau
from typing import TYPE_CHECKING, Final, NamedTuple, Protocol

from motion.s7.units import millimetres

if TYPE_CHECKING:
    from fieldbus.history import History
    from motion.s7.variables import VariableStore

NOT_ADAPTED: Final = 0
IN_ADAPTION: Final = 1
ADAPTED: Final = 2
NOT_APPLICABLE: Final = 3
ADAPTION_ERROR: Final = 4

ALARM_DRIVE_TRANSFER: Final = 102
ALARM_ENCODER_TRANSFER: Final = 103
ALARM_DRIVE_DIFFERS: Final = 111
ALARM_ENCODER_DIFFERS: Final = 112
ALARM_ENCODER_AT_START: Final = 552

_STATES: Final = ("NOT_ADAPTED", "IN_ADAPTION", "ADAPTED", "NOT_APPLICABLE", "ADAPTION_ERROR")
_VALID: Final = 1 << 31
_LINEAR: Final = 1
_LINEAR_MOTOR: Final = 1 << 12
_MOST_STEPS: Final = 8388608

TELEGRAM: Final = 922
MOTOR: Final = 108
REFERENCE_SPEED: Final = 2000
MAXIMUM_SPEED: Final = 1082
REFERENCE_TORQUE: Final = 2003
UPPER_TORQUE: Final = 1520
LOWER_TORQUE: Final = 1521
MOTOR_INERTIA: Final = 341
LOAD_INERTIA: Final = 1498
ENCODER_FORMAT: Final = 979
_ENCODER_ELEMENTS: Final = 10

Answer = Callable[[float | None, str], object]
"""Called with the value of a parameter, or None and the reason why there is none."""


class ParameterSource(Protocol):
    """Connection through which parameters can be read."""

    link_ok: bool
    has_parameters: bool
    telegram_number: int

    def read_parameter(self, number: int, index: int, answer: Answer) -> None:
        """Begin to read element `index` of parameter `number`; `answer` is called later, once."""


class AlarmSink(Protocol):
    """Where alarms go."""

    def raise_alarm(self, number: int, *, info: int = 0, text: str = "") -> object:
        """Raise an alarm."""


class Read(NamedTuple):
    """A parameter to be read, and the number of the cause in the alarm if that fails (TA-013); 0 = the
    transfer continues without it.
    """

    number: int
    element: int
    cause: int

    def __str__(self) -> str:
        letter = "r" if self.number == MOTOR else "p"
        return f"{letter}{self.number:04d}" + (
            f"[{self.element}]" if self.number in (MOTOR, ENCODER_FORMAT) else ""
        )


class InvalidValueError(ValueError):
    """A parameter has a value that no axis can work with.

    Args:
        message: What is wrong.
        place: Which one of the parameters read it is, from 0.

    """

    def __init__(self, message: str, place: int) -> None:
        super().__init__(message)
        self.place = place


_DRIVE_READS: Final = (
    Read(TELEGRAM, 0, 9), Read(MOTOR, 0, 8), Read(REFERENCE_SPEED, 0, 6), Read(MAXIMUM_SPEED, 0, 2),
    Read(REFERENCE_TORQUE, 0, 7), Read(UPPER_TORQUE, 0, 3), Read(LOWER_TORQUE, 0, 4),
)  # fmt: skip


_INERTIA_READS: Final = (Read(MOTOR_INERTIA, 0, 0), Read(LOAD_INERTIA, 0, 0))
"""Of a drive with dynamic servo control (CFG-580)."""


def _encoder_reads(interface: int) -> tuple[Read, ...]:
    first = 1 + _ENCODER_ELEMENTS * (interface - 1)
    format_reads = (Read(ENCODER_FORMAT, first + at, cause) for at, cause in enumerate((2, 3, 4, 5, 6)))
    return (*format_reads, Read(REFERENCE_SPEED, 0, 7))


class _Transfer:
    """One part: the drive, or one encoder. `take` turns the values read into variables."""

    def __init__(
        self,
        store: VariableStore,
        source: ParameterSource,
        *,
        prefix: str,
        state_path: str,
        alarm: int,
        reads: tuple[Read, ...],
        name: str,
        history: History | None,
    ) -> None:
        self.store = store
        self.source = source
        self.prefix = prefix
        self.state_path = state_path
        self.alarm = alarm
        self.reads = reads
        self.selected: bool = store.read(f"{prefix}.DataAdaption") == 1
        self.state = NOT_APPLICABLE
        self.unused_cause = 0
        self._axis_name = name
        self._history = history
        self._values: list[float] = []
        self._at = 0
        self._age = 0

    def set_state(self, state: int, reason: str = "") -> None:
        if state == self.state and state == self.store.read(self.state_path):
            return
        self.state = state
        self.store.set_internal(self.state_path, state)
        if self._history is not None and self.selected:
            self._history.emit(
                self._axis_name, "axis.adaption", part=self.prefix, state=_STATES[state], reason=reason
            )

    def begin(self, on_end: Callable[[_Transfer, list[float] | None, str, int], None]) -> None:
        """Read everything, one after the other; `on_end` gets the values, or None
        with the reason and its number.
        """
        self._age += 1
        age = self._age
        self._values = []
        self.set_state(IN_ADAPTION)

        def ask() -> None:
            read = self.reads[len(self._values)]

            def answer(value: float | None, reason: str) -> None:
                if age != self._age or self.state != IN_ADAPTION:
                    return  # the answer to a question of before
                if value is None and read.cause == 0:
                    value = nan
                if value is None:
                    on_end(self, None, f"{read}: {reason}", read.cause)
                    return
                self._values.append(value)
                if len(self._values) < len(self.reads):
                    ask()
                else:
                    on_end(self, self._values, "", 0)

            self.source.read_parameter(read.number, read.element, answer)

        ask()

    def cancel(self) -> None:
        """Let no answer to an earlier question count any more."""
        self._age += 1

    def forget(self) -> None:
        """Wait for the drive."""
        self.cancel()
        self.set_state(NOT_ADAPTED)


def _positive(values: list[float], place: int, what: str) -> float:
    value = values[place]
    if not (isfinite(value) and value > 0.0):
        raise InvalidValueError(f"{what} = {value:g} is not above 0", place)
    return value


def _whole(values: list[float], place: int, low: int, high: int, what: str) -> int:
    value = values[place]
    if not (isfinite(value) and low <= value <= high and value == int(value)):
        raise InvalidValueError(f"{what} = {value:g} is not within {low} to {high}", place)
    return int(value)


class Adaption:
    """The transfer of one technology object.

    Args:
        store: Its variables.
        drive: Port of the drive; None for an external encoder.
        encoders: Port of every encoder in turn.
        alarms: Where alarms go.
        apply: Called after values of the variables in effect have changed.
        simulated: Whether the connection is not used; then nothing is transferred.
        name: Source of history events.
        history: Log, or None.

    """

    def __init__(
        self,
        store: VariableStore,
        drive: ParameterSource | None,
        encoders: tuple[ParameterSource, ...],
        alarms: AlarmSink,
        apply: Callable[[], None],
        *,
        simulated: bool = False,
        name: str = "",
        history: History | None = None,
    ) -> None:
        self._store = store
        self._alarms = alarms
        self._apply = apply
        self._done_once: dict[str, tuple[object, ...]] = {}
        self.ready = True
        """Whether nothing stands against enabling: everything that is selected is
        transferred (CFG-353, CFG-354).
        """
        parts = []
        if drive is not None:
            dsc = store.object_type != "SpeedAxis" and store.read("PositionControl.EnableDSC")
            parts.append(
                _Transfer(
                    store,
                    drive,
                    prefix="Actor",
                    state_path="StatusDrive.AdaptionState",
                    alarm=ALARM_DRIVE_TRANSFER,
                    reads=(*_DRIVE_READS, *_INERTIA_READS) if dsc else _DRIVE_READS,
                    name=name,
                    history=history,
                )
            )
        for number, encoder in enumerate(encoders, start=1):
            place = "" if store.object_type == "ExternalEncoder" else f"[{number}]"
            prefix = f"Sensor{place}"
            if place and not store.read(f"{prefix}.Existent"):
                continue
            parts.append(
                _Transfer(
                    store,
                    encoder,
                    prefix=prefix,
                    state_path=f"StatusSensor{place}.AdaptionState",
                    alarm=ALARM_ENCODER_TRANSFER,
                    reads=_encoder_reads(store.read_int(f"{prefix}.Interface.Number")),
                    name=name,
                    history=history,
                )
            )
        for part in parts:
            part.selected = part.selected and not simulated
            part.set_state(NOT_ADAPTED if part.selected else NOT_APPLICABLE)
        self._parts = tuple(part for part in parts if part.selected)
        self._link = [False] * len(self._parts)
        self._refresh()

    @property
    def active(self) -> bool:
        """Whether `step` has anything to do at all."""
        return bool(self._parts)

    def states(self) -> Iterator[tuple[str, int]]:
        """Yield prefix and state of every selected part."""
        for part in self._parts:
            yield part.prefix, part.state

    def _refresh(self) -> None:
        self.ready = all(part.state == ADAPTED for part in self._parts)

    def step(self) -> None:
        """Look whether the drive has come or gone; once per cycle, where `active`."""
        for at, part in enumerate(self._parts):
            link = part.source.link_ok
            if part.state == NOT_ADAPTED and not part.source.has_parameters:
                self._fail(part, "the connection has no parameter access", 1)
                continue
            if link is self._link[at]:
                continue
            self._link[at] = link
            if part.state == ADAPTION_ERROR:
                continue  # only a restart of the technology object helps (CFG-355)
            if link:
                part.begin(self._end)
            else:
                part.forget()
            self._refresh()

    def close(self) -> None:
        """Ask nothing more, and take no answer any more: another one takes over."""
        for part in self._parts:
            part.cancel()
        self._parts = ()

    # -- what has been read
    # -------------------------------------------------------------------------------------

    def _end(self, part: _Transfer, values: list[float] | None, reason: str, cause: int) -> None:
        if values is None:
            self._fail(part, reason, cause)
            return
        try:
            changes = self._drive(part, values) if part.prefix == "Actor" else self._encoder(part, values)
        except InvalidValueError as error:
            self._fail(part, str(error), part.reads[error.place].cause)
            return
        bind = self._store.bind
        changed = {path: value for path, value in changes.items() if bind(path).value != value}
        before = self._done_once.get(part.prefix)
        self._done_once[part.prefix] = tuple(changes.values())
        if changed:
            for path, value in changed.items():
                self._store.set_internal(path, value)
            self._apply()
            if before is not None and part.prefix != "Actor":
                # It was in service with other data before: positions mean something else now.
                self._alarms.raise_alarm(
                    ALARM_ENCODER_AT_START, info=2, text="encoder data have changed: " + ", ".join(changed)
                )
        part.set_state(ADAPTED)
        self._refresh()

    def _fail(self, part: _Transfer, reason: str, cause: int) -> None:
        part.set_state(ADAPTION_ERROR, reason)
        self._refresh()
        self._alarms.raise_alarm(part.alarm, info=cause, text=reason)

    def _drive(self, part: _Transfer, values: list[float]) -> dict[str, float]:
        telegram, motor, _, _, _, _, _, *inertias = values
        if part.source.telegram_number and telegram != part.source.telegram_number:
            self._alarms.raise_alarm(
                ALARM_DRIVE_DIFFERS,
                info=1,
                text=f"telegram {part.source.telegram_number}, p0922 = {telegram:g}",
            )
        linear = bool(int(motor) & _LINEAR_MOTOR)
        speed_axis = self._store.object_type == "SpeedAxis"
        if linear and (speed_axis or self._store.read("Properties.MotionType") == 1):
            self._alarms.raise_alarm(ALARM_DRIVE_DIFFERS, info=5, text="linear motor configured in the drive")
            linear = False
        references = tuple(
            _positive(values, place, what) for place, what in ((2, "p2000"), (3, "p1082"), (4, "p2003"))
        )
        for at, name in ((5, "p1520"), (6, "p1521")):
            if not isfinite(values[at]):
                raise InvalidValueError(f"{name} = {values[at]:g} is no torque", at)
        if linear:
            place = "Actor.LinearMotorDriveParameter."
            names = ("ReferenceVelocity", "MaxVelocity", "ReferenceForce")
        else:
            place, names = "Actor.DriveParameter.", ("ReferenceSpeed", "MaxSpeed", "ReferenceTorque")
        changes: dict[str, float] = {} if speed_axis else {"Actor.MotorType": int(linear)}
        changes |= {place + name: float(value) for name, value in zip(names, references, strict=True)}
        if inertias:
            changes |= self._inertias(*inertias, linear=linear)
        return changes

    def _inertias(self, motor: float, load: float, *, linear: bool) -> dict[str, float]:
        """Return the inertias of the drive, p0341 and p1498, the second one as it is at the load (CFG-575 to
        CFG-577, CFG-581).
        """
        read = self._store.read
        changes: dict[str, float] = {}
        if motor >= 0.0:
            place = "LinearMotorDriveParameter.MotorMass" if linear else "DriveParameter.MotorInertia"
            changes[f"Actor.{place}"] = motor
        if load >= 0.0:
            if not linear:
                load *= (read("LoadGear.Numerator") / read("LoadGear.Denominator")) ** 2
                if read("Properties.MotionType") == 0:
                    load *= (
                        tau
                        * 1e3
                        / read("Mechanics.LeadScrew")
                        / millimetres(self._store.read_int("Units.LengthUnit"))
                    ) ** 2
            changes["Actor.LoadInertia"] = load
        return changes

    def _encoder(self, part: _Transfer, values: list[float]) -> dict[str, float]:
        kind, _, _, _, revolutions, _ = values
        prefix = part.prefix
        bits = int(kind)
        if not bits & _VALID:
            raise InvalidValueError("p0979: the encoder is not valid (bit 31 of its type)", 0)
        linear = bool(bits & _LINEAR)
        if linear and self._store.read("Properties.MotionType") == 1:
            raise InvalidValueError("p0979: a linear encoder cannot measure a rotary object", 0)
        absolute = self._store.read(f"{prefix}.Type") != 0
        if absolute is not (revolutions > 0):
            self._alarms.raise_alarm(
                ALARM_ENCODER_DIFFERS,
                info=2 if absolute else 5,
                text=f"{prefix}.Type = {self._store.read(f'{prefix}.Type')}, p0979 has {revolutions:g} "
                f"revolutions",
            )
        place = f"{prefix}.Parameter."
        changes: dict[str, float] = {
            f"{prefix}.System": 0 if linear else 1,
            f"{place}FineResolutionXist1": _whole(values, 2, 0, 31, "p0979, fine resolution of Gx_XIST1"),
            f"{place}FineResolutionXist2": _whole(values, 3, 0, 31, "p0979, fine resolution of Gx_XIST2"),
            f"{place}DeterminableRevolutions": _whole(values, 4, 0, _MOST_STEPS, "p0979, revolutions"),
        }
        if linear:
            unit = millimetres(self._store.read_int("Units.LengthUnit"))
            changes[f"{place}Resolution"] = _positive(values, 1, "p0979, distance of lines") * 1e-6 / unit
            changes[f"{place}ReferenceVelocity"] = _positive(values, 5, "p2000")
        else:
            changes[f"{place}StepsPerRevolution"] = _whole(values, 1, 1, _MOST_STEPS, "p0979, resolution")
            changes[f"{place}ReferenceSpeed"] = _positive(values, 5, "p2000")
        return changes
