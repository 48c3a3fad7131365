"""`[drive.NAME.safety]` of a bench file: safety functions of the emulated drive."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Final, Literal

from pydantic import Field, model_validator

from hil.bench._drive_sections import Finite, NotNegative, Positive, Section, Time_ms, _checked

if TYPE_CHECKING:
    from emulators.drive.machine import SafetyConfig
    from emulators.drive.profidrive.safety.config import SafeMotionConfig

Reaction = Literal["sto", "ss1", "ss2"]
SafeTime_ms = Annotated[float, Field(ge=1.0, le=600_000.0)]

_OF_ANY_DRIVE: Final = frozenset({"sto", "ss1_time_ms", "ss1_monitored", "interlock"})


class SafetySection(Section):
    """`[drive.NAME.safety]`: safety functions of the drive; those beyond the first four belong to a
    PROFIdrive axis.
    """

    sto: Literal["inhibit", "fault"] = "inhibit"
    ss1_time_ms: SafeTime_ms = 500.0
    ss1_monitored: bool = True
    interlock: Literal["none", "inhibit", "quick_stop", "fault"] = "none"
    ss1_external: bool = False
    """Safe stop 1 leaves the braking to the controller (SS1E)."""
    ss2_time_ms: SafeTime_ms = 500.0
    ss2_monitored: bool = True
    ss2_external: bool = False
    """Safe stop 2 leaves the braking to the controller (SS2E)."""
    sos_delay_ms: Time_ms = 100.0
    sos_tolerance_mm: Positive = 1.0
    sls_limits_mm_s: Annotated[tuple[Positive, ...], Field(min_length=1, max_length=4)] = (250.0,)
    """Limits of levels 1 to 4 (p9531), mm/s of the load."""
    sls_factor_percent: Annotated[float, Field(gt=0.0, le=100.0)] = 80.0
    """Share of the limit that S_V_LIMIT_B shows (p9533)."""
    sls_delay_ms: Time_ms = 100.0
    sls_reaction: Reaction = "ss1"
    sdi_tolerance_mm: Positive = 1.0
    sdi_delay_ms: Time_ms = 100.0
    sdi_reaction: Reaction = "ss1"
    slp_ranges_mm: Annotated[tuple[tuple[Finite, Finite], ...], Field(max_length=2)] = ()
    """Ranges 1 and 2 of safely limited position, mm of the load."""
    slp_delay_ms: Time_ms = 100.0
    slp_reaction: Reaction = "ss1"
    sbt_torque_nm: NotNegative = 0.0
    """Safe brake test: torque with which the drive pulls at the closed brake; 0 = not configured."""
    sbt_time_ms: SafeTime_ms = 500.0
    sbt_tolerance_mm: Positive = 1.0
    sbc: bool = True
    """With safe torque off the brake closes whatever STW1 bit 12 says."""

    @model_validator(mode="after")
    def _fits(self) -> SafetySection:
        if self.model_fields_set:
            _checked(self.build_motion)
        return self

    @property
    def beyond(self) -> str | None:
        """The first key with another value than its default that belongs to a PROFIdrive axis alone."""
        for name, info in type(self).model_fields.items():
            if name not in _OF_ANY_DRIVE and getattr(self, name) != info.default:
                return name
        return None

    def build(self) -> SafetyConfig:
        """Return the configuration of what every drive has."""
        from emulators.drive.machine import SafetyConfig

        return SafetyConfig(
            sto=self.sto,
            ss1_time_s=self.ss1_time_ms / 1000.0,
            ss1_monitored=self.ss1_monitored,
            interlock=self.interlock,
        )

    def build_motion(self) -> SafeMotionConfig:
        """Return the configuration of the functions of a PROFIdrive axis."""
        from emulators.drive.profidrive.safety.config import SafeMotionConfig

        return SafeMotionConfig(
            ss1_external=self.ss1_external,
            ss2_time_s=self.ss2_time_ms / 1000.0,
            ss2_monitored=self.ss2_monitored,
            ss2_external=self.ss2_external,
            sos_delay_s=self.sos_delay_ms / 1000.0,
            sos_tolerance=self.sos_tolerance_mm / 1000.0,
            sls_limits=tuple(limit / 1000.0 for limit in self.sls_limits_mm_s),
            sls_factor=self.sls_factor_percent / 100.0,
            sls_delay_s=self.sls_delay_ms / 1000.0,
            sls_reaction=self.sls_reaction,
            sdi_tolerance=self.sdi_tolerance_mm / 1000.0,
            sdi_delay_s=self.sdi_delay_ms / 1000.0,
            sdi_reaction=self.sdi_reaction,
            slp_ranges=tuple((low / 1000.0, high / 1000.0) for low, high in self.slp_ranges_mm),
            slp_delay_s=self.slp_delay_ms / 1000.0,
            slp_reaction=self.slp_reaction,
            sbt_torque_Nm=self.sbt_torque_nm,
            sbt_time_s=self.sbt_time_ms / 1000.0,
            sbt_tolerance=self.sbt_tolerance_mm / 1000.0,
            sbc=self.sbc,
        )
