"""Faults of bus, drive, encoder, switches, mechanics and controller, and what the axis makes of them,
whatever the profile of its drive.
"""

from __future__ import annotations

from typing import Final

from hil.campaign import Campaign
from testcases.campaigns import (
    _reactions_bus,
    _reactions_controller,
    _reactions_drive,
    _reactions_machine,
    _reactions_precedence,
)

CAMPAIGN: Final = Campaign("fault reactions", tags=("fault",), bench="reference")
CAMPAIGN.says_of("nc", "testcases.campaigns._nc_faults:FAULT_REACTIONS")

for _part in (
    _reactions_drive,
    _reactions_bus,
    _reactions_machine,
    _reactions_controller,
    _reactions_precedence,
):
    for _case in _part.CASES.cases:
        CAMPAIGN.add(_case)
