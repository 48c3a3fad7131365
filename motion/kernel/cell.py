"""Values that may change while an axis moves: the dialect writes them, the parts of the kernel read them."""

from __future__ import annotations

from typing import Generic, TypeVar

T = TypeVar("T")


class Cell(Generic[T]):
    """One value in the units of the runtime: position unit, s, Nm, N.

    A dialect keeps its configuration and its program variables in cells. A part of an axis gets
    the cells that it needs when it is made and reads `value` in every cycle, so that a new value
    acts without a look-up by name.
    """

    __slots__ = ("value",)

    def __init__(self, value: T) -> None:
        self.value = value
        """The value in effect."""

    def __repr__(self) -> str:
        return f"<Cell {self.value!r}>"
