"""The samples of a case on the disk: a NumPy archive, read on demand."""

from __future__ import annotations

import ast
import hashlib
import io
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

from reports.errors import StoreError
from reports.measures import signal_measures
from reports.model import CaseResult, Signal

SIGNAL_FOLDER = "signals"
_PLACES = {b"\x93NUMPY\x01": (2, 10), b"\x93NUMPY\x02": (4, 12), b"\x93NUMPY\x03": (4, 12)}
"""Size of the length of a header, and where the header begins, by magic and version (numpy.lib.format)."""


class StoredSignals(Sequence[Signal]):
    """The signals of a case on the disk, read when they are asked for; only those
    asked for last stay in memory.

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


def write_signals(folder: Path, case: CaseResult) -> dict[str, Any] | None:
    """Write the archive of a case; return what the journal says about it."""
    if not case.signals:
        return None
    store = _Samples()
    columns = [
        [
            signal.name,
            signal.unit,
            store.add_time(signal.time_s),
            store.add(signal.values),
            list(signal.enum.items()),
        ]
        for signal in case.signals
    ]
    buffer = io.BytesIO()
    np.savez_compressed(buffer, allow_pickle=False, **store.arrays())
    content = buffer.getvalue()
    # Named by content: writing a case again never touches the archive that an older line of the journal
    # points at.
    readable = re.sub(r"[^A-Za-z0-9._-]+", "_", case.identifier)[:60].strip("._") or "case"
    name = f"{SIGNAL_FOLDER}/{readable}-{hashlib.sha256(content).hexdigest()[:16]}.npz"
    (folder / SIGNAL_FOLDER).mkdir(exist_ok=True)
    write_whole(folder / name, content)
    numbers = [list(one) for one in signal_measures(case.signals) if math.isfinite(one.value)]
    return {"file": name, "columns": columns, "numbers": numbers}


class _Samples:
    """Columns one after the other, in one array for each kind of number: reading one
    member is quicker than thirty.
    """

    def __init__(self) -> None:
        self._parts: dict[str, list[NDArray[Any]]] = {}
        self._sizes: dict[str, int] = {}
        self._known: dict[bytes, list[Any]] = {}

    def add(self, column: NDArray[Any]) -> list[Any]:
        """Return where the column is: name of the array, start, end."""
        name = f"samples_{column.dtype.str[1:]}"
        start = self._sizes.get(name, 0)
        self._parts.setdefault(name, []).append(column)
        self._sizes[name] = start + len(column)
        return [name, start, start + len(column)]

    def add_time(self, column: NDArray[Any]) -> list[Any]:
        """Return where a time axis is: most signals share one, and each distinct one is stored once."""
        key = hashlib.sha256(column.tobytes() + str(column.dtype).encode()).digest()
        if key not in self._known:
            self._known[key] = self.add(column)
        return self._known[key]

    def arrays(self) -> dict[str, NDArray[Any]]:
        """Return the arrays by their names."""
        return {name: np.concatenate(parts) for name, parts in self._parts.items()}


def _read_signals(folder: Path, plain: dict[str, Any]) -> list[Signal]:
    path = folder / SIGNAL_FOLDER / Path(str(plain.get("file", ""))).name
    try:
        with zipfile.ZipFile(path) as archive:
            arrays = {name.removesuffix(".npy"): _array(archive.read(name)) for name in archive.namelist()}
        times: dict[str, NDArray[Any]] = {}
        return [
            Signal(
                name,
                unit,
                times.setdefault(str(time), _column(arrays, time)),
                _column(arrays, column),
                {int(value): text for value, text in enum},
            )
            for name, unit, time, column, enum in plain["columns"]
        ]
    except (OSError, ValueError, KeyError, TypeError, SyntaxError, zlib.error, zipfile.BadZipFile) as error:
        raise StoreError(f"{path}: signals missing or damaged: {error}") from error


def _column(arrays: dict[str, NDArray[Any]], place: Any) -> NDArray[Any]:
    if isinstance(place, str):  # a member of its own, in the first format
        return arrays[place]
    name, start, end = place
    array = arrays[name]
    if not 0 <= start <= end <= len(array):
        raise ValueError(f"{name} has {len(array)} samples, and no {start} to {end}")
    return array[start:end]


def _array(content: bytes) -> NDArray[Any]:
    """Return the array of a member: as `numpy.load` does, which would parse the same
    few headers thousands of times.
    """
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


def write_whole(path: Path, content: bytes) -> None:
    """Write a file so that a reader sees the old one or the whole new one."""
    draft = path.with_name(path.name + ".part")
    with draft.open("wb") as file:
        file.write(content)
        file.flush()
        os.fsync(file.fileno())
    draft.replace(path)
    sync_folder(path.parent)


def sync_folder(folder: Path) -> None:
    """Make new names durable where the system lets a folder be opened (not on Windows)."""
    try:
        handle = os.open(folder, os.O_RDONLY)
    except OSError:
        return
    try:
        os.fsync(handle)
    finally:
        os.close(handle)
