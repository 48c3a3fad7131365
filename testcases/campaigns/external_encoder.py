"""External encoders over PROFIdrive telegrams and CiA 406: their values, homing, alarms and faults, next to a
drive of either profile.
"""

from __future__ import annotations

from typing import Final

from hil.campaign import Campaign
from testcases.campaigns import (
    _external_encoder_faults,
    _external_encoder_marks,
    _external_encoder_values,
)
from testcases.campaigns._external_encoder import bench_with_encoders

REFERENCE: Final = bench_with_encoders("reference")
PROFIDRIVE: Final = bench_with_encoders("profidrive")

CAMPAIGN: Final = Campaign(
    "external encoder", tags=("encoder",), bench="testcases.campaigns.external_encoder:REFERENCE"
)

for _part in (_external_encoder_values, _external_encoder_marks, _external_encoder_faults):
    for _case in _part.CASES.cases:
        CAMPAIGN.add(_case)
