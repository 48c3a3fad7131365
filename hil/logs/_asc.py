"""Lines of a Vector ASC file as the reader of python-can takes them, whatever
its header leaves out or says.
"""

from __future__ import annotations

import io
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Final

from fieldbus.clock import S

_HEADER: Final = re.compile(r"\s*(//|date\s|base\s|(no\s+)?internal\s+events\s+logged)", re.IGNORECASE)
_EVENTS: Final = re.compile(r"\s*(no\s+)?internal\s+events\s+logged", re.IGNORECASE)
_RELATIVE: Final = re.compile(r"\s*base\s+(hex|dec)\s+timestamps\s+relative", re.IGNORECASE)
_TIMED: Final = re.compile(r"\s*(\d+)\.(\d{1,9})(\s.*)", re.DOTALL)


class AscLines(io.TextIOBase):
    """The lines of an ASC file, with times from its begin.

    With `timestamps relative` every event, CAN frame or not, has the time since the one before it: the times
    are added up. A header without `internal events logged` gets that line, because the reader would take the
    first frame for it. Comments in the code page of another country are no hindrance.
    """

    def __init__(self, path: Path) -> None:
        super().__init__()
        self._stream = path.open(encoding="utf-8", errors="replace")
        self._lines = self._read()

    def __iter__(self) -> Iterator[str]:  # type: ignore[override]  # of text, as io.TextIOBase itself gives
        return self._lines

    def close(self) -> None:
        """Close the file."""
        self._stream.close()
        super().close()

    def _read(self) -> Iterator[str]:
        relative = False
        body = False
        total_ns = 0
        for line in self._stream:
            if not body:
                if not line.strip() or _EVENTS.match(line):
                    continue
                relative = relative or _RELATIVE.match(line) is not None
                if _HEADER.match(line):
                    yield line
                    continue
                body = True
                yield "no internal events logged\n"
            timed = _TIMED.match(line) if relative else None
            if timed is None:
                yield line
                continue
            total_ns += int(timed[1]) * S + int(timed[2].ljust(9, "0"))
            seconds, rest = divmod(total_ns, S)
            yield f"{seconds}.{rest:09d}{timed[3]}"
