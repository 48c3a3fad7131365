"""The page of a running campaign (`hil run --watch`), by the rules of the cockpit: token, host, origin."""

from __future__ import annotations

import asyncio
import secrets
import tempfile
import threading
from collections.abc import Awaitable, Callable, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Final

from starlette.applications import Starlette
from starlette.requests import Request
from starlette.responses import HTMLResponse, JSONResponse, PlainTextResponse, Response
from starlette.routing import Mount, Route
from starlette.staticfiles import StaticFiles

from hil.cockpit.page_text import PAGE, page_text
from hil.cockpit.security import Admission, Guard, enter_routes
from hil.cockpit.server import http_server
from reports import HistoryError, render_html
from reports.model import RunResult

if TYPE_CHECKING:
    from socket import socket

    from starlette.types import ASGIApp

    from hil.cockpit.campaign_watch import CampaignWatch

_REPORT_POLICY: Final = (
    "sandbox allow-scripts; default-src 'none'; script-src 'unsafe-inline'; style-src 'unsafe-inline'; "
    "img-src data: blob:; frame-ancestors 'none'"
)
"""A report is one file with its scripts inside. It runs without an origin: it can neither read the page of
the run nor send anything.
"""


class WatchPage:
    """Answers the page of a running campaign.

    Args:
        watch: The campaign.
        admission: Who is let in.

    """

    def __init__(self, watch: CampaignWatch, admission: Admission) -> None:
        self._watch = watch
        self._admission = admission

    def routes(self) -> list[Route]:
        """Return the addresses of its data and actions."""
        watch = self._watch
        return [
            Route("/state", self._for_admitted(self._state)),
            Route("/case/{number:int}", self._for_admitted(self._case)),
            Route("/history", self._for_admitted(self._history)),
            Route("/compare", self._for_admitted(self._compare)),
            *(
                Route(f"/{name}", self._for_admitted(self._action(action)), methods=["POST"])
                for name, action in (("stop", watch.stop), ("resume", watch.resume), ("end", watch.end))
            ),
        ]

    def _for_admitted(
        self, answer: Callable[[Request], Awaitable[Response]]
    ) -> Callable[[Request], Awaitable[Response]]:
        async def checked(request: Request) -> Response:
            if not self._admission.admits(request.headers):
                return PlainTextResponse("the token is missing", status_code=401)
            return await answer(request)

        return checked

    @staticmethod
    def _action(action: Callable[[], None]) -> Callable[[Request], Awaitable[Response]]:
        async def act(_: Request) -> Response:
            action()
            return Response(status_code=204)

        return act

    async def _state(self, request: Request) -> Response:
        since = request.query_params.get("since", "0")
        if not since.isdecimal() or len(since) > 9:
            return PlainTextResponse("since: a whole number of 0 or more is allowed", status_code=400)
        return JSONResponse(self._watch.state(int(since)))

    async def _history(self, _: Request) -> Response:
        return JSONResponse(await asyncio.to_thread(self._watch.earlier_runs))

    async def _compare(self, request: Request) -> Response:
        base, now = (request.query_params.get(name, "")[:40] for name in ("base", "now"))
        try:
            return JSONResponse(await asyncio.to_thread(self._watch.compare, base, now))
        except HistoryError as error:
            return PlainTextResponse(str(error), status_code=404)

    async def _case(self, request: Request) -> Response:
        number: int = request.path_params["number"]
        page = await asyncio.to_thread(self._report, number)
        if page is None:
            return PlainTextResponse("there is no such result", status_code=404)
        return HTMLResponse(page, headers={"content-security-policy": _REPORT_POLICY})

    def _report(self, number: int) -> str | None:
        """Return the report page of one case."""
        case = self._watch.result(number)
        if case is None:
            return None
        run = RunResult(case.title, case.seed, "", "", {}, "", [replace(case, files={})])
        with tempfile.TemporaryDirectory() as folder:
            path = render_html(run, Path(folder, "report.html"))
            return path.read_text(encoding="utf-8")


def watch_application(watch: CampaignWatch, admission: Admission, hosts: Iterable[str]) -> ASGIApp:
    """Return the server of a campaign as an ASGI application.

    Args:
        watch: The campaign.
        admission: Who is let in.
        hosts: Values of `Host` under which it is reached, with the port.

    """
    page = page_text(
        "Campaign",
        styles=("/page/cockpit.css", "/page/operations.css", "/page/watch.css"),
        module="/page/watch.js",
    )
    routes = [
        Route("/", lambda _: HTMLResponse(page)),
        *enter_routes(admission),
        *WatchPage(watch, admission).routes(),
        Mount("/page", StaticFiles(directory=PAGE)),
    ]
    return Guard(Starlette(routes=routes), hosts)


@contextmanager
def served_watch(watch: CampaignWatch, listening: socket) -> Iterator[str]:
    """Serve a campaign in a thread of its own, and give the address with its token.

    Args:
        watch: The campaign.
        listening: A socket that listens on the loopback; it is closed at the end.

    """
    with listening:
        address, port = listening.getsockname()
        token = secrets.token_urlsafe(24)
        hosts = [f"{name}:{port}" for name in (address, "localhost")]
        server = http_server(watch_application(watch, Admission(token, port), hosts))
        thread = threading.Thread(target=lambda: server.run(sockets=[listening]), name="watch", daemon=True)
        thread.start()
        try:
            yield f"http://{address}:{port}/#token={token}"
        finally:
            server.should_exit = True
            thread.join()
