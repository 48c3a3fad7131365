"""A node's connection to the virtual segment."""

from __future__ import annotations

from collections.abc import Callable, Container, Iterable, Mapping
from typing import Final, Protocol

from fieldbus.can.bitstream import BitError
from fieldbus.can.confinement import WARNING_LIMIT, NodeState
from fieldbus.can.frame import CanFrame, FrameReceiver
from fieldbus.clock import Scheduler, Timer
from fieldbus.errors import BusError

Entry = tuple[int, int, int, CanFrame, int, tuple[BitError, ...] | None]
"""A frame waiting for the bus: arbitration key, sequence number, number of the copy, frame,
bits, the bit errors of its next attempts (`NOT_ASKED` before the hooks have seen it). The first
three give the order of the queue.
"""

NOT_ASKED: Final = None

StateListener = Callable[[NodeState, NodeState], object]


def ignore_frame(frame: CanFrame, time_ns: int) -> None:
    """Receive nothing: the receiver of a node that does not listen."""


class Confirmation:
    """Stands among the receivers of a port's own frames and confirms that a frame has been sent."""

    __slots__ = ("receive",)

    mailboxes: Final = None
    apart: Final = ()

    def __init__(self, confirm: FrameReceiver) -> None:
        self.receive = confirm


class PortSection(Protocol):
    """The part of the bus that a port is connected to, as the port uses it."""

    @property
    def name(self) -> str:
        """Name of the segment."""

    @property
    def bitrate(self) -> int:
        """Bit rate, bit/s."""

    @property
    def scheduler(self) -> Scheduler:
        """Time of the segment."""

    def submit(self, port: MediumPort, frames: Iterable[CanFrame]) -> None:
        """Queue frames of `port`."""

    def withdraw(self, port: MediumPort, identifiers: Container[tuple[int, bool]]) -> None:
        """See `MediumPort.withdraw`."""

    def flush(self, port: MediumPort) -> None:
        """Remove the queued frames of `port`."""

    def recover(self, port: MediumPort) -> None:
        """Begin the recovery of `port` from bus-off."""

    def set_error_counters(self, port: MediumPort, tec: int, rec: int) -> None:
        """Set the error counters of `port`, and its state accordingly."""

    def detach(self, port: MediumPort) -> None:
        """Remove `port` for good."""

    def presence_changed(self, port: MediumPort) -> None:
        """Follow a change of `port.online`."""

    def ports_changed(self) -> None:
        """Follow a change of what a port does."""

    def routes_changed(self) -> None:
        """Follow a change of the acceptance filter of a port."""


class MediumPort:
    """A port of a `CanMedium`; made by `CanMedium.attach`.

    A frame that cannot be queued is lost without an exception, as in a CAN controller: because the
    port is offline or bus-off, or because its transmit queue is full (`overruns`, event
    `can.overrun`). Going offline, or into bus-off, empties the queue. Coming online resets the
    controller: its counters start at zero.
    """

    __slots__ = (
        "_delayed", "_last_due_ns", "_online", "_receive_delay_ns", "acknowledged", "acknowledges", "alone",
        "apart", "auto_recovery", "can_send", "classic_only", "confirmation", "detached", "discarded",
        "handler", "joining", "listen_only", "listening", "mailboxes", "name", "not_before_ns", "on_overrun",
        "on_state", "one_shot", "overload_frames", "overruns", "queue", "rate", "rec", "receive", "receivers",
        "recovery_count", "recovery_from_ns", "recovery_timer", "routes", "section", "state",
        "takes_fd", "tec", "tx_buffers",
    )  # fmt: skip

    def __init__(
        self,
        section: PortSection,
        name: str,
        receive: FrameReceiver,
        *,
        listen_only: bool,
        tx_buffers: int,
        auto_recovery: bool,
        confirm: FrameReceiver | None,
        one_shot: bool = False,
        takes_fd: bool = False,
    ) -> None:
        self.name = name
        self.listen_only = listen_only
        """Receives without acknowledging and without error flags; must not send."""
        self.tx_buffers = tx_buffers
        self.auto_recovery = auto_recovery
        """Whether the node leaves bus-off by itself; otherwise after `recover`."""
        self.one_shot = one_shot
        """Whether a frame that loses the arbitration or ends in an error is not repeated (CANP-030)."""
        self.takes_fd = takes_fd
        """Whether frames of CAN FD reach the receiver, and may be sent."""
        self.on_state: list[StateListener] = []
        """Called with the old and the new state when the error state changes."""
        self.on_overrun: list[Callable[[], object]] = []
        """Called when frames were refused, at most once a second, as the event `can.overrun` is written."""
        self.tec = 0
        """Transmit error counter."""
        self.rec = 0
        """Receive error counter, up to 255."""
        self.state = NodeState.ERROR_ACTIVE
        self.overruns = 0
        """Frames refused because the transmit queue was full."""

        # Set by the methods below.
        self.acknowledges = True
        self.classic_only = False
        self.overload_frames = 0
        self.rate: int | None = None
        self._receive_delay_ns = 0
        self._delayed: FrameReceiver | None = None
        self._last_due_ns = 0
        self._online = True

        # Kept by the bus.
        self.section = section
        self.detached = False
        self.joining = False  # came online in the middle of a frame
        self.listening = False
        self.can_send = not listen_only
        self.handler = receive
        self.receive: FrameReceiver = ignore_frame
        self.confirmation = None if confirm is None else Confirmation(confirm)
        self.receivers: tuple[MediumPort | Confirmation, ...] = ()
        self.mailboxes: Mapping[int, FrameReceiver] | None = None
        self.apart: Container[int] = ()
        self.routes: dict[
            int, FrameReceiver
        ] = {}  # receiver of the frames of this port, by arbitration field
        self.acknowledged = False
        self.alone = False  # no node receives from this port, nor will when the present frame has ended
        self.queue: list[Entry] = []
        self.discarded = 0  # entries up to this sequence number must not return to the queue
        self.not_before_ns = 0  # suspend transmission
        self.recovery_count = 0
        self.recovery_from_ns = 0
        self.recovery_timer: Timer | None = None

    def send(self, frame: CanFrame) -> None:
        """Queue `frame`; it goes out as soon as it wins the bus, and again after every error.

        Raises:
            BusError: The port is detached or listens only, or the frame is no classical CAN frame.

        """
        self.section.submit(self, (frame,))

    def send_all(self, frames: Iterable[CanFrame]) -> None:
        """Queue several frames at once; see `send`."""
        self.section.submit(self, frames)

    def accept(self, mailboxes: Mapping[int, FrameReceiver], apart: Container[int] = ()) -> None:
        """Take good data frames with 11-bit identifiers by these tables only from now on (acceptance filter).

        Frames with other 11-bit identifiers are not delivered; frames with 29-bit identifiers, remote frames,
        and all frames while their reception is delayed go to the receiver of the port, which has to filter
        them itself. Call it again when the table has changed.

        Args:
            mailboxes: Receivers by identifier.
            apart: Identifiers whose receivers keep what comes and do nothing else (`Timer.apart`).

        """
        self.mailboxes = None if self._delayed else mailboxes
        self.apart = apart
        self.section.routes_changed()

    def detach(self) -> None:
        """Leave the segment for good; queued frames are lost. Harmless to repeat."""
        self.section.detach(self)

    def flush(self) -> None:
        """Remove the queued frames; one that is on the wire still completes."""
        self.section.flush(self)

    def withdraw(self, identifiers: Container[tuple[int, bool]]) -> None:
        """Remove queued frames by their identifiers: (identifier, whether it has 29 bits)."""
        self.section.withdraw(self, identifiers)

    def recover(self) -> None:
        """Ask for recovery from bus-off (CANP-055); harmless in any other state."""
        self.section.recover(self)

    def set_error_counters(self, *, tec: int | None = None, rec: int | None = None) -> None:
        """Set the error counters; the state follows (CANP-059).

        Args:
            tec: 0..256; 256 means bus-off.
            rec: 0..255.

        Raises:
            BusError: A counter is out of range.

        """
        if tec is not None and not 0 <= tec <= 256:
            raise BusError(f"transmit error counter {tec} is outside 0..256")
        if rec is not None and not 0 <= rec <= 255:
            raise BusError(f"receive error counter {rec} is outside 0..255")
        self.section.set_error_counters(
            self, self.tec if tec is None else tec, self.rec if rec is None else rec
        )

    # -- faults of the node

    def set_acknowledge(self, acknowledges: bool) -> None:
        """Set whether the node acknowledges the frames that it receives (CANP-059)."""
        self.acknowledges = acknowledges
        self.section.ports_changed()

    def set_classic_only(self, classic_only: bool) -> None:
        """Set whether the controller of the node knows no CAN FD.

        Such a frame is then a form error for it (CANP-076). On a classical segment that makes no difference.
        """
        self.classic_only = classic_only
        self.section.ports_changed()

    def set_overload_frames(self, count: int) -> None:
        """Request `count` (0..2) overload frames after every frame that the node has received (CANP-041).

        Raises:
            BusError: More than two.

        """
        if not 0 <= count <= 2:
            raise BusError(f"{count} overload frames in succession: 0 to 2 are allowed")
        self.overload_frames = count
        self.section.ports_changed()

    def set_bitrate(self, rate: int | None) -> None:
        """Run the node at `rate` bit/s (1000..1000000), None: at the bit rate of the segment (CANP-068).

        Raises:
            BusError: The rate is out of range.

        """
        if rate is not None and not 1_000 <= rate <= 1_000_000:
            raise BusError(f"bit rate {rate} bit/s is outside 1000..1000000 bit/s")
        self.rate = None if rate == self.section.bitrate else rate
        self.section.ports_changed()

    @property
    def receive_delay_ns(self) -> int:
        """Delay between the end of a frame and its delivery to the node, ns (>= 0); the order is kept."""
        return self._receive_delay_ns

    @receive_delay_ns.setter
    def receive_delay_ns(self, value: int) -> None:
        if value < 0:
            raise BusError(f"delay {value} ns of the reception is negative")
        self._receive_delay_ns = value
        if value and self._delayed is None:
            self._delayed = self.handler
            self.handler = self._receive_late
            self.mailboxes = None
        self.section.ports_changed()

    def _receive_late(self, frame: CanFrame, time_ns: int) -> None:
        scheduler = self.section.scheduler
        receive = self._delayed
        assert receive is not None
        due = max(time_ns + self._receive_delay_ns, self._last_due_ns)
        if due <= scheduler.now:
            receive(frame, time_ns)
            return
        self._last_due_ns = due

        def deliver() -> None:
            if self._online:
                receive(frame, due)

        scheduler.at(due, deliver)

    @property
    def online(self) -> bool:
        """Whether the node takes part; False: it neither sends, receives nor acknowledges."""
        return self._online

    @online.setter
    def online(self, value: bool) -> None:
        if value == self._online:
            return
        if self.detached:
            raise BusError(f"port {self.name} is detached from {self.section.name}")
        self._online = value
        self.section.presence_changed(self)

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
        return (
            f"<MediumPort {self.name} on {self.section.name}: {where}, {self.state.value}, "
            f"TEC {self.tec}, REC {self.rec}>"
        )
