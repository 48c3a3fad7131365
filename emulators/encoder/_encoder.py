"""Rotary encoders: what the drive believes of the shaft, and the ways in which it can be wrong.

Position is kept twice: as a float angle for the control loop and as an exact integer number of increments for
everything that is reported. The integer is derived from the undisturbed angle plus an integer offset, so that
it never drifts.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import TYPE_CHECKING, Final

from fieldbus.errors import ConfigurationError

if TYPE_CHECKING:
    import numpy as np

_TAU: Final = 2.0 * math.pi

ZeroMarkListener = Callable[[int, float, float, float], None]
"""Gets the position of a zero mark, increments, and the shaft angles before it, at it and after it, rad."""


class RotaryEncoder:
    """Encoder on a shaft. Use `IncrementalEncoder` or `AbsoluteEncoder`.

    Args:
        counts_per_revolution: Increments per revolution, 4..2^31.
        reversed_direction: True: the value falls while the shaft turns in positive direction.
        zero_mark_counts: Place of the zero mark within the revolution, increments,
            0..counts_per_revolution - 1.
        interpolated: True (default): the angle handed to the control loop is finer than an increment, as
            that of a sine/cosine encoder; False: it has steps of one increment.
        rng: Source of the noise; needed only when noise is switched on.

    Raises:
        ConfigurationError: A value is outside its range.

    """

    def __init__(
        self,
        *,
        counts_per_revolution: int = 131072,
        reversed_direction: bool = False,
        zero_mark_counts: int = 0,
        interpolated: bool = True,
        rng: np.random.Generator | None = None,
    ) -> None:
        if not 4 <= counts_per_revolution <= 1 << 31:
            raise ConfigurationError("counts_per_revolution", counts_per_revolution, "4..2147483648")
        if not 0 <= zero_mark_counts < counts_per_revolution:
            raise ConfigurationError("zero_mark_counts", zero_mark_counts, f"0..{counts_per_revolution - 1}")
        self._counts = int(counts_per_revolution)
        self._inc_per_rad = self._counts / _TAU
        self._rad_per_inc = _TAU / self._counts
        self.direction = -1.0 if reversed_direction else 1.0
        """-1.0: the value falls while the shaft turns in positive direction."""
        self._zero_mark = int(zero_mark_counts)
        self._interpolated = interpolated
        self._rng = rng
        self._offset_increments = 0
        self.offset = 0.0
        """Measured angle where the shaft is at zero, rad."""
        self._raw = 0.0
        self._noise = 0
        self._noise_now = 0
        self._frozen = False
        self._factor = 1.0
        self._anchor = (0.0, 0.0)
        self._true = 0.0
        self._armed = False
        self._loss_every = 0
        self._loss_start = 0
        self._lost = 0
        self.plain = interpolated
        """Whether a sample is nothing but the angle of the shaft times `direction` plus `offset`."""
        self._listeners: tuple[ZeroMarkListener, ...] = ()
        self.zero_mark_present = True
        """False: the zero mark never comes (a dirty disc, a broken wire)."""
        self.latched_increments: int | None = None
        """Position at the first zero mark after `arm_zero_mark`, increments; None: not passed yet."""

    @property
    def counts_per_revolution(self) -> int:
        """Increments per revolution."""
        return self._counts

    @property
    def radians_per_increment(self) -> float:
        """Size of an increment, rad."""
        return self._rad_per_inc

    @property
    def increments(self) -> int:
        """Position at the last sample, whole increments (nearest), not wrapped."""
        return math.floor(self._raw * self._inc_per_rad + 0.5) + self._offset_increments + self._noise_now

    @property
    def angle(self) -> float:
        """Angle that `sample` returned last, rad."""
        if not self._interpolated:
            return self.increments * self._rad_per_inc
        return self._raw + self.offset + self._noise_now * self._rad_per_inc

    def sample(self, shaft_angle: float) -> float:
        """Take over the angle of the shaft (rad) and return the measured
        angle, rad, continuous over turns.
        """
        if self.plain:
            self._raw = raw = shaft_angle * self.direction
            return raw + self.offset
        return self._sample_special(shaft_angle)

    def note_sample(self, shaft_angle: float) -> None:
        """Let this angle (rad) be that of the last sample, of an encoder that is `plain`."""
        self._raw = shaft_angle * self.direction

    def power_on(self, shaft_angle: float) -> None:
        """Start up at the shaft angle (rad): what survives a power cycle depends on the kind of encoder."""
        self._raw = self._true = shaft_angle * self.direction
        self._anchor = (self._raw, self._raw)
        self._armed = False
        self.latched_increments = None
        self._set_offset(self._initial_offset(math.floor(self._raw * self._inc_per_rad + 0.5)))
        self._settle()

    # -- zero mark -------------------------------------------------------------------------------------------

    def arm_zero_mark(self, armed: bool = True) -> None:
        """Latch the exact position of the next zero mark into
        `latched_increments`, or stop waiting for it.
        """
        self._armed = armed
        if armed:
            self.latched_increments = None
        self._settle()

    def watch_zero_mark(self, listener: ZeroMarkListener) -> None:
        """Call `listener` at every zero mark from now on, within the sample that
        finds it; once is enough to ask.
        """
        if listener not in self._listeners:
            self._listeners = (*self._listeners, listener)
            self._settle()

    def unwatch_zero_mark(self, listener: ZeroMarkListener) -> None:
        """Call `listener` no more; harmless when it was not called anyway."""
        self._listeners = tuple(one for one in self._listeners if one != listener)
        self._settle()

    def increments_at(self, shaft_angle: float) -> int:
        """Return what a latch holds that is triggered while the shaft stands
        at an angle (rad), increments.
        """
        raw = self._raw if self._frozen else self._scaled(shaft_angle * self.direction)
        return math.floor(raw * self._inc_per_rad + 0.5) + self._offset_increments + self._noise_now

    # -- faults ----------------------------------------------------------------------------------------------

    @property
    def frozen(self) -> bool:
        """Whether the value stands still whatever the shaft does."""
        return self._frozen

    def freeze(self, frozen: bool) -> None:
        """Hold the value; after release the encoder shows the true position again, with a jump."""
        self._frozen = frozen
        self._settle()

    def jump(self, increments: int) -> None:
        """Add an offset to the position for good (slipped coupling, lost counts)."""
        self._set_offset(self._offset_increments + int(increments))

    def set_noise(self, amplitude_increments: int) -> None:
        """Disturb every sample by -amplitude..+amplitude increments, evenly distributed; 0 = off.

        Raises:
            ConfigurationError: The amplitude is negative, or the encoder was
                built without a random generator.

        """
        if amplitude_increments < 0:
            raise ConfigurationError("amplitude_increments", amplitude_increments, ">= 0")
        if amplitude_increments and self._rng is None:
            raise ConfigurationError(
                "amplitude_increments", amplitude_increments, "0, since the encoder has no rng"
            )
        self._noise = int(amplitude_increments)
        if not self._noise:
            self._noise_now = 0
        self._settle()

    def scale(self, factor: float) -> None:
        """Count `factor` times what the shaft moves from now on (a wrong disc, a
        wrong ratio); 1 = rightly again.

        What was counted wrongly stays.

        Raises:
            ConfigurationError: The factor is not a number above 0.

        """
        if not 0.0 < factor < math.inf:
            raise ConfigurationError("factor", factor, "a number > 0")
        true = self._raw if self._factor == 1.0 else self._true
        if self._factor != 1.0:
            self._set_offset(
                self._offset_increments + math.floor((self._raw - true) * self._inc_per_rad + 0.5)
            )
            self._raw = true
        self._factor = factor
        self._true = true
        self._anchor = (true, true)
        self._settle()

    def _scaled(self, true: float) -> float:
        if self._factor == 1.0:
            return true
        start, shown = self._anchor
        return shown + (true - start) * self._factor

    def reverse(self, reversed_direction: bool) -> None:
        """Set the counting direction; the present position stays."""
        sign = -1.0 if reversed_direction else 1.0
        if sign != self.direction:
            factor = self._factor
            self.scale(1.0)
            before = self.increments
            self.direction = sign
            self._raw = -self._raw
            self._set_offset(self._offset_increments + before - self.increments)
            self.scale(factor)

    def lose_steps(self, every: int) -> None:
        """Miss one of `every` increments that the shaft moves from now on (a
        dirty disc); 0 = count all again.

        What was missed stays missed.

        Raises:
            ConfigurationError: `every` is 1 or negative.

        """
        if every != 0 and every < 2:
            raise ConfigurationError("every", every, "0, or 2 and more")
        self._loss_every = int(every)
        self._loss_start = math.floor(self._raw * self._inc_per_rad + 0.5)
        self._lost = 0
        self._settle()

    # -- inside ----------------------------------------------------------------------------------------------

    def _initial_offset(self, raw_increments: int) -> int:
        raise NotImplementedError

    def _set_offset(self, increments: int) -> None:
        self._offset_increments = increments
        self.offset = increments * self._rad_per_inc

    def _settle(self) -> None:
        self.plain = self._interpolated and not (
            self._frozen
            or self._armed
            or self._noise
            or self._loss_every
            or self._listeners
            or self._factor != 1.0
        )

    def _sample_special(self, shaft_angle: float) -> float:
        if not self._frozen:
            before = self._raw
            self._true = true = shaft_angle * self.direction
            self._raw = raw = self._scaled(true)
            if self._loss_every:
                self._miss_steps()
            if (self._armed or self._listeners) and self.zero_mark_present and raw != before:
                self._look_for_zero_mark(before, raw)
        if self._noise and self._rng is not None:
            self._noise_now = int(self._rng.integers(-self._noise, self._noise, endpoint=True))
        return self.angle

    def _miss_steps(self) -> None:
        moved = math.floor(self._raw * self._inc_per_rad + 0.5) - self._loss_start
        lost = int(moved / self._loss_every)
        if lost != self._lost:
            self._set_offset(self._offset_increments - lost + self._lost)
            self._lost = lost

    def _look_for_zero_mark(self, before: float, after: float) -> None:
        start = before * self._inc_per_rad - self._zero_mark
        end = after * self._inc_per_rad - self._zero_mark
        turn_before = math.floor(start / self._counts)
        turn_after = math.floor(end / self._counts)
        if turn_before == turn_after:
            return
        turn = turn_before + 1 if after > before else turn_before
        mark = turn * self._counts + self._zero_mark
        latched = mark + self._offset_increments
        for listener in self._listeners:
            listener(
                latched,
                before * self.direction,
                mark * self._rad_per_inc * self.direction,
                after * self.direction,
            )
        if self._armed:
            self.latched_increments = latched
            self._armed = False
            self._settle()


class IncrementalEncoder(RotaryEncoder):
    """Counts from zero at power-on; has a zero mark once per revolution."""

    def _initial_offset(self, raw_increments: int) -> int:
        return -raw_increments


class AbsoluteEncoder(RotaryEncoder):
    """Knows its position at power-on within its range of turns.

    Args:
        turns: Distinguishable revolutions: 1 = single-turn; 1..65536.
        mounting_offset: Value of the encoder where the shaft is at zero, increments.
        counts_per_revolution: As `RotaryEncoder`, like the following.
        reversed_direction: See there.
        zero_mark_counts: See there.
        interpolated: See there.
        rng: See there.

    """

    def __init__(
        self,
        *,
        turns: int = 4096,
        mounting_offset: int = 0,
        counts_per_revolution: int = 131072,
        reversed_direction: bool = False,
        zero_mark_counts: int = 0,
        interpolated: bool = True,
        rng: np.random.Generator | None = None,
    ) -> None:
        super().__init__(
            counts_per_revolution=counts_per_revolution,
            reversed_direction=reversed_direction,
            zero_mark_counts=zero_mark_counts,
            interpolated=interpolated,
            rng=rng,
        )
        if not 1 <= turns <= 65536:
            raise ConfigurationError("turns", turns, "1..65536")
        self._turns = int(turns)
        self._mounting = int(mounting_offset)
        self._set_offset(self._mounting)

    @property
    def turns(self) -> int:
        """Distinguishable revolutions."""
        return self._turns

    @property
    def absolute_value(self) -> int:
        """What the encoder transmits: 0 .. turns * counts_per_revolution - 1."""
        return self.increments % (self._turns * self._counts)

    def jump(self, increments: int) -> None:
        """Add an offset that also survives a power cycle."""
        self._mounting += int(increments)
        super().jump(increments)

    def _initial_offset(self, raw_increments: int) -> int:
        # The drive counts on from the value read at power-on, taken into the range around zero.
        span = self._turns * self._counts
        value = (raw_increments + self._mounting + span // 2) % span - span // 2
        return value - raw_increments
