"""Result model to plain JSON values and back, without the samples of the signals.

Bus messages, of which a case may have tens of thousands, are rows instead of objects. Unknown keys are
refused on reading, missing ones take the default of the model, so that older journals stay readable.
"""

from __future__ import annotations

import gc
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import fields
from typing import Any

from reports.cams import CamDrawing
from reports.homing import HomingDrawing
from reports.model import (
    AlarmRecord,
    CaseResult,
    Check,
    FaultRecord,
    Message,
    Reaction,
    RequirementInfo,
    RunResult,
    Step,
    Verdict,
)

_ROWS: dict[str, type[Any]] = {
    "story": Step,
    "checks": Check,
    "alarms": AlarmRecord,
    "faults": FaultRecord,
}
_MESSAGE_FIELDS = tuple(item.name for item in fields(Message))
_CASE_PLAIN = tuple(
    item.name
    for item in fields(CaseResult)
    if item.name not in {*_ROWS, "cams", "homings", "messages", "reaction", "signals"}
)
_RUN_PLAIN = tuple(item.name for item in fields(RunResult) if item.name not in {"cases", "requirements"})


def _plain(record: object) -> dict[str, Any]:
    return {item.name: getattr(record, item.name) for item in fields(record)}  # type: ignore[arg-type]  # a model class


def case_to_plain(case: CaseResult) -> dict[str, Any]:
    """Return the JSON object of a case without its signals."""
    plain = {name: getattr(case, name) for name in _CASE_PLAIN}
    for name in _ROWS:
        plain[name] = [_plain(record) for record in getattr(case, name)]
    plain["reaction"] = None if case.reaction is None else _plain(case.reaction)
    plain["cams"] = [drawing.to_plain() for drawing in case.cams]
    plain["homings"] = [drawing.to_plain() for drawing in case.homings]
    plain["messages"] = [[getattr(message, name) for name in _MESSAGE_FIELDS] for message in case.messages]
    return plain


def case_from_plain(plain: Mapping[str, Any]) -> CaseResult:
    """Return the case of a JSON object; its signals are empty.

    Raises:
        TypeError, ValueError, KeyError: The object is not one of `case_to_plain`.

    """
    values = dict(plain)
    values["verdict"] = Verdict(values["verdict"])
    values["checks"] = [{**check, "verdict": Verdict(check["verdict"])} for check in values.get("checks", [])]
    for name, kind in _ROWS.items():
        values[name] = [kind(**record) for record in values.get(name, [])]
    reaction = values.get("reaction")
    values["reaction"] = None if reaction is None else Reaction(**reaction)
    values["cams"] = [CamDrawing.from_plain(drawing) for drawing in values.get("cams", [])]
    values["homings"] = [HomingDrawing.from_plain(drawing) for drawing in values.get("homings", [])]
    values["messages"] = messages_from_plain(values.get("messages", []))
    return CaseResult(**values)


def messages_from_plain(rows: Iterable[Sequence[Any]]) -> list[Message]:
    """Return the bus messages of the rows of `case_to_plain`.

    Raises:
        TypeError: A row is not one.

    """
    return [Message(*row) for row in rows]


def run_to_plain(run: RunResult) -> dict[str, Any]:
    """Return the JSON object of everything of a run except its cases."""
    plain = {name: getattr(run, name) for name in _RUN_PLAIN}
    plain["requirements"] = [_plain(requirement) for requirement in run.requirements]
    return plain


def run_from_plain(plain: Mapping[str, Any]) -> RunResult:
    """Return the run of a JSON object; its cases are empty.

    Raises:
        TypeError, ValueError, KeyError: The object is not one of `run_to_plain`.

    """
    values = dict(plain)
    values["requirements"] = [RequirementInfo(**record) for record in values.get("requirements", [])]
    return RunResult(**values)


@contextmanager
def without_collector() -> Iterator[None]:
    """Leave out the search for cycles, of which results have none: it would look at every object of a large
    run time and again.
    """
    enabled = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if enabled:
            gc.enable()


def plain_number(value: object) -> object:
    """Turn a NumPy scalar into the Python number that it is (`default` of `json.dumps`).

    Raises:
        TypeError: `value` is something else.

    """
    item = getattr(value, "item", None)
    if item is None:
        raise TypeError(f"{type(value).__name__} is no value of the result model")
    return item()
