"""A server on a pseudo-terminal, which any program opens as its serial port."""

from __future__ import annotations

from typing import Final

from fieldbus.clock import MS, Scheduler, Timer
from fieldbus.modbus.framing import LONGEST_RTU, RtuResponder
from fieldbus.modbus.serial_line import SerialFormat
from fieldbus.modbus.server import ModbusServer
from fieldbus.pty_line import PtyLine

_SHORTEST_PAUSE_NS: Final = 4 * MS


class PtyServer:
    """A device behind a pseudo-terminal, in real time.

    A pseudo-terminal knows neither rate nor parity, and hands over pieces when it likes. So a frame ends with
    a pause of at least 4 ms, pauses within a frame are not judged, and the response waits as long as request
    and response would have taken on a line of the given format.

    Args:
        scheduler: A realtime scheduler.
        server: What answers.
        format_: Of the line that is imitated.
        processing_ns: From the end of the request to the response, ns.

    Raises:
        OSError: The system has no pseudo-terminal left.

    """

    def __init__(
        self,
        scheduler: Scheduler,
        server: ModbusServer,
        *,
        format_: SerialFormat | None = None,
        processing_ns: int = MS,
    ) -> None:
        self._scheduler = scheduler
        self._responder = RtuResponder(server)
        self._format = format_ if format_ is not None else SerialFormat()
        self.processing_ns = processing_ns
        self.longest_processing_ns = 0
        """A response that would come later is not sent; 0 = it always is."""
        self.online = True
        """Whether the device is supplied; without supply it neither receives nor sends."""
        self.silent = False
        """Whether requests are carried out and not answered."""
        self._pause_ns = max(self._format.t35_ns, _SHORTEST_PAUSE_NS)
        self._buffer = bytearray()
        self._timer: Timer | None = None
        self._line = PtyLine(scheduler, self._received)

    @property
    def path(self) -> str:
        """The device file that the other program opens."""
        return self._line.path

    def _received(self, data: bytes) -> None:
        if not self.online:
            return
        # One byte beyond the longest frame is kept: it makes the frame one that is too long.
        self._buffer += data[: LONGEST_RTU + 1 - len(self._buffer)]
        if self._timer is not None:
            self._timer.cancel()
        self._timer = self._scheduler.after(self._pause_ns, self._ended)

    def _ended(self) -> None:
        frame = bytes(self._buffer)
        self._buffer.clear()
        self._timer = None
        answer = self._responder.receive(frame) if self.online else None
        late = 0 < self.longest_processing_ns < self.processing_ns
        if answer is not None and not (self.silent or late):
            delay_ns = self.processing_ns + self._format.duration_ns(len(frame) + len(answer))
            self._scheduler.after(delay_ns, lambda: self._line.write(answer))

    def close(self) -> None:
        """Remove the device file; harmless to repeat."""
        self._line.close()
