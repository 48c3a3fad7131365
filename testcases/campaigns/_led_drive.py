"""A PROFIdrive drive without an axis, led word by word in telegram 3."""

from __future__ import annotations

from typing import Final

from hil.bench import BenchFile

BENCH: Final = BenchFile(
    "led drive",
    """
[bench]
name = "led drive"
kind = "virtual"
cycle_ms = 4

[segment.can0]
bitrate = 1_000_000

[drive.drive1]
profile = "profidrive"
telegram = 3
segment = "can0"
node_id = 5
""",
)
