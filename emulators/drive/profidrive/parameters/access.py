"""Acyclic access to parameters by requests; knows no bus.

In registers it is data record 47 over Modbus (PD-326 to PD-333), in data records that of PROFIBUS and
PROFINET (PD-199, PD-206, PD-232).

Record 47 (2Fh) on PROFIBUS, B02Eh and B02Fh on PROFINET. One connection has one request at a time.
"""

from __future__ import annotations

import struct
from collections.abc import Callable, Sequence
from enum import IntEnum
from typing import Final, Generic, TypeVar

from emulators.drive.profidrive.parameters.server import ParameterServer
from fieldbus.clock import MS
from fieldbus.profidrive.record_errors import RecordError, RecordRefusedError
from fieldbus.profidrive.requests import LONGEST_RECORD, RequestId

Answer = TypeVar("Answer")
RECORDS: Final = frozenset({0x2F, 0xB02E, 0xB02F})
"""Records of the parameter access point."""
_REQUEST_HEADER: Final = 4
FIRST_REGISTER: Final = 40601
REGISTERS: Final = 122
"""Control word, header, 120 registers of data."""
_HEADER: Final = 1
_DATA: Final = 2
_LONGEST: Final = 2 * (REGISTERS - _DATA)
_RECORD: Final = 0x2F


class ChannelControl(IntEnum):
    """Values of register 40601 (PD-326)."""

    WRITE_ONLY = 0
    START = 1
    """Written: begin. Read: the answer is not ready."""
    READY = 2


class ChannelError(IntEnum):
    """First data word behind a header of length 0 (PD-329 to PD-333)."""

    LENGTH = 1
    STATE = 2
    FUNCTION = 3
    NOT_READY = 4
    INTERNAL = 5


class _DelayedAnswer(Generic[Answer]):
    """The answer to a request, which can be read after the time that the drive takes for it."""

    def __init__(self) -> None:
        self.answer: Answer | None = None
        """The answer, perhaps not yet to be read; None: there is no request."""
        self._ready_ns = 0

    def give(self, answer: Answer, ready_ns: int) -> None:
        """Let an answer be read from a time on."""
        self.answer = answer
        self._ready_ns = ready_ns

    def pending(self, now_ns: int) -> bool:
        """Return whether a request is being carried out."""
        return self.answer is not None and now_ns < self._ready_ns

    def clear(self) -> None:
        """Forget request and answer."""
        self.answer = None


class ParameterChannel:
    """The registers 40601 to 40722 over a parameter server.

    A request is carried out when it is started; its answer can be read `latency_ns` later. It stays until the
    next write.

    Args:
        server: Answers the requests.
        latency_ns: Time to the answer, ns, >= 0.
        available: Whether the drive takes requests at present; otherwise they are answered with error 2.

    """

    first: Final = FIRST_REGISTER
    """Number of the first register."""

    def __init__(
        self,
        server: ParameterServer,
        *,
        latency_ns: int = 20 * MS,
        available: Callable[[], bool] = lambda: True,
    ) -> None:
        self._server = server
        self._available = available
        self.latency_ns = latency_ns
        self.injected = 0
        """`ChannelError` with which every request is answered; 0 = none."""
        self._registers = [0] * REGISTERS
        self._pending: _DelayedAnswer[tuple[int, ...]] = _DelayedAnswer()
        self._filled = _DATA

    def write(self, first: int, values: Sequence[int], now_ns: int) -> bool:
        """Take registers; return False, without any effect, while a request is being carried out.

        Args:
            first: Register, 40601..40722.
            values: Words, 0..65535; all of them within the channel.
            now_ns: Present time, ns.

        Raises:
            IndexError: A register is outside the channel; the caller knows its register map.

        """
        start = self._place(first, len(values))
        if self._pending.pending(now_ns):
            return False
        self._pending.clear()
        self._registers[start : start + len(values)] = [value & 0xFFFF for value in values]
        if start + len(values) > _DATA:
            self._filled = max(self._filled, start + len(values))
        if not start and values:
            control = self._registers[0]
            if control == ChannelControl.START:
                self._start(now_ns)
            elif control != ChannelControl.WRITE_ONLY:
                self._pending.give(_failure(ChannelError.STATE), now_ns)
        return True

    def read(self, first: int, count: int, now_ns: int) -> list[int]:
        """Return registers: the answer, that it is not ready, or what has been written so far.

        Raises:
            IndexError: A register is outside the channel.

        """
        start = self._place(first, count)
        answer = self._pending.answer
        if answer is None:
            shown: Sequence[int] = self._registers
        elif self._pending.pending(now_ns):
            shown = _failure(ChannelError.NOT_READY, ChannelControl.START)
        else:
            shown = answer
        return list(shown[start : start + count])

    def reset(self) -> None:
        """Begin as after power-on."""
        self._registers = [0] * REGISTERS
        self._pending.clear()
        self._filled = _DATA

    def _start(self, now_ns: int) -> None:
        function, length = divmod(self._registers[_HEADER], 256)
        filled = 2 * (self._filled - _DATA)
        self._filled = _DATA
        if function != _RECORD:
            self._pending.give(_failure(ChannelError.FUNCTION), now_ns)
        elif not 0 < length <= min(filled, _LONGEST):
            self._pending.give(_failure(ChannelError.LENGTH), now_ns)
        elif not self._available():
            self._pending.give(_failure(ChannelError.STATE), now_ns)
        elif self.injected:
            self._pending.give(_failure(self.injected), now_ns + self.latency_ns)
        else:
            data = struct.pack(f">{REGISTERS - _DATA}H", *self._registers[_DATA:])[:length]
            answer = self._server.request(data)
            words = struct.unpack(f">{REGISTERS - _DATA}H", answer.ljust(_LONGEST, b"\0"))
            self._pending.give(
                (ChannelControl.READY, _RECORD << 8 | len(answer), *words), now_ns + self.latency_ns
            )

    @staticmethod
    def _place(first: int, count: int) -> int:
        start = first - FIRST_REGISTER
        if start < 0 or count < 0 or start + count > REGISTERS:
            raise IndexError(
                f"{count} registers from {first} are not within "
                f"{FIRST_REGISTER}..{FIRST_REGISTER + REGISTERS - 1}"
            )
        return start


def _failure(error: int, control: int = ChannelControl.READY) -> tuple[int, ...]:
    return (control, _RECORD << 8, error, *(0,) * (REGISTERS - 3))


class ParameterRecord:
    """The records of one connection over a parameter server.

    Args:
        server: Answers the requests.
        latency_ns: Time to the answer, ns, >= 0.
        available: Whether the drive is there at present.

    """

    def __init__(
        self,
        server: ParameterServer,
        *,
        latency_ns: int = 20 * MS,
        available: Callable[[], bool] = lambda: True,
    ) -> None:
        self._server = server
        self._available = available
        self.latency_ns = latency_ns
        self._pending: _DelayedAnswer[bytes] = _DelayedAnswer()

    def write(self, record: int, data: bytes, now_ns: int) -> None:
        """Take a request.

        Raises:
            RecordRefusedError: Module failure, no such record, wrong length, a
                request under way, wrong header.

        """
        self._check(record)
        if not _REQUEST_HEADER <= len(data) <= LONGEST_RECORD:
            raise RecordRefusedError(RecordError.LENGTH)
        if self._pending.pending(now_ns):
            raise RecordRefusedError(RecordError.STATE_CONFLICT)
        if data[1] not in set(RequestId) or not data[0]:
            raise RecordRefusedError(RecordError.RANGE)
        self._pending.give(self._server.request(data), now_ns + self.latency_ns)

    def read(self, record: int, now_ns: int) -> bytes:
        """Return the answer; it is gone then.

        Raises:
            RecordRefusedError: Module failure, no such record, no answer or not yet.

        """
        self._check(record)
        answer = self._pending.answer
        if answer is None or self._pending.pending(now_ns):
            raise RecordRefusedError(RecordError.STATE_CONFLICT)
        self._pending.clear()
        return answer

    def reset(self) -> None:
        """Forget the request: the connection has ended."""
        self._pending.clear()

    def _check(self, record: int) -> None:
        if not self._available():
            raise RecordRefusedError(RecordError.MODULE)
        if record not in RECORDS:
            raise RecordRefusedError(RecordError.INDEX)
