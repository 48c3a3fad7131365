"""An I/O station on Modbus: its channels in the four areas and as a process image, with a watchdog and ways
to fail.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import chain
from typing import Any, Final

from emulators.io._channels import AnalogInput, AnalogOutput, CounterInput, DigitalInput, DigitalOutput
from fieldbus.clock import MS, Scheduler
from fieldbus.errors import ConfigurationError
from fieldbus.history import History
from fieldbus.modbus import Area, Block, ModbusServer, RegisterMap
from fieldbus.modbus.io_image import INPUTS, OUTPUTS, IoImage

_MOST: Final = 512
KINDS: Final = ("input", "output", "analog_input", "analog_output", "counter")
"""Names of the kinds of channels."""


class ModbusIoStation:
    """A station whose channels stand from address 0 on, each kind in its area,
    and together in a process image.

    Digital inputs are discrete inputs, digital outputs coils, analog inputs input registers, analog outputs
    holding registers. `fieldbus.modbus.io_image` says where inputs (counters too) and outputs stand as one
    block of holding registers each. Outputs take their substitute values when nothing was written for the
    watchdog time; the next write counts again.

    Args:
        scheduler: Time.
        digital_inputs: Channels, 0..512.
        digital_outputs: Channels.
        analog_inputs: Channels.
        analog_outputs: Channels.
        counters: Counters of encoders.
        unit: Address, 1..247, or None for any.
        watchdog_ms: Watchdog time, ms; 0 for none.
        name: Name in the history.
        history: Log; None for none.

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
        counters: Sequence[CounterInput] = (),
        unit: int | None = 1,
        watchdog_ms: float = 0.0,
        name: str = "station",
        history: History | None = None,
    ) -> None:
        if watchdog_ms < 0:
            raise ConfigurationError("I/O station, watchdog_ms", watchdog_ms, "0 or more")
        self.name = name
        self._history = history
        self._scheduler = scheduler
        self._watchdog_ns = round(watchdog_ms * MS)
        self._written_ns = 0
        self._watching = False
        self.powered = True
        """Whether it has its supply; without it the outputs are off and requests stay unanswered."""
        self.substituted = False
        """Whether the outputs have their substitute values because of the watchdog."""
        self.digital_inputs = list(digital_inputs)
        self.digital_outputs = list(digital_outputs)
        self.analog_inputs = list(analog_inputs)
        self.analog_outputs = list(analog_outputs)
        self.counters = list(counters)
        self._swapped: dict[str, tuple[tuple[int, int], ...]] = {}
        self._wires: dict[str, list[Any]] = {}
        """By kind of channel, while wires are exchanged: how they should be."""
        self.image: Final = IoImage(
            digital_inputs=min(len(self.digital_inputs), _MOST),
            digital_outputs=min(len(self.digital_outputs), _MOST),
            analog_inputs=len(self.analog_inputs),
            analog_outputs=len(self.analog_outputs),
            counters=len(self.counters),
        )
        """Where the channels are in holding registers."""
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
                block.read = _reader(area, channels)
                if area is Area.COILS:
                    block.write = self._write_coils
                elif area is Area.HOLDING_REGISTERS:
                    block.write = self._write_registers
        self._add_image(registers)
        self.server = ModbusServer(registers, unit=unit)
        analog = (
            ("ai", "V", self.analog_inputs),
            ("ao", "V", self.analog_outputs),
            ("count", "inc", self.counters),
        )
        self.trace_columns: Final = (
            ("inputs", ""),
            ("outputs", ""),
            ("powered", ""),
            ("substituted", ""),
            *((f"{short}{number}", unit) for short, unit, every in analog for number in range(len(every))),
        )
        """(name, unit) of the values of `trace_row`."""
        self.trace_enums: Final[dict[str, dict[int, str]]] = {}

    def _add_image(self, registers: RegisterMap) -> None:
        image = self.image
        area = Area.HOLDING_REGISTERS
        if image.input_words:
            inputs = registers.add(area, Block(INPUTS, image.input_words, name="inputs", writable=False))
            inputs.read = lambda at, count: self._input_words()[at : at + count]
        if image.output_words:
            outputs = registers.add(area, Block(OUTPUTS, image.output_words, name="outputs"))
            outputs.read = lambda at, count: self._output_words()[at : at + count]
            outputs.write = self._write_image

    # -- channels --------------------------------------------------------------------------------------

    def input(self, number: int) -> DigitalInput:
        """Return a digital input by its number, from 0 on.

        Raises:
            ConfigurationError: There is no such channel; likewise the methods below.

        """
        return self.channel("input", number)  # type: ignore[no-any-return]  # one of its kind

    def output(self, number: int) -> DigitalOutput:
        """Return a digital output by its number."""
        return self.channel("output", number)  # type: ignore[no-any-return]  # one of its kind

    def analog_input(self, number: int) -> AnalogInput:
        """Return an analog input by its number."""
        return self.channel("analog_input", number)  # type: ignore[no-any-return]  # one of its kind

    def analog_output(self, number: int) -> AnalogOutput:
        """Return an analog output by its number."""
        return self.channel("analog_output", number)  # type: ignore[no-any-return]  # one of its kind

    def counter(self, number: int) -> CounterInput:
        """Return a counter by its number."""
        return self.channel("counter", number)  # type: ignore[no-any-return]  # one of its kind

    def _of(self, kind: str) -> list[Any]:
        lists = (
            self.digital_inputs,
            self.digital_outputs,
            self.analog_inputs,
            self.analog_outputs,
            self.counters,
        )
        if kind not in KINDS:
            raise ConfigurationError(f"{self.name}: kind of channel", kind, ", ".join(KINDS))
        return lists[KINDS.index(kind)]

    def channel(self, kind: str, number: int) -> Any:
        """Return a channel by its kind, one of `KINDS`, and its number."""
        channels = self._of(kind)
        if not 0 <= number < len(channels):
            allowed = f"0..{len(channels) - 1}" if channels else "none, there are no such channels"
            raise ConfigurationError(f"{self.name}: {kind}", number, allowed)
        return channels[number]

    def check_channel(self, kind: str, number: int) -> None:
        """Check that there is a channel.

        Raises:
            ConfigurationError: There is not.

        """
        self.channel(kind, number)

    # -- faults ----------------------------------------------------------------------------------------

    def power_off(self) -> None:
        """Take its supply away: it answers nothing, its outputs are off at once."""
        if not self.powered:
            return
        self.powered = self.server.powered = False
        self._emit("station.power", on=False)
        for digital in self.digital_outputs:
            digital.set(False)
        for analog in self.analog_outputs:
            analog.set(0)

    def power_on(self) -> None:
        """Give the supply back; counters begin at 0."""
        if not self.powered:
            self.powered = self.server.powered = True
            self._emit("station.power", on=True)
            for counter in self.counters:
                counter.restart()

    def hold(self, kind: str, number: int, value: float | None) -> None:
        """Let a channel stand at a value, a level or a quantity in its unit,
        whatever comes; None: it works again.
        """
        channel = self._wired(kind, number)
        if kind in ("input", "output"):
            channel.hold(None if value is None else bool(value))
        elif kind == "counter":
            channel.hold(value is not None)
        else:
            channel.disturbance.stuck = value
            self._refresh(channel)

    def break_wire(self, kind: str, number: int, broken: bool) -> None:
        """Break the wire of a channel, or repair it."""
        channel = self._wired(kind, number)
        if kind in ("analog_input", "analog_output"):
            channel.disturbance.broken = broken
            self._refresh(channel)
        else:
            channel.break_wire(broken)

    def disturb(
        self, kind: str, number: int, *, offset: float = 0.0, gain: float = 1.0, noise: float = 0.0
    ) -> None:
        """Falsify an analog channel: offset and noise in its unit; without arguments it is right again."""
        channel = self._wired(kind, number)
        if kind not in ("analog_input", "analog_output"):
            raise ConfigurationError(f"{self.name}: kind of channel", kind, "analog_input, analog_output")
        channel.disturbance.set_noise(noise)
        channel.disturbance.offset, channel.disturbance.gain = offset, gain
        self._refresh(channel)

    def swap(self, kind: str, first: int, second: int) -> None:
        """Exchange the wires of two channels; again, and they are right."""
        pairs = list(self._swapped.get(kind, ()))
        pair = (first, second)
        if pair in pairs:
            pairs.remove(pair)
        else:
            pairs.append(pair)
        self.rewire(kind, pairs)

    def rewire(self, kind: str, pairs: Sequence[tuple[int, int]]) -> None:
        """Exchange the wires of pairs of channels, one pair after the other, beginning from how they should
        be; without pairs they are right.
        """
        for number in chain.from_iterable(pairs):
            self.channel(kind, number)
        channels = self._of(kind)
        outputs = kind in ("output", "analog_output")
        # The written values stay with the terminals of outputs, the wires behind them change places.
        right = self._wires.setdefault(
            kind, [one.on_change for one in channels] if outputs else list(channels)
        )
        wires = list(right)
        for first, second in pairs:
            wires[first], wires[second] = wires[second], wires[first]
        if outputs:
            for channel, wire in zip(channels, wires, strict=True):
                if channel.on_change is not wire:
                    channel.on_change = wire
                    self._refresh(channel)
        else:
            channels[:] = wires
        self._swapped[kind] = tuple(pairs)
        if not pairs:
            del self._wires[kind]

    def _wired(self, kind: str, number: int) -> Any:
        """Return the channel whose wire should be at a place, wherever it is now."""
        channel = self.channel(kind, number)
        if kind in ("output", "analog_output") or kind not in self._wires:
            return channel
        return self._wires[kind][number]

    @staticmethod
    def _refresh(channel: DigitalOutput | AnalogOutput | AnalogInput) -> None:
        if isinstance(channel, AnalogOutput):
            channel.refresh()
        elif isinstance(channel, DigitalOutput) and channel.on_change is not None:
            channel.on_change(channel.level)

    # -- bus -------------------------------------------------------------------------------------------

    def _input_words(self) -> list[int]:
        return self.image.pack_inputs(
            _bits([one.value for one in self.digital_inputs]),
            [one.word for one in self.analog_inputs],
            [one.count for one in self.counters],
        )

    def _output_words(self) -> list[int]:
        return self.image.pack_outputs(
            _bits([one.value for one in self.digital_outputs]), [one.word for one in self.analog_outputs]
        )

    def _write_image(self, at: int, values: Sequence[int]) -> None:
        words = self._output_words()
        words[at : at + len(values)] = values
        digital, analog = self.image.unpack_outputs(words)
        self._seen()
        for number, output in enumerate(self.digital_outputs):
            output.set(bool(digital >> number & 1))
        for channel, word in zip(self.analog_outputs, analog, strict=True):
            channel.set(word)

    def _write_coils(self, at: int, values: Sequence[int]) -> None:
        self._seen()
        for channel, value in zip(self.digital_outputs[at:], values, strict=False):
            channel.set(bool(value))

    def _write_registers(self, at: int, values: Sequence[int]) -> None:
        self._seen()
        for channel, value in zip(self.analog_outputs[at:], values, strict=False):
            channel.set(value - 0x10000 if value & 0x8000 else value)

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
        self._emit("station.substituted")
        for digital in self.digital_outputs:
            if digital.substitute is not None:
                digital.set(digital.substitute)
        for analog in self.analog_outputs:
            if analog.substitute is not None:
                analog.set(analog.substitute)

    # -- evidence --------------------------------------------------------------------------------------

    def trace_row(self) -> tuple[float, ...]:
        """Return the present values of `trace_columns`: inputs behind their filter, outputs at the end of
        their wires.
        """
        return (
            _bits([one.value for one in self.digital_inputs]),
            _bits([one.level for one in self.digital_outputs]),
            self.powered,
            self.substituted,
            *[one.smoothed for one in self.analog_inputs],
            *[one.value for one in self.analog_outputs],
            *[one.count for one in self.counters],
        )

    def _emit(self, kind: str, **data: str | float | bool) -> None:
        if self._history is not None:
            self._history.emit(self.name, kind, **data)


def _bits(levels: Sequence[bool]) -> int:
    value = 0
    for number, level in enumerate(levels):
        if level:
            value |= 1 << number
    return value


def _reader(area: Area, channels: list[Any]) -> Callable[[int, int], list[int]]:
    if area in (Area.DISCRETE_INPUTS, Area.COILS):
        return lambda at, count: [int(one.value) for one in channels[at : at + count]]
    return lambda at, count: [one.word for one in channels[at : at + count]]
