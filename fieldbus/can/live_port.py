"""A local node's connection to a live segment."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING

from fieldbus.can.frame import CanFrame, FrameReceiver

if TYPE_CHECKING:
    from fieldbus.can.live import LiveSegment


class LivePort:
    """A local node's connection to a live segment; made by `LiveSegment.attach`."""

    __slots__ = ("confirm", "detached", "listen_only", "name", "online", "receive", "segment")

    def __init__(
        self,
        segment: LiveSegment,
        name: str,
        receive: FrameReceiver,
        *,
        listen_only: bool,
        confirm: FrameReceiver | None,
    ) -> None:
        self.segment = segment
        self.name = name
        self.receive = receive
        self.listen_only = listen_only
        self.confirm = confirm
        self.online = True
        """False: the node neither sends nor receives. The adapter goes on acknowledging what is on the bus.
        """
        self.detached = False

    def send(self, frame: CanFrame) -> None:
        """Hand `frame` to the bus and to the other local nodes.

        Raises:
            BusError: The port is detached or listens only, the segment is closed, the bus refuses, or the
                frame is no classical CAN frame.

        """
        self.segment.submit(self, frame)

    def send_all(self, frames: Iterable[CanFrame]) -> None:
        """Hand several frames over, in their order; see `send`."""
        for frame in frames:
            self.segment.submit(self, frame)

    def detach(self) -> None:
        """Leave the segment for good; harmless to repeat."""
        self.segment.detach(self)

    def __repr__(self) -> str:
        where = "detached" if self.detached else "online" if self.online else "offline"
        return f"<LivePort {self.name} on {self.segment.name}: {where}>"
