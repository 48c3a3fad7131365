"""An I/O station on Modbus: discrete inputs, coils, input registers, holding registers, and a watchdog."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

from emulators.io._channels import AnalogInput, AnalogOutput, DigitalInput, DigitalOutput
from fieldbus.clock import MS, Scheduler
from fieldbus.errors import ConfigurationError
from fieldbus.modbus import Area, Block, ModbusServer, RegisterMap
from fieldbus.modbus.registers import ReadHook

_MOST: Final = 512


class ModbusIoStation:
    """A station whose channels stand from address 0 on, each kind in its area.

    Digital inputs are discrete inputs, digital outputs coils, analog inputs input registers, analog outputs holding registers.
    Outputs take their substitute values when nothing was written for the watchdog time; the next write counts again.

    Args:
        scheduler: Time.
        digital_inputs: Channels, 0..512.
        digital_outputs: Channels.
        analog_inputs: Channels.
        analog_outputs: Channels.
        unit: Address, 1..247, or None for any.
        watchdog_ms: Watchdog time, ms; 0 for none.

    Attributes:
        server: For `RtuStation`, `TcpStation` or `PtyServer`.

    """

    def __init__(
        self,
        scheduler: Scheduler,
        *,
        digital_inputs: Sequence[DigitalInput] = (),
        digital_outputs: Sequence[DigitalOutput] = (),
        analog_inputs: Sequence[AnalogInput] = (),
        analog_outputs: Sequence[AnalogOutput] = (),
        unit: int | None = 1,
        watchdog_ms: float = 0.0,
    ) -> None:
        if watchdog_ms < 0:
            raise ConfigurationError("I/O station, watchdog_ms", watchdog_ms, "0 or more")
        self._scheduler = scheduler
        self._watchdog_ns = round(watchdog_ms * MS)
        self._written_ns = 0
        self._watching = False
        self.substituted = False
        """Whether the outputs have their substitute values because of the watchdog."""
        self.digital_inputs = tuple(digital_inputs)
        self.digital_outputs = tuple(digital_outputs)
        self.analog_inputs = tuple(analog_inputs)
        self.analog_outputs = tuple(analog_outputs)
        registers = RegisterMap("I/O station")
        for area, channels in (
            (Area.DISCRETE_INPUTS, self.digital_inputs),
            (Area.COILS, self.digital_outputs),
            (Area.INPUT_REGISTERS, self.analog_inputs),
            (Area.HOLDING_REGISTERS, self.analog_outputs),
        ):
            if len(channels) > _MOST:
                raise ConfigurationError(f"I/O station, {area.value}", len(channels), f"at most {_MOST}")
            if channels:
                block = registers.add(area, Block(0, len(channels), name=area.value))
                block.read = self._reader(area)
                if area in (Area.COILS, Area.HOLDING_REGISTERS):
                    block.write = self._write_coils if area is Area.COILS else self._write_registers
        self.server = ModbusServer(registers, unit=unit)

    def _reader(self, area: Area) -> ReadHook:
        if area is Area.DISCRETE_INPUTS:
            return lambda at, count: [int(one.value) for one in self.digital_inputs[at : at + count]]
        if area is Area.COILS:
            return lambda at, count: [int(one.value) for one in self.digital_outputs[at : at + count]]
        if area is Area.INPUT_REGISTERS:
            return lambda at, count: [one.word for one in self.analog_inputs[at : at + count]]
        return lambda at, count: [one.word for one in self.analog_outputs[at : at + count]]

    def _write_coils(self, at: int, values: Sequence[int]) -> None:
        self._seen()
        for channel, value in zip(self.digital_outputs[at:], values, strict=False):
            channel.set(bool(value))

    def _write_registers(self, at: int, values: Sequence[int]) -> None:
        self._seen()
        for channel, value in zip(self.analog_outputs[at:], values, strict=False):
            channel.word = value - 0x10000 if value & 0x8000 else value

    def _seen(self) -> None:
        self.substituted = False
        self._written_ns = self._scheduler.now
        if self._watchdog_ns and not self._watching:
            self._watching = True
            self._scheduler.after(self._watchdog_ns, self._look)

    def _look(self) -> None:
        due_ns = self._written_ns + self._watchdog_ns
        if self._scheduler.now < due_ns:
            self._scheduler.at(due_ns, self._look)
            return
        self._watching = False
        self.substituted = True
        for digital in self.digital_outputs:
            if digital.substitute is not None:
                digital.set(digital.substitute)
        for analog in self.analog_outputs:
            if analog.substitute is not None:
                analog.word = analog.substitute
