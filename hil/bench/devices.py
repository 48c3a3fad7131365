"""Emulated devices of a bench file that are nothing but their EDS."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, Final

if TYPE_CHECKING:
    from emulators.station import CanopenDevice
    from fieldbus.clock import Scheduler
    from fieldbus.history import History
    from hil.bench.config import BenchConfig

DEVICE_METHODS: Final = frozenset(("power_off", "power_on", "stop_heartbeat", "get", "set"))
"""Methods of a device that may be called through the pipe."""


def build_device(
    scheduler: Scheduler, segments: Mapping[str, Any], config: BenchConfig, name: str, *, history: History
) -> CanopenDevice:
    """Return the emulated device that `device.NAME` describes, still switched off."""
    from emulators.station import CanopenDevice

    section = config.device[name]
    return CanopenDevice(
        scheduler,
        segments[section.segment],
        section.eds,
        section.node_id,
        name=name,
        history=history,
        storage=section.storage,
    )
