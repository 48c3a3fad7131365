"""The emulated CiA 402 drive with all that a test can do to it and its machine (C402-310 to C402-312)."""

from __future__ import annotations

import math
from functools import partial
from typing import TYPE_CHECKING, Any, ClassVar, Final

from emulators.canopen_node import CanopenNode
from emulators.drive.cia402.axis import ProfileAxis
from emulators.drive.cia402.config import DriveConfig
from emulators.drive.cia402.eds import EDS
from emulators.drive.cia402.faults import codes as faults
from emulators.drive.cia402.faults.codes import FaultMemory
from emulators.drive.cia402.faults.log import FaultLog
from emulators.drive.cia402.faults.reactions import FaultReactions
from emulators.drive.cia402.function import DriveFunction
from emulators.drive.cia402.homing_methods import supported_methods
from emulators.drive.cia402.modes import ModeOfOperation
from emulators.drive.cia402.monitors import Monitors
from emulators.drive.cia402.objects.mode_rules import (
    REFUSALS,
    coupled_values,
    mode_checks,
    mode_readers,
    restore_buffer,
)
from emulators.drive.cia402.objects.profile import SUPPORTED_HOMING
from emulators.drive.cia402.objects.protection import clear_history, protection_readers
from emulators.drive.cia402.objects.rules import (
    IN_VELOCITY_UNITS,
    NEVER_ZERO,
    REQUIRED,
    axis_checks,
    axis_readers,
)
from emulators.drive.cia402.objects.table import all_objects
from emulators.drive.cia402.parameters import Parameters
from emulators.drive.cia402.protection import Protection
from emulators.drive.cia402.safety import SafetyFunctions
from emulators.drive.cia402.statemachine import PowerStateMachine
from emulators.drive.cia402.status_word import StatusWord
from emulators.drive.cia402.sync_jitter import SyncJitter
from emulators.drive.cia402.touch_probe import TouchProbe
from emulators.drive.cia402.velocity_limits import VelocityLimits
from emulators.drive.cia402.warnings import DriveWarning, Warnings
from emulators.drive.drive_train import build_drive_train
from emulators.drive.emulated_drive import MainsDrive
from emulators.drive.supply import DcLink
from emulators.encoder import AbsoluteEncoder
from emulators.repetition import Repetition
from emulators.trace import NMT_STATE, SERVO, Column, names_and_units, servo_values, value_texts
from fieldbus.can.segment import CanSegment
from fieldbus.canopen.abort import AbortCode, SdoAbort
from fieldbus.canopen.nmt import NmtState
from fieldbus.cia402 import DriveState, Mode
from fieldbus.clock import MS, Scheduler, Timer, seconds_to_ns
from fieldbus.errors import UnsupportedFaultError
from fieldbus.history import History

if TYPE_CHECKING:
    import numpy as np

_SERVO_DRIVE: Final = 0x00020192
"""1000h of a servo drive (C402-309)."""
_CONTROL_PRIORITY: Final = 1
"""The control cycle follows the servo step of the same instant."""
_VELOCITY_UNIT: Final = 0x60A900
_STATUSWORD: Final = 0x604100
_SYNC_PAUSE_NS: Final = 100 * MS
_TARGET_REACHED: Final = 1 << 10
_PROBE_LEVELS: Final = 3 << 16


_COLUMNS: Final = (
    *SERVO,
    Column("following_error", "pu"),
    Column("encoder_increments", "inc"),
    Column("controlword"),
    Column("statusword"),
    Column("state", texts={int(state): state.text for state in DriveState}),
    Column("mode", texts={0: "none", **{int(mode): mode.short for mode in Mode}}),
    NMT_STATE,
    Column("inputs"),
    Column("outputs"),
    Column("brake_closed"),
    Column("error_code"),
)


class CiA402Drive(MainsDrive):
    """A servo drive with its motor and machine on a CAN segment.

    It is off until `power_on`; the machine moves from the start. Everything runs in callbacks of the
    scheduler: the servo step every `servo_period_ns`, modes and monitoring every `control_period_ns`, cyclic
    setpoints at SYNC. Injected faults act at once.

    Args:
        scheduler: Clock of the drive.
        segment: CAN segment.
        config: The drive and its machine.
        name: Name of the node on the segment and in the history.
        history: Event log; None for none.
        rng: Source of the encoder noise; None: the encoder cannot be made noisy.

    Raises:
        ConfigurationError: The configuration does not fit together.

    """

    trace_enums: ClassVar = value_texts(_COLUMNS)

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
        train = build_drive_train(
            scheduler,
            mechanics=config.mechanics,
            switches=config.switches,
            encoder=config.encoder,
            brake=config.brake,
            tuning=config.tuning,
            servo_period_ns=config.servo_period_ns,
            rng=rng,
        )
        super().__init__(
            scheduler,
            name=name,
            history=history,
            train=train,
            power=train.build_power_stage(
                supply=config.supply,
                thermal=config.thermal,
                rated_torque_Nm=config.rated_torque_nm,
            ),
            control_period_ns=config.control_period_ns,
        )
        self.config = config
        self.trace_columns = names_and_units(_COLUMNS, train.load_unit)
        """(name, unit) of the values of `trace_row`."""
        self.node = CanopenNode(
            scheduler,
            segment,
            EDS.dictionary(config.eds),
            config.node_id,
            name=name,
            history=history,
            boot_time_s=config.boot_time_ms / 1000.0,
            storage=config.storage,
        )
        self.slave = self.node.slave
        slave = self.slave
        self._set_defaults()
        self.machine = PowerStateMachine(self._on_transition)
        self.machine.tolerates_no_power = config.quirks.falls_back_without_power_s > 0.0
        self.machine.skips_switched_on = config.quirks.skips_switched_on
        self.axis = ProfileAxis(
            config=config, core=self.core, values=slave.values, options=self.machine.options
        )
        self.axis.refresh()
        entries = slave.store.entries
        unit = entries[_VELOCITY_UNIT].default if _VELOCITY_UNIT in entries else slave.values[_VELOCITY_UNIT]
        self._velocity_limits = VelocityLimits(
            entries, IN_VELOCITY_UNITS, self.axis.units.velocity_unit(int(unit))
        )
        self.axis.fitted_inputs = self.digital_inputs.fitted
        self._control_period_s = self.axis.control_period_s
        self.parameters = Parameters(self.axis, self.emit)
        """Written parameters, and the digital outputs."""
        self.function = function = DriveFunction(scheduler, machine=self.machine, axis=self.axis)
        self.faults = FaultMemory(
            slave, name=name, history=history, codes=config.emcy, log=FaultLog(scheduler)
        )
        self.warnings = Warnings(slave, self.emit)
        self.status_word = StatusWord(slave, function, self.warnings, config.quirks)
        self.refresh_status = self.status_word.refresh
        """Forms 6041h."""
        self.warnings.on_change = self.refresh_status
        self.reactions = FaultReactions(
            scheduler,
            config,
            slave,
            function=function,
            memory=self.faults,
            parameters=self.parameters,
            dc_link=self.power.dc_link,
            refresh_status=self.refresh_status,
            emit=self.emit,
        )
        """Fault reaction, reset, lost communication."""
        self.protection = Protection(
            scheduler,
            config,
            self.power,
            function=function,
            parameters=self.parameters,
            warnings=self.warnings,
            raise_fault=self.reactions.raise_fault,
            refresh_status=self.refresh_status,
        )
        """Overload, temperatures, DC link."""
        self.safety = SafetyFunctions(
            scheduler,
            config.safety,
            function=function,
            inputs=self.digital_inputs,
            parameters=self.parameters,
            warnings=self.warnings,
            raise_fault=self.reactions.raise_fault,
            refresh_status=self.refresh_status,
        )
        """Safe torque off, safe stop 1, interlock."""
        self.reactions.causes += (self.protection.holds, self.safety.holds)
        self.monitors = Monitors(config, function, self.reactions.raise_fault)
        self.touch_probe = TouchProbe(scheduler, slave, self.axis, servo_period_ns=config.servo_period_ns)
        self._self_test: Timer | None = None
        self._toggle = Repetition(scheduler)
        self._connect()
        self._connect_objects()
        scheduler.every(config.control_period_ns, self._control_cycle, priority=_CONTROL_PRIORITY)

    def _connect(self) -> None:
        """Let the parts of the drive react to each other."""
        config, function, slave = self.config, self.function, self.slave
        function.on_following = self._on_following
        function.on_fault_reset = self.faults.acknowledge
        function.on_change = self.refresh_status
        function.homing.on_homed = self._on_homed
        function.homing.on_search_failed = self._on_search_failed
        function.interpolation.on_empty = self._on_buffer_empty
        if config.slippage_reaction == "fault":
            function.profile_velocity.on_slippage = partial(self.raise_fault, faults.SLIPPAGE)
        self.digital_inputs.on_change = self._on_inputs
        self.safety.show_interlock()
        self.touch_probe.on_event = self._on_probe
        self.digital_inputs.on_probe = self.touch_probe.on_input
        slave.on_sync.append(self._on_sync)
        if config.sync_jitter_percent:
            jitter = SyncJitter(
                function,
                config.sync_jitter_percent / 100.0,
                on_jitter=self.reactions.sync_lost,
                emit=self.emit,
            )
            slave.on_sync.append(jitter.on_sync)
        slave.on_nmt_state.append(self._on_nmt_state)
        slave.on_communication_error.append(self.reactions.communication_lost)
        slave.on_reset.append(self._on_reset)
        slave.sync.on_lost.append(self.reactions.sync_lost)

    def _connect_objects(self) -> None:
        """Connect the objects with what they show and do."""
        axis, function, probe = self.axis, self.function, self.touch_probe
        log, slave = self.faults.log, self.slave
        slave.sdo.refused_writes = {
            index << 8 | sub: code for (index, sub), code in self.config.refusals.items()
        }
        self.node.connect(
            {
                **protection_readers(self.config, self.protection, self.safety, log),
                0x200001: lambda: slave.sync.lost,
                0x604100: self.status_word.read,
                **mode_readers(axis, function.interpolation),
                **axis_readers(axis, self.dc_link),
                0x60FD00: lambda: self.digital_inputs.value,
            },
            {
                0x604000: self.on_controlword,
                0x606000: self.on_mode_request,
                0x210700: partial(clear_history, log),
                0x60B800: probe.on_function,
                0x60D001: probe.on_source,
                0x60D002: probe.on_source,
                **axis_checks(axis, self.parameters, self._velocity_limits),
                **mode_checks(function, self.warnings, self.parameters),
            },
        )

    def _set_defaults(self) -> None:
        config = self.config
        derived = {
            (0x608F, 1): config.encoder.counts_per_revolution,
            (0x6090, 1): config.encoder.counts_per_revolution,
            (0x6075, 0): round(config.rated_current_A * 1000.0),
            (0x6076, 0): round(config.rated_torque_nm * 1000.0),
            (0x6510, 1): config.servo_period_ns // 1000,
        }
        if config.eds is not None:
            entries = self.slave.store.entries
            if 0x100000 in entries:
                derived[0x1000, 0] = _SERVO_DRIVE
            derived = {
                (index, sub): value
                for (index, sub), value in derived.items()
                if (entry := entries.get(index << 8 | sub)) is None or not entry.given or not entry.default
            }
        else:
            listed = list(supported_methods(config.homing))
            derived[0x60E3, 0] = len(listed)
            listed += [0] * (len(SUPPORTED_HOMING) - len(listed))
            derived.update({(0x60E3, sub): method for sub, method in enumerate(listed, 1)})
        self.node.adopt(
            all_objects(), device="CiA 402 drive", required=REQUIRED, never_zero=NEVER_ZERO, eds=config.eds
        )
        self.node.set_defaults({**derived, **coupled_values(config.objects), **config.objects}, "drive")

    # -- what it is doing ------------------------------------------------------------------------------

    @property
    def state(self) -> DriveState:
        """State of the power drive system; NOT_READY_TO_SWITCH_ON while off."""
        return self.machine.state

    @property
    def mode(self) -> ModeOfOperation:
        """Mode in effect (6061h)."""
        return self.function.mode

    @property
    def dc_link(self) -> DcLink:
        """DC link with mains and chopper."""
        return self.protection.dc_link

    @property
    def sto_active(self) -> bool:
        """Whether safe torque off is in effect."""
        return self.safety.torque_off

    # -- life ------------------------------------------------------------------------------------------

    def power_on(self) -> None:
        """Switch the control supply on: self-test, boot-up, Switch on disabled."""
        if not self.slave.powered:
            self.faults.log.power(True)
            self._restart_application()
            self.slave.power_on()

    def power_off(self) -> None:
        """Switch everything off at once: the motor coasts, all but the non-volatile memory is lost."""
        if self.slave.powered:
            self.faults.log.power(False)
            self._cancel_self_test()
            self.slave.power_off()
            self.function.start()
            self.touch_probe.reset()

    def _restart_application(self) -> None:
        self.function.off()
        self.encoder.power_on(self.mechanics.motor_angle)
        self.core.reinitialise()
        self.axis.homed = isinstance(self.encoder, AbsoluteEncoder)
        if not self.axis.homed:
            self.axis.home_shift = 0
        self.axis.synchronised = False
        self.axis.missing_count = 0
        self.axis.fresh = self.axis.supervised = False
        restore_buffer(self.function.interpolation)
        self.axis.primed = False
        self.faults.clear()
        self.monitors.reset()
        self.reactions.forget()
        self.status_word.forget()
        self.touch_probe.reset()
        self.parameters.changed = True
        self.function.start()
        self._cancel_self_test()
        self.warnings.warn(REFUSALS, False)
        self.protection.restart()
        if self.config.quirks.silent_until_ready:
            self.slave.pdos.mute(frozenset((_STATUSWORD,)))

    def _on_reset(self, application: bool) -> None:
        self.parameters.changed = True
        self._velocity_limits.follow(self.axis.units.velocity_unit(self.slave.values[_VELOCITY_UNIT]))
        if application:
            self._restart_application()

    def _on_nmt_state(self, old: NmtState, new: NmtState) -> None:
        self.emit("drive.nmt", **{"from": old.name, "to": new.name})
        if old is NmtState.OPERATIONAL:
            self.axis.synchronised = False
        if new is NmtState.PRE_OPERATIONAL and self.machine.state is DriveState.NOT_READY_TO_SWITCH_ON:
            self.parameters.refresh()
            self.digital_inputs.read()
            if self.config.self_test_s and self._self_test is None:
                self._self_test = self.scheduler.after(
                    seconds_to_ns(self.config.self_test_s), self._self_test_passed
                )
            elif not self.config.self_test_s:
                self._self_test_passed()

    def _self_test_passed(self) -> None:
        """Leave Not ready to switch on: transition 1 (C402-002)."""
        self._self_test = None
        self.function.execute(self.machine.initialised())
        self.status_word.show_mode()
        if self.config.quirks.silent_until_ready:
            self.slave.pdos.mute(frozenset())
        self.refresh_status()

    def _cancel_self_test(self) -> None:
        if self._self_test is not None:
            self._self_test.cancel()
            self._self_test = None

    def _on_transition(self, number: int, old: DriveState, new: DriveState) -> None:
        self.machine.status_seen = False
        if new is DriveState.SWITCHED_ON:
            self.protection.on_switched_on()
        elif new is DriveState.FAULT and self.config.quirks.auto_reset_s:
            self.reactions.arm_auto_reset()
        if old is not new:
            self.emit("drive.state", **{"from": old.text, "to": new.text}, transition=number)

    # -- commands --------------------------------------------------------------------------------------

    def on_controlword(self, word: int) -> None:
        """Take 6040h, from PDO or SDO."""
        machine = self.machine
        if word == self.function.word and machine.settled:
            return
        if self.parameters.changed:
            self.parameters.refresh()
        if machine.state is DriveState.FAULT:
            machine.fault_present = self.reactions.present()
            if word & 0x80:
                self.reactions.reset_commanded()
        self.function.control(word)
        self.refresh_status()

    def on_mode_request(self, number: int) -> None:
        """Check 6060h; the mode changes in the next control cycle (C402-089, C402-090).

        Raises:
            SdoAbort: 06090030h, the mode is not supported.

        """
        if number and not (number in self.function.modes and self.slave.values[0x650200] >> (number - 1) & 1):
            self.warnings.warn(DriveWarning.MODE_REFUSED, True)
            raise SdoAbort(AbortCode.VALUE)
        if self.warnings.bits:
            self.warnings.warn(DriveWarning.MODE_REFUSED, False)

    # -- cycles ----------------------------------------------------------------------------------------

    def _on_sync(self, _time_ns: int) -> None:
        self.axis.synchronised = True
        function = self.function
        if function.following:
            mode = function.mode
            mode.sync()
            if mode.missed and mode.missed == self.config.missing_setpoints:
                self.reactions.communication_lost("setpoint")

    def _control_cycle(self) -> None:
        slave = self.slave
        if not slave.powered:
            return
        if self.parameters.changed:
            self.parameters.refresh()
        function = self.function
        wanted = slave.values[0x606000]
        if wanted and wanted != function.mode.number:
            function.change_mode(wanted)
            self.status_word.show_mode()
        axis = self.axis
        if axis.synchronised and self.scheduler.now - slave.sync.time_ns > _SYNC_PAUSE_NS:
            # SYNC has stopped: setpoints come by SDO or event-driven PDOs, if at all.
            axis.synchronised = self.scheduler.now - slave.sync.time_ns < 10e9 * axis.period_s
        function.cycle()
        self.monitors.update(self._control_period_s)
        self.protection.update()
        if self.safety.monitoring:
            self.safety.watch()
        self.refresh_status()

    def _on_following(self) -> None:
        key = self.mode.target_key
        self.axis.supervised = bool(key) and any(
            pdo.valid and pdo.synchronous and key in pdo.layout.keys for pdo in self.slave.pdos.receive
        )

    # -- faults ---------------------------------------------------------------------------

    def raise_fault(self, emcy_code: int, *, persistent: bool = False) -> None:
        """Raise a fault: EMCY, 603Fh, transition 13 with the reaction of 605Eh. Without effect while off.

        Args:
            emcy_code: EMCY code, 1..FFFFh.
            persistent: The cause stays until `clear_fault_cause`; before that the fault cannot be reset.

        """
        self.reactions.raise_fault(emcy_code, persistent=persistent)

    # -- machine ---------------------------------------------------------------------------------------

    def _on_homed(self, success: bool) -> None:
        self.status_word.homing_refused = not success
        self.emit("drive.homing", success=success, position_pu=self.axis.actual_position)

    def _on_search_failed(self, failed: bool) -> None:
        if failed:
            self.slave.emcy(faults.LIMIT_SWITCH)
        else:
            self.slave.emcy_clear(faults.LIMIT_SWITCH)

    def _on_buffer_empty(self, empty: bool) -> None:
        self.warnings.warn(DriveWarning.BUFFER_EMPTY, empty)
        if empty:
            self.slave.emcy(faults.BUFFER_EMPTY)
        else:
            self.slave.emcy_clear(faults.BUFFER_EMPTY)

    def _on_inputs(self, before: int) -> None:
        inputs = self.digital_inputs.value
        axis = self.axis
        axis.inputs = inputs
        self.slave.set(0x60FD, 0, inputs)
        guarded = self.config.limit_switch_reaction != "none"
        axis.blocked_negative = guarded and bool(inputs & 1)
        axis.blocked_positive = guarded and bool(inputs & 2)
        if (inputs ^ before) & _PROBE_LEVELS:
            self.touch_probe.show()
        self.emit("drive.inputs", inputs=inputs)
        if not self.function.following:
            return
        if self.mode is self.function.homing:
            # A switch changes while the machine moves; the encoder shows the position of the edge after that.
            self.scheduler.at(self.scheduler.now, self._inputs_for_homing)
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

    def _on_probe(self, probe: int, edge: str, position_pu: int, time_ns: int) -> None:
        self.emit("drive.probe", probe=probe, edge=edge, position_pu=position_pu, at_ns=time_ns)

    def _inputs_for_homing(self) -> None:
        if self.function.following:
            self.function.homing.inputs_changed()

    def peek(self, index: int, sub: int = 0) -> Any:
        """Return what an SDO upload of an entry would yield, without the bus and its delay."""
        hook = self.slave.store.read_hooks.get(index << 8 | sub)
        return self.slave.values[index << 8 | sub] if hook is None else hook()

    def trace_row(self) -> tuple[float, ...]:
        """Return the present values of `trace_columns`; position and velocity
        are those of the true mechanics.
        """
        core = self.core
        values = self.slave.values
        return servo_values(self.mechanics, core) + (  # noqa: RUF005 - a sum makes no list
            # Compiled, for a quarter of what it costs when the recorder packs them.
            float(self.axis.following_error),
            float(core.encoder.increments),
            values[0x604000],
            values[0x604100],
            self.machine.state,
            float(self.function.mode.number),
            self.slave.nmt_state,
            float(self.digital_inputs.value),
            float(self.parameters.outputs),
            float(core.brake.holding_torque_Nm > 0.0),
            values[0x603F00],
        )

    # -- state machine and status word -----------------------------------------------------------------

    def set_local_control(self, active: bool) -> None:
        """Take the control away from the bus: bit 9 of the status word 0, control words are ignored."""
        self.function.local_control = active
        self.machine.remote = not active
        if not active:
            self.function.evaluate_again()
        self.refresh_status()

    def refuse_transitions(self, *numbers: int) -> None:
        """Ignore the commands of these transitions (of 2, 3, 4, 15, 16); without numbers none."""
        self.machine.refused = frozenset(numbers)
        if not numbers:
            self.function.evaluate_again()
            self.refresh_status()
        self.machine.release()

    def force_switch_on_disabled(self) -> None:
        """Change to Switch on disabled without a command and without a fault; the motor coasts."""
        self.function.execute(self.machine.disable_voltage())
        self.refresh_status()

    def freeze_statusword(self, frozen: bool) -> None:
        """Let 6041h show what it shows now, whatever happens."""
        self.status_word.frozen = frozen
        self.refresh_status()

    def override_statusword_bits(self, set_bits: int, clear_bits: int) -> None:
        """Show bits of 6041h as 1, or as 0, whatever they should be; 0 and 0 = the true bits again."""
        self.status_word.override_bits(set_bits=set_bits, clear_bits=clear_bits)

    def toggle_target_reached(self, period_s: float | None) -> None:
        """Let bit 10 of 6041h change every `period_s`, whatever the motor does; None = the true bit."""
        self._toggle.stop()
        if period_s is None:
            self.status_word.override_bits()
            return
        reached = False

        def toggle() -> None:
            nonlocal reached
            reached = not reached
            self.status_word.override_bits(
                set_bits=_TARGET_REACHED if reached else 0, clear_bits=0 if reached else _TARGET_REACHED
            )

        self._toggle.start(seconds_to_ns(period_s), toggle)

    def override_mode_display(self, number: int | None) -> None:
        """Show a wrong mode in 6061h, or the true one again (None)."""
        self.status_word.override_mode_display(number)

    def force_warning(self, active: bool) -> None:
        """Show a warning without cause: bit 7, bit 31 of 2100h."""
        self.warnings.warn(DriveWarning.INJECTED, active)

    # -- power stage -----------------------------------------------------------------------------------

    def scale_ramps(self, share: float) -> None:
        """Make all ramps of the drive with this share of their slope; 1 = as set."""
        self.axis.ramp_scale = share

    def limit_torque(self, share: float | None) -> None:
        """Limit the torque to a share of the rated one; None = not."""
        self.protection.cap_torque(math.inf if share is None else share * self.config.rated_torque_nm)
        self.refresh_status()

    # -- encoder ---------------------------------------------------------------------------------------

    def break_encoder_wire(self, broken: bool) -> None:
        """Cut the wire of the encoder: the value stands, and the drive notices (7305h, absolute 7320h); or
        repair it.

        A repaired incremental encoder has lost its reference.
        """
        absolute = isinstance(self.encoder, AbsoluteEncoder)
        code = faults.POSITION_SENSOR if absolute else faults.INCREMENTAL_SENSOR
        self.encoder.freeze(broken)
        if broken:
            self.raise_fault(code, persistent=True)
        else:
            self.faults.end_causes(code)
            if not absolute:
                self.axis.homed = False

    def clear_fault_cause(self, emcy_code: int | None = None) -> None:
        """End the cause of a persistent fault, or of all; the fault itself waits for its reset."""
        self.faults.end_causes(emcy_code)

    def set_sto(self, active: bool) -> None:
        """Activate or release safe torque off (C402-030)."""
        self.safety.set_sto(active)

    def set_ss1(self, active: bool) -> None:
        """Demand safe stop 1, or release it: quick stop, then safe torque off."""
        self.safety.set_ss1(active)

    def open_interlock(self, opened: bool) -> None:
        """Open or close the interlock input (60FDh bit 3).

        Raises:
            UnsupportedFaultError: No interlock is wired.

        """
        if self.config.safety.interlock == "none":
            raise UnsupportedFaultError(f"{self.name}: no interlock is wired (safety.interlock)")
        self.safety.set_interlock(opened)

    def check_dc_link(self) -> None:
        """React to a change of the DC link or of the mains at once."""
        self.protection.look_at_link()
        self.refresh_status()

    # -- node ------------------------------------------------------------------------------------------

    def stop_heartbeat(self, stopped: bool) -> None:
        """Stop sending the heartbeat, or send it again."""
        self.node.stop_heartbeat(stopped)

    def delay_heartbeat(self, delay_s: float) -> None:
        """Send every heartbeat this much later than its period says, s; 0 = on time again."""
        self.node.delay_heartbeat(delay_s)

    def reset_node(self, boot_s: float) -> None:
        """Restart as after a dip of the supply: silence for `boot_s`, then boot-up; the motor coasts."""
        self.power_off()
        self.scheduler.after(seconds_to_ns(boot_s), self.power_on)

    def abort_sdo(self, code: int | None, index: int = 0) -> None:
        """Abort every SDO access (to `index`, 0 = any) with `code`; None = serve it again."""
        self.node.abort_sdo(code, index)

    def suppress_sdo_responses(self, silent: bool) -> None:
        """Leave SDO requests unanswered, or answer again."""
        self.node.suppress_sdo_responses(silent)

    def repeat_emcy(self, code: int | None, period_s: float = 0.001) -> None:
        """Send an EMCY every `period_s` without any state change; None = stop, with EMCY 0000h."""
        self.node.repeat_emcy(code, period_s)
