"""The encoder on the bus: CANopen slave, life, presets, alarms and warnings."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, Final

from emulators.encoder._mounting import Mounting
from emulators.encoder.cia406 import _object_rules
from emulators.encoder.cia406._channel import Channel, Scaling
from emulators.encoder.cia406._eds import encoder_dictionary
from emulators.encoder.cia406._objects import SUPPORTED_ALARMS, SUPPORTED_WARNINGS, family_of
from emulators.encoder.cia406._sensor import Sensor
from emulators.encoder.cia406.config import EncoderDeviceConfig
from fieldbus.can.frame import CanSegment
from fieldbus.canopen.nmt import NmtState
from fieldbus.canopen.slave import CanopenSlave
from fieldbus.cia406 import EncoderAlarm, EncoderType, EncoderWarning, describe_flags
from fieldbus.clock import MS, S, Scheduler, seconds_to_ns
from fieldbus.errors import ConfigurationError
from fieldbus.history import History

if TYPE_CHECKING:
    import numpy as np

CYCLE_NS: Final = 1 * MS
"""Speeds, cams, work area, alarms and warnings are looked at every millisecond."""
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


class EncoderDevice:
    """An encoder as node of a CAN segment; use `CiA406Encoder`, which adds fault injection and the recorder's
    columns.

    See there for the arguments.
    """

    __slots__ = (
        "_alarms_told",
        "_bounded",
        "_history",
        "_incremental",
        "_max_steps",
        "_offset_settings",
        "_operating_ns",
        "_powered_ns",
        "_sampled_ns",
        "_scheduler",
        "_stale",
        "_watchful",
        "channels",
        "config",
        "family",
        "injected_alarms",
        "injected_warnings",
        "name",
        "scaling",
        "slave",
    )

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
    ) -> None:
        self._scheduler = scheduler
        self._history = history
        self.name = name
        self.config = config
        self.family = family_of(config.kind)
        self.slave = CanopenSlave(
            scheduler,
            segment,
            encoder_dictionary(self.family if config.eds is None else config.eds),
            config.node_id,
            name=name,
            history=history,
            boot_time_ns=seconds_to_ns(config.boot_time_s),
        )
        self._set_defaults()
        self.scaling = Scaling(config)
        places = config.sensor_places_m if config.kind is EncoderType.MULTI_SENSOR else (0.0,)
        self.channels: tuple[Channel, ...] = tuple(
            Channel(
                number,
                Sensor(config, mounting, place_m=place, rng=rng),
                scaling=self.scaling,
                values=self.slave.values,
                config=config,
            )
            for number, place in enumerate(places, 1)
        )
        self._incremental = config.kind.incremental
        self._bounded = self.channels[0].sensor.bounded
        self._stale = True
        self._sampled_ns = -1
        self.injected_alarms = 0
        self._alarms_told = 0
        self.injected_warnings = 0
        self._offset_settings: tuple[Any, ...] = ()
        self._operating_ns = round(config.operating_time_h * 10 * _TENTH_HOUR_NS)
        self._powered_ns = 0
        per_step = self.channels[0].sensor.coordinate_per_step
        limit = config.max_speed
        self._max_steps = None if limit is None else limit / per_step * (CYCLE_NS / S)
        self._watchful = bool(
            self._bounded
            or self._incremental
            or self._max_steps is not None
            or config.operating_time_limit_h is not None
        )
        _object_rules.install(self)
        self.take_parameters()
        self.slave.on_reset.append(self._on_reset)
        scheduler.every(CYCLE_NS, self._cycle, priority=_PRIORITY)

    def _set_defaults(self) -> None:
        config = self.config
        kind = config.kind
        store = self.slave.store
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
        _object_rules.prepare_values(self)
        for (index, sub), value in {**derived, **config.objects}.items():
            entry = store.entries.get(index << 8 | sub)
            if entry is not None:
                entry.default = entry.coerce(value)
            elif index << 8 | sub in self.slave.values:
                self.slave.values[index << 8 | sub] = value
            else:
                raise ConfigurationError("objects", f"{index:04X}h:{sub}", "an object of the encoder")
        store.load(application=True)

    # -- life ------------------------------------------------------------------------------------------

    def power_on(self) -> None:
        """Switch the supply on: absolute encoders know their position at once, others begin at zero
        (C406-008).
        """
        if not self.slave.powered:
            self._powered_ns = self._scheduler.now
            self.slave.power_on()
            self._restart()

    def power_off(self) -> None:
        """Switch the supply off: nothing is measured, all but the non-volatile memory is lost."""
        if self.slave.powered:
            self._operating_ns += self._scheduler.now - self._powered_ns
            for channel in self.channels:
                channel.sensor.power_off()
            self.slave.power_off()

    def _on_reset(self, application: bool) -> None:
        if application:
            self._restart()

    def _restart(self) -> None:
        """Begin as after power-on, with the parameters that have just been loaded."""
        self._alarms_told = 0
        self.take_parameters(force=True)
        memory = self.slave.store.stored
        valid = self._offset_settings == self._settings() and not self._incremental
        for number, channel in enumerate(self.channels):
            channel.sensor.power_on()
            channel.restart()
            channel.offset = int(memory.get(_offset_key(number), 0)) if valid else 0
        self.sample()

    @property
    def operating_time_tenths(self) -> int:
        """6508h: time under supply, 0.1 h."""
        running = self._scheduler.now - self._powered_ns if self.slave.powered else 0
        return (self._operating_ns + running) // _TENTH_HOUR_NS

    # -- parameters ------------------------------------------------------------------------------------

    def invalidate(self) -> None:
        """Note that a parameter of the position formation is being written: the preset counts no more
        (C406-007).
        """
        self._stale = True
        self.forget_sample()
        for number, channel in enumerate(self.channels):
            channel.offset = 0
            self.slave.store.stored.pop(_offset_key(number), None)

    def take_parameters(self, *, force: bool = False) -> None:
        """Take written parameters over."""
        if self._stale or force:
            self._stale = False
            self.scaling.take(self.slave.values)
            self.forget_sample()

    def forget_sample(self) -> None:
        """Have the next reader sample anew although the instant is the same."""
        self._sampled_ns = -1

    def _settings(self) -> tuple[Any, ...]:
        """Return what an offset depends on."""
        scaling = self.scaling
        return scaling.on, scaling.reversed, scaling.numerator, scaling.resolution, scaling.total

    def preset(self, value: int, *, channel: int = 0) -> None:
        """Make the position of a channel `value` now, also in motion, and remember it (C406-005, C406-006).

        An absolute encoder keeps the offset over a loss of supply, at once and without 1010h, as long as the
        parameters of the position formation are the same then.
        """
        self.take_parameters()
        one = self.channels[channel]
        one.preset(value)
        if not self._incremental:
            self._offset_settings = self._settings()
            for number, other in enumerate(self.channels):
                self.slave.store.stored[_offset_key(number)] = other.offset
        self.forget_sample()
        if self._history is not None:
            self._history.emit(
                self.name, "encoder.preset", value=value, offset=one.offset, channel=channel + 1
            )

    # -- measuring -------------------------------------------------------------------------------------

    def sample(self) -> None:
        """Form positions, cams and work areas of this instant, once per instant."""
        now = self._scheduler.now
        if now == self._sampled_ns:
            return
        if self._stale:
            self.take_parameters()
        self._sampled_ns = now
        hold = self._alarms_told != 0 or (self._bounded and self._off_the_scale())
        for channel in self.channels:
            if channel.sample(hold=hold):
                self._tell_states(channel)

    def _off_the_scale(self) -> bool:
        return self._bounded and any(channel.sensor.off_the_scale for channel in self.channels)

    def _tell_states(self, channel: Channel) -> None:
        """Take cams and work area of a channel into their objects; event-driven TPDOs notice."""
        slave, number = self.slave, channel.number
        slave.set(0x6400, number, channel.area)
        if channel.cams != slave.values[0x630000 | number]:
            slave.set(0x6300, number, channel.cams)
            if self._history is not None:
                self._history.emit(self.name, "encoder.cams", state=channel.cams, channel=number)

    def _cycle(self) -> None:
        if not self.slave.powered or self.slave.nmt_state is NmtState.INITIALISING:
            return
        self.sample()
        fastest = 0
        for channel in self.channels:
            moved = channel.cycle()
            if moved:
                fastest = max(fastest, abs(moved))
        if (
            self._watchful
            or self.injected_alarms != self._alarms_told
            or self.injected_warnings != self.slave.values[0x650500]
        ):
            self._watch(fastest)

    def _watch(self, steps: int) -> None:
        """Look for causes of alarms and warnings; `steps` = raw steps moved in this cycle."""
        config = self.config
        alarms = self.injected_alarms
        if self._bounded and self._off_the_scale():
            alarms |= EncoderAlarm.POSITION_ERROR
        warnings = self.injected_warnings
        if self._max_steps is not None and steps > self._max_steps:
            warnings |= EncoderWarning.FREQUENCY_EXCEEDED
        limit_h = config.operating_time_limit_h
        if limit_h is not None and self.operating_time_tenths >= limit_h * 10:
            warnings |= EncoderWarning.OPERATING_TIME_LIMIT
        if self._incremental and not self.channels[0].sensor.reference_reached:
            warnings |= EncoderWarning.REFERENCE_POINT_NOT_REACHED
        if alarms != self._alarms_told:
            self._tell_alarms(alarms)
        before = self.slave.values[0x650500]
        if warnings != before:
            self._tell_warnings(before, warnings)

    def _tell_alarms(self, alarms: int) -> None:
        """Report alarms that have come and gone (C406-050, C406-051)."""
        before, self._alarms_told = self._alarms_told, alarms
        self.forget_sample()
        self.slave.set(0x6503, 0, alarms)
        if self._history is not None:
            self._history.emit(
                self.name, "encoder.alarm", word=alarms, text=describe_flags(0x6503, alarms) or "none"
            )
        data = alarms.to_bytes(2, "little") + self.slave.values[0x650500].to_bytes(2, "little")
        codes, past = _codes(alarms), _codes(before)
        for code in past:
            if code not in codes:
                self.slave.emcy_clear(code)
        for code in codes:
            if code not in past:
                self.slave.emcy(code, _REGISTER, data)

    def _tell_warnings(self, before: int, warnings: int) -> None:
        self.slave.set(0x6505, 0, warnings)
        if self._history is not None:
            self._history.emit(
                self.name, "encoder.warning", word=warnings, text=describe_flags(0x6505, warnings) or "none"
            )
        if self.config.warning_emcy:
            if warnings & ~before:
                self.slave.emcy(WARNING_EMCY, _REGISTER, warnings.to_bytes(2, "little"), repeat=True)
            elif not warnings:
                self.slave.emcy_clear(WARNING_EMCY)

    def inject_alarms(self, word: int) -> None:
        """Set the bits of 6503h whose cause somebody brings about.

        Raises:
            ConfigurationError: A bit that neither 6504h supports nor belongs to the manufacturer.

        """
        _supported("alarms", word, SUPPORTED_ALARMS)
        self.injected_alarms = word

    def inject_warnings(self, word: int) -> None:
        """Set the bits of 6505h whose cause somebody brings about.

        Raises:
            ConfigurationError: A bit that neither 6506h supports nor belongs to the manufacturer.

        """
        _supported("warnings", word, SUPPORTED_WARNINGS)
        self.injected_warnings = word

    def peek(self, index: int, sub: int = 0) -> Any:
        """Return what an SDO upload of an entry would yield, without the bus and its delay."""
        hook = self.slave.store.read_hooks.get(index << 8 | sub)
        return self.slave.values[index << 8 | sub] if hook is None else hook()


def _offset_key(channel: int) -> int:
    """Return where the offset of a channel lies in the non-volatile memory."""
    return 0x650900 if channel == 0 else 0x650C01 + channel


def _codes(alarms: int) -> Sequence[int]:
    """Return the EMCY codes of alarm bits."""
    codes = [ALARM_EMCY] if alarms & 0x0FFF else []
    return codes + [MANUFACTURER_EMCY + bit for bit in range(12, 16) if alarms >> bit & 1]


def _supported(what: str, word: int, supported: int) -> None:
    allowed = supported | 0xF000
    if word & ~allowed or word < 0:
        raise ConfigurationError(what, word, f"bits of {allowed:04X}h")
