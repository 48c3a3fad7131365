"""Recording a bench and reading what was recorded.

`Recorder` samples columns once per cycle; `Trace` is the immutable result, with signals by name
(`trace["axis1.actual_velocity"]`), the event log and the frames of the buses.
"""

from __future__ import annotations

import fieldbus  # noqa: F401 - puts the compiled core in place, if there is one
from hil.record._carried import CarriedRecording, Carrier
from hil.record._compare import Difference, first_difference
from hil.record._frames import BusFrame, PackedFrames
from hil.record._homing import homing_drawings
from hil.record._kinds import EVENT_KINDS, check_event_kind
from hil.record._received_rows import ReceivedRows
from hil.record._recorder import MEMORY_MB, STORE_EVERY_NS, Group, Recorder
from hil.record._select import EventSelector, event, kind_matches
from hil.record._signal import Direction, Signal
from hil.record._trace import Trace, TraceFrame, TraceGroup, protocol_of
from hil.record._vocabulary import (
    EVENT_DETAILS,
    Vocabulary,
    check_component,
    check_selector,
    check_state,
    similar_signals,
)

__all__ = [
    "EVENT_DETAILS",
    "EVENT_KINDS",
    "MEMORY_MB",
    "STORE_EVERY_NS",
    "BusFrame",
    "CarriedRecording",
    "Carrier",
    "Difference",
    "Direction",
    "EventSelector",
    "Group",
    "PackedFrames",
    "ReceivedRows",
    "Recorder",
    "Signal",
    "Trace",
    "TraceFrame",
    "TraceGroup",
    "Vocabulary",
    "check_component",
    "check_event_kind",
    "check_selector",
    "check_state",
    "event",
    "first_difference",
    "homing_drawings",
    "kind_matches",
    "protocol_of",
    "similar_signals",
]
