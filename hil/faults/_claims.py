"""Several faults that want the same thing of the same part: none of them mends what another one still breaks.

A *door* is what a fault operates: a method of a drive, an input, a channel, a port. Every fault lays a claim
on it. The newest claim acts; when it ends, the one before it acts again; the last one that ends puts the door
right. Forces add up instead.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, Final

from fieldbus.errors import HilError
from hil.faults._action import Action

Combine = Callable[[Sequence["Claim"]], tuple[Any, ...]]
_DOORS: Final = "_doors_of_faults"
"""Where a bench keeps its doors, by name of the part and of what is operated there."""


def total(claims: Sequence[Claim]) -> tuple[Any, ...]:
    """Combine claims that add up, as forces do."""
    return (sum(claim.arguments[0] for claim in claims),)


def each(claims: Sequence[Claim]) -> tuple[Any, ...]:
    """Combine claims that act one after the other, in the order in which they came."""
    return ([claim.arguments for claim in claims],)


class Door:
    """One thing that can be broken, with the claims of all faults on it."""

    __slots__ = ("_acting", "_anew", "_claims", "_combine", "_mend", "_operate")

    def __init__(
        self, operate: Callable[..., Any], mend: Callable[[], Any], *, combine: Combine | None, anew: bool
    ) -> None:
        self._operate = operate
        self._mend = mend
        self._combine = combine
        self._anew = anew
        self._claims: list[Claim] = []
        self._acting: tuple[Any, ...] | None = None

    def settle(self, claims: list[Claim]) -> None:
        """Do what the claims say from now on."""
        more = len(claims) > len(self._claims)
        self._claims = claims
        if not claims:
            self._acting = None
            self._mend()
            return
        wanted = claims[-1].arguments if self._combine is None else self._combine(claims)
        if wanted != self._acting or (more and self._anew):
            self._acting = wanted
            self._operate(*wanted)

    def forget(self, claim: Claim) -> None:
        """Drop a claim that could not be met."""
        self._claims = [one for one in self._claims if one is not claim]
        self._acting = None

    @property
    def claims(self) -> list[Claim]:
        """Claims that are laid, the newest last."""
        return self._claims


class Claim(Action):
    """What one fault wants of a door.

    Args:
        bench: The bench.
        place: Name of the part, and what is operated there.
        operate: Breaks it, called with the arguments of a claim.
        mend: Puts it right.
        arguments: What this fault wants.
        combine: What several claims make together; None: the newest counts.
        anew: The door is operated for every new claim, also when it stands like that already: it may have
            recovered.

    """

    __slots__ = ("_door", "arguments")

    def __init__(
        self,
        bench: Any,
        place: tuple[Any, ...],
        operate: Callable[..., Any],
        mend: Callable[[], Any],
        arguments: tuple[Any, ...] = (),
        *,
        combine: Combine | None = None,
        anew: bool = False,
    ) -> None:
        super().__init__(place[0], self.lay, self.withdraw)
        # On the bench itself, and so gone with it: doors lead to its parts, and a table of them elsewhere
        # would keep it alive.
        doors: dict[tuple[Any, ...], Door] = vars(bench).setdefault(_DOORS, {})
        self._door = doors.setdefault(place, Door(operate, mend, combine=combine, anew=anew))
        self.arguments = arguments

    def lay(self, *arguments: Any) -> None:
        """Want this from now on; with arguments, these instead of those before."""
        if arguments:
            self.arguments = arguments
        before = self._door.claims
        try:
            self._door.settle(before if self in before else [*before, self])
        except HilError:
            self._door.forget(self)  # refused: there is nothing to take back
            raise

    def withdraw(self) -> None:
        """Want nothing any more."""
        claims = self._door.claims
        if self in claims:
            self._door.settle([claim for claim in claims if claim is not self])


def all_of(target: str, claims: Sequence[Claim]) -> Action:
    """Return the action that lays and withdraws several claims together."""

    def lay() -> None:
        for claim in claims:
            claim.lay()

    def withdraw() -> None:
        for claim in claims:
            claim.withdraw()

    return Action(target, lay, withdraw)
