"""What holds in every cycle of every stop, whatever happens (section 9.2)."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from itertools import pairwise
from typing import TYPE_CHECKING, Final

if TYPE_CHECKING:
    from testcases.unit.stop_timelines.telegram_record import Row

RAMPS: Final = ("ALARM_RAMP", "DISABLING_RAMP", "STOPPING", "HALTING")
NO_MOTION_JOB: Final = ("MC_Stop", "MC_Reset", "MC_Power", "MC_SetAxisSTW", "MC_WriteParameter")

Rule = Callable[[Sequence["Row"]], Iterator["Row"]]


def _status_without_busy(rows: Sequence[Row]) -> Iterator[Row]:
    return (row for row in rows if row.status and not row.busy)


def _enable_without_busy(rows: Sequence[Row]) -> Iterator[Row]:
    return (row for row in rows if row.enable and not row.busy)


def _idle_though_enabled(rows: Sequence[Row]) -> Iterator[Row]:
    return (row for row in rows if not row.status and not row.busy and row.enable)


def _on_while_inhibited(rows: Sequence[Row]) -> Iterator[Row]:
    """ON rises in a telegram although the answer read before it shows "switching on inhibited"."""
    return (row for last, row in pairwise(rows) if row.stw1 & 1 and not last.stw1 & 1 and row.zsw1 & 0x40)


def _word_of_a_ramp(rows: Sequence[Row]) -> Iterator[Row]:
    """In a ramp of the axis the setpoint is not zero and the word is not 16#047F; bit 7 acknowledges."""
    return (
        row
        for row in rows
        if row.axis_state in RAMPS
        and row.setpoint != 0.0
        and row.acceleration != 0.0
        and row.stw1 & 0x047F != 0x047F
    )


def _phases_at_once(rows: Sequence[Row]) -> Iterator[Row]:
    return (row for row in rows if (row.x >> 12 & 7).bit_count() > 1)


def _error_bit(rows: Sequence[Row]) -> Iterator[Row]:
    return (row for row in rows if bool(row.x & 2) is not row.alarmed)


def _jobs_despite_an_alarm(rows: Sequence[Row]) -> Iterator[Row]:
    return (
        row
        for row in rows
        if 1 <= row.reaction <= 4
        and any(
            outputs["Busy"] and outputs["instruction"] not in NO_MOTION_JOB for outputs in row.jobs.values()
        )
    )


def _bits_of_the_axis(rows: Sequence[Row]) -> Iterator[Row]:
    """Bits 3 to 6 and 10 are always 1: the axis never coasts a drive by taking its operation away."""
    return (row for row in rows if row.stw1 & 0x0478 != 0x0478)


def _enabled_bit(rows: Sequence[Row]) -> Iterator[Row]:
    return (row for row in rows if bool(row.x & 1) is not row.status)


RULES: Final[dict[str, Rule]] = {
    "STP-507": _status_without_busy,
    "STP-508": _idle_though_enabled,
    "STP-509": _enable_without_busy,
    "STP-510": _on_while_inhibited,
    "STP-511": _word_of_a_ramp,
    "STP-512": _phases_at_once,
    "STP-513": _error_bit,
    "STP-514": _jobs_despite_an_alarm,
    "STP-289": _bits_of_the_axis,
    "STP-030": _enabled_bit,
}
"""Violations of a rule, by its requirement."""


def violations(rows: Sequence[Row]) -> list[str]:
    """Return what is violated when, in words."""
    return [
        f"{identifier} at {row.time_s:.3f} s in {row.axis_state}: STW1 {row.stw1:04X}, ZSW1 {row.zsw1:04X}, "
        f"StatusWord {row.x:X}"
        for identifier, rule in RULES.items()
        for row in rule(rows)
    ]
