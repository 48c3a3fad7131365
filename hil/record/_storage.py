"""Saving and loading a trace: columns in a NumPy archive, everything else in JSON beside it."""

from __future__ import annotations

import json
import zipfile
from pathlib import Path
from typing import Any

import numpy as np

from fieldbus.can.frame import CanFrame
from fieldbus.history import Event
from hil.errors import RecordingError
from hil.record._trace import Trace, TraceGroup
from hil.record._vocabulary import Vocabulary

FORMAT = 1


def _paths(path: Path) -> tuple[Path, Path]:
    stem = path.with_suffix("") if path.suffix in {".npz", ".json"} else path
    return stem.with_name(stem.name + ".npz"), stem.with_name(stem.name + ".json")


def save_trace(trace: Trace, path: Path) -> tuple[Path, Path]:
    """Write a trace; returns the two files."""
    archive, document = _paths(path)
    arrays: dict[str, Any] = {}
    groups = []
    for index, group in enumerate(trace.groups):
        arrays[f"t{index}"] = group.time_ns
        arrays[f"v{index}"] = group.values
        enums = {
            column: {str(value): text for value, text in texts.items()}
            for column, texts in group.enums.items()
        }
        groups.append({"name": group.name, "columns": group.columns, "enums": enums})
    content = {
        "format": FORMAT,
        "end_ns": trace.end_ns,
        "digest": trace.digest(),
        "constants": trace.constants,
        "groups": groups,
        "events": [list(entry) for entry in trace.events],
        "frames": {bus: [_row(*entry) for entry in trace.raw_frames(bus)] for bus in trace.buses},
        "vocabulary": None if trace.vocabulary is None else trace.vocabulary.as_dict(),
    }
    archive.parent.mkdir(parents=True, exist_ok=True)
    with archive.open("wb") as stream:
        np.savez_compressed(stream, allow_pickle=False, **arrays)
    document.write_text(json.dumps(content, separators=(",", ":"), default=_plain), encoding="utf-8")
    return archive, document


def _row(time_ns: int, sender: str, frame: Any, error: str) -> list[Any]:
    flags = frame.extended | frame.remote << 1
    row = [time_ns, sender, frame.can_id, bytes(frame.data).hex(), flags, frame.dlc, error]
    protocol = getattr(frame, "protocol", None)
    return row if protocol is None else [*row, protocol, frame.asked.hex(), frame.note]


def _entry(row: list[Any]) -> tuple[int, str, Any, str]:
    time_ns, sender, can_id, data, flags, dlc, error, *modbus = row
    content = bytes.fromhex(data)
    if modbus:
        from fieldbus.modbus import ModbusFrame

        protocol, asked, note = modbus
        return time_ns, sender, ModbusFrame(protocol, content, bytes.fromhex(asked), note), error
    frame = CanFrame(can_id, content, extended=bool(flags & 1), remote=bool(flags & 2), dlc=dlc)
    return time_ns, sender, frame, error


def _plain(value: Any) -> Any:
    item = getattr(value, "item", None)
    if callable(item):
        return item()
    raise TypeError(f"{value!r} is no scalar")


def load_trace(path: Path) -> Trace:
    """Read what `save_trace` wrote."""
    archive, document = _paths(path)
    try:
        content = json.loads(document.read_text(encoding="utf-8"))
        if content.get("format") != FORMAT:
            raise RecordingError(f"{document}: format {content.get('format')!r} is not {FORMAT}")
        groups = []
        with np.load(archive, allow_pickle=False) as arrays:
            for index, entry in enumerate(content["groups"]):
                enums = {
                    column: {int(value): text for value, text in texts.items()}
                    for column, texts in entry["enums"].items()
                }
                columns = tuple((str(name), str(unit)) for name, unit in entry["columns"])
                groups.append(
                    TraceGroup(entry["name"], columns, enums, arrays[f"t{index}"], arrays[f"v{index}"])
                )
        frames = {bus: [_entry(row) for row in log] for bus, log in content["frames"].items()}
        vocabulary = content.get("vocabulary")
        trace = Trace(
            groups,
            events=[Event(*entry) for entry in content["events"]],
            frames=frames,
            constants=content["constants"],
            end_ns=content["end_ns"],
            vocabulary=Vocabulary.from_dict(vocabulary) if vocabulary else None,
        )
    except (OSError, ValueError, KeyError, TypeError, AttributeError, zipfile.BadZipFile) as error:
        raise RecordingError(f"no readable trace at {document} and {archive.name}: {error}") from error
    if trace.digest() != content["digest"]:
        raise RecordingError(f"{document} and {archive.name} do not belong together: the digest differs")
    return trace
