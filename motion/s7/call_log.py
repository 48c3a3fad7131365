"""Outputs of instruction instances, call by call (MC-081, MC-566)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

if TYPE_CHECKING:
    from motion.s7.instructions import Instruction
    from motion.s7.runtime import Runtime

OUTPUTS: Final = (
    "Status",
    "Busy",
    "Active",
    "Done",
    "InVelocity",
    "InLimitation",
    "InClamping",
    "CommandAborted",
    "Error",
    "ErrorID",
)
"""Outputs that are recorded, of the instances that have them."""


@dataclass(frozen=True, slots=True)
class Call:
    """What one instance showed at the end of one call.

    Args:
        number: Calls of this instance since the recording began, from 1 on.
        cycle: Application cycle of the controller.
        time_ns: Time since the start of the bench, ns.
        outputs: Values by name, without the outputs that the instruction does not have.

    """

    number: int
    cycle: int
    time_ns: int
    outputs: dict[str, float]

    @property
    def true(self) -> frozenset[str]:
        """Names of the outputs that are TRUE."""
        return frozenset(name for name, value in self.outputs.items() if value is True)


class CallLog:
    """Records all outputs of every instance of the user program in every call, so that an output of one call
    is not missed.

    Args:
        runtime: The controller whose program is recorded, from now on.

    """

    def __init__(self, runtime: Runtime) -> None:
        self._runtime = runtime
        self._calls: dict[Instruction, list[Call]] = {}
        self._seen = runtime.program_calls
        runtime.after_cycle.append(self._sample)

    def of(self, instance: Instruction) -> list[Call]:
        """Return the calls of an instance, in their order."""
        return self._calls.get(instance, [])

    @property
    def instances(self) -> list[Instruction]:
        """All instances that have been called."""
        return list(self._calls)

    def _sample(self) -> None:
        runtime = self._runtime
        if runtime.program_calls == self._seen:
            return  # a cycle without the program
        self._seen = runtime.program_calls
        for instance in runtime.instances:
            calls = self._calls.setdefault(instance, [])
            outputs = {name: getattr(instance, name) for name in OUTPUTS if hasattr(instance, name)}
            calls.append(Call(len(calls) + 1, runtime.cycles, runtime.scheduler.now, outputs))
