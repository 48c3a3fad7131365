"""Port to a PROFIdrive axis on CANopen: its telegram in free process data words on PDOs, latched by SYNC.

Four words of the telegram are in a PDO (5800h and following to the drive, 5810h and following from it); one
more TPDO brings digital inputs and the fault number by event.

Delays, with T the bus cycle: the drive samples at SYNC k, the axis calculates half a cycle later, its
telegram is taken over at SYNC k+1, and its setpoints are interpolated by the drive until SYNC k+2.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from struct import Struct
from typing import TYPE_CHECKING, Final, Protocol

from typing_extensions import override

from fieldbus.can.timing import FrameMaker
from fieldbus.canopen.node_setup import PdoSetup
from fieldbus.errors import ConfigurationError, HilError
from fieldbus.profidrive.telegrams import swap_words
from motion.drives._canopen import CanopenNode, CanopenNodeConfig, node_setup, written
from motion.drives._telegram_pdos import WORDS_PER_PDO, TelegramPdos
from motion.drives.profidrive import ProfidrivePort, TelegramConfig, decode_parameter

if TYPE_CHECKING:
    from fieldbus.canopen.master import CanopenMaster
    from fieldbus.canopen.sdo_client import SdoJob
    from fieldbus.history import History

_RECEIVE: Final = 0x5800
_SEND: Final = 0x5810
_STATUS: Final = (0x22D20020, 0x28530010, 0x28540010)
_STATUS_STRUCT: Final = Struct("<IHH")
_PARAMETER: Final = 0x2000


@dataclass(frozen=True, kw_only=True)
class ProfidriveCanConfig(CanopenNodeConfig):
    """Facts about the drive that the controller has to know.

    Args:
        words: The telegram.

    Raises:
        ConfigurationError: A value is out of range, or values do not fit together.

    """

    words: TelegramConfig = field(default_factory=TelegramConfig)

    def __post_init__(self) -> None:
        CanopenNodeConfig.__post_init__(self)
        if self.words.build().actual.words > 12 and self.node_id > 0x5F:
            raise ConfigurationError("drive.node_id", self.node_id, "1..95 with a telegram of four TPDOs")


class ControlSteps(Protocol):
    """What stands between the control word of the axis and that of the telegram."""

    def word(self, stw1: int, *, link_ok: bool, zsw1: int) -> int:
        """Return control word 1 of the telegram.

        Args:
            stw1: Control word 1 of the axis.
            link_ok: Telegrams of the device arrive.
            zsw1: Its last status word 1.

        """


class ProfidriveCanPort(ProfidrivePort):
    """Exchanges the telegram in PDOs, four words in each.

    Args:
        master: The controller's CANopen services on the segment of the drive.
        config: Facts about the drive.
        name: Name of the drive in the history.
        history: Log for link and drive events; None for none.
        steps: What makes the control word of the telegram of that of the axis; None = it is the same.
        delay_cycles: Time from a setpoint to the actual value that it makes, bus cycles: 2 where the device
            interpolates its setpoints over a cycle, 1.5 where they act at once.

    """

    __slots__ = (
        "_delay_ns",
        "_master",
        "_pdos",
        "_rpdos",
        "_steps",
        "node",
        "node_id",
    )  # fmt: skip

    def __init__(
        self,
        master: CanopenMaster,
        config: ProfidriveCanConfig,
        *,
        name: str = "drive",
        history: History | None = None,
        steps: ControlSteps | None = None,
        delay_cycles: float = 2.0,
    ) -> None:
        super().__init__(config, config.words, name=name, history=history)
        self._steps = steps
        self._delay_ns = int(config.cycle_ns * delay_cycles)
        self.node_id = node = config.node_id
        self.has_parameters = True
        self._master = master
        self._cut()
        self._pdos = TelegramPdos(master, node, self.telegram.actual.words)
        master.subscribe(self._status_id(), self._on_status)
        setup = node_setup(name, config, controller=master.node_id, disable=_RECEIVE, pdos=self._pdo_setups())
        self.node = CanopenNode(self, master, setup).remote
        """The drive as a node of the network."""

    def _cut(self) -> None:
        """Lay down how words become PDOs."""
        out = self.telegram.setpoint
        size = 2 * WORDS_PER_PDO
        self._rpdos = tuple(
            (FrameMaker(0x200 + 0x100 * number + self.node_id), at, min(at + size, out.length))
            for number, at in enumerate(range(0, out.length, size))
        )

    @property
    @override
    def delay_ns(self) -> int:
        return self._delay_ns

    def _status_id(self) -> int:
        return (0x480 if len(self._pdos) < 4 else 0x680) + self.node_id

    def _pdo_setups(self) -> tuple[PdoSetup, ...]:
        node = self.node_id
        receive = _mappings(_RECEIVE, self.telegram.setpoint.words)
        send = _mappings(_SEND, self.telegram.actual.words)
        return (
            *(PdoSetup(False, n + 1, 0x200 + 0x100 * n + node, 1, words) for n, words in enumerate(receive)),
            *(PdoSetup(False, n + 1, 0x200 + 0x100 * n + node) for n in range(len(receive), 4)),
            *(PdoSetup(True, n + 1, 0x180 + 0x100 * n + node, 1, words) for n, words in enumerate(send)),
            # TPDOs that the telegram does not need are off before the status takes the identifier of one.
            *(PdoSetup(True, n + 1, 0x180 + 0x100 * n + node) for n in range(len(send), 4)),
            PdoSetup(True, 5, self._status_id(), 255, _STATUS),
        )

    # -- calls of the network
    # -------------------------------------------------------------------------------

    @override
    def leave_service(self) -> None:
        ProfidrivePort.leave_service(self)
        self._pdos.forget()

    def take_emcy(self, code: int) -> None:
        """Take the code of an EMCY of the drive."""
        # The fault number says more than the EMCY.

    def parameters(self) -> list[tuple[int, int, int]]:
        """Return what commissioning may write, in order: (index, sub-index, value)."""
        return written(self.node)

    @override
    def read_parameter(self, number: int, index: int, answer: Callable[[float | None, str], object]) -> None:
        # Object 2000h + number (PD-343).

        def ended(job: SdoJob) -> None:
            if job.ok:
                answer(decode_parameter(number, job.data), "")
            else:
                answer(None, f"{_PARAMETER + number:04X}h:{index}: {job.reason}")

        self._master.sdo(self.node_id).upload(_PARAMETER + number, index, ended)

    # -- bus events
    # -------------------------------------------------------------------------------------------

    def _on_status(self, data: bytes, _time_ns: int) -> None:
        if len(data) == _STATUS_STRUCT.size:
            self.inputs, self._fault_number, _ = _STATUS_STRUCT.unpack(data)

    # -- cycle
    # ------------------------------------------------------------------------------------------------

    @override
    def read(self) -> None:
        self._take(self._pdos.take())

    @override
    def write(self, stw1: int, speed_rpm: float, torque_nm: float = 0.0) -> None:
        if self._steps is not None:
            stw1 = self._steps.word(stw1, link_ok=self.link_ok, zsw1=self.zsw1)
        frame = self._compose(stw1, speed_rpm, torque_nm)
        if frame is not None:
            self._send(frame)

    def write_words(self, row: Sequence[int]) -> None:
        """Send a telegram of these signals, in their order."""
        frame = self.compose_words(row)
        if frame is not None:
            self._send(frame)

    def _send(self, frame: bytes) -> None:
        # Of an odd length only as a test wants it.
        data = swap_words(frame[:-1] if len(frame) & 1 else frame)
        self._master.send_all([maker.make(data[begin:end]) for maker, begin, end in self._rpdos])

    def release(self) -> None:
        """Disable the drive with a last telegram, which acts at the next SYNC."""
        try:
            self._send(self._compose_release())
        except HilError:
            return  # the bus is gone already


def _mappings(first: int, words: int) -> list[tuple[int, ...]]:
    entries = [(first + word) << 16 | 0x10 for word in range(words)]
    return [tuple(entries[at : at + WORDS_PER_PDO]) for at in range(0, words, WORDS_PER_PDO)]
