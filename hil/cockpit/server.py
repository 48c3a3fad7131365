"""The server: the page, the way in, and one WebSocket for each page."""

from __future__ import annotations

import asyncio
import re
import time
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
from importlib.resources import files
from importlib.util import find_spec
from itertools import count
from pathlib import Path
from typing import TYPE_CHECKING, Final

import uvicorn
from starlette.applications import Starlette
from starlette.responses import FileResponse, HTMLResponse
from starlette.routing import Mount, Route, WebSocketRoute
from starlette.staticfiles import StaticFiles
from starlette.websockets import WebSocket, WebSocketDisconnect, WebSocketState

from hil.cockpit.client import Client
from hil.cockpit.messages import (
    BURST,
    LARGEST_BYTES,
    RATE_PER_S,
    Message,
    MessageError,
    MessageReader,
    RateLimit,
)
from hil.cockpit.page_text import PAGE, page_text
from hil.cockpit.security import Admission, Guard, enter_routes

if TYPE_CHECKING:
    from collections.abc import Iterable

    from starlette.types import ASGIApp

    from hil.cockpit.machine import Machine

HOMING_STYLE: Final = Path(str(files("reports.html"))) / "templates" / "homing.css"
"""The style of homing pictures is that of the reports."""
_LIFE: Final = re.compile(r'\{"kind":"life"(?:,"at":(\d{1,15}))?\}')
"""Sign of life of an operator, with the time of the newest state that the page shows, ms; it does not wait
for the thread of the bench.
"""
_MOST_PAGES: Final = 16
_NOT_ADMITTED: Final = 4401
_TOO_MANY: Final = 4408
_TOO_FAST: Final = 4429
_TOO_SLOW: Final = 4413
_NO_TEXT: Final = 4400


def _library() -> Path:
    """Return the folder of uPlot, without an import of its package, which would load IPython."""
    package = find_spec("uplot")
    assert package is not None  # a dependency
    assert package.submodule_search_locations is not None
    return Path(package.submodule_search_locations[0], "static")


class Pages:
    """The connected pages.

    Args:
        machine: What their messages are for.
        admission: Who is let in.
        rate: Makes the count of the messages of one page.

    """

    def __init__(self, machine: Machine, admission: Admission, rate: Callable[[], RateLimit]) -> None:
        self._machine = machine
        self._admission = admission
        self._rate = rate
        self._reader = MessageReader(machine.kinds)
        self._numbers = count(1)
        self._open = 0

    async def serve(self, socket: WebSocket) -> None:
        """Serve a page until it goes."""
        if not self._admission.admits(socket.headers):
            await self._refuse(
                socket, _NOT_ADMITTED, "the token is missing: open the address that was printed"
            )
            return
        if self._open >= _MOST_PAGES:
            await self._refuse(socket, _TOO_MANY, f"{_MOST_PAGES} pages are open already")
            return
        await socket.accept()
        client = Client(next(self._numbers), asyncio.get_running_loop())
        self._open += 1
        self._machine.welcome(client)
        sending = asyncio.create_task(self._send(socket, client))
        try:
            code, reason = await self._receive(socket, client)
            if socket.application_state is WebSocketState.CONNECTED:
                await socket.close(code, reason)
        except (WebSocketDisconnect, RuntimeError):
            pass  # it has gone
        finally:
            client.closed = True
            self._open -= 1
            self._machine.farewell(client)
            sending.cancel()

    @staticmethod
    async def _refuse(socket: WebSocket, code: int, reason: str) -> None:
        """Close a connection so that the page learns why: before it is accepted, it would not."""
        await socket.accept()
        await socket.close(code, reason)

    async def _receive(self, socket: WebSocket, client: Client) -> tuple[int, str]:
        rate = self._rate()
        while True:
            event = await socket.receive()
            if event["type"] == "websocket.disconnect":
                raise WebSocketDisconnect(event.get("code", 1000))
            if not rate.allows(time.monotonic()):
                return _TOO_FAST, "too many messages"
            text = event.get("text")
            if text is None:
                return _NO_TEXT, "messages are text"
            if life := _LIFE.fullmatch(text):
                client.alive(None if life[1] is None else int(life[1]) / 1000.0)
                continue
            try:
                message: Message = self._reader.read(text)
            except MessageError as error:
                client.send({"kind": "reply", "id": _number_of(text), "ok": False, "error": str(error)})
                continue
            self._machine.post(message, client)

    @staticmethod
    async def _send(socket: WebSocket, client: Client) -> None:
        try:
            while (content := await client.next()) is not None:
                if isinstance(content, bytes):
                    await socket.send_bytes(content)
                else:
                    await socket.send_text(content)
                client.sent()
            await socket.close(_TOO_SLOW, "the page reads too slowly")
        except (WebSocketDisconnect, RuntimeError, OSError):
            client.closed = True


def _number_of(text: str) -> int:
    """Return the number of a request that cannot be used otherwise; 0: it has none."""
    import json

    try:
        found = json.loads(text)
    except (ValueError, RecursionError):
        return 0
    number = found.get("id", 0) if isinstance(found, dict) else 0
    return number if type(number) is int and 0 <= number < 2**53 else 0


def application(
    machine: Machine,
    admission: Admission,
    hosts: Iterable[str],
    *,
    rate: Callable[[], RateLimit] = lambda: RateLimit(RATE_PER_S, BURST),
) -> ASGIApp:
    """Return the server as an ASGI application; it starts the machine, and stops it at its end.

    Args:
        machine: The bench.
        admission: Who is let in.
        hosts: Values of `Host` under which it is reached, with the port.
        rate: Makes the count of the messages of one page.

    """
    pages = Pages(machine, admission, rate)

    page = page_text(
        "Cockpit",
        styles=("/uplot.css", "/homing.css", "/page/cockpit.css", "/page/operations.css"),
        scripts=("/uplot.js",),
        module="/page/app.js",
    )

    @asynccontextmanager
    async def lifespan(_: Starlette) -> AsyncIterator[None]:
        machine.start()
        try:
            yield
        finally:
            await asyncio.to_thread(machine.stop)

    library = _library()
    routes = [
        Route("/", lambda _: HTMLResponse(page)),
        *enter_routes(admission),
        WebSocketRoute("/socket", pages.serve),
        Route("/uplot.js", lambda _: FileResponse(library / "uPlot.iife.js", media_type="text/javascript")),
        Route("/uplot.css", lambda _: FileResponse(library / "uPlot.min.css", media_type="text/css")),
        Route("/homing.css", lambda _: FileResponse(HOMING_STYLE, media_type="text/css")),
        Mount("/page", StaticFiles(directory=PAGE)),
    ]
    return Guard(Starlette(routes=routes, lifespan=lifespan), hosts)


def http_server(app: ASGIApp) -> uvicorn.Server:
    """Return the server of an application, with the bounds of a WebSocket; `run(sockets=[...])` serves."""
    return uvicorn.Server(
        uvicorn.Config(
            app,
            log_level="warning",
            ws="websockets-sansio",
            ws_max_size=LARGEST_BYTES,
            ws_ping_interval=5.0,
            ws_ping_timeout=20.0,  # a slow connection answers late; an operator gives signs of life
            timeout_graceful_shutdown=2,
            server_header=False,
        )
    )
