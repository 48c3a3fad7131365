"""Enabling that is disturbed, and stops into which somebody interferes; the same cases on drives of either
profile.
"""

from __future__ import annotations

from typing import Final

from hil.campaign import Campaign
from testcases.campaigns import _axis_enabling, _axis_stopping

CAMPAIGN: Final = Campaign("axis faults", tags=("fault", "axis"), bench="reference")

for _part in (_axis_enabling, _axis_stopping):
    for _case in _part.CASES.cases:
        CAMPAIGN.add(_case)
