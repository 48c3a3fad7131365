"""Technology objects with the instructions as methods, for straight-line test code."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Final, Generic, TypeVar, Union

from fieldbus.errors import UnknownAttributeError
from motion.s7.axis import ExternalEncoder, TechnologyAxis
from motion.s7.cam_handle import CamHandle
from motion.s7.cams import Cam
from motion.s7.commissioning import ControlPanel
from motion.s7.data_blocks import BitAddress
from motion.s7.diagnostics import Diagnosis, diagnose, diagnose_encoder
from motion.s7.instructions import (
    Instruction,
    MC_AbortMeasuringInput,
    MC_CamIn,
    MC_CamOut,
    MC_GearIn,
    MC_GearInPos,
    MC_GearInVelocity,
    MC_GearOut,
    MC_Halt,
    MC_HaltSuperimposed,
    MC_Home,
    MC_LeadingValueAdditive,
    MC_MeasuringInput,
    MC_MeasuringInputCyclic,
    MC_MotionInPosition,
    MC_MotionInSuperimposed,
    MC_MotionInVelocity,
    MC_MoveAbsolute,
    MC_MoveJog,
    MC_MoveRelative,
    MC_MoveSuperimposed,
    MC_MoveVelocity,
    MC_OffsetAbsolute,
    MC_OffsetRelative,
    MC_PhasingAbsolute,
    MC_PhasingRelative,
    MC_Power,
    MC_Reset,
    MC_SetAxisSTW,
    MC_SetSensor,
    MC_Stop,
    MC_SynchronizedMotionSimulation,
    MC_TorqueAdditive,
    MC_TorqueLimiting,
    MC_TorqueRange,
    MC_WriteParameter,
)
from motion.s7.proxy import LeadingAxisProxy
from motion.s7.start_interlock import StartInterlock

if TYPE_CHECKING:
    from motion.s7.axis.alarms import AxisAlarms
    from motion.s7.axis.state import AxisState
    from motion.s7.axis.technology_object import TechnologyObject
    from motion.s7.measuring_input import MeasuringInput
    from motion.s7.runtime import Runtime
    from motion.s7.variables import VariableStore

_T = TypeVar("_T", bound=Instruction)
_Object = TypeVar("_Object", bound=TechnologyAxis | ExternalEncoder | LeadingAxisProxy)
_INSTEAD: Final = {
    "enable": "power()",
    "disable": "power.set(Enable=False) of the instance power = axis.power()",
    "acknowledge": "reset()",
    "ack": "reset()",
    "move": "move_absolute(), move_relative() or move_velocity()",
    "read": 'var("ActualPosition")',
    "set": 'write("Override.Velocity", 50.0)',
}
"""What is meant by names that an axis does not have."""


LeadingObject = Union[
    "AxisHandle", "EncoderHandle", "ProxyHandle", TechnologyAxis, ExternalEncoder, LeadingAxisProxy
]
"""What may lead a synchronous axis: a handle or the object itself."""


def _attribute(handle: object, technology_object: TechnologyObject, name: str) -> Any:
    """Return an attribute of a technology object for its handle.

    Raises:
        AttributeError: Neither has it; the message names similar ones.

    """
    try:
        return getattr(technology_object, name)
    except AttributeError:
        # What the object has, but cannot tell now, is not misspelt.
        if name.startswith("_") or hasattr(type(technology_object), name):
            raise
        raise UnknownAttributeError(
            handle,
            technology_object,
            attribute=name,
            what=technology_object.name,
            instead=_INSTEAD.get(name, ""),
        ) from None


def summary(technology_object: TechnologyObject) -> str:
    """Return an object, its state and its pending alarms in words."""
    words = [f"{technology_object.name} {technology_object.state.name}"]
    if technology_object.has_position:
        unit = technology_object.variables.unit("Position")
        words[0] += f" at {technology_object.var('ActualPosition'):.6g} {unit}".rstrip()
        if not technology_object.var("StatusWord.X5"):
            words.append("not homed")
    pending = [f"alarm {alarm.number}" for alarm in technology_object.engine.pending]
    return ", ".join(words + pending)


class _Handle(Generic[_Object]):
    """What handles of axes and of encoders have in common."""

    def __init__(self, runtime: Runtime, technology_object: _Object) -> None:
        self._runtime = runtime
        self.object = technology_object
        self.paths_read: set[str] = set()
        """Paths of the variables that were read with `var`."""

    def __getattr__(self, name: str) -> Any:
        return _attribute(self, self.object, name)

    def __repr__(self) -> str:
        return f"<{self.summary()} ({self._runtime.scheduler.now * 1e-9:.3f} s)>"

    def summary(self) -> str:
        """Return the object, its state and its pending alarms: `z ALARM_DISABLED at
        12.5 mm, not homed, alarm 521`.
        """
        return summary(self.object)

    @property
    def name(self) -> str:
        """Name of the technology object."""
        return self.object.name

    @property
    def variables(self) -> VariableStore:
        """Variables of the technology data block."""
        return self.object.variables

    def var(self, path: str) -> float:
        """Return a variable of the technology data block by its original path; bits as `StatusWord.X7`.

        Raises:
            ConfigurationError: There is no such variable on this object type.

        """
        self.paths_read.add(path)
        return self.object.var(path)

    def write(self, path: str, value: float) -> None:
        """Assign a variable as the user program does; the access class decides when it takes effect.

        Raises:
            ConfigurationError: There is no such variable, or it cannot be written.

        """
        self.object.write(path, value)

    @property
    def homed(self) -> bool:
        """Whether the object is homed."""
        return self.object.homed

    def run(self, instance: _T) -> _T:
        """Hand an instance of your own to the runtime."""
        self._runtime.call(instance)
        return instance


def _gear(leader: LeadingObject, numerator: int, denominator: int) -> dict[str, Any]:
    """Return the inputs that start a gear behind `leader`."""
    return {
        "Execute": True,
        "Master": leader.object if isinstance(leader, _Handle) else leader,
        "RatioNumerator": numerator,
        "RatioDenominator": denominator,
    }


class AxisHandle(_Handle[TechnologyAxis]):
    """An axis with the instructions as methods, for straight-line test code.

    Every method makes an instance, hands it to the runtime, which calls it from the next application cycle
    on, and returns it: `job = axis.move_absolute(100.0); bench.run_until(job.done, timeout=2.0)`. All inputs
    of the instruction may be given by their own names: `axis.move_velocity(50.0, Jerk=0.0)`. Every other
    attribute is that of the technology object (`object`).
    """

    def __init__(self, runtime: Runtime, axis: TechnologyAxis) -> None:
        super().__init__(runtime, axis)
        self._power: MC_Power | None = None
        self._interlock: StartInterlock | None = None

    @property
    def state(self) -> AxisState:
        """State of the axis."""
        return self.object.state

    @property
    def alarms(self) -> AxisAlarms:
        """Technology alarms of the axis."""
        return self.object.alarms

    @property
    def communication_ok(self) -> bool:
        """Whether drive and controller exchange cyclic data."""
        return self.object.communication_ok

    @property
    def in_operation(self) -> bool:
        """Whether the drive is in operation, as it reports."""
        return self.object.in_operation

    def diagnosis(self) -> Diagnosis:
        """Return what the axis says about itself now: `print(axis.diagnosis().text())`."""
        return diagnose(self.object)

    def control_panel(self, *, monitoring_s: float = 2.0, alive: bool = True) -> ControlPanel:
        """Return a control panel for this axis, without master control yet; see `ControlPanel`.

        Args:
            monitoring_s: Time without a sign of life after which the axis is stopped and given back, s.
            alive: Whether it gives signs of life by itself, five per monitoring time.

        """
        panel = ControlPanel(self._runtime, self.object, monitoring_s=monitoring_s)
        if alive:
            panel.keep_alive(monitoring_s / 5)
        return panel

    @property
    def power_instance(self) -> MC_Power:
        """The `MC_Power` instance of this axis."""
        if self._power is None:
            self._power = self.run(MC_Power(self.object))
        return self._power

    def power(self, enable: bool = True, *, start_mode: int = 1, stop_mode: int = 0) -> MC_Power:
        """Set the inputs of the axis' only `MC_Power` instance, whether the devices are ready or not."""
        instance = self.power_instance
        if self._interlock is not None:
            self._interlock.request = False
        instance.set(Enable=enable, StartMode=start_mode, StopMode=stop_mode)
        return instance

    def power_when_ready(self, *, start_mode: int = 1, stop_mode: int = 0) -> MC_Power:
        """Enable behind a start interlock: `Enable` is TRUE only while drive and encoder are ready (STP-024).

        `power` ends the interlock.
        """
        instance = self.power_instance
        instance.set(StartMode=start_mode, StopMode=stop_mode)
        if self._interlock is None:
            self._interlock = StartInterlock(self.object, instance)
            self._runtime.call(self._interlock, first=True)
        self._interlock.request = True
        return instance

    def reset(self, *, restart: bool = False) -> MC_Reset:
        """Start `MC_Reset`."""
        return self.run(MC_Reset(self.object, Execute=True, Restart=restart))

    def home(self, position: float = 0.0, *, mode: int = 0, sensor: int = 0) -> MC_Home:
        """Start `MC_Home`."""
        return self.run(MC_Home(self.object, Execute=True, Position=position, Mode=mode, Sensor=sensor))

    def set_sensor(self, sensor: int, *, mode: int = 0, reference: int = 1) -> MC_SetSensor:
        """Start `MC_SetSensor`."""
        return self.run(
            MC_SetSensor(self.object, Execute=True, Sensor=sensor, Mode=mode, ReferenceSensor=reference)
        )

    def write_parameter(self, number: int, value: float) -> MC_WriteParameter:
        """Start `MC_WriteParameter`."""
        return self.run(MC_WriteParameter(self.object, Execute=True, ParameterNumber=number, Value=value))

    def set_limit_variables(
        self, negative: BitAddress | None = None, positive: BitAddress | None = None
    ) -> None:
        """Let bits of a data block be the hardware limit switches, from the next
        restart of the object on (LIM-071).

        The eight parts of both addresses are written in load memory; the monitoring has to be off there, and
        is switched on by `write_parameter(1000, True)` (LIM-070).

        Args:
            negative: `BitAddress.of_bit(number, byte, bit)`; None = the input that the bench has wired.
            positive: The same for the positive switch.

        """
        for name, address in (("Min", negative), ("Max", positive)):
            given = address or BitAddress()
            parts = zip(("RID", "Area", "DbNumber", "Offset"), given, strict=True)
            for part, value in parts:
                self.object.variables.write_start(f"PositionLimits_HW.{name}SwitchAddress.{part}", value)

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

    def gear_in(
        self, leader: LeadingObject, numerator: int = 1, denominator: int = 1, **inputs: Any
    ) -> MC_GearIn:
        """Start `MC_GearIn` behind `leader`, which the bench file names as `leading`, with the ratio
        `numerator` / `denominator`.
        """
        return self.run(MC_GearIn(self.object, **_gear(leader, numerator, denominator), **inputs))

    def gear_in_pos(
        self,
        leader: AxisHandle | TechnologyAxis,
        master: float,
        slave: float,
        numerator: int = 1,
        denominator: int = 1,
        **inputs: Any,
    ) -> MC_GearInPos:
        """Start `MC_GearInPos` behind `leader`, as `gear_in` does: position `slave` of this axis belongs to
        position `master` of the leading one, axis units.
        """
        return self.run(
            MC_GearInPos(
                self.object,
                **_gear(leader, numerator, denominator),
                MasterSyncPosition=master,
                SlaveSyncPosition=slave,
                **inputs,
            )
        )

    def gear_in_velocity(
        self, leader: LeadingObject, numerator: int = 1, denominator: int = 1, **inputs: Any
    ) -> MC_GearInVelocity:
        """Start `MC_GearInVelocity` behind `leader`, as `gear_in` does; change the ratio with
        `ContinuousUpdate=True` and `instance.set(RatioNumerator=...)`.
        """
        return self.run(MC_GearInVelocity(self.object, **_gear(leader, numerator, denominator), **inputs))

    def gear_out(self, position: float, **inputs: Any) -> MC_GearOut:
        """Start `MC_GearOut`, which stops the axis at `position`, axis unit."""
        return self.run(MC_GearOut(self.object, Execute=True, SlavePosition=position, **inputs))

    def cam_in(self, leader: AxisHandle | TechnologyAxis, cam: CamHandle | Cam, **inputs: Any) -> MC_CamIn:
        """Start `MC_CamIn` behind `leader`, as `gear_in` does, with an interpolated `cam`."""
        master: Any = leader.object if isinstance(leader, AxisHandle) else leader
        used: Any = cam.object if isinstance(cam, CamHandle) else cam
        return self.run(MC_CamIn(self.object, Execute=True, Master=master, Cam=used, **inputs))

    def cam_out(self, position: float, **inputs: Any) -> MC_CamOut:
        """Start `MC_CamOut`, which stops the axis at `position`, axis unit."""
        return self.run(MC_CamOut(self.object, Execute=True, SlavePosition=position, **inputs))

    def phasing_absolute(self, shift: float, **inputs: Any) -> MC_PhasingAbsolute:
        """Start `MC_PhasingAbsolute` to `shift`, unit of the leading object, which is that of the synchronous
        job if `Master` says nothing else.
        """
        return self.run(MC_PhasingAbsolute(self.object, **self._phasing(shift), **inputs))

    def phasing_relative(self, shift: float, **inputs: Any) -> MC_PhasingRelative:
        """Start `MC_PhasingRelative` by `shift`, as `phasing_absolute` does."""
        return self.run(MC_PhasingRelative(self.object, **self._phasing(shift), **inputs))

    def _phasing(self, shift: float) -> dict[str, Any]:
        return {"Execute": True, "Master": self.object.leader, "PhaseShift": shift}

    def offset_absolute(self, offset: float, distance: float = 0.0, **inputs: Any) -> MC_OffsetAbsolute:
        """Start `MC_OffsetAbsolute` to `offset`, axis unit, over `distance` of the leading value."""
        return self.run(
            MC_OffsetAbsolute(self.object, Execute=True, Offset=offset, OffsetDistance=distance, **inputs)
        )

    def offset_relative(self, offset: float, distance: float = 0.0, **inputs: Any) -> MC_OffsetRelative:
        """Start `MC_OffsetRelative` by `offset`, axis unit, over `distance` of the leading value."""
        return self.run(
            MC_OffsetRelative(self.object, Execute=True, Offset=offset, OffsetDistance=distance, **inputs)
        )

    def leading_value_additive(self, position: float, **inputs: Any) -> MC_LeadingValueAdditive:
        """Start `MC_LeadingValueAdditive` with `position`, unit of the leading object; go on with
        `instance.set(Position=...)`, end it with `instance.set(Enable=False)`.
        """
        return self.run(MC_LeadingValueAdditive(self.object, Enable=True, Position=position, **inputs))

    def synchronized_motion_simulation(self) -> MC_SynchronizedMotionSimulation:
        """Start `MC_SynchronizedMotionSimulation`; `set(Enable=False)` ends it."""
        return self.run(MC_SynchronizedMotionSimulation(self.object, Enable=True))

    def move_superimposed(self, distance: float, **inputs: Any) -> MC_MoveSuperimposed:
        """Start `MC_MoveSuperimposed` by `distance`, axis unit, on top of the motion that runs."""
        return self.run(MC_MoveSuperimposed(self.object, Execute=True, Distance=distance, **inputs))

    def halt_superimposed(self, **inputs: Any) -> MC_HaltSuperimposed:
        """Start `MC_HaltSuperimposed`."""
        return self.run(MC_HaltSuperimposed(self.object, Execute=True, **inputs))

    def motion_in_velocity(self, velocity: float, **inputs: Any) -> MC_MotionInVelocity:
        """Start `MC_MotionInVelocity` with `velocity`, axis unit per second; go
        on with `instance.set(Velocity=...)`.
        """
        return self.run(MC_MotionInVelocity(self.object, Enable=True, Velocity=velocity, **inputs))

    def motion_in_position(self, position: float, **inputs: Any) -> MC_MotionInPosition:
        """Start `MC_MotionInPosition` with `position`, axis unit; continue
        with `instance.set(Position=..., Velocity=...)`.
        """
        return self.run(MC_MotionInPosition(self.object, Enable=True, Position=position, **inputs))

    def motion_in_superimposed(self, distance: float, **inputs: Any) -> MC_MotionInSuperimposed:
        """Start `MC_MotionInSuperimposed` with `distance`, axis unit; continue
        with `instance.set(Distance=..., VelocityDiff=...)`.
        """
        return self.run(MC_MotionInSuperimposed(self.object, Enable=True, Distance=distance, **inputs))

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


class EncoderHandle(_Handle[ExternalEncoder]):
    """An external encoder with the instructions that it knows as methods; see `AxisHandle`."""

    def __init__(self, runtime: Runtime, encoder: ExternalEncoder) -> None:
        super().__init__(runtime, encoder)
        self._power: MC_Power | None = None

    def diagnosis(self) -> Diagnosis:
        """Return what the object says about itself now: `print(encoder.diagnosis().text())`."""
        return diagnose_encoder(self.object)

    def power(self, enable: bool = True) -> MC_Power:
        """Set `Enable` of the object's only `MC_Power` instance."""
        if self._power is None:
            external: Any = self.object
            self._power = self.run(MC_Power(external))
        self._power.set(Enable=enable)
        return self._power

    def reset(self, *, restart: bool = False) -> MC_Reset:
        """Start `MC_Reset`."""
        return self.run(MC_Reset(self.object, Execute=True, Restart=restart))

    def home(self, position: float = 0.0, *, mode: int = 0, sensor: int = 0) -> MC_Home:
        """Start `MC_Home`."""
        return self.run(MC_Home(self.object, Execute=True, Position=position, Mode=mode, Sensor=sensor))

    def write_parameter(self, number: int, value: float) -> MC_WriteParameter:
        """Start `MC_WriteParameter`."""
        external: Any = self.object
        return self.run(MC_WriteParameter(external, Execute=True, ParameterNumber=number, Value=value))


class MeasuringInputHandle:
    """A measuring input with its instructions as methods; see `AxisHandle`."""

    def __init__(self, runtime: Runtime, one: MeasuringInput) -> None:
        self._runtime = runtime
        self.object = one
        """The technology object."""

    @property
    def name(self) -> str:
        """Name of the technology object."""
        return self.object.name

    def var(self, path: str) -> float:
        """Return a variable of the technology data block by its original path: `Status`.

        Raises:
            UnknownVariableError: There is no such variable.

        """
        return self.object.var(path)

    def run(self, instance: _T) -> _T:
        """Hand an instance of your own to the runtime."""
        self._runtime.call(instance)
        return instance

    def measure(self, mode: int = 0, **inputs: Any) -> MC_MeasuringInput:
        """Start `MC_MeasuringInput`."""
        return self.run(MC_MeasuringInput(self.object, Execute=True, Mode=mode, **inputs))

    def measure_cyclic(self, mode: int = 0, **inputs: Any) -> MC_MeasuringInputCyclic:
        """Start `MC_MeasuringInputCyclic`."""
        return self.run(MC_MeasuringInputCyclic(self.object, Execute=True, Mode=mode, **inputs))

    def abort(self) -> MC_AbortMeasuringInput:
        """Start `MC_AbortMeasuringInput`."""
        return self.run(MC_AbortMeasuringInput(self.object, Execute=True))

    def reset(self, *, restart: bool = False) -> MC_Reset:
        """Start `MC_Reset`."""
        return self.run(MC_Reset(self.object, Execute=True, Restart=restart))


class ProxyHandle(_Handle[LeadingAxisProxy]):
    """A leading-axis proxy: leads axes of its controller; see `AxisHandle`."""

    def reset(self, *, restart: bool = False) -> MC_Reset:
        """Start `MC_Reset`."""
        return self.run(MC_Reset(self.object, Execute=True, Restart=restart))
