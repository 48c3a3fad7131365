"""The drive process: emulated devices in real time, for a bench in another process or
for somebody else's controller.

`hil emulate` runs a `DriveHost` for somebody else's controller. Started as a program, this module serves one
bench after the other: commands come as JSON lines on standard input, replies go to standard output
(`hil.bench.remote` is the other side).
"""

from __future__ import annotations

import base64
import json
import os
import queue
import sys
import threading
import time
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from functools import partial
from typing import TYPE_CHECKING, Any, Final

from fieldbus.canopen.nmt import NmtState
from fieldbus.clock import RealtimeScheduler, S
from fieldbus.history import History
from hil.bench.config import BenchConfig
from hil.bench.drive_config import ProfidriveModbusTable
from hil.bench.emulated import DeviceBuilder, EmulatedDevices
from hil.bench.io_config import StationTable
from hil.bench.remote_calls import PARAMETER_METHODS, REMOTE_METHODS, RemoteError
from hil.bench.segment_config import CanTable, RtuTable, TcpTable
from hil.record import STORE_EVERY_NS, Recorder

if TYPE_CHECKING:
    from emulators.drive.profidrive import DriveParameters
    from fieldbus.can.live import LiveSegment
    from fieldbus.modbus import SocketNetwork
    from hil.bench.emulated import EmulatedPart
    from hil.bench.modbus_links import ModbusDevice

_ORPHAN_S: Final = 3.0
"""How long the process may take to end by itself when its bench is gone."""
_FOREVER_S: Final = 3600.0
_FETCHED: Final = 256 * 1024
_FETCHED_EVENTS: Final = 500
"""Bytes of rows and events in one reply: a matter of a millisecond or two."""


class DriveHost:
    """Emulated drives of a bench file on live buses, in real time; a virtual
    bench file is taken as a live one.

    Args:
        config: Validated bench file.
        place: Arguments of `LiveSegment.open` (`interface`, `channel`, options) that replace those of every
            segment; None keeps the bench file's. The drives of a segment with a bridge are on its far side.
        origin_ns: Value of the monotonic clock that is time zero; None: now.
        seed: Seed of the drives' random streams.
        record: Whether signals and events are kept for `execute("fetch")`. Without a record the
            host may run for weeks; `history` then calls its listeners and keeps nothing.

    Raises:
        BusError: A bus cannot be opened.

    """

    def __init__(
        self,
        config: BenchConfig,
        *,
        place: Mapping[str, Any] | None = None,
        origin_ns: int | None = None,
        seed: int = 0,
        record: bool = True,
    ) -> None:
        self.scheduler = RealtimeScheduler(origin_ns)
        self.history = History(self.scheduler)
        self.recorder = Recorder(self.history, self.scheduler, memory_mb=config.bench.recording_memory_mb)
        self.segments: dict[str, LiveSegment] = {}
        self.devices = EmulatedDevices()
        self.places: dict[str, tuple[str, int] | str] = {}
        """Where the drives and stations on Modbus are: host and port, or device file."""
        self._on_modbus: list[ModbusDevice] = []
        self._networks: list[SocketNetwork] = []
        self.released = False
        self._config = config.model_copy(update={"bench": config.bench.model_copy(update={"kind": "live"})})
        try:
            self._open(place)
            if record:
                self.scheduler.every(STORE_EVERY_NS, self.recorder.store_a_little)
            else:
                self.history.listen(lambda _event: self.history.events.clear())
            builder = DeviceBuilder(
                self._config,
                self.scheduler,
                history=self.history,
                recorder=self.recorder if record else None,
                seed=seed,
            )
            self.devices = builder.build(self.segments, self._serve)
        except BaseException:
            self.close()
            raise
        self.devices.power_on()

    def _open(self, place: Mapping[str, Any] | None) -> None:
        from fieldbus.can.live import LiveSegment

        for name, section in self._config.segment.items():
            if not isinstance(section, CanTable):
                continue
            self.segments[name] = LiveSegment.open(
                self.scheduler,
                **(
                    section.opening_for_drives()
                    if place is None
                    else {"fd_bitrate": section.data_bitrate, **place}
                ),
                name=name,
                history=self.history,
                # The bench records the frames of its buses itself.
                keep_log=False,
                # A drive keeps running when its bus is down, or no node acknowledges.
                lossy=True,
            )

    def _serve(self, segment_name: str, name: str, device: ModbusDevice) -> None:
        """Put a drive or an I/O station on a TCP port or a pseudo-terminal of its own."""
        self._on_modbus.append(device)
        segment = self._config.segment[segment_name]
        if isinstance(segment, RtuTable):
            self.places[name] = str(device.open_terminal(segment.serial_format()).path)
            return
        from fieldbus.modbus import SocketNetwork

        table = self._config.station.get(name) or self._config.drive[name]
        assert isinstance(table, ProfidriveModbusTable | StationTable)
        assert isinstance(segment, TcpTable)
        network = SocketNetwork(self.scheduler, unread_ns=round(segment.unread_timeout_s * S))
        self._networks.append(network)
        device.listen(network, limits=segment.limits())
        self.places[name] = network.serve(*table.address(segment))

    def execute(self, command: Mapping[str, Any]) -> object:
        """Carry out one command of the pipe; returns its result, plain data.

        Raises:
            RemoteError: Unknown command, device or method.

        """
        call = str(command.get("call"))
        if call == "fetch":
            return self._fetch(**command.get("kwargs", {}))
        name = str(command.get("drive"))
        part = self.devices.find(name)
        arguments: Sequence[Any] = command.get("args", ())
        if part is not None and call in PARAMETER_METHODS:
            parameters = _parameters_of(part)
            if parameters is not None:
                return _access(parameters, call, arguments)
        method = getattr(part, call, None) if call in REMOTE_METHODS else None
        if method is None:
            raise RemoteError(f"unknown command {call!r} for drive {name!r}")
        result: object = method(*arguments, **command.get("kwargs", {}))
        return result

    def _fetch(self, rows: Mapping[str, int], events: int) -> dict[str, Any]:
        """Return what has been recorded since: so little at a time that the drives are not held up.

        Args:
            rows: Number of rows of each group that the bench has; none: 0.
            events: Number of events that it has.

        """
        left = _FETCHED
        found: dict[str, dict[str, Any]] = {}
        for group in self.recorder.groups:
            width = 8 * (1 + len(group.columns))
            content = group.content_from(rows.get(group.name, 0), left // width)
            left -= len(content)
            found[group.name] = {
                "columns": group.columns,
                "enums": {
                    column: {str(k): v for k, v in texts.items()} for column, texts in group.enums.items()
                },
                "content": base64.b64encode(content).decode("ascii"),
            }
        return {
            "groups": found,
            "events": self.history.events[events : events + _FETCHED_EVENTS],
            "more": left < _FETCHED // 2 or len(self.history.events) > events + _FETCHED_EVENTS,
            "lateness_s": self.scheduler.worst_lateness_ns / S,
        }

    @property
    def booted(self) -> bool:
        """Whether all drives are past their boot-up."""
        return all(state != NmtState.INITIALISING for state in self.devices.nmt_states())

    def run_until(self, predicate: Callable[[], object], timeout_s: float) -> bool:
        """Run the drives until `predicate` is true or `timeout_s` has passed."""
        return self.scheduler.run_until(predicate, round(timeout_s * S))

    def release(self) -> None:
        """Let `run_until` return."""
        self.released = True

    def close(self) -> None:
        """Leave the buses."""
        self.devices.power_off()
        for device in self._on_modbus:
            device.close()
        for network in self._networks:
            network.close()
        for segment in self.segments.values():
            segment.close()


def _parameters_of(part: EmulatedPart) -> DriveParameters | None:
    """Return the parameters of a PROFIdrive axis; None: the device has none."""
    from emulators.drive.profidrive import ProfidriveCanDrive
    from emulators.drive.profidrive.modbus import ProfidriveModbusDrive

    return part.parameters if isinstance(part, ProfidriveCanDrive | ProfidriveModbusDrive) else None


def _access(parameters: DriveParameters, call: str, arguments: Sequence[Any]) -> object:
    if call == "request_parameters":
        return parameters.request(bytes.fromhex(arguments[0])).hex()
    if call == "read_parameter":
        return parameters.read(*arguments)
    parameters.write(*arguments)
    return None


class DriveServer:
    """The program: serves one bench after the other until standard input ends."""

    def __init__(self) -> None:
        self._waiting: queue.SimpleQueue[dict[str, Any] | None] = queue.SimpleQueue()
        self._host: DriveHost | None = None
        self._lock = threading.Lock()

    def run(self) -> int:
        """Serve; returns the exit code."""
        threading.Thread(target=self._read, name="commands", daemon=True).start()
        while True:
            command = self._waiting.get()
            if command is None:
                return 0
            _reply(command, partial(self._start, command))
            host = self._host
            if host is None:
                continue
            while not host.released:
                host.run_until(lambda host=host: host.released, _FOREVER_S)  # type: ignore[misc]
            with self._lock:
                orphaned = self._host is host
            if orphaned:
                host.close()
                return 1

    def _read(self) -> None:
        for line in sys.stdin:
            command = json.loads(line)
            with self._lock:
                host = self._host
                if host is None or command.get("call") == "start":
                    self._waiting.put(command)
                    continue
            host.scheduler.post(partial(self._serve, host, command))
        # The bench has ended, perhaps killed: the drives leave the bus, whatever they are doing.
        self._waiting.put(None)
        with self._lock:
            if self._host is not None:
                self._host.scheduler.post(self._host.release)
        time.sleep(_ORPHAN_S)
        os._exit(1)

    def _start(self, command: Mapping[str, Any]) -> dict[str, Any]:
        host = DriveHost(
            BenchConfig.model_validate(command["config"]),
            origin_ns=command["origin_ns"],
            seed=command["seed"],
        )
        with self._lock:
            self._host = host
        return {"places": host.places}

    def _serve(self, host: DriveHost, command: Mapping[str, Any]) -> None:
        if command.get("call") == "release":
            with self._lock:
                self._host = None
            host.release()
            host.close()
            _reply(command, lambda: None)
        else:
            _reply(command, lambda: host.execute(command))


def _reply(command: Mapping[str, Any], act: Callable[[], object]) -> None:
    try:
        text = json.dumps({"id": command.get("id", -1), "result": act()})
    except Exception as error:  # noqa: BLE001 - whatever it was, the bench must hear of it
        text = json.dumps({"id": command.get("id", -1), "error": f"{type(error).__name__}: {error}"})
    with suppress(BrokenPipeError):  # the end of the input says it too
        print(text, flush=True)  # noqa: T201 - the pipe


if __name__ == "__main__":
    sys.exit(DriveServer().run())
