"""Port to the second encoder in the telegram of a PROFIdrive axis: G2_STW, G2_ZSW,
G2_XIST1 (CFG-207 to CFG-213).
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Final

from typing_extensions import override

from fieldbus.profidrive.words import G_STW, G_ZSW
from motion.drives.encoder import EncoderPort
from motion.drives.mark import TelegramMarkSearch

if TYPE_CHECKING:
    from motion.drives.profidrive import ProfidrivePort

_FAULTY: Final = int(G_ZSW.ERROR | G_ZSW.PARKING)
_ERROR: Final = int(G_ZSW.ERROR)
_ACKNOWLEDGE: Final = int(G_STW.ACKNOWLEDGE)


class SecondEncoderPort(EncoderPort):
    """The second encoder of a drive; its errors are acknowledged at once, so that
    they are gone with their cause.

    Args:
        port: Port to the drive, which is read before.
        absolute_encoder: It keeps its position over power-off.

    """

    def __init__(self, port: ProfidrivePort, *, absolute_encoder: bool) -> None:
        super().__init__()
        self._port = port
        self._sent = self._clearings = 0
        self.absolute_encoder = absolute_encoder
        self.telegram_number = port.telegram_number
        self.interface_number = 2
        self.mark = self._search = TelegramMarkSearch()
        self.brings_speed = True
        self.has_parameters = port.has_parameters

    @override
    def read(self) -> None:
        port = self._port
        self.link_ok = port.link_ok
        self.encoder_restarts = port.encoder_restarts
        if not port.link_ok:
            return
        self.actual_speed_rpm = port.actual_speed_rpm  # NIST_B is that of encoder 1 (CFG-339)
        zsw = port.actual("G2_ZSW")
        self.sensor_fault = bool(zsw & _FAULTY)
        if not self.sensor_fault:
            self.encoder_increments = port.actual("G2_XIST1")
        mark = self._search
        if mark.busy:
            mark.take(zsw, port.actual("G2_XIST2"))
        if port.clearings != self._clearings:
            self._clearings, self._sent = port.clearings, 0
        word = _ACKNOWLEDGE if zsw & _ERROR else mark.word
        if word != self._sent:
            self._sent = word
            port.command("G2_STW", word)

    @override
    def read_parameter(self, number: int, index: int, answer: Callable[[float | None, str], object]) -> None:
        # Those of its drive.
        self._port.read_parameter(number, index, answer)
