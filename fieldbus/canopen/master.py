"""The controller's CANopen services: NMT, SYNC, heartbeat, EMCY, raw PDOs, SDO clients and nodes (CiA
301).
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from types import MappingProxyType
from typing import Final

from fieldbus.can.frame import CanFrame, CanSegment, FrameReceiver
from fieldbus.canopen.nmt import COB_EMCY, COB_ERROR_CONTROL, COB_NMT, COB_SYNC, NmtCommand, NmtState
from fieldbus.canopen.node import RemoteNode
from fieldbus.canopen.node_setup import NodeSetup
from fieldbus.canopen.node_user import NodeUser
from fieldbus.canopen.sdo_client import SdoClient
from fieldbus.canopen.supervision import HeartbeatWatch
from fieldbus.clock import S, Scheduler, Timer
from fieldbus.errors import ConfigurationError
from fieldbus.history import History, Scalar

SYNC_PRIORITY: Final = -10
"""SYNC goes before everything else of its instant."""

_NMT_COMMANDS: Final = frozenset(NmtCommand)
_FRAME_BITS: Final = 135
"""Longest frame of a PDO or SDO with all its stuff bits, and the gap behind it."""
_SDO_IN_A_ROW: Final = 16
"""SDO requests, of all clients together, between two pauses."""

DataCallback = Callable[[bytes, int], None]
Remover = Callable[[], None]


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

    __slots__ = (
        "_accept",
        "_clients",
        "_frame_ns",
        "_heartbeat",
        "_history",
        "_mailboxes",
        "_nodes",
        "_port",
        "_sdo_active",
        "_sdo_count",
        "_sdo_pause_ns",
        "_subscribers",
        "_sync",
        "_sync_frames",
        "_sync_next",
        "_watches",
        "name",
        "node_id",
        "scheduler",
        "sync_count",
    )

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
        self._subscribers: dict[int, tuple[DataCallback, ...]] = {}
        self._watches: list[HeartbeatWatch] = []
        self._clients: dict[int, SdoClient] = {}
        self._sdo_active: set[int] = set()
        self._sdo_count = 0
        self._sdo_pause_ns = 0
        self._nodes: dict[int, RemoteNode] = {}
        # Live segments may not know their bit rate; most run at the highest.
        self._frame_ns = _FRAME_BITS * S // (getattr(segment, "bitrate", None) or 1_000_000)
        self._heartbeat: Timer | None = None
        self._sync: Timer | None = None
        self._sync_frames: tuple[CanFrame, ...] = ()
        self._sync_next = 0
        self.sync_count = 0
        """SYNCs sent since construction."""
        self._mailboxes: dict[int, FrameReceiver] = {}
        self._port = segment.attach(name, self._receive)
        # A controller in virtual time looks up itself who takes a frame.
        self._accept: Callable[[Mapping[int, FrameReceiver]], None] | None = getattr(
            self._port, "accept", None
        )
        if self._accept is not None:
            self._accept(self._mailboxes)

    # -- frames
    # -----------------------------------------------------------------------------------------------

    def send(self, cob_id: int, data: bytes) -> None:
        """Queue a data frame with an 11-bit identifier."""
        self._port.send(CanFrame(cob_id, data))

    def send_all(self, frames: Iterable[CanFrame]) -> None:
        """Queue several frames."""
        self._port.send_all(frames)

    def send_remote(self, cob_id: int, dlc: int = 0) -> None:
        """Queue a remote frame: a guarding request or a PDO request."""
        self._port.send(CanFrame(cob_id, remote=True, dlc=dlc))

    def subscribe(self, cob_id: int, callback: DataCallback) -> Remover:
        """Call `callback(data, time_ns)` for data frames with an 11-bit identifier; return the remover.

        `data` is what came on the wire, of any length: the callback must not trust it.
        """
        subscribers = self._subscribers
        self._subscribe(cob_id, (*subscribers.get(cob_id, ()), callback))

        def remove() -> None:
            self._subscribe(
                cob_id, tuple(other for other in subscribers.get(cob_id, ()) if other is not callback)
            )

        return remove

    def _subscribe(self, cob_id: int, callbacks: tuple[DataCallback, ...]) -> None:
        if not callbacks:
            self._subscribers.pop(cob_id, None)
            self._mailboxes.pop(cob_id, None)
        else:
            self._subscribers[cob_id] = callbacks
            self._mailboxes[cob_id] = _only(callbacks[0]) if len(callbacks) == 1 else self._receive
        if self._accept is not None:
            self._accept(self._mailboxes)

    def _receive(self, frame: CanFrame, time_ns: int) -> None:
        callbacks = self._subscribers.get(frame.can_id)
        if callbacks is None or frame.remote or frame.extended:
            return
        data = frame.data
        for callback in callbacks:
            callback(data, time_ns)

    # -- network management
    # -----------------------------------------------------------------------------------

    def nmt(self, command: int, node: int = 0) -> None:
        """Send a node control command (`NmtCommand`) to one node, or to all with 0.

        A managed node (`add_node`) that is taken out of Operational in this way stays out until it is told to
        start or starts anew.

        Raises:
            ConfigurationError: There is no such command, or no such node-ID. A frame that is wrong on
                purpose goes through the segment (`inject`), as that of a stranger.

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
        self._nodes[node] = managed = RemoteNode(self, setup, user)
        return managed

    def sdo(self, node: int) -> SdoClient:
        """Return the SDO client of a node; there is one, so that a server never gets two requests at once.

        Raises:
            ConfigurationError: `node` is out of range.

        """
        client = self._clients.get(node)
        if client is None:
            client = self._clients[node] = SdoClient(self, node)
        return client

    def sdo_under_way(self, client: SdoClient, active: bool) -> None:
        """Note whether a client has a transfer under way; clients call this."""
        if active:
            self._sdo_active.add(client.node)
        else:
            self._sdo_active.discard(client.node)

    def sdo_delay_ns(self, requests: int = 1) -> int:
        """Return how long SDO requests have to wait for the good of the others, ns; 0 = not at all.

        * A request whose answer may still be on the bus when SYNC is due waits for it: SYNC would come late
          by up to a frame, and every drive would sample late. A cycle that is too short for it is not spared.
        * After some requests there is a pause. Frames of error control have less priority than SDOs, and
          would not get through between clients and servers that answer each other without delay.

        Both hold for all clients together. Requests that need not wait count as sent.

        Args:
            requests: Frames that are to be sent at once; one answer is expected.

        """
        now = self.scheduler.now
        if now < self._sdo_pause_ns:
            return self._sdo_pause_ns - now
        clients = max(1, len(self._sdo_active))
        need_ns = self._frame_ns * (requests + 1) * clients
        sync = self._sync
        if sync is not None:
            left_ns = sync.due_ns - now
            if 0 < left_ns < need_ns < sync.period_ns:
                return left_ns
        self._sdo_count += 1
        if self._sdo_count <= _SDO_IN_A_ROW:
            return 0
        self._sdo_count = 0
        # The exchanges of the other clients end; then a moment is enough for a frame that has been waiting.
        pause_ns = 2 * self._frame_ns * (clients - 1) + self._frame_ns // 8
        self._sdo_pause_ns = now + pause_ns
        return pause_ns

    def emit(self, kind: str, **data: Scalar) -> None:
        """Write an event into the history, if there is one."""
        if self._history is not None:
            self._history.emit(self.name, kind, **data)

    def close(self) -> None:
        """Stop everything that sends by itself: SYNC, heartbeat, guarding, boots."""
        self.stop_sync()
        self.produce_heartbeat(0)
        for node in self._nodes.values():
            node.stop()

    def power_off(self) -> None:
        """Fall silent at once, as a controller whose supply is gone: nothing is sent, heard or
        acknowledged.
        """
        self.close()
        self._port.online = False

    def power_on(self) -> None:
        """Come back: every node is taken into service from the beginning. SYNC and heartbeat are started by
        whoever needs them.
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
        self._sync = self.scheduler.every(
            period_ns, self._send_sync, phase_ns=phase_ns, priority=SYNC_PRIORITY
        )

    def stop_sync(self) -> None:
        """Stop sending SYNC."""
        if self._sync is not None:
            self._sync.cancel()
            self._sync = None

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
            on_state: Called with the new state when it changes (0 = boot-up), and with the first after a
                loss.

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


def _only(callback: DataCallback) -> FrameReceiver:
    """Return what gives the data of a frame to a callback."""

    def take(frame: CanFrame, time_ns: int) -> None:
        callback(frame.data, time_ns)

    return take
