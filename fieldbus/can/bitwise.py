"""The virtual segment bit by bit, while something is wrong on the wire.

The cyclic path computes good frames as a whole. A frame with a bit error, with several senders, one whose
sender vanishes, a bus that is stuck or split and nodes with a wrong bit rate are followed with one event per
bit instead: every node is a `Controller`, the bus is the AND of what they send, and what comes of an error
follows from the rules of each node. It begins with a SOF, or in the middle of a frame, which is then repeated
up to the present bit without events; it ends when all nodes agree that the frame is over.
"""

from __future__ import annotations

from collections.abc import Iterable
from heapq import heapify, heappop

from fieldbus.can.account import FrameAccount, PlannedError
from fieldbus.can.arbitration import COMMIT_PRIORITY, COMMITTED
from fieldbus.can.bitstream import image_of
from fieldbus.can.confinement import (
    REC_LIMIT,
    RECOVERY_SEQUENCE_BITS,
    SUSPEND_BITS,
    NodeState,
)
from fieldbus.can.controller import Controller
from fieldbus.can.port import NOT_ASKED, Entry, MediumPort
from fieldbus.can.timing import INTERMISSION_BITS
from fieldbus.clock import S, Scheduler
from fieldbus.errors import BusError
from fieldbus.history import History


class BitwiseSegment(FrameAccount):
    """Base of `CanMedium`; see there."""

    def __init__(
        self, scheduler: Scheduler, *, bitrate: int, name: str, history: History | None, keep_log: bool
    ) -> None:
        super().__init__(scheduler, bitrate=bitrate, name=name, history=history, keep_log=keep_log)
        self._asleep = False  # waiting for somebody to let go of the bus or to send
        self._held: int | None = None
        self._flips: list[
            tuple[int, frozenset[str] | None]
        ] = []  # time within the bit, who reads it inverted
        self._holds: list[tuple[int, int | None]] = []  # time within the bit, level from there on
        self._left: tuple[int, tuple[str, ...]] = (-1, ())  # end of the last intermission and who had sent

    # --------------------------------------------------------------------------------------------- disturbing

    def flip_bit(self, nodes: Iterable[str] | None = None) -> None:
        """Let the bit that is on the wire now be read inverted.

        On an idle bus that is one dominant bit.

        Args:
            nodes: Names of the nodes that read it wrongly; default all.

        """
        self._flips.append((self.scheduler.now, None if nodes is None else frozenset(nodes)))
        self._follow_bitwise()

    def hold_level(self, level: int | None) -> None:
        """Hold the bus at `level` (0 dominant, 1 recessive) whatever the nodes send; None lets go.

        Raises:
            BusError: Another level.

        """
        if level not in (None, 0, 1):
            raise BusError(f"level {level} of the bus is neither 0 (dominant) nor 1 (recessive)")
        self._holds.append((self.scheduler.now, level))
        self._follow_bitwise()

    # --------------------------------------------------------------------------------------------- beginning

    def _transmit_bitwise(self, start_ns: int) -> None:
        self._begin(start_ns)
        self._start_frames()
        self._next_bit()

    def _follow_bitwise(self) -> None:
        now = self.scheduler.now
        if self._bitwise:
            self._wake()
            return
        if self._deciding:  # called by a hook
            self._at(now, self._follow_bitwise, priority=COMMIT_PRIORITY)
            return
        entry, sender = self._entry, self._sender
        if entry is not None and sender is not None and now > self._open_until_ns:
            if self._timer is not None:
                self._timer.cancel()
            start = self._start_ns
            self._entry = None
            self._open_until_ns = COMMITTED
            self._unacknowledged = False
            self._begin(start, sender)
            self._repeat_start(sender, entry)
            self._note_sof()
            self._note_sender()
            while self._edge_ns(self._bit + 1) <= now:
                self._step()
                if not self._bitwise:  # over already
                    return
        else:
            if entry is not None:
                self._withdraw()
            self._disarm()
            self._begin(now)
            passed = INTERMISSION_BITS - self._bits_until(self._free_ns)
            senders = self._last_senders() if passed < INTERMISSION_BITS else ()
            for controller in self._controllers:
                if controller.step != controller.idle:
                    continue
                if passed < INTERMISSION_BITS:
                    controller.begin_intermission(max(passed, 1))
                    controller.n = passed
                    controller.transmitter = controller.port.name in senders
                elif controller.port.not_before_ns > now:
                    controller.suspend(self._bits_until(controller.port.not_before_ns))
            self._start_frames()
        self._next_bit()

    def _last_senders(self) -> tuple[str, ...]:
        """Return who sent the last frame; without a log only for one that was followed bit by bit."""
        if self._left[0] == self._free_ns:
            return self._left[1]
        return (self.log[-1][1],) if self._keep_log and self.log else ()

    def _join_grid(self, grid_ns: int, bit: int) -> None:
        """Follow the bus bit by bit from `bit` of the grid of another segment on, without controllers so
        far.
        """
        self._bitwise = self._deciding = True
        self._plain = False
        self._grid_ns = grid_ns
        self._bit = bit
        self._started_bit = -1
        self._logged = None
        self._busy_from_ns = None
        self._forget_frame()

    def _repeat_start(self, sender: MediumPort, entry: Entry) -> None:
        """Let those begin who began with the frame that is on the wire, and lost the arbitration against
        it.
        """
        late = self._late_sequence if self._late_ns == self._grid_ns else self._sequence + 1
        for controller in self._controllers:
            port = controller.port
            if port is sender:
                controller.begin(entry)
                self._plan(port, entry)
            elif controller.may_start() and port.can_send:
                early = [item for item in port.queue if item[1] < late]
                if early:
                    first = min(early, key=lambda item: item[:3])
                    port.queue.remove(first)
                    heapify(port.queue)
                    self._backlog -= 1
                    controller.begin(first)

    def _begin(self, origin_ns: int, sender: MediumPort | None = None) -> None:
        """Give every node, and `sender` in any case, a controller that expects a frame from `origin_ns`
        on.
        """
        self._disarm()
        self._join_grid(origin_ns, 0)
        self._controllers = []
        for port in self._ports:
            foreign = port not in self._nodes
            if port is not sender and (not port.online or (foreign and not port.queue)):
                continue
            controller = Controller(self, port, silent=port.listen_only or foreign)
            if port.state is NodeState.BUS_OFF:
                recessive = (origin_ns - max(self._quiet_since_ns, port.recovery_from_ns)) * self.bitrate // S
                sequences, rest = divmod(max(recessive, 0), RECOVERY_SEQUENCE_BITS)
                controller.go_off(rest)
                if port.recovery_timer is not None:
                    port.recovery_count += sequences
            elif port.joining:
                controller.integrate()
            elif port.not_before_ns > origin_ns >= self._free_ns:
                controller.suspend(min(self._bits_until(port.not_before_ns, origin_ns), SUSPEND_BITS))
            self._controllers.append(controller)

    def _bits_until(self, time_ns: int, since_ns: int | None = None) -> int:
        """Return how many whole or broken bits there are up to `time_ns`, at least 0."""
        gap = time_ns - (self.scheduler.now if since_ns is None else since_ns)
        return -(-gap * self.bitrate // S) if gap > 0 else 0

    def _next_bit(self) -> None:
        if self._bitwise:
            self._at(self._edge_ns(self._bit + 1), self._end_of_bit, priority=COMMIT_PRIORITY)

    def _wake(self) -> None:
        if not self._asleep:
            return
        self._asleep = False
        self._bit = max(self._bit, (self.scheduler.now - self._grid_ns) * self.bitrate // S)
        self._next_bit()

    # ---------------------------------------------------------------------------------------- starting frames

    def _start_frames(self) -> None:
        """Let everybody who has a frame and may send begin with this bit."""
        able = [one for one in self._controllers if one.may_start() and one.port.queue and one.port.can_send]
        if not able:
            return
        if self._hooks:
            self._settle([one.port for one in able])
        started = False
        for controller in able:
            port = controller.port
            if port.queue and controller in self._controllers and controller.may_start():
                self._note_sof()
                started = True
                entry = self._take_first(port)
                controller.begin(entry)
                self._plan(port, entry)
        if started:
            self._note_sender()

    def _settle(self, ports: list[MediumPort]) -> None:
        """Ask the hooks about the frames that win now; one that only wins by a bit error goes out unasked."""
        while True:
            waiting = [port for port in ports if port.queue]
            best = min((port.queue[0][0] for port in waiting), default=0)
            unasked = [port for port in waiting if port.queue[0][0] == best and port.queue[0][5] is NOT_ASKED]
            if not unasked:
                return
            port = unasked[0]
            self._ask(port, heappop(port.queue), self.scheduler.now)

    def _plan(self, port: MediumPort, entry: Entry) -> None:
        if entry[5]:
            controller = next(one for one in self._controllers if one.port is port)
            error = entry[5][0]
            position = image_of(entry[3]).position(error.field, error.bit)
            if position is not None:
                self._planned.append(PlannedError(controller, self._bit + position, error))

    # --------------------------------------------------------------------------------------------- a bit

    def _end_of_bit(self) -> None:
        if not self._bitwise:  # the nodes have gone to the other side of a mended break
            return
        self._step()
        if self._bitwise:
            self._asleep = self._can_sleep()
            if not self._asleep:
                self._next_bit()

    def _step(self) -> None:
        """Let all nodes read the present bit, and do what follows from it."""
        bit = self._bit
        end = self._edge_ns(bit + 1)
        while self._holds and self._holds[0][0] < end:
            self._held = self._holds.pop(0)[1]
        held = self._held
        level = 1
        for controller in self._controllers:
            level &= controller.drive
        if held is not None:
            level = held
        flips = self._due_errors(end) if self._planned or self._flips else ()
        for controller in self._controllers:
            read = level
            for nodes in flips:
                if nodes is None or controller.port.name in nodes:
                    read ^= 1
            rate = controller.port.rate
            if rate is None:
                controller.step(read)
            else:  # reads as often as its own clock lets it
                for _ in range((bit + 1) * rate // self.bitrate - bit * rate // self.bitrate):
                    controller.step(read)
        if not level or flips:
            self._quiet_since_ns = end
        self._bit = bit + 1
        self._act()
        if self._bitwise:
            if self._is_over():
                self._leave()
            else:
                self._start_frames()

    def _due_errors(self, end_ns: int) -> list[frozenset[str] | None]:
        """Return who reads the present bit inverted, once for each error."""
        due = [nodes for time, nodes in self._flips if time < end_ns]
        self._flips = [flip for flip in self._flips if flip[0] >= end_ns]
        for planned in [one for one in self._planned if one.bit <= self._bit]:
            self._planned.remove(planned)
            controller, bit, error = planned
            # Behind the last bit of the frame its sender need not be sending any more, but it must have come
            # so far.
            if bit == self._bit and (
                controller.entry is not None or controller.step == controller.intermission
            ):
                due.append(error.nodes)
        return due

    # --------------------------------------------------------------------------------------------- the end

    def _is_over(self) -> bool:
        """Return whether all nodes agree that the last frame is over, and nothing disturbs the bus."""
        if self._held is not None or self._flips or self._holds or self._planned:
            return False
        left = -1
        for controller in self._controllers:
            step = controller.step
            if step == controller.off:
                continue
            if step in (controller.idle, controller.suspended):
                own = 0
            elif step == controller.intermission:
                own = INTERMISSION_BITS - controller.n
            else:
                return False
            if left < 0:
                left = own
            elif own != left:
                return False
        return True

    def _leave(self) -> None:
        """Go back to whole frames."""
        now = self._edge_ns(self._bit)
        left = 0
        for controller in self._controllers:
            port = controller.port
            if controller.step == controller.intermission:
                left = INTERMISSION_BITS - controller.n
                if controller.transmitter and port.state is NodeState.ERROR_PASSIVE:
                    port.not_before_ns = now + self._durations[left + SUSPEND_BITS]
            elif controller.step == controller.suspended:
                port.not_before_ns = now + self._durations[SUSPEND_BITS - controller.n]
        self._free_ns = free = now + self._durations[left]
        self._resolve(free - self._intermission_ns)
        if self._busy_from_ns is not None:
            self._busy_bits += (free - self._busy_from_ns) * self.bitrate // S
            if self._logged is not None:
                self._spans[self._logged] = (self._spans[self._logged][0], free)
        self._left = free, tuple(one.port.name for one in self._controllers if one.transmitter)
        self._bitwise = self._deciding = self._asleep = False
        for controller in self._controllers:
            port = controller.port
            if controller.step == controller.off:
                port.recovery_from_ns = now - self._durations[controller.n]
                if port.recovery_timer is not None:
                    self._await_recovery(port)
        for port in self._nodes:
            port.joining = False
        self._controllers = []
        self._rebuild()
        if self._backlog:
            self._arbitrate(max(free, self.scheduler.now))

    def _can_sleep(self) -> bool:
        """Return whether nothing can happen before somebody lets go of the bus or wants to send."""
        if self._held is None or self._flips or self._holds:
            return False
        for controller in self._controllers:
            port, step = controller.port, controller.step
            if step == controller.off:
                if self._held and port.recovery_timer is not None:
                    return False
            elif step == controller.integrating and not self._held:
                continue
            elif step == controller.idle and self._held:
                if port.queue:
                    return False
            elif not (
                step == controller.after_flag
                and not self._held
                and (controller.silent or port.rec >= REC_LIMIT)
            ):
                return False
        return True

    # -------------------------------------------------------------------------------------- nodes come and go

    def _add_controller(self, port: MediumPort) -> None:
        """Let `port` join the segment that is followed bit by bit."""
        if self._bitwise:
            self._wake()
            controller = Controller(self, port, silent=port.listen_only)
            controller.integrate()
            self._controllers.append(controller)

    def _drop_controller(self, port: MediumPort) -> None:
        """Take `port` from the bus; its frame breaks off."""
        for controller in self._controllers:
            if controller.port is port:
                self._break_frame(controller)
                self._controllers.remove(controller)
                self._wake()
                return

    def _switch_off(self, port: MediumPort) -> None:
        """Follow a change to or from bus-off that came from outside."""
        for controller in self._controllers:
            if controller.port is port:
                if port.state is NodeState.BUS_OFF:
                    self._break_frame(controller)
                    controller.go_off()
                elif controller.step == controller.off:
                    controller.integrate()
                self._wake()

    def _break_frame(self, controller: Controller) -> None:
        if controller.entry is not None and self._failing is None:
            others = [one for one in self._controllers if one is not controller and one.entry is not None]
            if not others:
                self._failing = (controller.port.name, controller.entry[3])
            elif self._on_wire is not None and self._on_wire[0] == controller.port.name:
                assert others[0].entry is not None
                self._on_wire = (others[0].port.name, others[0].entry[3])
