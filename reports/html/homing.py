"""A homing for the page of its case: the picture, the numbered steps, and the same in text.

The picture is velocity over position as the manuals draw it, and below it the switches and zero marks. Its
geometry is calculated here; the page gets elements as nested lists, `[tag, attributes, children]`, and makes
SVG nodes of them, so that no text of a run is ever parsed as markup. Colours are those of the page, by class.
"""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Sequence
from itertools import pairwise
from typing import Final

from reports.homing import HomingDrawing, HomingStep, SwitchLane
from reports.json_types import Json, JsonObject

MINUS: Final = "\N{MINUS SIGN}"
Node = list[Json]
Point = tuple[float, float]

_WIDTH: Final = 960.0
_LEFT: Final = 92.0
_RIGHT: Final = 940.0
_TOP: Final = 46.0
_BASE: Final = 278.0
"""Sides of the plot, px."""
_LANE: Final = 25.0
_BAR: Final = 12.0
_RADIUS: Final = 9.0
_LETTER: Final = 6.2
"""About the width of a letter, px."""
_LANES: Final = ("negative limit", "cam", "input", "zero mark", "positive limit")
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


def drawing_payload(drawing: HomingDrawing) -> JsonObject:
    """Return title, picture, text alternative and legend of a homing, for the page."""
    numbers = _numbers(drawing)
    rows = [_row(drawing, step, number) for step, number in zip(drawing.steps, numbers, strict=True)]
    return {
        "title": f"{drawing.job}, Mode {drawing.mode}: {drawing.mark_kind}, homing direction "
        f"{_SIDES[drawing.direction]}",
        "sub": _result(drawing),
        "alt": _alternative(drawing),
        "svg": _Picture(drawing, numbers).node(),
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


def _row(drawing: HomingDrawing, step: HomingStep, number: int) -> list[Json]:
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
    """Return the picture as text."""
    unit = drawing.unit
    text = [f"Velocity over position of {drawing.axis}. {_result(drawing)}."]
    for step in drawing.steps:
        if step.travel:
            text.append(
                f"{named(step).capitalize()}: from {short(step.begin)} to {short(step.end)} {unit} "
                f"with up to {short(abs(step.velocity))} {unit}/s."
            )
        else:
            text.append(f"{step.name.capitalize()} at {short(step.begin)} {unit}.")
    for lane in drawing.lanes:
        if lane.name != "zero mark" and lane.bars:
            places = ", ".join(f"from {short(low)} to {short(high)} {unit}" for low, high in lane.bars)
            text.append(f"{lane.name.capitalize()} active {places}.")
    return " ".join(text)


# -- numbers


def named(step: HomingStep) -> str:
    """Return the name of a step with the direction of a travel."""
    return step.name + {1: " +", -1: f" {MINUS}", 0: ""}[step.direction if step.travel else 0]


def short(value: float, digits: int = 1) -> str:
    """Return a number with a true minus sign and, beyond one digit, without zeros at the end."""
    text = f"{value:.{digits}f}"
    if digits > 1:
        text = text.rstrip("0").rstrip(".")
    return "0" if text in {"-0", "-0.0", "0.0"} else text.replace("-", MINUS)


def _round_numbers(low: float, high: float, about: int) -> list[float]:
    """Return round numbers between two values."""
    rough = max(high - low, 1e-9) / about
    size = 10.0 ** math.floor(math.log10(rough))
    size *= next(factor for factor in (1.0, 2.0, 5.0, 10.0) if factor * size >= rough)
    first, last = math.ceil(low / size - 1e-9), math.floor(high / size + 1e-9)
    return [number * size for number in range(first, last + 1)]


class _Scale:
    """Position to px: to scale, but long stretches where nothing happens are shortened.

    Args:
        low: Left end, position unit.
        high: Right end.
        places: Ascending places that matter.

    """

    def __init__(self, low: float, high: float, places: Sequence[float]) -> None:
        gaps = [(a, b) for a, b in pairwise(places) if b - a > 0.25 * (high - low)]
        length = 0.3 * ((high - low) - sum(b - a for a, b in gaps)) / max(len(gaps), 1)
        margin = 0.25 * length
        self.short = [(a + margin, b - margin) for a, b in gaps if b - a > 2.0 * length]
        """What is shortened: from, to, position unit."""
        self._knots, self._lengths = [low], [0.0]
        for begin, end in self.short:
            self._add(begin, begin - self._knots[-1])
            self._add(end, length - 2.0 * margin)
        self._add(high, high - self._knots[-1])
        self.stretch = (high - low) / self._lengths[-1]
        """By how much the whole scale is shortened."""

    def _add(self, place: float, length: float) -> None:
        self._knots.append(place)
        self._lengths.append(self._lengths[-1] + length)

    def px(self, place: float) -> float:
        """Return the px of a place."""
        knots, lengths = self._knots, self._lengths
        index = min(max(bisect_right(knots, place) - 1, 0), len(knots) - 2)
        share = (place - knots[index]) / (knots[index + 1] - knots[index])
        part = (lengths[index] + share * (lengths[index + 1] - lengths[index])) / lengths[-1]
        return round(_LEFT + part * (_RIGHT - _LEFT), 1)

    def left_out(self, place: float) -> bool:
        """Return whether a place is in a shortened stretch."""
        return any(low <= place <= high for low, high in self.short)


def _interesting(drawing: HomingDrawing) -> list[float]:
    """Return the places to show to scale: moments, edges, turns, and where the velocity changes."""
    places = [place for step in drawing.steps for place in (step.begin, step.end)]
    places += [edge.position for lane in drawing.lanes for edge in lane.edges]
    places += [place for place in (drawing.mark, drawing.home) if place is not None]
    top = max((abs(point[2]) for point in drawing.path), default=0.0)
    for before, after in pairwise(drawing.path):
        if abs(after[2] - before[2]) > 0.004 * top:
            places += [before[1], after[1]]
    return sorted(places)


# -- the picture


class _Picture:
    """Geometry of one picture.

    Args:
        drawing: The homing; its path has at least one point.
        numbers: Number of every step, 0 for none.

    """

    def __init__(self, drawing: HomingDrawing, numbers: Sequence[int]) -> None:
        self._drawing = drawing
        self._steps = list(zip(drawing.steps, numbers, strict=True))
        self._lanes = sorted(drawing.lanes, key=lambda lane: _LANES.index(lane.name))
        places = [point[1] for point in drawing.path]
        places += [place for place in (drawing.mark, drawing.home) if place is not None]
        margin = 0.05 * max(max(places) - min(places), 1e-3)
        self._low, self._high = min(places) - margin, max(places) + margin
        self._scale = _Scale(self._low, self._high, _interesting(drawing))
        speeds = [0.0, *(point[2] for point in drawing.path)]
        margin = 0.16 * max(max(speeds) - min(speeds), 1e-3)
        self._slow, self._fast = min(speeds) - margin, max(speeds) + margin
        self._end = _BASE + _LANE * len(self._lanes) + 6.0

    def _y(self, velocity: float) -> float:
        return round(_TOP + (self._fast - velocity) / (self._fast - self._slow) * (_BASE - _TOP), 1)

    def node(self) -> Node:
        """Return the picture."""
        lanes = [
            self._lane(lane, _BASE + _LANE * number + (_LANE - _BAR) / 2 + 6.0)
            for number, lane in enumerate(self._lanes)
        ]
        curves = [self._curve(step, number) for step, number in self._steps if step.travel]
        size = f"0 0 {_WIDTH:g} {self._end + 34.0:g}"
        return _node(
            "svg",
            {"viewBox": size, "class": "homing-svg", "role": "img"},
            self._grid(),
            self._velocities(),
            self._marks(),
            *lanes,
            *curves,
            self._breaks(),
            self._badges(),
        )

    def _grid(self) -> Node:
        found: list[Node] = []
        last = -1e9
        for place in _round_numbers(self._low, self._high, min(round(9 * self._scale.stretch), 200)):
            x = self._scale.px(place)
            if x - last >= 44.0 and not self._scale.left_out(place):
                last = x
                found.append(_line(x, x, _TOP, self._end, "hg"))
                found.append(_text(x, self._end + 13.0, _tick(place, self._high - self._low), "ht", "middle"))
        for velocity in _round_numbers(self._slow, self._fast, 5):
            y = self._y(velocity)
            found.append(_line(_LEFT, _RIGHT, y, y, "h0" if abs(velocity) < 1e-9 else "hg"))
            found.append(_text(_LEFT - 6.0, y + 3.5, _tick(velocity, self._fast - self._slow), "ht", "end"))
        unit = self._drawing.unit
        found.append(_text(_LEFT - 6.0, _TOP - 10.0, f"velocity, {unit}/s", "ht", "end"))
        found.append(_text(_RIGHT, self._end + 28.0, f"position, {unit}", "ht", "end"))
        found.append(_line(_LEFT, _RIGHT, self._end, self._end, "h0"))
        return _group(found)

    def _velocities(self) -> Node:
        """Return the configured velocities that steps have used."""
        drawing, found = self._drawing, []
        for name, velocity, parts in (
            ("approach velocity", drawing.approach_velocity, {"approach", "back"}),
            ("homing velocity", drawing.homing_velocity, {"search"}),
        ):
            for sign in {step.direction for step in drawing.steps if velocity and step.name in parts}:
                y = self._y(sign * velocity)
                if _TOP < y < _BASE:
                    found.append(_line(_LEFT, _RIGHT, y, y, "hv"))
                    found.append(_text(_LEFT + 4.0, y - 4.0, name, "hs", "start"))
        return _group(found)

    def _marks(self) -> Node:
        """Return the lines of mark and home position through the whole picture."""
        found: list[Node] = []
        labels = (("homing mark", self._drawing.mark, "hm"), ("home position", self._drawing.home, "hh"))
        for row, (name, place, kind) in enumerate(labels):
            if place is not None:
                x, y, text = self._scale.px(place), 12.0 + 16.0 * row, f"{name} {short(place, 2)}"
                half = _LETTER * len(text) / 2
                found.append(_line(x, x, y + 5.0, self._end, kind))
                at = min(max(x, _LEFT + half), _RIGHT - half)
                found.append(_text(at, y + 3.0, text, kind + " hb", "middle"))
        return _group(found)

    def _breaks(self) -> Node:
        """Return the signs where the scale is broken."""
        found: list[Node] = []
        for low, high in self._scale.short:
            x = 0.5 * (self._scale.px(low) + self._scale.px(high))
            box: JsonObject = {
                "x": x - 5.0,
                "y": _TOP,
                "width": 10.0,
                "height": self._end - _TOP,
                "class": "hcut",
            }
            title = _node("title", {}, f"shortened: {short(low)} to {short(high)} {self._drawing.unit}")
            sides = [_line(x + side, x + side, _TOP, self._end, "hzig") for side in (-5.0, 5.0)]
            found.append(_group([_node("rect", box), *sides, title]))
        return _group(found)

    def _lane(self, lane: SwitchLane, y: float) -> Node:
        parts = [
            _text(_LEFT - 6.0, y + 10.0, lane.name, "hl", "end"),
            _line(_LEFT, _RIGHT, y + _BAR, y + _BAR, "hg"),
        ]
        marks = lane.name == "zero mark"
        parts += self._zero_marks(lane, y) if marks else self._bars(lane, y)
        if not lane.bars:
            text = "none was found" if marks else "never active"
            parts.append(_text(_LEFT + 8.0, y + 9.0, text, "hs", "start"))
        return _group(parts, {"data-lane": lane.name})

    def _zero_marks(self, lane: SwitchLane, y: float) -> list[Node]:
        found = []
        for place, _ in reversed(lane.bars):
            if not self._scale.left_out(place):
                x, used = self._scale.px(place), place == self._drawing.mark
                found.append(_line(x, x, y - (3.0 if used else 0.0), y + _BAR, "hz used" if used else "hz"))
        return found

    def _bars(self, lane: SwitchLane, y: float) -> list[Node]:
        found: list[Node] = []
        near = 0.004 * (self._high - self._low)
        kind = "hbar limit" if lane.name.endswith("limit") else "hbar"
        for low, high in lane.bars:
            a, b = self._scale.px(low), self._scale.px(high)
            box: JsonObject = {"x": a, "y": y, "width": max(b - a, 1.5), "height": _BAR, "class": kind}
            found.append(_node("rect", box))
            for place, x, anchor, shift in ((low, a, "end", -5.0), (high, b, "start", 5.0)):
                if any(abs(edge.position - place) <= near for edge in lane.edges):
                    found.append(_line(x, x, y - 4.0, y + _BAR, "hedge"))
                    found.append(_text(x + shift, y + 9.5, short(place), "hs", anchor))
        for edge in lane.edges:
            x, tip = self._scale.px(edge.position), 8.0 * (edge.direction or 1)
            shape = f"M{x:.1f} {y - 7.5:.1f}L{x + tip:.1f} {y - 4:.1f}L{x:.1f} {y - 0.5:.1f}Z"
            title = (
                f"{lane.name} {'reached' if edge.active else 'left'} at {short(edge.position, 2)} "
                f"{self._drawing.unit}, {short(edge.time_s - self._drawing.begin_s, 4)} s"
            )
            found.append(_node("path", {"d": shape, "class": "hedge"}, _node("title", {}, title)))
        return found

    def _points(self, step: HomingStep) -> list[Point]:
        """Return the curve of a travel, px, with the last point before it, so that there is no gap."""
        path = self._drawing.path
        inside = [point for point in path if step.begin_s - 1e-6 <= point[0] <= step.end_s + 1e-6]
        before = [point for point in path if point[0] < step.begin_s - 1e-6]
        return [(self._scale.px(point[1]), self._y(point[2])) for point in [*before[-1:], *inside]]

    def _curve(self, step: HomingStep, number: int) -> Node:
        points = self._points(step)
        parts: list[Node] = []
        if len(points) > 1:
            line = "M" + "L".join(f"{x:g} {y:g}" for x, y in points)
            parts.append(_node("path", {"d": line, "class": "hc"}))
            parts.append(_arrow(*_along(points, 0.62)))
        return _group(parts, {"class": f"hp-{step.name}", "data-step": number or None})

    def _badges(self) -> Node:
        """Return dots at moments, and the numbers of steps outward of the curve, apart from each other."""
        found: list[Node] = []
        taken: list[Point] = []
        for step, number in self._steps:
            x, y = self._scale.px(step.begin), self._y(step.velocity)
            if step.travel:
                points = self._points(step)
                if len(points) < 2:
                    continue
                x, y, _ = _along(points, 0.5)
            else:
                mood = {"mark": " hm", "home position": " hh"}.get(step.name, "")
                found.append(_node("circle", {"cx": x, "cy": y, "r": 3.5, "class": "hdot" + mood}))
            if not number:
                continue
            a, b = min(max(x, _LEFT + _RADIUS), _RIGHT - _RADIUS), y
            # Between the curve and standstill; at standstill on the side with more space.
            fast = abs(step.velocity) > 0.05 * (self._fast - self._slow)
            way = 4.0 if (step.velocity > 0.0 if fast else self._fast < -self._slow) else -4.0
            while abs(b - y) < 16.0 or any(math.dist((a, b), other) < 2.0 * _RADIUS + 2.0 for other in taken):
                b += way
            taken.append((a, b))
            parts = [
                _line(a, x, b, y, "hlead"),
                _node("circle", {"cx": round(a, 1), "cy": round(b, 1), "r": _RADIUS, "class": "hn"}),
                _text(a, b + 4.0, str(number), "hnt", "middle"),
                _node("title", {}, f"{number} {named(step)}"),
            ]
            kind = f"hp-{step.name if step.travel else 'moment'}"
            found.append(_group(parts, {"class": kind, "data-step": number}))
        return _group(found)


def _along(points: Sequence[Point], share: float) -> tuple[float, float, float]:
    """Return place and angle at a share of the length of a curve."""
    rest = share * sum(math.dist(a, b) for a, b in pairwise(points))
    for (x0, y0), (x1, y1) in pairwise(points):
        length = math.dist((x0, y0), (x1, y1))
        if length >= rest > 0.0:
            part = rest / length
            return x0 + part * (x1 - x0), y0 + part * (y1 - y0), math.atan2(y1 - y0, x1 - x0)
        rest -= length
    return *points[-1], 0.0


def _arrow(x: float, y: float, angle: float) -> Node:
    corners = ((6.0, 0.0), (-5.0, 4.5), (-5.0, -4.5))
    cos, sin = math.cos(angle), math.sin(angle)
    place = "L".join(f"{x + a * cos - b * sin:.1f} {y + a * sin + b * cos:.1f}" for a, b in corners)
    return _node("path", {"d": f"M{place}Z", "class": "ha"})


def _tick(value: float, span: float) -> str:
    return short(value, 0 if span > 15.0 else 2) if span > 1.0 else short(value, 3)


def _node(tag: str, attributes: JsonObject, *children: Json) -> Node:
    return [tag, {name: value for name, value in attributes.items() if value is not None}, list(children)]


def _group(children: list[Node], attributes: JsonObject | None = None) -> Node:
    return _node("g", attributes or {}, *children)


def _line(x1: float, x2: float, y1: float, y2: float, kind: str) -> Node:
    places = {"x1": x1, "x2": x2, "y1": y1, "y2": y2}
    return _node("line", {name: round(value, 1) for name, value in places.items()} | {"class": kind})


def _text(x: float, y: float, text: str, kind: str, anchor: str) -> Node:
    return _node("text", {"x": round(x, 1), "y": round(y, 1), "class": kind, "text-anchor": anchor}, text)
