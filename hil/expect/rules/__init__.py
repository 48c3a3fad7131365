"""Rules that know physics and protocol and judge every trace."""

from __future__ import annotations

import gc
from typing import TYPE_CHECKING, Any, Final, NamedTuple

from hil.expect.rules import (
    _axis_words,
    _bus_protocol,
    _bus_values,
    _causes,
    _drive_motion,
    _drive_words,
    _dynamics,
    _kinematics,
    _modbus_protocol,
    _places,
    _profiles,
    _ramps,
    _read_objects,
)
from hil.expect.rules._bus_views import BusView
from hil.expect.rules._definition import Findings, Rule
from hil.expect.rules._modbus_protocol import ModbusView
from hil.expect.rules._pieces import pieces
from hil.expect.rules._views import AxisView, DriveView, TraceView

if TYPE_CHECKING:
    from hil.record import Trace
    from reports.model import Check

__all__ = ["ALL_RULES", "AXIS_RULES", "BUS_RULES", "DRIVE_RULES", "MODBUS_RULES", "Rule", "judge"]

AXIS_RULES: Final[tuple[Rule[AxisView], ...]] = (
    *_kinematics.AXIS_RULES,
    *_ramps.AXIS_RULES,
    *_bus_values.AXIS_RULES,
    *_axis_words.AXIS_RULES,
    *_causes.AXIS_RULES,
    *_places.AXIS_RULES,
    *_profiles.AXIS_RULES,
    *_dynamics.AXIS_RULES,
)
DRIVE_RULES: Final[tuple[Rule[DriveView], ...]] = (
    *_drive_motion.DRIVE_RULES,
    *_bus_values.DRIVE_RULES,
    *_drive_words.DRIVE_RULES,
    *_causes.DRIVE_RULES,
    *_read_objects.DRIVE_RULES,
    *_dynamics.DRIVE_RULES,
)
BUS_RULES: Final[tuple[Rule[BusView], ...]] = _bus_protocol.BUS_RULES
MODBUS_RULES: Final[tuple[Rule[ModbusView], ...]] = _modbus_protocol.MODBUS_RULES
ALL_RULES: Final[tuple[Rule[Any], ...]] = (*AXIS_RULES, *DRIVE_RULES, *BUS_RULES, *MODBUS_RULES)
"""All of them; a check is called by the name of its rule, with the component behind it."""


def judge(trace: Trace, *, longest: int | None = None) -> list[Check]:
    """Return the checks of all rules on all components that they can judge.

    A trace with more than `longest` samples of a component (None: by their number) is judged in pieces that
    overlap.

    A bus log of another tool shows too little of axes and drives: rules of the bus alone judge it. On a live
    bench controller and drives record in processes of their own, at times that waver: what most rules compare
    cycle by cycle is not of the same instant there; the others judge (`Rule.live`).
    """
    live = trace.from_log or bool(trace.constants.get("bench.live"))
    found = _Found(
        Findings([rule for rule in AXIS_RULES if rule.live or not live]),
        Findings([rule for rule in DRIVE_RULES if rule.live or not live]),
        Findings([rule for rule in BUS_RULES if rule.live or not live]),
        Findings([rule for rule in MODBUS_RULES if rule.live or not live]),
    )
    for part, span_s in pieces(trace, longest=longest):
        _look(part, span_s, found)
        if span_s is not None:
            gc.collect()  # a view and its components know each other, and a case runs without collecting
    return [check for findings in found for check in findings.checks()]


class _Found(NamedTuple):
    """What was found on each kind of component."""

    axes: Findings[AxisView]
    drives: Findings[DriveView]
    buses: Findings[BusView]
    links: Findings[ModbusView]


def _look(part: Trace, span_s: tuple[float, float] | None, found: _Found) -> None:
    """Judge a piece of a trace."""
    view = TraceView(part)
    if not part.from_log:
        for axis in view.axes.values():
            found.axes.look(axis.name, axis, axis.excuses, cycle_s=view.cycle_s, span_s=span_s)
        for drive in view.drives.values():
            found.drives.look(drive.name, drive, drive.excuses, cycle_s=view.cycle_s, span_s=span_s)
    for name in part.can_buses:
        bus = BusView(view, name)
        found.buses.look(name, bus, bus.excuses, cycle_s=view.cycle_s, span_s=span_s)
    for name in part.buses:
        if name not in part.can_buses:
            link = ModbusView(view, name)
            found.links.look(name, link, link.excuses, cycle_s=view.cycle_s, span_s=span_s)
