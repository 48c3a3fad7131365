"""The controller's ports to the drives of a bench file, as profile and bus want them."""

from __future__ import annotations

from typing import TYPE_CHECKING, TypeAlias, TypedDict

from fieldbus.clock import MS
from fieldbus.errors import ConfigurationError
from motion.drives.cia402 import Cia402Port, Cia402PortConfig
from motion.drives.profidrive import TelegramConfig
from motion.drives.profidrive_can import ProfidriveCanConfig, ProfidriveCanPort

if TYPE_CHECKING:
    from collections.abc import Mapping

    from fieldbus.canopen.master import CanopenMaster
    from fieldbus.canopen.node import RemoteNode
    from fieldbus.clock import Scheduler
    from fieldbus.history import History
    from hil.bench.config import BenchConfig
    from hil.bench.drive_config import DriveSection
    from hil.bench.modbus_links import ModbusSegment
    from hil.bench.segments import Segments
    from motion.drives.analog import AnalogPort
    from motion.drives.profidrive_modbus import ProfidriveModbusPort
    from motion.drives.station import StationLink

    CanPort: TypeAlias = Cia402Port | ProfidriveCanPort
    TelegramPort: TypeAlias = ProfidriveCanPort | ProfidriveModbusPort
    Port: TypeAlias = CanPort | ProfidriveModbusPort | AnalogPort


class DrivePorts:
    """The ports, by the name of the drive and by the kind of its connection.

    Args:
        config: The bench file.
        segments: Its buses.
        links: The controller's side of the I/O stations, for drives at their terminals.
        scheduler: Time of the bench.
        history: Its event log.

    """

    def __init__(
        self,
        config: BenchConfig,
        segments: Segments,
        links: Mapping[str, StationLink],
        *,
        scheduler: Scheduler,
        history: History,
    ) -> None:
        self._config = config
        self._segments = segments
        self._links = links
        self._scheduler = scheduler
        self._history = history
        self.by_name: dict[str, Port] = {}
        """All ports, in the order in which they were made."""
        self.can: dict[str, CanPort] = {}
        self.modbus: dict[str, ProfidriveModbusPort] = {}
        self.analog: dict[str, AnalogPort] = {}

    def add(self, name: str) -> Port:
        """Make the port to drive `name`."""
        section = self._config.drive[name]
        port: Port
        if section.profile == "analog":
            from hil.bench.io_devices import build_analog_port

            port = self.analog[name] = build_analog_port(
                self._config, name, self._links, history=self._history
            )
        elif section.segment in self._segments.masters:
            master = self._segments.masters[section.segment]
            port = self.can[name] = build_can_port(self._config, name, master, history=self._history)
        else:
            segment = self._segments.modbus[section.segment]
            port = self.modbus[name] = build_modbus_port(
                self._config, name, segment, self._scheduler, history=self._history
            )
        self.by_name[name] = port
        return port

    def telegram_port(self, name: str) -> TelegramPort:
        """Return the port to a drive that speaks PROFIdrive telegrams.

        Raises:
            ConfigurationError: The drive has none.

        """
        port = self.modbus.get(name) or self.can.get(name)
        if port is None or isinstance(port, Cia402Port):
            raise ConfigurationError(
                f"drive.{name}", "no telegram", "a drive that speaks PROFIdrive telegrams"
            )
        return port

    def node(self, name: str) -> RemoteNode | None:
        """Return the CANopen node of a drive; None for a drive that is not on CAN."""
        port = self.can.get(name)
        return None if port is None else port.node

    def missing(self, name: str) -> bool:
        """Say whether a drive may be missing, and is."""
        port = self.by_name[name]
        return port.optional and not self._started(name)

    def _started(self, name: str) -> bool:
        if name in self.can:
            return self.can[name].node.started
        return self.modbus[name].started if name in self.modbus else self.analog[name].started

    @property
    def ready(self) -> bool:
        """Whether every drive answers that is not optional."""
        return all(port.optional or self._answers(name) for name, port in self.by_name.items())

    def _answers(self, name: str) -> bool:
        return self.can[name].node.in_service if name in self.can else self._started(name)

    def power(self, on: bool) -> None:
        """Follow the supply of the controller: without it the ports are silent, with it they begin again."""
        for name, port in self.by_name.items():
            if name in self.modbus:
                if on:
                    self.modbus[name].boot()
                else:
                    self.modbus[name].close()
            elif on and name in self.analog:
                port.enter_service()  # at the terminals of a station there is nothing to set up
            if not on:
                port.power_down()

    def release(self) -> bool:
        """Disable every drive that the controller leads with its last telegram; returns whether there is
        one.
        """
        leading = [port for port in self.by_name.values() if port.link_ok]
        for port in leading:
            port.release()
        return bool(leading)

    def close(self) -> None:
        """Stop the ports that ask by themselves."""
        for port in self.modbus.values():
            port.close()


class _Link(TypedDict):
    """Settings for a drive on any bus."""

    cycle_ns: int
    absolute_encoder: bool
    grace_cycles: int
    optional: bool


class _Node(TypedDict):
    """Settings for a drive of any profile on CANopen."""

    node_id: int
    heartbeat_ms: int
    consumer_heartbeat_ms: int
    guard_time_ms: int
    life_time_factor: int
    vendor_id: int | None
    product_code: int | None
    revision: int | None
    serial: int | None
    store: bool


def _link(config: BenchConfig, drive: DriveSection) -> _Link:
    return {
        "cycle_ns": config.bench.cycle_ms * MS,
        "absolute_encoder": drive.encoder == "absolute",
        "grace_cycles": config.bench.grace_cycles,
        "optional": drive.optional,
    }


def _node(drive: DriveSection) -> _Node:
    return {
        "node_id": drive.node_id,
        "heartbeat_ms": drive.heartbeat_ms,
        "consumer_heartbeat_ms": drive.consumer_heartbeat_ms,
        "guard_time_ms": drive.guard_time_ms,
        "life_time_factor": drive.life_time_factor,
        "vendor_id": drive.vendor_id,
        "product_code": drive.product_code,
        "revision": drive.revision,
        "serial": drive.serial,
        "store": drive.device == "emulated" if drive.store_parameters is None else drive.store_parameters,
    }


def _telegram(config: BenchConfig, drive: DriveSection) -> TelegramConfig:
    own = drive.profidrive
    return TelegramConfig(
        telegram=drive.telegram,
        torque_telegram=own.torque_telegram,
        safety_telegram=own.safety_telegram,
        reference_speed_rpm=own.reference_speed_rpm,
        reference_torque_nm=own.reference_torque_nm,
        sign_of_life=config.counts_life(drive),
        isochronous=not config.segment[drive.segment].on_modbus,
    )


def build_can_port(config: BenchConfig, name: str, master: CanopenMaster, *, history: History) -> CanPort:
    """Return the port to a drive on CAN."""
    drive = config.drive[name]
    link, node = _link(config, drive), _node(drive)
    if drive.profile in ("tm_pto", "tm41"):
        from motion.drives.tm_pto import PtoWords, TmPtoConfig, TmPtoPort

        signal_output = drive.profile == "tm41"
        words = PtoWords(
            variant="standard" if signal_output else drive.tm_pto.variant,
            reference_speed_rpm=drive.max_speed_rpm if signal_output else drive.tm_pto.reference_speed_rpm,
        )
        return TmPtoPort(master, TmPtoConfig(words=words, **link, **node), name=name, history=history)
    if drive.profile == "profidrive":
        can = ProfidriveCanConfig(words=_telegram(config, drive), **link, **node)
        return ProfidriveCanPort(master, can, name=name, history=history)
    own = Cia402PortConfig(
        rated_torque_nm=drive.rated_torque_nm,
        increments_per_revolution=drive.increments_per_revolution,
        off1_deceleration_rpm_s=drive.max_speed_rpm / drive.off1_ramp_s,
        off3_deceleration_rpm_s=drive.max_speed_rpm / drive.off3_ramp_s,
        **link,
        **node,
    )
    return Cia402Port(master, own, name=name, history=history)


def build_modbus_port(
    config: BenchConfig, name: str, segment: ModbusSegment, scheduler: Scheduler, *, history: History
) -> ProfidriveModbusPort:
    """Return the port to a drive on Modbus."""
    from hil.bench.modbus_config import combines, registers_of
    from motion.drives.profidrive_modbus import ProfidriveModbusConfig, ProfidriveModbusPort

    drive = config.drive[name]
    own = ProfidriveModbusConfig(
        unit=drive.unit,
        registers=registers_of(drive),
        words=_telegram(config, drive),
        monitoring_ms=round(drive.profidrive.setpoint_monitoring_ms),
        combined=combines(drive, config.segment[drive.segment]),
        request_ns=segment.request_ns(),
        **_link(config, drive),
    )
    port = ProfidriveModbusPort(scheduler, segment.client(name), own, name=name, history=history)
    segment.watch(port)
    return port
