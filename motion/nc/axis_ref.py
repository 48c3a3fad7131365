"""`AXIS_REF`: the axis as a PLC program sees it (NC-429, NC-474 to NC-478)."""

from __future__ import annotations

from typing import TYPE_CHECKING

from motion.nc.interface import STATUS_BITS, NcToPlc, PlcToNc, State

if TYPE_CHECKING:
    from motion.nc.axis import NcAxis


class AxisStatus:
    """`AXIS_REF.Status` (`ST_AxisStatus`): as of the last `ReadStatus()`."""

    def __init__(self) -> None:
        self.StateDWord = 0
        self.ErrorID = 0
        self.AxisState = 0
        self.HomingState = 0
        self.OpModeDWord = 0

    def __getattr__(self, name: str) -> bool:
        """Return a bit of the status double word by its name."""
        bit = STATUS_BITS.get(name)
        if bit is None:
            raise AttributeError(f"Status has no {name!r}; it has: {', '.join(STATUS_BITS)}")
        return bool(self.StateDWord & bit)


class AxisRef:
    """The instance of an axis in a PLC program.

    Args:
        axis: The axis.

    """

    def __init__(self, axis: NcAxis) -> None:
        self.axis = axis
        self.PlcToNc = PlcToNc()
        """What the program says to the axis; the next transfer brings it there."""
        self.image = NcToPlc()
        """`NcToPlc`: what the axis says, as of the last transfer."""
        self.Status = AxisStatus()
        self.plc_cycle_s = axis.cycle_s
        """Cycle in which the PLC calls its blocks, s."""

    def restart(self, axis: NcAxis) -> None:
        """Be the instance of the axis that the system has started with; what the program says stays."""
        self.axis = axis
        self.image = NcToPlc()

    @property
    def NcToPlc(self) -> NcToPlc:
        """What the axis says, as of the last transfer."""
        return self.image

    def clear(self) -> None:
        """Show zeros: the watchdog has cleared the structure (NC-020)."""
        self.image = NcToPlc()

    def ReadStatus(self) -> None:
        """Refresh `Status`; once at the start of each cycle of the PLC (NC-475)."""
        image, status = self.image, self.Status
        status.StateDWord = image.StateDWord
        status.ErrorID = image.ErrorCode
        status.AxisState = image.AxisState
        status.HomingState = image.HomingState
        status.OpModeDWord = image.OpModeDWord

    def state(self, bit: State) -> bool:
        """Return a bit of `StateDWord` as of the last transfer."""
        return bool(self.image.StateDWord & bit)
