"""What a technology object says about itself, in the pages on which an engineering tool shows it (section 4
of the instruction specification).

Words are taken from one snapshot of the object, so that bits of one page belong together (DIA-110).
"""

from __future__ import annotations

from dataclasses import dataclass
from textwrap import wrap
from typing import TYPE_CHECKING, Final

from fieldbus.profidrive.telegrams import describe_value

if TYPE_CHECKING:
    from motion.s7.alarms import AlarmEngine
    from motion.s7.axis.axis import TechnologyAxis
    from motion.s7.axis.external_encoder import ExternalEncoder

Row = tuple[str, str]
"""Indication, and its variable: `!` in front inverts a bit, `|` stands between bits of which one is enough,
`=` before values of which the variable has one.
"""
"""Indication and variable; a leading `!` inverts a bit."""

_MAXIMUM_SPEED: Final = "maximum velocity"
_STATUS: Final[tuple[Row, ...]] = (
    ("simulation active", "StatusWord.X25"),
    ("enabled", "StatusWord.X0"),
    ("error", "StatusWord.X1"),
    ("restart active", "StatusWord.X2"),
    ("control panel active", "StatusWord.X4"),
    ("drive ready", "StatusDrive.InOperation"),
    ("communication with the drive", "StatusDrive.CommunicationOK"),
    ("restart required", "StatusWord.X3"),
)
_POSITION_STATUS: Final[tuple[Row, ...]] = (
    ("position-controlled mode", "!StatusWord.X28"),
    ("homed", "StatusWord.X5"),
    ("encoder values valid", "StatusSensor[1].State"),
    ("encoder homed", "StatusSensor[1].Adjusted"),
)
_LIMIT_SWITCHES: Final[tuple[Row, ...]] = (
    ("negative software limit switch", "StatusWord.X15"),
    ("positive software limit switch", "StatusWord.X16"),
    ("negative hardware limit switch", "StatusWord.X17"),
    ("positive hardware limit switch", "StatusWord.X18"),
)
_MOTION: Final[tuple[Row, ...]] = (
    ("done", "StatusWord.X6"),
    ("jog", "StatusWord.X9"),
    ("velocity setpoint", "StatusWord.X10"),
    ("constant velocity", "StatusWord.X12"),
    ("accelerating", "StatusWord.X13"),
    ("decelerating", "StatusWord.X14"),
    ("torque limiting", "StatusWord.X26"),
    ("torque limit active", "StatusWord.X27"),
    ("stop job active", "StatusWord2.X0"),
)
_POSITION_MOTION: Final[tuple[Row, ...]] = (
    ("homing job", "StatusWord.X11"),
    ("positioning job", "StatusWord.X8"),
    ("standstill", "StatusWord.X7"),
    ("clamped at a fixed stop", "StatusWord.X30"),
    ("superimposed motion", "StatusWord.X23|StatusWord2.X6|StatusWord2.X7"),
    ("superimposed motion is halted", "StatusWord2.X7"),
)
_WAITS: Final = "StatusSynchronizedMotion.WaitingFunctionState"
_SYNCHRONOUS_MOTION: Final[tuple[Row, ...]] = (
    ("synchronisation pending", f"{_WAITS}=2,3"),
    ("synchronising", "StatusWord.X21"),
    ("synchronous", "StatusWord.X22"),
    ("desynchronisation pending", f"{_WAITS}=4,5"),
    ("desynchronising", "StatusWord2.X1"),
)
"""What a synchronous axis shows as well (SYN-386 to SYN-388)."""
_WARNINGS: Final[tuple[Row, ...]] = (
    ("configuration", "WarningWord.X1"),
    ("job rejected", "WarningWord.X3"),
    ("dynamic limit", "WarningWord.X6"),
    ("adaption", "WarningWord.X15"),
)
_POSITION_WARNINGS: Final[tuple[Row, ...]] = (("following error", "WarningWord.X11"),)
_ERRORS: Final[tuple[Row, ...]] = (
    ("system", "ErrorWord.X0"),
    ("configuration", "ErrorWord.X1"),
    ("user program", "ErrorWord.X2"),
    ("job rejected", "ErrorWord.X3"),
    ("drive", "ErrorWord.X4"),
    ("dynamic limit", "ErrorWord.X6"),
    ("data exchange", "ErrorWord.X7"),
    ("I/O", "ErrorWord.X13"),
    ("adaption", "ErrorWord.X15"),
)
_POSITION_ERRORS: Final[tuple[Row, ...]] = (
    ("encoder", "ErrorWord.X5"),
    ("software limit switch", "ErrorWord.X8"),
    ("hardware limit switch", "ErrorWord.X9"),
    ("homing", "ErrorWord.X10"),
    ("following error", "ErrorWord.X11"),
    ("positioning", "ErrorWord.X12"),
)
_VALUES: Final[tuple[Row, ...]] = (
    ("velocity override", "Override.Velocity"),
    (_MAXIMUM_SPEED, "DynamicLimits.MaxVelocity"),
    ("maximum acceleration", "DynamicLimits.MaxAcceleration"),
    ("maximum deceleration", "DynamicLimits.MaxDeceleration"),
    ("maximum jerk", "DynamicLimits.MaxJerk"),
)
_SPEED_VALUES: Final[tuple[Row, ...]] = (("speed setpoint", "Velocity"), ("actual speed", "ActualSpeed"))
_POSITION_VALUES: Final[tuple[Row, ...]] = (
    ("operative encoder", "OperativeSensor"),
    ("target position", "StatusPositioning.TargetPosition"),
    ("position setpoint", "Position"),
    ("velocity setpoint", "Velocity"),
    ("actual position", "ActualPosition"),
    ("actual velocity", "ActualVelocity"),
    ("following error", "StatusPositioning.FollowingError"),
)
_MEANINGS: Final[dict[str, dict[float, str]]] = {
    "encoder values valid": {0: "not valid", 1: "waiting for valid values", 2: "valid"},
    "encoder homed": {0: "no", 1: "yes"},
}
"""What the numbers of an indication mean (VAR-107)."""
_PER_TIME: Final = {"1/s2": "s", "1/s3": "s²"}
_IN_A_SECOND: Final = {"1/min": 60.0, "1/h": 3600.0}
"""Speed that one revolution per second is, in the other units of a speed axis."""
_WIDTH: Final = 110
_WORDS: Final = ("StatusWord", "StatusWord2", "ErrorWord", "WarningWord")

ENCODER_PAGES: Final[dict[str, tuple[Row, ...]]] = {
    "encoder status": (
        ("enabled", "StatusWord.X0"),
        ("homed", "StatusWord.X5"),
        ("error", "StatusWord.X1"),
        ("restart active", "StatusWord.X2"),
        ("encoder values valid", "StatusSensor.State"),
        ("encoder homed", "StatusSensor.Adjusted"),
        ("restart required", "StatusWord.X3"),
    ),
    "motion status": (
        ("done", "StatusWord.X6"),
        ("homing job", "StatusWord.X11"),
        ("standstill", "StatusWord.X7"),
    ),
    "warnings": (("job rejected", "WarningWord.X3"), ("adaption", "WarningWord.X15")),
    "errors": (
        ("system", "ErrorWord.X0"),
        ("configuration", "ErrorWord.X1"),
        ("user program", "ErrorWord.X2"),
        ("encoder", "ErrorWord.X5"),
        ("data exchange", "ErrorWord.X7"),
        ("I/O", "ErrorWord.X13"),
        ("adaption", "ErrorWord.X15"),
    ),
    "values": (("actual position", "ActualPosition"), ("actual velocity", "ActualVelocity")),
}
"""The pages of an external encoder (DIA-072 to DIA-087, DIA-096, DIA-097)."""


def pages(*, has_position: bool, follows: bool = False) -> dict[str, tuple[Row, ...]]:
    """Return the pages of a positioning or a speed axis, or one that `follows` others: title and rows
    (DIA-001 to DIA-071, DIA-089 to DIA-099).
    """
    if not has_position:
        return {
            "axis status": _STATUS,
            "motion status": _MOTION,
            "warnings": _WARNINGS,
            "errors": _ERRORS,
            "values": _SPEED_VALUES + _VALUES,
        }
    return {
        "axis status": _STATUS + _POSITION_STATUS,
        "limit switches": _LIMIT_SWITCHES,
        "motion status": _MOTION + _POSITION_MOTION + (_SYNCHRONOUS_MOTION if follows else ()),
        "warnings": _WARNINGS + _POSITION_WARNINGS,
        "errors": _ERRORS + _POSITION_ERRORS,
        "values": _POSITION_VALUES + _VALUES,
    }


@dataclass(frozen=True)
class Diagnosis:
    """A snapshot of one axis or external encoder.

    Args:
        axis: Name of the technology object.
        kind: Type of the technology object.
        state: State of enabling and stopping, as text.
        words: `StatusWord`, `StatusWord2` (of an axis), `ErrorWord`, `WarningWord`.
        pages: Page -> indication -> value: a truth value for a bit, else the value of the variable.
        alarms: Pending alarms, the one of highest priority first: number, reaction, text.
        job: Instruction and name of the job in control; None without one.
        telegram: Words of the drive's telegram by signal name, last sent and last received; those of an
            encoder with a telegram of its own follow, behind `Sensor[n].` on an axis (DIA-100 to DIA-102).
        units: Units of the indications that are values with a unit.

    """

    axis: str
    kind: str
    state: str
    words: dict[str, int]
    pages: dict[str, dict[str, float]]
    alarms: tuple[dict[str, int | str], ...]
    job: str | None
    telegram: dict[str, int]
    units: dict[str, str]

    def as_dict(self) -> dict[str, object]:
        """Return everything in types that JSON knows."""
        return {
            "axis": self.axis,
            "type": self.kind,
            "state": self.state,
            "job": self.job,
            "words": {name: f"16#{value:08X}" for name, value in self.words.items()},
            **self.pages,
            "units": self.units,
            "alarms": list(self.alarms),
            "telegram": {name: _described(name, value) for name, value in self.telegram.items()},
        }

    def text(self) -> str:
        """Return the pages as lines for a person: alarms first, then of every page what is set, the values
        with their units, and the names of what is not set.
        """
        lines = [f"{self.axis}  {self.kind}  {self.state}" + (f"  {self.job}" if self.job else "")]
        lines += ["", "alarms"]
        lines += [
            f"  {alarm['number']}  reaction {alarm['reaction']}  {alarm['text']}" for alarm in self.alarms
        ] or ["  none"]
        for title, rows in self.pages.items():
            lines += ["", title, *self._page(rows)]
        lines += ["", "telegram"]
        width = max(map(len, self.telegram), default=0) + 2
        lines += [f"  {name:<{width}}{_described(name, value)}" for name, value in self.telegram.items()]
        return "\n".join(lines)

    def _page(self, rows: dict[str, float]) -> list[str]:
        lines = [f"  [x] {name}" for name, value in rows.items() if value is True]
        for name, value in rows.items():
            if not isinstance(value, bool):
                lines.append(f"      {name}: {self._shown(name, value)}")
        unset = [name for name, value in rows.items() if value is False]
        if unset:
            lines += wrap(", ".join(unset), _WIDTH, initial_indent="  not set: ", subsequent_indent="    ")
        return lines

    def _shown(self, name: str, value: float) -> str:
        meaning = _MEANINGS.get(name, {}).get(value)
        shown = f"{value:g}" if isinstance(value, float) else str(value)
        if meaning:
            return f"{shown} ({meaning})"
        unit = self.units.get(name, "")
        per, speed = _PER_TIME.get(unit, ""), self.units.get(_MAXIMUM_SPEED, "")
        # An acceleration of a speed axis counts revolutions in seconds, whatever its speed does (CFG-081).
        same = (
            f" ({value * _IN_A_SECOND[speed]:g} {speed} per {per})" if per and speed in _IN_A_SECOND else ""
        )
        return f"{shown} {unit}{same}".rstrip()


def _described(name: str, value: int) -> str:
    return describe_value(name.rpartition(".")[2], value)


def _snapshot(
    one: TechnologyAxis | ExternalEncoder,
    engine: AlarmEngine,
    pages_shown: dict[str, tuple[Row, ...]],
    state: str,
    *,
    job: str | None = None,
    telegram: dict[str, int],
) -> Diagnosis:
    """Take every word once, so that the bits of one page belong together (DIA-110)."""
    names = (
        [name for name in _WORDS if name != "StatusWord2"] if one.object_type == "ExternalEncoder" else _WORDS
    )
    words = {name: int(one.var(name)) for name in names}

    def value(variable: str) -> float:
        if "|" in variable:
            return any(value(one) for one in variable.split("|"))
        path, found, values = variable.partition("=")
        if found:
            return one.var(path) in {int(number) for number in values.split(",")}
        word, _, bit = variable.lstrip("!").partition(".X")
        if word in words and bit.isdigit():
            return bool(words[word] >> int(bit) & 1) is not variable.startswith("!")
        return one.var(variable)

    return Diagnosis(
        axis=one.name,
        kind=one.object_type,
        state=state,
        words=words,
        pages={
            title: {name: value(variable) for name, variable in rows} for title, rows in pages_shown.items()
        },
        alarms=tuple(
            {"number": entry.number, "reaction": entry.reaction, "text": entry.text}
            for entry in sorted(engine.pending, key=lambda one: one.priority, reverse=True)
        ),
        job=job,
        telegram=telegram,
        units={
            name: unit
            for rows in pages_shown.values()
            for name, variable in rows
            if ".X" not in variable and "=" not in variable and (unit := one.variables.unit(variable))
        },
    )


def diagnose(axis: TechnologyAxis) -> Diagnosis:
    """Return a snapshot of `axis`."""
    job = axis.motion.job
    telegram = {"STW1": axis.stw1_sent, **axis.port.telegram_view()}
    if axis.has_position and not axis.simulated:
        for number, one in enumerate(axis.servo.encoder_ports, start=1):
            if one is not axis.servo.drive_port:
                telegram |= {f"Sensor[{number}].{name}": word for name, word in one.telegram_view().items()}
    return _snapshot(
        axis,
        axis.alarms.engine,
        pages(has_position=axis.has_position, follows=axis.object_type == "SynchronousAxis"),
        axis.state.name,
        job=None if job is None else f"{job.instruction} {job.name}",
        telegram=telegram,
    )


def diagnose_encoder(encoder: ExternalEncoder) -> Diagnosis:
    """Return a snapshot of an external encoder."""
    enabling = encoder.enabling
    waiting = "ENABLING" if enabling.enable else encoder.state.name
    return _snapshot(
        encoder,
        encoder.engine,
        ENCODER_PAGES,
        "ENABLED" if enabling.enabled else waiting,
        telegram=encoder.port.telegram_view(),
    )
