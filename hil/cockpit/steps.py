"""The steps of a session: what an operator does with a bench, as values with a time."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Final, Protocol

from fieldbus.errors import ConfigurationError, UnknownNameError
from hil.faults import Fault, Injector

if TYPE_CHECKING:
    from collections.abc import Callable

    from fieldbus.history import Scalar
    from fieldbus.profidrive import TypeCode
    from hil.bench.bench import Bench
    from hil.faults import ArmedFault
    from motion.s7.commissioning import ControlPanel
    from reports.json_types import JsonObject

COMMANDS: Final[Mapping[str, tuple[str, ...]]] = {
    "power": ("enable",),
    "power_when_ready": (),
    "reset": (),
    "home": ("position",),
    "set_position": ("position",),
    "move_absolute": ("position",),
    "move_relative": ("distance",),
    "move_velocity": ("velocity",),
    "move_superimposed": ("distance",),
    "jog": ("velocity",),
    "gear_in": ("leader",),
    "gear_in_velocity": ("leader",),
    "gear_out": ("position",),
    "cam_in": ("leader", "cam"),
    "cam_out": ("position",),
    "phasing_relative": ("shift",),
    "offset_relative": ("offset", "distance"),
    "halt": (),
    "stop": ("mode",),
}
"""Methods of an axis that a session may call, with the inputs that are given without their names."""


def _given(inputs: Mapping[str, Scalar]) -> str:
    """Return inputs with their values, for a list of steps."""
    return ", ".join(f"{name} = {value}" for name, value in inputs.items())


@dataclass(frozen=True)
class Command:
    """An instruction to an axis: a method of its handle.

    Raises:
        UnknownNameError: A session has no such command.

    """

    axis: str
    name: str
    """One of `COMMANDS`."""
    inputs: Mapping[str, Scalar] = field(default_factory=dict)
    """By name; leading objects and cams by their names on the bench."""

    def __post_init__(self) -> None:
        if self.name not in COMMANDS:
            raise UnknownNameError("step.command", self.name, "a command", COMMANDS)

    def __str__(self) -> str:
        return f"{self.axis}: {self.name.replace('_', ' ')} {_given(self.inputs)}".rstrip()


@dataclass(frozen=True)
class SetInputs:
    """Inputs of the instance that an earlier step has started: the end of jogging, for example."""

    step: int
    """Number of that step, from 0."""
    inputs: Mapping[str, Scalar]

    def __str__(self) -> str:
        return f"step {self.step + 1}: {_given(self.inputs)}"


@dataclass(frozen=True)
class WriteVariable:
    """A variable of an axis that is assigned."""

    axis: str
    path: str
    value: float

    def __str__(self) -> str:
        return f"{self.axis}: {self.path} = {self.value:g}"


@dataclass(frozen=True)
class WriteObject:
    """An entry of the dictionary of a node that is written by SDO."""

    node: str
    index: int
    sub: int
    data: bytes

    def __str__(self) -> str:
        return f"{self.node}: {self.index:04X}h.{self.sub:02X}h = {self.data.hex(' ')}"


@dataclass(frozen=True)
class InterpolateCam:
    """A cam that is interpolated, so that an axis can follow by it."""

    cam: str

    def __str__(self) -> str:
        return f"cam {self.cam}: interpolate"


@dataclass(frozen=True)
class WriteParameter:
    """An element of a parameter of a drive on Modbus that is written by data record 47."""

    node: str
    number: int
    """PNU."""
    index: int
    code: TypeCode
    value: float

    def __str__(self) -> str:
        return f"{self.node}: p{self.number:04}[{self.index}] = {self.value:g}"


@dataclass(frozen=True)
class Inject:
    """A fault that is armed."""

    fault: Fault

    def __str__(self) -> str:
        return f"fault {self.fault}"


@dataclass(frozen=True)
class TakeBack:
    """A fault that is taken back, or disarmed."""

    step: int
    """Number of the step that armed it, from 0."""

    def __str__(self) -> str:
        return f"take back the fault of step {self.step + 1}"


@dataclass(frozen=True)
class Remark:
    """Something that a test only mentions: what was waited for, or a command that it has no line for."""

    text: str

    def __str__(self) -> str:
        return self.text


Step = (
    Command
    | SetInputs
    | WriteVariable
    | WriteObject
    | WriteParameter
    | InterpolateCam
    | Inject
    | TakeBack
    | Remark
)


@dataclass(frozen=True)
class TimedStep:
    """A step and when it was done."""

    time_ns: int
    step: Step

    def to_dict(self, number: int) -> JsonObject:
        """Return number, time and text for a list of steps."""
        kind = type(self.step).__name__
        return {"number": number, "time_s": self.time_ns * 1e-9, "kind": kind, "text": str(self.step)}


class Performer:
    """Does steps on a bench, and keeps what later steps refer to.

    Args:
        bench: The bench.
        injector: Arms its faults; None: one of its own.

    """

    def __init__(self, bench: Bench, injector: Injector | None = None) -> None:
        self._bench = bench
        self.injector = Injector(bench) if injector is None else injector
        self.made: list[Any] = []
        """What each step has made: the instance of a command, the armed fault, the SDO job; else None."""

    def perform(self, step: Step) -> Any:
        """Do a step and return what it made.

        Raises:
            HilError: The bench refuses it; the message says why. Such a step has not been done.

        """
        made = self._perform(step)
        self.made.append(made)
        return made

    def follow(self, made: object) -> None:
        """Note what a step has made that somebody else has done."""
        self.made.append(made)

    def _perform(self, step: Step) -> Any:
        bench = self._bench
        match step:
            case Command():
                return self._command(step)
            case SetInputs():
                self._earlier(step.step).set(**step.inputs)
            case WriteVariable():
                bench.axis(step.axis).write(step.path, step.value)
            case WriteObject():
                return bench.node(step.node).sdo.download(step.index, step.sub, step.data)
            case InterpolateCam():
                return bench.cam(step.cam).interpolate()
            case WriteParameter():
                transfer = ParameterTransfer()
                port = parameter_port(bench, step.node)
                port.write_parameter(step.number, step.index, step.code, step.value, transfer.answer)
                return transfer
            case Inject():
                return self.injector.arm(step.fault)
            case TakeBack():
                armed: ArmedFault = self._earlier(step.step)
                armed.remove()
            case Remark():
                pass
        return None

    def _earlier(self, number: int) -> Any:
        if not 0 <= number < len(self.made) or self.made[number] is None:
            raise ConfigurationError("step", number + 1, "the number of an earlier step that made something")
        return self.made[number]

    def _command(self, step: Command) -> Any:
        axis = self._bench.axis(step.axis or None)
        method: Callable[..., Any] = getattr(axis, step.name)
        inputs: dict[str, Any] = dict(step.inputs)
        if "leader" in inputs:
            inputs["leader"] = leading_object(self._bench, str(inputs["leader"]))
        if "cam" in inputs:
            inputs["cam"] = self._bench.cam(str(inputs["cam"]))
        positional = [inputs.pop(name) for name in COMMANDS[step.name] if name in inputs]
        return method(*positional, **inputs)


class ParameterPort(Protocol):
    """A drive whose parameters the controller reads and writes by data record 47."""

    has_parameters: bool

    def read_parameter(self, number: int, index: int, answer: Callable[[float | None, str], object]) -> None:
        """Read an element."""

    def write_parameter(
        self, number: int, index: int, code: int, value: float, answer: Callable[[float | None, str], object]
    ) -> None:
        """Write an element."""


class ParameterTransfer:
    """An access to a parameter that has begun."""

    def __init__(self) -> None:
        self.value: float | None = None
        """What was read or written."""
        self.reason = ""
        """Why it failed."""
        self._ended = False

    def answer(self, value: float | None, reason: str) -> None:
        """Take the answer of the drive."""
        self.value, self.reason, self._ended = value, reason, True

    def done(self) -> bool:
        """Return whether it has ended."""
        return self._ended

    @property
    def ok(self) -> bool:
        """Whether the drive has carried it out."""
        return self._ended and self.value is not None


def parameter_port(bench: Bench, node: str) -> ParameterPort:
    """Return the port to a drive on Modbus with a parameter channel.

    Raises:
        ConfigurationError: There is none of this name, or its register map has no such channel.

    """
    port: Any = bench.port(node)
    if not hasattr(port, "write_parameter") or not port.has_parameters:
        raise ConfigurationError("parameters", node, "a drive on Modbus with data record 47")
    return port  # type: ignore[no-any-return]


def leading_object(bench: Bench, name: str) -> Any:
    """Return the handle of what may lead an axis: an axis or an external encoder.

    Raises:
        ConfigurationError: There is none of this name.

    """
    return bench.external_encoder(name) if name in bench.external_encoder_names else bench.axis(name)


def panel_steps(panel: ControlPanel, command: str, value: float = 0.0, slider: float = 100.0) -> list[Step]:
    """Return what a user program does in place of a command of the control panel.

    Args:
        panel: The panel, with its dynamic values, before it gets the command.
        command: `enable`, `disable`, `acknowledge`, `jog`, `move_relative`, `move_absolute`, `home`,
            `set_position`, `adjust_encoder` or `stop`.
        value: Distance or position, axis unit.
        slider: Of the panel, -100 to 100 %.

    Raises:
        UnknownNameError: The panel has no such command, or it is none for a program.

    """
    axis = panel.axis
    name = axis.name
    read = axis.variables.read
    speed = min(panel.velocity * panel.adjust * 0.01, read("DynamicLimits.MaxVelocity")) * abs(slider) * 0.01
    dynamics: dict[str, Scalar] = {
        "Acceleration": min(panel.acceleration, read("DynamicLimits.MaxAcceleration")),
        "Deceleration": min(panel.deceleration, read("DynamicLimits.MaxDeceleration")),
        "Jerk": min(panel.jerk, read("DynamicLimits.MaxJerk")),
    }
    moving: dict[str, Scalar] = {"Velocity": speed, **dynamics}
    off = Command(name, "power", {"enable": False, "stop_mode": 2})
    greatest: dict[str, Scalar] = {
        "Deceleration": read("DynamicLimits.MaxDeceleration"),
        "Jerk": read("DynamicLimits.MaxJerk"),
    }
    forward = value if slider > 0.0 else -value
    direction: dict[str, Scalar] = {"Direction": 1 if slider > 0.0 else 2} if axis.modulo.enabled else {}
    found: dict[str, Sequence[Step]] = {
        "enable": [Command(name, "power", {"stop_mode": 2})],
        "disable": [off],
        "acknowledge": [*([off] if axis.enabling.alarmed else []), Command(name, "reset")],
        "jog": [Command(name, "jog", {"velocity": speed, "backward": slider < 0.0, **dynamics})],
        "move_relative": [Command(name, "move_relative", {"distance": forward, **moving})],
        "move_absolute": [Command(name, "move_absolute", {"position": value, **moving, **direction})],
        "home": [Command(name, "home", {"position": value, "mode": 3})],
        "set_position": [Command(name, "home", {"position": value})],
        "adjust_encoder": [Command(name, "home", {"position": value, "mode": 7})],
        "stop": [Command(name, "halt", greatest)],
    }
    if command not in found:
        raise UnknownNameError("panel command", command, "a command of a program", found)
    return list(found[command])
