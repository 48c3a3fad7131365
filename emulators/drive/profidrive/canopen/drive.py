"""The PROFIdrive axis as a node of a CAN segment: its telegram in free process data
words on PDOs, latched by SYNC.

At SYNC the drive takes what has come (`process_words`), makes its cycle, and its answer goes into the TPDOs
of the same SYNC. A drive that is not isochronous makes its cycle by itself when SYNC is missing.
"""

from __future__ import annotations

from contextlib import suppress
from typing import TYPE_CHECKING, Any, ClassVar, Final

from emulators.canopen_node import CanopenNode
from emulators.drive.profidrive.bus_drive import DriveOnBus
from emulators.drive.profidrive.canopen import objects
from emulators.drive.profidrive.canopen.cia402_objects import Cia402Objects
from emulators.drive.profidrive.canopen.config import ProfidriveNodeConfig
from emulators.drive.profidrive.canopen.eds import EDS
from emulators.drive.profidrive.canopen.sdo_parameters import ParameterObjects
from emulators.drive.profidrive.faults import catalogue as numbers
from emulators.drive.profidrive.faults.catalogue import Fault
from emulators.drive.profidrive.statemachine import Off
from emulators.process_words import ProcessWords, SyncCycle
from emulators.trace import NMT_STATE, value_texts
from fieldbus.can.segment import CanSegment
from fieldbus.canopen.abort import AbortCode, SdoAbort
from fieldbus.canopen.nmt import NmtState
from fieldbus.clock import Scheduler, seconds_to_ns
from fieldbus.errors import HilError
from fieldbus.history import History

if TYPE_CHECKING:
    import numpy as np

_MEMORY: Final = "parameters"
_WITH_PARAMETERS: Final = (1, 3)
"""Groups of 1010h and 1011h to which the parameters of the drive belong: all, application."""
_NOT_VALID: Final = 0x0001
_LEFT_OPERATIONAL: Final = 0x8100
"""EMCY when the master has ended communication by NMT: no peer is missing, so it is not 8130h."""
_REACTIONS: Final = {1: Off.OFF2, 2: Off.OFF2, 3: Off.OFF3}
"""6007h: 0 nothing, 1 fault, 2 pulses off, 3 quick stop (PD-345)."""


class ProfidriveCanDrive(DriveOnBus):
    """An emulated PROFIdrive axis on a CAN segment, with all that a test can do to it and its machine.

    It is off until `power_on`; the machine moves from the start. Injected faults act at once.

    Args:
        scheduler: Time of the bench.
        segment: CAN segment.
        config: Node and drive.
        name: Name of the node on the segment and in the history.
        history: Log; None for none.
        rng: Source of the encoder's noise; None: the encoder cannot be made noisy.

    Raises:
        ConfigurationError: The configuration does not fit together, or the telegram has more than 16
            words in a direction.

    """

    trace_enums: ClassVar = {**DriveOnBus.trace_enums, **value_texts((NMT_STATE,))}
    bus_columns: ClassVar = (NMT_STATE,)

    def __init__(
        self,
        scheduler: Scheduler,
        segment: CanSegment,
        config: ProfidriveNodeConfig,
        *,
        name: str,
        history: History | None = None,
        rng: np.random.Generator | None = None,
    ) -> None:
        super().__init__(scheduler, config.drive, name=name, history=history, rng=rng)
        self.node_config = config
        drive = self.drive
        self.node = CanopenNode(
            scheduler,
            segment,
            EDS.dictionary(),
            config.node_id,
            name=name,
            history=history,
            boot_time_s=config.boot_time_ms / 1000.0,
            storage=config.storage,
        )
        self.slave = self.node.slave
        self._words = ProcessWords(self.slave, drive.telegram)
        self._emcys: set[int] = set()
        self._left_operational = False
        slave = self.slave
        slave.on_write(objects.ABORT_CONNECTION, 0, _check_abort_connection)
        store = slave.store
        self._configured = self.parameters.store.saved
        """What counts as saved when nothing is: the configuration."""
        parameters = self.parameters.store
        store.foreign = Cia402Objects(drive, parameters, ParameterObjects(parameters))
        store.on_save = self._save_parameters
        store.on_restore = self._restore_parameters
        self.parameters.memory.on_saved = self._keep_parameters
        if _MEMORY in store.extra:
            self.parameters.store.saved = store.extra[_MEMORY]
        slave.on_nmt_state.append(self._on_nmt_state)
        SyncCycle(
            scheduler,
            slave,
            self._words,
            self._cycle,
            free_running_ns=None if drive.isochronous else config.drive.cycle_ns,
        )
        slave.on_reset.append(self._on_reset)
        slave.on_communication_error.append(self._on_communication_error)
        drive.on_fault.append(self._on_fault)
        drive.on_inputs = lambda: slave.set(objects.DIGITAL_INPUTS, 0, drive.inputs)
        drive.on_warning = lambda: slave.set(objects.WARNING_NUMBER, 0, drive.faults.warning_number)

    def trace_row(self) -> tuple[float, ...]:
        """Return the present values of `trace_columns`; position and velocity
        are those of the true mechanics.
        """
        return self._trace_values((self.slave.nmt_state,))

    # -- life ------------------------------------------------------------------------------------------

    def power_on(self) -> None:
        """Switch the control supply on."""
        if not self.slave.powered:
            self.slave.power_on()
            self.parameters.power_on()
            self.drive.power_on()
            self._show_all()

    def power_off(self) -> None:
        """Switch everything off at once: the motor coasts, all but the non-volatile memory is lost."""
        if self.slave.powered:
            self.slave.power_off()
            self.drive.power_off()
            self._emcys.clear()

    def _on_reset(self, application: bool) -> None:
        if application:
            self.drive.power_off()
            self.parameters.power_on()
            self.drive.power_on()
            self._emcys.clear()
        self._show_all()

    # -- memory of the parameters (PD-250, PD-344) -----------------------------------------------------

    def _save_parameters(self, group: int) -> None:
        if group in _WITH_PARAMETERS:
            self.parameters.store.save()
            self.slave.store.extra[_MEMORY] = self.parameters.store.saved

    def _restore_parameters(self, area: int) -> None:
        if area in _WITH_PARAMETERS:
            self.slave.store.extra.pop(_MEMORY, None)
            self.parameters.store.saved = self._configured

    def _keep_parameters(self) -> None:
        """Keep what p0971 or p0977 has saved, in the file too if there is one."""
        store = self.slave.store
        store.extra[_MEMORY] = self.parameters.store.saved
        with suppress(HilError):  # the history reports a file that cannot be written
            store.persist()

    def _show_all(self) -> None:
        drive, slave = self.drive, self.slave
        slave.set(objects.DIGITAL_INPUTS, 0, drive.inputs)
        slave.set(objects.FAULT_NUMBER, 0, drive.faults.number)
        slave.set(objects.WARNING_NUMBER, 0, drive.faults.warning_number)

    def _on_nmt_state(self, old: NmtState, new: NmtState) -> None:
        self.drive.emit("drive.nmt", **{"from": old.name, "to": new.name})

    # -- bus cycle -------------------------------------------------------------------------------------

    def _cycle(self) -> None:
        words = self._words
        frame = words.take()
        if frame is not None:
            self.receive(frame)
        self.drive.cycle()
        answer = self.transmit()
        if answer is None:
            words.keep_back()
        else:
            words.give(answer)

    # -- faults ----------------------------------------------------------------------------------------

    def _on_communication_error(self, reason: str) -> None:
        """React to a lost controller as 6007h says (PD-345)."""
        reaction = _REACTIONS.get(self.slave.values[objects.ABORT_CONNECTION << 8])
        if reaction is not None and self.drive.controlled_cyclically:
            self.drive.emit("drive.communication_lost", reason=reason)
            self._left_operational = reason == "nmt"
            self.drive.raise_fault(numbers.CAN_ERROR, reaction=reaction)

    def _on_fault(self, row: Fault | None, value: int) -> None:
        slave = self.slave
        slave.set(objects.FAULT_NUMBER, 0, self.drive.faults.number)
        if row is not None:
            by_nmt = row.number == numbers.CAN_ERROR and self._left_operational
            emcy = _LEFT_OPERATIONAL if by_nmt else row.emcy
            self._emcys.add(emcy)
            slave.emcy(emcy, data=row.number.to_bytes(2, "little") + (value & 0xFFFF).to_bytes(2, "little"))
            return
        for code in sorted(self._emcys):
            slave.emcy_clear(code)
        self._emcys.clear()

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


def _check_abort_connection(value: Any) -> None:
    if value != 0 and value not in _REACTIONS:
        raise SdoAbort(AbortCode.VALUE)
