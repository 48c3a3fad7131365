"""Where the cases of a run are executed: in this process, on processes of this machine, or elsewhere."""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Generator, Mapping, Sequence
from dataclasses import dataclass
from multiprocessing.connection import wait
from typing import Any, Protocol

from hil.campaign._case import Case
from hil.campaign._process import LONGEST_WAIT_S, WorkerLostError, WorkerProcess, hung
from hil.campaign._worker import Order, Parcel, run_order


@dataclass(frozen=True, slots=True)
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

        Closing the iterator ends what is under way. Losing a worker loses at most the case that it was
        running.
        """
        ...


class InProcess:
    """Executes one order after the other in this process.

    Args:
        cases: The cases by identifier.

    """

    def __init__(self, cases: Mapping[str, Case]) -> None:
        self._cases = cases

    def execute(self, orders: Sequence[Order]) -> Generator[Finished, None, None]:
        """Execute all orders in their order."""
        for order in orders:
            yield Finished(order, Parcel(run_order(order, self._cases[order.identifier])))


class LocalProcesses:
    """Executes orders on worker processes of this machine.

    Args:
        jobs: Number of processes.

    """

    def __init__(self, jobs: int) -> None:
        self._jobs = jobs

    def execute(self, orders: Sequence[Order]) -> Generator[Finished, None, None]:
        """Execute all orders; a process that dies or hangs is replaced."""
        waiting = deque(orders)
        idle: list[WorkerProcess] = []
        busy: dict[Any, tuple[WorkerProcess, Order, float]] = {}
        try:
            while waiting or busy:
                while waiting and len(busy) < self._jobs:
                    order = waiting.popleft()
                    worker = _given(order, idle)
                    busy[worker.connection] = (worker, order, _due(order))
                yield from _await(busy, idle)
        finally:
            for worker, _order, _due_s in busy.values():
                worker.kill()
            for worker in idle:
                worker.close()


def _given(order: Order, idle: list[WorkerProcess]) -> WorkerProcess:
    """Return a worker that has taken the order; one that died idle, by what an earlier case left behind, is
    replaced.
    """
    while idle:
        worker = idle.pop()
        try:
            worker.send(order)
        except WorkerLostError:
            worker.kill()
        else:
            return worker
    worker = WorkerProcess()
    worker.send(order)
    return worker


def _due(order: Order) -> float:
    # Wall time, of a process of the machine; nothing in the bench is controlled by it.
    return time.monotonic() + order.patience_s if order.patience_s else float("inf")


def _await(busy: dict[Any, tuple[WorkerProcess, Order, float]], idle: list[WorkerProcess]) -> list[Finished]:
    """Wait until workers have answered, died, or used up their patience."""
    due = min(due_s for _worker, _order, due_s in busy.values()) if busy else 0.0
    rest = min(max(due - time.monotonic(), 0.0), LONGEST_WAIT_S)
    done: list[Finished] = []
    for connection in wait(list(busy), rest):
        worker, order, _due_s = busy.pop(connection)
        try:
            done.append(Finished(order, worker.receive()))
            idle.append(worker)
        except WorkerLostError as error:
            worker.kill()
            done.append(Finished(order, None, str(error)))
    now = time.monotonic()
    for connection, (worker, order, due_s) in list(busy.items()):
        if due_s <= now:
            del busy[connection]
            worker.kill()
            done.append(Finished(order, None, hung(order)))
    return done
