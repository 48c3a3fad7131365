"""What a new job does to a running one on a synchronous axis, and what becomes of itself: the table of
synchronous jobs (OVR-025 to OVR-038) and its footnotes, as data.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final, NamedTuple

_COLUMNS: Final[Mapping[str, str]] = {
    "gear-in": "S1",
    "gear-in-velocity": "S2",
    "gear-in-velocity-free": "S2",
    "gear-in-pos-waiting": "S3", "cam-in-waiting": "S3",
    "gear-in-pos": "S4", "cam-in": "S4",
    "phasing-absolute": "S5", "phasing-relative": "S5",
    "offset-absolute": "S6", "offset-relative": "S6",
    "additive": "S7",
    "gear-out-waiting": "S8", "cam-out-waiting": "S8",
    "gear-out": "S9", "cam-out": "S9",
}  # fmt: skip
RUNNING: Final = tuple(_COLUMNS)
"""Running jobs, each of them in its column of the table; `free`: not position-controlled."""
_TABLE: Final = """
OVR-025 homing-3 homing-5                              : AT AT -P -R -R -R -P -R -R
OVR-026 halt halt-basic absolute relative velocity jog : AT AT -P AT AT AT -P AT AT
OVR-027 absolute-buffered relative-buffered            : -W -W -P -W -W -W -P -W -W
OVR-028 motion-in-velocity motion-in-position          : AT AT -P AT AT AT -P AT AT
OVR-029 superimposed motion-in-superimposed            : -P -P -P -P -P -P -P -P -P
OVR-029 halt-superimposed                              : -D -D -D -D -D -D -D -D -D
OVR-030 stop                                           : AT AT AT AT AT AT -P AT AT
OVR-031 gear-in gear-in-velocity                       : AT AT AT AT AT AT -P AT AT
OVR-032 gear-in-pos-waiting cam-in-waiting             : -W -W AW -W -W -W -W AW -W
OVR-033 gear-in-pos cam-in                             : AT AT AT AT AT AT -P AT AT
OVR-034 phasing-absolute phasing-relative              : -P NR -R -P AT NR -P -P -R
OVR-035 offset-absolute offset-relative                : -P NR -R -P NR AT -P -P -R
OVR-036 additive                                       : -P -P -P -P -P -P AT -P -P
OVR-037 gear-out-waiting cam-out-waiting               : -W NR AD -W -W -W -W AW -R
OVR-038 gear-out cam-out                               : AT NR AD AT AT AT -P AT -R
"""
"""First letter, the running job: A is aborted, - and N go on. Second letter, the new one: T takes over, P
runs in parallel, W waits, R is refused, D is done at once.
"""
SHIFTS: Final = ("phasing-absolute", "phasing-relative", "offset-absolute", "offset-relative")
"""Jobs that shift a value of a synchronous job."""
LEAVING: Final = ("gear-out", "cam-out", "gear-out-waiting", "cam-out-waiting")
"""Jobs that leave the leading value."""
_NO_SHIFT: Final = {"S2": 0x8079, "S3": 0x8075, "S5": 0x808A, "S6": 0x808A, "S9": 0x80A9}
"""ErrorIDs of shifts: behind a gear of velocities, without a synchronous job, while the other value is
shifted, and not synchronous.
"""
_NOTHING_TO_LEAVE: Final = {"gear": 0x8077, "cam": 0x8078}
_COUPLED: Final = 0x80A1
"""Active homing is refused: the axis is coupled."""
_NOT_CONTROLLED: Final = 0x8071
"""Active homing is refused: the axis is not position-controlled."""
_ENTRIES: Final = ("gear-in-pos", "cam-in", "gear-in-pos-waiting", "cam-in-waiting")
"""Jobs that lead the axis to a synchronous position."""


class Pair(NamedTuple):
    """A running job and a new one."""

    identifier: str
    new: str
    aborts: bool
    """Whether the running job is aborted."""
    fate: str
    """Of the new job: T, P, W, R or D."""
    error_id: int = 0
    """Of a refusal; 0: any."""

    @property
    def words(self) -> str:
        """Identifier of the requirement on the letter of the running job."""
        return "OVR-001" if self.aborts else "OVR-007"


def pairs(running: str) -> list[Pair]:
    """Return the pairs of a running job with every new one."""
    column = _COLUMNS[running]
    found = []
    for line in _TABLE.strip().splitlines():
        head, _, letters = line.partition(":")
        identifier, *jobs = head.split()
        letter, fate = letters.split()[int(column[1]) - 1]
        found += [_pair(running, column, identifier, new, letter, fate) for new in jobs]
    return found


def _pair(running: str, column: str, identifier: str, new: str, letter: str, fate: str) -> Pair:
    if running == "gear-in-velocity-free":
        if identifier == "OVR-025":
            return Pair("SYN-422", new, False, "R", _NOT_CONTROLLED)
        if identifier == "OVR-029" or new in _ENTRIES:  # footnote 5
            return Pair(identifier, new, False, "R")
    if new in LEAVING:
        kind = new.partition("-")[0]
        # Footnote 6: MC_GearOut ends gears, MC_CamOut cams; what is shifted here is a gear.
        left = "cam" if running.startswith("cam") or (running == "additive" and kind == "cam") else "gear"
        if kind != left:
            return Pair(identifier, new, False, "R", _NOTHING_TO_LEAVE[kind])
        if fate == "R":
            return Pair(identifier, new, False, "R", _NOTHING_TO_LEAVE[kind])
    if fate != "R":
        return Pair(identifier, new, letter == "A", fate)
    if new in SHIFTS:
        return Pair(identifier, new, False, "R", _NO_SHIFT[column])
    return Pair(identifier, new, False, "R", _COUPLED if identifier == "OVR-025" else 0)
