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
_FORWARD: Final = 1 << 9
_BACKWARD: Final = 1 << 10
_ERROR: Final = 1 << 31
_STANDS: Final = 1e-9


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
        self.velocity = self._of(trace, name, "set_velocity")
        self.output = self._of(trace, name, "output")
        self.code = self._of(trace, name, "error_code")
        self.cycles = self._of(trace, name, "op_mode_dword").astype(np.int64) >> 24 & 0xFF
        self.two_speed = bool(trace.constants.get(f"{name}.two_speed"))
        """Whether its set values are the actual ones (NC-607)."""

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
