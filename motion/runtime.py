"""The controller's cycle: every axis, then the user program (MC-634)."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar

from fieldbus.clock import Scheduler, Timer
from fieldbus.errors import ConfigurationError
from fieldbus.history import History
from motion.axis import ExternalEncoder, TechnologyAxis
from motion.diagnostics import Diagnosis, diagnose
from motion.instructions import (
    Instruction,
    MC_Halt,
    MC_HaltSuperimposed,
    MC_Home,
    MC_MoveAbsolute,
    MC_MoveJog,
    MC_MoveRelative,
    MC_MoveSuperimposed,
    MC_MoveVelocity,
    MC_Power,
    MC_Reset,
    MC_SaveAbsoluteEncoderData,
    MC_SetAxisSTW,
    MC_SetSensor,
    MC_Stop,
    MC_TorqueAdditive,
    MC_TorqueLimiting,
    MC_TorqueRange,
    MC_WriteParameter,
)
from motion.memory_card import MemoryCard

_T = TypeVar("_T", bound=Instruction)


class Runtime:
    """Runs axes and instruction instances at a fixed cycle.

    Args:
        scheduler: Time.
        cycle_ns: Application cycle (`MC_Servo` and `MC_Interpolator`, 1:1), ns.
        phase_ns: Instant within the bus cycle at which the application cycle runs, ns; default half a cycle, when
            the actual values of this cycle have arrived and the next SYNC is still to come.
        history: Event log, or None.

    """

    def __init__(
        self,
        scheduler: Scheduler,
        *,
        cycle_ns: int,
        phase_ns: int | None = None,
        history: History | None = None,
    ) -> None:
        if cycle_ns <= 0:
            raise ConfigurationError("cycle", f"{cycle_ns} ns", "a positive time")
        self.scheduler = scheduler
        self.cycle_ns = cycle_ns
        self.phase_ns = cycle_ns // 2 if phase_ns is None else phase_ns
        self.history = history
        self.axes: list[TechnologyAxis] = []
        self.encoders: list[ExternalEncoder] = []
        self.program: list[Callable[[], object]] = []
        """Called once per application cycle, in this order, after the axes."""
        self.after_cycle: list[Callable[[], object]] = []
        """Called at the end of every application cycle (recorder, triggers)."""
        self.cycles = 0
        self.card: MemoryCard | None = None
        """The memory card; None = there is none."""
        self.saver: MC_SaveAbsoluteEncoderData | None = None
        """The instance whose save runs."""
        self._savers = 0
        self._dormant: list[Instruction] = []
        self._timer: Timer | None = None

    def add(self, axis: TechnologyAxis) -> None:
        """Take an axis into the cycle."""
        self.axes.append(axis)

    def add_encoder(self, encoder: ExternalEncoder) -> None:
        """Take an external encoder into the cycle, before the axes."""
        self.encoders.append(encoder)

    @property
    def objects(self) -> list[TechnologyAxis | ExternalEncoder]:
        """All technology objects."""
        return [*self.encoders, *self.axes]

    def insert_card(self, folder: Path) -> bool:
        """Put a memory card in before the first cycle; adjustment data on it are restored (HOM-159).

        Returns:
            Whether there were data, and they fitted.

        """
        self.card = MemoryCard(folder, self.history)
        return self.card.restore(self.objects)

    def count_saver(self) -> int:
        """Return the number of one more instance of `MC_SaveAbsoluteEncoderData`, from 1 on."""
        self._savers += 1
        return self._savers

    def call(self, instance: Callable[[], object]) -> None:
        """Call `instance` once per cycle from the next cycle on.

        Instances whose job has ended and whose outputs are only held are laid aside until their `Execute` falls.
        """
        active: list[Callable[[], object]] = []
        for one in self.program:
            if isinstance(one, Instruction) and one.dormant:
                self._dormant.append(one)
            else:
                active.append(one)
        self.program = [*active, instance]

    def start(self) -> None:
        """Begin to cycle."""
        if self._timer is None:
            self._timer = self.scheduler.every(self.cycle_ns, self.cycle, phase_ns=self.phase_ns)

    def stop(self) -> None:
        """End the cycle."""
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None

    def cycle(self) -> None:
        """Run one application cycle."""
        self.cycles += 1
        for encoder in self.encoders:
            encoder.cycle()
        for axis in self.axes:
            axis.cycle()
        for one in self._dormant:
            if not one.Execute:
                self._dormant = [other for other in self._dormant if other is not one]
                self.program = [*self.program, one]
        for instance in self.program:
            instance()
        for callback in self.after_cycle:
            callback()


class AxisHandle:
    """An axis with the instructions as methods, for straight-line test code.

    Every method makes an instance, hands it to the runtime, which calls it from the next application cycle on, and
    returns it: `job = axis.move_absolute(100.0); bench.run_until(job.done, timeout=2.0)`. All inputs of the
    instruction may be given by their own names: `axis.move_velocity(50.0, Jerk=0.0)`. Attributes and methods of the
    technology object (`var`, `write`, `state`, ...) are reached through the handle as well.
    """

    def __init__(self, runtime: Runtime, axis: TechnologyAxis) -> None:
        self._runtime = runtime
        self.object = axis
        self._power: MC_Power | None = None

    def __getattr__(self, name: str) -> Any:
        return getattr(self.object, name)

    def diagnosis(self) -> Diagnosis:
        """Return what the axis says about itself now: `print(axis.diagnosis().text())`."""
        return diagnose(self.object)

    def run(self, instance: _T) -> _T:
        """Hand an instance of your own to the runtime."""
        self._runtime.call(instance)
        return instance

    @property
    def power_instance(self) -> MC_Power:
        """The `MC_Power` instance of this axis."""
        if self._power is None:
            self._power = self.run(MC_Power(self.object))
        return self._power

    def power(self, enable: bool = True, *, start_mode: int = 1, stop_mode: int = 0) -> MC_Power:
        """Set the inputs of the axis' only `MC_Power` instance."""
        instance = self.power_instance
        instance.set(Enable=enable, StartMode=start_mode, StopMode=stop_mode)
        return instance

    def reset(self, *, restart: bool = False) -> MC_Reset:
        """Start `MC_Reset`."""
        return self.run(MC_Reset(self.object, Execute=True, Restart=restart))

    def home(self, position: float = 0.0, *, mode: int = 0) -> MC_Home:
        """Start `MC_Home`."""
        return self.run(MC_Home(self.object, Execute=True, Position=position, Mode=mode))

    def set_sensor(self, sensor: int, *, mode: int = 0, reference: int = 1) -> MC_SetSensor:
        """Start `MC_SetSensor`."""
        return self.run(
            MC_SetSensor(self.object, Execute=True, Sensor=sensor, Mode=mode, ReferenceSensor=reference)
        )

    def write_parameter(self, number: int, value: Any) -> MC_WriteParameter:
        """Start `MC_WriteParameter`."""
        return self.run(MC_WriteParameter(self.object, Execute=True, ParameterNumber=number, Value=value))

    def move_absolute(self, position: float, **inputs: Any) -> MC_MoveAbsolute:
        """Start `MC_MoveAbsolute` to `position`, axis unit."""
        return self.run(MC_MoveAbsolute(self.object, Execute=True, Position=position, **inputs))

    def move_relative(self, distance: float, **inputs: Any) -> MC_MoveRelative:
        """Start `MC_MoveRelative` by `distance`, axis unit."""
        return self.run(MC_MoveRelative(self.object, Execute=True, Distance=distance, **inputs))

    def move_velocity(self, velocity: float, **inputs: Any) -> MC_MoveVelocity:
        """Start `MC_MoveVelocity` with `velocity`, axis unit per second."""
        return self.run(MC_MoveVelocity(self.object, Execute=True, Velocity=velocity, **inputs))

    def jog(self, velocity: float = 100.0, *, backward: bool = False, **inputs: Any) -> MC_MoveJog:
        """Start `MC_MoveJog`; end it with `instance.set(JogForward=False, JogBackward=False)`."""
        return self.run(
            MC_MoveJog(
                self.object, JogForward=not backward, JogBackward=backward, Velocity=velocity, **inputs
            )
        )

    def move_superimposed(self, distance: float, **inputs: Any) -> MC_MoveSuperimposed:
        """Start `MC_MoveSuperimposed` by `distance`, axis unit, on top of the motion that runs."""
        return self.run(MC_MoveSuperimposed(self.object, Execute=True, Distance=distance, **inputs))

    def halt_superimposed(self, **inputs: Any) -> MC_HaltSuperimposed:
        """Start `MC_HaltSuperimposed`."""
        return self.run(MC_HaltSuperimposed(self.object, Execute=True, **inputs))

    def torque_additive(self, value: float) -> MC_TorqueAdditive:
        """Start `MC_TorqueAdditive` with `value`, Nm; end it with `instance.set(Enable=False)`."""
        return self.run(MC_TorqueAdditive(self.object, Enable=True, Value=value))

    def torque_range(self, upper: float, lower: float) -> MC_TorqueRange:
        """Start `MC_TorqueRange` with limits in Nm; end it with `instance.set(Enable=False)`."""
        return self.run(MC_TorqueRange(self.object, Enable=True, UpperLimit=upper, LowerLimit=lower))

    def torque_limiting(self, limit: float = -1.0, *, mode: int = 0) -> MC_TorqueLimiting:
        """Start `MC_TorqueLimiting` with `limit`, Nm or N; end it with `instance.set(Enable=False)`."""
        return self.run(MC_TorqueLimiting(self.object, Enable=True, Limit=limit, Mode=mode))

    def set_axis_stw(self, **inputs: Any) -> MC_SetAxisSTW:
        """Start `MC_SetAxisSTW`."""
        return self.run(MC_SetAxisSTW(self.object, Execute=True, **inputs))

    def halt(self, **inputs: Any) -> MC_Halt:
        """Start `MC_Halt`."""
        return self.run(MC_Halt(self.object, Execute=True, **inputs))

    def stop(self, mode: int = 0, **inputs: Any) -> MC_Stop:
        """Start `MC_Stop`; release the axis with `instance.set(Execute=False)`."""
        return self.run(MC_Stop(self.object, Execute=True, Mode=mode, **inputs))


class EncoderHandle:
    """An external encoder with the instructions that it knows as methods; see `AxisHandle`."""

    def __init__(self, runtime: Runtime, encoder: ExternalEncoder) -> None:
        self._runtime = runtime
        self.object = encoder

    def __getattr__(self, name: str) -> Any:
        return getattr(self.object, name)

    def run(self, instance: _T) -> _T:
        """Hand an instance of your own to the runtime."""
        self._runtime.call(instance)
        return instance

    def reset(self, *, restart: bool = False) -> MC_Reset:
        """Start `MC_Reset`."""
        return self.run(MC_Reset(self.object, Execute=True, Restart=restart))

    def home(self, position: float = 0.0, *, mode: int = 0) -> MC_Home:
        """Start `MC_Home`."""
        return self.run(MC_Home(self.object, Execute=True, Position=position, Mode=mode))

    def write_parameter(self, number: int, value: Any) -> MC_WriteParameter:
        """Start `MC_WriteParameter`."""
        external: Any = self.object
        return self.run(MC_WriteParameter(external, Execute=True, ParameterNumber=number, Value=value))
