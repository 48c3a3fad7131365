"""Rules of `hil check`: which tables of a bench file have to agree for the bench to work.

Each rule is one definition: what it compares, what happens otherwise, which keys to change. They look at
the tables alone; nothing is built. `python -m hil.bench.rules docs/reference/bench-file.md` writes the table
of rules between the comments `<!-- rules of hil check -->` and `<!-- end of rules -->` of a page.
"""

from __future__ import annotations

import math
import re
import sys
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Final

from fieldbus.errors import located
from hil.bench._models import keys_of
from hil.bench.config import SWITCH_LEVELS
from hil.bench.drive_config import (
    WITH_RAMPS,
    WITH_SWITCHES,
    Cia402DriveTable,
    ProfidriveModbusTable,
)
from hil.expect.golden import drive_ramp, stop_ramp, switch_clearance
from motion.s7.axis.assembly import mechanics_of
from motion.s7.axis.configuration import setpoint_range
from motion.s7.units import LENGTHS

if TYPE_CHECKING:
    from emulators.drive.machine import LinearAxisConfig, SwitchesConfig
    from hil.bench.config import BenchConfig
    from hil.bench.drive_config import DriveTable
    from motion.kernel.mechanics import Mechanics
    from motion.s7.axis.configuration import SetpointRange

_SAME: Final = 1e-6
"""Relative difference up to which two ratios are the same."""
_SIDES: Final = ("negative", "positive")
_REMOVES_ENABLE: Final = 0
_TRAVERSABLE: Final = 1
_OFF1: Final = 1
_OFF2: Final = 3


class AxisFacts:
    """What a bench file says of an axis and of the drive that it moves.

    Args:
        config: The bench file.
        name: Name of the axis.

    Raises:
        ConfigurationError: The variables of the axis do not fit together.

    """

    def __init__(self, config: BenchConfig, name: str) -> None:
        self.name = name
        self.table = config.s7_axes[name]
        self.drive_name = self.table.drive
        self.drive: DriveTable = config.drive[self.table.drive]
        self.cycle_s = config.bench.cycle_ms / 1000.0
        station = config.inputs_of_axis(name)
        self.wires = None if station is None else config.station[station].digital_inputs
        """Wires of the digital inputs of its station; None: its switches count at the drive."""
        self.filters_s = {side: config.input_filter_s(name, f"{side}_limit") for side in _SIDES}
        """Filter time of the inputs at which the limit switches count, by side."""
        self.from_drive = (config.encoders_of_axis(name) or (self.drive_name,))[0] == self.drive_name
        """Whether the first encoder of the axis is that of the drive."""
        with located(f"axis.{name}"):
            self.store = config.variables_of(name)

    def read(self, path: str) -> float:
        """Return the start value of a variable in the units of the user."""
        return self.store.read(path)

    @property
    def positions(self) -> bool:
        """Whether the axis has positions."""
        return self.table.type != "speed"

    @property
    def emulated(self) -> bool:
        """Whether the bench brings the drive, so that its tables say what it does."""
        return self.drive.device == "emulated"

    @cached_property
    def mechanics(self) -> Mechanics:
        """Ratios of the axis."""
        return mechanics_of(self.store)

    @cached_property
    def setpoint(self) -> SetpointRange:
        """Reference and limit of its speed setpoint."""
        return setpoint_range(self.store)

    @property
    def standard_motor(self) -> bool:
        """Whether the motor turns."""
        return not self.positions or self.read("Actor.MotorType") == 0

    @property
    def unit_mm(self) -> float | None:
        """Size of the position unit, mm; None for angles and speeds."""
        metres = LENGTHS.get(int(self.read("Units.LengthUnit"))) if self.positions else None
        return None if metres is None else metres * 1e3

    @property
    def machine(self) -> LinearAxisConfig | None:
        """What the emulated drive moves; None: nothing, or nobody knows."""
        return self.drive.machine if self.emulated else None

    @property
    def switches(self) -> SwitchesConfig | None:
        """Switches of the emulated drive; None: there are none, or nobody knows."""
        return self.drive.switches if self.emulated and isinstance(self.drive, WITH_SWITCHES) else None

    @property
    def watches_switches(self) -> bool:
        """Whether the hardware limit switches count from the start on."""
        return self.positions and bool(self.read("PositionLimits_HW.Active"))

    @property
    def wired_switches(self) -> Iterator[tuple[str, float]]:
        """Sides and places of the limit switches that the axis can read, mm: those at the inputs of its
        station, or those of the table `switches` of its drive.
        """
        switches, drive = self.switches, self.drive
        if switches is None or (
            isinstance(drive, ProfidriveModbusTable) and drive.registers().inputs is None
        ):
            return
        places = (switches.negative_limit_mm, switches.positive_limit_mm)
        for side, place in zip(_SIDES, places, strict=True):
            wired = (
                "switches" in drive.model_fields_set
                if self.wires is None
                else f"{self.drive_name}.{side}_limit" in self.wires
            )
            if wired and place is not None:
                yield side, place

    @property
    def velocity(self) -> float:
        """Greatest velocity, position units per second (of a speed axis rpm)."""
        return float(
            min(
                self.store.bind("DynamicLimits.MaxVelocity").value,
                self.store.bind("DynamicLimits.Velocity").value,
            )
        )

    def rpm(self, velocity: float) -> float:
        """Return the motor speed of a velocity, rpm (of a linear motor m/min)."""
        return velocity * abs(self.mechanics.rpm_per_unit)

    def keys(self, templates: Iterable[str]) -> tuple[str, ...]:
        """Return the keys, those that the drive has, as they are in the bench file."""
        own = keys_of(type(self.drive))
        return tuple(
            key.format(axis=self.name, drive=self.drive_name)
            for key in templates
            if not key.startswith("drive.") or key.split(".")[2] in own
        )

    def gaps_mm(self) -> Iterator[tuple[str, float, float, float]]:
        """Yield side, place of the limit switch, place of the end stop and the way between them, mm."""
        machine, switches = self.machine, self.switches
        if machine is None or switches is None:
            return
        places = zip(
            _SIDES,
            (switches.negative_limit_mm, switches.positive_limit_mm),
            (machine.negative_stop_mm, machine.positive_stop_mm),
            strict=True,
        )
        for side, switch, stop in places:
            if switch is not None and stop is not None:
                yield side, switch, stop, stop - switch if side == "positive" else switch - stop


Check = Callable[[AxisFacts], Iterator[str]]


@dataclass(frozen=True)
class Rule:
    """What has to agree in a bench file."""

    name: str
    """`switch-level`; `hil check --ignore NAME` leaves it out."""
    compares: str
    """What it compares, for the handbook."""
    otherwise: str
    """What happens where it does not hold."""
    keys: tuple[str, ...]
    """Keys that can be changed, with `{axis}` and `{drive}`."""
    alarm: int
    """Alarm that comes of it; 0: none, or another one each time."""
    check: Check
    """Yields a sentence for everything that does not hold."""


@dataclass(frozen=True)
class Finding:
    """A rule that does not hold for an axis."""

    rule: Rule
    axis: str
    drive: str
    sentence: str
    keys: tuple[str, ...]
    """Keys that can be changed, as they are in the bench file."""

    def to_dict(self) -> dict[str, object]:
        """Return it as plain values."""
        return {
            "rule": self.rule.name,
            "axis": self.axis,
            "drive": self.drive,
            "alarm": self.rule.alarm or None,
            "text": self.sentence,
            "keys": list(self.keys),
        }


def _variable(path: str) -> str:
    return f'axis.{{axis}}.variables."{path}"'


_PLACES: Final = (
    "drive.{drive}.switches.negative_limit_mm",
    "drive.{drive}.switches.positive_limit_mm",
    "drive.{drive}.mechanics.negative_stop_mm",
    "drive.{drive}.mechanics.positive_stop_mm",
)
_RULES: list[Rule] = []


def _rule(
    name: str, *, compares: str, otherwise: str, keys: tuple[str, ...], alarm: int = 0
) -> Callable[[Check], Check]:
    def define(check: Check) -> Check:
        _RULES.append(Rule(name, compares, otherwise, keys, alarm, check))
        return check

    return define


def _bool(value: object) -> str:
    return "TRUE" if value else "FALSE"


@_rule(
    "switch-level",
    compares="`PositionLimits_HW.MinSwitchLevel`, `.MaxSwitchLevel` and the contacts of the limit switches",
    otherwise="a free switch counts as reached",
    keys=(*map(_variable, SWITCH_LEVELS), "drive.{drive}.switches.normally_closed"),
    alarm=531,
)
def _switch_level(axis: AxisFacts) -> Iterator[str]:
    if not axis.watches_switches or axis.switches is None:
        return
    actuated = not axis.switches.normally_closed
    contact = "open" if actuated else "closed"
    for path in SWITCH_LEVELS:
        is_variable = axis.read(f"{path.removesuffix('Level')}Address.DbNumber") != 0
        if axis.read(path) != actuated and not is_variable:
            yield (
                f"{path} = {_bool(not actuated)}, but the limit switches of {axis.drive_name} are normally "
                f"{contact} and {_bool(actuated)} when they are reached"
            )


@_rule(
    "switch-supervision",
    compares="limit switches that are wired (table `switches` of the drive, digital inputs of a station) and "
    "`PositionLimits_HW.Active`; with `false` in the bench file it is meant so",
    otherwise="the axis does not stop at a limit switch",
    keys=(_variable("PositionLimits_HW.Active"),),
)
def _switch_supervision(axis: AxisFacts) -> Iterator[str]:
    if not axis.positions or "PositionLimits_HW.Active" in axis.table.variables:
        return
    if places := [f"{side} at {place:g} mm" for side, place in axis.wired_switches]:
        yield (
            f"{axis.drive_name} has limit switches ({', '.join(places)}), and PositionLimits_HW.Active is "
            "FALSE, its default"
        )


@_rule(
    "switch-place",
    compares="limit switches and end stops of the machine",
    otherwise="the load hits the end stop before it reaches the switch",
    keys=_PLACES,
)
def _switch_place(axis: AxisFacts) -> Iterator[str]:
    for side, switch, stop, gap in axis.gaps_mm() if axis.watches_switches else ():
        if gap <= 0.0:
            yield f"the {side} limit switch at {switch:g} mm is not before the end stop at {stop:g} mm"


@_rule(
    "start-position",
    compares="place of the load at the start, limit switches and end stops",
    otherwise="a limit switch is reached, or an end stop is passed, before anything moves",
    keys=(
        "drive.{drive}.mechanics.start_position_mm",
        "drive.{drive}.switches.negative_limit_mm",
        "drive.{drive}.switches.positive_limit_mm",
    ),
    alarm=531,
)
def _start_position(axis: AxisFacts) -> Iterator[str]:
    machine, switches = axis.machine, axis.switches
    if machine is None:
        return
    start = machine.start_position_mm
    low, high = (
        (-math.inf if machine.negative_stop_mm is None else machine.negative_stop_mm),
        (math.inf if machine.positive_stop_mm is None else machine.positive_stop_mm),
    )
    if not low <= start <= high:
        yield f"the load starts at {start:g} mm, and the end stops are at {low:g} and {high:g} mm"
    if switches is None or not axis.watches_switches:
        return
    width = math.inf if switches.limit_width_mm is None else switches.limit_width_mm
    for side, place, way in (
        ("negative", switches.negative_limit_mm, -1.0),
        ("positive", switches.positive_limit_mm, 1.0),
    ):
        if place is not None and 0.0 <= (start - place) * way <= width:
            yield f"the load starts at {start:g} mm, on the {side} limit switch at {place:g} mm"


def _too_short(axis: AxisFacts, needed_mm: Callable[[float], float]) -> Iterator[str]:
    """Yield what is needed behind limit switches and is not there, in words, the same need in one sentence.

    Args:
        axis: Axis.
        needed_mm: Returns the way that has to be free behind a switch, mm, by the time that passes before
            the switch is seen, s.

    """
    found: dict[float, dict[str, float]] = {}
    for side, _, _, gap in axis.gaps_mm():
        needed = needed_mm(axis.filters_s[side])
        if 0.0 < gap < needed:
            found.setdefault(needed, {})[side] = gap
    for needed, short in found.items():
        ways = " and ".join(f"{gap:g} mm" for gap in dict.fromkeys(short.values()))
        yield (
            f"needs {needed:.4g} mm behind the {' and the '.join(short)} limit switch, and the end stop "
            f"comes after {ways}"
        )


@_rule(
    "stop-distance",
    compares="the stop from the greatest velocity at a limit switch, and the way from there to the end stop",
    otherwise="the load hits the end stop",
    keys=(
        _variable("DynamicLimits.MaxVelocity"),
        _variable("DynamicDefaults.EmergencyDeceleration"),
        _variable("PositionLimits_HW.ApproachBehavior"),
        "drive.{drive}.off3_ramp_s",
        *_PLACES,
    ),
)
def _stop_distance(axis: AxisFacts) -> Iterator[str]:
    unit = axis.unit_mm
    if not axis.watches_switches or unit is None or axis.switches is None:
        return
    velocity, bind = axis.velocity, axis.store.bind
    how, deceleration = "the emergency ramp", bind("DynamicDefaults.EmergencyDeceleration").value
    if (
        bind("PositionLimits_HW.Mode").value == _TRAVERSABLE
        or bind("PositionLimits_HW.ApproachBehavior").value == _REMOVES_ENABLE
    ):
        reaction = bind("Actor.RemoveEnableReaction").value
        ramp = "off1_ramp_s" if reaction == _OFF1 else "off3_ramp_s"
        drive, speed = axis.drive, axis.rpm(1.0)
        if reaction == _OFF2 or not speed or not isinstance(drive, WITH_RAMPS):
            return  # it coasts
        time_s = drive.off1_ramp_s if reaction == _OFF1 else drive.off3_ramp_s
        how = f"{ramp} of {axis.drive_name}"
        deceleration = drive_ramp(axis.velocity, drive.max_speed_rpm / speed, time_s).peak_deceleration
    if deceleration <= 0.0:
        return

    def needed_mm(filter_s: float) -> float:
        return unit * switch_clearance(velocity, deceleration, filter_s=filter_s, cycle_s=axis.cycle_s)

    for need in _too_short(axis, needed_mm):
        yield f"from {velocity * unit:g} mm/s {how} {need}"


@_rule(
    "reversal-distance",
    compares="the reversal of an active homing at a limit switch (`Homing.AutoReversal`), and the way from "
    "there to the end stop",
    otherwise="the load hits the end stop",
    keys=(
        _variable("Homing.ApproachVelocity"),
        _variable("Homing.ReferencingVelocity"),
        _variable("DynamicDefaults.Deceleration"),
        *_PLACES,
    ),
)
def _reversal_distance(axis: AxisFacts) -> Iterator[str]:
    unit = axis.unit_mm
    if not axis.watches_switches or unit is None or axis.switches is None:
        return
    if not axis.read("Homing.AutoReversal"):
        return
    bind = axis.store.bind
    velocities = [bind(f"Homing.{name}Velocity").value for name in ("Approach", "Referencing")]
    velocity = min(max(velocities), axis.velocity)
    deceleration = min(
        bind("DynamicDefaults.Deceleration").value, bind("DynamicLimits.MaxDeceleration").value
    )
    if deceleration <= 0.0:
        return
    jerk = min(bind("DynamicDefaults.Jerk").value or math.inf, bind("DynamicLimits.MaxJerk").value)
    ramp = stop_ramp(velocity, deceleration, jerk if math.isfinite(jerk) else None)

    def needed_mm(filter_s: float) -> float:
        return float(unit * (velocity * (filter_s + axis.cycle_s) + ramp.distance))

    for need in _too_short(axis, needed_mm):
        yield (
            f"active homing that turns round from {velocity * unit:g} mm/s with {deceleration * unit:g} "
            f"mm/s² {need}"
        )


@_rule(
    "encoder-resolution",
    compares="`Sensor[1].Parameter.StepsPerRevolution`, `.FineResolutionXist1` and the encoder of the drive",
    otherwise="the axis measures another way than the drive travels",
    keys=(
        _variable("Sensor[1].Parameter.StepsPerRevolution"),
        _variable("Sensor[1].Parameter.FineResolutionXist1"),
        "drive.{drive}.increments_per_revolution",
    ),
    alarm=521,
)
def _encoder_resolution(axis: AxisFacts) -> Iterator[str]:
    if not axis.positions or not axis.from_drive or not axis.emulated:
        return
    if axis.read("Sensor[1].System") == 0 or axis.read("Sensor[1].DataAdaption"):
        return
    steps = int(axis.read("Sensor[1].Parameter.StepsPerRevolution"))
    fine = int(axis.read("Sensor[1].Parameter.FineResolutionXist1"))
    counts = axis.drive.increments_per_revolution << axis.drive.fine_resolution_bits
    if steps << fine != counts:
        yield (
            f"{steps} steps with {fine} bits of fine resolution are {steps << fine} counts per revolution, "
            f"the encoder of {axis.drive_name} has {counts}"
        )


@_rule(
    "lead-screw",
    compares="`Mechanics.LeadScrew`, `LoadGear` and the machine of the drive",
    otherwise="the axis measures another way than the load travels",
    keys=(
        _variable("Mechanics.LeadScrew"),
        _variable("LoadGear.Numerator"),
        _variable("LoadGear.Denominator"),
        "drive.{drive}.mechanics.lead_screw_mm",
        "drive.{drive}.mechanics.gear_numerator",
        "drive.{drive}.mechanics.gear_denominator",
    ),
)
def _lead_screw(axis: AxisFacts) -> Iterator[str]:
    machine, unit = axis.machine, axis.unit_mm
    if machine is None or unit is None or not axis.standard_motor or not axis.from_drive:
        return
    seen = 60.0 / abs(axis.mechanics.rpm_per_unit) * unit
    travelled = machine.lead_screw_mm * machine.gear_denominator / machine.gear_numerator
    if not math.isclose(seen, travelled, rel_tol=_SAME):
        yield (
            f"a revolution of the motor is {seen:.6g} mm to the axis, and {travelled:.6g} mm to the machine "
            f"of {axis.drive_name}"
        )


@_rule(
    "direction",
    compares="`Actor.InverseDirection`, `Sensor[1].InverseDirection` and `reversed` of the machine",
    otherwise="the axis goes the other way than its switches and end stops are placed for, or runs away",
    keys=(
        _variable("Actor.InverseDirection"),
        _variable("Sensor[1].InverseDirection"),
        "drive.{drive}.mechanics.reversed",
    ),
)
def _direction(axis: AxisFacts) -> Iterator[str]:
    machine = axis.machine
    if machine is None or not axis.positions or not axis.from_drive:
        return
    for path in ("Actor.InverseDirection", "Sensor[1].InverseDirection"):
        if axis.read(path) != machine.reversed:
            yield (
                f"{path} is {_bool(axis.read(path))}, and reversed of the machine of {axis.drive_name} is "
                f"{str(machine.reversed).lower()}"
            )


@_rule(
    "maximum-velocity",
    compares="`DynamicLimits.MaxVelocity` through gear and lead, and `Actor.DriveParameter.MaxSpeed`",
    otherwise="the axis cannot reach its maximum velocity",
    keys=(
        _variable("DynamicLimits.MaxVelocity"),
        _variable("Mechanics.LeadScrew"),
        _variable("Actor.DriveParameter.MaxSpeed"),
    ),
    alarm=551,
)
def _maximum_velocity(axis: AxisFacts) -> Iterator[str]:
    if axis.read("Actor.DataAdaption"):
        return  # the maximum speed comes from the drive
    maximum = axis.store.bind("DynamicLimits.MaxVelocity").value
    wanted, most = axis.rpm(maximum), axis.setpoint.maximum
    if wanted > most * (1.0 + _SAME):
        unit = axis.store.unit("DynamicLimits.MaxVelocity")
        shown = axis.read("DynamicLimits.MaxVelocity")
        speed = "rpm" if axis.standard_motor else "m/min"
        yield (
            f"DynamicLimits.MaxVelocity = {shown:g} {unit} needs {wanted:.6g} {speed}, the setpoint ends at "
            f"{most:.6g}; at most {shown * most / wanted:.6g} {unit}"
        )


@_rule(
    "drive-torque",
    compares="the torque that 6072h, 6073h and the rated torque of a CiA 402 drive allow, and what the "
    "machine needs for the emergency ramp (`DynamicDefaults.EmergencyDeceleration`)",
    otherwise="the drive does not follow the ramp",
    keys=(
        _variable("DynamicDefaults.EmergencyDeceleration"),
        "drive.{drive}.rated_torque_nm",
        "drive.{drive}.mechanics.load_mass_kg",
        "drive.{drive}.mechanics.motor_inertia_kgm2",
        "drive.{drive}.eds",
    ),
    alarm=521,
)
def _drive_torque(axis: AxisFacts) -> Iterator[str]:
    machine, drive = axis.machine, axis.drive
    if machine is None or not axis.positions or not isinstance(drive, Cia402DriveTable):
        return
    deceleration = axis.store.bind("DynamicDefaults.EmergencyDeceleration").value
    inertia = machine.motor_inertia_kgm2 + machine.load_at_motor_kgm2
    needed = inertia * axis.rpm(deceleration) * math.tau / 60.0
    there = drive.torque_limit_nm
    if needed > there:
        yield f"{axis.drive_name} gives at most {there:.3g} Nm; the emergency ramp needs {needed:.3g} Nm"


@_rule(
    "drive-speed",
    compares="the greatest speed setpoint of the axis and `max_speed_rpm` of the drive",
    otherwise="the drive does not follow",
    keys=(
        _variable("DynamicLimits.MaxVelocity"),
        _variable("Actor.DriveParameter.MaxSpeed"),
        "drive.{drive}.max_speed_rpm",
    ),
    alarm=521,
)
def _drive_speed(axis: AxisFacts) -> Iterator[str]:
    if not axis.emulated or not axis.standard_motor:
        return
    most = min(axis.rpm(axis.velocity), axis.setpoint.maximum)
    if most > axis.drive.max_speed_rpm * (1.0 + _SAME):
        own = axis.drive.max_speed_rpm
        yield f"the axis moves with up to {most:.6g} rpm, {axis.drive_name} with {own:g} rpm at most"


@_rule(
    "reference-speed",
    compares="`Actor.DriveParameter.ReferenceSpeed` and the speed at 100 % of the setpoint of the drive",
    otherwise="the drive turns faster or slower than the axis says",
    keys=(
        _variable("Actor.DriveParameter.ReferenceSpeed"),
        "drive.{drive}.profidrive.reference_speed_rpm",
        "drive.{drive}.analog.reference_speed_rpm",
        "drive.{drive}.tm_pto.reference_speed_rpm",
    ),
    alarm=521,
)
def _reference_speed(axis: AxisFacts) -> Iterator[str]:
    if not axis.emulated or not axis.standard_motor or axis.drive.profile == "cia402":
        return
    if axis.read("Actor.DataAdaption"):
        return
    own, theirs = axis.setpoint.reference, axis.drive.reference_speed_rpm
    if not math.isclose(own, theirs, rel_tol=_SAME):
        yield f"100 % of the setpoint is {own:g} rpm to the axis, and {theirs:g} rpm to {axis.drive_name}"


RULES: Final = tuple(_RULES)
"""All rules, in the order of the handbook."""

KEYS_OF_ALARMS: Final[Mapping[int, tuple[str, ...]]] = {
    104: (_variable("PositionLimits_SW.MinPosition"), _variable("PositionLimits_SW.MaxPosition")),
    109: (_variable("PositionLimits_HW.Active"), _variable("Actor.Interface.EnableTorqueData")),
    110: (
        _variable("Actor.DriveParameter.MaxSpeed"),
        _variable("Actor.DriveParameter.ReferenceSpeed"),
    ),
    111: ("drive.{drive}.telegram",),
    112: (_variable("Sensor[1].Type"), "drive.{drive}.encoder"),
}
"""Keys that can be changed against alarms after the start that no rule foresees."""


def findings(config: BenchConfig) -> list[Finding]:
    """Return everything in a bench file that does not agree.

    Raises:
        ConfigurationError: The variables of an axis do not fit together.

    """
    found = []
    for name, axis in config.s7_axes.items():
        if not axis.drive:
            continue  # a virtual axis, which nothing has to fit
        facts = AxisFacts(config, name)
        for rule in RULES:
            keys = facts.keys(rule.keys)
            found += [Finding(rule, name, facts.drive_name, sentence, keys) for sentence in rule.check(facts)]
    return found


# -- documentation -----------------------------------------------------------------------------------------

_BLOCK: Final = re.compile(r"(<!-- rules of hil check -->\n).*?(<!-- end of rules -->)", re.DOTALL)


def table() -> str:
    """Return the Markdown table of the rules."""
    lines = ["| rule | compares | otherwise | keys |", "|---|---|---|---|"]
    for rule in RULES:
        keys = ", ".join(f"`{key.format(axis='NAME', drive='NAME')}`" for key in rule.keys)
        otherwise = rule.otherwise + (f": alarm {rule.alarm}" if rule.alarm else "")
        lines.append(f"| `{rule.name}` | {rule.compares} | {otherwise} | {keys} |")
    return "\n".join(lines)


def with_rules(page: str) -> str:
    """Return a page with the present table of rules."""
    return _BLOCK.sub(lambda found: f"{found[1]}{table()}\n{found[2]}", page)


if __name__ == "__main__":
    for argument in sys.argv[1:]:
        path = Path(argument)
        path.write_text(with_rules(path.read_text(encoding="utf-8")), encoding="utf-8")
