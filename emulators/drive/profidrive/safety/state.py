"""What the safety functions of a PROFIdrive axis have in effect."""

from __future__ import annotations


class SafetyState:
    """Written by the safety functions, read by everything that they overrule."""

    def __init__(self) -> None:
        self.off = 0
        """Stop commands, bits of `Off`."""
        self.torque_off = False
        """Safe torque off is in effect."""
        self.holding = False
        """Safe stop 2 has taken the setpoints away: the axis brakes, or stands under control."""
        self.testing_brake = False
        """The brake test moves the axis: the brake is closed, or closing."""
