"""Who may talk to the cockpit: hosts, origins, the token, and what a page may load."""

from __future__ import annotations

import asyncio
import hmac
import secrets
from collections.abc import Iterable
from http.cookies import CookieError, SimpleCookie
from typing import TYPE_CHECKING, Final

from starlette.datastructures import Headers, MutableHeaders
from starlette.requests import Request
from starlette.responses import PlainTextResponse, Response
from starlette.routing import Route

if TYPE_CHECKING:
    from starlette.types import ASGIApp, Message, Receive, Scope, Send

POLICY: Final = (
    "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' data: blob:; "
    "connect-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
)
"""Content security policy: nothing from anywhere else, nothing inline."""
_POLICY: Final = "content-security-policy"
_HEADERS: Final = {
    _POLICY: POLICY,
    "x-content-type-options": "nosniff",
    "referrer-policy": "no-referrer",
    "cross-origin-opener-policy": "same-origin",
    "cross-origin-resource-policy": "same-origin",
    "permissions-policy": "camera=(), geolocation=(), microphone=()",
    "cache-control": "no-store",
}
_LONGEST_TOKEN: Final = 1024
_WRONG_TOKEN_S: Final = 0.5
"""Time that the answer to a wrong token takes, s."""
_REFUSED: Final = 4403
"""Code with which a WebSocket is closed that may not be opened."""


class Admission:
    """The token that opens the cockpit, and the cookie that a page has afterwards.

    Args:
        token: The token.
        port: Port of the server; cookies do not tell ports apart, so that it is in the name.

    """

    def __init__(self, token: str, port: int) -> None:
        self._token = token.encode()
        self._session = secrets.token_urlsafe(32)
        self.cookie_name = f"hil_cockpit_{port}"

    def cookie(self, token: str) -> str | None:
        """Return the `Set-Cookie` for the right token; None: it is wrong."""
        if not hmac.compare_digest(token.encode("utf-8", "replace"), self._token):
            return None
        return f"{self.cookie_name}={self._session}; HttpOnly; SameSite=Strict; Path=/"

    def admits(self, headers: Headers) -> bool:
        """Return whether a request carries the cookie."""
        cookies: SimpleCookie = SimpleCookie()
        try:
            cookies.load(headers.get("cookie", ""))
        except CookieError:
            return False
        found = cookies.get(self.cookie_name)
        return found is not None and hmac.compare_digest(
            found.value.encode("utf-8", "replace"), self._session.encode()
        )


def enter_routes(admission: Admission) -> list[Route]:
    """Return the way in: `POST` gives the cookie for the token, `GET` says whether it is there."""

    async def enter(request: Request) -> Response:
        body = b""
        async for part in request.stream():
            body += part
            if len(body) > _LONGEST_TOKEN:
                return PlainTextResponse("too long", status_code=413)
        cookie = admission.cookie(body.decode("utf-8", "replace").strip())
        if cookie is None:
            await asyncio.sleep(_WRONG_TOKEN_S)
            return PlainTextResponse("wrong token", status_code=403)
        return Response(status_code=204, headers={"set-cookie": cookie})

    async def entered(request: Request) -> Response:
        return Response(status_code=204 if admission.admits(request.headers) else 401)

    return [Route("/enter", enter, methods=["POST"]), Route("/enter", entered, methods=["GET"])]


class Guard:
    """Refuses requests for another host or from a page of another origin, and gives every answer its headers.

    An answer with a content security policy of its own keeps it.

    Args:
        app: What is guarded.
        hosts: Values of `Host` under which the server is reached, with the port.

    """

    def __init__(self, app: ASGIApp, hosts: Iterable[str]) -> None:
        self._app = app
        self._hosts = frozenset(hosts)
        self._origins = frozenset(f"http://{host}" for host in self._hosts)

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Serve a request."""
        if scope["type"] not in {"http", "websocket"}:
            await self._app(scope, receive, send)
            return
        refusal = self._refusal(Headers(scope=scope), socket=scope["type"] == "websocket")
        if scope["type"] == "websocket":
            if refusal:
                await receive()
                await send({"type": "websocket.close", "code": _REFUSED, "reason": refusal})
            else:
                await self._app(scope, receive, send)
            return

        async def send_with_headers(message: Message) -> None:
            if message["type"] == "http.response.start":
                headers = MutableHeaders(scope=message)
                own = headers.get(_POLICY)
                headers.update(_HEADERS)
                if own is not None:
                    headers[_POLICY] = own
            await send(message)

        if refusal:
            await PlainTextResponse(refusal, status_code=403)(scope, receive, send_with_headers)
        else:
            await self._app(scope, receive, send_with_headers)

    def _refusal(self, headers: Headers, *, socket: bool) -> str:
        if headers.get("host", "") not in self._hosts:
            return "this host is not served here"
        origin = headers.get("origin")
        if origin is None:
            return "a WebSocket without an origin is refused" if socket else ""
        return "" if origin in self._origins else "pages of another origin are refused"
