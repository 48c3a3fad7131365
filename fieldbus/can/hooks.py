"""Fault hooks of a CAN segment: what may happen to a frame that is about to go on the wire."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Final, Literal, Self

from fieldbus.can.bitstream import BitError
from fieldbus.can.fd import wire_bits
from fieldbus.can.frame import CanFrame
from fieldbus.errors import BusError

HookKind = Literal["drop", "delay", "corrupt", "replace", "duplicate"]


class HookResult:
    """What a hook wants done with the frame; made by the class methods."""

    __slots__ = ("count", "delay_ns", "error", "frame", "kind")

    def __init__(
        self,
        kind: HookKind,
        *,
        delay_ns: int = 0,
        count: int = 0,
        frame: CanFrame | None = None,
        error: BitError | None = None,
    ) -> None:
        self.kind: Final = kind
        self.delay_ns: Final = delay_ns
        self.count: Final = count
        self.frame: Final = frame
        self.error: Final = error

    @classmethod
    def drop(cls) -> Self:
        """The frame never reaches the wire; the sender believes that it was sent."""
        return cls("drop")

    @classmethod
    def delay(cls, delay_ns: int) -> Self:
        """The frame is offered to the bus only after `delay_ns` (> 0), and is not hooked again."""
        if delay_ns <= 0:
            raise BusError(f"delay {delay_ns} ns of a frame is not positive")
        return cls("delay", delay_ns=delay_ns)

    @classmethod
    def corrupt(cls, count: int = 1, error: BitError | None = None) -> Self:
        """The next `count` (>= 1) attempts suffer a bit error; what follows depends on its place (virtual
        segments only).

        Args:
            count: Attempts in a row.
            error: Which bit is wrong, and for whom; default: the last bit of the CRC, for all. A frame
                that has no such bit passes.

        """
        if count < 1:
            raise BusError(f"{count} corrupted attempts: at least one is needed")
        return cls("corrupt", count=count, error=BitError() if error is None else error)

    @classmethod
    def replace(cls, frame: CanFrame) -> Self:
        """`frame` goes out in place of what the sender gave.

        Raises:
            BusError: `frame` is no CAN frame.

        """
        wire_bits(frame, None, None)  # validates
        return cls("replace", frame=frame)

    @classmethod
    def duplicate(cls, count: int = 1) -> Self:
        """The frame is sent `count` (>= 1) more times, directly after the first."""
        if count < 1:
            raise BusError(f"{count} duplicates: at least one is needed")
        return cls("duplicate", count=count)

    def __repr__(self) -> str:
        details = {"delay_ns": self.delay_ns, "count": self.count, "frame": self.frame, "error": self.error}
        shown = ", ".join(f"{key}={value}" for key, value in details.items() if value)
        return f"HookResult.{self.kind}({shown})"


FrameHook = Callable[[CanFrame, str, int], HookResult | None]
"""Called with frame, name of the sender and time (ns); None lets the frame pass."""


class Verdict:
    """The results of all hooks for one frame, taken together."""

    __slots__ = ("copies", "corruptions", "delay_ns", "dropped", "frame")

    def __init__(self, frame: CanFrame) -> None:
        self.frame = frame
        self.dropped = False
        self.delay_ns = 0
        self.corruptions: tuple[BitError, ...] = ()
        self.copies = 0


def ask_hooks(hooks: Iterable[FrameHook], frame: CanFrame, sender: str, time_ns: int) -> Verdict | None:
    """Ask `hooks` in their order and combine what they say; None when all let the frame pass.

    A drop ends the round. A later hook sees the frame that an earlier one put in place; delays, corrupted
    attempts and duplicates add up.
    """
    verdict: Verdict | None = None
    for hook in hooks:
        result = hook(frame, sender, time_ns)
        if result is None:
            continue
        if verdict is None:
            verdict = Verdict(frame)
        if result.kind == "drop":
            verdict.dropped = True
            break
        if result.frame is not None:
            verdict.frame = frame = result.frame
        elif result.kind == "delay":
            verdict.delay_ns += result.delay_ns
        elif result.kind == "corrupt":
            assert result.error is not None
            verdict.corruptions += (result.error,) * result.count
        else:
            verdict.copies += result.count
    return verdict


class FrameHooks:
    """The hooks of a segment, in the order in which they were added.

    Args:
        on_change: Called when hooks were added or removed.

    """

    def __init__(self, on_change: Callable[[], None] | None = None) -> None:
        self.active: tuple[FrameHook, ...] = ()
        self._on_change = on_change
        # Each in a tuple, for an identity of its own: the same function can be added twice.
        self._entries: tuple[tuple[FrameHook], ...] = ()

    def add(self, hook: FrameHook) -> Callable[[], None]:
        """Add a hook; return the function that removes it, harmless to repeat."""
        entry = (hook,)
        self._replace((*self._entries, entry))

        def remove() -> None:
            self._replace(tuple(other for other in self._entries if other is not entry))

        return remove

    def _replace(self, entries: tuple[tuple[FrameHook], ...]) -> None:
        self._entries = entries
        self.active = tuple(hook for (hook,) in entries)
        if self._on_change is not None:
            self._on_change()
