"""A bus section bit by bit, while something is wrong on the wire.

The cyclic path computes good frames as a whole. A frame with a bit error, with several senders, one whose
sender vanishes, a bus that is stuck or split and nodes with a wrong bit rate are followed with one event per
bit instead: every node is a `Controller`, the bus is the AND of what they send, and the result of an error
follows from the rules of each node. It begins with a SOF, or in the middle of a frame, which is then repeated
up to the present bit without events; it ends when all nodes agree that the frame is over.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final, NamedTuple, Protocol

from fieldbus.can.bitstream import BitError, image_of
from fieldbus.can.confinement import (
    REC_LIMIT,
    RECOVERY_SEQUENCE_BITS,
    RECOVERY_SEQUENCES,
    SUSPEND_BITS,
    ErrorCode,
    NodeState,
)
from fieldbus.can.controller import Controller
from fieldbus.can.error_handling import ErrorHandling, StateChange
from fieldbus.can.frame import CanFrame
from fieldbus.can.frame_log import FrameLog
from fieldbus.can.port import NOT_ASKED, Entry, MediumPort
from fieldbus.can.timing import INTERMISSION_BITS
from fieldbus.clock import S, Scheduler

COMMIT_PRIORITY: Final = 1000
"""Rank of a bit, and of a start of frame that is an event, in its instant: after
everything that may still send.
"""


class FrameLevel(Protocol):
    """Queues and hooks of the section, and the way back to whole frames."""

    def take_first(self, port: MediumPort) -> Entry:
        """Remove the first frame of a queue, and return it."""

    def take(self, port: MediumPort, entry: Entry) -> None:
        """Remove a frame from a queue."""

    def give_back(self, port: MediumPort, entry: Entry, code: ErrorCode | None) -> None:
        """Queue a frame again that could not be sent, or give it up; `code` None: it lost the arbitration."""

    def ask_first(self, ports: Sequence[MediumPort]) -> None:
        """Ask the hooks about the frames that win now."""

    def leave_bus_off(self, port: MediumPort, changes: list[StateChange]) -> None:
        """Let a node take part again."""

    def leave_bit_level(self, free_ns: int, busy_bits: int) -> None:
        """Return to whole frames; the bus is free at `free_ns` and was occupied for `busy_bits`."""


class _FoundError(NamedTuple):
    """An error that a node has found in the present bit."""

    controller: Controller
    code: ErrorCode
    field: str
    frame: CanFrame | None  # what it was sending
    reported: bool  # False: an error-passive node that only misses the acknowledge


class _PlannedError(NamedTuple):
    """A bit error that waits for its place in the frame of a sender."""

    controller: Controller
    bit: int  # of the grid
    error: BitError


class BitLevel:
    """The controllers of a section in step, and what they send, receive and find.

    Args:
        scheduler: Time.
        bitrate: bit/s.
        data_bitrate: Of the data phase of CAN FD, bit/s; None: a classical segment.
        nodes: Nodes of the section; the list of the section itself.
        ports: All that may send, likewise.
        errors: Error states of the nodes.
        log: Log of the segment.
        frames: Queues and hooks of the section.

    """

    def __init__(
        self,
        scheduler: Scheduler,
        *,
        bitrate: int,
        data_bitrate: int | None = None,
        nodes: list[MediumPort],
        ports: list[MediumPort],
        errors: ErrorHandling,
        log: FrameLog,
        frames: FrameLevel,
    ) -> None:
        self.active = False
        """Whether the bus is followed bit by bit."""
        self._scheduler = scheduler
        self._bitrate = bitrate
        self._data_bitrate = data_bitrate
        self._rate = bitrate  # of the present bit
        self._nodes = nodes
        self._ports = ports
        self._errors = errors
        self._log = log
        self._frames = frames
        self._intermission_ns = INTERMISSION_BITS * S // bitrate
        self._asleep = False  # waiting for the bus to be released, or for a frame
        self._controllers: list[Controller] = []
        self._grid_ns = 0  # start of bit `_grid_bit`, from which on the bits have the present rate
        self._grid_bit = 0
        self._bit = 0  # number of the bit that is on the wire
        self._started_bit = -1  # bit with the last SOF
        self._held: int | None = None
        self._flips: list[
            tuple[int, frozenset[str] | None]
        ] = []  # time within the bit, who reads it inverted
        self._holds: list[tuple[int, int | None]] = []  # time within the bit, level from there on
        self._planned: list[_PlannedError] = []
        self._last_intermission: tuple[int, tuple[str, ...]] = (-1, ())  # its end, and who had sent
        # What the present bit has brought.
        self._changes: list[StateChange] = []
        self._found: list[_FoundError] = []
        self._sent: list[tuple[Controller, Entry]] = []
        self._received: list[tuple[Controller, CanFrame]] = []
        self._recovered: list[MediumPort] = []
        # The frame that is being followed.
        self._first_code: ErrorCode | None = None
        self._failing: tuple[str, CanFrame] | None = None
        self._on_wire: tuple[str, CanFrame] | None = None
        self._succeeded = False
        self._busy_from_ns: int | None = None
        self._span_from_ns = 0
        self._logged: int | None = None  # place of the last entry of the log that was written here

    # -- disturbing

    def flip(self, nodes: frozenset[str] | None) -> None:
        """Have the bit that is on the wire now read inverted by `nodes`, None: by all."""
        self._flips.append((self._scheduler.now, nodes))

    def hold(self, level: int | None) -> None:
        """Hold the bus at `level` from now on; None releases it."""
        self._holds.append((self._scheduler.now, level))

    # -- beginning

    def begin(self, start_ns: int, free_ns: int) -> None:
        """Start the first frames of all ports now; the last intermission has ended at `free_ns`."""
        self._begin_grid(start_ns, free_ns)
        self._start_frames()
        self.next_bit()

    def take_over(
        self, start_ns: int, free_ns: int, sender: MediumPort, entry: Entry, late_sequence: int
    ) -> None:
        """Follow the frame that is on the wire from its start up to now.

        Args:
            start_ns: Start of the frame.
            free_ns: End of the last intermission.
            sender: Who sends it.
            entry: The frame.
            late_sequence: Frames from this number on were queued after its start.

        """
        now = self._scheduler.now
        self._begin_grid(start_ns, free_ns, sender)
        self._repeat_start(sender, entry, late_sequence)
        self._note_sof()
        self._note_sender()
        while self._edge_ns(self._bit + 1) <= now:
            self._step()
            if not self.active:  # over already
                return
        self.next_bit()

    def begin_between(self, now_ns: int, free_ns: int) -> None:
        """Begin with the present bit, between two frames or on an idle bus."""
        self._begin_grid(now_ns, free_ns)
        passed = INTERMISSION_BITS - self._bits_until(free_ns, now_ns)
        senders = self._last_senders(free_ns) if passed < INTERMISSION_BITS else ()
        for controller in self._controllers:
            if controller.step != controller.idle:
                continue
            if passed < INTERMISSION_BITS:
                controller.begin_intermission(max(passed, 1))
                controller.n = passed
                controller.transmitter = controller.port.name in senders
            elif controller.port.not_before_ns > now_ns:
                controller.suspend(self._bits_until(controller.port.not_before_ns, now_ns))
        self._start_frames()
        self.next_bit()

    def _last_senders(self, free_ns: int) -> tuple[str, ...]:
        """Return who sent the last frame; without a log only for one that was followed bit by bit."""
        if self._last_intermission[0] == free_ns:
            return self._last_intermission[1]
        sender = self._log.last_sender()
        return () if sender is None else (sender,)

    def _start_grid(self, grid_ns: int, bit: int) -> None:
        """Follow the bus from `bit` of a grid on, without controllers so far."""
        self.active = True
        self._grid_ns = grid_ns
        self._grid_bit = 0
        self._rate = self._bitrate
        self._bit = bit
        self._started_bit = -1
        self._logged = None
        self._busy_from_ns = None
        self._forget_frame()

    def _begin_grid(self, origin_ns: int, free_ns: int, sender: MediumPort | None = None) -> None:
        """Give every node, and `sender` in any case, a controller that
        expects a frame from `origin_ns` on.
        """
        self._start_grid(origin_ns, 0)
        self._controllers = []
        for port in self._ports:
            foreign = port not in self._nodes
            if port is not sender and (not port.online or (foreign and not port.queue)):
                continue
            controller = self._controller(port, silent=port.listen_only or foreign)
            if port.state is NodeState.BUS_OFF:
                quiet_ns = max(self._errors.quiet_since_ns, port.recovery_from_ns)
                recessive = (origin_ns - quiet_ns) * self._bitrate // S
                sequences, rest = divmod(max(recessive, 0), RECOVERY_SEQUENCE_BITS)
                controller.go_off(rest)
                if port.recovery_timer is not None:
                    port.recovery_count += sequences
            elif port.joining:
                controller.integrate()
            elif port.not_before_ns > origin_ns >= free_ns:
                controller.suspend(min(self._bits_until(port.not_before_ns, origin_ns), SUSPEND_BITS))
            self._controllers.append(controller)

    def _controller(self, port: MediumPort, *, silent: bool) -> Controller:
        return Controller(self, port, silent=silent, on_fd=self._data_bitrate is not None)

    def _repeat_start(self, sender: MediumPort, entry: Entry, late_sequence: int) -> None:
        """Let those begin who began with the frame that is on the wire, and lost the arbitration
        against it.
        """
        for controller in self._controllers:
            port = controller.port
            if port is sender:
                controller.begin(entry)
                self._plan(controller, entry)
            elif controller.may_start() and port.can_send:
                early = [item for item in port.queue if item[1] < late_sequence]
                if early:
                    first = min(early, key=lambda item: item[:3])
                    self._frames.take(port, first)
                    controller.begin(first)

    def _bits_until(self, time_ns: int, since_ns: int) -> int:
        """Return how many whole or broken bits there are up to `time_ns`, at least 0."""
        gap = time_ns - since_ns
        return -(-gap * self._bitrate // S) if gap > 0 else 0

    def next_bit(self) -> None:
        """Enter the end of the present bit."""
        if self.active:
            self._scheduler.at(self._edge_ns(self._bit + 1), self._end_of_bit, priority=COMMIT_PRIORITY)

    def wake(self) -> None:
        """Go on if all nodes are waiting for a frame."""
        if not self._asleep:
            return
        self._asleep = False
        past = (self._scheduler.now - self._grid_ns) * self._rate // S
        self._bit = max(self._bit, self._grid_bit + past)
        self.next_bit()

    def _edge_ns(self, bit: int) -> int:
        """Return the time at which bit number `bit` begins."""
        return self._grid_ns + (bit - self._grid_bit) * S // self._rate

    def _follow_rate(self, data_bitrate: int) -> None:
        """Let the next bit have the data bit rate of CAN FD while a node transmits its data phase."""
        rate = data_bitrate if any(one.fast for one in self._controllers) else self._bitrate
        if rate != self._rate:
            self._grid_ns, self._grid_bit, self._rate = self._edge_ns(self._bit), self._bit, rate

    # -- starting frames

    def _start_frames(self) -> None:
        """Let every node that has a frame and may send begin with this bit."""
        able = [one for one in self._controllers if one.may_start() and one.port.queue and one.port.can_send]
        if not able:
            return
        self._frames.ask_first([one.port for one in able])
        started = False
        for controller in able:
            port = controller.port
            if port.queue and controller in self._controllers and controller.may_start():
                self._note_sof()
                started = True
                entry = self._frames.take_first(port)
                controller.begin(entry)
                self._plan(controller, entry)
        if started:
            self._note_sender()

    def _plan(self, controller: Controller, entry: Entry) -> None:
        if entry[5]:
            error = entry[5][0]
            position = image_of(entry[3]).position(error.field, error.bit)
            if position is not None:
                self._planned.append(_PlannedError(controller, self._bit + position, error))

    def _note_sof(self) -> None:
        """Begin the account of a new frame with this bit."""
        if self._started_bit != self._bit:
            self._started_bit = self._bit
            start = self._edge_ns(self._bit)
            self._resolve(start)
            if self._busy_from_ns is None:
                self._busy_from_ns = self._span_from_ns = start

    def _note_sender(self) -> None:
        """Find out whose frame it will be unless something goes wrong."""
        entries = [(one.entry, one.port.name) for one in self._controllers if one.entry is not None]
        entry, name = min(entries, key=lambda pair: pair[0][:3])
        self._on_wire = (name, entry[3])

    def _forget_frame(self) -> None:
        self._first_code = None
        self._failing = self._on_wire = None
        self._succeeded = False
        self._planned = []

    # -- a bit

    def _end_of_bit(self) -> None:
        if not self.active:  # the nodes have gone to the other side of a repaired break
            return
        self._step()
        if self.active:
            self._asleep = self._can_sleep()
            if not self._asleep:
                self.next_bit()

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
                for _ in range((bit + 1) * rate // self._bitrate - bit * rate // self._bitrate):
                    controller.step(read)
        if not level or flips:
            self._errors.quiet_since_ns = end
        self._bit = bit + 1
        self._act()
        if self._data_bitrate is not None:
            self._follow_rate(self._data_bitrate)
        if self.active:
            if self._is_over():
                self._finish()
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

    def _act(self) -> None:
        """Carry out what the bit has brought, now that all nodes have read it."""
        if not (self._found or self._sent or self._received or self._recovered or self._changes):
            return
        found, self._found = self._found, []
        sent, self._sent = self._sent, []
        received, self._received = self._received, []
        recovered, self._recovered = self._recovered, []
        changes, self._changes = self._changes, []
        end = self._edge_ns(self._bit)
        for port in recovered:
            port.tec = port.rec = 0
            self._frames.leave_bus_off(port, changes)
        if found:
            self._report_found(found)
        if sent or received:
            self._deliver(sent, received, end)
        self._errors.report(changes)

    def _report_found(self, found: list[_FoundError]) -> None:
        senders = [one for one in found if one.frame is not None]
        first = self._first_code is None
        if first:
            self._first_code = (senders or found)[0].code
        if self._failing is None and senders:
            name, frame = senders[0].controller.port.name, senders[0].frame
            assert frame is not None
            self._failing = (name, frame)
        for one in senders or (found[:1] if first else []):
            if one.reported:
                self._errors.report_error(one.controller.port, one.code, one.field, one.frame)

    def _deliver(
        self, sent: list[tuple[Controller, Entry]], received: list[tuple[Controller, CanFrame]], end: int
    ) -> None:
        frame = sent[0][1][3] if sent else received[0][1]
        name = sent[0][0].port.name if sent else ""
        if not sent and self._on_wire is not None and self._on_wire[1] == frame:
            name, frame = self._on_wire
        self._succeeded = bool(sent)
        self._write(end, name, frame, "")
        for controller, other in received:
            if controller.port in self._nodes and (controller.port.takes_fd or not other.fd):
                controller.port.receive(frame if other == frame else other, end)
        for controller, entry in sent:
            if controller.port.confirmation is not None:
                controller.port.confirmation.receive(entry[3], end)

    def _write(self, end_ns: int, name: str, frame: CanFrame, error: str) -> None:
        if self._log.enabled:
            free = end_ns + self._intermission_ns
            span = (min(self._span_from_ns, end_ns), free)
            self._logged = self._log.write_span(span, end_ns, name, frame, error)
            self._span_from_ns = free

    def _resolve(self, end_ns: int) -> None:
        """Write the failed attempt, if there is one that has not turned out well after all."""
        if self._failing is not None and not self._succeeded and self._first_code is not None:
            self._write(end_ns, *self._failing, self._first_code.value)
        self._forget_frame()

    # -- the end

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

    def _finish(self) -> None:
        """Go back to whole frames."""
        now = self._edge_ns(self._bit)
        left = 0
        for controller in self._controllers:
            port = controller.port
            if controller.step == controller.intermission:
                left = INTERMISSION_BITS - controller.n
                if controller.transmitter and port.state is NodeState.ERROR_PASSIVE:
                    port.not_before_ns = now + self._duration_ns(left + SUSPEND_BITS)
            elif controller.step == controller.suspended:
                port.not_before_ns = now + self._duration_ns(SUSPEND_BITS - controller.n)
        free = now + self._duration_ns(left)
        self._resolve(free - self._intermission_ns)
        busy_bits = 0
        if self._busy_from_ns is not None:
            busy_bits = (free - self._busy_from_ns) * self._bitrate // S
            if self._logged is not None:
                self._log.extend(self._logged, free)
        self._last_intermission = free, tuple(one.port.name for one in self._controllers if one.transmitter)
        self.stop()
        for controller in self._controllers:
            port = controller.port
            if controller.step == controller.off:
                port.recovery_from_ns = now - self._duration_ns(controller.n)
                if port.recovery_timer is not None:
                    self._errors.await_recovery(port)
        self._controllers = []
        self._frames.leave_bit_level(free, busy_bits)

    def _duration_ns(self, bits: int) -> int:
        return bits * S // self._bitrate

    def stop(self) -> None:
        """Stop following the bus."""
        self.active = self._asleep = False

    def _can_sleep(self) -> bool:
        """Return whether nothing can happen before the bus is released or a frame is queued."""
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

    # -- nodes come and go

    def join(self, port: MediumPort) -> None:
        """Give `port` a controller that joins the running segment, unless it has one."""
        if self.active and all(one.port is not port for one in self._controllers):
            self.wake()
            controller = self._controller(port, silent=port.listen_only)
            controller.integrate()
            self._controllers.append(controller)

    def leave(self, port: MediumPort) -> None:
        """Take `port` from the bus; its frame breaks off."""
        for controller in self._controllers:
            if controller.port is port:
                self._break_frame(controller)
                self._controllers.remove(controller)
                self.wake()
                return

    def state_set(self, port: MediumPort) -> None:
        """Follow a change to or from bus-off that came from outside."""
        for controller in self._controllers:
            if controller.port is port:
                if port.state is NodeState.BUS_OFF:
                    self._break_frame(controller)
                    controller.go_off()
                elif controller.step == controller.off:
                    controller.integrate()
                self.wake()

    def _break_frame(self, controller: Controller) -> None:
        if controller.entry is not None and self._failing is None:
            others = [one for one in self._controllers if one is not controller and one.entry is not None]
            if not others:
                self._failing = (controller.port.name, controller.entry[3])
            elif self._on_wire is not None and self._on_wire[0] == controller.port.name:
                assert others[0].entry is not None
                self._on_wire = (others[0].port.name, others[0].entry[3])

    def join_grid_of(self, other: BitLevel) -> None:
        """Follow the bus from the present bit of another section on, without controllers so far."""
        grid_ns, first, bit, rate = other.grid
        self._start_grid(grid_ns, bit)
        self._grid_bit, self._rate = first, rate

    @property
    def grid(self) -> tuple[int, int, int, int]:
        """Start of a bit, ns; its number; number of the present bit; the rate since the former."""
        return self._grid_ns, self._grid_bit, self._bit, self._rate

    def hand_over(self, ports: Sequence[MediumPort], other: BitLevel) -> None:
        """Move the controllers of `ports` to another section."""
        for controller in [one for one in self._controllers if one.port in ports]:
            self._controllers.remove(controller)
            other.take_controller(controller)

    def take_controller(self, controller: Controller) -> None:
        """Take the controller of a node over from another section."""
        if controller.entry is not None:
            self._on_wire = (controller.port.name, controller.entry[3])
        controller.host = self
        self._controllers.append(controller)

    # -- what the controllers report (`fieldbus.can.controller.Host`)

    def frame_started(self, controller: Controller) -> None:  # noqa: ARG002 - the same for all
        """Follow a SOF that a node has read without sending it."""
        self._note_sof()

    def frame_to_send(self, controller: Controller) -> Entry | None:
        """Return the frame with which a node joins in; the SOF is another
        node's, so the hooks are not asked.
        """
        port = controller.port
        if not port.queue or not port.can_send:
            return None
        self._note_sof()
        entry = self._frames.take_first(port)
        self._on_wire = self._on_wire or (port.name, entry[3])
        return entry

    def lost_arbitration(self, controller: Controller, entry: Entry) -> None:
        """Queue `entry` again."""
        self._frames.give_back(controller.port, entry, None)

    def attempt_failed(self, controller: Controller, entry: Entry) -> None:
        """Queue `entry` again, which ended in an error."""
        rest = entry[5] if entry[5] is NOT_ASKED else entry[5][1:]
        self._frames.give_back(controller.port, (*entry[:5], rest), self._found[-1].code)

    def error_found(self, controller: Controller, code: ErrorCode, field: str, entry: Entry | None) -> None:
        """Note an error that a node has detected, while it was sending `entry`."""
        if entry is not None or not controller.silent:
            frame = None if entry is None else entry[3]
            self._found.append(_FoundError(controller, code, field, frame, not controller.ack_only))

    def counted(self, controller: Controller) -> None:
        """Follow a change of the error counters."""
        port = controller.port
        self._errors.update_state(port, self._changes)
        if port.state is NodeState.BUS_OFF and controller.step != controller.off:
            controller.go_off()

    def frame_sent(self, controller: Controller, entry: Entry) -> None:
        """Note a successful transmission."""
        self._sent.append((controller, entry))

    def frame_received(self, controller: Controller, frame: CanFrame) -> None:
        """Note a good reception."""
        self._received.append((controller, frame))

    def overload_started(self, controller: Controller, *, own: bool) -> None:
        """Report an overload flag that a node sends by its own wish."""
        if own:
            self._errors.report_overload(controller.port)

    def quiet_sequence(self, controller: Controller) -> None:
        """Count 11 recessive bits that a bus-off node has seen."""
        port = controller.port
        if port.recovery_timer is None:
            return
        port.recovery_count += 1
        if port.recovery_count >= RECOVERY_SEQUENCES:
            controller.step = controller.idle
            self._recovered.append(port)
