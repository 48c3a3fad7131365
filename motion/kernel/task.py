"""The task of a controller: every object, then the program, at a fixed cycle (MC-634)."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Generic, Protocol, TypeVar

from fieldbus.errors import ConfigurationError

if TYPE_CHECKING:
    from fieldbus.clock import Scheduler, Timer


class CyclicAxis(Protocol):
    """An axis as the task calls it."""

    def cycle(self) -> None:
        """Run one application cycle."""

    def servo_cycle(self) -> None:
        """Run one servo cycle without the interpolator: it is not due, or late."""


class CyclicEncoder(Protocol):
    """An external encoder as the task calls it."""

    def cycle(self) -> None:
        """Run one application cycle, before the axes."""

    def finish_cycle(self) -> None:
        """Do what needs the inputs of all axes."""


class Background(Protocol):
    """An object without inputs and outputs as the task calls it."""

    def cycle(self) -> None:
        """Run one application cycle, before or after the axes."""


A = TypeVar("A", bound=CyclicAxis)
E = TypeVar("E", bound=CyclicEncoder)


class Task(Generic[A, E]):
    """The cyclic task: calls every encoder and axis, then the program.

    Args:
        scheduler: Time.
        cycle_ns: Cycle, ns.
        phase_ns: Instant within the cycle at which the task runs, ns.
        program: The program, called after the objects; it calls `Scheduler.catch_up` before anything that
            looks at a plant.
        program_cycles: Cycles from one call of the program to the next, 1 or more (MC-567).

    Raises:
        ConfigurationError: The cycle is no positive time, or `program_cycles` is less than 1.

    """

    def __init__(
        self,
        scheduler: Scheduler,
        *,
        cycle_ns: int,
        phase_ns: int,
        program: Callable[[], object],
        program_cycles: int,
    ) -> None:
        if cycle_ns <= 0:
            raise ConfigurationError("cycle", f"{cycle_ns} ns", "a positive time")
        if program_cycles < 1:
            raise ConfigurationError("program_cycles", program_cycles, "1 or more")
        self.scheduler = scheduler
        self.cycle_ns = cycle_ns
        self.phase_ns = phase_ns
        self.program_cycles = program_cycles
        self.run_program = program
        self.axes: list[A] = []
        self.encoders: list[E] = []
        self.received: list[Background] = []
        """Objects that take values of other controllers over, before all others."""
        self.background: list[Background] = []
        """Objects without inputs and outputs, such as cams."""
        self.records: list[Callable[[], object]] = []
        """Called at the end of every cycle, before `after_cycle`. They read what the controller and the buses
        have, and nothing else (`Timer.apart`).
        """
        self.after_cycle: list[Callable[[], object]] = []
        """Called at the end of every cycle (triggers, what a test watches)."""
        self.cycles = 0
        self._entry: Callable[[], object] = self.cycle
        self._apart = True
        self._timer: Timer | None = None

    def start(self) -> None:
        """Begin to cycle."""
        if self._timer is None:
            self._timer = timer = self.scheduler.every(self.cycle_ns, self._entry, phase_ns=self.phase_ns)
            timer.apart = self._apart

    def stop(self) -> None:
        """End the cycle."""
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None

    def enter(self, entry: Callable[[], object] | None = None) -> None:
        """Call `entry` in every cycle instead of what is called now; None: `cycle`."""
        self._apart = entry is None
        self._entry = self.cycle if entry is None else entry
        if self._timer is not None:
            self._timer.callback = self._entry
            self._timer.apart = self._apart

    def cycle_objects(self, *, servo_only: bool = False) -> None:
        """Run one cycle of the objects without the program; or their servo cycle alone."""
        self.cycles += 1
        for one in self.received:
            one.cycle()
        for encoder in self.encoders:
            encoder.cycle()
        if servo_only:
            for axis in self.axes:
                axis.servo_cycle()
        else:
            for axis in self.axes:
                axis.cycle()
        for encoder in self.encoders:
            encoder.finish_cycle()
        for one in self.background:
            one.cycle()

    def end_cycle(self) -> None:
        """Call what looks on at the end of a cycle."""
        for record in self.records:
            record()
        if self.after_cycle:
            self.scheduler.catch_up()
            for callback in tuple(self.after_cycle):
                callback()

    def cycle(self) -> None:
        """Run one cycle.

        Objects have their devices on a bus: they neither see nor change a plant, so the task is an event
        apart (`Timer.apart`). The program and `after_cycle` may do both, and begin when all is up to date.
        """
        self.cycle_objects()
        if self.cycles % self.program_cycles == 0:
            self.run_program()
        self.end_cycle()
