"""`[station.NAME]` of a bench file: an emulated I/O station, its wires, and the controller's side of it."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Annotated, Final, Literal

from pydantic import Field, model_validator

from emulators.input_filter import INPUT_FILTER_MS
from fieldbus.clock import MS
from hil.bench._table import Port, Table

if TYPE_CHECKING:
    from emulators.drive.analog import AnalogDrive
    from emulators.drive.emulated_drive import EmulatedDrive
    from emulators.io import CounterInput, DigitalInput, ModbusIoStation
    from fieldbus.clock import Scheduler
    from fieldbus.history import History
    from fieldbus.modbus import (
        ConnectionLimits,
        PtyServer,
        SerialFormat,
        SerialLine,
        SocketNetwork,
        TcpLink,
    )
    from fieldbus.modbus.io_image import IoImage
    from hil.bench._site import DeviceSite
    from hil.bench.modbus_links import ModbusSegment
    from hil.bench.segment_config import TcpTable
    from motion.drives.station import StationInputs, StationLink

LIMITS: Final = ("negative_limit", "positive_limit", "home")
"""Terminals of a drive that are switches of an axis."""
_FilterMs = Annotated[float, Field(ge=0.0, le=1000.0)]
Channels = Literal["digital_inputs", "digital_outputs", "analog_outputs", "counters"]


class WiredStation:
    """An emulated station for a Modbus segment: it can be put on a network or a line.

    Args:
        scheduler: Time of the bench.
        station: The station.
        processing_ns: From a request to its response, ns.

    """

    def __init__(self, scheduler: Scheduler, station: ModbusIoStation, *, processing_ns: int) -> None:
        self._scheduler = scheduler
        self.station = station
        self._processing_ns = processing_ns
        self._terminal: PtyServer | None = None

    def listen(self, network: TcpLink | SocketNetwork, *, limits: ConnectionLimits) -> None:
        """Answer on a network."""
        from fieldbus.modbus import TcpStation

        TcpStation(
            self._scheduler,
            network,
            self.station.server,
            processing_ns=self._processing_ns,
            limits=limits,
        )

    def open_terminal(self, form: SerialFormat) -> PtyServer:
        """Open a pseudo-terminal that any program takes for its serial port (`path`).

        Raises:
            OSError: The system has no pseudo-terminal left.

        """
        from fieldbus.modbus import PtyServer

        self._terminal = PtyServer(
            self._scheduler, self.station.server, format_=form, processing_ns=self._processing_ns
        )
        return self._terminal

    def close(self) -> None:
        """Take the pseudo-terminal away, if there is one; harmless to repeat."""
        if self._terminal is not None:
            self._terminal.close()

    def attach(self, line: SerialLine) -> None:
        """Answer on a serial line."""
        from fieldbus.modbus import RtuStation

        RtuStation(
            self._scheduler,
            line,
            self.station.server,
            name=self.station.name,
            processing_ns=self._processing_ns,
        )


class StationTable(Table, frozen=True):
    """`[station.NAME]`: an emulated I/O station on a Modbus segment."""

    segment: str
    """Name of the Modbus segment to which it is connected."""
    unit: Annotated[int, Field(ge=1, le=247)] = 1
    """Address; each once on a serial line."""
    host: Annotated[str, Field(min_length=1)] | None = None
    """Host of this station on a live network; none: as the segment says."""
    port: Port | None = None
    """TCP port of this station on a live network; none: that of the segment."""
    digital_inputs: tuple[str, ...] = ()
    """Per channel `DRIVE.negative_limit`, `.positive_limit`, `.home`, `.probe1`, `.probe2`, of an analog
    drive `.ready`; `""` = nothing.
    """
    digital_outputs: tuple[str, ...] = ()
    """`DRIVE.enable` of an analog drive, or a terminal of a drive with two speeds, or nothing."""
    analog_inputs: Annotated[int, Field(ge=0, le=16)] = 0
    """Number of inputs for ±10 V."""
    analog_outputs: tuple[str, ...] = ()
    """`DRIVE.setpoint` of an analog drive, or nothing; ±10 V."""
    counters: tuple[str, ...] = ()
    """`DRIVE.encoder`, or nothing."""
    input_filter_ms: _FilterMs = INPUT_FILTER_MS
    """Filter of the digital inputs: a level counts when it has been stable for this long."""
    input_filters_ms: tuple[_FilterMs, ...] = ()
    """Filter of each channel of `digital_inputs` on its own; left out: `input_filter_ms`."""
    watchdog_ms: Annotated[float, Field(ge=0.0, le=60_000.0)] = 100.0
    """Time without a request that writes after which the outputs are off; 0 = never."""
    processing_ms: Annotated[float, Field(ge=0.0, le=1000.0)] = 0.2
    """From a request to its response."""

    @model_validator(mode="after")
    def _one_filter_each(self) -> StationTable:
        if self.input_filters_ms and len(self.input_filters_ms) != len(self.digital_inputs):
            raise ValueError(
                f"input_filters_ms: {len(self.input_filters_ms)} values; allowed: one for each of the "
                f"{len(self.digital_inputs)} digital_inputs"
            )
        return self

    def address(self, segment: TcpTable) -> tuple[str, int]:
        """Return host and port on a live network."""
        return self.host or segment.host, segment.port if self.port is None else self.port

    def image(self) -> IoImage:
        """Return where the channels stand in the process image."""
        from fieldbus.modbus.io_image import IoImage

        return IoImage(
            digital_inputs=len(self.digital_inputs),
            digital_outputs=len(self.digital_outputs),
            analog_inputs=self.analog_inputs,
            analog_outputs=len(self.analog_outputs),
            counters=len(self.counters),
        )

    @property
    def wires(self) -> dict[Channels, tuple[str, ...]]:
        """What is wired to each channel, by kind of channel."""
        return {
            "digital_inputs": self.digital_inputs,
            "digital_outputs": self.digital_outputs,
            "analog_outputs": self.analog_outputs,
            "counters": self.counters,
        }

    def wire(self, channels: Channels, terminal: str) -> int | None:
        """Return the number of the channel that a terminal is wired to; None: to none."""
        wires = self.wires[channels]
        return wires.index(terminal) if terminal in wires else None

    def filter_s(self, channel: int) -> float:
        """Return the filter time of a digital input, s.

        Args:
            channel: Its number, from 0.

        """
        own = self.input_filters_ms
        return (own[channel] if own else self.input_filter_ms) / 1000.0

    def build(self, site: DeviceSite, drives: Mapping[str, EmulatedDrive]) -> WiredStation:
        """Return the station, wired to the drives.

        Args:
            site: Where it works.
            drives: Emulated drives by name.

        """
        from emulators.io import AnalogInput, AnalogOutput, DigitalOutput, ModbusIoStation

        analog = {wire: _analog(wire, drives) for wire in self.analog_outputs if wire}
        station = ModbusIoStation(
            site.scheduler,
            digital_inputs=[
                self._input(site.scheduler, channel, wire, drives)
                for channel, wire in enumerate(self.digital_inputs)
            ],
            digital_outputs=[
                DigitalOutput(_switched(wire, drives) if wire else None) for wire in self.digital_outputs
            ],
            analog_inputs=[
                AnalogInput(site.scheduler, 0.0, 10.0, bipolar=True, rng=site.rng)
                for _ in range(self.analog_inputs)
            ],
            analog_outputs=[
                AnalogOutput(0.0, 10.0, on_change=analog[wire].set_voltage if wire else None, rng=site.rng)
                for wire in self.analog_outputs
            ],
            counters=[_counter(wire, drives) for wire in self.counters],
            unit=self.unit,
            watchdog_ms=self.watchdog_ms,
            name=site.name,
            history=site.history,
        )
        return WiredStation(site.scheduler, station, processing_ns=round(self.processing_ms * MS))

    def _input(
        self, scheduler: Scheduler, number: int, wire: str, drives: Mapping[str, EmulatedDrive]
    ) -> DigitalInput:
        from emulators.io import DigitalInput

        channel = DigitalInput(scheduler, filter_ms=self.filter_s(number) * 1000.0)
        drive, _, terminal = wire.partition(".")
        if terminal == "ready":
            _analog(wire, drives).on_ready.append(channel.set)
        elif terminal:
            drives[drive].digital_inputs.follow(terminal, channel.set)
        return channel

    def build_link(
        self,
        name: str,
        segment: ModbusSegment,
        *,
        grace_cycles: int,
        history: History,
    ) -> StationLink:
        """Return the controller's side of the station."""
        from motion.drives.station import StationLink

        return StationLink(
            segment.client(name),
            self.image(),
            unit=self.unit,
            grace_cycles=grace_cycles,
            name=name,
            history=history,
        )

    def axis_inputs(self, drive: str, link: StationLink) -> StationInputs | None:
        """Return the limit and home switches of a drive that are wired here; None: there are none."""
        from motion.drives.station import StationInputs

        wires = {one: self.wire("digital_inputs", f"{drive}.{one}") for one in LIMITS}
        channels = {one: number for one, number in wires.items() if number is not None}
        return StationInputs(link, channels) if channels else None


def _counter(wire: str, drives: Mapping[str, EmulatedDrive]) -> CounterInput:
    from emulators.drive.emulated_drive import ServoDrive
    from emulators.io import CounterInput

    if not wire:
        return CounterInput()
    drive = drives[wire.partition(".")[0]]
    if isinstance(drive, ServoDrive):
        encoder = drive.core.encoder
        return CounterInput(lambda: encoder.increments)
    from emulators.drive.stepper_can import StepperCanDrive

    assert isinstance(drive, StepperCanDrive)  # what else has an encoder output
    return CounterInput(drive.emitted_count)


def _switched(wire: str, drives: Mapping[str, EmulatedDrive]) -> Callable[[bool], object]:
    """Return what a digital output switches at a drive."""
    from emulators.drive.two_speed import TwoSpeedDrive

    name, _, terminal = wire.partition(".")
    drive = drives[name]
    if isinstance(drive, TwoSpeedDrive):
        return lambda level: drive.set_terminal(terminal, level)
    return _analog(wire, drives).set_enable


def _analog(wire: str, drives: Mapping[str, EmulatedDrive]) -> AnalogDrive:
    from emulators.drive.analog import AnalogDrive

    drive = drives[wire.partition(".")[0]]
    assert isinstance(drive, AnalogDrive)  # what else has such a terminal
    return drive
