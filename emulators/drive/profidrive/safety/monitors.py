"""What the safety functions watch: standstill, speed, direction and position of the load."""

from __future__ import annotations

from emulators.drive.core import ServoCore
from emulators.drive.profidrive.faults.catalogue import DriveWarning
from emulators.drive.safety_config import SafeMotionConfig
from emulators.mechanics import AxisMechanics
from fieldbus.clock import Scheduler, seconds_to_ns
from fieldbus.errors import ConfigurationError


class SafeMonitors:
    """Safe operating stop, safely limited speed, safe direction, safely limited position.

    Each one is selected, and monitored when its delay has passed.

    Args:
        scheduler: Clock of the drive.
        config: Limits, delays and reactions.
        core: Servo core.
        mechanics: Machine.

    """

    def __init__(
        self, scheduler: Scheduler, config: SafeMotionConfig, core: ServoCore, mechanics: AxisMechanics
    ) -> None:
        self._scheduler = scheduler
        self._sos_delay_ns = seconds_to_ns(config.sos_delay_ms / 1000.0)
        self._sos_tolerance = config.sos_tolerance_mm / 1000.0
        self._sls_limits = tuple(limit / 1000.0 for limit in config.sls_limits_mm_s)
        self._sls_delay_ns = seconds_to_ns(config.sls_delay_ms / 1000.0)
        self._sls_reaction = config.sls_reaction
        self._sdi_tolerance = config.sdi_tolerance_mm / 1000.0
        self._sdi_delay_ns = seconds_to_ns(config.sdi_delay_ms / 1000.0)
        self._sdi_reaction = config.sdi_reaction
        self._slp_ranges = tuple((low / 1000.0, high / 1000.0) for low, high in config.slp_ranges_mm)
        self._slp_delay_ns = seconds_to_ns(config.slp_delay_ms / 1000.0)
        self._slp_reaction = config.slp_reaction
        self._core = core
        self._mechanics = mechanics
        self._sos_selected = False
        self._held = False
        self._reference: float | None = None
        self._furthest = 0.0
        self._sos_ns = self._sls_ns = self._sdi_ns = self._slp_ns = 0
        self.sls_level = 0
        """Selected level, 0 = none."""
        self.sls_active = False
        self.sdi = 0
        """Permitted direction, 1 or -1; 0 = safe direction is not selected."""
        self.sdi_active = False
        self.slp_range = 0
        """Selected range, 0 = none."""
        self.slp_active = False

    @property
    def selected(self) -> bool:
        """Whether anything is to be watched."""
        return bool(self._sos_selected or self._held or self.sls_level or self.sdi or self.slp_range)

    @property
    def sos_selected(self) -> bool:
        """Whether the standstill is, or will be, monitored: by safe operating stop, or safe stop 2."""
        return self._sos_selected or self._held

    @property
    def sos_active(self) -> bool:
        """Whether the standstill is monitored now."""
        return self._reference is not None

    @property
    def sls_limit(self) -> float:
        """Limit of the selected level, m/s or rad/s of the load."""
        return self._sls_limits[self.sls_level - 1]

    # -- selection -------------------------------------------------------------------------------------

    def select_sos(self, selected: bool) -> None:
        """Select or deselect safe operating stop."""
        if selected is not self._sos_selected:
            self._sos_selected = selected
            self._sos_ns = self._scheduler.now
            if not self.sos_selected:
                self._reference = None

    def hold_position(self) -> None:
        """Monitor the standstill from now on: safe stop 2 has braked."""
        self._held = True
        if self._reference is None:
            self._reference = self._core.position

    def release_position(self) -> None:
        """Safe stop 2 is over."""
        self._held = False
        if not self._sos_selected:
            self._reference = None

    def select_sls(self, level: int | None) -> None:
        """Select a level of safely limited speed, None = deselect; see `SafetyFunctions.set_sls`."""
        limits = self._sls_limits
        if level is not None and not 1 <= level <= len(limits):
            raise ConfigurationError("safely limited speed, level", level, f"1..{len(limits)}")
        self.sls_level = 0 if level is None else level
        self._sls_ns = self._scheduler.now
        self.sls_active = False

    def select_sdi(self, direction: int | None) -> None:
        """Select the permitted direction, None = deselect; see `SafetyFunctions.set_sdi`."""
        if direction not in (None, 1, -1):
            raise ConfigurationError("safe direction", direction, "1, -1")
        self.sdi = direction or 0
        self._sdi_ns = self._scheduler.now
        self.sdi_active = False

    def select_slp(self, number: int | None) -> None:
        """Select a range of safely limited position, None = deselect; see `SafetyFunctions.set_slp`."""
        ranges = self._slp_ranges
        if number is not None and not 1 <= number <= len(ranges):
            allowed = f"1..{len(ranges)}" if ranges else "slp_ranges_mm in the configuration"
            raise ConfigurationError("safely limited position, range", number, allowed)
        self.slp_range = number or 0
        self._slp_ns = self._scheduler.now
        self.slp_active = False

    def restart(self) -> None:
        """Start every delay again: after power-on, and after an acknowledgement."""
        now = self._scheduler.now
        self._held = False
        self._reference = None
        self._sos_ns = self._sls_ns = self._sdi_ns = self._slp_ns = now
        self.sls_active = self.sdi_active = self.slp_active = False

    # -- control cycle ---------------------------------------------------------------------------------

    def watch(self) -> tuple[DriveWarning, str] | None:
        """Look at the load; returns message and reaction of the first function that is violated."""
        now = self._scheduler.now
        core = self._core
        ratio = self._mechanics.ratio
        if self.sos_selected:
            if self._reference is None and now - self._sos_ns >= self._sos_delay_ns:
                self._reference = core.position
            reference = self._reference
            if reference is not None and abs((core.position - reference) * ratio) > self._sos_tolerance:
                return DriveWarning.SAFE_STANDSTILL, "ss1"
        if self.sls_level:
            if now - self._sls_ns >= self._sls_delay_ns:
                self.sls_active = True
            if self.sls_active and abs(core.velocity * ratio) > self.sls_limit:
                return DriveWarning.SAFE_SPEED, self._sls_reaction
        if self.sdi:
            place = core.position * ratio * self.sdi
            if not self.sdi_active:
                self._furthest = place
                self.sdi_active = now - self._sdi_ns >= self._sdi_delay_ns
            elif place > self._furthest:
                self._furthest = place
            elif self._furthest - place > self._sdi_tolerance:
                return DriveWarning.SAFE_DIRECTION, self._sdi_reaction
        if self.slp_range:
            if now - self._slp_ns >= self._slp_delay_ns:
                self.slp_active = True
            low, high = self._slp_ranges[self.slp_range - 1]
            if self.slp_active and not low <= self._mechanics.position <= high:
                return DriveWarning.SAFE_POSITION, self._slp_reaction
        return None
