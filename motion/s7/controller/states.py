"""Operating states of the controller (section 1.9 of the instruction specification)."""

from __future__ import annotations

from enum import Enum


class OperatingState(Enum):
    """What the controller is doing; the value is its name in the history."""

    POWER_OFF = "power off"
    """Without supply: nothing is sent, nothing is calculated."""
    STOP = "STOP"
    """No program and no jobs, outputs off; technology data and inputs continue being updated (MC-632)."""
    STARTUP = "STARTUP"
    """The start-up program runs, outputs off, motion jobs are rejected (MC-631)."""
    RUN = "RUN"
    """Everything runs."""
