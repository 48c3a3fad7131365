"""A serial port of this machine as a line: what the master of a virtual line uses, in real time."""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import suppress
from threading import Thread
from typing import TYPE_CHECKING, Final

from fieldbus.clock import MS
from fieldbus.errors import BusError, ConfigurationError
from fieldbus.modbus.serial_line import Parity, SerialFormat, SerialFrame

if TYPE_CHECKING:
    import serial

    from fieldbus.clock import Scheduler, Timer
    from fieldbus.modbus.serial_line import SerialListener

_SHORTEST_PAUSE_NS: Final = 4 * MS
"""A system hands received bytes over in pieces, later than they came: pauses below it say nothing."""
_LETTERS: Final = {Parity.EVEN: "E", Parity.ODD: "O", Parity.NONE: "N"}
_POLL_S: Final = 0.1
_PIECE: Final = 4096


class LiveSerialLine:
    """A serial port with one master at our end.

    Args:
        scheduler: A realtime scheduler.
        path: Device file.
        format_: Rate and characters.
        other: Name in the log of the device at the other end.

    Raises:
        BusError: The device file cannot be opened.

    """

    def __init__(
        self, scheduler: Scheduler, path: str, format_: SerialFormat, *, other: str = "device"
    ) -> None:
        import serial

        self._scheduler = scheduler
        self.path = path
        self.format = format_
        self.pause_ns = max(format_.t35_ns, _SHORTEST_PAUSE_NS)
        """Silence that ends a frame, ns."""
        self.log: list[SerialFrame] = []
        """As `SerialLine.log`; what is received is joined to frames by its pauses."""
        self._other = other
        self._listener: SerialListener | None = None
        self._closed = False
        self._frame = bytearray()
        self._start_ns = self._last_ns = 0
        self._pause: Timer | None = None
        stop_bits = format_.bits - 9 - (format_.parity is not Parity.NONE)
        try:
            self._port: serial.Serial = serial.Serial(
                path,
                format_.baud,
                parity=_LETTERS[format_.parity],
                stopbits=stop_bits,
                timeout=_POLL_S,
                write_timeout=0,
            )
        except (OSError, ValueError, serial.SerialException) as error:
            raise BusError(f"serial line {path}: {error}") from error
        self._thread = Thread(target=self._run, name=f"serial port {path}", daemon=True)
        self._thread.start()

    def attach(
        self, name: str, listener: SerialListener, format_: SerialFormat | None = None
    ) -> LiveSerialPort:
        """Let a master use the line.

        Raises:
            ConfigurationError: There is one already, or it wants another format than the line's.

        """
        if self._listener is not None:
            raise ConfigurationError("master of the line", name, "one master")
        if format_ is not None and format_ != self.format:
            raise ConfigurationError("serial line, format", format_, "that of the line")
        self._listener = listener
        return LiveSerialPort(self, name)

    def send(self, name: str, data: bytes) -> int:
        """Send bytes; returns when the last character ends by the rate of the line, ns."""
        import serial

        self._end_of_frame()
        start = self._scheduler.now
        end = start + self.format.duration_ns(len(data))
        note = ""
        try:
            self._port.write(data)
        except (OSError, serial.SerialException):
            note = "dropped"
        self.log.append(SerialFrame(start, end, name, data, note))
        return end

    def _received(self, data: bytes) -> None:
        now = self._scheduler.now
        if self._pause is None:
            self._start_ns = now - self.format.duration_ns(len(data))
        else:
            self._pause.cancel()
        self._pause = self._scheduler.after(self.pause_ns, self._end_of_frame)
        self._last_ns = now
        self._frame += data
        if self._listener is not None:
            self._listener.started(now)
            self._listener.received(data, False, now)

    def _end_of_frame(self) -> None:
        if self._pause is not None:
            self._pause.cancel()
            self._pause = None
            self.log.append(SerialFrame(self._start_ns, self._last_ns, self._other, bytes(self._frame), ""))
            self._frame.clear()

    def _run(self) -> None:
        import serial

        while not self._closed:
            try:
                data = self._port.read(1)
                waiting = self._port.in_waiting if data else 0
                if waiting:
                    data += self._port.read(min(waiting, _PIECE))
            except (OSError, TypeError, serial.SerialException):
                return  # the device is gone: what is asked finds no answer
            if data:
                self._scheduler.post(lambda data=data: self._received(data))  # type: ignore[misc]

    @property
    def open(self) -> bool:
        """Whether it has not been given back."""
        return not self._closed

    def close(self) -> None:
        """Give the port back; harmless to repeat."""
        if self._closed:
            return
        self._closed = True
        self._thread.join(10 * _POLL_S)
        with suppress(OSError):
            self._port.close()


class LiveSerialPort:
    """The master's place on the line."""

    def __init__(self, line: LiveSerialLine, name: str) -> None:
        self._line = line
        self.format = line.format
        self.name = name

    @property
    def online(self) -> bool:
        """Whether the port is open."""
        return self._line.open

    def send(self, data: bytes, pauses: Mapping[int, int] | None = None) -> int:  # noqa: ARG002 - a system makes its own
        """Send bytes; returns when the last character ends by the rate of the line, ns."""
        return self._line.send(self.name, data)
