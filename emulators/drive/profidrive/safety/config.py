"""Configuration of the safe motion functions of a PROFIdrive axis."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final, Literal

from emulators.drive.machine import check_number
from fieldbus.errors import ConfigurationError

Reaction = Literal["sto", "ss1", "ss2"]
REACTIONS: Final = ("sto", "ss1", "ss2")
"""Stop reactions of safe motion monitoring."""
SLS_LEVELS: Final = 4
SLP_RANGES: Final = 2


@dataclass(frozen=True, slots=True, kw_only=True)
class SafeMotionConfig:
    """Safe stopping and safe motion monitoring beyond safe torque off and safe stop 1 (CFG-443 to CFG-498).

    Lengths and speeds are those of the load: m and m/s, or rad and rad/s on a rotary axis.

    Args:
        ss1_external: Safe stop 1 does not brake by itself: safe torque off follows when its time has
            passed (SS1E).
        ss2_time_s: Safe stop 2: from its selection to the monitoring of standstill at the latest, s.
        ss2_monitored: The ramp of safe stop 2 is watched as that of safe stop 1 is.
        ss2_external: Safe stop 2 does not brake by itself: standstill is monitored when its time has
            passed (SS2E).
        sos_delay_s: Safe operating stop: from its selection to the monitoring, s.
        sos_tolerance: Distance that the load may move at monitored standstill.
        sls_limits: Safely limited speed: limits of levels 1 to 4, at least one (p9531).
        sls_factor: Share of the limit that S_V_LIMIT_B shows as limit of the setpoint, above 0 to 1 (p9533).
        sls_delay_s: From the selection to the monitoring, s.
        sls_reaction: Stop when the limit is exceeded.
        sdi_tolerance: Distance into the forbidden direction that is tolerated.
        sdi_delay_s: From the selection to the monitoring, s.
        sdi_reaction: Stop when it is exceeded.
        slp_ranges: Safely limited position: lower and upper end of ranges 1 and 2; empty = not configured.
        slp_delay_s: From the selection to the monitoring, s.
        slp_reaction: Stop when the range is left.
        sbt_torque_Nm: Safe brake test: torque with which the drive pulls at the closed brake, Nm; 0 = not
            configured.
        sbt_time_s: How long it pulls, s.
        sbt_tolerance: Distance that the load may move meanwhile.
        sbc: With safe torque off the brake closes whatever STW1 bit 12 says (SBC).

    Raises:
        ConfigurationError: A value is out of range.

    """

    ss1_external: bool = False
    ss2_time_s: float = 0.5
    ss2_monitored: bool = True
    ss2_external: bool = False
    sos_delay_s: float = 0.1
    sos_tolerance: float = 0.001
    sls_limits: tuple[float, ...] = (0.25,)
    sls_factor: float = 0.8
    sls_delay_s: float = 0.1
    sls_reaction: Reaction = "ss1"
    sdi_tolerance: float = 0.001
    sdi_delay_s: float = 0.1
    sdi_reaction: Reaction = "ss1"
    slp_ranges: tuple[tuple[float, float], ...] = ()
    slp_delay_s: float = 0.1
    slp_reaction: Reaction = "ss1"
    sbt_torque_Nm: float = 0.0
    sbt_time_s: float = 0.5
    sbt_tolerance: float = 0.001
    sbc: bool = True

    def __post_init__(self) -> None:
        for name in ("ss2_time_s", "sos_tolerance", "sdi_tolerance", "sbt_time_s", "sbt_tolerance"):
            check_number(name, getattr(self, name), positive=True)
        for name in ("sos_delay_s", "sls_delay_s", "sdi_delay_s", "slp_delay_s", "sbt_torque_Nm"):
            check_number(name, getattr(self, name))
        if not 1 <= len(self.sls_limits) <= SLS_LEVELS:
            raise ConfigurationError("sls_limits", self.sls_limits, f"1 to {SLS_LEVELS} speeds")
        for limit in self.sls_limits:
            check_number("sls_limits", limit, positive=True)
        if not 0.0 < self.sls_factor <= 1.0:
            raise ConfigurationError("sls_factor", self.sls_factor, "above 0 to 1")
        if len(self.slp_ranges) > SLP_RANGES:
            raise ConfigurationError("slp_ranges", self.slp_ranges, f"at most {SLP_RANGES} ranges")
        for low, high in self.slp_ranges:
            if not (math.isfinite(low) and math.isfinite(high) and low < high):
                raise ConfigurationError("slp_ranges", (low, high), "two finite numbers, low < high")
        for name in ("sls_reaction", "sdi_reaction", "slp_reaction"):
            if getattr(self, name) not in REACTIONS:
                raise ConfigurationError(name, getattr(self, name), ", ".join(REACTIONS))
