"""The controller's SDO client on the bus: a queue per node, time-outs, retries; nothing waits (CiA 301
section A6).

One client serves one node and has at most one transfer under way, because a server has one channel; clients
of several nodes work at the same time. A transfer is a `SdoJob`: ask it, or be called when it has ended.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from typing import TYPE_CHECKING, Final

from fieldbus.canopen.abort import ABORT_TEXTS, AbortCode
from fieldbus.canopen.nmt import COB_SDO_CLIENT, COB_SDO_SERVER
from fieldbus.canopen.sdo_transfer import SdoDownload, SdoTransfer, SdoUpload
from fieldbus.clock import MS, Timer
from fieldbus.errors import ConfigurationError

if TYPE_CHECKING:
    from fieldbus.canopen.master import CanopenMaster

TIMEOUT_NS: Final = 300 * MS
"""How long a server may take for an answer, ns."""
ATTEMPTS: Final = 2
"""How often a transfer is begun before silence counts as its end."""
BLOCK_FROM_BYTES: Final = 64
"""Downloads of this size and more use the block protocol where the server knows it."""

_BURST: Final = 4
"""Segments of a block that are handed to the bus at once; a real transmit queue is short."""
_BURST_NS: Final = 1 * MS

JobCallback = Callable[["SdoJob"], object]


class SdoJob:
    """One transfer, waiting, under way or ended.

    Attributes that end in `ed` or say what came of it are valid once `done()` is true.
    """

    __slots__ = ("_callback", "_client", "_done", "attempts", "transfer")

    def __init__(self, client: SdoClient, transfer: SdoTransfer, callback: JobCallback | None) -> None:
        self._client = client
        self._callback = callback
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
        """Why it failed: the server's code, or 05040000h for a server that does not answer; 0 = it did not
        fail.
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
            self._client.withdraw(self)

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
        return f"<SdoJob {what} {where} at node {self._client.node}: {state} {self.reason}>"


class SdoClient:
    """The client of one node's default SDO server; made by `CanopenMaster.sdo`.

    Args:
        master: Services of the controller on the segment.
        node: Node-ID of the server, 1..127.

    Raises:
        ConfigurationError: `node` is out of range.

    """

    __slots__ = (
        "_deadline",
        "_jobs",
        "_master",
        "_no_block",
        "_pending",
        "_request_id",
        "_timer",
        "_waiting",
        "attempts",
        "node",
        "strays",
        "timeout_ns",
    )

    def __init__(self, master: CanopenMaster, node: int) -> None:
        if not 1 <= node <= 127:
            raise ConfigurationError(f"{master.name}: SDO client node", node, "1..127")
        self.node = node
        self.timeout_ns = TIMEOUT_NS
        """How long the server may take for an answer, ns."""
        self.attempts = ATTEMPTS
        """How often a transfer is begun before silence counts as its end; 1 or more."""
        self.strays = 0
        """Answers that belonged to no transfer: somebody else's, or late ones."""
        self._master = master
        self._request_id = COB_SDO_CLIENT + node
        self._jobs: deque[SdoJob] = deque()
        self._waiting: deque[bytes] = deque()  # requests that have not gone out yet
        self._pending: Timer | None = None  # when they will
        self._timer: Timer | None = None
        self._deadline = 0
        self._no_block = False
        master.subscribe(COB_SDO_SERVER + node, self._receive)

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
        return self._queue(SdoJob(self, SdoUpload(index, sub, block=block and not self._no_block), on_done))

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
            SdoJob(self, SdoDownload(index, sub, data, block=wanted and not self._no_block), on_done)
        )

    def cancel(self) -> None:
        """Give up all transfers without calling anybody: the node has gone, or has started anew."""
        for job in tuple(self._jobs):
            job.cancel()

    def withdraw(self, job: SdoJob) -> None:
        """Take a job out; one that is under way is aborted. Jobs call this for themselves."""
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
                self._master.send(self._request_id, abort)
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
        self._master.sdo_under_way(self, bool(jobs))
        if jobs:
            job = jobs[0]
            job.attempts += 1
            self._send(job.transfer.start())

    def _send(self, requests: list[bytes]) -> None:
        master = self._master
        self._deadline = master.scheduler.now + self.timeout_ns
        if self._timer is None:
            self._timer = master.scheduler.at(self._deadline, self._due)
        if len(requests) == 1 and not self._waiting:
            delay = master.sdo_delay_ns()
            if not delay:
                master.send(self._request_id, requests[0])
                return
        self._waiting.extend(requests)
        self._hand_over()

    def _hand_over(self) -> None:
        """Send what waits: not into the time of a SYNC, and long blocks in bursts."""
        waiting = self._waiting
        if self._pending is not None or not waiting:
            return
        master = self._master
        burst = min(_BURST, len(waiting))
        delay = master.sdo_delay_ns(burst)
        if not delay:
            for _ in range(burst):
                master.send(self._request_id, waiting.popleft())
            self._deadline = master.scheduler.now + self.timeout_ns
            delay = _BURST_NS
        if waiting:
            self._pending = master.scheduler.after(delay, self._go_on)

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
                self._master.send(self._request_id, requests[0])
            self._end(job)
        elif requests:
            self._send(requests)

    def _end(self, job: SdoJob) -> None:
        self._jobs.popleft()
        if not self._jobs:
            self._master.sdo_under_way(self, False)
        first = self._jobs[0] if self._jobs else None
        if first is not None:
            self._next()
        job.finish()

    def _due(self) -> None:
        self._timer = None
        if not self._jobs:
            return
        now = self._master.scheduler.now
        if self._deadline > now:
            self._timer = self._master.scheduler.at(self._deadline, self._due)
            return
        job = self._jobs[0]
        self._waiting.clear()
        self._master.send(self._request_id, job.transfer.expire())
        if job.attempts < self.attempts:
            self._next()
        else:
            self._end(job)
