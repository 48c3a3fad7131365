"""The axes: what an operator sees and does, and that they stop when the operator is away."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Final, Literal

from pydantic import Field

from fieldbus.errors import HilError
from hil.cockpit.axes import AxisDesk, axis_desks
from hil.cockpit.messages import Message, MessageError
from hil.cockpit.pane import Handler, Pane
from hil.record import homing_drawings
from reports.html.homing import drawing_payload

if TYPE_CHECKING:
    from hil.bench.bench import Bench
    from hil.cockpit.client import Client
    from hil.cockpit.operator import Control
    from hil.cockpit.recording import AxisRecorder, StepLog
    from hil.record import Trace

_HARMLESS: Final = frozenset(
    {
        "stop",
        "disable",
        "ack",
        "release",
        "slide",
        "f6",
        "f8",
        "velocity",
        "acceleration",
        "deceleration",
        "jerk",
    }
)
"""Commands that move nothing, so that a physical drive may have them in any case."""

AxisName = Annotated[str, Field(min_length=1, max_length=80)]


class AxisCommand(Message):
    """A command of the panel: `enable`, `rel` with [distance, slider], ..."""

    kind: Literal["axis.command"]
    axis: AxisName
    command: Annotated[str, Field(pattern="^[a-z0-9-]{1,20}$")]
    values: Annotated[
        list[float | Annotated[str, Field(pattern=r"^[\w.-]{1,80}$")]], Field(max_length=8)
    ] = []  # noqa: RUF012 - pydantic copies it


class AxisJog(Message):
    """Jog as long as the key is held: the slider at press, 0 when it is let go."""

    kind: Literal["axis.jog"]
    axis: AxisName
    slider: Annotated[float, Field(ge=-100.0, le=100.0)]


class AxisAway(Message):
    """The operator does not see the page any more: stop, keep control."""

    kind: Literal["axis.away"]


class StopAll(Message):
    """Stop every axis that the panel moves; whoever watches may do that."""

    operates = False
    kind: Literal["axis.stop_all"]


class AxisHoming(Message):
    """Ask for the picture of the last homing of an axis, also while it goes on."""

    operates = False
    kind: Literal["axis.homing"]
    axis: AxisName


class AxisPane(Pane):
    """The axes of the bench.

    Args:
        control: Who operates.
        folder: Where pages are written.
        allow_motion: Whether axes with a physical drive may be moved.

    """

    name = "axis"

    def __init__(self, control: Control, folder: Path, *, allow_motion: bool) -> None:
        self.on_away: list[Callable[[], object]] = []
        """Called when all axes have been stopped because the operator is away."""
        self.on_disabled: list[Callable[[str], object]] = []
        """Called with the name of an axis that was disabled because no sign of life came."""
        self._control = control
        self._folder = folder
        self._allow_motion = allow_motion
        self._desks: dict[str, AxisDesk] = {}
        self._physical: frozenset[str] = frozenset()
        self._away = True
        """Whether the operator is away, so that the axes have been stopped."""
        self._record: Callable[[], Trace] | None = None

    @property
    def handlers(self) -> Mapping[type[Message], Handler]:
        """What it takes."""
        return {
            AxisCommand: self._command,
            AxisJog: self._jog,
            AxisAway: lambda _, __: self._stop(),
            StopAll: lambda _, __: self._stop(),
            AxisHoming: self._homing,
        }

    def begin(self, bench: Bench) -> None:
        """Take up a bench."""
        self._record = bench.trace
        self._desks = axis_desks(bench, self._folder)
        drives = bench.config.drive
        self._physical = frozenset(
            name
            for name, table in bench.config.axis.items()
            if table.drive in drives and drives[table.drive].device == "physical"
        )
        self._away = True

    def recorders(self, log: StepLog) -> dict[str, AxisRecorder]:
        """Return what records the commands of each axis as steps."""
        return {name: desk.recorder(log) for name, desk in self._desks.items()}

    def end(self) -> None:
        """Give all axes back."""
        self._record = None
        desks, self._desks = self._desks, {}
        for desk in desks.values():
            with suppress(HilError):
                desk.close()

    def pulse(self, now_s: float) -> None:  # noqa: ARG002 - a sign of life counts in every slice
        """Pass on the sign of life of the operator, or stop what moves without one."""
        if self._control.present:
            self._away = False
            for desk in self._desks.values():
                desk.beat()
            return
        if not self._away:
            self._away = True
            self._leave()
        for name, desk in self._desks.items():
            if desk.watch():
                for call in self.on_disabled:
                    call(name)

    def gone(self, client: Client) -> None:
        """Stop what the page has operated, and give the axes back by the rule of the sign of life."""
        if self._control.client is client:
            self._leave()

    def _leave(self) -> None:
        """Stop everything: the operator is away."""
        self._stop()
        for call in self.on_away:
            call()

    def given_up(self) -> None:
        """Disable all axes and give them back, without waiting for it."""
        for desk in self._desks.values():
            with suppress(HilError):
                desk.release()

    def _stop(self) -> None:
        for desk in self._desks.values():
            with suppress(HilError):
                desk.stop()

    def _homing(self, message: AxisHoming, _: Client) -> object:
        """Return the picture of a homing as the report draws it; None: the axis has not been homed."""
        if self._record is None:
            return None
        found = [one for one in homing_drawings(self._record()) if one.axis == message.axis]
        return drawing_payload(found[-1]) if found else None

    def _desk(self, name: str) -> AxisDesk:
        if name not in self._desks:
            raise MessageError(f"axis: {name!r} is not there; there are {', '.join(self._desks) or 'none'}")
        return self._desks[name]

    def _permit(self, name: str) -> None:
        """Refuse what may move an axis.

        Raises:
            MessageError: The operator is away, or the drive is a physical one that must not be moved.

        """
        if not self._control.present:
            raise MessageError(
                "no sign of life came in time, or what the page shows is older than 2 s: nothing is moved"
            )
        if name in self._physical and not self._allow_motion:
            raise MessageError(
                f"{name} has a physical drive: it is moved only by a cockpit started with --allow-motion"
            )

    def _command(self, message: AxisCommand, _: Client) -> str:
        desk = self._desk(message.axis)
        if message.command not in desk.commands:
            raise MessageError(
                f"command: {message.command!r} is not allowed; allowed: {', '.join(desk.commands)}"
            )
        if message.command not in _HARMLESS:
            self._permit(message.axis)
        return desk.execute(message.command, list(message.values))

    def _jog(self, message: AxisJog, _: Client) -> None:
        desk = self._desk(message.axis)
        if message.slider:
            self._permit(message.axis)
        desk.jog(message.slider)

    def description(self) -> object:
        """Return what each axis is."""
        return {
            "allow_motion": self._allow_motion,
            "physical": sorted(self._physical),
            "axes": {name: desk.description() for name, desk in self._desks.items()},
        }

    def state(self) -> object:
        """Return what each axis does."""
        return {name: desk.state() for name, desk in self._desks.items()}
