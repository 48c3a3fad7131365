"""Hypothesis strategies for faults of telegram words: OFF1 to OFF3 that nobody gave,
bits that lie, silence, delay.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

from hypothesis import strategies as st
from hypothesis.strategies import SearchStrategy

from hil.faults import Fault
from hil.fuzz._program import Break, Step

if TYPE_CHECKING:
    from fieldbus.history import Scalar

_COMMANDS: Final = tuple(f"STW1.{bit}" for bit in (0, 1, 2, 3, 4, 5, 6, 8, 9))
"""ON, OFF2, OFF3, enable operation, the ramp generator, jog: what the drive hears wrongly."""
_STATES: Final = tuple(f"ZSW1.{bit}" for bit in (0, 1, 2, 3, 5, 6, 7, 9))
"""Bits of the state machine, fault, warning, control requested: what the axis hears wrongly."""
_ENCODER: Final = ("G1_ZSW.15", "G1_ZSW.14", "G1_ZSW.11")
_DIRECTIONS: Final = ("actual", "setpoint")

_way = st.sampled_from(_DIRECTIONS)
_KNOWN: Final[dict[str, SearchStrategy[dict[str, Scalar]]]] = {
    "telegram.flip": st.fixed_dictionaries({"signal": st.sampled_from((*_COMMANDS, *_STATES, *_ENCODER))}),
    "telegram.stuck": st.one_of(
        st.fixed_dictionaries(
            {"signal": st.sampled_from((*_COMMANDS, "STW1.7", *_STATES)), "value": st.integers(0, 1)}
        ),
        st.fixed_dictionaries({"signal": st.sampled_from(("NSOLL_B", "STW1", "ZSW1"))}),
    ),
    "telegram.scale": st.fixed_dictionaries(
        {"signal": st.just("NSOLL_B"), "factor": st.sampled_from((0.0, 0.5, 0.9, 1.1))}
    ),
    "telegram.freeze": st.fixed_dictionaries(
        {"direction": _way, "sign_of_life": st.sampled_from(("stands", "counts"))}
    ),
    "telegram.late": st.fixed_dictionaries({"direction": _way, "cycles": st.integers(1, 6)}),
    "telegram.lost": st.fixed_dictionaries({"direction": _way}),
    "telegram.length": st.fixed_dictionaries({"direction": _way, "words": st.integers(-12, 4).filter(bool)}),
    "telegram.sign_of_life": st.fixed_dictionaries(
        {"direction": _way, "how": st.sampled_from(("freeze", "jump", "zero"))}
    ),
    "telegram.control_lost": st.fixed_dictionaries({"direction": _way}),
}
TELEGRAM_KINDS: Final = tuple(_KNOWN)
"""Kinds that a search draws. The others displace what the axis measures, or say what a flip says too."""


def telegram_fault(kind: str) -> SearchStrategy[Step]:
    """Return steps with a fault of this kind: so many telegrams, or so long, whatever ends first."""
    return st.builds(
        lambda values, count, tenths: Break(
            Fault(kind, count=count, duration_s=round(tenths * 0.02, 6), parameters=values)
        ),
        _KNOWN[kind],
        st.one_of(st.none(), st.integers(1, 40)),
        st.integers(1, 25),
    )
