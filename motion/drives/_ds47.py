"""Access to parameters of a drive through the registers of data record 47 (PD-326 to PD-333); nothing waits.

One request at a time: control word, header and request are written, then the answer
is asked for until it is there.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from struct import Struct
from typing import TYPE_CHECKING, Final, NamedTuple

from fieldbus.clock import MS
from fieldbus.modbus.client import Outcome, Result
from fieldbus.modbus.codes import Function
from fieldbus.modbus.pdu import Request
from fieldbus.profidrive import requests
from fieldbus.profidrive.errors import ParameterAccessError

if TYPE_CHECKING:
    from fieldbus.clock import Scheduler

Answer = Callable[[float | None, str], object]
Submit = Callable[[Request, Callable[[Result], object]], None]

_START: Final = 1
_READY: Final = 2
_RECORD: Final = 0x2F00
_ANSWER_REGISTERS: Final = 16
_ASK_AFTER_NS: Final = 25 * MS
_TRIES: Final = 20
_DRIVE_OBJECT: Final = 1
_ERRORS: Final = (
    "",
    "invalid length",
    "not possible in this state",
    "invalid function",
    "answer not ready",
    "internal error",
)


class _Access(NamedTuple):
    number: int
    element: int
    written: requests.Values | None
    """What is written; None: it is read."""
    answer: Answer


class Ds47Client:
    """The queue of accesses.

    Args:
        scheduler: Time.
        submit: Sends a request of Modbus.
        first: Address on the wire of the control word.

    """

    def __init__(self, scheduler: Scheduler, submit: Submit, first: int) -> None:
        self._scheduler = scheduler
        self._submit = submit
        self._first = first
        self._queue: deque[_Access] = deque()
        self._epoch = 0
        self._reference = 0
        self._tries = 0

    def read(self, number: int, index: int, answer: Answer) -> None:
        """Queue the read of element `index` of parameter `number`; `answer` is called later, once."""
        self._append(_Access(number, index, None, answer))

    def write(self, number: int, index: int, values: requests.Values, answer: Answer) -> None:
        """Queue the write of element `index` of parameter `number`; `answer` is called later, once, with the
        value that was written.
        """
        self._append(_Access(number, index, values, answer))

    def _append(self, access: _Access) -> None:
        self._queue.append(access)
        if len(self._queue) == 1:
            self._begin()

    def _begin(self) -> None:
        access = self._queue[0]
        self._tries = 0
        self._reference = self._reference % 0xFF + 1
        address = requests.Address(access.number, access.element, 1)
        service = requests.RequestId.READ if access.written is None else requests.RequestId.WRITE
        values = () if access.written is None else (access.written,)
        data = requests.Request(self._reference, service, _DRIVE_OBJECT, (address,), values).encode()
        words = (_START, _RECORD | len(data), *Struct(f">{len(data) // 2}H").unpack(data))
        self._submit(
            Request(int(Function.WRITE_MULTIPLE_REGISTERS), self._first, len(words), words),
            self._now(self._on_written),
        )

    def _on_written(self, result: Result) -> None:
        if result.outcome is Outcome.DONE:
            self._ask_later()
        else:
            self._end(None, result.text)

    def fail(self, reason: str) -> None:
        """End all accesses: the drive is gone. What still comes belongs to nobody."""
        self._epoch += 1
        waiting = list(self._queue)
        self._queue.clear()
        for access in waiting:
            access.answer(None, reason)

    def _now(self, done: Callable[[Result], object]) -> Callable[[Result], object]:
        """Return `done`, as long as the accesses of now have not been ended."""
        epoch = self._epoch
        return lambda result: done(result) if epoch == self._epoch else None

    def _ask_later(self) -> None:
        epoch = self._epoch
        self._scheduler.after(_ASK_AFTER_NS, lambda: self._ask() if epoch == self._epoch else None)

    def _ask(self) -> None:
        self._tries += 1
        self._submit(
            Request(int(Function.READ_HOLDING_REGISTERS), self._first, _ANSWER_REGISTERS),
            self._now(self._on_answer),
        )

    def _on_answer(self, result: Result) -> None:
        if result.outcome is not Outcome.DONE or result.response is None:
            self._end(None, result.text)
            return
        control, header, *words = result.response.values
        length = header & 0xFF
        if control == _START and self._tries < _TRIES:
            self._ask_later()
        elif control != _READY:
            self._end(None, "data record 47 is not answered")
        elif not length:
            error = words[0] if words else 0
            self._end(None, f"data record 47: {_ERRORS[error] if error < len(_ERRORS) else error}")
        else:
            self._decode(Struct(f">{len(words)}H").pack(*words)[:length])

    def _decode(self, data: bytes) -> None:
        try:
            answer = requests.decode_answer(data)
        except ParameterAccessError as error:
            self._end(None, str(error))
            return
        entry = answer.results[0] if answer.results else None
        written = self._queue[0].written
        if answer.reference != self._reference:
            self._end(None, "the answer belongs to another request")
        elif isinstance(entry, requests.Refusal):
            self._end(None, entry.text)
        elif written is not None:
            self._end(float(written.values[0]), "")
        elif entry is None or not entry.values or isinstance(entry.values[0], bytes):
            self._end(None, "the answer holds no number")
        else:
            self._end(float(entry.values[0]), "")

    def _end(self, value: float | None, reason: str) -> None:
        access = self._queue.popleft()
        if self._queue:
            self._begin()
        access.answer(value, reason)
