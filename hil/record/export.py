"""Signals of a trace as files of other tools: MDF4, CSV, NumPy archives."""

from __future__ import annotations

import csv
from collections.abc import Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Final

import numpy as np

from fieldbus.errors import ConfigurationError
from hil.errors import CannotRunError
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
    rows: dict[int, dict[int, float]] = {}
    for group, columns in chosen:
        first = len(header)
        for column in columns:
            name, unit = group.columns[column]
            header.append(f"{group.name}.{name} [{unit}]" if unit else f"{group.name}.{name}")
        for time_ns, values in zip(group.time_ns.tolist(), group.values[:, columns].tolist(), strict=True):
            rows.setdefault(time_ns, {}).update(enumerate(values, start=first))
    with naming(path), path.open("w", encoding="utf-8", newline="") as stream:
        writer = csv.writer(stream, lineterminator="\n")
        writer.writerow(header)
        for time_ns in sorted(rows):
            row = rows[time_ns]
            seconds, rest = divmod(time_ns, 1_000_000_000)
            fields = (repr(row[at]) if at in row else "" for at in range(1, len(header)))
            writer.writerow([f"{seconds}.{rest:09d}", *fields])


def _write_mdf(chosen: Chosen, path: Path) -> None:
    try:
        from asammdf import MDF, Signal
    except ImportError as error:
        raise CannotRunError(
            f"{path}: MDF4 needs the package asammdf: pip install 'motion-hil[mdf]' ({error})"
        ) from error
    with MDF(version="4.10") as mdf:
        mdf.header.start_time = _EPOCH
        for group, columns in chosen:
            times = group.time_ns * _NS
            mdf.append(
                [
                    Signal(
                        samples=np.ascontiguousarray(group.values[:, column]),
                        timestamps=times,
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
