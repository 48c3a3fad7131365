"""Acyclic parameter access in data records: write a request, read its answer (PD-199, PD-206, PD-232). Knows
no bus.

Record 47 (2Fh) on PROFIBUS, B02Eh and B02Fh on PROFINET. One connection has one request at a time.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Final

from emulators.drive.profidrive.parameters.server import ParameterServer
from fieldbus.clock import MS
from fieldbus.profidrive.record_errors import RecordError, RecordRefusedError
from fieldbus.profidrive.requests import LONGEST_RECORD, RequestId

RECORDS: Final = frozenset({0x2F, 0xB02E, 0xB02F})
"""Records of the parameter access point."""
_HEADER: Final = 4


class ParameterRecord:
    """The records of one connection over a parameter server.

    Args:
        server: Answers the requests.
        latency_ns: Time to the answer, ns, >= 0.
        available: Whether the drive is there at present.

    """

    __slots__ = ("_answer", "_available", "_ready_ns", "_server", "latency_ns")

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
        self._answer: bytes | None = None
        self._ready_ns = 0

    def write(self, record: int, data: bytes, now_ns: int) -> None:
        """Take a request.

        Raises:
            RecordRefusedError: Module failure, no such record, wrong length, a request under way, wrong
                header.

        """
        self._check(record)
        if not _HEADER <= len(data) <= LONGEST_RECORD:
            raise RecordRefusedError(RecordError.LENGTH)
        if self._answer is not None and now_ns < self._ready_ns:
            raise RecordRefusedError(RecordError.STATE_CONFLICT)
        if data[1] not in set(RequestId) or not data[0]:
            raise RecordRefusedError(RecordError.RANGE)
        self._answer = self._server.request(data)
        self._ready_ns = now_ns + self.latency_ns

    def read(self, record: int, now_ns: int) -> bytes:
        """Return the answer; it is gone then.

        Raises:
            RecordRefusedError: Module failure, no such record, no answer or not yet.

        """
        self._check(record)
        answer = self._answer
        if answer is None or now_ns < self._ready_ns:
            raise RecordRefusedError(RecordError.STATE_CONFLICT)
        self._answer = None
        return answer

    def reset(self) -> None:
        """Forget the request: the connection has ended."""
        self._answer = None

    def _check(self, record: int) -> None:
        if not self._available():
            raise RecordRefusedError(RecordError.MODULE)
        if record not in RECORDS:
            raise RecordRefusedError(RecordError.INDEX)
