"""State words of CiA 402, from the profile's own masks: the oracle does not ask the product."""

from __future__ import annotations

import re
from collections.abc import Collection, Mapping
from functools import lru_cache
from typing import Final

import numpy as np
from numpy.typing import NDArray

from hil.record import Signal

STATUS_PATTERNS: Final = (
    ("operation_enabled", 0x6F, 0x27),
    ("switched_on", 0x6F, 0x23),
    ("ready_to_switch_on", 0x6F, 0x21),
    ("quick_stop_active", 0x6F, 0x07),
    ("fault_reaction_active", 0x4F, 0x0F),
    ("fault", 0x4F, 0x08),
    ("switch_on_disabled", 0x4F, 0x40),
    ("not_ready_to_switch_on", 0x4F, 0x00),
)
"""State, mask and value of the statusword 6041h."""


def cia402_state(statusword: int) -> str:
    """Return the state that a statusword shows, as `operation_enabled`; empty when it shows none."""
    for state, mask, value in STATUS_PATTERNS:
        if statusword & mask == value:
            return state
    return ""


def has_torque(statuswords: NDArray[np.int64]) -> NDArray[np.bool_]:
    """Return where a statusword shows a state in which the drive may give torque."""
    six, four = statuswords & 0x6F, statuswords & 0x4F
    result: NDArray[np.bool_] = (six == 0x27) | (six == 0x07) | (four == 0x0F)
    return result


@lru_cache(maxsize=1024)
def normal_state(text: str) -> str:
    """Return a state text in one spelling: `Operation enabled`,
    `OPERATION_ENABLED` become `operation_enabled`.
    """
    text = re.sub(r"(?<=[a-z])(?=[A-Z])", "_", text.strip())
    return re.sub(r"[^a-z0-9]+", "_", text.lower()).strip("_")


def state_codes(enum: Mapping[int, str], states: Collection[str]) -> list[int]:
    """Return the numbers of some states of a signal, in the spelling of `normal_state`."""
    return [code for code, text in enum.items() if normal_state(text) in states]


def where_code(numbers: NDArray[np.float64], codes: Collection[int]) -> NDArray[np.bool_]:
    """Return the samples that have one of some numbers: what `numpy.isin` says, for a few of them in a tenth
    of its time.
    """
    found = np.zeros(len(numbers), dtype=bool)
    for code in codes:
        found |= numbers == code
    return found


def in_states(signal: Signal, states: Collection[str]) -> NDArray[np.bool_]:
    """Return the samples of a state signal in some states, in the spelling of `normal_state`."""
    return where_code(np.rint(signal.values), state_codes(signal.enum, states))


def word_samples(
    signal: Signal, since_s: float, until_s: float
) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Return times and words: the one in effect at `since_s`, if any, then those up to `until_s`; what is no
    number is left out.
    """
    part = signal.between(since_s, until_s)
    values, times = part.values, part.time_s
    if len(signal) and signal.time_s[0] <= since_s:
        values, times = np.concatenate(([signal.at(since_s)], values)), np.concatenate(([since_s], times))
    known = ~np.isnan(values)
    return times[known], values[known].astype(np.int64)
