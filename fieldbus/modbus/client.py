"""Requests of a client on their way: the queue, and how each of them ends. Nothing waits."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from enum import Enum
from typing import Final, NamedTuple

from fieldbus.clock import Scheduler
from fieldbus.errors import ConfigurationError
from fieldbus.modbus.errors import ModbusError, ResponseError
from fieldbus.modbus.pdu import Request, Response, decode_response

_LONGEST_QUEUE: Final = 256


class Outcome(Enum):
    """How a request ended."""

    DONE = "done"
    EXCEPTION = "exception"
    TIMEOUT = "timeout"
    INVALID = "invalid"
    """What came was no response to the request."""
    LOST = "lost"
    """There was no connection, or it ended."""


class Result(NamedTuple):
    """The end of a request."""

    outcome: Outcome
    response: Response | None
    """With `DONE` and `EXCEPTION`."""
    tries: int
    """How often the request was sent."""
    reason: str = ""
    """Why there is no response, in words; empty with one."""

    @property
    def text(self) -> str:
        """The end in words; made when it is asked for, because hardly anybody asks."""
        return self.reason if self.response is None else str(self.response)


Done = Callable[[Result], object]


class Job:
    """A request on its way."""

    __slots__ = ("done", "frame_pdu", "problem", "request", "response_pdu", "result", "tries", "unit")

    def __init__(self, request: Request, unit: int, done: Done | None) -> None:
        self.request = request
        self.unit = unit
        self.done = done
        self.frame_pdu = request.encode()
        self.tries = 0
        self.problem = ""
        self.result: Result | None = None
        """None until it has ended."""
        self.response_pdu = b""
        """The response as it came; empty without one."""

    def _end(self, outcome: Outcome, response: Response | None, reason: str = "") -> None:
        self.result = Result(outcome, response, self.tries, reason)
        if self.done is not None:
            self.done(self.result)

    def decode(self, unit: int, pdu: bytes) -> Response:
        """Return the response to this request.

        Raises:
            ResponseError: It is none.

        """
        if unit != self.unit:
            raise ResponseError(f"a response of unit {unit}")
        response = decode_response(self.request, pdu)
        self.response_pdu = pdu
        return response

    def finish(self, response: Response) -> None:
        """End with a response."""
        outcome = Outcome.EXCEPTION if response.exception else Outcome.DONE
        self._end(outcome, response)

    def fail(self, outcome: Outcome, text: str) -> None:
        """End without one."""
        self._end(outcome, None, f"{self.request}: {text}")


class QueuedClient:
    """What the clients of both links share: the queue and its limits."""

    def __init__(self, scheduler: Scheduler, timeout_ns: int, retries: int) -> None:
        if timeout_ns <= 0:
            raise ConfigurationError("client, timeout_ns", timeout_ns, "more than 0")
        if retries < 0:
            raise ConfigurationError("client, retries", retries, "0 or more")
        self._scheduler = scheduler
        self.timeout_ns = timeout_ns
        self.retries = retries
        self._queue: deque[Job] = deque()
        self.late = 0
        """Responses that came too late or unsolicited, and were discarded (MODB-041)."""
        self.timeouts = 0

    def submit(self, request: Request, unit: int = 1, done: Done | None = None) -> Job:
        """Put a request into the queue and return its job.

        Args:
            request: What to ask.
            unit: 0..255; on a serial line 0 is a broadcast, which only functions 05, 06, 15, 16 may be.
            done: Called with the result.

        Raises:
            ModbusError: The request cannot be encoded, or the queue is full.

        """
        if not 0 <= unit <= 255:
            raise ModbusError(f"unit {unit} is outside 0..255")
        if len(self._queue) >= _LONGEST_QUEUE:
            raise ModbusError(f"{_LONGEST_QUEUE} requests are waiting already")
        job = Job(request, unit, done)
        self._queue.append(job)
        self._scheduler.catch_up()  # a hook of the line may look at anything
        self._go_on()
        return job

    def _go_on(self) -> None:
        raise NotImplementedError

    @property
    def waiting(self) -> int:
        """Requests in the queue."""
        return len(self._queue)
