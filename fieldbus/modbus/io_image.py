"""Process image of an I/O station in holding registers, so that one request (function 23) brings outputs and
fetches inputs.

Digital channels stand sixteen to a register, channel 0 in bit 0, then one register for each analog channel,
then two for each counter, high word first. Inputs begin at `INPUTS`, outputs at `OUTPUTS`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

from fieldbus.errors import ConfigurationError
from fieldbus.modbus.codes import Function
from fieldbus.modbus.pdu import Request

INPUTS: Final = 0x1000
"""First register of the inputs."""
OUTPUTS: Final = 0x2000
"""First register of the outputs."""
_MOST_INPUTS: Final = 125
_MOST_OUTPUTS: Final = 121
"""Registers that fit into one request of function 23."""
_PER_REGISTER: Final = 16


@dataclass(frozen=True, kw_only=True)
class IoImage:
    """How many channels of each kind there are, and where they stand.

    Raises:
        ConfigurationError: The image does not fit into one request.

    """

    digital_inputs: int = 0
    digital_outputs: int = 0
    analog_inputs: int = 0
    analog_outputs: int = 0
    counters: int = 0

    def __post_init__(self) -> None:
        for name, words, most in (
            ("inputs", self.input_words, _MOST_INPUTS),
            ("outputs", self.output_words, _MOST_OUTPUTS),
        ):
            if words > most:
                raise ConfigurationError(f"process image, {name}", f"{words} registers", f"at most {most}")

    @property
    def input_words(self) -> int:
        """Registers of the inputs."""
        return -(-self.digital_inputs // _PER_REGISTER) + self.analog_inputs + 2 * self.counters

    @property
    def output_words(self) -> int:
        """Registers of the outputs."""
        return -(-self.digital_outputs // _PER_REGISTER) + self.analog_outputs

    def request(self, outputs: Sequence[int]) -> Request | None:
        """Return the request that writes the outputs and reads the inputs; None: there are no channels."""
        inputs = self.input_words
        if inputs and outputs:
            return Request(
                Function.READ_WRITE_MULTIPLE_REGISTERS, INPUTS, inputs, tuple(outputs), write_address=OUTPUTS
            )
        if inputs:
            return Request(Function.READ_HOLDING_REGISTERS, INPUTS, inputs)
        if outputs:
            return Request(Function.WRITE_MULTIPLE_REGISTERS, OUTPUTS, len(outputs), tuple(outputs))
        return None

    def pack_outputs(self, digital: int, analog: Sequence[int]) -> list[int]:
        """Return the registers of the outputs; bit n of `digital` is channel
        n, analog words may be negative.
        """
        return [*_registers(digital, self.digital_outputs), *(word & 0xFFFF for word in analog)]

    def unpack_outputs(self, words: Sequence[int]) -> tuple[int, list[int]]:
        """Return the digital outputs as a number and the analog words, signed."""
        count = -(-self.digital_outputs // _PER_REGISTER)
        return _number(words[:count]), [_signed(word) for word in words[count:]]

    def pack_inputs(self, digital: int, analog: Sequence[int], counters: Sequence[int]) -> list[int]:
        """Return the registers of the inputs; counters count modulo 2^32."""
        words = [*_registers(digital, self.digital_inputs), *(word & 0xFFFF for word in analog)]
        for value in counters:
            words += (value >> 16 & 0xFFFF, value & 0xFFFF)
        return words

    def unpack_inputs(self, words: Sequence[int]) -> tuple[int, list[int], list[int]]:
        """Return the digital inputs as a number, the analog words and the counters, signed."""
        first = -(-self.digital_inputs // _PER_REGISTER)
        behind = first + self.analog_inputs
        counters = [
            _signed(words[at]) << 16 | words[at + 1] for at in range(behind, behind + 2 * self.counters, 2)
        ]
        return _number(words[:first]), [_signed(word) for word in words[first:behind]], counters


def _registers(bits: int, channels: int) -> list[int]:
    return [bits >> at & 0xFFFF for at in range(0, channels, _PER_REGISTER)]


def _number(words: Sequence[int]) -> int:
    value = 0
    for place, word in enumerate(words):
        value |= word << _PER_REGISTER * place
    return value


def _signed(word: int) -> int:
    return word - 0x10000 if word & 0x8000 else word
