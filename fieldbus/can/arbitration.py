"""The cyclic path of the virtual segment: queues, arbitration, transmission and delivery of good frames.

One scheduler event per frame, at the end of its EOF. Who sends next is decided ahead of time, when the bus
becomes free or the first frame is queued on an idle bus; until the very instant of the start of frame the
decision is open, and a frame that is queued by then and ranks higher takes the place. So all frames of one
instant take part in the arbitration whatever the order of the calls, and no event is needed for the
intermission.

With hooks installed the decision is not taken ahead but by an event at the start of the frame, after
everything else of that instant, because a hook must see a frame once and only when it really goes out.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Sequence
from heapq import heappop, heappush
from typing import Final

from fieldbus.can.frame import CanFrame, FrameReceiver
from fieldbus.can.hooks import FrameHook, ask_hooks
from fieldbus.can.port import NOT_ASKED, Confirmation, Entry, MediumPort, deaf
from fieldbus.can.timing import INTERMISSION_BITS, note_timing, timing_of
from fieldbus.clock import Scheduler, Timer
from fieldbus.errors import BusError, ConfigurationError

LogEntry = tuple[int, str, CanFrame, str]
"""A frame on the wire: time of its end (ns), name of the sender, the frame, what went wrong ("" = it was
good).
"""

COMMIT_PRIORITY: Final = 1000
"""Rank of the start of a hooked frame among the events of its instant: after everything that may still send.
"""

_NS: Final = 1_000_000_000
_LONGEST_BITS: Final = 256  # more than the longest frame with the longest error frame
COMMITTED: Final = -1
"""No other frame may take the place of the chosen one any more."""


class Arbitration(ABC):
    """Base of `CanMedium`; see there."""

    def __init__(self, scheduler: Scheduler, *, bitrate: int, name: str, keep_log: bool) -> None:
        if not isinstance(bitrate, int) or not 1_000 <= bitrate <= 1_000_000:
            raise ConfigurationError("bitrate", bitrate, "a whole number from 1000 to 1000000 bit/s")
        self.scheduler = scheduler
        self.name = name
        self.bitrate: Final = bitrate
        self.log: list[LogEntry] = []
        """Every frame on the wire in order; grows, is never replaced."""
        self._keep_log = keep_log
        self._at = scheduler.at
        self._again = scheduler.again
        self._on_end: Callable[[], None] = self._end_of_frame
        self._durations: Final = [bits * _NS // bitrate for bits in range(_LONGEST_BITS)]
        self._intermission_ns = self._durations[INTERMISSION_BITS]
        # By bits with the intermission, which comes behind the end of a frame.
        self._to_end_ns: Final = [0] * INTERMISSION_BITS + self._durations
        self._ports: list[MediumPort] = []  # all that may send, in the order in which they came
        self._hooks: tuple[FrameHook, ...] = ()
        self._hook_entries: tuple[tuple[FrameHook], ...] = ()
        self._sequence = 0
        self._backlog = 0  # frames in all queues; the one in `_entry` is in none
        self._busy_bits = 0
        self._free_ns = scheduler.now  # end of the last intermission
        # The frame that is on the wire or will be next.
        self._entry: Entry | None = None
        self._sender: MediumPort | None = None
        self._start_ns = 0
        self._end_ns = 0
        self._open_until_ns = COMMITTED  # last instant at which another frame may take its place
        self._timer: Timer | None = None
        self._spare: Timer | None = None  # event of an end of frame that is over: good for the next one
        # The first frame that came after the SOF of the frame that began at `_late_ns`.
        self._late_ns = -1
        self._late_sequence = 0
        # The start of the next frame, while hooks are installed.
        self._commit_timer: Timer | None = None
        self._commit_ns = 0
        self._deciding = False  # nobody may start a frame: hooks are asked, or the bus is followed bit by bit
        self._bitwise = False
        self._delicate = False  # a node disturbs every frame, or frames can be given up
        self._troubled = True  # anything beyond good frames between healthy nodes
        self._plain = False  # neither trouble nor hooks: the short way is open
        self._careful = (
            False  # a frame may start only by an event of its own: hooks, or nodes that disturb every frame
        )

    # --------------------------------------------------------------------------------------------- sending

    def submit(self, port: MediumPort, frames: Iterable[CanFrame]) -> None:
        """Queue `frames` of `port`; see `MediumPort.send`."""
        for frame in frames:
            key, bits = frame.timing or note_timing(frame)
            if not port.can_send:
                if port.detached:
                    raise BusError(f"port {port.name} is detached from {self.name}")
                if port.listen_only:
                    raise BusError(f"port {port.name} on {self.name} listens only")
                continue
            self._sequence = sequence = self._sequence + 1
            if self._plain:
                current = self._entry
                if current is None:
                    start = self._free_ns
                    now = self.scheduler.now
                    if start < now:  # noqa: PLR1730 - max() is a call on the cyclic path
                        start = now
                    self._sender = port
                    self._begin_frame((key, sequence, 0, frame, bits, NOT_ASKED), start)
                    continue
                if (
                    port is self._sender
                    and key > current[0]
                    and self.scheduler.now <= self._open_until_ns
                    and len(port.queue) < port.tx_buffers
                ):
                    # One more frame of a node whose first one has yet to start, and ranks higher: nothing
                    # changes.
                    heappush(port.queue, (key, sequence, 0, frame, bits, NOT_ASKED))
                    self._backlog += 1
                    continue
            if len(port.queue) < port.tx_buffers:
                self._offer(port, (key, sequence, 0, frame, bits, NOT_ASKED))
            else:
                self._overrun(port)

    def _begin_frame(self, entry: Entry, start_ns: int) -> None:
        """Put a frame of `_sender` on the wire, unless a better one comes until the very instant."""
        self._entry = entry
        self._start_ns = self._open_until_ns = start_ns
        self._end_ns = end = start_ns + self._to_end_ns[entry[4]]
        timer = self._spare
        if timer is None:
            self._timer = self._at(end, self._on_end)
        else:
            self._spare = None
            self._timer = timer
            self._again(timer, end)

    def _offer(self, port: MediumPort, entry: Entry) -> None:
        heappush(port.queue, entry)
        self._backlog += 1
        current = self._entry
        if current is None:
            if self._deciding:
                self._wake()
            else:
                self._arbitrate(max(self._free_ns, self.scheduler.now))
        elif self.scheduler.now > self._open_until_ns:
            if self._late_ns != self._start_ns:
                self._late_ns = self._start_ns
                self._late_sequence = entry[1]
        elif (
            entry[0] < current[0]
            or (entry[0] == current[0] and port is not self._sender)
            # The chosen one may be an error-passive sender that still has to wait, and this one need not.
            or max(self._free_ns, self.scheduler.now, port.not_before_ns) < self._start_ns
        ):
            self._rearbitrate()

    def _queue(self, port: MediumPort, entry: Entry) -> None:
        """Put `entry` back, unless its port has been emptied meanwhile."""
        if entry[1] > port.dead_sequence:
            heappush(port.queue, entry)
            self._backlog += 1

    # -------------------------------------------------------------------------------------------- arbitration

    def _arbitrate(self, earliest_ns: int) -> None:
        """Decide who sends next, not before `earliest_ns`; nobody has the bus."""
        start, contenders = self._contend(earliest_ns)
        if not contenders:
            return
        if (
            self._careful
            or len(contenders) > 1
            or self._commit_timer is not None
            or (self._troubled and self._is_special(contenders))
        ):
            self._arm(start)
        else:
            self._transmit(start, contenders[0], start)

    def _contend(self, earliest_ns: int) -> tuple[int, list[MediumPort]]:
        """Return when the next frame can start, and the ports that then send the winning arbitration
        field.
        """
        start = earliest_ns
        while True:
            contenders: list[MediumPort] = []
            best = 1 << 32
            for port in self._ports:
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
            start = min(port.not_before_ns for port in self._ports if port.queue)

    def _rearbitrate(self) -> None:
        """Take back a decision that is still open, and decide again."""
        self._withdraw()
        self._arbitrate(max(self._free_ns, self.scheduler.now))

    def _withdraw(self) -> None:
        if self._timer is not None:
            self._timer.cancel()
        if self._entry is not None and self._sender is not None:
            self._queue(self._sender, self._entry)
        self._entry = None
        self._open_until_ns = COMMITTED

    def _transmit(self, start_ns: int, port: MediumPort, open_until_ns: int) -> None:
        """Put the first frame of `port` on the wire."""
        self._backlog -= 1
        self._sender = port
        self._begin_frame(heappop(port.queue), start_ns)
        self._open_until_ns = open_until_ns

    # --------------------------------------------------------------------------------------------- the end

    def _end_of_frame(self) -> None:
        if self._troubled:
            self._end_of_frame_in_trouble()
            return
        entry = self._entry
        sender = self._sender
        assert entry is not None
        assert sender is not None
        end = self._end_ns
        key, _, _, frame, bits, _ = entry
        self._busy_bits += bits
        if self._keep_log:
            self.log.append((end, sender.name, frame, ""))
        self._free_ns = free = end + self._intermission_ns
        backlog = self._backlog
        if not backlog:
            self._entry = None
            self._spare = self._timer
        elif backlog == len(sender.queue) and self._plain and sender.not_before_ns <= free and self._timer:
            # Nobody else wants the bus: as `_begin_frame`, without a call.
            self._backlog = backlog - 1
            self._entry = entry = heappop(sender.queue)
            self._start_ns = self._open_until_ns = free
            self._end_ns = following = free + self._to_end_ns[entry[4]]
            self._again(self._timer, following)
        else:
            self._entry = None
            self._spare = self._timer
            self._arbitrate(free)
        receive = sender.routes.get(key)
        if receive is None:
            receive = self._find_route(sender, frame, key)
        receive(frame, end)

    def _find_route(self, sender: MediumPort, frame: CanFrame, key: int) -> FrameReceiver:
        """Note who takes frames of `sender` with this arbitration field, and return what gives it to them."""
        routes = sender.routes
        takers: list[tuple[MediumPort | Confirmation, FrameReceiver]] = []
        for port in sender.receivers:
            boxes = port.mailboxes
            if boxes is None or frame.extended or frame.remote:
                takers.append((port, port.receive))
            elif frame.can_id in boxes:
                takers.append((port, boxes[frame.can_id]))

        def receive_all(frame: CanFrame, time_ns: int) -> None:
            for port, take in takers:
                # A taker may change what the others listen to, or take them off the bus.
                (take if sender.routes is routes else port.receive)(frame, time_ns)

        route = receive_all if len(takers) > 1 else takers[0][1] if takers else deaf
        routes[key] = route
        return route

    def routes_changed(self) -> None:
        """Forget who takes which frame."""
        for port in self._ports:
            port.routes = {}

    # --------------------------------------------------------------------------------------------- hooks

    def add_hook(self, hook: FrameHook) -> Callable[[], None]:
        """Call `hook` with every frame of the nodes that is about to go on the wire, first attempt only.

        It is called at the start of the frame, when arbitration is won, and sees neither injected frames nor
        copies nor frames that a hook has delayed. Hooks are called in the order in which they were added.

        Returns:
            The function that removes the hook; harmless to repeat.

        """
        entry = (hook,)  # its own identity, so that the same function can be added twice
        self._hook_entries = (*self._hook_entries, entry)
        self._hooks_changed()

        def remove() -> None:
            self._hook_entries = tuple(other for other in self._hook_entries if other is not entry)
            self._hooks_changed()

        return remove

    def _hooks_changed(self) -> None:
        self._hooks = tuple(hook for (hook,) in self._hook_entries)
        self._way_changed()

    def _way_changed(self) -> None:
        """Find out whether frames may go the short way, and take back what has been decided otherwise."""
        self._careful = bool(self._hooks) or self._delicate
        self._plain = not (
            self._troubled or self._careful or self._deciding or self._commit_timer is not None
        )
        if self._deciding:
            return
        if self._commit_timer is not None and not self._careful:
            self._disarm()
            self._arbitrate(max(self._free_ns, self.scheduler.now))
        elif self._entry is not None and self._careful and self.scheduler.now <= self._open_until_ns:
            self._rearbitrate()

    def _disarm(self) -> None:
        if self._commit_timer is not None:
            self._commit_timer.cancel()
            self._commit_timer = None
            self._plain = not (self._troubled or self._careful or self._deciding)

    def _arm(self, start_ns: int) -> None:
        """Enter the start of the next frame as an event."""
        if self._commit_timer is not None:
            if self._commit_ns <= start_ns:
                return
            self._commit_timer.cancel()
        self._commit_ns = start_ns
        self._plain = False
        self._commit_timer = self._at(start_ns, self._commit, priority=COMMIT_PRIORITY)

    def _commit(self) -> None:
        """Start the frame that wins now, after the hooks have had their say."""
        self._commit_timer = None
        start = self._commit_ns
        self._deciding = True
        self._plain = False
        try:
            contenders = self._ask_contenders(start)
        finally:
            if not self._bitwise:
                self._deciding = False
                self._plain = not (self._troubled or self._careful)
        if self._bitwise:
            self._wake()  # a hook has disturbed the bus
        elif not contenders:
            if self._backlog:
                self._arbitrate(start)
        elif self._is_special(contenders):
            self._transmit_bitwise(start)
        else:
            self._transmit(start, contenders[0], COMMITTED)

    def _ask_contenders(self, start_ns: int) -> list[MediumPort]:
        """Return the ports that start now, all of their frames having passed the hooks."""
        while True:
            start, contenders = self._contend(start_ns)
            if start > start_ns:
                return []
            for port in contenders:
                if port.queue[0][5] is NOT_ASKED:
                    sequence = self._sequence
                    passed = self._ask(port, heappop(port.queue), start_ns)
                    if passed and len(contenders) == 1 and sequence == self._sequence and port.queue:
                        return contenders  # nothing has changed
                    break
            else:
                return contenders

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
            key, bits = timing_of(frame.can_id, bytes(frame.data), frame.extended, frame.remote, frame.dlc)
        entries: list[Entry] = [(key, sequence, copy, frame, bits, verdict.corruptions)]
        entries += [(key, sequence, copy + number + 1, frame, bits, ()) for number in range(verdict.copies)]
        if not verdict.delay_ns:
            for item in entries:
                self._queue(port, item)
            return False

        def offer() -> None:
            if sequence > port.dead_sequence:
                for item in entries:
                    self._offer(port, item)

        self.scheduler.after(verdict.delay_ns, offer)
        return False

    # ------------------------------------------------------------------------------------- beyond good frames

    @abstractmethod
    def _is_special(self, contenders: Sequence[MediumPort]) -> bool:
        """Return whether what `contenders` send now can only be found out bit by bit."""

    @abstractmethod
    def _transmit_bitwise(self, start_ns: int) -> None:
        """Start the first frames of all ports now, and follow them bit by bit."""

    @abstractmethod
    def _wake(self) -> None:
        """Go on bit by bit if everybody is waiting for a frame."""

    @abstractmethod
    def _end_of_frame_in_trouble(self) -> None:
        """End a frame while the nodes are not all healthy."""

    @abstractmethod
    def _overrun(self, port: MediumPort) -> None:
        """Refuse a frame because the queue is full."""
