"""Error confinement of a CAN node: states, limits of the error counters, lengths (CANP-038..057)."""

from __future__ import annotations

from enum import Enum
from typing import Final

WARNING_LIMIT: Final = 96
PASSIVE_LIMIT: Final = 128
BUS_OFF_LIMIT: Final = 256
REC_LIMIT: Final = 255
"""Where the receive error counter stops, as the 8-bit register of a controller does."""
REC_AFTER_PASSIVE: Final = 119
"""Receive error counter after a good reception in error passive (CANP-052)."""

FLAG_BITS: Final = 6
DELIMITER_BITS: Final = 8
SUSPEND_BITS: Final = 8
"""What an error-passive transmitter waits beyond the intermission (CANP-008, -042)."""

RECOVERY_SEQUENCES: Final = 128
RECOVERY_SEQUENCE_BITS: Final = 11


class NodeState(Enum):
    """Whether and how a node takes part in the traffic; the values are the terms of FMI-LS-BUS."""

    ERROR_ACTIVE = "ERROR_ACTIVE"
    ERROR_PASSIVE = "ERROR_PASSIVE"
    BUS_OFF = "BUS_OFF"


class ErrorCode(Enum):
    """What went wrong on the wire; the values are the terms of FMI-LS-BUS."""

    BIT = "BIT_ERROR"
    STUFF = "BIT_STUFFING_ERROR"
    FORM = "FORM_ERROR"
    CRC = "CRC_ERROR"
    ACK = "ACK_ERROR"


def state_of(tec: int, rec: int) -> NodeState:
    """Return the state that belongs to the counters (CANP-053, -054)."""
    if tec >= BUS_OFF_LIMIT:
        return NodeState.BUS_OFF
    if tec >= PASSIVE_LIMIT or rec >= PASSIVE_LIMIT:
        return NodeState.ERROR_PASSIVE
    return NodeState.ERROR_ACTIVE


def rec_after_reception(rec: int) -> int:
    """Return the receive error counter after a good frame (CANP-052)."""
    if rec >= PASSIVE_LIMIT:
        return REC_AFTER_PASSIVE
    return rec - 1 if rec else 0
