"""Reading bus logs that other tools have written: candump, ASC, BLF and whatever else
python-can knows by its suffix.
"""

from __future__ import annotations

import re
import struct
import zlib
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final, NoReturn

from fieldbus.can.capture import CAPTURES, read_capture
from fieldbus.can.fd import check_fd
from fieldbus.can.frame import CanFrame
from fieldbus.clock import S
from fieldbus.errors import BusError
from hil.errors import CannotRunError
from hil.record import PackedFrames

BENCH_EPOCH_NS: Final = 946_684_800 * S
"""Unix time of time zero of a bench in the logs that this product writes (2000-01-01)."""
_BENCH_DAYS_NS: Final = 30 * 86_400 * S

FORMATS: Final = ".log (candump), .asc, .blf, .pcap, .pcapng, .trc, .csv, .mf4"
_LINE: Final = re.compile(
    r"\s*\((?P<seconds>\d+)\.(?P<fraction>\d{1,9})\)\s+(?P<channel>\S+)\s+"
    r"(?P<id>[0-9A-Fa-f]{3}|[0-9A-Fa-f]{8})#(?P<body>\S*)(?:\s+[RT])?\s*"
)
_REMOTE: Final = re.compile(r"R([0-8]?)")
_DATA: Final = re.compile(r"((?:[0-9A-Fa-f]{2}){0,8})(?:_([9A-Fa-f]))?")
_FD_DATA: Final = re.compile(r"#([0-9A-Fa-f])((?:[0-9A-Fa-f]{2}){0,64})")
_ON_SCREEN: Final = re.compile(r"\s*(\([^)]*\))?\s*\S+\s+[0-9A-Fa-f]{3,8}\s+\[\d+\]")
"""Time or none, channel, identifier, number of bytes in brackets."""
_ERROR_FLAG: Final = 0x20000000
_EXTENDED_DIGITS: Final = 8
_TENS: Final = tuple(10 ** (9 - digits) for digits in range(10))
"""Nanoseconds of the last digit of a fraction with so many digits."""

Stamped = Iterator[tuple[int, str, CanFrame, str]]
"""Stamp (ns), channel, frame, error (empty: none)."""
_ERROR_FRAME: Final = CanFrame(0)


@dataclass
class BusLog:
    """A log file: frames by channel, in the order of the file."""

    path: Path
    channels: dict[str, PackedFrames] = field(default_factory=dict)
    """Times are from time zero: that of the bench in logs of this product, else the first frame."""
    fd_frames: int = 0
    """CAN FD frames among them."""
    origin_ns: int = 0
    """Unix time of time zero; 0 where the file has relative times."""

    @property
    def frames(self) -> int:
        """Number of frames of all channels."""
        return sum(map(len, self.channels.values()))

    @property
    def end_ns(self) -> int:
        """Time of the last frame."""
        return max((log.last_ns for log in self.channels.values()), default=0)


def read_bus_log(path: str | Path) -> BusLog:
    """Read a log of CAN frames, one after the other: a long one takes 21 bytes a frame.

    Raises:
        CannotRunError: There is no such file, it is empty, cut off, no CAN log,
            or its timestamps go backwards.

    """
    path = Path(path)
    if not path.is_file():
        raise CannotRunError(f"{path}: there is no such file")
    if path.stat().st_size == 0:
        raise CannotRunError(f"{path} is empty")
    log = BusLog(path)
    suffix = path.suffix.lower()
    if suffix == ".log":
        stamped = _read_candump(log)
    else:
        stamped = _read_captured(log) if suffix in CAPTURES else _read_with_library(log)
    numbers: dict[str, int] = {}
    for number, (stamp_ns, channel, frame, error) in enumerate(stamped, start=1):
        frames = log.channels.get(channel)
        if frames is None:
            frames = log.channels[channel] = PackedFrames()
        elif stamp_ns < frames.last_ns:
            origin_ns = _origin(log)
            raise CannotRunError(
                f"{path}: timestamps go backwards: frame {number} of the file, on {channel}, is at "
                f"{(stamp_ns - origin_ns) / S:.6f} s, and frame {numbers[channel]} before it at "
                f"{(frames.last_ns - origin_ns) / S:.6f} s; where the clock was set, the parts before and "
                f"behind it are logs of their own"
            )
        frames.append(stamp_ns, frame, error)
        log.fd_frames += frame.fd
        numbers[channel] = number
    if not log.channels:
        raise CannotRunError(f"{path} holds no CAN frame")
    log.origin_ns = _origin(log)
    for frames in log.channels.values():
        frames.shift(-log.origin_ns)
    return log


def _origin(log: BusLog) -> int:
    """Return the stamp that is time zero: that of a bench in logs of this
    product, else the first frame, or 0.
    """
    first = min(frames.first_ns for frames in log.channels.values())
    if BENCH_EPOCH_NS <= first < BENCH_EPOCH_NS + _BENCH_DAYS_NS:
        return BENCH_EPOCH_NS
    return first if first >= S * 100_000_000 else 0


def _read_candump(log: BusLog) -> Stamped:
    """Return the frames of a candump log with their stamps; the reader of python-can names no line."""
    match_line = _LINE.fullmatch
    try:
        with log.path.open(encoding="ascii") as stream:
            for number, line in enumerate(stream, start=1):
                match = match_line(line)
                if match is None:
                    if line.strip():
                        _refuse_line(log, stream, line, number)
                    continue
                seconds, fraction, channel, identifier, body = match.groups()
                stamp_ns = int(seconds) * S + int(fraction) * _TENS[len(fraction)]
                can_id, extended = int(identifier, 16), len(identifier) == _EXTENDED_DIGITS
                if extended and can_id & _ERROR_FLAG:
                    yield stamp_ns, channel, _ERROR_FRAME, "bus error"
                    continue
                try:
                    frame = (
                        _fd(can_id, extended, body) if body[:1] == "#" else _classical(can_id, extended, body)
                    )
                except BusError as error:
                    raise CannotRunError(f"{log.path}, line {number}: {error}") from error
                if frame is None:
                    cut = ": the file is cut off there" if _is_last(stream) else ""
                    what = "#, flags and bytes of CAN FD" if body[:1] == "#" else "0 to 8 bytes"
                    raise CannotRunError(
                        f"{log.path}, line {number}: {body!r} are no {what} in hexadecimal, and no R{cut}"
                    )
                yield stamp_ns, channel, frame, ""
    except (OSError, UnicodeDecodeError) as error:
        raise CannotRunError(f"{log.path} cannot be read as a candump log: {error}") from error


def _refuse_line(log: BusLog, stream: Iterator[str], line: str, number: int) -> NoReturn:
    cut = " (the file is cut off there)" if _is_last(stream) else ""
    if _ON_SCREEN.match(line):
        cut = "; that is how candump shows frames on the screen: record with candump -L, or -l into a file"
    raise CannotRunError(
        f"{log.path}, line {number}: {line[:60].rstrip()!r} is no line of a candump log such as "
        f"'(1735689600.000000) can0 181#3702000000000000'{cut}"
    )


def _is_last(stream: Iterator[str]) -> bool:
    """Return whether nothing but empty lines follows."""
    return not any(line.strip() for line in stream)


def _classical(can_id: int, extended: bool, body: str) -> CanFrame | None:
    """Return the frame that candump writes behind the #; None: that is none."""
    if body[:1] == "R":
        remote = _REMOTE.fullmatch(body)
        if remote is None:
            return None
        return CanFrame(can_id, b"", extended=extended, remote=True, dlc=int(remote[1] or 0))
    data = _DATA.fullmatch(body)
    if data is None:
        return None
    content = bytes.fromhex(data[1])
    if data[2] is None:
        return CanFrame(can_id, content, extended=extended)
    # Behind "_" stands a raw DLC of 9 to 15, which a classical frame of 8 bytes may have.
    return CanFrame(can_id, content, extended=extended, dlc=int(data[2], 16)) if len(content) == 8 else None


def _fd(can_id: int, extended: bool, body: str) -> CanFrame | None:
    """Return the frame of CAN FD that candump writes behind the first #; None: that is none."""
    data = _FD_DATA.fullmatch(body)
    if data is None:
        return None
    flags = int(data[1], 16)
    frame = CanFrame(
        can_id,
        bytes.fromhex(data[2]),
        extended=extended,
        fd=True,
        brs=bool(flags & 1),
        esi=bool(flags & 2),
    )
    check_fd(frame)
    return frame


def _read_captured(log: BusLog) -> Stamped:
    """Return the frames of a capture file with their stamps."""
    try:
        for stamp_ns, channel, frame, error in read_capture(log.path):
            yield stamp_ns, channel, frame, error
    except (OSError, BusError) as error:
        raise CannotRunError(f"{error}" if isinstance(error, BusError) else f"{log.path}: {error}") from error


def _read_with_library(log: BusLog) -> Stamped:
    """Return the frames of a file of another format, with their stamps, read by python-can."""
    import can
    from can.io.blf import BLFParseError

    from fieldbus.can.message import logged_frame

    count = 0
    try:
        with _reader(log.path) as reader:
            # Of a BLF file, whose reader takes what is left for the whole.
            stated = getattr(reader, "file_size", 0)
            for message in reader:
                count += 1
                channel = "" if message.channel is None else str(message.channel)
                if message.is_error_frame:
                    yield round(message.timestamp * S), channel, _ERROR_FRAME, "bus error"
                else:
                    yield round(message.timestamp * S), channel, logged_frame(message), ""
    except (
        OSError,
        ValueError,
        LookupError,
        struct.error,
        zlib.error,
        BLFParseError,
        can.CanError,
        BusError,
    ) as error:
        read = f" after {count} frames" if count else ""
        raise CannotRunError(
            f"{log.path} cannot be read as a CAN log{read}: {error or type(error).__name__}; it may be "
            f"cut off. "
            f"Logs are {FORMATS}"
        ) from error
    there = log.path.stat().st_size
    if isinstance(stated, int) and stated > there:
        raise CannotRunError(
            f"{log.path} cannot be read as a CAN log: it says that it has {stated} bytes and has {there}: it "
            f"is cut off"
        )


def _reader(path: Path) -> Any:
    import can

    if path.suffix.lower() != ".asc":
        return can.LogReader(path)
    from hil.logs._asc import AscLines

    lines: Any = AscLines(path)
    return can.ASCReader(lines)
