"""What an emulated device of the bench file is built with."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from numpy.random import Generator

    from fieldbus.can.segment import CanSegment
    from fieldbus.clock import Scheduler
    from fieldbus.history import History
    from hil.bench.bench_config import BenchTable


@dataclass(frozen=True, kw_only=True)
class DeviceSite:
    """Where an emulated device works.

    Args:
        name: Its name in the bench file.
        bench: `[bench]`.
        scheduler: Time of the bench.
        segments: Segments by name; a device on Modbus is attached later.
        history: Log of the bench.
        rng: Random stream of the device.

    """

    name: str
    bench: BenchTable
    scheduler: Scheduler
    segments: Mapping[str, CanSegment]
    history: History
    rng: Generator
