"""A serial line in simulated time: characters with their exact length, one talker at a time or a collision.

A run of characters without a pause is one transmission on the line and two events, so that a frame costs no
event per character. What a receiver makes of runs and pauses is its own affair (`FrameAssembler`).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from enum import Enum
from typing import Final, NamedTuple, Protocol

from fieldbus.clock import S, Scheduler, Timer
from fieldbus.errors import ConfigurationError
from fieldbus.modbus.framing import LONGEST_RTU
from fieldbus.modbus.hooks import Change, Hooks, LinkHook

_FAST: Final = 19_200
_T15_FAST_NS: Final = 750_000
_T35_FAST_NS: Final = 1_750_000
_END_OF_FRAME: Final = -1
"""Priority of the end of a pause: a frame that begins at that very instant is the next one."""


class Parity(Enum):
    """Parity bit of a character."""

    EVEN = "even"
    ODD = "odd"
    NONE = "none"


@dataclass(frozen=True)
class SerialFormat:
    """Rate and characters of a line.

    Args:
        baud: Bit/s, 300..1 000 000.
        parity: Parity bit.
        stop_bits: 1 or 2; None for 1 with parity and 2 without, so that a character has 11 bits (MODB-001).

    """

    baud: int = _FAST
    parity: Parity = Parity.EVEN
    stop_bits: int | None = None

    def __post_init__(self) -> None:
        if not 300 <= self.baud <= 1_000_000:
            raise ConfigurationError("serial line, baud", self.baud, "300..1000000")
        if self.stop_bits not in (None, 1, 2):
            raise ConfigurationError("serial line, stop_bits", self.stop_bits, "1, 2, or None")

    @property
    def bits(self) -> int:
        """Bits of a character with start, parity and stop bits."""
        parity = self.parity is not Parity.NONE
        stop = self.stop_bits if self.stop_bits is not None else 1 if parity else 2
        return 9 + parity + stop

    def duration_ns(self, characters: float) -> int:
        """Return the time of a number of characters, ns (MODB-011)."""
        return round(characters * self.bits * S / self.baud)

    @property
    def t15_ns(self) -> int:
        """Longest pause within a frame, ns (MODB-002)."""
        return _T15_FAST_NS if self.baud > _FAST else self.duration_ns(1.5)

    @property
    def t35_ns(self) -> int:
        """Shortest pause between frames, ns (MODB-002)."""
        return _T35_FAST_NS if self.baud > _FAST else self.duration_ns(3.5)


class SerialFrame(NamedTuple):
    """A transmission on the line, for the log: characters without a pause between them."""

    start_ns: int
    end_ns: int
    sender: str
    data: bytes
    """As sent; after a hook has changed it."""
    note: str
    """`collision`, `changed`, `dropped`, several with a comma, or nothing."""


class SerialListener(Protocol):
    """Who hears the line."""

    def started(self, time_ns: int) -> None:
        """Take note that a character begins after a pause."""

    def received(self, data: bytes, damaged: bool, time_ns: int) -> None:
        """Take characters without a pause between them, at the end of the last one; `damaged`: one had a
        wrong parity.
        """


class _Run:
    """Characters on the line without a pause."""

    __slots__ = ("damaged", "data", "disturbed", "end_ns", "heard", "note", "port", "start_ns")

    def __init__(self, port: SerialPort, start_ns: int, data: bytes, damaged: set[int], note: str) -> None:
        self.port = port
        self.start_ns = start_ns
        self.end_ns = start_ns + port.format.duration_ns(len(data))
        self.data = data
        self.damaged = damaged
        self.note = note
        self.disturbed: list[tuple[int, int]] = []
        self.heard: list[SerialPort] = []


class SerialPort:
    """A station's place on a line. It hears the others, and itself with `echo`."""

    def __init__(
        self, line: SerialLine, name: str, listener: SerialListener, format_: SerialFormat, echo: bool
    ) -> None:
        self.line = line
        self.name = name
        self.listener = listener
        self.format = format_
        self.echo = echo
        self.online = True
        """Whether the station is connected and supplied."""
        self._free_ns = 0

    def send(self, data: bytes, pauses: Mapping[int, int] | None = None) -> int:
        """Send bytes, behind those that are still being sent; whether the line is free is not asked.

        Args:
            data: At least one byte.
            pauses: Silence before the byte with this number (from 1 on), ns.

        Returns:
            When the last character ends, ns.

        """
        self._free_ns = self.line.transmit(self, data, max(self._free_ns, self.line.scheduler.now), pauses)
        return self._free_ns


class SerialLine:
    """A half-duplex line, as RS-485.

    Args:
        scheduler: Time.
        name: For logs.
        format_: Of the ports that bring none of their own. Ports with different ones hear each other's
            characters as damaged.
        keep_log: Whether `log` is kept.

    """

    def __init__(
        self,
        scheduler: Scheduler,
        name: str = "line",
        format_: SerialFormat | None = None,
        *,
        keep_log: bool = True,
    ) -> None:
        self.scheduler = scheduler
        self.name = name
        self.format = format_ if format_ is not None else SerialFormat()
        self.keep_log = keep_log
        self.pause_ns = 0
        """Silence that ends a frame where it is longer than t3.5, ns."""
        self.log: list[SerialFrame] = []
        self.collisions = 0
        """Transmissions that another one met."""
        self._ports: list[SerialPort] = []
        self._active: list[_Run] = []
        self._hooks = Hooks()

    def attach(
        self,
        name: str,
        listener: SerialListener,
        format_: SerialFormat | None = None,
        *,
        echo: bool = False,
    ) -> SerialPort:
        """Add a station; one with `echo` hears itself, as many two-wire adapters do."""
        port = SerialPort(self, name, listener, format_ if format_ is not None else self.format, echo)
        self._ports.append(port)
        return port

    def add_hook(self, hook: LinkHook) -> Callable[[], None]:
        """Ask `hook` before every transmission; returns the function that ends it."""
        return self._hooks.add(hook)

    @property
    def busy(self) -> bool:
        """Whether somebody talks."""
        return bool(self._active)

    def transmit(self, port: SerialPort, data: bytes, start_ns: int, pauses: Mapping[int, int] | None) -> int:
        """Put bytes of a port on the line from `start_ns` on; returns when the last character ends, ns."""
        if not port.online:
            return start_ns
        note = ""
        damaged: tuple[int, ...] = ()
        change = self._hooks.ask(port.name, data, self.scheduler.now)
        if change is not None:
            start_ns += change.delay_ns
            note = _note(change)
            if change.drop:
                end_ns = start_ns + port.format.duration_ns(len(data))
                self._note(SerialFrame(start_ns, end_ns, port.name, data, note))
                return end_ns
            data = data if change.data is None else change.data
            pauses = {**(pauses or {}), **change.pauses}
            damaged = change.damaged
        cuts = sorted(at for at in (pauses or {}) if 0 < at < len(data))
        end_ns = start_ns
        for begin, end in zip([0, *cuts], [*cuts, len(data)], strict=True):
            if begin:
                end_ns += (pauses or {})[begin]
            hurt = {at - begin for at in damaged if begin <= at < end}
            run = _Run(port, end_ns, data[begin:end], hurt, note)
            self.scheduler.at(run.start_ns, lambda run=run: self._begin(run))  # type: ignore[misc]
            end_ns = run.end_ns
        return end_ns

    def _note(self, entry: SerialFrame) -> None:
        if self.keep_log:
            self.log.append(entry)

    def _begin(self, run: _Run) -> None:
        if not run.data or not run.port.online:
            return
        for other in self._active:
            if other.end_ns > run.start_ns:
                met = (run.start_ns, min(run.end_ns, other.end_ns))
                run.disturbed.append(met)
                other.disturbed.append(met)
        self._active.append(run)
        run.heard = [port for port in self._ports if port.online and (port is not run.port or port.echo)]
        for port in run.heard:
            port.listener.started(run.start_ns)
        self.scheduler.at(run.end_ns, lambda: self._end(run))

    def _end(self, run: _Run) -> None:
        self._active.remove(run)
        data, hurt = run.data, run.damaged
        if run.disturbed:
            self.collisions += 1
            run.note = f"{run.note},collision".lstrip(",")
            hurt = hurt | self._overlaid(run)
        if hurt:
            # What arrives of a disturbed character is anything but what was sent.
            data = bytes(byte ^ 0xFF if at in hurt else byte for at, byte in enumerate(data))
        self._note(SerialFrame(run.start_ns, run.end_ns, run.port.name, run.data, run.note))
        for port in run.heard:
            if port.online:
                ours, theirs = port.format, run.port.format
                foreign = ours.baud != theirs.baud or ours.parity != theirs.parity
                port.listener.received(data, bool(hurt) or foreign, run.end_ns)
            else:  # it has left in the meantime
                port.listener.received(b"", True, run.end_ns)

    @staticmethod
    def _overlaid(run: _Run) -> set[int]:
        """Return the numbers of the characters that another transmission overlays."""
        duration = run.port.format.duration_ns
        found = set()
        for at in range(len(run.data)):
            start, end = run.start_ns + duration(at), run.start_ns + duration(at + 1)
            if any(start < other_end and other_start < end for other_start, other_end in run.disturbed):
                found.add(at)
        return found


def _note(change: Change) -> str:
    return "dropped" if change.drop else "changed"


class FrameAssembler:
    """A listener that makes frames of characters and pauses (MODB-002, MODB-004).

    Args:
        scheduler: Time.
        t15_ns: Longest pause within a frame, ns.
        t35_ns: Pause that ends a frame, ns.
        on_frame: Called with a frame at the end of the pause behind it, and whether it is damaged: a
            wrong parity, a pause that was too long, or more than 256 bytes.
        lenient: Accept pauses between both times, as many devices do.

    """

    def __init__(
        self,
        scheduler: Scheduler,
        t15_ns: int,
        t35_ns: int,
        on_frame: Callable[[bytes, bool], object],
        *,
        lenient: bool = False,
    ) -> None:
        if not 0 < t15_ns <= t35_ns:
            raise ConfigurationError("pauses", (t15_ns, t35_ns), "0 < t1.5 <= t3.5")
        self._scheduler = scheduler
        self.t15_ns = t15_ns
        """Longest pause within a frame, ns."""
        self.t35_ns = t35_ns
        """Pause that ends a frame, ns; at least `t15_ns`."""
        self._on_frame = on_frame
        self.lenient = lenient
        self.overruns = 0
        """Frames with more bytes than a frame can have."""
        self._buffer = bytearray()
        self._damaged = False
        self._last_ns = 0
        self._talkers = 0
        self._timer: Timer | None = None

    @property
    def busy(self) -> bool:
        """Whether a frame has begun and its end is not certain yet."""
        return self._timer is not None or self._talkers > 0

    def started(self, time_ns: int) -> None:
        """Note the begin of a character."""
        self._talkers += 1
        if self._timer is None:
            return
        self._timer.cancel()
        self._timer = None
        if time_ns - self._last_ns > self.t15_ns and not self.lenient:
            self._damaged = True

    def received(self, data: bytes, damaged: bool, time_ns: int) -> None:
        """Take characters."""
        self._damaged = self._damaged or damaged
        free = LONGEST_RTU - len(self._buffer)
        if len(data) > free:
            self.overruns += not self._damaged
            self._damaged = True
        self._buffer += data[:free]
        self._last_ns = time_ns
        self._talkers -= 1
        if self._talkers == 0:  # else others talk on: a collision has no pause
            self._timer = self._scheduler.at(time_ns + self.t35_ns, self._ended, priority=_END_OF_FRAME)

    def _ended(self) -> None:
        frame, damaged = bytes(self._buffer), self._damaged
        self._buffer.clear()
        self._damaged = False
        self._timer = None
        self._on_frame(frame, damaged)
