"""The `canopen` library on a CAN segment of a bench, without threads and without sleeping.

`PumpedNetwork` is a `canopen.Network` whose waits run the scheduler: the unmodified SDO client, NMT master,
PDO, EMCY and LSS classes of the library work in virtual and in real time. It serves programs of users, and as
a second, independently written implementation against which slave and master are tested.
"""

from __future__ import annotations

import queue
from collections import deque
from collections.abc import Callable
from struct import error as struct_error
from types import TracebackType
from typing import Any, Final, Self

import canopen
from canopen.emcy import EmcyConsumer
from canopen.lss import LssMaster
from canopen.nmt import NmtMaster
from canopen.objectdictionary import ObjectDictionaryError
from canopen.pdo import PdoMap
from canopen.sdo.client import SdoClient

from fieldbus.can.frame import CanFrame
from fieldbus.can.segment import CanSegment
from fieldbus.canopen.virtual_time import EPOCH_S, virtual_time
from fieldbus.clock import S, Scheduler, Timer, seconds_to_ns
from fieldbus.errors import BusError

LONGEST_WAIT_S: Final = 3600.0
"""What a wait without time-out waits at most, s: nothing may hang."""


class PumpedNetwork(canopen.Network):
    """A `canopen.Network` on a segment.

    Use it as the library's documentation says, except that there is nothing to connect. Whatever waits runs
    the scheduler, with the library's time-out taken as simulated time. Waiting from inside a scheduler
    callback - an EMCY callback that reads an SDO, for example - is refused with a `BusError`.

    Time stamps are seconds since `virtual_time.EPOCH_S`. Library code that polls a clock, such as
    `canopen.profiles.p402`, has to run inside `virtual_time(scheduler)`.

    Args:
        segment: CAN segment to attach to.
        name: Name of the port on the segment.

    """

    def __init__(self, segment: CanSegment, *, name: str = "canopen") -> None:
        self.scheduler: Scheduler = segment.scheduler
        self.malformed = 0
        """Frames that the library could not digest: too short for the service or PDO of their identifier."""
        self._tasks: list[PumpedPeriodicTask] = []
        super().__init__(None)
        producer: Any = self.time
        producer.transmit = self._in_virtual_time(self.time.transmit)
        self._port = segment.attach(name, self._receive)
        self._attached = True

    # -- what the library asks of a custom backend
    # ------------------------------------------------------------

    def connect(self, *_args: Any, **_kwargs: Any) -> Self:
        """Do nothing: the network is connected as long as it exists."""
        return self

    def disconnect(self) -> None:
        """Stop all periodic messages and leave the segment."""
        for task in list(self._tasks):
            task.stop()
        if self._attached:
            self._attached = False
            self._port.detach()

    def __exit__(
        self, kind: type[BaseException] | None, value: BaseException | None, traceback: TracebackType | None
    ) -> None:
        self.disconnect()

    def send_message(self, can_id: int, data: Any, remote: bool = False) -> None:
        """Queue a frame; identifiers above 7FFh are extended, as in the library.

        Raises:
            BusError: The network has been disconnected.

        """
        if not self._attached:
            raise BusError("the CANopen network has been disconnected")
        payload = bytes(data or b"")
        self._port.send(CanFrame(can_id, payload, extended=can_id > 0x7FF, remote=remote))

    def send_periodic(self, can_id: int, data: Any, period: float, remote: bool = False) -> Any:
        """Send a frame now and every `period` seconds; return the task with `update` and `stop`."""
        task = PumpedPeriodicTask(self, can_id, data, period, remote=remote)
        self._tasks.append(task)
        return task

    def subscribe(self, can_id: int, callback: Callable[[int, bytearray, float], None]) -> None:
        """Listen for an identifier; an object of the library that subscribes
        gets waits that run the scheduler.
        """
        self._adopt(getattr(callback, "__self__", None))
        super().subscribe(can_id, callback)

    def forget(self, task: PumpedPeriodicTask) -> None:
        """Take a stopped periodic message out of the list."""
        if task in self._tasks:
            self._tasks.remove(task)

    def check(self) -> None:
        """Do nothing: there is no receiving thread that could have failed."""

    def _receive(self, frame: CanFrame, time_ns: int) -> None:
        if frame.remote:
            return
        can_id = frame.can_id
        data = bytearray(frame.data)
        stamp = EPOCH_S + time_ns / S
        for callback in tuple(self.subscribers.get(can_id, ())):
            try:
                callback(can_id, data, stamp)
            except (struct_error, ObjectDictionaryError):
                # The library unpacks without looking at the length. An error of the user's own code is his.
                if not str(getattr(callback, "__module__", "")).startswith("canopen."):
                    raise
                self.malformed += 1
        self.scanner.on_message_received(can_id)

    # -- waits
    # ------------------------------------------------------------------------------------------------

    def _adopt(self, owner: object) -> None:
        thing: Any = owner  # the attributes replaced here are typed as what they are in the library
        if isinstance(owner, (SdoClient, LssMaster)):
            if not isinstance(thing.responses, PumpedQueue):
                thing.responses = PumpedQueue(self.scheduler)
                if isinstance(owner, SdoClient):
                    thing.send_request = self._unhurried(owner)
                    return
                # These sleep between their messages.
                for name in ("fast_scan", "send_switch_state_selective", "send_identify_remote_slave"):
                    if hasattr(owner, name):
                        setattr(thing, name, self._in_virtual_time(getattr(owner, name)))
        elif isinstance(owner, NmtMaster):
            if not isinstance(thing.state_update, PumpedCondition):
                thing.state_update = PumpedCondition(self.scheduler)
                thing.wait_for_bootup = self._in_virtual_time(owner.wait_for_bootup)
        elif isinstance(owner, EmcyConsumer):
            if not isinstance(thing.emcy_received, PumpedCondition):
                thing.emcy_received = PumpedCondition(self.scheduler)
                thing.wait = self._in_virtual_time(owner.wait)
        elif isinstance(owner, PdoMap) and not isinstance(thing.receive_condition, PumpedCondition):
            thing.receive_condition = PumpedCondition(self.scheduler)

    def _unhurried(self, client: SdoClient) -> Callable[[Any], None]:
        """Wrap the sending of an SDO client, which sleeps before it only if that is asked for."""
        send: Callable[[Any], None] = client.send_request
        send_late = self._in_virtual_time(send)

        def call(request: Any) -> None:
            if client.PAUSE_BEFORE_SEND:
                send_late(request)
            else:
                send(request)

        return call

    def _in_virtual_time(self, method: Callable[..., Any]) -> Callable[..., Any]:
        """Wrap a method of the library that calculates its time-out from the wall clock."""

        def call(*args: Any, **kwargs: Any) -> Any:
            with virtual_time(self.scheduler, poll_ns=0):
                return method(*args, **kwargs)

        return call


def _refuse_in_callback(scheduler: Scheduler, what: str) -> None:
    if scheduler.running:
        raise BusError(
            f"waiting for {what} from inside a scheduler callback: a callback must not wait;"
            " note the event and do the transfer outside"
        )


class PumpedQueue:
    """Stands in for the `queue.Queue` of an SDO client or LSS master."""

    def __init__(self, scheduler: Scheduler) -> None:
        self._scheduler = scheduler
        self._items: deque[bytes] = deque()

    def put(self, item: bytes) -> None:
        """Add an answer."""
        self._items.append(item)

    def empty(self) -> bool:
        """Forget what has not been fetched, and return True.

        The library asks before each request, and puts an ordinary queue in place of one that is not empty.
        """
        self._items.clear()
        return True

    def get(self, block: bool = True, timeout: float | None = None) -> bytes:
        """Return the next answer; run the scheduler until it comes.

        Raises:
            queue.Empty: It did not come in time.
            BusError: Called from inside a scheduler callback.

        """
        items = self._items
        if not items and block:
            _refuse_in_callback(self._scheduler, "an SDO answer")
            limit_s = LONGEST_WAIT_S if timeout is None else timeout
            self._scheduler.run_until(items.__len__, seconds_to_ns(limit_s))
        if not items:
            raise queue.Empty
        return items.popleft()


class PumpedCondition:
    """Stands in for the `threading.Condition` of an NMT master, PDO or EMCY
    consumer; there is one thread only.
    """

    def __init__(self, scheduler: Scheduler) -> None:
        self._scheduler = scheduler
        self._notified = 0

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, value: BaseException | None, traceback: TracebackType | None
    ) -> None:
        pass

    def notify_all(self) -> None:
        """Wake those who wait."""
        self._notified += 1

    def wait(self, timeout: float | None = None) -> bool:
        """Run the scheduler until `notify_all`; return whether it came in time.

        Raises:
            BusError: Called from inside a scheduler callback.

        """
        _refuse_in_callback(self._scheduler, "a message")
        before = self._notified
        limit_s = LONGEST_WAIT_S if timeout is None else max(0.0, timeout)
        return self._scheduler.run_until(lambda: self._notified != before, seconds_to_ns(limit_s))


class PumpedPeriodicTask:
    """A message sent periodically; the interface of `canopen.network.PeriodicMessageTask`."""

    def __init__(
        self, network: PumpedNetwork, can_id: int, data: Any, period: float, *, remote: bool
    ) -> None:
        if period <= 0:
            raise BusError(f"period {period} s of the message {can_id:03X}h is not positive")
        self.period = period
        self._network = network
        self._can_id = can_id
        self._data = bytes(data or b"")
        self._remote = remote
        self._due_ns = network.scheduler.now
        self._timer: Timer | None = None
        self._send()

    def _send(self) -> None:
        scheduler = self._network.scheduler
        self._due_ns += max(1, seconds_to_ns(self.period))
        self._timer = scheduler.at(max(self._due_ns, scheduler.now), self._send)
        self._network.send_message(self._can_id, self._data, self._remote)

    def stop(self) -> None:
        """End the transmission; harmless to repeat."""
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None
            self._network.forget(self)

    def update(self, data: Any) -> None:
        """Send other data from the next period on."""
        self._data = bytes(data or b"")
