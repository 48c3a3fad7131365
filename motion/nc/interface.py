"""The cyclic interface between PLC and NC: two structures of 128 and 256 byte (NC-429 to NC-471)."""

from __future__ import annotations

from enum import IntFlag
from math import floor
from struct import Struct
from typing import Final

_PLC_TO_NC: Final = Struct("<IIIIdddddiI5dBBB5xd8x")
_NC_TO_PLC: Final = Struct("<10I2dHHi7diHH3d4I8B8H2d16x2dI12x")
FULL_OVERRIDE: Final = 1_000_000
"""`Override` that means 100 %."""


class Control(IntFlag):
    """Bits of `PlcToNc.ControlDWord` (NC-430)."""

    ENABLE = 1 << 0
    FEED_PLUS = 1 << 1
    FEED_MINUS = 1 << 2
    HOMING_SENSOR = 1 << 5
    ACCEPT_BLOCKED_DRIVE = 1 << 8
    BLOCKED_DRIVE_DETECTED = 1 << 9


class State(IntFlag):
    """Bits of `NcToPlc.StateDWord` (NC-440 to NC-471)."""

    OPERATIONAL = 1 << 0
    HOMED = 1 << 1
    NOT_MOVING = 1 << 2
    IN_POSITION_AREA = 1 << 3
    IN_TARGET_POSITION = 1 << 4
    PROTECTED = 1 << 5
    ERROR_PROPAGATION_DELAYED = 1 << 6
    HAS_BEEN_STOPPED = 1 << 7
    HAS_JOB = 1 << 8
    POSITIVE_DIRECTION = 1 << 9
    NEGATIVE_DIRECTION = 1 << 10
    HOMING_BUSY = 1 << 11
    CONSTANT_VELOCITY = 1 << 12
    COMPENSATING = 1 << 13
    EXT_SET_POINT_GEN_ENABLED = 1 << 14
    MODE_PENDING = 1 << 15
    EXTERNAL_LATCH_VALID = 1 << 16
    NEW_TARGET_POS = 1 << 17
    TARGET_UNREACHABLE = 1 << 18
    CONTINUOUS_MOTION = 1 << 19
    CONTROL_LOOP_CLOSED = 1 << 20
    CAM_TABLE_QUEUED = 1 << 21
    CAM_DATA_QUEUED = 1 << 22
    CAM_SCALING_PENDING = 1 << 23
    CMD_BUFFERED = 1 << 24
    PTP_MODE = 1 << 25
    SOFT_LIMIT_MIN_EXCEEDED = 1 << 26
    SOFT_LIMIT_MAX_EXCEEDED = 1 << 27
    DRIVE_DEVICE_ERROR = 1 << 28
    MOTION_COMMANDS_LOCKED = 1 << 29
    IO_DATA_INVALID = 1 << 30
    ERROR = 1 << 31


STATUS_BITS: Final = {
    "Operational": State.OPERATIONAL,
    "Homed": State.HOMED,
    "NotMoving": State.NOT_MOVING,
    "InPositionArea": State.IN_POSITION_AREA,
    "InTargetPosition": State.IN_TARGET_POSITION,
    "Protected": State.PROTECTED,
    "ErrorPropagationDelayed": State.ERROR_PROPAGATION_DELAYED,
    "HasBeenStopped": State.HAS_BEEN_STOPPED,
    "HasJob": State.HAS_JOB,
    "PositiveDirection": State.POSITIVE_DIRECTION,
    "NegativeDirection": State.NEGATIVE_DIRECTION,
    "HomingBusy": State.HOMING_BUSY,
    "ConstantVelocity": State.CONSTANT_VELOCITY,
    "Compensating": State.COMPENSATING,
    "ExtSetPointGenEnabled": State.EXT_SET_POINT_GEN_ENABLED,
    "ExternalLatchValid": State.EXTERNAL_LATCH_VALID,
    "NewTargetPos": State.NEW_TARGET_POS,
    "ContinuousMotion": State.CONTINUOUS_MOTION,
    "ControlLoopClosed": State.CONTROL_LOOP_CLOSED,
    "CamTableQueued": State.CAM_TABLE_QUEUED,
    "CamDataQueued": State.CAM_DATA_QUEUED,
    "CamScalingPending": State.CAM_SCALING_PENDING,
    "CmdBuffered": State.CMD_BUFFERED,
    "PTPmode": State.PTP_MODE,
    "SoftLimitMinExceeded": State.SOFT_LIMIT_MIN_EXCEEDED,
    "SoftLimitMaxExceeded": State.SOFT_LIMIT_MAX_EXCEEDED,
    "DriveDeviceError": State.DRIVE_DEVICE_ERROR,
    "MotionCommandsLocked": State.MOTION_COMMANDS_LOCKED,
    "IoDataInvalid": State.IO_DATA_INVALID,
    "Error": State.ERROR,
}
"""Members of `AXIS_REF.Status` with their bits."""


class OpMode(IntFlag):
    """Bits of `NcToPlc.OpModeDWord`; the upper eight bits count the cycles of the NC."""

    POSITION_AREA_MONITORING = 1 << 0
    TARGET_POSITION_MONITORING = 1 << 1
    LOOP_MODE = 1 << 2
    MOTION_MONITORING = 1 << 3
    IN_TARGET_ALARM = 1 << 4
    DELAYED_ERROR_REACTION = 1 << 6
    SIMULATION_AXIS = 1 << 8
    POSITION_LAG_MONITORING = 1 << 16
    SOFT_LIMIT_MIN_MONITORING = 1 << 18
    SOFT_LIMIT_MAX_MONITORING = 1 << 19
    POSITION_CORRECTION = 1 << 20
    ALLOW_SLAVE_COMMANDS = 1 << 21
    ALLOW_EXT_SET_AXIS_COMMANDS = 1 << 22
    NC_APPLICATION_REQUEST = 1 << 23


class PlcToNc:
    """`PLCTONC_AXIS_REF`, 128 byte: what the PLC says to the axis."""

    __slots__ = (
        "AxisModeDWord",
        "AxisModeLReal",
        "AxisModeRequest",
        "ControlDWord",
        "ExtControllerOutput",
        "ExtSetAcc",
        "ExtSetDirection",
        "ExtSetPos",
        "ExtSetVelo",
        "ExtTorque",
        "GearRatio1",
        "GearRatio2",
        "GearRatio3",
        "GearRatio4",
        "MapState",
        "Override",
        "PlcCycleControl",
        "PlcCycleCount",
        "PositionCorrection",
    )

    def __init__(self) -> None:
        self.ControlDWord = 0
        self.Override = 0
        """0 to 1000000 = 0 to 100 %; more counts as 100 % (NC-173, NC-431)."""
        self.AxisModeRequest = 0
        self.AxisModeDWord = 0
        self.AxisModeLReal = 0.0
        self.PositionCorrection = 0.0
        """Correction, position unit (NC-206)."""
        self.ExtSetPos = 0.0
        self.ExtSetVelo = 0.0
        self.ExtSetAcc = 0.0
        self.ExtSetDirection = 0
        """-1, 0 or +1; 0: the packet is not taken over (NC-580)."""
        self.ExtControllerOutput = 0.0
        self.GearRatio1 = 0.0
        self.GearRatio2 = 0.0
        self.GearRatio3 = 0.0
        self.GearRatio4 = 0.0
        self.MapState = 0
        self.PlcCycleControl = 0
        self.PlcCycleCount = 0
        """Counts the cycles of the PLC, 8 bit: the mark of fresh data (NC-438)."""
        self.ExtTorque = 0.0

    def pack(self) -> bytes:
        """Return the structure as the image has it, 128 byte."""
        return _PLC_TO_NC.pack(
            self.ControlDWord,
            self.Override,
            self.AxisModeRequest,
            self.AxisModeDWord,
            self.AxisModeLReal,
            self.PositionCorrection,
            self.ExtSetPos,
            self.ExtSetVelo,
            self.ExtSetAcc,
            self.ExtSetDirection,
            0,
            self.ExtControllerOutput,
            self.GearRatio1,
            self.GearRatio2,
            self.GearRatio3,
            self.GearRatio4,
            self.MapState,
            self.PlcCycleControl,
            self.PlcCycleCount,
            self.ExtTorque,
        )

    def unpack(self, image: bytes) -> None:
        """Take over an image of 128 byte."""
        (
            self.ControlDWord,
            self.Override,
            self.AxisModeRequest,
            self.AxisModeDWord,
            self.AxisModeLReal,
            self.PositionCorrection,
            self.ExtSetPos,
            self.ExtSetVelo,
            self.ExtSetAcc,
            self.ExtSetDirection,
            _,
            self.ExtControllerOutput,
            self.GearRatio1,
            self.GearRatio2,
            self.GearRatio3,
            self.GearRatio4,
            self.MapState,
            self.PlcCycleControl,
            self.PlcCycleCount,
            self.ExtTorque,
        ) = _PLC_TO_NC.unpack(image)

    def take(self, other: PlcToNc) -> None:
        """Take over what another copy says: the transfer of one cycle."""
        self.ControlDWord = other.ControlDWord
        self.Override = other.Override
        self.PositionCorrection = other.PositionCorrection
        self.ExtSetPos = other.ExtSetPos
        self.ExtSetVelo = other.ExtSetVelo
        self.ExtSetAcc = other.ExtSetAcc
        self.ExtSetDirection = other.ExtSetDirection
        self.ExtControllerOutput = other.ExtControllerOutput
        self.GearRatio1 = other.GearRatio1
        self.GearRatio2 = other.GearRatio2
        self.GearRatio3 = other.GearRatio3
        self.GearRatio4 = other.GearRatio4
        self.AxisModeRequest = other.AxisModeRequest
        self.AxisModeDWord = other.AxisModeDWord
        self.AxisModeLReal = other.AxisModeLReal
        self.MapState = other.MapState
        self.PlcCycleControl = other.PlcCycleControl
        self.PlcCycleCount = other.PlcCycleCount
        self.ExtTorque = other.ExtTorque

    def clear(self) -> None:
        """Make everything zero, as the watchdog does (NC-015)."""
        self.unpack(bytes(_PLC_TO_NC.size))


class NcToPlc:
    """`NCTOPLC_AXIS_REF`, 256 byte: what the axis says to the PLC."""

    __slots__ = (
        "ActAcc",
        "ActPos",
        "ActPosWithoutPosCorrection",
        "ActTorque",
        "ActTorqueDerivative",
        "ActVelo",
        "ActiveControlLoopIndex",
        "AxisId",
        "AxisModeConfirmation",
        "AxisState",
        "CamCouplingState",
        "CamCouplingTableID",
        "CmdNo",
        "CmdState",
        "ControlLoopIndex",
        "CoupleState",
        "DcTimeStamp",
        "ErrorCode",
        "HomingState",
        "OpModeDWord",
        "PosDiff",
        "SafEntries",
        "SetAcc",
        "SetJerk",
        "SetPos",
        "SetTorque",
        "SetTorqueDerivative",
        "SetVelo",
        "StateDWord",
        "StateDWord2",
        "StateDWord3",
        "SvbEntries",
        "TargetPos",
        "TouchProbeCounter",
        "TouchProbeState",
        "modulo_factor",
    )

    def __init__(self) -> None:
        self.clear()

    def clear(self) -> None:
        """Make everything zero, as the watchdog does (NC-020)."""
        self.StateDWord = self.ErrorCode = self.AxisState = self.AxisModeConfirmation = 0
        self.HomingState = self.CoupleState = self.SvbEntries = self.SafEntries = 0
        self.AxisId = self.OpModeDWord = 0
        self.ActPos = 0.0
        self.modulo_factor = 0.0
        """Length of a modulo turn, position unit; no member of the structure. 0.0: it is not known yet."""
        self.ActiveControlLoopIndex = self.ControlLoopIndex = 0
        self.ActVelo = self.PosDiff = self.SetPos = self.SetVelo = self.SetAcc = 0.0
        self.TargetPos = 0.0
        self.CmdNo = self.CmdState = 0
        self.SetJerk = self.SetTorque = self.ActTorque = 0.0
        self.StateDWord2 = self.StateDWord3 = self.TouchProbeState = self.TouchProbeCounter = 0
        self.CamCouplingState: tuple[int, ...] = (0,) * 8
        self.CamCouplingTableID: tuple[int, ...] = (0,) * 8
        self.ActTorqueDerivative = self.SetTorqueDerivative = 0.0
        self.ActPosWithoutPosCorrection = self.ActAcc = 0.0
        self.DcTimeStamp = 0

    # Derived where they are read: few programs do, and they cost as much as the rest of the transfer.

    @property
    def ModuloActTurns(self) -> int:
        """Whole modulo turns of `ActPos`."""
        return self._turns(self.ActPos)

    @property
    def ModuloActPos(self) -> float:
        """`ActPos` within its turn, position unit."""
        return self._within_turn(self.ActPos)

    @property
    def ModuloSetTurns(self) -> int:
        """Whole modulo turns of `SetPos`."""
        return self._turns(self.SetPos)

    @property
    def ModuloSetPos(self) -> float:
        """`SetPos` within its turn, position unit."""
        return self._within_turn(self.SetPos)

    def _turns(self, position: float) -> int:
        return floor(position / self.modulo_factor) if self.modulo_factor else 0

    def _within_turn(self, position: float) -> float:
        return position - self._turns(position) * self.modulo_factor if self.modulo_factor else 0.0

    def pack(self) -> bytes:
        """Return the structure as the image has it, 256 byte."""
        return _NC_TO_PLC.pack(
            self.StateDWord,
            self.ErrorCode,
            self.AxisState,
            self.AxisModeConfirmation,
            self.HomingState,
            self.CoupleState,
            self.SvbEntries,
            self.SafEntries,
            self.AxisId,
            self.OpModeDWord,
            self.ActPos,
            self.ModuloActPos,
            self.ActiveControlLoopIndex,
            self.ControlLoopIndex,
            self.ModuloActTurns,
            self.ActVelo,
            self.PosDiff,
            self.SetPos,
            self.SetVelo,
            self.SetAcc,
            self.TargetPos,
            self.ModuloSetPos,
            self.ModuloSetTurns,
            self.CmdNo,
            self.CmdState,
            self.SetJerk,
            self.SetTorque,
            self.ActTorque,
            self.StateDWord2,
            self.StateDWord3,
            self.TouchProbeState,
            self.TouchProbeCounter,
            *self.CamCouplingState,
            *self.CamCouplingTableID,
            self.ActTorqueDerivative,
            self.SetTorqueDerivative,
            self.ActPosWithoutPosCorrection,
            self.ActAcc,
            self.DcTimeStamp,
        )


PLC_TO_NC_SIZE: Final = _PLC_TO_NC.size
NC_TO_PLC_SIZE: Final = _NC_TO_PLC.size

PLC_TO_NC: Final = (
    ("ControlDWord", "DWORD", 0),
    ("Override", "UDINT", 4),
    ("AxisModeRequest", "UDINT", 8),
    ("AxisModeDWord", "UDINT", 12),
    ("AxisModeLReal", "LREAL", 16),
    ("PositionCorrection", "LREAL", 24),
    ("ExtSetPos", "LREAL", 32),
    ("ExtSetVelo", "LREAL", 40),
    ("ExtSetAcc", "LREAL", 48),
    ("ExtSetDirection", "DINT", 56),
    ("ExtControllerOutput", "LREAL", 64),
    ("GearRatio1", "LREAL", 72),
    ("GearRatio2", "LREAL", 80),
    ("GearRatio3", "LREAL", 88),
    ("GearRatio4", "LREAL", 96),
    ("MapState", "BYTE", 104),
    ("PlcCycleControl", "BYTE", 105),
    ("PlcCycleCount", "BYTE", 106),
    ("ExtTorque", "LREAL", 112),
)
"""Members of `PLCTONC_AXIS_REF` with types and offsets, byte."""
NC_TO_PLC: Final = (
    ("StateDWord", "DWORD", 0),
    ("ErrorCode", "UDINT", 4),
    ("AxisState", "UDINT", 8),
    ("AxisModeConfirmation", "UDINT", 12),
    ("HomingState", "UDINT", 16),
    ("CoupleState", "UDINT", 20),
    ("SvbEntries", "UDINT", 24),
    ("SafEntries", "UDINT", 28),
    ("AxisId", "UDINT", 32),
    ("OpModeDWord", "DWORD", 36),
    ("ActPos", "LREAL", 40),
    ("ModuloActPos", "LREAL", 48),
    ("ActiveControlLoopIndex", "UINT", 56),
    ("ControlLoopIndex", "UINT", 58),
    ("ModuloActTurns", "DINT", 60),
    ("ActVelo", "LREAL", 64),
    ("PosDiff", "LREAL", 72),
    ("SetPos", "LREAL", 80),
    ("SetVelo", "LREAL", 88),
    ("SetAcc", "LREAL", 96),
    ("TargetPos", "LREAL", 104),
    ("ModuloSetPos", "LREAL", 112),
    ("ModuloSetTurns", "DINT", 120),
    ("CmdNo", "UINT", 124),
    ("CmdState", "UINT", 126),
    ("SetJerk", "LREAL", 128),
    ("SetTorque", "LREAL", 136),
    ("ActTorque", "LREAL", 144),
    ("StateDWord2", "DWORD", 152),
    ("StateDWord3", "DWORD", 156),
    ("TouchProbeState", "UDINT", 160),
    ("TouchProbeCounter", "UDINT", 164),
    ("ActTorqueDerivative", "LREAL", 192),
    ("SetTorqueDerivative", "LREAL", 200),
    ("ActPosWithoutPosCorrection", "LREAL", 224),
    ("ActAcc", "LREAL", 232),
    ("DcTimeStamp", "UDINT", 240),
)
"""Members of `NCTOPLC_AXIS_REF` with types and offsets, byte."""
