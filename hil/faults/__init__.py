"""Faults: what can break, when it breaks, and the injector that breaks it.

A `Fault` is a value that serialises to the bench's file format and back. `CATALOGUE` says which kinds there
are, with parameters, seam and the benches that can inject them. `Injector` arms faults on a bench and logs
every arming, application and removal as an event (`fault.armed`, `fault.applied`, `fault.removed`,
`fault.disarmed`), and every frame that is hit (`fault.hit`).
"""

from __future__ import annotations

from hil.faults._catalogue import CATALOGUE, DRIVE_METHODS, ENCODER_FAULT_METHODS, fault_type
from hil.faults._fault import Fault
from hil.faults._injector import ArmedFault, Injector
from hil.faults._kind import FaultType
from hil.faults._parameters import ENVIRONMENTS, Environment, Parameter
from hil.faults._text import fault_from_text
from hil.faults._trigger import (
    TRIGGERS,
    AnyOf,
    AtTime,
    ByChance,
    Every,
    Immediately,
    InCondition,
    InSequence,
    InState,
    OnEvent,
    OnFrame,
    SignalCrossing,
    Trigger,
    after,
    any_of,
    at,
    chance,
    condition,
    every,
    frame,
    immediately,
    on_event,
    position,
    sequence,
    signal,
    state,
    trigger_from_dict,
    velocity,
)

__all__ = [
    "CATALOGUE",
    "DRIVE_METHODS",
    "ENCODER_FAULT_METHODS",
    "ENVIRONMENTS",
    "TRIGGERS",
    "AnyOf",
    "ArmedFault",
    "AtTime",
    "ByChance",
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
    "fault_from_text",
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
