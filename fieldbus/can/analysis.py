"""Figures about the traffic of a segment: load and worst-case response times
ahead of time, jitter afterwards.

The calculations are those that a bus is laid out with; a test compares them with
what the virtual segment does.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from itertools import pairwise
from typing import Final, NamedTuple

from fieldbus.can.frame import CanFrame
from fieldbus.can.frame_log import LogEntry
from fieldbus.can.timing import arbitration_key, frame_bits, worst_case_bits
from fieldbus.clock import S
from fieldbus.errors import BusError


class BitTiming(NamedTuple):
    """What CiA 301 recommends for a bit rate."""

    bus_length_m: int
    """Guide to the longest bus, m."""
    sample_point: float
    """Place of the sample point in the bit, 0..1."""
    sample_point_range: tuple[float, float]
    """Tolerance of the sample point, 0..1."""


BIT_TIMING: Final = {
    1_000_000: BitTiming(25, 0.75, (0.75, 0.90)),
    800_000: BitTiming(50, 0.80, (0.75, 0.90)),
    500_000: BitTiming(100, 0.875, (0.85, 0.90)),
    250_000: BitTiming(250, 0.875, (0.85, 0.90)),
    125_000: BitTiming(500, 0.875, (0.85, 0.90)),
    50_000: BitTiming(1000, 0.875, (0.85, 0.90)),
    20_000: BitTiming(2500, 0.875, (0.85, 0.90)),
    10_000: BitTiming(5000, 0.875, (0.85, 0.90)),
}
"""The bit rates of CiA 301, bit/s (CANP-060 to CANP-067)."""


class PeriodicFrame(NamedTuple):
    """A frame that a node sends again and again."""

    frame: CanFrame
    """Identifier and length; the content does not matter where the worst case is asked for."""
    period_ns: int
    """Least distance of two requests, ns (> 0)."""
    jitter_ns: int = 0
    """How much later than its period a request may come, ns."""


def worst_case_time_ns(frame: CanFrame, bitrate: int) -> int:
    """Return the longest that a frame of this format and length can be,
    intermission included, ns (CANP-016).
    """
    return worst_case_bits(len(frame.data), extended=frame.extended) * S // bitrate


def planned_load(traffic: Iterable[PeriodicFrame], bitrate: int, *, exact: bool = False) -> float:
    """Return the part of the time that `traffic` occupies the bus, 0..1 and above
    if it does not fit (CANP-069).

    Args:
        traffic: The frames.
        bitrate: bit/s.
        exact: With the stuff bits that these very frames have; otherwise with the most that they can have.

    """
    load = 0.0
    for frame, period_ns, _ in traffic:
        bits = frame_bits(frame) if exact else worst_case_bits(len(frame.data), extended=frame.extended)
        load += bits * S / bitrate / period_ns
    return load


def response_time_ns(wanted: PeriodicFrame, traffic: Sequence[PeriodicFrame], bitrate: int) -> int | None:
    """Return the longest time from the request of a frame to the end of its intermission, ns (CANP-032).

    R = J + w + C with w = B + sum of ceil((w + J_k + bit) / T_k) C_k over all frames of higher priority; B is
    the longest frame of lower priority. Errors on the bus are not in it.

    Args:
        wanted: The frame.
        traffic: All frames of the bus; `wanted` may be among them.
        bitrate: bit/s.

    Returns:
        The time; None when it exceeds the period of the frame, so that the bus is too full for it.

    Raises:
        BusError: A period is not positive.

    """
    if any(item.period_ns <= 0 for item in (wanted, *traffic)):
        raise BusError("the period of a frame is not positive")
    own = arbitration_key(wanted.frame)
    others = [item for item in traffic if item is not wanted]
    higher = [item for item in others if arbitration_key(item.frame) <= own]
    lower = [worst_case_time_ns(item.frame, bitrate) for item in others if arbitration_key(item.frame) > own]
    length = worst_case_time_ns(wanted.frame, bitrate)
    bit = S // bitrate
    blocked = max(lower, default=0)
    waiting = blocked
    while True:
        longer = blocked + sum(
            -(-(waiting + item.jitter_ns + bit) // item.period_ns) * worst_case_time_ns(item.frame, bitrate)
            for item in higher
        )
        if wanted.jitter_ns + longer + length > wanted.period_ns:
            return None
        if longer == waiting:
            return wanted.jitter_ns + waiting + length
        waiting = longer


class ArrivalStatistics(NamedTuple):
    """How regularly a frame arrived, against a grid of its period."""

    arrivals: int
    earliest_ns: int
    """Least deviation from the grid, ns; the grid begins at the earliest arrival that the traffic allows, so
    >= 0.
    """
    latest_ns: int
    """Greatest deviation, ns."""
    mean_ns: float
    deviation_ns: float
    """Standard deviation, ns."""
    shortest_ns: int
    """Least distance of two arrivals, ns."""
    longest_ns: int
    """Greatest distance, ns."""


def arrival_statistics(
    arrivals_ns: Sequence[int], period_ns: int, *, phase_ns: int | None = None
) -> ArrivalStatistics:
    """Return how late the arrivals of a cyclic frame such as SYNC were (CANP-070).

    Args:
        arrivals_ns: Times of arrival in their order, ns; two at least.
        period_ns: Period of the producer, ns.
        phase_ns: Time at which the first would have arrived without any delay; default: such that the
            earliest is 0 late.

    Raises:
        BusError: Fewer than two arrivals, or a period that is not positive.

    """
    if len(arrivals_ns) < 2 or period_ns <= 0:
        raise BusError("statistics need two arrivals and a period > 0 ns")
    base = arrivals_ns[0] if phase_ns is None else phase_ns
    late = [time_ns - base - round((time_ns - base) / period_ns) * period_ns for time_ns in arrivals_ns]
    if phase_ns is None:
        earliest = min(late)
        late = [value - earliest for value in late]
    mean = sum(late) / len(late)
    deviation = math.sqrt(sum((value - mean) ** 2 for value in late) / len(late))
    gaps = [later - earlier for earlier, later in pairwise(arrivals_ns)]
    return ArrivalStatistics(len(late), min(late), max(late), mean, deviation, min(gaps), max(gaps))


def arrivals(log: Iterable[LogEntry], can_id: int, *, extended: bool = False) -> list[int]:
    """Return the times (ns) at which a good frame with this identifier ended."""
    return [
        end
        for end, _, frame, error in log
        if not error and frame.can_id == can_id and frame.extended == extended
    ]
