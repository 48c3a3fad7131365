"""`MC_Power` (section 2.1 of the instruction specification)."""

from __future__ import annotations

from typing import Any, ClassVar, Final

from typing_extensions import override

from motion.s7.axis.jobs import (
    ERROR_ALARM,
    ERROR_CONTROL_PANEL,
    ERROR_MODE,
    ERROR_SECOND_INSTANCE,
    ERROR_STOP_MODE,
    NO_ERROR,
)
from motion.s7.instructions.base import Instruction


def _bool(value: object) -> str:
    return "TRUE" if value else "FALSE"


_STOP_MODES: Final = (0, 1, 2, 3)
_START_MODES: Final = (0, 1)


class MC_Power(Instruction):
    """Enable and disable a technology object.

    Inputs: `Enable`; `StartMode` 0 without, 1 with position control; `StopMode`
        0 emergency stop, 1 quick stop,
    2 maximum dynamic values, 3 coast. Outputs: `Status`, `Busy`, `Error`, `ErrorID`. An external encoder has
    neither mode: it is enabled as soon as its value is valid.
    """

    instruction = "MC_Power"
    object_types = ("SpeedAxis", "PositioningAxis", "ExternalEncoder")
    inputs: ClassVar[dict[str, float]] = {"Enable": False, "StartMode": 1, "StopMode": 0}
    Enable: bool
    StartMode: int
    StopMode: int

    def __init__(self, axis: Any, *, name: str | None = None, **inputs: float) -> None:
        self.Status = False
        self._stale = False
        """`Enable` has been TRUE while a control panel had the axis: it takes a new edge (COM-072)."""
        super().__init__(axis, name=name, **inputs)

    def _call(self) -> None:
        axis = self.axis
        if axis.master is not self.master:
            self.Status = self.Busy = False
            self._stale = bool(self.Enable)
            self.Error = self._stale
            self.ErrorID = ERROR_CONTROL_PANEL if self._stale else NO_ERROR
            return
        if axis.power_owner is not self and self.master is None:
            if axis.power_owner is not None:
                self._fail(ERROR_SECOND_INSTANCE)
                return
            axis.power_owner = self
        enabling = axis.enabling
        self._stale = self._stale and bool(self.Enable)
        enable = bool(self.Enable) and not self._stale
        start_mode, stop_mode = self.StartMode, self.StopMode
        wrong = NO_ERROR
        if stop_mode in _STOP_MODES and start_mode in _START_MODES:
            self.Status, self.Busy, alarmed = enabling.call(
                enable=enable, start_mode=start_mode, stop_mode=stop_mode
            )
        else:
            wrong = self._call_with_wrong_mode(enable)
            self.Status, self.Busy, alarmed = enabling.enabled, enabling.busy, enabling.alarmed
        self.Error = alarmed
        self.ErrorID = ERROR_ALARM if alarmed else NO_ERROR
        if wrong:
            self._fail(wrong)

    def _call_with_wrong_mode(self, enable: bool) -> int:
        """Enable or disable with a mode that does not exist; returns the ErrorID.

        A wrong mode prevents the enabling, never the disabling; the start mode
        matters only at the rising edge.
        """
        axis = self.axis
        enabling = axis.enabling
        rising = enable and not enabling.enable
        wrong_stop = self.StopMode not in _STOP_MODES and axis.object_type != "ExternalEncoder"
        wrong_start = self.StartMode not in _START_MODES and axis.has_position
        wrong = ERROR_STOP_MODE if wrong_stop else ERROR_MODE if wrong_start and rising else NO_ERROR
        if not (wrong and rising):
            enabling.call(
                enable=enable,
                start_mode=enabling.start_mode if wrong_start else self.StartMode,
                stop_mode=0 if wrong_stop else self.StopMode,
            )
        return wrong

    def _fail(self, error_id: int) -> None:
        self.Error = True
        self.ErrorID = error_id

    @override
    def _standing(self) -> str:
        words = f"has Enable {_bool(self.Enable)}, Status {_bool(self.Status)}"
        return f"{words}, and {super()._standing()}" if self.Error else words

    def status(self) -> bool:
        """Return `Status`."""
        return self.Status

    def off(self) -> bool:
        """Return whether the disabling is complete: `Status` and `Busy` FALSE (MC-152)."""
        return not self.Status and not self.Busy
