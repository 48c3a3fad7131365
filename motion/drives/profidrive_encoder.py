"""Port to a PROFIdrive encoder on CANopen: its telegram (81 to 84) in free process data words on PDOs,
latched by SYNC.

Whoever uses the encoder sets `g1_stw` and `acknowledges`, and calls `read` once per bus cycle: it takes the
answer of the last SYNC and sends the words of the next one.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

from typing_extensions import override

from fieldbus.canopen.node_setup import NodeSetup
from fieldbus.errors import ConfigurationError
from fieldbus.profidrive import telegram
from fieldbus.profidrive.formats import from_n2, from_n4
from fieldbus.profidrive.sign_of_life import SignWatch, next_sign
from fieldbus.profidrive.words import G_STW, G_ZSW, SIGN_OF_LIFE_SHIFT, STW2_ENC
from motion.drives._link import GRACE_CYCLES
from motion.drives._telegram_pdos import TelegramPdos
from motion.drives.encoder import EncoderPort
from motion.drives.mark import TelegramMarkSearch

if TYPE_CHECKING:
    from fieldbus.canopen.master import CanopenMaster
    from fieldbus.canopen.node import RemoteNode
    from fieldbus.history import History
    from motion.drives.telegram_block import TelegramBlock

ENCODER_TELEGRAMS: Final = (81, 82, 83, 84)
_CONTROL: Final = int(STW2_ENC.CONTROL_BY_PLC)
_ACKNOWLEDGE: Final = int(STW2_ENC.ACKNOWLEDGE)
_ERROR: Final = int(G_ZSW.ERROR | G_ZSW.PARKING)
_ERRORS: Final = int(G_ZSW.ERROR)
_ACKNOWLEDGE_ERROR: Final = int(G_STW.ACKNOWLEDGE)
_HALF: Final = 1 << 31


@dataclass(frozen=True, kw_only=True)
class EncoderPortConfig:
    """Facts about the encoder that the controller has to know.

    Args:
        telegram: One of `ENCODER_TELEGRAMS`.
        sign_of_life: Whether the encoder works isochronously: both sides watch the counter of the other.
        sign_tolerance: Wrong values of its counter in a row that are tolerated (PD-132).
        grace_cycles: Cycles without data until the link counts as lost.
        absolute_encoder: It keeps its position over power-off.
        reference_speed: What 100 % of the speed stands for, rpm, of a linear encoder m/min.
        acknowledges_errors: Errors of the encoder are acknowledged at once, so that they are gone with
            their cause: for a technology object, which does not know of G1_STW.

    Raises:
        ConfigurationError: There is no such telegram.

    """

    telegram: int = 81
    sign_of_life: bool = True
    sign_tolerance: int = 3
    grace_cycles: int = GRACE_CYCLES
    absolute_encoder: bool = False
    reference_speed: float = 3000.0
    acknowledges_errors: bool = False

    def __post_init__(self) -> None:
        if self.telegram not in ENCODER_TELEGRAMS:
            raise ConfigurationError(
                "encoder.telegram", self.telegram, ", ".join(map(str, ENCODER_TELEGRAMS))
            )


class ProfidriveEncoderPort(EncoderPort):
    """Exchanges the encoder telegram in PDOs.

    Args:
        master: The controller's CANopen services on the segment of the encoder.
        setup: The encoder as a node; nothing is written to it except what is listed there.
        config: Its telegram.
        history: Log for `link.up` and `link.down`; None for none.

    """

    def __init__(
        self,
        master: CanopenMaster,
        setup: NodeSetup,
        config: EncoderPortConfig,
        *,
        history: History | None = None,
    ) -> None:
        super().__init__()
        self.name = setup.name
        self.absolute_encoder = config.absolute_encoder
        self.telegram_number = config.telegram
        self.brings_speed = config.telegram != 81
        self._reference_speed = config.reference_speed
        self.block: TelegramBlock | None = None
        """The data block between telegram and encoder object, if a user program is there."""
        self._master = master
        self._config = config
        self._history = history
        self._telegram = telegram(config.telegram)
        back = self._telegram.actual
        self._place = {name: at for at, name in enumerate(back.names)}
        self._answer: tuple[int, ...] = (0,) * len(back.names)
        self._pdos = TelegramPdos(master, setup.node_id, back.words)
        self._rpdo = 0x200 + setup.node_id
        self.mark = self._search = TelegramMarkSearch()
        self._watch = SignWatch(tolerance=config.sign_tolerance)
        self._sign = 0
        self._sent = (0, 0)
        self._age = config.grace_cycles
        self._in_service = False
        self._read_ns = -1
        self.g1_stw = 0
        """G1_STW of the next cycles."""
        self.acknowledges = False
        """STW2_ENC bit 7 of the next cycles."""
        self.node: RemoteNode = master.add_node(setup, self)
        """The encoder as a node of the network."""

    # -- values
    # -----------------------------------------------------------------------------------------------------

    def actual(self, name: str) -> int:
        """Return a signal of the last answer as the wire has it, such as `G1_ZSW`; words are 0..FFFFh.

        Raises:
            ConfigurationError: The telegram has no such signal.

        """
        at = self._place.get(name)
        if at is None:
            raise ConfigurationError("signal of the telegram", name, ", ".join(self._place))
        return self._answer[at]

    @override
    def telegram_view(self) -> dict[str, int]:
        # What was sent last and the last answer.
        return {
            "STW2_ENC": self._sent[0],
            "G1_STW": self._sent[1],
            **dict(zip(self._place, self._answer, strict=True)),
        }

    @property
    def increments(self) -> int:
        """G1_XIST1 (telegram 84: G1_XIST3), signed."""
        return self.actual("G1_XIST3" if self._config.telegram == 84 else "G1_XIST1")

    @property
    def speed(self) -> float | None:
        """Speed as a share of the reference speed; None: the telegram has none."""
        if "NIST_B" in self._place:
            return from_n4(self.actual("NIST_B"))
        return from_n2(self.actual("NIST_A")) if "NIST_A" in self._place else None

    @override
    def set_reference(self, speed: float) -> None:
        self._reference_speed = speed

    def connect_block(self, block: TelegramBlock) -> TelegramBlock:
        """Put a structure of a `DataBlock` between telegram and encoder object
        (CFG-289); see `ProfidrivePort.connect_block`.

        Raises:
            ConfigurationError: It is that of another telegram.

        """
        name = f"PD_TEL{self.telegram_number}"
        if block.name != name:
            raise ConfigurationError(
                "data block", block.name, f"{name}, the telegram of the encoder (CFG-255)"
            )
        self.block = block
        return block

    # -- calls of the network
    # -------------------------------------------------------------------------------------

    def node_restarted(self) -> None:
        """Take note that the node has booted."""
        self.encoder_restarts += 1

    def node_in_service(self) -> None:
        """Take note that the node is in service."""
        self._in_service = True

    def node_lost(self, reason: str) -> None:
        """Take note that the node is lost."""
        self._in_service = False
        self._pdos.forget()
        self._age = self._config.grace_cycles
        self._watch.reset()
        if self._history is not None:
            kind = "link.heartbeat_lost" if reason == "heartbeat" else "link.node_lost"
            self._history.emit(self.name, kind, reason=reason)

    def node_state(self, state: int) -> None:
        """Take the NMT state of the node."""
        if self._history is not None:
            self._history.emit(self.name, "link.nmt_state", state=int(state))

    def node_emcy(self, code: int) -> None:
        """Take an EMCY of the node."""
        # The words say more.

    # -- cycle
    # ------------------------------------------------------------------------------------------------------

    @override
    def read(self) -> None:
        # Take what the last SYNC has brought, and send the words of the next one.
        now = self._master.scheduler.now
        if now == self._read_ns:
            return  # several technology objects may read one encoder
        self._read_ns = now
        self._take()
        self._give()

    def _take(self) -> None:
        config = self._config
        limit = config.grace_cycles
        frame = self._pdos.take()
        if frame is not None:
            self._answer = answer = self._telegram.actual.unpack(frame)
            sign = answer[0] >> SIGN_OF_LIFE_SHIFT
            if self.block is not None:
                self._answer = answer = self.block.receive(answer)
                sign = answer[0] >> SIGN_OF_LIFE_SHIFT
            good = not config.sign_of_life or (self._watch.step(sign) and sign != 0)
            self.sign_lost = not good
            self._age = 0 if good else limit
            self._show(answer)
        elif self._age < limit:
            self._age += 1
        alive = self._age < limit and self._in_service
        if alive is not self.link_ok:
            self.link_ok = alive
            if self._history is not None:
                self._history.emit(self.name, "link.up" if alive else "link.down")

    def _give(self) -> None:
        self._sign = next_sign(self._sign)
        stw2 = _CONTROL | (_ACKNOWLEDGE if self.acknowledges else 0) | self._sign << SIGN_OF_LIFE_SHIFT
        g1_stw = self.g1_stw or self._search.word
        if self._config.acknowledges_errors and self._answer[1] & _ERRORS:
            g1_stw |= _ACKNOWLEDGE_ERROR
            stw2 |= _ACKNOWLEDGE
        g1_stw &= 0xFFFF
        self._sent = stw2, g1_stw
        if self.block is not None:
            stw2, g1_stw = self.block.send((stw2 & 0x0FFF, g1_stw & 0xFFFF))
        self._master.send(self._rpdo, stw2.to_bytes(2, "little") + g1_stw.to_bytes(2, "little"))

    def _show(self, answer: tuple[int, ...]) -> None:
        self.sensor_fault = bool(answer[1] & _ERROR)
        if self._search.busy:
            self._search.take(answer[1], self.actual("G1_XIST2"))
        if not self.sensor_fault:
            self.encoder_increments = (answer[2] + _HALF) % (2 * _HALF) - _HALF
        if self.brings_speed:
            self.actual_speed_rpm = (self.speed or 0.0) * self._reference_speed
