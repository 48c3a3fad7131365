"""Frames of this package as messages of python-can, and back; error frames in the SocketCAN encoding."""

from __future__ import annotations

from typing import Final

import can

from fieldbus.can.confinement import ErrorCode, NodeState
from fieldbus.can.fd import NO_FD, check_fd
from fieldbus.can.frame import CanFrame
from fieldbus.can.timing import frame_bits
from fieldbus.errors import BusError

# Error classes (identifier) and details (data bytes 1 to 3) as in linux/can/error.h.
ERROR_CONTROLLER: Final = 0x004
ERROR_PROTOCOL: Final = 0x008
ERROR_ACK: Final = 0x020
ERROR_BUS_OFF: Final = 0x040
ERROR_BUS: Final = 0x080
ERROR_RESTARTED: Final = 0x100
ERROR_FLAG: Final = 0x2000_0000

_CONTROLLER_PASSIVE: Final = 0x10 | 0x20
_CONTROLLER_ACTIVE: Final = 0x40
_PROTOCOL: Final = {ErrorCode.BIT: 0x01, ErrorCode.FORM: 0x02, ErrorCode.STUFF: 0x04, ErrorCode.CRC: 0x00}
_SENDING: Final = 0x80
_CRC_LOCATION: Final = 0x08
_ACK_LOCATION: Final = 0x19
_LOCATIONS: Final = {
    "sof": 0x03,
    "id": 0x02,
    "srr": 0x04,
    "rtr": 0x0C,
    "ide": 0x05,
    "id_extension": 0x07,
    "reserved": 0x09,
    "dlc": 0x0B,
    "data": 0x0A,
    "crc": _CRC_LOCATION,
    "crc_delimiter": 0x18,
    "ack_slot": _ACK_LOCATION,
    "ack_delimiter": 0x1B,
    "eof": 0x1A,
}


def to_message(
    frame: CanFrame, *, time_s: float = 0.0, channel: str | None = None, is_rx: bool = True
) -> can.Message:
    """Return `frame` as a message; a DLC above 8 becomes the number of bytes, which python-can counts."""
    if frame.fd:
        return can.Message(
            timestamp=time_s,
            arbitration_id=frame.can_id,
            is_extended_id=frame.extended,
            dlc=len(frame.data),
            data=frame.data,
            channel=channel,
            is_rx=is_rx,
            is_fd=True,
            bitrate_switch=frame.brs,
            error_state_indicator=frame.esi,
        )
    return can.Message(
        timestamp=time_s,
        arbitration_id=frame.can_id,
        is_extended_id=frame.extended,
        is_remote_frame=frame.remote,
        dlc=min(frame.dlc, 8),
        data=None if frame.remote else frame.data,
        channel=channel,
        is_rx=is_rx,
    )


def to_frame(message: can.Message, *, fd: bool = False) -> CanFrame:
    """Return a data or remote message as a frame.

    Args:
        message: The message.
        fd: Whether it may be one of CAN FD.

    Raises:
        BusError: It is an error frame, a CAN FD message without `fd`, or does not make a frame.

    """
    if message.is_error_frame:
        raise BusError("an error frame cannot be sent as a message")
    if message.is_fd:
        if not fd:
            raise BusError(NO_FD)
        frame = CanFrame(
            message.arbitration_id,
            bytes(message.data),
            extended=message.is_extended_id,
            remote=message.is_remote_frame,
            fd=True,
            brs=message.bitrate_switch,
            esi=message.error_state_indicator,
        )
        check_fd(frame)
        return frame
    frame = CanFrame(
        message.arbitration_id,
        b"" if message.is_remote_frame else bytes(message.data),
        extended=message.is_extended_id,
        remote=message.is_remote_frame,
        dlc=message.dlc,
    )
    frame_bits(frame)  # validates
    return frame


def logged_frame(message: can.Message) -> CanFrame:
    """Return a message from a log file as a frame, of CAN FD too.

    The reader of ASC files takes an empty frame of CAN FD for a remote one, which CAN FD does not have.

    Raises:
        BusError: It is an error frame, or does not make a frame.

    """
    if message.is_fd and message.is_remote_frame and not message.dlc:
        message.is_remote_frame = False
    return to_frame(message, fd=True)


def error_message(
    code: ErrorCode,
    *,
    time_s: float = 0.0,
    channel: str | None = None,
    tec: int = 0,
    rec: int = 0,
    field: str = "",
    sending: bool = False,
) -> can.Message:
    """Return the error frame that SocketCAN reports for `code`.

    Args:
        code: What went wrong.
        time_s: Time stamp, s.
        channel: Name of the bus.
        tec: Transmit error counter, as data byte 6.
        rec: Receive error counter, as data byte 7.
        field: Where in the frame; one of `fieldbus.can.bitstream.FIELDS`, empty: not known.
        sending: Whether the node that found the error was sending.

    """
    data = bytearray(8)
    if code is ErrorCode.ACK:
        error_class = ERROR_ACK | ERROR_BUS
        data[3] = _ACK_LOCATION
    else:
        error_class = ERROR_PROTOCOL | ERROR_BUS
        data[2] = _PROTOCOL[code] | (_SENDING if sending else 0)
        data[3] = _CRC_LOCATION if code is ErrorCode.CRC else _LOCATIONS.get(field, 0)
    return _error(error_class, data, time_s, channel, (tec, rec))


def status_message(
    state: NodeState, *, time_s: float = 0.0, channel: str | None = None, tec: int = 0, rec: int = 0
) -> can.Message:
    """Return the error frame that SocketCAN reports for a change to `state`."""
    data = bytearray(8)
    if state is NodeState.BUS_OFF:
        return _error(ERROR_BUS_OFF, data, time_s, channel, (tec, rec))
    data[1] = _CONTROLLER_PASSIVE if state is NodeState.ERROR_PASSIVE else _CONTROLLER_ACTIVE
    return _error(ERROR_CONTROLLER, data, time_s, channel, (tec, rec))


def _error(
    error_class: int, data: bytearray, time_s: float, channel: str | None, counters: tuple[int, int]
) -> can.Message:
    data[6], data[7] = (min(counter, 255) for counter in counters)
    return can.Message(
        timestamp=time_s,
        arbitration_id=error_class,
        is_extended_id=False,
        is_error_frame=True,
        dlc=8,
        data=data,
        channel=channel,
    )


def read_error(message: can.Message) -> tuple[str, NodeState | None]:
    """Return what an error frame says: the name of the error ("" = none, or not
    known) and the new state, if any.
    """
    error_class = message.arbitration_id
    data = bytes(message.data).ljust(8, b"\x00")
    code = ""
    if error_class & ERROR_ACK:
        code = ErrorCode.ACK.value
    elif error_class & ERROR_PROTOCOL:
        details = [kind.value for kind, bit in _PROTOCOL.items() if bit and data[2] & bit]
        code = details[0] if details else ErrorCode.CRC.value if data[3] == _CRC_LOCATION else ""
    state = None
    if error_class & ERROR_BUS_OFF:
        state = NodeState.BUS_OFF
    elif error_class & ERROR_CONTROLLER and data[1] & _CONTROLLER_PASSIVE:
        state = NodeState.ERROR_PASSIVE
    elif (error_class & ERROR_CONTROLLER and data[1] & _CONTROLLER_ACTIVE) or error_class & ERROR_RESTARTED:
        state = NodeState.ERROR_ACTIVE
    return code, state
