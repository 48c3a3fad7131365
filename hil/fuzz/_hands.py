"""The hands of a program: they give its instructions to the axes of a bench."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Final, Protocol

from fieldbus.errors import ConfigurationError
from hil.bench.units import MILLIMETRES, UnitScale
from hil.fuzz._nc_hands import NcHands
from hil.fuzz._nc_jobs import NC_JOBS
from hil.fuzz._program import DERIVED, LET_GO, instruction_of, is_own
from hil.fuzz._s7_jobs import INSTRUCTIONS, STARTERS, jobs_of, values_of
from motion.nc.handles import NcAxisHandle

if TYPE_CHECKING:
    from collections.abc import Callable

    from hil.bench.bench import Bench
    from hil.fuzz._invariants import NamedJob
    from hil.fuzz._program import Do
    from motion.s7.cam_handle import CamHandle
    from motion.s7.handles import AxisHandle
    from motion.s7.instructions.base import Instruction


class Hands(Protocol):
    """Gives instructions to one axis."""

    def do(self, step: Do) -> None:
        """Give one.

        Raises:
            ConfigurationError: The axis has no such instruction, or an input cannot have its value.

        """


def hands_of(bench: Bench, name: str, watch: Callable[[NamedJob], object]) -> Hands:
    """Return the hands for an axis of a bench.

    Args:
        bench: The bench.
        name: Name of the axis; empty: the first one.
        watch: Takes every instance whose outputs are to be looked at.

    """
    handle = _object_without_motion(bench, name)
    if handle is not None:
        return ObjectHands(handle, watch=watch)
    axis: object = bench.axis(name or None)
    if isinstance(axis, NcAxisHandle):
        return NcHands(axis, master=lambda other: bench.axis(other, controller="nc").ref, watch=watch)

    def leader(other: str) -> Any:
        return bench.axis(other) if other in bench.axis_names else bench.external_encoder(other)

    def cam(other: str) -> CamHandle:
        return bench.cam(other)

    return TechnologyHands(bench.axis(name or None), leader=leader, cam=cam, watch=watch)


def _object_without_motion(bench: Bench, name: str) -> Any:
    """Return a technology object that is no axis, by name; None: it is one, or there is none."""
    if not name or not is_own(bench):
        return None
    if name in bench.external_encoder_names:
        return bench.external_encoder(name)
    if name in bench.measuring_input_names:
        return bench.measuring_input(name)
    if name in bench.cam_names:
        return bench.cam(name)
    return bench.proxy(name) if name in bench.proxy_names else None


def _start(job: str) -> dict[str, bool]:
    """Return the input that starts an instruction."""
    return {next(one for one in STARTERS if one in INSTRUCTIONS[job].inputs): True}


def _let_go(held: dict[str, Instruction], job: str) -> None:
    """Take the starting inputs of the last instance of an instruction away."""
    instance = held.pop(job, None)
    if instance is not None:
        instance.set(**{one: False for one in STARTERS if one in instance.inputs})


class ObjectHands:
    """Gives instructions to a technology object that is no axis.

    Args:
        handle: The technology object.
        watch: Takes every instance whose outputs are to be looked at.

    """

    def __init__(self, handle: Any, *, watch: Callable[[NamedJob], object]) -> None:
        self._handle = handle
        self._watch = watch
        self._held: dict[str, Instruction] = {}

    def do(self, step: Do) -> None:
        """Give an instruction."""
        if step.job == LET_GO:
            _let_go(self._held, step.text("job"))
            return
        if step.job not in jobs_of(self._handle.object):
            raise ConfigurationError(f"step {step.job}", self._handle.name, "an object that knows it")
        if step.job == "power":
            self._handle.power(bool(step.parameters.get("StartMode", 1)))
            return
        inputs = values_of(step.job, step.parameters, MILLIMETRES)
        job = self._handle.run(INSTRUCTIONS[step.job](self._handle.object))
        job.set(**_start(step.job), **inputs)
        self._held[step.job] = job
        self._watch(job)


_HOW: Final = {"jerk": "Jerk", "buffer": "BufferMode"}
"""Parameters that go to inputs only where a program names them: the others keep their defaults."""


class TechnologyHands:
    """Gives instructions to a technology object; keeps the instances that are released later.

    Args:
        axis: The technology object.
        leader: Returns what it may follow, by name.
        cam: Returns a cam by name.
        watch: Takes every instance whose outputs are to be looked at.

    """

    _RELEASES: Final = {
        "jog_release": ("jog", {"JogForward": False, "JogBackward": False}),
        "stop_release": ("stop", {"Execute": False}),
        "motion_in_release": ("motion_in_velocity", {"Enable": False}),
        "torque_release": ("torque_limiting", {"Enable": False}),
        "additive_release": ("leading_value_additive", {"Enable": False}),
    }

    def __init__(
        self,
        axis: AxisHandle,
        *,
        leader: Callable[[str], Any],
        cam: Callable[[str], CamHandle],
        watch: Callable[[NamedJob], object],
    ) -> None:
        self._axis = axis
        self._leader = leader
        self._cam = cam
        self._watch = watch
        self._held: dict[str, Instruction] = {}
        self._scale = UnitScale.of_axis(axis)

    def do(self, step: Do) -> None:
        """Give an instruction, or release one."""
        axis, scale = self._axis, self._scale

        def value(name: str) -> float:
            return step.value(name, scale)

        def whole(name: str) -> int:
            return int(step.value(name, scale))

        if step.job in NC_JOBS:
            raise ConfigurationError(f"step {step.job}", axis.name, "an axis of an NC")
        how = {key: value(name) for name, key in _HOW.items() if name in step.parameters}
        if step.job in self._RELEASES:
            of, inputs = self._RELEASES[step.job]
            held = self._held.pop(of, None)
            if held is not None:
                held.set(**inputs)
            return
        match step.job:
            case "power_on":
                axis.power(True)
                return
            case "power_off":
                axis.power(False, stop_mode=whole("stop_mode"))
                return
            case "override":
                axis.write("Override.Velocity", value("factor"))
                return
            case "assign":
                path, number = step.text("path"), value("value")
                real = axis.variables.describe(path).data_type == "LREAL"
                axis.write(path, number if real else int(number))
                return
            case "let_go":
                _let_go(self._held, step.text("job"))
                return
            case "reset":
                job: Instruction = axis.reset()
            case "home":
                job = axis.home(value("position"), mode=whole("mode"))
            case "move_absolute":
                job = axis.move_absolute(value("position"), Velocity=value("velocity"), **how)
            case "move_relative":
                job = axis.move_relative(value("distance"), Velocity=value("velocity"), **how)
            case "move_velocity":
                job = axis.move_velocity(value("velocity"), **how)
            case "move_superimposed":
                job = axis.move_superimposed(value("distance"), VelocityDiff=value("velocity"))
            case "halt_superimposed":
                job = axis.halt_superimposed()
            case "motion_in_velocity":
                job = axis.motion_in_velocity(value("velocity"))
            case "torque_limiting":
                job = axis.torque_limiting(value("limit"))
            case "jog":
                job = axis.jog(value("velocity"), backward=bool(value("backward")))
            case "halt":
                job = axis.halt()
            case "stop":
                job = axis.stop(whole("mode"))
            case one if one in DERIVED:
                if one not in jobs_of(axis.object):
                    raise ConfigurationError(f"step {one}", axis.name, "an axis that knows it")
                job = axis.run(INSTRUCTIONS[one](axis.object))
                job.set(**_start(one))
            case _:
                job = self._synchronous(step)
        instruction = instruction_of(step.job)
        if instruction:
            job.set(**values_of(instruction, step.parameters, scale))
        self._held[step.job] = job
        self._watch(job)

    def _synchronous(self, step: Do) -> Instruction:
        axis, scale = self._axis, self._scale

        def value(name: str) -> float:
            return step.value(name, scale)

        def whole(name: str) -> int:
            return int(step.value(name, scale))

        def leader() -> Any:
            return self._leader(step.text("leader"))

        match step.job:
            case "gear_in":
                return axis.gear_in(leader(), whole("numerator"), whole("denominator"))
            case "gear_in_velocity":
                return axis.gear_in_velocity(leader(), whole("numerator"), whole("denominator"))
            case "gear_in_pos":
                return axis.gear_in_pos(
                    leader(),
                    value("master"),
                    value("slave"),
                    whole("numerator"),
                    whole("denominator"),
                    SyncProfileReference=whole("profile"),
                    MasterStartDistance=value("distance"),
                )
            case "cam_in":
                return axis.cam_in(
                    leader(),
                    self._cam(step.text("cam")),
                    ApplicationMode=whole("mode"),
                    SyncProfileReference=whole("profile"),
                    MasterStartDistance=value("distance"),
                )
            case "gear_out" | "cam_out":
                leave = axis.gear_out if step.job == "gear_out" else axis.cam_out
                return leave(
                    value("position"),
                    SyncProfileReference=whole("profile"),
                    MasterStopDistance=value("distance"),
                )
            case "interpolate":
                return self._cam(step.text("cam")).interpolate()
            case "phasing":
                return axis.phasing_relative(value("shift"))
            case "offset":
                return axis.offset_relative(value("offset"), value("distance"))
            case _:
                return axis.leading_value_additive(value("position"))
