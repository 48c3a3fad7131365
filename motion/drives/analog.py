"""Port to a drive with an analog setpoint through an I/O station: enable output, ready
input, analog output, counter.

The axis speaks control and status words; this port makes terminals of them (STP-058
to STP-062, CFG-386 to CFG-398):

* the enable output is set as long as the axis wants the drive to operate, and
  only then a setpoint is output;
* the drive operates when the ready input says so, without one as soon as the enable output is set;
* the drive does not report when it has stopped by itself: the axis looks at its encoder (`reports_stop`).

Delays, with T the cycle: the axis calculates, its outputs are written and its inputs are sampled in the same
exchange, and the axis sees them one cycle later.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

from typing_extensions import override

from fieldbus.errors import ConfigurationError
from fieldbus.profidrive.words import STW1, ZSW1
from motion.drives._link import LinkConfig, LinkedPort
from motion.drives.station import StationAnswers, StationLink

if TYPE_CHECKING:
    from fieldbus.history import History

FULL_SCALE: Final = 27648
"""Word of 100 % (CFG-397)."""
OVERRANGE: Final = 1.17
"""Largest setpoint as a share of the reference speed (CFG-396)."""
_OPERATE: Final = int(STW1.ON | STW1.NO_OFF2 | STW1.NO_OFF3 | STW1.ENABLE_OPERATION)
_STOPS: Final = int(STW1.NO_OFF2 | STW1.NO_OFF3)
_REQUESTED: Final = int(ZSW1.CONTROL_REQUESTED)
_READY_TO_SWITCH_ON: Final = int(ZSW1.READY_TO_SWITCH_ON)
_READY: Final = int(ZSW1.READY_TO_SWITCH_ON | ZSW1.READY)
_OPERATING: Final = int(ZSW1.OPERATION_ENABLED)
_INHIBITED: Final = int(ZSW1.SWITCHING_ON_INHIBITED)
_OFF_SHIFT: Final = 3
"""STW1 bits 1 and 2 show as ZSW1 bits 4 and 5."""


@dataclass(frozen=True, kw_only=True)
class AnalogPortConfig(LinkConfig):
    """Facts about the drive and its wires that the controller has to know.

    Args:
        reference_speed_rpm: Speed at 100 % of the analog output, rpm (CFG-394).
        setpoint: Number of the analog output.
        enable: Number of the digital output that enables the drive; None: there is none (CFG-388).
        ready: Number of the digital input at which the drive says that it is ready; None: there is none.
        counter: Number of the counter of its encoder; None: a speed axis without encoder.

    Raises:
        ConfigurationError: A value is out of range.

    """

    reference_speed_rpm: float = 3000.0
    setpoint: int = 0
    enable: int | None = None
    ready: int | None = None
    counter: int | None = None

    def __post_init__(self) -> None:
        LinkConfig.__post_init__(self)
        if not (math.isfinite(self.reference_speed_rpm) and self.reference_speed_rpm > 0.0):
            raise ConfigurationError(
                "analog drive, reference_speed_rpm", self.reference_speed_rpm, "a finite number > 0"
            )


class AnalogPort(LinkedPort):
    """Makes terminals of control word, status word and speed setpoint.

    Args:
        station: Where the drive is wired to.
        config: Facts about the drive.
        name: Name of the drive in the history.
        history: Log for link events; None for none.

    Raises:
        ConfigurationError: The station has no such channel.

    """

    __slots__ = (
        "_answers",
        "_config",
        "_enable",
        "_ready",
        "_reference",
        "_setpoint",
        "_station",
        "_stw1",
    )

    reports_stop = False
    analog = True

    def __init__(
        self,
        station: StationLink,
        config: AnalogPortConfig,
        *,
        name: str = "drive",
        history: History | None = None,
    ) -> None:
        super().__init__(config, name=name, history=history)
        image = station.image
        for kind, number, count in (
            ("setpoint", config.setpoint, image.analog_outputs),
            ("enable", config.enable, image.digital_outputs),
            ("ready", config.ready, image.digital_inputs),
            ("counter", config.counter, image.counters),
        ):
            if number is not None and not 0 <= number < count:
                allowed = f"0..{count - 1}" if count else "none: the station has no such channels"
                raise ConfigurationError(f"{name}: channel of the {kind}", number, allowed)
        self._station = station
        self._config = config
        self._reference = config.reference_speed_rpm
        self._setpoint, self._enable, self._ready = config.setpoint, config.enable, config.ready
        self._answers = StationAnswers(station, config.counter)
        self._stw1 = 0
        self.enter_service()

    @override
    def set_reference(self, speed_rpm: float, torque_nm: float) -> None:
        self._reference = speed_rpm

    @property
    def started(self) -> bool:
        """The station has answered."""
        return self._answers.started

    @property
    @override
    def delay_ns(self) -> int:
        return self._answers.delay_ns(self._cycle_ns)

    @override
    def read(self) -> None:
        answers = self._answers
        alive = self._judge(answers.fresh())
        if answers.returned(alive):
            self.drive_restarted()
        if not alive:
            return
        stw1 = self._stw1
        zsw1 = _REQUESTED | (stw1 & _STOPS) << _OFF_SHIFT
        if stw1 & _OPERATE == _OPERATE:
            zsw1 |= _READY
            if self._ready is None or self._station.input(self._ready):
                zsw1 |= _OPERATING
        elif stw1 & _STOPS == _STOPS:
            zsw1 |= _READY_TO_SWITCH_ON
        else:
            zsw1 |= _INHIBITED
        self.zsw1 = zsw1
        self.encoder_increments = answers.increments(self.encoder_increments)

    @override
    def write(self, stw1: int, speed_rpm: float, torque_nm: float = 0.0) -> None:
        # The outputs go with the next exchange of the station.
        self._stw1 = stw1
        operate = stw1 & _OPERATE == _OPERATE
        station = self._station
        if self._enable is not None:
            station.set_output(self._enable, operate)
        word = 0
        if operate and self.zsw1 & _OPERATING:
            share = min(max(speed_rpm / self._reference, -OVERRANGE), OVERRANGE)
            word = round(share * FULL_SCALE)
        station.set_analog(self._setpoint, word)

    def release(self) -> None:
        """Take enable and setpoint away: nobody will lead the drive any more."""
        self.write(0, 0.0)
        self._station.exchange()
