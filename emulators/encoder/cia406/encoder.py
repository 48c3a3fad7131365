"""The emulated CiA 406 encoder with all that a test can do to it (C402-312)."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

from emulators.encoder._mounting import Mounting
from emulators.encoder._own_shaft import OwnShaft
from emulators.encoder.cia406._object_rules import EVENT_TIMER
from emulators.encoder.cia406.config import EncoderDeviceConfig
from emulators.encoder.cia406.device import EncoderDevice
from emulators.mechanics import DrivenShaft
from fieldbus.can.frame import CanSegment
from fieldbus.canopen import NmtState
from fieldbus.clock import Scheduler
from fieldbus.errors import UnsupportedFaultError
from fieldbus.history import History

if TYPE_CHECKING:
    import numpy as np

TRACE_ENUMS: Final[dict[str, dict[int, str]]] = {
    "nmt_state": {int(state): state.name for state in NmtState},
}
"""Texts of the columns that show a state."""


class CiA406Encoder(EncoderDevice, OwnShaft):
    """An encoder as a device of its own on a CAN segment.

    It is off until `power_on`. Positions on the bus are those of the instant at which they are read: of SYNC
    for synchronous PDOs, of the transmission for TPDO1. Speeds, cams, work area, alarms and warnings are
    looked at every millisecond.

    Args:
        scheduler: Time of the bench.
        segment: CAN segment.
        config: The encoder.
        mounting: What it measures, and how it is coupled to it.
        name: Name of the node on the segment and in the history.
        history: Log for `encoder.preset`, `encoder.cams`, `encoder.alarm`, `encoder.warning`; None for none.
        rng: Source of the noise; None: the encoder cannot be made noisy.
        shaft: The shaft behind `mounting` when it is the encoder's own, for `turn_shaft`.

    Raises:
        ConfigurationError: The configuration does not fit together.

    """

    __slots__ = ("_cycle_before", "shaft", "trace_columns")

    trace_enums = TRACE_ENUMS

    def __init__(
        self,
        scheduler: Scheduler,
        segment: CanSegment,
        config: EncoderDeviceConfig,
        mounting: Mounting,
        *,
        name: str,
        history: History | None = None,
        rng: np.random.Generator | None = None,
        shaft: DrivenShaft | None = None,
    ) -> None:
        super().__init__(scheduler, segment, config, mounting, name=name, history=history, rng=rng)
        self.shaft = shaft
        self._cycle_before: int | None = None
        self.trace_columns = (
            ("coordinate", "m" if config.kind.linear else "rad"),
            ("position_value", "steps"),
            ("raw_value", "steps"),
            ("speed_value", ""),
            ("offset", "steps"),
            ("cams", ""),
            ("area", ""),
            ("alarms", ""),
            ("warnings", ""),
            ("nmt_state", ""),
        )
        """(name, unit) of the values of `trace_row`."""

    def trace_row(self) -> tuple[float, ...]:
        """Return the present values of `trace_columns`; the coordinate is the true one, the others are those
        of channel 1.
        """
        channel = self.channels[0]
        values = self.slave.values
        return (
            channel.sensor.coordinate,
            channel.position,
            channel.raw,
            channel.speed,
            channel.offset,
            values[0x630001],
            values[0x640001],
            values[0x650300],
            values[0x650500],
            self.slave.nmt_state,
        )

    # -- sensor ----------------------------------------------------------------------------------------

    def freeze_encoder(self, frozen: bool) -> None:
        """Let the value stand still, or follow the shaft again."""
        for channel in self.channels:
            channel.sensor.encoder.freeze(frozen)
        self.forget_sample()

    def jump_encoder(self, increments: int) -> None:
        """Shift the value by raw steps, as a slipped coupling does."""
        for channel in self.channels:
            channel.sensor.encoder.jump(increments)
        self.forget_sample()

    def set_encoder_noise(self, increments: int) -> None:
        """Disturb the value by -increments..+increments raw steps; 0 = off."""
        for channel in self.channels:
            channel.sensor.encoder.set_noise(increments)
        self.forget_sample()

    def reverse_encoder(self, reversed_direction: bool) -> None:
        """Count the other way round from the present position on."""
        for channel in self.channels:
            channel.sensor.encoder.reverse(reversed_direction)
        self.forget_sample()

    def lose_encoder_steps(self, every: int) -> None:
        """Miss one of `every` raw steps of the motion; 0 = none from now on."""
        for channel in self.channels:
            channel.sensor.encoder.lose_steps(every)
        self.forget_sample()

    def suppress_index(self, missing: bool) -> None:
        """Let the reference mark never come, or come again; an incremental encoder that waits for it goes on
        warning.

        Raises:
            UnsupportedFaultError: An absolute encoder has no mark.

        """
        if not self._incremental:
            raise UnsupportedFaultError(f"{self.name}: an absolute encoder has no index")
        for channel in self.channels:
            channel.sensor.encoder.zero_mark_present = not missing

    # -- device ----------------------------------------------------------------------------------------

    def preset_encoder(self, value: int) -> None:
        """Write a preset to 6003h, whatever moves; the value is taken into the range of 6002h."""
        self.take_parameters()
        self.preset(value % self.scaling.total)

    def move_near_overflow(self, margin: int) -> None:
        """Place the position `margin` units before the end of 6002h (>= 1), or behind its beginning (<= 0).

        A margin beyond the range is taken into it.
        """
        self.take_parameters()
        self.preset(-margin % self.scaling.total)

    def set_alarm(self, bit: int, active: bool) -> None:
        """Bring about the cause of an alarm, a bit of 6503h (0 position error, 12 to 15 manufacturer), or end
        it.

        Raises:
            ConfigurationError: The encoder does not support it (6504h).

        """
        word = self.injected_alarms
        self.inject_alarms(word | 1 << bit if active else word & ~(1 << bit))

    def set_warning(self, bit: int, active: bool) -> None:
        """Bring about the cause of a warning, a bit of 6505h (0 to 5, 12 to 15 manufacturer), or end it.

        Raises:
            ConfigurationError: The encoder does not support it (6506h).

        """
        word = self.injected_warnings
        self.inject_warnings(word | 1 << bit if active else word & ~(1 << bit))

    def force_cycle_time(self, period_ms: int | None) -> None:
        """Send TPDO1 with a wrong cycle, ms (0: never by time); None = as before."""
        store = self.slave.store
        entry = store.entries.get(EVENT_TIMER)
        if entry is None:
            raise UnsupportedFaultError(f"{self.name}: the EDS has no event timer 1800h:5")
        if period_ms is not None:
            if self._cycle_before is None:
                self._cycle_before = store.values[EVENT_TIMER]
            store.assign(entry, period_ms)
        elif self._cycle_before is not None:
            store.assign(entry, self._cycle_before)
            self._cycle_before = None

    def stop_heartbeat(self, stopped: bool) -> None:
        """Keep the heartbeat back, or send it again."""
        self.slave.error_control.silent = stopped
