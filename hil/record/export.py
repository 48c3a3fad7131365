"""Signals of a trace as files of other tools: MDF4, CSV, NumPy archives."""

from __future__ import annotations

import csv
from collections.abc import Iterator, Sequence
from datetime import UTC, datetime
from heapq import merge
from itertools import groupby, repeat
from operator import itemgetter
from pathlib import Path
from typing import TYPE_CHECKING, Final

import numpy as np

from fieldbus.errors import ConfigurationError
from hil.errors import CannotRunError
from hil.record._signal import PART
from hil.record._trace import Trace, TraceGroup
from reports.naming import naming

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

SIGNAL_FORMATS: Final = (".mf4", ".csv", ".npz")
"""Suffixes of files for signals."""
_EPOCH: Final = datetime(2000, 1, 1, tzinfo=UTC)
"""Time zero of a bench in files that need an absolute time, as in the bus logs."""
_NS: Final = 1e-9


def write_signals(trace: Trace, path: str | Path, names: Sequence[str] = ()) -> Path:
    """Write signals of a trace; the suffix of `path` says in which format.

    * `.mf4`: a channel group per component, with units, the texts of states as conversion, and time in
      seconds. Needs the extra `mdf` (`pip install motion-hil[mdf]`).
    * `.csv`: a row per sample, `time_s` first; where components were sampled at different times a field is
      empty. Numbers are written so that reading gives back the same float64; a header line has `name [unit]`.
    * `.npz`: arrays `name` and, per component, `component.time_ns` (int64) and `component.time_s`.

    Args:
        trace: The recording.
        path: File; replaced if it exists.
        names: Signals; none: all.

    Returns:
        `path`.

    Raises:
        ConfigurationError: Another suffix.
        RecordingError: There is no such signal.
        CannotRunError: MDF4 without the extra.

    """
    path = Path(path)
    write = {".mf4": _write_mdf, ".csv": _write_csv, ".npz": _write_npz}.get(path.suffix.lower())
    if write is None:
        raise ConfigurationError(
            "path", str(path), f"a file name with the suffix {', '.join(SIGNAL_FORMATS)}"
        )
    for name in names:
        _ = trace[name]  # the message of a missing one lists what there is
    wanted = set(names or trace.names())
    groups = [(group, _columns(group, wanted)) for group in trace.groups]
    write([(group, columns) for group, columns in groups if columns], path)
    return path


Chosen = list[tuple[TraceGroup, list[int]]]
"""Groups and the numbers of their columns."""


def _columns(group: TraceGroup, wanted: set[str]) -> list[int]:
    return [n for n, (column, _) in enumerate(group.columns) if f"{group.name}.{column}" in wanted]


def _write_npz(chosen: Chosen, path: Path) -> None:
    arrays: dict[str, ArrayLike] = {}
    for group, columns in chosen:
        arrays[f"{group.name}.time_ns"] = group.time_ns
        arrays[f"{group.name}.time_s"] = group.time_ns * _NS
        for column in columns:
            arrays[f"{group.name}.{group.columns[column][0]}"] = group.values[:, column]
    with naming(path), path.open("wb") as stream:
        np.savez_compressed(stream, allow_pickle=False, **arrays)


def _write_csv(chosen: Chosen, path: Path) -> None:
    header = ["time_s"]
    streams: list[Iterator[_Row]] = []
    for group, columns in chosen:
        streams.append(_rows(group, columns, first=len(header) - 1))
        for column in columns:
            name, unit = group.columns[column]
            header.append(f"{group.name}.{name} [{unit}]" if unit else f"{group.name}.{name}")
    with naming(path), path.open("w", encoding="utf-8", newline="") as stream:
        writer = csv.writer(stream, lineterminator="\n")
        writer.writerow(header)
        for time_ns, rows in groupby(merge(*streams, key=itemgetter(0)), key=itemgetter(0)):
            fields = [""] * (len(header) - 1)
            for _, first, values in rows:
                fields[first : first + len(values)] = map(repr, values)
            seconds, rest = divmod(time_ns, 1_000_000_000)
            writer.writerow([f"{seconds}.{rest:09d}", *fields])


_Row = tuple[int, int, list[float]]
"""Time in ns, place of the first value among the fields, values."""


def _rows(group: TraceGroup, columns: list[int], *, first: int) -> Iterator[_Row]:
    """Return the rows of a group, read piece by piece."""
    for begin in range(0, len(group.time_ns), PART):
        times = group.time_ns[begin : begin + PART].tolist()
        values = group.values[begin : begin + PART][:, columns].tolist()
        yield from zip(times, repeat(first), values)


def _write_mdf(chosen: Chosen, path: Path) -> None:
    try:
        from asammdf import MDF, Signal
    except ImportError as error:
        raise CannotRunError(
            f"{path}: MDF4 needs the package asammdf: pip install 'motion-hil[mdf]' ({error})"
        ) from error
    with MDF(version="4.10") as mdf:
        mdf.header.start_time = _EPOCH
        for number, (group, columns) in enumerate(chosen):
            mdf.append(
                [
                    Signal(
                        samples=np.ascontiguousarray(group.values[:PART, column]),
                        timestamps=group.time_ns[:PART] * _NS,
                        name=f"{group.name}.{group.columns[column][0]}",
                        unit=group.columns[column][1],
                        conversion=_texts(group, group.columns[column][0]),
                    )
                    for column in columns
                ],
                acq_name=group.name,
                comment=f"recorded by the bench: {group.name}",
                common_timebase=True,
            )
            # The library keeps what it has been given in a file of its own until it is saved.
            for begin in range(PART, len(group.time_ns), PART):
                part = slice(begin, begin + PART)
                more = [np.ascontiguousarray(group.values[part, column]) for column in columns]
                mdf.extend(number, [(one, None) for one in (group.time_ns[part] * _NS, *more)])
        mdf.save(path, overwrite=True, compression=2)


def _texts(group: TraceGroup, column: str) -> dict[str, int | str | bytes] | None:
    """Return the texts of a state as a conversion of value to text; None for a quantity."""
    texts = group.enums.get(column)
    if not texts:
        return None
    table: dict[str, int | str | bytes] = {}
    for number, (value, text) in enumerate(texts.items()):
        table[f"val_{number}"] = value
        table[f"text_{number}"] = text.encode()
    table["default"] = b""
    return table
