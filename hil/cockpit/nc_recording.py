"""Commands to an NC axis as steps of a session: the blocks that a PLC program calls in their place."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Final

from hil.cockpit.steps import Command, SetInputs
from hil.panel import NC_JOGS

if TYPE_CHECKING:
    from fieldbus.history import Scalar
    from hil.cockpit.recording import StepLog
    from hil.panel import NcPanelSession
    from motion.nc.handles import NcAxisHandle

_HALF: Final = 50.0
"""Slider above which a jog is fast, %."""
_FULL: Final = 100.0
_ENABLES: Final = ("enable", "positive", "negative")
_NO_DYNAMICS: Final[Mapping[str, float]] = {}
_UNLOCK: Final[Mapping[str, Scalar]] = {"Execute": False}
_LET_GO: Final[Mapping[str, Scalar]] = {"JogForward": False, "JogBackwards": False}


def jog_key(slider: float) -> str:
    """Return the key that is held for a slider: F1 and F4 are fast, F2 and F3 slow (NC-232 to NC-235)."""
    fast = abs(slider) > _HALF
    if slider > 0.0:
        return "f4" if fast else "f3"
    return "f1" if fast else "f2"


class NcRecorder:
    """Records what is done with an NC axis.

    Args:
        axis: The axis.
        session: Carries the commands out; it has the fields that they use, and the block that the last one
            has started.
        log: Takes the steps.

    """

    def __init__(self, axis: NcAxisHandle, session: NcPanelSession, log: StepLog) -> None:
        self._axis = axis
        self._name = axis.name
        self._session = session
        self._log = log
        self._jogging: int | None = None
        """Number of the step that started to jog."""
        self._key = ""
        self._stopping: int | None = None
        """Number of the step that stops: its block locks the axis until `Execute` falls."""
        self._homing: int | None = None
        """Number of the step that homed last."""
        self._cam = False

    def command(self, name: str, values: Sequence[float | str], time_ns: int) -> None:
        """Record a command that has been carried out."""
        numbers = [float(one) for one in values if isinstance(one, int | float)]
        match name:
            case "enable":
                self._power([1.0, 1.0, 1.0, *numbers], time_ns)
            case "set":
                self._power(numbers, time_ns)
            case "disable":
                self._power([0.0], time_ns)
            case "release":
                self._let_go(time_ns)
            case "f5":
                self._let_go(time_ns)
                session = self._session
                self._do("move_absolute", {"position": session.target}, time_ns, session.move_inputs)
            case "f6":
                self._stop(time_ns)
            case "f8":
                self._do("reset", {}, time_ns)
            case "f9":
                self._let_go(time_ns)
                self._homing = self._do("home", {}, time_ns)
                if self._cam:
                    self._set_cam(time_ns)
            case "cam":
                self._cam = numbers[0] == 1.0
                self._set_cam(time_ns)
            case "position":
                self._do("set_position", {"position": numbers[0]}, time_ns)
            case _:
                pass  # a field, which a later command uses

    def jog(self, slider: float, time_ns: int) -> None:
        """Record that a key is pressed, changed for another one, or let go with slider 0."""
        key = jog_key(slider) if slider else ""
        if key == self._key and self._jogging is not None:
            return
        self._let_go(time_ns)
        if not key:
            return
        mode, backwards = NC_JOGS[key]
        self._key = key
        self._jogging = self._do("jog", {"mode": mode, **({"backwards": True} if backwards else {})}, time_ns)

    def stopped(self, time_ns: int) -> None:
        """Record that what moves is stopped."""
        if self._axis.operational and self._axis.ref.NcToPlc.SetVelo != 0.0:
            self._stop(time_ns)
        else:
            self._let_go(time_ns)

    def released(self, time_ns: int) -> None:
        """Record that the enables are taken away."""
        self._let_go(time_ns)
        if self._axis.operational:
            self._power([0.0], time_ns)

    def look(self) -> None:
        """Record that a stop has ended: the panel takes `Execute` back at once, and the axis is free."""
        number = self._stopping
        ended_ns = None if number is None else self._log.ended_ns(number)
        if number is not None and ended_ns is not None:
            self._stopping = None
            self._log.note(SetInputs(number, _UNLOCK), time_ns=ended_ns)

    def _do(
        self,
        name: str,
        inputs: Mapping[str, Scalar],
        time_ns: int,
        dynamics: Mapping[str, float] = _NO_DYNAMICS,
    ) -> int:
        """Record a block with its inputs; a dynamic value of 0 is that of the axis, and left out."""
        given = {key: one for key, one in dynamics.items() if one != 0.0}
        return self._log.note(
            Command(self._name, name, {**inputs, **given}), self._session.job, time_ns=time_ns
        )

    def _power(self, numbers: Sequence[float], time_ns: int) -> None:
        """Record the enables of controller, forward and backward, 0 or 1, and an override in %."""
        given = dict(zip(_ENABLES, (one == 1.0 for one in numbers), strict=False))
        # Without the enable of the controller the others count for nothing.
        missing = (
            {name: False for name, one in given.items() if not one} if given["enable"] else {"enable": False}
        )
        override = numbers[3] if len(numbers) > len(_ENABLES) else _FULL
        self._do("power", missing | ({"override": override} if override != _FULL else {}), time_ns)

    def _stop(self, time_ns: int) -> None:
        self._let_go(time_ns)
        if self._stopping is not None:  # the one before locks no longer than it brakes
            self._log.note(SetInputs(self._stopping, _UNLOCK), time_ns=time_ns)
        self._stopping = self._do("stop", {}, time_ns, self._session.stop_inputs)

    def _let_go(self, time_ns: int) -> None:
        number, self._jogging, self._key = self._jogging, None, ""
        if number is not None:
            self._log.note(SetInputs(number, _LET_GO), time_ns=time_ns)

    def _set_cam(self, time_ns: int) -> None:
        if self._homing is not None:
            self._log.note(SetInputs(self._homing, {"bCalibrationCam": self._cam}), time_ns=time_ns)
