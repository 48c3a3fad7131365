"""What the controllers of a segment tell of the frame that is followed bit by bit: events, log,
deliveries.
"""

from __future__ import annotations

from heapq import heappop
from typing import NamedTuple

from fieldbus.can.bitstream import BitError
from fieldbus.can.confinement import RECOVERY_SEQUENCES, ErrorCode, NodeState
from fieldbus.can.controller import Controller
from fieldbus.can.frame import CanFrame
from fieldbus.can.port import NOT_ASKED, Entry, MediumPort
from fieldbus.can.trouble import ErrorHandling, StateChange
from fieldbus.clock import S, Scheduler
from fieldbus.history import History


class _Found(NamedTuple):
    """An error that a node has found in the present bit."""

    controller: Controller
    code: ErrorCode
    field: str
    frame: CanFrame | None  # what it was sending
    told: bool  # False: an error-passive node that only misses the acknowledge


class PlannedError(NamedTuple):
    """A bit error that waits for its place in the frame of a sender."""

    controller: Controller
    bit: int  # of the grid
    error: BitError


class FrameAccount(ErrorHandling):
    """Base of `BitwiseSegment`; the host of the controllers."""

    def __init__(
        self, scheduler: Scheduler, *, bitrate: int, name: str, history: History | None, keep_log: bool
    ) -> None:
        super().__init__(scheduler, bitrate=bitrate, name=name, history=history, keep_log=keep_log)
        self._controllers: list[Controller] = []
        self._grid_ns = 0  # start of bit 0
        self._bit = 0  # number of the bit that is on the wire
        self._started_bit = -1  # bit with the last SOF
        self._planned: list[PlannedError] = []
        self._changes: list[StateChange] = []
        self._found: list[_Found] = []
        self._sent: list[tuple[Controller, Entry]] = []
        self._got: list[tuple[Controller, CanFrame]] = []
        self._recovered: list[MediumPort] = []
        # The frame that is being followed.
        self._first_code: ErrorCode | None = None
        self._failing: tuple[str, CanFrame] | None = None
        self._on_wire: tuple[str, CanFrame] | None = None
        self._succeeded = False
        self._busy_from_ns: int | None = None
        self._span_from_ns = 0
        self._logged: int | None = None  # index of the last entry of the log written here

    def _edge_ns(self, bit: int) -> int:
        """Return the time at which bit number `bit` begins."""
        return self._grid_ns + bit * S // self.bitrate

    def _forget_frame(self) -> None:
        self._first_code = None
        self._failing = self._on_wire = None
        self._succeeded = False
        self._planned = []

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

    # --------------------------------------------------------------------------------------------- a bit

    def _act(self) -> None:
        """Tell what the bit has brought, now that all nodes have read it."""
        found, self._found = self._found, []
        sent, self._sent = self._sent, []
        got, self._got = self._got, []
        recovered, self._recovered = self._recovered, []
        changes, self._changes = self._changes, []
        if not (found or sent or got or recovered or changes):
            return
        end = self._edge_ns(self._bit)
        for port in recovered:
            port.tec = port.rec = 0
            self._leave_bus_off(port, changes)
        if found:
            self._tell_found(found)
        if sent or got:
            self._deliver(sent, got, end)
        self._tell(changes)

    def _tell_found(self, found: list[_Found]) -> None:
        senders = [one for one in found if one.frame is not None]
        first = self._first_code is None
        if first:
            self._first_code = (senders or found)[0].code
        if self._failing is None and senders:
            name, frame = senders[0].controller.port.name, senders[0].frame
            assert frame is not None
            self._failing = (name, frame)
        for one in senders or (found[:1] if first else []):
            if one.told:
                self._tell_error(one.controller.port, one.code, one.field, one.frame)

    def _deliver(
        self, sent: list[tuple[Controller, Entry]], got: list[tuple[Controller, CanFrame]], end: int
    ) -> None:
        frame = sent[0][1][3] if sent else got[0][1]
        name = sent[0][0].port.name if sent else ""
        if not sent and self._on_wire is not None and self._on_wire[1] == frame:
            name, frame = self._on_wire
        self._succeeded = bool(sent)
        self._log_here(end, name, frame, "")
        for controller, other in got:
            if controller.port in self._nodes:
                controller.port.receive(frame if other == frame else other, end)
        for controller, entry in sent:
            if controller.port.confirmation is not None:
                controller.port.confirmation.receive(entry[3], end)

    def _log_here(self, end_ns: int, name: str, frame: CanFrame, error: str) -> None:
        if self._keep_log:
            self._logged = len(self.log)
            free = end_ns + self._intermission_ns
            self._spans[self._logged] = (min(self._span_from_ns, end_ns), free)
            self._span_from_ns = free
            self.log.append((end_ns, name, frame, error))

    def _resolve(self, end_ns: int) -> None:
        """Write the failed attempt, if there is one that has not turned out well after all."""
        if self._failing is not None and not self._succeeded and self._first_code is not None:
            self._log_here(end_ns, *self._failing, self._first_code.value)
        self._forget_frame()

    # ---------------------------------------------------------------------------------- what controllers tell

    def frame_started(self, controller: Controller) -> None:  # noqa: ARG002 - the same for all
        """See `fieldbus.can.controller.Host`."""
        self._note_sof()

    def _take_first(self, port: MediumPort) -> Entry:
        self._backlog -= 1
        return heappop(port.queue)

    def frame_to_send(self, controller: Controller) -> Entry | None:
        """See `fieldbus.can.controller.Host`; the SOF is that of somebody else, so the hooks are not
        asked.
        """
        port = controller.port
        if not port.queue or not port.can_send:
            return None
        self._note_sof()
        entry = self._take_first(port)
        self._on_wire = self._on_wire or (port.name, entry[3])
        return entry

    def lost_arbitration(self, controller: Controller, entry: Entry) -> None:
        """See `fieldbus.can.controller.Host`."""
        self._give_back(controller.port, entry, None)

    def attempt_failed(self, controller: Controller, entry: Entry) -> None:
        """See `fieldbus.can.controller.Host`."""
        rest = entry[5] if entry[5] is NOT_ASKED else entry[5][1:]
        self._give_back(controller.port, (*entry[:5], rest), self._found[-1].code)

    def error_found(self, controller: Controller, code: ErrorCode, field: str, entry: Entry | None) -> None:
        """See `fieldbus.can.controller.Host`."""
        if entry is not None or not controller.silent:
            frame = None if entry is None else entry[3]
            self._found.append(_Found(controller, code, field, frame, not controller.ack_only))

    def counted(self, controller: Controller) -> None:
        """See `fieldbus.can.controller.Host`."""
        port = controller.port
        self._update_state(port, self._changes)
        if port.state is NodeState.BUS_OFF and controller.step != controller.off:
            controller.go_off()

    def frame_sent(self, controller: Controller, entry: Entry) -> None:
        """See `fieldbus.can.controller.Host`."""
        self._sent.append((controller, entry))

    def frame_received(self, controller: Controller, frame: CanFrame) -> None:
        """See `fieldbus.can.controller.Host`."""
        self._got.append((controller, frame))

    def overload_started(self, controller: Controller, *, own: bool) -> None:
        """See `fieldbus.can.controller.Host`."""
        if own and self._history is not None:
            self._history.emit(self.name, "can.overload", port=controller.port.name)

    def quiet_sequence(self, controller: Controller) -> None:
        """See `fieldbus.can.controller.Host`."""
        port = controller.port
        if port.recovery_timer is None:
            return
        port.recovery_count += 1
        if port.recovery_count >= RECOVERY_SEQUENCES:
            controller.step = controller.idle
            self._recovered.append(port)
