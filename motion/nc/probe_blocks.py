"""Blocks of the touch probe (`MC_TouchProbe`, `MC_AbortTrigger`)."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, ClassVar

from typing_extensions import override

from motion.nc.blocks import ExecuteBlock
from motion.nc.errors import BLOCK_PARAMETER
from motion.nc.touch_probe import ProbeSource

if TYPE_CHECKING:
    from motion.nc.axis_ref import AxisRef


class MC_TouchProbe(ExecuteBlock):
    """Records the position of the axis at an edge (NC-382, NC-456).

    `TriggerInput` is a `ProbeSource`. With `WindowOnly` an edge counts from `FirstPosition` to `LastPosition`
    alone.
    """

    block = "MC_TouchProbe"
    inputs: ClassVar[dict[str, Any]] = {
        "Execute": False,
        "TriggerInput": ProbeSource.LATCH_POSITIVE,
        "WindowOnly": False,
        "FirstPosition": 0.0,
        "LastPosition": 0.0,
    }
    TriggerInput: int
    WindowOnly: bool
    FirstPosition: float
    LastPosition: float

    def __init__(self, axis: AxisRef, **inputs: float) -> None:
        self.RecordedPosition = 0.0
        super().__init__(axis, **inputs)

    @override
    def _begin(self) -> None:
        if int(self.TriggerInput) not in set(ProbeSource):
            self._finish(BLOCK_PARAMETER)
            return
        window = (self.FirstPosition, self.LastPosition) if self.WindowOnly else None
        refused = self.Axis.axis.probe.start(ProbeSource(int(self.TriggerInput)), window)
        if refused:
            self._finish(refused)
        else:
            self.Busy = self.Active = True

    @override
    def _go_on(self) -> None:
        probe = self.Axis.axis.probe
        if probe.valid:
            self.RecordedPosition = probe.position
            self._finish()
        elif not probe.active:
            self._finish()
            self.Done = False
            self.CommandAborted = True


class MC_AbortTrigger(ExecuteBlock):
    """Ends the wait of `MC_TouchProbe`."""

    block = "MC_AbortTrigger"
    inputs: ClassVar[dict[str, Any]] = {"Execute": False}

    @override
    def _begin(self) -> None:
        self.Axis.axis.probe.cancel()
        self._finish()
