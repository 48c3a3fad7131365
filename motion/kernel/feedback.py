"""Actual values: from raw encoder counts to position and velocity of the axis (CFG sections 15 to 17, HOM
section 2.14).
"""

from __future__ import annotations

from abc import abstractmethod
from fractions import Fraction
from typing import TYPE_CHECKING, Final, Protocol

from typing_extensions import override

from motion.kernel.cell import Cell
from motion.kernel.mechanics import CYCLIC_ABSOLUTE, INCREMENTAL, EncoderScale

if TYPE_CHECKING:
    from motion.drives.mark import MarkSearch
    from motion.kernel.modulo import Modulo

NOT_VALID: Final = 0
WAITING_FOR_VALID: Final = 1
VALID: Final = 2


class EncoderSource(Protocol):
    """Where an encoder value comes from: the port of the drive that evaluates it, or a port of its own."""

    link_ok: bool
    sign_lost: bool
    mark: MarkSearch | None
    probes: tuple[tuple[MarkSearch, MarkSearch], ...]
    sensor_fault: bool
    encoder_increments: int
    encoder_restarts: int
    actual_speed_rpm: float

    @property
    def absolute_from_zero(self) -> bool:
        """Whether an absolute value lies between 0 and the measuring range; else it has a sign."""

    def probe_level(self, number: int) -> bool | None:
        """Return whether probe input 1 or 2 is active; None: the connection does not say it."""


class Feedback:
    """Position and velocity of an axis from one encoder, real or simulated.

    Args:
        source: Port that brings the count.
        scale: Ratios and format of the encoder.
        abs_offset: Cell that keeps the relation of an absolute encoder over power-off, position unit.

    """

    def __init__(self, source: EncoderSource, scale: EncoderScale, abs_offset: Cell[float]) -> None:
        self.source = source
        self.scale = scale
        self._abs_offset = abs_offset
        self._offset = 0.0
        self._correction = 0.0
        self.position = 0.0
        """Actual position, position unit; unwrapped on a modulo axis."""
        self.velocity = 0.0
        """Actual velocity, position unit per second: difference of two positions, or that of the telegram."""
        self.last_velocity = 0.0
        """`velocity` of the cycle before."""
        self.state = NOT_VALID
        """`NOT_VALID`, `WAITING_FOR_VALID` or `VALID`."""
        self.compensation = 0.0
        """What the backlash compensation has added to `position`, position unit."""
        self.lost_reference = False
        """Set when an incremental count came back with a new reference; the axis clears it."""

    @abstractmethod
    def update(self) -> None:
        """Take over the value of this cycle."""

    @abstractmethod
    def ahead(self, raw: int) -> float:
        """Return how far a raw count lies ahead of the present position, position unit."""

    @property
    @abstractmethod
    def travel(self) -> float:
        """Way of the encoder since its count began, position unit: independent of the coordinate system."""

    @abstractmethod
    def place(self, modulo: Modulo) -> tuple[int, float]:
        """Return modulo cycle and position within the range."""

    @abstractmethod
    def shift(self, offset: float) -> None:
        """Move the coordinate system so that the position grows by `offset`."""

    def transfer(self, position: float) -> None:
        """Show `position` from now on (`MC_SetSensor`); an absolute encoder remembers by how much that
        corrects it.
        """
        offset = position - self.position
        self._correction += offset
        self.shift(offset)

    def keep_offset(self) -> None:
        """Make the present relation of encoder value and position the one that
        outlasts power-off (`AbsEncoderOffset`).

        What a backlash compensation adds belongs to it: it holds for the flank that is touched now (CFG-568).
        """
        self._offset += self.compensation
        self.compensation = 0.0
        self._abs_offset.value = self._offset
        self._correction = 0.0

    def discard_correction(self) -> None:
        """Take back what `transfer` has corrected at an absolute encoder
        (MC-389); an incremental one keeps it.
        """
        correction, self._correction = self._correction, 0.0
        if correction and self.scale.kind != INCREMENTAL:
            self.shift(-correction)


class EncoderFeedback(Feedback):
    """Actual values from the count of an encoder.

    The count is unwrapped to an integer of unlimited length, so that an endless axis does not
    drift: a position is an offset and the increments since a count that belongs to it,
    multiplied once (LIM-098, LIM-102).

    Args:
        source: Port that brings the count.
        scale: Ratios and format of the encoder.
        cycle_s: Application cycle, s.
        abs_offset: Cell of `StatusSensor[n].AbsEncoderOffset`, which outlasts power-off.
        before: The same encoder before a restart of the technology object or of the controller; None at
            its first start.
        powered_off: Whether the controller has been without supply meanwhile.

    """

    def __init__(
        self,
        source: EncoderSource,
        scale: EncoderScale,
        cycle_s: float,
        abs_offset: Cell[float],
        *,
        before: Feedback | None = None,
        powered_off: bool = False,
    ) -> None:
        super().__init__(source, scale, abs_offset)
        self._increment = scale.increment
        self._rate = 1.0 / cycle_s
        self._unit_per_rpm = scale.unit_per_rpm if scale.velocity_from_drive else 0.0
        self._full = 1 << scale.bits
        self._half = self._full >> 1
        self._last_raw = 0
        self._count = 0
        self._base = 0
        """Count at which the position is `_offset`."""
        self._restarts = 0
        self._fresh = True
        self._retained: int | None = None
        if scale.kind != INCREMENTAL:
            self._offset = abs_offset.value
            if isinstance(before, EncoderFeedback):
                self._go_on(before, powered_off=powered_off)

    def _go_on(self, before: EncoderFeedback, *, powered_off: bool) -> None:
        """Take over what an absolute encoder has counted before a restart (CFG-115), or what is kept over
        power-off (CFG-292).
        """
        if before._fresh:
            self._retained = before._retained
        elif powered_off:
            self._retained = before._count
        elif before.scale.increment == self._increment and before._full == self._full:
            self._count, self._last_raw, self._restarts = before._count, before._last_raw, before._restarts
            self._base = before._base
            self._fresh = False
            self.position = (self._count - self._base) * self._increment + self._offset

    @override
    def update(self) -> None:
        """Take over the encoder count of this cycle."""
        source = self.source
        self.last_velocity = self.velocity
        if not source.link_ok or source.sensor_fault:
            if source.sensor_fault and self.state == VALID and self.scale.kind == INCREMENTAL:
                self.lost_reference = True  # what it has counted wrong nobody knows (HOM-179)
            self.state = NOT_VALID
            self.velocity = 0.0
            if self.compensation:  # which is added again in every cycle
                self.position = (self._count - self._base) * self._increment + self._offset
            return
        raw = source.encoder_increments
        if self._fresh or source.encoder_restarts != self._restarts:
            self._begin(raw)
            return
        delta = (raw - self._last_raw + self._half) % self._full - self._half
        self._last_raw = raw
        self._count += delta
        if self.state != VALID:
            # Back after a gap: the distance of several cycles is no velocity.
            self.state = VALID
            self.velocity = 0.0
        else:
            self.velocity = delta * self._increment * self._rate
        if self._unit_per_rpm:
            self.velocity = source.actual_speed_rpm * self._unit_per_rpm
        self.position = (self._count - self._base) * self._increment + self._offset

    def _begin(self, raw: int) -> None:
        """Take the first value, or a count with a new reference.

        An absolute encoder defines the position with it, an incremental one continues from the last known
        position, but is not homed any more.
        """
        scale = self.scale
        if scale.kind == INCREMENTAL:
            if not self._fresh:
                self.lost_reference = True
            self._offset = self.position
            self._count = self._base = 0
        else:
            self._base = 0
            known = self._retained if self._fresh else self._count
            self._count = raw
            if self.source.absolute_from_zero and 0 < scale.range_counts <= self._half:
                # The count may have run on since the device was switched on: of what the encoder knows that
                # is one range (CFG-296).
                self._count %= scale.range_counts
            if scale.kind == CYCLIC_ABSOLUTE and scale.range_counts and known is not None:
                # The measuring ranges passed so far count on, the nearest one of them (CFG-292, CFG-298).
                self._count += round((known - self._count) / scale.range_counts) * scale.range_counts
            self._retained = None
        self._fresh = False
        self._restarts = self.source.encoder_restarts
        self._last_raw = raw
        self.position = (self._count - self._base) * self._increment + self._offset
        self.velocity = 0.0
        self.state = VALID

    @override
    def ahead(self, raw: int) -> float:
        """Return how far a raw count lies ahead of the present position, axis unit."""
        return ((raw - self._last_raw + self._half) % self._full - self._half) * self._increment

    @property
    @override
    def travel(self) -> float:
        """Way of the encoder since its count began, axis unit: the position
        without any relation to the machine.
        """
        return self._count * self._increment

    @override
    def place(self, modulo: Modulo) -> tuple[int, float]:
        """Return modulo cycle and position within the range, to the increment however often the range has
        been passed.
        """
        if not modulo.enabled:
            return 0, self.position
        if self._fresh:  # the offset of an absolute encoder says nothing before its first value
            return modulo.exact_place(Fraction(self.position))
        exact = Fraction(self._offset) + (self._count - self._base) * self.scale.exact_increment
        return modulo.exact_place(exact + Fraction(self.compensation))

    @override
    def shift(self, offset: float) -> None:
        """Move the coordinate system so that the position grows by `offset`.

        An incremental encoder counts again from there, so that the way up to now
        takes no digits any more (LIM-101).
        """
        self.position += offset
        if self.scale.kind == INCREMENTAL:
            self._offset = self.position - self.compensation
            self._base = self._count
        else:
            self._offset += offset


class _NoSource:
    """Source of an axis without encoder."""

    absolute_from_zero = False

    def __init__(self) -> None:
        self.link_ok = True
        self.sign_lost = self.sensor_fault = False
        self.mark: MarkSearch | None = None
        self.probes: tuple[tuple[MarkSearch, MarkSearch], ...] = ()
        self.encoder_increments = self.encoder_restarts = 0
        self.actual_speed_rpm = 0.0

    def probe_level(self, number: int) -> bool | None:  # noqa: ARG002 - the interface of a port
        """Say nothing: there are no probes."""
        return None


class _NoFeedback(Feedback):
    """Feedback of an axis without encoder: it stands at 0 and is valid."""

    def __init__(self) -> None:
        scale = EncoderScale(
            kind=INCREMENTAL,
            fine=1,
            exact_increment=Fraction(0),
            increment=0.0,
            bits=32,
            range_counts=0,
            velocity_from_drive=False,
            reference=0.0,
            unit_per_rpm=0.0,
        )
        super().__init__(_NoSource(), scale, Cell(0.0))
        self.state = VALID

    @override
    def update(self) -> None:
        pass

    @override
    def ahead(self, raw: int) -> float:
        return 0.0

    @property
    @override
    def travel(self) -> float:
        return 0.0

    @override
    def place(self, modulo: Modulo) -> tuple[int, float]:
        return 0, 0.0

    @override
    def shift(self, offset: float) -> None:
        pass


NO_FEEDBACK: Final[Feedback] = _NoFeedback()
"""Of an axis without positions."""
