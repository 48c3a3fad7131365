"""Faults of the words between a drive's profile and the bus that carries them, and what axis and drive make
of them.

For drives led by a PROFIdrive telegram with encoder values and sign of life, on any transport.
"""

from __future__ import annotations

from typing import Final

from hil.campaign import Campaign
from testcases.campaigns import _telegram_actual, _telegram_setpoint

CAMPAIGN: Final = Campaign("telegram faults", tags=("fault", "telegram"), bench="profidrive")
CAMPAIGN.says_of("nc", "testcases.campaigns._nc_faults:TELEGRAM_FAULTS")

for _part in (_telegram_actual, _telegram_setpoint):
    for _case in _part.CASES.cases:
        CAMPAIGN.add(_case)
