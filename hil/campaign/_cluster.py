"""Running cases on the workers of a dask scheduler: an engine of others, with the
protocol of our own processes.

Every thread of a worker has a worker process of ours. So a case has its time limits, and one
that kills its process takes no worker along; and a worker that is lost itself loses nothing, because the
scheduler gives its cases to another one.
"""

from __future__ import annotations

import importlib
import threading
import uuid
from collections.abc import Callable, Generator, Sequence
from contextlib import closing
from dataclasses import replace
from importlib import metadata
from typing import Any, Final, TypeVar

from hil._workers import Pool
from hil.campaign._executor import Finished, finished_orders
from hil.campaign._worker import Order, Parcel
from hil.errors import CannotRunError

CONNECT_S: Final = 10.0
"""Time within which the scheduler has to answer, and to have a worker."""
_COMPARED: Final = ("motion-hil", "numpy", "allpairspy")
"""Packages that have to be the same everywhere: traces and matrices are made by them."""

_thread = threading.local()
TaskT = TypeVar("TaskT")
ResultT = TypeVar("ResultT")


def versions() -> dict[str, str]:
    """Return the versions here of what has to be the same everywhere."""
    return {name: metadata.version(name) for name in _COMPARED}


def process_of_thread() -> Pool[Any, Any]:
    """Return the process of this thread of a worker, as a pool of one."""
    pool: Pool[Any, Any] | None = getattr(_thread, "pool", None)
    if pool is None:
        pool = _thread.pool = Pool(1)
    return pool


def run_in_process(order: Order) -> Parcel | str:
    """Run an order on the process of this thread of a worker; returns the reason if it was lost."""
    (one,) = finished_orders(process_of_thread().run([order]))
    return one.reason if one.parcel is None else one.parcel


def on_cluster(
    address: str, function: Callable[[TaskT], ResultT | str], tasks: Sequence[TaskT]
) -> Generator[tuple[int, ResultT | str], None, None]:
    """Call a function for every task on the workers of a dask scheduler.

    Args:
        address: Of the scheduler, `tcp://host:8786`.
        function: At the top level of a module; it returns a text where the task was lost.
        tasks: They travel by pickle.

    Yields:
        Number of the task, and its result, or why it was lost.

    Raises:
        CannotRunError: dask.distributed is not installed, the scheduler does not answer or has no workers, or
            a worker has other versions.

    """
    try:
        distributed: Any = importlib.import_module("distributed")
    except ModuleNotFoundError as error:
        raise CannotRunError(
            f"a cluster needs dask.distributed, which is not installed ({error}): pip install "
            f"'motion-hil[cluster]'"
        ) from error
    with _client(distributed, address) as client:
        run = uuid.uuid4().hex
        futures: dict[Any, int] = {
            client.submit(function, task, key=f"{run}-{number}", pure=False): number
            for number, task in enumerate(tasks)
        }
        try:
            for future in distributed.as_completed(list(futures), loop=client.loop):
                number = futures.pop(future)
                try:
                    yield number, future.result()
                except Exception as error:  # noqa: BLE001 - of the engine: too many workers died with this task, or it cannot travel
                    yield number, f"{type(error).__name__} of the cluster: {error}"
                future.release()
        finally:
            client.cancel(list(futures))


class Cluster:
    """Executes orders on the workers of a dask scheduler.

    Campaigns and bench files are found on the workers by the same references as here.

    Args:
        address: Of the scheduler, `tcp://host:8786`.

    """

    def __init__(self, address: str) -> None:
        self._address = address

    def execute(self, orders: Sequence[Order]) -> Generator[Finished, None, None]:
        """Execute all orders.

        Raises:
            CannotRunError: As of `on_cluster`.

        """
        sent = [replace(order, packed=bool(order.directory)) for order in orders]
        with closing(on_cluster(self._address, run_in_process, sent)) as outcomes:
            for number, outcome in outcomes:
                if isinstance(outcome, str):
                    yield Finished(orders[number], None, outcome)
                else:
                    yield Finished(orders[number], outcome)


def _client(distributed: Any, address: str) -> Any:
    try:
        client = distributed.Client(address, timeout=CONNECT_S, set_as_default=False)
    except (OSError, ValueError, TimeoutError) as error:
        raise CannotRunError(f"no scheduler answers at {address!r}: {error}") from error
    try:
        client.wait_for_workers(1, timeout=CONNECT_S)
        theirs: dict[str, dict[str, str]] = client.run(versions, on_error="return")
    except TimeoutError as error:
        client.close()
        raise CannotRunError(f"the scheduler at {address!r} has no workers") from error
    ours = versions()
    for worker, found in theirs.items():
        if found != ours:
            client.close()
            raise CannotRunError(f"the worker {worker} has {found}, this run is made with {ours}")
    return client
