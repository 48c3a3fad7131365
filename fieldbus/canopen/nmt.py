"""NMT states, commands and identifiers of the predefined connection set (CiA 301; C301-001 to C301-021)."""

from __future__ import annotations

from collections.abc import Mapping
from enum import IntEnum
from functools import cache
from typing import Final


class NmtState(IntEnum):
    """State of a node; the value is the one in heartbeat and guarding frames."""

    INITIALISING = 0x00
    STOPPED = 0x04
    OPERATIONAL = 0x05
    PRE_OPERATIONAL = 0x7F


class NmtCommand(IntEnum):
    """Command specifier of the node control frame."""

    START = 0x01
    STOP = 0x02
    ENTER_PRE_OPERATIONAL = 0x80
    RESET_NODE = 0x81
    RESET_COMMUNICATION = 0x82


COB_NMT: Final = 0x000
COB_SYNC: Final = 0x080
COB_EMCY: Final = 0x080
COB_TIME: Final = 0x100
COB_TPDO: Final = (0x180, 0x280, 0x380, 0x480)
COB_RPDO: Final = (0x200, 0x300, 0x400, 0x500)
COB_SDO_SERVER: Final = 0x580
COB_SDO_CLIENT: Final = 0x600
COB_ERROR_CONTROL: Final = 0x700

UNCONFIGURED: Final = 0xFF
"""Node-ID of a node that has none and waits for LSS (C301-163)."""

STATE_OF_COMMAND: Final[dict[int, NmtState]] = {
    NmtCommand.START: NmtState.OPERATIONAL,
    NmtCommand.STOP: NmtState.STOPPED,
    NmtCommand.ENTER_PRE_OPERATIONAL: NmtState.PRE_OPERATIONAL,
}
"""Commands that lead straight into a state."""

_RESTRICTED: Final = (
    (0x000, 0x07F),
    (0x101, 0x180),
    (0x581, 0x5FF),
    (0x601, 0x67F),
    (0x6E0, 0x6FF),
    (0x701, 0x7FF),
)


def is_restricted(can_id: int) -> bool:
    """Say whether an 11-bit identifier must not be given to a configurable object (C301-012)."""
    return any(first <= can_id <= last for first, last in _RESTRICTED)


@cache
def predefined_identifiers(node_id: int) -> Mapping[int, int]:
    """Return the COB-IDs of the predefined connection set, keyed `index << 8 |
    sub-index` (C301-001 to C301-010).

    PDOs beyond the fourth have none: they are not valid.
    """
    result = {
        0x100500: COB_SYNC,
        0x101200: COB_TIME,
        0x101400: COB_EMCY + node_id,
        0x120001: COB_SDO_CLIENT + node_id,
        0x120002: COB_SDO_SERVER + node_id,
    }
    for number in range(0x200):
        known = number < len(COB_RPDO)
        result[(0x1400 + number) << 8 | 1] = COB_RPDO[number] + node_id if known else 1 << 31
        result[(0x1800 + number) << 8 | 1] = 1 << 30 | COB_TPDO[number] + node_id if known else 3 << 30
    return result
