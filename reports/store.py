"""A run on disk: `run.json`, an append-only journal `cases.jsonl` and one NumPy archive of signals per case.

The journal gets one line per finished case, flushed and synchronised to the disk, after the archive of the
case is there: a run that is killed loses at most the case that was running. A line that was cut off in the
middle of writing is the last one; it is ignored on reading and cut away before the next line is added.

NaN and infinities are in the journal as the words that Python's `json` reads and writes.
"""

from __future__ import annotations

import io
import json
import os
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, ClassVar, overload

from reports.archive import SIGNAL_FOLDER, StoredSignals, sync_folder, write_signals, write_whole
from reports.codec import (
    case_from_plain,
    case_to_plain,
    messages_from_plain,
    plain_number,
    run_from_plain,
    run_to_plain,
    without_collector,
)
from reports.errors import StoreError
from reports.model import CaseResult, Message, RunResult
from reports.naming import naming
from reports.packed import pack_case

__all__ = [
    "JOURNAL_FILE",
    "RUN_FILE",
    "SIGNAL_FOLDER",
    "StoredMessages",
    "StoredSignals",
    "finish_run",
    "load_run",
    "save_run",
    "start_run",
    "stored_cases",
    "write_case",
]

RUN_FILE = "run.json"
JOURNAL_FILE = "cases.jsonl"
FORMAT = 2
"""Version of the stored form."""
READABLE = (1, 2)
"""Versions that are read; another one is refused. In the first, an archive had a member for every column."""
_LOG = b',"messages":['
_AFTER_LOG = b'],"signals":'


def start_run(directory: str | Path, run: RunResult) -> None:
    """Create the store of a run: everything but its cases, marked as interrupted until `finish_run`.

    Args:
        directory: Folder of the run; created with its parents.
        run: The run; its cases are ignored.

    Raises:
        StoreError: The folder already holds a run (resume it by `write_case`, or choose another folder).

    """
    folder = Path(directory)
    folder.mkdir(parents=True, exist_ok=True)
    if (folder / RUN_FILE).exists() or (folder / JOURNAL_FILE).exists():
        raise StoreError(f"{folder}: holds a run already; append to it or choose an empty folder")
    _write_header(folder, {**run_to_plain(run), "interrupted": True})


def write_case(directory: str | Path, case: CaseResult) -> CaseResult:
    """Append a finished case; on return it is on the disk.

    Returns:
        The same case, whose signals and bus log are read on demand: a run of thousands of
        cases keeps this one.

    Raises:
        StoreError: `directory` holds no run.

    """
    folder = Path(directory)
    if not (folder / RUN_FILE).exists():
        raise StoreError(f"{folder}: no run here; {RUN_FILE} is missing (call start_run first)")
    plain = case_to_plain(case)
    with naming(folder / SIGNAL_FOLDER):
        plain["signals"] = write_signals(folder, case)
    line = json.dumps(plain, default=plain_number, separators=(",", ":")).encode("ascii") + b"\n"
    path = folder / JOURNAL_FILE
    with naming(path), path.open("r+b" if path.exists() else "w+b") as file:
        _repair_tail(file)
        file.write(line)
        file.flush()
        os.fsync(file.fileno())
    sync_folder(folder)
    return replace(
        case,
        signals=StoredSignals(folder, plain["signals"]) if plain["signals"] else [],
        messages=StoredMessages(_split(line)[1]),
    )


def finish_run(directory: str | Path, *, interrupted: bool = False) -> None:
    """Note that the run ended: by itself, or `interrupted` by the user.

    Raises:
        StoreError: `directory` holds no run.

    """
    folder = Path(directory)
    _write_header(folder, {**_read_header(folder), "interrupted": interrupted})


def save_run(directory: str | Path, run: RunResult) -> None:
    """Store a whole run at once.

    Raises:
        StoreError: The folder already holds a run.

    """
    start_run(directory, run)
    for case in run.cases:
        write_case(directory, case)
    finish_run(directory, interrupted=run.interrupted)


def load_run(directory: str | Path, *, lazy: bool = False) -> RunResult:
    """Read a run back, equal to what was written.

    A case that was written twice counts as written last, at the place of the first. A run that never got to
    `finish_run` is `interrupted`.

    Args:
        directory: Folder of the run.
        lazy: Read signals and bus log of a case when somebody asks for them, again each time, and keep its
            story packed. What is wrong with signals or bus log is then raised there.

    Raises:
        StoreError: `directory` holds no run, or a file of it is damaged.

    """
    folder = Path(directory)
    try:
        run = run_from_plain(_read_header(folder))
    except (TypeError, ValueError, KeyError) as error:
        raise StoreError(f"{folder / RUN_FILE}: not a run: {error}") from error
    with without_collector():
        cases = _cases(folder, lazy=lazy)
    run.cases = list(cases.values())
    return run


def stored_cases(directory: str | Path) -> list[str]:
    """Return the identifiers of the cases in the journal, in order: what a resumed run need not repeat.

    Raises:
        StoreError: The journal is damaged.

    """
    return list(dict.fromkeys(str(plain["identifier"]) for _number, plain, _log in _journal(Path(directory))))


class StoredMessages(Sequence[Message]):
    """The bus log of a case as it is in the journal, taken apart when it is asked for: as text it takes a
    tenth of the memory.

    Args:
        text: The JSON array of its messages.

    """

    __slots__ = ("_text",)
    __hash__ = None  # type: ignore[assignment]  # as equal as lists are
    _last: ClassVar[tuple[StoredMessages, list[Message]] | None] = None

    def __init__(self, text: bytes) -> None:
        self._text = text

    def _read(self) -> list[Message]:
        last = StoredMessages._last
        if last is None or last[0] is not self:
            try:
                last = StoredMessages._last = (self, messages_from_plain(json.loads(self._text)))
            except (TypeError, ValueError) as error:
                raise StoreError(f"bus log of a case damaged: {error}") from error
        return last[1]

    def __len__(self) -> int:
        return len(self._read())

    @overload
    def __getitem__(self, index: int) -> Message: ...

    @overload
    def __getitem__(self, index: slice) -> list[Message]: ...

    def __getitem__(self, index: int | slice) -> Message | list[Message]:
        """Return a message, or some of them."""
        return self._read()[index]

    def __iter__(self) -> Iterator[Message]:
        return iter(self._read())

    def __eq__(self, other: object) -> bool:
        return list(self) == list(other) if isinstance(other, Sequence) else NotImplemented


def _cases(folder: Path, *, lazy: bool) -> dict[str, CaseResult]:
    cases: dict[str, CaseResult] = {}
    for number, plain, log in _journal(folder):
        try:
            signals = plain.pop("signals", None)
            case = case_from_plain(plain)
            stored = (
                None
                if signals is None
                else StoredSignals(folder, {**signals, "columns": [*signals["columns"]]})
            )
            if log:
                case.messages = StoredMessages(log) if lazy else messages_from_plain(json.loads(log))
        except (TypeError, ValueError, KeyError, AttributeError) as error:
            raise StoreError(f"{folder / JOURNAL_FILE}, line {number}: not a case: {error}") from error
        if stored is not None:
            case.signals = stored if lazy else list(stored)
        if lazy:
            pack_case(case)
        cases[case.identifier] = case
    return cases


def _journal(folder: Path) -> Iterator[tuple[int, dict[str, Any], bytes]]:
    """Give line number, object and bus log of every case, the log as text where it stands as `write_case`
    puts it.
    """
    path = folder / JOURNAL_FILE
    if not path.exists():
        return
    with path.open("rb") as file:
        for number, line in enumerate(file, start=1):
            if line == b"\n":
                continue
            head, log = _split(line)
            try:
                plain = json.loads(head)
            except ValueError as error:
                if not line.endswith(b"\n"):  # the writer was killed
                    return
                raise StoreError(f"{path}, line {number}: damaged: {error}") from error
            if not isinstance(plain, dict) or "identifier" not in plain:
                raise StoreError(f"{path}, line {number}: not a case")
            yield number, plain, log


def _split(line: bytes) -> tuple[bytes, bytes]:
    """Return the line of a case without its bus log, and the log.

    Inside a string every quotation mark has a backslash before it, so the marks are keys; behind the log,
    which is the last but one, there is none of these names.
    """
    start, end = line.rfind(_LOG), line.rfind(_AFTER_LOG)
    if not 0 < start < end:
        return line, b""
    return line[:start] + line[end + 1 :], line[start + len(_LOG) - 1 : end + 1]


def _repair_tail(file: io.BufferedRandom) -> None:
    """Place the file at the end of its last whole line: complete a line
    without newline, cut off a torn one.
    """
    size = file.seek(0, os.SEEK_END)
    position = size
    tail = b""
    while position and b"\n" not in tail:
        step = min(65536, position)
        position -= step
        file.seek(position)
        tail = file.read(step) + tail
    last = tail[tail.rfind(b"\n") + 1 :]
    file.seek(size)
    if not last:
        return
    try:
        json.loads(last)
    except ValueError:
        file.seek(size - len(last))
        file.truncate()
    else:
        file.write(b"\n")


def _read_header(folder: Path) -> dict[str, Any]:
    path = folder / RUN_FILE
    try:
        plain = json.loads(path.read_bytes())
    except FileNotFoundError:
        raise StoreError(f"{folder}: no run here; {RUN_FILE} is missing") from None
    except ValueError as error:
        raise StoreError(f"{path}: damaged: {error}") from error
    if not isinstance(plain, dict) or plain.pop("format", None) not in READABLE:
        raise StoreError(f"{path}: not a run of format {' or '.join(map(str, READABLE))}")
    return plain


def _write_header(folder: Path, plain: dict[str, Any]) -> None:
    text = json.dumps({"format": FORMAT, **plain}, default=plain_number, indent=1)
    with naming(folder / RUN_FILE):
        write_whole(folder / RUN_FILE, text.encode("ascii"))
