"""The protocol of serial-line CAN adapters (Lawicel CAN232 and all that speak like it): bytes in, bytes out.

A command is a letter, its arguments in hexadecimal digits, and CR. The answer is CR, or something and CR, for
what was done, and BELL for what was not: an unknown command, wrong digits, or the wrong state of the channel.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from enum import IntFlag, StrEnum
from typing import Final

from emulators.adapter._acceptance import AcceptanceFilter
from fieldbus.can.frame import CanFrame
from fieldbus.clock import MS

OK: Final = b"\r"
BELL: Final = b"\a"

BITRATES: Final = {
    0: 10_000, 1: 20_000, 2: 50_000, 3: 100_000, 4: 125_000, 5: 250_000, 6: 500_000, 7: 800_000, 8: 1_000_000,
}  # fmt: skip
"""Arguments of `S`, bit/s."""

_LONGEST: Final = 64
"""Characters that can make a command; the longest real one has 26."""
_RECEIVE_DEPTH: Final = 32
_TRANSMIT_DEPTH: Final = 8
_STAMP_MS: Final = 60_000
_HEX: Final = frozenset(b"0123456789abcdefABCDEF")


class ChannelState(StrEnum):
    """State of the CAN channel."""

    CLOSED = "closed"
    OPEN = "open"
    LISTENING = "listen-only"


class StatusFlag(IntFlag):
    """Bits of the answer to `F`; reading clears those that report something past."""

    RECEIVE_FULL = 0x01
    TRANSMIT_FULL = 0x02
    WARNING = 0x04
    OVERRUN = 0x08
    PASSIVE = 0x20
    ARBITRATION_LOST = 0x40
    BUS_ERROR = 0x80


class SlcanAdapter:
    """The state machine of the adapter. It does no input or output and knows no time but what it is given.

    Args:
        transmit: Called with a frame for the bus; returns whether the bus has taken it.
        bitrate: Bit rate of the bus, bit/s; None: unknown, any is right. With another one the adapter
            understands nothing on the bus and nobody understands it.
        auto_poll: Whether received frames are sent unasked (`X1`) after power-on, as adapters on USB do.
        version: Hardware and software version, two digits each.
        serial_number: Four characters.
        on_state: Called with every new state of the channel.

    """

    def __init__(
        self,
        transmit: Callable[[CanFrame], bool],
        *,
        bitrate: int | None = None,
        auto_poll: bool = True,
        version: str = "1013",
        serial_number: str = "H1L0",
        on_state: Callable[[ChannelState], None] | None = None,
    ) -> None:
        self.state = ChannelState.CLOSED
        self.status = StatusFlag(0)
        self.channel_bitrate: int | None = None
        """Bit rate that the program has set, bit/s; None: not set up, the channel cannot be opened."""
        self.auto_poll = auto_poll
        self.time_stamps = False
        self.filter = AcceptanceFilter()
        self.rejected = 0
        """Commands that were answered with BELL."""
        self._transmit = transmit
        self._bitrate = bitrate
        self._version = version
        self._serial_number = serial_number
        self._on_state = on_state
        self._line = bytearray()
        self._overlong = False
        self._stuck = 0
        self._queue: deque[bytes] = deque()

    # ---------------------------------------------------------------------------------------- the serial side

    def feed(self, data: bytes) -> bytes:
        """Take bytes of the program, in pieces of any size, and return the answers."""
        answers = bytearray()
        for byte in data:
            if byte == 0x0D:
                answers += self._command(bytes(self._line))
                self._line.clear()
                self._overlong = False
            elif byte == 0x0A:
                continue  # from programs that end lines with CR LF
            elif len(self._line) < _LONGEST:
                self._line.append(byte)
            else:
                self._overlong = True
        return bytes(answers)

    def _command(self, line: bytes) -> bytes:
        if not line:
            return OK
        answer = None
        if not self._overlong and line.isascii():
            handler = _HANDLERS.get(line[:1])
            if handler is not None:
                answer = handler(self, line[1:])
        if answer is None:
            self.rejected += 1
            return BELL
        return answer

    # Each returns the answer, or None for BELL.

    def _set_bitrate(self, argument: bytes) -> bytes | None:
        number = _number(argument, 1)
        if number not in BITRATES or self.state is not ChannelState.CLOSED:
            return None
        self.channel_bitrate = BITRATES[number]
        return OK

    def _set_timing(self, argument: bytes) -> bytes | None:
        """`sxxyy`: bus timing registers of the SJA1000 at 16 MHz."""
        registers = _number(argument, 4)
        if registers is None or self.state is not ChannelState.CLOSED:
            return None
        prescaler = (registers >> 8 & 0x3F) + 1
        quanta = 3 + (registers & 0xF) + (registers >> 4 & 0x7)
        self.channel_bitrate = 8_000_000 // (prescaler * quanta)
        return OK

    def _open(self, argument: bytes) -> bytes | None:
        return self._enter(ChannelState.OPEN, argument)

    def _listen(self, argument: bytes) -> bytes | None:
        return self._enter(ChannelState.LISTENING, argument)

    def _enter(self, state: ChannelState, argument: bytes) -> bytes | None:
        if argument or self.state is not ChannelState.CLOSED or self.channel_bitrate is None:
            return None
        self.status = StatusFlag(0)
        self._change(state)
        return OK

    def _close(self, argument: bytes) -> bytes | None:
        if argument or self.state is ChannelState.CLOSED:
            return None
        self._queue.clear()
        self._stuck = 0
        self._change(ChannelState.CLOSED)
        return OK

    def _change(self, state: ChannelState) -> None:
        self.state = state
        if self._on_state is not None:
            self._on_state(state)

    def _send_standard(self, argument: bytes) -> bytes | None:
        return self._send(argument, digits=3, remote=False)

    def _send_extended(self, argument: bytes) -> bytes | None:
        return self._send(argument, digits=8, remote=False)

    def _request_standard(self, argument: bytes) -> bytes | None:
        return self._send(argument, digits=3, remote=True)

    def _request_extended(self, argument: bytes) -> bytes | None:
        return self._send(argument, digits=8, remote=True)

    def _send(self, argument: bytes, *, digits: int, remote: bool) -> bytes | None:
        if self.state is not ChannelState.OPEN:
            return None
        extended = digits == 8
        can_id, dlc = _number(argument[:digits], digits), _number(argument[digits : digits + 1], 1)
        if can_id is None or dlc is None or dlc > 8 or can_id > (0x1FFF_FFFF if extended else 0x7FF):
            return None
        body = argument[digits + 1 :]
        if len(body) != (0 if remote else 2 * dlc) or not _HEX.issuperset(body):
            return None
        frame = CanFrame(
            can_id, bytes.fromhex(body.decode("ascii")), extended=extended, remote=remote, dlc=dlc
        )
        if not self._hand_over(frame):
            return None
        if not self.auto_poll:
            return OK
        return b"Z\r" if extended else b"z\r"

    def _hand_over(self, frame: CanFrame) -> bool:
        """Put a frame into the transmit queue; one that the bus never acknowledges stays there."""
        if self._deaf:
            if self._stuck >= _TRANSMIT_DEPTH:
                self.status |= StatusFlag.TRANSMIT_FULL
                return False
            self._stuck += 1
            self.status |= StatusFlag.BUS_ERROR | StatusFlag.WARNING | StatusFlag.PASSIVE
            return True
        if self._transmit(frame):
            return True
        self.status |= StatusFlag.TRANSMIT_FULL
        return False

    def _poll(self, argument: bytes) -> bytes | None:
        if argument or self.state is ChannelState.CLOSED or self.auto_poll:
            return None
        return self._queue.popleft() if self._queue else OK

    def _poll_all(self, argument: bytes) -> bytes | None:
        if argument or self.state is ChannelState.CLOSED or self.auto_poll:
            return None
        frames = b"".join(self._queue)
        self._queue.clear()
        return frames + b"A\r"

    def _read_status(self, argument: bytes) -> bytes | None:
        if argument or self.state is ChannelState.CLOSED:
            return None
        status, self.status = self.status, StatusFlag(0)
        return b"F%02X\r" % int(status)

    def _set_auto_poll(self, argument: bytes) -> bytes | None:
        number = _number(argument, 1)
        if number not in (0, 1) or self.state is not ChannelState.CLOSED:
            return None
        self.auto_poll = bool(number)
        return OK

    def _set_time_stamps(self, argument: bytes) -> bytes | None:
        number = _number(argument, 1)
        if number not in (0, 1) or self.state is not ChannelState.CLOSED:
            return None
        self.time_stamps = bool(number)
        return OK

    def _set_filter_mode(self, argument: bytes) -> bytes | None:
        number = _number(argument, 1)
        if number not in (0, 1) or self.state is not ChannelState.CLOSED:
            return None
        self.filter.single = bool(number)
        return OK

    def _set_code(self, argument: bytes) -> bytes | None:
        code = _number(argument, 8)
        if code is None or self.state is not ChannelState.CLOSED:
            return None
        self.filter.code = code
        return OK

    def _set_mask(self, argument: bytes) -> bytes | None:
        mask = _number(argument, 8)
        if mask is None or self.state is not ChannelState.CLOSED:
            return None
        self.filter.mask = mask
        return OK

    def _set_line_speed(self, argument: bytes) -> bytes | None:
        """`Un`: taken, and without effect on a line that has no speed."""
        number = _number(argument, 1)
        return OK if number is not None and number <= 6 and self.state is ChannelState.CLOSED else None

    def _set_start_up(self, argument: bytes) -> bytes | None:
        """`Qn`: taken; this adapter is never without supply, so it never starts up."""
        number = _number(argument, 1)
        return OK if number is not None and number <= 2 and self.state is not ChannelState.CLOSED else None

    def _tell_version(self, argument: bytes) -> bytes | None:
        return None if argument else b"V" + self._version.encode("ascii") + OK

    def _tell_serial_number(self, argument: bytes) -> bytes | None:
        return None if argument else b"N" + self._serial_number.encode("ascii") + OK

    # ------------------------------------------------------------------------------------------- the CAN side

    @property
    def _deaf(self) -> bool:
        """Whether the channel runs at another bit rate than the bus."""
        return self._bitrate is not None and self.channel_bitrate != self._bitrate

    def deliver(self, frame: CanFrame, time_ns: int, *, free: int) -> bytes:
        """Take a frame of the bus and return what goes to the program now.

        Args:
            frame: The frame.
            time_ns: When it came.
            free: Bytes that the line can take at this moment; what does not fit is lost and flagged.

        """
        if self.state is ChannelState.CLOSED:
            return b""
        if self._deaf:
            self.status |= StatusFlag.BUS_ERROR
            return b""
        if not self.filter.accepts(frame):
            return b""
        text = self._text(frame, time_ns)
        if self.auto_poll:
            if len(text) <= free:
                return text
        elif len(self._queue) < _RECEIVE_DEPTH:
            self._queue.append(text)
            return b""
        self.status |= StatusFlag.RECEIVE_FULL | StatusFlag.OVERRUN
        return b""

    def _text(self, frame: CanFrame, time_ns: int) -> bytes:
        letter = ("t", "T", "r", "R")[frame.extended + 2 * frame.remote]
        width = 8 if frame.extended else 3
        text = f"{letter}{frame.can_id:0{width}X}{min(frame.dlc, 8)}{frame.data.hex().upper()}"
        if self.time_stamps:
            text += f"{time_ns // MS % _STAMP_MS:04X}"
        return text.encode("ascii") + OK


def _number(digits: bytes, count: int) -> int | None:
    """Return exactly `count` hexadecimal digits as a number, or None for anything else."""
    if len(digits) != count or not _HEX.issuperset(digits):
        return None
    return int(digits, 16)


_HANDLERS: Final[dict[bytes, Callable[[SlcanAdapter, bytes], bytes | None]]] = {
    b"S": SlcanAdapter._set_bitrate,  # noqa: SLF001 - the table of the class
    b"s": SlcanAdapter._set_timing,  # noqa: SLF001
    b"O": SlcanAdapter._open,  # noqa: SLF001
    b"L": SlcanAdapter._listen,  # noqa: SLF001
    b"C": SlcanAdapter._close,  # noqa: SLF001
    b"t": SlcanAdapter._send_standard,  # noqa: SLF001
    b"T": SlcanAdapter._send_extended,  # noqa: SLF001
    b"r": SlcanAdapter._request_standard,  # noqa: SLF001
    b"R": SlcanAdapter._request_extended,  # noqa: SLF001
    b"P": SlcanAdapter._poll,  # noqa: SLF001
    b"A": SlcanAdapter._poll_all,  # noqa: SLF001
    b"F": SlcanAdapter._read_status,  # noqa: SLF001
    b"X": SlcanAdapter._set_auto_poll,  # noqa: SLF001
    b"Z": SlcanAdapter._set_time_stamps,  # noqa: SLF001
    b"W": SlcanAdapter._set_filter_mode,  # noqa: SLF001
    b"M": SlcanAdapter._set_code,  # noqa: SLF001
    b"m": SlcanAdapter._set_mask,  # noqa: SLF001
    b"U": SlcanAdapter._set_line_speed,  # noqa: SLF001
    b"Q": SlcanAdapter._set_start_up,  # noqa: SLF001
    b"V": SlcanAdapter._tell_version,  # noqa: SLF001
    b"N": SlcanAdapter._tell_serial_number,  # noqa: SLF001
}
