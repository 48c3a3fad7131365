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
from collections.abc import Generator, Sequence
from dataclasses import replace
from importlib import metadata
from typing import Any, Final

from hil._workers import Pool
from hil.campaign._executor import Finished, finished_orders
from hil.campaign._worker import Order, Parcel
from hil.errors import CannotRunError

CONNECT_S: Final = 10.0
"""Time within which the scheduler has to answer, and to have a worker."""
_COMPARED: Final = ("motion-hil", "numpy", "allpairspy")
"""Packages that have to be the same everywhere: traces and matrices are made by them."""

_thread = threading.local()


def versions() -> dict[str, str]:
    """Return the versions here of what has to be the same everywhere."""
    return {name: metadata.version(name) for name in _COMPARED}


def run_in_process(order: Order) -> Parcel | str:
    """Run an order on the process of this thread of a worker; returns the reason if it was lost."""
    pool: Pool[Order, Parcel] | None = getattr(_thread, "pool", None)
    if pool is None:
        pool = _thread.pool = Pool(1)
    (one,) = finished_orders(pool.run([order]))
    return one.reason if one.parcel is None else one.parcel


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
            CannotRunError: dask.distributed is not installed, the scheduler does not answer or has no
                workers, or a worker has other versions.

        """
        try:
            distributed: Any = importlib.import_module("distributed")
        except ModuleNotFoundError as error:
            raise CannotRunError(
                f"a cluster needs dask.distributed, which is not installed ({error}): pip install "
                f"'motion-hil[cluster]'"
            ) from error
        with self._client(distributed) as client:
            run = uuid.uuid4().hex
            futures: dict[Any, Order] = {
                client.submit(
                    run_in_process,
                    replace(order, packed=bool(order.directory)),
                    key=f"{run}-{number}",
                    pure=False,
                ): order
                for number, order in enumerate(orders)
            }
            try:
                for future in distributed.as_completed(list(futures), loop=client.loop):
                    order = futures.pop(future)
                    yield _finished(future, order)
                    future.release()
            finally:
                client.cancel(list(futures))

    def _client(self, distributed: Any) -> Any:
        try:
            client = distributed.Client(self._address, timeout=CONNECT_S, set_as_default=False)
        except (OSError, ValueError, TimeoutError) as error:
            raise CannotRunError(f"no scheduler answers at {self._address!r}: {error}") from error
        try:
            client.wait_for_workers(1, timeout=CONNECT_S)
            theirs: dict[str, dict[str, str]] = client.run(versions, on_error="return")
        except TimeoutError as error:
            client.close()
            raise CannotRunError(f"the scheduler at {self._address!r} has no workers") from error
        ours = versions()
        for worker, found in theirs.items():
            if found != ours:
                client.close()
                raise CannotRunError(f"the worker {worker} has {found}, this run is made with {ours}")
        return client


def _finished(future: Any, order: Order) -> Finished:
    try:
        outcome = future.result()
    except Exception as error:  # noqa: BLE001 - of the engine: too many workers died with this case, or it cannot travel
        return Finished(order, None, f"{type(error).__name__} of the cluster: {error}")
    if isinstance(outcome, str):
        return Finished(order, None, outcome)
    return Finished(order, outcome)
