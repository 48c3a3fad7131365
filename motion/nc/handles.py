"""NC axes with the blocks as methods, for straight-line test code."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, TypeVar

from fieldbus.errors import UnknownAttributeError
from motion.nc.blocks import (
    DEFAULT_HOME_POSITION,
    Block,
    HomingMode,
    JogMode,
    MC_ExtSetPointGenDisable,
    MC_ExtSetPointGenEnable,
    MC_GearIn,
    MC_GearOut,
    MC_Halt,
    MC_Home,
    MC_Jog,
    MC_MoveAbsolute,
    MC_MoveAdditive,
    MC_MoveContinuousAbsolute,
    MC_MoveContinuousRelative,
    MC_MoveModulo,
    MC_MoveRelative,
    MC_MoveVelocity,
    MC_Power,
    MC_Reset,
    MC_SetPosition,
    MC_Stop,
)
from motion.nc.correction_blocks import (
    MC_BacklashCompensation,
    MC_MoveSuperImposed,
    MC_PositionCorrectionLimiter,
)
from motion.nc.errors import error_text
from motion.nc.modulo import Direction
from motion.nc.online import Online
from motion.nc.probe_blocks import MC_TouchProbe
from motion.nc.process_image import ProcessImage
from motion.nc.touch_probe import ProbeSource

if TYPE_CHECKING:
    from motion.nc.axis import NcAxis
    from motion.nc.axis_ref import AxisRef
    from motion.nc.parameters import Value
    from motion.nc.tasks import NcRuntime

_B = TypeVar("_B", bound=Block)


class NcAxisHandle:
    """An NC axis with the blocks as methods.

    Every method makes a block, hands it to the PLC program, which calls it from its next cycle on, and
    returns
    it: `move = axis.move_absolute(100.0, Velocity=50.0); bench.run_until(move.done, timeout=5.0)`. All
    inputs of a block may be given by their own names.

    Args:
        runtime: Tasks of the NC.
        ref: `AXIS_REF` of the axis.

    """

    def __init__(self, runtime: NcRuntime, ref: AxisRef) -> None:
        self._runtime = runtime
        self.ref = ref
        """`AXIS_REF` of the program: `ref.PlcToNc`, `ref.NcToPlc`, `ref.Status`."""
        self._power: MC_Power | None = None
        self._online: Online | None = None

    if not TYPE_CHECKING:

        def __getattr__(self, name: str) -> object:
            """Name methods that are similar to one that does not exist."""
            if name.startswith("_"):
                raise AttributeError(name)
            raise UnknownAttributeError(self, attribute=name, what=self.name)

    @property
    def object(self) -> NcAxis:
        """The axis itself; an activation of the configuration makes another one."""
        return self.ref.axis

    @property
    def online(self) -> Online:
        """Its online dialog: view, enabling, keys F1 to F9, functions."""
        if self._online is None:
            runtime, name = self._runtime, self.name
            self._online = Online(
                self.ref,
                scheduler=runtime.scheduler,
                plc_has_priority=lambda: runtime.plc_running and runtime.links[name].connected,
                axis_of=lambda other: runtime.links[other].ref.axis,
            )
            runtime.after_cycle.append(self._online.step)
        return self._online

    @property
    def image(self) -> ProcessImage:
        """Process images between the axis and its device, as of the last cycle."""
        return ProcessImage(self.object)

    def trace_row(self) -> tuple[float, ...]:
        """Return the values that are recorded for the present cycle."""
        return self.ref.axis.trace_row()

    def __repr__(self) -> str:
        return f"<{self.summary()} ({self._runtime.scheduler.now * 1e-9:.3f} s)>"

    def summary(self) -> str:
        """Return the axis, how it stands, and its error in words."""
        axis = self.object
        state = error_text(axis.error_id) if axis.error else "operational" if axis.operational else "disabled"
        return f"{axis.name} {state} at {axis.position:.6g} {axis.parameters.read('axis.unit')}"

    @property
    def name(self) -> str:
        """Name of the axis."""
        return self.object.name

    @property
    def position(self) -> float:
        """Actual position, position unit."""
        return self.object.position

    @property
    def operational(self) -> bool:
        """Whether the axis is enabled and follows commands (`Operational`)."""
        return self.object.operational

    @property
    def error_id(self) -> int:
        """Error code of the axis, 0 for none."""
        return self.object.error_id

    @property
    def homed(self) -> bool:
        """Whether the axis is homed (`Homed`)."""
        return self.object.homed

    def read_parameter(self, key: str) -> Value:
        """Return a parameter by its key: `axis.maximum_velocity`.

        Raises:
            UnknownNameError: There is no such parameter.

        """
        return self.object.parameters.read(key)

    def write_parameter(self, key: str, value: Value) -> None:
        """Change a parameter while the axis runs.

        Raises:
            ConfigurationError: There is no such parameter, or it cannot have the value; it stays as it is.

        """
        self.object.parameters.write(key, value)

    def run(self, instance: _B) -> _B:
        """Hand a block of your own to the PLC program."""
        self._runtime.call(instance)
        return instance

    def power(
        self, enable: bool = True, *, positive: bool = True, negative: bool = True, override: float = 100.0
    ) -> MC_Power:
        """Set the inputs of the axis' only `MC_Power`."""
        if self._power is None:
            self._power = self.run(MC_Power(self.ref))
        self._power.set(Enable=enable, Enable_Positive=positive, Enable_Negative=negative, Override=override)
        return self._power

    def reset(self) -> MC_Reset:
        """Start `MC_Reset`."""
        return self.run(MC_Reset(self.ref, Execute=True))

    def set_position(self, position: float, *, relative: bool = False) -> MC_SetPosition:
        """Start `MC_SetPosition`."""
        return self.run(MC_SetPosition(self.ref, Execute=True, Position=position, Mode=relative))

    def home(
        self, position: float | None = None, *, mode: HomingMode = HomingMode.MC_DefaultHoming
    ) -> MC_Home:
        """Start `MC_Home`; give it the cam with `instance.set(bCalibrationCam=True)`.

        Args:
            position: Position of the sync event, position unit; None: the parameter `enc.home_position`.
            mode: Sequence of the NC, or the present place.

        """
        where = DEFAULT_HOME_POSITION if position is None else position
        return self.run(MC_Home(self.ref, Execute=True, Position=where, HomingMode=mode))

    def move_absolute(self, position: float, **inputs: Any) -> MC_MoveAbsolute:
        """Start `MC_MoveAbsolute` to `position`, position unit."""
        return self.run(MC_MoveAbsolute(self.ref, Execute=True, Position=position, **inputs))

    def move_relative(self, distance: float, **inputs: Any) -> MC_MoveRelative:
        """Start `MC_MoveRelative` by `distance`, position unit."""
        return self.run(MC_MoveRelative(self.ref, Execute=True, Distance=distance, **inputs))

    def move_additive(self, distance: float, **inputs: Any) -> MC_MoveAdditive:
        """Start `MC_MoveAdditive` by `distance` from the last target, position unit."""
        return self.run(MC_MoveAdditive(self.ref, Execute=True, Distance=distance, **inputs))

    def move_modulo(
        self, position: float, direction: Direction = Direction.POSITIVE, **inputs: Any
    ) -> MC_MoveModulo:
        """Start `MC_MoveModulo` to the modulo position `position`, position unit."""
        return self.run(
            MC_MoveModulo(self.ref, Execute=True, Position=position, Direction=direction, **inputs)
        )

    def move_velocity(self, velocity: float, **inputs: Any) -> MC_MoveVelocity:
        """Start `MC_MoveVelocity`; a negative `velocity` moves in negative direction."""
        direction = Direction.NEGATIVE if velocity < 0.0 else Direction.POSITIVE
        return self.run(
            MC_MoveVelocity(self.ref, Execute=True, Velocity=abs(velocity), Direction=direction, **inputs)
        )

    def move_continuous_absolute(
        self, position: float, end_velocity: float, **inputs: Any
    ) -> MC_MoveContinuousAbsolute:
        """Start `MC_MoveContinuousAbsolute` through `position` with `end_velocity`."""
        return self.run(
            MC_MoveContinuousAbsolute(
                self.ref, Execute=True, Position=position, EndVelocity=end_velocity, **inputs
            )
        )

    def move_continuous_relative(
        self, distance: float, end_velocity: float, **inputs: Any
    ) -> MC_MoveContinuousRelative:
        """Start `MC_MoveContinuousRelative` by `distance`, on with `end_velocity`."""
        return self.run(
            MC_MoveContinuousRelative(
                self.ref, Execute=True, Distance=distance, EndVelocity=end_velocity, **inputs
            )
        )

    def gear_in(self, master: NcAxisHandle, numerator: float = 1.0, denominator: float = 1.0) -> MC_GearIn:
        """Start `MC_GearIn` behind `master`."""
        return self.run(
            MC_GearIn(
                self.ref,
                Execute=True,
                Master=master.ref,
                RatioNumerator=numerator,
                RatioDenominator=denominator,
            )
        )

    def gear_out(self) -> MC_GearOut:
        """Start `MC_GearOut`."""
        return self.run(MC_GearOut(self.ref, Execute=True))

    def external_enable(self, position: float, *, start_type: int = 1) -> MC_ExtSetPointGenEnable:
        """Start `MC_ExtSetPointGenEnable`; the packets are written to `ref.PlcToNc`."""
        return self.run(
            MC_ExtSetPointGenEnable(self.ref, Execute=True, Position=position, PositionType=start_type)
        )

    def external_disable(self) -> MC_ExtSetPointGenDisable:
        """Start `MC_ExtSetPointGenDisable`."""
        return self.run(MC_ExtSetPointGenDisable(self.ref, Execute=True))

    def move_superimposed(self, distance: float, velocity: float, **inputs: Any) -> MC_MoveSuperImposed:
        """Start `MC_MoveSuperImposed`: `distance` on top of what the axis does."""
        return self.run(
            MC_MoveSuperImposed(self.ref, Execute=True, Distance=distance, VelocityDiff=velocity, **inputs)
        )

    def compensate_backlash(self, backlash: float, **inputs: Any) -> MC_BacklashCompensation:
        """Switch `MC_BacklashCompensation` on; off again with `instance.set(Enable=False)`."""
        return self.run(MC_BacklashCompensation(self.ref, Enable=True, Backlash=backlash, **inputs))

    def correct_position(self, value: float, **inputs: Any) -> MC_PositionCorrectionLimiter:
        """Switch `MC_PositionCorrectionLimiter` on with a value, position unit."""
        return self.run(
            MC_PositionCorrectionLimiter(self.ref, Enable=True, PositionCorrectionValue=value, **inputs)
        )

    def touch_probe(self, source: ProbeSource = ProbeSource.LATCH_POSITIVE, **inputs: Any) -> MC_TouchProbe:
        """Start `MC_TouchProbe`."""
        return self.run(MC_TouchProbe(self.ref, Execute=True, TriggerInput=source, **inputs))

    def halt(self, **inputs: Any) -> MC_Halt:
        """Start `MC_Halt`."""
        return self.run(MC_Halt(self.ref, Execute=True, **inputs))

    def stop(self, **inputs: Any) -> MC_Stop:
        """Start `MC_Stop`; release the axis with `instance.set(Execute=False)`."""
        return self.run(MC_Stop(self.ref, Execute=True, **inputs))

    def emergency_stop(self, *, ramp: bool = True) -> None:
        """Stop for an emergency: on the ramp of the fast axis stop, then locked until `reset`; or without
        output at once.
        """
        self.object.emergency_stop(ramp=ramp)

    def jog(
        self, mode: JogMode = JogMode.MC_JOGMODE_STANDARD_SLOW, *, backwards: bool = False, **inputs: Any
    ) -> MC_Jog:
        """Start `MC_Jog`; end it with `instance.set(JogForward=False, JogBackwards=False)`."""
        return self.run(
            MC_Jog(self.ref, JogForward=not backwards, JogBackwards=backwards, Mode=mode, **inputs)
        )
