"""A register map as the controller sees it: where the telegram goes, and with which requests."""

from __future__ import annotations

from dataclasses import dataclass, field
from struct import Struct
from typing import Final

from fieldbus.errors import ConfigurationError
from fieldbus.modbus.codes import LIMITS, MOST_WRITTEN_WHEN_READING, Function
from fieldbus.modbus.map_file import BlockFile, MapFile
from fieldbus.modbus.pdu import Request
from fieldbus.profidrive import Telegram

_READ: Final = int(Function.READ_HOLDING_REGISTERS)
_WRITE: Final = int(Function.WRITE_MULTIPLE_REGISTERS)
_BOTH: Final = int(Function.READ_WRITE_MULTIPLE_REGISTERS)
_TIMEOUT, _INPUTS, _FAULTS = 2040, 722, 947


@dataclass(frozen=True)
class ProcessDataRegisters:
    """Requests for the process data of a drive.

    Args:
        setpoints: Address on the wire of the first word to the drive.
        actual_values: Address on the wire of the first word from it.
        telegram: The telegram.
        low_word_first: Of double words the low word stands first, in the time-out too.
        combined: Function 23 is allowed: one request for both directions, written first (MODB-020).
        timeout: Address and number of registers of the time-out of the process
            data, ms; None = there is none.
        inputs: Addresses of the digital inputs, one register each from bit 0 on; empty = there are none.
        fault_number: Address of the number of the oldest fault; None = there is none.
        parameters: Address of the control word of the parameter channel (data
            record 47); None = there is none.

    """

    setpoints: int
    actual_values: int
    telegram: Telegram
    low_word_first: bool = False
    combined: bool = False
    timeout: tuple[int, int] | None = None
    inputs: tuple[int, int] | None = None
    fault_number: int | None = None
    parameters: int | None = None
    _places: tuple[tuple[int, ...], tuple[int, ...]] = field(init=False, repr=False)
    _words: tuple[Struct, Struct] = field(init=False, repr=False)

    def __post_init__(self) -> None:
        layouts = (self.telegram.setpoint, self.telegram.actual)
        places = tuple(layout.places(low_word_first=self.low_word_first) for layout in layouts)
        object.__setattr__(self, "_places", places)
        object.__setattr__(self, "_words", tuple(Struct(f">{layout.words}H") for layout in layouts))

    @property
    def words_out(self) -> int:
        """Words of the telegram to the drive."""
        return self.telegram.setpoint.words

    @property
    def words_in(self) -> int:
        """Words of the telegram from the drive."""
        return self.telegram.actual.words

    def write(self, frame: bytes) -> Request:
        """Return the request that writes a telegram, words with the high byte first; one of a wrong length as
        it is.
        """
        words = self._registers(frame)
        return Request(_WRITE, self.setpoints, len(words), words)

    def read(self) -> Request:
        """Return the request that reads the actual values."""
        return Request(_READ, self.actual_values, self.words_in)

    def exchange(self, frame: bytes) -> Request:
        """Return the request that writes a telegram and reads the actual values."""
        return Request(_BOTH, self.actual_values, self.words_in, self._registers(frame), self.setpoints)

    def write_timeout(self, milliseconds: int) -> Request | None:
        """Return the request that sets the time-out of the process data; None where the map has none."""
        if self.timeout is None:
            return None
        address, count = self.timeout
        if count == 1:
            return Request(_WRITE, address, 1, (min(milliseconds, 0xFFFF),))
        words = (milliseconds & 0xFFFF, milliseconds >> 16)
        return Request(_WRITE, address, 2, words if self.low_word_first else words[::-1])

    def read_inputs(self) -> Request | None:
        """Return the request that reads the digital inputs; None where the map has none."""
        return None if self.inputs is None else Request(_READ, *self.inputs)

    def read_fault_number(self) -> Request | None:
        """Return the request that reads the number of the oldest fault; None where the map has none."""
        return None if self.fault_number is None else Request(_READ, self.fault_number, 1)

    def frame(self, values: tuple[int, ...], *, setpoints: bool = False) -> bytes:
        """Return the telegram that is in registers, words with the high byte first.

        Args:
            values: All words of the telegram.
            setpoints: Whether it is that to the drive.

        """
        direction = 0 if setpoints else 1
        return self._words[direction].pack(*[values[place] for place in self._places[direction]])

    def _registers(self, frame: bytes) -> tuple[int, ...]:
        layout = self._words[0]
        if len(frame) == layout.size:
            words = layout.unpack(frame)
            return tuple([words[place] for place in self._places[0]])
        count = len(frame) // 2
        return Struct(f">{count}H").unpack(frame[: 2 * count])


def process_data(file: MapFile, telegram: Telegram, *, name: str = "") -> ProcessDataRegisters:
    """Return the requests for a telegram behind a register map.

    Args:
        file: The map.
        telegram: The telegram, with its supplements.
        name: Its name, for messages.

    Raises:
        ConfigurationError: The map has no process data, fewer words than the telegram, or allows no
            fitting function.

    """
    blocks = {block.hook: block for block in file.block if block.hook is not None}
    words_out, words_in = telegram.setpoint.words, telegram.actual.words
    for hook, words in (("setpoints", words_out), ("actual_values", words_in)):
        if hook not in blocks:
            raise ConfigurationError(f"register map {file.name}", f"no {hook}", "a map with process data")
        if blocks[hook].count < words:
            raise ConfigurationError(
                name or f"telegram {telegram.number}",
                f"{words} words of {hook}",
                f"at most {blocks[hook].count} in the map {file.name}",
            )
    limits = {**LIMITS, **file.limits}
    functions = set(file.functions)
    combined = _BOTH in functions and words_out <= MOST_WRITTEN_WHEN_READING and words_in <= limits[_BOTH]
    if not combined and not {_READ, _WRITE} <= functions:
        raise ConfigurationError(
            f"register map {file.name}", f"functions {sorted(functions)}", "23, or 3 and 16"
        )

    def address(block: BlockFile) -> int:
        return block.register_ - file.first

    found = {block.parameter: block for block in file.block if block.parameter is not None}
    timeout, inputs, faults = (found.get(number) for number in (_TIMEOUT, _INPUTS, _FAULTS))
    if _WRITE not in functions or (timeout is not None and not timeout.writable):
        timeout = None
    return ProcessDataRegisters(
        setpoints=address(blocks["setpoints"]),
        actual_values=address(blocks["actual_values"]),
        telegram=telegram,
        low_word_first=file.word_order == "low_first",
        combined=combined,
        timeout=None if timeout is None else (address(timeout), timeout.words),
        inputs=None if inputs is None or _READ not in functions else (address(inputs), inputs.count),
        fault_number=None if faults is None or _READ not in functions else address(faults),
        parameters=address(blocks["ds47"]) if "ds47" in blocks and {_READ, _WRITE} <= functions else None,
    )
