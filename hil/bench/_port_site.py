"""What the controller's port to a drive of the bench file is built with."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from fieldbus.canopen.master import CanopenMaster
    from fieldbus.clock import Scheduler
    from fieldbus.history import History
    from hil.bench.bench_config import BenchTable
    from hil.bench.io_config import StationTable
    from hil.bench.modbus_links import ModbusSegment
    from motion.drives.station import StationLink


@dataclass(frozen=True, kw_only=True)
class PortSite:
    """What the controller has to reach a drive.

    Args:
        name: Name of the drive in the bench file.
        bench: `[bench]`.
        scheduler: Time of the bench.
        history: Log of the bench.
        masters: CANopen services by CAN segment.
        modbus: Modbus segments by name.
        stations: Tables of the I/O stations by name.
        links: The controller's side of the I/O stations by name.
        variables: Start values of the axis that the drive moves.
        interface: What the axis gives to the drive: `velocity`, `position`, `torque`.

    """

    name: str
    bench: BenchTable
    scheduler: Scheduler
    history: History
    masters: Mapping[str, CanopenMaster]
    modbus: Mapping[str, ModbusSegment]
    stations: Mapping[str, StationTable]
    links: Mapping[str, StationLink]
    variables: Mapping[str, bool | int | float]
    interface: str = "velocity"
