"""The load of a CAN segment, as the recorder samples it."""

from __future__ import annotations

from typing import Final, Protocol

from fieldbus.clock import S

LOAD_COLUMNS: Final = (("load", "%"),)
"""Columns of a CAN segment in the trace."""


class CountsBits(Protocol):
    """A segment that knows what it has carried."""

    @property
    def busy_bits(self) -> int:
        """Bit times for which the bus was occupied since the segment exists."""


class LoadMeter:
    """The load of a CAN segment over each application cycle (CANP-069).

    A frame counts in the cycle in which it ends, so that one cycle may show a little more than 100 %.

    Args:
        segment: The segment; it knows the exact length of what it has carried.
        bitrate: Its bit rate, bit/s.
        cycle_ns: Time between two rows, ns.

    """

    def __init__(self, segment: CountsBits, *, bitrate: int, cycle_ns: int) -> None:
        self._segment = segment
        self._percent_per_bit = 100.0 * S / bitrate / cycle_ns
        self._before = segment.busy_bits

    def row(self) -> tuple[float]:
        """Return the load since the last call, %."""
        busy = self._segment.busy_bits
        load = (busy - self._before) * self._percent_per_bit
        self._before = busy
        return (load,)
