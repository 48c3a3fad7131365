"""What a fault may do to what is on a link."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field


@dataclass(frozen=True)
class Change:
    """What becomes of one transmission. The defaults change nothing.

    Args:
        drop: It does not go on the link at all.
        data: Other bytes instead of it.
        delay_ns: It begins so much later, ns.
        pauses: Serial line: silence before the byte with this number (from 1 on), ns.
        damaged: Serial line: numbers of the bytes that arrive with a wrong parity.
        cuts: TCP: numbers of the bytes that begin a new segment.
        reset: TCP: the connection is reset instead.

    """

    drop: bool = False
    data: bytes | None = None
    delay_ns: int = 0
    pauses: Mapping[int, int] = field(default_factory=dict)
    damaged: tuple[int, ...] = ()
    cuts: tuple[int, ...] = ()
    reset: bool = False


LinkHook = Callable[[str, bytes, int], Change | None]
"""Called with sender, bytes and time (ns) when something is about to go on a link; None leaves it as it is.
"""


class _Entry:
    """A hook that was added; the same one may be added twice."""

    def __init__(self, hook: LinkHook) -> None:
        self.hook = hook


class Hooks:
    """The hooks of a link, asked in the order in which they came; the first that wants a change has it."""

    def __init__(self) -> None:
        self._entries: list[_Entry] = []

    def add(self, hook: LinkHook) -> Callable[[], None]:
        """Ask `hook` from now on; returns the function that ends it (harmless to repeat)."""
        entry = _Entry(hook)
        self._entries = [*self._entries, entry]

        def end() -> None:
            self._entries = [other for other in self._entries if other is not entry]

        return end

    def ask(self, sender: str, data: bytes, time_ns: int) -> Change | None:
        """Return the change that is wanted."""
        for entry in self._entries:
            change = entry.hook(sender, data, time_ns)
            if change is not None:
                return change
        return None
