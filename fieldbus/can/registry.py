"""Names of segments, so that configuration text can point at a segment of the same process."""

from __future__ import annotations

from typing import TYPE_CHECKING
from weakref import WeakValueDictionary

from fieldbus.errors import BusError

if TYPE_CHECKING:
    from fieldbus.can.segment import CanSegment

_segments: WeakValueDictionary[str, CanSegment] = WeakValueDictionary()


def register_segment(segment: CanSegment, name: str | None = None) -> None:
    """Make `segment` known under `name` (default: its own); the latest bearer of a name holds it.

    The registry does not keep a segment alive.
    """
    _segments[segment.name if name is None else name] = segment


def find_segment(name: str) -> CanSegment:
    """Return the segment registered as `name`.

    Raises:
        BusError: There is none; the message lists the known names.

    """
    segment = _segments.get(name)
    if segment is None:
        known = ", ".join(sorted(_segments)) or "none"
        raise BusError(f"no CAN segment is registered as {name!r}; registered: {known}")
    return segment
