"""Execution levels: `MC_Servo` and `MC_Interpolator`, the blocks of the user around them, and what becomes of
them when computing takes long.

In one servo cycle, in this order (MC-634): `MC_PreServo`, `MC_Servo`, `MC_PostServo`; where the
interpolator is due, with it, and afterwards `MC_PreInterpolator` and the user program. An interpolator
that is due every n servo cycles (`T_ipo = n * T_servo`) calculates the setpoints n cycles ahead, between
which `MC_Servo` interpolates.

Computing takes no time unless a time is set. With a time for `MC_Servo` its outputs come later by it; with
one for `MC_Interpolator` the next setpoints may be missing when `MC_Servo` wants them (MC-636, MC-637).
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Final, Protocol

from fieldbus.clock import MS
from fieldbus.errors import ConfigurationError

if TYPE_CHECKING:
    from fieldbus.clock import Timer
    from motion.kernel.task import Task
    from motion.s7.axis import ExternalEncoder, TechnologyAxis

LONGEST_CYCLE_NS: Final = 32 * MS
"""Longest application cycle (MC-634)."""
SERVO_PRIORITIES: Final = range(17, 27)
INTERPOLATOR_PRIORITIES: Final = range(16, 26)
_TOLERATED: Final = 3
"""Overflows of `MC_Interpolator` in a row that do not stop the controller (MC-637)."""

Hook = Callable[[], object]


def check_priorities(servo: int, interpolator: int) -> None:
    """Refuse priorities of `MC_Servo` and `MC_Interpolator` that cannot be configured (MC-635).

    Raises:
        ConfigurationError: One is out of its range, or the servo's is not the higher one.

    """
    for name, value, allowed in (
        ("servo_priority", servo, SERVO_PRIORITIES),
        ("interpolator_priority", interpolator, INTERPOLATOR_PRIORITIES),
    ):
        if value not in allowed:
            raise ConfigurationError(name, value, f"{allowed[0]} to {allowed[-1]}")
    if servo <= interpolator:
        raise ConfigurationError("servo_priority", servo, f"more than interpolator_priority = {interpolator}")


class LevelsOwner(Protocol):
    """The CPU that the levels belong to."""

    def renew_cycle(self) -> None:
        """Let the task call what the settings of the levels want in every cycle."""

    def report(self, text: str) -> None:
        """Enter something into the diagnostics buffer."""

    def overflow(self, what: str) -> None:
        """Go to STOP because a level has not ended in time."""


class ExecutionLevels:
    """The levels of one controller: `bench.controller.levels`.

    Args:
        task: Technology objects and user program.
        interpolator_ns: Cycle of `MC_Interpolator`, ns: a multiple of the servo cycle, at most 32 ms.
        send_clock_ns: Bus cycle, ns; the servo cycle is a multiple of it (CFG-187).

    Raises:
        ConfigurationError: The cycles do not fit together.

    """

    def __init__(
        self, task: Task[TechnologyAxis, ExternalEncoder], *, interpolator_ns: int, send_clock_ns: int
    ) -> None:
        servo_ns = task.cycle_ns
        if servo_ns % send_clock_ns:
            raise ConfigurationError(
                "servo cycle", f"{servo_ns} ns", f"a multiple of the send clock of {send_clock_ns} ns"
            )
        if interpolator_ns % servo_ns or interpolator_ns < servo_ns:
            raise ConfigurationError(
                "interpolator cycle",
                f"{interpolator_ns} ns",
                f"a multiple of the servo cycle of {servo_ns} ns",
            )
        if interpolator_ns != servo_ns and interpolator_ns > LONGEST_CYCLE_NS:
            raise ConfigurationError("interpolator cycle", f"{interpolator_ns} ns", "at most 32 ms")
        self.ratio = interpolator_ns // servo_ns
        """Servo cycles in an interpolator cycle."""
        self.isochronous = True
        """`MC_Servo` keeps up with the send clock."""
        self.pre_servo: list[Hook] = []
        """`MC_PreServo`: called before the technology objects read their inputs; `changed` after a change."""
        self.post_servo: list[Hook] = []
        """`MC_PostServo`: called when they have written their outputs."""
        self.pre_interpolator: list[Hook] = []
        """`MC_PreInterpolator`: called before the instructions, once per interpolator cycle."""
        self._task = task
        self._cpu: LevelsOwner | None = None
        self._send_clock_ns = send_clock_ns
        self._servo_ns = 0
        self._interpolator_ns = 0
        self._stalled = False
        self._tick = 0
        self._servo_ends_ns = 0
        self._left_ns = 0
        self._resumed_ns = 0
        self._end: Timer | None = None
        self._missed = 0
        self._queued = False
        self._overflows = 0
        self._generation = 0
        self._interpolations = 0

    def belong_to(self, owner: LevelsOwner) -> None:
        """Take note of the CPU that the levels belong to, before the first cycle."""
        self._cpu = owner

    @property
    def _owner(self) -> LevelsOwner:
        assert self._cpu is not None  # the controller takes its levels over at once
        return self._cpu

    # -- settings
    # ---------------------------------------------------------------------------------------------

    @property
    def plain(self) -> bool:
        """Whether nothing but the technology objects and the program has to be called, in every cycle."""
        hooks = self.pre_servo or self.post_servo or self.pre_interpolator
        return self.ratio == 1 and not (hooks or self._servo_ns or self._interpolator_ns or self._stalled)

    def changed(self) -> None:
        """Take changed hooks over."""
        self._owner.renew_cycle()

    def hook(self, level: str, call: Hook) -> Callable[[], None]:
        """Call `call` in `MC_PreServo`, `MC_PostServo` or `MC_PreInterpolator`; returns the function that
        ends it.

        Raises:
            ConfigurationError: There is no such level.

        """
        lists = {
            "MC_PreServo": self.pre_servo,
            "MC_PostServo": self.post_servo,
            "MC_PreInterpolator": self.pre_interpolator,
        }
        if level not in lists:
            raise ConfigurationError("execution level", level, ", ".join(lists))
        hooks = lists[level]
        hooks.append(call)
        self.changed()

        def end() -> None:
            if call in hooks:
                hooks.remove(call)
                self.changed()

        return end

    def set_computing_time(self, *, servo_ns: int | None = None, interpolator_ns: int | None = None) -> None:
        """Say how long the levels take from now on, with the blocks of the user; None leaves it.

        Args:
            servo_ns: `MC_PreServo`, `MC_Servo` and `MC_PostServo`, ns.
            interpolator_ns: `MC_PreInterpolator` and `MC_Interpolator`, without interruptions, ns.

        Raises:
            ConfigurationError: A time is negative.

        """
        for name, value in (("servo_ns", servo_ns), ("interpolator_ns", interpolator_ns)):
            if value is not None and value < 0:
                raise ConfigurationError(f"computing time {name}", value, "0 or more")
        if servo_ns is not None:
            self._servo_ns = servo_ns
        if interpolator_ns is not None:
            self._interpolator_ns = interpolator_ns
        self.changed()

    @property
    def computing_time(self) -> tuple[int, int]:
        """Time that `MC_Servo` and `MC_Interpolator` take, ns."""
        return self._servo_ns, self._interpolator_ns

    def stall(self, stalled: bool) -> None:
        """Let all levels hang without anybody noticing, or continue: no inputs, no program, no telegrams; the
        bus runs on.
        """
        self._stalled = stalled
        self.changed()

    def reset(self) -> None:
        """Forget what is under way: the controller enters RUN, or leaves it."""
        if self._end is not None:
            self._end.cancel()
            self._end = None
        self._tick = 0
        self._left_ns = self._missed = self._overflows = 0
        self._servo_ends_ns = 0
        self._queued = False
        self._generation += 1
        self.isochronous = True

    # -- cycle
    # ------------------------------------------------------------------------------------------------

    def cycle_objects(self) -> None:
        """Run one servo cycle of the technology objects alone, in STOP and STARTUP."""
        if self._stalled:
            return
        self._task.cycle_objects(servo_only=not self._due())

    def cycle(self) -> None:
        """Run one servo cycle in RUN."""
        task = self._task
        if self._stalled:
            task.end_cycle()
            return
        servo_ns = self._servo_ns
        if not servo_ns and not self._interpolator_ns:
            self._serve(due=self._due(), late=False)
            return
        now = task.scheduler.now
        if now < self._servo_ends_ns:
            self._owner.overflow("MC_Servo runs longer than the application cycle")
            return
        due = self._due()
        late = self._interrupt(due)
        if late is None:
            return
        self._servo_ends_ns = now + servo_ns
        if servo_ns > self._send_clock_ns and self.isochronous:
            self.isochronous = False
            self._owner.report("overflow of MC_Servo: longer than the send clock, no longer isochronous")
        generation = self._generation
        if servo_ns:
            task.scheduler.at(self._servo_ends_ns, lambda: self._served(generation, due=due, late=late))
        else:
            self._served(generation, due=due, late=late)

    def _due(self) -> bool:
        """Say whether the interpolator is due in this servo cycle, and count it."""
        due = self._tick == 0
        self._tick += 1
        if self._tick >= self.ratio:
            self._tick = 0
        return due

    def _serve(self, *, due: bool, late: bool) -> None:
        """`MC_Servo` with the blocks around it, and what follows when the
        interpolator is due and has its time.
        """
        task = self._task
        for hook in self.pre_servo:
            hook()
        full = due and not late
        task.cycle_objects(servo_only=not full)
        for hook in self.post_servo:
            hook()
        if full:
            for hook in self.pre_interpolator:
                hook()
            self._interpolations += 1
            if self._interpolations % task.program_cycles == 0:
                task.run_program()
        task.end_cycle()

    # -- computing time
    # ---------------------------------------------------------------------------------------

    def _interrupt(self, due: bool) -> bool | None:
        """`MC_Servo` begins: interrupt a running interpolator; returns whether its setpoints are missing,
        None after a stop.
        """
        if self._end is None:
            if due:
                self._overflows = 0
            return False
        self._end.cancel()
        self._left_ns -= self._task.scheduler.now - self._resumed_ns
        if not due:
            return False
        self._missed += 1
        self._overflows += 1
        controller = self._owner
        if self._missed > 1:
            controller.overflow("MC_Interpolator is interrupted by a second call of MC_Servo")
            return None
        if self._overflows > _TOLERATED:
            controller.overflow(f"MC_Interpolator, {self._overflows} times in a row")
            return None
        controller.report("overflow of MC_Interpolator")
        self._queued = True
        return True

    def _served(self, generation: int, *, due: bool, late: bool) -> None:
        """`MC_Servo` ends, unless RUN has: its outputs are written, and the
        interpolator begins or continues.
        """
        if generation != self._generation:
            return
        self._serve(due=due, late=late)
        if self._end is not None:
            self._resume()
        elif due and self._interpolator_ns:
            self._left_ns = self._interpolator_ns
            self._missed = 0
            self._resume()

    def _resume(self) -> None:
        scheduler = self._task.scheduler
        self._resumed_ns = scheduler.now
        self._end = scheduler.after(max(0, self._left_ns), self._interpolated)

    def _interpolated(self) -> None:
        """`MC_Interpolator` ends; a call that has been waiting begins."""
        self._end = None
        if self._queued:
            self._queued = False
            self._missed = 0
            self._left_ns = self._interpolator_ns
            if self._left_ns:
                self._resume()
