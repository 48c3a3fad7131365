"""Port to a channel of a pulse module on CANopen: telegram 3 with the deviations of the module (PTO-127 to
PTO-136).

* the setpoint has 16 bits (the device), or 32 (the standard variant, to be asked for; PTO-037);
* no sign of life in either direction;
* control words are given step by step: stops withdrawn, ON, enable operation, each when the module has
  answered (PTO-273);
* the position is the count of the pulses, without fine resolution: a motor that is out of step is not
  noticed (PTO-280).

Delays, with T the bus cycle: the module samples at SYNC k, the axis calculates half a cycle later, and the
module goes to the setpoint at SYNC k+1, on its own ramp.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Final, Literal

from fieldbus.errors import ConfigurationError
from fieldbus.profidrive import Telegram, pto_telegram, telegram
from fieldbus.profidrive.words import STW1, ZSW1
from motion.drives.profidrive import TelegramConfig
from motion.drives.profidrive_can import ProfidriveCanConfig, ProfidriveCanPort

if TYPE_CHECKING:
    from fieldbus.canopen.master import CanopenMaster
    from fieldbus.history import History

_START: Final = 0x0450
"""First step: control, ramp generator and setpoint enabled, all stops active."""
_NOT_EVALUATED: Final = int(STW1.RAMP_RELEASE)
_ENABLE_OPERATION: Final = int(STW1.ENABLE_OPERATION)
_READY: Final = int(ZSW1.READY)


@dataclass(slots=True, frozen=True, kw_only=True)
class PtoWords(TelegramConfig):
    """Telegram 3 as the module has it.

    Args:
        variant: `device`: 16-bit setpoint; `standard`: 32-bit setpoint.

    Raises:
        ConfigurationError: It is not telegram 3, or has something that the module lacks.

    """

    sign_of_life: bool = False
    variant: Literal["device", "standard"] = "device"

    def __post_init__(self) -> None:
        for name, needed in (("telegram", 3), ("torque_telegram", False), ("sign_of_life", False)):
            if getattr(self, name) != needed:
                raise ConfigurationError(f"pulse module, {name}", getattr(self, name), str(needed))
        if self.variant not in ("device", "standard"):
            raise ConfigurationError("pulse module, variant", self.variant, "device, standard")

    def build(self) -> Telegram:
        """Return the layout of both directions."""
        return pto_telegram() if self.variant == "device" else telegram(3)


@dataclass(slots=True, frozen=True, kw_only=True)
class TmPtoConfig(ProfidriveCanConfig):
    """Facts about the module that the controller has to know.

    Args:
        words: Its telegram.

    """

    words: TelegramConfig = field(default_factory=PtoWords)


class TmPtoPort(ProfidriveCanPort):
    """See the module.

    Args:
        master: The controller's CANopen services on the segment of the module.
        config: Facts about the module.
        name: Name of the drive in the history.
        history: Log for link and drive events; None for none.

    """

    __slots__ = ("_begun",)

    def __init__(
        self,
        master: CanopenMaster,
        config: TmPtoConfig,
        *,
        name: str = "drive",
        history: History | None = None,
    ) -> None:
        super().__init__(master, config, name=name, history=history)
        self._begun = False
        self._stw2_at = -1  # the sign of life has to be 0, in the standard variant too

    @property
    def delay_ns(self) -> int:
        """See `LinkedPort.delay_ns`: the setpoint is there at once, so that its middle counts."""
        return self._cycle_ns * 3 // 2

    def _compose(self, stw1: int, speed_rpm: float, torque_nm: float) -> bytes | None:
        return super()._compose(self._step_by_step(stw1), speed_rpm, torque_nm)

    def _step_by_step(self, stw1: int) -> int:
        """Return the control word for the module: what it has not answered yet is not followed by the next
        step.
        """
        if not (self.link_ok and self._begun):
            self._begun = self.link_ok
            return _START
        word = stw1 & ~_NOT_EVALUATED
        # Enable operation stays while a stop ramp runs, on which the module still shows that it is ready.
        return word if self.zsw1 & _READY else word & ~_ENABLE_OPERATION
