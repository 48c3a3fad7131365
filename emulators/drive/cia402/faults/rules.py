"""What the drive does on each of its faults, as data: one rule per EMCY code (C301-114 to C301-131, C402-296
to C402-308).

The profile names the codes and leaves the rest to the manufacturer: which faults allow the drive to brake,
and how they are reset. `RULES` answers that for every code of `fieldbus.cia402.EMCY_TEXTS`; `fault_rule` also
for codes that have no text.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum
from typing import Final

from fieldbus.canopen.emcy import register_bits
from fieldbus.cia402 import EMCY_TEXTS, emcy_text


class Reaction(Enum):
    """What happens to the torque (C402-014, C402-015)."""

    COAST = "coast"
    """Torque off at once, whatever 605Eh says: power stage, its supply, control or motor sensor has failed.
    """
    OPTION = "option"
    """As the fault reaction option code 605Eh says."""


class Reset(Enum):
    """What takes the drive out of Fault (C402-016)."""

    EDGE = "edge"
    """A rising edge of bit 7 once the cause is gone."""
    RESTART = "restart"
    """Only power-off or NMT reset node: memory or processor have failed."""


@dataclass(frozen=True)
class FaultRule:
    """Everything that belongs to an EMCY code."""

    code: int
    text: str
    register: int
    """Bits of 1001h (C402-308)."""
    reaction: Reaction
    reset: Reset


_COASTING: Final = (
    # Short circuits and earth leakage; a continuous overcurrent can still be braked.
    *range(0x2110, 0x2140), 0x2211, 0x2212, *range(0x2230, 0x2300), *range(0x2320, 0x2350),
    # No or too much voltage in the DC link, output and field circuits.
    *range(0x3210, 0x3230), *range(0x3300, 0x3400),
    # Supply of the control, control, power section, contacts, fuses; the chopper alone does not hinder.
    *range(0x5100, 0x5300), *range(0x5400, 0x5420), *range(0x5430, 0x5460),
    # Memory, watchdog.
    *range(0x5500, 0x5600), 0x6010,
    # Commutation, and every sensor of the motor.
    0x7122, *range(0x7200, 0x7400),
    0xFF80, 0xFF81,
)  # fmt: skip
_RESTART: Final = (0x5220, *range(0x5500, 0x5600), 0x6010)

COASTING_FAULTS: Final = frozenset(_COASTING)
"""EMCY codes after which there is no torque to brake with."""
RESTART_FAULTS: Final = frozenset(_RESTART)
"""EMCY codes that only a restart of the drive clears."""


def fault_rule(code: int) -> FaultRule:
    """Return the rule of an EMCY code 1..FFFFh, known or not."""
    return FaultRule(
        code=code,
        text=emcy_text(code),
        register=register_bits(code),
        reaction=Reaction.COAST if code in COASTING_FAULTS else Reaction.OPTION,
        reset=Reset.RESTART if code in RESTART_FAULTS else Reset.EDGE,
    )


RULES: Final[dict[int, FaultRule]] = {code: fault_rule(code) for code in EMCY_TEXTS if code}
"""Rule of every code that has a text."""
