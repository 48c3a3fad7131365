"""A whole bench file: its tables, and what follows from them together."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Final

from pydantic import Field

from hil.bench._table import Table
from hil.bench.axis_config import OBJECTS, AnyAxis, AxisTable, ExternalEncoderTable, second_of
from hil.bench.bench_config import BenchTable, ToleranceTable
from hil.bench.cam_config import CamTable
from hil.bench.controller_config import ControllerTable, ProxyTable
from hil.bench.device_config import DeviceTable
from hil.bench.drive_config import (
    WITH_SWITCHES,
    AnalogDriveTable,
    AnyDrive,
    CanDriveTable,
    Cia402DriveTable,
    DriveTable,
    ProfidriveCanTable,
    ProfidriveModbusTable,
)
from hil.bench.drive_tables import second_encoder_variables
from hil.bench.encoder_config import AnyEncoder, EncoderTable
from hil.bench.io_config import StationTable
from hil.bench.measuring_config import MeasuringInputTable
from hil.bench.nc_axis_config import NcAxisTable
from hil.bench.nc_config import NcTable
from hil.bench.segment_config import AnySegment
from hil.bench.units import taken_over_in_unit
from motion.s7.axis.configuration import encoders_of_telegram, given_values
from motion.s7.axis.ramp_times import RampTimes
from motion.s7.variables import VariableStore

SWITCH_LEVELS: Final = ("PositionLimits_HW.MinSwitchLevel", "PositionLimits_HW.MaxSwitchLevel")
"""Variables with the level of an actuated limit switch."""
_MOST_STEPS: Final = 1 << 23
"""Greatest `StepsPerRevolution` of an encoder of an axis."""


class BenchConfig(Table, frozen=True):
    """A whole bench file."""

    bench: BenchTable
    """What is common to the whole bench."""
    tolerance: ToleranceTable = ToleranceTable()
    """How far a measurement on this bench may lie from the number of the specification."""
    segment: dict[str, AnySegment] = Field(min_length=1)
    """Segments by name: CAN, Modbus TCP, Modbus RTU."""
    drive: dict[str, AnyDrive] = {}
    """Drives by name."""
    encoder: dict[str, AnyEncoder] = {}
    """Encoders that are CANopen devices of their own, by name."""
    device: dict[str, DeviceTable] = {}
    """Emulated CANopen devices of any kind, by name."""
    station: dict[str, StationTable] = {}
    """Emulated I/O stations on Modbus, by name."""
    nc: NcTable = NcTable()
    """What the axes with `controller = "nc"` have in common."""
    axis: dict[str, AnyAxis] = {}
    """Axes by name: technology objects that move a drive, or axes of an NC."""
    external_encoder: dict[str, ExternalEncoderTable] = {}
    """External encoders by name: technology objects that read an encoder."""
    cam: dict[str, CamTable] = {}
    """Cams by name: technology objects with the function that a following axis follows."""
    measuring_input: dict[str, MeasuringInputTable] = {}
    """Measuring inputs by name: technology objects that measure positions at the edges of a probe."""
    controller: dict[str, ControllerTable] = {}
    """Controllers beside that of `[bench]`, by name."""
    proxy: dict[str, ProxyTable] = {}
    """Leading-axis proxies by name: technology objects with the leading value of another controller."""

    @property
    def s7_axes(self) -> dict[str, AxisTable]:
        """Axes that are technology objects, by name."""
        return {name: one for name, one in self.axis.items() if isinstance(one, AxisTable)}

    def plc_of(self, name: str) -> str | None:
        """Return which controller of `[controller.NAME]` has an axis or a proxy; None: that of `[bench]`."""
        if name in self.proxy:
            return self.proxy[name].plc
        axis = self.axis.get(name)
        return axis.plc if isinstance(axis, AxisTable) else None

    def cpu_of(self, plc: str | None) -> str:
        """Return what kind of controller that is."""
        other = None if plc is None else self.controller.get(plc)
        return self.bench.cpu if other is None else other.cpu

    @property
    def nc_axes(self) -> dict[str, NcAxisTable]:
        """Axes of an NC, by name."""
        return {name: one for name, one in self.axis.items() if isinstance(one, NcAxisTable)}

    @property
    def devices(self) -> dict[str, DriveTable | EncoderTable | DeviceTable]:
        """Drives, encoders and other devices by name."""
        return {**self.drive, **self.encoder, **self.device}

    @property
    def nodes(self) -> dict[str, CanDriveTable | EncoderTable | DeviceTable]:
        """Drives, encoders and other devices with a CANopen node, by name."""
        return {**self.can_drives, **self.encoder, **self.device}

    @property
    def can_drives(self) -> dict[str, CanDriveTable]:
        """Drives with a CANopen node, by name."""
        return {name: drive for name, drive in self.drive.items() if isinstance(drive, CanDriveTable)}

    def place_of(self, name: str) -> str:
        """Return the table of a node, `drive.x_drive`."""
        kind = "drive" if name in self.drive else "encoder" if name in self.encoder else "device"
        return f"{kind}.{name}"

    @property
    def emulated_names(self) -> tuple[str, ...]:
        """Drives, encoders and other devices that the bench brings."""
        return tuple(name for name, table in self.devices.items() if table.device == "emulated")

    @property
    def emulated_encoders(self) -> tuple[str, ...]:
        """Encoders that the bench brings."""
        return tuple(name for name, table in self.encoder.items() if table.device == "emulated")

    @property
    def moved_drives(self) -> list[str]:
        """Drives that an axis moves, in the order of the axes."""
        return [axis.drive for axis in self.axis.values() if axis.drive]

    @property
    def used_encoders(self) -> set[str]:
        """Encoders that an axis or an external encoder reads."""
        used = {one.encoder for one in self.external_encoder.values()}
        used.update(one.encoder for one in self.nc_axes.values() if one.encoder is not None)
        used.update(name for axis in self.s7_axes.values() for name in axis.encoders or ())
        return used

    def leads(self, segment: str) -> bool:
        """Whether the bench is the controller on a segment: it moves an axis
        there, or nobody else can be there.
        """
        if any(self.drive[drive].segment == segment for drive in self.moved_drives):
            return True
        return not self.bench.live and any(one.segment == segment for one in self.encoder.values())

    def lead_mm(self, encoder: EncoderTable) -> float | None:
        """Return the lead of the screw of the machine that an encoder sits on, mm; None: it sits on none."""
        drive = None if encoder.on is None else self.drive[encoder.on]
        return None if drive is None or drive.machine is None else drive.machine.lead_screw_mm

    def encoders_of_axis(self, name: str) -> tuple[str, ...] | None:
        """Return where the encoders of an axis come from: as it says, or both of telegram 6 and 106
        (CFG-282); None: the drive.
        """
        axis = self.s7_axes[name]
        if axis.encoders is not None or axis.type == "speed" or not axis.drive:
            return axis.encoders
        drive = self.drive[axis.drive]
        if not isinstance(drive, (ProfidriveCanTable, ProfidriveModbusTable)) or not drive.second_encoder:
            return None
        both = encoders_of_telegram(drive.telegram, self.cpu_of(axis.plc)) == 2
        return (axis.drive, second_of(axis.drive)) if both else None

    def wired_variables(self, name: str) -> dict[str, bool | int]:
        """Return the variables of an axis that follow from the wires of its analog drive."""
        drive = self.drive.get(self.axis[name].drive)
        if not isinstance(drive, AnalogDriveTable):
            return {}
        return drive.wired_variables(self.axis[name].drive, self.station)

    def start_values(self, name: str) -> dict[str, object]:
        """Return the start values of the variables of an axis: what it says, and otherwise what follows from
        drive, encoders, switches and wires.
        """
        axis = self.s7_axes[name]
        if not axis.drive:
            return dict(axis.variables)
        drive = self.drive[axis.drive]
        values: dict[str, object] = dict(drive.taken_over())
        if axis.type != "speed":
            if isinstance(drive, WITH_SWITCHES):
                level = not drive.switches.normally_closed
                values |= dict.fromkeys(SWITCH_LEVELS, level)
            encoders = self.encoders_of_axis(name) or (axis.drive,)
            for number, encoder in enumerate(encoders, start=1):
                own = self._values_of_encoder(axis, encoder, f"Sensor[{number}]")
                values |= taken_over_in_unit(own, axis.variables)
        return {**values, **self.wired_variables(name), **axis.variables}

    def variables_of(self, name: str) -> VariableStore:
        """Return the variables of an axis with their start values, also those that follow from ramp times.

        Raises:
            ConfigurationError: They do not fit together.

        """
        axis = self.s7_axes[name]
        values = given_values(self.start_values(name))
        store = VariableStore(OBJECTS[axis.type], values, name=name)
        RampTimes(store, axis.ramp_times, values)
        return store

    def _values_of_encoder(self, axis: AxisTable, encoder: str, sensor: str) -> dict[str, int | float]:
        """Return the variables that follow from an encoder of an axis."""
        drive = self.drive[axis.drive]
        if encoder == axis.drive:
            steps, fine = (
                f"{sensor}.Parameter.{one}" for one in ("StepsPerRevolution", "FineResolutionXist1")
            )
            given = steps in axis.variables or fine in axis.variables
            # One of the two alone says which share of the other is meant: both keep to the axis then.
            counts, bits = drive.increments_per_revolution, drive.fine_resolution_bits
            while counts > _MOST_STEPS and counts % 2 == 0:
                counts, bits = counts // 2, bits + 1
            return {} if given or counts > _MOST_STEPS else {steps: counts, fine: bits}
        if encoder == second_of(axis.drive):
            second = drive.second_encoder
            return {} if second is None else second_encoder_variables(second, sensor)
        return self.encoder[encoder].taken_over(sensor)

    def inputs_of_axis(self, name: str) -> str | None:
        """Return the station to which the switches of an axis are wired; None: those at its drive count."""
        axis = self.s7_axes[name]
        drive = self.drive.get(axis.drive)
        if axis.inputs is None and isinstance(drive, AnalogDriveTable):
            return drive.station(axis.drive, self.station)
        return axis.inputs

    def input_filter_s(self, name: str, switch: str) -> float:
        """Return the filter time of the input at which a switch counts for an axis, s.

        Args:
            name: Axis.
            switch: `negative_limit`, `positive_limit` or `home`.

        """
        drive = self.axis[name].drive
        station = self.station.get(self.inputs_of_axis(name) or "")
        channel = None if station is None else station.wire("digital_inputs", f"{drive}.{switch}")
        if station is not None and channel is not None:
            return station.filter_s(channel)
        table = self.drive.get(drive)
        return table.switches.filter_s(switch) if isinstance(table, WITH_SWITCHES) else 0.0

    @property
    def modbus_drives(self) -> Iterator[tuple[str, ProfidriveModbusTable]]:
        """Drives on Modbus with their names."""
        for name, drive in self.drive.items():
            if isinstance(drive, ProfidriveModbusTable):
                yield name, drive

    @property
    def source_files(self) -> list[Path]:
        """EDS files and register maps that the bench is made of, as far as they are there."""
        names = [drive.eds for drive in self.drive.values() if isinstance(drive, Cia402DriveTable)]
        names += [drive.map for _, drive in self.modbus_drives if drive.map.endswith(".toml")]
        names += [device.eds for device in self.device.values()]
        return [Path(name) for name in names if name is not None and Path(name).is_file()]
