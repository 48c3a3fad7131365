"""The controller's CANopen services: NMT, SYNC, heartbeat, EMCY, raw PDOs,
SDO clients and nodes (CiA 301).
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from types import MappingProxyType
from typing import Final

from fieldbus.can.frame import CanFrame
from fieldbus.can.segment import CanSegment
from fieldbus.canopen.connection import BusConnection, DataCallback, Remover
from fieldbus.canopen.nmt import COB_EMCY, COB_ERROR_CONTROL, COB_NMT, COB_SYNC, NmtCommand, NmtState
from fieldbus.canopen.node import NodeUser, RemoteNode
from fieldbus.canopen.node_setup import NodeSetup
from fieldbus.canopen.sdo_client import SdoClient, SdoPacing
from fieldbus.canopen.supervision import HeartbeatWatch
from fieldbus.clock import Scheduler, Timer
from fieldbus.errors import ConfigurationError
from fieldbus.history import History, Scalar

SYNC_PRIORITY: Final = -10
"""SYNC goes before everything else of its instant."""

_NMT_COMMANDS: Final = frozenset(NmtCommand)


class CanopenMaster:
    """One controller on a segment.

    Args:
        scheduler: Time of the bench.
        segment: CAN segment to attach to.
        name: Name of the port and in the history.
        node_id: Own node-ID, for the heartbeat, 1..127.
        history: Log for `node.*`, `heartbeat.lost`, `heartbeat.back`, `guarding.lost`, `guarding.back` and
            `emcy.received`; None for none.

    Raises:
        ConfigurationError: `node_id` is out of range.

    """

    def __init__(
        self,
        scheduler: Scheduler,
        segment: CanSegment,
        *,
        name: str = "controller",
        node_id: int = 127,
        history: History | None = None,
    ) -> None:
        if not 1 <= node_id <= 127:
            raise ConfigurationError(f"{name}: node_id", node_id, "1..127")
        self.scheduler = scheduler
        self.name = name
        self.node_id = node_id
        self._history = history
        self._connection = BusConnection(segment, name)
        self._port = self._connection.port
        self._watches: list[HeartbeatWatch] = []
        self._pacing = SdoPacing(scheduler, segment.bitrate)
        self._clients: dict[int, SdoClient] = {}
        self._nodes: dict[int, RemoteNode] = {}
        self._heartbeat: Timer | None = None
        self._sync: Timer | None = None
        self._sync_frames: tuple[CanFrame, ...] = ()
        self._sync_next = 0
        self.sync_count = 0
        """SYNCs sent since construction."""

    # -- frames
    # -----------------------------------------------------------------------------------------------

    def send(self, cob_id: int, data: bytes) -> None:
        """Queue a data frame with an 11-bit identifier."""
        self._port.send(CanFrame(cob_id, data))

    def send_frame(self, frame: CanFrame) -> None:
        """Queue a frame."""
        self._port.send(frame)

    def send_all(self, frames: Iterable[CanFrame]) -> None:
        """Queue several frames."""
        self._port.send_all(frames)

    def send_remote(self, cob_id: int, dlc: int = 0) -> None:
        """Queue a remote frame: a guarding request or a PDO request."""
        self._port.send(CanFrame(cob_id, remote=True, dlc=dlc))

    def subscribe(self, cob_id: int, callback: DataCallback, *, apart: bool = False) -> Remover:
        """Call `callback(data, time_ns)` for data frames with an 11-bit identifier; return the remover.

        See `BusConnection.subscribe`.
        """
        return self._connection.subscribe(cob_id, callback, apart=apart)

    # -- network management
    # -----------------------------------------------------------------------------------

    def nmt(self, command: int, node: int = 0) -> None:
        """Send a node control command (`NmtCommand`) to one node, or to all with 0.

        A managed node (`add_node`) that is taken out of Operational in this way stays out until it is
        commanded to start, or restarts.

        Raises:
            ConfigurationError: There is no such command, or no such node-ID. A frame that is wrong on
                purpose goes through the segment (`inject`), as a frame of another node.

        """
        if command not in _NMT_COMMANDS:
            allowed = ", ".join(f"{one:02X}h {one.name}" for one in NmtCommand)
            raise ConfigurationError("NMT command", f"{command:02X}h", allowed)
        if not 0 <= node <= 127:
            raise ConfigurationError("NMT node", node, "1..127, or 0 for all")
        self._port.send(CanFrame(COB_NMT, bytes((command, node))))
        for managed in self._nodes.values():
            if node in (0, managed.node_id):
                managed.note_command(command)

    # -- nodes and SDO
    # ----------------------------------------------------------------------------------------

    @property
    def nodes(self) -> Mapping[int, RemoteNode]:
        """The managed nodes, by node-ID."""
        return MappingProxyType(self._nodes)

    def add_node(self, setup: NodeSetup, user: NodeUser | None = None) -> RemoteNode:
        """Manage a node of the network; `RemoteNode.boot` then takes it into service.

        Raises:
            ConfigurationError: The node-ID is the controller's own, or managed already.

        """
        node = setup.node_id
        if node == self.node_id or node in self._nodes:
            raise ConfigurationError(f"{self.name}: node_id of {setup.name}", node, "a node-ID of its own")
        self._nodes[node] = managed = RemoteNode(
            setup,
            user,
            scheduler=self.scheduler,
            connection=self._connection,
            sdo=self.sdo(node),
            report=self.emit,
        )
        return managed

    def sdo(self, node: int) -> SdoClient:
        """Return the SDO client of a node; there is one, so that a server never gets two requests at once.

        Raises:
            ConfigurationError: `node` is out of range.

        """
        client = self._clients.get(node)
        if client is None:
            client = self._clients[node] = SdoClient(
                node,
                scheduler=self.scheduler,
                connection=self._connection,
                pacing=self._pacing,
                name=self.name,
            )
        return client

    def emit(self, kind: str, **data: Scalar) -> None:
        """Write an event into the history, if there is one."""
        if self._history is not None:
            self._history.emit(self.name, kind, **data)

    def close(self) -> None:
        """Stop all cyclic services: SYNC, heartbeat, guarding, boots."""
        self.stop_sync()
        self.produce_heartbeat(0)
        for node in self._nodes.values():
            node.stop()

    def power_off(self) -> None:
        """Fall silent at once, as a controller without supply: nothing is sent, received or acknowledged."""
        self.close()
        self._port.online = False

    def power_on(self) -> None:
        """Come back: every node is taken into service from the beginning. SYNC and heartbeat stay
        off until they are started.
        """
        self._port.online = True
        for node in self._nodes.values():
            node.boot()

    def on_bootup(self, node: int, callback: Callable[[], None]) -> Remover:
        """Call `callback()` when `node` reports its boot-up; return the remover."""

        def receive(data: bytes, _time_ns: int) -> None:
            if data == b"\0":
                self.emit("node.bootup", node=node)
                callback()

        return self.subscribe(COB_ERROR_CONTROL + node, receive)

    def on_emcy(
        self, node: int, callback: Callable[[int, int, bytes], None], *, cob_id: int | None = None
    ) -> Remover:
        """Call `callback(code, register, data)` for EMCYs of `node`; return the remover.

        Frames of another length than eight bytes are ignored. `cob_id` is for a node with another 1014h.
        """

        def receive(data: bytes, _time_ns: int) -> None:
            if len(data) == 8:
                code = data[0] | data[1] << 8
                self.emit("emcy.received", node=node, code=code, register=data[2])
                callback(code, data[2], data[3:])

        return self.subscribe(COB_EMCY + node if cob_id is None else cob_id, receive)

    # -- SYNC
    # -------------------------------------------------------------------------------------------------

    def start_sync(
        self, period_ns: int, phase_ns: int = 0, *, counter_overflow: int = 0, cob_id: int = COB_SYNC
    ) -> None:
        """Send SYNC at every `k * period_ns + phase_ns`, before all other events of the instant.

        Args:
            period_ns: Cycle, ns.
            phase_ns: Offset on the grid, 0..period_ns - 1.
            counter_overflow: 0 = no data, 2..240 = counter from 1 to this value (1019h of the slaves).
            cob_id: Identifier (1005h of the slaves).

        Raises:
            ConfigurationError: `counter_overflow` is out of range.

        """
        if counter_overflow and not 2 <= counter_overflow <= 240:
            raise ConfigurationError(f"{self.name}: counter_overflow", counter_overflow, "0 or 2..240")
        self.stop_sync()
        if counter_overflow:
            self._sync_frames = tuple(CanFrame(cob_id, bytes((n,))) for n in range(1, counter_overflow + 1))
        else:
            self._sync_frames = (CanFrame(cob_id),)
        self._sync_next = 0
        self._pacing.sync = self._sync = self.scheduler.every(
            period_ns, self._send_sync, phase_ns=phase_ns, priority=SYNC_PRIORITY
        )
        self._sync.apart = True

    def stop_sync(self) -> None:
        """Stop sending SYNC."""
        if self._sync is not None:
            self._sync.cancel()
            self._pacing.sync = self._sync = None

    def _send_sync(self) -> None:
        frames = self._sync_frames
        self.sync_count += 1
        number = self._sync_next
        self._port.send(frames[number])
        number += 1
        self._sync_next = number if number < len(frames) else 0

    # -- heartbeat
    # --------------------------------------------------------------------------------------------

    def produce_heartbeat(self, period_ns: int) -> None:
        """Send the own heartbeat (Operational) now and every `period_ns`; 0 stops it."""
        if self._heartbeat is not None:
            self._heartbeat.cancel()
            self._heartbeat = None
        if period_ns:
            frame = CanFrame(COB_ERROR_CONTROL + self.node_id, bytes((NmtState.OPERATIONAL,)))
            send = self._port.send
            # The grid begins with the present instant: the first heartbeat goes out at once.
            self._heartbeat = self.scheduler.every(
                period_ns, lambda: send(frame), phase_ns=self.scheduler.now % period_ns
            )

    def watch_heartbeat(
        self,
        node: int,
        timeout_ns: int,
        on_lost: Callable[[], None] | None = None,
        on_state: Callable[[int], None] | None = None,
    ) -> Remover:
        """Watch the heartbeat of `node`; return the function that ends it (see `HeartbeatWatch`).

        Args:
            node: 1..127.
            timeout_ns: Longest silence, ns.
            on_lost: Called once per loss.
            on_state: Called with the new state when it changes (0 = boot-up),
                and with the first after a loss.

        Raises:
            ConfigurationError: `node` or `timeout_ns` is out of range.

        """
        if not 1 <= node <= 127:
            raise ConfigurationError(f"{self.name}: watch_heartbeat node", node, "1..127")
        if timeout_ns <= 0:
            raise ConfigurationError(f"{self.name}: watch_heartbeat timeout_ns", timeout_ns, "more than 0")

        def lost() -> None:
            self.emit("heartbeat.lost", node=node)
            if on_lost is not None:
                on_lost()

        watch = HeartbeatWatch(
            self.scheduler,
            timeout_ns,
            on_lost=lost,
            on_back=lambda: self.emit("heartbeat.back", node=node),
            on_state=on_state,
        )
        remove = self.subscribe(COB_ERROR_CONTROL + node, watch.receive)
        self._watches.append(watch)

        def end() -> None:
            remove()
            watch.stop()
            if watch in self._watches:
                self._watches.remove(watch)

        return end
