"""Hardware-in-the-loop benches for motion control: faults, expectations, campaigns, replay.

The names below are loaded when they are first used, so that importing the package costs nothing.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from hil.campaign import Campaign, Case, CaseContext, Runner, RunOptions, Token
    from hil.faults import CATALOGUE, Fault, Injector
    from hil.record import Recorder, Signal, Trace, event

_HOMES = {
    "CATALOGUE": "hil.faults",
    "Campaign": "hil.campaign",
    "Case": "hil.campaign",
    "CaseContext": "hil.campaign",
    "Fault": "hil.faults",
    "Injector": "hil.faults",
    "Recorder": "hil.record",
    "RunOptions": "hil.campaign",
    "Runner": "hil.campaign",
    "Signal": "hil.record",
    "Token": "hil.campaign",
    "Trace": "hil.record",
    "event": "hil.record",
}

__all__ = [
    "CATALOGUE",
    "Campaign",
    "Case",
    "CaseContext",
    "Fault",
    "Injector",
    "Recorder",
    "RunOptions",
    "Runner",
    "Signal",
    "Token",
    "Trace",
    "event",
]


def __getattr__(name: str) -> Any:
    home = _HOMES.get(name)
    if home is None:
        raise AttributeError(f"module 'hil' has no attribute {name!r}")
    return getattr(import_module(home), name)
