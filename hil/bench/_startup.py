"""Taking the drives of a bench into service, all at the same time, and what is said when one does not
come.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING, Final

from fieldbus.canopen.boot import BootState
from fieldbus.clock import S
from hil.errors import BlockedError
from motion.drives.cia402 import CommissioningError

if TYPE_CHECKING:
    from fieldbus.canopen.node import RemoteNode
    from fieldbus.clock import Scheduler
    from fieldbus.errors import HilError
    from hil.bench._ports import Port
    from hil.bench.encoders import EncoderNodes
    from motion.drives.profidrive_modbus import ProfidriveModbusPort

BOOT_TIMEOUT_NS: Final = 5 * S


class BenchNotReadyError(BlockedError):
    """The bench did not come up: a drive does not answer or sends no cyclic data."""


def commission(scheduler: Scheduler, ports: Iterable[Port], encoders: EncoderNodes | None) -> None:
    """Take all drives into service, up to the command to start.

    An optional drive is waited for as long as it goes on answering.

    Raises:
        BenchNotReadyError: A drive did not come up, or is another one than the bench file says.
        CommissioningError: A drive refuses a parameter.

    """
    if encoders is not None:
        encoders.start()
    nodes: list[RemoteNode] = []
    on_modbus: list[ProfidriveModbusPort] = []
    for port in ports:
        node = getattr(port, "node", None)
        if node is not None:
            nodes.append(node)
            node.boot()
        elif hasattr(port, "boot"):
            on_modbus.append(port)  # type: ignore[arg-type]
            on_modbus[-1].boot()

    def settled(node: RemoteNode) -> bool:
        failure = node.failure
        return node.started or (failure is not None and (node.setup.optional or not failure.silent))

    scheduler.run_until(
        lambda: (
            all(settled(node) for node in nodes)
            and all(port.started or port.refusal or (port.optional and port.text) for port in on_modbus)
            and (encoders is None or encoders.settled)
        ),
        BOOT_TIMEOUT_NS,
    )
    for node in nodes:
        if not node.started and not node.setup.optional:
            raise _node_not_started(node)
    for port in on_modbus:
        if not port.started and not port.optional:
            raise _port_not_started(port)


def _node_not_started(node: RemoteNode) -> HilError:
    failure = node.failure
    if failure is None or (failure.silent and failure.state is BootState.WAITING):
        reason = "" if failure is None else f": {failure.what}"
        return BenchNotReadyError(
            f"{node.name} (node {node.node_id}) does not answer on the bus within {BOOT_TIMEOUT_NS // S} "
            f"s{reason}"
        )
    if failure.abort_code and not failure.silent:
        return CommissioningError(str(failure))
    return BenchNotReadyError(str(failure))


def _port_not_started(port: ProfidriveModbusPort) -> HilError:
    if port.refusal:
        return BenchNotReadyError(
            f"{port.name} (unit {port.unit}) is another drive than its register map says: {port.refusal}"
        )
    reason = f": {port.text}" if port.text else ""
    return BenchNotReadyError(
        f"{port.name} (unit {port.unit}) does not answer within {BOOT_TIMEOUT_NS // S} s{reason}"
    )


def missing(port: Port) -> bool:
    """Say whether a drive may be missing, and is."""
    node = getattr(port, "node", None)
    started = port.started if node is None else node.started  # type: ignore[union-attr]
    return port.optional and not started
