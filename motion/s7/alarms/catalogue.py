"""Technology alarms and error identifications as the system defines them."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from typing import Any, Final

from fieldbus.errors import HilError
from motion.s7.data import load

NO_REACTION: Final = 0
STOP_CURRENT: Final = 1
"""Stop with the dynamic values of the running instruction (VAR-092)."""
STOP_MAXIMUM: Final = 2
"""Stop with the dynamic limits (VAR-093)."""
STOP_EMERGENCY: Final = 3
"""Stop with the emergency deceleration, without jerk limit (VAR-094)."""
REMOVE_ENABLE: Final = 4
TRACK_SETPOINTS: Final = 5
"""Setpoints follow the actual values (VAR-096)."""
TERMINATE_ENCODER: Final = 10
"""What an external encoder shows for `REMOVE_ENABLE` (VAR-095)."""

_SEVERITY: Final = {
    NO_REACTION: 0,
    STOP_CURRENT: 1,
    STOP_MAXIMUM: 2,
    STOP_EMERGENCY: 3,
    TRACK_SETPOINTS: 4,
    REMOVE_ENABLE: 5,
    # Other objects end their processing, which is what removing the enable is to an axis (TA-004, TA-012).
    6: 5,
    7: 5,
    8: 5,
    9: 5,
    TERMINATE_ENCODER: 5,
    13: 5,
}


class AlarmError(HilError):
    """A technology alarm was raised that the catalogue does not know in this form."""


def severity(reaction: int) -> int:
    """Return the place of an alarm reaction in the order of importance; only the order means something.

    Removing the enable, tracking, emergency stop, maximum dynamics, current dynamics, none (TA-004; STP-432
    to STP-435).

    Raises:
        AlarmError: There is no such reaction of an axis or encoder.

    """
    try:
        return _SEVERITY[reaction]
    except KeyError:
        raise AlarmError(f"{reaction} is no alarm reaction; there are {sorted(_SEVERITY)}") from None


def stop_mode_severity(mode: int) -> int:
    """Return the severity of `MC_Stop` with `Mode` 0, 2 or 3, on the scale of
    `severity` (STP-433 to STP-435).

    Raises:
        AlarmError: There is no such mode.

    """
    reactions = {0: STOP_EMERGENCY, 2: STOP_MAXIMUM, 3: STOP_CURRENT}
    if mode not in reactions:
        raise AlarmError(f"{mode} is no mode of MC_Stop; there are 0, 2 and 3")
    return severity(reactions[mode])


@dataclass(frozen=True)
class AlarmEntry:
    """One technology alarm of the catalogue."""

    number: int
    name: str
    text: str
    alarm_class: str
    """`W` warning, `F` to be acknowledged, `R` to be cleared by a restart (section 2.1)."""
    reactions: tuple[int, ...]
    """`ErrorDetail.Reaction` on an axis: the usual one, then those that a configuration can select."""
    other_reactions: dict[str, int]
    """Reaction of object types that differ from an axis."""
    restart: bool | None
    """Whether only a restart clears it; None where that depends on the cause (531; TA-016)."""
    diagnostic_buffer: bool
    """Whether the diagnostic buffer records it (TA-011)."""
    error_bit: int | None
    """Bit of `ErrorWord`; None for a warning."""
    warning_bit: int | None
    """Bit of `WarningWord`; None for an error."""
    bit_name: str
    applies_to: tuple[str, ...]
    """Types of technology object that can have it."""
    stays_enabled: tuple[int, ...]
    """Reactions after whose ramp the axis stays enabled (STP-589 to STP-591)."""
    causes: tuple[str, ...]
    """Possible causes; the supplementary value numbers them from 1 (TA-013)."""
    source: str

    def reaction_of(self, object_type: str) -> int:
        """Return the usual `ErrorDetail.Reaction` on a type of technology object."""
        usual = self.other_reactions.get(object_type)
        if usual is None:
            usual = self.reactions[0] if self.reactions else NO_REACTION
            if object_type == "ExternalEncoder" and usual != NO_REACTION:
                usual = TERMINATE_ENCODER
        return usual

    def describe(self, info: int = 0) -> str:
        """Return the text, with the cause that the supplementary value `info` names, if it names one."""
        return f"{self.text}: {self.causes[info - 1]}" if 0 < info <= len(self.causes) else self.text


@dataclass(frozen=True)
class ErrorIdEntry:
    """One `ErrorID` of the `MC_` instructions."""

    value: int
    text: str
    parameters: tuple[str, ...]
    """Inputs of the instruction that are concerned."""


@cache
def _data() -> Any:
    return load("technology_alarms")


@cache
def catalogue() -> dict[int, AlarmEntry]:
    """Return all technology alarms by their numbers, ascending."""
    return {
        row["number"]: AlarmEntry(
            number=row["number"],
            name=row["name"],
            text=row["text"],
            alarm_class=row["class"],
            reactions=tuple(row["reactions"]),
            other_reactions=row.get("other_reactions", {}),
            restart=row["restart"],
            diagnostic_buffer=row["diagnostic_buffer"],
            error_bit=row["error_bit"],
            warning_bit=row["warning_bit"],
            bit_name=row["bit_name"],
            applies_to=tuple(row["applies_to"]),
            stays_enabled=tuple(row.get("stays_enabled", ())),
            causes=tuple(row.get("causes", ())),
            source=row["source"],
        )
        for row in _data()["alarms"]
    }


def alarm(number: int) -> AlarmEntry:
    """Return the technology alarm `number`.

    Raises:
        AlarmError: There is no such alarm.

    """
    entry = catalogue().get(number)
    if entry is None:
        raise AlarmError(f"there is no technology alarm {number}")
    return entry


@cache
def error_ids() -> dict[int, ErrorIdEntry]:
    """Return all error identifications of the `MC_` instructions by their values."""
    return {
        row["value"]: ErrorIdEntry(row["value"], row["text"], tuple(row["parameters"]))
        for row in _data()["error_ids"]
    }


def error_text(error_id: int) -> str:
    """Return what an `ErrorID` means, such as `16#8001: ...`; unknown ones are named as such."""
    entry = error_ids().get(error_id)
    return f"16#{error_id:04X}: {entry.text if entry is not None else 'unknown error identification'}"
