"""The master of a serial line: one request at a time, time-outs, retries. A state machine; nothing waits."""

from __future__ import annotations

from fieldbus.clock import MS, Scheduler, Timer
from fieldbus.modbus.client import Done, Job, Outcome, QueuedClient
from fieldbus.modbus.codes import BROADCAST, WRITING
from fieldbus.modbus.errors import ModbusError, ResponseError
from fieldbus.modbus.framing import rtu_frame, unwrap_rtu
from fieldbus.modbus.pdu import Request, Response
from fieldbus.modbus.serial_line import FrameAssembler, SerialFormat, SerialLine, SerialPort
from fieldbus.modbus.serial_port import LiveSerialLine, LiveSerialPort


class RtuClient(QueuedClient):
    """The master of a serial line.

    Args:
        scheduler: Time.
        line: Where it hangs.
        name: On the line.
        format_: Rate and parity, where they are not those of the line.
        timeout_ns: From the end of a request to the begin of its response, ns (MODB-009).
        turnaround_ns: Pause after a broadcast, ns (MODB-009).
        retries: How often a request is sent again after a time-out or a damaged response.

    """

    def __init__(
        self,
        scheduler: Scheduler,
        line: SerialLine | LiveSerialLine,
        *,
        name: str = "master",
        format_: SerialFormat | None = None,
        timeout_ns: int = 500 * MS,
        turnaround_ns: int = 100 * MS,
        retries: int = 1,
    ) -> None:
        super().__init__(scheduler, timeout_ns, retries)
        rate = format_ if format_ is not None else line.format
        self._t35_ns = max(rate.t35_ns, line.pause_ns)
        self._turnaround_ns = turnaround_ns
        # A master takes what comes: how long a device pauses within its response is the device's affair.
        self._assembler = FrameAssembler(scheduler, rate.t15_ns, self._t35_ns, self._frame, lenient=True)
        self.port: SerialPort | LiveSerialPort = line.attach(name, self._assembler, format_)
        self._job: Job | None = None
        self._timer: Timer | None = None
        self._expired = False
        self._start: Timer | None = None
        self._free_ns = 0

    def _go_on(self) -> None:
        if self._job is not None or not self._queue or self._start is not None or self._assembler.busy:
            return
        at = max(self._scheduler.now, self._free_ns)
        self._start = self._scheduler.at(at, self._send_next)

    def _send_next(self) -> None:
        self._start = None
        if self._assembler.busy:
            return  # somebody talks; the end of that frame resumes this
        self._job = job = self._queue.popleft()
        job.tries += 1
        end_ns = self.port.send(rtu_frame(job.unit, job.frame_pdu))
        self._free_ns = end_ns + self._t35_ns
        self._expired = False
        if job.unit == BROADCAST:
            self._free_ns = max(self._free_ns, end_ns + self._turnaround_ns)
            self._timer = self._scheduler.at(self._free_ns, self._turned_around)
        else:
            self._timer = self._scheduler.at(end_ns + self.timeout_ns, self._timed_out)

    def submit(self, request: Request, unit: int = 1, done: Done | None = None) -> Job:
        """Queue a request, as `QueuedClient.submit`; a broadcast has to be one that writes.

        Raises:
            ModbusError: The request cannot be encoded, is a broadcast that reads, or the queue is full.

        """
        if unit == BROADCAST and request.function not in WRITING:
            raise ModbusError(f"{request}: no broadcast; allowed: functions 05, 06, 15, 16")
        return super().submit(request, unit, done)

    def _turned_around(self) -> None:
        job, self._job = self._job, None
        if job is not None:
            job.finish(Response(job.request.function))
        self._go_on()

    def _timed_out(self) -> None:
        if self._assembler.busy:  # it has begun: its end decides
            self._expired = True
            return
        self.timeouts += 1
        self._retry(Outcome.TIMEOUT, "no response")

    def _retry(self, outcome: Outcome, text: str) -> None:
        job, self._job = self._job, None
        if self._timer is not None:
            self._timer.cancel()
        if job is not None:
            if job.tries <= self.retries:
                self._queue.appendleft(job)
            elif job.problem:
                job.fail(Outcome.INVALID, job.problem)
            else:
                job.fail(outcome, text)
        self._go_on()

    def _frame(self, frame: bytes, damaged: bool) -> None:
        job = self._job
        if job is None or job.unit == BROADCAST:
            self.late += 1
            self._go_on()
            return
        content = None if damaged else unwrap_rtu(frame)
        if content is None:
            job.problem = f"a damaged response: {frame.hex(' ')}"
            self._retry(Outcome.INVALID, job.problem)
            return
        try:
            response = job.decode(*content)
        except ResponseError as error:
            # The late response to an earlier request, most likely; the right one may still come.
            self.late += 1
            job.problem = str(error)
            if self._expired:
                self._retry(Outcome.INVALID, job.problem)
            return
        self._job = None
        if self._timer is not None:
            self._timer.cancel()
        job.finish(response)
        self._go_on()
