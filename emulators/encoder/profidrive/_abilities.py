"""States of the encoder interface, and what it can do."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

from fieldbus.errors import ConfigurationError


class EncoderState(Enum):
    """States of the interface."""

    SD1 = "normal operation"
    SD2 = "error is being acknowledged"
    SD3 = "error"
    SD4 = "reference value is shown"
    SD5 = "waiting for the reference mark"
    SD7 = "home position is set or shifted"
    SD10 = "waiting for measured values"
    SD11 = "measured value is shown"
    SD12 = "parking"


@dataclass(frozen=True, kw_only=True)
class EncoderAbilities:
    """What an encoder interface can do.

    Args:
        reference_marks: Functions 1.. of reference mark search, 0..4. The first is the zero mark of the
            encoder, others are brought by `EncoderInterface.reference_mark`.
        measuring: Functions 1.. of measurement on the fly, 0..4: rising and falling edge of probe 1, then
            of probe 2.
        home: The home position can be set and shifted.
        parking: The encoder can be parked; False: the request ends with error 0003h.
        preset_counter: The home position moves Gx_XIST1 too, as in the encoder profile (PD-171).
        absolute_at_start: The absolute value is shown until the first control word comes (PD-170).
        zero_mark_tolerance: None: the zero mark is not monitored; else the increments by which two zero
            marks may differ from a whole number of revolutions before error 0002h comes, >= 0.

    Raises:
        ConfigurationError: A value is out of its range.

    """

    reference_marks: int = 1
    measuring: int = 4
    home: bool = True
    parking: bool = True
    preset_counter: bool = False
    absolute_at_start: bool = False
    zero_mark_tolerance: int | None = None

    def __post_init__(self) -> None:
        for name in ("reference_marks", "measuring"):
            value = getattr(self, name)
            if not 0 <= value <= 4:
                raise ConfigurationError(f"encoder interface {name}", value, "0..4")
        if self.zero_mark_tolerance is not None and self.zero_mark_tolerance < 0:
            raise ConfigurationError(
                "encoder interface zero_mark_tolerance", self.zero_mark_tolerance, ">= 0"
            )
