"""Emulated drives in a process of their own, on a live bus.

`DriveHost` (`hil.bench.drive_host`) is the process' inside; `hil emulate` runs it for somebody else's
controller.
`RemoteDrives` is the bench's side: it starts that process, shares its time base, and passes fault commands
and records over
pipes as JSON lines. Nothing of the control path runs over the pipes: axis and
drive meet on the bus only.
"""

from __future__ import annotations

import atexit
import base64
import json
import os
import queue
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Mapping
from contextlib import suppress
from functools import partial
from typing import TYPE_CHECKING, Any, Final

from fieldbus.clock import RealtimeScheduler, S, Scheduler
from fieldbus.errors import HilError
from fieldbus.history import Event
from hil.bench.config import BenchConfig
from hil.bench.drive_host import FAULT_METHODS, DriveHost, RemoteError
from hil.errors import BlockedError
from hil.record._trace import TraceGroup

if TYPE_CHECKING:
    from hil.bench.bench import Bench

_READY_TIMEOUT_NS: Final = 60 * S
_REPLY_TIMEOUT_NS: Final = 10 * S
_ORPHAN_S: Final = 3.0
"""How long a drive process may take to end by itself when its bench is gone."""


class RemoteDrive:
    """Stands for a drive or an encoder in the drive process: the fault interface and nothing else."""

    def __init__(self, remote: RemoteDrives, name: str, methods: frozenset[str]) -> None:
        self._remote = remote
        self._methods = methods
        self.name = name

    @property
    def parameters(self) -> RemoteParameters:
        """The parameters of a PROFIdrive axis."""
        return RemoteParameters(self._remote, self.name)

    def __getattr__(self, method: str) -> Callable[..., Any]:
        if method not in self._methods:
            raise AttributeError(
                f"{self.name} in another process has no {method!r}; it has {', '.join(sorted(self._methods))}"
            )
        return lambda *args, **kwargs: self._remote.call(method, self.name, args, kwargs)


class RemoteParameters:
    """Stands for the parameters of a PROFIdrive axis in the drive process; see `DriveParameters`."""

    def __init__(self, remote: RemoteDrives, name: str) -> None:
        self._remote = remote
        self._name = name

    def read(self, parameter: int | str, sub_index: int = 0) -> int | float:
        """Return the present value of a parameter, given by number or name.

        Raises:
            RemoteError: It is refused, or the drive has no parameters.

        """
        value: int | float = self._remote.call("read_parameter", self._name, (parameter, sub_index))
        return value

    def write(self, parameter: int | str, value: float, sub_index: int = 0) -> None:
        """Write a parameter by all rules.

        Raises:
            RemoteError: It is refused, or the drive has no parameters.

        """
        self._remote.call("write_parameter", self._name, (parameter, value, sub_index))

    def request(self, data: bytes) -> bytes:
        """Return the answer to a request of base mode parameter access.

        Raises:
            RemoteError: The drive has no parameters.

        """
        return bytes.fromhex(self._remote.call("request_parameters", self._name, (data.hex(),)))


class DriveProcess:
    """One process that holds emulated drives; it serves one bench after the other, because starting it takes
    seconds.
    """

    def __init__(self) -> None:
        self.gone = False
        self.replies: dict[int, dict[str, Any]] = {}
        self._post: Callable[[Callable[[], object]], None] | None = None
        self._number = 0
        self._process = subprocess.Popen(
            [sys.executable, "-m", "hil.bench.remote"],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
            bufsize=1,
            env={**os.environ, "PYTHONUNBUFFERED": "1"},
            # Ctrl-C in the terminal is our business; the end of the pipe is what ends the drives.
            start_new_session=True,
        )
        self._reader = threading.Thread(target=self._read, name="drive process", daemon=True)
        self._reader.start()

    def serve(self, scheduler: Scheduler | None) -> None:
        """Hand replies over to `scheduler` from now on; None: to nobody."""
        self.replies.clear()
        self._post = None if scheduler is None else scheduler.post

    def send(self, call: str, **message: Any) -> int:
        """Send a command; returns the number of its reply."""
        self._number += 1
        assert self._process.stdin is not None
        try:
            self._process.stdin.write(json.dumps({"id": self._number, "call": call, **message}) + "\n")
            self._process.stdin.flush()
        except (BrokenPipeError, ValueError):
            self.gone = True
        return self._number

    def _read(self) -> None:
        assert self._process.stdout is not None
        for line in self._process.stdout:
            try:
                reply = json.loads(line)
            except json.JSONDecodeError:
                continue
            post = self._post
            if post is not None:
                post(partial(self.replies.__setitem__, int(reply["id"]), reply))
        self.gone = True
        post = self._post
        if post is not None:
            post(_nothing)  # wakes whoever waits for a reply

    def end(self) -> None:
        """End the process."""
        if self._process.poll() is None:
            if self._process.stdin is not None:
                with suppress(BrokenPipeError):
                    self._process.stdin.close()
            try:
                self._process.wait(5.0)
            except subprocess.TimeoutExpired:
                self._process.kill()
                self._process.wait()
        self._reader.join(2.0)
        if self._process.stdout is not None:
            self._process.stdout.close()


_idle: list[DriveProcess] = []


@atexit.register
def _end_idle() -> None:
    while _idle:
        _idle.pop().end()


def _nothing() -> None:
    pass


class RemoteDrives:
    """The drives of a live bench, in their process.

    Args:
        bench: The live bench that they belong to.
        config: Its bench file.

    Raises:
        BlockedError: The process did not come up.

    """

    def __init__(self, bench: Bench, config: BenchConfig) -> None:
        self._bench = bench
        self.groups: dict[str, TraceGroup] = {}
        self.events: list[Event] = []
        self.lateness_s = 0.0
        """Worst lateness in the drive process as of the last fetch, s."""
        scheduler = bench.scheduler
        assert isinstance(scheduler, RealtimeScheduler)
        process = self._process = _idle.pop() if _idle else DriveProcess()
        process.serve(scheduler)
        number = process.send(
            "start",
            config=config.model_dump(mode="json", exclude_unset=True),
            origin_ns=scheduler.origin_ns,
            seed=bench.seed,
        )
        scheduler.run_until(lambda: process.gone or number in process.replies, _READY_TIMEOUT_NS)
        reply = process.replies.pop(number, {"error": "it ended, or did not answer in time"})
        if "error" in reply:
            process.end()
            raise BlockedError(f"the process of the emulated drives failed: {reply['error']}")
        self.places: dict[str, Any] = reply["result"]["places"]
        """Where the emulated drives on Modbus are: host and port, or device file."""

    def call(
        self, method: str, drive: str | None, args: Any = (), kwargs: Mapping[str, Any] | None = None
    ) -> Any:
        """Send a command. Inside of a callback it is only sent; outside the reply is waited for and returned.

        Raises:
            RemoteError: The drive process refuses, ended, or does not answer.

        """
        process = self._process
        number = process.send(method, drive=drive, args=list(args), kwargs=dict(kwargs or {}))
        scheduler = self._bench.scheduler
        if scheduler.running:
            return None
        if not scheduler.run_until(lambda: process.gone or number in process.replies, _REPLY_TIMEOUT_NS):
            raise RemoteError(f"the drive process does not answer to {method}")
        reply = process.replies.pop(number, None)
        if reply is None:
            raise RemoteError(f"the drive process ended during {method}")
        if "error" in reply:
            raise RemoteError(f"{drive}.{method}: {reply['error']}")
        return reply.get("result")

    def proxy(self, name: str, methods: frozenset[str] = FAULT_METHODS) -> RemoteDrive:
        """Return the stand-in of a drive or encoder that offers these methods."""
        return RemoteDrive(self, name, methods)

    def fetch(self) -> None:
        """Bring the drives' records over."""
        if self._process.gone:
            return
        result = self.call("fetch", None)
        self.groups = {
            name: TraceGroup.from_bytes(
                name,
                tuple((column, unit) for column, unit in group["columns"]),
                {column: {int(k): v for k, v in texts.items()} for column, texts in group["enums"].items()},
                base64.b64decode(group["content"]),
            )
            for name, group in result["groups"].items()
        }
        self.events = [Event(int(t), source, kind, data) for t, source, kind, data in result["events"]]
        self.lateness_s = float(result["lateness_s"])

    def close(self) -> None:
        """Take the drives off the bus; the process stays for the next bench."""
        process = self._process
        try:
            self.call("release", None)
        except HilError:
            process.end()
        else:
            process.serve(None)
            _idle.append(process)


def main() -> int:
    """Serve one bench after the other until standard input ends."""
    waiting: queue.SimpleQueue[dict[str, Any] | None] = queue.SimpleQueue()
    active: list[DriveHost] = []
    lock = threading.Lock()

    def reply(command: Mapping[str, Any], act: Callable[[], Any]) -> None:
        try:
            text = json.dumps({"id": command.get("id", -1), "result": act()})
        except Exception as error:  # noqa: BLE001 - whatever it was, the bench must hear of it
            text = json.dumps({"id": command.get("id", -1), "error": f"{type(error).__name__}: {error}"})
        with suppress(BrokenPipeError):  # the end of the input says it too
            print(text, flush=True)  # noqa: T201 - the pipe

    def read() -> None:
        for line in sys.stdin:
            command = json.loads(line)
            with lock:
                host = active[0] if active else None
                if host is None or command.get("call") == "start":
                    waiting.put(command)
                    continue
            host.scheduler.post(partial(serve, host, command))
        # Nobody is at the other end any more, killed perhaps: the drives leave the bus, whatever they are
        # doing.
        waiting.put(None)
        with lock:
            if active:
                active[0].scheduler.post(active[0].release)
        time.sleep(_ORPHAN_S)
        os._exit(1)

    def serve(host: DriveHost, command: Mapping[str, Any]) -> None:
        if command.get("call") == "release":
            with lock:
                active.clear()
            host.release()
            host.close()
            reply(command, lambda: None)
        else:
            reply(command, lambda: host.execute(command))

    threading.Thread(target=read, name="commands", daemon=True).start()
    while True:
        first = waiting.get()
        if first is None:
            return 0
        command = first

        def start(command: Mapping[str, Any] = command) -> dict[str, Any]:
            host = DriveHost(
                BenchConfig.model_validate(command["config"]),
                origin_ns=command["origin_ns"],
                seed=command["seed"],
            )
            with lock:
                active.append(host)
            return {"places": host.places}

        reply(command, start)
        with lock:
            host = active[0] if active else None
        while host is not None and not host.released:
            host.run_until(lambda host=host: host.released, 3600.0)  # type: ignore[misc]
        with lock:
            orphaned = host is not None and host in active
        if host is not None and orphaned:
            host.close()
            return 1


if __name__ == "__main__":
    sys.exit(main())
