"""Ratios between motor, encoders and axis, from the variables of the technology object (CFG section 25)."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from fractions import Fraction
from math import ceil, log2
from typing import TYPE_CHECKING, Final

from motion.s7.units import millimetres, per_revolution

if TYPE_CHECKING:
    from motion.s7.variables import VariableStore

INCREMENTAL: Final = 0
ABSOLUTE: Final = 1
CYCLIC_ABSOLUTE: Final = 2

MOTOR_SIDE: Final = 0
LOAD_SIDE: Final = 1
EXTERNAL: Final = 2

_LINEAR: Final = 0
_FULL_BITS: Final = 32


def _decimal(value: float) -> Fraction:
    """Return a number as it has been written, not as the nearest binary one."""
    return Fraction(repr(float(value)))


def _ratio(read: Callable[[str], int], path: str) -> Fraction:
    return Fraction(read(f"{path}.Numerator"), read(f"{path}.Denominator"))


class SensorScale:
    """One encoder: what an increment is worth, how wide it counts, over which range it knows its place.

    Args:
        store: Variables of a positioning axis or an external encoder.
        prefix: `Sensor[1]` to `Sensor[4]` of an axis, `Sensor` of an external encoder.
        load_gear: Motor revolutions per load revolution.
        travel: Position units per revolution of the load.

    """

    __slots__ = (
        "bits",
        "exact_increment",
        "fine",
        "increment",
        "kind",
        "own_rate",
        "prefix",
        "range_counts",
        "reference",
        "unit_per_rpm",
        "velocity_from_drive",
    )

    def __init__(self, store: VariableStore, prefix: str, *, load_gear: Fraction, travel: float) -> None:
        read = store.read
        parameter = f"{prefix}.Parameter."
        self.fine = fine = 1 << read(f"{parameter}FineResolutionXist1")
        """Raw increments per encoder increment."""
        external = store.object_type == "ExternalEncoder"
        gear = Fraction(1) if external else _ratio(read, f"{prefix}.MeasuringGear")
        mounting = MOTOR_SIDE if external else read(f"{prefix}.MountingMode")
        steps = read(f"{parameter}StepsPerRevolution")
        revolutions = read(f"{parameter}DeterminableRevolutions")
        self.prefix = prefix
        self.kind: int = read(f"{prefix}.Type")
        """0 incremental, 1 absolute, 2 cyclic absolute."""
        sign = -1.0 if read(f"{prefix}.InverseDirection") else 1.0
        if read(f"{prefix}.System") == _LINEAR:
            # The distance of two lines is one of the load, whatever gears there are before it (CFG-511,
            # CFG-529).
            per_step = _decimal(read(f"{parameter}Resolution")) * gear
        elif mounting == MOTOR_SIDE:
            per_step = gear / load_gear * _decimal(travel) / steps
        elif mounting == LOAD_SIDE:
            per_step = gear * _decimal(travel) / steps
        else:
            per_step = gear * _decimal(read(f"{parameter}DistancePerRevolution")) / steps
        self.exact_increment = int(sign) * per_step / fine
        """Axis units per raw increment as a ratio, by the decimal numbers of the configuration."""
        self.increment = float(self.exact_increment)
        """Axis units per raw increment, signed by the encoder direction."""
        self.bits = _FULL_BITS
        """Width of the count: 32, or what the encoder parameters need (CFG-308, CFG-309)."""
        if read(f"{parameter}BehaviorGx_XIST1") == 0:
            self.bits = min(
                _FULL_BITS, (fine - 1).bit_length() + ceil(log2(max(2, steps * max(1, revolutions))))
            )
        self.range_counts: int = steps * fine * revolutions
        """Measuring range of an absolute encoder in raw increments; 0 without one (CFG-299)."""
        self.velocity_from_drive: bool = read(f"{prefix}.ActualVelocityMode") == 1
        """Whether the velocity is `NIST_B` of the drive, not the difference of positions (CFG-336)."""
        self.unit_per_rpm = 0.0
        """Axis units per second at 1 rpm (linear motor or encoder: 1 m/min) of the velocity that the telegram
        brings.
        """
        self.own_rate = self.increment * steps * fine / 60.0
        """`unit_per_rpm` of an encoder with a telegram of its own (CFG-340)."""
        self.reference: float = read(f"{parameter}ReferenceSpeed")
        """What 100 % of that velocity means, rpm, of a linear encoder m/min."""
        if read(f"{prefix}.System") == _LINEAR:
            self.own_rate = sign * float(gear) * 1000.0 / 60.0 / millimetres(read("Units.LengthUnit"))
            self.reference = read(f"{parameter}ReferenceVelocity")

    def __eq__(self, other: object) -> bool:
        """Return whether positions mean the same with both."""
        return isinstance(other, SensorScale) and all(
            getattr(self, name) == getattr(other, name) for name in SensorScale.__slots__
        )

    __hash__ = None  # type: ignore[assignment]


class Mechanics:
    """Ratios of one technology object.

    Args:
        store: Its variables.
        apart: For every encoder in turn, whether it has a telegram of its own: its velocity is then one
            of the encoder, and not one of the motor (CFG-340).

    """

    __slots__ = ("increment", "rpm_per_unit", "sensors", "units_per_load_revolution")

    def __init__(self, store: VariableStore, *, apart: Sequence[bool] = ()) -> None:
        read = store.read
        kind = store.object_type
        load_gear = _ratio(read, "LoadGear")
        gear = float(load_gear)
        external = kind == "ExternalEncoder"
        direction = -1.0 if not external and read("Actor.InverseDirection") else 1.0
        self.sensors: tuple[SensorScale, ...] = ()
        self.increment = 0.0
        """Axis units per raw increment of the first encoder."""
        self.rpm_per_unit: float
        """Motor speed in rpm (linear motor: m/min) per velocity unit of the axis, signed by the drive
        direction.
        """
        self.units_per_load_revolution: float
        if kind == "SpeedAxis":
            self.units_per_load_revolution = 1.0
            self.rpm_per_unit = gear * direction
            return
        unit = read("Units.LengthUnit")
        rotary = read("Properties.MotionType") == 1
        travel = per_revolution(unit) if rotary else read("Mechanics.LeadScrew")
        self.units_per_load_revolution = travel
        if external:
            self.rpm_per_unit = 60.0 / travel * gear
            prefixes = ["Sensor"]
        else:
            linear_motor = read("Actor.MotorType") == 1
            per_unit = 60.0 * millimetres(unit) / 1000.0 if linear_motor else 60.0 / travel * gear
            self.rpm_per_unit = per_unit * direction
            prefixes = [f"Sensor[{number}]" for number in range(1, 5) if read(f"Sensor[{number}].Existent")]
        self.sensors = tuple(
            SensorScale(store, prefix, load_gear=load_gear, travel=travel) for prefix in prefixes
        )
        for at, scale in enumerate(self.sensors):
            own = apart[at] if at < len(apart) else external
            scale.unit_per_rpm = scale.own_rate if own else 1.0 / self.rpm_per_unit
        self.increment = self.sensors[0].increment if self.sensors else 0.0
