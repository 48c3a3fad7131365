"""Bus logs as files that other tools read, and their files as frames.

A log that starts at time zero is put on a Unix epoch, because formats and tools take times in the first
decades of the epoch for relative ones. Times are exact to a microsecond in candump and ASC files and to a
nanosecond in BLF files, as far as the reader's floating-point seconds go (about 0.1 us).
"""

from __future__ import annotations

import struct
import zlib
from collections.abc import Iterable, Iterator
from datetime import datetime
from pathlib import Path
from typing import Final

import can
from can.io.blf import BLFParseError

from fieldbus.can.capture import CAPTURES, read_capture, write_capture
from fieldbus.can.confinement import ErrorCode
from fieldbus.can.frame import CanFrame
from fieldbus.can.frame_log import LogEntry
from fieldbus.can.message import ERROR_BUS, ERROR_FLAG, error_message, logged_frame, to_message
from fieldbus.clock import S
from fieldbus.errors import BusError, ConfigurationError

EPOCH_S: Final = 946_684_800.0
"""2000-01-01T00:00:00Z, the default time of bench time zero."""

_READ_ERRORS: Final = (
    OSError,
    ValueError,
    LookupError,
    struct.error,
    zlib.error,
    BLFParseError,
    can.CanError,
)
_FORMATS: Final = ".log (candump), .asc (Vector ASCII), .blf (Vector binary), .pcap or .pcapng"


def write_log(
    log: Iterable[LogEntry], path: str | Path, *, channel: str = "can0", epoch_s: float = EPOCH_S
) -> Path:
    """Write the log of a segment; the suffix of `path` says in which format.

    Attempts that failed are written as error frames. Names of senders are in no format.

    Args:
        log: `CanMedium.log`, `LiveSegment.log`, or a part of it.
        path: File with the suffix .log, .asc, .blf, .pcap or .pcapng; replaced if it exists.
        channel: Name of the bus, for candump and pcapng files.
        epoch_s: Unix time of bench time zero, whole seconds.

    Returns:
        `path`.

    Raises:
        ConfigurationError: Another suffix, or `epoch_s` is no whole second after 1990.

    """
    path = Path(path)
    if epoch_s != int(epoch_s) or epoch_s < 631_152_000:
        raise ConfigurationError("epoch_s", epoch_s, "whole seconds of Unix time after 1990-01-01")
    write = {
        ".log": _write_candump,
        ".asc": _write_asc,
        ".blf": _write_blf,
        **dict.fromkeys(CAPTURES, write_capture),
    }.get(path.suffix.lower())
    if write is None:
        raise ConfigurationError("path", str(path), f"a file name with the suffix {_FORMATS}")
    write(log, path, channel, int(epoch_s))
    return path


def _write_candump(log: Iterable[LogEntry], path: Path, channel: str, epoch_s: int) -> None:
    # Written here: the writer of python-can loses the DLC of remote frames and the kind of an error.
    with path.open("w", encoding="ascii") as file:
        for time_ns, _, frame, error in log:
            seconds, microseconds = divmod((time_ns + 500) // 1000, 1_000_000)
            if error:
                message = error_message(_code(error))
                identifier = f"{ERROR_FLAG | ERROR_BUS | message.arbitration_id:08X}"
                body = message.data.hex().upper()
            else:
                identifier = f"{frame.can_id:0{8 if frame.extended else 3}X}"
                body = f"R{frame.dlc or ''}" if frame.remote else frame.data.hex().upper()
                if frame.fd:
                    body = f"#{frame.brs | frame.esi << 1:X}{body}"
            file.write(f"({epoch_s + seconds}.{microseconds:06d}) {channel} {identifier}#{body}\n")


def _code(error: str) -> ErrorCode:
    return next((code for code in ErrorCode if code.value == error), ErrorCode.FORM)


def _messages(log: Iterable[LogEntry]) -> Iterator[can.Message]:
    """Return the messages of `log` with times from zero."""
    for time_ns, _, frame, error in log:
        # Half a nanosecond more, so that cutting off the fraction of whole nanoseconds gives back the number.
        message = to_message(frame, time_s=(time_ns + 0.5) / S)
        if error:
            message.is_error_frame = True
            message.is_remote_frame = False
        yield message


def _write_asc(log: Iterable[LogEntry], path: Path, _channel: str, epoch_s: int) -> None:
    # The format means local time without naming the zone.
    start = datetime.fromtimestamp(epoch_s).strftime("%a %b %d %H:%M:%S.000 %Y")  # noqa: DTZ006 - see above
    with path.open("w", encoding="ascii") as file:
        writer = can.ASCWriter(file, channel=1)
        # The writer's own header has the date of today, and its time zero is the first frame.
        file.seek(0)
        file.truncate()
        file.write(f"date {start}\nbase hex  timestamps absolute\ninternal events logged\n")
        file.write(f"Begin Triggerblock {start}\n 0.000000 Start of measurement\n")
        writer.header_written = True
        for message in _messages(log):
            writer(message)
        writer.stop()


def _write_blf(log: Iterable[LogEntry], path: Path, _channel: str, epoch_s: int) -> None:
    writer = can.BLFWriter(path)
    # Times are stored as nanoseconds from the start. With the epoch entered only into the header they keep
    # their digits.
    writer.start_timestamp = 0.0
    last_s = 0.0
    for message in _messages(log):
        last_s = message.timestamp
        writer(message)
    writer.start_timestamp = float(epoch_s)
    writer.stop_timestamp = epoch_s + last_s
    writer.stop()


def read_log(path: str | Path, *, origin_s: float | None = None) -> list[tuple[float, CanFrame]]:
    """Read the frames of a log file of any format that python-can knows by its suffix.

    Error frames are left out.

    Args:
        path: The file: .log, .asc, .blf, .trc, .csv, .pcap, .pcapng, ...
        origin_s: Unix time that becomes time zero; `EPOCH_S` gives the bench times of files written by
            `write_log`.
            Default: the first frame is at zero.

    Returns:
        Pairs of time (s) and frame, in the order of the file.

    Raises:
        BusError: The file cannot be read or holds what is no CAN log.

    """
    frames: list[tuple[float, CanFrame]] = []
    if Path(path).suffix.lower() in CAPTURES:
        return _read_capture(path, origin_s)
    first_s = origin_s
    options = {} if origin_s is None else {"relative_timestamp": False}
    try:
        with can.LogReader(path, **options) as reader:
            for message in reader:
                if message.is_error_frame:
                    continue
                if first_s is None:
                    first_s = message.timestamp
                frames.append((message.timestamp - first_s, logged_frame(message)))
    except (*_READ_ERRORS, BusError) as error:
        raise BusError(f"{path} cannot be read as a CAN log: {error}") from error
    return frames


def _read_capture(path: str | Path, origin_s: float | None) -> list[tuple[float, CanFrame]]:
    try:
        found = [(entry.time_ns, entry.frame) for entry in read_capture(path) if not entry.error]
    except OSError as error:
        raise BusError(f"{path} cannot be read as a CAN log: {error}") from error
    first_ns = (found[0][0] if found else 0) if origin_s is None else round(origin_s * S)
    return [((time_ns - first_ns) / S, frame) for time_ns, frame in found]
