"""A case in a few numbers: what earlier runs are compared by without keeping their signals."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from typing import Final, NamedTuple

import numpy as np

from reports.model import CaseResult, Signal

_SET: Final = re.compile(r"setpoint|demand|target|command|reference|nominal|_output$")
_SHARE: Final = 0.01
"""Part of its scale by which a number may differ before it counts as another one."""
_STANDSTILL_S: Final = 0.005
"""The same for the moment of standstill [s]: about one bus cycle."""
_FLOOR: Final = 1e-6


class Measure(NamedTuple):
    """One number of a case."""

    name: str
    """`axis1.actual_position: final`, `reaction time` and the like; unique within a case."""
    value: float
    unit: str
    tolerance: float
    """Difference from which on two runs drifted apart, in `unit`."""


def measures(case: CaseResult) -> list[Measure]:
    """Return the numbers of a case.

    These are the final value of every actual position, the greatest amount of every following error, actual
    velocity and torque, the last moment at which a velocity was above 1 % of that, every measured value of a
    check, and the simulated time. The tolerance is 1 % of the range (positions), of the limits (checks) or of
    the number itself, for the moment of standstill 5 ms. Signals without unit, setpoints and numbers that are
    not finite are left out.
    """
    found = [Measure("simulated time", case.simulated_s, "s", _tolerance(case.simulated_s))]
    found += signal_measures(case.signals)
    for check in case.checks:
        if check.value is not None:
            limited = check.low is not None and check.high is not None
            scale = check.high - check.low if limited else check.value  # type: ignore[operator]  # limited: both are there
            found.append(Measure(f"check: {check.name}", float(check.value), check.unit, _tolerance(scale)))
    counts: dict[str, int] = {}
    unique = []
    for one in found:
        if math.isfinite(one.value):
            counts[one.name] = counts.get(one.name, 0) + 1
            unique.append(
                one if counts[one.name] == 1 else one._replace(name=f"{one.name} ({counts[one.name]})")
            )
    return unique


def signal_measures(signals: Sequence[Signal]) -> list[Measure]:
    """Return the numbers of signals; those of stored ones are in the journal, and no sample is read."""
    stored = getattr(signals, "numbers", None)
    if stored is not None:
        return [Measure(*row) for row in stored]
    return [one for signal in signals for one in _of_signal(signal)]


def _tolerance(scale: float) -> float:
    return max(_SHARE * abs(scale), _FLOOR) if math.isfinite(scale) else _FLOOR


def _of_signal(signal: Signal) -> list[Measure]:
    name = signal.name.rpartition(".")[2].lower()
    if not signal.unit or signal.enum or _SET.search(name):
        return []
    values = np.asarray(signal.values, dtype=np.float64)
    times = np.asarray(signal.time_s, dtype=np.float64)
    finite = np.isfinite(values)
    if not finite.any() or len(times) != len(values):
        return []
    if not finite.all():
        values, times = values[finite], times[finite]
    if "position" in name and not re.search("error|deviation", name):
        scale = float(values.max() - values.min())
        return [Measure(f"{signal.name}: final", float(values[-1]), signal.unit, _tolerance(scale))]
    if not re.search(r"following_?error|position_?(error|deviation)|velocity|speed|torque", name):
        return []
    size = np.abs(values)
    peak = float(size.max())
    found = [Measure(f"{signal.name}: peak", peak, signal.unit, _tolerance(peak))]
    if re.search("velocity|speed", name) and peak > 0:
        last = float(times[np.flatnonzero(size > 0.01 * peak)[-1]])
        found.append(Measure(f"{signal.name}: last motion", last, "s", _STANDSTILL_S))
    return found
