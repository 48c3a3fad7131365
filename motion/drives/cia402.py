"""Port to a CiA 402 drive on CANopen: cyclic synchronous velocity on PDOs, latched by SYNC.

One RPDO (6040h, 60FFh, 6060h) and two synchronous TPDOs (6041h, 6064h, 6077h; 606Ch, 60FDh) carry the cycle;
603Fh and 1001h come by event.

Delays, with T the bus cycle: the drive samples at SYNC k, the axis calculates half a cycle later, its
setpoint is latched at SYNC k+1 and interpolated by the drive until SYNC k+2.
"""

from __future__ import annotations

from dataclasses import dataclass
from struct import Struct
from typing import TYPE_CHECKING, Final

from typing_extensions import override

from fieldbus.canopen.node_setup import PdoSetup
from fieldbus.cia402 import DriveState, decode_state
from fieldbus.errors import HilError
from motion.drives._canopen import CanopenNode, CanopenNodeConfig, CommissioningError, written
from motion.drives._link import LinkedPort
from motion.drives._max_torque import MaxTorque
from motion.drives._probe_mark import ProbeMarkSearch
from motion.drives.port import STW1, ZSW1

if TYPE_CHECKING:
    from fieldbus.canopen.master import CanopenMaster
    from fieldbus.history import History

__all__ = ["Cia402Port", "Cia402PortConfig", "CommissioningError"]

_RPDO1: Final = Struct("<Hib")
_TPDO1: Final = Struct("<Hih")
_TPDO2: Final = Struct("<iI")
_TPDO3: Final = Struct("<HB")

MODE_CSV: Final = 9
_VELOCITY_UNIT_MILLI_RPM: Final = 0xFDB44700
_PROFILE: Final = 402

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


@dataclass(frozen=True, kw_only=True)
class Cia402PortConfig(CanopenNodeConfig):
    """Facts about the drive that the controller has to know, in addition to those of any drive on CANopen.

    Args:
        rated_torque_nm: 6076h, for the torque in permille.
        increments_per_revolution: 608Fh.
        off1_deceleration_rpm_s: Slope of OFF1, rpm per second (p1082 / p1121); written to 6084h.
        off3_deceleration_rpm_s: Slope of OFF3, rpm per second (p1082 / p1135); written to 6085h.
        fault_reaction: 605Eh.

    """

    rated_torque_nm: float = 2.0
    increments_per_revolution: int = 131072
    off1_deceleration_rpm_s: float = 3000.0
    off3_deceleration_rpm_s: float = 6000.0
    fault_reaction: int = 2


class Cia402Port(LinkedPort):
    """Sends velocity setpoints in csv and reads position, velocity and torque.

    Args:
        master: The controller's CANopen services on the segment of the drive.
        config: Facts about the drive.
        name: Name of the drive in the history.
        history: Log for link and drive events; None for none.

    """

    __slots__ = (
        "_fault_code",
        "_master",
        "_max_torque",
        "_probe",
        "_rpdo1_id",
        "_seen_tpdo1",
        "_state_of_word",
        "_statusword",
        "_stw1",
        "_torque_factor",
        "_torque_share_permille",
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
        super().__init__(config, name=name, history=history)
        self.node_id = node = config.node_id
        self._master = master
        self._rpdo1_id = 0x200 + node
        self._torque_factor = config.rated_torque_nm / 1000.0
        self._statusword = 0
        self._stw1 = 0
        self._fault_code = 0
        self._seen_tpdo1 = False
        self._state_of_word: dict[int, DriveState] = {}
        self._torque_share_permille = 1000.0
        self._max_torque = MaxTorque(master, node, self._limit_refused)
        self.has_torque_reduction = True
        self._probe = ProbeMarkSearch(master, node)
        self.mark = self._probe
        master.subscribe(0x180 + node, self._on_tpdo1)
        master.subscribe(0x280 + node, self._on_tpdo2)
        master.subscribe(0x380 + node, self._on_tpdo3)
        self.node = CanopenNode(
            self,
            master,
            config,
            disable=0x6040,
            pdos=_pdos(node),
            parameters=_parameters(config),
            device_profile=_PROFILE,
        ).remote
        """The drive as a node of the network."""

    def parameters(self) -> list[tuple[int, int, int]]:
        """Return what commissioning may write, in order: (index, sub-index, value)."""
        return written(self.node)

    # -- calls of the network
    # -------------------------------------------------------------------------------

    @override
    def drive_restarted(self) -> None:
        LinkedPort.drive_restarted(self)
        self._fault_code = 0
        self._max_torque.drive_restarted()

    @override
    def leave_service(self) -> None:
        LinkedPort.leave_service(self)
        self._seen_tpdo1 = False

    def take_emcy(self, code: int) -> None:
        """Take the code of an EMCY of the drive."""
        if code:
            self._fault_code = code

    # -- bus events
    # -------------------------------------------------------------------------------------------

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

    # -- cycle
    # ------------------------------------------------------------------------------------------------

    @override
    def read(self) -> None:
        fresh = self._seen_tpdo1
        self._seen_tpdo1 = False
        if not self._judge(fresh):
            return
        if self._probe.waiting:
            self._probe.ask()
        word = self._statusword
        if self._max_torque.wanted is not None:
            self.torque_limit_reached = word & 0x0800 != 0
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

    @override
    def write(self, stw1: int, speed_rpm: float, torque_nm: float = 0.0) -> None:
        # The speed is sent in 10^-3 rpm.
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

    @override
    def set_reference(self, speed_rpm: float, torque_nm: float) -> None:
        self._torque_share_permille = torque_nm / self._torque_factor

    @override
    def limit_torque(self, share: float | None) -> None:
        # A whole share is no reduction, as in a PROFIdrive telegram.
        reduced = share is not None and share < 1.0
        self.torque_limit_reached = False
        self._max_torque.want(
            round(share * self._torque_share_permille) if share is not None and reduced else None
        )

    def _limit_refused(self, reason: str) -> None:
        self.emit("drive.limit_refused", object="6072h", reason=reason)

    def release(self) -> None:
        """Disable the drive with a last telegram, which acts at the next
        SYNC: nobody will lead it any more.
        """
        try:
            self._master.send(self._rpdo1_id, _RPDO1.pack(0, 0, MODE_CSV))
        except HilError:
            return  # the bus is gone already


def _pdos(node: int) -> tuple[PdoSetup, ...]:
    # PDOs that the cycle does not use stay silent, whatever the device's default is.
    return (
        PdoSetup(False, 1, 0x200 + node, 1, (0x60400010, 0x60FF0020, 0x60600008)),
        PdoSetup(True, 1, 0x180 + node, 1, (0x60410010, 0x60640020, 0x60770010)),
        PdoSetup(True, 2, 0x280 + node, 1, (0x606C0020, 0x60FD0020)),
        PdoSetup(True, 3, 0x380 + node, 255, (0x603F0010, 0x10010008)),
        PdoSetup(True, 4, 0x480 + node),
        *(PdoSetup(False, number, 0x100 + 0x100 * number + node) for number in (2, 3, 4)),
    )


def _parameters(config: Cia402PortConfig) -> list[tuple[int, int, int, int]]:
    u8, u16, u32 = 1, 2, 4
    return [
        (0x60A9, 0, _VELOCITY_UNIT_MILLI_RPM, u32),
        (0x608F, 1, config.increments_per_revolution, u32),
        (0x608F, 2, 1, u32),
        (0x6092, 1, config.increments_per_revolution, u32),
        (0x6092, 2, 1, u32),
        (0x60C2, 1, config.cycle_ns // 1_000_000, u8),
        (0x60C2, 2, -3, u8),
        (0x605A, 0, 2, u16),
        (0x605B, 0, 1, u16),
        (0x605C, 0, 1, u16),
        (0x605E, 0, config.fault_reaction, u16),
        (0x6084, 0, round(config.off1_deceleration_rpm_s * 1000.0), u32),
        (0x6085, 0, round(config.off3_deceleration_rpm_s * 1000.0), u32),
        (0x6060, 0, MODE_CSV, u8),
    ]
