"""The emulated devices of a bench file in one process: drives, I/O stations,
encoders, devices made of an EDS.

A bench in virtual time holds them itself; for a live bench they are in the
drive process (`hil.bench.drive_host`).
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Final, TypeAlias

from numpy.random import Generator, SeedSequence, default_rng

from fieldbus.clock import MS
from fieldbus.errors import ErrorCollector
from hil.bench._site import DeviceSite
from hil.bench.drive_config import ProfidriveCanTable, ProfidriveModbusTable

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from emulators.drive.analog import AnalogDrive
    from emulators.drive.cia402 import CiA402Drive
    from emulators.drive.profidrive import ProfidriveCanDrive
    from emulators.drive.profidrive.modbus import ProfidriveModbusDrive
    from emulators.drive.profidrive.second_encoder import SecondEncoder
    from emulators.drive.stepper_can import StepperCanDrive
    from emulators.drive.two_speed import TwoSpeedDrive
    from emulators.encoder.cia406 import CiA406Encoder
    from emulators.encoder.profidrive.can import ProfidriveCanEncoder
    from emulators.io import ModbusIoStation
    from emulators.station import CanopenDevice
    from fieldbus.can.segment import CanSegment
    from fieldbus.canopen.nmt import NmtState
    from fieldbus.clock import Scheduler
    from fieldbus.history import History
    from hil.bench.config import BenchConfig
    from hil.bench.modbus_links import ModbusDevice
    from hil.record import Recorder

    EmulatedDrive: TypeAlias = (
        CiA402Drive
        | ProfidriveCanDrive
        | ProfidriveModbusDrive
        | AnalogDrive
        | TwoSpeedDrive
        | StepperCanDrive
    )
    EmulatedEncoder: TypeAlias = CiA406Encoder | ProfidriveCanEncoder
    EmulatedPart: TypeAlias = (
        EmulatedDrive | EmulatedEncoder | SecondEncoder | CanopenDevice | ModbusIoStation
    )
    Recorded: TypeAlias = EmulatedDrive | EmulatedEncoder | ModbusIoStation

_SAMPLE_PRIORITY: Final = 100


def named_rng(seed: int, name: str) -> Generator:
    """Return the random stream of component `name` in a run with `seed`."""
    return default_rng(SeedSequence([seed & 0xFFFFFFFFFFFFFFFF, *name.encode()]))


@dataclass
class EmulatedDevices:
    """Emulated devices by name."""

    drives: dict[str, EmulatedDrive] = field(default_factory=dict)
    second_encoders: dict[str, SecondEncoder] = field(default_factory=dict)
    """Second encoders of drives, by `DRIVE.encoder2`."""
    stations: dict[str, ModbusIoStation] = field(default_factory=dict)
    encoders: dict[str, EmulatedEncoder] = field(default_factory=dict)
    """Encoders with a node of their own."""
    devices: dict[str, CanopenDevice] = field(default_factory=dict)
    """Devices that are made of their EDS alone."""

    def find(self, name: str) -> EmulatedPart | None:
        """Return a drive, an encoder, a device or an I/O station by name; None: there is none."""
        return (
            self.drives.get(name)
            or self.stations.get(name)
            or self.encoders.get(name)
            or self.devices.get(name)
            or self.second_encoders.get(name)
        )

    def power_on(self) -> None:
        """Switch on drives, encoders and devices."""
        for part in (*self.drives.values(), *self.encoders.values(), *self.devices.values()):
            part.power_on()

    def power_off(self) -> None:
        """Switch off drives, encoders and devices."""
        for part in (*self.drives.values(), *self.encoders.values(), *self.devices.values()):
            part.power_off()

    def nmt_states(self) -> list[NmtState]:
        """Return the NMT states of all that have a node on CANopen."""
        parts = (*self.drives.values(), *self.encoders.values(), *self.devices.values())
        return [part.slave.nmt_state for part in parts if hasattr(part, "slave")]


class DeviceBuilder:
    """Builds the emulated devices of a bench file, still switched off, and records them in every bus cycle.

    Args:
        config: The bench file.
        scheduler: Time of the devices.
        history: Their event log.
        recorder: Samples them; None: nothing is recorded.
        seed: Seed of their random streams.

    """

    def __init__(
        self,
        config: BenchConfig,
        scheduler: Scheduler,
        *,
        history: History,
        recorder: Recorder | None,
        seed: int,
    ) -> None:
        self._config = config
        self._scheduler = scheduler
        self._history = history
        self._recorder = recorder
        self._seed = seed

    def build(
        self, segments: Mapping[str, CanSegment], attach: Callable[[str, str, ModbusDevice], object]
    ) -> EmulatedDevices:
        """Return the devices.

        Args:
            segments: CAN segments, by name.
            attach: Puts a device on Modbus on its bus; gets the names of segment and device, and the device.

        """
        config, devices, errors = self._config, EmulatedDevices(), ErrorCollector()
        for name, section in config.drive.items():
            if section.device == "emulated":
                with errors.located(f"drive.{name}"):
                    self._build_drive(devices, name, segments, attach)
        errors.check()  # what follows needs the drives
        for name in config.station:
            with errors.located(f"station.{name}"):
                self._build_station(devices, name, segments, attach)
        self._build_encoders(devices, segments, errors)
        for name, device in config.device.items():
            with errors.located(f"device.{name}"):
                devices.devices[name] = device.build(self._site(name, segments))
        errors.check()
        return devices

    def _build_drive(
        self,
        devices: EmulatedDevices,
        name: str,
        segments: Mapping[str, CanSegment],
        attach: Callable[[str, str, ModbusDevice], object],
    ) -> None:
        section = self._config.drive[name]
        drive = devices.drives[name] = section.build(self._site(name, segments))
        self._record(name, drive)
        if not isinstance(section, ProfidriveCanTable | ProfidriveModbusTable):
            return
        from emulators.drive.profidrive import ProfidriveCanDrive
        from emulators.drive.profidrive.modbus import ProfidriveModbusDrive

        if isinstance(drive, ProfidriveModbusDrive):
            attach(section.segment, name, drive)
        if isinstance(drive, ProfidriveCanDrive | ProfidriveModbusDrive) and drive.second_encoder is not None:
            devices.second_encoders[f"{name}.encoder2"] = drive.second_encoder

    def _build_station(
        self,
        devices: EmulatedDevices,
        name: str,
        segments: Mapping[str, CanSegment],
        attach: Callable[[str, str, ModbusDevice], object],
    ) -> None:
        section = self._config.station[name]
        wired = section.build(self._site(name, segments), devices.drives)
        attach(section.segment, name, wired)
        devices.stations[name] = wired.station
        self._record(name, wired.station)

    def _build_encoders(
        self, devices: EmulatedDevices, segments: Mapping[str, CanSegment], errors: ErrorCollector
    ) -> None:
        for name in self._config.emulated_encoders:
            section = self._config.encoder[name]
            with errors.located(f"encoder.{name}"):
                machine = None if section.on is None else devices.drives[section.on].mechanics
                encoder = devices.encoders[name] = section.build(
                    self._site(name, segments), machine, self._config.lead_mm(section)
                )
                self._record(name, encoder)

    def _site(self, name: str, segments: Mapping[str, CanSegment]) -> DeviceSite:
        return DeviceSite(
            name=name,
            bench=self._config.bench,
            scheduler=self._scheduler,
            segments=segments,
            history=self._history,
            rng=named_rng(self._seed, name),
        )

    def _record(self, name: str, part: Recorded) -> None:
        """Record a device whatever its state on the bus, after the events of the instant."""
        if self._recorder is None:
            return
        group = self._recorder.add_group(name, part.trace_columns, part.trace_row, enums=part.trace_enums)
        self._scheduler.every(self._config.bench.cycle_ms * MS, group.sample, priority=_SAMPLE_PRIORITY)
