"""`hil vcan`: run a command of any project where a SocketCAN interface exists."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from typing import Literal, cast

from fieldbus.errors import ConfigurationError
from hil.vcan import Request, interface_names, run


def run_with_interfaces(
    command: Sequence[str], *, names: Sequence[str], count: int, where: str, timeout_s: float, memory_mib: int
) -> int:
    """Run the command; returns its exit code, or one of those of `hil.vcan`.

    Args:
        command: Program and arguments.
        names: Of the interfaces; none: vcan0.
        count: How many interfaces; 0: as many as are named.
        where: auto, host or uml.
        timeout_s: Longest time of the command, s; 0: no limit.
        memory_mib: Memory of user-mode Linux, MiB.

    Raises:
        ConfigurationError: A name, the count or the place is not possible.

    """
    if where not in {"auto", "host", "uml"}:
        raise ConfigurationError("--where", where, "auto, host or uml")
    place = cast("Literal['auto', 'host', 'uml']", where)
    return run(Request(command, interface_names(names, count), place, timeout_s, memory_mib), _tell)


def _tell(text: str) -> None:
    print(f"hil vcan: {text}", file=sys.stderr, flush=True)  # noqa: T201 - standard output is the command's
