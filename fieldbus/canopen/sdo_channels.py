"""The SDO servers of a slave on their identifiers, with timeouts in the time of
the bench (C301-072, C301-150).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Final

from fieldbus.can.frame import CanFrame
from fieldbus.canopen.abort import AbortCode, SdoAbort
from fieldbus.canopen.dictionary import ObjectValue
from fieldbus.canopen.nmt import COB_SDO_CLIENT, COB_SDO_SERVER, is_restricted
from fieldbus.canopen.sdo_server import SdoServer
from fieldbus.canopen.store import ObjectStore, WriteHook
from fieldbus.clock import Scheduler, Timer

_FIRST_RECORD: Final = 0x1200
_LAST_RECORD: Final = 0x127F
_INITIATE: Final = (1, 2, 5, 6)
"""Client command specifiers that name an object: download, upload, block upload, block download."""
_DOWNLOADS: Final = (1, 6)


class SdoChannels:
    """One server per record 1200h to 127Fh; the first exists always, on the predefined identifiers.

    Args:
        scheduler: Time for the timeouts.
        store: The dictionary behind all channels.
        send: Puts a frame on the bus.
        timeout_ns: Silence of the client that ends a transfer.

    """

    def __init__(
        self, scheduler: Scheduler, store: ObjectStore, send: Callable[[CanFrame], None], *, timeout_ns: int
    ) -> None:
        self.scheduler = scheduler
        self._store = store
        self._send = send
        self.timeout_ns = timeout_ns
        self.response_delay_ns = 0
        """Time between request and answer, ns; a fault to inject."""
        self.silent = False
        """Requests are not answered: a fault to inject."""
        self.refusal: tuple[int, int] | None = None
        """(index, abort code) with which every access to the index (0 = any) is refused: a fault to inject.
        """
        self.refused_writes: Mapping[int, int] = {}
        """Entries that take no value whatever the dictionary says, by key, with abort codes.
        """
        records = sorted({key >> 8 for key in store.entries if _FIRST_RECORD < key >> 8 <= _LAST_RECORD})
        self._channels = {record: _Channel(self, SdoServer(store)) for record in (_FIRST_RECORD, *records)}

    def handlers(self, node_id: int) -> list[tuple[int, Callable[[CanFrame, int], None]]]:
        """Return the identifiers to listen to, with their handlers."""
        values = self._store.values
        result: list[tuple[int, Callable[[CanFrame, int], None]]] = []
        for record, channel in self._channels.items():
            if record == _FIRST_RECORD:
                request, channel.answer_id = COB_SDO_CLIENT + node_id, COB_SDO_SERVER + node_id
            else:
                request = values.get(record << 8 | 1, 1 << 31)
                answer = values.get(record << 8 | 2, 1 << 31)
                if not request & 0x7FF or not answer & 0x7FF or request >> 31 or answer >> 31:
                    channel.answer_id = 0
                    continue
                request, channel.answer_id = request & 0x7FF, answer & 0x7FF
            result.append((request, channel.receive))
        return result

    def answering(self) -> list[tuple[int, bool]]:
        """Return the identifiers of the answers, as `handlers` has found them, and that they have 11 bits."""
        return [(channel.answer_id, False) for channel in self._channels.values() if channel.answer_id]

    def guard(self, key: int) -> WriteHook:
        """Return the check of a COB-ID of a record (C301-012, C301-101)."""
        values = self._store.values

        def check(value: ObjectValue) -> None:
            can_id = value & 0x1FFFFFFF
            if value >> 29 & 1 or (can_id and (can_id > 0x7FF or is_restricted(can_id))):
                raise SdoAbort(AbortCode.VALUE)  # with 11 bits only
            if value >> 31:
                return
            old = values[key]
            if not old >> 31 and (old ^ value) & 0x7FF:
                raise SdoAbort(AbortCode.DEVICE_STATE)
            for record in self._channels:
                for sub in (1, 2):
                    other = record << 8 | sub
                    if other != key and can_id and values.get(other, 1 << 31) & 0x800007FF == can_id:
                        raise SdoAbort(AbortCode.NO_RESOURCE)  # that connection is taken

        return check

    def reset(self) -> None:
        """Drop all transfers silently."""
        for channel in self._channels.values():
            channel.reset()

    def refused(self, request: bytes) -> bytes | None:
        """Return the abort with which a request that begins a transfer is to be refused; None: serve it."""
        command, index = request[0] >> 5, int.from_bytes(request[1:3], "little")
        if command not in _INITIATE:
            return None
        code = None
        if self.refusal is not None and self.refusal[0] in (0, index):
            code = self.refusal[1]
        elif command in _DOWNLOADS:
            code = self.refused_writes.get(index << 8 | request[3])
        if code is None:
            return None
        return b"\x80" + request[1:4] + code.to_bytes(4, "little")

    def send(self, can_id: int, data: bytes) -> None:
        """Put an answer on the bus."""
        self._send(CanFrame(can_id, data))


class _Channel:
    """A server with its identifiers and its timer, which is entered once per timeout, not once per frame."""

    def __init__(self, owner: SdoChannels, server: SdoServer) -> None:
        self._owner = owner
        self._server = server
        self._timer: Timer | None = None
        self._delayed: list[Timer] = []
        self._last_ns = 0
        self.answer_id = 0

    def receive(self, frame: CanFrame, time_ns: int) -> None:
        """Take a request; frames of another length than eight bytes are ignored (C301-075)."""
        data = frame.data
        if len(data) != 8:
            return
        owner = self._owner
        if owner.silent:
            return
        refused = owner.refused(data) if owner.refusal is not None or owner.refused_writes else None
        answers = self._server.request(data) if refused is None else [refused]
        if answers:
            if owner.response_delay_ns:
                self._delayed = [timer for timer in self._delayed if timer.due_ns > owner.scheduler.now]
                self._delayed.append(
                    owner.scheduler.after(owner.response_delay_ns, lambda: self._answer(answers))
                )
            else:
                self._answer(answers)
        if self._server.active:
            self._last_ns = time_ns
            if self._timer is None:
                self._arm()

    def _answer(self, answers: list[bytes]) -> None:
        owner = self._owner
        can_id = self.answer_id
        for answer in answers:
            owner.send(can_id, answer)

    def reset(self) -> None:
        """Drop the transfer and answers that are under way."""
        self._server.reset()
        for timer in self._delayed:
            timer.cancel()
        self._delayed.clear()
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None

    def _arm(self) -> None:
        owner = self._owner
        due = max(self._last_ns + owner.timeout_ns, owner.scheduler.now)
        self._timer = owner.scheduler.at(due, self._due)

    def _due(self) -> None:
        self._timer = None
        if not self._server.active:
            return
        if self._owner.scheduler.now - self._last_ns < self._owner.timeout_ns:
            self._arm()
        else:
            self._owner.send(self.answer_id, self._server.expire())
