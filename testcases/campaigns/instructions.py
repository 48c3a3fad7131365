"""Every instruction at the wrong moment: over every other job, in every state of the axis, with inputs at and
beyond their limits; and its outputs in every call.
"""

from __future__ import annotations

from typing import Final

from hil.campaign import Campaign
from testcases.campaigns import _instruction_inputs, _instruction_overriding, _instruction_states

CAMPAIGN: Final = Campaign("instructions", tags=("axis", "instructions"), bench="reference")

for _part in (_instruction_overriding, _instruction_states, _instruction_inputs):
    for _case in _part.CASES.cases:
        CAMPAIGN.add(_case)
