"""Port to a PROFIdrive axis on Modbus: its telegram in registers, polled once per cycle; nothing waits.

With T the bus cycle: the telegram goes out in the application cycle, at k*T + T/2 (function 16), and the
actual values are read at (k+1)*T (function 3). The drive has the telegram before (k+1)*T, and what the axis
sees at k*T + T/2 was read after k*T, as it is on CAN. With `combined`, one request in the application cycle
does both (function 23): less time on a serial line, but the axis sees the actual values half a cycle later.

A response that comes late, not at all, or is an exception, is a missing cycle. Nothing is sent again: the
next cycle has newer values.

A drive is asked for its actual values before anything is written to it: one that has not had a telegram since
it was switched on does not request control yet (ZSW1.9 = 0, PD-081), and so shows that it has started again.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from enum import Enum
from typing import TYPE_CHECKING, Final, Protocol

from typing_extensions import override

from fieldbus.errors import ConfigurationError, HilError
from fieldbus.modbus import ExceptionCode, Outcome, ProcessDataRegisters
from fieldbus.profidrive import TypeCode
from fieldbus.profidrive.requests import Values
from fieldbus.profidrive.words import ZSW1
from motion.drives._ds47 import Ds47Client
from motion.drives._link import LinkConfig
from motion.drives.profidrive import ProfidrivePort, TelegramConfig

if TYPE_CHECKING:
    from fieldbus.clock import Scheduler, Timer
    from fieldbus.history import History
    from fieldbus.modbus import Job, Request, Result

_CONTROL_REQUESTED: Final = int(ZSW1.CONTROL_REQUESTED)
_FAULT: Final = int(ZSW1.FAULT)
_ASK_AGAIN_NS: Final = 200_000_000
"""Pause between two questions to a drive that is silent."""
_FAULT_NUMBER_CYCLES: Final = 16
"""Cycles after which the fault number is read again, as long as the fault is there."""
_READING, _WRITING, _INPUTS = range(3)
"""Kinds of requests of a cycle; each may fail on its own."""
_MEANT: Final = frozenset(
    {ExceptionCode.ILLEGAL_FUNCTION, ExceptionCode.ILLEGAL_DATA_ADDRESS, ExceptionCode.ILLEGAL_DATA_VALUE}
)
"""Exceptions that say that the drive is another one than the map describes: asking again changes nothing
(MODB-022 to -024).
"""


def _ignore(_value: float | None, _reason: str) -> None:
    """Take an answer that nobody waits for."""


class RegisterClient(Protocol):
    """Who carries requests: `TcpClient` or `RtuClient`."""

    def submit(self, request: Request, unit: int = 1, done: Callable[[Result], object] | None = None) -> Job:
        """Put a request into the queue; `done` is called with its end."""


class Stage(Enum):
    """How far the port is with its drive."""

    OFF = "off"
    ASKING = "asking"
    SETTING = "setting"
    SERVICE = "in service"


@dataclass(frozen=True, kw_only=True)
class ProfidriveModbusConfig(LinkConfig):
    """Facts about the drive that the controller has to know, in addition to `LinkConfig`.

    Args:
        unit: Address of the drive, 0..255 (over TCP), 1..247 (on a serial line).
        registers: Where the telegram stands.
        words: The telegram.
        monitoring_ms: Time-out of the process data in the drive, written at the start where the map has
            it; 0 = off.
        combined: Write and read with one request, where the map allows function 23.
        request_ns: From a request for actual values to the instant at which the drive takes them, ns.

    Raises:
        ConfigurationError: A value is out of range, or values do not fit together.

    """

    unit: int = 1
    registers: ProcessDataRegisters
    words: TelegramConfig = field(default_factory=TelegramConfig)
    monitoring_ms: int = 0
    combined: bool = False
    request_ns: int = 0

    def __post_init__(self) -> None:
        LinkConfig.__post_init__(self)
        if not 0 <= self.unit <= 255:
            raise ConfigurationError("drive.unit", self.unit, "0..255")
        if self.combined and not self.registers.combined:
            raise ConfigurationError("drive.map", "without function 23", "combined = false")
        layout = self.words.build()
        if (layout.setpoint.words, layout.actual.words) != (
            self.registers.words_out,
            self.registers.words_in,
        ):
            raise ConfigurationError("drive.telegram", self.words.telegram, "the telegram of the registers")


class ProfidriveModbusPort(ProfidrivePort):
    """Polls the telegram in registers: function 16 to write and 3 to read, or 23 for both.

    Args:
        scheduler: Time of the bench.
        client: Who carries the requests; without retries.
        config: Facts about the drive.
        name: Name of the drive in the history.
        history: Log for link and drive events; None for none.

    """

    __slots__ = (
        "_ask_at_ns",
        "_asked_ns",
        "_asking_more",
        "_client",
        "_config",
        "_cycles_of_fault",
        "_fresh",
        "_misses",
        "_more",
        "_parameters",
        "_read_fault_number",
        "_read_inputs",
        "_read_request",
        "_reading",
        "_scheduler",
        "_timer",
        "_writing",
        "exceptions",
        "missed",
        "refusal",
        "response_ns",
        "stage",
        "text",
        "unit",
    )  # fmt: skip

    def __init__(
        self,
        scheduler: Scheduler,
        client: RegisterClient,
        config: ProfidriveModbusConfig,
        *,
        name: str = "drive",
        history: History | None = None,
    ) -> None:
        super().__init__(config, config.words, name=name, history=history)
        self._scheduler = scheduler
        self._client = client
        self._config = config
        self.unit = config.unit
        self._read_request = config.registers.read()
        self._read_inputs = config.registers.read_inputs()
        self._read_fault_number = config.registers.read_fault_number()
        self._more: tuple[Request, Callable[[Result], object]] | None = None
        """A request of the parameter channel that waits for its cycle."""
        channel = config.registers.parameters
        self._parameters = None if channel is None else Ds47Client(scheduler, self._put_aside, channel)
        self.has_parameters = channel is not None
        self._timer: Timer | None = None
        self._fresh: bytes | None = None
        """Actual values that have come since the last application cycle."""
        self._reading = self._asking_more = self._writing = False
        self._asked_ns = 0
        self._ask_at_ns = 0
        self._misses = [0, 0, 0]
        self._cycles_of_fault = 0
        self.stage = Stage.OFF
        self.missed = 0
        """Cycles without actual values, since the start."""
        self.exceptions = 0
        """Requests that were answered with an exception."""
        self.response_ns = 0
        """From the last request for actual values to its response, ns."""
        self.text = ""
        """What the last request that failed has ended with."""
        self.refusal = ""
        """Why the drive cannot be led at all; empty while that is not known."""

    @override
    def read_parameter(self, number: int, index: int, answer: Callable[[float | None, str], object]) -> None:
        self._channel().read(number, index, answer)

    def write_parameter(
        self,
        number: int,
        index: int,
        code: int,
        value: float,
        answer: Callable[[float | None, str], object] = _ignore,
    ) -> None:
        """Write element `index` of parameter `number` by data record 47; nothing waits.

        Args:
            number: PNU, 1..65535.
            index: Element, from 0.
            code: Data type (`TypeCode`).
            value: What is written.
            answer: Called later, once, with the value, or with None and the reason in words.

        Raises:
            ConfigurationError: The register map has no parameter channel.

        """
        exact = float(value) if code == TypeCode.FLOAT32 else int(value)
        self._channel().write(number, index, Values(code, (exact,)), answer)

    def _channel(self) -> Ds47Client:
        # Data record 47 (PD-326).
        if self._parameters is None:
            raise ConfigurationError(
                "register map", "without data record 47", "a map with a parameter channel"
            )
        return self._parameters

    # -- start and end
    # ------------------------------------------------------------------------------------------

    def boot(self) -> None:
        """Begin to ask for the drive."""
        if self._timer is None:
            self.stage = Stage.ASKING
            self._timer = self._scheduler.every(self._config.cycle_ns, self._poll)

    @property
    def started(self) -> bool:
        """Whether the drive is in service."""
        return self.stage is Stage.SERVICE

    def describe(self) -> dict[str, object]:
        """Return what is known of the drive, as plain values."""
        return {
            "name": self.name,
            "unit": self.unit,
            "state": self.stage.value,
            "missed": self.missed,
            "exceptions": self.exceptions,
            "response_s": self.response_ns * 1e-9,
            "text": self.text,
        }

    def release(self) -> None:
        """Disable the drive with a last telegram: nobody will lead it any more."""
        request = self._config.registers.write(self._compose_release())
        if self.stage is Stage.SERVICE:
            try:
                self._client.submit(request, self._config.unit)
            except HilError:
                return  # the queue is full: nobody is there

    def close(self) -> None:
        """Ask no more."""
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None
        self.stage = Stage.OFF

    @property
    @override
    def delay_ns(self) -> int:
        age = self._config.cycle_ns * (2 if self._config.combined else 1) // 2 - self._config.request_ns
        return self._config.cycle_ns * 3 // 2 + age

    # -- cycle
    # --------------------------------------------------------------------------------------------------

    @override
    def read(self) -> None:
        frame, self._fresh = self._fresh, None
        if frame is None and self.link_ok:
            self.missed += 1
        self._take(frame)

    @override
    def write(self, stw1: int, speed_rpm: float, torque_nm: float = 0.0) -> None:
        self._put(self._compose(stw1, speed_rpm, torque_nm))

    def write_words(self, row: Sequence[int]) -> None:
        """Send a telegram of these signals, in their order."""
        self._put(self.compose_words(row))

    def _put(self, frame: bytes | None) -> None:
        if self.stage is not Stage.SERVICE:
            return
        # One that is still under way is older, but another behind it would be later than the next one.
        if not self._config.combined:
            if frame is not None and not self._writing:
                self._writing = True
                self._submit(self._config.registers.write(frame), self._on_written)
        elif not self._reading:
            both = self._read_request if frame is None else self._config.registers.exchange(frame)
            self._ask(both)

    def _submit(self, request: Request, done: Callable[[Result], object]) -> None:
        self._client.submit(request, self._config.unit, done)

    def _poll(self) -> None:
        """Ask for actual values, at k*T."""
        if self._reading:
            return
        if self.stage is Stage.ASKING:
            if self._scheduler.now >= self._ask_at_ns:
                self._reading = True
                self._submit(self._read_request, self._on_asked)
        elif self.stage is Stage.SERVICE and not self._config.combined:
            self._ask(self._read_request)

    def _ask(self, request: Request) -> None:
        self._reading = True
        self._asked_ns = self._scheduler.now
        self._submit(request, self._on_read)
        if self._asking_more:
            return
        # One more request per cycle, whatever it asks: a line has no time for two.
        if self._more is not None:
            (more, done), self._more = self._more, None
            self._asking_more = True
            self._submit(more, lambda result: self._on_more(result, done))
        elif self._cycles_of_fault % _FAULT_NUMBER_CYCLES == 1 and self._read_fault_number is not None:
            self._asking_more = True
            self._submit(self._read_fault_number, self._on_fault_number)
        elif self._read_inputs is not None:
            self._asking_more = True
            self._submit(self._read_inputs, self._on_inputs)

    # -- responses
    # ------------------------------------------------------------------------------------------------

    def _on_asked(self, result: Result) -> None:
        """Look what a drive shows that nobody has written to (yet, or for some time)."""
        self._reading = False
        if self.stage is not Stage.ASKING:
            return
        if not self._good(result):
            self._ask_at_ns = self._scheduler.now + (0 if self._in_service else _ASK_AGAIN_NS)
            return
        frame = self._frame_of(result)
        if not (frame[0] << 8 | frame[1]) & _CONTROL_REQUESTED:
            if self._in_service:
                self._lose("restart")
            self.drive_restarted()
        if self._in_service:  # a gap in the connection, and the same drive behind it
            self._fresh = frame
            self.stage = Stage.SERVICE
            return
        request = self._config.registers.write_timeout(self._config.monitoring_ms)
        if request is None:
            self._begin()
        else:
            self.stage = Stage.SETTING
            self._submit(request, self._on_set)

    def _on_set(self, result: Result) -> None:
        if self.stage is not Stage.SETTING:
            return
        if self._good(result):
            self._begin()
        else:
            self.stage = Stage.ASKING
            self._ask_at_ns = self._scheduler.now + _ASK_AGAIN_NS

    def _begin(self) -> None:
        self.stage = Stage.SERVICE
        self._misses = [0, 0, 0]
        self.refusal = ""
        self.enter_service()
        self.emit("link.in_service")

    def _on_read(self, result: Result) -> None:
        self._reading = False
        if self.stage is not Stage.SERVICE:
            return
        if not self._good(result):
            return
        self.response_ns = self._scheduler.now - self._asked_ns
        self._fresh = frame = self._frame_of(result)
        if frame[1] & _FAULT:
            self._cycles_of_fault += 1
        else:
            self._cycles_of_fault = self._fault_number = 0  # the next fault may be another one

    def _on_written(self, result: Result) -> None:
        self._writing = False
        if self.stage is Stage.SERVICE:
            self._good(result, _WRITING)

    def _on_inputs(self, result: Result) -> None:
        self._asking_more = False
        if self.stage is Stage.SERVICE and self._good(result, _INPUTS) and result.response is not None:
            self.inputs = sum(1 << bit for bit, value in enumerate(result.response.values) if value)

    def _put_aside(self, request: Request, done: Callable[[Result], object]) -> None:
        self._more = (request, done)

    def _on_more(self, result: Result, done: Callable[[Result], object]) -> None:
        self._asking_more = False
        done(result)

    def _on_fault_number(self, result: Result) -> None:
        self._asking_more = False
        if result.outcome is Outcome.DONE and result.response is not None:
            self._fault_number = result.response.values[0]
        else:
            self._cycles_of_fault = 0  # asked for again in the next cycle

    def _frame_of(self, result: Result) -> bytes:
        return self._config.registers.frame(result.response.values if result.response is not None else ())

    def _good(self, result: Result, kind: int = _READING) -> bool:
        """Count how a request has ended, and say whether it was carried out."""
        misses = self._misses
        if result.outcome is Outcome.DONE:
            misses[kind] = 0
            return True
        code = 0
        if result.outcome is Outcome.EXCEPTION and result.response is not None:
            self.exceptions += 1
            code = result.response.exception
        self.text = result.text
        misses[kind] += 1
        if misses[kind] == 1:  # only the first of a row is reported
            self.emit("link.request_failed", outcome=result.outcome.value, exception=code, text=result.text)
        if not self._in_service:
            if code in _MEANT:
                self.refusal = result.text
        elif misses[kind] >= self._grace:
            self._lose("connection" if result.outcome is Outcome.LOST else result.outcome.value)
        elif result.outcome is Outcome.LOST or (
            misses[_READING] > 1 and result.outcome is not Outcome.EXCEPTION
        ):
            self.stage = Stage.ASKING  # it may have started again meanwhile
        return False

    def _lose(self, reason: str) -> None:
        self.stage = Stage.ASKING
        self._ask_at_ns = 0
        self._misses = [0, 0, 0]
        self._fresh = None
        self.leave_service()
        self.emit("link.node_lost", reason=reason)
        self._more = None
        if self._parameters is not None:
            self._parameters.fail("the drive is lost")
