"""A drive that is a CANopen node: its settings on the network, and what its port hears from there."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final, Protocol, TypeAlias

from fieldbus.canopen.node_setup import NodeSetup, Parameter, PdoSetup
from fieldbus.errors import ConfigurationError, HilError
from motion.drives._link import LinkConfig

if TYPE_CHECKING:
    from fieldbus.canopen.master import CanopenMaster
    from fieldbus.canopen.node import RemoteNode


Row: TypeAlias = tuple[int, int, int, int]
"""A parameter: index, sub-index, value, bytes."""
_HEARTBEAT: Final = 0x101700


class CommissioningError(HilError):
    """A drive refuses a parameter that the cyclic operation needs."""


@dataclass(frozen=True, kw_only=True)
class CanopenNodeConfig(LinkConfig):
    """Facts about a drive on CANopen that the controller has to know, in addition to those of `LinkConfig`.

    Args:
        node_id: CANopen node, 1..127.
        heartbeat_ms: Heartbeat of drive and controller; 0 switches it off.
        consumer_heartbeat_ms: Time after which either side reports the other's heartbeat as lost.
        abort_connection: 6007h, the drive's reaction to lost communication.
        guard_time_ms: Period of node guarding, for drives without heartbeat; 0 = none.
        life_time_factor: Guard times without an answer after which either side reports the other as lost.
        vendor_id: Expected 1018h:1; None = any. Likewise `product_code`, `revision`, `serial`.
        store: Have the drive keep the parameters (1010h).
        commission: Set the drive up; otherwise it is only compared, and not used if something differs.

    Raises:
        ConfigurationError: A value is out of range.

    """

    node_id: int
    heartbeat_ms: int = 100
    consumer_heartbeat_ms: int = 250
    abort_connection: int = 3
    guard_time_ms: int = 0
    life_time_factor: int = 3
    vendor_id: int | None = None
    product_code: int | None = None
    revision: int | None = None
    serial: int | None = None
    store: bool = True
    commission: bool = True

    def __post_init__(self) -> None:
        LinkConfig.__post_init__(self)
        if not 1 <= self.node_id <= 127:
            raise ConfigurationError("drive.node_id", self.node_id, "1..127")


class NodePort(Protocol):
    """What a port is to its node."""

    name: str

    def drive_restarted(self) -> None:
        """Take note that the drive has started again."""

    def enter_service(self) -> None:
        """Take note that the drive is configured and Operational."""

    def leave_service(self) -> None:
        """Take note that the drive must not be relied on any more."""

    def take_emcy(self, code: int) -> None:
        """Take note of an EMCY."""

    def emit(self, kind: str, **data: str | float | bool) -> None:
        """Write an event of this drive into the log."""


class CanopenNode:
    """Stands between a port and the network (`NodeUser`).

    The network compares and writes what is given here, at the start and whenever the drive comes back.

    Args:
        port: Gets the events of the node.
        master: The controller's CANopen services on the segment of the drive.
        setup: What the node is expected to be.

    """

    def __init__(self, port: NodePort, master: CanopenMaster, setup: NodeSetup) -> None:
        self._port = port
        self.remote: RemoteNode = master.add_node(setup, self)
        """The drive as a node of the network."""

    def node_restarted(self) -> None:
        """Tell the port that the drive has restarted: its state is lost."""
        self._port.drive_restarted()

    def node_in_service(self) -> None:
        """Let the port use the drive: it is configured and Operational."""
        self._port.enter_service()

    def node_lost(self, reason: str) -> None:
        """Take the drive out of use and log why."""
        self._port.leave_service()
        if reason == "heartbeat":
            self._port.emit("link.heartbeat_lost")
        else:
            self._port.emit("link.node_lost", reason=reason)

    def node_state(self, state: int) -> None:
        """Log the new NMT state."""
        self._port.emit("link.nmt_state", state=int(state))

    def node_emcy(self, code: int) -> None:
        """Give an EMCY to the port."""
        self._port.take_emcy(code)


def node_setup(
    name: str,
    config: CanopenNodeConfig,
    *,
    controller: int,
    disable: int,
    pdos: tuple[PdoSetup, ...],
    parameters: Iterable[Row] = (),
    prepare: tuple[Parameter, ...] = (),
    calm: tuple[Parameter, ...] = (),
    device_profile: int | None = None,
    taken: Callable[[Iterable[Row]], list[Row]] = list,
) -> NodeSetup:
    """Return what a drive is expected to be and is set up to.

    Args:
        name: Of the drive.
        config: Facts about the drive.
        controller: Node-ID of the controller.
        disable: Object that switches the drive off when it is 0, before anything is written.
        pdos: The PDOs that the cycle uses, and those that have to be silent.
        parameters: What the profile needs besides bus cycle, reaction to lost communication and
            error control: (index, sub-index, value, length).
        prepare: Written after that.
        calm: See `NodeSetup`.
        device_profile: Expected profile in 1000h; None = any.
        taken: Returns those of the parameters that the drive has, with the lengths that it gives them.

    """
    rows = taken(_rows(config, controller, parameters))
    written_keys = {index << 8 | sub for index, sub, *_ in rows}
    has_heartbeat = bool(config.heartbeat_ms) and _HEARTBEAT in written_keys
    guard_time_ms = config.guard_time_ms
    if config.heartbeat_ms and not has_heartbeat:
        guarding = taken([(0x100C, 0, config.heartbeat_ms, 2), (0x100D, 0, config.life_time_factor, 1)])
        if len(guarding) == 2:
            guard_time_ms = config.heartbeat_ms
            rows += guarding
    return NodeSetup(
        node_id=config.node_id,
        name=name,
        device_profile=device_profile,
        vendor_id=config.vendor_id,
        product_code=config.product_code,
        revision=config.revision,
        serial=config.serial,
        calm=calm,
        prepare=(Parameter(disable, 0, 0, 2), *prepare),
        pdos=pdos,
        parameters=tuple(Parameter(*row) for row in rows),
        store=config.store and bool(taken([(0x1010, 1, 0, 4)])),
        heartbeat_timeout_ms=config.consumer_heartbeat_ms if has_heartbeat else 0,
        guard_time_ms=guard_time_ms,
        life_time_factor=config.life_time_factor,
        optional=config.optional,
        compare_only=not config.commission,
    )


def _rows(config: CanopenNodeConfig, controller: int, own: Iterable[Row]) -> list[Row]:
    """Return what is written into the drive, the profile's rows between bus cycle and error control."""
    heartbeat = controller << 16 | config.consumer_heartbeat_ms if config.heartbeat_ms else 0
    rows = [
        (0x1006, 0, config.cycle_ns // 1000, 4),
        *own,
        (0x6007, 0, config.abort_connection, 2),
        (0x1017, 0, config.heartbeat_ms, 2),
        (0x1016, 1, heartbeat, 4),
    ]
    if config.guard_time_ms:
        rows += [(0x100C, 0, config.guard_time_ms, 2), (0x100D, 0, config.life_time_factor, 1)]
    return rows


def written(node: RemoteNode) -> list[tuple[int, int, int]]:
    """Return what commissioning may write into a node, in order: (index, sub-index, value)."""
    return [(index, sub, value) for index, sub, value, _ in node.setup.everything()]
