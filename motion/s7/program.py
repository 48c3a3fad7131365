"""The user program: instances of instructions and functions, called in their order."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

from motion.kernel.execute_input import Dormant
from motion.s7.instructions import Instruction, MC_SaveAbsoluteEncoderData

if TYPE_CHECKING:
    from motion.s7.axis import TechnologyAxis


class Program:
    """Calls instructions and functions in the order in which they were added.

    Args:
        axes: The axes, whose limit switches may be inputs of the process image of the program.
        catch_up: Called before functions, which may look at a plant; instructions know objects only.

    """

    def __init__(self, axes: list[TechnologyAxis], catch_up: Callable[[], object]) -> None:
        self._axes = axes
        self._catch_up = catch_up
        self.calls: tuple[Callable[[], object], ...] = ()
        """Called in this order."""
        self._entries: list[Callable[[], object]] = []
        """The same, as it is called."""
        self._functions = False
        """There are functions among them."""
        self.count = 0
        """How often the program has been called."""
        self._dormant: Dormant[Instruction] = Dormant()

    def call(self, instance: Callable[[], object], *, first: bool = False) -> None:
        """Call `instance` with every call of the program from the next one on, behind the others.

        Instances whose job has ended and whose outputs are only held are not
        called until their `Execute` falls.

        Args:
            instance: Of an instruction, or a function.
            first: In front of the others.

        """
        active: list[Callable[[], object]] = []
        for one in self.calls:
            if isinstance(one, Instruction) and one.dormant:
                self._dormant.add(one)
            else:
                active.append(one)
        self._schedule([instance, *active] if first else [*active, instance])

    def _schedule(self, calls: list[Callable[[], object]]) -> None:
        self.calls = tuple(calls)
        self._entries = [one.entry if isinstance(one, Instruction) else one for one in calls]
        self._functions = not all(isinstance(one, Instruction) for one in calls)

    def uncall(self, instance: Callable[[], object]) -> None:
        """Call `instance` no more."""
        self._schedule([one for one in self.calls if one != instance])

    def restart(self) -> None:
        """Let every instance of an instruction start again (warm restart)."""
        self._schedule([*self.calls, *self._dormant.take_all()])
        for one in self.calls:
            if isinstance(one, Instruction | MC_SaveAbsoluteEncoderData):
                one.warm_restart()

    @property
    def instances(self) -> list[Instruction]:
        """All instances of instructions, those that are not called at present included."""
        return [one for one in (*self.calls, *self._dormant.instances) if isinstance(one, Instruction)]

    def run(self) -> None:
        """Call every instance and function once."""
        self.count += 1
        for axis in self._axes:
            if axis.image_limits is not None:
                axis.image_limits.update_image()
        if self._dormant.fallen:
            self._wake()
        if self._functions:
            self._catch_up()
        for entry in self._entries:
            entry()

    def _wake(self) -> None:
        """Call those again that were not called and whose `Execute` has fallen."""
        # In front: they are older than what the program has got since, as a rule.
        self._schedule([*self._dormant.take_fallen(), *self.calls])
