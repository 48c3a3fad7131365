"""The reference axis as a vertical one: a load that would fall, and a holding brake that takes time to open
and to close.
"""

from __future__ import annotations

from typing import Final

from hil.bench import BenchFile, load_bench

HOLDING_NM: Final = 4.0
"""Torque of the brake; the load needs 0.8 Nm."""
OPENING_S: Final = 0.06
CLOSING_S: Final = 0.08

_HANGING: Final = f"""
[drive.drive1.brake]
torque_nm = {HOLDING_NM}
opening_time_ms = {OPENING_S * 1000.0}
closing_time_ms = {CLOSING_S * 1000.0}

[drive.drive1.mechanics]
gravity_n = -500.0
"""

BENCH: Final = BenchFile("hanging load", load_bench("reference").text + _HANGING)
