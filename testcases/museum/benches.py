"""Benches whose devices behave as an entry of the museum tells."""

from __future__ import annotations

from typing import Final

from hil.bench import BenchFile
from testcases.campaigns._led_servo import BENCH, DRIVE

UNPRIMED: Final[BenchFile] = BENCH.configured({"drive": {DRIVE: {"personality": "unprimed-csp-servo"}}})
"""A drive that goes to position 0 in csp before it has got a target."""
