"""Traversing blocks of the basic positioner: motions, waiting, jumps, outputs, and what follows what (PD-057,
PD-086, PD-091).
"""

from __future__ import annotations

import math
from typing import Final

from emulators.drive.positioner_config import TraversingBlock
from emulators.drive.profidrive.positioner.motion import Motion
from emulators.drive.profidrive.positioner.task import Task
from emulators.drive.profidrive.positioner.terms import Mode, Refused, Words
from fieldbus.profidrive.words import STW1

_OUTPUTS: Final = 3


class BlockRun:
    """Works through the table of blocks.

    Args:
        task: Task of the positioner.

    """

    def __init__(self, task: Task) -> None:
        self._task = task
        self.table: dict[int, TraversingBlock] = {one.number: one for one in task.settings.block}
        self.broken: frozenset[int] = frozenset()
        """Blocks that contradict themselves."""
        self.active = 0
        """Number of the block in work."""
        self.outputs = 0
        """Direct outputs 1 and 2, as bits."""
        self._running: TraversingBlock | None = None
        """The block in work, whatever the table has become since."""
        self._wait_s = 0.0

    def start(self, number: int, words: Words, base: float | None = None, *, follows: bool = False) -> None:
        """Begin a block.

        Args:
            number: Its number.
            words: Setpoint words in effect.
            base: Where a relative way begins, LU; None: at the position demand.
            follows: It follows another one.

        """
        task = self._task
        block = self.table.get(number)
        if number in self.broken:
            task.refuse(Refused.INCONSISTENT_BLOCK)
            return
        if block is None:
            task.refuse(Refused.NO_SUCCESSOR if follows else Refused.NO_SUCH_BLOCK)
            return
        if not block.moves:
            self.active = number
            self._running = block
            self._wait_s = block.parameter / 1000.0 if block.task == "wait" else 0.0
            task.accept(Mode.BLOCK, None)
            return
        if block.task == "absolute":
            target = task.absolute(float(block.position), 0)
            if target is None:
                return
        else:
            target = self._target_of(block, task.demand if base is None else base)
        if not task.allowed(target, words, absolute=block.task == "absolute"):
            return
        self.active = number
        self._running = block
        settings = task.settings
        task.accept(
            Mode.BLOCK,
            Motion(
                target,
                block.velocity,
                settings.max_acceleration * block.acceleration_percent / 100.0,
                settings.max_deceleration * block.deceleration_percent / 100.0,
                self._end_velocity(block, number, target),
                block.task != "absolute",
            ),
        )

    @staticmethod
    def _target_of(block: TraversingBlock, base: float) -> float:
        if block.task == "absolute":
            return float(block.position)
        if block.task == "relative":
            return base + block.position
        return math.inf if block.task == "endless positive" else -math.inf

    def _end_velocity(self, block: TraversingBlock, number: int, target: float) -> float:
        """Return the speed with which a flying block change passes the target:
        only on in the same direction.
        """
        following = self.table.get(number + 1)
        if block.continuation != "continue flying" or following is None or not following.moves:
            return 0.0
        way = target - self._task.demand
        onward = self._target_of(following, target) - target
        return min(block.velocity, following.velocity) if way * onward > 0.0 else 0.0

    def step(self, words: Words, rising: int, cycle_s: float) -> None:
        """Go on to what follows; one block that does not move per cycle."""
        task = self._task
        block = self._running
        if block is None:
            return
        following = self.active + 1
        if block.continuation == "continue external" and rising & STW1.EXTERNAL_BLOCK_CHANGE:
            self.start(following, words, follows=True)
            return
        if task.target_reached:
            return
        if not block.moves:
            self._carry_out(block, words, cycle_s)
            return
        wanted = task.wanted
        if wanted is None:
            return
        if wanted.end_velocity > 0.0:
            if task.core.profile.raw_done:
                self.start(following, words, wanted.target, follows=True)
        elif math.isfinite(wanted.target) and task.motion.arrived():
            task.motion.moving = False
            self._end(block, words, wanted.target)

    def _carry_out(self, block: TraversingBlock, words: Words, cycle_s: float) -> None:
        if block.task == "wait":
            self._wait_s -= cycle_s
            if self._wait_s > 1e-9:
                return
        elif block.task == "goto":
            if block.parameter not in self.table:
                self._task.refuse(Refused.NO_JUMP_TARGET)
            else:
                self.start(block.parameter, words)
            return
        elif block.task == "set output":
            self.outputs |= block.parameter & _OUTPUTS
        else:
            self.outputs &= ~block.parameter & _OUTPUTS
        self._end(block, words, None)

    def _end(self, block: TraversingBlock, words: Words, base: float | None) -> None:
        if block.continuation in {"continue with stop", "continue flying"}:
            self.start(self.active + 1, words, base, follows=True)
        else:
            self._task.target_reached = True
