"""The controller's SDO client on the bus: a queue per node, time-outs, retries; nothing waits (CiA 301
section A6).

One client serves one node and has at most one transfer under way, because a server has one channel; clients
of several nodes work at the same time. A transfer is a `SdoJob`: ask it, or be called when it has ended.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from typing import Final

from fieldbus.canopen.abort import ABORT_TEXTS, AbortCode
from fieldbus.canopen.connection import BusConnection
from fieldbus.canopen.nmt import COB_SDO_CLIENT, COB_SDO_SERVER
from fieldbus.canopen.sdo_transfer import SdoDownload, SdoTransfer, SdoUpload
from fieldbus.clock import MS, S, Scheduler, Timer
from fieldbus.errors import ConfigurationError

TIMEOUT_NS: Final = 300 * MS
"""How long a server may take for an answer, ns."""
ATTEMPTS: Final = 2
"""How often a transfer is begun before silence counts as its end."""
BLOCK_FROM_BYTES: Final = 64
"""Downloads of this size and more use the block protocol where the server knows it."""

_BURST: Final = 4
"""Segments of a block that are handed to the bus at once; a real transmit queue is short."""
_BURST_NS: Final = 1 * MS

_FRAME_BITS: Final = 135
"""Longest frame of a PDO or SDO with all its stuff bits, and the gap after it."""
_IN_A_ROW: Final = 16
"""Requests, of all clients together, between two pauses."""

JobCallback = Callable[["SdoJob"], object]


class SdoPacing:
    """Delays the SDO requests of a controller so that SYNC and error control stay in time.

    * A request whose answer may still be on the bus when SYNC is due waits for it: SYNC would come late
      by up to a frame, and every drive would sample late. A cycle that is too short for it is not spared.
    * After some requests there is a pause. Frames of error control have less priority than SDOs, and
      would not get through between clients and servers that answer each other without delay.

    Both hold for all clients of the controller together.

    Args:
        scheduler: Time.
        bitrate: Bit rate of the segment, bit/s; None = not known: most run at the highest.

    """

    def __init__(self, scheduler: Scheduler, bitrate: int | None) -> None:
        self.sync: Timer | None = None
        """When SYNC is due; None = it is not sent."""
        self._scheduler = scheduler
        self._frame_ns = _FRAME_BITS * S // (bitrate or 1_000_000)
        self._busy: set[int] = set()
        self._count = 0
        self._pause_ns = 0

    def set_busy(self, node: int, busy: bool) -> None:
        """Note whether the client of `node` has a transfer under way."""
        if busy:
            self._busy.add(node)
        else:
            self._busy.discard(node)

    def delay_ns(self, requests: int = 1) -> int:
        """Return how long requests have to wait, ns; 0 = not at all: they then count as sent.

        Args:
            requests: Frames that are to be sent at once; one answer is expected.

        """
        now = self._scheduler.now
        if now < self._pause_ns:
            return self._pause_ns - now
        clients = max(1, len(self._busy))
        need_ns = self._frame_ns * (requests + 1) * clients
        sync = self.sync
        if sync is not None:
            left_ns = sync.due_ns - now
            if 0 < left_ns < need_ns < sync.period_ns:
                return left_ns
        self._count += 1
        if self._count <= _IN_A_ROW:
            return 0
        self._count = 0
        # The exchanges of the other clients end; then a moment is enough for a frame that has been waiting.
        pause_ns = 2 * self._frame_ns * (clients - 1) + self._frame_ns // 8
        self._pause_ns = now + pause_ns
        return pause_ns


class SdoJob:
    """One transfer, waiting, under way or ended.

    Attributes that end in `ed` or say what came of it are valid once `done()` is true.
    """

    def __init__(
        self,
        node: int,
        transfer: SdoTransfer,
        callback: JobCallback | None,
        withdraw: Callable[[SdoJob], None],
    ) -> None:
        self._callback = callback
        self._withdraw = withdraw
        self.node = node
        """Node-ID of the server."""
        self._done = False
        self.transfer = transfer
        self.attempts = 0
        """How often it has been begun."""

    def done(self) -> bool:
        """Return whether the transfer has ended, well or not."""
        return self._done

    @property
    def ok(self) -> bool:
        """Whether it has ended well."""
        return self._done and not self.transfer.abort_code

    @property
    def data(self) -> bytes:
        """What was read or written."""
        transfer = self.transfer
        assert isinstance(transfer, SdoUpload | SdoDownload)
        return transfer.data

    @property
    def value(self) -> int:
        """What was read or written, as an unsigned number."""
        return int.from_bytes(self.data, "little")

    @property
    def abort_code(self) -> int:
        """Why it failed: the server's code, or 05040000h for a server that does
        not answer; 0 = it did not fail.
        """
        return self.transfer.abort_code

    @property
    def timed_out(self) -> bool:
        """Whether the server was silent."""
        return self._done and self.attempts > 0 and self.transfer.abort_code == AbortCode.TIMEOUT

    @property
    def reason(self) -> str:
        """Why it failed, in words; empty when it did not."""
        code = self.transfer.abort_code
        return f"{code:08X}h {ABORT_TEXTS.get(code, 'unknown abort code')}" if code else ""

    def cancel(self) -> None:
        """Give the transfer up; the callback is not called any more. Harmless when it has ended."""
        self._callback = None
        if not self._done:
            self._withdraw(self)

    def finish(self) -> None:
        """End it; called by the client."""
        self._done = True
        callback = self._callback
        if callback is not None:
            callback(self)

    def __repr__(self) -> str:
        state = "waiting" if not self.attempts else "ended" if self._done else "under way"
        what = "read" if isinstance(self.transfer, SdoUpload) else "write"
        where = f"{self.transfer.index:04X}h:{self.transfer.sub}"
        return f"<SdoJob {what} {where} at node {self.node}: {state} {self.reason}>"


class SdoClient:
    """The client of one node's default SDO server; made by `CanopenMaster.sdo`.

    Args:
        node: Node-ID of the server, 1..127.
        scheduler: Time.
        connection: Connection of the controller to the segment.
        pacing: Delays the requests of all clients.
        name: Name of the controller, for messages.

    Raises:
        ConfigurationError: `node` is out of range.

    """

    def __init__(
        self,
        node: int,
        *,
        scheduler: Scheduler,
        connection: BusConnection,
        pacing: SdoPacing,
        name: str,
    ) -> None:
        if not 1 <= node <= 127:
            raise ConfigurationError(f"{name}: SDO client node", node, "1..127")
        self.node = node
        self.timeout_ns = TIMEOUT_NS
        """How long the server may take for an answer, ns."""
        self.attempts = ATTEMPTS
        """How often a transfer is begun before silence counts as its end; 1 or more."""
        self.strays = 0
        """Answers that belonged to no transfer: those of another client, or late ones."""
        self._scheduler = scheduler
        self._connection = connection
        self._pacing = pacing
        self._request_id = COB_SDO_CLIENT + node
        self._jobs: deque[SdoJob] = deque()
        self._waiting: deque[bytes] = deque()  # requests that have not gone out yet
        self._pending: Timer | None = None  # when they will
        self._timer: Timer | None = None
        self._deadline = 0
        self._no_block = False
        connection.subscribe(COB_SDO_SERVER + node, self._receive)

    @property
    def busy(self) -> bool:
        """Whether a transfer is under way or waiting."""
        return bool(self._jobs)

    def upload(
        self, index: int, sub: int = 0, on_done: JobCallback | None = None, *, block: bool = False
    ) -> SdoJob:
        """Queue a read; returns at once.

        Args:
            index: Object index.
            sub: Sub-index.
            on_done: Called with the job when it has ended, well or not.
            block: Ask for the block protocol; of use for long contents.

        Raises:
            ConfigurationError: Index or sub-index is out of range.

        """
        return self._queue(self._job(SdoUpload(index, sub, block=block and not self._no_block), on_done))

    def download(
        self,
        index: int,
        sub: int,
        data: bytes,
        on_done: JobCallback | None = None,
        *,
        block: bool | None = None,
    ) -> SdoJob:
        """Queue a write of `data`; returns at once.

        Args:
            index: Object index.
            sub: Sub-index.
            data: The bytes, as long as the object is.
            on_done: Called with the job when it has ended, well or not.
            block: Use the block protocol; None = from `BLOCK_FROM_BYTES` on.

        Raises:
            ConfigurationError: Index or sub-index is out of range, or `data` is not bytes.

        """
        if not isinstance(data, (bytes, bytearray, memoryview)):
            raise ConfigurationError(
                f"SDO data for {index:04X}h:{sub}", data, "bytes, little-endian, as long as the object is"
            )
        wanted = len(data) >= BLOCK_FROM_BYTES if block is None else block
        return self._queue(
            self._job(SdoDownload(index, sub, data, block=wanted and not self._no_block), on_done)
        )

    def cancel(self) -> None:
        """Cancel all transfers without a call of `on_done`: the node is gone, or has restarted."""
        for job in tuple(self._jobs):
            job.cancel()

    def _job(self, transfer: SdoTransfer, on_done: JobCallback | None) -> SdoJob:
        return SdoJob(self.node, transfer, on_done, self._withdraw)

    def _withdraw(self, job: SdoJob) -> None:
        """Remove a job; one that is under way is aborted."""
        if job not in self._jobs:
            return
        under_way = job is self._jobs[0]
        self._jobs.remove(job)
        abort = job.transfer.cancel()
        job.finish()
        if under_way:
            unsent = bool(self._waiting)
            self._waiting.clear()
            if not unsent:
                self._connection.send(self._request_id, abort)
            self._next()

    # -- course
    # -----------------------------------------------------------------------------------------------

    def _queue(self, job: SdoJob) -> SdoJob:
        self._jobs.append(job)
        if len(self._jobs) == 1:
            self._next()
        return job

    def _next(self) -> None:
        """Begin the first job of the queue, if there is one."""
        jobs = self._jobs
        self._pacing.set_busy(self.node, bool(jobs))
        if jobs:
            job = jobs[0]
            job.attempts += 1
            self._send(job.transfer.start())

    def _send(self, requests: list[bytes]) -> None:
        self._deadline = self._scheduler.now + self.timeout_ns
        if self._timer is None:
            self._timer = self._scheduler.at(self._deadline, self._due)
        if len(requests) == 1 and not self._waiting:
            delay = self._pacing.delay_ns()
            if not delay:
                self._connection.send(self._request_id, requests[0])
                return
        self._waiting.extend(requests)
        self._hand_over()

    def _hand_over(self) -> None:
        """Send what waits: not into the time of a SYNC, and long blocks in bursts."""
        waiting = self._waiting
        if self._pending is not None or not waiting:
            return
        burst = min(_BURST, len(waiting))
        delay = self._pacing.delay_ns(burst)
        if not delay:
            for _ in range(burst):
                self._connection.send(self._request_id, waiting.popleft())
            self._deadline = self._scheduler.now + self.timeout_ns
            delay = _BURST_NS
        if waiting:
            self._pending = self._scheduler.after(delay, self._go_on)

    def _go_on(self) -> None:
        self._pending = None
        self._hand_over()

    def _receive(self, data: bytes, _time_ns: int) -> None:
        jobs = self._jobs
        if not jobs:
            self.strays += 1
            return
        job = jobs[0]
        transfer = job.transfer
        strays = transfer.strays
        block = transfer.block
        requests = transfer.receive(data)
        if transfer.strays != strays:
            self.strays += transfer.strays - strays
            return
        if block and not transfer.block:
            self._no_block = True  # this server will not be asked again
        if transfer.done:
            self._waiting.clear()  # segments of a block that has been refused
            if requests:
                self._connection.send(self._request_id, requests[0])
            self._end(job)
        elif requests:
            self._send(requests)

    def _end(self, job: SdoJob) -> None:
        self._jobs.popleft()
        if not self._jobs:
            self._pacing.set_busy(self.node, False)
        first = self._jobs[0] if self._jobs else None
        if first is not None:
            self._next()
        job.finish()

    def _due(self) -> None:
        self._timer = None
        if not self._jobs:
            return
        now = self._scheduler.now
        if self._deadline > now:
            self._timer = self._scheduler.at(self._deadline, self._due)
            return
        job = self._jobs[0]
        self._waiting.clear()
        self._connection.send(self._request_id, job.transfer.expire())
        if job.attempts < self.attempts:
            self._next()
        else:
            self._end(job)
