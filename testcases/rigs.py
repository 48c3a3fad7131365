"""What rigs of unit tests share: time, events, and a controller that runs technology objects.

A rig is a part of the product with just what it needs around it. Whole machines are benches
(`hil.load_bench`).
"""

from __future__ import annotations

from collections.abc import Callable

from fieldbus.clock import MS, S, VirtualScheduler
from fieldbus.history import Event, History
from motion.s7.axis import ExternalEncoder, PositioningAxis, SpeedAxis
from motion.s7.handles import AxisHandle, EncoderHandle
from motion.s7.runtime import Runtime


class VirtualRig:
    """Devices in virtual time with a history.

    Args:
        cycle_ns: Cycle of the bus or controller.

    """

    def __init__(self, *, cycle_ns: int = 4 * MS) -> None:
        self.scheduler = VirtualScheduler()
        self.history = History(self.scheduler)
        self.cycle_ns = cycle_ns

    def run(self, seconds: float) -> None:
        self.scheduler.run_for(round(seconds * S))

    def cycles(self, number: int = 1) -> None:
        self.scheduler.run_for(number * self.cycle_ns)

    def until(self, condition: Callable[[], object], timeout: float = 5.0) -> None:
        """Let time pass until a condition holds; fail after `timeout` seconds."""
        assert self.scheduler.run_until(condition, round(timeout * S)), (
            "the condition did not come true in time"
        )

    def events(self, kind: str) -> list[Event]:
        return list(self.history.select(kind=kind))


class ControllerRig(VirtualRig):
    """A controller with one technology object, made by `control_axis` or `control_encoder`."""

    runtime: Runtime
    axis: AxisHandle
    encoder: EncoderHandle

    def control_axis(self, axis: PositioningAxis | SpeedAxis, *, interpolator_ns: int | None = None) -> None:
        """Run an axis from now on."""
        self.runtime = Runtime(
            self.scheduler, cycle_ns=self.cycle_ns, interpolator_ns=interpolator_ns, history=self.history
        )
        self.runtime.add(axis)
        self.axis = AxisHandle(self.runtime, axis)

    def control_encoder(self, encoder: ExternalEncoder) -> None:
        """Run an external encoder from now on."""
        self.runtime = Runtime(self.scheduler, cycle_ns=self.cycle_ns, history=self.history)
        self.runtime.add_encoder(encoder)
        self.encoder = EncoderHandle(self.runtime, encoder)
