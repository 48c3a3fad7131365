"""Always-on rules about axes of an NC: error, enables, motion and the status word say the same."""

from __future__ import annotations

from typing import Final

import numpy as np

from hil.expect.rules._bus_values import given_speed, sample_before
from hil.expect.rules._definition import Findings, Flags, Judged, Numbers, Rule, last_true
from hil.expect.rules._pieces import pieces
from hil.expect.rules._views import DriveView, TraceView
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
        drive: The drive that it moves; None: it has none, or none that is recorded.

    """

    def __init__(self, trace: Trace, name: str, drive: DriveView | None = None) -> None:
        self.drive = drive
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
    return axis.judged(_always(axis), _jumps(axis), "the cycle counter of OpModeDWord jumps")


def _jumps(axis: NcAxisView) -> Flags:
    """Return where the cycle counter does not go on: an activation of the project creates the axis again."""
    # A cycle in which the axis is not executed shows the same image again (NC-075).
    return np.concatenate(([False], np.diff(axis.cycles) % 256 > 1))


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


def _generates(axis: NcAxisView) -> Flags:
    """Return the cycles in which a job of the axis moves it, and has moved it before."""
    moves = axis.generated & (np.abs(axis.velocity) > _STANDS)
    return last_true(moves, 1)


def _shows_direction(axis: NcAxisView) -> Judged | None:
    if axis.two_speed or len(axis.time_s) < 4:
        return None
    missing = ~axis.bit(_FORWARD) & (axis.velocity > _STANDS) | ~axis.bit(_BACKWARD) & (
        axis.velocity < -_STANDS
    )
    return axis.judged(_generates(axis), missing, "no direction in StateDWord with a set velocity")


def _speed_given(axis: NcAxisView) -> Judged | None:
    drive = axis.drive
    found = None if drive is None or drive.number("live") else given_speed(drive)
    if drive is None or found is None or not axis.cycle_s or len(axis.time_s) < 10 or _jumps(axis).any():
        return None
    sent, step = found
    at, near = sample_before(axis.time_s, sent.time_s - 1e-9, 0.5 * axis.cycle_s)
    if drive.has("mode"):
        # With a position interface the speed on the bus is that of the set position alone.
        before = np.clip(np.searchsorted(drive.time_s, sent.time_s) - 1, 0, len(drive.time_s) - 1)
        near &= drive.shows("mode", "csv")[before]
    output = axis.output[at]
    moved = near & (np.abs(output) > 0.02) & (sent.values != 0.0)
    # The scale is that of most frames; an axis that stands still needs none.
    scale = float(np.median(sent.values[moved] / output[moved])) if np.count_nonzero(moved) > 20 else 0.0
    judged = near & ((output == 0.0) | (scale != 0.0))
    off = np.abs(sent.values - scale * output)
    return Judged(
        sent.time_s,
        judged,
        judged & (off > 2.0 * step + 1e-3 * np.abs(scale * output) + 1e-5 * abs(scale)),
        lambda k: (
            f"{sent.values[k]:.6g} rpm is sent with an output of {output[k]:.5g}, of which 1 is "
            f"{scale:.6g} rpm"
        ),
    )


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
    Rule(
        name="direction is shown",
        says="PositiveDirection or NegativeDirection is set while a job moves the axis",
        requirements=("NC-449", "NC-450"),
        tolerance="from the second cycle of a motion on; not of two-speed axes",
        judge=_shows_direction,
    ),
    Rule(
        name="speed setpoint of the drive",
        says="the speed setpoint that the drive gets is the output of its own axis, by one scale",
        requirements=("NC-148", "NC-029"),
        tolerance="0.1 %, and two steps of the setpoint; not of an axis that an activation has created again",
        judge=_speed_given,
        excused_by=("frame.", "telegram.", "can.", "controller.", "drive."),
        recovery_s=0.1,
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
    for part, span_s in pieces(trace) if names else ():
        whole = TraceView(part)
        pairs = {} if part.vocabulary is None else dict(part.vocabulary.drives)
        for name in names:
            drive = pairs.get(name, "")
            view = NcAxisView(part, name, whole.drive(drive))
            found.look(name, view, whole.excuses((name, drive)), cycle_s=view.cycle_s, span_s=span_s)
    return found.checks()
