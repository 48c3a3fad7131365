"""The triggers, with what each of them hears on a live bench."""

from __future__ import annotations

from typing import Final

_CONTROLLER: Final = "live: signals of the controller, once per application cycle"
_EVENTS: Final = "live: what the controller tells; drive.*, encoder.*, emcy.raised and nmt.state are refused"
_PARTS: Final = "live: as its parts"

TRIGGERS: Final[dict[str, tuple[str, str]]] = {
    "immediately": ("As soon as the fault is armed", "live: yes"),
    "at": ("At a time of the bench", "live: yes"),
    "after": ("A time after arming", "live: yes"),
    "position": ("When the actual position of an axis passes a value", _CONTROLLER),
    "velocity": ("When the actual velocity of an axis passes a value", _CONTROLLER),
    "signal": ("When a recorded signal passes a value", _CONTROLLER),
    "condition": ("When a recorded signal is within limits, or a word has bits", _CONTROLLER),
    "state": ("When a component is in a state", _EVENTS),
    "event": ("At the n-th event of a kind: phase of a job, alarm, begin or end of another fault", _EVENTS),
    "frame": (
        "At the n-th frame that fits identifier, mask and data",
        "live: frames that a local port sends or receives, or that pass a bridge",
    ),
    "every": ("Again and again after arming", "live: yes"),
    "sequence": ("When the last of several triggers fires, one after the other", _PARTS),
    "any": ("Whenever one of several triggers fires", _PARTS),
    "chance": ("With a probability whenever another trigger fires", _PARTS),
}
"""Value of `when` in a file -> what it waits for, and what it hears on a live bench."""
