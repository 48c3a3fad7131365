"""Emergency producer: active errors, error register 1001h, history 1003h (CiA 301; C301-108 to C301-112)."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Mapping
from typing import Final

from fieldbus.can.frame import CanFrame
from fieldbus.canopen.abort import AbortCode, SdoAbort
from fieldbus.canopen.dictionary import ObjectValue
from fieldbus.canopen.nmt import COB_EMCY, NmtState, is_restricted
from fieldbus.canopen.store import ObjectStore
from fieldbus.clock import Scheduler, Timer
from fieldbus.history import History

_ERROR_REGISTER: Final = 0x100100
_FIELD: Final = 0x100300
_COB_ID: Final = 0x101400
_INHIBIT: Final = 0x101500

QUEUE_LIMIT: Final = 64
"""EMCYs that wait at most; further ones are lost and counted."""


def register_bits(code: int) -> int:
    """Return the bits of 1001h that an error code sets (C301-112, C402-308)."""
    group = code >> 8
    if code == 0:
        return 0
    if 0x20 <= group <= 0x2F:
        return 0x03
    if 0x30 <= group <= 0x3F:
        return 0x05
    if 0x40 <= group <= 0x4F:
        return 0x09
    if group in (0x81, 0x82):
        return 0x11
    if 0x70 <= group <= 0x7F or 0x83 <= group <= 0x8A:
        return 0x21
    return 0x81 if group == 0xFF else 0x01


class EmcyProducer:
    """Knows the active errors, keeps register and history, and sends.

    Args:
        scheduler: Time for the inhibit time.
        store: Holds 1001h, 1003h, 1014h, 1015h.
        send: Puts a frame on the bus.
        node_id: For the default identifier.
        set_value: Device-side `set` of the slave, so that a TPDO with 1001h notices.
        source: Name in the history.
        history: Log; None for none.

    """

    def __init__(
        self,
        scheduler: Scheduler,
        store: ObjectStore,
        send: Callable[[CanFrame], None],
        *,
        node_id: int,
        set_value: Callable[[int, int, ObjectValue], None],
        source: str,
        history: History | None,
    ) -> None:
        self._scheduler = scheduler
        self._store = store
        self._send = send
        self._node_id = node_id
        self._set_value = set_value
        self._source = source
        self._history = history
        self._state = NmtState.INITIALISING
        self._queue: deque[bytes] = deque()
        self._not_before_ns = 0
        self._timer: Timer | None = None
        self.active: dict[int, int] = {}
        """Present errors: code -> bits of 1001h, oldest first."""
        self.replacements: Mapping[int, tuple[int, int | None, bytes]] = {}
        """Error code -> code, bits of 1001h (None = by the code) and data that this device sends instead."""
        self.lost = 0
        """EMCYs that found the queue full."""
        self._capacity = max((key & 0xFF for key in store.entries if key >> 8 == 0x1003), default=0)
        store.commands[_FIELD] = self._clear_history
        store.guards[_COB_ID] = self._check_cob_id
        for sub in range(1, self._capacity + 1):
            store.read_hooks[_FIELD | sub] = self._reader(sub)

    def set_node_id(self, node_id: int) -> None:
        """Speak as another node; matters only without a 1014h that says more."""
        if _COB_ID not in self._store.entries:
            self._store.values[_COB_ID] = COB_EMCY + node_id
        self._node_id = node_id

    @property
    def cob_id(self) -> int:
        """Present 1014h; bit 31 = no EMCY is sent."""
        return int(self._store.values[_COB_ID])

    @property
    def register(self) -> int:
        """Present error register 1001h."""
        register = 0
        for bits in self.active.values():
            register |= bits
        return register

    def raise_error(self, code: int, register: int | None, data: bytes, *, repeat: bool) -> bool:
        """Note an error and queue its EMCY; see `CanopenSlave.emcy`."""
        if code in self.active and not repeat:
            return False
        known = code
        if self.replacements and code in self.replacements:
            code, register, data = self.replacements[code]
        bits = (register_bits(code) if register is None else register & 0xBF) | 0x01
        self.active[known] = bits
        data = bytes(data[:5]).ljust(5, b"\0")
        self._update_register()
        self._remember(code | int.from_bytes(data[:2], "little") << 16)
        if self._history is not None:
            self._history.emit(
                self._source, "emcy.raised", code=code, register=self.register, data=data.hex()
            )
        self._queue_frame(code, data)
        return True

    def clear(self, code: int | None) -> bool:
        """End an error, or all; queue 0000h with what remains of the register (C301-109)."""
        if code is None:
            if not self.active:
                return False
            self.active.clear()
        elif self.active.pop(code, None) is None:
            return False
        self._update_register()
        if self._history is not None:
            self._history.emit(self._source, "emcy.cleared", code=code or 0, register=self.register)
        self._queue_frame(0, bytes(5))
        return True

    def reset(self, *, application: bool) -> None:
        """Forget what reset ends: communication errors, with `application` all; then set the objects."""
        self._queue.clear()
        self._not_before_ns = 0
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None
        if application:
            self.active.clear()
        else:
            self.active = {code: bits for code, bits in self.active.items() if code >> 8 not in (0x81, 0x82)}
        values = self._store.values
        for sub in range(self._capacity + 1):
            values[_FIELD | sub] = 0
        values[_ERROR_REGISTER] = self.register
        values.setdefault(_COB_ID, COB_EMCY + self._node_id)

    def enter_state(self, state: NmtState) -> None:
        """Follow the NMT state: EMCYs wait while it does not allow them (C301-108)."""
        self._state = state
        self.flush()

    # -- sending
    # ----------------------------------------------------------------------------------------------

    def _queue_frame(self, code: int, data: bytes) -> None:
        if self._store.values[_COB_ID] >> 31:
            return
        if len(self._queue) >= QUEUE_LIMIT:
            self.lost += 1
            return
        self._queue.append(code.to_bytes(2, "little") + bytes((self.register,)) + data)
        self.flush()

    def flush(self) -> None:
        """Send what waits, as far as state, 1014h and inhibit time allow."""
        if self._state not in (NmtState.PRE_OPERATIONAL, NmtState.OPERATIONAL):
            return
        now = self._scheduler.now
        queue = self._queue
        cob_id = self._store.values[_COB_ID]
        if cob_id >> 31:
            queue.clear()
            return
        inhibit_ns = self._store.values.get(_INHIBIT, 0) * 100_000
        while queue:
            if now < self._not_before_ns:
                if self._timer is None:
                    self._timer = self._scheduler.at(self._not_before_ns, self._inhibit_over)
                return
            self._send(CanFrame(cob_id & 0x1FFFFFFF, queue.popleft(), extended=bool(cob_id & 1 << 29)))
            if inhibit_ns:
                self._not_before_ns = now + inhibit_ns

    def _inhibit_over(self) -> None:
        self._timer = None
        self.flush()

    # -- objects
    # ----------------------------------------------------------------------------------------------

    def _update_register(self) -> None:
        self._set_value(0x1001, 0, self.register)

    def _remember(self, entry: int) -> None:
        values = self._store.values
        if not self._capacity:
            return
        for sub in range(self._capacity, 1, -1):
            values[_FIELD | sub] = values[_FIELD | sub - 1]
        values[_FIELD | 1] = entry
        values[_FIELD] = min(values[_FIELD] + 1, self._capacity)

    def _reader(self, sub: int) -> Callable[[], int]:
        def read() -> int:
            if sub > self._store.values[_FIELD]:
                raise SdoAbort(AbortCode.NO_DATA)
            return int(self._store.values[_FIELD | sub])

        return read

    def _clear_history(self, value: ObjectValue) -> None:
        if value != 0:
            raise SdoAbort(AbortCode.VALUE)
        for sub in range(self._capacity + 1):
            self._store.values[_FIELD | sub] = 0

    def _check_cob_id(self, value: ObjectValue) -> None:
        old = self._store.values[_COB_ID]
        if not value >> 31 and not value & 1 << 29 and is_restricted(value & 0x7FF):
            raise SdoAbort(AbortCode.VALUE)
        if not old >> 31 and not value >> 31 and (old ^ value) & 0x3FFFFFFF:
            raise SdoAbort(AbortCode.DEVICE_STATE)
