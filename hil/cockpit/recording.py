"""Commands of the axis view as steps of a session: what a user program does in their place."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, Final

from hil.cockpit.steps import Command, Remark, SetInputs, Step, WriteVariable, panel_steps

if TYPE_CHECKING:
    from fieldbus.history import Scalar
    from hil.bench.bench import Bench
    from hil.cockpit.session import Session
    from motion.s7.commissioning import ControlPanel

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
_NC: Final[dict[str, tuple[str, dict[str, Scalar]]]] = {
    "enable": ("power", {}),
    "disable": ("power", {"enable": False}),
    "f6": ("stop", {}),
    "f8": ("reset", {}),
}


class AxisRecorder:
    """Writes down what is done with the axes of a bench.

    Args:
        session: Gets the steps.

    """

    def __init__(self, session: Session) -> None:
        self._session = session
        self._bench: Bench = session.bench
        self._jogging: dict[str, int] = {}
        """Axis -> number of the step that started to jog."""
        self._slider: dict[str, float] = {}
        """Axis -> slider with which its job began, %."""
        self._overridden: set[str] = set()
        """Axes whose slider was moved after that."""

    def command(self, axis: str, name: str, values: Sequence[float | str], time_ns: int) -> None:
        """Record a command that has been carried out."""
        if name in _SETTINGS:
            return
        panel = self._panel(axis)
        if panel is None:
            self._without_panel(axis, name, values, time_ns)
        elif name == "jog":
            self.jog(axis, float(values[0]) if values else _FULL, time_ns)
        elif name == "slide":
            self._slide(panel, float(values[0]) if values else 0.0, time_ns)
        elif name == "release":
            self._note(panel_steps(panel, "disable"), None, time_ns)
        elif name in _PANEL:
            numbers = [float(one) for one in values if isinstance(one, int | float)]
            slider = numbers[1] if len(numbers) > 1 else _FULL
            value = numbers[0] if numbers else 0.0
            if name in {"rel", "abs", "home"}:
                self._begin(axis, slider, time_ns)
            steps = panel_steps(panel, _PANEL[name], value, slider)
            moves = name in {"rel", "abs", "home", "set", "adjust-encoder"}
            self._note(steps, panel.job if moves else None, time_ns)
        else:
            self._note(self._following(axis, name, values), panel.job, time_ns)

    def jog(self, axis: str, slider: float, time_ns: int) -> None:
        """Record that jogging begins, changes, or ends with slider 0."""
        panel = self._panel(axis)
        if panel is None:
            return
        if slider == 0.0:
            self._slide(panel, 0.0, time_ns)
        elif axis in self._jogging:
            self._override(axis, slider, time_ns)
        else:
            self._begin(axis, slider, time_ns)
            steps = panel_steps(panel, "jog", slider=slider)
            self._jogging[axis] = self._note(steps, panel.job, time_ns)

    def stop_all(self, time_ns: int) -> None:
        """Record that everything the panels move is stopped."""
        for axis in self._bench.axis_names:
            panel = self._panel(axis)
            if panel is None:
                continue
            self._end_jogging(axis, time_ns)
            if self._bench.axis(axis).var("Velocity") != 0.0:
                self._note(panel_steps(panel, "stop"), None, time_ns)

    def released(self, time_ns: int) -> None:
        """Record that all axes are disabled and given back."""
        for axis in self._bench.axis_names:
            panel = self._panel(axis)
            if panel is not None and panel.enabled:
                self._note(panel_steps(panel, "disable"), None, time_ns)

    def _panel(self, axis: str) -> ControlPanel | None:
        if axis not in self._bench.axis_names:
            return None
        master: Any = self._bench.axis(axis).object.master
        return master if hasattr(master, "slider") else None

    def _note(self, steps: Sequence[Step], made: object, time_ns: int) -> int:
        """Record steps, the last of which has made something."""
        number = -1
        for place, step in enumerate(steps, 1):
            number = self._session.note(step, made if place == len(steps) else None, time_ns=time_ns)
        return number

    def _slide(self, panel: ControlPanel, slider: float, time_ns: int) -> None:
        axis = panel.axis.name
        if slider:
            self._override(axis, slider, time_ns)
        elif not self._end_jogging(axis, time_ns):
            inputs: dict[str, Scalar] = {"Deceleration": panel.deceleration, "Jerk": panel.jerk}
            self._note([Command(axis, "halt", inputs)], None, time_ns)

    def _end_jogging(self, axis: str, time_ns: int) -> bool:
        number = self._jogging.pop(axis, None)
        if number is None:
            return False
        self._note([SetInputs(number, {"JogForward": False, "JogBackward": False})], None, time_ns)
        return True

    def _begin(self, axis: str, slider: float, time_ns: int) -> None:
        """Note the slider of a job that begins; the override is full again."""
        self._slider[axis] = abs(slider)
        if axis in self._overridden:
            self._overridden.discard(axis)
            self._note([WriteVariable(axis, "Override.Velocity", _FULL)], None, time_ns)

    def _override(self, axis: str, slider: float, time_ns: int) -> None:
        share = _FULL * abs(slider) / (self._slider.get(axis) or _FULL)
        self._overridden.add(axis)
        self._note([WriteVariable(axis, "Override.Velocity", share)], None, time_ns)

    def _following(self, axis: str, name: str, values: Sequence[float | str]) -> list[Step]:
        """Return the steps of commands to an axis that follows others."""
        numbers = [float(one) for one in values if isinstance(one, int | float)]
        names = [one for one in values if isinstance(one, str)]
        if name == "gear" and names:
            ratio = dict(zip(("numerator", "denominator"), map(round, numbers), strict=False))
            return [Command(axis, "gear_in", {"leader": names[0], **ratio})]
        if name in {"gear-out", "cam-out"} and numbers:
            over: dict[str, Scalar] = (
                {"MasterStopDistance": numbers[1]} if len(numbers) > 1 else {"SyncProfileReference": 0}
            )
            return [Command(axis, name.replace("-", "_"), {"position": numbers[0], **over})]
        if name == "phase" and numbers:
            return [Command(axis, "phasing_relative", {"shift": numbers[0]})]
        if name == "offset" and len(numbers) > 1:
            return [Command(axis, "offset_relative", {"offset": numbers[0], "distance": numbers[1]})]
        return [_by_hand(axis, name, values)]

    def _without_panel(self, axis: str, name: str, values: Sequence[float | str], time_ns: int) -> None:
        if axis in self._bench.nc_axis_names and name in _NC:
            method, inputs = _NC[name]
            self._note([Command(axis, method, inputs)], None, time_ns)
        else:
            self._note([_by_hand(axis, name, values)], None, time_ns)


def _by_hand(axis: str, name: str, values: Sequence[float | str]) -> Remark:
    given = " ".join(str(one) for one in values)
    return Remark(f"{axis}: {name} {given}".rstrip() + " (has no line of its own: write it by hand)")
