"""Blocks that add to the motion of an axis: superposed motion, position correction, backlash (sections 10.1,
11.5, 18).
"""

from __future__ import annotations

from enum import IntEnum
from math import sqrt
from typing import TYPE_CHECKING, ClassVar, Final

from typing_extensions import override

from motion.nc.blocks import Block, MotionBlock
from motion.nc.commands import POSITION, Command, CommandState
from motion.nc.errors import BLOCK_MODE, BLOCK_PARAMETER

if TYPE_CHECKING:
    from motion.nc.axis_ref import AxisRef

_STANDS: Final = 1e-9


class MC_MoveSuperImposed(MotionBlock):
    """Adds `Distance` with at most `VelocityDiff` to what the axis does, as a master or a slave (NC-245)."""

    block = "MC_MoveSuperImposed"
    inputs: ClassVar[dict[str, float]] = {
        "Execute": False,
        "Distance": 0.0,
        "VelocityDiff": 0.0,
        "Acceleration": 0.0,
        "Deceleration": 0.0,
        "Jerk": 0.0,
    }
    Distance: float
    VelocityDiff: float

    @override
    def _make(self) -> Command | int:
        acceleration, deceleration, jerk = self.Axis.axis.dynamics(
            self.Acceleration, self.Deceleration, self.Jerk
        )
        return Command(
            POSITION,
            velocity=self.VelocityDiff,
            acceleration=acceleration,
            deceleration=deceleration,
            jerk=jerk,
            target=self.Distance,
        )

    @override
    def _submit(self, command: Command) -> int:
        return self.Axis.axis.superimpose(command)


class MC_AbortSuperposition(Block):
    """Ends a superposed motion; its way so far stays."""

    block = "MC_AbortSuperposition"
    inputs: ClassVar[dict[str, float]] = {"Execute": False}
    Execute: bool

    def __init__(self, axis: AxisRef, **inputs: float) -> None:
        self.Done = False
        self._last = False
        super().__init__(axis, **inputs)

    @override
    def _call(self) -> None:
        execute, last = bool(self.Execute), self._last
        self._last = execute
        if execute and not last:
            self.Axis.axis.superposed.abort(CommandState.ABORTED, 0)
        self.Done = execute


class CorrectionMode(IntEnum):
    """`E_AxisPositionCorrectionMode`."""

    POSITIONCORRECTION_MODE_UNLIMITED = 0
    """The value acts as it is."""
    POSITIONCORRECTION_MODE_FAST = 1
    """The correction changes by at most the way of Maximum Acceleration within a cycle of the PLC."""
    POSITIONCORRECTION_MODE_FULLLENGTH = 2
    """The correction changes over `CorrectionLength`, the way of the axis."""


class MC_PositionCorrectionLimiter(Block):
    """Writes the position correction, directly or filtered by its `CorrectionMode` (NC-208)."""

    block = "MC_PositionCorrectionLimiter"
    inputs: ClassVar[dict[str, float]] = {
        "Enable": False,
        "PositionCorrectionValue": 0.0,
        "CorrectionMode": CorrectionMode.POSITIONCORRECTION_MODE_UNLIMITED,
        "Acceleration": 0.0,
        "CorrectionLength": 0.0,
    }
    Enable: bool
    PositionCorrectionValue: float
    CorrectionMode: int
    Acceleration: float
    CorrectionLength: float

    def __init__(self, axis: AxisRef, **inputs: float) -> None:
        self.Limiting = False
        """The value has not been reached yet."""
        self._velocity = 0.0
        self._place: float | None = None
        super().__init__(axis, **inputs)

    @override
    def _call(self) -> None:
        self.Error, self.ErrorID = False, 0
        self.Busy = bool(self.Enable)
        if not self.Enable:
            self.Limiting, self._velocity, self._place = False, 0.0, None
            return
        axis = self.Axis.axis
        if not axis.parameters.read("axis.position_correction"):
            self._fail(BLOCK_MODE)
            return
        mode = int(self.CorrectionMode)
        written = self.Axis.PlcToNc
        left = self.PositionCorrectionValue - written.PositionCorrection
        if mode == CorrectionMode.POSITIONCORRECTION_MODE_UNLIMITED:
            step = left
        elif mode == CorrectionMode.POSITIONCORRECTION_MODE_FAST:
            step = self._by_acceleration(left)
        elif mode == CorrectionMode.POSITIONCORRECTION_MODE_FULLLENGTH and self.CorrectionLength > 0.0:
            step = self._over_length(left)
        else:
            self._fail(BLOCK_PARAMETER)
            return
        written.PositionCorrection += step
        self.Limiting = abs(left - step) > _STANDS

    def _fail(self, error_id: int) -> None:
        self.Error, self.ErrorID, self.Limiting = True, error_id, False

    def _by_acceleration(self, left: float) -> float:
        """Return the step of this cycle towards the value, with a limited acceleration."""
        axis = self.Axis.axis
        dt = self.Axis.plc_cycle_s
        acceleration = self.Acceleration or axis.parameters.cell("axis.default_acceleration").value
        direction = 1.0 if left >= 0.0 else -1.0
        change = acceleration * dt
        # The velocity from which steps of `change` end exactly there.
        fastest = sqrt(2.0 * acceleration * abs(left) + 0.25 * change * change) - 0.5 * change
        wanted = direction * fastest
        velocity = min(max(wanted, self._velocity - change), self._velocity + change)
        step = velocity * dt
        if abs(left) <= 0.5 * change * dt or (abs(step) >= abs(left) and step * left > 0.0):
            step, velocity = left, 0.0
        self._velocity = velocity
        return step

    def _over_length(self, left: float) -> float:
        """Return the step of this cycle: its share of the way that the axis has gone."""
        position = self.Axis.NcToPlc.SetPos
        before, self._place = self._place, position
        if before is None:
            return 0.0
        share = min(abs(position - before) / self.CorrectionLength, 1.0) * abs(self._whole(left))
        return left if share >= abs(left) else share if left > 0.0 else -share

    def _whole(self, left: float) -> float:
        return self.PositionCorrectionValue if abs(self.PositionCorrectionValue) >= abs(left) else left


class DisableMode(IntEnum):
    """`E_DisableMode`: what becomes of the correction when the compensation is switched off."""

    DisableModeHold = 0
    """It stays."""
    DisableModeReset = 1
    """It goes to 0."""


class MC_BacklashCompensation(Block):
    """Compensates backlash by position correction (NC-599 to NC-605).

    `CompensationInPositiveDirection` TRUE: the reference is at the right edge, the correction acts in
    positive direction; FALSE: at the left edge, in negative direction. `Ramp` is the velocity with which the
    correction changes, position unit/s; 0.0: at once.
    """

    block = "MC_BacklashCompensation"
    inputs: ClassVar[dict[str, float]] = {
        "Enable": False,
        "Backlash": 0.0,
        "CompensationInPositiveDirection": False,
        "Ramp": 0.0,
        "DisableMode": DisableMode.DisableModeReset,
    }
    Enable: bool
    Backlash: float
    CompensationInPositiveDirection: bool
    Ramp: float
    DisableMode: int

    def __init__(self, axis: AxisRef, **inputs: float) -> None:
        self.Active = False
        """The compensation is at work."""
        self.Enabled = False
        self._direction = 0
        self._value = 0.0
        super().__init__(axis, **inputs)

    @override
    def _call(self) -> None:
        self.Error, self.ErrorID = False, 0
        axis = self.Axis.axis
        wanted = 0.0
        if self.Enable:
            if not axis.parameters.read("axis.position_correction"):
                self.Error, self.ErrorID = True, BLOCK_MODE
                self.Enabled = self.Active = self.Busy = False
                return
            velocity = self.Axis.NcToPlc.SetVelo
            if abs(velocity) > _STANDS:
                self._direction = 1 if velocity > 0.0 else -1
            right = bool(self.CompensationInPositiveDirection)
            if self._direction == (1 if right else -1):
                wanted = -self.Backlash if right else self.Backlash
        elif int(self.DisableMode) == DisableMode.DisableModeHold:
            wanted = self._value
        else:
            self._direction = 0
        self.Enabled = self.Busy = bool(self.Enable)
        self._go(wanted, self.Axis.plc_cycle_s)
        self.Active = abs(self._value - wanted) > _STANDS

    def _go(self, wanted: float, dt: float) -> None:
        before = self._value
        step = wanted - before
        if self.Ramp > 0.0:
            most = self.Ramp * dt
            step = min(max(step, -most), most)
        self._value = before + step
        # Another user of the correction keeps his share.
        self.Axis.PlcToNc.PositionCorrection += step
