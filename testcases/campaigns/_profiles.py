"""What an axis has in common behind every profile, and how each profile calls it: cases name the left side
only.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Final, TypeVar

from hil.campaign import CaseContext
from hil.errors import BlockedError
from hil.record import EventSelector, event
from testcases.campaigns.support import drive_name

T = TypeVar("T")

STATES: Final[Mapping[str, Mapping[str, str]]] = {
    "operating": {"cia402": "Operation enabled", "profidrive": "S4 operation"},
    "switched off": {"cia402": "Switch on disabled", "profidrive": "S1 switching on inhibited"},
    "off after a fault": {"cia402": "Fault", "profidrive": "S1 switching on inhibited"},
    "quick stop": {"cia402": "Quick stop active", "profidrive": "S5 quick stop"},
}
"""What a drive is doing -> the name of that state in its profile."""


def profile_of(ctx: CaseContext) -> str:
    """Return the profile of the drive under test: `cia402` or `profidrive`."""
    return str(ctx.bench.config.drive[drive_name(ctx)].profile)


def by_profile(ctx: CaseContext, *, cia402: T, profidrive: T) -> T:
    """Return what applies to the profile of the drive under test."""
    return profidrive if profile_of(ctx) == "profidrive" else cia402


def of_profile(ctx: CaseContext, values: Mapping[str, T]) -> T:
    """Return what applies to the profile of the drive under test, by its name.

    Raises:
        BlockedError: There is nothing for that profile.

    """
    profile = profile_of(ctx)
    if profile not in values:
        raise BlockedError(
            f"the case needs a drive with profile {' or '.join(values)}; {drive_name(ctx)} has {profile}"
        )
    return values[profile]


def enters(ctx: CaseContext, what: str) -> EventSelector:
    """Select the instant at which the drive begins something, one of `STATES`."""
    return event("drive.state", drive_name(ctx), to=of_profile(ctx, STATES[what]))


def warns_of_mains(ctx: CaseContext) -> EventSelector:
    """Select the warning of missing mains: a text of the CiA 402 drive, a number of the PROFIdrive axis."""
    reported: dict[str, Any] = by_profile(
        ctx, cia402={"text": "mains missing"}, profidrive={"warnings": "7840"}
    )
    return event("drive.warning", drive_name(ctx), **reported)


def encoder_increments_per_revolution(ctx: CaseContext) -> int:
    """Return the steps that the fault kinds of the encoder count in, of one revolution: fine resolution
    included.
    """
    section = ctx.bench.config.drive[drive_name(ctx)]
    fine = section.profidrive.fine_resolution_bits if section.profile == "profidrive" else 0
    return int(section.increments_per_revolution) << int(fine)
