"""A station of the npm package `canopen` in a process of its own, on a segment in real time, and a drive
next to it.

`testcases/peers/node_station.js` is the other end: it hands every frame and every call to the unmodified
library.
"""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import threading
from collections.abc import Callable
from pathlib import Path
from typing import Any, Final

import numpy as np
import pytest

from emulators.drive.cia402 import CiA402Drive, DriveConfig
from fieldbus.can import CanFrame, CanMedium
from fieldbus.clock import RealtimeScheduler, seconds_to_ns
from fieldbus.history import History

NODE: Final = 5
"""The drive."""
MASTER: Final = 100
"""The stranger."""
PATIENCE_S: Final = 30.0
"""How long to wait for anything; it decides only how long a failure takes."""

_PROGRAM: Final = Path(__file__).parent / "peers" / "node_station.js"


class PeerError(Exception):
    """A service of the library failed; `code` is what it says of the reason, an SDO abort code for
    example.
    """

    def __init__(self, text: str, code: int | None) -> None:
        super().__init__(text)
        self.code = code


class NodeStation:
    """The station: its frames go over the segment, its services are calls that let time pass until they
    answer.
    """

    def __init__(
        self, scheduler: RealtimeScheduler, segment: CanMedium, modules: Path, own: int, other: int
    ) -> None:
        self._scheduler = scheduler
        self._port = segment.attach(f"node-canopen-{own}", self._to_station)
        self._calls = 0
        self._answers: dict[int, tuple[Any, PeerError | None]] = {}
        self.events: list[tuple[str, Any]] = []
        """What the library has noticed by itself, in order."""
        self._process = subprocess.Popen(
            [shutil.which("node") or "node", _PROGRAM, str(own), str(other)],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
            env={**os.environ, "NODE_PATH": str(modules)},
        )
        self._reader = threading.Thread(target=self._read, daemon=True)
        self._reader.start()
        self.until(lambda: self.events, "Node.js to start")

    def _read(self) -> None:
        assert self._process.stdout is not None
        for line in self._process.stdout:
            message = json.loads(line)
            self._scheduler.post(lambda message=message: self._take(message))

    def _take(self, message: dict[str, Any]) -> None:
        if "frame" in message:
            can_id, data = message["frame"]
            self._port.send(CanFrame(can_id, bytes.fromhex(data)))
        elif "event" in message:
            self.events.append((message["event"][0], message["event"][1]))
        elif "result" in message:
            self._answers[message["result"][0]] = (message["result"][1], None)
        else:
            number, text, code = message["error"]
            self._answers[number] = (None, PeerError(text, code))

    def _write(self, message: dict[str, Any]) -> None:
        assert self._process.stdin is not None
        self._process.stdin.write(json.dumps(message) + "\n")
        self._process.stdin.flush()

    def _to_station(self, frame: CanFrame, _time_ns: int) -> None:
        if not frame.remote and not frame.extended:
            self._write({"frame": [frame.can_id, frame.data.hex()]})

    def until(self, condition: Callable[[], object], what: str) -> None:
        """Let time pass until a condition holds; fail after `PATIENCE_S`."""
        if not self._scheduler.run_until(condition, seconds_to_ns(PATIENCE_S)):
            pytest.fail(f"waited {PATIENCE_S} s for {what}; noticed so far: {self.events[-10:]}")

    def poll(self, condition: Callable[[], object], what: str) -> None:
        """Call `condition`, which may itself ask for services, again and again until it holds."""
        end_ns = self._scheduler.now + seconds_to_ns(PATIENCE_S)
        while not condition():
            if self._scheduler.now > end_ns:
                pytest.fail(f"waited {PATIENCE_S} s for {what}; noticed so far: {self.events[-10:]}")
            self.run(0.005)

    def run(self, seconds: float) -> None:
        """Let time pass."""
        self._scheduler.run_for(seconds_to_ns(seconds))

    def begin(self, service: str, **arguments: Any) -> int:
        """Ask for a service and return the number of the call."""
        self._calls += 1
        self._write({"call": [self._calls, service, arguments]})
        return self._calls

    def call(self, service: str, **arguments: Any) -> Any:
        """Ask for a service, let time pass until it is done, and return its answer.

        Raises:
            PeerError: The library says that it failed.

        """
        number = self.begin(service, **arguments)
        self.until(lambda: number in self._answers, f"{service}({arguments})")
        value, error = self._answers.pop(number)
        if error is not None:
            raise error
        return value

    def upload(self, index: int, sub: int = 0, *, block: bool = False) -> bytes:
        """Read an object by SDO."""
        return bytes.fromhex(self.call("upload", index=index, subIndex=sub, block=block))

    def download(self, index: int, sub: int, data: bytes, *, block: bool = False) -> None:
        """Write an object by SDO."""
        self.call("download", index=index, subIndex=sub, data=data.hex(), block=block)

    def noticed(self, name: str) -> list[Any]:
        """Return the events of one kind, in order."""
        return [value for kind, value in self.events if kind == name]

    def close(self) -> None:
        """End the process."""
        assert self._process.stdin is not None
        self._process.stdin.close()
        self._process.wait(10.0)
        self._reader.join(10.0)


class Station:
    """A reference axis at node 5 on a segment in real time; `power_on` once somebody listens."""

    def __init__(self, name: str) -> None:
        self.scheduler = RealtimeScheduler()
        self.history = History(self.scheduler)
        self.segment = CanMedium(self.scheduler, name=name, history=self.history)
        self.drive = CiA402Drive(
            self.scheduler,
            self.segment,
            DriveConfig.reference(node_id=NODE),
            name="drive",
            history=self.history,
            rng=np.random.default_rng(1),
        )
