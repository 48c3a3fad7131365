"""Configuration of the safety functions of a PROFIdrive axis."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Literal

from annotated_types import Ge, Gt, Le, MaxLen, MinLen

from emulators.checked_fields import NotNegative, Positive, check_fields
from emulators.drive.machine import SafeStopConfig, SafeTime_ms
from fieldbus.errors import ConfigurationError

Reaction = Literal["sto", "ss1", "ss2"]
Delay_ms = Annotated[float, Ge(0.0), Le(5000.0)]


@dataclass(frozen=True, kw_only=True)
class SafeMotionConfig(SafeStopConfig):
    """`[drive.NAME.safety]`: safety functions of a PROFIdrive axis (CFG-443 to CFG-498).

    Lengths and speeds are those of the load; on a rotary axis mm stands for 0.001 rad.

    Raises:
        ConfigurationError: A value is out of its range, or the ends of a range are not in order.

    """

    ss1_external: bool = False
    """Safe stop 1 leaves the braking to the controller (SS1E): safe torque off when its time has passed."""
    ss2_time_ms: SafeTime_ms = 500.0
    """Safe stop 2: from its selection to the monitoring of standstill, at the latest."""
    ss2_monitored: bool = True
    """Its ramp is watched as that of safe stop 1 is."""
    ss2_external: bool = False
    """Safe stop 2 leaves the braking to the controller (SS2E)."""
    sos_delay_ms: Delay_ms = 100.0
    """Safe operating stop: from its selection to the monitoring."""
    sos_tolerance_mm: Positive = 1.0
    """Distance that the load may move at monitored standstill."""
    sls_limits_mm_s: Annotated[tuple[Positive, ...], MinLen(1), MaxLen(4)] = (250.0,)
    """Safely limited speed: limits of levels 1 to 4 (p9531), at the load."""
    sls_factor_percent: Annotated[float, Gt(0.0), Le(100.0)] = 80.0
    """Share of the limit that S_V_LIMIT_B tells the controller (p9533)."""
    sls_delay_ms: Delay_ms = 100.0
    """From the selection to the monitoring."""
    sls_reaction: Reaction = "ss1"
    """Stop above the limit."""
    sdi_tolerance_mm: Positive = 1.0
    """Safe direction: distance the other way that is tolerated."""
    sdi_delay_ms: Delay_ms = 100.0
    """From the selection to the monitoring."""
    sdi_reaction: Reaction = "ss1"
    """Stop beyond it."""
    slp_ranges_mm: Annotated[tuple[tuple[float, float], ...], MaxLen(2)] = ()
    """Safely limited position: lower and upper end of ranges 1 and 2 of the load."""
    slp_delay_ms: Delay_ms = 100.0
    """From the selection to the monitoring."""
    slp_reaction: Reaction = "ss1"
    """Stop outside of the range."""
    sbt_torque_nm: NotNegative = 0.0
    """Safe brake test (S_STW3B of telegram 701): torque with which the drive pulls at the closed brake; 0 =
    not configured.
    """
    sbt_time_ms: SafeTime_ms = 500.0
    """How long it pulls."""
    sbt_tolerance_mm: Positive = 1.0
    """Distance that the load may move meanwhile."""
    sbc: bool = True
    """With safe torque off the brake closes whatever STW1 bit 12 says."""

    def __post_init__(self) -> None:
        check_fields(self, "safety")
        for low, high in self.slp_ranges_mm:
            if not low < high:
                raise ConfigurationError("slp_ranges_mm", (low, high), "the lower end first")
