"""What rules ask of a component of the trace again and again: columns, bits and states on one grid.

Fifty rules look at the same few columns of the same few hundred samples: what they have in common is
computed once. It is handed out as it is kept, so the arrays cannot be written to.
"""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Callable, Iterable
from functools import cached_property
from typing import TYPE_CHECKING, Any, Self, TypeVar, cast

import numpy as np

from hil.expect._words import state_codes, where_code
from hil.expect.rules._definition import Flags, Numbers, Words

if TYPE_CHECKING:
    from fieldbus.history import Event
    from hil.record import Trace

Found = TypeVar("Found")
Kept = TypeVar("Kept", bound=np.ndarray[Any, Any])


class ComponentView:
    """A component of a trace.

    Args:
        trace: Where it is; one of a bench, in which all columns of a component have the same samples.
        name: Its name.

    """

    def __init__(self, trace: Trace, name: str) -> None:
        self.name = name
        self._trace = trace
        self._group = next(group for group in trace.groups if group.name == name)
        self._names = frozenset(column for column, _ in self._group.columns)
        self._columns: dict[str, Numbers] = {}
        self._words: dict[str, Words] = {}
        self._bits: dict[tuple[str, int], Flags] = {}
        self._states: dict[tuple[str, ...], Flags] = {}
        self._once: dict[object, object] = {}
        self._places: dict[int, int] = {}

    @cached_property
    def time_s(self) -> Numbers:
        """Time of every sample."""
        times: Numbers = (self._group.time_ns * 1e-9).astype(np.float64)
        return kept(times)

    @cached_property
    def _time_ns(self) -> list[int]:
        whole: list[int] = self._group.time_ns.tolist()
        return whole

    def has(self, *columns: str) -> bool:
        """Return whether columns are recorded."""
        return self._names.issuperset(columns)

    def __getitem__(self, column: str) -> Numbers:
        found = self._columns.get(column)
        if found is None:
            found = self._columns[column] = self._trace[f"{self.name}.{column}"].values
        return found

    def unit(self, column: str) -> str:
        """Return the unit of a column."""
        return self._trace[f"{self.name}.{column}"].unit

    def word(self, column: str) -> Words:
        """Return a column as whole numbers."""
        found = self._words.get(column)
        if found is None:
            found = self._words[column] = kept(self[column].astype(np.int64))
        return found

    def note_bits(self, column: str, bits: Iterable[int]) -> None:
        """Note that bits of a word were looked at."""
        self._trace.looked_at.update(f"{self.name}.{column}.X{bit}" for bit in bits)

    def bit(self, number: int, column: str = "status_word") -> Flags:
        """Return a bit of a word."""
        found = self._bits.get((column, number))
        if found is None:
            self.note_bits(column, (number,))
            found = self._bits[column, number] = kept(self.word(column) & 1 << number != 0)
        return found

    def in_states(self, *texts: str) -> Flags:
        """Return the samples in some states of the component, in the spelling `operation_enabled`."""
        found = self._states.get(texts)
        if found is None:
            enum = self._trace[f"{self.name}.state"].enum
            found = self._states[texts] = kept(where_code(self._state, state_codes(enum, texts)))
        return found

    @cached_property
    def _state(self) -> Numbers:
        return np.rint(self["state"])

    def shows(self, column: str, *texts: str) -> Flags:
        """Return the samples in which a column has one of some texts."""
        signal = self._trace[f"{self.name}.{column}"]
        codes = [code for code, text in signal.enum.items() if text in texts]
        return where_code(np.rint(signal.values), codes)

    def index_of(self, time_ns: int) -> int:
        """Return the first sample at or after a time."""
        found = self._places.get(time_ns)
        if found is None:
            found = self._places[time_ns] = bisect_left(self._time_ns, time_ns)
        return found

    def near(self, events: Iterable[Event], before: int = 1, after: int = 1) -> Flags:
        """Return the samples around events: so many before the one that shows it first, so many after."""
        flags = np.zeros(len(self._time_ns), dtype=bool)
        for time_ns in {entry.time_ns: None for entry in events}:
            index = self.index_of(time_ns)
            flags[max(index - before, 0) : index + after + 1] = True
        return flags

    def once(self, compute: Callable[[Self], Found]) -> Found:
        """Return what a function makes of this component, computed for the first that asks."""
        if compute not in self._once:
            self._once[compute] = compute(self)
        return cast("Found", self._once[compute])


def kept(values: Kept) -> Kept:
    """Return an array that cannot be written to any more."""
    values.flags.writeable = False
    return values
