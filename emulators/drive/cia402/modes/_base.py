"""What every mode of operation can be asked."""

from __future__ import annotations

from typing import Final

from typing_extensions import override

from emulators.drive.cia402.axis import ProfileAxis
from emulators.drive.cia402.statemachine import StopOption

BIT_10: Final = 1 << 10
BIT_12: Final = 1 << 12
BIT_13: Final = 1 << 13


class ModeOfOperation:
    """A mode in effect. The drive calls `enter` when setpoints begin to count and `leave` when they cease to.

    Args:
        axis: The motor as the profile sees it.

    """

    number: int = 0
    """Value of 6060h."""
    position_controlled: bool = True
    """Whether stops of this mode keep the position control."""
    cyclic: bool = False
    """Whether setpoints come with every SYNC."""
    tells_arrival: bool = True
    """Whether bit 10 of the status word is "target reached" (C402-044)."""
    target_key: int = 0
    """Key of the cyclic setpoint."""

    def __init__(self, axis: ProfileAxis) -> None:
        self.axis = axis
        self.status = 0
        """Bits 10, 12 and 13 of the status word."""
        self.limited = False
        """A limit holds the motion back (bit 11)."""
        self.missed = 0
        """Cyclic setpoints that have been missing in succession."""
        self.following_error = False
        """The following error is too large; set by the drive (bit 13 in pp and csp)."""

    def enter(self) -> None:
        """Begin with setpoint = actual value (C402-089)."""
        self.rest()

    def rest(self) -> None:
        """Hold the axis; one that moves is braked with 6084h before."""
        core = self.axis.core
        if core.standing and core.precontrol_velocity == 0.0:
            core.hold_position()
        else:
            core.ramp(0.0, self.axis.stop_slope(StopOption.SLOW_DOWN), track_position=True)

    @property
    def torque_offset(self) -> float:
        """Torque that the mode adds to the demand, Nm."""
        return 0.0

    def leave(self) -> None:
        """Cease: pulses are about to be inhibited, or another mode takes over."""
        self.status = 0
        self.limited = False
        self.axis.demand_excess = 0.0

    def control(self, word: int, changed: int) -> None:
        """Take the mode-specific bits of a new control word; `changed` has the
        bits that differ from the last.
        """

    def sync(self) -> None:
        """Take the cyclic setpoint that has become effective with SYNC."""

    def cycle(self) -> None:
        """Do the work of one control cycle and update `status`."""

    def stopped(self) -> None:
        """Update `status` while a stop by the drive (halt, limit switch) holds the mode up."""
        self.status = 0 if self.axis.core.stopping else BIT_10

    def waiting(self) -> None:
        """Update `status` while the brake opens and setpoints do not pass yet."""
        self.stopped()

    def stop(self, option: StopOption) -> None:
        """Bring the axis to rest as an option code says (C402-074)."""
        self.axis.core.stop(
            self.stop_slope(option),
            track_position=self.position_controlled and option <= StopOption.QUICK_STOP,
        )

    def stop_slope(self, option: StopOption) -> float:
        """Return the deceleration of a stop, rad/s^2; inf = at the torque limit."""
        return self.axis.stop_slope(option)

    def resume(self) -> None:
        """Go on after a halt or after a stop at a limit switch."""
        self.enter()


class NoMode(ModeOfOperation):
    """6060h = 0: stand still."""

    @override
    def stopped(self) -> None:
        self.status = 0
