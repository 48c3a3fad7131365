"""The buses of a bench: CAN segments with the controller's services on them, Modbus networks and lines."""

from __future__ import annotations

from contextlib import suppress
from typing import TYPE_CHECKING, Final, TypeAlias

from fieldbus.can.port import MediumPort
from fieldbus.canopen.master import CanopenMaster
from fieldbus.clock import MS
from fieldbus.errors import BusError, ConfigurationError, HilError
from hil.bench.drive_config import ProfidriveModbusTable
from hil.bench.io_config import StationTable
from hil.bench.segment_config import CanTable, RtuTable, SegmentTable, TcpTable
from hil.errors import BlockedError
from hil.record.load_meter import LOAD_COLUMNS, LoadMeter

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from fieldbus.can import CanMedium
    from fieldbus.can.live import LiveSegment
    from fieldbus.clock import Scheduler
    from fieldbus.history import History
    from hil.bench.config import BenchConfig
    from hil.bench.modbus_links import ModbusSegment
    from hil.record import Recorder

    CanSegment: TypeAlias = CanMedium | LiveSegment
    Segment: TypeAlias = CanSegment | ModbusSegment

MASTER_NODE: Final = 127
"""Node-ID of the controller."""


class Segments:
    """The segments of a bench file, opened.

    Args:
        config: The bench file.
        scheduler: Time of the bench.
        history: Its event log.

    Raises:
        BlockedError: A live bus cannot be opened.

    """

    def __init__(self, config: BenchConfig, scheduler: Scheduler, history: History) -> None:
        self._config = config
        self._scheduler = scheduler
        self._history = history
        self._cycle_ns = config.bench.cycle_ms * MS
        self._live: list[LiveSegment] = []
        self.by_name: dict[str, Segment] = {}
        """All segments, in the order of the bench file."""
        self.can: dict[str, CanSegment] = {}
        self.modbus: dict[str, ModbusSegment] = {}
        self.masters: dict[str, CanopenMaster] = {}
        """CANopen services of the controller, by CAN segment."""
        try:
            for name, section in config.segment.items():
                self._open(name, section)
        except BaseException:
            self.close()
            raise

    def _open(self, name: str, section: SegmentTable) -> None:
        if not isinstance(section, CanTable):
            from hil.bench.modbus_links import ModbusSegment

            modbus = ModbusSegment(self._scheduler, name, section, cycle_ns=self._cycle_ns)
            self.by_name[name] = self.modbus[name] = modbus
            return
        can = self._open_can(name, section)
        self.by_name[name] = self.can[name] = can
        self.masters[name] = CanopenMaster(
            self._scheduler, can, name="controller", node_id=MASTER_NODE, history=self._history
        )

    def _open_can(self, name: str, section: CanTable) -> CanSegment:
        if self._config.bench.kind == "virtual":
            from fieldbus.can import CanMedium

            return CanMedium(
                self._scheduler,
                bitrate=section.bitrate,
                data_bitrate=section.data_bitrate,
                name=name,
                history=self._history,
            )
        from fieldbus.can.live import LiveSegment

        try:
            live = LiveSegment.open(self._scheduler, name=name, history=self._history, **section.opening())
        except BusError as error:
            raise BlockedError(str(error)) from error
        live.bitrate = section.bitrate
        self._live.append(live)
        return live

    def connect_drives(self, places: Mapping[str, tuple[str, int] | str]) -> None:
        """Connect the controller to the drives and I/O stations on live Modbus.

        Args:
            places: Host and port, or device file, of those that are not where the bench file says.

        Raises:
            BlockedError: A serial line cannot be opened.

        """
        drives: dict[str, ProfidriveModbusTable | StationTable] = {
            name: one for name, one in self._config.drive.items() if isinstance(one, ProfidriveModbusTable)
        }
        stations: dict[str, ProfidriveModbusTable | StationTable] = {**self._config.station}
        for name, device in (drives | stations).items():
            segment = self.modbus[device.segment]
            section = self._config.segment[device.segment]
            place = places.get(name)
            try:
                if isinstance(section, RtuTable):
                    path = place if isinstance(place, str) else section.path or ""
                    segment.open(name, path, section.serial_format())
                elif isinstance(section, TcpTable):
                    host, port = place if isinstance(place, tuple) else device.address(section)
                    segment.connect(name, host, port)
            except BusError as error:
                raise BlockedError(str(error)) from error

    def limit_to_classic(self) -> None:
        """Let the nodes that the bench file names know no CAN FD.

        Raises:
            ConfigurationError: A segment has no such node.

        """
        for name, section in self._config.segment.items():
            if not isinstance(section, CanTable) or not section.classic_nodes:
                continue
            ports = {port.name: port for port in self.can[name].ports if isinstance(port, MediumPort)}
            for node in section.classic_nodes:
                if node not in ports:
                    raise ConfigurationError(f"segment.{name}.classic_nodes", node, ", ".join(ports))
                ports[node].set_classic_only(True)

    # -- evidence -------------------------------------------------------------------------------------------

    def record_frames(self, recorder: Recorder, records: list[Callable[[], object]]) -> None:
        """Record the frames of all segments, and the load of those on CAN once per cycle."""
        for name in self.by_name:  # frames of the same time keep the order of the bench file
            if name in self.modbus:
                modbus = self.modbus[name]
                recorder.add_bus(name, modbus.entries, drop=modbus.drop_log, held=modbus.held)
                continue
            can, section = self.can[name], self._config.segment[name]
            assert isinstance(section, CanTable)
            recorder.add_bus(name, can.log, drop=can.drop_log)
            meter = LoadMeter(can, bitrate=section.bitrate, cycle_ns=self._cycle_ns)
            records.append(recorder.add_group(name, LOAD_COLUMNS, meter.row).sample)

    def record_requests(self, recorder: Recorder, after_cycle: list[Callable[[], object]]) -> None:
        """Record the requests of the ports on Modbus once per cycle; of ports that come later, nothing."""
        for name, modbus in self.modbus.items():
            columns = modbus.columns
            if columns:
                after_cycle.append(recorder.add_group(name, columns, modbus.row).sample)

    # -- end ------------------------------------------------------------------------------------------------

    def leave(self) -> None:
        """End the services of the controller on the buses."""
        for master in self.masters.values():
            with suppress(HilError):  # a bus that is down takes no last frames
                master.close()

    def close(self) -> None:
        """Close live buses, connections and lines."""
        for live in self._live:
            live.close()
        for modbus in self.modbus.values():
            modbus.close()
