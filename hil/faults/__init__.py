"""Faults: what can break, when it breaks, and the injector that breaks it.

A `Fault` is a value that serialises to the bench's file format and back. `CATALOGUE` says which kinds there
are, with parameters, seam and the benches that can inject them. `Injector` arms faults on a bench and logs
every arming, application and removal as an event (`fault.armed`, `fault.applied`, `fault.removed`,
`fault.disarmed`), and every frame that is hit (`fault.hit`).
"""

from __future__ import annotations

from hil.faults._catalogue import CATALOGUE, fault_type
from hil.faults._compose import (
    AnyOf,
    ByChance,
    Every,
    InCondition,
    InSequence,
    any_of,
    chance,
    condition,
    every,
    sequence,
)
from hil.faults._fault import Fault
from hil.faults._injector import ArmedFault, Injector
from hil.faults._parameters import ENVIRONMENTS, Environment, FaultType, Parameter
from hil.faults._trigger import (
    AtTime,
    ComposedTrigger,
    Immediately,
    InState,
    OnEvent,
    OnFrame,
    SignalCrossing,
    Trigger,
    after,
    at,
    frame,
    immediately,
    on_event,
    position,
    signal,
    state,
    trigger_from_dict,
    velocity,
)
from hil.faults._trigger_catalogue import TRIGGERS

__all__ = [
    "CATALOGUE",
    "ENVIRONMENTS",
    "TRIGGERS",
    "AnyOf",
    "ArmedFault",
    "AtTime",
    "ByChance",
    "ComposedTrigger",
    "Environment",
    "Every",
    "Fault",
    "FaultType",
    "Immediately",
    "InCondition",
    "InSequence",
    "InState",
    "Injector",
    "OnEvent",
    "OnFrame",
    "Parameter",
    "SignalCrossing",
    "Trigger",
    "after",
    "any_of",
    "at",
    "chance",
    "condition",
    "every",
    "fault_type",
    "frame",
    "immediately",
    "on_event",
    "position",
    "sequence",
    "signal",
    "state",
    "trigger_from_dict",
    "velocity",
]
