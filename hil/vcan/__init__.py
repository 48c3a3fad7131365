"""Run any command where a SocketCAN interface exists, on this machine or, without rights, in user-mode Linux.

Needs nothing but the standard library, so that `./run` can ask before anything is installed.
"""

from __future__ import annotations

from hil.vcan._host import HostInterfaces
from hil.vcan._names import interface_names, variables
from hil.vcan._run import EXIT_CRASHED, EXIT_TIMEOUT, EXIT_UNAVAILABLE, Request, run
from hil.vcan._tools import UnavailableError

__all__ = [
    "EXIT_CRASHED",
    "EXIT_TIMEOUT",
    "EXIT_UNAVAILABLE",
    "HostInterfaces",
    "Request",
    "UnavailableError",
    "interface_names",
    "run",
    "variables",
]
