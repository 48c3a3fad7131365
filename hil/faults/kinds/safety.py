"""Safety functions that are selected at a PROFIdrive axis (CFG-443 to CFG-498)."""

from __future__ import annotations

from functools import partial
from typing import Final

from hil.faults import seams
from hil.faults._kind import Family, FaultType, Held, Once, toggled
from hil.faults._parameters import Environment, Parameter

# -- kinds -----------------------------------------------------------------------------------------------

_REFUSED: Final[dict[Environment, str]] = {
    "hardware": "a physical drive has no seam for this; it would need a safety controller on its inputs"
}
_REMARK: Final = "a PROFIdrive axis only; the bench file sets it up: [drive.NAME.safety]"
_kind: Final = partial(FaultType, seam="drive internals", target="drive", refused=_REFUSED, remark=_REMARK)

FAMILY: Final = Family(
    kinds=(
        _kind(
            "safety.ss2",
            "Safe stop 2 is selected: quick stop, then monitored standstill under control",
            toggled(seams.HasSafeStop2, lambda drive, active: drive.set_ss2(active)),
            example={"target": "drive1", "duration_s": 1.0},
            text="""
            Safe stop 2 is selected at a PROFIdrive axis: it brakes on the OFF3 ramp by itself, then the
            standstill is monitored while the drive stays in operation. Setpoints act again at the end.
            With `ss2_external` it does not brake (SS2E). The kinds `safety.*` are set up in
            `[drive.NAME.safety]`; what is violated stops the drive by itself and leaves a safety message.
            """,
        ),
        _kind(
            "safety.sos",
            "Safe operating stop is selected: the standstill is monitored after a delay",
            toggled(seams.HasSafeOperatingStop, lambda drive, active: drive.set_sos(active)),
            example={"target": "drive1", "duration_s": 1.0},
            text="""
            Safe operating stop is selected: nothing brakes, but after a delay the load has to stand.
            """,
        ),
        _kind(
            "safety.sbc",
            "Safe brake control is selected: torque off, and the brake closes",
            toggled(seams.HasSafeBrakeControl, lambda drive, active: drive.set_sbc(active)),
            example={"target": "drive1", "duration_s": 1.0},
            text="""
            Safe brake control is selected: torque off, and the brake closes whatever STW1 bit 12 says.
            """,
        ),
        _kind(
            "safety.sls",
            "Safely limited speed is selected: the drive stops by itself above the limit",
            Held(
                seams.HasSafelyLimitedSpeed,
                lambda drive, p: drive.set_sls(p.integer("level")),
                lambda drive, _: drive.set_sls(None),
            ),
            parameters=(Parameter("level", "int", "Level with its limit", minimum=1, maximum=4, default=1),),
            example={"target": "drive1", "duration_s": 2.0, "parameters": {"level": 1}},
            text="""
            Safely limited speed is selected: above the limit of the level the drive stops by itself after
            the delay.
            """,
        ),
        _kind(
            "safety.sdi",
            "Safe direction is selected: the drive stops by itself when the load moves the other way",
            Held(
                seams.HasSafeDirection,
                lambda drive, p: drive.set_sdi(1 if p.text("direction") == "positive" else -1),
                lambda drive, _: drive.set_sdi(None),
            ),
            parameters=(
                Parameter(
                    "direction",
                    "text",
                    "Permitted direction",
                    required=True,
                    choices=("positive", "negative"),
                ),
            ),
            example={"target": "drive1", "duration_s": 2.0, "parameters": {"direction": "positive"}},
        ),
        _kind(
            "safety.slp",
            "Safely limited position is selected: the drive stops by itself outside of the range",
            Held(
                seams.HasSafelyLimitedPosition,
                lambda drive, p: drive.set_slp(p.integer("range")),
                lambda drive, _: drive.set_slp(None),
            ),
            parameters=(Parameter("range", "int", "Range in force", minimum=1, maximum=2, default=1),),
            example={"target": "drive1", "duration_s": 2.0, "parameters": {"range": 1}},
            text="""
            Safely limited position is selected: the drive stops by itself outside of the range
            (`slp_ranges_mm`).
            """,
        ),
        _kind(
            "safety.acknowledge",
            "The safety messages of the drive are acknowledged safely",
            Once(seams.AcknowledgesSafety, lambda drive, _: drive.acknowledge_safety()),
            lasting=False,
            example={"target": "drive1"},
        ),
    ),
)
