"""How busy a segment is, as a recorded signal."""

from __future__ import annotations

from typing import Final, Protocol

from fieldbus.clock import S

LOAD_COLUMNS: Final = (("load", "%"),)
"""Columns of a segment in the trace."""


class CountedSegment(Protocol):
    """A segment that knows the exact length of what it has carried."""

    @property
    def busy_bits(self) -> int:
        """Bit times for which the bus was occupied, since the segment exists."""


class LoadMeter:
    """The load of a segment over each application cycle (CANP-069).

    A frame counts in the cycle in which it ends, so that one cycle may show a little more than 100 %.

    Args:
        segment: The segment.
        bitrate: Its bit rate, bit/s.
        cycle_ns: Time between two rows, ns.

    """

    __slots__ = ("_before", "_percent_per_bit", "_segment")

    def __init__(self, segment: CountedSegment, *, bitrate: int, cycle_ns: int) -> None:
        self._segment = segment
        self._percent_per_bit = 100.0 * S / bitrate / cycle_ns
        self._before = segment.busy_bits

    def row(self) -> tuple[float]:
        """Return the load since the last call, %."""
        busy = self._segment.busy_bits
        load = (busy - self._before) * self._percent_per_bit
        self._before = busy
        return (load,)
