"""Overlapping faults on one target stack: the newest is active; when it ends, the previous one resumes.

What a fault operates - a method of a drive, an input, a channel - has a stack of overrides, one per
fault that is active on it. When the last one ends, the target is restored. Where settings can be
combined, as forces can, all of them act together.
"""

from __future__ import annotations

from collections.abc import Callable, Hashable, Sequence
from typing import TYPE_CHECKING, Final, Generic, TypeVar, cast

from fieldbus.errors import HilError

if TYPE_CHECKING:
    from hil.protocols import Bench

S = TypeVar("S")
V = TypeVar("V")
_SHARED: Final = "_shared_by_faults"


def shared(bench: Bench, key: Hashable, make: Callable[[], V]) -> V:
    """Return what all faults of a bench that name the same key have in common, made for the first of them.

    It lives in the bench itself and ends with it: it leads to parts of the bench, and a table
    elsewhere would keep them alive.
    """
    table: dict[Hashable, object] = vars(bench).setdefault(_SHARED, {})
    if key not in table:
        table[key] = make()
    return cast("V", table[key])


def newest(settings: Sequence[S]) -> S:
    """Return the setting that is active when the newest counts."""
    return settings[-1]


class OverrideStack(Generic[S]):
    """Overrides of one target.

    Args:
        operate: Sets the target, called with the settings of all overrides, the newest last.
        restore: Restores it when there is none left.
        effective: What the settings come to together; the target is operated only when that changes.
        repeat: The target is operated for every new override, also when nothing changes: it may have
        recovered.

    """

    def __init__(
        self,
        operate: Callable[[Sequence[S]], object],
        restore: Callable[[], object],
        *,
        effective: Callable[[Sequence[S]], object] = newest,
        repeat: bool = False,
    ) -> None:
        self._operate = operate
        self._restore = restore
        self._effective = effective
        self._repeat = repeat
        self._overrides: list[Override[S]] = []
        self._active: object = None

    def apply(self, override: Override[S]) -> None:
        """Put an override on top, or take over its new setting.

        Raises:
            HilError: The target refuses it; then the override is not in the stack.

        """
        new = override not in self._overrides
        if new:
            self._overrides = [*self._overrides, override]
        try:
            self._settle(again=new and self._repeat)
        except HilError:
            self._overrides = [one for one in self._overrides if one is not override]
            self._active = None
            raise

    def remove(self, override: Override[S]) -> None:
        """End an override; the one below resumes, or the target is restored. Harmless if it is not there."""
        if override not in self._overrides:
            return
        self._overrides = [one for one in self._overrides if one is not override]
        if self._overrides:
            self._settle(again=False)
        else:
            self._active = None
            self._restore()

    def _settle(self, *, again: bool) -> None:
        settings = [one.setting for one in self._overrides]
        active = self._effective(settings)
        if again or active != self._active:
            self._active = active
            self._operate(settings)


class Override(Generic[S]):
    """What one fault sets at a target.

    Args:
        stack: Overrides of the target.
        setting: What this fault sets.

    """

    def __init__(self, stack: OverrideStack[S], setting: S) -> None:
        self._stack = stack
        self.setting = setting

    def apply(self) -> None:
        """Set it."""
        self._stack.apply(self)

    def change(self, setting: S) -> None:
        """Set something else from now on."""
        self.setting = setting
        self._stack.apply(self)

    def remove(self) -> None:
        """End it."""
        self._stack.remove(self)
