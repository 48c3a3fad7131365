"""What the controller does when a CiA 402 drive refuses a part of its configuration: another plan."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from typing import Final

from fieldbus.canopen.abort import AbortCode
from fieldbus.canopen.boot import Refusal
from fieldbus.canopen.node_setup import NodeSetup
from motion.drives.cia402_plan import Answers, DrivePlan, named

_RATIOS: Final = (0x608F, 0x6091, 0x6092, 0x6093, 0x6094, 0x6096)
SCALING: Final = (*((index, sub) for index in _RATIOS for sub in (1, 2)), (0x60A9, 0))
"""Objects that say how large the units of the drive are."""
_OBJECT_IS_WRONG: Final = (AbortCode.NOT_MAPPABLE, AbortCode.NO_OBJECT, AbortCode.VALUE, AbortCode.PARAMETER)
_TOO_MUCH: Final = (AbortCode.PDO_LENGTH, AbortCode.NOT_MAPPABLE, AbortCode.VALUE, AbortCode.VALUE_HIGH)


class Negotiation:
    """Plans again with what the drive has shown (`Negotiator`).

    Args:
        plan: The plan to begin with.
        plan_again: Returns the plan for a drive that is as it has shown.
        setup_of: Returns what a plan sets up.
        take: Puts a plan into use.

    """

    def __init__(
        self,
        plan: DrivePlan,
        *,
        plan_again: Callable[[Answers], DrivePlan],
        setup_of: Callable[[DrivePlan], NodeSetup],
        take: Callable[[DrivePlan], None],
    ) -> None:
        self._plan = plan
        self._plan_again = plan_again
        self._setup_of = setup_of
        self._take = take
        self._answers = Answers()

    @staticmethod
    def look_at(refusal: Refusal) -> Iterable[tuple[int, int]]:
        """Return what has to be known of the drive: the PDO, or the object and what goes with it."""
        at = refusal.parameter.index, refusal.parameter.sub
        if refusal.pdo is not None:
            return refusal.pdo.record
        return SCALING if at in SCALING else (at,)

    def instead(self, refusal: Refusal, found: Mapping[int, int]) -> tuple[NodeSetup, str] | None:
        """Return the setup of another plan and what it does otherwise; None: there is nothing else to try.

        Raises:
            ConfigurationError: No plan fits the drive.

        """
        answers = self._answers
        before = len(answers.fixed), len(answers.unmappable)
        if refusal.pdo is None:
            answers.values.update(found)
            answers.fixed.add(refusal.parameter.key)
        else:
            self._learn_of_pdo(refusal, found)
        if (len(answers.fixed), len(answers.unmappable)) == before:
            return None
        plan = self._plan_again(answers)
        text = "; ".join(_changes(self._plan, plan)) or "left as it is"
        self._plan = plan
        self._take(plan)
        return self._setup_of(plan), text

    def _learn_of_pdo(self, refusal: Refusal, found: Mapping[int, int]) -> None:
        pdo, parameter, code = refusal.pdo, refusal.parameter, refusal.abort_code
        assert pdo is not None
        answers = self._answers
        in_mapping = parameter.index == pdo.mapping
        if in_mapping and parameter.sub and code in _OBJECT_IS_WRONG:
            answers.unmappable.add((parameter.value >> 8, pdo.transmit))
        elif in_mapping and parameter.value and not parameter.sub and code in _TOO_MUCH and pdo.entries:
            answers.unmappable.add((pdo.entries[-1] >> 8, pdo.transmit))
        else:
            keys = list(_members(pdo.mapping)) if in_mapping and parameter.sub else [parameter.key]
            for key in keys:
                answers.fixed.add(key)
                if key in found:
                    answers.values[key] = found[key]
            if code == AbortCode.NO_SUB_INDEX and parameter.key not in found:
                answers.absent.add(parameter.key)


def _changes(old: DrivePlan, new: DrivePlan) -> Iterator[str]:
    """Yield what a plan does otherwise: other modes, other PDOs, what is lost."""
    yield from (note for note in new.notes if note not in old.notes)
    for letter, before, after in (("R", old.receive, new.receive), ("T", old.transmit, new.transmit)):
        for use in after:
            if before and use not in before:
                carried = ", ".join(named(raw >> 8) for raw in use.entries)
                yield f"{letter}PDO {use.cob_id:03X}h carries {carried}"


def _members(mapping: int) -> Iterator[int]:
    return (mapping << 8 | sub for sub in range(1, 9))
