"""Travel limits: hardware and software limit switches, met in every way, wired wrongly, and left again; on
drives of either profile.
"""

from __future__ import annotations

from typing import Final

from hil.campaign import Campaign
from testcases.campaigns import _limits_hardware, _limits_software, _limits_wiring

CAMPAIGN: Final = Campaign("limits", tags=("limits",), bench="reference")
CAMPAIGN.says_of("nc", "testcases.campaigns._nc_limits:LIMITS")

for _part in (_limits_hardware, _limits_wiring, _limits_software):
    for _case in _part.CASES.cases:
        CAMPAIGN.add(_case)
