"""`hil export`: a saved trace, or what it holds of a bus, as a file of another format."""

from __future__ import annotations

import fnmatch
from collections.abc import Sequence
from pathlib import Path
from typing import Final

from hil._commands.terminal import console, print_json
from hil.errors import CannotRunError, RecordingError
from hil.record import Trace
from hil.record.export import SIGNAL_FORMATS, write_signals

_BUS_FORMATS: Final = (".log", ".asc", ".blf", ".pcap", ".pcapng")


def export_trace(
    source: Path, output: Path, *, signals: Sequence[str] = (), bus: str = "", as_json: bool = False
) -> int:
    """Write signals (.mf4, .csv, .npz) or the frames of a CAN segment (.log, .asc, .blf, .pcap,
    .pcapng) of a saved trace; returns the exit code.

    Args:
        source: `trace.npz` or `trace.json` of a case.
        output: The file; its suffix says what it becomes.
        signals: Names, with `*` as in file names; none: all.
        bus: Segment whose frames are written; needed where there are several.
        as_json: Tell on standard output what was written.

    Raises:
        CannotRunError: The trace cannot be read, the suffix is unknown, or
            there is no such signal or segment.

    """
    try:
        trace = Trace.load(source)
    except RecordingError as error:
        raise CannotRunError(str(error)) from error
    suffix = output.suffix.lower()
    if suffix not in (*SIGNAL_FORMATS, *_BUS_FORMATS):
        raise CannotRunError(
            f"--output {output}: allowed are {', '.join(SIGNAL_FORMATS)} for signals, "
            f"{', '.join(_BUS_FORMATS)} for the frames of a CAN segment"
        )
    if source.resolve() == output.resolve() or (suffix == ".npz" and output.with_suffix(".json").exists()):
        raise CannotRunError(f"--output {output}: that is the file of a saved trace, which would be lost")
    output.parent.mkdir(parents=True, exist_ok=True)
    if suffix in _BUS_FORMATS:
        written = _write_bus(trace, output, bus, signals)
    else:
        if bus:
            raise CannotRunError(
                f"--bus {bus!r}: {suffix} holds signals; frames go to {', '.join(_BUS_FORMATS)}"
            )
        names = _chosen(trace, signals)
        write_signals(trace, output, names)
        written = {"signals": len(names), "samples": max((len(trace[name]) for name in names), default=0)}
    if as_json:
        print_json({"file": str(output), **written})
    console().print(
        f"{output}: {', '.join(f'{count} {what}' for what, count in written.items())}", markup=False
    )
    return 0


def _write_bus(trace: Trace, output: Path, bus: str, signals: Sequence[str]) -> dict[str, object]:
    from fieldbus.can.export import write_log

    if signals:
        raise CannotRunError(f"--signal: {output.suffix} holds the frames of a segment, not signals")
    there = trace.can_buses
    if not there:
        raise CannotRunError("the trace holds no CAN frames")
    if bus and bus not in there:
        raise CannotRunError(f"--bus {bus!r}: the trace has the CAN segments {', '.join(there)}")
    if not bus and len(there) > 1:
        raise CannotRunError(f"the trace has the CAN segments {', '.join(there)}: say which one with --bus")
    log = trace.can_log(bus or there[0])
    write_log(log, output, channel=bus or there[0])
    return {"frames": len(log)}


def _chosen(trace: Trace, patterns: Sequence[str]) -> list[str]:
    names = trace.names()
    if not patterns:
        return names
    chosen: dict[str, None] = {}
    for pattern in patterns:
        found = fnmatch.filter(names, pattern)
        if not found:
            raise CannotRunError(f"--signal {pattern!r} fits no signal; there is: {', '.join(names)}")
        chosen.update(dict.fromkeys(found))
    return list(chosen)
