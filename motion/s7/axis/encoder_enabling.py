"""Enabling of an external encoder: no drive, no ramp, only whether its values are valid (STP-035, MC-159)."""

from __future__ import annotations

from typing import TYPE_CHECKING

from motion.s7.axis.enabling import ALARM_ENCODER_NOT_READY, NOT_INITIALISED

if TYPE_CHECKING:
    from motion.s7.axis.external_encoder import ExternalEncoder


class EncoderEnabling:
    """What `MC_Power` commands and sees of an external encoder; the object steps it once per cycle."""

    __slots__ = ("_joined", "_object", "enable", "enabled", "start_mode")

    def __init__(self, external: ExternalEncoder) -> None:
        self._object = external
        self._joined = False
        """The encoder has been there since the start of the controller, or it has been told that it was not.
        """
        self.enable = False
        """Level of `MC_Power.Enable` as last called."""
        self.enabled = False
        """`MC_Power.Status` and `StatusWord.X0`."""
        self.start_mode = 1
        """Without effect (STP-027)."""

    @property
    def busy(self) -> bool:
        """`MC_Power.Busy`: enabled, or to be enabled."""
        return self.enable

    @property
    def alarmed(self) -> bool:
        """Whether an alarm keeps an object disabled that is to be enabled."""
        return self.enable and not self.enabled and self._object.engine.reaction != 0

    def call(self, *, enable: bool, start_mode: int, stop_mode: int) -> None:
        """Take the inputs of `MC_Power` over; there is nothing to stop."""
        del start_mode, stop_mode
        self.enable = enable
        if not enable:
            self._set(False)

    def step(self) -> None:
        """Follow input, encoder value and alarms."""
        external = self._object
        if not self._joined:
            if external.sensor_valid:
                self._joined = True
            elif self.enable:
                self._joined = True
                external.engine.raise_alarm(ALARM_ENCODER_NOT_READY, info=NOT_INITIALISED)
        wanted = self.enable and external.engine.reaction == 0 and not external.restarting
        # A value that becomes invalid without an alarm does not end what has been enabled.
        self._set(wanted and (self.enabled or external.sensor_valid))

    def _set(self, enabled: bool) -> None:
        if enabled is self.enabled:
            return
        self.enabled = enabled
        external = self._object
        if external.history is not None:
            external.history.emit(external.name, "power.status", value=enabled)
