"""Setpoints from the user program: vectors that are followed, wrong or overridden, and faults under them; on
drives of either profile.
"""

from __future__ import annotations

from typing import Final

from hil.campaign import Campaign
from testcases.campaigns import (
    _motion_in_ends,
    _motion_in_faults,
    _motion_in_overriding,
    _motion_in_program,
    _motion_in_superimposed,
    _motion_in_vectors,
)

CAMPAIGN: Final = Campaign("motion in", tags=("motion-in",), bench="reference")

for _part in (
    _motion_in_vectors,
    _motion_in_ends,
    _motion_in_overriding,
    _motion_in_superimposed,
    _motion_in_faults,
    _motion_in_program,
):
    for _case in _part.CASES.cases:
        CAMPAIGN.add(_case)
