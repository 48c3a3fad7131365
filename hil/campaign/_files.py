"""Evidence files of a case: the whole trace, the CAN log in candump's format, and the Modbus log as text."""

from __future__ import annotations

import hashlib
import re
from collections.abc import Iterable
from pathlib import Path
from typing import Final, Literal

from fieldbus.can.frame import CanFrame
from hil.campaign._execute import Execution
from hil.record import Trace, TraceFrame, protocol_of
from reports.model import Verdict
from reports.naming import naming

Keep = Literal["all", "failed", "none"]
EPOCH_S: Final = 946_684_800
"""Unix time of time zero of a bench, 2000-01-01: exported logs need an absolute time, and some formats lose
early ones.
"""
FOLDER: Final = "evidence"
_LONGEST_NAME: Final = 120
_PLAIN_NAME: Final = re.compile(r"[A-Za-z0-9-][A-Za-z0-9.-]*(/[A-Za-z0-9-][A-Za-z0-9.-]*)*")


def candump_lines(frames: Iterable[TraceFrame]) -> Iterable[str]:
    """Return CAN frames as lines of a candump log; frames that never reached a receiver are left out."""
    for frame in frames:
        if frame.error or frame.protocol != "can":
            continue
        identifier = f"{frame.can_id:08X}" if frame.extended else f"{frame.can_id:03X}"
        body = f"R{frame.dlc}" if frame.remote else frame.data.hex().upper()
        if frame.fd:
            body = f"#{frame.brs | frame.esi << 1:X}{body}"
        seconds, rest = divmod(frame.time_ns, 1_000_000_000)
        yield f"({EPOCH_S + seconds}.{rest // 1000:06d}) {frame.bus} {identifier}#{body}\n"


def write_candump(trace: Trace, path: Path) -> Path:
    """Write the frames of a trace as a candump log."""
    with path.open("w", encoding="ascii") as stream:
        stream.writelines(candump_lines(trace.iter_frames()))
    return path


def write_modbus_log(trace: Trace, path: Path) -> Path:
    """Write the requests and responses of a trace, a line each: time, segment, sender, bytes, words, what
    went wrong.
    """
    with path.open("w", encoding="utf-8") as stream:
        for time_ns, bus, sender, frame, error in trace.raw_by_time():
            if isinstance(frame, CanFrame):
                continue
            seconds, rest = divmod(time_ns, 1_000_000_000)
            suffix = f" [{error}]" if error else ""
            stream.write(
                f"{seconds}.{rest // 1000:06d} {bus} {sender} {frame.data.hex(' ').upper() or '-'}  "
                f"{frame.text()}{suffix}\n"
            )
    return path


def folder_name(identifier: str) -> str:
    """Return the folder of a case: its identifier with `_` for `/`; a digest is added where that
    could mean two of them.

    The second kind are identifiers with characters beyond letters, digits, `.` and `-`, with empty parts, or
    too long for a name of a file.
    """
    if len(identifier) <= _LONGEST_NAME and _PLAIN_NAME.fullmatch(identifier):
        return identifier.replace("/", "_")
    readable = re.sub(r"[^A-Za-z0-9._-]+", "_", identifier)[:_LONGEST_NAME].strip("._") or "case"
    return f"{readable}-{hashlib.sha256(identifier.encode('utf-8', 'replace')).hexdigest()[:12]}"


def write_evidence(execution: Execution, directory: Path, keep: Keep) -> None:
    """Write the evidence files of a case below `directory` and note them in the result."""
    result, trace = execution.result, execution.trace
    if trace is None or keep == "none" or (keep == "failed" and result.verdict is Verdict.PASSED):
        return
    folder = directory / FOLDER / folder_name(result.identifier)
    folder.mkdir(parents=True, exist_ok=True)
    with naming(folder / "trace.npz"):
        archive, document = trace.save(folder / "trace")
    written = {"trace columns": archive, "trace events and frames": document}
    protocols = {protocol_of(log) for log in map(trace.raw_frames, trace.buses) if log}
    if "can" in protocols:
        with naming(folder / "bus.log"):
            written["bus log (candump)"] = write_candump(trace, folder / "bus.log")
    if protocols - {"can"}:
        with naming(folder / "modbus.log"):
            written["bus log (Modbus)"] = write_modbus_log(trace, folder / "modbus.log")
    result.files.update({title: path.relative_to(directory).as_posix() for title, path in written.items()})
