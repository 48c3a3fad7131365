"""The control loop of a positioning axis: gain, precontrol, balancing, filters, switching on and off, in the
controller and in the drive.
"""

from __future__ import annotations

from typing import Final

from hil.campaign import Campaign
from testcases.campaigns import _control_faults, _control_switching, _control_travel

CAMPAIGN: Final = Campaign("control", tags=("control",), bench="profidrive")

for _part in (_control_travel, _control_switching, _control_faults):
    for _case in _part.CASES.cases:
        CAMPAIGN.add(_case)
