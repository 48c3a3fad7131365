"""The interface of a CAN segment, whatever carries it."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Protocol, runtime_checkable

from fieldbus.can.frame import CanFrame, FrameReceiver
from fieldbus.clock import Scheduler


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
    def data_bitrate(self) -> int | None:
        """Bit rate of the data phase of CAN FD, bit/s; None = a classical segment."""

    @property
    def ports(self) -> Sequence[CanPort]:
        """The attached nodes, in the order in which they came."""

    def attach(
        self, name: str, receive: FrameReceiver, *, confirm: FrameReceiver | None = None, fd: bool = False
    ) -> CanPort:
        """Connect a node.

        Args:
            name: Its name, which no other node of the segment has.
            receive: Called with every frame of the others, never with the node's own.
            confirm: Called with every own frame that was sent.
            fd: Whether the node takes and sends frames of CAN FD.

        Raises:
            BusError: The name is taken.
            ConfigurationError: CAN FD on a classical segment.

        """
