"""The thread of the bench: nothing else touches it. Messages are carried out here, between slices of time."""

from __future__ import annotations

import shutil
import tempfile
import threading
import time
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from typing import TYPE_CHECKING, Final

from fieldbus.errors import HilError
from hil.cockpit.messages import Message, MessageError, encoded
from hil.cockpit.pace import Pace

if TYPE_CHECKING:
    from hil.bench import BenchFile
    from hil.bench.bench import Bench
    from hil.cockpit.client import Client
    from hil.cockpit.operator import Control
    from hil.cockpit.pane import Handler, Pane

_STATE_S: Final = 0.1
"""Time between two states for the pages, s."""
_LOOK_S: Final = 1.0
_LEAST_ROOM: Final = 1_000_000_000
"""Room on the disk of the temporary files that a recording leaves, bytes."""
_NO_BENCH: Final = "no bench is up: start one in the view Bench"

Carried = Callable[["Client", Message, int], object]
"""Called with every message that has been carried out: from whom, what, bench time in ns before it."""


class Machine:
    """A bench and what may be done with it; `start` begins its thread.

    Args:
        bench_file: The bench that comes first.
        control: Who operates.
        seed: Seed of every bench.
        first: Brings up the first bench, in the middle of a case; None: it is built of the bench file.
        room: Returns the room on the disk to which a long recording goes, bytes.

    """

    def __init__(
        self,
        bench_file: BenchFile,
        control: Control,
        *,
        seed: int = 0,
        first: Callable[[], Bench] | None = None,
        room: Callable[[], int] = lambda: shutil.disk_usage(tempfile.gettempdir()).free,
    ) -> None:
        self._room = room
        self.bench_file = bench_file
        """What the present bench is built of."""
        self.bench: Bench | None = None
        self.pace: Pace | None = None
        self.failure = ""
        """Why no bench is up, in words."""
        self.carried_out: list[Carried] = []
        """Called with every message that has been carried out, in the thread of the bench."""
        self.replays = False
        """Whether the present bench was brought up in the middle of a case."""
        self._seed = seed
        self._first = first
        self._control = control
        self._panes: Sequence[Pane] = ()
        self._handlers: dict[type[Message], Handler] = {}
        self._clients: list[Client] = []
        self._work: deque[Callable[[], object]] = deque()
        self._wake = threading.Event()
        self._ending = False
        self._next_state_s = 0.0
        self._next_look_s = 0.0
        self._aside = ThreadPoolExecutor(max_workers=1, thread_name_prefix="aside")
        self._thread = threading.Thread(target=self._run, name="bench", daemon=True)

    def use(self, panes: Sequence[Pane]) -> None:
        """Take the panes, before the thread begins."""
        self._panes = panes
        for pane in panes:
            self._handlers.update(pane.handlers)

    @property
    def kinds(self) -> list[type[Message]]:
        """The messages of all panes."""
        return list(self._handlers)

    # -- from the thread of the server
    # -------------------------------------------------------------------------------------------

    def start(self) -> None:
        """Bring up the first bench, in the thread that begins here."""
        self._thread.start()

    def stop(self) -> None:
        """Give all axes back, close the bench and end the thread."""
        self._ending = True
        self._wake.set()
        self._thread.join()
        self._aside.shutdown(cancel_futures=True)

    def post(self, message: Message, client: Client) -> None:
        """Let a message be carried out; the page gets a reply."""
        if message.aside:
            self._aside.submit(self._carry_out, message, client)
        else:
            self._give(lambda: self._carry_out(message, client))

    def welcome(self, client: Client) -> None:
        """Take a page in: it gets the description of the bench."""
        self._give(lambda: self._welcome(client))

    def farewell(self, client: Client) -> None:
        """Forget a page; what it operated is stopped."""
        self._give(lambda: self._farewell(client))

    def _give(self, job: Callable[[], object]) -> None:
        self._work.append(job)
        self._wake.set()

    # -- in the thread of the bench
    # -------------------------------------------------------------------------------------------

    def broadcast(self, document: object) -> None:
        """Send a document to all pages."""
        for client in self._clients:
            client.send(document)

    def the_bench(self) -> Bench:
        """Return the bench.

        Raises:
            MessageError: None is up.

        """
        if self.bench is None:
            raise MessageError(_NO_BENCH)
        return self.bench

    def the_pace(self) -> Pace:
        """Return the time control of the bench.

        Raises:
            MessageError: None is up.

        """
        if self.pace is None:
            raise MessageError(_NO_BENCH)
        return self.pace

    def release_control(self, client: Client) -> None:
        """Let every pane give back what the operator has, and let others operate."""
        for pane in self._panes:
            pane.given_up()
        self._control.release(client)

    def open(self, bench_file: BenchFile, build: Callable[[], Bench] | None = None) -> None:
        """Close the present bench and bring up another one.

        Args:
            bench_file: What it is built of.
            build: Brings it up in the middle of a case; None: it is fresh.

        Raises:
            HilError: It does not come up; the message says why.

        """
        self._close()
        self.bench_file = bench_file
        self.failure = ""
        try:
            bench = self.bench = bench_file.build(seed=self._seed) if build is None else build()
            self.replays = build is not None
            self.pace = Pace(bench, live=bench.kind == "live")
            if self.replays:
                self.pace.pause()  # it is there to be looked at
            for pane in self._panes:
                pane.begin(bench)
        except Exception as error:
            with suppress(Exception):
                self._close()
            self.failure = _said(error)
            self._describe()
            raise
        self._describe()

    def _close(self) -> None:
        bench, self.bench, self.pace = self.bench, None, None
        if bench is None:
            return
        try:
            for pane in self._panes:
                with suppress(HilError):
                    pane.end()
        finally:
            bench.close()

    def _run(self) -> None:
        with suppress(Exception):  # its message is kept in `failure`, and every page shows it
            self.open(self.bench_file, self._first)
        try:
            while not self._ending:
                try:
                    self._round()
                except Exception as error:  # noqa: BLE001 - a bench that breaks does not take the cockpit along
                    self._broken(error)
        finally:
            self._close()

    def _round(self) -> None:
        for _ in range(len(self._work)):
            self._work.popleft()()
        wait_s = _STATE_S if self.pace is None else self.pace.advance()
        now_s = time.monotonic()
        if self.bench is not None:
            for pane in self._panes:
                pane.pulse(now_s)
            if now_s >= self._next_look_s:
                self._next_look_s = now_s + _LOOK_S
                self._bound()
        if now_s >= self._next_state_s:
            self._next_state_s = now_s + _STATE_S
            self._show()
        if wait_s > 0.0 and not self._work:
            self._wake.wait(wait_s)
        self._wake.clear()

    def _bound(self) -> None:
        """Keep the recording from filling the disk: a virtual bench stands still, a live one forgets."""
        bench, pace = self.bench, self.pace
        if bench is None or pace is None or self._room() >= _LEAST_ROOM:
            return
        if pace.live:
            bench.recorder.forget()
        elif pace.running:
            pace.hold(
                "The bench stands still: the disk for its recording, of the temporary files in "
                f"{tempfile.gettempdir()}, has less than 1 GB left. Make room and press Run, or press "
                "Reset bench, which begins a new recording."
            )

    def _broken(self, error: Exception) -> None:
        with suppress(Exception):
            self._close()
        self.failure = f"the bench has broken off: {_said(error)}"
        self._describe()

    def _carry_out(self, message: Message, client: Client) -> None:
        reply: dict[str, object] = {"kind": "reply", "id": message.id}
        before = 0 if self.bench is None else self.bench.scheduler.now
        try:
            if message.operates:
                self._control.need(client)
            value = self._handlers[type(message)](message, client)
        except HilError as error:
            client.send({**reply, "ok": False, "error": str(error)})
            return
        except Exception as error:  # noqa: BLE001 - a bench that breaks does not take the cockpit along
            client.send({**reply, "ok": False, "error": _said(error)})
            if not message.aside:
                self._broken(error)
            return
        client.send({**reply, "ok": True, "value": value})
        if not message.aside:
            for call in self.carried_out:
                call(client, message, before)

    def _welcome(self, client: Client) -> None:
        self._clients = [*self._clients, client]
        client.send(self._hello(client))
        self._next_state_s = 0.0

    def _farewell(self, client: Client) -> None:
        self._clients = [one for one in self._clients if one is not client]
        for pane in self._panes:
            pane.gone(client)
        self._control.release(client)

    def _hello(self, client: Client) -> Mapping[str, object]:
        bench, file = self.bench, self.bench_file
        return {
            "kind": "bench",
            "you": client.name,
            "name": file.name,
            "source": file.source,
            "live": file.kind == "live",
            "cycle_ms": None if bench is None else bench.cycle_ns / 1e6,
            "up": bench is not None,
            "failure": self.failure,
            "panes": {} if bench is None else {pane.name: pane.description() for pane in self._panes},
        }

    def _describe(self) -> None:
        """Tell all pages what the bench is now; that they had no state meanwhile is not their fault."""
        for client in self._clients:
            client.alive()
            client.send(self._hello(client))
        self._next_state_s = 0.0

    def _show(self) -> None:
        clients = self._clients
        if not clients:
            return
        operator = self._control.client
        document: dict[str, object] = {
            "kind": "state",
            "at": round(time.monotonic() * 1000.0),
            "time_s": None if self.bench is None else self.bench.now_s,
            "operator": None if operator is None else operator.name,
            "away": operator is not None and not self._control.present,
            "pages": len(clients),
        }
        if self.bench is not None:
            document.update({pane.name: pane.state() for pane in self._panes})
        text = encoded(document)
        for client in clients:
            if not client.busy:
                client.show(text)


def _said(error: Exception) -> str:
    """Return what an exception says; a programming error with its type."""
    return str(error) if isinstance(error, HilError) else f"{type(error).__name__}: {error}"
