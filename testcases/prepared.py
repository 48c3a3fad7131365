"""`hil` and `pytest` from a process that has imported everything already: most of the time of a short command
is imports.

A server imports and waits. A command (`PreparedCommands.folder` has them) hands over its arguments, folder,
environment and standard streams; the server forks, and the copy runs what the installed command runs. It
is a process of its own in all but its start. Signals do not reach it: what is ended from outside needs
the installed command.
"""

from __future__ import annotations

import array
import json
import os
import socket
import sys
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from pathlib import Path

_HEAD = 4
"""Bytes in front of the request: its length."""


def ask(address: str, program: str, arguments: list[str]) -> int:
    """Have a command run by the server and return its exit code; this is all that a command does."""
    request = json.dumps([program, arguments, os.getcwd(), dict(os.environ)]).encode()  # noqa: PTH109
    with socket.socket(socket.AF_UNIX) as connection:
        connection.connect(address)
        streams = array.array("i", [0, 1, 2])
        connection.sendmsg(
            [len(request).to_bytes(_HEAD, "big")], [(socket.SOL_SOCKET, socket.SCM_RIGHTS, streams)]
        )
        connection.sendall(request)
        answer = connection.recv(1)
    return answer[0] if answer else 255


def serve(address: str) -> None:
    """Import everything, say so with an empty line, and fork for every command, until killed."""
    import pkgutil
    from contextlib import suppress

    import hypothesis  # noqa: F401
    import pytest  # noqa: F401

    import hil._commands
    import hil.testing

    for module in pkgutil.iter_modules(hil._commands.__path__):
        if module.name not in ("cockpit", "ads"):  # what only they need is large
            __import__(f"hil._commands.{module.name}")
    with socket.socket(socket.AF_UNIX) as server:
        server.bind(address)
        server.listen()
        print(flush=True)
        while True:
            connection, _ = server.accept()
            if os.fork() == 0:
                server.close()
                _run(connection)
            connection.close()
            with suppress(ChildProcessError):
                while os.waitpid(-1, os.WNOHANG)[0]:
                    pass


def _run(connection: socket.socket) -> None:
    """Be the command that a client asks for; the process ends here."""
    import atexit
    import threading

    head, ancillary, _, _ = connection.recvmsg(_HEAD, socket.CMSG_SPACE(12))
    streams = array.array("i", ancillary[0][2])
    text = b""
    while len(text) < int.from_bytes(head, "big"):
        text += connection.recv(1 << 20)
    program, arguments, folder, environment = json.loads(text)
    for number, stream in enumerate(streams):
        os.dup2(stream, number)
        os.close(stream)
    os.chdir(folder)
    os.environ.clear()
    os.environ.update(environment)
    sys.argv = [os.path.join(os.path.dirname(sys.executable), program), *arguments]  # noqa: PTH118, PTH120
    sys.path[0] = os.path.dirname(sys.executable)  # noqa: PTH120
    code = 1
    try:
        if program == "pytest":
            import pytest

            code = int(pytest.console_main())
        else:
            from motion_hil import main

            code = main() or 0
    except SystemExit as end:
        code = end.code if isinstance(end.code, int) else int(end.code is not None)
    except BaseException:  # noqa: BLE001 - as the interpreter shows it
        sys.excepthook(*sys.exc_info())
    finally:
        threading._shutdown()
        atexit._run_exitfuncs()
        sys.stdout.flush()
        sys.stderr.flush()
        connection.sendall(bytes([code & 255]))
        os._exit(code)


class PreparedCommands:
    """A server, and a folder with the commands `hil` and `pytest` that ask it; put first in PATH."""

    def __init__(self, folder: Path) -> None:
        import subprocess

        self.folder = folder
        address = str(folder / "socket")
        for program in ("hil", "pytest"):
            path = folder / program
            path.write_text(f'#!/bin/sh\nexec {sys.executable} -I -S {__file__} {address} {program} "$@"\n')
            path.chmod(0o755)
        self._server = subprocess.Popen(
            [sys.executable, "-m", "testcases.prepared", "serve", address],
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
        )
        assert self._server.stdout is not None
        if not self._server.stdout.readline():
            raise RuntimeError(f"it ended with exit code {self._server.wait()}")

    def close(self) -> None:
        """End the server."""
        self._server.terminate()
        self._server.communicate()


if __name__ == "__main__":
    if sys.argv[1] == "serve":
        serve(sys.argv[2])
    else:
        sys.exit(ask(sys.argv[1], sys.argv[2], sys.argv[3:]))
