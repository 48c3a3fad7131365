"""Port to a CiA 402 drive on CANopen: cyclic synchronous velocity on PDOs, latched by SYNC.

One RPDO (6040h, 60FFh, 6060h) and two synchronous TPDOs (6041h, 6064h, 6077h; 606Ch, 60FDh) carry the cycle;
603Fh and 1001h come by event. The mapping is written once by `commission`, through the canopen library's SDO
client, and stored in the drive (1010h), so that a drive that was switched off comes back ready for the cycle.

Delays, with T the bus cycle: the drive samples at SYNC k, the axis calculates half a cycle later, its setpoint
is latched at SYNC k+1 and interpolated by the drive until SYNC k+2.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from struct import Struct
from typing import TYPE_CHECKING, Any, Final

from fieldbus.cia402 import DriveState, decode_state
from fieldbus.errors import ConfigurationError, HilError
from fieldbus.history import History
from motion.drives.port import STW1, ZSW1, DrivePort

if TYPE_CHECKING:
    from fieldbus.canopen.master import CanopenMaster

_RPDO1: Final = Struct("<Hib")
_TPDO1: Final = Struct("<Hih")
_TPDO2: Final = Struct("<iI")
_TPDO3: Final = Struct("<HB")

MODE_CSV: Final = 9
_VELOCITY_UNIT_MILLI_RPM: Final = 0xFDB44700
_SAVE: Final = 0x65766173
_NMT_START: Final = 0x01
_OPERATIONAL: Final = 0x05
_PRE_OPERATIONAL: Final = 0x7F

GRACE_CYCLES: Final = 3
"""Cycles without an actual value after which the link counts as lost."""

_ZSW1_OF_STATE: Final = {
    DriveState.NOT_READY_TO_SWITCH_ON: ZSW1.SWITCHING_ON_INHIBITED,
    DriveState.SWITCH_ON_DISABLED: ZSW1.SWITCHING_ON_INHIBITED,
    DriveState.READY_TO_SWITCH_ON: ZSW1.READY_TO_SWITCH_ON,
    DriveState.SWITCHED_ON: ZSW1.READY_TO_SWITCH_ON | ZSW1.READY,
    DriveState.OPERATION_ENABLED: ZSW1.READY_TO_SWITCH_ON | ZSW1.READY | ZSW1.OPERATION_ENABLED,
    DriveState.QUICK_STOP_ACTIVE: ZSW1.READY_TO_SWITCH_ON | ZSW1.READY,
    DriveState.FAULT_REACTION_ACTIVE: ZSW1.READY_TO_SWITCH_ON | ZSW1.READY | ZSW1.FAULT,
    DriveState.FAULT: ZSW1.FAULT | ZSW1.SWITCHING_ON_INHIBITED,
}


@dataclass(slots=True, frozen=True)
class Cia402PortConfig:
    """Facts about the drive that the controller has to know.

    Args:
        node_id: CANopen node, 1..127.
        cycle_ns: Bus cycle (SYNC period), ns.
        rated_torque_nm: 6076h, for the torque in permille.
        increments_per_revolution: 608Fh.
        off1_deceleration_rpm_s: Slope of OFF1, rpm per second (p1082 / p1121); written to 6084h.
        off3_deceleration_rpm_s: Slope of OFF3, rpm per second (p1082 / p1135); written to 6085h.
        absolute_encoder: The encoder keeps its position over power-off.
        heartbeat_ms: Heartbeat of drive and controller; 0 switches it off.
        consumer_heartbeat_ms: Time after which either side reports the other's heartbeat as lost.
        abort_connection: 6007h, the drive's reaction to lost communication.
        fault_reaction: 605Eh.
        grace_cycles: Cycles without data until the link counts as lost.

    """

    node_id: int
    cycle_ns: int
    rated_torque_nm: float = 2.0
    increments_per_revolution: int = 131072
    off1_deceleration_rpm_s: float = 3000.0
    off3_deceleration_rpm_s: float = 6000.0
    absolute_encoder: bool = False
    heartbeat_ms: int = 100
    consumer_heartbeat_ms: int = 250
    abort_connection: int = 3
    fault_reaction: int = 2
    grace_cycles: int = GRACE_CYCLES

    def __post_init__(self) -> None:
        if not 1 <= self.node_id <= 127:
            raise ConfigurationError("drive.node_id", self.node_id, "1..127")
        if self.cycle_ns <= 0 or self.cycle_ns % 1_000_000:
            raise ConfigurationError("cycle", f"{self.cycle_ns} ns", "a whole number of milliseconds")


class CommissioningError(HilError):
    """A drive refuses a parameter that the cyclic operation needs."""

    def __init__(self, drive: str, index: int, sub: int, value: int, reason: str) -> None:
        super().__init__(f"{drive} refuses {index:04X}h:{sub} = {value} ({value & 0xFFFFFFFF:X}h): {reason}")


class Cia402Port(DrivePort):
    """See the module.

    Args:
        master: The controller's CANopen services on the segment of the drive.
        config: Facts about the drive.
        name: Name of the drive in the history.
        history: Log for link and drive events; None for none.

    """

    __slots__ = (
        "_ack",
        "_config",
        "_fault_code",
        "_heartbeat_ok",
        "_history",
        "_link_age",
        "_master",
        "_off1",
        "_rpdo1_id",
        "_seen_tpdo1",
        "_starting",
        "_state_of_word",
        "_statusword",
        "_stw1",
        "_torque_factor",
        "name",
        "node_id",
    )

    def __init__(
        self,
        master: CanopenMaster,
        config: Cia402PortConfig,
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
        self._rpdo1_id = 0x200 + node
        self._torque_factor = config.rated_torque_nm / 1000.0
        self._statusword = 0
        self._stw1 = 0
        self._fault_code = 0
        self._seen_tpdo1 = False
        self._heartbeat_ok = True
        self._starting = False
        self._link_age = config.grace_cycles
        self._state_of_word: dict[int, DriveState] = {}
        master.subscribe(0x180 + node, self._on_tpdo1)
        master.subscribe(0x280 + node, self._on_tpdo2)
        master.subscribe(0x380 + node, self._on_tpdo3)
        master.on_emcy(node, self._on_emcy)
        master.on_bootup(node, self._on_bootup)
        if config.heartbeat_ms:
            master.watch_heartbeat(
                node, config.consumer_heartbeat_ms * 1_000_000, self._on_heartbeat_lost, self._on_nmt_state
            )

    # -- start-up ---------------------------------------------------------------------------------------------

    def parameters(self) -> list[tuple[int, int, int]]:
        """Return what commissioning writes, in order: (index, sub-index, value)."""
        c = self._config
        node = c.node_id
        writes: list[tuple[int, int, int]] = [
            (0x1400, 1, 0x80000200 + node),
            (0x1600, 0, 0),
            (0x1600, 1, 0x60400010),
            (0x1600, 2, 0x60FF0020),
            (0x1600, 3, 0x60600008),
            (0x1600, 0, 3),
            (0x1400, 2, 1),
            (0x1400, 1, 0x200 + node),
        ]
        for offset, (entries, kind) in enumerate(
            (
                ((0x60410010, 0x60640020, 0x60770010), 1),
                ((0x606C0020, 0x60FD0020), 1),
                ((0x603F0010, 0x10010008), 255),
            )
        ):
            cob_id = 0x180 + 0x100 * offset + node
            writes += [(0x1800 + offset, 1, 0xC0000000 + cob_id), (0x1A00 + offset, 0, 0)]
            writes += [(0x1A00 + offset, sub, entry) for sub, entry in enumerate(entries, 1)]
            writes += [
                (0x1A00 + offset, 0, len(entries)),
                (0x1800 + offset, 2, kind),
                (0x1800 + offset, 1, 0x40000000 + cob_id),
            ]
        # PDOs that the cycle does not use stay silent, whatever the device's default is.
        writes += [(0x1800 + pdo, 1, 0xC0000180 + 0x100 * pdo + node) for pdo in (3,)]
        writes += [(0x1400 + pdo, 1, 0x80000200 + 0x100 * pdo + node) for pdo in (1, 2, 3)]
        period_ms = c.cycle_ns // 1_000_000
        writes += [
            (0x1006, 0, c.cycle_ns // 1000),
            (0x60A9, 0, _VELOCITY_UNIT_MILLI_RPM),
            (0x608F, 1, c.increments_per_revolution),
            (0x608F, 2, 1),
            (0x6092, 1, c.increments_per_revolution),
            (0x6092, 2, 1),
            (0x60C2, 1, period_ms),
            (0x60C2, 2, -3),
            (0x6007, 0, c.abort_connection),
            (0x605A, 0, 2),
            (0x605B, 0, 1),
            (0x605C, 0, 1),
            (0x605E, 0, c.fault_reaction),
            (0x6084, 0, round(c.off1_deceleration_rpm_s * 1000.0)),
            (0x6085, 0, round(c.off3_deceleration_rpm_s * 1000.0)),
            (0x6060, 0, MODE_CSV),
        ]
        if c.heartbeat_ms:
            writes += [
                (0x1017, 0, c.heartbeat_ms),
                (0x1016, 1, self._master.node_id << 16 | c.consumer_heartbeat_ms),
            ]
        return writes

    def commission(self, sdo: Any, *, store: bool = True) -> None:
        """Disable the drive, write the parameters through `sdo` (a `canopen` SDO client) and start the node.

        With `store` the drive keeps the parameters (1010h), so that it comes back ready after it was switched off.

        Must be called from outside of callbacks: the SDO client waits.
        """
        from canopen.sdo.exceptions import SdoError

        writes = [(0x6040, 0, 0), *self.parameters()]
        if store:
            writes.append((0x1010, 1, _SAVE))
        for index, sub, value in writes:
            entry = sdo[index]
            target = entry if hasattr(type(entry), "raw") else entry[sub]
            try:
                target.raw = value
            except (
                SdoError,
                ValueError,
                OverflowError,
            ) as error:  # the last two: outside the object's data type
                raise CommissioningError(self.name, index, sub, value, str(error)) from None
        self._starting = True
        self._master.nmt(_NMT_START, self.node_id)

    def _on_bootup(self) -> None:
        if not self.absolute_encoder:
            self.encoder_restarts += 1
        self._fault_code = 0
        self._starting = True
        self._master.nmt(_NMT_START, self.node_id)

    # -- bus events -------------------------------------------------------------------------------------------

    def _on_tpdo1(self, data: bytes, _time_ns: int) -> None:
        if len(data) >= 8:
            self._statusword, self.encoder_increments, torque = _TPDO1.unpack_from(data)
            self.actual_torque_nm = torque * self._torque_factor
            self._seen_tpdo1 = True

    def _on_tpdo2(self, data: bytes, _time_ns: int) -> None:
        if len(data) >= 8:
            velocity, self.inputs = _TPDO2.unpack_from(data)
            self.actual_speed_rpm = velocity * 0.001

    def _on_tpdo3(self, data: bytes, _time_ns: int) -> None:
        if len(data) >= 3:
            self._fault_code = _TPDO3.unpack_from(data)[0]

    def _on_emcy(self, code: int, _register: int, _data: bytes) -> None:
        if code:
            self._fault_code = code

    def _on_heartbeat_lost(self) -> None:
        self._heartbeat_ok = False
        if self._history is not None:
            self._history.emit(self.name, "link.heartbeat_lost")

    def _on_nmt_state(self, state: int) -> None:
        self._heartbeat_ok = True
        if state == _OPERATIONAL:
            self._starting = False
        elif self._starting and state == _PRE_OPERATIONAL:
            self._master.nmt(_NMT_START, self.node_id)  # the first command was lost
        if self._history is not None:
            self._history.emit(self.name, "link.nmt_state", state=int(state))

    # -- cycle ------------------------------------------------------------------------------------------------

    def read(self) -> None:
        """See `DrivePort.read`."""
        if self._seen_tpdo1:
            self._seen_tpdo1 = False
            self._link_age = 0
        elif self._link_age < self._config.grace_cycles:
            self._link_age += 1
        alive = self._link_age < self._config.grace_cycles and self._heartbeat_ok
        if alive is not self.link_ok:
            self.link_ok = alive
            if self._history is not None:
                self._history.emit(self.name, "link.up" if alive else "link.down")
        if not alive:
            self.zsw1 = 0
            return
        word = self._statusword
        key = word & 0x6F
        state = self._state_of_word.get(key)
        if state is None:
            state = self._state_of_word[key] = decode_state(word)
        stw1 = self._stw1
        zsw1 = int(_ZSW1_OF_STATE[state])
        if state is DriveState.OPERATION_ENABLED and not stw1 & 0x0001:
            zsw1 &= ~0x0004  # braking on OFF1 is no operation any more (STP-272)
        fault = zsw1 & 0x0008
        if fault:
            self.drive_fault_code = self._fault_code
            self.sensor_fault = 0x7300 <= self._fault_code <= 0x732F
        else:
            self.drive_fault_code = self._fault_code = 0
            self.sensor_fault = False
        # OFF2 and OFF3 are shown as pending as long as the controller withdraws them.
        if stw1 & 0x0002:
            zsw1 |= 0x0010
        if stw1 & 0x0004 and state is not DriveState.QUICK_STOP_ACTIVE:
            zsw1 |= 0x0020
        self.zsw1 = zsw1 | word & 0x0280

    def write(self, stw1: int, speed_rpm: float, torque_nm: float = 0.0) -> None:  # noqa: ARG002 - csv carries no torque
        """See `DrivePort.write`; the speed is sent in 10^-3 rpm."""
        self._stw1 = stw1
        if not stw1 & 0x0002:
            control = 0x0000
        elif not stw1 & 0x0004:
            control = 0x0002
        elif not stw1 & 0x0001:
            control = 0x0006
        else:
            # Switched on first, operation enabled when the drive has shown that state (transitions 3 and 4).
            control = 0x000F if self._statusword & 0x0002 and stw1 & 0x0008 else 0x0007
        if stw1 & STW1.ACKNOWLEDGE:
            control |= 0x0080
        milli_rpm = int(speed_rpm * 1000.0 + (0.5 if speed_rpm >= 0.0 else -0.5))
        if milli_rpm > 0x7FFFFFFF:
            milli_rpm = 0x7FFFFFFF
        elif milli_rpm < -0x7FFFFFFF:
            milli_rpm = -0x7FFFFFFF
        self._master.send(self._rpdo1_id, _RPDO1.pack(control, milli_rpm, MODE_CSV))

    def release(self) -> None:
        """Disable the drive with a last telegram, which acts at the next SYNC: nobody will lead it any more."""
        try:
            self._master.send(self._rpdo1_id, _RPDO1.pack(0, 0, MODE_CSV))
        except HilError:
            return  # the bus is gone already


PortFactory = Callable[[], DrivePort]
