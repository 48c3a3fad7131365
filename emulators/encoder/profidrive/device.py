"""PROFIdrive encoder: a device of its own with telegram 81, 82, 83 or 84. Takes
and gives frames; knows no bus.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from functools import partial
from typing import TYPE_CHECKING, Final

from emulators.drive.profidrive.faults.buffer import FaultBuffer, FaultMessage
from emulators.encoder._mounting import Mounting
from emulators.encoder.profidrive._abilities import EncoderAbilities, EncoderState
from emulators.encoder.profidrive.format import EncoderFormat, p979
from emulators.encoder.profidrive.interface import SIGN_OF_LIFE_FAILED, EncoderInterface
from emulators.encoder.profidrive.model import encoder_model
from emulators.encoder.profidrive.settings import ProfidriveEncoderSettings
from emulators.mechanics import SwitchModel
from fieldbus.clock import MS, S, Scheduler
from fieldbus.errors import ConfigurationError
from fieldbus.profidrive import STW2_ENC, ZSW2_ENC, telegram, to_n2, to_n4
from fieldbus.profidrive.sign_of_life import SignOfLife
from fieldbus.profidrive.words import SIGN_OF_LIFE_SHIFT

if TYPE_CHECKING:
    import numpy as np

_TAU: Final = 2.0 * math.pi
PROBES_MAX: Final = 2


@dataclass(frozen=True, kw_only=True)
class ProfidriveEncoderConfig:
    """An encoder as a device of its own.

    Args:
        form: Formats, kind and resolution.
        settings: Telegram (PD-010 to PD-013; 84 needs `form.wide`), sign of life (PD-130), zero mark and
            reference speed; the formats are those of `form`.
        abilities: What the encoder interface can do.
        reversed_direction: Counts the other way round.
        mounting_offset: Value where the machine is at zero, increments of the
            model; only for absolute encoders.
        factor: Bus cycles in an application cycle of the controller, >= 1.
        compatible: True: G1_STW counts without control by PLC, as in the compatibility mode of the
            encoder profile.

    Raises:
        ConfigurationError: A value is out of its range, or they do not fit together.

    """

    form: EncoderFormat
    settings: ProfidriveEncoderSettings = field(default_factory=ProfidriveEncoderSettings)
    abilities: EncoderAbilities = field(default_factory=EncoderAbilities)
    reversed_direction: bool = False
    mounting_offset: int = 0
    factor: int = 1
    compatible: bool = False

    def __post_init__(self) -> None:
        if self.settings.telegram == 84 and not self.form.wide:
            raise ConfigurationError("encoder telegram", 84, "81 to 83 without 64-bit values (wide)")
        if self.mounting_offset and not self.form.absolute:
            raise ConfigurationError(
                "encoder mounting_offset", self.mounting_offset, "0 for an incremental encoder"
            )
        if self.factor < 1:
            raise ConfigurationError("encoder factor", self.factor, "1 or more")


class ProfidriveEncoder:
    """A PROFIdrive encoder. It is off until `power_on`.

    Per bus cycle: `receive` with the frame that has come, if one has, then `cycle`, then `transmit`.

    Args:
        scheduler: Time of the bench.
        config: The encoder.
        mounting: What it measures; a coordinate in rad, or in m for a linear encoder.
        probes: Switches of probe 1 and 2 along the coordinate of the encoder; looked at in every cycle,
            latched where they are. Others call `probe_edge`.
        marks: Cams of reference mark 2 and following; the rising edge is the mark.
        rng: Source of the noise; None: it cannot be made noisy.

    Raises:
        ConfigurationError: More probes or marks than the interface has.

    """

    def __init__(
        self,
        scheduler: Scheduler,
        config: ProfidriveEncoderConfig,
        mounting: Mounting,
        *,
        probes: tuple[SwitchModel, ...] = (),
        marks: tuple[SwitchModel, ...] = (),
        rng: np.random.Generator | None = None,
    ) -> None:
        if 2 * len(probes) > config.abilities.measuring + 1 or len(probes) > PROBES_MAX:
            raise ConfigurationError("encoder probes", len(probes), "one per two measuring functions")
        if len(marks) >= max(1, config.abilities.reference_marks):
            raise ConfigurationError("encoder marks", len(marks), "one less than reference_marks")
        self.config: Final = config
        self._scheduler = scheduler
        self._mounting = mounting
        form = config.form
        settings = config.settings
        self.encoder: Final = encoder_model(
            form,
            zero_mark=settings.zero_mark,
            reversed_direction=config.reversed_direction,
            mounting_offset=config.mounting_offset,
            rng=rng,
        )
        """The model, with the faults that can be brought about there."""
        length_m = form.periods * form.grid_nm * 1e-9
        self._per_coordinate = _TAU / length_m if form.linear else 1.0
        reference = settings.reference_speed
        self._full_speed = reference * 1e-3 * self._per_coordinate if form.linear else reference * _TAU / 60.0
        self.interface: Final = EncoderInterface(self.encoder, form, config.abilities)
        """State machine of the words, with the errors that can be brought about there."""
        self._telegram = telegram(settings.telegram)
        self._signs = SignOfLife(tolerance=settings.sign_of_life_tolerance, factor=config.factor)
        self.faults: Final = FaultBuffer()
        """Fault situations; the number of a message is the code of the encoder error."""
        self.warnings: Final[set[int]] = set()
        """Numbers of the warnings that are there."""
        self.refused = 0
        """Frames of a wrong length since construction."""
        self.powered = False
        self.words = (0, 0, 0)
        """G1_ZSW, G1_XIST1, G1_XIST2 of the last cycle."""
        self._frozen_sign: int | None = None
        self._pending: bytes | None = None
        self._switches = (*probes, *marks)
        for number, switch in enumerate(probes, 1):
            switch.on_change = partial(self._probe_changed, number, switch)
        for number, switch in enumerate(marks, 2):
            switch.on_change = partial(self._cam_changed, number, switch)
        self._reset()

    @property
    def p979(self) -> tuple[int, ...]:
        """Encoder format, PNU 979."""
        return p979(self.config.form)

    def power_on(self) -> None:
        """Start up where the machine stands; absolute encoders know the place, others begin to count."""
        shaft = self._shaft()
        self.encoder.power_on(shaft)
        self.interface.power_on()
        self.powered = True
        self._reset()
        for switch in self._switches:
            switch.update(self._mounting.coordinate())
        self._angle = self.encoder.sample(shaft)
        self._build(self.interface.words())

    def power_off(self) -> None:
        """Take the supply away: nothing is received or sent, and the fault situations are gone."""
        self.powered = False
        self.faults.clear()

    @property
    def sign_of_life(self) -> int:
        """The encoder's counter as it is shown: 0 without clock, 1..15 when it is synchronous (PD-126)."""
        if not self.config.settings.sign_of_life:
            return 0
        return self._signs.value if self._frozen_sign is None else self._frozen_sign

    def freeze_sign_of_life(self, frozen: bool) -> None:
        """Let the encoder's sign of life stand still, or count again."""
        self._frozen_sign = self._signs.value if frozen else None

    # -- bus -------------------------------------------------------------------------------------------

    def receive(self, frame: bytes) -> bool:
        """Take a frame for the next cycle; return False when it is refused: wrong
        length (PD-030), or no supply.
        """
        if not self.powered:
            return False
        if len(frame) != self._telegram.setpoint.length:
            self.refused += 1
            return False
        self._pending = frame
        return True

    def transmit(self) -> bytes | None:
        """Return the frame of the last cycle; None without supply."""
        return self._frame if self.powered else None

    def cycle(self) -> None:
        """Sample, evaluate what was received and build what is sent: once per bus cycle."""
        if not self.powered:
            return
        self._sample()
        if self._pending is not None:
            self._take_over(self._pending)
            self._pending = None
        if self.config.settings.sign_of_life and self._signs.step(self._stw2 >> SIGN_OF_LIFE_SHIFT):
            self.interface.report(SIGN_OF_LIFE_FAILED)
        words = self.interface.step(self._g1_stw, self._scheduler.now)
        if self.interface.state is EncoderState.SD3:
            self._enter_fault(self.interface.error)
        self._build(words)

    # -- edges -----------------------------------------------------------------------------------------

    def probe_edge(self, number: int, rising: bool, coordinate: float | None = None) -> None:
        """Bring an edge of probe 1 or 2.

        Args:
            number: 1 or 2.
            rising: Direction.
            coordinate: Where the encoder was at the edge, rad or m; None: where it is now.

        """
        self.interface.probe_edge(number, rising, self._increments(coordinate))

    def reference_cam(self, number: int, coordinate: float | None = None) -> None:
        """Bring reference mark 2, 3 or 4; arguments as `probe_edge`."""
        self.interface.reference_mark(number, self._increments(coordinate))

    # -- inside ----------------------------------------------------------------------------------------

    def _reset(self) -> None:
        self._pending = None
        self._stw2 = 0
        self._g1_stw = 0
        self._addressed = False
        self._frame = bytes(self._telegram.actual.length)
        self._angle = 0.0
        self._sampled_ns = self._scheduler.now
        self.speed = 0.0
        """Speed since the cycle before, share of the reference speed."""
        self._signs.reset()

    def _shaft(self) -> float:
        return self._mounting.coordinate() * self._per_coordinate

    def _increments(self, coordinate: float | None) -> int:
        where = self._shaft() if coordinate is None else coordinate * self._per_coordinate
        return self.encoder.increments_at(where)

    def _sample(self) -> None:
        now = self._scheduler.now
        angle = self.encoder.sample(self._shaft())
        if self._switches:
            coordinate = self._mounting.coordinate()
            for switch in self._switches:
                switch.update(coordinate, moving=True)
        elapsed = now - self._sampled_ns
        if elapsed > 0:
            self.speed = (angle - self._angle) / (elapsed / S * self._full_speed)
            self._angle = angle
            self._sampled_ns = now

    def _take_over(self, frame: bytes) -> None:
        before = self._stw2
        stw2, g1_stw = self._telegram.setpoint.unpack(frame)
        if stw2 & STW2_ENC.CONTROL_BY_PLC or self.config.compatible:
            self._g1_stw = g1_stw
            if stw2 & ~before & STW2_ENC.ACKNOWLEDGE:
                self.faults.acknowledge()
        # Bit 9 says from now on that there is a controller to request control from (PD-081).
        self._addressed = True
        self._stw2 = stw2

    def _enter_fault(self, code: int) -> None:
        self.faults.enter(FaultMessage(number=code, code=code, time_ms=self._scheduler.now // MS))

    def _build(self, words: tuple[int, int, int]) -> None:
        self.words = words
        zsw2 = self.sign_of_life << SIGN_OF_LIFE_SHIFT
        if self.faults.present:
            zsw2 |= ZSW2_ENC.FAULT
        if self.warnings:
            zsw2 |= ZSW2_ENC.WARNING
        if self._addressed:
            zsw2 |= ZSW2_ENC.CONTROL_REQUESTED
        zsw, xist1, xist2 = words
        speed = 0.0 if self.interface.state is EncoderState.SD12 else self.speed
        number = self.config.settings.telegram
        pack = self._telegram.actual.pack
        if number == 81:
            self._frame = pack(zsw2, zsw, xist1, xist2)
        elif number == 82:
            self._frame = pack(zsw2, zsw, xist1, xist2, to_n2(speed))
        elif number == 83:
            self._frame = pack(zsw2, zsw, xist1, xist2, to_n4(speed))
        else:
            self._frame = pack(zsw2, zsw, self.interface.xist3, xist2, to_n4(speed))

    def _probe_changed(self, number: int, switch: SwitchModel) -> None:
        if self.powered:
            self.probe_edge(number, switch.state, switch.edge)

    def _cam_changed(self, number: int, switch: SwitchModel) -> None:
        if self.powered and switch.state:
            self.reference_cam(number, switch.edge)
