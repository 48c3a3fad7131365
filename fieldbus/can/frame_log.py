"""The log of a virtual segment: every frame on the wire, and how long the bus was occupied."""

from __future__ import annotations

from fieldbus.can.frame import CanFrame
from fieldbus.can.timing import INTERMISSION_BITS, frame_bits
from fieldbus.clock import S

LogEntry = tuple[int, str, CanFrame, str]
"""A frame on the wire: time of its end (ns), name of the sender, the frame, the error ("" = it was good)."""


class FrameLog:
    """Frames in the order of the wire, and the time that the bus was occupied by each.

    Args:
        bitrate: Bit rate of the segment, bit/s.
        enabled: Whether anything is written.

    """

    def __init__(self, bitrate: int, *, enabled: bool) -> None:
        self.enabled = enabled
        self.entries: list[LogEntry] = []
        """Those in memory: grows, is never replaced."""
        self._bitrate = bitrate
        self._intermission_ns = INTERMISSION_BITS * S // bitrate
        self._dropped = 0
        # Start and end (ns) on the bus by place in the log, of entries whose length is not that of the frame.
        self._spans: dict[int, tuple[int, int]] = {}

    def write(self, end_ns: int, sender: str, frame: CanFrame, error: str) -> None:
        """Write a frame that has occupied the bus for its own length."""
        if self.enabled:
            self.entries.append((end_ns, sender, frame, error))

    def write_span(
        self, span_ns: tuple[int, int], end_ns: int, sender: str, frame: CanFrame, error: str
    ) -> int | None:
        """Write an attempt that has occupied the bus from `span_ns[0]` to `span_ns[1]`.

        Returns:
            Its place, for `extend`; None: the log is not kept.

        """
        if not self.enabled:
            return None
        place = self._dropped + len(self.entries)
        self._spans[place] = span_ns
        self.entries.append((end_ns, sender, frame, error))
        return place

    def extend(self, place: int, free_ns: int) -> None:
        """Let the attempt at `place` have occupied the bus up to `free_ns`."""
        span = self._spans.get(place)
        if span is not None:
            self._spans[place] = (span[0], free_ns)

    def drop(self, count: int) -> None:
        """Remove the oldest entries; the places of the others stay as they are."""
        del self.entries[:count]
        for place in range(self._dropped, self._dropped + count) if self._spans else ():
            self._spans.pop(place, None)
        self._dropped += count

    def reaches(self, since_ns: int) -> bool:
        """Whether the entries go back to a time."""
        return not self._dropped or (bool(self.entries) and self.entries[0][0] <= since_ns)

    def last_sender(self) -> str | None:
        """Return who sent the last frame; None: it is not known."""
        return self.entries[-1][1] if self.enabled and self.entries else None

    def busy_ns(self, since_ns: int, now_ns: int) -> int:
        """Return how long frames that have ended have occupied the bus between two times, ns."""
        busy = 0
        for place in range(len(self.entries) - 1, -1, -1):
            end, _, frame, _ = self.entries[place]
            span = self._spans.get(self._dropped + place)
            if span is None:
                free = end + self._intermission_ns
                span = free - frame_bits(frame) * S // self._bitrate, free
            start, free = span
            if free <= since_ns:
                break
            busy += min(free, now_ns) - max(start, since_ns)
        return busy
