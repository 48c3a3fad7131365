"""Emulated drives in real time, for a bench in another process or for somebody else's controller."""

from __future__ import annotations

import base64
from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any, Final

from fieldbus.canopen.nmt import NmtState
from fieldbus.clock import MS, RealtimeScheduler, S
from fieldbus.errors import HilError
from fieldbus.history import History
from hil.bench.config import BenchConfig
from hil.bench.devices import DEVICE_METHODS
from hil.bench.encoders import ENCODER_METHODS
from hil.record import Recorder

if TYPE_CHECKING:
    from fieldbus.modbus import SocketNetwork

FAULT_METHODS: Final = frozenset(
    (
        "raise_fault",
        "clear_fault_cause",
        "set_sto",
        "freeze_encoder",
        "jump_encoder",
        "suppress_index",
        "invert_input",
        "swap_limit_switches",
        "jam",
        "set_load_force",
        "set_added_friction",
        "slip_coupling",
        "break_coupling",
        "set_added_backlash",
        "force_input",
        "stop_heartbeat",
        "power_off",
        "power_on",
        "set_encoder_noise",
        "reverse_encoder",
        "lose_encoder_steps",
        "set_ss1",
        "set_ss2",
        "set_sos",
        "set_sbc",
        "set_sls",
        "set_sdi",
        "set_slp",
        "acknowledge_safety",
        "open_interlock",
        "delay_heartbeat",
        "disconnect_mains",
        "set_mains_voltage_share",
        "disconnect_phase",
        "set_dc_link_voltage",
        "restore_dc_link",
        "disable_chopper",
        "limit_torque",
        "set_brake_stuck",
        "set_brake_torque_share",
        "scale_ramps",
        "set_local_control",
        "refuse_transitions",
        "force_switch_on_disabled",
        "force_warning",
        "freeze_statusword",
        "override_statusword_bits",
        "toggle_target_reached",
        "override_mode_display",
        "reset_node",
        "abort_sdo",
        "suppress_sdo_responses",
        "repeat_emcy",
        "force_temperature",
        "set_encoder_drift",
        "set_encoder_scale",
        "break_encoder_wire",
        "set_encoder_error",
        "force_ready",
        "short_outputs",
        "restore_outputs",
        "disconnect_load_supply",
        "unplug_module",
        "report_encoder_error",
        "clear_encoder_error",
        "lose_steps",
        "set_clock_drift",
        "set_clock_jitter",
    )
)
"""Methods of a drive that may be called through the pipe."""


PARAMETER_METHODS: Final = frozenset(("read_parameter", "write_parameter", "request_parameters"))
"""What `RemoteParameters` sends through the pipe."""

_METHODS: Final = FAULT_METHODS | ENCODER_METHODS | DEVICE_METHODS


class RemoteError(HilError):
    """The drive process failed or does not answer."""


class DriveHost:
    """Emulated drives of a bench file on live buses, in real time; a virtual bench file is taken as a live
    one.

    Args:
        config: Validated bench file.
        place: Arguments of `LiveSegment.open` (`interface`, `channel`, options) that replace those of
            every segment; None keeps the bench file's. The drives of a segment with a bridge are on its far
            side.
        origin_ns: Value of the monotonic clock that is time zero; None: now.
        seed: Seed of the drives' random streams.
        record: Whether frames, signals and events are kept for `execute("fetch")`. Without a record the
            host may run for weeks; `history` then tells its listeners and forgets.

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
        live = config.model_copy(update={"bench": config.bench.model_copy(update={"kind": "live"})})
        try:
            self._build(live, place, seed, record=record)
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
                self.scheduler,
                self.segments,
                config,
                name,
                drives=self.drives,
                history=self.history,
                rng=named_rng(seed, name),
            )
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
