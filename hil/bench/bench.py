"""The bench: what a bench file describes, wired, in virtual or in real time.

Both kinds share everything but the medium and the place of the emulated devices: a bench in
virtual time holds them itself; on a live bench they run in a process of their own
(`hil.bench.remote`), or are real hardware.
"""

from __future__ import annotations

import gc
from collections.abc import Callable, Mapping
from collections.abc import Set as AbstractSet
from contextlib import ExitStack
from types import TracebackType
from typing import TYPE_CHECKING, Any, Final, Literal, Self, overload

from fieldbus.clock import MS, RealtimeScheduler, S, Scheduler, VirtualScheduler
from fieldbus.errors import ConfigurationError, UnknownAttributeError
from fieldbus.history import History
from hil.bench.control import ControlSystem
from hil.bench.emulated import DeviceBuilder, EmulatedDevices, named_rng
from hil.bench.frame_texts import FrameTexts
from hil.bench.judged_numbers import numbers_of_drive
from hil.bench.names import cob_ids, component_names, named, nodes_on
from hil.bench.numbers import axis_numbers
from hil.bench.outputs import outputs_of
from hil.bench.segments import Segments
from hil.bench.vocabulary import bench_vocabulary
from hil.bench.waiting import UnmetWait, check_condition, checked_ns
from hil.errors import ExpectationFailedError, UnsupportedFaultError, name_the
from hil.record import STORE_EVERY_NS, Recorder, Trace, Vocabulary
from motion.s7.call_log import CallLog
from motion.s7.runtime import Runtime

if TYPE_CHECKING:
    from numpy.random import Generator

    from emulators.io import ModbusIoStation
    from fieldbus.can.frame import CanFrame
    from fieldbus.canopen.master import CanopenMaster
    from fieldbus.canopen.node import RemoteNode
    from fieldbus.modbus import ModbusFrame
    from fieldbus.node_clock import NodeClock
    from hil.bench.config import BenchConfig
    from hil.bench.drive_ports import DrivePorts, Port
    from hil.bench.modbus_links import ModbusDevice
    from hil.bench.remote import RemoteDevices
    from hil.bench.segments import Segment
    from hil.bench.telegram_master import TelegramMaster
    from hil.expect.golden import ReferenceAxis
    from hil.protocols import Device, Drive, Encoder
    from motion.drives.profidrive_encoder import ProfidriveEncoderPort
    from motion.drives.station import StationLink
    from motion.nc.handles import NcAxisHandle
    from motion.nc.tasks import NcRuntime
    from motion.s7.cam_handle import CamHandle
    from motion.s7.controller import Controller
    from motion.s7.handles import AxisHandle, EncoderHandle, MeasuringInputHandle, ProxyHandle

_GC_THRESHOLD: Final = 100_000
_INJECTOR: Final = 'faults.inject("drive.fault", ...): `faults` is a fixture, else hil.Injector(bench)'
_INSTEAD: Final = {
    "axes": 'bench.axis("x"), with a name of bench.axis_names',
    "cams": 'bench.cam("profile"), with a name of bench.cam_names',
    "drives": 'bench.drive("x_drive"), with a name of bench.drive_names',
    "encoders": 'bench.encoder("scale"), with a name of bench.encoder_names',
    "devices": 'bench.device("box"), with a name of bench.device_names',
    "stations": 'bench.station("io"), with a name of bench.station_names',
    "segments": 'bench.segment("can0"), with a name of bench.segment_names',
    "networks": 'bench.network("can0"), with a name of bench.network_names',
    "nodes": 'bench.node("x_drive")',
    "inject": _INJECTOR,
    "faults": _INJECTOR,
    "injector": _INJECTOR,
    "check": "trace.check(alarm(421)): `trace` is a fixture, else hil.CurrentTrace(bench)",
    "run": "bench.run_for(0.5)",
    "sleep": "bench.run_for(0.5)",
    "step": "bench.run_for(0.5)",
    "wait": 'bench.run_for(0.5), or bench.wait_until(job.done, 5.0, "homing")',
    "wait_for": 'bench.wait_until(job.done, 5.0, "homing")',
    "time": "bench.now_s",
    "time_s": "bench.now_s",
    "now": "bench.now_s",
    "events": "bench.trace().events",
    "signal": 'bench.trace()["x.actual_position"]',
}
"""What is meant by names that a bench does not have."""


class Bench:
    """A wired bench. Use it as a context manager, or call `close`.

    Args:
        config: Validated bench file.
        seed: Seed of every random stream of this bench.

    Raises:
        BlockedError: A bus cannot be opened, or a drive did not come up, or is another one than the bench
            file says.
        CommissioningError: A drive refuses a parameter.
        ConfigurationError: A variable of an axis does not exist or is out of range.

    """

    def __init__(self, config: BenchConfig, *, seed: int = 0) -> None:
        self.config = config
        self.seed = seed
        self.kind = config.bench.kind
        self.cycle_ns = config.bench.cycle_ms * MS
        """Bus cycle and cycle of `MC_Servo`, ns."""
        self.interpolator_ns = (config.bench.interpolator_ms or config.bench.cycle_ms) * MS
        """Cycle of `MC_Interpolator`, ns."""
        self.scheduler: Scheduler = VirtualScheduler() if self.kind == "virtual" else RealtimeScheduler()
        self.history = History(self.scheduler)
        """Event log."""
        self.recorder = Recorder(self.history, self.scheduler, memory_mb=config.bench.recording_memory_mb)
        self.runtime = Runtime(
            self.scheduler,
            cycle_ns=self.cycle_ns,
            interpolator_ns=self.interpolator_ns,
            history=self.history,
            program_cycles=config.bench.program_cycles,
        )
        """Cycle of the controller."""
        self._cycle_callbacks: list[Callable[[], object]] = []
        self._telegrams: dict[str, TelegramMaster] = {}
        self._remote: RemoteDevices | None = None
        self._unmet: UnmetWait | None = None
        with ExitStack() as stack:
            self._keep_garbage(stack)
            self._segments = Segments(config, self.scheduler, self.history)
            stack.callback(self._segments.close)
            self._segments.record_frames(self.recorder, self.runtime.records)
            self._devices = self._find_devices(stack)
            stack.callback(self._segments.leave)
            self._note_numbers()
            self._control = ControlSystem(
                config,
                self.runtime,
                self._segments,
                history=self.history,
                recorder=self.recorder,
                rng=self.rng,
            )
            stack.callback(self._control.ports.close)
            if self.kind == "live":
                stack.callback(self._control.release_drives)
            stack.callback(self.runtime.stop)
            for other in self._control.others.values():
                stack.callback(other.stop)
            if self._control.nc is not None:
                stack.callback(self._control.nc.stop)
            self._segments.record_requests(self.recorder, self.runtime.after_cycle)
            self._listed = bool(self.runtime.after_cycle)
            if self._listed:
                self.runtime.after_cycle.append(self._after_cycle)
            self._texts = FrameTexts(config, self._segments, self._control.ports, self.recorder.frames)
            if isinstance(self._devices, EmulatedDevices):
                self._devices.power_on()
            self._control.start()
            if self.kind == "live":
                # A step of it is far shorter than a cycle; all at once would hold up the axes.
                self.scheduler.every(STORE_EVERY_NS, self.recorder.store_a_little)
            self._closing = stack.pop_all()

    @staticmethod
    def _keep_garbage(stack: ExitStack) -> None:
        """Look for reference cycles less often until the bench is closed.

        What a bench allocates lives as long as it does: frames, events, samples. Looking through all of it
        again and again costs a tenth of the cyclic path and finds nothing.
        """
        before = gc.get_threshold()
        gc.set_threshold(max(_GC_THRESHOLD, before[0]), *before[1:])
        stack.callback(gc.set_threshold, *before)

    def _find_devices(self, stack: ExitStack) -> EmulatedDevices | RemoteDevices:
        """Return the emulated devices: those of this process, still switched off,
        or those of the drive process.
        """
        config, scheduler = self.config, self.scheduler
        if not isinstance(scheduler, RealtimeScheduler):
            builder = DeviceBuilder(
                config, scheduler, history=self.history, recorder=self.recorder, seed=self.seed
            )
            built = builder.build(self._segments.can, self._attach)
            self._segments.limit_to_classic()
            return built
        devices: EmulatedDevices | RemoteDevices = EmulatedDevices()
        if config.emulated_names:
            from hil.bench.remote import RemoteDevices

            devices = self._remote = RemoteDevices(config, scheduler, seed=self.seed)
            stack.callback(self._remote.close)
        self._segments.connect_drives({} if self._remote is None else self._remote.places)
        return devices

    def _attach(self, segment: str, name: str, device: ModbusDevice) -> None:
        self._segments.modbus[segment].attach(name, device)

    def _note_numbers(self) -> None:
        """Note the numbers of the drives, for judges of the trace, and whether time is real."""
        if self.kind == "live":
            self.recorder.set_constant("bench.live", 1.0)
        for bus, segment in self._segments.can.items():
            if segment.bitrate is not None:
                self.recorder.set_constant(f"{bus}.bitrate", segment.bitrate)
        for name, section in self.config.drive.items():
            for key, value in numbers_of_drive(section, self.config.bench).items():
                self.recorder.set_constant(f"{name}.{key}", value)

    # -- parts ----------------------------------------------------------------------------------------------

    @overload
    def axis(self, name: str | None = None) -> AxisHandle: ...

    @overload
    def axis(self, name: str | None = None, *, controller: Literal["nc"]) -> NcAxisHandle: ...

    def axis(self, name: str | None = None, *, controller: str | None = None) -> Any:
        """Return an axis by name, or the first one: an `AxisHandle`, or an `NcAxisHandle` where the bench
        file says `controller = "nc"`.

        Args:
            name: The axis; None: the first one.
            controller: `nc`: it has to be an axis of an NC, which typed code thereby knows; None: any.

        Raises:
            ConfigurationError: There is no such axis.

        """
        control = self._control
        if controller == "nc":
            return named("axis of an NC", control.nc_axes, name)
        if not control.nc_axes:
            return named("axis", control.axes, name)
        found = {**control.axes, **control.nc_axes}
        return named("axis", {one: found[one] for one in self.config.axis}, name)

    @property
    def nc(self) -> NcRuntime:
        """The NC: its tasks and its PLC program.

        Raises:
            ConfigurationError: The bench has no axis of one.

        """
        if self._control.nc is None:
            raise ConfigurationError("bench", "nc", 'an axis with controller = "nc"; this bench has none')
        return self._control.nc

    def golden(self, axis: str | None = None) -> ReferenceAxis:
        """Return the golden numbers of an axis by name, or of the first one.

        Its ramps follow from the bench file by formula, for example
        `bench.golden("z").emergency(60.0)` from 60 mm/s.

        Raises:
            ConfigurationError: There is no such axis, or its drive has no
                ramps of its own.

        """
        return axis_numbers(self.config, self.axis(axis), self.cycle_ns)

    def external_encoder(self, name: str | None = None) -> EncoderHandle:
        """Return an external encoder (technology object) by name, or the first one."""
        return named("external encoder", self._control.external_encoders, name)

    def cam(self, name: str | None = None) -> CamHandle:
        """Return a cam by name, or the first one: `bench.run_until(bench.cam("knife").interpolate().done,
        1.0)`.

        Raises:
            ConfigurationError: There is no such cam.

        """
        return named("cam", self._control.cams, name)

    def measuring_input(self, name: str | None = None) -> MeasuringInputHandle:
        """Return a measuring input by name, or the first one:
        `bench.run_until(bench.measuring_input("mark").measure().done, 1.0)`.

        Raises:
            ConfigurationError: There is no such measuring input.

        """
        return named("measuring input", self._control.measuring_inputs, name)

    def proxy(self, name: str | None = None) -> ProxyHandle:
        """Return a leading-axis proxy by name, or the first one; `.link` is the way of its telegrams, which a
        test may lose (`link.lost`), delay (`link.delay_ns`) and change (`link.disturb`).

        Raises:
            ConfigurationError: There is no such proxy.

        """
        return named("proxy", self._control.proxies, name)

    def drive(self, name: str | None = None) -> Drive:
        """Return an emulated drive by name, or the first one.

        On a bench in virtual time it is the drive itself, `emulators.drive.cia402.CiA402Drive` for example;
        on a live bench it stands for the one in the drive process, and has the methods of the faults only.

        Raises:
            ConfigurationError: There is no such drive.
            UnsupportedFaultError: The drive is physical and has no fault interface (verdict: blocked).

        """
        wanted = name or next(iter(self.config.drive), None)
        section = None if wanted is None else self.config.drive.get(wanted)
        if section is not None and section.device == "physical":
            raise UnsupportedFaultError(f"{wanted} is a physical drive: it offers no fault interface")
        drives: Mapping[str, Drive] = self._devices.drives
        return named("drive", drives, name)

    def encoder(self, name: str | None = None) -> Encoder:
        """Return an emulated encoder with a node of its own by name, or the first one.

        `drive1.encoder2` is the second encoder of a drive. What is returned is as of `drive`.

        Raises:
            ConfigurationError: There is no such encoder.
            UnsupportedFaultError: The encoder is physical and has no fault interface (verdict: blocked).

        """
        second: Mapping[str, Encoder] = self._devices.second_encoders
        if name is not None and name in second:
            return second[name]
        wanted = name or next(iter(self.config.encoder), None)
        section = None if wanted is None else self.config.encoder.get(wanted)
        if section is not None and section.device == "physical":
            raise UnsupportedFaultError(f"{wanted} is a physical encoder: it offers no fault interface")
        encoders: Mapping[str, Encoder] = self._devices.encoders
        return named("encoder", encoders, name)

    def encoder_port(self, name: str | None = None) -> ProfidriveEncoderPort:
        """Return the controller's port to a PROFIdrive encoder with a node of its
        own by name, or the first one.

        Raises:
            ConfigurationError: There is no such encoder that the bench leads.

        """
        nodes = self._control.encoder_nodes
        return named("PROFIdrive encoder", {} if nodes is None else nodes.ports, name)

    def device(self, name: str | None = None) -> Device:
        """Return an emulated device that is made of its EDS alone by name, or the first one.

        Raises:
            ConfigurationError: There is no such device.

        """
        devices: Mapping[str, Device] = self._devices.devices
        return named("device", devices, name)

    def station(self, name: str | None = None) -> ModbusIoStation:
        """Return an emulated I/O station by name, or the first one:
        `bench.station("io").input(3)` is a channel. On a live bench it is in another process, and faults are
        all that it has.

        Raises:
            ConfigurationError: There is no such station.

        """
        stations: Mapping[str, Any] = self._devices.stations
        return named("station", stations, name)  # type: ignore[no-any-return]  # or its stand-in

    def segment(self, name: str | None = None) -> Segment:
        """Return a segment by name, or the first one: `CanMedium`, `LiveSegment` or `ModbusSegment`."""
        return named("segment", self._segments.by_name, name)

    def network(self, name: str | None = None) -> CanopenMaster:
        """Return the controller's CANopen services on a segment, by its name, or on the first one.

        `bench.network().nodes` are the drives as nodes: state, identity, EMCYs (`RemoteNode`).
        """
        return named("CAN segment", self._segments.masters, name)

    def node(self, drive_name: str | None = None) -> RemoteNode:
        """Return a drive or an encoder as its controller sees it, by name;
        default: the drive of the first axis.

        Raises:
            ConfigurationError: There is no such drive, or it is on Modbus.

        """
        encoders = self._control.encoder_nodes
        if encoders is not None and drive_name in encoders.nodes:
            return encoders.nodes[drive_name]
        port = self.port(drive_name)
        node = self._control.ports.node(port.name)
        if node is None:
            raise ConfigurationError("bench node", port.name, "a drive on CAN; this one is on Modbus")
        return node

    def port(self, drive_name: str | None = None) -> Port:
        """Return the port by which the controller leads a drive, by the name
        of the drive, or the first one.
        """
        return named("drive with an axis", self._control.ports.by_name, drive_name)

    @property
    def ports(self) -> DrivePorts:
        """The ports by which the controller leads its drives, by the kind of their connection."""
        return self._control.ports

    def station_link(self, name: str | None = None) -> StationLink:
        """Return an I/O station as the controller sees it, by name, or the first one."""
        return named("station", self._control.links, name)

    def telegram(self, name: str | None = None) -> TelegramMaster:
        """Return the master of a PROFIdrive drive without an axis: the test leads it
        by the signals of its telegram.

        The first call takes the drive into service and waits until it answers; not inside of a callback.

        Args:
            name: The drive; None: the first one.

        Raises:
            ConfigurationError: There is no such drive, it has an axis, or it has no telegram.
            BlockedError: Somebody else is the controller on its segment, or the drive did not come up.

        """
        from hil.bench.telegram_master import lead

        wanted = name or next(iter(self.config.drive), "")
        if wanted not in self._telegrams:
            section = self.config.drive.get(wanted)
            self._telegrams[wanted] = lead(
                self.config,
                wanted,
                ports=self._control.ports,
                master=None if section is None else self._segments.masters.get(section.segment),
                scheduler=self.scheduler,
                on_cycle=self.on_cycle,
            )
        return self._telegrams[wanted]

    @property
    def controller(self) -> Controller:
        """The controller as a CPU: operating states, what it keeps, diagnostics buffer."""
        return self.runtime.controller

    def outputs(self, looked_at: AbstractSet[str]) -> tuple[frozenset[str], frozenset[str]]:
        """Return which variables that axes only show, and which bits of their words, somebody has read, and
        which nobody has: `axis1.StatusPositioning.Distance`, `axis1.StatusWord.X7`.

        Args:
            looked_at: Names of the signals, and of the bits of recorded words, that were looked at in the
                trace.

        """
        return outputs_of(self._control.axes, looked_at)

    # -- names ----------------------------------------------------------------------------------------------

    @property
    def axis_names(self) -> tuple[str, ...]:
        """Names of the axes."""
        return tuple(self._control.axes)

    @property
    def nc_axis_names(self) -> tuple[str, ...]:
        """Names of the axes of an NC."""
        return tuple(self._control.nc_axes)

    @property
    def external_encoder_names(self) -> tuple[str, ...]:
        """Names of the external encoders (technology objects)."""
        return tuple(self._control.external_encoders)

    @property
    def proxy_names(self) -> tuple[str, ...]:
        """Names of the leading-axis proxies."""
        return tuple(self._control.proxies)

    @property
    def controllers(self) -> dict[str, Controller]:
        """Controllers beside `controller`, by name."""
        return {name: runtime.controller for name, runtime in self._control.others.items()}

    @property
    def controller_clocks(self) -> dict[str, NodeClock]:
        """Clocks of the controllers beside `controller`, by name."""
        return self._control.clocks

    @property
    def measuring_input_names(self) -> tuple[str, ...]:
        """Names of the measuring inputs."""
        return tuple(self._control.measuring_inputs)

    @property
    def cam_names(self) -> tuple[str, ...]:
        """Names of the cams."""
        return tuple(self._control.cams)

    @property
    def drive_names(self) -> tuple[str, ...]:
        """Names of the drives that have a fault interface."""
        return tuple(self._devices.drives)

    @property
    def encoder_names(self) -> tuple[str, ...]:
        """Names of the encoders that are devices of their own."""
        return tuple(self.config.encoder)

    @property
    def second_encoder_names(self) -> tuple[str, ...]:
        """Names of the second encoders of drives."""
        return tuple(self._devices.second_encoders)

    @property
    def device_names(self) -> tuple[str, ...]:
        """Names of the emulated devices that are made of their EDS alone."""
        return tuple(self._devices.devices)

    @property
    def station_names(self) -> tuple[str, ...]:
        """Names of the I/O stations."""
        return tuple(self._devices.stations)

    @property
    def segment_names(self) -> tuple[str, ...]:
        """Names of the segments."""
        return tuple(self._segments.by_name)

    @property
    def network_names(self) -> tuple[str, ...]:
        """Names of the CAN segments."""
        return tuple(self._segments.masters)

    @property
    def component_names(self) -> tuple[str, ...]:
        """Names of everything that reports its state in the history."""
        return component_names(self.config)

    @property
    def profiles(self) -> frozenset[str]:
        """Profiles of the drives: `cia402`, `profidrive`."""
        return frozenset(section.profile for section in self.config.drive.values())

    def drive_of(self, axis_name: str | None = None) -> str:
        """Return the name of the drive that moves an axis."""
        name = axis_name or next(iter(self.config.axis))
        return self.config.axis[name].drive

    def nodes_on(self, segment: str) -> tuple[str, ...]:
        """Return the names of the drives, encoders and devices on a segment, in this order."""
        return nodes_on(self.config, segment)

    def cob_ids(self, drive_name: str) -> dict[str, int]:
        """Return the identifiers that a drive, an encoder or a device uses, by name; a CiA 406 encoder has
        no RPDOs.

        Raises:
            ConfigurationError: There is no such node.

        """
        return cob_ids(self.config, drive_name)

    # -- time -----------------------------------------------------------------------------------------------

    def run_for(self, seconds: float) -> None:
        """Let `seconds` (0 or more) of bench time pass.

        Raises:
            ConfigurationError: It is no such time.

        """
        self.scheduler.run_for(checked_ns("bench.run_for", seconds))

    def run_until(self, predicate: Callable[[], object], timeout: float) -> bool:
        """Run until `predicate` is true or `timeout` seconds have passed; returns whether it became true.

        Raises:
            ConfigurationError: The predicate is no function: `job.done()` in place of `job.done`; or the
                timeout is no time of 0 s or more.

        """
        check_condition("bench.run_until", predicate)
        if self.scheduler.run_until(predicate, checked_ns("bench.run_until.timeout", timeout)):
            self._unmet = None
            return True
        self._unmet = UnmetWait(predicate, timeout, self.scheduler.now)
        return False

    def wait_until(self, condition: Callable[[], object], timeout: float, what: str = "") -> float:
        """Run until `condition` is true, and return the time at which it is, s.

        Args:
            condition: What is waited for: an output of a job such as `job.done`, or any function.
            timeout: Limit, s.
            what: Its meaning, for the message.

        Raises:
            ExpectationFailedError: It did not come in time; the message says what was waited for, how it
                ended, and why.
            ConfigurationError: The condition is no function: `job.done()` in place of `job.done`.

        """
        __tracebackhide__ = True
        check_condition("bench.wait_until", condition)
        if not self.run_until(condition, timeout):
            raise ExpectationFailedError(f"{what}: {self.unmet_wait()}" if what else self.unmet_wait())
        return self.now_s

    def unmet_wait(self) -> str:
        """Return why the last `run_until` gave up, in words; empty when it did
        not, or time has passed since.
        """
        unmet = self._unmet
        if unmet is None or unmet.ended_ns != self.scheduler.now:
            return ""
        return unmet.summary(self.summary())

    def summary(self) -> str:
        """Return the axes with their states and pending alarms: `x STANDSTILL
        at 0 mm; z DISABLED, alarm 521`.
        """
        control = self._control
        texts = [axis.summary() for axis in control.axes.values()]
        return "; ".join([*texts, *(axis.summary() for axis in control.nc_axes.values())])

    if not TYPE_CHECKING:

        def __getattr__(self, name: str) -> object:
            """Say what a name that a bench does not have is called here."""
            instead = _INSTEAD.get(name, "")
            if not instead and not name.startswith("_"):
                instead = self._of_an_axis(name)
            raise UnknownAttributeError(self, attribute=name, what="the bench", instead=instead)

        def _of_an_axis(self, name: str) -> str:
            """Return how to ask an axis for what a bench does not have; empty: an axis has none either."""
            from motion.s7.handles import AxisHandle

            if not hasattr(AxisHandle, name):
                return ""
            names = self.axis_names
            shown = f'"{names[0]}"' if len(names) > 1 else ""
            others = f"; {name_the('axis', names)}" if len(names) > 1 else ""
            return f"bench.axis({shown}).{name}: it belongs to an axis{others}"

    def __repr__(self) -> str:
        return f"<Bench {self.config.bench.name!r} at {self.now_s:.3f} s: {self.summary()}>"

    @property
    def now_s(self) -> float:
        """Present bench time, s."""
        return self.scheduler.now / S

    def on_cycle(self, callback: Callable[[], object]) -> Callable[[], None]:
        """Call `callback` at the end of every application cycle; returns the function that ends it."""
        if not self._listed:
            # In front of what a test has put there; without any of it drives need not catch up for it.
            self._listed = True
            self.runtime.after_cycle.insert(0, self._after_cycle)
        # A new list each time, so that a callback may withdraw itself while the list is walked.
        self._cycle_callbacks = [*self._cycle_callbacks, callback]

        def remove() -> None:
            self._cycle_callbacks = [one for one in self._cycle_callbacks if one is not callback]

        return remove

    def _after_cycle(self) -> None:
        for callback in self._cycle_callbacks:
            callback()

    def rng(self, name: str) -> Generator:
        """Return the seeded random stream of component `name`; the same name gives the same stream."""
        return named_rng(self.seed, name)

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
        """Lateness up to which measured times and distances mean something, s:
        `[tolerance]` of the bench file.
        """
        section = self.config.tolerance
        return section.time_s if section.lateness_s is None else section.lateness_s

    # -- evidence -------------------------------------------------------------------------------------------

    @property
    def vocabulary(self) -> Vocabulary:
        """What its recording can hold: names of components and jobs, states, alarms."""
        return bench_vocabulary(
            (*self.component_names, *self.second_encoder_names),
            (instance.name for instance in self.runtime.instances),
            self.history.events,
            self.history.declared,
            {name: section.drive for name, section in self.config.axis.items() if section.drive},
        )

    def trace(self) -> Trace:
        """Return everything recorded so far; on a live bench the drives' own records are fetched."""
        trace = self.recorder.trace(self.vocabulary)
        remote = self._remote
        if remote is None:
            return trace
        remote.fetch()
        return Trace(
            [*trace.groups, *remote.groups],
            events=sorted([*trace.events, *remote.events], key=lambda event: event.time_ns),
            frames={bus: trace.raw_frames(bus) for bus in trace.buses},
            constants=trace.constants,
            end_ns=trace.end_ns,
            vocabulary=trace.vocabulary,
            looked_at=trace.looked_at,
        )

    def record_calls(self) -> CallLog:
        """Record the outputs of every instruction instance in every call from now on (MC-566).

        `log.of(job)` are its calls: number, application cycle, time, outputs. Outputs of a single call are
        not missed.
        """
        return CallLog(self.runtime)

    def decode(self, frame: CanFrame | ModbusFrame, *, segment: str | None = None) -> str:
        """Return the meaning of a frame, by the PDO mapping that the controller has written.

        Args:
            frame: The frame.
            segment: Where it was, for a bench with several segments whose nodes have
                equal node-IDs; None = anywhere.

        Raises:
            ConfigurationError: There is no such segment.

        """
        return self._texts.describe(frame, segment)

    # -- end ------------------------------------------------------------------------------------------------

    def release_drives(self) -> None:
        """Stop the controller and disable every drive that it leads; two cycles of SYNC make it act."""
        self._control.release_drives()

    def on_close(self, callback: Callable[[], object]) -> None:
        """Call `callback` before the bench is closed, while its devices can still be asked."""
        self._closing.callback(callback)

    def close(self) -> None:
        """Release buses, threads and processes; harmless when called again."""
        self._closing.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()
