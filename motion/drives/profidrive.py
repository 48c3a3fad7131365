"""The controller's side of a PROFIdrive telegram, whatever carries it.

Control and status word, encoder words, torque words are those of the axis itself and pass through. A port
over a bus takes answers with `_take` and sends what `_compose` returns.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from struct import Struct
from typing import TYPE_CHECKING, Final, Literal

from typing_extensions import override

from fieldbus.errors import ConfigurationError
from fieldbus.profidrive import Telegram, pto_telegram, telegram
from fieldbus.profidrive.formats import N2_ONE, N4_ONE, from_n2, to_kpc, to_n2, to_n4
from fieldbus.profidrive.sign_of_life import SignWatch, next_sign
from fieldbus.profidrive.words import G_STW, G_ZSW, MELDW, SIGN_OF_LIFE_SHIFT, STW1
from motion.drives._link import LinkConfig, LinkedPort
from motion.drives.data_block import JoinedBlocks
from motion.drives.mark import TelegramSearches
from motion.drives.telegram_block import TelegramBlock

if TYPE_CHECKING:
    from fieldbus.history import History

POSITIONING_TELEGRAMS: Final = (3, 4, 5, 6, 102, 103, 105, 106)
"""Telegrams with setpoint and encoder value (CFG-196)."""
SPEED_TELEGRAMS: Final = (1, 2, *POSITIONING_TELEGRAMS)
"""Telegrams of a speed axis (CFG-195)."""

WORD_TELEGRAMS: Final = (7, 9, 20, 110, 111)
"""Telegrams that no axis uses: a test leads the drive by their words."""

_FLOATING: Final = frozenset((341, 1082, 1498, 2000, 2003))
_FLOAT: Final = Struct("<f")

_CONTROL: Final = int(STW1.CONTROL_BY_PLC)
_ACKNOWLEDGE: Final = int(STW1.ACKNOWLEDGE)
_ERROR: Final = int(G_ZSW.ERROR)
_ENCODER_ERROR: Final = int(G_ZSW.ERROR | G_ZSW.PARKING)
_ENCODER_ACKNOWLEDGE: Final = int(G_STW.ACKNOWLEDGE)
_PROBES: Final = 2
"""Probes that the encoder interface of an axis can have."""
_TORQUE_BELOW_THRESHOLD: Final = int(MELDW.TORQUE_BELOW_THRESHOLD)
_FREE_WORDS: Final = ("G2_STW", "S_STW1B", "S_STW3B")
_XERR_MAX: Final = 0x7FFFFFFF

TelegramSeam = Callable[[bytes], bytes | None]
"""Gets a telegram between profile and bus; returns what passes on in its place, None for nothing."""


def decode_parameter(number: int, data: bytes) -> float | None:
    """Return the value of a parameter that came as an object of its own, low byte
    first; None for what is no number.

    Args:
        number: PROFIdrive number; it says which ones are floating point.
        data: What was read.

    """
    if number in _FLOATING:
        return float(_FLOAT.unpack(data)[0]) if len(data) == _FLOAT.size else None
    return int.from_bytes(data, "little") if 1 <= len(data) <= 4 else None


@dataclass(frozen=True, kw_only=True)
class TelegramConfig:
    """The telegram of a drive and what its words mean.

    Args:
        telegram: Number of the telegram, one of `SPEED_TELEGRAMS` or `WORD_TELEGRAMS`.
        torque_telegram: Whether 750 follows it.
        safety_telegram: 700 or 701, the safety information channel, follows them; None = neither.
        reference_speed_rpm: p2000.
        reference_torque_nm: p2003.
        sign_of_life: Whether both sides watch the counter of the other (CFG-192).
        sign_tolerance: Wrong values of the drive's counter in a row that are tolerated (PD-132).
        isochronous: Whether the drive works in the clock of the bus: without it there is no dynamic servo
            control (PD-198).
        pulse_module: Telegram 3 of a pulse module: `device` with a 16-bit setpoint, `standard` with one of 32
            bits, STW2 0 in both; None = a PROFIdrive axis.

    Raises:
        ConfigurationError: The telegram is none of these, or has no sign of life.

    """

    telegram: int = 3
    torque_telegram: bool = False
    safety_telegram: int | None = None
    reference_speed_rpm: float = 3000.0
    reference_torque_nm: float = 2.0
    sign_of_life: bool = True
    sign_tolerance: int = 3
    isochronous: bool = True
    pulse_module: Literal["device", "standard"] | None = None

    def __post_init__(self) -> None:
        if self.pulse_module is not None:
            self._check_pulse_module()
            return
        known = (*SPEED_TELEGRAMS, *WORD_TELEGRAMS)
        if self.telegram not in known:
            raise ConfigurationError("drive.telegram", self.telegram, ", ".join(map(str, sorted(known))))
        if self.sign_of_life and not self.build().isochronous:
            raise ConfigurationError("drive.telegram", self.telegram, "one with a sign of life (CFG-190)")

    def _check_pulse_module(self) -> None:
        facts = (
            ("telegram", self.telegram, 3),
            ("torque_telegram", self.torque_telegram, False),
            ("sign_of_life", self.sign_of_life, False),
        )
        for name, value, needed in facts:
            if value != needed:
                raise ConfigurationError(f"pulse module, {name}", value, str(needed))
        if self.pulse_module not in ("device", "standard"):
            raise ConfigurationError("pulse module, variant", self.pulse_module, "device, standard")

    def build(self) -> Telegram:
        """Return the telegram, with its supplements."""
        if self.pulse_module == "device":
            return pto_telegram()
        chosen = telegram(self.telegram)
        if self.torque_telegram:
            chosen = chosen.with_supplement()
        return chosen if self.safety_telegram is None else chosen.with_supplement(self.safety_telegram)


class ProfidrivePort(LinkedPort):
    """Base of the ports to a PROFIdrive axis; a bus adds `read`, `write` and `release`.

    Args:
        link: What holds for the drive on any bus.
        words: Its telegram.
        name: Name of the drive in the history.
        history: Log for link and drive events; None for none.

    """

    __slots__ = (
        "_add_at",
        "_answer",
        "_blocks",
        "_fault_number",
        "_g1_at",
        "_g1_zsw_at",
        "_gain_per_s",
        "_kpc",
        "_kpc_at",
        "_kpc_of_gain",
        "_m_act_at",
        "_meldw_at",
        "_momred_at",
        "_narrow",
        "_nist_at",
        "_nsoll_at",
        "_pack",
        "_place",
        "_probe_levels",
        "_range_at",
        "_reference_speed",
        "_reference_torque",
        "_row",
        "_searches",
        "_sign",
        "_speed_scale",
        "_stw2_at",
        "_unpack",
        "_watch",
        "_watches",
        "_words",
        "_xerr",
        "_xerr_at",
        "_xist2_at",
        "_xist_at",
        "_zsw2_at",
        "actual_seam",
        "block",
        "clearings",
        "setpoint_seam",
        "telegram",
    )

    absolute_from_zero = True

    def __init__(
        self, link: LinkConfig, words: TelegramConfig, *, name: str, history: History | None
    ) -> None:
        super().__init__(link, name=name, history=history)
        self._words = words
        self.telegram = words.build()
        """Layout of both directions."""
        self.dsc = self.telegram.dsc and words.sign_of_life and words.isochronous
        self.telegram_number = words.telegram
        self._blocks: TelegramBlock | JoinedBlocks
        self.block: TelegramBlock | None = None
        """The data block between telegram and axis, if a user program is there (CFG section 13)."""
        self._compile()
        self.set_reference(words.reference_speed_rpm, words.reference_torque_nm)
        self._watch = SignWatch(tolerance=words.sign_tolerance)
        self._watches = words.sign_of_life
        self._sign = 0
        self._xerr = self._kpc = 0
        self._gain_per_s = 0.0
        self._kpc_of_gain = 0
        self._fault_number = 0
        self.setpoint_seam: TelegramSeam | None = None
        """Stands between this port and the bus, for every telegram to the drive; None: nothing does."""
        self.actual_seam: TelegramSeam | None = None
        """The same for every telegram from the drive."""

    @property
    def watches_sign_of_life(self) -> bool:
        """Whether both sides watch the counter of the other."""
        return self._words.sign_of_life

    def _compile(self) -> None:
        """Find the place of every signal; what the telegram lacks is -1."""
        out, back = self.telegram.setpoint, self.telegram.actual
        self._pack = out.pack
        self._unpack = back.unpack
        place = {name: at for at, name in enumerate(out.names)}
        self._narrow = "NSOLL_A" in place
        self._row = [0] * len(out.names)
        self.clearings = 0
        """How often all words that are sent were set to zero: those of `command` have to be given again."""
        self._place_outputs(place)
        self._xerr_at = place.get("XERR", -1)
        self._kpc_at = place.get("KPC", -1)
        self._add_at = place.get("M_ADD1", -1)
        self._range_at = (place.get("M_LIMIT_POS", -1), place.get("M_LIMIT_NEG", -1))
        self._momred_at = place.get("MOMRED", -1)
        self.speaks_telegram = True
        self.has_torque_data = self._add_at >= 0
        self.has_torque_reduction = self._momred_at >= 0
        self.set_torque_range(1.0, -1.0)
        place = {name: at for at, name in enumerate(back.names)}
        self._nist_at = place.get("NIST_A" if self._narrow else "NIST_B", -1)
        self._zsw2_at = place.get("ZSW2", -1)
        self._g1_zsw_at = place.get("G1_ZSW", -1)
        self._xist_at = place.get("G1_XIST1", -1)
        self._xist2_at = place.get("G1_XIST2", -1)
        self._m_act_at = place.get("M_ACT", -1)
        self._meldw_at = place.get("MELDW", -1)
        has_encoder = self._xist2_at >= 0 and self._g1_at >= 0
        self._searches = TelegramSearches(_PROBES) if has_encoder else None
        self._probe_levels = 0
        if self._searches is not None:
            self.mark, self.probes = self._searches.mark, self._searches.probes
        self._place = place
        self._answer: tuple[int, ...] = (0,) * len(back.names)

    def _place_outputs(self, place: dict[str, int]) -> None:
        """Find the words of every cycle; those that are missing in `place` stay as they are."""
        self._nsoll_at = place.get("NSOLL_A" if self._narrow else "NSOLL_B", -1)
        # The sign of life of a pulse module has to be 0, in the standard variant too.
        self._stw2_at = place.get("STW2", -1) if self._words.pulse_module is None else -1
        self._g1_at = place.get("G1_STW", -1)

    @override
    def probe_level(self, number: int) -> bool | None:
        # A telegram shows it only while it measures; what it showed before says nothing.
        searches = self._searches
        if searches is None or not searches.current.busy:
            return None
        return bool(self._probe_levels >> number - 1 & 1)

    @override
    def set_reference(self, speed_rpm: float, torque_nm: float) -> None:
        self._reference_speed = speed_rpm
        self._reference_torque = torque_nm
        self._speed_scale = speed_rpm / (N2_ONE if self._narrow else N4_ONE)

    @override
    def switch_outputs(self, on: bool) -> None:
        # Every word is 0, so that the drive misses the sign of life of its controller.
        place = {name: at for at, name in enumerate(self.telegram.setpoint.names)} if on else {}
        self._place_outputs(place)
        self._row[:] = [0] * len(self._row)
        self.clearings += 1
        # Nor does the drive answer with a sign of life then, and its values count all the same (MC-632).
        self._watches = on and self._words.sign_of_life
        self._watch.reset()
        if on:
            self.set_torque_range(1.0, -1.0)
        if self.block is not None:
            self._blocks.suspend(not on)

    def connect_block(
        self, block: TelegramBlock | None = None, torque: TelegramBlock | None = None
    ) -> TelegramBlock:
        """Put a data block between telegram and axis; from now on the user program
        keeps the sign of life (CFG-260).

        Args:
            block: Structure of a `DataBlock`; None = one of its own with all words.
            torque: Structure `PD_TEL750` for the words of the supplement; None = they are in `block`.

        Raises:
            ConfigurationError: A structure is that of another telegram, or has not as many words.

        """
        own = TelegramBlock(self.telegram)
        self.block = block = own if block is None else block
        self._blocks = blocks = block if torque is None else JoinedBlocks(block, torque)
        if block.name != own.name:
            raise ConfigurationError(
                "data block", block.name, f"{own.name}, the telegram of the drive (CFG-255)"
            )
        if torque is not None and torque.name != "PD_TEL750":
            raise ConfigurationError("data block of the torque data", torque.name, "PD_TEL750 (CFG-405)")
        if tuple(blocks.names) != (*own.Input, *own.Output):
            allowed = "together with PD_TEL750" if torque is None else "without one for torque data"
            raise ConfigurationError("data block", block.name, f"{allowed}: as the drive has its telegrams")
        self.has_parameters = False
        return block

    # -- calls of the bus
    # -------------------------------------------------------------------------------------

    @override
    def drive_restarted(self) -> None:
        LinkedPort.drive_restarted(self)
        self._fault_number = 0

    @override
    def fault_text(self) -> str:
        """Return the fault of the drive in words, `drive fault 7936`: its numbers are decimal."""
        return f"drive fault {self.drive_fault_code}" if self.drive_fault_code else "drive fault"

    @override
    def leave_service(self) -> None:
        LinkedPort.leave_service(self)
        self._watch.reset()

    # -- cycle
    # --------------------------------------------------------------------------------------------------

    def _take(self, frame: bytes | None) -> None:
        """Take the answer of this cycle, words with the high byte first; None: there is none.

        One of a wrong length is not taken over (PD-030).
        """
        if frame is not None and self.actual_seam is not None:
            frame = self.actual_seam(frame)
        if frame is None or len(frame) != self.telegram.actual.length:
            alive = self._judge(fresh=False)
        else:
            self._answer = answer = self._unpack(frame)
            valid = True
            if self._watches and self.block is None:
                sign = answer[self._zsw2_at] >> SIGN_OF_LIFE_SHIFT
                valid = self._watch.step(sign) and sign != 0
                self.sign_lost = not valid
            alive = self._judge(True, valid)
        if self.block is not None:
            answer = self._blocks.receive(self._answer)
            if alive:
                self._show(answer)
        elif alive:
            self._show(self._answer)

    def _show(self, answer: tuple[int, ...]) -> None:
        self.zsw1 = zsw1 = answer[0]
        if self._nist_at >= 0:
            self.actual_speed_rpm = answer[self._nist_at] * self._speed_scale
        if self._m_act_at >= 0:
            self.actual_torque_nm = from_n2(answer[self._m_act_at]) * self._reference_torque
        if self._meldw_at >= 0:
            self.torque_limit_reached = not answer[self._meldw_at] & _TORQUE_BELOW_THRESHOLD
        self.drive_fault_code = self._fault_number if zsw1 & 0x0008 else 0
        if self._xist_at >= 0:
            g1_zsw = answer[self._g1_zsw_at]
            self.sensor_fault = bool(g1_zsw & _ENCODER_ERROR)
            self.sensor_code = answer[self._xist2_at] & 0xFFFF_FFFF if g1_zsw & _ERROR else 0
            if not self.sensor_fault:
                self.encoder_increments = answer[self._xist_at]
            searches = self._searches
            if searches is not None and searches.current.busy:
                self._probe_levels = g1_zsw >> 8 & 3
                searches.take(g1_zsw, answer[self._xist2_at])

    def command(self, name: str, value: int) -> None:
        """Send a word that the axis does not use itself in every telegram from now on: G2_STW, S_STW1B,
        S_STW3B; 0..FFFFh.

        Raises:
            ConfigurationError: It is none of them, or the telegram does not have it, or the value is no word.

        """
        names = self.telegram.setpoint.names
        free = [one for one in _FREE_WORDS if one in names]
        if name not in free:
            raise ConfigurationError("word of the telegram", name, ", ".join(free) or "none in this telegram")
        if not 0 <= value <= 0xFFFF:
            raise ConfigurationError(name, value, "0..65535")
        self._row[names.index(name)] = value

    def actual(self, name: str) -> int:
        """Return a signal of the last answer as the wire has it, such as `S_ZSW1B`; words are 0..FFFFh.

        Raises:
            ConfigurationError: The telegram has no such signal.

        """
        at = self._place.get(name)
        if at is None:
            raise ConfigurationError("signal of the telegram", name, ", ".join(self._place))
        return self._answer[at]

    @override
    def telegram_view(self) -> dict[str, int]:
        sent = zip(self.telegram.setpoint.names, self._row, strict=True)
        return {**dict(sent), **dict(zip(self.telegram.actual.names, self._answer, strict=True))}

    @override
    def control_position(self, deviation_increments: float, gain_per_s: float) -> None:
        # XERR and KPC.
        if not -_XERR_MAX <= deviation_increments <= _XERR_MAX:
            deviation_increments = min(max(deviation_increments, -_XERR_MAX), _XERR_MAX)
        self._xerr = round(deviation_increments)
        if gain_per_s != self._gain_per_s:
            self._gain_per_s = gain_per_s
            self._kpc_of_gain = to_kpc(gain_per_s)
        self._kpc = self._kpc_of_gain

    @override
    def set_torque_range(self, upper: float, lower: float) -> None:
        # M_LIMIT_POS and M_LIMIT_NEG.
        if self.has_torque_data:
            for at, share in zip(self._range_at, (upper, lower), strict=True):
                self._row[at] = to_n2(share)

    @override
    def limit_torque(self, share: float | None) -> None:
        # MOMRED, where 4000h takes everything away (STP-136).
        if self.has_torque_reduction:
            self._row[self._momred_at] = 0 if share is None else round((1.0 - share) * N2_ONE)

    def _compose(self, stw1: int, speed_rpm: float, torque_nm: float) -> bytes | None:
        """Return the telegram of this cycle, of any length where a test
        disturbs it; None: nothing is sent.
        """
        row = self._row
        row[0] = stw1
        if self._nsoll_at >= 0:
            share = speed_rpm / self._reference_speed
            row[self._nsoll_at] = to_n2(share) if self._narrow else to_n4(share)
        if self._stw2_at >= 0:
            self._sign = sign = next_sign(self._sign)
            row[self._stw2_at] = sign << SIGN_OF_LIFE_SHIFT | self.stw2
        if self._g1_at >= 0:
            acknowledges = stw1 & _ACKNOWLEDGE and self.sensor_fault
            row[self._g1_at] = (
                _ENCODER_ACKNOWLEDGE
                if acknowledges
                else 0
                if self._searches is None
                else self._searches.current.word
            )
        if self.dsc:
            row[self._xerr_at] = self._xerr
            row[self._kpc_at] = self._kpc
            self._xerr = self._kpc = 0
        if self._add_at >= 0:
            row[self._add_at] = to_n2(torque_nm / self._reference_torque)
        if self.block is None:
            frame = self._pack(*row)
        else:
            if self._stw2_at >= 0:
                row[self._stw2_at] = self.stw2
            frame = self._pack(*self._blocks.send(row))
        return frame if self.setpoint_seam is None else self.setpoint_seam(frame)

    def compose_words(self, row: Sequence[int]) -> bytes | None:
        """Return a telegram of these signals, in their order; the sign of life is added where both sides
        watch it.
        """
        words = list(row)
        if self._stw2_at >= 0 and self._words.sign_of_life:
            self._sign = next_sign(self._sign)
            words[self._stw2_at] = words[self._stw2_at] & 0x0FFF | self._sign << SIGN_OF_LIFE_SHIFT
        frame = self._pack(*words)
        return frame if self.setpoint_seam is None else self.setpoint_seam(frame)

    def _compose_release(self) -> bytes:
        """Return a last telegram, which disables the drive: nobody will lead it any more."""
        row = self._row
        row[:] = [0] * len(row)
        row[0] = _CONTROL
        if self._stw2_at >= 0:
            self._sign = next_sign(self._sign)
            row[self._stw2_at] = self._sign << SIGN_OF_LIFE_SHIFT
        return self._pack(*row)
