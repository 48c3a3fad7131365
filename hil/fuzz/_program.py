"""Fuzz programs: lists of steps (jobs, faults, waits) as JSON values."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any, Final

from fieldbus.errors import ConfigurationError
from hil.bench.units import MILLIMETRES, UnitScale
from hil.errors import CannotRunError
from hil.faults import Fault, Parameter
from hil.fuzz._configuration import Configuration
from hil.fuzz._device_jobs import DEVICE_JOBS
from hil.fuzz._nc_jobs import COUPLED, NC_JOBS
from hil.fuzz._s7_jobs import INSTRUCTIONS, inputs_of, is_complete, jobs_of
from motion.nc.handles import NcAxisHandle
from motion.s7.handles import AxisHandle
from reports.json_types import JsonObject

if TYPE_CHECKING:
    from fieldbus.history import Scalar
    from hil.bench.bench import Bench
    from motion.s7.variables import Variable as Definition

_HOW: Final = (
    Parameter(
        "jerk", "float", "Jerk; < 0: default of the axis, 0: trapezoid", "mm/s3", -1.0, 1e9, default=-1.0
    ),
    Parameter("buffer", "int", "BufferMode", minimum=0, maximum=1, default=0),
)
_LEADER: Final = (
    Parameter("leader", "text", "Leading object: an axis or an external encoder, by name", required=True),
)
_RATIO: Final = (
    Parameter("numerator", "int", "RatioNumerator", minimum=-1000, maximum=1000, default=1),
    Parameter("denominator", "int", "RatioDenominator", minimum=1, maximum=1000, default=1),
)
_DISTANCE: Final = Parameter("distance", "float", "Way of the leading value", "mm", 0.001, 1e6, default=20.0)
_STOP_POSITION: Final = Parameter("position", "float", "Stop position", "mm", -1e6, 1e6, required=True)


def _profile(known: tuple[int, ...]) -> Parameter:
    words = ", ".join(map(str, known))
    return Parameter(
        "profile", "int", f"SyncProfileReference: {words}", minimum=0, maximum=max(known), default=1
    )


REMOVE_FAULTS: Final = "remove_faults"
ASSIGN: Final = "assign"
LET_GO: Final = "let_go"
_SHORT: Final[dict[str, tuple[Parameter, ...]]] = {
    "power_on": (),
    "power_off": (Parameter("stop_mode", "int", "StopMode", minimum=0, maximum=3, default=0),),
    "reset": (),
    "home": (
        Parameter("position", "float", "Home position", "mm", -1e6, 1e6, default=0.0),
        Parameter("mode", "int", "Mode", minimum=0, maximum=13, default=0),
    ),
    "move_absolute": (
        Parameter("position", "float", "Target", "mm", -1e6, 1e6, required=True),
        Parameter("velocity", "float", "Velocity", "mm/s", 0.001, 1e6, default=100.0),
        *_HOW,
    ),
    "move_relative": (
        Parameter("distance", "float", "Distance", "mm", -1e6, 1e6, required=True),
        Parameter("velocity", "float", "Velocity", "mm/s", 0.001, 1e6, default=100.0),
        *_HOW,
    ),
    "move_velocity": (
        Parameter("velocity", "float", "Velocity, signed", "mm/s", -1e6, 1e6, required=True),
        Parameter(
            "jerk", "float", "Jerk; < 0: default of the axis, 0: trapezoid", "mm/s3", -1.0, 1e9, default=-1.0
        ),
    ),
    "move_superimposed": (
        Parameter("distance", "float", "Distance", "mm", -1e6, 1e6, required=True),
        Parameter("velocity", "float", "Greatest velocity difference", "mm/s", 0.001, 1e6, default=100.0),
    ),
    "halt_superimposed": (),
    "motion_in_velocity": (
        Parameter("velocity", "float", "Velocity, signed", "mm/s", -1e6, 1e6, required=True),
    ),
    "motion_in_release": (),
    "torque_limiting": (
        Parameter("limit", "float", "Torque limit; < 0: default of the axis", "Nm", -1.0, 1e6, default=-1.0),
    ),
    "torque_release": (),
    "override": (Parameter("factor", "float", "Velocity override", "%", 0.0, 200.0, required=True),),
    "jog": (
        Parameter("velocity", "float", "Velocity", "mm/s", 0.0, 1e6, default=100.0),
        Parameter("backward", "bool", "Direction", default=False),
    ),
    "jog_release": (),
    "halt": (),
    "stop": (Parameter("mode", "int", "Mode", minimum=0, maximum=3, default=0),),
    "stop_release": (),
    REMOVE_FAULTS: (),
    "gear_in": (*_LEADER, *_RATIO),
    "gear_in_velocity": (*_LEADER, *_RATIO),
    "gear_in_pos": (
        *_LEADER,
        *_RATIO,
        Parameter(
            "master", "float", "Leading position that belongs to `slave`", "mm", -1e6, 1e6, default=0.0
        ),
        Parameter("slave", "float", "Following position", "mm", -1e6, 1e6, default=0.0),
        _profile((0, 1, 3, 4)),
        _DISTANCE,
    ),
    "gear_out": (_STOP_POSITION, _profile((0, 1)), _DISTANCE),
    "cam_in": (
        *_LEADER,
        Parameter("cam", "text", "Name of the cam", required=True),
        Parameter("mode", "int", "ApplicationMode", minimum=0, maximum=2, default=1),
        _profile((0, 1, 2, 3, 4, 5, 6)),
        _DISTANCE,
    ),
    "cam_out": (_STOP_POSITION, _profile((0, 1)), _DISTANCE),
    "interpolate": (Parameter("cam", "text", "Name of the cam", required=True),),
    "phasing": (Parameter("shift", "float", "PhaseShift, relative", "mm", -1e6, 1e6, required=True),),
    "offset": (
        Parameter("offset", "float", "Offset, relative", "mm", -1e6, 1e6, required=True),
        _DISTANCE,
    ),
    "leading_value_additive": (
        Parameter("position", "float", "Added to the leading value", "mm", -1e6, 1e6, required=True),
    ),
    "additive_release": (),
}
"""Steps with parameters of their own, in mm and s."""
SYNCHRONOUS: Final = tuple(_SHORT)[tuple(_SHORT).index("gear_in") :]
"""Those of a technology object that follows others."""
_INSTRUCTION: Final = {
    "jog": "move_jog",
    "phasing": "phasing_relative",
    "offset": "offset_relative",
    "interpolate": "interpolate_cam",
}
"""Step -> the name that its instruction has among all of them, where that is another one."""


def instruction_of(job: str) -> str:
    """Return the name that the instruction of a step has among `INSTRUCTIONS`; empty: it has none."""
    name = _INSTRUCTION.get(job, job)
    return name if name in INSTRUCTIONS else ""


def _with_inputs(job: str, short: tuple[Parameter, ...]) -> tuple[Parameter, ...]:
    instruction = instruction_of(job)
    return (*short, *inputs_of(instruction)) if instruction else short


_S7_JOBS: Final[dict[str, tuple[Parameter, ...]]] = {
    **{job: _with_inputs(job, short) for job, short in _SHORT.items()},
    **{job: inputs_of(job) for job in INSTRUCTIONS if is_complete(job) and job not in _SHORT},
    ASSIGN: (
        Parameter("path", "text", "Variable of the technology data block", required=True),
        Parameter("value", "float", "In the unit of the variable", required=True),
    ),
    LET_GO: (
        Parameter(
            "job",
            "text",
            "Step whose last instance gets Execute, Enable and the jog inputs FALSE",
            required=True,
        ),
    ),
}
JOBS: Final[dict[str, tuple[Parameter, ...]]] = {**_S7_JOBS, **NC_JOBS, **DEVICE_JOBS}
"""Instructions of a program, with their parameters: for technology objects, for NC axes, and what is asked
of devices.
"""
DERIVED: Final = frozenset(_S7_JOBS) - frozenset(_SHORT)
"""Instructions of technology objects that have the inputs of their definition alone."""

_ASSIGNED: Final = ("DIR", "CAL")
"""Classes of access of variables that the program may assign while the object runs."""
_NEEDS: Final = {
    "move_superimposed": "move_superimposed",
    "halt_superimposed": "halt_superimposed",
    "motion_in_velocity": "motion_in_velocity",
    "motion_in_release": "motion_in_velocity",
    "torque_limiting": "torque_limiting",
    "torque_release": "torque_limiting",
    "override": "write",
}
"""Instruction -> what an axis handle has to have for it; all have the others."""


def job_names(axis: object) -> tuple[str, ...]:
    """Return the instructions that an axis can be given by itself, in the order of `JOBS`.

    Args:
        axis: Handle of the axis, `bench.axis()`.

    """
    if isinstance(axis, NcAxisHandle):
        return (*(job for job in NC_JOBS if job not in COUPLED), REMOVE_FAULTS)
    # A user's own axis says by its methods what it knows.
    known = jobs_of(axis.object) if isinstance(axis, AxisHandle) else None

    def has(job: str) -> bool:
        if job in DERIVED:
            if known is None or job == LET_GO:
                return known is not None
            # power_on and power_off keep one instance.
            return job in known and job not in {"power", *_INSTRUCTION.values()}
        instruction = instruction_of(job)
        if known is not None and instruction and is_complete(instruction) and instruction not in known:
            return False
        return job not in SYNCHRONOUS and (job not in _NEEDS or hasattr(axis, _NEEDS[job]))

    return tuple(job for job in _S7_JOBS if has(job))


@dataclass(frozen=True)
class Participant:
    """An axis of a bench whose programs give instructions to several."""

    axis: str
    drive: str
    jobs: tuple[str, ...]
    """What it can be given by itself, as of `job_names`."""
    leaders: tuple[str, ...] = ()
    """What it may follow."""
    cams: tuple[str, ...] = ()
    """Cams that it may follow them by."""


def participants(bench: Bench, count: int) -> tuple[Participant, ...]:
    """Return the first `count` axes of a bench.

    Raises:
        CannotRunError: The bench has fewer.

    """
    names = (*bench.axis_names, *bench.nc_axis_names)
    if not 1 <= count <= len(names):
        raise CannotRunError(f"{count} axes are not possible: the bench has {len(names)}: {', '.join(names)}")
    found = []
    for name in names[:count]:
        axis: object = bench.axis(name)
        if isinstance(axis, NcAxisHandle):
            leaders = tuple(other for other in names[:count] if other != name)
        else:
            leaders = tuple(one.name for one in getattr(bench.axis(name).object, "leading_objects", ()))
        found.append(
            Participant(
                name,
                bench.drive_of(name),
                job_names(axis),
                leaders,
                tuple(bench.cam_names) if leaders else (),
            )
        )
    return tuple(found)


@dataclass(frozen=True)
class ObjectWithoutMotion:
    """A technology object that is no axis: an external encoder, a measuring input, a cam, a proxy."""

    name: str
    jobs: tuple[str, ...]
    """Instructions that it knows."""


def is_own(bench: object) -> bool:
    """Return whether a bench is made of a bench file, and not a user's own that has what programs need."""
    from hil.bench.bench import Bench as OwnBench

    return isinstance(bench, OwnBench)


def objects_of(bench: Bench) -> tuple[ObjectWithoutMotion, ...]:
    """Return the technology objects of a bench that are no axes."""
    found: list[Any] = [
        *(bench.external_encoder(name) for name in bench.external_encoder_names),
        *(bench.measuring_input(name) for name in bench.measuring_input_names),
        *(bench.cam(name) for name in bench.cam_names),
        *(bench.proxy(name) for name in bench.proxy_names),
    ]
    return tuple(ObjectWithoutMotion(one.name, jobs_of(one.object)) for one in found)


@dataclass(frozen=True)
class Variable:
    """A variable of an axis that the program may assign."""

    axis: str
    path: str
    values: tuple[float, ...]
    """What it is given."""


def variables_of(bench: Bench, names: Sequence[str]) -> tuple[Variable, ...]:
    """Return the variables of technology objects that a program may assign while they run."""
    found = []
    for name in names:
        axis: object = bench.axis(name)
        if not isinstance(axis, AxisHandle):
            continue
        store = axis.variables
        for path in store.paths():
            if store.describe(path).access not in _ASSIGNED:
                continue
            values = _others_for(store.describe(path), store.start_value(path))
            if values:
                found.append(Variable(name, path, values))
    return tuple(found)


def _others_for(variable: Definition, start: float) -> tuple[float, ...]:
    """Return values for a variable: others of a kind that has names, and parts and multiples of a number."""
    if variable.data_type == "BOOL":
        return (0.0, 1.0)
    if variable.enum:
        return tuple(float(one) for one in variable.enum)
    if variable.data_type != "LREAL" or not start:
        return ()
    low, high = variable.limits(0)
    tried = (start, start * 0.5, start * 1.5, start * 0.9)
    return tuple(one for one in tried if (low is None or one >= low) and (high is None or one <= high))


LONGEST_WAIT_S: Final = 60.0
_CONFIGURATION: Final = "configuration"


@dataclass(frozen=True)
class Do:
    """Give an instruction."""

    job: str
    parameters: Mapping[str, Scalar] = field(default_factory=dict)
    axis: str = ""
    """Name of the axis; empty: the first one."""

    def __post_init__(self) -> None:
        known = JOBS.get(self.job)
        if known is None:
            raise ConfigurationError("step.do", self.job, ", ".join(JOBS))
        names = {parameter.name: parameter for parameter in known}
        for name, value in self.parameters.items():
            if name not in names:
                raise ConfigurationError(
                    f"step {self.job}.{name}", value, ", ".join(names) or "no parameters"
                )
            names[name].check(f"step {self.job}", value)
        for parameter in known:
            if parameter.required and parameter.name not in self.parameters:
                raise ConfigurationError(f"step {self.job}.{parameter.name}", None, parameter.allowed)

    def value(self, name: str, scale: UnitScale = MILLIMETRES) -> float:
        """Return a parameter, or its default, as a number for an axis with these units."""
        parameter = next(one for one in JOBS[self.job] if one.name == name)
        value = self.parameters.get(name, parameter.default)
        if not isinstance(value, int | float):
            raise ConfigurationError(f"step {self.job}.{name}", value, parameter.allowed)
        if name == "jerk" and value < 0.0:
            return value  # the default of the axis
        factor = scale.of(parameter.unit)
        return value if factor == 1.0 else value * factor

    def text(self, name: str) -> str:
        """Return a parameter that is a name."""
        return str(self.parameters[name])

    def to_json(self) -> JsonObject:
        """Return the step as JSON values."""
        where: JsonObject = {"axis": self.axis} if self.axis else {}
        return {"do": self.job, **where, **self.parameters}

    def __str__(self) -> str:
        units = {parameter.name: parameter.unit for parameter in JOBS[self.job]}
        details = ", ".join(
            f"{name} = {value if isinstance(value, str) else f'{value:g}'} {units[name]}".rstrip()
            for name, value in self.parameters.items()
        )
        where = f"{self.axis}: " if self.axis else ""
        return f"{where}{self.job} {details}".rstrip()


@dataclass(frozen=True)
class Wait:
    """Let bench time pass."""

    seconds: float

    def __post_init__(self) -> None:
        if not 0 <= self.seconds <= LONGEST_WAIT_S:
            raise ConfigurationError("step.wait", self.seconds, f"0..{LONGEST_WAIT_S:g} s")

    def to_json(self) -> JsonObject:
        """Return the step as JSON values."""
        return {"wait": self.seconds}

    def __str__(self) -> str:
        return f"wait {self.seconds:g} s"


@dataclass(frozen=True)
class Break:
    """Arm a fault."""

    fault: Fault

    def to_json(self) -> JsonObject:
        """Return the step as JSON values."""
        return {"fault": self.fault.to_dict()}

    def __str__(self) -> str:
        return f"fault {self.fault}"


Step = Do | Wait | Break


def for_axis(step: Step, axis: str) -> Step:
    """Return a step whose instruction is for an axis; empty: for the one that it is for."""
    return replace(step, axis=axis) if isinstance(step, Do) and axis else step


def step_from_json(content: object, where: str = "step") -> Step:
    """Build a step from JSON values.

    Raises:
        ConfigurationError: It is no step; the message says which key is wrong.

    """
    if not isinstance(content, Mapping):
        raise ConfigurationError(where, content, "an object with do, wait or fault")
    if "fault" in content and len(content) == 1:
        return Break(Fault.from_dict(content["fault"], f"{where}.fault"))
    if "wait" in content and len(content) == 1:
        seconds = content["wait"]
        if not isinstance(seconds, (int, float)) or isinstance(seconds, bool):
            raise ConfigurationError(f"{where}.wait", seconds, "a number of seconds")
        return Wait(float(seconds))
    if isinstance(content.get("do"), str):
        axis = content.get("axis", "")
        if not isinstance(axis, str):
            raise ConfigurationError(f"{where}.axis", axis, "the name of an axis")
        given = {key: value for key, value in content.items() if key not in ("do", "axis")}
        return Do(content["do"], given, axis)
    raise ConfigurationError(where, dict(content), "an object with do, wait or fault")


@dataclass(frozen=True)
class Program:
    """A list of steps, and the configuration of the bench that they are done on."""

    steps: tuple[Step, ...]
    configuration: Configuration = field(default_factory=Configuration)
    """What is laid over the bench file first."""

    def to_json(self) -> list[JsonObject]:
        """Return the program as JSON values: the configuration, if there is one, is in front of the steps."""
        head: list[JsonObject] = (
            [{_CONFIGURATION: self.configuration.to_json()}] if self.configuration else []
        )
        return [*head, *(step.to_json() for step in self.steps)]

    @classmethod
    def from_json(cls, content: object) -> Program:
        """Build a program from JSON values; `ConfigurationError` names the step that is wrong."""
        if not isinstance(content, Iterable) or isinstance(content, (str, Mapping)):
            raise ConfigurationError("program", content, "a list of steps")
        steps = list(content)
        configuration, first = Configuration(), 0
        if steps and isinstance(steps[0], Mapping) and set(steps[0]) == {_CONFIGURATION}:
            configuration, first = Configuration.from_json(steps[0][_CONFIGURATION]), 1
        places = range(first, len(steps))
        return cls(
            tuple(step_from_json(steps[place], f"program[{place}]") for place in places), configuration
        )

    @property
    def name(self) -> str:
        """Identifier made from the content."""
        text = json.dumps(self.to_json(), sort_keys=True, separators=(",", ":"))
        return f"fuzz/{hashlib.sha256(text.encode()).hexdigest()[:12]}"

    def __str__(self) -> str:
        width = len(str(len(self.steps)))
        lines = [f"{number:{width}}. {step}" for number, step in enumerate(self.steps, 1)]
        return "\n".join([*self.configuration.lines(), *lines])
