"""The second encoder of a PROFIdrive axis: on the load or the motor, with its own
mounting, format and faults (G2).
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import TYPE_CHECKING, Final

from emulators.drive.profidrive.faults.catalogue import DriveWarning
from emulators.drive.profidrive.faults.state import FaultState
from emulators.drive.second_encoder_config import SecondEncoderConfig
from emulators.encoder import Mounting
from emulators.encoder.profidrive import EncoderInterface
from emulators.encoder.profidrive.model import encoder_model
from emulators.encoder.profidrive.sensor import ProfidriveSensor
from emulators.mechanics import AxisMechanics

if TYPE_CHECKING:
    import numpy as np


_PER_NM: Final = 1e-9


class SecondEncoder(ProfidriveSensor):
    """The encoder behind G2_STW, G2_ZSW, G2_XIST1 and G2_XIST2; sampled once per bus cycle.

    Args:
        config: What it is and where.
        mechanics: Machine that it sits on.
        lead_mm: Lead of its screw, mm; None: the load turns.
        name: Name in messages.
        faults: Gets the warning of a broken wire.
        rng: Source of its noise; None: it cannot be made noisy.

    """

    def __init__(
        self,
        config: SecondEncoderConfig,
        mechanics: AxisMechanics,
        *,
        lead_mm: float | None,
        name: str,
        faults: FaultState,
        rng: np.random.Generator | None,
    ) -> None:
        form = config.form()
        encoder = encoder_model(form, zero_mark=config.zero_mark, rng=rng)
        super().__init__(name, encoder, EncoderInterface(encoder, form))
        self._faults = faults
        self._ratio = mechanics.ratio
        self.on_motor = config.mounting == "motor"
        source: Callable[[], float] = (
            (lambda: mechanics.motor_angle) if self.on_motor else (lambda: mechanics.position)
        )
        ratio, offset, backlash = config.coupling(lead_mm)
        self._mounting = Mounting(source, ratio=ratio, offset=offset, backlash=backlash)
        # Angle of the model per coordinate of the encoder: 1, or a revolution for the length of the scale.
        self._per_coordinate = math.tau / (form.periods * form.grid_nm * _PER_NM) if form.linear else 1.0
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
        """Cut its wire, or repair it: G2_ZSW says so, and the drive warns; it does
        not control with this encoder.
        """
        super().break_encoder_wire(broken)
        self._faults.warn(DriveWarning.SECOND_ENCODER, broken)
