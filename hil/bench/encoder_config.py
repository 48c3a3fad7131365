"""`[encoder.NAME]` of a bench file: one model per profile and kind of measurement,
each of which builds its encoder.
"""

from __future__ import annotations

import math
from abc import abstractmethod
from collections.abc import Callable
from typing import TYPE_CHECKING, Annotated, ClassVar, Final, Literal, Protocol

from annotated_types import Unit
from pydantic import Discriminator, Field, Tag, WrapValidator, model_validator

from emulators.checked_fields import NotNegative
from emulators.encoder.keys import (
    LinearMountingKeys,
    LinearWarningKeys,
    MountingKeys,
    RotaryKeys,
    RotaryMountingKeys,
    RotaryWarningKeys,
)
from emulators.encoder.profidrive.settings import ProfidriveEncoderSettings
from fieldbus.node_clock import NodeClock
from hil.bench._table import NodeId, Table, refused_by_part

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


class _ShaftTable(Table, frozen=True):
    """What the shaft or slide of an encoder of its own has."""

    profile: Annotated[tuple[tuple[NotNegative, float], ...], Unit("s; rpm or mm/s")] | None = None
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


class ShaftTable(_ShaftTable, frozen=True):
    """`[encoder.NAME.shaft]`: how the shaft of a rotary encoder turns; a test may move it otherwise."""

    label: ClassVar[str] = "the shaft of a rotary encoder"

    speed_rpm: float = 0.0
    """Constant speed of a shaft."""

    @property
    def constant_speed(self) -> float:
        """Constant speed, rpm."""
        return self.speed_rpm


class SlideTable(_ShaftTable, frozen=True):
    """`[encoder.NAME.shaft]`: how the slide of a linear encoder moves; a test may move it otherwise."""

    label: ClassVar[str] = "the slide of a linear encoder"

    speed_mm_s: float = 0.0
    """Constant speed of a linear encoder's slide."""

    @property
    def constant_speed(self) -> float:
        """Constant speed, mm/s."""
        return self.speed_mm_s


class Machine(Protocol):
    """The machine of a drive that an encoder sits on."""

    @property
    def motor_angle(self) -> float:
        """Angle of the motor shaft, rad."""

    @property
    def position(self) -> float:
        """Position of the load, m or rad."""


class _EncoderTable(Table, MountingKeys, frozen=True):
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
    heartbeat_ms: Annotated[int, Field(ge=0, le=60000)] = 100
    """Heartbeat of the encoder; 0 = none. That of a physical one is what it was set to: with 0 here the
    bench does not wait for it.
    """

    @property
    @abstractmethod
    def motion(self) -> _ShaftTable:
        """How its own shaft or slide moves."""

    @abstractmethod
    def build(
        self, site: DeviceSite, machine: Machine | None, lead_mm: float | None
    ) -> CiA406Encoder | ProfidriveCanEncoder:
        """Return the emulated encoder, still switched off, on the machine of a drive or a shaft of its own.

        Args:
            site: Where it works.
            machine: What it sits on; None: a shaft or slide of its own.
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
    def speed_scale(self) -> float:
        """rad/s per rpm, or m/s per mm/s."""
        return 1.0 / 1000.0 if self.linear else _RPM

    def mounted(
        self, scheduler: Scheduler, machine: Machine | None, lead_mm: float | None
    ) -> tuple[Mounting, DrivenShaft | None]:
        """Return how the encoder follows a machine or its own shaft, and that shaft."""
        from emulators.encoder import Mounting

        ratio, offset, backlash = self.coupling(lead_mm)
        shaft: DrivenShaft | None = None
        source: Callable[[], float]
        if machine is None:
            shaft = own = self.motion.build(scheduler, self.speed_scale)

            def source() -> float:
                return own.position
        elif self.mounting == "motor":

            def source() -> float:
                return machine.motor_angle
        else:

            def source() -> float:
                return machine.position

        return Mounting(source, ratio=ratio, offset=offset, backlash=backlash), shaft

    def taken_over(self, prefix: str) -> dict[str, int | float]:
        """Return the variables that an axis takes over from the encoder, as an
        offline transfer does (CFG-356).
        """
        return {f"{prefix}.Type": int(self.absolute), f"{prefix}.Parameter.FineResolutionXist1": 0}


class _RotaryTable(_EncoderTable, RotaryMountingKeys, RotaryKeys, frozen=True):
    """What a rotary encoder of any profile has."""

    linear: ClassVar[bool] = False

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


class _LinearTable(_EncoderTable, LinearMountingKeys, frozen=True):
    """What a linear encoder of any profile has."""

    linear: ClassVar[bool] = True

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

    def taken_over(self, prefix: str) -> dict[str, int | float]:
        """Return the variables that an axis takes over from the encoder, as an
        offline transfer does (CFG-356).
        """
        values = super().taken_over(prefix)
        values[f"{prefix}.System"] = 0
        values[f"{prefix}.Parameter.Resolution"] = self.measuring_step_um / 1000.0
        values[f"{prefix}.MountingMode"] = 1
        return values


class _Cia406Table(_EncoderTable, frozen=True):
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
        self, site: DeviceSite, machine: Machine | None, lead_mm: float | None
    ) -> CiA406Encoder | ProfidriveCanEncoder:
        """Return the emulated encoder, still switched off, on the machine of a drive or a shaft of its own.

        Args:
            site: Where it works.
            machine: What it sits on; None: a shaft or slide of its own.
            lead_mm: Lead of the screw of the drive that it sits on, mm; None: it sits on none.

        """
        from emulators.encoder.cia406 import CiA406Encoder

        mounting, shaft = self.mounted(site.scheduler, machine, lead_mm)
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


class RotaryEncoderTable(_Cia406Table, _RotaryTable, RotaryWarningKeys, frozen=True):
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
            max_speed_rpm=self.max_speed_rpm,
            objects=self._objects,
        )


class LinearEncoderTable(_Cia406Table, _LinearTable, LinearWarningKeys, frozen=True):
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

    def config(self) -> EncoderDeviceConfig:
        """Return the configuration of the emulated encoder.

        Raises:
            ConfigurationError: Resolution and range do not fit together.

        """
        from emulators.encoder.cia406 import EncoderDeviceConfig, EncoderType

        return EncoderDeviceConfig(
            node_id=self.node_id,
            kind=EncoderType[self.type.upper()],
            measuring_step_um=self.measuring_step_um,
            length_mm=self.length_mm,
            sensor_places_m=(0.0, _SENSOR_SHARE * (self.length_mm / 1000.0)),
            max_speed_mm_s=self.max_speed_mm_s,
            objects=self._objects,
        )


class _ProfidriveEncoderTable(_EncoderTable, frozen=True):
    """What a PROFIdrive encoder of any kind has."""

    profidrive: ProfidriveEncoderSettings = ProfidriveEncoderSettings()

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

        form = self.form()
        encoder_model(form, zero_mark=self.profidrive.zero_mark)
        return ProfidriveEncoderNodeConfig(
            node_id=self.node_id,
            encoder=ProfidriveEncoderConfig(form=form, settings=self.profidrive),
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
        self, site: DeviceSite, machine: Machine | None, lead_mm: float | None
    ) -> CiA406Encoder | ProfidriveCanEncoder:
        """Return the emulated encoder, still switched off, on the machine of a drive or a shaft of its own.

        Args:
            site: Where it works.
            machine: What it sits on; None: a shaft or slide of its own.
            lead_mm: Lead of the screw of the drive that it sits on, mm; None: it sits on none.

        """
        from emulators.encoder.profidrive.can import ProfidriveCanEncoder

        mounting, shaft = self.mounted(site.scheduler, machine, lead_mm)
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


class ProfidriveRotaryTable(_ProfidriveEncoderTable, _RotaryTable, frozen=True):
    """`[encoder.NAME]`: a rotary PROFIdrive encoder."""

    label: ClassVar[str] = 'a rotary encoder with profile = "profidrive"'

    profile: Literal["profidrive"]
    type: Literal["single_turn", "multi_turn", "incremental_rotary"] = "multi_turn"

    def form(self) -> EncoderFormat:
        """Return kind, resolution and formats of the values.

        Raises:
            ConfigurationError: Resolution, range and fine bits do not fit together.

        """
        return self.profidrive.form(self.steps_per_revolution, self.turns_of(self.type))


class ProfidriveLinearTable(_ProfidriveEncoderTable, _LinearTable, frozen=True):
    """`[encoder.NAME]`: a linear PROFIdrive encoder."""

    label: ClassVar[str] = 'a linear encoder with profile = "profidrive"'

    profile: Literal["profidrive"]
    type: Literal["incremental_linear", "absolute_linear"]

    def form(self) -> EncoderFormat:
        """Return kind, resolution and formats of the values.

        Raises:
            ConfigurationError: Resolution, range and fine bits do not fit together.

        """
        return self.profidrive.form(self.periods, 1 if self.absolute else 0, grid_nm=self.measuring_step_nm)


def _cia406_dictionary(kind: str) -> canopen.ObjectDictionary:
    from emulators.encoder.cia406 import EDS, EncoderType, family_of

    return EDS[family_of(EncoderType[kind.upper()])].dictionary()


def _choice(table: object) -> str | None:
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
