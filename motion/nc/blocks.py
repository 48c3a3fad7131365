"""Function blocks of a PLC program for NC axes (`MC_` blocks; sections 7.2, 17, 20, 21).

A block is called once per cycle of the PLC. Its inputs are attributes with the names of the library; a call
may set them: `move(Execute=True, Position=100.0)`. Outputs are attributes too and change in a call only.
"""

from __future__ import annotations

from enum import IntEnum
from math import isfinite
from numbers import Real
from typing import TYPE_CHECKING, Any, ClassVar, Final

from typing_extensions import override

from fieldbus.errors import ConfigurationError, UnknownAttributeError, UnknownNameError, similar_names
from motion.kernel.execute_input import ExecuteInput
from motion.nc.commands import CONTINUOUS, ENDLESS, POSITION, STOP, BufferMode, Command, CommandState
from motion.nc.errors import BLOCK_MODE, BLOCK_NOT_PERMITTED, BLOCK_PARAMETER, error_text
from motion.nc.interface import FULL_OVERRIDE, OpMode, State
from motion.nc.modulo import Direction, ModuloTargetError, modulo_move

if TYPE_CHECKING:
    from collections.abc import Callable

    from motion.nc.axis_ref import AxisRef

_ENABLE: Final = 0x1
_FEED_PLUS: Final = 0x2
_FEED_MINUS: Final = 0x4
_NO_ENABLES: Final = ~(_ENABLE | _FEED_PLUS | _FEED_MINUS)
_CAM: Final = 0x20
_OPERATIONAL: Final = int(State.OPERATIONAL)
_ERROR: Final = int(State.ERROR)
DEFAULT_HOME_POSITION: Final = 1e307
"""`Position` of `MC_Home` that stands for the parameter `enc.home_position`."""


class JogMode(IntEnum):
    """`E_JogMode`."""

    MC_JOGMODE_STANDARD_SLOW = 0
    MC_JOGMODE_STANDARD_FAST = 1
    MC_JOGMODE_CONTINOUS = 2
    MC_JOGMODE_INCHING = 3


def _input_value(where: str, value: object, default: object) -> Any:
    """Return a value as an input of the kind of `default` keeps it.

    Raises:
        ConfigurationError: It is of another kind.

    """
    if isinstance(default, IntEnum):
        members = type(default)
        if isinstance(value, str):
            if value not in members.__members__:
                near = similar_names(value, members.__members__)
                raise ConfigurationError(
                    where, value, ", ".join(members.__members__) + (near and f"; {near}")
                )
            return members[value]
        allowed = f"a number, or one of {', '.join(members.__members__)}"
    elif isinstance(default, bool):
        if value is not None and not isinstance(value, str):
            return value
        allowed = "True or False"
    elif isinstance(default, (int, float)):
        allowed = "a number"
    else:
        return value
    if isinstance(value, Real):
        return value
    raise ConfigurationError(where, value, allowed)


class Block:
    """Base of all blocks.

    Args:
        axis: `AXIS_REF` of the axis.
        **inputs: Start values of inputs.

    Raises:
        UnknownNameError: The block does not have an input.

    """

    block: ClassVar[str] = ""
    inputs: ClassVar[dict[str, float]] = {}
    """Names and defaults of the inputs."""

    def __init__(self, axis: AxisRef, **inputs: float) -> None:
        self.Axis = axis
        self.Busy = False
        self.Error = False
        self.ErrorID = 0
        for key, value in self.inputs.items():
            setattr(self, key, value)
        self.set(**inputs)

    if not TYPE_CHECKING:

        def __getattr__(self, name: str) -> object:
            """Name outputs and inputs that are similar to one that the block does not have."""
            raise UnknownAttributeError(self, attribute=name, what=self.block)

    def set(self, **inputs: float) -> None:
        """Assign inputs; they act at the next call.

        Raises:
            UnknownNameError: The block does not have the input.
            ConfigurationError: The input cannot have the value: enumerations take a member, its name or a
                number, BOOL inputs True or False, the others a number.

        """
        for key, value in inputs.items():
            if key not in self.inputs:
                raise UnknownNameError(self.block, key, "an input", self.inputs)
            setattr(self, key, _input_value(f"{self.block}.{key}", value, self.inputs[key]))

    def __call__(self, **inputs: float) -> None:
        """Call the block once."""
        if inputs:
            self.set(**inputs)
        self._call()

    def _call(self) -> None:
        raise NotImplementedError

    def _has_numbers(self) -> bool:
        """Return whether every input of type LREAL is a finite number."""
        return all(
            isfinite(getattr(self, key)) for key, default in self.inputs.items() if isinstance(default, float)
        )

    @property
    def entry(self) -> Callable[[], None]:
        """What the task of a PLC calls in every cycle: the block, with the inputs that it has."""
        return self._call

    @property
    def name(self) -> str:
        """Block and axis, for messages."""
        return f"{self.block} of {self.Axis.axis.name}"

    def __repr__(self) -> str:
        state = error_text(self.ErrorID) if self.Error else "busy" if self.Busy else "idle"
        return f"<{self.name}: {state}>"

    # -- outputs as predicates, for `run_until`

    def busy(self) -> bool:
        """Return `Busy`."""
        return self.Busy

    def error(self) -> bool:
        """Return `Error`."""
        return self.Error


class MC_Power(Block):
    """Enables and override of an axis (NC-723)."""

    block = "MC_Power"
    inputs: ClassVar[dict[str, float]] = {
        "Enable": False,
        "Enable_Positive": False,
        "Enable_Negative": False,
        "Override": 100.0,
        "BufferMode": BufferMode.Aborting,
    }
    Enable: bool
    Enable_Positive: bool
    Enable_Negative: bool
    Override: float

    def __init__(self, axis: AxisRef, **inputs: float) -> None:
        self.Status = False
        self.Active = False
        self._given_override = 0.0
        self._override = 0
        """What the axis gets for it."""
        self._shown = -1
        """States that the outputs show; -1: they have to be looked at again."""
        super().__init__(axis, **inputs)

    @override
    def _call(self) -> None:
        ref = self.Axis
        written = ref.PlcToNc
        word = written.ControlDWord & _NO_ENABLES
        enable = self.Enable
        if enable:
            word |= _ENABLE
            if self.Enable_Positive:
                word |= _FEED_PLUS
            if self.Enable_Negative:
                word |= _FEED_MINUS
        written.ControlDWord = word
        override = self.Override
        if override != self._given_override:
            self._given_override = override
            # What is no number is no override.
            self._override = int(min(override, 100.0) * (FULL_OVERRIDE / 100.0)) if override > 0.0 else 0
        written.Override = self._override
        if enable and ref.axis.encoder_only:  # it has nothing to enable (NC-066)
            self.Error, self.ErrorID = True, BLOCK_NOT_PERMITTED
            self.Status = self.Active = self.Busy = False
            self._shown = -1
            return
        state = ref.image.StateDWord
        shown = state & (_OPERATIONAL | _ERROR)
        if shown == self._shown and enable is self.Busy:
            return
        self.Status = self.Active = state & _OPERATIONAL != 0
        self.Busy = bool(enable)
        self.Error = error = state & _ERROR != 0
        self.ErrorID = ref.image.ErrorCode if error else 0
        self._shown = -1 if error else shown

    def status(self) -> bool:
        """Return `Status`."""
        return self.Status


class ExecuteBlock(Block):
    """Started by a rising edge of `Execute`; ends in one of Done, CommandAborted, Error (NC-727)."""

    Execute = ExecuteInput()
    execute_level: bool = False
    on_execute_fall: Callable[[], object] | None = None

    def __init__(self, axis: AxisRef, **inputs: float) -> None:
        self.Execute = False
        self.Done = False
        self.Active = False
        self.CommandAborted = False
        self._last = False
        self._ended = False
        super().__init__(axis, **inputs)

    @override
    def _call(self) -> None:
        execute, last = bool(self.execute_level), self._last
        if execute and last:
            if self.Busy:
                self._go_on()
            return
        self._last = execute
        if execute:
            self._clear()
            if self._has_numbers():
                self._begin()
            else:
                self._finish(BLOCK_PARAMETER)
        elif self.Busy:
            self._go_on()
        if last:
            self._released()
        elif not execute and self._ended:
            self._clear()

    def _begin(self) -> None:
        """Start; on the rising edge."""
        raise NotImplementedError

    def _go_on(self) -> None:
        """Continue what runs."""

    def _released(self) -> None:
        """`Execute` has fallen; that ends no command."""

    def _clear(self) -> None:
        self.Busy = self.Done = self.Active = self.CommandAborted = self.Error = False
        self.ErrorID = 0
        self._ended = False

    def _finish(self, error_id: int = 0) -> None:
        self.Busy = self.Active = False
        self._ended = True
        self.Error = error_id != 0
        self.ErrorID = error_id
        self.Done = not self.Error

    @property
    def dormant(self) -> bool:
        """Whether a call would change nothing: it has ended, and its outputs are held while `Execute` is
        TRUE.
        """
        return self._ended and self._last and bool(self.Execute)

    def done(self) -> bool:
        """Return `Done`."""
        return self.Done

    def aborted(self) -> bool:
        """Return `CommandAborted`."""
        return self.CommandAborted

    def ended(self) -> bool:
        """Return whether the command has ended, one way or another."""
        return self._ended


class MC_Reset(ExecuteBlock):
    """Clears the error of an axis and acknowledges its drive (NC-725)."""

    block = "MC_Reset"
    inputs: ClassVar[dict[str, float]] = {"Execute": False}

    @override
    def _begin(self) -> None:
        self.Axis.axis.reset()
        self.Busy = True

    @override
    def _go_on(self) -> None:
        if self.Axis.axis.resetting:
            return
        image = self.Axis.NcToPlc
        self._finish(image.ErrorCode if image.StateDWord & State.ERROR else 0)


class MC_SetPosition(ExecuteBlock):
    """Gives the present place another position; `Mode` TRUE shifts by `Position` (NC-242)."""

    block = "MC_SetPosition"
    inputs: ClassVar[dict[str, float]] = {"Execute": False, "Position": 0.0, "Mode": False}
    Position: float
    Mode: bool

    @override
    def _begin(self) -> None:
        self.Axis.axis.set_position(self.Position, relative=bool(self.Mode))
        self._finish()


class HomingMode(IntEnum):
    """`MC_HomingMode`."""

    MC_DefaultHoming = 0
    MC_Direct = 1
    MC_ForceCalibration = 4
    MC_ResetCalibration = 5


class MC_Home(ExecuteBlock):
    """Homes the axis (NC-306 to NC-325).

    `MC_DefaultHoming` runs the sequence of the NC; `MC_Direct` gives the present place the position
    `Position`; the other modes set and reset the calibration flag. With `DEFAULT_HOME_POSITION` at
    `Position` the sync event has the position of the parameter `enc.home_position`.
    """

    block = "MC_Home"
    inputs: ClassVar[dict[str, float]] = {
        "Execute": False,
        "Position": DEFAULT_HOME_POSITION,
        "HomingMode": HomingMode.MC_DefaultHoming,
        "bCalibrationCam": False,
    }
    Position: float
    HomingMode: int
    bCalibrationCam: bool

    @override
    def _call(self) -> None:
        written = self.Axis.PlcToNc
        if self.bCalibrationCam:
            written.ControlDWord |= _CAM
        else:
            written.ControlDWord &= ~_CAM
        super()._call()

    @override
    def _begin(self) -> None:
        axis = self.Axis.axis
        mode = int(self.HomingMode)
        position = self.Position
        if position == DEFAULT_HOME_POSITION:
            position = axis.parameters.cell("enc.home_position").value
        if mode == HomingMode.MC_Direct:
            axis.set_position(position)
            axis.homing.complete()
        elif mode == HomingMode.MC_ForceCalibration:
            axis.homing.complete()
        elif mode == HomingMode.MC_ResetCalibration:
            axis.encoder.homed = False
        elif mode != HomingMode.MC_DefaultHoming:
            self._finish(BLOCK_MODE)
            return
        elif axis.encoder_only:
            self._finish(BLOCK_NOT_PERMITTED)
            return
        else:
            axis.homing.request()
            axis.prepared.append(lambda: axis.homing.start(position))
            self.Busy = True
            return
        self._finish()

    @override
    def _go_on(self) -> None:
        homing = self.Axis.axis.homing
        self.Active = homing.busy
        if homing.waiting or homing.busy or homing.application_request:
            return
        if homing.done or self.Axis.axis.homed:
            self._finish()
        elif homing.error_id:
            self._finish(homing.error_id)
        else:
            self._finish()
            self.Done = False
            self.CommandAborted = True


class MC_ReadApplicationRequest(Block):
    """Tells which sequence the NC asks the PLC for: 0 none, 1 homing (NC-325)."""

    block = "MC_ReadApplicationRequest"
    inputs: ClassVar[dict[str, float]] = {"Enable": False}
    Enable: bool

    def __init__(self, axis: AxisRef, **inputs: float) -> None:
        self.Valid = False
        self.ApplicationRequestType = 0
        super().__init__(axis, **inputs)

    @override
    def _call(self) -> None:
        self.Valid = bool(self.Enable)
        asked = self.Axis.NcToPlc.OpModeDWord & OpMode.NC_APPLICATION_REQUEST
        self.ApplicationRequestType = 1 if self.Enable and asked else 0


class MotionBlock(ExecuteBlock):
    """A block that gives a motion command to the axis."""

    Velocity: float
    Acceleration: float
    Deceleration: float
    Jerk: float
    BufferMode: int

    def __init__(self, axis: AxisRef, **inputs: float) -> None:
        self._command: Command | None = None
        super().__init__(axis, **inputs)

    def _make(self) -> Command | int:
        """Return the command, or the error code with which the block refuses its inputs."""
        raise NotImplementedError

    def _command_of(self, kind: int, *, target: float, relative: bool = False) -> Command:
        """Return a command of the inputs."""
        acceleration, deceleration, jerk = self.Axis.axis.dynamics(
            self.Acceleration, self.Deceleration, self.Jerk
        )
        return Command(
            kind,
            velocity=self.Velocity,
            acceleration=acceleration,
            deceleration=deceleration,
            jerk=jerk,
            target=target,
            relative=relative,
            buffer_mode=BufferMode(int(self.BufferMode)),
        )

    @override
    def _begin(self) -> None:
        made = self._refused_inputs() or self._make()
        if isinstance(made, int):
            self._finish(made)
            return
        self._command = made
        refused = self._submit(made)
        if refused:
            self._finish(refused)
            return
        self.Busy = True
        self._show(made)

    def _submit(self, command: Command) -> int:
        """Give the command to the axis; returns an error code, 0 for none."""
        return self.Axis.axis.submit(command)

    def _refused_inputs(self) -> int:
        """Return an error code where an input has no usable value."""
        names = ("Acceleration", "Deceleration", "Jerk")
        if any(not getattr(self, name) >= 0.0 for name in names if name in self.inputs):
            return BLOCK_PARAMETER
        if "BufferMode" in self.inputs and int(self.BufferMode) not in set(BufferMode):
            return BLOCK_PARAMETER
        return 0

    @override
    def _go_on(self) -> None:
        if self._command is not None:
            self._show(self._command)

    def _show(self, command: Command) -> None:
        state = command.state
        if state is CommandState.ACTIVE:
            self.Active = True
            self._show_running(command)
        elif state is CommandState.DONE:
            self._finish()
        elif state is CommandState.ABORTED:
            self._finish()
            self.Done = False
            self.CommandAborted = True
        elif state is CommandState.ERROR:
            self._finish(command.error_id)
        else:
            self.Active = False
            self._show_running(command)

    def _show_running(self, command: Command) -> None:
        """Set further outputs of a running command."""


_DYNAMICS: Final[dict[str, float]] = {
    "Velocity": 0.0,
    "Acceleration": 0.0,
    "Deceleration": 0.0,
    "Jerk": 0.0,
    "BufferMode": BufferMode.Aborting,
}


class MC_MoveAbsolute(MotionBlock):
    """Moves to an absolute position (NC-726)."""

    block = "MC_MoveAbsolute"
    inputs: ClassVar[dict[str, float]] = {"Execute": False, "Position": 0.0, **_DYNAMICS}
    Position: float

    @override
    def _make(self) -> Command | int:
        return self._command_of(POSITION, target=self.Position)


class MC_MoveRelative(MotionBlock):
    """Moves by a distance from the set position at which it begins."""

    block = "MC_MoveRelative"
    inputs: ClassVar[dict[str, float]] = {"Execute": False, "Distance": 0.0, **_DYNAMICS}
    Distance: float

    @override
    def _make(self) -> Command | int:
        return self._command_of(POSITION, target=self.Distance, relative=True)


class MC_MoveAdditive(MotionBlock):
    """Moves by a distance from the last target position, reached or not; else from the set position."""

    block = "MC_MoveAdditive"
    inputs: ClassVar[dict[str, float]] = {"Execute": False, "Distance": 0.0, **_DYNAMICS}
    Distance: float

    @override
    def _make(self) -> Command | int:
        motion = self.Axis.axis.motion
        if not motion.has_target:
            return self._command_of(POSITION, target=self.Distance, relative=True)
        last = motion.last_target if motion.queue and self.BufferMode else motion.target
        return self._command_of(POSITION, target=last + self.Distance)


class MC_MoveModulo(MotionBlock):
    """Moves to a modulo position; a position of a turn or more contains additional turns (NC-709 to
    NC-722).
    """

    block = "MC_MoveModulo"
    inputs: ClassVar[dict[str, float]] = {
        "Execute": False,
        "Position": 0.0,
        "Direction": Direction.POSITIVE,
        **_DYNAMICS,
    }
    Position: float
    Direction: int

    @override
    def _make(self) -> Command | int:
        axis = self.Axis.axis
        direction = int(self.Direction)
        if direction == Direction.CURRENT:
            direction = Direction.NEGATIVE if axis.motion.generator.v < 0.0 else Direction.POSITIVE
        if direction not in set(Direction):
            return BLOCK_PARAMETER
        try:
            way = modulo_move(
                axis.motion.last_target if self.BufferMode else axis.motion.generator.s,
                self.Position,
                factor=axis.parameters.cell("enc.modulo_factor").value,
                tolerance=axis.parameters.cell("enc.modulo_tolerance_window").value,
                direction=Direction(direction),
            )
        except ModuloTargetError:
            return BLOCK_PARAMETER
        return self._command_of(POSITION, target=way, relative=True)


class MC_MoveVelocity(MotionBlock):
    """Moves with a velocity, on and on."""

    block = "MC_MoveVelocity"
    inputs: ClassVar[dict[str, float]] = {"Execute": False, "Direction": Direction.POSITIVE, **_DYNAMICS}
    Direction: int

    def __init__(self, axis: AxisRef, **inputs: float) -> None:
        self.InVelocity = False
        super().__init__(axis, **inputs)

    @override
    def _make(self) -> Command | int:
        direction = int(self.Direction)
        if direction == Direction.CURRENT:
            direction = Direction.NEGATIVE if self.Axis.axis.motion.generator.v < 0.0 else Direction.POSITIVE
        if direction not in {Direction.POSITIVE, Direction.NEGATIVE}:
            return BLOCK_PARAMETER
        return self._command_of(ENDLESS, target=1.0 if direction == Direction.POSITIVE else -1.0)

    @override
    def _clear(self) -> None:
        super()._clear()
        self.InVelocity = False

    @override
    def _show_running(self, command: Command) -> None:
        self.InVelocity = command.in_velocity

    @override
    def _finish(self, error_id: int = 0) -> None:
        super()._finish(error_id)
        self.InVelocity = False

    def in_velocity(self) -> bool:
        """Return `InVelocity`."""
        return self.InVelocity


class _ContinuousBlock(MotionBlock):
    """What motions that go on after their target have in common."""

    EndVelocity: float

    def __init__(self, axis: AxisRef, **inputs: float) -> None:
        self.InEndVelocity = False
        super().__init__(axis, **inputs)

    def _through(self, target: float, *, relative: bool) -> Command | int:
        if not self.EndVelocity >= 0.0:
            return BLOCK_PARAMETER
        command = self._command_of(CONTINUOUS, target=target, relative=relative)
        command.end_velocity = self.EndVelocity
        return command

    @override
    def _clear(self) -> None:
        super()._clear()
        self.InEndVelocity = False

    @override
    def _show_running(self, command: Command) -> None:
        self.InEndVelocity = command.in_velocity

    def in_end_velocity(self) -> bool:
        """Return `InEndVelocity`."""
        return self.InEndVelocity


class MC_MoveContinuousAbsolute(_ContinuousBlock):
    """Moves to a position, passes it with the end velocity, and goes on with it."""

    block = "MC_MoveContinuousAbsolute"
    inputs: ClassVar[dict[str, float]] = {
        "Execute": False,
        "Position": 0.0,
        "EndVelocity": 0.0,
        **_DYNAMICS,
    }
    Position: float

    @override
    def _make(self) -> Command | int:
        return self._through(self.Position, relative=False)


class MC_MoveContinuousRelative(_ContinuousBlock):
    """Moves by a distance, passes its end with the end velocity, and goes on with it."""

    block = "MC_MoveContinuousRelative"
    inputs: ClassVar[dict[str, float]] = {
        "Execute": False,
        "Distance": 0.0,
        "EndVelocity": 0.0,
        **_DYNAMICS,
    }
    Distance: float

    @override
    def _make(self) -> Command | int:
        return self._through(self.Distance, relative=True)


class _StopBlock(MotionBlock):
    """What `MC_Stop` and `MC_Halt` have in common."""

    locks: ClassVar[bool]

    @override
    def _refused_inputs(self) -> int:
        return 0

    @override
    def _make(self) -> Command | int:
        axis = self.Axis.axis
        deceleration, jerk = axis.stop_dynamics(self.Deceleration, self.Jerk)
        return Command(
            STOP, acceleration=deceleration, deceleration=deceleration, jerk=jerk, locks=self.locks
        )


class MC_Halt(_StopBlock):
    """Brakes to standstill; another command may take over at any time."""

    block = "MC_Halt"
    inputs: ClassVar[dict[str, float]] = {"Execute": False, "Deceleration": 0.0, "Jerk": 0.0}
    locks = False


class MC_Stop(_StopBlock):
    """Brakes to standstill and refuses other commands while `Execute` is TRUE (NC-724, NC-741)."""

    block = "MC_Stop"
    inputs: ClassVar[dict[str, float]] = {"Execute": False, "Deceleration": 0.0, "Jerk": 0.0}
    locks = True

    @override
    def _released(self) -> None:
        self._unlock()

    @override
    def _go_on(self) -> None:
        super()._go_on()
        if not self.Execute:
            self._unlock()

    def _unlock(self) -> None:
        if self._command is not None and self._command.ended:
            self.Axis.axis.motion.release(self._command)


class MC_GearIn(ExecuteBlock):
    """Makes the axis a slave of `Master` with the ratio `RatioNumerator` / `RatioDenominator`, from the
    present positions on; while it is one, a rising edge changes the ratio.
    """

    block = "MC_GearIn"
    inputs: ClassVar[dict[str, Any]] = {
        "Execute": False,
        "Master": None,
        "RatioNumerator": 1.0,
        "RatioDenominator": 1.0,
    }
    Master: AxisRef | None
    RatioNumerator: float
    RatioDenominator: float

    def __init__(self, axis: AxisRef, **inputs: Any) -> None:
        self.InGear = False
        super().__init__(axis, **inputs)

    @override
    def _begin(self) -> None:
        axis = self.Axis.axis
        if self.Master is None or not self.RatioDenominator:
            self._finish(BLOCK_PARAMETER)
            return
        ratio = self.RatioNumerator / self.RatioDenominator
        master = self.Master.axis
        if axis.coupling.master is master and ratio:
            axis.coupling.set_ratio(ratio)
            refused = 0
        else:
            refused = axis.couple(master, ratio)
        if refused:
            self._finish(refused)
            return
        self.Busy = self.Active = self.InGear = True

    @override
    def _go_on(self) -> None:
        axis = self.Axis.axis
        if axis.coupling.master is None:
            self._finish(axis.error_id)
            self.Done = False
            self.CommandAborted = not self.Error

    @override
    def _clear(self) -> None:
        super()._clear()
        self.InGear = False

    @override
    def _finish(self, error_id: int = 0) -> None:
        super()._finish(error_id)
        self.InGear = False

    def in_gear(self) -> bool:
        """Return `InGear`."""
        return self.InGear


class MC_GearOut(ExecuteBlock):
    """Ends a coupling; the axis goes on with its velocity."""

    block = "MC_GearOut"
    inputs: ClassVar[dict[str, float]] = {"Execute": False}

    @override
    def _begin(self) -> None:
        axis = self.Axis.axis
        if axis.coupling.master is None:
            self._finish(BLOCK_NOT_PERMITTED)
            return
        axis.decouple()
        self._finish()


class MC_ExtSetPointGenEnable(ExecuteBlock):
    """Lets the packets in `PlcToNc` be the setpoints (NC-565)."""

    block = "MC_ExtSetPointGenEnable"
    inputs: ClassVar[dict[str, float]] = {"Execute": False, "Position": 0.0, "PositionType": 1}
    Position: float
    PositionType: int

    @override
    def _begin(self) -> None:
        self._finish(self.Axis.axis.enable_external(int(self.PositionType), self.Position))


class MC_ExtSetPointGenDisable(ExecuteBlock):
    """Ends external setpoints after one more packet (NC-582)."""

    block = "MC_ExtSetPointGenDisable"
    inputs: ClassVar[dict[str, float]] = {"Execute": False}

    @override
    def _begin(self) -> None:
        self._finish(self.Axis.axis.external.disable())


class MC_Jog(Block):
    """Moves by hand (NC-103, NC-104, NC-107).

    The standard modes take the manual velocities of the axis, `MC_JOGMODE_CONTINOUS` the input `Velocity`; in
    `MC_JOGMODE_INCHING` a rising edge moves by `Position`.
    """

    block = "MC_Jog"
    inputs: ClassVar[dict[str, float]] = {
        "JogForward": False,
        "JogBackwards": False,
        "Mode": JogMode.MC_JOGMODE_STANDARD_SLOW,
        "Position": 0.0,
        "Velocity": 0.0,
        "Acceleration": 0.0,
        "Deceleration": 0.0,
        "Jerk": 0.0,
    }
    JogForward: bool
    JogBackwards: bool
    Mode: int
    Position: float
    Velocity: float
    Acceleration: float
    Deceleration: float
    Jerk: float

    def __init__(self, axis: AxisRef, **inputs: float) -> None:
        self.Done = False
        self.Active = False
        self.CommandAborted = False
        self._command: Command | None = None
        self._direction = 0.0
        super().__init__(axis, **inputs)

    @override
    def _call(self) -> None:
        forward, backwards = bool(self.JogForward), bool(self.JogBackwards)
        wanted = 0.0 if forward == backwards else 1.0 if forward else -1.0
        before, self._direction = self._direction, wanted
        command = self._command
        if wanted != before:
            if wanted:
                self._start(wanted)
            elif command is not None and not command.ended and command.kind == ENDLESS:
                self._halt(command)
            elif command is None:
                self.Error, self.ErrorID = False, 0
        command = self._command
        if command is not None:
            self._show(command)

    def _start(self, direction: float) -> None:
        self.Done = self.CommandAborted = self.Error = False
        self.ErrorID = 0
        axis = self.Axis.axis
        mode = int(self.Mode)
        cell = axis.parameters.cell
        velocity = self.Velocity
        if mode == JogMode.MC_JOGMODE_STANDARD_SLOW:
            velocity = cell("axis.manual_velocity_slow").value
        elif mode == JogMode.MC_JOGMODE_STANDARD_FAST:
            velocity = cell("axis.manual_velocity_fast").value
        acceleration, deceleration, jerk = axis.dynamics(self.Acceleration, self.Deceleration, self.Jerk)
        inching = mode == JogMode.MC_JOGMODE_INCHING
        command = Command(
            POSITION if inching else ENDLESS,
            velocity=velocity,
            acceleration=acceleration,
            deceleration=deceleration,
            jerk=jerk,
            target=direction * self.Position if inching else direction,
            relative=inching,
        )
        usable = self._has_numbers() and min(self.Acceleration, self.Deceleration, self.Jerk) >= 0.0
        refused = axis.submit(command) if usable and mode in set(JogMode) else BLOCK_PARAMETER
        if refused:
            self._command = None
            self.Busy = self.Active = False
            self.Error, self.ErrorID = True, refused
        else:
            self._command = command

    def _halt(self, command: Command) -> None:
        axis = self.Axis.axis
        halt = Command(
            STOP,
            acceleration=command.deceleration,
            deceleration=command.deceleration,
            jerk=command.jerk,
        )
        if axis.submit(halt) == 0:
            self._command = halt

    def _show(self, command: Command) -> None:
        state = command.state
        self.Busy = self.Active = not command.ended
        if not command.ended:
            return
        self._command = None
        self.Done = state is CommandState.DONE
        self.CommandAborted = state is CommandState.ABORTED
        if state is CommandState.ERROR:
            self.Error, self.ErrorID = True, command.error_id

    def done(self) -> bool:
        """Return `Done`."""
        return self.Done
