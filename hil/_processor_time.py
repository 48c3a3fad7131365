"""Processor time of processes, with what they have started."""

from __future__ import annotations

import os
import time
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from typing import Final

_PROCESSES: Final = Path("/proc")
_USER, _CHILDREN_SYSTEM = 11, 14
"""Places in `/proc/PID/stat` behind the name: user, system, and both of children that it has waited for
(proc_pid_stat(5)).
"""


def own_processor_time_s() -> float:
    """Return the processor time of this process and of the children that it has waited for, s."""
    times = os.times()
    return time.process_time() + times.children_user + times.children_system


def processor_time_s(pid: int) -> float | None:
    """Return the processor time of a process and of all that it has started, s.

    Returns:
        None: the process has ended, or the system does not tell, as outside of Linux.

    """
    try:
        ticks = _own_ticks(pid)
    except OSError:
        return None
    for one in _descendants(pid):
        with suppress(OSError):  # it has just ended
            ticks += _own_ticks(one)
    return ticks / os.sysconf("SC_CLK_TCK")


def _own_ticks(pid: int) -> int:
    text = (_PROCESSES / str(pid) / "stat").read_text(encoding="utf-8", errors="replace")
    fields = text.rpartition(")")[2].split()  # the name before it may have spaces and parentheses
    return sum(map(int, fields[_USER : _CHILDREN_SYSTEM + 1]))


def _descendants(pid: int) -> Iterator[int]:
    for file in (_PROCESSES / str(pid) / "task").glob("*/children"):
        children = ""
        with suppress(OSError):
            children = file.read_text(encoding="ascii")
        for child in map(int, children.split()):
            yield child
            yield from _descendants(child)
