"""A homing for the page of its case: picture, numbered steps, and the same in words for those who cannot see
it.
"""

from __future__ import annotations

from typing import Any, Final

from reports.homing import HomingDrawing, HomingStep
from reports.html.homing_layout import named, short
from reports.html.homing_picture import picture

_SIDES: Final = {1: "positive", -1: "negative", 0: "present"}
_WORDS: Final = {
    "start": "the job begins",
    "approach": "to the switch",
    "back": "back past the switch",
    "search": "to the homing mark",
    "mark": "homing mark: the position is set",
    "home": "to the home position",
    "motion": "motion by others",
    "stop": "to rest",
    "turn": "the motion turns",
    "end": "end of the job",
}


def drawing_payload(drawing: HomingDrawing) -> dict[str, Any]:
    """Return title, picture, text alternative and legend of a homing, for the page."""
    numbers = _numbers(drawing)
    rows = [_row(drawing, step, number) for step, number in zip(drawing.steps, numbers, strict=True)]
    return {
        "title": f"{drawing.job}, Mode {drawing.mode}: {drawing.mark_kind}, homing direction "
        f"{_SIDES[drawing.direction]}",
        "sub": _result(drawing),
        "alt": _alternative(drawing),
        "svg": picture(drawing, numbers),
        "rows": rows,
        "good": drawing.outcome == "Done",
    }


def _numbers(drawing: HomingDrawing) -> list[int]:
    """Return the number of every step; 0 for motions of others during a passive homing."""
    found, next_number = [], 1
    for step in drawing.steps:
        counts = drawing.active or not step.travel
        found.append(next_number if counts else 0)
        next_number += counts
    return found


def _row(drawing: HomingDrawing, step: HomingStep, number: int) -> list[Any]:
    """Return number, name, meaning, place, velocity, time [s from the start], time in the trace."""
    place = short(step.begin)
    velocity = ""
    if step.travel:
        place = f"{short(step.begin)} → {short(step.end)}"
        velocity = short(step.velocity)
    elif step.name == "mark":
        velocity = short(step.velocity)
    return [
        number or "",
        named(step),
        _WORDS.get(step.name, ""),
        f"{place} {drawing.unit}",
        f"{velocity} {drawing.unit}/s" if velocity else "",
        short(step.begin_s - drawing.begin_s, 3) + " s",
        round(step.begin_s, 7),
    ]


def _result(drawing: HomingDrawing) -> str:
    unit = drawing.unit
    configured = (
        f"approach velocity {short(drawing.approach_velocity)} {unit}/s, homing velocity "
        f"{short(drawing.homing_velocity)} {unit}/s"
        if drawing.active
        else "on the fly, during motions of others"
    )
    where = "not homed" if drawing.mark is None else f"homed, mark at {short(drawing.mark, 3)} {unit}"
    home = "" if drawing.home is None else f", home position {short(drawing.home, 3)} {unit}"
    return f"{drawing.outcome}: {where}{home}; {configured}"


def _alternative(drawing: HomingDrawing) -> str:
    """Return the picture in words."""
    unit = drawing.unit
    told = [f"Velocity over position of {drawing.axis}. {_result(drawing)}."]
    for step in drawing.steps:
        if step.travel:
            told.append(
                f"{named(step).capitalize()}: from {short(step.begin)} to {short(step.end)} {unit} "
                f"with up to {short(abs(step.velocity))} {unit}/s."
            )
        else:
            told.append(f"{step.name.capitalize()} at {short(step.begin)} {unit}.")
    for lane in drawing.lanes:
        if lane.name != "zero mark" and lane.bars:
            places = ", ".join(f"from {short(low)} to {short(high)} {unit}" for low, high in lane.bars)
            told.append(f"{lane.name.capitalize()} active {places}.")
    return " ".join(told)
