"""Port to a CiA 402 drive on CANopen: cyclic synchronous velocity on PDOs, latched by SYNC.

One RPDO (6040h, 60FFh, 6060h) and two synchronous TPDOs (6041h, 6064h, 6077h; 606Ch, 60FDh) carry the cycle;
603Fh and 1001h come by event. A drive whose EDS does not allow that is used by a plan (`cia402_plan`).

Delays, with T the bus cycle: the drive samples at SYNC k, the axis calculates half a cycle later, its
setpoint is latched at SYNC k+1 and interpolated by the drive until SYNC k+2.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from struct import Struct
from typing import TYPE_CHECKING, Final

from typing_extensions import override

from fieldbus.can.timing import FrameMaker
from fieldbus.canopen.node_setup import NodeSetup, Parameter, PdoSetup
from fieldbus.cia402 import DriveState, decode_state
from fieldbus.errors import ConfigurationError, HilError
from motion.drives._canopen import (
    CanopenNode,
    CanopenNodeConfig,
    CommissioningError,
    node_setup,
    written,
)
from motion.drives._link import LinkedPort
from motion.drives._max_torque import MaxTorque
from motion.drives._probe_mark import (
    INPUT_FALLS,
    INPUT_RISES,
    SECOND_FALLS,
    SECOND_RISES,
    ProbeMarkSearch,
)
from motion.drives.cia402_negotiation import Negotiation
from motion.drives.cia402_plan import (
    CONTROL,
    FAULT_CODE,
    FOLLOWING_ERROR,
    INPUTS,
    INTERPOLATION_DATA,
    MODE,
    MODE_CSP,
    MODE_CST,
    MODE_CSV,
    MODE_IP,
    MODE_PV,
    POSITION,
    PROFILE_ACCELERATION,
    PROFILE_DECELERATION,
    STANDARD,
    STATUS,
    TARGET_POSITION,
    TARGET_TORQUE,
    TARGET_VELOCITY,
    TORQUE,
    VELOCITY,
    Answers,
    DrivePlan,
    PdoUse,
)
from motion.drives.port import STW1, ZSW1

if TYPE_CHECKING:
    from fieldbus.canopen.master import CanopenMaster
    from fieldbus.history import History

__all__ = ["Cia402Port", "Cia402PortConfig", "CommissioningError"]

_RPDO1: Final = Struct("<Hib")
_TPDO1: Final = Struct("<Hih")
_TPDO2: Final = Struct("<iI")
_TPDO3: Final = Struct("<HB")

_VELOCITY_UNIT_MILLI_RPM: Final = 0xFDB44700
_PROFILE: Final = 402
_STEEP: Final = 10.0
"""How much steeper than OFF3 the ramps of the drive are in profile velocity."""
_SHUTDOWN: Final = 0x0006
_ENABLE_OPERATION: Final = 0x000F
_ACKNOWLEDGED: Final = (Parameter(0x6040, 0, 0x0080, 2), Parameter(0x6040, 0, 0, 2))
_POSITION_MODES: Final = (MODE_CSP, MODE_IP)
_POSITION_TARGETS: Final = (TARGET_POSITION, INTERPOLATION_DATA)
_ENABLE_INTERPOLATION: Final = 0x0010
_ACKNOWLEDGE: Final = int(STW1.ACKNOWLEDGE)
_ENABLED: Final = DriveState.OPERATION_ENABLED
_STOPPING: Final = DriveState.QUICK_STOP_ACTIVE

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
        plan: How to use a drive whose EDS is known.
        plan_again: Returns the plan for a drive that is as it has shown on the bus; None: a drive that
            refuses a part of its configuration is not taken into service.

    """

    rated_torque_nm: float = 2.0
    increments_per_revolution: int = 131072
    off1_deceleration_rpm_s: float = 3000.0
    off3_deceleration_rpm_s: float = 6000.0
    fault_reaction: int = 2
    plan: DrivePlan = STANDARD
    plan_again: Callable[[Answers], DrivePlan] | None = None


class Cia402Port(LinkedPort):
    """Sends velocity setpoints in csv and reads position, velocity and torque.

    Args:
        master: The controller's CANopen services on the segment of the drive.
        config: Facts about the drive.
        name: Name of the drive in the history.
        history: Log for link and drive events; None for none.

    """

    __slots__ = (
        "_config",
        "_fault_code",
        "_mapped",
        "_master",
        "_max_torque",
        "_probe",
        "_rpdo1",
        "_searches",
        "_seen_tpdo1",
        "_sent",
        "_state_of_word",
        "_statusword",
        "_stw1",
        "_subscriptions",
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
        self._rpdo1 = FrameMaker(0x200 + node)
        self._torque_factor = config.rated_torque_nm / 1000.0
        self._statusword = 0
        self._stw1 = 0
        self._fault_code = 0
        self._seen_tpdo1 = False
        self._sent = (0, 0)
        self._state_of_word: dict[int, DriveState] = {}
        self._torque_share_permille = 1000.0
        self._max_torque = MaxTorque(master, node, self._limit_refused)
        self._probe = ProbeMarkSearch(master, node)
        self.mark = self._probe
        first, second = (
            (ProbeMarkSearch(master, node, rises), ProbeMarkSearch(master, node, falls))
            for rises, falls in ((INPUT_RISES, INPUT_FALLS), (SECOND_RISES, SECOND_FALLS))
        )
        self.probes = first, second
        self._searches = self._probe, *first, *second
        for search in self._searches:
            search.on_begin = self._look_at
        self._config = config
        self._mapped: MappedData | None = None
        self._subscriptions: list[Callable[[], None]] = []
        self._use(config.plan)
        self.node = CanopenNode(self, master, self._setup(config.plan)).remote
        """The drive as a node of the network."""
        if config.plan_again is not None:
            self.node.negotiator = Negotiation(
                config.plan, plan_again=config.plan_again, setup_of=self._setup, take=self._use
            )

    def _convert(self, convert: Callable[[int], int] | None) -> None:
        for search in self._searches:
            search.convert = convert

    @override
    def probe_level(self, number: int) -> bool | None:
        return bool(self.inputs >> 15 + number & 1)

    def _look_at(self, search: ProbeMarkSearch) -> None:
        """Look at a search from now on: they share the touch probe of the drive."""
        self._probe = search

    def _use(self, plan: DrivePlan) -> None:
        """Exchange process data with the drive as a plan says."""
        for remove in self._subscriptions:
            remove()
        subscribe, node = self._master.subscribe, self.node_id
        self.has_torque_reduction = plan.limits_torque
        self._mapped = None
        self._convert(None)
        if plan.receive:
            self._mapped = mapped = MappedData(self._master, plan, self._config)
            self.brings_speed = mapped.brings_speed
            self._convert(mapped.increments_at)
            self._subscriptions = [
                subscribe(use.cob_id, mapped.receiver(use), apart=True) for use in plan.transmit
            ]
        else:
            self._subscriptions = [
                subscribe(0x180 + node, self._on_tpdo1, apart=True),
                subscribe(0x280 + node, self._on_tpdo2, apart=True),
                subscribe(0x380 + node, self._on_tpdo3, apart=True),
            ]

    def _setup(self, plan: DrivePlan) -> NodeSetup:
        """Return what a plan sets up in the drive."""
        config = replace(self._config, plan=plan)
        return node_setup(
            self.name,
            config,
            controller=self._master.node_id,
            disable=0x6040,
            pdos=plan.setups if plan.receive else _pdos(self.node_id),
            parameters=_parameters(config),
            prepare=_ACKNOWLEDGED if plan.fault_at_start else (),
            calm=(Parameter(0x6007, 0, 0, 2),) if plan.faults_outside_operation else (),
            device_profile=_PROFILE if plan.is_402 else None,
            taken=plan.rows,
        )

    @property
    @override
    def delay_ns(self) -> int:
        # In pv a setpoint counts from its SYNC on, and not from the middle of the way to it.
        if self._mapped is not None and self._mapped.mode == MODE_PV:
            return self._cycle_ns * 3 // 2
        return super().delay_ns

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
        if self._mapped is not None:
            self._mapped.restart()

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

    def _take(self, mapped: MappedData) -> None:
        """Take over what the PDOs of a plan have brought."""
        self._seen_tpdo1 = mapped.fresh
        mapped.fresh = False
        values = mapped.values
        self._statusword = values[STATUS]
        self.encoder_increments = mapped.increments
        self.inputs = values[INPUTS]
        self.actual_torque_nm = values[TORQUE] * self._torque_factor
        self.actual_speed_rpm = values[VELOCITY] * mapped.velocity_unit_rpm
        self.following_error = round(values[FOLLOWING_ERROR] * mapped.increments_per_unit)
        if mapped.brings_fault_code and values[FAULT_CODE]:
            self._fault_code = values[FAULT_CODE]

    # -- cycle
    # ------------------------------------------------------------------------------------------------

    @override
    def read(self) -> None:
        if self._mapped is not None:
            self._take(self._mapped)
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
        if state is _ENABLED and not stw1 & 0x0001:
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
        if stw1 & 0x0004 and state is not _STOPPING:
            zsw1 |= 0x0020
        self.zsw1 = zsw1 | word & 0x0280

    def _control(self, stw1: int) -> int:
        """Return the control word of the profile for a control word 1."""
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
        if stw1 & _ACKNOWLEDGE:
            control |= 0x0080
        return control

    @override
    def write(self, stw1: int, speed_rpm: float, torque_nm: float = 0.0) -> None:
        # The speed is sent in 10^-3 rpm.
        control = self._control(stw1)
        if self._mapped is not None:
            self._mapped.send(control, speed_rpm)
            return
        milli_rpm = int(speed_rpm * 1000.0 + (0.5 if speed_rpm >= 0.0 else -0.5))
        if milli_rpm > 0x7FFFFFFF:
            milli_rpm = 0x7FFFFFFF
        elif milli_rpm < -0x7FFFFFFF:
            milli_rpm = -0x7FFFFFFF
        self._sent = control, milli_rpm
        self._master.send_frame(self._rpdo1.make(_RPDO1.pack(control, milli_rpm, MODE_CSV)))

    @override
    def write_position(self, stw1: int, position: int) -> None:
        mapped = self._mapped
        if mapped is None or mapped.mode not in _POSITION_MODES:
            raise ConfigurationError("drive", "csv", "a drive in csp or ip takes positions")
        mapped.send_position(self._control(stw1), position)

    @override
    def write_torque(self, stw1: int, permille: int) -> None:
        mapped = self._mapped
        if mapped is None or mapped.mode != MODE_CST:
            raise ConfigurationError("drive", "csv", "a drive in cst takes torques")
        mapped.send_torque(self._control(stw1), permille)

    @override
    def process_words(self) -> dict[str, int]:
        if self._mapped is not None:
            return self._mapped.words()
        control, speed = self._sent
        return {
            "6040h": control,
            "6060h": MODE_CSV,
            "60FFh": speed,
            "6041h": self._statusword,
            "6064h": self.encoder_increments,
            "606Ch": round(self.actual_speed_rpm * 1000.0),
            "6077h": round(self.actual_torque_nm / self._torque_factor),
            "60FDh": self.inputs,
        }

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
            if self._mapped is not None:
                self._mapped.send(0, 0.0)
                return
            self._master.send_frame(self._rpdo1.make(_RPDO1.pack(0, 0, MODE_CSV)))
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


class MappedData:
    """Process data of a drive whose PDOs are not the standard ones.

    Args:
        master: The controller's CANopen services.
        plan: PDOs, mode and units.
        config: Facts about the drive.

    """

    __slots__ = (
        "_cycle_min",
        "_increments_per_turn",
        "_last_position",
        "_master",
        "_off1_rpm",
        "_receive",
        "_scale",
        "_sent",
        "_speed_rpm",
        "_target",
        "_travelled",
        "brings_fault_code",
        "brings_speed",
        "fresh",
        "increments",
        "increments_per_unit",
        "mode",
        "values",
        "velocity_unit_rpm",
    )

    def __init__(self, master: CanopenMaster, plan: DrivePlan, config: Cia402PortConfig) -> None:
        self._master = master
        self.mode = plan.mode
        self._receive = plan.receive
        self.increments_per_unit = self._scale = plan.increments_per_unit
        self._increments_per_turn = config.increments_per_revolution
        self._cycle_min = config.cycle_ns / 60e9
        self._off1_rpm = config.off1_deceleration_rpm_s * config.cycle_ns / 1e9 if plan.ramps_off1 else 0.0
        self._speed_rpm = 0.0
        self.velocity_unit_rpm = plan.velocity_unit_rpm
        carried = {raw >> 8 for use in plan.transmit for raw in use.entries}
        self.brings_speed = VELOCITY in carried
        self.brings_fault_code = FAULT_CODE in carried
        self.values: dict[int, int] = dict.fromkeys(
            (STATUS, POSITION, VELOCITY, TORQUE, INPUTS, FAULT_CODE, FOLLOWING_ERROR), 0
        )
        """Last values by key."""
        self.fresh = False
        """The status word has come since the last cycle."""
        self.increments = 0
        """Encoder, increments, signed 32 bit."""
        self._last_position: int | None = None
        self._travelled = 0
        self._sent: dict[int, int] = {}
        self._target = 0.0
        """csp: position setpoint, position units of the drive, without the wrap at 32 bits."""

    def restart(self) -> None:
        """Forget the position: the drive has been away."""
        self.fresh = False
        self._last_position = None

    def receiver(self, use: PdoUse) -> Callable[[bytes, int], None]:
        """Return what takes the payload of a PDO."""
        size = sum(raw & 0xFF for raw in use.entries) // 8
        fields: list[tuple[int, int, int, bool]] = []
        offset = 0
        for raw, signed in zip(use.entries, use.signed, strict=True):
            fields.append((raw >> 8, offset, raw & 0xFF, signed))
            offset += raw & 0xFF
        values = self.values
        status = any(key == STATUS for key, *_ in fields)
        position = any(key == POSITION for key, *_ in fields)

        def take(data: bytes, _time_ns: int) -> None:
            if len(data) < size:
                return
            word = int.from_bytes(data, "little")
            for key, at, bits, signed in fields:
                number = word >> at & (1 << bits) - 1
                values[key] = number - (1 << bits) if signed and number >> bits - 1 else number
            if position:
                self._moved(values[POSITION])
            if status:
                self.fresh = True

        return take

    def _moved(self, position: int) -> None:
        """Take a position in units of the drive over, counted on beyond 32 bits."""
        last = self._last_position
        if last is None:
            self._travelled = position
        else:
            self._travelled += (position - last + 0x80000000 & 0xFFFFFFFF) - 0x80000000
        self._last_position = position
        self.increments = (round(self._travelled * self._scale) + 0x80000000 & 0xFFFFFFFF) - 0x80000000

    def increments_at(self, position: int) -> int:
        """Return the encoder at a position near the last one, in units of the drive."""
        last = self._last_position
        way = 0 if last is None else (position - last + 0x80000000 & 0xFFFFFFFF) - 0x80000000
        exact = round((self._travelled + way) * self._scale)
        return (exact + 0x80000000 & 0xFFFFFFFF) - 0x80000000

    def send(self, control: int, speed_rpm: float) -> None:
        """Send control word and setpoint.

        Args:
            control: 6040h.
            speed_rpm: At the motor shaft.

        """
        if self._off1_rpm:
            control, speed_rpm = self._with_own_off1(control, speed_rpm)
        if (
            self.mode in _POSITION_MODES
            and control & 0x000F == 0x000F
            and self.values[STATUS] & 0x006F == 0x0027
        ):
            self._target += speed_rpm * self._cycle_min * self._increments_per_turn / self._scale
        else:
            self._target = float(self._travelled)
        self._put(control, speed=round(speed_rpm / self.velocity_unit_rpm))

    def _with_own_off1(self, control: int, speed_rpm: float) -> tuple[int, float]:
        """Return control word and setpoint for OFF1 by the controller: the drive stays enabled until the ramp
        has ended.
        """
        if control == _SHUTDOWN and self.values[STATUS] & 0x006F == 0x0027:
            step = self._off1_rpm
            if abs(self._speed_rpm) > step:
                speed_rpm = self._speed_rpm - math.copysign(step, self._speed_rpm)
                control = _ENABLE_OPERATION
            else:
                speed_rpm = 0.0
        self._speed_rpm = speed_rpm
        return control, speed_rpm

    def send_position(self, control: int, position: int) -> None:
        """Send control word and a position, increments, signed 32 bit."""
        way = (position - self.increments + 0x80000000 & 0xFFFFFFFF) - 0x80000000
        self._target = self._travelled + way / self._scale
        self._put(control)

    def send_torque(self, control: int, permille: int) -> None:
        """Send control word and a torque, permille of the rated one."""
        self._put(control, torque=permille)

    def words(self) -> dict[str, int]:
        """Return the objects as last sent and received, by name."""
        every = {**self._sent, **self.values}
        return {
            f"{key >> 8:04X}h" + (f":{key & 0xFF}" if key & 0xFF else ""): value
            for key, value in every.items()
        }

    def _put(self, control: int, *, speed: int = 0, torque: int = 0) -> None:
        if self.mode == MODE_IP and control & 0x000F == 0x000F:
            control |= _ENABLE_INTERPOLATION
        sent = self._sent
        for use in self._receive:
            word = offset = 0
            for raw in use.entries:
                key, bits = raw >> 8, raw & 0xFF
                if key == CONTROL:
                    number = control
                elif key == TARGET_VELOCITY:
                    number = min(max(speed, -(1 << bits - 1)), (1 << bits - 1) - 1)
                elif key in _POSITION_TARGETS:
                    number = round(self._target)
                elif key == MODE:
                    number = self.mode
                elif key == TARGET_TORQUE:
                    number = min(max(torque, -(1 << bits - 1)), (1 << bits - 1) - 1)
                else:
                    number = 0
                sent[key] = number
                word |= (number & (1 << bits) - 1) << offset
                offset += bits
            self._master.send(use.cob_id, word.to_bytes((offset + 7) // 8, "little"))


def _parameters(config: Cia402PortConfig) -> list[tuple[int, int, int, int]]:
    u8, u16, u32 = 1, 2, 4
    plan = config.plan
    unit = plan.velocity_unit_rpm
    units = [(0x60A9, 0, _VELOCITY_UNIT_MILLI_RPM, u32)] if plan.sets_units else []
    if plan.increments_per_unit == 1.0:
        units += [
            (0x608F, 1, config.increments_per_revolution, u32),
            (0x608F, 2, 1, u32),
            (0x6092, 1, config.increments_per_revolution, u32),
            (0x6092, 2, 1, u32),
        ]
    return [
        *units,
        (0x60C2, 1, config.cycle_ns // 1_000_000, u8),
        (0x60C2, 2, -3, u8),
        (0x605A, 0, 2, u16),
        (0x605B, 0, 1, u16),
        (0x605C, 0, 1, u16),
        (0x605E, 0, config.fault_reaction, u16),
        *([] if plan.ramps_off1 else [(0x6084, 0, round(config.off1_deceleration_rpm_s / unit), u32)]),
        (0x6085, 0, round(config.off3_deceleration_rpm_s / unit), u32),
        *_steep(plan, _STEEP * config.off3_deceleration_rpm_s / unit),
        (0x6060, 0, plan.mode, u8),
    ]


def _steep(plan: DrivePlan, wanted: float) -> Iterator[tuple[int, int, int, int]]:
    """Yield the ramps of profile velocity: the axis makes its own, the drive shall add nothing."""
    if plan.mode != MODE_PV:
        return
    for key in (PROFILE_ACCELERATION, PROFILE_DECELERATION):
        entry = (plan.writable or {}).get(key)
        if entry is not None:
            high = entry.type_range[1] if entry.high is None else int(entry.high)
            yield key >> 8, 0, min(round(wanted), high), entry.size
