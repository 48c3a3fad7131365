"""`[encoder.NAME]` of a bench file: one model per profile and kind of measurement,
each of which builds its encoder.
"""

from __future__ import annotations

import math
from abc import abstractmethod
from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Final, Literal

from annotated_types import Unit
from pydantic import Discriminator, Field, Tag, WrapValidator, model_validator

from emulators.encoder.coupling import Coupling, gear_ratio, linear_coupling, rotary_coupling, scale_periods
from emulators.encoder.profidrive.format import FineBits, fitted_format
from fieldbus.node_clock import NodeClock
from hil.bench._table import Finite, NodeId, NotNegative, Positive, Table, refused_by_part

if TYPE_CHECKING:
    import canopen

    from emulators.encoder import Mounting
    from emulators.encoder.cia406 import CiA406Encoder, EncoderDeviceConfig
    from emulators.encoder.profidrive import EncoderFormat
    from emulators.encoder.profidrive.can import ProfidriveCanEncoder, ProfidriveEncoderNodeConfig
    from emulators.mechanics import DrivenShaft
    from fieldbus.clock import Scheduler
    from hil.bench._site import DeviceSite

_RPM: Final = 2.0 * math.pi / 60.0
_SENSOR_SHARE: Final = 0.25
"""The second sensor of a multi-sensor device sits a quarter of the scale behind the first."""
LINEAR: Final = (
    "incremental_linear",
    "incremental_linear_counting",
    "absolute_linear",
    "cyclic_linear",
    "multi_sensor",
)
"""Types that measure a length."""


class EncoderTelegramTable(Table):
    """`[encoder.NAME.profidrive]`: the telegram of a PROFIdrive encoder, and how its values are formed."""

    telegram: Literal[81, 82, 83, 84] = 81
    """82 and 83 bring the speed too, 84 the speed and a counter of 64 bits."""
    sign_of_life: bool = True
    """It works isochronously: both sides watch the counter of the other."""
    sign_of_life_tolerance: Annotated[int, Field(ge=0, le=65_535)] = 1
    """Failures that the emulated encoder tolerates (PNU 925); 65535 = not monitored."""
    fine_xist1_bits: FineBits | None = None
    """Fine resolution of G1_XIST1 (P979[3]); none: 11, or as many as fit."""
    fine_xist2_bits: FineBits | None = None
    """Fine resolution of G1_XIST2 (P979[4]); none: 9, or as many as fit."""
    counter_bits: Annotated[int, Field(ge=8, le=32)] = 32
    """Width of G1_XIST1; a controller has to know of less than 32 (`BehaviorGx_XIST1` = 0)."""
    reference_speed: Annotated[Positive, Unit("rpm or mm/s")] = 3000.0
    """What 4000h (4000 0000h) of the speed stands for."""
    zero_mark: Annotated[int, Field(ge=0), Unit("inc")] = 0
    """Place of the zero mark, increments of G1_XIST1."""


class _ShaftTable(Table):
    """What the shaft or slide of an encoder of its own has."""

    profile: Annotated[tuple[tuple[NotNegative, Finite], ...], Unit("s; rpm or mm/s")] | None = None
    """Duration and speed at its end, one after the other, with linear changes; instead of a constant speed.
    """
    repeat: bool = False
    """The profile begins again at its end."""

    @model_validator(mode="after")
    def _one_motion(self) -> _ShaftTable:
        if self.profile is not None and self.constant_speed:
            raise ValueError("profile: give either a profile or a constant speed")
        if self.repeat and not sum(duration for duration, _ in self.profile or ()):
            raise ValueError("repeat: true needs a profile that takes some time")
        return self

    @property
    @abstractmethod
    def constant_speed(self) -> float:
        """Constant speed, rpm or mm/s."""

    def build(self, scheduler: Scheduler, scale: float) -> DrivenShaft:
        """Return the shaft in motion.

        Args:
            scheduler: Time of the bench.
            scale: rad/s or m/s per unit of the speeds.

        """
        from emulators.mechanics import DrivenShaft

        shaft = DrivenShaft(scheduler)
        if self.profile is not None:
            shaft.follow([(time_s, speed * scale) for time_s, speed in self.profile], repeat=self.repeat)
        else:
            shaft.turn(scale * self.constant_speed)
        return shaft


class ShaftTable(_ShaftTable):
    """`[encoder.NAME.shaft]`: how the shaft of a rotary encoder turns; a test may move it otherwise."""

    label: ClassVar[str] = "the shaft of a rotary encoder"

    speed_rpm: Finite = 0.0
    """Constant speed of a shaft."""

    @property
    def constant_speed(self) -> float:
        """Constant speed, rpm."""
        return self.speed_rpm


class SlideTable(_ShaftTable):
    """`[encoder.NAME.shaft]`: how the slide of a linear encoder moves; a test may move it otherwise."""

    label: ClassVar[str] = "the slide of a linear encoder"

    speed_mm_s: Finite = 0.0
    """Constant speed of a linear encoder's slide."""

    @property
    def constant_speed(self) -> float:
        """Constant speed, mm/s."""
        return self.speed_mm_s


class _EncoderTable(Table):
    """What an encoder of any profile and kind has."""

    linear: ClassVar[bool]

    profile: Literal["cia406", "profidrive"] = "cia406"
    """Profile of the encoder; with `profidrive` the types `single_turn`, `multi_turn`, `incremental_rotary`,
    `incremental_linear` and `absolute_linear`.
    """
    device: Literal["emulated", "physical"] = "emulated"
    """`physical`: it is on the bus, the bench does not bring it; only with `kind = "live"`."""
    segment: str
    """Name of the segment to which it is connected."""
    node_id: NodeId
    """CANopen node-ID, each once per segment, drives included."""
    type: str
    """Device type (1000h); the second sensor of `multi_sensor` sits a quarter of the scale behind the first.
    """
    on: str | None = None
    """Machine that it sits on; none: a shaft of its own; the name of a drive."""
    mounting: Literal["motor", "load"] = "motor"
    """The motor shaft, or the load behind gear and screw; a linear encoder needs `load`."""
    gear_numerator: Annotated[int, Field(ge=1)] = 1
    """Revolutions of the encoder ..."""
    gear_denominator: Annotated[int, Field(ge=1)] = 1
    """... per so many revolutions of the shaft."""
    reversed: bool = False
    """Mounted the other way round."""
    heartbeat_ms: Annotated[int, Field(ge=0, le=60000)] = 100
    """Heartbeat of the encoder; 0 = none. That of a physical one is what it was set to: with 0 here the
    bench does not wait for it.
    """

    @property
    @abstractmethod
    def motion(self) -> _ShaftTable:
        """How its own shaft or slide moves."""

    @abstractmethod
    def coupling(self, lead_mm: float | None) -> Coupling:
        """Return how it is coupled to a machine or shaft.

        Args:
            lead_mm: Lead of the screw for a rotary encoder at the load; None: at a motor shaft or a
                shaft of its own.

        """

    @abstractmethod
    def build(
        self, site: DeviceSite, drives: Mapping[str, Any], lead_mm: float | None
    ) -> CiA406Encoder | ProfidriveCanEncoder:
        """Return the emulated encoder, still switched off, on the machine of a drive or a shaft of its own.

        Args:
            site: Where it works.
            drives: Emulated drives by name.
            lead_mm: Lead of the screw of the drive that it sits on, mm; None: it sits on none.

        """

    @abstractmethod
    def dictionary(self) -> canopen.ObjectDictionary:
        """Return the object dictionary, shared and read-only."""

    @abstractmethod
    def check_values(self) -> None:
        """Check that resolution and range fit together.

        Raises:
            ConfigurationError: They do not.

        """

    @model_validator(mode="after")
    def _place_fits(self) -> _EncoderTable:
        if self.on is None and "mounting" in self.model_fields_set:
            raise ValueError(f"mounting: {self.mounting!r} needs the drive (`on`) that it sits on")
        if self.on is not None and "shaft" in self.model_fields_set:
            raise ValueError(f"shaft: the encoder sits on {self.on} and has no shaft of its own")
        if self.device == "emulated":
            self.check_values()
        return self

    @property
    def absolute(self) -> bool:
        """Whether it knows its place after switching on."""
        return "incremental" not in self.type

    @property
    def _ratio(self) -> float:
        return gear_ratio(self.gear_numerator, self.gear_denominator, reversed_direction=self.reversed)

    @property
    def speed_scale(self) -> float:
        """rad/s per rpm, or m/s per mm/s."""
        return 1.0 / 1000.0 if self.linear else _RPM

    def mounted(
        self, scheduler: Scheduler, drives: Mapping[str, Any], lead_mm: float | None
    ) -> tuple[Mounting, DrivenShaft | None]:
        """Return how the encoder follows a machine or its own shaft, and that shaft."""
        from emulators.encoder import Mounting

        at_load = self.on is not None and self.mounting == "load"
        ratio, offset, backlash = self.coupling(lead_mm if at_load else None)
        shaft: DrivenShaft | None = None
        source: Callable[[], float]
        if self.on is None:
            shaft = own = self.motion.build(scheduler, self.speed_scale)

            def source() -> float:
                return own.position
        else:
            mechanics = drives[self.on].mechanics
            if self.mounting == "motor":

                def source() -> float:
                    return float(mechanics.motor_angle)
            else:

                def source() -> float:
                    return float(mechanics.position)

        return Mounting(source, ratio=ratio, offset=offset, backlash=backlash), shaft

    def taken_over(self, prefix: str) -> dict[str, int | float]:
        """Return the variables that an axis takes over from the encoder, as an
        offline transfer does (CFG-356).
        """
        return {f"{prefix}.Type": int(self.absolute), f"{prefix}.Parameter.FineResolutionXist1": 0}


class _RotaryTable(_EncoderTable):
    """What a rotary encoder of any profile has."""

    linear: ClassVar[bool] = False

    steps_per_revolution: Annotated[int, Field(ge=4, le=2**31), Unit("steps/rev")] = 8192
    """Single-turn resolution (6501h)."""
    revolutions: Annotated[int, Field(ge=1, le=65535)] = 4096
    """Distinguishable revolutions (6502h); together at most 2147483648 steps."""
    mm_per_revolution: Positive | None = None
    """Travel of the load per revolution of a rotary encoder with `mounting =
    "load"`; none: the lead of the screw.
    """
    offset_deg: Finite = 0.0
    """Place of the encoder where the machine is at zero."""
    backlash_deg: NotNegative = 0.0
    """Play of the coupling of a rotary encoder."""
    shaft: ShaftTable = ShaftTable()

    @model_validator(mode="after")
    def _travel_at_load(self) -> _RotaryTable:
        if self.mm_per_revolution is not None and self.mounting != "load" and self.on is not None:
            raise ValueError('mm_per_revolution: only with mounting = "load"')
        return self

    @property
    def motion(self) -> ShaftTable:
        """How its own shaft turns."""
        return self.shaft

    @property
    def turns(self) -> int:
        """Revolutions that the PROFIdrive format tells apart; 0 = it is incremental."""
        return {"multi_turn": self.revolutions, "single_turn": 1}.get(self.type, 0)

    def coupling(self, lead_mm: float | None) -> Coupling:
        """Return how it is coupled to a machine or shaft.

        Args:
            lead_mm: Lead of the screw for an encoder at the load; None: at a motor shaft or a shaft of
                its own.

        """
        return rotary_coupling(
            self._ratio,
            offset_deg=self.offset_deg,
            backlash_deg=self.backlash_deg,
            mm_per_revolution=None if lead_mm is None else self.mm_per_revolution or lead_mm,
        )

    def taken_over(self, prefix: str) -> dict[str, int | float]:
        """Return the variables that an axis takes over from the encoder, as an
        offline transfer does (CFG-356).
        """
        values = super().taken_over(prefix)
        values[f"{prefix}.System"] = 1
        values[f"{prefix}.Parameter.StepsPerRevolution"] = self.steps_per_revolution
        values[f"{prefix}.Parameter.DeterminableRevolutions"] = 0
        if self.absolute:
            counts = self.type in ("multi_turn", "single_turn_counting")
            values[f"{prefix}.Parameter.DeterminableRevolutions"] = self.revolutions if counts else 1
        if self.on is not None:
            values[f"{prefix}.MountingMode"] = 0 if self.mounting == "motor" else 1
        return values


class _LinearTable(_EncoderTable):
    """What a linear encoder of any profile has."""

    linear: ClassVar[bool] = True

    measuring_step_um: Positive = 1.0
    """Measuring step of a linear encoder (6501h); distance of two lines of a PROFIdrive one (P979[2]); in
    steps of 0.001.
    """
    length_mm: Positive = 2000.0
    """Length of the scale, or period of a cyclic code."""
    offset_mm: Finite | None = None
    """Place on the scale where the machine is at zero; none: its middle."""
    backlash_mm: NotNegative = 0.0
    """Play of the coupling of a linear one."""
    shaft: SlideTable = SlideTable()

    @model_validator(mode="after")
    def _at_load(self) -> _LinearTable:
        if self.on is not None and self.mounting != "load":
            raise ValueError(
                f"mounting: {self.mounting!r} is not allowed; a linear encoder measures the load"
            )
        return self

    @property
    def motion(self) -> SlideTable:
        """How its own slide moves."""
        return self.shaft

    def coupling(self, lead_mm: float | None) -> Coupling:  # noqa: ARG002 - a scale measures the load itself
        """Return how it is coupled to a machine or slide.

        Args:
            lead_mm: Lead of the screw; without effect.

        """
        return linear_coupling(
            self._ratio, length_mm=self.length_mm, offset_mm=self.offset_mm, backlash_mm=self.backlash_mm
        )

    def taken_over(self, prefix: str) -> dict[str, int | float]:
        """Return the variables that an axis takes over from the encoder, as an
        offline transfer does (CFG-356).
        """
        values = super().taken_over(prefix)
        values[f"{prefix}.System"] = 0
        values[f"{prefix}.Parameter.Resolution"] = self.measuring_step_um / 1000.0
        values[f"{prefix}.MountingMode"] = 1
        return values


class _Cia406Table(_EncoderTable):
    """What a CiA 406 encoder of any kind has."""

    cyclic_timer_ms: Annotated[int, Field(ge=0, le=65535)] = 0
    """Period of TPDO1 (6200h, 1800h:5); 0: only at the start. TPDO2 comes with every SYNC."""

    @abstractmethod
    def config(self) -> EncoderDeviceConfig:
        """Return the configuration of the emulated encoder.

        Raises:
            ConfigurationError: Resolution and range do not fit together.

        """

    @property
    def _objects(self) -> dict[tuple[int, int], int]:
        return {(0x1800, 5): self.cyclic_timer_ms, (0x1017, 0): self.heartbeat_ms}

    def check_values(self) -> None:
        """Check that resolution and range fit together.

        Raises:
            ConfigurationError: They do not.

        """
        self.config()

    def dictionary(self) -> canopen.ObjectDictionary:
        """Return the object dictionary, shared and read-only."""
        return _cia406_dictionary(self.type)

    def build(
        self, site: DeviceSite, drives: Mapping[str, Any], lead_mm: float | None
    ) -> CiA406Encoder | ProfidriveCanEncoder:
        """Return the emulated encoder, still switched off, on the machine of a drive or a shaft of its own.

        Args:
            site: Where it works.
            drives: Emulated drives by name.
            lead_mm: Lead of the screw of the drive that it sits on, mm; None: it sits on none.

        """
        from emulators.encoder.cia406 import CiA406Encoder

        mounting, shaft = self.mounted(site.scheduler, drives, lead_mm)
        return CiA406Encoder(
            NodeClock(site.scheduler, lambda: site.rng.spawn(1)[0]),
            site.segments[self.segment],
            self.config(),
            mounting,
            name=site.name,
            history=site.history,
            rng=site.rng,
            shaft=shaft,
        )


class RotaryEncoderTable(_Cia406Table, _RotaryTable):
    """`[encoder.NAME]`: a rotary CiA 406 encoder."""

    label: ClassVar[str] = 'a rotary encoder with profile = "cia406"'

    profile: Literal["cia406"] = "cia406"
    """Profile of the encoder; with `profidrive` the types `single_turn`, `multi_turn`, `incremental_rotary`,
    `incremental_linear` and `absolute_linear`.
    """
    type: Literal[
        "single_turn",
        "multi_turn",
        "single_turn_counting",
        "incremental_rotary",
        "incremental_rotary_counting",
    ] = "multi_turn"
    """Device type (1000h); the second sensor of `multi_sensor` sits a quarter of the scale behind the first.
    """
    max_speed_rpm: Positive | None = None
    """Speed from which on it warns (6505h bit 0)."""

    def config(self) -> EncoderDeviceConfig:
        """Return the configuration of the emulated encoder.

        Raises:
            ConfigurationError: Resolution and range do not fit together.

        """
        from emulators.encoder.cia406 import EncoderDeviceConfig, EncoderType

        return EncoderDeviceConfig(
            node_id=self.node_id,
            kind=EncoderType[self.type.upper()],
            steps_per_revolution=self.steps_per_revolution,
            revolutions=self.revolutions,
            max_speed=None if self.max_speed_rpm is None else self.max_speed_rpm * _RPM,
            objects=self._objects,
        )


class LinearEncoderTable(_Cia406Table, _LinearTable):
    """`[encoder.NAME]`: a linear CiA 406 encoder."""

    label: ClassVar[str] = 'a linear encoder with profile = "cia406"'

    profile: Literal["cia406"] = "cia406"
    """Profile of the encoder; with `profidrive` the types `single_turn`, `multi_turn`, `incremental_rotary`,
    `incremental_linear` and `absolute_linear`.
    """
    type: Literal[
        "incremental_linear",
        "incremental_linear_counting",
        "absolute_linear",
        "cyclic_linear",
        "multi_sensor",
    ]
    """Device type (1000h); the second sensor of `multi_sensor` sits a quarter of the scale behind the first.
    """
    max_speed_mm_s: Positive | None = None
    """The same for a linear one."""

    def config(self) -> EncoderDeviceConfig:
        """Return the configuration of the emulated encoder.

        Raises:
            ConfigurationError: Resolution and range do not fit together.

        """
        from emulators.encoder.cia406 import EncoderDeviceConfig, EncoderType

        length_m = self.length_mm / 1000.0
        return EncoderDeviceConfig(
            node_id=self.node_id,
            kind=EncoderType[self.type.upper()],
            measuring_step_nm=round(self.measuring_step_um * 1000.0),
            length_m=length_m,
            sensor_places_m=(0.0, _SENSOR_SHARE * length_m),
            max_speed=None if self.max_speed_mm_s is None else self.max_speed_mm_s / 1000.0,
            objects=self._objects,
        )


class _ProfidriveEncoderTable(_EncoderTable):
    """What a PROFIdrive encoder of any kind has."""

    profidrive: EncoderTelegramTable = EncoderTelegramTable()

    @abstractmethod
    def form(self) -> EncoderFormat:
        """Return kind, resolution and formats of the values.

        Raises:
            ConfigurationError: Resolution, range and fine bits do not fit together.

        """

    def config(self, cycle_ns: int) -> ProfidriveEncoderNodeConfig:
        """Return the configuration of the emulated encoder.

        Args:
            cycle_ns: Bus cycle, ns.

        Raises:
            ConfigurationError: Values do not fit together.

        """
        from emulators.encoder.profidrive.can import ProfidriveEncoderNodeConfig
        from emulators.encoder.profidrive.device import ProfidriveEncoderConfig
        from emulators.encoder.profidrive.model import encoder_model

        own = self.profidrive
        form = self.form()
        encoder_model(form, zero_mark=own.zero_mark)
        return ProfidriveEncoderNodeConfig(
            node_id=self.node_id,
            encoder=ProfidriveEncoderConfig(
                form=form,
                telegram=own.telegram,
                zero_mark=own.zero_mark,
                reference_speed=own.reference_speed,
                isochronous=own.sign_of_life,
                tolerance=own.sign_of_life_tolerance,
            ),
            cycle_ns=cycle_ns,
            heartbeat_ms=self.heartbeat_ms,
        )

    def check_values(self) -> None:
        """Check that resolution and range fit together.

        Raises:
            ConfigurationError: They do not.

        """
        self.config(1)

    def dictionary(self) -> canopen.ObjectDictionary:
        """Return the object dictionary, shared and read-only."""
        from emulators.encoder.profidrive.eds import EDS

        return EDS.dictionary()

    @property
    def reference_speed(self) -> float:
        """Speed of 4000h as the controller counts it, rpm or m/min."""
        return self.profidrive.reference_speed * (0.06 if self.linear else 1.0)

    def build(
        self, site: DeviceSite, drives: Mapping[str, Any], lead_mm: float | None
    ) -> CiA406Encoder | ProfidriveCanEncoder:
        """Return the emulated encoder, still switched off, on the machine of a drive or a shaft of its own.

        Args:
            site: Where it works.
            drives: Emulated drives by name.
            lead_mm: Lead of the screw of the drive that it sits on, mm; None: it sits on none.

        """
        from emulators.encoder.profidrive.can import ProfidriveCanEncoder

        mounting, shaft = self.mounted(site.scheduler, drives, lead_mm)
        return ProfidriveCanEncoder(
            NodeClock(site.scheduler, lambda: site.rng.spawn(1)[0]),
            site.segments[self.segment],
            self.config(site.bench.cycle_ns),
            mounting,
            name=site.name,
            history=site.history,
            rng=site.rng,
            shaft=shaft,
        )

    def taken_over(self, prefix: str) -> dict[str, int | float]:
        """Return the variables that an axis takes over from the encoder, as an
        offline transfer does (CFG-356).
        """
        form = self.form()
        quantity = "ReferenceVelocity" if self.linear else "ReferenceSpeed"
        return {
            **super().taken_over(prefix),
            f"{prefix}.Parameter.FineResolutionXist1": form.shift_xist1,
            f"{prefix}.Parameter.FineResolutionXist2": form.shift_xist2,
            f"{prefix}.Parameter.{quantity}": self.reference_speed,
        }


class ProfidriveRotaryTable(_ProfidriveEncoderTable, _RotaryTable):
    """`[encoder.NAME]`: a rotary PROFIdrive encoder."""

    label: ClassVar[str] = 'a rotary encoder with profile = "profidrive"'

    profile: Literal["profidrive"]
    type: Literal["single_turn", "multi_turn", "incremental_rotary"] = "multi_turn"

    def form(self) -> EncoderFormat:
        """Return kind, resolution and formats of the values.

        Raises:
            ConfigurationError: Resolution, range and fine bits do not fit together.

        """
        own = self.profidrive
        return fitted_format(
            self.steps_per_revolution,
            self.turns,
            fine_xist1=own.fine_xist1_bits,
            fine_xist2=own.fine_xist2_bits,
            wide=own.telegram == 84,
            counter_bits=own.counter_bits,
        )


class ProfidriveLinearTable(_ProfidriveEncoderTable, _LinearTable):
    """`[encoder.NAME]`: a linear PROFIdrive encoder."""

    label: ClassVar[str] = 'a linear encoder with profile = "profidrive"'

    profile: Literal["profidrive"]
    type: Literal["incremental_linear", "absolute_linear"]

    def form(self) -> EncoderFormat:
        """Return kind, resolution and formats of the values.

        Raises:
            ConfigurationError: Resolution, range and fine bits do not fit together.

        """
        own = self.profidrive
        periods, grid_nm = scale_periods(self.measuring_step_um, self.length_mm)
        return fitted_format(
            periods,
            1 if self.absolute else 0,
            grid_nm=grid_nm,
            fine_xist1=own.fine_xist1_bits,
            fine_xist2=own.fine_xist2_bits,
            wide=own.telegram == 84,
            counter_bits=own.counter_bits,
        )


def _cia406_dictionary(kind: str) -> canopen.ObjectDictionary:
    from emulators.encoder.cia406 import EDS, EncoderType, family_of

    return EDS[family_of(EncoderType[kind.upper()])].dictionary()


def _choice(table: Any) -> Any:
    """Return the tag of the model: profile and kind of measurement."""
    if isinstance(table, _EncoderTable):
        profile, kind = table.profile, table.type
    elif isinstance(table, dict):
        profile, kind = table.get("profile", "cia406"), table.get("type", "multi_turn")
    else:
        return None
    return f"{profile} {'linear' if kind in LINEAR else 'rotary'}"


Cia406Table = RotaryEncoderTable | LinearEncoderTable
ProfidriveEncoderTable = ProfidriveRotaryTable | ProfidriveLinearTable
EncoderTable = Cia406Table | ProfidriveEncoderTable
AnyEncoder = Annotated[
    Annotated[RotaryEncoderTable, Tag("cia406 rotary")]
    | Annotated[LinearEncoderTable, Tag("cia406 linear")]
    | Annotated[ProfidriveRotaryTable, Tag("profidrive rotary")]
    | Annotated[ProfidriveLinearTable, Tag("profidrive linear")],
    Discriminator(_choice),
    WrapValidator(refused_by_part),
]
"""`[encoder.NAME]`, chosen by its keys `profile` and `type`."""
