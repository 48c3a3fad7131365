"""A PROFIdrive axis without a bus: machine, encoder, servo core, state machine,
setpoint channel, faults, words.

A transport hands telegrams over with `receive`, calls `cycle` once per bus cycle, and sends what `transmit`
returns. Within `cycle` the order is that of the profile (PD-347): telegram, sign of life, state machine,
encoder, setpoint channel, faults. The servo core runs on the scheduler, several times per bus cycle. Faults,
safety inputs and standstill do not wait for the bus: they act when they happen.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import TYPE_CHECKING, Final

from emulators.drive.drive_train import build_drive_train
from emulators.drive.machine import LinearAxisConfig
from emulators.drive.profidrive.config import DriveSettings, ProfidriveConfig
from emulators.drive.profidrive.data_sets import DataSets
from emulators.drive.profidrive.faults import catalogue as numbers
from emulators.drive.profidrive.faults.catalogue import Fault, fault
from emulators.drive.profidrive.faults.state import FaultState
from emulators.drive.profidrive.modes import OperatingMode
from emulators.drive.profidrive.modes.position import PositionMode
from emulators.drive.profidrive.modes.setpoint_channel import SetpointChannel
from emulators.drive.profidrive.modes.speed import SpeedDeviation, SpeedMode
from emulators.drive.profidrive.monitors import Monitors
from emulators.drive.profidrive.operation import Operation
from emulators.drive.profidrive.positioner.positioner import Positioner
from emulators.drive.profidrive.probes import ProbeLatch
from emulators.drive.profidrive.process_data import ProcessData
from emulators.drive.profidrive.safety.functions import SafetyFunctions
from emulators.drive.profidrive.safety.state import SafetyState
from emulators.drive.profidrive.second_encoder import SecondEncoder
from emulators.drive.profidrive.signals import (
    ActualTelegram,
    Getter,
    motor_signals,
    position_signals,
    safety_signals,
    second_encoder_signals,
    status_signals,
)
from emulators.drive.profidrive.statemachine import AxisState, GeneralStateMachine, Off
from emulators.drive.profidrive.status_words import StatusWords
from emulators.drive.profidrive.torque import TorqueLimits
from emulators.encoder.profidrive import EncoderInterface
from fieldbus.clock import Scheduler, seconds_to_ns
from fieldbus.history import History
from fieldbus.profidrive.sign_of_life import SignOfLife
from fieldbus.profidrive.words import G_STW, SIGN_OF_LIFE_MASK, SIGN_OF_LIFE_SHIFT, STW1, STW2

if TYPE_CHECKING:
    import numpy as np


_CONTROL_PRIORITY: Final = 1
"""The control cycle follows the servo step of the same instant."""
_ACKNOWLEDGE: Final = int(STW1.ACKNOWLEDGE)
_OPEN_BRAKE: Final = int(STW1.OPEN_BRAKE)
_PARK_AXIS: Final = int(STW2.PARKING)
_PARK_ENCODER: Final = int(G_STW.PARK)
_CONTROL: Final = int(STW1.CONTROL_BY_PLC)
_DATA_SET: Final = 0x1F
_S4: Final = AxisState.S4
_SIGN_OF_LIFE_FAILED: Final = 0x0F02
_NOT_VALID: Final = 0x0001
_ABSENT: Final = (0,)
"""Behind the signals of a telegram: what stands for those that it does not have."""


FaultListener = Callable[[Fault | None, int], None]


class ProfidriveDrive:
    """A servo drive with its motor and machine, with PROFIdrive's telegrams (application classes 1, 3 and 4).

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
        "_frame",
        "_g1_at",
        "_g2_at",
        "_history",
        "_stw2_at",
        "actual",
        "config",
        "core",
        "data",
        "data_sets",
        "deviation",
        "digital_inputs",
        "encoder",
        "encoder_words",
        "faults",
        "isochronous",
        "mechanics",
        "mode",
        "monitors",
        "name",
        "on_fault",
        "on_inputs",
        "on_warning",
        "operation",
        "power",
        "powered",
        "probe_latch",
        "rejected",
        "safety",
        "safety_state",
        "scheduler",
        "second",
        "settings",
        "sign_of_life",
        "telegram",
        "torque",
        "train",
        "watched_by_transport",
        "words",
    )

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
        """Parameters in effect; call `refresh` when one has changed."""
        self.telegram = config.build_telegram()
        self.isochronous = config.works_isochronously
        self.train = train = build_drive_train(
            scheduler,
            mechanics=config.mechanics,
            switches=config.switches,
            encoder=config.encoder_with_fine_resolution,
            brake=config.brake,
            tuning=config.tuning,
            servo_period_ns=config.servo_period_ns,
            rng=rng,
        )
        """Motor, machine and servo core."""
        self.core = train.core
        self.encoder = train.encoder
        self.mechanics = train.mechanics
        self.power = train.build_power_stage(
            supply=config.supply,
            thermal=config.thermal,
            rated_torque_Nm=config.rated_torque_nm,
        )
        self.faults = FaultState(scheduler)
        self.faults.on_fault = self._on_fault
        self.faults.pulses = lambda: self.core.enabled
        self.faults.on_acknowledged = self._on_acknowledged
        self.faults.on_warning = self._on_warning
        self.on_fault: list[FaultListener] = []
        """Called with a new fault and its value, and with None when a situation has been acknowledged."""
        self.on_inputs: Callable[[], object] = _nothing
        """Called when the digital inputs have changed."""
        self.on_warning: Callable[[], object] = _nothing
        """Called when the warnings have changed."""
        self.digital_inputs = train.digital_inputs
        self.digital_inputs.on_change = self._on_inputs
        self.sign_of_life = SignOfLife(tolerance=self.settings.sign_of_life_tolerance)
        signs = self.sign_of_life if self.isochronous else None
        self.data = ProcessData(self.telegram.setpoint)
        """Setpoints and control words in effect."""
        self._stw2_at = self.data.place("STW2")
        self._g1_at = self.data.place("G1_STW")
        self._g2_at = self.data.place("G2_STW")
        machine = GeneralStateMachine()
        self.safety_state = SafetyState()
        """Safety functions in effect."""
        cycle_s = config.cycle_ns / 1e9
        steps = config.cycle_ns // config.servo_period_ns
        self.torque = TorqueLimits(self.core, self.data, self.settings, steps=steps)
        self.deviation = SpeedDeviation(self.core, self.settings, cycle_s=cycle_s)
        self.mode: OperatingMode = self._build_mode(machine, steps, cycle_s)
        """What the setpoints mean: speed, or tasks of the positioner; one telegram has
        the one or the other (PD-032).
        """
        self.operation = Operation(
            scheduler,
            machine=machine,
            core=self.core,
            data=self.data,
            faults=self.faults,
            safety=self.safety_state,
            mode=self.mode,
            torque=self.torque,
            dc_link=self.power.dc_link,
            signs=signs,
            power_on_delay_ns=seconds_to_ns(config.power_on_delay_ms / 1000.0),
            emit=self.emit,
        )
        self.safety = SafetyFunctions(
            scheduler,
            config.safety,
            settings=self.settings,
            core=self.core,
            mechanics=self.mechanics,
            machine=machine,
            mode=self.mode,
            data=self.data,
            faults=self.faults,
            state=self.safety_state,
            raise_fault=self.raise_fault,
            act=self.operation.act,
            emit=self.emit,
        )
        self.encoder_words = EncoderInterface(self.encoder, config.encoder_format)
        """Encoder interface G1."""
        self.second = (
            None
            if config.encoder2 is None
            else SecondEncoder(
                config.encoder2,
                self.mechanics,
                lead_mm=config.mechanics.lead_screw_mm
                if isinstance(config.mechanics, LinearAxisConfig)
                else None,
                name=f"{name}.encoder2",
                faults=self.faults,
                rng=rng,
            )
        )
        """The second encoder, G2; None = not fitted."""
        self.probe_latch = probes = ProbeLatch(
            scheduler, self.core, self.encoder_words, period_ns=config.servo_period_ns
        )
        if self.second is not None:
            probes.others.append(self.second.probe_edge)
        self.digital_inputs.on_probe = probes.on_edge
        if isinstance(self.mode, PositionMode):
            probes.listeners.append(self.mode.probe_edge)
        self.monitors = Monitors(
            scheduler,
            config,
            settings=self.settings,
            core=self.core,
            power=self.power,
            data=self.data,
            signs=signs,
            torque=self.torque,
            safety=self.safety,
            faults=self.faults,
            raise_fault=self.raise_fault,
        )
        self.powered = False
        self.rejected = 0
        """Frames that were not taken over because of their length (PD-030)."""
        self.watched_by_transport = False
        """The transport reports by `accessed` that process data come (PD-292); otherwise every
        telegram does.
        """
        self._frame: bytes | None = None
        self.data_sets = DataSets(self.settings, config.data_sets, on_change=self.refresh)
        self.words = StatusWords(
            self.core,
            self.settings,
            self.data,
            operation=self.operation,
            mode=self.mode,
            faults=self.faults,
            safety=self.safety_state,
            torque=self.torque,
            deviation=self.deviation,
            signs=self.sign_of_life,
            data_sets=self.data_sets,
            operation_while_braking=config.operation_while_braking,
        )
        self.actual = ActualTelegram(self.telegram.actual, self._sources())
        """The telegram to the controller."""
        self.refresh()
        scheduler.every(config.control_period_ns, self._control_cycle, priority=_CONTROL_PRIORITY)

    def _build_mode(self, machine: GeneralStateMachine, steps: int, cycle_s: float) -> OperatingMode:
        config = self.config
        channel = SetpointChannel(
            self.core, self.settings, steps=steps, cycle_s=cycle_s, interpolation=config.interpolation
        )
        if config.positions:
            return PositionMode(
                channel,
                Positioner(self.core, config.positioner, cycle_s=cycle_s),
                self.data,
                machine=machine,
                safety=self.safety_state,
                faults=self.faults,
                torque=self.torque,
                inputs=self.digital_inputs,
                keeps_home=config.encoder.kind == "absolute",
                raise_fault=self.raise_fault,
            )
        return SpeedMode(
            channel,
            self.core,
            self.data,
            settings=self.settings,
            faults=self.faults,
            deviation=self.deviation,
            isochronous=self.isochronous,
        )

    def _sources(self) -> dict[str, Getter]:
        """Return where the signals to the controller come from."""
        sources = {
            **status_signals(self.words, self.faults, self.digital_inputs),
            **motor_signals(self.core, self.settings),
            **second_encoder_signals(self.second),
            **safety_signals(self.safety, self.settings),
        }
        if isinstance(self.mode, PositionMode):
            sources.update(position_signals(self.mode.positioner))
        return sources

    def refresh(self) -> None:
        """Take changed parameters over."""
        self.channel.refresh()
        self.sign_of_life.tolerance = self.settings.sign_of_life_tolerance
        self.torque.renew()

    # -- what it is doing ------------------------------------------------------------------------------

    @property
    def state(self) -> AxisState:
        """State of the general state machine."""
        return self.operation.machine.state

    @property
    def machine(self) -> GeneralStateMachine:
        """The general state machine."""
        return self.operation.machine

    @property
    def channel(self) -> SetpointChannel:
        """The setpoint channel: of speed mode, and with the stop ramps of both modes."""
        return self.mode.channel

    @property
    def torque_limit_Nm(self) -> float:
        """Upper torque limit in effect, Nm."""
        return self.torque.upper_Nm

    @property
    def now_ns(self) -> int:
        """Present time, ns."""
        return self.scheduler.now

    @property
    def inputs(self) -> int:
        """Digital inputs: bit 0 negative limit, 1 positive limit, 2 home switch; 1 = actuated."""
        return self.digital_inputs.value

    @property
    def stw1(self) -> int:
        """STW1 in effect."""
        return self.data.stw1

    @property
    def row(self) -> tuple[int, ...]:
        """Signals of the last telegram that was taken over, and a 0 for those that it does not have."""
        return self.data.row

    @property
    def g1_words(self) -> tuple[int, int, int]:
        """G1_ZSW, G1_XIST1, G1_XIST2."""
        return self.actual.g1_words

    @property
    def controlled_cyclically(self) -> bool:
        """Whether valid cyclic data have come since power-on (PD-081)."""
        return self.data.controlled_cyclically

    # -- life ------------------------------------------------------------------------------------------

    def power_on(self) -> None:
        """Switch the control supply on."""
        if self.powered:
            return
        self.powered = True
        self.encoder.power_on(self.mechanics.motor_angle)
        self.core.reinitialise()
        self.faults.restart()
        self.encoder_words.power_on()
        self.actual.g1_words = self.encoder_words.words()
        if self.second is not None:
            self.second.power_on()
        self.deviation.restart()
        self.monitors.restart()
        self.power.restart(self.now_ns)
        self.safety.restart()
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
        """Begin as after power-on: no telegram has come yet."""
        self.sign_of_life.reset()
        self.data.restart()
        self.core.brake.forced_open = False
        self._frame = None
        self.data_sets.restart()
        self.mode.restart()
        self.operation.reset()

    # -- bus cycle -------------------------------------------------------------------------------------

    def receive(self, frame: bytes) -> None:
        """Take a telegram of the controller; it acts in the next `cycle`. One of a
        wrong length does not (PD-030).
        """
        if len(frame) != self.telegram.setpoint.length:
            self.rejected += 1
        elif self.powered:
            self._frame = frame

    def cycle(self) -> None:
        """Do what is due once per bus cycle, in the order of the profile (PD-347)."""
        if not self.powered:
            return
        now = self.scheduler.now
        data = self.data
        data.cycle_at_ns = now
        frame = self._frame
        if frame is not None:
            self._frame = None
            self._take_over(frame, now)
        elif not data.controlled_cyclically:
            return
        if self.isochronous and self.sign_of_life.step(data.stw2 >> SIGN_OF_LIFE_SHIFT):
            self.raise_fault(numbers.SIGN_OF_LIFE)
            self.encoder_words.report(_SIGN_OF_LIFE_FAILED)
            if self.second is not None:
                self.second.interface.report(_SIGN_OF_LIFE_FAILED)
        operation = self.operation
        operation.act()
        park = _PARK_ENCODER if data.stw2 & _PARK_AXIS and operation.parked else 0
        self.actual.g1_words = self.encoder_words.step(data.g1_stw | park, now)
        if self.second is not None:
            self.second.step(data.row[self._g2_at] | park, now)
        safety = self.safety_state
        if operation.machine.state is _S4 and not (safety.holding or safety.testing_brake):
            self.mode.lead(data.row)
        if self.torque.follows_telegram and self.core.enabled:
            self.torque.lead()
        if self.safety.brake_test.wired:
            self.safety.brake_test.step()
        self.mode.watch()
        self.deviation.watch()

    def transmit(self) -> bytes:
        """Return the telegram to the controller, with the values of now."""
        self.channel.sent_angle = self.core.position
        return self.actual.frame()

    def accessed(self) -> None:
        """Note that process data have come, where the transport watches that (PD-292)."""
        self.data.received_at_ns = self.scheduler.now

    def _take_over(self, frame: bytes, now_ns: int) -> None:
        data = self.data
        row = self.telegram.setpoint.unpack(frame) + _ABSENT
        stw1 = row[0]
        stw2 = row[self._stw2_at]
        if not (self.watched_by_transport and data.controlled_cyclically):
            data.received_at_ns = now_ns
        data.controlled_cyclically = True
        if not stw1 & _CONTROL:
            # Everything is kept but the bit itself; the sign of life is evaluated all the same (PD-076).
            data.stw1 &= ~_CONTROL
            data.stw2 = data.stw2 & ~SIGN_OF_LIFE_MASK | stw2 & SIGN_OF_LIFE_MASK
            if self.config.control_lost == "fault" and self.operation.machine.enabled:
                self.raise_fault(numbers.CONTROL_LOST)
            return
        sets = self.data_sets
        if sets.changing or stw2 & _DATA_SET != sets.wanted:
            sets.changing = False
            sets.select(stw2 & _DATA_SET)
        if (stw1 ^ data.stw1) & _OPEN_BRAKE:
            self.core.brake.forced_open = bool(stw1 & _OPEN_BRAKE)  # without any condition (PD-056)
        acknowledges = stw1 & ~data.stw1 & _ACKNOWLEDGE
        data.stw1 = stw1
        data.stw2 = stw2
        data.g1_stw = row[self._g1_at]
        data.row = row
        if acknowledges:
            self.faults.acknowledge()

    def act(self) -> None:
        """Let the state machine make one step: in every bus cycle, and when something happens in between."""
        self.operation.act()

    # -- faults and warnings ---------------------------------------------------------------------------

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
            if self.faults.off:
                self.operation.lock_on()
            self.operation.act()

    def clear_fault_cause(self, code: int | None = None) -> None:
        """End the cause of a persistent fault, or of all; the fault itself waits for its acknowledgement."""
        self.faults.forget(None if code is None else fault(code).number)

    def communication_lost(self) -> None:
        """Raise F08700, because the transport reports that the bus or the controller is gone (PD-345)."""
        self.raise_fault(numbers.CAN_ERROR)

    def _on_fault(self, row: Fault, value: int) -> None:
        self.emit("drive.fault", number=row.number, value=value, text=row.text, diagnosis=str(row.diagnosis))
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

    # -- control cycle ---------------------------------------------------------------------------------

    def _control_cycle(self) -> None:
        if self.powered:
            self.monitors.update()

    def _on_inputs(self, _before: int) -> None:
        self.emit("drive.inputs", inputs=self.digital_inputs.value)
        self.on_inputs()


def _nothing() -> None:
    pass


def _always() -> bool:
    return True
