"""Which of two stops wins: the superseding matrix of the specification (section 10), as data."""

from __future__ import annotations

from typing import Final

MATRIX: Final = """
STP-516 stop-3   N N N P N N N  N N N N
STP-517 stop-2   A N N P P N N  N N N N
STP-518 stop-0   A A N P P P N  N N N N
STP-519 alarm-1  A N N P N N N  N N N N
STP-520 alarm-2  A A N P P N N  N N A N
STP-521 alarm-3  A A A P P P N  A N A N
STP-522 alarm-4  A A A P P P P  2 2 2 2
STP-523 alarm-7  A A A P P P P  W W W W
STP-524 power-0  E E E P P P N  - - - -
STP-525 power-2  E E E P P N N  - - - -
STP-526 power-1  E E E P P P R  - - - -
STP-526 power-3  E E E P P P P  - - - -
"""
"""N the new one takes over, A the active one goes on and the new one is turned away, P it goes on and the
alarm stays pending,
E turned away with an error, 2 OFF2 at once, W after standstill, R the pattern of RemoveEnableReaction.
alarm-7 is reaction 4 with 16#7, alarm-4 stands for the other values."""
COLUMNS: Final = (
    "stop-3",
    "stop-2",
    "stop-0",
    "alarm-1",
    "alarm-2",
    "alarm-3",
    "alarm-4",
    "power-0",
    "power-1",
    "power-2",
    "power-3",
)


def cell(active: str, new: str) -> tuple[str, str]:
    """Return identifier and letter of a pair; `active` is a row of the matrix, `new` a column."""
    for line in MATRIX.strip().splitlines():
        identifier, row, *letters = line.split()
        if row == active:
            return identifier, letters[COLUMNS.index(new)]
    raise KeyError(active)
