"""Targets and coupled axes."""

from __future__ import annotations

from typing import Final

from hil.museum import FieldError, Source
from testcases.museum._seeds import made

_AREA: Final = "coordination"

ENTRIES: Final[tuple[FieldError, ...]] = (
    FieldError(
        name="modulo-move-lost",
        title="A modulo positioning is not executed when target and start come together",
        area=_AREA,
        sources=(
            Source(
                "Lenze application knowledge base, 294973 (8400 up to V13)",
                "https://www.lenze.com/de-de/application-knowledge-base/artikel/294973/1",
            ),
        ),
        happened=(
            "An inverter converts a target into its modulo range in the background. When the start edge "
            "came with the new target or a few milliseconds behind it, the old target was still in force: "
            "no motion, or a motion to the wrong place, sporadically, by the load of the processor."
        ),
        on_the_bus="The start is acknowledged and *done* comes at once; the position stays.",
        found_by=(
            "Change target and start in the same cycle, many times, and check the way, not *done* alone: "
            "*done* is true, for the old target."
        ),
        campaign="modulo_axis",
        case="modulo-axis/place/shortest",
        defect=made(
            "modulo-move-lost",
            "axis",
            "A positioning of a modulo axis goes to the place where it is",
            (
                "motion.s7.axis.motion:MotionControl._activate",
                "job.target = self._servo.modulo.target(job.target, gen.s, job.direction)",
                "job.target = self._servo.modulo.target(gen.s, gen.s, job.direction)",
            ),
        ),
    ),
    FieldError(
        name="follower-reverses-when-leaving",
        title="The follower goes backwards when it is uncoupled to a place that it has passed",
        area=_AREA,
        sources=(
            Source(
                "Lenze application knowledge base, 319073 (FlexCam)",
                "https://www.lenze.com/en-us/application-knowledge-base/article/319073/1",
            ),
            Source(
                "Lenze application knowledge base, 201700120 (ElectricalShaftPos before V3.15)",
                "https://www.lenze.com/en-de/go/akb/201700120/1",
            ),
        ),
        happened=(
            "Technology modules uncoupled a follower to a stop position behind the present one. On a modulo "
            "axis that is a place of the next turn; the follower reversed to it instead, through whatever "
            "was in its way."
        ),
        on_the_bus="The velocity of the follower changes its sign during desynchronising.",
        found_by=(
            "Uncouple at every angle of the turn. A follower that may not run backwards needs a stop "
            "position ahead of it, or a module that counts on."
        ),
        campaign="gearing",
        case="gearing-of-a-modulo-axis/gear-out/behind",
        defect=made(
            "follower-reverses-when-leaving",
            "axis",
            "MC_GearOut takes a stop position of a modulo axis as the nearest one, whichever side it lies on",
            (
                "motion.kernel.synchronous.leaving:_StopPlace.passed",
                (
                    "        if modulo.enabled:\n"
                    "            left = (left + _ROUNDING) % modulo.length - _ROUNDING\n"
                ),
                "        if modulo.enabled and left < 0.0:\n            return self._position, 0.0\n",
            ),
        ),
    ),
)
