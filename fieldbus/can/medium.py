"""A CAN segment in virtual time."""

from __future__ import annotations

from typing import Final

from fieldbus.can.confinement import BUS_OFF_LIMIT, NodeState
from fieldbus.can.frame import CanFrame, FrameReceiver
from fieldbus.can.partition import DivisibleSegment
from fieldbus.can.port import MediumPort, deaf
from fieldbus.can.registry import register_segment
from fieldbus.can.timing import frame_bits, timing_of
from fieldbus.can.trouble import StateChange
from fieldbus.clock import S, Scheduler
from fieldbus.errors import BusError, ConfigurationError
from fieldbus.history import History

_INJECTOR_BUFFERS: Final = 1 << 20


class CanMedium(DivisibleSegment):
    """A CAN segment in virtual time: frame times to the bit, arbitration, acknowledge, error confinement.

    A frame occupies the bus for its exact length with stuff bits; the other nodes receive it at the end of
    its EOF, and the next one starts after the intermission at the earliest. A frame that no other online node
    acknowledges, that a hook corrupts or that collides with one of equal identifier ends in an error frame
    and is retransmitted until it succeeds or its sender is bus-off. Whatever disturbs the bus is followed bit
    by bit, with the error flags and counters of every node, as ISO 11898-1 has it.

    Not modelled: CAN FD, and positions within a bit (propagation, resynchronisation).

    Args:
        scheduler: Clock of the segment; its only thread.
        bitrate: 1000..1000000 bit/s.
        name: Name in logs and events; also registered for `can.Bus(interface="hil", channel=name)`.
        history: Where `can.status`, `can.bus_error`, `can.overrun` events go; good frames are only in `log`.
        keep_log: Whether `log` is written.
        registered: Whether it is registered under its name.

    """

    hook_kinds: Final = frozenset({"drop", "delay", "corrupt", "replace", "duplicate"})
    """What hooks can do here."""

    def __init__(
        self,
        scheduler: Scheduler,
        *,
        bitrate: int = 1_000_000,
        name: str = "can0",
        history: History | None = None,
        keep_log: bool = True,
        registered: bool = True,
    ) -> None:
        super().__init__(scheduler, bitrate=bitrate, name=name, history=history, keep_log=keep_log)
        self._created_ns = scheduler.now
        self._injectors: dict[str, MediumPort] = {}
        if registered:
            register_segment(self)

    def __repr__(self) -> str:
        return f"<CanMedium {self.name}, {self.bitrate} bit/s, {len(self._nodes)} nodes>"

    # --------------------------------------------------------------------------------------------- nodes

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
    ) -> MediumPort:
        """Connect a node; a frame that is on the wire at this moment passes it by.

        Args:
            name: Its name in logs; no two nodes of a segment may share one.
            receive: Called with every good frame of the others and the time of its end (ns).
            listen_only: Only listens: gives no acknowledge, sends no error flags, must not send.
            tx_buffers: Frames that can wait for the bus (>= 1).
            auto_recovery: Leave bus-off without being asked (CANP-055).
            confirm: Called with every own frame that was sent successfully.
            one_shot: Give a frame up that loses the arbitration or ends in an error (event `can.given_up`).

        Raises:
            BusError: The name is taken.

        """
        if any(port.name == name for port in self.ports):
            raise BusError(f"a port named {name!r} is already attached to {self.name}")
        if tx_buffers < 1:
            raise ConfigurationError("tx_buffers", tx_buffers, "at least 1")
        port = MediumPort(
            self,
            name,
            receive,
            listen_only=listen_only,
            tx_buffers=tx_buffers,
            auto_recovery=auto_recovery,
            confirm=confirm,
            one_shot=one_shot,
        )
        port.joining = self._on_the_wire()
        self._nodes.append(port)
        self._ports.append(port)
        self._add_controller(port)
        self.ports_changed()
        return port

    def detach(self, port: MediumPort) -> None:
        """See `MediumPort.detach`."""
        if port.detached:
            return
        port.online = False
        port.detached = True
        self._nodes.remove(port)
        self._ports.remove(port)
        self.ports_changed()

    def presence_changed(self, port: MediumPort) -> None:
        """Follow a change of `port.online`."""
        if port.online:
            port.tec = port.rec = 0
            changes: list[StateChange] = []
            self._change_state(port, NodeState.ERROR_ACTIVE, changes)
            port.can_send = not port.listen_only
            port.joining = self._on_the_wire()
            self._add_controller(port)
            self._rebuild()
            self._tell(changes)
        else:
            port.can_send = port.joining = False
            self._stop_recovery(port)
            self._empty(port)
            self._break_off(port)
            self._rebuild()

    def set_error_counters(self, port: MediumPort, tec: int, rec: int) -> None:
        """See `MediumPort.set_error_counters`."""
        changes: list[StateChange] = []
        port.tec, port.rec = tec, rec
        if port.state is NodeState.BUS_OFF and tec < BUS_OFF_LIMIT:
            self._leave_bus_off(port, changes)
        self._update_state(port, changes)
        if self._bitwise:
            self._switch_off(port)
        elif port.state is NodeState.BUS_OFF and self._entry is not None:
            self._break_off(port)
        self._assess()
        self._tell(changes)

    def flush(self, port: MediumPort) -> None:
        """See `MediumPort.flush`."""
        self._empty(port)
        if self._entry is not None and self.scheduler.now <= self._open_until_ns:
            self._rearbitrate()

    def _break_off(self, port: MediumPort) -> None:
        """Take `port` from the bus, in the middle of its frame if need be."""
        if not self._bitwise and self._entry is not None:
            if not self._on_the_wire():
                self._rearbitrate()
            elif port is self._sender:
                self._follow_bitwise()
        if port.online:
            self._switch_off(port)
        else:
            self._drop_controller(port)

    # --------------------------------------------------------------------------------------------- faults

    def inject(self, frame: CanFrame, sender: str = "fault") -> None:
        """Send `frame` from outside of the nodes, by normal arbitration and past the hooks.

        The injecting device neither receives nor acknowledges. It appears in the log as `sender`, which may
        be the name of a node.

        Raises:
            BusError: The frame is no classical CAN frame.

        """
        port = self._injectors.get(sender)
        if port is None:
            port = MediumPort(
                self,
                sender,
                deaf,
                listen_only=False,
                tx_buffers=_INJECTOR_BUFFERS,
                auto_recovery=True,
                confirm=None,
            )
            self._injectors[sender] = port
            self._ports.append(port)
            self._rebuild()
        if not port.can_send:
            return
        key, bits = timing_of(frame.can_id, bytes(frame.data), frame.extended, frame.remote, frame.dlc)
        self._sequence += 1
        self._offer(port, (key, self._sequence, 0, frame, bits, ()))

    def injected(self, sender: str) -> int:
        """Return how many injected frames of `sender` wait for the bus."""
        port = self._injectors.get(sender)
        return len(port.queue) if port is not None else 0

    def withdraw(self, sender: str) -> None:
        """Forget the injected frames of `sender` that wait for the bus."""
        port = self._injectors.get(sender)
        if port is not None:
            self.flush(port)

    def _far_side(self) -> CanMedium:
        far = CanMedium(
            self.scheduler,
            bitrate=self.bitrate,
            name=self.name,
            history=self._history,
            keep_log=self._keep_log,
            registered=False,
        )
        far.log = self.log
        far._spans = self._spans
        far._hook_entries = self._hook_entries
        far._hooks_changed()
        far.bus_error_listeners = self.bus_error_listeners
        return far

    # --------------------------------------------------------------------------------------------- load

    @property
    def busy_bits(self) -> int:
        """Bit times for which the bus was occupied since the segment exists, counted when a frame has
        ended.
        """
        return self._busy_bits

    def bus_load(self, window_ns: int | None = None) -> float:
        """Return which part of the time the bus was occupied, 0..1; a frame in progress does not count
        (CANP-069).

        Args:
            window_ns: Length of time up to now (> 0); default: since the segment exists.

        Raises:
            BusError: A window is asked for and the log is not kept.

        """
        now = self.scheduler.now
        since = self._created_ns
        if window_ns is None:
            return self._busy_bits * S / self.bitrate / (now - since) if now > since else 0.0
        if window_ns <= 0:
            raise BusError(f"window {window_ns} ns is not positive")
        if not self._keep_log:
            raise BusError(f"the bus load of a window needs the log, which {self.name} does not keep")
        since = max(since, now - window_ns)
        busy = 0
        for index in range(len(self.log) - 1, -1, -1):
            end, _, frame, _ = self.log[index]
            span = self._spans.get(index)
            if span is None:
                free = end + self._intermission_ns
                span = free - self._durations[frame_bits(frame)], free
            start, free = span
            if free <= since:
                break
            busy += min(free, now) - max(start, since)
        return busy / (now - since) if now > since else 0.0
