"""A section of a CAN bus: nodes that hear each other, with whole frames on the cyclic path.

One scheduler event per frame, at the end of its EOF. Who sends next is decided ahead of time, when
the bus becomes free or the first frame is queued on an idle bus; until the very instant of the start
of frame the decision is open, and a frame that is queued by then and ranks higher takes the place. So
all frames of one instant take part in the arbitration whatever the order of the calls, and no event
is needed for the intermission.

With hooks installed the decision is not taken ahead but by an event at the start of the frame, after
everything else of that instant, because a hook must see a frame once and only when it really goes out.

A frame between healthy nodes is computed as a whole. While error counters are not zero, or a node finds no
partner, the end of a frame also updates the counters. What goes wrong inside of a frame is followed bit by
bit (`BitLevel`).
"""

from __future__ import annotations

from collections.abc import Callable, Container, Iterable, Sequence
from heapq import heapify, heappop, heappush
from typing import Any, Final

from fieldbus.can.bit_level import COMMIT_PRIORITY, BitLevel
from fieldbus.can.confinement import (
    BUS_OFF_LIMIT,
    DELIMITER_BITS,
    FLAG_BITS,
    SUSPEND_BITS,
    ErrorCode,
    NodeState,
    rec_after_reception,
)
from fieldbus.can.error_handling import BusErrorListener, ErrorHandling, StateChange
from fieldbus.can.fd import NO_FD, fd_bits, fd_time_ns
from fieldbus.can.fd import arbitration_key as fd_key
from fieldbus.can.frame import CanFrame, FrameReceiver
from fieldbus.can.frame_log import FrameLog
from fieldbus.can.hooks import FrameHook, ask_hooks
from fieldbus.can.port import NOT_ASKED, Confirmation, Entry, MediumPort, ignore_frame
from fieldbus.can.timing import INTERMISSION_BITS, note_timing
from fieldbus.clock import S, Scheduler, Timer
from fieldbus.errors import BusError
from fieldbus.history import History

_push: Final = heappush  # constants are at hand in the compiled core
# Any: an entry that only passes through is not taken apart and made again there.
_pop: Final[Callable[[list[Entry]], Any]] = heappop
_LONGEST_BITS: Final = 256  # more than the longest frame with the longest error frame
_COMMITTED: Final = -1  # no other frame may take the place of the chosen one any more
_ACK_TO_EOF_BITS: Final = 8  # ACK delimiter and EOF
_FLAG_FOR_EOF_BITS: Final = FLAG_BITS + DELIMITER_BITS - _ACK_TO_EOF_BITS


class BusSection:
    """The nodes on one side of a cable break, or all nodes of a segment.

    Args:
        scheduler: Time; its only thread.
        bitrate: bit/s.
        data_bitrate: That of the data phase of CAN FD, bit/s; None: a classical segment. Frames of a segment
            with CAN FD never go the short way.
        name: Name of the segment in events.
        history: Where events go.
        log: Log of the segment.
        listeners: Called with every error that a node finds.

    """

    def __init__(
        self,
        scheduler: Scheduler,
        *,
        bitrate: int,
        data_bitrate: int | None = None,
        name: str,
        history: History | None,
        log: FrameLog,
        listeners: list[BusErrorListener],
    ) -> None:
        self.scheduler = scheduler
        self.name = name
        self.bitrate: Final = bitrate
        self.data_bitrate: Final = data_bitrate
        self.nodes: list[MediumPort] = []
        """The connected nodes, in the order in which they came."""
        self.ports: list[MediumPort] = []
        """All that may send: the nodes, and those that inject frames."""
        self.busy_bits = 0
        """Bit times for which the bus was occupied, counted when a frame has ended."""
        self.free_ns = scheduler.now
        """End of the last intermission, ns."""
        self.log: Final = log
        self.errors: Final = ErrorHandling(
            scheduler,
            name=name,
            bitrate=bitrate,
            history=history,
            listeners=listeners,
            on_bus_off=self._on_bus_off,
            on_recovered=self._on_recovered,
        )
        self._write_log: bool = log.enabled
        self._log_entries = log.entries
        self._at = scheduler.at
        self._on_end: Callable[[], None] = self._end_of_frame
        self._durations: Final = [bits * S // bitrate for bits in range(_LONGEST_BITS)]
        self._intermission_ns = self._durations[INTERMISSION_BITS]
        # By bits with the intermission, which follows the end of a frame.
        self._to_end_ns: Final = [0] * INTERMISSION_BITS + self._durations
        # Of CAN FD frames: place in `_to_end_ns` by numbers of bits, and by place bits of the nominal rate.
        self._fd_places: dict[tuple[int, int], int] = {}
        self._fd_busy: dict[int, int] = {}
        self._hooks: tuple[FrameHook, ...] = ()
        self._sequence = 0  # number of the last frame that was queued
        self._backlog = 0  # frames in all queues; the one in `_entry` is in none
        # The frame that is on the wire or will be next.
        self._entry: Entry | None = None
        self._sender: MediumPort | None = None
        self._start_ns = 0
        self._end_ns = 0
        self._open_until_ns = _COMMITTED  # last instant at which another frame may take its place
        self._timer: Timer | None = None
        self._spare: Timer | None = None  # event of an end of frame that is over: good for the next one
        # The first frame that came after the SOF of the frame that began at `_late_ns`.
        self._late_ns = -1
        self._late_sequence = 0
        # The start of the next frame, while hooks are installed.
        self._commit_timer: Timer | None = None
        self._commit_ns = 0
        # What keeps frames from the short way.
        self._blocked = False  # no frame may start: hooks are asked, or the bus is followed bit by bit
        self._unacknowledged = False  # the attempt on the wire has found no acknowledge
        self._degraded = True  # not only good frames between healthy nodes
        self._disturbed = False  # a node disturbs every frame, or frames can be given up
        self._start_by_event = False  # hooks, or nodes that disturb every frame
        self._short_way = False  # none of all this
        self.bits: Final = BitLevel(
            scheduler,
            bitrate=bitrate,
            data_bitrate=data_bitrate,
            nodes=self.nodes,
            ports=self.ports,
            errors=self.errors,
            log=log,
            frames=self,
        )
        """The bus bit by bit, while something is wrong on the wire."""

    # -- sending

    def submit(self, port: MediumPort, frames: Iterable[CanFrame]) -> None:
        """Queue `frames` of `port`; see `MediumPort.send`."""
        now = self.scheduler.time_ns
        for frame in frames:
            key, bits = frame.key, frame.bits
            if not bits:
                key, bits = self._timing(frame, port)
            if not port.can_send:
                if port.detached:
                    raise BusError(f"port {port.name} is detached from {self.name}")
                if port.listen_only:
                    raise BusError(f"port {port.name} on {self.name} listens only")
                continue
            self._sequence = sequence = self._sequence + 1
            if self._short_way:
                current = self._entry
                if current is None:
                    start = self.free_ns
                    if start < now:  # noqa: PLR1730 - max() is a call on the cyclic path
                        start = now
                    self._sender = port
                    self._begin_frame((key, sequence, 0, frame, bits, NOT_ASKED), bits, start)
                    continue
                if (
                    port is self._sender
                    and key > current[0]
                    and now <= self._open_until_ns
                    and len(port.queue) < port.tx_buffers
                ):
                    # One more frame of a node whose first one has yet to start, and ranks higher: nothing
                    # changes.
                    _push(port.queue, (key, sequence, 0, frame, bits, NOT_ASKED))
                    self._backlog += 1
                    continue
            if len(port.queue) < port.tx_buffers:
                self._offer(port, (key, sequence, 0, frame, bits, NOT_ASKED))
            else:
                self.errors.overrun(port)

    def inject(self, port: MediumPort, frame: CanFrame) -> None:
        """Queue a frame of `port` that no hook sees."""
        key, bits = self._timing(frame, port)
        if port.can_send:
            self._sequence += 1
            self._offer(port, (key, self._sequence, 0, frame, bits, ()))

    def _timing(self, frame: CanFrame, port: MediumPort) -> tuple[int, int]:
        """Return arbitration key and bits of a frame; of one of CAN FD the place of its duration.

        Raises:
            BusError: It is no frame that the segment carries and `port` sends.

        """
        if not frame.fd:
            return note_timing(frame)
        rate = self.data_bitrate
        if rate is None:
            raise BusError(NO_FD)
        if not port.takes_fd:
            raise BusError(f"port {port.name} on {self.name} sends no CAN FD frames")
        bits = fd_bits(frame)
        place = self._fd_places.get(bits)
        if place is None:
            place = self._fd_places[bits] = len(self._to_end_ns)
            duration_ns = fd_time_ns(frame, self.bitrate, rate)
            self._to_end_ns.append(duration_ns - self._intermission_ns)
            self._fd_busy[place] = round(duration_ns * self.bitrate / S)
        return fd_key(frame), place

    def _begin_frame(self, entry: Entry, bits: int, start_ns: int) -> None:
        """Put a frame of `_sender` on the wire, unless a better one comes until the very instant."""
        self._entry = entry
        self._start_ns = self._open_until_ns = start_ns
        self._end_ns = end = start_ns + self._to_end_ns[bits]
        timer = self._spare
        if timer is None:
            self._timer = timer = self._at(end, self._on_end)
            timer.apart = True
        else:
            self._spare = None
            self._timer = timer
            self.scheduler.again(timer, end)

    def _offer(self, port: MediumPort, entry: Entry) -> None:
        _push(port.queue, entry)
        self._backlog += 1
        current = self._entry
        now = self.scheduler.time_ns
        start = self._start_ns
        if current is None:
            if self._blocked:
                self.bits.wake()
            else:
                self._arbitrate(max(self.free_ns, now))
        elif now > self._open_until_ns:
            if self._late_ns != start:
                self._late_ns = start
                self._late_sequence = entry[1]
        else:
            key, chosen = entry[0], current[0]
            if (
                key < chosen
                or (key == chosen and port is not self._sender)
                # The chosen one may be an error-passive sender that still has to wait, and this one need not.
                or (self.free_ns < start and now < start and port.not_before_ns < start)
            ):
                self._rearbitrate()

    def _queue(self, port: MediumPort, entry: Entry) -> None:
        """Put `entry` back, unless the queue has been emptied since it was taken."""
        if entry[1] > port.discarded:
            _push(port.queue, entry)
            self._backlog += 1

    def take_first(self, port: MediumPort) -> Entry:
        """Remove the first frame of a queue, and return it."""
        self._backlog -= 1
        entry: Entry = _pop(port.queue)
        return entry

    def take(self, port: MediumPort, entry: Entry) -> None:
        """Remove a frame from a queue."""
        port.queue.remove(entry)
        heapify(port.queue)
        self._backlog -= 1

    def give_back(self, port: MediumPort, entry: Entry, code: ErrorCode | None) -> None:
        """Queue a frame again that could not be sent, or give it up; `code` None: it lost the arbitration."""
        if entry[1] <= port.discarded:
            return
        if code is not None and entry[5] is NOT_ASKED:
            entry = (*entry[:5], ())  # hooks that come later are for new frames
        if not port.one_shot:
            self._queue(port, entry)
        else:
            reason = "ARBITRATION_LOST" if code is None else code.value
            self.errors.report_given_up(port, entry[3].can_id, reason)

    # -- arbitration

    def _arbitrate(self, earliest_ns: int) -> None:
        """Decide who sends next, not before `earliest_ns`; the bus is free."""
        start, contenders = self._contend(earliest_ns)
        if not contenders:
            return
        if (
            self._start_by_event
            or len(contenders) > 1
            or self._commit_timer is not None
            or (self._degraded and self._needs_bits(contenders))
        ):
            self._arm(start)
        else:
            self._transmit(start, contenders[0], start)

    def _contend(self, earliest_ns: int) -> tuple[int, list[MediumPort]]:
        """Return when the next frame can start, and the ports that then send
        the winning arbitration field.
        """
        start = earliest_ns
        while True:
            contenders: list[MediumPort] = []
            best = 1 << 32
            for port in self.ports:
                queue = port.queue
                if queue and port.not_before_ns <= start:
                    key = queue[0][0]
                    if key < best:
                        best = key
                        contenders = [port]
                    elif key == best:
                        contenders.append(port)
            if contenders or not self._backlog:
                return start, contenders
            start = min(port.not_before_ns for port in self.ports if port.queue)

    def _rearbitrate(self) -> None:
        """Take back a decision that is still open, and decide again."""
        self._withdraw()
        self._arbitrate(max(self.free_ns, self.scheduler.now))

    def _withdraw(self) -> None:
        if self._timer is not None:
            self._timer.cancel()
        if self._entry is not None and self._sender is not None:
            self._queue(self._sender, self._entry)
        self._entry = None
        self._open_until_ns = _COMMITTED

    def _transmit(self, start_ns: int, port: MediumPort, open_until_ns: int) -> None:
        """Put the first frame of `port` on the wire."""
        self._backlog -= 1
        self._sender = port
        entry = _pop(port.queue)
        self._begin_frame(entry, entry[4], start_ns)
        self._open_until_ns = open_until_ns

    def _needs_bits(self, contenders: Sequence[MediumPort]) -> bool:
        """Return whether what `contenders` send now can only be found out bit by bit."""
        first = contenders[0].queue[0]
        if len(contenders) > 1 or first[5]:
            return True
        if first[3].fd and any(port.classic_only for port in self._listeners(contenders[0])):
            return True
        if not contenders[0].acknowledged and not all(
            port.listen_only for port in self._listeners(contenders[0])
        ):
            return True
        return self._disturbed and any(
            port.online
            and (
                port.overload_frames
                or port.rate is not None
                or (port.one_shot and port is not contenders[0] and port.queue)
            )
            for port in self.nodes
        )

    # -- start of a frame by an event

    def _arm(self, start_ns: int) -> None:
        """Enter the start of the next frame as an event."""
        if self._commit_timer is not None:
            if self._commit_ns <= start_ns:
                return
            self._commit_timer.cancel()
        self._commit_ns = start_ns
        self._short_way = False
        self._commit_timer = self._at(start_ns, self._commit, priority=COMMIT_PRIORITY)

    def _disarm(self) -> None:
        if self._commit_timer is not None:
            self._commit_timer.cancel()
            self._commit_timer = None
            self._short_way = not (self._degraded or self._start_by_event or self._blocked)

    def _commit(self) -> None:
        """Start the frame that wins now, after the hooks have been asked."""
        self._commit_timer = None
        start = self._commit_ns
        self._blocked = True
        try:
            contenders = self._ask_contenders(start)
        finally:
            disturbed = self.bits.active
            if not disturbed:
                self._blocked = False
                self._short_way = not (self._degraded or self._start_by_event)
        if disturbed:
            self.bits.wake()  # a hook has disturbed the bus
        elif not contenders:
            if self._backlog:
                self._arbitrate(start)
        elif self._needs_bits(contenders):
            self._enter_bit_level()
            self.bits.begin(start, self.free_ns)
        else:
            self._transmit(start, contenders[0], _COMMITTED)

    def _ask_contenders(self, start_ns: int) -> list[MediumPort]:
        """Return the ports that start now, all of their frames having passed the hooks."""
        while True:
            start, contenders = self._contend(start_ns)
            if start > start_ns:
                return []
            for port in contenders:
                if port.queue[0][5] is NOT_ASKED:
                    sequence = self._sequence
                    passed = self._ask(port, _pop(port.queue), start_ns)
                    if passed and len(contenders) == 1 and sequence == self._sequence and port.queue:
                        return contenders  # nothing has changed
                    break
            else:
                return contenders

    def ask_first(self, ports: Sequence[MediumPort]) -> None:
        """Ask the hooks about the frames that win now; one that only wins by a bit error goes out unasked."""
        if not self._hooks:
            return
        while True:
            waiting = [port for port in ports if port.queue]
            best = min((port.queue[0][0] for port in waiting), default=0)
            unasked = [port for port in waiting if port.queue[0][0] == best and port.queue[0][5] is NOT_ASKED]
            if not unasked:
                return
            port = unasked[0]
            self._ask(port, _pop(port.queue), self.scheduler.now)

    def _ask(self, port: MediumPort, entry: Entry, time_ns: int) -> bool:
        """Let the hooks decide about `entry`; returns whether it is in the queue as it was."""
        self._backlog -= 1
        key, sequence, copy, frame, bits, _ = entry
        verdict = ask_hooks(self._hooks, frame, port.name, time_ns)
        if verdict is None:
            self._queue(port, (key, sequence, copy, frame, bits, ()))
            return True
        if verdict.dropped:
            return False
        if verdict.frame is not frame:
            frame = verdict.frame
            key, bits = self._timing(frame, port)
        entries: list[Entry] = [(key, sequence, copy, frame, bits, verdict.corruptions)]
        entries += [(key, sequence, copy + number + 1, frame, bits, ()) for number in range(verdict.copies)]
        if not verdict.delay_ns:
            for item in entries:
                self._queue(port, item)
            return False

        def offer() -> None:
            if sequence > port.discarded:
                for item in entries:
                    self._offer(port, item)

        self.scheduler.after(verdict.delay_ns, offer)
        return False

    def set_hooks(self, hooks: tuple[FrameHook, ...]) -> None:
        """Ask `hooks` about every frame from now on."""
        self._hooks = hooks
        self._way_changed()

    def _way_changed(self) -> None:
        """Find out whether frames may go the short way, and take back what has been decided otherwise."""
        self._start_by_event = bool(self._hooks) or self._disturbed
        self._short_way = not (
            self._degraded or self._start_by_event or self._blocked or self._commit_timer is not None
        )
        if self._blocked:
            return
        if self._commit_timer is not None and not self._start_by_event:
            self._disarm()
            self._arbitrate(max(self.free_ns, self.scheduler.now))
        elif self._entry is not None and self._start_by_event and self.scheduler.now <= self._open_until_ns:
            self._rearbitrate()

    # -- end of a frame

    def _end_of_frame(self) -> None:
        if self._degraded:
            self.scheduler.catch_up()
            self._end_of_degraded_frame()
            return
        entry = self._entry
        sender = self._sender
        assert entry is not None
        assert sender is not None
        end = self._end_ns
        # Compiled, a name for several of them would make objects of the numbers.
        key, _sequence, _copy, frame, bits, _corruptions = entry
        self.busy_bits += bits
        time_ns: Any = end  # compiled, one object for log and receiver
        if self._write_log:
            self._log_entries.append((time_ns, sender.name, frame, ""))
        self.free_ns = free = end + self._intermission_ns
        backlog = self._backlog
        if not backlog:
            self._entry = None
            self._spare = self._timer
        elif (
            backlog == len(sender.queue) and self._short_way and sender.not_before_ns <= free and self._timer
        ):
            # No other node is waiting: as `_begin_frame`, without a call.
            self._backlog = backlog - 1
            self._entry = upcoming = _pop(sender.queue)
            self._start_ns = self._open_until_ns = free
            self._end_ns = following = free + self._to_end_ns[upcoming[4]]
            self.scheduler.again(self._timer, following)
        else:
            self._entry = None
            self._spare = self._timer
            self._arbitrate(free)
        receive = sender.routes.get(key)
        if receive is None:
            receive = self._find_route(sender, frame, key)
        receive(frame, time_ns)

    def _find_route(self, sender: MediumPort, frame: CanFrame, key: int) -> FrameReceiver:
        """Note who takes frames of `sender` with this arbitration field, and return what delivers them."""
        routes = sender.routes
        takers: list[tuple[MediumPort | Confirmation, FrameReceiver]] = []
        apart = True
        for port in sender.receivers:
            boxes = port.mailboxes
            if boxes is None or frame.extended or frame.remote:
                takers.append((port, port.receive))
                apart = False
            elif frame.can_id in boxes:
                takers.append((port, boxes[frame.can_id]))
                apart = apart and frame.can_id in port.apart
        catch_up = self.scheduler.catch_up
        route: FrameReceiver

        def receive_all(frame: CanFrame, time_ns: Any) -> None:
            catch_up()
            for port, take in takers:
                # A taker may change what the others listen to, or take them off the bus.
                (take if sender.routes is routes else port.receive)(frame, time_ns)

        if not takers:
            route = ignore_frame
        elif len(takers) > 1:
            route = receive_all
        else:
            first = takers[0][1]

            def receive_one(frame: CanFrame, time_ns: Any) -> None:
                catch_up()
                first(frame, time_ns)

            route = first if apart else receive_one
        routes[key] = route
        return route

    def routes_changed(self) -> None:
        """Forget who takes which frame."""
        for port in self.ports:
            port.routes = {}

    def _end_of_degraded_frame(self) -> None:
        entry, sender = self._entry, self._sender
        assert entry is not None
        assert sender is not None
        if sender.alone:
            self._spare = self._timer
            self._miss_acknowledge(entry)
            return
        audience = self._listeners(sender)
        if not any(port.acknowledges and not port.listen_only for port in audience):
            if not all(port.listen_only for port in audience):
                self.follow_bits()
                return
            self._miss_acknowledge(entry)
            return
        end = self._end_ns
        errors = self.errors
        errors.count_quiet(self.ports, self._start_ns, end - self._durations[_ACK_TO_EOF_BITS])
        changes: list[StateChange] = []
        if sender.tec:
            sender.tec -= 1
            errors.update_state(sender, changes)
        for port in audience:
            if port.rec and not port.listen_only:
                port.rec = rec_after_reception(port.rec)
                errors.update_state(port, changes)
        frame = entry[3]
        if frame.fd:
            self.busy_bits += self._fd_busy[entry[4]]
            span = self._start_ns, end + self._intermission_ns
            self.log.write_span(span, end, sender.name, frame, "")
        else:
            self.busy_bits += entry[4]
            self.log.write(end, sender.name, frame, "")
        self._suspend(sender, end)
        self._release(end)
        for port in audience:
            if port.takes_fd or not frame.fd:
                port.receive(frame, end)
        if sender.confirmation is not None:
            sender.confirmation.receive(entry[3], end)
        errors.report(changes)

    def _miss_acknowledge(self, entry: Entry) -> None:
        """Continue without an acknowledge: an error flag takes the place of ACK delimiter and EOF."""
        self._unacknowledged = True
        if entry[3].fd:
            self._end_ns = self._start_ns + self._to_end_ns[entry[4]] + self._durations[_FLAG_FOR_EOF_BITS]
        else:
            self._end_ns = self._start_ns + self._durations[_unacknowledged_bits(entry[4])]
        self._timer = self._at(self._end_ns, self._end_of_unacknowledged)

    def _end_of_unacknowledged(self) -> None:
        """End an attempt of a node that only listeners receive, if any."""
        entry, sender = self._entry, self._sender
        assert entry is not None
        assert sender is not None
        end = self._end_ns
        errors = self.errors
        errors.count_quiet(self.ports, self._start_ns, end - self._durations[DELIMITER_BITS])
        if entry[3].fd:
            self.busy_bits += self._fd_busy[entry[4]] + _FLAG_FOR_EOF_BITS
        else:
            self.busy_bits += _unacknowledged_bits(entry[4]) + INTERMISSION_BITS
        span = (self._start_ns, end + self._intermission_ns)
        self.log.write_span(span, end, sender.name, entry[3], ErrorCode.ACK.value)
        if sender.alone and self._only_repeats(sender, entry):
            self._unacknowledged = False
            self.free_ns = end + self._intermission_ns
            sender.not_before_ns = start = end + self._durations[INTERMISSION_BITS + SUSPEND_BITS]
            self._begin_frame(entry, entry[4], start)
            return
        changes: list[StateChange] = []
        self.give_back(sender, entry, ErrorCode.ACK)
        # An error-passive node that only misses the acknowledge is not counted up, or it would end in
        # bus-off.
        if sender.state is not NodeState.ERROR_PASSIVE:
            sender.tec += 8
            errors.report_error(sender, ErrorCode.ACK, "ack_slot", entry[3])
            errors.update_state(sender, changes)
        self._suspend(sender, end)
        self._unacknowledged = False
        self._release(end)
        errors.report(changes)

    def _only_repeats(self, sender: MediumPort, entry: Entry) -> bool:
        """Return whether the next attempt is certainly this one again: nothing has come
        that would have to be weighed.

        A node without a partner makes some ten thousand attempts a second. Queue, counters and state are the
        same after each.
        """
        queue = sender.queue
        return (
            sender.state is NodeState.ERROR_PASSIVE
            and not self._start_by_event
            and entry[5] == ()  # hooks have been asked, or are for frames that come after it
            and self._commit_timer is None
            and self._backlog == len(queue)
            and not (queue and queue[0] < entry)
            and entry[1] > sender.discarded
        )

    def _suspend(self, sender: MediumPort, end_ns: int) -> None:
        if sender.state is NodeState.ERROR_PASSIVE:
            sender.not_before_ns = end_ns + self._durations[INTERMISSION_BITS + SUSPEND_BITS]

    def _release(self, end_ns: int) -> None:
        """End the frame and let the next one come."""
        self.free_ns = free = end_ns + self._intermission_ns
        self._entry = None
        self._open_until_ns = _COMMITTED
        if any(port.joining for port in self.nodes):
            for port in self.nodes:
                port.joining = False
            self._rebuild()
        else:
            self._assess()
        if self._backlog:
            self._arbitrate(free)

    # -- bit by bit

    def follow_bits(self) -> None:
        """Follow the bus bit by bit from now on, the frame that is on the wire included."""
        now = self.scheduler.now
        if self.bits.active:
            self.bits.wake()
            return
        if self._blocked:  # called by a hook
            self._at(now, self.follow_bits, priority=COMMIT_PRIORITY)
            return
        entry, sender = self._entry, self._sender
        if entry is not None and sender is not None and now > self._open_until_ns:
            if self._timer is not None:
                self._timer.cancel()
            start = self._start_ns
            self._entry = None
            self._open_until_ns = _COMMITTED
            self._unacknowledged = False
            self._enter_bit_level()
            late = self._late_sequence if self._late_ns == start else self._sequence + 1
            self.bits.take_over(start, self.free_ns, sender, entry, late)
        else:
            if entry is not None:
                self._withdraw()
            self._enter_bit_level()
            self.bits.begin_between(now, self.free_ns)

    def _enter_bit_level(self) -> None:
        self._disarm()
        self._blocked = True
        self._short_way = False

    def leave_bit_level(self, free_ns: int, busy_bits: int) -> None:
        """Return to whole frames: all nodes agree that the bus is free at `free_ns`."""
        self.free_ns = free_ns
        self.busy_bits += busy_bits
        self._blocked = False
        for port in self.nodes:
            port.joining = False
        self._rebuild()
        if self._backlog:
            self._arbitrate(max(free_ns, self.scheduler.now))

    # -- nodes

    def add_port(self, port: MediumPort) -> None:
        """Let a port that injects frames take part."""
        self.ports.append(port)
        self._rebuild()

    def attach(self, port: MediumPort) -> None:
        """Connect a node; a frame that is on the wire at this moment passes it by."""
        port.joining = self._on_the_wire()
        self.nodes.append(port)
        self.ports.append(port)
        self.bits.join(port)
        self.ports_changed()

    def detach(self, port: MediumPort) -> None:
        """Disconnect a node for good."""
        if port.detached:
            return
        port.online = False
        port.detached = True
        self.nodes.remove(port)
        self.ports.remove(port)
        self.ports_changed()

    def presence_changed(self, port: MediumPort) -> None:
        """Follow a change of `port.online`."""
        if port.online:
            port.tec = port.rec = 0
            changes: list[StateChange] = []
            self.errors.change_state(port, NodeState.ERROR_ACTIVE, changes)
            port.can_send = not port.listen_only
            port.joining = self._on_the_wire()
            self.bits.join(port)
            self._rebuild()
            self.errors.report(changes)
        else:
            port.can_send = port.joining = False
            self.errors.stop_recovery(port)
            self._empty(port)
            self._break_off(port)
            self._rebuild()

    def flush(self, port: MediumPort) -> None:
        """Remove the queued frames of a port; one that is on the wire still completes."""
        self._empty(port)
        if self._entry is not None and self.scheduler.now <= self._open_until_ns:
            self._rearbitrate()

    def withdraw(self, port: MediumPort, identifiers: Container[tuple[int, bool]]) -> None:
        """Remove queued frames of a port by their identifiers; one that is on the wire still completes."""
        still_open = self._entry is not None and self.scheduler.now <= self._open_until_ns
        if still_open:
            self._withdraw()
        left = [entry for entry in port.queue if (entry[3].can_id, entry[3].extended) not in identifiers]
        self._backlog -= len(port.queue) - len(left)
        port.queue[:] = left
        heapify(port.queue)
        if still_open:
            self._arbitrate(max(self.free_ns, self.scheduler.now))

    def ports_changed(self) -> None:
        """Follow a change of what a port does."""
        self._rebuild()
        self._way_changed()

    def _empty(self, port: MediumPort) -> None:
        self._backlog -= len(port.queue)
        port.queue.clear()
        port.discarded = self._sequence

    def _on_the_wire(self) -> bool:
        return self._entry is not None and self.scheduler.now > self._open_until_ns

    def _break_off(self, port: MediumPort) -> None:
        """Take `port` from the bus, in the middle of its frame if need be."""
        if not self.bits.active and self._entry is not None:
            if not self._on_the_wire():
                self._rearbitrate()
            elif port is self._sender:
                self.follow_bits()
        if port.online:
            self.bits.state_set(port)
        else:
            self.bits.leave(port)

    def _rebuild(self) -> None:
        """Find out which node receives from which."""
        for port in self.nodes:
            port.listening = port.online and port.state is not NodeState.BUS_OFF and not port.joining
            port.receive = port.handler if port.listening else ignore_frame
        listening = [port for port in self.nodes if port.listening]
        joining = any(port.joining for port in self.nodes)
        for port in self.ports:
            others: list[MediumPort] = [other for other in listening if other is not port]
            port.acknowledged = any(other.acknowledges and not other.listen_only for other in others)
            port.receivers = (*others, port.confirmation) if port.confirmation is not None else tuple(others)
            port.alone = not others and not joining
            port.routes = {}
        self._assess()

    def _assess(self) -> None:
        """Find out whether the short way is open."""
        self._degraded = (
            self._unacknowledged
            or self.data_bitrate is not None
            or any(
                port.tec
                or port.rec
                or port.joining
                or port.state is not NodeState.ERROR_ACTIVE
                or (port.can_send and not port.acknowledged)
                for port in self.ports
            )
        )
        self._disturbed = any(
            port.online and (port.one_shot or port.overload_frames or port.rate is not None)
            for port in self.nodes
        )
        self._start_by_event = bool(self._hooks) or self._disturbed
        self._short_way = not (
            self._degraded or self._start_by_event or self._blocked or self._commit_timer is not None
        )

    def _listeners(self, sender: MediumPort) -> list[MediumPort]:
        """Return the nodes that hear `sender`."""
        return [port for port in self.nodes if port.listening and port is not sender]

    # -- error states

    def recover(self, port: MediumPort) -> None:
        """Begin the recovery of a node from bus-off; harmless in any other state."""
        self.errors.begin_recovery(port)

    def set_error_counters(self, port: MediumPort, tec: int, rec: int) -> None:
        """Set the error counters of a port; its state follows."""
        changes: list[StateChange] = []
        port.tec, port.rec = tec, rec
        if port.state is NodeState.BUS_OFF and tec < BUS_OFF_LIMIT:
            self.leave_bus_off(port, changes)
        self.errors.update_state(port, changes)
        if self.bits.active:
            self.bits.state_set(port)
        elif port.state is NodeState.BUS_OFF and self._entry is not None:
            self._break_off(port)
        self._assess()
        self.errors.report(changes)

    def leave_bus_off(self, port: MediumPort, changes: list[StateChange]) -> None:
        """Let a node take part again."""
        self.errors.stop_recovery(port)
        self.errors.change_state(port, NodeState.ERROR_ACTIVE, changes)
        port.can_send = port.online and not port.listen_only
        port.joining = self._on_the_wire()
        self._rebuild()

    def _on_bus_off(self, port: MediumPort) -> None:
        self._empty(port)
        self._rebuild()

    def _on_recovered(self, port: MediumPort) -> None:
        if port.section is not self:
            return  # behind a cable break now
        if self.bits.active or (self._on_the_wire() and self._start_ns < self.scheduler.now):
            return  # the end of this frame enters a new time
        changes: list[StateChange] = []
        port.tec = port.rec = 0
        self.leave_bus_off(port, changes)
        self.errors.report(changes)

    # -- cable breaks (CANP-078)

    def split_off(self, ports: Sequence[MediumPort]) -> BusSection:
        """Break the cable: return a section of its own with the nodes `ports`, which are of this one."""
        far = BusSection(
            self.scheduler,
            bitrate=self.bitrate,
            data_bitrate=self.data_bitrate,
            name=self.name,
            history=self.errors.history,
            log=self.log,
            listeners=self.errors.listeners,
        )
        far.set_hooks(self._hooks)
        if self._entry is not None or self.bits.active:
            self.follow_bits()
        far.start_at(self._sequence, self.free_ns, self.errors.quiet_since_ns)
        if self.bits.active:
            far.continue_bits_of(self.bits)
        self.hand_over(ports, far)
        far.bits.next_bit()
        return far

    def start_at(self, sequence: int, free_ns: int, quiet_since_ns: int) -> None:
        """Continue where another section is."""
        self._sequence = sequence
        self.free_ns = free_ns
        self.errors.quiet_since_ns = quiet_since_ns

    def continue_bits_of(self, bits: BitLevel) -> None:
        """Follow the bus bit by bit on the same grid as another section."""
        self._blocked = True
        self._short_way = False
        self.bits.join_grid_of(bits)

    def rejoin(self, far: BusSection) -> None:
        """Repair the cable: take the nodes of `far` back; what is on the wire
        on the two sides then collides.
        """
        self._sequence = sequence = max(self._sequence, far.sequence)
        far.start_at(sequence, far.free_ns, far.errors.quiet_since_ns)
        if self.busy or far.busy or max(self.free_ns, far.free_ns) > self.scheduler.now:
            self.follow_bits()
            far.follow_bits()
        far.hand_over(list(far.nodes), self)
        far.retire()

    @property
    def sequence(self) -> int:
        """Number of the last frame that was queued."""
        return self._sequence

    @property
    def busy(self) -> bool:
        """Whether a frame is on the wire or about to start, or the bus is followed bit by bit."""
        return self._entry is not None or self.bits.active

    def hand_over(self, ports: Sequence[MediumPort], other: BusSection) -> None:
        """Move nodes, with what they are sending, to another section."""
        self.bits.hand_over(ports, other.bits)
        for port in ports:
            self.nodes.remove(port)
            self.ports.remove(port)
            self._backlog -= len(port.queue)
            other.receive_port(port)
        for section in (self, other):
            section.resettle()

    def receive_port(self, port: MediumPort) -> None:
        """Take a node over from another section."""
        self.nodes.append(port)
        self.ports.append(port)
        self._backlog += len(port.queue)
        port.section = self
        if not self.bits.active:
            if port.recovery_timer is not None:
                self.errors.await_recovery(port)
        elif port.online:
            self.bits.join(port)

    def resettle(self) -> None:
        """Follow a change of the nodes, and decide who sends next."""
        self.ports_changed()
        if not self.bits.active and self._backlog:
            self._arbitrate(max(self.free_ns, self.scheduler.now))

    def retire(self) -> None:
        """Be no section any more: nothing starts here."""
        self.bits.stop()
        self._blocked = True
        self._disarm()


def _unacknowledged_bits(bits: int) -> int:
    """Return the length of an attempt without its intermission, error flag and delimiter included."""
    return bits - INTERMISSION_BITS - _ACK_TO_EOF_BITS + FLAG_BITS + DELIMITER_BITS
