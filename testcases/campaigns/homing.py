"""Homing: every mode from every side, and what goes wrong on the way; the same cases on drives of either
profile.
"""

from __future__ import annotations

from typing import Final

from hil.campaign import Campaign
from testcases.campaigns import _homing_faults, _homing_marks, _homing_passive

CAMPAIGN: Final = Campaign("homing", tags=("homing",), bench="profidrive")
CAMPAIGN.says_of("nc", "testcases.campaigns._nc_homing:HOMING_CASES")

for _part in (_homing_marks, _homing_faults, _homing_passive):
    for _case in _part.CASES.cases:
        CAMPAIGN.add(_case)
