"""What the supply of the controller means for its buses, and which of its outputs belong to no axis."""

from __future__ import annotations

from typing import TYPE_CHECKING

from fieldbus.clock import MS
from hil.bench.drive_config import CanDriveTable

if TYPE_CHECKING:
    from collections.abc import Mapping

    from fieldbus.canopen.master import CanopenMaster
    from hil.bench.config import BenchConfig
    from hil.bench.drive_ports import DrivePorts
    from motion.drives.station import StationLink
    from motion.s7.controller import Controller


class ControllerBuses:
    """The buses of the controller: led with supply, silent without.

    Args:
        config: The bench file.
        masters: CANopen services, by segment.
        ports: Ports to the drives; those that come later count too.
        links: I/O stations, by name; those that come later count too.

    """

    def __init__(
        self,
        config: BenchConfig,
        masters: Mapping[str, CanopenMaster],
        ports: DrivePorts,
        links: Mapping[str, StationLink],
    ) -> None:
        self._config = config
        self._masters = masters
        self._ports = ports
        self._links = links

    def connect(self, controller: Controller) -> None:
        """Follow the operating states of the controller."""
        controller.on_power.append(self._power)
        controller.on_outputs.append(self._switch_outputs)
        controller.periphery_ready = lambda: self._ports.ready

    def lead(self) -> None:
        """Send SYNC and heartbeat where the bench is the controller.

        On a bench without axes another program is the controller: the bench listens, and sends only faults.
        """
        config = self._config
        led = [config.drive[name] for name in config.moved_drives]
        for name, master in self._masters.items():
            heartbeats = [
                drive.heartbeat_ms
                for drive in led
                if isinstance(drive, CanDriveTable) and drive.segment == name
            ]
            if config.leads(name):
                master.start_sync(config.bench.cycle_ms * MS, 0)
            if any(heartbeats):
                master.produce_heartbeat(min(filter(None, heartbeats)) * MS)

    def _power(self, on: bool) -> None:
        led = [master for name, master in self._masters.items() if self._config.leads(name)]
        for link in self._links.values():
            link.power(on)
        if on:
            for master in led:
                master.power_on()
            self.lead()
        self._ports.power(on)
        if not on:
            for master in led:
                master.power_off()

    def _switch_outputs(self, on: bool) -> None:
        for link in self._links.values():
            link.switch_outputs(on)
