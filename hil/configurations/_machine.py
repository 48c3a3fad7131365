"""A machine for a configuration: numbers as a machine builder has them, no two of them equal or round by
accident.

Everything is made in mm and s, of a rotary axis in deg and s; the emulated machine of a rotary axis travels
1 mm per degree. In time all machines are alike: their greatest velocity is reached within some tenths of a
second, and their range is passed in two to three seconds, so that a case takes about as long on each of them.
"""

from __future__ import annotations

import math
import random
from typing import Any, Final

from hil.configurations.factors import Row
from motion.s7.units import ANGLES

Table = dict[str, Any]

_UNITS: Final = {
    "mm": (1013, 1062, 1524),
    "m": (1010, 1061, 1525),
    "um": (1014, 1062, 1524),
    "in": (1019, 1066, 1069),
    "deg": (1005, 1521, 1522),
    "rad": (1004, 1086, 1523),
}
"""Codes of `Units.LengthUnit`, and of `Units.VelocityUnit` per second and per minute."""
_CYCLES_MS: Final = {"2ms": 2, "4ms": 4, "8ms": 8}
_LINE_MS: Final = {"none": 24, "twin": 48}
_ON_MOTOR: Final = ("motor", "both")
_TURNS: Final = 4096
_PEAK: Final = 3.0
"""Torque limit of a drive as a multiple of its rated torque."""
_WITH_DRIVE_COUNTS: Final = {"usual": 131_072, "coarse": 20_000, "finest": 1 << 24}
_WITH_TELEGRAM_COUNTS: Final = {"usual": (2048, 11), "coarse": (2500, 7), "finest": (1 << 16, 11)}


def units_of(row: Row) -> tuple[int, int]:
    """Return the codes of the units of length and velocity."""
    length, second, minute = _UNITS[row["unit"]]
    return length, minute if row["time"] == "minute" else second


def cycle_ms(row: Row) -> int:
    """Return the bus cycle, ms."""
    return _CYCLES_MS.get(row["cycle"]) or _LINE_MS.get(row["neighbours"], _LINE_MS["none"])


class Dice:
    """Draws numbers.

    Args:
        name: The same name gives the same numbers.

    """

    def __init__(self, name: str) -> None:
        self._random = random.Random(name)  # noqa: S311 - repeatable, not secret

    def between(self, low: float, high: float) -> float:
        """Return a number of four digits."""
        value = self._random.uniform(low, high)
        return round(value, 3 - math.floor(math.log10(abs(value)))) if value else 0.0

    def one_of(self, *values: float) -> float:
        """Return one of these."""
        return self._random.choice(values)


class Machine:
    """Motor, gear, load and axis of a configuration.

    Args:
        row: The configuration.
        dice: Where the numbers come from.

    """

    def __init__(self, row: Row, dice: Dice) -> None:
        self.row = row
        self.rotary = row["motion"].startswith("rotary")
        self.modulo = row["motion"].endswith("modulo")
        self.cycle_s = cycle_ms(row) / 1000.0
        between, one_of = dice.between, dice.one_of
        self.velocity = between(520.0, 1500.0) if self.rotary else between(260.0, 620.0)
        self.lead, self.gear = self._transmission(one_of)
        per_unit = self.gear[0] / self.gear[1] / self.lead
        fastest_rpm = self.velocity * per_unit * 60.0
        margin = 1.0 if row["reserve"] == "none" else between(1.08, 1.35)
        self.max_speed_rpm = math.ceil(fastest_rpm * margin * 1000.0) / 1000.0
        self.reference_rpm = self.max_speed_rpm * (1.0 if row["reserve"] == "none" else between(1.05, 1.5))
        self._dynamics(between)
        self._range(between)
        self._inertia(between, per_unit)

    def _transmission(self, one_of: Any) -> tuple[float, tuple[int, int]]:
        gear = self.row["gear"]
        if self.rotary:
            return 360.0, {"direct": (1, 1), "reduced": (40, 3), "fraction": (17, 7)}[gear]
        if gear == "direct":
            return one_of(8.0, 12.7, 16.0), (1, 1)
        if gear == "reduced":
            return one_of(32.0, 40.0, 63.5), (7, 2)
        return one_of(4.0, 5.0, 6.0), (3, 7)

    def _dynamics(self, between: Any) -> None:
        v, row = self.velocity, self.row
        self.acceleration = v * between(3.4, 4.6)
        share = between(1.15, 1.45) if row["braking"] == "harder" else between(0.72, 0.87)
        self.deceleration = self.acceleration * share
        self.emergency = max(self.acceleration, self.deceleration) * between(1.5, 2.1)
        self.jerk = v * between(32.0, 48.0)
        self.own_velocity = v * between(0.17, 0.24)
        self.own_acceleration = self.acceleration * between(0.42, 0.5)
        self.own_deceleration = self.deceleration * between(0.52, 0.6)
        self.own_jerk = 0.0 if row["jerk"] == "none" else self.jerk * between(0.4, 0.6)
        self.off1_s, self.off3_s = between(0.7, 1.2), between(0.33, 0.57)
        # Of the transport delay a gain may use so much; without precontrol the axis is behind by v / Kv.
        delay_s = self.cycle_s * (2.5 if row["bus"] == "modbus-rtu" else 2.0)
        self.kv = round(0.16 * between(0.85, 1.0) / delay_s, 2)
        self.kpc = {"full": 100.0, "part": between(81.0, 93.0), "none": 0.0}[row["precontrol"]]
        behind = (1.0 - self.kpc / 100.0) / self.kv
        self.error = v * (behind * 1.3 + between(0.019, 0.027) + self.cycle_s)
        self.least_error = (
            self.error * between(0.2, 0.3) if self.kpc == 100.0 else self.error * between(0.5, 0.6)
        )

    def _range(self, between: Any) -> None:
        v = self.velocity
        self.low, self.high = -v * between(1.08, 1.25), v * between(1.3, 1.5)
        filter_s = float(self.row["filter"].rstrip("ms")) / 1000.0
        gap = v * (0.09 + filter_s + 3.0 * self.cycle_s)
        self.low_switch, self.high_switch = self.low - gap * between(0.95, 1.05), self.high + gap
        stop = v * (0.1 + 1.1 * filter_s + 4.0 * self.cycle_s)
        self.low_stop = self.low_switch - stop * between(1.05, 1.2)
        self.high_stop = self.high_switch + stop * between(1.2, 1.4)
        self.play, self.smoothing_s = v * between(3.7e-4, 4.3e-4), between(0.09, 0.12)
        self.cam = (self.low - 0.04 * v, self.low - 0.004 * v)

    def _inertia(self, between: Any, per_unit: float) -> None:
        self.rated_nm = between(1.3, 3.7)
        heavy = self.row["load"] == "heavy"
        angular = self.emergency * per_unit * math.tau
        peak_nm = _PEAK * self.rated_nm
        inertia = peak_nm * (between(0.4, 0.5) if heavy else between(0.16, 0.24)) / angular
        share = between(0.75, 0.85) if heavy else between(0.3, 0.5)
        self.motor_inertia = inertia * (1.0 - share)
        screw = self.lead / 1000.0 / math.tau
        at_screw = inertia * share * (self.gear[0] / self.gear[1]) ** 2
        self.screw_inertia = 0.3 * at_screw
        self.mass = 0.7 * at_screw / screw**2
        per_torque = self.gear[0] / self.gear[1] / screw
        friction = 0.11 * peak_nm if self.row["load"] == "friction" else 0.1 * inertia * angular
        self.friction = friction * per_torque * between(0.9, 1.1)
        self.breakaway = self.friction * between(1.2, 1.5)
        self.viscous = 0.4 * self.friction / (self.velocity / 1000.0)

    # -- tables ---------------------------------------------------------------------------------------------

    @property
    def window(self) -> float:
        """Positioning window: what the encoder can resolve several times, and what a slow bus lets swing."""
        share = 2e-3 if self.row["bus"] == "modbus-rtu" else 2e-4
        return max(share * self.velocity, 6.0 * self.increment)

    @property
    def increment(self) -> float:
        """Travel per increment of the encoder."""
        if self.row["feedback"] == "load":
            return 0.005 if self.row["resolution"] == "coarse" else 0.001
        counts, _ = self.counts
        return self.lead * self.gear[1] / self.gear[0] / counts

    @property
    def counts(self) -> tuple[int, int]:
        """Increments per revolution, and bits of fine resolution."""
        kind = self.row["resolution"]
        if self.row["profile"] == "cia402":
            counts = _WITH_DRIVE_COUNTS[kind]
            # So many revolutions of an absolute encoder do not fit into 32 bits.
            return (1 << 20 if self._absolute and kind == "finest" else counts), 0
        return _WITH_TELEGRAM_COUNTS[kind]

    @property
    def _absolute(self) -> bool:
        return self.row["encoder"] != "incremental" and self.row["feedback"] in _ON_MOTOR

    @property
    def _scale_length(self) -> float:
        """Length of the scale of a linear encoder on the load, mm."""
        return 20.0 * self.velocity

    @property
    def first_value(self) -> float:
        """What an absolute encoder says where the machine is at 0, mm or deg."""
        if self.row["feedback"] == "load":
            return 0.0 if self.rotary else 0.5 * self._scale_length
        if self.row["mounting"] == "centre":
            return 0.0
        value = self._mounting * self.increment
        return -value if self.row["direction"] == "reversed" else value

    @property
    def _mounting(self) -> int:
        """Value of the encoder on the motor, near the end of what its revolutions or 32 bits can tell."""
        counts, bits = self.counts
        return min(_TURNS // 2 * counts, (1 << 31) >> bits) - counts // 3

    def drive(self, segment: str, address: int) -> Table:
        """Return the table of the drive."""
        row = self.row
        counts, bits = self.counts
        table: Table = {
            "profile": row["profile"],
            "segment": segment,
            "increments_per_revolution": counts,
            "max_speed_rpm": self.max_speed_rpm,
            "off1_ramp_s": self.off1_s,
            "off3_ramp_s": self.off3_s,
            "rated_torque_nm": self.rated_nm,
            "mechanics": self._mechanics(),
            "switches": self._switches(),
        }
        table["unit" if row["bus"] != "can" else "node_id"] = address
        if self._absolute:
            table["encoder"] = "absolute"
            if row["mounting"] == "overflow":
                table["mounting_increments"] = self._mounting
        if row["profile"] == "profidrive":
            table["telegram"] = int(row["telegram"])
            table["profidrive"] = {
                "reference_speed_rpm": round(self.reference_rpm, 3),
                "reference_torque_nm": round(1.1 * self.rated_nm, 3),
                "fine_resolution_bits": bits,
            }
            if row["telegram"] in ("103", "106"):
                table["encoder2"] = self._second_encoder()
        return table

    def _mechanics(self) -> Table:
        table: Table = {
            "lead_screw_mm": self.lead,
            "gear_numerator": self.gear[0],
            "gear_denominator": self.gear[1],
            "reversed": self.row["direction"] == "reversed",
            "motor_inertia_kgm2": self.motor_inertia,
            "screw_inertia_kgm2": self.screw_inertia,
            "load_mass_kg": self.mass,
            "coulomb_friction_n": self.friction,
            "static_friction_n": self.breakaway,
            "viscous_friction_n_per_m_s": self.viscous,
            "backlash_mm": 0.5 * self.play if self.row["play"] == "some" else 0.0,
        }
        # Further away than an axis without ends comes in any case.
        far = 1000.0 * self.velocity
        table["negative_stop_mm"] = -far if self.modulo else self.low_stop
        table["positive_stop_mm"] = far if self.modulo else self.high_stop
        return table

    def _switches(self) -> Table:
        far = 900.0 * self.velocity
        places = (-far, far) if self.row["switches"] == "none" else (self.low_switch, self.high_switch)
        return {
            "negative_limit_mm": places[0],
            "positive_limit_mm": places[1],
            "normally_closed": self.row["switches"] == "opening",
            "home_from_mm": self.cam[0],
            "home_to_mm": self.cam[1],
            "hysteresis_mm": 0.001 * self.velocity,
            "input_filter_ms": float(self.row["filter"].rstrip("ms")),
        }

    def _second_encoder(self) -> Table:
        kind = "multi_turn" if self.row["encoder"] == "absolute" else "incremental_rotary"
        return {
            "type": kind,
            "mounting": "load",
            "steps_per_revolution": {"usual": 4096, "coarse": 3600, "finest": 16384}[self.row["resolution"]],
            "revolutions": 512,
        }

    def load_encoder(self, drive: str, segment: str, node_id: int) -> Table:
        """Return the table of an encoder on the load with a node of its own."""
        absolute = self.row["encoder"] == "absolute" and self.row["feedback"] == "load"
        table: Table = {"segment": segment, "node_id": node_id, "on": drive, "mounting": "load"}
        if self.row["play"] == "compensated":
            table["backlash_deg" if self.rotary else "backlash_mm"] = self.play
        if self.rotary:
            table["type"] = "multi_turn" if absolute else "incremental_rotary"
            table["steps_per_revolution"] = {"usual": 65536, "coarse": 36000, "finest": 1 << 20}[
                self.row["resolution"]
            ]
            table["revolutions"] = 1024
            return table
        table["type"] = "absolute_linear" if absolute else "incremental_linear"
        table["measuring_step_um"] = 5.0 if self.row["resolution"] == "coarse" else 1.0
        table["length_mm"] = self._scale_length
        return table

    def variables(self, servo_s: float) -> Table:
        """Return the start values of the axis, in mm or deg and s."""
        row, v = self.row, self.velocity
        reversed_direction = row["direction"] == "reversed"
        values: Table = {
            "Actor.InverseDirection": reversed_direction,
            "Actor.DriveParameter.MaxSpeed": self.max_speed_rpm,
            "LoadGear.Numerator": self.gear[0],
            "LoadGear.Denominator": self.gear[1],
            "DynamicLimits.MaxVelocity": v,
            "DynamicLimits.Velocity": v,
            "DynamicLimits.MaxAcceleration": self.acceleration,
            "DynamicLimits.MaxDeceleration": self.deceleration,
            "DynamicLimits.MaxJerk": self.jerk,
            "DynamicDefaults.Velocity": self.own_velocity,
            "DynamicDefaults.Acceleration": self.own_acceleration,
            "DynamicDefaults.Deceleration": self.own_deceleration,
            "DynamicDefaults.Jerk": self.own_jerk,
            "DynamicDefaults.EmergencyDeceleration": self.emergency,
            "PositionControl.Kv": self.kv,
            "PositionControl.Kpc": self.kpc,
            "PositionControl.EnableDSC": row["dsc"] == "on",
            "DynamicAxisModel.VelocityTimeConstant": servo_s,
            "PositioningMonitoring.Window": self.window,
            "PositioningMonitoring.ToleranceTime": round(1.0 + 7.0 / self.kv, 2),
            "PositioningMonitoring.MinDwellTime": 0.013,
            "FollowingError.MinValue": self.least_error,
            "FollowingError.MaxValue": self.error,
            "FollowingError.MinVelocity": 0.11 * v,
            "StandstillSignal.VelocityThreshold": max(0.0045 * v, 3.0 * self.increment / self.cycle_s),
            "StandstillSignal.MinDwellTime": 0.023,
            "PositionLimits_HW.Active": row["switches"] != "none",
            "PositionLimits_HW.Mode": 0,
            "PositionLimits_HW.ApproachBehavior": 1,
            "PositionLimits_SW.Active": row["software-limits"] == "on",
            "PositionLimits_SW.MinPosition": self.low,
            "PositionLimits_SW.MaxPosition": self.high,
            "Homing.ApproachVelocity": 0.41 * v,
            "Homing.ReferencingVelocity": 0.07 * v,
        }
        if self.rotary:
            values["Properties.MotionType"] = 1
        else:
            values["Mechanics.LeadScrew"] = self.lead
        if self.modulo:
            values |= {
                "Modulo.Enable": True,
                "Modulo.Length": 360.0 if self.rotary else round(0.37 * v, 1),
                "Modulo.StartValue": -180.0 if self.rotary else 0.0,
            }
        return values | self._sensor(reversed_direction=reversed_direction)

    def _sensor(self, *, reversed_direction: bool) -> Table:
        if self.row["feedback"] not in _ON_MOTOR:
            return {}
        values: Table = {"Sensor[1].InverseDirection": reversed_direction}
        if self.row["play"] == "compensated":
            values["Sensor[1].Backlash.Enable"] = True
            values["Sensor[1].Backlash.Size"] = self.play
        if self.row["feedback"] == "both":
            values["PositionControl.SmoothingTimeByChangeDifference"] = self.smoothing_s
        if self._absolute:
            values["Sensor[1].Type"] = 2 if self.row["encoder"] == "cyclic" else 1
            values["Sensor[1].Parameter.DeterminableRevolutions"] = _TURNS
        return values


def is_angle(length: int) -> bool:
    """Return whether a code of `Units.LengthUnit` is an angle."""
    return length in ANGLES
