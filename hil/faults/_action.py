"""What a fault does to the bench, and where it may."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from fieldbus.errors import UnsupportedFaultError
from hil.faults._fault import Fault
from hil.faults._parameters import Environment
from hil.protocols import Bench

Work = Callable[[], None]


class Action:
    """Applying a fault and taking it back.

    Args:
        target: Resolved name of what is broken.
        apply: Breaks it.
        remove: Mends it; None when there is nothing to mend.

    """

    __slots__ = ("apply", "remove", "target")

    def __init__(self, target: str, apply: Work, remove: Work | None) -> None:
        self.target = target
        self.apply = apply
        self.remove = remove


def environment(bench: Bench, part: Any) -> Environment:
    """Return where a part of the bench lives: `virtual`, `live` (emulated elsewhere) or `hardware`."""
    if getattr(part, "physical", False):
        return "hardware"
    return "virtual" if bench.kind == "virtual" else "live"


def refuse_unless_supported(bench: Bench, fault: Fault, part: Any) -> None:
    """Raise `UnsupportedFaultError` when the catalogue says that the fault cannot be injected there."""
    where = environment(bench, part)
    reason = fault.entry.injectable(where)
    if reason:
        raise UnsupportedFaultError(f"{fault.kind} cannot be injected on a {where} bench: {reason}")
