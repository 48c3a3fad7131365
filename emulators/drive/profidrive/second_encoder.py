"""The second encoder of a PROFIdrive axis: on the load or the motor, with its own mounting, format and faults
(G2).
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Final, Literal

from emulators.drive.profidrive.faults.catalogue import DriveWarning
from emulators.drive.profidrive.faults.state import FaultState
from emulators.encoder import Mounting
from emulators.encoder.profidrive import EncoderFormat, EncoderInterface
from emulators.encoder.profidrive.model import encoder_model
from emulators.encoder.profidrive.sensor import ProfidriveSensor
from emulators.mechanics import AxisMechanics
from fieldbus.errors import ConfigurationError

if TYPE_CHECKING:
    import numpy as np


_PER_NM: Final = 1e-9


@dataclass(frozen=True, slots=True, kw_only=True)
class SecondEncoderConfig:
    """A second encoder.

    Args:
        form: Kind, resolution and formats; a linear encoder measures the load.
        mounting: Side of the machine: the motor shaft, or the load.
        ratio: Encoder coordinate (rad, linear: m) per coordinate of the motor (rad) or load (m or rad);
            negative: mounted the other way round.
        offset: Encoder coordinate where the machine is at zero, rad or m.
        backlash: Play of its coupling, rad or m of the encoder, >= 0.
        zero_mark: Place of its zero mark, increments of Gx_XIST1, 0..form.counts - 1.

    Raises:
        ConfigurationError: Values do not fit together.

    """

    form: EncoderFormat = field(default_factory=EncoderFormat)
    mounting: Literal["motor", "load"] = "load"
    ratio: float = 1.0
    offset: float = 0.0
    backlash: float = 0.0
    zero_mark: int = 0

    def __post_init__(self) -> None:
        if self.mounting not in ("motor", "load"):
            raise ConfigurationError("encoder2 mounting", self.mounting, "motor, load")
        if self.form.linear and self.mounting != "load":
            raise ConfigurationError("encoder2 mounting", self.mounting, "load for a linear encoder")
        Mounting(_nowhere, ratio=self.ratio, offset=self.offset, backlash=self.backlash)
        encoder_model(self.form, zero_mark=self.zero_mark)

    @property
    def per_coordinate(self) -> float:
        """Angle of the model per coordinate of the encoder: 1, or a revolution for the length of the
        scale.
        """
        form = self.form
        return math.tau / (form.periods * form.grid_nm * _PER_NM) if form.linear else 1.0


class SecondEncoder(ProfidriveSensor):
    """The encoder behind G2_STW, G2_ZSW, G2_XIST1 and G2_XIST2; sampled once per bus cycle.

    Args:
        config: What it is and where.
        mechanics: Machine that it sits on.
        name: Name in messages.
        faults: Gets the warning of a broken wire.
        rng: Source of its noise; None: it cannot be made noisy.

    """

    __slots__ = ("_faults", "_mounting", "_per_coordinate", "_ratio", "on_motor", "words")

    def __init__(
        self,
        config: SecondEncoderConfig,
        mechanics: AxisMechanics,
        *,
        name: str,
        faults: FaultState,
        rng: np.random.Generator | None,
    ) -> None:
        encoder = encoder_model(config.form, zero_mark=config.zero_mark, rng=rng)
        super().__init__(name, encoder, EncoderInterface(encoder, config.form))
        self._faults = faults
        self._ratio = mechanics.ratio
        self.on_motor = config.mounting == "motor"
        source: Callable[[], float] = (
            (lambda: mechanics.motor_angle) if self.on_motor else (lambda: mechanics.position)
        )
        self._mounting = Mounting(source, ratio=config.ratio, offset=config.offset, backlash=config.backlash)
        self._per_coordinate = config.per_coordinate
        self.words = (0, 0, 0)
        """G2_ZSW, G2_XIST1, G2_XIST2."""

    def power_on(self) -> None:
        """Start up where the machine stands."""
        self.encoder.power_on(self._mounting.coordinate() * self._per_coordinate)
        self.interface.power_on()
        self.words = self.interface.words()

    def step(self, stw: int, now_ns: int) -> None:
        """Sample, and evaluate the control word of this bus cycle."""
        self.encoder.sample(self._mounting.coordinate() * self._per_coordinate)
        self.words = self.interface.step(stw, now_ns)

    def probe_edge(self, number: int, rising: bool, motor_angle: float) -> None:
        """Take an edge of probe 1 or 2 that came when the motor was at an angle, rad."""
        machine = motor_angle if self.on_motor else motor_angle * self._ratio
        place = self._mounting.at(machine) * self._per_coordinate
        self.interface.probe_edge(number, rising, self.encoder.increments_at(place))

    def break_encoder_wire(self, broken: bool) -> None:
        """Cut its wire, or repair it: G2_ZSW says so, and the drive warns; it does not control with this
        encoder.
        """
        super().break_encoder_wire(broken)
        self._faults.warn(DriveWarning.SECOND_ENCODER, broken)


def _nowhere() -> float:
    return 0.0
