"""One node's CAN controller bit by bit: what it sends, what it makes of what it
reads, and its error counters.

The cyclic path of the segment does without: it computes good frames as a whole. Controllers run only
while something is wrong on the wire, one step per bit, and know nothing of time, queues and logs,
which are the business of their host. Each state of a controller is a method that takes the level of
the present bit (0 dominant, 1 recessive), sets what the node sends in the next one (`drive`) and
chooses the next state (`step`).
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Final, Protocol

from fieldbus.can.bitstream import FrameImage, FrameParser, image_of
from fieldbus.can.confinement import (
    BUS_OFF_LIMIT,
    DELIMITER_BITS,
    FLAG_BITS,
    REC_LIMIT,
    RECOVERY_SEQUENCE_BITS,
    SUSPEND_BITS,
    ErrorCode,
    NodeState,
    rec_after_reception,
)
from fieldbus.can.frame import CanFrame
from fieldbus.can.port import Entry, MediumPort
from fieldbus.can.timing import INTERMISSION_BITS

_EOF_BITS: Final = 7
_TOLERATED_DOMINANT: Final = (
    8  # the 8th dominant bit after a flag counts, and every 8th from there on (CANP-050)
)


_FIELD_OF_STATE: Final = {
    name: name for name in ("crc_delimiter", "ack_slot", "ack_delimiter", "eof", "delimiter", "flag")
}


class Host(Protocol):
    """What follows the actions of a controller."""

    def frame_started(self, controller: Controller) -> None:
        """Follow a SOF that the node has read without sending it."""

    def frame_to_send(self, controller: Controller) -> Entry | None:
        """Return the frame with which the node joins in after a SOF in the
        intermission; None when it has none.
        """

    def lost_arbitration(self, controller: Controller, entry: Entry) -> None:
        """Take back `entry`."""

    def attempt_failed(self, controller: Controller, entry: Entry) -> None:
        """Take back `entry`, which ended in an error."""

    def error_found(self, controller: Controller, code: ErrorCode, field: str, entry: Entry | None) -> None:
        """Follow an error that the node has detected, while it was sending
        `entry`; the counters are up to date.
        """

    def counted(self, controller: Controller) -> None:
        """Follow a change of the error counters."""

    def frame_sent(self, controller: Controller, entry: Entry) -> None:
        """Follow a successful transmission."""

    def frame_received(self, controller: Controller, frame: CanFrame) -> None:
        """Follow a good reception."""

    def overload_started(self, controller: Controller, *, own: bool) -> None:
        """Follow an overload flag, sent by own wish or in answer to a dominant bit."""

    def quiet_sequence(self, controller: Controller) -> None:
        """Follow 11 recessive bits that a bus-off node has seen."""


class Controller:
    """The data link layer of one node.

    Args:
        host: Follows what the node does.
        port: Holds counters and error state.
        silent: Never sends unless it transmits a frame: no acknowledge, no flags,
            nothing is counted as receiver.
        on_fd: Whether there are frames of CAN FD on the segment. A controller that knows none then finds a
            form error in the recessive bit FDF (CANP-076).

    """

    def __init__(self, host: Host, port: MediumPort, *, silent: bool, on_fd: bool = False) -> None:
        self.host = host
        self.port = port
        self.silent = silent
        self._on_fd = on_fd
        self._expected: FrameImage | None = None
        """CAN FD: the frame received up to the end of the data, with the checksum that it has to have."""
        self._parser = FrameParser()
        self.drive = 1
        """What the node sends in the present bit."""
        self.step: Callable[[int], None] = self.idle
        """Takes the level of the present bit."""
        self.n = 0
        """Bits passed in the present field."""
        self.transmitter = False
        """Whether it sent the present or the last frame; until the next SOF."""
        self.entry: Entry | None = None
        """The frame that it transmits."""
        self.image: FrameImage | None = None
        self.index = 0
        """Position on the wire in the present frame."""
        self._arbitrating = False
        self._overloads = 0
        self.ack_only = False
        """Whether it is error-passive and has found nothing but a missing acknowledge."""
        self._error_flag = False
        self.begin_frame()

    # ----------------------------------------------------------------------------------------- between frames

    def idle(self, bit: int) -> None:
        """Bus idle."""
        if not bit:
            self._start_of_frame(None)

    def may_start(self) -> bool:
        """Return whether the node can send SOF in the next bit."""
        return self.step == self.idle

    def begin(self, entry: Entry) -> None:
        """Send the SOF of `entry` in the next bit."""
        self._take(entry)
        self.begin_frame()
        self.drive = 0
        self.step = self.frame

    def _start_of_frame(self, entry: Entry | None) -> None:
        """Take the dominant bit just read for SOF; a node with a frame joins in
        from the first identifier bit on.
        """
        self.host.frame_started(self)
        self._take(entry)
        self.begin_frame()
        self.step = self.frame
        self.frame(0)

    def _take(self, entry: Entry | None) -> None:
        self.entry = entry
        self.image = None if entry is None else image_of(entry[3])
        self._arbitrating = self.transmitter = entry is not None
        self._overloads = 0

    def integrate(self) -> None:
        """Join a running segment: 11 recessive bits, then the bus is idle."""
        self.drive = 1
        self.n = 0
        self.transmitter = False
        self.entry = self.image = None
        self.step = self.integrating

    def integrating(self, bit: int) -> None:
        """Wait for 11 recessive bits."""
        self.n = self.n + 1 if bit else 0
        if self.n == RECOVERY_SEQUENCE_BITS:
            self.step = self.idle

    def go_off(self, recessive: int = 0) -> None:
        """Bus-off: send nothing, count sequences of 11 recessive bits, of which `recessive` are past."""
        self.drive = 1
        self.n = recessive
        self.transmitter = False
        self.entry = self.image = None
        self.step = self.off

    def off(self, bit: int) -> None:
        """Bus-off."""
        self.n = self.n + 1 if bit else 0
        if self.n == RECOVERY_SEQUENCE_BITS:
            self.n = 0
            self.host.quiet_sequence(self)

    def begin_intermission(self, passed: int = 0) -> None:
        """Three recessive bits, or an overload flag if the node wants one (CANP-041)."""
        self.drive = 1
        self.n = passed
        self.step = self.intermission
        if not passed and self._overloads:
            self._overloads -= 1
            self._begin_overload(own=True)

    def intermission(self, bit: int) -> None:
        """Intermission; dominant in its third bit is the SOF of the next frame (CANP-027, -041)."""
        self.n += 1
        if bit:
            if self.n == INTERMISSION_BITS:
                if self.transmitter and self.port.state is NodeState.ERROR_PASSIVE:
                    self.n = 0
                    self.step = self.suspended
                else:
                    self.step = self.idle
        elif self.n < INTERMISSION_BITS:
            self._begin_overload(own=False)
        elif self.transmitter and self.port.state is NodeState.ERROR_PASSIVE:
            self._start_of_frame(None)
        else:
            self._start_of_frame(self.host.frame_to_send(self))

    def suspend(self, left: int) -> None:
        """Suspend transmission with `left` bits to go."""
        self.transmitter = True
        self.n = SUSPEND_BITS - left
        self.step = self.suspended

    def suspended(self, bit: int) -> None:
        """Suspend transmission of an error-passive transmitter; it receives what others start (CANP-042)."""
        self.n += 1
        if not bit:
            self._start_of_frame(None)
        elif self.n == SUSPEND_BITS:
            self.step = self.idle

    # --------------------------------------------------------------------------------------------- SOF to CRC

    def begin_frame(self) -> None:
        """Expect SOF."""
        self._parser.begin_frame()
        self.index = self._run = 0
        self._last = -1
        self._stuff_due = False

    def frame(self, bit: int) -> None:
        """Stuffed region, as transmitter or receiver."""
        index = self.index
        self.index = following = index + 1
        image = self.image
        parser = self._parser
        if image is not None:
            if image.bits[index] != bit:
                if self._arbitrating and not bit and 0 < index < image.arbitration_end:
                    if index in image.stuff:
                        self._fail(ErrorCode.STUFF, excused=True)
                        return
                    assert self.entry is not None
                    self.host.lost_arbitration(self, self.entry)
                    self.entry = self.image = image = None
                    self.transmitter = self._arbitrating = False
                else:
                    self._fail(ErrorCode.BIT)
                    return
            if image is not None:
                self.drive = image.bits[following] if following < len(image.bits) else 1
        if image is None:
            self.drive = 1
        if self._stuff_due:
            if bit == self._last:
                self._fail(ErrorCode.STUFF)
                return
            self._stuff_due = False
            self._last, self._run = bit, 1
        else:
            if bit == self._last:
                self._run += 1
                self._stuff_due = self._run == FLAG_BITS - 1
            else:
                self._last, self._run = bit, 1
            parser.parse(bit)
            if bit and self._on_fd and parser.at_fdf():
                self._format_is_fd()
                return
        if parser.taken >= parser.total and not self._stuff_due:
            self.step = self.crc_delimiter

    def _format_is_fd(self) -> None:
        if self.port.classic_only:
            self._fail(ErrorCode.FORM)
            return
        self._parser.begin_fd()
        self._expected = None
        self.step = self.fd_frame

    @property
    def fast(self) -> bool:
        """Whether the node transmits and its present bit has the data bit rate of CAN FD."""
        image = self.image
        if image is None or not image.fast:
            return False
        return (self.step == self.fd_frame and self.index in image.fast) or self.step == self.crc_delimiter

    def fd_frame(self, bit: int) -> None:
        """CAN FD from behind FDF to the checksum, as transmitter or receiver (CANP-073, CANP-075)."""
        index = self.index
        self.index = following = index + 1
        image = self.image
        if image is not None:
            if image.bits[index] != bit:
                self._fail(ErrorCode.BIT)
                return
            self.drive = image.bits[following] if following < len(image.bits) else 1
        expected = self._expected
        if expected is None:
            self._fd_bit(bit)
            return
        if index in expected.fixed:
            if bit == self._last:
                self._fail(ErrorCode.FORM)
                return
        elif expected.bits[index] != bit:
            self._parser.crc = 1
        self._last = bit
        if following == len(expected.bits):
            self.step = self.crc_delimiter

    def _fd_bit(self, bit: int) -> None:
        """Take a bit up to the end of the data."""
        parser = self._parser
        if self._stuff_due:
            if bit == self._last:
                self._fail(ErrorCode.STUFF)
                return
            self._stuff_due = False
            self._last, self._run = bit, 1
        else:
            if bit == self._last:
                self._run += 1
                self._stuff_due = self._run == FLAG_BITS - 1
            else:
                self._last, self._run = bit, 1
            parser.parse_fd(bit)
        if parser.taken >= parser.total:
            # The rest depends on all before: who has read a bit wrongly expects another checksum.
            self._expected = image_of(parser.received_frame())
            parser.crc = 0

    # ----------------------------------------------------------------------------------- CRC delimiter to EOF

    def crc_delimiter(self, bit: int) -> None:
        """CRC delimiter, then the acknowledge of a receiver that computes the same CRC."""
        if not bit:
            self._fail(ErrorCode.FORM)
            return
        self.step = self.ack_slot
        if not (self.transmitter or self._parser.crc or self.silent or not self.port.acknowledges):
            self.drive = 0

    def ack_slot(self, bit: int) -> None:
        """ACK slot."""
        self.drive = 1
        if self.transmitter and bit:
            self._fail(ErrorCode.ACK)
            return
        self.step = self.ack_delimiter

    def ack_delimiter(self, bit: int) -> None:
        """ACK delimiter, after which a receiver signals a CRC error (CANP-035)."""
        if not bit:
            self._fail(ErrorCode.FORM)
        elif self._parser.crc and not self.transmitter:
            self._fail(ErrorCode.CRC)
        else:
            self.n = 0
            self.step = self.eof

    def eof(self, bit: int) -> None:
        """End of frame; its last bit matters to the transmitter only (CANP-013)."""
        self.n += 1
        if not bit and (self.transmitter or self.n < _EOF_BITS):
            self._fail(ErrorCode.FORM)
            return
        if self.n < _EOF_BITS:
            return
        entry = self.entry
        port = self.port
        if entry is not None:
            self.entry = self.image = None
            if port.tec:
                port.tec -= 1
                self.host.counted(self)
            self.host.frame_sent(self, entry)
        elif not self.transmitter:  # one whose frame was taken away has nothing to report
            if port.rec and not self.silent:
                port.rec = rec_after_reception(port.rec)
                self.host.counted(self)
            self._overloads = 0 if self.silent else port.overload_frames
            self.host.frame_received(self, self._parser.received_frame())
        if bit:
            self.begin_intermission()
        else:
            self._begin_overload(own=False)

    # --------------------------------------------------------------------------------------------- errors

    def _field(self) -> str:
        """Return the name of the field of the present bit."""
        step = self.step
        if step in (self.frame, self.fd_frame):
            if self.image is not None:
                return self.image.fields[self.index - 1]
            return self._parser.field()
        return _FIELD_OF_STATE.get(step.__name__, "")

    def _fail(self, code: ErrorCode, *, excused: bool = False, in_flag: bool = False) -> None:
        """Count an error and send an error flag from the next bit on."""
        port = self.port
        field = self._field()
        # An error that makes the node passive is still signalled with an active flag (CANP-053).
        active = port.state is NodeState.ERROR_ACTIVE
        entry = self.entry
        self.ack_only = False
        if self.transmitter:
            if code is ErrorCode.ACK and not active:
                self.ack_only = True  # counts only if a dominant bit is seen during the flag (CANP-046)
            elif not excused:
                port.tec = min(port.tec + 8, BUS_OFF_LIMIT)
        elif not self.silent:
            port.rec = min(port.rec + (8 if in_flag else 1), REC_LIMIT)
        else:
            active = False
        self.entry = self.image = None
        self.host.error_found(self, code, field, entry)
        if entry is not None:
            self.host.attempt_failed(self, entry)
        self.host.counted(self)
        if self.step == self.off:
            return
        self.n = 0
        self._error_flag = True
        if active:
            self.drive = 0
            self.step = self.flag
        else:
            self.drive = 1
            self._last = -1
            self.step = self.passive_flag

    def _begin_overload(self, *, own: bool) -> None:
        self.host.overload_started(self, own=own)
        self.n = 0
        self._error_flag = False
        self.ack_only = False
        if self.silent:
            self.drive = 1
            self._last = -1
            self.step = self.passive_flag
        else:  # dominant in error passive, too
            self.drive = 0
            self.step = self.flag

    def flag(self, bit: int) -> None:
        """Active error flag or overload flag."""
        if bit:
            self._fail(ErrorCode.BIT, in_flag=True)
            return
        self.n += 1
        if self.n == FLAG_BITS:
            self._end_flag()

    def passive_flag(self, bit: int) -> None:
        """Passive error flag: over when six equal bits have been read (CANP-039)."""
        if not bit and self.ack_only:
            self.ack_only = False
            self.port.tec = min(self.port.tec + 8, BUS_OFF_LIMIT)
            self.host.counted(self)
            if self.step == self.off:
                return
        self.n = self.n + 1 if bit == self._last else 1
        self._last = bit
        if self.n == FLAG_BITS:
            self._end_flag()

    def _end_flag(self) -> None:
        self.drive = 1
        self.n = 0
        self.step = self.after_flag

    def after_flag(self, bit: int) -> None:
        """Wait for the first recessive bit, which is the first of the delimiter (CANP-040, -044, -050)."""
        if bit:
            self.n = 1
            self.step = self.delimiter
            return
        self.n += 1
        if self.transmitter:
            if self.n % _TOLERATED_DOMINANT == 0:
                self.port.tec = min(self.port.tec + 8, BUS_OFF_LIMIT)
                self.host.counted(self)
        elif not self.silent:
            worse = 8 * (self.n == 1 and self._error_flag) + 8 * (self.n % _TOLERATED_DOMINANT == 0)
            if worse:
                self.port.rec = min(self.port.rec + worse, REC_LIMIT)
                self.host.counted(self)

    def delimiter(self, bit: int) -> None:
        """Error or overload delimiter."""
        self.n += 1
        if not bit:
            if self.n < DELIMITER_BITS:
                self._fail(ErrorCode.FORM)
            else:
                self._begin_overload(own=False)
        elif self.n == DELIMITER_BITS:
            self.begin_intermission()
