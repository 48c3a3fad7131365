"""A rule about objects that are read by SDO: they say what the drive shows."""

from __future__ import annotations

from typing import Final

import numpy as np

from hil.expect.rules._definition import Judged, Rule
from hil.expect.rules._views import DriveView

_ANSWER, _REQUEST = 0x580, 0x600
_EXPEDITED: Final = 0x43
"""Answer to an upload with up to four bytes."""
_SHOWN: Final = {0x6041: "statusword", 0x603F: "error_code", 0x6064: "encoder_increments"}
"""Objects of a CiA 402 drive with the column that has the same."""
_HOME_OFFSET: Final = b"\x7c\x60"


def _objects(drive: DriveView) -> Judged | None:
    if drive.number("standard") != 1.0 or drive.data is None or not drive.has(*_SHOWN.values()):
        return None
    if drive.node is None:
        return None
    bus, node = drive.node
    times, found = drive.time_s, []
    # 607Ch moves 6064h against the encoder.
    moved = any(data[1:3] == _HOME_OFFSET for _, data in drive.whole.frames.of(bus, _REQUEST + node).each())
    # So does a homing, whatever the offset.
    homed = min(
        (one.time_ns * 1e-9 for one in drive.whole.events.of(drive.name, "drive.homing")), default=np.inf
    )
    for when, data in drive.whole.frames.of(bus, _ANSWER + node).each():
        if len(data) != 8 or data[0] & 0xE3 != _EXPEDITED or data[3]:
            continue
        column = _SHOWN.get(int.from_bytes(data[1:3], "little"))
        if column is None or ((moved or when >= homed) and column == "encoder_increments"):
            continue
        at = int(np.searchsorted(times, when))
        if not 2 <= at < len(times) - 2:
            continue
        size = 4 - (data[0] >> 2 & 3)
        value = int.from_bytes(data[4 : 4 + size], "little", signed=column == "encoder_increments")
        around = drive.word(column)[at - 2 : at + 2]
        if column == "encoder_increments":
            slack = int(np.ptp(around)) + 2
            good = around.min() - slack <= value <= around.max() + slack
        elif column == "statusword":
            if np.ptp(around):  # it may have had a value between two samples that neither of them has
                continue
            good = value == around[0]
        else:
            good = value in around
        found.append(
            (
                when,
                "" if good else f"{data[2]:02X}{data[1]:02X}h = {value}, the drive shows {int(around[-1])}",
            )
        )
    return Judged.of_list(found) if found else None


OBJECTS: Final = Rule(
    name="objects of the drive",
    says="6041h, 603Fh and 6064h read by SDO are what the drive shows",
    requirements=("C402-039",),
    tolerance="that of the samples around; 6041h while it stays, 6064h before any homing and "
    "without home offset (607Ch)",
    judge=_objects,
    excused_by=("frame.", "can.", "sdo.", "drive.", "encoder.", "mechanics."),
    recovery_s=1.0,
)

DRIVE_RULES: Final[tuple[Rule[DriveView], ...]] = (OBJECTS,)
