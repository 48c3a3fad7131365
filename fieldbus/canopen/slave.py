"""A CANopen slave: dictionary, NMT, SDO server, PDOs, EMCY, heartbeat, SYNC, TIME and LSS (CiA 301).

The device that owns it - a drive, an encoder, an I/O station - sets and reads values, registers callbacks,
and is called when the bus does something.
"""

from __future__ import annotations

import os
from collections.abc import Callable
from enum import Enum
from typing import TYPE_CHECKING, Final

from fieldbus.can.frame import CanFrame
from fieldbus.can.port import MediumPort
from fieldbus.can.segment import CanSegment
from fieldbus.canopen.communication_errors import CollisionWatch, CommunicationErrors, check_behaviour
from fieldbus.canopen.dictionary import ObjectValue
from fieldbus.canopen.dispatch import Dispatcher, Route
from fieldbus.canopen.emcy import EmcyProducer
from fieldbus.canopen.error_control import ErrorControl
from fieldbus.canopen.lss import COB_LSS_MASTER, LssSlave
from fieldbus.canopen.nmt import (
    COB_ERROR_CONTROL,
    COB_NMT,
    STATE_OF_COMMAND,
    UNCONFIGURED,
    NmtCommand,
    NmtState,
)
from fieldbus.canopen.node_settings import NodeSettings
from fieldbus.canopen.pdo_engine import PdoEngine
from fieldbus.canopen.sdo_channels import SdoChannels
from fieldbus.canopen.store import ObjectStore, ReadHook, WriteHook
from fieldbus.canopen.sync import SyncService
from fieldbus.canopen.time_stamp import TimeService
from fieldbus.clock import S, Scheduler, Timer
from fieldbus.errors import ConfigurationError
from fieldbus.history import History
from fieldbus.node_clock import NodeClock

_OVERRUN_REPORT_NS: Final = 10_000_000  # later than the loss, when the queue can take the EMCY

if TYPE_CHECKING:
    import canopen


_EVERYWHERE: Final = (NmtState.PRE_OPERATIONAL, NmtState.OPERATIONAL)


class CanopenSlave:
    """One node of a CAN segment as CiA 301 describes it.

    The slave is off until `power_on`. Frames are taken and sent within scheduler callbacks; nothing waits.

    Args:
        scheduler: Time of the bench.
        segment: CAN segment to attach to.
        dictionary: Object dictionary, for example from an EDS file; defaults relative to the node-ID are
            calculated for `node_id`, whatever the file was read for.
        node_id: 1..127, or 255: the node has none and waits for LSS (C301-163). One that LSS has stored
            goes first.
        name: Name of the port on the segment and in the history.
        history: Log for `nmt.state`, `emcy.raised`, `emcy.cleared`, `heartbeat.lost`, `life_guarding.lost`,
            `rpdo.timeout`, `lss.node_id`, `lss.bitrate` and `storage.failed`; None for none.
        boot_time_ns: Time from power-on or reset to the boot-up frame.
        sdo_timeout_ns: Silence of the client that ends a transfer (C301-072).
        bitrate: Bit rate that the node is set to, bit/s; None = that of the segment.
        storage: File in which stored parameters outlive the process; None = they do not.

    Raises:
        ConfigurationError: `node_id` or a time is out of range, the dictionary is empty, or `storage`
            cannot be used.

    """

    def __init__(
        self,
        scheduler: Scheduler,
        segment: CanSegment,
        dictionary: canopen.ObjectDictionary,
        node_id: int,
        *,
        name: str,
        history: History | None = None,
        boot_time_ns: int = 0,
        sdo_timeout_ns: int = S,
        bitrate: int | None = None,
        storage: str | os.PathLike[str] | None = None,
    ) -> None:
        if not 1 <= node_id <= 127 and node_id != UNCONFIGURED:
            raise ConfigurationError(f"{name}: node_id", node_id, "1..127, or 255 for a node without one")
        if boot_time_ns < 0:
            raise ConfigurationError(f"{name}: boot_time_ns", boot_time_ns, "0 or more")
        if sdo_timeout_ns <= 0:
            raise ConfigurationError(f"{name}: sdo_timeout_ns", sdo_timeout_ns, "more than 0")
        self.scheduler = scheduler
        self.node_id = node_id
        self.name = name
        self.boot_time_ns = boot_time_ns
        self._history = history
        self._powered = False
        self._state = NmtState.INITIALISING
        self._boot_timer: Timer | None = None
        self.on_nmt_state: list[Callable[[NmtState, NmtState], None]] = []
        """Called with old and new state."""
        self.on_reset: list[Callable[[bool], None]] = []
        """Called on NMT reset when the values have been restored; True = reset node, the application too."""

        self._store = store = ObjectStore(dictionary, node_id)
        store.predefine(node_id)
        self.values: dict[int, ObjectValue] = store.values
        """Present values, keyed `index << 8 | sub-index`; what PDOs send and SDO reads."""
        self._dispatcher = Dispatcher(scheduler.to_local_time if isinstance(scheduler, NodeClock) else None)
        self._port = segment.attach(name, self._dispatcher.receive)
        self._port.online = False
        # A port in virtual time looks up itself who takes a frame, and reports the state of its controller.
        self._controller = self._port if isinstance(self._port, MediumPort) else None
        if self._controller is not None:
            self._dispatcher.on_change = self._controller.accept
            self._controller.on_state.append(self._controller_state)
            self._controller.on_overrun.append(lambda: scheduler.after(_OVERRUN_REPORT_NS, self._overrun))
        send = self._port.send
        self.errors = EmcyProducer(
            scheduler, store, send, node_id=node_id, set_value=self.set, source=name, history=history
        )
        self._communication = communication = CommunicationErrors(
            self.errors,
            store.values,
            state=lambda: self._state,
            enter=self._enter,
            source=name,
            history=history,
        )
        self.on_communication_error: list[Callable[[str], None]] = communication.listeners
        """Called with "heartbeat", "life_guarding", "rpdo_timeout", "bus_off" or "nmt" (Operational left)."""
        self.pdos = PdoEngine(
            scheduler,
            store,
            send,
            send_all=self._port.send_all,
            # A live interface does not give a frame back.
            withdraw=(lambda _ids: None) if self._controller is None else self._controller.withdraw,
            on_change=self._rebuild,
            emcy=communication.raise_error,
            emcy_clear=self.errors.clear,
            on_timeout=communication.rpdo_timeout,
        )
        self.sync = SyncService(
            scheduler,
            store,
            send,
            self.pdos,
            emcy=communication.raise_error,
            emcy_clear=self.errors.clear,
            on_change=self._rebuild,
        )
        self.on_sync: list[Callable[[int], None]] = self.sync.on_sync
        """Called with the time at SYNC reception, after the RPDO latch, before the TPDO sampling."""
        self.error_control = ErrorControl(
            scheduler,
            store,
            send,
            node_id=node_id,
            on_lost=communication.peer_lost,
            on_found=communication.peers_found,
        )
        self.time = TimeService(scheduler, store, send, on_change=self._rebuild)
        """Clock of the device, set and sent by TIME (C301-004)."""
        self.bus_watch = CollisionWatch(
            scheduler, emcy=communication.raise_error, emcy_clear=self.errors.clear
        )
        """Reports collisions of identifiers (C301-125)."""
        self.pdos.multiplexer.node_id = node_id
        self._sdo = SdoChannels(scheduler, store, send, timeout_ns=sdo_timeout_ns)
        self.settings = NodeSettings(
            scheduler,
            store,
            send,
            self._port,
            node_id=node_id,
            bitrate=bitrate,
            bitrates=dictionary.device_information.allowed_baudrates,
            storage=storage,
            on_node_id=self._named,
            source=name,
            history=history,
        )
        # A device whose EDS says nothing about LSS has it.
        self.settings.lss.enabled = dictionary.device_information.LSS_supported is not False
        store.changed = self.pdos.touch
        store.applied[0x101400] = self._emcy_identifier_changed
        for key in store.entries:
            if key >> 8 == 0x1016 and key & 0xFF:
                store.applied[key] = self._consumers_changed
            elif key >> 8 == 0x1029 and key & 0xFF:
                store.guards[key] = check_behaviour
            elif 0x1200 <= key >> 8 <= 0x127F:
                store.applied[key] = self._rebuild
                if key & 0xFF in (1, 2):
                    store.guards[key] = self._sdo.guard(key)

    # -- what it is doing ----------------------------------------------------------------------------------

    @property
    def nmt_state(self) -> NmtState:
        """Present NMT state; INITIALISING while off."""
        return self._state

    @property
    def powered(self) -> bool:
        """Whether `power_on` was called after the last `power_off`."""
        return self._powered

    @property
    def lss(self) -> LssSlave:
        """LSS slave: pending and stored node-ID and bit rate."""
        return self.settings.lss

    @property
    def store(self) -> ObjectStore:
        """Entries, access rules and non-volatile memory."""
        return self._store

    @property
    def sdo(self) -> SdoChannels:
        """SDO servers, with the faults that can be injected into them."""
        return self._sdo

    @property
    def sdo_response_delay_ns(self) -> int:
        """Time between an SDO request and its answer, ns; 0 = at once."""
        return self._sdo.response_delay_ns

    @sdo_response_delay_ns.setter
    def sdo_response_delay_ns(self, delay_ns: int) -> None:
        self._sdo.response_delay_ns = delay_ns

    # -- access of the device

    def get(self, index: int, sub: int = 0) -> ObjectValue:
        """Return the present value; KeyError when the dictionary has no such entry."""
        return self.values[index << 8 | sub]

    def set(self, index: int, sub: int, value: ObjectValue) -> None:
        """Set a value without access checks; event-driven TPDOs that map it are
        sent if their payload changes.
        """
        key = index << 8 | sub
        values = self.values
        if values.get(key) != value:
            values[key] = value
            self.pdos.touch(key)

    def notify_change(self, index: int, sub: int = 0) -> None:
        """Have event-driven TPDOs with this object looked at, after a direct write to `values`."""
        self.pdos.touch(index << 8 | sub)

    def trigger_tpdos(self) -> None:
        """Have all event-driven TPDOs looked at when the present instant ends; changed payloads are sent."""
        self.pdos.touch_all()

    def trigger_tpdo(self, number: int) -> None:
        """Send event-driven TPDO `number` (1 = 1800h) as on a device event, whatever its payload is."""
        for pdo in self.pdos.transmit:
            if pdo.number == number and pdo.valid and self.pdos.cycle.operational:
                pdo.trigger()

    def send_multiplexed(self, number: int, node: int, index: int, sub: int, content: bytes) -> bool:
        """Send up to four bytes to an object of another node with TPDO `number`, which is in DAM (C301-051).

        Args:
            number: 1 = 1800h; its mapping record has FFh objects.
            node: Node-ID of the consumer; 0 = all.
            index: Index of the consumer's object.
            sub: Its sub-index.
            content: Its value, little-endian, at most four bytes.

        Returns:
            Whether it was sent: the PDO is valid, in destination address mode, and the node Operational.

        Raises:
            ConfigurationError: An argument is out of range.

        """
        if not 0 <= node <= 127:
            raise ConfigurationError("node", node, "0..127")
        if not 0 <= index <= 0xFFFF or not 0 <= sub <= 0xFF or len(content) > 4:
            raise ConfigurationError(
                "destination", (index, sub, content), "an object, and at most four bytes"
            )
        return self.pdos.send_multiplexed(number, node, index, sub, content)

    def on_write(self, index: int, sub: int, callback: WriteHook) -> None:
        """Call `callback(value)` before a value written by SDO or PDO is stored.

        A PDO write takes place when it becomes effective. `SdoAbort` from the callback refuses the value: an
        SDO is aborted with its code, a PDO leaves the object as it was. Several callbacks run in order.

        Raises:
            ConfigurationError: The dictionary has no such entry.

        """
        self._chain(self._store.write_hooks, index, sub, callback)
        self.pdos.recompile()

    def on_read(self, index: int, sub: int, callback: ReadHook) -> None:
        """Call `callback() -> value` for SDO reads and when a PDO samples the object.

        `SdoAbort` from the callback aborts an SDO; a PDO sends the last value. One callback per entry.

        Raises:
            ConfigurationError: The dictionary has no such entry.

        """
        self._known(index, sub)
        self._store.read_hooks[index << 8 | sub] = callback
        self.pdos.recompile()

    def emcy(
        self, code: int, register: int | None = None, data: bytes = b"", *, repeat: bool = False
    ) -> bool:
        """Raise an error: 1001h and 1003h take it up, an EMCY is queued (C301-108 to C301-112).

        Args:
            code: EMCY error code, 1..FFFFh.
            register: Bits of 1001h that belong to the error; bit 0 is always added. None = by the code.
            data: Up to five manufacturer-specific bytes.
            repeat: Send again although the error is already present.

        Returns:
            Whether it was new or repeated; a present error is not sent twice.

        """
        return self.errors.raise_error(code, register, data, repeat=repeat)

    def emcy_clear(self, code: int | None = None) -> bool:
        """End the error `code`, or all: EMCY 0000h with what remains of 1001h (C301-109).

        Returns:
            Whether there was anything to end.

        """
        return self.errors.clear(code)

    def _known(self, index: int, sub: int) -> None:
        if index << 8 | sub not in self._store.entries:
            raise ConfigurationError(
                f"{self.name}: callback", f"{index:04X}h:{sub}", "an entry of the dictionary"
            )

    def _chain(self, hooks: dict[int, WriteHook], index: int, sub: int, callback: WriteHook) -> None:
        self._known(index, sub)
        key = index << 8 | sub
        first = hooks.get(key)
        if first is None:
            hooks[key] = callback
            return

        def both(value: ObjectValue) -> None:
            first(value)
            callback(value)

        hooks[key] = both

    # -- power and NMT
    # ----------------------------------------------------------------------------------------

    def power_on(self) -> None:
        """Come to life with stored or default values; the boot-up frame follows after `boot_time_ns`."""
        if self._powered:
            return
        self._port.online = True
        self._powered = True
        self._renumber(self.settings.start(application=True))
        self._restore(application=True)
        self._boot()

    def power_off(self) -> None:
        """Fall silent at once; everything but the non-volatile memory is lost."""
        if not self._powered:
            return
        self._powered = False
        self._silence()
        self._port.online = False
        self._enter(NmtState.INITIALISING)

    def _controller_state(self, old: Enum, new: Enum) -> None:
        if self._powered:
            self._communication.controller_state(old, new)

    def _overrun(self) -> None:
        if self._powered:
            self._communication.overrun()

    def _boot(self) -> None:
        if self.node_id == UNCONFIGURED:
            self._rebuild()  # LSS alone, until it has named the node (C301-163)
        elif self.boot_time_ns:
            self._boot_timer = self.scheduler.after(self.boot_time_ns, self._booted)
        else:
            self._booted()

    def _booted(self) -> None:
        self._boot_timer = None
        self._enter(NmtState.PRE_OPERATIONAL)
        startup = self.values.get(0x1F8000)
        if startup is not None and not startup & 0x04:
            self._enter(NmtState.OPERATIONAL)  # starts by itself (C301-021)

    def _named(self) -> None:
        """Come to life with the node-ID that LSS has given."""
        self._renumber(self.settings.start(application=False))
        self._restore(application=False)
        self._boot()

    def _renumber(self, node_id: int) -> None:
        if node_id == self.node_id:
            return
        self._store.renumber(self.node_id, node_id)
        self.errors.set_node_id(node_id)
        self.error_control.set_node_id(node_id)
        self.pdos.multiplexer.node_id = node_id
        self.node_id = node_id
        self.settings.node_id_changed(node_id)

    def _silence(self) -> None:
        """Stop every timer and forget every transfer."""
        if self._boot_timer is not None:
            self._boot_timer.cancel()
            self._boot_timer = None
        self._sdo.reset()
        self.error_control.stop()
        self.sync.stop()
        self.time.stop()
        self.bus_watch.stop()
        self.lss.stop()
        if self._controller is not None:
            self._controller.flush()  # a controller that restarts does not send what was queued before

    def _restore(self, *, application: bool) -> None:
        self._store.load(application=application)
        self.errors.reset(application=application)
        self.error_control.reset()
        self.pdos.configure()
        self.sync.configure()

    def _reset(self, *, application: bool) -> None:
        left = self._state == NmtState.OPERATIONAL
        self._silence()
        self._enter(NmtState.INITIALISING)
        if left:
            self._communication.announce("nmt")  # only now: a node that is reset sends no EMCY
        self._renumber(self.settings.start(application=application))
        self._restore(application=application)
        for callback in self.on_reset:
            callback(application)
        if self._powered:
            self._boot()

    def _on_nmt(self, frame: CanFrame, _time_ns: int) -> None:
        """Take a node control frame; anything malformed is ignored (C301-016, C301-017)."""
        data = frame.data
        if len(data) != 2 or data[1] not in (0, self.node_id) or self._state == NmtState.INITIALISING:
            return
        command = data[0]
        target = STATE_OF_COMMAND.get(command)
        if target is not None:
            left = self._state == NmtState.OPERATIONAL and target != NmtState.OPERATIONAL
            self._enter(target)
            if left:
                self._communication.announce("nmt")
        elif command in (NmtCommand.RESET_NODE, NmtCommand.RESET_COMMUNICATION):
            self._reset(application=command == NmtCommand.RESET_NODE)

    def _enter(self, state: NmtState) -> None:
        old = self._state
        if state == old:
            return
        self._state = self.time.state = state
        if old == NmtState.OPERATIONAL:
            self.pdos.leave_operational()
        if state not in _EVERYWHERE:
            self._sdo.reset()
        if state != NmtState.INITIALISING:
            self.error_control.enter_state(state)
            self.sync.enter_state(state)
        self._rebuild()
        self.errors.enter_state(state)
        if self._history is not None:
            self._history.emit(self.name, "nmt.state", **{"from": old.name, "to": state.name})
        for callback in self.on_nmt_state:
            callback(old, state)
        if state == NmtState.OPERATIONAL and self._state == state:
            self.pdos.enter_operational()

    # -- configuration
    # ----------------------------------------------------------------------------------------

    def _rebuild(self) -> None:
        """Listen to what the present state and configuration want (C301-015 to C301-020)."""
        data: list[Route] = []
        remote: list[Route] = []
        state = self._state
        if state != NmtState.INITIALISING:
            data.append((COB_NMT, False, self._on_nmt))
            remote.append((COB_ERROR_CONTROL + self.node_id, False, self.error_control.guard))
        if self.lss.enabled and (state != NmtState.INITIALISING or self.node_id == UNCONFIGURED):
            data.append((COB_LSS_MASTER, False, self.lss.receive))
        if state in _EVERYWHERE:
            data += [(*place, self.time.receive) for place in self.time.listening()]
            data += [(can_id, False, handler) for can_id, handler in self._sdo.handlers(self.node_id)]
            data.append((self.sync.can_id, self.sync.extended, self.sync.receive))
            data += [(*place, self.bus_watch.collision) for place in self._own_identifiers()]
        receivers = list(self.pdos.receivers())
        data += [(pdo.can_id, pdo.extended, pdo.handler) for pdo in receivers]
        remote += [(pdo.can_id, pdo.extended, pdo.on_remote_frame) for pdo in self.pdos.requestable()]
        if state != NmtState.INITIALISING:
            data += [
                (can_id, False, self.error_control.heartbeat) for can_id in self.error_control.watched_ids()
            ]
        self._dispatcher.replace(data, remote, [pdo.on_sync_frame for pdo in receivers])

    def _own_identifiers(self) -> list[tuple[int, bool]]:
        """Return what only this node may send with: nobody else's frames should have it (C301-125)."""
        own = [(COB_ERROR_CONTROL + self.node_id, False), *self._sdo.answering(), *self.pdos.transmitted()]
        emcy = self.errors.cob_id
        if not emcy >> 31:
            own.append((emcy & 0x1FFFFFFF, bool(emcy >> 29 & 1)))
        return own

    def _emcy_identifier_changed(self) -> None:
        self.errors.flush()
        self._rebuild()

    def _consumers_changed(self) -> None:
        self.error_control.configure()
        self._rebuild()
