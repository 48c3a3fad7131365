"""Rules that know physics and protocol and judge every trace."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Final

from hil.expect.rules import (
    _axis_words,
    _bus_values,
    _causes,
    _drive_motion,
    _drive_words,
    _kinematics,
    _places,
    _ramps,
)
from hil.expect.rules._definition import Rule, outcome
from hil.expect.rules._views import AxisView, DriveView, TraceView

if TYPE_CHECKING:
    from hil.record import Trace
    from reports.model import Check

__all__ = ["ALL_RULES", "AXIS_RULES", "DRIVE_RULES", "Rule", "judge"]

AXIS_RULES: Final[tuple[Rule[AxisView], ...]] = (
    *_kinematics.AXIS_RULES,
    *_ramps.AXIS_RULES,
    *_bus_values.AXIS_RULES,
    *_axis_words.AXIS_RULES,
    *_causes.AXIS_RULES,
    *_places.AXIS_RULES,
)
DRIVE_RULES: Final[tuple[Rule[DriveView], ...]] = (
    *_drive_motion.DRIVE_RULES,
    *_bus_values.DRIVE_RULES,
    *_drive_words.DRIVE_RULES,
    *_causes.DRIVE_RULES,
)
ALL_RULES: Final[tuple[Rule[Any], ...]] = (*AXIS_RULES, *DRIVE_RULES)
"""All of them; a check is called by the name of its rule, with the component behind it."""


def judge(trace: Trace) -> list[Check]:
    """Return the checks of all rules on all components that they can judge.

    A bus log shows too little. On a live bench controller and drives record in processes of their own, at
    times that waver: what most rules compare cycle by cycle is not of the same instant there; the others
    judge (`Rule.live`).
    """
    if trace.from_log:
        return []
    live = bool(trace.constants.get("bench.live"))
    view = TraceView(trace)
    checks: list[Check | None] = []
    for axis in view.axes.values():
        of_axis = [rule for rule in AXIS_RULES if rule.live or not live]
        checks += [outcome(rule, axis, axis.name, axis.excuses, view.cycle_s) for rule in of_axis]
    for drive in view.drives.values():
        of_drive = [rule for rule in DRIVE_RULES if rule.live or not live]
        checks += [outcome(rule, drive, drive.name, drive.excuses, view.cycle_s) for rule in of_drive]
    return [check for check in checks if check is not None]
