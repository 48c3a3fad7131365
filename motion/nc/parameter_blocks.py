"""Blocks that read and write parameters and states of an axis (`MC_ReadParameter`, `MC_ReadStatus` and
theirs).
"""

from __future__ import annotations

from enum import IntEnum
from typing import TYPE_CHECKING, Any, ClassVar, Final

from typing_extensions import override

from fieldbus.errors import ConfigurationError
from motion.nc.blocks import Block, ExecuteBlock
from motion.nc.errors import BLOCK_PARAMETER
from motion.nc.interface import State
from motion.nc.parameters import RefusedParameterError, Value, catalogue

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from motion.nc.axis_ref import AxisRef
    from motion.nc.interface import NcToPlc


class AxisParameter(IntEnum):
    """Numbers of `ParameterNumber`, as PLCopen has them."""

    CommandedPosition = 1
    SWLimitPos = 2
    SWLimitNeg = 3
    EnableLimitPos = 4
    EnableLimitNeg = 5
    EnablePosLagMonitoring = 6
    MaxPositionLag = 7
    MaxVelocitySystem = 8
    MaxVelocityAppl = 9
    ActualVelocity = 10
    CommandedVelocity = 11
    MaxAccelerationSystem = 12
    MaxAccelerationAppl = 13
    MaxDecelerationSystem = 14
    MaxDecelerationAppl = 15


_STATES: Final[Mapping[int, Callable[[NcToPlc], float]]] = {
    AxisParameter.CommandedPosition: lambda image: image.SetPos,
    AxisParameter.ActualVelocity: lambda image: image.ActVelo,
    AxisParameter.CommandedVelocity: lambda image: image.SetVelo,
}
"""Numbers that are values of the axis: they can be read only."""
_KEYS: Final[Mapping[int, str]] = {
    AxisParameter.SWLimitPos: "axis.soft_limit_max",
    AxisParameter.SWLimitNeg: "axis.soft_limit_min",
    AxisParameter.EnableLimitPos: "axis.soft_limit_max_enable",
    AxisParameter.EnableLimitNeg: "axis.soft_limit_min_enable",
    AxisParameter.EnablePosLagMonitoring: "axis.position_lag_monitoring",
    AxisParameter.MaxPositionLag: "axis.position_lag_max",
    AxisParameter.MaxVelocitySystem: "axis.reference_velocity",
    AxisParameter.MaxVelocityAppl: "axis.maximum_velocity",
    AxisParameter.MaxAccelerationSystem: "axis.maximum_acceleration",
    AxisParameter.MaxAccelerationAppl: "axis.default_acceleration",
    AxisParameter.MaxDecelerationSystem: "axis.maximum_deceleration",
    AxisParameter.MaxDecelerationAppl: "axis.default_deceleration",
}
"""Parameters by number."""


class _EnabledBlock(Block):
    """What blocks that read while `Enable` is TRUE have in common."""

    inputs: ClassVar[dict[str, Any]] = {"Enable": False}
    Enable: bool

    def __init__(self, axis: AxisRef, **inputs: float) -> None:
        self.Valid = False
        super().__init__(axis, **inputs)

    @override
    def _call(self) -> None:
        self.Error, self.ErrorID = False, 0
        if self.Enable:
            self.ErrorID = self._read()
            self.Error = self.ErrorID != 0
        self.Valid = self.Busy = bool(self.Enable) and not self.Error

    def _read(self) -> int:
        """Set the outputs; returns an error code, 0 for none."""
        raise NotImplementedError

    def valid(self) -> bool:
        """Return `Valid`."""
        return self.Valid


class MC_ReadStatus(_EnabledBlock):
    """State of the axis in the terms of PLCopen, and its status double word bit by bit."""

    block = "MC_ReadStatus"

    def __init__(self, axis: AxisRef, **inputs: float) -> None:
        self.ErrorStop = self.Disabled = self.Stopping = self.StandStill = False
        self.DiscreteMotion = self.ContinuousMotion = self.SynchronizedMotion = self.Homing = False
        self.ConstantVelocity = self.Accelerating = self.Decelerating = False
        super().__init__(axis, **inputs)

    @override
    def _read(self) -> int:
        image = self.Axis.NcToPlc
        state = image.StateDWord
        enabled = bool(state & State.OPERATIONAL)
        moving = not state & State.NOT_MOVING
        self.ErrorStop = bool(state & State.ERROR)
        self.Disabled = not enabled and not self.ErrorStop
        self.Homing = bool(state & State.HOMING_BUSY)
        self.SynchronizedMotion = enabled and bool(state & State.PROTECTED)
        self.Stopping = (
            enabled
            and bool(state & State.HAS_BEEN_STOPPED)
            and (moving or bool(state & State.MOTION_COMMANDS_LOCKED))
        )
        free = enabled and not (self.Homing or self.SynchronizedMotion or self.Stopping)
        self.ContinuousMotion = free and bool(state & State.CONTINUOUS_MOTION)
        self.DiscreteMotion = free and bool(state & State.HAS_JOB) and not self.ContinuousMotion
        self.StandStill = free and not (self.ContinuousMotion or self.DiscreteMotion)
        self.ConstantVelocity = moving and bool(state & State.CONSTANT_VELOCITY)
        self.Accelerating, self.Decelerating = image.AxisState == 4, image.AxisState == 5
        return 0

    def bit(self, state: State) -> bool:
        """Return a bit of the status double word as of the last transfer."""
        return self.Valid and self.Axis.state(state)


class MC_ReadActualPosition(_EnabledBlock):
    """Reads the actual position."""

    block = "MC_ReadActualPosition"

    def __init__(self, axis: AxisRef, **inputs: float) -> None:
        self.Position = 0.0
        super().__init__(axis, **inputs)

    @override
    def _read(self) -> int:
        self.Position = self.Axis.NcToPlc.ActPos
        return 0


class MC_ReadActualVelocity(_EnabledBlock):
    """Reads the actual velocity."""

    block = "MC_ReadActualVelocity"

    def __init__(self, axis: AxisRef, **inputs: float) -> None:
        self.ActualVelocity = 0.0
        super().__init__(axis, **inputs)

    @override
    def _read(self) -> int:
        self.ActualVelocity = self.Axis.NcToPlc.ActVelo
        return 0


class MC_ReadAxisError(_EnabledBlock):
    """Reads the error code of the axis."""

    block = "MC_ReadAxisError"

    def __init__(self, axis: AxisRef, **inputs: float) -> None:
        self.AxisErrorID = 0
        super().__init__(axis, **inputs)

    @override
    def _read(self) -> int:
        self.AxisErrorID = self.Axis.NcToPlc.ErrorCode
        return 0


def _value(block: Block, number: int) -> Value | None:
    """Return the value of a number; None: there is no such number."""
    state = _STATES.get(number)
    if state is not None:
        return state(block.Axis.NcToPlc)
    key = _KEYS.get(number)
    return None if key is None else block.Axis.axis.parameters.read(key)


def _write(block: Block, number: int, value: Value, *, flag: bool) -> int:
    """Write a parameter; returns an error code, 0 for none."""
    key = _KEYS.get(number)
    if key is None or (catalogue()[key].type == "bool") is not flag:
        return BLOCK_PARAMETER
    try:
        block.Axis.axis.parameters.write(key, value)
    except RefusedParameterError as refused:
        return refused.error_id
    except ConfigurationError:
        return BLOCK_PARAMETER
    return 0


class MC_ReadParameter(_EnabledBlock):
    """Reads a number of `AxisParameter`."""

    block = "MC_ReadParameter"
    inputs: ClassVar[dict[str, Any]] = {"Enable": False, "ParameterNumber": 0}
    ParameterNumber: int

    def __init__(self, axis: AxisRef, **inputs: float) -> None:
        self.Value = 0.0
        super().__init__(axis, **inputs)

    @override
    def _read(self) -> int:
        value = _value(self, int(self.ParameterNumber))
        if isinstance(value, bool) or not isinstance(value, int | float):
            return BLOCK_PARAMETER
        self.Value = float(value)
        return 0


class MC_ReadBoolParameter(_EnabledBlock):
    """Reads a flag of `AxisParameter`."""

    block = "MC_ReadBoolParameter"
    inputs: ClassVar[dict[str, Any]] = {"Enable": False, "ParameterNumber": 0}
    ParameterNumber: int

    def __init__(self, axis: AxisRef, **inputs: float) -> None:
        self.Value = False
        super().__init__(axis, **inputs)

    @override
    def _read(self) -> int:
        value = _value(self, int(self.ParameterNumber))
        if not isinstance(value, bool):
            return BLOCK_PARAMETER
        self.Value = value
        return 0


class MC_WriteParameter(ExecuteBlock):
    """Writes a number of `AxisParameter`; it acts from the next cycle of the axis on."""

    block = "MC_WriteParameter"
    inputs: ClassVar[dict[str, Any]] = {"Execute": False, "ParameterNumber": 0, "Value": 0.0}
    ParameterNumber: int
    Value: float

    @override
    def _begin(self) -> None:
        self._finish(_write(self, int(self.ParameterNumber), float(self.Value), flag=False))


class MC_WriteBoolParameter(ExecuteBlock):
    """Writes a flag of `AxisParameter`."""

    block = "MC_WriteBoolParameter"
    inputs: ClassVar[dict[str, Any]] = {"Execute": False, "ParameterNumber": 0, "Value": False}
    ParameterNumber: int
    Value: bool

    @override
    def _begin(self) -> None:
        self._finish(_write(self, int(self.ParameterNumber), bool(self.Value), flag=True))


class MC_ReadParameterSet(_EnabledBlock):
    """Reads all parameters of the axis; `Parameter` has them by key."""

    block = "MC_ReadParameterSet"

    def __init__(self, axis: AxisRef, **inputs: float) -> None:
        self.Parameter: dict[str, Value] = {}
        super().__init__(axis, **inputs)

    @override
    def _read(self) -> int:
        parameters = self.Axis.axis.parameters
        self.Parameter = {key: parameters.read(key) for key in catalogue()}
        return 0
