"""Taking the drives of a bench into service, all at the same time, and what is
said when one does not answer.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

from fieldbus.canopen.boot import BootFailure, BootState
from fieldbus.clock import S
from hil.errors import BlockedError
from motion.drives.cia402 import CommissioningError

if TYPE_CHECKING:
    from collections.abc import Iterable

    from fieldbus.canopen.node import RemoteNode
    from fieldbus.clock import Scheduler
    from fieldbus.errors import HilError
    from hil.bench.drive_ports import DrivePorts
    from hil.bench.encoders import EncoderNodes
    from motion.drives.profidrive_modbus import ProfidriveModbusPort

BOOT_TIMEOUT_NS: Final = 5 * S
"""How long drives and encoders may take to answer."""
LINK_TIMEOUT_NS: Final = 5 * S
"""How long drives may take to send cyclic data."""


def commission(
    scheduler: Scheduler, ports: DrivePorts, drives: Iterable[str], encoders: EncoderNodes | None = None
) -> None:
    """Take drives into service, up to the command to start.

    An optional drive is waited for as long as it continues answering.

    Args:
        scheduler: Time of the bench.
        ports: The controller's ports.
        drives: Names of the drives.
        encoders: Encoders with a node of their own.

    Raises:
        BlockedError: A drive did not come up, or is another one than the bench file says.
        CommissioningError: A drive refuses a parameter.

    """
    if encoders is not None:
        encoders.start()
    nodes: list[RemoteNode] = []
    on_modbus: list[ProfidriveModbusPort] = []
    for name in drives:
        node = ports.node(name)
        if node is not None:
            nodes.append(node)
            node.boot()
        elif name in ports.modbus:
            on_modbus.append(ports.modbus[name])
            on_modbus[-1].boot()

    def settled() -> bool:
        # Asked after every event of the start: a loop, because generators cost more than what they yield.
        for node in nodes:
            if not node.started:
                failure = node.failure
                if failure is None or (failure.silent and not node.setup.optional):
                    return False
        for port in on_modbus:
            if not (port.started or port.refusal or (port.optional and port.text)):
                return False
        return encoders is None or encoders.settled

    scheduler.run_until(settled, BOOT_TIMEOUT_NS)
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
        return BlockedError(
            f"{node.name} (node {node.node_id}) does not answer on the bus within "
            f"{BOOT_TIMEOUT_NS // S} s{reason}"
        )
    if failure.differences:
        return BlockedError(
            f"{failure}. `hil commission BENCH --write` sets it up once, commission = true in "
            f"[drive.{node.name}] at every start"
        )
    if failure.abort_code and not failure.silent:
        return CommissioningError(str(failure))
    return BlockedError(str(failure))


def _port_not_started(port: ProfidriveModbusPort) -> HilError:
    if port.refusal:
        return BlockedError(
            f"{port.name} (unit {port.unit}) is another drive than its register map says: {port.refusal}"
        )
    reason = f": {port.text}" if port.text else ""
    return BlockedError(
        f"{port.name} (unit {port.unit}) does not answer within {BOOT_TIMEOUT_NS // S} s{reason}"
    )


def wait_for_encoders(scheduler: Scheduler, encoders: EncoderNodes) -> None:
    """Wait until all encoders with a node of their own are in service.

    Raises:
        BlockedError: One is no encoder, cannot be read, or does not become Operational.

    """
    try:
        encoders.check()
    except BootFailure as failure:
        raise BlockedError(str(failure)) from None
    if not scheduler.run_until(lambda: not encoders.missing, BOOT_TIMEOUT_NS):
        raise BlockedError(
            f"no heartbeat in Operational from {', '.join(encoders.missing)} within {BOOT_TIMEOUT_NS // S} s"
        )
