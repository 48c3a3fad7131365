"""CAN frames and the interface of a CAN segment, whatever carries it."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from typing import Protocol, runtime_checkable

from fieldbus.clock import Scheduler


class CanFrame:
    """A classical CAN data or remote frame. Immutable by convention; frames are shared between receivers.

    Args:
        can_id: Identifier, 0..7FFh, or 0..1FFFFFFFh with `extended`.
        data: 0 to 8 bytes; empty for a remote frame.
        extended: 29-bit identifier.
        remote: Remote frame; `dlc` then says how many bytes are asked for.
        dlc: Data length code 0..15 as sent; default the length of `data` (CANP-010).

    """

    __slots__ = ("can_id", "data", "dlc", "extended", "remote", "timing")

    def __init__(
        self,
        can_id: int,
        data: bytes = b"",
        *,
        extended: bool = False,
        remote: bool = False,
        dlc: int | None = None,
    ) -> None:
        self.can_id = can_id
        self.data = data
        self.extended = extended
        self.remote = remote
        self.dlc = len(data) if dlc is None else dlc
        self.timing: tuple[int, int] | None = None  # kept by `fieldbus.can.timing.note_timing`

    def __eq__(self, other: object) -> bool:
        return (
            isinstance(other, CanFrame)
            and self.can_id == other.can_id
            and self.data == other.data
            and self.extended == other.extended
            and self.remote == other.remote
            and self.dlc == other.dlc
        )

    def __hash__(self) -> int:
        return hash((self.can_id, self.data, self.extended, self.remote, self.dlc))

    def __repr__(self) -> str:
        width = 8 if self.extended else 3
        body = f"R{self.dlc}" if self.remote else self.data.hex(" ").upper()
        return f"<CanFrame {self.can_id:0{width}X}#{body}>"


FrameReceiver = Callable[[CanFrame, int], None]
"""Called with a received frame and the time of its end, ns."""


@runtime_checkable
class CanPort(Protocol):
    """One node's connection to a segment."""

    name: str
    online: bool
    """False: the node neither sends, receives nor acknowledges (powered down or unplugged)."""

    def send(self, frame: CanFrame) -> None:
        """Queue `frame` for transmission; returns at once."""

    def send_all(self, frames: Iterable[CanFrame]) -> None:
        """Queue several frames, in their order."""

    def detach(self) -> None:
        """Leave the segment for good; queued frames are lost."""


@runtime_checkable
class CanSegment(Protocol):
    """A CAN bus that devices attach to: virtual (`CanMedium`) or live (`LiveSegment`)."""

    name: str
    scheduler: Scheduler

    @property
    def bitrate(self) -> int | None:
        """Bit rate, bit/s; None = not known."""

    @property
    def ports(self) -> Sequence[CanPort]:
        """The attached nodes, in the order in which they came."""

    def attach(self, name: str, receive: FrameReceiver, *, confirm: FrameReceiver | None = None) -> CanPort:
        """Connect a node.

        Args:
            name: Its name, which no other node of the segment has.
            receive: Called with every frame of the others, never with the node's own.
            confirm: Called with every own frame that was sent.

        Raises:
            BusError: The name is taken.

        """
