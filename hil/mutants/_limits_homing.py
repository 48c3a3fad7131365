"""Defects of travel limits and of homing."""

from __future__ import annotations

from functools import partial
from typing import Final

from hil.mutants._mutant import Mutant, defect

_LIMITS: Final = "motion.axis.limits:TravelLimits"
_ACTIVE: Final = "motion.axis.homing.active:ActiveHoming"
_FINDER: Final = "motion.axis.homing.finder:MarkFinder"
_PASSIVE: Final = "motion.axis.homing.passive:PassiveHoming"
_DIRECT: Final = "motion.axis.homing.direct"

_defect = partial(defect, area="axis")

MUTANTS: Final[tuple[Mutant, ...]] = (
    _defect(
        "limit-polarity",
        "The level of the hardware limit switches is taken the wrong way round",
        f"{_LIMITS}.check_hardware",
        "is (switch.level.value != 0)",
        "is (switch.level.value == 0)",
        ids=("LIM-034",),
        likely=("fault-reactions/limit-switch/constant",),
    ),
    _defect(
        "limit-switches-crossed",
        "The negative limit switch is read from the input of the positive one",
        f"{_LIMITS}.check_hardware",
        "on = (inputs & switch.mask != 0)",
        "on = (inputs & (3 - switch.mask) != 0)",
        ids=("LIM-034",),
        likely=("fault-reactions/limit-switch-stuck", "fault-reactions/limit-switch/*"),
    ),
    _defect(
        "limit-can-be-left-outwards",
        "A limit switch that is acknowledged lets the axis go on outwards",
        f"{_LIMITS}._evaluate",
        "if outwards > 0.0 or (self._barred and outwards != 0.0):",
        "if self._barred and outwards != 0.0:",
        ids=("LIM-049", "LIM-059"),
        likely=("fault-reactions/limit-switch-stuck", "fault-reactions/limit-switch/*"),
    ),
    _defect(
        "limit-bars-the-way-back",
        "A limit switch that is acknowledged bars the way back too",
        f"{_LIMITS}._evaluate",
        "if outwards > 0.0 or (self._barred and outwards != 0.0):",
        "if outwards != 0.0:",
        ids=("LIM-049",),
        likely=("fault-reactions/limit-switch/*", "fault-reactions/limit-switch-stuck"),
    ),
    _defect(
        "limit-keeps-no-enable",
        "A hardware limit switch always removes the enable, whatever ApproachBehavior says",
        f"{_LIMITS}._alarm",
        "reaction=3 if keeps_enabled else 4,",
        "reaction=4,",
        ids=("LIM-034",),
        likely=("fault-reactions/limit-switch/*",),
    ),
    _defect(
        "homing-approaches-the-wrong-way",
        "Active homing approaches against Homing.ApproachDirection",
        f"{_ACTIVE}.__init__",
        'self._approach = -1 if read("Homing.ApproachDirection") else 1',
        'self._approach = 1 if read("Homing.ApproachDirection") else -1',
        ids=("HOM-085",),
        likely=("homing/cam/*", "homing/input/*"),
    ),
    _defect(
        "homing-searches-at-approach-speed",
        "The mark is searched with the approach velocity",
        f"{_ACTIVE}._enter",
        "velocity = self._homing_velocity if phase is Phase.SEARCH else self._approach_velocity",
        "velocity = self._approach_velocity",
        ids=("HOM-080",),
        likely=("homing/cam/*",),
    ),
    _defect(
        "home-offset-added",
        "The home position offset is added instead of subtracted",
        f"{_ACTIVE}._arrive",
        "relate(axis, target - way - mark)",
        "relate(axis, target + way - mark)",
        ids=("HOM-081",),
        likely=("homing/zero-mark/*", "homing/cam/*"),
    ),
    _defect(
        "home-at-actual-position",
        "The position of the mark counts as that of the cycle in which it is noticed",
        f"{_FINDER}._passed",
        "return self._feedback.position + ahead",
        "return self._feedback.position",
        ids=("HOM-082",),
        likely=("homing/zero-mark/*", "homing/on-the-fly/zero-mark/*"),
    ),
    _defect(
        "mark-on-cam-counts",
        "A zero mark that lies on the cam is taken",
        f"{_FINDER}.step",
        "# a zero mark on the cam does not count (HOM-091)\n            self.close()",
        "if search.searching else self._begin(search)",
        ids=("HOM-091",),
        likely=("homing/cam/*", "homing/no-zero-mark-behind-cam/*"),
    ),
    _defect(
        "mark-of-the-wrong-direction",
        "A mark that is passed against the homing direction is taken",
        f"{_FINDER}.step",
        "forward = way != 0 and self._direction in (0, way)",
        "forward = way != 0",
        ids=("HOM-128",),
        likely=("homing/cam-bounces/input/9@reference", "homing/wrong-direction"),
    ),
    _defect(
        "input-edge-swapped",
        "The edge of the other side of the digital input is taken for the mark",
        f"{_FINDER}.enters",
        "is not self._positive_side",
        "is self._positive_side",
        ids=("HOM-073", "HOM-076"),
        likely=("homing/input/*",),
    ),
    _defect(
        "no-reversal-at-limit",
        "Active homing does not turn round at a limit switch",
        f"{_ACTIVE}._begin",
        'if axis.variables.read("Homing.AutoReversal"):',
        'if axis.variables.read("Homing.AutoReversal") and self._kind < 0:',
        ids=("HOM-108",),
        likely=("homing/reversal/*",),
    ),
    _defect(
        "reverses-for-ever",
        "Active homing turns round at the limit switches as often as it meets one",
        f"{_ACTIVE}._turn",
        "self._turned.add(place)",
        "self._turned.discard(place)",
        ids=("HOM-114",),
        likely=("homing/cam-stuck-free/with", "homing/no-zero-mark/with", "homing/input-stuck-free/with"),
    ),
    _defect(
        "limits-stay-off-after-homing",
        "The limit switches stay unwatched after a homing that turns round at them",
        f"{_LIMITS}.end_reversal",
        "self.reversing = False\n",
        "self.reversing = self.reversing\n",
        ids=("HOM-115",),
        likely=("homing/limit-after-reversal@reference",),
    ),
    _defect(
        "passive-homing-resets-always",
        "Passive homing with mode 2 resets the homed state at its start",
        f"{_PASSIVE}.__init__",
        "if owner.incremental and mode != 2:",
        "if owner.incremental:",
        ids=("HOM-120",),
        likely=("homing/on-the-fly/*/2",),
    ),
    _defect(
        "direct-relative-as-absolute",
        "MC_Home mode 1 sets the position instead of shifting it",
        f"{_DIRECT}:home_directly",
        "if mode in (0, 7, 13):\n        offset = position - feedback.position",
        "if mode in (0, 1, 7, 13):\n        offset = position - feedback.position",
        ids=("HOM-013",),
        likely=("homing/direct/1@reference",),
    ),
    _defect(
        "homed-too-early",
        "The axis counts as homed from the start of active homing on",
        f"{_ACTIVE}._begin",
        "if axis.incremental:\n            axis.homed = False",
        "if axis.incremental:\n            axis.homed = True",
        ids=("HOM-087",),
        likely=("homing/aborted/*", "homing/no-zero-mark/*"),
    ),
    _defect(
        "homed-outlives-encoder-fault",
        "An incremental encoder that has failed leaves the axis homed",
        "motion.axis.feedback:Feedback.update",
        "self.lost_reference = True  # what",
        "self.lost_reference = False  # what",
        ids=("HOM-179",),
        likely=("homing/homed-encoder-lost@reference",),
    ),
)
