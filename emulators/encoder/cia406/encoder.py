"""The emulated CiA 406 encoder with all that a test can do to it (C402-312)."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, ClassVar, Final

from emulators.canopen_node import CanopenNode
from emulators.encoder._mounting import Mounting
from emulators.encoder._own_shaft import OwnShaft
from emulators.encoder.cia406 import _object_rules as rules
from emulators.encoder.cia406._channel import Channel, Scaling
from emulators.encoder.cia406._measurement import Measurement
from emulators.encoder.cia406._objects import SUPPORTED_ALARMS, SUPPORTED_WARNINGS, all_objects, family_of
from emulators.encoder.cia406.config import EncoderDeviceConfig
from emulators.encoder.cia406.eds import EDS
from emulators.mechanics import DrivenShaft
from emulators.trace import LOAD, NMT_STATE, Column, names_and_units, value_texts
from fieldbus.can.segment import CanSegment
from fieldbus.canopen.nmt import NmtState
from fieldbus.cia406 import EncoderAlarm, EncoderWarning, describe_flags
from fieldbus.clock import MS, S, Scheduler
from fieldbus.errors import ConfigurationError, UnsupportedFaultError
from fieldbus.history import History
from fieldbus.node_clock import own_clock

if TYPE_CHECKING:
    import numpy as np

CYCLE_NS: Final = 1 * MS
"""Speeds, cams, work area, alarms and warnings are checked every millisecond."""
_PRIORITY: Final = 1
"""The cycle follows the servo step of the same instant."""
ALARM_EMCY: Final = 0x1000
"""EMCY of every alarm of the profile (C406-050)."""
MANUFACTURER_EMCY: Final = 0xFF00
"""EMCY of an alarm bit of the manufacturer: this plus the number of the bit."""
WARNING_EMCY: Final = 0xFF20
"""EMCY of the warnings, where it is configured."""
_REGISTER: Final = 0x21
"""1001h: generic, device profile."""
_TENTH_HOUR_NS: Final = 360 * S


_COLUMNS: Final = (
    Column("coordinate", LOAD),
    Column("position_value", "steps"),
    Column("raw_value", "steps"),
    Column("speed_value"),
    Column("offset", "steps"),
    Column("cams"),
    Column("area"),
    Column("alarms"),
    Column("warnings"),
    NMT_STATE,
)


class CiA406Encoder:
    """An encoder as a device of its own on a CAN segment.

    It is off until `power_on`. Positions on the bus are those of the instant at which they are read: of SYNC
    for synchronous PDOs, of the transmission for TPDO1. Speeds, cams, work area, alarms and warnings are
    updated every millisecond.

    Args:
        scheduler: Clock of the encoder.
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

    trace_enums: ClassVar = value_texts(_COLUMNS)

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
        self.scheduler = scheduler
        self._history = history
        self.name = name
        self.config = config
        self.shaft = OwnShaft(name, shaft)
        self.family = family_of(config.kind)
        self.node = CanopenNode(
            scheduler,
            segment,
            EDS[self.family].dictionary(config.eds),
            config.node_id,
            name=name,
            history=history,
            boot_time_s=config.boot_time_s,
        )
        self.slave = self.node.slave
        self._set_defaults()
        self.measurement = Measurement(scheduler, self.slave, config, mounting, emit=self.emit, rng=rng)
        """Position channels, scaling, presets."""
        self.injected_alarms = 0
        self._alarms_shown = 0
        self.injected_warnings = 0
        self._operating_ns = round(config.operating_time_h * 10 * _TENTH_HOUR_NS)
        self._powered_ns = 0
        self._normal_cycle_ms: int | None = None
        per_step = self.channels[0].sensor.coordinate_per_step
        limit = config.max_speed
        self._max_steps = None if limit is None else limit / per_step * (CYCLE_NS / S)
        self._watchful = bool(
            self.measurement.bounded
            or self.measurement.incremental
            or self._max_steps is not None
            or config.operating_time_limit_h is not None
        )
        self.node.connect(
            rules.readers(self.slave.values, self.measurement, lambda: self.operating_time_tenths),
            rules.checks(self.slave.store, self.measurement, config),
        )
        self.measurement.take_parameters()
        self.trace_columns = names_and_units(_COLUMNS, "m" if config.kind.linear else "rad")
        """(name, unit) of the values of `trace_row`."""

        self.slave.on_reset.append(self._on_reset)
        scheduler.every(CYCLE_NS, self._cycle, priority=_PRIORITY)

    def _set_defaults(self) -> None:
        config = self.config
        kind = config.kind
        units = config.measuring_step_nm if kind.linear else config.steps_per_revolution
        derived = {
            (0x1000, 0): kind.device_type,
            (0x1018, 4): config.serial_number,
            (0x6002, 0): config.raw_range,
            (0x6501, 0): units,
            (0x650B, 0): config.serial_number,
            (0x6005, 1) if kind.linear else (0x6001, 0): units,
        }
        if not kind.linear:
            derived[0x6502, 0] = config.turns
        self.node.adopt(
            all_objects(self.family), device="CiA 406 encoder", required=(0x6000, 0x6004), eds=config.eds
        )
        self.node.set_defaults({**derived, **config.objects}, "encoder")

    @property
    def channels(self) -> tuple[Channel, ...]:
        """Position channels; a multi-sensor encoder has several."""
        return self.measurement.channels

    @property
    def scaling(self) -> Scaling:
        """Settings that make a position of raw steps."""
        return self.measurement.scaling

    def sample(self) -> None:
        """Form positions, cams and work areas of this instant, once per instant."""
        self.measurement.sample()

    def emit(self, kind: str, **data: str | float | bool) -> None:
        """Write an event of this encoder into the log, if there is one."""
        if self._history is not None:
            self._history.emit(self.name, kind, **data)

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

    # -- life ------------------------------------------------------------------------------------------

    def power_on(self) -> None:
        """Switch the supply on: absolute encoders know their position at once,
        others begin at zero (C406-008).
        """
        if not self.slave.powered:
            self._powered_ns = self.scheduler.now
            self.slave.power_on()
            self._restart()

    def power_off(self) -> None:
        """Switch the supply off: nothing is measured, all but the non-volatile memory is lost."""
        if self.slave.powered:
            self._operating_ns += self.scheduler.now - self._powered_ns
            for channel in self.channels:
                channel.sensor.power_off()
            self.slave.power_off()

    def _on_reset(self, application: bool) -> None:
        if application:
            self._restart()

    def _restart(self) -> None:
        """Begin as after power-on, with the parameters that have just been loaded."""
        self._alarms_shown = 0
        self.measurement.restart()

    @property
    def operating_time_tenths(self) -> int:
        """6508h: time under supply, 0.1 h."""
        running = self.scheduler.now - self._powered_ns if self.slave.powered else 0
        return (self._operating_ns + running) // _TENTH_HOUR_NS

    # -- alarms and warnings ---------------------------------------------------------------------------

    def _cycle(self) -> None:
        if not self.slave.powered or self.slave.nmt_state is NmtState.INITIALISING:
            return
        measurement = self.measurement
        measurement.sample()
        fastest = 0
        for channel in measurement.channels:
            moved = channel.cycle()
            if moved:
                fastest = max(fastest, abs(moved))
        if (
            self._watchful
            or self.injected_alarms != self._alarms_shown
            or self.injected_warnings != self.slave.values[0x650500]
        ):
            self._watch(fastest)

    def _watch(self, steps: int) -> None:
        """Look for causes of alarms and warnings; `steps` = raw steps moved in this cycle."""
        config = self.config
        alarms = self.injected_alarms
        if self.measurement.bounded and self.measurement.off_the_scale():
            alarms |= EncoderAlarm.POSITION_ERROR
        warnings = self.injected_warnings
        if self._max_steps is not None and steps > self._max_steps:
            warnings |= EncoderWarning.FREQUENCY_EXCEEDED
        limit_h = config.operating_time_limit_h
        if limit_h is not None and self.operating_time_tenths >= limit_h * 10:
            warnings |= EncoderWarning.OPERATING_TIME_LIMIT
        if self.measurement.incremental and not self.channels[0].sensor.reference_reached:
            warnings |= EncoderWarning.REFERENCE_POINT_NOT_REACHED
        if alarms != self._alarms_shown:
            self._show_alarms(alarms)
        before = self.slave.values[0x650500]
        if warnings != before:
            self._show_warnings(before, warnings)

    def _show_alarms(self, alarms: int) -> None:
        """Report alarms that have come and gone (C406-050, C406-051)."""
        before, self._alarms_shown = self._alarms_shown, alarms
        self.measurement.alarm = alarms != 0
        self.measurement.forget_sample()
        self.slave.set(0x6503, 0, alarms)
        self.emit("encoder.alarm", word=alarms, text=describe_flags(0x6503, alarms) or "none")
        data = alarms.to_bytes(2, "little") + self.slave.values[0x650500].to_bytes(2, "little")
        codes, past = _codes(alarms), _codes(before)
        for code in past:
            if code not in codes:
                self.slave.emcy_clear(code)
        for code in codes:
            if code not in past:
                self.slave.emcy(code, _REGISTER, data)

    def _show_warnings(self, before: int, warnings: int) -> None:
        self.slave.set(0x6505, 0, warnings)
        self.emit("encoder.warning", word=warnings, text=describe_flags(0x6505, warnings) or "none")
        if self.config.warning_emcy:
            if warnings & ~before:
                self.slave.emcy(WARNING_EMCY, _REGISTER, warnings.to_bytes(2, "little"), repeat=True)
            elif not warnings:
                self.slave.emcy_clear(WARNING_EMCY)

    def inject_alarms(self, word: int) -> None:
        """Set the bits of 6503h whose cause a test brings about.

        Raises:
            ConfigurationError: A bit that neither 6504h supports nor belongs to the manufacturer.

        """
        _supported("alarms", word, SUPPORTED_ALARMS)
        self.injected_alarms = word

    def inject_warnings(self, word: int) -> None:
        """Set the bits of 6505h whose cause a test brings about.

        Raises:
            ConfigurationError: A bit that neither 6506h supports nor belongs to the manufacturer.

        """
        _supported("warnings", word, SUPPORTED_WARNINGS)
        self.injected_warnings = word

    def peek(self, index: int, sub: int = 0) -> Any:
        """Return what an SDO upload of an entry would yield, without the bus and its delay."""
        hook = self.slave.store.read_hooks.get(index << 8 | sub)
        return self.slave.values[index << 8 | sub] if hook is None else hook()

    # -- sensor ----------------------------------------------------------------------------------------

    def freeze_encoder(self, frozen: bool) -> None:
        """Let the value stand still, or follow the shaft again."""
        for channel in self.channels:
            channel.sensor.encoder.freeze(frozen)
        self.measurement.forget_sample()

    def jump_encoder(self, increments: int) -> None:
        """Shift the value by raw steps, as a slipped coupling does."""
        for channel in self.channels:
            channel.sensor.encoder.jump(increments)
        self.measurement.forget_sample()

    def set_encoder_noise(self, increments: int) -> None:
        """Disturb the value by -increments..+increments raw steps; 0 = off."""
        for channel in self.channels:
            channel.sensor.encoder.set_noise(increments)
        self.measurement.forget_sample()

    def reverse_encoder(self, reversed_direction: bool) -> None:
        """Count the other way round from the present position on."""
        for channel in self.channels:
            channel.sensor.encoder.reverse(reversed_direction)
        self.measurement.forget_sample()

    def lose_encoder_steps(self, every: int) -> None:
        """Miss one of `every` raw steps of the motion; 0 = none from now on."""
        for channel in self.channels:
            channel.sensor.encoder.lose_steps(every)
        self.measurement.forget_sample()

    def suppress_index(self, missing: bool) -> None:
        """Let the reference mark never come, or come again; an incremental encoder
        that waits for it continues warning.

        Raises:
            UnsupportedFaultError: An absolute encoder has no mark.

        """
        if not self.measurement.incremental:
            raise UnsupportedFaultError(f"{self.name}: an absolute encoder has no index")
        for channel in self.channels:
            channel.sensor.encoder.zero_mark_present = not missing

    # -- device ----------------------------------------------------------------------------------------

    def preset_encoder(self, value: int) -> None:
        """Write a preset to 6003h, whatever moves; the value is taken into the range of 6002h."""
        self.measurement.take_parameters()
        self.measurement.preset(value % self.scaling.total)

    def move_near_overflow(self, margin: int) -> None:
        """Place the position `margin` units before the end of 6002h (>= 1), or behind its beginning (<= 0).

        A margin beyond the range is taken into it.
        """
        self.measurement.take_parameters()
        self.measurement.preset(-margin % self.scaling.total)

    def set_alarm(self, bit: int, active: bool) -> None:
        """Bring about the cause of an alarm, a bit of 6503h (0 position error, 12
        to 15 manufacturer), or end it.

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
        entry = store.entries.get(rules.EVENT_TIMER)
        if entry is None:
            raise UnsupportedFaultError(f"{self.name}: the EDS has no event timer 1800h:5")
        if period_ms is not None:
            if self._normal_cycle_ms is None:
                self._normal_cycle_ms = store.values[rules.EVENT_TIMER]
            store.assign(entry, period_ms)
        elif self._normal_cycle_ms is not None:
            store.assign(entry, self._normal_cycle_ms)
            self._normal_cycle_ms = None

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


def _codes(alarms: int) -> Sequence[int]:
    """Return the EMCY codes of alarm bits."""
    codes = [ALARM_EMCY] if alarms & 0x0FFF else []
    return codes + [MANUFACTURER_EMCY + bit for bit in range(12, 16) if alarms >> bit & 1]


def _supported(what: str, word: int, supported: int) -> None:
    allowed = supported | 0xF000
    if word & ~allowed or word < 0:
        raise ConfigurationError(what, word, f"bits of {allowed:04X}h")
