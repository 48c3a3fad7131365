"""A serial-line adapter on a segment and a pseudo-terminal."""

from __future__ import annotations

from emulators.adapter._slcan import ChannelState, SlcanAdapter, StatusFlag
from fieldbus.can.frame import CanFrame
from fieldbus.can.segment import CanSegment
from fieldbus.errors import BusError, ConfigurationError
from fieldbus.history import History
from fieldbus.pty_line import PtyLine


class SlcanDevice:
    """An emulated serial-line adapter: `path` is what a program opens as its serial port.

    Args:
        segment: A segment in real time, the bus that the adapter is on.
        bitrate: Bit rate of that bus, bit/s; None: any that the program sets is right.
        auto_poll: See `SlcanAdapter`.
        name: Name in logs.
        history: Where `adapter.state` and `adapter.overrun` events go.

    Raises:
        BusError: The name is taken on the segment.
        ConfigurationError: The segment is not in real time.

    """

    def __init__(
        self,
        segment: CanSegment,
        *,
        bitrate: int | None = None,
        auto_poll: bool = True,
        name: str = "adapter",
        history: History | None = None,
    ) -> None:
        if not segment.scheduler.realtime:
            raise ConfigurationError("adapter", segment.name, "a segment in real time, as the serial line is")
        self.name = name
        self._history = history
        self._port = segment.attach(name, self._on_frame)
        self._port.online = False
        self.adapter = SlcanAdapter(self._send, bitrate=bitrate, auto_poll=auto_poll, on_state=self._on_state)
        self._line = PtyLine(segment.scheduler, self._on_bytes)
        self.path = self._line.path
        """Device file of the pseudo-terminal."""

    def _on_bytes(self, data: bytes) -> None:
        self._line.write(self.adapter.feed(data))

    def _on_frame(self, frame: CanFrame, time_ns: int) -> None:
        lost = self.adapter.status & StatusFlag.OVERRUN
        self._line.write(self.adapter.deliver(frame, time_ns, free=self._line.free))
        if self.adapter.status & StatusFlag.OVERRUN and not lost and self._history is not None:
            self._history.emit(self.name, "adapter.overrun", can_id=frame.can_id)

    def _send(self, frame: CanFrame) -> bool:
        try:
            self._port.send(frame)
        except BusError:  # the segment reports it
            return False
        return True

    def _on_state(self, state: ChannelState) -> None:
        # A closed channel neither hears nor acknowledges.
        self._port.online = state is not ChannelState.CLOSED
        if state is ChannelState.CLOSED:
            self._line.discard()
        if self._history is not None:
            bitrate = self.adapter.channel_bitrate or 0
            self._history.emit(self.name, "adapter.state", state=state.value, bitrate=bitrate)

    def close(self) -> None:
        """Leave the segment and take the device file away; harmless to repeat."""
        self._port.detach()
        self._line.close()
