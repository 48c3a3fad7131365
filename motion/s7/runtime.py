"""A controller: its task, its user program, its CPU, its memory card (MC-634)."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

from motion.kernel.task import Task
from motion.s7.controller import Controller, ExecutionLevels
from motion.s7.data_blocks import DataBlocks
from motion.s7.memory_card import MemoryCard
from motion.s7.program import Program

if TYPE_CHECKING:
    from fieldbus.clock import Scheduler
    from fieldbus.history import History
    from motion.s7.axis import ExternalEncoder, TechnologyAxis
    from motion.s7.cams import Cam
    from motion.s7.instructions import Instruction
    from motion.s7.measuring_input import MeasuringInput
    from motion.s7.proxy import LeadingAxisProxy, LeadingValueLink


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
        self.scheduler = scheduler
        self.cycle_ns = cycle_ns
        self.phase_ns = cycle_ns // 2 if phase_ns is None else phase_ns
        self.history = history
        self.axes: list[TechnologyAxis] = []
        self.user_program = Program(self.axes, scheduler.catch_up)
        """Instances and functions that are called after the axes, every `program_cycles`-th cycle."""
        self.task: Task[TechnologyAxis, ExternalEncoder] = Task(
            scheduler,
            cycle_ns=cycle_ns,
            phase_ns=self.phase_ns,
            program=self.user_program.run,
            program_cycles=program_cycles,
        )
        """What runs in every cycle."""
        self.task.axes = self.axes
        self.encoders = self.task.encoders
        self.cams: list[Cam] = []
        """Cam technology objects."""
        self.proxies: list[LeadingAxisProxy] = []
        """Leading-axis proxies."""
        self._numbered = 0
        self.measuring_inputs: list[MeasuringInput] = []
        """Measuring inputs."""
        self.records = self.task.records
        """Called at the end of every application cycle, before `after_cycle`: the recorder's rows of objects
        and buses.
        """
        self.after_cycle = self.task.after_cycle
        """Called at the end of every application cycle (triggers, what a test watches)."""
        self.data_blocks = DataBlocks()
        """Global data blocks of the user program."""
        self.card: MemoryCard | None = None
        """The memory card; None = there is none."""
        self.saver: object | None = None
        """The instance of `MC_SaveAbsoluteEncoderData` whose save runs."""
        self._savers = 0
        levels = ExecutionLevels(
            self.task,
            interpolator_ns=interpolator_ns or cycle_ns,
            send_clock_ns=send_clock_ns or cycle_ns,
        )
        self.controller = Controller(
            self.task,
            self.user_program,
            levels,
            self.data_blocks,
            history,
            cams=self.cams,
            proxies=self.proxies,
            measuring_inputs=self.measuring_inputs,
        )
        """The CPU around this runtime: operating states and diagnostics buffer."""
        self.controller.on_warm_restart = self._forget_save
        self.controller.renew_cycle()

    def _forget_save(self) -> None:
        self.saver = None

    def add(self, axis: TechnologyAxis) -> None:
        """Take an axis into the cycle."""
        axis.data_blocks = self.data_blocks
        self.axes.append(axis)
        self._number(axis)

    def add_encoder(self, encoder: ExternalEncoder) -> None:
        """Take an external encoder into the cycle, before the axes."""
        self.encoders.append(encoder)
        self._number(encoder)

    def add_proxy(self, proxy: LeadingAxisProxy) -> None:
        """Take a leading-axis proxy into the cycle, before the axes."""
        self.proxies.append(proxy)
        self.task.received.append(proxy)
        self._number(proxy)

    def send_leading_value(self, link: LeadingValueLink) -> None:
        """Send a leading value at the end of every application cycle."""
        self.after_cycle.append(link.send)

    def _number(
        self, one: TechnologyAxis | ExternalEncoder | LeadingAxisProxy | Cam | MeasuringInput
    ) -> None:
        self._numbered += 1
        one.db_number = self._numbered

    def order_axes(self) -> None:
        """Call leading axes before those that follow them, so that all of a chain use the values of one cycle
        (SYN-015); to be called when the interconnections are known.
        """
        ordered: list[TechnologyAxis] = []

        def take(axis: TechnologyAxis, above: tuple[TechnologyAxis, ...]) -> None:
            if axis in ordered or axis in above:
                return
            names = [leader.name for leader in axis.leading_objects]
            for leader in self.axes:
                if leader.name in names:  # external encoders are called before all axes
                    take(leader, (*above, axis))
            ordered.append(axis)

        for axis in self.axes:
            take(axis, ())
            for leading in axis.leading_objects:
                leading.lead()
            axis.check_interconnections()
        self.axes[:] = [axis for axis in ordered if axis in self.axes]

    def add_cam(self, cam: Cam) -> None:
        """Take a cam into the cycle, after the axes."""
        self.cams.append(cam)
        self._number(cam)
        self.task.background.append(cam)

    def add_measuring_input(self, one: MeasuringInput) -> None:
        """Take a measuring input into the cycle, after the axes."""
        self.measuring_inputs.append(one)
        self._number(one)
        self.task.background.append(one)

    @property
    def objects(self) -> list[TechnologyAxis | ExternalEncoder]:
        """All technology objects with inputs and outputs."""
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

    # -- the program

    @property
    def program(self) -> tuple[Callable[[], object], ...]:
        """What the program calls, in this order."""
        return self.user_program.calls

    @property
    def program_calls(self) -> int:
        """How often the program has been called."""
        return self.user_program.count

    @property
    def instances(self) -> list[Instruction]:
        """All instances of instructions in the program."""
        return self.user_program.instances

    def call(self, instance: Callable[[], object], *, first: bool = False) -> None:
        """Call `instance` with every call of the program from the next one on, behind the others or in front
        of them.
        """
        self.user_program.call(instance, first=first)

    def uncall(self, instance: Callable[[], object]) -> None:
        """Call `instance` no more."""
        self.user_program.uncall(instance)

    # -- the cycle

    @property
    def cycles(self) -> int:
        """Number of application cycles so far."""
        return self.task.cycles

    @property
    def program_cycles(self) -> int:
        """Application cycles from one call of the program to the next."""
        return self.task.program_cycles

    @program_cycles.setter
    def program_cycles(self, cycles: int) -> None:
        self.task.program_cycles = cycles

    def start(self) -> None:
        """Begin to cycle."""
        self.task.start()

    def stop(self) -> None:
        """End the cycle."""
        self.task.stop()
