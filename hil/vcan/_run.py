"""One command with its interfaces: the first way that is open."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Final, Literal

from hil.vcan._host import HostInterfaces
from hil.vcan._names import variables
from hil.vcan._tools import UnavailableError, kill_group, search_path, tool
from hil.vcan._uml import BootError, CommandTimeoutError, run_in_uml

EXIT_TIMEOUT: Final = 124
EXIT_UNAVAILABLE: Final = 69
EXIT_CRASHED: Final = 70
_CANNOT_EXECUTE, _NOT_FOUND = 126, 127
_GRACE_S: Final = 5.0
"""How long a command may take to end after Ctrl-C or SIGTERM, and after its time is up."""


@dataclass(frozen=True)
class Request:
    """A command and the interfaces that it wants.

    Args:
        command: Program and arguments.
        names: Of the interfaces.
        where: `host`: only on this machine; `uml`: only in user-mode Linux; `auto`: the first that is open.
        timeout_s: Longest time of the command, s; 0: no limit.
        memory_mib: Memory of user-mode Linux, MiB.

    """

    command: Sequence[str]
    names: Sequence[str]
    where: Literal["auto", "host", "uml"] = "auto"
    timeout_s: float = 0.0
    memory_mib: int = 1024


def run(request: Request, tell: Callable[[str], object]) -> int:
    """Run the command and return its exit code, or one of the `EXIT_` codes.

    Args:
        request: What to run, and where.
        tell: Takes lines for the user.

    """
    program = request.command[0]
    if tool(program) is None:
        tell(f"{program}: {'not executable' if Path(program).exists() else 'no such command'}")
        return _CANNOT_EXECUTE if Path(program).exists() else _NOT_FOUND
    environment = {**os.environ, **variables(request.names, dict(os.environ)), "PATH": search_path()}
    listed = " and ".join([", ".join(request.names[:-1]), request.names[-1]][len(request.names) == 1 :])
    reasons: list[str] = []
    try:
        if request.where in {"auto", "host"}:
            try:
                with HostInterfaces(request.names):
                    tell(f"{listed} on this machine")
                    return _run_here(request, environment)
            except UnavailableError as error:
                reasons.append(f"on this machine: {error}")
        if request.where in {"auto", "uml"}:
            try:
                tell(f"{listed} in user-mode Linux")
                return run_in_uml(
                    request.command,
                    request.names,
                    environment,
                    timeout_s=request.timeout_s,
                    memory_mib=request.memory_mib,
                )
            except UnavailableError as error:
                reasons.append(f"in user-mode Linux: {error}")
    except CommandTimeoutError:
        tell(f"the command took longer than {request.timeout_s:g} s")
        return EXIT_TIMEOUT
    except BootError as error:
        tell(str(error))
        return EXIT_CRASHED
    except BrokenPipeError:  # nobody reads the output any more
        return 128 + signal.SIGPIPE
    tell("\n  ".join([f"no SocketCAN interface {listed} to be had", *reasons]))
    return EXIT_UNAVAILABLE


def _run_here(request: Request, environment: dict[str, str]) -> int:
    """Run the command on this machine, with our own input and output.

    At a terminal it stays in the foreground and gets Ctrl-C itself. Elsewhere it gets a session of its own,
    and what it leaves behind ends with it.
    """
    terminal = sys.stdin is not None and sys.stdin.isatty()
    process = subprocess.Popen(request.command, env=environment, start_new_session=not terminal)
    before = signal.signal(signal.SIGINT, signal.SIG_IGN) if terminal else None
    try:
        code = process.wait(request.timeout_s or None)
    except subprocess.TimeoutExpired as error:
        _end(process, signal.SIGTERM)
        raise CommandTimeoutError from error
    except KeyboardInterrupt:
        _end(process, signal.SIGTERM if terminal else signal.SIGINT)
        raise
    finally:
        if before is not None:
            signal.signal(signal.SIGINT, before)
        if terminal:
            process.kill()
            process.wait()
        else:
            kill_group(process)
    return code if code >= 0 else 128 - code


def _end(process: subprocess.Popen[bytes], number: signal.Signals) -> None:
    """Let the command end in order."""
    process.send_signal(number)
    with suppress(subprocess.TimeoutExpired):
        process.wait(_GRACE_S)
