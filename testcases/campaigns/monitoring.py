"""Monitoring of a positioning axis: window and times, following error, standstill, fixed stop, under faults;
on drives of either profile.
"""

from __future__ import annotations

from typing import Final

from hil.campaign import Campaign
from testcases.campaigns import (
    _monitoring_faults,
    _monitoring_following,
    _monitoring_positioning,
    _monitoring_standstill,
)

CAMPAIGN: Final = Campaign("monitoring", tags=("monitoring",), bench="reference")
CAMPAIGN.says_of("nc", "testcases.campaigns._nc_monitoring:MONITORING")

for _part in (_monitoring_positioning, _monitoring_following, _monitoring_faults, _monitoring_standstill):
    for _case in _part.CASES.cases:
        CAMPAIGN.add(_case)
