"""Interfaces of this machine: those that are there, and those that `ip link` can create."""

from __future__ import annotations

import os
import socket
import subprocess
from collections.abc import Sequence
from pathlib import Path
from types import TracebackType
from typing import Final, Self

from hil.vcan._tools import UnavailableError, tool

_ARPHRD_CAN: Final = 280
_IFF_UP: Final = 1

_NO_MODULE: Final = "the kernel has no module vcan (Ubuntu: linux-modules-extra-$(uname -r) may have it)"
_ADVICE: Final = {
    "not supported": _NO_MODULE,
    "unknown device type": _NO_MODULE,
    "not permitted": "that needs root or, in a container, the capability NET_ADMIN",
    "password is required": "sudo wants a password, and is never asked for one here",
}
"""What `ip` or `sudo` says (a part of it, in small letters), and what it means."""


class HostInterfaces:
    """Interfaces on this machine, as a context manager; those that had to be created are removed at its end.

    Args:
        names: Of the interfaces.

    """

    def __init__(self, names: Sequence[str]) -> None:
        self._names = names
        self.created: list[str] = []

    def __enter__(self) -> Self:
        """Provide all of them.

        Raises:
            UnavailableError: One does not exist and cannot be created.

        """
        try:
            for name in self._names:
                self._open(name)
        except BaseException:
            self._remove()
            raise
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._remove()

    def _open(self, name: str) -> None:
        system = Path("/sys/class/net") / name
        if system.exists():
            if int((system / "type").read_text()) != _ARPHRD_CAN:
                raise UnavailableError(f"{name} is there, but is not a CAN interface")
            if not int((system / "flags").read_text(), 0) & _IFF_UP:
                _as_root("ip", "link", "set", name, "up")
        else:
            _as_root("ip", "link", "add", "dev", name, "type", "vcan")
            self.created.append(name)
            _as_root("ip", "link", "set", name, "up")
        _check_socket(name)

    def _remove(self) -> None:
        for name in self.created:
            subprocess.run(_with_rights("ip", "link", "del", name), check=False, capture_output=True)
        self.created.clear()


def _with_rights(*command: str) -> list[str]:
    """Return `command` so that it runs with root's rights, without ever asking for a password."""
    path = tool(command[0])
    if path is None:
        raise UnavailableError(f"the program {command[0]} is not installed (Debian and Ubuntu: iproute2)")
    if os.geteuid() == 0:
        return [path, *command[1:]]
    sudo = tool("sudo")
    if sudo is None:
        raise UnavailableError(f"`{' '.join(command)}` needs root, and sudo is not installed")
    return [sudo, "-n", path, *command[1:]]


def _as_root(*command: str) -> None:
    done = subprocess.run(
        _with_rights(*command),
        check=False,
        capture_output=True,
        text=True,
        stdin=subprocess.DEVNULL,
        env={**os.environ, "LC_ALL": "C"},
    )
    if done.returncode:
        said = (done.stderr or done.stdout).strip().splitlines() or [f"exit code {done.returncode}"]
        reason = said[0].removeprefix("Error: ").removesuffix(".")
        advice = next((text for part, text in _ADVICE.items() if part in done.stderr.lower()), "")
        raise UnavailableError(f"`{' '.join(command)}`: {reason}{advice and f'; {advice}'}")


def _check_socket(name: str) -> None:
    """Open a raw CAN socket: the proof that programs can use the interface."""
    try:
        with socket.socket(socket.AF_CAN, socket.SOCK_RAW, socket.CAN_RAW) as probe:
            probe.bind((name,))
    except OSError as error:
        raise UnavailableError(f"a CAN socket on {name}: {error.strerror or error}") from error
