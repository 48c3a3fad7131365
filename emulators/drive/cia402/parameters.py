"""When the drive takes over what has been written to its parameters, and its digital outputs (C402-169)."""

from __future__ import annotations

from emulators.drive.cia402.axis import ProfileAxis
from emulators.events import Emit

_MASK = 0x60FE02
_OUTPUTS = 0x60FE01


class Parameters:
    """Converted parameters of the axis; they are taken over before something acts on them.

    Args:
        axis: The motor as the profile sees it.
        emit: Writes changes of the outputs into the log.

    """

    def __init__(self, axis: ProfileAxis, emit: Emit) -> None:
        self._axis = axis
        self._emit = emit
        self.changed = False
        """An object has been written whose converted value the drive keeps."""
        self.outputs = 0
        """Digital outputs that are on: 60FEh:1 as far as 60FEh:2 enables it."""

    def take(self) -> None:
        """Take written parameters over, if there are any."""
        if self.changed:
            self.refresh()

    def refresh(self) -> None:
        """Take the parameters over."""
        self.changed = False
        axis = self._axis
        axis.refresh()
        mask = axis.values[_MASK]
        outputs = axis.values[_OUTPUTS] & mask
        brake = axis.core.brake
        if brake.fitted:
            brake.forced_open = bool(mask & 1 and not outputs & 1)
            brake.forced_closed = bool(outputs & 1)
        if outputs != self.outputs:
            self.outputs = outputs
            self._emit("drive.outputs", outputs=outputs)
