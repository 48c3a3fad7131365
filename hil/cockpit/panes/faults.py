"""The faults: the catalogue for this bench, what is armed, and taking it back."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Annotated, Final, Literal

from pydantic import Field

from hil.cockpit.fault_catalogue import describe, stand, triggers
from hil.cockpit.messages import Message, MessageError
from hil.cockpit.pane import Handler, Pane
from hil.cockpit.steps import Inject, TakeBack
from hil.faults import Fault

if TYPE_CHECKING:
    from hil.bench.bench import Bench
    from hil.cockpit.client import Client
    from hil.cockpit.session import Session
    from hil.faults import ArmedFault
    from reports.json_types import JsonObject

_MOST_SHOWN: Final = 50
_LOOK_S: Final = 1.0
"""Time between two looks at why triggers have not fired, s."""
_Text = Annotated[str, Field(max_length=200)]
_Value = bool | int | float | _Text
_Values = Annotated[dict[Annotated[str, Field(max_length=40)], _Value], Field(max_length=16)]


class ArmFault(Message):
    """Arm a fault; without a trigger it is applied now."""

    kind: Literal["faults.arm"]
    fault: Annotated[str, Field(pattern=r"^[a-z0-9_.]{3,60}$")]
    target: Annotated[str, Field(max_length=80)] = ""
    parameters: _Values = {}  # noqa: RUF012 - pydantic copies it
    trigger: _Values | None = None
    """As in a file: `{"when": "position", "value": 100.0}`."""
    until: _Values | None = None
    duration_s: Annotated[float, Field(gt=0.0, le=1e5)] | None = None
    count: Annotated[int, Field(ge=1, le=1_000_000)] | None = None


class TakeBackFault(Message):
    """End a fault, or disarm one that still waits."""

    kind: Literal["faults.take_back"]
    number: Annotated[int, Field(ge=1, le=1_000_000)]


class TakeBackAll(Message):
    """End all faults."""

    kind: Literal["faults.take_back_all"]


class FaultPane(Pane):
    """Faults of the bench.

    Args:
        session: Returns the session, which arms them and records it.

    """

    name = "faults"

    def __init__(self, session: Callable[[], Session]) -> None:
        self._session = session
        self._description: JsonObject | None = None
        self._steps: dict[int, int] = {}
        """Number of an armed fault -> number of its step."""
        self._waiting: dict[int, str] = {}
        """Number of an armed fault -> what came in place of its trigger."""
        self._next_s = 0.0

    @property
    def handlers(self) -> Mapping[type[Message], Handler]:
        """What it takes."""
        return {ArmFault: self._arm, TakeBackFault: self._take_back, TakeBackAll: self._take_back_all}

    def begin(self, bench: Bench) -> None:
        """Take up a bench."""
        self._steps, self._waiting = {}, {}
        self._description = {"catalogue": list(describe(bench)), "triggers": list(triggers())}

    def end(self) -> None:
        """Let go of the bench."""
        self._description = None

    def _arm(self, message: ArmFault, _: Client) -> int:
        content: dict[str, object] = {"kind": message.fault, "parameters": message.parameters}
        optional = {
            "target": message.target,
            "trigger": message.trigger,
            "until": message.until,
            "duration_s": message.duration_s,
            "count": message.count,
        }
        content |= {name: value for name, value in optional.items() if value not in (None, "")}
        session = self._session()
        armed = session.do(Inject(Fault.from_dict(content)))
        number: int = armed.number
        self._steps[number] = len(session.steps) - 1
        return number

    def _take_back(self, message: TakeBackFault, _: Client) -> None:
        if message.number not in self._steps:
            raise MessageError(f"number: no fault {message.number} has been armed here")
        self._session().do(TakeBack(self._steps[message.number]))

    def _take_back_all(self, _: TakeBackAll, __: Client) -> None:
        session = self._session()
        for armed in reversed(session.performer.injector.armed):
            if not armed.over and armed.number in self._steps:
                session.do(TakeBack(self._steps[armed.number]))

    def description(self) -> object:
        """Return the catalogue."""
        return self._description

    def pulse(self, now_s: float) -> None:
        """Look once a second why triggers have not fired: that goes through the recording."""
        if now_s < self._next_s:
            return
        self._next_s = now_s + _LOOK_S
        self._waiting = {one.number: one.waiting_summary() for one in self._armed() if not one.over}

    def _armed(self) -> list[ArmedFault]:
        return self._session().performer.injector.armed[-_MOST_SHOWN:]

    def state(self) -> object:
        """Return what has been armed, the newest first."""
        return [stand(one, self._waiting.get(one.number, "")) for one in reversed(self._armed())]
