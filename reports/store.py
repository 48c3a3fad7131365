"""A run on disk: `run.json`, an append-only journal `cases.jsonl` and one NumPy archive of signals per case.

The journal gets one line per finished case, flushed and synchronised to the disk, after the archive of the case is
there: whoever kills the run loses at most the case that was running. A line that was cut off in the middle of writing
is the last one; it is ignored on reading and cut away before the next line is added.

NaN and infinities stand in the journal as the words that Python's `json` reads and writes.
"""

from __future__ import annotations

import ast
import hashlib
import io
import json
import math
import os
import re
import zipfile
import zlib
from collections.abc import Iterator, Sequence
from functools import lru_cache
from pathlib import Path
from typing import Any, ClassVar, cast, overload

import numpy as np
from numpy.typing import NDArray

from reports.codec import case_from_plain, case_to_plain, plain_number, run_from_plain, run_to_plain
from reports.errors import StoreError
from reports.measures import signal_measures
from reports.model import CaseResult, RunResult, Signal
from reports.packed import pack_case

RUN_FILE = "run.json"
JOURNAL_FILE = "cases.jsonl"
SIGNAL_FOLDER = "signals"
_PLACES = {b"\x93NUMPY\x01": (2, 10), b"\x93NUMPY\x02": (4, 12), b"\x93NUMPY\x03": (4, 12)}
"""Size of the length of a header, and where the header begins, by magic and version (numpy.lib.format)."""
FORMAT = 1
"""Version of the stored form; another one is refused."""


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


def write_case(directory: str | Path, case: CaseResult) -> Sequence[Signal]:
    """Append a finished case; on return it is on the disk.

    Returns:
        Its signals as they are on the disk, which are read when somebody asks for them: a run of thousands of cases keeps
        these rather than the samples.

    Raises:
        StoreError: `directory` holds no run.

    """
    folder = Path(directory)
    if not (folder / RUN_FILE).exists():
        raise StoreError(f"{folder}: no run here; {RUN_FILE} is missing (call start_run first)")
    plain = case_to_plain(case)
    plain["signals"] = _write_signals(folder, case)
    line = json.dumps(plain, default=plain_number, separators=(",", ":")).encode("ascii") + b"\n"
    path = folder / JOURNAL_FILE
    with path.open("r+b" if path.exists() else "w+b") as file:
        _mend_tail(file)
        file.write(line)
        file.flush()
        os.fsync(file.fileno())
    _sync_folder(folder)
    return StoredSignals(folder, plain["signals"]) if plain["signals"] else []


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
        lazy: Read the signals of a case when somebody asks for them, each time anew, and keep its long lists packed. What is
            wrong with signals is then raised there.

    Raises:
        StoreError: `directory` holds no run, or a file of it is damaged.

    """
    folder = Path(directory)
    try:
        run = run_from_plain(_read_header(folder))
    except (TypeError, ValueError, KeyError) as error:
        raise StoreError(f"{folder / RUN_FILE}: not a run: {error}") from error
    cases: dict[str, CaseResult] = {}
    for number, plain in _journal(folder):
        try:
            signals = plain.pop("signals", None)
            case = case_from_plain(plain)
            stored = (
                None
                if signals is None
                else StoredSignals(folder, {**signals, "columns": [*signals["columns"]]})
            )
        except (TypeError, ValueError, KeyError, AttributeError) as error:
            raise StoreError(f"{folder / JOURNAL_FILE}, line {number}: not a case: {error}") from error
        if stored is not None:
            case.signals = stored if lazy else list(stored)
        if lazy:
            pack_case(case)
        cases[case.identifier] = case
    run.cases = list(cases.values())
    return run


def stored_cases(directory: str | Path) -> list[str]:
    """Return the identifiers of the cases in the journal, in order: what a resumed run need not repeat.

    Raises:
        StoreError: The journal is damaged.

    """
    return list(dict.fromkeys(str(plain["identifier"]) for _number, plain in _journal(Path(directory))))


class StoredSignals(Sequence[Signal]):
    """The signals of a case on the disk, read when they are asked for; only those asked for last stay in memory.

    Args:
        folder: Folder of the run.
        plain: What the journal says about the archive.

    """

    __slots__ = ("_folder", "_plain")
    __hash__ = None  # type: ignore[assignment]  # as equal as lists are
    _last: ClassVar[tuple[StoredSignals, list[Signal]] | None] = None

    def __init__(self, folder: Path, plain: dict[str, Any]) -> None:
        self._folder = folder
        self._plain = plain

    @property
    def texts(self) -> list[dict[int, str]]:
        """Texts of the values of each signal, without reading a sample."""
        return [{int(value): text for value, text in column[-1]} for column in self._plain["columns"]]

    @property
    def numbers(self) -> list[list[Any]] | None:
        """Rows of `reports.measures.Measure`; None in a journal without them."""
        return cast("list[list[Any]] | None", self._plain.get("numbers"))

    def _read(self) -> list[Signal]:
        last = StoredSignals._last
        if last is None or last[0] is not self:
            last = StoredSignals._last = (self, _read_signals(self._folder, self._plain))
        return last[1]

    def __len__(self) -> int:
        return len(self._plain["columns"])

    @overload
    def __getitem__(self, index: int) -> Signal: ...

    @overload
    def __getitem__(self, index: slice) -> list[Signal]: ...

    def __getitem__(self, index: int | slice) -> Signal | list[Signal]:
        """Return a signal, or some of them."""
        return self._read()[index]

    def __iter__(self) -> Iterator[Signal]:
        return iter(self._read())

    def __eq__(self, other: object) -> bool:
        return list(self) == list(other) if isinstance(other, Sequence) else NotImplemented


def _journal(folder: Path) -> Iterator[tuple[int, dict[str, Any]]]:
    path = folder / JOURNAL_FILE
    if not path.exists():
        return
    lines = path.read_bytes().split(b"\n")
    for number, line in enumerate(lines, start=1):
        if not line:
            continue
        try:
            plain = json.loads(line)
        except ValueError as error:
            if number == len(lines):  # no newline after it: the writer was killed
                return
            raise StoreError(f"{path}, line {number}: damaged: {error}") from error
        if not isinstance(plain, dict) or "identifier" not in plain:
            raise StoreError(f"{path}, line {number}: not a case")
        yield number, plain


def _mend_tail(file: io.BufferedRandom) -> None:
    """Place the file at the end of its last whole line: complete a line without newline, cut off a torn one."""
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
    if not isinstance(plain, dict) or plain.pop("format", None) != FORMAT:
        raise StoreError(f"{path}: not a run of format {FORMAT}")
    return plain


def _write_header(folder: Path, plain: dict[str, Any]) -> None:
    text = json.dumps({"format": FORMAT, **plain}, default=plain_number, indent=1)
    _write_whole(folder / RUN_FILE, text.encode("ascii"))


def _write_signals(folder: Path, case: CaseResult) -> dict[str, Any] | None:
    """Write the archive of a case; return what the journal says about it."""
    if not case.signals:
        return None
    arrays: dict[str, NDArray[Any]] = {}
    names: dict[bytes, str] = {}
    columns: list[list[Any]] = []
    for signal in case.signals:
        # Most signals share one time axis: store each distinct one once.
        key = hashlib.sha256(signal.time_s.tobytes() + str(signal.time_s.dtype).encode()).digest()
        if key not in names:
            names[key] = f"time{len(names)}"
            arrays[names[key]] = signal.time_s
        column = f"column{len(columns)}"
        arrays[column] = signal.values
        columns.append([signal.name, signal.unit, names[key], column, list(signal.enum.items())])
    buffer = io.BytesIO()
    np.savez_compressed(buffer, allow_pickle=False, **arrays)
    content = buffer.getvalue()
    # Named by content: writing a case again never touches the archive that an older line of the journal points at.
    readable = re.sub(r"[^A-Za-z0-9._-]+", "_", case.identifier)[:60].strip("._") or "case"
    name = f"{SIGNAL_FOLDER}/{readable}-{hashlib.sha256(content).hexdigest()[:16]}.npz"
    (folder / SIGNAL_FOLDER).mkdir(exist_ok=True)
    _write_whole(folder / name, content)
    numbers = [list(one) for one in signal_measures(case.signals) if math.isfinite(one.value)]
    return {"file": name, "columns": columns, "numbers": numbers}


def _read_signals(folder: Path, plain: dict[str, Any]) -> list[Signal]:
    path = folder / SIGNAL_FOLDER / Path(str(plain.get("file", ""))).name
    try:
        with zipfile.ZipFile(path) as archive:
            arrays = {name.removesuffix(".npy"): _array(archive.read(name)) for name in archive.namelist()}
        return [
            Signal(name, unit, arrays[time], arrays[column], {int(value): text for value, text in enum})
            for name, unit, time, column, enum in plain["columns"]
        ]
    except (OSError, ValueError, KeyError, TypeError, SyntaxError, zlib.error, zipfile.BadZipFile) as error:
        raise StoreError(f"{path}: signals missing or damaged: {error}") from error


def _array(content: bytes) -> NDArray[Any]:
    """Return the array of a member: as `numpy.load` does, which would parse the same few headers thousands of times."""
    size, start = _PLACES.get(content[:7], (0, 0))
    length = int.from_bytes(content[8 : 8 + size], "little")
    if not length:
        raise ValueError("a member is no NumPy array")
    kind, shape = _header(content[start : start + length])
    return np.frombuffer(content, kind, offset=start + length).reshape(shape).copy()


@lru_cache(maxsize=256)
def _header(text: bytes) -> tuple[np.dtype[Any], tuple[int, ...]]:
    plain = ast.literal_eval(text.decode("latin-1"))
    kind = np.dtype(plain["descr"])
    if kind.hasobject or (plain["fortran_order"] and len(plain["shape"]) > 1):
        raise ValueError(f"a member holds {plain['descr']}, which no signal has")
    return kind, plain["shape"]


def _write_whole(path: Path, content: bytes) -> None:
    """Write a file so that a reader sees the old one or the whole new one."""
    draft = path.with_name(path.name + ".part")
    with draft.open("wb") as file:
        file.write(content)
        file.flush()
        os.fsync(file.fileno())
    draft.replace(path)
    _sync_folder(path.parent)


def _sync_folder(folder: Path) -> None:
    """Make new names durable where the system lets a folder be opened (not on Windows)."""
    try:
        handle = os.open(folder, os.O_RDONLY)
    except OSError:
        return
    try:
        os.fsync(handle)
    finally:
        os.close(handle)
