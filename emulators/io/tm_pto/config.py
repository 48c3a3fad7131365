"""Configuration of a channel (PTO-006 to PTO-018)."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum
from typing import Final

from fieldbus.errors import ConfigurationError

FREQUENCY_MIN_HZ: Final = 0.1
"""Smallest frequency of the pulses; below there are none (PTO-022, PTO-167)."""
FREQUENCY_MAX_HZ: Final = 200_000.0
PAUSES_MS: Final = (0, 1, 4, 10)
INPUT_DELAYS_MS: Final = (0.004, 0.05, 0.1, 0.4, 0.8, 1.6, 3.2, 12.8, 20.0)
"""Delays of the digital inputs; 0.004 stands for "none" (PTO-016)."""
SIGNS_UNMONITORED: Final = 65_535


class SignalType(Enum):
    """What comes out of the two terminals (PTO-006)."""

    PULSE_DIRECTION = "pulse and direction"
    UP_DOWN = "count up, count down"
    AB = "A/B phase-shifted"
    AB_FOURFOLD = "A/B phase-shifted fourfold"


@dataclass(frozen=True, slots=True, kw_only=True)
class PtoConfig:
    """A channel.

    Args:
        signal_type: Form of the pulses.
        reversal_pause_ms: No pulses for this time at a change of direction: 0, 1, 4 or 10 ms.
        increments: Increments per revolution, 1..1 000 000; with fourfold signals these are edges.
        reference_speed: 100 % of the setpoint, 1..20 000 rpm.
        maximum_speed: rpm, from 0.1 Hz to the smaller of twice the reference speed and 200 kHz (fourfold:
            800 000 edges/s).
        ramp_stop_ms: From maximum speed to standstill, 1..65 535; also the ramp of every other change of
            speed.
        quick_stop_ms: The same for OFF3, 1..65 535.
        use_ed: Terminal ED enables the drive.
        use_dr: Terminal DR says that the drive is ready.
        use_rs: Terminal RS is the reference switch.
        use_mi: Terminal MI is the measuring input.
        rs_rising: Edge of RS that is the reference mark.
        input_delay_ms: Filter of the inputs, one of `INPUT_DELAYS_MS`.
        sign_tolerance: Tolerated sign-of-life errors in a row, 1..65 535; 65 535 = not monitored.
        diagnostics: Diagnostic interrupts are on.
        standard: True: frames of standard telegram 3 (32-bit setpoint); False: those of the device (PTO-037).
        strict_parking: True: a parking request is answered with error 0003h (PTO-134).
        start_value: G1_XIST1 at power-on, 0..2^32 - 1.

    Raises:
        ConfigurationError: A value is out of its range.

    """

    signal_type: SignalType = SignalType.PULSE_DIRECTION
    reversal_pause_ms: int = 0
    increments: int = 200
    reference_speed: float = 3000.0
    maximum_speed: float = 3000.0
    ramp_stop_ms: int = 5000
    quick_stop_ms: int = 1000
    use_ed: bool = False
    use_dr: bool = False
    use_rs: bool = False
    use_mi: bool = False
    rs_rising: bool = True
    input_delay_ms: float = 0.1
    sign_tolerance: int = 1
    diagnostics: bool = False
    standard: bool = False
    strict_parking: bool = False
    start_value: int = 0

    def __post_init__(self) -> None:
        for name, low, high in (
            ("increments", 1, 1_000_000),
            ("reference_speed", 1.0, 20_000.0),
            ("ramp_stop_ms", 1, 65_535),
            ("quick_stop_ms", 1, 65_535),
            ("sign_tolerance", 1, SIGNS_UNMONITORED),
            ("start_value", 0, 0xFFFF_FFFF),
            ("maximum_speed", *self.speed_range),
        ):
            value = getattr(self, name)
            if not low <= value <= high:
                raise ConfigurationError(f"pulse channel {name}", value, f"{low:.12g}..{high:.12g}")
        if self.reversal_pause_ms not in PAUSES_MS:
            raise ConfigurationError(
                "pulse channel reversal_pause_ms", self.reversal_pause_ms, f"one of {PAUSES_MS}"
            )
        if self.input_delay_ms not in INPUT_DELAYS_MS:
            raise ConfigurationError(
                "pulse channel input_delay_ms", self.input_delay_ms, f"one of {INPUT_DELAYS_MS}"
            )

    @property
    def speed_range(self) -> tuple[float, float]:
        """Lowest and highest maximum speed that can be configured, rpm (PTO-010)."""
        increments = self.increments or 1  # 0 is refused elsewhere
        highest = FREQUENCY_MAX_HZ * (4.0 if self.signal_type is SignalType.AB_FOURFOLD else 1.0)
        return FREQUENCY_MIN_HZ * 60.0 / increments, min(
            2.0 * self.reference_speed, highest * 60.0 / increments
        )

    def frequency(self, speed_rpm: float) -> float:
        """Return the frequency of the increments at a speed, Hz, with its sign (PTO-020)."""
        return speed_rpm * self.increments / 60.0
