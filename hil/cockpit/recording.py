"""Commands of the axis view as steps of a session: what a user program does in their place."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Final, Protocol

from hil.cockpit.steps import Command, InterpolateCam, Remark, SetInputs, Step, WriteVariable, panel_steps

if TYPE_CHECKING:
    from fieldbus.history import Scalar
    from motion.s7.commissioning import ControlPanel
    from motion.s7.handles import AxisHandle

_FULL: Final = 100.0
_PANEL: Final = {
    "enable": "enable",
    "disable": "disable",
    "ack": "acknowledge",
    "rel": "move_relative",
    "abs": "move_absolute",
    "home": "home",
    "set": "set_position",
    "adjust-encoder": "adjust_encoder",
    "stop": "stop",
}
"""Command of the view -> command of the control panel."""
_SETTINGS: Final = frozenset({"take", "velocity", "acceleration", "deceleration", "jerk", "adjust"})
"""They change what later commands do, and nothing by themselves."""
_CAM: Final[Mapping[str, Scalar]] = {"ApplicationMode": 1, "SyncProfileReference": 2}
"""Inputs of `MC_CamIn` with which the panel starts: again and again, beginning where both are."""


class StepLog(Protocol):
    """Takes the steps of a session."""

    @property
    def now_ns(self) -> int:
        """Bench time, ns."""

    def note(self, step: Step, made: object = None, *, time_ns: int | None = None) -> int:
        """Record a step; returns its number, from 0."""

    def ended_ns(self, number: int) -> int | None:
        """Return when a step on an NC axis came to its end, ns; None: it has not."""


class AxisRecorder(Protocol):
    """Records what an operator does with one axis; times are those before the command, ns."""

    def command(self, name: str, values: Sequence[float | str], time_ns: int) -> None:
        """Record a command that has been carried out."""

    def jog(self, slider: float, time_ns: int) -> None:
        """Record that jogging begins, changes, or ends with slider 0."""

    def stopped(self, time_ns: int) -> None:
        """Record that what the panel moves is stopped."""

    def released(self, time_ns: int) -> None:
        """Record that the axis is disabled and given back."""

    def look(self) -> None:
        """Record what follows from commands later on; called after every slice of time."""


class S7Recorder:
    """Records what is done with an S7 axis.

    Args:
        axis: The axis.
        panel: Its control panel.
        log: Takes the steps.

    """

    def __init__(self, axis: AxisHandle, panel: ControlPanel, log: StepLog) -> None:
        self._axis = axis
        self._panel = panel
        self._name = axis.name
        self._log = log
        self._jogging: int | None = None
        """Number of the step that started to jog."""
        self._slider = _FULL
        """Slider with which the job began, %."""
        self._overridden = False
        """Whether the slider was moved after that."""

    def command(self, name: str, values: Sequence[float | str], time_ns: int) -> None:
        """Record a command that has been carried out."""
        panel = self._panel
        if name in _SETTINGS or not panel.active:
            return
        numbers = [float(one) for one in values if isinstance(one, int | float)]
        if name == "jog":
            self.jog(numbers[0] if numbers else _FULL, time_ns)
        elif name == "slide":
            self._slide(numbers[0] if numbers else 0.0, time_ns)
        elif name == "release":
            self._note(panel_steps(panel, "disable"), None, time_ns)
        elif name in _PANEL:
            slider = numbers[1] if len(numbers) > 1 else _FULL
            value = numbers[0] if numbers else 0.0
            if name in {"rel", "abs", "home"}:
                self._begin(slider, time_ns)
            steps = panel_steps(panel, _PANEL[name], value, slider)
            moves = name in {"rel", "abs", "home", "set", "adjust-encoder"}
            self._note(steps, panel.job if moves else None, time_ns)
        else:
            if name == "cam" and self._log.now_ns > time_ns:
                # The panel has let time pass, to interpolate the cam first.
                self._log.note(InterpolateCam(str(values[1])), time_ns=time_ns)
                time_ns = self._log.now_ns
            self._note(self._following(name, values, numbers), panel.job, time_ns)

    def jog(self, slider: float, time_ns: int) -> None:
        """Record that jogging begins, changes, or ends with slider 0."""
        panel = self._panel
        if not panel.active:
            return
        if slider == 0.0:
            self._slide(0.0, time_ns)
        elif self._jogging is not None:
            self._override(slider, time_ns)
        else:
            self._begin(slider, time_ns)
            self._jogging = self._note(panel_steps(panel, "jog", slider=slider), panel.job, time_ns)

    def stopped(self, time_ns: int) -> None:
        """Record that what the panel moves is stopped."""
        if not self._panel.active:
            return
        self._end_jogging(time_ns)
        if self._axis.var("Velocity") != 0.0:
            self._note(panel_steps(self._panel, "stop"), None, time_ns)

    def released(self, time_ns: int) -> None:
        """Record that the axis is disabled and given back."""
        if self._panel.active and self._panel.enabled:
            self._note(panel_steps(self._panel, "disable"), None, time_ns)

    def look(self) -> None:
        """Nothing follows later on."""

    def _note(self, steps: Sequence[Step], made: object, time_ns: int) -> int:
        """Record steps, the last of which has made something."""
        number = -1
        for place, step in enumerate(steps, 1):
            number = self._log.note(step, made if place == len(steps) else None, time_ns=time_ns)
        return number

    def _slide(self, slider: float, time_ns: int) -> None:
        if slider:
            self._override(slider, time_ns)
        elif not self._end_jogging(time_ns):
            inputs: dict[str, Scalar] = {"Deceleration": self._panel.deceleration, "Jerk": self._panel.jerk}
            self._note([Command(self._name, "halt", inputs)], None, time_ns)

    def _end_jogging(self, time_ns: int) -> bool:
        number, self._jogging = self._jogging, None
        if number is None:
            return False
        self._note([SetInputs(number, {"JogForward": False, "JogBackward": False})], None, time_ns)
        return True

    def _begin(self, slider: float, time_ns: int) -> None:
        """Note the slider of a job that begins; the override is full again."""
        self._slider = abs(slider)
        if self._overridden:
            self._overridden = False
            self._note([WriteVariable(self._name, "Override.Velocity", _FULL)], None, time_ns)

    def _override(self, slider: float, time_ns: int) -> None:
        share = _FULL * abs(slider) / (self._slider or _FULL)
        self._overridden = True
        self._note([WriteVariable(self._name, "Override.Velocity", share)], None, time_ns)

    def _following(self, name: str, values: Sequence[float | str], numbers: Sequence[float]) -> list[Step]:
        """Return the steps of commands to an axis that follows others."""
        axis = self._name
        names = [one for one in values if isinstance(one, str)]
        if name == "gear" and names:
            ratio = dict(zip(("numerator", "denominator"), map(round, numbers), strict=False))
            return [Command(axis, "gear_in", {"leader": names[0], **ratio})]
        if name == "cam" and len(names) > 1:
            return [Command(axis, "cam_in", {"leader": names[0], "cam": names[1], **_CAM})]
        if name in {"gear-out", "cam-out"} and numbers:
            over: dict[str, Scalar] = (
                {"MasterStopDistance": numbers[1]} if len(numbers) > 1 else {"SyncProfileReference": 0}
            )
            return [Command(axis, name.replace("-", "_"), {"position": numbers[0], **over})]
        if name == "phase" and numbers:
            return [Command(axis, "phasing_relative", {"shift": numbers[0]})]
        if name == "offset" and len(numbers) > 1:
            return [Command(axis, "offset_relative", {"offset": numbers[0], "distance": numbers[1]})]
        given = " ".join(str(one) for one in values)
        return [Remark(f"{axis}: {name} {given}".rstrip() + " (has no line of its own: write it by hand)")]
