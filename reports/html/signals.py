"""Which signals share a panel of the plot, which become lanes, and what a case shows before anybody asks.

A panel holds one quantity in one unit with its setpoints and actual values. States, bits, words
and numbers that stand for something (alarm number, mode) say nothing as a curve; they become
lanes: coloured bands with a text.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterable
from dataclasses import dataclass, field
from functools import lru_cache
from typing import Final

import numpy as np

from reports.model import Signal

_FOLLOWING: Final = "Leading and following value"
"""Panel of what a synchronous axis gets and makes of it."""
_QUANTITIES: Final[tuple[tuple[str, str], ...]] = (
    # pattern in the signal's own name, title of the panel; the first match counts, the order is that of the
    # plot
    (r"function_?error", "Function error"),
    (r"leading_position|function_position", _FOLLOWING),
    (r"following_?error|position_?(error|deviation)", "Following error"),
    (r"(velocity|speed)_?(error|deviation)", "Velocity deviation"),
    (r"jerk", "Jerk"),
    (r"acceleration|deceleration", "Acceleration"),
    (r"torque|force", "Torque"),
    (r"current", "Current"),
    (r"voltage|dc_?link", "Voltage"),
    (r"temperature", "Temperature"),
    (r"velocity", "Velocity"),
    (r"speed|rpm", "Speed"),
    (r"position|encoder|increments|distance|angle", "Position"),
)
_ORDER: Final = (
    "Position",
    _FOLLOWING,
    "Velocity",
    "Following error",
    "Function error",
    "Torque",
    "Speed",
    "Velocity deviation",
    "Acceleration",
    "Jerk",
    "Current",
    "Voltage",
    "Temperature",
)
_FALLBACK: Final = 4
"""Panels that are shown where none of those at first sight is there."""
_FIRST_SIGHT: Final = 6
"""Panels shown at once: the quantities before `Speed`, which stands in where there is no velocity."""
_SETPOINT: Final = re.compile(r"setpoint|demand|target|command|reference|nominal|_output$")
_MOTION: Final = re.compile(r"position|velocity|speed")
_WORD: Final = re.compile(r"word\d*$|^stw\d?|^zsw\d?|^inputs$|^outputs$|_bits$|register$")
_CODE: Final = re.compile(r"(number|code|mode|reaction|count|identifier|_id)$")
_MAX_BANDS: Final = 3000
_CROWDED: Final = 3


@dataclass
class Panel:
    """Signals that share one pair of axes."""

    title: str
    unit: str
    signals: list[Signal] = field(default_factory=list)
    shown: bool = False
    idle: bool = False
    """It belongs to an axis that is at rest in the whole case, and that the case is not about."""


@dataclass
class Lane:
    """One signal as bands."""

    signal: Signal
    kind: str
    """`state` (texts), `bit`, `word` (shown as hexadecimal) or `code` (shown as a number)."""
    shown: bool = False
    idle: bool = False
    """See `Panel`."""


def base_name(name: str) -> str:
    """Return the name of a signal without its component, in lower case."""
    return name.rpartition(".")[2].lower()


@lru_cache(maxsize=4096)
def _quantity(name: str) -> str:
    """Return the title of the panel of a signal; names repeat from case to case."""
    own = base_name(name)
    return next((title for pattern, title in _QUANTITIES if re.search(pattern, own)), "") or name


@lru_cache(maxsize=4096)
def is_setpoint(name: str) -> bool:
    """Return whether the signal is a setpoint, not an actual value."""
    return _SETPOINT.search(base_name(name)) is not None


def component(name: str) -> str:
    """Return the component that a signal belongs to; empty for a bare name."""
    return name.rpartition(".")[0]


def arrange(
    signals: Iterable[Signal], interest: Iterable[str] = (), *, involved: Iterable[str] = ()
) -> tuple[list[Panel], list[Lane]]:
    """Sort signals into panels and lanes and choose those to show at first.

    Shown are the first panel of position, velocity, following error and torque - the controller's view before
    that of the drive - and the lanes of states. With many components every one gets panels of its own. Axes
    and drives that rest in the whole case are not shown, unless the case is about them or nothing moves.
    Empty signals are left out.

    Args:
        signals: All signals of a case.
        interest: Components whose panels are shown rather than those of others.
        involved: Components that something happened to, so that they count as busy even at rest.

    """
    panels: dict[tuple[str, str, bool], Panel] = {}
    lanes: list[Lane] = []
    signals = list(signals)
    wanted = set(interest)
    idle = _at_rest(signals) - wanted - set(involved)
    for signal in signals:
        if len(signal.values) == 0 or len(signal.values) != len(signal.time_s):
            continue
        kind = _lane_kind(signal)
        if kind:
            rests = component(signal.name) in idle
            lanes.append(Lane(signal, kind, shown=kind == "state" and not rests, idle=rests))
            continue
        title = _quantity(signal.name)
        # Who rests has a panel of its own: a curve that never moves would only take room.
        # The leading object may count in another unit.
        unit = "" if title == _FOLLOWING else signal.unit
        key = (title, unit, component(signal.name) in idle)
        panels.setdefault(key, Panel(title, unit)).signals.append(signal)
    parts = [part for panel in panels.values() for part in _split(panel)]
    for part in parts:
        part.idle = {component(signal.name) for signal in part.signals} <= idle
    ranked = sorted(parts, key=lambda panel: _rank(panel, wanted))
    shown = _show(ranked, _ORDER[:_FIRST_SIGHT])
    if "Velocity" not in shown:
        shown |= _show(ranked, ("Speed",))
    if not shown:
        for panel in ranked[:_FALLBACK]:
            panel.shown = True
    order = {"state": 0, "code": 1, "bit": 2, "word": 3}
    lanes.sort(key=lambda lane: order[lane.kind])
    return ranked, lanes


def _show(ranked: list[Panel], titles: Iterable[str]) -> set[str]:
    """Show the first panel of each title; return the titles that were found."""
    found: set[str] = set()
    for panel in ranked:
        if panel.title in titles and panel.title not in found:
            found.add(panel.title)
            panel.shown = True
    return found


def _split(panel: Panel) -> list[Panel]:
    """Sort the signals of a panel, setpoint first; divide it by component when it
    holds more than fits its head.
    """
    panel.signals.sort(key=lambda signal: (component(signal.name), not is_setpoint(signal.name)))
    if len(panel.signals) <= _CROWDED:
        return [panel]
    parts: dict[str, Panel] = {}
    for signal in panel.signals:
        parts.setdefault(component(signal.name), Panel(panel.title, panel.unit)).signals.append(signal)
    return list(parts.values())


def bands(lane: Lane) -> tuple[list[float], list[float | None]]:
    """Return start times [s] and values of the bands of a lane, at full resolution; None stands for a gap.

    Past 3000 changes only the first of each short interval is kept: more than
    one band per pixel shows nothing.
    """
    signal = lane.signal
    values = signal.values
    changed = np.ones(len(values), dtype=bool)
    changed[1:] = (values[1:] != values[:-1]) & ~(np.isnan(values[1:]) & np.isnan(values[:-1]))
    index = np.flatnonzero(changed)
    if len(index) > _MAX_BANDS:
        span = max(float(signal.time_s[-1] - signal.time_s[0]), 1e-9)
        slots = ((signal.time_s[index] - signal.time_s[0]) / span * (_MAX_BANDS - 1)).astype(np.int64)
        index = index[np.unique(slots, return_index=True)[1]]
    starts = [round(time, 7) for time in signal.time_s[index].tolist()]
    return starts, [value if math.isfinite(value) else None for value in values[index].tolist()]


def _at_rest(signals: Iterable[Signal]) -> set[str]:
    """Return the components that have a position or velocity, none of which moves by more than a thousandth
    of what others of the same unit do; none where nothing moves.
    """
    spans: dict[str, dict[str, float]] = {}
    for signal in signals:
        if not signal.enum and _MOTION.search(base_name(signal.name)):
            values = signal.values[np.isfinite(signal.values)]
            span = float(values.max() - values.min()) if len(values) else 0.0
            owner = spans.setdefault(component(signal.name), {})
            owner[signal.unit] = max(owner.get(signal.unit, 0.0), span)
    most: dict[str, float] = {}
    for owner in spans.values():
        for unit, span in owner.items():
            most[unit] = max(most.get(unit, 0.0), span)
    resting = {
        name
        for name, owner in spans.items()
        if all(span <= 1e-3 * most[unit] for unit, span in owner.items())
    }
    return resting if any(most.values()) else set()


def _lane_kind(signal: Signal) -> str:
    if signal.enum:
        return "state"
    if signal.unit:
        return ""
    values = signal.values[np.isfinite(signal.values)]
    if not np.array_equal(values, np.rint(values)):
        return ""
    name = base_name(signal.name)
    if _WORD.search(name):
        return "word"
    if _CODE.search(name):
        return "code"
    if len(values) and values.min() >= 0 and values.max() <= 1:
        return "bit"
    return ""


def _rank(panel: Panel, interest: set[str]) -> tuple[int, bool, bool, bool, bool]:
    """Return the place of a panel: by quantity, then what is not at rest, what is of interest, the
    controller's view, what has a setpoint.
    """
    rank = _ORDER.index(panel.title) if panel.title in _ORDER else len(_ORDER)
    components = {component(signal.name) for signal in panel.signals}
    controller = any("axis" in name.lower() for name in components)
    both = any(is_setpoint(signal.name) for signal in panel.signals)
    return rank, panel.idle, not controller, not components & interest, not both
