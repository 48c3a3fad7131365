"""The bench: wires what the bench file describes, and runs it in virtual or in real time.

Both kinds share everything but the medium and the place of the drives: a virtual bench holds the emulated
drives itself; on a live bench they run in a process of their own (`hil.bench.remote`), or are somebody's
hardware.
"""

from __future__ import annotations

import gc
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING, Any, Final, Self

from numpy.random import Generator, SeedSequence, default_rng

from fieldbus.canopen.boot import BootFailure
from fieldbus.canopen.master import CanopenMaster
from fieldbus.clock import MS, RealtimeScheduler, S, Scheduler, VirtualScheduler, seconds_to_ns
from fieldbus.errors import BusError, HilError
from fieldbus.history import History
from hil.bench._load import LOAD_COLUMNS, LoadMeter
from hil.bench._parts import MASTER_NODE, BenchParts
from hil.bench._ports import build_can_port, build_modbus_port
from hil.bench._startup import BOOT_TIMEOUT_NS, BenchNotReadyError, commission, missing
from hil.bench._supply import ControllerBuses
from hil.bench.axis_config import (
    encoders_of_axis,
    from_drive,
    from_encoder,
    from_second_encoder,
    second_of,
)
from hil.bench.config import BenchConfig
from hil.bench.io_devices import axis_inputs, build_analog_port, wired_variables
from hil.bench.vocabulary import bench_vocabulary
from hil.record import Recorder, Trace, Vocabulary
from motion.drives.port import SWITCHES
from motion.s7.axis import ExternalEncoder, PositioningAxis, SpeedAxis, SynchronousAxis, TechnologyAxis
from motion.s7.handles import AxisHandle, EncoderHandle
from motion.s7.runtime import Runtime

if TYPE_CHECKING:
    from hil.bench._ports import Port
    from hil.bench.config import ExternalEncoderSection
    from hil.bench.encoders import EncoderNodes
    from hil.bench.remote import RemoteDrives
    from hil.bench.telegram_master import TelegramMaster
    from hil.bench.words import BenchWords
    from motion.drives.encoder import EncoderPort
    from motion.drives.station import StationLink
    from motion.s7.controller import Controller

_AXES: Final = {"positioning": PositioningAxis, "speed": SpeedAxis, "synchronous": SynchronousAxis}
_SAMPLE_PRIORITY: Final = 100
_GC_THRESHOLD: Final = 100_000
_LINK_TIMEOUT_NS: Final = 5 * S


def named_rng(seed: int, name: str) -> Generator:
    """Return the random stream of component `name` in a run with `seed`."""
    return default_rng(SeedSequence([seed & 0xFFFFFFFFFFFFFFFF, *name.encode()]))


class Bench(BenchParts):
    """A wired bench. Use it as a context manager, or call `close`.

    Args:
        config: Validated bench file.
        seed: Seed of every random stream of this bench.

    Raises:
        BenchNotReadyError: A drive did not come up, or is another one than the bench file says.
        CommissioningError: A drive refuses a parameter.
        ConfigurationError: A variable of an axis does not exist or is out of range.

    """

    def __init__(self, config: BenchConfig, *, seed: int = 0) -> None:
        self.config = config
        self.seed = seed
        self.kind = config.bench.kind
        self.cycle_ns = config.bench.cycle_ms * MS
        self.interpolator_ns = (config.bench.interpolator_ms or config.bench.cycle_ms) * MS
        self.scheduler: Scheduler = VirtualScheduler() if self.kind == "virtual" else RealtimeScheduler()
        self.history = History(self.scheduler)
        self.recorder = Recorder(self.history, self.scheduler)
        self.runtime = Runtime(
            self.scheduler,
            cycle_ns=self.cycle_ns,
            interpolator_ns=self.interpolator_ns,
            history=self.history,
            program_cycles=config.bench.program_cycles,
        )
        self._segments: dict[str, Any] = {}
        self._masters: dict[str, CanopenMaster] = {}
        self._drives: dict[str, Any] = {}
        self._encoders: dict[str, Any] = {}
        self._second_encoders: dict[str, Any] = {}
        self._devices: dict[str, Any] = {}
        self._stations: dict[str, Any] = {}
        self._links: dict[str, StationLink] = {}
        self._encoder_nodes: EncoderNodes | None = None
        self._encoder_ports: dict[str, EncoderPort] = {}
        self._external_encoders: dict[str, EncoderHandle] = {}
        self._ports: dict[str, Port] = {}
        self._axes: dict[str, AxisHandle] = {}
        self._telegrams: dict[str, TelegramMaster] = {}
        self._cycle_callbacks: list[Callable[[], object]] = []
        self._remote: RemoteDrives | None = None
        self._words: dict[str | None, BenchWords] = {}
        self._closed = False
        # What a bench allocates lives as long as it does: frames, events, samples. Looking through all of it
        # for cycles again and again costs a tenth of the cyclic path and finds nothing.
        self._gc_threshold = gc.get_threshold()
        gc.set_threshold(max(_GC_THRESHOLD, self._gc_threshold[0]), *self._gc_threshold[1:])
        try:
            self._build()
            self._start()
        except BaseException:
            self.close()
            raise

    # -- construction
    # -----------------------------------------------------------------------------------------

    def _build(self) -> None:
        config = self.config
        for name in config.segment:
            self._build_segment(name)
        if self.kind == "virtual":
            from hil.bench.drives import build_drive

            for name in config.drive:
                drive = build_drive(
                    self.scheduler, self._segments, config, name, history=self.history, rng=self.rng(name)
                )
                self._drives[name] = drive
                self._record(name, drive)
                segment = config.drive[name].segment
                if config.segment[segment].on_modbus and config.drive[name].profile != "analog":
                    self._segments[segment].attach(name, drive)
                if config.drive[name].encoder2.type != "none":
                    self._second_encoders[f"{name}.encoder2"] = getattr(drive, "second_encoder", None)
            for name in config.station:
                self._build_station(name)
        elif config.emulated_names:
            from hil.bench.encoders import ENCODER_METHODS
            from hil.bench.remote import RemoteDrives

            self._remote = RemoteDrives(self, config)
            for name, drive_section in config.drive.items():
                if drive_section.device == "emulated":
                    self._drives[name] = self._remote.proxy(name)
                    if drive_section.encoder2.type != "none":
                        second = f"{name}.encoder2"
                        self._second_encoders[second] = self._remote.proxy(second, ENCODER_METHODS)
        if self.kind == "live":
            self._connect_modbus()
        if config.encoder:
            self._build_encoders()
        self._build_devices()
        for name, drive_section in config.drive.items():
            for side in ("negative", "positive"):
                stop_mm = getattr(drive_section.mechanics, f"{side}_stop_mm")
                if drive_section.device == "emulated" and stop_mm is not None:
                    self.recorder.set_constant(f"{name}.{side}_stop", stop_mm / 1000.0)
        for name, axis_section in config.axis.items():
            self._build_axis(name, axis_section)
        for name, encoder_section in config.external_encoder.items():
            self._build_external_encoder(name, encoder_section)
        for link in self._links.values():
            self.runtime.after_cycle.append(link.exchange)
        for name, segment_section in config.segment.items():
            if segment_section.on_modbus and self._segments[name].columns:
                place = self._segments[name]
                group = self.recorder.add_group(name, place.columns, place.row)
                self.runtime.after_cycle.append(group.sample)
        self.runtime.after_cycle.append(self._after_cycle)

    def _connect_modbus(self) -> None:
        """Lead the drives on live Modbus where they are: at their place, or where their process says."""
        from hil.bench.modbus_config import address_of

        places = {} if self._remote is None else self._remote.places
        for name, drive in self.config.drive.items():
            section = self.config.segment[drive.segment]
            if not section.on_modbus:
                continue
            segment = self._segments[drive.segment]
            try:
                if section.kind == "modbus_rtu":
                    segment.open(name, places.get(name, section.path))
                else:
                    segment.connect(name, *places.get(name, address_of(drive, section)))
            except BusError as error:
                raise BenchNotReadyError(str(error)) from error

    def _build_segment(self, name: str) -> None:
        section = self.config.segment[name]
        if section.on_modbus:
            from hil.bench.modbus_links import ModbusSegment

            self._segments[name] = segment = ModbusSegment(
                self.scheduler, name, section, cycle_ns=self.cycle_ns
            )
            self.recorder.add_bus(name, lambda: segment.log)
            return
        if self.kind == "virtual":
            from fieldbus.can import CanMedium

            can: Any = CanMedium(self.scheduler, bitrate=section.bitrate, name=name, history=self.history)
        else:
            from fieldbus.can.live import LiveSegment

            try:
                can = LiveSegment.open(self.scheduler, name=name, history=self.history, **section.opening())
            except BusError as error:
                raise BenchNotReadyError(str(error)) from error
            can.bitrate = section.bitrate
        self._segments[name] = can
        self.recorder.add_bus(name, can.log)
        meter = LoadMeter(can, bitrate=section.bitrate, cycle_ns=self.cycle_ns)
        load = self.recorder.add_group(name, LOAD_COLUMNS, meter.row)
        self.runtime.after_cycle.append(load.sample)
        self._masters[name] = CanopenMaster(
            self.scheduler, can, name="controller", node_id=MASTER_NODE, history=self.history
        )

    def _record(self, name: str, device: Any) -> None:
        """Record a device whatever its state on the bus, after the events of the instant."""
        group = self.recorder.add_group(
            name, device.trace_columns, device.trace_row, enums=device.trace_enums
        )
        self.scheduler.every(self.cycle_ns, group.sample, priority=_SAMPLE_PRIORITY)

    def _build_encoders(self) -> None:
        from hil.bench.encoder_config import encoder_names
        from hil.bench.encoders import (
            ENCODER_METHODS,
            EncoderNodes,
            build_encoder,
            build_encoder_ports,
            used_encoders,
        )

        for name in encoder_names(self.config):
            if self._remote is not None:
                self._encoders[name] = self._remote.proxy(name, ENCODER_METHODS)
                continue
            encoder = build_encoder(
                self.scheduler,
                self._segments,
                self.config,
                name,
                drives=self._drives,
                history=self.history,
                rng=self.rng(name),
            )
            self._encoders[name] = encoder
            self._record(name, encoder)
        cia406 = build_encoder_ports(self._masters, self.config, self.history)
        self._encoder_ports = dict(cia406)
        self._encoder_nodes = EncoderNodes(self._masters, self.config, cia406, self.history)
        used = used_encoders(self.config)
        for name, port in self._encoder_nodes.ports.items():
            if name in used:
                self._encoder_ports[name] = port  # its technology object reads it
            else:
                self.runtime.after_cycle.append(port.read)

    def _build_devices(self) -> None:
        from hil.bench.devices import DEVICE_METHODS, build_device

        for name in self.config.device:
            if self._remote is not None:
                self._devices[name] = self._remote.proxy(name, DEVICE_METHODS)
            else:
                self._devices[name] = build_device(
                    self.scheduler, self._segments, self.config, name, history=self.history
                )

    def _build_station(self, name: str) -> None:
        from hil.bench.io_devices import build_link, build_station

        wired = build_station(
            self.scheduler, self.config, name, drives=self._drives, history=self.history, rng=self.rng(name)
        )
        segment = self._segments[self.config.station[name].segment]
        segment.attach(name, wired)
        self._stations[name] = wired.station
        self._record(name, wired.station)
        if self.config.axis:
            self._links[name] = build_link(self.config, name, wired.station, segment, history=self.history)

    def _build_axis(self, name: str, section: Any) -> None:
        port = self._build_port(section.drive)
        kind = _AXES[section.type]
        drive = self.config.drive[section.drive]
        variables = from_drive(drive)
        encoders: list[EncoderPort | Port] | None = None
        named = encoders_of_axis(section, drive, self.config.bench.cpu)
        if named is not None:
            encoders = []
            for number, one in enumerate(named, start=1):
                if one == section.drive:
                    encoders.append(port)
                elif one == second_of(section.drive):
                    from motion.drives.profidrive_second import SecondEncoderPort

                    second = drive.encoder2
                    absolute = not second.type.startswith("incremental")
                    encoders.append(SecondEncoderPort(port, absolute_encoder=absolute))  # type: ignore[arg-type]  # as above
                    variables |= from_second_encoder(second, f"Sensor[{number}]")
                else:
                    encoders.append(self._encoder_ports[one])
                    variables |= from_encoder(self.config.encoder[one], f"Sensor[{number}]")
        if section.connection == "data_block":
            port.connect_block()  # type: ignore[union-attr]  # checked with the bench file
        variables |= {**wired_variables(self.config, name), **section.variables}
        axis: TechnologyAxis = kind(
            name,
            port,
            cycle_ns=self.cycle_ns,
            interpolator_ns=self.interpolator_ns,
            variables=variables,
            delay_s=port.delay_ns / S,
            history=self.history,
            encoders=encoders,
            connection=section.connection,
            cpu=self.config.bench.cpu,
            ramp_times=section.ramp_times,
        )
        axis.station_inputs = axis_inputs(self.config, name, self._links)
        axis.inputs_in_servo = section.inputs_update == "servo"
        axis.homing_input = SWITCHES[section.homing_input]
        on_motor = encoders is None and axis.has_position and variables.get("Sensor[1].System", 1) == 1
        self.history.emit(
            name,
            "axis.wired",
            drive=section.drive,
            homing_input=section.homing_input,
            zero_mark_pitch=60.0 / axis.mechanics.rpm_per_unit if on_motor else 0.0,
        )
        axis.enabling.timeout_s = section.enable_timeout_s
        self.runtime.add(axis)
        self._ports[section.drive] = port
        self._axes[name] = AxisHandle(self.runtime, axis)
        group = self.recorder.add_group(name, axis.trace_columns, axis.trace_row, enums=axis.trace_enums)
        self.runtime.after_cycle.append(group.sample)

        def read(path: str) -> float:
            return float(axis.variables.bind(path).value)

        constants = {
            "cycle_s": self.cycle_ns / S,
            "max_velocity": read("DynamicLimits.MaxVelocity"),
            "max_acceleration": read("DynamicLimits.MaxAcceleration"),
            "max_deceleration": read("DynamicLimits.MaxDeceleration"),
            "max_jerk": read("DynamicLimits.MaxJerk"),
            "emergency_deceleration": read("DynamicDefaults.EmergencyDeceleration"),
            "deceleration": read("DynamicDefaults.Deceleration"),
            "jerk": read("DynamicDefaults.Jerk"),
            "unit_per_rpm": 1.0 / axis.mechanics.rpm_per_unit,
        }
        if self.interpolator_ns != self.cycle_ns:
            constants["interpolator_s"] = self.interpolator_ns / S
        for key, value in constants.items():
            self.recorder.set_constant(f"{name}.{key}", value)

    def _build_external_encoder(self, name: str, section: ExternalEncoderSection) -> None:
        variables = from_encoder(self.config.encoder[section.encoder], "Sensor")
        variables.pop("Sensor.MountingMode", None)
        encoder = ExternalEncoder(
            name,
            self._encoder_ports[section.encoder],
            cycle_ns=self.cycle_ns,
            variables={**variables, **section.variables},
            history=self.history,
        )
        if section.drive is not None:
            drive, mask = section.drive, SWITCHES[section.homing_input]
            encoder.digital_input = lambda: self._ports[drive].inputs & mask != 0
        self.runtime.add_encoder(encoder)
        self._external_encoders[name] = EncoderHandle(self.runtime, encoder)
        group = self.recorder.add_group(
            name, encoder.trace_columns, encoder.trace_row, enums=encoder.trace_enums
        )
        self.runtime.after_cycle.append(group.sample)

    def telegram(self, name: str | None = None) -> TelegramMaster:
        """Return the master of a PROFIdrive drive without an axis: the test leads it by the words of its
        telegram.

        The first call takes the drive into service and waits until it answers; not inside of a callback.

        Args:
            name: The drive; None: the first one.

        Raises:
            ConfigurationError: There is no such drive, it has an axis, or it is none with a telegram.
            BlockedError: Somebody else is the controller on its segment.
            BenchNotReadyError: The drive did not come up.

        """
        from hil.bench.telegram_master import lead

        wanted = name or next(iter(self.config.drive), "")
        if wanted not in self._telegrams:
            self._telegrams[wanted] = lead(self, wanted)
        return self._telegrams[wanted]

    def lead_drive(self, name: str) -> tuple[Any, CanopenMaster | None]:
        """Return a new port to a drive without an axis, and the CANopen services on its segment if it is on
        CAN.
        """
        port = self._build_port(name)
        self._ports[name] = port
        return port, self._masters.get(self.config.drive[name].segment)

    def _build_port(self, name: str) -> Port:
        """Return the controller's port to a drive, as its profile and its bus want it."""
        place = self.config.drive[name].segment
        if self.config.drive[name].profile == "analog":
            return build_analog_port(self.config, name, self._links, history=self.history)
        if place in self._masters:
            return build_can_port(self.config, name, self._masters[place], history=self.history)
        return build_modbus_port(
            self.config, name, self._segments[place], self.scheduler, history=self.history
        )

    # -- start
    # ------------------------------------------------------------------------------------------------

    def _start(self) -> None:
        """Power the drives, commission them and wait for the cyclic link."""
        if self.kind == "virtual":
            for device in (*self._drives.values(), *self._encoders.values(), *self._devices.values()):
                device.power_on()
        commission(self.scheduler, self._ports.values(), self._encoder_nodes)
        buses = ControllerBuses(self.config, self._masters, self._ports, self._links, cycle_ns=self.cycle_ns)
        buses.connect(self.controller)
        buses.lead()
        if self.config.bench.memory_card is not None:
            self.runtime.insert_card(Path(self.config.bench.memory_card))
        self.runtime.start()
        if self._encoder_nodes is not None:
            self._start_encoders(self._encoder_nodes)
        if not self.scheduler.run_until(self._linked, _LINK_TIMEOUT_NS):
            missing = [name for name, port in self._ports.items() if not port.link_ok and not port.optional]
            raise BenchNotReadyError(
                f"no cyclic data from {', '.join(missing)} within {_LINK_TIMEOUT_NS // S} s"
            )

    def _start_encoders(self, encoders: EncoderNodes) -> None:
        try:
            encoders.check()
        except BootFailure as failure:
            raise BenchNotReadyError(str(failure)) from None
        if not self.scheduler.run_until(lambda: not encoders.missing, BOOT_TIMEOUT_NS):
            raise BenchNotReadyError(
                f"no heartbeat in Operational from {', '.join(encoders.missing)} within "
                f"{BOOT_TIMEOUT_NS // S} s"
            )

    @property
    def controller(self) -> Controller:
        """The controller as a CPU: operating states, what it keeps, diagnostics buffer."""
        return self.runtime.controller

    @property
    def lateness_s(self) -> float:
        """Greatest delay of an event behind its time since the bench was ready, in all its processes, s.

        0.0 in virtual time. The share of the drive process is as of the last `trace`.
        """
        if not isinstance(self.scheduler, RealtimeScheduler):
            return 0.0
        remote = self._remote.lateness_s if self._remote is not None else 0.0
        return max(self.scheduler.worst_lateness_ns / S, remote)

    @property
    def allowed_lateness_s(self) -> float:
        """Lateness up to which measured times and distances mean something, s: `[tolerance]` of the bench
        file.
        """
        section = self.config.tolerance
        return section.time_s if section.lateness_s is None else section.lateness_s

    def _linked(self) -> bool:
        return all(
            (handle.communication_ok and handle.sensor_valid)
            or missing(self._ports[self.drive_of(name)])
            or self._programmed(handle)
            for name, handle in self._axes.items()
        )

    def _programmed(self, handle: AxisHandle) -> bool:
        """Say whether the telegram of an axis arrives and it is up to a program to let the axis see it."""
        return handle.object.connection == "data_block" and handle.object.drive_port.link_ok

    def _after_cycle(self) -> None:
        for callback in self._cycle_callbacks:
            callback()

    # -- time
    # -------------------------------------------------------------------------------------------------

    def on_cycle(self, callback: Callable[[], object]) -> Callable[[], None]:
        """Call `callback` at the end of every application cycle; returns the function that ends it."""
        # A new list each time, so that a callback may withdraw itself while the list is walked.
        self._cycle_callbacks = [*self._cycle_callbacks, callback]

        def remove() -> None:
            self._cycle_callbacks = [one for one in self._cycle_callbacks if one is not callback]

        return remove

    def run_for(self, seconds: float) -> None:
        """Let `seconds` of bench time pass."""
        self.scheduler.run_for(seconds_to_ns(seconds))

    def run_until(self, predicate: Callable[[], object], timeout: float) -> bool:
        """Run until `predicate` is true or `timeout` seconds have passed; returns whether it became true."""
        return self.scheduler.run_until(predicate, seconds_to_ns(timeout))

    @property
    def now_s(self) -> float:
        """Present bench time, s."""
        return self.scheduler.now / S

    def rng(self, name: str) -> Generator:
        """Return the seeded random stream of component `name`; the same name gives the same stream."""
        return named_rng(self.seed, name)

    # -- evidence
    # ---------------------------------------------------------------------------------------------

    @property
    def vocabulary(self) -> Vocabulary:
        """What its recording can hold: names of components and jobs, states, alarms."""
        return bench_vocabulary(self)

    def trace(self) -> Trace:
        """Return everything recorded so far; on a live bench the drives' own records are fetched."""
        trace = self.recorder.trace(self.vocabulary)
        remote = self._remote
        if remote is None:
            return trace
        remote.fetch()
        return Trace(
            [*trace.groups, *remote.groups.values()],
            events=sorted([*trace.events, *remote.events], key=lambda event: event.time_ns),
            frames={bus: trace.raw_frames(bus) for bus in trace.buses},
            constants=trace.constants,
            end_ns=trace.end_ns,
            vocabulary=trace.vocabulary,
        )

    def close(self) -> None:
        """Release buses, threads and processes; harmless when called again."""
        if self._closed:
            return
        self._closed = True
        gc.set_threshold(*self._gc_threshold)
        self.runtime.stop()
        try:
            if self.kind == "live":
                self.release_drives()
        finally:
            self._let_go()

    def _let_go(self) -> None:
        """Stop what is still sending, and give processes and buses back."""
        for port in self._ports.values():
            close = getattr(port, "close", None)
            if close is not None:
                close()
        for master in self._masters.values():
            with suppress(HilError):  # a bus that is down takes no last frames
                master.close()
        if self._remote is not None:
            self._remote.close()
        for segment in self._segments.values():
            close = getattr(segment, "close", None)
            if close is not None:
                close()

    def release_drives(self) -> None:
        """Stop the controller and disable every drive that it leads; two cycles of SYNC make it act."""
        self.runtime.stop()
        leading = [port for port in self._ports.values() if port.link_ok]
        for port in leading:
            port.release()
        if leading:
            self.scheduler.run_for(2 * self.cycle_ns)

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()
