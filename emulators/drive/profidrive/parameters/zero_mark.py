"""Which signal is the zero mark of the encoder interface: that of the encoder, or a probe input in its place
(p0490, p0495).

The external mark counts at the negative end of its signal in either direction of travel, inverted at the
positive end (§5.11.10, HOM-168, HOM-169).
"""

from __future__ import annotations

from emulators.drive.profidrive.parameters.store import ParameterStore
from emulators.drive.profidrive.probes import ProbeLatch
from emulators.encoder.profidrive import EncoderInterface
from emulators.events import Emit
from emulators.mechanics import AxisMechanics


class ZeroMarkSource:
    """Chooses the zero mark as p0490 and p0495 say.

    Args:
        interface: Encoder interface G1.
        mechanics: Machine; its direction of travel decides which edge counts.
        probes: Probe inputs.
        emit: Writes a change of the source into the log.
        store: Its parameters: p0495 is 0 for the encoder, 1 or 2 for a probe input; bit 0 and 1 of p0490
            invert these inputs.

    """

    def __init__(
        self,
        interface: EncoderInterface,
        mechanics: AxisMechanics,
        probes: ProbeLatch,
        emit: Emit,
        store: ParameterStore,
    ) -> None:
        self._interface = interface
        self._mechanics = mechanics
        self._emit = emit
        self._probe = 0
        self._inverted = 0
        store.writers[490] = self._invert
        store.writers[495] = self._choose
        probes.listeners.append(self._on_edge)

    def _invert(self, _: int, value: float) -> None:
        self._inverted = int(value)

    def _choose(self, _: int, value: float) -> None:
        self._probe = int(value)
        self._interface.external_mark = bool(value)
        self._emit("drive.zero_mark", external=bool(value))

    def _on_edge(self, number: int, rising: bool, increments: int) -> None:
        if number != self._probe:
            return
        signal = rising is not bool(self._inverted >> number - 1 & 1)
        if signal is (self._mechanics.velocity > 0.0):
            self._interface.reference_mark(1, increments)
