"""Faults of followers and of their leading axis, in every phase of synchronous operation, and what the
specification makes of them. The matrix `synchronous_faults` crosses them with functions and phases.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Final

from hil.campaign import CaseContext
from hil.expect import alarm, no_alarm, standstill
from testcases.campaigns._synchronous import (
    FUNCTIONS,
    OUTPUT,
    PHASES,
    WAITING,
    Machine,
    applied,
    bring,
    lost,
    machine,
)

LEADER_DRIVE, FOLLOWER_DRIVE = "leader_drive", "a_drive"


@dataclass(frozen=True, kw_only=True)
class Word:
    """A fault of one of both axes."""

    words: str
    kind: str
    of_leader: bool = False
    options: Mapping[str, Any] = field(default_factory=dict)
    lasts_s: float | None = None
    number: int
    """Alarm of the axis that it hits."""
    reaction: int
    carries: bool = True
    """Of a fault of the leading axis: it goes on to give a value that can be followed."""
    steps_back: bool = False
    """Its value steps back to the actual one, which is no way to synchronise (SYN-312)."""


FAULTS: Final = {
    "drive-fault": Word(
        words="its drive trips", kind="drive.fault", options={"code": 0x2310}, number=421, reaction=4,
    ),
    "torque-off": Word(words="its torque is off", kind="drive.sto", lasts_s=0.5, number=421, reaction=4),
    "limit-switch": Word(
        words="it meets a limit switch", kind="switch.press", options={"input": "positive_limit"},
        lasts_s=0.8, number=531, reaction=3,
    ),
    "jam": Word(words="it jams", kind="mechanics.jam", lasts_s=0.8, number=521, reaction=4),
    "unplugged": Word(
        words="its cycles on the bus are lost", kind="can.unplug", options={"node": FOLLOWER_DRIVE},
        lasts_s=0.4, number=431, reaction=4,
    ),
    "leader-drive-fault": Word(
        words="the leading drive trips", kind="drive.fault", of_leader=True, options={"code": 0x2310},
        number=421, reaction=4, steps_back=True,
    ),
    "leader-limit-switch": Word(
        words="the leading axis meets a limit switch", kind="switch.press", of_leader=True,
        options={"input": "positive_limit"}, lasts_s=0.8, number=531, reaction=3,
    ),
    "leader-jam": Word(
        words="the leading axis jams", kind="mechanics.jam", of_leader=True, lasts_s=0.8,
        number=521, reaction=4, steps_back=True,
    ),
    "leader-unplugged": Word(
        words="the cycles of the leading drive are lost", kind="can.unplug", of_leader=True,
        options={"node": LEADER_DRIVE}, lasts_s=0.4, number=431, reaction=4, carries=False,
    ),
}  # fmt: skip
"""Faults by their word in a matrix."""


class FollowerVocabulary:
    """Functions, phases and faults of a follower; see `hil.matrix.Vocabulary`."""

    factors: Final[Mapping[str, Mapping[str, str]]] = {
        "function": FUNCTIONS,
        "phase": PHASES,
        "fault": {name: word.words for name, word in FAULTS.items()},
    }
    defaults: Final[Mapping[str, str]] = {}
    benches: Final[Mapping[tuple[str, str], str]] = {}

    def impossible(self, values: Mapping[str, str]) -> str:
        """Return why a combination cannot exist."""
        function, phase = values.get("function"), values.get("phase")
        if function is not None and phase in ("waiting", "desynchronising") and function not in WAITING:
            return "the function neither waits nor leaves at a place"
        return ""

    def title(self, values: Mapping[str, str]) -> str:
        """Return what a combination tests, in words."""
        words = FAULTS[values["fault"]].words
        return f"{FUNCTIONS[values['function']]}: {words} {PHASES[values['phase']]}"

    def requirements(self, values: Mapping[str, str]) -> Sequence[str]:
        """Return the identifiers that a combination checks."""
        word = FAULTS[values["fault"]]
        if not word.of_leader:
            return ("SYN-295",)
        return ("SYN-294",) if not word.carries or values["phase"] == "synchronous" else ()

    def run(self, ctx: CaseContext, values: Mapping[str, str]) -> None:
        """Bring the follower into the phase, let the fault act, and state what is expected."""
        word = FAULTS[values["fault"]]
        here = machine(ctx)
        job = bring(ctx, here, values["function"], values["phase"])
        drive = LEADER_DRIVE if word.of_leader else FOLLOWER_DRIVE
        target = "" if "node" in word.options else drive
        ctx.inject(word.kind, target, duration_s=word.lasts_s, **word.options)
        ctx.run_for(1.2)
        if word.of_leader:
            _leader_fails(ctx, here, word, values, job)
        else:
            lost(ctx, here, job, number=word.number, reaction=word.reaction, since=applied())


def _leader_fails(ctx: CaseContext, here: Machine, word: Word, values: Mapping[str, str], job: Any) -> None:
    """Expect what a failed leading axis does to its follower: a value that is no value ends the job with
    alarm 601; one that steps back ends synchronising with alarm 608; else the follower comes to rest with it
    and stays in gear.
    """
    name, phase = here.follower.name, values["phase"]
    ctx.expect(
        alarm(word.number, reaction=word.reaction, since=applied(), axis=here.leader.name),
        standstill(by=ctx.now_s - 0.1, axis=name),
        standstill(by=ctx.now_s - 0.1, axis=here.leader.name),
    )
    on_the_way = phase in ("synchronising", "desynchronising") and values["function"] != "gear-in-velocity"
    if not word.carries or (word.steps_back and on_the_way):
        number = 608 if word.carries else 601
        expected = alarm(number, reaction=2, since=applied(), axis=name)
        ctx.expect(expected.covers("SYN-312" if word.carries else "SYN-294"))
        ctx.measure(f"ErrorID of {job.name}", job.ErrorID, low=0x8001, high=0x8001)
        return
    ctx.expect(no_alarm(since=applied(), axis=name, besides=(522,)))
    ctx.measure(f"{job.name} goes on", float(job.Busy and not job.Error), low=1.0)
    if phase == "synchronous":
        ctx.measure(
            f"{OUTPUT[values['function']]} of {job.name}",
            float(getattr(job, OUTPUT[values["function"]])),
            low=1.0,
        )


VOCABULARY: Final = FollowerVocabulary()
