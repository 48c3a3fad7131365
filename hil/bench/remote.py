"""The emulated devices of a live bench, in a process of their own.

`RemoteDevices` starts that process (`hil.bench.drive_host`), shares its time base, and passes fault commands
and records over pipes as JSON lines. Nothing of the control path runs over the pipes: axis and drive meet on
the bus only.
"""

from __future__ import annotations

import atexit
import base64
import json
import os
import subprocess
import sys
import threading
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from functools import partial
from typing import TYPE_CHECKING, Any, Final, Protocol

from fieldbus.clock import S
from fieldbus.errors import HilError
from fieldbus.history import Event
from hil.bench.device_config import DEVICE_METHODS
from hil.bench.encoders import ENCODER_METHODS
from hil.bench.remote_calls import STATION_METHODS, RemoteError
from hil.errors import BlockedError
from hil.faults import DRIVE_METHODS
from hil.record import ReceivedRows, TraceGroup

if TYPE_CHECKING:
    from fieldbus.clock import RealtimeScheduler, Scheduler
    from hil.bench.config import BenchConfig

_READY_TIMEOUT_NS: Final = 60 * S
_REPLY_TIMEOUT_NS: Final = 10 * S


class DriveCalls(Protocol):
    """Calls methods of the devices in the drive process."""

    def call(
        self,
        method: str,
        drive: str | None,
        args: Sequence[Any] = (),
        kwargs: Mapping[str, Any] | None = None,
    ) -> Any:
        """Call a method of a device; returns its result, or None within a callback."""


class RemoteDrive:
    """Stands for a drive, an encoder or a device in the drive process: its fault interface."""

    def __init__(self, remote: DriveCalls, name: str, methods: frozenset[str]) -> None:
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

    def __init__(self, remote: DriveCalls, name: str) -> None:
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
    """One process that holds emulated drives; it serves one bench after the other,
    because starting it takes seconds.
    """

    def __init__(self) -> None:
        self.gone = False
        self.replies: dict[int, dict[str, Any]] = {}
        self._post: Callable[[Callable[[], object]], None] | None = None
        self._number = 0
        self._process = subprocess.Popen(
            [sys.executable, "-m", "hil.bench.drive_host"],
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
        """Hand replies over to `scheduler` from now on; None: discard them."""
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
            post(_nothing)  # wakes a call that waits for a reply

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


class RemoteDevices:
    """The emulated devices of a live bench, in the drive process.

    Args:
        config: The bench file.
        scheduler: Time of the bench; the process shares its origin.
        seed: Seed of the random streams of the devices.

    Raises:
        BlockedError: The process did not come up.

    """

    def __init__(self, config: BenchConfig, scheduler: RealtimeScheduler, *, seed: int) -> None:
        self._scheduler = scheduler
        self._rows: dict[str, ReceivedRows] = {}
        self.events: list[Event] = []
        """Events of the devices as of the last `fetch`."""
        self.lateness_s = 0.0
        """Worst lateness in the drive process as of the last fetch, s."""
        process = self._process = _idle.pop() if _idle else DriveProcess()
        process.serve(scheduler)
        number = process.send(
            "start",
            config=config.model_dump(mode="json", exclude_unset=True),
            origin_ns=scheduler.origin_ns,
            seed=seed,
        )
        scheduler.run_until(lambda: process.gone or number in process.replies, _READY_TIMEOUT_NS)
        reply = process.replies.pop(number, {"error": "it ended, or did not answer in time"})
        if "error" in reply:
            process.end()
            raise BlockedError(f"the process of the emulated drives failed: {reply['error']}")
        places: dict[str, Any] = reply["result"]["places"]
        self.places: dict[str, tuple[str, int] | str] = {
            name: place if isinstance(place, str) else (str(place[0]), int(place[1]))
            for name, place in places.items()
        }
        """Where the emulated drives on Modbus are: host and port, or device file."""
        drives = {name: one for name, one in config.drive.items() if one.device == "emulated"}
        self.drives = {name: RemoteDrive(self, name, DRIVE_METHODS) for name in drives}
        self.second_encoders = {
            f"{name}.encoder2": RemoteDrive(self, f"{name}.encoder2", ENCODER_METHODS)
            for name, one in drives.items()
            if one.second_encoder is not None
        }
        self.encoders = {name: RemoteDrive(self, name, ENCODER_METHODS) for name in config.emulated_encoders}
        self.devices = {name: RemoteDrive(self, name, DEVICE_METHODS) for name in config.device}
        self.stations = {name: RemoteDrive(self, name, STATION_METHODS) for name in config.station}

    def call(
        self,
        method: str,
        drive: str | None,
        args: Sequence[Any] = (),
        kwargs: Mapping[str, Any] | None = None,
    ) -> Any:
        """Send a command. Inside of a callback it is only sent; outside the reply is waited for and returned.

        Raises:
            RemoteError: The drive process refuses, ended, or does not answer.

        """
        process = self._process
        number = process.send(method, drive=drive, args=list(args), kwargs=dict(kwargs or {}))
        scheduler = self._scheduler
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

    def fetch(self) -> None:
        """Get what the drive process has recorded since the last time."""
        while not self._process.gone:
            had = {name: rows.rows for name, rows in self._rows.items()}
            result = self.call("fetch", None, kwargs={"rows": had, "events": len(self.events)})
            for name, group in result["groups"].items():
                columns = tuple((column, unit) for column, unit in group["columns"])
                enums = {c: {int(k): v for k, v in texts.items()} for c, texts in group["enums"].items()}
                if name not in self._rows:
                    self._rows[name] = ReceivedRows(name, columns, enums)
                self._rows[name].add(base64.b64decode(group["content"]))
            self.events += [Event(int(t), source, kind, data) for t, source, kind, data in result["events"]]
            self.lateness_s = float(result["lateness_s"])
            if not result["more"]:
                break

    @property
    def groups(self) -> list[TraceGroup]:
        """Records of the devices as of the last `fetch`."""
        return [rows.so_far() for rows in self._rows.values()]

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
