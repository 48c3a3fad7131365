"""Always-on rules about axes of an NC: error, enables, motion and the status word say the same."""

from __future__ import annotations

from typing import Final

import numpy as np

from hil.expect.rules._definition import Excuses, Findings, Flags, Judged, Numbers, Rule
from hil.expect.rules._pieces import pieces
from hil.record import Trace
from reports.model import Check

_OPERATIONAL: Final = 1 << 0
_NOT_MOVING: Final = 1 << 2
_HAS_JOB: Final = 1 << 8
_FORWARD: Final = 1 << 9
_BACKWARD: Final = 1 << 10
_COUPLED: Final = 1 << 5
_EXTERNAL: Final = 1 << 14
_ERROR: Final = 1 << 31
_CORRECTED: Final = 1 << 20
"""Of `OpModeDWord`: a correction is added to the actual position."""
_STANDS: Final = 1e-9
_STEPS: Final = (
    "axis.position_set",
    "axis.setpoint_step",
    "axis.emergency_stop",
    "axis.fast_stop",
    "axis.reset",
    "axis.error",
    "axis.feed_missing",
)
"""Events with which set values may step, or end at once."""
_AROUND: Final = 3
"""Cycles around such an event."""


class NcAxisView:
    """The recorded columns of one NC axis.

    Args:
        trace: The trace.
        name: The axis.

    """

    def __init__(self, trace: Trace, name: str) -> None:
        word = trace[f"{name}.state_dword"]
        self.time_s: Numbers = np.asarray(word.time_s, dtype=np.float64)
        self.word = np.asarray(word.values).astype(np.int64)
        self.position = self._of(trace, name, "set_position")
        self.velocity = self._of(trace, name, "set_velocity")
        self.acceleration = self._of(trace, name, "set_acceleration")
        self.actual = self._of(trace, name, "actual_position")
        self.lag = self._of(trace, name, "following_error")
        self.output = self._of(trace, name, "output")
        self.code = self._of(trace, name, "error_code")
        self.cycles = self._of(trace, name, "op_mode_dword").astype(np.int64) >> 24 & 0xFF
        corrected = self._of(trace, name, "op_mode_dword").astype(np.int64) & _CORRECTED != 0
        self.corrected: Flags = corrected | np.concatenate((corrected[1:], [False]))
        """Cycles in which a correction is added to its actual position."""
        self.two_speed = bool(trace.constants.get(f"{name}.two_speed"))
        """Whether its set values are the actual ones (NC-607)."""
        self.cycle_s = float(trace.constants.get(f"{name}.cycle_s", 0.0))
        self.moved = self._moved(trace, name)
        """Cycles around which the set values may step."""

    def _moved(self, trace: Trace, name: str) -> Flags:
        flags = np.zeros(len(self.time_s), dtype=bool)
        for entry in trace.select(source=name):
            if entry.kind in _STEPS:
                at = int(np.searchsorted(self.time_s, entry.time_ns * 1e-9 - 1e-9))
                flags[max(at - _AROUND, 0) : at + _AROUND + 1] = True
        return flags

    @property
    def generated(self) -> Flags:
        """Cycles that follow on one another and in which the axis makes its set values."""
        own = (
            self.bit(_OPERATIONAL)
            & ~self.bit(_ERROR)
            & ~self.bit(_EXTERNAL)
            & ~self.bit(_COUPLED)
            & ~self.moved
        )
        behind = np.concatenate(([False], own[:-1]))
        follows = np.abs(np.diff(self.time_s, prepend=-1.0) - self.cycle_s) < 0.01 * self.cycle_s
        # At the end of a motion the lag is cleared, and the set position becomes the actual one. An encoder
        # axis never has any: its set values are its actual ones (NC-060).
        lags = self.lag != 0.0
        own &= lags & self.bit(_HAS_JOB)
        behind &= np.concatenate(([False], lags[:-1]))
        counted = np.concatenate(([False], np.diff(self.cycles) % 256 == 1))
        return own & behind & follows & counted

    @staticmethod
    def _of(trace: Trace, name: str, column: str) -> Numbers:
        return np.asarray(trace[f"{name}.{column}"].values, dtype=np.float64)

    def bit(self, mask: int) -> Flags:
        """Return in which cycles a bit of `StateDWord` is set."""
        return np.asarray((self.word & mask) != 0, dtype=bool)

    def judged(self, where: Flags, broken: Flags, text: str) -> Judged:
        """Return a finding: where the rule could say something, and where it does not hold."""
        return Judged(self.time_s, where, where & broken, lambda _: text)


def _always(axis: NcAxisView) -> Flags:
    return np.ones(len(axis.time_s), dtype=bool)


def _error_bit(axis: NcAxisView) -> Judged:
    # MC_Reset clears the code behind the image of its cycle.
    wrong = axis.bit(_ERROR) != (axis.code != 0)
    wrong[1:] &= wrong[:-1]
    return axis.judged(_always(axis), wrong, "Error bit of StateDWord and error code contradict each other")


def _shut_down(axis: NcAxisView) -> Judged:
    moving = (np.abs(axis.velocity) > _STANDS) | (np.abs(axis.output) > _STANDS)
    in_error = axis.code != 0
    # An axis of the same coupling may bring the error after this one was executed.
    before = np.concatenate(([False], in_error[:-1]))
    return axis.judged(in_error & before, moving, "set velocity or output of an axis in error")


def _without_enable(axis: NcAxisView) -> Judged:
    moving = np.abs(axis.velocity) > _STANDS
    return axis.judged(~axis.bit(_OPERATIONAL), moving, "set velocity without Operational")


def _direction(axis: NcAxisView) -> Judged | None:
    if axis.two_speed:
        return None
    forward, backward = axis.velocity > _STANDS, axis.velocity < -_STANDS
    wrong = (axis.bit(_BACKWARD) & forward) | (axis.bit(_FORWARD) & backward)
    wrong |= axis.bit(_FORWARD) & axis.bit(_BACKWARD)
    return axis.judged(_always(axis), wrong, "direction in StateDWord against the sign of the set velocity")


def _not_moving(axis: NcAxisView) -> Judged | None:
    if axis.two_speed:
        return None
    moving = np.abs(axis.velocity) > _STANDS
    return axis.judged(axis.bit(_NOT_MOVING), moving, "NotMoving with a set velocity")


def _counter(axis: NcAxisView) -> Judged | None:
    if len(axis.time_s) < 2:
        return None
    step = np.diff(axis.cycles) % 256
    # A cycle in which the axis is not executed shows the same image again (NC-075).
    wrong = np.concatenate(([False], step > 1))
    return axis.judged(_always(axis), wrong, "the cycle counter of OpModeDWord jumps")


def _lag(axis: NcAxisView) -> Judged | None:
    if axis.two_speed:
        return None
    where = axis.generated & ~axis.corrected
    off = np.abs(axis.lag - (axis.position - axis.actual))
    return axis.judged(
        where, off > 1e-6 * (1.0 + np.abs(axis.position)), "lag is not set minus actual position"
    )


def _set_position(axis: NcAxisView) -> Judged | None:
    if axis.two_speed or not axis.cycle_s or len(axis.time_s) < 2:
        return None
    p, v, a, cycle_s = axis.position, axis.velocity, axis.acceleration, axis.cycle_s
    way = 0.5 * (v[1:] + v[:-1]) * cycle_s
    gained = np.abs(v[1:] - v[:-1] - 0.5 * (a[1:] + a[:-1]) * cycle_s)
    bound = np.abs(a[1:] - a[:-1]) * cycle_s**2 / 8.0 + 0.6 * gained * cycle_s + 1e-6 * (1.0 + np.abs(p[1:]))
    off = np.concatenate(([False], np.abs(p[1:] - p[:-1] - way) > bound))
    return axis.judged(axis.generated, off, "the set position is not the integral of the set velocity")


def _set_velocity(axis: NcAxisView) -> Judged | None:
    if axis.two_speed or not axis.cycle_s or len(axis.time_s) < 4:
        return None
    v, a, cycle_s = axis.velocity, axis.acceleration, axis.cycle_s
    low, high = np.minimum(a[1:], a[:-1]) * cycle_s, np.maximum(a[1:], a[:-1]) * cycle_s
    # One step of the acceleration may lie within the cycle, or in one of the two around it.
    slack = np.maximum.reduce([high - low, np.roll(high - low, 1), np.roll(high - low, -1)]) + 1e-6
    gained = v[1:] - v[:-1]
    off = np.concatenate(([False], (gained < low - slack) | (gained > high + slack)))
    where = axis.generated
    where[-1] = False
    return axis.judged(where, off, "the set velocity is not the integral of the set acceleration")


NC_RULES: Final[tuple[Rule[NcAxisView], ...]] = (
    Rule(
        name="error code and status",
        says="StateDWord.31 is set exactly while there is an error code",
        requirements=("NC-148",),
        tolerance="one cycle: MC_Reset clears the code behind the image",
        judge=_error_bit,
    ),
    Rule(
        name="shut down in error",
        says="an axis in error has neither set velocity nor output",
        requirements=("NC-148",),
        tolerance="one cycle: an error that another axis of the coupling brings comes behind the execution",
        judge=_shut_down,
    ),
    Rule(
        name="no motion without enable",
        says="an axis that is not operational has no set velocity",
        requirements=("NC-029",),
        tolerance="none",
        judge=_without_enable,
    ),
    Rule(
        name="direction of motion",
        says="PositiveDirection and NegativeDirection are those of the set velocity",
        requirements=("NC-449", "NC-450"),
        tolerance="none; not of two-speed axes, whose set values are the actual ones",
        judge=_direction,
    ),
    Rule(
        name="NotMoving",
        says="NotMoving is not set while there is a set velocity",
        requirements=("NC-442",),
        tolerance="none; not of two-speed axes",
        judge=_not_moving,
    ),
    Rule(
        name="cycle counter",
        says="the counter of OpModeDWord counts the cycles of the axis",
        requirements=("NC-472",),
        tolerance="none",
        judge=_counter,
    ),
    Rule(
        name="position lag",
        says="the position lag is the set position minus the actual position",
        requirements=("NC-004",),
        tolerance="rounding; not of two-speed axes, or while a correction is added",
        judge=_lag,
    ),
    Rule(
        name="set position",
        says="the set position is the integral of the set velocity",
        requirements=("NC-165",),
        tolerance="what a change of the acceleration within the cycle can make; not around a position "
        "that is set, without a job, of coupled axes, or with external setpoints",
        judge=_set_position,
    ),
    Rule(
        name="set velocity",
        says="the set velocity is the integral of the set acceleration",
        requirements=("NC-165",),
        tolerance="one change of the acceleration within the cycle or the two around it; otherwise as "
        "the set position",
        judge=_set_velocity,
    ),
)
"""Rules that hold for every NC axis, whatever a case is about. Those of drives, buses and mechanics hold
besides; those of jobs, alarms and setpoints of technology objects find nothing to judge.
"""


def check_nc_axes(trace: Trace) -> list[Check]:
    """Return the checks of all rules on all NC axes; a bus log shows none."""
    if trace.from_log:
        return []
    names = [name.removesuffix(".state_dword") for name in trace.names() if name.endswith(".state_dword")]
    found = Findings(NC_RULES)
    for part, span_s in pieces(trace):
        for name in names:
            found.look(name, NcAxisView(part, name), Excuses([]), cycle_s=0.0, span_s=span_s)
    return found.checks()
