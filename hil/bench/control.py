"""The controller of a bench: runtime, ports to its drives, axes, encoders
and I/O stations as it sees them.
"""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Final

from fieldbus.clock import MS, US, S
from fieldbus.errors import ErrorCollector
from fieldbus.node_clock import NodeClock
from hil.bench.axis_config import AxisTable, ExternalEncoderTable, second_of
from hil.bench.cam_config import CamTable
from hil.bench.controller_buses import ControllerBuses
from hil.bench.drive_ports import DrivePorts
from hil.bench.judged_numbers import numbers_of_axis
from hil.bench.startup import LINK_TIMEOUT_NS, commission, wait_for_encoders
from hil.bench.units import taken_over_in_unit
from hil.errors import BlockedError
from motion.drives.port import SWITCHES, DrivePort, NoDrivePort
from motion.s7.axis import ExternalEncoder, PositioningAxis, SpeedAxis, SynchronousAxis
from motion.s7.cam_handle import CamHandle
from motion.s7.cams import Cam
from motion.s7.compatibility import level_of
from motion.s7.handles import AxisHandle, EncoderHandle, MeasuringInputHandle, ProxyHandle
from motion.s7.measuring_input import CENTRAL, TELEGRAM, MeasuringInput, measured_object

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from numpy.random import Generator

    from fieldbus.history import History
    from hil.bench.config import BenchConfig
    from hil.bench.controller_config import ProxyTable
    from hil.bench.drive_config import DriveTable
    from hil.bench.drive_ports import Port
    from hil.bench.encoders import EncoderNodes
    from hil.bench.measuring_config import MeasuringInputTable
    from hil.bench.nc_axis_config import NcAxisTable
    from hil.bench.segments import Segments
    from hil.record import Recorder
    from motion.drives.encoder import EncoderPort
    from motion.drives.station import StationLink
    from motion.nc.handles import NcAxisHandle
    from motion.nc.parameters import ParameterSet
    from motion.nc.project import Link, Project
    from motion.nc.tasks import NcRuntime
    from motion.s7.axis import TechnologyAxis
    from motion.s7.axis.technology_object import TechnologyObject
    from motion.s7.proxy import LeadingAxisProxy
    from motion.s7.runtime import Runtime

_AXES: Final = {"positioning": PositioningAxis, "speed": SpeedAxis, "synchronous": SynchronousAxis}


class ControlSystem:
    """The controller with everything that a bench file connects to it.

    Args:
        config: The bench file.
        runtime: Cycle of the controller; gets the axes and external encoders.
        segments: The buses.
        history: Event log.
        recorder: Samples axes and external encoders.
        rng: Returns the random stream of a name.

    Raises:
        ConfigurationError: A variable of an axis does not exist or is out of range.

    """

    def __init__(
        self,
        config: BenchConfig,
        runtime: Runtime,
        segments: Segments,
        *,
        history: History,
        recorder: Recorder,
        rng: Callable[[str], Generator],
    ) -> None:
        self._config = config
        self._runtime = runtime
        self._scheduler = runtime.scheduler
        self._history = history
        self._recorder = recorder
        self.links: dict[str, StationLink] = {}
        """I/O stations, as the controller sees them."""
        self.ports = DrivePorts(config, segments, self.links, scheduler=runtime.scheduler, history=history)
        self.encoder_nodes: EncoderNodes | None = None
        """Encoders with a node of their own; None: there are none."""
        self._encoder_ports: dict[str, EncoderPort] = {}
        self.axes: dict[str, AxisHandle] = {}
        self.nc: NcRuntime | None = None
        """The NC; None: the bench has no axis of one."""
        self._project: Project | None = None
        self.nc_axes: dict[str, NcAxisHandle] = {}
        self.external_encoders: dict[str, EncoderHandle] = {}
        self.clocks: dict[str, NodeClock] = {
            name: NodeClock(self._scheduler, partial(rng, f"controller.{name}")) for name in config.controller
        }
        """Clocks of the controllers beside that of `[bench]`."""
        self.others: dict[str, Runtime] = {
            name: self._other_runtime(name, section.phase_us) for name, section in config.controller.items()
        }
        """Controllers beside that of `[bench]`."""
        self.proxies: dict[str, ProxyHandle] = {}
        self.cams: dict[str, CamHandle] = {}
        self.measuring_inputs: dict[str, MeasuringInputHandle] = {}
        self._buses = ControllerBuses(config, segments.masters, self.ports, self.links)
        if config.axis:
            self._connect_stations(segments)
        if config.encoder:
            self._connect_encoders(segments)
        errors = ErrorCollector()
        for name, section in config.s7_axes.items():
            with errors.located(f"axis.{name}"):
                self._add_axis(name, section)
        for name, nc_section in config.nc_axes.items():
            with errors.located(f"axis.{name}"):
                self._add_nc_axis(name, nc_section)
        if config.nc_axes:
            self._activate_nc(self._nc_project())
        for name, external in config.external_encoder.items():
            with errors.located(f"external_encoder.{name}"):
                self._add_external_encoder(name, external)
        for name, proxy in config.proxy.items():
            with errors.located(f"proxy.{name}"):
                self._add_proxy(name, proxy)
        objects: dict[str, TechnologyObject] = {}
        for handles in (self.external_encoders, self.axes, self.proxies):
            objects |= {name: one.object for name, one in handles.items()}
        for name, section in config.s7_axes.items():
            if section.leading and name in self.axes:
                axis = self.axes[name].object
                axis.leading_objects = tuple(
                    objects[leader] for leader in section.leading if leader in objects
                )
                axis.couplings = dict(section.coupling)
                axis.hold_tolerance = section.hold_tolerance
        for one in (runtime, *self.others.values()):
            one.order_axes()
        for name, cam in config.cam.items():
            with errors.located(f"cam.{name}"):
                self._add_cam(name, cam)
        for name, measuring in config.measuring_input.items():
            with errors.located(f"measuring_input.{name}"):
                self._add_measuring_input(name, measuring)
        errors.check()
        for link in self.links.values():
            runtime.after_cycle.append(link.exchange)

    def _connect_stations(self, segments: Segments) -> None:
        for name, section in self._config.station.items():
            self.links[name] = section.build_link(
                name,
                segments.modbus[section.segment],
                grace_cycles=self._config.bench.grace_cycles,
                history=self._history,
            )

    def _connect_encoders(self, segments: Segments) -> None:
        from hil.bench.encoders import EncoderNodes, build_encoder_ports

        cia406 = build_encoder_ports(segments.masters, self._config, self._history)
        self._encoder_ports.update(cia406)
        self.encoder_nodes = EncoderNodes(segments.masters, self._config, cia406, self._history)
        used = self._config.used_encoders
        for name, port in self.encoder_nodes.ports.items():
            if name in used:
                self._encoder_ports[name] = port  # its technology object reads it
            else:
                self._runtime.after_cycle.append(port.read)

    # -- axes -----------------------------------------------------------------------------------------------

    def _other_runtime(self, name: str, phase_us: int | None) -> Runtime:
        """Return one more controller with the cycles of the bench."""
        from motion.s7.runtime import Runtime

        runtime = self._runtime
        return Runtime(
            self.clocks[name],
            cycle_ns=runtime.cycle_ns,
            interpolator_ns=self._interpolator_ns,
            phase_ns=None if phase_us is None else phase_us * US,
            history=self._history,
            program_cycles=runtime.program_cycles,
        )

    def _runtime_of(self, name: str) -> Runtime:
        """Return the controller that has an axis or a proxy."""
        plc = self._config.plc_of(name)
        return self._runtime if plc is None else self.others[plc]

    def _add_proxy(self, name: str, section: ProxyTable) -> None:
        from motion.s7.proxy import LeadingAxisProxy, LeadingValueLink

        if section.axis not in self.axes:
            return  # it has a mistake of its own
        link = LeadingValueLink(
            self._scheduler,
            self.axes[section.axis].object,
            interface=section.interface,
            delay_ns=section.delay_us * US,
        )
        self._runtime_of(section.axis).send_leading_value(link)
        runtime = self._runtime_of(name)
        proxy = LeadingAxisProxy(
            name, link, cycle_ns=runtime.cycle_ns, variables=section.variables, history=self._history
        )
        runtime.add_proxy(proxy)
        self.proxies[name] = ProxyHandle(runtime, proxy)
        self._record(name, proxy)

    def _add_axis(self, name: str, section: AxisTable) -> None:
        config = self._config
        port: Port | NoDrivePort = self.ports.add(section.drive) if section.drive else NoDrivePort()
        variables = config.start_values(name)
        for proxy in config.proxy.values():
            if proxy.axis == name:
                output = f"CrossPlcSynchronousOperation.Interface[{proxy.interface}].EnableLeadingValueOutput"
                variables.setdefault(output, True)
        encoders: list[EncoderPort | Port] | None = None
        named = config.encoders_of_axis(name)
        if named is not None:
            encoders = [self._encoder_of_axis(section, one) for one in named]
        if section.connection == "data_block":
            self.ports.telegram_port(section.drive).connect_block()
        axis: TechnologyAxis = _AXES[section.type](
            name,
            port,
            cycle_ns=self._runtime.cycle_ns,
            interpolator_ns=self._interpolator_ns,
            variables=variables,
            delay_s=port.delay_ns / S,
            history=self._history,
            encoders=encoders,
            connection=section.connection,
            cpu=config.cpu_of(section.plc),
            ramp_times=section.ramp_times,
        )
        place = config.inputs_of_axis(name)
        if place is not None:
            axis.station_inputs = config.station[place].axis_inputs(section.drive, self.links[place])
        if section.inputs_update != "servo":
            axis.read_limits_with_program()
        axis.homing_input = SWITCHES[section.homing_input]
        axis.enabling.timeout_s = section.enable_timeout_s
        on_motor = encoders is None and axis.has_position and variables.get("Sensor[1].System", 1) == 1
        self._history.emit(
            name,
            "axis.wired",
            drive=section.drive,
            homing_input=section.homing_input,
            zero_mark_pitch=60.0 / axis.mechanics.rpm_per_unit if on_motor else 0.0,
        )
        runtime = self._runtime_of(name)
        runtime.add(axis)
        self.axes[name] = AxisHandle(runtime, axis)
        self._record(name, axis)
        self._note_limits(name, axis)

    def _add_nc_axis(self, name: str, section: NcAxisTable) -> None:
        from motion.nc.project import AxisKind

        config = self._config
        drive = config.drive.get(section.drive)
        kind = AxisKind.CONTINUOUS
        link: Link | None = None
        if drive is not None:
            if drive.profile == "two_speed":
                kind = AxisKind.DISCRETE
            link = self._link_of(section, drive, self.ports.add(section.drive))
        elif section.encoder is not None:
            kind = AxisKind.ENCODER
            link = self._encoder_link(self._encoder_ports[section.encoder])
        self._nc_project().add(
            name, kind=kind, values=section.start_values(drive), link=link, comment=section.comment
        )

    def _nc_project(self) -> Project:
        """Return the project of the NC; the first call makes both."""
        if self._project is None:
            from motion.nc.project import Project
            from motion.nc.tasks import NcRuntime

            runtime, table = self._runtime, self._config.nc
            self.nc = NcRuntime(
                self._scheduler,
                cycle_ns=runtime.cycle_ns,
                phase_ns=runtime.phase_ns,
                plc_cycles=runtime.program_cycles,
                svb_ns=table.svb_ns,
                parameters=table.build_parameters(),
                retain=table.build_retain(),
                history=self._history,
            )
            table.add_tables(self.nc.tables)
            self._project = self.nc.project = Project(
                self.nc, licence=table.build_licence(), history=self._history
            )
        return self._project

    @staticmethod
    def _link_of(section: NcAxisTable, drive: DriveTable, port: DrivePort) -> Link:
        from motion.nc.device import INTERFACES, TWO_SPEED, PortDevice

        interface = TWO_SPEED if drive.profile == "two_speed" else INTERFACES[section.interface]
        switch = section.fast_stop_input

        def link(parameters: ParameterSet) -> PortDevice:
            return PortDevice(
                port,
                rpm_per_unit=60.0 / section.feed_of(drive),
                interface=interface,
                torque_per_nm=1000.0 / drive.reference_torque_nm,
                fast_stop_input=0 if switch is None else SWITCHES[switch],
                direct_inputs=parameters.read("drv.type") in {"MDP_703", "MDP_733"},
            )

        return link

    @staticmethod
    def _encoder_link(port: EncoderPort) -> Link:
        from motion.nc.device import EncoderDevice

        return lambda parameters: EncoderDevice(port)  # noqa: ARG005 - the parameters do not matter

    def _activate_nc(self, project: Project) -> None:
        """Build the axes of the NC, and record them."""
        from motion.nc.axis import TRACE_COLUMNS
        from motion.nc.handles import NcAxisHandle

        project.activate(start=False)
        assert self.nc is not None  # it has a project
        for entry in project:
            assert entry.ref is not None  # it is activated
            handle = self.nc_axes[entry.name] = NcAxisHandle(self.nc, entry.ref)
            group = self._recorder.add_group(entry.name, TRACE_COLUMNS, handle.trace_row)
            self._runtime.records.append(group.sample)
            self._recorder.set_constant(f"{entry.name}.cycle_s", handle.object.cycle_s)
            if handle.object.two_speed:
                self._recorder.set_constant(f"{entry.name}.two_speed", 1.0)

    def _encoder_of_axis(self, section: AxisTable, encoder: str) -> EncoderPort | Port:
        """Return the port to an encoder of an axis."""
        if encoder == section.drive:
            return self.ports.by_name[encoder]
        if encoder == second_of(section.drive):
            from motion.drives.profidrive_second import SecondEncoderPort

            second = self._config.drive[section.drive].second_encoder
            assert second is not None  # checked with the bench file
            port = self.ports.telegram_port(section.drive)
            return SecondEncoderPort(port, absolute_encoder=second.absolute)
        return self._encoder_ports[encoder]

    @property
    def _interpolator_ns(self) -> int:
        bench = self._config.bench
        return (bench.interpolator_ms or bench.cycle_ms) * MS

    def _note_limits(self, name: str, axis: TechnologyAxis) -> None:
        """Note the facts of an axis that a judge of the trace needs."""

        def read(path: str) -> float:
            return float(axis.variables.bind(path).value)

        constants = {
            "cycle_s": self._runtime.cycle_ns / S,
            "max_velocity": read("DynamicLimits.MaxVelocity"),
            "max_acceleration": read("DynamicLimits.MaxAcceleration"),
            "max_deceleration": read("DynamicLimits.MaxDeceleration"),
            "max_jerk": read("DynamicLimits.MaxJerk"),
            "emergency_deceleration": read("DynamicDefaults.EmergencyDeceleration"),
            "deceleration": read("DynamicDefaults.Deceleration"),
            "jerk": read("DynamicDefaults.Jerk"),
            "unit_per_rpm": 1.0 / axis.mechanics.rpm_per_unit,
        }
        if self._interpolator_ns != self._runtime.cycle_ns:
            constants["interpolator_s"] = self._interpolator_ns / S
        own = self._config.encoders_of_axis(name)
        if axis.has_position:
            drive = self._config.axis[name].drive
            first = own[0] if own else ""
            # Number of the encoder in the telegram of the drive; 0: it has a device of its own.
            number = 1 if own is None or first == drive else 2 if first == second_of(drive) else 0
            constants["encoder_of_drive"] = number if drive else 0
            # The actual values of a virtual axis are one cycle older than those of a drive (CFG-151).
            constants["delay_s"] = axis.delay_s + (axis.servo.cycle_s if axis.servo.virtual else 0.0)
            constants["limits_at_drive"] = drive != "" and self._config.inputs_of_axis(name) is None
        constants |= numbers_of_axis(axis.variables)
        for key, value in constants.items():
            self._recorder.set_constant(f"{name}.{key}", value)

    def _add_external_encoder(self, name: str, section: ExternalEncoderTable) -> None:
        values = self._config.encoder[section.encoder].taken_over("Sensor")
        variables = taken_over_in_unit(values, section.variables)
        variables.pop("Sensor.MountingMode", None)
        encoder = ExternalEncoder(
            name,
            self._encoder_ports[section.encoder],
            cycle_ns=self._runtime.cycle_ns,
            variables={**variables, **section.variables},
            history=self._history,
        )
        if section.drive is not None:
            port, mask = self.ports.by_name[section.drive], SWITCHES[section.homing_input]
            encoder.digital_input = lambda: port.inputs & mask != 0
        self._runtime.add_encoder(encoder)
        self.external_encoders[name] = EncoderHandle(self._runtime, encoder)
        self._record(name, encoder)

    def _add_cam(self, name: str, section: CamTable) -> None:
        points, segments = section.elements()
        cam = Cam(
            name,
            kind=section.kind,
            points=points,
            segments=segments,
            variables=section.start_values(),
            cpu=self._config.bench.cpu,
            history=self._history,
        )
        self._runtime.add_cam(cam)
        self.cams[name] = CamHandle(self._runtime, cam)

    def _add_measuring_input(self, name: str, section: MeasuringInputTable) -> None:
        handle = self.axes.get(section.of) or self.external_encoders.get(section.of)
        if handle is None:
            return  # it has a mistake of its own
        cpu = self._config.cpu_of(self._config.plc_of(section.of))
        one = MeasuringInput(
            name,
            measured_object(handle.object),
            probe=section.probe,
            kind=CENTRAL if section.kind == "central" else TELEGRAM,
            correction_ms=section.correction_ms,
            aborts_for_homing=level_of(cpu).version == "V7.0",
            cpu=cpu,
            history=self._history,
        )
        handle.object.on_homing.append(one.end_for_homing)
        runtime = self._runtime_of(section.of)
        runtime.add_measuring_input(one)
        self.measuring_inputs[name] = MeasuringInputHandle(runtime, one)

    def _record(self, name: str, part: TechnologyAxis | ExternalEncoder | LeadingAxisProxy) -> None:
        group = self._recorder.add_group(name, part.trace_columns, part.trace_row, enums=part.trace_enums)
        self._runtime_of(name).records.append(group.sample)

    # -- operation ------------------------------------------------------------------------------------------

    def start(self) -> None:
        """Commission the drives and wait for the cyclic link.

        Raises:
            BlockedError: A drive did not come up, or is another one than the bench file says.
            CommissioningError: A drive refuses a parameter.

        """
        commission(self._scheduler, self.ports, self.ports.by_name, self.encoder_nodes)
        self._buses.connect(self._runtime.controller)
        self._buses.lead()
        if self._config.bench.memory_card is not None:
            self._runtime.insert_card(Path(self._config.bench.memory_card))
        if self.nc is not None:
            # In front of the other controller, whose cycle ends with the recording.
            self.nc.start()
        self._runtime.start()
        for other in self.others.values():
            other.start()
        if self.encoder_nodes is not None:
            wait_for_encoders(self._scheduler, self.encoder_nodes)
        if not self._scheduler.run_until(self._linked, LINK_TIMEOUT_NS):
            reasons = "; ".join(self._not_linked()) or "an axis has no link"
            raise BlockedError(f"not ready within {LINK_TIMEOUT_NS // S} s: {reasons}")

    def _not_linked(self) -> Iterator[str]:
        """Yield why drives cannot be used."""
        for name, port in self.ports.by_name.items():
            if port.optional:
                continue
            if not port.link_ok:
                yield f"no cyclic data from {name}"
            elif port.drive_fault_code:
                yield f"{name} is in fault {port.drive_fault_code:04X}h"
        for name, handle in self.axes.items():
            axis = handle.object
            if axis.communication_ok and not axis.sensor_valid:
                yield f"{name} has no valid actual value"

    def _linked(self) -> bool:
        return all(
            (axis.communication_ok and axis.sensor_valid)
            or (self._config.axis[name].drive != "" and self.ports.missing(self._config.axis[name].drive))
            or self._programmed(axis)
            for name, axis in ((name, handle.object) for name, handle in self.axes.items())
        ) and all(
            handle.object.device.valid or self._may_be_silent(name, handle)
            for name, handle in self.nc_axes.items()
        )

    def _may_be_silent(self, name: str, handle: NcAxisHandle) -> bool:
        drive = self._config.axis[name].drive
        return handle.object.disabled or (drive != "" and self.ports.missing(drive))

    @staticmethod
    def _programmed(axis: TechnologyAxis) -> bool:
        """Say whether the telegram of an axis arrives and it is up to a program to let the axis see it."""
        return axis.connection == "data_block" and axis.servo.drive_port.link_ok

    def release_drives(self) -> None:
        """Stop the runtime and disable every drive that the controller leads;
        two cycles of SYNC make it act.
        """
        self._runtime.stop()
        for other in self.others.values():
            other.stop()
        if self.nc is not None:
            self.nc.stop()
        if self.ports.release():
            self._scheduler.run_for(2 * self._runtime.cycle_ns)
