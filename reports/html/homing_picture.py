"""The picture of a homing: velocity over position as the manuals draw it, and below it the switches and zero
marks.

The geometry is calculated here. The page gets elements as nested lists, `[tag, attributes, children]`, and
makes SVG nodes of them, so that no text of a run is ever parsed as markup. Colours are those of the page, by
class.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise
from typing import Any, Final

from reports.homing import HomingDrawing, HomingStep, SwitchLane
from reports.html.homing_layout import Free, Scale, interesting, named, round_numbers, short

_WIDTH: Final = 960.0
_LEFT: Final = 92.0
_RIGHT: Final = 20.0
_TOP: Final = 46.0
_PLOT: Final = 232.0
_LANE: Final = 25.0
_BAR: Final = 12.0
_RADIUS: Final = 9.0
_ARROW_EVERY: Final = 190.0
_LETTER: Final = 6.2
"""About the width of a letter, px."""
_LANES: Final = ("negative limit", "cam", "input", "zero mark", "positive limit")

Node = list[Any]


def picture(drawing: HomingDrawing, numbers: Sequence[int]) -> Node:
    """Return the picture of a homing.

    Args:
        drawing: The homing; its path has at least one point.
        numbers: Number of every step, 0 for none.

    """
    return _Picture(drawing, numbers).node()


class _Picture:
    """Geometry of one picture."""

    def __init__(self, drawing: HomingDrawing, numbers: Sequence[int]) -> None:
        self._drawing = drawing
        self._numbers = numbers
        self._lanes = sorted(drawing.lanes, key=lambda lane: _LANES.index(lane.name))
        places = [point[1] for point in drawing.path]
        places += [place for place in (drawing.mark, drawing.home) if place is not None]
        low, high = min(places), max(places)
        room = 0.05 * max(high - low, 1e-3)
        self._low, self._high = low - room, high + room
        self._scale = Scale(self._low, self._high, interesting(drawing))
        speeds = [point[2] for point in drawing.path]
        top = max([0.0, *speeds])
        bottom = min([0.0, *speeds])
        span = max(top - bottom, 1e-3)
        self._top = top + 0.16 * span
        self._bottom = bottom - 0.16 * span
        self._base = _TOP + _PLOT
        self._height = self._base + _LANE * len(self._lanes) + 40.0
        self._free = Free()

    def _x(self, place: float) -> float:
        return round(_LEFT + self._scale.part(place) * (_WIDTH - _LEFT - _RIGHT), 1)

    def _y(self, velocity: float) -> float:
        return round(_TOP + (self._top - velocity) / (self._top - self._bottom) * _PLOT, 1)

    def node(self) -> Node:
        """Return the picture."""
        size = f"0 0 {_WIDTH:g} {self._height:g}"
        for low, high in self._scale.short:
            self._free.take(0.5 * (self._x(low) + self._x(high)), self._height / 2, 14.0, self._height)
        curves = self._curves()  # words keep away from it
        return _node(
            "svg",
            {"viewBox": size, "class": "homing-svg", "role": "img"},
            self._grid(),
            self._guides(),
            *self._lane_nodes(),
            curves,
            self._breaks(),
            self._badges(),
        )

    def _grid(self) -> Node:
        end, right = self._height - 34.0, _WIDTH - _RIGHT
        found: list[Node] = []
        last = -1e9
        for place in round_numbers(self._low, self._high, self._scale.ticks(9)):
            x = self._x(place)
            if x - last < 44.0 or self._scale.left_out(place):
                continue
            last = x
            found.append(_line(x, x, _TOP, end, "hg"))
            found.append(_text(x, end + 13.0, _tick(place, self._high - self._low), "ht", "middle"))
        for velocity in round_numbers(self._bottom, self._top, 5):
            y = self._y(velocity)
            found.append(_line(_LEFT, right, y, y, "h0" if abs(velocity) < 1e-9 else "hg"))
            found.append(_text(_LEFT - 6.0, y + 3.5, _tick(velocity, self._top - self._bottom), "ht", "end"))
        unit = self._drawing.unit
        found.append(_text(_LEFT - 6.0, _TOP - 10.0, f"velocity, {unit}/s", "ht", "end"))
        found.append(_text(right, end + 28.0, f"position, {unit}", "ht", "end"))
        found.append(_line(_LEFT, right, end, end, "h0"))
        return _group(found)

    def _guides(self) -> Node:
        """Return the configured velocities, and the lines of mark and home position through the whole
        picture.
        """
        drawing, found = self._drawing, []
        for name, velocity, parts in (
            ("approach velocity", drawing.approach_velocity, {"approach", "back"}),
            ("homing velocity", drawing.homing_velocity, {"search"}),
        ):
            for sign in (1, -1):
                y = self._y(sign * velocity)
                used = any(step.name in parts and step.direction == sign for step in drawing.steps)
                if velocity > 0.0 and used and _TOP < y < self._base:
                    found.append(_line(_LEFT, _WIDTH - _RIGHT, y, y, "hv"))
                    width = _LETTER * len(name) + 6.0
                    places = [
                        (_LEFT + width / 2 + 4.0 + part * (_WIDTH - _LEFT - _RIGHT - width - 8.0), y + side)
                        for side in (-7.0, 8.0)
                        for part in (0.0, 1.0, 0.75, 0.25, 0.5)
                    ]
                    x, y = self._free.place(places, width, 11.0)
                    found.append(_text(x, y + 3.5, name, "hs", "middle"))
        end = self._height - 34.0
        labels = [("homing mark", drawing.mark, "hm"), ("home position", drawing.home, "hh")]
        for name, place, kind in labels:
            if place is None:
                continue
            x = self._x(place)
            words = f"{name} {short(place, 2)}"
            width = _LETTER * len(words) + 8.0
            middle = min(max(x, _LEFT + width / 2), _WIDTH - _RIGHT - width / 2)
            at, y = self._free.place([(middle, 12.0), (middle, 28.0)], width, 15.0)
            found.append(_line(x, x, y + 5.0, end, kind))
            found.append(_text(at, y + 3.0, words, kind + " hb", "middle"))
        return _group(found)

    def _breaks(self) -> Node:
        """Return the signs where the scale is broken: a stretch without any event is drawn shorter than it
        is.
        """
        found: list[Node] = []
        end = self._height - 34.0
        for low, high in self._scale.short:
            x = 0.5 * (self._x(low) + self._x(high))
            found.append(
                _node(
                    "rect",
                    {"x": x - 5.0, "y": _TOP, "width": 10.0, "height": end - _TOP + 3.0, "class": "hcut"},
                )
            )
            for side in (-5.0, 5.0):
                line = "".join(
                    f"{'M' if not number else 'L'}{x + side + (2.5 if number % 2 else -2.5):g} "
                    f"{_TOP + 12.0 * number:g}"
                    for number in range(int((end - _TOP) / 12.0) + 2)
                )
                found.append(_node("path", {"d": line, "class": "hzig"}))
            found.append(_node("title", {}, f"shortened: {short(low)} to {short(high)} {self._drawing.unit}"))
        return _group(found)

    def _lane_nodes(self) -> list[Node]:
        found = []
        for number, lane in enumerate(self._lanes):
            y = self._base + _LANE * number + (_LANE - _BAR) / 2 + 6.0
            parts: list[Node] = [
                _text(_LEFT - 6.0, y + 10.0, lane.name, "hl", "end"),
                _line(_LEFT, _WIDTH - _RIGHT, y + _BAR, y + _BAR, "hg"),
            ]
            parts += self._zero_marks(lane, y) if lane.name == "zero mark" else self._bars(lane, y)
            found.append(_group(parts, {"data-lane": lane.name}))
        return found

    def _zero_marks(self, lane: SwitchLane, y: float) -> list[Node]:
        found = []
        for place, _ in reversed(lane.bars):
            if self._scale.left_out(place):
                continue
            x, used = self._x(place), place == self._drawing.mark
            found.append(_line(x, x, y - (3.0 if used else 0.0), y + _BAR, "hz used" if used else "hz"))
        if not lane.bars:
            found.append(_text(_LEFT + 8.0, y + 9.0, "none was found", "hs", "start"))
        return found

    def _bars(self, lane: SwitchLane, y: float) -> list[Node]:
        found: list[Node] = []
        near = 0.004 * (self._high - self._low)
        kind = "hbar limit" if lane.name.endswith("limit") else "hbar"
        ends = [(edge.position, edge) for edge in lane.edges]
        for low, high in lane.bars:
            a, b = self._x(low), self._x(high)
            found.append(
                _node("rect", {"x": a, "y": y, "width": max(b - a, 1.5), "height": _BAR, "class": kind})
            )
            for place, anchor, shift in ((low, "end", -5.0), (high, "start", 5.0)):
                x = self._x(place)
                if any(abs(where - place) <= near for where, _ in ends):
                    found.append(_line(x, x, y - 4.0, y + _BAR, "hedge"))
                    found.append(_text(x + shift, y + 9.5, short(place), "hs", anchor))
        for place, edge in ends:
            x, d = self._x(place), 8.0 * (edge.direction or 1)
            title = (
                f"{lane.name} {'reached' if edge.active else 'left'} at {short(place, 2)} "
                f"{self._drawing.unit}, "
                f"{short(edge.time_s - self._drawing.begin_s, 4)} s"
            )
            found.append(
                _node(
                    "path",
                    {
                        "d": f"M{x:.1f} {y - 7.5:.1f}L{x + d:.1f} {y - 4:.1f}L{x:.1f} {y - 0.5:.1f}Z",
                        "class": "hedge",
                    },
                    _node("title", {}, title),
                )
            )
        if not lane.bars:
            found.append(_text(_LEFT + 8.0, y + 9.0, "never active", "hs", "start"))
        return found

    # -- curve
    # ------------------------------------------------------------------------------------------------

    def _points(self, step: HomingStep) -> list[tuple[float, float]]:
        """Return the curve of a travel, px, with the last point before it, so that there is no gap."""
        path = self._drawing.path
        inside = [point for point in path if step.begin_s - 1e-6 <= point[0] <= step.end_s + 1e-6]
        before = [point for point in path if point[0] < step.begin_s - 1e-6]
        return [(self._x(point[1]), self._y(point[2])) for point in [*before[-1:], *inside]]

    def _curves(self) -> Node:
        found: list[Node] = []
        for step, number in zip(self._drawing.steps, self._numbers, strict=True):
            if not step.travel:
                continue
            points = self._points(step)
            if len(points) < 2:
                continue
            line = "M" + "L".join(f"{x:g} {y:g}" for x, y in points)
            parts = [_node("path", {"d": line, "class": "hc"})]
            parts += [_arrow(*arrow) for arrow in _arrows(points)]
            found.append(_group(parts, {"class": f"hp-{step.name}", "data-step": number or None}))
            for (x0, y0), (x1, y1) in pairwise(points):
                pieces = int(math.dist((x0, y0), (x1, y1)) / 5.0) + 1
                for piece in range(pieces):
                    self._free.take(
                        x0 + (x1 - x0) * piece / pieces, y0 + (y1 - y0) * piece / pieces, 4.0, 4.0
                    )
        return _group(found)

    def _badges(self) -> Node:
        """Return the numbers: of moments on the curve, of travels beside its middle."""
        found: list[Node] = []
        steps = list(zip(self._drawing.steps, self._numbers, strict=True))
        for step, _number in steps:
            if not step.travel:
                x, y = self._x(step.begin), self._y(step.velocity)
                found.append(_node("circle", {"cx": x, "cy": y, "r": 3.5, "class": "hdot " + _mood(step)}))
                self._free.take(x, y, 8.0, 8.0)
        for step, number in steps:
            if not number:
                continue
            if step.travel:
                points = self._points(step)
                if len(points) < 2:
                    continue
                x, y = points[_middle(points)]
            else:
                x, y = self._x(step.begin), self._y(step.velocity)
            size = 2.0 * _RADIUS + 2.0
            up = -1.0 if step.velocity >= 0.0 else 1.0
            around = [
                (x + dx, y + up * dy)
                for reach in (17.0, 26.0, 36.0, 48.0, 62.0)
                for dx, dy in (
                    (0.0, reach),
                    (reach, 0.6 * reach),
                    (-reach, 0.6 * reach),
                    (reach, 0.0),
                    (-reach, 0.0),
                    (0.0, -reach),
                )
            ]
            inside = [
                (a, b)
                for a, b in around
                if _LEFT + _RADIUS < a < _WIDTH - _RADIUS - 2.0 and _TOP - 4.0 < b < self._base - 2.0
            ]
            a, b = self._free.place(inside or around, size, size)
            found.append(
                _group(
                    [
                        _line(a, x, b, y, "hlead"),
                        _node("circle", {"cx": round(a, 1), "cy": round(b, 1), "r": _RADIUS, "class": "hn"}),
                        _text(a, b + 4.0, str(number), "hnt", "middle"),
                        _node("title", {}, f"{number} {named(step)}"),
                    ],
                    {"class": f"hp-{step.name if step.travel else 'moment'}", "data-step": number},
                )
            )
        return _group(found)


def _mood(step: HomingStep) -> str:
    return {"mark": "hm", "home position": "hh"}.get(step.name, "")


def _middle(points: Sequence[tuple[float, float]]) -> int:
    """Return the index of the point at half of a curve."""
    total = sum(math.dist(a, b) for a, b in pairwise(points))
    gone = 0.0
    for index in range(1, len(points)):
        gone += math.dist(points[index - 1], points[index])
        if gone >= total / 2:
            return index
    return len(points) - 1


def _arrows(points: Sequence[tuple[float, float]]) -> list[tuple[float, float, float]]:
    """Return places and angles of arrow heads along a curve."""
    total = sum(math.dist(a, b) for a, b in pairwise(points))
    if total < 16.0:
        return []
    count = max(round(total / _ARROW_EVERY), 1)
    wanted = [(number + 0.62) * total / count for number in range(count)]
    found, gone = [], 0.0
    for (x0, y0), (x1, y1) in pairwise(points):
        length = math.dist((x0, y0), (x1, y1))
        while wanted and gone + length >= wanted[0]:
            part = (wanted.pop(0) - gone) / max(length, 1e-9)
            found.append((x0 + part * (x1 - x0), y0 + part * (y1 - y0), math.atan2(y1 - y0, x1 - x0)))
        gone += length
    return found


def _arrow(x: float, y: float, angle: float) -> Node:
    corners = ((6.0, 0.0), (-5.0, 4.5), (-5.0, -4.5))
    cos, sin = math.cos(angle), math.sin(angle)
    place = "L".join(f"{x + a * cos - b * sin:.1f} {y + a * sin + b * cos:.1f}" for a, b in corners)
    return _node("path", {"d": f"M{place}Z", "class": "ha"})


def _tick(value: float, span: float) -> str:
    return short(value, 0 if span > 15.0 else 2) if span > 1.0 else short(value, 3)


def _node(tag: str, attributes: dict[str, Any], *children: Any) -> Node:
    return [tag, {name: value for name, value in attributes.items() if value is not None}, list(children)]


def _group(children: list[Node], attributes: dict[str, Any] | None = None) -> Node:
    return _node("g", attributes or {}, *children)


def _line(x1: float, x2: float, y1: float, y2: float, kind: str) -> Node:
    places = {"x1": x1, "x2": x2, "y1": y1, "y2": y2}
    return _node("line", {name: round(value, 1) for name, value in places.items()} | {"class": kind})


def _text(x: float, y: float, words: str, kind: str, anchor: str) -> Node:
    return _node("text", {"x": round(x, 1), "y": round(y, 1), "class": kind, "text-anchor": anchor}, words)
