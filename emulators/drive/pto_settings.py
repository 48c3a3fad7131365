"""Settings of a pulse module with its stepper motor."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, ClassVar, Final, Literal

from annotated_types import Ge, Le, Unit

from emulators.checked_fields import BENCH_FILE_TABLE, NotNegative, Positive, check_fields
from fieldbus.errors import ConfigurationError

INPUT_DELAYS_MS: Final = (0.004, 0.05, 0.1, 0.4, 0.8, 1.6, 3.2, 12.8, 20.0)
"""Delays of the digital inputs; 0.004 stands for "none" (PTO-016)."""

Signals = Literal["pulse_direction", "up_down", "ab", "ab_fourfold"]
"""What comes out of the two terminals (PTO-006)."""


@dataclass(frozen=True, kw_only=True)
class PtoSettings:
    """`[drive.NAME.tm_pto]`: pulse module and stepper motor.

    Raises:
        ConfigurationError: A value is out of its range.

    """

    __pydantic_config__: ClassVar = BENCH_FILE_TABLE

    variant: Literal["device", "standard"] = "device"
    """Telegram 3 with a setpoint of 16 bits, as the device has it, or of 32 bits."""
    signals: Signals = "pulse_direction"
    """Form of the pulses."""
    reversal_pause_ms: Literal[0, 1, 4, 10] = 0
    """No pulses for this time at a change of direction."""
    reference_speed_rpm: Annotated[float, Ge(1.0), Le(20_000.0)] = 3000.0
    """Speed that 4000h stands for."""
    use_ed: bool = True
    """Terminal ED enables the power stage; without current the motor is out of step."""
    use_dr: bool = True
    """Terminal DR tells that the power stage is ready."""
    use_rs: bool = False
    """Terminal RS is wired to the home switch."""
    use_mi: bool = False
    """Terminal MI is wired to probe1."""
    input_delay_ms: NotNegative = 0.1
    """Filter of the terminals: 0.004 (none), 0.05, 0.1, 0.4, 0.8, 1.6, 3.2, 12.8 or 20."""
    strict_parking: bool = False
    """A parking request ends with error 3."""
    watchdog_cycles: Annotated[int, Ge(1), Le(1000), Unit("cycles")] = 3
    """Bus cycles without a telegram after which the module stops."""
    full_steps: Annotated[int, Ge(4), Le(10_000), Unit("steps/rev")] = 200
    """Full steps of the motor, a multiple of 4."""
    corner_hz: Positive = 2000.0
    """Full-step frequency above which the torque falls."""
    start_stop_hz: Positive = 500.0
    """Full-step frequency up to which a standing rotor is caught."""
    ready_delay_ms: Annotated[float, Ge(0.0), Le(5000.0)] = 0.0
    """From ED to DR."""

    def __post_init__(self) -> None:
        check_fields(self, "tm_pto")
        if self.input_delay_ms not in INPUT_DELAYS_MS:
            raise ConfigurationError("input_delay_ms", self.input_delay_ms, f"one of {INPUT_DELAYS_MS}")

    @property
    def standard(self) -> bool:
        """Whether the frames are those of the standard telegram 3 (PTO-037)."""
        return self.variant == "standard"
