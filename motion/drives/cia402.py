"""Port to a CiA 402 drive on CANopen: cyclic synchronous velocity on PDOs, latched by SYNC.

One RPDO (6040h, 60FFh, 6060h) and two synchronous TPDOs (6041h, 6064h, 6077h; 606Ch, 60FDh) carry the cycle;
603Fh and 1001h come by event. `setup` says what the drive has to be and how it has to be configured; the network
(`CanopenMaster.add_node`) sees to that, at the start and whenever the drive comes back, and tells the port whether it
may be relied on.

Delays, with T the bus cycle: the drive samples at SYNC k, the axis calculates half a cycle later, its setpoint
is latched at SYNC k+1 and interpolated by the drive until SYNC k+2.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from struct import Struct
from typing import TYPE_CHECKING, Final

from fieldbus.canopen.node_setup import NodeSetup, Parameter, PdoSetup
from fieldbus.cia402 import DriveState, decode_state
from fieldbus.errors import ConfigurationError, HilError
from fieldbus.history import History
from motion.drives.port import STW1, ZSW1, DrivePort

if TYPE_CHECKING:
    from fieldbus.canopen.master import CanopenMaster
    from fieldbus.canopen.node import RemoteNode

_RPDO1: Final = Struct("<Hib")
_TPDO1: Final = Struct("<Hih")
_TPDO2: Final = Struct("<iI")
_TPDO3: Final = Struct("<HB")

MODE_CSV: Final = 9
_VELOCITY_UNIT_MILLI_RPM: Final = 0xFDB44700
_PROFILE: Final = 402

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
        guard_time_ms: Period of node guarding, for drives without heartbeat; 0 = none.
        life_time_factor: Guard times without an answer after which either side reports the other as lost.
        vendor_id: Expected 1018h:1; None = any. Likewise `product_code`, `revision`, `serial`.
        store: Have the drive keep the parameters (1010h).
        optional: The network is ready without this drive.

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


class CommissioningError(HilError):
    """A drive refuses a parameter that the cyclic operation needs."""


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
        "_history",
        "_in_service",
        "_link_age",
        "_master",
        "_off1",
        "_rpdo1_id",
        "_seen_tpdo1",
        "_state_of_word",
        "_statusword",
        "_stw1",
        "_torque_factor",
        "name",
        "node",
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
        self._in_service = False
        self._link_age = config.grace_cycles
        self._state_of_word: dict[int, DriveState] = {}
        master.subscribe(0x180 + node, self._on_tpdo1)
        master.subscribe(0x280 + node, self._on_tpdo2)
        master.subscribe(0x380 + node, self._on_tpdo3)
        self.node: RemoteNode = master.add_node(self.setup(), self)
        """The drive as a node of the network."""

    # -- configuration ----------------------------------------------------------------------------------------

    def setup(self) -> NodeSetup:
        """Return what the drive has to be and how it has to be configured."""
        c = self._config
        return NodeSetup(
            node_id=c.node_id,
            name=self.name,
            device_profile=_PROFILE,
            vendor_id=c.vendor_id,
            product_code=c.product_code,
            revision=c.revision,
            serial=c.serial,
            prepare=(Parameter(0x6040, 0, 0, 2),),
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
        # PDOs that the cycle does not use stay silent, whatever the device's default is.
        return (
            PdoSetup(False, 1, 0x200 + node, 1, (0x60400010, 0x60FF0020, 0x60600008)),
            PdoSetup(True, 1, 0x180 + node, 1, (0x60410010, 0x60640020, 0x60770010)),
            PdoSetup(True, 2, 0x280 + node, 1, (0x606C0020, 0x60FD0020)),
            PdoSetup(True, 3, 0x380 + node, 255, (0x603F0010, 0x10010008)),
            PdoSetup(True, 4, 0x480 + node),
            *(PdoSetup(False, number, 0x100 + 0x100 * number + node) for number in (2, 3, 4)),
        )

    def _parameters(self) -> tuple[Parameter, ...]:
        c = self._config
        u8, u16, u32 = 1, 2, 4
        heartbeat = self._master.node_id << 16 | c.consumer_heartbeat_ms if c.heartbeat_ms else 0
        rows = [
            (0x1006, 0, c.cycle_ns // 1000, u32),
            (0x60A9, 0, _VELOCITY_UNIT_MILLI_RPM, u32),
            (0x608F, 1, c.increments_per_revolution, u32),
            (0x608F, 2, 1, u32),
            (0x6092, 1, c.increments_per_revolution, u32),
            (0x6092, 2, 1, u32),
            (0x60C2, 1, c.cycle_ns // 1_000_000, u8),
            (0x60C2, 2, -3, u8),
            (0x6007, 0, c.abort_connection, u16),
            (0x605A, 0, 2, u16),
            (0x605B, 0, 1, u16),
            (0x605C, 0, 1, u16),
            (0x605E, 0, c.fault_reaction, u16),
            (0x6084, 0, round(c.off1_deceleration_rpm_s * 1000.0), u32),
            (0x6085, 0, round(c.off3_deceleration_rpm_s * 1000.0), u32),
            (0x6060, 0, MODE_CSV, u8),
            (0x1017, 0, c.heartbeat_ms, u16),
            (0x1016, 1, heartbeat, u32),
        ]
        if c.guard_time_ms:
            rows += [(0x100C, 0, c.guard_time_ms, u16), (0x100D, 0, c.life_time_factor, u8)]
        return tuple(Parameter(*row) for row in rows)

    def parameters(self) -> list[tuple[int, int, int]]:
        """Return what commissioning may write, in order: (index, sub-index, value)."""
        return [(index, sub, value) for index, sub, value, _ in self.node.setup.everything()]

    # -- what the network tells -------------------------------------------------------------------------------

    def node_restarted(self) -> None:
        """See `NodeUser`: an incremental count has lost its reference."""
        if not self.absolute_encoder:
            self.encoder_restarts += 1
        self._fault_code = 0

    def node_in_service(self) -> None:
        """See `NodeUser`: from now on cyclic data mean what they should."""
        self._in_service = True

    def node_lost(self, reason: str) -> None:
        """See `NodeUser`: the link is down until the drive is in service again."""
        self._in_service = False
        self._seen_tpdo1 = False
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
        """See `NodeUser`."""
        if code:
            self._fault_code = code

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

    # -- cycle ------------------------------------------------------------------------------------------------

    def read(self) -> None:
        """See `DrivePort.read`."""
        if self._seen_tpdo1:
            self._seen_tpdo1 = False
            self._link_age = 0
        elif self._link_age < self._config.grace_cycles:
            self._link_age += 1
        alive = self._link_age < self._config.grace_cycles and self._in_service
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
