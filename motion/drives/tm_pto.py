"""Port to a channel of a pulse module on CANopen: telegram 3 with the deviations of
the module (PTO-127 to PTO-136).

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

from typing import TYPE_CHECKING, Final, Literal

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


def pto_words(
    *,
    variant: Literal["device", "standard"] = "device",
    reference_speed_rpm: float = 3000.0,
    telegram: int = 3,
    torque_telegram: bool = False,
    sign_of_life: bool = False,
) -> TelegramConfig:
    """Return telegram 3 as the module has it.

    Args:
        variant: `device`: 16-bit setpoint; `standard`: 32-bit setpoint.
        reference_speed_rpm: Speed at 100 % of the setpoint, rpm.
        telegram: 3.
        torque_telegram: False: the module has no torque.
        sign_of_life: False: nor a sign of life.

    Raises:
        ConfigurationError: It is not telegram 3, or has something that the module lacks.

    """
    return TelegramConfig(
        telegram=telegram,
        torque_telegram=torque_telegram,
        sign_of_life=sign_of_life,
        reference_speed_rpm=reference_speed_rpm,
        pulse_module=variant,
    )


class PulseModuleSteps:
    """Control words step by step: the module has to answer a step before the next one follows (PTO-273)."""

    def __init__(self) -> None:
        self._begun = False

    def word(self, stw1: int, *, link_ok: bool, zsw1: int) -> int:
        """Return the control word for the module; the arguments as in `ControlSteps`."""
        if not (link_ok and self._begun):
            self._begun = link_ok
            return _START
        word = stw1 & ~_NOT_EVALUATED
        # Enable operation stays while a stop ramp runs, on which the module still shows that it is ready.
        return word if zsw1 & _READY else word & ~_ENABLE_OPERATION


def pulse_module_port(
    master: CanopenMaster,
    config: ProfidriveCanConfig,
    *,
    name: str = "drive",
    history: History | None = None,
) -> ProfidriveCanPort:
    """Return the port to a channel of a pulse module.

    Args:
        master: The controller's CANopen services on the segment of the module.
        config: Facts about the module; its telegram by `pto_words`.
        name: Name of the drive in the history.
        history: Log for link and drive events; None for none.

    """
    return ProfidriveCanPort(
        master, config, name=name, history=history, steps=PulseModuleSteps(), delay_cycles=1.5
    )
