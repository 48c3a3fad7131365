"""Actual values: from raw encoder counts to position and velocity of the axis (CFG section 25, HOM section 2.14)."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

from fieldbus.errors import ConfigurationError

if TYPE_CHECKING:
    from motion.drives.port import DrivePort
    from motion.variables import VariableStore

NOT_VALID: Final = 0
WAITING_FOR_VALID: Final = 1
VALID: Final = 2

_HALF: Final = 1 << 31
_FULL: Final = 1 << 32


class Mechanics:
    """Ratios between motor, encoder and axis, from the variables of the technology object.

    Args:
        store: Variables of a positioning or speed axis.
        speed_axis: The object has no position; its unit is rpm at the load.

    """

    __slots__ = ("increment", "rpm_per_unit", "units_per_load_revolution")

    def __init__(self, store: VariableStore, *, speed_axis: bool) -> None:
        gear = store.read("LoadGear.Numerator") / store.read("LoadGear.Denominator")
        direction = -1.0 if store.read("Actor.InverseDirection") else 1.0
        if speed_axis:
            self.units_per_load_revolution = 1.0
            self.rpm_per_unit = gear * direction
            """Motor speed in rpm per velocity unit of the axis, signed by the drive direction."""
            self.increment = 0.0
            return
        rotary = store.read("Properties.MotionType") == 1
        travel = 360.0 if rotary else store.read("Mechanics.LeadScrew")
        self.units_per_load_revolution = travel
        self.rpm_per_unit = 60.0 / travel * gear * direction
        steps = store.read("Sensor[1].Parameter.StepsPerRevolution") * 2 ** store.read(
            "Sensor[1].Parameter.FineResolutionXist1"
        )
        measuring = store.read("Sensor[1].MeasuringGear.Numerator") / store.read(
            "Sensor[1].MeasuringGear.Denominator"
        )
        mounting = store.read("Sensor[1].MountingMode")
        if mounting == 0:
            per_encoder_revolution = measuring / gear * travel
        elif mounting == 1:
            per_encoder_revolution = measuring * travel
        elif mounting == 2:
            per_encoder_revolution = measuring * store.read("Sensor[1].Parameter.DistancePerRevolution")
        else:
            raise ConfigurationError("Sensor[1].MountingMode", mounting, "0, 1 or 2")
        sign = -1.0 if store.read("Sensor[1].InverseDirection") else 1.0
        self.increment = sign * per_encoder_revolution / steps
        """Axis units per raw increment, signed by the encoder direction."""


class Feedback:
    """Position and velocity of the axis from the drive's encoder.

    The count is unwrapped to an integer of unlimited length, so that an endless axis does not drift.

    Args:
        mechanics: Ratios of the axis.
        cycle_s: Application cycle, s.

    """

    __slots__ = ("_count", "_fresh", "_increment", "_last_raw", "_offset", "_rate", "_restarts", "lost_reference",
                 "position", "state", "velocity")  # fmt: skip

    def __init__(self, mechanics: Mechanics, cycle_s: float) -> None:
        self._increment = mechanics.increment
        self._rate = 1.0 / cycle_s
        self._count = 0
        self._last_raw = 0
        self._offset = 0.0
        self._restarts = 0
        self._fresh = True
        self.position = 0.0
        """Actual position, axis unit."""
        self.velocity = 0.0
        """Actual velocity, axis unit per second: difference of two positions."""
        self.state = NOT_VALID
        """`StatusSensor[1].State`."""
        self.lost_reference = False
        """Set when an incremental count came back with a new reference; the axis clears it."""

    def update(self, port: DrivePort) -> None:
        """Take over the encoder count of this cycle."""
        if not port.link_ok or port.sensor_fault:
            self.state = NOT_VALID
            self.velocity = 0.0
            return
        raw = port.encoder_increments
        if self._fresh or port.encoder_restarts != self._restarts:
            # First value, or a count with a new reference: an absolute encoder defines the position with it, an
            # incremental one continues from the last known position, but is not homed any more.
            if port.absolute_encoder:
                self._count = raw
            elif not self._fresh:
                self.lost_reference = True
            if not port.absolute_encoder:
                self._offset = self.position
                self._count = 0
            self._fresh = False
            self._restarts = port.encoder_restarts
            self._last_raw = raw
            self.position = self._count * self._increment + self._offset
            self.velocity = 0.0
            self.state = VALID
            return
        delta = (raw - self._last_raw + _HALF) % _FULL - _HALF
        self._last_raw = raw
        self._count += delta
        if self.state != VALID:
            # Back after a gap: the distance of several cycles is no velocity.
            self.state = VALID
            self.velocity = 0.0
        else:
            self.velocity = delta * self._increment * self._rate
        self.position = self._count * self._increment + self._offset

    def shift(self, offset: float) -> None:
        """Move the coordinate system so that the position grows by `offset`."""
        self._offset += offset
        self.position += offset
