"""A pulse module with a stepper drive as a node of a CAN segment: telegram 3 in free process data words on
PDOs, latched by SYNC.

The node shows the objects of the PROFIdrive axis, of which it uses the process data words, the digital inputs
and the fault number. When SYNC is missing the module continues with its own clock, so that its watchdog sees
that no controller leads it any more.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, ClassVar, Final

from emulators.canopen_node import CanopenNode
from emulators.drive.emulated_drive import EmulatedDrive
from emulators.drive.machine import LinearAxisConfig
from emulators.drive.profidrive.canopen import objects
from emulators.drive.profidrive.canopen.eds import EDS
from emulators.drive.stepper import COLUMNS, StepperDrive
from emulators.drive.stepper_can_config import StepperNodeConfig
from emulators.process_words import ProcessWords
from emulators.trace import NMT_STATE, names_and_units, value_texts
from fieldbus.can.segment import CanSegment
from fieldbus.canopen.nmt import NmtState
from fieldbus.clock import Scheduler, seconds_to_ns
from fieldbus.errors import ConfigurationError
from fieldbus.history import History
from fieldbus.profidrive import pto_telegram, telegram
from fieldbus.profidrive.words import ENCODER_ERRORS

if TYPE_CHECKING:
    import numpy as np

_OWN_CLOCK_PRIORITY: Final = 2
_COLUMNS: Final = (*COLUMNS, NMT_STATE)


class StepperCanDrive(EmulatedDrive):
    """An emulated pulse module with its stepper drive on a CAN segment, and all that a test can do to them.

    It is off until `power_on`. Injected faults act at once.

    Args:
        scheduler: Time of the bench.
        segment: CAN segment.
        config: Node and drive.
        name: Name of the node on the segment and in the history.
        history: Log; None for none.
        rng: Not used: a pulse counter has no noise.

    """

    trace_enums: ClassVar = value_texts(_COLUMNS)

    def __init__(
        self,
        scheduler: Scheduler,
        segment: CanSegment,
        config: StepperNodeConfig,
        *,
        name: str,
        history: History | None = None,
        rng: np.random.Generator | None = None,  # noqa: ARG002 - every drive takes one
    ) -> None:
        drive = StepperDrive(scheduler, config.drive, name=name, history=history)
        super().__init__(
            scheduler,
            name=name,
            history=history,
            travel=drive.mechanics,
            switches=drive.switches,
            digital_inputs=drive.digital_inputs,
        )
        self.config = config
        self.drive = drive
        """Module, motor and machine without a bus."""
        self.mechanics = drive.mechanics
        self.node = CanopenNode(
            scheduler,
            segment,
            EDS.dictionary(),
            config.node_id,
            name=name,
            history=history,
            boot_time_s=config.boot_time_ms / 1000.0,
        )
        self.slave = slave = self.node.slave
        self._words = ProcessWords(
            slave, telegram(3) if config.drive.channel.settings.standard else pto_telegram()
        )
        self._sync_ns = 0
        unit = "m" if isinstance(config.drive.mechanics, LinearAxisConfig) else "rad"
        self.trace_columns = names_and_units(_COLUMNS, unit)
        """(name, unit) of the values of `trace_row`."""
        slave.on_sync.append(self._on_sync)
        slave.on_nmt_state.append(self._on_nmt_state)
        slave.on_reset.append(self._on_reset)
        slave.on_communication_error.append(self._on_communication_error)
        drive.on_inputs = self._show_inputs
        scheduler.every(config.cycle_ns, self._own_clock, priority=_OWN_CLOCK_PRIORITY)

    def trace_row(self) -> tuple[float, ...]:
        """Return the present values of `trace_columns`."""
        return (*self.drive.trace_row(), self.slave.nmt_state)

    def emitted_count(self) -> int:
        """Return the edges of the signal so far, for an encoder input."""
        generator = self.drive.channel.generator
        generator.advance(self.scheduler.now)
        return generator.count

    # -- life ------------------------------------------------------------------------------------------

    def power_on(self) -> None:
        """Switch the supply on."""
        if not self.slave.powered:
            self.drive.module.supply(True)
            self.drive.restart()
            self.slave.power_on()
            self._show_inputs()

    def power_off(self) -> None:
        """Switch everything off at once: no pulses, no current, no answer."""
        if self.slave.powered:
            self.slave.power_off()
            self.drive.module.supply(False)
            self.drive.channel.restart()
            self.drive.motor.energised = False
            self.drive.log_changes()

    def _on_reset(self, application: bool) -> None:
        if application:
            self.drive.restart()
        self._show_inputs()

    def _on_nmt_state(self, old: NmtState, new: NmtState) -> None:
        self.drive.emit("drive.nmt", **{"from": old.name, "to": new.name})
        if new is NmtState.OPERATIONAL:
            self._words.begin()

    def _on_communication_error(self, reason: str) -> None:
        """A controller that is gone is one that has stopped (PTO-204); a frame of one that is back is needed
        to continue.
        """
        self.drive.emit("drive.communication_lost", reason=reason)
        self.drive.channel.stop_controller(True)
        self.drive.channel.stop_controller(False)

    def _show_inputs(self) -> None:
        self.slave.set(objects.DIGITAL_INPUTS, 0, self.drive.digital_inputs.value)
        self.slave.set(objects.FAULT_NUMBER, 0, int(self.drive.channel.fault))

    # -- bus cycle -------------------------------------------------------------------------------------

    def _on_sync(self, time_ns: int) -> None:
        self._sync_ns = time_ns
        if self.slave.nmt_state is NmtState.OPERATIONAL:
            self._cycle(self._words.take())

    def _own_clock(self) -> None:
        operational = self.slave.nmt_state is NmtState.OPERATIONAL
        if not operational or self.scheduler.now - self._sync_ns > 2 * self.config.cycle_ns:
            self._cycle(None)

    def _cycle(self, frame: bytes | None) -> None:
        if not self.slave.powered:
            return
        module = self.drive.module
        if frame is not None:
            module.receive(0, frame)
        fault = self.drive.channel.fault
        module.cycle()
        self.drive.log_changes()
        if self.drive.channel.fault is not fault:
            self._show_inputs()
        self._words.give(module.transmit(0)[0])

    # -- faults ----------------------------------------------------------------------------------------

    def short_outputs(self, present: bool, channel: int = 0) -> None:
        """Bring about a short circuit at the outputs of a channel, or remove
        it: both channels stop (PTO-207).
        """
        self.drive.module.short_circuit(channel, present)
        self._show_inputs()

    def disconnect_load_supply(self, missing: bool) -> None:
        """Take the load supply of the outputs away, or give it back (PTO-209)."""
        self.drive.module.supply(not missing)

    def unplug_module(self, failed: bool) -> None:
        """Let the module be pulled out of its station, or plugged in again (PTO-210)."""
        self.drive.module.failed = failed
        if failed:
            self.drive.channel.restart()
            self.drive.log_changes()

    def report_encoder_error(self, code: int, present: bool) -> None:
        """Bring about the lasting cause of an error of the encoder feedback, or end it.

        Raises:
            ConfigurationError: There is no such code.

        """
        interface = self.drive.channel.interface
        if code not in ENCODER_ERRORS:
            raise ConfigurationError("encoder error", code, ", ".join(map(str, ENCODER_ERRORS)))
        (interface.set_error if present else interface.clear_error)(code)

    def force_ready(self, level: bool | None) -> None:
        """Bring a level to the ready input DR; None: that of the power stage."""
        self.drive.force_ready(level)

    def lose_steps(self, periods: int) -> None:
        """Let the shaft slip by whole electrical periods; positive: it lags behind."""
        self.drive.lose_steps(periods)

    def raise_fault(self, code: int = 1, *, persistent: bool = False) -> None:
        """Raise the only fault: an error of a digital output, whatever the number.

        Args:
            code: Not used; 1 is shown.
            persistent: The short circuit stays until `clear_fault_cause`.

        """
        del code
        self.short_outputs(True)
        if not persistent:
            self.short_outputs(False)

    def clear_fault_cause(self, code: int | None = None) -> None:
        """End the short circuit; the fault itself waits for its acknowledgement."""
        del code
        self.short_outputs(False)

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
