"""A position channel: from raw steps to position, speed, cams and work area (C406-003 to
C406-008, C406-049, C406-052).
"""

from __future__ import annotations

from collections import deque
from itertools import pairwise
from typing import Any, Final

from emulators.encoder.cia406._objects import CAMS
from emulators.encoder.cia406._sensor import Sensor
from emulators.encoder.cia406.config import EncoderDeviceConfig
from fieldbus.cia406 import AreaState, OperatingParameter

_NM_PER_MS_IN_SPEED_STEPS: Final = 10
"""1 nm per ms is 0.001 mm/s, a tenth of the unit 0.01 mm/s of 6005h:2."""
_LOWEST: Final = -0x8000
_HIGHEST: Final = 0x7FFF


class Scaling:
    """The settings that make a position of raw steps, as they are in effect.

    Args:
        config: The encoder.

    """

    def __init__(self, config: EncoderDeviceConfig) -> None:
        self._config = config
        self.raw_range = config.raw_range
        self.on = False
        self.reversed = False
        self.numerator: int = 1
        self.resolution: int = 1
        self.total: int = config.raw_range
        """Values of 6004h: it lies in 0..total - 1."""

    def take(self, values: dict[int, Any]) -> None:
        """Take 6000h, 6001h or 6005h, and 6002h over; 6002h falls to the largest range available."""
        word = values[0x600000]
        linear = self._config.kind.linear
        self.on = bool(word & OperatingParameter.SCALING)
        self.reversed = bool(
            word & (OperatingParameter.MEASURING_DIRECTION if linear else OperatingParameter.CODE_SEQUENCE)
        )
        self.numerator, self.resolution = (
            (self._config.measuring_step_nm, max(1, values[0x600501]))
            if linear
            else (max(1, values[0x600100]), self._config.steps_per_revolution)
        )
        values[0x600200] = max(1, min(values[0x600200], self.largest_total(values)))
        self.total = values[0x600200] if self.on else self.raw_range

    def largest_total(self, values: dict[int, Any]) -> int:
        """Return the largest 6002h that the units of 6001h or 6005h:1 allow (formula of C406-008)."""
        if self._config.kind.linear:
            return max(1, self.raw_range * self._config.measuring_step_nm // max(1, int(values[0x600501])))
        return max(1, int(values[0x600100])) * self._config.turns

    def scaled(self, steps: int) -> int:
        """Return raw steps, folded or not, in the measuring units in effect."""
        return steps * self.numerator // self.resolution if self.on else steps


class Channel:
    """Position, motion, cams and work area of one sensor.

    Args:
        number: Sub-index of the channel in the arrays, from 1.
        sensor: What senses.
        scaling: Settings in effect, common to all channels.
        values: Present values of the objects.
        config: The encoder.

    """

    def __init__(
        self,
        number: int,
        sensor: Sensor,
        *,
        scaling: Scaling,
        values: dict[int, Any],
        config: EncoderDeviceConfig,
    ) -> None:
        self.number = number
        self._enable_key = 0x630100 | number
        self._scaling = scaling
        self._values = values
        self._config = config
        self._history: deque[int] = deque(maxlen=4)
        self._interval = 1
        self._active = 0
        self._steps = 0
        self._derived = True
        self._speed = self._acceleration = self._jerk = 0
        self.cams = 0
        """6300h: state of the cams."""
        self.area = 0
        """6400h: state of the work area."""
        self.sensor = sensor
        self.offset = 0
        """Difference between position and scaled raw value, from the preset (6509h, C406-005)."""
        self.raw = 0
        """600Ch: as sensed, whatever 6000h says."""
        self.position = 0
        """6004h, or 6020h of a multi-sensor device."""
        self.unfolded = 0
        """6008h: the position before it is folded into 6002h."""

    # -- position --------------------------------------------------------------------------------------

    def _count(self) -> int:
        """Sample; returns the count in the direction of the code sequence, not folded."""
        self._steps = count = self.sensor.read()
        self.raw = count % self._scaling.raw_range
        return -count if self._scaling.reversed else count

    def sample(self, *, hold: bool) -> bool:
        """Form position, cams and work area of this instant; with `hold` they stay what they were (C406-050).

        Returns:
            Whether a cam or the state of the area has changed.

        """
        scaling = self._scaling
        self._steps = count = self.sensor.read()
        self.raw = steps = count % scaling.raw_range
        if not hold:
            if scaling.reversed:
                steps = -count % scaling.raw_range
            if scaling.on:
                steps = steps * scaling.numerator // scaling.resolution
            self.unfolded = unfolded = steps + self.offset
            self.position = unfolded % scaling.total
        cams = self._find_cams() if self._active or self._values[self._enable_key] else 0
        area = self._find_area()
        if cams == self.cams and area == self.area:
            return False
        self.cams, self.area = cams, area
        return True

    def preset(self, value: int) -> None:
        """Make the position of this instant `value`, whatever moves (C406-005, C406-006)."""
        scaling = self._scaling
        self.offset = value - scaling.scaled(self._count() % scaling.raw_range)

    def restart(self) -> None:
        """Begin without a past: no speed, no cam with hysteresis."""
        self._history.clear()
        self._active = self.cams = self.area = 0
        self._derived = True
        self._speed = self._acceleration = self._jerk = 0

    # -- motion ----------------------------------------------------------------------------------------

    def cycle(self) -> int:
        """Take note of the position of this millisecond; returns the raw steps moved since the last one."""
        interval = max(1, self._values[0x603102])  # an EDS of others may have 0 here
        past = self._history
        if interval != self._interval:
            self._interval = interval
            past = self._history = deque(past, maxlen=3 * interval + 1)
        before = past[-1] if past else None
        now = self._steps
        past.append(now)
        self._derived = False
        return 0 if before is None else now - before

    @property
    def speed(self) -> int:
        """6030h: difference of two positions one interval T (6031h:2) apart."""
        self._derive()
        return self._speed

    @property
    def acceleration(self) -> int:
        """6040h: difference of two speeds T apart."""
        self._derive()
        return self._acceleration

    @property
    def jerk(self) -> int:
        """6050h: difference of two accelerations T apart."""
        self._derive()
        return self._jerk

    def _derive(self) -> None:
        """Work out the motion of the last cycle, once, and only on demand."""
        if self._derived:
            return
        self._derived = True
        self._speed = self._acceleration = self._jerk = 0
        past, interval = self._history, self._interval
        count = len(past)
        if count <= interval:
            return
        sign = -1 if self._scaling.reversed else 1
        counts = [sign * past[-1 - back * interval] for back in range(min(4, 1 + (count - 1) // interval))]
        values = self._values
        multiplier, divider = values[0x603103], max(1, values[0x603104])
        if self._config.kind.linear:
            step = self._config.measuring_step_nm
            interval = self._interval
            differences = _differences([step * count for count in counts])
            speed_unit = _NM_PER_MS_IN_SPEED_STEPS * interval * max(1, values[0x600502])
            self._speed = _limited(differences[0] * multiplier, speed_unit * divider)
            # 1 nm per ms² is 1 mm/s², 1 nm per ms³ is 1000 mm/s³.
            if len(differences) > 1:
                self._acceleration = _limited(differences[1], interval**2 * max(1, values[0x600503]))
            if len(differences) > 2:
                self._jerk = _limited(1000 * differences[2], interval**3 * max(1, values[0x600504]))
            return
        scaled = counts if values[0x603101] else [self._scaling.scaled(count) for count in counts]
        differences = _differences(scaled)
        self._speed = _limited(differences[0] * multiplier, divider)
        if len(differences) > 1:
            self._acceleration = _limited(differences[1], 1)
        if len(differences) > 2:
            self._jerk = _limited(differences[2], 1)

    # -- cams and work area ----------------------------------------------------------------------------

    def _find_cams(self) -> int:
        """Return the state register 6300h at the present position (C406-049)."""
        values = self._values
        enabled: int = values[self._enable_key]
        if not enabled:
            self._active = 0
            return 0
        number = self.number
        position = self.position
        active = 0
        for cam in range(CAMS):
            bit = 1 << cam
            if enabled & bit:
                key = cam << 8 | number
                play = values[0x633000 + key] if self._active & bit else 0
                if values[0x631000 + key] - play <= position <= values[0x632000 + key] + play:
                    active |= bit
        self._active = active
        return int((active ^ values[0x630200 | number]) & enabled)

    def _find_area(self) -> int:
        """Return the area state register 6400h at the present position."""
        values = self._values
        if self.position > values[self._enable_key + 0x10100]:
            return AreaState.OUT_OF_RANGE | AreaState.OVERFLOW
        if self.position < values[self._enable_key + 0x10000]:
            return AreaState.OUT_OF_RANGE | AreaState.UNDERFLOW
        return 0


def _differences(points: list[int]) -> list[int]:
    """Return first, second and third difference of points in descending order of
    time, as far as there are points.
    """
    found = []
    while len(points) > 1:
        points = [new - old for new, old in pairwise(points)]
        found.append(points[0])
    return found


def _limited(numerator: int, denominator: int) -> int:
    """Return a quotient without its fraction, held at the ends of I16."""
    value = abs(numerator) // denominator
    return max(_LOWEST, -value) if numerator < 0 else min(_HIGHEST, value)
