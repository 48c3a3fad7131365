"""Touch probe: two latches for the position at an edge of an input or at the index (C402-142 to C402-152).

The latch belongs to the instant of the event, not to a cycle: an edge between two servo instants gets the
position that the machine had then, an edge that the load makes gets its place, an index its increment. The
result shows at the next servo instant. While no probe is on, nothing of this runs.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import TYPE_CHECKING, Any, Final

from emulators.drive.machine import INPUT_BITS, PROBE_INPUTS
from emulators.mechanics import SwitchModel, passing_time, position_within
from fieldbus.canopen.abort import AbortCode, SdoAbort
from fieldbus.clock import S, Scheduler

if TYPE_CHECKING:
    from emulators.drive.cia402.axis import ProfileAxis
    from fieldbus.canopen.slave import CanopenSlave

_ON: Final = 0x01
_CONTINUOUS: Final = 0x02
_SOURCE_BITS: Final = 0x0C
_INDEX: Final = 0
"""Internal number of the source "index"; 1 and 2 are the probe inputs."""
_SOURCES: Final = {1: 1, 2: 2, 5: _INDEX, 6: _INDEX}
"""Values of 60D0h; both encoders of the profile are the motor encoder here."""
_POSITIVE: Final = 0
_NEGATIVE: Final = 1


class _Channel:
    """One probe: what it was switched on with, and what it has stored."""

    def __init__(self, number: int) -> None:
        self.number = number
        """0 or 1."""
        self.on = False
        self.continuous = False
        self.source = 0
        self.edges = 0
        """Bit 0 positive, bit 1 negative: what is still waited for."""
        self.stored = 0
        """Bit 0 positive, bit 1 negative edge stored."""
        self.toggle = False
        self.generation = 0
        """Counts how often the probe has been switched on."""

    def wants(self, source: int, edge: int) -> bool:
        """Return whether an event is for this probe; a first event is taken once."""
        if not (self.on and self.source == source and self.edges >> edge & 1):
            return False
        if not self.continuous:
            self.edges &= ~(1 << edge)
        return True


class TouchProbe:
    """Objects 60B8h to 60BDh and 60D0h to 60D8h of a drive.

    Args:
        scheduler: Time of the bench.
        slave: Holds the objects.
        axis: Mechanics, encoder and units.
        servo_period_ns: Distance of the servo instants, ns.

    """

    def __init__(
        self, scheduler: Scheduler, slave: CanopenSlave, axis: ProfileAxis, *, servo_period_ns: int
    ) -> None:
        self._scheduler = scheduler
        self._slave = slave
        self._axis = axis
        self._period_ns = servo_period_ns
        self._period_s = servo_period_ns / S
        self._channels = (_Channel(0), _Channel(1))
        self.on_event: Callable[[int, str, int, int], None] = _nothing
        """Called with probe 1 or 2, "positive" or "negative", position in position units and time, ns."""

    def reset(self) -> None:
        """Switch both probes off and count from zero, as at power-on; values are those of the dictionary."""
        self._axis.core.encoder.unwatch_zero_mark(self._on_index)
        for channel in self._channels:
            channel.on = False
            channel.edges = channel.stored = 0
        self.show()

    # -- objects ---------------------------------------------------------------------------------------

    def on_function(self, value: int) -> None:
        """Take 60B8h: a probe looks at its bits when it is switched on and at no other time (C402-151).

        Raises:
            SdoAbort: 06090030h, the source is reserved.

        """
        halves = (value & 0xFF, value >> 8 & 0xFF)
        if any(half & _SOURCE_BITS == _SOURCE_BITS for half in halves):
            raise SdoAbort(AbortCode.VALUE)
        for channel, half in zip(self._channels, halves, strict=True):
            if bool(half & _ON) is channel.on:
                continue
            channel.on = bool(half & _ON)
            channel.stored = 0
            channel.toggle = False
            if channel.on:
                channel.generation += 1
                channel.continuous = bool(half & _CONTINUOUS)
                channel.edges = half >> 4 & 3
                channel.source = self._source(channel.number, half >> 2 & 3)
        encoder = self._axis.core.encoder
        if any(channel.on and channel.source == _INDEX for channel in self._channels):
            encoder.watch_zero_mark(self._on_index)
        else:
            encoder.unwatch_zero_mark(self._on_index)
        self.show()

    @staticmethod
    def on_source(value: int) -> None:
        """Check 60D0h.

        Raises:
            SdoAbort: 06090030h, there is no such source.

        """
        if value not in _SOURCES:
            raise SdoAbort(AbortCode.VALUE)

    def _source(self, number: int, selection: int) -> int:
        if selection == 0:
            return number + 1
        if selection == 1:
            return _INDEX
        return _SOURCES[self._slave.values[0x60D001 + number]]

    def show(self) -> None:
        """Update 60B9h: on, stored edges, toggle of continuous events (bit 6), level of the input (bit 7)."""
        status = 0
        for channel in self._channels:
            half = 0
            if channel.on:
                half = _ON | channel.stored << 1 | channel.toggle << 6
                if channel.source and self._axis.inputs >> INPUT_BITS[PROBE_INPUTS[channel.source - 1]] & 1:
                    half |= 0x80
            status |= half << 8 * channel.number
        self._slave.set(0x60B9, 0, status)

    # -- events ----------------------------------------------------------------------------------------

    def on_input(self, source: int, switch: SwitchModel) -> None:
        """Take an edge of probe input 1 or 2 at the instant at which it comes."""
        edge = _POSITIVE if switch.state else _NEGATIVE
        store = self._storage(source, edge)
        if not store:
            return
        core = self._axis.core
        mechanics = core.mechanics
        now = self._scheduler.now
        place = switch.edge
        if place is not None:
            # The load has passed the place within the step that ends now.
            elapsed = passing_time(
                mechanics.step_start, mechanics.position, mechanics.velocity, self._period_s, place
            )
            time_ns = now - self._period_ns + round(elapsed * S)
            increments = core.encoder.increments_at(place / mechanics.ratio)
            for finish in store:
                finish(increments, time_ns)
            return
        # Where the machine is now will be known at the next servo instant, which can be this one.
        since_step = now % self._period_ns
        start = (mechanics.motor_angle, mechanics.motor_speed)

        def latch() -> None:
            angle = mechanics.motor_angle
            if since_step:
                angle = position_within(*start, angle, self._period_s, since_step / S)
            increments = core.encoder.increments_at(angle)
            for finish in store:
                finish(increments, now)

        self._scheduler.at(now - since_step + self._period_ns if since_step else now, latch)

    def _on_index(self, increments: int, before: float, mark: float, after: float) -> None:
        """Take a zero mark: an event with a positive edge only."""
        store = self._storage(_INDEX, _POSITIVE)
        if store:
            speed = self._axis.core.mechanics.motor_speed
            elapsed = passing_time(before, after, speed, self._period_s, mark)
            time_ns = self._scheduler.now - self._period_ns + round(elapsed * S)
            for finish in store:
                finish(increments, time_ns)

    def _storage(self, source: int, edge: int) -> list[Callable[[int, int], None]]:
        """Return what has to be called with increments and time of an event, for
        every probe that waits for it.
        """
        return [
            partial(self._store, channel, channel.generation, edge)
            for channel in self._channels
            if channel.wants(source, edge)
        ]

    def _store(self, channel: _Channel, generation: int, edge: int, increments: int, time_ns: int) -> None:
        if not channel.on or channel.generation != generation:
            return  # switched off while the latch was being read
        slave = self._slave
        axis = self._axis
        place = 2 * channel.number + edge
        position = axis.units.to_user_position(increments + axis.home_shift)
        slave.set(0x60BA + place, 0, position)
        slave.set(0x60D1 + place, 0, time_ns & 0xFFFFFFFF)
        slave.set(0x60D5 + place, 0, slave.values[0x60D5 + place << 8] + 1 & 0xFFFF)
        channel.stored |= 1 << edge
        if channel.continuous:
            channel.toggle = not channel.toggle
        self.show()
        self.on_event(channel.number + 1, "negative" if edge else "positive", position, time_ns)


def _nothing(*_event: Any) -> None:
    pass
