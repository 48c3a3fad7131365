"""The controller's ports to the drives of a bench file."""

from __future__ import annotations

from typing import TYPE_CHECKING, TypeAlias

from fieldbus.errors import ConfigurationError
from hil.bench._port_site import PortSite
from hil.bench.drive_config import AnalogDriveTable, ProfidriveModbusTable, TwoSpeedDriveTable
from motion.drives.cia402 import Cia402Port

if TYPE_CHECKING:
    from collections.abc import Mapping

    from fieldbus.canopen.node import RemoteNode
    from fieldbus.clock import Scheduler
    from fieldbus.history import History
    from hil.bench.config import BenchConfig
    from hil.bench.segments import Segments
    from motion.drives.analog import AnalogPort
    from motion.drives.profidrive_can import ProfidriveCanPort
    from motion.drives.profidrive_modbus import ProfidriveModbusPort
    from motion.drives.station import StationLink
    from motion.drives.two_speed import TwoSpeedPort

    CanPort: TypeAlias = Cia402Port | ProfidriveCanPort
    TelegramPort: TypeAlias = ProfidriveCanPort | ProfidriveModbusPort
    Port: TypeAlias = CanPort | ProfidriveModbusPort | AnalogPort | TwoSpeedPort


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
        self.analog: dict[str, AnalogPort | TwoSpeedPort] = {}
        """Drives at the terminals of a station."""

    def add(self, name: str) -> Port:
        """Make the port to drive `name`."""
        config = self._config
        axis = next((one for one in config.s7_axes.values() if one.drive == name), None)
        nc_axis = next((one for one in config.nc_axes.values() if one.drive == name), None)
        site = PortSite(
            name=name,
            bench=config.bench,
            scheduler=self._scheduler,
            history=self._history,
            masters=self._segments.masters,
            modbus=self._segments.modbus,
            stations=config.station,
            links=self._links,
            variables={} if axis is None else axis.variables,
            interface="velocity" if nc_axis is None else nc_axis.interface,
        )
        drive = config.drive[name]
        port: Port
        if isinstance(drive, AnalogDriveTable | TwoSpeedDriveTable):
            port = self.analog[name] = drive.build_port(site)
        elif isinstance(drive, ProfidriveModbusTable):
            port = self.modbus[name] = drive.build_port(site)
        else:
            port = self.can[name] = drive.build_port(site)
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
        """Disable every drive that the controller leads with its last
        telegram; returns whether there is one.
        """
        leading = [port for port in self.by_name.values() if port.link_ok]
        for port in leading:
            port.release()
        return bool(leading)

    def close(self) -> None:
        """Stop the ports that ask by themselves."""
        for port in self.modbus.values():
            port.close()
