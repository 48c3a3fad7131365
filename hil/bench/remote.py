"""Emulated drives in a process of their own, on a live bus.

`DriveHost` is the process' inside: emulated drives in real time on python-can buses; `hil emulate` runs it for
somebody else's controller. `RemoteDrives` is the bench's side: it starts that process, shares its time base, and
passes fault commands and records over pipes as JSON lines. Nothing of the control path runs over the pipes: axis and
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

from fieldbus.canopen.nmt import NmtState
from fieldbus.clock import MS, RealtimeScheduler, S, Scheduler
from fieldbus.errors import HilError
from fieldbus.history import Event, History
from hil.bench.config import BenchConfig
from hil.bench.devices import DEVICE_METHODS
from hil.bench.encoders import ENCODER_METHODS
from hil.errors import BlockedError
from hil.record import Recorder
from hil.record._trace import TraceGroup

if TYPE_CHECKING:
    from fieldbus.modbus import SocketNetwork
    from hil.bench.bench import Bench

_READY_TIMEOUT_NS: Final = 60 * S
_REPLY_TIMEOUT_NS: Final = 10 * S
_ORPHAN_S: Final = 3.0
"""How long a drive process may take to end by itself when its bench is gone."""

FAULT_METHODS: Final = frozenset((
    "raise_fault", "clear_fault_cause", "set_sto", "freeze_encoder", "jump_encoder", "miss_index", "invert_input", "swap_limit_switches", "jam", "load_force",
    "force_input", "stop_heartbeat", "power_off", "power_on",
    "set_encoder_noise", "reverse_encoder", "lose_encoder_steps",
    "set_ss1", "set_ss2", "set_sos", "set_sbc", "set_sls", "set_sdi", "set_slp", "acknowledge_safety", "open_interlock", "delay_heartbeat", "cut_mains",
    "cut_phase", "set_dc_link_voltage", "restore_dc_link", "break_chopper", "limit_torque", "stick_brake", "slip_brake",
    "scale_ramps", "set_local_control", "refuse_transitions", "fall_to_switch_on_disabled", "show_warning",
    "freeze_statusword", "lie_in_statusword", "toggle_target_reached", "show_mode_as", "reset_node", "abort_sdo",
    "silence_sdo", "storm_emcy", "force_temperature", "drift_encoder",
    "break_encoder", "set_encoder_error",
))  # fmt: skip
"""Methods of a drive that may be called through the pipe."""


PARAMETER_METHODS: Final = frozenset(("read_parameter", "write_parameter", "request_parameters"))
"""What `RemoteParameters` sends through the pipe."""

_METHODS: Final = FAULT_METHODS | ENCODER_METHODS | DEVICE_METHODS


class RemoteError(HilError):
    """The drive process failed or does not answer."""


class DriveHost:
    """Emulated drives of a bench file on live buses, in real time.

    Args:
        config: Validated bench file.
        place: Arguments of `LiveSegment.open` (`interface`, `channel`, options) that replace those of every segment;
            None keeps the bench file's. The drives of a segment with a bridge are on its far side.
        origin_ns: Value of the monotonic clock that is time zero; None: now.
        seed: Seed of the drives' random streams.
        record: Whether frames, signals and events are kept for `execute("fetch")`. Without a record the host may
            run for weeks; `history` then tells its listeners and forgets.

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
        self.recorder = Recorder(self.history, self.scheduler)
        self.segments: dict[str, Any] = {}
        self.drives: dict[str, Any] = {}
        self.places: dict[str, tuple[str, int] | str] = {}
        """Where the drives on Modbus are: host and port, or device file."""
        self._networks: list[SocketNetwork] = []
        self._second_encoders: dict[str, Any] = {}
        self._groups: dict[str, Any] = {}
        self.released = False
        try:
            self._build(config, place, seed, record=record)
        except BaseException:
            self.close()
            raise
        for drive in self.drives.values():
            drive.power_on()

    def _build(
        self, config: BenchConfig, place: Mapping[str, Any] | None, seed: int, *, record: bool
    ) -> None:
        from fieldbus.can.live import LiveSegment
        from hil.bench.bench import named_rng
        from hil.bench.devices import build_device
        from hil.bench.drives import build_drive
        from hil.bench.encoder_config import encoder_names
        from hil.bench.encoders import build_encoder

        for name, section in config.segment.items():
            if section.on_modbus:
                continue
            self.segments[name] = LiveSegment.open(
                self.scheduler,
                **(section.opening_for_drives() if place is None else place),
                name=name,
                history=self.history,
                keep_log=record,
                # A drive goes on living when its bus is down, or nobody is there to acknowledge.
                lossy=True,
            )
        if not record:
            self.history.listen(lambda _event: self.history.events.clear())
        for name, drive_section in config.drive.items():
            if drive_section.device != "emulated":
                continue
            drive = build_drive(
                self.scheduler, self.segments, config, name, history=self.history, rng=named_rng(seed, name)
            )
            self.drives[name] = drive
            if config.segment[drive_section.segment].on_modbus:
                self.places[name] = self._serve(config, name, drive)
            if drive_section.encoder2.type != "none":
                self._second_encoders[f"{name}.encoder2"] = getattr(drive, "second_encoder", None)
        for name in encoder_names(config):
            self.drives[name] = build_encoder(
                self.scheduler, self.segments, config, name,
                drives=self.drives, history=self.history, rng=named_rng(seed, name),
            )  # fmt: skip
        if record:
            for name, device in self.drives.items():
                group = self.recorder.add_group(
                    name, device.trace_columns, device.trace_row, enums=device.trace_enums
                )
                self.scheduler.every(config.bench.cycle_ms * MS, group.sample)
                self._groups[name] = group
        for name in config.device:
            self.drives[name] = build_device(
                self.scheduler, self.segments, config, name, history=self.history
            )

    def _serve(self, config: BenchConfig, name: str, drive: Any) -> tuple[str, int] | str:
        """Put a drive on a TCP port or a pseudo-terminal of its own; returns where."""
        from hil.bench.modbus_config import address_of

        section = config.drive[name]
        segment = config.segment[section.segment]
        if segment.kind == "modbus_rtu":
            return str(drive.open_terminal(segment.serial_format()).path)
        from fieldbus.modbus import SocketNetwork

        network = SocketNetwork(self.scheduler)
        self._networks.append(network)
        drive.listen(network)
        return network.serve(*address_of(section, segment))

    def execute(self, command: Mapping[str, Any]) -> Any:
        """Carry out one command of the pipe; returns its result.

        Raises:
            RemoteError: Unknown command, drive or method.

        """
        call = command.get("call")
        if call == "fetch":
            return self._fetch()
        if call == "ready":
            self.scheduler.worst_lateness_ns = 0
            return None
        name = str(command.get("drive"))
        drive = self.drives.get(name) or self._second_encoders.get(name)
        if drive is not None and call in PARAMETER_METHODS and hasattr(drive, "parameters"):
            return self._parameters(drive.parameters, str(call), command.get("args", ()))
        if drive is None or call not in FAULT_METHODS | ENCODER_METHODS or not hasattr(drive, str(call)):
            raise RemoteError(f"unknown command {call!r} for drive {command.get('drive')!r}")
        return getattr(drive, str(call))(*command.get("args", ()), **command.get("kwargs", {}))

    @staticmethod
    def _parameters(parameters: Any, call: str, args: Any) -> Any:
        if call == "request_parameters":
            return parameters.request(bytes.fromhex(args[0])).hex()
        return getattr(parameters, call.removesuffix("_parameter"))(*args)

    def _fetch(self) -> dict[str, Any]:
        return {
            "groups": {
                name: {
                    "columns": group.columns,
                    "enums": {
                        column: {str(k): v for k, v in texts.items()} for column, texts in group.enums.items()
                    },
                    "content": base64.b64encode(group.content()).decode("ascii"),
                }
                for name, group in self._groups.items()
            },
            "events": self.history.events,
            "lateness_s": self.scheduler.worst_lateness_ns / S,
        }

    @property
    def booted(self) -> bool:
        """Whether all drives are past their boot-up."""
        nodes = [drive.slave for drive in self.drives.values() if hasattr(drive, "slave")]
        return all(node.nmt_state != NmtState.INITIALISING for node in nodes)

    def run_until(self, predicate: Callable[[], object], timeout_s: float) -> bool:
        """Run the drives until `predicate` is true or `timeout_s` has passed."""
        return self.scheduler.run_until(predicate, round(timeout_s * S))

    def release(self) -> None:
        """Let `run_until` return."""
        self.released = True

    def close(self) -> None:
        """Leave the buses."""
        for drive in self.drives.values():
            drive.power_off()
        for name in self.places:
            self.drives[name].close()
        for network in self._networks:
            network.close()
        for segment in self.segments.values():
            segment.close()


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
    """One process that holds emulated drives; it serves one bench after the other, because starting it takes seconds."""

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
        # Nobody is at the other end any more, killed perhaps: the drives leave the bus, whatever they are doing.
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
