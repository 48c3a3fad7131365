"""How an encoder forms its positions: channels, scaling, presets (C406-003 to C406-008)."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from emulators.encoder._mounting import Mounting
from emulators.encoder.cia406._channel import Channel, Scaling
from emulators.encoder.cia406._sensor import Sensor
from emulators.encoder.cia406.config import EncoderDeviceConfig
from emulators.events import Emit
from fieldbus.canopen.slave import CanopenSlave
from fieldbus.cia406 import EncoderType
from fieldbus.clock import Scheduler

if TYPE_CHECKING:
    import numpy as np


class Measurement:
    """The position channels of an encoder, sampled once per instant.

    Args:
        scheduler: Clock of the encoder.
        slave: Holds the objects.
        config: The encoder.
        mounting: What it measures, and how it is coupled to it.
        emit: Writes presets and cams into the log.
        rng: Source of the noise; None: the encoder cannot be made noisy.

    """

    def __init__(
        self,
        scheduler: Scheduler,
        slave: CanopenSlave,
        config: EncoderDeviceConfig,
        mounting: Mounting,
        *,
        emit: Emit,
        rng: np.random.Generator | None,
    ) -> None:
        self._scheduler = scheduler
        self._slave = slave
        self._emit = emit
        self.scaling = Scaling(config)
        places = config.sensor_places_m if config.kind is EncoderType.MULTI_SENSOR else (0.0,)
        self.channels: tuple[Channel, ...] = tuple(
            Channel(
                number,
                Sensor(config, mounting, place_m=place, rng=rng),
                scaling=self.scaling,
                values=slave.values,
                config=config,
            )
            for number, place in enumerate(places, 1)
        )
        self.incremental = config.kind.incremental
        self.bounded = self.channels[0].sensor.bounded
        self.alarm = False
        """An alarm is shown: the values are held."""
        self._stale = True
        self._sampled_ns = -1
        self._offset_settings: tuple[Any, ...] = ()

    def restart(self) -> None:
        """Begin as after power-on, with the parameters that have just been loaded."""
        self.alarm = False
        self.take_parameters(force=True)
        memory = self._slave.store.stored
        valid = self._offset_settings == self._settings() and not self.incremental
        for number, channel in enumerate(self.channels):
            channel.sensor.power_on()
            channel.restart()
            channel.offset = int(memory.get(_offset_key(number), 0)) if valid else 0
        self.sample()

    # -- parameters ------------------------------------------------------------------------------------

    def invalidate(self) -> None:
        """Note that a parameter of the position formation is being written: the
        preset no longer counts (C406-007).
        """
        self._stale = True
        self.forget_sample()
        for number, channel in enumerate(self.channels):
            channel.offset = 0
            self._slave.store.stored.pop(_offset_key(number), None)

    def take_parameters(self, *, force: bool = False) -> None:
        """Take written parameters over."""
        if self._stale or force:
            self._stale = False
            self.scaling.take(self._slave.values)
            self.forget_sample()

    def forget_sample(self) -> None:
        """Let the next reader sample again although the instant is the same."""
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
        if not self.incremental:
            self._offset_settings = self._settings()
            for number, other in enumerate(self.channels):
                self._slave.store.stored[_offset_key(number)] = other.offset
        self.forget_sample()
        self._emit("encoder.preset", value=value, offset=one.offset, channel=channel + 1)

    # -- samples -------------------------------------------------------------------------------------

    def sample(self) -> None:
        """Form positions, cams and work areas of this instant, once per instant."""
        now = self._scheduler.now
        if now == self._sampled_ns:
            return
        if self._stale:
            self.take_parameters()
        self._sampled_ns = now
        hold = self.alarm or (self.bounded and self.off_the_scale())
        for channel in self.channels:
            if channel.sample(hold=hold):
                self._tell_states(channel)

    def off_the_scale(self) -> bool:
        """Return whether a sensor has left its scale."""
        return self.bounded and any(channel.sensor.off_the_scale for channel in self.channels)

    def _tell_states(self, channel: Channel) -> None:
        """Take cams and work area of a channel into their objects; event-driven TPDOs notice."""
        slave, number = self._slave, channel.number
        slave.set(0x6400, number, channel.area)
        if channel.cams != slave.values[0x630000 | number]:
            slave.set(0x6300, number, channel.cams)
            self._emit("encoder.cams", state=channel.cams, channel=number)


def _offset_key(channel: int) -> int:
    """Return the key of the offset of a channel in the non-volatile memory."""
    return 0x650900 if channel == 0 else 0x650C01 + channel
