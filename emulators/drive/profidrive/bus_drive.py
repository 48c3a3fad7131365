"""A PROFIdrive axis behind any transport, with all that a test can do to it and its machine (PD-349)."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import TYPE_CHECKING, ClassVar, Final

from emulators.drive.emulated_drive import MainsDrive
from emulators.drive.profidrive.config import ProfidriveConfig
from emulators.drive.profidrive.drive import ProfidriveDrive
from emulators.drive.profidrive.faults import catalogue as numbers
from emulators.drive.profidrive.faults.catalogue import DriveWarning
from emulators.drive.profidrive.parameters.drive_parameters import DriveParameters
from emulators.drive.profidrive.second_encoder import SecondEncoder
from emulators.drive.profidrive.statemachine import AxisState
from emulators.encoder import AbsoluteEncoder
from emulators.trace import SERVO, Column, names_and_units, servo_values, value_texts
from fieldbus.clock import Scheduler
from fieldbus.errors import UnsupportedFaultError
from fieldbus.history import History
from fieldbus.profidrive import Telegram

if TYPE_CHECKING:
    import numpy as np

TelegramSeam = Callable[[bytes], bytes | None]
"""For faults: another telegram, or none, in place of one."""
_NOT_VALID: Final = 0x0001


_COLUMNS_BEFORE_BUS: Final = (
    *SERVO,
    Column("following_error", "rad"),
    Column("encoder_increments", "inc"),
    Column("drive_stw1"),
    Column("drive_zsw1"),
    Column("drive_stw2"),
    Column("drive_zsw2"),
    Column("state", texts={state.number: state.text for state in AxisState}),
)
_COLUMNS_AFTER_BUS: Final = (
    Column("inputs"),
    Column("brake_closed"),
    Column("fault_number"),
    Column("warning_number"),
    Column("safety"),
    Column("nsoll"),
    Column("xerr"),
    Column("kpc"),
    Column("m_add"),
)
"""The last four are setpoints of the telegram as they came, whole numbers: N4 or N2, increments of G1_XIST1,
0.001 1/s, N2; 0 where the telegram does not have them.
"""
_SECOND_ENCODER_COLUMNS: Final = (Column("g2_zsw"), Column("g2_xist1", "inc"), Column("g2_xist2"))


class DriveOnBus(MainsDrive):
    """A drive with its machine and the fault methods; a transport inherits it and carries the telegrams.

    Args:
        scheduler: Time of the bench.
        config: The drive.
        name: Name of the drive in the history.
        history: Log; None for none.
        rng: Source of the encoder's noise; None: the encoder cannot be made noisy.

    Raises:
        ConfigurationError: The configuration does not fit together.

    """

    bus_columns: ClassVar[tuple[Column, ...]] = ()
    """Columns of the trace that the transport adds."""
    trace_enums: ClassVar = value_texts(_COLUMNS_BEFORE_BUS)

    def __init__(
        self,
        scheduler: Scheduler,
        config: ProfidriveConfig,
        *,
        name: str,
        history: History | None = None,
        rng: np.random.Generator | None = None,
    ) -> None:
        drive = ProfidriveDrive(scheduler, config, name=name, history=history, rng=rng)
        super().__init__(
            scheduler,
            name=name,
            history=history,
            train=drive.train,
            power=drive.power,
            control_period_ns=config.control_period_ns,
        )
        self.config = config
        self.drive = drive
        """The axis without a bus."""
        self.parameters = DriveParameters(drive)
        """Parameters of the drive, read and written by the rules of the bus."""
        self.setpoint_seam: TelegramSeam | None = None
        """Changes what comes from the controller, before the drive takes it."""
        self.actual_seam: TelegramSeam | None = None
        """Changes what the drive sends, before it goes on the bus."""
        columns = (*_COLUMNS_BEFORE_BUS, *self.bus_columns, *_COLUMNS_AFTER_BUS)
        if config.encoder2 is not None:
            columns += _SECOND_ENCODER_COLUMNS
        self.trace_columns = names_and_units(columns, drive.train.load_unit)
        """(name, unit) of the values of `trace_row`."""

    def _trace_values(self, bus: tuple[float, ...] = ()) -> tuple[float, ...]:
        """Return the present values of `trace_columns`; `bus`: those of `bus_columns`."""
        drive = self.drive
        core = drive.core
        faults = drive.faults
        data = drive.data
        row = data.row
        nsoll, xerr, kpc, m_add = data.control_places
        words = drive.words
        brake = core.brake
        # Compiled, sums make no list, as stars in a tuple do, and numbers become floats here for a quarter of
        # what they cost when the recorder packs them.
        values = servo_values(drive.mechanics, core)
        values += (
            core.position_demand - core.position,
            float(drive.encoder.increments),
            float(data.stw1),
            float(words.zsw1()),
            float(data.stw2),
            float(words.zsw2()),
            float(drive.operation.machine.number),
        )
        values += bus
        values += (
            float(drive.digital_inputs.value),
            float(brake.torque_Nm > 0.0 and brake.holding_torque_Nm > 0.0),
            float(faults.number),
            float(faults.warning_number),
            float(drive.safety.s_zsw1b()),
            float(row[nsoll]),
            float(row[xerr]),
            float(row[kpc]),
            float(row[m_add]),
        )
        return values if drive.second is None else values + drive.second.words

    @property
    def state(self) -> AxisState:
        """State of the general state machine."""
        return self.drive.state

    # -- telegrams -------------------------------------------------------------------------------------

    @property
    def telegram(self) -> Telegram:
        """Layout of both directions."""
        return self.drive.telegram

    def receive(self, frame: bytes) -> None:
        """Take a telegram of the controller; it acts in the next cycle of the drive."""
        taken = frame if self.setpoint_seam is None else self.setpoint_seam(frame)
        if taken is not None:
            self.drive.receive(taken)

    def transmit(self) -> bytes | None:
        """Return the telegram to the controller with the values of now; None: a fault keeps it back."""
        frame = self.drive.transmit()
        return frame if self.actual_seam is None else self.actual_seam(frame)

    # -- faults ----------------------------------------------------------------------------------------

    def raise_fault(self, code: int, *, persistent: bool = False) -> None:
        """Raise a fault by its number, or by the EMCY code of one; see `ProfidriveDrive.raise_fault`."""
        self.drive.raise_fault(code, persistent=persistent)

    def clear_fault_cause(self, code: int | None = None) -> None:
        """End the cause of a persistent fault, or of all; the fault itself waits for its acknowledgement."""
        self.drive.clear_fault_cause(code)

    def set_sto(self, active: bool) -> None:
        """Activate or release safe torque off."""
        self.drive.safety.set_sto(active)

    def set_ss1(self, active: bool) -> None:
        """Demand safe stop 1, or release it: quick stop, then safe torque off."""
        self.drive.safety.set_ss1(active)

    def set_ss2(self, active: bool) -> None:
        """Demand safe stop 2, or release it: quick stop, then monitored standstill under control."""
        self.drive.safety.set_ss2(active)

    def set_sos(self, active: bool) -> None:
        """Select safe operating stop, or deselect it: the standstill is monitored after a delay."""
        self.drive.safety.set_sos(active)

    def set_sbc(self, active: bool) -> None:
        """Demand safe brake control, or release it: torque off, and the brake closes."""
        self.drive.safety.set_sbc(active)

    def set_sls(self, level: int | None) -> None:
        """Select a level of safely limited speed, or deselect it (None); see `SafetyFunctions.set_sls`."""
        self.drive.safety.set_sls(level)

    def set_sdi(self, direction: int | None) -> None:
        """Select safe direction with the permitted one, 1 or -1, or deselect it (None)."""
        self.drive.safety.set_sdi(direction)

    def set_slp(self, number: int | None) -> None:
        """Select a range of safely limited position, or deselect it (None); see `SafetyFunctions.set_slp`.

        Raises:
            UnsupportedFaultError: No range is set up.

        """
        if number is not None and not self.config.safety.slp_ranges_mm:
            raise UnsupportedFaultError(f"{self.name}: no range is set up (safety.slp_ranges_mm)")
        self.drive.safety.set_slp(number)

    def acknowledge_safety(self) -> None:
        """Acknowledge safety messages safely."""
        self.drive.safety.acknowledge()

    def refuse_transitions(self, *transitions: int) -> None:
        """Refuse S3 to S4 (given as 4); without numbers nothing is refused.

        Raises:
            UnsupportedFaultError: Another transition is named.

        """
        if set(transitions) - {4}:
            raise UnsupportedFaultError(
                f"{self.name}: a PROFIdrive axis refuses transition 4 (S3 to S4) only"
            )
        self.drive.operation.refuses = bool(transitions)

    def freeze_statusword(self, frozen: bool) -> None:
        """Let ZSW1 show what it shows now, whatever happens."""
        self.drive.words.freeze(frozen)

    def override_statusword_bits(self, set_bits: int, clear_bits: int) -> None:
        """Show bits of ZSW1 as 1, or as 0, whatever they should be; 0 and 0 = the true bits again."""
        self.drive.words.override_bits(set_bits=set_bits, clear_bits=clear_bits)

    def force_warning(self, active: bool) -> None:
        """Show a warning without cause."""
        self.drive.faults.warn(DriveWarning.INJECTED, active)

    # -- power stage and encoder ----------------------------------------------------------------------

    def check_dc_link(self) -> None:
        """React to a change of the DC link or of the mains at once."""
        self.drive.monitors.look_at_link()

    def limit_torque(self, share: float | None) -> None:
        """Limit the torque to a share of the rated one; None = not."""
        torque = math.inf if share is None else share * self.config.rated_torque_nm
        self.drive.torque.cap(injected_Nm=torque)

    def scale_ramps(self, share: float) -> None:
        """Make all ramps of the drive with this share of their slope; 1 = as set."""
        self.drive.channel.ramp_scale = share
        self.drive.channel.refresh()

    @property
    def second_encoder(self) -> SecondEncoder | None:
        """The second encoder with its own fault methods; None = not fitted."""
        return self.drive.second

    def set_encoder_error(self, code: int, active: bool) -> None:
        """Bring about the cause of an error of G1_XIST2, or end it; see `EncoderInterface.set_error`."""
        if active:
            self.drive.encoder_words.set_error(code)
        else:
            self.drive.encoder_words.clear_error(code)

    def break_encoder_wire(self, broken: bool) -> None:
        """Cut the wire of the encoder: the value stands, G1_ZSW and a fault say so; or repair it."""
        drive = self.drive
        absolute = isinstance(drive.encoder, AbsoluteEncoder)
        number = numbers.ENCODER_SERIAL if absolute else numbers.ENCODER_SIGNAL
        drive.encoder.freeze(broken)
        if broken:
            drive.encoder_words.set_error(_NOT_VALID)
            drive.raise_fault(number, persistent=True)
        else:
            drive.encoder_words.clear_error(_NOT_VALID)
            drive.clear_fault_cause(number)
