"""Hypothesis strategies for configurations: what a bench file may say otherwise, and
still be a machine that works.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Final

from hypothesis import strategies as st
from hypothesis.strategies import SearchStrategy

from hil.bench.axis_config import OBJECTS
from hil.bench.drive_config import ProfidriveCanTable
from hil.fuzz._configuration import UNITS, Configuration
from hil.fuzz._nc_configurations import nc_configurations
from motion.s7.variables import elements, variables_of
from reports.json_types import Json

if TYPE_CHECKING:
    from hil.bench.config import BenchConfig
    from hil.bench.drive_config import DriveTable

Table = dict[str, Json]
Part = SearchStrategy[Table]

_LENGTHS: Final = (
    (1013, 1524),
    (1013, 1061),
    (1536, 1538),
    (1010, 1061),
    (1010, 1525),
    (1014, 1062),
    (1019, 1066),
    (1018, 1070),
)
"""Codes of units: mm and mm/min, mm and m/s, mm and mm/s with six decimals, m and m/s, m and m/min, µm and
mm/s, in and in/s, ft and ft/min."""
_MACHINES: Final = (
    {"load_mass_kg": 5.0},
    {"load_mass_kg": 100.0},
    {"coulomb_friction_n": 150.0},
    {"viscous_friction_n_per_m_s": 300.0},
)


class _Tables:
    """Makes tables of a bench file for its first axis and the drive of that."""

    def __init__(self, config: BenchConfig) -> None:
        # A virtual axis without a drive comes into question only where there is no other.
        self.axis, section = min(config.s7_axes.items(), key=lambda item: not item[1].drive)
        self.drive = section.drive
        kind = OBJECTS[section.type]
        self._paths = {path for variable in variables_of(kind) for path in elements(variable)}

    def on_bench(self, **values: Json) -> Table:
        return {"bench": values}

    def on_drive(self, **values: Json) -> Table:
        return {"drive": {self.drive: values}}

    def variables(self, values: Mapping[str, Json]) -> Table:
        """Return the values that the type of the axis has: a speed axis has no lead and no encoder."""
        own = {path: value for path, value in values.items() if path in self._paths}
        return {"axis": {self.axis: {"variables": own}}}

    def on_axis(self, **values: Json) -> Table:
        return {"axis": {self.axis: values}}


def _one(build: Callable[..., Table], key: str, *values: Json) -> Part:
    """Return tables with one key."""
    return st.sampled_from(values).map(lambda value: build(**{key: value}))


def _variable(tables: _Tables, path: str, *values: Json) -> Part:
    return st.sampled_from(values).map(lambda value: tables.variables({path: value}))


def _controller(tables: _Tables, config: BenchConfig) -> dict[str, Part]:
    cycle = config.bench.cycle_ms
    parts = {
        "program": _one(tables.on_bench, "program_cycles", 2, 3),
        "grace": _one(tables.on_bench, "grace_cycles", 1, 2, 10),
        "cpu": _one(tables.on_bench, "cpu", "S7-1500", "S7-1200 G2", "S7-1500T V8", "S7-1500T V7"),
        "servo": _one(tables.on_bench, "servo_period_us", 125, 500),
    }
    if 4 * cycle <= 32:
        parts["interpolator"] = _one(tables.on_bench, "interpolator_ms", 2 * cycle, 4 * cycle)
    if config.drive[tables.drive].bus == "can":
        parts["cycle"] = _one(tables.on_bench, "cycle_ms", 2, 4, 8)
    return parts


def _dynamics(tables: _Tables) -> dict[str, Part]:
    ramps = ("DynamicDefaults.Acceleration", "DynamicDefaults.Deceleration")
    return {
        "jerk": st.sampled_from([(0.0, 20000.0), (2000.0, 2000.0), (50000.0, 100000.0)]).map(
            lambda two: tables.variables({"DynamicDefaults.Jerk": two[0], "DynamicLimits.MaxJerk": two[1]})
        ),
        "dynamics": st.sampled_from([200.0, 500.0, 2000.0]).map(
            lambda value: tables.variables(dict.fromkeys(ramps, value))
        ),
        "emergency": _variable(tables, "DynamicDefaults.EmergencyDeceleration", 500.0, 1000.0, 8000.0),
        "override": _variable(tables, "Override.Velocity", 10.0, 120.0),
        "control": st.tuples(st.sampled_from([2.0, 10.0, 30.0]), st.sampled_from([0.0, 50.0, 100.0])).map(
            lambda two: tables.variables({"PositionControl.Kv": two[0], "PositionControl.Kpc": two[1]})
        ),
    }


def _positions(tables: _Tables) -> dict[str, Part]:
    homing = st.tuples(st.integers(0, 2), st.integers(0, 1), st.booleans(), st.booleans())
    return {
        UNITS: st.sampled_from(_LENGTHS).map(lambda two: {"length": two[0], "velocity": two[1]}),
        "modulo": st.tuples(st.sampled_from([100.0, 360.0, 1000.0]), st.sampled_from([0.0, -50.0])).map(
            lambda two: tables.variables(
                {"Modulo.Enable": True, "Modulo.Length": two[0], "Modulo.StartValue": two[1]}
            )
        ),
        "following error": _variable(tables, "FollowingError.EnableMonitoring", False),
        "software limits": st.tuples(st.sampled_from([40.0, 150.0, 500.0]), st.integers(0, 1)).map(
            lambda two: tables.variables(
                {
                    "PositionLimits_SW.Active": True,
                    "PositionLimits_SW.MinPosition": -two[0],
                    "PositionLimits_SW.MaxPosition": two[0],
                    "PositionLimits_SW.LimitReachedBehavior": two[1],
                }
            )
        ),
        "hardware limits": st.tuples(st.booleans(), st.integers(0, 1)).map(
            lambda two: tables.variables(
                {"PositionLimits_HW.Active": two[0], "PositionLimits_HW.ApproachBehavior": two[1]}
            )
        ),
        "homing": homing.map(
            lambda how: tables.variables(
                {
                    "Sensor[1].ActiveHoming.Mode": how[0],
                    "Sensor[1].ActiveHoming.Direction": how[1],
                    "Sensor[1].ActiveHoming.SideInput": how[2],
                    "Homing.AutoReversal": how[3],
                }
            )
        ),
        "type": st.just(tables.on_axis(type="synchronous")),
        "inputs": st.just(tables.on_axis(inputs_update="program")),
        "quantization": _variable(tables, "PositionControl.ControlDifferenceQuantization.Mode", 1),
    }


def _machine(tables: _Tables, drive: DriveTable) -> dict[str, Part]:
    parts: dict[str, Part] = {}
    if drive.profile != "analog":
        parts["ramps"] = st.tuples(st.sampled_from([0.2, 3.0]), st.sampled_from([0.1, 2.0])).map(
            lambda two: tables.on_drive(off1_ramp_s=two[0], off3_ramp_s=two[1])
        )
    if drive.profile != "tm_pto":  # a stepper motor has no torque to spare
        parts["machine"] = st.sampled_from(_MACHINES).map(lambda table: tables.on_drive(mechanics=table))
        parts["lead and gear"] = st.just(
            {
                **tables.on_drive(mechanics={"lead_screw_mm": 20.0, "gear_numerator": 2}),
                **tables.variables({"Mechanics.LeadScrew": 20.0, "LoadGear.Numerator": 2}),
            }
        )
        parts["switches"] = st.just(tables.on_drive(switches={"input_filter_ms": 20.0}))
    return parts


def _resolution(tables: _Tables, steps: str, increments: tuple[int, ...]) -> Part:
    return st.sampled_from(increments).map(
        lambda count: {
            **tables.on_drive(increments_per_revolution=count),
            **tables.variables({steps: count}),
        }
    )


def _cia402(tables: _Tables) -> dict[str, Part]:
    from emulators.drive.cia402.personality import personality_names

    on_drive = tables.on_drive
    return {
        "personality": _one(on_drive, "personality", *personality_names()),
        "resolution": _resolution(tables, "Sensor[1].Parameter.StepsPerRevolution", (4096, 20000, 1048576)),
        "encoder": _one(on_drive, "encoder", "absolute"),
        "heartbeat": st.sampled_from([{"heartbeat_ms": 0}, {"heartbeat_ms": 0, "guard_time_ms": 50}]).map(
            lambda table: on_drive(**table)
        ),
        "sync loss": _one(on_drive, "sync_loss", "fault", "warning", "none"),
        "missing setpoints": _one(on_drive, "missing_setpoints", 0, 1, 5),
        "interpolation": _one(on_drive, "csv_interpolation", False),
        "precontrol": _one(on_drive, "torque_precontrol", False),
        "power on": _one(on_drive, "power_on_delay_ms", 50.0),
        "boot": _one(on_drive, "boot_time_ms", 100.0),
        "drive error": _one(on_drive, "following_error", "fault", "status"),
        "safety": _one(on_drive, "safety", {"sto": "fault"}, {"ss1_monitored": False}),
        "brake": st.just(
            on_drive(brake={"torque_nm": 5.0, "opening_time_ms": 30.0, "closing_time_ms": 30.0})
        ),
        "reaction": _variable(tables, "Actor.RemoveEnableReaction", 1, 3, 5),
    }


def _profidrive(tables: _Tables, drive: DriveTable, *, on_can: bool) -> dict[str, Part]:
    def own(**values: Json) -> Table:
        return tables.on_drive(profidrive=values)

    parts = {
        "resolution": _resolution(tables, "Sensor[1].Parameter.StepsPerRevolution", (512, 2500, 8192)),
        "telegram": _one(tables.on_drive, "telegram", 3, 5, 102, 105, *((103,) if on_can else ())),
        "sign of life": st.one_of(
            _one(own, "sign_of_life", False), _one(own, "sign_of_life_tolerance", 5, 65535)
        ),
        "ramp generator": st.just(own(operating_mode=1, ramp_up_s=0.5)),
        "interpolation": st.just(own(interpolation=False)),
        "encoder": _one(tables.on_drive, "encoder", "absolute"),
        "setpoints": _one(own, "setpoint_monitoring_ms", 0.0, 50.0),
        "reaction": _variable(tables, "Actor.RemoveEnableReaction", 1, 3, 5),
        "reference": st.sampled_from([3000.0, 6000.0]).map(lambda rpm: own(reference_speed_rpm=rpm)),
    }
    parts["velocity"] = _variable(tables, "Sensor[1].ActualVelocityMode", 1)
    if on_can:
        # Over Modbus the transfer takes longer than an axis may need to come up, and a register map has no
        # space for more words.
        parts["transfer"] = st.just(tables.variables({"Actor.DataAdaption": 1, "Sensor[1].DataAdaption": 1}))
        parts["supplement"] = st.one_of(
            _one(own, "torque_telegram", True), _one(own, "safety_telegram", 700, 701)
        )
    if isinstance(drive, ProfidriveCanTable) and drive.telegram in {5, 105}:
        parts["position control"] = _variable(tables, "PositionControl.EnableDSC", True)
    return parts


def _parts(config: BenchConfig) -> dict[str, Part]:
    """Return the parts of a configuration for a technology object and its drive, by name."""
    tables = _Tables(config)
    drive = config.drive[tables.drive]
    axis = config.s7_axes[tables.axis]
    parts = {**_controller(tables, config), **_machine(tables, drive)}
    if axis.type != "speed":
        parts.update(_dynamics(tables))
        parts.update(_positions(tables))
        codes = (axis.variables.get("Units.LengthUnit", 1013), axis.variables.get("Units.VelocityUnit", 1062))
        if codes != (1013, 1062):
            del parts[UNITS]
    if drive.profile == "cia402":
        parts.update(_cia402(tables))
    elif drive.profile == "profidrive":
        parts.update(_profidrive(tables, drive, on_can=drive.bus == "can"))
    return parts


def configurations(config: BenchConfig) -> SearchStrategy[Configuration]:
    """Return a strategy of configurations for the first axis of a bench and its drive.

    Parts are drawn independently of each other; some do not go together, and then the bench file is refused
    when it is built.

    Args:
        config: The content of the bench file (`BenchFile.config`).

    """
    parts = nc_configurations(config) if config.nc_axes else _parts(config)
    order = list(parts)

    def of(chosen: list[str]) -> SearchStrategy[Configuration]:
        # In one order, whatever the order of drawing: the same parts are the same program.
        return st.fixed_dictionaries({name: parts[name] for name in order if name in chosen}).map(
            Configuration
        )

    return st.lists(st.sampled_from(order), max_size=5, unique=True).flatmap(of)
