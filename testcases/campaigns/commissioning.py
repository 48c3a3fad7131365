"""Commissioning by hand: sessions at the control panel, the life sign, and faults under the hands of an
operator; on drives of either profile.
"""

from __future__ import annotations

from typing import Final

from hil.campaign import Campaign
from testcases.campaigns import _commissioning_faults, _commissioning_session

CAMPAIGN: Final = Campaign("commissioning", tags=("panel",), bench="reference")

for _part in (_commissioning_session, _commissioning_faults):
    for _case in _part.CASES.cases:
        CAMPAIGN.add(_case)
