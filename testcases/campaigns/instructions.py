"""Every instruction at the wrong moment: over every other job, in every state of the axis, with inputs at and
beyond their limits; and its outputs in every call.
"""

from __future__ import annotations

from typing import Final

from hil.campaign import Campaign
from testcases.campaigns import _instruction_inputs, _instruction_overriding, _instruction_states
from testcases.campaigns._instruction_makes import OF_1500, OF_G2, SPEED_AXIS

CAMPAIGN: Final = Campaign("instructions", tags=("axis", "instructions"), bench="reference")

for _part in (_instruction_overriding, _instruction_states, _instruction_inputs):
    for _case in _part.CASES.cases:
        CAMPAIGN.add(_case)

__all__ = ["CAMPAIGN", "OF_1500", "OF_G2", "SPEED_AXIS"]
