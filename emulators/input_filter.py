"""Filter of digital inputs."""

from __future__ import annotations

from typing import Final

INPUT_FILTER_MS: Final = 6.4
"""Filter time of a digital input unless it is configured otherwise, ms (LIM-026, LIM-105)."""
