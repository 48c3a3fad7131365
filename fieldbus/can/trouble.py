"""What the virtual segment does when not every node is healthy: error frames, counters, bus-off and recovery.

Everything here is off the cyclic path: it runs while a counter is not zero, a node is missing its partner, or a frame
has several senders or is to be corrupted.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from heapq import heappop
from typing import Final

from fieldbus.can.arbitration import Arbitration
from fieldbus.can.confinement import (
    BUS_OFF_LIMIT,
    DELIMITER_BITS,
    FLAG_BITS,
    REC_LIMIT,
    RECOVERY_SEQUENCE_BITS,
    RECOVERY_SEQUENCES,
    SUSPEND_BITS,
    ErrorCode,
    NodeState,
    first_difference,
    flag_bits_after,
    rec_after_reception,
    state_of,
)
from fieldbus.can.frame import CanFrame
from fieldbus.can.port import Entry, MediumPort, deaf
from fieldbus.can.timing import INTERMISSION_BITS, wire_bits
from fieldbus.clock import S, Scheduler
from fieldbus.history import History

BusErrorListener = Callable[[int, str, ErrorCode, CanFrame], object]
"""Called with time (ns), name of the transmitter, what went wrong, and the frame."""

StateChange = tuple[MediumPort, NodeState, NodeState]
"""A port, its old and its new state."""

_Transmission = tuple[MediumPort, Entry]

_ACK_TO_EOF_BITS: Final = 8  # ACK delimiter and EOF
_OVERRUN_EVENT_NS: Final = S  # at most one event per node in this time


class ErrorHandling(Arbitration):
    """Base of `CanMedium`; see there."""

    def __init__(
        self, scheduler: Scheduler, *, bitrate: int, name: str, history: History | None, keep_log: bool
    ) -> None:
        super().__init__(scheduler, bitrate=bitrate, name=name, keep_log=keep_log)
        self.bus_error_listeners: list[BusErrorListener] = []
        """Called whenever the event `can.bus_error` is written."""
        self._history = history
        self._nodes: list[MediumPort] = []
        self._error_bits: dict[int, int] = {}  # bits of the attempts that failed, by index in the log
        self._quiet_since_ns = scheduler.now  # start of the last ACK or error delimiter
        self._overrun_told_ns: dict[str, int] = {}
        # The frame on the wire, when it is not just a good one of one sender.
        self._special = False
        self._partners: list[_Transmission] = []  # send along with the sender
        self._losers: list[_Transmission] = []  # error-passive, dropped out with a bit error of their own
        self._failure: ErrorCode | None = None
        self._failure_bits = 0
        self._forced = False  # a hook wants the error

    # --------------------------------------------------------------------------------------------- nodes

    def _empty(self, port: MediumPort) -> None:
        self._backlog -= len(port.queue)
        port.queue.clear()
        port.dead_sequence = self._sequence

    def _on_the_wire(self) -> bool:
        return self._entry is not None and self.scheduler.now > self._open_until_ns

    def _rebuild(self) -> None:
        """Work out anew who hears whom."""
        for port in self._nodes:
            port.listening = port.online and port.state is not NodeState.BUS_OFF and not port.joining
            port.receive = port.handler if port.listening else deaf
        ears = [port for port in self._nodes if port.listening]
        for port in self._ports:
            others: list[MediumPort] = [other for other in ears if other is not port]
            port.acknowledged = any(not other.listen_only for other in others)
            port.receivers = (*others, port.confirmation) if port.confirmation is not None else tuple(others)
        self._assess()

    def _assess(self) -> None:
        """Find out whether the short way is open."""
        self._troubled = self._special or any(
            port.tec
            or port.rec
            or port.joining
            or port.state is not NodeState.ERROR_ACTIVE
            or (port.can_send and not port.acknowledged)
            for port in self._ports
        )
        self._plain = not (self._troubled or self._hooks or self._deciding)

    # --------------------------------------------------------------------------------------------- the frame

    def _transmitters(self) -> list[_Transmission]:
        if self._entry is None or self._sender is None:
            return []
        return [(self._sender, self._entry), *self._partners, *self._losers]

    def _forget_trouble(self) -> None:
        if self._special:
            self._special = self._forced = False
            self._partners = []
            self._losers = []
            self._failure = None
            self._assess()

    def _transmit_with_trouble(self, others: Sequence[MediumPort]) -> None:
        for port in others:
            self._partners.append((port, heappop(port.queue)))
            self._backlog -= 1
        self._special = self._troubled = True
        self._plain = False
        if not self._collide() and any(entry[5] > 0 for _, entry in self._transmitters()):
            self._corrupt()
        assert self._entry is not None
        if self._failure is None:
            self._end_ns = self._start_ns + self._durations[self._entry[4] - INTERMISSION_BITS]
            self._timer = self._at(self._end_ns, self._on_end)
        else:
            self._end_ns = self._start_ns + self._durations[self._failure_bits]
            self._timer = self._at(self._end_ns, self._end_of_error_frame)

    def _collide(self) -> bool:
        """Find out what becomes of senders with the same arbitration field; returns whether the frame fails.

        Who sends recessive and reads dominant has a bit error (CANP-029). Error-active, it destroys the frame for all;
        error-passive, its flag goes unnoticed and the others go on (CANP-039).
        """
        sending = [(wire_bits(entry[3]), port, entry) for port, entry in self._transmitters()]
        while (position := first_difference([wire for wire, _, _ in sending])) is not None:
            losing = [item for item in sending if item[0][position]]
            if any(port.state is NodeState.ERROR_ACTIVE for _, port, _ in losing):
                flags = FLAG_BITS
                if len(self._audience()) > 0:
                    flags = flag_bits_after([*sending[0][0][:position], 0], flag_level=0)
                for wire, _, _ in sending:
                    if not wire[
                        position
                    ]:  # notices with the next recessive bit that it sends, a stuff bit at the latest
                        flags = max(flags, wire.index(1, position) - position + FLAG_BITS)
                self._failure = ErrorCode.BIT
                self._failure_bits = position + 1 + flags + DELIMITER_BITS
                return True
            self._losers += [(port, entry) for _, port, entry in losing]
            sending = [item for item in sending if not item[0][position]]
            (_, self._sender, self._entry), *rest = sending
            self._partners = [(port, entry) for _, port, entry in rest]
        return False

    def _corrupt(self) -> None:
        """Let the last bit of the stuffed region, which no receiver can take for data, arrive inverted."""
        assert self._entry is not None
        assert self._sender is not None
        wire = wire_bits(self._entry[3])
        wire[-1] ^= 1
        passive = self._sender.state is NodeState.ERROR_PASSIVE
        self._failure = ErrorCode.BIT
        self._failure_bits = len(wire) + flag_bits_after(wire, flag_level=int(passive)) + DELIMITER_BITS
        self._forced = True

    def _audience(self) -> list[MediumPort]:
        """Return the nodes that receive the present frame."""
        sending = [port for port, _ in self._transmitters()]
        return [port for port in self._nodes if port.listening and port not in sending]

    # --------------------------------------------------------------------------------------------- the end

    def _end_of_frame_in_trouble(self) -> None:
        entry, sender = self._entry, self._sender
        assert entry is not None
        assert sender is not None
        audience = self._audience()
        if all(port.listen_only for port in audience):
            # Nobody answered in the ACK slot: an error flag has taken the place of ACK delimiter and EOF.
            self._special = True
            self._failure = ErrorCode.ACK
            self._failure_bits = entry[4] - INTERMISSION_BITS - _ACK_TO_EOF_BITS + FLAG_BITS + DELIMITER_BITS
            self._end_ns = self._start_ns + self._durations[self._failure_bits]
            self._timer = self._at(self._end_ns, self._end_of_error_frame)
            return
        end = self._end_ns
        self._account_recovery(end - self._durations[_ACK_TO_EOF_BITS])
        senders = [port for port, own in [(sender, entry), *self._partners] if own[1] > port.dead_sequence]
        changes: list[StateChange] = []
        for port in senders:
            if port.tec:
                port.tec -= 1
                self._update_state(port, changes)
        for port in audience:
            if port.rec and not port.listen_only:
                port.rec = rec_after_reception(port.rec)
                self._update_state(port, changes)
        self._busy_bits += entry[4]
        self._write(end, sender, entry[3], "")
        self._punish(self._losers, ErrorCode.BIT, changes)
        self._suspend(senders, end)
        self._release(end)
        for port in audience:
            port.receive(entry[3], end)
        for port in senders:
            if port.confirmation is not None:
                port.confirmation.receive(entry[3], end)
        self._tell(changes)

    def _end_of_error_frame(self) -> None:
        entry, sender, code = self._entry, self._sender, self._failure
        assert entry is not None
        assert sender is not None
        assert code is not None
        end = self._end_ns
        self._account_recovery(end - self._durations[DELIMITER_BITS])
        bits = self._failure_bits + INTERMISSION_BITS
        self._busy_bits += bits
        if self._keep_log:
            self._error_bits[len(self.log)] = bits
        self._write(end, sender, entry[3], code.value)
        changes: list[StateChange] = []
        for port in self._audience():  # after a missing acknowledge only those that count nothing
            if not port.listen_only:
                port.rec = min(port.rec + 1, REC_LIMIT)
                self._update_state(port, changes)
        transmitters = self._transmitters()
        self._punish(transmitters, code, changes)
        self._suspend([port for port, _ in transmitters], end)
        self._release(end)
        self._tell(changes)

    def _punish(self, transmitters: list[_Transmission], code: ErrorCode, changes: list[StateChange]) -> None:
        """Count a failed transmission and queue the frames again."""
        alive = [(port, entry) for port, entry in transmitters if entry[1] > port.dead_sequence]
        # An error-passive node that only misses the acknowledge is not counted up, or a lone node would end in bus-off.
        excused = code is ErrorCode.ACK and all(port.state is NodeState.ERROR_PASSIVE for port, _ in alive)
        for port, entry in alive:
            corruptions = entry[5] - 1 if self._forced else entry[5]
            self._queue(port, (*entry[:5], max(corruptions, 0)))
            if excused:
                continue
            port.tec = min(port.tec + 8, BUS_OFF_LIMIT)
            if self._history is not None:
                self._history.emit(
                    self.name,
                    "can.bus_error",
                    port=port.name,
                    code=code.value,
                    can_id=entry[3].can_id,
                    tec=port.tec,
                )
            for listener in self.bus_error_listeners:
                listener(self._end_ns, port.name, code, entry[3])
            self._update_state(port, changes)

    def _suspend(self, transmitters: list[MediumPort], end_ns: int) -> None:
        until = end_ns + self._durations[INTERMISSION_BITS + SUSPEND_BITS]
        for port in transmitters:
            if port.state is NodeState.ERROR_PASSIVE:
                port.not_before_ns = until

    def _release(self, end_ns: int) -> None:
        """Leave the frame behind and let the next one come."""
        self._free_ns = free = end_ns + self._intermission_ns
        self._entry = None
        self._special = True  # so that the state of the segment is looked at again
        self._forget_trouble()
        if any(port.joining for port in self._nodes):
            for port in self._nodes:
                port.joining = False
            self._rebuild()
        if self._backlog:
            self._arbitrate(free)

    def _write(self, end_ns: int, sender: MediumPort, frame: CanFrame, error: str) -> None:
        if self._keep_log:
            self.log.append((end_ns, sender.name, frame, error))

    def _overrun(self, port: MediumPort) -> None:
        port.overruns += 1
        now = self.scheduler.now
        told = self._overrun_told_ns.get(port.name)
        if self._history is not None and (told is None or now - told >= _OVERRUN_EVENT_NS):
            self._overrun_told_ns[port.name] = now
            self._history.emit(self.name, "can.overrun", port=port.name, count=port.overruns)

    # --------------------------------------------------------------------------------------------- states

    def _update_state(self, port: MediumPort, changes: list[StateChange]) -> None:
        if port.state is not NodeState.BUS_OFF:  # which only recovery ends
            self._change_state(port, state_of(port.tec, port.rec), changes)

    def _change_state(self, port: MediumPort, state: NodeState, changes: list[StateChange]) -> None:
        old = port.state
        if state is old:
            return
        port.state = state
        changes.append((port, old, state))
        if state is NodeState.BUS_OFF:
            port.can_send = False
            self._empty(port)
            self._rebuild()
            if port.auto_recovery:
                self.begin_recovery(port)

    def _tell(self, changes: list[StateChange]) -> None:
        for port, old, new in changes:
            if self._history is not None:
                self._history.emit(
                    self.name, "can.status", port=port.name, status=new.value, tec=port.tec, rec=port.rec
                )
            for listener in tuple(port.on_state):
                listener(old, new)

    # --------------------------------------------------------------------------------------------- recovery

    def begin_recovery(self, port: MediumPort) -> None:
        """See `MediumPort.recover`."""
        if port.state is NodeState.BUS_OFF and port.online and port.recovery_timer is None:
            port.recovery_count = 0
            port.recovery_from_ns = self.scheduler.now
            self._await_recovery(port)

    def _await_recovery(self, port: MediumPort) -> None:
        """Enter the time at which the bus, staying recessive, completes the sequences that are still missing."""
        missing = (RECOVERY_SEQUENCES - port.recovery_count) * RECOVERY_SEQUENCE_BITS
        due = max(self._quiet_since_ns, port.recovery_from_ns) + missing * S // self.bitrate
        self._stop_recovery(port)
        port.recovery_timer = self._at(max(due, self.scheduler.now), lambda: self._recover(port))

    def _stop_recovery(self, port: MediumPort) -> None:
        if port.recovery_timer is not None:
            port.recovery_timer.cancel()
            port.recovery_timer = None

    def _account_recovery(self, quiet_ns: int) -> None:
        """Count the recessive sequences before the frame that ends now; `quiet_ns`: the next ones start there."""
        waiting = [port for port in self._ports if port.recovery_timer is not None]
        for port in waiting:
            recessive = self._start_ns - max(self._quiet_since_ns, port.recovery_from_ns)
            if recessive > 0:
                port.recovery_count += recessive // self._durations[RECOVERY_SEQUENCE_BITS]
        self._quiet_since_ns = quiet_ns
        for port in waiting:
            self._await_recovery(port)

    def _recover(self, port: MediumPort) -> None:
        if self._on_the_wire() and self._start_ns < self.scheduler.now:
            return  # the end of this frame enters a new time
        changes: list[StateChange] = []
        port.tec = port.rec = 0
        self._leave_bus_off(port, changes)
        self._tell(changes)

    def _leave_bus_off(self, port: MediumPort, changes: list[StateChange]) -> None:
        self._stop_recovery(port)
        self._change_state(port, NodeState.ERROR_ACTIVE, changes)
        port.can_send = port.online and not port.listen_only
        port.joining = self._on_the_wire()
        self._rebuild()
