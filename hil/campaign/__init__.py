"""Campaigns: cases as functions, found in files and modules, run with evidence, replayed by token.

Example::

    CAMPAIGN = Campaign("stop modes")

    @CAMPAIGN.product("mc-power-{mode}", parameters={"mode": [0, 1, 2]}, title="MC_Power, StopMode {mode}")
    def stop(ctx, mode):
        ...

"""

from __future__ import annotations

from hil.campaign._benches import load_bench_file
from hil.campaign._case import Campaign, Case
from hil.campaign._context import CaseContext
from hil.campaign._controllers import Counterpart, NotApplicable
from hil.campaign._discover import Found, Selected, find_campaigns, load_campaign, select_cases
from hil.campaign._execute import CaseSettings, Execution, execute_case, requirements_here
from hil.campaign._files import write_candump, write_evidence
from hil.campaign._runner import Runner, RunOptions, case_seed, environment_facts
from hil.campaign._shipped import SHIPPED, ShippedCampaign
from hil.campaign._token import Token

__all__ = [
    "SHIPPED",
    "Campaign",
    "Case",
    "CaseContext",
    "CaseSettings",
    "Counterpart",
    "Execution",
    "Found",
    "NotApplicable",
    "RunOptions",
    "Runner",
    "Selected",
    "ShippedCampaign",
    "Token",
    "case_seed",
    "environment_facts",
    "execute_case",
    "find_campaigns",
    "load_bench_file",
    "load_campaign",
    "requirements_here",
    "select_cases",
    "write_candump",
    "write_evidence",
]
