"""Makes of controllers that a case can run on, and what a campaign says of the other make."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Final

from hil.errors import CannotRunError

CONTROLLERS: Final[Mapping[str, str]] = {"s7": "a technology object of an S7-1500", "nc": "an axis of an NC"}
"""Word of `--controllers` -> what it is; the first is the one that cases are written for."""


@dataclass(frozen=True)
class Counterpart:
    """What a case is on another make of controller: the same fault in the same phase, and what is expected
    there.
    """

    function: Callable[..., object]
    """Called with a `CaseContext` and the parameters."""
    parameters: Mapping[str, object] = field(default_factory=dict)
    requirements: tuple[str, ...] = ()
    title: str = ""
    """What is tested; empty: the title of the case."""
    needs: Mapping[str, str | Sequence[str]] | None = None
    """What it needs of a configuration; None: its numbers are those of the bench of the case, so that it runs
    on no configuration.
    """


@dataclass(frozen=True)
class NotApplicable:
    """A case has no meaning on another make of controller."""

    reason: str
    """Why, in a sentence that the report shows."""


Rule = Callable[[str, Mapping[str, object]], Counterpart | NotApplicable | None]
"""Tells what a case is on another make, by its name behind the slug of the campaign and its parameters; None:
nobody has said so.
"""


def parse_controllers(text: str) -> tuple[str, ...]:
    """Read `s7`, `nc` or `s7,nc`.

    Raises:
        CannotRunError: It names another make, or one twice.

    """
    names = tuple(name.strip() for name in text.split(",")) if text else ()
    if any(name not in CONTROLLERS for name in names) or len(set(names)) < len(names):
        raise CannotRunError(
            f"--controllers {text!r} is not allowed; allowed: {', '.join(CONTROLLERS)}, or several with "
            "commas, "
            "each once"
        )
    return names
