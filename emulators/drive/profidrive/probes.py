"""Probe inputs of an axis at its encoder interface: latched to the increment."""

from __future__ import annotations

from collections.abc import Callable

from emulators.drive.core import ServoCore
from emulators.encoder.profidrive import EncoderInterface
from emulators.mechanics import SwitchModel, position_within
from fieldbus.clock import S, Scheduler


class ProbeLatch:
    """Gives edges to the encoder interface: at their place, or, when the load had no
    part in them, at their instant.

    Args:
        scheduler: Time of the bench.
        core: Servo core with the motor encoder.
        interface: Encoder interface of that encoder.
        period_ns: Servo step, ns.

    """

    def __init__(
        self, scheduler: Scheduler, core: ServoCore, interface: EncoderInterface, *, period_ns: int
    ) -> None:
        self._scheduler = scheduler
        self._core = core
        self.listeners: list[Callable[[int, bool, int], object]] = [interface.probe_edge]
        """Called with number, edge (rising) and increments of the motor encoder."""
        self.others: list[Callable[[int, bool, float], object]] = []
        """Called with number, edge (rising) and the angle of the motor, rad: other encoders."""
        self._period_ns = period_ns

    def on_edge(self, number: int, switch: SwitchModel) -> None:
        """Take an edge of probe input 1 or 2 within the step of the machine in which it comes."""
        core = self._core
        mechanics = core.mechanics
        rising = switch.state
        place = switch.edge
        if place is not None:
            self._tell(number, rising, place / mechanics.ratio)
            return
        # Where the machine is now will be known at the next servo instant, which can be this one.
        now = self._scheduler.now
        since_step = now % self._period_ns
        start = (mechanics.motor_angle, mechanics.motor_speed)

        def latch() -> None:
            angle = mechanics.motor_angle
            if since_step:
                angle = position_within(*start, angle, self._period_ns / S, since_step / S)
            self._tell(number, rising, angle)

        self._scheduler.at(now - since_step + self._period_ns if since_step else now, latch)

    def _tell(self, number: int, rising: bool, angle: float) -> None:
        increments = self._core.encoder.increments_at(angle)
        for listener in self.listeners:
            listener(number, rising, increments)
        for other in self.others:
            other(number, rising, angle)
