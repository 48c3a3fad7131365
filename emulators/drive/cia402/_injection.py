"""Faults of a CiA 402 drive that a test can inject beyond those of supply, safety and machine: status word,
ramps, sensor (C402-310, C402-311).
"""

from __future__ import annotations

import math
from typing import Final

from emulators.drive.cia402 import faults
from emulators.drive.cia402.device import DriveDevice
from emulators.drive.cia402.protection import DriveWarning
from emulators.drive.injection import MachineFaults, NodeFaults, PowerFaults, cancel
from emulators.drive.power_stage import PowerStage
from emulators.encoder import AbsoluteEncoder
from fieldbus.clock import Timer, seconds_to_ns

_TARGET_REACHED: Final = 1 << 10


class InjectableDrive(MachineFaults, PowerFaults, NodeFaults, DriveDevice):
    """A drive that can be made to fail; use `CiA402Drive`."""

    __slots__ = ("_drift_rest", "_drift_timer", "_emcy_timer", "_repeated_emcy", "_toggle_timer")

    _drift_rest: float
    _repeated_emcy: int
    _drift_timer: Timer | None
    _emcy_timer: Timer | None
    _toggle_timer: Timer | None

    # -- state machine and status word -----------------------------------------------------------------

    def set_local_control(self, active: bool) -> None:
        """Take the control away from the bus: bit 9 of the status word 0, control words are ignored."""
        self.function.local_control = active
        self.machine.remote = not active
        if not active:
            self.function.evaluate_again()
        self.refresh_status()

    def refuse_transitions(self, *numbers: int) -> None:
        """Ignore the commands of these transitions (of 2, 3, 4, 15, 16); without numbers none."""
        self.machine.refused = frozenset(numbers)
        if not numbers:
            self.function.evaluate_again()
            self.refresh_status()
        self.machine.release()

    def force_switch_on_disabled(self) -> None:
        """Change to Switch on disabled without being told to and without a fault; the motor coasts."""
        self.function.execute(self.machine.disable_voltage())
        self.refresh_status()

    def freeze_statusword(self, frozen: bool) -> None:
        """Let 6041h show what it shows now, whatever happens."""
        self.status_word.frozen = frozen
        self.refresh_status()

    def override_statusword_bits(self, set_bits: int, clear_bits: int) -> None:
        """Show bits of 6041h as 1, or as 0, whatever they should be; 0 and 0 = the true bits again."""
        self.status_word.override_bits(set_bits=set_bits, clear_bits=clear_bits)

    def toggle_target_reached(self, period_s: float | None) -> None:
        """Let bit 10 of 6041h change every `period_s`, whatever the motor does; None = the true bit."""
        cancel(self, "_toggle_timer")
        if period_s is None:
            self.status_word.override_bits()
            return
        reached = False

        def toggle() -> None:
            nonlocal reached
            reached = not reached
            self.status_word.override_bits(
                set_bits=_TARGET_REACHED if reached else 0, clear_bits=0 if reached else _TARGET_REACHED
            )
            self._toggle_timer = self.scheduler.after(seconds_to_ns(period_s), toggle)

        toggle()

    def override_mode_display(self, number: int | None) -> None:
        """Show a wrong mode in 6061h, or the true one again (None)."""
        self.status_word.override_mode_display(number)

    def force_warning(self, active: bool) -> None:
        """Show a warning without cause: bit 7, bit 31 of 2100h."""
        self.protection.warn(DriveWarning.INJECTED, active)

    @property
    def power(self) -> PowerStage:
        """Models of heat and supply."""
        return self.protection.power

    # -- power stage -----------------------------------------------------------------------------------

    def scale_ramps(self, share: float) -> None:
        """Make all ramps of the drive with this share of their slope; 1 = as set."""
        self.axis.ramp_scale = share

    def limit_torque(self, share: float | None) -> None:
        """Limit the torque to a share of the rated one; None = not."""
        self.protection.cap_torque(math.inf if share is None else share * self.config.rated_torque_Nm)
        self.refresh_status()

    # -- encoder ---------------------------------------------------------------------------------------

    def break_encoder_wire(self, broken: bool) -> None:
        """Cut the wire of the encoder: the value stands, and the drive notices (7305h, absolute 7320h); or
        repair it.

        A repaired incremental encoder has lost its reference.
        """
        absolute = isinstance(self.encoder, AbsoluteEncoder)
        code = faults.POSITION_SENSOR if absolute else faults.INCREMENTAL_SENSOR
        self.encoder.freeze(broken)
        if broken:
            self.raise_fault(code, persistent=True)
        else:
            self.faults.end_causes(code)
            if not absolute:
                self.axis.homed = False
