"""Names of the interfaces, and the environment variables in which a command finds them."""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import Final

from fieldbus.errors import ConfigurationError

LONGEST: Final = 15
"""Characters that the kernel takes in the name of an interface."""
MOST: Final = 16
_NAME: Final = re.compile(r"[A-Za-z0-9_.-]{1,15}")


def interface_names(given: Sequence[str], count: int = 0) -> list[str]:
    """Return the names of all interfaces.

    Args:
        given: Names that are given; none: vcan0.
        count: How many interfaces there are; those without a name are numbered on from the last one
            (vcan0, vcan1, ...). 0: as many as are given.

    Raises:
        ConfigurationError: The kernel takes no such name, a name is there twice, or the count does not fit.

    """
    names = list(given) or ["vcan0"]
    for name in names:
        if not _NAME.fullmatch(name) or name in {".", ".."}:
            raise ConfigurationError("--interface", name, f"1 to {LONGEST} letters, digits, _ . -")
        if names.count(name) > 1:
            raise ConfigurationError("--interface", name, "each name once")
    if count and not len(names) <= count <= MOST:
        raise ConfigurationError("--count", count, f"{len(names)} (names that are given) to {MOST}")
    while len(names) < count:
        names.append(_next(names[-1], names))
    return names


def _next(name: str, taken: Sequence[str]) -> str:
    stem = name.rstrip("0123456789")
    number = int(name[len(stem) :] or 0)
    while True:
        number += 1
        found = f"{stem[: LONGEST - len(str(number))]}{number}"
        if found not in taken:
            return found


def variables(names: Sequence[str], environment: dict[str, str]) -> dict[str, str]:
    """Return the environment variables that tell a command its interfaces.

    HIL_VCAN is the first one, HIL_VCAN_2 the second, and so on. CAN_INTERFACE and CAN_CHANNEL give it to
    programs of python-can that name no bus, unless the user has set one of the two.

    Args:
        names: Of the interfaces.
        environment: Of the user.

    """
    found = {"HIL_VCAN": names[0]} | {
        f"HIL_VCAN_{number}": name for number, name in enumerate(names[1:], start=2)
    }
    if not {"CAN_INTERFACE", "CAN_CHANNEL"} & environment.keys():
        found |= {"CAN_INTERFACE": "socketcan", "CAN_CHANNEL": names[0]}
    return found
