"""What both ways to an interface need: programs of the system, and the word that a way is closed."""

from __future__ import annotations

import contextlib
import os
import shutil
import signal
import subprocess


class UnavailableError(Exception):
    """This way to an interface is closed; the message says why and what would open it."""


def search_path() -> str:
    """Return where programs are looked for; an ordinary user's PATH lacks the sbin directories."""
    return f"{os.environ.get('PATH', '')}:/usr/local/sbin:/usr/sbin:/sbin:/usr/bin:/bin"


def tool(name: str) -> str | None:
    """Return the path of a program."""
    return shutil.which(name, path=search_path())


def kill_group(process: subprocess.Popen[bytes]) -> None:
    """End a process with everything that it started in its group."""
    with contextlib.suppress(ProcessLookupError):
        os.killpg(process.pid, signal.SIGKILL)
    process.wait()
