"""Port to a PROFIdrive axis on CANopen: its telegram in free process data words on PDOs, latched by SYNC.

Control and status word, encoder words, torque words are those of the axis itself and pass through. Four words of the
telegram stand in a PDO (5800h and following to the drive, 5810h and following from it); one more TPDO brings digital inputs
and the fault number by event. `setup` says how the drive has to be configured; the network sees to that.

Delays, with T the bus cycle: the drive samples at SYNC k, the axis calculates half a cycle later, its telegram is taken over
at SYNC k+1, and its setpoints are interpolated by the drive until SYNC k+2.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from struct import Struct
from typing import TYPE_CHECKING, Final

from fieldbus.canopen.node_setup import NodeSetup, Parameter, PdoSetup
from fieldbus.errors import ConfigurationError, HilError
from fieldbus.history import History
from fieldbus.profidrive import Telegram, telegram
from fieldbus.profidrive.formats import N2_ONE, N4_ONE, from_n2, to_kpc, to_n2, to_n4
from fieldbus.profidrive.sign_of_life import SignWatch, next_sign
from fieldbus.profidrive.words import G_STW, G_ZSW, SIGN_OF_LIFE_SHIFT, STW1
from motion.drives.port import DrivePort

if TYPE_CHECKING:
    from fieldbus.canopen.master import CanopenMaster
    from fieldbus.canopen.node import RemoteNode

POSITIONING_TELEGRAMS: Final = (3, 4, 5, 6, 102, 103, 105, 106)
"""Telegrams with setpoint and encoder value (CFG-196)."""
SPEED_TELEGRAMS: Final = (1, 2, *POSITIONING_TELEGRAMS)
"""Telegrams of a speed axis (CFG-195)."""

GRACE_CYCLES: Final = 3
"""Cycles without an actual value after which the link counts as lost."""

_RECEIVE: Final = 0x5800
_SEND: Final = 0x5810
_STATUS: Final = (0x22D20020, 0x28530010, 0x28540010)
_STATUS_STRUCT: Final = Struct("<IHH")
_WORDS_PER_PDO: Final = 4
_CONTROL: Final = int(STW1.CONTROL_BY_PLC)
_ACKNOWLEDGE: Final = int(STW1.ACKNOWLEDGE)
_ENCODER_ERROR: Final = int(G_ZSW.ERROR | G_ZSW.PARKING)
_ENCODER_ACKNOWLEDGE: Final = int(G_STW.ACKNOWLEDGE)
_XERR_MAX: Final = 0x7FFFFFFF


@dataclass(slots=True, frozen=True)
class ProfidrivePortConfig:
    """Facts about the drive that the controller has to know.

    Args:
        node_id: CANopen node, 1..127.
        cycle_ns: Bus cycle (SYNC period), ns.
        telegram: Number of the telegram, one of `SPEED_TELEGRAMS`.
        torque_telegram: Whether 750 follows it.
        reference_speed_rpm: p2000.
        reference_torque_nm: p2003.
        absolute_encoder: The encoder keeps its position over power-off.
        sign_of_life: Whether the drive works isochronously: both sides watch the counter (CFG-192).
        sign_tolerance: Wrong values of the drive's counter in a row that are tolerated (PD-132).
        heartbeat_ms: Heartbeat of drive and controller; 0 switches it off.
        consumer_heartbeat_ms: Time after which either side reports the other's heartbeat as lost.
        abort_connection: 6007h, the drive's reaction to lost communication.
        grace_cycles: Cycles without data until the link counts as lost.
        guard_time_ms: Period of node guarding, for drives without heartbeat; 0 = none.
        life_time_factor: Guard times without an answer after which either side reports the other as lost.
        vendor_id: Expected 1018h:1; None = any. Likewise `product_code`, `revision`, `serial`.
        store: Have the drive keep the parameters (1010h).
        optional: The network is ready without this drive.

    Raises:
        ConfigurationError: A value is out of range, or values do not fit together.

    """

    node_id: int
    cycle_ns: int
    telegram: int = 3
    torque_telegram: bool = False
    reference_speed_rpm: float = 3000.0
    reference_torque_nm: float = 2.0
    absolute_encoder: bool = False
    sign_of_life: bool = True
    sign_tolerance: int = 3
    heartbeat_ms: int = 100
    consumer_heartbeat_ms: int = 250
    abort_connection: int = 3
    grace_cycles: int = GRACE_CYCLES
    guard_time_ms: int = 0
    life_time_factor: int = 3
    vendor_id: int | None = None
    product_code: int | None = None
    revision: int | None = None
    serial: int | None = None
    store: bool = True
    optional: bool = False

    def __post_init__(self) -> None:
        if not 1 <= self.node_id <= 127:
            raise ConfigurationError("drive.node_id", self.node_id, "1..127")
        if self.cycle_ns <= 0 or self.cycle_ns % 1_000_000:
            raise ConfigurationError("cycle", f"{self.cycle_ns} ns", "a whole number of milliseconds")
        if self.telegram not in SPEED_TELEGRAMS:
            raise ConfigurationError(
                "drive.telegram", self.telegram, ", ".join(map(str, sorted(SPEED_TELEGRAMS)))
            )
        words = self.build_telegram()
        if self.sign_of_life and not words.isochronous:
            raise ConfigurationError("drive.telegram", self.telegram, "one with a sign of life (CFG-190)")
        if words.actual.words > 12 and self.node_id > 0x5F:
            raise ConfigurationError("drive.node_id", self.node_id, "1..95 with a telegram of four TPDOs")

    def build_telegram(self) -> Telegram:
        """Return the telegram, with its supplement."""
        chosen = telegram(self.telegram)
        return chosen.with_supplement() if self.torque_telegram else chosen


class ProfidrivePort(DrivePort):
    """See the module.

    Args:
        master: The controller's CANopen services on the segment of the drive.
        config: Facts about the drive.
        name: Name of the drive in the history.
        history: Log for link and drive events; None for none.

    """

    __slots__ = (
        "_add_at", "_all_seen", "_answer", "_config", "_encoder_ack", "_fault_number", "_from_words", "_g1_at", "_g1_zsw_at",
        "_history", "_in_service", "_kpc", "_kpc_at", "_link_age", "_m_act_at", "_master", "_narrow", "_nist_at", "_nsoll_at",
        "_pack", "_parts", "_row", "_rpdo_ids", "_rpdo_slices", "_seen", "_sign", "_speed_scale", "_stw2_at", "_to_words",
        "_unpack", "_watch", "_xerr", "_xerr_at", "_xist_at", "_zsw2_at",  "name", "node", "node_id", "telegram",
    )  # fmt: skip

    def __init__(
        self,
        master: CanopenMaster,
        config: ProfidrivePortConfig,
        *,
        name: str = "drive",
        history: History | None = None,
    ) -> None:
        super().__init__()
        self.name = name
        self.node_id = node = config.node_id
        self.absolute_encoder = config.absolute_encoder
        self._config = config
        self._history = history
        self._master = master
        self.telegram = config.build_telegram()
        self.dsc = self.telegram.dsc and config.sign_of_life
        self._compile()
        self._speed_scale = config.reference_speed_rpm / (N2_ONE if self._narrow else N4_ONE)
        self._watch = SignWatch(tolerance=config.sign_tolerance)
        self._sign = 0
        self._seen = 0
        self._xerr = self._kpc = 0
        self._encoder_ack = False
        self._in_service = False
        self._fault_number = 0
        self._link_age = config.grace_cycles
        for number in range(len(self._parts)):
            master.subscribe(0x180 + 0x100 * number + node, self._receiver(number))
        master.subscribe(self._status_id(), self._on_status)
        self.node: RemoteNode = master.add_node(self.setup(), self)
        """The drive as a node of the network."""

    def _compile(self) -> None:
        """Find the place of every signal, and how words become PDOs; what the telegram lacks is -1."""
        out, back = self.telegram.setpoint, self.telegram.actual
        self._pack = out.pack
        self._unpack = back.unpack
        self._to_words = (Struct(f">{out.words}H"), Struct(f"<{out.words}H"))
        self._from_words = (Struct(f"<{back.words}H"), Struct(f">{back.words}H"))
        place = {name: at for at, name in enumerate(out.names)}
        self._narrow = "NSOLL_A" in place
        self._row = [0] * len(out.names)
        self._nsoll_at = place["NSOLL_A" if self._narrow else "NSOLL_B"]
        self._stw2_at = place.get("STW2", -1)
        self._g1_at = place.get("G1_STW", -1)
        self._xerr_at = place.get("XERR", -1)
        self._kpc_at = place.get("KPC", -1)
        self._add_at = place.get("M_ADD1", -1)
        if self._add_at >= 0:
            self._row[place["M_LIMIT_POS"]] = 0x7FFF
            self._row[place["M_LIMIT_NEG"]] = -0x8000
        place = {name: at for at, name in enumerate(back.names)}
        self._nist_at = place["NIST_A" if self._narrow else "NIST_B"]
        self._zsw2_at = place.get("ZSW2", -1)
        self._g1_zsw_at = place.get("G1_ZSW", -1)
        self._xist_at = place.get("G1_XIST1", -1)
        self._m_act_at = place.get("M_ACT", -1)
        size = 2 * _WORDS_PER_PDO
        self._rpdo_ids = tuple(
            0x200 + 0x100 * number + self.node_id for number in range(-(-out.length // size))
        )
        self._rpdo_slices = tuple(
            slice(size * number, min(size * number + size, out.length))
            for number in range(len(self._rpdo_ids))
        )
        parts = -(-back.length // size)
        self._parts = [bytes(min(size, back.length - size * number)) for number in range(parts)]
        self._all_seen = (1 << parts) - 1
        self._answer: tuple[int, ...] = (0,) * len(back.names)

    # -- configuration ----------------------------------------------------------------------------------------

    def _status_id(self) -> int:
        return (0x480 if len(self._parts) < 4 else 0x680) + self.node_id

    def setup(self) -> NodeSetup:
        """Return what the drive has to be and how it has to be configured."""
        c = self._config
        return NodeSetup(
            node_id=c.node_id,
            name=self.name,
            vendor_id=c.vendor_id,
            product_code=c.product_code,
            revision=c.revision,
            serial=c.serial,
            prepare=(Parameter(_RECEIVE, 0, 0, 2),),
            pdos=self._pdos(),
            parameters=self._parameters(),
            store=c.store,
            heartbeat_timeout_ms=c.consumer_heartbeat_ms if c.heartbeat_ms else 0,
            guard_time_ms=c.guard_time_ms,
            life_time_factor=c.life_time_factor,
            optional=c.optional,
        )

    def _pdos(self) -> tuple[PdoSetup, ...]:
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

    def _parameters(self) -> tuple[Parameter, ...]:
        c = self._config
        heartbeat = self._master.node_id << 16 | c.consumer_heartbeat_ms if c.heartbeat_ms else 0
        rows = [
            (0x1006, 0, c.cycle_ns // 1000, 4),
            (0x6007, 0, c.abort_connection, 2),
            (0x1017, 0, c.heartbeat_ms, 2),
            (0x1016, 1, heartbeat, 4),
        ]
        if c.guard_time_ms:
            rows += [(0x100C, 0, c.guard_time_ms, 2), (0x100D, 0, c.life_time_factor, 1)]
        return tuple(Parameter(*row) for row in rows)

    def parameters(self) -> list[tuple[int, int, int]]:
        """Return what commissioning may write, in order: (index, sub-index, value)."""
        return [(index, sub, value) for index, sub, value, _ in self.node.setup.everything()]

    # -- what the network tells -------------------------------------------------------------------------------

    def node_restarted(self) -> None:
        """See `NodeUser`: an incremental count has lost its reference."""
        if not self.absolute_encoder:
            self.encoder_restarts += 1
        self._fault_number = 0
        self._encoder_ack = False

    def node_in_service(self) -> None:
        """See `NodeUser`: from now on cyclic data mean what they should."""
        self._in_service = True

    def node_lost(self, reason: str) -> None:
        """See `NodeUser`: the link is down until the drive is in service again."""
        self._in_service = False
        self._seen = 0
        self._watch.reset()
        self._link_age = self._config.grace_cycles  # what comes next has to be new
        if self._history is not None:
            if reason == "heartbeat":
                self._history.emit(self.name, "link.heartbeat_lost")
            else:
                self._history.emit(self.name, "link.node_lost", reason=reason)

    def node_state(self, state: int) -> None:
        """See `NodeUser`."""
        if self._history is not None:
            self._history.emit(self.name, "link.nmt_state", state=int(state))

    def node_emcy(self, code: int) -> None:
        """See `NodeUser`: the fault number says more than the EMCY."""

    # -- bus events -------------------------------------------------------------------------------------------

    def _receiver(self, number: int) -> Callable[[bytes, int], None]:
        parts = self._parts
        size = len(parts[number])
        bit = 1 << number

        def receive(data: bytes, _time_ns: int) -> None:
            if len(data) == size:
                parts[number] = data
                self._seen |= bit

        return receive

    def _on_status(self, data: bytes, _time_ns: int) -> None:
        if len(data) == _STATUS_STRUCT.size:
            self.inputs, self._fault_number, _ = _STATUS_STRUCT.unpack(data)

    # -- cycle ------------------------------------------------------------------------------------------------

    def read(self) -> None:
        """See `DrivePort.read`."""
        limit = self._config.grace_cycles
        if self._seen == self._all_seen:
            self._seen = 0
            words, frame = self._from_words
            self._answer = answer = self._unpack(frame.pack(*words.unpack(b"".join(self._parts))))
            self._link_age = 0
            good = True
            if self._config.sign_of_life:
                sign = answer[self._zsw2_at] >> SIGN_OF_LIFE_SHIFT
                good = self._watch.step(sign) and sign != 0
            if not good:
                self._link_age = limit
        else:
            answer = self._answer
            if self._link_age < limit:
                self._link_age += 1
        alive = self._link_age < limit and self._in_service
        if alive is not self.link_ok:
            self.link_ok = alive
            if self._history is not None:
                self._history.emit(self.name, "link.up" if alive else "link.down")
        if not alive:
            self.zsw1 = 0
            return
        self.zsw1 = zsw1 = answer[0]
        self.actual_speed_rpm = answer[self._nist_at] * self._speed_scale
        if self._m_act_at >= 0:
            self.actual_torque_nm = from_n2(answer[self._m_act_at]) * self._config.reference_torque_nm
        self.drive_fault_code = self._fault_number if zsw1 & 0x0008 else 0
        if self._xist_at >= 0:
            g1_zsw = answer[self._g1_zsw_at]
            self.sensor_fault = bool(g1_zsw & _ENCODER_ERROR)
            if not self.sensor_fault:
                self.encoder_increments = answer[self._xist_at]

    def control_position(self, deviation_increments: float, gain_per_s: float) -> None:
        """See `DrivePort.control_position`: XERR and KPC."""
        bounded = min(max(deviation_increments, -_XERR_MAX), _XERR_MAX)
        self._xerr = round(bounded)
        self._kpc = to_kpc(gain_per_s)

    def write(self, stw1: int, speed_rpm: float, torque_nm: float = 0.0) -> None:
        """See `DrivePort.write`."""
        row = self._row
        row[0] = stw1
        share = speed_rpm / self._config.reference_speed_rpm
        row[self._nsoll_at] = to_n2(share) if self._narrow else to_n4(share)
        if self._stw2_at >= 0:
            self._sign = next_sign(self._sign)
            row[self._stw2_at] = self._sign << SIGN_OF_LIFE_SHIFT
        if self._g1_at >= 0:
            if stw1 & _ACKNOWLEDGE and self.sensor_fault:
                self._encoder_ack = True
            elif self._encoder_ack and not (stw1 & _ACKNOWLEDGE and self.sensor_fault):
                self._encoder_ack = False
            row[self._g1_at] = _ENCODER_ACKNOWLEDGE if self._encoder_ack else 0
        if self.dsc:
            row[self._xerr_at] = self._xerr
            row[self._kpc_at] = self._kpc
            self._xerr = self._kpc = 0
        if self._add_at >= 0:
            row[self._add_at] = to_n2(torque_nm / self._config.reference_torque_nm)
        self._send()

    def _send(self) -> None:
        big, little = self._to_words
        data = little.pack(*big.unpack(self._pack(*self._row)))
        send = self._master.send
        for can_id, part in zip(self._rpdo_ids, self._rpdo_slices, strict=True):
            send(can_id, data[part])

    def release(self) -> None:
        """Disable the drive with a last telegram, which acts at the next SYNC: nobody will lead it any more."""
        row = self._row
        row[:] = [0] * len(row)
        row[0] = _CONTROL
        if self._stw2_at >= 0:
            self._sign = next_sign(self._sign)
            row[self._stw2_at] = self._sign << SIGN_OF_LIFE_SHIFT
        try:
            self._send()
        except HilError:
            return  # the bus is gone already


def _mappings(first: int, words: int) -> list[tuple[int, ...]]:
    entries = [(first + word) << 16 | 0x10 for word in range(words)]
    return [tuple(entries[at : at + _WORDS_PER_PDO]) for at in range(0, words, _WORDS_PER_PDO)]
