"""The drive on the bus: CANopen slave, life, status word, faults and their reactions."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Final

from emulators.drive.brake import HoldingBrake
from emulators.drive.cia402 import _object_rules, faults
from emulators.drive.cia402._eds import drive_dictionary
from emulators.drive.cia402._inputs import DigitalInputs
from emulators.drive.cia402._objects_profile import SUPPORTED_HOMING
from emulators.drive.cia402.axis import ProfileAxis
from emulators.drive.cia402.config import DriveConfig
from emulators.drive.cia402.faults import FaultMemory, Monitors
from emulators.drive.cia402.function import DriveFunction
from emulators.drive.cia402.homing_methods import supported_methods
from emulators.drive.cia402.modes import Homing, ModeOfOperation
from emulators.drive.cia402.statemachine import PowerStateMachine
from emulators.drive.core import ServoCore
from emulators.drive.protection import DcLink
from emulators.encoder import AbsoluteEncoder
from fieldbus.can.frame import CanSegment
from fieldbus.canopen.abort import AbortCode, SdoAbort
from fieldbus.canopen.nmt import NmtState
from fieldbus.canopen.slave import CanopenSlave
from fieldbus.cia402 import DriveState
from fieldbus.clock import MS, Scheduler, seconds_to_ns
from fieldbus.errors import ConfigurationError
from fieldbus.history import History

if TYPE_CHECKING:
    import numpy as np

_CONTROL_PRIORITY: Final = 1
"""The control cycle follows the servo step of the same instant."""
_SYNC_PAUSE_NS: Final = 100 * MS
_VOLTAGE_ENABLED: Final = 1 << 4
_WARNING: Final = 1 << 7
_REMOTE: Final = 1 << 9
_TARGET_REACHED: Final = 1 << 10
_INTERNAL_LIMIT: Final = 1 << 11


class DriveDevice:
    """A drive as node of a CAN segment; use `CiA402Drive`, which adds fault injection and the recorder's columns.

    See there for the arguments.
    """

    __slots__ = (
        "_control_period_s",
        "_history",
        "_mode_refused",
        "_scheduler",
        "_status",
        "axis",
        "config",
        "core",
        "dc_link",
        "digital_inputs",
        "encoder",
        "faults",
        "function",
        "homing",
        "machine",
        "mechanics",
        "monitors",
        "name",
        "parameters_changed",
        "slave",
        "status_frozen",
        "sto_active",
        "switches",
    )

    def __init__(
        self,
        scheduler: Scheduler,
        segment: CanSegment,
        config: DriveConfig,
        *,
        name: str,
        history: History | None = None,
        rng: np.random.Generator | None = None,
    ) -> None:
        self._scheduler = scheduler
        self._history = history
        self.name = name
        self.config = config
        self.mechanics, self.switches = config.mechanics.build()
        self.encoder = config.encoder.build(rng)
        self.core = ServoCore(
            mechanics=self.mechanics,
            encoder=self.encoder,
            period_s=config.servo_period_ns / 1e9,
            tuning=config.tuning,
            brake=HoldingBrake(
                self.mechanics,
                torque_Nm=config.brake.torque_Nm,
                opening_time_s=config.brake.opening_time_s,
                closing_time_s=config.brake.closing_time_s,
            ),
        )
        self.slave = CanopenSlave(
            scheduler,
            segment,
            drive_dictionary(config.eds),
            config.node_id,
            name=name,
            history=history,
            boot_time_ns=seconds_to_ns(config.boot_time_s),
        )
        self._set_defaults()
        self.machine = PowerStateMachine(self._on_transition)
        self.axis = ProfileAxis(
            config=config, core=self.core, values=self.slave.values, options=self.machine.options
        )
        self.axis.refresh()
        self._control_period_s = self.axis.control_period_s
        self.function = DriveFunction(scheduler, machine=self.machine, axis=self.axis)
        self.function.on_fault_reset = self._on_fault_reset
        self.function.on_following = self._on_following
        self.function.on_change = self._refresh_status
        self.homing = self._homing_mode()
        self.faults = FaultMemory(self.slave, name=name, history=history)
        self.monitors = Monitors(self)
        self.dc_link = DcLink()
        self.sto_active = False
        self.status_frozen = False
        """The status word does not change: a fault to inject."""
        self.digital_inputs = DigitalInputs(scheduler, self.switches, filter_s=config.input_filter_s)
        self.digital_inputs.on_change = self._on_inputs
        self.axis.fitted_inputs = self.digital_inputs.fitted
        self.parameters_changed = False
        """An object that the drive keeps converted has been written."""
        self._mode_refused = False
        self._status = 0
        _object_rules.install(self)
        self.slave.on_sync.append(self._on_sync)
        self.slave.on_nmt_state.append(self._on_nmt_state)
        self.slave.on_communication_error.append(self._on_communication_error)
        self.slave.on_reset.append(self._on_reset)
        self.slave.sync.on_lost.append(self._on_sync_lost)
        scheduler.every(config.servo_period_ns, self.core.step)
        scheduler.every(config.control_period_ns, self._control_cycle, priority=_CONTROL_PRIORITY)

    def _homing_mode(self) -> Homing:
        homing = self.function.modes[Homing.number]
        assert isinstance(homing, Homing)
        homing.on_homed = self._on_homed
        homing.on_search_failed = self._on_search_failed
        return homing

    def _set_defaults(self) -> None:
        config = self.config
        store = self.slave.store
        derived = {
            (0x608F, 1): config.encoder.counts_per_revolution,
            (0x6075, 0): round(config.rated_current_A * 1000.0),
            (0x6076, 0): round(config.rated_torque_Nm * 1000.0),
            (0x6510, 1): config.servo_period_ns // 1000,
        }
        if config.eds is None:
            listed = list(supported_methods(config.hard_stop_methods))
            derived[0x60E3, 0] = len(listed)
            listed += [0] * (len(SUPPORTED_HOMING) - len(listed))
            derived.update({(0x60E3, sub): method for sub, method in enumerate(listed, 1)})
        _object_rules.prepare_values(self)
        for (index, sub), value in {**derived, **config.objects}.items():
            entry = store.entries.get(index << 8 | sub)
            if entry is not None:
                entry.default = entry.coerce(value)
            elif index << 8 | sub in self.slave.values:
                self.slave.values[index << 8 | sub] = value
            else:
                raise ConfigurationError("objects", f"{index:04X}h:{sub}", "an object of the drive")
        store.load(application=True)

    # -- what it is doing ------------------------------------------------------------------------------------------

    @property
    def state(self) -> DriveState:
        """State of the power drive system; NOT_READY_TO_SWITCH_ON while off."""
        return self.machine.state

    @property
    def mode(self) -> ModeOfOperation:
        """Mode in force (6061h)."""
        return self.function.mode

    # -- life ------------------------------------------------------------------------------------------------------

    def power_on(self) -> None:
        """Switch the control supply on: self-test, boot-up, Switch on disabled."""
        if not self.slave.powered:
            self._restart_application()
            self.slave.power_on()

    def power_off(self) -> None:
        """Switch everything off at once: the motor coasts, all but the non-volatile memory is lost."""
        if self.slave.powered:
            self.slave.power_off()
            self.function.start()

    def _restart_application(self) -> None:
        self.function.off()
        self.encoder.power_on(self.mechanics.motor_angle)
        self.core.reinitialise()
        self.axis.homed = isinstance(self.encoder, AbsoluteEncoder)
        if not self.axis.homed:
            self.axis.home_shift = 0
        self.axis.synchronised = False
        self.axis.missing_count = 0
        self.faults.clear()
        self.monitors.reset()
        self._mode_refused = False
        self.parameters_changed = True
        self._status = -1
        self.function.start()

    def _on_reset(self, application: bool) -> None:
        self.parameters_changed = True
        if application:
            self._restart_application()

    def _on_nmt_state(self, old: NmtState, new: NmtState) -> None:
        if self._history is not None:
            self._history.emit(self.name, "drive.nmt", **{"from": old.name, "to": new.name})
        if old is NmtState.OPERATIONAL:
            self.axis.synchronised = False
        if new is NmtState.PRE_OPERATIONAL and self.machine.state is DriveState.NOT_READY_TO_SWITCH_ON:
            self.refresh_parameters()
            self.digital_inputs.read()
            self.function.execute(self.machine.initialised())
            self.slave.set(0x6061, 0, self.mode.number)
            self._refresh_status()

    def _on_transition(self, number: int, old: DriveState, new: DriveState) -> None:
        self.machine.status_seen = False
        if self._history is not None and old is not new:
            self._history.emit(
                self.name, "drive.state", **{"from": old.text, "to": new.text}, transition=number
            )

    # -- commands --------------------------------------------------------------------------------------------------

    def on_controlword(self, word: int) -> None:
        """Take 6040h, from PDO or SDO."""
        machine = self.machine
        if word == self.function.word and machine.settled:
            return
        if self.parameters_changed:
            self.refresh_parameters()
        if machine.state is DriveState.FAULT:
            machine.fault_present = self._fault_present()
        self.function.control(word)
        self._refresh_status()

    def on_mode_request(self, number: int) -> None:
        """Check 6060h; the mode changes in the next control cycle (C402-089, C402-090).

        Raises:
            SdoAbort: 06090030h, the mode is not supported.

        """
        if number and not (number in self.function.modes and self.slave.values[0x650200] >> (number - 1) & 1):
            self._mode_refused = True
            raise SdoAbort(AbortCode.VALUE)
        self._mode_refused = False

    def refresh_parameters(self) -> None:
        """Take written parameters over."""
        self.parameters_changed = False
        self.axis.refresh()
        values = self.slave.values
        brake = self.core.brake
        if brake.fitted:
            brake.forced_open = bool(values[0x60FE02] & 1 and not values[0x60FE01] & 1)

    # -- cycles ----------------------------------------------------------------------------------------------------

    def _on_sync(self, _time_ns: int) -> None:
        self.axis.synchronised = True
        function = self.function
        if function.following:
            mode = function.mode
            mode.sync()
            if mode.missed and mode.missed == self.config.missing_setpoints:
                self._on_communication_error("setpoint")

    def _control_cycle(self) -> None:
        slave = self.slave
        if not slave.powered:
            return
        if self.parameters_changed:
            self.refresh_parameters()
        function = self.function
        wanted = slave.values[0x606000]
        if wanted and wanted != function.mode.number:
            function.change_mode(wanted)
            slave.set(0x6061, 0, function.mode.number)
        axis = self.axis
        if axis.synchronised and self._scheduler.now - slave.sync.time_ns > _SYNC_PAUSE_NS:
            # Nobody sends SYNC any more: set-points come by SDO or event-driven PDOs, if at all.
            axis.synchronised = self._scheduler.now - slave.sync.time_ns < 10e9 * axis.period_s
        function.cycle()
        self.monitors.update(self._control_period_s)
        self._refresh_status()

    def _on_following(self) -> None:
        key = self.mode.target_key
        self.axis.supervised = bool(key) and any(
            pdo.valid and pdo.synchronous and key in pdo.layout.keys for pdo in self.slave.pdos.receive
        )

    # -- status word -----------------------------------------------------------------------------------------------

    def read_statusword(self) -> int:
        """Return 6041h for a reader on the bus."""
        self.machine.status_seen = True
        return max(self._status, 0)

    def _refresh_status(self) -> None:
        if self.status_frozen:
            return
        machine = self.machine
        function = self.function
        state = machine.state
        status = state.bits
        if not self.dc_link.low:
            status |= _VOLTAGE_ENABLED
        if self.sto_active or self._mode_refused or self.monitors.warning:
            status |= _WARNING
        if not function.local_control:
            status |= _REMOTE
        if state is DriveState.OPERATION_ENABLED:
            mode = function.mode
            if machine.follows_commands:
                status |= mode.status
            core = self.core
            axis = self.axis
            if (
                mode.limited
                or core.torque_limited
                or core.speed_limited
                or function.limit_stop
                or axis.blocked_positive
                or axis.blocked_negative
            ):
                status |= _INTERNAL_LIMIT
        elif state is DriveState.QUICK_STOP_ACTIVE and not self.core.stopping and not function.mode.cyclic:
            status |= _TARGET_REACHED
        if status != self._status:
            self._status = status
            self.slave.set(0x6041, 0, status)

    # -- faults ----------------------------------------------------------------------------------------------------

    def raise_fault(self, emcy_code: int, *, persistent: bool = False) -> None:
        """Raise a fault: EMCY, 603Fh, transition 13 with the reaction of 605Eh. Without effect while off.

        Args:
            emcy_code: EMCY code, 1..FFFFh.
            persistent: The cause stays until `clear_fault_cause`; before that the fault cannot be reset.

        """
        if not 1 <= emcy_code <= 0xFFFF:
            raise ConfigurationError("emcy_code", emcy_code, "1..65535")
        state = self.machine.state
        if not self.slave.powered or state is DriveState.NOT_READY_TO_SWITCH_ON:
            return
        known = emcy_code in self.faults.causes
        self.faults.enter(emcy_code, persistent=persistent)
        if known and state in (DriveState.FAULT, DriveState.FAULT_REACTION_ACTIVE):
            return
        if self.parameters_changed:
            self.refresh_parameters()
        self.function.execute(self.machine.fault(can_brake=emcy_code not in self.config.coasting_faults))
        self._refresh_status()

    def _on_fault_reset(self) -> None:
        self.faults.acknowledge()

    def _fault_present(self) -> bool:
        causes = self.faults.causes
        return (
            self.faults.persistent
            or self.dc_link.high
            or (faults.UNDERVOLTAGE in causes and self.dc_link.low)
            or (faults.SAFE_TORQUE_OFF in causes and self.sto_active)
            or (faults.COMMUNICATION in causes and self.slave.error_control.anyone_lost)
        )

    def _on_communication_error(self, reason: str) -> None:
        """React to lost communication as 6007h says (C402-077)."""
        if self.parameters_changed:
            self.refresh_parameters()
        if self._history is not None:
            self._history.emit(self.name, "drive.connection_lost", reason=reason)
        option = self.machine.options.abort_connection
        if option == 1:
            self.raise_fault(_CODES.get(reason, faults.COMMUNICATION))
        elif option == 2:
            self.function.execute(self.machine.disable_voltage())
        elif option == 3:
            self.function.execute(self.machine.quick_stop())
        self._refresh_status()

    def _on_sync_lost(self) -> None:
        if not self.mode.cyclic or self.machine.state is not DriveState.OPERATION_ENABLED:
            return
        if self.config.sync_loss_reaction == "fault":
            self.raise_fault(faults.SYNC_LOST)
        elif self.config.sync_loss_reaction == "warning":
            self.slave.emcy(faults.SYNC_LOST)
            self.slave.emcy_clear(faults.SYNC_LOST)

    # -- machine ---------------------------------------------------------------------------------------------------

    def _on_homed(self, success: bool) -> None:
        if self._history is not None:
            self._history.emit(
                self.name, "drive.homing", success=success, position_pu=self.axis.actual_position
            )

    def _on_search_failed(self, failed: bool) -> None:
        if failed:
            self.slave.emcy(faults.LIMIT_SWITCH)
        else:
            self.slave.emcy_clear(faults.LIMIT_SWITCH)

    @property
    def inputs(self) -> int:
        """60FDh: bit 0 negative limit switch, 1 positive limit switch, 2 home switch, 16 probe 1, 17 probe 2."""
        return self.digital_inputs.value

    def _on_inputs(self, before: int) -> None:
        inputs = self.digital_inputs.value
        axis = self.axis
        axis.inputs = inputs
        self.slave.set(0x60FD, 0, inputs)
        guarded = self.config.limit_switch_reaction != "none"
        axis.blocked_negative = guarded and bool(inputs & 1)
        axis.blocked_positive = guarded and bool(inputs & 2)
        if self._history is not None:
            self._history.emit(self.name, "drive.inputs", inputs=inputs)
        if not self.function.following:
            return
        if self.mode is self.homing:
            # A switch changes while the machine moves; the encoder shows the position of the edge after that.
            self._scheduler.at(self._scheduler.now, self._inputs_for_homing)
            return
        core = self.core
        rising = inputs & ~before
        threshold = core.standstill_speed
        into_positive = core.velocity_demand > 0.0 or core.velocity > threshold
        into_negative = core.velocity_demand < 0.0 or core.velocity < -threshold
        if not ((rising & 2 and into_positive) or (rising & 1 and into_negative)):
            return
        if self.config.limit_switch_reaction == "fault":
            self.raise_fault(faults.LIMIT_SWITCH)
        elif self.config.limit_switch_reaction == "stop":
            self.function.stop_at_limit_switch()

    def _inputs_for_homing(self) -> None:
        if self.function.following:
            self.homing.inputs_changed()

    def peek(self, index: int, sub: int = 0) -> Any:
        """Return what an SDO upload of an entry would yield, without the bus and its delay."""
        hook = self.slave.store.read_hooks.get(index << 8 | sub)
        return self.slave.values[index << 8 | sub] if hook is None else hook()


_CODES: Final = {
    "bus_off": faults.BUS_OFF,
    "rpdo_timeout": faults.RPDO_TIMEOUT,
    "setpoint": faults.RPDO_TIMEOUT,
}
