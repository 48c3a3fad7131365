"""A PROFIdrive axis without a bus: machine, encoder, servo core, state machine, setpoint channel, faults, words.

A transport hands telegrams over with `receive`, calls `cycle` once per bus cycle, and sends what `transmit` returns.
Within `cycle` the order is that of the profile (PD-347): telegram, sign of life, state machine, encoder, setpoint channel,
faults. The servo core runs on the scheduler, several times per bus cycle. Faults, safety inputs and standstill do not wait
for the bus: they act when they happen.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from typing import TYPE_CHECKING, Final

from emulators.drive.brake import HoldingBrake
from emulators.drive.core import ServoCore
from emulators.drive.inputs import DigitalInputs
from emulators.drive.power_stage import PowerStage
from emulators.drive.profidrive import fault_catalogue as numbers
from emulators.drive.profidrive._faults import FaultState
from emulators.drive.profidrive._monitors import Monitors
from emulators.drive.profidrive._probes import ProbeLatch
from emulators.drive.profidrive._safety import SafetyInputs
from emulators.drive.profidrive._words import StatusWords
from emulators.drive.profidrive.config import DriveSettings, ProfidriveConfig
from emulators.drive.profidrive.fault_catalogue import DriveWarning, Fault, fault
from emulators.drive.profidrive.setpoint_channel import SetpointChannel
from emulators.drive.profidrive.statemachine import Action, AxisState, GeneralStateMachine, Off
from emulators.encoder.profidrive import EncoderInterface
from fieldbus.clock import Scheduler, seconds_to_ns
from fieldbus.history import History
from fieldbus.profidrive.formats import from_n2, torque_factor
from fieldbus.profidrive.sign_of_life import SignOfLife
from fieldbus.profidrive.words import SIGN_OF_LIFE_MASK, SIGN_OF_LIFE_SHIFT, STW1

if TYPE_CHECKING:
    import numpy as np


_CONTROL_PRIORITY: Final = 1
"""The control cycle follows the servo step of the same instant."""
_ON: Final = int(STW1.ON)
_ACKNOWLEDGE: Final = int(STW1.ACKNOWLEDGE)
_CONTROL: Final = int(STW1.CONTROL_BY_PLC)
_JOG: Final = int(STW1.JOG_1 | STW1.JOG_2)
_N2_TO_N4: Final = 16
_SIGN_OF_LIFE_FAILED: Final = 0x0F02
_NOT_VALID: Final = 0x0001


FaultListener = Callable[[Fault | None, int], None]


class ProfidriveDrive:
    """A servo drive with its motor and machine, in PROFIdrive's speed mode (application classes 1, 3 and 4).

    It is off until `power_on`; the machine moves from the start.

    Args:
        scheduler: Time of the bench.
        config: The drive and its machine.
        name: Name in the history.
        history: Log; None for none.
        rng: Source of the encoder's noise; None: the encoder cannot be made noisy.

    Raises:
        ConfigurationError: The configuration does not fit together.
        TelegramError: The telegram of free configuration does not.

    """

    __slots__ = (
        "_frame", "_g1_at", "_history", "_kpc_at", "_limit_words", "_momred_at", "_narrow",
        "_nsoll_at", "_on_locked", "_row", "_s3_ns", "_standstill", "_stw2_at", "_torque_at", "_xerr_at", "channel", "config",
        "controlled_cyclically", "core", "cycle_at_ns", "data_at_ns", "digital_inputs", "encoder",
        "encoder_words", "faults", "g1_stw", "g1_words", "injected_cap_Nm", "isochronous", "machine", "mechanics", "monitors", "name",
        "on_fault", "on_inputs", "on_warning", "power", "powered", "protection_cap_Nm", "refuses_operation", "rejected", "safety", "scheduler",
        "settings", "sign_of_life", "stw1", "stw2", "switches", "telegram", "torque_limit_Nm", "words",
    )  # fmt: skip

    def __init__(
        self,
        scheduler: Scheduler,
        config: ProfidriveConfig,
        *,
        name: str,
        history: History | None = None,
        rng: np.random.Generator | None = None,
    ) -> None:
        self.scheduler = scheduler
        self.config = config
        self.name = name
        self._history = history
        self.settings: DriveSettings = replace(config.settings)
        """Parameters in force; call `refresh` when one has changed."""
        self.telegram = config.build_telegram()
        self.isochronous = self.telegram.isochronous if config.isochronous is None else config.isochronous
        self.mechanics, self.switches = config.mechanics.build()
        self.encoder = config.encoder_with_fine_resolution.build(rng)
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
        self.core.on_standstill = self._on_standstill
        self.power = PowerStage(
            self.core,
            supply=config.supply,
            thermal=config.thermal,
            rated_torque_Nm=config.rated_torque_Nm,
            motor_time_constant_s=config.thermal_time_constant_s,
        )
        self.machine = GeneralStateMachine()
        self.faults = FaultState(scheduler)
        self.faults.on_fault = self._on_fault
        self.faults.on_acknowledged = self._on_acknowledged
        self.faults.on_warning = self._on_warning
        self.on_fault: list[FaultListener] = []
        """Called with a new fault and its value, and with None when a situation has been acknowledged."""
        self.on_inputs: Callable[[], object] = _nothing
        """Called when the digital inputs have changed."""
        self.on_warning: Callable[[], object] = _nothing
        """Called when the warnings have changed."""
        self.safety = SafetyInputs(self)
        self.sign_of_life = SignOfLife(tolerance=self.settings.sign_of_life_tolerance)
        self.channel = SetpointChannel(
            self.core,
            self.settings,
            steps=config.cycle_ns // config.servo_period_ns,
            interpolation=config.interpolation,
        )
        self.encoder_words = EncoderInterface(self.encoder, config.encoder_format)
        """Encoder interface G1."""
        self.g1_words = (0, 0, 0)
        """G1_ZSW, G1_XIST1, G1_XIST2."""
        self.digital_inputs = DigitalInputs(scheduler, self.switches, filter_s=config.input_filter_s)
        self.digital_inputs.on_change = self._on_inputs
        probes = ProbeLatch(scheduler, self.core, self.encoder_words, period_ns=config.servo_period_ns)
        self.digital_inputs.on_probe = probes.on_edge
        self.monitors = Monitors(self)
        self.stw1 = 0
        """STW1 in force: that of the last frame with control by PLC, and bit 10 of the last frame (PD-076)."""
        self.stw2 = 0
        self.g1_stw = 0
        self.powered = False
        self.controlled_cyclically = False
        """Valid cyclic data have come since power-on (PD-081)."""
        self.rejected = 0
        """Frames that were not taken over because of their length (PD-030)."""
        self.refuses_operation = False
        """S3 is not left, whatever the control word says."""
        self.torque_limit_Nm = math.inf
        """Upper torque limit in force, Nm."""
        self.protection_cap_Nm = math.inf
        self.injected_cap_Nm = math.inf
        self.cycle_at_ns = self.data_at_ns = 0
        self._frame: bytes | None = None
        self._on_locked = False
        self._standstill = False
        self._s3_ns = 0
        self._limit_words: tuple[int, int, int, float] | None = None
        self._compile()
        self.words = StatusWords(self)
        self.refresh()
        scheduler.every(config.servo_period_ns, self.core.step)
        scheduler.every(config.control_period_ns, self._control_cycle, priority=_CONTROL_PRIORITY)

    def _compile(self) -> None:
        """Find the place of every signal; what the telegram lacks is the 0 at the end of the row."""
        names = self.telegram.setpoint.names
        place = {name: at for at, name in enumerate(names)}
        self._narrow = "NSOLL_A" in place and "NSOLL_B" not in place
        self._nsoll_at = place.get("NSOLL_A" if self._narrow else "NSOLL_B", -1)
        self._stw2_at = place.get("STW2", -1)
        self._g1_at = place.get("G1_STW", -1)
        self._momred_at = place.get("MOMRED", -1)
        self._xerr_at = place.get("XERR", -1)
        self._kpc_at = place.get("KPC", -1)
        self._torque_at = tuple(
            place[name] for name in ("M_ADD1", "M_LIMIT_POS", "M_LIMIT_NEG") if name in place
        )
        self._row = (0,) * (len(names) + 1)

    def refresh(self) -> None:
        """Take changed parameters over."""
        self.channel.refresh()
        self.sign_of_life.tolerance = self.settings.sign_of_life_tolerance
        self._limit_words = None
        self._apply_torque()

    # -- what it is doing ------------------------------------------------------------------------------------------

    @property
    def state(self) -> AxisState:
        """State of the general state machine."""
        return self.machine.state

    @property
    def now_ns(self) -> int:
        """Present time, ns."""
        return self.scheduler.now

    @property
    def inputs(self) -> int:
        """Digital inputs: bit 0 negative limit, 1 positive limit, 2 home switch; 1 = actuated."""
        return self.digital_inputs.value

    @property
    def ready(self) -> bool:
        """Whether the power stage can be enabled."""
        return not (self.power.dc_link.low or self.safety.torque_off or self.refuses_operation)

    # -- life --------------------------------------------------------------------------------------------------------

    def power_on(self) -> None:
        """Switch the control supply on."""
        if self.powered:
            return
        self.powered = True
        self.encoder.power_on(self.mechanics.motor_angle)
        self.core.reinitialise()
        self.faults.restart()
        self.encoder_words.power_on()
        self.g1_words = self.encoder_words.words()
        self.words.restart()
        self.monitors.restart()
        self.power.restart(self.now_ns)
        self.digital_inputs.read()
        self._forget()
        self.refresh()

    def power_off(self) -> None:
        """Switch everything off at once: the motor coasts."""
        if not self.powered:
            return
        self.powered = False
        self.core.inhibit_pulses()
        self._forget()

    def _forget(self) -> None:
        """Begin as after power-on: nobody has spoken to the drive yet."""
        old = self.machine.state
        self.machine.reset()
        self.sign_of_life.reset()
        self.stw1 = self.stw2 = self.g1_stw = 0
        self.controlled_cyclically = False
        self._frame = None
        self._on_locked = self._standstill = False
        self._row = (0,) * len(self._row)
        self._changed(old)

    # -- bus cycle ---------------------------------------------------------------------------------------------------

    def receive(self, frame: bytes) -> None:
        """Take a telegram of the controller; it acts in the next `cycle`. One of a wrong length does not (PD-030)."""
        if len(frame) != self.telegram.setpoint.length:
            self.rejected += 1
        elif self.powered:
            self._frame = frame

    def cycle(self) -> None:
        """Do what is due once per bus cycle, in the order of the profile (PD-347)."""
        if not self.powered:
            return
        now = self.scheduler.now
        self.cycle_at_ns = now
        frame = self._frame
        if frame is not None:
            self._frame = None
            self._take_over(frame, now)
        elif not self.controlled_cyclically:
            return
        if self.isochronous and self.sign_of_life.step(self.stw2 >> SIGN_OF_LIFE_SHIFT):
            self.raise_fault(numbers.SIGN_OF_LIFE)
            self.encoder_words.report(_SIGN_OF_LIFE_FAILED)
        self.act()
        self.g1_words = self.encoder_words.step(self.g1_stw, now)
        row = self._row
        if self.machine.state is AxisState.S4:
            self._lead(row)
        self.words.watch_deviation()

    def transmit(self) -> bytes:
        """Return the telegram to the controller, with the values of now."""
        self.channel.sent_angle = self.core.position
        return self.words.frame()

    def _take_over(self, frame: bytes, now_ns: int) -> None:
        row = (*self.telegram.setpoint.unpack(frame), 0)
        stw1 = row[0]
        stw2 = row[self._stw2_at]
        self.controlled_cyclically = True
        self.data_at_ns = now_ns
        if not stw1 & _CONTROL:
            # Everything is kept but the bit itself; the sign of life is evaluated all the same (PD-076).
            self.stw1 &= ~_CONTROL
            self.stw2 = self.stw2 & ~SIGN_OF_LIFE_MASK | stw2 & SIGN_OF_LIFE_MASK
            return
        acknowledges = stw1 & ~self.stw1 & _ACKNOWLEDGE
        self.stw1 = stw1
        self.stw2 = stw2
        self.g1_stw = row[self._g1_at]
        self._row = row
        if acknowledges:
            self.faults.acknowledge()

    def _lead(self, row: tuple[int, ...]) -> None:
        """Let the setpoints act."""
        nsoll = row[self._nsoll_at]
        if self._narrow:
            nsoll <<= _N2_TO_N4
        kpc = row[self._kpc_at]
        if kpc and not (self.isochronous and self.settings.operating_mode == 3):
            self.faults.warn(DriveWarning.DSC_WITHOUT_CLOCK, True)
            kpc = 0
        elif self.faults.warnings:
            self.faults.warn(DriveWarning.DSC_WITHOUT_CLOCK, False)
        self.channel.step(self.stw1, nsoll, row[self._xerr_at], kpc)
        if self._torque_at:
            self.core.torque_offset = from_n2(row[self._torque_at[0]]) * self.settings.reference_torque_Nm
        if self._torque_at or self._momred_at >= 0:
            self._apply_torque()

    def _apply_torque(self) -> None:
        """Limit the torque: parameters, telegram 750, MOMRED, protection (PD-037, PD-038)."""
        row = self._row
        momred = row[self._momred_at] if self._momred_at >= 0 else 0
        high_word, low_word = (row[at] for at in self._torque_at[1:]) if self._torque_at else (0, 0)
        cap = min(self.protection_cap_Nm, self.injected_cap_Nm)
        words = (momred, high_word, low_word, cap)
        if words == self._limit_words:
            return
        self._limit_words = words
        settings = self.settings
        high, low = settings.torque_limits_Nm
        if self._torque_at and self.controlled_cyclically:
            high = min(high, max(0.0, from_n2(high_word) * settings.reference_torque_Nm))
            low = min(low, max(0.0, -from_n2(low_word) * settings.reference_torque_Nm))
        factor = torque_factor(momred, settings.momred_evaluation_percent)
        self.torque_limit_Nm = min(cap, high * factor)
        self.core.set_torque_limits(self.torque_limit_Nm, min(cap, low * factor))

    # -- state machine -----------------------------------------------------------------------------------------------

    def act(self) -> None:
        """Let the state machine make one step: in every bus cycle, and when something happens in between."""
        if not (self.powered and self.controlled_cyclically):
            return
        machine = self.machine
        old = machine.state
        action = machine.step(
            self._command(old),
            off=self.faults.off | self.safety.off,
            standstill=self._standstill,
            ready=self.ready and (old is not AxisState.S3 or self._delay_over()),
            synchronised=not self.isochronous or self.sign_of_life.synchronised,
        )
        if action is not Action.NOTHING:
            self._carry_out(action)
        if machine.state is not old:
            self._changed(old)

    def _delay_over(self) -> bool:
        return self.scheduler.now - self._s3_ns >= seconds_to_ns(self.config.power_on_delay_s)

    def _command(self, state: AxisState) -> int:
        """Return STW1 as the state machine sees it."""
        stw1 = self.stw1
        if self._on_locked:
            # What a fault has switched off needs a new ON (PD-115).
            if not stw1 & _ON:
                self._on_locked = False
            elif state is not AxisState.S1:
                stw1 &= ~_ON
        if stw1 & _JOG:
            both = stw1 & _JOG == _JOG
            self.faults.warn(DriveWarning.JOG_CONTRADICTION, both)
            if state is not AxisState.S1 and not self._on_locked and self.channel.jogging(stw1):
                stw1 |= _ON  # jogging switches on by itself, from S2 (PD-122)
        elif self.faults.warnings:
            self.faults.warn(DriveWarning.JOG_CONTRADICTION, False)
        return stw1

    def _carry_out(self, action: Action) -> None:
        core = self.core
        if action is Action.ENABLE:
            self._standstill = False
            core.enable_pulses()
            self._limit_words = None
            self._apply_torque()
        elif action is Action.INHIBIT:
            self.channel.dsc = False
            core.inhibit_pulses()
        elif action is Action.CONTINUE:
            self._standstill = False
        else:
            self._standstill = False
            self.channel.stop_ramp(self.stw1, quick=action is Action.QUICK_STOP)

    def _on_standstill(self) -> None:
        self._standstill = True
        self.act()

    def _changed(self, old: AxisState) -> None:
        new = self.machine.state
        if new is AxisState.S3:
            self._s3_ns = self.scheduler.now
        if new is not old:
            self.emit("drive.state", **{"from": old.text, "to": new.text})

    # -- faults and warnings -------------------------------------------------------------------------------------------

    def raise_fault(
        self, code: int, *, value: int = 0, persistent: bool = False, reaction: Off | None = None
    ) -> None:
        """Raise a fault: ZSW1 bit 3, fault buffer, reaction. Without effect while off.

        Args:
            code: Fault number, or the EMCY code of one of the catalogue, 1..65535.
            value: Fault value (PNU 949).
            persistent: The cause stays until `clear_fault_cause`: acknowledging opens a new situation.
            reaction: How the drive stops; None = as the catalogue says.

        """
        if not self.powered:
            return
        row = fault(code)
        if persistent:
            self.faults.keep(row.number, _always)
        if self.faults.enter(row, value, reaction=reaction):
            if row.number in numbers.OF_THE_ENCODER:
                self.encoder_words.report(_NOT_VALID)
            self._on_locked = self._on_locked or bool(self.faults.off)
            self.act()

    def clear_fault_cause(self, code: int | None = None) -> None:
        """End the cause of a persistent fault, or of all; the fault itself waits for its acknowledgement."""
        self.faults.forget(None if code is None else fault(code).number)

    def communication_lost(self) -> None:
        """Raise F08700, as the transport tells that the bus or the controller is gone (PD-345)."""
        self.raise_fault(numbers.CAN_ERROR)

    def _on_fault(self, row: Fault, value: int) -> None:
        self.emit("drive.fault", number=row.number, value=value, text=row.text)
        for callback in self.on_fault:
            callback(row, value)

    def _on_acknowledged(self) -> None:
        self.emit("drive.fault_acknowledged")
        for callback in self.on_fault:
            callback(None, 0)

    def _on_warning(self) -> None:
        warnings = [int(number) for number in self.faults.warnings]
        self.emit("drive.warning", warnings=", ".join(map(str, warnings)))
        self.on_warning()

    def emit(self, kind: str, **data: str | float | bool) -> None:
        """Write an event of this drive into the log, if there is one."""
        if self._history is not None:
            self._history.emit(self.name, kind, **data)

    # -- control cycle -------------------------------------------------------------------------------------------------

    def _control_cycle(self) -> None:
        if self.powered:
            self.monitors.update()

    def cap_torque(self, *, protection_Nm: float | None = None, injected_Nm: float | None = None) -> None:
        """Limit the torque because of heat, or from a test, Nm; inf = not."""
        if protection_Nm is not None:
            self.protection_cap_Nm = protection_Nm
        if injected_Nm is not None:
            self.injected_cap_Nm = injected_Nm
        self._apply_torque()

    def _on_inputs(self, _before: int) -> None:
        self.emit("drive.inputs", inputs=self.digital_inputs.value)
        self.on_inputs()


def _nothing() -> None:
    pass


def _always() -> bool:
    return True
