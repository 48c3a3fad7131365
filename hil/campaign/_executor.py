"""Where the cases of a run are executed: in this process, on processes of this machine, or elsewhere."""

from __future__ import annotations

from collections.abc import Callable, Generator, Iterable, Iterator, Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass
from typing import Protocol

from hil._workers import Answer, Ended, Pool
from hil.campaign._case import Case
from hil.campaign._worker import Order, Parcel, run_order

OnBegin = Callable[[Order], object]


@dataclass(frozen=True)
class Finished:
    """An order that has been dealt with."""

    order: Order
    parcel: Parcel | None
    """None: the worker was lost with the case."""
    reason: str = ""
    """Why it was lost."""


class Executor(Protocol):
    """Executes orders, in any order and place; what a case leaves does not depend on either."""

    def execute(self, orders: Sequence[Order]) -> Generator[Finished, None, None]:
        """Execute all orders and give each as soon as it has ended.

        Closing the iterator ends what is under way. Losing a worker loses at
        most the case that it was running.
        """
        ...


class InProcess:
    """Executes one order after the other in this process.

    Args:
        cases: The cases by identifier.
        on_begin: Told of every order before it is executed.

    """

    def __init__(self, cases: Mapping[str, Case], on_begin: OnBegin | None = None) -> None:
        self._cases = cases
        self._on_begin = on_begin

    def execute(self, orders: Sequence[Order]) -> Generator[Finished, None, None]:
        """Execute all orders in their order."""
        for order in orders:
            if self._on_begin is not None:
                self._on_begin(order)
            yield Finished(order, Parcel(run_order(order, self._cases[order.identifier])))


class LocalProcesses:
    """Executes orders on worker processes of this machine.

    Args:
        jobs: Number of processes.
        on_begin: Told of every order that a process gets.

    """

    def __init__(self, jobs: int, on_begin: OnBegin | None = None) -> None:
        self._jobs = jobs
        self._on_begin = on_begin

    def execute(self, orders: Sequence[Order]) -> Generator[Finished, None, None]:
        """Execute all orders; a process that dies or hangs is replaced."""
        with (
            Pool[Order, Parcel](self._jobs, on_give=self._on_begin) as pool,
            closing(pool.run(orders)) as events,
        ):
            yield from finished_orders(events)


def finished_orders(events: Iterable[Answer[Order, Parcel] | Ended[Order]]) -> Iterator[Finished]:
    """Return what became of the orders of a pool."""
    for event in events:
        if isinstance(event, Answer):
            yield Finished(event.task, event.value)
        elif event.how != "done":
            yield Finished(event.task, None, event.reason)
