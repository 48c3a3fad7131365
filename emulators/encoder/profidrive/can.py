"""The PROFIdrive encoder as a node of a CAN segment: its telegram in free process data words on PDOs, latched
by SYNC.

At SYNC the encoder takes the words that have come, samples, makes its cycle, and its answer goes into the
TPDOs of the same SYNC. One that is not isochronous makes its cycle by itself when SYNC is missing.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar, Final

from emulators.canopen_node import CanopenNode
from emulators.encoder._mounting import Mounting
from emulators.encoder._own_shaft import OwnShaft
from emulators.encoder.profidrive import _objects as objects
from emulators.encoder.profidrive._abilities import EncoderState
from emulators.encoder.profidrive.device import ProfidriveEncoder, ProfidriveEncoderConfig
from emulators.encoder.profidrive.eds import EDS
from emulators.encoder.profidrive.sensor import ProfidriveSensor
from emulators.process_words import ProcessWords, SyncCycle
from emulators.trace import LOAD, NMT_STATE, Column, names_and_units, value_texts
from fieldbus.can.segment import CanSegment
from fieldbus.clock import MS, Scheduler
from fieldbus.errors import ConfigurationError
from fieldbus.history import History
from fieldbus.node_clock import own_clock
from fieldbus.profidrive import telegram
from fieldbus.profidrive.words import ENCODER_ERRORS

if TYPE_CHECKING:
    import numpy as np

    from emulators.mechanics import DrivenShaft

_NOT_VALID_PDO: Final = 1 << 31
EMCY: Final = 0x7300
"""EMCY of an encoder error: fault of a sensor; the code of Gx_XIST2 is in its data."""
_STATES: Final = {state: number for number, state in enumerate(EncoderState)}


@dataclass(frozen=True, kw_only=True)
class ProfidriveEncoderNodeConfig:
    """A PROFIdrive encoder on CANopen.

    Args:
        node_id: 1..127.
        encoder: The encoder.
        cycle_ns: Bus cycle, ns: of a free-running encoder when SYNC is missing.
        heartbeat_ms: 1017h, 0..65535.
        boot_time_s: From power-on or reset to the boot-up frame, s.

    Raises:
        ConfigurationError: A value is out of its range.

    """

    node_id: int
    encoder: ProfidriveEncoderConfig
    cycle_ns: int = 4 * MS
    heartbeat_ms: int = 0
    boot_time_s: float = 0.0

    def __post_init__(self) -> None:
        if not 1 <= self.node_id <= 127:
            raise ConfigurationError("node_id", self.node_id, "1..127")
        if self.cycle_ns <= 0:
            raise ConfigurationError("cycle_ns", self.cycle_ns, "> 0")
        if not 0 <= self.heartbeat_ms <= 0xFFFF:
            raise ConfigurationError("heartbeat_ms", self.heartbeat_ms, "0..65535")
        if not self.boot_time_s >= 0.0:
            raise ConfigurationError("boot_time_s", self.boot_time_s, ">= 0")


_ERRORS: Final = {0: "none", **{code: f"{code:04X}h {text}" for code, text in ENCODER_ERRORS.items()}}
_COLUMNS: Final = (
    Column("coordinate", LOAD),
    Column("g1_zsw"),
    Column("g1_xist1", "inc"),
    Column("g1_xist2"),
    Column("speed", "%"),
    Column("state", texts={number: f"{state.name} {state.value}" for state, number in _STATES.items()}),
    Column(
        "error", texts={0: "none", **{code: f"{code:04X}h {text}" for code, text in ENCODER_ERRORS.items()}}
    ),
    Column("faults"),
    Column("sign_of_life"),
    NMT_STATE,
)


class ProfidriveCanEncoder(ProfidriveSensor):
    """An emulated PROFIdrive encoder on a CAN segment, with all that a test can do to
    it. It is off until `power_on`.

    Args:
        scheduler: Time of the bench.
        segment: CAN segment.
        config: Node and encoder.
        mounting: What it measures, and how it is coupled to it.
        name: Name of the node on the segment and in the history.
        history: Log for `encoder.error`; None for none.
        rng: Source of the noise; None: the encoder cannot be made noisy.
        shaft: The shaft behind `mounting` when it is the encoder's own, for `turn_shaft`.

    Raises:
        ConfigurationError: The configuration does not fit together.

    """

    trace_enums: ClassVar = value_texts(_COLUMNS)

    def __init__(
        self,
        scheduler: Scheduler,
        segment: CanSegment,
        config: ProfidriveEncoderNodeConfig,
        mounting: Mounting,
        *,
        name: str,
        history: History | None = None,
        rng: np.random.Generator | None = None,
        shaft: DrivenShaft | None = None,
    ) -> None:
        device = ProfidriveEncoder(scheduler, config.encoder, mounting, rng=rng)
        super().__init__(name, device.encoder, device.interface)
        self.scheduler = scheduler
        self._history = history
        self._mounting = mounting
        self.config = config
        self.shaft = OwnShaft(name, shaft)
        self.device = device
        """The encoder without a bus."""
        self.node = CanopenNode(
            scheduler,
            segment,
            EDS.dictionary(),
            config.node_id,
            name=name,
            history=history,
            boot_time_s=config.boot_time_s,
        )
        self.slave = slave = self.node.slave
        self._set_defaults()
        self._words = ProcessWords(slave, telegram(config.encoder.settings.telegram))
        self._code = 0
        self.trace_columns = names_and_units(_COLUMNS, "m" if config.encoder.form.linear else "rad")
        """(name, unit) of the values of `trace_row`."""
        slave.on_reset.append(self._on_reset)
        SyncCycle(
            scheduler,
            slave,
            self._words,
            self._cycle,
            free_running_ns=None if config.encoder.settings.sign_of_life else config.cycle_ns,
        )

    def _set_defaults(self) -> None:
        """Enter what depends on the telegram: its number, formats, and PDOs
        with no more words than it has.
        """
        words = telegram(self.config.encoder.settings.telegram).actual.words
        values = {
            (0x1017, 0): self.config.heartbeat_ms,
            (objects.TELEGRAM, 0): self.config.encoder.settings.telegram,
        }
        values.update({(objects.FORMAT, at): value for at, value in enumerate(self.device.p979, 1)})
        for pdo in range(3):
            left = words - objects.WORDS_PER_PDO * pdo
            values[0x1A00 + pdo, 0] = min(max(left, 0), objects.WORDS_PER_PDO)
            if left <= 0:
                values[0x1800 + pdo, 1] = (0x180 + 0x100 * pdo + self.config.node_id) | _NOT_VALID_PDO
        self.node.set_defaults(values, "encoder")

    def trace_row(self) -> tuple[float, ...]:
        """Return the present values of `trace_columns`; the coordinate is the true one, `speed` in percent of
        the reference.
        """
        device = self.device
        zsw, xist1, xist2 = device.words
        return (
            self._mounting.coordinate(),
            zsw,
            xist1,
            xist2,
            100.0 * device.speed,
            _STATES[device.interface.state],
            device.interface.error,
            len(device.faults.present),
            device.sign_of_life,
            self.slave.nmt_state,
        )

    # -- life ------------------------------------------------------------------------------------------

    def power_on(self) -> None:
        """Switch the supply on: absolute encoders know their position at once, others begin to count."""
        if not self.slave.powered:
            self.device.power_on()
            self.slave.power_on()
            self._give()

    def power_off(self) -> None:
        """Switch the supply off."""
        if self.slave.powered:
            self.slave.power_off()
            self.device.power_off()
            self._code = 0

    def _on_reset(self, application: bool) -> None:
        if application:
            self.device.power_off()
            self.device.power_on()
            self._code = 0
        self._give()

    # -- bus cycle -------------------------------------------------------------------------------------

    def _cycle(self) -> None:
        device = self.device
        frame = self._words.take()
        if frame is not None:
            device.receive(frame)
        device.cycle()
        code = device.interface.error
        if code != self._code:
            self._tell(code)
        self._give()

    def _give(self) -> None:
        frame = self.device.transmit()
        if frame is not None:
            self._words.give(frame)

    def _tell(self, code: int) -> None:
        """Report an error that has come or gone: r2131, EMCY, log."""
        self._code = code
        slave = self.slave
        slave.set(objects.FAULT_NUMBER, 0, code)
        if code:
            slave.emcy(EMCY, data=code.to_bytes(2, "little"))
        else:
            slave.emcy_clear(EMCY)
        if self._history is not None:
            self._history.emit(self.name, "encoder.error", code=code, text=ENCODER_ERRORS.get(code, "none"))

    # -- node ------------------------------------------------------------------------------------------

    def stop_heartbeat(self, stopped: bool) -> None:
        """Stop sending the heartbeat, or send it again."""
        self.node.stop_heartbeat(stopped)

    def set_clock_drift(self, ppm: float) -> None:
        """Let the clock of the encoder run fast (positive) or slow, ppm; 0 = at the pace of the bench.

        Raises:
            UnsupportedFaultError: The encoder has no clock of its own.

        """
        own_clock(self.scheduler, self.name).drift(ppm)

    def set_clock_jitter(self, longest_ns: int) -> None:
        """Let the cycles of the encoder begin late by up to so many ns; 0 = on time again.

        Raises:
            UnsupportedFaultError: The encoder has no clock of its own.

        """
        own_clock(self.scheduler, self.name).jitter(longest_ns)

    # -- shaft -------------------------------------------------------------------------------------------

    def turn_shaft(self, speed: float, ramp_s: float = 0.0) -> None:
        """Turn the encoder's own shaft, rad/s (m/s linear), reached linearly within `ramp_s`.

        Raises:
            UnsupportedFaultError: The encoder sits on the machine of a drive.

        """
        self.shaft.turn(speed, ramp_s)

    def place_shaft(self, position: float) -> None:
        """Put the encoder's own shaft at rest at a position, rad or m.

        Raises:
            UnsupportedFaultError: The encoder sits on the machine of a drive.

        """
        self.shaft.place(position)

    def freeze_sign_of_life(self, frozen: bool) -> None:
        """Let the encoder's sign of life stand still, or count again."""
        self.device.freeze_sign_of_life(frozen)
