"""A CAN segment in virtual time."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Final

from fieldbus.can.error_handling import BusErrorListener
from fieldbus.can.frame import CanFrame, FrameReceiver
from fieldbus.can.frame_log import FrameLog, LogEntry
from fieldbus.can.hooks import FrameHook, FrameHooks
from fieldbus.can.port import MediumPort, ignore_frame
from fieldbus.can.registry import register_segment
from fieldbus.can.section import BusSection
from fieldbus.clock import S, Scheduler
from fieldbus.errors import BusError, ConfigurationError
from fieldbus.history import History

_INJECTOR_BUFFERS: Final = 1 << 20
_FASTEST: Final = 8_000_000


class CanMedium:
    """A CAN segment in virtual time: frame times to the bit, arbitration, acknowledge, error confinement.

    A frame occupies the bus for its exact length with stuff bits; the other nodes receive it at the end of
    its EOF, and the next one starts after the intermission at the earliest. A frame that no other online node
    acknowledges, that a hook corrupts or that collides with one of equal identifier ends in an error frame
    and is retransmitted until it succeeds or its sender is bus-off. Every disturbance of the bus is followed
    bit by bit, with the error flags and counters of every node, as ISO 11898-1 has it.

    With `data_bitrate` the segment carries CAN FD too: nodes that were attached with `fd` send and receive
    such frames, all others acknowledge and ignore them, unless their controller is `set_classic_only`.

    Not modelled: positions within a bit (propagation, resynchronisation), and ESI, which is what the sender
    gives.

    Args:
        scheduler: Clock of the segment; its only thread.
        bitrate: 1000..1000000 bit/s.
        data_bitrate: Bit rate of the data phase of CAN FD, bit/s, from `bitrate` to 8000000; None: a
            classical segment, which has no CAN FD frames.
        name: Name in logs and events; also registered for `can.Bus(interface="hil", channel=name)`.
        history: Where `can.status`, `can.bus_error`, `can.overrun` events go; good frames are only in `log`.
        keep_log: Whether `log` is written.

    Raises:
        ConfigurationError: A bit rate is out of range.

    """

    hook_kinds: Final = frozenset({"drop", "delay", "corrupt", "replace", "duplicate"})
    """What hooks can do here."""

    def __init__(
        self,
        scheduler: Scheduler,
        *,
        bitrate: int = 1_000_000,
        data_bitrate: int | None = None,
        name: str = "can0",
        history: History | None = None,
        keep_log: bool = True,
    ) -> None:
        if not isinstance(bitrate, int) or not 1_000 <= bitrate <= 1_000_000:
            raise ConfigurationError("bitrate", bitrate, "a whole number from 1000 to 1000000 bit/s")
        if data_bitrate is not None and (
            not isinstance(data_bitrate, int) or not bitrate <= data_bitrate <= _FASTEST
        ):
            raise ConfigurationError(
                "data_bitrate", data_bitrate, f"a whole number from {bitrate} (bitrate) to {_FASTEST} bit/s"
            )
        self.scheduler = scheduler
        self.name = name
        self.bitrate: Final = bitrate
        self.data_bitrate: Final = data_bitrate
        self._frames = FrameLog(bitrate, enabled=keep_log)
        self.log: Final[list[LogEntry]] = self._frames.entries
        """Every frame on the wire in order; grows, is never replaced."""
        self.bus_error_listeners: Final[list[BusErrorListener]] = []
        """Called whenever the event `can.bus_error` is written."""
        self._near = BusSection(
            scheduler,
            bitrate=bitrate,
            data_bitrate=data_bitrate,
            name=name,
            history=history,
            log=self._frames,
            listeners=self.bus_error_listeners,
        )
        self._far: list[BusSection] = []  # behind cable breaks
        self._hooks = FrameHooks(self._hooks_changed)
        self._injectors: dict[str, MediumPort] = {}
        self._created_ns = scheduler.now
        register_segment(self)

    def __repr__(self) -> str:
        return f"<CanMedium {self.name}, {self.bitrate} bit/s, {len(self._near.nodes)} nodes>"

    # -- nodes

    def attach(
        self,
        name: str,
        receive: FrameReceiver,
        *,
        listen_only: bool = False,
        tx_buffers: int = 256,
        auto_recovery: bool = True,
        confirm: FrameReceiver | None = None,
        one_shot: bool = False,
        fd: bool = False,
    ) -> MediumPort:
        """Connect a node; a frame that is on the wire at this moment passes it by.

        Args:
            name: Its name in logs; no two nodes of a segment may share one.
            receive: Called with every good frame of the others and the time of its end (ns).
            listen_only: Only listens: gives no acknowledge, sends no error flags, must not send.
            tx_buffers: Frames that can wait for the bus (>= 1).
            auto_recovery: Leave bus-off without being asked (CANP-055).
            confirm: Called with every own frame that was sent successfully.
            one_shot: Do not repeat a frame that loses the arbitration or ends in
                an error (event `can.given_up`).
            fd: Whether the node takes and sends frames of CAN FD. The others acknowledge them as a
                controller does, and know nothing of them.

        Raises:
            BusError: The name is taken.
            ConfigurationError: There is no transmit buffer, or CAN FD on a classical segment.

        """
        if any(port.name == name for port in self.ports):
            raise BusError(f"a port named {name!r} is already attached to {self.name}")
        if tx_buffers < 1:
            raise ConfigurationError("tx_buffers", tx_buffers, "at least 1")
        if fd and self.data_bitrate is None:
            raise ConfigurationError("fd", fd, f"a segment with data_bitrate; {self.name} has none")
        port = MediumPort(
            self._near,
            name,
            receive,
            listen_only=listen_only,
            tx_buffers=tx_buffers,
            auto_recovery=auto_recovery,
            confirm=confirm,
            one_shot=one_shot,
            takes_fd=fd,
        )
        self._near.attach(port)
        return port

    @property
    def ports(self) -> tuple[MediumPort, ...]:
        """The attached nodes in the order in which they came, those behind a break at the end."""
        return (*self._near.nodes, *(port for section in self._far for port in section.nodes))

    def port(self, name: str) -> MediumPort:
        """Return the node `name`.

        Raises:
            BusError: There is none; the message lists the names.

        """
        for port in self.ports:
            if port.name == name:
                return port
        known = ", ".join(port.name for port in self.ports) or "none"
        raise BusError(f"no node {name!r} on {self.name}; nodes: {known}")

    # -- faults

    def add_hook(self, hook: FrameHook) -> Callable[[], None]:
        """Call `hook` with every frame of the nodes that is about to go on the wire, first attempt only.

        It is called at the start of the frame, when arbitration is won, and sees neither injected frames nor
        copies nor frames that a hook has delayed. Hooks are called in the order in which they were added.

        Returns:
            The function that removes the hook; harmless to repeat.

        """
        return self._hooks.add(hook)

    def _hooks_changed(self) -> None:
        for section in (self._near, *self._far):
            section.set_hooks(self._hooks.active)

    def flip_bit(self, nodes: Iterable[str] | None = None) -> None:
        """Have the bit that is on the wire now read inverted.

        On an idle bus that is one dominant bit.

        Args:
            nodes: Names of the nodes that read it wrongly; default all.

        """
        self._near.bits.flip(None if nodes is None else frozenset(nodes))
        self._near.follow_bits()

    def hold_level(self, level: int | None) -> None:
        """Hold the bus at `level` (0 dominant, 1 recessive) whatever the nodes send; None releases it.

        Raises:
            BusError: Another level.

        """
        if level not in (None, 0, 1):
            raise BusError(f"level {level} of the bus is neither 0 (dominant) nor 1 (recessive)")
        self._near.bits.hold(level)
        self._near.follow_bits()

    def cut(self, names: Iterable[str]) -> Callable[[], None]:
        """Break the cable: the nodes `names` continue among themselves, and so do the others (CANP-078).

        Frames of both sides are in the one log. Injected frames reach the near side only.

        Returns:
            The function that repairs the cable; harmless to repeat. What is on the wire on the two sides then
            collides.

        Raises:
            BusError: No such node, or it is behind another break.

        """
        ports = [self.port(name) for name in dict.fromkeys(names)]
        for port in ports:
            if port not in self._near.nodes:
                raise BusError(f"{port.name} is cut off from {self.name} already")
        far = self._near.split_off(ports)
        self._far.append(far)

        def repair() -> None:
            if far in self._far:
                self._far.remove(far)
                self._near.rejoin(far)

        return repair

    def inject(self, frame: CanFrame, sender: str = "fault") -> None:
        """Send `frame` from outside of the nodes, by normal arbitration and past the hooks.

        The injecting device neither receives nor acknowledges. It appears in the log as `sender`, which may
        be the name of a node.

        Raises:
            BusError: The frame is none that the segment carries.

        """
        port = self._injectors.get(sender)
        if port is None:
            port = self._injectors[sender] = MediumPort(
                self._near,
                sender,
                ignore_frame,
                listen_only=False,
                tx_buffers=_INJECTOR_BUFFERS,
                auto_recovery=True,
                confirm=None,
                takes_fd=True,
            )
            self._near.add_port(port)
        self._near.inject(port, frame)

    def injected(self, sender: str) -> int:
        """Return how many injected frames of `sender` wait for the bus."""
        port = self._injectors.get(sender)
        return port.pending if port is not None else 0

    def withdraw(self, sender: str) -> None:
        """Remove the injected frames of `sender` that wait for the bus."""
        port = self._injectors.get(sender)
        if port is not None:
            port.flush()

    # -- load

    @property
    def busy_bits(self) -> int:
        """Bit times for which the bus was occupied since the segment exists,
        counted when a frame has ended.
        """
        return self._near.busy_bits

    def drop_log(self, count: int) -> None:
        """Remove the oldest entries of `log`, which somebody else keeps or nobody needs."""
        self._frames.drop(count)

    def bus_load(self, window_ns: int | None = None) -> float:
        """Return which part of the time the bus was occupied, 0..1; a frame in
        progress does not count (CANP-069).

        Args:
            window_ns: Length of time up to now (> 0); default: since the segment exists.

        Raises:
            BusError: A window is asked for and the log is not kept, or not in memory for so long.

        """
        now = self.scheduler.now
        since = self._created_ns
        if window_ns is None:
            return self.busy_bits * S / self.bitrate / (now - since) if now > since else 0.0
        if window_ns <= 0:
            raise BusError(f"window {window_ns} ns is not positive")
        if not self._frames.enabled:
            raise BusError(f"the bus load of a window needs the log, which {self.name} does not keep")
        since = max(since, now - window_ns)
        if not self._frames.reaches(since):
            raise BusError(f"the log of {self.name} in memory is shorter than a window of {window_ns} ns")
        return self._frames.busy_ns(since, now) / (now - since) if now > since else 0.0
