"""Configuration of a channel (PTO-006 to PTO-018)."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Final

from emulators.drive.pto_settings import PtoSettings
from fieldbus.errors import ConfigurationError

FREQUENCY_MIN_HZ: Final = 0.1
"""Smallest frequency of the pulses; below there are none (PTO-022, PTO-167)."""
FREQUENCY_MAX_HZ: Final = 200_000.0
SIGNS_UNMONITORED: Final = 65_535


@dataclass(frozen=True, kw_only=True)
class PtoConfig:
    """A channel.

    Args:
        settings: Signals, terminals and monitoring.
        increments: Increments per revolution, 1..1 000 000; with fourfold signals these are edges.
        maximum_speed: rpm, from 0.1 Hz to the smaller of twice the reference speed and 200 kHz (fourfold:
            800 000 edges/s).
        ramp_stop_ms: From maximum speed to standstill, 1..65 535; also the ramp
            of every other change of speed.
        quick_stop_ms: The same for OFF3, 1..65 535.
        rs_rising: Edge of RS that is the reference mark.
        sign_tolerance: Tolerated sign-of-life errors in a row, 1..65 535; 65 535 = not monitored.
        diagnostics: Diagnostic interrupts are on.
        start_value: G1_XIST1 at power-on, 0..2^32 - 1.

    Raises:
        ConfigurationError: A value is out of its range.

    """

    settings: PtoSettings = field(default_factory=PtoSettings)
    increments: int = 200
    maximum_speed: float = 3000.0
    ramp_stop_ms: int = 5000
    quick_stop_ms: int = 1000
    rs_rising: bool = True
    sign_tolerance: int = 1
    diagnostics: bool = False
    start_value: int = 0

    def __post_init__(self) -> None:
        for name, low, high in (
            ("increments", 1, 1_000_000),
            ("ramp_stop_ms", 1, 65_535),
            ("quick_stop_ms", 1, 65_535),
            ("sign_tolerance", 1, SIGNS_UNMONITORED),
            ("start_value", 0, 0xFFFF_FFFF),
            ("maximum_speed", *self.speed_range),
        ):
            value = getattr(self, name)
            if not low <= value <= high:
                raise ConfigurationError(f"pulse channel {name}", value, f"{low:.12g}..{high:.12g}")

    @property
    def speed_range(self) -> tuple[float, float]:
        """Lowest and highest maximum speed that can be configured, rpm (PTO-010)."""
        increments = self.increments or 1  # 0 is refused elsewhere
        highest = FREQUENCY_MAX_HZ * (4.0 if self.settings.signals == "ab_fourfold" else 1.0)
        return FREQUENCY_MIN_HZ * 60.0 / increments, min(
            2.0 * self.settings.reference_speed_rpm, highest * 60.0 / increments
        )

    def frequency(self, speed_rpm: float) -> float:
        """Return the frequency of the increments at a speed, Hz, with its sign (PTO-020)."""
        return speed_rpm * self.increments / 60.0
