"""What the virtual segment does when not every node is healthy: missing acknowledges, counters, bus-off and
recovery.

Everything here is off the cyclic path: it runs while a counter is not zero or a node is missing its partner.
Frames are still computed as a whole; what goes wrong inside of one is followed bit by bit in
`fieldbus.can.bitwise`.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable, Sequence
from typing import Final

from fieldbus.can.arbitration import COMMITTED, Arbitration
from fieldbus.can.confinement import (
    DELIMITER_BITS,
    FLAG_BITS,
    RECOVERY_SEQUENCE_BITS,
    RECOVERY_SEQUENCES,
    SUSPEND_BITS,
    ErrorCode,
    NodeState,
    rec_after_reception,
    state_of,
)
from fieldbus.can.frame import CanFrame
from fieldbus.can.port import NOT_ASKED, Entry, MediumPort, deaf
from fieldbus.can.timing import INTERMISSION_BITS
from fieldbus.clock import S, Scheduler
from fieldbus.history import History

BusErrorListener = Callable[[int, str, ErrorCode, CanFrame | None, str], object]
"""Called with time (ns), name of the node that found the error, what went wrong, the frame that it was
sending (None: it was
receiving) and the field of the frame."""

StateChange = tuple[MediumPort, NodeState, NodeState]
"""A port, its old and its new state."""

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
        self._spans: dict[
            int, tuple[int, int]
        ] = {}  # start and end (ns) on the bus by index in the log, if not plain
        self._quiet_since_ns = scheduler.now  # start of the last ACK or error delimiter
        self._overrun_told_ns: dict[str, int] = {}
        self._unacknowledged = False  # the attempt on the wire has found no acknowledge

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
        joining = any(port.joining for port in self._nodes)
        for port in self._ports:
            others: list[MediumPort] = [other for other in ears if other is not port]
            port.acknowledged = any(other.acknowledges and not other.listen_only for other in others)
            port.receivers = (*others, port.confirmation) if port.confirmation is not None else tuple(others)
            port.alone = not others and not joining
            port.routes = {}
        self._assess()

    def _assess(self) -> None:
        """Find out whether the short way is open."""
        self._troubled = self._unacknowledged or any(
            port.tec
            or port.rec
            or port.joining
            or port.state is not NodeState.ERROR_ACTIVE
            or (port.can_send and not port.acknowledged)
            for port in self._ports
        )
        self._delicate = any(
            port.online and (port.one_shot or port.overload_frames or port.rate is not None)
            for port in self._nodes
        )
        self._careful = bool(self._hooks) or self._delicate
        self._plain = not (
            self._troubled or self._careful or self._deciding or self._commit_timer is not None
        )

    def ports_changed(self) -> None:
        """Follow a change of what a port does."""
        self._rebuild()
        self._way_changed()

    def _is_special(self, contenders: Sequence[MediumPort]) -> bool:
        if len(contenders) > 1 or contenders[0].queue[0][5]:
            return True
        if not contenders[0].acknowledged and not all(port.listen_only for port in self._ears(contenders[0])):
            return True
        return self._delicate and any(
            port.online
            and (
                port.overload_frames
                or port.rate is not None
                or (port.one_shot and port is not contenders[0] and port.queue)
            )
            for port in self._nodes
        )

    def _ears(self, sender: MediumPort) -> list[MediumPort]:
        """Return the nodes that hear `sender`."""
        return [port for port in self._nodes if port.listening and port is not sender]

    # --------------------------------------------------------------------------------------------- the end

    def _end_of_frame_in_trouble(self) -> None:
        entry, sender = self._entry, self._sender
        assert entry is not None
        assert sender is not None
        if sender.alone:
            self._spare = self._timer
            self._miss_acknowledge(entry)
            return
        audience = self._ears(sender)
        if not any(port.acknowledges and not port.listen_only for port in audience):
            if not all(port.listen_only for port in audience):
                self._follow_bitwise()
                return
            self._miss_acknowledge(entry)
            return
        end = self._end_ns
        self._account_recovery(end - self._durations[_ACK_TO_EOF_BITS])
        changes: list[StateChange] = []
        # A sender whose queue has been emptied meanwhile is not counted for what it was before.
        alive = entry[1] > sender.dead_sequence
        if alive and sender.tec:
            sender.tec -= 1
            self._update_state(sender, changes)
        for port in audience:
            if port.rec and not port.listen_only:
                port.rec = rec_after_reception(port.rec)
                self._update_state(port, changes)
        self._busy_bits += entry[4]
        self._write(end, sender, entry[3], "")
        if alive:
            self._suspend(sender, end)
        self._release(end)
        for port in audience:
            port.receive(entry[3], end)
        if alive and sender.confirmation is not None:
            sender.confirmation.receive(entry[3], end)
        self._tell(changes)

    def _miss_acknowledge(self, entry: Entry) -> None:
        """Go on where nobody has answered in the ACK slot: an error flag takes the place of ACK delimiter and
        EOF.
        """
        self._unacknowledged = True
        self._end_ns = self._start_ns + self._durations[self._unacknowledged_bits(entry[4])]
        self._timer = self._at(self._end_ns, self._end_of_unacknowledged)

    @staticmethod
    def _unacknowledged_bits(bits: int) -> int:
        """Return the length of an attempt without its intermission, error flag and delimiter included."""
        return bits - INTERMISSION_BITS - _ACK_TO_EOF_BITS + FLAG_BITS + DELIMITER_BITS

    def _end_of_unacknowledged(self) -> None:
        """End an attempt of a node that nobody hears, listeners aside."""
        entry, sender = self._entry, self._sender
        assert entry is not None
        assert sender is not None
        end = self._end_ns
        self._account_recovery(end - self._durations[DELIMITER_BITS])
        self._busy_bits += self._unacknowledged_bits(entry[4]) + INTERMISSION_BITS
        if self._keep_log:
            self._spans[len(self.log)] = (self._start_ns, end + self._intermission_ns)
        self._write(end, sender, entry[3], ErrorCode.ACK.value)
        if sender.alone and self._only_repeats(sender, entry):
            self._unacknowledged = False
            self._free_ns = end + self._intermission_ns
            sender.not_before_ns = start = end + self._durations[INTERMISSION_BITS + SUSPEND_BITS]
            self._begin_frame(entry, start)
            return
        changes: list[StateChange] = []
        if entry[1] > sender.dead_sequence:
            self._give_back(sender, entry, ErrorCode.ACK)
            # An error-passive node that only misses the acknowledge is not counted up, or it would end in
            # bus-off.
            if sender.state is not NodeState.ERROR_PASSIVE:
                sender.tec += 8
                self._tell_error(sender, ErrorCode.ACK, "ack_slot", entry[3])
                self._update_state(sender, changes)
            self._suspend(sender, end)
        self._unacknowledged = False
        self._release(end)
        self._tell(changes)

    def _only_repeats(self, sender: MediumPort, entry: Entry) -> bool:
        """Return whether the next attempt is this one again, for sure: nothing has come that would have to be
        weighed.

        A node without a partner makes some ten thousand attempts a second. Queue, counters and state are the
        same behind each.
        """
        queue = sender.queue
        return (
            sender.state is NodeState.ERROR_PASSIVE
            and not self._careful
            and entry[5] == ()  # hooks have been asked, or are for frames that come after it
            and self._commit_timer is None
            and self._backlog == len(queue)
            and not (queue and queue[0] < entry)
            and entry[1] > sender.dead_sequence
        )

    def _give_back(self, port: MediumPort, entry: Entry, code: ErrorCode | None) -> None:
        """Queue a frame again that could not be sent, or give it up; `code` None: it lost the arbitration."""
        if entry[1] <= port.dead_sequence:
            return
        if code is not None and entry[5] is NOT_ASKED:
            entry = (*entry[:5], ())  # hooks that come later are for new frames
        if not port.one_shot:
            self._queue(port, entry)
        elif self._history is not None:
            reason = "ARBITRATION_LOST" if code is None else code.value
            self._history.emit(
                self.name, "can.given_up", port=port.name, can_id=entry[3].can_id, reason=reason
            )

    def _tell_error(self, port: MediumPort, code: ErrorCode, field: str, frame: CanFrame | None) -> None:
        """Tell that `port` has found an error; `frame`: what it was sending."""
        if self._history is not None:
            role = {"can_id": frame.can_id, "tec": port.tec} if frame is not None else {"rec": port.rec}
            self._history.emit(
                self.name, "can.bus_error", port=port.name, code=code.value, field=field, **role
            )
        for listener in tuple(self.bus_error_listeners):
            listener(self.scheduler.now, port.name, code, frame, field)

    def _suspend(self, sender: MediumPort, end_ns: int) -> None:
        if sender.state is NodeState.ERROR_PASSIVE:
            sender.not_before_ns = end_ns + self._durations[INTERMISSION_BITS + SUSPEND_BITS]

    def _release(self, end_ns: int) -> None:
        """Leave the frame behind and let the next one come."""
        self._free_ns = free = end_ns + self._intermission_ns
        self._entry = None
        self._open_until_ns = COMMITTED
        if any(port.joining for port in self._nodes):
            for port in self._nodes:
                port.joining = False
            self._rebuild()
        else:
            self._assess()
        if self._backlog:
            self._arbitrate(free)

    def _write(self, end_ns: int, sender: MediumPort, frame: CanFrame, error: str) -> None:
        if self._keep_log:
            self.log.append((end_ns, sender.name, frame, error))

    def _overrun(self, port: MediumPort) -> None:
        port.overruns += 1
        now = self.scheduler.now
        told = self._overrun_told_ns.get(port.name)
        if told is not None and now - told < _OVERRUN_EVENT_NS:
            return
        self._overrun_told_ns[port.name] = now
        if self._history is not None:
            self._history.emit(self.name, "can.overrun", port=port.name, count=port.overruns)
        for listener in tuple(port.on_overrun):
            listener()

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

    @abstractmethod
    def _follow_bitwise(self) -> None:
        """Follow the bus bit by bit from now on, the frame that is on the wire included."""

    def _await_recovery(self, port: MediumPort) -> None:
        """Enter the time at which the bus, staying recessive, completes the sequences that are still
        missing.
        """
        missing = (RECOVERY_SEQUENCES - port.recovery_count) * RECOVERY_SEQUENCE_BITS
        due = max(self._quiet_since_ns, port.recovery_from_ns) + missing * S // self.bitrate
        self._stop_recovery(port)
        port.recovery_timer = self._at(max(due, self.scheduler.now), lambda: self._recover(port))

    def _stop_recovery(self, port: MediumPort) -> None:
        if port.recovery_timer is not None:
            port.recovery_timer.cancel()
            port.recovery_timer = None

    def _account_recovery(self, quiet_ns: int) -> None:
        """Count the recessive sequences before the frame that ends now; `quiet_ns`: the next ones start
        there.
        """
        waiting = [port for port in self._ports if port.recovery_timer is not None]
        for port in waiting:
            recessive = self._start_ns - max(self._quiet_since_ns, port.recovery_from_ns)
            if recessive > 0:
                port.recovery_count += recessive // self._durations[RECOVERY_SEQUENCE_BITS]
        self._quiet_since_ns = quiet_ns
        for port in waiting:
            self._await_recovery(port)

    def _recover(self, port: MediumPort) -> None:
        if port.medium is not self:
            return  # behind a cable break now
        if self._bitwise or (self._on_the_wire() and self._start_ns < self.scheduler.now):
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
