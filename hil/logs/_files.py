"""Reading bus logs that other tools have written: candump, ASC, BLF and whatever else python-can knows by its suffix."""

from __future__ import annotations

import re
import struct
import zlib
from dataclasses import dataclass, field
from pathlib import Path
from typing import Final

from fieldbus.can.frame import CanFrame
from fieldbus.clock import S
from fieldbus.errors import BusError
from hil.errors import CannotRunError

BENCH_EPOCH_NS: Final = 946_684_800 * S
"""Unix time of time zero of a bench in the logs that this product writes (2000-01-01)."""
_BENCH_DAYS_NS: Final = 30 * 86_400 * S

FORMATS: Final = ".log (candump), .asc, .blf, .trc, .csv, .mf4"
_LINE: Final = re.compile(
    r"\s*\((?P<seconds>\d+)\.(?P<fraction>\d{1,9})\)\s+(?P<channel>\S+)\s+"
    r"(?P<id>[0-9A-Fa-f]{3}|[0-9A-Fa-f]{8})#(?P<body>\S*)(?:\s+[RT])?\s*"
)
_REMOTE: Final = re.compile(r"R([0-8]?)")
_DATA: Final = re.compile(r"(?:[0-9A-Fa-f]{2}){0,8}")
_ERROR_FLAG: Final = 0x20000000

Entry = tuple[int, str, CanFrame, str]
"""Time (ns), sender (never known), frame, error (empty: none)."""


@dataclass(slots=True)
class BusLog:
    """A log file: frames by channel, in the order of the file."""

    path: Path
    channels: dict[str, list[Entry]] = field(default_factory=dict)
    """Times are from time zero: that of the bench in logs of this product, else the first frame."""
    left_out: int = 0
    """CAN FD frames."""
    origin_ns: int = 0
    """Unix time of time zero; 0 where the file has relative times."""

    @property
    def frames(self) -> int:
        """Number of frames of all channels."""
        return sum(map(len, self.channels.values()))

    @property
    def end_ns(self) -> int:
        """Time of the last frame."""
        return max((log[-1][0] for log in self.channels.values() if log), default=0)


def read_bus_log(path: str | Path) -> BusLog:
    """Read a log of CAN frames.

    Raises:
        CannotRunError: There is no such file, it is empty, cut off, no CAN log, or its timestamps go backwards.

    """
    path = Path(path)
    if not path.is_file():
        raise CannotRunError(f"{path}: there is no such file")
    if path.stat().st_size == 0:
        raise CannotRunError(f"{path} is empty")
    log = BusLog(path)
    stamped = _read_candump(log) if path.suffix.lower() == ".log" else _read_with_library(log)
    if not stamped:
        more = f"; {log.left_out} CAN FD frames are left out" if log.left_out else ""
        raise CannotRunError(f"{path} holds no CAN frame{more}")
    first = min(time_ns for time_ns, _, _, _ in stamped)
    if BENCH_EPOCH_NS <= first < BENCH_EPOCH_NS + _BENCH_DAYS_NS:
        log.origin_ns = BENCH_EPOCH_NS
    elif first >= S * 100_000_000:
        log.origin_ns = first
    last: dict[str, tuple[int, int]] = {}
    for number, (stamp_ns, channel, frame, error) in enumerate(stamped, start=1):
        time_ns = stamp_ns - log.origin_ns
        before = last.get(channel)
        if before is not None and time_ns < before[0]:
            raise CannotRunError(
                f"{path}: timestamps go backwards: frame {number} of the file, on {channel}, is at "
                f"{time_ns / S:.6f} s, and frame {before[1]} before it at {before[0] / S:.6f} s"
            )
        last[channel] = (time_ns, number)
        log.channels.setdefault(channel, []).append((time_ns, "", frame, error))
    return log


def _read_candump(log: BusLog) -> list[tuple[int, str, CanFrame, str]]:
    """Return the frames of a candump log with their stamps; the reader of python-can names no line."""
    found: list[tuple[int, str, CanFrame, str]] = []
    try:
        lines = log.path.read_text(encoding="ascii").splitlines()
    except (OSError, UnicodeDecodeError) as error:
        raise CannotRunError(f"{log.path} cannot be read as a candump log: {error}") from error
    for number, line in enumerate(lines, start=1):
        if not line.strip():
            continue
        match = _LINE.fullmatch(line)
        where = f"{log.path}, line {number}"
        if match is None:
            cut = " (the file is cut off there)" if number == len(lines) else ""
            raise CannotRunError(
                f"{where}: {line[:60]!r} is no line of a candump log such as "
                f"'(1735689600.000000) can0 181#3702000000000000'{cut}"
            )
        if match["body"].startswith("#"):
            log.left_out += 1
            continue
        stamp_ns = int(match["seconds"]) * S + int(match["fraction"].ljust(9, "0"))
        can_id, extended = int(match["id"], 16), len(match["id"]) == 8
        remote = _REMOTE.fullmatch(match["body"])
        if extended and can_id & _ERROR_FLAG:
            found.append((stamp_ns, match["channel"], CanFrame(0), "bus error"))
            continue
        if remote is None and _DATA.fullmatch(match["body"]) is None:
            cut = ": the file is cut off there" if number == len(lines) else ""
            raise CannotRunError(
                f"{where}: {match['body']!r} are no 0 to 8 bytes in hexadecimal, and no R{cut}"
            )
        try:
            if remote is not None:
                frame = CanFrame(can_id, b"", extended=extended, remote=True, dlc=int(remote[1] or 0))
            else:
                frame = CanFrame(can_id, bytes.fromhex(match["body"]), extended=extended)
        except BusError as error:
            raise CannotRunError(f"{where}: {error}") from error
        found.append((stamp_ns, match["channel"], frame, ""))
    return found


def _read_with_library(log: BusLog) -> list[tuple[int, str, CanFrame, str]]:
    """Return the frames of a file of another format, with their stamps, read by python-can."""
    import can
    from can.io.blf import BLFParseError

    from fieldbus.can.message import to_frame

    found: list[tuple[int, str, CanFrame, str]] = []
    try:
        with can.LogReader(log.path) as reader:
            told = getattr(
                reader, "file_size", 0
            )  # of a BLF file, whose reader takes what is left for the whole
            for message in reader:
                if message.is_fd:
                    log.left_out += 1
                    continue
                stamp_ns = round(message.timestamp * S)
                channel = "" if message.channel is None else str(message.channel)
                error = "bus error" if message.is_error_frame else ""
                frame = CanFrame(0) if error else to_frame(message)
                found.append((stamp_ns, channel, frame, error))
    except (OSError, ValueError, LookupError, struct.error, zlib.error, BLFParseError, can.CanError, BusError) as error:  # fmt: skip
        read = f" after {len(found)} frames" if found else ""
        raise CannotRunError(
            f"{log.path} cannot be read as a CAN log{read}: {error or type(error).__name__}; it may be cut off. "
            f"Logs are {FORMATS}"
        ) from error
    there = log.path.stat().st_size
    if isinstance(told, int) and told > there:
        raise CannotRunError(
            f"{log.path} cannot be read as a CAN log: it says that it has {told} bytes and has {there}: it is cut off"
        )
    return found
