"""Fields of a segment as the data block of a cam has them (CAM-006 to CAM-008)."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

from motion.kernel.cams import Segment

SEGMENT_FIELDS: Final = (
    "xmin", "xmax", "a0", "a1", "a2", "a3", "a4", "a5", "a6", "sineAmplitude", "sinePeriod", "sinePhase",
)  # fmt: skip
"""Fields of `TO_Cam_Struct_SegmentData`."""


def segment_of(values: Sequence[float]) -> Segment:
    """Return the segment with values in the order of `SEGMENT_FIELDS`."""
    a = (values[2], values[3], values[4], values[5], values[6], values[7], values[8])
    return Segment(values[0], values[1], a, amplitude=values[9], rate=values[10], phase=values[11])


def segment_values(segment: Segment) -> tuple[float, ...]:
    """Return the values of a segment in the order of `SEGMENT_FIELDS`."""
    return (segment.xmin, segment.xmax, *segment.a, segment.amplitude, segment.rate, segment.phase)
