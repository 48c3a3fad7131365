"""From increments of the encoder model to Gx_XIST1, Gx_XIST2, G1_XIST3."""

from __future__ import annotations

from typing import Protocol

from emulators.encoder._encoder import ZeroMarkListener
from emulators.encoder.profidrive.format import EncoderFormat
from fieldbus.errors import ConfigurationError


class PositionSource(Protocol):
    """What counts: an encoder model, or a counter of pulses."""

    @property
    def counts_per_revolution(self) -> int:
        """Increments per revolution."""

    @property
    def increments(self) -> int:
        """Present position, whole increments, not wrapped."""

    def watch_zero_mark(self, listener: ZeroMarkListener) -> None:
        """Call `listener` at every zero mark from now on."""

    def unwatch_zero_mark(self, listener: ZeroMarkListener) -> None:
        """Call `listener` no more."""


def signed32(value: int) -> int:
    """Return the low 32 bits as a signed number, as the words of a telegram hold them."""
    value &= 0xFFFF_FFFF
    return value - 0x1_0000_0000 if value & 0x8000_0000 else value


def _shifted(counts: int, by: int) -> int:
    return counts << by if by >= 0 else counts >> -by


class Counting:
    """The numbers behind the encoder interface.

    Args:
        encoder: The model; its increments per revolution have to be those of the format.
        form: The format.

    Raises:
        ConfigurationError: The encoder does not count as the format says.

    """

    def __init__(self, encoder: PositionSource, form: EncoderFormat) -> None:
        if encoder.counts_per_revolution != form.counts:
            raise ConfigurationError(
                "encoder format periods",
                form.periods,
                f"{encoder.counts_per_revolution} increments of the encoder, "
                f"divided by 2^{form.interpolation_bits} (interpolation_bits)",
            )
        self._encoder = encoder
        self._form = form
        self._fine1 = form.shift_xist1 - form.interpolation_bits
        self._fine2 = form.shift_xist2 - form.interpolation_bits
        self._mask = (1 << form.counter_bits) - 1
        self._range = form.revolutions * form.counts
        self.home = 0
        """Shift of the absolute value by the home position, increments; survives a power cycle."""
        self.power_on()

    def power_on(self) -> None:
        """Let Gx_XIST1 begin where the format says, at the present increments."""
        now = self._encoder.increments
        if self._form.load_absolute:
            self._base = _shifted((now + self.home) % self._range - now, self._fine1)
        else:
            self._base = self._form.start_value - _shifted(now, self._fine1)

    def xist1(self) -> int:
        """Return the present Gx_XIST1."""
        fine = self._fine1
        increments = self._encoder.increments
        value = (
            (increments << fine if fine >= 0 else increments >> -fine) + self._base & self._mask & 0xFFFF_FFFF
        )
        return value - 0x1_0000_0000 if value & 0x8000_0000 else value

    def in_xist1(self, increments: int) -> int:
        """Return what Gx_XIST1 is at a position, increments of the model; signed 32-bit."""
        return signed32(_shifted(increments, self._fine1) + self._base & self._mask)

    def xist2(self) -> int:
        """Return the absolute value in the format of Gx_XIST2, signed 32-bit; only for absolute encoders."""
        return signed32(_shifted((self._encoder.increments + self.home) % self._range, self._fine2))

    def xist3(self) -> int:
        """Return the counter with the fine bits of Gx_XIST1 and 64 bits, signed."""
        value = _shifted(self._encoder.increments, self._fine1) + self._base & 0xFFFF_FFFF_FFFF_FFFF
        return value - (1 << 64) if value >> 63 else value

    def set_home(self, steps: int, *, relative: bool, with_counter: bool) -> None:
        """Make the present position `steps`, or shift it by `steps` (lines or steps, not fine ones).

        Args:
            steps: Home position.
            relative: Shift by it.
            with_counter: Move Gx_XIST1 as well, as the encoder profile does.

        """
        now = self._encoder.increments
        shift = steps << self._form.interpolation_bits
        if self._form.absolute:
            before = self.home
            self.home = (before + shift if relative else shift - now) % self._range
        if with_counter:
            fine = _shifted(shift, self._fine1)
            self._base = self._base + fine if relative else fine - _shifted(now, self._fine1)
