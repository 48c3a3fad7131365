"""A cockpit for tests: the server in this process, and pages that speak to it as a browser does."""

from __future__ import annotations

import json
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from http.client import HTTPConnection
from pathlib import Path
from queue import Empty, Queue
from socket import create_connection
from tempfile import TemporaryDirectory
from threading import Event, Thread
from typing import Any

from websockets.exceptions import ConnectionClosed
from websockets.sync.client import ClientConnection, connect

from hil._commands.cockpit import listen
from hil.bench import load_bench
from hil.cockpit.assembly import cockpit
from hil.cockpit.server import http_server

TOKEN = "a-token-of-the-tests"
PATIENCE_S = 30.0


class Page:
    """A page of the cockpit: requests, the newest state, what came otherwise."""

    def __init__(self, socket: Any) -> None:
        self.socket = socket
        self.description: dict[str, Any] = {}
        self.state: dict[str, Any] = {}
        self.events: list[list[Any]] = []
        self.samples: list[bytes] = []
        self.documents: list[dict[str, Any]] = []
        """What came of other kinds."""
        self.code: int | None = None
        self._replies: Queue[dict[str, Any]] = Queue()
        self._number = 0
        self._living = Event()
        self._reader = Thread(target=self._read, daemon=True)
        self._reader.start()
        self._life = Thread(target=self._live, daemon=True)

    def _read(self) -> None:
        while True:
            try:
                message = self.socket.recv()
            except ConnectionClosed as end:
                self.code = 1006 if end.rcvd is None else end.rcvd.code
                return
            if isinstance(message, bytes):
                self.samples.append(message)
                continue
            document = json.loads(message)
            kind = document["kind"]
            if kind == "reply":
                self._replies.put(document)
            elif kind == "bench":
                self.description = document
            elif kind == "state":
                self.state = document
            elif kind == "events":
                self.events += document["events"]
            else:
                self.documents.append(document)

    def ask(self, kind: str, **fields: Any) -> dict[str, Any]:
        """Send a message and return its reply."""
        self._number += 1
        self.send(json.dumps({"kind": kind, "id": self._number, **fields}))
        return self.reply()

    def send(self, text: str) -> None:
        self.socket.send(text)

    def reply(self) -> dict[str, Any]:
        try:
            return self._replies.get(timeout=PATIENCE_S)
        except Empty:
            raise AssertionError("no reply came") from None

    def do(self, kind: str, **fields: Any) -> Any:
        """Send a message that has to be carried out; returns the value of the reply."""
        reply = self.ask(kind, **fields)
        assert reply["ok"], reply
        return reply["value"]

    def refused(self, kind: str, **fields: Any) -> str:
        """Send a message that has to be refused; returns the sentence."""
        reply = self.ask(kind, **fields)
        assert not reply["ok"], reply
        return reply["error"]

    def command(self, axis: str, command: str, *values: float) -> Any:
        return self.do("axis.command", axis=axis, command=command, values=list(values))

    def until(self, condition: Callable[[], object], what: str) -> None:
        end = time.monotonic() + PATIENCE_S
        while not _true(condition):
            assert time.monotonic() < end, f"{what}: {json.dumps(self.state)[:600]}"
            time.sleep(0.01)

    def live(self) -> None:
        """Give signs of life from now on."""
        self._life.start()

    def hush(self) -> None:
        """Give no more signs of life."""
        self._living.set()
        self._life.join()

    def _live(self) -> None:
        while not self._living.wait(0.1):
            with suppress(ConnectionClosed):
                at = self.state.get("at")
                self.send('{"kind":"life"}' if at is None else f'{{"kind":"life","at":{at}}}')


def _true(condition: Callable[[], object]) -> bool:
    try:
        return bool(condition())
    except (KeyError, TypeError):
        return False


class Served:
    """A cockpit that is served on the loopback, and the cookie of a page that came in with the token."""

    def __init__(self, port: int, token: str = TOKEN) -> None:
        self.port = port
        self.host = f"127.0.0.1:{port}"
        self.origin = f"http://{self.host}"
        status, headers, _ = self.http("POST", "/enter", body=token)
        assert status == 204
        self.cookie = headers["set-cookie"].partition(";")[0]

    def http(
        self, method: str, path: str, body: str = "", **headers: str
    ) -> tuple[int, dict[str, str], bytes]:
        """Make a request; returns status, headers and content."""
        connection = HTTPConnection("127.0.0.1", self.port, timeout=PATIENCE_S)
        try:
            connection.request(method, path, body, {"host": self.host, **headers})
            answer = connection.getresponse()
            found = {name.lower(): value for name, value in answer.getheaders()}
            return answer.status, found, answer.read()
        finally:
            connection.close()

    def connect(
        self, *, host: str = "", origin: str | None = "", cookie: str | None = "", port: int = 0
    ) -> ClientConnection:
        """Open a WebSocket, at the port of a relay if one is given; empty: what is right, None: without."""
        carried = self.cookie if cookie == "" else cookie
        return connect(
            f"ws://{host or self.host}/socket",
            sock=create_connection(("127.0.0.1", port or self.port)),
            origin=self.origin if origin == "" else origin,
            additional_headers={} if carried is None else {"cookie": carried},
            max_size=None,
            compression=None,
        )

    @contextmanager
    def page(self, port: int = 0) -> Iterator[Page]:
        """Open a page, at the port of a relay where one is given, and wait until its bench is up."""
        with self.connect(port=port) as socket:
            one = Page(socket)
            try:
                one.until(lambda: one.description["up"] and one.state["axis"], "the bench comes up")
                yield one
            finally:
                if one._life.is_alive():
                    one.hush()


@contextmanager
def served(bench: str = "reference", **options: Any) -> Iterator[Served]:
    """Serve a cockpit, in a working folder of its own where none is given."""
    with TemporaryDirectory() as work:
        listening = listen("127.0.0.1", 0)
        port = listening.getsockname()[1]
        app = cockpit(
            load_bench(bench),
            token=TOKEN,
            port=port,
            hosts=[f"127.0.0.1:{port}"],
            folder=options.pop("folder", Path(work)),
            **options,
        )
        server = http_server(app)
        thread = Thread(target=lambda: server.run(sockets=[listening]), daemon=True)
        thread.start()
        try:
            yield Served(port)
        finally:
            server.should_exit = True
            thread.join(PATIENCE_S)
            listening.close()
