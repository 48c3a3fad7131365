"""The frames of the CAN buses of a trace, by identifier, as columns."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from itertools import islice
from typing import TYPE_CHECKING, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from fieldbus.can.frame import CanFrame
from hil.record import PackedFrames
from hil.record._spool import Spool

if TYPE_CHECKING:
    from hil.record import Trace
    from hil.record._frames import Entry


class Frames(NamedTuple):
    """The data frames of one identifier that were sent and received without an error."""

    time_s: NDArray[np.float64]
    """Time at which each of them ended."""
    lengths: NDArray[np.uint8]
    """Bytes of each."""
    data: NDArray[np.uint8]
    """Their bytes, one frame after the other."""

    def of_length(self, length: int) -> NDArray[np.uint8] | None:
        """Return the bytes, a row per frame; None when one of them has another length."""
        if not length or len(self.data) != length * len(self.lengths) or (self.lengths != length).any():
            return None
        return self.data.reshape(-1, length)

    def each(self) -> Iterator[tuple[float, bytes]]:
        """Return time in s and bytes of every frame."""
        data, end = self.data.tobytes(), 0
        for time_s, length in zip(self.time_s.tolist(), self.lengths.tolist(), strict=True):
            begin, end = end, end + length
            yield time_s, data[begin:end]

    def between(self, begin_s: float, end_s: float) -> slice:
        """Return the numbers of the frames behind one time and before another."""
        first = int(np.searchsorted(self.time_s, begin_s, side="right"))
        return slice(first, max(int(np.searchsorted(self.time_s, end_s)), first))


_NONE = Frames(np.empty(0), np.empty(0, dtype=np.uint8), np.empty(0, dtype=np.uint8))
_PART: Final = 65_536
"""Frames of a bus that are put to the others at a time."""


class _Collected:
    """Frames of one identifier while a log is read; those of a long log go to temporary files."""

    def __init__(self) -> None:
        self._times, self._lengths, self._data = Spool(), Spool(), Spool()

    def add(self, frames: list[tuple[int, bytes]]) -> None:
        """Add frames: time in ns and data of each."""
        times = np.array([time_ns for time_ns, _ in frames], dtype=np.float64) * 1e-9
        self._times.write(times.tobytes())
        self._lengths.write(bytes([len(data) for _, data in frames]))
        self._data.write(b"".join([data for _, data in frames]))

    def frames(self) -> Frames:
        """Return all of them."""
        return Frames(self._times.view(np.float64), self._lengths.view(np.uint8), self._data.view(np.uint8))


def closely_behind(log: Sequence[Entry], within_ns: float, most: int) -> Iterator[tuple[int, Entry]]:
    """Return, of each identifier and length, the first frame that ends closely behind the one before it, with
    the time between, ns; none of CAN FD and none with an error.

    Args:
        log: Frames in the order in which they ended.
        within_ns: What counts as close, ns.
        most: Frames at the begin of the log that are looked at.

    """
    columns = log.columns() if isinstance(log, PackedFrames) and len(log) <= _PART else None
    if columns is not None:
        gaps = np.diff(columns.time_ns[:most])
        at = np.flatnonzero((gaps <= within_ns) & ~columns.wrong[1:most]) + 1
        _, firsts = np.unique(columns.can_id[at].astype(np.uint64) << 4 | columns.dlc[at], return_index=True)
        yield from ((int(gaps[one - 1]), log[one]) for one in np.sort(at[firsts]).tolist())
        return
    known: set[tuple[int, int]] = set()
    last_ns = -(1 << 62)
    for entry in islice(log, most):
        end_ns, _, frame, error = entry
        gap_ns, last_ns = end_ns - last_ns, end_ns
        if gap_ns > within_ns or error or frame.fd or (frame.can_id, frame.dlc) in known:
            continue
        known.add((frame.can_id, frame.dlc))
        yield gap_ns, entry


class BusFrames:
    """The frames of all CAN buses.

    Args:
        trace: Where they are.

    """

    def __init__(self, trace: Trace) -> None:
        self._trace = trace
        self._buses: dict[str, dict[int, Frames]] = {}
        self._errors: dict[str, NDArray[np.float64]] = {}
        self._remotes: dict[str, dict[int, list[float]]] = {}
        self._senders: dict[str, dict[int, set[str]]] = {}

    def _of_bus(self, bus: str) -> dict[int, Frames]:
        found = self._buses.get(bus)
        if found is None:
            packed = self._packed(bus)
            if packed is not None:
                self._buses[bus] = packed
                return packed
            collected: defaultdict[int, _Collected] = defaultdict(_Collected)
            errors = Spool()
            remotes = self._remotes.setdefault(bus, {})
            senders = self._senders[bus] = defaultdict(set)
            log = iter(self._trace.raw_frames(bus))
            while part := list(islice(log, _PART)):
                kept: defaultdict[int, list[tuple[int, bytes]]] = defaultdict(list)
                for time_ns, sender, frame, error in part:
                    if error or frame.extended or frame.remote or not isinstance(frame, CanFrame) or frame.fd:
                        if frame.remote and not error and not frame.extended:
                            remotes.setdefault(frame.can_id, []).append(time_ns * 1e-9)
                        continue
                    can_id = frame.can_id
                    kept[can_id].append((time_ns, frame.data))
                    senders[can_id].add(sender)
                for can_id, frames in kept.items():
                    collected[can_id].add(frames)
                wrong = np.array([entry[0] for entry in part if entry[3]], dtype=np.float64) * 1e-9
                errors.write(wrong.tobytes())
            self._errors[bus] = errors.view(np.float64)
            found = self._buses[bus] = {can_id: one.frames() for can_id, one in collected.items()}
        return found

    def _packed(self, bus: str) -> dict[int, Frames] | None:
        """Return the frames of a log that is packed, without making them; None: it is not, or it is long."""
        log = self._trace.raw_frames(bus)
        columns = log.columns() if isinstance(log, PackedFrames) and len(log) <= _PART else None
        if columns is None:
            return None
        wrong = columns.wrong
        time_s = columns.time_ns.astype(np.float64) * 1e-9
        self._errors[bus] = time_s[wrong]
        remotes = self._remotes.setdefault(bus, {})
        for place in np.flatnonzero(columns.is_base_remote & ~wrong):
            remotes.setdefault(int(columns.can_id[place]), []).append(float(time_s[place]))
        senders = self._senders.setdefault(bus, {})
        at = np.flatnonzero(columns.is_base_data & ~wrong)
        can_id = columns.can_id[at]
        # By identifier, those of one in their order.
        order = np.argsort(can_id, kind="stable")
        at, can_id = at[order], can_id[order]
        firsts = np.flatnonzero(np.diff(can_id, prepend=-1))
        origins, records = columns.records["origin"][at].tolist(), columns.data[at]
        times, lengths = time_s[at], columns.lengths[at]
        found: dict[int, Frames] = {}
        for first, last in zip(firsts, [*firsts[1:], len(at)], strict=True):
            size = lengths[first:last]
            most = int(size.max())
            data = records[first:last, :most]
            whole = data.ravel() if int(size.min()) == most else data[np.arange(most) < size[:, None]]
            one = int(can_id[first])
            found[one] = Frames(times[first:last], size, whole)
            senders[one] = {columns.kinds[origin][0] for origin in set(origins[first:last])}
        return found

    def behind_errors(self, bus: str, times: NDArray[np.float64], span_s: float) -> NDArray[np.bool_] | None:
        """Return the times at most so long behind a frame with an error: what is sent then may have waited.

        None: there was no error on the bus.
        """
        self._of_bus(bus)
        errors = self._errors[bus]
        if not len(errors):
            return None
        last = np.searchsorted(errors, times, side="right") - 1
        return (last >= 0) & (times - errors[np.maximum(last, 0)] <= span_s)

    def identifiers(self, bus: str) -> frozenset[int]:
        """Return the identifiers of the data frames."""
        return frozenset(self._of_bus(bus))

    def senders(self, bus: str, can_id: int) -> set[str]:
        """Return who has sent data frames with an identifier."""
        self._of_bus(bus)
        return self._senders[bus].get(can_id, set())

    def remotes(self, bus: str, can_id: int) -> list[float]:
        """Return when the remote frames of an identifier have ended, s."""
        self._of_bus(bus)
        return self._remotes[bus].get(can_id, [])

    def of(self, bus: str, can_id: int) -> Frames:
        """Return the frames of an identifier."""
        return self._of_bus(bus).get(can_id, _NONE)


class Series(NamedTuple):
    """Values of a signal as they were on the bus."""

    time_s: NDArray[np.float64]
    values: NDArray[np.float64]

    def latest(self, times: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
        """Return the last value that was on the bus before each of some times, and where there was one."""
        at = np.searchsorted(self.time_s, times - 1e-9, side="right") - 1
        return self.values[np.maximum(at, 0)], at >= 0

    def age_s(self, times: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return how long ago the last value was sent at each of some times, s."""
        at = np.searchsorted(self.time_s, times - 1e-9, side="right") - 1
        return np.where(at >= 0, times - self.time_s[np.maximum(at, 0)], np.inf)


_WORDS_PER_PDO: Final = 4
_TO_DRIVE: Final = 0x200
_FROM_DRIVE: Final = 0x180
_CIA402: Final = {
    "controlword": (0x200, 0, "<u2"),
    "target_velocity": (0x200, 2, "<i4"),
    "mode": (0x200, 6, "<i1"),
    "statusword": (0x180, 0, "<u2"),
    "position": (0x180, 2, "<i4"),
    "torque": (0x180, 6, "<i2"),
    "velocity": (0x280, 0, "<i4"),
    "inputs": (0x280, 4, "<u4"),
    "error_code": (0x380, 0, "<u2"),
    "error_register": (0x380, 2, "<u1"),
}
"""Where the controller maps the objects of a CiA 402 drive: first identifier, byte, format."""
_LENGTHS: Final = {0x200: 7, 0x180: 8, 0x280: 8, 0x380: 3}


class ProcessData:
    """Cyclic data of a drive on CAN, by the mapping of the controller.

    Args:
        frames: The frames of all buses.
        bus: Bus of the drive.
        node: Its node-ID.
        words: Of a telegram: the first word of each signal, by `setpoint.NAME` and `actual.NAME`; of a
            CiA 402 drive None.

    """

    def __init__(self, frames: BusFrames, bus: str, node: int, words: Mapping[str, int] | None) -> None:
        self._frames = frames
        self._bus = bus
        self._node = node
        self._words = words
        self._found: dict[str, Series | None] = {}
        self._rows: dict[int, tuple[NDArray[np.float64], NDArray[np.uint8]] | None] = {}

    def __getitem__(self, name: str) -> Series | None:
        """Return a signal; None where it is not mapped, was not sent, or not in its length."""
        if name not in self._found:
            self._found[name] = self._object(name) if self._words is None else self._signal(name)
        return self._found[name]

    def when_whole(self, sent: Series) -> Series:
        """Return an actual value of a telegram at the times at which the last PDO of the telegram had come.

        The controller takes a telegram as a whole; that of a CiA 402 drive is no telegram.
        """
        if self._words is None or not len(sent.time_s):
            return sent
        total = self._words["actual.words"]
        last = self._word(_FROM_DRIVE, total - 1, total)
        if last is None:
            return sent
        at = np.searchsorted(last[0], sent.time_s - 1e-9)
        known = at < len(last[0])
        return Series(last[0][at[known]], sent.values[known])

    def _object(self, name: str) -> Series | None:
        place = _CIA402.get(name)
        if place is None:
            return None
        base, first, kind = place
        found = self._of(base, _LENGTHS[base])
        if found is None:
            return None
        format_ = np.dtype(kind)
        column = np.ascontiguousarray(found[1][:, first : first + format_.itemsize]).view(format_)[:, 0]
        return Series(found[0], column.astype(np.float64))

    def _of(self, base: int, length: int) -> tuple[NDArray[np.float64], NDArray[np.uint8]] | None:
        """Return times and bytes of the frames of an identifier; None where they have another length."""
        if base not in self._rows:
            found = self._frames.of(self._bus, base + self._node)
            rows = found.of_length(length)
            self._rows[base] = None if rows is None or not len(rows) else (found.time_s, rows)
        return self._rows[base]

    def _word(
        self, base: int, word: int, total: int
    ) -> tuple[NDArray[np.float64], NDArray[np.uint16]] | None:
        number = word // _WORDS_PER_PDO
        found = self._of(base + 0x100 * number, 2 * min(_WORDS_PER_PDO, total - number * _WORDS_PER_PDO))
        if found is None:
            return None
        first = 2 * (word % _WORDS_PER_PDO)
        return found[0], np.ascontiguousarray(found[1][:, first : first + 2]).view("<u2")[:, 0]

    def _signal(self, name: str) -> Series | None:
        words = self._words or {}
        side, _, signal = name.partition(".")
        if name not in words:
            return None
        total = words[f"{side}.words"]
        base = _TO_DRIVE if side == "setpoint" else _FROM_DRIVE
        first = self._word(base, words[name], total)
        if first is None:
            return None
        if signal not in _DOUBLE:
            kind = "<i2" if signal in _SIGNED else "<u2"
            return Series(first[0], first[1].view(kind).astype(np.float64))
        second = self._word(base, words[name] + 1, total)
        if second is None:
            return None
        # The halves may be in two PDOs, and a recording may begin between them.
        at = np.searchsorted(first[0], second[0], side="right") - 1
        paired = at >= 0
        both = first[1][at[paired]].astype(np.uint32) << 16 | second[1][paired]
        return Series(second[0][paired], both.view(np.int32).astype(np.float64))


_DOUBLE: Final = frozenset(
    ("NSOLL_B", "NIST_B", "G1_XIST1", "G1_XIST2", "G2_XIST1", "G2_XIST2", "XERR", "KPC")
)
_SIGNED: Final = frozenset(("NSOLL_A", "NIST_A", "MOMRED", "M_ADD1", "M_LIMIT_POS", "M_LIMIT_NEG", "M_ACT"))
