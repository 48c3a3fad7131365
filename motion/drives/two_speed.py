"""Port to a drive with two speeds through an I/O station: the bits of the two-speed interface as digital
outputs, and a counter (section 19.2 of the NC specification).

Delays are those of an analog drive: outputs are written and inputs sampled in the same exchange.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Final

from typing_extensions import override

from fieldbus.errors import ConfigurationError
from fieldbus.profidrive.words import STW1, ZSW1
from motion.drives._link import LinkConfig, LinkedPort
from motion.drives.station import StationAnswers

if TYPE_CHECKING:
    from collections.abc import Mapping

    from fieldbus.history import History
    from motion.drives.station import StationLink

BITS: Final[Mapping[str, tuple[int, int]]] = {
    "minus_high": (8, 0),
    "minus_low": (8, 1),
    "plus_low": (8, 2),
    "plus_high": (8, 3),
    "direction_minus": (9, 0),
    "direction_plus": (9, 1),
    "velo_low": (9, 2),
    "velo_high": (9, 3),
    "brake": (8, 7),
}
"""Byte and bit of the 12 byte of the interface by the terminal that it switches."""
_OPERATE: Final = int(STW1.ON | STW1.NO_OFF2 | STW1.NO_OFF3 | STW1.ENABLE_OPERATION)
_REQUESTED: Final = int(ZSW1.CONTROL_REQUESTED)
_READY_TO_SWITCH_ON: Final = int(ZSW1.READY_TO_SWITCH_ON)
_OPERATING: Final = int(ZSW1.READY_TO_SWITCH_ON | ZSW1.READY | ZSW1.OPERATION_ENABLED)
_STANDS: Final = 0x80
"""Control byte: no speed, brake applied."""


@dataclass(frozen=True, kw_only=True)
class TwoSpeedPortConfig(LinkConfig):
    """Wires of a drive with two speeds.

    Args:
        outputs: Number of the digital output by terminal, names of `BITS`.
        counter: Number of the counter of its encoder; None: there is none.

    Raises:
        ConfigurationError: A value is out of range.

    """

    outputs: Mapping[str, int] = field(default_factory=dict)
    counter: int | None = None


class TwoSpeedPort(LinkedPort):
    """Makes terminals of the two-speed interface.

    Args:
        station: Where the drive is wired to.
        config: Its wires.
        name: Name of the drive in the history.
        history: Log for link events; None for none.

    Raises:
        ConfigurationError: The station has no such channel, or there is no such terminal.

    """

    __slots__ = ("_answers", "_image", "_station", "_stw1", "_wires")

    reports_stop = False

    def __init__(
        self,
        station: StationLink,
        config: TwoSpeedPortConfig,
        *,
        name: str = "drive",
        history: History | None = None,
    ) -> None:
        super().__init__(config, name=name, history=history)
        image = station.image
        wires: list[tuple[int, int, int]] = []
        for terminal, number in config.outputs.items():
            if terminal not in BITS:
                raise ConfigurationError(f"{name}: terminal", terminal, ", ".join(BITS))
            if not 0 <= number < image.digital_outputs:
                raise ConfigurationError(f"{name}: output", number, f"0..{image.digital_outputs - 1}")
            byte, bit = BITS[terminal]
            wires.append((number, byte, 1 << bit))
        if config.counter is not None and not 0 <= config.counter < image.counters:
            raise ConfigurationError(f"{name}: counter", config.counter, f"0..{image.counters - 1}")
        self._wires = tuple(wires)
        self._station = station
        self._answers = StationAnswers(station, config.counter)
        self._stw1 = 0
        self._image = bytes(8) + bytes((_STANDS, _STANDS, 0, 0))
        self.enter_service()

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
        operate = self._stw1 & _OPERATE == _OPERATE
        self.zsw1 = _REQUESTED | (_OPERATING if operate else _READY_TO_SWITCH_ON)
        self.encoder_increments = answers.increments(self.encoder_increments)

    @override
    def write(self, stw1: int, speed_rpm: float, torque_nm: float = 0.0) -> None:
        """Send a control word: without an image the drive stands."""
        self.write_image(stw1, self._image if speed_rpm else bytes(8) + bytes((_STANDS, _STANDS, 0, 0)))

    @override
    def write_image(self, stw1: int, image: bytes) -> None:
        self._stw1 = stw1
        self._image = image
        station = self._station
        for number, byte, mask in self._wires:
            station.set_output(number, image[byte] & mask != 0)

    @override
    def process_words(self) -> dict[str, int]:
        return {"nControlByte": self._image[8], "nExtControlByte": self._image[9]}

    def release(self) -> None:
        """Switch everything off: nobody will lead the drive any more."""
        self.write(0, 0.0)
        self._station.exchange()
