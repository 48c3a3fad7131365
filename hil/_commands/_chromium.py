"""Chromium without a window, driven by its own protocol: to measure pages."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final
from urllib.request import urlopen

from hil.errors import CannotRunError

if TYPE_CHECKING:
    from websockets.sync.client import ClientConnection

_PROGRAMS: Final = ("chromium", "chromium-browser", "google-chrome")
_FLAGS: Final = (
    "--headless=new",
    "--disable-gpu",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
    "--hide-scrollbars",
    "--window-size=1440,1000",
    "--remote-debugging-port=0",
)
_PATIENCE_S: Final = 60.0


def find_chromium() -> str | None:
    """Return the program, or None where there is none."""
    return next((path for name in _PROGRAMS if (path := shutil.which(name))), None)


class ChromiumPage:
    """A page in Chromium.

    Args:
        socket: Connection to the page.

    """

    def __init__(self, socket: ClientConnection) -> None:
        self._socket = socket
        self._number = 0

    def command(self, method: str, **parameters: object) -> dict[str, Any]:
        """Carry out a command of the protocol, and return its result.

        Raises:
            CannotRunError: Chromium refuses it, or does not answer.

        """
        self._number += 1
        self._socket.send(json.dumps({"id": self._number, "method": method, "params": parameters}))
        while True:
            try:
                answer = json.loads(self._socket.recv(timeout=_PATIENCE_S))
            except TimeoutError:
                raise CannotRunError(f"Chromium does not answer to {method}") from None
            if answer.get("id") != self._number:
                continue  # an event
            if "error" in answer:
                raise CannotRunError(f"Chromium, {method}: {answer['error'].get('message')}")
            result: dict[str, Any] = answer["result"]
            return result

    def js(self, expression: str) -> Any:
        """Return the value of an expression in the page.

        Raises:
            CannotRunError: It fails.

        """
        found = self.command("Runtime.evaluate", expression=expression, awaitPromise=True, returnByValue=True)
        if "exceptionDetails" in found:
            raise CannotRunError(f"the page: {found['exceptionDetails'].get('text')} in {expression[:80]}")
        return found["result"].get("value")

    def until(self, expression: str, what: str) -> None:
        """Wait until an expression is true.

        Raises:
            CannotRunError: It does not get true.

        """
        end_s = time.monotonic() + _PATIENCE_S
        while not self.js(f"Boolean({expression})"):
            if time.monotonic() > end_s:
                raise CannotRunError(f"the page: {what} does not come")
            time.sleep(0.05)

    def open(self, address: str, *, before: str = "") -> None:
        """Load an address; a script runs before those of the page."""
        self.command("Page.enable")
        if before:
            self.command("Page.addScriptToEvaluateOnNewDocument", source=before)
        self.command("Page.navigate", url=address)

    def mouse(self, kind: str, x: float, y: float) -> None:
        """Let the left button act at a place: `mousePressed`, `mouseReleased`."""
        self.command("Input.dispatchMouseEvent", type=kind, x=x, y=y, button="left", clickCount=1)


@contextmanager
def chromium(program: str) -> Iterator[ChromiumPage]:
    """Start Chromium with a profile of its own, and give its page.

    Raises:
        CannotRunError: It does not start.

    """
    from websockets.sync.client import connect

    # The sandbox does not work for root.
    flags = [*_FLAGS, *(["--no-sandbox"] if os.geteuid() == 0 else [])]
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as profile:
        process = subprocess.Popen(  # noqa: S603 - a program that was looked for by its name
            [program, *flags, f"--user-data-dir={profile}", "about:blank"],
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        )
        try:
            with connect(_address(process, Path(profile)), max_size=None, compression=None) as socket:
                page = ChromiumPage(socket)
                yield page
                with suppress(CannotRunError):
                    page.command("Browser.close")
        finally:
            process.terminate()
            with suppress(subprocess.TimeoutExpired):
                process.wait(10.0)
            process.kill()


def _address(process: subprocess.Popen[bytes], profile: Path) -> str:
    """Return the address of the page, when Chromium is up."""
    file, end_s = profile / "DevToolsActivePort", time.monotonic() + _PATIENCE_S
    while True:
        lines = file.read_text(encoding="ascii").split() if file.exists() else []
        if lines:
            with urlopen(f"http://127.0.0.1:{int(lines[0])}/json/list") as answer:
                pages = [one for one in json.load(answer) if one["type"] == "page"]
            if pages:
                return str(pages[0]["webSocketDebuggerUrl"])
        if process.poll() is not None or time.monotonic() > end_s:
            raise CannotRunError("Chromium does not start")
        time.sleep(0.05)
