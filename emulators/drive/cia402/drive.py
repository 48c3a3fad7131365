"""The emulated CiA 402 drive with all that a test can do to it and its machine (C402-311, C402-312)."""

from __future__ import annotations

from typing import TYPE_CHECKING

from emulators.drive.cia402._injection import InjectableDrive
from emulators.drive.cia402._trace import TRACE_ENUMS, trace_columns, trace_row
from emulators.drive.cia402.config import DriveConfig
from emulators.drive.machine import LinearAxisConfig
from fieldbus.can.frame import CanSegment
from fieldbus.clock import Scheduler
from fieldbus.errors import UnsupportedFaultError
from fieldbus.history import History

if TYPE_CHECKING:
    import numpy as np


class CiA402Drive(InjectableDrive):
    """A servo drive with its motor and machine on a CAN segment.

    It is off until `power_on`; the machine moves from the start. Everything runs in callbacks of the
    scheduler: the servo step every `servo_period_ns`, modes and monitoring every `control_period_ns`, cyclic
    set-points at SYNC. Injected faults act at once.

    Args:
        scheduler: Time of the bench.
        segment: CAN segment.
        config: The drive and its machine.
        name: Name of the node on the segment and in the history.
        history: Log; None for none.
        rng: Source of the encoder's noise; None: the encoder cannot be made noisy.

    Raises:
        ConfigurationError: The configuration does not fit together.

    """

    __slots__ = ("trace_columns",)

    trace_enums = TRACE_ENUMS

    def __init__(
        self,
        scheduler: Scheduler,
        segment: CanSegment,
        config: DriveConfig,
        *,
        name: str,
        history: History | None = None,
        rng: np.random.Generator | None = None,
    ) -> None:
        super().__init__(scheduler, segment, config, name=name, history=history, rng=rng)
        self.trace_columns = trace_columns("m" if isinstance(config.mechanics, LinearAxisConfig) else "rad")
        """(name, unit) of the values of `trace_row`."""

    def trace_row(self) -> tuple[float, ...]:
        """Return the present values of `trace_columns`; position and velocity are those of the true
        mechanics.
        """
        return trace_row(self)

    # -- drive -----------------------------------------------------------------------------------------

    def clear_fault_cause(self, emcy_code: int | None = None) -> None:
        """End the cause of a persistent fault, or of all; the fault itself waits for its reset."""
        self.faults.end_causes(emcy_code)

    def set_sto(self, active: bool) -> None:
        """Activate or release safe torque off (C402-030)."""
        self.safety.set_sto(active)

    def set_ss1(self, active: bool) -> None:
        """Demand safe stop 1, or release it: quick stop, then safe torque off."""
        self.safety.set_ss1(active)

    def open_interlock(self, opened: bool) -> None:
        """Open or close the interlock input (60FDh bit 3).

        Raises:
            UnsupportedFaultError: No interlock is wired.

        """
        if self.config.safety.interlock == "none":
            raise UnsupportedFaultError(f"{self.name}: no interlock is wired (safety.interlock)")
        self.safety.set_interlock(opened)

    def _link_changed(self) -> None:
        self.protection.look_at_link()
        self.refresh_status()
