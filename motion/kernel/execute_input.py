"""The input `Execute` of instances, and the instances that wait for it to fall.

An instance whose job has ended only holds its outputs until `Execute` falls: a program need not call it. A
long program has hundreds of them, so the input says when it falls, and nobody looks at them in every cycle.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Generic, Protocol, TypeVar


class Executed(Protocol):
    """An instance with the input."""

    execute_level: bool
    """Level of the input."""
    on_execute_fall: Callable[[], object] | None
    """Called when the input becomes FALSE."""


Instance = TypeVar("Instance", bound=Executed)


class ExecuteInput:
    """The input as an attribute of its instances."""

    def __get__(self, instance: Executed, owner: type) -> bool:
        return instance.execute_level

    def __set__(self, instance: Executed, level: bool) -> None:
        instance.execute_level = level
        on_fall = instance.on_execute_fall
        if not level and on_fall is not None:
            on_fall()


class Dormant(Generic[Instance]):
    """Instances that a program does not call until their `Execute` falls."""

    def __init__(self) -> None:
        self.instances: list[Instance] = []
        self.fallen = False
        """The input of one of them has become FALSE since they were last looked at."""

    def add(self, instance: Instance) -> None:
        """Take in an instance."""
        instance.on_execute_fall = self._note
        self.instances.append(instance)

    def take_fallen(self) -> list[Instance]:
        """Return those whose `Execute` is FALSE, and let go of them."""
        return self._release([one for one in self.instances if not one.execute_level])

    def take_all(self) -> list[Instance]:
        """Return all, and let go of them."""
        return self._release(self.instances)

    def _release(self, instances: list[Instance]) -> list[Instance]:
        self.fallen = False
        for one in instances:
            one.on_execute_fall = None
        self.instances = [one for one in self.instances if one.on_execute_fall is not None]
        return instances

    def _note(self) -> None:
        self.fallen = True
