"""Times of the command line: `90s`, `5m`, `1h30m`."""

from __future__ import annotations

import re
from typing import Final

from hil.errors import CannotRunError

_PARTS: Final = re.compile(r"(?:(\d+)h)?(?:(\d+)m)?(?:(\d+)s?)?")


def parse_duration(option: str, text: str) -> float:
    """Return a duration in s; an empty text is 0.

    Raises:
        CannotRunError: It is no duration, or none above 0.

    """
    found = _PARTS.fullmatch(text)
    seconds = 0
    if found is not None:
        for part, factor in zip(found.groups(), (3600, 60, 1), strict=True):
            seconds += int(part or 0) * factor
    if text and not seconds:
        raise CannotRunError(f"{option} {text!r} is not allowed; allowed: a time such as 90s, 5m or 1h30m")
    return float(seconds)
