"""Other processes in tests: `hil`, programs of can-utils, and reading what they say."""

from __future__ import annotations

import os
import re
import shutil
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

import pytest

PATIENCE_S = 60.0
"""How long to wait for something that must come; it decides nothing but how long a failure takes."""


def program(name: str) -> str:
    """Return the path of a program of can-utils, or fail."""
    path = shutil.which(name)
    if path is None:
        pytest.fail(f"{name} is missing (Debian package can-utils)")
    return path


def hil_command() -> list[str]:
    """Return the installed command `hil`, or the module where it is not installed next to this Python."""
    installed = Path(sys.executable).with_name("hil")
    return [str(installed)] if installed.exists() else [sys.executable, "-m", "hil.cli"]


_HEARING = "import os, signal, sys; signal.signal(signal.SIGINT, signal.SIG_DFL); os.execvp(sys.argv[1], sys.argv[1:])"  # noqa: E501


def _hearing_ctrl_c(command: list[str]) -> list[str]:
    """Return a command that hears Ctrl-C, which a shell lets what it starts in the background ignore, for
    good.
    """
    if signal.getsignal(signal.SIGINT) is not signal.SIG_IGN:
        return command
    return [sys.executable, "-c", _HEARING, *command]


class Reader:
    """A process whose lines are read as they come, so that it never waits for us."""

    def __init__(self, command: list[str], *, stream: str, cwd: Path | None = None) -> None:
        pipes = {"stdout": subprocess.DEVNULL, "stderr": subprocess.STDOUT, stream: subprocess.PIPE}
        self.process = subprocess.Popen(
            _hearing_ctrl_c(command),
            stdin=subprocess.DEVNULL,
            text=True,
            bufsize=1,
            cwd=cwd,
            # as a terminal does it: a process group of its own, which Ctrl-C goes to
            process_group=0,
            env={**os.environ, "PYTHONPATH": os.pathsep.join(path for path in sys.path if path)},
            **pipes,
        )
        self.lines: list[str] = []
        self._thread = threading.Thread(target=self._read, daemon=True)
        self._thread.start()

    def _read(self) -> None:
        for line in self.process.stdout or self.process.stderr:
            self.lines.append(line.rstrip("\n"))

    def wait_for(self, pattern: str, *, since: int = 0) -> re.Match[str]:
        """Return the first match in the lines from number `since` on, waiting for it."""
        end = time.monotonic() + PATIENCE_S
        looked_at = since
        while True:
            # The end of the process is asked for before the lines, so that its last line is not missed.
            ended = self.process.poll() is not None
            while looked_at < len(self.lines):
                found = re.search(pattern, self.lines[looked_at])
                if found:
                    return found
                looked_at += 1
            if ended:
                self._thread.join(PATIENCE_S)
                if looked_at == len(self.lines):
                    break
            elif time.monotonic() > end:
                break
            else:
                time.sleep(0.01)
        shown = "\n".join(self.lines[-40:])
        pytest.fail(f"no line matches {pattern!r} (exit code {self.process.poll()}):\n{shown}")

    def end(self, number: int) -> int:
        """Send a signal and return the exit code."""
        self.process.send_signal(number)
        try:
            return self.process.wait(PATIENCE_S)
        finally:
            self.kill()

    def join(self) -> None:
        """Wait until everything that the process has said is read."""
        self._thread.join(PATIENCE_S)

    def kill(self) -> None:
        self.process.kill()
        self.process.wait()
        self._thread.join(PATIENCE_S)
