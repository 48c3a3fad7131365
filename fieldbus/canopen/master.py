"""The controller's cyclic CANopen services: NMT, SYNC, heartbeat, EMCY and raw PDOs (CiA 301).

Commissioning over SDO is not here: it uses the `canopen` library through `PumpedNetwork`.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Final

from fieldbus.can.frame import CanFrame, CanSegment
from fieldbus.canopen.nmt import COB_EMCY, COB_ERROR_CONTROL, COB_NMT, COB_SYNC, NmtState
from fieldbus.clock import Scheduler, Timer
from fieldbus.errors import ConfigurationError
from fieldbus.history import History

SYNC_PRIORITY: Final = -10
"""SYNC goes before everything else of its instant."""

DataCallback = Callable[[bytes, int], None]
Remover = Callable[[], None]


class CanopenMaster:
    """One controller on a segment.

    Args:
        scheduler: Time of the bench.
        segment: CAN segment to attach to.
        name: Name of the port and in the history.
        node_id: Own node-ID, for the heartbeat, 1..127.
        history: Log for `heartbeat.lost`, `heartbeat.back`, `emcy.received` and `node.bootup`; None for none.

    Raises:
        ConfigurationError: `node_id` is out of range.

    """

    __slots__ = (
        "_heartbeat",
        "_history",
        "_port",
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
        self._watches: list[_HeartbeatWatch] = []
        self._heartbeat: Timer | None = None
        self._sync: Timer | None = None
        self._sync_frames: tuple[CanFrame, ...] = ()
        self._sync_next = 0
        self.sync_count = 0
        """SYNCs sent since construction."""
        self._port = segment.attach(name, self._receive)

    # -- frames -----------------------------------------------------------------------------------------------

    def send(self, cob_id: int, data: bytes) -> None:
        """Queue a data frame with an 11-bit identifier."""
        self._port.send(CanFrame(cob_id, data))

    def send_remote(self, cob_id: int, dlc: int = 0) -> None:
        """Queue a remote frame: a guarding request or a PDO request."""
        self._port.send(CanFrame(cob_id, remote=True, dlc=dlc))

    def subscribe(self, cob_id: int, callback: DataCallback) -> Remover:
        """Call `callback(data, time_ns)` for data frames with an 11-bit identifier; return the remover.

        `data` is what came on the wire, of any length: the callback must not trust it.
        """
        subscribers = self._subscribers
        subscribers[cob_id] = (*subscribers.get(cob_id, ()), callback)

        def remove() -> None:
            rest = tuple(other for other in subscribers.get(cob_id, ()) if other is not callback)
            if rest:
                subscribers[cob_id] = rest
            else:
                subscribers.pop(cob_id, None)

        return remove

    def _receive(self, frame: CanFrame, time_ns: int) -> None:
        callbacks = self._subscribers.get(frame.can_id)
        if callbacks is None or frame.remote or frame.extended:
            return
        data = frame.data
        for callback in callbacks:
            callback(data, time_ns)

    # -- network management -----------------------------------------------------------------------------------

    def nmt(self, command: int, node: int = 0) -> None:
        """Send a node control command (`NmtCommand`) to one node, or to all with 0."""
        self._port.send(CanFrame(COB_NMT, bytes((command, node))))

    def on_bootup(self, node: int, callback: Callable[[], None]) -> Remover:
        """Call `callback()` when `node` reports its boot-up; return the remover."""

        def receive(data: bytes, _time_ns: int) -> None:
            if data == b"\0":
                if self._history is not None:
                    self._history.emit(self.name, "node.bootup", node=node)
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
                if self._history is not None:
                    self._history.emit(self.name, "emcy.received", node=node, code=code, register=data[2])
                callback(code, data[2], data[3:])

        return self.subscribe(COB_EMCY + node if cob_id is None else cob_id, receive)

    # -- SYNC -------------------------------------------------------------------------------------------------

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

    # -- heartbeat --------------------------------------------------------------------------------------------

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
        """Watch the heartbeat of `node`; return the function that ends it.

        Monitoring starts with the first heartbeat (C301-026). A boot-up or a change of state is reported as such,
        never as a loss (C301-027); after a boot-up monitoring waits for the first heartbeat again.

        Args:
            node: 1..127.
            timeout_ns: Longest silence, ns.
            on_lost: Called once per loss.
            on_state: Called with the new state when it changes (0 = boot-up), and with the first after a loss.

        Raises:
            ConfigurationError: `node` or `timeout_ns` is out of range.

        """
        if not 1 <= node <= 127:
            raise ConfigurationError(f"{self.name}: watch_heartbeat node", node, "1..127")
        if timeout_ns <= 0:
            raise ConfigurationError(f"{self.name}: watch_heartbeat timeout_ns", timeout_ns, "more than 0")
        watch = _HeartbeatWatch(self, node, timeout_ns, on_lost, on_state)
        remove = self.subscribe(COB_ERROR_CONTROL + node, watch.receive)
        self._watches.append(watch)

        def end() -> None:
            remove()
            watch.stop()
            if watch in self._watches:
                self._watches.remove(watch)

        return end

    def log(self, kind: str, node: int) -> None:
        """Emit an event about a node, if there is a history."""
        if self._history is not None:
            self._history.emit(self.name, kind, node=node)


class _HeartbeatWatch:
    """One watched node; its timer is entered once per timeout, not once per heartbeat."""

    __slots__ = (
        "_last_ns",
        "_lost",
        "_master",
        "_node",
        "_on_lost",
        "_on_state",
        "_state",
        "_timeout_ns",
        "_timer",
    )

    def __init__(
        self,
        master: CanopenMaster,
        node: int,
        timeout_ns: int,
        on_lost: Callable[[], None] | None,
        on_state: Callable[[int], None] | None,
    ) -> None:
        self._master = master
        self._node = node
        self._timeout_ns = timeout_ns
        self._on_lost = on_lost
        self._on_state = on_state
        self._timer: Timer | None = None
        self._last_ns = 0
        self._state = -1
        self._lost = False

    def receive(self, data: bytes, time_ns: int) -> None:
        if len(data) != 1:
            return
        state = data[0] & 0x7F
        if state == NmtState.INITIALISING:
            self.stop()
        else:
            self._last_ns = time_ns
            if self._timer is None:
                self._arm(time_ns + self._timeout_ns)
        if self._lost:
            self._lost = False
            self._master.log("heartbeat.back", self._node)
        if state != self._state:
            self._state = state
            if self._on_state is not None:
                self._on_state(state)

    def stop(self) -> None:
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None

    def _arm(self, due_ns: int) -> None:
        scheduler = self._master.scheduler
        self._timer = scheduler.at(max(due_ns, scheduler.now), self._due)

    def _due(self) -> None:
        self._timer = None
        due = self._last_ns + self._timeout_ns
        if due > self._master.scheduler.now:
            self._arm(due)
            return
        self._lost = True
        self._state = -1
        self._master.log("heartbeat.lost", self._node)
        if self._on_lost is not None:
            self._on_lost()
