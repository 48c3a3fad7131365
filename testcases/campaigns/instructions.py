"""Every instruction at the wrong moment: over every other job, in every state of the axis, with inputs at and
beyond their limits; and its outputs in every call.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Final

from hil.campaign import Campaign
from hil.configurations.needs import Needs
from testcases.campaigns import _instruction_inputs, _instruction_overriding, _instruction_states

CAMPAIGN: Final = Campaign("instructions", tags=("axis", "instructions"), bench="reference")
NEEDS: Final = {
    "cpu": "S7-1500T",
    "encoder": "incremental",
    "software-limits": "off",
    "motion": ("linear", "rotary"),
    "neighbours": "none",
    "load": "not heavy",
}
"""Of every case: all instructions, an encoder whose homing ends with a restart, and ways without an end."""

for _part in (_instruction_overriding, _instruction_states, _instruction_inputs):
    for _case in _part.CASES.cases:
        CAMPAIGN.add(replace(_case, needs=_case.needs & Needs.of(NEEDS)))
