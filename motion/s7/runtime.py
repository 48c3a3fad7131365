"""The controller's cycle: every axis, then the user program (MC-634)."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from fieldbus.clock import Scheduler, Timer
from fieldbus.errors import ConfigurationError
from fieldbus.history import History
from motion.s7.axis import ExternalEncoder, TechnologyAxis
from motion.s7.controller import Controller, ExecutionLevels
from motion.s7.data_blocks import DataBlocks
from motion.s7.instructions import Instruction, MC_SaveAbsoluteEncoderData
from motion.s7.memory_card import MemoryCard


class Runtime:
    """Runs axes and instruction instances at a fixed cycle.

    Args:
        scheduler: Time.
        cycle_ns: Cycle of `MC_Servo`, ns.
        interpolator_ns: Cycle of `MC_Interpolator`, ns, a multiple of that; None = the same.
        send_clock_ns: Bus cycle, ns, of which the servo cycle is a multiple; None = the same.
        phase_ns: Instant within the bus cycle at which the application cycle runs, ns; default half a
            cycle, when the actual values of this cycle have arrived and the next SYNC is still to come.
        history: Event log, or None.
        program_cycles: Application cycles from one call of the user program to the next (MC-567).

    """

    def __init__(
        self,
        scheduler: Scheduler,
        *,
        cycle_ns: int,
        interpolator_ns: int | None = None,
        send_clock_ns: int | None = None,
        phase_ns: int | None = None,
        history: History | None = None,
        program_cycles: int = 1,
    ) -> None:
        if cycle_ns <= 0:
            raise ConfigurationError("cycle", f"{cycle_ns} ns", "a positive time")
        if program_cycles < 1:
            raise ConfigurationError("program_cycles", program_cycles, "1 or more")
        self.scheduler = scheduler
        self.cycle_ns = cycle_ns
        self.phase_ns = cycle_ns // 2 if phase_ns is None else phase_ns
        self.history = history
        self.axes: list[TechnologyAxis] = []
        self.encoders: list[ExternalEncoder] = []
        self.program: list[Callable[[], object]] = []
        """Called in this order, after the axes, in every application cycle or every `program_cycles`-th."""
        self.program_cycles = program_cycles
        self.program_calls = 0
        """How often the program has been called."""
        self.after_cycle: list[Callable[[], object]] = []
        """Called at the end of every application cycle (recorder, triggers)."""
        self.cycles = 0
        self.data_blocks = DataBlocks()
        """Global data blocks of the user program."""
        self.card: MemoryCard | None = None
        """The memory card; None = there is none."""
        self.saver: MC_SaveAbsoluteEncoderData | None = None
        """The instance whose save runs."""
        self._savers = 0
        self._dormant: list[Instruction] = []
        self._timer: Timer | None = None
        levels = ExecutionLevels(
            self, interpolator_ns=interpolator_ns or cycle_ns, send_clock_ns=send_clock_ns or cycle_ns
        )
        self.controller = Controller(self, levels)
        """The CPU around this runtime: operating states and diagnostics buffer."""
        self._entry: Callable[[], object] = self.cycle if levels.plain else levels.cycle

    def add(self, axis: TechnologyAxis) -> None:
        """Take an axis into the cycle."""
        axis.data_blocks = self.data_blocks
        self.axes.append(axis)

    def add_encoder(self, encoder: ExternalEncoder) -> None:
        """Take an external encoder into the cycle, before the axes."""
        self.encoders.append(encoder)

    @property
    def objects(self) -> list[TechnologyAxis | ExternalEncoder]:
        """All technology objects."""
        return [*self.encoders, *self.axes]

    def insert_card(self, folder: Path) -> bool:
        """Put a memory card in before the first cycle; adjustment data on it are restored (HOM-159).

        Returns:
            Whether there were data, and they fitted.

        """
        self.card = MemoryCard(folder, self.history)
        return self.card.restore(self.objects)

    def count_saver(self) -> int:
        """Return the number of one more instance of `MC_SaveAbsoluteEncoderData`, from 1 on."""
        self._savers += 1
        return self._savers

    def call(self, instance: Callable[[], object]) -> None:
        """Call `instance` with every call of the program from the next one on.

        Instances whose job has ended and whose outputs are only held are laid aside until their `Execute`
        falls.
        """
        active: list[Callable[[], object]] = []
        for one in self.program:
            if isinstance(one, Instruction) and one.dormant:
                self._dormant.append(one)
            else:
                active.append(one)
        self.program = [*active, instance]

    def uncall(self, instance: Callable[[], object]) -> None:
        """Call `instance` no more."""
        self.program = [one for one in self.program if one != instance]

    def start(self) -> None:
        """Begin to cycle."""
        if self._timer is None:
            self._timer = self.scheduler.every(self.cycle_ns, self._entry, phase_ns=self.phase_ns)

    def stop(self) -> None:
        """End the cycle."""
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None

    def enter(self, entry: Callable[[], object]) -> None:
        """Call `entry` instead of what is called in every application cycle; for the controller."""
        self._entry = entry
        if self._timer is not None:
            self._timer.callback = entry

    def restart_program(self) -> None:
        """Let every instance of an instruction begin anew (warm restart)."""
        self.program = [*self.program, *self._dormant]
        self._dormant = []
        self.saver = None
        for one in self.program:
            begin_anew = getattr(one, "begin_anew", None)
            if begin_anew is not None:
                begin_anew()

    def cycle_objects(self, *, servo_only: bool = False) -> None:
        """Run one application cycle of the technology objects alone, without the program; or of `MC_Servo`
        alone.
        """
        self.cycles += 1
        for encoder in self.encoders:
            encoder.cycle()
        for axis in self.axes:
            if servo_only:
                axis.servo_cycle()
            else:
                axis.cycle()
        for encoder in self.encoders:
            encoder.finish_cycle()

    def end_cycle(self) -> None:
        """Call what looks on at the end of a cycle."""
        for callback in self.after_cycle:
            callback()

    def _wake(self) -> None:
        """Call those again that have been laid aside and whose `Execute` has fallen."""
        woken = [one for one in self._dormant if not one.Execute]
        if woken:
            # In front: what has been laid aside is older than what the program has got since, as a rule.
            self._dormant = [one for one in self._dormant if one.Execute]
            self.program = [*woken, *self.program]

    def cycle(self) -> None:
        """Run one application cycle."""
        self.cycle_objects()
        if self.cycles % self.program_cycles == 0:
            self.run_program()
        self.end_cycle()

    @property
    def instances(self) -> list[Instruction]:
        """All instances of instructions in the program, those that are laid aside included."""
        return [one for one in (*self.program, *self._dormant) if isinstance(one, Instruction)]

    def run_program(self) -> None:
        """Call every instance and function of the user program once."""
        self.program_calls += 1
        for axis in self.axes:
            position = axis.position
            if position is not None and not position.hardware.in_servo:
                position.hardware.update_image()
        if self._dormant:
            self._wake()
        for instance in self.program:
            instance()
