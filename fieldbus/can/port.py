"""A node's connection to the virtual segment."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

from fieldbus.can.confinement import WARNING_LIMIT, NodeState
from fieldbus.can.frame import CanFrame, FrameReceiver
from fieldbus.clock import Timer
from fieldbus.errors import BusError

if TYPE_CHECKING:
    from fieldbus.can.medium import CanMedium

Entry = tuple[int, int, int, CanFrame, int, int]
"""A frame waiting for the bus: arbitration key, sequence number, number of the copy, frame, bits, attempts still to be
corrupted (`NOT_ASKED` before the hooks have seen it). The first three give the order of the queue."""

NOT_ASKED = -1

StateListener = Callable[[NodeState, NodeState], object]


def deaf(frame: CanFrame, time_ns: int) -> None:
    """Receive nothing: stands in for the receiver of a node that does not listen."""


class Confirmation:
    """Stands among the receivers of a port's own frames to tell it that one has been sent."""

    __slots__ = ("receive",)

    def __init__(self, confirm: FrameReceiver) -> None:
        self.receive = confirm


class MediumPort:
    """A port of a `CanMedium`; made by `CanMedium.attach`.

    A frame that cannot be queued is lost without an exception, as in a CAN controller: because the port is offline
    or bus-off, or because its transmit queue is full (`overruns`, event `can.overrun`). Going offline, or into
    bus-off, empties the queue. Coming online starts the controller anew, counters at zero.
    """

    __slots__ = (
        "_online",
        "acknowledged",
        "auto_recovery",
        "can_send",
        "confirmation",
        "dead_sequence",
        "detached",
        "handler",
        "joining",
        "listen_only",
        "listening",
        "medium",
        "name",
        "not_before_ns",
        "on_state",
        "overruns",
        "queue",
        "rec",
        "receive",
        "receivers",
        "recovery_count",
        "recovery_from_ns",
        "recovery_timer",
        "state",
        "tec",
        "tx_buffers",
    )

    def __init__(
        self,
        medium: CanMedium,
        name: str,
        receive: FrameReceiver,
        *,
        listen_only: bool,
        tx_buffers: int,
        auto_recovery: bool,
        confirm: FrameReceiver | None,
    ) -> None:
        self.medium = medium
        self.name = name
        self.listen_only = listen_only
        """Receives without acknowledging and without error flags; must not send."""
        self.tx_buffers = tx_buffers
        self.auto_recovery = auto_recovery
        """Whether the node leaves bus-off by itself; otherwise after `recover`."""
        self.on_state: list[StateListener] = []
        """Called with the old and the new state when the error state changes."""
        self.tec = 0
        """Transmit error counter."""
        self.rec = 0
        """Receive error counter, up to 255."""
        self.state = NodeState.ERROR_ACTIVE
        self.overruns = 0
        """Frames refused because the transmit queue was full."""

        # The rest belongs to the medium.
        self._online = True
        self.detached = False
        self.joining = False  # came online in the middle of a frame
        self.listening = False
        self.can_send = not listen_only
        self.handler = receive
        self.receive: FrameReceiver = deaf
        self.confirmation = None if confirm is None else Confirmation(confirm)
        self.receivers: tuple[MediumPort | Confirmation, ...] = ()
        self.acknowledged = False
        self.queue: list[Entry] = []
        self.dead_sequence = 0  # entries up to this number must not return to the queue
        self.not_before_ns = 0  # suspend transmission
        self.recovery_count = 0
        self.recovery_from_ns = 0
        self.recovery_timer: Timer | None = None

    def send(self, frame: CanFrame) -> None:
        """Queue `frame`; it goes out as soon as it wins the bus, and again after every error.

        Raises:
            BusError: The port is detached or listens only, or the frame is no classical CAN frame.

        """
        self.medium.submit(self, frame)

    def detach(self) -> None:
        """Leave the segment for good; queued frames are lost. Harmless to repeat."""
        self.medium.detach(self)

    def flush(self) -> None:
        """Forget the queued frames; one that is on the wire still completes."""
        self.medium.flush(self)

    def recover(self) -> None:
        """Ask for recovery from bus-off (CANP-055); harmless in any other state."""
        self.medium.begin_recovery(self)

    def set_error_counters(self, *, tec: int | None = None, rec: int | None = None) -> None:
        """Set the error counters; the state follows (CANP-059).

        Args:
            tec: 0..256; 256 means bus-off.
            rec: 0..255.

        """
        if tec is not None and not 0 <= tec <= 256:
            raise BusError(f"transmit error counter {tec} is outside 0..256")
        if rec is not None and not 0 <= rec <= 255:
            raise BusError(f"receive error counter {rec} is outside 0..255")
        self.medium.set_error_counters(
            self, self.tec if tec is None else tec, self.rec if rec is None else rec
        )

    @property
    def online(self) -> bool:
        """Whether the node takes part; False: it neither sends, receives nor acknowledges."""
        return self._online

    @online.setter
    def online(self, value: bool) -> None:
        if value == self._online:
            return
        if self.detached:
            raise BusError(f"port {self.name} is detached from {self.medium.name}")
        self._online = value
        self.medium.presence_changed(self)

    @property
    def warning(self) -> bool:
        """Whether a counter has reached the warning limit of 96 (CANP-053)."""
        return self.tec >= WARNING_LIMIT or self.rec >= WARNING_LIMIT

    @property
    def pending(self) -> int:
        """Number of frames in the transmit queue, the one on the wire not counted."""
        return len(self.queue)

    def __repr__(self) -> str:
        where = "detached" if self.detached else "online" if self._online else "offline"
        return f"<MediumPort {self.name} on {self.medium.name}: {where}, {self.state.value}, TEC {self.tec}, REC {self.rec}>"
